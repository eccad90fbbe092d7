//! Reprojection: where a camera that is turned, but stands at the same place, finds its picture in another camera's.

use glam::{DMat3, DVec2, DVec3};

/// Tangents of a frustum's sides: left, right, down, up.
pub type Tangents = [f64; 4];

/// The homography from a turned camera's clip space (x right, y down, −1 to 1) to texture coordinates (0 to 1, v downwards) of
/// a picture with the frustum `tangents`: a turn about the common centre needs no depth (R. Hartley, A. Zisserman, "Multiple
/// View Geometry in Computer Vision", 2nd ed. 2004, section 8.4.2). `half` are the turned camera's tangents to the right
/// and upwards; both look along −Z.
pub fn homography(view_from_turned: DMat3, half: DVec2, [left, right, down, up]: Tangents) -> DMat3 {
    let turned_from_clip = DMat3::from_diagonal(DVec3::new(half.x, -half.y, -1.0));
    // (x, y, z) to (u, v) · −z.
    let (width, height) = (right - left, up - down);
    let uv_from_view = DMat3::from_cols(
        DVec3::new(1.0 / width, 0.0, 0.0),
        DVec3::new(0.0, -1.0 / height, 0.0),
        DVec3::new(left / width, -up / height, -1.0),
    );
    uv_from_view * view_from_turned * turned_from_clip
}

/// The texture coordinates at a place in clip space; `None` for what lies behind the other camera.
pub fn source(uv_from_clip: DMat3, clip: DVec2) -> Option<DVec2> {
    let q = uv_from_clip * clip.extend(1.0);
    (q.z > 0.0).then(|| q.truncate() / q.z)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    /// Rays instead of matrices.
    #[test]
    fn a_homography_finds_what_rays_find() {
        let tangents @ [left, right, down, up] = [-1.3, 1.1, -1.2, 1.4];
        let turn = DQuat::from_euler(glam::EulerRot::YXZ, 0.2, -0.1, 0.3);
        let half = DVec2::new(0.9, 0.5);
        let homography = homography(DMat3::from_quat(turn), half, tangents);
        for (x, y) in [(-1.0, -1.0), (0.3, 0.9), (1.0, -0.4), (0.0, 0.0)] {
            let ray = turn * DVec3::new(x * half.x, -y * half.y, -1.0);
            let at = DVec2::new(ray.x, ray.y) / -ray.z;
            let expected = DVec2::new((at.x - left) / (right - left), (up - at.y) / (up - down));
            let found = source(homography, DVec2::new(x, y)).expect("in front");
            assert!((found - expected).length() < 1e-12, "{found} instead of {expected}");
        }
        let back = super::homography(DMat3::from_rotation_y(std::f64::consts::PI), half, tangents);
        assert_eq!(source(back, DVec2::ZERO), None);
    }
}
