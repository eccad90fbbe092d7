//! Tests of layers and of other extensions of a material's surface.

use glam::Vec3;
use serde_json::{Value, json};

use super::build_tests::Build;
use super::materials_tests::{build, good, read};
use crate::asset::material::{DiffuseTransmission, Extension, MIN_SHEEN_ROUGHNESS, MapDesc, ThinFilm};
use crate::asset::texture::Pick;

/// A file whose first picture has one texel's colour, alpha 0.2.
fn with_magenta(material: Value) -> Build {
    with_picture(material, &image::RgbaImage::from_pixel(2, 2, image::Rgba([255, 0, 255, 51])))
}

/// A file with this first picture.
fn with_picture(material: Value, picture: &image::RgbaImage) -> Build {
    let mut build = build(material);
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let view = build.view(png.get_ref());
    build.json["images"][0] = json!({"bufferView": view});
    build
}

#[test]
fn clear_coats() {
    let with = |coat: serde_json::Value| json!({"name": "Car", "extensions": {"KHR_materials_clearcoat": coat}});
    let none = good(with(json!({"clearcoatRoughnessFactor": 0.5, "clearcoatTexture": {"index": 0}})));
    assert!(none.clearcoat == 0.0 && none.clearcoat_map.is_none());
    let coat = good(with(json!({"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25})));
    assert_eq!((coat.clearcoat, coat.clearcoat_roughness), (0.5, 0.25));
    let mapped = good(with(json!({"clearcoatFactor": 1, "clearcoatTexture": {"index": 0}})));
    assert_eq!(mapped.clearcoat_map.as_ref().map(|map| map.pick), Some(Pick::Red));
    let mut bumpy = with(json!({"clearcoatFactor": 1, "clearcoatNormalTexture": {"index": 0}}));
    bumpy["normalTexture"] = json!({"index": 0});
    assert!(good(bumpy).clearcoat_bumps && !mapped.clearcoat_bumps);
    for (more, problem) in [
        (json!({"clearcoatFactor": 2}), "clearcoatFactor: 2 is not in 0..=1; 1 is used"),
        (
            json!({"clearcoatFactor": 1, "clearcoatNormalTexture": {"index": 0}}),
            "clearcoatNormalTexture that is not the normalTexture",
        ),
    ] {
        let (desc, warning) = read(with(more));
        assert!(desc.clearcoat == 1.0 && warning.contains(problem), "{warning}");
    }
    // The texture's green is 0.
    let smooth =
        json!({"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.8, "clearcoatRoughnessTexture": {"index": 0}});
    let (model, warning) = with_magenta(with(smooth)).warned();
    assert_eq!(model.materials[0].clearcoat_roughness, 0.0);
    assert!(warning.contains("clearcoatRoughnessTexture: the mean of its texels is used"), "{warning}");
}

#[test]
fn sheen_of_cloth() {
    let with = |sheen: Value| json!({"name": "Velvet", "extensions": {"KHR_materials_sheen": sheen}});
    assert_eq!(good(with(json!({"sheenRoughnessFactor": 0.5}))).sheen, Vec3::ZERO);
    let velvet = good(with(json!({"sheenColorFactor": [0.25, 0.5, 1], "sheenRoughnessFactor": 0.5})));
    assert_eq!((velvet.sheen, velvet.sheen_roughness), (Vec3::new(0.25, 0.5, 1.0), 0.5));
    let (smooth, warning) = read(with(json!({"sheenColorFactor": [2, 0, 0], "sheenRoughnessFactor": 0.3})));
    assert!(smooth.sheen == Vec3::X && warning.contains("sheenColorFactor: 2 is not in 0..=1"), "{warning}");
    let (smooth, warning) = read(with(json!({"sheenColorFactor": [1, 0, 0]})));
    assert!(smooth.sheen_roughness == MIN_SHEEN_ROUGHNESS && warning.contains("0 is not in 0.2..=1"), "{warning}");
}

#[test]
fn thin_films() {
    let with = |film: Value| json!({"extensions": {"KHR_materials_iridescence": film}});
    assert_eq!(good(with(json!({"iridescenceIor": 2}))).film, None);
    let film = |share, ior, thickness| Some(ThinFilm { share, ior, thickness });
    assert_eq!(good(with(json!({"iridescenceFactor": 0.5}))).film, film(0.5, 1.3, [400.0; 2]));
    let mapped = json!({"iridescenceFactor": 1, "iridescenceIor": 1.8, "iridescenceThicknessMinimum": 200,
        "iridescenceThicknessTexture": {"index": 0}});
    let desc = good(with(mapped.clone()));
    assert_eq!(desc.film, film(1.0, 1.8, [200.0, 400.0]));
    assert_eq!(desc.film_map.map(|map| map.pick), Some(Pick::Green));
    // The mean where a coat's map has its place; the texture's green is 0.
    let mut coated = with(mapped);
    coated["extensions"]["KHR_materials_clearcoat"] = json!({"clearcoatFactor": 1, "clearcoatTexture": {"index": 0}});
    let (model, warning) = with_magenta(coated).warned();
    let desc = &model.materials[0];
    assert!(desc.film == film(1.0, 1.8, [200.0; 2]) && desc.film_map.is_none(), "{:?}", desc.film);
    assert!(warning.contains("iridescenceThicknessTexture: the mean of its texels is used"), "{warning}");
    let (desc, warning) = read(with(json!({"iridescenceFactor": 1, "iridescenceIor": 0.5})));
    assert!(desc.film == film(1.0, 1.0, [400.0; 2]) && warning.contains("iridescenceIor: 0.5 is not in 1..=10"));
    // Of a sheet it is the colour of what it mirrors.
    let sheet = json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {"KHR_materials_iridescence": {"iridescenceFactor": 1},
        "KHR_materials_transmission": {"transmissionFactor": 1}}});
    let (sheet, _) = read(sheet);
    let color = sheet.base_color.alone;
    assert!(sheet.film.is_none() && color.max_element() - color.min_element() > 0.05, "{color}");
}

#[test]
fn dielectrics_reflect_by_their_index_and_factors() {
    let reflects = |ior: Value, specular: Value| {
        let extensions = json!({"KHR_materials_ior": ior, "KHR_materials_specular": specular});
        let (desc, warning) = read(json!({"extensions": extensions}));
        (desc.dielectric_f0.to_array(), desc.dielectric_f90, warning)
    };
    for (ior, want) in [
        (json!({}), 0.04),
        (json!({"ior": 1.5}), 0.04),
        (json!({"ior": 1.0}), 0.0),
        (json!({"ior": 3}), 0.25),
        (json!({"ior": 0}), 1.0),
    ] {
        assert_eq!(reflects(ior, json!({})), ([want; 3], 1.0, String::new()));
    }
    let ([water, ..], ..) = reflects(json!({"ior": 1.33}), json!({"specularColorFactor": [2, 2, 2]}));
    assert!((water - 2.0 * (0.33f32 / 2.33).powi(2)).abs() < 1e-6, "{water}");
    let warning = "a.glb: material 0: ior: 0.5 is not in 1..=10; 1 is used";
    assert_eq!(reflects(json!({"ior": 0.5}), json!({})), ([0.0; 3], 1.0, warning.into()));
    // The factor is that of all that is reflected, the color only of what is head on, up to all of it.
    let half = reflects(json!({"ior": 3}), json!({"specularFactor": 0.5, "specularColorFactor": [0, 1, 9]}));
    assert_eq!(half, ([0.0, 0.125, 0.5], 0.5, String::new()));
    assert_eq!(reflects(json!({}), json!({"specularFactor": 0})), ([0.0; 3], 0.0, String::new()));
    let endless = reflects(json!({"ior": 1}), json!({"specularColorFactor": [1e39, 1, 1]}));
    assert_eq!(endless, ([0.0; 3], 1.0, String::new()));
    // Means of textures where another extension has the map: that of the factor is in alpha.
    let magenta = Vec3::new(0.04, 0.0, 0.04);
    let sheen = json!({"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 1, "sheenColorTexture": {"index": 0}});
    for (key, f0, f90) in [("specularTexture", Vec3::splat(0.008), 0.2), ("specularColorTexture", magenta, 1.0)] {
        let both = json!({"KHR_materials_sheen": sheen, "KHR_materials_specular": {key: {"index": 0}}});
        let (model, warning) = with_magenta(json!({"extensions": both})).warned();
        let expected = format!("a.glb: material 0: KHR_materials_specular: {key}: the mean of its texels is used");
        assert_eq!(warning, expected);
        let desc = &model.materials[0];
        let is_near = (desc.dielectric_f0 - f0).abs().max_element() < 1e-6 && (desc.dielectric_f90 - f90).abs() < 1e-6;
        assert!(is_near, "{key}: {desc:?}");
    }
}

/// Of a material with these extensions: what its extension maps are of, their channels, and all warnings.
fn extension_maps(extensions: Value) -> (Option<Extension>, [Option<Pick>; 2], String) {
    let (model, warnings) = with_magenta(json!({"extensions": extensions})).load();
    let maps = model.unwrap().materials.remove(0).extension_maps;
    let pick = |map: &Option<MapDesc>| map.as_ref().map(|map| map.pick);
    let picks = maps.as_ref().map_or([None; 2], |maps| [pick(&maps.color), pick(&maps.number)]);
    (maps.map(|maps| maps.of), picks, warnings.join("\n"))
}

#[test]
fn the_first_extension_with_textures_has_maps() {
    let texture = json!({"index": 0});
    let specular = json!({"specularColorTexture": texture, "specularTexture": texture});
    let sheen = json!({"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 0.5, "sheenRoughnessTexture": texture});
    let anisotropy = json!({"anisotropyStrength": 0.5, "anisotropyTexture": texture});
    let (of, picks, warning) = extension_maps(json!({"KHR_materials_specular": specular}));
    assert_eq!((of, picks), (Some(Extension::Specular), [Some(Pick::Red), Some(Pick::Alpha)]), "{warning}");
    assert_eq!(warning, "");
    let (of, picks, warning) =
        extension_maps(json!({"KHR_materials_specular": specular, "KHR_materials_sheen": sheen}));
    assert_eq!((of, picks), (Some(Extension::Sheen), [None, Some(Pick::Alpha)]));
    assert_eq!(warning.matches("the mean of its texels is used").count(), 2, "{warning}");
    let (of, picks, warning) =
        extension_maps(json!({"KHR_materials_anisotropy": anisotropy, "KHR_materials_sheen": sheen}));
    assert_eq!((of, picks), (Some(Extension::Anisotropy), [Some(Pick::Red), None]));
    assert!(warning.contains("sheenRoughnessTexture: the mean of its texels is used"), "{warning}");
    // What does nothing has no maps, and sheets have none.
    for (extensions, mean) in [
        (json!({"KHR_materials_sheen": {"sheenColorTexture": texture}}), false),
        (json!({"KHR_materials_anisotropy": {"anisotropyTexture": texture}}), false),
        (json!({"KHR_materials_specular": {"specularFactor": 0, "specularColorTexture": texture}}), true),
        (json!({"KHR_materials_specular": specular, "KHR_materials_transmission": {"transmissionFactor": 1}}), true),
    ] {
        let (of, _, warning) = extension_maps(extensions.clone());
        assert!(of.is_none() && warning.contains("the mean of its texels") == mean, "{extensions}: {warning}");
    }
    // One picture can be packed only if both are sampled alike.
    let turned = json!({"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}});
    let apart = json!({"specularColorTexture": texture, "specularTexture": turned});
    let (_, picks, warning) = extension_maps(json!({"KHR_materials_specular": apart}));
    assert!(picks[1].is_none() && warning.contains("specularTexture: the mean of its texels is used"), "{warning}");
}

/// The triangle's coordinates are (0, 0), (1, 0) and (0, 1): three quarters of it are in the texture's left half.
#[test]
fn triangles_with_a_transmission_texture_are_sheets_or_not() {
    let material = json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {"KHR_materials_transmission":
        {"transmissionFactor": 1, "transmissionTexture": {"index": 0}}}});
    let of = |left: u8, right: u8| {
        let texel = |x: u32, _| image::Rgba([if x < 4 { left } else { right }, 0, 0, 255]);
        with_picture(material.clone(), &image::RgbaImage::from_fn(8, 8, texel)).load()
    };
    let (model, warnings) = of(204, 0);
    let model = model.unwrap();
    assert!(warnings.iter().any(|warning| warning.contains("transmissionTexture: triangles of which more")));
    assert_eq!((model.submeshes.len(), model.submeshes[0].material, model.materials.len()), (1, Some(1), 2));
    let [solid, sheet] = &model.materials[..] else { panic!("two materials") };
    assert!(solid.transmission.is_none() && solid.opacity == 1.0);
    // Of 0.8 of the light, what is mirrored stays: 1 - 0.8 (1 - R).
    assert!(sheet.transmission.is_some() && (sheet.opacity - 0.269).abs() < 0.002, "{}", sheet.opacity);
    let (model, _) = of(0, 255);
    assert_eq!(model.unwrap().submeshes[0].material, Some(0));
    let (model, warnings) = of(100, 100);
    assert_eq!((model.unwrap().materials.len(), warnings), (1, Vec::new()), "nothing lets through half of it");
}

#[test]
fn bodies_split_light_by_their_abbe_number() {
    let spread = |dispersion: f32| {
        let (desc, warning) = read(json!({
            "pbrMetallicRoughness": {"metallicFactor": 0},
            "extensions": {
                "KHR_materials_dispersion": {"dispersion": dispersion},
                "KHR_materials_transmission": {"transmissionFactor": 1},
            },
        }));
        assert!(desc.refraction.is_none() && warning.contains("light goes straight through it"), "a sheet: {warning}");
        let (model, warnings) = build(json!({
            "pbrMetallicRoughness": {"metallicFactor": 0},
            "extensions": {
                "KHR_materials_dispersion": {"dispersion": dispersion},
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": 1},
            },
        }))
        .load();
        let told = warnings.iter().any(|warning| warning.contains("colours part in balls and convex bodies alone"));
        assert_eq!(told, dispersion > 0.0, "{warnings:?}");
        model.unwrap().materials[0].refraction.expect("a body").ior_spread
    };
    // Of glass of index 1.5, that of blue less that of red over what it bends is Abbe's number's inverse.
    assert_eq!([0.0, 2.0, 1000.0].map(spread), [0.0, 0.025, 0.5 * 0.5 * 39.0 / 20.0]);
}

#[test]
fn light_diffuses_through_sheets() {
    let with = |through: Value| json!({"extensions": {"KHR_materials_diffuse_transmission": through}});
    assert_eq!(good(with(json!({"diffuseTransmissionColorFactor": [1, 0, 0]}))).diffuse_transmission, None);
    let through = |share, color| Some(DiffuseTransmission { share, color });
    assert_eq!(good(with(json!({"diffuseTransmissionFactor": 0.25}))).diffuse_transmission, through(0.25, Vec3::ONE));
    let leaf = json!({"diffuseTransmissionFactor": 2, "diffuseTransmissionColorFactor": [0.5, 1, 0]});
    let (desc, warning) = read(with(leaf));
    assert_eq!(desc.diffuse_transmission, through(1.0, Vec3::new(0.5, 1.0, 0.0)));
    assert!(warning.contains("diffuseTransmissionFactor: 2 is not in 0..=1"), "{warning}");
    let mapped = with(json!({"diffuseTransmissionFactor": 1, "diffuseTransmissionTexture": {"index": 0}}));
    let maps = good(mapped).extension_maps.unwrap();
    assert!(maps.of == Extension::DiffuseTransmission && maps.color.is_none() && maps.number.is_some());
    let mut thick = with(json!({"diffuseTransmissionFactor": 1}));
    thick["extensions"]["KHR_materials_volume"] = json!({"thicknessFactor": 0.01});
    assert!(read(thick).1.contains("drawn as a thin sheet"));
}
