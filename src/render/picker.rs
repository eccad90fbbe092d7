//! Finds the material that is seen in a pixel, by drawing that pixel alone.

use std::sync::Arc;

use glam::Mat4;

use super::bound_scene::BoundScene;
use super::draws::{CullOptions, DrawList};
use super::eye::Eye;
use super::pipeline_request::PipelineRequest;
use super::surface_pass::{PICKED, SurfacePass};
use crate::Result;
use crate::gpu::{
    Attachments, ColourAttachment, DEPTH_FORMAT, DepthAttachment, Gpu, Image, ImageAccess, ImageDesc, ImageUsageFlags,
    Subresource, read_image, submit_and_wait,
};

/// The drawn pixel.
const ONE: [u32; 2] = [1, 1];

/// The pass and its one pixel.
pub struct Picker {
    gpu: Arc<Gpu>,
    pass: SurfacePass,
    picked: Arc<Image>,
    depth: Arc<Image>,
}

impl Picker {
    /// For a scene with these features.
    pub fn new(request: &PipelineRequest) -> Result<Self> {
        let gpu = &request.gpu;
        let usage = ImageUsageFlags::COLOR_ATTACHMENT | ImageUsageFlags::TRANSFER_SRC;
        let depth = ImageDesc::flat(DEPTH_FORMAT, ONE, ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT);
        Ok(Self {
            gpu: Arc::clone(gpu),
            pass: SurfacePass::picking(request)?,
            picked: Image::new(gpu, "picked material", ImageDesc::flat(PICKED, ONE, usage))?,
            depth: Image::new(gpu, "picked depth", depth)?,
        })
    }

    /// The index of the material nearest to an eye that sees one pixel alone, [`Eye::of_pixel`]; `None` for the sky.
    pub fn material(&self, scene: &BoundScene, eye: &Eye, world_from_models: Mat4) -> Result<Option<usize>> {
        let in_models = Eye { world_from_view: world_from_models.inverse() * eye.world_from_view, ..*eye };
        let mut draws = DrawList::default();
        draws.fill(&scene.resources.draws, &[in_models], CullOptions::default());
        submit_and_wait(&self.gpu, |commands| {
            commands.prepare_fresh(&self.picked, ImageAccess::Colour);
            commands.prepare_fresh(&self.depth, ImageAccess::Depth);
            let attachments = Attachments {
                colours: &[ColourAttachment::cleared(self.picked.attachment(), [0.0; 4])],
                depth: Some(DepthAttachment::transient(self.depth.attachment())),
                area: ONE,
            };
            commands.render(&attachments, |commands| {
                let clip_from_models = in_models.clip_from_world();
                self.pass.draw(commands, &scene.resources, &scene.set, draws.calls(), clip_from_models);
            });
            Ok(())
        })?;
        let bytes = read_image(&self.gpu, &self.picked, Subresource { mip: 0, layer: 0 }, size_of::<u32>() as u64)?;
        let number = bytes.try_into().map_or(0, u32::from_ne_bytes);
        Ok((number as usize).checked_sub(1))
    }
}
