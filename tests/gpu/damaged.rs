//! Models with wrong numbers in them that can be loaded all the same: they are drawn without a message of the validation.

use pbr_vr::asset::Report;
use pbr_vr::render::{Eye, LightDetail, LightModel, Shading};
use pbr_vr::scene::load;

use crate::common::Workshop;
use crate::common::colour::{Look, look};
use crate::common::gltf::everything;
use crate::common::stage::{load_options, with_gpu};

/// Numbers that look random and are the same in every run (Marsaglia, "Xorshift RNGs", 2003).
fn next(state: &mut u64, end: usize) -> usize {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state % end as u64) as usize
}

/// The same file with some digits of its JSON replaced.
fn changed(text: &[u8], state: &mut u64) -> Vec<u8> {
    let mut changed = text.to_vec();
    let end = text.windows(5).position(|w| w == b"data:").expect("a buffer");
    let digits: Vec<usize> = (0..text.len()).filter(|i| text[*i].is_ascii_digit() && *i < end).collect();
    for _ in 0..=next(state, 3) {
        changed[digits[next(state, digits.len())]] = b'0' + next(state, 10) as u8;
    }
    changed
}

#[test]
fn what_can_be_loaded_can_be_drawn() {
    let shop = Workshop::new();
    let good = everything().bytes(false);
    let (mut state, mut drawn) = (0x2545_f491_4f6c_dd1d, 0);
    with_gpu(|gpu| {
        for number in 0..16 {
            let path = shop.path("a.gltf");
            let bytes = if number == 0 { good.clone() } else { changed(&good, &mut state) };
            std::fs::write(&path, bytes).expect("a file");
            let Ok(scene) = load(&path, &load_options(), &Report::silent()) else { continue };
            let eye = Eye::of_camera(&scene.cameras[0], 16.0 / 9.0);
            let shading = if number % 4 == 0 { Shading::Reference } else { Shading::Pbr };
            let light = if number % 8 == 0 { LightModel::Baked } else { LightModel::Direct };
            let detail =
                LightDetail { lightmap_size: Some(64), lightmap_samples: 8, probe_size: 16, ..LightDetail::default() };
            // It holds no number that is none, or below 0.
            look(gpu, &scene, &[eye], Look { light, shading, size: [32, 18], samples: 4, frames: 2, detail });
            drawn += 1;
        }
    });
    println!("{drawn} drawn");
    assert!(drawn > 6, "{drawn}");
}
