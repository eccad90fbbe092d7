//! The lightmap of `--light baked` in scenes whose light is known exactly, beside the reference in others, and with models
//! that no one should make.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec3};
use pbr_vr::asset::Panorama;
use pbr_vr::reference::brdf::{DIELECTRIC_F0, Geometry};
use pbr_vr::reference::energy::{Curve, Energy, Scattering};
use pbr_vr::render::{Eye, LightModel, Shading};
use pbr_vr::scene::{Material, Mesh, Scene};

use crate::common::solids::{
    Quad, Shot, Taken, ball, block, eye, flat, grey, lamp, level, mote, quad, seen, take, take_all, turned, uniform,
    world,
};
use crate::common::stage::with_gpu;

const BAKED: LightModel = LightModel::Baked;
/// Texels along the lightmap where noise, seams or slopes of light are judged.
const FINE: u32 = 256;
/// Far enough for a scene of some 2 m to need no more than the least lightmap.
const FAR: [f64; 3] = [0.0, 12.0, 0.0];

/// A dielectric as the lightmap has it, matt, and as pictures show its diffuse part.
struct Matt {
    base_color: DVec3,
    energy: Energy,
    curve: Curve,
}

impl Matt {
    fn new(material: &Material) -> Self {
        assert_eq!(material.metallic_factor, 0.0);
        let roughness = f64::from(material.roughness_factor);
        Self {
            base_color: material.base_color_factor.as_dvec3(),
            energy: Energy::new(roughness, Geometry::Smith, Scattering::Multiple),
            curve: Curve::new(roughness, Geometry::Smith),
        }
    }

    /// Share of even light that is given back.
    fn albedo(&self) -> f64 {
        let Energy { mean, .. } = self.energy;
        let f0 = DVec3::splat(DIELECTRIC_F0);
        (self.energy.specular_albedo(f0, mean) + self.energy.diffuse_even(self.base_color, 0.0, mean)).x
    }

    /// Irradiance of which the diffuse part is seen at a cosine.
    fn irradiance(&self, radiance: f64, nv: f64) -> f64 {
        PI * radiance / self.energy.diffuse_even(self.base_color, 0.0, self.curve.at(nv)).x
    }
}

/// A picture's soft light as irradiance, with its places and normals; `None` where another mesh than the first ones is seen.
fn soft(scene: &Scene, from: &Eye, taken: &Taken, meshes: usize) -> Vec<Option<(f64, DVec3, DVec3)>> {
    let matt = Matt::new(&scene.materials[0]);
    let at = |(pixel, radiance): (usize, &f64)| {
        let (p, n, mesh) = seen(scene, from, taken.size, pixel)?;
        let nv = n.dot((from.position().as_dvec3() - p).normalize());
        (mesh < meshes).then(|| (matt.irradiance(*radiance, nv), p, n))
    };
    taken.pixels.iter().enumerate().map(at).collect()
}

fn diffuse(size: u32) -> Shot {
    Shot { shading: Shading::Diffuse, ..Shot::new(BAKED, size) }
}

/// Mean, and root of the mean square of deviations from what is wanted, relative.
fn deviations(pairs: &[(f64, f64)]) -> (f64, f64) {
    let count = pairs.len() as f64;
    let wanted = pairs.iter().map(|(_, want)| want).sum::<f64>() / count;
    let mean = pairs.iter().map(|(got, want)| got - want).sum::<f64>() / count / wanted;
    (mean, (pairs.iter().map(|(got, want)| (got - want).powi(2)).sum::<f64>() / count).sqrt() / wanted)
}

/// Wherever a lamp is in a ball, all of its wall gets the same soft light, E ρ / (1 − ρ) for the irradiance E of a lamp in its
/// middle.
#[test]
fn a_lamp_in_a_ball_is_the_integrating_sphere() {
    with_gpu(|gpu| {
        // In the middle light is the same everywhere; near the wall there is a spot, which is found from the lamp.
        for (at, bound) in [([0.0; 3], 0.004), ([0.0, -0.8, 0.4], 0.03)] {
            let things = vec![ball(0, [0.0; 3], 1.0, 24, true), mote(FAR)];
            let scene = world(things, vec![grey(0.6, 0.0, 1.0)], vec![lamp(at, 2.0)], uniform(0.0));
            let albedo = Matt::new(&scene.materials[0]).albedo();
            // Of the facets' area.
            let corner = |i: &u32| Vec3::from(scene.meshes[0].vertices[*i as usize].position).as_dvec3();
            let area = |t: &[u32]| 0.5 * (corner(&t[1]) - corner(&t[0])).cross(corner(&t[2]) - corner(&t[0])).length();
            let area: f64 = scene.meshes[0].indices.chunks_exact(3).map(area).sum();
            let want = 4.0 * PI * 2.0 / area * albedo / (1.0 - albedo);
            let eyes = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.2]].map(|to| eye([0.0, 0.0, 0.1], to, 90.0));
            let taken = take_all(gpu, &scene, &eyes, diffuse(48));
            let of = |(eye, taken)| soft(&scene, eye, taken, 1).into_iter().flatten().map(|(got, ..)| (got, want));
            let pairs: Vec<(f64, f64)> = eyes.iter().zip(&taken).flat_map(of).collect();
            let (mean, spread) = deviations(&pairs);
            println!("lamp at {at:?}: {:+.3} %, spread {:.3} %", 100.0 * mean, 100.0 * spread);
            assert!(mean.abs() < 0.01 && spread < bound + 0.006, "lamp at {at:?}: {mean}, spread {spread}");
        }
    });
}

