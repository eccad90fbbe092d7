//! The common methods of prefiltering, of the thesis and others, for comparison by `measure`. All start from the same
//! cube with mips and end in cubes of the format of `LightMaps`, so that times and errors are comparable.

mod environment;
mod pass;
#[cfg(test)]
mod pass_gpu_tests;

pub use environment::Environment;
pub use pass::AlternativePass;

/// A method with its parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Specular: 2^n GGX half vectors at Hammersley's points, each one sample of mip 0; thesis, section 3-3-2-3.
    MonteCarlo { log2_samples: u32 },
    /// Specular: the same half vectors, each reading the mip that fits it; Křivánek and Colbert (2008).
    FilteredSampling { log2_samples: u32 },
    /// Irradiance: a grid in θ and φ; thesis, sections 3-3-2-2 and (without sin θ) 2-4-1.
    FixedStep { step_radians: f32, with_sine: bool },
    /// Irradiance: spherical harmonics up to this degree; Ramamoorthi and Hanrahan (2001).
    Harmonics { order: u32 },
}

/// The quantity that a map holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    Specular,
    Irradiance,
}

/// One map to fill.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Alpha of the lobe; 1 for irradiance, which is the same integral.
    pub alpha: f64,
    /// Texels along a face.
    pub size: u32,
}

impl Method {
    /// The quantity of the maps that it fills.
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
