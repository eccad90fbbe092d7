//! The connection to the OpenVR runtime and the calls that this program makes, through its raw function tables. The safe
//! wrappers of the `openvr` crate panic where a runtime lacks an entry or returns an unknown value; these do not.

use std::ffi::{CStr, CString, c_char};
use std::ptr;

use openvr_sys as sys;

use super::actions::Hand;
use super::codes::Refusal;
use super::events::Event;
use super::frame_statistics::{FRAME_TIMING_BYTES, FrameTiming};
use super::optics::{Optics, matrix};
use crate::gpu::{Handles, foreign_call};
use crate::{Error, Result};

/// The number of poses that the runtime writes, one per device; the headset's is the first.
pub const DEVICES: usize = sys::k_unMaxTrackedDeviceCount as usize;
/// A limit for the lengths of names that a runtime reports; longer ones are invalid.
const LONGEST_TEXT: u32 = 1 << 16;
/// A limit for the triangles of a hidden area.
const MOST_TRIANGLES: u32 = 1 << 20;

/// Left or right.
pub const EYES: [sys::EVREye; 2] = [sys::EVREye_Eye_Left, sys::EVREye_Eye_Right];

/// The kind of application, for the runtime.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Shows pictures; starts the runtime's own programs if needed.
    Scene,
    /// Only queries the runtime.
    Background,
}

/// The connection; at most one at a time. It must be dropped before any Vulkan object that the runtime uses.
pub struct Runtime {
    system: *const sys::VR_IVRSystem_FnTable,
    compositor: *const sys::VR_IVRCompositor_FnTable,
    /// Null if the runtime has no input system.
    input: *const sys::VR_IVRInput_FnTable,
    /// Null if the runtime has no overlays.
    overlay: *const sys::VR_IVROverlay_FnTable,
    /// Whether the compositor leaves the program's queue alone in `wait_get_poses`.
    explicit_timing: bool,
}

impl Runtime {
    /// Connects; the caller guarantees that there is no other connection.
    pub fn start(role: Role) -> std::result::Result<Self, Refusal> {
        let kind = match role {
            Role::Scene => sys::EVRApplicationType_VRApplication_Scene,
            Role::Background => sys::EVRApplicationType_VRApplication_Background,
        };
        let mut code = sys::EVRInitError_VRInitError_None;
        // SAFETY: the call loads the runtime's library, which is what it is for; the pointer is good.
        unsafe { sys::VR_InitInternal(&mut code, kind) };
        if code != sys::EVRInitError_VRInitError_None {
            return Err(Refusal { code, words: words_of(code) });
        }
        // From here on, Drop disconnects whatever fails.
        let mut runtime = Self {
            system: ptr::null(),
            compositor: ptr::null(),
            input: ptr::null(),
            overlay: ptr::null(),
            explicit_timing: false,
        };
        runtime.system = table(sys::IVRSystem_Version)?;
        if role == Role::Scene {
            runtime.compositor = table(sys::IVRCompositor_Version)?;
            // Without input one can still look around.
            runtime.input = table(sys::IVRInput_Version).unwrap_or(ptr::null());
            runtime.overlay = table(sys::IVROverlay_Version).unwrap_or(ptr::null());
        }
        Ok(runtime)
    }

    /// Whether a device is connected and switched on; 0 is the headset.
    pub fn is_connected(&self, device: u32) -> bool {
        // SAFETY: the entry takes any index.
        self.system().IsTrackedDeviceConnected.is_none_or(|call| unsafe { call(device) })
    }

    /// The device that the runtime takes for the controller in the left, the right hand; `None` where there is none.
    pub fn device_in(&self, hand: Hand) -> Option<u32> {
        let role = match hand {
            Hand::Left => sys::ETrackedControllerRole_TrackedControllerRole_LeftHand,
            Hand::Right => sys::ETrackedControllerRole_TrackedControllerRole_RightHand,
        };
        // SAFETY: a value of the enumeration.
        let device = self.system().GetTrackedDeviceIndexForControllerRole.map(|call| unsafe { call(role) });
        device.filter(|device| (*device as usize) < DEVICES)
    }

