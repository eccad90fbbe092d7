//! What reads files: one call for each format, and what must be true of its result.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use super::formats::Format;
use super::seeds;
use crate::asset::gltf::draco_tests::compressed;
use crate::asset::image_source::ImageSource;
use crate::asset::ktx2::Ktx2;
use crate::asset::picture::Picture;
use crate::asset::texture::Encoding;
use crate::asset::{Cache, MipChain, Panorama, Report, Storage, Texture, TextureOptions, contained};
use crate::measure::ladder::{settings, store};
use crate::render::light_plan::LightPlan;
use crate::scene::{Bounds, LoadOptions, Probe, Scene, atlas, load};
use crate::view::headset::probe;
use crate::view::panel::saved::Saved;
use crate::view::sequence::Record;
use crate::{Error, Result};

/// The longest error, in characters, besides the folder's name.
const LONGEST: usize = 1000;
/// A cache's entry, in bytes.
const ENTRY_BYTES: u64 = 1 << 20;

/// A reader of one kind of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reader {
    Obj,
    Mtl,
    Scene,
    Gltf,
    Glb,
    Hdr,
    Exr,
    Png,
    Jpeg,
    Tga,
    Webp,
    Basis,
    Ktx2,
    CachedTextures,
    CachedLight,
    States,
}

/// How a file was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    Read,
    Refused,
    /// A foreign decoder panicked.
    GaveUp,
}

impl Reader {
    pub const ALL: [Self; 16] = [
        Self::Obj,
        Self::Mtl,
        Self::Scene,
        Self::Gltf,
        Self::Glb,
        Self::Hdr,
        Self::Exr,
        Self::Png,
        Self::Jpeg,
        Self::Tga,
        Self::Webp,
        Self::Basis,
        Self::Ktx2,
        Self::CachedTextures,
        Self::CachedLight,
        Self::States,
    ];

