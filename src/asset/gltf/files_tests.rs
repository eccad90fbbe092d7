//! Tests of files: forms, buffers, names, extensions, and what hostile ones do.

use serde_json::json;

use super::build_tests::{Build, glb, load, load_at, only, problem};

#[test]
fn both_forms_with_and_without_marks() {
    let build = Build::triangle();
    assert_eq!(only(&build.model()).corners.len(), 3);
    for mark in ["", "\u{feff}"] {
        let (model, warnings) = load(format!("{mark}{}", build.gltf()));
        assert_eq!((only(&model.unwrap()).corners.len(), warnings.len()), (3, 0));
    }
}

#[test]
fn buffers_are_files_of_any_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("models")).unwrap();
    let path = folder.path().join("models/a.gltf");
    let mut build = Build::triangle();
    std::fs::write(folder.path().join("models/Größe 1.bin"), &build.bytes).unwrap();
    std::fs::write(folder.path().join("up.bin"), &build.bytes).unwrap();
    let mut loaded = |uri: &str| {
        build.json["buffers"][0]["uri"] = json!(uri);
        std::fs::write(&path, build.json.to_string()).unwrap();
        let (model, warnings) = load_at(&path);
        (model.map(|model| only(&model).corners.len()).map_err(|error| error.to_string()), warnings)
    };
    for uri in ["Gr%C3%B6%C3%9Fe%201.bin", "Größe 1.bin", "../up.bin", "%2E%2E/up.bin", ".\\Größe 1.bin"] {
        assert_eq!(loaded(uri), (Ok(3), vec![]), "{uri}");
    }
    if cfg!(not(windows)) {
        assert_eq!(loaded("größe 1.BIN").1, ["a.gltf: größe 1.BIN: found as Größe 1.bin"]);
    }
    for (uri, why) in [
        ("no.bin", "buffer 0: there is no file no.bin; put that file beside the model"),
        ("https://a.b/c.bin", "buffer 0 is https://a.b/c.bin, not a file; put it beside the model as a file"),
        ("", "there is no file"),
        ("data:;base64,A", "its data URI is not base64"),
        ("data:nothing", "its data URI has no comma"),
    ] {
        let error = loaded(uri).0.unwrap_err();
        assert!(error.contains(why), "{error}");
    }
}

#[test]
fn extensions_that_are_needed() {
    let needs = |name: &str| Build::triangle().with("", "extensionsRequired", json!([name]));
    for name in ["KHR_mesh_quantization", "KHR_texture_transform", "KHR_materials_clearcoat", "EXT_meshopt_compression"]
    {
        needs(name).model();
    }
    for (name, remedy) in [
        ("MSFT_texture_dds", "export it again with PNG, JPEG, WebP or KTX2 textures"),
        ("OTHER_thing", "export it again without it"),
    ] {
        let problem = needs(name).problem();
        let expected = format!("it needs the extension {name}, which is not supported; {remedy}");
        assert!(problem.ends_with(&expected), "{problem}");
    }
    let used = Build::triangle().with("", "extensionsUsed", json!(["KHR_materials_ior", "OTHER_thing", "OTHER_thing"]));
    assert_eq!(used.warned().1, "a.glb: the extension OTHER_thing is not supported; drawn without");
    let animated = Build::triangle().with("", "animations", json!([{"channels": [], "samplers": []}]));
    assert_eq!(animated.warned().1, "a.glb: animations are not played");
}

