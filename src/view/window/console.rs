//! The console window that Windows opens for a program that Explorer or SteamVR starts: it must not cover the
//! picture, nor close before an error in it was read. On other systems, and in a shared console, nothing happens. On
//! Linux, whether there is a standard output at all.

/// Minimises the program's own console without giving the focus to it.
pub fn step_aside() {
    #[cfg(windows)]
    own::show(windows_sys::Win32::UI::WindowsAndMessaging::SW_SHOWMINNOACTIVE);
}

/// After a failure: brings the program's own console back and keeps it open until Enter is pressed.
pub fn hold() {
    #[cfg(windows)]
    if own::is_there() {
        use std::io::IsTerminal as _;
        own::show(windows_sys::Win32::UI::WindowsAndMessaging::SW_RESTORE);
        if std::io::stdin().is_terminal() && std::io::stderr().is_terminal() {
            crate::complain!("Press Enter to close this window.");
            // The result of reading does not matter.
            let _ = std::io::stdin().read_line(&mut String::new());
        }
    }
}

/// Looks at the standard output before Rust's runtime does, which opens the null device where it is closed.
#[cfg(target_os = "linux")]
mod early {
    use std::ffi::c_int;

    const STANDARD_OUTPUT: c_int = 1;
    /// `F_GETFD` of Linux's fcntl.h: fails for a descriptor that is not open.
    const GET_FLAGS: c_int = 1;

    unsafe extern "C" {
        fn fcntl(descriptor: c_int, command: c_int, ...) -> c_int;
    }

    /// The loader calls what stands in this section before `main`.
    #[used]
    // SAFETY: the section holds pointers to functions that may be called before `main`; this one needs no runtime.
    #[unsafe(link_section = ".init_array")]
    static LOOK: extern "C" fn() = look;

    extern "C" fn look() {
        // SAFETY: this command reads the flags of any descriptor and changes nothing.
        if unsafe { fcntl(STANDARD_OUTPUT, GET_FLAGS) } < 0 {
            crate::error::note_closed_output();
        }
    }
}

#[cfg(windows)]
mod own {
    use windows_sys::Win32::System::Console::{GetConsoleProcessList, GetConsoleWindow};
    use windows_sys::Win32::UI::WindowsAndMessaging::{SHOW_WINDOW_CMD, ShowWindow};

    /// Whether this process is the only one in its console: then Windows opened it for this program alone.
    pub fn is_there() -> bool {
        let mut processes = [0; 2];
        // SAFETY: the list has room for as many as it is said to have.
        unsafe { GetConsoleProcessList(processes.as_mut_ptr(), 2) == 1 }
    }

    pub fn show(how: SHOW_WINDOW_CMD) {
        if is_there() {
            // SAFETY: the window, which may be null, is the console's; it lives as long as this process is attached.
            unsafe { ShowWindow(GetConsoleWindow(), how) };
        }
    }
}
