//! Tests of materials: factors, alpha, maps and their texture coordinates, extensions.

use glam::{Vec2, Vec3, vec2, vec3};
use serde_json::{Value, json};

use super::build_tests::{Build, only};
use super::transmission::MIN_ATTENUATION;
use crate::asset::material::{AlphaUse, BodyShape, Factor, MapDesc, MaterialDesc, NormalsKind, Sampling, Wrap};
use crate::asset::texture::{Encoding, Pick, Texture};

/// A triangle with two sets of texture coordinates and this material, three textures with pictures inside the file.
pub fn build(material: Value) -> Build {
    let mut build = Build::triangle();
    for (name, values) in [("TEXCOORD_0", [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]), ("TEXCOORD_1", [0.5; 6])] {
        let uvs = build.floats("VEC2", &values);
        build.attribute(name, uvs);
    }
    let view = build.view(b"picture");
    build.json["images"] = json!([{"bufferView": view, "name": "a/b"}, {"uri": "data:image/png;base64,AQID"}]);
    build.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]);
    build.json["textures"] = json!([{"source": 0}, {"source": 1}, {"source": 0, "sampler": 0}]);
    build.material(material)
}

/// The material, and a warning or none.
pub fn read(material: Value) -> (MaterialDesc, String) {
    let (model, warnings) = build(material).load();
    let mut materials = model.unwrap().materials;
    assert!(warnings.len() < 2 && materials.len() == 1, "{warnings:?}");
    (materials.remove(0), warnings.into_iter().next().unwrap_or_default())
}

pub fn good(material: Value) -> MaterialDesc {
    let (desc, warning) = read(material);
    assert_eq!(warning, "");
    desc
}

#[test]
fn factors_and_their_defaults() {
    let plain = MaterialDesc { culls_backs: true, ..MaterialDesc::plain("material 0", Vec3::ONE, 1.0, 1.0) };
    assert_eq!(good(json!({})), plain);
    let desc = good(json!({
        "name": "Steel", "doubleSided": true, "emissiveFactor": [0.1, 0.2, 0.5],
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.25},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 10}},
    }));
    assert_eq!((desc.name.as_str(), desc.culls_backs, desc.opacity), ("Steel", false, 0.4));
    assert_eq!(desc.base_color, Factor::same(vec3(0.1, 0.2, 0.3)));
    assert_eq!((desc.metallic, desc.roughness), (Factor::same(0.5), Factor::same(0.25)));
    assert_eq!(desc.emissive, Factor::same(vec3(1.0, 2.0, 5.0)));
    let (desc, warning) = read(json!({"name": "a", "pbrMetallicRoughness": {"metallicFactor": 2}}));
    assert_eq!(
        (desc.metallic.alone, warning.as_str()),
        (1.0, "a.glb: material a: metallicFactor: 2 is not in 0..=1; 1 is used")
    );
    let strong = json!({"KHR_materials_emissive_strength": {"emissiveStrength": 1e30}});
    assert_eq!(read(json!({"emissiveFactor": [1, 0, 0], "extensions": strong})).0.emissive.alone, vec3(1e6, 0.0, 0.0));
}

#[test]
fn alpha_in_all_modes() {
    let faint = json!({"baseColorFactor": [1, 1, 1, 0.5]});
    let of = |mode: &str, cutoff: f32, surface: &Value| {
        let desc = good(json!({"alphaMode": mode, "alphaCutoff": cutoff, "pbrMetallicRoughness": surface}));
        (desc.alpha, desc.opacity)
    };
    assert_eq!(of("OPAQUE", 0.5, &faint), (AlphaUse::Opaque, 0.5));
    assert_eq!(of("BLEND", 0.5, &faint), (AlphaUse::Blend, 0.5));
    assert_eq!(of("MASK", 0.25, &json!({})), (AlphaUse::Mask(0.25), 1.0));
    assert_eq!(of("MASK", 0.25, &faint), (AlphaUse::Mask(0.5), 1.0));
    assert_eq!(of("MASK", 0.0, &faint).0, AlphaUse::Opaque);
    let AlphaUse::Mask(cutoff) = of("MASK", 0.5, &json!({"baseColorFactor": [1, 1, 1, 0]})).0 else {
        panic!("no mask")
    };
    assert!(cutoff > 1.0 && cutoff.is_finite());
    assert_eq!(good(json!({"alphaMode": "MASK"})).alpha, AlphaUse::Mask(0.5));
    assert!(read(json!({"alphaMode": "MAYBE"})).1.contains("alphaMode: MAYBE is unknown; drawn opaque"));
}

