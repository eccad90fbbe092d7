//! glTF 2.0 models, `.glb` and `.gltf`: geometry where its nodes place it, materials, cameras and lights.

mod accessor;
mod anisotropy;
mod component;
mod container;
mod deform;
mod diffuse_transmission;
mod document;
mod draco;
mod extensions;
mod geometry;
mod glossy;
mod images;
mod instances;
mod iridescence;
mod layers;
mod maps;
mod material_reader;
mod materials;
mod meshopt;
mod nodes;
mod scene;
mod sheen;
mod source;
mod specular;
mod transmission;
mod triangles;
mod uri;
mod views;

use std::path::Path;

use glam::{DAffine3, DMat4, DVec3};

use self::nodes::Nodes;
use self::scene::Meshes;
use self::source::Source;
use self::views::{PlacedCamera, PlacedLight};
use crate::Result;
use crate::asset::Report;
use crate::asset::mesh::{self, Submesh};
use crate::asset::model::{Model, ModelCamera, ModelLight, Placement};

/// Reads a model as its default scene shows it.
///
/// Meshes stand where their nodes place them; of those that are mirrored or scaled unevenly there are transformed copies,
/// so that every placement is a rotation, a uniform scale and a translation. Skins and morph targets are applied as the
/// nodes stand; animations are not played. Normals that are missing are those of the flat triangles. Pictures are not
/// read, only found. What is not supported, and can be left out, is a warning.
///
/// # Errors
/// The file or a buffer cannot be read, or is too large; it is not as the format has it; it needs an extension that is
/// not supported; its scene shows no triangles.
pub fn load(path: &Path, report: &Report) -> Result<Model> {
    let source = Source::open(path, report)?;
    extensions::check(&source)?;
    warn_of_motion(&source);
    let nodes = Nodes::of(&source)?;
    let meshes = scene::meshes(&source, &nodes)?;
    let cameras = views::cameras(&source, &nodes)?;
    let lights = views::lights(&source, &nodes)?;
    let centre = far_centre(&meshes);
    if let Some(by) = centre.map(|centre| -centre) {
        source.warn_once("far", &format!("far from the origin for its size; moved by {} {} {}", by.x, by.y, by.z));
    }
    Ok(assemble(meshes, cameras, lights, centre.unwrap_or(DVec3::ZERO)))
}

fn warn_of_motion(source: &Source<'_>) {
    if !source.document.skins.is_empty() {
        source.warn_once("motion", "animations are not played; skinned meshes stand as their nodes do");
    } else if !source.document.animations.is_empty() {
        source.warn_once("motion", "animations are not played");
    }
}

/// The middle of a model that is so far from the origin that f32 would distort it.
fn far_centre(meshes: &Meshes) -> Option<DVec3> {
    let bounds: Vec<_> = meshes.submeshes.iter().map(bounds).collect();
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (submesh, at) in &meshes.placements {
        let (own_low, own_high) = bounds[*submesh];
        let centre = at.transform_point3(0.5 * (own_low + own_high));
        let [x, y, z] = [at.matrix3.x_axis, at.matrix3.y_axis, at.matrix3.z_axis].map(DVec3::abs);
        let half = 0.5 * (own_high - own_low);
        let half = x * half.x + y * half.y + z * half.z;
        (low, high) = (low.min(centre - half), high.max(centre + half));
    }
    mesh::far_centre(low, high)
}

fn bounds(submesh: &Submesh) -> (DVec3, DVec3) {
    let positions = submesh.corners.iter().map(|corner| corner.position.as_dvec3());
    positions.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
}

/// The model, moved so that `centre` is the origin.
fn assemble(meshes: Meshes, cameras: Vec<PlacedCamera>, lights: Vec<PlacedLight>, centre: DVec3) -> Model {
    let matrix = |at: DAffine3| {
        let moved = DAffine3::from_mat3_translation(at.matrix3, at.translation - centre);
        DMat4::from(moved).as_mat4()
    };
    let placement = |(submesh, at)| Placement { submesh, model_from_local: matrix(at) };
    let camera = |placed: PlacedCamera| ModelCamera { model_from_camera: matrix(placed.at), ..placed.camera };
    let light = |placed: PlacedLight| match placed.light {
        ModelLight::Point { intensity, cone, .. } => {
            ModelLight::Point { position: (placed.at - centre).as_vec3(), intensity, cone }
        }
        directional => directional,
    };
    Model {
        submeshes: meshes.submeshes,
        placements: meshes.placements.into_iter().map(placement).collect::<Vec<_>>(),
        materials: meshes.materials,
        cameras: cameras.into_iter().map(camera).collect(),
        lights: lights.into_iter().map(light).collect(),
    }
}

#[cfg(test)]
pub(crate) mod build_tests;
#[cfg(test)]
pub(crate) mod draco_tests;
#[cfg(test)]
mod files_tests;
#[cfg(test)]
mod geometry_tests;
#[cfg(test)]
mod layers_tests;
#[cfg(test)]
mod materials_tests;
#[cfg(test)]
mod scene_tests;
