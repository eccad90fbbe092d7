//! The script: everything about the simulated headset that a test or a user may choose, as a TOML file.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Names the script's file. Without it, the defaults below hold and nothing is written.
pub const SCRIPT_VARIABLE: &str = "PBR_VR_HEADSET_SCRIPT";

/// What the headset is and what happens to it. Frame 1 begins with the first WaitGetPoses. Things that last do so from
/// `frame` up to and including `last`, which is `frame` itself unless given.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Script {
    /// Where `calls.jsonl`, `frames.csv` and the pictures are written; relative to the script's folder.
    pub output: PathBuf,
    /// Recommended pixels of an eye's image: width, height.
    pub size: [u32; 2],
    /// Frames per second of the display, as the runtime reports them.
    pub hz: f32,
    /// Whether WaitGetPoses waits for the display; else there are as many frames as the program makes.
    pub is_paced: bool,
    /// What GetOutputDevice answers: the number of a physical device; −1 for none, −2 for one that Vulkan does not list.
    pub gpu: i32,
    /// Space-separated, as the runtime would name them.
    pub instance_extensions: String,
    pub device_extensions: String,
    /// Frames whose pictures are written.
    pub show: Vec<u64>,
    /// Also every frame that is a multiple of this; 0: none.
    pub show_every: u64,
    /// Pictures are written with the texels that filtering may read beyond the bounds: one more column and row at the
    /// right and lower side, where the image has them.
    pub show_border: bool,
    /// Whether pictures are copied. Without, the runtime has nothing on the program's device.
    pub copies: bool,
    pub start: Start,
    pub left: EyeOptics,
    pub right: EyeOptics,
    /// The head's way through frames, in the standing space.
    pub head: Vec<Waypoint>,
    /// Those of the hands; a hand without one is not there.
    pub left_hand: Vec<Waypoint>,
    pub right_hand: Vec<Waypoint>,
    /// Sides of the play area along x and z, metres; none if 0.
    pub play_area_metres: [f32; 2],
    pub event: Vec<Event>,
    pub ipd: Vec<Ipd>,
    pub lens: Vec<Lens>,
    pub pose: Vec<PoseLoss>,
    pub wait_error: Vec<CallError>,
    pub submit_error: Vec<CallError>,
    pub block_submit: Vec<Block>,
    /// Frames in which Submit calls Vulkan in a way that the validation layer does not allow.
    pub bad_vulkan: Vec<u64>,
    pub headset: Vec<Presence>,
    pub die: Vec<Death>,
    /// Digital actions are active only while they are pressed, as some runtimes have it.
    pub are_buttons_shy: bool,
    pub button: Vec<Button>,
    pub axis: Vec<Axis>,
    pub timing: Vec<Timing>,
    /// Overlays that cannot be made: `dashboard`, `held`.
    pub refused_overlays: Vec<String>,
    /// Calls that fail for the one that is held.
    pub refused_held_calls: Vec<String>,
    /// SetOverlayTexture comes back only once the next frame has begun, but for a program whose frames wait for it.
    pub is_overlay_slow: bool,
    /// When the dashboard shows the program's overlay.
    pub dashboard: Vec<Shown>,
    /// What the laser mouse does on the program's overlays, in order.
    pub laser: Vec<Laser>,
    /// When a hand's controller is connected, but not tracked.
    pub lost_hand: Vec<LostHand>,
}

/// Something is shown.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Shown {
    pub frame: u64,
    pub last: Option<u64>,
}

/// The laser mouse points at an overlay.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Laser {
    pub frame: u64,
    /// At the one that is fixed to a controller, where the laser mouse is on for it then, rather than at the dashboard's.
    #[serde(default)]
    pub held: bool,
    /// Part of the overlay's width and height, from its upper left corner.
    pub at: [f32; 2],
    /// Whether its button is pressed or released then.
    pub pressed: Option<bool>,
}

/// A hand is not tracked.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LostHand {
    pub frame: u64,
    pub last: Option<u64>,
    /// `left` or `right`.
    pub hand: String,
}

