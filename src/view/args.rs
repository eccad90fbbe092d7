//! Command-line arguments that choose settings by their measured cost or error.

use clap::{Args, Id};

use crate::args::parse_positive;
use crate::render::RenderSettings;

/// Settings chosen by cost or error from the measured ladder of the scene.
#[derive(Args, Clone, Copy, Debug, Default, PartialEq)]
#[group(multiple = false, conflicts_with_all = setting_flags())]
pub struct Choice {
    /// Choose the quickest settings whose error (mean FLIP) was at most this when `measure ladder SCENE` measured them here.
    #[arg(long, value_name = "FLIP", value_parser = parse_positive)]
    pub tolerance: Option<f64>,
    /// Choose the most accurate settings whose frames took at most this long when `measure ladder SCENE` measured them here.
    #[arg(long, value_name = "MS", value_parser = parse_positive)]
    pub budget_ms: Option<f64>,
}

/// All flags of the settings; a clap group does not include flattened arguments.
fn setting_flags() -> Vec<Id> {
    RenderSettings::augment_args(clap::Command::new("settings"))
        .get_arguments()
        .map(|flag| flag.get_id().clone())
        .collect()
}

/// Parses arguments as the command line would; for tests.
#[cfg(test)]
pub fn parsed<T: Args>(arguments: &[&str]) -> std::result::Result<T, clap::Error> {
    let command = T::augment_args(clap::Command::new("test").no_binary_name(true));
    T::from_arg_matches(&command.try_get_matches_from(arguments)?)
}
