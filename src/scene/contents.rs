//! The data of a scene: instances, materials, lights, cameras, environment.

use glam::{Mat4, Vec2, Vec3};
use serde::Serialize;

use super::mesh::{Bounds, Mesh};
use crate::asset::material::{DiffuseTransmission, Extension, Refraction, Sampling, ThinFilm};
use crate::asset::model::Cone;
use crate::asset::{MipChain, Panorama};

/// A loaded scene. World space is right-handed, +Y up, in metres.
#[derive(Clone, Debug)]
pub struct Scene {
    pub meshes: Vec<Mesh>,
    pub instances: Vec<Instance>,
    pub materials: Vec<Material>,
    /// Where the first materials come from.
    pub sources: Vec<MaterialSource>,
    pub textures: Vec<MipChain>,
    pub lights: Vec<PointLight>,
    /// At least one.
    pub cameras: Vec<Camera>,
    pub environment: Environment,
    /// Where mirror images are captured; none: as found by rays.
    pub probes: Vec<Probe>,
    /// Exposure in stops: displayed = radiance · 2^exposure_ev.
    pub exposure_ev: f32,
}

impl Scene {
    /// Its geometry.
    pub fn geometry(&self) -> GeometryView<'_> {
        GeometryView { meshes: &self.meshes, instances: &self.instances }
    }

    /// Number of triangles, those of a mesh counted for each instance.
    pub fn triangles(&self) -> usize {
        self.instances.iter().map(|i| self.meshes[i.mesh].indices.len() / 3).sum()
    }

    /// Bounds of everything in world space; empty without instances.
    pub fn bounds(&self) -> Bounds {
        self.geometry().bounds()
    }
}

/// Meshes and their placements.
#[derive(Clone, Copy, Debug)]
pub struct GeometryView<'a> {
    pub meshes: &'a [Mesh],
    pub instances: &'a [Instance],
}

impl GeometryView<'_> {
    /// Bounds of everything in world space; empty without instances.
    pub fn bounds(&self) -> Bounds {
        let placed = self.instances.iter().map(|i| self.meshes[i.mesh].bounds.placed(i.world_from_local));
        Bounds::of(placed.filter(|b| *b != Bounds::EMPTY).flat_map(|b| [b.min, b.max]))
    }
}

/// A mesh with its transform.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    pub world_from_local: Mat4,
}

/// The most maps of a material.
pub const MAPS: usize = 5;

/// Metallic–roughness material; each map, where present, is multiplied by its factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub name: String,
    /// Linear RGB.
    pub base_color_factor: Vec3,
    /// Multiplies alpha where the material blends.
    pub opacity: f32,
    pub metallic_factor: f32,
    /// Perceptual roughness: alpha = roughness².
    pub roughness_factor: f32,
    /// Reflectance at normal incidence of the part that is no metal.
    pub dielectric_f0: Vec3,
    /// At grazing angles, 0 to 1.
    pub dielectric_f90: f32,
    /// The share that has a clear coat, 0 to 1; the ORM map's alpha multiplies it.
    pub clearcoat_factor: f32,
    pub clearcoat_roughness: f32,
    /// Whether the normal map shows in the coat, too.
    pub clearcoat_bumps: bool,
    /// A thin film below the coat, whose thickness the ORM map's alpha says where the coat has no map.
    pub film: Option<ThinFilm>,
    /// In which direction highlights are stretched, along tangent and bitangent, as long as they are strongly: 0 to 1.
    pub anisotropy: Vec2,
    /// Linear RGB, 0 to 1; black where it has no sheen.
    pub sheen_color: Vec3,
    pub sheen_roughness: f32,
    pub diffuse_transmission: Option<DiffuseTransmission>,
    /// Radiance, W/(m² sr).
    pub emissive_factor: Vec3,
    /// Indices into [`Scene::textures`].
    pub base_color_map: Option<usize>,
    pub normal_map: Option<usize>,
    /// Occlusion, roughness, metallic in R, G, B.
    pub orm_map: Option<usize>,
    pub emissive_map: Option<usize>,
    /// With what it is a map of.
    pub extension_map: Option<(Extension, usize)>,
    /// How base color, normal, ORM, emissive and extension map are looked up.
    pub lookups: [Lookup; MAPS],
    /// Minimum and maximum of factor times map; coarser levels of a map may be rougher, where normals vary.
    pub metallic_range: [f32; 2],
    pub roughness_range: [f32; 2],
    /// Whether occlusion in the ORM map darkens anything.
    pub occludes: bool,
    /// With `Some(a)`, fragments whose base color map has alpha < a are discarded.
    pub alpha_cutoff: Option<f32>,
    /// Whether alpha is coverage: the share of what is behind that is hidden.
    pub blends: bool,
    /// Whether it is not seen from behind.
    pub culls_backs: bool,
    /// Whether colours of vertices multiply base color and alpha.
    pub vertex_colours: bool,
    /// Of a sheet like glass: by which it and the base color map multiply light that goes through where it does not cover. At
    /// slanted views less goes through.
    pub transmission: Option<Vec3>,
    /// Of a sheet that is the surface of closed bodies: how they bend what goes through.
    pub refraction: Option<Refraction>,
    /// Whether its emission is its colour.
    pub unlit: bool,
}

