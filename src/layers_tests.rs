//! The order of the code: imports run down the layers, `ash` stays where Vulkan is called, files do not use each other in
//! circles, and every file is short and says what it owns.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Lowest first; a layer may use itself and those before it.
const LAYERS: [&str; 12] = [
    "error",
    "reference",
    "asset",
    "args",
    "scene",
    "gpu",
    "context",
    "precompute",
    "render",
    "view",
    "measure",
    "main",
];
/// May name `ash`: what calls Vulkan, and the error that holds Vulkan's result codes.
const NAMES_ASH: [&str; 4] = ["gpu", "view::window", "view::headset", "error"];
const MOST_LINES: usize = 500;

/// A path inside the crate, such as `gpu::image::Image`; empty for the crate's root.
type Names = Vec<String>;
/// The code of each file under src/, by module: its `pub use` statements, and the rest.
type Files = BTreeMap<Names, [String; 2]>;

/// All files of a folder and of those below it.
fn paths_under(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { paths_under(&path) } else { vec![path] }).collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The program's code, without tests and without lines of comment.
fn files() -> Files {
    let mut files = Files::new();
    for path in paths_under(&root().join("src")) {
        let inside = path.strip_prefix(root().join("src")).unwrap().with_extension("");
        let mut module: Names = inside.iter().map(|name| name.to_str().unwrap().to_owned()).collect();
        module.retain(|name| name != "mod" && name != "lib");
        let text = fs::read_to_string(&path).unwrap().replace("\r\n", "\n");
        let code: Vec<&str> =
            without_tests(&text).lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        if !module.last().is_some_and(|name| name.ends_with("_tests")) {
            files.insert(module, split_exports(&code.join("\n")));
        }
    }
    files
}

/// A file up to its inline test module, which comes last.
fn without_tests(text: &str) -> &str {
    let mut marks = text.match_indices("#[cfg(test)]\n");
    let opens_module =
        |at: usize| text[at..].lines().nth(1).is_some_and(|line| line.contains("mod ") && line.ends_with('{'));
    marks.find(|(at, _)| opens_module(*at)).map_or(text, |(at, _)| &text[..at])
}

