//! Probes' maps against light that is known: an integrating sphere, a bright sky, scenes that need none.

use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Mat4, Vec3};

use super::baked_light::{BakedLight, LightSource};
use super::bound_scene::BoundScene;
use super::frame::FrameInputs;
use super::layouts::Layouts;
use super::light_detail::{FACE, LightDetail};
use super::light_plan::LightPlan;
use super::lighting::Lighting;
use super::scene_resources::{SceneResources, SceneTextures};
use super::settings::{LightModel, RenderSettings};
use crate::asset::Panorama;
use crate::context::Context;
use crate::gpu::{Gpu, Subresource, with_gpu};
use crate::precompute::harness_tests::texels;
use crate::reference::brdf::Geometry;
use crate::reference::energy::{Energy, Scattering};
use crate::scene::atlas::{Work, flatten};
use crate::scene::{Bounds, Camera, Environment, GeometryView, Instance, Material, Mesh, PointLight, Probe, Scene};

/// Texels along a lightmap's side: few, for the sake of time.
const SIDE: u32 = 64;

fn scene(mesh: Mesh, base_color: f32, intensity: f32, sky: f32) -> Scene {
    let bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
    Scene {
        meshes: vec![mesh],
        instances: vec![Instance { mesh: 0, world_from_local: Mat4::IDENTITY }],
        sources: Vec::new(),
        materials: vec![Material::plain("matt", Vec3::splat(base_color), 0.0, 1.0)],
        textures: vec![],
        lights: vec![PointLight { position: Vec3::ZERO, intensity: Vec3::splat(intensity), radius: 0.0, cone: None }],
        cameras: vec![Camera { name: "c".into(), position: Vec3::ZERO, target: Vec3::Z, vertical_fov_degrees: 40.0 }],
        environment: Environment { panorama: Panorama::uniform(Vec3::splat(sky)), rotation_degrees: 0.0 },
        probes: vec![Probe { position: Vec3::new(0.4, 0.2, -0.1), bounds, thing: None }],
        exposure_ev: 0.0,
    }
}

/// The scene with its lightmap and its probes computed to their end.
fn baked(gpu: &Arc<Gpu>, scene: &Scene) -> BoundScene {
    let (context, layouts) = (Context::silent(gpu), Arc::new(Layouts::new(gpu).unwrap()));
    let settings = RenderSettings { light: LightModel::Baked, cube_size: 16, ..RenderSettings::default() };
    let work = Work { cache: None, report: &context.report, stop: &AtomicBool::new(false) };
    let flat = flatten(scene.geometry(), &[], SIDE, work).unwrap();
    let geometry = GeometryView { meshes: &flat.meshes, instances: &flat.instances };
    let textures = SceneTextures::new(&context, &layouts, scene, &settings).unwrap();
    let resources = SceneResources::new(&context, textures, scene, geometry, &settings).unwrap();
    let lighting = Lighting::new(&context, &scene.environment.panorama, &settings).unwrap();
    let side = flat.atlas.size[0];
    let source =
        LightSource { scene, geometry, ray_scene: &resources.ray_scene, importance: lighting.importance.as_ref() };
    let (plan, _) = LightPlan::by_rays((gpu, &layouts), scene, &resources.ray_scene, side, &settings).unwrap();
    // Whether the scene needs it or not.
    let plan = LightPlan { probes: scene.probes.clone(), ..plan };
    let light = BakedLight::planned(&context, &layouts, source, (side, &plan, blake3::hash(b"")), &settings).unwrap();
    let mut bound = BoundScene::new(gpu, &layouts, resources, lighting, Some(light)).unwrap();
    let holds_light = |bound: &BoundScene| bound.baked.as_ref().unwrap().probes_hold_light();
    assert!(!holds_light(&bound), "before anything is captured");
    bound.finish_light(&context, &FrameInputs::of(scene, &[])).unwrap();
    assert!(holds_light(&bound));
    bound
}

