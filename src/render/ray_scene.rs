//! What rays meet, on the GPU: a scene's triangles under a hierarchy with their corners, and reduced copies of textures.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytemuck::{Pod, Zeroable};
use glam::{DVec4, Mat4, Vec3};

use super::emitters;
use super::layouts::Layouts;
use super::ray_features::{EMISSIVE_MAPS, EXTENSION_MAPS, features};
use super::ray_textures::RayTextures;
use super::shared::{VertexExtraBlock, constant, ray_feature};
use crate::Result;
use crate::gpu::{AddressMode, Binding, Buffer, BufferKind, Constant, DescriptorSet, Gpu, Sampler, Upload};
use crate::reference::octahedral::pack_frame;
use crate::scene::atlas::steps;
use crate::scene::bvh::{Bvh, BvhTriangle, Hit};
use crate::scene::darkness::{TriangleLight, is_dark};
use crate::scene::lightmap_texels::{LightmapTexels, Sides, sides};
use crate::scene::places::Places;
use crate::scene::sphere_lights::SphereLight;
use crate::scene::surroundings::spiral;
use crate::scene::{GeometryView, Instance, Mesh, Model, Scene, Vertex};

/// The upper bits of a triangle's material, the same as in `glsl/bvh.glsl`: it is alpha-tested; its back is never seen.
const MASKED: u32 = 1 << 31;
const ONE_SIDED: u32 = 1 << 30;
/// It is part of a sphere light.
const SPHERE: u32 = 1 << 29;
/// Triangles that shine and are looked at one by one, at most.
const MOST_EMITTERS: usize = 256;
/// The CPU data of a scene's rays, and from its first use on the scene on the GPU.
pub struct LazyRayScene {
    meshes: Vec<Mesh>,
    instances: Vec<Instance>,
    /// For each of the scene's materials.
    masked: Vec<bool>,
    culls_backs: Vec<bool>,
    lets_through: Vec<bool>,
    /// Of each material, the sum of its channels.
    emission: Vec<f32>,
    has_textures: bool,
    /// What shaders have code for: bits of [`ray_feature`].
    features: u32,
    /// Where paths begin that look for the backs that are seen.
    cameras: Vec<Vec3>,
    lamps: Vec<Vec3>,
    spheres: Vec<SphereLight>,
    texture_sets: Mutex<Arc<[DescriptorSet]>>,
    built: Mutex<Option<Arc<RayScene>>>,
}

/// The buffers and textures that rays read, and the hierarchy on the CPU.
pub struct RayScene {
    pub bvh: Bvh,
    /// The sides that are seen of each of its triangles.
    sides: Vec<Sides>,
    nodes: Arc<Buffer>,
    triangles: Arc<Buffer>,
    corners: Arc<Buffer>,
    corner_extras: Arc<Buffer>,
    emitters: Arc<Buffer>,
    textures: RayTextures,
}

/// `bindings::RAYS` for one scene and panorama.
pub struct RaySet {
    pub set: DescriptorSet,
}

/// A triangle: an element of `RAY_TRIANGLES`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct TriangleBlock {
    corners: [[f32; 3]; 3],
    material_and_flags: u32,
}

/// One of its corners: an element of `RAY_CORNERS`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct CornerBlock {
    frame: [i16; 4],
    uv: [f32; 2],
    /// In 65536ths.
    lightmap_uv: [u16; 2],
}

impl LazyRayScene {
    /// Copies what rays need of a scene with this geometry; its textures are read from their descriptor sets.
    pub fn new(
        scene: &Scene,
        geometry: GeometryView<'_>,
        texture_sets: &Arc<[DescriptorSet]>,
        spheres: Vec<SphereLight>,
    ) -> Self {
        Self {
            meshes: geometry.meshes.to_vec(),
            instances: geometry.instances.to_vec(),
            masked: scene.materials.iter().map(|m| m.alpha_cutoff.is_some() || m.blends).collect(),
            culls_backs: scene.materials.iter().map(|m| m.culls_backs).collect(),
            lets_through: scene.materials.iter().map(|m| m.diffuse_transmission.is_some()).collect(),
            emission: scene.materials.iter().map(|material| material.emissive_factor.element_sum()).collect(),
            has_textures: !scene.textures.is_empty(),
            features: features(&scene.materials, geometry),
            cameras: scene.cameras.iter().map(|camera| camera.position).collect(),
            lamps: scene.lights.iter().map(|lamp| lamp.position).collect(),
            spheres,
            texture_sets: Mutex::new(Arc::clone(texture_sets)),
            built: Mutex::new(None),
        }
    }

