//! The texture levels that a picture from a known viewpoint can read.

use glam::{Mat4, Vec2, Vec3};
use rayon::prelude::*;

use crate::asset::MipChain;
use crate::scene::{MAPS, Mesh, Scene};

/// Position and resolution of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// World space, metres.
    pub position: Vec3,
    /// Largest distance of an eye from it, metres.
    pub around_metres: f32,
    /// Tangent of the angle that the smallest pixel spans, seen from the eye; the sides of its square.
    pub pixel_tangent: f32,
}

impl Viewpoint {
    /// For a frustum with these tangents (left, right, down, up) over `size` pixels.
    ///
    /// Pixels are equal on the image plane; seen from the eye those in the corner are smaller by the squared cosine.
    pub fn new(position: Vec3, around_metres: f32, tangents: [f32; 4], size: [u32; 2]) -> Self {
        let [left, right, down, up] = tangents;
        let corner = Vec2::new(left.abs().max(right.abs()), down.abs().max(up.abs()));
        let pixel = ((right - left) / size[0] as f32).min((up - down) / size[1] as f32);
        Self { position, around_metres, pixel_tangent: pixel / (1.0 + corner.length_squared()) }
    }
}

/// Half a level for what hardware rounds, and for derivatives that are differences between neighbouring pixels.
const MARGIN_LEVELS: f32 = 0.5;

/// For each of the scene's textures, the finest level that a picture from the viewpoint may read.
///
/// A pixel's footprint on a triangle is no smaller than `pixel_tangent` times the distance to its box, in any
/// direction; so its shorter axis spans at least that times the smallest texel density of the triangle's texture
/// coordinates. Anisotropic filtering takes its level from the shorter axis, or from something longer.
pub fn first_levels(scene: &Scene, viewpoint: Viewpoint) -> Vec<u32> {
    let nearest = scene.instances.par_iter().map(|instance| {
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        let maps = material.maps();
        let sizes = maps.map(|map| map.map_or(Vec2::ZERO, |map| side(&scene.textures[map])));
        // Whose second coordinates are not looked at stay whole.
        let mut footprints = footprints(mesh, instance.world_from_local, sizes, viewpoint);
        for (footprint, lookup) in footprints.iter_mut().zip(material.lookups) {
            *footprint = if lookup.second_uv { 0.0 } else { *footprint };
        }
        (maps, footprints)
    });
    let mut least = vec![f32::INFINITY; scene.textures.len()];
    for (maps, footprints) in nearest.collect::<Vec<_>>() {
        for (map, footprint) in maps.into_iter().zip(footprints) {
            if let Some(map) = map {
                least[map] = least[map].min(footprint);
            }
        }
    }
    least.into_iter().zip(&scene.textures).map(|(texels, texture)| first_level(texels, texture)).collect()
}

fn side(texture: &MipChain) -> Vec2 {
    Vec2::new(texture.width as f32, texture.height as f32)
}

/// The level at which this many texels of level 0 along the shorter axis of a footprint are less than one.
fn first_level(texels: f32, texture: &MipChain) -> u32 {
    let last = texture.levels.len().saturating_sub(1) as u32;
    // A texture that is not visible keeps its last level; `as` saturates.
    ((texels.log2() - MARGIN_LEVELS).max(0.0).floor() as u32).min(last)
}

/// Texels of each map under the smallest footprint on any triangle.
fn footprints(mesh: &Mesh, world_from_local: Mat4, sizes: [Vec2; MAPS], viewpoint: Viewpoint) -> [f32; MAPS] {
    let mut least = [f32::INFINITY; MAPS];
    for triangle in mesh.indices.chunks_exact(3) {
        let corners = [triangle[0], triangle[1], triangle[2]].map(|i| &mesh.vertices[i as usize]);
        let [a, b, c] = corners.map(|v| world_from_local.transform_point3(v.position.into()));
        let distance = viewpoint.position.distance(viewpoint.position.clamp(a.min(b).min(c), a.max(b).max(c)));
        let metres = (distance - viewpoint.around_metres).max(0.0) * viewpoint.pixel_tangent;
        let [ta, tb, tc] = corners.map(|v| Vec2::from(v.uv));
        for (least, size) in least.iter_mut().zip(sizes) {
            let density = smallest_density([b - a, c - a], [(tb - ta) * size, (tc - ta) * size]);
            *least = least.min(density * metres);
        }
    }
    least
}

/// Smallest singular value of the map from the triangle's plane, in metres, to texels; 0 for triangles without area,
/// which therefore keep all levels.
fn smallest_density([along, other]: [Vec3; 2], [t_along, t_other]: [Vec2; 2]) -> f32 {
    let length = along.length();
    let x = along / length;
    let height = (other - x * other.dot(x)).length();
    if !(length > 0.0 && height > 0.0) {
        return 0.0;
    }
    // Texels per metre along x, and along y in the plane.
    let per_x = t_along / length;
    let per_y = (t_other - per_x * other.dot(x)) / height;
    // The singular values' squares are the roots of s² − (|x|² + |y|²) s + det²; the smaller one as det² over the
    // larger.
    let half = 0.5 * (per_x.length_squared() + per_y.length_squared());
    let det = per_x.perp_dot(per_y);
    let larger = half + (half * half - det * det).max(0.0).sqrt();
    if larger > 0.0 { det.abs() / larger.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn density_is_the_smaller_of_two() {
        let edges = [Vec3::X * 2.0, Vec3::new(1.0, 0.0, 4.0)];
        let texels = |p: Vec3| Vec2::new(100.0 * p.x, 30.0 * p.z);
        let found = smallest_density(edges, edges.map(texels));
        assert!((found - 30.0).abs() < 1e-3, "{found}");
        // A turn of the texture changes nothing.
        let turned = smallest_density(edges, edges.map(|p| Vec2::from_angle(0.7).rotate(texels(p))));
        assert!((turned - 30.0).abs() < 1e-3, "{turned}");
        assert_eq!(smallest_density([Vec3::X, Vec3::X], [Vec2::X, Vec2::Y]), 0.0, "no area");
        assert_eq!(smallest_density([Vec3::X, Vec3::Y], [Vec2::X, Vec2::X]), 0.0, "no area in the texture");
    }

    #[test]
    fn the_smallest_pixel_is_in_the_corner() {
        let viewpoint = Viewpoint::new(Vec3::ZERO, 0.0, [-1.0, 1.0, -1.0, 1.0], [200, 100]);
        assert!((viewpoint.pixel_tangent - 0.01 / 3.0).abs() < 1e-7);
    }

    #[test]
    fn levels_below_the_footprint_are_never_read() {
        let texture = MipChain {
            name: "t".into(),
            width: 256,
            height: 256,
            format: crate::asset::ktx2::TexelFormat::Rgba8,
            levels: vec![vec![]; 9],
        };
        let level = |texels| first_level(texels, &texture);
        assert_eq!([0.0, 0.5, 1.0, 2.0, 3.0, 5.7, 1e9].map(level), [0, 0, 0, 0, 1, 2, 8]);
        assert_eq!(level(f32::INFINITY), 8, "nothing shows it");
        assert_eq!(level(f32::NAN), 0);
    }
}
