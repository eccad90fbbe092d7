//! Compiles every stage file of glsl/ to SPIR-V and lists them for `gpu::shader`, those of tests/glsl/ in a separate
//! list; generates `bindings.glsl`; embeds the Windows manifest.

#[path = "src/gpu/shader_compiler.rs"]
mod shader_compiler;

#[path = "src/gpu/binding_type.rs"]
mod binding_type;
#[path = "src/render/bindings.rs"]
mod bindings;

/// Where `bindings` finds the type, as in the program.
mod gpu {
    pub use crate::binding_type::BindingType;
}

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::{env, fs, process, thread};

/// Where this variable is set, shaders are not optimised: for checks of the Rust code, which has to wait for them.
const UNOPTIMIZED: &str = "PBR_VR_UNOPTIMIZED_SHADERS";
/// What the names of shaders for core materials begin with.
const CORE: &str = "core/";
/// Of shaders of less SPIR-V there is no other for core materials.
const WORTHWHILE_BYTES: usize = 50_000;

#[expect(clippy::print_stderr, reason = "cargo shows what a failed build script printed")]
fn main() {
    if let Err(message) = run() {
        // File and line first, as in a compiler's message.
        eprintln!("{message}");
        process::exit(1);
    }
}

fn run() -> Result<(), String> {
    let variable = |name: &str| env::var(name).map_err(|e| format!("{name}: {e}"));
    let root = PathBuf::from(variable("CARGO_MANIFEST_DIR")?);
    let out = PathBuf::from(variable("OUT_DIR")?);
    let glsl = root.join("glsl");
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=tests/glsl");
    println!("cargo:rerun-if-env-changed={UNOPTIMIZED}");
    for file in ["src/gpu/shader_compiler.rs", "src/gpu/binding_type.rs", "src/render/bindings.rs"] {
        println!("cargo:rerun-if-changed={file}");
    }
    // With `hot-reload` the program includes it.
    write_file(&out.join(shader_compiler::BINDINGS), bindings::glsl().as_bytes())?;
    let ours = table("COMPILED", &glsl, &glsl, &out)?;
    let core = format!("/// What names of shaders for core materials begin with.\nconst CORE: &str = {CORE:?};\n");
    write_file(&out.join("shaders.rs"), (core + &ours).as_bytes())?;
    // Only unit tests include this one.
    let tests = table("FOR_TESTS", &root.join("tests/glsl"), &glsl, &out)?;
    write_file(&out.join("test_shaders.rs"), tests.as_bytes())?;
    if variable("CARGO_CFG_TARGET_OS")? == "windows" {
        embed_manifest()?;
    }
    Ok(())
}

/// The manifest of the programs on Windows: paths may be longer than 260 characters, text is UTF-8, and windows are
/// aware of each monitor's scale.
fn embed_manifest() -> Result<(), String> {
    use embed_manifest::manifest::{ActiveCodePage, DpiAwareness, Setting};
    let manifest = embed_manifest::new_manifest("pbr-vr")
        .active_code_page(ActiveCodePage::Utf8)
        .dpi_awareness(DpiAwareness::PerMonitorV2)
        .long_path_aware(Setting::Enabled);
    embed_manifest::embed_manifest(manifest).map_err(|e| format!("the Windows manifest: {e}"))
}

/// Rust source of a list of all stage files of `folder`, compiled into `out`, and of those of which less is left for core materials.
fn table(list: &str, folder: &Path, includes: &Path, out: &Path) -> Result<String, String> {
    let mut table = format!("static {list}: &[(&str, &[u8])] = &[\n");
    let mut add = |name: &str, spirv: &[u8]| {
        let file = format!("{list}_{}.spv", name.replace('/', "_"));
        write_file(&out.join(&file), spirv)?;
        writeln!(table, "    ({name:?}, include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{file}\"))),")
            .map_err(|e| e.to_string())
    };
    for Shader { name, whole, core } in compiled(folder, includes)? {
        add(&name, &whole)?;
        if let Some(core) = core {
            add(&format!("{CORE}{name}"), &core)?;
        }
    }
    table.push_str("];\n");
    Ok(table)
}

/// A stage file's SPIR-V, and that for core materials where it is much less.
struct Shader {
    name: String,
    whole: Vec<u8>,
    core: Option<Vec<u8>>,
}

/// All stage files of `folder` in order, compiled by all processors.
fn compiled(folder: &Path, includes: &Path) -> Result<Vec<Shader>, String> {
    let bindings = bindings::glsl();
    let optimized = env::var_os(UNOPTIMIZED).is_none();
    let shader = |name: &String| {
        let compile = |core| {
            let how = shader_compiler::Compilation { includes, bindings: &bindings, debug: false, core, optimized };
            shader_compiler::compile(&folder.join(name), &how)
        };
        let whole = compile(false)?;
        let core = if whole.len() < WORTHWHILE_BYTES { None } else { Some(compile(true)?) };
        let core = core.filter(|core| 10 * core.len() < 9 * whole.len());
        Ok(Shader { name: name.clone(), whole, core })
    };
    let names = shader_compiler::stage_files(folder)?;
    let (next, shaders) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((i, name)) = Some(next.fetch_add(1, Relaxed)).and_then(|i| Some((i, names.get(i)?))) {
                    let shader = shader(name);
                    shaders.lock().unwrap_or_else(PoisonError::into_inner).insert(i, shader);
                }
            });
        }
    });
    shaders.into_inner().unwrap_or_else(PoisonError::into_inner).into_values().collect()
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), String> {
    fs::write(path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}