    /// Nothing for rays to meet.
    fn empty() -> Self {
        Self {
            meshes: Vec::new(),
            instances: Vec::new(),
            masked: Vec::new(),
            culls_backs: Vec::new(),
            lets_through: Vec::new(),
            emission: Vec::new(),
            has_textures: false,
            features: 0,
            cameras: Vec::new(),
            lamps: Vec::new(),
            spheres: Vec::new(),
            texture_sets: Mutex::new(Arc::new([])),
            built: Mutex::new(None),
        }
    }

    /// Takes the same textures with other levels from now on; what is built stays.
    pub fn set_textures(&self, sets: &Arc<[DescriptorSet]>) {
        *locked(&self.texture_sets) = Arc::clone(sets);
    }

    /// The scene on the GPU; the first call builds it.
    pub fn get(&self, gpu: &Arc<Gpu>, layouts: &Layouts) -> Result<Arc<RayScene>> {
        let mut built = locked(&self.built);
        if let Some(built) = &*built {
            return Ok(Arc::clone(built));
        }
        let bvh = Bvh::new(&self.meshes, &self.instances)?;
        let mut sides = sides(&bvh, &self.meshes, &self.instances, [&self.cameras, &self.lamps]);
        for (side, triangle) in sides.iter_mut().zip(bvh.triangles()) {
            if self.lets_through[self.mesh(triangle).material] {
                *side = Sides::Both;
            }
        }
        let sets = Arc::clone(&locked(&self.texture_sets));
        let has = [self.has_textures, self.has(EMISSIVE_MAPS), self.has(EXTENSION_MAPS)];
        let textures = RayTextures::new(gpu, layouts, &sets, has)?;
        let scene = Arc::new(RayScene::new(gpu, (bvh, sides), self, textures)?);
        *built = Some(Arc::clone(&scene));
        Ok(scene)
    }

    fn has(&self, feature: u32) -> bool {
        self.features & feature != 0
    }

    /// A constant of shaders that trace rays: the scene's features, and `more` that the scene alone does not say.
    pub fn features(&self, model: Model, more: u32) -> Constant {
        // Without sheets that tint there are no maps of what they let through; a clear coat is a second surface, sheen another layer;
        // stretched highlights have directions; films have colours; light diffuses to the other side; bodies of glass are followed through.
        let of_materials = ray_feature::TINTS
            | ray_feature::CLEARCOAT
            | ray_feature::SHEEN
            | ray_feature::ANISOTROPY
            | ray_feature::FILM
            | EXTENSION_MAPS
            | ray_feature::DIFFUSE_TRANSMISSION
            | ray_feature::REFRACTS;
        let everything = if model == Model::Everything { !of_materials } else { 0 };
        (constant::RAY_FEATURES, self.features | more | everything)
    }

    /// Another: the number of lamps.
    pub fn lamps(&self) -> Constant {
        (constant::LIGHTS, self.lamps.len() as u32)
    }

    /// Whether it has been used.
    #[cfg(test)]
    pub fn is_built(&self) -> bool {
        locked(&self.built).is_some()
    }

    /// Whether almost no light reaches what the cameras see.
    pub fn is_dark(&self, scene: &RayScene) -> bool {
        let light = |triangle: usize| {
            let material = self.mesh(&scene.bvh.triangles()[triangle]).material;
            TriangleLight {
                culls_back: self.culls_backs[material],
                is_open: self.masked[material],
                shines: self.emission[material] > 0.0,
            }
        };
        self.lamps.is_empty() && self.spheres.is_empty() && is_dark(&scene.bvh, &self.cameras, &light)
    }

