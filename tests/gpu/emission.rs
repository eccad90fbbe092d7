//! Light that surfaces of models give: what is seen of it, and what it lights.

use glam::{DVec3, Vec3};
use image::{Rgba, RgbaImage};
use pbr_vr::render::{Eye, LightModel, Shading};
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

/// A closed white room of walls 4 m wide with a panel that shines below its ceiling.
fn room(shop: &Workshop, albedo: f64, strength: f64) -> std::path::PathBuf {
    let mut gltf = Gltf::new();
    let paint = gltf.material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [albedo, albedo, 0.6 * albedo, 1], "metallicFactor": 0, "roughnessFactor": 1},
        "doubleSided": true,
    }));
    let panel = gltf.material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1, "roughnessFactor": 1},
        "emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": strength}},
        "doubleSided": true,
    }));
    let mut walls = Shape::block([-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]);
    walls.normals.iter_mut().flatten().for_each(|c| *c = -*c);
    walls.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    gltf.show(&walls, paint);
    gltf.show(&Shape::block([-1.0, 1.9, -1.0], [1.0, 1.95, 1.0]), panel);
    gltf.write(shop, "room.gltf")
}

#[test]
fn a_room_lit_by_a_panel_alone_is_lit_as_in_the_exact_picture() {
    let shop = Workshop::new();
    let corner = Eye::looking(Vec3::new(1.6, -0.4, 1.6), Vec3::new(-1.0, -1.0, -1.0), 70.0, 1.0);
    with_gpu(|gpu| {
        let scene = loaded(&room(&shop, 0.6, 5.0), 0.0);
        let what = Look { light: LightModel::Baked, size: [32; 2], ..Look::default() };
        let baked = look(gpu, &scene, &[corner], what).remove(0);
        let exact = look(gpu, &scene, &[corner], Look { shading: Shading::Reference, frames: 96, ..what }).remove(0);
        let error = exact.error.expect("an error").mean_relative;
        let (got, want) = (baked.mean(), exact.mean());
        println!("baked {got}, exact {want}, ± {error} of a pixel");
        assert!(want.min_element() > 0.1, "{want}");
        assert_near("the room's mean", got, want, 0.0, 0.03);
        let blocks = |seen: &Seen| -> Vec<DVec3> {
            let block = |i: u32| {
                let all = (0..64).map(|k| seen.at(i % 4 * 8 + k % 8, i / 4 * 8 + k / 8));
                all.sum::<DVec3>() / 64.0
            };
            (0..16).map(block).collect()
        };
        for (i, (got, want)) in blocks(&baked).into_iter().zip(blocks(&exact)).enumerate() {
            println!("block {i}: {:+.3}", (got / want - 1.0).x);
            assert_near(&format!("block {i}"), got, want, 0.01, 0.06);
        }
    });
}
