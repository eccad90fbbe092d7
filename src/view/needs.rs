//! `needs`: the features that a scene's shaders model, those left out, and why.

use std::path::PathBuf;

use clap::Args;

use super::loader::load_scene;
use crate::args::write_json;
use crate::asset::{Outputs, Report, Storage, TextureOptions};
use crate::scene::load::files as scene_files;
use crate::scene::needs::findings::Findings;
use crate::{Result, say};

/// A scene and the file for the findings.
#[derive(Args, Clone, Debug)]
pub struct NeedsRequest {
    /// A scene description (.toml) or a model (.gltf, .glb, .obj).
    pub scene: PathBuf,
    /// Write the decisions, material by material.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Prints the features of a scene that its shaders model.
///
/// # Errors
/// Whatever stops loading; an output that cannot be written.
pub fn needs(request: &NeedsRequest, report: &Report) -> Result<()> {
    let NeedsRequest { scene, json } = request;
    Outputs::of(scene_files(scene)).file_if(json.as_deref())?;
    // Nothing is drawn, so textures need not be compressed.
    let textures = TextureOptions { storage: Storage::Raw, ..TextureOptions::default() };
    let findings = Findings::of(&load_scene(scene, &textures, report)?);
    let triangles = if findings.triangles == 1 { "triangle" } else { "triangles" };
    say!("{}: {} {triangles}, {}", scene.display(), findings.triangles, findings.lines().join("\n  "));
    write_json(json.as_deref(), &findings)
}
