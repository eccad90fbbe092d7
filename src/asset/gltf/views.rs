//! Cameras and lights of a glTF file.

use std::collections::HashSet;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{DAffine3, DMat3, DVec3, Mat4, Vec3};
use serde::Deserialize;

use super::nodes::{self, Nodes};
use super::source::Source;
use crate::Result;
use crate::asset::model::{Cone, ModelCamera, ModelLight};
use crate::error::{MAX_QUOTED, shortened};

/// The most cameras; nobody chooses among more.
const MAX_CAMERAS: usize = 1000;
const LIGHTS: &str = "KHR_lights_punctual";
/// The least difference between the angles of a cone, in radians.
const MIN_FALLOFF: f32 = 1e-4;

/// A camera, and where it is in f64.
pub struct PlacedCamera {
    pub camera: ModelCamera,
    pub at: DAffine3,
}

/// A light, and where it is in f64.
pub struct PlacedLight {
    pub light: ModelLight,
    pub at: DVec3,
}

/// The cameras of the nodes that the scene shows.
///
/// # Errors
/// One does not exist.
pub fn cameras(source: &Source<'_>, nodes: &Nodes) -> Result<Vec<PlacedCamera>> {
    let (mut cameras, mut names) = (Vec::new(), HashSet::new());
    for index in &nodes.shown {
        let node = &source.document.nodes[*index];
        let Some(number) = node.camera else { continue };
        let of = nodes::name_of(source, *index);
        if cameras.len() == MAX_CAMERAS {
            source.warn_once("cameras", &format!("{of}: it has more than {MAX_CAMERAS} cameras; others are left out"));
            break;
        }
        let Some(camera) = source.document.cameras.get(number) else {
            return Err(source.broken(format!("{of}: there is no camera {number}")));
        };
        let Some(perspective) = &camera.perspective else {
            source.warn_once("orthographic", &format!("{of}: cameras without perspective are not supported; left out"));
            continue;
        };
        let degrees = perspective.yfov.to_degrees();
        let rotation = rotation(&nodes.globals[*index].matrix3).filter(|_| degrees > 0.0 && degrees < 180.0);
        let Some(rotation) = rotation else {
            source.warn_once(format!("camera {number}"), &format!("{of}: its camera sees nothing; left out"));
            continue;
        };
        let named = [&node.name, &camera.name].into_iter().flatten().find(|name| !name.is_empty());
        let name = named.map_or_else(|| format!("camera {number}"), |name| shortened(name, MAX_QUOTED));
        let at = DAffine3::from_mat3_translation(rotation, nodes.globals[*index].translation);
        let model_from_camera = Mat4::IDENTITY;
        let camera = ModelCamera { name: unique(name, &mut names), model_from_camera, vertical_fov_degrees: degrees };
        cameras.push(PlacedCamera { camera, at });
    }
    Ok(cameras)
}

/// A name that is not among those known, which it joins.
fn unique(name: String, known: &mut HashSet<String>) -> String {
    if known.insert(name.clone()) {
        return name;
    }
    // There are more numbers than names.
    let mut number = known.len();
    loop {
        let other = format!("{name} {number}");
        if known.insert(other.clone()) {
            return other;
        }
        number += 1;
    }
}

/// The rotation of a matrix without its scale: what looks along −Z still does.
fn rotation(matrix: &DMat3) -> Option<DMat3> {
    let back = matrix.z_axis.try_normalize()?;
    let right = matrix.y_axis.cross(back).try_normalize()?;
    Some(DMat3::from_cols(right, back.cross(right), back))
}

#[derive(Deserialize)]
struct Lights {
    lights: Vec<Light>,
}

#[derive(Deserialize)]
struct Light {
    #[serde(rename = "type")]
    kind: String,
    color: Option<[f32; 3]>,
    intensity: Option<f32>,
    spot: Option<Spot>,
}

#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Spot {
    inner_cone_angle: f32,
    outer_cone_angle: f32,
}

impl Default for Spot {
    fn default() -> Self {
        Self { inner_cone_angle: 0.0, outer_cone_angle: FRAC_PI_4 }
    }
}

#[derive(Deserialize)]
struct Named {
    light: usize,
}

/// The lights of the nodes that the scene shows.
///
/// # Errors
/// One does not exist, or has values that mean nothing.
pub fn lights(source: &Source<'_>, nodes: &Nodes) -> Result<Vec<PlacedLight>> {
    let all: Option<Lights> = source.extension("its lights", &source.document.extensions, LIGHTS)?;
    let all = all.map_or(Vec::new(), |all| all.lights);
    let mut lights = Vec::new();
    for index in &nodes.shown {
        let of = nodes::name_of(source, *index);
        let extensions = &source.document.nodes[*index].extensions;
        let Some(Named { light }) = source.extension(&of, extensions, LIGHTS)? else { continue };
        let Some(own) = all.get(light) else {
            return Err(source.broken(format!("{of}: there is no light {light}")));
        };
        let global = &nodes.globals[*index];
        match own.placed(global) {
            Some(light) => lights.push(PlacedLight { light, at: global.translation }),
            None => source.warn_once(format!("light {light}"), &format!("{of}: its light shines nowhere; left out")),
        }
    }
    Ok(lights)
}

impl Light {
    /// `None`: it has no direction, no kind that is known, or no light. Its position is not set.
    fn placed(&self, global: &DAffine3) -> Option<ModelLight> {
        let power = Vec3::from(self.color.unwrap_or([1.0; 3])) * self.intensity.unwrap_or(1.0);
        if !power.is_finite() || power.min_element() < 0.0 {
            return None;
        }
        let back = global.matrix3.z_axis.try_normalize().map(|back| back.as_vec3());
        let point = |cone| ModelLight::Point { position: Vec3::ZERO, intensity: power, cone };
        match self.kind.as_str() {
            "point" => Some(point(None)),
            "directional" => Some(ModelLight::Directional { towards: back?, irradiance: power }),
            "spot" => Some(point(Some(cone(-back?, self.spot.as_ref().unwrap_or(&Spot::default()))))),
            _ => None,
        }
    }
}

fn cone(along: Vec3, spot: &Spot) -> Cone {
    let outer = spot.outer_cone_angle.clamp(MIN_FALLOFF, FRAC_PI_2);
    Cone { along, inner: spot.inner_cone_angle.clamp(0.0, outer - MIN_FALLOFF), outer }
}
