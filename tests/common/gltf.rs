//! glTF files made by tests: JSON with the numbers and pictures of a few shapes in its only buffer.

use std::io::Cursor;
use std::path::PathBuf;

use base64::Engine as _;
use glam::{DMat3, DMat4, DVec3};
use serde_json::{Value, json};

use super::Workshop;

/// A file to be.
pub struct Gltf {
    pub json: Value,
    bytes: Vec<u8>,
}

/// Triangles with what their vertices have; a list is empty where they have none of it.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub tangents: Vec<[f32; 4]>,
    /// v downwards.
    pub uvs: [Vec<[f32; 2]>; 2],
    pub colours: Vec<[f32; 4]>,
    pub indices: Vec<u32>,
}

impl Shape {
    /// A rectangle at a height of z that faces +Z; its texture coordinates run right and down from 0 to 1.
    pub fn plate([x0, x1]: [f32; 2], [y0, y1]: [f32; 2], z: f32) -> Self {
        Self {
            positions: vec![[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]],
            normals: vec![[0.0, 0.0, 1.0]; 4],
            uvs: [vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], vec![]],
            indices: vec![0, 1, 2, 0, 2, 3],
            ..Self::default()
        }
    }

    /// A box, without texture coordinates.
    pub fn block(low: [f32; 3], high: [f32; 3]) -> Self {
        let mut shape = Self::default();
        for axis in 0..3 {
            for side in [0, 1] {
                let (u, v) =
                    if side == 1 { ((axis + 1) % 3, (axis + 2) % 3) } else { ((axis + 2) % 3, (axis + 1) % 3) };
                let first = shape.positions.len() as u32;
                for (a, b) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                    let mut corner = low;
                    corner[axis] = [low, high][side][axis];
                    corner[u] = [low, high][a][u];
                    corner[v] = [low, high][b][v];
                    shape.positions.push(corner);
                    let mut normal = [0.0; 3];
                    normal[axis] = if side == 1 { 1.0 } else { -1.0 };
                    shape.normals.push(normal);
                }
                shape.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
            }
        }
        shape
    }

    /// A ball around the origin with smooth normals.
    pub fn ball(radius: f32, rows: u32) -> Self {
        let columns = 2 * rows;
        let mut shape = Self::default();
        for row in 0..=rows {
            for column in 0..=columns {
                let (v, u) = (f64::from(row) / f64::from(rows), f64::from(column) / f64::from(columns));
                let (polar, around) = (v * std::f64::consts::PI, u * std::f64::consts::TAU);
                let n = DVec3::new(polar.sin() * around.cos(), polar.cos(), -polar.sin() * around.sin()).as_vec3();
                shape.positions.push((n * radius).into());
                shape.normals.push(n.into());
                shape.uvs[0].push([u as f32, v as f32]);
            }
        }
        for row in 0..rows {
            for column in 1..=columns {
                let a = row * (columns + 1) + column - 1;
                let [b, c, d] = [a + columns + 1, a + columns + 2, a + 1];
                shape.indices.extend([a, b, c, a, c, d]);
            }
        }
        shape
    }

    /// The same with other texture coordinates: `map` of those it has.
    pub fn with_uvs(mut self, set: usize, map: impl Fn([f32; 2]) -> [f32; 2]) -> Self {
        self.uvs[set] = self.uvs[0].iter().map(|uv| map(*uv)).collect();
        self
    }

    pub fn coloured(mut self, colour: impl Fn([f32; 3]) -> [f32; 4]) -> Self {
        self.colours = self.positions.iter().map(|p| colour(*p)).collect();
        self
    }

    /// The triangles where a node puts them; normals by the inverse transpose, in f64.
    pub fn moved(&self, by: DMat4) -> Self {
        let linear = DMat3::from_mat4(by);
        let (cofactors, mirrors) = (linear.inverse().transpose(), linear.determinant() < 0.0);
        let direction = |m: DMat3, v: [f32; 3]| (m * DVec3::from(v.map(f64::from))).normalize().as_vec3();
        let place = |p: &[f32; 3]| by.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().into();
        let tangent =
            |[x, y, z, w]: &[f32; 4]| direction(linear, [*x, *y, *z]).extend(if mirrors { -w } else { *w }).into();
        let mut moved = Self {
            positions: self.positions.iter().map(place).collect(),
            normals: self.normals.iter().map(|n| direction(cofactors, *n).into()).collect(),
            tangents: self.tangents.iter().map(tangent).collect(),
            ..self.clone()
        };
        if mirrors {
            moved.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
        }
        moved
    }
}

