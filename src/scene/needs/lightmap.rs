//! The size of the lightmap that a scene needs.

use glam::Vec3;
use rayon::prelude::*;

use super::Model;
use super::casting::nothing_casts;
use crate::asset::Cache;
use crate::scene::atlas::{COARSER, SIDES, hidden_triangles};
use crate::scene::{Instance, Scene};

/// Texels wanted along the diagonal of a scene's bounds.
///
/// Soft light changes with the size of what surrounds a place, so texels have to be small beside the whole scene, at
/// whatever scale it was made. The diffuse light that a camera sees in a room is off by 3.0 % with 350 texels along its
/// diagonal, by 2.3 % with 710 and 1.2 % with 1400; in a court by 2.7 % with 140, 1.9 % with 330 and 1.7 % with 670.
const TEXELS_ALONG: f64 = 300.0;
/// Share of an atlas that is surface.
const USED: f64 = 0.8;

/// The side of the square lightmap for a scene, in texels: the least of [`SIDES`] with [`TEXELS_ALONG`] texels, or the
/// largest. A scene that is more surface beside its extent, as a building with its columns beside an empty room, needs
/// more; surfaces that are hidden need fewer texels.
fn side(scene: &Scene, hidden: &[Vec<bool>]) -> u32 {
    let bounds = scene.bounds();
    let diagonal = 2.0 * f64::from(bounds.radius());
    let area_of = |(i, instance)| area(scene, instance, hidden.get(i).map_or(&[], Vec::as_slice));
    let area: f64 = scene.instances.par_iter().enumerate().map(area_of).collect::<Vec<_>>().iter().sum();
    let wanted = TEXELS_ALONG * (area / USED).sqrt() / diagonal;
    // What has no extent, or an infinite one, gets the least: a comparison with NaN is false.
    let least = SIDES.into_iter().find(|side| f64::from(*side) >= wanted);
    least.unwrap_or(if wanted > 0.0 { SIDES[SIDES.len() - 1] } else { SIDES[0] })
}

/// The size of a scene's lightmap.
#[derive(Debug)]
pub struct LightmapNeed {
    /// It is a square one of this side, in texels.
    pub side: u32,
    /// For each instance, of each triangle, whether it has fewer texels; or nothing, where none has.
    pub hidden: Vec<Vec<bool>>,
}

impl LightmapNeed {
    /// The lightmap that a scene needs. What is hidden comes from the cache, if there is one.
    pub fn new(scene: &Scene, model: Model, cache: Option<&Cache>) -> Self {
        let hidden = if model == Model::Needed { hidden_triangles(scene, cache) } else { Vec::new() };
        Self { side: side(scene, &hidden), hidden }
    }
}

/// Why a scene's soft light is not modelled by a lightmap, if nothing blocks or gives back light that falls on something.
pub fn needs_no_lightmap(scene: &Scene, model: Model) -> Option<&'static str> {
    nothing_casts(scene).filter(|_| model == Model::Needed)
}

/// World-space area of one instance, m², less where triangles have fewer texels.
fn area(scene: &Scene, instance: &Instance, hidden: &[bool]) -> f64 {
    let mesh = &scene.meshes[instance.mesh];
    let corner = |index: u32| {
        let local = Vec3::from(mesh.vertices[index as usize].position);
        instance.world_from_local.transform_vector3(local).as_dvec3()
    };
    let twice = |t: &[u32]| {
        let [a, b, c] = [t[0], t[1], t[2]].map(corner);
        (b - a).cross(c - a).length()
    };
    let share = |hidden: bool| if hidden { f64::from(COARSER).powi(-2) } else { 1.0 };
    let shares = hidden.iter().copied().chain(std::iter::repeat(false)).map(share);
    let areas = mesh.indices.chunks_exact(3).map(twice).zip(shares).map(|(twice, share)| 0.5 * twice * share);
    areas.filter(|area| area.is_finite()).sum()
}

#[cfg(test)]
mod tests {
    use glam::Mat4;

    use super::*;
    use crate::asset::Panorama;
    use crate::scene::{Environment, Mesh};

    fn side(count: usize, scale: f32) -> u32 {
        let environment = Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees: 0.0 };
        let one = Instance { mesh: 0, world_from_local: Mat4::from_scale(Vec3::splat(scale)) };
        let scene = Scene {
            meshes: vec![Mesh::ball(12, 1.0)],
            instances: vec![one; count],
            sources: Vec::new(),
            materials: vec![],
            textures: vec![],
            lights: vec![],
            cameras: vec![],
            environment,
            probes: vec![],
            exposure_ev: 0.0,
        };
        LightmapNeed::new(&scene, Model::Everything, None).side
    }

    #[test]
    fn a_lone_ball_has_no_soft_light_of_its_own() {
        let environment = Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees: 0.0 };
        let placed = |x: f32| Instance { mesh: 0, world_from_local: Mat4::from_translation(Vec3::new(x, 0.0, 0.0)) };
        let mut scene = Scene {
            meshes: vec![Mesh::ball(12, 1.0)],
            instances: vec![placed(0.0)],
            materials: vec![crate::scene::material::default_material()],
            sources: vec![],
            textures: vec![],
            lights: vec![],
            cameras: vec![],
            environment,
            probes: vec![],
            exposure_ev: 0.0,
        };
        assert!(needs_no_lightmap(&scene, Model::Needed).is_some());
        assert!(needs_no_lightmap(&scene, Model::Everything).is_none());
        scene.instances.push(placed(3.0));
        assert!(needs_no_lightmap(&scene, Model::Needed).is_none());
    }

    #[test]
    fn more_surface_in_the_same_place_needs_more() {
        // A ball covers π times its diagonal's square over 3: 300 · sqrt(π / 3 / 0.8) = 343 texels, and for n of them
        // sqrt(n) times as many.
        assert_eq!([1, 2, 3, 8, 10, 30, 40, 1000].map(|n| side(n, 1.0)), [384, 512, 768, 1024, 1536, 2048, 2048, 2048]);
        assert_eq!([1e-3, 1.0, 1e3].map(|scale| side(1, scale)), [384; 3], "at whatever scale");
        assert_eq!([side(0, 1.0), side(1, 0.0), side(1, f32::NAN), side(1, f32::INFINITY)], [64; 4], "no extent");
    }
}
