//! Lights of model files in a scene: point lights beside its own, directional ones as suns of its panorama.

use glam::{Quat, Vec3};

use super::{Environment, PointLight};
use crate::asset::Panorama;
use crate::asset::model::ModelLight;
use crate::reference::cube::panorama_texel_solid_angle;

/// A panorama that gets a sun is at least this wide, in texels.
const LEAST_WIDTH: u32 = 1024;

/// The point and spot lights among them.
pub fn point_lights(lights: &[ModelLight]) -> impl Iterator<Item = PointLight> {
    lights.iter().filter_map(|light| match *light {
        ModelLight::Point { position, intensity, cone } => Some(PointLight { position, intensity, radius: 0.0, cone }),
        ModelLight::Directional { .. } => None,
    })
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
    fn a_scene_without_them_keeps_its_panorama() {
        let mut environment = Environment { panorama: Panorama::uniform(Vec3::ONE), rotation_degrees: 0.0 };
        let point = ModelLight::Point { position: Vec3::X, intensity: Vec3::ONE, cone: None };
        add_directional(&mut environment, &[point]);
        assert_eq!(environment.panorama, Panorama::uniform(Vec3::ONE));
        assert_eq!(point_lights(&[point]).count(), 1);
    }
}
