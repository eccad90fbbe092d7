//! MTL material libraries: the Phong and the PBR keys, as written; `scene::material` interprets them.
//!
//! `tobj`'s own reader is not used: it takes `-bm 0.5 file` for a file name and panics on an incomplete colour.

use std::path::{Path, PathBuf};

use super::{Report, file};
use crate::error::{MAX_QUOTED, shortened};
use crate::{Error, Result};

const MAX_FILE_BYTES: u64 = 64 << 20;

/// One `newmtl`. Absent keys are `None`; present numbers are finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mtl {
    pub name: String,
    /// Its file, for messages; maps are relative to its folder.
    pub path: PathBuf,
    /// Diffuse colour or base color.
    pub kd: Option<[f32; 3]>,
    /// Specular colour of the Phong model.
    pub ks: Option<[f32; 3]>,
    pub ke: Option<[f32; 3]>,
    /// Phong exponent.
    pub ns: Option<f32>,
    /// 1 is opaque; from `d`, or 1 − `Tr`.
    pub dissolve: Option<f32>,
    pub metallic: Option<f32>,
    pub roughness: Option<f32>,
    pub map_kd: Option<Map>,
    pub map_ka: Option<Map>,
    pub map_ao: Option<Map>,
    pub map_d: Option<Map>,
    pub map_metallic: Option<Map>,
    pub map_roughness: Option<Map>,
    /// `norm`: always a normal map.
    pub norm: Option<Map>,
    /// `bump` or `map_Bump`: a height map, or a normal map (many exporters write it so).
    pub bump: Option<Map>,
}

/// A texture as a material refers to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Key and line as written, for messages.
    pub key: String,
    pub line: usize,
    /// File name without options and quotes.
    pub file: String,
    /// `-bm`, else 1.
    pub bump_strength: f32,
}

/// Reads every material of a library. Values that cannot be parsed are skipped with a warning that names line and key.
///
/// # Errors
/// The file cannot be read, or is larger than 64 MiB.
pub fn load(path: &Path, report: &Report) -> Result<Vec<Mtl>> {
    let bytes = file::read(path, "material library", MAX_FILE_BYTES)?;
    if file::is_utf16(&bytes) {
        let (problem, remedy) = ("it is UTF-16 text".into(), "save it again as UTF-8");
        return Err(Error::Broken { path: path.into(), what: "material library", problem, remedy });
    }
    Ok(parse(path, &bytes, report))
}

fn parse(path: &Path, bytes: &[u8], report: &Report) -> Vec<Mtl> {
    let mut materials: Vec<Mtl> = Vec::new();
    for (index, line) in file::lines(bytes).enumerate() {
        let line = line.trim();
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let value = value.trim();
        if key.eq_ignore_ascii_case("newmtl") {
            materials.push(Mtl { name: value.to_owned(), path: path.into(), ..Mtl::default() });
        } else if let Some(material) = materials.last_mut()
            && let Err(problem) = read_key(material, key, value, index + 1)
        {
            let (key, value) = (shortened(key, MAX_QUOTED), shortened(value, MAX_QUOTED));
            report.warn(format!("{}:{}: {key} {value}: {problem}; ignored", file::short_name(path), index + 1));
        }
    }
    materials
}

