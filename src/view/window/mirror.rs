//! Layout of the eyes' pictures in a headset's mirror window.

use crate::gpu::{Rect, Subresource};
use crate::view::Mirror;

/// Bytes of a pixel of a screenshot.
const PIXEL: usize = 4;

/// The parts of the window that show the picture's layers: centred, as large as possible without distortion.
pub fn parts(mirror: Mirror, picture: [u32; 2], window: [u32; 2]) -> Vec<(Subresource, [Rect; 2])> {
    let layers: &[u32] = match mirror {
        Mirror::Both => &[0, 1],
        Mirror::Left => &[0],
        Mirror::Right => &[1],
    };
    let count = layers.len() as u32;
    let [width, height] = picture.map(f64::from);
    let scale = (f64::from(window[0]) / (f64::from(count) * width)).min(f64::from(window[1]) / height);
    let size = [width, height].map(|s| ((s * scale).floor() as u32).max(1));
    let left = window[0].saturating_sub(count * size[0]) / 2;
    let top = window[1].saturating_sub(size[1]) / 2;
    let onto = |i: u32| Rect { corner: [left + i * size[0], top], size };
    let place = |(i, layer): (u32, &u32)| (Subresource { mip: 0, layer: *layer }, [Rect::of(picture), onto(i)]);
    // A window of a few pixels has no room for two pictures.
    let fits = |(_, [_, onto]): &(Subresource, [Rect; 2])| (0..2).all(|i| onto.corner[i] + onto.size[i] <= window[i]);
    (0..).zip(layers).map(place).filter(fits).collect()
}

/// The upper left part of a picture of RGBA bytes that is `width` pixels wide.
pub fn crop(pixels: &[u8], width: u32, [part_width, part_height]: [u32; 2]) -> Vec<u8> {
    let rows = pixels.chunks_exact(PIXEL * width as usize).take(part_height as usize);
    rows.flat_map(|row| &row[..PIXEL * part_width as usize]).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eyes_fit_the_window_undistorted_and_beside_each_other() {
        let rects: Vec<Rect> = parts(Mirror::Both, [1512, 1680], [1280, 720]).iter().map(|(_, [_, on])| *on).collect();
        assert_eq!(rects[0], Rect { corner: [0, 4], size: [640, 711] });
        assert_eq!(rects[1], Rect { corner: [640, 4], size: [640, 711] });
        let right = &parts(Mirror::Right, [1000, 1000], [400, 300])[0];
        assert_eq!((right.0.layer, right.1[1]), (1, Rect { corner: [50, 0], size: [300, 300] }));
    }

    #[test]
    fn no_window_is_too_small_or_too_odd() {
        for window in [[1, 1], [1, 720], [1280, 1], [3, 2], [2, 3]] {
            for (_, [_, onto]) in parts(Mirror::Both, [1512, 1680], window) {
                assert!((0..2).all(|i| onto.corner[i] + onto.size[i] <= window[i]), "{window:?}: {onto:?}");
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
