//! The library's entry points: the factory, and IVRClientCore_003, an object with a C++ vtable.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::null_mut;
use std::time::Duration;

use openvr_sys as sys;
use serde_json::{Value, json};

use crate::frame_times::FrameTimes;
use crate::log::Log;
use crate::runtime::{self, Runtime};
use crate::script::Script;
use crate::{chaperone, compositor, input, overlay, system};

/// The methods in the order of `ivrclientcore.h`; each takes the object first.
#[repr(C)]
struct Methods {
    init: unsafe extern "C" fn(*const Object, sys::EVRApplicationType, *const c_char) -> sys::EVRInitError,
    cleanup: unsafe extern "C" fn(*const Object),
    is_interface_version_valid: unsafe extern "C" fn(*const Object, *const c_char) -> sys::EVRInitError,
    get_generic_interface: unsafe extern "C" fn(*const Object, *const c_char, *mut sys::EVRInitError) -> *mut c_void,
    is_hmd_present: unsafe extern "C" fn(*const Object) -> bool,
    english_string: unsafe extern "C" fn(*const Object, sys::EVRInitError) -> *const c_char,
    id: unsafe extern "C" fn(*const Object, sys::EVRInitError) -> *const c_char,
}

#[repr(C)]
struct Object {
    methods: &'static Methods,
}

static METHODS: Methods =
    Methods { init, cleanup, is_interface_version_valid, get_generic_interface, is_hmd_present, english_string, id };
static OBJECT: Object = Object { methods: &METHODS };

const OK: sys::EVRInitError = sys::EVRInitError_VRInitError_None;
const NOT_FOUND: sys::EVRInitError = sys::EVRInitError_VRInitError_Init_InterfaceNotFound;

/// The one symbol that the loader looks up.
///
/// # Safety
/// As OpenVR's loader calls it: `name` is a string, `code` may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn VRClientCoreFactory(name: *const c_char, code: *mut c_int) -> *mut c_void {
    // SAFETY: the loader passes a string and a place for the code.
    let is_known = unsafe { text(name) } == "IVRClientCore_003";
    if !code.is_null() {
        // SAFETY: as above.
        unsafe { *code = if is_known { 0 } else { NOT_FOUND as c_int } };
    }
    if is_known { (&raw const OBJECT).cast_mut().cast() } else { null_mut() }
}

/// The text behind a C string; empty for null.
///
/// # Safety
/// `text` is null or a string that outlives the result.
pub unsafe fn text<'a>(text: *const c_char) -> &'a str {
    if text.is_null() {
        return "";
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_str().unwrap_or("?")
}

/// Script and log, or a line on stderr.
fn open() -> Option<(Script, Log)> {
    let opened = Script::from_environment().and_then(|script| {
        let log = Log::open(script.folder())?;
        Ok((script, log))
    });
    opened.inspect_err(|problem| eprintln!("headset runtime: {problem}")).ok()
}

unsafe extern "C" fn init(
    _: *const Object,
    kind: sys::EVRApplicationType,
    _startup: *const c_char,
) -> sys::EVRInitError {
    let Some((script, mut log)) = open() else { return sys::EVRInitError_VRInitError_Init_SettingsInitFailed };
    let start = script.start.clone();
    log.call(0, "Init", &json!({ "application": kind }));
    for _ in 0..start.chatter_kib {
        let line = "x".repeat(1023);
        println!("{line}");
        eprintln!("{line}");
    }
    if start.abort {
        eprintln!("headset runtime: aborts as its script says");
        std::process::abort();
    }
    if start.hang {
        loop {
            std::thread::park();
        }
    }
    std::thread::sleep(Duration::from_millis(start.slow_ms));
    if start.no_headset {
        return sys::EVRInitError_VRInitError_Init_HmdNotFound;
    }
    if start.is_asleep && kind != sys::EVRApplicationType_VRApplication_Scene {
        return sys::EVRInitError_VRInitError_Init_NoServerForBackgroundApp;
    }
    if start.error != 0 {
        return start.error as sys::EVRInitError;
    }
    match FrameTimes::open(script.folder()) {
        Ok(times) => runtime::start(Runtime::new(script, log, times)),
        Err(problem) => {
            eprintln!("headset runtime: {problem}");
            return sys::EVRInitError_VRInitError_Init_SettingsInitFailed;
        }
    }
    OK
}

unsafe extern "C" fn cleanup(_: *const Object) {
    runtime::stop();
}

/// The table of a name with version, if there is one.
fn table(name: &str) -> Option<*mut c_void> {
    let name = name.strip_prefix("FnTable:")?;
    let is = |version: &[u8]| version.strip_suffix(b"\0") == Some(name.as_bytes());
    if is(sys::IVRSystem_Version) {
        Some(system::table())
    } else if is(sys::IVRCompositor_Version) {
        Some(compositor::table())
    } else if is(sys::IVRInput_Version) {
        Some(input::table())
    } else if is(sys::IVROverlay_Version) {
        Some(overlay::table())
    } else {
        is(sys::IVRChaperone_Version).then(chaperone::table)
    }
}

unsafe extern "C" fn is_interface_version_valid(_: *const Object, name: *const c_char) -> sys::EVRInitError {
    // SAFETY: the loader passes a string.
    let name = unsafe { text(name) };
    runtime::with(|r| {
        // Only system's is asked for in this way, and by its plain name.
        let known = name.as_bytes() == &sys::IVRSystem_Version[..sys::IVRSystem_Version.len() - 1];
        let answer = if known && !r.script.start.too_old { OK } else { NOT_FOUND };
        r.call("IsInterfaceVersionValid", json!({ "name": name, "answer": answer }));
        answer
    })
}

unsafe extern "C" fn get_generic_interface(
    _: *const Object,
    name: *const c_char,
    error: *mut sys::EVRInitError,
) -> *mut c_void {
    // SAFETY: the loader passes a string.
    let name = unsafe { text(name) };
    let found = runtime::with(|r| {
        let found = if r.script.start.too_old { None } else { table(name) };
        r.call("GetGenericInterface", json!({ "name": name, "found": found.is_some() }));
        found
    });
    if !error.is_null() {
        // SAFETY: the loader passes null or a place for the code.
        unsafe { *error = if found.is_some() { OK } else { NOT_FOUND } };
    }
    found.unwrap_or(null_mut())
}

unsafe extern "C" fn is_hmd_present(_: *const Object) -> bool {
    let Some((script, mut log)) = open() else { return false };
    let answer = !script.start.no_headset;
    log.call(0, "BIsHmdPresent", &json!({ "answer": answer }));
    answer
}

unsafe extern "C" fn english_string(_: *const Object, error: sys::EVRInitError) -> *const c_char {
    let text = match error {
        OK => c"No error",
        sys::EVRInitError_VRInitError_Init_HmdNotFound => c"Hmd not found",
        _ => c"The test runtime refuses",
    };
    text.as_ptr()
}

unsafe extern "C" fn id(_: *const Object, error: sys::EVRInitError) -> *const c_char {
    if error == OK { c"VRInitError_None".as_ptr() } else { c"VRInitError_Unknown".as_ptr() }
}

/// Details for a call without any.
pub const NOTHING: Value = Value::Null;
