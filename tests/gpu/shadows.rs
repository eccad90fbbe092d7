//! Shadows of lamps on the GPU against rays: their places and penumbrae, no acne, no gap under what stands on a floor, holes,
//! both eyes, and when maps are drawn again.

use std::fmt::Write as _;
use std::sync::Arc;

use glam::{DVec3, Mat4, Vec3};
use pbr_vr::asset::Panorama;
use pbr_vr::context::Context;
use pbr_vr::gpu::{Gpu, Subresource, read_image};
use pbr_vr::reference::shadow::{FACE_TANGENT, disc_beyond, hit, is_blocked};
use pbr_vr::reference::sun::{Sun, find_sun};
use pbr_vr::render::{Eye, FrameInputs, IPD_METRES, LightModel, Output, RenderSettings, Renderer};
use pbr_vr::scene::{Model, Scene};

use crate::common::stage::{draw_frame, scene, shipped, with_gpu};
use crate::common::{Workshop, material};

/// Texels along a face of one lamp's map on a software renderer; other GPUs have more.
const FACE: f64 = 1024.0;
const SIZE: u32 = 160;

type Triangle = [DVec3; 3];

/// A quadrilateral as two triangles.
fn quad(a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]) -> Vec<Triangle> {
    let [a, b, c, d] = [a, b, c, d].map(DVec3::from);
    vec![[a, b, c], [a, c, d]]
}

/// A level rectangle that faces up.
fn level([x0, x1]: [f64; 2], y: f64, [z0, z1]: [f64; 2]) -> Vec<Triangle> {
    quad([x0, y, z1], [x1, y, z1], [x1, y, z0], [x0, y, z0])
}

/// A box, its faces outwards.
fn block([x0, y0, z0]: [f64; 3], [x1, y1, z1]: [f64; 3]) -> Vec<Triangle> {
    [
        level([x0, x1], y1, [z0, z1]),
        quad([x0, y0, z0], [x1, y0, z0], [x1, y0, z1], [x0, y0, z1]),
        quad([x0, y0, z1], [x1, y0, z1], [x1, y1, z1], [x0, y1, z1]),
        quad([x1, y0, z0], [x0, y0, z0], [x0, y1, z0], [x1, y1, z0]),
        quad([x1, y0, z1], [x1, y0, z0], [x1, y1, z0], [x1, y1, z1]),
        quad([x0, y0, z0], [x0, y0, z1], [x0, y1, z1], [x0, y1, z0]),
    ]
    .concat()
}

fn floor() -> Vec<Triangle> {
    level([-3.0, 3.0], 0.0, [-3.0, 3.0])
}

/// A matte scene of triangles under one lamp in the dark.
fn matte(triangles: &[Triangle], lamp: DVec3, radius: f64) -> Scene {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    let [x, y, z] = lamp.to_array();
    let light =
        format!("[[light]]\npoint = {{ position = [{x}, {y}, {z}], intensity = [9, 9, 9], radius = {radius} }}\n");
    under(&shop, triangles, &light)
}

/// The same under a panorama that is black but for a sun of about 1° radius, which has all light.
fn sunny(triangles: &[Triangle], towards: DVec3) -> (Scene, Sun) {
    let shop = Workshop::new();
    let disc = 1f64.to_radians().cos();
    shop.panorama("sky.exr", 1024, |d| if DVec3::from(d).dot(towards) > disc { [500.0; 3] } else { [1e-4; 3] });
    let scene = under(&shop, triangles, "");
    let panorama = &scene.environment.panorama;
    let split = find_sun([panorama.width, panorama.height], &panorama.texels).expect("a sun");
    (scene, split.sun)
}

