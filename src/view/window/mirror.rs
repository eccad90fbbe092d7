//! What a headset's mirror window shows: a calm camera's view, or the eyes' pictures.

use glam::{DMat3, DVec3, Mat3, Vec3};

use crate::render::MirrorPart;
use crate::view::Mirror;
use crate::view::headset::{Session, Steady};

/// Bytes of a pixel of a screenshot.
const PIXEL: usize = 4;

/// What a mirror shows, and the calm camera's state.
pub struct MirrorView {
    mirror: Mirror,
    steady: Steady,
}

impl MirrorView {
    /// Shows what the command line asks for.
    pub fn new(mirror: Mirror) -> Self {
        Self { mirror, steady: Steady::default() }
    }

    /// Follows a frame of the headset, shown or not; returns the parts of a window of this size, pixels.
    pub fn follow(&mut self, session: &Session, window: [u32; 2]) -> Vec<MirrorPart> {
        let [width, height] = window.map(|side| side.max(1) as f32);
        let limit = session.bounds();
        let Some(seen) = session.seen().filter(|_| self.mirror == Mirror::Steady) else {
            return parts(self.mirror, session.area(), limit, window);
        };
        let view = self.steady.follow(&seen, width / height);
        let to_limit = DMat3::from_diagonal(DVec3::new(limit[0].into(), limit[1].into(), 1.0));
        vec![MirrorPart { layer: 0, uv_from_clip: (to_limit * view.uv_from_clip(&seen.eye)).as_mat3(), limit }]
    }
}

/// The eyes' pictures, of which an area is filled, with these greatest texture coordinates: beside each other in the
/// middle, as large as possible without distortion.
fn parts(mirror: Mirror, [width, height]: [u32; 2], limit: [f32; 2], window: [u32; 2]) -> Vec<MirrorPart> {
    let layers: &[u32] = match mirror {
        Mirror::Steady | Mirror::Both => &[0, 1],
        Mirror::Left => &[0],
        Mirror::Right => &[1],
    };
    let count = layers.len() as f32;
    let [width, height, across, down] = [width, height, window[0], window[1]].map(|side| side.max(1) as f32);
    let scale = (across / (count * width)).min(down / height);
    // In clip space, 2 wide and high.
    let [part_width, part_height] = [2.0 * scale * width / across, 2.0 * scale * height / down];
    let place = |(i, layer): (u8, &u32)| {
        let corner = [(f32::from(i) - 0.5 * count) * part_width, -0.5 * part_height];
        let [u, v] = [limit[0] / part_width, limit[1] / part_height];
        let uv_from_clip = Mat3::from_cols(
            Vec3::new(u, 0.0, 0.0),
            Vec3::new(0.0, v, 0.0),
            Vec3::new(-corner[0] * u, -corner[1] * v, 1.0),
        );
        MirrorPart { layer: *layer, uv_from_clip, limit }
    };
    (0..).zip(layers).map(place).collect()
}

/// The upper left part of a picture of RGBA bytes that is `width` pixels wide.
pub fn crop(pixels: &[u8], width: u32, [part_width, part_height]: [u32; 2]) -> Vec<u8> {
    let rows = pixels.chunks_exact(PIXEL * width as usize).take(part_height as usize);
    rows.flat_map(|row| &row[..PIXEL * part_width as usize]).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a part in the window, pixels.
    fn corners(part: &MirrorPart, window: [u32; 2]) -> [f32; 4] {
        let clip_from_uv = part.uv_from_clip.inverse();
        let pixel = |u: f32, v: f32| {
            let clip = clip_from_uv * Vec3::new(u, v, 1.0);
            [0, 1].map(|i| (0.5 * clip[i] + 0.5) * window[i] as f32)
        };
        let ([x0, y0], [x1, y1]) = (pixel(0.0, 0.0), pixel(part.limit[0], part.limit[1]));
        [x0, y0, x1, y1]
    }

    fn assert_near(found: [f32; 4], expected: [f32; 4]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.01), "{found:?} instead of {expected:?}");
    }

    #[test]
    fn eyes_fit_the_window_undistorted_and_beside_each_other() {
        let both = parts(Mirror::Both, [1512, 1680], [1.0; 2], [1280, 720]);
        assert_near(corners(&both[0], [1280, 720]), [0.0, 4.444, 640.0, 715.556]);
        assert_near(corners(&both[1], [1280, 720]), [640.0, 4.444, 1280.0, 715.556]);
        let right = &parts(Mirror::Right, [1000, 1000], [0.5, 0.75], [400, 300])[0];
        assert_eq!(right.layer, 1);
        assert_near(corners(right, [400, 300]), [50.0, 0.0, 350.0, 300.0]);
    }

    #[test]
    fn no_window_is_too_small_or_too_odd() {
        for window in [[1, 1], [1, 720], [1280, 1], [3, 2], [2, 3], [0, 0]] {
            for part in parts(Mirror::Both, [1512, 1680], [1.0; 2], window) {
                assert!(part.uv_from_clip.is_finite(), "{window:?}: {part:?}");
            }
        }
    }

    #[test]
    fn screenshots_are_cropped_to_what_was_drawn() {
        let pixels: Vec<u8> = (0..3 * 2 * 4).collect();
        assert_eq!(crop(&pixels, 3, [2, 1]), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(crop(&pixels, 3, [1, 2]), [0, 1, 2, 3, 12, 13, 14, 15]);
    }
}
