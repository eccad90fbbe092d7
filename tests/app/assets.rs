//! What ships: the models are what the tool makes, closed and turned outwards; textures are sound; downloads are checked.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::Vec3;

#[allow(dead_code)]
#[path = "../../tools/make_assets/geometry/mod.rs"]
mod geometry;
#[allow(dead_code)]
#[path = "../../tools/make_assets/textures/mod.rs"]
mod textures;

const MODELS: [&str; 4] = ["sphere", "teapot", "tearoom", "demo"];
const MAPS: [&str; 5] = ["albedo", "normal", "metallic", "roughness", "ao"];

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

struct Triangle {
    /// Numbers of the positions, equal where corners touch.
    numbers: [u32; 3],
    positions: [Vec3; 3],
    normals: [Vec3; 3],
    uvs: [[f32; 2]; 3],
}

/// A shipped model's triangles, and its materials.
fn load(name: &str) -> (Vec<Triangle>, Vec<tobj::Material>) {
    let path = assets().join("scenes").join(format!("{name}.obj"));
    let (models, materials) = tobj::load_obj(&path, &tobj::LoadOptions::default()).unwrap();
    let mut positions = HashMap::new();
    let mut triangles = Vec::new();
    for mesh in models.iter().map(|m| &m.mesh) {
        assert!(mesh.face_arities.is_empty(), "{name}: only triangles are expected");
        for corner in (0..mesh.indices.len()).step_by(3) {
            let vector = |list: &[f32], i: u32| Vec3::from_slice(&list[3 * i as usize..]);
            let at = [0, 1, 2].map(|k| corner + k);
            let corners = at.map(|i| vector(&mesh.positions, mesh.indices[i]));
            let next = positions.len() as u32;
            let numbers = [0, 1, 2]
                .map(|k: u32| *positions.entry(corners[k as usize].to_array().map(f32::to_bits)).or_insert(next + k));
            triangles.push(Triangle {
                numbers,
                positions: corners,
                normals: at.map(|i| vector(&mesh.normals, mesh.normal_indices[i])),
                uvs: at.map(|i| [0, 1].map(|c| mesh.texcoords[2 * mesh.texcoord_indices[i] as usize + c])),
            });
        }
    }
    (triangles, materials.unwrap())
}

#[test]
fn the_tool_makes_the_committed_models() {
    for file in geometry::files() {
        // A checkout on Windows may have other line ends.
        let committed = fs::read_to_string(assets().join(file.path)).unwrap().replace("\r\n", "\n");
        let first_difference = committed.lines().zip(file.text.lines()).position(|(a, b)| a != b);
        let hint = "run `cargo run --release --example make-assets`";
        assert!(committed == file.text, "assets/{}: differs at line {first_difference:?}; {hint}", file.path);
    }
}

#[test]
fn models_have_the_expected_size() {
    for (name, least, most) in
        [("sphere", 20_480, 20_480), ("teapot", 15_000, 16_000), ("tearoom", 5_000, 20_000), ("demo", 5_000, 20_000)]
    {
        let count = load(name).0.len();
        assert!((least..=most).contains(&count), "{name}: {count} triangles");
    }
    let heights = load("teapot")
        .0
        .iter()
        .flat_map(|t| t.positions)
        .map(|p| p.y)
        .fold([1.0f32, -1.0], |[a, b], y| [a.min(y), b.max(y)]);
    assert_eq!(heights, [0.0, 0.18]);
}

#[test]
fn triangles_face_where_their_normals_point() {
    for name in MODELS {
        for (number, t) in load(name).0.iter().enumerate() {
            let [a, b, c] = t.positions;
            let face = (b - a).cross(c - a);
            assert!(face.length() > 0.0, "{name}: triangle {number} has no area");
            for normal in t.normals {
                assert!((normal.length() - 1.0).abs() < 1e-3, "{name}: triangle {number} has normal {normal}");
            }
            let agreement = face.normalize().dot(t.normals.iter().sum::<Vec3>().normalize());
            assert!(agreement > 0.5, "{name}: triangle {number} at {a}: {agreement}");
        }
    }
}

#[test]
fn triangles_have_room_in_their_textures() {
    for name in MODELS {
        for (number, t) in load(name).0.iter().enumerate() {
            let [a, b, c] = t.uvs;
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            assert!(area.abs() > 0.0, "{name}: triangle {number} at {} has no area in texture space", t.positions[0]);
        }
    }
}

#[test]
fn the_sphere_is_closed() {
    let (triangles, _) = load("sphere");
    let edges: HashSet<[u32; 2]> =
        triangles.iter().flat_map(|t| [0, 1, 2].map(|k| [t.numbers[k], t.numbers[(k + 1) % 3]])).collect();
    assert_eq!(edges.len(), triangles.len() * 3, "an edge is used twice in the same direction");
    assert!(edges.iter().all(|[a, b]| edges.contains(&[*b, *a])), "an edge has only one side");
    assert!(
        triangles
            .iter()
            .flat_map(|t| t.positions.iter().zip(&t.normals))
            .all(|(p, n)| p.normalize().distance(*n) < 1e-3)
    );
}