/// A matte scene of triangles under sky.exr and a light.
fn under(shop: &Workshop, triangles: &[Triangle], light: &str) -> Scene {
    shop.write("m.mtl", &material([0.5; 3], 0.0, 1.0));
    let mut obj = "mtllib m.mtl\nusemtl m\n".to_owned();
    for (i, [a, b, c]) in triangles.iter().enumerate() {
        let n = (*b - *a).cross(*c - *a).normalize();
        for p in [a, b, c] {
            writeln!(obj, "v {} {} {}\nvt 0 0\nvn {} {} {}", p.x, p.y, p.z, n.x, n.y, n.z).expect("a string");
        }
        let corner = |k: usize| format!("{0}/{0}/{0}", 3 * i + k);
        writeln!(obj, "f {} {} {}", corner(1), corner(2), corner(3)).expect("a string");
    }
    shop.write("m.obj", &obj);
    let text = format!("environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = \"m.obj\"\n{light}");
    scene(&shop.write("scene.toml", &text))
}

fn renderer(gpu: &Arc<Gpu>, scene: &Scene, light: LightModel, model: Model, eyes: u32) -> Renderer {
    let settings =
        RenderSettings { light, model, samples: 1, output: Output::Linear, cube_size: 16, ..Default::default() };
    Renderer::new(&Context::silent(gpu), scene, settings, [SIZE; 2], eyes).expect("a renderer")
}

/// Radiance of one layer, rows from the top.
fn radiance(gpu: &Arc<Gpu>, renderer: &Renderer, layer: u32) -> Vec<[f32; 4]> {
    let bytes = read_image(gpu, renderer.picture(), Subresource { mip: 0, layer }, Output::Linear.bytes());
    bytemuck::pod_collect_to_vec(&bytes.expect("a picture"))
}

fn draw(gpu: &Arc<Gpu>, scene: &Scene, light: LightModel, eyes: &[Eye]) -> Vec<Vec<[f32; 4]>> {
    let count = eyes.len() as u32;
    let mut renderer = renderer(gpu, scene, light, Model::Everything, count);
    draw_frame(gpu, &mut renderer, &FrameInputs::of(scene, eyes));
    (0..count).map(|layer| radiance(gpu, &renderer, layer)).collect()
}

/// One eye's picture with all that the scene needs.
fn draw_needed(gpu: &Arc<Gpu>, scene: &Scene, eye: &Eye) -> Vec<[f32; 4]> {
    let mut renderer = renderer(gpu, scene, LightModel::Direct, Model::Needed, 1);
    draw_frame(gpu, &mut renderer, &FrameInputs::of(scene, &[*eye]));
    radiance(gpu, &renderer, 0)
}

/// For each eye and pixel the share of the lamp's light that reaches it; `None` where it gives none.
fn visibility(gpu: &Arc<Gpu>, scene: &Scene, eyes: &[Eye]) -> Vec<Vec<Option<f64>>> {
    let [open, direct] = [LightModel::Open, LightModel::Direct].map(|light| draw(gpu, scene, light, eyes));
    let share = |(open, direct): (&[f32; 4], &[f32; 4])| (open[0] > 1e-5).then(|| f64::from(direct[0] / open[0]));
    open.iter().zip(&direct).map(|(open, direct)| open.iter().zip(direct).map(share).collect()).collect()
}

/// Where the ray through a pixel meets the triangles first: the point and the triangle's normal, towards the eye.
fn seen(eye: &Eye, [x, y]: [f64; 2], triangles: &[Triangle]) -> Option<(DVec3, DVec3)> {
    let at = |i: f64, from: f32, to: f32| f64::from(from) + (i + 0.5) / f64::from(SIZE) * f64::from(to - from);
    let view = DVec3::new(at(x, eye.left, eye.right), at(y, eye.up, eye.down), -1.0);
    let from = eye.position().as_dvec3();
    let d = eye.world_from_view.as_dmat4().transform_vector3(view);
    let hits = triangles.iter().filter_map(|t| Some((hit(from, d, *t).filter(|at| *at > 0.0)?, t)));
    let (along, [a, b, c]) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let n = (*b - *a).cross(*c - *a).normalize();
    Some((from + along * d, if n.dot(d) > 0.0 { -n } else { n }))
}

