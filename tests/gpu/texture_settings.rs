//! How maps of models are looked up: wraps, squares, sides, second texture coordinates and transforms, seen directly and in
//! a mirror.

use glam::{DVec2, DVec3, Vec3};
use image::{Rgba, RgbaImage};
use pbr_vr::render::{Eye, LightModel, Shading};
use serde_json::{Value, json};

use crate::common::Workshop;
use crate::common::colour::{Look, assert_near, front, loaded, loaded_with_warnings, look, on_plane, see};
use crate::common::gltf::{Gltf, Shape};
use crate::common::stage::with_gpu;

/// Cells of the picture's sides, each of so many texels.
const CELLS: u32 = 4;
const TEXELS: u32 = 16;

fn level(cell: [u32; 2]) -> [u8; 3] {
    [40 + 50 * cell[0] as u8, 60 + 60 * cell[1] as u8, if cell[0] == cell[1] { 255 } else { 90 }]
}

/// A colour for each cell, all different.
fn cells() -> RgbaImage {
    RgbaImage::from_fn(CELLS * TEXELS, CELLS * TEXELS, |x, y| {
        let [r, g, b] = level([x / TEXELS, y / TEXELS]);
        Rgba([r, g, b, 255])
    })
}

fn decoded(code: u8) -> f64 {
    let v = f64::from(code) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Wrap {
    Repeat,
    Mirror,
    Clamp,
}

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];

impl Wrap {
    fn code(self) -> u32 {
        [10497, 33648, 33071][self as usize]
    }

    /// The cell of a coordinate; `None` close to an edge of one.
    fn cell(self, at: f64) -> Option<u32> {
        let within = match self {
            Self::Repeat => at.rem_euclid(1.0),
            Self::Mirror => 1.0 - (at.rem_euclid(2.0) - 1.0).abs(),
            Self::Clamp => at.clamp(0.0, 0.999),
        };
        let scaled = within * f64::from(CELLS);
        let is_clear = self == Self::Clamp && !(0.1..0.9).contains(&at) || (0.2..0.8).contains(&scaled.fract());
        is_clear.then_some(scaled as u32)
    }
}

/// The colour at texture coordinates, v downwards.
fn colour_at(uv: DVec2, wraps: [Wrap; 2]) -> Option<DVec3> {
    let cell = [wraps[0].cell(uv.x)?, wraps[1].cell(uv.y)?];
    Some(DVec3::from(level(cell).map(decoded)))
}

fn sampler(wraps: [Wrap; 2]) -> Value {
    json!({"wrapS": wraps[0].code(), "wrapT": wraps[1].code()})
}

/// A surface that is one picture's light, and nothing else.
fn glowing(map: Value) -> Value {
    json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1, "roughnessFactor": 1},
        "emissiveFactor": [1, 1, 1], "emissiveTexture": map, "doubleSided": true,
    })
}

fn painted(map: Value) -> Value {
    json!({
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1, "baseColorTexture": map},
        "doubleSided": true,
    })
}

/// A mirror at z = 0 for [`front`], and the place behind the eye whose image fills it: this high on z.
fn mirror(gltf: &mut Gltf) {
    let silver = json!({"pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0}});
    let silver = gltf.material(silver);
    gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0), silver);
}

const BEHIND_Z: f32 = 10.0;
/// Half of the height that the mirror shows there.
const BEHIND_HALF: f32 = 3.0;

/// A plate that faces −Z behind the eye, whose mirror image is that of a plate at z = 0 which faces +Z, turned about Y.
fn behind() -> Shape {
    let mut shape = Shape::plate([-BEHIND_HALF, BEHIND_HALF], [-BEHIND_HALF, BEHIND_HALF], BEHIND_Z);
    shape.normals = vec![[0.0, 0.0, -1.0]; 4];
    shape.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    shape
}

fn reference(frames: u64) -> Look {
    Look { light: LightModel::Baked, shading: Shading::Reference, frames, ..Look::default() }
}

/// Compares all pixels whose colour is certain, and says how many there were.
fn assert_colours(
    case: &str,
    seen: &crate::common::colour::Seen,
    uv: impl Fn(DVec2) -> DVec2,
    wraps: [Wrap; 2],
    slack: f64,
) {
    let size = seen.size[0];
    let mut compared = 0;
    for (x, y) in (0..size).flat_map(|y| (0..size).map(move |x| (x, y))) {
        let Some(want) = colour_at(uv(on_plane(x, y, size, 0.0)), wraps) else { continue };
        assert_near(&format!("{case}, pixel {x}, {y}"), seen.at(x, y), want, slack, 0.0);
        compared += 1;
    }
    assert!(compared > size * size / 10, "{case}: only {compared} pixels");
}

