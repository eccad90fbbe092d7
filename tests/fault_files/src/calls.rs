//! The functions of the C library that Rust's standard library calls for files and threads. Each is counted if it works on the
//! folder's files, fails if it is the chosen one, and else is the C library's.

use std::ffi::{c_char, c_int, c_uint, c_void};

use libc::{
    AT_FDCWD, DIR, dirent64, iovec, mode_t, pthread_attr_t, pthread_t, size_t, ssize_t, statx as Statx, timespec,
};

use super::faults::{
    CLOSE, CREATE, Fault, Kind, LIST, MAKE_FOLDER, MODE, NEXT_ENTRY, OPEN, READ, REMOVE, RENAME, RESOLVE, STAT, SYNC,
    THREAD, TIMES, TRUNCATE, WRITE, fault,
};
use super::files::{is_ours, note, path_in, path_of};

/// The C library's own functions, by their names.
pub mod real {
    use super::*;

    macro_rules! real {
        ($($name:ident: ($($type:ty),*) -> $result:ty;)*) => {$(
            pub fn $name() -> unsafe extern "C" fn($($type),*) -> $result {
                static FOUND: std::sync::OnceLock<usize> = std::sync::OnceLock::new();
                let name = concat!(stringify!($name), "\0");
                // SAFETY: the name ends in NUL.
                let find = || unsafe { libc::dlsym(libc::RTLD_NEXT, name.as_ptr().cast()) } as usize;
                let found = *FOUND.get_or_init(find);
                assert!(found != 0, "the C library has {name}");
                // SAFETY: the function of that name has this signature; mode arguments of open are passed as those of others.
                unsafe { std::mem::transmute::<usize, unsafe extern "C" fn($($type),*) -> $result>(found) }
            }
        )*};
    }

    real! {
        open: (*const c_char, c_int, mode_t) -> c_int;
        open64: (*const c_char, c_int, mode_t) -> c_int;
        openat64: (c_int, *const c_char, c_int, mode_t) -> c_int;
        close: (c_int) -> c_int;
        read: (c_int, *mut c_void, size_t) -> ssize_t;
        write: (c_int, *const c_void, size_t) -> ssize_t;
        writev: (c_int, *const iovec, c_int) -> ssize_t;
        fsync: (c_int) -> c_int;
        fdatasync: (c_int) -> c_int;
        ftruncate64: (c_int, i64) -> c_int;
        futimens: (c_int, *const timespec) -> c_int;
        fchmod: (c_int, mode_t) -> c_int;
        rename: (*const c_char, *const c_char) -> c_int;
        mkdir: (*const c_char, mode_t) -> c_int;
        unlink: (*const c_char) -> c_int;
        unlinkat: (c_int, *const c_char, c_int) -> c_int;
        statx: (c_int, *const c_char, c_int, c_uint, *mut Statx) -> c_int;
        opendir: (*const c_char) -> *mut DIR;
        readdir64: (*mut DIR) -> *mut dirent64;
        closedir: (*mut DIR) -> c_int;
        realpath: (*const c_char, *mut c_char) -> *mut c_char;
        pthread_create: (*mut pthread_t, *const pthread_attr_t, Start, *mut c_void) -> c_int;
    }
}

/// What a thread begins with.
type Start = extern "C" fn(*mut c_void) -> *mut c_void;

/// Sets the error that a call fails with.
fn set_error(error: c_int) {
    // SAFETY: this thread's error number.
    unsafe { *libc::__errno_location() = error }
}

/// Whether this call on a path fails; then with its error.
///
/// # Safety
/// The path is null or ends in NUL.
unsafe fn path_fails(kind: Kind, at: c_int, path: *const c_char) -> bool {
    // SAFETY: see above.
    let fault = unsafe { path_in(at, path) }.and_then(|path| fault(kind, || path));
    is_error(fault)
}

/// The same of an open file.
fn file_fails(kind: Kind, file: c_int) -> bool {
    is_error(file_fault(kind, file))
}

fn is_error(fault: Option<Fault>) -> bool {
    let Some(Fault::Error(error)) = fault else { return false };
    set_error(error);
    true
}

fn file_fault(kind: Kind, file: c_int) -> Option<Fault> {
    if is_ours(file) { fault(kind, || path_of(file)) } else { None }
}

/// The bytes of a call that reads or writes `count`; `None` with its error if it fails.
fn length(kind: Kind, file: c_int, count: size_t) -> Option<size_t> {
    match file_fault(kind, file) {
        Some(Fault::Error(error)) => {
            set_error(error);
            None
        }
        // None at all would be the end of the file.
        Some(Fault::Short) => Some(if count > 1 { count / 2 } else { count }),
        None => Some(count),
    }
}

/// Opens a file by `open`, the C library's.
///
/// # Safety
/// The path ends in NUL.
unsafe fn opened(at: c_int, path: *const c_char, flags: c_int, open: impl FnOnce() -> c_int) -> c_int {
    let kind = if flags & libc::O_CREAT == 0 { OPEN } else { CREATE };
    // SAFETY: see above.
    let ours = unsafe { path_in(at, path) };
    let is_ours = ours.is_some();
    if is_error(ours.and_then(|path| fault(kind, || path))) {
        return -1;
    }
    let file = open();
    note(file, is_ours);
    file
}

/// Each is, as long as it does not fail, the C library's function of its name.
macro_rules! exported {
    ($(fn $name:ident($($argument:ident: $type:ty),*) -> $result:ty $body:block)*) => {$(
        /// # Safety
        /// That of the C library's function.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($($argument: $type),*) -> $result {
            // SAFETY: the caller's arguments, as they are or as a part of what they allow.
            unsafe { $body }
        }
    )*};
}