/// How starting goes.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Start {
    /// VR_IsHmdPresent answers no, and Init fails with 108, HmdNotFound.
    pub no_headset: bool,
    /// The EVRInitError that Init fails with; 0: it succeeds.
    pub error: u32,
    /// No interface version is known, as in a runtime older than the program.
    pub too_old: bool,
    /// Only a program that shows pictures can start the runtime's server: Init of others fails with 121.
    pub is_asleep: bool,
    /// Milliseconds that Init takes.
    pub slow_ms: u64,
    /// Init never returns.
    pub hang: bool,
    /// Init aborts the process, with a line on stderr.
    pub abort: bool,
    /// KiB that Init writes to stdout and to stderr: more than a pipe holds.
    pub chatter_kib: u32,
}

/// One eye's frustum and place in the head.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct EyeOptics {
    /// Tangents of the frustum's sides: left, right, down, up. Left and down are negative.
    pub tangents: [f32; 4],
    /// In the head's space, metres: +X right, +Y up, −Z forward.
    pub position: [f32; 3],
    /// Yaw (left is positive), pitch (up), roll (to the left) of the eye in the head, applied in this order.
    #[serde(default)]
    pub rotation_degrees: [f32; 3],
    /// What the lens hides: triangles with corners in 0..1 of the eye's image, origin at its lower left.
    #[serde(default)]
    pub hidden_triangles: Vec<[[f32; 2]; 3]>,
}

/// Where something is at a frame; between two it moves evenly, before the first and after the last it rests.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    pub frame: u64,
    /// Metres, +Y up, in the standing space.
    pub position: [f32; 3],
    /// Yaw, pitch, roll as in `EyeOptics`.
    #[serde(default)]
    pub rotation_degrees: [f32; 3],
}

/// An event of OpenVR's, by its number: 700 is Quit.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    pub frame: u64,
    pub number: u32,
    /// The device it is about; 0 is the head.
    #[serde(default)]
    pub device: u32,
}

/// The eyes move apart to this distance, with event 105.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Ipd {
    pub frame: u64,
    pub metres: f32,
}

/// Both frusta change, with event 110.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    pub frame: u64,
    pub left_tangents: [f32; 4],
    pub right_tangents: [f32; 4],
}

/// The head's pose is reported like this.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PoseLoss {
    pub frame: u64,
    pub last: Option<u64>,
    /// An ETrackingResult: 200 is fine, 201 out of range, 300 rotation only.
    pub result: u32,
    pub valid: bool,
}

/// WaitGetPoses or Submit answer with this EVRCompositorError.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct CallError {
    pub frame: u64,
    pub last: Option<u64>,
    pub code: u32,
}

/// Submit of the left eye takes this long.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    pub frame: u64,
    pub seconds: f32,
}

/// The headset is unplugged (event 101) or plugged in (100).
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Presence {
    pub frame: u64,
    pub connected: bool,
}

/// The runtime takes the process with it, in WaitGetPoses.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Death {
    pub frame: u64,
}

/// A digital action is pressed.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Button {
    pub frame: u64,
    pub last: Option<u64>,
    /// Its path, like `/actions/main/in/teleport`.
    pub action: String,
    /// The hand that does it: `left` or `right`.
    pub hand: String,
}

/// An analog action is moved.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    pub frame: u64,
    pub last: Option<u64>,
    pub action: String,
    pub hand: String,
    pub value: [f32; 2],
}

/// What GetFrameTiming says about these frames.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    pub frame: u64,
    pub last: Option<u64>,
    pub dropped: u32,
    /// How often a frame was shown; more than once means that it was reprojected.
    pub presents: u32,
    pub reprojection_flags: u32,
}

