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

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::{env, fs, process, thread};

/// A folder for SPIR-V that builds share, instead of one in the output folder.
const SPIRV_FOLDER: &str = "PBR_VR_SPIRV_FOLDER";
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
    let kept = KeptSpirv::new(env::var_os(SPIRV_FOLDER).map_or_else(|| out.join("spirv"), PathBuf::from))?;
    let ours = table("COMPILED", &glsl, &glsl, &out, &kept)?;
    let core = format!("/// What names of shaders for core materials begin with.\nconst CORE: &str = {CORE:?};\n");
    write_file(&out.join("shaders.rs"), (core + &ours).as_bytes())?;
    // Only unit tests include this one.
    let tests = table("FOR_TESTS", &root.join("tests/glsl"), &glsl, &out, &kept)?;
    write_file(&out.join("test_shaders.rs"), tests.as_bytes())?;
    kept.forget_unused();
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
fn table(list: &str, folder: &Path, includes: &Path, out: &Path, kept: &KeptSpirv) -> Result<String, String> {
    let mut table = format!("static {list}: &[(&str, &[u8])] = &[\n");
    let mut add = |name: &str, spirv: &[u8]| {
        let file = format!("{list}_{}.spv", name.replace('/', "_"));
        write_file(&out.join(&file), spirv)?;
        writeln!(table, "    ({name:?}, include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{file}\"))),")
            .map_err(|e| e.to_string())
    };
    for Shader { name, whole, core } in compiled(folder, includes, kept)? {
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
fn compiled(folder: &Path, includes: &Path, kept: &KeptSpirv) -> Result<Vec<Shader>, String> {
    let bindings = bindings::glsl();
    let optimized = env::var_os(UNOPTIMIZED).is_none();
    let shader = |name: &String| {
        let compile = |core| {
            let how = shader_compiler::Compilation { includes, bindings: &bindings, debug: false, core, optimized };
            kept.compile(&folder.join(name), &how)
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

/// SPIR-V of earlier builds, each beside the text that it was compiled from: a shader is compiled again only if that changes.
struct KeptSpirv {
    folder: PathBuf,
    /// Names of files that this build has read or written.
    used: Mutex<BTreeSet<String>>,
}

impl KeptSpirv {
    fn new(folder: PathBuf) -> Result<Self, String> {
        fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(Self { folder, used: Mutex::default() })
    }

    fn compile(&self, path: &Path, how: &shader_compiler::Compilation<'_>) -> Result<Vec<u8>, String> {
        let text = shader_compiler::preprocess(path, how)?;
        let text = format!("// {}, optimized: {}\n{text}", path.display(), how.optimized);
        let mut hasher = DefaultHasher::new();
        text.hash(&mut hasher);
        let [text_name, spirv_name] = ["glsl", "spv"].map(|kind| format!("{:016x}.{kind}", hasher.finish()));
        let [text_file, spirv_file] = [&text_name, &spirv_name].map(|name| self.folder.join(name));
        self.used.lock().unwrap_or_else(PoisonError::into_inner).extend([text_name, spirv_name]);
        // Hashes may collide.
        if fs::read_to_string(&text_file).is_ok_and(|known| known == text)
            && let Ok(spirv) = fs::read(&spirv_file)
        {
            return Ok(spirv);
        }
        let spirv = shader_compiler::compile(path, how)?;
        // The text last: a build that ends in between leaves nothing that is taken for whole.
        write_file(&spirv_file, &spirv)?;
        write_file(&text_file, text.as_bytes())?;
        Ok(spirv)
    }

    /// Removes what no shader of this build is compiled to. Nothing fails where that fails.
    fn forget_unused(&self) {
        let used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            if !entry.file_name().to_str().is_some_and(|name| used.contains(name)) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), String> {
    fs::write(path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}
