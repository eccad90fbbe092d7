//! The smallest files that a reader once failed on, and what each of them showed.

use super::readers::Reader;

/// Reader, what the file showed, and the file.
pub fn all() -> Vec<(Reader, &'static str, Vec<u8>)> {
    vec![]
}
