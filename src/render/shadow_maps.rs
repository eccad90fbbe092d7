//! The shadow maps of a scene's lamps and of the sun: images, and when they are drawn again.
//!
//! Each lamp has six layers of an array, not a cube: a face reaches a little beyond the cube's (`FACE_TANGENT`), so that
//! filters stay inside it, no GPU needs cube arrays, and a software renderer is spared the filtering across edges.

use std::sync::Arc;

use glam::{Mat4, Vec3, Vec4};

use super::draws::{CullOptions, Draw, DrawList, Order};
use super::eye::Eye;
use super::scene_resources::SceneResources;
use super::shadow_plan::{FACES, LampMap, face_tangent};
use super::shared::SunShadowBlock;
use super::sun_view::SunView;
use super::surface_pass::{SurfacePass, TRANSMISSION};
use crate::Result;
use crate::gpu::{
    Attachments, ColourAttachment, Commands, DEPTH_FORMAT, DepthAttachment, DescriptorSet, Gpu, Image, ImageAccess,
    ImageDesc, ImageUsageFlags, Shape, Subresource,
};
use crate::reference::sun::Sun;

/// What maps are drawn for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub world_from_models: Mat4,
    /// Unit vector in world space, if there is a sun.
    pub towards_sun: Option<Vec3>,
}

/// Layers as lights see the scene.
pub struct ShadowImages {
    /// Of what blocks light.
    pub depth: Arc<Image>,
    /// By which sheets before that multiply light; a single texel that is never read where none colours any.
    pub transmission: Arc<Image>,
}

impl ShadowImages {
    fn new(gpu: &Arc<Gpu>, name: &str, (side, layers): (u32, u32), tints: bool) -> Result<Self> {
        let image = |what: &str, format, (side, layers), usage| {
            let flat = ImageDesc::flat(format, [side; 2], usage | ImageUsageFlags::SAMPLED);
            Image::new(gpu, &format!("{name} {what}"), ImageDesc { shape: Shape::Layers(layers), ..flat })
        };
        Ok(Self {
            depth: image("depth", DEPTH_FORMAT, (side, layers), ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT)?,
            transmission: image(
                "transmission",
                TRANSMISSION,
                if tints { (side, layers) } else { (1, 1) },
                ImageUsageFlags::COLOR_ATTACHMENT,
            )?,
        })
    }

    fn prepare_fresh(&self, commands: &mut Commands<'_>) {
        commands.prepare_fresh(&self.depth, ImageAccess::Depth);
        commands.prepare_fresh(&self.transmission, ImageAccess::Colour);
    }

    fn prepare_to_read(&self, commands: &mut Commands<'_>) {
        commands.prepare(&self.depth, ImageAccess::DepthSampled);
        commands.prepare(&self.transmission, ImageAccess::Sampled);
    }

    /// Draws into one layer, cleared to what is farthest.
    fn render(&self, commands: &mut Commands<'_>, layer: u32, tints: bool, record: impl FnOnce(&mut Commands<'_>)) {
        let at = Subresource { mip: 0, layer };
        let depth = Some(DepthAttachment::cleared(self.depth.attachment_of(at), 0.0));
        let colours: Vec<ColourAttachment<'_>> = tints
            .then(|| ColourAttachment::cleared(self.transmission.attachment_of(at), [1.0; 4]))
            .into_iter()
            .collect();
        commands.render(&Attachments { colours: &colours, depth, area: self.depth.desc().size }, record);
    }

    fn bytes(&self) -> u64 {
        let bytes = |image: &Image| {
            let [width, height] = image.desc().size.map(u64::from);
            width * height * u64::from(image.desc().shape.layers()) * size_of::<f32>() as u64
        };
        bytes(&self.depth) + bytes(&self.transmission)
    }
}

/// The maps, and what they show.
pub struct ShadowMaps {
    /// Six layers for each lamp of the plan.
    pub lamps: ShadowImages,
    /// One layer; a single texel without a sun.
    pub sun: ShadowImages,
    /// One per layer of the lamps, in the lamp's space, and whether that moves with the models.
    eyes: Vec<(Eye, bool)>,
    /// `world_from_models` of the last drawing.
    lamps_for: Option<Mat4>,
    has_sun: bool,
    sun_for: Option<Placement>,
    sun_view: Option<SunView>,
    draws: DrawList,
    /// How often maps have been drawn.
    pub drawings: u64,
}

impl ShadowMaps {
    /// Makes images for a scene's plan; nothing is drawn yet.
    ///
    /// # Errors
    /// No memory.
    pub fn new(gpu: &Arc<Gpu>, resources: &SceneResources, has_sun: bool) -> Result<Self> {
        let (plan, tints) = (&resources.shadow_plan, resources.tints());
        let has_sun = has_sun && plan.casts;
        let sun_side = if has_sun { plan.sun_side } else { 1 };
        Ok(Self {
            lamps: ShadowImages::new(gpu, "lamp shadow", (plan.face, plan.layers()), tints)?,
            sun: ShadowImages::new(gpu, "sun shadow", (sun_side, 1), tints)?,
            eyes: plan
                .maps
                .iter()
                .flat_map(|map| (0..FACES).map(move |face| (face_eye(map, face), map.moves)))
                .collect(),
            lamps_for: None,
            has_sun,
            sun_for: None,
            sun_view: None,
            draws: DrawList::default(),
            drawings: 0,
        })
    }

