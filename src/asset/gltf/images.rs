//! The pictures of a glTF file: files beside it, or bytes inside it.

use std::path::PathBuf;
use std::sync::Arc;

use super::source::{Source, label};
use super::uri;
use crate::Result;
use crate::asset::image_source::ImageSource;
use crate::asset::image_source::MAX_FILE_BYTES;
use crate::error::{MAX_QUOTED, shortened};

/// The pictures that materials have asked for; `None`: it cannot be used, which is warned of.
#[derive(Default)]
pub struct Images(Vec<Option<Option<ImageSource>>>);

impl Images {
    /// A picture by its index.
    pub fn get(&mut self, source: &Source<'_>, index: usize) -> Option<ImageSource> {
        if self.0.is_empty() {
            self.0.resize(source.document.images.len(), None);
        }
        let Some(known) = self.0.get_mut(index) else {
            source.warn_once(format!("image {index}"), &format!("there is no image {index}; drawn without"));
            return None;
        };
        known.get_or_insert_with(|| picture_or_warning(source, index)).clone()
    }
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
