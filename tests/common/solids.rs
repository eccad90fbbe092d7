//! Scenes of a few exact shapes, made in memory, and pictures of them as numbers.

use std::sync::Arc;

use glam::{DVec3, Mat4, Vec3};
use half::f16;
use pbr_vr::asset::{Panorama, Report};
use pbr_vr::context::{Context, Setup};
use pbr_vr::gpu::{FrameRing, Gpu, Subresource, read_image};
use pbr_vr::reference::shadow::hit;
use pbr_vr::render::{
    Eye, FRAME_BYTES, FRAMES_IN_FLIGHT, FrameInputs, LightDetail, LightModel, Output, RenderSettings, Renderer,
    Shading, StandardError, lightmap_sides,
};
use pbr_vr::scene::{Bounds, Camera, Environment, Instance, Material, Mesh, PointLight, Scene, Vertex};

use super::validated;

/// Counter-clockwise seen from its front.
pub type Quad = [DVec3; 4];

pub fn quad(corners: [[f64; 3]; 4]) -> Quad {
    corners.map(DVec3::from)
}

/// A level rectangle that faces up.
pub fn level([x0, x1]: [f64; 2], y: f64, [z0, z1]: [f64; 2]) -> Quad {
    quad([[x0, y, z1], [x1, y, z1], [x1, y, z0], [x0, y, z0]])
}

/// The faces of a box, outwards: −x, +x, −y, +y, −z, +z.
pub fn block([x0, y0, z0]: [f64; 3], [x1, y1, z1]: [f64; 3]) -> [Quad; 6] {
    [
        quad([[x0, y0, z0], [x0, y0, z1], [x0, y1, z1], [x0, y1, z0]]),
        quad([[x1, y0, z1], [x1, y0, z0], [x1, y1, z0], [x1, y1, z1]]),
        quad([[x0, y0, z0], [x1, y0, z0], [x1, y0, z1], [x0, y0, z1]]),
        level([x0, x1], y1, [z0, z1]),
        quad([[x1, y0, z0], [x0, y0, z0], [x0, y1, z0], [x1, y1, z0]]),
        quad([[x0, y0, z1], [x1, y0, z1], [x1, y1, z1], [x0, y1, z1]]),
    ]
}

/// The same faces seen from their other sides.
pub fn turned<const N: usize>(quads: [Quad; N]) -> [Quad; N] {
    quads.map(|[a, b, c, d]| [d, c, b, a])
}

/// A mesh of flat quadrilaterals, joined where corners coincide only as far as the program itself does that.
pub fn flat(material: usize, quads: &[Quad]) -> Mesh {
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for [a, b, c, d] in quads {
        let n = (*b - *a).cross(*d - *a).normalize_or(DVec3::Y).as_vec3();
        let tangent = (*b - *a).normalize_or(DVec3::X).as_vec3().extend(1.0);
        let first = vertices.len() as u32;
        for (corner, uv) in [a, b, c, d].into_iter().zip([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]) {
            let (position, normal) = (corner.as_vec3().into(), n.into());
            vertices.push(Vertex { position, normal, uv, tangent: tangent.into(), ..Vertex::default() });
        }
        indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }
    let bounds = Bounds::of(vertices.iter().map(|v| v.position.into()));
    Mesh { name: "flat".into(), vertices, indices, material, bounds }
}

/// A ball with smooth normals; `inward`: seen from inside.
pub fn ball(material: usize, centre: [f64; 3], radius: f32, rows: u32, inward: bool) -> Mesh {
    let centre = DVec3::from(centre).as_vec3();
    let mut mesh = Mesh { material, ..Mesh::ball(rows, radius) };
    for vertex in &mut mesh.vertices {
        vertex.position = (centre + Vec3::from(vertex.position)).into();
        if inward {
            vertex.normal = vertex.normal.map(|c| -c);
        }
    }
    if inward {
        mesh.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    }
    mesh.bounds = Bounds { min: mesh.bounds.min + centre, max: mesh.bounds.max + centre };
    mesh
}

/// A triangle too small to matter: with it far away, a scene is so large that the least lightmap is fine enough.
pub fn mote(at: [f64; 3]) -> Mesh {
    let [x, y, z] = at;
    let mut mesh = flat(0, &[level([x, x + 1e-3], y, [z, z + 1e-3])]);
    mesh.indices.truncate(3);
    mesh
}

