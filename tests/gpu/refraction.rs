//! Solid glass: balls against rays in f64, even light, absorption, what is inside, and pictures against the exact ones.

use std::slice::from_ref;

use glam::{DMat4, DVec3};
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::refraction::fresnel_dielectric;
use pbr_vr::render::{LightModel, Shading};
use serde_json::{Value, json};

use crate::common::gltf::{Gltf, Shape};
use crate::common::{PictureOptions, Workshop, pixel};

const SIDE: u32 = 32;
/// From where the balls, of radius 1, are seen, and the angle of the picture's height.
const EYE_Z: f64 = 20.0;
const FOV_DEGREES: f64 = 6.0;

/// Clear glass, with what its volume has more.
fn glass(roughness: f64, volume: Value) -> Value {
    let mut of_volume = json!({"thicknessFactor": 2});
    of_volume.as_object_mut().expect("an object").extend(volume.as_object().expect("an object").clone());
    json!({
        "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": roughness},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": of_volume},
    })
}

/// Shapes of one material, and others of a dull one.
fn picture(
    shop: &Workshop,
    material: &Value,
    shapes: &[Shape],
    dull: &[Shape],
    options: &PictureOptions<'_>,
) -> Picture {
    let mut gltf = Gltf::new();
    let dull_material = gltf.material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.1, 0.1, 1], "metallicFactor": 0, "roughnessFactor": 1},
    }));
    let material = gltf.material(material.clone());
    shapes.iter().for_each(|shape| gltf.show(shape, material));
    dull.iter().for_each(|shape| gltf.show(shape, dull_material));
    gltf.write(shop, "glass.gltf");
    let text = format!(
        "environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = \"glass.gltf\"\n[[camera]]\nname = \"c\"\n\
         position = [0, 0, {EYE_Z}]\ntarget = [0, 0, 0]\nvertical_fov_degrees = {FOV_DEGREES}\n"
    );
    shop.render(&shop.write("scene.toml", &text), options).remove(0)
}

fn all_light(shading: Shading, frames: u64) -> PictureOptions<'static> {
    PictureOptions { size: [SIDE; 2], light: LightModel::Baked, shading, frames, ..PictureOptions::default() }
}

fn exact(frames: u64) -> PictureOptions<'static> {
    all_light(Shading::Reference, frames)
}

/// The direction from the eye to a place of the picture, in pixels.
fn direction(x: f64, y: f64) -> DVec3 {
    let half = (0.5 * FOV_DEGREES).to_radians().tan();
    let at = |pixel: f64| (2.0 * pixel / f64::from(SIDE) - 1.0) * half;
    DVec3::new(at(x), -at(y), -1.0).normalize()
}

/// What a ray brings through a clear ball of radius 1 around the origin, by Snell's and Fresnel's laws, with what is mirrored inside a
/// few times; `None` beside the ball.
fn through_ball(d: DVec3, ior: f64, sky: &dyn Fn(DVec3) -> f64) -> Option<f64> {
    let (eye, along) = (EYE_Z * DVec3::Z, -EYE_Z * d.z);
    let squared = EYE_Z * EYE_Z - along * along;
    let n = eye + (along - (1.0 - squared.min(1.0)).sqrt()) * d;
    if squared >= 0.98 {
        return None;
    }
    let share = fresnel_dielectric(-n.dot(d), ior);
    let mut sum = share * sky(d.reflect(n));
    let (mut at, mut inside, mut left) = (n, d.refract(n, 1.0 / ior), 1.0 - share);
    for _ in 0..20 {
        at = (at - 2.0 * at.dot(inside) * inside).normalize();
        let share = fresnel_dielectric(at.dot(inside), 1.0 / ior);
        sum += left * (1.0 - share) * sky(inside.refract(-at, ior));
        left *= share;
        inside = inside.reflect(at).normalize();
    }
    Some(sum)
}

/// A sky without edges, bright above, and its mean over a pixel of the ball.
fn slope(d: DVec3) -> f64 {
    1.0 + 0.8 * d.y + 0.15 * d.x
}

fn pixel_through_ball(x: u32, y: u32, ior: f64) -> Option<f64> {
    let places =
        (0..16).map(|i| (f64::from(x) + (f64::from(i % 4) + 0.5) / 4.0, f64::from(y) + (f64::from(i / 4) + 0.5) / 4.0));
    let all: Option<Vec<f64>> = places.map(|(x, y)| through_ball(direction(x, y), ior, &slope)).collect();
    all.map(|all| all.iter().sum::<f64>() / 16.0)
}

