//! Tests of compressed primitives, with meshes that Draco's own encoder compresses.

use draco_core::{
    DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh, MeshEncoder, PointAttribute,
};
use serde_json::{Value, json};

use super::build_tests::{Build, numbers, only};
use super::draco::NAME;
use crate::asset::mesh::Submesh;

/// Quads along a side.
const QUADS: u32 = 4;
/// Attributes of the grid: name, its accessor's type and type of numbers, and what Draco calls them.
const ATTRIBUTES: [(&str, &str, u32, GeometryAttributeType, DataType); 4] = [
    ("POSITION", "VEC3", 5126, GeometryAttributeType::Position, DataType::Float32),
    ("NORMAL", "VEC3", 5126, GeometryAttributeType::Normal, DataType::Float32),
    ("TEXCOORD_0", "VEC2", 5126, GeometryAttributeType::TexCoord, DataType::Float32),
    ("COLOR_0", "VEC4", 5121, GeometryAttributeType::Color, DataType::Uint8),
];

/// A curved grid: the numbers of each attribute, and triangles.
fn grid() -> ([Vec<f64>; 4], Vec<[u32; 3]>) {
    let side = QUADS + 1;
    let mut values = [const { Vec::new() }; 4];
    for (x, y) in (0..side * side).map(|at| (at % side, at / side)) {
        let (s, t) = (f64::from(x) / f64::from(QUADS), f64::from(y) / f64::from(QUADS));
        values[0].extend([s, t, s * t]);
        let length = (s * s + t * t + 1.0).sqrt();
        values[1].extend([-t / length, -s / length, 1.0 / length]);
        values[2].extend([s, t]);
        values[3].extend([f64::from(50 * x), f64::from(50 * y), 255.0, 128.0]);
    }
    let quad = |at: u32| {
        let low = at / QUADS * side + at % QUADS;
        [[low, low + 1, low + side + 1], [low, low + side + 1, low + side]]
    };
    (values, (0..QUADS * QUADS).flat_map(quad).collect())
}

/// The grid as Draco's bytes.
fn packed(speed: i32) -> Vec<u8> {
    let (values, triangles) = grid();
    let mut mesh = Mesh::new();
    for ((_, kind, code, draco, numbers_of), values) in ATTRIBUTES.into_iter().zip(&values) {
        let width = usize::from(kind.as_bytes()[3] - b'0');
        let mut attribute = PointAttribute::new();
        attribute.init(draco, width as u8, numbers_of, code == 5121, values.len() / width);
        attribute.buffer_mut().write(0, &numbers(code, values));
        mesh.add_attribute(attribute);
    }
    mesh.set_num_faces(triangles.len());
    for (face, corners) in triangles.iter().enumerate() {
        mesh.set_face(FaceIndex(face as u32), corners.map(Into::into));
    }
    let mut options = EncoderOptions::new();
    options.set_compression_level(10 - speed);
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut buffer = EncoderBuffer::new();
    encoder.encode(&options, &mut buffer).unwrap();
    buffer.data().to_vec()
}

/// A file of the grid: compressed at a speed, or as it is.
fn built(speed: Option<i32>) -> Build {
    let (values, triangles) = grid();
    let mut build = Build::new();
    let corners: Vec<f64> = triangles.as_flattened().iter().map(|corner| f64::from(*corner)).collect();
    let (mut attributes, mut ids) = (json!({}), json!({}));
    for (id, ((name, kind, code, ..), values)) in ATTRIBUTES.into_iter().zip(&values).enumerate() {
        attributes[name] = json!(build.typed(kind, code, values, code == 5121));
        ids[name] = json!(id);
    }
    let indices = build.typed("SCALAR", 5121, &corners, false);
    let mut primitive = json!({"attributes": attributes, "indices": indices});
    if let Some(speed) = speed {
        for accessor in build.json["accessors"].as_array_mut().unwrap() {
            accessor.as_object_mut().unwrap().remove("bufferView");
        }
        let view = build.view(&packed(speed));
        primitive["extensions"] = json!({NAME: {"bufferView": view, "attributes": ids}});
        build.json["extensionsRequired"] = json!([NAME]);
    }
    build.mesh(primitive);
    build
}

/// A compressed model.
pub fn compressed() -> Vec<u8> {
    built(Some(0)).glb()
}

/// The triangles of a mesh in an order of their own: Draco keeps neither their order nor which corner is first.
fn sorted(submesh: &Submesh) -> Vec<Vec<f32>> {
    let corners = submesh.corners.iter().zip(&submesh.extras).map(|(corner, extra)| {
        [&corner.position.to_array()[..], &corner.normal.to_array(), &corner.uv.to_array(), &extra.colour.to_array()]
            .concat()
    });
    let corners: Vec<Vec<f32>> = corners.collect();
    let mut triangles: Vec<Vec<f32>> = corners
        .chunks_exact(3)
        .map(|triangle| {
            let first = (0..3).min_by(|a, b| triangle[*a].partial_cmp(&triangle[*b]).unwrap()).unwrap();
            (0..3).flat_map(|at| triangle[(first + at) % 3].clone()).collect()
        })
        .collect();
    triangles.sort_by(|a, b| a.partial_cmp(b).unwrap());
    triangles
}

#[test]
fn a_compressed_primitive_is_what_was_compressed() {
    let expected = sorted(only(&built(None).model()));
    assert_eq!(expected.len(), 2 * (QUADS * QUADS) as usize);
    // The slowest walks along edges, the fastest does not.
    for speed in [0, 5, 10] {
        let model = built(Some(speed)).model();
        assert_eq!(sorted(only(&model)), expected, "at the speed {speed}");
    }
    // What it was made of says nothing of what is decompressed.
    let strip = built(Some(0)).with("/meshes/0/primitives/0", "mode", json!(5)).model();
    assert_eq!(sorted(only(&strip)), expected);
    let counted = built(Some(0)).with("/accessors/0", "count", json!(1)).model();
    assert_eq!(sorted(only(&counted)), expected);
}

#[test]
fn broken_compression() {
    let primitive = "/meshes/0/primitives/0";
    let extension = format!("{primitive}/extensions/{NAME}");
    let problem = |pointer: &str, key: &str, value: Value| built(Some(0)).with(pointer, key, value).problem();
    for (pointer, key, value, why) in [
        (primitive, "indices", Value::Null, "mesh 0: it is compressed, and has no indices"),
        (primitive, "indices", json!(99), "there is no accessor 99"),
        (&extension, "bufferView", json!(99), "there is no buffer view 99"),
        (&extension, "bufferView", json!("a"), "KHR_draco_mesh_compression: invalid type"),
        (
            &extension,
            "attributes",
            json!({"POSITION": 9}),
            "its compressed data has no attribute 9, which is its POSITION",
        ),
        ("/accessors/0", "type", json!("MAT2"), "there is no accessor 0, or its type is unknown"),
        ("/accessors/0", "type", json!("VEC2"), "accessor 0 is not of the type VEC3"),
    ] {
        let problem = problem(pointer, key, value);
        assert!(problem.contains(why), "{key}: {problem}");
    }
    let mut cut = built(Some(0));
    let length = cut.json["bufferViews"][5]["byteLength"].as_u64().unwrap();
    for shorter in [0, 1, 11, length / 2, length - 1] {
        cut.json["bufferViews"][5]["byteLength"] = json!(shorter);
        let problem = cut.problem();
        assert!(problem.contains("mesh 0: its compressed data cannot be read"), "{shorter}: {problem}");
    }
}
