//! Alpha of models: opaque, masked and blended surfaces, and colours of vertices, against what they must give exactly.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use image::{Rgba, RgbaImage};
use pbr_vr::gpu::Gpu;
use pbr_vr::reference::brdf::f_schlick;
use pbr_vr::render::{Eye, LightDetail, LightModel, Shading};
use pbr_vr::scene::Scene;
use serde_json::{Value, json};

use crate::common::Workshop;
use crate::common::colour::{EYE_Z, Look, assert_near, front, loaded, loaded_with_warnings, look, see};
use crate::common::gltf::{Gltf, Shape};
use crate::common::stage::with_gpu;

/// A surface that emits a colour and reflects nothing.
fn glowing(colour: [f64; 3], alpha: f64) -> Value {
    json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, alpha], "metallicFactor": 1, "roughnessFactor": 1},
        "emissiveFactor": colour, "alphaMode": "BLEND", "doubleSided": true,
    })
}

/// A dull dielectric of a base color and an alpha.
fn painted(colour: [f64; 4], mode: &str) -> Value {
    json!({
        "pbrMetallicRoughness": {"baseColorFactor": colour, "metallicFactor": 0, "roughnessFactor": 1},
        "alphaMode": mode, "doubleSided": true,
    })
}

fn over(near: [f64; 3], alpha: f64, behind: DVec3) -> DVec3 {
    DVec3::from(near) * alpha + behind * (1.0 - alpha)
}

const RED: [f64; 3] = [0.9, 0.1, 0.0];
const GREEN: [f64; 3] = [0.05, 0.8, 0.2];
const BLUE: [f64; 3] = [0.1, 0.2, 0.6];

/// A red pane and a green one before a blue wall.
fn panes(shop: &Workshop, red_first: bool, red_z: f32) -> std::path::PathBuf {
    let mut gltf = Gltf::new();
    let mut show = |colour, alpha, z| {
        let material = gltf.material(glowing(colour, alpha));
        gltf.show(&Shape::plate([-1.5, 1.5], [-1.5, 1.5], z), material);
    };
    show(BLUE, 1.0, -1.0);
    if red_first {
        show(RED, 0.4, red_z);
        show(GREEN, 0.7, -red_z);
    } else {
        show(GREEN, 0.7, -red_z);
        show(RED, 0.4, red_z);
    }
    gltf.write(shop, "panes.gltf")
}

#[test]
fn panes_cover_each_other_by_distance_whatever_their_order() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for (red_first, red_z) in [(true, 0.5), (true, -0.5), (false, 0.5), (false, -0.5)] {
            let scene = loaded(&panes(&shop, red_first, red_z), 0.0);
            let [red, green] = [|behind| over(RED, 0.4, behind), |behind| over(GREEN, 0.7, behind)];
            let want = if red_z > 0.0 { red(green(BLUE.into())) } else { green(red(BLUE.into())) };
            for (samples, eyes) in [(1, vec![front()]), (4, vec![front()]), (4, front().stereo(0.063).to_vec())] {
                let case = format!("red first {red_first}, at {red_z}, {samples} samples, {} eyes", eyes.len());
                for seen in look(gpu, &scene, &eyes, Look { samples, ..Look::default() }) {
                    for pixel in &seen.pixels {
                        assert_near(&case, *pixel, want, 0.0, 2e-3);
                    }
                }
            }
        }
    });
}

#[test]
fn the_reference_covers_by_chance_as_much_as_pictures_do() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for (light, red_z) in [(LightModel::Open, 0.5), (LightModel::Baked, -0.5)] {
            let scene = loaded(&panes(&shop, true, red_z), 0.0);
            let picture = see(gpu, &scene, Look::default()).about([0.0; 2], 4);
            let what = Look { light, shading: Shading::Reference, frames: 64, size: [32; 2], ..Look::default() };
            let mean = see(gpu, &scene, what).mean();
            // Each sample is one of three colours, so that its standard deviation is below half of their span.
            let error = 0.5 * 0.9 / f64::from(32 * 32 * 64).sqrt();
            println!("{light:?}: {mean} ± {error:.5}, picture {picture}");
            assert_near(&format!("{light:?}"), mean, picture, 4.0 * error, 1e-3);
        }
    });
}

