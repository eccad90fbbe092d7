//! Maps of sheen, specular factors and the direction of highlights: each texel as a material of its own.

use glam::DVec3;
use pbr_vr::render::Shading;
use serde_json::{Value, json};

use crate::common::brdf::slanted;
use crate::common::gltf::{Gltf, Shape};
use crate::common::{PictureOptions, Workshop, pixel};

const SIDE: u32 = 32;

/// A map of two texels, side by side, and two materials that are the same without it.
struct Case {
    base: Value,
    extension: &'static str,
    texels: [[u8; 4]; 2],
    with_map: fn(&Value) -> Value,
    without: [Value; 2],
}

fn material(base: &Value, name: &str, extension: Value) -> Value {
    let mut material = base.clone();
    material["extensions"][name] = extension;
    material
}

fn cases() -> [Case; 3] {
    let plain = |color: f64, metallic: f64| {
        json!({"pbrMetallicRoughness":
            {"baseColorFactor": [color, color, color, 1], "metallicFactor": metallic, "roughnessFactor": 0.4}})
    };
    [
        Case {
            base: plain(0.1, 0.0),
            extension: "KHR_materials_sheen",
            // sRGB: 188 is half of 255 in linear light.
            texels: [[255, 188, 0, 255], [0, 0, 255, 128]],
            with_map: |map| {
                json!({"sheenColorFactor": [1, 1, 1], "sheenColorTexture": map, "sheenRoughnessFactor": 0.8,
                    "sheenRoughnessTexture": map})
            },
            without: [
                json!({"sheenColorFactor": [1, 0.503, 0], "sheenRoughnessFactor": 0.8}),
                json!({"sheenColorFactor": [0, 0, 1], "sheenRoughnessFactor": 0.4016}),
            ],
        },
        Case {
            base: plain(0.02, 0.0),
            extension: "KHR_materials_specular",
            texels: [[255, 188, 0, 255], [255, 255, 255, 51]],
            with_map: |map| json!({"specularColorTexture": map, "specularTexture": map}),
            without: [json!({"specularColorFactor": [1, 0.503, 0]}), json!({"specularFactor": 0.2})],
        },
        Case {
            base: plain(0.9, 1.0),
            extension: "KHR_materials_anisotropy",
            // Along the bitangent; along the tangent and weaker.
            texels: [[128, 255, 255, 255], [255, 128, 128, 255]],
            with_map: |map| json!({"anisotropyStrength": 0.9, "anisotropyTexture": map}),
            without: [
                json!({"anisotropyStrength": 0.9, "anisotropyRotation": std::f64::consts::FRAC_PI_2}),
                json!({"anisotropyStrength": 0.9 * 128.0 / 255.0}),
            ],
        },
    ]
}

/// The radiance of a plate's left and right half, under a panorama that is bright on one side, and a lamp.
fn halves(shop: &Workshop, of: &dyn Fn(&mut Gltf) -> Value, shading: Shading) -> [DVec3; 2] {
    let mut gltf = Gltf::new();
    let material = of(&mut gltf);
    let material = gltf.material(material);
    // Seven thousandths of it are in the picture.
    let plate = Shape::plate([-0.5, 0.5], [-0.5, 0.5], 0.0).with_uvs(0, |uv| uv.map(|at| 0.5 + 50.0 * (at - 0.5)));
    gltf.show(&plate, material);
    gltf.write(shop, "plate.gltf");
    let lamp = "[[light]]\npoint = { position = [1.0, 0.5, 2.0], intensity = [8, 8, 8] }\n";
    let frames = if shading == Shading::Pbr { 1 } else { 256 };
    let options = PictureOptions::open(SIDE, shading, frames);
    let picture = shop.seen_from_afar("plate.gltf", slanted(0.6, 0.0), lamp, &options);
    [SIDE / 4, 3 * SIDE / 4].map(|x| {
        let pixels = (SIDE / 4..3 * SIDE / 4).map(|y| DVec3::from(pixel(&picture, x, y)));
        pixels.sum::<DVec3>() / f64::from(SIDE / 2)
    })
}

#[test]
fn each_texel_of_an_extension_map_is_a_material_of_its_own() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 64, |d| [0.3 + 2.0 * d[0].max(0.0) as f32, 0.5, 0.5 + 0.4 * d[1] as f32]);
    for Case { base, extension, texels, with_map, without } in cases() {
        for (shading, bound) in [(Shading::Pbr, 0.01), (Shading::Reference, 0.02)] {
            let mapped = |gltf: &mut Gltf| {
                let picture = image::RgbaImage::from_fn(8, 8, |x, _| image::Rgba(texels[usize::from(x >= 4)]));
                let map = json!({"index": gltf.texture(&picture, json!({}))});
                material(&base, extension, with_map(&map))
            };
            let got = halves(&shop, &mapped, shading);
            let want =
                without.each_ref().map(|own| halves(&shop, &|_| material(&base, extension, own.clone()), shading));
            println!("{extension} {shading:?}: {got:.4?} against {want:.4?}");
            for half in [0, 1] {
                let off = (got[half] / want[half][half] - 1.0).abs().max_element();
                assert!(off < bound, "{extension} {shading:?} {half}: {} against {}", got[half], want[half][half]);
            }
            let apart = (want[0][0] / want[1][0] - 1.0).abs().max_element();
            assert!(apart > 4.0 * bound, "{extension}: both materials look alike: {apart}");
        }
    }
}
