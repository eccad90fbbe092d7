//! OBJ models: preprocesses the text for `tobj`, then checks positions and completes normals.
//!
//! The text is preprocessed because `tobj` reads lines like `l 1 2 3` as triangles, overflows on relative indices
//! before the start of the file, and shifts the coordinates of meshes where only some corners have them.

use std::io::Cursor;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::mesh::{Corner, Submesh};
use super::mtl::{self, Mtl};
use super::{Report, file, normals};
use crate::error::{MAX_QUOTED, shortened};
use crate::{Error, Result};

const MAX_FILE_BYTES: u64 = 1 << 30;
/// 1.5 GB of corners. The thesis's largest scene has 262,267.
const MAX_TRIANGLES: usize = 16 << 20;
/// Beyond this, or below its inverse, products of lengths leave the range of f32.
pub const MAX_COORDINATE: f32 = 1e9;
/// Beyond this, f32 cannot resolve texels.
const MAX_UV: f32 = 1e6;

/// The triangles and materials of one file.
#[derive(Clone, Debug)]
pub struct Model {
    pub submeshes: Vec<Submesh>,
    pub materials: Vec<Mtl>,
}

/// Reads a model and the material libraries it names.
///
/// Polygons become fans. Missing, zero or non-finite normals are computed from the adjacent triangles. A missing
/// library or material is a warning.
///
/// # Errors
/// The file cannot be read or is too large; a line cannot be parsed; an index is out of range; a position is not
/// finite; there are no triangles.
pub fn load(path: &Path, report: &Report) -> Result<Model> {
    let bytes = file::read(path, "model", MAX_FILE_BYTES)?;
    if file::is_utf16(&bytes) {
        let (problem, remedy) = ("it is UTF-16 text".into(), "save it again as UTF-8");
        return Err(Error::Broken { path: path.into(), what: "OBJ model", problem, remedy });
    }
    let source = ObjText::new(path, &bytes)?;
    drop(bytes);
    let materials = load_libraries(path, &source, report);
    let models = run_tobj(path, &source.text, &materials)?;
    warn_of_unknown_materials(path, &source, &materials, report);
    let mut submeshes = Vec::new();
    for model in models.into_iter().filter(|model| !model.mesh.indices.is_empty()) {
        submeshes.push(submesh(path, &source, model, report)?);
    }
    if submeshes.is_empty() {
        return Err(broken(path, "it has no triangles".into()));
    }
    normals::complete(&mut submeshes);
    Ok(Model { submeshes, materials })
}

/// The lines of a file that `tobj` needs, after one additional line: the others are empty, so that line numbers stay.
struct ObjText {
    text: String,
    /// Line and file name of each `mtllib`.
    libraries: Vec<(usize, String)>,
    /// Line and name of each `usemtl`.
    uses: Vec<(usize, String)>,
}

impl ObjText {
    fn new(path: &Path, bytes: &[u8]) -> Result<Self> {
        // `tobj` gets all materials with this line, so that libraries may be named anywhere.
        let mut source = Self { text: "mtllib all\n".into(), libraries: Vec::new(), uses: Vec::new() };
        source.text.reserve(bytes.len());
        let mut counts = Counts::default();
        let mut joined = String::new();
        let mut last = 0;
        for (index, line) in file::lines(bytes).enumerate() {
            let line = line.trim();
            last = index + 1;
            if let Some(start) = line.strip_suffix('\\') {
                joined.push_str(start);
                joined.push(' ');
                source.text.push('\n');
                continue;
            }
            if joined.is_empty() {
                source.add_line(path, index + 1, line, &mut counts)?;
            } else {
                joined.push_str(line);
                source.add_line(path, index + 1, &std::mem::take(&mut joined), &mut counts)?;
            }
            source.text.push('\n');
        }
        // The last line may end in a continuation, too.
        source.add_line(path, last, &joined, &mut counts)?;
        Ok(source)
    }

