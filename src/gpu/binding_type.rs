//! The kinds of bindings; without imports, because build.rs includes this file.

/// The kind of one binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingType {
    Uniform,
    /// A uniform buffer whose offset is given when the set is bound.
    UniformDynamic,
    Storage,
    /// A storage buffer whose offset is given when the set is bound.
    StorageDynamic,
    /// An image with its sampler.
    Sampled,
    /// One mip of an image, all layers, `image2DArray`.
    StorageImage,
}
