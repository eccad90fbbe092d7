//! Directions of cube maps and panoramas, and solid angles of their texels, in f64: twins of `glsl/cube.glsl`.

use std::f64::consts::{FRAC_1_PI, PI, TAU};

use glam::{DVec2, DVec3};

use super::math::TINY;

/// Unit direction of point st in [0, 1]² (from the top left) of a face: the inverse of the Vulkan specification's table
/// "Cube map face and coordinate selection"; faces 0 to 5 are +X, −X, +Y, −Y, +Z, and anything else −Z.
pub fn cube_direction(face: u32, st: DVec2) -> DVec3 {
    let p = 2.0 * st - DVec2::ONE;
    let d = match face {
        0 => DVec3::new(1.0, -p.y, -p.x),
        1 => DVec3::new(-1.0, -p.y, p.x),
        2 => DVec3::new(p.x, 1.0, p.y),
        3 => DVec3::new(p.x, -1.0, -p.y),
        4 => DVec3::new(p.x, -p.y, 1.0),
        _ => DVec3::new(-p.x, -p.y, -1.0),
    };
    d.normalize()
}

/// Face and point st of direction d (of any length but 0); ties go to z, then y, as in the specification.
pub fn cube_face(d: DVec3) -> (u32, DVec2) {
    let a = d.abs();
    let (face, p, major) = if a.z >= a.x && a.z >= a.y {
        if d.z < 0.0 { (5, DVec2::new(-d.x, -d.y), a.z) } else { (4, DVec2::new(d.x, -d.y), a.z) }
    } else if a.y >= a.x {
        if d.y < 0.0 { (3, DVec2::new(d.x, -d.z), a.y) } else { (2, DVec2::new(d.x, d.z), a.y) }
    } else if d.x < 0.0 {
        (1, DVec2::new(d.z, -d.y), a.x)
    } else {
        (0, DVec2::new(-d.z, -d.y), a.x)
    };
    (face, 0.5 * p / major + DVec2::splat(0.5))
}

/// Solid angle in sr of the triangle with corners a, b, c, given their triple product:
/// Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle" (1983), eq. 8.
fn triangle_solid_angle(a: DVec3, b: DVec3, c: DVec3, triple: f64) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    2.0 * triple.atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
}

/// Solid angle in sr of texel (x, y) of a face of size² texels, exactly: two triangles, whose triple product is the
/// texel's area.
pub fn cube_texel_solid_angle(texel: [u32; 2], size: u32) -> f64 {
    let side = 2.0 / f64::from(size);
    let at = |x: f64, y: f64| DVec3::new(x * side - 1.0, y * side - 1.0, 1.0);
    let [x, y] = texel.map(f64::from);
    let (a, b, c, d) = (at(x, y), at(x + 1.0, y), at(x + 1.0, y + 1.0), at(x, y + 1.0));
    triangle_solid_angle(a, b, c, side * side) + triangle_solid_angle(a, c, d, side * side)
}

/// Panorama coordinates of direction d of any length: u = atan2(z, x)/2π + ½, v from the top = ½ − asin(y)/π.
/// u and v are in [0, 1]; straight up and down, where atan2(0, 0) is undefined, u is ½.
pub fn panorama_uv(d: DVec3) -> DVec2 {
    let across = d.x.hypot(d.z);
    let x = if across > 0.0 { d.x } else { 1.0 };
    DVec2::new(d.z.atan2(x) / TAU + 0.5, 0.5 - d.y.atan2(across.max(TINY)) * FRAC_1_PI)
}

/// Unit direction of panorama coordinates (u, v), v from the top.
pub fn panorama_direction(uv: DVec2) -> DVec3 {
    let (sin_longitude, cos_longitude) = ((uv.x - 0.5) * TAU).sin_cos();
    let (sin_latitude, cos_latitude) = ((0.5 - uv.y) * PI).sin_cos();
    DVec3::new(cos_latitude * cos_longitude, sin_latitude, cos_latitude * sin_longitude)
}

