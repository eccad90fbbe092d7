//! Triangles gathered surface by surface, and written as OBJ and MTL text.

use std::collections::HashMap;
use std::fmt::Write;

use glam::{DAffine3, DVec2, DVec3};

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Metres.
    pub position: DVec3,
    /// Outward; need not have unit length.
    pub normal: DVec3,
    /// v upwards, as OBJ counts it.
    pub uv: DVec2,
}

impl Point {
    /// The same point of a surface that was moved, turned or uniformly scaled.
    pub fn transformed(self, world_from_local: DAffine3) -> Self {
        Self {
            position: world_from_local.transform_point3(self.position),
            normal: world_from_local.transform_vector3(self.normal),
            uv: self.uv,
        }
    }
}

/// Lines of one kind (`v`, `vt`, `vn`), each written once.
#[derive(Default)]
struct Lines {
    numbers: HashMap<String, usize>,
    text: String,
}

impl Lines {
    /// The line's number, counted from 1.
    fn number(&mut self, line: String) -> usize {
        let next = self.numbers.len() + 1;
        let text = &mut self.text;
        *self.numbers.entry(line).or_insert_with_key(|line| {
            text.push_str(line);
            next
        })
    }
}

/// A model under construction.
#[derive(Default)]
pub struct Obj {
    positions: Lines,
    uvs: Lines,
    normals: Lines,
    faces: String,
}

impl Obj {
    /// Starts an object; what follows belongs to it.
    pub fn object(&mut self, name: &str, material: &str) {
        self.faces.push_str(&format!("o {name}\nusemtl {material}\n"));
    }

    /// Adds one triangle, unless two of its corners fall together.
    pub fn triangle(&mut self, corners: [Point; 3]) {
        let numbers = corners.map(|corner| {
            let (p, t, n) = (corner.position, corner.uv, corner.normal.normalize_or_zero());
            [
                self.positions.number(format!("v {} {} {}\n", decimal(p.x, 5), decimal(p.y, 5), decimal(p.z, 5))),
                self.uvs.number(format!("vt {} {}\n", decimal(t.x, 5), decimal(t.y, 5))),
                self.normals.number(format!("vn {} {} {}\n", decimal(n.x, 4), decimal(n.y, 4), decimal(n.z, 4))),
            ]
        });
        let [a, b, c] = numbers;
        if a[0] == b[0] || b[0] == c[0] || c[0] == a[0] {
            return;
        }
        self.faces.push('f');
        for [p, t, n] in numbers {
            self.faces.push_str(&format!(" {p}/{t}/{n}"));
        }
        self.faces.push('\n');
    }

    /// Adds a surface over (0..1)², cut into `columns` × `rows`; seen from outside, u runs right and v up.
    pub fn surface(&mut self, columns: usize, rows: usize, point: impl Fn(f64, f64) -> Point) {
        let at = |i: usize, j: usize| point(i as f64 / columns as f64, j as f64 / rows as f64);
        for j in 0..rows {
            for i in 0..columns {
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                self.triangle([a, b, c]);
                self.triangle([a, c, d]);
            }
        }
    }

    /// The OBJ file.
    pub fn text(&self, library: &str) -> String {
        let made =
            "# Made by tools/make_assets (cargo run --release --example make-assets); MIT OR Apache-2.0 OR CC0-1.0.";
        let mut text = format!("{made}\n# Metres, +Y up, counter-clockwise from outside.\nmtllib {library}\n");
        for part in [&self.positions.text, &self.uvs.text, &self.normals.text, &self.faces] {
            text.push_str(part);
        }
        text
    }
}

/// A metallic–roughness material, as MTL writes it.
pub struct Material {
    pub name: &'static str,
    /// Linear RGB, multiplies the albedo map.
    pub albedo: [f64; 3],
    pub metallic: f64,
    pub roughness: f64,
    /// Folder under `textures/` that holds the five maps.
    pub maps: Option<&'static str>,
}

/// The MTL file of some materials.
pub fn library(materials: &[Material]) -> String {
    let mut text = String::from("# Made by tools/make_assets; maps and factors of physically based materials.\n");
    for m in materials {
        let [r, g, b] = m.albedo.map(|x| decimal(x, 3));
        let factors = format!("Kd {r} {g} {b}\nPm {}\nPr {}\n", decimal(m.metallic, 3), decimal(m.roughness, 3));
        // Writing to a string cannot fail.
        let _ = write!(text, "\nnewmtl {}\n{factors}", m.name);
        if let Some(set) = m.maps {
            let maps = [
                ("map_Kd", "albedo"),
                ("norm", "normal"),
                ("map_Pm", "metallic"),
                ("map_Pr", "roughness"),
                ("map_ao", "ao"),
            ];
            for (key, file) in maps {
                text.push_str(&format!("{key} ../textures/{set}/{file}.jpg\n"));
            }
        }
    }
    text
}

/// A number with at most `places` decimals, never `-0`.
fn decimal(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}