/// From the plane's −1 to 1 to texture coordinates −1 to 2, v downwards.
fn thrice(at: DVec2) -> DVec2 {
    DVec2::new(1.5 * at.x + 0.5, 0.5 - 1.5 * at.y)
}

fn thrice_of([u, v]: [f32; 2]) -> [f32; 2] {
    [3.0 * u - 1.0, 3.0 * v - 1.0]
}

#[test]
fn maps_go_on_beyond_their_edges_as_samplers_say() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for wraps in WRAPS.into_iter().flat_map(|s| WRAPS.map(|t| [s, t])) {
            let mut gltf = Gltf::new();
            let texture = gltf.texture(&cells(), sampler(wraps));
            let material = gltf.material(painted(json!({"index": texture})));
            gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0).with_uvs(0, thrice_of), material);
            let scene = loaded(&gltf.write(&shop, "wraps.gltf"), 1.0);
            let seen = see(gpu, &scene, Look { shading: Shading::BaseColor, size: [96; 2], ..Look::default() });
            assert_colours(&format!("{wraps:?}"), &seen, thrice, wraps, 3e-3);
        }
    });
}

#[test]
fn maps_in_a_mirror_go_on_beyond_their_edges_as_samplers_say() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for wraps in [[Wrap::Repeat, Wrap::Clamp], [Wrap::Mirror, Wrap::Repeat], [Wrap::Clamp, Wrap::Mirror]] {
            let mut gltf = Gltf::new();
            mirror(&mut gltf);
            let texture = gltf.texture(&cells(), sampler(wraps));
            let material = gltf.material(glowing(json!({"index": texture})));
            gltf.show(&behind().with_uvs(0, thrice_of), material);
            let scene = loaded(&gltf.write(&shop, "mirror.gltf"), 0.0);
            let seen = see(gpu, &scene, Look { size: [96; 2], ..reference(1) });
            assert_colours(&format!("{wraps:?} in a mirror"), &seen, thrice, wraps, 6e-3);
        }
    });
}

#[test]
fn magnified_texels_are_squares_where_the_sampler_says_so() {
    let shop = Workshop::new();
    let steps = RgbaImage::from_fn(2, 2, |x, _| Rgba(if x == 0 { [0, 0, 0, 255] } else { [255, 255, 255, 255] }));
    with_gpu(|gpu| {
        for (filter, is_nearest) in [(9728, true), (9729, false)] {
            let mut gltf = Gltf::new();
            let texture = gltf.texture(&steps, json!({"magFilter": filter, "wrapS": 33071, "wrapT": 33071}));
            let material = gltf.material(painted(json!({"index": texture})));
            gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0), material);
            let scene = loaded(&gltf.write(&shop, "nearest.gltf"), 1.0);
            let seen = see(gpu, &scene, Look { shading: Shading::BaseColor, ..Look::default() });
            for x in 0..64 {
                let u = (f64::from(x) + 0.5) / 64.0;
                let want = if is_nearest { u.round() } else { (2.0 * u - 0.5).clamp(0.0, 1.0) };
                // Filters have 8 bits of weights.
                assert_near(&format!("{filter} at {u}"), seen.at(x, 30), DVec3::splat(want), 6e-3, 0.0);
            }
        }
    });
}

#[test]
fn only_surfaces_with_two_sides_are_seen_from_behind() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for (double_sided, mirrored) in [(true, false), (false, false), (true, true), (false, true)] {
            let mut gltf = Gltf::new();
            let material = gltf.material(json!({
                "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.8, 1]}, "doubleSided": double_sided,
            }));
            let mesh = gltf.mesh(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0), material);
            gltf.node(json!({"mesh": mesh, "scale": [if mirrored { -1 } else { 1 }, 1, 1]}));
            let scene = loaded(&gltf.write(&shop, "sides.gltf"), 0.0);
            for from in [5.0, -5.0] {
                let eye = Eye::looking(Vec3::new(0.0, 0.0, from), Vec3::ZERO, 20.0, 1.0);
                for samples in [1, 4] {
                    let what = Look { shading: Shading::BaseColor, samples, ..Look::default() };
                    let seen = look(gpu, &scene, &[eye], what).remove(0);
                    let is_seen = double_sided || from > 0.0;
                    let want = DVec3::new(0.2, 0.4, 0.8) * f64::from(u8::from(is_seen));
                    let case = format!("two sides {double_sided}, mirrored {mirrored}, from {from}");
                    assert_near(&case, seen.about([0.0; 2], 3), want, 1e-3, 0.0);
                }
            }
        }
    });
}

