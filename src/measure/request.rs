//! The command line of `pbr-vr measure`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::pareto::Limit;
use crate::args::{parse_pixels_per_degree, parse_positive, parse_size};
use crate::asset::shipped;
use crate::precompute::check_face_size;
use crate::reference::metrics::PIXELS_PER_DEGREE;
use crate::scene::is_scene;
use crate::scene::staging::{Stage, Staging};
use crate::{Error, Result};

/// The name for all measurements.
const ALL: &str = "all";

/// The measurements, their inputs and the output folder.
#[derive(Args, Clone, Debug)]
pub struct MeasureRequest {
    /// Measurements by name; all of them if left out, or for `all`. Names that end in .toml, .gltf, .glb or .obj are scenes for
    /// `ladder` and `causes`.
    #[arg(value_name = "NAME|SCENE")]
    names: Vec<String>,
    /// The folder for CSV, JSON and charts; created if missing.
    #[arg(short, long, value_name = "DIR", required_unless_present = "list")]
    output: Option<PathBuf>,
    /// Write all results as JSON.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// A few sizes and parameters: minutes. The default.
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// All sizes and parameters, more texels: an hour on a CPU.
    #[arg(long)]
    pub full: bool,
    /// List what can be measured.
    #[arg(long)]
    pub list: bool,
    /// Size of the pictures of ladder and causes, in pixels.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub picture: Option<[u32; 2]>,
    /// Report the quickest settings of a ladder with an error (mean FLIP) of at most this.
    #[arg(long, value_name = "FLIP", value_parser = parse_positive, conflicts_with = "budget_ms")]
    tolerance: Option<f64>,
    /// Report the most accurate settings of a ladder that take at most this long a frame.
    #[arg(long, value_name = "MS", value_parser = parse_positive)]
    budget_ms: Option<f64>,
    /// Measure only settings of this kind in a ladder, such as light or samples; may be repeated. No setting is chosen
    /// from such a ladder later.
    #[arg(long = "setting", value_name = "KIND")]
    pub settings: Vec<String>,
    /// Pixels in a degree of visual angle for the ladder's FLIP: 67 on a monitor at arm's length, 11 in an HTC Vive.
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = parse_pixels_per_degree)]
    pub pixels_per_degree: f32,
    /// Measure with this panorama instead of the synthetic and shipped ones; may be repeated. A single one lights the scenes of
    /// ladder and causes, too.
    #[arg(long = "panorama", value_name = "FILE")]
    pub panoramas: Vec<PathBuf>,
    #[command(flatten)]
    stage: Stage,
    /// Measure this method only; may be repeated.
    #[arg(long = "method", value_name = "NAME")]
    pub methods: Vec<String>,
    /// Texels along the cube's faces; may be repeated.
    #[arg(long = "size", value_name = "N")]
    pub sizes: Vec<u32>,
    /// Also judge cube maps that cmgen wrote (-f exr --no-mirror) from the one panorama.
    #[arg(long, value_name = "DIR")]
    pub judge: Option<PathBuf>,
}

impl MeasureRequest {
    /// How the scenes of ladder and causes are staged.
    pub fn staging(&self) -> Staging {
        let panorama = if let [only] = &self.panoramas[..] { Some(only.clone()) } else { None };
        Staging { panorama, stage: self.stage.clone(), write_scene: None }
    }

    /// The folder for results.
    pub fn folder(&self) -> &Path {
        self.output.as_deref().unwrap_or(Path::new("."))
    }

    /// Whether a measurement was asked for.
    pub fn wants(&self, name: &str) -> bool {
        let mut names = self.names().peekable();
        names.peek().is_none() || names.any(|n| n == name || n == ALL)
    }

    fn names(&self) -> impl Iterator<Item = &String> {
        self.names.iter().filter(|name| !is_scene(name.as_ref()))
    }

    /// The scenes that were named; empty for some that are shipped.
    pub fn scenes(&self) -> Vec<PathBuf> {
        self.names.iter().filter(|name| is_scene(name.as_ref())).map(PathBuf::from).collect()
    }

    /// The limit for a choice from each ladder.
    pub fn limit(&self) -> Option<Limit> {
        self.tolerance.map(Limit::Tolerance).or(self.budget_ms.map(Limit::BudgetMs))
    }

    /// Refuses names of measurements and methods that are not known, and flags that none of the wanted measurements uses.
    pub fn check(&self, known: &[&'static str], methods: &[&str], settings: &[&str]) -> Result<()> {
        let all: Vec<&str> = known.iter().copied().chain([ALL]).collect();
        check_names("measurement", self.names(), &all)?;
        check_names("method", self.methods.iter(), methods)?;
        check_names("kind of setting", self.settings.iter(), settings)?;
        self.sizes.iter().try_for_each(|size| check_face_size(*size))?;
        if self.wants("ladder") && self.panoramas.len() > 1 {
            return Err(Error::Usage("a ladder is measured with one --panorama".into()));
        }
        if self.judge.is_some() && self.panoramas.len() != 1 {
            return Err(Error::Usage("--judge needs the one --panorama that its maps were made from".into()));
        }
        let (precompute, ladder) = (["precompute"].as_slice(), ["ladder"].as_slice());
        let (both, pictures) = (["precompute", "causes"].as_slice(), ["ladder", "causes"].as_slice());
        for (given, flag, users) in [
            (!self.scenes().is_empty(), "a scene", pictures),
            (!self.panoramas.is_empty(), "--panorama", [both, ladder].concat().as_slice()),
            (self.stage != Stage::default(), "a flag of the scene", pictures),
            (!self.sizes.is_empty(), "--size", both),
            (!self.methods.is_empty(), "--method", precompute),
            (self.judge.is_some(), "--judge", precompute),
            (self.picture.is_some(), "--picture", pictures),
            (!self.settings.is_empty(), "--setting", ladder),
            (self.tolerance.is_some(), "--tolerance", ladder),
            (self.budget_ms.is_some(), "--budget-ms", ladder),
        ] {
            if given && !users.iter().any(|name| self.wants(name)) {
                let users = users.join("` and `measure ");
                return Err(Error::Usage(format!("{flag} is for `measure {users}`; leave it out")));
            }
        }
        Ok(())
    }

    /// All files that are read.
    pub fn inputs(&self) -> Vec<PathBuf> {
        self.scenes().into_iter().chain(self.panoramas.iter().cloned()).collect()
    }

    /// The named scenes, or these of the shipped ones.
    pub fn scenes_or(&self, names: &[&str]) -> Result<Vec<PathBuf>> {
        let folder = shipped::folder()?.join("scenes");
        let shipped = names.iter().map(|name| folder.join(name).with_extension("toml")).collect();
        Ok(Some(self.scenes()).filter(|named| !named.is_empty()).unwrap_or(shipped))
    }

    /// The files of the named panoramas, or of the shipped ones.
    pub fn panorama_files(&self) -> Result<Vec<PathBuf>> {
        let folder = shipped::folder()?;
        let shipped = shipped::PANORAMAS.map(|name| folder.join(name)).into();
        Ok(Some(self.panoramas.clone()).filter(|named| !named.is_empty()).unwrap_or(shipped))
    }
}

fn check_names<'a>(what: &'static str, mut names: impl Iterator<Item = &'a String>, known: &[&str]) -> Result<()> {
    names.find(|name| !known.contains(&name.as_str())).map_or(Ok(()), |name| {
        Err(Error::UnknownName { what, name: name.clone(), known: known.iter().map(|k| (*k).to_owned()).collect() })
    })
}
