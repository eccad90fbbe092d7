//! The environment cube with mips that the alternative methods sample.

use std::sync::Arc;

use crate::Result;
use crate::gpu::{
    AddressMode, Binding, BindingType, DescriptorSet, DescriptorSetLayout, Format, Gpu, Image, ImageAccess, ImageDesc,
    ImageUsageFlags, PassTime, Pipeline, Sampler, Shape, submit_and_wait,
};

/// A panorama as a cube map with all mips, in half floats: radiance / `scale`.
pub struct Environment {
    pub(super) cube: Arc<Image>,
    pub scale: f32,
    pub times: Vec<PassTime>,
}

impl Environment {
    /// Computes the cube, `size` texels along a face (a power of two), from a panorama in f32.
    pub fn new(gpu: &Arc<Gpu>, panorama: &Arc<Image>, scale: f32, size: u32) -> Result<Self> {
        let cube = cube(gpu, "environment", size, size.ilog2() + 1)?;
        let sampler = Sampler::new(gpu, "panorama", AddressMode::Panorama, 1)?;
        let set = |layout: &DescriptorSetLayout, bindings: &[Binding<'_>]| {
            DescriptorSet::new(gpu, "environment", layout, bindings)
        };

        // Two samples for each panorama texel that a cube texel spans at the equator.
        let taps = (panorama.desc().size[0].div_ceil(4 * size) * 2).clamp(2, 16);
        let layout =
            DescriptorSetLayout::new(gpu, "panorama to cube", &[BindingType::Sampled, BindingType::StorageImage])?;
        let to_cube = Pipeline::compute(gpu, "alternative_cube.comp", &[(0, taps)], &[&layout], 4)?;
        let to_cube_set = set(&layout, &[Binding::Sampled(panorama, &sampler), Binding::StorageImage(&cube, 0)])?;

        let layout =
            DescriptorSetLayout::new(gpu, "cube mips", &[BindingType::StorageImage, BindingType::StorageImage])?;
        let halve = Pipeline::compute(gpu, "alternative_mip.comp", &[], &[&layout], 0)?;
        let mips = (0..size.ilog2() as usize)
            .map(|mip| set(&layout, &[Binding::StorageImage(&cube, mip), Binding::StorageImage(&cube, mip + 1)]))
            .collect::<Result<Vec<_>>>()?;

        let times = submit_and_wait(gpu, |commands| {
            commands.prepare(&cube, ImageAccess::Storage);
            commands.pass("panorama to cube", |commands| {
                commands.bind(&to_cube, &[&to_cube_set]);
                commands.push(&to_cube, bytemuck::bytes_of(&scale.recip()));
                commands.dispatch([size.div_ceil(8), size.div_ceil(8), 6]);
            });
            commands.pass("cube mips", |commands| {
                for (mip, set) in (1u32..).zip(&mips) {
                    commands.prepare(&cube, ImageAccess::Storage);
                    commands.bind(&halve, &[set]);
                    let groups = (size >> mip).div_ceil(8);
                    commands.dispatch([groups, groups, 6]);
                }
            });
            Ok(())
        })?;
        Ok(Self { cube, scale, times })
    }
}

/// A cube map in half floats that shaders write and sample.
pub(super) fn cube(gpu: &Arc<Gpu>, name: &str, size: u32, mips: u32) -> Result<Arc<Image>> {
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE | ImageUsageFlags::TRANSFER_SRC;
    let flat = ImageDesc::flat(Format::R16G16B16A16_SFLOAT, [size; 2], usage);
    Image::new(gpu, name, ImageDesc { shape: Shape::Cube, mips, ..flat })
}
