//! Structures shared with shaders: twins of `glsl/shared.glsl`, in scalar block layout.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};

use crate::scene::Vertex;
use crate::scene::mesh::WHITE;
use crate::scene::needs::MAX_COUNTED_LIGHTS;
use crate::scene::probes::MOST_PROBES;
use crate::scene::sphere_lights::MAX_SPHERE_LIGHTS;

/// The most eyes one pass draws.
pub const MAX_EYES: usize = 4;
/// Bytes of `SCENE_COUNTED_LIGHTS` and of `SCENE_PROBES`.
pub const COUNTED_LIGHTS_BYTES: u64 = (size_of::<LightBlock>() * MAX_COUNTED_LIGHTS) as u64;
pub const PROBES_BYTES: u64 = (size_of::<ProbeBlock>() * MOST_PROBES) as u64;
// Every GPU allows uniform buffers of this size.
const _: () = assert!(COUNTED_LIGHTS_BYTES <= 16384 && PROBES_BYTES <= COUNTED_LIGHTS_BYTES);

/// One eye as shaders see it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct EyeBlock {
    pub clip_from_world: [[f32; 4]; 4],
    /// Rigid; the last column is the eye's position.
    pub world_from_view: [[f32; 4]; 4],
    /// Tangents left, right, down, up.
    pub tangents: [f32; 4],
}

/// A disc far away as shaders see it, in world space; all 0 where there is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct SunBlock {
    /// Unit vector to its centre.
    pub towards: [f32; 3],
    /// Of a surface that faces it, W/m² per channel.
    pub irradiance: [f32; 3],
    /// Of its angular radius.
    pub sine: f32,
}

/// The sun's shadow map as shaders see it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct SunShadowBlock {
    /// World space to u, v and reversed depth.
    pub place_from_world: [[f32; 4]; 4],
    /// Radius of the sun's disc in uv, seen through a hole, per depth between hole and point.
    pub spread: [f32; 2],
}

/// Uniforms of one frame: `FRAME_UNIFORMS`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct FrameBlock {
    pub eyes: [EyeBlock; MAX_EYES],
    /// cos and sin of the panorama's rotation about +Y.
    pub environment_rotation: [f32; 2],
    /// Multiplies radiance before the tone curve.
    pub exposure: f32,
    /// Multiplies values of the environment's maps.
    pub environment_scale: f32,
    pub light_count: u32,
    /// Frames accumulated before this one; 0 without accumulation.
    pub sample_index: u32,
    /// A rigid movement of all instances.
    pub world_from_models: [[f32; 4]; 4],
    pub sun: SunBlock,
    pub sun_shadow: SunShadowBlock,
    /// In the models' space.
    pub sphere_lights: [SphereLightBlock; MAX_SPHERE_LIGHTS],
}

/// A surface that shines, as a sphere.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct SphereLightBlock {
    /// Metres.
    pub position: [f32; 3],
    pub radius: f32,
    /// W/sr.
    pub intensity: [f32; 3],
    /// As of `LightBlock`.
    pub shadow_near: f32,
    pub shadow_layer: i32,
}

/// One placed mesh of one material: an element of `SCENE_INSTANCES`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct InstanceBlock {
    /// Rotation, uniform scale, translation.
    pub world_from_local: [[f32; 4]; 4],
    /// Index into `SCENE_MATERIALS`.
    pub material: u32,
}

/// One material: an element of `SCENE_MATERIALS`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct MaterialBlock {
    pub base_color: [f32; 3],
    pub metallic: f32,
    pub roughness: f32,
    pub alpha_cutoff: f32,
    /// The index of the set of textures that it is drawn with.
    pub textures: u32,
    /// Multiplies alpha where the material blends; 1 elsewhere.
    pub opacity: f32,
    /// Radiance, W/(m² sr).
    pub emission: [f32; 3],
    /// Of `material_flag`.
    pub flags: u32,
    /// Reflectance of the part that is no metal, at normal incidence and at grazing angles.
    pub dielectric_f0: [f32; 3],
    pub dielectric_f90: f32,
    /// A thin film: its share, index of refraction and thickness (nm), and F0 of what is below it where that is no metal. With a film
    /// `dielectric_f0` is what has the same mean over all directions.
    pub film_share: f32,
    pub film_ior: f32,
    pub film_thickness: f32,
    pub film_base_f0: [f32; 3],
    /// Its thickness where the map of it is 0.
    pub film_thinnest: f32,
    /// By which light is multiplied that goes through it.
    pub transmission: [f32; 3],
    /// The share that has a clear coat, and the coat's roughness.
    pub clearcoat: f32,
    pub clearcoat_roughness: f32,
    /// What the surface of a body that bends light multiplies it by, what the body absorbs (1/m), and its index of refraction; that is 1
    /// elsewhere.
    pub surface_transmission: [f32; 3],
    pub absorption: [f32; 3],
    pub ior: f32,
    /// By how much the index of blue is above it, and that of red below it.
    pub ior_spread: f32,
    /// What the map of a convex body is about, local space: its centre, and the radius that distances are in.
    pub body_centre: [f32; 3],
    pub body_radius: f32,
    /// The color of its sheen, and its roughness.
    pub sheen: [f32; 3],
    pub sheen_roughness: f32,
    /// In which direction highlights are stretched, along tangent and bitangent, as long as they are strongly.
    pub anisotropy: [f32; 2],
    /// The share of diffuse light that goes through to the other side, and its color.
    pub diffuse_transmission: f32,
    pub diffuse_transmission_color: [f32; 3],
    /// What the extension map is of: an `asset::material::Extension`; 0 without one.
    pub extension: u32,
}

