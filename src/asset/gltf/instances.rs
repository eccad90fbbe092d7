//! Many of a node's mesh: `EXT_mesh_gpu_instancing`.

use std::collections::BTreeMap;

use glam::DAffine3;
use serde::Deserialize;

use super::accessor::Elements;
use super::document::Node;
use super::nodes;
use super::source::Source;
use crate::Result;

/// The extension's name.
pub const NAME: &str = "EXT_mesh_gpu_instancing";

#[derive(Deserialize)]
struct Instancing {
    /// Accessors.
    #[serde(default)]
    attributes: BTreeMap<String, usize>,
}

/// Where the instances of a node's mesh stand, node from mesh; without the extension one, where the node is.
///
/// # Errors
/// They are not as the extension has it, or more than `most`.
pub fn of_node(source: &Source<'_>, index: usize, node: &Node, most: usize) -> Result<Vec<DAffine3>> {
    let of = || nodes::name_of(source, index);
    let Some(Instancing { attributes }) = source.extension(&of(), &node.extensions, NAME)? else {
        return Ok(vec![DAffine3::IDENTITY]);
    };
    let translations = attribute::<3>(source, &attributes, "TRANSLATION")?;
    let rotations = attribute::<4>(source, &attributes, "ROTATION")?;
    let scales = attribute::<3>(source, &attributes, "SCALE")?;
    let counts = [
        translations.as_ref().map(|of| of.count),
        rotations.as_ref().map(|of| of.count),
        scales.as_ref().map(|of| of.count),
    ];
    let Some(count) = counts.into_iter().flatten().next() else {
        return Err(source.broken(format!("{}: {NAME}: it says of no instance where it is", of())));
    };
    if counts.into_iter().flatten().any(|other| other != count) {
        return Err(source.broken(format!("{}: {NAME}: its attributes are not of equally many instances", of())));
    }
    if count > most {
        return Err(source.too_large(format!("{}: {count} instances", of()), format!("{most}")));
    }
    Ok((0..count)
        .map(|number| {
            let of = |elements: &Option<Elements<'_, 3>>| Some(elements.as_ref()?.get(number).map(f64::from));
            let rotation = rotations.as_ref().map(|rotations| rotations.get(number).map(f64::from));
            nodes::moved(of(&translations), rotation, of(&scales))
        })
        .collect())
}

fn attribute<'a, const N: usize>(
    source: &'a Source<'_>,
    attributes: &BTreeMap<String, usize>,
    key: &str,
) -> Result<Option<Elements<'a, N>>> {
    attributes.get(key).map(|accessor| Elements::of(source, *accessor)).transpose()
}
