//! `render::shared` against `glsl/shared.glsl`: blocks member by member on the GPU, constants by reading the file.

use clap::ValueEnum;

use super::bindings::SCENE;
use super::settings::Shading;
use super::shared::{
    EyeBlock, FrameBlock, InstanceBlock, LightBlock, MAX_EYES, MaterialBlock, SphereLightBlock, SunBlock,
    SunShadowBlock, constant, ray_feature,
};
use crate::gpu::{
    Binding, BindingType, Buffer, BufferKind, DescriptorSet, DescriptorSetLayout, FrameRing, Pipeline, UNIFORM_RANGE,
    read_buffer,
};
use crate::precompute::harness_tests::with_gpu;
use crate::reference::brdf::Geometry;
use crate::scene::needs::MAX_COUNTED_LIGHTS;
use crate::scene::probes::MOST_PROBES;
use crate::scene::sphere_lights::MAX_SPHERE_LIGHTS;

const SHARED: &str = include_str!("../../glsl/shared.glsl");
const PROBES: &str = include_str!("../../glsl/placed_probes.glsl");
const RAY_FEATURES: &str = include_str!("../../glsl/ray_features.glsl");
const BRDF: &str = include_str!("../../glsl/brdf.glsl");

/// Numbers 1, 2, 3 …
struct Counter(f32);

impl Counter {
    fn next(&mut self) -> f32 {
        self.0 += 1.0;
        self.0
    }

    fn list<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| self.next())
    }
}

/// One of each kind of block, every number another.
struct Blocks {
    frame: FrameBlock,
    instances: [InstanceBlock; 2],
    materials: [MaterialBlock; 3],
    lights: [LightBlock; 3],
}

impl Blocks {
    fn new() -> Self {
        let mut counter = Counter(0.0);
        let matrix = |counter: &mut Counter| std::array::from_fn(|_| counter.list());
        let eyes: [EyeBlock; MAX_EYES] = std::array::from_fn(|_| EyeBlock {
            clip_from_world: matrix(&mut counter),
            world_from_view: matrix(&mut counter),
            tangents: counter.list(),
        });
        let frame = FrameBlock {
            eyes,
            environment_rotation: counter.list(),
            exposure: counter.next(),
            environment_scale: counter.next(),
            light_count: counter.next() as u32,
            sample_index: counter.next() as u32,
            world_from_models: matrix(&mut counter),
            sun: SunBlock { towards: counter.list(), irradiance: counter.list(), sine: counter.next() },
            sun_shadow: SunShadowBlock { place_from_world: matrix(&mut counter), spread: counter.list() },
            sphere_lights: std::array::from_fn(|_| SphereLightBlock {
                position: counter.list(),
                radius: counter.next(),
                intensity: counter.list(),
                shadow_near: counter.next(),
                shadow_layer: counter.next() as i32,
            }),
        };
        let instances = std::array::from_fn(|_| InstanceBlock {
            world_from_local: matrix(&mut counter),
            material: counter.next() as u32,
        });
        let materials = std::array::from_fn(|_| MaterialBlock {
            base_color: counter.list(),
            metallic: counter.next(),
            roughness: counter.next(),
            alpha_cutoff: counter.next(),
            textures: counter.next() as u32,
            opacity: counter.next(),
            emission: counter.list(),
            flags: counter.next() as u32,
            dielectric_f0: counter.list(),
            dielectric_f90: counter.next(),
            film_share: counter.next(),
            film_ior: counter.next(),
            film_thickness: counter.next(),
            film_base_f0: counter.list(),
            film_thinnest: counter.next(),
            transmission: counter.list(),
            clearcoat: counter.next(),
            clearcoat_roughness: counter.next(),
            surface_transmission: counter.list(),
            absorption: counter.list(),
            ior: counter.next(),
            ior_spread: counter.next(),
            body_centre: counter.list(),
            body_radius: counter.next(),
            sheen: counter.list(),
            sheen_roughness: counter.next(),
            anisotropy: counter.list(),
            diffuse_transmission: counter.next(),
            diffuse_transmission_color: counter.list(),
            extension: counter.next() as u32,
        });
        let lights = std::array::from_fn(|_| LightBlock {
            position: counter.list(),
            radius: counter.next(),
            intensity: counter.list(),
            shadow_near: counter.next(),
            shadow_layer: counter.next() as i32,
            along: counter.list(),
            cone: counter.list(),
        });
        Self { frame, instances, materials, lights }
    }

