//! The runtime's events that the program reacts to.

use openvr_sys as sys;

/// What has happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The runtime closes; we have to go.
    Quit,
    /// Distance between the eyes, or the lenses: ask for the optics again.
    OpticsChanged,
    /// A device came; 0 is the headset.
    DeviceOn(u32),
    /// A device went.
    DeviceOff(u32),
    /// The runtime's own menu came up or went away.
    Dashboard(bool),
    /// We draw on a GPU that the headset does not hang on.
    WrongGpu,
    /// Nothing of ours.
    Other(u32),
}

impl Event {
    /// From the runtime's number and device.
    pub fn new(kind: sys::EVREventType, device: u32) -> Self {
        match kind {
            sys::EVREventType_VREvent_Quit => Self::Quit,
            sys::EVREventType_VREvent_IpdChanged | sys::EVREventType_VREvent_LensDistortionChanged => {
                Self::OpticsChanged
            }
            sys::EVREventType_VREvent_TrackedDeviceActivated => Self::DeviceOn(device),
            sys::EVREventType_VREvent_TrackedDeviceDeactivated => Self::DeviceOff(device),
            sys::EVREventType_VREvent_DashboardActivated => Self::Dashboard(true),
            sys::EVREventType_VREvent_DashboardDeactivated => Self::Dashboard(false),
            sys::EVREventType_VREvent_SceneApplicationUsingWrongGraphicsAdapter => Self::WrongGpu,
            other => Self::Other(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_keep_their_device_and_strange_ones_pass() {
        assert_eq!(Event::new(700, 3), Event::Quit);
        assert_eq!((Event::new(105, 0), Event::new(110, 0)), (Event::OpticsChanged, Event::OpticsChanged));
        assert_eq!((Event::new(100, 2), Event::new(101, 0)), (Event::DeviceOn(2), Event::DeviceOff(0)));
        assert_eq!((Event::new(502, 0), Event::new(503, 0)), (Event::Dashboard(true), Event::Dashboard(false)));
        // Other programs' leaving is none of our business.
        assert_eq!((Event::new(701, 0), Event::new(99_999, 0)), (Event::Other(701), Event::Other(99_999)));
    }
}
