//! GLSL to SPIR-V with shaderc: for build.rs, and at run time with `hot-reload`.

use std::fs;
use std::path::Path;

/// The stage files of a folder, sorted: `*.vert`, `*.frag`, `*.comp`.
// At run time, shaders are loaded by name.
#[cfg_attr(feature = "hot-reload", allow(dead_code))]
pub fn stage_files(folder: &Path) -> Result<Vec<String>, String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| kind(Path::new(name)).is_some())
        .collect();
    names.sort();
    Ok(names)
}

/// The generated include: the bindings of the renderer's tables.
pub const BINDINGS: &str = "bindings.glsl";

/// Where and how stage files are compiled.
pub struct Compilation<'a> {
    /// The folder of the files that are included.
    pub includes: &'a Path,
    /// The text of [`BINDINGS`].
    pub bindings: &'a str,
    /// With lines and names, for debuggers.
    pub debug: bool,
    /// Whether `CORE_MATERIALS` is defined.
    pub core: bool,
    /// Otherwise it takes less time, and nothing that is drawn with it does.
    pub optimized: bool,
}

/// Compiles one stage file. The message of an error begins with file and line.
pub fn compile(path: &Path, how: &Compilation<'_>) -> Result<Vec<u8>, String> {
    let kind = kind(path).ok_or_else(|| format!("{}: not a shader stage", path.display()))?;
    let spirv = compiler()?
        .compile_into_spirv(&source(path)?, kind, &path.display().to_string(), "main", Some(&options(how)?))
        .map_err(|e| e.to_string())?;
    Ok(spirv.as_binary_u8().to_vec())
}

/// A stage file with all that it includes, and without what conditions leave out.
// At run time, a shader is compiled because its text has changed.
#[cfg_attr(feature = "hot-reload", allow(dead_code))]
pub fn preprocess(path: &Path, how: &Compilation<'_>) -> Result<String, String> {
    let text = compiler()?
        .preprocess(&source(path)?, &path.display().to_string(), "main", Some(&options(how)?))
        .map_err(|e| e.to_string())?;
    Ok(text.as_text())
}

fn source(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

fn compiler() -> Result<shaderc::Compiler, String> {
    shaderc::Compiler::new().map_err(|e| format!("shaderc: {e}"))
}

fn options<'a>(how: &Compilation<'a>) -> Result<shaderc::CompileOptions<'a>, String> {
    let Compilation { includes, bindings, debug, core, optimized } = *how;
    let mut options = shaderc::CompileOptions::new().map_err(|e| format!("shaderc: {e}"))?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    if optimized {
        options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    }
    options.set_warnings_as_errors();
    if debug {
        options.set_generate_debug_info();
    }
    if core {
        options.add_macro_definition("CORE_MATERIALS", None);
    }
    options.set_include_callback(move |wanted, _, _, _| {
        if wanted == BINDINGS {
            return Ok(shaderc::ResolvedInclude { resolved_name: wanted.into(), content: bindings.into() });
        }
        let path = includes.join(wanted);
        let content = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
    });
    Ok(options)
}

fn kind(path: &Path) -> Option<shaderc::ShaderKind> {
    match path.extension()?.to_str()? {
        "vert" => Some(shaderc::ShaderKind::Vertex),
        "frag" => Some(shaderc::ShaderKind::Fragment),
        "comp" => Some(shaderc::ShaderKind::Compute),
        _ => None,
    }
}