/// The `pub use` statements of a file, and the rest.
fn split_exports(code: &str) -> [String; 2] {
    let (mut exports, mut rest) = (String::new(), String::new());
    for statement in code.split_inclusive(';') {
        let first = statement.lines().map(str::trim_start).find(|line| !line.is_empty() && !line.starts_with("#["));
        let is_export = first.is_some_and(|line| line.starts_with("pub") && line.contains(" use "));
        if is_export { &mut exports } else { &mut rest }.push_str(statement);
    }
    [exports, rest]
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The paths at the start of `text`, which is `a::b`, `a::{b, c::d}` or `{a, b}`; and the text behind them.
fn parse(text: &str) -> (Vec<Names>, &str) {
    let text = text.trim_start();
    if let Some(mut rest) = text.strip_prefix('{') {
        let mut members = Vec::new();
        loop {
            let (member, behind) = parse(rest);
            members.extend(member);
            rest = behind[behind.find([',', '}']).unwrap()..].trim_start_matches(',').trim_start();
            if let Some(rest) = rest.strip_prefix('}') {
                return (members, rest);
            }
        }
    }
    let (name, behind) = text.split_at(text.find(|c| !is_word(c)).unwrap_or(text.len()));
    let name = vec![name.to_owned()];
    let Some(below) = behind.strip_prefix("::") else { return (vec![name], behind) };
    let (below, behind) = parse(below);
    (below.into_iter().map(|path| [&name[..], &path].concat()).collect(), behind)
}

/// What a part of a file names of this crate, by paths that start at the crate's root, above the file, or in a module below it.
fn named(module: &Names, code: &str, files: &Files) -> BTreeSet<Names> {
    let above = |levels| module[..module.len().saturating_sub(levels)].to_vec();
    let mut starts = vec![("crate".to_owned(), Names::new()), ("pbr_vr".to_owned(), Names::new())];
    starts.extend([("super".to_owned(), above(1)), ("super::super".to_owned(), above(2))]);
    let below = files.keys().filter(|file| file.len() == module.len() + 1 && file.starts_with(module));
    starts.extend(below.map(|file| (file[module.len()].clone(), file.clone())));
    let mut paths = BTreeSet::new();
    for (start, base) in starts {
        for (at, _) in code.match_indices(&format!("{start}::")) {
            let before = &code[..at];
            if !before.ends_with(is_word) && !before.ends_with("::") {
                let (found, _) = parse(&code[at + start.len() + 2..]);
                paths.extend(found.into_iter().map(|path| [&base[..], &path].concat()));
            }
        }
    }
    paths.retain(|path| !path.iter().any(|name| name == "super"));
    paths
}

/// The file that holds what a path names; a module above it may only re-export it.
fn file_of(path: &Names, exports: &BTreeMap<Names, BTreeSet<Names>>) -> Names {
    let depth = (0..=path.len()).rev().find(|depth| exports.contains_key(&path[..*depth])).unwrap();
    let (module, rest) = path.split_at(depth);
    match exports[module].iter().find(|export| !rest.is_empty() && export.last() == rest.first()) {
        Some(export) => file_of(export, exports),
        None => module.to_vec(),
    }
}

/// The files that each file uses; what it only re-exports does not count.
fn uses() -> BTreeMap<Names, BTreeSet<Names>> {
    let files = files();
    let exports: BTreeMap<_, _> =
        files.iter().map(|(module, [code, _])| (module.clone(), named(module, code, &files))).collect();
    let mut uses = BTreeMap::new();
    for (module, [_, code]) in files.iter().filter(|(module, _)| !module.is_empty()) {
        let mut paths = named(module, code, &files);
        let words: BTreeSet<&str> = code.split(|c| !is_word(c)).collect();
        paths.extend(exports[module].iter().filter(|path| words.contains(path[path.len() - 1].as_str())).cloned());
        let mut others: BTreeSet<Names> = paths.iter().map(|path| file_of(path, &exports)).collect();
        // The crate's root only lists the layers and re-exports `error`.
        others.retain(|other| other != module && !other.is_empty());
        uses.insert(module.clone(), others);
    }
    uses
}

#[test]
fn imports_run_down_the_layers() {
    let level = |module: &Names| LAYERS.iter().position(|layer| *layer == module[0]).unwrap();
    for (module, used) in uses() {
        let above: Vec<_> = used.iter().filter(|other| level(other) > level(&module)).collect();
        assert!(above.is_empty(), "{module:?} uses a higher layer: {above:?}");
    }
}

/// Whether a file uses another, itself or through more files.
fn reaches(uses: &BTreeMap<Names, BTreeSet<Names>>, from: &Names, to: &Names) -> bool {
    let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
    while let Some(module) = next.pop() {
        next.extend(uses[module].iter().filter(|used| seen.insert(*used)));
    }
    seen.contains(to)
}

#[test]
fn files_do_not_use_each_other_in_circles() {
    let uses = uses();
    let circles = uses.iter().flat_map(|(module, used)| {
        let back = used.iter().filter(|other| reaches(&uses, other, module));
        back.map(|other| format!("{} uses {}\n", module.join("::"), other.join("::")))
    });
    let circles: String = circles.collect();
    assert!(circles.is_empty(), "all of these are part of a circle:\n{circles}");
}

#[test]
fn ash_stays_where_vulkan_is_called() {
    for (module, [exports, code]) in files() {
        let names_ash =
            [exports, code].concat().split(|c| !is_word(c)).any(|word| word == "ash" || word == "ash_window");
        let may = NAMES_ASH.iter().any(|start| module.join("::").starts_with(start));
        assert!(may || !names_ash, "{module:?} names ash");
    }
}

#[test]
fn every_file_is_short_and_says_what_it_owns() {
    for path in ["src", "glsl"].iter().flat_map(|folder| paths_under(&root().join(folder))) {
        if path.extension().is_some_and(|e| e == "md") {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.lines().count() <= MOST_LINES, "{}: more than {MOST_LINES} lines", path.display());
        let first = text.lines().find(|line| !line.starts_with("#version")).unwrap_or_default();
        let start = if path.extension().is_some_and(|e| e == "rs") { "//! " } else { "// " };
        assert!(first.starts_with(start), "{}: the first line does not say what it owns", path.display());
    }
}
