//! What has been measured of settings, to be shown beside them.

use std::path::Path;

use crate::context::Context;
use crate::render::RenderSettings;

/// The time and the error of settings.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredSettings {
    pub settings: RenderSettings,
    /// The time of a frame relative to that of the default settings.
    pub time: f64,
    /// Mean FLIP against the exact picture.
    pub flip: f64,
}

/// Finds what has been measured for a scene's file on a context's GPU, which may be nothing.
pub type Measurements = fn(&Path, &Context) -> Vec<MeasuredSettings>;
