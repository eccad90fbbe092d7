//! Light transport of `--shading reference` in scenes whose light is known exactly: furnaces, closed balls, black boxes,
//! shadows, mirrors, holes.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Mat4, Quat, Vec3};
use pbr_vr::asset::Panorama;
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::energy::VISIBLE;
use pbr_vr::reference::quadrature::gauss_legendre;
use pbr_vr::reference::sun::find_sun;
use pbr_vr::render::{Eye, LightModel, Shading};
use pbr_vr::scene::{Material, PointLight};

use crate::common::brdf::{Brdf, slanted};
use crate::common::solids::{
    Shot, Taken, assert_mean, ball, block, eye, flat, grey, lamp, level, quad, seen, take, take_all, turned, uniform,
    world,
};
use crate::common::stage::with_gpu;
use crate::common::{PictureOptions, Workshop, material, mean_at};

const BAKED: LightModel = LightModel::Baked;

/// Radiance inside of a ball of one material around a lamp at its centre, by the cosine to the normal at which it leaves the
/// surface. What any point sees in a direction leaves another one at the same angle, so that transport is one integral over
/// a cosine, repeated.
struct InsideOfBall {
    nodes: Vec<[f64; 2]>,
    /// Indirect radiance at the nodes.
    indirect: Vec<f64>,
    direct: f64,
    brdf: Brdf,
}

impl InsideOfBall {
    fn new(material: &Material, irradiance: f64) -> Self {
        let (brdf, nodes) = (Brdf::new(material), gauss_legendre(32));
        let mut inside = Self { indirect: vec![0.0; nodes.len()], nodes, direct: irradiance, brdf };
        let kernels: Vec<Vec<f64>> = inside.nodes.iter().map(|[cosine, _]| inside.kernel(*cosine)).collect();
        for _ in 0..400 {
            let all: Vec<f64> =
                inside.nodes.iter().zip(&inside.indirect).map(|([c, _], sum)| sum + inside.first(*c)).collect();
            inside.indirect = kernels.iter().map(|k| k.iter().zip(&all).map(|(k, l)| k * l).sum()).collect();
        }
        inside
    }

    /// By the lamp alone.
    fn first(&self, cosine: f64) -> f64 {
        self.direct * self.brdf.value(DVec3::Z, slanted(cosine, 0.0))
    }

    /// Weights of the radiance at all nodes for that which leaves at a cosine.
    fn kernel(&self, cosine: f64) -> Vec<f64> {
        self.nodes.iter().map(|[c, weight]| self.brdf.around(*c, cosine) * c * weight).collect()
    }

    fn radiance(&self, cosine: f64) -> f64 {
        let all = self.nodes.iter().zip(&self.indirect).map(|([c, _], sum)| sum + self.first(*c));
        self.first(cosine) + self.kernel(cosine).iter().zip(all).map(|(k, l)| k * l).sum::<f64>()
    }
}

/// Where all light is given back, things under even light cannot be seen.
#[test]
fn white_things_are_invisible_in_a_furnace() {
    let (metal, chalk) = (grey(1.0, 1.0, 0.6), grey(1.0, 0.0, 0.8));
    let bowl = |material| {
        let mut bowl = ball(material, [0.0; 3], 1.0, 16, false);
        // The lower half, seen from within.
        let vertices = bowl.vertices.clone();
        let is_low = |t: &&[u32]| t.iter().all(|i| vertices[*i as usize].position[1] < 0.01);
        bowl.indices = bowl.indices.chunks_exact(3).filter(is_low).flatten().copied().collect();
        bowl
    };
    let two = |a, b| vec![ball(a, [-0.52, 0.0, 0.0], 0.5, 16, false), ball(b, [0.52, 0.0, 0.0], 0.5, 16, false)];
    let cases = [
        ("a metal ball", vec![ball(0, [0.0; 3], 1.0, 16, false)]),
        ("a ball of chalk", vec![ball(1, [0.0; 3], 1.0, 16, false)]),
        ("two balls", two(0, 1)),
        ("a metal bowl", vec![bowl(0)]),
        ("a bowl of chalk", vec![bowl(1)]),
        (
            "a box on a floor",
            vec![flat(1, &[level([-2.0, 2.0], -0.5, [-2.0, 2.0])]), flat(0, &block([-0.5; 3], [0.5; 3]))],
        ),
    ];
    with_gpu(|gpu| {
        for (name, meshes) in cases {
            let scene = world(meshes, vec![metal.clone(), chalk.clone()], vec![], uniform(1.0));
            let from = eye([0.3, 1.6, 2.2], [0.0, -0.1, 0.0], 45.0);
            let taken = take(gpu, &scene, &from, Shot::reference(BAKED, 24, 48));
            assert_mean(name, &taken, 1.0, 0.002);
            assert!((taken.mean() - 1.0).abs() < 0.005, "{name}");
            let most = taken.pixels.iter().map(|p| (p - 1.0).abs()).fold(0.0, f64::max);
            let standard = taken.error.unwrap().max_relative;
            println!("{name}: worst pixel {most:.4}, largest standard error {standard:.4}");
            assert!(most <= 6.0 * standard + 0.01, "{name}: {most}, standard error {standard}");
        }
    });
}

