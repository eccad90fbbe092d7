//! Irradiance, prefiltered radiance and reflected light of a panorama, by sums over all of its texels: slow and exact.

use std::ops::Add;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    brdf::{DIELECTRIC_F0, Geometry, d_ggx, diffuse_karis2013, f_schlick, f0_from_metallic, v_environment},
    cube::{panorama_direction, panorama_texel_solid_angle, panorama_uv},
    energy::{Curve, Energy, Scattering},
    lobe::grazing_kernel,
    table::Entry,
};

/// A panorama as a function of direction: constant over each texel, or [interpolated](PanoramaView::interpolated).
#[derive(Clone, Copy, Debug)]
pub struct PanoramaView<'a> {
    width: u32,
    height: u32,
    texels: &'a [[f32; 3]],
    interpolated: bool,
}

/// A point of a surface, seen from direction `v`.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Unit normal.
    pub n: DVec3,
    /// Unit direction to the eye.
    pub v: DVec3,
    /// Linear RGB.
    pub base_color: DVec3,
    pub metallic: f64,
    pub roughness: f64,
}

/// Radiance that a surface reflects to the eye, by term.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reflected {
    pub diffuse: DVec3,
    pub specular: DVec3,
}

impl Add for Reflected {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { diffuse: self.diffuse + other.diffuse, specular: self.specular + other.specular }
    }
}

impl<'a> PanoramaView<'a> {
    /// `width · height` texels of linear RGB radiance, rows from the top; `None` if their number is another, or zero.
    pub fn new(width: u32, height: u32, texels: &'a [[f32; 3]]) -> Option<Self> {
        let count = u64::from(width) * u64::from(height);
        (count > 0 && count == texels.len() as u64).then_some(Self { width, height, texels, interpolated: false })
    }

    /// Bilinear between texel centres in u and v, wrapped at the seam, clamped at the poles: as in `--shading
    /// reference`.
    pub fn interpolated(self) -> Self {
        Self { interpolated: true, ..self }
    }

    /// Radiance from direction d (to the light).
    pub fn radiance(&self, d: DVec3) -> DVec3 {
        let uv = panorama_uv(d);
        if self.interpolated {
            return self.between_texels(uv);
        }
        // u = 1 is u = 0; v = 1 is the last row.
        let x = (uv.x * f64::from(self.width)) as u32 % self.width;
        let y = ((uv.y * f64::from(self.height)) as u32).min(self.height - 1);
        self.texel(x, y)
    }

    fn between_texels(&self, uv: DVec2) -> DVec3 {
        let at = uv * DVec2::new(f64::from(self.width), f64::from(self.height)) - 0.5;
        let (base, part) = (at.floor(), at - at.floor());
        let column = |x: f64| x.rem_euclid(f64::from(self.width)) as u32;
        let row = |y: f64| y.clamp(0.0, f64::from(self.height - 1)) as u32;
        let along = |y: f64| {
            let [left, right] = [base.x, base.x + 1.0].map(|x| self.texel(column(x), row(y)));
            left.lerp(right, part.x)
        };
        along(base.y).lerp(along(base.y + 1.0), part.y)
    }

    fn texel(&self, x: u32, y: u32) -> DVec3 {
        let [r, g, b] = self.texels[y as usize * self.width as usize + x as usize].map(f64::from);
        DVec3::new(r, g, b)
    }

    /// Σ term(direction, radiance · solid angle, solid angle) over cells that each lie in one texel and are about
    /// `cell_radians` wide at most. Rows are computed in parallel and added in order, so that the sum is deterministic.
    fn sum<T: Default + Add<Output = T> + Send>(
        &self,
        cell_radians: impl Fn(DVec3) -> f64 + Sync,
        term: impl Fn(DVec3, DVec3, f64) -> T + Sync,
    ) -> T {
        let row_sum = |y: u32| {
            let mut sum = T::default();
            let mut add = |d: DVec3, radiance: DVec3, solid_angle: f64| {
                sum = std::mem::take(&mut sum) + term(d, radiance * solid_angle, solid_angle);
            };
            for x in 0..self.width {
                let cell = Cell { x, y, depth: 0 };
                self.visit(cell, self.texel(x, y), &cell_radians, &mut add);
            }
            sum
        };
        let rows: Vec<T> = (0..self.height).into_par_iter().map(row_sum).collect();
        rows.into_iter().fold(T::default(), T::add)
    }