    /// The texels of a lightmap of this side.
    pub fn lightmap_texels(&self, scene: &RayScene, side: u32) -> LightmapTexels {
        LightmapTexels::new(&scene.bvh, &self.meshes, &self.instances, side, &scene.sides)
    }

    fn triangle(&self, triangle: &BvhTriangle, sides: Sides) -> TriangleBlock {
        let material = self.mesh(triangle).material;
        let masked = if self.masked.get(material) == Some(&true) { MASKED } else { 0 };
        let one_sided = if sides == Sides::Both { 0 } else { ONE_SIDED };
        let corners = triangle.corners.map(Vec3::from);
        let is_of_sphere = self.emission[material] > 0.0 && self.spheres.iter().any(|sphere| sphere.has(corners));
        let sphere = if is_of_sphere { SPHERE } else { 0 };
        TriangleBlock { corners: triangle.corners, material_and_flags: material as u32 | masked | one_sided | sphere }
    }

    fn corners(&self, triangle: &BvhTriangle) -> [CornerBlock; 3] {
        let mesh = self.mesh(triangle);
        let place = self.instances[triangle.instance as usize].world_from_local;
        let first = triangle.first_index as usize;
        [0, 1, 2].map(|i| corner(&mesh.vertices[mesh.indices[first + i] as usize], place))
    }

    fn corner_extras(&self, triangle: &BvhTriangle) -> [VertexExtraBlock; 3] {
        let mesh = self.mesh(triangle);
        let first = triangle.first_index as usize;
        [0, 1, 2].map(|i| (&mesh.vertices[mesh.indices[first + i] as usize]).into())
    }

    fn mesh(&self, triangle: &BvhTriangle) -> &Mesh {
        &self.meshes[self.instances[triangle.instance as usize].mesh]
    }
}

/// A panic leaves nothing half done behind these locks.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn corner(vertex: &Vertex, place: Mat4) -> CornerBlock {
    let turned = |v: Vec3| place.transform_vector3(v).normalize_or(Vec3::Y).as_dvec3();
    let [x, y, z, sign] = vertex.tangent;
    let tangent: DVec4 = turned(Vec3::new(x, y, z)).extend(sign.into());
    let frame = pack_frame(turned(vertex.normal.into()), tangent);
    CornerBlock { frame, uv: vertex.uv, lightmap_uv: steps(vertex.lightmap_uv) }
}

impl RayScene {
    /// Places of its surfaces, at most so many.
    pub fn places(&self, most: u32) -> Places {
        Places::new(&self.bvh, &self.sides, most)
    }

    /// Of all that rays meet, metres.
    pub fn radius(&self) -> f32 {
        self.bvh.bounds().radius()
    }

