//! Elements of accessors: numbers of any type in buffers, found one by one, so that no file makes large copies.

use super::component::{Component, Unpacked, kind};
use super::document::{self, SparsePart};
use super::source::{Source, label};
use crate::Result;

/// The most elements of an accessor without bytes of its own, which costs a file nothing.
const MAX_ZEROS: usize = 1 << 27;

/// The elements of an accessor, each of N numbers.
#[derive(Clone, Debug)]
pub struct Elements<'a, const N: usize> {
    pub count: usize,
    /// Without it, all are zeros.
    base: Option<(&'a [u8], usize)>,
    component: Component,
    normalized: bool,
    sparse: Option<Replaced<'a>>,
}

/// Elements that replace others.
#[derive(Clone, Debug)]
struct Replaced<'a> {
    count: usize,
    indices: (&'a [u8], Component),
    values: &'a [u8],
}

impl Replaced<'_> {
    fn index(&self, number: usize) -> usize {
        let (bytes, component) = self.indices;
        component.index(bytes, number * component.bytes()) as usize
    }

    /// Which of them replaces an element; they are in the order of the elements.
    fn find(&self, element: usize) -> Option<usize> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = (low + high) / 2;
            if self.index(middle) < element { low = middle + 1 } else { high = middle }
        }
        (low < self.count && self.index(low) == element).then_some(low)
    }
}

impl<'a, const N: usize> Elements<'a, N> {
    /// An accessor's elements, all of which are there.
    ///
    /// # Errors
    /// There is no such accessor, it is not of vectors of N, or goes beyond its buffer.
    pub fn of(source: &'a Source<'_>, index: usize) -> Result<Self> {
        let Some(accessor) = source.document.accessors.get(index) else {
            return Err(source.broken(format!("there is no accessor {index}")));
        };
        let of = label("accessor", index, accessor.name.as_deref());
        let Some(component) = Component::of(accessor.component_type) else {
            return Err(source.broken(format!("{of} has numbers of the unknown type {}", accessor.component_type)));
        };
        let kind = kind(N);
        if accessor.kind != kind {
            return Err(source.broken(format!("{of} is not of the type {kind}, which is needed")));
        }
        let normalized = accessor.normalized;
        if let Some(Unpacked { component, bytes }) = source.unpacked(index) {
            let element = N * component.bytes();
            let base = Some((bytes.as_slice(), element));
            return Ok(Self { count: bytes.len() / element, base, component: *component, normalized, sparse: None });
        }
        let count = accessor.count;
        let element = N * component.bytes();
        let base = match accessor.buffer_view {
            Some(view) => Some(base(source, &of, view, (accessor.byte_offset, count, element))?),
            None if count > MAX_ZEROS => {
                return Err(source.too_large(format!("{of} of {count} zeros"), format!("{MAX_ZEROS}")));
            }
            None => None,
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => Some(replaced(source, &of, sparse, (count, element))?),
            None => None,
        };
        Ok(Self { count, base, component, normalized, sparse })
    }

    /// With integers that are normalized even if the file does not say so.
    pub fn normalized(self) -> Self {
        Self { normalized: true, ..self }
    }

    /// Where the element at an index is.
    fn place(&self, index: usize) -> Option<(&'a [u8], usize)> {
        if let Some((sparse, number)) = self.sparse.as_ref().and_then(|sparse| Some((sparse, sparse.find(index)?))) {
            return Some((sparse.values, number * N * self.component.bytes()));
        }
        self.base.map(|(bytes, stride)| (bytes, index * stride))
    }

    /// An element; `index` < `count`.
    pub fn get(&self, index: usize) -> [f32; N] {
        let Some((bytes, at)) = self.place(index) else { return [0.0; N] };
        std::array::from_fn(|i| self.component.number(bytes, at + i * self.component.bytes(), self.normalized))
    }

    /// An element of unsigned integers.
    pub fn indices(&self, index: usize) -> [u32; N] {
        let Some((bytes, at)) = self.place(index) else { return [0; N] };
        std::array::from_fn(|i| self.component.index(bytes, at + i * self.component.bytes()))
    }

    /// Whether it is of unsigned integers.
    pub fn has_indices(&self) -> bool {
        self.component.is_index()
    }

    /// The index that is none.
    pub fn restart(&self) -> u32 {
        self.component.restart()
    }
}

/// The bytes of an accessor and its stride. Of it: the offset, the number of elements and the bytes of each.
fn base<'a>(
    source: &'a Source<'_>,
    of: &str,
    view: usize,
    (offset, count, element): (usize, usize, usize),
) -> Result<(&'a [u8], usize)> {
    let (bytes, stride) = source.view(view)?;
    let stride = stride.unwrap_or(element);
    // One element needs no stride.
    if stride < element && count > 1 {
        return Err(source.broken(format!("{of}: its elements overlap: there are {stride} bytes for {element}")));
    }
    Ok((within(source, of, bytes, (offset, count, stride, element))?, stride))
}

/// `bytes` from an offset on, if there are enough of them.
fn within<'a>(
    source: &Source<'_>,
    of: &str,
    bytes: &'a [u8],
    (offset, count, stride, element): (usize, usize, usize, usize),
) -> Result<&'a [u8]> {
    let length = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(element));
    let end = length.and_then(|length| length.checked_add(offset));
    match end.and_then(|end| bytes.get(offset..end)) {
        Some(bytes) => Ok(bytes),
        None if count == 0 => Ok(&[]),
        None => Err(source.broken(format!("{of} needs more bytes than its buffer has for it"))),
    }
}

/// What replaces elements of an accessor, of which there are `count` of `element` bytes.
fn replaced<'a>(
    source: &'a Source<'_>,
    of: &str,
    sparse: &document::Sparse,
    (count, element): (usize, usize),
) -> Result<Replaced<'a>> {
    let part = |part: &SparsePart, element| {
        let (bytes, _) = source.view(part.buffer_view)?;
        within(source, of, bytes, (part.byte_offset, sparse.count, element, element))
    };
    let component = sparse.indices.component_type.and_then(Component::of).filter(|component| component.is_index());
    let Some(component) = component else {
        return Err(source.broken(format!("{of}: its sparse indices are of no usable type")));
    };
    let indices = (part(&sparse.indices, component.bytes())?, component);
    let replaced = Replaced { count: sparse.count, indices, values: part(&sparse.values, element)? };
    // Each accessor is looked at once: many primitives may use it.
    let rises = || (1..sparse.count).all(|i| replaced.index(i - 1) < replaced.index(i));
    let in_range = sparse.count == 0 || replaced.index(sparse.count - 1) < count;
    if in_range && (!source.first_time(of) || rises()) {
        return Ok(replaced);
    }
    Err(source.broken(format!("{of}: its sparse indices do not rise, or go beyond its {count} elements")))
}