/// Compares every pixel with rays, but for those so near a shadow's edge that a map cannot tell: two texels and a half, as
/// the surface sees them, and a pixel. Returns the numbers of lit, dark and skipped pixels that the lamp's side shows.
fn compare(gpu: &Arc<Gpu>, name: &str, triangles: &[Triangle], lamp: DVec3, eyes: &[Eye]) -> [usize; 3] {
    let mut counts = [0; 3];
    let pictures = visibility(gpu, &matte(triangles, lamp, 0.0), eyes);
    for (eye, shares) in eyes.iter().zip(pictures) {
        for (i, share) in (0..).zip(shares) {
            let pixel = [f64::from(i % SIZE), f64::from(i / SIZE)];
            let (Some((p, n)), Some(share)) = (seen(eye, pixel, triangles), share) else { continue };
            let next = |x, y| seen(eye, [pixel[0] + x, pixel[1] + y], triangles).map_or(1.0, |(q, _)| p.distance(q));
            let l = (lamp - p).normalize();
            if n.dot(l) < 0.02 {
                continue;
            }
            let reach = 2.5 * 2.0 * FACE_TANGENT * p.distance(lamp) / FACE / n.dot(l).max(0.1)
                + next(1.0, 0.0).max(next(0.0, 1.0));
            let (t, b) = (n.any_orthonormal_vector(), n.cross(n.any_orthonormal_vector()));
            let around = (0..16).map(|k| {
                let phi = f64::from(k) * std::f64::consts::TAU / 16.0;
                let q = p + reach * if k % 2 == 0 { 1.0 } else { 0.5 } * (phi.cos() * t + phi.sin() * b);
                is_blocked(q + 1e-7 * n, lamp, triangles, 1e-6)
            });
            let blocked = is_blocked(p + 1e-7 * n, lamp, triangles, 1e-6);
            if around.into_iter().any(|other| other != blocked) {
                counts[2] += 1;
                continue;
            }
            counts[usize::from(blocked)] += 1;
            let want = if blocked { 0.0 } else { 1.0 };
            assert!((share - want).abs() < 0.01, "{name}: {share}, not {want}, at {p:.4}, pixel {pixel:?}");
        }
    }
    println!("{name}: {counts:?} lit, dark and at edges");
    counts
}

fn eye(position: [f32; 3], target: [f32; 3]) -> Eye {
    Eye::looking(position.into(), target.into(), 50.0, 1.0)
}

#[test]
fn shadows_lie_where_rays_say() {
    let things = [
        ("a square over a floor", level([-0.3, 0.3], 1.0, [-0.2, 0.4]), DVec3::new(0.2, 2.5, 0.1)),
        // Wherever the box meets the floor, its shadow begins.
        ("a box on a floor", block([-0.4, 0.0, -0.3], [0.4, 0.5, 0.3]), DVec3::new(1.5, 1.6, 0.9)),
        ("a box and a low lamp", block([-0.2, 0.0, -0.2], [0.2, 0.4, 0.2]), DVec3::new(1.5, 0.5, 1.2)),
        (
            "a wall of no thickness",
            quad([-0.8, 0.0, 0.0], [0.8, 0.0, 0.0], [0.8, 0.6, 0.0], [-0.8, 0.6, 0.0]),
            DVec3::new(0.3, 1.4, 1.1),
        ),
        ("a thin wall", block([-0.8, 0.0, 0.0], [0.8, 0.6, 0.01]), DVec3::new(0.3, 1.4, 1.1)),
        ("a shade 4 cm over the lamp", level([-0.05, 0.05], 1.44, [-0.05, 0.05]), DVec3::new(0.0, 1.4, 0.0)),
    ];
    with_gpu(|gpu| {
        for (name, thing, lamp) in things {
            let mut all_dark = 0;
            let mut triangles = [floor(), thing].concat();
            // A ceiling, and a wall behind, for shadows on other faces of the map.
            triangles.extend(quad([-3.0, 2.8, -3.0], [3.0, 2.8, -3.0], [3.0, 2.8, 3.0], [-3.0, 2.8, 3.0]));
            triangles.extend(quad([-3.0, 0.0, -2.0], [3.0, 0.0, -2.0], [3.0, 3.0, -2.0], [-3.0, 3.0, -2.0]));
            for (view, from) in [("before", [0.9, 1.9, 2.6]), ("behind", [-0.7, 2.2, -1.8]), ("below", [0.6, 0.6, 2.6])]
            {
                let target = if view == "below" { [0.0, 1.6, -0.5] } else { [0.0, 0.1, 0.0] };
                let told = format!("{name} from {view}");
                let [lit, dark, edges] = compare(gpu, &told, &triangles, lamp, &[eye(from, target)]);
                assert!(lit > 500 && 4 * edges < lit + dark, "{told}: {lit} lit, {dark} dark, {edges} at edges");
                all_dark += dark;
            }
            assert!(all_dark > 300, "{name}: {all_dark} dark");
        }
    });
}