/// Sees what is in the middle of [`front`]'s picture.
fn keyhole() -> Eye {
    Eye::looking(Vec3::new(0.0, 0.0, EYE_Z as f32), Vec3::ZERO, 0.4, 1.0)
}

fn glass(colour: [f64; 3], more: &Value) -> Value {
    let mut material = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [colour[0], colour[1], colour[2], 1], "metallicFactor": 0, "roughnessFactor": 0},
        "doubleSided": true, "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}},
    });
    more.as_object()
        .into_iter()
        .flatten()
        .for_each(|(key, value)| material["pbrMetallicRoughness"][key] = value.clone());
    material
}

/// A plate at a height, turned about the axis Y.
fn sheet(z: f32, degrees: f64) -> Shape {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let mut sheet = Shape::plate([-1.5, 1.5], [-1.5, 1.5], 0.0);
    let turned = |[x, y, _]: [f32; 3]| [x * cosine as f32, y, z - x * sine as f32];
    sheet.positions.iter_mut().for_each(|p| *p = turned(*p));
    sheet.normals.fill([sine as f32, 0.0, cosine as f32]);
    sheet
}

/// What is seen in pictures and by each exact light through sheets before a narrow wall that shines: what they mirror is dark.
fn assert_through(gpu: &Arc<Gpu>, name: &str, scene: &Scene, want: DVec3) {
    for samples in [1, 4] {
        let look_at = Look { samples, size: [8; 2], ..Look::default() };
        for seen in look(gpu, scene, &[keyhole(), keyhole()], look_at) {
            assert_near(&format!("{name}, {samples} samples"), seen.mean(), want, 1e-4, 5e-3);
        }
    }
    let reference = Look { shading: Shading::Reference, frames: 32, size: [32; 2], ..Look::default() };
    for light in [LightModel::Open, LightModel::Direct, LightModel::Baked] {
        let mean = look(gpu, scene, &[keyhole()], Look { light, ..reference }).remove(0).mean();
        // Each sample is 0 or the wall's light; where nothing is traced each shows one colour, three times as bright.
        let channels = if light == LightModel::Baked || want == DVec3::splat(want.x) { 1.0 } else { 3.0 };
        let through = want / (BLUE_WALL * channels);
        let deviation =
            BLUE_WALL * channels * (through * (1.0 - through)).map(f64::sqrt) / f64::from(32 * 32 * 32).sqrt();
        assert_near(&format!("{name}, {light:?}"), mean, want, 4.5 * deviation.max_element(), 5e-3);
    }
}

const BLUE_WALL: DVec3 = DVec3::new(BLUE[0], BLUE[1], BLUE[2]);

fn with_wall() -> Gltf {
    let mut gltf = Gltf::new();
    let wall = gltf.material(glowing(BLUE, 1.0));
    gltf.show(&Shape::plate([-0.3, 0.3], [-1.5, 1.5], -1.0), wall);
    gltf
}

#[test]
fn glass_lets_through_what_fresnel_leaves() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for degrees in [0.0f64, 60.0, 75.0] {
            let mut gltf = with_wall();
            let material = gltf.material(glass([1.0; 3], &json!({})));
            gltf.show(&sheet(0.0, degrees), material);
            let (scene, _) = loaded_with_warnings(&gltf.write(&shop, "glass.gltf"), 0.0);
            let fresnel = f_schlick(DVec3::splat(0.04), degrees.to_radians().cos()).x;
            assert_through(gpu, &format!("{degrees}°"), &scene, BLUE_WALL * (1.0 - fresnel));
        }
    });
}

