//! Tests of reading geometry: types of accessors, attributes, triangles, skins and morph targets.

use glam::{Vec2, Vec3, Vec4, vec2, vec3, vec4};
use serde_json::json;

use super::build_tests::{Build, numbers, only, problem};

/// Texture coordinates of the triangle's corners, of a type of component.
fn uvs(code: u32, values: &[f64], normalized: bool) -> Vec<Vec2> {
    let mut build = Build::triangle();
    let accessor = build.typed("VEC2", code, values, normalized);
    build.attribute("TEXCOORD_0", accessor);
    only(&build.model()).corners.iter().map(|corner| vec2(corner.uv.x, 1.0 - corner.uv.y)).collect()
}

#[test]
fn components_of_each_type() {
    for (code, most) in [(5120, 127.0), (5121, 255.0), (5122, 32767.0), (5123, 65535.0), (5125, 4294967295.0)] {
        let values = [0.0, most, 1.0, 0.0, most, most];
        let normalized = uvs(code, &values, true);
        assert!((normalized[0] - Vec2::Y).length() < 1e-6 && (normalized[2] - Vec2::ONE).length() < 1e-6, "{code}");
        assert_eq!(uvs(code, &[0.0, 100.0, 1.0, 0.0, 2.0, 7.0], false), [vec2(0.0, 100.0), Vec2::X, vec2(2.0, 7.0)]);
    }
    assert_eq!(uvs(5120, &[-128.0, -127.0, 0.0, 0.0, 0.0, 0.0], true)[0], Vec2::NEG_ONE, "no less than −1");
    assert_eq!(uvs(5126, &[0.5, -2.0, 0.0, 0.0, 0.0, 0.0], true)[0], vec2(0.5, -2.0));
}

#[test]
fn strides_and_offsets() {
    let mut build = Build::new();
    // 4 bytes that do not belong to it, then 20 for each vertex, of which the last has only 12.
    let mut values = vec![9.0];
    for position in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        values.extend(position);
        values.extend([7.0, 7.0]);
    }
    values.truncate(values.len() - 2);
    let view = build.view(&numbers(5126, &values));
    build.json["bufferViews"][view]["byteStride"] = json!(20);
    let accessor = json!({"bufferView": view, "byteOffset": 4, "componentType": 5126, "count": 3, "type": "VEC3"});
    let position = build.accessor(accessor);
    build.mesh(json!({"attributes": {"POSITION": position}}));
    assert_eq!(positions(&build), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    build.json["accessors"][position]["count"] = json!(4);
    assert!(build.problem().contains("accessor 0 needs more bytes than its buffer has for it"));
}

fn positions(build: &Build) -> Vec<Vec3> {
    only(&build.model()).corners.iter().map(|corner| corner.position).collect()
}

#[test]
fn sparse_elements_replace_others() {
    for (code, based) in [(5121, true), (5123, false), (5125, true)] {
        let mut build = Build::triangle();
        let indices = build.view(&numbers(code, &[1.0, 2.0]));
        let values = build.view(&numbers(5126, &[2.0, 0.0, 0.0, 0.0, 3.0, 0.0]));
        build.json["accessors"][0]["sparse"] = json!({
            "count": 2, "indices": {"bufferView": indices, "componentType": code}, "values": {"bufferView": values},
        });
        if !based {
            build.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        }
        assert_eq!(positions(&build), [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 3.0], "{code}");
        for bad in [[2.0, 1.0], [1.0, 1.0], [1.0, 3.0]] {
            let at = build.json["bufferViews"][indices]["byteOffset"].as_u64().unwrap() as usize;
            let bytes = numbers(code, &bad);
            build.bytes[at..at + bytes.len()].copy_from_slice(&bytes);
            assert!(build.problem().contains("sparse indices do not rise"), "{bad:?}");
        }
    }
}

