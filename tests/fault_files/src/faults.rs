//! Which call fails, and how: by its number among those that count.

use std::ffi::{CString, OsString, c_int};
use std::fmt::Write as _;
use std::os::unix::ffi::{OsStrExt as _, OsStringExt as _};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use libc::{EACCES, EAGAIN, EDQUOT, EINTR, EIO, EMFILE, ENOSPC, EPERM};

use super::calls::real;
use super::names::{CALL, FOLDER, LOG};

/// How a call fails.
#[derive(Clone, Copy)]
pub enum Fault {
    Error(c_int),
    /// It reads or writes half of what was asked for, which is no failure.
    Short,
}

impl Fault {
    fn name(self) -> &'static str {
        match self {
            Self::Short => "short",
            Self::Error(EACCES) => "EACCES",
            Self::Error(EAGAIN) => "EAGAIN",
            Self::Error(EDQUOT) => "EDQUOT",
            Self::Error(EINTR) => "EINTR",
            Self::Error(EIO) => "EIO",
            Self::Error(EMFILE) => "EMFILE",
            Self::Error(ENOSPC) => "ENOSPC",
            Self::Error(EPERM) => "EPERM",
            Self::Error(_) => "another",
        }
    }
}

const fn errors<const N: usize>(numbers: [c_int; N]) -> [Fault; N] {
    let (mut faults, mut i) = ([Fault::Short; N], 0);
    while i < N {
        faults[i] = Fault::Error(numbers[i]);
        i += 1;
    }
    faults
}

/// What is called, and the faults that its manual page (Linux man-pages, section 2 or 3) lists for it.
#[derive(Clone, Copy)]
pub struct Kind(pub &'static str, pub &'static [Fault]);

pub const OPEN: Kind = Kind("open", &errors([EACCES, EMFILE, EIO, EINTR]));
pub const CREATE: Kind = Kind("create", &errors([ENOSPC, EDQUOT, EACCES, EMFILE, EINTR]));
pub const READ: Kind = Kind("read", &[Fault::Error(EIO), Fault::Error(EINTR), Fault::Short]);
pub const WRITE: Kind = {
    let [full, quota, broken, interrupted] = errors([ENOSPC, EDQUOT, EIO, EINTR]);
    Kind("write", &[full, quota, broken, interrupted, Fault::Short])
};
pub const SYNC: Kind = Kind("fsync", &errors([EIO, ENOSPC, EDQUOT, EINTR]));
/// The file is closed all the same.
pub const CLOSE: Kind = Kind("close", &errors([EIO, EINTR, ENOSPC]));
pub const TRUNCATE: Kind = Kind("ftruncate", &errors([EIO, EINTR]));
pub const TIMES: Kind = Kind("futimens", &errors([EACCES, EPERM]));
pub const MODE: Kind = Kind("fchmod", &errors([EPERM, EIO]));
pub const RENAME: Kind = Kind("rename", &errors([EACCES, ENOSPC, EDQUOT]));
pub const MAKE_FOLDER: Kind = Kind("mkdir", &errors([EACCES, ENOSPC, EDQUOT]));
pub const REMOVE: Kind = Kind("unlink", &errors([EACCES, EIO]));
pub const STAT: Kind = Kind("stat", &errors([EACCES, EIO]));
pub const LIST: Kind = Kind("opendir", &errors([EACCES, EMFILE]));
pub const NEXT_ENTRY: Kind = Kind("readdir", &errors([EIO]));
pub const RESOLVE: Kind = Kind("realpath", &errors([EACCES, EIO]));
pub const THREAD: Kind = Kind("pthread_create", &errors([EAGAIN]));

/// What a test has asked for.
struct Plan {
    folder: PathBuf,
    chosen: u64,
    calls: AtomicU64,
    list: c_int,
}

impl Plan {
    fn find() -> Option<Self> {
        let folder = std::env::var_os(FOLDER)?.into();
        let chosen = std::env::var(CALL).ok()?.parse().ok()?;
        let list = CString::new(std::env::var_os(LOG)?.into_vec()).ok()?;
        let flags = libc::O_WRONLY | libc::O_CREAT | libc::O_APPEND | libc::O_CLOEXEC;
        // SAFETY: the C library's function, and a text that ends in NUL.
        let list = unsafe { real::open64()(list.as_ptr(), flags, 0o600) };
        (list >= 0).then_some(Self { folder, chosen, calls: AtomicU64::new(0), list })
    }
}

fn plan() -> Option<&'static Plan> {
    static PLAN: OnceLock<Option<Plan>> = OnceLock::new();
    PLAN.get_or_init(Plan::find).as_ref()
}

/// Whether a path is of the folder whose files count. In folders named `vulkan` its loader looks for layers.
pub fn counts(path: &Path) -> bool {
    let is_loaders = |path: &Path| path.iter().any(|part| part == "vulkan");
    plan().is_some_and(|plan| path.strip_prefix(&plan.folder).is_ok_and(|rest| !is_loaders(rest)))
}

/// How this call, one of those that count, fails; `None` if it does not. `path` is what it works on.
pub fn fault(Kind(name, faults): Kind, path: impl FnOnce() -> OsString) -> Option<Fault> {
    let plan = plan()?;
    let number = plan.calls.fetch_add(1, Ordering::Relaxed) + 1;
    // One call after the other has one fault after the other.
    let which = faults[usize::try_from(number).unwrap_or(0) % faults.len()];
    let fault = (number == plan.chosen).then_some(which);
    let mut line = format!("{name}:{}", which.name());
    if fault.is_some() {
        // A name of any bytes stays on its line.
        let _ = write!(line, " {}", path().as_bytes().escape_ascii());
    }
    line.push('\n');
    // SAFETY: the C library's function; the bytes live. Written at once, so that lines of two threads stay whole.
    unsafe { real::write()(plan.list, line.as_ptr().cast(), line.len()) };
    fault
}
