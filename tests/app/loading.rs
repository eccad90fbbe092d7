//! Loading, end to end: files cut short, damaged or lying are refused and never crash; the test scenes come out whole.

use std::io::Cursor;
use std::path::Path;
use std::time::{Duration, Instant};

use pbr_vr::asset::image_source::ImageSource;
use pbr_vr::asset::picture::Picture;
use pbr_vr::asset::texture::Encoding;
use pbr_vr::asset::{Panorama, Report, Texture};
use pbr_vr::scene::{self, LoadOptions, Scene};
use pbr_vr::{Error, Result};

use crate::common::{gltf, scenes};

/// Numbers that look random and are the same in every run (Marsaglia, "Xorshift RNGs", 2003).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end as u64) as usize
    }
}

/// Loads every prefix of `bytes`, about `steps` of them, and as many copies with a few bytes changed. Each must be
/// loaded or refused; a panic fails the test. Every error must say which file it is about.
fn torture(name: &str, bytes: &[u8], steps: usize, load: impl Fn(&Path) -> Result<()>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let outcome = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let outcome = load(&path);
        if let Err(error) = &outcome {
            assert!(error.to_string().contains(name.split('.').next().unwrap()), "{error}");
        }
        outcome
    };
    outcome(bytes).unwrap_or_else(|error| panic!("{name} is good: {error}"));
    assert!(outcome(&[]).is_err() || name.ends_with(".toml") || name.ends_with(".mtl"), "{name}: empty");
    for length in (0..bytes.len()).step_by((bytes.len() / steps).max(1)) {
        let _ = outcome(&bytes[..length]);
    }
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let interesting = [0, 1, 0x7f, 0x80, 0xff, b'-', b'9', b' ', b'\n', b'/'];
    for _ in 0..steps {
        let mut changed = bytes.to_vec();
        // The header is short and holds what hurts most.
        let end = if random.below(2) == 0 { changed.len().min(400) } else { changed.len() };
        for _ in 0..=random.below(4) {
            let at = random.below(end);
            // Another number may be as harmful as it is well formed.
            if changed[at].is_ascii_digit() && random.below(4) > 0 {
                changed[at] = b'0' + random.below(10) as u8;
                continue;
            }
            changed[at] = match random.below(3) {
                0 => interesting[random.below(interesting.len())],
                1 => changed[at] ^ (1 << random.below(8)),
                _ => random.below(256) as u8,
            };
        }
        let _ = outcome(&changed);
    }
}

fn load_scene(path: &Path) -> Result<()> {
    let scene = scene::load(path, &LoadOptions::default(), &Report::silent())?;
    check(&scene);
    Ok(())
}

/// What a loaded scene promises to the renderer.
fn check(scene: &Scene) {
    for mesh in &scene.meshes {
        assert!(mesh.material < scene.materials.len() && mesh.indices.len() % 3 == 0);
        assert!(mesh.indices.iter().all(|i| (*i as usize) < mesh.vertices.len()));
        for v in &mesh.vertices {
            let all = [&v.position[..], &v.normal, &v.uv, &v.uv1, &v.tangent].concat();
            assert!(all.iter().all(|x| x.is_finite()), "{v:?}");
            let (n, t) = (glam::Vec3::from(v.normal), glam::Vec4::from(v.tangent));
            assert!((n.length() - 1.0).abs() < 1e-3 && (t.truncate().length() - 1.0).abs() < 1e-2, "{v:?}");
            assert!(t.truncate().dot(n).abs() < 2e-2 && t.w.abs() == 1.0, "{v:?}");
        }
    }
    for material in &scene.materials {
        let maps = material.maps();
        assert!(maps.into_iter().flatten().all(|map| map < scene.textures.len()));
    }
    for texture in &scene.textures {
        let blocks = texture.width.div_ceil(4) as usize * texture.height.div_ceil(4) as usize;
        assert_eq!(texture.levels[0].len(), blocks * 16, "{}", texture.name);
    }
    assert!(scene.instances.iter().all(|instance| instance.mesh < scene.meshes.len()));
    assert!(!scene.cameras.is_empty());
}