#[test]
fn compressed_views() {
    let mut build = Build::triangle();
    let vertices = [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 5.0, 5.0]];
    let packed = ::meshopt::encode_vertex_buffer(&vertices).unwrap();
    let indices = ::meshopt::encode_index_buffer(&[0, 1, 2], 4).unwrap();
    let mut pack = |bytes: &[u8], mode: &str, stride: usize, count: usize| {
        let view = build.view(bytes);
        let own = build.json["bufferViews"][view].clone();
        build.json["bufferViews"][view] = json!({
            "buffer": 1, "byteLength": stride * count, "extensions": {"EXT_meshopt_compression": {
                "buffer": 0, "byteOffset": own["byteOffset"], "byteLength": own["byteLength"],
                "byteStride": stride, "count": count, "mode": mode,
            }},
        });
        view
    };
    let (positions, triangles) = (pack(&packed, "ATTRIBUTES", 12, 4), pack(&indices, "TRIANGLES", 2, 3));
    build.json["accessors"][0] = json!({"bufferView": positions, "componentType": 5126, "count": 4, "type": "VEC3"});
    let index = build.accessor(json!({"bufferView": triangles, "componentType": 5123, "count": 3, "type": "SCALAR"}));
    let mut build = build.with("/meshes/0/primitives/0", "indices", json!(index));
    let got: Vec<_> = only(&build.model()).corners.iter().map(|corner| corner.position.to_array()).collect();
    assert!(vertices[..3].iter().all(|vertex| got.contains(vertex)), "{got:?}");
    let view = format!("/bufferViews/{positions}/extensions/EXT_meshopt_compression");
    for (key, value) in [
        ("count", json!(1u64 << 62)),
        ("byteStride", json!(3)),
        ("mode", json!("X")),
        ("filter", json!("Y")),
        ("byteLength", json!(5)),
    ] {
        let mut broken = build.json.clone();
        broken.pointer_mut(&view).unwrap()[key] = value;
        std::mem::swap(&mut build.json, &mut broken);
        assert!(build.problem().contains(&format!("buffer view {positions}: its ")), "{key}: {}", build.problem());
        std::mem::swap(&mut build.json, &mut broken);
    }
}

#[test]
fn accessors_that_go_too_far() {
    let huge = u64::MAX;
    for (pointer, key, value, why) in [
        ("/accessors/0", "count", json!(4), "accessor 0 needs more bytes than its buffer has for it"),
        ("/accessors/0", "count", json!(huge), "needs more bytes"),
        ("/accessors/0", "count", json!(1u64 << 31), "needs more bytes"),
        ("/accessors/0", "byteOffset", json!(huge), "needs more bytes"),
        ("/accessors/0", "byteOffset", json!(4), "needs more bytes"),
        ("/accessors/0", "bufferView", json!(9), "there is no buffer view 9"),
        ("/accessors/0", "componentType", json!(5124), "accessor 0 has numbers of the unknown type 5124"),
        ("/accessors/0", "type", json!("VEC2"), "accessor 0 is not of the type VEC3, which is needed"),
        ("/bufferViews/0", "byteOffset", json!(huge), "buffer view 0 goes beyond its buffer"),
        ("/bufferViews/0", "byteOffset", json!(1u64 << 40), "needs more bytes"),
        ("/bufferViews/0", "byteLength", json!(20), "needs more bytes"),
        ("/bufferViews/0", "byteStride", json!(huge), "needs more bytes"),
        ("/bufferViews/0", "byteStride", json!(0), "its elements overlap"),
        ("/bufferViews/0", "buffer", json!(1), "there is no buffer 1"),
        ("/meshes/0/primitives/0/attributes", "POSITION", json!(9), "there is no accessor 9"),
    ] {
        let problem = Build::triangle().with(pointer, key, value).problem();
        assert!(problem.contains(why), "{problem}");
    }
    // A view may claim more than there is, as long as nobody needs it.
    Build::triangle().with("/bufferViews/0", "byteLength", json!(1u64 << 40)).model();
    let mut zeros = Build::triangle();
    for count in [1u64 << 26, 1 << 31, huge] {
        zeros.json["accessors"][0] = json!({"componentType": 5126, "count": count, "type": "VEC3"});
        assert!(zeros.problem().contains("too large"), "{count}");
    }
}