    /// The headset's maker and model, as far as the runtime reports them.
    pub fn headset_name(&self) -> String {
        let of = |property| self.text(property).unwrap_or_default();
        let maker = of(sys::ETrackedDeviceProperty_Prop_ManufacturerName_String);
        let model = of(sys::ETrackedDeviceProperty_Prop_ModelNumber_String);
        match format!("{maker} {model}").trim() {
            "" => "unnamed headset".into(),
            name => name.to_owned(),
        }
    }

    /// The display's rate in Hz; `None` if the runtime does not know it.
    pub fn display_hertz(&self) -> Option<f32> {
        let call = self.system().GetFloatTrackedDeviceProperty?;
        let mut error = sys::ETrackedPropertyError_TrackedProp_Success;
        // SAFETY: the pointer is good for the call.
        let hertz = unsafe { call(0, sys::ETrackedDeviceProperty_Prop_DisplayFrequency_Float, &mut error) };
        let known = error == sys::ETrackedPropertyError_TrackedProp_Success && hertz.is_finite() && hertz > 0.0;
        known.then_some(hertz)
    }

    fn text(&self, property: sys::ETrackedDeviceProperty) -> Option<String> {
        let call = self.system().GetStringTrackedDeviceProperty?;
        let mut error = sys::ETrackedPropertyError_TrackedProp_Success;
        // SAFETY: buffer and size belong together (see `text_of`); the error pointer is good for the call.
        let text = text_of(|buffer, size| unsafe { call(0, property, buffer, size, &mut error) })?;
        Some(text.to_string_lossy().trim().to_owned())
    }

    /// Names of the Vulkan instance extensions that the runtime needs.
    pub fn instance_extensions(&self) -> Vec<CString> {
        let call = self.compositor().GetVulkanInstanceExtensionsRequired;
        // SAFETY: buffer and size belong together.
        words(call.and_then(|call| text_of(|buffer, size| unsafe { call(buffer, size) })))
    }

    /// The VkPhysicalDevice that the headset is connected to; 0 if the runtime names none.
    pub fn output_device(&self, instance: u64) -> u64 {
        let mut device = 0;
        if let Some(call) = self.system().GetOutputDevice {
            // SAFETY: `instance` is a live VkInstance; the pointer is good for the call.
            foreign_call(|| unsafe {
                call(&mut device, sys::ETextureType_TextureType_Vulkan, instance as *mut sys::VkInstance_T);
            });
        }
        device
    }

    /// Names of the Vulkan device extensions that the runtime needs on a VkPhysicalDevice.
    pub fn device_extensions(&self, physical: u64) -> Vec<CString> {
        let call = self.compositor().GetVulkanDeviceExtensionsRequired;
        let physical = physical as *mut sys::VkPhysicalDevice_T;
        // SAFETY: buffer and size belong together; the physical device is of a live instance.
        words(call.and_then(|call| text_of(|buffer, size| foreign_call(|| unsafe { call(physical, buffer, size) }))))
    }

    /// Pixels of each eye's picture, the user's own scale included.
    pub fn recommended_size(&self) -> Result<[u32; 2]> {
        let call = need(self.system().GetRecommendedRenderTargetSize, "GetRecommendedRenderTargetSize")?;
        let (mut width, mut height) = (0, 0);
        // SAFETY: both pointers are good for the call.
        unsafe { call(&mut width, &mut height) };
        if width == 0 || height == 0 {
            return Err(Error::Headset {
                problem: format!("its runtime asks for pictures of {width}x{height} pixels"),
            });
        }
        Ok([width, height])
    }