#[test]
fn glass_colours_what_is_behind_by_factor_texture_and_vertices() {
    let shop = Workshop::new();
    let [red, green] = [[0.9, 0.3, 0.05], [0.2, 0.7, 1.0]];
    with_gpu(|gpu| {
        let clear = 1.0 - f_schlick(DVec3::splat(0.04), 1.0).x;
        let mut one = with_wall();
        let material = one.material(glass(red, &json!({})));
        one.show(&sheet(0.0, 0.0), material);
        let mut two = with_wall();
        for (colour, z) in [(red, 0.5), (green, -0.5)] {
            let material = two.material(glass(colour, &json!({})));
            two.show(&sheet(z, 0.0), material);
        }
        let mut painted = with_wall();
        let texture = painted.texture(&RgbaImage::from_pixel(4, 4, Rgba([255, 188, 99, 77])), json!({}));
        let material = painted.material(glass(red, &json!({"baseColorTexture": {"index": texture}})));
        painted.show(&sheet(0.0, 0.0).coloured(|_| [1.0, 0.5, 1.0, 1.0]), material);
        let decoded = |byte: f64| ((byte / 255.0 + 0.055) / 1.055).powf(2.4);
        let texel = DVec3::new(1.0, 0.5 * decoded(188.0), decoded(99.0));
        let (red, green) = (DVec3::from(red), DVec3::from(green));
        for (name, gltf, want) in [
            ("one", one, clear * red),
            ("two", two, clear * clear * red * green),
            ("texture and vertices", painted, clear * red * texel),
        ] {
            let (scene, _) = loaded_with_warnings(&gltf.write(&shop, "coloured.gltf"), 0.0);
            assert_through(gpu, name, &scene, BLUE_WALL * want);
        }
    });
}

/// What lights a floor.
#[derive(Clone, Copy, Debug)]
enum Above {
    Panel,
    Lamp,
    Sun,
}

/// Below a coloured sheet a grey floor has its colour, in pictures and in the exact one.
#[test]
fn light_through_coloured_glass_has_its_colour() {
    let shop = Workshop::new();
    let colour = [1.0, 0.5, 0.1];
    let lit = |glass_colour: [f64; 3], by: Above| {
        let mut gltf = Gltf::new();
        let floor = gltf.material(painted([0.5, 0.5, 0.5, 1.0], "OPAQUE"));
        gltf.show(&Shape::plate([-1.2, 1.2], [-1.2, 1.2], 0.0), floor);
        let material = gltf.material(glass(glass_colour, &json!({})));
        gltf.show(&sheet(1.0, 0.0), material);
        match by {
            Above::Panel => {
                let panel = gltf.material(glowing([20.0; 3], 1.0));
                gltf.show(&Shape::plate([-1.0, 1.0], [0.5, 1.5], 3.0), panel);
            }
            Above::Lamp => {
                gltf.light(json!({"type": "point", "intensity": 60.0}), json!({"translation": [1.0, 0, 4]}));
            }
            // It shines along −Z.
            Above::Sun => gltf.light(json!({"type": "directional", "intensity": 3.0}), json!({})),
        }
        loaded_with_warnings(&gltf.write(&shop, "floor.gltf"), 0.0).0
    };
    let from_aside = Eye::looking(Vec3::new(0.0, -2.5, 0.6), Vec3::ZERO, 8.0, 1.0);
    with_gpu(|gpu| {
        for by in [Above::Panel, Above::Lamp, Above::Sun] {
            let seen = |shading, frames, colour| {
                let detail = LightDetail { lightmap_size: Some(64), lightmap_samples: 16, ..LightDetail::default() };
                let what = Look { light: LightModel::Baked, shading, size: [16; 2], frames, detail, ..Look::default() };
                look(gpu, &lit(colour, by), &[from_aside], what).remove(0).mean()
            };
            let [picture, exact] =
                [(Shading::Pbr, 1), (Shading::Reference, 64)].map(|(shading, frames)| seen(shading, frames, colour));
            let clear = seen(Shading::Pbr, 1, [1.0; 3]);
            println!("{by:?}: {picture}, exact {exact}, picture without colour {clear}");
            for light in [picture, exact] {
                assert_near(&format!("{by:?}"), light / light.x, DVec3::from(colour), 0.001, 0.004);
            }
            assert_near(&format!("{by:?}, picture"), picture, exact, 0.0, 0.025);
            // Shadows of clear glass are its coverage in sixteenths.
            assert!((clear.x / picture.x - 1.0).abs() < 0.07, "{by:?}: {clear} without colour");
        }
    });
}