#[test]
fn a_ball_of_glass_shows_what_snells_law_says() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 256, |d| [slope(DVec3::from(d)) as f32; 3]);
    // Few enough triangles for it to be known to be convex: then nothing is baked.
    let ball = [Shape::ball(1.0, 88)];
    for (shading, frames, [most, mean]) in [(Shading::Reference, 128, [0.25, 0.02]), (Shading::Pbr, 1, [0.25, 0.03])] {
        let got = picture(&shop, &glass(0.0, json!({})), &ball, &[], &all_light(shading, frames));
        let (mut count, mut sum, mut worst, mut upside_down) = (0, 0.0, 0.0_f64, 0);
        for (x, y) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
            let Some(want) = pixel_through_ball(x, y, 1.5) else { continue };
            let off = (pixel(&got, x, y)[0] / want - 1.0).abs();
            (count, sum, worst) = (count + 1, sum + off, worst.max(off));
            upside_down += usize::from((pixel(&got, x, y)[0] < 1.0) == (y < SIDE / 2));
        }
        println!("{shading:?}: {:.4} off in the mean, {worst:.4} at worst", sum / f64::from(count));
        assert!(count > 400, "{count} pixels of the ball");
        assert!(upside_down as f64 > 0.75 * f64::from(count), "{upside_down} of {count}");
        assert!(worst < most && sum / f64::from(count) < mean, "{shading:?}: {worst}, {}", sum / f64::from(count));
    }
}

/// With an Abbe number of 2 the index of red is 1.375, and that of blue 1.625.
#[test]
fn a_ball_that_splits_light_shows_each_colour_by_its_own_index() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 256, |d| [slope(DVec3::from(d)) as f32; 3]);
    let mut material = glass(0.0, json!({}));
    material["extensions"]["KHR_materials_dispersion"] = json!({"dispersion": 10});
    let got = [exact(512), all_light(Shading::Pbr, 1)]
        .map(|options| picture(&shop, &material, &[Shape::ball(1.0, 88)], &[], &options));
    // Where between the pictures of two indices a channel's is, 0 to 1: noise of single pixels is as large as their difference.
    let iors = [1.375, 1.5, 1.625];
    let between = |channel: usize, got: Option<&Picture>| {
        let (mut product, mut square) = (0.0, 0.0);
        for (x, y) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
            let [Some(red), Some(green), Some(blue)] = iors.map(|ior| pixel_through_ball(x, y, ior)) else { continue };
            let is = got.map_or([red, green, blue], |got| pixel(got, x, y))[channel];
            product += (is - red) * (blue - red);
            square += (blue - red).powi(2);
        }
        product / square
    };
    let of = |got: Option<&Picture>| [0, 1, 2].map(|channel| between(channel, got));
    let want = of(None);
    // Pictures leave out what is mirrored inside, which is nearly the same for all colours.
    for (got, bound) in got.iter().zip([0.2, 0.45]) {
        let at = of(Some(got));
        println!("red, green and blue between red's and blue's pictures: {at:.3?}, should be {want:.3?}");
        assert!(want.iter().zip(at).all(|(want, at)| (at - want).abs() < bound), "{at:?}, not {want:?}");
    }
}

/// Bodies of any form between which light is lost only by rough surfaces' microfacets.
#[test]
fn under_even_light_clear_glass_is_not_seen() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    let block = Shape::block([-0.9, -0.9, -0.3], [0.1, 0.8, 0.4]);
    let shapes = [block, Shape::ball(0.4, 24).moved(glam::DMat4::from_translation(DVec3::new(0.5, 0.2, 0.0)))];
    for (roughness, least) in [(0.0, 0.995), (0.4, 0.96)] {
        let got = picture(&shop, &glass(roughness, json!({})), &shapes, &[], &exact(64));
        let mean = got.pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / got.pixels.len() as f64;
        assert!(mean > least && mean < 1.005, "roughness {roughness}: {mean}");
    }
}

