//! A ladder as a chart: error over time, its Pareto front, and every configuration by number.

use super::super::machine::Machine;
use super::super::plot::{Mark, Panel, Plot, Point, Series, YAxis};
use super::config::{Config, Ladder};
use super::reference::ReferenceFacts;

/// The chart of one scene.
pub fn plot(ladder: &Ladder) -> Plot {
    let mut configs: Vec<&Config> = ladder.configs.iter().collect();
    let is_dominated = |config: &Config| config.dominated_by.is_some();
    configs.sort_by(|a, b| is_dominated(a).cmp(&is_dominated(b)).then(a.ms.total_cmp(&b.ms)));
    let series = |name: &str, colour, mark| Series { name: name.into(), colour, mark, ..Series::default() };
    let [mut front, mut on_front, mut dominated, mut default] = [
        series("Pareto front", 1, Mark::Band),
        series("on it", 1, Mark::Circle),
        series("dominated", 6, Mark::Ring),
        series("default", 0, Mark::Circle),
    ];
    let heading = if ladder.configs.iter().any(|config| config.bake.is_some()) {
        "Settings (× the default's time, FLIP, processor time of the bake); dominated ones last:"
    } else {
        "Settings (× the default's time, FLIP); dominated ones last:"
    };
    let mut key = vec![(String::new(), heading.to_owned())];
    for (number, config) in (1..).zip(configs) {
        key.push((format!("{number}"), words(config)));
        let (ms, flip, noise) = (config.ms, config.error.flip, config.flip_noise);
        let unit = ms / config.ratio.median;
        let x_range = Some([config.ratio.low * unit, config.ratio.high * unit]);
        let y_range = Some([flip - noise, flip + noise]).filter(|[low, _]| *low > 0.0);
        if !is_dominated(config) {
            front.points.push(Point { x: ms, y: flip, ..Point::default() });
        }
        let own = match (config.is_default(), is_dominated(config)) {
            (true, _) => &mut default,
            (false, true) => &mut dominated,
            (false, false) => &mut on_front,
        };
        own.points.push(Point { x: ms, y: flip, x_range, y_range, label: format!("{number}") });
    }
    let x_label = match ladder.time.as_str() {
        "GPU time" => "GPU time of a frame, ms".to_owned(),
        ratio => format!("time of a frame, ms: the default's GPU time, times the ratio of {ratio}s"),
    };
    let panel = Panel {
        title: String::new(),
        x_label,
        y: YAxis::Log("error against the reference picture, mean FLIP".into()),
        series: vec![front, on_front, dominated, default],
        floor: Some(ladder.reference.floor.flip),
    };
    let title = format!("{}: time and error of every setting", ladder.scene);
    Plot { title, panels: vec![panel], caption: notes(ladder), key }
}

/// A configuration in few words, with its time and error.
fn words(config: &Config) -> String {
    let flags = config.name().trim_start_matches("--").replace(" --", ", ");
    let shorter = [
        ("irradiance-size", "irradiance"),
        ("cube-size", "cube"),
        ("drop-levels", "drop"),
        ("light baked, ", "baked, "),
    ];
    let flags = shorter.into_iter().fold(flags, |flags, (long, short)| flags.replace(long, short));
    let noise = if config.is_default() { String::new() } else { format!(" ± {:.5}", config.flip_noise) };
    let bake = config.bake.map_or_else(String::new, |bake| format!(", {:.0} s", bake.cpu_s.unwrap_or(bake.gpu_s)));
    format!("{flags} ({:.2}×, {:.4}{noise}{bake})", config.ratio.median, config.error.flip)
}

/// Notes on the measurement, for chart and table.
pub fn notes(ladder: &Ladder) -> Vec<String> {
    let Ladder { scene, machine: Machine { gpu, date, .. }, size: [width, height], reference, .. } = ladder;
    let ReferenceFacts { frames, fineness, pixels_per_degree, floor, .. } = reference;
    let mut notes = vec![
        format!(
            "{scene}: {gpu}, {date}, {width}×{height}. Level bars: first to last decile of the frames. Upright bars, and ±: \
             uncertainty of FLIP's difference from the default's."
        ),
        format!(
            "Reference picture: all light along all paths, {frames} frames of {fineness}×{fineness} times the pixels, display light (after the tone curve) \
             averaged; dashed: its own error, FLIP {:.5}. FLIP as seen with {pixels_per_degree} pixels per degree.",
            floor.flip
        ),
    ];
    notes.extend(ladder.notes.iter().cloned());
    notes
}
