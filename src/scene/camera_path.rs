//! Ways of a camera through a sequence of pictures: around its target, and along named cameras.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DQuat, DVec3};

use super::Camera;
use crate::{Error, Result};

/// Horizontal parts of directions below this count as none; the least distance of two knots.
const EPSILON: f64 = 1e-6;

/// `count` cameras around the target of `camera`, the first of them itself: evenly, counter-clockwise seen from above.
pub fn turntable(camera: &Camera, count: u32) -> Vec<Camera> {
    let from_target = (camera.position - camera.target).as_dvec3();
    let at = |i: u32| {
        let turn = DQuat::from_rotation_y(TAU * f64::from(i) / f64::from(count.max(1)));
        Camera { position: camera.target + (turn * from_target).as_vec3(), ..camera.clone() }
    };
    // The first one exactly.
    std::iter::once(camera.clone()).chain((1..count).map(at)).collect()
}

/// `count` cameras from the first to the last of `names`: a centripetal Catmull-Rom spline (C. Yuksel, S. Schaefer, J. Keyser,
/// "Parameterization and applications of Catmull-Rom curves", Computer-Aided Design 43, 2011), which has neither cusps nor
/// loops between two cameras, by the pyramid of P. J. Barry and R. N. Goldman (SIGGRAPH 1988).
///
/// # Errors
/// [`Error::UnknownName`]; fewer than two names.
pub fn along(cameras: &[Camera], names: &[String], count: u32) -> Result<Vec<Camera>> {
    if names.len() < 2 {
        return Err(Error::Usage("a path leads along two cameras or more, such as `--path front,side`".into()));
    }
    let known = || cameras.iter().map(|camera| camera.name.clone()).collect();
    let mut poses: Vec<Pose> = Vec::new();
    for name in names {
        let found = cameras.iter().find(|camera| camera.name == *name);
        let unknown = || Error::UnknownName { what: "camera", name: name.clone(), known: known() };
        poses.push(Pose::of(found.ok_or_else(unknown)?, poses.last()));
    }
    let spline = Spline::new(&poses);
    let last = f64::from(count.saturating_sub(1).max(1));
    Ok((0..count).map(|i| spline.at(f64::from(i) / last).camera(i)).collect())
}

/// A camera by what is interpolated: x, y, z; yaw and pitch, radians; logarithms of the distance to the target and of the
/// tangent of half the vertical field of view. Cameras are upright, so that two angles are all of a direction, and a camera
/// that looks back turns about the vertical.
#[derive(Clone, Copy, Debug)]
struct Pose([f64; 7]);

impl Pose {
    /// `before`: the camera that it comes after, from which it turns the shorter way.
    fn of(camera: &Camera, before: Option<&Self>) -> Self {
        let (position, target) = (camera.position.as_dvec3(), camera.target.as_dvec3());
        let distance = position.distance(target).max(f64::from(f32::MIN_POSITIVE));
        let direction = (target - position).try_normalize().unwrap_or(DVec3::NEG_Z);
        let yaw_before = before.map_or(0.0, |before| before.0[3]);
        // Straight up and down there is no yaw.
        let is_steep = direction.x.hypot(direction.z) < EPSILON;
        let yaw = if is_steep { yaw_before } else { (-direction.x).atan2(-direction.z) };
        let turns = ((yaw - yaw_before) / TAU).round();
        let log_tangent = (0.5 * f64::from(camera.vertical_fov_degrees).to_radians()).tan().ln();
        let [x, y, z] = position.to_array();
        Self([x, y, z, yaw - turns * TAU, direction.y.clamp(-1.0, 1.0).asin(), distance.ln(), log_tangent])
    }

    fn camera(&self, index: u32) -> Camera {
        let [x, y, z, yaw, pitch, log_distance, log_tangent] = self.0;
        // A curve may swing a little beyond.
        let pitch = pitch.clamp(-FRAC_PI_2, FRAC_PI_2);
        let direction = DQuat::from_rotation_y(yaw) * DQuat::from_rotation_x(pitch) * DVec3::NEG_Z;
        let position = DVec3::new(x, y, z);
        Camera {
            name: format!("path {index}"),
            position: position.as_vec3(),
            target: (position + direction * log_distance.exp()).as_vec3(),
            vertical_fov_degrees: (2.0 * log_tangent.exp().atan()).to_degrees() as f32,
        }
    }

    /// At 0 this one, at 1 the other; beyond, further on the same way.
    fn lerp(&self, other: &Self, t: f64) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + (other.0[i] - self.0[i]) * t))
    }

    fn distance(&self, other: &Self) -> f64 {
        (0..3).map(|i| (self.0[i] - other.0[i]).powi(2)).sum::<f64>().sqrt()
    }

    /// How different two cameras are: the square root of their distance in units of `metres`, plus the angles and the change of
    /// the field of view. 0 only for equal ones, so that a camera that turns on the spot takes its time, too.
    fn span(&self, other: &Self, metres: f64) -> f64 {
        let moved = if metres > 0.0 { self.distance(other) / metres } else { 0.0 };
        let [yaw, pitch, log_tangent] = [3, 4, 6].map(|i| self.0[i] - other.0[i]);
        (moved + yaw.hypot(pitch) + log_tangent.abs()).sqrt()
    }
}

/// The spline through all poses.
struct Spline {
    /// With one more at either end, as far beyond as the next one lies within.
    poses: Vec<Pose>,
    /// The parameter at each pose, increasing.
    knots: Vec<f64>,
}

