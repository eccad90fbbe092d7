//! A lost connection to the desktop: winit panics (elsewhere Xlib ends the process), and nothing can be drawn any more. The
//! user gets one line instead of a backtrace.

use std::path::Path;

use crate::Error;

/// Ends the process with one line if winit panics; other panics go to the hook that was installed before.
pub fn install_hook() {
    let previous = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic.location().is_some_and(|place| is_winit(place.file())) {
            return previous(panic);
        }
        let reason = panic.payload().downcast_ref::<String>().map_or("no reason is given", String::as_str);
        let error = Error::Window { problem: format!("the window system failed: {reason}") };
        crate::complain!("pbr-vr: {error}");
        std::process::exit(error.exit_code().into());
    }));
}

/// Whether a source file is winit's: of a crate folder `winit-VERSION`, as cargo's registry and vendored sources name it.
fn is_winit(file: &str) -> bool {
    let is_version = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
    Path::new(file).components().any(|part| {
        let name = part.as_os_str().to_str();
        name.and_then(|name| name.strip_prefix("winit-")).is_some_and(is_version)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_crates_own_folder_is_winit() {
        let registry = "/home/me/.cargo/registry/src/index.crates.io-1949cf8c6b5b557f";
        assert!(is_winit(&format!("{registry}/winit-0.30.13/src/platform_impl/linux/x11/mod.rs")));
        for file in [
            "/home/winit/pbr-vr/src/view/window.rs",
            "/home/me/my-winit-app/src/main.rs",
            "/home/me/winit-experiments/src/main.rs",
            "src/winit.rs",
            &format!("{registry}/winit_input_helper-0.16.0/src/lib.rs"),
            &format!("{registry}/ash-window-0.13.0/src/lib.rs"),
        ] {
            assert!(!is_winit(file), "{file}");
        }
    }
}
