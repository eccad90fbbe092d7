//! A glTF scene: the meshes of its nodes where they stand, and copies of those that stand mirrored or distorted.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, Vec3, Vec4};

use super::deform::{self, cofactors, turned};
use super::document::Node;
use super::geometry::{Read, Wanted};
use super::instances;
use super::nodes::{self, Nodes};
use super::source::{Source, label};
use crate::Result;
use crate::asset::material::MaterialDesc;
use crate::asset::mesh::{MAX_COORDINATE, Submesh};
use crate::asset::normals;
use crate::error::shortened;

/// The most triangles as often as they stand somewhere.
const MAX_PLACED_TRIANGLES: usize = 50_000_000;
/// The most primitives as often as nodes name them.
const MAX_PLACEMENTS: usize = 1_000_000;
/// Characters of a mesh's name that are kept: each of its primitives has it.
const MAX_NAME: usize = 200;
/// By how much the parts of a matrix may differ from those of a rotation.
const TOLERANCE: f64 = 1e-4;
/// What is smaller, as a part of the largest, is nothing.
const NOTHING: f64 = 1e-12;

/// The meshes of a scene.
pub struct Meshes {
    pub submeshes: Vec<Submesh>,
    pub placements: Vec<(usize, DAffine3)>,
    pub materials: Vec<MaterialDesc>,
}

/// What makes a mesh of one node another than that of another node.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Key {
    mesh: usize,
    skin: Option<usize>,
    /// Of morph targets, as bits.
    weights: Option<Vec<u32>>,
    /// What distorts it, as bits.
    by: Option<[u64; 9]>,
}

/// What a matrix does to a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Turns it, and scales it alike in all directions.
    Similar,
    Distorting,
    /// Nothing of it is left but a line or a point.
    Vanishing,
}

/// Reads the meshes of all nodes that the scene shows.
///
/// # Errors
/// One of them is not as it should be, or they are too large.
pub fn meshes(source: &Source<'_>, nodes: &Nodes) -> Result<Meshes> {
    let mut placing = Placing::new(source, nodes);
    for node in &nodes.shown {
        placing.place(*node)?;
    }
    if placing.placements.is_empty() {
        return Err(source.broken(placing.why_nothing()));
    }
    Ok(placing.finish())
}

struct Placing<'a> {
    source: &'a Source<'a>,
    nodes: &'a Nodes,
    read: Read,
    submeshes: Vec<Submesh>,
    known: HashMap<Key, Vec<usize>>,
    skins: HashMap<usize, Vec<DAffine3>>,
    placements: Vec<(usize, DAffine3)>,
    named: usize,
    triangles: usize,
    vanished: bool,
}

impl<'a> Placing<'a> {
    fn new(source: &'a Source<'a>, nodes: &'a Nodes) -> Self {
        Self {
            source,
            nodes,
            read: Read::default(),
            submeshes: Vec::new(),
            known: HashMap::new(),
            skins: HashMap::new(),
            placements: Vec::new(),
            named: 0,
            triangles: 0,
            vanished: false,
        }
    }

    fn place(&mut self, index: usize) -> Result<()> {
        let source = self.source;
        let node = &source.document.nodes[index];
        let Some(mesh) = node.mesh else { return Ok(()) };
        if source.document.meshes.get(mesh).is_none() {
            return Err(source.broken(format!("{}: there is no mesh {mesh}", nodes::name_of(source, index))));
        }
        // A skin's joints say all of where its mesh is.
        if node.skin.is_some() {
            return self.place_mesh(mesh, node, DAffine3::IDENTITY);
        }
        for instance in instances::of_node(source, index, node, MAX_PLACEMENTS)? {
            let global = self.nodes.globals[index] * instance;
            nodes::check_reach(source, index, &global)?;
            self.place_mesh(mesh, node, global)?;
        }
        Ok(())
    }

    fn place_mesh(&mut self, mesh: usize, node: &Node, global: DAffine3) -> Result<()> {
        let kind = kind_of(&global.matrix3);
        if kind == Kind::Vanishing {
            self.vanished = true;
            return Ok(());
        }
        let weights = node.weights.as_ref().map(|weights| weights.iter().map(|weight| weight.to_bits()).collect());
        let mut key = Key { mesh, skin: node.skin, weights, by: None };
        let mut placed = self.submeshes_of(&key, node)?;
        let mut at = global;
        if kind == Kind::Distorting {
            key.by = Some(global.matrix3.to_cols_array().map(f64::to_bits));
            placed = self.distorted(key, &placed, &global.matrix3)?;
            at = DAffine3::from_translation(global.translation);
        }
        for submesh in placed {
            self.triangles += self.submeshes[submesh].corners.len() / 3;
            self.placements.push((submesh, at));
        }
        if self.triangles > MAX_PLACED_TRIANGLES {
            let limit = format!("{MAX_PLACED_TRIANGLES} triangles");
            return Err(self.source.too_large(format!("over {limit} with all copies"), limit));
        }
        Ok(())
    }

    fn count_named(&mut self, more: usize) -> Result<()> {
        self.named = self.named.saturating_add(more);
        if self.named > MAX_PLACEMENTS {
            return Err(self
                .source
                .too_large(format!("over {MAX_PLACEMENTS} parts of meshes"), format!("{MAX_PLACEMENTS}")));
        }
        Ok(())
    }