#[test]
fn a_lamp_in_a_ball_is_the_integrating_sphere() {
    with_gpu(|gpu| {
        for material in [grey(0.8, 0.0, 1.0), grey(0.5, 0.0, 0.6), grey(0.7, 1.0, 0.8)] {
            let name = format!("metallic {}", material.metallic_factor);
            let want = InsideOfBall::new(&material, 3.0);
            let scene =
                world(vec![ball(0, [0.0; 3], 1.0, 48, true)], vec![material], vec![lamp([0.0; 3], 3.0)], uniform(0.0));
            // From the centre all is seen head on; from beside it at slants.
            let size = 16;
            for (from, fov) in [([0.0, 0.0, 0.01], 20.0), ([0.0, 0.0, 0.8], 60.0)] {
                let from = eye(from, [0.0, 0.0, -1.0], fov);
                let taken = take(gpu, &scene, &from, Shot::reference(BAKED, size, 24));
                let mut sum = 0.0;
                for pixel in 0..taken.pixels.len() {
                    let (p, ..) = seen(&scene, &from, size, pixel).unwrap();
                    sum += want.radiance(-p.normalize().dot((from.position().as_dvec3() - p).normalize()).min(-1e-6));
                }
                // The ball's facets are nearer than its radius: 0.1 % of r² on average.
                assert_mean(&name, &taken, sum / taken.pixels.len() as f64, 0.004);
            }
        }
    });
}

/// By flux: whatever place the lamp has in a ball of a perfectly matt material, all of the wall gets the same indirect light.
/// Our materials are not quite matt; near a wall the lamp's spot is found by following light from the lamp.
#[test]
fn a_lamp_near_the_wall_of_a_ball_gives_as_much_as_one_in_the_middle() {
    with_gpu(|gpu| {
        let from = eye([0.0, 0.0, 0.5], [0.0, 0.0, -1.0], 40.0);
        let picture = |at: [f64; 3]| {
            let scene = world(
                vec![ball(0, [0.0; 3], 1.0, 48, true)],
                vec![grey(0.6, 0.0, 1.0)],
                vec![lamp(at, 1.0)],
                uniform(0.0),
            );
            let brdf = Brdf::new(&scene.materials[0]);
            let taken = take(gpu, &scene, &from, Shot::reference(BAKED, 16, 32));
            // Less what comes straight from the lamp.
            let direct = |pixel: usize| {
                let (p, ..) = seen(&scene, &from, 16, pixel).unwrap();
                let (n, to_lamp) = (-p.normalize(), DVec3::from(at) - p);
                let (l, v) = (to_lamp.normalize(), (from.position().as_dvec3() - p).normalize());
                brdf.at(n, l, v) * n.dot(l).max(0.0) / to_lamp.length_squared()
            };
            let direct = (0..taken.pixels.len()).map(direct).sum::<f64>() / taken.pixels.len() as f64;
            let standard = taken.error.unwrap().mean_relative * taken.mean() / 16.0;
            (taken.mean() - direct, standard)
        };
        let (middle, standard) = picture([0.0; 3]);
        for at in [[0.0, 0.97, 0.0], [0.0, 0.5, 0.5], [0.69, 0.0, 0.69]] {
            let (other, other_standard) = picture(at);
            let bound = 4.0 * standard.hypot(other_standard) + 0.015 * middle;
            println!("a lamp at {at:?}: {other:.5} ± {other_standard:.5}, in the middle {middle:.5} ± {standard:.5}");
            assert!((other - middle).abs() < bound, "{at:?}: {other}, not {middle}");
        }
    });
}

