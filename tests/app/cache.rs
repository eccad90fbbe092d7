//! The cache of precomputed maps: hits, versions, damaged, locked and unwritable files.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use crate::common::{Workshop, entries, finish, json, material, program, setup, sphere, succeeds};
use pbr_vr::asset::ktx2::Ktx2;
use pbr_vr::precompute::Cache;
use pbr_vr::reference::brdf::Geometry;
use pbr_vr::reference::split_sum::SplitSum;
use pbr_vr::render::{LightModel, RenderSettings};
use pbr_vr::view::{BakeRequest, RenderFacts, RenderRequest, bake, render};

/// A rough metal sphere under a coloured sky, and a cache.
struct Scene {
    shop: Workshop,
    scene: PathBuf,
    cache: Cache,
}

impl Scene {
    fn new() -> Self {
        let shop = Workshop::new();
        shop.sky(3.0);
        shop.write("m.mtl", &material([0.9, 0.6, 0.3], 1.0, 0.4));
        shop.write("model.obj", &sphere("m.mtl"));
        let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"model.obj\"\n[[camera]]\nname = \"front\"\n\
            position = [0, 0, 3]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 45\n";
        let scene = shop.write("scene.toml", text);
        let cache = Cache::in_folder(shop.path("cache"));
        Self { shop, scene, cache }
    }

    /// The picture's bytes, and the messages.
    fn render(&self, cache: Option<&Cache>) -> (Vec<u8>, RenderFacts) {
        self.render_with(cache, Geometry::Smith, SplitSum::Moment)
    }

    fn render_with(&self, cache: Option<&Cache>, geometry: Geometry, split_sum: SplitSum) -> (Vec<u8>, RenderFacts) {
        let output = self.shop.path("out.exr");
        let request = RenderRequest {
            size: [64, 64],
            settings: RenderSettings { geometry, split_sum, light: LightModel::Direct, ..RenderSettings::default() },
            ..RenderRequest::new(&self.scene, &output)
        };
        let facts = render(&request, &setup(cache)).expect("a render without validation messages");
        (fs::read(&output).expect("the picture"), facts)
    }

    /// The files that are baked, and how many of light maps and BRDF table came from the cache.
    fn bake(&self, face_size: u32, cache: Option<&Cache>) -> (BTreeMap<PathBuf, Vec<u8>>, usize) {
        let (panorama, folder) = (self.shop.path("sky.exr"), self.shop.path("baked"));
        let request = BakeRequest { input: panorama, output: folder.clone(), size: face_size, json: None };
        let facts = bake(&request, &setup(cache)).expect("baking without validation messages");
        let passes = facts.stages.iter().flat_map(|stage| &stage.gpu);
        (entries(&folder), passes.filter(|pass| pass.name.ends_with("from the cache")).count())
    }

    fn entries(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        entries(&self.shop.path("cache"))
    }
}

/// How many of light maps and BRDF table came from the cache; all other passes are counted in the second.
fn passes(facts: &RenderFacts) -> (usize, usize) {
    let cached = facts.precompute.iter().filter(|pass| pass.name.ends_with("from the cache")).count();
    (cached, facts.precompute.len() - cached)
}

#[test]
fn cached_and_uncached_renders_are_the_same_bytes_and_the_work_is_skipped() {
    let scene = Scene::new();
    let (uncached, facts) = scene.render(None);
    let work = passes(&facts);
    assert!(work.0 == 0 && work.1 > 1, "{:?}", facts.precompute);
    assert!(scene.entries().is_empty(), "without a cache nothing is kept");
    let (cold, facts) = scene.render(Some(&scene.cache));
    assert_eq!(passes(&facts), work);
    let kept = scene.entries();
    assert!(kept.len() == 4 && kept.keys().all(|path| path.extension().is_some_and(|e| e == "ktx2")), "{kept:?}");
    let (warm, facts) = scene.render(Some(&scene.cache));
    assert_eq!(passes(&facts), (2, 0), "{:?}", facts.precompute);
    assert!(uncached == cold && cold == warm, "the cache changes the picture");
    assert_eq!(scene.entries(), kept);
    // Other tables, the same light.
    let others = [(Geometry::Karis2013, SplitSum::Moment), (Geometry::Smith, SplitSum::Classic)];
    for (i, (geometry, split_sum)) in others.into_iter().enumerate() {
        let (other, facts) = scene.render_with(Some(&scene.cache), geometry, split_sum);
        assert_eq!(passes(&facts), (1, 1), "{:?}", facts.precompute);
        assert_eq!(scene.entries().len(), kept.len() + 1 + i);
        assert!(other != warm, "another table must change the picture");
    }
    // Another panorama, the same tables.
    scene.shop.sky(3.5);
    let (other, facts) = scene.render(Some(&scene.cache));
    assert_eq!(passes(&facts), (1, work.1 - 1), "{:?}", facts.precompute);
    assert!(other != warm, "a changed panorama must change the picture");
}

