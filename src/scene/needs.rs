//! The features of the renderer that a scene needs, and those that would cost time and not change the picture.

pub mod casting;
pub mod findings;
pub mod lightmap;
pub mod mirrors;
pub mod resolution;

use clap::ValueEnum;
use glam::{Vec2, Vec3};
use serde::Serialize;

use super::{Material, Scene};
use crate::asset::material::{BodyShape, Extension};
use crate::reference::brdf::{round_roughness, stretched_alphas};
use crate::reference::energy::is_multi_scatter_visible;
use casting::nothing_casts;
use resolution::{Viewpoint, first_levels};

/// Which features are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum Model {
    /// Those that the scene needs.
    #[default]
    Needed,
    /// All, needed or not: the same picture, slower; for measurements.
    Everything,
}

/// Which part of a material's surface is metal; the same order as in `glsl/shared.glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Metalness {
    /// Dielectric everywhere: reflects as its index of refraction says, without colour.
    Dielectric,
    /// Metal everywhere: no diffuse reflection.
    Metal,
    /// Both: a map or a factor between 0 and 1.
    Mixed,
}

/// What colours of vertices multiply; the same order as in `glsl/shared.glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum VertexColours {
    None,
    /// Base color and alpha.
    Base,
    /// And emission, which an unlit material's colour is.
    Emission,
}

/// The features that a material needs; each combination is a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct MaterialFeatures {
    pub base_color_map: bool,
    pub normal_map: bool,
    /// Occlusion, roughness, metallic.
    pub orm_map: bool,
    pub alpha_mask: bool,
    pub metalness: Metalness,
    /// Multiple scattering between microfacets; without it a rough metal is too dark.
    pub multi_scatter: bool,
    /// Light of its own.
    pub emits: bool,
    pub vertex_colours: VertexColours,
    /// Bit i: the base color, normal, ORM, emissive or extension map takes second texture coordinates.
    pub second_uv: u32,
    /// Coverage by alpha, over what is behind.
    pub blends: bool,
    /// What is behind is seen in another colour.
    pub tints: bool,
    /// Dielectrics whose reflectance is not gray, or not 1 at grazing angles.
    pub specular: bool,
    /// A clear coat.
    pub clearcoat: bool,
    /// The sheen of cloth.
    pub sheen: bool,
    /// Stretched highlights.
    pub anisotropy: bool,
    /// A thin film.
    pub film: bool,
    /// Light that diffuses through.
    pub diffuse_transmission: bool,
    /// A map of an extension.
    pub extension_map: Option<Extension>,
    /// Balls and other convex bodies through which their surroundings are seen.
    pub refracts: bool,
    /// These split light into colours.
    pub disperses: bool,
}

impl MaterialFeatures {
    /// Without what a vertex or a pipeline has to have for it.
    pub(super) const EVERYTHING: Self = Self {
        base_color_map: true,
        normal_map: true,
        orm_map: true,
        alpha_mask: true,
        metalness: Metalness::Mixed,
        multi_scatter: true,
        emits: true,
        vertex_colours: VertexColours::None,
        second_uv: 0,
        blends: false,
        tints: false,
        specular: false,
        clearcoat: false,
        sheen: false,
        anisotropy: false,
        film: false,
        diffuse_transmission: false,
        extension_map: None,
        refracts: false,
        disperses: false,
    };

    /// The same for any factors of base color, metallic and roughness.
    pub fn with_any_factors(self) -> Self {
        Self { metalness: Metalness::Mixed, multi_scatter: true, ..self }
    }

    /// Everything but what only this material's vertices have, or what changes its picture.
    fn everything(material: &Material) -> Self {
        let Self { base_color_map, normal_map, orm_map, alpha_mask, metalness, multi_scatter, emits, .. } =
            Self::EVERYTHING;
        Self { base_color_map, normal_map, orm_map, alpha_mask, metalness, multi_scatter, emits, ..Self::of(material) }
    }