#[test]
fn no_light_leaves_or_enters_a_closed_box() {
    let thick = || vec![flat(0, &block([-1.0; 3], [1.0; 3])), flat(0, &turned(block([-0.8; 3], [0.8; 3]))), mote(FAR)];
    let scene = |lamp_at, sky| world(thick(), vec![grey(0.8, 0.0, 0.6)], vec![lamp(lamp_at, 30.0)], uniform(sky));
    let out = [[0.0, 0.0, 3.0], [3.0, 0.1, 0.2], [-1.5, -2.0, 1.9], [0.1, 3.0, 0.1], [-2.2, 1.1, -2.0]];
    let out = out.map(|from| eye(from, [0.0; 3], 60.0));
    let within = [[1.0, 0.0, 0.0], [0.3, 1.0, 0.1], [-1.0, -1.0, 1.0]].map(|to| eye([0.1, -0.2, 0.3], to, 90.0));
    with_gpu(|gpu| {
        let lit = take_all(gpu, &scene([0.3, -0.2, 0.1], 0.0), &out, Shot::new(BAKED, 64));
        let dark = take_all(gpu, &scene([2.0, 1.0, 0.0], 5.0), &within, Shot::new(BAKED, 64));
        for (i, taken) in lit.iter().chain(&dark).enumerate() {
            let lit = taken.pixels.iter().filter(|p| **p > 0.0).count();
            assert_eq!(lit, 0, "view {i}: {lit} pixels, at most {}", taken.largest());
        }
    });
}

#[test]
fn white_things_are_invisible_in_a_furnace() {
    let things = vec![
        flat(0, &[level([-1.0, 1.0], -0.5, [-1.0, 1.0])]),
        flat(0, &block([-0.8, -0.5, -0.2], [-0.3, 0.4, 0.3])),
        ball(1, [0.4, 0.0, 0.0], 0.5, 16, false),
        mote(FAR),
    ];
    let scene = world(things, vec![grey(1.0, 0.0, 0.8), grey(1.0, 1.0, 0.5)], vec![], uniform(1.0));
    with_gpu(|gpu| {
        for from in [[0.3, 1.6, 2.2], [-2.0, 0.2, 1.0]] {
            let shot = Shot { lightmap: FINE, ..Shot::new(BAKED, 64) };
            let taken = take(gpu, &scene, &eye(from, [0.0, -0.1, 0.0], 45.0), shot);
            let (low, mean, high) = (taken.quantile(0.001), taken.mean(), taken.quantile(0.999));
            // In corners between white things light bounces more often than is computed: some is missing, none is added.
            println!("mean {mean:.5}, from {low:.4} to {high:.4}");
            assert!((mean - 1.0).abs() < 0.002 && low > 0.98 && high < 1.01, "{mean}, {low}, {high}");
        }
    });
}

/// A smooth wall gives back less of light that comes along its normal than of even light.
#[test]
fn a_smooth_wall_gives_back_less_of_light_along_its_normal() {
    let wall = grey(0.1, 0.0, 0.2);
    let matt = Matt::new(&wall);
    let at_normal = matt.curve.at(1.0);
    let specular = matt.energy.specular_albedo(DVec3::splat(DIELECTRIC_F0), at_normal);
    let given = (specular + matt.energy.diffuse_even(matt.base_color, 0.0, at_normal)).x;
    let lamp_irradiance = 2.0_f64;
    let want = lamp_irradiance * given / (1.0 - matt.albedo());
    let things = vec![ball(0, [0.0; 3], 1.0, 24, true), mote(FAR)];
    let scene = world(things, vec![wall], vec![lamp([0.0; 3], lamp_irradiance as f32)], uniform(0.0));
    let from = eye([0.0, 0.0, 0.1], [0.0, 0.0, -1.0], 90.0);
    with_gpu(|gpu| {
        let taken = take(gpu, &scene, &from, diffuse(32));
        let pairs: Vec<_> = soft(&scene, &from, &taken, 1).into_iter().flatten().map(|(got, ..)| (got, want)).collect();
        let (mean, spread) = deviations(&pairs);
        println!(
            "{:+.2} %, spread {:.2} %; albedo {:.3}, of the lamp's light {given:.3}",
            100.0 * mean,
            100.0 * spread,
            matt.albedo()
        );
        // By the albedo of even light it would be a quarter more.
        assert!(matt.albedo() > 1.2 * given && mean.abs() < 0.05 && spread < 0.06, "{mean}, spread {spread}");
    });
}

