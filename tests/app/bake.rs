//! Baked files: their content, also by an independent reader, and the command's output.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use crate::common::{Workshop, entries, finish, json, material, program, setup, sphere, succeeds, validated};
use half::f16;
use pbr_vr::asset::ktx2::{Ktx2, TexelFormat};
use pbr_vr::asset::{Panorama, Report};
use pbr_vr::context::Context;
use pbr_vr::gpu::{Format, Gpu, Image, ImageDesc, ImageUsageFlags, Shape, Subresource, read_image, write_mips};
use pbr_vr::precompute::{BrdfTable, LightMaps, Options, read_texture};
use pbr_vr::reference::brdf::Geometry;
use pbr_vr::reference::levels::{LEVELS, alpha_from_level};
use pbr_vr::reference::split_sum::SplitSum;
use pbr_vr::view::{BakeRequest, bake};

const FILES: [&str; 3] = ["brdf.ktx2", "irradiance.ktx2", "specular.ktx2"];
const MOST_BYTES: u64 = 1 << 30;

fn baked(shop: &Workshop, panorama: &Path, face_size: u32) {
    let folder = shop.path("new/folder");
    let request = BakeRequest { input: panorama.into(), output: folder, size: face_size, json: None };
    let facts = bake(&request, &setup(None)).expect("baking without validation messages");
    assert_eq!(facts.files.len(), 3);
}

fn read(shop: &Workshop, name: &str) -> Ktx2 {
    Ktx2::read(&shop.path("new/folder").join(name), MOST_BYTES).expect("a baked file")
}

/// What another reader says of a file must be what ours says.
fn check_with_other_reader(path: &Path, ours: &Ktx2) {
    let bytes = fs::read(path).expect("a baked file");
    let theirs = ktx2::Reader::new(&bytes).expect("a KTX2 file to the other reader too");
    let header = theirs.header();
    assert_eq!(header.format.map(|f| f.value()), Some(ours.format.vulkan()));
    assert_eq!([header.pixel_width, header.pixel_height, header.pixel_depth], [ours.size[0], ours.size[1], 0]);
    assert_eq!([header.layer_count, header.face_count], [ours.layers, ours.faces]);
    assert_eq!(header.level_count as usize, ours.levels.len());
    assert!(header.supercompression_scheme.is_none());
    let levels: Vec<&[u8]> = theirs.levels().map(|level| level.data).collect();
    assert_eq!(levels, ours.levels, "{}", path.display());
    let said: BTreeMap<String, Vec<u8>> =
        theirs.key_value_data().map(|(key, value)| (key.to_owned(), value.to_vec())).collect();
    assert_eq!(said, ours.key_values);
    assert_eq!(theirs.writer().map(|w| w.trim_end_matches('\0')), ours.text("KTXwriter"));
    // The descriptor that the other reader's authors make for this format.
    let format = header.format.expect("checked above");
    let (descriptor, type_size) = ktx2::dfd::Basic::from_format(format).expect("a descriptor");
    assert_eq!(theirs.basic_dfd(), Some(&descriptor));
    assert_eq!(header.type_size, type_size);
}

/// Every texel of an image, read back one face of one mip at a time: level after level, face after face.
fn texels(gpu: &Arc<Gpu>, image: &Image, format: TexelFormat) -> Vec<Vec<u8>> {
    let desc = image.desc();
    let face = |mip, layer| read_image(gpu, image, Subresource { mip, layer }, format.bytes().into()).expect("texels");
    (0..desc.mips).map(|mip| (0..desc.shape.layers()).flat_map(|layer| face(mip, layer)).collect()).collect()
}

