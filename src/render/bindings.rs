//! Every descriptor binding of the renderer's shaders, by set. build.rs makes `bindings.glsl` of these tables, so that
//! a shader names a binding instead of numbering it: `layout(SCENE_LIGHTS, scalar)`.

use crate::gpu::BindingType::{self, Sampled, Storage, StorageDynamic, StorageImage, Uniform, UniformDynamic};

/// The bindings of one descriptor set: names and types, in order from binding 0.
pub struct SetBindings {
    /// The number of the set in `layout(set = …)`.
    pub set: u32,
    pub bindings: &'static [(&'static str, BindingType)],
}

/// Data that is written once per frame; see `gpu::FrameRing`. The storage binding holds data that passes push.
pub const FRAME: SetBindings =
    SetBindings { set: 0, bindings: &[("FRAME_UNIFORMS", UniformDynamic), ("FRAME_STORAGE", StorageDynamic)] };

/// A scene and its light.
pub const SCENE: SetBindings = SetBindings {
    set: 1,
    bindings: &[
        ("SCENE_INSTANCES", Storage),
        ("SCENE_MATERIALS", Storage),
        ("SCENE_LIGHTS", Storage),
        ("SCENE_PANORAMA", Sampled),
        ("SCENE_IRRADIANCE", Sampled),
        ("SCENE_SPECULAR_EVEN", Sampled),
        ("SCENE_SPECULAR_ODD", Sampled),
        ("SCENE_BRDF_TABLE", Sampled),
        ("SCENE_LIGHTMAP", Sampled),
        ("SCENE_LAMP_SHADOWS", Sampled),
        ("SCENE_LAMP_DEPTHS", Sampled),
        ("SCENE_SUN_SHADOW", Sampled),
        ("SCENE_SUN_DEPTH", Sampled),
        ("SCENE_PROBES", Uniform),
        ("SCENE_PROBE_EVEN", Sampled),
        ("SCENE_PROBE_ODD", Sampled),
        ("SCENE_VERTEX_EXTRAS", Storage),
        ("SCENE_COUNTED_LIGHTS", Uniform),
        ("SCENE_LAMP_TRANSMISSION", Sampled),
        ("SCENE_SUN_TRANSMISSION", Sampled),
    ],
};

/// The textures of one material.
pub const TEXTURES: SetBindings = SetBindings {
    set: 2,
    bindings: &[
        ("BASE_COLOR_MAP", Sampled),
        ("NORMAL_MAP", Sampled),
        ("ORM_MAP", Sampled),
        ("EMISSION_MAP", Sampled),
        ("EXTENSION_MAP", Sampled),
    ],
};

/// What rays meet: the scene's triangles under a hierarchy, small copies of its textures, and the importance table of the
/// panorama.
pub const RAYS: SetBindings = SetBindings {
    set: 3,
    bindings: &[
        ("RAY_NODES", Storage),
        ("RAY_TRIANGLES", Storage),
        ("RAY_CORNERS", Storage),
        ("RAY_BASE_COLOR", Sampled),
        ("RAY_NORMAL", Sampled),
        ("RAY_ORM", Sampled),
        ("RAY_IMPORTANCE", Storage),
        ("RAY_EMISSION", Sampled),
        ("RAY_CORNER_EXTRAS", Storage),
        ("RAY_EMITTERS", Storage),
        ("RAY_EXTENSION", Sampled),
    ],
};

/// One layer of the textures for rays, a compute pass. GPUs may allow no more than four storage images in a stage: the last is that of
/// emission, and in a pass of its own that of extensions.
pub const RAY_TEXTURES: SetBindings = SetBindings {
    set: 1,
    bindings: &[
        ("RAY_TEXTURES_BASE_COLOR", StorageImage),
        ("RAY_TEXTURES_NORMAL", StorageImage),
        ("RAY_TEXTURES_ORM", StorageImage),
        ("RAY_TEXTURES_EMISSION", StorageImage),
    ],
};

/// A lightmap while it is computed, in compute passes.
pub const LIGHTMAP: SetBindings = SetBindings {
    set: 2,
    bindings: &[
        ("LIGHTMAP_TEXELS", Storage),
        ("LIGHTMAP_SUMS", Storage),
        ("LIGHTMAP_SURFACES", Storage),
        ("LIGHTMAP_RELAYS", Storage),
        ("LIGHTMAP_INDICES", Storage),
        ("LIGHTMAP_DIRECT", Sampled),
        ("LIGHTMAP_SOFT", Sampled),
        ("LIGHTMAP_DIRECT_IMAGE", StorageImage),
        ("LIGHTMAP_SOFT_IMAGE", StorageImage),
        ("LIGHTMAP_LIGHT_IMAGE", StorageImage),
    ],
};

/// What a probe's rays read and write, in a compute pass.
pub const PROBE: SetBindings = SetBindings {
    set: 2,
    bindings: &[("PROBE_DIRECT", Sampled), ("PROBE_SOFT", Sampled), ("PROBE_CAPTURE", StorageImage)],
};

/// What is learned of the sky that is seen, in compute passes: `SKY_IMPORTANCE` is the table that `RAY_IMPORTANCE` reads.
pub const SKY: SetBindings = SetBindings {
    set: 2,
    bindings: &[("SKY_TRIED", Storage), ("SKY_IMPORTANCE", Storage), ("SKY_COMES", Storage), ("SKY_SHARES", Storage)],
};

/// The reference's accumulation, a compute pass.
pub const ACCUMULATE: SetBindings = SetBindings {
    set: 0,
    bindings: &[
        ("ACCUMULATE_LATEST", Sampled),
        ("ACCUMULATE_MEAN", StorageImage),
        ("ACCUMULATE_DEVIATIONS", StorageImage),
        ("ACCUMULATE_ERRORS", Storage),
    ],
};

/// The pass that shows the accumulated mean.
pub const SHOW: SetBindings = SetBindings { set: 1, bindings: &[("SHOW_MEAN", Sampled)] };

/// A texture of the user interface.
pub const UI: SetBindings = SetBindings { set: 1, bindings: &[("UI_TEXTURE", Sampled)] };

/// The mirror of a headset: the eyes' picture.
pub const MIRROR: SetBindings = SetBindings { set: 0, bindings: &[("MIRROR_PICTURE", Sampled)] };

/// All of them.
pub const ALL: [SetBindings; 12] =
    [FRAME, SCENE, TEXTURES, RAYS, RAY_TEXTURES, LIGHTMAP, PROBE, SKY, ACCUMULATE, SHOW, UI, MIRROR];

/// `bindings.glsl`: a macro per binding.
pub fn glsl() -> String {
    let mut text = String::from("// The bindings of src/render/bindings.rs, made by build.rs.\n");
    for SetBindings { set, bindings } in ALL {
        for (binding, (name, _)) in bindings.iter().enumerate() {
            text += &format!("#define {name} set = {set}, binding = {binding}\n");
        }
    }
    text
}
