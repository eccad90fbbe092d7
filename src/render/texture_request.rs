//! Textures of a scene that is drawn, loaded again with other levels.

use std::sync::Arc;

use super::layouts::Layouts;
use super::scene_resources::SceneTextures;
use super::settings::RenderSettings;
use crate::Result;
use crate::asset::TextureOptions;
use crate::context::Context;
use crate::scene::Scene;

/// What they are loaded with.
#[derive(Clone)]
pub struct TextureRequest {
    pub(super) layouts: Arc<Layouts>,
    pub(super) settings: RenderSettings,
}

impl TextureRequest {
    /// How the scene's file is to be loaded.
    pub fn options(&self, context: &Context) -> TextureOptions {
        self.settings.textures.options(context)
    }

    /// Uploads what fits into `limit` bytes.
    ///
    /// # Errors
    /// No memory; a failed Vulkan call.
    pub fn upload(&self, context: &Context, scene: &Scene, limit: u64) -> Result<SceneTextures> {
        SceneTextures::within(context, &self.layouts, scene, &self.settings, limit)
    }
}