    /// As the tables and the environment name it.
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    /// The file that is damaged.
    pub fn file(self) -> &'static str {
        match self {
            Self::Obj => "case.obj",
            Self::Mtl => "case.mtl",
            Self::Scene => "case.toml",
            Self::Gltf => "case.gltf",
            Self::Glb => "case.glb",
            Self::Hdr => "case.hdr",
            Self::Exr => "case.exr",
            Self::Png => "case.png",
            Self::Jpeg => "case.jpg",
            Self::Tga => "case.tga",
            Self::Webp => "case.webp",
            Self::Basis | Self::Ktx2 | Self::CachedTextures | Self::CachedLight => "case.ktx2",
            Self::States => "case.json",
        }
    }

    /// What its files are made of.
    pub fn format(self) -> Format {
        match self {
            Self::Obj => Format::Lines(&[
                "v", "vt", "vn", "f", "o", "g", "s", "usemtl", "mtllib", "p", "l", "off", "1/1/1", "-1", "1//",
            ]),
            Self::Mtl => Format::Lines(&[
                "newmtl", "Kd", "Ks", "Ke", "Ns", "Ni", "d", "Tr", "illum", "Pr", "Pm", "map_Kd", "map_d", "map_Bump",
                "bump", "norm", "map_Pr", "map_Pm", "map_Ke", "map_Ns", "refl", "disp", "-bm", "-s", "-o", "-t",
                "-imfchan", "-clamp", "on", "good.png", "good.obj", "none.png", "spectral", "xyz",
            ]),
            Self::Scene => Format::Lines(&[
                "[[model]]",
                "[environment]",
                "[[camera]]",
                "[[probe]]",
                "[[light]]",
                "file",
                "scale",
                "panorama",
                "good.glb",
                "good.mtl",
                "case.toml",
                "\"\"\"",
                "true",
                "1979-05-27",
                "[[[[[[[[",
                "= {",
                "${PBR_VR_SCENES}/a",
                "\\u0000",
            ]),
            Self::Gltf | Self::States => Format::Json,
            Self::Glb => Format::Glb,
            Self::Hdr => Format::Hdr,
            Self::Exr => Format::Exr,
            Self::Png => Format::Png,
            Self::Jpeg => Format::Jpeg,
            Self::Tga => Format::Head(18),
            Self::Webp => Format::Head(40),
            Self::Basis => Format::Head(350),
            Self::Ktx2 | Self::CachedTextures | Self::CachedLight => Format::Head(260),
        }
    }

    /// How many damaged files an ordinary run reads, beside all that are cut off.
    pub fn cases(self) -> u64 {
        match self {
            Self::Obj | Self::Mtl | Self::Gltf | Self::Glb => 1500,
            Self::Scene => 800,
            Self::CachedTextures | Self::CachedLight => 400,
            _ => 3000,
        }
    }

    /// Whole files. `bench` has made what it needs.
    pub fn seeds(self, bench: &Bench) -> Vec<Vec<u8>> {
        match self {
            Self::Obj => vec![seeds::OBJ.into(), shipped("scenes/sphere.obj", 3000)],
            Self::Mtl => vec![seeds::MTL.into(), shipped("scenes/demo.mtl", 3000)],
            Self::Scene => vec![seeds::scene(), shipped("scenes/demo.toml", 3000)],
            Self::Gltf => vec![seeds::gltf()],
            Self::Glb => vec![seeds::glb(), compressed()],
            Self::Hdr => seeds::hdrs(),
            Self::Exr => seeds::exrs(),
            Self::Png => seeds::pngs(),
            Self::Jpeg => seeds::jpegs(),
            Self::Tga => seeds::tgas(),
            Self::Webp => seeds::webps(),
            Self::Basis => crate::asset::basis::tests::files().into(),
            Self::Ktx2 => seeds::ktx2s(),
            Self::CachedTextures | Self::CachedLight => bench.entries.iter().map(|(_, bytes)| bytes.clone()).collect(),
            Self::States => seeds::states(),
        }
    }

    /// Extensions of the large scenes' files that it reads.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Obj => &["obj"],
            Self::Mtl => &["mtl"],
            Self::Gltf => &["gltf"],
            Self::Glb => &["glb"],
            Self::Hdr => &["hdr"],
            Self::Exr => &["exr"],
            Self::Png => &["png"],
            Self::Jpeg => &["jpg", "JPG"],
            Self::Tga => &["tga"],
            Self::Webp => &["webp"],
            Self::Scene | Self::Basis | Self::Ktx2 | Self::CachedTextures | Self::CachedLight | Self::States => &[],
        }
    }
}

/// The beginning of a shipped file, up to the end of a line.
fn shipped(name: &str, length: usize) -> Vec<u8> {
    let mut bytes = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets").join(name)).unwrap();
    bytes.truncate(length);
    let end = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    bytes.truncate(end);
    bytes
}

/// Where one reader reads one file after another.
pub struct Bench {
    reader: Reader,
    folder: PathBuf,
    /// Names and contents of the cache's entries, as they should be.
    entries: Vec<(String, Vec<u8>)>,
    /// What light is kept for.
    scene: Option<Scene>,
}

