//! `kill -9` while files are written: each is absent, the old one or the whole new one, and the next run works as ever.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant, SystemTime};

use pbr_vr::asset::picture::Picture;

use super::bake::strips;
use crate::common::{Workshop, material, sphere};
use crate::desktop::command;

/// Kills of all tests here together, if not the default.
const KILLS_VARIABLE: &str = "PBR_VR_KILLS";
const KILLS: usize = 12;
/// What an output held before.
const OLD: &[u8] = b"old";
/// What Mesa has compiled: once for all starts here, most of whose time that takes.
pub const DRIVER_CACHE: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/driver-cache");
const PATIENCE: Duration = Duration::from_secs(120);

/// A test's part of all kills, in twelfths, rounded up.
pub fn kills(twelfths: usize) -> usize {
    let all = std::env::var(KILLS_VARIABLE).map_or(KILLS, |n| n.parse().expect("a number of kills"));
    (all * twelfths).div_ceil(12)
}

/// When a program is killed.
#[derive(Clone, Copy, Debug)]
pub enum Point {
    /// After a time.
    After(Duration),
    /// As soon as the files have changed so often: one was created, has grown, was renamed or removed.
    Change(usize),
}

/// All files of a folder and those within, by their path in it.
pub fn files(folder: &Path) -> BTreeMap<PathBuf, u64> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).into_iter().flatten().flatten() {
            // It may be gone by now.
            let Ok(data) = entry.metadata() else { continue };
            let path = entry.path();
            let within = path.strip_prefix(folder).expect("an entry of it").to_owned();
            if data.is_dir() {
                folders.push(path);
            } else if data.is_file() {
                found.insert(within, data.len());
            }
        }
    }
    found
}

/// Waits for a point, or the program's end; returns how often the files have changed until then.
pub fn wait_for(point: Point, folder: &Path, mut has_ended: impl FnMut() -> bool) -> usize {
    let (started, mut known, mut changes) = (Instant::now(), files(folder), 0);
    while !has_ended() {
        assert!(started.elapsed() < PATIENCE, "it does not end");
        let now = files(folder);
        if now != known {
            (known, changes) = (now, changes + 1);
        }
        if match point {
            Point::After(time) => started.elapsed() >= time,
            Point::Change(count) => changes >= count,
        } {
            break;
        }
        std::thread::sleep(Duration::from_micros(100));
    }
    changes
}

/// Points spread over a run: every second one at a change of its files.
fn points(count: usize, took: Duration, changes: usize) -> impl Iterator<Item = Point> {
    (0..count).map(move |i| {
        let share = (i as f64 + 0.5) / count as f64;
        if i % 2 == 0 {
            Point::After(took.mul_f64(share))
        } else {
            Point::Change(1 + (share * changes as f64) as usize)
        }
    })
}

pub fn is_temporary(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".pbr-vr-"))
}

/// Makes the temporary files older than any program's that runs, and says how many there are.
pub fn age_temporary_files(folder: &Path) -> usize {
    let left: Vec<PathBuf> = files(folder).into_keys().filter(|path| is_temporary(path)).collect();
    for path in &left {
        let file = File::options().write(true).open(folder.join(path)).expect("a temporary file");
        file.set_modified(SystemTime::now() - Duration::from_secs(2 * 3600)).expect("its time");
    }
    left.len()
}

pub fn assert_no_temporary_files(folder: &Path, when: &str) {
    let left: Vec<PathBuf> = files(folder).into_keys().filter(|path| is_temporary(path)).collect();
    assert!(left.is_empty(), "{when}: {left:?} are left");
}

/// A run of the program that writes files, and where they are.
struct Job {
    arguments: &'static [&'static str],
    /// What it writes outside of the cache.
    outputs: &'static [&'static str],
    /// Whether it names them on stdout.
    tells: bool,
    /// Whether it writes over older results, instead of taking another name.
    replaces: bool,
}

