//! OBJ models: read by `tobj` from preprocessed text, then cut into triangles, checked, and completed with normals.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::io::Cursor;
use std::path::Path;

use glam::{Vec2, Vec3, Vec4};

use super::contained::contained;
use super::mesh::{Corner, CornerExtra, MAX_COORDINATE, Submesh};
use super::model::Model;
use super::mtl::{self, Mtl, UvTransform};
use super::obj_text::{ObjText, broken};
use super::polygon::triangulate;
use super::texture::srgb_to_linear;
use super::{Report, file, mtl_material, normals};
use crate::error::{MAX_QUOTED, shortened};
use crate::{Error, Result};

const MAX_FILE_BYTES: u64 = 1 << 30;
/// Beyond this, f32 cannot resolve texels.
const MAX_UV: f32 = 1e6;

/// Reads a model and the material libraries it names.
///
/// Polygons are cut into triangles, which turn counter-clockwise about the file's normals where it has any. Missing, zero
/// or non-finite normals are computed from the adjacent triangles of the same smoothing group. A model far from the origin
/// is moved there with a warning; a missing library or material is one, too.
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
    let (all, are_read) = load_libraries(path, &source, report);
    let models = run_tobj(path, &source.text, &all)?;
    // What a library that cannot be read holds is not missed line by line.
    if are_read {
        warn_of_unknown_materials(path, &source, &all, report);
    }
    warn_of_changes(path, &source, report);
    let mut submeshes = Vec::new();
    let mut groups = source.smoothing.iter().copied();
    for model in models.into_iter().filter(|model| !model.mesh.indices.is_empty()) {
        submeshes.push(submesh(path, &source, model, &mut groups, report)?);
    }
    if submeshes.is_empty() {
        return Err(broken(path, "it has no triangles".into()));
    }
    normals::complete(&mut submeshes);
    let used = keep_used(&mut submeshes, all);
    place_textures(&mut submeshes, &used, report);
    Ok(Model::in_place(submeshes, mtl_material::materials(&used, report)))
}

/// Drops materials that no submesh uses, so that their textures are not loaded.
fn keep_used(submeshes: &mut [Submesh], all: Vec<Mtl>) -> Vec<Mtl> {
    let used: BTreeSet<usize> = submeshes.iter().filter_map(|submesh| submesh.material).collect();
    let new_index: HashMap<usize, usize> = used.iter().enumerate().map(|(new, old)| (*old, new)).collect();
    for submesh in submeshes {
        submesh.material = submesh.material.and_then(|old| new_index.get(&old).copied());
    }
    all.into_iter().enumerate().filter(|(index, _)| used.contains(index)).map(|(_, mtl)| mtl).collect()
}

/// Applies `-s` and `-o` of the materials' maps.
fn place_textures(submeshes: &mut [Submesh], materials: &[Mtl], report: &Report) {
    let transforms: Vec<UvTransform> = materials.iter().map(|mtl| mtl.uv_transform(report)).collect();
    for submesh in submeshes {
        let own = submesh.material.map(|material| transforms[material]);
        if let Some(own) = own.filter(|own| *own != UvTransform::default()) {
            submesh.corners.iter_mut().for_each(|corner| corner.uv = own.apply(corner.uv));
        }
    }
}

/// The materials of all libraries that are there, and whether all of these can be read.
fn load_libraries(path: &Path, source: &ObjText, report: &Report) -> (Vec<Mtl>, bool) {
    let folder = path.parent().unwrap_or(Path::new(""));
    let short = file::short_name(path);
    let (mut materials, mut are_read) = (Vec::new(), true);
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
                Err(error) => {
                    are_read = false;
                    report.warn(format!("{short}:{line}: mtllib {name}: {error}; using default materials"));
                }
            }
        }
    }
    (materials, are_read)
}

fn warn_of_changes(path: &Path, source: &ObjText, report: &Report) {
    let short = file::short_name(path);
    if let Some(by) = source.moved {
        let by = -by;
        report.warn(format!("{short}: far from the origin for its size; moved by {} {} {}", by.x, by.y, by.z));
    }
}

fn warn_of_unknown_materials(path: &Path, source: &ObjText, materials: &[Mtl], report: &Report) {
    let mut known: HashSet<&str> = materials.iter().map(|material| material.name.as_str()).collect();
    for (line, name) in &source.uses {
        // Each is warned of once.
        if known.insert(name) {
            report.warn(format!(
                "{}:{line}: usemtl {name}: no such material; using the default one",
                file::short_name(path)
            ));
        }
    }
    if source.uses.is_empty() {
        report.warn(format!("{}: it names no material (usemtl); using the default one", file::short_name(path)));
    }
}

