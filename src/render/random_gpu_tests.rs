//! A million surfaces made of random and of hostile numbers, shaded by the real fragment shader.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec2, Vec3};

use super::eye::Eye;
use super::frame::{FRAME_BYTES, FrameInputs};
use super::frame_set::FrameSet;
use super::renderer::Renderer;
use super::settings::{LightModel, RenderSettings, Shading, TextureSettings};
use super::shared::constant;
use crate::asset::ktx2::TexelFormat;
use crate::asset::material::ThinFilm;
use crate::asset::mips::{level_count, level_size};
use crate::asset::{MipChain, Panorama};
use crate::context::Context;
use crate::gpu::submit_and_wait;
use crate::gpu::{
    Attachments, ColourAttachment, Constant, Format, FrameRing, Gpu, GraphicsDesc, Image, ImageAccess, ImageDesc,
    ImageUsageFlags, Pipeline, Subresource, read_image,
};
use crate::precompute::harness_tests::{Random, with_gpu};
use crate::reference::brdf::Geometry;
use crate::scene::{Bounds, Environment, Instance, Material, Mesh, Model, PointLight, Scene, Vertex};

/// Pixels of the picture, one triangle each: more than a million.
const SIZE: [u32; 2] = [1024, 1024];
/// Each draws a part of the picture.
const MATERIALS: u32 = 16;
/// Greatest radiance of the surroundings.
const SKY: f32 = 40.0;

/// The push constants of test_random.vert.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Range {
    instance: u32,
    first: u32,
    seed: u32,
    hostile: u32,
    inside: u32,
    size: [u32; 2],
}

/// A texture of any bytes; half of the texels are all 0 or all 255.
fn texture(name: &str, format: TexelFormat, random: &mut Random) -> MipChain {
    let side = 64;
    let texel = |random: &mut Random| match random.below(4) {
        0 => [0; 4],
        1 => [255; 4],
        _ => (random.bits() as u32).to_le_bytes(),
    };
    let level = |level: u32, random: &mut Random| -> Vec<u8> {
        let [width, height] = level_size([side, side], level);
        (0..width * height).flat_map(|_| texel(random)).collect()
    };
    let levels = (0..level_count([side, side])).map(|l| level(l, random)).collect();
    MipChain { name: name.into(), width: side, height: side, format, levels }
}

/// Materials of all kinds with all maps under a sky with a sun, and point lights. Values also stand where others belong.
fn scene() -> Scene {
    let mut random = Random(22);
    let factors = [0.0, 1e-30, 0.04, 0.5, 1.0];
    let materials = (0..MATERIALS).map(|i| Material {
        base_color_factor: Vec3::from_array([(); 3].map(|()| factors[random.below(5) as usize])),
        metallic_factor: factors[(i % 5) as usize],
        roughness_factor: factors[(i / 3) as usize % 5],
        anisotropy: [Vec2::ZERO, Vec2::new(factors[(i / 4) as usize % 5], factors[i as usize % 5])][i as usize / 2 % 2],
        dielectric_f0: Vec3::splat(factors[(i / 2) as usize % 5]),
        film: (i % 3 == 1).then(|| ThinFilm {
            share: factors[i as usize % 5],
            ior: 1.0 + factors[(i / 2) as usize % 5],
            thickness: [factors[(i / 4) as usize % 5], 1e5 * factors[(i / 3) as usize % 5]],
        }),
        base_color_map: Some(0),
        normal_map: Some(1),
        orm_map: Some(2),
        metallic_range: [0.0, 1.0],
        roughness_range: [0.0, 1.0],
        occludes: true,
        ..Material::plain(&format!("material {i}"), Vec3::ONE, 0.0, 0.5)
    });
    let materials: Vec<Material> = materials.collect();
    let corner = |x, y| {
        let (normal, tangent) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]);
        Vertex { position: [x, y, 0.0], normal, uv: [x, y], tangent, ..Vertex::default() }
    };
    let vertices = vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)];
    let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(1.0, 1.0, 0.0) };
    let mesh = |material| Mesh {
        name: "triangle".into(),
        vertices: vertices.clone(),
        indices: vec![0, 1, 2],
        material,
        bounds,
    };
    let all = 0..MATERIALS as usize;
    let light =
        |position, intensity| PointLight { position, intensity: Vec3::splat(intensity), radius: 0.0, cone: None };
    let glow = Vec3::new(0.3, 0.8, 0.5).normalize();
    let sky = |d: Vec3| if d.dot(glow) > 0.99 { Vec3::splat(SKY) } else { Vec3::splat(1.0) + 0.5 * d };
    let mut panorama = Panorama::from_fn(256, 128, sky);
    panorama.texels[50 * 256 + 30] = [30_000.0; 3]; // a sun
    Scene {
        // Instance i has material i.
        meshes: all.clone().map(mesh).collect(),
        instances: all.map(|mesh| Instance { mesh, world_from_local: Mat4::IDENTITY }).collect(),
        sources: Vec::new(),
        materials,
        textures: vec![
            texture("base color", TexelFormat::Rgba8Srgb, &mut random),
            texture("normal", TexelFormat::Rgba8, &mut random),
            texture("surface", TexelFormat::Rgba8, &mut random),
        ],
        lights: vec![
            light(Vec3::new(1.0, 2.0, 3.0), 100.0),
            light(Vec3::ZERO, 1e6),
            light(Vec3::new(-1e19, 0.0, 1.0), 1e6),
            light(Vec3::new(0.0, -1.0, 0.0), 0.0),
        ],
        cameras: Vec::new(),
        environment: Environment { panorama, rotation_degrees: 30.0 },
        probes: vec![],
        exposure_ev: 0.0,
    }
}

