//! `render::shared` against `glsl/shared.glsl`: blocks member by member on the GPU, constants by reading the file.

use clap::ValueEnum;

use super::shared::{EyeBlock, FrameBlock, LightBlock, MAX_EYES, constant};
use super::{Geometry, Shading};
use crate::gpu::{
    Binding, BindingType, Buffer, BufferKind, DescriptorSet, DescriptorSetLayout, Pipeline, read_buffer,
    submit_and_wait,
};
use crate::precompute::harness_tests::with_gpu;

const SHARED: &str = include_str!("../../glsl/shared.glsl");
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

fn blocks() -> (FrameBlock, [LightBlock; 3]) {
    let mut counter = Counter(0.0);
    let eyes: [EyeBlock; MAX_EYES] = std::array::from_fn(|_| EyeBlock {
        clip_from_world: std::array::from_fn(|_| counter.list()),
        world_from_view: std::array::from_fn(|_| counter.list()),
        tangents: counter.list(),
    });
    let frame = FrameBlock {
        eyes,
        environment_rotation: counter.list(),
        exposure: counter.next(),
        environment_scale: counter.next(),
        light_count: counter.next() as u32,
        sample_index: counter.next() as u32,
    };
    let lights = std::array::from_fn(|_| LightBlock { position: counter.list(), intensity: counter.list() });
    (frame, lights)
}

/// What test_shared.comp writes: each member by its name.
fn by_name(frame: &FrameBlock, lights: &[LightBlock]) -> Vec<f32> {
    let mut numbers = Vec::new();
    for eye in &frame.eyes {
        numbers.extend(eye.clip_from_world.as_flattened());
        numbers.extend(eye.world_from_view.as_flattened());
        numbers.extend(eye.tangents);
    }
    numbers.extend(frame.environment_rotation);
    numbers.extend([frame.exposure, frame.environment_scale, frame.light_count as f32, frame.sample_index as f32]);
    for light in lights {
        numbers.extend(light.position.iter().chain(&[0.0]).chain(&light.intensity).chain(&[0.0]));
    }
    numbers
}

#[test]
fn shaders_find_every_member_where_rust_put_it() {
    let (frame, lights) = blocks();
    let want = by_name(&frame, &lights);
    let got: Vec<f32> = with_gpu(|gpu| {
        let frame = Buffer::with_bytes(gpu, "frame", BufferKind::Uniform, bytemuck::bytes_of(&frame)).unwrap();
        let lights =
            Buffer::with_bytes(gpu, "lights", BufferKind::StorageFromCpu, bytemuck::cast_slice(&lights)).unwrap();
        let out = Buffer::new(gpu, "numbers", BufferKind::Storage, 4 * want.len() as u64).unwrap();
        let layouts = [
            DescriptorSetLayout::new(gpu, "in", &[BindingType::Uniform, BindingType::Storage]).unwrap(),
            DescriptorSetLayout::new(gpu, "out", &[BindingType::Storage]).unwrap(),
        ];
        let sets = [
            DescriptorSet::new(gpu, "in", &layouts[0], &[Binding::Uniform(&frame), Binding::Storage(&lights)]).unwrap(),
            DescriptorSet::new(gpu, "out", &layouts[1], &[Binding::Storage(&out)]).unwrap(),
        ];
        let pipeline = Pipeline::compute(gpu, "test_shared.comp", &[], &layouts.each_ref(), 0).unwrap();
        submit_and_wait(gpu, |commands| {
            commands.bind(&pipeline, &sets.each_ref());
            commands.dispatch([1, 1, 1]);
            Ok(())
        })
        .unwrap();
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
    assert_eq!(constants(SHARED, "uint", "MAX_"), [("EYES".to_owned(), MAX_EYES as u32)]);
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
        ("SLICES", constant::SLICES),
    ];
    assert_eq!(declared.collect::<Vec<_>>(), ours);
}
