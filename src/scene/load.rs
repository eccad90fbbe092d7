//! Loading a scene description or a single model with all files that it names.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{Mat4, Vec3};
use rayon::prelude::*;

use super::description::{Description, EnvironmentFile, MAX_LENGTH, ModelFile};
use super::mesh::{Bounds, Mesh};
use super::staging::Staging;
use super::{
    Camera, Environment, Instance, Material, MaterialSource, Scene, description_text, material, model_lights,
    refraction, tangent,
};
use crate::asset::material::{AlphaUse, MaterialDesc};
use crate::asset::mesh::Submesh;
use crate::asset::model::{Model, ModelCamera, ModelLight};
use crate::asset::{Panorama, Report, TextureOptions, file, gltf, obj};
use crate::{Error, Result};

const AUTO_FOV_DEGREES: f32 = 45.0;
/// The extensions of scenes' files, in lower case: of descriptions, and of models.
const EXTENSIONS: [&str; 4] = ["toml", "gltf", "glb", "obj"];

/// Whether a file is a scene's, by its extension.
pub fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|own| EXTENSIONS.iter().any(|known| own.eq_ignore_ascii_case(known)))
}

/// Defaults for a scene, and options of loading.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// For a model, or a description without `environment`; with `None` such a scene is lit by uniform radiance 1.
    pub default_panorama: Option<PathBuf>,
    /// How textures are made.
    pub textures: TextureOptions,
    /// What takes the place of the description's keys.
    pub staging: Staging,
}

/// The scene in a folder: its first description, else its first model, by name. `None` if there is none.
pub fn scene_in(folder: &Path) -> Option<PathBuf> {
    let files = std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    let rank = |path: &PathBuf| {
        let own = path.extension()?;
        EXTENSIONS.iter().position(|known| own.eq_ignore_ascii_case(known))
    };
    files.filter_map(|path| Some((rank(&path)?, path))).min().map(|(_, path)| path)
}

/// Loads a scene description (.toml) or a model (.gltf, .glb, .obj) with all it names.
///
/// A scene without cameras gets one named `auto` that sees all of it.
///
/// # Errors
/// The scene, a model or the panorama is missing, broken or too large, or a key of the description is wrong.
pub fn load(path: &Path, options: &LoadOptions, report: &Report) -> Result<Scene> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let description = match extension.as_deref() {
        Some("toml") => Description::load(path)?,
        Some("obj" | "gltf" | "glb") => only_model(path),
        _ => return Err(Error::Usage(format!("{}: a scene is a .toml, .gltf, .glb or .obj file", path.display()))),
    };
    let (environment, panorama) = environment(path, &description, options, report)?;
    let mut models = Models::load(&description.models, report)?;
    models.find_vertex_alpha();
    let (mut materials, mut textures) = material::build(&models.materials, &options.textures, report);
    if models.meshes.iter().any(|mesh| mesh.material == materials.len()) {
        materials.push(material::default_material());
    }
    for mesh in models.meshes.iter().filter(|mesh| mesh.has_colours()) {
        materials[mesh.material].vertex_colours = true;
    }
    let parts = refraction::Parts {
        meshes: &mut models.meshes,
        instances: &mut models.instances,
        materials: &mut materials,
        textures: &mut textures,
    };
    refraction::settle(parts, report);
    let mut lights = description.lights.clone();
    lights.extend(model_lights::point_lights(&models.lights));
    let mut cameras = description.cameras.clone();
    add_cameras(&mut cameras, &models.cameras);
    let mut scene = Scene {
        meshes: models.meshes,
        instances: models.instances,
        sources: sources(&models.materials, &materials),
        materials,
        textures,
        lights,
        cameras,
        environment,
        probes: description.probes.clone(),
        exposure_ev: description.exposure_ev,
    };
    let bounds = scene.bounds();
    model_lights::warn_of_units(&models.lights, bounds, &scene.environment.panorama, report);
    model_lights::add_directional(&mut scene.environment, &models.lights);
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
    options.staging.stage.apply(&mut scene, description.floor)?;
    if let Some(file) = &options.staging.write_scene {
        description_text::write(file, &described(description, panorama, &options.staging, &scene))?;
    }
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

/// Reads a model by the kind of its file.
fn load_model(path: &Path, report: &Report) -> Result<Model> {
    let is_obj = path.extension().is_none_or(|extension| extension.eq_ignore_ascii_case("obj"));
    if is_obj { obj::load(path, report) } else { gltf::load(path, report) }
}

fn only_model(path: &Path) -> Description {
    let model = ModelFile { file: path.into(), world_from_local: Mat4::IDENTITY };
    Description {
        environment: None,
        exposure_ev: 0.0,
        floor: false,
        models: vec![model],
        lights: vec![],
        probes: vec![],
        cameras: vec![],
    }
}

fn sources(descs: &[MaterialDesc], materials: &[Material]) -> Vec<MaterialSource> {
    let source = |(desc, material): (&MaterialDesc, &Material)| {
        let mut guesses = desc.guesses.clone();
        if let (AlphaUse::Guessed, Some(cutoff)) = (desc.alpha, material.alpha_cutoff) {
            guesses.push(format!("holes where alpha is below {cutoff}: it varies"));
        }
        MaterialSource { maps: desc.origins(), guesses }
    };
    descs.iter().zip(materials).map(source).collect()
}

