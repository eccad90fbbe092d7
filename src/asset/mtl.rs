//! MTL material libraries: the Phong and the PBR keys, as written; `scene::material` interprets them.
//!
//! `tobj`'s own reader is not used: it takes `-bm 0.5 file` for a file name and panics on an incomplete colour.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use glam::Vec2;

use super::texture::Pick;
use super::{Report, file};
use crate::error::{MAX_QUOTED, shortened};
use crate::{Error, Result};

const MAX_FILE_BYTES: u64 = 64 << 20;
/// The largest number of `-s` and `-o`.
const MAX_UV_TRANSFORM: f32 = 1e4;

/// One `newmtl`. Absent keys are `None`; present numbers are finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mtl {
    pub name: String,
    /// Its file, for messages; maps are relative to its folder.
    pub path: PathBuf,
    /// Whether Blender wrote the file, which keeps roughness and metalness in keys of the Phong model.
    pub by_blender: bool,
    /// Ambient colour.
    pub ka: Option<[f32; 3]>,
    /// The number of an illumination model.
    pub illum: Option<u32>,
    /// Diffuse colour or base color.
    pub kd: Option<[f32; 3]>,
    /// Specular colour of the Phong model.
    pub ks: Option<[f32; 3]>,
    pub ke: Option<[f32; 3]>,
    /// By which light is multiplied that goes through.
    pub tf: Option<[f32; 3]>,
    /// Phong exponent.
    pub ns: Option<f32>,
    /// 1 is opaque; from `d`, or 1 − `Tr`.
    pub dissolve: Option<f32>,
    /// Index of refraction.
    pub ior: Option<f32>,
    pub metallic: Option<f32>,
    pub roughness: Option<f32>,
    pub clearcoat: Option<f32>,
    pub clearcoat_roughness: Option<f32>,
    pub sheen: Option<f32>,
    pub anisotropy: Option<f32>,
    /// In turns, counter-clockwise from the tangent.
    pub anisotropy_rotation: Option<f32>,
    pub map_kd: Option<Map>,
    pub map_ke: Option<Map>,
    pub map_ka: Option<Map>,
    pub map_ao: Option<Map>,
    pub map_d: Option<Map>,
    pub map_metallic: Option<Map>,
    pub map_roughness: Option<Map>,
    pub map_clearcoat: Option<Map>,
    /// `norm`: always a normal map.
    pub norm: Option<Map>,
    /// `bump` or `map_Bump`: a height map, or a normal map (many exporters write it so).
    pub bump: Option<Map>,
}

/// A texture as a material refers to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// Key and line as written, for messages.
    pub key: String,
    pub line: usize,
    /// File name without options and quotes.
    pub file: String,
    /// `-bm`, else 1.
    pub bump_strength: f32,
    /// `-imfchan`: the channel of a scalar map.
    pub pick: Option<Pick>,
    /// `-s` and `-o`.
    pub uv: UvTransform,
    /// `-clamp`: not repeated beyond its edges.
    pub clamp: bool,
}

/// Texture coordinates become `scale` · uv + `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    pub scale: [f32; 2],
    pub offset: [f32; 2],
}

impl UvTransform {
    /// Texture coordinates as the map takes them.
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        uv * Vec2::from(self.scale) + Vec2::from(self.offset)
    }
}

impl Mtl {
    /// That of all its maps: of the first one, with a warning if others differ.
    pub fn uv_transform(&self, report: &Report) -> UvTransform {
        let colours = [&self.map_kd, &self.norm, &self.bump, &self.map_roughness, &self.map_metallic];
        let maps = || colours.into_iter().chain([&self.map_ao, &self.map_ka, &self.map_d]).flatten();
        let Some(first) = maps().next() else { return UvTransform::default() };
        if let Some(other) = maps().find(|map| map.uv != first.uv) {
            let short = file::short_name(&self.path);
            let (line, key, own) = (other.line, &other.key, &first.key);
            report.warn(format!(
                "{short}:{line}: {key}: its -s and -o are not those of {own}, which are used for all maps"
            ));
        }
        first.uv
    }
}

impl Default for UvTransform {
    fn default() -> Self {
        Self { scale: [1.0; 2], offset: [0.0; 2] }
    }
}