#[test]
fn maps_take_the_texture_coordinates_that_they_name() {
    let shop = Workshop::new();
    let other = |[u, v]: [f32; 2]| [0.25 + 0.5 * v, 0.5 * u];
    let other_at = |at: DVec2| DVec2::new(0.5 - 0.25 * at.y, 0.25 + 0.25 * at.x);
    let plain_at = |at: DVec2| DVec2::new(0.5 * at.x + 0.5, 0.5 - 0.5 * at.y);
    with_gpu(|gpu| {
        for (base_set, emissive_set) in [(0, 1), (1, 0), (1, 1)] {
            let mut gltf = Gltf::new();
            let texture = gltf.texture(&cells(), json!({}));
            let mut material = painted(json!({"index": texture, "texCoord": base_set}));
            material["emissiveTexture"] = json!({"index": texture, "texCoord": emissive_set});
            material["emissiveFactor"] = json!([1, 1, 1]);
            material["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 1, 1, 1]);
            let material = gltf.material(material);
            gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0).with_uvs(1, other), material);
            let scene = loaded(&gltf.write(&shop, "second.gltf"), 0.0);
            let wraps = [Wrap::Repeat; 2];
            for (shading, set) in [(Shading::BaseColor, base_set), (Shading::Pbr, emissive_set)] {
                let seen = see(gpu, &scene, Look { shading, size: [96; 2], ..Look::default() });
                let uv = |at| if set == 0 { plain_at(at) } else { other_at(at) };
                assert_colours(&format!("{base_set} {emissive_set} {shading:?}"), &seen, uv, wraps, 3e-3);
            }
        }
    });
}

#[test]
fn second_texture_coordinates_are_taken_in_a_mirror_too() {
    let shop = Workshop::new();
    let other = |[u, v]: [f32; 2]| [0.25 + 0.5 * v, 0.5 * u];
    let mut gltf = Gltf::new();
    mirror(&mut gltf);
    let texture = gltf.texture(&cells(), json!({}));
    // Base color, here black, takes the first ones.
    let black = gltf.texture(&RgbaImage::from_pixel(4, 4, Rgba([0, 0, 0, 255])), json!({}));
    let mut material = glowing(json!({"index": texture, "texCoord": 1}));
    material["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": black});
    let material = gltf.material(material);
    gltf.show(&behind().with_uvs(1, other), material);
    with_gpu(|gpu| {
        let scene = loaded(&gltf.write(&shop, "second.gltf"), 0.0);
        let seen = see(gpu, &scene, Look { size: [96; 2], ..reference(1) });
        let uv = |at: DVec2| DVec2::new(0.5 - 0.25 * at.y, 0.25 + 0.25 * at.x);
        assert_colours("second coordinates in a mirror", &seen, uv, [Wrap::Repeat; 2], 6e-3);
    });
}

/// Base color of what a mirror shows: even light on a dull surface, seen directly and in the mirror.
#[test]
fn base_colors_and_colours_of_vertices_are_the_same_in_a_mirror() {
    let shop = Workshop::new();
    let ramp = |[x, y, _]: [f32; 3]| [0.6 + 0.13 * x, 0.5 - 0.1 * y, 0.9, 1.0];
    let wraps = [Wrap::Clamp, Wrap::Mirror];
    let made = |in_mirror: bool| {
        let mut gltf = Gltf::new();
        if in_mirror {
            mirror(&mut gltf);
        }
        let texture = gltf.texture(&cells(), sampler(wraps));
        let material = gltf.material(painted(json!({"index": texture, "texCoord": 1})));
        let shape = behind().with_uvs(1, thrice_of).coloured(ramp);
        gltf.show(&shape, material);
        loaded(&gltf.write(&shop, "colours.gltf"), 1.0)
    };
    with_gpu(|gpu| {
        let what = Look { size: [48; 2], ..reference(64) };
        let mirrored = see(gpu, &made(true), what);
        // Where the mirror image is seen from, and what it sees there.
        let back =
            Eye::looking(Vec3::new(0.0, 0.0, -5.0), Vec3::new(0.0, 0.0, 1.0), 2.0 * 0.2f32.atan().to_degrees(), 1.0);
        let direct = look(gpu, &made(false), &[back], what).remove(0);
        // By the part of the picture, as the reference is drawn at random.
        let mut sums = [[[DVec3::ZERO; 2]; 4]; 4];
        for (x, y) in (0..48).flat_map(|y| (0..48).map(move |x| (x, y))) {
            if colour_at(thrice(on_plane(x, y, 48, 0.0)), wraps).is_some() {
                let sum = &mut sums[y as usize / 12][x as usize / 12];
                sum[0] += mirrored.at(x, y);
                sum[1] += direct.at(47 - x, y);
            }
        }
        for (i, [got, want]) in sums.iter().flatten().enumerate() {
            println!("part {i}: {:+.4}", got / want - 1.0);
            assert!(want.min_element() > 0.1, "part {i}: {want}");
            assert_near(&format!("part {i}"), *got, *want, 0.0, 0.05);
        }
    });
}

