//! The pictures of a glTF file: files beside it, or bytes inside it.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec4;

use super::glossy::Glossy;
use super::source::{Source, label};
use super::uri;
use crate::asset::image_source::{ImageSource, MAX_FILE_BYTES};
use crate::asset::material::MapDesc;
use crate::asset::texture::{Channel, Encoding, Texture};
use crate::error::{MAX_QUOTED, shortened};
use crate::{Error, Result};

/// The pictures that materials have asked for.
#[derive(Default)]
pub struct Images {
    /// By index. `None` within: it cannot be used, which is warned of.
    pictures: Vec<Option<Option<ImageSource>>>,
    /// Means of their texels, linear RGB and alpha.
    means: HashMap<(PathBuf, Encoding), Option<Vec4>>,
    /// Base color, and roughness with metalness, by what they are made of.
    converted: HashMap<PathBuf, Option<[ImageSource; 2]>>,
}

impl Images {
    /// A picture by its index.
    pub fn get(&mut self, source: &Source<'_>, index: usize) -> Option<ImageSource> {
        if self.pictures.is_empty() {
            self.pictures.resize(source.document.images.len(), None);
        }
        let Some(known) = self.pictures.get_mut(index) else {
            source.warn_once(format!("image {index}"), &format!("there is no image {index}; drawn without"));
            return None;
        };
        known.get_or_insert_with(|| picture_or_warning(source, index)).clone()
    }

    /// Mean of a map's texels, linear RGB and alpha; `None`: it cannot be read, which is warned of.
    pub fn mean(&mut self, source: &Source<'_>, map: &MapDesc, encoding: Encoding) -> Option<Vec4> {
        let mean = || {
            let loaded = Texture::load(&map.image, encoding).map(|texture| texture.mean());
            loaded.map_err(|error| warn_unusable(source, map, &error)).ok()
        };
        *self.means.entry((map.image.place().into(), encoding)).or_insert_with(mean)
    }

    /// One channel of a map; `None`: it cannot be read, which is warned of.
    pub fn channel(&self, source: &Source<'_>, map: &MapDesc) -> Option<Channel> {
        Channel::load(&map.image, map.pick).map_err(|error| warn_unusable(source, map, &error)).ok()
    }

    /// Base color, and roughness with metalness, of a material of diffuse and specular textures; `None`: one of them cannot be
    /// read, which is warned of. `of`: the material in words.
    ///
    /// # Errors
    /// All pictures of the file together are too large.
    pub fn converted(
        &mut self,
        source: &Source<'_>,
        of: &str,
        glossy: &Glossy,
        [diffuse, specular]: [Option<&ImageSource>; 2],
    ) -> Result<Option<[ImageSource; 2]>> {
        let [a, b] = [diffuse, specular].map(|image| image.map_or("".into(), |image| image.place().to_string_lossy()));
        let factors = (glossy.diffuse_factor, glossy.specular_factor, glossy.glossiness_factor);
        let place = PathBuf::from(format!("{a}+{b} {factors:?}"));
        if let Some(known) = self.converted.get(&place) {
            return Ok(known.clone());
        }
        let made = glossy.pictures(&place, diffuse, specular);
        if let Err(error) = &made {
            source.warn_once(place.to_string_lossy(), &format!("{of}: {error}; drawn without"));
        }
        let made = made.ok();
        for picture in made.iter().flatten() {
            source.count_bytes(picture.read()?.len())?;
        }
        self.converted.insert(place, made.clone());
        Ok(made)
    }
}

fn warn_unusable(source: &Source<'_>, map: &MapDesc, error: &Error) {
    source.warn_once(map.image.place().to_string_lossy(), &format!("{}: {error}; drawn without", map.origin));
}

fn picture_or_warning(source: &Source<'_>, index: usize) -> Option<ImageSource> {
    let name = source.document.images[index].name.as_deref();
    match picture(source, index) {
        Ok(Ok(picture)) => return Some(picture),
        Ok(Err(problem)) => {
            source.warn_once(
                format!("image {index}"),
                &format!("{}: {problem}; drawn without", label("image", index, name)),
            );
        }
        // It says of which file it is.
        Err(error) => source
            .warn_once(format!("image {index}"), &format!("{}: {error}; drawn without", label("image", index, name))),
    }
    None
}

/// A picture, or why there is none.
fn picture(source: &Source<'_>, index: usize) -> Result<std::result::Result<ImageSource, String>> {
    let image = &source.document.images[index];
    if let Some(view) = image.buffer_view {
        let (bytes, _) = source.view(view)?;
        // A part of a picture is none.
        let missing = bytes.len() < source.document.buffer_views[view].byte_length;
        if missing || bytes.is_empty() {
            return Ok(Err("its bytes are not in the file".into()));
        }
        source.count_bytes(bytes.len())?;
        return Ok(Ok(ImageSource::embedded(place(source, index), bytes.into())));
    }
    let Some(uri) = &image.uri else { return Ok(Err("it has neither bytes nor a file".into())) };
    if let Some(bytes) = uri::data(uri, MAX_FILE_BYTES) {
        let bytes = match bytes {
            Ok(bytes) => Arc::from(bytes),
            Err(problem) => return Ok(Err(problem)),
        };
        return Ok(Ok(ImageSource::embedded(place(source, index), bytes)));
    }
    if uri::foreign_scheme(uri).is_some() {
        return Ok(Err(format!("{} is not a file; put it beside the model as one", shortened(uri, MAX_QUOTED))));
    }
    let found = source.find(uri).map(ImageSource::file);
    Ok(found.ok_or_else(|| format!("{}: file not found", shortened(uri, MAX_QUOTED))))
}

/// What no other picture is called.
fn place(source: &Source<'_>, index: usize) -> PathBuf {
    let mut place = source.path.as_os_str().to_owned();
    place.push(format!("#image {index}"));
    if let Some(name) = source.document.images[index].name.as_deref().filter(|name| !name.is_empty()) {
        place.push(format!(" {}", shortened(name, MAX_QUOTED).replace(['/', '\\'], "_")));
    }
    place.into()
}