fn read_key(material: &mut Mtl, key: &str, value: &str, line: usize) -> std::result::Result<(), &'static str> {
    let map = || read_map(key, value, line).map(Some);
    match key.to_ascii_lowercase().as_str() {
        "kd" => material.kd = Some(colour(value)?),
        "ks" => material.ks = Some(colour(value)?),
        "ke" => material.ke = Some(colour(value)?),
        "ns" => material.ns = Some(number(value)?),
        // `-halo` makes it depend on the view; the number comes last in either case.
        "d" => material.dissolve = Some(number(value.trim_start_matches("-halo"))?),
        // Some exporters write three numbers; `d` takes precedence.
        "tr" => material.dissolve = material.dissolve.or(Some(1.0 - number(value)?)),
        "pm" => material.metallic = Some(number(value)?),
        "pr" => material.roughness = Some(number(value)?),
        "map_kd" => material.map_kd = map()?,
        "map_ka" => material.map_ka = map()?,
        "map_ao" => material.map_ao = map()?,
        "map_d" => material.map_d = map()?,
        "map_pm" => material.map_metallic = map()?,
        "map_pr" => material.map_roughness = map()?,
        "norm" | "map_norm" => material.norm = map()?,
        "bump" | "map_bump" => material.bump = map()?,
        _ => {}
    }
    Ok(())
}

fn number(text: &str) -> std::result::Result<f32, &'static str> {
    let word = text.split_whitespace().next().ok_or("no number")?;
    word.parse().ok().filter(|v: &f32| v.is_finite()).ok_or("not a number")
}

/// Three numbers, or one for all three channels.
fn colour(text: &str) -> std::result::Result<[f32; 3], &'static str> {
    let values = text.split_whitespace().map(number).collect::<std::result::Result<Vec<_>, _>>();
    match values.map_err(|_| "not an RGB colour")?[..] {
        [grey] => Ok([grey; 3]),
        [r, g, b] => Ok([r, g, b]),
        _ => Err("not an RGB colour"),
    }
}

fn read_map(key: &str, value: &str, line: usize) -> std::result::Result<Map, &'static str> {
    let mut rest = value;
    let mut bump_strength = 1.0;
    while rest.starts_with('-') {
        let (option, after) = next_word(rest);
        let option = option.to_ascii_lowercase();
        let Some((least, most)) = option_arity(&option) else { break };
        if option == "-bm" {
            bump_strength = number(after)?;
        }
        rest = skip_words(after, least, most);
    }
    let file = rest.trim().trim_matches('"').trim();
    if file.is_empty() {
        return Err("no file name");
    }
    Ok(Map { key: key.to_owned(), line, file: file.to_owned(), bump_strength })
}

/// Minimum and maximum number of words after a map option; beyond the minimum only numbers count.
fn option_arity(option: &str) -> Option<(usize, usize)> {
    Some(match option {
        "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-type" | "-texres" | "-bm" | "-boost" => (1, 1),
        "-mm" => (2, 2),
        "-o" | "-s" | "-t" => (1, 3),
        _ => return None,
    })
}

fn next_word(text: &str) -> (&str, &str) {
    let text = text.trim_start();
    text.split_at(text.find(char::is_whitespace).unwrap_or(text.len()))
}