#[test]
fn files_that_are_cut_off_or_lie() {
    let whole = Build::triangle().glb();
    for length in 0..whole.len() {
        assert!(load(&whole[..length]).0.is_err(), "{length}");
    }
    let changed = |at: usize, value: u32| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        problem(bytes)
    };
    assert!(changed(4, 1).contains("binary glTF of version 1"));
    assert!(changed(8, 0).contains("no part of JSON") && changed(8, u32::MAX).contains("cut off"));
    assert!(changed(12, u32::MAX).contains("goes beyond its end"));
    assert!(changed(16, 0).contains("no part of JSON"));
    assert!(problem(glb(&whole[20..20], None)).contains("EOF"));
    let json = Build::triangle().json.to_string();
    assert!(problem(glb(json.as_bytes(), None)).contains("buffer 0 has no data"));
    for (text, why) in [
        ("", "EOF"),
        ("[]", "it does not say its version"),
        ("{\"asset\":{\"version\":\"1.0\"}}", "it is of version 1.0, not 2.0; export it again as glTF 2.0"),
        ("{\"asset\":{\"version\":\"2.0\"}}", "it has no triangles"),
        ("\u{feff}{\"asset\":{\"version\":\"2.0\"},\"nodes\":3}", "expected a list"),
    ] {
        assert!(problem(text).contains(why), "{text}: {}", problem(text));
    }
    assert!(problem(b"\xff\xfe{\0}\0").contains("UTF-16"));
}

#[test]
fn bombs() {
    let version = "\"asset\":{\"version\":\"2.0\"}";
    for deep in ["[".repeat(100_000), "{\"a\":".repeat(100_000)] {
        problem(&deep);
        problem(format!("{{{version},\"extensions\":{{\"a\":{deep}"));
        problem(format!("{{{version},\"extras\":{deep}"));
    }
    let many = format!("{{{version},\"nodes\":[{}{{}}]}}", "{},".repeat(1 << 20));
    assert!(problem(many).contains("a list of more than 1048576"));
    // A mesh of many primitives in many places, and a large one in many places.
    let mut build = Build::triangle();
    let primitive = json!({"attributes": {"POSITION": 0}, "mode": 0});
    build.json["meshes"] = json!([{"primitives": vec![primitive; 2000]}]);
    build.json["skins"] = json!([{"joints": [0]}]);
    let nodes: Vec<_> = (0..2000).map(|i| json!({"mesh": 0, "skin": 0, "weights": [i]})).collect();
    let shown: Vec<_> = (0..2000).collect();
    build.json["nodes"] = json!(nodes);
    let build = build.with("/scenes/0", "nodes", json!(shown));
    assert!(build.problem().contains("over 1000000 parts of meshes"));
    let mut large = Build::triangle();
    let index = large.typed("SCALAR", 5121, &[0.0, 1.0, 2.0].repeat(100_000), false);
    let nodes: Vec<_> = (0..600).map(|_| json!({"mesh": 0})).collect();
    large.json["nodes"] = json!(nodes);
    large.json["scenes"][0]["nodes"] = json!((0..600).collect::<Vec<_>>());
    let large = large.with("/meshes/0/primitives/0", "indices", json!(index));
    assert!(large.problem().contains("over 50000000 triangles with all copies"));
}

/// Numbers that look random: xorshift64.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % limit as u64) as usize
    }
}

/// A file that uses most of what there is.
fn rich() -> Build {
    let mut build = Build::triangle();
    for (name, kind, values) in [
        ("NORMAL", "VEC3", [0.0, 0.0, 1.0].repeat(3)),
        ("TANGENT", "VEC4", [1.0, 0.0, 0.0, 1.0].repeat(3)),
        ("TEXCOORD_0", "VEC2", vec![0.5; 6]),
        ("COLOR_0", "VEC4", vec![0.5; 12]),
        ("WEIGHTS_0", "VEC4", [1.0, 0.0, 0.0, 0.0].repeat(3)),
    ] {
        let accessor = build.floats(kind, &values);
        build.attribute(name, accessor);
    }
    let joints = build.typed("VEC4", 5121, &[0.0; 12], false);
    build.attribute("JOINTS_0", joints);
    let index = build.typed("SCALAR", 5123, &[0.0, 1.0, 2.0], false);
    let values = build.view(&[0; 12]);
    build.json["accessors"][index]["sparse"] =
        json!({"count": 1, "indices": {"bufferView": values, "componentType": 5121}, "values": {"bufferView": values}});
    build.json["images"] = json!([{"bufferView": values}, {"uri": "data:,abc"}]);
    build.json["textures"] = json!([{"source": 0}, {"source": 1}]);
    build.json["skins"] = json!([{"joints": [1]}]);
    build.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1}}]);
    build.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot"}]}});
    build.node(json!({"camera": 0, "scale": [1, 2, -1], "children": [2]}));
    build.json["nodes"][1]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    build.json["nodes"].as_array_mut().unwrap().push(json!({"mesh": 0, "weights": [0.5]}));
    build.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0}]);
    build.json["meshes"][0]["primitives"][0]["indices"] = json!(index);
    build.json["nodes"][0]["skin"] = json!(0);
    let transform = json!({"KHR_texture_transform": {"offset": [1, 2]}});
    build.material(json!({
        "normalTexture": {"index": 1, "extensions": transform}, "emissiveTexture": {"index": 0}, "alphaMode": "MASK",
    }))
}

