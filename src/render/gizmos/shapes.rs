//! The gizmos' shapes as triangles.

use std::f32::consts::TAU;

use glam::{Mat4, Vec3};

use super::ControllerGizmos;

/// Metres.
const WAND_LENGTH: f32 = 0.12;
const WAND_RADIUS: f32 = 0.018;
const RAY_RADIUS: f32 = 0.002;
const RIBBON_WIDTH: f32 = 0.03;
const RING_RADIUS: f32 = 0.25;
const RING_WIDTH: f32 = 0.05;
/// Metres above the floor, against z-fighting.
const RING_LIFT: f32 = 0.004;
const WAND_SIDES: u16 = 12;
const RAY_SIDES: u16 = 4;
const RING_SIDES: u16 = 48;

impl ControllerGizmos {
    /// A cone in the hand that points along the pose's −Z, its tip at the pose's origin; its sides are shaded a little, to
    /// show its shape.
    pub fn wand(&mut self, world_from_hand: &Mat4, colour: Vec3) {
        let place = |p: Vec3| world_from_hand.transform_point3(p);
        let tip = place(Vec3::ZERO);
        let end = place(Vec3::Z * WAND_LENGTH);
        for (a, b, shade) in around(WAND_SIDES) {
            let rim = [a, b].map(|p| place(p * WAND_RADIUS + Vec3::Z * WAND_LENGTH));
            self.triangle([tip, rim[0], rim[1]], colour * shade);
            self.triangle([end, rim[1], rim[0]], colour * 0.4);
        }
    }

    /// A thin beam from a hand along its −Z.
    pub fn ray(&mut self, world_from_hand: &Mat4, length_metres: f32, colour: Vec3) {
        let place = |p: Vec3| world_from_hand.transform_point3(p);
        let forward = Vec3::NEG_Z * length_metres;
        for (a, b, _) in around(RAY_SIDES) {
            let (a, b) = (a * RAY_RADIUS, b * RAY_RADIUS);
            self.quad([place(a), place(b), place(b + forward), place(a + forward)], colour);
        }
    }

    /// A level ribbon along a line of points: the teleport's arc.
    pub fn ribbon(&mut self, points: &[Vec3], colour: Vec3) {
        // A vertical segment has no sideways direction of its own: it takes the last one's.
        let mut side = Vec3::X;
        let mut before: Option<[Vec3; 2]> = None;
        for (i, point) in points.iter().enumerate() {
            let (from, to) = (points[i.saturating_sub(1)], points[(i + 1).min(points.len() - 1)]);
            side = (to - from).with_y(0.0).cross(Vec3::Y).try_normalize().unwrap_or(side);
            let half = side * (0.5 * RIBBON_WIDTH);
            let edge = [*point - half, *point + half];
            if let Some([left, right]) = before {
                self.quad([left, right, edge[1], edge[0]], colour);
            }
            before = Some(edge);
        }
    }

    /// A flat ring on the floor: where the teleport would land.
    pub fn ring(&mut self, centre: Vec3, colour: Vec3) {
        let centre = centre + Vec3::Y * RING_LIFT;
        for (a, b, _) in around(RING_SIDES) {
            let at = |p: Vec3, radius: f32| centre + Vec3::new(p.x, 0.0, p.y) * radius;
            let (inner, outer) = (RING_RADIUS - RING_WIDTH, RING_RADIUS);
            self.quad([at(a, inner), at(a, outer), at(b, outer), at(b, inner)], colour);
        }
    }

    fn quad(&mut self, [a, b, c, d]: [Vec3; 4], colour: Vec3) {
        self.triangle([a, b, c], colour);
        self.triangle([a, c, d], colour);
    }
}

