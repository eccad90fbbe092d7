//! Changes of a scene while it is shown: they give the picture of a scene that is like that from the start, light follows
//! them, and what is clicked on is what is seen.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{Mat4, Vec3};
use image::{Rgba, RgbaImage};
use pbr_vr::asset::Panorama;
use pbr_vr::context::Context;
use pbr_vr::gpu::{FrameRing, Gpu, Subresource, read_image};
use pbr_vr::render::{
    Eye, FRAME_BYTES, FrameInputs, LightDetail, LightModel, MaterialFactors, Output, PassPipelines, RenderSettings,
    Renderer, SceneEdits, Shading,
};
use pbr_vr::scene::{Camera, Environment, Instance, Material, Mesh, PointLight, Scene};
use serde_json::json;

use crate::common::Workshop;
use crate::common::colour::loaded;
use crate::common::gltf::{Gltf, Shape};
use crate::common::stage::with_gpu;

const SIZE: [u32; 2] = [48, 48];
/// More than any bake here takes.
const PATIENCE: Duration = Duration::from_secs(120);

/// A metal ball and a lamp in a dull room, an eighth of which is open to a sky that is brighter on one side.
fn room(wall: Material, ball: Material, intensity: f32) -> Scene {
    let mut shell = Mesh::ball(12, 2.0);
    shell.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    shell.vertices.iter_mut().for_each(|v| v.normal = v.normal.map(|c| -c));
    shell.indices.truncate(shell.indices.len() / 24 * 21);
    let meshes = vec![shell, Mesh { material: 1, ..Mesh::ball(12, 0.4) }];
    let lamp =
        PointLight { position: Vec3::new(0.9, 0.3, 0.0), intensity: Vec3::splat(intensity), radius: 0.0, cone: None };
    let (position, target) = (Vec3::new(0.0, 0.2, 1.2), Vec3::ZERO);
    Scene {
        instances: (0..meshes.len()).map(|mesh| Instance { mesh, world_from_local: Mat4::IDENTITY }).collect(),
        meshes,
        materials: vec![wall, ball],
        sources: Vec::new(),
        textures: vec![],
        lights: vec![lamp],
        cameras: vec![Camera { name: "c".into(), position, target, vertical_fov_degrees: 60.0 }],
        environment: Environment {
            panorama: Panorama::from_fn(64, 32, |d| Vec3::splat(1.0 + 0.9 * d.x)),
            rotation_degrees: 0.0,
        },
        probes: vec![],
        exposure_ev: 0.0,
    }
}

fn plain(factors: MaterialFactors) -> Material {
    Material::plain("plain", factors.base_color, factors.metallic, factors.roughness)
}

const WALL: MaterialFactors = MaterialFactors { base_color: Vec3::new(0.6, 0.5, 0.4), metallic: 0.0, roughness: 0.9 };
const BALL: MaterialFactors = MaterialFactors { base_color: Vec3::new(0.9, 0.8, 0.3), metallic: 1.0, roughness: 0.2 };
const PAINTED: MaterialFactors =
    MaterialFactors { base_color: Vec3::new(0.1, 0.3, 0.8), metallic: 0.5, roughness: 0.6 };
const COPPER: MaterialFactors = MaterialFactors { base_color: Vec3::new(0.9, 0.5, 0.4), metallic: 1.0, roughness: 0.7 };

fn settings(light: LightModel, shading: Shading) -> RenderSettings {
    let light_detail =
        LightDetail { lightmap_size: Some(64), lightmap_samples: 8, probe_size: 32, ..LightDetail::default() };
    let output = Output::Linear;
    RenderSettings { light, shading, output, light_detail, cube_size: 16, ..RenderSettings::default() }
}

/// A renderer that draws what a scene's first camera sees.
struct Desk {
    gpu: Arc<Gpu>,
    renderer: Renderer,
    ring: FrameRing,
    inputs: FrameInputs<'static>,
    eye: Eye,
}

impl Desk {
    fn new(gpu: &Arc<Gpu>, scene: &Scene, settings: RenderSettings) -> Self {
        Self::with(gpu, scene, Renderer::new(&Context::silent(gpu), scene, settings, SIZE, 1).expect("a renderer"))
    }

    fn with(gpu: &Arc<Gpu>, scene: &Scene, renderer: Renderer) -> Self {
        Self {
            gpu: Arc::clone(gpu),
            renderer,
            ring: FrameRing::new(gpu, FRAME_BYTES).expect("a ring"),
            inputs: FrameInputs::of(scene, &[]),
            eye: Eye::of_camera(&scene.cameras[0], 1.0),
        }
    }

