//! Calls of other crates' decoders: a panic in one becomes an error of the file that it reads, without the panic's own
//! message on stderr.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::Path;
use std::sync::Once;

use serde::de::DeserializeOwned;

use super::file::short_name;
use crate::error::{MAX_QUOTED, one_line};

/// How the problem begins that a panic becomes.
pub const GAVE_UP: &str = "its decoder gave up";

// Otherwise a damaged file would end the program.
const _: () = assert!(cfg!(panic = "unwind"), "no profile may have `panic = \"abort\"`");

thread_local! {
    /// Whether this thread is in a decoder.
    static INSIDE: Cell<bool> = const { Cell::new(false) };
    /// Where the last one panicked: file and line.
    static PLACE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Calls a decoder, which must work in this thread alone: a panic of another one would be printed, or end the process.
///
/// # Errors
/// It panicked; the problem in words, for an error that names the file.
pub fn contained<T>(decode: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = take_hook();
        set_hook(Box::new(move |panic| {
            if INSIDE.get() {
                let place = panic.location().map_or_else(String::new, |place| {
                    format!("{}:{}", short_name(Path::new(place.file())), place.line())
                });
                PLACE.with_borrow_mut(|last| *last = place);
            } else {
                previous(panic);
            }
        }));
    });
    let outside = INSIDE.replace(true);
    // What it worked on is dropped, but for the file's bytes, which it only reads.
    let done = catch_unwind(AssertUnwindSafe(decode));
    INSIDE.set(outside);
    done.map_err(|reason| {
        let reason = words(reason.as_ref());
        format!("{GAVE_UP} at {}: {}", PLACE.take(), one_line(&reason, 2 * MAX_QUOTED))
    })
}

/// Decodes JSON; errors and panics as a problem in words.
pub fn from_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let decoded = contained(|| serde_json::from_slice(bytes))?;
    decoded.map_err(|error| one_line(&error.to_string(), 2 * MAX_QUOTED))
}

fn words(reason: &(dyn Any + Send)) -> String {
    let text = reason.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| reason.downcast_ref::<&str>().copied()).unwrap_or("no reason is given").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_one_line_of_words() {
        assert_eq!(contained(|| 7), Ok(7));
        let nothing: [u8; 0] = [];
        let index = std::hint::black_box(3);
        let problem = contained(|| nothing[index]).unwrap_err();
        assert!(
            problem.starts_with("its decoder gave up at contained.rs:") && problem.contains("index is 3"),
            "{problem}"
        );
        let problem = contained(|| assert_eq!(nothing.len(), index, "{}", "long\n".repeat(100))).unwrap_err();
        assert!(!problem.contains('\n') && problem.chars().count() < 4 * MAX_QUOTED, "{problem}");
        let within = contained(|| contained(|| -> u8 { panic!("inner") }).unwrap_err()).unwrap();
        assert!(within.contains("inner") && !INSIDE.get());
    }

    #[test]
    fn json_that_cannot_be_read_is_a_problem() {
        assert_eq!(from_json::<[u8; 2]>(b"[1, 2]"), Ok([1, 2]));
        assert!(from_json::<[u8; 2]>(b"[1, 2").unwrap_err().contains("line 1"));
        let deep = "[".repeat(100_000);
        assert!(from_json::<serde_json::Value>(deep.as_bytes()).is_err());
    }
}
