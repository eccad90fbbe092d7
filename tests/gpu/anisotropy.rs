//! Stretched highlights: lamps against f64, even light, pictures against the exact ones.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::brdf::{
    Geometry, d_ggx_stretched, f_schlick, round_roughness, stretched_alphas, v_smith_stretched,
};
use pbr_vr::reference::energy::{Curve, Energy, Scattering};
use pbr_vr::render::Shading;
use serde_json::{Value, json};

use crate::common::brdf::slanted;
use crate::common::gltf::{Gltf, Shape};
use crate::common::{PictureOptions, Workshop, mean_colour, pixel};

const SIDE: u32 = 33;
const GOLD: [f64; 3] = [1.0, 0.75, 0.35];

/// Brushed metal.
fn brushed(color: [f64; 3], roughness: f64, strength: f64, rotation: f64) -> Value {
    let [r, g, b] = color;
    json!({
        "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1], "metallicFactor": 1, "roughnessFactor": roughness},
        "extensions": {"KHR_materials_anisotropy": {"anisotropyStrength": strength, "anisotropyRotation": rotation}},
    })
}

/// A plate that fills the picture, seen from far away along -v; its tangent is +x. `more`: of the description.
fn picture(shop: &Workshop, material: Value, v: DVec3, more: &str, options: &PictureOptions<'_>) -> Picture {
    let mut gltf = Gltf::new();
    let material = gltf.material(material);
    gltf.show(&Shape::plate([-0.5, 0.5], [-0.5, 0.5], 0.0), material);
    gltf.write(shop, "metal.gltf");
    shop.seen_from_afar("metal.gltf", v, more, options)
}

/// A direction in the frame whose x is turned by `rotation` from the tangent.
fn turned(d: DVec3, rotation: f64) -> DVec3 {
    DVec2::from_angle(-rotation).rotate(d.truncate()).extend(d.z)
}

#[test]
fn a_lamp_on_brushed_metal_is_what_f64_says() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    let away = 2.0;
    for (roughness, strength, rotation, v, l) in [
        (0.3, 0.8, 0.0, slanted(0.8, 0.4), slanted(0.7, 3.3)),
        (0.3, 0.8, FRAC_PI_2, slanted(0.8, 0.4), slanted(0.7, 3.3)),
        (0.5, 1.0, 0.7, slanted(0.3, 1.0), slanted(0.6, 2.2)),
        (0.6, 0.5, -0.4, DVec3::Z, slanted(0.5, 0.2)),
    ] {
        let alphas = stretched_alphas(roughness * roughness, strength);
        let round = round_roughness(alphas);
        let energy = Energy::new(round, Geometry::Smith, Scattering::Multiple);
        let curve = Curve::new(round, Geometry::Smith);
        let color = DVec3::from(GOLD);
        let [own_v, own_l] = [v, l].map(|d| turned(d, rotation));
        let lobe = d_ggx_stretched(own_v + own_l, alphas) * v_smith_stretched(own_l, own_v, alphas);
        let single = f_schlick(color, 0.5 * (v + l).length()) * lobe;
        let beyond = energy.beyond_single(color, 1.0, curve.at(l.z), curve.at(v.z));
        let want = 40.0 / (away * away) * l.z * (single + beyond);
        let [x, y, z] = (away * l).to_array();
        let lamp = format!("[[light]]\npoint = {{ position = [{x}, {y}, {z}], intensity = [40, 40, 40] }}\n");
        for shading in [Shading::Pbr, Shading::Reference] {
            let material = brushed(GOLD, roughness, strength, rotation);
            let picture = picture(&shop, material, v, &lamp, &PictureOptions::open(SIDE, shading, 1));
            let got = DVec3::from(pixel(&picture, SIDE / 2, SIDE / 2));
            let off = (got / want - 1.0).abs().max_element();
            assert!(off < 1e-2, "{roughness} {strength} {rotation:.1}, {shading:?}: {got} against {want}");
        }
    }
}

/// What is scattered more than once is that of a round lobe, whose albedo is near to that of the stretched one.
#[test]
fn under_even_light_white_brushed_metal_is_white() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    for (roughness, strength, v) in
        [(0.2, 0.8, slanted(0.5, 0.0)), (0.5, 0.5, slanted(0.9, 1.5)), (0.3, 1.0, slanted(0.4, 0.8))]
    {
        for (shading, frames, bound) in [(Shading::Pbr, 1, 0.006), (Shading::Reference, 32, 0.1)] {
            let material = brushed([1.0; 3], roughness, strength, 0.3);
            let got = mean_colour(&picture(&shop, material, v, "", &PictureOptions::open(SIDE, shading, frames))).x;
            println!("{roughness} {strength} {shading:?}: {got}");
            assert!((got - 1.0).abs() < bound, "{roughness} {strength} {shading:?}: {got}");
        }
    }
}

/// A band of light across x, which only highlights that are stretched across it lead towards the eye from its sides.
#[test]
fn brushed_metal_mirrors_a_panorama_as_the_exact_picture() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 128, |d| {
        let band = (1.0 - 4.0 * (d[0] - 0.5).abs()).max(0.0) as f32;
        [0.1 + 4.0 * band, 0.2 + 2.0 * band, 0.3 + band]
    });
    let v = slanted(0.8, 0.3);
    let of = |rotation, shading, frames| {
        let material = brushed(GOLD, 0.3, 0.8, rotation);
        mean_colour(&picture(&shop, material, v, "", &PictureOptions::open(SIDE, shading, frames)))
    };
    let exact = [0.0, FRAC_PI_2].map(|rotation| of(rotation, Shading::Reference, 64));
    assert!((exact[0].x / exact[1].x - 1.0).abs() > 0.3, "the direction does not matter: {exact:?}");
    for (rotation, exact) in [0.0, FRAC_PI_2].into_iter().zip(exact) {
        let fast = of(rotation, Shading::Pbr, 1);
        println!("{rotation:.1}: {fast:.4} against {exact:.4}");
        assert!(((fast - exact) / exact).abs().max_element() < 0.1, "{rotation}: {fast} against {exact}");
    }
}