/// The description of a staged scene, whose panorama comes from this file. The camera that it is seen by is the first.
fn described(from: Description, panorama: Option<PathBuf>, staging: &Staging, scene: &Scene) -> Description {
    let rotation_degrees = scene.environment.rotation_degrees;
    let environment = panorama.map(|panorama| EnvironmentFile { panorama, rotation_degrees });
    let first = &scene.cameras[0];
    let mut cameras = vec![first.clone()];
    cameras.extend(from.cameras.into_iter().filter(|camera| camera.name != first.name));
    Description {
        environment,
        exposure_ev: scene.exposure_ev,
        floor: from.floor || staging.stage.floor,
        cameras,
        ..from
    }
}

/// The environment, and the file of its panorama.
fn environment(
    path: &Path,
    description: &Description,
    options: &LoadOptions,
    report: &Report,
) -> Result<(Environment, Option<PathBuf>)> {
    let own = description.environment.as_ref().map(|e| &e.panorama);
    let file = options.staging.panorama.as_ref().or(own).or(options.default_panorama.as_ref());
    let panorama = match file {
        Some(file) => Panorama::load(file, report)?,
        None => {
            report.warn(format!("{}: no environment; lit by uniform radiance 1", file::short_name(path)));
            Panorama::uniform(Vec3::ONE)
        }
    };
    let own_rotation = description.environment.as_ref().map_or(0.0, |e| e.rotation_degrees);
    let rotation_degrees = options.staging.stage.rotation.unwrap_or(own_rotation);
    Ok((Environment { panorama, rotation_degrees }, file.cloned()))
}

/// The models of a scene, each file read once.
#[derive(Default)]
struct Models {
    /// Their materials are indices into `materials`; `materials.len()` is the default material.
    meshes: Vec<Mesh>,
    instances: Vec<Instance>,
    materials: Vec<MaterialDesc>,
    /// In world space.
    cameras: Vec<ModelCamera>,
    lights: Vec<ModelLight>,
}

impl Models {
    fn load(files: &[ModelFile], report: &Report) -> Result<Self> {
        let progress = report.progress("models", files.len() as u64);
        let mut models = Self::default();
        let mut submeshes: Vec<Submesh> = Vec::new();
        let mut known: HashMap<&Path, (usize, Model)> = HashMap::new();
        for file in files {
            if !known.contains_key(file.file.as_path()) {
                let mut model = report.time("parse", || load_model(&file.file, report))?;
                let (first, first_material) = (submeshes.len(), models.materials.len());
                let renumbered = model.submeshes.drain(..).map(|submesh| {
                    let material = submesh.material.map(|material| material + first_material);
                    Submesh { material, ..submesh }
                });
                submeshes.extend(renumbered);
                models.materials.append(&mut model.materials);
                known.insert(&file.file, (first, model));
            }
            if let Some((first, model)) = known.get(file.file.as_path()) {
                models.place(model, *first, file.world_from_local);
            }
            progress.inc(1);
        }
        let default = models.materials.len();
        let mesh = |submesh: Submesh| tangent::mesh(&submesh, submesh.material.unwrap_or(default));
        models.meshes = submeshes.into_par_iter().map(mesh).collect();
        progress.finish_and_clear();
        Ok(models)
    }

    /// Tells materials of vertices that make them less opaque.
    fn find_vertex_alpha(&mut self) {
        for mesh in self.meshes.iter().filter(|mesh| mesh.has_alpha()) {
            if let Some(material) = self.materials.get_mut(mesh.material) {
                material.vertex_alpha = true;
            }
        }
    }

    /// Adds what a model has to the world, with its first mesh's index.
    fn place(&mut self, model: &Model, first_mesh: usize, world_from_model: Mat4) {
        self.instances.extend(model.placements.iter().map(|placement| Instance {
            mesh: first_mesh + placement.submesh,
            world_from_local: world_from_model * placement.model_from_local,
        }));
        self.cameras.extend(model.cameras.iter().map(|camera| ModelCamera {
            model_from_camera: world_from_model * camera.model_from_camera,
            ..camera.clone()
        }));
        self.lights.extend(model.lights.iter().map(|light| light.placed(world_from_model)));
    }
}

/// Adds cameras of models behind those of the description, with numbers behind names that are there already.
fn add_cameras(cameras: &mut Vec<Camera>, more: &[ModelCamera]) {
    let mut names: HashSet<String> = cameras.iter().map(|camera| camera.name.clone()).collect();
    for camera in more {
        let numbered = (2..).map(|number| format!("{} {number}", camera.name));
        let mut candidates = std::iter::once(camera.name.clone()).chain(numbered);
        let Some(name) = candidates.find(|name| !names.contains(name)) else { continue };
        names.insert(name.clone());
        let (position, ahead) =
            (camera.model_from_camera.w_axis.truncate(), -camera.model_from_camera.z_axis.truncate());
        let target = position + ahead.normalize_or(Vec3::NEG_Z);
        cameras.push(Camera { name, position, target, vertical_fov_degrees: camera.vertical_fov_degrees });
    }
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