    /// Passes a cell of a texel with this radiance to `add`, or recursively its quarters if it is too wide: so cells
    /// shrink towards a lobe's centre, wherever in the texel that is.
    fn visit(
        &self,
        cell: Cell,
        texel: DVec3,
        cell_radians: &impl Fn(DVec3) -> f64,
        add: &mut impl FnMut(DVec3, DVec3, f64),
    ) {
        /// Largest depth of the recursion; bounds the time for very narrow lobes.
        const DEEPEST: u32 = 16;
        let size = [self.width, self.height].map(|side| side.saturating_mul(1 << cell.depth));
        let [width, height] = size.map(f64::from);
        let d = panorama_direction(DVec2::new((f64::from(cell.x) + 0.5) / width, (f64::from(cell.y) + 0.5) / height));
        let radians = (std::f64::consts::TAU / width).max(std::f64::consts::PI / height);
        // With interpolation the slope changes at a texel's centre, which must be between cells.
        let is_too_wide = radians > cell_radians(d) || (self.interpolated && cell.depth == 0);
        if is_too_wide && cell.depth < DEEPEST {
            return cell.quarters().into_iter().for_each(|quarter| self.visit(quarter, texel, cell_radians, add));
        }
        let radiance = if self.interpolated { self.radiance(d) } else { texel };
        add(d, radiance, panorama_texel_solid_angle(cell.y, size));
    }
}

/// A part of a texel: column and row of a panorama with 2^depth times as many of each.
#[derive(Clone, Copy)]
struct Cell {
    x: u32,
    y: u32,
    depth: u32,
}

impl Cell {
    fn quarters(self) -> [Self; 4] {
        let [x, y, depth] = [2 * self.x, 2 * self.y, self.depth + 1];
        [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|[x, y]| Self { x, y, depth })
    }
}

/// Cell width for smooth integrands: the error of cos(θ) by midpoints of 0.02 is 2e-5.
const SMOOTH_RADIANS: f64 = 0.02;

/// How much a channel counts where light of all is taken together; as in `glsl/nodes.glsl`.
const BRIGHTNESS: DVec3 = DVec3::new(0.25, 0.5, 0.25);

/// Cells per scale of a specular lobe.
const CELLS_PER_LOBE: f64 = 12.0;

/// Irradiance ∫ L n·l dl in W/m² on a surface with unit normal n. Not divided by π: a white Lambertian reflects it / π.
pub fn irradiance(panorama: PanoramaView, n: DVec3) -> DVec3 {
    panorama.sum(|_| SMOOTH_RADIANS, |l, light, _| light * n.dot(l).max(0.0))
}

/// How much of the light on a surface with unit normal n is grazing: the mean of 21 (1 − n·l)⁵ by the irradiance of all
/// channels; 1 for even light, and where there is none. For one cosine c of all light it is 21 (1 − c)⁵.
pub fn grazing(panorama: PanoramaView, n: DVec3) -> f64 {
    let term = |l: DVec3, light: DVec3, _: f64| {
        let nl = n.dot(l);
        DVec2::new(nl.max(0.0), 21.0 * grazing_kernel(nl)) * light.dot(BRIGHTNESS)
    };
    let [all, grazing] = panorama.sum(|_| SMOOTH_RADIANS, term).to_array();
    if all > 0.0 { grazing / all } else { 1.0 }
}

/// Prefiltered radiance for a roughness in [0, 1] around unit direction r, with n = v = r: ∫ L D n·l dl / ∫ D n·l dl,
/// the content of the split sum's levels (Karis 2013, the sum below eq. 7, which weights its GGX samples by n·l).
pub fn prefiltered(panorama: PanoramaView, r: DVec3, roughness: f64) -> DVec3 {
    let alpha = roughness * roughness;
    if alpha < 1e-6 {
        return panorama.radiance(r); // narrower than 1/256 of the texels of any panorama
    }
    #[derive(Default)]
    struct Weighted(DVec3, f64);
    impl Add for Weighted {
        type Output = Self;
        fn add(self, other: Self) -> Self {
            Self(self.0 + other.0, self.1 + other.1)
        }
    }
    let Weighted(light, weight) = panorama.sum(
        |l| lobe_cell_radians(r, l, alpha),
        |l, light, solid_angle| {
            let kernel = d_ggx(r, r + l, alpha) * r.dot(l).max(0.0);
            Weighted(light * kernel, solid_angle * kernel)
        },
    );
    light / weight
}

/// Cell width at l of a lobe of this alpha around r: its scale is alpha at the centre (over half vectors, so twice that
/// over l) and grows with the distance from there.
fn lobe_cell_radians(r: DVec3, l: DVec3, alpha: f64) -> f64 {
    (2.0 * alpha).hypot(r.distance(l)) / CELLS_PER_LOBE
}

