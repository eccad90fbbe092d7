//! Tests of the materials and textures that MTL keys and maps give.

use std::path::PathBuf;

use image::{GrayImage, Luma, Rgb, RgbImage, Rgba, RgbaImage};

use super::*;
use crate::asset::cache::Key;
use crate::asset::ktx2::TexelFormat;
use crate::asset::material::{BodyShape, Sampling};
use crate::asset::texture::Pick;
use crate::asset::{Cache, Storage, mtl, mtl_material};
use crate::scene::maps::TEXTURES_VERSION;

struct Folder(tempfile::TempDir);

impl Folder {
    /// Pictures of 4×4: `grey N`, `vary` (half 0, half 200), `red`, `coloured`, `flat`, `bumpy` (a normal map).
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        let left = |x: u32| x < 2;
        let grey = |name: &str, at: &dyn Fn(u32) -> u8| {
            GrayImage::from_fn(4, 4, |x, _| Luma([at(x)])).save(folder.path(name)).unwrap();
        };
        for value in [0, 51, 255] {
            grey(&format!("grey{value}.png"), &|_| value);
        }
        grey("vary.png", &|x| if left(x) { 0 } else { 200 });
        let rgb = |name: &str, at: &dyn Fn(u32) -> [u8; 3]| {
            RgbImage::from_fn(4, 4, |x, _| Rgb(at(x))).save(folder.path(name)).unwrap();
        };
        rgb("red.png", &|_| [255, 0, 0]);
        rgb("coloured.png", &|x| if left(x) { [255, 0, 0] } else { [0, 255, 0] });
        rgb("flat.png", &|_| [128, 127, 255]);
        rgb("bumpy.png", &|x| if left(x) { [140, 128, 250] } else { [116, 128, 250] });
        let leaf = |x| if left(x) { Rgba([9, 99, 9, 0]) } else { Rgba([99, 9, 9, 255]) };
        RgbaImage::from_fn(4, 4, |x, _| leaf(x)).save(folder.path("leaf.png")).unwrap();
        std::fs::write(folder.path("broken.png"), b"\x89PNG\r\n\x1a\n and no more").unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn build(&self, mtl: &str) -> (Vec<Material>, Vec<MipChain>, Vec<String>) {
        let (materials, textures, report) = self.build_with(mtl, &RAW);
        (materials, textures, report.warnings())
    }

    fn build_with(&self, mtl: &str, options: &TextureOptions) -> (Vec<Material>, Vec<MipChain>, Report) {
        let path = self.path("m.mtl");
        std::fs::write(&path, mtl).unwrap();
        let report = Report::silent();
        let descs = mtl_material::materials(&mtl::load(&path, &report).unwrap(), &report);
        let (materials, textures) = build(&descs, options, &report);
        (materials, textures, report)
    }
}

/// Uncompressed, so that tests can compare texels.
const RAW: TextureOptions =
    TextureOptions { storage: Storage::Raw, cache: None, budget_bytes: None, dropped_levels: 0, anisotropy: 1 };

fn only(folder: &Folder, keys: &str) -> (Material, Vec<MipChain>, Vec<String>) {
    let (mut materials, textures, warnings) = folder.build(&format!("newmtl a\n{keys}"));
    (materials.remove(0), textures, warnings)
}

fn first_texel(texture: &MipChain) -> [u8; 4] {
    texture.levels[0][..4].try_into().unwrap()
}

#[test]
fn factors_and_their_defaults() {
    let folder = Folder::new();
    let material = |keys: &str| only(&folder, keys).0;
    let plain = material("");
    assert_eq!((plain.base_color_factor, plain.metallic_factor, plain.roughness_factor), (Vec3::splat(0.8), 0.0, 0.5));
    let pbr = material("Kd 1 0.5 0\nPm 0.75\nPr 0.25\nNs 1000");
    assert_eq!(
        (pbr.base_color_factor, pbr.metallic_factor, pbr.roughness_factor),
        (Vec3::new(1.0, 0.5, 0.0), 0.75, 0.25)
    );
    assert_eq!(material("Ks 0 0 0\nNs 50").roughness_factor, 1.0, "no highlight at all");
    assert!((material("Ks 1 1 1\nNs 30").roughness_factor - 0.5).abs() < 1e-6, "alpha² = 2/32");
    let clamped = only(&folder, "Kd 2 -1 0\nPr 7");
    assert_eq!((clamped.0.base_color_factor, clamped.0.roughness_factor, clamped.2.len()), (Vec3::X, 1.0, 2));
}

