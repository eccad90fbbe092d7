//! The sun's view of a scene for its shadow map: the smallest rectangle and depths, in the sun's axes, that hold all models.

use glam::{Mat4, Vec2, Vec3, Vec4};

use super::shared::SunShadowBlock;
use crate::scene::Bounds;

/// A part of the map's side, and of its depths, that is left free at each end.
const MARGIN: f32 = 0.01;

/// World space to places in the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunView {
    /// u, v and reversed depth, each from 0 to 1.
    pub place_from_world: Mat4,
    /// Metres.
    pub size: Vec3,
}

impl SunView {
    /// A view of boxes, which are given in models' space, from a unit direction in world space.
    pub fn new(boxes: impl Iterator<Item = Bounds>, world_from_models: Mat4, towards: Vec3) -> Self {
        let across = towards.any_orthonormal_vector();
        let axes = Mat4::from_cols(across.extend(0.0), towards.cross(across).extend(0.0), towards.extend(0.0), Vec4::W);
        let sun_from_world = axes.transpose();
        let sun_from_models = sun_from_world * world_from_models;
        let placed = boxes.map(|bounds| bounds.placed(sun_from_models)).filter(|bounds| *bounds != Bounds::EMPTY);
        let all = Bounds::of(placed.flat_map(|bounds| [bounds.min, bounds.max]));
        let all = if all == Bounds::EMPTY { Bounds { min: Vec3::ZERO, max: Vec3::ZERO } } else { all };
        // What has no extent at all gets one.
        let least = 1e-5 * all.min.abs().max(all.max.abs()).max_element().max(1e-6);
        let size = (all.max - all.min).max(Vec3::splat(least)) / (1.0 - 2.0 * MARGIN);
        let first = all.centre() - 0.5 * size;
        Self { place_from_world: Mat4::from_scale(1.0 / size) * Mat4::from_translation(-first) * sun_from_world, size }
    }

    /// World space to clip space, depth reversed.
    pub fn clip_from_world(&self) -> Mat4 {
        let clip_from_place = Mat4::from_cols(2.0 * Vec4::X, 2.0 * Vec4::Y, Vec4::Z, Vec4::new(-1.0, -1.0, 0.0, 1.0));
        clip_from_place * self.place_from_world
    }

    /// As shaders read it; `tangent` of the sun's angular radius.
    pub fn block(&self, tangent: f32) -> SunShadowBlock {
        let spread = tangent * self.size.z / Vec2::new(self.size.x, self.size.y);
        SunShadowBlock { place_from_world: self.place_from_world.to_cols_array_2d(), spread: spread.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_corners_lie_in_the_map_and_what_is_nearer_to_the_sun_is_deeper() {
        let boxes = [
            Bounds { min: Vec3::new(-3.0, 0.0, -1.0), max: Vec3::new(5.0, 2.0, 1.0) },
            Bounds { min: Vec3::new(90.0, 7.0, -1.0), max: Vec3::new(91.0, 7.0, 1.0) },
            Bounds::EMPTY,
        ];
        let moved = Mat4::from_rotation_translation(glam::Quat::from_rotation_y(0.4), Vec3::new(3.0, 1.0, -2.0));
        for towards in [Vec3::Y, Vec3::new(0.6, 0.0, -0.8), Vec3::new(-1.0, 2.0, 0.5).normalize()] {
            let view = SunView::new(boxes.into_iter(), moved, towards);
            let place = |p: Vec3| view.place_from_world.transform_point3(moved.transform_point3(p));
            let corners = boxes[..2].iter().flat_map(|b| [b.min, b.max]);
            let inside = |p: Vec3| p.min_element() >= MARGIN - 1e-5 && p.max_element() <= 1.0 - MARGIN + 1e-5;
            assert!(corners.map(place).all(inside), "{towards}");
            let p = Vec3::new(1.0, 2.0, 3.0);
            let step = view.place_from_world.transform_point3(p + towards) - view.place_from_world.transform_point3(p);
            assert!((step - Vec3::Z / view.size.z).length() < 1e-5, "{towards}: {step}");
            let clip = view.clip_from_world().project_point3(p);
            let want = view.place_from_world.transform_point3(p);
            assert!((0.5 * clip.truncate() + 0.5 - want.truncate()).length() < 1e-6 && (clip.z - want.z).abs() < 1e-6);
        }
        // No extent in one axis, or nothing at all.
        for none in [&boxes[2..], &[Bounds { min: Vec3::ONE, max: Vec3::ONE }][..]] {
            assert!(SunView::new(none.iter().copied(), Mat4::IDENTITY, Vec3::Y).place_from_world.is_finite());
        }
    }
}