    fn of(material: &Material) -> Self {
        let seen_through = material.refraction.filter(|body| material.blends && body.shape != BodyShape::Other);
        Self {
            base_color_map: material.base_color_map.is_some(),
            normal_map: material.normal_map.is_some(),
            orm_map: material.orm_map.is_some(),
            alpha_mask: material.alpha_cutoff.is_some(),
            metalness: match material.metallic_range {
                [_, most] if most <= 0.0 => Metalness::Dielectric,
                [least, _] if least >= 1.0 => Metalness::Metal,
                _ => Metalness::Mixed,
            },
            multi_scatter: multi_scatter(material),
            emits: material.emissive_factor != Vec3::ZERO,
            vertex_colours: match material.vertex_colours {
                false => VertexColours::None,
                true if material.unlit => VertexColours::Emission,
                true => VertexColours::Base,
            },
            second_uv: (0..).zip(material.lookups).map(|(i, lookup)| u32::from(lookup.second_uv) << i).sum(),
            blends: material.blends,
            tints: material.tints(),
            specular: material.has_specular_factors(),
            clearcoat: material.clearcoat_factor > 0.0,
            sheen: material.sheen_color != Vec3::ZERO,
            anisotropy: material.anisotropy != Vec2::ZERO,
            film: material.film.is_some(),
            diffuse_transmission: material.diffuse_transmission.is_some(),
            extension_map: material.extension_map.map(|(of, _)| of),
            refracts: seen_through.is_some(),
            disperses: seen_through.is_some_and(|refraction| refraction.ior_spread > 0.0),
        }
    }
}

/// Whether multiple scattering could be visible on any part of a material. Maps multiply the base color by at most 1.
fn multi_scatter(material: &Material) -> bool {
    let [roughness, metallic] = [material.roughness_range, material.metallic_range].map(|[_, most]| f64::from(most));
    let roughness = round_roughness(stretched_alphas(roughness * roughness, material.anisotropy.length().into()));
    is_multi_scatter_visible(
        roughness,
        metallic,
        material.base_color_factor.max_element().into(),
        material.even_dielectric_f0().max_element().into(),
    )
}

/// More point lights than these are not counted by shaders made for their number, but by any frame.
pub const MAX_COUNTED_LIGHTS: usize = 64;

/// The features that the renderer builds for a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneFeatures {
    /// One for each of the scene's materials.
    pub materials: Vec<MaterialFeatures>,
    /// The number of point lights, a constant of the shaders, at most [`MAX_COUNTED_LIGHTS`]; `None` for any number.
    pub lights: Option<u32>,
    /// Whether anything may cast a shadow on anything.
    pub casts: bool,
    /// The finest level of each texture that can be read.
    pub first_levels: Vec<u32>,
}

impl SceneFeatures {
    /// The features for a scene seen from one viewpoint only, or from anywhere.
    pub fn of(scene: &Scene, model: Model, viewpoint: Option<Viewpoint>) -> Self {
        let whole = vec![0; scene.textures.len()];
        match model {
            Model::Needed => Self {
                materials: scene.materials.iter().map(MaterialFeatures::of).collect(),
                lights: (scene.lights.len() <= MAX_COUNTED_LIGHTS).then_some(scene.lights.len() as u32),
                casts: nothing_casts(scene).is_none(),
                first_levels: viewpoint.map_or(whole, |viewpoint| first_levels(scene, viewpoint)),
            },
            Model::Everything => Self {
                materials: scene.materials.iter().map(MaterialFeatures::everything).collect(),
                lights: None,
                casts: true,
                first_levels: whole,
            },
        }
    }