/// A smooth floor's specular part has more of grazing light, its diffuse part less, than of light from above.
#[test]
fn a_smooth_floors_diffuse_part_takes_less_of_grazing_light() {
    let floor = Material { base_color_factor: Vec3::splat(0.5), ..grey(0.5, 0.0, 0.2) };
    let matt = Matt::new(&floor);
    // Twenty of the panorama's rows, to 14°.
    let highest = (20.0 * PI / 256.0).sin();
    let sky = Panorama::from_fn(512, 256, |d| Vec3::splat(if d.y > 0.0 && d.y < highest as f32 { 1.0 } else { 0.0 }));
    let plane = flat(0, &[level([-1.0, 1.0], 0.0, [-1.0, 1.0])]);
    let things = vec![plane, ball(0, [0.9, 0.05, 0.9], 0.05, 8, false), mote(FAR)];
    let scene = world(things, vec![floor], vec![], sky);
    let from = eye([0.0, 1.0, 1.5], [0.0; 3], 20.0);
    let seen_at = |pixel: usize| seen(&scene, &from, 32, pixel).filter(|(.., mesh)| *mesh == 0);
    let expected = |p: DVec3| {
        let at_v = matt.curve.at(DVec3::Y.dot((from.position().as_dvec3() - p).normalize()));
        let part = |i: i32| {
            let cosine = (f64::from(i) + 0.5) / 200.0 * highest;
            2.0 * PI * cosine * matt.energy.diffuse(matt.base_color, matt.curve.at(cosine), at_v).x * highest / 200.0
        };
        (0..200).map(part).sum::<f64>()
    };
    with_gpu(|gpu| {
        // Without a lightmap the fall is a fitted one.
        for (light, most) in [(BAKED, 0.01), (LightModel::Open, 0.03)] {
            let taken = take(gpu, &scene, &from, Shot { light, ..diffuse(32) });
            let pairs: Vec<(f64, f64)> =
                (0..32 * 32).filter_map(|pixel| Some((taken.pixels[pixel], expected(seen_at(pixel)?.0)))).collect();
            let (mean, spread) = deviations(&pairs);
            println!("{light:?}: {mean:.4}, {spread:.4} in {} pixels", pairs.len());
            assert!(pairs.len() > 900 && mean.abs() < most && spread < 2.0 * most, "{light:?}: {mean}, {spread}");
        }
    });
}

/// A black floor that is smooth mirrors the sky towards walls, more of it than to the ceiling.
#[test]
fn a_smooth_floor_gives_walls_more_than_its_mean() {
    let sky = Panorama::from_fn(64, 32, |d| Vec3::splat(if d.y > 0.0 { 1.0 } else { 0.0 }));
    let floor = flat(1, &[level([-12.0, 12.0], 0.0, [-12.0, 12.0])]);
    let things = vec![flat(0, &block([-0.25, 0.75, -0.25], [0.25, 1.25, 0.25])), floor];
    let scene = world(things, vec![grey(0.5, 0.0, 1.0), grey(0.0, 0.0, 0.2)], vec![], sky);
    let from = eye([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], 15.0);
    with_gpu(|gpu| {
        let baked = take(gpu, &scene, &from, Shot::new(BAKED, 32));
        let exact = take(gpu, &scene, &from, Shot::reference(BAKED, 32, 64));
        let on_wall = |pixel: &usize| seen(&scene, &from, 32, *pixel).is_some_and(|(.., mesh)| mesh == 0);
        let pixels: Vec<usize> = (0..32 * 32).filter(on_wall).collect();
        let mean = |taken: &Taken| pixels.iter().map(|i| taken.pixels[*i]).sum::<f64>() / pixels.len() as f64;
        let (got, want) = (mean(&baked), mean(&exact));
        println!("{got:.4} for {want:.4} in {} pixels", pixels.len());
        assert!(pixels.len() > 800 && (got / want - 1.0).abs() < 0.015, "{got} for {want}");
    });
}

/// A metal ball, mesh 1, on a floor of this material under an even sky.
fn ball_on(floor: Material) -> Scene {
    let things = vec![flat(0, &[level([-6.0, 6.0], -0.5, [-6.0, 6.0])]), ball(1, [0.0; 3], 0.5, 24, false), mote(FAR)];
    world(things, vec![floor, grey(1.0, 1.0, 0.25)], vec![], uniform(1.0))
}

/// A metal ball mirrors the floor where that hides the sky, and all of the sky above.
#[test]
fn a_metal_ball_mirrors_the_floor_that_hides_the_sky() {
    let scene = ball_on(grey(0.05, 0.0, 1.0));
    let from = eye([0.0, 0.3, 2.6], [0.0; 3], 26.0);
    with_gpu(|gpu| {
        let baked = take(gpu, &scene, &from, Shot::new(BAKED, 48));
        let exact = take(gpu, &scene, &from, Shot::reference(BAKED, 48, 24));
        let on_ball = |pixel| seen(&scene, &from, 48, pixel).filter(|(.., mesh)| *mesh == 1);
        let pairs = |sees: &dyn Fn(DVec3) -> bool| -> Vec<(f64, f64)> {
            let pixels = (0..48 * 48).filter(|pixel| on_ball(*pixel).is_some_and(|(_, n, _)| sees(n)));
            pixels.map(|pixel| (baked.pixels[pixel], exact.pixels[pixel])).collect()
        };
        let mean =
            |pairs: &[(f64, f64)]| pairs.iter().fold(DVec2::ZERO, |sum, p| sum + DVec2::from(*p)) / pairs.len() as f64;
        let (upper, lower, all) = (pairs(&|n| n.y > 0.3), pairs(&|n| n.y < -0.3), pairs(&|_| true));
        let error = all.iter().map(|(got, want)| (got - want).abs()).sum::<f64>() / all.len() as f64;
        let (up, low) = (mean(&upper), mean(&lower));
        println!("upper {up}, lower {low}, mean error {error:.4} of {} pixels", all.len());
        assert!((up.x - up.y).abs() < 0.04 && (low.x - low.y).abs() < 0.02 && error < 0.09, "{up} {low} {error}");
    });
}