#[test]
fn both_eyes_see_the_same_shadow() {
    with_gpu(|gpu| {
        let triangles = [floor(), block([-0.4, 0.0, -0.3], [0.4, 0.5, 0.3])].concat();
        let eyes = eye([0.9, 1.9, 2.6], [0.0; 3]).stereo(IPD_METRES);
        let [lit, dark, _] = compare(gpu, "two eyes", &triangles, DVec3::new(1.5, 1.6, -0.9), &eyes);
        assert!(lit > 1000 && dark > 1000, "{lit} lit, {dark} dark");
    });
}

#[test]
fn nothing_leaves_a_closed_box() {
    with_gpu(|gpu| {
        let triangles = [floor(), block([-0.3, 0.2, -0.3], [0.3, 0.8, 0.3])].concat();
        let lamp = DVec3::new(0.05, 0.5, 0.1);
        let [lit, dark, _] = compare(gpu, "a lamp in a box", &triangles, lamp, &[eye([0.9, 1.9, 2.6], [0.0; 3])]);
        assert!(lit == 0 && dark > 5000, "{lit} lit, {dark} dark");
    });
}

/// Between the straight edge of a level square and the floor, a lamp's disc is seen as far as it lies beyond the edge.
#[test]
fn a_penumbra_is_as_wide_as_the_lamp_seen_past_an_edge() {
    with_gpu(|gpu| {
        for (radius, height) in [(0.1, 1.25), (0.2, 1.25), (0.1, 0.4)] {
            // x < 0 is covered: a floor's point at x sees the lamp beyond the edge where the line to it is at x > 0.
            let triangles = [floor(), level([-2.0, 0.0], height, [-1.0, 1.0])].concat();
            let lamp_height = 2.5;
            let scene = matte(&triangles, DVec3::new(0.0, lamp_height, 0.0), radius);
            let eye = eye([0.5, 0.3, 0.9], [0.0; 3]);
            let shares = visibility(gpu, &scene, &[eye]).remove(0);
            let half_width = radius * height / (lamp_height - height);
            let (mut worst, mut inside, mut sum) = (0f64, 0, 0.0);
            for (i, share) in (0..).zip(shares) {
                let seen = seen(&eye, [f64::from(i % SIZE), f64::from(i / SIZE)], &triangles);
                let (Some((p, _)), Some(share)) = (seen, share) else { continue };
                if p.y > 1e-6 || p.z.abs() > 0.3 || p.x.abs() > 3.0 * half_width {
                    continue;
                }
                let error = share - disc_beyond(-p.x / half_width);
                inside += usize::from(p.x.abs() < half_width);
                (worst, sum) = (worst.max(error.abs()), sum + error);
                // Two texels of the map, on the floor, from where it begins and ends.
                let texel = 2.0 * FACE_TANGENT * lamp_height / FACE;
                if p.x.abs() > half_width + 2.0 * texel {
                    assert!(error.abs() < 0.02, "{radius} {height}: {share} at {p:.4}, beyond the penumbra");
                }
            }
            println!("radius {radius}, edge at {height}: worst {worst}, {inside} inside");
            assert!(worst < 0.1 && inside > 150, "radius {radius}, edge at {height}: {worst} in {inside}");
        }
    });
}

