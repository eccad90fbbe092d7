//! A scene's copy on the GPU: geometry, instances, materials with their textures, point lights; and the ranges to draw.

mod geometry;
mod probe_parts;
mod textures;
mod vertex;

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;

use super::draws::{Draw, Layer, ProbeUse};
use super::edits::{EditPlaces, SceneEdits};
use super::ray_scene::LazyRayScene;
use super::settings::RenderSettings;
use super::shadow_plan::ShadowPlan;
use super::shared::{InstanceBlock, LightBlock, MaterialBlock, SphereLightBlock, material_flag};
use crate::Result;
use crate::asset::material::{BodyShape, DiffuseTransmission, Refraction, ThinFilm};
use crate::asset::model::Cone;
use crate::context::Context;
use crate::gpu::{Buffer, BufferKind, Commands, Gpu};
use crate::scene::cluster::{Cluster, clusters};
use crate::scene::needs::{MAX_COUNTED_LIGHTS, mirrors};
use crate::scene::sphere_lights::{MAX_SPHERE_LIGHTS, SphereLight};
use crate::scene::{GeometryView, Lookup, Material, MaterialFeatures, PointLight, Probe, Scene, SceneFeatures};
pub use geometry::Geometry;
pub use textures::{SceneTextures, TextureFacts, affordable_bytes};
pub use vertex::{ATTRIBUTES, PackedVertex};

/// Textures that were offered in place of others.
pub struct Replaced {
    pub are_shown: bool,
    /// Those that are not needed.
    pub left: SceneTextures,
}

/// The GPU resources of a scene without its environment.
pub struct SceneResources {
    pub geometry: Geometry,
    /// `InstanceBlock`, `MaterialBlock` and `LightBlock` each.
    pub instances: Arc<Buffer>,
    pub materials: Arc<Buffer>,
    pub lights: Arc<Buffer>,
    /// What the scene's file has of the last two.
    pub material_blocks: Vec<MaterialBlock>,
    pub light_blocks: Vec<LightBlock>,
    pub light_count: u32,
    /// For mirror images, in the models' space; the first `sphere_light_count` of them.
    pub sphere_lights: [SphereLightBlock; MAX_SPHERE_LIGHTS],
    pub sphere_light_count: u32,
    pub shadow_plan: ShadowPlan,
    /// Each combination of features that a material needs; [`Draw::variant`] is an index.
    pub variants: Vec<MaterialFeatures>,
    /// For each of the scene's materials, the index of its combination.
    pub variant_of_materials: Vec<u32>,
    /// The number of point lights that shaders are made for; `None` for any.
    pub constant_lights: Option<u32>,
    /// [`Draw::textures`] is an index of one of its sets.
    pub textures: SceneTextures,
    /// What rays meet, from when they are first traced.
    pub ray_scene: Arc<LazyRayScene>,
    pub draws: Vec<Draw>,
}

impl SceneResources {
    /// Draws with the same textures at other levels from now on; returns those before. Others, of a file that has changed, are
    /// refused and returned.
    pub fn replace_textures(&mut self, textures: SceneTextures) -> Replaced {
        if self.textures.of_materials != textures.of_materials {
            return Replaced { are_shown: false, left: textures };
        }
        self.ray_scene.set_textures(&textures.sets);
        Replaced { are_shown: true, left: std::mem::replace(&mut self.textures, textures) }
    }

    /// Whether something colours the light behind it.
    pub fn tints(&self) -> bool {
        self.variants.iter().any(|features| features.tints)
    }

    /// The combinations that pipelines are made for: those of edited materials can show any factors.
    pub fn variants_for(&self, edits: &SceneEdits) -> Vec<MaterialFeatures> {
        let mut variants = self.variants.clone();
        for material in edits.materials.keys() {
            if let Some(variant) = self.variant_of_materials.get(*material) {
                let features = &mut variants[*variant as usize];
                *features = features.with_any_factors();
            }
        }
        variants
    }

