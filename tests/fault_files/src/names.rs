//! The environment variables, which tests include, too: they must not link the rest.

/// The variable with the folder whose files count; an absolute path without links.
pub const FOLDER: &str = "PBR_VR_FAULT_FOLDER";
/// The variable with the number of the call that fails; 1 is the first, 0 none.
pub const CALL: &str = "PBR_VR_FAULT_CALL";
/// The variable with the path of the file that lists the calls, a line each: what it is, a colon, and the fault that is meant for
/// it. Of the call that fails, file and fault follow. It is not in the folder.
pub const LOG: &str = "PBR_VR_FAULT_LOG";