#[test]
fn what_is_inside_is_seen_between_backs_and_fronts() {
    let shop = Workshop::new();
    let mut gltf = Gltf::new();
    let [wall, glass, ball] = [glowing(BLUE, 1.0), glowing(GREEN, 0.3), glowing(RED, 0.5)].map(|m| gltf.material(m));
    gltf.show(&Shape::plate([-3.0, 3.0], [-3.0, 3.0], -2.0), wall);
    // Listed so that nothing is right by chance.
    gltf.show(&Shape::ball(0.5, 48), ball);
    gltf.show(&Shape::block([-0.7; 3], [0.7; 3]), glass);
    let path = gltf.write(&shop, "box.glb");
    let red = |behind| over(RED, 0.5, behind);
    let green = |behind| over(GREEN, 0.3, behind);
    with_gpu(|gpu| {
        let scene = loaded(&path, 0.0);
        for (samples, eyes) in [(1, vec![front()]), (4, front().stereo(0.063).to_vec())] {
            for seen in look(gpu, &scene, &eyes, Look { samples, size: [128; 2], ..Look::default() }) {
                for point in [[0.0, 0.0], [0.3, 0.0], [-0.2, 0.3], [0.1, -0.35]] {
                    let want = green(red(red(green(BLUE.into()))));
                    assert_near(&format!("ball at {point:?}"), seen.about(point, 1), want, 0.0, 2e-3);
                }
                for point in [[0.56, 0.56], [-0.57, 0.0], [0.0, 0.56]] {
                    assert_near("box alone", seen.about(point, 1), green(green(BLUE.into())), 0.0, 2e-3);
                }
                assert_near("wall alone", seen.about([0.96, -0.97], 1), BLUE.into(), 0.0, 1e-3);
            }
        }
    });
}

/// Eight columns whose alpha grows from left to right, of texels or of vertices.
const COLUMNS: u32 = 8;

fn alpha_of(column: u32) -> f64 {
    (f64::from(column) * 36.0).round() / 255.0
}

fn columns(alpha: impl Fn(u32) -> u8) -> RgbaImage {
    RgbaImage::from_fn(COLUMNS * 8, 8, |x, _| Rgba([255, 255, 255, alpha(x / 8)]))
}

/// Where alpha comes from.
#[derive(Clone, Copy, Debug)]
enum From {
    Texture,
    Factor,
    Vertices,
    /// The product of a texture, a factor and vertices.
    All,
}

/// A strip for each column, before a black sky. Base color is `colour`.
fn strips(shop: &Workshop, from: From, colour: [f64; 3], more: &Value) -> std::path::PathBuf {
    let mut gltf = Gltf::new();
    let sampler = json!({"wrapS": 33071, "wrapT": 33071});
    let picture = match from {
        From::Texture => Some(columns(|c| (alpha_of(c) * 255.0).round() as u8)),
        From::All => Some(columns(|_| 204)),
        _ => None,
    };
    let texture = picture.map(|picture| gltf.texture(&picture, sampler));
    for column in 0..COLUMNS {
        let alpha = alpha_of(column);
        let (factor, vertex) = match from {
            From::Texture => (1.0, None),
            From::Factor => (alpha, None),
            From::Vertices => (1.0, Some(alpha)),
            From::All => (0.9, Some(alpha)),
        };
        let [r, g, b] = colour;
        let mut material = painted([r, g, b, factor], "OPAQUE");
        if let Some(texture) = texture {
            material["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
        }
        more.as_object().into_iter().flatten().for_each(|(key, value)| material[key] = value.clone());
        let material = gltf.material(material);
        let x0 = column as f32 / COLUMNS as f32;
        let mut shape = Shape::plate([2.0 * x0 - 1.0, 2.0 * x0 - 0.75], [-1.0, 1.0], 0.0);
        shape = shape.with_uvs(0, |[u, v]| [x0 + u / COLUMNS as f32, v]);
        if let Some(alpha) = vertex {
            shape = shape.coloured(|_| [1.0, 1.0, 1.0, alpha as f32]);
        }
        gltf.show(&shape, material);
    }
    gltf.write(shop, "strips.gltf")
}

/// The alpha that a column has in all.
fn whole_alpha(from: From, column: u32) -> f64 {
    if matches!(from, From::All) { 0.8 * 0.9 * alpha_of(column) } else { alpha_of(column) }
}

const SOURCES: [From; 4] = [From::Texture, From::Factor, From::Vertices, From::All];

fn middle(column: u32) -> [f64; 2] {
    [(f64::from(column) + 0.5) / f64::from(COLUMNS) * 2.0 - 1.0, 0.1]
}

#[test]
fn opaque_surfaces_ignore_alpha() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for from in SOURCES {
            let scene = loaded(&strips(&shop, from, [0.5, 0.25, 0.75], &json!({})), 0.0);
            let seen = see(gpu, &scene, Look { shading: Shading::BaseColor, ..Look::default() });
            for column in 0..COLUMNS {
                let want = DVec3::new(0.5, 0.25, 0.75);
                assert_near(&format!("{from:?} {column}"), seen.about(middle(column), 2), want, 1e-3, 0.0);
            }
        }
    });
}

