//! The lines of an OBJ file as `tobj` reads them rightly, and what it does not read.
//!
//! `tobj` reads lines like `l 1 2 3` as triangles, overflows on relative indices before the start of the file, reads f32,
//! and knows neither smoothing groups nor files in which only some positions have a colour.

use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;

use super::file;
use super::mesh::far_centre;
use crate::error::{MAX_QUOTED, shortened};
use crate::{Error, Result};

/// 1.5 GB of corners. The thesis's largest scene has 262,267.
const MAX_TRIANGLES: usize = 16 << 20;

/// The lines of a file that `tobj` needs, after one additional line: the others are empty, so that line numbers stay.
pub struct ObjText {
    pub text: String,
    /// Line and file name of each `mtllib`.
    pub libraries: Vec<(usize, String)>,
    /// Line and name of each `usemtl`.
    pub uses: Vec<(usize, String)>,
    /// The smoothing group of each face, 0 for none; empty if the file names none at all.
    pub smoothing: Vec<u32>,
    /// What was subtracted from all positions, which are far from the origin.
    pub moved: Option<DVec3>,
    /// Whether all positions are written with a colour, 0 to 1: some has one that is not white.
    pub coloured: bool,
    faces: usize,
}

impl ObjText {
    /// Takes a file apart.
    ///
    /// # Errors
    /// Too many triangles; an index before the file's start.
    pub fn new(path: &Path, bytes: &[u8]) -> Result<Self> {
        let (source, found) = Self::read(path, bytes, Counts::default())?;
        let (centre, colour_scale) = (found.far_centre(), found.colour_scale());
        if centre.is_none() && colour_scale.is_none() {
            return Ok(source);
        }
        let counts = Counts { centre: centre.unwrap_or_default(), colour_scale, ..Counts::default() };
        let (source, _) = Self::read(path, bytes, counts)?;
        Ok(Self { moved: centre, coloured: colour_scale.is_some(), ..source })
    }

    /// Reads all lines; returns what they define, too.
    fn read(path: &Path, bytes: &[u8], mut counts: Counts) -> Result<(Self, Counts)> {
        let mut source = Self {
            // `tobj` gets all materials with this line, so that libraries may be named anywhere.
            text: "mtllib all\n".into(),
            libraries: Vec::new(),
            uses: Vec::new(),
            smoothing: Vec::new(),
            moved: None,
            coloured: false,
            faces: 0,
        };
        source.text.reserve(bytes.len());
        let mut joined = String::new();
        let mut last = 0;
        for (index, line) in file::lines(bytes).enumerate() {
            // A comment goes on to the end of its own line only.
            let line = if line.trim_start().starts_with('#') { "" } else { line.trim() };
            last = index + 1;
            if let Some(start) = line.strip_suffix('\\') {
                joined.push_str(start);
                joined.push(' ');
                source.text.push('\n');
                continue;
            }
            if joined.is_empty() {
                source.add_line(path, index + 1, line, &mut counts)?;
            } else {
                joined.push_str(line);
                source.add_line(path, index + 1, &std::mem::take(&mut joined), &mut counts)?;
            }
            source.text.push('\n');
        }
        // The last line may end in a continuation, too.
        source.add_line(path, last, &joined, &mut counts)?;
        Ok((source, counts))
    }

