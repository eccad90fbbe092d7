//! Tests of nodes, of the copies that they make, of cameras and of lights.

use std::f32::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use glam::{Mat4, Quat, Vec3, vec3};
use serde_json::{Value, json};

use super::build_tests::{Build, only};
use crate::asset::mesh::Submesh;
use crate::asset::model::{Cone, Model, ModelLight};

fn close(a: Vec3, b: Vec3) -> bool {
    (a - b).length() < 1e-5
}

/// A tetrahedron with the normals of its faces and tangents along their first edges.
fn solid() -> Build {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let (mut positions, mut normals, mut tangents) = (Vec::new(), Vec::new(), Vec::new());
    for [a, b, c] in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|face| face.map(|i: usize| corners[i])) {
        let normal = (b - a).cross(c - a).normalize();
        for corner in [a, b, c] {
            positions.extend(corner.to_array().map(f64::from));
            normals.extend(normal.to_array().map(f64::from));
            tangents.extend((b - a).normalize().extend(-1.0).to_array().map(f64::from));
        }
    }
    let mut build = Build::new();
    let position = build.floats("VEC3", &positions);
    let (normal, tangent) = (build.floats("VEC3", &normals), build.floats("VEC4", &tangents));
    build.mesh(json!({"attributes": {"POSITION": position, "NORMAL": normal, "TANGENT": tangent}}));
    build
}

/// That triangles turn about their normals, outwards, and tangents run along first edges with bitangents of this sign.
fn assert_whole(submesh: &Submesh, sign: f32) {
    let middle: Vec3 =
        submesh.corners.iter().map(|corner| corner.position).sum::<Vec3>() / submesh.corners.len() as f32;
    for (corners, extras) in submesh.corners.chunks(3).zip(submesh.extras.chunks(3)) {
        let [a, b, c] = [0, 1, 2].map(|i| corners[i].position);
        let face = (b - a).cross(c - a).normalize();
        assert!(face.dot(a - middle) > 0.0, "it turns inwards");
        for (corner, extra) in corners.iter().zip(extras) {
            assert!(close(corner.normal, face), "{} {face}", corner.normal);
            let tangent = extra.tangent.truncate();
            assert!(tangent.is_normalized() && tangent.dot(face).abs() < 1e-5 && extra.tangent.w == sign);
        }
    }
}

#[test]
fn transforms_of_nodes_are_multiplied() {
    let mut build = Build::triangle();
    build.json["nodes"] = json!([
        {"mesh": 0, "translation": [0, 0, 1]},
        {"children": [0], "rotation": [0, FRAC_1_SQRT_2, 0, FRAC_1_SQRT_2], "scale": [2, 2, 2]},
        {"children": [1], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]},
    ]);
    build.json["scenes"][0]["nodes"] = json!([2]);
    let model = build.model();
    let expected = Mat4::from_scale_rotation_translation(
        Vec3::splat(2.0),
        Quat::from_rotation_y(FRAC_PI_2),
        vec3(5.0 + 2.0, 6.0, 7.0),
    );
    assert!(model.placements[0].model_from_local.abs_diff_eq(expected, 1e-5), "{:?}", model.placements);
    assert_eq!(only(&model).name, "mesh 0");
}

/// `KHR_node_visibility`: with all that is below a node.
#[test]
fn hidden_nodes_are_not_shown() {
    let shown = |first: Value, second: Value| {
        let mut build = Build::triangle();
        build.json["nodes"] = json!([
            {"mesh": 0, "children": [1], "extensions": {"KHR_node_visibility": first}},
            {"mesh": 0, "extensions": {"KHR_node_visibility": second}},
            {"mesh": 0},
        ]);
        build.json["scenes"][0]["nodes"] = json!([0, 2]);
        build.json["extensionsRequired"] = json!(["KHR_node_visibility"]);
        build.model().placements.len()
    };
    let (hidden, visible) = (json!({"visible": false}), json!({"visible": true}));
    assert_eq!(shown(json!({}), visible.clone()), 3);
    assert_eq!(shown(json!({}), hidden.clone()), 2);
    assert_eq!(shown(hidden, visible), 1);
}

