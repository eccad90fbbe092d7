//! Samples of the GGX lobe for n = v = r, which are the same around every direction.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use crate::reference::sampling::{hammersley, pdf_ggx, sample_ggx};

/// 2^log2_count samples (4 at least) of the lobe of `alpha` around +Z as direction and the mip to read, of a cube map whose faces are
/// `source_size` texels wide.
///
/// Four quarter turns of one set, so that their mean lies on the axis exactly. Only u below 1 / (1 + α²) gives an l above the
/// horizon: l.z = 2 h.z² − 1. No bias is added to the mip (Křivánek and Colbert add 1): so many samples do not need it, and
/// it would flatten a linear sky by ½ %.
pub(super) fn samples(alpha: f64, log2_count: u32, source_size: u32) -> Vec<[f32; 4]> {
    let count = 1u32 << log2_count;
    let texel_sr = 4.0 * PI / (6.0 * f64::from(source_size).powi(2));
    let above = 1.0 / (1.0 + alpha * alpha);
    let sample = |i: u32| {
        let strip = 0.5 / f64::from(count / 4);
        let u = hammersley(i, log2_count - 2);
        let h = sample_ggx(DVec2::new((u.x + strip) * above, 0.25 * u.y), alpha);
        let l = 2.0 * h.z * h - DVec3::Z;
        let sample_sr = above / (f64::from(count) * pdf_ggx(DVec3::Z, h, alpha));
        let mip = (0.5 * (sample_sr / texel_sr).log2()).max(0.0);
        let turned = [[l.x, l.y], [-l.y, l.x], [-l.x, -l.y], [l.y, -l.x]];
        turned.map(|[x, y]| [x, y, l.z, mip].map(|c| c as f32))
    };
    (0..count / 4).flat_map(sample).collect()
}