/// How the surfaces are shaded.
#[derive(Clone, Copy)]
struct Case {
    fragment: &'static str,
    shading: Shading,
    geometry: Geometry,
    point_lights: bool,
    hostile: u32,
    /// Whether some lie in a point light or in the eye.
    inside: bool,
}

/// Radiance of every pixel.
fn shade(gpu: &Arc<Gpu>, renderer: &Renderer, inputs: &FrameInputs<'_>, case: Case) -> Vec<[f32; 4]> {
    let usage = ImageUsageFlags::COLOR_ATTACHMENT | ImageUsageFlags::TRANSFER_SRC;
    let picture = Image::new(gpu, "random", ImageDesc::flat(Format::R32G32B32A32_SFLOAT, SIZE, usage)).unwrap();
    let constants: [Constant; 6] = [
        (constant::SHADING, case.shading as u32),
        (constant::GEOMETRY, case.geometry as u32),
        (constant::LINEAR_OUTPUT, 1),
        (constant::LIGHTS, if case.point_lights { u32::MAX } else { 0 }),
        (constant::METALNESS, 2),
        (constant::SUN, 1),
    ];
    let desc = GraphicsDesc {
        name: "random",
        vertex: "test_random.vert",
        fragment: Some(case.fragment),
        constants: &constants,
        sets: &renderer.layouts.drawing(),
        push_bytes: size_of::<Range>() as u32,
        colours: &[Format::R32G32B32A32_SFLOAT],
        ..GraphicsDesc::default()
    };
    let pipeline = Pipeline::graphics(gpu, &desc).unwrap();
    let count = SIZE[0] * SIZE[1] / MATERIALS;
    let mut ring = FrameRing::new(gpu, FRAME_BYTES).unwrap();
    let mut frame = ring.begin().unwrap();
    let block = frame.push(&inputs.block(renderer.scene.constants())).unwrap();
    let set = FrameSet { set: frame.set, block };
    frame.commands.prepare_fresh(&picture, ImageAccess::Colour);
    // What is not drawn would be found.
    let colours = &[ColourAttachment::cleared(picture.attachment(), [f32::NEG_INFINITY; 4])];
    frame.commands.render(&Attachments { colours, depth: None, area: SIZE }, |commands| {
        set.bind(commands, &pipeline, 0);
        commands.bind_set(&pipeline, 1, &renderer.scene.set, &[]);
        // All materials have the same maps.
        commands.bind_set(&pipeline, 2, &renderer.scene.resources.textures.sets[0], &[]);
        for instance in 0..MATERIALS {
            let Case { hostile, inside, .. } = case;
            let first = instance * count;
            let range = Range { instance, first, seed: 5, hostile, inside: inside.into(), size: SIZE };
            commands.push(&pipeline, bytemuck::bytes_of(&range));
            commands.draw(3 * count, 1);
        }
    });
    frame.submit(None).unwrap();
    ring.finish_all().unwrap();
    bytemuck::pod_collect_to_vec(&read_image(gpu, &picture, Subresource { mip: 0, layer: 0 }, 16).unwrap())
}

