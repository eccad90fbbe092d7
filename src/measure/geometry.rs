//! What vertices lose in fewer bytes, and what ordering triangles gains: a row for each encoding, those in use marked.

use std::path::Path;

use glam::{DVec3, Mat4, Vec2, Vec3, Vec4};
use half::f16;
use serde::Serialize;

use crate::asset::file::write_atomically;
use crate::asset::{Report, shipped};
use crate::reference::octahedral::{
    frame_normal, frame_tangent, octahedral_decode, octahedral_encode, pack_frame, unpack_frame,
};
use crate::scene::cluster::{Cluster, clusters};
use crate::scene::load::{LoadOptions, load};
use crate::scene::{Scene, Vertex};
use crate::{Error, Result, say};

/// Radians across a pixel in the middle of a headset's picture: 110° over 1512 pixels.
const PIXEL_RADIANS: f32 = 2.0 * 1.428_148 / 1512.0;
/// How near people look at things, metres.
const NEAR_METRES: f32 = 0.3;
const MAP_TEXELS: f32 = 2048.0;
/// Entries of the vertex cache that `acmr` is told for, first in, first out.
const CACHE: u32 = 32;

/// One encoding of one attribute, or one order of triangles.
#[derive(Clone, Debug, Serialize)]
pub struct GeometryRow {
    pub scene: String,
    pub what: &'static str,
    pub encoding: &'static str,
    /// Of one vertex or triangle.
    pub bytes: f64,
    /// The largest of the scene, or vertices per triangle for orders.
    pub value: f64,
    pub unit: &'static str,
    pub used: bool,
}

const HEADER: &str = "scene,what,encoding,bytes,value,unit,used";

/// Measures and writes `geometry.csv` and `geometry.json`: the shipped tearoom, and Sponza where the environment variable
/// PBR_VR_SCENES leads to it.
pub fn run(folder: &Path, report: &Report) -> Result<Vec<GeometryRow>> {
    let mut files = vec![("tearoom", shipped::folder()?.join("scenes/tearoom.toml"))];
    if let Some(scenes) = std::env::var_os("PBR_VR_SCENES") {
        files.push(("Sponza", Path::new(&scenes).join("crytek-sponza/sponza.obj")));
    } else {
        say!("Sponza: skipped (set PBR_VR_SCENES)");
    }
    let mut rows = Vec::new();
    for (name, file) in files {
        let mut scene = load(&file, &LoadOptions::default(), report)?;
        if name == "Sponza" {
            // Its file is in centimetres.
            scene.instances.iter_mut().for_each(|i| i.world_from_local = Mat4::from_scale(Vec3::splat(0.01)));
        }
        let found = scene_rows(name, &scene);
        found.iter().for_each(|row| say!("{}", line(row).trim_end()));
        rows.extend(found);
        write(folder, &rows)?;
    }
    Ok(rows)
}

fn write(folder: &Path, rows: &[GeometryRow]) -> Result<()> {
    let csv = rows.iter().fold(format!("{HEADER}\n"), |text, row| text + &line(row));
    write_atomically(&folder.join("geometry.csv"), csv.as_bytes())?;
    let path = folder.join("geometry.json");
    let json = serde_json::to_string_pretty(rows).map_err(|e| Error::write(&path)(e.into()))?;
    write_atomically(&path, json.as_bytes())
}

