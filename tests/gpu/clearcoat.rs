//! Clear coats: lamps against f64, even light, pictures against the exact ones, a coat over a part, bumps below it.

use glam::DVec3;
use pbr_vr::asset::picture::Picture;
use pbr_vr::reference::brdf::{Geometry, specular};
use pbr_vr::reference::clearcoat::Clearcoat;
use pbr_vr::reference::energy::{Curve, Energy, Scattering};
use pbr_vr::render::Shading;
use serde_json::json;

use crate::common::brdf::slanted;
use crate::common::gltf::{Gltf, Shape};
use crate::common::{PictureOptions, Workshop, material, mean_colour, pixel, square};

const SIDE: u32 = 33;

/// A square that fills the picture, seen from far away along -v, with what the description says more.
fn picture(shop: &Workshop, mtl: &str, v: DVec3, more: &str, options: &PictureOptions<'_>) -> Picture {
    shop.write("m.mtl", mtl);
    shop.write("model.obj", &square("m.mtl"));
    shop.seen_from_afar("model.obj", v, more, options)
}

#[test]
fn a_lamp_on_a_clear_coat_is_what_f64_says() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    let away = 2.0;
    for (base, metallic, roughness, [factor, coat_roughness]) in
        [(0.5f32, 0.0f32, 0.9f32, [1.0f32, 0.2f32]), (0.8, 1.0, 0.6, [0.5, 0.5])]
    {
        let mtl = format!("{}Pc {factor}\nPcr {coat_roughness}\n", material([base; 3], metallic, roughness));
        // Where either scatters more than once, both do.
        let scattering = if metallic > 0.0 { Scattering::Multiple } else { Scattering::Single };
        let coat = Clearcoat::new(factor.into(), coat_roughness.into(), scattering);
        let [roughness, metallic] = [roughness, metallic].map(f64::from);
        let energy = Energy::new(roughness, Geometry::Smith, scattering);
        let curve = Curve::new(roughness, Geometry::Smith);
        for (v, l) in [
            (DVec3::Z, DVec3::Z),
            (slanted(0.8, 0.3), slanted(0.7, 3.3)),
            (slanted(0.3, 1.0), slanted(0.4, 4.2)),
            (slanted(0.4, 1.0), slanted(0.9, 0.2)),
        ] {
            let [x, y, z] = (away * l).to_array();
            let lamp = format!("[[light]]\npoint = {{ position = [{x}, {y}, {z}], intensity = [40, 40, 40] }}\n");
            let got = pixel(
                &picture(&shop, &mtl, v, &lamp, &PictureOptions::open(SIDE, Shading::Pbr, 1)),
                SIDE / 2,
                SIDE / 2,
            )[0];
            let base_color = DVec3::splat(f64::from(base));
            let fresnel = energy.dielectric.mixed(base_color, metallic);
            let beyond = energy.beyond_single(base_color, metallic, curve.at(l.z), curve.at(v.z));
            let below = (specular(DVec3::Z, v, l, fresnel, roughness, Geometry::Smith) + beyond).x * l.z;
            let want = 40.0 / (away * away) * (coat.left(v.z) * below + coat.scattered(DVec3::Z, v, l));
            assert!((got / want - 1.0).abs() < 8e-3, "{base} {factor}, v {v:.2}, l {l:.2}: {got} against {want}");
        }
    }
}

/// In pictures by construction, in the exact ones because what the coat reflects is what the base loses.
#[test]
fn under_even_light_a_coat_on_white_is_white() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [1.0; 3]);
    for (metallic, coat_roughness, nv) in [(0.0, 0.0, 0.8), (1.0, 0.3, 0.3), (0.0, 1.0, 0.5)] {
        let mtl = format!("{}Pc 1\nPcr {coat_roughness}\n", material([1.0; 3], metallic, 0.7));
        for (shading, frames) in [(Shading::Pbr, 1), (Shading::Reference, 32)] {
            let got =
                mean_colour(&picture(&shop, &mtl, slanted(nv, 0.5), "", &PictureOptions::open(SIDE, shading, frames)))
                    .x;
            assert!((got - 1.0).abs() < 0.006, "{metallic} {coat_roughness} {shading:?}: {got}");
        }
    }
}

#[test]
fn coats_mirror_a_panorama_as_in_the_exact_picture() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 128, |d| {
        [0.3 + 5.0 * d[2].max(0.0).powi(2) as f32, 0.5 + 0.5 * d[0] as f32, 1.0 + d[1] as f32]
    });
    for (coat_roughness, nv, bound) in [(0.05, 0.9, 0.01), (0.3, 0.6, 0.03), (0.2, 0.3, 0.04)] {
        let mtl = |factor: f32| format!("{}Pc {factor}\nPcr {coat_roughness}\n", material([0.02; 3], 0.0, 0.9));
        let v = slanted(nv, 0.5);
        // What it adds; the base has errors of its own.
        let [fast, exact] =
            [PictureOptions::open(SIDE, Shading::Pbr, 1), PictureOptions::open(SIDE, Shading::Reference, 64)].map(
                |options| {
                    let [with, without] =
                        [1.0, 0.0].map(|factor| mean_colour(&picture(&shop, &mtl(factor), v, "", &options)));
                    with - without
                },
            );
        let off = ((fast - exact) / exact).abs().max_element();
        println!("roughness {coat_roughness}, n.v {nv}: {fast:.4} against {exact:.4}");
        assert!(off < bound, "{coat_roughness} {nv}: {fast} against {exact}");
    }
}