    /// The optics of one eye.
    pub fn optics(&self, eye: sys::EVREye) -> Result<Optics> {
        let raw = need(self.system().GetProjectionRaw, "GetProjectionRaw")?;
        let place = need(self.system().GetEyeToHeadTransform, "GetEyeToHeadTransform")?;
        let (mut left, mut right, mut top, mut bottom) = (0.0, 0.0, 0.0, 0.0);
        // SAFETY: all pointers are good for the call.
        let head_from_eye = unsafe {
            raw(eye, &mut left, &mut right, &mut top, &mut bottom);
            matrix(&place(eye))
        };
        Optics::new([left, right, top, bottom], head_from_eye)
    }

    /// The triangles of one eye that no lens shows, three corners each, in 0 to 1 of its picture; may be none.
    pub fn hidden_area(&self, eye: sys::EVREye) -> Vec<[f32; 2]> {
        let Some(call) = self.system().GetHiddenAreaMesh else { return Vec::new() };
        // SAFETY: the entry takes every eye and kind.
        let mesh = unsafe { call(eye, sys::EHiddenAreaMeshType_k_eHiddenAreaMesh_Standard) };
        if mesh.pVertexData.is_null() || mesh.unTriangleCount == 0 || mesh.unTriangleCount > MOST_TRIANGLES {
            return Vec::new();
        }
        // SAFETY: the runtime keeps three corners per triangle there, at least until the next event.
        let corners = unsafe { std::slice::from_raw_parts(mesh.pVertexData, 3 * mesh.unTriangleCount as usize) };
        corners.iter().map(|corner| corner.v).collect()
    }

    /// The oldest event not yet taken.
    pub fn next_event(&self) -> Option<Event> {
        let call = self.system().PollNextEvent?;
        let mut event = sys::VREvent_t::default();
        // SAFETY: the pointer is good for the call, the size is the structure's.
        let there = unsafe { call(&mut event, size_of::<sys::VREvent_t>() as u32) };
        there.then(|| Event::new(event.eventType, event.trackedDeviceIndex))
    }

    /// Acknowledges [`Event::Quit`]. Without that event, some runtimes abort.
    pub fn acknowledge_quit(&self) {
        if let Some(call) = self.system().AcknowledgeQuit_Exiting {
            // SAFETY: no arguments.
            unsafe { call() };
        }
    }

    /// Sets the standing tracking space and, if the compositor supports it, explicit timing, with which it leaves the
    /// program's queue alone.
    pub fn prepare(&mut self) {
        if let Some(call) = self.compositor().SetTrackingSpace {
            // SAFETY: a value of the enumeration.
            unsafe { call(sys::ETrackingUniverseOrigin_TrackingUniverseStanding) };
        }
        let calls = (self.compositor().SetExplicitTimingMode, self.compositor().PostPresentHandoff);
        if let (Some(call), Some(_)) = calls {
            let mode =
                sys::EVRCompositorTimingMode_VRCompositorTimingMode_Explicit_ApplicationPerformsPostPresentHandoff;
            // SAFETY: a value of the enumeration; `post_present_handoff` is called as it demands.
            unsafe { call(mode) };
            self.explicit_timing = true;
        }
    }

    /// Whether `wait_get_poses` leaves the program's queue alone.
    pub fn has_explicit_timing(&self) -> bool {
        self.explicit_timing
    }

    /// Waits until the next frame is due; fills every device's pose at the time it will be seen. Returns the code.
    /// Without explicit timing it uses the program's queue.
    pub fn wait_get_poses(&self, poses: &mut [sys::TrackedDevicePose_t; DEVICES]) -> Result<sys::EVRCompositorError> {
        let call = need(self.compositor().WaitGetPoses, "WaitGetPoses")?;
        // SAFETY: the array has as many poses as is said; no second array is asked for.
        Ok(foreign_call(|| unsafe { call(poses.as_mut_ptr(), DEVICES as u32, ptr::null_mut(), 0) }))
    }