#[test]
fn meshes_are_shared_and_scenes_chosen() {
    let mut build = Build::triangle();
    build.node(json!({"mesh": 0, "translation": [1, 0, 0], "name": "second"}));
    build.json["meshes"][0]["name"] = json!("Tür");
    let model = build.model();
    assert_eq!((model.placements.len(), only(&model).name.as_str()), (2, "Tür"));
    let mut build = build.with("", "scenes", json!([{}, {"nodes": [1]}]));
    assert!(build.problem().contains("its scene shows no mesh"));
    build.json["scene"] = json!(1);
    assert_eq!(build.model().placements[0].model_from_local.w_axis.x, 1.0);
    build.json["scene"] = json!(2);
    assert!(build.problem().contains("there is no scene 2"));
    build.json.as_object_mut().unwrap().remove("scene");
    build.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(build.model().placements.len(), 2, "without scenes, all are shown");
}

#[test]
fn mirrored_and_uneven_nodes_get_copies() {
    assert_whole(only(&solid().model()), -1.0);
    let skewed = json!([1, 0, 0, 0, 0.7, 1, 0, 0, 0, 0, 3, 0, 4, 5, 6, 1]);
    for (key, value, sign) in [
        ("scale", json!([-1, 1, 1]), 1.0),
        ("scale", json!([-2, -2, -2]), 1.0),
        ("scale", json!([1, 5, 0.2]), -1.0),
        ("scale", json!([-1, 5, -0.2]), -1.0),
        ("matrix", skewed, -1.0),
    ] {
        let model = solid().with("/nodes/0", key, value.clone()).model();
        assert_whole(only(&model), sign);
        let at = model.placements[0].model_from_local;
        let translation = if key == "matrix" { vec3(4.0, 5.0, 6.0) } else { Vec3::ZERO };
        assert_eq!(at, Mat4::from_translation(translation), "{value}");
    }
}

#[test]
fn copies_are_shared_and_vanishing_nodes_left_out() {
    let mut build = solid();
    for x in [1, 2] {
        build.node(json!({"mesh": 0, "scale": [-1, 1, 1], "translation": [x, 0, 0]}));
    }
    build.node(json!({"mesh": 0, "scale": [0, 0, 0]}));
    build.node(json!({"mesh": 0, "scale": [0, 1, 0]}));
    let model = build.model();
    let placed: Vec<_> = model.placements.iter().map(|placed| placed.submesh).collect();
    assert_eq!((model.submeshes.len(), placed), (2, vec![0, 1, 1]));
    // Pressed flat, something can be seen of it; everything is finite.
    let model = solid().with("/nodes/0", "scale", json!([1, 1, 0])).model();
    assert!(only(&model).corners.iter().all(|c| c.normal.is_normalized() && c.position.z == 0.0));
    let nothing = solid().with("/nodes/0", "scale", json!([0, 0, 0]));
    assert!(nothing.problem().contains("scales all of its meshes to nothing"));
}