#[test]
fn no_light_leaves_a_closed_box() {
    let thick = || vec![flat(0, &block([-1.0; 3], [1.0; 3])), flat(0, &turned(block([-0.9; 3], [0.9; 3])))];
    let cases = [
        ("a thick box", thick()),
        ("a thin box", vec![flat(0, &block([-1.0; 3], [1.0; 3]))]),
        ("a box that faces inwards", vec![flat(0, &turned(block([-1.0; 3], [1.0; 3])))]),
        ("a ball", vec![ball(0, [0.0; 3], 1.0, 16, false)]),
    ];
    let from =
        [[0.0, 0.0, 3.0], [3.0, 0.1, 0.2], [2.0, 2.0, 2.0], [-1.5, -2.0, 1.9], [0.0, 3.0, 0.1], [-2.2, 1.1, -2.0]];
    let eyes = from.map(|from| eye(from, [0.0; 3], 60.0));
    with_gpu(|gpu| {
        for (name, meshes) in cases {
            let lights = [lamp([0.3, -0.2, 0.1], 100.0), lamp([0.85, 0.85, 0.85], 100.0)];
            let is_ball = name == "a ball";
            let scene =
                world(meshes, vec![grey(0.9, 0.0, 0.4)], lights[..if is_ball { 1 } else { 2 }].to_vec(), uniform(0.0));
            for (light, frames) in [(BAKED, 12), (LightModel::Direct, 2)] {
                for (i, taken) in take_all(gpu, &scene, &eyes, Shot::reference(light, 40, frames)).iter().enumerate() {
                    let lit = taken.pixels.iter().filter(|p| **p > 0.0).count();
                    assert_eq!(lit, 0, "{name}, {light:?}, side {i}: {lit} pixels, at most {}", taken.largest());
                }
            }
        }
    });
}

/// Under light that comes from everywhere, the inside of a closed box is dark.
#[test]
fn no_light_enters_a_closed_box() {
    let scene = world(
        vec![flat(0, &block([-1.0; 3], [1.0; 3])), flat(0, &turned(block([-0.9; 3], [0.9; 3])))],
        vec![grey(0.9, 0.0, 0.4)],
        vec![lamp([2.0, 1.0, 0.0], 100.0)],
        uniform(10.0),
    );
    let eyes = [[1.0, 0.0, 0.0], [0.3, 1.0, 0.1], [-1.0, -1.0, 1.0]].map(|to| eye([0.1, -0.2, 0.3], to, 90.0));
    with_gpu(|gpu| {
        for taken in take_all(gpu, &scene, &eyes, Shot::reference(BAKED, 24, 16)) {
            assert_eq!(taken.pixels.iter().filter(|p| **p > 0.0).count(), 0, "at most {}", taken.largest());
        }
    });
}

#[test]
fn the_shade_of_a_square_is_black() {
    let things =
        vec![flat(0, &[level([-2.0, 2.0], 0.0, [-2.0, 2.0])]), flat(0, &[level([-0.3, 0.3], 1.0, [-0.3, 0.3])])];
    let scene = world(things, vec![grey(0.5, 0.0, 0.6)], vec![lamp([0.0, 2.0, 0.0], 9.0)], uniform(0.0));
    let from = eye([0.4, 0.8, 2.4], [0.0; 3], 50.0);
    let brdf = Brdf::new(&scene.materials[0]);
    with_gpu(|gpu| {
        for shot in [Shot::reference(LightModel::Direct, 64, 2), Shot::new(LightModel::Direct, 64)] {
            let taken = take(gpu, &scene, &from, shot);
            let mut counts = [0; 2];
            for (pixel, got) in taken.pixels.iter().enumerate() {
                let Some((p, n, 0)) = seen(&scene, &from, 64, pixel) else { continue };
                let far = p.x.abs().max(p.z.abs()) - 0.6;
                // Beside the shadow's edge, and where the floor ends.
                if far.abs() < 0.1 || far > 0.9 {
                    continue;
                }
                counts[usize::from(far > 0.0)] += 1;
                let to_lamp = DVec3::new(0.0, 2.0, 0.0) - p;
                let (l, v) = (to_lamp.normalize(), (from.position().as_dvec3() - p).normalize());
                let lit = 9.0 / to_lamp.length_squared() * n.dot(l) * brdf.at(n, l, v);
                let want = if far > 0.0 { lit } else { 0.0 };
                // Pixels are as wide as 5 cm, where two jittered samples are not at their middles.
                assert!((got - want).abs() <= 0.06 * want, "{:?}: {got}, not {want}, at {p}", shot.shading);
            }
            assert!(counts[0] > 50 && counts[1] > 500, "{counts:?}");
        }
    });
}

