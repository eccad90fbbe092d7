//! Scene descriptions as text: what `scene::description` reads.

use std::path::Path;

use glam::{EulerRot, Vec3};
use serde::Serialize;

use super::description::{Description, EnvironmentFile, ModelFile};
use super::{Camera, PointLight, Probe};
use crate::asset::file;
use crate::{Error, Result};

/// Writes a description that gives this scene again. Files in its folder or below are named relative to it, others by their
/// whole path.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, description: &Description) -> Result<()> {
    let folder = std::path::absolute(path).map_err(Error::write(path))?;
    let name = |named: &Path| -> Result<String> {
        let whole = std::path::absolute(named).map_err(Error::read(named))?;
        let relative = folder.parent().and_then(|folder| whole.strip_prefix(folder).ok()).unwrap_or(&whole);
        Ok(relative.to_string_lossy().replace('\\', "/"))
    };
    let text = SceneText {
        exposure_ev: description.exposure_ev,
        floor: description.floor,
        environment: description
            .environment
            .as_ref()
            .map(|environment| EnvironmentText::new(environment, &name))
            .transpose()?,
        model: description.models.iter().map(|model| ModelText::new(model, &name)).collect::<Result<_>>()?,
        light: description.lights.iter().map(|light| LightText { point: PointText::new(light) }).collect(),
        probe: description.probes.iter().map(ProbeText::new).collect(),
        camera: description.cameras.iter().map(CameraText::new).collect(),
    };
    let text = toml::to_string(&text).map_err(|error| Error::Usage(format!("{}: {error}", path.display())))?;
    file::write_atomically(path, text.as_bytes())
}

/// Adds a camera at the end of a description, whose text stays as it is.
///
/// # Errors
/// [`Error::Usage`] for a model, which has no description, and for a name that is taken; the file cannot be read or
/// written.
pub fn append_camera(path: &Path, camera: &Camera) -> Result<()> {
    let shown = path.display();
    if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("toml")) {
        let remedy = "write one with --write-scene, and show that";
        return Err(Error::Usage(format!("{shown} is a model without a description of cameras; {remedy}")));
    }
    if Description::load(path)?.cameras.iter().any(|known| known.name == camera.name) {
        return Err(Error::Usage(format!("{shown} has a camera {} already; choose another name", camera.name)));
    }
    #[derive(Serialize)]
    struct Cameras {
        camera: [CameraText; 1],
    }
    let unwritable = |error: &dyn std::fmt::Display| Error::Usage(format!("{shown}: {error}"));
    let block = toml::to_string(&Cameras { camera: [CameraText::new(camera)] }).map_err(|error| unwritable(&error))?;
    let old = std::fs::read_to_string(path).map_err(Error::read(path))?;
    let line_end = if old.ends_with('\n') || old.is_empty() { "" } else { "\n" };
    let text = format!("{old}{line_end}\n{block}");
    // Cameras may stand in the file in a form that tables cannot be added to.
    toml::from_str::<toml::Table>(&text).map_err(|error| unwritable(&error.message()))?;
    file::write_atomically(path, text.as_bytes())
}

#[derive(Serialize)]
struct SceneText {
    exposure_ev: f32,
    floor: bool,
    environment: Option<EnvironmentText>,
    model: Vec<ModelText>,
    light: Vec<LightText>,
    probe: Vec<ProbeText>,
    camera: Vec<CameraText>,
}

#[derive(Serialize)]
struct EnvironmentText {
    panorama: String,
    rotation_degrees: f32,
}

#[derive(Serialize)]
struct ModelText {
    file: String,
    translation: [f32; 3],
    rotation_degrees: [f32; 3],
    scale: f32,
}

#[derive(Serialize)]
struct LightText {
    point: PointText,
}

#[derive(Serialize)]
struct PointText {
    position: [f32; 3],
    intensity: [f32; 3],
    radius: f32,
}

#[derive(Serialize)]
struct ProbeText {
    position: [f32; 3],
    r#box: [[f32; 3]; 2],
}

#[derive(Serialize)]
struct CameraText {
    name: String,
    position: [f32; 3],
    target: [f32; 3],
    vertical_fov_degrees: f32,
}

impl EnvironmentText {
    fn new(environment: &EnvironmentFile, name: &impl Fn(&Path) -> Result<String>) -> Result<Self> {
        Ok(Self { panorama: name(&environment.panorama)?, rotation_degrees: environment.rotation_degrees })
    }
}