impl Default for Script {
    fn default() -> Self {
        let eye = |x| EyeOptics {
            tangents: [-1.0, 1.0, -1.0, 1.0],
            position: [x, 0.0, 0.0],
            rotation_degrees: [0.0; 3],
            hidden_triangles: Vec::new(),
        };
        Self {
            output: PathBuf::new(),
            size: [256, 256],
            hz: 90.0,
            is_paced: false,
            gpu: 0,
            instance_extensions: String::new(),
            device_extensions: String::new(),
            show: Vec::new(),
            show_every: 0,
            show_border: false,
            copies: true,
            start: Start::default(),
            left: eye(-0.0315),
            right: eye(0.0315),
            head: vec![Waypoint { frame: 1, position: [0.0, 1.6, 0.0], rotation_degrees: [0.0; 3] }],
            left_hand: Vec::new(),
            right_hand: Vec::new(),
            play_area_metres: [2.0, 2.0],
            event: Vec::new(),
            ipd: Vec::new(),
            lens: Vec::new(),
            pose: Vec::new(),
            wait_error: Vec::new(),
            submit_error: Vec::new(),
            block_submit: Vec::new(),
            bad_vulkan: Vec::new(),
            headset: Vec::new(),
            die: Vec::new(),
            are_buttons_shy: false,
            button: Vec::new(),
            axis: Vec::new(),
            timing: Vec::new(),
            refused_overlays: Vec::new(),
            refused_held_calls: Vec::new(),
            is_overlay_slow: false,
            dashboard: Vec::new(),
            laser: Vec::new(),
            lost_hand: Vec::new(),
        }
    }
}

impl Script {
    /// Reads the script that the environment names.
    ///
    /// # Errors
    /// A line that names the file and what is wrong with it.
    pub fn from_environment() -> Result<Self, String> {
        std::env::var_os(SCRIPT_VARIABLE).map_or_else(|| Ok(Self::default()), |file| Self::read(Path::new(&file)))
    }

    /// Where to write; nowhere without a script file.
    pub fn folder(&self) -> Option<&Path> {
        (!self.output.as_os_str().is_empty()).then_some(&self.output)
    }

    fn read(file: &Path) -> Result<Self, String> {
        let say = |problem: &dyn std::fmt::Display| format!("{}: {problem}", file.display());
        let text = std::fs::read_to_string(file).map_err(|e| say(&e))?;
        let mut script: Self = toml::from_str(&text).map_err(|e| say(&e))?;
        let file = std::path::absolute(file).map_err(|e| say(&e))?;
        script.output = file.parent().unwrap_or(Path::new("/")).join(&script.output);
        Ok(script)
    }

    /// Whether this frame's pictures are to be written.
    pub fn shows(&self, frame: u64) -> bool {
        self.show.contains(&frame) || (self.show_every > 0 && frame.is_multiple_of(self.show_every))
    }
}

/// Whether `at` lies in what lasts from `frame` to `last`.
pub fn lasts(at: u64, frame: u64, last: Option<u64>) -> bool {
    (frame..=last.unwrap_or(frame)).contains(&at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_survives_being_written_and_unknown_keys_are_errors() {
        let script =
            Script { size: [12, 34], event: vec![Event { frame: 5, number: 700, device: 0 }], ..Script::default() };
        let text = toml::to_string(&script).expect("TOML");
        let read: Script = toml::from_str(&text).expect("a script");
        assert_eq!(format!("{script:?}"), format!("{read:?}"));
        assert!(toml::from_str::<Script>("sise = [1, 1]").is_err());
    }

    #[test]
    fn the_simulators_script_can_be_read() {
        let script: Script = toml::from_str(include_str!("../look-around.toml")).expect("a script");
        assert_eq!(script.left.hidden_triangles.len(), 4);
        assert!(script.head.len() > 3 && script.head.is_sorted_by_key(|w| w.frame));
    }

    #[test]
    fn pictures_are_written_of_the_frames_named_and_of_multiples() {
        let script = Script { show: vec![3], show_every: 5, ..Script::default() };
        let shown: Vec<u64> = (1..12).filter(|frame| script.shows(*frame)).collect();
        assert_eq!(shown, [3, 5, 10]);
        assert!(lasts(4, 4, None) && !lasts(5, 4, None) && lasts(5, 4, Some(5)) && !lasts(6, 4, Some(5)));
    }
}
