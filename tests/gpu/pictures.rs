//! All scenes against their golden pictures, and that the same command gives the same bytes.
//! After a change that is meant to be seen: `PBR_VR_BLESS=1 cargo test --test gpu pictures`, and look at what changed.

use std::path::{Path, PathBuf};

use crate::common::{PictureOptions, Workshop, program, succeeds};
use pbr_vr::asset::comparison::compare;
use pbr_vr::asset::picture::Picture;

/// Mean FLIP that driver versions may differ by; a shifted highlight gives ten times as much.
const TOLERANCE: f32 = 0.005;

/// What a block's mean may differ by; as much as half a level of exposure gives ten times over.
const BLOCK_TOLERANCE: f32 = 0.01;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

#[test]
fn shipped_scenes_look_like_their_golden_pictures() {
    let shop = Workshop::new();
    for name in ["demo", "sphere", "teapot", "tearoom"] {
        check_against_golden(&shop, name, [480, 270]);
    }
}

#[test]
fn the_head_and_crytek_sponza_look_like_their_golden_pictures() {
    if crate::common::scenes("pictures of the head and Crytek Sponza").is_none() {
        return;
    }
    let shop = Workshop::new();
    for name in ["head", "crytek-sponza"] {
        check_against_golden(&shop, name, [320, 180]);
    }
}

/// Its licence forbids commercial use, so that no picture of it is kept here: only what is left of one in 16×9 blocks.
#[test]
fn dabrovic_sponza_looks_like_its_golden_means() {
    if crate::common::scenes("a picture of Dabrovic Sponza").is_none() {
        return;
    }
    let shop = Workshop::new();
    let means = block_means(&picture_of(&shop, "dabrovic-sponza", [320, 180]));
    let file = assets().join("golden/dabrovic-sponza.txt");
    if blessing() {
        let lines: Vec<String> = means.iter().map(|[r, g, b]| format!("{r:.4} {g:.4} {b:.4}\n")).collect();
        std::fs::write(&file, lines.concat()).expect("golden means");
    }
    let text = std::fs::read_to_string(&file).expect("golden means");
    let golden: Vec<f32> = text.split_whitespace().map(|number| number.parse().expect("a number")).collect();
    assert_eq!(golden.len(), 3 * means.len());
    let worst = golden.iter().zip(means.as_flattened()).fold(0.0, |worst: f32, (a, b)| worst.max((a - b).abs()));
    assert!(worst <= BLOCK_TOLERANCE, "a block's mean is off by {worst}, limit {BLOCK_TOLERANCE}");
}

fn blessing() -> bool {
    std::env::var_os("PBR_VR_BLESS").is_some()
}

fn picture_of(shop: &Workshop, name: &str, size: [u32; 2]) -> Picture {
    let scene = assets().join("scenes").join(format!("{name}.toml"));
    shop.render(&scene, &PictureOptions { file: &format!("{name}.png"), size, ..PictureOptions::default() }).remove(0)
}

fn check_against_golden(shop: &Workshop, name: &str, size: [u32; 2]) {
    let picture = picture_of(shop, name, size);
    let golden = assets().join("golden").join(format!("{name}.png"));
    if blessing() {
        picture.write(&golden).expect("a golden picture");
    }
    let comparison = compare(&picture, &Picture::read(&golden).expect("a golden picture")).expect("equal sizes");
    assert!(
        comparison.flip_mean <= TOLERANCE,
        "{name}: FLIP {} against {}, limit {TOLERANCE}",
        comparison.flip_mean,
        golden.display()
    );
}

/// Means over 16×9 blocks of a picture whose sides these divide, row by row.
fn block_means(picture: &Picture) -> Vec<[f32; 3]> {
    let [columns, rows] = [16, 9];
    let (width, height) = (picture.width / columns, picture.height / rows);
    let mut means = vec![[0.0; 3]; (columns * rows) as usize];
    for (i, pixel) in (0..).zip(&picture.pixels) {
        let (x, y): (u32, u32) = (i % picture.width, i / picture.width);
        let mean = &mut means[(y / height * columns + x / width) as usize];
        (0..3).for_each(|c| mean[c] += pixel[c] / (width * height) as f32);
    }
    means
}

#[test]
fn the_same_command_gives_the_same_bytes() {
    let shop = Workshop::new();
    let scene = assets().join("scenes/teapot.toml");
    for extension in ["png", "exr"] {
        let files = ["a", "b"].map(|name| format!("{name}.{extension}"));
        let bytes = files.each_ref().map(|file| {
            let scene = scene.to_str().expect("a path");
            let options = ["--validate", "--no-cache", "--light", "direct", "--size", "160x120"];
            succeeds(program(shop.folder.path(), &[&["render", scene, "-o", file], &options[..]].concat()));
            std::fs::read(shop.path(file)).expect("the written picture")
        });
        assert!(bytes[0] == bytes[1], ".{extension} differs between two runs");
    }
}
