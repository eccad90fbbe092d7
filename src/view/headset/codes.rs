//! Meaning of the runtime's error codes: at initialisation, and of the frame loop's calls.

use std::fmt;

use openvr_sys as sys;
use serde::{Deserialize, Serialize};

/// The runtime's initialisation failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// EVRInitError.
    pub code: u32,
    /// The loader's or the runtime's name for it.
    pub words: String,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { code, words } = self;
        match *code {
            sys::EVRInitError_VRInitError_Init_VRClientDLLNotFound => {
                write!(
                    f,
                    "the headset runtime's library cannot be loaded (OpenVR {code}): it is damaged, or another library that \
                     it needs is missing; reinstall SteamVR"
                )
            }
            sys::EVRInitError_VRInitError_Init_InstallationNotFound
            | sys::EVRInitError_VRInitError_Init_InstallationCorrupt
            | sys::EVRInitError_VRInitError_Init_FileNotFound
            | sys::EVRInitError_VRInitError_Init_PathRegistryNotFound => {
                write!(f, "the headset runtime is registered but not there (OpenVR {code}); reinstall SteamVR")
            }
            sys::EVRInitError_VRInitError_Init_FactoryNotFound
            | sys::EVRInitError_VRInitError_Init_InterfaceNotFound
            | sys::EVRInitError_VRInitError_Init_InvalidInterface => {
                write!(
                    f,
                    "the headset runtime is too old or too new for this program ({words}, OpenVR {code}); update SteamVR"
                )
            }
            sys::EVRInitError_VRInitError_Init_HmdNotFound
            | sys::EVRInitError_VRInitError_Init_HmdNotFoundPresenceFailed => {
                write!(
                    f,
                    "the runtime finds no headset (OpenVR {code}); connect it, switch it on, and look at SteamVR's window"
                )
            }
            _ if words.is_empty() => write!(f, "the runtime refuses (OpenVR {code}); look at SteamVR's window"),
            _ => write!(f, "the runtime refuses: {words} (OpenVR {code}); look at SteamVR's window"),
        }
    }
}

/// What to do after WaitGetPoses or Submit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum After {
    /// No error.
    Continue,
    /// Normal before the first frame and while the dashboard is open: continue submitting.
    NoFocus,
    /// This frame is lost; the next may be shown. Count it and report it once.
    FrameLost(&'static str),
    /// No frame will be shown any more.
    GiveUp(&'static str),
}

/// The reaction to a code of the compositor.
pub fn after(code: sys::EVRCompositorError) -> After {
    match code {
        sys::EVRCompositorError_VRCompositorError_None => After::Continue,
        sys::EVRCompositorError_VRCompositorError_DoNotHaveFocus => After::NoFocus,
        sys::EVRCompositorError_VRCompositorError_IsNotSceneApplication => {
            After::GiveUp("the runtime has given the eyes to another program (103); close that, then start again")
        }
        sys::EVRCompositorError_VRCompositorError_TextureIsOnWrongDevice => After::GiveUp(
            "the pictures are on another GPU than the headset (104); plug it into the one that draws, and start again",
        ),
        sys::EVRCompositorError_VRCompositorError_TextureUsesUnsupportedFormat => {
            After::GiveUp("the runtime cannot take 8-bit sRGB pictures (105); update SteamVR")
        }
        sys::EVRCompositorError_VRCompositorError_SharedTexturesNotSupported => After::GiveUp(
            "the driver cannot share pictures with the runtime (106); update the graphics driver and SteamVR",
        ),
        sys::EVRCompositorError_VRCompositorError_RequestFailed => After::FrameLost("request failed"),
        sys::EVRCompositorError_VRCompositorError_IncompatibleVersion => After::FrameLost("incompatible version"),
        sys::EVRCompositorError_VRCompositorError_InvalidTexture => After::FrameLost("invalid texture"),
        sys::EVRCompositorError_VRCompositorError_IndexOutOfRange => After::FrameLost("index out of range"),
        sys::EVRCompositorError_VRCompositorError_AlreadySubmitted => After::FrameLost("already submitted"),
        sys::EVRCompositorError_VRCompositorError_InvalidBounds => After::FrameLost("invalid bounds"),
        _ => After::FrameLost("unknown error"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_can_never_be_seen_ends_the_run() {
        let deadly: Vec<u32> = (0..400).filter(|code| matches!(after(*code), After::GiveUp(_))).collect();
        assert_eq!(deadly, [103, 104, 105, 106]);
    }

    #[test]
    fn no_focus_is_no_error_and_every_other_code_costs_one_frame() {
        assert_eq!((after(0), after(101)), (After::Continue, After::NoFocus));
        for code in [1, 100, 102, 107, 108, 109, 110, 4711] {
            assert!(matches!(after(code), After::FrameLost(_)), "{code}");
        }
    }

    #[test]
    fn sentences_that_end_a_run_name_the_code_and_a_remedy() {
        for code in 103..=106 {
            let After::GiveUp(why) = after(code) else { panic!("{code} goes on") };
            assert!(why.contains(&code.to_string()) && why.contains(';'), "{why}");
        }
    }

    #[test]
    fn refusals_say_what_to_do() {
        let say = |code, words: &str| Refusal { code, words: words.into() }.to_string();
        assert!(say(100, "").contains("reinstall SteamVR"));
        assert!(say(105, "IVRSystem_026").contains("IVRSystem_026") && say(105, "").contains("update SteamVR"));
        assert!(say(108, "x").contains("connect it"));
        assert!(say(4711, "out of ink").contains("out of ink (OpenVR 4711)"));
        assert!(say(4711, "").contains("4711"));
    }
}