/// All texels of all specular levels, as radiance, and their faces.
fn radiance(gpu: &Arc<Gpu>, bound: &BoundScene) -> Vec<(DVec3, u32)> {
    let mut all = Vec::new();
    for image in &bound.baked.as_ref().unwrap().probes().unwrap().specular {
        for (mip, layer) in (0..image.desc().mips).flat_map(|mip| (0..6).map(move |layer| (mip, layer))) {
            let face = texels(gpu, image, Subresource { mip, layer });
            all.extend(face.into_iter().map(|texel| (texel, layer)));
        }
    }
    all
}

#[test]
fn a_probe_in_an_integrating_sphere_sees_the_same_light_everywhere() {
    // L = I ρ / (π r² (1 − ρ)), wherever the probe is.
    let (base_color, intensity) = (0.5, 3.0);
    let mut ball = Mesh::ball(48, 1.0);
    ball.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    ball.vertices.iter_mut().for_each(|v| v.normal = v.normal.map(|c| -c));
    let energy = Energy::new(1.0, Geometry::Smith, Scattering::Multiple);
    let albedo = energy.specular_albedo(DVec3::splat(0.04), energy.mean).x
        + energy.diffuse_even(DVec3::splat(base_color), 0.0, energy.mean).x;
    let want = intensity * albedo / (PI * (1.0 - albedo));
    let worst = with_gpu(|gpu| {
        let bound = baked(gpu, &scene(ball, base_color as f32, intensity as f32, 9.0));
        let off = radiance(gpu, &bound).into_iter().map(|(texel, ..)| (texel / want - 1.0).abs().max_element());
        off.fold(0.0, f64::max)
    });
    println!("radiance {want:.4}, off by {worst:.4} at most");
    assert!(worst < 0.03, "off by {worst}");
}

#[test]
fn the_sky_is_left_to_the_panorama_and_what_halves_cannot_hold_is_cut_off() {
    // A small plate far below, which shines, under a sky as bright.
    let mut plate = Mesh::ball(4, 0.01);
    plate.vertices.iter_mut().for_each(|v| v.position[1] = -0.9);
    let mut scene = scene(plate, 0.5, 0.0, 1e6);
    scene.materials[0].emissive_factor = Vec3::splat(1e6);
    with_gpu(|gpu| {
        let all = radiance(gpu, &baked(gpu, &scene));
        assert!(all.iter().all(|(texel, ..)| texel.is_finite()));
        let most = |face: u32| {
            all.iter().filter(|(.., layer)| *layer == face).map(|(texel, ..)| texel.max_element()).fold(0.0, f64::max)
        };
        let [up, down] = [2, 3].map(most);
        println!("from above {up:.1}, from below {down:.1}");
        // Of the 60000 that are kept what a texel has that the plate covers in part.
        assert!(up < 1.0 && (1000.0..60000.5).contains(&down), "{up} from above, {down} from below");
    });
}

#[test]
fn nothing_is_built_for_what_mirrors_nothing() {
    with_gpu(|gpu| {
        let matt = scene(Mesh::ball(4, 0.5), 0.5, 1.0, 1.0);
        let layouts = Layouts::new(gpu).unwrap();
        let count_of = |scene: &Scene, probe_size: u32| {
            let light_detail = LightDetail { probe_size, ..LightDetail::default() };
            let settings = RenderSettings { light_detail, ..RenderSettings::default() };
            let bound = baked(gpu, scene);
            let rays = &bound.resources.ray_scene;
            LightPlan::by_rays((gpu, &layouts), scene, rays, SIDE, &settings).unwrap().0.probes.len()
        };
        assert_eq!(count_of(&matt, FACE), 0);
        let metal = Scene { materials: vec![Material::plain("metal", Vec3::ONE, 1.0, 0.3)], ..matt };
        assert_eq!([FACE, 16, 0].map(|probe_size| count_of(&metal, probe_size)), [1, 1, 0]);
    });
}