/// The floor's own colour, not that of all light: the channel that is seen is strong or weak in it.
#[test]
fn a_metal_ball_mirrors_the_colour_of_the_floor() {
    let from = eye([0.0, 0.3, 2.6], [0.0; 3], 26.0);
    with_gpu(|gpu| {
        for colour in [[0.9, 0.1, 0.1], [0.1, 0.9, 0.9]] {
            let scene = ball_on(Material { base_color_factor: colour.into(), ..grey(1.0, 0.0, 1.0) });
            let baked = take(gpu, &scene, &from, Shot::new(BAKED, 48));
            let exact = take(gpu, &scene, &from, Shot::reference(BAKED, 48, 24));
            let below = |pixel| seen(&scene, &from, 48, pixel).is_some_and(|(_, n, mesh)| mesh == 1 && n.y < -0.1);
            let pixels: Vec<usize> = (0..48 * 48).filter(|pixel| below(*pixel)).collect();
            let mean = |taken: &Taken| pixels.iter().map(|i| taken.pixels[*i]).sum::<f64>() / pixels.len() as f64;
            let (got, want) = (mean(&baked), mean(&exact));
            println!("{colour:?}: {got:.4} for {want:.4} in {} pixels", pixels.len());
            assert!(pixels.len() > 100 && (got / want - 1.0).abs() < 0.1, "{colour:?}: {got} for {want}");
        }
    });
}

/// The walls and the ceiling of a room of 2 m, without its floor, and the window in one of them.
fn walls_with_window() -> (Vec<Quad>, Quad) {
    let window = quad([[-0.3, 1.2, -1.0], [0.3, 1.2, -1.0], [0.3, 1.7, -1.0], [-0.3, 1.7, -1.0]]);
    let wall =
        |[x0, x1]: [f64; 2], [y0, y1]: [f64; 2]| quad([[x0, y0, -1.0], [x1, y0, -1.0], [x1, y1, -1.0], [x0, y1, -1.0]]);
    let mut walls: Vec<Quad> = turned(block([-1.0, 0.0, -1.0], [1.0, 2.0, 1.0])).to_vec();
    walls.retain(|corners| corners.iter().any(|c| c.y > 0.0) && corners.iter().any(|c| c.z > -1.0));
    let beside =
        [([-1.0, -0.3], [0.0, 2.0]), ([0.3, 1.0], [0.0, 2.0]), ([-0.3, 0.3], [0.0, 1.2]), ([-0.3, 0.3], [1.7, 2.0])];
    walls.extend(beside.map(|(x, y)| wall(x, y)));
    assert_eq!(walls.len(), 8);
    (walls, window)
}

/// White walls that get their light by a bright patch of the sky through a window: few samples of a bounce find that. Those that
/// do not may put a texel below zero, which must not be lost.
#[test]
fn a_room_with_a_window_gets_no_light_from_noise() {
    let towards = Vec3::new(0.2, 0.4, -1.0).normalize();
    let sky = Panorama::from_fn(256, 128, |d| Vec3::splat(if d.dot(towards) > 0.98 { 100.0 } else { 1.0 }));
    let (walls, _) = walls_with_window();
    let things = vec![flat(0, &[level([-1.0, 1.0], 0.0, [-1.0, 1.0])]), flat(0, &walls), mote(FAR)];
    let scene = world(things, vec![grey(0.8, 0.0, 1.0)], vec![], sky);
    let from = eye([0.8, 1.6, -0.8], [-0.4, 0.8, 1.0], 90.0);
    with_gpu(|gpu| {
        let baked = take(gpu, &scene, &from, Shot { lightmap: FINE, ..Shot::new(BAKED, 48) }).mean();
        let exact = take(gpu, &scene, &from, Shot::reference(BAKED, 48, 64)).mean();
        println!("{baked:.4} for {exact:.4}, {:+.2} %", 100.0 * (baked / exact - 1.0));
        assert!((baked / exact - 1.0).abs() < 0.02, "{baked} for {exact}");
    });
}

