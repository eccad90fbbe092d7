//! `--shading reference` in closed rooms that get all their light from the panorama through a small opening: inside of a ball with a
//! hole, whose light is known (Jacquez and Kuppenheim, "Theory of the Integrating Sphere" (1955)).

use std::f64::consts::PI;

use glam::{DVec3, Mat4, Quat, Vec3};
use pbr_vr::asset::Panorama;
use pbr_vr::reference::cube::panorama_texel_solid_angle;
use pbr_vr::render::LightModel;
use pbr_vr::scene::Mesh;

use crate::common::brdf::Brdf;
use crate::common::solids::{Shot, Taken, assert_mean, ball, eye, grey, seen, take, uniform, world};
use crate::common::stage::with_gpu;

const RADIUS: f64 = 2.0;
const FRAMES: u64 = 64;
const SIZE: u32 = 32;

/// Triangles of a ball around the origin, which are taken out of it.
struct Hole {
    triangles: Vec<[DVec3; 3]>,
}

/// The ball, seen from inside, with a hole around a direction.
fn ball_with_hole(towards: DVec3) -> (Mesh, Hole) {
    let mut mesh = ball(0, [0.0; 3], RADIUS as f32, 64, true);
    let place = |i: &u32| Vec3::from(mesh.vertices[*i as usize].position).as_dvec3();
    let corners = |t: &[u32]| [place(&t[0]), place(&t[1]), place(&t[2])];
    let is_hole = |t: &&[u32]| corners(t).iter().all(|c| c.normalize().dot(towards) > 0.975);
    let (hole, wall): (Vec<&[u32]>, Vec<&[u32]>) = mesh.indices.chunks_exact(3).partition(is_hole);
    let (triangles, indices) = (hole.into_iter().map(corners).collect(), wall.concat());
    mesh.indices = indices;
    (mesh, Hole { triangles })
}

impl Hole {
    /// The part of the whole ball that it takes. Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle" (1983).
    fn part(&self) -> f64 {
        let solid_angle = |t: &[DVec3; 3]| {
            let [a, b, c] = t.map(DVec3::normalize);
            2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
        };
        self.triangles.iter().map(solid_angle).sum::<f64>() / (4.0 * PI)
    }

    /// Area that light from a direction finds.
    fn area(&self, d: DVec3) -> f64 {
        self.triangles.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).dot(d).abs()).sum()
    }
}

/// The radiance that a wall of this albedo gives back of light whose first irradiance is on average `even`.
fn given_back(albedo: f64, even: f64, part: f64) -> f64 {
    albedo / PI * even / (1.0 - albedo * (1.0 - part))
}

/// The mean, and the standard error of a pixel.
fn assert_lit(name: &str, taken: &Taken, want: f64, most_error: f64) {
    assert_mean(name, taken, want, 0.015);
    let error = taken.error.expect("an error").mean_relative;
    println!("{name}: error of a pixel {error:.3}");
    assert!(error < most_error, "{name}: {error}");
}

/// Also where the models are turned as a whole, and the hole with them.
#[test]
fn an_even_sky_through_a_hole_lights_a_ball_evenly() {
    let (mesh, hole) = ball_with_hole(DVec3::new(0.3, 0.8, -0.5).normalize());
    let wall = grey(0.8, 0.0, 1.0);
    let want = given_back(Brdf::new(&wall).even_albedo(), PI * hole.part(), hole.part());
    let scene = world(vec![mesh], vec![wall], vec![], uniform(1.0));
    let placed = Mat4::from_rotation_translation(Quat::from_rotation_y(2.0), Vec3::new(3.0, -1.0, 0.5));
    with_gpu(|gpu| {
        for (name, world_from_models) in [("as it stands", Mat4::IDENTITY), ("turned", placed)] {
            let at = |p: Vec3| world_from_models.transform_point3(p).as_dvec3().to_array();
            let from = eye(at(Vec3::ZERO), at(Vec3::new(-0.3, -0.8, 0.5)), 60.0);
            let shot = Shot { world_from_models, ..Shot::reference(LightModel::Baked, SIZE, FRAMES) };
            assert_lit(name, &take(gpu, &scene, &from, shot), want, 0.25);
        }
    });
}

/// Its patch on the wall is small and out of view: what it gives back lights the rest evenly.
#[test]
fn a_sun_through_a_hole_lights_the_rest_of_a_ball_evenly() {
    let sun = DVec3::new(0.35, 0.75, -0.55).normalize();
    let (mesh, hole) = ball_with_hole(DVec3::new(0.3, 0.8, -0.5).normalize());
    let sky = Panorama::from_fn(512, 256, |d| Vec3::splat(if d.as_dvec3().dot(sun) > 0.9995 { 3000.0 } else { 0.1 }));
    let part = hole.part();
    let through = |x: u32, y: u32| {
        let d = sky.direction(x, y).as_dvec3();
        let of_sun = f64::from(sky.texels[(y * 512 + x) as usize][0] - 0.1);
        of_sun * panorama_texel_solid_angle(y, [512, 256]) * hole.area(d)
    };
    let of_sun: f64 = (0..512).flat_map(|x| (0..256).map(move |y| (x, y))).map(|(x, y)| through(x, y)).sum();
    let even = of_sun / (4.0 * PI * RADIUS * RADIUS);
    // The patch itself is not seen: only what it gives back.
    let wall = grey(0.8, 0.0, 1.0);
    let albedo = Brdf::new(&wall).even_albedo();
    let want = given_back(albedo, 0.1 * PI * part, part) + albedo * given_back(albedo, even, part);
    let scene = world(vec![mesh], vec![wall], vec![], sky);
    let from = eye([0.0; 3], [0.8, -0.3, 0.4], 60.0);
    assert!(seen(&scene, &from, SIZE, 0).is_some());
    with_gpu(|gpu| {
        let taken = take(gpu, &scene, &from, Shot::reference(LightModel::Baked, SIZE, FRAMES));
        assert_lit("sun", &taken, want, 0.2);
    });
}
