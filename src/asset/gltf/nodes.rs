//! The tree of nodes: where each of them is, and which of them the scene shows.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde::Deserialize;

use super::document::Node;
use super::source::{Source, label};
use crate::Result;
use crate::asset::mesh::MAX_COORDINATE;

/// The extension by which a node is hidden with all below it.
pub const VISIBILITY: &str = "KHR_node_visibility";

#[derive(Deserialize)]
struct Visibility {
    #[serde(default = "yes")]
    visible: bool,
}

fn yes() -> bool {
    true
}

/// The nodes of a file.
pub struct Nodes {
    /// Of each: model from node.
    pub globals: Vec<DAffine3>,
    /// Those of the scene that are not hidden, parents first.
    pub shown: Vec<usize>,
}

/// A node in words.
pub fn name_of(source: &Source<'_>, node: usize) -> String {
    label("node", node, source.document.nodes.get(node).and_then(|node| node.name.as_deref()))
}

impl Nodes {
    /// Walks the tree.
    ///
    /// # Errors
    /// It is not a tree, or a node is not where numbers can say.
    pub fn of(source: &Source<'_>) -> Result<Self> {
        let roots = roots(source)?;
        let nodes = &source.document.nodes;
        let mut globals = vec![None; nodes.len()];
        let mut next: Vec<(usize, DAffine3)> = roots.iter().map(|root| (*root, DAffine3::IDENTITY)).collect();
        while let Some((node, above)) = next.pop() {
            let global = above * local(&nodes[node]);
            check_reach(source, node, &global)?;
            globals[node] = Some(global);
            next.extend(nodes[node].children.iter().map(|child| (*child, global)));
        }
        if let Some(lost) = globals.iter().position(Option::is_none) {
            return Err(source.broken(format!("{} is its own ancestor", name_of(source, lost))));
        }
        let shown = shown(source, roots)?;
        Ok(Self { globals: globals.into_iter().flatten().collect(), shown })
    }
}

/// All nodes without a parent.
fn roots(source: &Source<'_>) -> Result<Vec<usize>> {
    let nodes = &source.document.nodes;
    let mut has_parent = vec![false; nodes.len()];
    for (parent, child) in nodes.iter().enumerate().flat_map(|(i, node)| node.children.iter().map(move |c| (i, *c))) {
        let Some(known) = has_parent.get_mut(child) else {
            return Err(source.broken(format!("{} has a child {child}, which does not exist", name_of(source, parent))));
        };
        if std::mem::replace(known, true) {
            return Err(source.broken(format!("{} has two parents", name_of(source, child))));
        }
    }
    Ok((0..nodes.len()).filter(|node| !has_parent[*node]).collect())
}

/// The visible nodes of the default scene, else of the first one, else of none.
fn shown(source: &Source<'_>, roots: Vec<usize>) -> Result<Vec<usize>> {
    let document = &source.document;
    let number = document.scene.unwrap_or(0);
    let mut next = match document.scenes.get(number) {
        Some(scene) => scene.nodes.to_vec(),
        None if document.scene.is_some() => return Err(source.broken(format!("there is no scene {number}"))),
        None => roots,
    };
    next.reverse();
    let mut next: Vec<(usize, bool)> = next.into_iter().map(|root| (root, true)).collect();
    let (mut seen, mut shown) = (vec![false; document.nodes.len()], Vec::new());
    while let Some((node, above)) = next.pop() {
        match seen.get_mut(node) {
            None => return Err(source.broken(format!("its scene has a node {node}, which does not exist"))),
            Some(true) => return Err(source.broken(format!("its scene shows {} twice", name_of(source, node)))),
            Some(seen) => *seen = true,
        }
        let visible = above && is_visible(source, node)?;
        if visible {
            shown.push(node);
        }
        next.extend(document.nodes[node].children.iter().rev().map(|child| (*child, visible)));
    }
    Ok(shown)
}

fn is_visible(source: &Source<'_>, node: usize) -> Result<bool> {
    let extensions = &source.document.nodes[node].extensions;
    let said: Option<Visibility> = source.extension(&name_of(source, node), extensions, VISIBILITY)?;
    Ok(said.is_none_or(|said| said.visible))
}

fn local(node: &Node) -> DAffine3 {
    if let Some(matrix) = node.matrix {
        let [x, y, z, t] = [0, 4, 8, 12].map(|at| DVec3::new(matrix[at], matrix[at + 1], matrix[at + 2]));
        return DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), t);
    }
    moved(node.translation, node.rotation, node.scale)
}

/// What a translation, a rotation (a quaternion of any length: x, y, z, w) and a scale do together.
pub fn moved(translation: Option<[f64; 3]>, rotation: Option<[f64; 4]>, scale: Option<[f64; 3]>) -> DAffine3 {
    let rotation = rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    let length = rotation.length();
    let rotation = if length.is_finite() && length > 0.0 { rotation / length } else { DQuat::IDENTITY };
    let [translation, scale] =
        [(translation, DVec3::ZERO), (scale, DVec3::ONE)].map(|(given, usual)| given.map_or(usual, DVec3::from));
    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
}

/// Checks that a node, or one of its instances, is where numbers can say.
///
/// # Errors
/// It is too far away, or too large.
pub fn check_reach(source: &Source<'_>, node: usize, global: &DAffine3) -> Result<()> {
    let most = f64::from(MAX_COORDINATE);
    if global.to_cols_array().iter().all(|number| number.abs() <= most) {
        return Ok(());
    }
    Err(source.broken(format!("{} is scaled or moved beyond {most:e}", name_of(source, node))))
}