#[test]
fn instances() {
    let instanced = |attributes: Value| {
        let extensions = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
        solid().with("/nodes/0", "translation", json!([10, 0, 0])).with("/nodes/0", "extensions", extensions)
    };
    let mut build = instanced(Value::Null);
    let translation = build.floats("VEC3", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    // A quarter turn about y, and none: normalized bytes, as compressed files have them.
    let rotation = build.typed("VEC4", 5120, &[0.0, 90.0, 0.0, 90.0, 0.0, 0.0, 0.0, 127.0], true);
    let scale = build.floats("VEC3", &[2.0, 2.0, 2.0, 1.0, 1.0, 3.0]);
    let attributes = json!({"TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale, "_ID": 99});
    build.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = attributes;
    let model = build.model();
    let at = |number: usize| model.placements[number].model_from_local;
    let turned =
        Mat4::from_scale_rotation_translation(Vec3::splat(2.0), Quat::from_rotation_y(FRAC_PI_2), vec3(11.0, 2.0, 3.0));
    assert!(at(0).abs_diff_eq(turned, 1e-5), "{}", at(0));
    // The second is scaled unevenly, in a copy.
    assert_eq!((model.placements.len(), at(1)), (2, Mat4::from_translation(vec3(14.0, 5.0, 6.0))));
    let deepest =
        model.submeshes[model.placements[1].submesh].corners.iter().map(|corner| corner.position.z).fold(0.0, f32::max);
    assert_eq!(deepest, 3.0);

    let key = "node 0: EXT_mesh_gpu_instancing: ";
    assert!(instanced(json!({})).problem().contains(&format!("{key}it says of no instance where it is")));
    build.json["accessors"][scale]["count"] = json!(1);
    assert!(build.problem().contains(&format!("{key}its attributes are not of equally many instances")));
    let mut many = instanced(Value::Null);
    let zeros = many.accessor(json!({"componentType": 5126, "count": 100_000_000, "type": "VEC3"}));
    many.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json!({"TRANSLATION": zeros});
    assert!(many.problem().contains("node 0: 100000000 instances"), "{}", many.problem());
    let mut far = instanced(Value::Null);
    let translation = far.floats("VEC3", &[0.0, 1e30, 0.0]);
    far.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json!({"TRANSLATION": translation});
    assert!(far.problem().contains("node 0 is scaled or moved beyond"), "{}", far.problem());
}

#[test]
fn trees_that_are_none() {
    let with_nodes = |nodes: Value, shown: Value| {
        let mut build = Build::triangle();
        build.json["nodes"] = nodes;
        build.json["scenes"][0]["nodes"] = shown;
        build.problem()
    };
    for (nodes, shown, why) in [
        (json!([{"children": [0], "name": "loop"}]), json!([0]), "node 0 (loop) is its own ancestor"),
        (json!([{"children": [1]}, {"children": [0]}]), json!([0]), "node 0 is its own ancestor"),
        (json!([{"children": [2]}, {"children": [2]}, {}]), json!([0, 1]), "node 2 has two parents"),
        (json!([{"children": [1, 1]}, {}]), json!([0]), "node 1 has two parents"),
        (json!([{"children": [1]}, {}]), json!([0, 1]), "its scene shows node 1 twice"),
        (json!([{"children": [9]}]), json!([0]), "node 0 has a child 9, which does not exist"),
        (json!([{}]), json!([9]), "its scene has a node 9, which does not exist"),
        (json!([{"mesh": 9}]), json!([0]), "node 0: there is no mesh 9"),
        (json!([{"mesh": 0, "scale": [1e300, 1, 1]}]), json!([0]), "node 0 is scaled or moved beyond 1e9"),
    ] {
        let problem = with_nodes(nodes, shown);
        assert!(problem.contains(why), "{problem}");
    }
    // Deeper than a thread's stack.
    let nodes: Vec<_> = (1..100_000).map(|child| json!({"children": [child]})).chain([json!({"mesh": 0})]).collect();
    let mut build = Build::triangle();
    build.json["nodes"] = json!(nodes);
    assert_eq!(build.model().placements.len(), 1);
}

#[test]
fn models_far_away_are_moved() {
    let mut build = Build::triangle();
    build.json["nodes"][0]["translation"] = json!([1e6, 0, -2e5]);
    build.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    build.node(json!({"camera": 0, "translation": [1e6, 0, -199_990.0]}));
    let (model, warning) = build.warned();
    assert_eq!(warning, "a.glb: far from the origin for its size; moved by -1000001 -1 200000");
    assert!(close(model.placements[0].model_from_local.w_axis.truncate(), vec3(-1.0, -1.0, 0.0)));
    assert!(close(model.cameras[0].model_from_camera.w_axis.truncate(), vec3(-1.0, -1.0, 10.0)));
}

#[test]
fn cameras_lose_their_scale() {
    let mut build = Build::triangle();
    build.json["cameras"] = json!([
        {"name": "lens", "type": "perspective", "perspective": {"yfov": FRAC_PI_2, "znear": 0.1}},
        {"type": "perspective", "perspective": {"yfov": 4, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 1}},
    ]);
    build.node(json!({"camera": 0, "scale": [3, -3, 3], "translation": [0, 0, 9]}));
    build.node(json!({"camera": 0, "name": "lens"}));
    build.node(json!({"camera": 1, "name": "wide"}));
    build.node(json!({"camera": 2, "name": "map"}));
    let (model, warnings) = build.load();
    let model = model.unwrap();
    let names: Vec<_> = model.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["lens", "lens 1"]);
    let camera = &model.cameras[0];
    assert!((camera.vertical_fov_degrees - 90.0).abs() < 1e-4);
    assert!((camera.model_from_camera.determinant() - 1.0).abs() < 1e-5);
    assert!(close(camera.model_from_camera.transform_vector3(Vec3::NEG_Z), Vec3::NEG_Z));
    assert!(warnings.iter().any(|w| w == "a.glb: node 3 (wide): its camera sees nothing; left out"), "{warnings:?}");
    assert!(warnings.iter().any(|w| w.contains("node 4 (map): cameras without perspective are not supported")));
}

fn lit(lights: Value, node: Value) -> Model {
    let mut build = Build::triangle();
    build.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    let at = build.node(node);
    build.json["nodes"][at]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    build.model()
}

#[test]
fn lights_of_each_kind() {
    let node = json!({"translation": [1, 2, 3], "rotation": [FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2], "scale": [2, 2, 2]});
    let model = lit(json!([{"type": "point", "color": [1, 0.5, 0], "intensity": 10, "range": 3}]), node.clone());
    let position = vec3(1.0, 2.0, 3.0);
    assert_eq!(model.lights, [ModelLight::Point { position, intensity: vec3(10.0, 5.0, 0.0), cone: None }]);
    let spot = json!([{"type": "spot", "spot": {"innerConeAngle": 0.5, "outerConeAngle": 9}}]);
    let [ModelLight::Point { cone: Some(Cone { along, inner, outer }), intensity, .. }] =
        lit(spot, node.clone()).lights[..]
    else {
        panic!("no spot")
    };
    // A quarter turn about x takes −z to y.
    assert!(close(along, Vec3::Y) && inner == 0.5 && outer == FRAC_PI_2 && intensity == Vec3::ONE, "{along}");
    let spot = json!([{"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}}]);
    let [ModelLight::Point { cone: Some(cone), .. }] = lit(spot, json!({})).lights[..] else { panic!("no spot") };
    assert!(cone.inner < cone.outer && cone.outer == 0.5 && close(cone.along, Vec3::NEG_Z));
    let [ModelLight::Directional { towards, irradiance }] =
        lit(json!([{"type": "directional", "intensity": 3}]), node).lights[..]
    else {
        panic!("no sun")
    };
    assert!(close(towards, Vec3::NEG_Y) && irradiance == Vec3::splat(3.0));
}

#[test]
fn lights_that_are_none() {
    let mut build = Build::triangle();
    build.json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "area"}, {"type": "point", "intensity": -1}]}});
    for (light, node) in [(0, json!({"name": "a"})), (1, json!({}))] {
        let at = build.node(node);
        build.json["nodes"][at]["extensions"] = json!({"KHR_lights_punctual": {"light": light}});
    }
    let (model, warnings) = build.load();
    assert!(model.unwrap().lights.is_empty());
    assert_eq!(warnings[0], "a.glb: node 1 (a): its light shines nowhere; left out");
    build.json["nodes"][1]["extensions"] = json!({"KHR_lights_punctual": {"light": 5}});
    assert!(build.problem().contains("node 1 (a): there is no light 5"));
    build.json["nodes"][1]["extensions"] = json!({"KHR_lights_punctual": {"light": "x"}});
    assert!(build.problem().contains("node 1 (a): KHR_lights_punctual: invalid type"));
}
