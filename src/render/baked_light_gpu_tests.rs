//! Light from the cache: what such a start leaves out, and what is computed all the same once the light changes.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use glam::{Mat4, Vec3};

use super::bound_scene::{BAKE_MS, BoundScene};
use super::edits::{MaterialFactors, SceneEdits};
use super::frame::{FRAME_BYTES, FrameInputs};
use super::layouts::Layouts;
use super::light_detail::LightDetail;
use super::lighting::Lighting;
use super::lightmapped::LightmapRequest;
use super::scene_resources::SceneTextures;
use super::settings::{LightModel, RenderSettings};
use crate::asset::{Cache, Panorama};
use crate::context::Context;
use crate::gpu::{FrameRing, Gpu, with_gpu};
use crate::precompute::read_texture;
use crate::scene::{Camera, Environment, Instance, Material, Mesh, PointLight, Scene};

/// More than any bake here takes.
const PATIENCE: Duration = Duration::from_secs(120);

/// A metal ball in a round room, an eighth of which is open to a sky that is brighter on one side.
fn scene() -> Scene {
    let mut room = Mesh::ball(12, 2.0);
    room.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    room.vertices.iter_mut().for_each(|v| v.normal = v.normal.map(|c| -c));
    let kept = room.indices.len() / 24 * 21;
    room.indices.truncate(kept);
    let ball = Mesh { material: 1, ..Mesh::ball(12, 0.4) };
    let materials = [(0.0, 1.0), (1.0, 0.2)];
    let plain = |(metallic, roughness)| Material::plain("plain", Vec3::splat(0.6), metallic, roughness);
    let sky = Panorama::from_fn(64, 32, |d| Vec3::splat(1.0 + 0.9 * d.x));
    Scene {
        meshes: vec![room, ball],
        instances: (0..2).map(|mesh| Instance { mesh, world_from_local: Mat4::IDENTITY }).collect(),
        sources: Vec::new(),
        materials: materials.map(plain).into(),
        textures: vec![],
        lights: vec![PointLight {
            position: Vec3::new(0.9, 0.3, 0.0),
            intensity: Vec3::splat(3.0),
            radius: 0.0,
            cone: None,
        }],
        cameras: vec![Camera {
            name: "c".into(),
            position: Vec3::new(0.0, 0.2, 1.2),
            target: Vec3::ZERO,
            vertical_fov_degrees: 60.0,
        }],
        environment: Environment { panorama: sky, rotation_degrees: 0.0 },
        probes: vec![],
        exposure_ev: 0.0,
    }
}

fn bound(context: &Context, scene: &Scene) -> (BoundScene, bool) {
    let layouts = Arc::new(Layouts::new(&context.gpu).unwrap());
    let detail = LightDetail { lightmap_size: Some(64), lightmap_samples: 8, probe_size: 32, ..LightDetail::default() };
    let settings =
        RenderSettings { light: LightModel::Baked, light_detail: detail, cube_size: 16, ..RenderSettings::default() };
    let textures = SceneTextures::new(context, &layouts, scene, &settings).unwrap();
    let lighting = Lighting::new(context, &scene.environment.panorama, &settings).unwrap();
    let request = LightmapRequest::new(&layouts, &textures, &lighting, &settings);
    let lightmapped = request.prepare(context, scene, &AtomicBool::new(false)).unwrap().expect("a lightmap");
    let is_traced = lightmapped.resources.ray_scene.is_built();
    let (resources, baked) = (lightmapped.resources, lightmapped.baked);
    (BoundScene::new(&context.gpu, &layouts, resources, lighting, Some(baked)).unwrap(), is_traced)
}

/// All bytes of lightmap and probes.
fn light(gpu: &Arc<Gpu>, bound: &BoundScene) -> Vec<Vec<Vec<u8>>> {
    let baked = bound.baked.as_ref().unwrap();
    let probes = &baked.probes().expect("a probe for the ball").specular;
    let images = [baked.lightmap()].into_iter().chain(probes);
    images.map(|image| read_texture(gpu, &[image]).unwrap().levels).collect()
}

fn turned(scene: &Scene, radians: f32) -> FrameInputs<'_> {
    FrameInputs { environment_rotation: radians, ..FrameInputs::of(scene, &[]) }
}