    /// What test_shared.comp writes: each member by its name.
    fn by_name(&self) -> Vec<f32> {
        let Self { frame, .. } = self;
        let mut numbers = Vec::new();
        for eye in &frame.eyes {
            numbers.extend(eye.clip_from_world.as_flattened());
            numbers.extend(eye.world_from_view.as_flattened());
            numbers.extend(eye.tangents);
        }
        numbers.extend(frame.environment_rotation);
        numbers.extend([frame.exposure, frame.environment_scale, frame.light_count as f32, frame.sample_index as f32]);
        numbers.extend(frame.world_from_models.as_flattened());
        numbers.extend(frame.sun.towards.iter().chain(&[0.0]).chain(&frame.sun.irradiance).chain(&[frame.sun.sine]));
        numbers.extend(frame.sun_shadow.place_from_world.as_flattened().iter().chain(&frame.sun_shadow.spread));
        for light in &frame.sphere_lights {
            numbers.extend(light.position.iter().chain(&[light.radius]).chain(&light.intensity));
            numbers.extend([light.shadow_near, light.shadow_layer as f32]);
        }
        for light in &self.lights {
            numbers.extend(light.position.iter().chain(&[light.radius]).chain(&light.intensity));
            numbers.extend([light.shadow_near, light.shadow_layer as f32]);
            numbers.extend(light.along.iter().chain(&light.cone));
        }
        for instance in &self.instances {
            numbers.extend(instance.world_from_local.as_flattened());
            numbers.push(instance.material as f32);
        }
        for material in self.materials {
            let MaterialBlock { base_color, metallic, roughness, alpha_cutoff, textures, opacity, .. } = material;
            let MaterialBlock {
                emission,
                flags,
                dielectric_f0,
                dielectric_f90,
                transmission,
                clearcoat,
                clearcoat_roughness,
                ..
            } = material;
            numbers.extend(base_color);
            numbers.extend([metallic, roughness, alpha_cutoff, textures as f32, opacity]);
            numbers.extend(emission);
            numbers.push(flags as f32);
            numbers.extend(dielectric_f0);
            numbers.push(dielectric_f90);
            numbers.extend([material.film_share, material.film_ior, material.film_thickness]);
            numbers.extend(material.film_base_f0.iter().chain(&[material.film_thinnest]));
            numbers.extend(transmission);
            numbers.extend([clearcoat, clearcoat_roughness]);
            numbers.extend(
                material
                    .surface_transmission
                    .iter()
                    .chain(&material.absorption)
                    .chain(&[material.ior, material.ior_spread])
                    .chain(&material.body_centre)
                    .chain(&[material.body_radius]),
            );
            numbers.extend(material.sheen.iter().chain(&[material.sheen_roughness]).chain(&material.anisotropy));
            numbers.push(material.diffuse_transmission);
            numbers.extend(material.diffuse_transmission_color.iter().chain(&[material.extension as f32]));
        }
        numbers
    }
}

#[test]
fn shaders_find_every_member_where_rust_put_it() {
    let blocks = Blocks::new();
    let want = blocks.by_name();
    let got: Vec<f32> = with_gpu(|gpu| {
        let buffer = |name, bytes: &[u8]| Buffer::with_bytes(gpu, name, BufferKind::FromCpu, bytes).unwrap();
        let instances = buffer("instances", bytemuck::cast_slice(&blocks.instances));
        let materials = buffer("materials", bytemuck::cast_slice(&blocks.materials));
        let lights = buffer("lights", bytemuck::cast_slice(&blocks.lights));
        let out = Buffer::new(gpu, "numbers", BufferKind::Storage, 4 * want.len() as u64).unwrap();
        let mut ring = FrameRing::new(gpu, UNIFORM_RANGE).unwrap();
        // The shader reads no image.
        let kinds: Vec<BindingType> = SCENE.bindings[..3].iter().map(|(_, kind)| *kind).collect();
        let scene_layout = DescriptorSetLayout::new(gpu, "scene", &kinds).unwrap();
        let out_layout = DescriptorSetLayout::new(gpu, "out", &[BindingType::Storage]).unwrap();
        let bindings = [&instances, &materials, &lights].map(Binding::Storage);
        let scene = DescriptorSet::new(gpu, "scene", &scene_layout, &bindings).unwrap();
        let set = DescriptorSet::new(gpu, "out", &out_layout, &[Binding::Storage(&out)]).unwrap();
        let layouts = [ring.layout(), &scene_layout, &out_layout];
        let pipeline = Pipeline::compute(gpu, "test_shared.comp", &[], &layouts, 0).unwrap();
        let mut frame = ring.begin().unwrap();
        let block = frame.push(&blocks.frame).unwrap();
        frame.commands.bind_pipeline(&pipeline);
        frame.commands.bind_set(&pipeline, 0, frame.set, &[block, 0]);
        frame.commands.bind_set(&pipeline, 1, &scene, &[]);
        frame.commands.bind_set(&pipeline, 2, &set, &[]);
        frame.commands.dispatch([1, 1, 1]);
        frame.commands.buffers_written();
        frame.submit(None).unwrap();
        ring.finish_all().unwrap();
        bytemuck::pod_collect_to_vec(&read_buffer(gpu, &out).unwrap())
    });
    assert_eq!(got, want);
}

/// Names, without their underscores, and values of `const {kind} {prefix}NAME = value;`.
fn constants(text: &str, kind: &str, prefix: &str) -> Vec<(String, u32)> {
    let start = format!("const {kind} {prefix}");
    let declarations = text.lines().filter_map(|line| line.strip_prefix(&start)?.split(';').next()?.split_once(" = "));
    declarations.map(|(name, value)| (name.replace('_', ""), value.parse().unwrap())).collect()
}

