//! Which code for materials a pipeline has: for core materials, which have no clear coat, no sheen, no stretched highlights, no film, no diffuse
//! transmission, no map of an extension and do not refract, or for all.
//!
//! Constants alone would do, but validation layers, software renderers and drivers work through all of a shader before they
//! leave out what its constants do.

use super::ray_features::EXTENSION_MAPS;
use super::shared::{constant, ray_feature};
use crate::gpu::{Constant, core_materials};

/// What is true or not of the material of the surface that is drawn.
const OF_SURFACE: [u32; 7] = [
    constant::CLEARCOAT,
    constant::SHEEN,
    constant::ANISOTROPY,
    constant::FILM,
    constant::EXTENSION_MAP_OF,
    constant::DIFFUSE_TRANSMISSION,
    constant::REFRACTS,
];
/// What rays may meet.
const OF_RAYS: u32 = ray_feature::CLEARCOAT
    | ray_feature::SHEEN
    | ray_feature::ANISOTROPY
    | ray_feature::FILM
    | ray_feature::REFRACTS
    | ray_feature::DIFFUSE_TRANSMISSION
    | EXTENSION_MAPS;

/// The name of `shader` with no more code than these constants use.
pub fn shader_for(shader: &str, constants: &[Constant]) -> String {
    let rays =
        constants.iter().find(|(id, _)| *id == constant::RAY_FEATURES).map_or(u32::MAX, |(_, features)| *features);
    let surface = constants.iter().any(|(id, value)| OF_SURFACE.contains(id) && *value != 0);
    if surface || rays & OF_RAYS != 0 { shader.to_owned() } else { core_materials(shader) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_for_layers_is_there_where_a_surface_or_a_ray_needs_it() {
        let none = [
            (constant::RAY_FEATURES, ray_feature::HOLES | ray_feature::TINTS),
            (constant::CLEARCOAT, 0),
            (constant::TINTS, 1),
        ];
        assert_eq!(shader_for("a.frag", &none), "core/a.frag");
        assert_eq!(shader_for("a.frag", &none[1..]), "a.frag", "rays may meet anything");
        for id in OF_SURFACE {
            assert_eq!(shader_for("a.frag", &[none[0], (id, 1)]), "a.frag");
        }
        for bit in [
            ray_feature::CLEARCOAT,
            ray_feature::SHEEN,
            ray_feature::ANISOTROPY,
            ray_feature::FILM,
            ray_feature::REFRACTS,
            ray_feature::DIFFUSE_TRANSMISSION,
            EXTENSION_MAPS,
        ] {
            assert_eq!(shader_for("a.frag", &[(constant::RAY_FEATURES, bit)]), "a.frag");
        }
    }
}