impl Gltf {
    /// A file of nothing.
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "materials": [], "textures": [], "images": [], "samplers": [],
            "extensionsUsed": [],
        });
        Self { json, bytes: Vec::new() }
    }

    fn push(&mut self, list: &str, entry: Value) -> usize {
        let list = self.json[list].as_array_mut().expect("a list");
        list.push(entry);
        list.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        self.bytes.extend(bytes);
        self.push("bufferViews", view)
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let view = self.view(bytemuck::cast_slice(values.as_flattened()));
        let bound = |pick: fn(f32, f32) -> f32, from| {
            values.iter().fold([from; N], |all, value| std::array::from_fn(|i| pick(all[i], value[i])))
        };
        let (min, max) = (bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY));
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        self.push(
            "accessors",
            json!({
                "bufferView": view, "componentType": 5126, "count": values.len(), "type": kind,
                "min": min.as_slice(), "max": max.as_slice(),
            }),
        )
    }

    /// A picture with its sampler, as a texture.
    pub fn texture(&mut self, picture: &image::RgbaImage, sampler: Value) -> usize {
        let mut png = Cursor::new(Vec::new());
        picture.write_to(&mut png, image::ImageFormat::Png).expect("a picture");
        let view = self.view(&png.into_inner());
        let source = self.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
        let sampler = self.push("samplers", sampler);
        self.push("textures", json!({"source": source, "sampler": sampler}))
    }

    pub fn material(&mut self, material: Value) -> usize {
        let extensions: Vec<Value> =
            material["extensions"].as_object().into_iter().flat_map(|e| e.keys()).map(|k| json!(k)).collect();
        extensions.into_iter().for_each(|name| self.uses(name));
        self.push("materials", material)
    }

    pub fn uses(&mut self, extension: Value) {
        let list = self.json["extensionsUsed"].as_array_mut().expect("a list");
        if !list.contains(&extension) {
            list.push(extension);
        }
    }

    pub fn mesh(&mut self, shape: &Shape, material: usize) -> usize {
        let mut attributes = json!({"POSITION": self.floats(&shape.positions)});
        for (name, accessor) in [
            ("NORMAL", (!shape.normals.is_empty()).then(|| self.floats(&shape.normals))),
            ("TANGENT", (!shape.tangents.is_empty()).then(|| self.floats(&shape.tangents))),
            ("TEXCOORD_0", (!shape.uvs[0].is_empty()).then(|| self.floats(&shape.uvs[0]))),
            ("TEXCOORD_1", (!shape.uvs[1].is_empty()).then(|| self.floats(&shape.uvs[1]))),
            ("COLOR_0", (!shape.colours.is_empty()).then(|| self.floats(&shape.colours))),
        ] {
            if let Some(accessor) = accessor {
                attributes[name] = json!(accessor);
            }
        }
        let view = self.view(bytemuck::cast_slice(&shape.indices));
        let indices = self.push(
            "accessors",
            json!({"bufferView": view, "componentType": 5125, "count": shape.indices.len(), "type": "SCALAR"}),
        );
        let primitive = json!({"attributes": attributes, "indices": indices, "material": material});
        self.push("meshes", json!({"primitives": [primitive]}))
    }

    /// Adds a node below another one.
    pub fn child(&mut self, node: Value) -> usize {
        self.push("nodes", node)
    }

    /// Adds a node to the scene.
    pub fn node(&mut self, node: Value) -> usize {
        let node = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().expect("a list").push(json!(node));
        node
    }

    /// Adds a shape as it stands.
    pub fn show(&mut self, shape: &Shape, material: usize) {
        let mesh = self.mesh(shape, material);
        self.node(json!({"mesh": mesh}));
    }

    /// Adds a light, `KHR_lights_punctual`, and a node that has it.
    pub fn light(&mut self, light: Value, mut node: Value) {
        let name = "KHR_lights_punctual";
        self.uses(json!(name));
        if self.json["extensions"].is_null() {
            self.json["extensions"] = json!({name: {"lights": []}});
        }
        let lights = self.json["extensions"][name]["lights"].as_array_mut().expect("a list");
        lights.push(light);
        node["extensions"] = json!({name: {"light": lights.len() - 1}});
        self.node(node);
    }

    /// The file's bytes: JSON with the buffer as text in it, or a binary file.
    pub fn bytes(&self, binary: bool) -> Vec<u8> {
        let mut json = self.json.clone();
        // Empty lists are not allowed.
        json.as_object_mut()
            .expect("an object")
            .retain(|_, value| value.as_array().is_none_or(|list| !list.is_empty()));
        json["buffers"] = json!([{"byteLength": self.bytes.len()}]);
        if !binary {
            let base64 = base64::engine::general_purpose::STANDARD.encode(&self.bytes);
            json["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{base64}"));
            return json.to_string().into_bytes();
        }
        let mut chunks = Vec::new();
        for (kind, mut bytes, fill) in
            [(b"JSON", json.to_string().into_bytes(), b' '), (b"BIN\0", self.bytes.clone(), 0)]
        {
            bytes.resize(bytes.len().next_multiple_of(4), fill);
            chunks.extend((bytes.len() as u32).to_le_bytes());
            chunks.extend(kind);
            chunks.extend(bytes);
        }
        let length = 12 + chunks.len() as u32;
        [b"glTF".to_vec(), 2u32.to_le_bytes().to_vec(), length.to_le_bytes().to_vec(), chunks].concat()
    }

    /// Writes the file, `.gltf` or `.glb`.
    pub fn write(&self, shop: &Workshop, name: &str) -> PathBuf {
        let path = shop.path(name);
        std::fs::write(&path, self.bytes(name.ends_with(".glb"))).expect("a test file");
        path
    }
}

