//! Descriptor set layouts, and sets that hold the resources they bind.

use std::sync::Arc;

use ash::vk;

use super::binding_type::BindingType;
use super::buffer::Buffer;
use super::deferred::Deferred;
use super::device::Gpu;
use super::image::{Image, ImageAccess};
use super::sampler::Sampler;
use crate::{Error, Result};

fn raw_type(kind: BindingType) -> vk::DescriptorType {
    match kind {
        BindingType::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        BindingType::UniformDynamic => vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC,
        BindingType::Storage => vk::DescriptorType::STORAGE_BUFFER,
        BindingType::StorageDynamic => vk::DescriptorType::STORAGE_BUFFER_DYNAMIC,
        BindingType::Sampled => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        BindingType::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
    }
}

/// The bindings 0, 1, 2 … of one set, seen by every stage.
pub struct DescriptorSetLayout {
    gpu: Arc<Gpu>,
    pub(super) raw: vk::DescriptorSetLayout,
    kinds: Vec<BindingType>,
}

impl DescriptorSetLayout {
    /// Creates a layout whose binding i is `kinds[i]`.
    pub fn new(gpu: &Arc<Gpu>, name: &str, kinds: &[BindingType]) -> Result<Self> {
        let bindings: Vec<_> = (0u32..)
            .zip(kinds)
            .map(|(i, kind)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(i)
                    .descriptor_type(raw_type(*kind))
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::ALL)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive, `info` is complete.
        let raw = unsafe { gpu.device.create_descriptor_set_layout(&info, None) }
            .map_err(Error::vulkan("creating a descriptor set layout"))?;
        gpu.name(raw, name);
        Ok(Self { gpu: Arc::clone(gpu), raw, kinds: kinds.to_vec() })
    }

    /// What it binds.
    pub(super) fn kinds(&self) -> &[BindingType] {
        &self.kinds
    }
}

impl Drop for DescriptorSetLayout {
    fn drop(&mut self) {
        self.gpu.defer_destruction(Deferred::DescriptorSetLayout(self.raw));
    }
}