#[test]
fn the_teapots_body_is_the_published_one() {
    // Points on Newell's curves worked out by hand from the Bernstein weights at 1/2: rim, belly, knob (radius, height).
    let unit = 0.18 / 3.15;
    let (triangles, _) = load("teapot");
    for (radius, height) in
        [(1.403_125, 2.498_437_5), (1.843_75, 1.621_875), (2.0, 0.9), (1.5, 0.15), (0.325, 2.981_25)]
    {
        let seen = |p: &Vec3| {
            (p.x.hypot(p.z) - radius * unit).abs() < 2e-3 * unit && (p.y - height * unit).abs() < 1e-3 * unit
        };
        assert!(triangles.iter().flat_map(|t| &t.positions).any(seen), "no point at radius {radius}, height {height}");
    }
}

#[test]
fn materials_name_maps_that_are_there() {
    for name in MODELS {
        let folder = assets().join("scenes");
        for material in load(name).1 {
            let known = |key: &str| material.unknown_param.get(key).cloned();
            assert!(known("Pm").is_some() && known("Pr").is_some(), "{}: Pm and Pr", material.name);
            let maps: Vec<String> = material
                .diffuse_texture
                .iter()
                .cloned()
                .chain(["norm", "map_Pm", "map_Pr", "map_ao"].into_iter().filter_map(known))
                .collect();
            assert!(maps.is_empty() || maps.len() == MAPS.len(), "{}: {maps:?}", material.name);
            for map in maps {
                assert!(folder.join(&map).is_file(), "{}: {map} is missing", material.name);
            }
        }
    }
}

#[test]
fn scenes_name_files_that_are_there() {
    for name in MODELS {
        let folder = assets().join("scenes");
        let scene: toml::Table = fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap().parse().unwrap();
        let models = scene["model"].as_array().unwrap().iter().map(|m| m["file"].as_str().unwrap());
        for file in models.chain([scene["environment"]["panorama"].as_str().unwrap()]) {
            assert!(folder.join(file).is_file(), "{name}.toml: {file} is missing");
        }
        let lights = scene["light"].as_array().unwrap().len();
        assert!(lights <= 4 && !scene["camera"].as_array().unwrap().is_empty(), "{name}.toml");
    }
}

#[test]
fn texture_sets_are_whole_tileable_and_plausible() {
    for set in textures::sets() {
        let mut sizes = HashSet::new();
        for map in MAPS {
            let path = assets().join("textures").join(set.name).join(format!("{map}.jpg"));
            let bytes = fs::metadata(&path).unwrap().len();
            assert!(bytes < 400_000, "{}: {bytes} bytes", path.display());
            let picture = image::open(&path).unwrap().to_rgb8();
            sizes.insert(picture.dimensions());
            let seam = seam(&picture);
            assert!(seam < 2.5, "{}: a step of {seam} times the usual one across the edge", path.display());
            let mean = picture.as_raw().iter().map(|b| f32::from(*b)).sum::<f32>() / picture.as_raw().len() as f32;
            if map == "albedo" {
                // sRGB 0.02..0.9 linear.
                assert!((39.0..243.0).contains(&mean), "{}: mean {mean}", path.display());
            }
            if map == "normal" {
                for p in picture.pixels() {
                    let n = Vec3::from_array(p.0.map(|c| f32::from(c) / 127.5 - 1.0));
                    assert!(n.z > 0.0 && (0.7..1.3).contains(&n.length()), "{}: {n}", path.display());
                }
            }
        }
        assert_eq!(sizes.len(), 1, "{}: {sizes:?}", set.name);
    }
}

/// The mean step across the picture's two edges over the largest mean step between neighbouring columns or rows inside.
fn seam(picture: &image::RgbImage) -> f32 {
    let size = picture.width();
    let step = |from: u32, to: u32, columns: bool| {
        let at = |line: u32, k: u32| if columns { picture.get_pixel(line, k) } else { picture.get_pixel(k, line) };
        let apart = |k: u32| (0..3).map(|c| f32::from(at(from, k)[c].abs_diff(at(to, k)[c]))).sum::<f32>();
        (0..size).map(apart).sum::<f32>() / size as f32
    };
    let worst = |columns| {
        let inside = (0..size - 1).map(|i| step(i, i + 1, columns)).fold(0.0, f32::max);
        step(size - 1, 0, columns) / inside.max(0.5)
    };
    worst(true).max(worst(false))
}