/// Where a material comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MaterialSource {
    /// Its maps, as messages name them.
    pub maps: Vec<String>,
    /// What its file does not say.
    pub guesses: Vec<String>,
}

impl Material {
    /// Whether what is no metal in it reflects otherwise than by an index of refraction alone.
    pub fn has_specular_factors(&self) -> bool {
        let has_map = self.extension_map.is_some_and(|(of, _)| of == Extension::Specular);
        has_map
            || self.film.is_some()
            || self.dielectric_f0 != Vec3::splat(self.dielectric_f0.x)
            || self.dielectric_f90 != 1.0
    }

    /// F0 of the part that is no metal for light from all sides, with the film.
    pub fn even_dielectric_f0(&self) -> Vec3 {
        self.film.map_or(self.dielectric_f0, |film| film.even_f0(self.dielectric_f0, self.dielectric_f90))
    }

    /// Base color, normal, ORM, emissive and extension map.
    pub fn maps(&self) -> [Option<usize>; MAPS] {
        let extension = self.extension_map.map(|(_, map)| map);
        [self.base_color_map, self.normal_map, self.orm_map, self.emissive_map, extension]
    }

    /// Whether light that goes through it changes its colour.
    pub fn tints(&self) -> bool {
        let is_clear = |color: Vec3| color == Vec3::ONE && self.base_color_map.is_none() && !self.vertex_colours;
        self.blends && self.transmission.is_some_and(|color| !is_clear(color))
    }

    /// Whether a map is looked up by second texture coordinates.
    pub fn takes_second_uv(&self) -> bool {
        self.lookups.iter().any(|lookup| lookup.second_uv)
    }
}

/// How a map is looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Lookup {
    pub sampling: Sampling,
    /// Whether by a vertex's second texture coordinates.
    pub second_uv: bool,
}

/// A point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    pub position: Vec3,
    /// Radiant intensity per channel, W/sr.
    pub intensity: Vec3,
    /// Metres; 0 for a point. The size of its shadows' penumbrae; it shines as a point does.
    pub radius: f32,
    /// Where a spot light shines; `None`: to all sides.
    pub cone: Option<Cone>,
}

/// A place to capture light, and the box that what is seen from there is taken to lie on. World space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    pub position: Vec3,
    pub bounds: Bounds,
    /// The box around a thing that alone mirrors what is captured, which is what lies outside; `None`: all in `bounds` does.
    pub thing: Option<Bounds>,
}

/// A named viewpoint.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    pub name: String,
    pub position: Vec3,
    pub target: Vec3,
    pub vertical_fov_degrees: f32,
}

/// The panorama around the scene.
#[derive(Clone, Debug)]
pub struct Environment {
    pub panorama: Panorama,
    /// Turns the panorama about +Y, counter-clockwise seen from above.
    pub rotation_degrees: f32,
}