#[test]
fn constant_maps_become_factors() {
    let folder = Folder::new();
    let keys =
        "Kd 0.5 1 1\nmap_Kd red.png\nnorm flat.png\nPr 0.5\nmap_Pr grey51.png\nmap_Pm grey255.png\nmap_Ka grey255.png";
    let (material, textures, warnings) = only(&folder, keys);
    assert_eq!((textures.len(), warnings.len()), (0, 0));
    assert_eq!((material.base_color_map, material.normal_map, material.orm_map), (None, None, None));
    assert_eq!((material.base_color_factor, material.metallic_factor), (Vec3::new(0.5, 0.0, 0.0), 1.0));
    assert!((material.roughness_factor - 0.1).abs() < 1e-6, "{}", material.roughness_factor);
    let grey = only(&folder, "map_Kd grey51.png").0.base_color_factor.x;
    assert!((grey - 0.033_105).abs() < 1e-5, "sRGB 0.2 is linear 0.0331: {grey}");
}

#[test]
fn varying_maps_are_packed() {
    let folder = Folder::new();
    let (material, textures, _) =
        only(&folder, "map_Kd coloured.png\nnorm bumpy.png\nmap_Pr vary.png\nmap_Pm grey51.png");
    let map = |index: Option<usize>| &textures[index.unwrap()];
    assert_eq!(first_texel(map(material.base_color_map)), [255, 0, 0, 255]);
    assert_eq!(map(material.base_color_map).format, TexelFormat::Rgba8Srgb);
    assert_eq!(first_texel(map(material.normal_map)), [140, 128, 254, 255], "normalised");
    assert_eq!(map(material.normal_map).format, TexelFormat::Rgba8);
    assert_eq!(first_texel(map(material.orm_map)), [255, 0, 255, 255], "absent or constant channels are 1");
    assert_eq!(map(material.orm_map).format, TexelFormat::Rgba8);
    assert_eq!(material.roughness_factor, 1.0);
    assert!((material.metallic_factor - 0.2).abs() < 1e-6);
    let dark = only(&folder, "map_ao grey51.png");
    assert_eq!(first_texel(&dark.1[0]), [51, 255, 255, 255], "occlusion has no factor");
}

#[test]
fn ranges_are_those_of_factor_times_map() {
    let folder = Folder::new();
    let ranges = |keys: &str| {
        let material = only(&folder, keys).0;
        let cut = |range: [f32; 2]| range.map(|value| (value * 1000.0).round() / 1000.0);
        (cut(material.roughness_range), cut(material.metallic_range), material.occludes)
    };
    assert_eq!(ranges(""), ([0.5; 2], [0.0; 2], false));
    assert_eq!(ranges("Pr 0.5\nmap_Pr vary.png\nPm 1"), ([0.0, 0.392], [1.0; 2], false));
    assert_eq!(ranges("map_Pr grey51.png\nmap_Pm vary.png"), ([0.2; 2], [0.0, 0.784], false));
    assert_eq!(ranges("map_Pm grey255.png\nmap_ao vary.png"), ([0.5; 2], [1.0; 2], true));
    assert_eq!(ranges("map_ao grey51.png\nPr 0.3"), ([0.3; 2], [0.0; 2], true));
    assert_eq!(ranges("map_Pr missing.png\nPr 0.3\nmap_Pm broken.png"), ([0.3; 2], [0.0; 2], false));
}

#[test]
fn ambient_maps_are_occlusion_unless_they_repeat_the_colour() {
    let folder = Folder::new();
    assert!(only(&folder, "map_Kd coloured.png\nmap_Ka vary.png").0.orm_map.is_some());
    assert!(only(&folder, "map_Kd coloured.png\nmap_Ka COLOURED.png").0.orm_map.is_none());
    let both = only(&folder, "map_Ka vary.png\nmap_ao grey255.png");
    assert!(both.0.orm_map.is_none(), "map_ao takes precedence");
}