    /// GPU memory, bytes.
    pub fn bytes(&self) -> u64 {
        self.lamps.bytes() + self.sun.bytes()
    }

    /// The sun's map as shaders read it; all 0 without one.
    pub fn sun_block(&self, sun: Option<&Sun>) -> SunShadowBlock {
        let view = self.sun_view.as_ref().zip(sun);
        view.map_or_else(SunShadowBlock::default, |(view, sun)| view.block(sun.angular_radius.tan() as f32))
    }

    /// Records the drawing of maps that do not show the scene as it is; then prepares all for sampling. Without a pass
    /// nothing reads them.
    pub fn update(
        &mut self,
        commands: &mut Commands<'_>,
        pass: Option<&SurfacePass>,
        scene: (&SceneResources, &DescriptorSet),
        place: Placement,
    ) {
        if let Some(pass) = pass {
            if !self.eyes.is_empty() && self.lamps_for != Some(place.world_from_models) {
                commands
                    .pass("lamp shadows", |commands| self.draw_lamps(commands, pass, scene, place.world_from_models));
                self.lamps_for = Some(place.world_from_models);
                self.drawings += 1;
            }
            let towards = place.towards_sun.filter(|_| self.has_sun && self.sun_for != Some(place));
            if let Some(towards) = towards {
                commands.pass("sun shadow", |commands| {
                    self.draw_sun(commands, pass, scene, place.world_from_models, towards)
                });
                self.sun_for = Some(place);
                self.drawings += 1;
            }
        }
        self.lamps.prepare_to_read(commands);
        self.sun.prepare_to_read(commands);
    }

    fn draw_lamps(
        &mut self,
        commands: &mut Commands<'_>,
        pass: &SurfacePass,
        (resources, set): (&SceneResources, &DescriptorSet),
        world_from_models: Mat4,
    ) {
        let models_from_world = world_from_models.inverse();
        self.lamps.prepare_fresh(commands);
        for (layer, (eye, moves)) in (0..).zip(&self.eyes) {
            // As for the picture, models that are moved together are drawn by moving the eye the opposite way.
            let to_models = if *moves { Mat4::IDENTITY } else { models_from_world };
            let eye = Eye { world_from_view: to_models * eye.world_from_view, ..*eye };
            self.draws.fill(&resources.draws, &[eye], CullOptions::default());
            self.lamps.render(commands, layer, pass.tints(), |commands| {
                pass.draw(commands, resources, set, self.draws.calls(), eye.clip_from_world());
            });
        }
    }

    fn draw_sun(
        &mut self,
        commands: &mut Commands<'_>,
        pass: &SurfacePass,
        (resources, set): (&SceneResources, &DescriptorSet),
        world_from_models: Mat4,
        towards: Vec3,
    ) {
        let view = SunView::new(resources.draws.iter().map(Draw::bounds), world_from_models, towards);
        self.sun.prepare_fresh(commands);
        // All is in view, and what is nearest is as good as any order.
        let all = CullOptions { frusta: false, backs: false, order: Order::Listed };
        let anywhere = Eye::symmetric(Mat4::IDENTITY, 90.0, 1.0, 1.0);
        self.draws.fill(&resources.draws, &[anywhere], all);
        self.sun.render(commands, 0, pass.tints(), |commands| {
            let clip_from_models = view.clip_from_world() * world_from_models;
            pass.draw(commands, resources, set, self.draws.calls(), clip_from_models);
        });
        self.sun_view = Some(view);
    }
}

/// The view of one face of a lamp's map, as `reference::shadow::lamp_place` looks it up.
fn face_eye(map: &LampMap, face: u32) -> Eye {
    let axis = face as usize / 2;
    let unit = |i: usize| Vec3::AXES[i % 3];
    // −Z of the view is forward; up is the axis after the next, and right-handedness gives the rest.
    let backward = if face.is_multiple_of(2) { -unit(axis) } else { unit(axis) };
    let up = unit(axis + 2);
    let columns = [up.cross(backward), up, backward].map(|column| column.extend(0.0));
    let tangent = face_tangent();
    Eye {
        world_from_view: Mat4::from_cols(columns[0], columns[1], columns[2], Vec4::from((map.position, 1.0))),
        left: -tangent,
        right: tangent,
        down: -tangent,
        up: tangent,
        near_metres: map.near_metres,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::shadow::lamp_place;

    #[test]
    fn faces_are_drawn_where_they_are_looked_up() {
        let map = LampMap { lamp: 0, position: Vec3::new(1.0, -2.0, 0.5), moves: false, near_metres: 0.01 };
        for direction in
            [[3.0, 1.0, -2.0], [-3.0, 1.0, 2.0], [1.0, 3.0, 0.5], [0.2, -3.0, 1.0], [1.0, -2.0, 4.0], [1.0, 2.0, -4.0]]
        {
            let q = Vec3::from(direction);
            let place = lamp_place(q.as_dvec3(), -q.as_dvec3(), 0.01, 0.0, f64::INFINITY);
            let clip = face_eye(&map, place.layer).clip_from_world() * (map.position + q).extend(1.0);
            let uv = 0.5 * (clip.truncate().truncate() / clip.w) + 0.5;
            assert!(clip.w > 0.0 && (uv.as_dvec2() - place.uv).length() < 1e-6, "{q}: {uv} is not {}", place.uv);
            assert!((f64::from(clip.z / clip.w) - place.depth).abs() < 1e-8);
        }
    }
}