fn scene_rows(name: &str, scene: &Scene) -> Vec<GeometryRow> {
    let clusters = clusters(&scene.meshes, &scene.instances);
    let worst = |loss: fn(&Cluster, &Vertex) -> f32| {
        let all = clusters.iter().flat_map(|c| c.vertices.iter().map(move |v| loss(c, v)));
        f64::from(all.fold(0.0, f32::max))
    };
    let row = |what, encoding, bytes, value, unit, used| GeometryRow {
        scene: name.into(),
        what,
        encoding,
        bytes,
        value,
        unit,
        used,
    };
    let vertices: usize = clusters.iter().map(|c| c.vertices.len()).sum();
    let loaded: usize = scene.meshes.iter().map(|m| m.vertices.len()).sum();
    let cuts = vertices as f64 / loaded.max(1) as f64;
    let (listed, ordered) = cache_misses(scene, &clusters);
    vec![
        row("position", "f32", 12.0, 0.0, "pixels at 0.3 m", true),
        row("position", "16 bits in the range's box", 6.0, worst(position_loss), "pixels at 0.3 m", false),
        row("normal", "f32", 12.0, 0.0, "degrees", false),
        row("normal", "octahedral, 16 bits", 4.0, worst(normal_loss), "degrees", true),
        row("normal", "octahedral, 8 bits", 2.0, worst(coarse_normal_loss), "degrees", false),
        row("tangent", "f32", 16.0, 0.0, "degrees", false),
        row("tangent", "octahedral, 16 bits, sign inside", 4.0, worst(tangent_loss), "degrees", true),
        row("uv", "f32", 8.0, 0.0, "texels of 2048", true),
        row("uv", "half", 4.0, worst(half_uv_loss), "texels of 2048", false),
        row("uv", "16 bits in the range's box", 4.0, worst(boxed_uv_loss), "texels of 2048", false),
        row("vertex", "as loaded", 48.0, 1.0, "times the vertices", false),
        row("vertex", "packed", 28.0, cuts, "times the vertices", true),
        row("triangle", "as loaded, 32 bits", 12.0, listed, "vertices shaded", false),
        row("triangle", "ordered, 16 bits", 6.0, ordered, "vertices shaded", true),
    ]
}

/// Vertices shaded per triangle, as loaded and in clusters.
fn cache_misses(scene: &Scene, clusters: &[Cluster]) -> (f64, f64) {
    let misses = |indices: &[u32], vertices| {
        f64::from(meshopt::analyze_vertex_cache(indices, vertices, CACHE, 0, 0).vertices_transformed)
    };
    let loaded = scene.meshes.iter().map(|m| (misses(&m.indices, m.vertices.len()), m.indices.len() / 3));
    let wide = |c: &Cluster| c.indices.iter().map(|i| u32::from(*i)).collect::<Vec<_>>();
    let ordered = clusters.iter().map(|c| (misses(&wide(c), c.vertices.len()), c.indices.len() / 3));
    let mean = |all: &mut dyn Iterator<Item = (f64, usize)>| {
        let (misses, triangles) = all.fold((0.0, 0), |sum, next| (sum.0 + next.0, sum.1 + next.1));
        misses / triangles.max(1) as f64
    };
    (mean(&mut loaded.into_iter()), mean(&mut ordered.into_iter()))
}

/// The nearest of 65,536 steps from `min` to `max`.
fn in_box(value: f32, min: f32, max: f32) -> f32 {
    let step = (max - min) / 65_535.0;
    if step > 0.0 { min + ((value - min) / step).round() * step } else { min }
}

fn position_loss(cluster: &Cluster, vertex: &Vertex) -> f32 {
    let (min, max) = (cluster.bounds.min, cluster.bounds.max);
    let at = Vec3::from(vertex.position);
    let kept = Vec3::from_array(std::array::from_fn(|i| in_box(at[i], min[i], max[i])));
    let metres = cluster.placements[0].transform_vector3(kept - at).length();
    metres / NEAR_METRES / PIXEL_RADIANS
}

fn degrees(a: DVec3, b: DVec3) -> f32 {
    // Of a small angle the chord keeps the digits.
    (2.0 * (0.5 * a.distance(b)).asin()).to_degrees() as f32
}

fn packed(vertex: &Vertex) -> glam::DVec4 {
    unpack_frame(pack_frame(Vec3::from(vertex.normal).as_dvec3(), Vec4::from(vertex.tangent).as_dvec4()))
}

