//! IVRCompositor: the pace of frames, poses, what is submitted, and frame timing.

use std::ffi::{CString, c_char, c_void};
use std::process;
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::{Duration, Instant};

use openvr_sys as sys;
use serde_json::json;

use crate::client_core::NOTHING;
use crate::images::Submitted;
use crate::pace::PastFrame;
use crate::runtime::{Runtime, with};
use crate::script::lasts;
use crate::system::{copy_string, eye_index};
use crate::tracking::HEAD;

static TABLE: LazyLock<sys::VR_IVRCompositor_FnTable> = LazyLock::new(|| sys::VR_IVRCompositor_FnTable {
    SetTrackingSpace: Some(set_tracking_space),
    GetTrackingSpace: Some(tracking_space),
    WaitGetPoses: Some(wait_get_poses),
    GetLastPoses: Some(last_poses),
    Submit: Some(submit),
    ClearLastSubmittedFrame: Some(clear_last_submitted_frame),
    PostPresentHandoff: Some(post_present_handoff),
    GetFrameTiming: Some(frame_timing),
    GetFrameTimeRemaining: Some(frame_time_remaining),
    GetCumulativeStats: Some(cumulative_stats),
    FadeToColor: Some(fade_to_color),
    FadeGrid: Some(fade_grid),
    IsFullscreen: Some(yes),
    CanRenderScene: Some(yes),
    ShouldAppRenderWithLowResources: Some(no),
    SuspendRendering: Some(suspend_rendering),
    GetVulkanInstanceExtensionsRequired: Some(instance_extensions),
    GetVulkanDeviceExtensionsRequired: Some(device_extensions),
    SetExplicitTimingMode: Some(set_explicit_timing_mode),
    SubmitExplicitTimingData: Some(submit_explicit_timing_data),
    IsMotionSmoothingEnabled: Some(no),
    IsMotionSmoothingSupported: Some(no),
    ..Default::default()
});

pub fn table() -> *mut c_void {
    (&raw const *TABLE).cast_mut().cast()
}

const OK: sys::EVRCompositorError = sys::EVRCompositorError_VRCompositorError_None;

unsafe extern "C" fn set_tracking_space(space: sys::ETrackingUniverseOrigin) {
    with(|r| {
        r.space = space;
        r.call("SetTrackingSpace", json!({ "space": space }));
    });
}

unsafe extern "C" fn tracking_space() -> sys::ETrackingUniverseOrigin {
    with(|r| r.space)
}

unsafe extern "C" fn wait_get_poses(
    render: *mut sys::TrackedDevicePose_t,
    render_count: u32,
    game: *mut sys::TrackedDevicePose_t,
    game_count: u32,
) -> sys::EVRCompositorError {
    let (vsync, missed) = with(|r| {
        r.call("WaitGetPoses", NOTHING);
        r.times.wait_begins();
        // This mode promises it, so that waiting may leave the queue alone.
        let promised =
            sys::EVRCompositorTimingMode_VRCompositorTimingMode_Explicit_ApplicationPerformsPostPresentHandoff;
        if r.timing_mode == promised && r.submitted != [false; 2] && !r.is_handed_off {
            r.fault("WaitGetPoses without the PostPresentHandoff that was promised");
        }
        r.pace.next_vsync(Instant::now())
    });
    // Not under the lock: other threads may ask for other things meanwhile.
    thread::sleep(vsync.saturating_duration_since(Instant::now()));
    with(|r| {
        begin_frame(r, vsync, missed);
        let error = r.script.wait_error.iter().find(|e| lasts(r.frame, e.frame, e.last));
        let code = error.map_or(OK, |e| e.code as sys::EVRCompositorError);
        if code == OK {
            // SAFETY: the interface asks for room for so many poses, or null.
            unsafe {
                r.fill(render, render_count, r.frame, r.space);
                r.fill(game, game_count, r.frame + 1, r.space);
            }
        }
        r.times.frame_begins(r.frame, missed);
        r.call("Frame", json!({ "code": code, "missed": missed }));
        code
    })
}