    fn add_line(&mut self, path: &Path, number: usize, line: &str, counts: &mut Counts) -> Result<()> {
        let (key, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        match key {
            "v" | "vt" | "vn" | "f" => {
                let data = line.split('#').next().unwrap_or(line);
                counts.add(path, number, key, data)?;
                self.text.push_str(data);
            }
            "o" | "g" => {
                self.text.push_str("o ");
                self.text.push_str(rest.trim());
            }
            "usemtl" => {
                self.uses.push((number, rest.trim().to_owned()));
                // `tobj` rejects an empty name; no material has this one.
                self.text.push_str(if rest.trim().is_empty() { "usemtl \u{0}" } else { "usemtl " });
                self.text.push_str(rest.trim());
            }
            "mtllib" => self.libraries.push((number, rest.trim().to_owned())),
            _ => {}
        }
        Ok(())
    }

    /// Line number in the user's file, and words, of each line that starts with `key`.
    fn lines<'a>(&'a self, key: &'a str) -> impl Iterator<Item = (usize, std::str::SplitWhitespace<'a>)> {
        self.text.lines().enumerate().filter_map(move |(number, line)| {
            let mut words = line.split_whitespace();
            (words.next() == Some(key)).then_some((number, words))
        })
    }
}

/// What the lines so far have defined.
#[derive(Default)]
struct Counts {
    /// Positions, texture coordinates, normals.
    data: [usize; 3],
    triangles: usize,
}

impl Counts {
    fn add(&mut self, path: &Path, number: usize, key: &str, line: &str) -> Result<()> {
        match key {
            "v" => self.data[0] += 1,
            "vt" => self.data[1] += 1,
            "vn" => self.data[2] += 1,
            _ => {
                self.triangles += line.split_ascii_whitespace().count().saturating_sub(3);
                if self.triangles > MAX_TRIANGLES {
                    let (size, limit) =
                        (format!("over {MAX_TRIANGLES} triangles"), format!("{MAX_TRIANGLES} triangles"));
                    return Err(Error::TooLarge { path: path.into(), what: "model", size, limit });
                }
                self.check_face(path, number, line)?;
            }
        }
        Ok(())
    }

    /// Rejects indices on which `tobj`'s sums would overflow; the others it checks itself.
    fn check_face(&self, path: &Path, number: usize, line: &str) -> Result<()> {
        for corner in line.split_ascii_whitespace().skip(1) {
            for (index, count) in corner.split('/').zip(self.data) {
                let safe = -(count as i64)..=i64::from(u32::MAX);
                if index.parse().is_ok_and(|i: i64| !safe.contains(&i)) {
                    return Err(broken(
                        path,
                        format!("line {number}: index {} of a face is not among {count}", shortened(index, MAX_QUOTED)),
                    ));
                }
            }
        }
        Ok(())
    }
}

fn load_libraries(path: &Path, source: &ObjText, report: &Report) -> Vec<Mtl> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let short = file::short_name(path);
    let mut materials = Vec::new();
    for (line, names) in &source.libraries {
        // The rest of the line is one name with spaces or several names.
        let whole = file::find(folder, names.trim_matches('"'));
        let found: Vec<_> = match whole {
            Some(found) => vec![(names.as_str(), Some(found))],
            None => names.split_whitespace().map(|name| (name, file::find(folder, name))).collect(),
        };
        for (name, found) in found {
            let Some(found) = found else {
                report.warn(format!("{short}:{line}: mtllib {name}: file not found; using default materials"));
                continue;
            };
            if let Some(real) = found.real_name {
                report.warn(format!("{short}:{line}: mtllib {name}: found as {real}"));
            }
            match mtl::load(&found.path, report) {
                Ok(more) => materials.extend(more),
                Err(error) => report.warn(format!("{short}:{line}: mtllib {name}: {error}; using default materials")),
            }
        }
    }
    materials
}

fn warn_of_unknown_materials(path: &Path, source: &ObjText, materials: &[Mtl], report: &Report) {
    let mut warned = Vec::new();
    for (line, name) in &source.uses {
        if !warned.contains(&name) && !materials.iter().any(|material| material.name == *name) {
            report.warn(format!(
                "{}:{line}: usemtl {name}: no such material; using the default one",
                file::short_name(path)
            ));
            warned.push(name);
        }
    }
    if source.uses.is_empty() {
        report.warn(format!("{}: it names no material (usemtl); using the default one", file::short_name(path)));
    }
}