    /// Tells the compositor where on the queue the frame begins. Uses the program's queue.
    pub fn submit_timing(&self) {
        if let Some(call) = self.compositor().SubmitExplicitTimingData.filter(|_| self.explicit_timing) {
            // SAFETY: no arguments. It only improves measurements: its code changes nothing.
            foreign_call(|| unsafe { call() });
        }
    }

    /// Submits one eye's picture: the part from 0, 0 to `bounds`. If the user has `jumped`, the compositor does not
    /// extrapolate from this frame and the one before. Returns the code. Uses the program's queue.
    pub fn submit(
        &self,
        eye: sys::EVREye,
        picture: &EyePicture,
        bounds: [f32; 2],
        jumped: bool,
    ) -> Result<sys::EVRCompositorError> {
        let call = need(self.compositor().Submit, "Submit")?;
        let mut data = picture.data();
        let mut texture = sys::Texture_t {
            handle: (&raw mut data).cast(),
            eType: sys::ETextureType_TextureType_Vulkan,
            eColorSpace: sys::EColorSpace_ColorSpace_Auto,
        };
        let mut bounds = sys::VRTextureBounds_t { uMin: 0.0, vMin: 0.0, uMax: bounds[0], vMax: bounds[1] };
        let flags = match jumped {
            true => sys::EVRSubmitFlags_Submit_FrameDiscontinuity,
            false => sys::EVRSubmitFlags_Submit_Default,
        };
        // SAFETY: structures and handles are good for the call; the image is in the layout it wants.
        Ok(foreign_call(|| unsafe { call(eye, &mut texture, &mut bounds, flags) }))
    }

    /// The compositor's timing of an earlier frame.
    pub fn frame_timing(&self, frames_ago: u32) -> Option<FrameTiming> {
        let call = self.compositor().GetFrameTiming?;
        let mut timing = sys::Compositor_FrameTiming { m_nSize: FRAME_TIMING_BYTES, ..Default::default() };
        // SAFETY: the structure is at least as long as it says.
        unsafe { call(&mut timing, frames_ago) }.then(|| FrameTiming::from(&timing))
    }

    /// Notifies the compositor that both eyes have been submitted. Uses the program's queue.
    pub fn post_present_handoff(&self) {
        if let Some(call) = self.compositor().PostPresentHandoff {
            // SAFETY: no arguments.
            foreign_call(|| unsafe { call() });
        }
    }

    /// The function table of the input system; `None` if there is none.
    pub fn input(&self) -> Option<&sys::VR_IVRInput_FnTable> {
        // SAFETY: null, or a table that the runtime keeps until it is disconnected, which `drop` does.
        unsafe { self.input.as_ref() }
    }

    /// The function table of overlays; `None` if there is none.
    pub fn overlay(&self) -> Option<&sys::VR_IVROverlay_FnTable> {
        // SAFETY: as for `input`.
        unsafe { self.overlay.as_ref() }
    }

    fn system(&self) -> &sys::VR_IVRSystem_FnTable {
        // SAFETY: `start` has got it from the runtime, which keeps it until `drop`.
        unsafe { &*self.system }
    }

    /// Only of a [`Role::Scene`].
    fn compositor(&self) -> &sys::VR_IVRCompositor_FnTable {
        assert!(!self.compositor.is_null(), "a background program has no compositor");
        // SAFETY: as above.
        unsafe { &*self.compositor }
    }
}

impl Drop for Runtime {
    fn drop(&mut self) {
        // SAFETY: `start` has connected; nothing uses the tables any more.
        foreign_call(|| unsafe { sys::VR_ShutdownInternal() });
    }
}