#[test]
fn files_hold_the_maps_bit_for_bit_and_another_reader_agrees() {
    let shop = Workshop::new();
    let panorama = shop.sky(0.0);
    baked(&shop, &panorama, 64);
    let mut names: Vec<_> =
        fs::read_dir(shop.path("new/folder")).expect("it was made").map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, FILES, "nothing else is left there");
    let [brdf, irradiance, specular] = FILES.map(|name| read(&shop, name));
    for (name, texture) in FILES.iter().zip([&brdf, &irradiance, &specular]) {
        check_with_other_reader(&shop.path("new/folder").join(name), texture);
    }
    let gpu = Gpu::open(validated()).expect("a GPU");
    let panorama = Panorama::load(&panorama, &Report::silent()).expect("the panorama");
    let light = LightMaps::new(&Context::silent(&gpu), &panorama, Options { face_size: 64, ..Options::default() })
        .expect("maps");
    let table = BrdfTable::new(&Context::silent(&gpu), Geometry::Smith, SplitSum::Moment).expect("a table");
    assert_eq!(irradiance.levels, texels(&gpu, &light.irradiance_over_pi, irradiance.format));
    assert_eq!(brdf.levels, texels(&gpu, &table.image, brdf.format));
    assert_eq!((brdf.format, brdf.layers, brdf.faces), (TexelFormat::Rgba32Float, 2, 1));
    let [even, odd] = light.specular.each_ref().map(|cube| texels(&gpu, cube, specular.format));
    let expected: Vec<Vec<u8>> = even.into_iter().zip(odd).map(|(even, odd)| [even, odd].concat()).collect();
    assert_eq!(specular.levels, expected);
    assert!(specular.levels[0].chunks_exact(8).any(|t| t != &specular.levels[0][..8]), "it holds a picture");
    assert_eq!((specular.size, specular.layers, specular.faces, specular.levels.len()), ([64, 64], 2, 6, LEVELS / 2));
    let roughness: Vec<f64> =
        specular.text("pbrvrRoughness").expect("a key").split(' ').map(|r| r.parse().expect("a number")).collect();
    assert_eq!(roughness.len(), LEVELS);
    let error = |(level, r): (usize, &f64)| (r - alpha_from_level(level).sqrt()).abs();
    assert!(roughness.iter().enumerate().map(error).all(|e| e < 1e-6), "{roughness:?}");
    assert!(roughness[0] == 0.0 && roughness.last() >= Some(&1.0) && roughness.is_sorted(), "{roughness:?}");
    assert!(
        specular
            .text("pbrvrContent")
            .is_some_and(|content| ["i / 2", "i % 2"].iter().all(|part| content.contains(part)))
    );
    let messages = gpu.messages();
    drop((light, table, gpu));
    messages.check().expect("no validation message");
}

#[test]
fn a_sun_beyond_halves_is_written_in_floats_and_keeps_its_radiance() {
    let shop = Workshop::new();
    let panorama = shop.sky(5e6);
    baked(&shop, &panorama, 16);
    let gpu = Gpu::open(validated()).expect("a GPU");
    let panorama = Panorama::load(&panorama, &Report::silent()).expect("the panorama");
    let light = LightMaps::new(&Context::silent(&gpu), &panorama, Options { face_size: 16, ..Options::default() })
        .expect("maps");
    assert!(light.scale > 1.0);
    let specular: Vec<&Image> = light.specular.iter().map(|map| &**map).collect();
    let maps = [("irradiance.ktx2", vec![&*light.irradiance_over_pi]), ("specular.ktx2", specular)];
    for (name, map) in maps {
        let file = read(&shop, name);
        check_with_other_reader(&shop.path("new/folder").join(name), &file);
        assert_eq!(file.format, TexelFormat::Rgba32Float);
        let halves = read_texture(&gpu, &map).expect("the map").levels.concat();
        let floats = file.levels.concat();
        assert_eq!(floats.len(), 2 * halves.len());
        for (i, (float, half)) in floats.chunks_exact(4).zip(halves.chunks_exact(2)).enumerate() {
            let half = f16::from_le_bytes([half[0], half[1]]).to_f32();
            let expected = if i % 4 == 3 { half } else { half * light.scale };
            assert_eq!(float, expected.to_le_bytes(), "number {i} of {name}");
        }
        let brightest =
            floats.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).fold(0.0, f32::max);
        assert!(brightest > 1e5, "{name}: the sun is clamped to {brightest}");
    }
}

