//! Culling: boxes outside of every eye's frustum, and boxes seen from outside, whose back faces are invisible.

use glam::{Vec3, Vec4};

use super::eye::Eye;
use super::shared::MAX_EYES;
use crate::scene::Bounds;

/// Margin relative to distance: a box is culled only if it is this far outside. A twentieth of a pixel (at 1000 pixels
/// across 90°) is far above the rounding of f32 and the rasteriser's 1/256 pixel.
const MARGIN: f32 = 1e-4;
/// Margin relative to the coordinates, about ten roundings of f32, for scenes far from the origin.
const ROUNDING: f32 = 1e-6;

/// The frusta of all eyes of one frame.
pub struct Frusta {
    eyes: [Frustum; MAX_EYES],
    count: usize,
}

#[derive(Clone, Copy, Default)]
struct Frustum {
    /// Left, right, down, up, near: unit normals inwards, in the world; a point p is inside where n · (p − position) ≥ w.
    planes: [Vec4; 5],
    position: Vec3,
    /// From the eye to the near plane's farthest corner.
    near_reach: f32,
}

impl Frusta {
    /// The frusta of at most [`MAX_EYES`] eyes, which may be canted.
    pub fn of(eyes: &[Eye]) -> Self {
        let mut frusta = Self { eyes: Default::default(), count: eyes.len().min(MAX_EYES) };
        frusta.eyes.iter_mut().zip(eyes).for_each(|(frustum, eye)| *frustum = Frustum::of(eye));
        frusta
    }

    /// Whether any eye may see a part of a box: conservative, never wrongly `false`.
    pub fn may_see(&self, bounds: &Bounds) -> bool {
        self.eyes[..self.count].iter().any(|eye| eye.may_see(bounds))
    }

    /// Whether every eye and its near plane are outside of a box.
    pub fn all_outside(&self, bounds: &Bounds) -> bool {
        self.eyes[..self.count].iter().all(|eye| {
            let reach = (1.0 + MARGIN) * eye.near_reach + ROUNDING * size_of_coordinates(bounds, eye.position);
            distance(bounds, eye.position) > reach
        })
    }

    /// Metres from the nearest eye to a box; 0 inside.
    pub fn distance(&self, bounds: &Bounds) -> f32 {
        self.eyes[..self.count].iter().map(|eye| distance(bounds, eye.position)).fold(f32::INFINITY, f32::min)
    }

    /// Metres from the nearest eye to the farthest corner of a box.
    pub fn reach(&self, bounds: &Bounds) -> f32 {
        self.eyes[..self.count].iter().map(|eye| reach(bounds, eye.position)).fold(f32::INFINITY, f32::min)
    }
}

/// Metres from a point to the farthest corner of a box.
fn reach(bounds: &Bounds, position: Vec3) -> f32 {
    (position - bounds.min).abs().max((position - bounds.max).abs()).length()
}

impl Frustum {
    fn of(eye: &Eye) -> Self {
        // In view space −z is forward: x lies right of the left side where x ≥ left · −z.
        let sides = [
            Vec3::new(1.0, 0.0, eye.left),
            Vec3::new(-1.0, 0.0, -eye.right),
            Vec3::new(0.0, 1.0, eye.down),
            Vec3::new(0.0, -1.0, -eye.up),
            Vec3::NEG_Z,
        ];
        let offsets = [0.0, 0.0, 0.0, 0.0, eye.near_metres];
        let world = |n: Vec3| eye.world_from_view.transform_vector3(n.normalize());
        let corner = Vec3::new(eye.left.abs().max(eye.right.abs()), eye.down.abs().max(eye.up.abs()), 1.0);
        Self {
            planes: std::array::from_fn(|i| world(sides[i]).extend(offsets[i])),
            position: eye.position(),
            near_reach: eye.near_metres * corner.length(),
        }
    }

    fn may_see(&self, bounds: &Bounds) -> bool {
        let (centre, half) = (bounds.centre() - self.position, (bounds.max - bounds.min) * 0.5);
        let margin = MARGIN * (centre.length() + half.length()) + ROUNDING * size_of_coordinates(bounds, self.position);
        !self.planes.iter().any(|plane| {
            let n = plane.truncate();
            // The corner that is farthest along the normal.
            n.dot(centre) + n.abs().dot(half) < plane.w - margin
        })
    }
}

fn distance(bounds: &Bounds, position: Vec3) -> f32 {
    position.clamp(bounds.min, bounds.max).distance(position)
}

