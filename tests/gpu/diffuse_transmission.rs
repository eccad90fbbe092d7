//! Light that diffuses through sheets: lamps against f64, even light, pictures and baked light against the exact ones.

use glam::{DVec3, Vec3};
use pbr_vr::asset::material::DiffuseTransmission;
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::brdf::Geometry;
use pbr_vr::reference::energy::{Curve, Energy, Scattering};
use pbr_vr::render::{LightModel, Shading};
use pbr_vr::scene::{Material, Scene};
use serde_json::{Value, json};

use crate::common::brdf::slanted;
use crate::common::gltf::{Gltf, Shape};
use crate::common::solids::{Shot, block, eye, flat, grey, lamp, level, take, turned, uniform, world};
use crate::common::stage::with_gpu;
use crate::common::{PictureOptions, Workshop, mean_colour, pixel};

const SIDE: u32 = 33;
const GREEN: [f64; 3] = [0.5, 0.8, 0.1];

/// A leaf, seen from both sides.
fn leaf(base: f64, roughness: f64, share: f64, color: [f64; 3]) -> Value {
    json!({
        "pbrMetallicRoughness":
            {"baseColorFactor": [base, base, base, 1], "metallicFactor": 0, "roughnessFactor": roughness},
        "doubleSided": true,
        "extensions": {"KHR_materials_diffuse_transmission":
            {"diffuseTransmissionFactor": share, "diffuseTransmissionColorFactor": color}},
    })
}

/// A leaf that fills the picture, seen from far away along -v.
fn picture(shop: &Workshop, leaf: Value, v: DVec3, more: &str, options: &PictureOptions<'_>) -> Picture {
    let mut gltf = Gltf::new();
    let material = gltf.material(leaf);
    gltf.show(&Shape::plate([-0.5, 0.5], [-0.5, 0.5], 0.0), material);
    gltf.write(shop, "leaf.gltf");
    shop.seen_from_afar("leaf.gltf", v, more, options)
}

#[test]
fn a_lamp_behind_a_leaf_is_what_f64_says() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    let (away, share) = (2.0, 0.6);
    for (roughness, v, l) in [
        (0.9, slanted(0.9, 0.3), slanted(0.8, 3.0)),
        (0.3, slanted(0.3, 0.3), slanted(0.6, 1.0)),
        // The eye behind, the lamp before it.
        (0.5, -slanted(0.7, 0.3), -slanted(0.5, 2.0)),
    ] {
        let at_v = Curve::new(roughness, Geometry::Smith).at(v.z.abs());
        let energy = Energy::new(roughness, Geometry::Smith, Scattering::Multiple);
        let through = energy.diffuse_transmission(share, GREEN.into(), 0.0, at_v);
        let want = 40.0 / (away * away) * l.z.abs() * through;
        let [x, y, z] = (-away * l).to_array();
        let lamp = format!("[[light]]\npoint = {{ position = [{x}, {y}, {z}], intensity = [40, 40, 40] }}\n");
        for (shading, light) in [
            (Shading::Pbr, LightModel::Open),
            (Shading::Pbr, LightModel::Direct),
            (Shading::Pbr, LightModel::Baked),
            (Shading::Reference, LightModel::Open),
            (Shading::Reference, LightModel::Baked),
        ] {
            let frames = if shading == Shading::Pbr { 1 } else { 64 };
            let options = PictureOptions { light, ..PictureOptions::open(SIDE, shading, frames) };
            let picture = picture(&shop, leaf(0.4, roughness, share, GREEN), v, &lamp, &options);
            // A path takes either side, so that one pixel is noisy.
            let got = if shading == Shading::Pbr {
                DVec3::from(pixel(&picture, SIDE / 2, SIDE / 2))
            } else {
                mean_colour(&picture)
            };
            let off = (got / want - 1.0).abs().max_element();
            assert!(off < 1.5e-2, "{roughness} {v:.2} {shading:?} {light:?}: {got} against {want}");
        }
    }
}

#[test]
fn under_even_light_a_white_leaf_is_white() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    for (roughness, share, v) in [(0.2, 0.5, slanted(0.5, 0.0)), (0.9, 1.0, slanted(0.9, 1.5))] {
        for (shading, frames, bound) in [(Shading::Pbr, 1, 0.004), (Shading::Reference, 64, 0.01)] {
            let options = PictureOptions::open(SIDE, shading, frames);
            let got = mean_colour(&picture(&shop, leaf(1.0, roughness, share, [1.0; 3]), v, "", &options)).x;
            assert!((got - 1.0).abs() < bound, "{roughness} {share} {shading:?}: {got}");
        }
    }
}

/// A sky that is bright above the leaf and of another color below.
#[test]
fn a_panorama_behind_a_leaf_is_that_of_the_exact_picture() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 64, |d| if d[2] > 0.0 { [0.2, 0.4, 0.9] } else { [1.0 - 0.5 * d[0] as f32, 1.5, 0.3] });
    let [fast, exact] = [(Shading::Pbr, 1), (Shading::Reference, 64)].map(|(shading, frames)| {
        let options = PictureOptions::open(SIDE, shading, frames);
        mean_colour(&picture(&shop, leaf(0.3, 0.6, 0.7, GREEN), slanted(0.6, 0.4), "", &options))
    });
    println!("{fast} against {exact}");
    assert!((fast / exact - 1.0).abs().max_element() < 0.02, "{fast} against {exact}");
}

/// A closed room whose lamp is above a sheet from wall to wall.
fn lamp_behind_paper() -> Scene {
    let walls = turned(block([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]));
    let through = DiffuseTransmission { share: 0.6, color: Vec3::splat(0.9) };
    let paper = Material { diffuse_transmission: Some(through), culls_backs: false, ..grey(0.8, 0.0, 0.9) };
    let meshes = vec![flat(0, &walls), flat(1, &[level([-1.0, 1.0], 0.3, [-1.0, 1.0])])];
    world(meshes, vec![grey(0.5, 0.0, 1.0), paper], vec![lamp([0.2, 0.7, -0.1], 3.0)], uniform(0.0))
}

#[test]
fn light_through_paper_lights_a_room_as_in_the_exact_picture() {
    let scene = lamp_behind_paper();
    // The paper from below; the floor; a wall from above, which the floor gives little.
    let views = [
        eye([0.1, -0.8, 0.1], [0.0, 0.3, 0.0], 60.0),
        eye([0.1, 0.2, 0.1], [0.0, -1.0, 0.0], 60.0),
        eye([0.1, 0.6, 0.1], [-1.0, 0.65, 0.0], 30.0),
    ];
    with_gpu(|gpu| {
        for (i, view) in views.iter().enumerate() {
            let baked = take(gpu, &scene, view, Shot::new(LightModel::Baked, 24)).mean();
            let exact = take(gpu, &scene, view, Shot::reference(LightModel::Baked, 24, 128)).mean();
            println!("view {i}: baked {baked:.5}, exact {exact:.5}: {:+.2} %", 100.0 * (baked / exact - 1.0));
            assert!(exact > 0.01 && (baked / exact - 1.0).abs() < 0.03, "view {i}: {baked} against {exact}");
        }
    });
}
