//! What this machine has, what is missing, and what to do: `pbr-vr doctor`.

use std::path::PathBuf;

use super::headset;
use crate::Result;
use crate::asset::shipped;
use crate::gpu::{GpuInfo, survey, validation_available};

/// Prints the findings.
///
/// # Errors
/// No GPU will do: then nothing can be drawn on this machine.
pub fn run() -> Result<()> {
    println!("pbr-vr {}", env!("CARGO_PKG_VERSION"));
    let gpus = survey();
    match &gpus {
        Ok(gpus) => gpus.iter().enumerate().for_each(|(i, gpu)| print_gpu(i, gpu)),
        Err(error) => println!("GPU         missing: {error}"),
    }
    line(
        "validation",
        validation_available(),
        "layer installed",
        "no layer; for --validate install vulkan-validationlayers or the Vulkan SDK",
    );
    match super::no_display() {
        None => println!("display     there"),
        Some(reason) => println!("display     missing: {reason}; pictures can be written all the same"),
    }
    match headset::registry() {
        Some(path) => println!("OpenVR      runtime registered in {}", path.display()),
        None => println!("OpenVR      no runtime; install Steam and SteamVR to use a headset"),
    }
    match headset::probe() {
        Ok(Some(name)) => println!("headset     {name}"),
        Ok(None) => println!("headset     there; its runtime is not running and will be started"),
        Err(reason) => println!("headset     missing: {reason}"),
    }
    match shipped::folder() {
        Ok(folder) => println!("assets      {}", folder.display()),
        Err(error) => println!("assets      missing: {error}"),
    }
    match std::env::var_os("PBR_VR_SCENES") {
        Some(folder) => println!("scenes      PBR_VR_SCENES = {}", PathBuf::from(folder).display()),
        None => println!("scenes      PBR_VR_SCENES is not set; `tools/fetch-assets` gets the larger scenes"),
    }
    gpus.map(|_| ())
}

fn print_gpu(index: usize, gpu: &GpuInfo) {
    let verdict = match &gpu.unfit {
        Some(reason) => format!("will not do: {reason}"),
        None if index == 0 => "used unless --gpu names another".into(),
        None => "will do".into(),
    };
    println!("GPU         {} ({}, Vulkan {}, {}): {verdict}", gpu.name, gpu.kind, gpu.vulkan, gpu.driver);
    println!("            {:.1} GiB of its own", gpu.memory as f64 / f64::from(1 << 30));
    for (name, there) in &gpu.options {
        println!("            {name}: {}", if *there { "yes" } else { "no" });
    }
}

fn line(what: &str, there: bool, yes: &str, no: &str) {
    println!("{what:<11} {}", if there { yes } else { no });
}
