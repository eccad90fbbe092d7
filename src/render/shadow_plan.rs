//! Which lamps have a shadow map, and how large: decided by the scene, and by the memory there is.

use glam::Vec3;

use super::light_detail::LightDetail;
use crate::context::Context;
use crate::reference::shadow::FACE_TANGENT;
use crate::scene::sphere_lights::SphereLight;
use crate::scene::{Bounds, Material, PointLight, Scene};

/// Layers of a lamp's map.
pub const FACES: u32 = 6;
/// Bytes of a depth texel.
const TEXEL_BYTES: u64 = 4;
/// Texels along a face, the largest first; at most half the sun's map. Smaller ones are made where they are asked for.
const FACE_SIZES: [u32; 5] = [4096, 2048, 1024, 512, 256];
/// Texels along the sun's map, which is cached while nothing turns: 64 MiB, and 16 in software, where a drawing takes as
/// long as a few frames.
const SUN_SIDE: u32 = 4096;
const SUN_SIDE_IN_SOFTWARE: u32 = 2048;
/// Part of the GPU's memory that shadow maps may take, and the most bytes: six lamps at the largest size.
const MEMORY_PART: u64 = 16;
const MOST_BYTES: u64 = 640 << 20;
const MOST_BYTES_IN_SOFTWARE: u64 = 64 << 20;
/// Lamps with a map at most: the layers that every GPU allows an image (256) have room for as many.
const MOST_LAMPS: usize = 42;
/// The near plane as a part of the scene's radius: what is nearer to a lamp casts no shadow. Reversed depth in f32 keeps its
/// digits however near it is.
const NEAR_PART: f32 = 1e-4;

/// How shaders look up shadows of the scene's lights; the order of `glsl/shared.glsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LampShadows {
    /// No lamp has a map.
    #[default]
    None,
    /// Every lamp is a point.
    Sharp,
    /// Some lamp has a size.
    Soft,
}

/// A lamp's map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampMap {
    /// Of the scene's lights, and then of its sphere lights.
    pub lamp: usize,
    /// World space; as the scene's file places it where it moves with the models.
    pub position: Vec3,
    /// Whether it does: sphere lights are parts of them.
    pub moves: bool,
    /// Metres along a face's axis to the near plane.
    pub near_metres: f32,
}

/// The shadow maps of a scene's lamps and sphere lights. Lamp `maps[i].lamp` has the layers from 6 i on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadowPlan {
    pub kind: LampShadows,
    pub maps: Vec<LampMap>,
    /// Texels along a face; 1 without maps.
    pub face: u32,
    /// Whether anything casts a shadow on anything.
    pub casts: bool,
    /// Texels along the sun's map, if there is a sun.
    pub sun_side: u32,
}

impl ShadowPlan {
    /// Maps for the scene's lamps, none if nothing `casts` or none are wanted; says which lamps go without.
    pub fn new(
        context: &Context,
        (scene, spheres): (&Scene, &[SphereLight]),
        casts: bool,
        detail: &LightDetail,
    ) -> Self {
        let casts = casts && detail.has_shadow_maps();
        let info = context.gpu.info();
        let (sun_side, budget) = match detail.shadow_size {
            None if info.is_software() => (sun_side(SUN_SIDE_IN_SOFTWARE, info.memory), MOST_BYTES_IN_SOFTWARE),
            None => (sun_side(SUN_SIDE, info.memory), MOST_BYTES),
            Some(side) => (side, MOST_BYTES),
        };
        // What sheets let through takes as much as depth.
        let budget = if scene.materials.iter().any(Material::tints) { budget / 2 } else { budget };
        let most = context.gpu.max_image_size();
        if sun_side > most && casts {
            let told = format!("{} allows {most} texels a side: the sun's shadow map has no more", info.name);
            context.report.warn(told);
        }
        let sun_side = sun_side.min(most);
        let largest = sun_side / 2;
        let plan = if casts {
            Self::within((&scene.lights, spheres), scene.bounds(), largest, budget.min(info.memory / MEMORY_PART))
        } else {
            Self { face: 1, ..Self::default() }
        };
        let plan = Self { casts, sun_side, ..plan };
        let lamps = scene.lights.len() + spheres.len();
        let without = if casts { lamps - plan.maps.len() } else { 0 };
        if without > 0 {
            context.report.warn(format!("{without} of {lamps} lamps cast no shadow: the weakest and farthest"));
        }
        plan
    }

