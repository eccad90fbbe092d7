//! glTF files made by tests: JSON with the accessors of some data.

use std::path::Path;

use serde_json::{Value, json};

use crate::asset::Report;
use crate::asset::mesh::Submesh;
use crate::asset::model::Model;
use crate::{Error, Result};

/// A file to be.
pub struct Build {
    pub json: Value,
    pub bytes: Vec<u8>,
}

/// Numbers as the bytes of a type of component: its code and they.
pub fn numbers(code: u32, values: &[f64]) -> Vec<u8> {
    let bytes = |value: &f64| match code {
        5120 => (*value as i8).to_le_bytes().to_vec(),
        5121 => (*value as u8).to_le_bytes().to_vec(),
        5122 => (*value as i16).to_le_bytes().to_vec(),
        5123 => (*value as u16).to_le_bytes().to_vec(),
        5125 => (*value as u32).to_le_bytes().to_vec(),
        _ => (*value as f32).to_le_bytes().to_vec(),
    };
    values.iter().flat_map(bytes).collect()
}

fn push(list: &mut Value, entry: Value) -> usize {
    let list = list.as_array_mut().unwrap();
    list.push(entry);
    list.len() - 1
}

impl Build {
    /// A file of nothing.
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}], "materials": [],
        });
        Self { json, bytes: Vec::new() }
    }

    /// One triangle in the plane z = 0, towards +z, in a mesh of its own.
    pub fn triangle() -> Self {
        let mut build = Self::new();
        let position = build.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        build.mesh(json!({"attributes": {"POSITION": position}}));
        build
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        self.bytes.extend(bytes);
        push(&mut self.json["bufferViews"], view)
    }

    pub fn accessor(&mut self, accessor: Value) -> usize {
        push(&mut self.json["accessors"], accessor)
    }

    pub fn typed(&mut self, kind: &str, code: u32, values: &[f64], normalized: bool) -> usize {
        let size = ["SCALAR", "", "VEC2", "VEC3", "VEC4"].iter().position(|k| *k == kind).unwrap_or(16).max(1);
        let view = self.view(&numbers(code, values));
        let count = values.len() / size;
        self.accessor(json!({
            "bufferView": view, "componentType": code, "count": count, "type": kind, "normalized": normalized,
        }))
    }

    pub fn floats(&mut self, kind: &str, values: &[f64]) -> usize {
        self.typed(kind, 5126, values, false)
    }

    /// Adds a mesh of one primitive, and a node that shows it. Returns the node.
    pub fn mesh(&mut self, primitive: Value) -> usize {
        let mesh = push(&mut self.json["meshes"], json!({"primitives": [primitive]}));
        self.node(json!({"mesh": mesh}))
    }

    /// Adds a node to the scene.
    pub fn node(&mut self, node: Value) -> usize {
        let node = push(&mut self.json["nodes"], node);
        push(&mut self.json["scenes"][0]["nodes"], json!(node));
        node
    }

    /// The same with something changed; for a path such as `/nodes/0`.
    pub fn with(mut self, pointer: &str, key: &str, value: Value) -> Self {
        self.json.pointer_mut(pointer).unwrap()[key] = value;
        self
    }

    /// An attribute of the first primitive.
    pub fn attribute(&mut self, name: &str, accessor: usize) {
        self.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
    }

    /// Gives the first primitive this material.
    pub fn material(mut self, material: Value) -> Self {
        self.json["materials"] = json!([material]);
        self.with("/meshes/0/primitives/0", "material", json!(0))
    }

    pub fn glb(&self) -> Vec<u8> {
        glb(self.json.to_string().as_bytes(), Some(&self.bytes))
    }

    /// With the bytes as base64.
    pub fn gltf(&self) -> String {
        use base64::Engine as _;
        let mut json = self.json.clone();
        let base64 = base64::engine::general_purpose::STANDARD.encode(&self.bytes);
        json["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{base64}"));
        json.to_string()
    }

    pub fn load(&self) -> (Result<Model>, Vec<String>) {
        load(self.glb())
    }

    /// Without warnings.
    pub fn model(&self) -> Model {
        let (model, warnings) = self.load();
        assert_eq!(warnings, [""; 0]);
        model.unwrap()
    }

    /// The model's only warning.
    pub fn warned(&self) -> (Model, String) {
        let (model, warnings) = self.load();
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        (model.unwrap(), warnings[0].clone())
    }

    pub fn problem(&self) -> String {
        problem(self.glb())
    }
}

pub fn glb(json: &[u8], binary: Option<&[u8]>) -> Vec<u8> {
    let mut chunks = Vec::new();
    for (kind, bytes, fill) in [(b"JSON", Some(json), b' '), (b"BIN\0", binary, 0)] {
        let Some(bytes) = bytes else { continue };
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), fill);
        chunks.extend((bytes.len() as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(bytes);
    }
    let length = 12 + chunks.len() as u32;
    [b"glTF".to_vec(), 2u32.to_le_bytes().to_vec(), length.to_le_bytes().to_vec(), chunks].concat()
}

/// Loads bytes as a file in a folder of its own.
pub fn load(bytes: impl AsRef<[u8]>) -> (Result<Model>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    std::fs::write(&path, bytes).unwrap();
    load_at(&path)
}

pub fn load_at(path: &Path) -> (Result<Model>, Vec<String>) {
    let report = Report::silent();
    (super::load(path, &report), report.warnings())
}

/// Why it is refused.
pub fn problem(bytes: impl AsRef<[u8]>) -> String {
    let error = load(bytes).0.expect_err("it should be refused");
    assert!(matches!(error, Error::Broken { .. } | Error::TooLarge { .. }), "{error}");
    error.to_string()
}

/// The only mesh.
pub fn only(model: &Model) -> &Submesh {
    assert_eq!(model.submeshes.len(), 1);
    &model.submeshes[0]
}