/// A file with something of each kind: maps, colours, tangents, mirrored and nested nodes, a light of each type, a camera.
pub fn everything() -> Gltf {
    let mut gltf = Gltf::new();
    let picture =
        image::RgbaImage::from_fn(4, 4, |x, y| image::Rgba([60 * x as u8, 60 * y as u8, 200, 255 - 50 * x as u8]));
    let texture = gltf.texture(&picture, json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}));
    gltf.uses(json!("KHR_texture_transform"));
    let moved = json!({"KHR_texture_transform": {"offset": [0.1, 0.2], "rotation": 0.5, "scale": [2, 3]}});
    let mapped = gltf.material(json!({
        "name": "mapped", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.4,
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.9, 0.8, 1, 0.9], "baseColorTexture": {"index": texture, "extensions": moved},
            "roughnessFactor": 0.8, "metallicRoughnessTexture": {"index": texture, "texCoord": 1},
        },
        "normalTexture": {"index": texture, "scale": 0.5}, "occlusionTexture": {"index": texture, "texCoord": 1, "strength": 0.7},
    }));
    let glass = gltf.material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.3, 0.9, 0.25]}, "alphaMode": "BLEND",
        "emissiveFactor": [0.1, 0.2, 0.3], "emissiveTexture": {"index": texture},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}, "KHR_materials_ior": {"ior": 1.5}},
    }));
    let mut plate = Shape::plate([-0.8, 0.8], [-0.8, 0.8], 0.0).with_uvs(1, |[u, v]| [v, u]);
    plate = plate.coloured(|[x, y, _]| [0.5 + 0.5 * x, 0.5 + 0.5 * y, 1.0, 0.8]);
    plate.tangents = vec![[1.0, 0.0, 0.0, -1.0]; 4];
    let plate = gltf.mesh(&plate, mapped);
    let block = gltf.mesh(&Shape::block([-0.3; 3], [0.3; 3]).coloured(|_| [1.0, 0.5, 0.5, 1.0]), glass);
    let child = gltf.child(json!({"mesh": block, "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [-1, 1, 2]}));
    gltf.node(json!({"mesh": plate, "children": [child], "translation": [0, 0.1, 0.2]}));
    gltf.node(json!({"mesh": block, "matrix": [1, 0, 0, 0, 0.2, 1, 0, 0, 0, 0, 1, 0, -0.5, 0.5, 0.5, 1]}));
    gltf.light(json!({"type": "point", "intensity": 20}), json!({"translation": [0, 1, 2]}));
    gltf.light(
        json!({"type": "spot", "intensity": 20, "spot": {"outerConeAngle": 0.5}}),
        json!({"translation": [1, 1, 2]}),
    );
    gltf.light(json!({"type": "directional", "color": [1, 0.9, 0.8]}), json!({"rotation": [0.6, 0, 0, 0.8]}));
    gltf.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.01}}]);
    gltf.node(json!({"camera": 0, "translation": [0, 0, 4]}));
    gltf
}