    /// The largest faces, at most `largest`, with which all lamps fit into `budget` bytes; with the smallest, the lamps that
    /// light the scene most.
    fn within((lamps, spheres): (&[PointLight], &[SphereLight]), bounds: Bounds, largest: u32, budget: u64) -> Self {
        let sphere = |s: &SphereLight| PointLight {
            position: s.position,
            intensity: s.intensity(),
            radius: s.radius,
            cone: None,
        };
        let lights: Vec<PointLight> = lamps.iter().copied().chain(spheres.iter().map(sphere)).collect();
        let fixed = lamps.len();
        let lamps = lights.len().min(MOST_LAMPS);
        let bytes = |face: u32| u64::from(FACES) * u64::from(face).pow(2) * TEXEL_BYTES;
        let fits = |face: &u32| *face <= largest && bytes(*face) * lamps as u64 <= budget;
        let face = FACE_SIZES.into_iter().find(fits).unwrap_or(FACE_SIZES[FACE_SIZES.len() - 1].min(largest));
        let count = lamps.min((budget / bytes(face)) as usize);
        let mut order: Vec<usize> = (0..lights.len()).collect();
        order.sort_by(|a, b| irradiance(&lights[*b], bounds).total_cmp(&irradiance(&lights[*a], bounds)));
        order.truncate(count);
        order.sort_unstable();
        let near = (NEAR_PART * bounds.radius()).max(f32::MIN_POSITIVE);
        let map = |lamp: usize| {
            let PointLight { position, radius, .. } = lights[lamp];
            // Nothing of a bulb around the lamp casts a shadow: its corners on a face are farthest from the axis. Of a surface that
            // shines nothing does, either.
            let around = spheres.get(lamp.wrapping_sub(fixed)).map(|sphere| 1.01 * sphere.reach);
            LampMap {
                lamp,
                position,
                moves: lamp >= fixed,
                near_metres: near.max(around.unwrap_or(radius / 3f32.sqrt())),
            }
        };
        let soft = order.iter().any(|lamp| *lamp < fixed && lights[*lamp].radius > 0.0);
        let kind = match (order.iter().filter(|lamp| **lamp < fixed).count(), soft) {
            (0, _) => LampShadows::None,
            (_, false) => LampShadows::Sharp,
            (_, true) => LampShadows::Soft,
        };
        Self {
            kind,
            face: if count > 0 { face } else { 1 },
            maps: order.into_iter().map(map).collect(),
            ..Self::default()
        }
    }

    /// Layers of the image, at least one lamp's.
    pub fn layers(&self) -> u32 {
        FACES * self.maps.len().max(1) as u32
    }

    /// The first layer and the near plane of a lamp's map; −1 without one.
    pub fn of_lamp(&self, lamp: usize) -> (i32, f32) {
        let map = (0i32..).zip(&self.maps).find(|(_, map)| map.lamp == lamp);
        map.map_or((-1, 1.0), |(i, map)| (FACES as i32 * i, map.near_metres))
    }
}

/// Texels along the sun's map, at most so many, on a GPU of so much memory.
fn sun_side(most: u32, memory: u64) -> u32 {
    let fits = |side: &u32| *side <= most && u64::from(*side).pow(2) * TEXEL_BYTES <= memory / MEMORY_PART;
    FACE_SIZES.into_iter().find(fits).unwrap_or(FACE_SIZES[FACE_SIZES.len() - 1])
}

/// Tangent of half the angle of a face.
pub fn face_tangent() -> f32 {
    FACE_TANGENT as f32
}

