//! Light that surfaces of models give: what is seen of it, and what it lights.

use glam::{DVec3, Vec3};
use image::{Rgba, RgbaImage};
use pbr_vr::render::{Eye, LightDetail, LightModel, Shading};
use serde_json::json;

use crate::common::Workshop;
use crate::common::colour::{Look, Seen, assert_near, loaded, look, see};
use crate::common::gltf::{Gltf, Shape};
use crate::common::stage::with_gpu;

#[test]
fn emission_is_factor_times_strength_times_map() {
    let shop = Workshop::new();
    let mut gltf = Gltf::new();
    // Two halves: 1, and what 188 stands for.
    let halves = RgbaImage::from_fn(64, 64, |x, _| Rgba(if x < 32 { [255; 4] } else { [188, 188, 188, 255] }));
    let texture = gltf.texture(&halves, json!({"wrapS": 33071, "wrapT": 33071}));
    let material = gltf.material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1, "roughnessFactor": 1},
        "emissiveFactor": [1.0, 0.5, 0.25], "emissiveTexture": {"index": texture},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 12.5}},
    }));
    gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0), material);
    with_gpu(|gpu| {
        // A black metal reflects nothing.
        let scene = loaded(&gltf.write(&shop, "emission.glb"), 0.7);
        let full = DVec3::new(12.5, 6.25, 3.125);
        let dim = ((188.0 / 255.0 + 0.055) / 1.055f64).powf(2.4);
        for light in [LightModel::Open, LightModel::Direct, LightModel::Baked] {
            for (shading, samples) in
                [(Shading::Pbr, 1), (Shading::Pbr, 4), (Shading::Phong, 1), (Shading::Reference, 1)]
            {
                if shading == Shading::Phong && light == LightModel::Baked {
                    continue;
                }
                let seen = see(gpu, &scene, Look { light, shading, samples, frames: 2, ..Look::default() });
                let name = format!("{light:?}, {shading:?}");
                // Phong keeps a highlight of metals; its base color is black.
                assert_near(&name, seen.about([-0.5, 0.2], 3), full, 0.0, 2e-3);
                assert_near(&name, seen.about([0.5, -0.2], 3), full * dim, 0.0, 4e-3);
            }
        }
    });
}

/// A closed white room of walls 4 m wide.
fn room() -> Gltf {
    let mut gltf = Gltf::new();
    let paint = gltf.material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.6, 0.36, 1], "metallicFactor": 0, "roughnessFactor": 1},
        "doubleSided": true,
    }));
    let mut walls = Shape::block([-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]);
    walls.normals.iter_mut().flatten().for_each(|c| *c = -*c);
    walls.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    gltf.show(&walls, paint);
    // With it the scene is so large that a coarse lightmap is fine enough.
    gltf.show(&Shape::plate([0.0, 1e-3], [12.0, 12.001], 0.0), paint);
    gltf
}

/// The light that is baked for a room is that of the exact picture: all in all, and in each part.
fn assert_baked_is_exact(name: &str, room: &Gltf) {
    let shop = Workshop::new();
    let corner = Eye::looking(Vec3::new(1.6, -0.4, 1.6), Vec3::new(-1.0, -1.0, -1.0), 70.0, 1.0);
    with_gpu(|gpu| {
        let scene = loaded(&room.write(&shop, "room.gltf"), 0.0);
        let detail = LightDetail { lightmap_size: Some(128), ..LightDetail::default() };
        let what = Look { light: LightModel::Baked, size: [32; 2], detail, ..Look::default() };
        let baked = look(gpu, &scene, &[corner], what).remove(0);
        let exact = look(gpu, &scene, &[corner], Look { shading: Shading::Reference, frames: 32, ..what }).remove(0);
        let (got, want) = (baked.mean(), exact.mean());
        println!("{name}: baked {got}, exact {want}: {}", got / want - 1.0);
        assert!(want.min_element() > 0.01, "{name}: {want}");
        assert_near(name, got, want, 0.0, 0.03);
        let parts = |seen: &Seen| -> Vec<DVec3> {
            let part = |i: u32| {
                let all = (0..64).map(|k| seen.at(i % 4 * 8 + k % 8, i / 4 * 8 + k / 8));
                all.sum::<DVec3>() / 64.0
            };
            (0..16).map(part).collect()
        };
        for (i, (got, want)) in parts(&baked).into_iter().zip(parts(&exact)).enumerate() {
            println!("{name}, part {i}: {:+.3}", (got / want - 1.0).x);
            assert_near(&format!("{name}, part {i}"), got, want, 0.01, 0.08);
        }
    });
}

#[test]
fn a_room_lit_by_a_panel_alone_is_lit_as_in_the_exact_picture() {
    let mut room = room();
    let panel = room.material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1, "roughnessFactor": 1},
        "emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 5}},
        "doubleSided": true,
    }));
    room.show(&Shape::block([-1.0, 1.9, -1.0], [1.0, 1.95, 1.0]), panel);
    assert_baked_is_exact("panel", &room);
}

/// All that is seen but for the spot itself is light that walls give back.
#[test]
fn a_room_lit_by_a_spot_light_alone_is_lit_as_in_the_exact_picture() {
    let mut room = room();
    let spot = json!({"innerConeAngle": 0.3, "outerConeAngle": 0.5});
    // Upwards: the ceiling's spot is not in the picture.
    let node = json!({"translation": [-0.3, -0.5, 0.2], "rotation": [0.707_106_77, 0, 0, 0.707_106_77]});
    room.light(json!({"type": "spot", "intensity": 60.0, "spot": spot}), node);
    assert_baked_is_exact("spot", &room);
}
