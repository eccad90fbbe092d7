//! Sheen of cloth: lamps against f64, even light, pictures against the exact ones, the mean of a texture, what a lightmap gives back.

use glam::DVec3;
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::brdf::{Geometry, specular};
use pbr_vr::reference::energy::{Curve, Energy, Scattering};
use pbr_vr::reference::sheen::{sheen_albedo, sheen_brdf, under_sheen};
use pbr_vr::render::Shading;
use serde_json::{Value, json};

use crate::common::brdf::slanted;
use crate::common::gltf::{Gltf, Shape};
use crate::common::{PictureOptions, Workshop, mean_colour, pixel};

const SIDE: u32 = 33;
const COLOR: [f64; 3] = [0.9, 0.5, 0.2];

/// A cloth with a base of one gray; `sheen`: the extension.
fn cloth(gray: f64, roughness: f64, sheen: &Value) -> Value {
    json!({
        "pbrMetallicRoughness": {"baseColorFactor": [gray, gray, gray, 1], "metallicFactor": 0, "roughnessFactor": roughness},
        "extensions": {"KHR_materials_sheen": sheen},
    })
}

fn sheen(roughness: f64) -> Value {
    json!({"sheenColorFactor": COLOR, "sheenRoughnessFactor": roughness})
}

/// A plate that fills the picture, seen from far away along -v, with what the description says more.
fn picture(
    shop: &Workshop,
    gltf: &mut Gltf,
    material: usize,
    v: DVec3,
    more: &str,
    options: &PictureOptions<'_>,
) -> Picture {
    gltf.show(&Shape::plate([-0.5, 0.5], [-0.5, 0.5], 0.0), material);
    gltf.write(shop, "cloth.gltf");
    shop.seen_from_afar("cloth.gltf", v, more, options)
}

/// The same of a material alone.
fn plain(shop: &Workshop, material: Value, v: DVec3, more: &str, options: &PictureOptions<'_>) -> Picture {
    let mut gltf = Gltf::new();
    let material = gltf.material(material);
    picture(shop, &mut gltf, material, v, more, options)
}

#[test]
fn a_lamp_on_cloth_is_what_f64_says() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    let (away, gray, roughness) = (2.0, 0.5, 0.9);
    let energy = Energy::new(roughness, Geometry::Smith, Scattering::Single);
    let curve = Curve::new(roughness, Geometry::Smith);
    let base_color = DVec3::splat(gray);
    for (sheen_roughness, v, l) in [
        (0.5, DVec3::Z, slanted(0.7, 3.3)),
        (0.3, slanted(0.3, 1.0), slanted(0.4, 1.2)),
        (1.0, slanted(0.4, 1.0), slanted(0.9, 0.2)),
        (0.2, slanted(0.2, 1.0), slanted(0.2, 4.2)),
    ] {
        let [x, y, z] = (away * l).to_array();
        let lamp = format!("[[light]]\npoint = {{ position = [{x}, {y}, {z}], intensity = [40, 40, 40] }}\n");
        let material = cloth(gray, roughness, &sheen(sheen_roughness));
        let fresnel = energy.dielectric;
        let beyond = energy.beyond_single(base_color, 0.0, curve.at(l.z), curve.at(v.z));
        let below = specular(DVec3::Z, v, l, fresnel, roughness, Geometry::Smith) + beyond;
        let color = DVec3::from(COLOR);
        let left = under_sheen(color, sheen_albedo(v.z, sheen_roughness));
        let want = 40.0 / (away * away) * l.z * (left * below + color * sheen_brdf(DVec3::Z, v, l, sheen_roughness));
        for (shading, frames) in [(Shading::Pbr, 1), (Shading::Reference, 1)] {
            let picture = plain(&shop, material.clone(), v, &lamp, &PictureOptions::open(SIDE, shading, frames));
            let got = DVec3::from(pixel(&picture, SIDE / 2, SIDE / 2));
            let off = (got / want - 1.0).abs().max_element();
            assert!(off < 8e-3, "{sheen_roughness}, v {v:.2}, l {l:.2}, {shading:?}: {got} against {want}");
        }
    }
}

/// What a white sheen scatters is what a white base loses, as far as the albedo's fit goes.
#[test]
fn under_even_light_white_sheen_on_white_is_white() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    for (roughness, nv) in [(0.2, 0.1), (0.5, 0.3), (0.3, 0.8), (1.0, 0.2)] {
        let sheen = json!({"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": roughness});
        for (shading, frames, bound) in [(Shading::Pbr, 1, 0.006), (Shading::Reference, 32, 0.025)] {
            let got = mean_colour(&plain(
                &shop,
                cloth(1.0, 0.7, &sheen),
                slanted(nv, 0.5),
                "",
                &PictureOptions::open(SIDE, shading, frames),
            ))
            .x;
            assert!((got - 1.0).abs() < bound, "{roughness} {nv} {shading:?}: {got}");
        }
    }
}

/// Sheen comes from the viewer's side, which is several times as bright here as the other.
#[test]
fn sheen_of_a_panorama_is_that_of_the_exact_picture() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 128, |d| {
        [0.2 + 2.0 * d[0].max(0.0) as f32, 0.5 + 0.4 * d[1] as f32, 1.0 + 0.9 * d[2] as f32]
    });
    for (roughness, nv, bound) in [(0.3, 0.2, 0.06), (0.5, 0.3, 0.06), (0.5, 0.7, 0.06), (0.9, 0.4, 0.06)] {
        let [fast, exact] =
            [PictureOptions::open(SIDE, Shading::Pbr, 1), PictureOptions::open(SIDE, Shading::Reference, 64)].map(
                |options| {
                    // Black, so that what is not sheen is little.
                    let mut black = cloth(0.0, 1.0, &sheen(roughness));
                    black["extensions"]["KHR_materials_ior"] = json!({"ior": 1});
                    mean_colour(&plain(&shop, black, slanted(nv, 0.0), "", &options))
                },
            );
        println!("roughness {roughness}, n.v {nv}: {fast:.4} against {exact:.4}");
        let off = ((fast - exact) / exact).abs().max_element();
        assert!(off < bound, "{roughness} {nv}: {fast} against {exact}");
    }
}