#[test]
fn maps_and_samplers() {
    let desc = good(json!({
        "name": "Steel",
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 2}, "metallicRoughnessTexture": {"index": 1}},
        "normalTexture": {"index": 0, "scale": 0.5}, "occlusionTexture": {"index": 1, "strength": 0.25},
        "emissiveTexture": {"index": 1},
    }));
    let base = desc.base_color_map.unwrap();
    assert_eq!(base.sampling, Sampling { wrap: [Wrap::Clamp, Wrap::Mirror], nearest: true });
    assert_eq!(base.origin, "a.glb: material Steel: baseColorTexture");
    assert!(base.image.place().to_str().unwrap().ends_with("a.glb#image 0 a_b"), "{:?}", base.image.place());
    assert_eq!(&*base.image.read().unwrap(), b"picture");
    let (roughness, metallic, occlusion) =
        (desc.roughness_map.unwrap(), desc.metallic_map.unwrap(), desc.occlusion_map.unwrap());
    assert_eq!([roughness.pick, metallic.pick, occlusion.pick], [Pick::Green, Pick::Blue, Pick::Red]);
    assert_eq!((roughness.sampling, &*roughness.image.read().unwrap()), (Sampling::default(), &[1, 2, 3][..]));
    assert!(roughness.image == occlusion.image && roughness.image != base.image);
    let normals = desc.normals.unwrap();
    assert_eq!((normals.kind, desc.occlusion_strength), (NormalsKind::Vectors(0.5), 0.25));
    assert!(!normals.map.second_uv && normals.map.image == base.image);
}

#[test]
fn texture_coordinates_are_chosen_and_transformed() {
    let transform = |value: Value| json!({"KHR_texture_transform": value});
    let build = build(json!({
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "normalTexture": {"index": 0, "texCoord": 7, "extensions": transform(json!({
            "offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.25], "texCoord": 0,
        }))},
        "emissiveTexture": {"index": 0, "texCoord": 1},
    }));
    let (model, warning) = build.warned();
    assert_eq!(
        warning,
        "a.glb: material 0: its maps need more than two texture coordinates; others are those of its first map"
    );
    let desc = &model.materials[0];
    assert!(!desc.normals.as_ref().unwrap().map.second_uv && desc.base_color_map.as_ref().unwrap().second_uv);
    assert!(!desc.emissive_map.as_ref().unwrap().second_uv);
    // With v downwards: turned counter-clockwise, (½, 0) comes to (0, −½) and (0, ¼) to (¼, 0); then 1 is added to v.
    let uvs: Vec<_> = only(&model).corners.iter().map(|corner| corner.uv).collect();
    let expected = [vec2(0.0, 0.0), vec2(0.0, 0.5), vec2(0.25, 0.0)];
    assert!(uvs.iter().zip(expected).all(|(a, b)| (a - b).length() < 1e-6), "{uvs:?}");
    assert_eq!(only(&model).extras.iter().map(|extra| extra.uv1).collect::<Vec<_>>(), [Vec2::Y, Vec2::ONE, Vec2::ZERO]);
}