/// A grey, matte or metallic material.
pub fn grey(base_color: f32, metallic: f32, roughness: f32) -> Material {
    Material::plain("m", Vec3::splat(base_color), metallic, roughness)
}

pub fn lamp(position: [f64; 3], intensity: f32) -> PointLight {
    PointLight { position: DVec3::from(position).as_vec3(), intensity: Vec3::splat(intensity), radius: 0.0, cone: None }
}

/// A scene of meshes under lamps and a panorama, with a camera where the pictures' eye is.
pub fn world(meshes: Vec<Mesh>, materials: Vec<Material>, lights: Vec<PointLight>, sky: Panorama) -> Scene {
    Scene {
        instances: (0..meshes.len()).map(|mesh| Instance { mesh, world_from_local: Mat4::IDENTITY }).collect(),
        meshes,
        sources: Vec::new(),
        materials,
        textures: Vec::new(),
        lights,
        cameras: Vec::new(),
        environment: Environment { panorama: sky, rotation_degrees: 0.0 },
        probes: vec![],
        exposure_ev: 0.0,
    }
}

pub fn uniform(radiance: f32) -> Panorama {
    Panorama::uniform(Vec3::splat(radiance))
}

pub fn eye(position: [f64; 3], target: [f64; 3], fov_degrees: f32) -> Eye {
    let [position, target] = [position, target].map(|p| DVec3::from(p).as_vec3());
    Eye::looking(position, target, fov_degrees, 1.0)
}

/// What is drawn, on square pictures.
#[derive(Clone, Copy)]
pub struct Shot {
    pub light: LightModel,
    pub shading: Shading,
    pub size: u32,
    pub frames: u64,
    pub world_from_models: Mat4,
    /// Texels along the lightmap.
    pub lightmap: u32,
}

impl Shot {
    pub fn new(light: LightModel, size: u32) -> Self {
        Self { light, shading: Shading::Pbr, size, frames: 1, world_from_models: Mat4::IDENTITY, lightmap: 128 }
    }

    /// The reference's mean of so many frames.
    pub fn reference(light: LightModel, size: u32, frames: u64) -> Self {
        Self { shading: Shading::Reference, frames, ..Self::new(light, size) }
    }
}

/// A picture: one grey number for each pixel, rows from the top.
pub struct Taken {
    pub size: u32,
    pub pixels: Vec<f64>,
    pub error: Option<StandardError>,
    /// All halves of the finished lightmap, as bits.
    pub lightmap: Vec<u16>,
    pub warnings: Vec<String>,
}

impl Taken {
    pub fn mean(&self) -> f64 {
        self.pixels.iter().sum::<f64>() / self.pixels.len() as f64
    }

