//! Materials as model files describe them, checked: factors and maps of the metallic–roughness model.

use glam::{DVec3, Vec2, Vec3};
use serde::Serialize;

use super::image_source::ImageSource;
use super::texture::Pick;
use crate::reference::brdf::{self, Fresnel};
use crate::reference::film::Film;
use crate::reference::{sheen, tone};

/// Reflectance at normal incidence of most plastics, glass and wood, whose index of refraction is 1.5: ((1.5 − 1) / (1.5 + 1))².
pub const DIELECTRIC_F0: f32 = brdf::DIELECTRIC_F0 as f32;

/// The most radiance of a surface, W/(m² sr).
pub const MAX_EMISSION: f32 = 1e6;

/// The most index of refraction that is not infinite; diamond has 2.42.
pub const MAX_IOR: f32 = 10.0;
/// That of a surface that says nothing else; its reflectance is [`DIELECTRIC_F0`].
pub const USUAL_IOR: f32 = 1.5;

/// Of a dielectric with this index of refraction, by Fresnel's equations.
pub fn f0_from_ior(ior: f32) -> f32 {
    let ior = f64::from(ior);
    ((ior - 1.0) / (ior + 1.0)).powi(2) as f32
}

/// Least roughness of sheen.
pub const MIN_SHEEN_ROUGHNESS: f32 = sheen::MIN_SHEEN_ROUGHNESS as f32;

/// A thin film over a surface, whose interference colours what the surface reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinFilm {
    /// Of the surface that has it, 0 to 1.
    pub share: f32,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// Nanometres, where the map of it is 0 and 1; without a map the latter.
    pub thickness: [f32; 2],
}

impl ThinFilm {
    /// F0 by Schlick's form of a surface that reflects as much of light from all sides as one of this F0 and F90 with the film does,
    /// for all thicknesses.
    pub fn even_f0(&self, f0: Vec3, f90: f32) -> Vec3 {
        const THICKNESSES: u8 = 9;
        let [least, largest] = self.thickness;
        let bare = Fresnel { f0: f0.as_dvec3(), f90: f90.into() };
        let of = |i: u8| {
            let thickness = least + f32::from(i) / f32::from(THICKNESSES - 1) * (largest - least);
            let film =
                Film { share: self.share.into(), ior: self.ior.into(), thickness: thickness.into(), base_f0: bare.f0 };
            film.even(bare).f0
        };
        ((0..THICKNESSES).map(of).sum::<DVec3>() / f64::from(THICKNESSES)).as_vec3()
    }
}

/// Light that diffuses through a thin sheet, as through leaves, paper and lampshades.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// Of what would be reflected diffusely without it, 0 to 1.
    pub share: f32,
    /// By which that is multiplied on its way, linear RGB, 0 to 1.
    pub color: Vec3,
}

/// How a closed body bends light that goes through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refraction {
    /// Index of refraction, above 1.
    pub ior: f32,
    /// By how much that of blue light is above it, and that of red light below it: dispersion.
    pub ior_spread: f32,
    /// By which each of its surfaces multiplies light that goes through, linear RGB, 0 to 1. The base color map multiplies it, too.
    pub surface_transmission: Vec3,
    /// What it absorbs on the way, 1/m.
    pub absorption: Vec3,
    /// What all bodies of it are.
    pub shape: BodyShape,
}

/// The bodies through which pictures show their surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BodyShape {
    Balls,
    /// One that is convex: the farthest that a corner of it lies from its centre, local space.
    Convex {
        centre: Vec3,
        radius: f32,
    },
    /// Drawn as sheets.
    Other,
}

/// What the extension map of a material says texel by texel; the same numbers as in `glsl/shared.glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Extension {
    /// By which F0 of the part that is no metal is multiplied, sRGB, and in alpha by which both F0 and F90 are.
    Specular = 1,
    /// By which the sheen's color is multiplied, sRGB, and in alpha its roughness.
    Sheen,
    /// The direction in which highlights are stretched, as long as they are strongly: R and G stand for −1 to 1.
    Anisotropy,
    /// By which the color of diffuse transmission is multiplied, sRGB, and in alpha its share.
    DiffuseTransmission,
    /// Made at loading for a convex body that light is bent by: see `scene::body_map`.
    Body,
    /// The same for a body of few faces.
    Faces,
}

/// The maps of one extension of a material, which are packed in one texture.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtensionMaps {
    pub of: Extension,
    /// sRGB; of anisotropy direction and strength, linear RGB.
    pub color: Option<MapDesc>,
    /// One number; there is none of anisotropy.
    pub number: Option<MapDesc>,
}

