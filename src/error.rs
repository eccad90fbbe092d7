//! Every error that a user can see (the problem, the file or resource, the remedy), and printing to stdout and stderr.

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// The crate's result.
pub type Result<T> = std::result::Result<T, Error>;

/// An error, displayed as the command line prints it: one line, with its remedy.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file or folder could not be opened or read.
    #[error("cannot read {}: {source}; check that the path is right and readable", path.display())]
    Read { path: PathBuf, source: std::io::Error },

    /// A file or folder could not be written.
    #[error("cannot write {}: {source}; check that the folder exists, is writable and has room", path.display())]
    Write { path: PathBuf, source: std::io::Error },

    /// A file was read, but its content is not usable.
    #[error("{}: not a usable {what}: {problem}; {remedy}", path.display())]
    Broken { path: PathBuf, what: &'static str, problem: String, remedy: &'static str },

    /// A file would need more memory than the program allocates for its kind.
    #[error("{}: {what} is too large: {size} against a limit of {limit}; use a smaller one", path.display())]
    TooLarge { path: PathBuf, what: &'static str, size: String, limit: String },

    /// A key of a scene description is unknown, missing or has a bad value.
    #[error("{}:{line}: key `{key}`: {problem}", path.display())]
    SceneKey { path: PathBuf, line: usize, key: String, problem: String },

    /// A name on the command line (camera, GPU …) that does not exist.
    #[error("no {what} named `{name}`; there are: {}", list(known))]
    UnknownName { what: &'static str, name: String, known: Vec<String> },

    /// Vulkan, its loader or a driver is missing or too old.
    #[error("no usable Vulkan: {problem}; {remedy}")]
    NoVulkan { problem: String, remedy: &'static str },

    /// The system starts no thread for the program.
    #[error("no thread can be started: {0}; close other programs, or raise the limit of processes (`ulimit -u`)")]
    NoThread(std::io::Error),

    /// A Vulkan call failed.
    #[error("GPU: {doing} failed: {result}; {}", vulkan_remedy(*result))]
    Vulkan { doing: &'static str, result: ash::vk::Result },

    /// GPU memory could not be allocated.
    #[error("GPU: no memory for {what}: {problem}; close other programs, or choose a smaller picture or scene")]
    GpuMemory { what: String, problem: String },

    /// More than the GPU allows an object of this kind to have.
    #[error("GPU: {what} has {asked}, and {gpu} allows {most} at most; choose a smaller scene or setting")]
    GpuLimit { what: String, asked: String, most: String, gpu: String },

    /// What computes a scene's light could not be prepared.
    #[error("light: {problem}")]
    Light { problem: String },

    /// The validation layer reported something that is not on the list of expected messages.
    #[error("validation: {count} message(s), the first: {first}; this is a defect of pbr-vr, please report it")]
    Validation { count: usize, first: String },

    /// A window could not be opened, or stopped working.
    #[error("window: {problem}; use `pbr-vr render` to write a picture without a display")]
    Window { problem: String },

    /// No headset could be used.
    #[error("headset: {problem}; use `--on window`")]
    Headset { problem: String },

    /// Settings are to be chosen for a scene from measurements that do not exist.
    #[error("{}: its settings have not been measured on {gpu}; run `pbr-vr measure ladder {}` with `-o DIR` once", scene.display(), scene.display())]
    NotMeasured { scene: PathBuf, gpu: String },

    /// No measured settings meet a limit.
    #[error("{0}; ask for less")]
    Unmet(String),

    /// Ctrl-C or a signal ended work that goes on with the same command; where it ended.
    #[error("interrupted {0}; the same command goes on from there")]
    Interrupted(String),

    /// Bad usage of the command line; exit status 2.
    #[error("{0}")]
    Usage(String),
}

impl Error {
    /// An I/O error met while reading `path`.
    pub fn read(path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_owned();
        move |source| Self::Read { path, source }
    }

    /// An I/O error met while writing `path`.
    pub fn write(path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_owned();
        move |source| Self::Write { path, source }
    }

    /// A thread that prepares light has panicked.
    pub fn light_panicked() -> Self {
        Self::Light { problem: "a thread that prepares it has panicked; this is a defect, please report it".into() }
    }

    /// A failed Vulkan call, with what it was called for.
    pub fn vulkan(doing: &'static str) -> impl FnOnce(ash::vk::Result) -> Self {
        move |result| Self::Vulkan { doing, result }
    }

    /// Whether the device is lost, so that nothing can be drawn any more.
    pub fn is_device_lost(&self) -> bool {
        matches!(self, Self::Vulkan { result: ash::vk::Result::ERROR_DEVICE_LOST, .. })
    }

    /// Whether the GPU or its driver has failed.
    pub fn is_of_gpu(&self) -> bool {
        matches!(self, Self::Vulkan { .. } | Self::GpuMemory { .. })
    }

    /// Whether memory is missing, so that less may do.
    pub fn is_out_of_memory(&self) -> bool {
        use ash::vk::Result as R;
        let of = |result| matches!(result, R::ERROR_OUT_OF_DEVICE_MEMORY | R::ERROR_OUT_OF_HOST_MEMORY);
        matches!(self, Self::GpuMemory { .. }) || matches!(self, Self::Vulkan { result, .. } if of(*result))
    }

    /// The process's exit status: 2 for bad usage, else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::UnknownName { .. } => 2,
            _ => 1,
        }
    }
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

fn vulkan_remedy(result: ash::vk::Result) -> &'static str {
    use ash::vk::Result as R;
    match result {
        R::ERROR_DEVICE_LOST => "the driver was reset: start again, and update the driver if it happens again",
        R::ERROR_OUT_OF_DEVICE_MEMORY | R::ERROR_OUT_OF_HOST_MEMORY => {
            "close other programs, or choose a smaller picture or scene"
        }
        R::ERROR_SURFACE_LOST_KHR => "the window was closed: start again",
        _ => "`pbr-vr doctor` lists GPUs and drivers; run with `--validate` for details",
    }
}

/// The first error of printing results.
static UNPRINTED: Mutex<Option<std::io::Error>> = Mutex::new(None);

/// Whether the standard output was closed when the program started (`>&-`). By now it leads nowhere: Rust opens the null
/// device in its place, so that no file that is opened later receives what is printed.
static WAS_CLOSED: AtomicBool = AtomicBool::new(false);

/// Notes that the standard output was closed at the start: what is printed is lost.
pub fn note_closed_output() {
    WAS_CLOSED.store(true, Ordering::Relaxed);
}

/// Prints a line of results; [`say!`](crate::say) calls it. A closed pipe is no failure: its reader wants no more
/// lines.
pub fn print(line: std::fmt::Arguments<'_>) {
    if WAS_CLOSED.load(Ordering::Relaxed) {
        let closed = std::io::Error::other("it is closed");
        UNPRINTED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(closed);
        return;
    }
    let Err(error) = writeln!(std::io::stdout(), "{}", shown(&line.to_string(), true)) else { return };
    if error.kind() != ErrorKind::BrokenPipe {
        // The value is valid even if another thread panicked while it held the lock.
        UNPRINTED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

/// Whether all results could be printed; call it at the end.
///
/// # Errors
/// The first failure of [`print`].
pub fn printed() -> Result<()> {
    let lost = UNPRINTED.lock().unwrap_or_else(PoisonError::into_inner).take();
    lost.map_or(Ok(()), |error| Err(Error::write("the standard output")(error)))
}

/// Prints a line to stderr; [`complain!`](crate::complain) calls it. A failure is ignored: there is nowhere to report
/// it.
pub fn complain(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr(), "{}", shown(&line.to_string(), false));
}

/// Text, possibly from a file, made safe for a terminal: control characters, which could break or rewrite lines, are
/// escaped. Line breaks are kept where `lines` is set.
pub fn shown(text: &str, lines: bool) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() && !(lines && c == '\n') { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out
}

/// Characters of a name or value from a file that messages quote.
pub const MAX_QUOTED: usize = 80;

/// The first `most` characters of a text, with an ellipsis where something was cut off.
pub fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// The first `most` characters of a text from a file or a decoder, on one line.
pub fn one_line(text: &str, most: usize) -> String {
    shown(&shortened(text.trim(), most), false)
}

/// Prints a line like `println!`, without its panic where the pipe is closed (`pbr-vr … | head -1`).
#[macro_export]
macro_rules! say {
    ($($what:tt)*) => { $crate::error::print(format_args!($($what)*)) };
}

/// Prints a line like `eprintln!`, without its panic where the line cannot be written (a full disk).
#[macro_export]
macro_rules! complain {
    ($($what:tt)*) => { $crate::error::complain(format_args!($($what)*)) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stays_a_line_and_short() {
        assert_eq!(shown("a\nb\u{1b}[31m\u{9b}é", false), "a\\nb\\u{1b}[31m\\u{9b}é");
        assert_eq!(shown("a\nb\r", true), "a\nb\\r");
        assert_eq!((shortened("äöü", 2), shortened("äöü", 3)), ("äö…".into(), "äöü".into()));
        assert_eq!((one_line(" a\rbc\n", 3), one_line("abc\n", 3)), ("a\\rb…".into(), "abc".into()));
    }

    #[test]
    fn only_a_lost_device_is_a_lost_device() {
        use ash::vk::Result as R;
        let error = |result| Error::vulkan("showing a picture")(result);
        assert!(error(R::ERROR_DEVICE_LOST).is_device_lost());
        for result in [R::ERROR_SURFACE_LOST_KHR, R::ERROR_OUT_OF_DEVICE_MEMORY, R::ERROR_NATIVE_WINDOW_IN_USE_KHR] {
            assert!(!error(result).is_device_lost(), "{result}");
        }
        assert!(!Error::Window { problem: "this display has no sRGB format".into() }.is_device_lost());
    }
}