fn load_panorama(path: &Path) -> Result<()> {
    let panorama = Panorama::load(path, &Report::silent())?;
    assert_eq!(panorama.texels.len(), panorama.width as usize * panorama.height as usize);
    assert!(panorama.texels.as_flattened().iter().all(|v| v.is_finite() && *v >= 0.0));
    Ok(())
}

fn load_texture(path: &Path) -> Result<()> {
    let texture = Texture::load(&ImageSource::file(path.to_owned()), Encoding::Srgb)?;
    assert_eq!(texture.pixels.len(), texture.width as usize * texture.height as usize * 4);
    Ok(())
}

fn load_picture(path: &Path) -> Result<()> {
    let picture = Picture::read(path)?;
    assert_eq!(picture.pixels.len(), picture.width as usize * picture.height as usize);
    Ok(())
}

const OBJ: &str = "# a model\nmtllib a.mtl\no one\nv -1 0 -1\nv 1 0 -1.5e0\nv 1 1 1 1.0\nv -1 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
    vn 0 1 0\nusemtl red\nf 1/1/1 2/2/1 3/3/1 4/4/1\ng two \\\n three\nusemtl blue\nf -4/-4/-1 -3/-3/-1 -2/-2/-1\nf 1//1 2//1 3//1\n\
    f 1/1 2/2 3/3\ns off\nl 1 2 3\nf 1 2 3\n";
const MTL: &str = "newmtl red\nKd 1 0 0\nNs 10\nmap_Kd -s 1 1 1 -o 0 0 a.png\nmap_Bump -bm 0.5 a.png\nmap_d a.png\nnewmtl blue\nPm 1\nPr 0.5\n";
const TOML: &str = "environment = { panorama = \"a.hdr\", rotation_degrees = 0 }\nexposure_ev = 0.5\n[[model]]\nfile = \"a.obj\"\n\
    rotation_degrees = [0, 90, 0]\nscale = 1.5\n[[light]]\npoint = { position = [1, 2, 1], intensity = [40, 40, 40] }\n\
    [[camera]]\nname = \"front\"\nposition = [0, 1, 3]\ntarget = [0, 1, 0]\n";

/// A small colourful picture.
fn picture() -> image::DynamicImage {
    let texel = |x: u32, y: u32| image::Rgba([(x * 13) as u8, (y * 29) as u8, (x * y) as u8, (x + y * 9) as u8]);
    image::RgbaImage::from_fn(19, 13, texel).into()
}

