//! A glTF file being read: its JSON, its buffers (read when they are needed), and its warnings and errors.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::component::Unpacked;
use super::container::{self, MAX_FILE_BYTES};
use super::document::{Document, Extensions, View};
use super::{meshopt, uri};
use crate::asset::{Report, file};
use crate::error::{MAX_QUOTED, shortened};
use crate::{Error, Result};

/// The most bytes of all buffers, decompressed views and pictures inside of files together.
const MAX_TOTAL_BYTES: u64 = 4 << 30;
const EXPORT_AGAIN: &str = "export it again";

/// A file being read.
pub struct Source<'a> {
    pub path: &'a Path,
    /// The file's name, with which warnings begin.
    pub short: String,
    pub document: Document,
    report: &'a Report,
    warned: RefCell<HashSet<String>>,
    checked: RefCell<HashSet<String>>,
    binary: Option<Vec<u8>>,
    buffers: Vec<OnceCell<Vec<u8>>>,
    /// Views that were compressed.
    views: Vec<OnceCell<Vec<u8>>>,
    /// Of accessors whose primitives were compressed.
    unpacked: Vec<OnceCell<Unpacked>>,
    bytes: Cell<u64>,
}

/// A thing of the file in words: `mesh 2 (Body)`.
pub fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name.filter(|name| !name.is_empty()) {
        Some(name) => format!("{kind} {index} ({})", shortened(name, MAX_QUOTED)),
        None => format!("{kind} {index}"),
    }
}

impl<'a> Source<'a> {
    /// Reads the file itself.
    ///
    /// # Errors
    /// Those of [`container::read`].
    pub fn open(path: &'a Path, report: &'a Report) -> Result<Self> {
        let container::Container { document, binary } = container::read(path)?;
        Ok(Self {
            path,
            short: file::short_name(path),
            buffers: document.buffers.iter().map(|_| OnceCell::new()).collect(),
            views: document.buffer_views.iter().map(|_| OnceCell::new()).collect(),
            unpacked: document.accessors.iter().map(|_| OnceCell::new()).collect(),
            document,
            report,
            warned: RefCell::default(),
            checked: RefCell::default(),
            binary,
            bytes: Cell::new(0),
        })
    }

    /// The error of a file that is not as it should be.
    pub fn broken(&self, problem: impl Into<String>) -> Error {
        self.broken_with(problem, EXPORT_AGAIN)
    }

    /// The same with a remedy of its own.
    pub fn broken_with(&self, problem: impl Into<String>, remedy: &'static str) -> Error {
        container::broken(self.path, problem.into(), remedy)
    }

    /// The error of a file that would take too much memory.
    pub fn too_large(&self, size: String, limit: String) -> Error {
        Error::TooLarge { path: self.path.into(), what: "model", size, limit }
    }

    /// Adds a warning, which is about this file; of those with the same key only the first.
    pub fn warn_once(&self, key: impl Into<String>, message: &str) {
        if self.warned.borrow_mut().insert(key.into()) {
            self.report.warn(format!("{}: {message}", self.short));
        }
    }

    /// Whether something is checked for the first time.
    pub fn first_time(&self, of: &str) -> bool {
        self.checked.borrow_mut().insert(of.to_owned())
    }

    /// An extension of something, if it is there.
    ///
    /// # Errors
    /// It is not as it should be.
    pub fn extension<T: for<'de> Deserialize<'de>>(
        &self,
        of: &str,
        extensions: &Extensions,
        name: &str,
    ) -> Result<Option<T>> {
        let Some(value) = extensions.get(name) else { return Ok(None) };
        let explain =
            |e: serde_json::Error| self.broken(format!("{of}: {name}: {}", shortened(&e.to_string(), MAX_QUOTED)));
        T::deserialize(value).map(Some).map_err(explain)
    }

    /// Counts bytes that are kept in memory.
    ///
    /// # Errors
    /// They are too many.
    pub fn count_bytes(&self, more: usize) -> Result<()> {
        let total = self.bytes.get().saturating_add(more as u64);
        if total > MAX_TOTAL_BYTES {
            return Err(self.too_large(format!("over {MAX_TOTAL_BYTES} bytes"), format!("{MAX_TOTAL_BYTES} bytes")));
        }
        self.bytes.set(total);
        Ok(())
    }

    /// The file that a URI of this one means; of another name, with a warning. `None`: there is no such file.
    pub fn find(&self, uri: &str) -> Option<PathBuf> {
        let found = uri::find(self.path.parent().unwrap_or(Path::new("")), uri)?;
        if let Some(real) = found.real_name {
            self.warn_once(uri, &format!("{}: found as {real}", shortened(uri, MAX_QUOTED)));
        }
        Some(found.path)
    }

