//! Cube maps written by Filament's `cmgen`, read so that they can be judged like ours.
//!
//! Determined with panoramas whose radiance is 1 + a·d: its faces are laid out as Vulkan's, but its axes are ours with x and z
//! exchanged (with `--no-mirror`). Level i of n holds roughness r with r(2 − r) = i / (n − 1), α = r².

use std::path::{Path, PathBuf};

use super::maps::Map;
use super::texels::Texel;
use crate::asset::picture::Picture;
use crate::precompute::CubeTexels;
use crate::precompute::alternatives::Quantity;
use crate::{Error, Result};

const FACES: [&str; 6] = ["px", "nx", "py", "ny", "pz", "nz"];

/// Reads `m{level}_{face}.exr` from level 0 up, and `i_{face}.exr` if there are any: radiance, and irradiance / π.
///
/// # Errors
/// No maps at all, missing faces, or faces that are not square and of one size.
pub fn read_maps(folder: &Path) -> Result<Vec<Map>> {
    let is_there = |map: &str| face_path(folder, map, 0).is_file();
    let count = (0u32..).take_while(|level| is_there(&format!("m{level}"))).count() as u32;
    let mut maps = Vec::new();
    for level in 0..count {
        let (quantity, cube) = (Quantity::Specular, read_cube(folder, &format!("m{level}"))?);
        maps.push(Map { quantity, level, alpha: alpha_of(level, count), cube });
    }
    if is_there("i") || maps.is_empty() {
        maps.push(Map { quantity: Quantity::Irradiance, level: 0, alpha: 1.0, cube: read_cube(folder, "i")? });
    }
    Ok(maps)
}

fn alpha_of(level: u32, count: u32) -> f64 {
    let lod = f64::from(level) / (f64::from(count) - 1.0).max(1.0);
    (1.0 - (1.0 - lod).sqrt()).powi(2)
}

fn face_path(folder: &Path, map: &str, face: usize) -> PathBuf {
    folder.join(format!("{map}_{}.exr", FACES[face]))
}

/// One cube in our orientation.
fn read_cube(folder: &Path, map: &str) -> Result<CubeTexels> {
    let faces = (0..6).map(|face| Picture::read(&face_path(folder, map, face))).collect::<Result<Vec<Picture>>>()?;
    let size = faces[0].width;
    if let Some(face) = faces.iter().position(|face| [face.width, face.height] != [size; 2]) {
        let [width, height] = [faces[face].width, faces[face].height];
        return Err(Error::Broken {
            path: face_path(folder, map, face),
            what: "face of a cube map",
            problem: format!("it has {width}x{height} texels, not {size}x{size}"),
            remedy: "give the folder that cmgen wrote with -f exr --no-mirror",
        });
    }
    let texel = |[x, y, face]: Texel| {
        let [r, g, b] = faces[face as usize].pixels[(y * size + x) as usize];
        [r, g, b, 1.0]
    };
    let all = (0..6).flat_map(|face| (0..size).flat_map(move |y| (0..size).map(move |x| [x, y, face])));
    Ok(CubeTexels { size, texels: all.map(|ours| texel(theirs(ours, size))).collect() })
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

    use super::super::texels::texel_direction;
    use super::*;

    #[test]
    fn their_texels_look_along_our_directions_with_x_and_z_exchanged_and_levels_run_from_mirror_to_rough() {
        for face in 0..6 {
            for texel in [[0, 0, face], [5, 2, face], [7, 7, face], [1, 6, face]] {
                let exchanged = texel_direction(theirs(texel, 8), 8).zyx();
                assert!(exchanged.abs_diff_eq(texel_direction(texel, 8), 1e-12), "{texel:?}");
            }
        }
        assert_eq!([alpha_of(0, 5), alpha_of(4, 5), alpha_of(0, 1)], [0.0, 1.0, 0.0]);
        assert!((alpha_of(3, 5).sqrt() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_folder_without_maps_or_with_odd_faces_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let error = || read_maps(folder.path()).err().unwrap().to_string();
        assert!(error().contains("i_px.exr"));
        for (face, width) in FACES.into_iter().zip([2, 3, 2, 2, 2, 2]) {
            let pixels = vec![[1.0; 4]; width * 2];
            let path = folder.path().join(format!("m0_{face}.exr"));
            Picture::from_radiance(face, width as u32, 2, &pixels).write(&path).unwrap();
        }
        assert!(error().contains("m0_nx.exr") && error().contains("3x2"), "{}", error());
    }
}