#[test]
fn bumps_become_normals_and_norm_wins() {
    let folder = Folder::new();
    let (material, textures, _) = only(&folder, "bump -bm 4 vary.png");
    let normals = &textures[material.normal_map.unwrap()];
    assert_ne!(normals.levels[0][4..8], [128, 128, 255, 255]);
    let (material, textures, _) = only(&folder, "bump bumpy.png");
    assert_eq!(first_texel(&textures[material.normal_map.unwrap()]), [140, 128, 254, 255], "normalised");
    assert_eq!(only(&folder, "norm flat.png\nbump vary.png").0.normal_map, None);
}

#[test]
fn cutouts() {
    let folder = Folder::new();
    let (material, textures, _) = only(&folder, "map_Kd coloured.png\nmap_d vary.png");
    let base_color = &textures[material.base_color_map.unwrap()];
    assert_eq!(
        (material.alpha_cutoff, first_texel(base_color), base_color.levels[0][15]),
        (Some(0.5), [255, 0, 0, 0], 200)
    );
    let (material, textures, _) = only(&folder, "map_Kd leaf.png");
    assert_eq!((material.alpha_cutoff, first_texel(&textures[0])), (Some(0.5), [9, 99, 9, 0]));
    let (material, textures, _) = only(&folder, "map_Kd red.png\nmap_d leaf.png");
    assert_eq!((material.base_color_factor, first_texel(&textures[0])), (Vec3::X, [255, 255, 255, 0]));
    for keys in ["map_Kd coloured.png\nmap_d grey255.png", "map_Kd coloured.png\nmap_d grey0.png", "map_d grey255.png"]
    {
        assert_eq!(only(&folder, keys).0.alpha_cutoff, None, "{keys}: a mask that cuts nothing out, or all");
    }
}

#[test]
fn textures_are_shared() {
    let folder = Folder::new();
    let keys = "map_Kd coloured.png\nnorm bumpy.png\nmap_Pr vary.png\n";
    let (materials, textures, _) =
        folder.build(&format!("newmtl a\n{keys}Kd 1 1 1\nnewmtl b\n{keys}Kd 0.5 1 1\nnewmtl c\nmap_Kd ./coloured.png"));
    assert_eq!(textures.len(), 3);
    assert_eq!(
        (materials[0].base_color_map, materials[0].orm_map),
        (materials[1].base_color_map, materials[1].orm_map)
    );
    assert_eq!(materials[0].base_color_map, materials[2].base_color_map);
}

#[test]
fn missing_and_broken_textures_are_warned_of_and_ignored() {
    let folder = Folder::new();
    let keys = "map_Kd no.png\nKd 0.5 0.5 0.5\nnorm broken.png\nmap_Pr broken.png\nmap_Pm vary.png\nmap_d gone.png";
    let (material, textures, warnings) = only(&folder, keys);
    assert_eq!(warnings[0], "m.mtl:2: map_Kd no.png: file not found; using the factor alone");
    assert_eq!(warnings.iter().filter(|w| w.starts_with("m.mtl:4: norm broken.png: ")).count(), 1, "{warnings:?}");
    assert_eq!(warnings.iter().filter(|w| w.starts_with("m.mtl:5: map_Pr broken.png: ")).count(), 1, "{warnings:?}");
    assert_eq!(warnings.len(), 4);
    assert_eq!(
        (material.base_color_factor, material.base_color_map, material.normal_map),
        (Vec3::splat(0.5), None, None)
    );
    assert_eq!((material.roughness_factor, textures.len()), (0.5, 1), "the metallic map is still there");
}

#[test]
fn other_letter_case_is_found_with_a_warning() {
    let folder = Folder::new();
    let (material, _, warnings) = only(&folder, "map_Kd COLOURED.PNG\nmap_ao COLOURED.PNG");
    assert!(material.base_color_map.is_some());
    if !folder.path("COLOURED.PNG").is_file() {
        assert_eq!(warnings, ["m.mtl:2: map_Kd COLOURED.PNG: found as coloured.png"]);
    }
}

#[test]
fn transparency_and_emission_are_read() {
    let folder = Folder::new();
    let (material, _, warnings) = only(&folder, "d 0.25\nKe 1 2 3");
    assert_eq!((material.opacity, material.blends, material.alpha_cutoff), (0.25, true, None));
    assert_eq!((material.emissive_factor, material.emissive_map), (Vec3::new(1.0, 2.0, 3.0), None));
    assert_eq!(warnings, [""; 0]);
    let (material, textures, warnings) = only(&folder, "Ke 0 0 0\nmap_Ke coloured.png\nd 0");
    assert_eq!((material.emissive_factor, first_texel(&textures[0])), (Vec3::ONE, [255, 0, 0, 255]));
    assert_eq!((material.opacity, material.blends), (1.0, false));
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert_eq!(only(&folder, "Ke 2 1 1\nmap_Ke red.png").0.emissive_factor, Vec3::new(2.0, 0.0, 0.0));
}

