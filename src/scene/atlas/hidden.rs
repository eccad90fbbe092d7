//! Surfaces that no one sees, such as outsides of a room's walls or the underside of a floor: their light takes fewer texels.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::kept::HEAD_BYTES;
use super::layout::{MOST_TRIANGLES, triangle_count};
use super::unwrap::Shape;
use crate::asset::Cache;
use crate::asset::cache::Key;
use crate::asset::ktx2::{Ktx2, TexelFormat};
use crate::scene::bvh::{Bvh, Hit};
use crate::scene::random_paths::{before, path_direction, random_direction, starts};
use crate::scene::{Instance, Scene};

/// Raise it whenever other surfaces of the same scene are found.
const VERSION: u32 = 1;
/// Paths from all cameras together, and how often each is reflected.
const PATHS: u32 = 1 << 13;
const REFLECTIONS: u32 = 4;
/// Part of the scene's area that a hidden surface has at least: paths may miss smaller ones by chance.
const LEAST_PART: f64 = 2e-3;
/// Share of a camera's rays that meet nothing from which on it stands in the open, and people may walk around what it sees.
const OPEN: f32 = 0.25;
/// Triangles in a row of the picture in the cache.
const ROW: usize = 4096;

/// For each instance, of each triangle, whether no path of light from a camera meets the smooth surface that it is part of. From a
/// camera in the open, what light from around meets is seen, too. From the cache, or else found by rays and kept there; empty where there
/// are too many triangles for an atlas.
pub fn hidden_triangles(scene: &Scene, cache: Option<&Cache>) -> Vec<Vec<bool>> {
    let count = triangle_count(scene.geometry());
    if count > MOST_TRIANGLES {
        return Vec::new();
    }
    let Some(cache) = cache else { return find(scene) };
    let key = key(scene);
    let rows = count.div_ceil(ROW).max(1);
    let size = [ROW as u32 / 4, rows as u32];
    let fits = |entry: &Ktx2| entry.format == TexelFormat::Rgba8 && entry.size == size;
    let kept = cache.load(&key, (rows * ROW) as u64 + HEAD_BYTES, fits);
    if let Some(bytes) = kept.and_then(|entry| entry.levels.into_iter().next()) {
        let mut rest = bytes.iter().map(|byte| *byte != 0);
        return triangles(scene).map(|count| rest.by_ref().take(count).collect()).collect();
    }
    let hidden = find(scene);
    let mut bytes: Vec<u8> = hidden.iter().flatten().map(|hidden| u8::from(*hidden)).collect();
    bytes.resize(rows * ROW, 0);
    let levels = vec![bytes];
    cache.keep(&key, Ktx2 { format: TexelFormat::Rgba8, size, layers: 0, faces: 1, levels, key_values: [].into() });
    hidden
}

/// Of each instance, their number.
fn triangles(scene: &Scene) -> impl Iterator<Item = usize> {
    scene.instances.iter().map(|instance| scene.meshes[instance.mesh].indices.len() / 3)
}

/// A hash of everything that it depends on.
fn key(scene: &Scene) -> String {
    let mut key = Key::new("hidden", VERSION);
    for mesh in &scene.meshes {
        key.add(bytemuck::cast_slice(&mesh.vertices));
        key.add(bytemuck::cast_slice(&mesh.indices));
        key.add(&[u8::from(lets_light_through(scene, mesh.material))]);
    }
    for instance in &scene.instances {
        key.add(&(instance.mesh as u64).to_le_bytes());
        key.add(bytemuck::bytes_of(&instance.world_from_local.to_cols_array()));
    }
    let cameras: Vec<[f32; 3]> = scene.cameras.iter().map(|camera| camera.position.into()).collect();
    key.add(bytemuck::cast_slice(&cameras));
    key.text()
}

fn lets_light_through(scene: &Scene, material: usize) -> bool {
    scene.materials.get(material).is_some_and(|m| {
        m.blends || m.alpha_cutoff.is_some() || m.transmission.is_some() || m.diffuse_transmission.is_some()
    })
}

