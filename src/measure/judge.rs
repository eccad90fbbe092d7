//! Cube maps that another program wrote, read so that they can be judged like ours: Filament's `cmgen`.
//!
//! Found out with panoramas whose radiance is 1 + a·d: its faces are laid out as Vulkan's, but its axes are ours with x and z
//! exchanged (with `--no-mirror`). Level i of n holds roughness r with r(2 − r) = i / (n − 1), α = r².

use std::path::{Path, PathBuf};

use super::maps::Map;
use super::texels::Texel;
use crate::asset::Report;
use crate::asset::picture::{Kind, Picture};
use crate::precompute::alternatives::{Quantity, Target};
use crate::{Error, Result};

const FACES: [&str; 6] = ["px", "nx", "py", "ny", "pz", "nz"];

/// Reads `m{level}_{face}.exr` from level 0 up, and `i_{face}.exr` if there are any: radiance, and irradiance / π.
///
/// # Errors
/// No maps at all, missing faces, or faces that are not square and of one size.
pub fn read_maps(folder: &Path, report: &Report) -> Result<Vec<Map>> {
    let mut levels = Vec::new();
    while face_path(folder, &format!("m{}", levels.len()), 0).is_file() {
        levels.push(read_cube(folder, &format!("m{}", levels.len()))?);
    }
    let count = levels.len();
    let mut maps: Vec<Map> = (0u32..)
        .zip(levels)
        .map(|(level, (size, texels))| {
            let target = Target { alpha: alpha_of(level, count), size };
            Map { quantity: Quantity::Specular, level, target, texels }
        })
        .collect();
    if face_path(folder, "i", 0).is_file() {
        let (size, texels) = read_cube(folder, "i")?;
        maps.push(Map { quantity: Quantity::Irradiance, level: 0, target: Target { alpha: 1.0, size }, texels });
    }
    if maps.is_empty() {
        return Err(Error::Broken {
            path: folder.into(),
            what: "folder of cube maps",
            problem: "it holds neither m0_px.exr nor i_px.exr".into(),
            remedy: "give the folder that cmgen wrote with -f exr --no-mirror",
        });
    }
    if count == 0 {
        report.warn(format!("{}: no specular levels; only irradiance is judged", folder.display()));
    }
    Ok(maps)
}

fn alpha_of(level: u32, count: usize) -> f64 {
    let lod = f64::from(level) / (count as f64 - 1.0).max(1.0);
    (1.0 - (1.0 - lod).sqrt()).powi(2)
}

fn face_path(folder: &Path, map: &str, face: usize) -> PathBuf {
    folder.join(format!("{map}_{}.exr", FACES[face]))
}

/// Size and texels of one cube, in our orientation.
fn read_cube(folder: &Path, map: &str) -> Result<(u32, Vec<[f32; 3]>)> {
    let mut faces = Vec::new();
    for face in 0..FACES.len() {
        let path = face_path(folder, map, face);
        let picture = Picture::read(&path)?;
        let size = faces.first().map_or(picture.width, |first: &Picture| first.width);
        if picture.kind != Kind::Radiance || (picture.width, picture.height) != (size, size) {
            return Err(Error::Broken {
                path,
                what: "face of a cube map",
                problem: format!("it has {}x{} texels, not {size}x{size}", picture.width, picture.height),
                remedy: "give the folder that cmgen wrote, unchanged",
            });
        }
        faces.push(picture);
    }
    let size = faces[0].width;
    let texel = |[x, y, face]: Texel| faces[face as usize].pixels[(y * size + x) as usize];
    let all = (0..6).flat_map(|face| (0..size).flat_map(move |y| (0..size).map(move |x| [x, y, face])));
    Ok((size, all.map(|ours| texel(theirs(ours, size))).collect()))
}

/// The texel whose direction is ours with x and z exchanged: ±X and ±Z mirror each other's, ±Y are transposed.
fn theirs([x, y, face]: Texel, size: u32) -> Texel {
    let last = size - 1;
    match face {
        0 => [last - x, y, 4],
        1 => [last - x, y, 5],
        2 => [y, x, 2],
        3 => [last - y, last - x, 3],
        4 => [last - x, y, 0],
        _ => [last - x, y, 1],
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3Swizzles as _;

    use super::*;
    use crate::measure::texels::texel_direction;

    #[test]
    fn their_texels_look_along_our_directions_with_x_and_z_exchanged() {
        for face in 0..6 {
            for texel in [[0, 0, face], [5, 2, face], [7, 7, face], [1, 6, face]] {
                let exchanged = texel_direction(theirs(texel, 8), 8).zyx();
                assert!(exchanged.abs_diff_eq(texel_direction(texel, 8), 1e-12), "{texel:?}");
            }
        }
    }

    #[test]
    fn levels_run_from_mirror_to_rough() {
        assert_eq!(alpha_of(0, 5), 0.0);
        assert_eq!(alpha_of(4, 5), 1.0);
        assert!((alpha_of(3, 5).sqrt() - 0.5).abs() < 1e-12);
        assert_eq!(alpha_of(0, 1), 0.0);
    }

    #[test]
    fn a_folder_without_maps_or_with_odd_faces_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let error = |folder: &Path| read_maps(folder, &Report::silent()).err().unwrap().to_string();
        assert!(error(folder.path()).contains("m0_px.exr"));
        let write = |name: &str, width: u32| {
            let pixels = vec![[1.0; 4]; (width * 2) as usize];
            Picture::from_radiance(name, width, 2, &pixels).write(&folder.path().join(name)).unwrap();
        };
        write("m0_px.exr", 2);
        assert!(error(folder.path()).contains("m0_nx.exr"));
        write("m0_nx.exr", 3);
        assert!(error(folder.path()).contains("3x2"));
    }
}