/// The resource put into one binding.
#[derive(Clone, Copy)]
pub enum Binding<'a> {
    /// A buffer, and the bytes that shaders see from its start.
    Uniform(&'a Arc<Buffer>, u64),
    /// A buffer, and the bytes that shaders see from the dynamic offset on.
    UniformDynamic(&'a Arc<Buffer>, u64),
    Storage(&'a Arc<Buffer>),
    /// A buffer, and the bytes that shaders see from the dynamic offset on.
    StorageDynamic(&'a Arc<Buffer>, u64),
    /// When used, a colour image must be prepared for [`ImageAccess::Sampled`], a depth image for
    /// [`ImageAccess::DepthSampled`].
    Sampled(&'a Arc<Image>, &'a Arc<Sampler>),
    /// An image and one of its mips.
    StorageImage(&'a Arc<Image>, usize),
}

impl Binding<'_> {
    fn kind(self) -> BindingType {
        match self {
            Self::Uniform(..) => BindingType::Uniform,
            Self::UniformDynamic(..) => BindingType::UniformDynamic,
            Self::Storage(_) => BindingType::Storage,
            Self::StorageDynamic(..) => BindingType::StorageDynamic,
            Self::Sampled(..) => BindingType::Sampled,
            Self::StorageImage(..) => BindingType::StorageImage,
        }
    }

    fn resource(self) -> Resource {
        match self {
            Self::Uniform(buffer, _)
            | Self::UniformDynamic(buffer, _)
            | Self::Storage(buffer)
            | Self::StorageDynamic(buffer, _) => Resource::Buffer(Arc::clone(buffer)),
            Self::Sampled(image, sampler) => Resource::Sampled(Arc::clone(image), Arc::clone(sampler)),
            Self::StorageImage(image, _) => Resource::Image(Arc::clone(image)),
        }
    }

    /// The buffer that shaders see the whole of as a storage buffer.
    fn stored(&self) -> Option<&Arc<Buffer>> {
        if let Self::Storage(buffer) = self { Some(buffer) } else { None }
    }

    /// For a dynamic binding, the last offset at which its range is inside the buffer.
    fn last_offset(self) -> Option<u64> {
        match self {
            Self::UniformDynamic(buffer, range) | Self::StorageDynamic(buffer, range) => {
                assert!(range <= buffer.size(), "{range} bytes of a buffer of {}", buffer.size());
                Some(buffer.size() - range)
            }
            _ => None,
        }
    }
}

/// Keeps a bound resource alive.
#[expect(dead_code, reason = "held, never read")]
enum Resource {
    Buffer(Arc<Buffer>),
    Image(Arc<Image>),
    Sampled(Arc<Image>, Arc<Sampler>),
}

/// One descriptor set with a pool of its own; written once. It keeps the resources it binds alive.
pub struct DescriptorSet {
    gpu: Arc<Gpu>,
    pool: vk::DescriptorPool,
    pub(super) raw: vk::DescriptorSet,
    /// For each dynamic binding, the largest offset it may be bound with.
    last_offsets: Vec<u64>,
    _resources: Vec<Resource>,
}

impl DescriptorSet {
    /// Creates and fills a set.
    ///
    /// # Errors
    /// A storage buffer that is larger than shaders may see; no memory.
    ///
    /// # Panics
    /// If `bindings` do not match the layout, or a dynamic range is larger than its buffer: a defect of the caller.
    pub fn new(gpu: &Arc<Gpu>, name: &str, layout: &DescriptorSetLayout, bindings: &[Binding<'_>]) -> Result<Self> {
        let kinds: Vec<BindingType> = bindings.iter().map(|b| b.kind()).collect();
        assert_eq!(kinds, layout.kinds, "set {name} does not match its layout");
        for buffer in bindings.iter().filter_map(|b| b.stored()) {
            gpu.limits.check_storage(name, buffer.size())?;
        }
        let sizes: Vec<_> =
            kinds.iter().map(|k| vk::DescriptorPoolSize::default().ty(raw_type(*k)).descriptor_count(1)).collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive, `info` is complete.
        let pool = unsafe { gpu.device.create_descriptor_pool(&info, None) }
            .map_err(Error::vulkan("creating a descriptor pool"))?;
        let mut set = Self {
            gpu: Arc::clone(gpu),
            pool,
            raw: vk::DescriptorSet::null(),
            last_offsets: bindings.iter().filter_map(|b| b.last_offset()).collect(),
            _resources: bindings.iter().map(|b| b.resource()).collect(),
        };
        let layouts = [layout.raw];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool was just created with room for one such set.
        let sets = unsafe { gpu.device.allocate_descriptor_sets(&info) }
            .map_err(Error::vulkan("allocating a descriptor set"))?;
        set.raw = sets.first().copied().unwrap_or_default();
        gpu.name(set.raw, name);
        for (i, binding) in (0u32..).zip(bindings) {
            set.write(i, *binding);
        }
        Ok(set)
    }

    /// # Panics
    /// If these are not one offset for each dynamic binding, or one lies too far back: a defect of the caller.
    pub(super) fn check_offsets(&self, offsets: &[u32]) {
        assert_eq!(offsets.len(), self.last_offsets.len(), "one dynamic offset for each dynamic binding");
        let fits = self.last_offsets.iter().zip(offsets).all(|(last, offset)| u64::from(*offset) <= *last);
        assert!(fits, "dynamic offsets {offsets:?} beyond {:?}", self.last_offsets);
    }

    fn write(&self, index: u32, binding: Binding<'_>) {
        let write = vk::WriteDescriptorSet::default()
            .dst_set(self.raw)
            .dst_binding(index)
            .descriptor_type(raw_type(binding.kind()));
        let (mut buffer, mut image) = ([vk::DescriptorBufferInfo::default()], [vk::DescriptorImageInfo::default()]);
        let write = match binding {
            Binding::Storage(b) => {
                buffer[0] = buffer[0].buffer(b.raw).range(vk::WHOLE_SIZE);
                write.buffer_info(&buffer)
            }
            Binding::Uniform(b, range) | Binding::UniformDynamic(b, range) | Binding::StorageDynamic(b, range) => {
                buffer[0] = buffer[0].buffer(b.raw).range(range);
                write.buffer_info(&buffer)
            }
            Binding::Sampled(i, sampler) => {
                let (layout, ..) = i.sampled_access().parts();
                image[0] = image[0].image_view(i.view).image_layout(layout).sampler(sampler.raw);
                write.image_info(&image)
            }
            Binding::StorageImage(i, mip) => {
                let (layout, ..) = ImageAccess::Storage.parts();
                image[0] = image[0].image_view(i.mip_views[mip]).image_layout(layout);
                write.image_info(&image)
            }
        };
        // SAFETY: the set is new, so no submission uses it; it holds the resources.
        unsafe { self.gpu.device.update_descriptor_sets(&[write], &[]) };
    }
}

impl Drop for DescriptorSet {
    fn drop(&mut self) {
        self.gpu.defer_destruction(Deferred::DescriptorPool(self.pool));
    }
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::{AddressMode, BufferKind, Format, ImageDesc, ImageUsageFlags, with_gpu};

    #[test]
    fn sets_keep_what_they_bind() {
        with_gpu(|gpu| {
            let buffer = Buffer::new(gpu, "bound", BufferKind::Storage, 4).unwrap();
            let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::STORAGE;
            let image = || Image::new(gpu, "bound", ImageDesc::flat(Format::R8G8B8A8_UNORM, [4, 4], usage)).unwrap();
            let (sampled, stored) = (image(), image());
            let sampler = Sampler::new(gpu, "bound", AddressMode::Clamp, 1).unwrap();
            let kinds = [BindingType::Storage, BindingType::Sampled, BindingType::StorageImage];
            let layout = DescriptorSetLayout::new(gpu, "layout", &kinds).unwrap();
            let bindings =
                [Binding::Storage(&buffer), Binding::Sampled(&sampled, &sampler), Binding::StorageImage(&stored, 0)];
            let set = DescriptorSet::new(gpu, "set", &layout, &bindings).unwrap();
            let images = [sampled, stored].map(|image| Arc::downgrade(&image));
            let (kept_buffer, kept_sampler) = (Arc::downgrade(&buffer), Arc::downgrade(&sampler));
            drop((buffer, sampler));
            let alive = || {
                let [sampled, stored] = images.each_ref().map(|image| image.strong_count());
                [kept_buffer.strong_count(), kept_sampler.strong_count(), sampled, stored]
            };
            assert_eq!(alive(), [1; 4]);
            drop(set);
            assert_eq!(alive(), [0; 4]);
        });
    }
}
