//! Shipped scenes against their golden pictures, and that the same command gives the same bytes.
//! After a change that is meant to be seen: `PBR_VR_BLESS=1 cargo test --test pictures`, and look at what changed.

mod common;

use std::path::{Path, PathBuf};

use common::{Look, Workshop};
use pbr_vr::asset::picture::{Picture, compare};

/// Mean FLIP that driver versions may differ by; a shifted highlight gives ten times as much.
const TOLERANCE: f32 = 0.005;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

#[test]
fn shipped_scenes_look_like_their_golden_pictures() {
    let shop = Workshop::new();
    for name in ["demo", "sphere", "teapot", "tearoom"] {
        let scene = assets().join("scenes").join(format!("{name}.toml"));
        let file = format!("{name}.png");
        let picture = shop.render(&scene, &Look { file: &file, size: [480, 270], ..Look::default() }).remove(0);
        let golden = assets().join("golden").join(&file);
        if std::env::var_os("PBR_VR_BLESS").is_some() {
            std::fs::create_dir_all(assets().join("golden")).expect("the folder of golden pictures");
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
}

#[test]
fn the_same_command_gives_the_same_bytes() {
    let shop = Workshop::new();
    let scene = assets().join("scenes/teapot.toml");
    for extension in ["png", "exr"] {
        let files = ["a", "b"].map(|name| format!("{name}.{extension}"));
        let bytes = files.each_ref().map(|file| {
            shop.render(&scene, &Look { file, size: [160, 120], ..Look::default() });
            std::fs::read(shop.path(file)).expect("the written picture")
        });
        assert!(bytes[0] == bytes[1], ".{extension} differs between two runs");
    }
}
