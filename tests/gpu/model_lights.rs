//! Lights of models on a plane, against the formula of KHR_lights_punctual in f64: point, spot and directional lights.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use pbr_vr::reference::brdf::{DIELECTRIC_F0, Geometry, f0_from_metallic, specular};
use pbr_vr::reference::energy::{Curve, Energy, Scattering};
use pbr_vr::render::{LightModel, Shading};
use serde_json::{Value, json};

use crate::common::Workshop;
use crate::common::colour::{EYE_Z, Look, assert_near, loaded, on_plane, see};
use crate::common::gltf::{Gltf, Shape};
use crate::common::stage::with_gpu;

const BASE: f64 = 0.5;
const COLOUR: [f64; 3] = [1.0, 0.5, 0.25];

/// A dull plane at z = 0.
fn plane_alone() -> Gltf {
    let mut gltf = Gltf::new();
    let material = gltf.material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [BASE, BASE, BASE, 1], "metallicFactor": 0, "roughnessFactor": 1},
        "doubleSided": true,
    }));
    gltf.show(&Shape::plate([-3.0, 3.0], [-3.0, 3.0], 0.0), material);
    gltf
}

/// The same under one light.
fn plane(shop: &Workshop, light: Value, node: Value) -> std::path::PathBuf {
    let mut gltf = plane_alone();
    gltf.light(light, node);
    gltf.write(shop, "light.gltf")
}

/// The BRDF of that plane in f64, for directions from a point.
struct Dull {
    energy: Energy,
    curve: Curve,
}

impl Dull {
    fn new() -> Self {
        let energy = Energy::new(1.0, Geometry::Smith, Scattering::Multiple);
        Self { energy, curve: Curve::new(1.0, Geometry::Smith) }
    }

    fn value(&self, l: DVec3, v: DVec3) -> f64 {
        let f0 = f0_from_metallic(DVec3::splat(BASE), 0.0, DIELECTRIC_F0);
        let [at_l, at_v] = [l, v].map(|d| self.curve.at(d.z));
        let beyond = self.energy.beyond_single(DVec3::splat(BASE), 0.0, at_l, at_v);
        (specular(DVec3::Z, v, l, f0, 1.0, Geometry::Smith) + beyond).x
    }

    /// Radiance at a point of the plane towards the eye.
    fn radiance(&self, point: DVec3, l: DVec3, irradiance: f64) -> DVec3 {
        let v = (DVec3::Z * EYE_Z - point).normalize();
        DVec3::from(COLOUR) * (irradiance * l.z.max(0.0) * self.value(l, v))
    }
}

/// The share of a spot light's intensity at an angle from its axis.
fn spot_share(cosine: f64, inner: f64, outer: f64) -> f64 {
    let scale = 1.0 / (inner.cos() - outer.cos()).max(0.001);
    let linear = (cosine * scale - outer.cos() * scale).clamp(0.0, 1.0);
    linear * linear
}

const LOOKS: [(LightModel, Shading); 6] = [
    (LightModel::Open, Shading::Pbr),
    (LightModel::Direct, Shading::Pbr),
    (LightModel::Baked, Shading::Pbr),
    (LightModel::Open, Shading::Reference),
    (LightModel::Direct, Shading::Reference),
    (LightModel::Baked, Shading::Reference),
];

fn assert_lit(case: &str, light: Value, node: Value, want: impl Fn(DVec3) -> DVec3, slack: f64) {
    let shop = Workshop::new();
    let path = plane(&shop, light, node);
    with_gpu(|gpu| {
        let scene = loaded(&path, 0.0);
        for (light, shading) in LOOKS {
            let is_reference = shading == Shading::Reference;
            let frames = if is_reference { 32 } else { 1 };
            let seen = see(gpu, &scene, Look { light, shading, frames, ..Look::default() });
            let (mut lit, mut sum, mut wanted) = (0, DVec3::ZERO, DVec3::ZERO);
            for (x, y) in (0..64).step_by(7).flat_map(|y| (0..64).step_by(7).map(move |x| (x, y))) {
                let point = on_plane(x, y, 64, 0.0).extend(0.0);
                let want = want(point);
                let case = format!("{case}, {light:?}, {shading:?} at {point}");
                // The reference is drawn at random.
                assert_near(&case, seen.at(x, y), want, 1.5e-3, if is_reference { 1.0 } else { slack });
                lit += u32::from(want.x > 0.01);
                (sum, wanted) = (sum + seen.at(x, y), wanted + want);
            }
            let error = seen.error.map_or(0.0, |error| error.mean_relative);
            println!(
                "{case}, {light:?}, {shading:?}: {:+.3} %, a pixel ± {error:.4}",
                100.0 * (sum.x / wanted.x - 1.0)
            );
            assert_near(&format!("{case}, {light:?}, {shading:?}"), sum, wanted, 0.0, slack);
            assert!(lit > 5, "{case}: {lit}");
        }
    });
}