/// One floor, from so near that all pixels show one place.
fn on_floor(material: Material, lights: Vec<PointLight>, sky: Panorama) -> (pbr_vr::scene::Scene, Eye, DVec3) {
    let from = [0.8, 0.9, 0.3];
    let scene = world(vec![flat(0, &[level([-1.0, 1.0], 0.0, [-1.0, 1.0])])], vec![material], lights, sky);
    (scene, eye(from, [0.0; 3], 0.05), DVec3::from(from).normalize())
}

#[test]
fn a_lamp_lights_a_floor_by_the_closed_form() {
    let at = DVec3::new(-0.5, 1.5, 0.4);
    with_gpu(|gpu| {
        for material in [grey(0.5, 0.0, 1.0), grey(0.9, 1.0, 0.4), grey(0.2, 0.0, 0.25)] {
            let (brdf, l) = (Brdf::new(&material), at.normalize());
            let (scene, from, v) = on_floor(material, vec![lamp(at.to_array(), 7.0)], uniform(0.0));
            let want = 7.0 / at.length_squared() * l.y * brdf.at(DVec3::Y, l, v);
            for light in [LightModel::Open, LightModel::Direct, BAKED] {
                for shot in [Shot::reference(light, 8, 2), Shot::new(light, 8)] {
                    let mean = take(gpu, &scene, &from, shot).mean();
                    println!("{light:?}, {:?}: {:+.4} %", shot.shading, 100.0 * (mean / want - 1.0));
                    // Pictures leave out multiple scattering where it changes less than `energy::VISIBLE`.
                    let bound = if shot.shading == Shading::Reference { 1e-3 } else { VISIBLE + 5e-4 };
                    assert!((mean / want - 1.0).abs() < bound, "{light:?}, {:?}: {mean}, not {want}", shot.shading);
                }
            }
        }
    });
}

#[test]
fn the_sun_lights_a_floor_by_the_closed_form() {
    let towards = DVec3::new(-0.3, 0.8, 0.4).normalize();
    let disc = 0.5f64.to_radians().cos();
    let sky = Panorama::from_fn(2048, 1024, |d| Vec3::splat(if d.as_dvec3().dot(towards) > disc { 4e4 } else { 1e-4 }));
    let sun = find_sun([sky.width, sky.height], &sky.texels).expect("a sun").sun;
    with_gpu(|gpu| {
        let material = grey(0.6, 0.0, 1.0);
        let brdf = Brdf::new(&material);
        let (scene, from, v) = on_floor(material, vec![], sky);
        let want = sun.irradiance.x * sun.direction.y * brdf.at(DVec3::Y, sun.direction, v);
        for light in [LightModel::Open, LightModel::Direct, BAKED] {
            assert_mean(&format!("{light:?}"), &take(gpu, &scene, &from, Shot::reference(light, 16, 16)), want, 3e-3);
        }
        let mean = take(gpu, &scene, &from, Shot::new(LightModel::Direct, 16)).mean();
        assert!((mean / want - 1.0).abs() < 3e-3, "{mean}, not {want}");
    });
}

/// Things over a floor cast the sun's shadow, and only under light that is blocked.
#[test]
fn the_sun_is_blocked_for_the_reference() {
    let towards = DVec3::new(0.0, 1.0, 0.0);
    let disc = 1f64.to_radians().cos();
    let sky = Panorama::from_fn(1024, 512, |d| Vec3::splat(if d.as_dvec3().dot(towards) > disc { 1e4 } else { 0.0 }));
    let things =
        vec![flat(0, &[level([-1.0, 1.0], 0.0, [-1.0, 1.0])]), flat(0, &[level([-0.5, 0.5], 0.5, [-0.5, 0.5])])];
    let scene = world(things, vec![grey(0.6, 0.0, 1.0)], vec![], sky);
    let eyes = [eye([0.9, 0.3, 0.0], [0.2, 0.0, 0.0], 2.0), eye([1.9, 0.6, 0.0], [0.8, 0.0, 0.0], 2.0)];
    with_gpu(|gpu| {
        let means = |light| {
            take_all(gpu, &scene, &eyes, Shot::reference(light, 12, 16)).iter().map(Taken::mean).collect::<Vec<_>>()
        };
        let [open, direct, all] = [LightModel::Open, LightModel::Direct, BAKED].map(means);
        println!("in the shade and beside it: {open:?}, {direct:?}, {all:?}");
        assert!((open[0] / open[1] - 1.0).abs() < 0.1 && open[0] > 0.1);
        assert_eq!(direct[0], 0.0);
        assert!((direct[1] / open[1] - 1.0).abs() < 0.02);
        // The square's underside sees the sunlit floor, and gives some of it back.
        assert!(all[0] > 0.0 && all[0] < 0.2 * all[1]);
    });
}