/// Reads every material of a library. Values that cannot be parsed are skipped with a warning that names line and key; a
/// key or an option that is not honoured is warned of where it is met first.
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
    let by_blender = bytes.starts_with(b"# Blender");
    let mut warned = HashSet::new();
    for (index, line) in file::lines(bytes).enumerate() {
        let line = line.trim();
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let value = value.trim();
        if key.eq_ignore_ascii_case("newmtl") {
            materials.push(Mtl { name: value.to_owned(), path: path.into(), by_blender, ..Mtl::default() });
        } else if let Some(material) = materials.last_mut() {
            let mut not_honoured = |what: &str, why: &str| {
                if warned.insert(what.to_ascii_lowercase()) {
                    let what = shortened(what, MAX_QUOTED);
                    report.warn(format!("{}:{}: {what}: {why}", file::short_name(path), index + 1));
                }
            };
            if let Err(problem) = read_key(material, key, value, index + 1, &mut not_honoured) {
                let (key, value) = (shortened(key, MAX_QUOTED), shortened(value, MAX_QUOTED));
                report.warn(format!("{}:{}: {key} {value}: {problem}; ignored", file::short_name(path), index + 1));
            }
        }
    }
    materials
}

/// Reads a key into the material; `not_honoured` takes a key or an option, and what it would have done.
fn read_key(
    material: &mut Mtl,
    key: &str,
    value: &str,
    line: usize,
    not_honoured: &mut impl FnMut(&str, &str),
) -> std::result::Result<(), &'static str> {
    let mut map = || read_map(key, value, line, not_honoured).map(Some);
    let lower = key.to_ascii_lowercase();
    match lower.as_str() {
        "kd" => material.kd = Some(colour(value)?),
        "ka" => material.ka = colour(value).ok(),
        "ks" => material.ks = Some(colour(value)?),
        "ke" => material.ke = Some(colour(value)?),
        // Of one that is not glass it may be anything.
        "tf" => material.tf = colour(value).ok(),
        "ns" => material.ns = Some(number(value)?),
        "illum" => material.illum = number(value).ok().map(|model| model as u32),
        // `-halo` makes it depend on the view; the number comes last in either case.
        "d" => material.dissolve = Some(number(value.trim_start_matches("-halo"))?),
        // Some exporters write three numbers; `d` takes precedence.
        "tr" => material.dissolve = material.dissolve.or(Some(1.0 - number(value)?)),
        "ni" => material.ior = Some(number(value)?),
        "pm" => material.metallic = Some(number(value)?),
        "pc" => material.clearcoat = Some(number(value)?),
        "pcr" => material.clearcoat_roughness = Some(number(value)?),
        "ps" => material.sheen = Some(number(value)?),
        "aniso" => material.anisotropy = Some(number(value)?),
        "anisor" => material.anisotropy_rotation = number(value).ok(),
        "pr" => material.roughness = Some(number(value)?),
        "map_kd" => material.map_kd = map()?,
        "map_ke" => material.map_ke = map()?,
        "map_ka" => material.map_ka = map()?,
        "map_ao" => material.map_ao = map()?,
        "map_d" | "map_opacity" => material.map_d = map()?,
        "map_pm" | "map_metallic" => material.map_metallic = map()?,
        "map_pr" | "map_roughness" => material.map_roughness = map()?,
        "map_pc" => material.map_clearcoat = map()?,
        "norm" | "map_norm" | "map_normal" => material.norm = map()?,
        "bump" | "map_bump" => material.bump = map()?,
        "map_orm" => set_packed(material, &map()?, [Pick::Red, Pick::Green, Pick::Blue]),
        "map_rma" => set_packed(material, &map()?, [Pick::Blue, Pick::Red, Pick::Green]),
        "map_ns" if material.by_blender => material.map_roughness = map()?,
        "map_refl" if material.by_blender => material.map_metallic = map()?,
        _ => {
            if let Some(why) = unread(&lower) {
                not_honoured(key, why);
            }
        }
    }
    Ok(())
}

/// Occlusion, roughness and metalness from the channels of one picture.
fn set_packed(material: &mut Mtl, map: &Option<Map>, picks: [Pick; 3]) {
    let [occlusion, roughness, metallic] =
        picks.map(|pick| map.clone().map(|map| Map { pick: Some(map.pick.unwrap_or(pick)), ..map }));
    (material.map_ao, material.map_roughness, material.map_metallic) = (occlusion, roughness, metallic);
}

/// What a key that is not read would have done; `None` where it does nothing, and at the end of a file.
fn unread(key: &str) -> Option<&'static str> {
    Some(match key {
        "" | "newmtl" | "sharpness" => return None,
        _ if key.starts_with('#') => return None,
        "map_ks" => "a colour of highlights is not modelled; dielectrics mirror as Ni says, metals their base colour",
        "map_ns" => "exponents of highlights are not read from pictures; give roughness as map_Pr",
        "map_refl" => "strengths of reflection are not read; give metalness as map_Pm",
        "refl" => "its picture is not read; the scene's panorama is mirrored",
        "disp" | "map_disp" => "displacement is not modelled; give heights as map_Bump",
        "decal" => "decals are not modelled",
        "map_tr" => "pictures of transparency are not read; give coverage as map_d",
        "map_ps" => "sheen has no map; Ps is used alone",
        "map_pcr" => "roughness of clear coats is not read from pictures; give it as Pcr",
        "map_aniso" | "map_anisor" => "anisotropy has no map; aniso and anisor are used alone",
        "map_aat" => return None,
        _ => "unknown key; ignored",
    })
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