impl ModelText {
    fn new(model: &ModelFile, name: &impl Fn(&Path) -> Result<String>) -> Result<Self> {
        let (scale, rotation, translation) = model.world_from_local.to_scale_rotation_translation();
        let (x, y, z) = rotation.to_euler(EulerRot::XYZ);
        // Not −0.
        let rotation_degrees = [x, y, z].map(|angle| angle.to_degrees() + 0.0);
        Ok(Self { file: name(&model.file)?, translation: translation.into(), rotation_degrees, scale: scale.x })
    }
}

impl PointText {
    fn new(light: &PointLight) -> Self {
        let PointLight { position, intensity, radius, .. } = *light;
        Self { position: position.into(), intensity: intensity.into(), radius }
    }
}

impl ProbeText {
    fn new(probe: &Probe) -> Self {
        let corner = |corner: Vec3| corner.to_array();
        Self { position: corner(probe.position), r#box: [corner(probe.bounds.min), corner(probe.bounds.max)] }
    }
}

impl CameraText {
    fn new(camera: &Camera) -> Self {
        let Camera { name, position, target, vertical_fov_degrees } = camera.clone();
        Self { name, position: position.into(), target: target.into(), vertical_fov_degrees }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Mat4, Quat};

    use super::*;
    use crate::scene::Bounds;

    #[test]
    fn a_camera_is_added_and_the_rest_of_the_text_stays() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scene.toml");
        std::fs::write(folder.path().join("a.obj"), "").unwrap();
        let before = "# mine\n[[model]]\nfile = \"a.obj\" # a model";
        std::fs::write(&file, before).unwrap();
        let camera = |name: &str| Camera {
            name: name.into(),
            position: Vec3::new(0.5, 1.0, 2.0),
            target: Vec3::Y,
            vertical_fov_degrees: 40.0,
        };
        append_camera(&file, &camera("near \"it\"")).unwrap();
        append_camera(&file, &camera("far")).unwrap();
        let error = append_camera(&file, &camera("far")).unwrap_err().to_string();
        assert!(error.contains("another name"), "{error}");
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.starts_with(before), "{text}");
        assert_eq!(Description::load(&file).unwrap().cameras, [camera("near \"it\""), camera("far")]);
        let error = append_camera(&folder.path().join("a.obj"), &camera("a")).unwrap_err().to_string();
        assert!(error.contains("--write-scene"), "{error}");
        std::fs::write(&file, "camera = []\n").unwrap();
        assert!(append_camera(&file, &camera("a")).is_err());
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "camera = []\n");
    }

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("models 'é'")).unwrap();
        let file = at("models 'é'/a.obj");
        std::fs::write(&file, "").unwrap();
        std::fs::write(at("sky.exr"), "").unwrap();
        let turn = Quat::from_euler(EulerRot::XYZ, 0.3, -1.2, 2.5);
        let placed = Mat4::from_scale_rotation_translation(Vec3::splat(0.1), turn, Vec3::new(1.0, -2.5, 1e6));
        let cone = None;
        let described = Description {
            environment: Some(EnvironmentFile { panorama: at("sky.exr"), rotation_degrees: -30.5 }),
            exposure_ev: 0.1,
            floor: true,
            models: vec![ModelFile { file, world_from_local: placed }],
            lights: vec![PointLight { position: Vec3::X, intensity: Vec3::splat(1e-3), radius: 0.05, cone }],
            probes: vec![Probe {
                position: Vec3::ZERO,
                bounds: Bounds { min: -Vec3::ONE, max: Vec3::ONE },
                thing: None,
            }],
            cameras: vec![Camera {
                name: "a \"b\"\n".into(),
                position: Vec3::new(0.1, 0.2, 0.3),
                target: Vec3::Z,
                vertical_fov_degrees: 33.3,
            }],
        };
        write(&at("scene.toml"), &described).unwrap();
        let text = std::fs::read_to_string(at("scene.toml")).unwrap();
        assert!(!text.contains(&*folder.path().to_string_lossy()), "names are relative: {text}");
        let mut read = Description::load(&at("scene.toml")).unwrap();
        assert!(read.models[0].world_from_local.abs_diff_eq(placed, 1e-4), "{text}");
        read.models[0].world_from_local = placed;
        assert_eq!(read, described);
    }
}
