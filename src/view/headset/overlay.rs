//! An overlay on the runtime's dashboard or fixed to a controller: its picture, and the laser mouse that points at it. Raw
//! calls of IVROverlay.

use std::ffi::CStr;

use glam::Mat4;
use openvr_sys as sys;
use sys::VR_IVROverlay_FnTable as Table;

use super::optics::rows;
use super::runtime::EyePicture;
use crate::gpu::foreign_call;

/// The overlays' keys, which no other program may have, and the name that people read.
const DASHBOARD_KEY: &CStr = c"pbr-vr.panel";
const HELD_KEY: &CStr = c"pbr-vr.panel-at-hand";
const NAME: &CStr = c"pbr-vr";
/// Width on the dashboard, metres.
const DASHBOARD_METRES: f32 = 1.2;

/// What the laser mouse does, pixels of the overlay from its upper left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pointer {
    Move([f32; 2]),
    /// The main button is pressed or released.
    Button {
        at: [f32; 2],
        pressed: bool,
    },
    /// Steps of a wheel, to the right and away from the hand.
    Scroll([f32; 2]),
    /// It points at something else.
    Gone,
}

/// The overlay. The function table is passed to each call instead of being kept: it is valid only while the runtime is
/// connected, which removes the overlay when it ends.
pub struct Overlay {
    handle: sys::VROverlayHandle_t,
    size: [u32; 2],
}

impl Overlay {
    /// Puts an overlay of `size` pixels on the dashboard.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub fn on_dashboard(table: &Table, size: [u32; 2]) -> Result<Self, String> {
        let create = table.CreateDashboardOverlay.ok_or("the runtime lacks CreateDashboardOverlay")?;
        let [key, name] = [DASHBOARD_KEY, NAME].map(|text| text.as_ptr().cast_mut());
        let (mut handle, mut thumbnail) = (0, 0);
        // SAFETY: both texts end in NUL and are only read; the pointers are good for the call.
        accepted("CreateDashboardOverlay", unsafe { create(key, name, &mut handle, &mut thumbnail) })?;
        Self { handle, size }.set_up(table, DASHBOARD_METRES)
    }

    /// Makes a hidden overlay of `size` pixels and so many metres that can be fixed to a controller.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub fn held(table: &Table, size: [u32; 2], width_metres: f32) -> Result<Self, String> {
        let create = table.CreateOverlay.ok_or("the runtime lacks CreateOverlay")?;
        let [key, name] = [HELD_KEY, NAME].map(|text| text.as_ptr().cast_mut());
        let mut handle = 0;
        // SAFETY: as above.
        accepted("CreateOverlay", unsafe { create(key, name, &mut handle) })?;
        Self { handle, size }.set_up(table, width_metres)
    }

    /// Sets width and input; an overlay that cannot have them is destroyed.
    fn set_up(self, table: &Table, width_metres: f32) -> Result<Self, String> {
        match self.accept_mouse(table, width_metres) {
            Ok(()) => Ok(self),
            Err(why) => {
                self.destroy(table);
                Err(why)
            }
        }
    }

    /// Removes it from the runtime; one that stays is removed by VR_Shutdown (openvr.h, IVROverlay::DestroyOverlay).
    pub fn destroy(self, table: &Table) {
        if let Some(destroy) = table.DestroyOverlay {
            // SAFETY: takes any handle.
            unsafe { destroy(self.handle) };
        }
    }

    fn accept_mouse(&self, table: &Table, width_metres: f32) -> Result<(), String> {
        if let Some(call) = table.SetOverlayWidthInMeters {
            // SAFETY: takes any handle and width.
            accepted("SetOverlayWidthInMeters", unsafe { call(self.handle, width_metres) })?;
        }
        let call = table.SetOverlayInputMethod.ok_or("the runtime lacks SetOverlayInputMethod")?;
        // SAFETY: a value of the enumeration.
        accepted("SetOverlayInputMethod", unsafe { call(self.handle, sys::VROverlayInputMethod_Mouse) })?;
        let call = table.SetOverlayMouseScale.ok_or("the runtime lacks SetOverlayMouseScale")?;
        let mut scale = sys::HmdVector2_t { v: self.size.map(|side| side as f32) };
        // SAFETY: the pointer is good for the call.
        accepted("SetOverlayMouseScale", unsafe { call(self.handle, &mut scale) })?;
        // Without the flag there are no scroll events, and nothing else is missing.
        let _ = self.set_flag(table, sys::VROverlayFlags_SendVRSmoothScrollEvents, true);
        Ok(())
    }

    fn set_flag(&self, table: &Table, flag: sys::VROverlayFlags, on: bool) -> Result<(), String> {
        let call = table.SetOverlayFlag.ok_or("the runtime lacks SetOverlayFlag")?;
        // SAFETY: a value of the enumeration.
        accepted("SetOverlayFlag", unsafe { call(self.handle, flag, on) })
    }

    /// What [`TextureCall::show`] knows it by.
    pub fn handle(&self) -> sys::VROverlayHandle_t {
        self.handle
    }

    /// Fixes it to a device.
    ///
    /// # Errors
    /// The call and the runtime's code.
    pub fn fix_to(&self, table: &Table, device: u32, device_from_overlay: &Mat4) -> Result<(), String> {
        let call = table.SetOverlayTransformTrackedDeviceRelative;
        let call = call.ok_or("the runtime lacks SetOverlayTransformTrackedDeviceRelative")?;
        let mut place = rows(device_from_overlay);
        // SAFETY: the pointer is good for the call, which takes any handle and device.
        accepted("SetOverlayTransformTrackedDeviceRelative", unsafe { call(self.handle, device, &mut place) })
    }

    /// Shows or hides it; not for one on the dashboard.
    ///
    /// # Errors
    /// The call and the runtime's code.
    pub fn set_shown(&self, table: &Table, shown: bool) -> Result<(), String> {
        let (call, name) = match shown {
            true => (table.ShowOverlay, "ShowOverlay"),
            false => (table.HideOverlay, "HideOverlay"),
        };
        let call = call.ok_or_else(|| format!("the runtime lacks {name}"))?;
        // SAFETY: takes any handle.
        accepted(name, unsafe { call(self.handle) })
    }

    /// Turns the laser mouse on or off for as long as the overlay is visible.
    ///
    /// # Errors
    /// The call and the runtime's code.
    pub fn set_laser(&self, table: &Table, on: bool) -> Result<(), String> {
        self.set_flag(table, sys::VROverlayFlags_MakeOverlaysInteractiveIfVisible, on)
    }

    /// Whether it can be seen now.
    pub fn is_visible(&self, table: &Table) -> bool {
        // SAFETY: takes any handle.
        table.IsOverlayVisible.is_some_and(|call| unsafe { call(self.handle) })
    }

    /// The oldest event of the laser mouse not yet taken; events of other kinds are dropped.
    pub fn next_event(&self, table: &Table) -> Option<Pointer> {
        let call = table.PollNextOverlayEvent?;
        loop {
            let mut event = sys::VREvent_t::default();
            // SAFETY: the pointer is good for the call, the size is the structure's.
            if !unsafe { call(self.handle, &mut event, size_of::<sys::VREvent_t>() as u32) } {
                return None;
            }
            if let Some(pointer) = self.pointer(&event) {
                return Some(pointer);
            }
        }
    }

    #[allow(clippy::unnecessary_cast, reason = "enumerations of C are signed with MSVC and unsigned elsewhere")]
    fn pointer(&self, event: &sys::VREvent_t) -> Option<Pointer> {
        let kind = event.eventType as sys::EVREventType;
        // SAFETY: every variant of the union is plain numbers, and these kinds of events fill these variants.
        let (mouse, scroll) = unsafe { (event.data.mouse, event.data.scroll) };
        // OpenVR's origin is the lower left corner.
        let at = [mouse.x, self.size[1] as f32 - mouse.y];
        let is_main = mouse.button == sys::EVRMouseButton_VRMouseButton_Left as u32;
        match kind {
            sys::EVREventType_VREvent_MouseMove => Some(Pointer::Move(at)),
            sys::EVREventType_VREvent_MouseButtonDown if is_main => Some(Pointer::Button { at, pressed: true }),
            sys::EVREventType_VREvent_MouseButtonUp if is_main => Some(Pointer::Button { at, pressed: false }),
            sys::EVREventType_VREvent_ScrollSmooth | sys::EVREventType_VREvent_ScrollDiscrete => {
                Some(Pointer::Scroll([scroll.xdelta, scroll.ydelta]))
            }
            sys::EVREventType_VREvent_FocusLeave => Some(Pointer::Gone),
            _ => None,
        }
    }
}

