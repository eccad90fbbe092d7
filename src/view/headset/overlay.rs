//! An overlay on the runtime's dashboard: its picture, and the laser mouse that points at it. Raw calls of IVROverlay.

use std::ffi::CStr;

use openvr_sys as sys;
use sys::VR_IVROverlay_FnTable as Table;

use super::runtime::EyePicture;
use crate::gpu::foreign_call;

/// The overlay's key, which no other program may have, and the name under its icon.
const KEY: &CStr = c"pbr-vr.panel";
const NAME: &CStr = c"pbr-vr";
/// Width on the dashboard, metres.
const WIDTH_METRES: f32 = 1.2;

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
    pub fn new(table: &Table, size: [u32; 2]) -> Result<Self, String> {
        let create = table.CreateDashboardOverlay.ok_or("the runtime lacks CreateDashboardOverlay")?;
        let (mut handle, mut thumbnail) = (0, 0);
        // SAFETY: both texts end in NUL and are only read; the pointers are good for the call.
        let code = unsafe { create(KEY.as_ptr().cast_mut(), NAME.as_ptr().cast_mut(), &mut handle, &mut thumbnail) };
        accepted("CreateDashboardOverlay", code)?;
        let overlay = Self { handle, size };
        overlay.accept_mouse(table)?;
        Ok(overlay)
    }

    fn accept_mouse(&self, table: &Table) -> Result<(), String> {
        if let Some(call) = table.SetOverlayWidthInMeters {
            // SAFETY: takes any handle and width.
            accepted("SetOverlayWidthInMeters", unsafe { call(self.handle, WIDTH_METRES) })?;
        }
        let call = table.SetOverlayInputMethod.ok_or("the runtime lacks SetOverlayInputMethod")?;
        // SAFETY: a value of the enumeration.
        accepted("SetOverlayInputMethod", unsafe { call(self.handle, sys::VROverlayInputMethod_Mouse) })?;
        let call = table.SetOverlayMouseScale.ok_or("the runtime lacks SetOverlayMouseScale")?;
        let mut scale = sys::HmdVector2_t { v: self.size.map(|side| side as f32) };
        // SAFETY: the pointer is good for the call.
        accepted("SetOverlayMouseScale", unsafe { call(self.handle, &mut scale) })?;
        if let Some(call) = table.SetOverlayFlag {
            // SAFETY: a value of the enumeration. Without the flag there are no scroll events, and nothing else is missing.
            unsafe { call(self.handle, sys::VROverlayFlags_SendVRSmoothScrollEvents, true) };
        }
        Ok(())
    }

    /// Whether the dashboard shows it now.
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

    /// Shows a picture, in layout TRANSFER_SRC_OPTIMAL, from now on. Uses the program's queue.
    ///
    /// # Errors
    /// The call and the runtime's code.
    pub fn show(&self, table: &Table, picture: &EyePicture) -> Result<(), String> {
        let call = table.SetOverlayTexture.ok_or("the runtime lacks SetOverlayTexture")?;
        let mut data = picture.data();
        let mut texture = sys::Texture_t {
            handle: (&raw mut data).cast(),
            eType: sys::ETextureType_TextureType_Vulkan,
            eColorSpace: sys::EColorSpace_ColorSpace_Auto,
        };
        // SAFETY: structures and handles are good for the call; the image is in the layout it wants.
        accepted("SetOverlayTexture", foreign_call(|| unsafe { call(self.handle, &mut texture) }))
    }
}

fn accepted(call: &str, code: sys::EVROverlayError) -> Result<(), String> {
    let is_fine = code == sys::EVROverlayError_VROverlayError_None;
    if is_fine { Ok(()) } else { Err(format!("{call} returns {code}")) }
}