    /// What an accessor holds that was compressed with its primitive; `None`: it was not, or is not decompressed yet.
    pub fn unpacked(&self, accessor: usize) -> Option<&Unpacked> {
        self.unpacked.get(accessor)?.get()
    }

    /// Keeps what an accessor holds; of two the first.
    ///
    /// # Errors
    /// There is no such accessor, or all together take too much memory.
    pub fn keep_unpacked(&self, accessor: usize, unpacked: Unpacked) -> Result<()> {
        let Some(kept) = self.unpacked.get(accessor) else {
            return Err(self.broken(format!("there is no accessor {accessor}")));
        };
        self.count_bytes(unpacked.bytes.len())?;
        kept.get_or_init(|| unpacked);
        Ok(())
    }

    /// What is there of a view, and its stride.
    ///
    /// # Errors
    /// There is no such view, or its buffer cannot be read.
    pub fn view(&self, index: usize) -> Result<(&[u8], Option<usize>)> {
        let Some(view) = self.document.buffer_views.get(index) else {
            return Err(self.broken(format!("there is no buffer view {index}")));
        };
        let of = format!("buffer view {index}");
        let extension = self.extension(&of, &view.extensions, meshopt::NAME)?;
        let Some(packed): Option<meshopt::Packed> = extension else {
            return Ok((self.slice(&of, view.buffer, view.byte_offset, view.byte_length)?, view.byte_stride));
        };
        let bytes = self.unpacked_view(index, view, &packed)?;
        Ok((bytes, Some(packed.byte_stride)))
    }

    fn unpacked_view(&self, index: usize, view: &View, packed: &meshopt::Packed) -> Result<&[u8]> {
        if let Some(known) = self.views[index].get() {
            return Ok(known);
        }
        let of = format!("buffer view {index}");
        let bytes = self.slice(&of, packed.buffer, packed.byte_offset, packed.byte_length)?;
        let fits = |size: &usize| *size as u64 <= MAX_FILE_BYTES && *size / meshopt::MOST_TIMES <= bytes.len();
        let size = packed.unpacked_bytes().filter(fits);
        let Some(size) = size.filter(|size| *size >= view.byte_length) else {
            return Err(self.broken(format!("{of}: its size is not that of its compressed elements")));
        };
        self.count_bytes(size)?;
        let unpacked = meshopt::unpack(bytes, packed).map_err(|problem| self.broken(format!("{of}: {problem}")))?;
        Ok(self.views[index].get_or_init(|| unpacked))
    }

    /// What is there of a part of a buffer.
    fn slice(&self, of: &str, buffer: usize, offset: usize, length: usize) -> Result<&[u8]> {
        let Some(end) = offset.checked_add(length) else {
            return Err(self.broken(format!("{of} goes beyond its buffer")));
        };
        let bytes = self.buffer(buffer)?;
        // An accessor that needs more complains.
        Ok(&bytes[offset.min(bytes.len())..end.min(bytes.len())])
    }

    fn buffer(&self, index: usize) -> Result<&[u8]> {
        let Some(buffer) = self.document.buffers.get(index) else {
            return Err(self.broken(format!("there is no buffer {index}")));
        };
        if let Some(known) = self.buffers[index].get() {
            return Ok(known);
        }
        let Some(uri) = &buffer.uri else {
            let binary = self.binary.as_deref().filter(|_| index == 0);
            return binary.ok_or_else(|| self.broken(format!("buffer {index} has no data")));
        };
        let bytes = match uri::data(uri, MAX_FILE_BYTES) {
            Some(bytes) => bytes.map_err(|problem| self.broken(format!("buffer {index}: {problem}")))?,
            None => file::read(&self.buffer_file(index, uri)?, "buffer", MAX_FILE_BYTES)?,
        };
        self.count_bytes(bytes.len())?;
        Ok(self.buffers[index].get_or_init(|| bytes))
    }

    fn buffer_file(&self, index: usize, uri: &str) -> Result<PathBuf> {
        let name = shortened(uri, MAX_QUOTED);
        let remedy = "put that file beside the model";
        if uri::foreign_scheme(uri).is_some() {
            return Err(
                self.broken_with(format!("buffer {index} is {name}, not a file"), "put it beside the model as a file")
            );
        }
        self.find(uri).ok_or_else(|| self.broken_with(format!("buffer {index}: there is no file {name}"), remedy))
    }
}