fn normal_loss(_: &Cluster, vertex: &Vertex) -> f32 {
    degrees(frame_normal(packed(vertex)), Vec3::from(vertex.normal).as_dvec3().normalize())
}

fn tangent_loss(_: &Cluster, vertex: &Vertex) -> f32 {
    let tangent = Vec4::from(vertex.tangent).as_dvec4().truncate().normalize();
    degrees(frame_tangent(packed(vertex)).truncate(), tangent)
}

fn coarse_normal_loss(_: &Cluster, vertex: &Vertex) -> f32 {
    let normal = Vec3::from(vertex.normal).as_dvec3().normalize();
    degrees(octahedral_decode((octahedral_encode(normal) * 127.0).round() / 127.0), normal)
}

fn half_uv_loss(_: &Cluster, vertex: &Vertex) -> f32 {
    let uv = Vec2::from(vertex.uv);
    let kept = uv.to_array().map(|v| f16::from_f32(v).to_f32());
    (Vec2::from(kept) - uv).abs().max_element() * MAP_TEXELS
}

fn boxed_uv_loss(cluster: &Cluster, vertex: &Vertex) -> f32 {
    let uvs = || cluster.vertices.iter().map(|v| Vec2::from(v.uv));
    // A cluster's first vertex stands for all: the loss is half a step at most, whatever the vertex.
    if !std::ptr::eq(vertex, &cluster.vertices[0]) {
        return 0.0;
    }
    let size = uvs().reduce(Vec2::max).unwrap_or_default() - uvs().reduce(Vec2::min).unwrap_or_default();
    0.5 * size.max_element() / 65_535.0 * MAP_TEXELS
}

fn line(row: &GeometryRow) -> String {
    let GeometryRow { scene, what, encoding, bytes, value, unit, used } = row;
    format!("{scene},{what},\"{encoding}\",{bytes},{value:.4},{unit},{used}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Bounds;

    fn cluster(uvs: [[f32; 2]; 2]) -> Cluster {
        let vertices =
            uvs.map(|uv| Vertex { position: [0.1; 3], normal: [0.6, 0.0, 0.8], uv, tangent: [0.0, 1.0, 0.0, 1.0] });
        Cluster {
            bounds: Bounds { min: Vec3::ZERO, max: Vec3::splat(6.5535) },
            vertices: vertices.to_vec(),
            indices: vec![0, 1, 1],
            material: 0,
            culling_bounds: None,
            placements: vec![Mat4::IDENTITY],
        }
    }

    #[test]
    fn losses_are_those_of_a_known_vertex() {
        let c = cluster([[0.0, 0.0], [20.0, 1.0]]);
        let first = &c.vertices[0];
        // 0.1 lies on a step of 0.0001.
        assert!(position_loss(&c, first) < 0.01);
        let between = Vertex { position: [0.10005, 0.1, 0.1], ..*first };
        assert!((position_loss(&c, &between) - 5e-5 / 0.3 / PIXEL_RADIANS).abs() < 0.01);
        assert!((boxed_uv_loss(&c, first) - 20.0 / 65_535.0 * 1024.0).abs() < 1e-3);
        assert_eq!(half_uv_loss(&c, first), 0.0);
        let odd = Vertex { uv: [1.0 + 1.0 / 2048.0, 0.0], ..*first };
        assert_eq!(half_uv_loss(&c, &odd), 1.0, "half a step of a half is a texel of 2048");
        assert!(normal_loss(&c, first) < 0.005 && (0.01..1.0).contains(&coarse_normal_loss(&c, first)));
        assert!(tangent_loss(&c, first) < 0.01);
    }

    #[test]
    fn lines_have_the_header_s_columns() {
        let row = GeometryRow {
            scene: "a".into(),
            what: "uv",
            encoding: "f32",
            bytes: 8.0,
            value: 0.0,
            unit: "texels",
            used: true,
        };
        assert_eq!(line(&row).split(',').count(), HEADER.split(',').count());
    }
}