/// What an occlusion map says of ambient light is not said of the sun, by the picture and by the reference.
#[test]
fn occlusion_maps_do_not_darken_the_sun() {
    let shop = Workshop::new();
    let disc = 1f64.to_radians().cos();
    shop.panorama("sky.exr", 1024, |d| [if d[1] > disc { 1e4 } else { 0.0 }; 3]);
    image::save_buffer(shop.path("half.png"), &[128; 16], 4, 4, image::ColorType::L8).expect("a map");
    shop.write("m.mtl", &(material([0.5; 3], 0.0, 1.0) + "map_ao half.png\n"));
    shop.write("m.obj", &crate::common::square("m.mtl"));
    let scene = shop.write(
        "scene.toml",
        "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"m.obj\"\nrotation_degrees = [-90, 0, 0]\n\
         [[camera]]\nname = \"c\"\nposition = [0.3, 1, 0.2]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 5\n",
    );
    let mean = |shading, frames| {
        let options =
            PictureOptions { size: [16, 16], light: LightModel::Direct, shading, frames, ..Default::default() };
        let picture: Picture = shop.render(&scene, &options).remove(0);
        mean_at(&picture, 8, 8, 6)[0]
    };
    let (fast, exact) = (mean(Shading::Pbr, 1), mean(Shading::Reference, 32));
    println!("{fast:.4}, by the reference {exact:.4}");
    assert!((fast / exact - 1.0).abs() < 0.01, "{fast}, by the reference {exact}");
}

/// A mirror has the radiance of what it mirrors times its own reflectance.
#[test]
fn a_mirror_shows_a_lit_square() {
    let things = vec![
        flat(0, &[quad([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])]),
        flat(1, &[quad([[1.0, -1.0, 3.0], [-1.0, -1.0, 3.0], [-1.0, 1.0, 3.0], [1.0, 1.0, 3.0]])]),
    ];
    // The lamp is behind the mirror, and shines past it.
    let scene =
        world(things, vec![grey(0.6, 0.0, 1.0), grey(0.7, 1.0, 0.0)], vec![lamp([3.0, 0.0, 3.5], 50.0)], uniform(0.0));
    let from = [0.0, 0.0, 2.0];
    let eyes = [eye(from, [0.0; 3], 1.0), eye(from, [0.0, 0.0, 3.0], 1.0)];
    with_gpu(|gpu| {
        let [straight, mirrored] = [0, 1].map(|i| take(gpu, &scene, &eyes[i], Shot::reference(BAKED, 16, 32)));
        let error = 4.0 * straight.error.unwrap().mean_relative.hypot(mirrored.error.unwrap().mean_relative) / 16.0;
        let ratio = mirrored.mean() / straight.mean();
        println!("{:.5} in the mirror, {:.5}: {ratio:.5} ± {error:.5}", mirrored.mean(), straight.mean());
        assert!((ratio / 0.7 - 1.0).abs() < 0.003 + error, "{ratio} ± {error}, not 0.7");
    });
}

