//! The runtime's events that the program reacts to.

use openvr_sys as sys;

/// An event of the runtime.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The runtime asks the program to quit.
    Quit,
    /// The eyes' distance or the lenses changed: query the optics again.
    OpticsChanged,
    /// A device was connected; 0 is the headset.
    DeviceOn(u32),
    /// A device was disconnected.
    DeviceOff(u32),
    /// The dashboard was opened or closed.
    Dashboard(bool),
    /// The program uses a GPU that the headset is not connected to.
    WrongGpu,
    /// Not relevant to this program.
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
        // The end of other programs is not relevant.
        assert_eq!((Event::new(701, 0), Event::new(99_999, 0)), (Event::Other(701), Event::Other(99_999)));
    }
}
