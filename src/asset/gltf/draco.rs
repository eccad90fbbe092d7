//! Compressed primitives: `KHR_draco_mesh_compression`.

use std::collections::BTreeMap;

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use serde::Deserialize;

use super::component::{Unpacked, shape};
use super::container::MAX_FILE_BYTES;
use super::document::Primitive;
use super::source::Source;
use crate::Result;
use crate::asset::contained::contained;

/// The extension's name.
pub const NAME: &str = "KHR_draco_mesh_compression";

/// A compressed primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Packed {
    buffer_view: usize,
    /// The compressed attributes by their unique numbers.
    attributes: BTreeMap<String, u32>,
}

/// Decompresses a primitive's triangles, at most so many, and vertices into its accessors; `false`: it is not compressed.
///
/// # Errors
/// It is not as the extension has it, or too large.
pub fn unpack(source: &Source<'_>, of: &str, primitive: &Primitive, most: usize) -> Result<bool> {
    let Some(packed): Option<Packed> = source.extension(of, &primitive.extensions, NAME)? else { return Ok(false) };
    let Some(indices) = primitive.indices else {
        return Err(source.broken(format!("{of}: it is compressed, and has no indices")));
    };
    // Those that an application keeps for itself need not be the primitive's.
    let accessors =
        || packed.attributes.iter().filter_map(|(key, id)| Some((key, *id, *primitive.attributes.get(key)?)));
    if source.unpacked(indices).is_some() && accessors().all(|(.., accessor)| source.unpacked(accessor).is_some()) {
        return Ok(true);
    }
    let problem = |problem: String| source.broken(format!("{of}: {problem}"));
    let (bytes, _) = source.view(packed.buffer_view)?;
    let mesh = contained(|| decoded(bytes, most as u64)).and_then(|mesh| mesh).map_err(problem)?;
    let corners = mesh.faces().iter().flatten().map(|point| point.0);
    source.keep_unpacked(indices, Unpacked::indices(corners))?;
    for (key, id, accessor) in accessors() {
        let Some(attribute) = mesh.attribute_by_unique_id(id) else {
            return Err(problem(format!("its compressed data has no attribute {id}, which is its {key}")));
        };
        let Some((component, numbers)) = source.document.accessors.get(accessor).and_then(shape) else {
            return Err(problem(format!("there is no accessor {accessor}, or its type is unknown")));
        };
        let values = contained(|| attribute.read_f32s(mesh.num_points(), numbers)).map_err(problem)?;
        source.keep_unpacked(accessor, Unpacked::numbers(component, &values))?;
    }
    Ok(true)
}

fn decoded(bytes: &[u8], most: u64) -> std::result::Result<Mesh, String> {
    let mut limits = DecodeLimits::default();
    limits.max_faces = most;
    limits.max_points = 3 * most;
    limits.max_decoded_bytes = MAX_FILE_BYTES;
    let mut mesh = Mesh::new();
    let result = MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh);
    result.map_err(|error| format!("its compressed data cannot be read: {error}"))?;
    Ok(mesh)
}