#[test]
fn images_become_textures_and_several_an_array() {
    let gpu = Gpu::open(validated()).expect("a GPU");
    let messages = gpu.messages();
    let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
    let desc = |shape, mips| ImageDesc { shape, mips, ..ImageDesc::flat(Format::R16G16_SFLOAT, [8, 8], usage) };
    let make = |shape, mips| Image::new(&gpu, "test", desc(shape, mips)).expect("an image");
    // Counts upwards from `first`, over all mips.
    let content = |image: &Image, first: u32| -> Vec<Vec<u8>> {
        let mut numbers = first..;
        let texels = |mip| (image.mip_size(mip).iter().product::<u32>() * image.desc().shape.layers()) as usize;
        (0..image.desc().mips)
            .map(|mip| numbers.by_ref().take(texels(mip)).flat_map(|n| (n % 30_000).to_le_bytes()).collect())
            .collect()
    };
    let cubes = [make(Shape::Cube, 3), make(Shape::Cube, 3)];
    let layers = make(Shape::Layers(2), 2);
    let contents = [content(&cubes[0], 0), content(&cubes[1], 20_000), content(&layers, 7)];
    let images: [(&Image, &[Vec<u8>]); 3] =
        [(&cubes[0], &contents[0][..]), (&cubes[1], &contents[1][..]), (&layers, &contents[2][..])];
    let times = write_mips(&gpu, "filling", &images).expect("filled images");
    assert_eq!(times.iter().map(|pass| pass.name).collect::<Vec<_>>(), ["filling"]);
    let array = read_texture(&gpu, &[&cubes[0], &cubes[1]]).expect("an array of cubes");
    assert_eq!((array.size, array.layers, array.faces), ([8, 8], 2, 6));
    let both: Vec<Vec<u8>> = contents[0].iter().zip(&contents[1]).map(|(a, b)| [&a[..], b].concat()).collect();
    assert_eq!(array.levels, both);
    let one = read_texture(&gpu, &[&layers]).expect("an array");
    assert_eq!((one.layers, one.faces, &one.levels), (2, 1, &contents[2]));
    let shop = Workshop::new();
    for (name, texture) in [("array.ktx2", array), ("one.ktx2", one)] {
        texture.write(&shop.path(name)).expect("a file");
        let back = Ktx2::read(&shop.path(name), MOST_BYTES).expect("the file");
        assert_eq!(back.levels, texture.levels);
        check_with_other_reader(&shop.path(name), &back);
    }
    assert!(read_texture(&gpu, &[&cubes[0], &layers]).is_err(), "two shapes");
    assert!(read_texture(&gpu, &[&layers, &layers]).is_err(), "an array of arrays");
    assert!(read_texture(&gpu, &[]).is_err());
    drop((cubes, layers, gpu));
    messages.check().expect("no validation message");
}

#[test]
fn bake_tells_what_it_wrote_and_how_long_it_took() {
    let shop = Workshop::new();
    shop.sky(0.0);
    let folder = shop.folder.path();
    let bake = ["bake", "sky.exr", "-o", "a/b", "--size", "32", "--json", "facts.json", "--validate", "--no-cache"];
    let said = succeeds(program(folder, &bake));
    assert_eq!(said.lines().count(), 3, "{said}");
    assert!(FILES.iter().all(|name| said.contains(name) && folder.join("a/b").join(name).is_file()), "{said}");
    let facts = json(&folder.join("facts.json"));
    assert!(facts["gpu"].is_string() && facts["face_size"] == 32 && facts["warnings"].is_array(), "{facts}");
    assert_eq!(facts["files"].as_array().map(Vec::len), Some(3));
    let ms = |value: &serde_json::Value| value.as_f64().is_some_and(|ms| ms > 0.0);
    for stage in facts["stages"].as_array().expect("stages") {
        assert!(ms(&stage["wall_ms"]), "{stage}");
        let is_gpu_work = ["light maps", "BRDF table"].contains(&stage["name"].as_str().unwrap_or_default());
        let times = stage["gpu"].as_array().expect("GPU times");
        assert!(times.is_empty() != is_gpu_work && times.iter().all(|pass| ms(&pass["ms"])), "{stage}");
    }
    // Over the old ones, with the same bytes.
    let before = entries(&folder.join("a/b"));
    succeeds(program(folder, &bake));
    assert_eq!(entries(&folder.join("a/b")), before);
}