#[test]
fn broken_and_foreign_entries_are_made_again() {
    let scene = Scene::new();
    let (files, _) = scene.bake(16, Some(&scene.cache));
    let good = scene.entries();
    type Harm = fn(&[u8], &[u8]) -> Vec<u8>;
    let harms: [(&str, Harm); 6] = [
        ("truncated", |bytes, _| bytes[..bytes.len() / 2].to_vec()),
        ("empty", |_, _| Vec::new()),
        ("garbage", |bytes, _| vec![0x5a; bytes.len()]),
        ("another's", |_, other| other.to_vec()),
        ("a bent texel", |bytes, _| {
            let mut bytes = bytes.to_vec();
            *bytes.last_mut().expect("texels") ^= 0x40;
            bytes
        }),
        ("too long", |bytes, _| [bytes, &[0; 1 << 20]].concat()),
    ];
    for (name, harm) in harms {
        let contents: Vec<&Vec<u8>> = good.values().collect();
        for (i, (path, bytes)) in good.iter().enumerate() {
            fs::write(path, harm(bytes, contents[(i + 1) % contents.len()])).expect("harm");
        }
        assert!(scene.bake(16, Some(&scene.cache)) == (files.clone(), 0), "{name}: taken, or baked otherwise");
        assert!(scene.entries() == good, "{name}: not made again");
    }
    // One lost file of two that belong together, and a folder in an entry's place.
    let (first, _) = good.first_key_value().expect("entries");
    fs::remove_file(first).expect("an entry");
    fs::create_dir(first).expect("a folder in its place");
    assert!(scene.bake(16, Some(&scene.cache)).0 == files);
}

#[test]
fn sizes_share_no_entries_and_an_entry_of_another_shape_is_not_taken() {
    let scene = Scene::new();
    let [(small, _), (large, _)] = [16, 32].map(|size| scene.bake(size, None));
    assert!(small != large);
    let cache = Some(&scene.cache);
    assert!(scene.bake(16, cache) == (small.clone(), 0));
    let of_small = scene.entries();
    // The BRDF table is the same.
    assert!(scene.bake(32, cache) == (large.clone(), 1));
    let of_large: Vec<PathBuf> = scene.entries().into_keys().filter(|path| !of_small.contains_key(path)).collect();
    assert!(scene.bake(16, cache) == (small, 2) && scene.bake(32, cache) == (large.clone(), 2));
    let read = |path: &PathBuf| Ktx2::read(path, 1 << 30).expect("an entry");
    let shape = |texture: &Ktx2| (texture.size, texture.faces, texture.levels.len());
    let mut forgeries = 0;
    for path in &of_large {
        for other in of_small.keys() {
            let mut forged = read(other);
            if shape(&forged) != shape(&read(path)) {
                // It says that it is the right one, and its texels are whole.
                forged.set_text("pbrvrKey", &path.file_stem().expect("a name").to_string_lossy());
                forged.write(path).expect("a forged entry");
                assert!(scene.bake(32, cache) == (large.clone(), 1), "{:?} was taken", shape(&forged));
                forgeries += 1;
            }
        }
    }
    assert!(forgeries >= 3, "{forgeries}");
}

#[test]
fn two_processes_at_once_and_no_cache() {
    let scene = Scene::new();
    let folder = scene.shop.folder.path();
    let maps = folder.join("cache/pbr-vr/maps");
    let start = |output: &str, facts: &str, more: &[&str]| {
        let common = ["render", "scene.toml", "-o", output, "--json", facts, "--size", "48x48", "--validate"];
        program(folder, &[&common, more].concat())
    };
    succeeds(start("plain.exr", "plain.json", &["--no-cache"]));
    assert!(!maps.exists(), "--no-cache keeps nothing");
    let both = [start("a.exr", "a.json", &[]), start("b.exr", "b.json", &[])];
    both.into_iter().for_each(|child| drop(succeeds(child)));
    let kept = entries(&maps);
    assert!(
        kept.len() == 4 && kept.keys().all(|path| path.extension().is_some_and(|e| e == "ktx2")),
        "{:?}",
        kept.keys()
    );
    succeeds(start("c.exr", "c.json", &[]));
    let picture = |name: &str| fs::read(folder.join(name)).expect("a picture");
    for name in ["a.exr", "b.exr", "c.exr"] {
        assert!(picture(name) == picture("plain.exr"), "{name} differs");
    }
    let said = json(&folder.join("c.json"))["precompute"].to_string();
    assert_eq!(said.matches("from the cache").count(), 2, "{said}");
    // Not even read: the work is done again.
    succeeds(start("d.exr", "d.json", &["--no-cache"]));
    let said = json(&folder.join("d.json"))["precompute"].to_string();
    assert!(!said.contains("from the cache"), "{said}");
    assert_eq!(entries(&maps), kept);
}

#[test]
fn a_cache_that_cannot_be_written_is_told_once_and_stops_nothing() {
    let scene = Scene::new();
    let folder = scene.shop.folder.path();
    fs::create_dir(folder.join("cache")).expect("a folder");
    fs::write(folder.join("cache/pbr-vr"), "a file where a folder should be").expect("a file");
    let output = finish(program(folder, &["render", "scene.toml", "-o", "a.png", "--size", "32x32"]));
    assert!(output.status.success() && folder.join("a.png").is_file());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.lines().count() == 1 && said.contains("WARN") && said.contains("pbr-vr"),
        "each start takes long, and nobody says why: {said}"
    );
}
