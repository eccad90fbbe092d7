//! Compiles every stage file of glsl/ to SPIR-V and lists them for `gpu::shader`, those of tests/glsl/ in a list apart;
//! hashes the code of what is kept on disk; says to Windows what the program can do.

#[path = "src/gpu/shader_compiler.rs"]
mod shader_compiler;

use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::{Path, PathBuf};
use std::{env, fs, process};

#[expect(clippy::print_stderr, reason = "cargo shows what a failed build script printed")]
fn main() {
    if let Err(message) = run() {
        // One block, file and line first, so that it reads like a compiler's own message.
        eprintln!("{message}");
        process::exit(1);
    }
}

fn run() -> Result<(), String> {
    let variable = |name: &str| env::var(name).map_err(|e| format!("{name}: {e}"));
    let root = PathBuf::from(variable("CARGO_MANIFEST_DIR")?);
    let out = PathBuf::from(variable("OUT_DIR")?);
    let debug = variable("PROFILE")? == "debug";
    let glsl = root.join("glsl");
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=tests/glsl");
    println!("cargo:rerun-if-changed=src/gpu/shader_compiler.rs");
    let ours = table("COMPILED", &glsl, &glsl, &out, debug)?;
    write_file(&out.join("shaders.rs"), ours.as_bytes())?;
    // Only unit tests include this one.
    let tests = table("FOR_TESTS", &root.join("tests/glsl"), &glsl, &out, debug)?;
    write_file(&out.join("test_shaders.rs"), tests.as_bytes())?;
    let maps = code_hash(&root, &["src/precompute", "src/reference"])?;
    println!("cargo:rustc-env=PBR_VR_PRECOMPUTE_CODE={maps:016x}");
    let textures = code_hash(&root, &["src/asset", "src/scene/maps.rs", "src/reference/mip.rs"])?;
    println!("cargo:rustc-env=PBR_VR_TEXTURE_CODE={textures:016x}");
    if variable("CARGO_CFG_TARGET_OS")? == "windows" {
        embed_manifest()?;
    }
    Ok(())
}

/// What Windows is told about the programs: they take paths beyond 260 characters, text is UTF-8, and each monitor's
/// pixels are their own affair.
fn embed_manifest() -> Result<(), String> {
    use embed_manifest::manifest::{ActiveCodePage, DpiAwareness, Setting};
    let manifest = embed_manifest::new_manifest("pbr-vr")
        .active_code_page(ActiveCodePage::Utf8)
        .dpi_awareness(DpiAwareness::PerMonitorV2)
        .long_path_aware(Setting::Enabled);
    embed_manifest::embed_manifest(manifest).map_err(|e| format!("the Windows manifest: {e}"))
}

/// Rust source of a list of all stage files of `folder`, compiled into `out`.
fn table(list: &str, folder: &Path, includes: &Path, out: &Path, debug: bool) -> Result<String, String> {
    let mut table = format!("static {list}: &[(&str, &[u8])] = &[\n");
    for name in shader_compiler::stage_files(folder)? {
        let spirv = shader_compiler::compile(&folder.join(&name), includes, debug)?;
        let file = format!("{list}_{name}.spv");
        write_file(&out.join(&file), &spirv)?;
        writeln!(table, "    ({name:?}, include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{file}\"))),")
            .map_err(|e| e.to_string())?;
    }
    table.push_str("];\n");
    Ok(table)
}

/// Tells one state of the code that things kept on disk come from apart from another.
fn code_hash(root: &Path, places: &[&str]) -> Result<u64, String> {
    let mut hasher = DefaultHasher::new();
    for place in places {
        println!("cargo:rerun-if-changed={place}");
        hash_place(&root.join(place), &mut hasher).map_err(|e| format!("{place}: {e}"))?;
    }
    Ok(hasher.finish())
}

fn hash_place(path: &Path, hasher: &mut DefaultHasher) -> std::io::Result<()> {
    if path.is_file() {
        (path.file_name(), fs::read(path)?).hash(hasher);
        return Ok(());
    }
    let mut paths = fs::read_dir(path)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    paths.sort();
    paths.iter().try_for_each(|path| hash_place(path, hasher))
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), String> {
    fs::write(path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}