/// By Beer and Lambert's law over the way that light has in the body, in exact pictures and others.
#[test]
fn the_middle_of_a_coloured_ball_absorbs_by_its_diameter() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    let color = [0.25, 0.5, 1.0];
    // At one of its radius; the stated thickness does not count.
    let volume = json!({"thicknessFactor": 0.1, "attenuationDistance": 1, "attenuationColor": color});
    for (shading, frames, bound) in [(Shading::Reference, 64, 0.03), (Shading::Pbr, 1, 0.03)] {
        let got =
            picture(&shop, &glass(0.0, volume.clone()), &[Shape::ball(1.0, 64)], &[], &all_light(shading, frames));
        for (channel, color) in color.into_iter().enumerate() {
            let middle = [SIDE / 2 - 1, SIDE / 2].into_iter().flat_map(|y| [SIDE / 2 - 1, SIDE / 2].map(|x| (x, y)));
            let got = middle.map(|(x, y)| pixel(&got, x, y)[channel]).sum::<f64>() / 4.0;
            let (f, a) = (0.04, f64::powi(color, 2));
            // Mirrored inside any number of times.
            let want = f + (1.0 - f) * (1.0 - f) * a / (1.0 - f * a);
            assert!((got - want).abs() < bound, "{shading:?}, {channel}: {got} against {want}");
        }
    }
}

/// A block that is turned, so that light leaves it by faces next to those that it came in by, and an egg.
#[test]
fn convex_bodies_show_what_exact_pictures_do() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 256, |d| [slope(DVec3::from(d)) as f32, 1.0 - 0.5 * d[0] as f32, 0.6 + 0.3 * d[2] as f32]);
    let turn = DMat4::from_rotation_x(0.5) * DMat4::from_rotation_y(0.7);
    let block = Shape::block([-0.55, -0.5, -0.45], [0.55, 0.5, 0.45]).moved(turn);
    let egg = Shape::ball(1.0, 40).moved(turn * DMat4::from_scale(DVec3::new(0.6, 0.95, 0.75)));
    for (name, shape) in [("block", block), ("egg", egg)] {
        for (material, bound) in [(glass(0.0, json!({})), 0.05), (glass(0.3, json!({})), 0.09)] {
            let [fast, exact] = [all_light(Shading::Pbr, 1), exact(96)]
                .map(|options| picture(&shop, &material, from_ref(&shape), &[], &options));
            let (mut off, mut all) = (0.0, 0.0);
            for (x, y) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
                let sky = DVec3::from(pixel(&exact, 0, 0));
                let [got, want] = [&fast, &exact].map(|picture| DVec3::from(pixel(picture, x, y)));
                if (want - sky).abs().max_element() > 0.02 {
                    (off, all) = (off + (got - want).abs().element_sum(), all + want.element_sum());
                }
            }
            println!("{name}: {:.2} % off", 100.0 * off / all);
            assert!(all > 200.0 && off < bound * all, "{name}: {off} of {all}");
        }
    }
}

/// In a hollow ball, or behind a block: what glass surrounds stays visible.
#[test]
fn things_are_seen_through_glass() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    let block = Shape::block([-1.0, -1.0, -0.2], [1.0, 1.0, 0.2]);
    let inside = Shape::block([-0.4, -0.4, -0.4], [0.4, 0.4, 0.4]);
    let behind = Shape::block([-0.4, -0.4, -1.0], [0.4, 0.4, -0.6]);
    let cases = [("in a ball", Shape::ball(0.9, 24), inside), ("behind a block", block, behind)];
    for (name, body, thing) in cases {
        for (shading, frames) in [(Shading::Reference, 8), (Shading::Pbr, 1)] {
            let options = PictureOptions { lightmap: Some(128), ..all_light(shading, frames) };
            let got = picture(&shop, &glass(0.0, json!({})), from_ref(&body), from_ref(&thing), &options);
            let [red, green, _] = pixel(&got, SIDE / 2, SIDE / 2);
            assert!(red > 0.5 && green < 0.4, "{name}, {shading:?}: {red}, {green}");
        }
    }
}

/// Open surfaces bend nothing: light that went in would never leave.
#[test]
fn an_open_surface_is_a_thin_sheet() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 64, |d| [slope(DVec3::from(d)) as f32; 3]);
    let ball = Shape::ball(1.0, 32);
    let is_near = |triangle: &&[u32]| triangle.iter().all(|corner| ball.positions[*corner as usize][2] >= -0.01);
    let indices = ball.indices.chunks_exact(3).filter(is_near).flatten().copied().collect();
    let half = Shape { indices, ..ball.clone() };
    let seen = picture(&shop, &glass(0.0, json!({})), &[half], &[], &exact(64));
    // Straight ahead the horizon is seen, above and below.
    let [above, below] = [SIDE / 4, 3 * SIDE / 4].map(|y| pixel(&seen, SIDE / 2, y)[0]);
    assert!((above - 1.0).abs() < 0.12 && (below - 1.0).abs() < 0.12, "{above}, {below}");
}
