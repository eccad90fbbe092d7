//! Descriptor set layouts and sets: what shaders can reach.

use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::{Deferred, Gpu};
use super::image::{Image, ImageAccess, Sampler};
use crate::{Error, Result};

/// The kind of one binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingType {
    Uniform,
    Storage,
    /// An image with its sampler.
    Sampled,
    /// One mip of an image, all layers, `image2DArray`.
    StorageImage,
}

impl BindingType {
    fn raw(self) -> vk::DescriptorType {
        match self {
            Self::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
            Self::Storage => vk::DescriptorType::STORAGE_BUFFER,
            Self::Sampled => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            Self::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
        }
    }
}

/// The bindings 0, 1, 2 … of one set, seen by every stage.
pub struct DescriptorSetLayout {
    gpu: Arc<Gpu>,
    pub(super) raw: vk::DescriptorSetLayout,
    slots: Vec<BindingType>,
}

impl DescriptorSetLayout {
    /// Makes a layout whose binding i is `slots[i]`.
    pub fn new(gpu: &Arc<Gpu>, name: &str, slots: &[BindingType]) -> Result<Self> {
        let bindings: Vec<_> = (0u32..)
            .zip(slots)
            .map(|(i, slot)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(i)
                    .descriptor_type(slot.raw())
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::ALL)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive, `info` is complete.
        let raw = unsafe { gpu.device.create_descriptor_set_layout(&info, None) }
            .map_err(Error::vulkan("making a set layout"))?;
        gpu.name(raw, name);
        Ok(Self { gpu: Arc::clone(gpu), raw, slots: slots.to_vec() })
    }
}

impl Drop for DescriptorSetLayout {
    fn drop(&mut self) {
        self.gpu.defer_destruction(Deferred::DescriptorSetLayout(self.raw));
    }
}

/// What is put into one binding.
#[derive(Clone, Copy)]
pub enum Binding<'a> {
    Uniform(&'a Buffer),
    Storage(&'a Buffer),
    Sampled(&'a Image, &'a Sampler),
    /// An image and which of its mips.
    StorageImage(&'a Image, usize),
}

impl Binding<'_> {
    fn slot(self) -> BindingType {
        match self {
            Self::Uniform(_) => BindingType::Uniform,
            Self::Storage(_) => BindingType::Storage,
            Self::Sampled(..) => BindingType::Sampled,
            Self::StorageImage(..) => BindingType::StorageImage,
        }
    }
}

/// One descriptor set with a pool of its own; written once. It does not keep what it refers to alive.
pub struct DescriptorSet {
    gpu: Arc<Gpu>,
    pool: vk::DescriptorPool,
    pub(super) raw: vk::DescriptorSet,
}

impl DescriptorSet {
    /// Makes and fills a set.
    ///
    /// # Panics
    /// If `binds` do not match the layout: a defect of the caller.
    pub fn new(gpu: &Arc<Gpu>, name: &str, layout: &DescriptorSetLayout, binds: &[Binding<'_>]) -> Result<Self> {
        let kinds: Vec<BindingType> = binds.iter().map(|b| b.slot()).collect();
        assert_eq!(kinds, layout.slots, "set {name} does not match its layout");
        let sizes: Vec<_> =
            kinds.iter().map(|k| vk::DescriptorPoolSize::default().ty(k.raw()).descriptor_count(1)).collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive, `info` is complete.
        let pool = unsafe { gpu.device.create_descriptor_pool(&info, None) }
            .map_err(Error::vulkan("making a descriptor pool"))?;
        let mut set = Self { gpu: Arc::clone(gpu), pool, raw: vk::DescriptorSet::null() };
        let layouts = [layout.raw];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool was just made with room for one such set.
        let sets =
            unsafe { gpu.device.allocate_descriptor_sets(&info) }.map_err(Error::vulkan("taking a descriptor set"))?;
        set.raw = sets.first().copied().unwrap_or_default();
        gpu.name(set.raw, name);
        for (i, bind) in (0u32..).zip(binds) {
            set.write(i, *bind);
        }
        Ok(set)
    }

    fn write(&self, binding: u32, bind: Binding<'_>) {
        let write =
            vk::WriteDescriptorSet::default().dst_set(self.raw).dst_binding(binding).descriptor_type(bind.slot().raw());
        let (mut buffer, mut image) = ([vk::DescriptorBufferInfo::default()], [vk::DescriptorImageInfo::default()]);
        let write = match bind {
            Binding::Uniform(b) | Binding::Storage(b) => {
                buffer[0] = buffer[0].buffer(b.raw).range(vk::WHOLE_SIZE);
                write.buffer_info(&buffer)
            }
            Binding::Sampled(i, sampler) => {
                let (layout, ..) = ImageAccess::Sampled.parts();
                image[0] = image[0].image_view(i.view).image_layout(layout).sampler(sampler.raw);
                write.image_info(&image)
            }
            Binding::StorageImage(i, mip) => {
                let (layout, ..) = ImageAccess::Storage.parts();
                image[0] = image[0].image_view(i.mip_views[mip]).image_layout(layout);
                write.image_info(&image)
            }
        };
        // SAFETY: the set is new, so no submission uses it; the resources are alive now.
        unsafe { self.gpu.device.update_descriptor_sets(&[write], &[]) };
    }
}

impl Drop for DescriptorSet {
    fn drop(&mut self) {
        self.gpu.defer_destruction(Deferred::DescriptorPool(self.pool));
    }
}