/// A floor that gets its light through a small window, beside a partition: closed form but for what little the black walls give
/// back. Few samples find the window; the filter leaves little of their noise, and the edge of the shadow where it is.
#[test]
fn noise_is_taken_out_and_shadows_stay() {
    let (walls, window) = walls_with_window();
    let floor = level([-1.0, 1.0], 0.0, [-1.0, 1.0]);
    let [low, high] = [DVec3::new(-1.0, 0.0, -0.1), DVec3::new(0.2, 0.5, 0.0)];
    let things = vec![flat(0, &[floor]), flat(1, &walls), flat(1, &block(low.into(), high.into())), mote(FAR)];
    let scene = world(things, vec![grey(0.5, 0.0, 1.0), grey(0.0, 0.0, 1.0)], vec![], uniform(1.0));
    let from = eye([0.0, 1.9, 0.9], [0.0, 0.0, 0.1], 90.0);
    let blocked = |p: DVec3, q: DVec3| {
        let d = q - p;
        let (a, b) = ((low - p) / d, (high - p) / d);
        a.min(b).max_element().max(0.0) < a.max(b).min_element().min(1.0)
    };
    let irradiance = |p: DVec3| {
        let steps = 24;
        let at = |i: i32| (f64::from(i) + 0.5) / f64::from(steps);
        let cell = |(i, j): (i32, i32)| {
            let q = window[0] + (window[1] - window[0]) * at(i) + (window[3] - window[0]) * at(j);
            let d = q - p;
            if blocked(p, q) { 0.0 } else { d.y * -d.z / d.length_squared().powi(2) }
        };
        let area = 0.6 * 0.5 / f64::from(steps * steps);
        (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))).map(cell).sum::<f64>() * area
    };
    with_gpu(|gpu| {
        let taken = take(gpu, &scene, &from, Shot { lightmap: FINE, ..diffuse(64) });
        let at: Vec<(f64, DVec3)> =
            soft(&scene, &from, &taken, 1).into_iter().flatten().map(|(e, p, _)| (e, p)).collect();
        let pairs = |is_in: &dyn Fn(f64, DVec3) -> bool| -> Vec<(f64, f64)> {
            let pairs = at.iter().map(|(got, p)| (*got, irradiance(*p), *p));
            pairs.filter(|(_, want, p)| is_in(*want, *p)).map(|(got, want, _)| (got, want)).collect()
        };
        let most = irradiance(DVec3::new(0.6, 0.0, 0.4));
        let lit = pairs(&|_, p| p.x > 0.4 && p.z > -0.4 && p.x < 0.95);
        let dark = pairs(&|want, p| want < 0.001 * most && p.z > 0.02);
        let (mean, spread) = deviations(&lit);
        let shadow = dark.iter().map(|(got, _)| got).sum::<f64>() / dark.len() as f64 / most;
        println!(
            "{} lit: {:+.2} %, spread {:.2} %; {} dark: {shadow:.4}",
            lit.len(),
            100.0 * mean,
            100.0 * spread,
            dark.len()
        );
        assert!(lit.len() > 100 && dark.len() > 100);
        // Without the filter the spread is 63 %, and the shadow .023.
        assert!(mean.abs() < 0.05 && spread < 0.3 && shadow < 0.04, "{mean}, {spread}, {shadow}");
    });
}

/// A panel that shines two centimetres below the ceiling lights that so brightly that few rays, which find it, would make specks. So
/// does a lamp before the wall behind the eye.
#[test]
fn a_panel_below_the_ceiling_makes_no_specks() {
    let panel = Material { emissive_factor: Vec3::splat(5.0), ..grey(0.5, 0.0, 1.0) };
    let room = turned(block([-3.0, 0.0, -3.0], [3.0, 3.0, 3.0]));
    let things = vec![flat(0, &room), flat(1, &block([-0.2, 2.95, -0.2], [0.2, 2.98, 0.2])), mote(FAR)];
    let lights = vec![lamp([0.3, 1.5, 2.9], 0.2)];
    let scene = world(things, vec![grey(0.7, 0.0, 1.0), panel], lights, uniform(0.0));
    let from = eye([0.0, 1.6, 2.7], [0.0, 0.8, -0.8], 70.0);
    with_gpu(|gpu| {
        let size = 48;
        let baked = take(gpu, &scene, &from, Shot { lightmap: FINE, ..Shot::new(BAKED, size) });
        let exact = take(gpu, &scene, &from, Shot::reference(BAKED, size, 64)).mean();
        let at = |x: usize, y: usize| baked.pixels[y * size as usize + x];
        // By how much a pixel is brighter than those two beside it on both sides, which light that changes evenly is not.
        let inside = || 2..size as usize - 2;
        let speck = |(x, y): (usize, usize)| at(x, y) / (at(x - 2, y) + at(x + 2, y)) * 2.0 - 1.0;
        let worst = inside().flat_map(|y| inside().map(move |x| (x, y))).map(speck).fold(0.0, f64::max);
        let off = baked.mean() / exact - 1.0;
        println!("{:+.2} %, worst speck {:.1} %", 100.0 * off, 100.0 * worst);
        assert!(off.abs() < 0.03 && worst < 0.1, "{off}, {worst}");
    });
}