fn encoded(format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let has_alpha = format != image::ImageFormat::Jpeg;
    let picture = if has_alpha { picture() } else { picture().into_rgb8().into() };
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// A Radiance picture of 16×4, with lines in the old or the new run-length coding.
fn radiance(new_coding: bool) -> Vec<u8> {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 4 +X 16\n".to_vec();
    for y in 0..4u8 {
        if new_coding {
            bytes.extend([2, 2, 0, 16]);
            for channel in 0..4 {
                bytes.extend([128 + 10, 100 + y * 10 + channel, 6, 1, 2, 3, 4, 5, 6]);
            }
        } else {
            bytes.extend([200, 100, 50, 128 + y, 1, 1, 1, 11, 9, 8, 7, 130, 60, 50, 40, 130, 1, 1, 1, 2]);
        }
    }
    bytes
}

fn openexr(compression: exr::prelude::Compression, tiles: bool) -> Vec<u8> {
    use exr::prelude::*;
    let blocks = if tiles { Blocks::Tiles(Vec2(16, 16)) } else { Blocks::ScanLines };
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    let pixel = |p: Vec2<usize>| (f16::from_f32(p.x() as f32), p.y() as f32 * 0.1, (p.x() * p.y()) as f32);
    let channels = SpecificChannels::build().with_channel("R").with_channel("G").with_channel("B").with_pixel_fn(pixel);
    let layer = Layer::new((40, 20), LayerAttributes::named("main"), encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Writes the good files that others name beside the one under test.
fn beside(path: &Path) {
    let write = |name: &str, bytes: &[u8]| {
        let other = path.with_file_name(name);
        if other != path && !other.exists() {
            std::fs::write(other, bytes).unwrap();
        }
    };
    write("a.obj", OBJ.as_bytes());
    write("a.mtl", MTL.as_bytes());
    write("a.png", &encoded(image::ImageFormat::Png));
    write("a.hdr", &radiance(true));
}

#[test]
fn damaged_models() {
    torture("a.obj", OBJ.as_bytes(), 1500, |path| {
        beside(path);
        load_scene(path)
    });
}

#[test]
fn damaged_gltf_models() {
    let file = gltf::everything();
    torture("a.gltf", &file.bytes(false), 250, load_scene);
    torture("a.glb", &file.bytes(true), 250, load_scene);
}

#[test]
fn damaged_material_libraries() {
    torture("a.mtl", MTL.as_bytes(), 700, |path| {
        beside(path);
        load_scene(&path.with_extension("obj"))
    });
}

#[test]
fn damaged_descriptions() {
    torture("scene.toml", TOML.as_bytes(), 700, |path| {
        beside(path);
        // A damaged file name is an error too, but about another file.
        match load_scene(path) {
            Err(error) if error.to_string().contains("scene") => Err(error),
            _ => Ok(()),
        }
    });
}

#[test]
fn damaged_textures() {
    for (name, format) in
        [("a.png", image::ImageFormat::Png), ("a.jpg", image::ImageFormat::Jpeg), ("a.tga", image::ImageFormat::Tga)]
    {
        torture(name, &encoded(format), 1500, load_texture);
    }
}

#[test]
fn damaged_radiance_pictures() {
    for new_coding in [false, true] {
        torture("a.hdr", &radiance(new_coding), 1500, load_panorama);
    }
}

#[test]
fn damaged_openexr_pictures() {
    use exr::prelude::Compression as C;
    for compression in
        [C::Uncompressed, C::RLE, C::ZIP1, C::ZIP16, C::PIZ, C::PXR24, C::B44, C::DWAA(None), C::DWAB(None)]
    {
        for tiles in [false, true] {
            println!("{compression:?}, tiles {tiles}");
            torture("a.exr", &openexr(compression, tiles), 150, load_panorama);
            torture("a.exr", &openexr(compression, tiles), 150, load_picture);
        }
    }
}

#[test]
fn lies_about_size_are_seen_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lie");
    let start = Instant::now();
    let refused = |bytes: &[u8], load: &dyn Fn(&Path) -> Result<()>| {
        std::fs::write(&path, bytes).unwrap();
        let outcome = load(&path);
        assert!(matches!(outcome, Err(Error::TooLarge { .. })), "{outcome:?}");
    };
    refused(b"#?RADIANCE\n\n-Y 2147483647 +X 2147483647\n\x02\x02\x00\x10", &load_panorama);
    let mut exr = openexr(exr::prelude::Compression::ZIP16, false);
    for window in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
        let at = exr.windows(window.len()).position(|w| w == window.as_bytes()).unwrap() + window.len() + 4;
        let mut lying = exr.clone();
        lying[at + 8..at + 16].copy_from_slice(&[0xff, 0xff, 0xff, 0x0f, 0xff, 0xff, 0xff, 0x0f]);
        std::fs::write(&path, &lying).unwrap();
        assert!(load_panorama(&path).is_err(), "{window}");
    }
    let at = exr.windows(20).position(|w| w == b"displayWindow\0box2i\0").unwrap() + 24;
    exr[at + 8..at + 12].copy_from_slice(&20_000i32.to_le_bytes());
    refused(&exr, &load_panorama);
    let mut png = encoded(image::ImageFormat::Png);
    png[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    let crc = crc32(&png[12..29]);
    png[29..33].copy_from_slice(&crc.to_be_bytes());
    refused(&png, &load_texture);
    let mut tga = encoded(image::ImageFormat::Tga);
    tga[12..16].fill(0xff);
    refused(&tga, &load_texture);
    let mut jpg = encoded(image::ImageFormat::Jpeg);
    let frame = jpg.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    jpg[frame + 5..frame + 9].fill(0xff);
    refused(&jpg, &load_texture);
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
}

/// The checksum of PNG chunks (ISO/IEC 15948, annex D), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

#[test]
fn test_scenes() {
    let Some(folder) = scenes("the large scenes") else { return };
    for (file, triangles, materials, warnings) in [
        ("sphere/sphere-cylcoords-16k_floor_tiles.obj", 15_872, 1, &[][..]),
        ("sphere/sphere-cylcoords-16k.obj", 15_872, 1, &["UnwrapChecker"]),
        ("sphere/sphere-cylcoords-4k_old_bricks.obj", 3_968, 1, &[]),
        ("sphere/sphere-cylcoords-1k.obj", 960, 1, &["UnwrapChecker"]),
        ("teapot/teapot_oxidised_gold.obj", 15_704, 1, &[]),
        ("teapot/teapot.obj", 15_704, 1, &[]),
        ("lee-perry-smith/head_pbr.obj", 17_684, 1, &[]),
        ("tearoom/tearoom.obj", 111_596, 6, &[]),
        ("dabrovic-sponza/sponza_pbr.obj", 66_450, 20, &[]),
        ("dabrovic-sponza/sponza.obj", 66_450, 20, &["sp_luk.JPG"]),
        ("crytek-sponza/sponza.obj", 262_267, 25, &[]),
        ("gltf-targets/NormalTangentTest/obj/NormalTangentTest.obj", 7_774, 1, &[]),
        ("gltf-targets/NormalTangentMirrorTest/obj/NormalTangentMirrorTest.obj", 5_240, 1, &[]),
        ("gltf-targets/NormalTangentTest/NormalTangentTest.gltf", 7_774, 1, &[]),
        ("gltf-targets/NormalTangentMirrorTest/NormalTangentMirrorTest.gltf", 5_240, 1, &[]),
    ] {
        let (start, report) = (Instant::now(), Report::silent());
        let options = LoadOptions {
            default_panorama: Some(folder.join("hdri/studio_small_03_1k.hdr")),
            ..LoadOptions::default()
        };
        let scene = scene::load(&folder.join(file), &options, &report).unwrap();
        let time = start.elapsed();
        check(&scene);
        let count: usize = scene.meshes.iter().map(|mesh| mesh.indices.len() / 3).sum();
        let vertices: usize = scene.meshes.iter().map(|mesh| mesh.vertices.len()).sum();
        println!(
            "{file}: {count} triangles, {vertices} vertices, {} meshes, {} materials, {} textures, {:.2} s",
            scene.meshes.len(),
            scene.materials.len(),
            scene.textures.len(),
            time.as_secs_f32(),
        );
        let told = report.warnings();
        told.iter().for_each(|warning| println!("  {warning}"));
        assert_eq!((count, scene.materials.len()), (triangles, materials), "{file}");
        for expected in warnings {
            assert!(told.iter().any(|w| w.contains(expected)), "{file}: {expected}");
        }
        assert_eq!(told.is_empty(), warnings.is_empty(), "{file}: {told:?}");
    }
}

#[test]
fn test_panoramas() {
    let Some(folder) = scenes("the larger panoramas") else { return };
    for (file, peak) in [
        ("hdri/rooitou_park_1k.hdr", Some(69_120.0)),
        ("hdri/studio_small_03_1k.hdr", None),
        ("hdri/exr-zip/sunset_1k.exr", None),
        ("hdri/exr-zip/city_1k.exr", None),
        ("hdri/blender-exr/courtyard.exr", None),
    ] {
        let (start, report) = (Instant::now(), Report::silent());
        let panorama = Panorama::load(&folder.join(file), &report).unwrap();
        let largest = panorama.texels.as_flattened().iter().fold(0f32, |a, b| a.max(*b));
        let time = start.elapsed().as_secs_f32();
        println!(
            "{file}: {}x{}, up to {largest}, {time:.2} s, {:?}",
            panorama.width,
            panorama.height,
            report.warnings()
        );
        assert_eq!((panorama.width, panorama.height), (1024, 512), "{file}");
        assert!(peak.is_none_or(|peak| peak == largest) && largest > 0.5, "{file}: {largest}");
    }
}
