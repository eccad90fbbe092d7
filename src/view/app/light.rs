//! What the app does with new light and pipelines for it: kept until both are there, then shown together.

use super::{App, NewLight};
use crate::Result;
use crate::render::{Lightmapped, PassPipelines};
use crate::view::loader::file_name;
use crate::view::update::Update;

impl App {
    /// Puts the shown scene under a panorama's light, at once where its pipelines will do.
    pub(super) fn light(&mut self, new: NewLight) -> Result<Option<Update>> {
        let Some(scene) = &self.scene else { return Ok(None) };
        if scene.loaded.renderer.needs_pipelines_under(&new.lighting, &new.settings) {
            self.new_light = Some(new);
            self.follow_settings()?;
            return Ok(None);
        }
        self.new_light = None;
        self.shine(new, None).map(Some)
    }

    /// A lightmap was prepared; it is shown once its pipelines are there, if its scene still is.
    pub(super) fn map_light(
        &mut self,
        number: u64,
        lightmap: Result<Option<Box<Lightmapped>>>,
    ) -> Result<Option<Update>> {
        let Some(scene) = self.scene.as_mut().filter(|scene| scene.loaded.number == number) else { return Ok(None) };
        match lightmap {
            Ok(lightmap) => {
                scene.loaded.lightmap_follows = lightmap.is_some();
                self.new_lightmap = lightmap.map(|lightmap| *lightmap);
                self.follow_settings()?;
                Ok(None)
            }
            Err(error) if error.is_device_lost() => Err(error),
            Err(error) => {
                scene.loaded.lightmap_follows = false;
                Ok(Some(Update::Failed(error)))
            }
        }
    }

    /// Draws with the pipelines that were asked for last.
    pub(super) fn draw_with(&mut self, pipelines: PassPipelines) -> Result<Option<Update>> {
        if let Some(new) = self.new_light.take() {
            return self.shine(new, Some(pipelines)).map(Some);
        }
        let Some(scene) = &mut self.scene else { return Ok(None) };
        match self.new_lightmap.take() {
            Some(lightmap) => {
                scene.loaded.renderer.set_lightmapped(lightmap, pipelines)?;
                scene.loaded.lightmap_follows = false;
                self.follow_settings()?;
            }
            None => {
                if let Err(error) = scene.loaded.renderer.set_pipelines(pipelines) {
                    self.refuse(error)?;
                    return Ok(self.refusal.take().map(Update::Failed));
                }
            }
        }
        Ok(Some(Update::Settings))
    }

    /// Shows other light, unrotated if it is another panorama's.
    fn shine(&mut self, new: NewLight, pipelines: Option<PassPipelines>) -> Result<Update> {
        let NewLight { path, lighting, settings } = new;
        let name = file_name(&path);
        if let Some(scene) = &mut self.scene {
            scene.loaded.renderer.set_lighting(lighting, &settings, pipelines)?;
            if scene.panorama.as_ref() != Some(&path) {
                (scene.environment_rotation, scene.first_rotation) = (0.0, 0.0);
                scene.panorama = Some(path);
            }
        }
        self.follow_settings()?;
        Ok(Update::Light(name))
    }
}