/// A single sheet, lit on one side; and one that parts a room.
#[test]
fn a_sheets_sides_have_their_own_light() {
    let sheet = |half: f64| quad([[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]]);
    let alone = vec![flat(0, &[sheet(1.0)]), mote(FAR)];
    let parted = vec![flat(0, &turned(block([-1.0; 3], [1.0; 3]))), flat(0, &[sheet(1.0)]), mote(FAR)];
    let sides = |z: f64| eye([0.3, 0.2, z], [0.0; 3], 60.0);
    with_gpu(|gpu| {
        for (name, things) in [("alone", alone), ("in a room", parted)] {
            for z in [0.6, -0.6] {
                let scene =
                    world(things.clone(), vec![grey(0.7, 0.0, 1.0)], vec![lamp([0.1, 0.2, z], 5.0)], uniform(0.0));
                let eyes = [sides(0.7), sides(-0.7)];
                let [mut lit, mut dark] =
                    <[Taken; 2]>::try_from(take_all(gpu, &scene, &eyes, Shot::new(BAKED, 48))).ok().unwrap();
                if z < 0.0 {
                    std::mem::swap(&mut lit, &mut dark);
                }
                let middle = |taken: &Taken| taken.pixels[24 * 48 + 24];
                println!(
                    "{name}, lamp at {z}: {:.5} and {:.2e}, at most {:.2e}",
                    middle(&lit),
                    dark.mean(),
                    dark.largest()
                );
                assert!(middle(&lit) > 0.1);
                if name == "alone" {
                    assert_eq!(dark.largest(), 0.0, "lamp at {z}");
                } else {
                    // Texels of the walls lie on both sides of the sheet's edges: a line of light beside them, and what it
                    // gives to the rest.
                    assert!(middle(&dark) < 0.01 * middle(&lit), "lamp at {z}: {} of {}", middle(&dark), middle(&lit));
                }
            }
        }
    });
}

/// Irradiance of a polygon of unit radiance: Lambert (1760), by its edges as seen from p. All of it is above p's horizon.
fn polygon_irradiance(p: DVec3, n: DVec3, corners: &Quad) -> f64 {
    let d = corners.map(|c| (c - p).normalize());
    let edge = |i: usize| {
        let (a, b) = (d[i], d[(i + 1) % 4]);
        let across = a.cross(b);
        across.length().atan2(a.dot(b)) * n.dot(across.normalize_or_zero())
    };
    (0.5 * (0..4).map(edge).sum::<f64>()).abs()
}

/// Soft light in a room of flat rectangles that hide nothing from each other, by radiosity between small patches.
struct Radiosity {
    /// With what each gives back, W/(m² sr).
    patches: Vec<(Quad, DVec3, f64)>,
}

impl Radiosity {
    fn new(faces: &[Quad], along: usize, albedo: f64, lamp: DVec3, intensity: f64) -> Self {
        let mut patches = Vec::new();
        for [a, b, _, d] in faces {
            let n = (*b - *a).cross(*d - *a).normalize();
            let at =
                |i: usize, j: usize| *a + (*b - *a) * (i as f64 / along as f64) + (*d - *a) * (j as f64 / along as f64);
            for (i, j) in (0..along).flat_map(|i| (0..along).map(move |j| (i, j))) {
                patches.push(([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], n, 0.0));
            }
        }
        let centre = |q: &Quad| 0.25 * (q[0] + q[1] + q[2] + q[3]);
        let direct = |p: DVec3, n: DVec3| {
            let to = lamp - p;
            intensity * n.dot(to).max(0.0) / to.length().powi(3)
        };
        // The mean over a patch, as near a lamp it changes within one.
        let mean_direct = |q: &Quad, n: DVec3| {
            let at = |k: usize| {
                let (s, t) = ((k % 8) as f64 / 8.0 + 1.0 / 16.0, (k / 8) as f64 / 8.0 + 1.0 / 16.0);
                direct(q[0] + s * (q[1] - q[0]) + t * (q[3] - q[0]), n)
            };
            (0..64).map(at).sum::<f64>() / 64.0
        };
        let first: Vec<f64> = patches.iter().map(|(q, n, _)| albedo / PI * mean_direct(q, *n)).collect();
        let factors: Vec<Vec<f64>> = patches
            .iter()
            .map(|(q, n, _)| {
                let p = centre(q);
                let seen = |(other, m, _): &(Quad, DVec3, f64)| {
                    if m.dot(*n) > 0.999 { 0.0 } else { polygon_irradiance(p, *n, other) }
                };
                patches.iter().map(seen).collect()
            })
            .collect();
        let mut given = first.clone();
        for _ in 0..60 {
            let next =
                |i: usize| first[i] + albedo / PI * factors[i].iter().zip(&given).map(|(f, l)| f * l).sum::<f64>();
            given = (0..given.len()).map(next).collect();
        }
        patches.iter_mut().zip(given).for_each(|(patch, given)| patch.2 = given);
        Self { patches }
    }

    fn irradiance(&self, p: DVec3, n: DVec3) -> f64 {
        let others = self.patches.iter().filter(|(_, m, _)| m.dot(n) < 0.999);
        others.map(|(q, _, given)| given * polygon_irradiance(p, n, q)).sum()
    }
}