/// Alpha below which a surface is a mirror; the same in the shader of `--shading reference`.
const MIRROR_ALPHA: f64 = 1e-4;

/// Light that `surface` reflects to the eye from an unoccluded panorama, with the full BRDF (Fresnel at v·h, no split
/// sum) and the environment's visibility of `geometry`, for any roughness from 0. This is the shading integral, not
/// light transport: other surfaces neither occlude nor reflect light. Multiple scattering counts as specular.
pub fn reflected(panorama: PanoramaView, surface: &Surface, geometry: Geometry, scattering: Scattering) -> Reflected {
    reflected_by(panorama, surface, &Terms::new(surface.roughness, geometry), scattering)
}

/// The same with precomputed terms.
pub fn reflected_by(panorama: PanoramaView, surface: &Surface, terms: &Terms, scattering: Scattering) -> Reflected {
    let &Surface { n, v, base_color, metallic, roughness } = surface;
    let geometry = terms.geometry;
    let alpha = roughness * roughness;
    let is_mirror = alpha < MIRROR_ALPHA;
    let f0 = f0_from_metallic(base_color, metallic, DIELECTRIC_F0);
    let nv = n.dot(v);
    let mirror = 2.0 * nv * n - v;
    let beyond = Beyond::new(surface, terms, scattering);
    // At grazing angles the lobe is narrower by n·v in one direction, down to a limit.
    let narrow = if is_mirror { f64::INFINITY } else { alpha * nv.max(alpha.min(0.1)) };
    let mut light = panorama.sum(
        |l| lobe_cell_radians(mirror, l, narrow).min(SMOOTH_RADIANS),
        |l, light, _| {
            let nl = n.dot(l);
            if nl <= 0.0 {
                return Reflected::default();
            }
            let h = v + l;
            let vh = 0.5 * h.length();
            let dv = if is_mirror { 0.0 } else { d_ggx(n, h, alpha) * v_environment(nl, nv, roughness, geometry) };
            let specular = f_schlick(f0, vh) * dv;
            let [diffuse, multiple] = beyond.at(f0, nl, vh);
            Reflected { diffuse: light * nl * diffuse, specular: light * nl * (specular + multiple) }
        },
    );
    if is_mirror {
        light.specular += f_schlick(f0, nv) * panorama.radiance(mirror);
    }
    light
}

/// The terms of a BRDF that depend on its roughness only: computed once for many surfaces.
pub struct Terms {
    geometry: Geometry,
    /// `None` with `Geometry::Karis2013`.
    energy: Option<(Energy, Curve)>,
}

impl Terms {
    /// For a roughness in [0, 1].
    pub fn new(roughness: f64, geometry: Geometry) -> Self {
        let energy = || (Energy::new(roughness, geometry, Scattering::Multiple), Curve::new(roughness, geometry));
        Self { geometry, energy: (geometry == Geometry::Smith).then(energy) }
    }

    /// The table's entry averaged over directions; `None` with `Geometry::Karis2013`.
    pub fn mean_entry(&self) -> Option<Entry> {
        self.energy.as_ref().map(|(energy, _)| energy.mean)
    }
}

/// The terms beside single scattering: the diffuse part of the thesis, or diffuse part and multiple scattering.
enum Beyond<'a> {
    Karis2013 { albedo: DVec3 },
    Smith { energy: Energy, curve: &'a Curve, at_v: Entry, albedo: DVec3, share: DVec3 },
}

impl<'a> Beyond<'a> {
    fn new(surface: &Surface, terms: &'a Terms, scattering: Scattering) -> Self {
        let &Surface { n, v, base_color, metallic, .. } = surface;
        let diffuse = (1.0 - metallic) * base_color;
        let Some((energy, curve)) = &terms.energy else { return Self::Karis2013 { albedo: diffuse } };
        let energy = Energy { scattering, ..*energy };
        let (at_v, share) = (curve.at(n.dot(v)), energy.mixed_share(base_color, metallic));
        Self::Smith { energy, curve, at_v, albedo: diffuse, share }
    }

