//! Makes the models and textures under `assets/`: `cargo run --release --example make-assets [FOLDER]`.

use std::path::{Path, PathBuf};

mod geometry;
mod textures;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("assets"), PathBuf::from);
    for file in geometry::files() {
        write(&folder.join(file.path), file.text.as_bytes())?;
    }
    for set in textures::sets() {
        for map in set.maps()? {
            write(&folder.join("textures").join(set.name).join(map.file), &map.jpeg)?;
        }
    }
    Ok(())
}

/// Writes one file, making its folder, and says how large it is.
#[expect(clippy::print_stdout, reason = "a tool says what it wrote")]
fn write(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent)?;
    }
    std::fs::write(path, bytes)?;
    println!("{:>8} kB  {}", bytes.len().div_ceil(1000), path.display());
    Ok(())
}
