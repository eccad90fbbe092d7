//! Which paths and open files are of the folder whose files count.

use std::ffi::{CStr, OsStr, OsString, c_char, c_int};
use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::faults::counts;

/// Whether an open file's descriptor is of the folder; higher ones are not followed.
static OPEN: [AtomicBool; 4096] = [const { AtomicBool::new(false) }; 4096];

fn place(descriptor: c_int) -> Option<&'static AtomicBool> {
    OPEN.get(usize::try_from(descriptor).ok()?)
}

/// Notes what a descriptor is of from now on.
pub fn note(descriptor: c_int, is_ours: bool) {
    place(descriptor).into_iter().for_each(|place| place.store(is_ours, Ordering::Relaxed));
}

/// Whether a descriptor is of a file in the folder.
pub fn is_ours(descriptor: c_int) -> bool {
    place(descriptor).is_some_and(|place| place.load(Ordering::Relaxed))
}

/// An open file's path, to be told.
pub fn path_of(descriptor: c_int) -> OsString {
    std::fs::read_link(format!("/proc/self/fd/{descriptor}")).unwrap_or_default().into_os_string()
}

/// The absolute path, if it is in the folder; a relative one is of the open folder `at`, or of the working folder.
///
/// # Safety
/// The path is null or ends in NUL.
pub unsafe fn path_in(at: c_int, path: *const c_char) -> Option<OsString> {
    if path.is_null() {
        return None;
    }
    // SAFETY: see above.
    let path = Path::new(OsStr::from_bytes(unsafe { CStr::from_ptr(path) }.to_bytes()));
    let whole = match path {
        path if path.is_absolute() => path.to_owned(),
        path if at == libc::AT_FDCWD => std::env::current_dir().ok()?.join(path),
        path if is_ours(at) => Path::new(&path_of(at)).join(path),
        _ => return None,
    };
    counts(&whole).then(|| whole.into_os_string())
}