    fn add_line(&mut self, path: &Path, number: usize, line: &str, counts: &mut Counts) -> Result<()> {
        let (key, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let data = || line.split('#').next().unwrap_or(line).trim_end();
        match key {
            "v" => self.add_position(data(), counts),
            "vt" | "vn" => {
                counts.data[if key == "vt" { 1 } else { 2 }] += 1;
                self.text.push_str(data());
            }
            "f" => self.add_face(path, number, data(), counts)?,
            "s" => self.set_group(rest, counts),
            "o" | "g" => {
                self.text.push_str("o ");
                self.text.push_str(rest.trim());
            }
            "usemtl" => {
                self.uses.push((number, rest.trim().to_owned()));
                // `tobj` rejects an empty name; no material has this one.
                self.text.push_str(if rest.trim().is_empty() { "usemtl \u{0}" } else { "usemtl " });
                self.text.push_str(rest.trim());
            }
            "mtllib" => self.libraries.push((number, rest.trim().to_owned())),
            _ => {}
        }
        Ok(())
    }

    /// A position: three numbers, a weight after them, or a colour after either.
    fn add_position(&mut self, line: &str, counts: &mut Counts) {
        counts.data[0] += 1;
        let words: Vec<&str> = line.split_ascii_whitespace().skip(1).take(8).collect();
        let own = match words.len() {
            7 => 4,
            count if count > 4 => 3,
            count => count,
        };
        let colour = match words[own..] {
            [r, g, b, ..] => [r, g, b].map(|word| word.parse().ok().filter(|c: &f32| c.is_finite()).unwrap_or(1.0)),
            _ => [1.0; 3],
        };
        counts.is_coloured |= colour != [1.0; 3];
        counts.brightest = colour.into_iter().fold(counts.brightest, f32::max);
        counts.has_fractions |= colour.iter().any(|c| c.fract() != 0.0);
        let numbers: Vec<f64> = words.iter().take(3).filter_map(|word| word.parse().ok()).collect();
        let Some(position) = <[f64; 3]>::try_from(numbers).ok().map(DVec3::from).filter(|p| p.is_finite()) else {
            // `tobj` says what is wrong with it.
            self.text.push_str(line);
            return;
        };
        counts.low = counts.low.min(position);
        counts.high = counts.high.max(position);
        self.text.push('v');
        if counts.centre == DVec3::ZERO && counts.colour_scale.is_none() {
            words[..own].iter().for_each(|word| self.text.extend([" ", word]));
        } else {
            let DVec3 { x, y, z } = position - counts.centre;
            // Writing to a string cannot fail.
            let _ = write!(self.text, " {x} {y} {z}");
            if let Some(scale) = counts.colour_scale {
                let [r, g, b] =
                    if words.len() < own + 3 { [1.0; 3] } else { colour.map(|c| (c * scale).clamp(0.0, 1.0)) };
                let _ = write!(self.text, " {r} {g} {b}");
            }
        }
    }

    /// A face; points and lines, which some programs write as faces, are left out.
    fn add_face(&mut self, path: &Path, number: usize, line: &str, counts: &mut Counts) -> Result<()> {
        let corners = line.split_ascii_whitespace().skip(1).count();
        counts.triangles += corners.saturating_sub(2);
        if counts.triangles > MAX_TRIANGLES {
            let (size, limit) = (format!("over {MAX_TRIANGLES} triangles"), format!("{MAX_TRIANGLES} triangles"));
            return Err(Error::TooLarge { path: path.into(), what: "model", size, limit });
        }
        counts.check_face(path, number, line)?;
        if corners < 3 {
            return Ok(());
        }
        self.text.push_str(line);
        self.faces += 1;
        if let Some(group) = counts.group {
            self.smoothing.push(group);
        }
        Ok(())
    }

    /// `s off`, `s 0` or the number of a group.
    fn set_group(&mut self, rest: &str, counts: &mut Counts) {
        let word = rest.split_ascii_whitespace().next().unwrap_or("0");
        // Faces before the first group belong to none that is numbered.
        if counts.group.is_none() {
            self.smoothing = vec![u32::MAX; self.faces];
        }
        counts.group = Some(if word.eq_ignore_ascii_case("on") { 1 } else { word.parse().unwrap_or(0) });
    }

    /// Line number in the user's file, and words, of each line that starts with `key`.
    pub fn lines<'a>(&'a self, key: &'a str) -> impl Iterator<Item = (usize, std::str::SplitWhitespace<'a>)> {
        self.text.lines().enumerate().filter_map(move |(number, line)| {
            let mut words = line.split_whitespace();
            (words.next() == Some(key)).then_some((number, words))
        })
    }
}

/// What the lines so far have defined.
struct Counts {
    /// Positions, texture coordinates, normals.
    data: [usize; 3],
    triangles: usize,
    /// The current smoothing group; `None` before the first.
    group: Option<u32>,
    /// Subtracted from positions.
    centre: DVec3,
    low: DVec3,
    high: DVec3,
    /// Whether a position has another colour than white, the largest number of all colours, and whether some is not whole.
    is_coloured: bool,
    brightest: f32,
    has_fractions: bool,
    /// Multiplies colours, which are written; `None`: they are not.
    colour_scale: Option<f32>,
}

impl Default for Counts {
    fn default() -> Self {
        let (low, high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        Self {
            data: [0; 3],
            triangles: 0,
            group: None,
            centre: DVec3::ZERO,
            low,
            high,
            is_coloured: false,
            brightest: 0.0,
            has_fractions: false,
            colour_scale: None,
        }
    }
}

impl Counts {
    /// The middle of all positions, if it is so far from the origin that f32 would distort the model.
    fn far_centre(&self) -> Option<DVec3> {
        far_centre(self.low, self.high)
    }

    /// What colours are multiplied by, where there are any: whole numbers above 1 are bytes.
    fn colour_scale(&self) -> Option<f32> {
        let are_bytes = self.brightest > 1.0 && !self.has_fractions;
        self.is_coloured.then_some(if are_bytes { 1.0 / 255.0 } else { 1.0 })
    }

    /// Rejects indices on which `tobj`'s sums would overflow; the others it checks itself.
    fn check_face(&self, path: &Path, number: usize, line: &str) -> Result<()> {
        for corner in line.split_ascii_whitespace().skip(1) {
            for (index, count) in corner.split('/').zip(self.data) {
                let safe = -(count as i64)..=i64::from(u32::MAX);
                if index.parse().is_ok_and(|i: i64| !safe.contains(&i)) {
                    let index = shortened(index, MAX_QUOTED);
                    return Err(broken(path, format!("line {number}: index {index} of a face is not among {count}")));
                }
            }
        }
        Ok(())
    }
}

/// The error of a model that is not as it should be.
pub fn broken(path: &Path, problem: String) -> Error {
    let remedy = "export it again as OBJ with triangles";
    Error::Broken { path: path.into(), what: "OBJ model", problem, remedy }
}
