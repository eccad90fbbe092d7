//! The commands of a person, whether a key, the panel or a controller gives them.

use std::path::PathBuf;

use crate::render::{MaterialFactors, RenderSettings};

/// One command.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    Quit,
    /// Orbit or fly.
    SwitchMode,
    NextCamera,
    /// One of the scene's cameras, from 0.
    Camera(usize),
    /// Write the present view into the scene's description, as a camera of this name.
    SaveCamera(String),
    /// Restore view, exposure, panorama's turn and settings.
    Reset,
    Fullscreen,
    NextPresentMode,
    /// Show or hide the panel.
    Panel,
    Screenshot,
    NextShading,
    PreviousShading,
    /// Add thirds of a stop.
    AddExposure(i8),
    /// Stops.
    Exposure(f32),
    /// Add steps to the panorama's rotation.
    AddRotation(i8),
    /// The panorama's rotation, radians.
    Rotation(f32),
    /// Show what there is to know of one of the scene's materials, from 0.
    Material(usize),
    /// Change a material's factors, or give it those of its file again.
    Factors(usize, Option<MaterialFactors>),
    /// Multiply a lamp's intensity, or give it that of its file again.
    Lamp(usize, Option<f32>),
    Settings(Box<RenderSettings>),
    /// Show a scene or a panorama.
    Open(PathBuf),
    NextScene,
    PreviousScene,
    NextPanorama,
    PreviousPanorama,
    /// Draw all the time, for measuring, or only when something changes.
    Continuous(bool),
}

/// Requests made with a controller's buttons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    pub next_scene: bool,
    pub next_panorama: bool,
    pub next_shading: bool,
}