    fn edit(&mut self, edits: SceneEdits) {
        let takes_pipelines = self.renderer.set_edits(edits);
        assert!(self.renderer.lacks_pipelines() || !takes_pipelines);
        if takes_pipelines {
            self.renderer.rebuild(self.renderer.settings().clone(), 1).expect("pipelines");
            assert!(!self.renderer.lacks_pipelines());
        }
    }

    fn draw(&mut self) {
        let mut frame = self.ring.begin().expect("a frame");
        let inputs = FrameInputs { eyes: &[self.eye], ..self.inputs };
        self.renderer.record(&mut frame, &inputs).expect("a recorded frame");
        frame.submit(None).expect("a submission");
    }

    /// A picture with all its light.
    fn picture(&mut self, frames: u32) -> Vec<f32> {
        if self.renderer.settings().shading != Shading::Reference {
            self.renderer.finish_lightmap(&self.inputs).expect("light");
        }
        (0..frames).for_each(|_| self.draw());
        self.pixels()
    }

    fn pixels(&mut self) -> Vec<f32> {
        self.ring.finish_all().expect("its end");
        let bytes = read_image(&self.gpu, self.renderer.picture(), Subresource { mip: 0, layer: 0 }, 16);
        bytemuck::pod_collect_to_vec(&bytes.expect("a picture"))
    }

    /// Frames as a window draws them, until it draws no more.
    fn until_finished(&mut self) -> u32 {
        let (started, mut frames) = (Instant::now(), 0);
        loop {
            self.draw();
            frames += 1;
            if !self.renderer.is_unfinished() {
                return frames;
            }
            assert!(started.elapsed() < PATIENCE, "light at {:?}", self.renderer.light_progress());
        }
    }
}

/// The greatest difference of two pictures' values, relative to the mean of the first.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    let mean = a.iter().sum::<f32>() / a.len() as f32;
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / mean
}

fn both_edits() -> SceneEdits {
    let mut edits = SceneEdits::default();
    edits.set_material(0, Some(PAINTED));
    edits.set_material(1, Some(COPPER));
    edits.set_lamp(0, Some(2.0));
    edits
}

#[test]
fn an_edited_scene_looks_like_one_that_is_so_from_the_start() {
    let (scene, wanted) = (room(plain(WALL), plain(BALL), 3.0), room(plain(PAINTED), plain(COPPER), 6.0));
    with_gpu(|gpu| {
        for (light, shading, frames) in
            [(LightModel::Direct, Shading::Pbr, 1), (LightModel::Baked, Shading::Reference, 3)]
        {
            let mut desk = Desk::new(gpu, &scene, settings(light, shading));
            let first = desk.picture(frames);
            desk.edit(both_edits());
            let edited = desk.picture(frames);
            let want = Desk::new(gpu, &wanted, settings(light, shading)).picture(frames);
            let (changed, off) = (difference(&first, &edited), difference(&want, &edited));
            println!("{light:?} {shading:?}: changed by {changed}, off by {off}");
            assert!(changed > 0.5, "{light:?} {shading:?}: nothing changes");
            assert!(off < 2e-3, "{light:?} {shading:?}: off by {off}");
            desk.edit(SceneEdits::default());
            assert!(desk.picture(frames) == first, "{light:?} {shading:?}: not as before");
        }
    });
}

/// A window draws only while the picture is not what it could be.
#[test]
fn light_follows_edits_and_the_panorama_although_nothing_else_is_drawn() {
    let (scene, wanted) = (room(plain(WALL), plain(BALL), 3.0), room(plain(PAINTED), plain(COPPER), 6.0));
    with_gpu(|gpu| {
        let settings = settings(LightModel::Baked, Shading::Pbr);
        let context = Context::silent(gpu);
        let renderer = Renderer::without_lightmap(&context, &scene, settings.clone(), SIZE, 1).expect("a renderer");
        let mut desk = Desk::with(gpu, &scene, renderer);
        desk.edit(both_edits());
        desk.draw();
        // The lightmap is of the scene as its file has it.
        let lightmapped = desk.renderer.lightmap_request().prepare(&context, &scene, &false.into());
        let lightmapped = lightmapped.expect("light").expect("a lightmap");
        let request = desk.renderer.pipeline_request_lightmapped(&lightmapped);
        let pipelines = PassPipelines::build(&request).expect("pipelines");
        desk.renderer.set_lightmapped(lightmapped, pipelines).expect("a lightmapped scene");
        assert!(!desk.renderer.lacks_pipelines());
        desk.until_finished();
        let off = difference(&Desk::new(gpu, &wanted, settings.clone()).picture(1), &desk.pixels());
        assert!(off < 2e-3, "edited: off by {off}");

        desk.edit(SceneEdits::default());
        desk.inputs.environment_rotation = 2.0;
        assert!(desk.until_finished() > 10, "the light is that of before");
        let mut at_once = Desk::new(gpu, &scene, settings);
        at_once.inputs.environment_rotation = 2.0;
        let off = difference(&at_once.picture(1), &desk.pixels());
        assert!(off < 1e-6, "turned: off by {off}");
    });
}