fn skip_words(text: &str, least: usize, most: usize) -> &str {
    let mut rest = text;
    for count in 0..most {
        let (word, after) = next_word(rest);
        // The last word is the file name, even where it looks like a number.
        if count >= least && (word.parse::<f32>().is_err() || after.trim().is_empty()) {
            break;
        }
        rest = after;
    }
    rest.trim_start()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &[u8]) -> (Vec<Mtl>, Vec<String>) {
        let report = Report::silent();
        (parse(Path::new("folder/a.mtl"), text, &report), report.warnings())
    }

    fn file_of(map_line: &str) -> (String, f32) {
        let (materials, warnings) = parsed(format!("newmtl a\n{map_line}\n").as_bytes());
        assert_eq!(warnings, [""; 0], "{map_line}");
        let map = materials[0].bump.clone().unwrap();
        (map.file, map.bump_strength)
    }

    #[test]
    fn keys() {
        let text = b"# comment\r\nKd 1 1 1\r\nnewmtl  first one\r\n\tKd 0.1 0.2 0.3\r\n Ks .5\r\nNs 50\r\nTr 0.25\r\nPm 1\r\nPr 0.5\r\n\
            map_Kd a b.png\r\nnorm n.png\r\nmap_Pm m.png\r\nmap_Pr r.png\r\nmap_Ka o.png\r\nmap_d d.png\r\nillum 2\r\nnewmtl second\r\nd -halo 0.5";
        let (materials, warnings) = parsed(text);
        assert_eq!((materials.len(), warnings.len()), (2, 0));
        let first = &materials[0];
        assert_eq!(first.name, "first one");
        assert_eq!((first.kd, first.ks, first.ns), (Some([0.1, 0.2, 0.3]), Some([0.5; 3]), Some(50.0)));
        assert_eq!((first.dissolve, first.metallic, first.roughness), (Some(0.75), Some(1.0), Some(0.5)));
        let map = first.map_kd.as_ref().unwrap();
        assert_eq!((map.key.as_str(), map.line, map.file.as_str()), ("map_Kd", 10, "a b.png"));
        for map in [&first.norm, &first.map_metallic, &first.map_roughness, &first.map_ka, &first.map_d] {
            assert!(map.is_some());
        }
        assert_eq!(
            materials[1],
            Mtl { name: "second".into(), path: "folder/a.mtl".into(), dissolve: Some(0.5), ..Mtl::default() }
        );
    }

    #[test]
    fn map_options() {
        for (line, file, strength) in [
            ("bump a.png", "a.png", 1.0),
            ("map_Bump -bm 0.5 a.png", "a.png", 0.5),
            ("map_bump -s 2 -o 1 2 3 -t 0.1 0.2 -bm 2 my stone.png", "my stone.png", 2.0),
            ("bump -clamp on -blendu off -mm 0 1 -imfchan l -BM 3 x\\y.png", "x\\y.png", 3.0),
            ("bump \"quoted name.png\"", "quoted name.png", 1.0),
            ("bump -s 1 1 1 2.5", "2.5", 1.0),
            ("bump -o 1 2", "2", 1.0),
            ("bump -dash.png", "-dash.png", 1.0),
        ] {
            assert_eq!(file_of(line), (file.to_owned(), strength), "{line}");
        }
    }

    #[test]
    fn marks_and_line_ends_of_any_editor() {
        for text in ["\u{feff}newmtl a\nKd 1 0 0\n", "newmtl a\rKd 1 0 0\r", "\u{feff}newmtl a\r\nKd 1 0 0"] {
            let (materials, warnings) = parsed(text.as_bytes());
            assert_eq!((materials.len(), warnings.len()), (1, 0), "{text:?}");
            assert_eq!(materials[0].kd, Some([1.0, 0.0, 0.0]), "{text:?}");
        }
    }

    #[test]
    fn invalid_values_are_warned_of_and_skipped() {
        let (materials, warnings) =
            parsed(b"newmtl a\nKd 1 2\nNs NaN\nPr\nmap_Kd\nmap_d -bm 1\nbump -bm x y.png\nKd 1 1 1 1");
        assert_eq!(warnings.len(), 7, "{warnings:?}");
        assert!(warnings[0].starts_with("a.mtl:2: Kd 1 2: not an RGB colour"));
        assert_eq!(materials, [Mtl { name: "a".into(), path: "folder/a.mtl".into(), ..Mtl::default() }]);
    }

    #[test]
    fn long_values_are_shortened_in_warnings() {
        let (_, warnings) = parsed(format!("newmtl a\nKd {}\n", "9e99 ".repeat(1000)).as_bytes());
        assert!(warnings.len() == 1 && warnings[0].chars().count() < 200, "{warnings:?}");
    }

    #[test]
    fn invalid_utf8_does_not_stop_parsing() {
        let (materials, _) = parsed(b"newmtl Gr\xfc\xdfe\nKd 1 0 0\n\xff\xfe\nmap_Kd st\xe4in.png\n");
        assert_eq!(materials[0].kd, Some([1.0, 0.0, 0.0]));
        assert_eq!(materials[0].name, "Gr\u{fffd}\u{fffd}e");
    }
}