#[test]
fn roughness_without_a_map_gets_one_where_normals_lose_detail() {
    let folder = Folder::new();
    let (material, textures, _) = only(&folder, "norm bumpy.png\nPr 0.4");
    let surface = &textures[material.orm_map.unwrap()];
    assert_eq!((material.roughness_factor, first_texel(surface)), (1.0, [255, 102, 255, 255]));
    assert!(surface.levels[2][1] > 102, "the last level is rougher: {:?}", surface.levels[2]);
    // A factor goes into the map with it: 200 · 0.5.
    let (material, textures, _) = only(&folder, "norm bumpy.png\nPr 0.5\nPm 0.3\nmap_Pr vary.png");
    let surface = &textures[material.orm_map.unwrap()];
    assert_eq!((material.roughness_factor, material.metallic_factor, surface.levels[0][13]), (1.0, 0.3, 100));
    // The same surface with other normals, or with none, is another texture.
    let keys = "map_Pr vary.png\n";
    let (_, textures, _) = folder.build(&format!("newmtl a\n{keys}newmtl b\n{keys}norm bumpy.png"));
    assert_eq!(textures.len(), 3);
    assert_eq!(only(&folder, "norm flat.png\nPr 0.4").1.len(), 0, "flat normals lose nothing");
}

#[test]
fn cached_textures_equal_new_ones_and_are_not_decoded() {
    let folder = Folder::new();
    let options = TextureOptions {
        storage: Storage::Bc,
        cache: Some(Cache::in_folder(folder.path("cache"))),
        ..TextureOptions::default()
    };
    let mtl = "newmtl a\nmap_Kd coloured.png\nmap_d vary.png\nnorm bumpy.png\nmap_Pr vary.png\nmap_Pm grey51.png\n\
        newmtl b\nKd 0.5 1 1\nmap_Kd red.png\nnorm flat.png\nmap_Pr grey51.png\nnewmtl c\nmap_Kd leaf.png\nbump -bm 2 vary.png\n";
    let decoded = |report: &Report| report.times_ms().contains_key("decode");
    let without = folder.build_with(mtl, &TextureOptions { cache: None, ..options.clone() });
    let cold = folder.build_with(mtl, &options);
    let warm = folder.build_with(mtl, &options);
    assert!(decoded(&without.2) && decoded(&cold.2) && !decoded(&warm.2));
    for other in [&cold, &warm] {
        assert!((&without.0, &without.1) == (&other.0, &other.1), "{:?}", other.0);
    }
    // A changed picture, another strength of bumps, another factor.
    std::fs::copy(folder.path("grey255.png"), folder.path("grey51.png")).unwrap();
    assert!(decoded(&folder.build_with(mtl, &options).2));
    for (from, to) in [("-bm 2", "-bm 3"), ("norm bumpy.png", "norm bumpy.png\nPr 0.5")] {
        assert!(decoded(&folder.build_with(&mtl.replace(from, to), &options).2), "{to}");
    }
    assert!(!decoded(&folder.build_with(mtl, &options).2));
    // Broken pictures are warned of every time.
    for _ in 0..2 {
        let (_, _, report) = folder.build_with("newmtl a\nmap_Kd coloured.png\nmap_Pr broken.png", &options);
        assert_eq!(report.warnings().len(), 1, "{:?}", report.warnings());
    }
}

