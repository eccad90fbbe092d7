//! Models: the same in two formats, and where and how nodes place them.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use image::{GrayImage, Luma, Rgba, RgbaImage};
use pbr_vr::asset::comparison::compare;
use pbr_vr::render::{LightModel, Shading};
use serde_json::{Value, json};

use crate::common::gltf::{Gltf, Shape};
use crate::common::{PictureOptions, Workshop};

/// Maps of a made-up surface; v downwards.
struct Maps {
    base_color: RgbaImage,
    normal: RgbaImage,
    occlusion: GrayImage,
    roughness: GrayImage,
    metallic: GrayImage,
}

const SIDE: u32 = 128;

impl Maps {
    fn new() -> Self {
        let wave = |x: u32, y: u32, a: f64, b: f64| {
            let at = |i: u32| f64::from(i) / f64::from(SIDE) * std::f64::consts::TAU;
            (a * at(x) + 0.7).sin() * (b * at(y)).cos()
        };
        let byte = |v: f64| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let grey = |a: f64, b: f64, low: f64, high: f64| {
            GrayImage::from_fn(SIDE, SIDE, |x, y| Luma([byte(low + (high - low) * (0.5 + 0.5 * wave(x, y, a, b)))]))
        };
        Self {
            base_color: RgbaImage::from_fn(SIDE, SIDE, |x, y| {
                Rgba([byte(0.5 + 0.4 * wave(x, y, 2.0, 3.0)), byte(0.6 + 0.3 * wave(x, y, 4.0, 1.0)), 120, 255])
            }),
            normal: RgbaImage::from_fn(SIDE, SIDE, |x, y| {
                // More slope up than right, so that no axis can be swapped or turned.
                let n = DVec3::new(0.3 * wave(x, y, 3.0, 2.0), 0.15 + 0.3 * wave(x, y, 2.0, 4.0), 1.0).normalize();
                Rgba([byte(0.5 + 0.5 * n.x), byte(0.5 + 0.5 * n.y), byte(0.5 + 0.5 * n.z), 255])
            }),
            occlusion: grey(5.0, 2.0, 0.4, 1.0),
            roughness: grey(1.0, 2.0, 0.2, 0.9),
            metallic: grey(2.0, 1.0, -1.0, 2.0),
        }
    }

    fn packed(&self) -> RgbaImage {
        RgbaImage::from_fn(SIDE, SIDE, |x, y| {
            let [o, r, m] = [&self.occlusion, &self.roughness, &self.metallic].map(|map| map.get_pixel(x, y)[0]);
            Rgba([o, r, m, 255])
        })
    }
}

fn write_obj(shop: &Workshop, shape: &Shape, maps: &Maps) {
    maps.base_color.save(shop.path("color.png")).expect("a map");
    maps.normal.save(shop.path("normal.png")).expect("a map");
    for (name, map) in [("ao", &maps.occlusion), ("rough", &maps.roughness), ("metal", &maps.metallic)] {
        map.save(shop.path(&format!("{name}.png"))).expect("a map");
    }
    shop.write(
        "m.mtl",
        "newmtl m\nKd 0.9 0.8 1\nPr 0.8\nPm 1\nmap_Kd color.png\nnorm normal.png\nmap_Pr rough.png\nmap_Pm metal.png\nmap_ao ao.png\n",
    );
    let mut obj = String::from("mtllib m.mtl\n");
    for ((p, n), [u, v]) in shape.positions.iter().zip(&shape.normals).zip(&shape.uvs[0]) {
        writeln!(obj, "v {} {} {}\nvn {} {} {}\nvt {u} {}", p[0], p[1], p[2], n[0], n[1], n[2], 1.0 - v).expect("text");
    }
    obj.push_str("usemtl m\n");
    for t in shape.indices.chunks_exact(3) {
        let [a, b, c] = [t[0] + 1, t[1] + 1, t[2] + 1];
        writeln!(obj, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}").expect("text");
    }
    shop.write("model.obj", &obj);
}

fn mapped_material(gltf: &mut Gltf, maps: &Maps) -> usize {
    let [base, normal, orm] =
        [&maps.base_color, &maps.normal, &maps.packed()].map(|picture| gltf.texture(picture, json!({})));
    gltf.material(json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.9, 0.8, 1, 1], "baseColorTexture": {"index": base},
            "roughnessFactor": 0.8, "metallicRoughnessTexture": {"index": orm},
        },
        "normalTexture": {"index": normal}, "occlusionTexture": {"index": orm}, "doubleSided": true,
    }))
}

