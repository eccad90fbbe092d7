//! Tests of `render::mirror_picture` on the GPU: what it shows against `reference::reprojection`.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec2, DVec3, EulerRot};

use super::mirror_picture::{MirrorPart, MirrorPicture};
use crate::gpu::{
    Format, FrameRing, Gpu, Image, ImageDesc, ImageUsageFlags, Shape, Subresource, read_image, with_gpu, write_mips,
};
use crate::reference::reprojection::{homography, source};
use crate::reference::tone::srgb_decode;
use crate::render::FRAME_BYTES;

/// Texels along a side of the eyes' picture.
const SIDE: u32 = 256;
const WINDOW: [u32; 2] = [96, 54];

/// Two layers: red is u, green is v, blue is the layer.
fn eyes(gpu: &Arc<Gpu>) -> Arc<Image> {
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST;
    let flat = ImageDesc::flat(Format::R8G8B8A8_UNORM, [SIDE; 2], usage);
    let image = Image::new(gpu, "eyes", ImageDesc { shape: Shape::Layers(2), ..flat }).unwrap();
    let texel = |layer: u8, x: u32, y: u32| [x as u8, y as u8, 255 * layer, 255];
    let layer = |layer| (0..SIDE).flat_map(move |y| (0..SIDE).flat_map(move |x| texel(layer, x, y)));
    let texels: Vec<u8> = layer(0).chain(layer(1)).collect();
    write_mips(gpu, "eyes", &[(&image, &[texels])]).unwrap();
    image
}

/// The window's pixels, linear.
fn shown(gpu: &Arc<Gpu>, parts: &[MirrorPart]) -> Vec<[f64; 3]> {
    let (mut mirror, mut ring) = (MirrorPicture::new(gpu).unwrap(), FrameRing::new(gpu, FRAME_BYTES).unwrap());
    let eyes = eyes(gpu);
    let mut frame = ring.begin().unwrap();
    let image = mirror.record(&mut frame, &eyes, parts, WINDOW).unwrap();
    frame.submit(None).unwrap();
    let bytes = read_image(gpu, &image, Subresource { mip: 0, layer: 0 }, 4).unwrap();
    let encoded = |pixel: &[u8]| DVec3::new(pixel[0].into(), pixel[1].into(), pixel[2].into()) / 255.0;
    bytes.chunks_exact(4).map(|pixel| srgb_decode(encoded(pixel)).to_array()).collect()
}

/// The place of a pixel in clip space.
fn clip(i: usize) -> DVec2 {
    let at = [i as u32 % WINDOW[0], i as u32 / WINDOW[0]];
    let [x, y] = [0, 1].map(|axis| (f64::from(at[axis]) + 0.5) / f64::from(WINDOW[axis]) * 2.0 - 1.0);
    DVec2::new(x, y)
}

#[test]
fn a_turned_camera_sees_what_the_reference_says_and_nothing_beyond_the_eyes_picture() {
    with_gpu(|gpu| {
        let tangents = [-1.3, 1.1, -1.2, 1.4];
        // The last one looks beyond the frustum.
        for (turn, layer, limit) in
            [([0.1, -0.05, 0.2], 0, 1.0), ([-0.2, 0.1, -0.4], 1, 0.75), ([0.9, 0.0, 0.0], 0, 1.0)]
        {
            let turn = DQuat::from_euler(EulerRot::YXZ, turn[0], turn[1], turn[2]);
            let whole = homography(DMat3::from_quat(turn), DVec2::new(0.8, 0.45), tangents);
            let exact = DMat3::from_diagonal(DVec3::new(limit, limit, 1.0)) * whole;
            let limit = [limit as f32; 2];
            let parts = [MirrorPart { layer, uv_from_clip: exact.as_mat3(), limit }];
            let (mut inside, mut outside) = (0, 0);
            for (i, pixel) in shown(gpu, &parts).into_iter().enumerate() {
                let uv = source(exact, clip(i))
                    .filter(|uv| uv.min_element() > 0.0 && uv.max_element() < f64::from(limit[0]));
                let Some(uv) = uv else {
                    // At its very edge rounding decides.
                    outside += usize::from(pixel == [0.0; 3]);
                    continue;
                };
                // Texel x holds x / 255 at its centre.
                let value = |t: f64| ((t * f64::from(SIDE) - 0.5) / 255.0).clamp(0.0, 1.0);
                let expected = [value(uv.x), value(uv.y), f64::from(layer)];
                let edge = 2.0 / f64::from(SIDE);
                if uv.min_element() > edge && uv.max_element() < f64::from(limit[0]) - edge {
                    let error = (0..3).map(|c| (pixel[c] - expected[c]).abs()).fold(0.0, f64::max);
                    assert!(error < 6e-3, "{i}: {pixel:?} instead of {expected:?}");
                    inside += 1;
                }
            }
            let all = (WINDOW[0] * WINDOW[1]) as usize;
            assert!(inside > all / 4 && inside + outside > all * 9 / 10, "{inside} inside, {outside} black of {all}");
            assert!(turn.to_axis_angle().1 < 0.8 || outside > all / 10, "the last one looks beyond");
        }
    });
}
