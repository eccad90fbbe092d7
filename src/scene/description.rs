//! Scene descriptions: TOML files with the environment, models, lights and cameras of a scene.

use std::collections::HashSet;
use std::fs::Metadata;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use glam::{EulerRot, Mat4, Quat, Vec3};
use serde::Deserialize;
use toml::Spanned;

use super::mesh::Bounds;
use super::probes::MOST_PROBES;
use super::{Camera, PointLight, Probe};
use crate::asset::contained::contained;
use crate::asset::mesh::MAX_COORDINATE;
use crate::asset::{file, shipped};
use crate::error::{MAX_QUOTED, one_line, shortened};
use crate::{Error, Result};

const MAX_FILE_BYTES: u64 = 16 << 20;
/// Prefix of files in the folder of the large scenes; no other variable is expanded.
const LARGE_SCENES: &str = "${PBR_VR_SCENES}/";
const LARGE_SCENES_REMEDY: &str = "; it does not come with the program: set PBR_VR_SCENES to the folder that holds it, or see `tools/fetch-assets --list`";
/// Limit of positions in metres, and of scales.
pub const MAX_LENGTH: f32 = MAX_COORDINATE;
/// Limit of a lamp's radius in metres.
const MAX_RADIUS: f32 = 100.0;
/// Limit of the exposure in stops, in both directions; the range of f32 is 127.
pub const MAX_EXPOSURE: f32 = 100.0;
const BACKSLASH: &str = "in \"…\" a backslash begins an escape: write / instead, or put the name between '…'";
/// Characters of messages of `toml`, which may quote a value.
const MAX_MESSAGE: usize = 300;
const DEFAULT_FOV_DEGREES: f32 = 45.0;

/// A checked description: paths are relative to the working directory, numbers are finite and in their range.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    pub environment: Option<EnvironmentFile>,
    pub exposure_ev: f32,
    /// Whether a grey floor lies under the models.
    pub floor: bool,
    pub models: Vec<ModelFile>,
    pub lights: Vec<PointLight>,
    /// At most [`MOST_PROBES`].
    pub probes: Vec<Probe>,
    /// May be empty; names are unique.
    pub cameras: Vec<Camera>,
}

/// A panorama, by its file.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentFile {
    pub panorama: PathBuf,
    pub rotation_degrees: f32,
}

/// A placed model, by its file.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile {
    pub file: PathBuf,
    pub world_from_local: Mat4,
}