/// Shares of the sun's light on the floor, with and without a thing on it or over it: points of the floor, and what reaches them.
fn sunlit(gpu: &Arc<Gpu>, thing: &[Triangle], towards: DVec3, eye: &Eye) -> (Vec<(DVec3, f64)>, Sun) {
    let (alone, all) = (floor(), [floor(), thing.to_vec()].concat());
    let ((without, _), (with, sun)) = (sunny(&alone, towards), sunny(&all, towards));
    let picture = |scene: &Scene| draw_needed(gpu, scene, eye);
    let (lit, shaded) = (picture(&without), picture(&with));
    let point = |i: usize| {
        let (p, _) = seen(eye, [f64::from(i as u32 % SIZE), f64::from(i as u32 / SIZE)], &all)?;
        (p.y.abs() < 1e-9).then(|| (p, f64::from(shaded[i][0] / lit[i][0])))
    };
    ((0..lit.len()).filter_map(point).collect(), sun)
}

#[test]
fn the_suns_shadow_lies_where_rays_say_and_begins_at_the_foot() {
    with_gpu(|gpu| {
        for (name, thing) in [
            ("a box", block([-0.4, 0.0, -0.3], [0.4, 0.5, 0.3])),
            ("a thin wall", block([-0.8, 0.0, 0.0], [0.8, 0.6, 0.01])),
        ] {
            let towards = DVec3::new(0.5, 0.6, 0.62).normalize();
            for from in [[0.9, 1.9, 2.6], [-0.7, 2.2, -1.8]] {
                let (points, sun) = sunlit(gpu, &thing, towards, &eye(from, [0.0, 0.1, 0.0]));
                let mut counts = [0; 3];
                for (p, share) in points {
                    let around = (0..16).map(|k| {
                        let phi = f64::from(k) * std::f64::consts::TAU / 16.0;
                        // The disc's shadow of an edge 0.6 m up, and two texels and a half of 6 m in 2048.
                        let reach = 0.6 * sun.angular_radius.tan() / sun.direction.y.powi(2) + 0.01;
                        let q = p + reach * DVec3::new(phi.cos(), 0.0, phi.sin());
                        is_blocked(q + 1e-7 * DVec3::Y, q + 50.0 * sun.direction, &thing, 1e-6)
                    });
                    let blocked = is_blocked(p + 1e-7 * DVec3::Y, p + 50.0 * sun.direction, &thing, 1e-6);
                    if around.into_iter().any(|other| other != blocked) {
                        counts[2] += 1;
                        continue;
                    }
                    counts[usize::from(blocked)] += 1;
                    let want = if blocked { 0.0 } else { 1.0 };
                    assert!((share - want).abs() < 0.02, "{name}: {share}, not {want}, at {p:.4}");
                }
                println!("{name}, sun: {counts:?} lit, dark and at edges");
                assert!(counts[0] > 3000 && counts[2] * 3 < counts[0], "{name}: {counts:?}");
                assert!(counts[1] > 100 || from[2] > 0.0, "{name}: {counts:?}");
            }
        }
    });
}

/// A room whose walls have no thickness, from within: shadow maps know its edges to half a texel.
#[test]
fn no_sun_shines_through_the_edges_of_thin_walls() {
    with_gpu(|gpu| {
        let room = [block([-2.0, 0.0, -1.5], [2.0, 2.5, 1.5]), block([-0.2, 0.0, -0.3], [0.2, 0.2, 0.3])].concat();
        let brightest = |triangles: &[Triangle], towards, eye: &Eye| {
            let picture = draw_needed(gpu, &sunny(triangles, towards).0, eye);
            picture.into_iter().map(|pixel| pixel[0]).collect::<Vec<f32>>()
        };
        for towards in [[0.80, 0.18, 0.58], [-0.3, 0.8, 0.5], [0.6, 0.5, -0.6]].map(|t| DVec3::from(t).normalize()) {
            let lit = brightest(&floor(), DVec3::Y, &eye([0.0, 1.0, 1.0], [0.0; 3])).into_iter().fold(0.0, f32::max);
            let mut bright = 0;
            for target in [[-2.0, 2.5, -1.5], [2.0, 2.5, 1.5], [-2.0, 0.0, 1.5], [2.0, 0.0, -1.5]] {
                let inside = eye([0.1, 1.2, 0.05], target);
                bright += brightest(&room, towards, &inside).into_iter().filter(|light| *light > 0.1 * lit).count();
            }
            println!("sun at {towards:.2}: {bright} bright pixels");
            assert!(bright < 30, "sun at {towards:.2}: {bright} bright pixels");
        }
    });
}