/// A material of a model. Factors are in their range; each map, where it can be read, is multiplied by its factor.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialDesc {
    pub name: String,
    /// Linear RGB, 0 to 1.
    pub base_color: Factor<Vec3>,
    /// Multiplies alpha.
    pub opacity: f32,
    pub metallic: Factor<f32>,
    /// Perceptual roughness.
    pub roughness: Factor<f32>,
    /// Reflectance of the part that is no metal, 0 to 1: at normal incidence, linear RGB, and at grazing angles.
    pub dielectric_f0: Vec3,
    pub dielectric_f90: f32,
    /// The share that has a clear coat, 0 to 1: a dielectric layer of index 1.5 and of this roughness.
    pub clearcoat: f32,
    pub clearcoat_roughness: f32,
    /// Whether the normal map shows in the coat, too.
    pub clearcoat_bumps: bool,
    /// Multiplies the share.
    pub clearcoat_map: Option<MapDesc>,
    pub film: Option<ThinFilm>,
    /// Of its thickness; there is none where there is a map of the clear coat.
    pub film_map: Option<MapDesc>,
    /// In which direction highlights are stretched, along tangent and bitangent, as long as they are strongly: 0 to 1.
    pub anisotropy: Vec2,
    /// Color of the sheen of cloth, linear RGB, 0 to 1, and its roughness, [`MIN_SHEEN_ROUGHNESS`] to 1.
    pub sheen: Vec3,
    pub sheen_roughness: f32,
    pub diffuse_transmission: Option<DiffuseTransmission>,
    /// Radiance, W/(m² sr).
    pub emissive: Factor<Vec3>,
    /// sRGB; alpha as `alpha` says.
    pub base_color_map: Option<MapDesc>,
    /// Replaces the base color map's alpha.
    pub mask_map: Option<MapDesc>,
    pub normals: Option<NormalsDesc>,
    pub occlusion_map: Option<MapDesc>,
    /// 0: the occlusion map has no effect; 1: its full effect.
    pub occlusion_strength: f32,
    pub roughness_map: Option<MapDesc>,
    pub metallic_map: Option<MapDesc>,
    /// sRGB.
    pub emissive_map: Option<MapDesc>,
    pub extension_maps: Option<ExtensionMaps>,
    pub alpha: AlphaUse,
    /// Whether colours of vertices multiply alpha by less than 1.
    pub vertex_alpha: bool,
    /// Whether it is not seen from behind.
    pub culls_backs: bool,
    /// Of a sheet like glass: by which it multiplies light that goes through where it does not cover, linear RGB, 0 to 1. The base
    /// color map multiplies this instead of the base color. At slanted views less goes through.
    pub transmission: Option<Vec3>,
    /// Of a sheet that is the surface of a solid body: how it bends what goes through.
    pub refraction: Option<Refraction>,
    /// Whether its emission is its colour, which vertices may have, too.
    pub unlit: bool,
    /// What the file does not say and was taken from something else, or for granted.
    pub guesses: Vec<String>,
}

impl ExtensionMaps {
    /// Those that there are.
    pub fn all(&self) -> impl Iterator<Item = &MapDesc> {
        [&self.color, &self.number].into_iter().flatten()
    }
}

/// A factor's value where its map is read, and where there is none or it is broken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor<T> {
    pub with_map: T,
    pub alone: T,
}

impl<T: Copy> Factor<T> {
    /// The same with and without a map.
    pub fn same(value: T) -> Self {
        Self { with_map: value, alone: value }
    }

    /// Its value.
    pub fn of(&self, has_map: bool) -> T {
        if has_map { self.with_map } else { self.alone }
    }
}

/// What alpha means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaUse {
    /// The file does not say: a mask with a cutoff of one half if some texels are below it and some above, else nothing.
    Guessed,
    Opaque,
    /// Surfaces with less alpha are holes.
    Mask(f32),
    /// Coverage: the share of what is behind that is hidden.
    Blend,
    /// The same, of the opacity alone: the map's alpha means nothing.
    Opacity,
}

impl AlphaUse {
    /// Whether alpha is coverage.
    pub fn blends(self) -> bool {
        matches!(self, Self::Blend | Self::Opacity)
    }
}

/// A map of a material.
#[derive(Clone, Debug, PartialEq)]
pub struct MapDesc {
    pub image: ImageSource,
    /// Of a map of one number, the channel.
    pub pick: Pick,
    /// Whether it takes the second texture coordinates of its vertices.
    pub second_uv: bool,
    pub sampling: Sampling,
    /// File, key and name as a message begins: `stone.mtl:3: map_Kd stone.png`.
    pub origin: String,
}

/// A map that turns the normal.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalsDesc {
    pub map: MapDesc,
    pub kind: NormalsKind,
}

/// What such a map holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NormalsKind {
    /// Unit vectors, +Y up, whose x and y are multiplied by a factor.
    Vectors(f32),
    /// Heights in hundredths of the picture's width times this, or vectors: the picture shows which.
    Bump(f32),
}

