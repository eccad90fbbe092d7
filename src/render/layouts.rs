//! The descriptor set layouts of `bindings`, created once per renderer.

use std::sync::Arc;

use super::bindings::{
    ACCUMULATE, FRAME, LIGHTMAP, MIRROR, PROBE, RAY_TEXTURES, RAYS, SCENE, SHOW, SKY, SetBindings, TEXTURES, UI,
};
use crate::Result;
use crate::gpu::{BindingType, DescriptorSetLayout, Gpu};

/// One layout per set of bindings.
pub struct Layouts {
    pub frame: DescriptorSetLayout,
    pub scene: DescriptorSetLayout,
    pub textures: DescriptorSetLayout,
    pub rays: DescriptorSetLayout,
    pub ray_textures: DescriptorSetLayout,
    pub lightmap: DescriptorSetLayout,
    pub probe: DescriptorSetLayout,
    pub sky: DescriptorSetLayout,
    pub accumulate: DescriptorSetLayout,
    pub show: DescriptorSetLayout,
}

impl Layouts {
    /// Creates all layouts.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            frame: frame(gpu)?,
            scene: layout(gpu, "scene", &SCENE)?,
            textures: layout(gpu, "textures", &TEXTURES)?,
            rays: layout(gpu, "rays", &RAYS)?,
            ray_textures: layout(gpu, "ray textures", &RAY_TEXTURES)?,
            lightmap: layout(gpu, "lightmap", &LIGHTMAP)?,
            probe: layout(gpu, "probe", &PROBE)?,
            sky: layout(gpu, "sky", &SKY)?,
            accumulate: layout(gpu, "accumulate", &ACCUMULATE)?,
            show: layout(gpu, "show", &SHOW)?,
        })
    }

    /// The layouts of passes that compute a scene's lightmap: frame, scene, lightmap, rays.
    pub fn baking(&self) -> [&DescriptorSetLayout; 4] {
        [&self.frame, &self.scene, &self.lightmap, &self.rays]
    }

    /// The layouts of the pass that captures light for a probe: frame, scene, probe, rays.
    pub fn capturing(&self) -> [&DescriptorSetLayout; 4] {
        [&self.frame, &self.scene, &self.probe, &self.rays]
    }

    /// The layouts of passes that learn what of the sky is seen: frame, scene, sky, rays.
    pub fn learning_sky(&self) -> [&DescriptorSetLayout; 4] {
        [&self.frame, &self.scene, &self.sky, &self.rays]
    }

    /// The layouts of passes that draw a scene: frame, scene, textures, rays.
    pub fn drawing(&self) -> [&DescriptorSetLayout; 4] {
        [&self.frame, &self.scene, &self.textures, &self.rays]
    }
}

/// The layout of set 0, which every `gpu::FrameRing` fills.
pub fn frame(gpu: &Arc<Gpu>) -> Result<DescriptorSetLayout> {
    layout(gpu, "frame", &FRAME)
}

/// The layout of a texture of the user interface.
pub fn ui(gpu: &Arc<Gpu>) -> Result<DescriptorSetLayout> {
    layout(gpu, "interface", &UI)
}

/// The layout of a headset's mirror.
pub fn mirror(gpu: &Arc<Gpu>) -> Result<DescriptorSetLayout> {
    layout(gpu, "mirror", &MIRROR)
}

fn layout(gpu: &Arc<Gpu>, name: &str, set: &SetBindings) -> Result<DescriptorSetLayout> {
    let kinds: Vec<BindingType> = set.bindings.iter().map(|(_, kind)| *kind).collect();
    DescriptorSetLayout::new(gpu, name, &kinds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{SAMPLED_IN_STAGE, STORAGE_IN_STAGE};

    #[test]
    fn a_stage_sees_no_more_than_is_asked_of_a_gpu() {
        let count = |kinds: &[BindingType]| {
            let of = |third: &SetBindings| {
                let all = [&FRAME, &SCENE, third, &RAYS].map(|set| set.bindings);
                all.concat().iter().filter(|(_, kind)| kinds.contains(kind)).count() as u32
            };
            [TEXTURES, LIGHTMAP, PROBE, SKY].iter().map(of).max()
        };
        assert_eq!(count(&[BindingType::Sampled]), Some(SAMPLED_IN_STAGE));
        assert_eq!(count(&[BindingType::Storage, BindingType::StorageDynamic]), Some(STORAGE_IN_STAGE));
    }
}