    /// Whether a lamp, or something that shines, is nearer to a surface, or to one that does not, than `part` of the scene's radius.
    pub fn is_light_near(&self, source: &LazyRayScene, part: f32) -> bool {
        let triangles = self.bvh.triangles();
        let shines = |i: usize| source.emission[source.mesh(&triangles[i]).material] > 0.0;
        let emitters: Vec<usize> = (0..triangles.len()).filter(|i| shines(*i)).collect();
        let sides = |i: &usize| {
            let [a, b, c] = triangles[*i].corners.map(Vec3::from);
            let (middle, n) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize_or_zero());
            let off = 1e-4 * (self.radius() + middle.abs().max_element());
            [middle + off * n, middle - off * n]
        };
        let step = emitters.len().div_ceil(MOST_EMITTERS).max(1);
        let points: Vec<Vec3> = emitters.iter().step_by(step).flat_map(sides).collect();
        self.is_near(&source.lamps, part, |_| true) || self.is_near(&points, part, |hit| !shines(hit.triangle))
    }

    /// Whether some point has one of these surfaces nearer than `part` of the scene's radius.
    fn is_near(&self, points: &[Vec3], part: f32, counts: impl Fn(&Hit) -> bool) -> bool {
        let far = part * self.radius();
        const RAYS: u32 = 256;
        let is_met = |p: Vec3| (0..RAYS).any(|i| self.bvh.trace(p, spiral(i, RAYS), far, &counts).is_some());
        points.iter().any(|p| is_met(*p))
    }

    fn new(
        gpu: &Arc<Gpu>,
        (bvh, sides): (Bvh, Vec<Sides>),
        source: &LazyRayScene,
        textures: RayTextures,
    ) -> Result<Self> {
        let triangle = |(triangle, sides): (&BvhTriangle, &Sides)| source.triangle(triangle, *sides);
        let triangles: Vec<TriangleBlock> = bvh.triangles().iter().zip(&sides).map(triangle).collect();
        let corners: Vec<CornerBlock> = bvh.triangles().iter().flat_map(|t| source.corners(t)).collect();
        let extras: Vec<VertexExtraBlock> = match source.has(ray_feature::EXTRAS) {
            true => bvh.triangles().iter().flat_map(|t| source.corner_extras(t)).collect(),
            false => vec![VertexExtraBlock::default()],
        };
        let (triangles, corners): (&[u8], &[u8]) = (bytemuck::cast_slice(&triangles), bytemuck::cast_slice(&corners));
        let extras: &[u8] = bytemuck::cast_slice(&extras);
        let emitters = emitters::table(bvh.triangles(), |t| source.emission[source.mesh(t).material]);
        let buffer = |name, bytes: &[u8]| Buffer::new(gpu, name, BufferKind::Storage, bytes.len() as u64);
        let scene = Self {
            nodes: buffer("ray nodes", bvh.node_bytes())?,
            triangles: buffer("ray triangles", triangles)?,
            corners: buffer("ray corners", corners)?,
            corner_extras: buffer("ray corner extras", extras)?,
            emitters: buffer("ray emitters", &emitters)?,
            textures,
            bvh,
            sides,
        };
        let mut upload = Upload::new(gpu);
        upload.buffer(&scene.nodes, scene.bvh.node_bytes())?;
        upload.buffer(&scene.corner_extras, extras)?;
        upload.buffer(&scene.emitters, &emitters)?;
        if !triangles.is_empty() {
            upload.buffer(&scene.triangles, triangles)?;
            upload.buffer(&scene.corners, corners)?;
        }
        upload.finish()?;
        Ok(scene)
    }
}

impl RaySet {
    /// Binds what rays meet, nothing for `None`, and the importance table of a panorama where one is sampled (`importance`).
    pub fn new(
        gpu: &Arc<Gpu>,
        layouts: &Layouts,
        ray_scene: Option<&LazyRayScene>,
        importance: Option<&Arc<Buffer>>,
    ) -> Result<Self> {
        let empty = LazyRayScene::empty();
        let scene = ray_scene.unwrap_or(&empty).get(gpu, layouts)?;
        let sampler = Sampler::new(gpu, "rays", AddressMode::Repeat, 1)?;
        let importance = match importance {
            Some(table) => Arc::clone(table),
            // No cells.
            None => Buffer::with_bytes(gpu, "no importance", BufferKind::FromCpu, &[0; size_of::<[u32; 16]>()])?,
        };
        let bindings = [
            Binding::Storage(&scene.nodes),
            Binding::Storage(&scene.triangles),
            Binding::Storage(&scene.corners),
            Binding::Sampled(&scene.textures.base_color, &sampler),
            Binding::Sampled(&scene.textures.normal, &sampler),
            Binding::Sampled(&scene.textures.orm, &sampler),
            Binding::Storage(&importance),
            Binding::Sampled(&scene.textures.emission, &sampler),
            Binding::Storage(&scene.corner_extras),
            Binding::Storage(&scene.emitters),
            Binding::Sampled(&scene.textures.extension, &sampler),
        ];
        Ok(Self { set: DescriptorSet::new(gpu, "rays", &layouts.rays, &bindings)? })
    }
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::{BindingType, DescriptorSetLayout, Pipeline, read_buffer, submit_and_wait, with_gpu};
    use crate::scene::bvh::tests::{Random, closed_ball, soup};

