//! Which extensions are read, which only change what is seen, and which make a file unreadable.

use super::document::Material;
use super::draco;
use super::instances;
use super::maps;
use super::meshopt;
use super::nodes;
use super::source::Source;
use crate::Result;
use crate::error::{MAX_QUOTED, shortened};

const READ: [&str; 22] = [
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    super::sheen::NAME,
    super::glossy::NAME,
    super::specular::NAME,
    super::transmission::DISPERSION,
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    super::transmission::VOLUME,
    super::diffuse_transmission::NAME,
    "KHR_mesh_quantization",
    super::anisotropy::NAME,
    draco::NAME,
    instances::NAME,
    super::iridescence::NAME,
    maps::OTHER_PICTURES[0],
    maps::OTHER_PICTURES[1],
    meshopt::NAME,
    nodes::VISIBILITY,
];

/// Those of materials that are not drawn, and what a picture lacks without each.
const NOT_DRAWN: [(&str, &str); 2] = [
    ("KHR_materials_volume_scatter", "what is inside does not scatter light"),
    ("KHR_materials_variants", "drawn in its first variant"),
];

/// Another form of pictures, where a file has a usual one as well; a map without warns of itself.
const DDS: &str = "MSFT_texture_dds";

fn is_not_drawn(name: &str) -> bool {
    NOT_DRAWN.iter().any(|(known, _)| *known == name)
}

/// Checks what the file needs, and warns of what is left out.
///
/// # Errors
/// It needs an extension that is not read.
pub fn check(source: &Source<'_>) -> Result<()> {
    let document = &source.document;
    for name in &document.extensions_required {
        if !READ.contains(&name.as_str()) && !is_not_drawn(name) {
            let problem = format!("it needs the extension {}, which is not supported", shortened(name, MAX_QUOTED));
            return Err(source.broken_with(problem, remedy(name)));
        }
    }
    let known = |name: &str| READ.contains(&name) || is_not_drawn(name) || name == DDS;
    for name in document.extensions_used.iter().filter(|name| !known(name)) {
        let name = shortened(name, MAX_QUOTED);
        source.warn_once(name.clone(), &format!("the extension {name} is not supported; drawn without"));
    }
    Ok(())
}

fn remedy(name: &str) -> &'static str {
    match name {
        DDS => "export it again with PNG, JPEG, WebP or KTX2 textures",
        _ => "export it again without it",
    }
}

/// Warns, once for each, of what a material has that is not drawn; `of` is the material in words.
pub fn warn_of_material(source: &Source<'_>, of: &str, material: &Material) {
    for (name, without) in NOT_DRAWN.iter().filter(|(name, _)| material.extensions.contains_key(*name)) {
        source.warn_once(*name, &format!("{of}: {name} is not supported; {without}"));
    }
}

/// The same of variants, which primitives have.
pub fn warn_of_variants(source: &Source<'_>, of: &str, primitive: &super::document::Primitive) {
    let name = "KHR_materials_variants";
    if primitive.extensions.contains_key(name) {
        source.warn_once(name, &format!("{of}: {name} is not supported; drawn in its usual material"));
    }
}
