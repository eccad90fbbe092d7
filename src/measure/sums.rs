//! Means of a panorama under lobes, in f64: requested one by one, computed many at once, each only once.

use std::collections::HashMap;

use glam::DVec3;

use crate::asset::Panorama;
use crate::reference::integrals::PanoramaView;
use crate::reference::panorama_sums::prefiltered_around;
use crate::{Error, Result};

/// A lobe's alpha and direction, as bits.
type Key = (u64, [u64; 3]);

/// Lobes narrower than this are mirrors: `prefiltered_around` could not resolve them.
const MIRROR_ALPHA: f64 = 1e-4;

/// The means of one panorama.
pub struct Sums<'a> {
    panorama: &'a Panorama,
    /// The panorama as the integrals see it.
    pub view: PanoramaView<'a>,
    known: HashMap<Key, DVec3>,
    requested: Vec<(f64, DVec3)>,
}

impl<'a> Sums<'a> {
    /// # Errors
    /// A panorama without texels.
    pub fn new(panorama: &'a Panorama) -> Result<Self> {
        let no_texels = || Error::Usage(format!("{}: a panorama without texels", panorama.name));
        let view = PanoramaView::new(panorama.width, panorama.height, &panorama.texels).ok_or_else(no_texels)?;
        Ok(Self { panorama, view, known: HashMap::new(), requested: Vec::new() })
    }

    /// Mean radiance under a lobe of `alpha` around d, which has any length but 0; 0 where it is not known before the next
    /// call by [`Self::settled`].
    pub fn around(&mut self, d: DVec3, alpha: f64) -> DVec3 {
        let d = d.normalize();
        if alpha < MIRROR_ALPHA {
            return self.view.interpolated().radiance(d);
        }
        let key = (alpha.to_bits(), d.to_array().map(f64::to_bits));
        *self.known.entry(key).or_insert_with(|| {
            self.requested.push((alpha, d));
            DVec3::ZERO
        })
    }

    /// What `value` makes of means, once all that it requests are known; it is called again for those that were not.
    pub fn settled<T>(&mut self, mut value: impl FnMut(&mut Self) -> T) -> T {
        loop {
            let settled = value(self);
            if !self.compute() {
                return settled;
            }
        }
    }

    /// Computes what was requested; `false` if nothing was.
    fn compute(&mut self) -> bool {
        let mut by_alpha: HashMap<u64, Vec<DVec3>> = HashMap::new();
        for (alpha, d) in self.requested.drain(..) {
            by_alpha.entry(alpha.to_bits()).or_default().push(d);
        }
        let size = [self.panorama.width, self.panorama.height];
        for (bits, directions) in &by_alpha {
            let means = prefiltered_around(directions, f64::from_bits(*bits), size, &self.panorama.texels);
            for (d, mean) in directions.iter().zip(means) {
                self.known.insert((*bits, d.to_array().map(f64::to_bits)), mean);
            }
        }
        !by_alpha.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn means_are_known_after_they_were_requested_and_computed() {
        let panorama = Panorama::from_fn(64, 32, |d| Vec3::ONE + 0.5 * d);
        let mut sums = Sums::new(&panorama).unwrap();
        assert_eq!(sums.around(DVec3::X, 1.0), DVec3::ZERO);
        assert!(sums.compute());
        // The clamped cosine keeps 2/3 of what is linear.
        assert!(sums.around(2.0 * DVec3::X, 1.0).abs_diff_eq(DVec3::new(4.0 / 3.0, 1.0, 1.0), 2e-3));
        assert!(!sums.compute());
        assert!(sums.around(DVec3::X, 0.0).abs_diff_eq(DVec3::new(1.5, 1.0, 1.0), 0.02), "a mirror is known at once");
    }
}