    pub fn largest(&self) -> f64 {
        self.pixels.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Of a list of 0 for as dark as can be to 1 for as bright, the value at a share.
    pub fn quantile(&self, share: f64) -> f64 {
        let mut sorted = self.pixels.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[((sorted.len() - 1) as f64 * share).round() as usize]
    }
}

/// Draws a scene for each eye; the lightmap is finished first, where the picture has one.
pub fn take_all(gpu: &Arc<Gpu>, scene: &Scene, eyes: &[Eye], shot: Shot) -> Vec<Taken> {
    let mut scene = scene.clone();
    let cameras = eyes.iter().enumerate().map(|(i, eye)| Camera {
        name: i.to_string(),
        position: eye.position(),
        target: eye.world_from_view.transform_point3(-Vec3::Z),
        vertical_fov_degrees: 45.0,
    });
    scene.cameras = cameras.collect();
    let Shot { light, shading, size, frames, world_from_models, lightmap } = shot;
    let light_detail = LightDetail { lightmap_size: Some(lightmap), ..LightDetail::default() };
    let settings = RenderSettings {
        light,
        shading,
        samples: 1,
        output: Output::Linear,
        cube_size: 16,
        light_detail,
        ..Default::default()
    };
    let context = Context { report: Arc::new(Report::silent()), ..Setup::silent(validated()).with(gpu) };
    let mut renderer = Renderer::new(&context, &scene, settings, [size; 2], 1).expect("a renderer");
    let inputs = FrameInputs { world_from_models, ..FrameInputs::of(&scene, &eyes[..1]) };
    let is_baked = light == LightModel::Baked && shading != Shading::Reference;
    if is_baked {
        renderer.finish_lightmap(&inputs).expect("a lightmap");
    }
    let lightmap = renderer.lightmap().filter(|_| is_baked).map_or_else(Vec::new, |image| {
        let layer = |layer| read_image(gpu, image, Subresource { mip: 0, layer }, 8).expect("a lightmap");
        let layers = (0..lightmap_sides(image)).flat_map(layer);
        layers.collect::<Vec<u8>>().chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
    });
    assert!(lightmap.iter().all(|bits| f16::from_bits(*bits).is_finite() && bits & 0x8000 == 0), "in the lightmap");
    let take = |eye: &Eye| {
        let inputs = FrameInputs { eyes: std::slice::from_ref(eye), ..inputs };
        let mut ring = FrameRing::new(gpu, FRAME_BYTES).expect("a ring");
        for _ in 0..frames {
            let mut frame = ring.begin().expect("a frame");
            renderer.record(&mut frame, &inputs).expect("a recorded frame");
            frame.submit(None).expect("a submission");
        }
        ring.finish_all().expect("its end");
        let slot = ((frames - 1) % FRAMES_IN_FLIGHT as u64) as usize;
        let bytes = read_image(gpu, renderer.picture(), Subresource { mip: 0, layer: 0 }, Output::Linear.bytes());
        let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes.expect("a picture"));
        assert!(texels.iter().all(|t| t.iter().all(|v| v.is_finite() && *v >= 0.0)), "in the picture");
        let pixels = texels.iter().map(|t| f64::from(t[0])).collect();
        let (error, warnings) = (renderer.standard_error(slot), context.report.warnings());
        Taken { size, pixels, error, lightmap: lightmap.clone(), warnings }
    };
    eyes.iter().map(take).collect()
}

pub fn take(gpu: &Arc<Gpu>, scene: &Scene, eye: &Eye, shot: Shot) -> Taken {
    take_all(gpu, scene, std::slice::from_ref(eye), shot).remove(0)
}

/// Bounds on the mean, from the reference's own standard error, and a part of it for tables and shapes in f32.
pub fn assert_mean(name: &str, taken: &Taken, want: f64, slack: f64) {
    let standard = taken.error.expect("an error").mean_relative * want / f64::from(taken.size);
    let mean = taken.mean();
    println!("{name}: {mean:.5} ± {standard:.5}, for {want:.5}: {:+.3} %", 100.0 * (mean / want - 1.0));
    assert!((mean - want).abs() <= 4.0 * standard + slack * want, "{name}: {mean} ± {standard}, not {want}");
}

/// Where a pixel's ray meets a scene's triangles first, with the triangle's normal towards the eye, and the mesh.
pub fn seen(scene: &Scene, eye: &Eye, size: u32, pixel: usize) -> Option<(DVec3, DVec3, usize)> {
    let at = |i: usize, a: f32, b: f32| f64::from(a) + (i as f64 + 0.5) / f64::from(size) * f64::from(b - a);
    let (x, y) = (pixel % size as usize, pixel / size as usize);
    let from = eye.position().as_dvec3();
    let view = DVec3::new(at(x, eye.left, eye.right), at(y, eye.up, eye.down), -1.0);
    let d = eye.world_from_view.as_dmat4().transform_vector3(view);
    let mut nearest: Option<(f64, DVec3, usize)> = None;
    for (index, mesh) in scene.meshes.iter().enumerate() {
        for t in mesh.indices.chunks_exact(3) {
            let corners = [t[0], t[1], t[2]].map(|i| Vec3::from(mesh.vertices[i as usize].position).as_dvec3());
            let Some(along) = hit(from, d, corners).filter(|along| *along > 0.0) else { continue };
            if nearest.is_none_or(|(least, ..)| along < least) {
                let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
                nearest = Some((along, if n.dot(d) > 0.0 { -n } else { n }, index));
            }
        }
    }
    nearest.map(|(along, n, mesh)| (from + along * d, n, mesh))
}
