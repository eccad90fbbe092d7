//! The types of the numbers in buffers, and the numbers of accessors whose primitives were compressed.

use super::document::Accessor;

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    pub fn of(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The bytes of a number, which this type has exactly.
    fn put(self, number: f32, to: &mut Vec<u8>) {
        match self {
            Self::I8 => to.extend((number as i8).to_le_bytes()),
            Self::U8 => to.push(number as u8),
            Self::I16 => to.extend((number as i16).to_le_bytes()),
            Self::U16 => to.extend((number as u16).to_le_bytes()),
            Self::U32 => to.extend((number as u32).to_le_bytes()),
            Self::F32 => to.extend(number.to_le_bytes()),
        }
    }

    /// The number at `at`; normalized ones become −1 to 1.
    pub fn number(self, bytes: &[u8], at: usize, normalized: bool) -> f32 {
        let (value, most) = match self {
            Self::I8 => (f32::from(taken::<1>(bytes, at)[0] as i8), 127.0),
            Self::U8 => (f32::from(taken::<1>(bytes, at)[0]), 255.0),
            Self::I16 => (f32::from(i16::from_le_bytes(taken(bytes, at))), 32767.0),
            Self::U16 => (f32::from(u16::from_le_bytes(taken(bytes, at))), 65535.0),
            Self::U32 => (u32::from_le_bytes(taken(bytes, at)) as f32, u32::MAX as f32),
            Self::F32 => return f32::from_le_bytes(taken(bytes, at)),
        };
        if normalized { (value / most).max(-1.0) } else { value }
    }

    /// The number at `at`; 0 if it is of a type that has no indices.
    pub fn index(self, bytes: &[u8], at: usize) -> u32 {
        match self {
            Self::U8 => u32::from(taken::<1>(bytes, at)[0]),
            Self::U16 => u32::from(u16::from_le_bytes(taken(bytes, at))),
            Self::U32 => u32::from_le_bytes(taken(bytes, at)),
            _ => 0,
        }
    }

    pub fn is_index(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }

    /// The largest index, which means another thing in lists of indices.
    pub fn restart(self) -> u32 {
        match self {
            Self::U8 => 0xff,
            Self::U16 => 0xffff,
            _ => u32::MAX,
        }
    }
}

/// Bytes at a place; zeros beyond the end.
fn taken<const B: usize>(bytes: &[u8], at: usize) -> [u8; B] {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; B])
}

/// The numbers of an accessor whose primitive was compressed.
#[derive(Debug)]
pub struct Unpacked {
    pub component: Component,
    pub bytes: Vec<u8>,
}

impl Unpacked {
    /// Indices of 32 bits: decompressed vertices can be more than the accessor's own type counts.
    pub fn indices(indices: impl Iterator<Item = u32>) -> Self {
        Self { component: Component::U32, bytes: indices.flat_map(u32::to_le_bytes).collect() }
    }

    /// Numbers of an accessor's own type.
    pub fn numbers(component: Component, numbers: &[f32]) -> Self {
        let mut bytes = Vec::with_capacity(numbers.len() * component.bytes());
        numbers.iter().for_each(|number| component.put(*number, &mut bytes));
        Self { component, bytes }
    }
}

/// The type of an accessor's numbers, and how many an element has; `None`: it has none that is known.
pub fn shape(accessor: &Accessor) -> Option<(Component, usize)> {
    let numbers = [1, 2, 3, 4].into_iter().find(|numbers| kind(*numbers) == accessor.kind)?;
    Some((Component::of(accessor.component_type)?, numbers))
}

/// The name of vectors of so many numbers.
pub fn kind(numbers: usize) -> &'static str {
    match numbers {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        4 => "VEC4",
        _ => "MAT4",
    }
}