#[test]
fn bake_fails_with_one_line() {
    let shop = Workshop::new();
    shop.sky(0.0);
    let folder = shop.folder.path();
    shop.write("file", "in the way");
    shop.write("broken.hdr", "#?RADIANCE\n");
    let cases: [(&[&str], i32, &str); 9] = [
        (&["bake", "sky.exr", "-o", "out", "--size", "100"], 2, "100"),
        (&["bake", "sky.exr", "-o", "out", "--size", "8"], 2, "16"),
        (&["bake", "sky.exr", "-o", "out", "--size", "2048"], 2, "1024"),
        (&["bake", "sky.exr", "-o", "out", "--size", "big"], 2, "big"),
        (&["bake", "sky.exr"], 2, "--output"),
        (&["bake", "none.exr", "-o", "out"], 1, "none.exr"),
        (&["bake", "broken.hdr", "-o", "out"], 1, "broken.hdr"),
        (&["bake", "sky.exr", "-o", "file"], 1, "file"),
        (&["bake", "sky.exr", "-o", "file/below"], 1, "file"),
    ];
    for (arguments, status, part) in cases {
        let output = finish(program(folder, arguments));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {said}");
        assert!(said.contains(part), "{arguments:?}: {said}");
    }
    assert!(!folder.join("out").exists(), "what fails leaves no folder");
}

/// A shiny strip of metal that lies, a matt one that stands on it, and a probe by hand.
pub fn strips(shop: &Workshop, probes: usize) {
    shop.sky(3.0);
    shop.write("strips.mtl", "newmtl metal\nKd 0.9 0.8 0.7\nPr 0.2\nPm 1\nnewmtl matt\nKd 0.7 0.3 0.3\nPr 1\nPm 0\n");
    shop.write(
        "strips.obj",
        "mtllib strips.mtl\nusemtl metal\nv -2 0 -0.3\nv 2 0 -0.3\nv 2 0 0.3\nv -2 0 0.3\nf 4 3 2\nf 4 2 1\n\
         usemtl matt\nv -1 0 -0.1\nv 1 0 -0.1\nv 1 0.6 -0.1\nv -1 0.6 -0.1\nf 5 6 7\nf 5 7 8\n",
    );
    let probe = |x: usize| format!("[[probe]]\nposition = [{x}, 0.4, 0.5]\nbox = [[-2, 0, -1], [2, 1.5, 1.5]]\n");
    let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"strips.obj\"\n\
        [[light]]\npoint = { position = [0.5, 1.2, -0.8], intensity = [3, 3, 3] }\n\
        [[camera]]\nname = \"a\"\nposition = [0, 9, 25]\ntarget = [0, 0.2, 0]\nvertical_fov_degrees = 40\n";
    shop.write("strips.toml", &(0..probes).map(probe).fold(text.to_owned(), |all, one| all + &one));
}