    /// A mesh as it is, skinned and morphed.
    fn submeshes_of(&mut self, key: &Key, node: &Node) -> Result<Vec<usize>> {
        if let Some(known) = self.known.get(key) {
            let known = known.clone();
            self.count_named(known.len().max(1))?;
            return Ok(known);
        }
        let source = self.source;
        let mesh = &source.document.meshes[key.mesh];
        self.count_named(mesh.primitives.len().max(1))?;
        if let Some(skin) = key.skin.filter(|skin| !self.skins.contains_key(skin)) {
            let joints = self.skins.values().map(Vec::len).sum();
            self.skins.insert(skin, deform::joints(source, skin, &self.nodes.globals, joints)?);
        }
        let joints = key.skin.and_then(|skin| self.skins.get(&skin)).map(Vec::as_slice);
        let weights = node.weights.as_ref().unwrap_or(&mesh.weights);
        let of = label("mesh", key.mesh, mesh.name.as_deref());
        let name = mesh.name.as_deref().filter(|name| !name.is_empty());
        let name = name.map_or_else(|| of.clone(), |name| shortened(name, MAX_NAME));
        let first = self.submeshes.len();
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let (mut of, mut name) = (of.clone(), name.clone());
            if mesh.primitives.len() > 1 {
                of = format!("{of} primitive {number}");
                name = format!("{name} {number}");
            }
            let wanted = Wanted { primitive, of: &of, name: &name, weights, joints };
            self.submeshes.extend(self.read.primitive(source, &wanted)?);
        }
        let made: Vec<usize> = (first..self.submeshes.len()).collect();
        self.known.insert(key.clone(), made.clone());
        Ok(made)
    }

    fn distorted(&mut self, key: Key, from: &[usize], by: &DMat3) -> Result<Vec<usize>> {
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        let first = self.submeshes.len();
        for submesh in from {
            self.read.count(self.source, self.submeshes[*submesh].corners.len() / 3)?;
            let copy = distorted(&self.submeshes[*submesh], by);
            if !copy.corners.iter().all(|corner| corner.position.abs().max_element() <= MAX_COORDINATE) {
                let name = label("mesh", key.mesh, Some(&copy.name));
                return Err(self.source.broken(format!("{name} is scaled beyond {MAX_COORDINATE:e}")));
            }
            self.submeshes.push(copy);
        }
        let made: Vec<usize> = (first..self.submeshes.len()).collect();
        self.known.insert(key, made.clone());
        Ok(made)
    }

    fn why_nothing(&self) -> &'static str {
        if self.source.document.meshes.is_empty() {
            "it has no triangles"
        } else if self.vanished {
            "its scene scales all of its meshes to nothing"
        } else if self.named == 0 {
            "its scene shows no mesh"
        } else {
            "it has no triangles"
        }
    }

    /// Drops submeshes of which only distorted copies stand anywhere.
    fn finish(mut self) -> Meshes {
        let mut stands = vec![false; self.submeshes.len()];
        self.placements.iter().for_each(|(submesh, _)| stands[*submesh] = true);
        let mut numbers = Vec::with_capacity(stands.len());
        let mut number = 0;
        for stands in &stands {
            numbers.push(number);
            number += usize::from(*stands);
        }
        self.placements.iter_mut().for_each(|(submesh, _)| *submesh = numbers[*submesh]);
        let kept = self.submeshes.into_iter().zip(stands).filter_map(|(submesh, stands)| stands.then_some(submesh));
        Meshes { submeshes: kept.collect(), placements: self.placements, materials: self.read.materials.descs }
    }
}

fn kind_of(matrix: &DMat3) -> Kind {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = *matrix;
    let largest = x.length().max(y.length()).max(z.length());
    // Squares of what is smaller are lost.
    if largest < 1e-30 {
        return Kind::Vanishing;
    }
    let matrix = *matrix * (1.0 / largest);
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = matrix;
    let area = cofactors(&matrix).to_cols_array().into_iter().fold(0.0, |most: f64, part| most.max(part.abs()));
    if area < NOTHING {
        return Kind::Vanishing;
    }
    let lengths = [x, y, z].iter().all(|axis| (axis.length() - 1.0).abs() <= TOLERANCE);
    let angles = [x.dot(y), y.dot(z), z.dot(x)].iter().all(|dot| dot.abs() <= TOLERANCE);
    if lengths && angles && matrix.determinant() > 0.0 { Kind::Similar } else { Kind::Distorting }
}

/// A copy transformed by a matrix, its triangles still counter-clockwise seen from outside.
fn distorted(submesh: &Submesh, by: &DMat3) -> Submesh {
    let mirrors = by.determinant() < 0.0;
    let sign = if mirrors { -1.0 } else { 1.0 };
    let cofactors = cofactors(by) * sign;
    let mut copy = submesh.clone();
    for corner in &mut copy.corners {
        corner.position = (*by * corner.position.as_dvec3()).as_vec3();
        corner.normal = normals::unit(turned(&cofactors, corner.normal));
    }
    for extra in &mut copy.extras {
        let tangent = normals::unit(turned(by, extra.tangent.truncate()));
        let is_usable = tangent != Vec3::ZERO;
        extra.tangent = if is_usable { tangent.extend(extra.tangent.w * sign as f32) } else { Vec4::ZERO };
    }
    if mirrors {
        copy.corners.chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
        copy.extras.chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
    }
    // Sides of what is pressed flat have none left.
    normals::complete(std::slice::from_mut(&mut copy));
    copy
}