#[test]
fn shading_and_geometry_are_numbered_as_in_glsl() {
    let name = |variant: &dyn std::fmt::Debug| format!("{variant:?}").to_uppercase();
    let ours: Vec<_> = Shading::value_variants().iter().map(|s| (name(s), *s as u32)).collect();
    assert_eq!(constants(SHARED, "uint", "SHADING_"), ours);
    let ours = [Geometry::Smith, Geometry::Karis2013].map(|g| (name(&g), g as u32));
    assert_eq!(constants(BRDF, "int", "GEOMETRY_"), ours);
}

#[test]
fn arrays_have_the_same_lengths_as_in_glsl() {
    let ours = [("EYES", MAX_EYES), ("SPHERELIGHTS", MAX_SPHERE_LIGHTS), ("COUNTEDLIGHTS", MAX_COUNTED_LIGHTS)];
    let ours = ours.map(|(n, most)| (n.to_owned(), most as u32));
    assert_eq!(constants(SHARED, "uint", "MAX_"), ours);
    assert_eq!(constants(PROBES, "uint", "MOST_"), [("PROBES".to_owned(), MOST_PROBES as u32)]);
    let lightmap = constants(SHARED, "uint", "LIGHTMAP_");
    let value = |wanted| lightmap.iter().find(|(name, _)| name == wanted).map(|(_, value)| *value);
    assert_eq!([value("KINDS"), value("STEPS")], [super::lightmap::KINDS, crate::scene::atlas::STEPS].map(Some));
}

#[test]
fn features_of_rays_have_the_same_bits_as_in_glsl() {
    let ours = [
        ("HOLES", ray_feature::HOLES),
        ("EMITTERS", ray_feature::EMITTERS),
        ("RELAYS", ray_feature::RELAYS),
        ("GLOSSY", ray_feature::GLOSSY),
        ("EXTRAS", ray_feature::EXTRAS),
        ("SKYRELAYS", ray_feature::SKY_RELAYS),
        ("TINTS", ray_feature::TINTS),
        ("CLEARCOAT", ray_feature::CLEARCOAT),
        ("REFRACTS", ray_feature::REFRACTS),
        ("SHEEN", ray_feature::SHEEN),
        ("FILM", ray_feature::FILM),
        ("ANISOTROPY", ray_feature::ANISOTROPY),
        ("DIFFUSETRANSMISSION", ray_feature::DIFFUSE_TRANSMISSION),
        ("MAPS", ray_feature::MAPS),
    ];
    assert_eq!(constants(RAY_FEATURES, "uint", "RAYS_"), ours.map(|(name, bit)| (name.to_owned(), bit)));
    assert!(
        RAY_FEATURES.contains(&format!("layout(constant_id = {}) const uint RAY_FEATURES", constant::RAY_FEATURES))
    );
}

#[test]
fn specialization_constants_have_their_ids() {
    let declared = SHARED.lines().filter_map(|line| {
        let (id, rest) = line.strip_prefix("layout(constant_id = ")?.split_once(") const ")?;
        Some((rest.split(' ').nth(1)?, id.parse::<u32>().unwrap()))
    });
    let ours = [
        ("EYES", constant::EYES),
        ("SHADING", constant::SHADING),
        ("GEOMETRY", constant::GEOMETRY),
        ("LINEAR_OUTPUT", constant::LINEAR_OUTPUT),
        ("HAS_BASE_COLOR_MAP", constant::HAS_BASE_COLOR_MAP),
        ("HAS_NORMAL_MAP", constant::HAS_NORMAL_MAP),
        ("HAS_ORM_MAP", constant::HAS_ORM_MAP),
        ("ALPHA_MASK", constant::ALPHA_MASK),
        ("LIGHTS", constant::LIGHTS),
        ("METALNESS", constant::METALNESS),
        ("MULTI_SCATTER", constant::MULTI_SCATTER),
        ("LIGHTMAP", constant::LIGHTMAP),
        ("SPLIT_SUM", constant::SPLIT_SUM),
        ("SUN", constant::SUN),
        ("LAMP_SHADOWS", constant::LAMP_SHADOWS),
        ("SUN_SHADOW", constant::SUN_SHADOW),
        ("EMITS", constant::EMITS),
        ("VERTEX_COLOURS", constant::VERTEX_COLOURS),
        ("SECOND_UV", constant::SECOND_UV),
        ("BLENDS", constant::BLENDS),
        ("SPECULAR", constant::SPECULAR),
        ("TINTS", constant::TINTS),
        ("CLEARCOAT", constant::CLEARCOAT),
        ("SHEEN", constant::SHEEN),
        ("ANISOTROPY", constant::ANISOTROPY),
        ("FILM", constant::FILM),
        ("EXTENSION_MAP_OF", constant::EXTENSION_MAP_OF),
        ("DIFFUSE_TRANSMISSION", constant::DIFFUSE_TRANSMISSION),
        ("REFRACTS", constant::REFRACTS),
        ("DISPERSES", constant::DISPERSES),
        ("SPHERE_LIGHTS", constant::SPHERE_LIGHTS),
    ];
    assert_eq!(declared.collect::<Vec<_>>(), ours);
}
