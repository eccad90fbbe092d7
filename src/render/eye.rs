//! One eye: where it is and what it sees.

use glam::{Affine3A, Mat3, Mat4, Vec3, Vec4};

use super::shared::MAX_EYES;
use crate::scene::Camera;

/// The greatest distance to the near plane, metres; the far plane is at infinity.
pub const NEAR_METRES: f32 = 0.02;
/// The greatest distance to the near plane as a part of the distance to the target, so that tiny scenes are not cut.
const NEAR_PART: f32 = 0.01;

/// Mean distance between human pupils, metres (Dodgson 2004, "Variation and extrema of human interpupillary distance").
pub const IPD_METRES: f32 = 0.063;

/// A viewpoint with its frustum. Right-handed view space, −Z forward, +Y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Rigid.
    pub world_from_view: Mat4,
    /// Tangents of the frustum's sides: left and down are usually negative.
    pub left: f32,
    pub right: f32,
    pub down: f32,
    pub up: f32,
    /// Distance to the near plane; more than 0.
    pub near_metres: f32,
}

impl Eye {
    /// A symmetric eye with a rigid `world_from_view` and a target `distance_metres` away.
    pub fn symmetric(world_from_view: Mat4, vertical_fov_degrees: f32, aspect: f32, distance_metres: f32) -> Self {
        let up = (0.5 * vertical_fov_degrees.to_radians()).tan();
        let right = up * aspect;
        let near_metres = (NEAR_PART * distance_metres).clamp(1e-12, NEAR_METRES);
        Self { world_from_view, left: -right, right, down: -up, up, near_metres }
    }

    /// A symmetric eye that looks from `position` to `target`, upright.
    pub fn looking(position: Vec3, target: Vec3, vertical_fov_degrees: f32, aspect: f32) -> Self {
        let backward = (position - target).try_normalize().unwrap_or(Vec3::Z);
        // Looking straight up or down, up is undefined: take −Z.
        let side = Vec3::Y.cross(backward).try_normalize().unwrap_or(Vec3::X);
        let axes = Mat3::from_cols(side, backward.cross(side), backward);
        let world_from_view = Mat4::from(Affine3A::from_mat3_translation(axes, position));
        Self::symmetric(world_from_view, vertical_fov_degrees, aspect, position.distance(target))
    }

    /// The eye of a scene's camera.
    pub fn of_camera(camera: &Camera, aspect: f32) -> Self {
        Self::looking(camera.position, camera.target, camera.vertical_fov_degrees, aspect)
    }

    /// Maps each of at most [`MAX_EYES`] eyes; unused elements repeat the first eye's result.
    pub(super) fn each(eyes: &[Self], change: impl Fn(&Self) -> Self) -> [Self; MAX_EYES] {
        std::array::from_fn(|i| change(eyes.get(i).unwrap_or(&eyes[0])))
    }

    /// A left and a right eye with parallel axes, `ipd` metres apart about this one.
    pub fn stereo(self, ipd_metres: f32) -> [Self; 2] {
        [-0.5, 0.5].map(|half| {
            let offset = Mat4::from_translation(Vec3::X * (half * ipd_metres));
            Self { world_from_view: self.world_from_view * offset, ..self }
        })
    }

    /// The part of it that one pixel of a picture shows, counted from the upper left corner.
    pub fn of_pixel(&self, [x, y]: [u32; 2], [width, height]: [u32; 2]) -> Self {
        let column = |x: u32| self.left + (self.right - self.left) * x as f32 / width as f32;
        let row = |y: u32| self.up + (self.down - self.up) * y as f32 / height as f32;
        Self { left: column(x), right: column(x + 1), up: row(y), down: row(y + 1), ..*self }
    }

    /// Position in world space, metres.
    pub fn position(&self) -> Vec3 {
        self.world_from_view.w_axis.truncate()
    }

    /// Vulkan clip space (y down), depth reversed: 1 at the near plane, 0 at infinity.
    pub fn clip_from_view(&self) -> Mat4 {
        let (width, height) = (self.right - self.left, self.up - self.down);
        // Columns; rows are those of Vulkan's y-down clip space with w = −z.
        Mat4::from_cols(
            Vec4::new(2.0 / width, 0.0, 0.0, 0.0),
            Vec4::new(0.0, -2.0 / height, 0.0, 0.0),
            Vec4::new((self.right + self.left) / width, -(self.up + self.down) / height, 0.0, -1.0),
            Vec4::new(0.0, 0.0, self.near_metres, 0.0),
        )
    }