#[test]
fn missing_texture_coordinates() {
    let build = build(json!({"normalTexture": {"index": 0, "texCoord": 3}, "emissiveTexture": {"index": 0}}));
    let (model, warning) = build.warned();
    assert_eq!(warning, "a.glb: mesh 0: it has no TEXCOORD_3, which its material needs; set to 0");
    assert!(!only(&model).has_uvs && only(&model).corners[1].uv == Vec2::ZERO);
    assert_eq!(only(&model).extras[1].uv1, Vec2::ONE);
}

#[test]
fn occlusion_that_cannot_be_packed() {
    for occlusion in [json!({"index": 0, "texCoord": 1}), json!({"index": 2})] {
        let surface = json!({"metallicRoughnessTexture": {"index": 0}});
        let (desc, warning) = read(json!({"pbrMetallicRoughness": surface, "occlusionTexture": occlusion}));
        assert!(desc.occlusion_map.is_none() && desc.roughness_map.is_some());
        assert!(warning.ends_with("is not sampled as metallicRoughnessTexture; drawn without occlusion"), "{warning}");
    }
}

#[test]
fn pictures_that_cannot_be_used() {
    for (image, why) in [
        (json!({}), "image 0: it has neither bytes nor a file; drawn without"),
        (json!({"uri": "no.png"}), "image 0: no.png: file not found; drawn without"),
        (json!({"uri": "http://a/b.png"}), "http://a/b.png is not a file; put it beside the model as one"),
        (json!({"uri": "data:;base64,*"}), "its data URI is not base64"),
        (json!({"bufferView": 99, "name": "x"}), "image 0 (x): "),
    ] {
        let mut build = build(json!({"emissiveTexture": {"index": 0}, "normalTexture": {"index": 0}}));
        build.json["images"][0] = image;
        let (model, warning) = build.warned();
        assert!(warning.contains(why), "{warning}");
        assert!(model.materials[0].emissive_map.is_none() && model.materials[0].normals.is_none());
    }
    let mut build = build(json!({"emissiveTexture": {"index": 0}}));
    build.json["textures"][0] = json!({"extensions": {"MSFT_texture_dds": {"source": 0}}});
    let only = "emissiveTexture: it has no PNG, JPEG, WebP or KTX2 picture, only MSFT_texture_dds";
    assert!(build.warned().1.contains(only));
    // WebP or KTX2 where there is nothing else.
    for name in ["EXT_texture_webp", "KHR_texture_basisu"] {
        build.json["textures"][0] = json!({"extensions": {name: {"source": 0}}});
        assert!(build.model().materials[0].emissive_map.is_some());
        build.json["textures"][0] = json!({"source": 0, "extensions": {name: {"source": 9}}});
        assert!(build.model().materials[0].emissive_map.is_some());
    }
    build.json["textures"][0] = json!({"source": 9});
    assert_eq!(build.warned().1, "a.glb: there is no image 9; drawn without");
    build.json["textures"] = json!([]);
    assert!(build.problem().contains("material 0: emissiveTexture: there is no texture 0"));
}

#[test]
fn unlit_materials_shine() {
    let (desc, warning) = read(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1], "baseColorTexture": {"index": 0}},
        "extensions": {"KHR_materials_unlit": {}},
    }));
    assert_eq!(warning, "a.glb: material 0: KHR_materials_unlit: drawn as a light source of its color");
    assert_eq!(desc.emissive, Factor::same(vec3(0.5, 0.25, 1.0)));
    assert_eq!((desc.base_color.alone, desc.metallic.alone, desc.roughness.alone), (Vec3::ZERO, 1.0, 1.0));
    assert!(desc.emissive_map == desc.base_color_map && desc.emissive_map.is_some());
}

/// A picture of two texels as PNG.
fn png(texels: [[u8; 4]; 2]) -> String {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbaImage::from_raw(2, 1, texels.concat()).expect("two texels");
    picture.write_to(&mut bytes, image::ImageFormat::Png).expect("a picture");
    let hex: String = bytes.into_inner().iter().map(|byte| format!("%{byte:02x}")).collect();
    format!("data:image/png,{hex}")
}