fn run_tobj(path: &Path, text: &str, materials: &[Mtl]) -> Result<Vec<tobj::Model>> {
    let options = tobj::LoadOptions { single_index: true, triangulate: false, ignore_points: true, ignore_lines: true };
    let mut reader = Cursor::new(text.as_bytes());
    let library = |_: &Path| {
        let named = materials.iter().map(|m| tobj::Material { name: m.name.clone(), ..Default::default() }).collect();
        Ok((named, materials.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect()))
    };
    let read = contained(|| tobj::load_obj_buf(&mut reader, &options, library));
    match read.map_err(|problem| broken(path, problem))? {
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

/// `groups`: the smoothing groups of this model's faces and of those that follow.
fn submesh(
    path: &Path,
    source: &ObjText,
    model: tobj::Model,
    groups: &mut impl Iterator<Item = u32>,
    report: &Report,
) -> Result<Submesh> {
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
    let colours: &[[f32; 3]] = if source.coloured { mesh.vertex_color.as_chunks().0 } else { &[] };
    let uvs: &[[f32; 2]] = mesh.texcoords.as_chunks().0;
    let normals: &[[f32; 3]] = mesh.normals.as_chunks().0;
    let has_uvs = complete("texture coordinates", "none are used", uvs.len());
    let has_normals = complete("normals", "computed for all", normals.len());
    if has_uvs && !within(uvs.as_flattened(), MAX_UV) {
        report
            .warn(format!("{}: object {name}: texture coordinates beyond {MAX_UV}; set to 0", file::short_name(path)));
    }
    let corner = |index: u32| {
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
    let mut submesh = Submesh {
        name,
        material: mesh.material_id,
        has_uvs,
        corners: Vec::new(),
        smoothing: Vec::new(),
        extras: Vec::new(),
    };
    submesh.corners.reserve(mesh.indices.len());
    let mut rest = &mesh.indices[..];
    // `tobj` leaves the numbers of corners out where all are triangles.
    let triangles = mesh.face_arities.is_empty().then_some(3).into_iter().cycle().take(mesh.indices.len() / 3);
    for arity in triangles.chain(mesh.face_arities.iter().map(|arity| *arity as usize)) {
        let (face, after) = rest.split_at(arity.min(rest.len()));
        rest = after;
        let group = groups.next();
        let mut add = |[a, b, c]: [u32; 3]| {
            let triangle = if is_seen_from_behind([a, b, c].map(corner)) { [a, c, b] } else { [a, b, c] };
            submesh.corners.extend(triangle.map(corner));
            submesh.smoothing.extend(group);
            if source.coloured {
                submesh.extras.extend(triangle.map(|i| coloured(colours.get(i as usize))));
            }
        };
        if let [a, b, c] = *face {
            add([a, b, c]);
            continue;
        }
        let around: Vec<Vec3> = face.iter().map(|index| corner(*index).position).collect();
        triangulate(&around).into_iter().for_each(|triangle| add(triangle.map(|corner| face[corner])));
    }
    Ok(submesh)
}

/// What a colour of a position is: sRGB, as scanners and modellers show it.
fn coloured(colour: Option<&[f32; 3]>) -> CornerExtra {
    let [r, g, b] = colour.unwrap_or(&[1.0; 3]).map(srgb_to_linear);
    CornerExtra { colour: Vec4::new(r, g, b, 1.0), ..CornerExtra::default() }
}

/// Whether a triangle turns clockwise about its normals, as in mirrored objects: light comes from the side that normals point
/// to.
fn is_seen_from_behind([a, b, c]: [Corner; 3]) -> bool {
    let area = (b.position - a.position).as_dvec3().cross((c.position - a.position).as_dvec3());
    let has_all = [a, b, c].iter().all(|corner| corner.normal != Vec3::ZERO);
    has_all && area.dot((a.normal + b.normal + c.normal).as_dvec3()) < 0.0
}

fn bad_position(source: &ObjText) -> String {
    let bad = |word: &str| !word.parse().is_ok_and(|v: f32| v.abs() <= MAX_COORDINATE);
    let line = source.lines("v").find(|(_, words)| words.clone().take(3).any(bad)).map(|(number, _)| number);
    let place = line.map_or(String::new(), |number| format!("line {number}: "));
    format!("{place}a position is not a number, or beyond {MAX_COORDINATE:e}")
}

#[cfg(test)]
#[path = "obj_tests.rs"]
mod tests;