#[test]
fn changed_bytes_are_refused_or_read() {
    let build = rich();
    let (glb, gltf) = (build.glb(), build.gltf().into_bytes());
    assert!(load(&glb).0.is_ok() && load(&gltf).0.is_ok());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut read = 0;
    for round in 0..2000 {
        let mut bytes = if round % 2 == 0 { glb.clone() } else { gltf.clone() };
        for _ in 0..=random.below(3) {
            let at = random.below(bytes.len());
            match random.below(4) {
                0 => bytes[at] ^= 1 << random.below(8),
                1 => bytes[at] = b'0' + random.below(10) as u8,
                2 => drop(bytes.remove(at)),
                _ => bytes.insert(at, b"0123456789-[]{},\"e\0\xff"[random.below(20)]),
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        let (model, _) = load_at(&path);
        let Ok(model) = model else { continue };
        read += 1;
        assert!(
            model
                .submeshes
                .iter()
                .flat_map(|submesh| &submesh.corners)
                .all(|c| c.position.is_finite() && c.normal.is_normalized())
        );
        assert!(model.placements.iter().all(|placed| placed.model_from_local.is_finite()));
    }
    assert!(read > 50, "{read}");
}

/// Tangents of the models that come with the format's tests run to the right in their pictures, bitangents upwards.
#[test]
fn supplied_tangents_are_ours() {
    let scenes = std::env::var_os("PBR_VR_SCENES").map(std::path::PathBuf::from);
    for name in ["NormalTangentTest", "NormalTangentMirrorTest"] {
        let path = scenes.as_ref().map(|folder| folder.join(format!("gltf-targets/{name}/{name}.gltf")));
        let Some(path) = path.filter(|path| path.is_file()) else {
            println!("skipped: PBR_VR_SCENES has no {name}");
            continue;
        };
        let (model, warnings) = load_at(&path);
        let model = model.unwrap();
        assert_eq!(warnings, [""; 0]);
        let (mut right, mut wrong) = (0, 0);
        for submesh in &model.submeshes {
            for (corners, extras) in submesh.corners.chunks(3).zip(submesh.extras.chunks(3)) {
                let [a, b, c] = [0, 1, 2].map(|i| corners[i]);
                let (p, q) = (b.position - a.position, c.position - a.position);
                let (s, t) = (b.uv - a.uv, c.uv - a.uv);
                let area = s.perp_dot(t);
                let up = (q * s.x - p * t.x) * area.signum();
                let (tangent, normal) = (extras[0].tangent, corners[0].normal);
                let bitangent = normal.cross(tangent.truncate()) * tangent.w;
                if bitangent.dot(up) > 0.0 { right += 1 } else { wrong += 1 }
            }
        }
        println!("{name}: {} submeshes, {right} right, {wrong} wrong", model.submeshes.len());
        assert!(right >= 20 * wrong, "{name}: {right} {wrong}");
        assert_eq!(name == "NormalTangentMirrorTest", right > 0, "only this one has tangents");
    }
}