#[test]
fn a_lamp_that_is_off_gives_no_light() {
    let mut scene = room(plain(WALL), plain(BALL), 3.0);
    scene.environment.panorama = Panorama::uniform(Vec3::ZERO);
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, &scene, settings(LightModel::Direct, Shading::Pbr));
        let lit = desk.picture(1);
        let mut edits = SceneEdits::default();
        edits.set_lamp(0, Some(0.0));
        desk.edit(edits);
        let dark = desk.picture(1);
        assert!(lit.iter().sum::<f32>() > 0.0);
        assert!(dark.chunks(4).all(|pixel| pixel[..3] == [0.0; 3]));
    });
}

#[test]
fn numbers_out_of_range_are_brought_into_it() {
    let mut edits = SceneEdits::default();
    let base_color = Vec3::new(f32::NAN, -1.0, 7.0);
    edits.set_material(3, Some(MaterialFactors { base_color, metallic: f32::INFINITY, roughness: -0.1 }));
    let want = MaterialFactors { base_color: Vec3::new(0.0, 0.0, 1.0), metallic: 1.0, roughness: 0.0 };
    assert_eq!(edits.materials[&3], want);
    edits.set_lamp(0, Some(f32::NAN));
    edits.set_lamp(1, Some(f32::INFINITY));
    assert!(edits.lamps[&0] == 0.0 && edits.lamps[&1].is_finite());
    edits.set_material(3, None);
    edits.set_lamp(0, None);
    edits.set_lamp(1, None);
    assert!(edits.is_empty());
    // Of materials and lamps that are not there.
    let scene = room(plain(WALL), plain(BALL), 3.0);
    with_gpu(|gpu| {
        let mut desk = Desk::new(gpu, &scene, settings(LightModel::Direct, Shading::Pbr));
        let first = desk.picture(1);
        let mut edits = SceneEdits::default();
        edits.set_material(99, Some(WALL));
        edits.set_lamp(99, Some(2.0));
        desk.edit(edits);
        assert!(desk.picture(1) == first && desk.renderer.factors(99).is_none());
    });
}

#[test]
fn what_is_picked_is_what_is_seen() {
    let shop = Workshop::new();
    let mut gltf = Gltf::new();
    // The left half of the near plate is a hole; the plate in the middle is seen from behind.
    let holed = RgbaImage::from_fn(8, 8, |x, _| Rgba([255, 255, 255, if x < 4 { 0 } else { 255 }]));
    let texture = gltf.texture(&holed, json!({"magFilter": 9728, "minFilter": 9728}));
    let maps = json!({"baseColorTexture": {"index": texture}});
    let near = gltf.material(json!({"alphaMode": "MASK", "doubleSided": true, "pbrMetallicRoughness": maps}));
    let back = gltf.material(json!({"doubleSided": false}));
    let far = gltf.material(json!({"doubleSided": true}));
    gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.5), near);
    let turn = glam::DMat4::from_rotation_y(std::f64::consts::PI);
    gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0).moved(turn), back);
    gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], -0.5), far);
    let scene = loaded(&gltf.write(&shop, "plates.gltf"), 1.0);
    let index = |gltf_index: usize| {
        let (all, most) = (&scene.materials, scene.materials.len());
        assert!(gltf_index < most, "{all:?}");
        gltf_index
    };
    with_gpu(|gpu| {
        let settings = settings(LightModel::Open, Shading::Pbr);
        let mut renderer = Renderer::new(&Context::silent(gpu), &scene, settings, SIZE, 1).expect("a renderer");
        let eye = Eye::looking(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, 60.0, 1.0);
        let mut pick =
            |pixel: [u32; 2], moved: Mat4| renderer.pick(&eye.of_pixel(pixel, SIZE), moved).expect("a picked material");
        let (left, right, sky) = ([20, 24], [28, 24], [2, 2]);
        assert_eq!(pick(right, Mat4::IDENTITY), Some(index(near)));
        assert_eq!(pick(left, Mat4::IDENTITY), Some(index(far)), "through a hole and a back that is not seen");
        assert_eq!(pick(sky, Mat4::IDENTITY), None);
        // Turned by half, the far plate is in front, and moved away nothing is there.
        assert_eq!(pick(right, Mat4::from_rotation_y(std::f32::consts::PI)), Some(index(far)));
        assert_eq!(pick(right, Mat4::from_translation(10.0 * Vec3::X)), None);
    });
}
