//! What the app does when the GPU's memory becomes too full for the shown scene's textures, or has room for better ones: they are
//! loaded again, and shown once they are there.

use super::App;
use crate::Result;
use crate::render::{Replaced, SceneTextures};
use crate::view::loader::LoadRequest;
use crate::view::memory_watch::{Advice, TextureUse};
use crate::view::update::Update;

impl App {
    /// Has the memory of the shown textures looked after.
    pub(super) fn watch_memory(&mut self) {
        let Some(scene) = &self.scene else { return };
        let [bytes, needed] = scene.loaded.renderer.texture_bytes();
        self.loader.start(LoadRequest::Watch(TextureUse { scene: scene.loaded.number, bytes, needed }));
    }

    /// Asks for other textures; another scene that is being loaded takes what memory there is by itself.
    pub(super) fn follow_memory(&mut self, advice: Advice) {
        let Some(scene) = self.scene.as_ref().filter(|scene| scene.loaded.number == advice.scene) else { return };
        let (path, staging) = (scene.loaded.path.clone(), scene.loaded.staging.clone());
        let request = scene.loaded.renderer.texture_request();
        self.loader.start(LoadRequest::Textures { advice, path, staging, request });
    }

    /// Shows other textures, if their scene still is shown.
    pub(super) fn texture(&mut self, advice: Advice, textures: Result<Box<SceneTextures>>) -> Result<Option<Update>> {
        let Some(scene) = self.scene.as_mut().filter(|scene| scene.loaded.number == advice.scene) else {
            return Ok(None);
        };
        let textures = match textures {
            Ok(textures) => *textures,
            Err(error) if error.is_device_lost() => return Err(error),
            Err(error) => return Ok(Some(Update::Failed(error))),
        };
        let [before, _] = scene.loaded.renderer.texture_bytes();
        let Replaced { are_shown, left } = scene.loaded.renderer.set_textures(textures);
        let [after, _] = scene.loaded.renderer.texture_bytes();
        self.loader.start(LoadRequest::Discard(Box::new(left)));
        if !are_shown {
            return Ok(None);
        }
        self.watch_memory();
        let told = told(&advice, [before, after]);
        if after < before {
            self.report().warn(told);
            return Ok(Some(Update::Settings));
        }
        Ok(Some(Update::Textures(told)))
    }
}

/// A message about textures of another size, bytes before and after.
fn told(advice: &Advice, [before, after]: [u64; 2]) -> String {
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let (budget, used) = (mib(advice.memory.budget), mib(advice.memory.used));
    let change = format!("textures of {:.1} MiB instead of {:.1}", mib(after), mib(before));
    if after < before {
        format!("GPU memory: other programs leave {budget:.0} MiB, of which {used:.0} were in use: {change}")
    } else {
        format!("GPU memory: there are {budget:.0} MiB again, of which {used:.0} were in use: {change}")
    }
}