/// How texels are looked up: glTF's samplers. Minification is always trilinear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Sampling {
    pub wrap: [Wrap; 2],
    /// Whether magnified texels are squares.
    pub nearest: bool,
}

/// Coordinates outside of 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Wrap {
    #[default]
    Repeat,
    Mirror,
    Clamp,
}

impl MaterialDesc {
    /// A material without maps.
    pub fn plain(name: &str, base_color: Vec3, metallic: f32, roughness: f32) -> Self {
        Self {
            name: name.into(),
            base_color: Factor::same(base_color),
            opacity: 1.0,
            metallic: Factor::same(metallic),
            roughness: Factor::same(roughness),
            dielectric_f0: Vec3::splat(DIELECTRIC_F0),
            dielectric_f90: 1.0,
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            clearcoat_bumps: false,
            anisotropy: Vec2::ZERO,
            clearcoat_map: None,
            film: None,
            film_map: None,
            sheen: Vec3::ZERO,
            sheen_roughness: 1.0,
            diffuse_transmission: None,
            emissive: Factor::same(Vec3::ZERO),
            base_color_map: None,
            mask_map: None,
            normals: None,
            occlusion_map: None,
            occlusion_strength: 1.0,
            roughness_map: None,
            metallic_map: None,
            emissive_map: None,
            extension_maps: None,
            alpha: AlphaUse::Opaque,
            vertex_alpha: false,
            culls_backs: false,
            transmission: None,
            refraction: None,
            unlit: false,
            guesses: Vec::new(),
        }
    }

    /// Makes a thin sheet of it, with no refraction: of light that meets it, `share` times its base color goes straight through,
    /// less what a smooth surface reflects. What it covers is a mirror of all that is reflected, and the base color of what does
    /// not transmit, there without its map. `inside`: by which what is behind its surface multiplies light.
    /// From behind it is the same sheet.
    pub fn transmit(&mut self, share: f32, inside: Vec3) {
        // Of light from all sides, by Schlick's form; shaders make it more at slanted views.
        let luminance = |color: Vec3| tone::luminance(color.as_dvec3()) as f32;
        // Of a film its mean colour; in mirror images it is that of a metal.
        let f0 = self.film.take().map_or(Vec3::splat(luminance(self.dielectric_f0)), |film| {
            film.even_f0(self.dielectric_f0, self.dielectric_f90)
        });
        let reflectance_of = f0 + (Vec3::splat(self.dielectric_f90) - f0) / 21.0;
        let reflectance = reflectance_of.max_element();
        let color = self.base_color.alone;
        let mirrored = share * reflectance;
        let coverage = 1.0 - share * (1.0 - reflectance);
        let covering = (share * reflectance_of + (1.0 - share) * color) / coverage;
        self.transmission = Some(inside * self.base_color.of(self.base_color_map.is_some()));
        self.culls_backs = false;
        self.base_color = Factor::same(covering.min(Vec3::ONE));
        self.metallic = Factor::same(mirrored / (mirrored + (1.0 - share) * luminance(color)));
        // Its red is not to be that of a mirror.
        self.metallic_map = None;
        // Alpha of an opaque material's map means nothing, and counts where a material is blended.
        let (opacity, alpha) = match self.alpha {
            AlphaUse::Blend => (self.opacity, AlphaUse::Blend),
            _ => (1.0, AlphaUse::Opacity),
        };
        (self.opacity, self.alpha) = (coverage * opacity, alpha);
        // Coverage divides all that a surface sends.
        self.emissive = Factor::same((self.emissive.alone / coverage).min(Vec3::splat(MAX_EMISSION)));
    }

    /// Makes the surface of a solid body of what [`Self::transmit`] has made a sheet of; `surface_transmission`: without its map.
    /// Without effect where a body would bend nothing.
    pub fn refract(&mut self, [ior, ior_spread]: [f32; 2], surface_transmission: Vec3, absorption: Vec3) {
        let refraction = Refraction { ior, ior_spread, surface_transmission, absorption, shape: BodyShape::Other };
        self.refraction = (ior > 1.0).then_some(refraction);
    }

    /// Its maps, as messages name them.
    pub fn origins(&self) -> Vec<String> {
        let normals = self.normals.as_ref().map(|normals| &normals.map);
        let maps = [&self.base_color_map, &self.mask_map, &self.occlusion_map, &self.roughness_map, &self.metallic_map];
        let extension = self.extension_maps.iter().flat_map(ExtensionMaps::all);
        let others = [&self.emissive_map, &self.clearcoat_map, &self.film_map].into_iter().flatten();
        let maps = maps.into_iter().flatten().chain(others).chain(normals).chain(extension);
        maps.map(|map| map.origin.clone()).collect()
    }
}
