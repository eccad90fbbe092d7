//! Keeps the house in order: imports run downwards, `unsafe` and `ash` stay where they belong, files say what they own.

use std::fs;
use std::path::{Path, PathBuf};

/// Lowest first; a layer may use itself and those before it. `lib.rs` declares all but `main`.
const LAYERS: [&str; 10] =
    ["error", "reference", "asset", "scene", "gpu", "precompute", "render", "view", "measure", "main"];
/// Names at the crate's root, which belong to `error`.
const ROOT_NAMES: [&str; 4] = ["Error", "Result", "complain", "say"];
const MOST_LINES: usize = 500;

/// A source file: its path under the repository, its text, and its text without comments and string contents.
struct Source {
    path: String,
    raw: Vec<String>,
    code: Vec<String>,
}

impl Source {
    fn new(path: &str, text: &str) -> Self {
        let lines = |text: &str| text.lines().map(str::to_owned).collect();
        Self { path: path.to_owned(), raw: lines(text), code: lines(&code_only(text)) }
    }

    fn at(&self, line: usize, problem: &str) -> String {
        format!("{}:{}: {problem}", self.path, line + 1)
    }

    /// The path inside `src/`, with `/` on every system.
    fn inside(&self) -> &str {
        self.path.strip_prefix("src/").unwrap_or(&self.path)
    }

    fn layer(&self) -> &str {
        self.inside().split('/').next().unwrap_or_default().trim_end_matches(".rs")
    }

    /// May hold `unsafe` and call `ash`: the GPU layer, and what talks to window system or headset.
    fn is_close_to_the_metal(&self) -> bool {
        ["gpu/", "view/window", "view/headset"].iter().any(|start| self.inside().starts_with(start))
    }

    /// Whether a comment with `needle` stands on this line or above the statement that the line belongs to.
    fn has_comment(&self, line: usize, needle: &str) -> bool {
        let is_comment = |i: usize| self.raw[i].contains("//") && self.raw[i].contains(needle);
        if is_comment(line) {
            return true;
        }
        for above in (0..line).rev() {
            let code = self.code[above].trim();
            if self.raw[above].trim_start().starts_with("//") {
                if is_comment(above) {
                    return true;
                }
            } else if code.is_empty() || code.ends_with([';', '{', '}']) {
                return false;
            }
        }
        false
    }

    /// Marks the lines of items under `#[cfg(test)]`; a file `*_tests.rs` is one (`test_files_are_only_tests` sees to it).
    fn test_lines(&self) -> Vec<bool> {
        let mut marks = vec![self.path.ends_with("_tests.rs"); self.code.len()];
        let mut line = 0;
        while line < self.code.len() {
            if !self.code[line].contains("#[cfg(test)]") {
                line += 1;
                continue;
            }
            let (mut depth, mut opened) = (0, false);
            while line < self.code.len() {
                marks[line] = true;
                for c in self.code[line].chars() {
                    depth += i32::from(c == '{') - i32::from(c == '}');
                    opened |= c == '{';
                }
                let ends = if opened { depth == 0 } else { self.code[line].trim_end().ends_with(';') };
                line += 1;
                if ends {
                    break;
                }
            }
        }
        marks
    }
}

/// The text with comments and the insides of strings and characters replaced by spaces; line ends stay.
fn code_only(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut out = String::with_capacity(text.len());
    let mut i = 0;
    let blank = |out: &mut String, c: char| out.push(if c == '\n' { '\n' } else { ' ' });
    while i < chars.len() {
        let rest = &chars[i..];
        let starts = |what: &str| what.chars().enumerate().all(|(k, c)| rest.get(k) == Some(&c));
        let length = if starts("//") {
            rest.iter().position(|c| *c == '\n').unwrap_or(rest.len())
        } else if starts("/*") {
            block_comment(rest)
        } else if starts("\"") {
            string(rest)
        } else if (starts("r\"") || starts("r#")) && !ends_in_word(&out) {
            raw_string(rest)
        } else if starts("'") {
            character(rest)
        } else {
            0
        };
        if length == 0 {
            out.push(chars[i]);
            i += 1;
        } else {
            rest[..length].iter().for_each(|c| blank(&mut out, *c));
            i += length;
        }
    }
    out
}

fn ends_in_word(text: &str) -> bool {
    text.ends_with(|c: char| c.is_alphanumeric() || c == '_')
}

fn block_comment(rest: &[char]) -> usize {
    let (mut depth, mut i) = (0, 0);
    while i < rest.len() {
        match (rest[i], rest.get(i + 1)) {
            ('/', Some('*')) => (depth, i) = (depth + 1, i + 2),
            ('*', Some('/')) => (depth, i) = (depth - 1, i + 2),
            _ => i += 1,
        }
        if depth == 0 {
            break;
        }
    }
    i.min(rest.len())
}

