//! Which vertices make the triangles of a primitive.

use super::accessor::Elements;
use super::source::Source;
use crate::Result;

/// How vertices make triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    List,
    Strip,
    Fan,
}

impl Mode {
    /// That of a number in the file; `None`: points and lines.
    ///
    /// # Errors
    /// It is unknown.
    pub fn of(source: &Source<'_>, of: &str, code: Option<u32>) -> Result<Option<Self>> {
        match code.unwrap_or(4) {
            0..=3 => Ok(None),
            4 => Ok(Some(Self::List)),
            5 => Ok(Some(Self::Strip)),
            6 => Ok(Some(Self::Fan)),
            other => Err(source.broken(format!("{of}: its mode {other} is unknown"))),
        }
    }

    /// The number of triangles of so many corners.
    pub fn triangles(self, corners: usize) -> usize {
        match self {
            Self::List => corners / 3,
            Self::Strip | Self::Fan => corners.saturating_sub(2),
        }
    }

    /// The corners of a triangle.
    fn corners(self, triangle: usize) -> [usize; 3] {
        match self {
            Self::List => [3 * triangle, 3 * triangle + 1, 3 * triangle + 2],
            // Every second one turns the other way.
            Self::Strip => [triangle, triangle + 1 + triangle % 2, triangle + 2 - triangle % 2],
            Self::Fan => [triangle + 1, triangle + 2, 0],
        }
    }
}

/// The triangles of a primitive of `count` vertices, without those that are only lines; strips have many.
///
/// # Errors
/// A vertex does not exist.
pub fn triangles(
    source: &Source<'_>,
    of: &str,
    mode: Mode,
    indices: Option<&Elements<'_, 1>>,
    count: usize,
) -> Result<Vec<[usize; 3]>> {
    let number = mode.triangles(indices.map_or(count, |indices| indices.count));
    let vertex = |corner: usize| match indices {
        Some(indices) => indices.indices(corner)[0] as usize,
        None => corner,
    };
    let mut triangles = Vec::with_capacity(number);
    for triangle in 0..number {
        let vertices = mode.corners(triangle).map(vertex);
        if let Some(bad) = vertices.iter().find(|vertex| **vertex >= count) {
            return Err(source.broken(problem(of, *bad, indices, count)));
        }
        let [a, b, c] = vertices;
        if a != b && b != c && c != a {
            triangles.push(vertices);
        }
    }
    Ok(triangles)
}

fn problem(of: &str, index: usize, indices: Option<&Elements<'_, 1>>, count: usize) -> String {
    if indices.is_some_and(|indices| indices.restart() as usize == index) {
        return format!("{of}: an index is {index}, which stands for the end of a strip and is not allowed");
    }
    format!("{of}: an index is {index}, and there are {count} vertices")
}
