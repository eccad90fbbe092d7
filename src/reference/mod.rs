//! Reference implementations in f64, without Vulkan: BRDF terms, sampling, integrals, colour, picture metrics.
//!
//! `math`, `brdf`, `clearcoat`, `disc`, `energy`, `film`, `sampling`, `cube`, `octahedral`, `openness`, `refraction`, `sheen`, `tone`,
//! `probe`, `shadow` and `split_sum` are the twins of the files of the same name in `glsl/` (`film` of `fresnel.glsl`, `probe` of
//! `probe_box.glsl`, `shadow` of `shadow_place.glsl`, `reprojection` of `mirror.frag`): same functions, same arguments, same constants.

pub mod brdf;
pub mod clearcoat;
pub mod cube;
pub mod disc;
pub mod energy;
pub mod film;
pub mod importance;
pub mod integrals;
pub mod math;
pub mod levels;
pub mod lobe;
pub mod metrics;
pub mod mip;
pub mod octahedral;
pub mod openness;
pub mod panorama_sums;
pub mod probe;
pub mod quadrature;
pub mod refraction;
pub mod reprojection;
pub mod sampling;
pub mod shadow;
pub mod sheen;
pub mod split_sum;
pub mod sun;
pub mod table;
pub mod tone;