/// A coat over half of a square, by its map; and the bumps of a normal map, which a coat levels out.
#[test]
fn a_coat_has_a_map_of_its_own_and_no_bumps() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 64, |d| [if d[0] > 0.0 { 4.0 } else { 0.1 }; 3]);
    let half = image::GrayImage::from_fn(8, 8, |x, _| image::Luma([if x < 4 { 255 } else { 0 }]));
    half.save(shop.path("half.png")).unwrap();
    image::RgbImage::from_pixel(8, 8, image::Rgb([230, 128, 200])).save(shop.path("inclined.png")).unwrap();
    let black = material([0.0; 3], 0.0, 1.0);
    let wide = |mtl: &str, shading| {
        shop.write("m.mtl", mtl);
        shop.write("model.obj", &square("m.mtl"));
        let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"model.obj\"\n[[camera]]\nname = \"c\"\n\
             position = [-10, 0, 10]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 2\n";
        let scene = shop.write("scene.toml", text);
        let picture = shop
            .render(&scene, &PictureOptions::open(SIDE, shading, if shading == Shading::Pbr { 1 } else { 64 }))
            .remove(0);
        [SIDE / 4, 3 * SIDE / 4].map(|x| pixel(&picture, x, SIDE / 2)[0])
    };
    let left = Clearcoat::new(1.0, 0.0, Scattering::Single).left(0.5f64.sqrt());
    for shading in [Shading::Pbr, Shading::Reference] {
        let coated = |more: &str| wide(&format!("{black}Pcr 0\n{more}"), shading);
        let [all, none, map] = ["Pc 1\n", "Pc 0\n", "Pc 1\nmap_Pc half.png\n"].map(coated);
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.05;
        assert!(all[0] > 2.0 * none[0], "{all:?} {none:?}");
        assert!(near(map[0], all[0]) && near(map[1], none[1]), "{shading:?}: {map:?} of {all:?} and {none:?}");
        // The base's own light is as inclined; what the coat adds is not.
        let [bumps, both] = ["Pc 0\nnorm inclined.png\n", "Pc 1\nnorm inclined.png\n"].map(coated);
        let added = |with: f64, without: f64| with - left * without;
        assert!(
            near(added(both[0], bumps[0]), added(all[0], none[0])),
            "{shading:?}: {both:?} over {bumps:?}, but {all:?} over {none:?}"
        );
    }
}

/// Where the coat names the surface's normal map, both are inclined.
#[test]
fn a_coat_with_the_normal_map_of_its_surface_has_its_bumps() {
    let shop = Workshop::new();
    shop.panorama("sky.exr", 64, |d| [0.2 + 2.0 * d[0].max(0.0) as f32; 3]);
    let inclined = image::RgbaImage::from_pixel(8, 8, image::Rgba([200, 128, 230, 255]));
    let picture = |has_bumps: bool, shading, frames| {
        let mut gltf = Gltf::new();
        let normal = gltf.texture(&inclined, json!({}));
        let mut coat = json!({"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.05});
        if has_bumps {
            coat["clearcoatNormalTexture"] = json!({"index": normal});
        }
        // Nothing below the coat mirrors.
        let material = gltf.material(json!({
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
            "normalTexture": {"index": normal}, "extensions": {"KHR_materials_clearcoat": coat, "KHR_materials_ior": {"ior": 1}},
        }));
        gltf.show(&Shape::plate([-1.0, 1.0], [-1.0, 1.0], 0.0), material);
        gltf.write(&shop, "coat.gltf");
        let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"coat.gltf\"\n[[camera]]\nname = \"c\"\n\
             position = [0, 0, 20]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 0.1\n";
        mean_colour(
            &shop.render(&shop.write("scene.toml", text), &PictureOptions::open(SIDE, shading, frames)).remove(0),
        )
        .x
    };
    let [with, without] = [true, false].map(|has_bumps| {
        let [fast, exact] = [picture(has_bumps, Shading::Pbr, 1), picture(has_bumps, Shading::Reference, 32)];
        assert!((fast / exact - 1.0).abs() < 0.05, "bumps {has_bumps}: {fast} against {exact}");
        exact
    });
    assert!(with > 1.5 * without, "{with} with bumps, {without} without");
}