/// Solid angle in sr of a texel in `row` of a panorama of size [width, height], exactly: the zone between two
/// latitudes.
pub fn panorama_texel_solid_angle(row: u32, size: [u32; 2]) -> f64 {
    let step_radians = PI / f64::from(size[1]);
    let polar = (f64::from(row) + 0.5) * step_radians;
    4.0 * PI / f64::from(size[0]) * polar.sin() * (0.5 * step_radians).sin()
}

/// d rotated about +Y by an angle given as (cosine, sine), counter-clockwise seen from above.
/// A panorama rotated by θ is looked up with the direction rotated by −θ.
pub fn rotate_y(d: DVec3, cos_sin: DVec2) -> DVec3 {
    DVec3::new(cos_sin.x * d.x + cos_sin.y * d.z, d.y, cos_sin.x * d.z - cos_sin.y * d.x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directions() -> impl Iterator<Item = DVec3> {
        (0..2000).map(|i| {
            let (z, phi) = (1.0 - (f64::from(i) + 0.5) / 1000.0, f64::from(i) * 2.4);
            let across = (1.0 - z * z).sqrt();
            DVec3::new(across * phi.cos(), across * phi.sin(), z)
        })
    }

    #[test]
    fn axes_hit_the_centres_of_their_faces() {
        for (face, axis) in [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z].into_iter().enumerate() {
            assert_eq!(cube_face(axis * 3.0), (face as u32, DVec2::splat(0.5)));
            assert_eq!(cube_direction(face as u32, DVec2::splat(0.5)), axis);
        }
        // The specification's table, row by row: sc and tc grow along these axes.
        let right = [-DVec3::Z, DVec3::Z, DVec3::X, DVec3::X, DVec3::X, -DVec3::X];
        let down = [-DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z, -DVec3::Y, -DVec3::Y];
        for face in 0..6 {
            let middle = cube_direction(face, DVec2::splat(0.5));
            let step = |x, y| cube_direction(face, DVec2::new(x, y)) - middle;
            assert!(step(0.6, 0.5).dot(right[face as usize]) > 0.1, "face {face} to the right");
            assert!(step(0.5, 0.6).dot(down[face as usize]) > 0.1, "face {face} downwards");
        }
    }

    #[test]
    fn cube_directions_come_back() {
        for d in directions() {
            let (face, st) = cube_face(d * 7.5);
            assert!(cube_direction(face, st).abs_diff_eq(d, 1e-14), "{d}");
            assert!(st.min_element() >= 0.0 && st.max_element() <= 1.0);
        }
        for face in 0..6 {
            for (s, t) in [(0.01, 0.01), (0.99, 0.3), (0.5, 0.999)] {
                let (again, st) = cube_face(cube_direction(face, DVec2::new(s, t)));
                assert!(again == face && st.abs_diff_eq(DVec2::new(s, t), 1e-14), "face {face} {st}");
            }
        }
    }

    #[test]
    fn solid_angles_sum_to_the_sphere() {
        for size in [1, 2, 7, 128] {
            let sum: f64 = (0..size * size).map(|i| cube_texel_solid_angle([i % size, i / size], size)).sum();
            assert!((6.0 * sum / (4.0 * PI) - 1.0).abs() < 1e-12, "cube of {size}: {sum}");
        }
        for size in [[1, 1], [4, 2], [37, 11], [1024, 512]] {
            let sum: f64 = (0..size[1]).map(|row| panorama_texel_solid_angle(row, size) * f64::from(size[0])).sum();
            assert!((sum / (4.0 * PI) - 1.0).abs() < 1e-12, "panorama of {size:?}: {sum}");
        }
    }

    /// Case 12 of tests/gpu/stability.rs.
    #[test]
    fn corner_texels_are_small_and_exact_in_f32() {
        let ratio = cube_texel_solid_angle([0, 0], 128) / cube_texel_solid_angle([64, 64], 128);
        assert!((ratio - 0.196).abs() < 1e-3, "{ratio}");

        let naive = |size: u32| {
            let area = |x: f32, y: f32| (x * y).atan2((x * x + y * y + 1.0).sqrt());
            let at = |i: u32| i as f32 * (2.0 / size as f32) - 1.0;
            let (lo, hi) = (at(0), at(1));
            area(lo, lo) - area(lo, hi) - area(hi, lo) + area(hi, hi)
        };
        let ours = |size: u32| {
            let side = 2.0 / size as f32;
            let at = |x: f32, y: f32| glam::Vec3::new(x * side - 1.0, y * side - 1.0, 1.0);
            let triangle = |a: glam::Vec3, b: glam::Vec3, c: glam::Vec3| {
                let (la, lb, lc) = (a.length(), b.length(), c.length());
                2.0 * (side * side).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
            };
            let (a, b, c, d) = (at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0));
            triangle(a, b, c) + triangle(a, c, d)
        };
        let truth = cube_texel_solid_angle([0, 0], 2048);
        let error = |value: f32| (f64::from(value) / truth - 1.0).abs();
        assert!(error(naive(2048)) > 0.01, "the difference of corner terms no longer cancels: {}", error(naive(2048)));
        assert!(error(ours(2048)) < 1e-6, "{}", error(ours(2048)));
    }

    #[test]
    fn panorama_directions_come_back() {
        for d in directions() {
            let uv = panorama_uv(d * 0.01);
            assert!(panorama_direction(uv).abs_diff_eq(d, 1e-14), "{d}");
            let asin = DVec2::new(d.z.atan2(d.x) / TAU + 0.5, 0.5 - d.y.asin() / PI);
            assert!(uv.abs_diff_eq(asin, 1e-12), "{uv} against {asin}");
        }
        assert_eq!(panorama_uv(DVec3::X), DVec2::splat(0.5));
        assert_eq!(panorama_uv(DVec3::Z), DVec2::new(0.75, 0.5));
        assert_eq!(panorama_uv(-DVec3::Z), DVec2::new(0.25, 0.5));
    }

    /// Case 11 of tests/gpu/stability.rs.
    #[test]
    fn poles_are_defined() {
        assert!((1.000_000_1f32).asin().is_nan(), "asin above 1 is no longer NaN");
        assert_eq!(panorama_uv(DVec3::Y), DVec2::new(0.5, 0.0));
        assert_eq!(panorama_uv(-DVec3::Y), DVec2::new(0.5, 1.0));
        assert_eq!(panorama_uv(DVec3::new(-0.0, 1.000_000_1, -0.0)), DVec2::new(0.5, 0.0));
        assert!(panorama_uv(DVec3::ZERO).is_finite());

        // asin loses half its digits beside the pole; atan2 does not.
        let (sin, cos) = 1e-4f64.sin_cos();
        let (asin, atan) = ((cos as f32).asin(), (cos as f32).atan2(sin as f32));
        let error = |latitude: f32| (PI / 2.0 - f64::from(latitude) - 1e-4).abs();
        assert!(error(asin) > 1e-5 && error(atan) < 2e-7, "{} and {}", error(asin), error(atan));

        // A white spot of one row at the pole of 512: its share of the sphere, not of the texels.
        let ratio = panorama_texel_solid_angle(0, [1024, 512]) / panorama_texel_solid_angle(256, [1024, 512]);
        assert!((ratio - 0.003).abs() < 1e-4, "{ratio}");
    }

    #[test]
    fn rotation_is_counter_clockwise_from_above() {
        let quarter = DVec2::new(0.0, 1.0);
        assert_eq!(rotate_y(DVec3::X, quarter), -DVec3::Z);
        assert_eq!(rotate_y(DVec3::Z, quarter), DVec3::X);
        assert_eq!(rotate_y(DVec3::Y, quarter), DVec3::Y);
        let truth = glam::DMat3::from_rotation_y(0.3) * DVec3::new(1.0, 2.0, 3.0);
        assert!(rotate_y(DVec3::new(1.0, 2.0, 3.0), DVec2::new(0.3f64.cos(), 0.3f64.sin())).abs_diff_eq(truth, 1e-14));
    }
}