/// Neighbouring points of the unit circle in the plane z = 0, and how bright the side between them is, as if lit from +Y.
fn around(sides: u16) -> impl Iterator<Item = (Vec3, Vec3, f32)> {
    let at = move |i: u16| {
        let (y, x) = (TAU * f32::from(i) / f32::from(sides)).sin_cos();
        Vec3::new(x, y, 0.0)
    };
    (0..sides).map(move |i| {
        let (a, b) = (at(i), at(i + 1));
        (a, b, 0.7 + 0.3 * (a.y + b.y) * 0.5)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::gizmos::MAX_GIZMO_VERTICES;

    fn points(gizmos: &ControllerGizmos) -> Vec<Vec3> {
        gizmos.triangles().iter().map(|v| Vec3::from(v.position)).collect()
    }

    #[test]
    fn a_ribbon_follows_its_line_with_constant_width_and_lies_level_across() {
        let line: Vec<Vec3> = (0..20u8)
            .map(|i| Vec3::new(0.1 * f32::from(i), 1.0 - 0.003 * f32::from(i).powi(2), 0.2 * f32::from(i)))
            .collect();
        let mut gizmos = ControllerGizmos::default();
        gizmos.ribbon(&line, Vec3::ONE);
        assert_eq!(gizmos.triangles().len(), 19 * 6);
        for p in points(&gizmos) {
            let nearest = line.iter().min_by(|a, b| a.distance(p).total_cmp(&b.distance(p))).unwrap();
            assert!((nearest.distance(p) - 0.5 * RIBBON_WIDTH).abs() < 1e-5 && (nearest.y - p.y).abs() < 1e-6);
        }
    }

    #[test]
    fn a_ribbon_that_falls_straight_down_or_has_no_length_is_finite() {
        for line in [vec![], vec![Vec3::ONE], vec![Vec3::ONE; 5], vec![Vec3::Y, Vec3::ZERO, -Vec3::Y]] {
            let mut gizmos = ControllerGizmos::default();
            gizmos.ribbon(&line, Vec3::ONE);
            assert_eq!(gizmos.triangles().len(), 6 * line.len().saturating_sub(1));
            assert!(points(&gizmos).iter().all(|p| p.is_finite()));
        }
    }

    #[test]
    fn a_ring_lies_flat_around_its_centre() {
        let mut gizmos = ControllerGizmos::default();
        let centre = Vec3::new(3.0, 0.5, -2.0);
        gizmos.ring(centre, Vec3::ONE);
        for p in points(&gizmos) {
            let from = p - centre;
            let radius = from.with_y(0.0).length();
            assert!((from.y - RING_LIFT).abs() < 1e-6);
            assert!((RING_RADIUS - RING_WIDTH - 1e-5..RING_RADIUS + 1e-5).contains(&radius));
        }
    }

    #[test]
    fn a_wand_has_its_tip_at_the_hand_and_its_body_behind() {
        let mut gizmos = ControllerGizmos::default();
        let hand = Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0));
        gizmos.wand(&hand, Vec3::ONE);
        let z: Vec<f32> = points(&gizmos).iter().map(|p| p.z).collect();
        assert!(z.iter().all(|z| (3.0..3.0 + WAND_LENGTH + 1e-5).contains(z)));
        assert!(points(&gizmos).contains(&Vec3::new(1.0, 2.0, 3.0)));
        let before = gizmos.triangles().len();
        gizmos.ray(&hand, 2.0, Vec3::ONE);
        let ray = &points(&gizmos)[before..];
        assert!(ray.iter().all(|p| (1.0 - 1e-5..3.0 + 1e-5).contains(&p.z)) && ray.iter().any(|p| p.z < 1.01));
    }

    #[test]
    fn too_many_triangles_are_left_out_without_growing() {
        let mut gizmos = ControllerGizmos::default();
        let room = gizmos.triangles.capacity();
        (0..100).for_each(|_| gizmos.ring(Vec3::ZERO, Vec3::ONE));
        assert_eq!(gizmos.triangles().len(), MAX_GIZMO_VERTICES);
        assert_eq!(gizmos.triangles.capacity(), room);
        gizmos.clear();
        assert!(gizmos.triangles().is_empty() && gizmos.triangles.capacity() == room);
    }
}