#[test]
fn masks_cut_what_is_below_their_cutoff() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for from in SOURCES {
            for (cutoff, samples) in [(None, 1), (Some(0.25), 4), (Some(0.75), 1), (Some(0.0), 1), (Some(1.1), 4)] {
                let more =
                    cutoff.map_or(json!({"alphaMode": "MASK"}), |c| json!({"alphaMode": "MASK", "alphaCutoff": c}));
                let scene = loaded(&strips(&shop, from, [0.5; 3], &more), 0.0);
                let seen = see(gpu, &scene, Look { shading: Shading::BaseColor, samples, ..Look::default() });
                for column in 0..COLUMNS {
                    let alpha = whole_alpha(from, column);
                    let want = if alpha < cutoff.unwrap_or(0.5) { 0.0 } else { 0.5 };
                    let case = format!("{from:?}, cutoff {cutoff:?}, alpha {alpha}");
                    assert_near(&case, seen.about(middle(column), 1), DVec3::splat(want), 1e-3, 0.0);
                }
            }
        }
    });
}

#[test]
fn blended_surfaces_take_alpha_from_texture_factor_and_vertices() {
    let shop = Workshop::new();
    with_gpu(|gpu| {
        for from in SOURCES {
            let scene = loaded(&strips(&shop, from, [0.5, 0.25, 0.75], &json!({"alphaMode": "BLEND"})), 0.0);
            let seen = see(gpu, &scene, Look { shading: Shading::BaseColor, ..Look::default() });
            for column in 0..COLUMNS {
                let want = DVec3::new(0.5, 0.25, 0.75) * whole_alpha(from, column);
                assert_near(&format!("{from:?} {column}"), seen.about(middle(column), 1), want, 3e-3, 0.0);
            }
        }
    });
}

#[test]
fn colours_of_vertices_multiply_base_color() {
    let shop = Workshop::new();
    let mut gltf = Gltf::new();
    let grey = RgbaImage::from_fn(2, 2, |x, _| Rgba(if x == 0 { [188, 188, 188, 255] } else { [255, 188, 188, 255] }));
    let texture = gltf.texture(&grey, json!({"magFilter": 9728}));
    let mut material = painted([0.5, 1.0, 0.8, 1.0], "OPAQUE");
    material["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
    let material = gltf.material(material);
    let colour = |x: f64, y: f64| DVec3::new(0.5 + 0.4 * x, 0.5 - 0.3 * y, 0.25);
    let shape = Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0);
    let shape = shape.coloured(|[x, y, _]| colour(x.into(), y.into()).as_vec3().extend(1.0).into());
    gltf.show(&shape, material);
    with_gpu(|gpu| {
        let scene = loaded(&gltf.write(&shop, "colours.gltf"), 1.0);
        let seen = see(gpu, &scene, Look { shading: Shading::BaseColor, ..Look::default() });
        let decoded = ((188.0 / 255.0 + 0.055) / 1.055f64).powf(2.4);
        for (x, y) in [(3, 5), (20, 60), (40, 31), (63, 0), (55, 48)] {
            let at = crate::common::colour::on_plane(x, y, 64, 0.0);
            let texel = if at.x < 0.0 { DVec3::splat(decoded) } else { DVec3::new(1.0, decoded, decoded) };
            let want = colour(at.x, at.y) * texel * DVec3::new(0.5, 1.0, 0.8);
            assert_near(&format!("pixel {x}, {y}"), seen.at(x, y), want, 2e-3, 0.0);
        }
    });
}

