//! Reflectance of a surface with a thin film over it, in f64: the twin of `film_reflectance` in `glsl/fresnel.glsl`.
//!
//! After Belcour and Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence" (2017), in the
//! form of glTF's `KHR_materials_iridescence`: Schlick's reflectances, two orders of interference.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::brdf::{Fresnel, f_schlick, schlick_weight};

/// A film, and the F0 of what is below it where the film is not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Of the surface that has the film, 0 to 1.
    pub share: f64,
    /// Index of refraction.
    pub ior: f64,
    /// Nanometres.
    pub thickness: f64,
    /// Linear RGB.
    pub base_f0: DVec3,
}

/// Orders of interference beyond the first reflection.
const ORDERS: u32 = 2;
/// Thickness in nanometres below which a film's index becomes that of air.
const THIN: f64 = 0.03;
/// Cosines over which reflectance is averaged.
const COSINES: u32 = 64;

/// Fourier transforms of the CIE 1931 observers as sums of Gaussians: Belcour and Barla (2017), supplemental material.
const HEIGHTS: DVec3 = DVec3::new(5.4856e-13, 4.4201e-13, 5.2481e-13);
const CENTRES: DVec3 = DVec3::new(1.6810e6, 1.7953e6, 2.2084e6);
const VARIANCES: DVec3 = DVec3::new(4.3278e9, 9.3046e9, 6.6121e9);
/// The second lobe of X: height, centre, variance.
const SECOND_X: [f64; 3] = [9.7470e-14, 2.2399e6, 4.5282e9];
/// Integral of Y.
const WHITE: f64 = 1.0685e-7;

/// Linear RGB of Rec. 709 from XYZ.
fn rgb_from_xyz(xyz: DVec3) -> DVec3 {
    DMat3::from_cols(
        DVec3::new(3.2404542, -0.969266, 0.0556434),
        DVec3::new(-1.5371385, 1.8760108, -0.2040259),
        DVec3::new(-0.4985314, 0.0415560, 1.0572252),
    ) * xyz
}

/// What interference of a path difference in metres is to an eye, linear RGB; `shift`: phases of reflection.
fn sensitivity(path: f64, shift: DVec3) -> DVec3 {
    let phase = 2.0 * PI * path;
    let lobe = |height: f64, centre: f64, variance: f64, shift: f64| {
        height * (2.0 * PI * variance).sqrt() * (centre * phase + shift).cos() * (-variance * phase * phase).exp()
    };
    let mut xyz = DVec3::from_array([0, 1, 2].map(|i| lobe(HEIGHTS[i], CENTRES[i], VARIANCES[i], shift[i])));
    let [height, centre, variance] = SECOND_X;
    xyz.x += lobe(height, centre, variance, shift.x);
    rgb_from_xyz(xyz / WHITE)
}

fn f0_between(from: f64, to: f64) -> f64 {
    ((to - from) / (to + from)).powi(2)
}

fn ior_of_f0(f0: f64) -> f64 {
    let root = f0.clamp(0.0, 0.9999).sqrt();
    (1.0 + root) / (1.0 - root)
}

impl Film {
    /// Reflectance where the film is, at a cosine; linear RGB.
    pub fn film_reflectance(&self, cosine: f64) -> DVec3 {
        let cosine = cosine.clamp(0.0, 1.0);
        let thick = (self.thickness / THIN).clamp(0.0, 1.0);
        let ior = 1.0 + (self.ior - 1.0) * thick * thick * (3.0 - 2.0 * thick);
        let inside2 = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
        if inside2 <= 0.0 {
            return DVec3::ONE;
        }
        let inside = inside2.sqrt();
        let top = f0_between(1.0, ior);
        let r12 = top + (1.0 - top) * schlick_weight(cosine);
        let through = (1.0 - r12).powi(2);
        // From within the denser film no phase is lost at its top.
        let at_top = if ior < 1.0 { 0.0 } else { PI };
        let base = self.base_f0.map(ior_of_f0);
        let r23 = base.map(|base| f0_between(ior, base)).map(|f0| f0 + (1.0 - f0) * schlick_weight(inside));
        let shift = base.map(|base| at_top + if base < ior { PI } else { 0.0 });
        let path = 2.0 * ior * self.thickness * 1e-9 * inside;
        let both = (r12 * r23).clamp(DVec3::splat(1e-5), DVec3::splat(0.9999));
        let each = both.map(f64::sqrt);
        let below = through * r23 / (1.0 - both);
        let mut sum = r12 + below;
        let mut order = below - (1.0 - r12);
        for m in 1..=ORDERS {
            let m = f64::from(m);
            order *= each;
            sum += order * 2.0 * sensitivity(m * path, m * shift);
        }
        sum.max(DVec3::ZERO)
    }