    /// Diffuse and multiple scattering in 1/sr.
    fn at(&self, f0: DVec3, nl: f64, vh: f64) -> [DVec3; 2] {
        match self {
            Self::Karis2013 { albedo } => [diffuse_karis2013(*albedo, f0, vh), DVec3::ZERO],
            Self::Smith { energy, curve, at_v, albedo, share } => {
                let at_l = curve.at(nl);
                [energy.diffuse(*albedo, at_l, *at_v), energy.multiple(*share, at_l, *at_v)]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{cube::panorama_uv, table::specular_albedo};
    use std::f64::consts::PI;

    fn white() -> Vec<[f32; 3]> {
        vec![[1.0; 3]; 32 * 16]
    }

    /// A sky of 0.1 and, around +X, 2 × 2 texels that carry the flux of the sun of cases 5 and 6: 0.53° wide, 50,000.
    fn sunny(width: u32, height: u32) -> Vec<[f32; 3]> {
        let mut texels = vec![[0.1; 3]; (width * height) as usize];
        let sun_sr = 2.0 * PI * (1.0 - (0.53f64.to_radians() / 2.0).cos());
        let (x, y) = (width / 2, height / 2);
        let patch_sr = 4.0 * panorama_texel_solid_angle(y, [width, height]);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            texels[((y - dy) * width + x - dx) as usize] = [(0.1 + 50_000.0 * sun_sr / patch_sr) as f32; 3];
        }
        texels
    }

    #[test]
    fn a_view_checks_its_size() {
        assert!(PanoramaView::new(32, 16, &white()).is_some());
        assert!(PanoramaView::new(32, 15, &white()).is_none());
        assert!(PanoramaView::new(0, 0, &[]).is_none());
    }

    #[test]
    fn radiance_finds_the_texel() {
        let texels: Vec<_> = (0..8 * 4).map(|i| [i as f32, 0.0, 0.0]).collect();
        let view = PanoramaView::new(8, 4, &texels).unwrap();
        for i in 0..8 * 4 {
            let uv = DVec2::new((f64::from(i % 8) + 0.5) / 8.0, (f64::from(i / 8) + 0.5) / 4.0);
            assert_eq!(view.radiance(panorama_direction(uv)).x, f64::from(i));
        }
        assert_eq!(view.radiance(DVec3::Y).x, 4.0);
        assert_eq!(view.radiance(-DVec3::Y).x, 28.0);
        assert!([0.0, 1.0].contains(&panorama_uv(DVec3::new(-1.0, 0.0, 1e-300)).x));
    }

    #[test]
    fn irradiance_of_white_is_pi_and_of_half_a_sky_follows_the_cosine() {
        let texels = white();
        let view = PanoramaView::new(32, 16, &texels).unwrap();
        for n in [DVec3::Y, DVec3::X, DVec3::new(0.6, -0.8, 0.0)] {
            let e = irradiance(view, n).x;
            assert!((e / PI - 1.0).abs() < 1e-4, "{e} at {n}");
        }
        let upper: Vec<_> = (0..32 * 16).map(|i| if i < 32 * 8 { [1.0; 3] } else { [0.0; 3] }).collect();
        let view = PanoramaView::new(32, 16, &upper).unwrap();
        for n in [DVec3::Y, DVec3::X, DVec3::new(0.6, -0.8, 0.0)] {
            // A tilted plane sees (1 + cos tilt) / 2 of a uniform upper hemisphere.
            let (e, truth) = (irradiance(view, n).x, PI * (1.0 + n.y) / 2.0);
            assert!((e - truth).abs() < 2e-4, "{e} against {truth} at {n}");
        }
    }

    /// Cases 5 and 6 of tests/gpu/stability.rs: the numbers of the truth.
    #[test]
    fn a_small_sun_is_never_missed() {
        let texels = sunny(1024, 512);
        let view = PanoramaView::new(1024, 512, &texels).unwrap();
        for (roughness, truth) in [(0.25, 70.889), (0.5, 5.712)] {
            let ours = prefiltered(view, DVec3::X, roughness).x;
            assert!((ours / truth - 1.0).abs() < 0.005, "{ours} against {truth} at roughness {roughness}");
        }
        let tilted = DVec3::new(10f64.to_radians().cos(), 10f64.to_radians().sin(), 0.0);
        let ours = prefiltered(view, tilted, 0.5).x;
        assert!((ours / 4.55 - 1.0).abs() < 0.005, "{ours} at 10 degrees");
        for (degrees, truth) in [(0f64, 1.17), (30.0, 1.03)] {
            let n = DVec3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0);
            let ours = irradiance(view, n).x / PI;
            assert!((ours - truth).abs() < 0.005, "{ours} against {truth} at {degrees} degrees");
        }
    }

    #[test]
    fn a_constant_panorama_stays_constant() {
        let texels = white();
        let view = PanoramaView::new(32, 16, &texels).unwrap();
        for roughness in [0.0, 0.1, 0.5, 1.0] {
            assert!(prefiltered(view, DVec3::new(0.6, 0.0, 0.8), roughness).abs_diff_eq(DVec3::ONE, 1e-12));
        }
    }

    /// Lobes narrower than a texel, at any point of it.
    #[test]
    fn narrow_lobes_lose_no_light_on_coarse_panoramas() {
        let texels = vec![[1.0; 3]; 64 * 32];
        let view = PanoramaView::new(64, 32, &texels).unwrap();
        for (nv, roughness) in
            [(0.05, 0.1), (0.1, 0.15), (0.5, 0.1), (0.05, 0.3), (0.4, 0.03), (0.8, 0.015), (0.3, 0.0)]
        {
            let n = DVec3::new(0.36, 0.48, 0.8);
            let v = nv * n + f64::sqrt(1.0 - nv * nv) * n.any_orthonormal_vector();
            let surface = Surface { n, v, base_color: DVec3::ONE, metallic: 1.0, roughness };
            let sum = reflected(view, &surface, Geometry::Smith, Scattering::Single).specular.x;
            let table = specular_albedo(surface.base_color, nv, roughness, Geometry::Smith).x;
            assert!((sum / table - 1.0).abs() < 3e-3, "{sum} against {table}: n·v {nv}, roughness {roughness}");
        }
    }

    #[test]
    fn white_furnace_agrees_with_the_table() {
        let texels = white();
        let view = PanoramaView::new(32, 16, &texels).unwrap();
        for geometry in [Geometry::Smith, Geometry::Karis2013] {
            for (nv, roughness) in [(1.0, 0.3), (0.5, 0.5), (0.2, 1.0), (0.3, 0.2)] {
                let across = f64::sqrt(1.0 - nv * nv);
                let n = DVec3::new(0.0, 0.6, 0.8);
                let v = nv * n + across * DVec3::X;
                let surface = Surface { n, v, base_color: DVec3::new(1.0, 0.5, 0.2), metallic: 1.0, roughness };
                let sum = reflected(view, &surface, geometry, Scattering::Single);
                let table = specular_albedo(surface.base_color, nv, roughness, geometry);
                assert!(sum.specular.abs_diff_eq(table, 1e-3), "{} against {table}: {nv}, {roughness}", sum.specular);
                assert_eq!(sum.diffuse, DVec3::ZERO);
            }
        }
    }

    #[test]
    fn multiple_scattering_passes_the_white_furnace_test() {
        let texels = white();
        let view = PanoramaView::new(32, 16, &texels).unwrap();
        for (nv, roughness, metallic) in [(0.9, 1.0, 1.0), (0.4, 0.6, 0.5), (0.7, 0.3, 0.0)] {
            let v = DVec3::new(f64::sqrt(1.0 - nv * nv), 0.0, nv);
            let surface = Surface { n: DVec3::Z, v, base_color: DVec3::ONE, metallic, roughness };
            let sum = |scattering| {
                let Reflected { diffuse, specular } = reflected(view, &surface, Geometry::Smith, scattering);
                (diffuse + specular).x
            };
            let multiple = sum(Scattering::Multiple);
            assert!((multiple - 1.0).abs() < 2e-3, "{multiple}: {nv}, {roughness}, {metallic}");
            assert!(metallic == 0.0 || sum(Scattering::Single) < 0.95);
        }
    }

    #[test]
    fn a_matt_surface_reflects_the_irradiance() {
        let texels = sunny(64, 32);
        let view = PanoramaView::new(64, 32, &texels).unwrap();
        let n = DVec3::new(0.8, 0.6, 0.0);
        let surface = Surface { n, v: n, base_color: DVec3::splat(0.5), metallic: 0.0, roughness: 1.0 };
        let share = |geometry| {
            reflected(view, &surface, geometry, Scattering::Single).diffuse.x / (0.5 / PI * irradiance(view, n).x)
        };
        // At normal incidence v·h is the cosine of half the angle to l, at least 0.7: Fresnel takes 4.0 to 4.3 %.
        let karis = share(Geometry::Karis2013);
        assert!((0.957..0.9601).contains(&karis), "{karis}");
        // Under uniform light the diffuse part is the rest of the specular part; for light from above slightly more.
        let left = 1.0 - specular_albedo(DVec3::splat(0.04), 1.0, 1.0, Geometry::Smith).x;
        let smith = share(Geometry::Smith);
        assert!((left..1.03 * left).contains(&smith), "{smith} and {left}");
        let even = white();
        let view = PanoramaView::new(32, 16, &even).unwrap();
        let smith = reflected(view, &surface, Geometry::Smith, Scattering::Single).diffuse.x / 0.5;
        assert!((smith - left).abs() < 1e-4, "{smith} is not {left}");
    }
}