fn string(rest: &[char]) -> usize {
    let mut i = 1;
    while i < rest.len() && rest[i] != '"' {
        i += if rest[i] == '\\' { 2 } else { 1 };
    }
    (i + 1).min(rest.len())
}

/// A raw string's length; 0 for a raw identifier.
fn raw_string(rest: &[char]) -> usize {
    let hashes = rest[1..].iter().take_while(|c| **c == '#').count();
    if rest.get(1 + hashes) != Some(&'"') {
        return 0;
    }
    let closes = |i: usize| rest[i] == '"' && rest[i + 1..].iter().take_while(|c| **c == '#').count() >= hashes;
    (2 + hashes..rest.len()).find(|i| closes(*i)).map_or(rest.len(), |i| i + 1 + hashes)
}

/// A character's length; 0 for a lifetime.
fn character(rest: &[char]) -> usize {
    match (rest.get(1), rest.get(2)) {
        (Some('\\'), _) => rest[3.min(rest.len())..].iter().position(|c| *c == '\'').map_or(0, |i| i + 4),
        (Some(_), Some('\'')) => 3,
        _ => 0,
    }
}

/// Names that the code takes from the crate's root, with their lines.
fn root_names(source: &Source) -> Vec<(usize, String)> {
    let code = source.code.join("\n");
    let mut names = Vec::new();
    let depth = module_depth(source.inside());
    let up = "super::".repeat(depth);
    for prefix in ["crate::", "pbr_vr::", up.as_str()] {
        for (start, _) in code.match_indices(prefix) {
            let before = &code[..start];
            if ends_in_word(before) || before.ends_with("::") {
                continue;
            }
            let line = before.matches('\n').count();
            let after = &code[start + prefix.len()..];
            if after.starts_with("super::") {
                continue;
            }
            let found = match after.strip_prefix('{') {
                Some(group) => group_names(group),
                None => vec![word(after)],
            };
            // Inside an inline module the same number of `super` ends one level lower: only layers count there.
            let is_path = |name: &String| prefix != up || LAYERS.contains(&name.as_str());
            names.extend(found.into_iter().filter(is_path).map(|name| (line, name)));
        }
    }
    names
}

/// How many `super::` lead from a file inside `src/` to the crate's root.
fn module_depth(inside: &str) -> usize {
    inside.trim_end_matches("/mod.rs").split('/').count()
}

fn word(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

/// The first names of a `{…}` group's members, given what follows its brace.
fn group_names(group: &str) -> Vec<String> {
    let (mut depth, mut names, mut fresh) = (0, Vec::new(), true);
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => fresh = true,
            c if depth == 0 && fresh && !c.is_whitespace() => {
                names.push(word(&group[i..]));
                fresh = false;
            }
            _ => {}
        }
    }
    names
}

fn upward_imports(source: &Source) -> Vec<String> {
    let level = |name: &str| LAYERS.iter().position(|layer| *layer == name);
    let own = level(source.layer()).unwrap_or_else(|| panic!("{}: no layer is named {}", source.path, source.layer()));
    let judge = |(line, name): (usize, String)| {
        let used = if ROOT_NAMES.contains(&name.as_str()) { Some(0) } else { level(&name) };
        match used {
            None => Some(source.at(line, &format!("`{name}` is no layer"))),
            Some(used) if used > own => Some(source.at(line, &format!("{} must not use {name}", source.layer()))),
            Some(_) => None,
        }
    };
    root_names(source).into_iter().filter_map(judge).collect()
}

/// Lines whose code holds `token` as a word of its own.
fn lines_with(source: &Source, token: &str) -> Vec<usize> {
    let holds = |line: &str| {
        line.match_indices(token).any(|(i, _)| {
            let after = &line[i + token.len()..];
            !ends_in_word(&line[..i]) && !after.starts_with(|c: char| c.is_alphanumeric() || c == '_')
        })
    };
    (0..source.code.len()).filter(|i| holds(&source.code[*i])).collect()
}

fn misplaced_unsafe(source: &Source) -> Vec<String> {
    let judge = |line: usize| {
        let code = &source.code[line];
        if !source.is_close_to_the_metal() {
            Some(source.at(line, "`unsafe` belongs into src/gpu or the window and headset files"))
        } else if (code.contains("unsafe {") || code.contains("unsafe impl")) && !source.has_comment(line, "SAFETY:") {
            Some(source.at(line, "`unsafe` without a `// SAFETY:` comment above it"))
        } else {
            None
        }
    };
    lines_with(source, "unsafe").into_iter().filter_map(judge).collect()
}