#[test]
fn a_point_light_falls_with_the_square_of_the_distance() {
    let dull = Dull::new();
    let at = DVec3::new(0.3, -0.2, 1.2);
    let light = json!({"type": "point", "color": COLOUR, "intensity": 7.0});
    let want = |point: DVec3| {
        let to = at - point;
        dull.radiance(point, to.normalize(), 7.0 / to.length_squared())
    };
    assert_lit("point", light, json!({"translation": at.to_array()}), want, 0.01);
}

#[test]
fn a_spot_light_falls_off_between_its_cones() {
    let dull = Dull::new();
    let (at, inner, outer) = (DVec3::new(-0.2, 0.1, 1.5), 0.2f64, 0.55f64);
    // Tilted, so that neither axis nor turn can be wrong unseen.
    let turn = DQuat::from_rotation_y(-0.15) * DQuat::from_rotation_x(0.1);
    let along = turn * DVec3::NEG_Z;
    let light = json!({
        "type": "spot", "color": COLOUR, "intensity": 9.0,
        "spot": {"innerConeAngle": inner, "outerConeAngle": outer},
    });
    let node = json!({"translation": at.to_array(), "rotation": turn.to_array(), "scale": [2, 2, 2]});
    let want = |point: DVec3| {
        let to = at - point;
        let l = to.normalize();
        let share = spot_share(-l.dot(along), inner, outer);
        dull.radiance(point, l, 9.0 * share / to.length_squared())
    };
    assert!(want(DVec3::new(1.0, 1.0, 0.0)) == DVec3::ZERO, "some of the plane is outside");
    assert_lit("spot", light, node, want, 0.015);
}

#[test]
fn a_directional_light_has_its_irradiance() {
    let dull = Dull::new();
    let turn = DQuat::from_rotation_y(0.6) * DQuat::from_rotation_x(-0.3);
    let l = turn * DVec3::Z;
    let light = json!({"type": "directional", "color": COLOUR, "intensity": 2.0 * PI});
    let want = |point: DVec3| dull.radiance(point, l, 2.0 * PI);
    // As wide as four texels of the panorama; the reference draws it at random, and `Open` by maps of the whole panorama.
    assert_lit("directional", light, json!({"rotation": turn.to_array()}), want, 0.03);
}

/// One of them is the panorama's sun; the other remains a part of the panorama.
#[test]
fn two_directional_lights_add_up() {
    let dull = Dull::new();
    let turns = [DQuat::from_rotation_y(0.6), DQuat::from_rotation_x(-0.8)];
    let shop = Workshop::new();
    let mut gltf = plane_alone();
    for (turn, intensity) in turns.iter().zip([3.0, 1.5]) {
        let light = json!({"type": "directional", "color": COLOUR, "intensity": intensity});
        gltf.light(light, json!({"rotation": turn.to_array()}));
    }
    let path = gltf.write(&shop, "suns.gltf");
    with_gpu(|gpu| {
        let scene = loaded(&path, 0.0);
        for light in [LightModel::Open, LightModel::Direct] {
            let seen = see(gpu, &scene, Look { light, ..Look::default() });
            for (x, y) in [(5, 9), (32, 32), (50, 20)] {
                let point = on_plane(x, y, 64, 0.0).extend(0.0);
                let [a, b] = turns.map(|turn| turn * DVec3::Z);
                let want = dull.radiance(point, a, 3.0) + dull.radiance(point, b, 1.5);
                assert_near(&format!("{light:?} at {point}"), seen.at(x, y), want, 0.0, 0.03);
            }
        }
    });
}