#[test]
fn lists_strips_and_fans() {
    let square = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
    let fan = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
    for (mode, values) in [(5, square), (6, fan)] {
        let mut build = Build::new();
        let position = build.floats("VEC3", &values);
        build.mesh(json!({"attributes": {"POSITION": position}, "mode": mode}));
        let model = build.model();
        assert_eq!(only(&model).corners.len(), 6, "{mode}");
        assert!(only(&model).corners.iter().all(|corner| corner.normal == Vec3::Z), "{mode}: all turn alike");
    }
    let mut build = Build::triangle();
    let indices = build.typed("SCALAR", 5121, &[2.0, 1.0, 0.0, 2.0, 2.0, 1.0, 0.0], false);
    let build = build.with("/meshes/0/primitives/0", "indices", json!(indices));
    assert_eq!(positions(&build), [Vec3::Y, Vec3::X, Vec3::ZERO], "neither a line nor a rest");
}

#[test]
fn indices_that_are_none() {
    for (code, index, why) in [
        (5123, 3.0, "3 vertices"),
        (5121, 255.0, "end of a strip"),
        (5123, 65535.0, "end of a strip"),
        (5126, 1.0, "type"),
    ] {
        let mut build = Build::triangle();
        let indices = build.typed("SCALAR", code, &[0.0, 1.0, index], false);
        let build = build.with("/meshes/0/primitives/0", "indices", json!(indices));
        assert!(build.problem().contains(why), "{}", build.problem());
    }
    let build = Build::triangle().with("/meshes/0/primitives/0", "mode", json!(7));
    assert!(build.problem().contains("mesh 0: its mode 7 is unknown"));
}

#[test]
fn points_and_what_has_no_positions_are_left_out() {
    let mut build = Build::triangle();
    build.mesh(json!({"attributes": {"POSITION": 0}, "mode": 1}));
    build.mesh(json!({"attributes": {"POSITION": 0}, "mode": 0}));
    let (model, warning) = build.warned();
    assert_eq!(warning, "a.glb: mesh 1: points and lines are not drawn");
    only(&model);
    let mut build = Build::triangle();
    build.mesh(json!({"attributes": {"NORMAL": 0}}));
    assert_eq!(build.warned().1, "a.glb: mesh 1: it has no positions; left out");
}

#[test]
fn normals_are_flat_unless_given() {
    // Two triangles that meet in an edge at a gentle angle.
    let fold = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.2, 0.0, 1.0, 0.0];
    let mut build = Build::new();
    let position = build.floats("VEC3", &fold);
    build.mesh(json!({"attributes": {"POSITION": position}}));
    let model = build.model();
    let normals: Vec<_> = only(&model).corners.iter().map(|corner| corner.normal).collect();
    assert_eq!(normals[..3], [Vec3::Z; 3]);
    assert!(normals[3..].iter().all(|n| n.is_normalized() && *n != Vec3::Z && *n == normals[3]), "{normals:?}");
    // A zero normal among others is completed; others get unit length.
    let mut build = Build::triangle();
    let normal = build.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.0]);
    build.attribute("NORMAL", normal);
    let model = build.model();
    let normals: Vec<_> = only(&model).corners.iter().map(|corner| corner.normal).collect();
    assert_eq!(normals, [Vec3::Z, Vec3::Z, Vec3::Y]);
}

#[test]
fn tangents_keep_their_sign() {
    let mut build = Build::triangle();
    let tangent = build.floats("VEC4", &[2.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0]);
    build.attribute("TANGENT", tangent);
    assert!(only(&build.model()).extras.is_empty(), "without normals they mean nothing");
    let normal = build.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    build.attribute("NORMAL", normal);
    let model = build.model();
    let tangents: Vec<_> = only(&model).extras.iter().map(|extra| extra.tangent).collect();
    assert_eq!(tangents, [vec4(1.0, 0.0, 0.0, 1.0), vec4(1.0, 0.0, 0.0, -1.0), Vec4::ZERO]);
}

