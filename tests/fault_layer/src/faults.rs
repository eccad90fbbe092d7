//! Which call fails: the next one of the function whose name is in a file, which goes with it. So a test says when.

use std::ffi::OsString;
use std::fs;
use std::sync::OnceLock;

/// The environment variable with the file's path.
pub const VARIABLE: &str = "PBR_VR_FAULT_FILE";

/// Whether this call of a function is to fail.
pub fn fails(function: &str) -> bool {
    static FILE: OnceLock<Option<OsString>> = OnceLock::new();
    let Some(file) = FILE.get_or_init(|| std::env::var_os(VARIABLE)) else { return false };
    let is_meant = fs::read_to_string(file).is_ok_and(|wanted| wanted == function);
    // Of two threads, one removes it.
    is_meant && fs::remove_file(file).is_ok()
}