    /// Reflectance at a cosine, where there is the film and where there is none; that is `bare` there.
    pub fn reflectance(&self, bare: impl Into<Fresnel>, cosine: f64) -> DVec3 {
        f_schlick(bare, cosine).lerp(self.film_reflectance(cosine).min(DVec3::ONE), self.share)
    }

    /// By Schlick's form what has the same mean over directions under the cosine.
    pub fn even(&self, bare: Fresnel) -> Fresnel {
        let mean: DVec3 = (0..COSINES)
            .map(|i| (f64::from(i) + 0.5) / f64::from(COSINES))
            .map(|cosine| 2.0 * cosine * self.reflectance(bare, cosine) / f64::from(COSINES))
            .sum();
        Fresnel { f0: ((21.0 * mean - bare.f90) / 20.0).clamp(DVec3::ZERO, DVec3::ONE), f90: bare.f90 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GLASS: DVec3 = DVec3::splat(0.04);

    fn film(ior: f64, thickness: f64, base_f0: DVec3) -> Film {
        Film { share: 1.0, ior, thickness, base_f0 }
    }

    /// Color matching functions at a wavelength in nanometres: Wyman, Sloan and Shirley, "Simple Analytic Approximations to the CIE
    /// XYZ Color Matching Functions" (2013), eq. 4.
    fn observers(nm: f64) -> DVec3 {
        let lobe = |height: f64, centre: f64, below: f64, above: f64| {
            let t = (nm - centre) / if nm < centre { below } else { above };
            height * (-0.5 * t * t).exp()
        };
        DVec3::new(
            lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
            lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
            lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
        )
    }

    #[test]
    fn colours_of_interference_are_those_of_the_observers() {
        let wavelengths = || (380..=780).map(f64::from);
        let white: f64 = wavelengths().map(|nm| observers(nm).y).sum();
        let mut worst: f64 = 0.0;
        for step in 0..60 {
            let (path, shift) = (50.0 * f64::from(step), PI * f64::from(step % 3));
            let wave = |nm: f64| (2.0 * PI * path / nm + shift).cos();
            let xyz: DVec3 = wavelengths().map(|nm| observers(nm) * wave(nm)).sum();
            let error = (sensitivity(path * 1e-9, DVec3::splat(shift)) - rgb_from_xyz(xyz / white)).abs();
            worst = worst.max(error.max_element());
        }
        // The Gaussians are over the inverse of the wavelength, and few.
        assert!(worst < 0.2, "{worst}");
    }

    #[test]
    fn a_thick_film_is_two_surfaces_without_colour() {
        for (cosine, base_f0) in [(1.0, GLASS), (0.6, GLASS), (0.3, DVec3::new(0.9, 0.6, 0.2))] {
            let thick = film(1.8, 50_000.0, base_f0);
            let inside = (1.0 - (1.0 - cosine * cosine) / (1.8f64 * 1.8)).sqrt();
            let top = f_schlick(DVec3::splat(f0_between(1.0, 1.8)), cosine).x;
            let below = f_schlick(base_f0.map(|f0| f0_between(1.8, ior_of_f0(f0))), inside);
            let want = top + (1.0 - top).powi(2) * below / (1.0 - top * below);
            let got = thick.film_reflectance(cosine);
            assert!((got - want).abs().max_element() < 1e-9, "{cosine}: {got}, not {want}");
        }
    }

    #[test]
    fn no_film_and_a_film_without_thickness_are_none() {
        for f0 in [GLASS, DVec3::new(0.9, 0.6, 0.2)] {
            // At slanted views Schlick's form has the film mirror even where it bends nothing.
            for cosine in [1.0, 0.9] {
                let bare = f_schlick(f0, cosine);
                let none = Film { share: 0.0, ..film(1.5, 400.0, f0) };
                assert_eq!(none.reflectance(f0, cosine), bare);
                let thin = film(1.5, 0.0, f0).reflectance(f0, cosine);
                // What is clamped for roots of small numbers makes half a per cent.
                assert!((thin - bare).abs().max_element() < 0.012, "{f0} at {cosine}: {thin}, not {bare}");
            }
        }
    }

    #[test]
    fn what_is_even_has_the_films_mean() {
        let film = film(1.4, 500.0, DVec3::new(0.3, 0.1, 0.05));
        let bare = Fresnel::from(film.base_f0);
        let mean: DVec3 =
            (0..1000).map(|i| (f64::from(i) + 0.5) / 1000.0).map(|c| 2e-3 * c * film.reflectance(bare, c)).sum();
        assert!((film.even(bare).mean() - mean).abs().max_element() < 1e-3);
        assert_eq!(Film { share: 0.0, ..film }.even(bare).f90, 1.0);
    }
}