/// Everything that the script has for this frame.
fn begin_frame(r: &mut Runtime, vsync: Instant, missed: u32) {
    r.frame += 1;
    let frame = r.frame;
    (r.submitted, r.is_handed_off) = ([false; 2], false);
    r.images.collect(frame);
    let script = Arc::clone(&r.script);
    if script.die.iter().any(|d| d.frame == frame) {
        r.call("Die", NOTHING);
        process::abort();
    }
    let scripted = script.timing.iter().find(|t| lasts(frame, t.frame, t.last));
    let past = match scripted {
        Some(t) => PastFrame {
            frame,
            presents: t.presents,
            dropped: t.dropped,
            reprojection_flags: t.reprojection_flags,
            ..Default::default()
        },
        None => PastFrame { frame, presents: 1 + missed, dropped: missed, ..Default::default() },
    };
    r.pace.begin(past, vsync);
    for ipd in script.ipd.iter().filter(|i| i.frame == frame) {
        r.eyes[0].position[0] = -0.5 * ipd.metres;
        r.eyes[1].position[0] = 0.5 * ipd.metres;
        r.post(sys::EVREventType_VREvent_IpdChanged as u32, HEAD);
    }
    for lens in script.lens.iter().filter(|l| l.frame == frame) {
        r.eyes[0].tangents = lens.left_tangents;
        r.eyes[1].tangents = lens.right_tangents;
        r.post(sys::EVREventType_VREvent_LensDistortionChanged as u32, HEAD);
    }
    for presence in script.headset.iter().filter(|h| h.frame == frame) {
        r.is_connected = presence.connected;
        let number = if presence.connected {
            sys::EVREventType_VREvent_TrackedDeviceActivated
        } else {
            sys::EVREventType_VREvent_TrackedDeviceDeactivated
        };
        r.post(number as u32, HEAD);
    }
    for event in script.event.iter().filter(|e| e.frame == frame) {
        r.post(event.number, event.device);
    }
}

unsafe extern "C" fn last_poses(
    render: *mut sys::TrackedDevicePose_t,
    render_count: u32,
    game: *mut sys::TrackedDevicePose_t,
    game_count: u32,
) -> sys::EVRCompositorError {
    with(|r| {
        // SAFETY: the interface asks for room for so many poses, or null.
        unsafe {
            r.fill(render, render_count, r.frame, r.space);
            r.fill(game, game_count, r.frame + 1, r.space);
        }
    });
    OK
}

unsafe extern "C" fn submit(
    eye: sys::EVREye,
    texture: *mut sys::Texture_t,
    bounds: *mut sys::VRTextureBounds_t,
    flags: sys::EVRSubmitFlags,
) -> sys::EVRCompositorError {
    let block = with(|r| {
        r.times.submit_begins();
        let block = r.script.block_submit.iter().find(|b| b.frame == r.frame && eye_index(eye) == 0);
        block.map(|b| Duration::from_secs_f32(b.seconds))
    });
    if let Some(block) = block {
        with(|r| r.call("SubmitBlocks", NOTHING));
        thread::sleep(block);
    }
    // SAFETY: the interface asks for a texture whose handle is one of Vulkan's, and for null or bounds.
    let submitted = unsafe { Submitted::read(eye_index(eye), texture, bounds) };
    with(|r| {
        let code = match &submitted {
            Ok(submitted) => accept(r, eye, submitted),
            Err(code) => *code,
        };
        let what = submitted.as_ref().map_or(NOTHING, Submitted::details);
        r.call("Submit", json!({ "eye": eye, "flags": flags, "code": code, "image": what }));
        r.times.submit_ends();
        code
    })
}

fn accept(r: &mut Runtime, eye: sys::EVREye, submitted: &Submitted) -> sys::EVRCompositorError {
    if let Some(error) = r.script.submit_error.iter().find(|e| lasts(r.frame, e.frame, e.last)) {
        return error.code as sys::EVRCompositorError;
    }
    if r.frame == 0 {
        return sys::EVRCompositorError_VRCompositorError_DoNotHaveFocus;
    }
    if std::mem::replace(&mut r.submitted[eye_index(eye)], true) {
        return sys::EVRCompositorError_VRCompositorError_AlreadySubmitted;
    }
    if r.script.bad_vulkan.contains(&r.frame) {
        r.images.misbehave();
    }
    match r.images.copy(submitted, r.frame, r.script.shows(r.frame), r.script.show_border) {
        Ok(()) => OK,
        Err(code) => code,
    }
}

unsafe extern "C" fn clear_last_submitted_frame() {
    with(|r| r.call("ClearLastSubmittedFrame", NOTHING));
}

unsafe extern "C" fn post_present_handoff() {
    with(|r| {
        r.is_handed_off = true;
        r.call("PostPresentHandoff", NOTHING);
    });
}