impl Bench {
    /// In a folder, which may be from an earlier run.
    pub fn new(reader: Reader, folder: &Path) -> Self {
        seeds::write_good_files(folder);
        fs::write(folder.join("uses.obj"), seeds::OBJ.replace("good.mtl", "case.mtl")).unwrap();
        let mut bench = Self { reader, folder: folder.to_owned(), entries: Vec::new(), scene: None };
        let cached = bench.path("cache");
        if cached.exists() {
            fs::remove_dir_all(&cached).unwrap();
        }
        match reader {
            Reader::CachedTextures => drop(bench.load_cached().unwrap()),
            Reader::CachedLight => {
                let scene = load(&bench.path("good.obj"), &raw(), &Report::silent()).unwrap();
                bench.flatten(&scene);
                let bounds = Bounds { min: glam::Vec3::NEG_ONE, max: glam::Vec3::ONE };
                let probes = vec![Probe { position: glam::Vec3::ZERO, bounds, thing: None }; 2];
                LightPlan { layers: 2, probes, dark: false }.keep(&bench.cache(), PLAN);
                bench.scene = Some(scene);
            }
            _ => return bench,
        }
        let mut files: Vec<PathBuf> = fs::read_dir(cached).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        let entry = |path: PathBuf| (path.file_stem().unwrap().to_str().unwrap().to_owned(), fs::read(path).unwrap());
        bench.entries = files.into_iter().map(entry).collect();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn cache(&self) -> Cache {
        Cache::in_folder(self.path("cache"))
    }

    fn load_cached(&self) -> Result<Scene> {
        let textures = TextureOptions { cache: Some(self.cache()), storage: Storage::Bc, ..TextureOptions::default() };
        load(&self.path("good.obj"), &LoadOptions { textures, ..LoadOptions::default() }, &Report::silent())
    }

    fn flatten(&self, scene: &Scene) {
        let (cache, report, stop) = (self.cache(), Report::silent(), AtomicBool::new(false));
        let work = atlas::Work { cache: Some(&cache), report: &report, stop: &stop };
        let flat =
            atlas::flatten(scene.geometry(), &atlas::hidden_triangles(scene, Some(&cache)), atlas::SIDES[0], work)
                .unwrap();
        for mesh in &flat.meshes {
            assert!(mesh.indices.iter().all(|index| (*index as usize) < mesh.vertices.len()));
        }
    }

    /// Reads bytes as a file of its kind, and checks what comes of it.
    pub fn read(&self, bytes: &[u8]) -> Taken {
        let path = self.path(self.reader.file());
        fs::write(&path, bytes).unwrap();
        match self.reader {
            Reader::Obj | Reader::Scene | Reader::Gltf | Reader::Glb => self.taken(scene(&path)),
            Reader::Mtl => self.taken(scene(&self.path("uses.obj"))),
            Reader::Hdr | Reader::Exr => {
                let picture = self.taken(picture(&path));
                worse(self.taken(panorama(&path)), picture)
            }
            Reader::Png | Reader::Jpeg | Reader::Tga | Reader::Webp => {
                let picture = self.taken(picture(&path));
                worse(self.taken(texture(path)), picture)
            }
            Reader::Basis => self.taken(texture(path)),
            Reader::Ktx2 => self.taken(Ktx2::read(&path, ENTRY_BYTES).map(drop)),
            Reader::CachedTextures | Reader::CachedLight => self.read_entries(&path, bytes),
            Reader::States => self.read_states(&path),
        }
    }

    /// Puts a file in the place of every entry, with the hash that it should have where that is possible.
    fn read_entries(&self, path: &Path, bytes: &[u8]) -> Taken {
        let read = Ktx2::from_bytes(path, bytes);
        for (key, _) in &self.entries {
            match &read {
                Ok(texture) => self.cache().store(key, texture.clone()).unwrap(),
                Err(_) => fs::write(self.path("cache").join(key).with_extension("ktx2"), bytes).unwrap(),
            }
        }
        match &self.scene {
            None => check_scene(&self.load_cached().unwrap()),
            Some(scene) => {
                self.flatten(scene);
                let _ = LightPlan::load(&self.cache(), PLAN);
            }
        }
        self.taken(read.map(drop))
    }

    /// As each state that there is; what cannot be read is as at the first start.
    fn read_states(&self, path: &Path) -> Taken {
        let _ = Saved::read(path);
        let _ = Record::open(path, Record::default());
        let _ = fs::read_to_string(path).map(|text| probe::runtime_folders(&text));
        let ladder = store::read(path).map(|ladder| {
            for config in &ladder.configs {
                let _ = settings::options(&config.flags);
            }
        });
        self.taken(ladder)
    }

    fn taken(&self, result: Result<()>) -> Taken {
        let Err(error) = result else { return Taken::Read };
        let text = error.to_string();
        let folder = self.folder.to_str().unwrap();
        assert!(text.contains(folder), "the error names no file: {text}");
        assert!(!text.contains(['\n', '\r']), "the error is more than a line: {text}");
        let length = text.replace(folder, "").chars().count();
        assert!(length <= LONGEST, "the error has {length} characters: {text}");
        assert!(!matches!(error, Error::Usage(_)), "a file is no usage: {text}");
        let Some((_, reason)) = text.split_once(contained::GAVE_UP) else { return Taken::Refused };
        let mut reasons = File::options().append(true).create(true).open(self.path(REASONS)).unwrap();
        writeln!(reasons, "{}", reason.trim()).unwrap();
        Taken::GaveUp
    }
}

const PLAN: &str = "plan";

/// The file of the folder that tells why decoders gave up.
pub const REASONS: &str = "reasons";

fn worse(a: Taken, b: Taken) -> Taken {
    if a == Taken::GaveUp || b == Taken::Read { a } else { b }
}

fn raw() -> LoadOptions {
    let textures = TextureOptions { storage: Storage::Raw, ..TextureOptions::default() };
    LoadOptions { textures, ..LoadOptions::default() }
}

fn scene(path: &Path) -> Result<()> {
    load(path, &raw(), &Report::silent()).map(|scene| check_scene(&scene))
}

/// What is drawn must be in range, and of finite numbers.
fn check_scene(scene: &Scene) {
    let finite = |numbers: &[f32]| numbers.iter().all(|number| number.is_finite());
    for mesh in &scene.meshes {
        assert!(mesh.material < scene.materials.len(), "material {}", mesh.material);
        assert!(mesh.indices.len().is_multiple_of(3) && !mesh.indices.is_empty(), "{} indices", mesh.indices.len());
        assert!(mesh.indices.iter().all(|index| (*index as usize) < mesh.vertices.len()), "an index");
        for vertex in &mesh.vertices {
            let all = [&vertex.position[..], &vertex.normal, &vertex.uv, &vertex.tangent, &vertex.uv1];
            assert!(all.into_iter().all(finite), "{vertex:?}");
        }
    }
    for instance in &scene.instances {
        assert!(instance.mesh < scene.meshes.len() && instance.world_from_local.is_finite(), "{instance:?}");
    }
    for material in &scene.materials {
        let maps = material.maps();
        assert!(maps.into_iter().flatten().all(|map| map < scene.textures.len()), "{maps:?}");
        let factors = [material.base_color_factor, material.emissive_factor];
        let numbers = [material.opacity, material.metallic_factor, material.roughness_factor];
        assert!(factors.iter().all(|factor| factor.is_finite()) && finite(&numbers), "{material:?}");
    }
    scene.textures.iter().for_each(check_levels);
    assert!(!scene.cameras.is_empty());
    for camera in &scene.cameras {
        let fov = camera.vertical_fov_degrees;
        assert!(camera.position.is_finite() && camera.target.is_finite() && fov > 0.0 && fov < 180.0, "{camera:?}");
    }
    for light in &scene.lights {
        assert!(light.position.is_finite() && light.intensity.is_finite(), "{light:?}");
    }
}

fn check_levels(texture: &MipChain) {
    let entry = texture.clone().into_ktx2();
    for (level, bytes) in entry.levels.iter().enumerate() {
        assert_eq!(bytes.len() as u64, entry.level_bytes(level as u32), "{} level {level}", texture.name);
    }
}

fn texture(path: PathBuf) -> Result<()> {
    Texture::load(&ImageSource::file(path), Encoding::Srgb).map(|texture| check_texture(&texture))
}

fn check_texture(texture: &Texture) {
    assert_eq!(texture.pixels.len(), texture.width as usize * texture.height as usize * 4);
    assert!(texture.width > 0 && texture.height > 0);
}

fn panorama(path: &Path) -> Result<()> {
    let panorama = Panorama::load(path, &Report::silent())?;
    assert_eq!(panorama.texels.len(), panorama.width as usize * panorama.height as usize);
    assert!(panorama.texels.iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    Ok(())
}

fn picture(path: &Path) -> Result<()> {
    let picture = Picture::read(path)?;
    assert_eq!(picture.pixels.len(), picture.width as usize * picture.height as usize);
    assert!(picture.width > 0 && picture.height > 0);
    Ok(())
}