/// A textured ball under a sky, and things that take light from each other.
fn shop() -> Workshop {
    let shop = Workshop::new();
    strips(&shop, 1);
    let wood: Vec<u8> = (0..64 * 64).flat_map(|i| [(i % 64 * 4) as u8, (i / 64 * 4) as u8, 90, 255]).collect();
    Picture::from_srgb8("wood", 64, 64, &wood).write(&shop.path("wood.png")).expect("a texture");
    shop.write("m.mtl", &(material([0.9, 0.6, 0.3], 0.0, 0.3) + "map_Kd wood.png\n"));
    shop.write("ball.obj", &sphere("m.mtl"));
    let camera = "[[camera]]\nname = \"front\"\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 50\n";
    let model = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"ball.obj\"\n";
    shop.write("scene.toml", &format!("{model}{camera}"));
    shop
}

impl Job {
    fn start(&self, folder: &Path, more: &[&str]) -> Child {
        let mut command = command(folder);
        command.args(self.arguments).args(more).env("PBR_VR_ASSETS", assets());
        command.env("MESA_SHADER_CACHE_DIR", DRIVER_CACHE).stdout(Stdio::piped());
        command.spawn().expect("the program starts")
    }

    /// Kills it at so many points of its run, each time in a new folder.
    fn kill(&self, count: usize) {
        let undisturbed = shop();
        let inputs: BTreeSet<PathBuf> = files(undisturbed.folder.path()).into_keys().collect();
        let started = Instant::now();
        let mut child = self.start(undisturbed.folder.path(), &[]);
        let has_ended = || child.try_wait().expect("a child").is_some();
        let changes = wait_for(Point::After(PATIENCE), undisturbed.folder.path(), has_ended);
        let took = started.elapsed();
        let told = self.succeeds(child);
        let whole: BTreeMap<PathBuf, Vec<u8>> = files(undisturbed.folder.path())
            .into_keys()
            .filter(|path| !inputs.contains(path))
            .map(|path| (path.clone(), fs::read(undisturbed.path(&path.to_string_lossy())).expect("a file")))
            .collect();
        assert!(self.outputs.iter().all(|name| whole.contains_key(Path::new(name))), "{:?}", whole.keys());
        assert_eq!(self.outputs.iter().any(|name| told.contains(name)), self.tells, "{told}");

        let (mut ended, mut left) = (0, 0);
        for (i, point) in points(count, took, changes).enumerate() {
            let shop = shop();
            let folder = shop.folder.path();
            // Every other time there is an older result.
            if self.replaces && i % 4 >= 2 {
                for name in self.outputs {
                    fs::create_dir_all(folder.join(name).parent().expect("a folder")).expect("a folder");
                    fs::write(folder.join(name), OLD).expect("an older result");
                }
            }
            let mut child = self.start(folder, &[]);
            wait_for(point, folder, || child.try_wait().expect("a child").is_some());
            ended += usize::from(child.try_wait().expect("a child").is_some());
            // SIGKILL, which no program can handle.
            child.kill().expect("its end");
            let output = child.wait_with_output().expect("its end");
            let said = String::from_utf8_lossy(&output.stdout).into_owned();
            let when = format!("{:?}, killed at {point:?}", self.arguments);
            for path in files(folder).into_keys().filter(|path| !inputs.contains(path) && !is_temporary(path)) {
                let bytes = fs::read(folder.join(&path)).expect("a file");
                let expected = whole.get(&path).unwrap_or_else(|| panic!("{when}: {} is there", path.display()));
                let is_old = bytes == OLD && self.outputs.iter().any(|name| path == Path::new(name));
                let is_whole = is_whole(&path, &bytes, expected);
                assert!(is_whole || is_old, "{when}: {} is not whole: {} bytes", path.display(), bytes.len());
                let is_told = said.contains(&*path.to_string_lossy());
                assert!(is_whole || !is_told, "{when}: {} is not what was told: {said}", path.display());
            }
            for name in self.outputs.iter().filter(|name| said.contains(*name)) {
                assert!(folder.join(name).exists(), "{when}: {name} is not there: {said}");
            }

            left += age_temporary_files(folder);
            self.succeeds(self.start(folder, &["--validate"]));
            for (path, expected) in &whole {
                let bytes = fs::read(folder.join(path)).unwrap_or_default();
                assert!(is_whole(path, &bytes, expected), "{when}, and run again: {}", path.display());
            }
            assert_no_temporary_files(folder, &format!("{when}, and run again"));
        }
        println!(
            "{:?}: {count} kills in {} ms and at {changes} changes, {ended} of them after its end; {left} temporary \
             files were left, and removed",
            self.arguments,
            took.as_millis()
        );
    }