unsafe extern "C" fn frame_timing(timing: *mut sys::Compositor_FrameTiming, frames_ago: u32) -> bool {
    with(|r| {
        // SAFETY: the interface asks for a structure that begins with its own size.
        let size = unsafe { (*timing).m_nSize } as usize;
        // The header packs to four bytes but on Windows; both are taken.
        if size != 188 && size != 192 {
            r.fault(&format!("GetFrameTiming wants {size} bytes"));
            return false;
        }
        let Some(past) = r.pace.ago(frames_ago as usize) else { return false };
        let told = sys::Compositor_FrameTiming {
            m_nSize: u32::try_from(size).unwrap_or(0),
            m_nFrameIndex: u32::try_from(past.frame).unwrap_or(u32::MAX),
            m_nNumFramePresents: past.presents,
            m_nNumDroppedFrames: past.dropped,
            m_nReprojectionFlags: past.reprojection_flags,
            m_flSystemTimeInSeconds: r.pace.seconds(),
            m_flClientFrameIntervalMs: past.interval_ms,
            m_HmdPose: r.pose(HEAD, past.frame, r.space),
            ..Default::default()
        };
        // The program's structure may be shorter than ours.
        let bytes = size.min(size_of::<sys::Compositor_FrameTiming>());
        // SAFETY: both are at least this long.
        unsafe { std::ptr::copy_nonoverlapping((&raw const told).cast::<u8>(), timing.cast::<u8>(), bytes) };
        true
    })
}

unsafe extern "C" fn frame_time_remaining() -> f32 {
    with(|r| (1.0 / r.pace.hz - r.pace.seconds_since_vsync()).max(0.0))
}

unsafe extern "C" fn cumulative_stats(stats: *mut sys::Compositor_CumulativeStats, size: u32) {
    let told = with(|r| sys::Compositor_CumulativeStats {
        m_nPid: process::id(),
        m_nNumFramePresents: r.pace.presents,
        m_nNumDroppedFrames: r.pace.dropped,
        m_nNumReprojectedFrames: r.pace.reprojected,
        ..Default::default()
    });
    let bytes = (size as usize).min(size_of::<sys::Compositor_CumulativeStats>());
    // SAFETY: the interface asks for `size` bytes.
    unsafe { std::ptr::copy_nonoverlapping((&raw const told).cast::<u8>(), stats.cast::<u8>(), bytes) };
}

unsafe extern "C" fn fade_to_color(seconds: f32, red: f32, green: f32, blue: f32, alpha: f32, background: bool) {
    let color = [red, green, blue, alpha];
    with(|r| r.call("FadeToColor", json!({ "seconds": seconds, "color": color, "background": background })));
}

unsafe extern "C" fn fade_grid(seconds: f32, fade_in: bool) {
    with(|r| r.call("FadeGrid", json!({ "seconds": seconds, "in": fade_in })));
}

unsafe extern "C" fn yes() -> bool {
    true
}

unsafe extern "C" fn no() -> bool {
    false
}

unsafe extern "C" fn suspend_rendering(suspend: bool) {
    with(|r| r.call("SuspendRendering", json!({ "suspend": suspend })));
}

/// 0 where there is nothing to name, as runtimes do.
fn names(names: &str, target: *mut c_char, size: u32) -> u32 {
    let Ok(text) = CString::new(names) else { return 0 };
    // SAFETY: the interface asks for room for `size` bytes.
    if names.is_empty() { 0 } else { unsafe { copy_string(&text, target, size) } }
}

unsafe extern "C" fn instance_extensions(target: *mut c_char, size: u32) -> u32 {
    with(|r| {
        r.call("GetVulkanInstanceExtensionsRequired", json!({ "size": size }));
        names(&r.script.instance_extensions, target, size)
    })
}

unsafe extern "C" fn device_extensions(device: *mut sys::VkPhysicalDevice_T, target: *mut c_char, size: u32) -> u32 {
    with(|r| {
        let details = json!({ "size": size, "physical_device": device as u64 });
        r.call("GetVulkanDeviceExtensionsRequired", details);
        names(&r.script.device_extensions, target, size)
    })
}

unsafe extern "C" fn set_explicit_timing_mode(mode: sys::EVRCompositorTimingMode) {
    with(|r| {
        r.timing_mode = mode;
        r.call("SetExplicitTimingMode", json!({ "mode": mode }));
    });
}

unsafe extern "C" fn submit_explicit_timing_data() -> sys::EVRCompositorError {
    with(|r| r.call("SubmitExplicitTimingData", NOTHING));
    OK
}