/// Pixels outside of 0 to what `most` says of each, the first of them, and the greatest share of that within.
fn wrong(radiance: &[[f32; 4]], most: &[[f32; 4]]) -> (usize, Option<(usize, [f32; 4])>, f32) {
    let is_wrong = |i: &usize| !(0..3).all(|c| (0.0..=most[*i][c]).contains(&radiance[*i][c]));
    let (bad, good): (Vec<usize>, Vec<usize>) = (0..radiance.len()).partition(is_wrong);
    let shares = good.iter().flat_map(|i| (0..3).map(|c| radiance[*i][c] / most[*i][c]));
    (bad.len(), bad.first().map(|i| (*i, radiance[*i])), shares.fold(0.0, f32::max))
}

/// An upper bound of each fragment's radiance: the greatest radiance of the surroundings, as nothing reflects more than it
/// receives, and the sun's and each point light's irradiance times the BRDF's peak (test_bound.frag).
fn most(gpu: &Arc<Gpu>, renderer: &Renderer, inputs: &FrameInputs<'_>, case: Case) -> Vec<[f32; 4]> {
    let mut most = shade(gpu, renderer, inputs, Case { fragment: "test_bound.frag", ..case });
    // Rounding takes its share: near a lobe's centre D is known to 1e-3 or so.
    most.iter_mut().flatten().for_each(|value| *value = 1.01 * (*value + SKY));
    most
}

#[test]
fn a_million_random_and_hostile_surfaces_send_light_that_is_finite_not_negative_and_bounded() {
    with_gpu(|gpu| {
        let scene = scene();
        let settings = RenderSettings {
            model: Model::Everything,
            samples: 1,
            textures: TextureSettings { anisotropy: Some(1), ..TextureSettings::default() },
            cube_size: 64,
            light: LightModel::Direct,
            ..RenderSettings::default()
        };
        let mut renderer = Renderer::new(&Context::silent(gpu), &scene, settings, [16, 16], 1).unwrap();
        assert_eq!(renderer.scene.resources.textures.sets.len(), 1);
        assert!(renderer.scene.lighting.sun.is_some());
        let place = Mat4::from_translation(Vec3::new(0.5, -0.25, 2.0));
        let eyes = [Eye::symmetric(place, 60.0, 1.0, 1.0)];
        let inputs = &FrameInputs::of(&scene, &eyes);
        // Shadow maps are bound, though nothing casts.
        submit_and_wait(gpu, |commands| {
            renderer.scene.update_shadows(commands, None, inputs);
            Ok(())
        })
        .unwrap();
        let ours = Case {
            fragment: "forward.frag",
            shading: Shading::Pbr,
            geometry: Geometry::Smith,
            point_lights: true,
            hostile: 24,
            inside: true,
        };
        for case in [
            ours,
            Case { point_lights: false, ..ours },
            Case { geometry: Geometry::Karis2013, ..ours },
            Case { shading: Shading::Phong, ..ours },
            Case { hostile: 0, ..ours },
        ] {
            let most = most(gpu, &renderer, inputs, case);
            assert!(most.iter().flatten().all(|value| value.is_finite()), "the bound bounds nothing");
            let (count, first, greatest) = wrong(&shade(gpu, &renderer, inputs, case), &most);
            let what = format!("{:?}, {:?}, point lights: {}", case.shading, case.geometry, case.point_lights);
            println!("{what}: {count} wrong, at most {greatest} of the bound");
            assert_eq!(count, 0, "{what}: the first is {first:?}");
        }
        // The form that tutorials have; negative, infinite and NaN alone count as wrong. On the same surfaces, on those without
        // hostile vectors, and without any in a point light, where next to nothing is left.
        let anything = vec![[f32::MAX; 4]; (SIZE[0] * SIZE[1]) as usize];
        for (hostile, inside, least) in [(24, true, 250_000), (0, true, 200_000), (0, false, 0)] {
            let naive = Case { fragment: "test_naive.frag", hostile, inside, ..ours };
            let (count, first, _) = wrong(&shade(gpu, &renderer, inputs, naive), &anything);
            println!("as in tutorials, hostile: {hostile}, in point lights: {inside}: {count} wrong");
            assert!(count >= least, "in the plain form only {count} are wrong any more, the first {first:?}");
        }
    });
}
