//! Vertices moved by morph targets and by skins.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::accessor::Elements;
use super::source::{Source, label};
use crate::Result;

/// The most joints of all skins together.
const MAX_JOINTS: usize = 1 << 20;

/// A vertex as it can be moved.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    pub position: Vec3,
    pub normal: Vec3,
    pub tangent: Vec3,
    /// Whether left and right are swapped.
    pub mirrored: bool,
}

/// Cofactors: they turn normals as the matrix turns areas, also where it has no inverse.
pub fn cofactors(matrix: &DMat3) -> DMat3 {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = *matrix;
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
}

/// A direction on a surface turned with it: a normal by cofactors, a tangent by the matrix itself. Not of unit length.
pub fn turned(by: &DMat3, direction: Vec3) -> Vec3 {
    let turned = *by * direction.as_dvec3();
    (turned / turned.abs().max_element().max(f64::MIN_POSITIVE)).as_vec3()
}

/// One morph target with its weight.
struct Target<'a> {
    weight: f32,
    /// What it adds to position, normal and tangent.
    adds: [Option<Elements<'a, 3>>; 3],
}

/// The morph targets of a primitive that have a weight.
#[derive(Default)]
pub struct Morph<'a>(Vec<Target<'a>>);

impl<'a> Morph<'a> {
    /// # Errors
    /// An accessor cannot be read, or has too few elements for `count` vertices.
    pub fn of(
        source: &'a Source<'_>,
        of: &str,
        targets: &[BTreeMap<String, usize>],
        weights: &[f32],
        count: usize,
    ) -> Result<Self> {
        let weighted = targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0 && weight.is_finite());
        let read = |(target, weight): (&BTreeMap<String, usize>, &f32)| {
            let add = |key: &str| attribute(source, of, target, key, count);
            Ok(Target { weight: *weight, adds: [add("POSITION")?, add("NORMAL")?, add("TANGENT")?] })
        };
        Ok(Self(weighted.map(read).collect::<Result<_>>()?))
    }

    /// How much work it is.
    pub fn targets(&self) -> usize {
        self.0.len()
    }

    pub fn apply(&self, vertex: usize, to: &mut Moved) {
        for Target { weight, adds } in &self.0 {
            let add =
                |number: usize| adds[number].as_ref().map_or(Vec3::ZERO, |add| Vec3::from(add.get(vertex)) * weight);
            to.position += add(0);
            to.normal += add(1);
            to.tangent += add(2);
        }
    }
}

/// An attribute of all vertices, if there is one.
///
/// # Errors
/// It cannot be read, or has too few elements.
pub fn attribute<'a, const N: usize>(
    source: &'a Source<'_>,
    of: &str,
    attributes: &BTreeMap<String, usize>,
    key: &str,
    count: usize,
) -> Result<Option<Elements<'a, N>>> {
    let Some(accessor) = attributes.get(key) else { return Ok(None) };
    let elements = Elements::of(source, *accessor)?;
    if elements.count < count {
        return Err(source.broken(format!("{of}: it has {count} positions, and {} of {key}", elements.count)));
    }
    Ok(Some(elements))
}

/// The matrices of a skin's joints: model from mesh.
///
/// # Errors
/// It names what does not exist, or its matrices cannot be read.
pub fn joints(source: &Source<'_>, skin: usize, globals: &[DAffine3], known: usize) -> Result<Vec<DAffine3>> {
    let Some(own) = source.document.skins.get(skin) else {
        return Err(source.broken(format!("there is no skin {skin}")));
    };
    let of = label("skin", skin, own.name.as_deref());
    if known + own.joints.len() > MAX_JOINTS {
        return Err(source.too_large(format!("over {MAX_JOINTS} joints"), format!("{MAX_JOINTS}")));
    }
    let inverse: Option<Elements<'_, 16>> =
        own.inverse_bind_matrices.map(|index| Elements::of(source, index)).transpose()?;
    if inverse.as_ref().is_some_and(|inverse| inverse.count < own.joints.len()) {
        return Err(source.broken(format!("{of} has fewer matrices than joints")));
    }
    let matrix = |(number, node): (usize, &usize)| {
        let global = globals.get(*node).ok_or_else(|| source.broken(format!("{of}: there is no node {node}")))?;
        Ok(inverse.as_ref().map_or(*global, |inverse| *global * affine(inverse.get(number))))
    };
    own.joints.iter().enumerate().map(matrix).collect()
}

fn affine(matrix: [f32; 16]) -> DAffine3 {
    let [x, y, z, t] = [0, 4, 8, 12].map(|at| Vec3::new(matrix[at], matrix[at + 1], matrix[at + 2]).as_dvec3());
    DAffine3 { matrix3: DMat3::from_cols(x, y, z), translation: t }
}

/// A skin as the vertices of a primitive have it.
pub struct Skinned<'a> {
    matrices: &'a [DAffine3],
    /// Joints and weights of four each.
    sets: Vec<(Elements<'a, 4>, Elements<'a, 4>)>,
}

impl<'a> Skinned<'a> {
    /// `None` where vertices have no joints.
    ///
    /// # Errors
    /// An accessor cannot be read.
    pub fn of(
        source: &'a Source<'_>,
        of: &str,
        attributes: &BTreeMap<String, usize>,
        count: usize,
        matrices: &'a [DAffine3],
    ) -> Result<Option<Self>> {
        let mut sets = Vec::new();
        for set in 0..2 {
            let joints: Option<Elements<'_, 4>> = attribute(source, of, attributes, &format!("JOINTS_{set}"), count)?;
            let weights: Option<Elements<'_, 4>> = attribute(source, of, attributes, &format!("WEIGHTS_{set}"), count)?;
            if joints.as_ref().is_some_and(|joints| !joints.has_indices()) {
                return Err(source.broken(format!("{of}: JOINTS_{set} is of no usable type")));
            }
            sets.extend(joints.zip(weights.map(Elements::normalized)));
        }
        Ok((!sets.is_empty()).then_some(Self { matrices, sets }))
    }

    /// Moves a vertex. `None`: it has a joint that does not exist.
    pub fn apply(&self, vertex: usize, to: &mut Moved) -> Option<()> {
        let (mut sum, mut total) = (DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO }, 0.0);
        for (joints, weights) in &self.sets {
            for (joint, weight) in joints.indices(vertex).into_iter().zip(weights.get(vertex)) {
                if weight == 0.0 || !weight.is_finite() {
                    continue;
                }
                let matrix = self.matrices.get(joint as usize)?;
                sum.matrix3 += matrix.matrix3 * f64::from(weight);
                sum.translation += matrix.translation * f64::from(weight);
                total += f64::from(weight);
            }
        }
        if total.abs() > 1e-6 {
            sum.matrix3 *= 1.0 / total;
            sum.translation /= total;
        } else {
            sum = *self.matrices.get(self.sets[0].0.indices(vertex)[0] as usize)?;
        }
        to.mirrored = sum.matrix3.determinant() < 0.0;
        let cofactors = cofactors(&sum.matrix3) * if to.mirrored { -1.0 } else { 1.0 };
        to.position = sum.transform_point3(to.position.as_dvec3()).as_vec3();
        to.normal = turned(&cofactors, to.normal);
        to.tangent = turned(&sum.matrix3, to.tangent);
        Some(())
    }
}