/// The entry that gives an overlay its picture. Unlike the table it may be kept, and called by another thread: openvr.h
/// restricts SetOverlayTexture to the overlay's process, not to a thread. (OpenGL's textures belong to a context, and so
/// to a thread; Vulkan's do not.)
#[derive(Clone, Copy)]
pub struct TextureCall(unsafe extern "C" fn(sys::VROverlayHandle_t, *mut sys::Texture_t) -> sys::EVROverlayError);

impl TextureCall {
    /// # Errors
    /// The runtime lacks it.
    ///
    /// # Safety
    /// It must not be used once the runtime is disconnected.
    pub unsafe fn new(table: &Table) -> Result<Self, String> {
        Ok(Self(table.SetOverlayTexture.ok_or("the runtime lacks SetOverlayTexture")?))
    }

    /// Shows a picture, in layout TRANSFER_SRC_OPTIMAL, from now on. Uses the program's queue.
    ///
    /// # Errors
    /// The call and the runtime's code.
    pub fn show(self, overlay: sys::VROverlayHandle_t, picture: &EyePicture) -> Result<(), String> {
        let mut data = picture.data();
        let mut texture = sys::Texture_t {
            handle: (&raw mut data).cast(),
            eType: sys::ETextureType_TextureType_Vulkan,
            eColorSpace: sys::EColorSpace_ColorSpace_Auto,
        };
        // SAFETY: structures and handles are good for the call; the image is in the layout it wants; the runtime is
        // connected, as promised to `new`.
        accepted("SetOverlayTexture", foreign_call(|| unsafe { (self.0)(overlay, &mut texture) }))
    }
}

fn accepted(call: &str, code: sys::EVROverlayError) -> Result<(), String> {
    let is_fine = code == sys::EVROverlayError_VROverlayError_None;
    if is_fine { Ok(()) } else { Err(format!("{call} returns {code}")) }
}