/// Bits of [`MaterialBlock::flags`], as in `glsl/instance.glsl`.
pub mod material_flag {
    pub const VERTEX_COLOURS: u32 = 1;
    pub const BLENDS: u32 = 2;
    /// Of the first map; the others follow.
    pub const SECOND_UV: u32 = 4;
    /// Colours of vertices multiply emission.
    pub const UNLIT: u32 = 128;
    /// The first bit of the first map's u; two bits each.
    pub const WRAPS: u32 = 8;
    /// What is covered grows at slanted views.
    pub const TRANSMITS: u32 = 1 << 28;
    /// The normal map shows in the clear coat.
    pub const CLEARCOAT_BUMPS: u32 = 1 << 29;
}

/// What few vertices have: an element of `SCENE_VERTEX_EXTRAS` and of `RAY_CORNER_EXTRAS`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct VertexExtraBlock {
    pub uv1: [f32; 2],
    /// In 65535ths.
    pub colour: [u16; 4],
}

impl VertexExtraBlock {
    /// Whether a vertex differs from those without any extra.
    pub fn is_needed(vertex: &Vertex) -> bool {
        vertex.colour != WHITE || vertex.uv1 != [0.0; 2]
    }
}

impl From<&Vertex> for VertexExtraBlock {
    fn from(vertex: &Vertex) -> Self {
        Self { uv1: vertex.uv1, colour: vertex.colour }
    }
}

/// One point light: an element of `SCENE_LIGHTS` and `SCENE_COUNTED_LIGHTS`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct LightBlock {
    /// Metres, world space.
    pub position: [f32; 3],
    /// Metres; 0 for a point.
    pub radius: f32,
    /// W/sr per channel.
    pub intensity: [f32; 3],
    /// The near plane of its shadow map, metres.
    pub shadow_near: f32,
    /// The first of six layers in `SCENE_LAMP_SHADOWS`; below 0 without a shadow map.
    pub shadow_layer: i32,
    /// Unit vector along a spot light's axis, world space.
    pub along: [f32; 3],
    /// Factor and summand of the cosine to the axis, whose sum's square, between 0 and 1, is the part of the intensity: 0
    /// and 1 for light to all sides.
    pub cone: [f32; 2],
}

/// A place that light was captured at, the box that it is taken to lie on, and the one in which mirror images show it: an element
/// of `SCENE_PROBES`. In the models' space.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct ProbeBlock {
    pub position: [f32; 3],
    pub low: [f32; 3],
    pub high: [f32; 3],
    pub reach_low: [f32; 3],
    pub reach_high: [f32; 3],
    /// Metres outside of the second box over which its influence ends.
    pub border: f32,
}