    /// Says of each draw which of these probes give its mirror images; splits those of `clusters`, which they were made of, that
    /// several give.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn place_probes(&mut self, gpu: &Arc<Gpu>, mut clusters: Vec<Cluster>, probes: &[Probe]) -> Result<()> {
        let mut draws = std::mem::take(&mut self.draws).into_iter();
        let mut is_reordered = false;
        for cluster in &mut clusters {
            for mut draw in draws.by_ref().take(cluster.placements.len()) {
                draw.probes = ProbeUse::new(probes, draw.bounds());
                match (draw.probes, &cluster.placements[..]) {
                    (ProbeUse::Several(_), [place]) if draw.is_solid() => {
                        let place = *place;
                        self.draws.extend(probe_parts::part(&draw, cluster, place, probes));
                        is_reordered = true;
                    }
                    _ => self.draws.push(draw),
                }
            }
        }
        if is_reordered { self.geometry.reorder(gpu, &clusters) } else { Ok(()) }
    }

    /// Of each variant, whether something is drawn with it by each kind of [`ProbeUse`].
    pub fn drawn_kinds(&self) -> Vec<[bool; ProbeUse::KINDS]> {
        let mut drawn = vec![[false; ProbeUse::KINDS]; self.variants.len()];
        for draw in &self.draws {
            drawn[draw.variant as usize][draw.probes.kind()] = true;
        }
        drawn
    }

    /// Records the writing of these materials and lamps as they are with their changes.
    pub fn write(&self, commands: &mut Commands<'_>, edits: &SceneEdits, places: &EditPlaces) {
        for index in &places.materials {
            if let Some(block) = self.material_blocks.get(*index) {
                let (block, offset) = (edits.material(*index, *block), index * size_of::<MaterialBlock>());
                commands.update_buffer(&self.materials, offset as u64, bytemuck::bytes_of(&block));
            }
        }
        for index in &places.lamps {
            if let Some(block) = self.light_blocks.get(*index) {
                let (block, offset) = (edits.lamp(*index, *block), index * size_of::<LightBlock>());
                commands.update_buffer(&self.lights, offset as u64, bytemuck::bytes_of(&block));
            }
        }
    }

    /// Uploads a scene whose textures are there with this geometry: its own, or the same with lightmap coordinates.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn new(
        context: &Context,
        textures: SceneTextures,
        scene: &Scene,
        geometry: GeometryView<'_>,
        settings: &RenderSettings,
    ) -> Result<Self> {
        Self::with_clusters(context, textures, scene, geometry, settings).map(|(resources, _)| resources)
    }

    /// The same, and the clusters that its draws are of, in their order.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn with_clusters(
        context: &Context,
        textures: SceneTextures,
        scene: &Scene,
        geometry: GeometryView<'_>,
        settings: &RenderSettings,
    ) -> Result<(Self, Vec<Cluster>)> {
        let gpu = &context.gpu;
        let features = SceneFeatures::of(scene, settings.model, settings.viewpoint);
        let blends: Vec<bool> = scene.materials.iter().map(|material| material.blends).collect();
        let clusters = clusters(geometry.meshes, geometry.instances, &blends);
        let buffers = Geometry::new(gpu, &clusters, scene.materials.iter().any(Material::takes_second_uv))?;
        let mut variants = Variants::default();
        let mut drawn = |i: usize| {
            let MaterialFeatures { blends, alpha_mask, .. } = features.materials[i];
            DrawnMaterial {
                variant: variants.index(features.materials[i]),
                textures: textures.of_materials[i],
                layer: [Layer::Opaque, Layer::Masked, Layer::Blended][if blends { 2 } else { alpha_mask.into() }],
                single_sided: scene.materials[i].culls_backs,
            }
        };
        let drawn: Vec<DrawnMaterial> = (0..scene.materials.len()).map(&mut drawn).collect();
        let spheres = match mirrors::any(scene, settings.model) {
            true => SphereLight::all(geometry, &scene.materials),
            false => Vec::new(),
        };
        let shadow_plan = ShadowPlan::new(context, (scene, &spheres), features.casts, &settings.light_detail);
        let mut sphere_lights = [SphereLightBlock::default(); MAX_SPHERE_LIGHTS];
        for (i, (block, sphere)) in sphere_lights.iter_mut().zip(&spheres).enumerate() {
            *block = sphere_block(sphere, shadow_plan.of_lamp(scene.lights.len() + i));
        }
        let lamp = |(i, light): (usize, &PointLight)| light_block(light, shadow_plan.of_lamp(i));
        let lights: Vec<LightBlock> = scene.lights.iter().enumerate().map(lamp).collect();
        let block = |(material, drawn): (&Material, &DrawnMaterial)| material_block(material, drawn.textures);
        let blocks: Vec<MaterialBlock> = scene.materials.iter().zip(&drawn).map(block).collect();
        let (draws, instances) = draws(&clusters, &buffers, &drawn);
        let resources = Self {
            geometry: buffers,
            instances: storage(gpu, "instances", &instances)?,
            materials: storage(gpu, "materials", &blocks)?,
            lights: light_buffer(gpu, &lights)?,
            light_count: u32::try_from(lights.len()).unwrap_or(u32::MAX),
            sphere_lights,
            sphere_light_count: spheres.len() as u32,
            material_blocks: blocks,
            light_blocks: lights,
            shadow_plan,
            variants: variants.all,
            variant_of_materials: drawn.iter().map(|drawn| drawn.variant).collect(),
            constant_lights: features.lights,
            ray_scene: Arc::new(LazyRayScene::new(scene, geometry, &textures.sets, spheres)),
            textures,
            draws,
        };
        if resources.tints() && !gpu.blends_two_sources() {
            let told = "no blending of two sources; what is seen through coloured glass keeps its colour";
            context.report.warn(format!("{}: {told}", gpu.info().name));
        }
        Ok((resources, clusters))
    }
}

