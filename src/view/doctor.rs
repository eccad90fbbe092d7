//! `doctor`: what this machine has, what is missing, and what to do.

use std::path::PathBuf;

use super::headset;
use crate::asset::shipped;
use crate::gpu::{GpuInfo, survey, validation_available};
use crate::{Result, say};

/// Prints the findings.
///
/// # Errors
/// No GPU of this machine is usable.
pub fn run() -> Result<()> {
    say!("pbr-vr {}", env!("CARGO_PKG_VERSION"));
    let gpus = survey();
    match &gpus {
        Ok(gpus) => gpus.iter().enumerate().for_each(|(i, gpu)| print_gpu(i, gpu)),
        Err(error) => say!("GPU         missing: {error}"),
    }
    line(
        "validation",
        validation_available(),
        "layer installed",
        "no layer; for --validate install vulkan-validationlayers or the Vulkan SDK",
    );
    match super::show::no_display() {
        None => say!("display     available"),
        Some(reason) => say!("display     missing: {reason}; pictures can be written all the same"),
    }
    match headset::registry() {
        Some(path) => say!("OpenVR      runtime registered in {}", path.display()),
        None => say!("OpenVR      no runtime; install Steam and SteamVR to use a headset"),
    }
    match headset::probe() {
        Ok(Some(name)) => say!("headset     {name}"),
        Ok(None) => say!("headset     found; its runtime is not running and will be started"),
        Err(reason) => say!("headset     missing: {reason}"),
    }
    match shipped::folder() {
        Ok(folder) => say!("assets      {}", folder.display()),
        Err(error) => say!("assets      missing: {error}"),
    }
    match std::env::var_os("PBR_VR_SCENES") {
        Some(folder) => say!("scenes      PBR_VR_SCENES = {}", PathBuf::from(folder).display()),
        None => say!("scenes      PBR_VR_SCENES is not set; `tools/fetch-assets` gets the larger scenes"),
    }
    gpus.map(|_| ())
}

fn print_gpu(index: usize, gpu: &GpuInfo) {
    let verdict = match &gpu.unfit {
        Some(reason) => format!("not usable: {reason}"),
        None if index == 0 => "used unless --gpu names another".into(),
        None => "usable".into(),
    };
    say!("GPU         {} ({}, Vulkan {}, {}): {verdict}", gpu.name, gpu.kind, gpu.vulkan, gpu.driver);
    say!("            {:.1} GiB of its own", gpu.memory as f64 / f64::from(1 << 30));
    for (name, there) in &gpu.options {
        say!("            {name}: {}", if *there { "yes" } else { "no" });
    }
}

fn line(what: &str, there: bool, yes: &str, no: &str) {
    say!("{what:<11} {}", if there { yes } else { no });
}