/// Where this fails because texels or facts have changed on purpose: raise [`TEXTURES_VERSION`], and put the new hash
/// here. Linux only: the last digits of powers are those of the system's library.
#[test]
#[cfg_attr(not(all(target_os = "linux", target_arch = "x86_64")), ignore = "other systems round other digits")]
fn cached_textures_change_only_with_their_version() {
    let folder = Folder::new();
    let options = TextureOptions { storage: Storage::Bc, ..TextureOptions::default() };
    let mtl = "newmtl a\nmap_Kd coloured.png\nmap_d vary.png\nnorm bumpy.png\nmap_Pr vary.png\nmap_ao grey51.png\n\
        newmtl b\nKd 0.5 1 1\nmap_Kd red.png\nmap_Pr grey51.png\nmap_Pm vary.png\nnewmtl c\nmap_Kd leaf.png\nbump -bm 2 vary.png\n";
    let (materials, textures, _) = folder.build_with(mtl, &options);
    let mut key = Key::default();
    for texture in &textures {
        key.add(format!("{} {} {:?}", texture.width, texture.height, texture.format).as_bytes());
        texture.levels.iter().for_each(|level| key.add(level));
    }
    for m in &materials {
        let facts = (m.metallic_factor, m.roughness_factor, m.metallic_range, m.roughness_range, m.occludes);
        key.add(format!("{:?} {facts:?} {:?}", m.base_color_factor.to_array(), m.alpha_cutoff).as_bytes());
    }
    assert_eq!((TEXTURES_VERSION, textures.len(), &key.text()[..16]), (1, 7, "df3e46f6f61ff7ce"));
}

#[test]
fn broken_entries_of_the_cache_are_recreated() {
    let folder = Folder::new();
    let options = TextureOptions {
        storage: Storage::Bc,
        cache: Some(Cache::in_folder(folder.path("cache"))),
        ..TextureOptions::default()
    };
    let mtl = "newmtl a\nmap_Kd coloured.png\nnorm bumpy.png\nmap_Pr vary.png";
    let build = || folder.build_with(mtl, &options);
    let good = build();
    let entries = || -> Vec<(PathBuf, Vec<u8>)> {
        let paths = std::fs::read_dir(folder.path("cache")).unwrap().map(|entry| entry.unwrap().path());
        let mut all: Vec<_> = paths.map(|path| (path.clone(), std::fs::read(path).unwrap())).collect();
        all.sort();
        all
    };
    let whole = entries();
    assert_eq!(whole.len(), 3);
    type Harm = fn(&[u8], &[u8]) -> Vec<u8>;
    let harms: [(&str, Harm); 5] = [
        ("truncated", |bytes, _| bytes[..bytes.len() / 2].to_vec()),
        ("empty", |_, _| Vec::new()),
        ("garbage", |bytes, _| vec![0x5a; bytes.len()]),
        ("of another texture", |_, other| other.to_vec()),
        ("a corrupted texel", |bytes, _| [&bytes[..bytes.len() - 1], &[bytes[bytes.len() - 1] ^ 0x40]].concat()),
    ];
    for (name, harm) in harms {
        for (i, (path, bytes)) in whole.iter().enumerate() {
            std::fs::write(path, harm(bytes, &whole[(i + 1) % whole.len()].1)).unwrap();
        }
        let again = build();
        assert!(again.2.times_ms().contains_key("decode"), "{name}: taken");
        assert!((&good.0, &good.1) == (&again.0, &again.1) && entries() == whole, "{name}: made otherwise");
    }
}

#[test]
fn a_colour_picture_that_is_its_own_mask_cuts_by_alpha_alone() {
    let folder = Folder::new();
    let (material, textures, _) = only(&folder, "map_Kd coloured.png\nmap_d coloured.png");
    assert_eq!((material.alpha_cutoff, first_texel(&textures[0])), (None, [255, 0, 0, 255]), "its red is no coverage");
    assert!(only(&folder, "map_Kd leaf.png\nmap_d leaf.png").0.alpha_cutoff.is_some());
    assert!(only(&folder, "map_Kd leaf.png\nmap_d vary.png").0.alpha_cutoff.is_some(), "another picture's grey is");
    assert!(only(&folder, "map_Kd red.png\nmap_d -imfchan g coloured.png").0.alpha_cutoff.is_some());
    assert!(only(&folder, "map_Kd red.png\nmap_d -imfchan m coloured.png").0.alpha_cutoff.is_none());
}

#[test]
fn channels_are_picked_by_name() {
    let folder = Folder::new();
    RgbImage::from_fn(4, 4, |x, _| Rgb([255, if x < 2 { 0 } else { 200 }, 51])).save(folder.path("orm.png")).unwrap();
    let (material, textures, _) = only(&folder, "map_ORM orm.png");
    assert_eq!(first_texel(&textures[0]), [255, 0, 255, 255]);
    assert_eq!((material.metallic_factor, material.occludes), (0.2, false));
    assert_eq!(only(&folder, "map_Pm -imfchan b orm.png").0.metallic_factor, 0.2);
    let luminance = only(&folder, "map_Pm -imfchan l red.png").0.metallic_factor;
    assert!((luminance - 0.2126).abs() < 0.002, "{luminance}");
}