#[test]
fn unlit_surfaces_show_the_colours_of_their_vertices() {
    let shop = Workshop::new();
    let mut gltf = Gltf::new();
    let mut material = painted([0.5, 1.0, 0.8, 1.0], "OPAQUE");
    material["extensions"] = json!({"KHR_materials_unlit": {}});
    let material = gltf.material(material);
    gltf.show(&Shape::plate([-1.0, 0.0], [-1.0, 1.0], 0.0), material);
    let coloured = Shape::plate([0.0, 1.0], [-1.0, 1.0], 0.0).coloured(|_| [0.5, 0.25, 1.0, 1.0]);
    gltf.show(&coloured, material);
    with_gpu(|gpu| {
        let (scene, warnings) = loaded_with_warnings(&gltf.write(&shop, "unlit.gltf"), 0.3);
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        for shading in [Shading::Pbr, Shading::Reference] {
            let seen = see(gpu, &scene, Look { shading, frames: 4, ..Look::default() });
            assert_near("plain", seen.about([-0.5, 0.0], 2), DVec3::new(0.5, 1.0, 0.8), 2e-3, 0.0);
            assert_near("coloured", seen.about([0.5, 0.0], 2), DVec3::new(0.25, 0.25, 0.8), 2e-3, 0.0);
        }
    });
}

/// Shadows of masked and of half-transparent panes, whose alpha comes from vertices, beside the reference.
#[test]
fn panes_let_through_what_they_do_not_cover() {
    let shop = Workshop::new();
    for (mode, alpha) in [("BLEND", 0.4), ("MASK", 0.4), ("MASK", 0.6), ("OPAQUE", 0.4)] {
        let mut gltf = Gltf::new();
        let floor = gltf.material(painted([0.5, 0.5, 0.5, 1.0], "OPAQUE"));
        gltf.show(&Shape::plate([-1.2, 1.2], [-1.2, 1.2], 0.0), floor);
        let pane = gltf.material(painted([0.5, 0.5, 0.5, 1.0], mode));
        // Beside the picture, between the lamp and the picture's right half.
        let pane_shape = Shape::plate([1.5, 2.75], [-1.5, 1.5], 2.5).coloured(|_| [1.0, 1.0, 1.0, alpha]);
        gltf.show(&pane_shape, pane);
        gltf.light(json!({"type": "point", "intensity": 60.0}), json!({"translation": [4, 0, 5]}));
        let path = gltf.write(&shop, "shadow.gltf");
        with_gpu(|gpu| {
            let scene = loaded(&path, 0.0);
            let what = Look { light: LightModel::Direct, size: [48; 2], ..Look::default() };
            let seen = see(gpu, &scene, what);
            let exact = see(gpu, &scene, Look { shading: Shading::Reference, frames: 48, ..what });
            let open = see(gpu, &scene, Look { light: LightModel::Open, ..what });
            let share = match mode {
                "BLEND" => 1.0 - f64::from(alpha),
                "MASK" => f64::from(u8::from(alpha < 0.5)),
                _ => 0.0,
            };
            let point = [0.1, 0.0];
            let whole = open.about(point, 6).x;
            let (got, want) = (seen.about(point, 6).x, exact.about(point, 6).x);
            println!("{mode} {alpha}: {:.4}, exact {:.4}, wanted {share}", got / whole, want / whole);
            assert!((got / whole - share).abs() < 0.04, "{mode} {alpha}: {}", got / whole);
            assert!((want / whole - share).abs() < 0.03, "{mode} {alpha}, reference: {}", want / whole);
        });
    }
}