exported! {
    fn open(path: *const c_char, flags: c_int, mode: mode_t) -> c_int {
        opened(AT_FDCWD, path, flags, || real::open()(path, flags, mode))
    }

    fn open64(path: *const c_char, flags: c_int, mode: mode_t) -> c_int {
        opened(AT_FDCWD, path, flags, || real::open64()(path, flags, mode))
    }

    fn openat64(at: c_int, path: *const c_char, flags: c_int, mode: mode_t) -> c_int {
        opened(at, path, flags, || real::openat64()(at, path, flags, mode))
    }

    fn close(file: c_int) -> c_int {
        let fails = file_fault(CLOSE, file);
        note(file, false);
        let closed = real::close()(file);
        if is_error(fails) { -1 } else { closed }
    }

    fn read(file: c_int, bytes: *mut c_void, count: size_t) -> ssize_t {
        length(READ, file, count).map_or(-1, |count| real::read()(file, bytes, count))
    }

    fn write(file: c_int, bytes: *const c_void, count: size_t) -> ssize_t {
        length(WRITE, file, count).map_or(-1, |count| real::write()(file, bytes, count))
    }

    fn writev(file: c_int, parts: *const iovec, count: c_int) -> ssize_t {
        match file_fault(WRITE, file) {
            fault @ Some(Fault::Error(_)) if is_error(fault) => -1,
            Some(_) if count > 0 => real::write()(file, (*parts).iov_base, (*parts).iov_len.div_ceil(2)),
            _ => real::writev()(file, parts, count),
        }
    }

    fn fsync(file: c_int) -> c_int {
        if file_fails(SYNC, file) { -1 } else { real::fsync()(file) }
    }

    fn fdatasync(file: c_int) -> c_int {
        if file_fails(SYNC, file) { -1 } else { real::fdatasync()(file) }
    }

    fn ftruncate64(file: c_int, length: i64) -> c_int {
        if file_fails(TRUNCATE, file) { -1 } else { real::ftruncate64()(file, length) }
    }

    fn futimens(file: c_int, times: *const timespec) -> c_int {
        if file_fails(TIMES, file) { -1 } else { real::futimens()(file, times) }
    }

    fn fchmod(file: c_int, mode: mode_t) -> c_int {
        if file_fails(MODE, file) { -1 } else { real::fchmod()(file, mode) }
    }

    fn rename(from: *const c_char, to: *const c_char) -> c_int {
        if path_fails(RENAME, AT_FDCWD, to) { -1 } else { real::rename()(from, to) }
    }

    fn mkdir(path: *const c_char, mode: mode_t) -> c_int {
        if path_fails(MAKE_FOLDER, AT_FDCWD, path) { -1 } else { real::mkdir()(path, mode) }
    }

    fn unlink(path: *const c_char) -> c_int {
        if path_fails(REMOVE, AT_FDCWD, path) { -1 } else { real::unlink()(path) }
    }

    fn unlinkat(at: c_int, path: *const c_char, flags: c_int) -> c_int {
        if path_fails(REMOVE, at, path) { -1 } else { real::unlinkat()(at, path, flags) }
    }

    fn statx(at: c_int, path: *const c_char, flags: c_int, mask: c_uint, found: *mut Statx) -> c_int {
        // An empty path stands for an open file itself.
        let is_file = !path.is_null() && *path == 0;
        let fails = if is_file { file_fails(STAT, at) } else { path_fails(STAT, at, path) };
        if fails { -1 } else { real::statx()(at, path, flags, mask, found) }
    }

    fn opendir(path: *const c_char) -> *mut DIR {
        let ours = path_in(AT_FDCWD, path);
        let is_ours = ours.is_some();
        if is_error(ours.and_then(|path| fault(LIST, || path))) {
            return std::ptr::null_mut();
        }
        let folder = real::opendir()(path);
        if !folder.is_null() {
            note(libc::dirfd(folder), is_ours);
        }
        folder
    }

    fn readdir64(folder: *mut DIR) -> *mut dirent64 {
        if file_fails(NEXT_ENTRY, libc::dirfd(folder)) { std::ptr::null_mut() } else { real::readdir64()(folder) }
    }

    fn closedir(folder: *mut DIR) -> c_int {
        note(libc::dirfd(folder), false);
        real::closedir()(folder)
    }

    fn realpath(path: *const c_char, resolved: *mut c_char) -> *mut c_char {
        if path_fails(RESOLVE, AT_FDCWD, path) { std::ptr::null_mut() } else { real::realpath()(path, resolved) }
    }

    fn pthread_create(thread: *mut pthread_t, how: *const pthread_attr_t, start: Start, with: *mut c_void) -> c_int {
        // It returns its error. Drivers start threads with functions of their own.
        match is_the_programs(start).then(|| fault(THREAD, || "thread".into())).flatten() {
            Some(Fault::Error(error)) => error,
            _ => real::pthread_create()(thread, how, start, with),
        }
    }
}

/// Whether a function is in the program's own file, not in a library.
fn is_the_programs(function: Start) -> bool {
    let base = |address: *const c_void| {
        let mut found = std::mem::MaybeUninit::<libc::Dl_info>::zeroed();
        // SAFETY: any address may be asked about; the answer is plain data for which there is room, and zeros are good.
        unsafe {
            libc::dladdr(address, found.as_mut_ptr());
            found.assume_init().dli_fbase
        }
    };
    // SAFETY: it only looks up a number that the kernel has given the process.
    let entry = unsafe { libc::getauxval(libc::AT_ENTRY) };
    base(function as *const c_void) == base(entry as *const c_void)
}