#[test]
fn the_suns_penumbra_has_the_width_of_its_disc() {
    with_gpu(|gpu| {
        for height in [0.5, 1.5] {
            let eye = eye([0.2, 0.4, 1.0], [-0.4, 0.0, 0.0]);
            let thing = level([-2.0, 0.0], height, [-2.0, 2.0]);
            let (points, sun) = sunlit(gpu, &thing, DVec3::new(0.35, 0.9, 0.1).normalize(), &eye);
            let s = sun.direction;
            // The edge's shadow, and how far it moves when the sun does by its radius.
            let (middle, half_width) =
                (-height * s.x / s.y, height * sun.angular_radius.tan() * s.x.hypot(s.y) / (s.y * s.y));
            let near = points.iter().filter(|(p, _)| (p.x - middle).abs() < 4.0 * half_width && p.z.abs() < 0.5);
            let (mut worst, mut inside) = (0f64, 0);
            for (p, share) in near {
                let at = (p.x - middle) / half_width;
                let error = (share - disc_beyond(-at)).abs();
                inside += usize::from(at.abs() < 1.0);
                worst = worst.max(error);
                // Two texels of 6 m in 2048 beyond the penumbra.
                assert!((p.x - middle).abs() < half_width + 0.006 || error < 0.02, "{height}: {share} at {p:.4}");
            }
            println!("edge at {height} m: penumbra of {half_width:.4} m, worst {worst:.3}, {inside} inside");
            assert!(worst < 0.12 && inside > 150, "{height} m: {worst}, {inside} inside");
        }
    });
}

#[test]
fn the_suns_map_is_drawn_again_when_it_turns() {
    with_gpu(|gpu| {
        let triangles = [floor(), block([-0.4, 0.0, -0.3], [0.4, 0.5, 0.3])].concat();
        let (scene, _) = sunny(&triangles, DVec3::new(0.5, 0.6, 0.62).normalize());
        let mut renderer = renderer(gpu, &scene, LightModel::Direct, Model::Needed, 1);
        let eyes = [eye([0.9, 1.9, 2.6], [0.0; 3])];
        let still = FrameInputs::of(&scene, &eyes);
        let turned = FrameInputs { environment_rotation: 1.0, ..still };
        let moved = FrameInputs { world_from_models: Mat4::from_translation(Vec3::X), ..turned };
        let pictures =
            [(still, 1), (still, 1), (turned, 2), (moved, 3), (moved, 3), (still, 4)].map(|(inputs, drawings)| {
                draw_frame(gpu, &mut renderer, &inputs);
                assert_eq!(renderer.shadow_drawings(), drawings);
                radiance(gpu, &renderer, 0)
            });
        assert!(pictures[0] == pictures[1] && pictures[0] == pictures[5] && pictures[0] != pictures[2]);
    });
}

