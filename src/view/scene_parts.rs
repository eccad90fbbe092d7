//! A loaded scene's materials and lamps, as a person is told of them.

use crate::scene::Scene;

/// Materials and lamps, in the scene's order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneParts {
    pub materials: Vec<MaterialPart>,
    /// Kinds of lamps.
    pub lamps: Vec<&'static str>,
}

/// A material's name and where its maps come from.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialPart {
    pub name: String,
    pub maps: Vec<String>,
}

impl SceneParts {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> Self {
        let maps = |i: usize| scene.sources.get(i).map_or_else(Vec::new, |source| source.maps.clone());
        let materials = scene.materials.iter().enumerate();
        let lamp = |is_spot: bool| if is_spot { "spot light" } else { "point light" };
        Self {
            materials: materials.map(|(i, m)| MaterialPart { name: m.name.clone(), maps: maps(i) }).collect(),
            lamps: scene.lights.iter().map(|light| lamp(light.cone.is_some())).collect(),
        }
    }
}
