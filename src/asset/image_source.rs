//! Where the bytes of a picture are: in a file of their own, or inside a model's.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::file;
use crate::Result;

/// Largest picture file, in bytes.
pub const MAX_FILE_BYTES: u64 = 1 << 30;

/// A PNG, JPEG, WebP, TGA or KTX2 picture, not decoded yet.
#[derive(Clone, Debug)]
pub struct ImageSource {
    /// The picture's file; of one inside a model, the model's file and a name: no other picture has it.
    place: PathBuf,
    bytes: Option<Arc<[u8]>>,
}

impl ImageSource {
    /// A picture in a file.
    pub fn file(path: PathBuf) -> Self {
        Self { place: path, bytes: None }
    }

    /// A picture inside a model's file; no other one may have this place.
    pub fn embedded(place: PathBuf, bytes: Arc<[u8]>) -> Self {
        Self { place, bytes: Some(bytes) }
    }

    /// For messages.
    pub fn place(&self) -> &Path {
        &self.place
    }

    /// Its bytes, not decoded.
    ///
    /// # Errors
    /// The file cannot be read, or is larger than 1 GiB.
    pub fn read(&self) -> Result<Cow<'_, [u8]>> {
        match &self.bytes {
            Some(bytes) => Ok(Cow::Borrowed(bytes)),
            None => file::read(&self.place, "texture", MAX_FILE_BYTES).map(Cow::Owned),
        }
    }
}

// The place alone says which one it is: comparing bytes would take long.
impl PartialEq for ImageSource {
    fn eq(&self, other: &Self) -> bool {
        self.place == other.place
    }
}

impl Eq for ImageSource {}

impl Hash for ImageSource {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.place.hash(state);
    }
}

impl PartialOrd for ImageSource {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for ImageSource {
    fn cmp(&self, other: &Self) -> Ordering {
        self.place.cmp(&other.place)
    }
}
