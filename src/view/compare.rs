//! `compare`: how different two pictures are, as numbers and maps.

use std::path::PathBuf;

use clap::Args;

use crate::args::{parse_pixels_per_degree, write_json};
use crate::asset::Outputs;
use crate::asset::comparison::compare_seen;
use crate::asset::picture::Picture;
use crate::reference::metrics::PIXELS_PER_DEGREE;
use crate::{Error, Result, say};

/// The files that `--maps` writes.
const MAPS: [&str; 3] = ["a.png", "b.png", "flip.png"];

/// Two pictures and the outputs of their comparison.
#[derive(Args, Clone, Debug)]
pub struct CompareRequest {
    pub a: PathBuf,
    pub b: PathBuf,
    /// Pixels in a degree of visual angle as FLIP sees them: 67 on a monitor at arm's length, 11 in an HTC Vive.
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = parse_pixels_per_degree)]
    pub pixels_per_degree: f32,
    /// Write a.png and b.png, as a viewer sees them, and flip.png, bright where they differ.
    #[arg(long, value_name = "DIR")]
    pub maps: Option<PathBuf>,
    /// Write the numbers.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Compares two pictures and prints the result.
///
/// # Errors
/// A picture that cannot be read or has another size than the other; an output that cannot be written.
pub fn compare(request: &CompareRequest) -> Result<()> {
    let mut outputs = Outputs::of([&request.a, &request.b]);
    if let Some(folder) = &request.maps {
        outputs.folder(folder, &MAPS)?;
    }
    outputs.file_if(request.json.as_deref())?;
    let (a, b) = (Picture::read(&request.a)?, Picture::read(&request.b)?);
    let comparison = compare_seen(&a, &b, request.pixels_per_degree)?;
    say!(
        "FLIP          mean {:.4}, largest {:.4}, at {} pixels per degree",
        comparison.flip_mean,
        comparison.flip_max,
        comparison.flip_pixels_per_degree
    );
    say!("relative MSE  {:.3e}", comparison.relative_mse);
    say!("relative L1   {:.3e}", comparison.relative_l1);
    say!(
        "error         mean {:.3e}, largest {:.3e} at {:?}",
        comparison.mean_error,
        comparison.max_error,
        comparison.max_error_at
    );
    if let Some(folder) = &request.maps {
        std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
        let maps = [a.to_display(0.0), b.to_display(0.0), comparison.flip_map()];
        MAPS.iter().zip(maps).try_for_each(|(name, map)| map.write(&folder.join(name)))?;
    }
    write_json(request.json.as_deref(), &comparison)
}