impl Spline {
    /// Of two poses or more.
    fn new(through: &[Pose]) -> Self {
        let steps = through.windows(2).map(|pair| pair[0].distance(&pair[1]));
        let metres = steps.sum::<f64>() / (through.len() - 1) as f64;
        let last = through.len() - 1;
        let before = through[0].lerp(&through[1], -1.0);
        let after = through[last].lerp(&through[last - 1], -1.0);
        let poses: Vec<Pose> = std::iter::once(before).chain(through.iter().copied()).chain([after]).collect();
        let mut knots = vec![0.0];
        for pair in poses.windows(2) {
            // Equal ones are a moment apart.
            knots.push(knots[knots.len() - 1] + pair[0].span(&pair[1], metres).max(EPSILON));
        }
        Self { poses, knots }
    }

    /// `part`: 0 at the first, 1 at the last pose.
    fn at(&self, part: f64) -> Pose {
        let (poses, knots) = (&self.poses, &self.knots);
        let last = poses.len() - 2;
        let t = knots[1] + part.clamp(0.0, 1.0) * (knots[last] - knots[1]);
        // The pose before t, which is neither of the additional ones nor the last.
        let i = knots[2..last].partition_point(|knot| *knot <= t) + 1;
        let between = |a: (Pose, usize), b: (Pose, usize)| a.0.lerp(&b.0, (t - knots[a.1]) / (knots[b.1] - knots[a.1]));
        let [p0, p1, p2, p3] = [i - 1, i, i + 1, i + 2].map(|i| (poses[i], i));
        let [a1, a2, a3] = [between(p0, p1), between(p1, p2), between(p2, p3)];
        let b1 = between((a1, i - 1), (a2, i + 1));
        let b2 = between((a2, i), (a3, i + 2));
        between((b1, i), (b2, i + 1))
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn camera(name: &str, position: [f32; 3], target: [f32; 3], fov: f32) -> Camera {
        let (position, target) = (position.into(), target.into());
        Camera { name: name.into(), position, target, vertical_fov_degrees: fov }
    }

    fn four() -> Vec<Camera> {
        vec![
            camera("a", [0.0, 1.0, 5.0], [0.0, 1.0, 0.0], 45.0),
            camera("b", [4.0, 2.0, 3.0], [0.0, 1.0, 0.0], 30.0),
            camera("c", [4.0, 2.0, 3.0], [9.0, 2.0, 3.0], 60.0),
            camera("d", [5.0, 0.5, -20.0], [0.0, 0.0, 0.0], 60.0),
        ]
    }

    fn path(names: &[&str], count: u32) -> Result<Vec<Camera>> {
        along(&four(), &names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>(), count)
    }

    fn assert_near(a: &Camera, b: &Camera) {
        let near = (a.position - b.position).length() < 1e-4 && (a.target - b.target).length() < 1e-3;
        assert!(near && (a.vertical_fov_degrees - b.vertical_fov_degrees).abs() < 1e-3, "{a:?} instead of {b:?}");
    }

    #[test]
    fn a_turntable_keeps_distance_and_height_and_comes_around() {
        let [start, ..] = &four()[..] else { unreachable!("four cameras") };
        let all = turntable(start, 8);
        assert_eq!((all.len(), &all[0]), (8, start));
        // Counter-clockwise seen from above takes +Z to +X.
        assert!((all[2].position - Vec3::new(5.0, 1.0, 0.0)).length() < 1e-5, "{:?}", all[2]);
        assert!(all.iter().all(|c| c.target == start.target && (c.position.distance(c.target) - 5.0).abs() < 1e-5));
        assert_eq!(turntable(start, 1), std::slice::from_ref(start));
    }

    #[test]
    fn a_path_passes_its_cameras_from_the_first_to_the_last() {
        let all = path(&["a", "b", "d"], 1001).unwrap();
        assert_near(&all[0], &four()[0]);
        assert_near(&all[1000], &four()[3]);
        let nearest = all.iter().map(|c| c.position.distance(four()[1].position)).fold(f32::INFINITY, f32::min);
        assert!(nearest < 0.05, "b is missed by {nearest}");
        assert_near(&path(&["d", "a"], 1).unwrap()[0], &four()[3]);
    }

    /// Also where it turns on the spot, looks back, passes a camera twice, or stands still.
    #[test]
    fn a_path_has_no_jumps() {
        for names in [&["a", "b", "c", "d"][..], &["b", "c"], &["a", "a", "b"], &["a", "d", "a"], &["c", "c"]] {
            let all = path(names, 2001).unwrap();
            let length: f32 = all.windows(2).map(|p| p[0].position.distance(p[1].position)).sum();
            for pair in all.windows(2) {
                let forward = |c: &Camera| (c.target - c.position).normalize();
                assert!(pair[0].position.distance(pair[1].position) <= 0.01 * length + 1e-6, "{names:?}: {pair:?}");
                assert!(forward(&pair[0]).angle_between(forward(&pair[1])) < 0.02, "{names:?}: {pair:?}");
            }
        }
        let back = camera("back", [0.0, 1.0, 5.0], [0.0, 1.0, 9.0], 45.0);
        let both = [four()[0].clone(), back];
        let all = along(&both, &["a".into(), "back".into()], 11).unwrap();
        let middle = (all[5].target - all[5].position).normalize();
        assert!(middle.y.abs() < 1e-5 && middle.x.abs() > 0.999, "it turns about the vertical: {middle}");
    }

    #[test]
    fn what_is_no_path_is_told() {
        assert!(path(&["a"], 5).unwrap_err().to_string().contains("two cameras"));
        let error = path(&["a", "z"], 5).unwrap_err().to_string();
        assert!(error.contains("`z`") || error.contains('z') && error.contains("a, b, c, d"), "{error}");
    }
}
