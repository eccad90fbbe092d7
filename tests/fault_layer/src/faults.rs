//! Which call fails. A test says it in one of two ways: the next call of the function whose name is in a file, which goes
//! with it, loses the GPU; or one call of all that may fail does, by its number in the process.

use std::ffi::OsString;
use std::fs;
use std::io::Write as _;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use ash::vk;

/// The environment variable with the path of the file that holds a function's name.
pub const FILE: &str = "PBR_VR_FAULT_FILE";
/// The environment variable with the number of the call that fails; 1 is the first, 0 none.
pub const CALL: &str = "PBR_VR_FAULT_CALL";
/// The environment variable with the path of the file that lists the calls, a line each: the function's name, and the error of
/// the call that fails.
pub const LOG: &str = "PBR_VR_FAULT_LOG";

/// The error with which this call of a function fails, one of those that Vulkan's specification lists for it; `None` if it
/// does not.
pub fn fault(function: &str, errors: &[vk::Result]) -> Option<vk::Result> {
    if errors.contains(&vk::Result::ERROR_DEVICE_LOST) && is_named(function) {
        return Some(vk::Result::ERROR_DEVICE_LOST);
    }
    is_numbered(function, errors)
}

fn is_named(function: &str) -> bool {
    static PATH: OnceLock<Option<OsString>> = OnceLock::new();
    let Some(file) = PATH.get_or_init(|| std::env::var_os(FILE)) else { return false };
    let is_meant = fs::read_to_string(file).is_ok_and(|wanted| wanted == function);
    // Of two threads, one removes it.
    is_meant && fs::remove_file(file).is_ok()
}

/// The numbered call, and the list of calls. Its lines count those before: the loader unloads this library with the last instance,
/// and loads it again with the next.
struct Numbered {
    chosen: u64,
    calls: AtomicU64,
    list: fs::File,
}

impl Numbered {
    fn find() -> Option<Self> {
        let chosen = std::env::var(CALL).ok()?.parse().ok()?;
        let path = std::env::var_os(LOG)?;
        let before = fs::read_to_string(&path).map_or(0, |text| text.lines().count());
        let list = fs::OpenOptions::new().create(true).append(true).open(path).ok()?;
        Some(Self { chosen, calls: AtomicU64::new(before as u64), list })
    }
}

fn is_numbered(function: &str, errors: &[vk::Result]) -> Option<vk::Result> {
    static NUMBERED: OnceLock<Option<Numbered>> = OnceLock::new();
    let Numbered { chosen, calls, list } = NUMBERED.get_or_init(Numbered::find).as_ref()?;
    let number = calls.fetch_add(1, Ordering::Relaxed) + 1;
    // One call after the other has its functions fail with one error after the other.
    let which = usize::try_from(number).unwrap_or(0) % errors.len();
    let error = (number == *chosen).then_some(errors[which]);
    let line = error.map_or_else(|| format!("{function}\n"), |error| format!("{function} {error:?}\n"));
    // Written at once, so that lines of two threads stay whole.
    (&mut &*list).write_all(line.as_bytes()).expect("room for a line");
    error
}