#[test]
fn transforms_of_textures_scale_then_turn_then_move() {
    let shop = Workshop::new();
    let cases = [
        json!({"offset": [0.3, -0.2]}),
        json!({"rotation": 0.6}),
        json!({"scale": [1.5, 0.5]}),
        json!({"offset": [0.1, 0.7], "rotation": -2.1, "scale": [0.8, 2.0]}),
        json!({"offset": [-0.5, 0.25], "rotation": 1.1, "scale": [-1.0, 1.2], "texCoord": 1}),
    ];
    let number = |value: &Value, otherwise: f64| value.as_f64().unwrap_or(otherwise);
    let pair = |value: &Value, otherwise: f64| DVec2::new(number(&value[0], otherwise), number(&value[1], otherwise));
    with_gpu(|gpu| {
        for case in cases {
            let mut gltf = Gltf::new();
            let texture = gltf.texture(&cells(), json!({}));
            let map = json!({"index": texture, "extensions": {"KHR_texture_transform": case}});
            gltf.uses(json!("KHR_texture_transform"));
            let material = gltf.material(painted(map));
            let second = |[u, v]: [f32; 2]| [1.0 - v, 0.5 * u];
            gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0).with_uvs(1, second), material);
            let scene = loaded(&gltf.write(&shop, "moved.gltf"), 1.0);
            let seen = see(gpu, &scene, Look { shading: Shading::BaseColor, size: [96; 2], ..Look::default() });
            let uv = |at: DVec2| {
                let plain = DVec2::new(0.5 * at.x + 0.5, 0.5 - 0.5 * at.y);
                let own = if case["texCoord"] == 1 { DVec2::new(1.0 - plain.y, 0.5 * plain.x) } else { plain };
                // The extension's matrices: translation · rotation · scale, of columns (cos, −sin), (sin, cos).
                let (sin, cos) = number(&case["rotation"], 0.0).sin_cos();
                let scaled = own * pair(&case["scale"], 1.0);
                let turned = DVec2::new(cos * scaled.x + sin * scaled.y, -sin * scaled.x + cos * scaled.y);
                turned + pair(&case["offset"], 0.0)
            };
            assert_colours(&case.to_string(), &seen, uv, [Wrap::Repeat; 2], 3e-3);
        }
    });
}

#[test]
fn the_eye_of_these_tests_sees_the_plane_as_they_think() {
    let ndc = front().clip_from_world() * glam::Vec4::new(0.5, -0.25, 0.0, 1.0);
    assert!((ndc.x / ndc.w - 0.5).abs() < 1e-5 && (ndc.y / ndc.w - 0.25).abs() < 1e-5, "{ndc}");
    assert!((on_plane(47, 39, 64, 0.0) - DVec2::new(0.484_375, -0.234_375)).length() < 1e-9);
}

#[test]
fn unlit_surfaces_keep_the_colours_of_their_vertices_in_a_mirror() {
    let shop = Workshop::new();
    let mut gltf = Gltf::new();
    mirror(&mut gltf);
    let unlit = gltf.material(json!({"doubleSided": true, "extensions": {"KHR_materials_unlit": {}}}));
    gltf.show(&behind().coloured(|[x, ..]| [0.5 + 0.1 * x, 0.25, 0.75, 1.0]), unlit);
    with_gpu(|gpu| {
        let (scene, warnings) = loaded_with_warnings(&gltf.write(&shop, "unlit.gltf"), 0.0);
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        let seen = see(gpu, &scene, reference(1));
        for x in [-0.9, -0.2, 0.4, 0.8] {
            let want = DVec3::new(0.5 + 0.3 * x, 0.25, 0.75);
            assert_near(&format!("at {x}"), seen.about([x, 0.1], 1), want, 5e-3, 0.0);
        }
    });
}