fn misplaced_ash(source: &Source) -> Vec<String> {
    // error.rs only names Vulkan's result codes.
    if source.is_close_to_the_metal() || source.inside() == "error.rs" {
        return Vec::new();
    }
    let lines = ["ash", "ash_window"].into_iter().flat_map(|token| lines_with(source, token));
    lines.map(|line| source.at(line, "`ash` belongs into src/gpu or the window files")).collect()
}

fn unproven_unwraps(source: &Source) -> Vec<String> {
    let tests = source.test_lines();
    let is_bad = |line: &usize| {
        let code = &source.code[*line];
        (code.contains(".unwrap()") || code.contains(".expect(")) && !tests[*line] && !source.has_comment(*line, "//")
    };
    let say = |line| source.at(line, "`unwrap` or `expect` without a comment above that proves it");
    (0..source.code.len()).filter(is_bad).map(say).collect()
}

/// `println!` and `eprintln!` panic where nothing can be written; `say!` and `complain!` do not.
fn fragile_prints(source: &Source) -> Vec<String> {
    let is_test = source.test_lines();
    let lines = ["print!", "println!", "eprint!", "eprintln!"].into_iter().flat_map(|name| lines_with(source, name));
    let problem = "say! and complain! do not panic where nothing can be written";
    lines.filter(|line| !is_test[*line]).map(|line| source.at(line, problem)).collect()
}

fn bad_shape(source: &Source) -> Vec<String> {
    let line = |i: usize| source.raw.get(i).map_or("", String::as_str);
    let mut problems = Vec::new();
    if source.raw.len() > MOST_LINES {
        problems.push(source.at(MOST_LINES, &format!("{} lines; at most {MOST_LINES}", source.raw.len())));
    }
    let says_what_it_owns = if source.path.ends_with(".rs") {
        line(0).starts_with("//! ")
    } else {
        line(0).starts_with("// ") || (line(0).starts_with("#version") && line(1).starts_with("// "))
    };
    if !says_what_it_owns {
        problems.push(source.at(0, "the first line must say what the file owns"));
    }
    problems
}

fn files_under(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() { files_under(&path, found) } else { found.push(path) }
    }
}

/// All files under one folder of the repository.
fn sources(folder: &str) -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = Vec::new();
    files_under(&root.join(folder), &mut paths);
    paths.sort();
    let read = |path: &PathBuf| {
        let inside = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
        Source::new(&inside, &fs::read_to_string(path).unwrap())
    };
    paths.iter().map(read).collect()
}

fn check(sources: &[Source], rule: impl Fn(&Source) -> Vec<String>) {
    assert!(!sources.is_empty(), "nothing to check");
    let problems: Vec<String> = sources.iter().flat_map(rule).collect();
    assert!(problems.is_empty(), "\n{}\n", problems.join("\n"));
}

fn rust_sources() -> Vec<Source> {
    sources("src").into_iter().filter(|s| s.path.ends_with(".rs")).collect()
}

#[test]
fn lib_declares_the_layers_in_order() {
    let lib = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let declared: Vec<String> = lib.lines().filter_map(|l| l.strip_prefix("pub mod ")).map(word).collect();
    assert_eq!(declared, LAYERS[..LAYERS.len() - 1]);
}

#[test]
fn imports_run_downwards() {
    let below_lib: Vec<Source> = rust_sources().into_iter().filter(|s| s.path != "src/lib.rs").collect();
    check(&below_lib, upward_imports);
}

#[test]
fn unsafe_stays_close_to_the_metal() {
    check(&rust_sources(), misplaced_unsafe);
}

#[test]
fn ash_stays_close_to_the_metal() {
    check(&rust_sources(), misplaced_ash);
}

#[test]
fn nothing_is_unwrapped_without_proof() {
    check(&rust_sources(), unproven_unwraps);
}

#[test]
fn nothing_is_printed_that_panics_where_it_cannot_be() {
    check(&rust_sources(), fragile_prints);
}

#[test]
fn test_files_are_only_tests() {
    let sources = rust_sources();
    let is_declared_for_tests = |module: &str| {
        let declares =
            |s: &Source, i: usize| lines_with(s, module).contains(&i) || s.raw[i].contains(&format!("\"{module}.rs\""));
        sources.iter().any(|s| {
            let tests = s.test_lines();
            !s.path.ends_with("_tests.rs") && (0..s.code.len()).any(|i| tests[i] && declares(s, i))
        })
    };
    for source in sources.iter().filter(|s| s.path.ends_with("_tests.rs")) {
        let module = source.path.rsplit('/').next().unwrap().trim_end_matches(".rs");
        assert!(is_declared_for_tests(module), "{}: no `#[cfg(test)]` stands before its `mod`", source.path);
    }
}

#[test]
fn every_file_is_short_and_says_what_it_owns() {
    check(&rust_sources(), bad_shape);
}