/// A plane and a ball alone have no shadow on them, though all is modelled, wherever the lamp is and whatever its size.
#[test]
fn nothing_shades_itself() {
    let mut ball = scene(&shipped("sphere.toml"));
    ball.environment.panorama = Panorama::from_fn(16, 8, |_| Vec3::ZERO);
    with_gpu(|gpu| {
        for (degrees, radius) in [1.5f64, 4.0, 10.0, 30.0, 60.0, 90.0].into_iter().flat_map(|d| [(d, 0.0), (d, 0.05)]) {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let lamp = 2.0 * DVec3::new(0.8 * cos, sin, 0.6 * cos);
            let plane = floor();
            let shares = visibility(gpu, &matte(&plane, lamp, radius), &[eye([0.4, 1.1, 1.3], [0.0; 3])]).remove(0);
            let darkest = shares.iter().flatten().copied().fold(1.0, f64::min);
            assert!(shares.iter().flatten().count() > 10_000 && darkest > 0.99, "{degrees}°, {radius} m: {darkest}");
            let mut scene = ball.clone();
            scene.lights[0].position = lamp.as_vec3();
            scene.lights[0].radius = radius as f32;
            let eye = eye([0.1, 0.3, 1.5], [0.0; 3]);
            let [open, direct] =
                [LightModel::Open, LightModel::Direct].map(|light| draw(gpu, &scene, light, &[eye]).remove(0));
            let (mut lit, mut dark) = (0, 0);
            for (i, (open, direct)) in (0u32..).zip(open.iter().zip(&direct)) {
                let from = eye.position().as_dvec3();
                let at =
                    |i: u32, a: f32, b: f32| f64::from(a) + (f64::from(i) + 0.5) / f64::from(SIZE) * f64::from(b - a);
                let view = DVec3::new(at(i % SIZE, eye.left, eye.right), at(i / SIZE, eye.up, eye.down), -1.0);
                let d = eye.world_from_view.as_dmat4().transform_vector3(view).normalize();
                let b = from.dot(d);
                let under = b * b - from.length_squared() + 0.25;
                // The ball of radius 1/2, but for its rim and where the lamp's light only grazes it.
                if under < 0.01 {
                    continue;
                }
                let p = from + d * (-b - under.sqrt());
                if p.normalize().dot((lamp - p).normalize()) > 0.06 {
                    lit += 1;
                    dark += usize::from(direct[0] < 0.985 * open[0]);
                }
            }
            assert!(lit > 1000 && dark == 0, "a ball, {degrees}°, {radius} m: {dark} of {lit} are darker");
        }
    });
}

#[test]
fn holes_let_light_through() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    // Opaque for u < 1/2.
    let mask: Vec<u8> = (0..64 * 64).map(|i| if i % 64 < 32 { 255 } else { 0 }).collect();
    image::save_buffer(shop.path("mask.png"), &mask, 64, 64, image::ColorType::L8).expect("a mask");
    shop.write("m.mtl", &(material([0.5; 3], 0.0, 1.0) + "newmtl leaf\nKd 0.5 0.5 0.5\nPr 1\nmap_d mask.png\n"));
    let obj = "mtllib m.mtl\nvn 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        v -3 0 3\nv 3 0 3\nv 3 0 -3\nv -3 0 -3\nusemtl m\nf 1/1/1 2/2/1 3/3/1 4/4/1\n\
        v -0.5 1 0.5\nv 0.5 1 0.5\nv 0.5 1 -0.5\nv -0.5 1 -0.5\nusemtl leaf\nf 5/1/1 6/2/1 7/3/1 8/4/1\n";
    shop.write("m.obj", obj);
    let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"m.obj\"\n[[light]]\n\
        point = { position = [0, 2, 0], intensity = [9, 9, 9] }\n";
    let scene = scene(&shop.write("scene.toml", text));
    let floor = floor();
    with_gpu(|gpu| {
        let eye = eye([0.0, 0.7, 2.6], [0.0, -0.2, 0.0]);
        let shares = visibility(gpu, &scene, &[eye]).remove(0);
        let mut counts = [0; 2];
        for (i, share) in (0..).zip(shares) {
            let seen = seen(&eye, [f64::from(i % SIZE), f64::from(i / SIZE)], &floor);
            let (Some((p, _)), Some(share)) = (seen, share) else { continue };
            // The square's shadow is twice as wide: from −1 to 1; of it the left half is there.
            let to_edge = p.x.abs().min((p.x + 1.0).abs()).min((p.z.abs() - 1.0).abs());
            if to_edge > 0.05 {
                let dark = p.x < 0.0 && p.x > -1.0 && p.z.abs() < 1.0;
                counts[usize::from(dark)] += 1;
                let want = if dark { 0.0 } else { 1.0 };
                assert!((share - want).abs() < 0.01, "{share}, not {want}, at {p:.3}");
            }
        }
        assert!(counts[0] > 2000 && counts[1] > 500, "{counts:?}");
    });
}

