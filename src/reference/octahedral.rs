//! Octahedral unit vectors, and a vertex's normal and tangent in four 16-bit numbers: twins of `glsl/octahedral.glsl`.

use glam::{DVec2, DVec3, DVec4, Vec2Swizzles as _};

/// Largest angle between a normal and its decoded 2 · 16 bits, radians (measured: 6.4e-5). The tangent's second number
/// shares its bits with a sign: twice this.
pub const NORMAL_ERROR_RADIANS: f64 = 7e-5;

/// The 16-bit value of 1.
const STEPS: f64 = 32767.0;

/// The unit vector `d` on the octahedron unfolded to [-1, 1]²: Meyer et al., "On Floating-Point Normal Vectors" (2010),
/// section 3.
pub fn octahedral_encode(d: DVec3) -> DVec2 {
    let p = d.truncate() / (d.x.abs() + d.y.abs() + d.z.abs());
    if d.z >= 0.0 { p } else { fold(p) }
}

/// The unit vector of a point of the octahedron.
pub fn octahedral_decode(p: DVec2) -> DVec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    (if z >= 0.0 { p } else { fold(p) }).extend(z).normalize()
}

/// Maps the triangles at the square's corners to their mirror images towards the centre, and back.
fn fold(p: DVec2) -> DVec2 {
    (1.0 - p.yx().abs()) * DVec2::new(1f64.copysign(p.x), 1f64.copysign(p.y))
}

/// A vertex's normal: the first two of its frame's four numbers in [-1, 1].
pub fn frame_normal(frame: DVec4) -> DVec3 {
    octahedral_decode(frame.truncate().truncate())
}

/// Its tangent, and the bitangent's sign: of the last number, the sign is this sign, and twice the size less 1 is the
/// second coordinate.
pub fn frame_tangent(frame: DVec4) -> DVec4 {
    octahedral_decode(DVec2::new(frame.z, 2.0 * frame.w.abs() - 1.0)).extend(if frame.w < 0.0 { -1.0 } else { 1.0 })
}

/// The frame of a unit normal and a unit tangent with the bitangent's sign, each number · 32767; of the nearest numbers
/// those that give the least angle (Cigolle et al., "A Survey of Efficient Representations for Independent Unit
/// Vectors" (2014), section 3, do the same with four).
pub fn pack_frame(normal: DVec3, tangent: DVec4) -> [i16; 4] {
    let (direction, sign) = (tangent.truncate(), if tangent.w < 0.0 { -1.0 } else { 1.0 });
    let n = octahedral_encode(normal);
    let t = octahedral_encode(direction);
    let [nx, ny] = nearest(n * STEPS, |p| octahedral_decode(p / STEPS).distance_squared(normal));
    // The magnitude is at least 1, so that the sign is kept.
    let [tx, ty] = nearest(DVec2::new(t.x, 0.5 * t.y + 0.5) * STEPS, |p| match p.y {
        1.0.. => octahedral_decode(DVec2::new(p.x / STEPS, 2.0 * p.y / STEPS - 1.0)).distance_squared(direction),
        _ => f64::INFINITY,
    });
    // `nearest` stays within ± 32767.
    [nx, ny, tx, sign * ty].map(|v| v as i16)
}

/// Decoding by the GPU: signed normalised numbers.
pub fn unpack_frame(frame: [i16; 4]) -> DVec4 {
    DVec4::from_array(frame.map(|v| (f64::from(v) / STEPS).max(-1.0)))
}

/// The one of the nine integer points around `p` with the least error.
fn nearest(p: DVec2, error: impl Fn(DVec2) -> f64) -> [f64; 2] {
    let steps = [0.0, -1.0, 1.0];
    let around = steps.iter().flat_map(|x| steps.map(|y| p.round() + DVec2::new(*x, y)));
    let inside = around.filter(|q| q.abs().max_element() <= STEPS);
    inside.min_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap_or(p.round()).to_array()
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::reference::sampling::hammersley;

    /// Directions all over the sphere, with those along axes and edges of the octahedron.
    pub fn directions() -> Vec<DVec3> {
        let mut all: Vec<DVec3> = (0..1 << 15)
            .map(|i| {
                let p = hammersley(i, 15);
                let (z, around) = (2.0 * p.x - 1.0, std::f64::consts::TAU * p.y);
                let across = (1.0 - z * z).sqrt();
                DVec3::new(across * around.cos(), across * around.sin(), z)
            })
            .collect();
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    all.extend(DVec3::new(x.into(), y.into(), z.into()).try_normalize());
                }
            }
        }
        all
    }

    #[test]
    fn every_direction_comes_back() {
        for d in directions() {
            let p = octahedral_encode(d);
            assert!(p.abs().max_element() <= 1.0 + 1e-12, "{d}: {p}");
            assert!(octahedral_decode(p).distance(d) < 1e-12, "{d}");
        }
    }

    #[test]
    fn packed_frames_keep_directions_and_the_sign() {
        let (mut worst_normal, mut worst_tangent) = (0f64, 0f64);
        for normal in directions() {
            let tangent = normal.any_orthonormal_vector();
            for sign in [-1.0, 1.0] {
                let frame = unpack_frame(pack_frame(normal, tangent.extend(sign)));
                worst_normal = worst_normal.max(frame_normal(frame).distance(normal));
                let got = frame_tangent(frame);
                worst_tangent = worst_tangent.max(got.truncate().distance(tangent));
                assert_eq!(got.w, sign, "{normal}");
            }
        }
        println!("normal {worst_normal:.2e}, tangent {worst_tangent:.2e} radians");
        assert!(worst_normal < NORMAL_ERROR_RADIANS && worst_tangent < 2.0 * NORMAL_ERROR_RADIANS);
        assert!(worst_normal > 0.1 * NORMAL_ERROR_RADIANS, "the bound says nothing");
    }
}