fn scene_of(shop: &Workshop, model: &str, camera: [f64; 3], fov_degrees: f64) -> std::path::PathBuf {
    let text = format!(
        "environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = \"{model}\"\n[[light]]\n\
         point = {{ position = [2, 3, 2], intensity = [20, 18, 15] }}\n\
         [[camera]]\nname = \"front\"\nposition = {camera:?}\ntarget = [0, 0, 0]\nvertical_fov_degrees = {fov_degrees}\n"
    );
    shop.write(&format!("{model}.toml"), &text)
}

/// How much two files' pictures differ: mean FLIP.
fn difference(shop: &Workshop, [a, b]: [&Path; 2], options: &PictureOptions<'_>) -> f32 {
    let [a, b] = [(a, "a"), (b, "b")].map(|(scene, name)| {
        let file = format!("{name}.png");
        shop.render(scene, &PictureOptions { file: &file, ..*options }).remove(0)
    });
    assert!(a.pixels.iter().flatten().any(|v| (v - a.pixels[0][0]).abs() > 0.1), "there is nothing in the picture");
    compare(&a, &b).expect("equal sizes").flip_mean
}

#[test]
fn a_model_looks_the_same_from_gltf_and_from_obj() {
    let shop = Workshop::new();
    shop.sky(4.0);
    let (shape, maps) = (Shape::ball(1.0, 32), Maps::new());
    write_obj(&shop, &shape, &maps);
    for name in ["model.gltf", "model.glb"] {
        let mut gltf = Gltf::new();
        let material = mapped_material(&mut gltf, &maps);
        gltf.show(&shape, material);
        gltf.write(&shop, name);
    }
    let scene = |model| scene_of(&shop, model, [0.4, 0.8, 3.0], 45.0);
    let [obj, gltf, glb] = ["model.obj", "model.gltf", "model.glb"].map(scene);
    let modes = [
        (LightModel::Baked, Shading::Pbr),
        (LightModel::Open, Shading::Pbr),
        (LightModel::Open, Shading::Normal),
        (LightModel::Open, Shading::Roughness),
        (LightModel::Open, Shading::Metallic),
        (LightModel::Open, Shading::Occlusion),
    ];
    for (light, shading) in modes {
        let options = PictureOptions { light, shading, size: [256, 192], ..PictureOptions::default() };
        let flip = difference(&shop, [&gltf, &obj], &options);
        println!("{light:?}, {shading:?}: FLIP {flip}");
        assert!(flip <= 0.002, "{light:?}, {shading:?}: {flip}");
    }
    let options = PictureOptions { light: LightModel::Open, size: [256, 192], ..PictureOptions::default() };
    assert_eq!(difference(&shop, [&glb, &gltf], &options), 0.0, "a binary file");
}

/// Four boxes that look different from every side: a shaft with a head, and two fins.
fn arrow() -> Shape {
    let mut arrow = Shape::default();
    for (low, high) in [
        ([-0.05, -0.05, -0.4], [0.05, 0.05, 0.3]),
        ([-0.15, -0.08, 0.3], [0.15, 0.08, 0.45]),
        ([0.05, -0.03, -0.4], [0.3, 0.03, -0.2]),
        ([-0.03, 0.05, -0.4], [0.03, 0.2, -0.1]),
    ] {
        let block = Shape::block(low, high);
        let first = arrow.positions.len() as u32;
        arrow.positions.extend(&block.positions);
        arrow.normals.extend(&block.normals);
        arrow.indices.extend(block.indices.iter().map(|i| first + i));
    }
    arrow
}