fn size_of_coordinates(bounds: &Bounds, position: Vec3) -> f32 {
    bounds.min.abs().max(bounds.max.abs()).max(position.abs()).max_element()
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec4, Mat4, Quat};

    use super::*;
    use crate::precompute::harness_tests::Random;

    fn vec3(random: &mut Random, size: f64) -> Vec3 {
        (size * (2.0 * random.colour() - 1.0)).as_vec3()
    }

    fn turn(random: &mut Random, radians: f32) -> Quat {
        Quat::from_axis_angle(random.direction().as_vec3(), radians)
    }

    /// An eye anywhere, with a lopsided frustum.
    fn eye(random: &mut Random, reach: f64) -> Eye {
        let around = std::f32::consts::TAU * random.unit() as f32;
        let side = |random: &mut Random| (0.2 + 1.3 * random.unit()) as f32;
        Eye {
            world_from_view: Mat4::from_rotation_translation(turn(random, around), vec3(random, reach)),
            left: -side(random),
            right: side(random),
            down: -side(random),
            up: side(random),
            near_metres: 0.02 + random.unit() as f32,
        }
    }

    /// A headset's eyes: apart, turned outwards, each other's mirror images.
    fn canted(random: &mut Random, middle: Eye) -> [Eye; 2] {
        let cant = 0.15 * random.unit() as f32;
        [-1.0, 1.0].map(|side: f32| {
            let from_head =
                Mat4::from_rotation_translation(Quat::from_rotation_y(-side * cant), Vec3::X * 0.032 * side);
            let (left, right) = if side < 0.0 { (middle.left, middle.right) } else { (-middle.right, -middle.left) };
            Eye { world_from_view: middle.world_from_view * from_head, left, right, ..middle }
        })
    }

    /// By clipping it against the five planes of clip space in f64 (Sutherland and Hodgman 1974): whether anything of a
    /// triangle is left.
    fn is_visible(eye: &Eye, triangle: [Vec3; 3]) -> bool {
        let clip_from_world: DMat4 = eye.clip_from_view().as_dmat4() * eye.world_from_view.as_dmat4().inverse();
        let mut polygon: Vec<DVec4> = triangle.iter().map(|p| clip_from_world * p.as_dvec3().extend(1.0)).collect();
        let planes: [fn(&DVec4) -> f64; 5] =
            [|p| p.w + p.x, |p| p.w - p.x, |p| p.w + p.y, |p| p.w - p.y, |p| p.w - p.z];
        for inside in planes {
            let mut rest = Vec::new();
            for (i, a) in polygon.iter().enumerate() {
                let b = &polygon[(i + 1) % polygon.len()];
                let (da, db) = (inside(a), inside(b));
                if da >= 0.0 {
                    rest.push(*a);
                }
                if (da >= 0.0) != (db >= 0.0) {
                    rest.push(a.lerp(*b, da / (da - db)));
                }
            }
            polygon = rest;
        }
        !polygon.is_empty()
    }

    /// Small groups of triangles with their boxes, all over a cube of side 2 · `reach`.
    fn groups(random: &mut Random, reach: f64) -> Vec<(Bounds, Vec<[Vec3; 3]>)> {
        let group = |_| {
            let (middle, size) = (vec3(random, reach), reach * 10f64.powf(-2.0 * random.unit()));
            let corner = |random: &mut Random| middle + vec3(random, size);
            let triangles: Vec<[Vec3; 3]> = (0..12).map(|_| std::array::from_fn(|_| corner(random))).collect();
            (Bounds::of(triangles.iter().flatten().copied()), triangles)
        };
        (0..300).map(group).collect()
    }

    #[test]
    fn culling_never_drops_a_visible_triangle() {
        let mut random = Random(7);
        let (mut culled, mut visible, mut all) = (0, 0, 0);
        for camera in 0..200 {
            // Scenes of all sizes, seen from inside and outside, with one eye and with two canted ones.
            let reach = 10f64.powi(camera % 5 - 1);
            let middle = eye(&mut random, 1.5 * reach);
            let pair = canted(&mut random, middle);
            let eyes: &[Eye] = if camera % 2 == 0 { &[middle] } else { &pair };
            let frusta = Frusta::of(eyes);
            for (bounds, triangles) in groups(&mut random, reach) {
                let seen = eyes.iter().any(|eye| triangles.iter().any(|t| is_visible(eye, *t)));
                let kept = frusta.may_see(&bounds);
                assert!(kept || !seen, "camera {camera}: {bounds:?} was dropped, {eyes:?}");
                (culled, visible, all) = (culled + u32::from(!kept), visible + u32::from(seen), all + 1);
            }
        }
        assert!(visible > all / 20 && culled > all / 2, "{all} boxes, {visible} visible, {culled} culled");
    }

    #[test]
    fn a_box_is_drawn_if_only_one_eye_sees_it() {
        let middle = Eye::symmetric(Mat4::IDENTITY, 60.0, 1.0, 1.0);
        let eyes = middle.stereo(2.0);
        let at = |x: f32| Bounds::of([Vec3::new(x - 0.01, -0.01, -1.0), Vec3::new(x + 0.01, 0.01, -0.99)]);
        let sees = |x| Frusta::of(&eyes).may_see(&at(x));
        assert!(sees(-1.2) && sees(1.2) && !sees(0.0) && !sees(-2.0) && !sees(2.0));
        assert!(!Frusta::of(&eyes[..1]).may_see(&at(1.2)) && !Frusta::of(&eyes[1..]).may_see(&at(-1.2)));
    }

    #[test]
    fn eyes_are_outside_of_a_box_only_with_their_near_planes() {
        let unit = Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE };
        let outside = |z| Frusta::of(&[Eye::symmetric(Mat4::from_translation(Vec3::Z * z), 90.0, 1.0, 100.0)]);
        assert!(!outside(0.5).all_outside(&unit));
        assert!(!outside(1.03).all_outside(&unit), "the near plane's corners are 0.035 m away");
        assert!(outside(1.04).all_outside(&unit));
        assert_eq!([0.5, 3.0].map(|z| outside(z).distance(&unit)), [0.0, 2.0]);
        let far_apart = Eye::symmetric(Mat4::from_translation(Vec3::Z * 3.0), 90.0, 1.0, 100.0).stereo(0.06);
        assert!(Frusta::of(&far_apart).all_outside(&unit));
        let one_inside = Eye::symmetric(Mat4::IDENTITY, 90.0, 1.0, 100.0).stereo(3.0);
        assert!(Frusta::of(&one_inside).all_outside(&unit), "both are 1.5 m from its middle");
        assert!(!Frusta::of(&[far_apart[0], one_inside[0]].map(|e| Eye { near_metres: 0.6, ..e })).all_outside(&unit));
    }
}