    /// Number of different pipelines.
    pub fn pipelines(&self) -> usize {
        self.materials.iter().collect::<std::collections::HashSet<_>>().len()
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::asset::Panorama;
    use crate::scene::material::default_material;
    use crate::scene::{Environment, PointLight};

    pub fn scene(materials: Vec<Material>, lights: usize) -> Scene {
        let light = PointLight { position: Vec3::Y, intensity: Vec3::ONE, radius: 0.0, cone: None };
        Scene {
            meshes: vec![],
            instances: vec![],
            materials,
            sources: Vec::new(),
            textures: vec![],
            lights: vec![light; lights],
            cameras: vec![],
            environment: Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees: 0.0 },
            probes: vec![],
            exposure_ev: 0.0,
        }
    }

    #[test]
    fn absent_maps_are_not_needed() {
        let all = Material {
            base_color_map: Some(0),
            normal_map: Some(1),
            orm_map: Some(2),
            alpha_cutoff: Some(0.5),
            metallic_range: [0.0, 1.0],
            emissive_factor: Vec3::ONE,
            ..default_material()
        };
        let features = SceneFeatures::of(&scene(vec![default_material(), all], 0), Model::Needed, None);
        assert_eq!(features.materials[1], MaterialFeatures::EVERYTHING);
        let plain = MaterialFeatures {
            base_color_map: false,
            normal_map: false,
            orm_map: false,
            alpha_mask: false,
            metalness: Metalness::Dielectric,
            multi_scatter: false,
            emits: false,
            ..MaterialFeatures::EVERYTHING
        };
        assert_eq!(features.materials[0], plain);
        assert_eq!(features.pipelines(), 2);
    }

    #[test]
    fn metalness_follows_from_the_range_of_factor_times_map() {
        let metalness = |metallic_range| {
            let material = Material { metallic_range, ..default_material() };
            SceneFeatures::of(&scene(vec![material], 0), Model::Needed, None).materials[0].metalness
        };
        assert_eq!(metalness([0.0, 0.0]), Metalness::Dielectric);
        assert_eq!(metalness([1.0, 1.0]), Metalness::Metal);
        for range in [[0.0, 0.004], [0.996, 1.0], [0.0, 1.0], [0.5, 0.5]] {
            assert_eq!(metalness(range), Metalness::Mixed, "{range:?}");
        }
    }

    #[test]
    fn rough_metals_need_multiple_scattering() {
        for (base_color, metallic, roughness, needed) in
            [(0.9, 1.0, 0.6, true), (0.9, 1.0, 0.02, false), (0.9, 0.0, 1.0, false), (0.05, 1.0, 0.5, false)]
        {
            let material = Material::plain("plain", Vec3::splat(base_color), metallic, roughness);
            let features = SceneFeatures::of(&scene(vec![material], 0), Model::Needed, None);
            assert_eq!(features.materials[0].multi_scatter, needed, "{base_color}, {metallic}, {roughness}");
        }
    }

    #[test]
    fn a_smooth_metal_is_rough_where_its_highlights_are_stretched() {
        let anisotropy = Vec2::new(0.0, 0.8);
        let material = Material { anisotropy, ..Material::plain("brushed", Vec3::splat(0.9), 1.0, 0.02) };
        assert!(SceneFeatures::of(&scene(vec![material], 0), Model::Needed, None).materials[0].multi_scatter);
    }

    #[test]
    fn lights_are_counted() {
        for count in [0, 1, MAX_COUNTED_LIGHTS] {
            assert_eq!(SceneFeatures::of(&scene(vec![], count), Model::Needed, None).lights, Some(count as u32));
            assert_eq!(SceneFeatures::of(&scene(vec![], count), Model::Everything, None).lights, None);
        }
        let many = scene(vec![], MAX_COUNTED_LIGHTS + 1);
        assert_eq!(SceneFeatures::of(&many, Model::Needed, None).lights, None);
    }

    #[test]
    fn everything_is_everything() {
        let features = SceneFeatures::of(&scene(vec![default_material(); 3], 1), Model::Everything, None);
        assert_eq!(features.materials, [MaterialFeatures::EVERYTHING; 3]);
        assert_eq!(features.pipelines(), 1);
    }
}