fn find(scene: &Scene) -> Vec<Vec<bool>> {
    let Ok(bvh) = Bvh::new(&scene.meshes, &scene.instances) else { return Vec::new() };
    let met = met_by_paths(scene, &bvh);
    let surfaces = |instance: &Instance| {
        Shape::new(&scene.meshes[instance.mesh], Mat3::from_mat4(instance.world_from_local)).into_surfaces()
    };
    let surfaces: Vec<Vec<(Vec<u32>, f64)>> = scene.instances.par_iter().map(surfaces).collect();
    let areas = surfaces.iter().flatten().map(|(_, area)| area);
    let least = LEAST_PART * areas.filter(|area| area.is_finite()).sum::<f64>();
    let of_instance = |(met, surfaces): (Vec<bool>, Vec<(Vec<u32>, f64)>)| {
        let mut hidden = vec![false; met.len()];
        for (triangles, area) in surfaces {
            let is_hidden = area >= least && !triangles.iter().any(|triangle| met[*triangle as usize]);
            triangles.iter().for_each(|triangle| hidden[*triangle as usize] = is_hidden);
        }
        hidden
    };
    met.into_iter().zip(surfaces).map(of_instance).collect()
}

/// For each instance, of each triangle, whether a path meets it.
fn met_by_paths(scene: &Scene, bvh: &Bvh) -> Vec<Vec<bool>> {
    let of_mesh: Vec<bool> = scene.meshes.iter().map(|mesh| lets_light_through(scene, mesh.material)).collect();
    let passes = |hit: &Hit| of_mesh[scene.instances[bvh.triangles()[hit.triangle].instance as usize].mesh];
    let unmet = |count| (0..count).map(|_| AtomicBool::new(false)).collect();
    let met: Vec<Vec<AtomicBool>> = triangles(scene).map(unmet).collect();
    // Half of the paths pass what light gets through. True where the first ray meets nothing.
    let walk = |mut o: Vec3, mut d: Vec3, path: u32| {
        for reflection in 0..=REFLECTIONS {
            let Some(hit) = bvh.trace(o, d, f32::INFINITY, |hit| path.is_multiple_of(2) || !passes(hit)) else {
                return reflection == 0;
            };
            let triangle = &bvh.triangles()[hit.triangle];
            met[triangle.instance as usize][triangle.first_index as usize / 3].store(true, Ordering::Relaxed);
            let (place, n) = before(bvh, o, d, &hit);
            (o, d) = (place, path_direction(Some(n), path.wrapping_mul(REFLECTIONS + 1).wrapping_add(reflection)));
        }
        false
    };
    let cameras = starts(&scene.cameras.iter().map(|camera| camera.position).collect::<Vec<_>>());
    let paths = PATHS / cameras.len().max(1) as u32;
    let is_open = |(number, camera): (u32, &Vec3)| {
        let of_camera = number * paths..(number + 1) * paths;
        let open = of_camera.into_par_iter().filter(|path| walk(*camera, random_direction(!path), *path)).count();
        open as f32 >= OPEN * paths as f32
    };
    // All of them: what they meet counts.
    if (0..).zip(&cameras).filter(|camera| is_open(*camera)).count() > 0 {
        let (centre, far) = (bvh.bounds().centre(), bvh.bounds().radius());
        (0..PATHS).into_par_iter().for_each(|path| {
            // Not from below the ground.
            let out = random_direction(path);
            let out = out.with_y(out.y.abs());
            walk(centre + far * out, path_direction(Some(-out), !path), path);
        });
    }
    met.into_iter().map(|of_instance| of_instance.into_iter().map(AtomicBool::into_inner).collect()).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use glam::Mat4;

    use super::*;
    use crate::asset::{Panorama, Report};
    use crate::scene::atlas::{COARSER, Work, flatten};
    use crate::scene::material::default_material;
    use crate::scene::needs::lightmap::LightmapNeed;
    use crate::scene::{Camera, Environment, Mesh, Model};

    /// A ball as a room, a larger one around it as the outside of its walls, a tiny one beyond; a camera there.
    fn scene(camera: Vec3) -> Scene {
        let mut room = Mesh::ball(24, 1.0);
        room.vertices.iter_mut().for_each(|vertex| vertex.normal = vertex.normal.map(|value| -value));
        room.indices.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
        room.material = 1;
        let placed = |mesh, x, size| {
            let [at, size] = [Vec3::X * x, Vec3::splat(size)];
            Instance { mesh, world_from_local: Mat4::from_scale_rotation_translation(size, glam::Quat::IDENTITY, at) }
        };
        Scene {
            meshes: vec![room, Mesh::ball(24, 1.1)],
            instances: vec![placed(0, 0.0, 1.0), placed(1, 0.0, 1.0), placed(1, 1.2, 0.01)],
            sources: vec![],
            materials: vec![default_material(), default_material()],
            textures: vec![],
            lights: vec![],
            cameras: vec![Camera {
                name: "a".into(),
                position: camera,
                target: Vec3::ZERO,
                vertical_fov_degrees: 60.0,
            }],
            environment: Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees: 0.0 },
            probes: vec![],
            exposure_ev: 0.0,
        }
    }

    /// Of each instance the share of its triangles that is hidden.
    fn shares(scene: &Scene, cache: Option<&Cache>) -> Vec<f64> {
        let share = |hidden: &Vec<bool>| hidden.iter().filter(|hidden| **hidden).count() as f64 / hidden.len() as f64;
        hidden_triangles(scene, cache).iter().map(share).collect()
    }

    #[test]
    fn outsides_of_rooms_are_hidden_and_insides_of_what_stands_in_the_open() {
        // The tiny one is never hidden: paths may miss it by chance.
        assert_eq!(shares(&scene(Vec3::new(0.3, 0.2, 0.1)), None), [0.0, 1.0, 0.0]);
        assert_eq!(shares(&scene(Vec3::new(0.0, 1.0, 4.0)), None), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn nothing_is_hidden_by_what_lets_light_through() {
        let pane = |change: fn(&mut crate::scene::Material)| {
            let mut scene = scene(Vec3::ZERO);
            change(&mut scene.materials[1]);
            shares(&scene, None)
        };
        assert_eq!(pane(|m| m.transmission = Some(Vec3::ONE)), [0.0; 3]);
        assert_eq!(pane(|m| m.blends = true), [0.0; 3]);
        assert_eq!(pane(|m| m.alpha_cutoff = Some(0.5)), [0.0; 3]);
    }

    #[test]
    fn what_is_hidden_is_kept_for_the_same_cameras_and_materials() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path().to_owned());
        let inside = scene(Vec3::ZERO);
        let found = shares(&inside, Some(&cache));
        let entries = || std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!((found.clone(), entries()), (shares(&inside, None), 1));
        assert_eq!((shares(&inside, Some(&cache)), entries()), (found, 1));
        assert_eq!(shares(&scene(Vec3::Z * 4.0), Some(&cache)), [1.0, 0.0, 0.0]);
        let mut pane = scene(Vec3::ZERO);
        pane.materials[1].blends = true;
        assert_eq!((shares(&pane, Some(&cache)), entries()), (vec![0.0; 3], 3));
    }

    #[test]
    fn hidden_surfaces_have_fewer_texels_and_a_lightmap_is_smaller_for_it() {
        let scene = scene(Vec3::ZERO);
        let [needed, everything] =
            [Model::Needed, Model::Everything].map(|model| LightmapNeed::new(&scene, model, None));
        assert!(needed.side < everything.side && everything.hidden.is_empty(), "{needed:?}, {everything:?}");
        let (report, stop) = (Report::silent(), AtomicBool::new(false));
        let work = Work { cache: None, report: &report, stop: &stop };
        let flat = flatten(scene.geometry(), &needed.hidden, needed.side, work).unwrap();
        // Of the atlas, per square metre.
        let density = |i: usize| {
            let Mesh { vertices, indices, .. } = &flat.meshes[i];
            let sum = |area: &dyn Fn([&crate::scene::Vertex; 3]) -> f32| {
                let corners = |t: &[u32]| [t[0], t[1], t[2]].map(|index| &vertices[index as usize]);
                indices.chunks_exact(3).map(|t| area(corners(t))).sum::<f32>()
            };
            let of_atlas = sum(&|corners| {
                let [a, b, c] = corners.map(|vertex| glam::Vec2::from(vertex.lightmap_uv));
                (b - a).perp_dot(c - a).abs()
            });
            let of_world = sum(&|corners| {
                let [a, b, c] = corners.map(|vertex| Vec3::from(vertex.position));
                (b - a).cross(c - a).length()
            });
            of_atlas / of_world
        };
        let ratio = density(0) / density(1);
        assert!((ratio / (COARSER * COARSER) - 1.0).abs() < 0.1, "{ratio}");
    }
}