#[test]
fn zeros_beside_maps_and_values_out_of_range_are_warned_of() {
    let folder = Folder::new();
    let (material, _, warnings) = only(&folder, "Pm 0\nmap_Pm grey255.png\nPr 0\nmap_Pr grey51.png");
    assert_eq!((material.metallic_factor, material.roughness_factor), (1.0, 0.2));
    assert_eq!(
        warnings,
        ["m.mtl: material a: Pm 0 with map_Pm; taken as 1", "m.mtl: material a: Pr 0 with map_Pr; taken as 1"]
    );
    let (material, _, warnings) = only(&folder, "Pm 1e30\nPr -5");
    assert_eq!((material.metallic_factor, material.roughness_factor), (1.0, 0.0));
    assert!(
        warnings[1].contains("Pr -5 is not between 0 and 1; clamped") && warnings[0].contains("Pm 1"),
        "{warnings:?}"
    );
    assert_eq!(only(&folder, "Pm 0\nPr 0").2, [""; 0]);
}

/// The values that Blender 3.4 writes for roughness 0.5 and for a metal of roughness 0.2.
#[test]
fn blenders_roughness_and_metalness_come_back() {
    let folder = Folder::new();
    let text = "# Blender 3.4.1 MTL File: 'None'\nnewmtl plain\nNs 250.000000\nKa 1 1 1\nKs 0.5 0.5 0.5\nillum 2\n\
        newmtl metal\nNs 640.000000\nKa 1 1 1\nKs 0.5 0.5 0.5\nillum 3\n";
    let values = |text: &str| {
        let (materials, _, warnings) = folder.build(text);
        assert_eq!(warnings, [""; 0]);
        materials.iter().map(|m| (m.roughness_factor, m.metallic_factor)).collect::<Vec<_>>()
    };
    let got = values(text);
    assert!((got[0].0 - 0.5).abs() < 1e-6 && (got[1].0 - 0.2).abs() < 1e-6, "{got:?}");
    assert_eq!([got[0].1, got[1].1], [0.0, 1.0]);
    let foreign = values(&text.replace("# Blender", "# Maya"));
    assert!(foreign[0].0 < 0.35 && foreign[1].1 == 0.0, "{foreign:?}");
}

#[test]
fn glass_of_an_illumination_model_lets_light_through() {
    let folder = Folder::new();
    let of = |text: &str| only(&folder, text).0;
    let glass = of("Kd 0 0 0\nillum 7\nNi 1.5\nPr 0");
    assert!(glass.blends && glass.transmission == Some(Vec3::ONE) && (glass.opacity - 0.04 - 0.96 / 21.0).abs() < 1e-6);
    assert_eq!((glass.base_color_factor, glass.metallic_factor, glass.roughness_factor), (Vec3::ONE, 1.0, 0.0));
    let bottle = of("Kd 0 0 0\nillum 4\nTf 0.2 0.8 0.1");
    assert!(bottle.tints() && bottle.transmission == Some(Vec3::new(0.2, 0.8, 0.1)) && bottle.opacity == glass.opacity);
    assert_eq!(of("Kd 0 0 0\nillum 4\nTf 0 0 0").transmission, Some(Vec3::ONE));
    let (_, _, warnings) = only(&folder, "Kd 0.1 0 0\nillum 4\nTf 1 0 0");
    assert!(warnings[0].contains("material a: Tf: colours what goes through glass alone"), "{warnings:?}");
    let diamond = of("Kd 0 0 0\nillum 6\nNi 2.4");
    assert!((diamond.dielectric_f0 - (1.4f32 / 3.4).powi(2)).abs().max_element() < 1e-6 && diamond.opacity > 0.2);
    // Models 6 and 7 refract, which bodies alone can show.
    assert!(
        diamond
            .refraction
            .is_some_and(|refraction| (refraction.ior - 2.4).abs() < 1e-4 && refraction.shape == BodyShape::Other)
    );
    assert!(glass.refraction.is_some() && bottle.refraction.is_none());
    // As programs write it for anything, or with other words for what is covered; metal.
    for other in
        ["Kd 0.1 0 0\nillum 7", "Kd 0 0 0\nillum 2", "Kd 0 0 0\nPm 1\nillum 7", "Kd 0 0 0\nmap_d vary.png\nillum 7"]
    {
        assert!(of(other).transmission.is_none(), "{other}");
    }
    let covered = of("Kd 0 0 0\nd 0.5\nillum 9");
    assert!(covered.blends && covered.transmission.is_none() && covered.opacity == 0.5);
    assert_eq!(of("Kd 1 1 1\nNi 1.45").dielectric_f0, Vec3::splat(0.04));
    assert_eq!(of("Kd 1 1 1\nanisor 0.3").anisotropy, Vec2::ZERO);
    assert!(of("Kd 1 1 1\naniso 0.5\nanisor 0.25").anisotropy.abs_diff_eq(Vec2::new(0.0, 0.5), 1e-6));
}

