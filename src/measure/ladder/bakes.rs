//! Renderers for configurations, and what each one's baked light took: computed once for all that have the same.

use std::path::{Path, PathBuf};

use super::super::bench::{BakeCost, Bench};
use super::super::report::stem;
use super::reference::Shot;
use crate::Result;
use crate::asset::Storage;
use crate::context::Context;
use crate::precompute::Cache;
use crate::reference::brdf::Geometry;
use crate::reference::energy::Scattering;
use crate::render::{LightDetail, LightModel, RenderSettings};
use crate::scene::Scene;

/// What baked light depends on.
#[derive(Clone, Copy, PartialEq)]
struct Kind {
    is_baked: bool,
    /// Without shadow maps, which it does not read.
    detail: LightDetail,
    textures: Option<Storage>,
    brdf: Option<(Geometry, Scattering)>,
}

impl Kind {
    fn of(settings: &RenderSettings) -> Self {
        let is_baked = settings.light == LightModel::Baked;
        let detail = LightDetail { shadow_size: None, ..settings.light_detail };
        let brdf = Some((settings.geometry, settings.scattering));
        let (detail, textures, brdf) =
            if is_baked { (detail, settings.textures.storage, brdf) } else { (LightDetail::default(), None, None) };
        Self { is_baked, detail, textures, brdf }
    }
}

/// A cache for each kind of light, empty at first so that each is timed, in a folder that is removed at the end.
pub struct Bakes {
    folder: PathBuf,
    known: Vec<(Kind, Option<BakeCost>)>,
}

impl Bakes {
    /// None yet.
    pub fn new(scene: &Path) -> Self {
        let name = format!("pbr-vr-ladder-{}-{}", std::process::id(), stem(scene));
        Self { folder: std::env::temp_dir().join(name), known: Vec::new() }
    }

    /// A renderer with these settings, and what its baked light took when that was first computed.
    pub fn bench(
        &mut self,
        context: &Context,
        scene: &Scene,
        settings: RenderSettings,
        shot: Shot,
    ) -> Result<(Bench, Option<BakeCost>)> {
        let kind = Kind::of(&settings);
        let known = self.known.iter().position(|(known, _)| *known == kind);
        let index = known.unwrap_or(self.known.len());
        let cache = Some(Cache::in_folder(self.folder.join(index.to_string())));
        let bench = Bench::new(&Context { cache, ..context.clone() }, scene, settings, shot.size, vec![shot.eye])?;
        if known.is_none() {
            self.known.push((kind, bench.baked));
        }
        let cost = self.known[index].1;
        Ok((bench, cost))
    }
}

impl Drop for Bakes {
    fn drop(&mut self) {
        // A leftover in the folder for temporary files is harmless.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
