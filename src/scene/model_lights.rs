//! Lights of model files in a scene: point lights beside its own, directional ones as suns of its panorama.

use std::f32::consts::PI;

use glam::{Quat, Vec3};

use super::{Bounds, Environment, PointLight};
use crate::asset::model::ModelLight;
use crate::asset::{Panorama, Report};
use crate::reference::cube::panorama_texel_solid_angle;

/// A panorama that gets a sun is at least this wide, in texels.
const LEAST_WIDTH: u32 = 1024;
/// Lights that give this many times as much as the panorama are taken to have another unit; the sun gives about ten times as
/// much as a blue sky.
const BRIGHTER: f32 = 100.0;

/// The point and spot lights among them.
pub fn point_lights(lights: &[ModelLight]) -> impl Iterator<Item = PointLight> {
    lights.iter().filter_map(|light| match *light {
        ModelLight::Point { position, intensity, cone } => Some(PointLight { position, intensity, radius: 0.0, cone }),
        ModelLight::Directional { .. } => None,
    })
}

/// Warns where lights are so much brighter than the panorama that they come from a program with other units: many export
/// lamps in candela and lux, 683 times as many as watts, beside emission and panoramas that have no unit.
pub fn warn_of_units(lights: &[ModelLight], bounds: Bounds, panorama: &Panorama, report: &Report) {
    let radius = bounds.radius().max(f32::MIN_POSITIVE);
    let irradiance = |light: &ModelLight| match light {
        ModelLight::Point { intensity, .. } => intensity.max_element() / (radius * radius),
        ModelLight::Directional { irradiance, .. } => irradiance.max_element(),
    };
    let brightest = lights.iter().map(irradiance).fold(0.0, f32::max);
    let sky = PI * mean_radiance(panorama);
    let stops = (sky / brightest).log2().round();
    if sky > 0.0 && brightest > BRIGHTER * sky {
        report.warn(format!(
            "its lights are {:.0} times as bright as the panorama; if they were exported in candela and lux, try --exposure {stops}",
            brightest / sky
        ));
    }
}

/// The largest channel's mean over the sphere, of some of the texels.
fn mean_radiance(panorama: &Panorama) -> f32 {
    let size = [panorama.width, panorama.height];
    let steps = size.map(|side| side.div_ceil(256) as usize);
    let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
    for y in (0..size[1]).step_by(steps[1]) {
        let angle = panorama_texel_solid_angle(y, size) as f32;
        for x in (0..size[0]).step_by(steps[0]) {
            sum += angle * Vec3::from(panorama.texels[(y * size[0] + x) as usize]);
            weight += angle;
        }
    }
    (sum / weight).max_element()
}

/// Adds the directional lights to the panorama, each as the four texels around its direction, with its irradiance: from
/// there the sun is found as that of any panorama is.
pub fn add_directional(environment: &mut Environment, lights: &[ModelLight]) {
    let panorama_from_world = Quat::from_rotation_y(-environment.rotation_degrees.to_radians());
    for light in lights {
        let ModelLight::Directional { towards, irradiance } = *light else { continue };
        if environment.panorama.width < LEAST_WIDTH {
            environment.panorama = enlarged(&environment.panorama);
        }
        add_sun(&mut environment.panorama, panorama_from_world * towards, irradiance);
    }
}

/// The same panorama with each texel repeated.
fn enlarged(panorama: &Panorama) -> Panorama {
    let times = LEAST_WIDTH.div_ceil(panorama.width);
    let (width, height) = (panorama.width * times, panorama.height * times);
    let texel = |x: u32, y: u32| panorama.texels[(y / times * panorama.width + x / times) as usize];
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
    Panorama { name: panorama.name.clone(), width, height, texels }
}

/// `irradiance`: of a surface that faces the light, W/m².
fn add_sun(panorama: &mut Panorama, towards: Vec3, irradiance: Vec3) {
    let size = [panorama.width, panorama.height];
    let at = Panorama::uv(towards) * glam::UVec2::from(size).as_vec2() - 0.5;
    let (low, part) = (at.floor(), at - at.floor());
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let weight = (if dx == 0 { 1.0 - part.x } else { part.x }) * (if dy == 0 { 1.0 - part.y } else { part.y });
        let x = (low.x as i64 + dx).rem_euclid(i64::from(size[0])) as u32;
        // Beyond a pole the nearest row, which touches it.
        let y = (low.y as i64 + dy).clamp(0, i64::from(size[1]) - 1) as u32;
        let radiance = irradiance * weight / panorama_texel_solid_angle(y, size) as f32;
        let texel = &mut panorama.texels[(y * size[0] + x) as usize];
        *texel = (Vec3::from(*texel) + radiance).to_array();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::sun::find_sun;

    #[test]
    fn a_directional_light_is_the_panoramas_sun() {
        for (towards, rotation_degrees) in [(Vec3::new(1.0, 2.0, -0.5), 0.0), (Vec3::new(-3.0, 0.1, 1.0), 75.0)] {
            let towards = towards.normalize();
            let mut environment = Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees };
            let irradiance = Vec3::new(3.0, 2.0, 1.0);
            add_directional(&mut environment, &[ModelLight::Directional { towards, irradiance }]);
            let panorama = &environment.panorama;
            let sun = find_sun([panorama.width, panorama.height], &panorama.texels).unwrap().sun;
            let turned = Quat::from_rotation_y(rotation_degrees.to_radians()) * sun.direction.as_vec3();
            assert!(turned.angle_between(towards).to_degrees() < 0.1, "{turned} is not {towards}");
            assert!((sun.irradiance.as_vec3() - irradiance).abs().max_element() < 0.01, "{}", sun.irradiance);
        }
    }

    #[test]
    fn lights_in_another_unit_are_warned_of() {
        let bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE };
        let sky = Panorama::uniform(Vec3::ONE);
        let warnings = |light| {
            let report = Report::silent();
            warn_of_units(&[light], bounds, &sky, &report);
            report.warnings()
        };
        let sun = |irradiance| ModelLight::Directional { towards: Vec3::Y, irradiance: Vec3::splat(irradiance) };
        assert_eq!(warnings(sun(30.0)), [""; 0]);
        let [warning] = &warnings(sun(3.0 * 683.0))[..] else { panic!("no warning") };
        assert!(warning.contains("652 times") && warning.ends_with("--exposure -9"), "{warning}");
        let lamp = ModelLight::Point { position: Vec3::ZERO, intensity: Vec3::splat(1000.0), cone: None };
        assert_eq!(warnings(lamp).len(), 1);
    }

    #[test]
    fn a_scene_without_them_keeps_its_panorama() {
        let mut environment = Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees: 0.0 };
        let point = ModelLight::Point { position: Vec3::X, intensity: Vec3::ONE, cone: None };
        add_directional(&mut environment, &[point]);
        assert_eq!(environment.panorama, Panorama::uniform(Vec3::ONE));
        assert_eq!(point_lights(&[point]).count(), 1);
    }
}
