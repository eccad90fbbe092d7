//! Loading a scene description or a single model with all files that it names.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::{Mat4, Vec3};
use rayon::prelude::*;

use super::description::{Description, MAX_LENGTH, ModelFile};
use super::mesh::{Bounds, Mesh};
use super::staging::Staging;
use super::{Camera, Environment, Instance, Scene, material, tangent};
use crate::asset::mesh::Submesh;
use crate::asset::mtl::{Mtl, UvTransform};
use crate::asset::{Panorama, Report, TextureOptions, file, obj};
use crate::{Error, Result};

const AUTO_FOV_DEGREES: f32 = 45.0;

/// Defaults for a scene, and options of loading.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// For an .obj, or a description without `environment`; with `None` such a scene is lit by uniform radiance 1.
    pub default_panorama: Option<PathBuf>,
    /// How textures are made.
    pub textures: TextureOptions,
    /// What takes the place of the description's keys.
    pub staging: Staging,
}

/// Loads a scene description (.toml) or a model (.obj) with all it names.
///
/// A scene without cameras gets one named `auto` that sees all of it.
///
/// # Errors
/// The scene, a model or the panorama is missing, broken or too large, or a key of the description is wrong.
pub fn load(path: &Path, options: &LoadOptions, report: &Report) -> Result<Scene> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let description = match extension.as_deref() {
        Some("toml") => Description::load(path)?,
        Some("obj") => only_model(path),
        _ => return Err(Error::Usage(format!("{}: a scene is a .toml or an .obj file", path.display()))),
    };
    let environment = environment(path, &description, options, report)?;
    let models = Models::load(&description.models, report)?;
    let (mut materials, textures) = material::build(&models.mtls, &options.textures, report);
    if models.meshes.iter().any(|mesh| mesh.material == materials.len()) {
        materials.push(material::default_material());
    }
    let mut scene = Scene {
        meshes: models.meshes,
        instances: models.instances,
        materials,
        textures,
        lights: description.lights,
        cameras: description.cameras,
        environment,
        probes: description.probes,
        exposure_ev: description.exposure_ev,
    };
    let bounds = scene.bounds();
    let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
    if bounds != Bounds::EMPTY && reach > MAX_LENGTH {
        return Err(Error::Broken {
            path: path.into(),
            what: "scene",
            problem: format!("its models reach {reach:e}, beyond {MAX_LENGTH:e}"),
            remedy: "choose smaller values for scale",
        });
    }
    if scene.cameras.is_empty() {
        scene.cameras.push(auto_camera(scene.bounds()));
    }
    options.staging.apply(&mut scene)?;
    Ok(scene)
}

/// A scene's file and the files that it names: panorama and models, but not their libraries and textures. Of a
/// description that cannot be read, only its own file.
pub fn files(path: &Path) -> Vec<PathBuf> {
    let is_description = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let description = is_description.then(|| Description::load(path).ok()).flatten();
    let named =
        description.map(|d| d.environment.into_iter().map(|e| e.panorama).chain(d.models.into_iter().map(|m| m.file)));
    std::iter::once(path.to_owned()).chain(named.into_iter().flatten()).collect()
}

fn only_model(path: &Path) -> Description {
    let model = ModelFile { file: path.into(), world_from_local: Mat4::IDENTITY };
    Description {
        environment: None,
        exposure_ev: 0.0,
        models: vec![model],
        lights: vec![],
        probes: vec![],
        cameras: vec![],
    }
}

fn environment(path: &Path, description: &Description, options: &LoadOptions, report: &Report) -> Result<Environment> {
    let own = description.environment.as_ref().map(|e| &e.panorama);
    let file = options.staging.panorama.as_ref().or(own).or(options.default_panorama.as_ref());
    let panorama = match file {
        Some(file) => Panorama::load(file, report)?,
        None => {
            report.warn(format!("{}: no environment; lit by uniform radiance 1", file::short_name(path)));
            Panorama::uniform(Vec3::ONE)
        }
    };
    Ok(Environment { panorama, rotation_degrees: description.environment.as_ref().map_or(0.0, |e| e.rotation_degrees) })
}

/// The geometry of a scene, each file read once.
struct Models {
    /// Their materials are indices into `mtls`; `mtls.len()` is the default material.
    meshes: Vec<Mesh>,
    instances: Vec<Instance>,
    /// Only those that are used.
    mtls: Vec<Mtl>,
}

impl Models {
    fn load(files: &[ModelFile], report: &Report) -> Result<Self> {
        let progress = report.progress("models", files.len() as u64);
        let mut all_mtls = Vec::new();
        let mut submeshes: Vec<Submesh> = Vec::new();
        let mut known: HashMap<&Path, Range<usize>> = HashMap::new();
        let mut instances = Vec::new();
        for model in files {
            let meshes = match known.get(model.file.as_path()) {
                Some(meshes) => meshes.clone(),
                None => {
                    let (loaded, first) = (report.time("parse", || obj::load(&model.file, report))?, all_mtls.len());
                    let start = submeshes.len();
                    submeshes.extend(
                        loaded
                            .submeshes
                            .into_iter()
                            .map(|submesh| Submesh { material: submesh.material.map(|m| m + first), ..submesh }),
                    );
                    all_mtls.extend(loaded.materials);
                    known.insert(&model.file, start..submeshes.len());
                    start..submeshes.len()
                }
            };
            instances.extend(meshes.map(|mesh| Instance { mesh, world_from_local: model.world_from_local }));
            progress.inc(1);
        }
        let mtls = keep_used(&mut submeshes, all_mtls);
        let uvs: Vec<UvTransform> = mtls.iter().map(|mtl| mtl.uv_transform(report)).collect();
        let meshes = submeshes
            .into_par_iter()
            .map(|mut submesh| {
                let material = submesh.material.unwrap_or(mtls.len());
                if let Some(uv) = uvs.get(material).filter(|uv| **uv != UvTransform::default()) {
                    submesh.corners.iter_mut().for_each(|corner| corner.uv = uv.apply(corner.uv));
                }
                tangent::mesh(&submesh, material)
            })
            .collect();
        progress.finish_and_clear();
        Ok(Self { meshes, instances, mtls })
    }
}

/// Drops materials that no submesh uses, so that their textures are not loaded.
fn keep_used(submeshes: &mut [Submesh], mtls: Vec<Mtl>) -> Vec<Mtl> {
    let used: BTreeSet<usize> = submeshes.iter().filter_map(|submesh| submesh.material).collect();
    let new_index: HashMap<usize, usize> = used.iter().enumerate().map(|(new, old)| (*old, new)).collect();
    for submesh in submeshes {
        submesh.material = submesh.material.and_then(|old| new_index.get(&old).copied());
    }
    mtls.into_iter().enumerate().filter(|(index, _)| used.contains(index)).map(|(_, mtl)| mtl).collect()
}

/// A camera that sees all of a box: from +Z, slightly from above and from the right.
fn auto_camera(bounds: Bounds) -> Camera {
    let (target, radius) = if bounds.radius() > 0.0 { (bounds.centre(), bounds.radius()) } else { (Vec3::ZERO, 1.0) };
    let distance = radius / (AUTO_FOV_DEGREES.to_radians() * 0.5).sin();
    let position = target + Vec3::new(0.35, 0.3, 1.0).normalize() * distance;
    Camera { name: "auto".into(), position, target, vertical_fov_degrees: AUTO_FOV_DEGREES }
}

#[cfg(test)]
#[path = "load_tests.rs"]
mod tests;