/// A dielectric without pictures keeps its reflectance, and its diffuse texture is its base color. With a specular texture
/// both become pictures of base color, roughness and metalness.
#[test]
fn specular_and_glossiness() {
    let with = |glossy: Value| json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": glossy}});
    let dielectric = good(with(json!({
        "diffuseFactor": [0.5, 0, 0, 1], "diffuseTexture": {"index": 0}, "glossinessFactor": 0.75, "specularFactor": [0.1, 0.1, 0.1],
    })));
    assert_eq!((dielectric.metallic.alone, dielectric.roughness.alone), (0.0, 0.25));
    assert!((dielectric.dielectric_f0 - 0.1).abs().max_element() < 1e-6 && dielectric.base_color_map.is_some());
    assert!((dielectric.base_color.alone - vec3(0.5, 0.0, 0.0)).abs().max_element() < 1e-6);
    let gold = good(with(json!({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1.0, 0.8, 0.3]})));
    assert_eq!((gold.metallic.alone, gold.roughness.alone), (1.0, 0.0));
    assert!((gold.base_color.alone - vec3(1.0, 0.8, 0.3)).abs().max_element() < 1e-6);

    // A red dielectric beside gold, half as glossy.
    let mut two = build(with(json!({"diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 1}})));
    let (diffuse, specular) = ([[200, 0, 0, 99], [0, 0, 0, 255]], [[56, 56, 56, 255], [255, 230, 150, 128]]);
    two.json["images"] = json!([{"uri": png(diffuse)}, {"uri": png(specular)}]);
    let (model, warnings) = two.load();
    assert_eq!(warnings, [""; 0]);
    let desc = model.unwrap().materials.remove(0);
    assert_eq!((desc.base_color.alone, desc.metallic.alone, desc.roughness.alone), (Vec3::ONE, 1.0, 1.0));
    let pixels = |map: &Option<MapDesc>| {
        Texture::load(&map.as_ref().expect("a map").image, Encoding::Linear).expect("a picture").pixels
    };
    let near = |got: Vec<u8>, want: [u8; 8]| {
        assert!(got.iter().zip(want).all(|(a, b)| a.abs_diff(b) <= 2), "{got:?}, not {want:?}");
    };
    near(pixels(&desc.base_color_map), [200, 0, 0, 99, 255, 230, 150, 255]);
    near(pixels(&desc.roughness_map), [255, 0, 0, 255, 255, 127, 255, 255]);
    assert_eq!(
        [desc.roughness_map, desc.metallic_map].map(|map| map.map(|map| map.pick)),
        [Some(Pick::Green), Some(Pick::Blue)]
    );

    // Pictures that are none: what their factors multiply is not known.
    for extra in [json!({}), json!({"diffuseTexture": {"index": 2}})] {
        let mut glossy = json!({"specularGlossinessTexture": {"index": 1}, "diffuseFactor": [0.5, 0.5, 0.5, 1]});
        glossy.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        let (plain, warning) = read(with(glossy));
        assert!(
            warning.ends_with("drawn without") && plain.roughness_map.is_none() && plain.metallic_map.is_none(),
            "{warning}"
        );
        assert_eq!((plain.metallic.alone, plain.roughness.alone, plain.dielectric_f0), (0.0, 0.5, Vec3::splat(0.04)));
        assert!((plain.base_color.alone - 0.5).abs().max_element() < 1e-6);
    }
}

#[test]
fn extensions_of_materials() {
    good(json!({"extensions": {"KHR_materials_ior": {}, "KHR_texture_transform": {}, "OTHER_thing": 1}}));
    let (_, warning) = read(json!({"name": "Car", "extensions": {"KHR_materials_volume_scatter": {}}}));
    assert_eq!(
        warning,
        "a.glb: material Car: KHR_materials_volume_scatter is not supported; what is inside does not scatter light"
    );
    let broken = build(json!({"extensions": {"KHR_materials_ior": {"ior": []}}}));
    assert!(broken.problem().contains("material 0: KHR_materials_ior: invalid type"));
}

#[test]
fn light_goes_through_what_transmits() {
    let of = |share: f32, color: [f32; 3], other: serde_json::Value| {
        let mut material = json!({
            "pbrMetallicRoughness":
                {"baseColorFactor": [color[0], color[1], color[2], 1], "metallicFactor": 0, "roughnessFactor": 0},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": share}},
        });
        material.as_object_mut().expect("an object").extend(other.as_object().expect("an object").clone());
        read(material)
    };
    let key = "a.glb: material 0: KHR_materials_transmission: ";
    // Of a white sheet no light is lost: what does not go through comes back, from a clear one as from a mirror.
    for share in [1.0, 0.6] {
        let (glass, warning) = of(share, [1.0; 3], json!({"emissiveFactor": [0.5, 0, 0]}));
        assert_eq!(warning, format!("{key}light goes straight through it, neither bent nor blurred"));
        assert_eq!((glass.alpha, glass.transmission), (AlphaUse::Opacity, Some(Vec3::ONE)));
        let through = share * (1.0 - 0.04 - 0.96 / 21.0);
        assert!(
            (1.0 - glass.opacity - through).abs() < 1e-6 && (glass.base_color.alone - 1.0).abs().max_element() < 1e-6
        );
        assert!((glass.opacity * glass.emissive.alone.x - 0.5).abs() < 1e-6);
        assert!(glass.opacity * glass.metallic.alone <= 1.0 - through && (share < 1.0 || glass.metallic.alone == 1.0));
    }
    // A green one mirrors as much, and only green goes through. Where a part transmits, the rest is as green.
    let (green, _) = of(1.0, [0.0, 1.0, 0.0], json!({"doubleSided": false}));
    assert!((green.opacity - 0.04 - 0.96 / 21.0).abs() < 1e-6 && !green.culls_backs);
    assert_eq!((green.base_color.alone, green.transmission), (Vec3::ONE, Some(Vec3::Y)));
    let (green, _) = of(0.5, [0.0, 1.0, 0.0], json!({}));
    let covers = green.opacity * green.base_color.alone - 0.5 * (0.04 + 0.96 / 21.0);
    assert!((covers - 0.5 * Vec3::Y).abs().max_element() < 1e-6, "{covers}");
    let (black, _) = of(1.0, [0.0; 3], json!({}));
    assert!(black.transmission == Some(Vec3::ZERO) && black.base_color.alone.is_finite());
    // A body of it multiplies light by its attenuation color at as many distances as it is thick, half at each surface.
    let volume = |more: serde_json::Value| {
        let glass = json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": more});
        let base = json!({"baseColorFactor": [1, 0.5, 1, 1], "metallicFactor": 0});
        read(json!({"pbrMetallicRoughness": base, "extensions": glass})).0.transmission.expect("glass").to_array()
    };
    let color = [0.25, 1.0, 0.0];
    for (more, want) in [
        (json!({"thicknessFactor": 4, "attenuationDistance": 4, "attenuationColor": color}), [0.5, 0.5, 0.0]),
        (json!({"thicknessFactor": 4, "attenuationDistance": 1, "attenuationColor": color}), [0.0625, 0.5, 0.0]),
        (json!({"thicknessFactor": 4, "attenuationColor": color}), [1.0, 0.5, 1.0]),
        (json!({"attenuationDistance": 1, "attenuationColor": color}), [1.0, 0.5, 1.0]),
        (json!({"thicknessFactor": 3e38, "attenuationDistance": -1, "attenuationColor": [2, 1, 0.5]}), [1.0, 0.5, 0.0]),
    ] {
        assert_eq!(volume(more.clone()), want, "{more}");
    }
    // With a thickness it is the surface of a solid body, which absorbs by the way that light has in it.
    let refraction = |share: f32, thickness: f32, mode: &str| {
        let more = json!({"thicknessFactor": thickness, "attenuationDistance": 2, "attenuationColor": color});
        let glass = json!({"KHR_materials_transmission": {"transmissionFactor": share}, "KHR_materials_volume": more,
            "KHR_materials_ior": {"ior": 1.33}});
        let base = json!({"baseColorFactor": [1, 0.5, 1, 1], "metallicFactor": 0});
        let (glass, warning) = read(json!({"pbrMetallicRoughness": base, "extensions": glass, "alphaMode": mode}));
        assert_eq!(warning.contains("balls and convex bodies alone"), glass.refraction.is_some(), "{warning}");
        glass.refraction
    };
    let body = refraction(1.0, 0.1, "OPAQUE").expect("a body");
    assert_eq!(body.ior_spread, 0.0);
    assert!(
        (body.ior - 1.33).abs() < 1e-4
            && body.surface_transmission == Vec3::new(1.0, 0.5, 1.0)
            && body.shape == BodyShape::Other
    );
    let want = Vec3::new(-0.5 * 0.25_f32.ln(), 0.0, -0.5 * MIN_ATTENUATION.ln());
    assert!((body.absorption - want).abs().max_element() < 1e-5, "{}", body.absorption);
    for (share, thickness, mode) in [(0.9, 0.1, "OPAQUE"), (1.0, 0.0, "OPAQUE"), (1.0, 0.1, "BLEND")] {
        assert_eq!(refraction(share, thickness, mode), None, "{share}, {thickness}, {mode}");
    }
    let (opaque, warning) = of(0.5, [1.0; 3], json!({"alphaMode": "MASK"}));
    assert_eq!(warning, format!("{key}not supported with a mask; drawn as if it were not transparent"));
    assert_eq!((opaque.opacity, opaque.metallic.alone), (1.0, 0.0));
    // Alpha of an opaque material counts as little as without.
    let clear = json!({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.1], "metallicFactor": 0}});
    let (mut opaque, mut blended) = (clear.clone(), clear);
    for (material, mode) in [(&mut opaque, "OPAQUE"), (&mut blended, "BLEND")] {
        material["alphaMode"] = json!(mode);
        material["extensions"] = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
    }
    let [opaque, blended] = [opaque, blended].map(|material| read(material).0.opacity);
    assert!((opaque - 0.04 - 0.96 / 21.0).abs() < 1e-6 && (blended - 0.1 * opaque).abs() < 1e-6, "{opaque}, {blended}");
    let both = json!({"KHR_materials_unlit": {}, "KHR_materials_transmission": {"transmissionFactor": 1}});
    let (unlit, _) = read(json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": both}));
    assert!(unlit.unlit && unlit.transmission.is_none() && unlit.alpha == AlphaUse::Opaque);
    good(json!({"extensions": {"KHR_materials_transmission": {}}}));
    good(json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}})); // metals do not
}

#[test]
fn materials_are_those_used_in_their_order() {
    let mut build = Build::triangle();
    build.json["materials"] = json!([{"name": "no"}, {"name": "last"}, {"name": "first"}]);
    build.json["meshes"][0]["primitives"] = json!([
        {"attributes": {"POSITION": 0}, "material": 2},
        {"attributes": {"POSITION": 0}, "material": 1},
        {"attributes": {"POSITION": 0}},
        {"attributes": {"POSITION": 0}, "material": 2},
    ]);
    let model = build.model();
    let names: Vec<_> = model.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["first", "last"]);
    let used: Vec<_> = model.submeshes.iter().map(|submesh| (submesh.name.as_str(), submesh.material)).collect();
    assert_eq!(used, [("mesh 0 0", Some(0)), ("mesh 0 1", Some(1)), ("mesh 0 2", None), ("mesh 0 3", Some(0))]);
    let build = build.with("/meshes/0/primitives/0", "material", json!(3));
    assert!(build.problem().contains("there is no material 3"));
}