#[test]
fn light_from_the_cache_needs_no_rays_until_it_changes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene();
    with_gpu(|gpu| {
        let context = Context { cache: Some(Cache::in_folder(folder.path().into())), ..Context::silent(gpu) };
        let (mut first, is_traced) = bound(&context, &scene);
        assert!(is_traced && first.light_progress().is_some(), "what is missing is prepared at once");
        first.finish_light(&context, &turned(&scene, 0.0)).unwrap();
        let known = light(gpu, &first);
        first.finish_light(&context, &turned(&scene, 2.0)).unwrap();
        let wanted = light(gpu, &first);
        assert!(wanted != known);
        drop(first);

        let (mut again, is_traced) = bound(&context, &scene);
        assert!(!is_traced, "rays for light that is there");
        assert_eq!(again.light_progress(), None);
        assert!(light(gpu, &again) == known, "other light came from the cache");
        assert_eq!(again.finish_light(&context, &turned(&scene, 0.0)).unwrap(), 0.0);
        assert!(!again.resources.ray_scene.is_built());

        // As a window does it: the old light stays until the panorama rests.
        let mut ring = FrameRing::new(gpu, FRAME_BYTES).unwrap();
        let (inputs, started) = (turned(&scene, 2.0), Instant::now());
        let mut waited = 0;
        loop {
            let mut frame = ring.begin().unwrap();
            if again.follow_light(&inputs, &context.report).unwrap() {
                let block = inputs.block(again.constants());
                again.record_light(&mut frame, &block, BAKE_MS).unwrap();
            } else if !again.resources.ray_scene.is_built() {
                waited += 1;
            } else if again.light_progress().is_none() {
                break;
            }
            frame.submit(None).unwrap();
            assert!(started.elapsed() < PATIENCE, "light at {:?}", again.light_progress());
        }
        assert!(waited > 10, "frames went on for {waited} frames only");
        ring.finish_all().unwrap();
        drop(ring);
        for (i, (got, want)) in light(gpu, &again).iter().zip(&wanted).enumerate() {
            assert!(got == want, "image {i} differs");
        }
        assert_eq!(context.report.warnings(), [""; 0]);
    });
}

/// Shaders of light for a scene without smooth metal have no code for it, until a material is made of it.
#[test]
fn light_of_a_material_that_became_metal_is_that_of_metal() {
    let smooth = |metallic| Material::plain("ball", Vec3::new(0.9, 0.6, 0.3), metallic, 0.2);
    let with_ball = |metallic: f32| {
        let mut scene = scene();
        scene.materials[1] = smooth(metallic);
        scene
    };
    let metal = MaterialFactors { base_color: smooth(1.0).base_color_factor, metallic: 1.0, roughness: 0.2 };
    let mut edits = SceneEdits::default();
    edits.set_material(1, Some(metal));
    with_gpu(|gpu| {
        let context = Context::silent(gpu);
        let lightmap = |scene: &Scene, edits: [SceneEdits; 2]| {
            let (mut bound, _) = bound(&context, scene);
            for edits in edits {
                bound.set_edits(edits);
                bound.finish_light(&context, &turned(scene, 0.0)).unwrap();
            }
            read_texture(gpu, &[bound.baked.as_ref().unwrap().lightmap()]).unwrap().levels
        };
        let none = SceneEdits::default;
        let (plastic, metal) = (with_ball(0.0), with_ball(1.0));
        let wanted = lightmap(&metal, [none(), none()]);
        assert!(lightmap(&plastic, [none(), none()]) != wanted);
        assert!(lightmap(&plastic, [none(), edits.clone()]) == wanted, "edited once there was light");
        assert!(lightmap(&plastic, [edits.clone(), edits.clone()]) == wanted, "edited before");
    });
}

#[test]
fn a_scene_that_goes_while_its_bake_is_prepared_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene();
    with_gpu(|gpu| {
        let context = Context { cache: Some(Cache::in_folder(folder.path().into())), ..Context::silent(gpu) };
        let (mut first, _) = bound(&context, &scene);
        first.finish_light(&context, &turned(&scene, 0.0)).unwrap();
        drop(first);
        let (mut again, _) = bound(&context, &scene);
        for _ in 0..12 {
            again.follow_light(&turned(&scene, 1.0), &context.report).unwrap();
        }
        assert_eq!(again.light_progress(), Some(0.0));
        drop(again);
    });
}