impl Description {
    /// Reads and checks a description; file names in it are relative to its folder, or begin with `${PBR_VR_SCENES}/`
    /// for [`shipped::large_scenes`].
    ///
    /// # Errors
    /// The file cannot be read; [`Error::SceneKey`] with the line for unknown or missing keys and bad values.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = file::read(path, "scene description", MAX_FILE_BYTES)?;
        let text = String::from_utf8(bytes).map_err(|error| Error::Broken {
            path: path.into(),
            what: "scene description",
            problem: format!("byte {} is not UTF-8", error.utf8_error().valid_up_to()),
            remedy: "save it as UTF-8 text",
        })?;
        Self::parse(path, &text)
    }

    fn parse(path: &Path, text: &str) -> Result<Self> {
        let decoded = contained(|| toml::from_str::<SceneKeys>(text)).map_err(|problem| Error::Broken {
            path: path.into(),
            what: "scene description",
            problem,
            remedy: "write it as README.md shows",
        })?;
        let file = decoded.map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let key = key_at(text, start);
            let problem = explain(error.message(), &key);
            Error::SceneKey { path: path.into(), line: line_at(text, start), key: shortened(&key, MAX_QUOTED), problem }
        })?;
        let check = Check { path, text };
        let folder = path.parent().unwrap_or(Path::new(""));
        let description = Self {
            environment: file.environment.map(|keys| check.environment(folder, keys)).transpose()?,
            exposure_ev: check.within(MAX_EXPOSURE, "exposure_ev", file.exposure_ev, 0.0)?,
            floor: file.floor,
            models: file.model.into_iter().map(|keys| check.model(folder, keys)).collect::<Result<_>>()?,
            lights: file.light.into_iter().map(|keys| check.light(keys.point)).collect::<Result<_>>()?,
            probes: check.probes(file.probe)?,
            cameras: check.cameras(file.camera)?,
        };
        Ok(description)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneKeys {
    environment: Option<EnvironmentKeys>,
    exposure_ev: Option<Spanned<f32>>,
    #[serde(default)]
    floor: bool,
    #[serde(default)]
    model: Vec<ModelKeys>,
    #[serde(default)]
    light: Vec<LightKeys>,
    #[serde(default)]
    probe: Vec<ProbeKeys>,
    #[serde(default)]
    camera: Vec<CameraKeys>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EnvironmentKeys {
    panorama: Spanned<String>,
    rotation_degrees: Option<Spanned<f32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelKeys {
    file: Spanned<String>,
    translation: Option<Spanned<[f32; 3]>>,
    rotation_degrees: Option<Spanned<[f32; 3]>>,
    scale: Option<Spanned<f32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LightKeys {
    point: PointKeys,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PointKeys {
    position: Spanned<[f32; 3]>,
    intensity: Spanned<[f32; 3]>,
    radius: Option<Spanned<f32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProbeKeys {
    position: Spanned<[f32; 3]>,
    /// Its least and its largest corner.
    r#box: Spanned<[[f32; 3]; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraKeys {
    name: Spanned<String>,
    position: Spanned<[f32; 3]>,
    target: Spanned<[f32; 3]>,
    vertical_fov_degrees: Option<Spanned<f32>>,
}

/// Checks values; knows the text for the line numbers of errors.
struct Check<'a> {
    path: &'a Path,
    text: &'a str,
}

/// A number, or three.
trait Finite {
    fn is_finite_number(&self) -> bool;
    fn largest(&self) -> f32;
}

impl Finite for f32 {
    fn is_finite_number(&self) -> bool {
        self.is_finite()
    }

    fn largest(&self) -> f32 {
        self.abs()
    }
}

impl Finite for [f32; 3] {
    fn is_finite_number(&self) -> bool {
        self.iter().all(|v| v.is_finite())
    }

    fn largest(&self) -> f32 {
        self.iter().fold(0.0, |most, v| v.abs().max(most))
    }
}

impl Finite for [[f32; 3]; 2] {
    fn is_finite_number(&self) -> bool {
        self.iter().all(Finite::is_finite_number)
    }

    fn largest(&self) -> f32 {
        self[0].largest().max(self[1].largest())
    }
}

impl Check<'_> {
    fn error<T>(&self, key: &str, value: &Spanned<T>, problem: impl Into<String>) -> Error {
        let line = line_at(self.text, value.span().start);
        Error::SceneKey { path: self.path.into(), line, key: key.into(), problem: problem.into() }
    }

    fn finite<T: Finite + Copy>(&self, key: &str, value: &Spanned<T>) -> Result<T> {
        let ok = value.get_ref().is_finite_number();
        if ok { Ok(*value.get_ref()) } else { Err(self.error(key, value, "a number must be finite")) }
    }

    fn optional<T: Finite + Copy>(&self, key: &str, value: Option<Spanned<T>>, default: T) -> Result<T> {
        value.map_or(Ok(default), |value| self.finite(key, &value))
    }

    /// A value whose numbers have a magnitude of at most `most`.
    fn within<T: Finite + Copy>(&self, most: f32, key: &str, value: Option<Spanned<T>>, default: T) -> Result<T> {
        let Some(value) = value else { return Ok(default) };
        let number = self.finite(key, &value)?;
        let ok = number.largest() <= most;
        if ok { Ok(number) } else { Err(self.error(key, &value, format!("it is beyond {most:e}"))) }
    }

    fn place(&self, key: &str, value: Spanned<[f32; 3]>) -> Result<Vec3> {
        self.within(MAX_LENGTH, key, Some(value), [0.0; 3]).map(Vec3::from_array)
    }

    fn file(&self, folder: &Path, key: &str, name: &Spanned<String>) -> Result<PathBuf> {
        let text = name.get_ref().replace('\\', "/");
        let path = match text.strip_prefix(LARGE_SCENES) {
            Some(rest) => shipped::large_scenes().map_err(|e| self.error(key, name, e.to_string()))?.join(rest),
            None if text.starts_with('$') => {
                return Err(self.error(key, name, format!("only `{LARGE_SCENES}` can begin with `$`")));
            }
            None => folder.join(&text),
        };
        let data = path.metadata();
        if !text.is_empty() && data.as_ref().is_ok_and(Metadata::is_file) {
            return Ok(path);
        }
        let remedy = if text.contains(char::is_control) {
            // An escape such as `\n` or `\t` was meant as a part of the path.
            format!("; {BACKSLASH}")
        } else if text.starts_with(LARGE_SCENES) {
            LARGE_SCENES_REMEDY.into()
        } else {
            String::new()
        };
        let place = shortened(&path.display().to_string(), MAX_MESSAGE);
        let problem = match data {
            // A disk that fails is not a name that is wrong.
            Err(e) if !matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                format!("{place} cannot be read: {e}{remedy}")
            }
            _ => format!("there is no file {place}{remedy}"),
        };
        Err(self.error(key, name, problem))
    }

    fn environment(&self, folder: &Path, keys: EnvironmentKeys) -> Result<EnvironmentFile> {
        Ok(EnvironmentFile {
            panorama: self.file(folder, "panorama", &keys.panorama)?,
            rotation_degrees: self.optional("rotation_degrees", keys.rotation_degrees, 0.0)?,
        })
    }

    fn model(&self, folder: &Path, keys: ModelKeys) -> Result<ModelFile> {
        let scale = self.within(MAX_LENGTH, "scale", keys.scale.clone(), 1.0)?;
        if let Some(value) = keys.scale.filter(|_| scale < 1.0 / MAX_LENGTH) {
            let problem =
                if scale > 0.0 { format!("it is below {:e}", 1.0 / MAX_LENGTH) } else { "it must be above 0".into() };
            return Err(self.error("scale", &value, problem));
        }
        let [x, y, z] = self.optional("rotation_degrees", keys.rotation_degrees, [0.0; 3])?.map(f32::to_radians);
        let rotation = Quat::from_euler(EulerRot::XYZ, x, y, z);
        let translation = keys.translation.map_or(Ok(Vec3::ZERO), |value| self.place("translation", value))?;
        Ok(ModelFile {
            file: self.file(folder, "file", &keys.file)?,
            world_from_local: Mat4::from_scale_rotation_translation(Vec3::splat(scale), rotation, translation),
        })
    }

    fn light(&self, keys: PointKeys) -> Result<PointLight> {
        let intensity = Vec3::from_array(self.finite("intensity", &keys.intensity)?);
        if intensity.min_element() < 0.0 {
            return Err(self.error("intensity", &keys.intensity, "light cannot be negative"));
        }
        let radius = self.within(MAX_RADIUS, "radius", keys.radius.clone(), 0.0)?;
        if let Some(value) = keys.radius.filter(|_| radius < 0.0) {
            return Err(self.error("radius", &value, "a radius cannot be negative"));
        }
        Ok(PointLight { position: self.place("position", keys.position)?, intensity, radius, cone: None })
    }

    fn probes(&self, all: Vec<ProbeKeys>) -> Result<Vec<Probe>> {
        if let Some(one_more) = all.get(MOST_PROBES) {
            return Err(self.error("position", &one_more.position, format!("there may be {MOST_PROBES} probes")));
        }
        all.into_iter().map(|keys| self.probe(keys)).collect()
    }

    fn probe(&self, keys: ProbeKeys) -> Result<Probe> {
        let [min, max] = self.within(MAX_LENGTH, "box", Some(keys.r#box.clone()), [[0.0; 3]; 2])?.map(Vec3::from_array);
        if !min.cmplt(max).all() {
            return Err(self.error("box", &keys.r#box, "its first corner must be below its second on every axis"));
        }
        let position = self.place("position", keys.position.clone())?;
        if position.cmplt(min).any() || position.cmpgt(max).any() {
            return Err(self.error("position", &keys.position, "the probe lies outside of its box"));
        }
        Ok(Probe { position, bounds: Bounds { min, max }, thing: None })
    }

    fn cameras(&self, all: Vec<CameraKeys>) -> Result<Vec<Camera>> {
        let mut names = HashSet::new();
        let mut cameras: Vec<Camera> = Vec::new();
        for keys in all {
            if !names.insert(keys.name.get_ref().clone()) {
                return Err(self.error(
                    "name",
                    &keys.name,
                    format!("there are two cameras `{}`", one_line(keys.name.get_ref(), MAX_QUOTED)),
                ));
            }
            cameras.push(self.camera(keys)?);
        }
        Ok(cameras)
    }

    fn camera(&self, keys: CameraKeys) -> Result<Camera> {
        let position = self.place("position", keys.position)?;
        let target = self.place("target", keys.target.clone())?;
        if position == target {
            return Err(self.error("target", &keys.target, "the camera stands on its target"));
        }
        let fov = self.optional("vertical_fov_degrees", keys.vertical_fov_degrees.clone(), DEFAULT_FOV_DEGREES)?;
        if let Some(value) = keys.vertical_fov_degrees.filter(|_| fov <= 0.0 || fov >= 180.0) {
            return Err(self.error("vertical_fov_degrees", &value, "it must be above 0 and below 180"));
        }
        Ok(Camera { name: keys.name.into_inner(), position, target, vertical_fov_degrees: fov })
    }
}

fn line_at(text: &str, byte: usize) -> usize {
    text.bytes().take(byte).filter(|b| *b == b'\n').count() + 1
}

/// The message of `toml`, with long keys shortened, and with a remedy for common mistakes.
fn explain(message: &str, key: &str) -> String {
    let message = shortened(&message.replace(key, &shortened(key, MAX_QUOTED)), MAX_MESSAGE);
    if message.contains("expected a sequence") && ["model", "light", "probe", "camera"].contains(&key) {
        format!("there may be several: write `[[{key}]]` instead of `[{key}]`")
    } else if message.contains("escape") || message.contains("unicode value") {
        format!("{message}; {BACKSLASH}")
    } else {
        message
    }
}

/// The key at a byte of the text, or the key whose value is there; for a table its name.
fn key_at(text: &str, byte: usize) -> String {
    let is_key = |c: char| c.is_alphanumeric() || c == '_' || c == '-' || c == '.' || c == '"';
    let byte = (0..=byte.min(text.len())).rev().find(|b| text.is_char_boundary(*b)).unwrap_or(0);
    let (before, after) = text.split_at(byte);
    let here: String = after.trim_start_matches('[').chars().take_while(|c| is_key(*c)).collect();
    let rest = after.trim_start_matches('[').trim_start_matches(is_key).trim_start();
    if !here.is_empty() && rest.starts_with(['=', ']']) && (rest.starts_with('=') || after.starts_with('[')) {
        return here;
    }
    let line = before.rsplit('\n').next().unwrap_or("");
    let head = line.rsplit_once('=').map_or(line, |(head, _)| head).trim_end();
    let start = head.rfind(|c| !is_key(c)).map_or(0, |i| i + head[i..].chars().next().map_or(0, char::len_utf8));
    if head[start..].is_empty() { here } else { head[start..].to_owned() }
}

#[cfg(test)]
#[path = "description_tests.rs"]
mod tests;
