//! The usual ways to fill the maps: what the thesis and others do, kept as rivals that `measure` charts.
//!
//! All start from the same cube with mips and end in cubes of the same format as `LightMaps` has, so that time and error
//! compare like with like.

mod environment;
mod job;
#[cfg(test)]
mod job_gpu_tests;

pub use environment::Environment;
pub use job::AlternativePass;

/// One way, with its parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Specular: 2^n GGX half vectors at Hammersley's points, each one tap of mip 0; thesis, section 3-3-2-3.
    MonteCarlo { log2_samples: u32 },
    /// Specular: the same half vectors, each reading the mip that fits it; Křivánek and Colbert (2008).
    FilteredSampling { log2_samples: u32 },
    /// Irradiance: a grid in θ and φ; thesis, sections 3-3-2-2 and (without sin θ) 2-4-1.
    FixedStep { step_radians: f32, with_sine: bool },
    /// Irradiance: spherical harmonics up to this degree; Ramamoorthi and Hanrahan (2001).
    Harmonics { order: u32 },
}

/// What a map holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    Specular,
    Irradiance,
}

/// One map to fill.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// The lobe's; 1 for irradiance, which is the same integral.
    pub alpha: f64,
    /// Texels along a face.
    pub size: u32,
}

impl Method {
    /// Which kind of map it fills.
    pub fn quantity(self) -> Quantity {
        match self {
            Self::MonteCarlo { .. } | Self::FilteredSampling { .. } => Quantity::Specular,
            Self::FixedStep { .. } | Self::Harmonics { .. } => Quantity::Irradiance,
        }
    }

    /// Its name on the command line and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::MonteCarlo { .. } => "monte-carlo",
            Self::FilteredSampling { .. } => "filtered-sampling",
            Self::FixedStep { with_sine: true, .. } => "fixed-step",
            Self::FixedStep { with_sine: false, .. } => "fixed-step-without-sine",
            Self::Harmonics { .. } => "spherical-harmonics",
        }
    }

    /// Its parameter, for tables: samples, step in radians, or degree.
    pub fn parameter(self) -> String {
        match self {
            Self::MonteCarlo { log2_samples } | Self::FilteredSampling { log2_samples } => {
                (1u32 << log2_samples).to_string()
            }
            Self::FixedStep { step_radians, .. } => step_radians.to_string(),
            Self::Harmonics { order } => order.to_string(),
        }
    }
}
