//! Shader stages by file name: those compiled by build.rs, or with `hot-reload` the current ones on disk.

use crate::{Error, Result};

// `COMPILED`, and `CORE`, which names by [`core_materials`] begin with.
include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

#[cfg(not(test))]
const FOR_TESTS: &[(&str, &[u8])] = &[];
#[cfg(test)]
include!(concat!(env!("OUT_DIR"), "/test_shaders.rs"));

/// The name of a shader without its code for clear coats, sheen and bodies that refract, which most scenes do without: two
/// thirds of a fragment shader.
pub fn core_materials(name: &str) -> String {
    format!("{CORE}{name}")
}

/// The SPIR-V words of `glsl/name`, which may be a name by [`core_materials`].
///
/// # Errors
/// With `hot-reload`, a shader on disk that does not compile; the message begins with file and line.
pub(super) fn load(name: &str) -> Result<Vec<u32>> {
    #[cfg(feature = "hot-reload")]
    if let Some(words) = on_disk::load(name)? {
        return Ok(words);
    }
    let compiled = |name| COMPILED.iter().chain(FOR_TESTS).find(|(n, _)| *n == name).map(|(_, bytes)| *bytes);
    let bytes = compiled(name).or_else(|| compiled(stage_file(name)));
    // Names are constants, and build.rs fails where a shader does not compile: so this is a defect that any test finds.
    let bytes = bytes.ok_or_else(|| Error::Usage(format!("there is no shader named {name}")))?;
    words(bytes).ok_or_else(|| Error::Usage(format!("shader {name} is not SPIR-V")))
}

/// The file that a shader is compiled from.
pub fn stage_file(name: &str) -> &str {
    name.strip_prefix(CORE).unwrap_or(name)
}

/// All compute shaders as they would be used now, name and SPIR-V words: part of the key of cached results.
///
/// # Errors
/// With `hot-reload`, a shader on disk that does not compile.
pub fn compute_shaders() -> Result<Vec<(&'static str, Vec<u32>)>> {
    let names = COMPILED.iter().map(|(name, _)| *name).filter(|name| name.ends_with(".comp"));
    names.map(|name| Ok((name, load(name)?))).collect()
}

fn words(bytes: &[u8]) -> Option<Vec<u32>> {
    ash::util::read_spv(&mut std::io::Cursor::new(bytes)).ok()
}

/// The folder of GLSL sources, and compiling them at run time.
#[cfg(feature = "hot-reload")]
pub mod on_disk {
    use std::path::PathBuf;

    use super::{CORE, stage_file, words};
    use crate::gpu::shader_compiler::{Compilation, compile};
    use crate::{Error, Result};

    /// As build.rs generated them: the tables are compiled into the program.
    const BINDINGS: &str = include_str!(concat!(env!("OUT_DIR"), "/bindings.glsl"));

    /// The folder that is watched.
    pub fn folder() -> PathBuf {
        PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/glsl"))
    }

    pub(super) fn load(name: &str) -> Result<Option<Vec<u32>>> {
        let folder = folder();
        let (file, core) = (stage_file(name), name.starts_with(CORE));
        let path = folder.join(file);
        if !path.is_file() {
            return Ok(None);
        }
        let how =
            Compilation { includes: &folder, bindings: BINDINGS, debug: cfg!(debug_assertions), core, optimized: true };
        let spirv = compile(&path, &how).map_err(|problem| Error::Broken {
            path,
            what: "shader",
            problem,
            remedy: "fix it; the last good one stays in use",
        })?;
        Ok(words(&spirv))
    }
}