#[test]
fn a_lamp_in_a_room_gives_what_radiosity_says() {
    let faces = turned(block([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]));
    with_gpu(|gpu| {
        for (at, far, bound) in [([0.3, 0.4, -0.2], FAR, 0.02), ([0.2, -0.85, -0.3], FAR, 0.03)] {
            let things = vec![flat(0, &faces), mote(far)];
            let scene = world(things, vec![grey(0.6, 0.0, 1.0)], vec![lamp(at, 3.0)], uniform(0.0));
            let albedo = Matt::new(&scene.materials[0]).albedo();
            let truth = Radiosity::new(&faces, 12, albedo, DVec3::from(at), 3.0);
            let eyes = [[0.0, 0.0, -1.0], [1.0, -0.6, 0.2]].map(|to| eye([-0.1, 0.1, 0.8], to, 80.0));
            let taken = take_all(gpu, &scene, &eyes, diffuse(48));
            for (eye, taken) in eyes.iter().zip(&taken) {
                let places = soft(&scene, eye, taken, 1);
                // Beside edges the sum over patches is itself not exact.
                let inside = |p: &DVec3| p.abs().to_array().iter().filter(|c| **c > 0.92).count() == 1;
                let pairs: Vec<(f64, f64)> = places
                    .into_iter()
                    .flatten()
                    .filter(|(_, p, _)| inside(p))
                    .map(|(got, p, n)| (got, truth.irradiance(p, n)))
                    .collect();
                let (mean, spread) = deviations(&pairs);
                println!(
                    "lamp at {at:?}: {:+.3} %, spread {:.2} %, {} places",
                    100.0 * mean,
                    100.0 * spread,
                    pairs.len()
                );
                assert!(pairs.len() > 1000 && mean.abs() < 0.01 && spread < bound, "{at:?}: {mean}, spread {spread}");
            }
        }
    });
}

/// A room with a box on its floor and a wall of some thickness, beside the reference: no light under what stands on
/// something, none through walls, and nothing dark at feet.
#[test]
fn feet_and_corners_are_as_the_reference_has_them() {
    let room = turned(block([-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]));
    let things = vec![
        flat(0, &room),
        flat(0, &block([-0.5, 0.0, -0.6], [0.0, 0.6, -0.1])),
        // It reaches through the floor, as walls do.
        flat(0, &block([0.4, -0.2, -1.0], [0.5, 1.0, 0.3])),
        mote(FAR),
    ];
    // Bright outside, where no light may come from.
    let scene = world(things, vec![grey(0.6, 0.0, 1.0)], vec![lamp([-0.5, 1.5, 0.5], 3.0)], uniform(20.0));
    let from = eye([-0.2, 1.1, 0.95], [0.1, 0.1, -0.5], 70.0);
    with_gpu(|gpu| {
        let size = 64;
        let exact = take(gpu, &scene, &from, Shot::reference(BAKED, size, 96));
        let baked = take(gpu, &scene, &from, Shot::new(BAKED, size));
        let near = |p: DVec3, [x0, x1]: [f64; 2], [z0, z1]: [f64; 2]| {
            let off = DVec3::new((x0 - p.x).max(p.x - x1).max(0.0), 0.0, (z0 - p.z).max(p.z - z1).max(0.0)).length();
            off < 0.06
        };
        let region = |(p, n, mesh): (DVec3, DVec3, usize)| match mesh {
            0 if n.y > 0.5 && near(p, [-0.5, 0.0], [-0.6, -0.1]) => "floor at the box",
            0 if n.y > 0.5 && near(p, [0.4, 0.5], [-1.0, 0.3]) => "floor at the wall",
            0 if n.y > 0.5 && p.x > 0.5 => "floor behind the wall",
            0 if n.y > 0.5 => "floor",
            0 if p.y < 0.06 => "walls' feet",
            0 => "walls",
            1 if n.y < 0.5 && p.y < 0.06 => "the box's foot",
            1 => "the box",
            _ if n.y < 0.5 && p.y < 0.06 => "the wall's foot",
            _ => "the wall",
        };
        let mut sums = std::collections::BTreeMap::<&str, [f64; 3]>::new();
        for pixel in 0..baked.pixels.len() {
            let Some(place) = seen(&scene, &from, size, pixel) else { continue };
            let sum = sums.entry(region(place)).or_default();
            sum[0] += baked.pixels[pixel];
            sum[1] += exact.pixels[pixel];
            sum[2] += 1.0;
        }
        println!("as a whole: {:+.2} %", 100.0 * (baked.mean() / exact.mean() - 1.0));
        let mut failures = Vec::new();
        for (name, [baked, exact, count]) in sums {
            let off = baked / exact - 1.0;
            println!("{name}: {:.4}, {:.4} exact, {:+.2} %, {count} pixels", baked / count, exact / count, 100.0 * off);
            if count > 8.0 && off.abs() > 0.06 {
                failures.push(format!("{name}: {:+.2} %", 100.0 * off));
            }
        }
        assert!(failures.is_empty(), "{failures:?}");
    });
}