#[test]
fn gold_is_gold_and_its_patina_is_not() {
    let open = |map: &str| image::open(assets().join("textures/oxidised-gold").join(map)).unwrap().to_rgb8();
    let (metallic, albedo) = (open("metallic.jpg"), open("albedo.jpg"));
    let share = |test: fn(u8) -> bool| metallic.pixels().filter(|p| test(p[0])).count() as f32 / (1 << 20) as f32;
    assert!(
        share(|m| m > 240) > 0.6 && share(|m| m < 15) > 0.03,
        "metal {}, patina {}",
        share(|m| m > 240),
        share(|m| m < 15)
    );
    // The brightest metal is gold's F0, linear (1.0, 0.78, 0.34): sRGB 255, 228, 158.
    let bright = albedo.pixels().zip(metallic.pixels()).filter(|(a, m)| m[0] > 250 && a[0] > 250);
    let near = bright.clone().filter(|(a, _)| a[1].abs_diff(228) < 12 && a[2].abs_diff(158) < 18).count();
    assert!(near > 50_000 && near * 10 > bright.count() * 8, "{near} pixels are gold");
}

#[test]
fn textures_are_what_the_tool_makes() {
    // The smallest set stands for all: they share every line but the pattern.
    let plaster = textures::sets().into_iter().find(|s| s.name == "plaster").unwrap();
    for map in plaster.maps().unwrap() {
        let committed = image::open(assets().join("textures/plaster").join(map.file)).unwrap().to_rgb8();
        let made = image::load_from_memory(&map.jpeg).unwrap().to_rgb8();
        // Other systems' sine may round differently: a few pixels by one step, not the picture.
        let apart = committed.as_raw().iter().zip(made.as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>();
        assert!(apart < committed.as_raw().len() as u64 / 100, "{}: {apart}", map.file);
    }
}

#[test]
fn normals_of_a_dome_point_away_from_its_top() {
    let dome = textures::map::Map::new(64, |uv| 0.1 * (1.0 - 4.0 * uv.distance_squared(glam::Vec2::splat(0.5))));
    let normals = dome.normals(1.0 / 64.0);
    // OpenGL: red to the right, green to the picture's top.
    let (right, top) = (normals.wrapped(48, 32), normals.wrapped(32, 16));
    assert!(right.x > 0.1 && right.y.abs() < 0.02, "{right}");
    assert!(top.y > 0.1 && top.x.abs() < 0.02, "{top}");
}

#[test]
fn panoramas_are_twice_as_wide_as_high_and_finite() {
    let mut seen = 0;
    for path in fs::read_dir(assets().join("panoramas")).unwrap().map(|e| e.unwrap().path()) {
        if path.extension().is_none_or(|e| e != "exr") {
            continue;
        }
        let picture = exr::prelude::read_first_rgba_layer_from_file(
            &path,
            |size, _| (size.width(), Vec::with_capacity(size.area())),
            |(_, texels): &mut (usize, Vec<[f32; 3]>), _, (r, g, b, _): (f32, f32, f32, f32)| texels.push([r, g, b]),
        );
        let layer = picture.unwrap().layer_data;
        let (width, texels) = layer.channel_data.pixels;
        assert_eq!((layer.size.width(), layer.size.height()), (width, width / 2), "{}", path.display());
        assert!(texels.iter().flatten().all(|x| x.is_finite()), "{}", path.display());
        let mean = texels.iter().flatten().map(|x| f64::from(*x)).sum::<f64>() / (3 * texels.len()) as f64;
        let peak = texels.iter().flatten().fold(0.0, |a: f32, b| a.max(*b));
        println!("{}: mean {mean:.3}, peak {peak:.1}", path.display());
        assert!((0.05..5.0).contains(&mean), "{}: mean radiance {mean}", path.display());
        seen += 1;
    }
    assert!(seen >= 2, "{seen} panoramas");
}

#[test]
fn all_of_it_is_small() {
    fn size(folder: &Path) -> u64 {
        let entry = |path: PathBuf| if path.is_dir() { size(&path) } else { fs::metadata(&path).unwrap().len() };
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).filter(|p| !p.ends_with("downloaded")).map(entry).sum()
    }
    let bytes = size(&assets());
    assert!(bytes < 15_000_000, "{bytes} bytes");
}

/// Runs the tests of a tool that is written in Python.
fn test_tool(name: &str) {
    let test = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools").join(name);
    for python in ["python3", "python"] {
        match Command::new(python).arg("-B").arg(&test).output() {
            Ok(done) => {
                assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
                return;
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => panic!("{python}: {error}"),
        }
    }
    assert!(std::env::var_os("CI").is_none(), "Python 3 is missing");
    println!("skipped: tools/{name} is not run (install Python 3)");
}

#[test]
fn downloads_are_checked_resumed_and_explained() {
    test_tool("test_fetch_assets.py");
}

#[test]
fn the_path_tracer_gets_our_materials_and_its_absence_is_explained() {
    test_tool("test_cycles_reference.py");
}

#[test]
fn other_renderers_get_our_scenes_and_their_absence_is_explained() {
    test_tool("test_compare_renderers.py");
}