/// Nodes and the matrices that they stand for.
fn placements(gltf: &mut Gltf, mesh: usize) -> Vec<DMat4> {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.9, 0.3);
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let moved = |x, y, by: DMat4| DMat4::from_translation(at(x, y)) * by;
    let sheared =
        DMat4::from_cols_array(&[0.9, 0.2, 0.0, 0.0, 0.3, 1.1, -0.2, 0.0, 0.1, 0.4, 0.7, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let array = |m: DMat4| json!(m.to_cols_array());
    let q = json!(turn.to_array());
    let mut all = Vec::new();
    let mut add = |node: Value, by: DMat4| {
        gltf.node(node);
        all.push(by);
    };
    add(json!({"mesh": mesh, "translation": [-1.5, 0.8, 0]}), moved(-1.5, 0.8, DMat4::IDENTITY));
    add(json!({"mesh": mesh, "translation": [-0.5, 0.8, 0], "rotation": q}), moved(-0.5, 0.8, DMat4::from_quat(turn)));
    let uneven = DVec3::new(1.6, 0.6, 0.9);
    add(
        json!({"mesh": mesh, "translation": [0.5, 0.8, 0], "rotation": q, "scale": uneven.to_array()}),
        moved(0.5, 0.8, DMat4::from_quat(turn) * DMat4::from_scale(uneven)),
    );
    let mirror = DVec3::new(-1.0, 1.0, 1.0);
    add(
        json!({"mesh": mesh, "translation": [1.5, 0.8, 0], "rotation": q, "scale": mirror.to_array()}),
        moved(1.5, 0.8, DMat4::from_quat(turn) * DMat4::from_scale(mirror)),
    );
    add(json!({"mesh": mesh, "matrix": array(moved(-1.5, -0.6, sheared))}), moved(-1.5, -0.6, sheared));
    let inside_out = DVec3::new(-0.9, -1.2, -0.7);
    add(
        json!({"mesh": mesh, "matrix": array(moved(-0.5, -0.6, DMat4::from_quat(turn) * DMat4::from_scale(inside_out)))}),
        moved(-0.5, -0.6, DMat4::from_quat(turn) * DMat4::from_scale(inside_out)),
    );
    // A turned node below an uneven one shears; below that one more, mirrored.
    let leaf = gltf.child(json!({"mesh": mesh, "rotation": q}));
    gltf.node(json!({"children": [leaf], "translation": [0.5, -0.6, 0], "scale": uneven.to_array()}));
    all.push(moved(0.5, -0.6, DMat4::from_scale(uneven) * DMat4::from_quat(turn)));
    let leaf = gltf.child(json!({"mesh": mesh, "scale": mirror.to_array()}));
    let middle = gltf.child(json!({"children": [leaf], "matrix": array(sheared)}));
    gltf.node(json!({"children": [middle], "translation": [1.5, -0.6, 0], "rotation": q}));
    all.push(moved(1.5, -0.6, DMat4::from_quat(turn) * sheared * DMat4::from_scale(mirror)));
    all
}

/// A picture of nodes beside one of the same triangles where they are, without nodes.
fn assert_same_as_moved(shape: &Shape, material: impl Fn(&mut Gltf) -> usize) {
    let shop = Workshop::new();
    shop.sky(4.0);
    let mut nodes = Gltf::new();
    let own = material(&mut nodes);
    let mesh = nodes.mesh(shape, own);
    let places = placements(&mut nodes, mesh);
    nodes.write(&shop, "nodes.gltf");
    let mut flat = Gltf::new();
    let own = material(&mut flat);
    places.iter().for_each(|place| flat.show(&shape.moved(*place), own));
    flat.write(&shop, "flat.gltf");
    let scene = |model| scene_of(&shop, model, [0.5, 0.6, 5.0], 36.0);
    let [nodes, flat] = ["nodes.gltf", "flat.gltf"].map(scene);
    let tangents = (!shape.uvs[0].is_empty()).then_some(Shading::Tangent);
    for shading in [Shading::Normal, Shading::Pbr].into_iter().chain(tangents) {
        let options =
            PictureOptions { light: LightModel::Open, shading, size: [384, 216], ..PictureOptions::default() };
        let flip = difference(&shop, [&nodes, &flat], &options);
        println!("{shading:?}: FLIP {flip}");
        // An edge that falls between two samples the other way is one of 83,000 pixels.
        assert!(flip <= 3e-4, "{shading:?}: {flip}");
    }
}

#[test]
fn nodes_place_and_distort_meshes_with_their_normals() {
    assert_same_as_moved(&arrow(), |gltf| {
        gltf.material(json!({"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.5, 0.2, 1], "metallicFactor": 0.3}}))
    });
}

#[test]
fn mirrored_nodes_mirror_mapped_normals() {
    let mut shape = Shape::ball(0.4, 16);
    // No longer round, and lopsided.
    shape.positions.iter_mut().for_each(|p| p[0] += 0.2 * p[1]);
    let maps = Maps::new();
    assert_same_as_moved(&shape, |gltf| mapped_material(gltf, &maps));
}

#[test]
fn tangents_of_the_file_are_mirrored_with_it() {
    let maps = Maps::new();
    let mut shape = Shape::plate([-0.4, 0.4], [-0.4, 0.4], 0.0);
    // Not those that the texture coordinates give.
    shape.tangents = vec![[0.6, 0.8, 0.0, 1.0]; 4];
    assert_same_as_moved(&shape, |gltf| mapped_material(gltf, &maps));
    shape.tangents = vec![[0.6, 0.8, 0.0, -1.0]; 4];
    assert_same_as_moved(&shape, |gltf| mapped_material(gltf, &maps));
}