#[test]
fn a_scenes_light_is_written_with_all_its_probes_and_another_reader_agrees() {
    let shop = Workshop::new();
    strips(&shop, 2);
    shop.write("bulb.mtl", &format!("{}Ke 9 8 7\n", material([0.5; 3], 0.0, 1.0)));
    shop.write("bulb.obj", &sphere("bulb.mtl"));
    let scene = std::fs::read_to_string(shop.path("strips.toml")).expect("a scene");
    let bulb = "[[model]]\nfile = \"bulb.obj\"\ntranslation = [0.5, 1.2, 0.5]\nscale = 0.05\n";
    shop.write("strips.toml", &(scene + bulb));
    let folder = shop.folder.path();
    let bake = ["bake", "strips.toml", "-o", "new/folder", "--json", "facts.json", "--validate"];
    let said = succeeds(program(folder, &bake));
    let names = ["light.json", "lightmap.ktx2", "probe-specular.ktx2"];
    let written = entries(&folder.join("new/folder"));
    assert_eq!(written.keys().filter_map(|path| path.file_name()?.to_str()).collect::<Vec<_>>(), names);
    assert!(names.iter().all(|name| said.contains(name)), "{said}");
    let [lightmap, specular] = [names[1], names[2]].map(|name| {
        let texture = read(&shop, name);
        check_with_other_reader(&shop.path("new/folder").join(name), &texture);
        texture
    });
    let meaning = json(&folder.join("new/folder/light.json"));
    let sides = meaning["lightmap"]["layers"].as_u64().expect("a number") as u32;
    assert_eq!(meaning["lightmap"]["size"], lightmap.size[0]);
    assert_eq!((lightmap.layers, lightmap.faces, lightmap.levels.len()), (3 * sides, 1, 1));
    assert_eq!((specular.layers, specular.faces, specular.levels.len()), (4, 6, LEVELS / 2));
    assert_eq!(meaning["roughness"].as_array().map(Vec::len), Some(LEVELS));
    let probes = meaning["probes"].as_array().expect("probes");
    let x: Vec<f64> = probes.iter().map(|probe| probe["position"][0].as_f64().expect("a number")).collect();
    assert_eq!(x, [0.0, 1.0]);
    assert!(probes.iter().all(|probe| probe["low"][0] == -2.0 && probe["high"][1] == 1.5), "{meaning}");
    let lights = meaning["sphere_lights"].as_array().expect("sphere lights");
    assert!(lights.len() == 1 && lights[0]["radiance"] == serde_json::json!([9.0, 8.0, 7.0]), "{meaning}");

    // Light, and all of it: no cube is dark, no two are alike, and the roughest level varies less.
    let value = |bytes: &[u8]| f64::from(f16::from_le_bytes([bytes[0], bytes[1]]));
    assert_eq!(specular.format, TexelFormat::Rgba16Float);
    let of = |texture: &Ktx2, level: usize, cube: usize| -> Vec<f64> {
        let bytes = &texture.levels[level];
        let each = bytes.len() / texture.layers as usize;
        bytes[cube * each..][..each].chunks_exact(8).map(value).collect()
    };
    let spread = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|v| (v - mean).abs()).sum::<f64>() / values.len() as f64 / mean
    };
    for probe in 0..2 {
        let levels: Vec<f64> = (0..LEVELS).map(|i| spread(&of(&specular, i / 2, probe + 2 * (i % 2)))).collect();
        assert!(levels[LEVELS - 1] < 0.9 * levels[0] && levels[LEVELS - 1] > 0.0, "{levels:?}");
        let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
        let [sharp, even] = [mean(of(&specular, 0, probe)), mean(of(&specular, (LEVELS - 1) / 2, probe + 2))];
        assert!((even / sharp - 1.0).abs() < 0.2, "{sharp} and {even}");
    }
    assert!(of(&specular, 0, 0) != of(&specular, 0, 1), "one probe's light twice");
    let brightest = |layer: u32| of(&lightmap, 0, layer as usize).into_iter().fold(0.0, f64::max);
    assert!(brightest(0) > 0.0 && brightest(2 * sides) > 0.0, "no irradiance, or nothing blocks");
    let facts = json(&folder.join("facts.json"));
    assert_eq!(facts["files"].as_array().map(Vec::len), Some(2));
    assert!(facts["light_ms"].as_f64().is_some_and(|ms| ms > 0.0) && facts["triangles"].as_u64() > Some(4), "{facts}");
    // From the cache, with the same bytes.
    succeeds(program(folder, &bake));
    assert!(entries(&folder.join("new/folder")) == written);
}