/// About what a lamp gives the scene's middle, W/m².
fn irradiance(lamp: &PointLight, bounds: Bounds) -> f32 {
    let distance = lamp.position.distance(bounds.centre()).max(bounds.radius());
    lamp.intensity.element_sum() / (distance * distance).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE };

    fn lamps(count: usize) -> Vec<PointLight> {
        let lamp = |i: usize| PointLight {
            position: Vec3::Y * (1.0 + i as f32),
            intensity: Vec3::splat(if i.is_multiple_of(2) { 1.0 } else { 0.01 }),
            radius: 0.0,
            cone: None,
        };
        (0..count).map(lamp).collect()
    }

    #[test]
    fn the_suns_map_takes_a_part_of_the_memory_at_most() {
        assert_eq!(sun_side(SUN_SIDE, 8 << 30), SUN_SIDE);
        assert_eq!(
            [2 << 30, 128 << 20, 1 << 20].map(|memory| sun_side(SUN_SIDE_IN_SOFTWARE, memory)),
            [2048, 1024, 256]
        );
    }

    #[test]
    fn more_lamps_have_smaller_maps_and_the_weakest_none() {
        let bytes = |plan: &ShadowPlan| u64::from(plan.layers()) * u64::from(plan.face).pow(2) * TEXEL_BYTES;
        let plan = |count| ShadowPlan::within((&lamps(count), &[]), BOUNDS, 2048, 128 << 20);
        assert_eq!([1, 2, 5, 6, 21, 22].map(|count| plan(count).face), [2048, 1024, 1024, 512, 512, 256]);
        assert!([1, 2, 5, 6, 21, 22, 42].iter().all(|count| plan(*count).maps.len() == *count));
        assert!((1..100).all(|count| bytes(&plan(count)) <= 128 << 20 && plan(count).layers() <= 256));
        let few = ShadowPlan::within((&lamps(10), &[]), BOUNDS, 1024, 10 << 20);
        assert_eq!((few.face, few.maps.len()), (256, 6));
        assert!([0, 2, 4, 6, 8].iter().all(|lamp| few.of_lamp(*lamp).0 >= 0), "{few:?}");
        assert_eq!((few.of_lamp(1), few.of_lamp(2).0, few.of_lamp(3)), ((6, few.maps[1].near_metres), 12, (-1, 1.0)));
        let small = ShadowPlan::within((&lamps(3), &[]), BOUNDS, 128, 1 << 30);
        assert_eq!((small.face, small.maps.len()), (128, 3), "as asked for");
        let none = ShadowPlan::within((&lamps(3), &[]), BOUNDS, 1024, 0);
        assert_eq!((none.kind, none.face, none.maps.len(), none.layers()), (LampShadows::None, 1, 0, 6));
    }

    #[test]
    fn a_lamp_with_a_size_makes_shadows_soft_and_lets_its_bulb_through() {
        let mut lights = lamps(2);
        assert_eq!(ShadowPlan::within((&lights, &[]), BOUNDS, 1024, 1 << 30).kind, LampShadows::Sharp);
        lights[1].radius = 0.3;
        let plan = ShadowPlan::within((&lights, &[]), BOUNDS, 1024, 1 << 30);
        assert_eq!(plan.kind, LampShadows::Soft);
        assert!(plan.maps[0].near_metres < 2e-4 && (plan.maps[1].near_metres - 0.1732).abs() < 1e-4);
        assert_eq!(ShadowPlan::within((&[], &[]), BOUNDS, 1024, 1 << 30).kind, LampShadows::None);
    }

    #[test]
    fn sphere_lights_have_maps_after_the_lamps_that_move_with_the_models() {
        let bounds = Bounds { min: Vec3::splat(-0.1), max: Vec3::splat(0.1) };
        let sphere = SphereLight { position: Vec3::ZERO, radius: 0.1, radiance: Vec3::ONE, reach: 0.1, bounds };
        let [alone, beside] = [0, 2].map(|count| ShadowPlan::within((&lamps(count), &[sphere]), BOUNDS, 1024, 1 << 30));
        assert_eq!((alone.kind, alone.of_lamp(0).0), (LampShadows::None, 0), "no lamp's shader reads it");
        let moves: Vec<(usize, bool)> = beside.maps.iter().map(|map| (map.lamp, map.moves)).collect();
        assert_eq!((beside.kind, moves), (LampShadows::Sharp, vec![(0, false), (1, false), (2, true)]));
        assert!((beside.of_lamp(2).1 - 0.101).abs() < 1e-6, "the surface itself casts nothing");
    }
}
