//! The picture of a headset's mirror window: parts of it show an eye's picture, also as a turned camera sees it.

use std::sync::Arc;

use glam::Mat3;

use super::layouts;
use super::output::Output;
use crate::Result;
use crate::gpu::{
    AddressMode, Attachments, Binding, ColourAttachment, DescriptorSet, DescriptorSetLayout, FrameContext, Gpu,
    GraphicsDesc, Image, ImageAccess, ImageDesc, ImageUsageFlags, Pipeline, Sampler,
};

/// What a part of the mirror shows; it covers all of the mirror that the homography takes into the eye's picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorPart {
    /// The eye.
    pub layer: u32,
    /// From the mirror's clip space to texture coordinates; see `reference::reprojection`.
    pub uv_from_clip: Mat3,
    /// The greatest texture coordinates of the eye's picture.
    pub limit: [f32; 2],
}

impl MirrorPart {
    /// The push constants of `glsl/mirror.frag`.
    fn push(&self) -> [[f32; 4]; 3] {
        let rows = self.uv_from_clip.transpose();
        let [u, v] = self.limit;
        // A handful of layers.
        [rows.x_axis.extend(self.layer as f32), rows.y_axis.extend(u), rows.z_axis.extend(v)].map(|row| row.to_array())
    }
}

/// The mirror's own image, pipeline and samplers.
pub struct MirrorPicture {
    gpu: Arc<Gpu>,
    pipeline: Pipeline,
    layout: DescriptorSetLayout,
    sampler: Arc<Sampler>,
    image: Option<Arc<Image>>,
    /// The eyes' picture that was bound last.
    source: Option<(Arc<Image>, DescriptorSet)>,
}

impl MirrorPicture {
    /// Makes the pipeline.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let layout = layouts::mirror(gpu)?;
        let desc = GraphicsDesc {
            name: "mirror",
            vertex: "mirror.vert",
            fragment: Some("mirror.frag"),
            sets: &[&layout],
            push_bytes: size_of::<[[f32; 4]; 3]>() as u32,
            colours: &[Output::Display.format()],
            ..GraphicsDesc::default()
        };
        Ok(Self {
            gpu: Arc::clone(gpu),
            pipeline: Pipeline::graphics(gpu, &desc)?,
            sampler: Sampler::new(gpu, "mirror", AddressMode::Clamp, 1)?,
            layout,
            image: None,
            source: None,
        })
    }

    /// Draws parts of the eyes' `picture`, a layered display picture, into an image of `size` pixels, black elsewhere, and
    /// returns that, prepared for `CopyFrom`.
    ///
    /// # Errors
    /// No memory for an image of this size.
    pub fn record(
        &mut self,
        frame: &mut FrameContext<'_>,
        picture: &Arc<Image>,
        parts: &[MirrorPart],
        size: [u32; 2],
    ) -> Result<Arc<Image>> {
        let image = self.image(size)?;
        self.bind(picture)?;
        let Some((_, set)) = &self.source else { return Ok(image) };
        frame.commands.pass("mirror", |commands| {
            commands.prepare(picture, ImageAccess::Sampled);
            commands.prepare_fresh(&image, ImageAccess::Colour);
            let colours = &[ColourAttachment::cleared(image.attachment(), [0.0, 0.0, 0.0, 1.0])];
            commands.render(&Attachments { colours, depth: None, area: size }, |commands| {
                commands.bind(&self.pipeline, &[set]);
                for part in parts {
                    commands.push(&self.pipeline, bytemuck::bytes_of(&part.push()));
                    commands.draw(3, 1);
                }
            });
            commands.prepare(&image, ImageAccess::CopyFrom);
        });
        Ok(image)
    }

    fn image(&mut self, size: [u32; 2]) -> Result<Arc<Image>> {
        if let Some(image) = self.image.as_ref().filter(|image| image.desc().size == size) {
            return Ok(Arc::clone(image));
        }
        let usage = ImageUsageFlags::COLOR_ATTACHMENT | ImageUsageFlags::TRANSFER_SRC;
        let image = Image::new(&self.gpu, "mirror", ImageDesc::flat(Output::Display.format(), size, usage))?;
        self.image = Some(Arc::clone(&image));
        Ok(image)
    }

    fn bind(&mut self, picture: &Arc<Image>) -> Result<()> {
        if self.source.as_ref().is_none_or(|(bound, _)| !Arc::ptr_eq(bound, picture)) {
            let set =
                DescriptorSet::new(&self.gpu, "mirror", &self.layout, &[Binding::Sampled(picture, &self.sampler)])?;
            self.source = Some((Arc::clone(picture), set));
        }
        Ok(())
    }
}