#[test]
fn colours_of_each_type() {
    for (kind, code, most, alpha) in [
        ("VEC3", 5121, 255.0, 1.0),
        ("VEC3", 5123, 65535.0, 1.0),
        ("VEC3", 5126, 1.0, 1.0),
        ("VEC4", 5121, 255.0, 0.0),
        ("VEC4", 5123, 65535.0, 0.0),
        ("VEC4", 5126, 1.0, 0.0),
    ] {
        let mut build = Build::triangle();
        let one = if kind == "VEC3" { vec![most, 0.0, most] } else { vec![most, 0.0, most, 0.0] };
        // Some programs forget to say that they are normalized.
        let colour = build.typed(kind, code, &one.repeat(3), false);
        build.attribute("COLOR_0", colour);
        assert_eq!(only(&build.model()).extras[2].colour, vec4(1.0, 0.0, 1.0, alpha), "{kind} {code}");
    }
    let mut build = Build::triangle();
    let colour = build.floats("VEC3", &[2.0, -1.0, 0.5].repeat(3));
    build.attribute("COLOR_0", colour);
    assert_eq!(only(&build.model()).extras[0].colour, vec4(1.0, 0.0, 0.5, 1.0));
}

#[test]
fn skins_stand_as_their_joints_do() {
    let mut build = Build::triangle();
    let joints = build.typed("VEC4", 5121, &[0.0, 1.0, 0.0, 0.0].repeat(3), false);
    let weights = build.typed("VEC4", 5121, &[255.0, 0.0, 0.0, 0.0, 0.0, 255.0, 0.0, 0.0, 51.0, 204.0, 0.0, 0.0], true);
    build.attribute("JOINTS_0", joints);
    build.attribute("WEIGHTS_0", weights);
    let identity = |x: f64| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
    let bind = build.floats("MAT4", &[identity(0.0), identity(-1.0)].concat());
    build.node(json!({"translation": [0, 0, 10]}));
    build.node(json!({"translation": [1, 0, 0], "scale": [2, 2, 2]}));
    build.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": bind}]);
    let build = build.with("/nodes/0", "skin", json!(0)).with("/nodes/0", "translation", json!([100, 0, 0]));
    let (model, warning) = build.warned();
    assert_eq!(warning, "a.glb: animations are not played; skinned meshes stand as their nodes do");
    let positions: Vec<_> = only(&model).corners.iter().map(|corner| corner.position).collect();
    let expected = [vec3(0.0, 0.0, 10.0), vec3(1.0, 0.0, 0.0), vec3(-0.8, 1.8, 2.0)];
    assert!(positions.iter().zip(expected).all(|(a, b)| (a - b).length() < 1e-5), "{positions:?}");
    assert_eq!(model.placements[0].model_from_local, glam::Mat4::IDENTITY);
    let build = build.with("/skins/0", "joints", json!([1]));
    assert!(build.load().0.unwrap_err().to_string().contains("joint that its skin has not"));
}

#[test]
fn morph_targets_have_weights_of_node_or_mesh() {
    let mut build = Build::triangle();
    let up = build.floats("VEC3", &[0.0, 0.0, 4.0].repeat(3));
    build.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up}, {"POSITION": 99}]);
    build.json["meshes"][0]["weights"] = json!([0.25, 0.0]);
    assert_eq!(positions(&build)[0], Vec3::Z);
    let build = build.with("/nodes/0", "weights", json!([0.5, 0.0]));
    assert_eq!(positions(&build)[0], Vec3::Z * 2.0);
}

#[test]
fn positions_that_are_no_places_and_missing_elements() {
    for (value, why) in [(f64::NAN, "not a number"), (1e10, "beyond 1e9")] {
        let mut build = Build::new();
        let position = build.floats("VEC3", &[value; 9]);
        build.mesh(json!({"attributes": {"POSITION": position}}));
        assert!(build.problem().contains(why));
    }
    let mut build = Build::triangle();
    let normal = build.floats("VEC3", &[0.0; 6]);
    build.attribute("NORMAL", normal);
    assert!(build.problem().contains("it has 3 positions, and 2 of NORMAL"), "{}", build.problem());
    let empty = Build::new();
    assert!(problem(empty.glb()).contains("it has no triangles"));
}
