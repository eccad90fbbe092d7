//! What rays may meet in a scene, for shaders that have code for nothing else.

use glam::{Vec2, Vec3};

use super::shared::{VertexExtraBlock, ray_feature};
use crate::asset::material::Extension;
use crate::scene::{GeometryView, MAPS, Material};

/// The number of the extension map among [`Material::maps`].
const EXTENSION_MAP: u32 = 4;
/// Bits of the emissive and the extension map.
pub const EMISSIVE_MAPS: u32 = ray_feature::MAPS << 3;
pub const EXTENSION_MAPS: u32 = ray_feature::MAPS << EXTENSION_MAP;

/// What rays may meet in a scene with this geometry: bits of [`ray_feature`].
pub fn features(materials: &[Material], geometry: GeometryView<'_>) -> u32 {
    let any = |is: &dyn Fn(&Material) -> bool| materials.iter().any(is);
    let extra = || geometry.meshes.iter().any(|mesh| mesh.vertices.iter().any(VertexExtraBlock::is_needed));
    // Rays meet bodies themselves.
    let is_body = |material: &Material| {
        material.extension_map.is_some_and(|(of, _)| matches!(of, Extension::Body | Extension::Faces))
    };
    let map =
        |material: &Material, i: u32| material.maps()[i as usize].filter(|_| i != EXTENSION_MAP || !is_body(material));
    let maps = |i: u32| any(&|material| map(material, i).is_some());
    let all = [
        (ray_feature::HOLES, any(&|material| material.alpha_cutoff.is_some() || material.blends)),
        (ray_feature::EMITTERS, any(&|material| material.emissive_factor != Vec3::ZERO)),
        (ray_feature::GLOSSY, any(&is_glossy)),
        (ray_feature::TINTS, any(&Material::tints)),
        (ray_feature::CLEARCOAT, any(&|material| material.clearcoat_factor > 0.0)),
        (ray_feature::SHEEN, any(&|material| material.sheen_color != Vec3::ZERO)),
        (ray_feature::ANISOTROPY, any(&|material| material.anisotropy != Vec2::ZERO)),
        (ray_feature::FILM, any(&|material| material.film.is_some())),
        (ray_feature::DIFFUSE_TRANSMISSION, any(&|material| material.diffuse_transmission.is_some())),
        (ray_feature::REFRACTS, any(&|material| material.refraction.is_some())),
        (ray_feature::EXTRAS, any(&Material::takes_second_uv) || extra()),
    ];
    let of_maps = (0..MAPS as u32).filter(|i| maps(*i)).map(|i| ray_feature::MAPS << i);
    all.into_iter().filter(|(_, has)| *has).map(|(feature, _)| feature).chain(of_maps).sum()
}

/// Whether some of it is smooth metal, as `glsl/lightmap.glsl`'s `is_glossy` has it.
fn is_glossy(material: &Material) -> bool {
    material.metallic_range[1] > 0.5 && material.roughness_range[0] < 0.6
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::material::{DiffuseTransmission, ThinFilm};
    use crate::scene::Mesh;

    #[test]
    fn a_scene_has_the_features_of_its_materials() {
        let mut mesh = Mesh::ball(4, 1.0);
        let of_mesh = |mesh: &Mesh, change: fn(&mut Material)| {
            let mut material = Material::plain("plain", Vec3::ONE, 0.0, 0.2);
            change(&mut material);
            features(&[material], GeometryView { meshes: std::slice::from_ref(mesh), instances: &[] })
        };
        let of = |change| of_mesh(&mesh, change);
        assert_eq!(of(|_| {}), 0);
        assert_eq!(of(|m| m.alpha_cutoff = Some(0.5)), ray_feature::HOLES);
        assert_eq!(of(|m| m.blends = true), ray_feature::HOLES);
        let sheet = |m: &mut Material| (m.blends, m.transmission) = (true, Some(Vec3::new(1.0, 0.9, 1.0)));
        assert_eq!(of(sheet), ray_feature::HOLES | ray_feature::TINTS);
        assert_eq!(of(|m| (m.blends, m.transmission) = (true, Some(Vec3::ONE))), ray_feature::HOLES);
        assert_eq!(of(|m| m.clearcoat_factor = 0.1), ray_feature::CLEARCOAT);
        assert_eq!(of(|m| m.sheen_color.y = 0.1), ray_feature::SHEEN);
        assert_eq!(of(|m| m.anisotropy.y = 0.1), ray_feature::ANISOTROPY);
        let film = |m: &mut Material| m.film = Some(ThinFilm { share: 0.1, ior: 1.3, thickness: [400.0; 2] });
        assert_eq!(of(film), ray_feature::FILM);
        let through = |m: &mut Material| {
            m.diffuse_transmission = Some(DiffuseTransmission { share: 0.5, color: Vec3::ONE });
        };
        assert_eq!(of(through), ray_feature::DIFFUSE_TRANSMISSION);
        let sheen = |m: &mut Material| m.extension_map = Some((Extension::Sheen, 0));
        assert_eq!(of(sheen), EXTENSION_MAPS);
        assert_eq!(of(|m| m.extension_map = Some((Extension::Body, 0))), 0);
        assert_eq!(of(|m| m.emissive_factor.z = 0.1), ray_feature::EMITTERS);
        assert_eq!(of(|m| (m.metallic_range, m.roughness_range) = ([0.0, 1.0], [0.2, 0.9])), ray_feature::GLOSSY);
        assert_eq!(of(|m| (m.metallic_range, m.roughness_range) = ([0.0, 1.0], [0.7, 0.9])), 0);
        assert_eq!(of(|m| m.lookups[1].second_uv = true), ray_feature::EXTRAS);
        assert_eq!(of(|m| m.normal_map = Some(0)), ray_feature::MAPS << 1);
        mesh.vertices[1].colour[3] = 0;
        assert_eq!(of_mesh(&mesh, |_| {}), ray_feature::EXTRAS);
    }
}