fn run_tobj(path: &Path, text: &str, materials: &[Mtl]) -> Result<Vec<tobj::Model>> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let mut reader = Cursor::new(text.as_bytes());
    let library = |_: &Path| {
        let named = materials.iter().map(|m| tobj::Material { name: m.name.clone(), ..Default::default() }).collect();
        Ok((named, materials.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect()))
    };
    match tobj::load_obj_buf(&mut reader, &options, library) {
        Ok((models, _)) => Ok(models),
        Err(error) => {
            // `tobj` stops right after the line with the error; the first line is not the user's.
            let read = &text.as_bytes()[..reader.position() as usize];
            let line = read.iter().filter(|b| **b == b'\n').count().saturating_sub(1);
            Err(broken(path, explain(error, line, text)))
        }
    }
}

fn explain(error: tobj::LoadError, line: usize, text: &str) -> String {
    use tobj::LoadError as E;
    match error {
        // `tobj` reports these at the end of the object, long after the line with the error.
        E::FaceVertexOutOfBounds | E::FaceTexCoordOutOfBounds | E::FaceNormalOutOfBounds => {
            index_out_of_range(text).unwrap_or_else(|| format!("{error} in the object that ends at line {line}"))
        }
        E::InvalidPolygon => format!("a face without corners in the object that ends at line {line}"),
        _ => format!("line {line}: {error}"),
    }
}

/// Describes the first face index that is out of range.
fn index_out_of_range(text: &str) -> Option<String> {
    let count = |key: &str| text.lines().filter(|line| line.split_whitespace().next() == Some(key)).count() as i64;
    let counts = [count("v"), count("vt"), count("vn")];
    text.lines().enumerate().filter(|(_, line)| line.starts_with('f')).find_map(|(number, line)| {
        let mut indices = line.split_whitespace().skip(1).flat_map(|corner| corner.split('/').zip(counts));
        let (index, count) = indices.find(|(index, count)| index.parse().is_ok_and(|i: i64| i == 0 || i > *count))?;
        Some(format!("line {number}: index {} of a face is not in 1..={count}", shortened(index, MAX_QUOTED)))
    })
}

fn submesh(path: &Path, source: &ObjText, model: tobj::Model, report: &Report) -> Result<Submesh> {
    let (mesh, name) = (model.mesh, model.name);
    let positions: &[[f32; 3]] = mesh.positions.as_chunks().0;
    let within = |values: &[f32], limit: f32| values.iter().all(|v| v.abs() <= limit);
    if !within(positions.as_flattened(), MAX_COORDINATE) {
        return Err(broken(path, bad_position(source)));
    }
    let complete = |kind: &str, remedy: &str, found: usize| {
        if found != 0 && found != positions.len() {
            let short = file::short_name(path);
            report.warn(format!("{short}: object {name}: only some corners have {kind}; {remedy}"));
        }
        found == positions.len()
    };
    let uvs: &[[f32; 2]] = mesh.texcoords.as_chunks().0;
    let normals: &[[f32; 3]] = mesh.normals.as_chunks().0;
    let has_uvs = complete("texture coordinates", "none are used", uvs.len());
    let has_normals = complete("normals", "computed for all", normals.len());
    if has_uvs && !within(uvs.as_flattened(), MAX_UV) {
        report
            .warn(format!("{}: object {name}: texture coordinates beyond {MAX_UV}; set to 0", file::short_name(path)));
    }
    let corner = |&index: &u32| {
        let i = index as usize;
        Corner {
            position: Vec3::from_array(positions[i]),
            normal: if has_normals { normals::unit(Vec3::from_array(normals[i])) } else { Vec3::ZERO },
            uv: Vec2::from_array(if has_uvs {
                uvs[i].map(|v| if v.abs() <= MAX_UV { v } else { 0.0 })
            } else {
                [0.0; 2]
            }),
        }
    };
    let corners = mesh.indices.iter().map(corner).collect();
    Ok(Submesh { name, material: mesh.material_id, has_uvs, corners })
}

fn bad_position(source: &ObjText) -> String {
    let bad = |word: &str| !word.parse().is_ok_and(|v: f32| v.abs() <= MAX_COORDINATE);
    let line = source.lines("v").find(|(_, words)| words.clone().take(3).any(bad)).map(|(number, _)| number);
    let place = line.map_or(String::new(), |number| format!("line {number}: "));
    format!("{place}a position is not a number, or beyond {MAX_COORDINATE:e}")
}

fn broken(path: &Path, problem: String) -> Error {
    let remedy = "export it again as OBJ with triangles";
    Error::Broken { path: path.into(), what: "OBJ model", problem, remedy }
}

#[cfg(test)]
#[path = "obj_tests.rs"]
mod tests;