    /// What tests/glsl/test_bvh.comp reads.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    struct Ray {
        o: [f32; 3],
        d: [f32; 3],
        far: f32,
    }

    /// And writes: the nearest hit, and whether there is any.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    struct Met {
        t: f32,
        triangle: u32,
        weights: [f32; 3],
        any: u32,
    }

    fn traced(gpu: &Arc<Gpu>, bvh: &Bvh, rays: &[Ray]) -> Vec<Met> {
        let triangle = |t: &BvhTriangle| TriangleBlock { corners: t.corners, material_and_flags: 0 };
        let triangles: Vec<TriangleBlock> = bvh.triangles().iter().map(triangle).collect();
        let storage = |bytes: &[u8]| Buffer::with_bytes(gpu, "rays", BufferKind::FromCpu, bytes).unwrap();
        let [from, nodes, triangles] =
            [bytemuck::cast_slice(rays), bvh.node_bytes(), bytemuck::cast_slice(&triangles)].map(storage);
        let to = Buffer::new(gpu, "met", BufferKind::Storage, (size_of::<Met>() * rays.len()) as u64).unwrap();
        let layout = DescriptorSetLayout::new(gpu, "rays", &[BindingType::Storage; 2]).unwrap();
        let set = |a, b| DescriptorSet::new(gpu, "rays", &layout, &[Binding::Storage(a), Binding::Storage(b)]).unwrap();
        let (used, scene) = (set(&from, &to), set(&nodes, &triangles));
        let pipeline = Pipeline::compute(gpu, "test_bvh.comp", &[], &[&layout; 4], 0).unwrap();
        submit_and_wait(gpu, |commands| {
            commands.bind(&pipeline, &[&used, &used, &used, &scene]);
            commands.dispatch([rays.len().div_ceil(64) as u32, 1, 1]);
            Ok(())
        })
        .unwrap();
        bytemuck::pod_collect_to_vec(&read_buffer(gpu, &to).unwrap())
    }

    #[test]
    fn the_gpu_finds_the_hits_that_the_cpu_finds() {
        let (meshes, instances) = soup(3000);
        let bvh = Bvh::new(&meshes, &instances).unwrap();
        let mut random = Random(5);
        let mut ray = |i: usize| Ray {
            o: (1.5 * random.point()).into(),
            // Along an axis now and then.
            d: if i.is_multiple_of(10) { Vec3::AXES[i / 10 % 3] } else { random.direction() }.into(),
            far: if i.is_multiple_of(3) { random.unit() } else { 1e30 },
        };
        let rays: Vec<Ray> = (0..8000).map(&mut ray).collect();
        let got = with_gpu(|gpu| traced(gpu, &bvh, &rays));
        let (mut hits, mut others) = (0, 0);
        for (ray, got) in rays.iter().zip(&got) {
            let want = bvh.trace(ray.o.into(), ray.d.into(), ray.far, |_| true);
            assert_eq!(got.any == 1, got.t >= 0.0, "{ray:?}: {got:?}");
            match want {
                Some(want) if got.t >= 0.0 && got.triangle as usize == want.triangle => {
                    let off = (got.t - want.t).abs().max((Vec3::from(got.weights) - want.weights).abs().max_element());
                    assert!(off < 1e-3, "{ray:?}: {got:?} is not {want:?}");
                    hits += 1;
                }
                None if got.t < 0.0 => {}
                // Through an edge, or where two triangles meet.
                _ => others += 1,
            }
        }
        assert!(hits > 2000 && others < 8, "{hits} hits, {others} differ");
    }

    #[test]
    fn no_ray_of_the_gpu_leaves_a_closed_surface() {
        let place = Mat4::from_translation(Vec3::new(3.1, -2.7, 0.3));
        let ball = closed_ball();
        let bvh = Bvh::new(std::slice::from_ref(&ball), &[Instance { mesh: 0, world_from_local: place }]).unwrap();
        let mut random = Random(11);
        let o = place.transform_point3(Vec3::new(0.1, 0.2, -0.3));
        let corners = ball.vertices.iter().map(|v| place.transform_point3(v.position.into()) - o);
        let random = (0..50_000).map(|_| random.direction());
        let rays: Vec<Ray> = corners.chain(random).map(|d| Ray { o: o.into(), d: d.into(), far: 1e30 }).collect();
        let got = with_gpu(|gpu| traced(gpu, &bvh, &rays));
        assert!(got.iter().all(|met| met.t > 0.0 && met.any == 1));
    }
}