/// A ball, whose charts end somewhere, under a sky whose irradiance is known in closed form; and the same bytes twice.
#[test]
fn charts_have_no_seams_and_bakes_repeat() {
    // Irradiance of 1 + 0.8 y is π (1 + 0.8 · 2/3 · n.y).
    let sky = Panorama::from_fn(256, 128, |d| Vec3::splat(1.0 + 0.8 * d.y));
    let things = vec![ball(0, [0.0; 3], 1.0, 24, false), mote(FAR)];
    let scene = world(things, vec![grey(0.5, 0.0, 1.0)], vec![], sky);
    let eyes = [[0.0, 0.0, 4.0], [3.0, 1.0, -2.0], [-2.0, -3.0, 1.0]].map(|from| eye(from, [0.0; 3], 35.0));
    with_gpu(|gpu| {
        let shot = Shot { lightmap: FINE, ..diffuse(96) };
        let taken = take_all(gpu, &scene, &eyes, shot);
        let matt = Matt::new(&scene.materials[0]);
        let (mut worst, mut pairs) = (0f64, Vec::new());
        for (eye, taken) in eyes.iter().zip(&taken) {
            for (pixel, radiance) in taken.pixels.iter().enumerate() {
                let Some((p, _, 0)) = seen(&scene, eye, 96, pixel) else { continue };
                let n = p.normalize();
                let nv = n.dot((eye.position().as_dvec3() - p).normalize());
                if nv < 0.2 {
                    continue;
                }
                let (got, want) = (matt.irradiance(*radiance, nv), PI * (1.0 + 0.8 * 2.0 / 3.0 * n.y));
                worst = worst.max((got / want - 1.0).abs());
                pairs.push((got, want));
            }
        }
        let (mean, spread) = deviations(&pairs);
        println!("{:+.3} %, spread {:.3} %, worst {:.2} %", 100.0 * mean, 100.0 * spread, 100.0 * worst);
        assert!(mean.abs() < 0.004 && spread < 0.006 && worst < 0.03, "{mean}, {spread}, {worst}");
        let again = take(gpu, &scene, &eyes[0], shot);
        assert!(again.lightmap == taken[0].lightmap && again.pixels == taken[0].pixels, "another lightmap");
        assert!(again.lightmap.len() >= 4 * (FINE * FINE) as usize);
    });
}

/// One that can be seen from inside, as rooms made of a single box are whose faces look outwards.
#[test]
fn an_inside_out_room_is_lit_inside() {
    let (lights, sky) = (vec![lamp([0.2, 0.3, 0.1], 3.0)], || uniform(0.0));
    let from = eye([-0.1, 0.1, 0.8], [0.3, -0.2, -1.0], 80.0);
    let room = block([-1.0; 3], [1.0; 3]);
    with_gpu(|gpu| {
        let [right, wrong] = [turned(room), room].map(|faces| {
            let scene = world(vec![flat(0, &faces), mote(FAR)], vec![grey(0.6, 0.0, 1.0)], lights.clone(), sky());
            take(gpu, &scene, &from, diffuse(48)).mean()
        });
        println!("faces inwards: {right:.4}, outwards: {wrong:.4}");
        assert!((wrong / right - 1.0).abs() < 0.02, "{right} inwards, {wrong} outwards");
    });
}

/// Numbers are finite in pictures and lightmaps, and no validation message comes.
#[test]
fn models_that_no_one_should_make_are_drawn() {
    let floor = || flat(0, &[level([-1.0, 1.0], 0.0, [-1.0, 1.0])]);
    let point = flat(0, &[[DVec3::ZERO; 4]]);
    let line = flat(0, &[quad([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])]);
    let needle = |i: i32| {
        let x = f64::from(i % 100) / 50.0 - 1.0;
        quad([[x, 0.1, -1.0], [x + 1e-6, 0.1, -1.0], [x + 1e-6, 0.1 + 1e-3 * f64::from(i / 100), 1.0], [x, 0.1, 1.0]])
    };
    let needles = flat(0, &(0..200).map(needle).collect::<Vec<_>>());
    let mut inside_out = flat(0, &block([-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]));
    inside_out.indices.chunks_exact_mut(3).step_by(2).for_each(|t| t.swap(0, 1));
    let mut no_normals = flat(0, &block([-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]));
    no_normals.vertices.iter_mut().for_each(|v| (v.normal, v.tangent) = ([0.0; 3], [0.0; 4]));
    let in_wall = flat(0, &block([0.4, -0.1, -1.0], [0.6, 1.0, 1.0]));
    let cases: Vec<(&str, Vec<Mesh>)> = vec![
        ("nothing", vec![]),
        ("a point and a line", vec![point.clone(), line.clone()]),
        ("a point and a line on a floor", vec![floor(), point, line]),
        ("needles", vec![needles, floor()]),
        ("the same floor twice", vec![floor(), floor(), flat(0, &turned([level([-1.0, 1.0], 0.0, [-1.0, 1.0])]))]),
        ("a box of both", vec![inside_out, floor()]),
        ("a box without normals", vec![no_normals, floor()]),
        ("a lamp in a wall", vec![in_wall, floor()]),
    ];
    with_gpu(|gpu| {
        for (name, mut things) in cases {
            if !things.is_empty() {
                things.push(mote(FAR));
            }
            // One on the floor itself, one in the wall.
            let lights = vec![lamp([0.3, 0.0, 0.2], 4.0), lamp([0.5, 0.5, 0.0], 4.0)];
            let scene = world(things, vec![grey(0.7, 0.3, 0.5)], lights, uniform(1.0));
            let from = eye([0.3, 0.9, 2.0], [0.0, 0.2, 0.0], 50.0);
            for shot in [Shot::new(BAKED, 24), Shot::reference(BAKED, 24, 4), Shot::new(LightModel::Direct, 24)] {
                let shot = Shot { lightmap: 64, ..shot };
                let taken = take(gpu, &scene, &from, shot);
                println!("{name}: {:?} {:.4}, {:?}", shot.shading, taken.mean(), taken.warnings);
            }
        }
    });
}
