//! The panel beside the left controller: where it is, when it is shown, and when the right hand's laser is on it.

use glam::{Mat4, Vec2, Vec3};
use openvr_sys as sys;
use sys::VR_IVROverlay_FnTable as Table;

use super::actions::Hand;
use super::hands::PanelInput;
use super::optics::place;
use super::overlay::{Overlay, Pointer};
use super::runtime::{DEVICES, Runtime};

/// Width, metres: at half a metre a third of the field of view.
const WIDTH_METRES: f32 = 0.3;
/// From the controller's origin up to the panel's lower edge, metres: above the ring of a wand and the thumb.
const CLEARANCE_METRES: f32 = 0.09;
/// From upright back, degrees: a controller that lies in the hand at the belt points forward, and its holder looks down.
const TILT_DEGREES: f32 = 45.0;
/// How much larger the panel is for a laser that is on it, part of its size: at the edge a trembling hand would otherwise
/// turn it on and off.
const MARGIN: f32 = 0.1;

/// The controllers' places in a frame.
pub struct HandPlaces {
    /// Device and `play_from_device` of the left one, where it is tracked.
    left: Option<(u32, Mat4)>,
    /// `play_from_device` of the right one, where it is tracked.
    right: Option<Mat4>,
}

impl HandPlaces {
    /// From every device's pose in this frame.
    pub fn new(runtime: &Runtime, poses: &[sys::TrackedDevicePose_t; DEVICES]) -> Self {
        let of = |hand| {
            let device = runtime.device_in(hand)?;
            Some((device, place(&poses[device as usize])?))
        };
        Self { left: of(Hand::Left), right: of(Hand::Right).map(|(_, place)| place) }
    }
}

/// The overlay at the left hand.
pub struct Held {
    overlay: Overlay,
    /// Pixels.
    size: [u32; 2],
    /// Whether the user wants to see it.
    is_wanted: bool,
    /// The device that it is fixed to, while it is shown.
    shown_at: Option<u32>,
    /// Whether the laser is on it.
    has_laser: bool,
    /// Whether the laser's button is pressed.
    is_pressed: bool,
    /// Where the right controller points, as last reported. Input may stop for the scene while the laser is on, poses
    /// of devices do not.
    device_from_pointer: Mat4,
}

impl Held {
    /// Makes it, hidden, with a picture of `size` pixels.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub fn new(table: &Table, size: [u32; 2]) -> Result<Self, String> {
        Ok(Self {
            overlay: Overlay::held(table, size, WIDTH_METRES)?,
            size,
            is_wanted: false,
            shown_at: None,
            has_laser: false,
            is_pressed: false,
            device_from_pointer: Mat4::IDENTITY,
        })
    }

    /// The overlay itself.
    pub fn overlay(&self) -> &Overlay {
        &self.overlay
    }

    /// Removes it from the runtime.
    pub fn destroy(self, table: &Table) {
        self.overlay.destroy(table);
    }

    /// Whether the laser is on it: its buttons are the panel's.
    pub fn has_laser(&self) -> bool {
        self.has_laser
    }

    /// Follows the hands of a frame. Returns whether the laser was taken off the panel.
    ///
    /// # Errors
    /// A refused call.
    pub fn follow(&mut self, table: &Table, input: PanelInput, places: &HandPlaces) -> Result<bool, String> {
        self.is_wanted ^= input.toggled;
        let left = places.left.filter(|_| self.is_wanted);
        let device = left.map(|(device, _)| device);
        let play_from_panel = left.map(|(_, play_from_device)| play_from_device * device_from_panel(self.height()));
        let hit = self.pointer(input, places).zip(play_from_panel).and_then(|(hand, panel)| hit(&panel, &hand));
        // A drag goes on beyond the edge.
        let is_on = match hit {
            _ if device.is_none() || !self.overlay.is_visible(table) => false,
            _ if self.has_laser && self.is_pressed => true,
            Some(at) if self.has_laser => self.holds(at, 1.0 + MARGIN),
            Some(at) => !input.is_busy && self.holds(at, 1.0),
            None => false,
        };
        let lost = self.has_laser && !is_on;
        if is_on != self.has_laser {
            // While this flag is set and the overlay is visible, the "system-wide laser mouse mode" is on (openvr.h,
            // VROverlayFlags_MakeOverlaysInteractiveIfVisible), and "it also causes the game to not get input"
            // (github.com/ValveSoftware/openvr/issues/1236). Were it set all the time, nobody could teleport with the
            // panel in hand, nor press the button that hides it: so only while the right hand points at it.
            self.overlay.set_laser(table, is_on)?;
            (self.has_laser, self.is_pressed) = (is_on, false);
        }
        if device != self.shown_at {
            if let Some(device) = device {
                self.overlay.fix_to(table, device, &device_from_panel(self.height()))?;
            }
            if device.is_some() != self.shown_at.is_some() {
                self.overlay.set_shown(table, device.is_some())?;
            }
            self.shown_at = device;
        }
        Ok(lost)
    }

    /// The oldest event of the laser not yet taken.
    pub fn next_event(&mut self, table: &Table) -> Option<Pointer> {
        let event = self.overlay.next_event(table)?;
        if let Pointer::Button { pressed, .. } = event {
            self.is_pressed = pressed;
        }
        Some(event)
    }

    /// `play_from_hand` of the hand that points.
    fn pointer(&mut self, input: PanelInput, places: &HandPlaces) -> Option<Mat4> {
        if let (Some(pointer), Some(device)) = (input.pointer, places.right) {
            self.device_from_pointer = device.inverse() * pointer;
        }
        input.pointer.or_else(|| places.right.map(|device| device * self.device_from_pointer))
    }

    /// Metres.
    fn height(&self) -> f32 {
        WIDTH_METRES * self.size[1] as f32 / self.size[0] as f32
    }

    /// Whether a point, metres from the centre, is on the panel made larger by a factor.
    fn holds(&self, at: Vec2, factor: f32) -> bool {
        at.abs().cmple(0.5 * factor * Vec2::new(WIDTH_METRES, self.height())).all()
    }
}

/// The panel's place on the controller, whose −Z points forward and +Y up: +X of the panel is to its right, +Y up, +Z
/// toward its reader.
fn device_from_panel(height_metres: f32) -> Mat4 {
    let turn = Mat4::from_rotation_x(-TILT_DEGREES.to_radians());
    let centre = Vec3::Y * CLEARANCE_METRES + turn.transform_vector3(Vec3::Y * (0.5 * height_metres));
    Mat4::from_translation(centre) * turn
}

/// Where a ray along the hand's −Z meets the panel's front: metres from its centre, to the right and up.
fn hit(play_from_panel: &Mat4, play_from_hand: &Mat4) -> Option<Vec2> {
    let panel_from_hand = play_from_panel.inverse() * *play_from_hand;
    let start = panel_from_hand.w_axis.truncate();
    let direction = -panel_from_hand.z_axis.truncate();
    let is_toward_front = start.z > 0.0 && direction.z < 0.0;
    is_toward_front.then(|| (start - direction * (start.z / direction.z)).truncate()).filter(|at| at.is_finite())
}

#[cfg(test)]
#[path = "held_tests.rs"]
mod tests;
