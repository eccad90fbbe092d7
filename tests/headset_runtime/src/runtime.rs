//! The runtime's one state, from Init to Cleanup.

use std::collections::VecDeque;
use std::process;
use std::sync::{Arc, Mutex, PoisonError};

use glam::Affine3A;
use openvr_sys as sys;
use serde_json::{Value, json};

use crate::frame_times::FrameTimes;
use crate::images::Images;
use crate::input::Actions;
use crate::log::Log;
use crate::overlay::Overlays;
use crate::pace::Pace;
use crate::script::{EyeOptics, Script};

/// All that a function needs; the tables' functions reach it through `with`.
pub struct Runtime {
    pub script: Arc<Script>,
    pub log: Log,
    /// Count of WaitGetPoses so far.
    pub frame: u64,
    /// As they are now: left and right.
    pub eyes: [EyeOptics; 2],
    /// Corners of what the lenses hide, as handed out.
    pub hidden: [Vec<sys::HmdVector2_t>; 2],
    pub events: VecDeque<sys::VREvent_t>,
    pub is_connected: bool,
    pub was_told_to_quit: bool,
    pub space: sys::ETrackingUniverseOrigin,
    /// Where the seated space's origin is in the standing one.
    pub standing_from_seated: Affine3A,
    /// Which eyes this frame has had, and whether it was handed over.
    pub submitted: [bool; 2],
    pub is_handed_off: bool,
    pub timing_mode: sys::EVRCompositorTimingMode,
    pub images: Images,
    pub actions: Actions,
    pub pace: Pace,
    pub times: FrameTimes,
    pub overlays: Overlays,
}

static RUNTIME: Mutex<Option<Runtime>> = Mutex::new(None);

impl Runtime {
    pub fn new(script: Script, log: Log, times: FrameTimes) -> Self {
        let corners =
            |eye: &EyeOptics| eye.hidden_triangles.iter().flatten().map(|v| sys::HmdVector2_t { v: *v }).collect();
        Self {
            log,
            frame: 0,
            eyes: [script.left.clone(), script.right.clone()],
            hidden: [corners(&script.left), corners(&script.right)],
            events: VecDeque::new(),
            is_connected: true,
            was_told_to_quit: false,
            space: sys::ETrackingUniverseOrigin_TrackingUniverseStanding,
            standing_from_seated: Affine3A::IDENTITY,
            submitted: [false; 2],
            is_handed_off: false,
            timing_mode: sys::EVRCompositorTimingMode_VRCompositorTimingMode_Implicit,
            images: Images::new(script.output.clone(), script.copies),
            actions: Actions::default(),
            pace: Pace::new(script.hz, script.is_paced),
            times,
            overlays: Overlays::default(),
            script: Arc::new(script),
        }
    }

    /// Logs one.
    pub fn call(&mut self, name: &str, details: Value) {
        self.log.call(self.frame, name, &details);
    }

    /// Logs what no program should do.
    pub fn fault(&mut self, problem: &str) {
        eprintln!("headset runtime: {problem}");
        self.call("Fault", json!({ "problem": problem }));
    }

    /// Queues an event about a device.
    pub fn post(&mut self, number: u32, device: u32) {
        let mut event = sys::VREvent_t { eventType: number, trackedDeviceIndex: device, ..Default::default() };
        if number == sys::EVREventType_VREvent_IpdChanged as u32 {
            let apart = self.eyes[1].position[0] - self.eyes[0].position[0];
            event.data = sys::VREvent_Data_t { ipd: sys::VREvent_Ipd_t { ipdMeters: apart } };
        }
        self.was_told_to_quit |= number == sys::EVREventType_VREvent_Quit as u32;
        self.events.push_back(event);
    }
}

pub fn start(runtime: Runtime) {
    *RUNTIME.lock().unwrap_or_else(PoisonError::into_inner) = Some(runtime);
}

/// Cleanup: waits for the program's device, as runtimes do, and frees what is ours on it.
pub fn stop() {
    let stopped = RUNTIME.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(mut runtime) = stopped {
        let overlays = runtime.overlays.count();
        runtime.call("Cleanup", json!({ "overlays": overlays }));
        runtime.times.end();
        runtime.images.close();
        runtime.call("CleanupDone", json!({ "copied": runtime.images.copied }));
    }
}

/// Calls `f` with the state. A call before Init or after Cleanup is the program's fault and ends it, as in some runtimes.
pub fn with<T>(f: impl FnOnce(&mut Runtime) -> T) -> T {
    let mut state = RUNTIME.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(runtime) = state.as_mut() else {
        eprintln!("headset runtime: called before Init or after Cleanup");
        process::abort();
    };
    f(runtime)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the loader and the programs compiled against OpenVR's own headers take for granted, on 64-bit Linux and Windows.
    #[test]
    fn structures_have_the_sizes_of_the_c_headers() {
        let padded = if cfg!(windows) { 64 } else { 60 };
        assert_eq!(size_of::<sys::VREvent_t>(), padded);
        assert_eq!(size_of::<sys::TrackedDevicePose_t>(), 80);
        assert_eq!(size_of::<sys::VRVulkanTextureData_t>(), 64);
        assert_eq!(size_of::<sys::Texture_t>(), 16);
        assert_eq!(size_of::<sys::HiddenAreaMesh_t>(), 16);
    }
}