// With these members, scalar layout equals repr(C); this checks it.
const _: () = {
    assert!(size_of::<EyeBlock>() == 144);
    assert!(offset_of!(FrameBlock, environment_rotation) == 144 * MAX_EYES);
    assert!(offset_of!(FrameBlock, exposure) == 144 * MAX_EYES + 8);
    assert!(offset_of!(FrameBlock, light_count) == 144 * MAX_EYES + 16);
    assert!(offset_of!(FrameBlock, sample_index) == 144 * MAX_EYES + 20);
    assert!(offset_of!(FrameBlock, world_from_models) == 144 * MAX_EYES + 24);
    assert!(offset_of!(FrameBlock, sun) == 144 * MAX_EYES + 88);
    assert!(offset_of!(SunBlock, irradiance) == 12 && offset_of!(SunBlock, sine) == 24);
    assert!(offset_of!(FrameBlock, sun_shadow) == 144 * MAX_EYES + 116);
    assert!(offset_of!(SunShadowBlock, spread) == 64);
    assert!(offset_of!(FrameBlock, sphere_lights) == 144 * MAX_EYES + 188);
    assert!(offset_of!(SphereLightBlock, radius) == 12 && offset_of!(SphereLightBlock, intensity) == 16);
    assert!(offset_of!(SphereLightBlock, shadow_near) == 28 && size_of::<SphereLightBlock>() == 36);
    assert!(size_of::<FrameBlock>() == 144 * MAX_EYES + 188 + size_of::<[SphereLightBlock; MAX_SPHERE_LIGHTS]>());
    assert!(offset_of!(InstanceBlock, material) == 64 && size_of::<InstanceBlock>() == 68);
    assert!(offset_of!(MaterialBlock, metallic) == 12 && offset_of!(MaterialBlock, emission) == 32);
    assert!(size_of::<MaterialBlock>() == 204 && size_of::<VertexExtraBlock>() == 16);
    assert!(offset_of!(LightBlock, radius) == 12 && offset_of!(LightBlock, intensity) == 16);
    assert!(offset_of!(LightBlock, shadow_near) == 28 && offset_of!(LightBlock, shadow_layer) == 32);
    assert!(offset_of!(LightBlock, along) == 36 && size_of::<LightBlock>() == 56);
    assert!(offset_of!(ProbeBlock, low) == 12 && offset_of!(ProbeBlock, border) == 60);
};

/// Specialization constants, by their id in `glsl/shared.glsl`.
pub mod constant {
    pub const EYES: u32 = 0;
    pub const SHADING: u32 = 1;
    pub const GEOMETRY: u32 = 2;
    pub const LINEAR_OUTPUT: u32 = 3;
    pub const HAS_BASE_COLOR_MAP: u32 = 4;
    pub const HAS_NORMAL_MAP: u32 = 5;
    pub const HAS_ORM_MAP: u32 = 6;
    pub const ALPHA_MASK: u32 = 7;
    pub const LIGHTS: u32 = 8;
    pub const METALNESS: u32 = 9;
    pub const MULTI_SCATTER: u32 = 10;
    pub const SPLIT_SUM: u32 = 11;
    pub const SUN: u32 = 12;
    pub const LAMP_SHADOWS: u32 = 13;
    pub const SUN_SHADOW: u32 = 14;
    pub const LIGHTMAP: u32 = 15;
    pub const TRANSPORT: u32 = 16;
    pub const SEVERAL_PROBES: u32 = 17;
    pub const PART: u32 = 18;
    pub const EMITS: u32 = 19;
    pub const VERTEX_COLOURS: u32 = 20;
    pub const SECOND_UV: u32 = 21;
    pub const BLENDS: u32 = 22;
    pub const SPHERE_LIGHTS: u32 = 23;
    pub const RAY_FEATURES: u32 = 24;
    pub const TINTS: u32 = 25;
    pub const CLEARCOAT: u32 = 26;
    pub const REFRACTS: u32 = 27;
    pub const SHEEN: u32 = 28;
    pub const SPECULAR: u32 = 29;
    pub const ANISOTROPY: u32 = 30;
    pub const FILM: u32 = 31;
    pub const EXTENSION_MAP_OF: u32 = 32;
    pub const DIFFUSE_TRANSMISSION: u32 = 33;
    pub const DISPERSES: u32 = 34;
}

/// What rays may meet or be sent to in a scene: bits of [`constant::RAY_FEATURES`], described in `glsl/ray_features.glsl`.
pub mod ray_feature {
    pub const HOLES: u32 = 1;
    pub const EMITTERS: u32 = 2;
    pub const RELAYS: u32 = 4;
    pub const GLOSSY: u32 = 8;
    pub const EXTRAS: u32 = 16;
    pub const SKY_RELAYS: u32 = 32;
    pub const TINTS: u32 = 64;
    pub const CLEARCOAT: u32 = 128;
    pub const REFRACTS: u32 = 256;
    pub const SHEEN: u32 = 512;
    pub const FILM: u32 = 32768;
    pub const ANISOTROPY: u32 = 65536;
    pub const DIFFUSE_TRANSMISSION: u32 = 131072;
    /// Shifted by the number of a map, as [`material_flag::SECOND_UV`].
    pub const MAPS: u32 = 1024;
}