    fn succeeds(&self, child: Child) -> String {
        let output = child.wait_with_output().expect("its end");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && errors.is_empty(), "{:?}: {errors}", self.arguments);
        String::from_utf8_lossy(&output.stdout).into_owned()
    }
}

/// Those of the program.
fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

/// Whether a file is as an undisturbed run writes it: the same bytes, but for files that hold times or what the driver has
/// compiled.
fn is_whole(path: &Path, bytes: &[u8], undisturbed: &[u8]) -> bool {
    let lines = |bytes: &[u8]| bytes.iter().filter(|byte| **byte == b'\n').count();
    let ends_like_it = bytes.last() == undisturbed.last();
    if path.starts_with("cache/pbr-vr/pipelines") {
        return bytes.split_at_checked(32).is_some_and(|(hash, rest)| blake3::hash(rest).as_bytes() == hash);
    }
    match path.extension().and_then(|extension| extension.to_str()) {
        // Grows with the pictures that are done, each of which is recorded when it is whole.
        Some("json") if path.to_string_lossy().ends_with("-sequence.json") => {
            ends_like_it && serde_json::from_slice::<serde_json::Value>(bytes).is_ok_and(|v| v["pictures"].is_object())
        }
        Some("json") => {
            let keys = |bytes: &[u8]| -> Option<Vec<String>> {
                let value: serde_json::Value = serde_json::from_slice(bytes).ok()?;
                Some(value.as_object()?.keys().cloned().collect())
            };
            ends_like_it && keys(bytes).is_some() && keys(bytes) == keys(undisturbed)
        }
        Some("csv" | "md") => ends_like_it && lines(bytes) == lines(undisturbed),
        Some("svg") => bytes.trim_ascii_end().ends_with(b"</svg>"),
        _ => bytes == undisturbed,
    }
}

#[test]
fn render_is_killed_while_it_fills_the_cache_and_writes_a_picture() {
    let arguments =
        &["render", "scene.toml", "-o", "out.png", "--json", "facts.json", "--size", "32x24", "--light", "direct"];
    Job { arguments, outputs: &["out.png", "facts.json"], tells: false, replaces: true }.kill(kills(2));
}

#[test]
fn render_is_killed_while_it_bakes_light_and_keeps_it() {
    let arguments = &[
        "render",
        "strips.toml",
        "-o",
        "out.png",
        "--size",
        "48x32",
        "--light",
        "baked",
        "--lightmap-size",
        "64",
        "--lightmap-samples",
        "8",
        "--probe-size",
        "16",
    ];
    Job { arguments, outputs: &["out.png"], tells: false, replaces: true }.kill(kills(3));
}

#[test]
fn bake_is_killed_while_it_writes_its_textures() {
    let arguments = &["bake", "sky.exr", "-o", "baked", "--size", "16", "--json", "baked.json"];
    let outputs = &["baked/brdf.ktx2", "baked/irradiance.ktx2", "baked/specular.ktx2", "baked.json"];
    Job { arguments, outputs, tells: true, replaces: true }.kill(kills(3));
}

#[test]
fn a_sequence_is_killed_between_its_pictures_and_goes_on() {
    let arguments =
        &["render", "scene.toml", "-o", "t.png", "--turntable", "3", "--size", "32x24", "--light", "direct"];
    let outputs = &["t-0001.png", "t-0002.png", "t-0003.png"];
    Job { arguments, outputs, tells: true, replaces: true }.kill(kills(3));
}

#[test]
fn measure_is_killed_while_it_writes_tables_and_charts() {
    let arguments = &[
        "measure",
        "precompute",
        "-o",
        "out",
        "--panorama",
        "sky.exr",
        "--size",
        "64",
        "--method",
        "ours",
        "--json",
        "all.json",
    ];
    let outputs =
        &["out/precompute.csv", "out/precompute.json", "out/precompute.md", "out/precompute-sky-64.svg", "all.json"];
    Job { arguments, outputs, tells: false, replaces: true }.kill(kills(2));
}

#[test]
fn a_view_without_a_display_is_killed_and_no_empty_file_has_its_pictures_name() {
    let arguments = &["view", "scene.toml", "--light", "direct", "--samples", "1", "--scale", "0.25"];
    Job { arguments, outputs: &["pbr-vr.png"], tells: true, replaces: false }.kill(kills(1));
}