#[test]
fn rays_pass_holes() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    // Opaque for u < 1/2.
    let mask: Vec<u8> = (0..64 * 64).map(|i| if i % 64 < 32 { 255 } else { 0 }).collect();
    image::save_buffer(shop.path("mask.png"), &mask, 64, 64, image::ColorType::L8).expect("a mask");
    shop.write("m.mtl", &(material([0.5; 3], 0.0, 1.0) + "newmtl leaf\nKd 0 0 0\nPm 1\nPr 1\nmap_d mask.png\n"));
    let obj = "mtllib m.mtl\nvn 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        v -3 0 3\nv 3 0 3\nv 3 0 -3\nv -3 0 -3\nusemtl m\nf 1/1/1 2/2/1 3/3/1 4/4/1\n\
        v -0.5 1 0.5\nv 0.5 1 0.5\nv 0.5 1 -0.5\nv -0.5 1 -0.5\nusemtl leaf\nf 5/1/1 6/2/1 7/3/1 8/4/1\n";
    shop.write("m.obj", obj);
    let scene = crate::common::stage::scene(&shop.write(
        "scene.toml",
        "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"m.obj\"\n[[light]]\n\
         point = { position = [0, 2, 0], intensity = [9, 9, 9] }\n",
    ));
    let from = eye([0.0, 0.7, 2.6], [0.0, -0.2, 0.0], 50.0);
    with_gpu(|gpu| {
        let open = take(gpu, &scene, &from, Shot::reference(LightModel::Open, 64, 2));
        for (light, least) in [(LightModel::Direct, 0.0), (BAKED, 0.05)] {
            let got = take(gpu, &scene, &from, Shot::reference(light, 64, 4));
            let mut counts = [0; 2];
            for pixel in 0..got.pixels.len() {
                let on_floor = |(p, ..): &(DVec3, DVec3, usize)| p.y < 0.1 && p.abs().max_element() < 2.0;
                let Some((p, ..)) = seen(&scene, &from, 64, pixel).filter(on_floor) else { continue };
                // The square's shadow is twice as wide, from −1 to 1; of it the left half is there.
                if p.x.abs().min((p.x + 1.0).abs()).min((p.z.abs() - 1.0).abs()) > 0.1 {
                    let dark = p.x < 0.0 && p.x > -1.0 && p.z.abs() < 1.0;
                    counts[usize::from(dark)] += 1;
                    let share = got.pixels[pixel] / open.pixels[pixel];
                    let fine = if dark { share <= least } else { (share - 1.0).abs() < 0.1 + least };
                    assert!(fine, "{light:?}: {share} at {p:.3}");
                }
            }
            assert!(counts[0] > 300 && counts[1] > 50, "{counts:?}");
        }
    });
}

/// Models, lamps and camera moved together are seen as before.
#[test]
fn moved_together_all_looks_the_same() {
    let things =
        || vec![flat(0, &[level([-2.0, 2.0], 0.0, [-2.0, 2.0])]), flat(1, &block([-0.4, 0.0, -0.4], [0.4, 0.8, 0.4]))];
    let materials = vec![grey(0.7, 0.0, 1.0), grey(0.8, 1.0, 0.9)];
    let moved = Mat4::from_rotation_translation(
        Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.3),
        Vec3::new(1.5, -0.4, 2.0),
    );
    let at = Vec3::new(0.9, 1.2, 0.5);
    let scenes = [at, moved.transform_point3(at)]
        .map(|at| world(things(), materials.clone(), vec![lamp(at.as_dvec3().to_array(), 5.0)], uniform(0.5)));
    let from = eye([0.9, 1.5, 2.4], [0.0, 0.3, 0.0], 45.0);
    let there = Eye { world_from_view: moved * from.world_from_view, ..from };
    with_gpu(|gpu| {
        let shot = Shot::reference(BAKED, 24, 32);
        let still = take(gpu, &scenes[0], &from, shot);
        let other = take(gpu, &scenes[1], &there, Shot { world_from_models: moved, ..shot });
        let standard = still.error.unwrap().mean_relative * still.mean();
        // Nine parts of the picture, each the mean of 64 pixels.
        for part in 0..9 {
            let of = |taken: &Taken| {
                let inside = |i: &usize| i % 24 / 8 == part % 3 && i / 24 / 8 == part / 3;
                (0..24 * 24).filter(inside).map(|i| taken.pixels[i]).sum::<f64>() / 64.0
            };
            let (a, b) = (of(&still), of(&other));
            let bound = 4.0 * 2f64.sqrt() * standard / 8.0 + 0.01 * a;
            println!("part {part}: {a:.4} and {b:.4}, bound {bound:.4}");
            assert!((a - b).abs() < bound, "part {part}: {a} and {b}");
        }
    });
}

/// The ball's integral is right by itself: a matt wall gives I / r² · ρ / π / (1 − ρ), and a white one keeps all light.
#[test]
fn the_balls_integral_is_that_of_a_matt_wall() {
    // Metal at full roughness is nearly matt; its share of even light at one bounce is what matters.
    let material = grey(0.5, 0.0, 1.0);
    let inside = InsideOfBall::new(&material, 1.0);
    let given = |l: &dyn Fn(f64) -> f64| TAU * inside.nodes.iter().map(|[c, w]| l(*c) * c * w).sum::<f64>();
    let first = given(&|c| inside.first(c));
    let all = given(&|c| inside.radiance(c));
    // All = first + A·all with a mean albedo A between those at the two ends.
    let albedo = 1.0 - first / all;
    println!("first {first:.4}, all {all:.4}, albedo {albedo:.4}");
    assert!((albedo - first).abs() < 0.03 && (PI * inside.radiance(1.0) / all - 1.0).abs() < 0.1);
}