/// What a material's draws have: see [`Draw`].
#[derive(Clone, Copy)]
struct DrawnMaterial {
    variant: u32,
    textures: u32,
    layer: Layer,
    single_sided: bool,
}

/// Combinations of features, each once.
#[derive(Default)]
struct Variants {
    all: Vec<MaterialFeatures>,
    known: HashMap<MaterialFeatures, u32>,
}

impl Variants {
    fn index(&mut self, features: MaterialFeatures) -> u32 {
        *self.known.entry(features).or_insert_with(|| {
            self.all.push(features);
            self.all.len() as u32 - 1
        })
    }
}

/// One draw per cluster and placement, and the instances, each a material at a placement.
fn draws(clusters: &[Cluster], geometry: &Geometry, materials: &[DrawnMaterial]) -> (Vec<Draw>, Vec<InstanceBlock>) {
    let (mut draws, mut instances) = (Vec::new(), Vec::new());
    let mut known: HashMap<(usize, [u32; 16]), u32> = HashMap::new();
    for (cluster, indices) in clusters.iter().zip(&geometry.ranges) {
        let DrawnMaterial { variant, textures, layer, single_sided } = materials[cluster.material];
        for world_from_local in &cluster.placements {
            let bits = world_from_local.to_cols_array().map(f32::to_bits);
            let instance = *known.entry((cluster.material, bits)).or_insert_with(|| {
                let world_from_local = world_from_local.to_cols_array_2d();
                instances.push(InstanceBlock { world_from_local, material: cluster.material as u32 });
                instances.len() as u32 - 1
            });
            let mut draw = Draw::new(cluster, indices.clone(), instance, *world_from_local, layer);
            (draw.variant, draw.textures, draw.single_sided) = (variant, textures, single_sided);
            draws.push(draw);
        }
    }
    (draws, instances)
}

/// A storage buffer of these blocks, or of a single zero one: a buffer cannot be empty.
fn storage<T: bytemuck::Pod>(gpu: &Arc<Gpu>, name: &str, blocks: &[T]) -> Result<Arc<Buffer>> {
    let none = [T::zeroed()];
    let blocks = if blocks.is_empty() { &none } else { blocks };
    Buffer::with_bytes(gpu, name, BufferKind::FromCpu, bytemuck::cast_slice(blocks))
}

/// With room for as many as shaders are made for.
fn light_buffer(gpu: &Arc<Gpu>, lights: &[LightBlock]) -> Result<Arc<Buffer>> {
    let mut all = lights.to_vec();
    all.resize(lights.len().max(MAX_COUNTED_LIGHTS), LightBlock::default());
    storage(gpu, "lights", &all)
}