/// The material of a plain desc with these extension maps, and its textures.
fn with_extension(folder: &Folder, of: Extension, [color, number]: [Option<&str>; 2]) -> (Material, Vec<MipChain>) {
    let map = |name: &str, pick| MapDesc {
        image: ImageSource::file(folder.path(name)),
        pick,
        second_uv: true,
        sampling: Sampling::default(),
        origin: format!("a: {name}"),
    };
    let [color, number] = [color.map(|name| map(name, Pick::Red)), number.map(|name| map(name, Pick::Alpha))];
    let desc = MaterialDesc {
        extension_maps: Some(ExtensionMaps { of, color, number }),
        sheen: Vec3::new(1.0, 0.5, 0.0),
        anisotropy: Vec2::X,
        ..MaterialDesc::plain("a", Vec3::ONE, 0.0, 0.5)
    };
    let report = Report::silent();
    let (mut materials, textures) = build(&[desc], &RAW, &report);
    assert_eq!(report.warnings(), [""; 0]);
    (materials.remove(0), textures)
}

#[test]
fn maps_of_extensions_are_packed_in_one_texture() {
    let folder = Folder::new();
    let save = |name: &str, texel: fn(u32) -> [u8; 4]| {
        let picture = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba(texel(x)));
        picture.save(folder.path(name)).unwrap();
    };
    save("both.png", |x| [[255, 0, 128, 51], [0, 255, 128, 204]][x as usize]);
    save("red.png", |_| [188, 0, 0, 255]);
    save("along.png", |x| [[255, 128, 255, 255], [0, 255, 128, 255]][x as usize]);
    let (sheen, textures) = with_extension(&folder, Extension::Sheen, [Some("both.png"), Some("both.png")]);
    assert_eq!((sheen.extension_map, sheen.lookups[4].second_uv), (Some((Extension::Sheen, 0)), true));
    assert_eq!((textures[0].format, first_texel(&textures[0])), (TexelFormat::Rgba8Srgb, [255, 0, 128, 51]));
    let (color, textures) = with_extension(&folder, Extension::Sheen, [Some("both.png"), None]);
    assert!(color.extension_map.is_some() && first_texel(&textures[0]) == [255, 0, 128, 255], "alpha means nothing");
    let (number, textures) = with_extension(&folder, Extension::Specular, [None, Some("both.png")]);
    assert!(number.has_specular_factors() && first_texel(&textures[0]) == [255, 255, 255, 51]);
    // Of one color it is a factor: 188 is half of 255 in linear light.
    let (factor, textures) = with_extension(&folder, Extension::Sheen, [Some("red.png"), None]);
    assert!(factor.extension_map.is_none() && textures.is_empty());
    assert!((factor.sheen_color - Vec3::new(0.5, 0.0, 0.0)).abs().max_element() < 0.005, "{}", factor.sheen_color);
    // Directions are as long as they are strongly stretched; the second one's is clamped to 1 first.
    let (along, textures) = with_extension(&folder, Extension::Anisotropy, [Some("along.png"), None]);
    assert_eq!((along.extension_map, textures[0].format), (Some((Extension::Anisotropy, 0)), TexelFormat::Rgba8));
    assert_eq!(textures[0].levels[0], [255, 128, 0, 255, 82, 173, 0, 255]);
    assert_eq!(textures[0].levels[1], [169, 151, 0, 255], "the mean");
}