#[test]
fn maps_are_drawn_again_when_models_move_and_not_otherwise() {
    with_gpu(|gpu| {
        let triangles = [floor(), block([-0.4, 0.0, -0.3], [0.4, 0.5, 0.3])].concat();
        let scene = matte(&triangles, DVec3::new(1.5, 1.6, 0.9), 0.02);
        let make = || renderer(gpu, &scene, LightModel::Direct, Model::Needed, 1);
        let mut renderer = make();
        assert_eq!(renderer.shadow_drawings(), 0);
        let eyes = [eye([0.9, 1.9, 2.6], [0.0; 3]), eye([-0.9, 1.9, 2.6], [0.0; 3])];
        let still = FrameInputs::of(&scene, &eyes[..1]);
        let moved = Mat4::from_rotation_translation(glam::Quat::from_rotation_y(0.6), Vec3::new(0.2, 0.0, -0.3));
        let frames = [
            (still, 1),
            (still, 1),
            (FrameInputs { eyes: &eyes[1..], exposure_ev: 2.0, environment_rotation: 1.0, ..still }, 1),
            (FrameInputs { world_from_models: moved, ..still }, 2),
            (FrameInputs { world_from_models: moved, ..still }, 2),
            (still, 3),
        ];
        let pictures = frames.map(|(inputs, drawings)| {
            draw_frame(gpu, &mut renderer, &inputs);
            assert_eq!(renderer.shadow_drawings(), drawings);
            radiance(gpu, &renderer, 0)
        });
        assert!(pictures[0] == pictures[5] && pictures[3] == pictures[4] && pictures[0] != pictures[3]);
        let mut fresh = make();
        draw_frame(gpu, &mut fresh, &frames[3].0);
        assert!(radiance(gpu, &fresh, 0) == pictures[3], "a moved model's shadow is that of a new renderer");
    });
}

/// Without a lamp, with nothing that casts, or with open light, no map is drawn; and open light shows no trace of a box.
#[test]
fn no_map_is_drawn_where_none_is_needed() {
    with_gpu(|gpu| {
        let (lamp, view) = (DVec3::new(1.5, 1.6, 0.9), [eye([0.9, 1.9, 2.6], [0.0; 3])]);
        let boxed = [floor(), block([-0.4, 0.0, -0.3], [0.4, 0.5, 0.3])].concat();
        let drawings = |scene: &Scene, light, model| {
            let mut renderer = renderer(gpu, scene, light, model, 1);
            draw_frame(gpu, &mut renderer, &FrameInputs::of(scene, &view));
            renderer.shadow_drawings()
        };
        let (direct, open) = (LightModel::Direct, LightModel::Open);
        assert_eq!(drawings(&matte(&boxed, lamp, 0.0), direct, Model::Needed), 1);
        assert_eq!(drawings(&matte(&boxed, lamp, 0.0), open, Model::Needed), 0);
        assert_eq!(drawings(&matte(&floor(), lamp, 0.0), direct, Model::Needed), 0);
        assert_eq!(drawings(&matte(&floor(), lamp, 0.0), direct, Model::Everything), 1);
        let dark = Scene { lights: vec![], ..matte(&boxed, lamp, 0.0) };
        assert_eq!(drawings(&dark, direct, Model::Everything), 0);
        let [with, without] = [&boxed, &floor()].map(|t| draw(gpu, &matte(t, lamp, 0.0), open, &view).remove(0));
        let beside = |i: &usize| {
            let pixel = [(*i as u32 % SIZE).into(), (*i as u32 / SIZE).into()];
            seen(&view[0], pixel, &boxed).is_some_and(|(p, _)| p.y < 1e-6 && p.x.abs().max(p.z.abs()) > 0.45)
        };
        let differing = (0..with.len()).filter(beside).filter(|i| with[*i] != without[*i]).count();
        assert_eq!(differing, 0, "pixels of the floor");
    });
}
