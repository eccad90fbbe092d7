//! The user's folders for caches, settings and pictures, as Windows and the XDG base directories define them.

use std::ffi::OsString;
use std::path::PathBuf;

/// For files that can be recreated: `%LOCALAPPDATA%` on Windows, else `$XDG_CACHE_HOME` or `~/.cache`; `None` where the
/// system names no such folder.
pub fn caches() -> Option<PathBuf> {
    caches_of(|name| std::env::var_os(name))
}

fn caches_of(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    user_folder(variable, "LOCALAPPDATA", ["XDG_CACHE_HOME", ".cache"])
}

/// For settings: `%APPDATA%` on Windows, else `$XDG_CONFIG_HOME` or `~/.config`; `None` where the system names no such folder.
pub fn settings() -> Option<PathBuf> {
    settings_of(|name| std::env::var_os(name))
}

fn settings_of(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    user_folder(variable, "APPDATA", ["XDG_CONFIG_HOME", ".config"])
}

/// What `windows` names there; elsewhere what `xdg` names, or else the folder in HOME.
fn user_folder(
    variable: impl Fn(&str) -> Option<OsString>,
    windows: &str,
    [xdg, in_home]: [&str; 2],
) -> Option<PathBuf> {
    let folder = absolute(variable);
    if cfg!(windows) { folder(windows) } else { folder(xdg).or_else(|| folder("HOME").map(|home| home.join(in_home))) }
}

/// The user's pictures: the known folder on Windows, which may be on another drive or in the cloud; else what
/// `user-dirs.dirs` calls XDG_PICTURES_DIR; `None` where the system names none.
pub fn pictures() -> Option<PathBuf> {
    #[cfg(windows)]
    return known_folders::get_known_folder_path(known_folders::KnownFolder::Pictures);
    #[cfg(not(windows))]
    return pictures_of(|name| std::env::var_os(name));
}

#[cfg(not(windows))]
fn pictures_of(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let home = absolute(&variable)("HOME")?;
    let list = settings_of(variable)?.join("user-dirs.dirs");
    named_folder(&std::fs::read_to_string(list).ok()?, "XDG_PICTURES_DIR", &home)
}

/// A line `NAME="$HOME/…"` or `NAME="/…"` of `user-dirs.dirs`, the form that xdg-user-dirs writes.
#[cfg(not(windows))]
fn named_folder(list: &str, name: &str, home: &std::path::Path) -> Option<PathBuf> {
    let value = list.lines().rev().find_map(|line| line.trim().strip_prefix(name)?.strip_prefix('='))?;
    let value = value.strip_prefix('"')?.strip_suffix('"')?;
    match value.strip_prefix("$HOME") {
        Some(rest) => Some(home.join(rest.trim_start_matches('/'))),
        None => Some(PathBuf::from(value)).filter(|path| path.is_absolute()),
    }
}

/// Folders that environment variables name. Relative ones are ignored, as the XDG specification demands; on Windows
/// too.
fn absolute(variable: impl Fn(&str) -> Option<OsString>) -> impl Fn(&str) -> Option<PathBuf> {
    move |name| variable(name).map(PathBuf::from).filter(|path| path.is_absolute())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// An environment that has only these.
    fn only<'a>(set: &'a [(&'a str, &'a str)]) -> impl Fn(&str) -> Option<OsString> + 'a {
        |wanted| set.iter().find(|(name, _)| *name == wanted).map(|(_, value)| value.into())
    }

    #[test]
    #[cfg(windows)]
    fn windows_users_find_the_cache_in_their_local_application_data() {
        let local = r"C:\Users\Jürgen Ö\AppData\Local";
        assert_eq!(caches_of(only(&[("LOCALAPPDATA", local), ("HOME", r"C:\home")])), Some(PathBuf::from(local)));
        assert_eq!(caches_of(only(&[("LOCALAPPDATA", r"here\there")])), None);
        assert_eq!(caches_of(only(&[])), None);
    }

    #[test]
    #[cfg(not(windows))]
    fn settings_are_where_xdg_says() {
        assert_eq!(settings_of(only(&[("HOME", "/home/me")])), Some("/home/me/.config".into()));
        let both = [("HOME", "/home/me"), ("XDG_CONFIG_HOME", "/etc/me")];
        assert_eq!(settings_of(only(&both)), Some("/etc/me".into()));
        assert_eq!(settings_of(only(&[("XDG_CONFIG_HOME", "relative")])), None);
    }

    #[test]
    #[cfg(windows)]
    fn windows_users_have_a_pictures_folder() {
        let pictures = pictures().expect("a known folder");
        assert!(pictures.is_absolute() && pictures.starts_with(Path::new(&std::env::var("USERPROFILE").unwrap())));
    }

    #[test]
    #[cfg(not(windows))]
    fn others_find_the_cache_where_xdg_says() {
        let home = ("HOME", "/home/jürgen ö");
        assert_eq!(caches_of(only(&[home, ("XDG_CACHE_HOME", "/fast")])), Some("/fast".into()));
        assert_eq!(caches_of(only(&[home, ("XDG_CACHE_HOME", "fast")])), Some("/home/jürgen ö/.cache".into()));
        assert_eq!(caches_of(only(&[home])), Some("/home/jürgen ö/.cache".into()));
        assert_eq!(caches_of(only(&[("LOCALAPPDATA", "/elsewhere")])), None);
    }

    #[test]
    #[cfg(not(windows))]
    fn others_find_their_pictures_where_xdg_says() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("user-dirs.dirs"), "# mine\nXDG_PICTURES_DIR=\"$HOME/Bilder\"\n").unwrap();
        let config = folder.path().to_str().unwrap();
        let found = pictures_of(only(&[("HOME", "/home/jürgen"), ("XDG_CONFIG_HOME", config)]));
        assert_eq!(found, Some("/home/jürgen/Bilder".into()));
        assert_eq!(pictures_of(only(&[("HOME", config)])), None, "no list there");
        assert_eq!(pictures_of(only(&[])), None);
    }

    #[test]
    #[cfg(not(windows))]
    fn the_list_of_user_folders_is_read_as_it_is_written() {
        let read = |list| named_folder(list, "XDG_PICTURES_DIR", Path::new("/home/a"));
        assert_eq!(
            read("XDG_MUSIC_DIR=\"$HOME/m\"\n XDG_PICTURES_DIR=\"/data/my pictures\""),
            Some("/data/my pictures".into())
        );
        assert_eq!(read("XDG_PICTURES_DIR=\"$HOME/\""), Some("/home/a/".into()));
        for nothing in [
            "",
            "#XDG_PICTURES_DIR=\"/a\"",
            "XDG_PICTURES_DIR=/a",
            "XDG_PICTURES_DIR=\"a\"",
            "XDG_PICTURES_DIRS=\"/a\"",
        ] {
            assert_eq!(read(nothing), None, "{nothing}");
        }
    }
}