    /// World space to clip space.
    pub fn clip_from_world(&self) -> Mat4 {
        self.clip_from_view() * self.world_from_view.inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ndc(eye: &Eye, world: Vec3) -> Vec3 {
        let clip = eye.clip_from_world() * world.extend(1.0);
        clip.truncate() / clip.w
    }

    #[test]
    fn the_frustum_maps_to_the_clip_square() {
        let eye = Eye {
            world_from_view: Mat4::IDENTITY,
            left: -1.5,
            right: 0.5,
            down: -0.25,
            up: 0.75,
            near_metres: NEAR_METRES,
        };
        let corner = |x, y| ndc(&eye, Vec3::new(x, y, -1.0) * 3.0);
        assert!((corner(-1.5, 0.75) - Vec3::new(-1.0, -1.0, NEAR_METRES / 3.0)).length() < 1e-6);
        assert!((corner(0.5, -0.25) - Vec3::new(1.0, 1.0, NEAR_METRES / 3.0)).length() < 1e-6);
    }

    #[test]
    fn depth_is_one_at_the_near_plane_and_zero_far_away() {
        let eye = Eye::looking(Vec3::ZERO, 5.0 * Vec3::NEG_Z, 60.0, 1.0);
        assert!((ndc(&eye, Vec3::new(0.0, 0.0, -NEAR_METRES)).z - 1.0).abs() < 1e-6);
        assert!(ndc(&eye, Vec3::new(0.0, 0.0, -1e9)).z < 1e-9);
    }

    #[test]
    fn scenes_of_any_size_lie_behind_the_near_plane() {
        for distance in [1e-4, 0.01, 1.0, 1e6] {
            let eye = Eye::looking(Vec3::ZERO, Vec3::new(0.0, 0.0, -distance), 60.0, 1.0);
            let depth = ndc(&eye, Vec3::new(0.0, 0.0, -0.5 * distance)).z;
            assert!(depth > 0.0 && depth < 1.0, "{distance} m: depth {depth}");
        }
    }

    #[test]
    fn looking_puts_the_target_in_the_middle_and_keeps_the_picture_upright() {
        for (position, target) in [(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO), (Vec3::Y, Vec3::ZERO), (Vec3::ZERO, Vec3::Y)]
        {
            let eye = Eye::looking(position, target, 45.0, 1.5);
            assert!(ndc(&eye, target).truncate().length() < 1e-5);
            let axes = Mat3::from_mat4(eye.world_from_view);
            assert!((axes.determinant() - 1.0).abs() < 1e-5);
            assert!(axes.y_axis.y >= -1e-6);
        }
    }

    #[test]
    fn a_pixel_of_an_eye_shows_what_the_eye_shows_there() {
        let eye =
            Eye { left: -1.5, right: 0.5, down: -0.25, up: 0.75, ..Eye::looking(Vec3::ONE, Vec3::ZERO, 50.0, 1.0) };
        let size = [20, 10];
        for pixel in [[0, 0], [19, 9], [7, 3]] {
            // The pixel's centre in the picture, from -1 to 1, and back into the world.
            let centre = [0, 1].map(|i| (2.0 * pixel[i] as f32 + 1.0) / size[i] as f32 - 1.0);
            let world = eye.clip_from_world().inverse() * Vec4::new(centre[0], centre[1], 0.5, 1.0);
            let seen = ndc(&eye.of_pixel(pixel, size), world.truncate() / world.w);
            assert!(seen.truncate().length() < 1e-3, "{pixel:?}: {seen}");
        }
    }

    #[test]
    fn stereo_eyes_are_an_ipd_apart_along_x_of_the_view() {
        let eye = Eye::looking(Vec3::new(0.0, 1.0, 2.0), Vec3::new(3.0, 1.0, -1.0), 45.0, 1.0);
        let [left, right] = eye.stereo(IPD_METRES);
        let apart = right.position() - left.position();
        assert!((apart.length() - IPD_METRES).abs() < 1e-6);
        assert!(apart.dot(eye.world_from_view.x_axis.truncate()) > 0.999 * IPD_METRES);
    }
}
