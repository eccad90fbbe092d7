//! What a person changes of a scene while it is shown: factors of materials, strength of lamps.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;

use super::shared::{LightBlock, MaterialBlock};

/// The most that a lamp's intensity is multiplied by.
const MOST_LAMP: f32 = 1e6;

/// A number from 0 to `most`; what is none is 0.
fn within(value: f32, most: f32) -> f32 {
    // Of a number and what is none, `max` gives the number.
    value.max(0.0).min(most)
}

/// Factors of a material; each multiplies its map where there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialFactors {
    /// Linear RGB, 0 to 1.
    pub base_color: Vec3,
    /// 0 to 1.
    pub metallic: f32,
    /// Perceptual roughness, 0 to 1: alpha = roughness².
    pub roughness: f32,
}

impl MaterialFactors {
    fn in_range(self) -> Self {
        Self {
            base_color: self.base_color.map(|channel| within(channel, 1.0)),
            metallic: within(self.metallic, 1.0),
            roughness: within(self.roughness, 1.0),
        }
    }

    pub(super) fn of(block: &MaterialBlock) -> Self {
        Self { base_color: block.base_color.into(), metallic: block.metallic, roughness: block.roughness }
    }

    fn applied(&self, block: MaterialBlock) -> MaterialBlock {
        let Self { base_color, metallic, roughness } = *self;
        MaterialBlock { base_color: base_color.into(), metallic, roughness, ..block }
    }
}

/// Changes of a scene as its file has it. What is not changed has no entry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneEdits {
    /// By the index of the material.
    pub materials: BTreeMap<usize, MaterialFactors>,
    /// What a lamp's intensity is multiplied by, by the index of the lamp.
    pub lamps: BTreeMap<usize, f32>,
}

impl SceneEdits {
    /// Whether the scene is as its file has it.
    pub fn is_empty(&self) -> bool {
        self.materials.is_empty() && self.lamps.is_empty()
    }

    /// Changes a material; `None`: it is as in its file again. Numbers are brought into their range.
    pub fn set_material(&mut self, index: usize, factors: Option<MaterialFactors>) {
        match factors {
            Some(factors) => drop(self.materials.insert(index, factors.in_range())),
            None => drop(self.materials.remove(&index)),
        }
    }

    /// Changes a lamp; `None`: it is as in its file again. Numbers are brought into their range.
    pub fn set_lamp(&mut self, index: usize, factor: Option<f32>) {
        match factor {
            Some(factor) => drop(self.lamps.insert(index, within(factor, MOST_LAMP))),
            None => drop(self.lamps.remove(&index)),
        }
    }

    /// A hash of them; `None` without any.
    pub(super) fn digest(&self) -> Option<blake3::Hash> {
        (!self.is_empty()).then(|| blake3::hash(format!("{self:?}").as_bytes()))
    }

    /// A material's block with its change.
    pub(super) fn material(&self, index: usize, block: MaterialBlock) -> MaterialBlock {
        self.materials.get(&index).map_or(block, |factors| factors.applied(block))
    }

    /// A lamp's block with its change.
    pub(super) fn lamp(&self, index: usize, block: LightBlock) -> LightBlock {
        let factor = self.lamps.get(&index).copied().unwrap_or(1.0);
        LightBlock { intensity: block.intensity.map(|channel| channel * factor), ..block }
    }

    /// What is changed here or there.
    pub(super) fn places(&self, other: &Self) -> EditPlaces {
        EditPlaces {
            materials: self.materials.keys().chain(other.materials.keys()).copied().collect(),
            lamps: self.lamps.keys().chain(other.lamps.keys()).copied().collect(),
        }
    }
}

/// Materials and lamps, by index.
#[derive(Debug, Default)]
pub(super) struct EditPlaces {
    pub materials: BTreeSet<usize>,
    pub lamps: BTreeSet<usize>,
}

impl EditPlaces {
    /// Adds others.
    pub fn extend(&mut self, others: Self) {
        self.materials.extend(others.materials);
        self.lamps.extend(others.lamps);
    }
}