fn read_map(
    key: &str,
    value: &str,
    line: usize,
    not_honoured: &mut impl FnMut(&str, &str),
) -> std::result::Result<Map, &'static str> {
    let mut map = Map { key: key.to_owned(), line, bump_strength: 1.0, ..Map::default() };
    let mut rest = value;
    while rest.starts_with('-') {
        let (option, after) = next_word(rest);
        let option = option.to_ascii_lowercase();
        let Some((least, most)) = option_arity(&option) else { break };
        rest = skip_words(after, least, most);
        let words = &after[..after.len() - rest.len()];
        read_option(&mut map, &option, words)?;
        if let Some(why) = unread_option(&option, words) {
            not_honoured(&format!("{key} {option}"), why);
        }
    }
    let file = rest.trim().trim_matches('"').trim();
    if file.is_empty() {
        return Err("no file name");
    }
    file.clone_into(&mut map.file);
    Ok(map)
}

fn read_option(map: &mut Map, option: &str, words: &str) -> std::result::Result<(), &'static str> {
    // What is not given stays.
    let pair = |mut values: [f32; 2]| -> std::result::Result<[f32; 2], &'static str> {
        for (value, word) in values.iter_mut().zip(words.split_whitespace()) {
            *value = number(word)?;
        }
        if values.iter().any(|value| value.abs() > MAX_UV_TRANSFORM) { Err("beyond 10000") } else { Ok(values) }
    };
    match option {
        "-bm" => map.bump_strength = number(words)?,
        "-clamp" => map.clamp = words.trim().eq_ignore_ascii_case("on"),
        "-s" => map.uv.scale = pair(map.uv.scale)?,
        "-o" => map.uv.offset = pair(map.uv.offset)?,
        "-imfchan" => map.pick = Some(Pick::from_letter(words.trim()).ok_or("no channel r, g, b, m or l")?),
        _ => {}
    }
    Ok(())
}