impl EyePicture {
    /// The same for the runtime.
    pub fn data(&self) -> sys::VRVulkanTextureData_t {
        let Handles { instance, physical, device, queue, family } = self.handles;
        sys::VRVulkanTextureData_t {
            m_nImage: self.image,
            m_pDevice: device as *mut _,
            m_pPhysicalDevice: physical as *mut _,
            m_pInstance: instance as *mut _,
            m_pQueue: queue as *mut _,
            m_nQueueFamilyIndex: family,
            m_nWidth: self.size[0],
            m_nHeight: self.size[1],
            m_nFormat: self.format,
            m_nSampleCount: 1,
        }
    }
}

/// One eye's image, or an overlay's, as the runtime requires it: 2D, one sample, in a layout to be copied from.
pub struct EyePicture {
    pub handles: Handles,
    /// VkImage.
    pub image: u64,
    pub size: [u32; 2],
    /// VkFormat.
    pub format: u32,
}

fn table<T>(version: &[u8]) -> std::result::Result<*const T, Refusal> {
    // The header's names end in NUL.
    let name = [b"FnTable:".as_slice(), version].concat();
    let mut code = sys::EVRInitError_VRInitError_None;
    // SAFETY: the name ends in NUL; the pointer is good for the call.
    let table = unsafe { sys::VR_GetGenericInterface(name.as_ptr().cast(), &mut code) };
    if code == sys::EVRInitError_VRInitError_None && table != 0 {
        Ok(table as *const T)
    } else {
        let code = sys::EVRInitError_VRInitError_Init_InterfaceNotFound;
        Err(Refusal { code, words: String::from_utf8_lossy(version).trim_end_matches('\0').to_owned() })
    }
}

fn need<T>(entry: Option<T>, name: &str) -> Result<T> {
    entry.ok_or_else(|| Error::Headset { problem: format!("its runtime lacks {name}; update it") })
}

/// The loader's name for an error.
fn words_of(code: sys::EVRInitError) -> String {
    // SAFETY: the call takes any code.
    let text = unsafe { sys::VR_GetVRInitErrorAsEnglishDescription(code) };
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and the loader ends its texts in NUL.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Reads a string by two calls, the first for its size (with NUL). `None` if there is none.
fn text_of(mut ask: impl FnMut(*mut c_char, u32) -> u32) -> Option<CString> {
    let size = ask(ptr::null_mut(), 0);
    if !(1..=LONGEST_TEXT).contains(&size) {
        return None;
    }
    let mut bytes = vec![0u8; size as usize];
    ask(bytes.as_mut_ptr().cast(), size);
    CStr::from_bytes_until_nul(&bytes).ok().map(CStr::to_owned)
}

fn words(text: Option<CString>) -> Vec<CString> {
    let text = text.unwrap_or_default();
    let split = text.as_bytes().split(|byte| byte.is_ascii_whitespace()).filter(|word| !word.is_empty());
    split.filter_map(|word| CString::new(word).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_asked_for_twice_and_may_be_missing_or_absurd() {
        let speak = |text: &'static [u8]| {
            move |buffer: *mut c_char, size: u32| {
                if size as usize >= text.len() {
                    // SAFETY: the buffer is `size` bytes long.
                    unsafe { ptr::copy_nonoverlapping(text.as_ptr(), buffer.cast(), text.len()) };
                }
                text.len() as u32
            }
        };
        assert_eq!(text_of(speak(b"VK_A VK_B\0")).as_deref(), Some(c"VK_A VK_B"));
        assert_eq!(text_of(speak(b"\0")).as_deref(), Some(c""));
        assert_eq!(text_of(speak(b"")), None);
        assert_eq!(text_of(|_, _| u32::MAX), None);
        assert_eq!(text_of(|buffer, _| if buffer.is_null() { 4 } else { 0 }).as_deref(), Some(c""));
    }

    #[test]
    fn extension_lists_may_be_empty_and_have_stray_spaces() {
        assert_eq!(words(None), Vec::<CString>::new());
        assert_eq!(words(Some(c"  VK_A  VK_B ".to_owned())), [c"VK_A".to_owned(), c"VK_B".to_owned()]);
    }
}