fn material_block(material: &Material, textures: u32) -> MaterialBlock {
    let straight = Refraction {
        ior: 1.0,
        ior_spread: 0.0,
        surface_transmission: Vec3::ONE,
        absorption: Vec3::ZERO,
        shape: BodyShape::Other,
    };
    let refraction = material.refraction.unwrap_or(straight);
    let (body_centre, body_radius) = match refraction.shape {
        BodyShape::Convex { centre, radius } => (centre, radius),
        _ => (Vec3::ZERO, 0.0),
    };
    let through = material.diffuse_transmission.unwrap_or(DiffuseTransmission { share: 0.0, color: Vec3::ZERO });
    let film = material.film.unwrap_or(ThinFilm { share: 0.0, ior: 1.0, thickness: [0.0; 2] });
    MaterialBlock {
        base_color: material.base_color_factor.into(),
        metallic: material.metallic_factor,
        roughness: material.roughness_factor,
        alpha_cutoff: material.alpha_cutoff.unwrap_or(0.0),
        textures,
        opacity: material.opacity,
        dielectric_f0: material.even_dielectric_f0().into(),
        dielectric_f90: material.dielectric_f90,
        film_share: film.share,
        film_ior: film.ior,
        film_thickness: film.thickness[1],
        film_base_f0: material.dielectric_f0.into(),
        film_thinnest: film.thickness[0],
        transmission: material.transmission.unwrap_or(Vec3::ONE).into(),
        clearcoat: material.clearcoat_factor,
        clearcoat_roughness: material.clearcoat_roughness,
        surface_transmission: refraction.surface_transmission.into(),
        absorption: refraction.absorption.into(),
        ior: refraction.ior,
        ior_spread: refraction.ior_spread,
        body_centre: body_centre.into(),
        body_radius,
        sheen: material.sheen_color.into(),
        sheen_roughness: material.sheen_roughness,
        anisotropy: material.anisotropy.into(),
        diffuse_transmission: through.share,
        diffuse_transmission_color: through.color.into(),
        extension: material.extension_map.map_or(0, |(of, _)| of as u32),
        emission: material.emissive_factor.into(),
        flags: material_flags(material),
    }
}

fn material_flags(material: &Material) -> u32 {
    let bit = |set: bool, bit: u32| if set { bit } else { 0 };
    let of_map = |(i, Lookup { sampling, second_uv }): (u32, Lookup)| {
        let [u, v] = sampling.wrap.map(|wrap| wrap as u32);
        bit(second_uv, material_flag::SECOND_UV << i) | (u | v << 2) << (material_flag::WRAPS + 4 * i)
    };
    let maps: u32 = (0..).zip(material.lookups).map(of_map).sum();
    let tints = material.unlit && material.vertex_colours;
    maps | bit(material.vertex_colours, material_flag::VERTEX_COLOURS)
        | bit(material.blends, material_flag::BLENDS)
        | bit(tints, material_flag::UNLIT)
        | bit(material.transmission.is_some(), material_flag::TRANSMITS)
        | bit(material.clearcoat_bumps, material_flag::CLEARCOAT_BUMPS)
}

fn light_block(light: &PointLight, (shadow_layer, shadow_near): (i32, f32)) -> LightBlock {
    LightBlock {
        position: light.position.into(),
        radius: light.radius,
        intensity: light.intensity.into(),
        shadow_near,
        shadow_layer,
        along: light.cone.map_or(Vec3::Y, |cone| cone.along).into(),
        cone: light.cone.map_or([0.0, 1.0], |cone| falloff(&cone)),
    }
}

fn sphere_block(sphere: &SphereLight, (shadow_layer, shadow_near): (i32, f32)) -> SphereLightBlock {
    SphereLightBlock {
        position: sphere.position.into(),
        radius: sphere.radius,
        intensity: sphere.intensity().into(),
        shadow_near,
        shadow_layer,
    }
}

/// Factor and summand of the cosine to the axis of a spot light: KHR_lights_punctual, "Inner and Outer Cone Angles".
fn falloff(cone: &Cone) -> [f32; 2] {
    let factor = 1.0 / (cone.inner.cos() - cone.outer.cos()).max(0.001);
    [factor, -cone.outer.cos() * factor]
}