#[test]
fn every_shader_is_short_and_says_what_it_owns() {
    check(&sources("glsl"), bad_shape);
}

/// The rules themselves: each must find what it is for, and nothing in comments, strings or tests.
mod rules {
    use super::*;

    fn count(rule: impl Fn(&Source) -> Vec<String>, path: &str, text: &str) -> usize {
        rule(&Source::new(path, text)).len()
    }

    #[test]
    fn upward_imports_are_found() {
        let bad = [
            "use crate::view::Window;",
            "use crate::{asset::Texture, render};",
            "use crate::{\n    asset,\n    scene::{Mesh, view},\n    render::Frame,\n};",
            "fn f() { pbr_vr::precompute::bake() }",
            "use super::super::view::Window;",
            "use crate::nonsense::X;",
        ];
        for text in bad {
            assert_eq!(count(upward_imports, "src/gpu/image.rs", text), 1, "{text}");
        }
        let good = [
            "use crate::{Error, Result, scene::Mesh};\nuse crate::gpu::Image;",
            "// crate::view\n/* crate::view */ /// crate::view\nlet s = \"crate::view\";",
            "let s = r#\"crate::view \" \"#; let c = '\"'; let t = '\\''; // crate::view",
            "use super::super::reference::brdf;",
            "fn f<'a>(x: &'a str) {} use othercrate::view::X;",
        ];
        for text in good {
            assert_eq!(count(upward_imports, "src/gpu/image.rs", text), 0, "{text}");
        }
        assert_eq!(count(upward_imports, "src/main.rs", "use pbr_vr::view;"), 0);
    }

    #[test]
    fn unsafe_is_found() {
        let proven = "// SAFETY: the handle lives.\nlet x =\n    unsafe { f() };";
        assert_eq!(count(misplaced_unsafe, "src/gpu/a.rs", proven), 0);
        assert_eq!(count(misplaced_unsafe, "src/view/window.rs", proven), 0);
        assert_eq!(count(misplaced_unsafe, "src/render/a.rs", proven), 1);
        assert_eq!(count(misplaced_unsafe, "src/view/camera.rs", proven), 1);
        let second = format!("{proven}\nunsafe {{ g() }};");
        assert_eq!(count(misplaced_unsafe, "src/gpu/a.rs", &second), 1);
        assert_eq!(count(misplaced_unsafe, "src/asset/a.rs", "// unsafe\nlet unsafe_name = \"unsafe\";"), 0);
    }

    #[test]
    fn ash_is_found() {
        assert_eq!(count(misplaced_ash, "src/render/a.rs", "use ash::vk;\nash_window::f();"), 2);
        assert_eq!(count(misplaced_ash, "src/gpu/a.rs", "use ash::vk;"), 0);
        assert_eq!(count(misplaced_ash, "src/render/a.rs", "let hash = trash::x(); // ash"), 0);
    }

    #[test]
    fn unwraps_are_found() {
        assert_eq!(
            count(unproven_unwraps, "src/a.rs", "fn f() {\n    x.unwrap();\n    y\n        .expect(\"\");\n}"),
            2
        );
        assert_eq!(
            count(unproven_unwraps, "src/a.rs", "fn f() {\n    // x was checked.\n    x\n        .unwrap();\n}"),
            0
        );
        let tests = "#[cfg(test)]\nmod tests {\n    fn f() { x.unwrap() }\n}\nfn g() { x.unwrap() }";
        assert_eq!(count(unproven_unwraps, "src/a.rs", tests), 1);
        assert_eq!(count(unproven_unwraps, "src/a.rs", "x.unwrap_or(1);\n/// `.unwrap()`\nfn f() {}"), 0);
    }

    #[test]
    fn fragile_prints_are_found() {
        assert_eq!(count(fragile_prints, "src/a.rs", "println!();\neprintln!();\neprint!();"), 3);
        assert_eq!(count(fragile_prints, "src/a.rs", "say!(); complain!(); // println!\nwriteln!(out);"), 0);
    }

    #[test]
    fn shapes_are_checked() {
        assert_eq!(count(bad_shape, "src/a.rs", "//! Owns a."), 0);
        assert_eq!(count(bad_shape, "src/a.rs", "use b;\n//! Owns a."), 1);
        assert_eq!(count(bad_shape, "src/a.rs", &format!("//! Owns a.\n{}", "\n".repeat(MOST_LINES))), 1);
        assert_eq!(count(bad_shape, "glsl/a.vert", "#version 460\n// Owns a.\n"), 0);
        assert_eq!(count(bad_shape, "glsl/a.glsl", "// Owns a.\n"), 0);
        assert_eq!(count(bad_shape, "glsl/a.vert", "#version 460\nvoid main() {}\n"), 1);
    }
}