/// What a map's option that is not read would have done; `None` where its value does nothing.
fn unread_option(option: &str, words: &str) -> Option<&'static str> {
    let numbers: Vec<f32> = words.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    Some(match option {
        "-t" if numbers.iter().any(|v| *v != 0.0) => "turbulence is not modelled",
        "-mm" if numbers != [0.0, 1.0] => "the picture's values are not changed by base and gain",
        "-cc" if words.trim().eq_ignore_ascii_case("on") => "colours are not corrected",
        "-boost" if numbers.iter().any(|v| *v != 0.0) => "smaller levels are not sharpened",
        "-type" => "pictures around spheres and cubes are not read",
        _ => return None,
    })
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
    fn scale_offset_and_channel_of_maps() {
        let (materials, warnings) = parsed(
            b"newmtl a\nmap_Kd -o 0.1 0.2 0 -s 2 3 1 col.png\nmap_d -imfchan m -s 2 a.png\nmap_Pr -imfchan z r.png\nbump -o 1e9 b.png\n",
        );
        let (colour, mask) = (materials[0].map_kd.as_ref().unwrap(), materials[0].map_d.as_ref().unwrap());
        assert_eq!(colour.uv, UvTransform { scale: [2.0, 3.0], offset: [0.1, 0.2] });
        assert_eq!(colour.uv.apply(Vec2::new(0.5, 1.0)), Vec2::new(1.1, 3.2));
        assert_eq!((mask.uv.scale, mask.pick, colour.pick), ([2.0, 1.0], Some(Pick::Alpha), None));
        assert!(warnings[0].contains("a.mtl:4: map_Pr -imfchan z r.png: no channel r, g, b, m or l; ignored"));
        assert!(warnings[1].contains("beyond 10000") && warnings.len() == 2, "{warnings:?}");
        let report = Report::silent();
        assert_eq!(materials[0].uv_transform(&report), colour.uv);
        assert_eq!(
            report.warnings(),
            ["a.mtl:3: map_d: its -s and -o are not those of map_Kd, which are used for all maps"]
        );
    }

    #[test]
    fn one_warning_for_each_key_and_option_that_is_not_honoured() {
        let silent = b"newmtl a\nKa 1 1 1\nillum 2\nNi 1.45\nTf 1 1 1\nPs 0\nPc 0.0\nPcr 0.03\naniso 0\nanisor 0\n# c\n\nmap_Kd -mm 0 1 -clamp off a.png";
        assert_eq!(parsed(silent).1, [""; 0]);
        let loud = b"newmtl a\nmap_Ns e.png\nmap_refl r.png\nrefl -type sphere s.png\nmap_Ks k.png\ndisp d.png\n\
            map_Pcr c.png\nshiny 3\nmap_Kd -clamp on -t 1 0 0 -mm 0 2 a.png\nnewmtl b\nmap_ks k.png\nmap_Pcr c.png\nshiny 4\nmap_Kd -clamp on a.png";
        let (_, warnings) = parsed(loud);
        let keys = ["map_Ns", "map_refl", "refl", "map_Ks", "disp", "map_Pcr", "shiny", "map_Kd -t"];
        assert_eq!(warnings.len(), keys.len() + 1, "{warnings:#?}");
        for (number, key) in keys.iter().enumerate() {
            assert!(warnings[number].starts_with(&format!("a.mtl:{}: {key}: ", number + 2)), "{}", warnings[number]);
        }
    }

    #[test]
    fn packed_pictures_and_other_names_of_keys() {
        let (materials, warnings) = parsed(b"newmtl a\nmap_ORM orm.png\nmap_Normal n.png\nnewmtl b\nmap_RMA rma.png\nnewmtl c\nmap_Roughness r.png\nmap_Metallic m.png\nmap_opacity o.png");
        assert_eq!(warnings, [""; 0]);
        let picks =
            |m: &Mtl| [&m.map_ao, &m.map_roughness, &m.map_metallic].map(|map| map.as_ref().and_then(|map| map.pick));
        assert_eq!(picks(&materials[0]), [Pick::Red, Pick::Green, Pick::Blue].map(Some));
        assert_eq!(picks(&materials[1]), [Pick::Blue, Pick::Red, Pick::Green].map(Some));
        assert!(materials[0].norm.is_some() && materials[2].map_roughness.is_some());
        assert!(materials[2].map_metallic.is_some() && materials[2].map_d.is_some());
        let (materials, _) = parsed(b"newmtl a\nmap_Kd -clamp on a.png\nmap_Ke -clamp off b.png");
        assert!(materials[0].map_kd.as_ref().is_some_and(|map| map.clamp));
        assert!(materials[0].map_ke.as_ref().is_some_and(|map| !map.clamp));
    }

    /// As Blender 3.4 writes a material without its option for PBR keys.
    #[test]
    fn blender_names_roughness_and_metalness_by_keys_of_phong() {
        let text = "# Blender 3.4.1 MTL File: 'None'\n# www.blender.org\n\nnewmtl tex\nKa 1.000000 1.000000 1.000000\nillum 2\n\
            map_Kd -o 0.1 0.2 0 -s 2 3 1 col.png\nmap_Ns -o 0.1 0.2 0 -s 2 3 1 rou.png\nmap_refl -o 0.1 0.2 0 -s 2 3 1 met.png\n";
        let (materials, warnings) = parsed(text.as_bytes());
        assert_eq!(warnings, [""; 0]);
        assert_eq!(materials[0].map_roughness.as_ref().unwrap().file, "rou.png");
        assert_eq!(materials[0].map_metallic.as_ref().unwrap().file, "met.png");
        assert!(materials[0].by_blender && materials[0].illum == Some(2));
    }

    #[test]
    fn keys() {
        let text = b"# comment\r\nKd 1 1 1\r\nnewmtl  first one\r\n\tKd 0.1 0.2 0.3\r\n Ks .5\r\nNs 50\r\nTr 0.25\r\nPm 1\r\nPr 0.5\r\n\
            map_Kd a b.png\r\nnorm n.png\r\nmap_Pm m.png\r\nmap_Pr r.png\r\nmap_Ka o.png\r\nmap_d d.png\r\nillum 2\r\nPs .25\r\naniso .5\r\nanisor .25\r\nnewmtl second\r\nd -halo 0.5";
        let (materials, warnings) = parsed(text);
        assert_eq!((materials.len(), warnings.len()), (2, 0));
        let first = &materials[0];
        assert_eq!(first.name, "first one");
        assert_eq!((first.kd, first.ks, first.ns), (Some([0.1, 0.2, 0.3]), Some([0.5; 3]), Some(50.0)));
        assert_eq!((first.dissolve, first.metallic, first.roughness), (Some(0.75), Some(1.0), Some(0.5)));
        assert_eq!((first.sheen, first.anisotropy, first.anisotropy_rotation), (Some(0.25), Some(0.5), Some(0.25)));
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
            ("map_bump -s 2 -o 1 2 3 -t 0 0 -bm 2 my stone.png", "my stone.png", 2.0),
            ("bump -clamp off -blendu off -mm 0 1 -imfchan l -BM 3 x\\y.png", "x\\y.png", 3.0),
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
