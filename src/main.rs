//! The command line: one call per subcommand.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};

use pbr_vr::asset::file::write_atomically;
use pbr_vr::asset::picture::{Picture, compare_seen};
use pbr_vr::asset::{Outputs, Report, Storage, TextureOptions, shipped};
use pbr_vr::error::printed;
use pbr_vr::gpu::GpuOptions;
use pbr_vr::measure::{self, Limit, MeasureRequest};
use pbr_vr::precompute::{Cache, Options};
use pbr_vr::reference::metrics::{PIXELS_PER_DEGREE, PIXELS_PER_DEGREE_RANGE};
use pbr_vr::scene::load::files as scene_files;
use pbr_vr::scene::needs::findings::Findings;
use pbr_vr::view::{self, BakeRequest, HiddenAreaV, Mirror, QualityOptions, RenderRequest, ViewRequest, doctor};
use pbr_vr::{Error, Result, complain, say};

/// Physically based materials under real light, in a headset, a window or a picture.
#[derive(Parser)]
#[command(version, about)]
struct Cli {
    #[command(flatten)]
    global: Global,
    /// Without a subcommand: `view`.
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Args)]
struct Global {
    /// Use the GPU whose name contains this.
    #[arg(long, global = true, value_name = "NAME")]
    gpu: Option<String>,
    /// Have every Vulkan call checked; any message is a failure.
    #[arg(long, global = true)]
    validate: bool,
    /// Compute all light anew, and keep nothing for the next start.
    #[arg(long, global = true)]
    no_cache: bool,
    /// Say more; twice, much more.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

#[derive(Subcommand)]
enum Command {
    /// Show a scene: in a headset, else in a window, else as one picture.
    View(View),
    /// Write a picture of a scene.
    Render(Render),
    /// Write what a panorama is precomputed to, as KTX2 files.
    Bake(Bake),
    /// Measure speed against accuracy: tables and charts.
    Measure(MeasureRequest),
    /// Say what is modelled for a scene, what is left out, and why.
    Needs(NeedsArgs),
    /// Say how different two pictures are.
    Compare(Compare),
    /// Say what this machine has, what is missing, and what to do.
    Doctor,
    /// What a process of its own is asked: whether a headset answers.
    #[command(name = view::PROBE_SUBCOMMAND, hide = true)]
    ProbeHeadset,
}

#[derive(Args, Default)]
struct View {
    /// A scene description (.toml) or a model (.obj); the demo if left out.
    scene: Option<PathBuf>,
    /// Where to show it.
    #[arg(long, value_enum, default_value_t)]
    on: On,
    /// Stop after this many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,
    /// Which way v points in the headset's hidden area; `off` draws that, too.
    #[arg(long, value_enum, default_value_t)]
    hidden_area: HiddenAreaV,
    /// What the window beside a headset shows.
    #[arg(long, value_enum, default_value_t)]
    mirror: Mirror,
    /// Write times and facts of the run, as JSON.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    look: QualityOptions,
    #[command(flatten)]
    choice: Choice,
}

/// Settings by what they cost or give, instead of each by itself.
#[derive(Args, Default)]
#[group(multiple = false, conflicts_with_all = look_flags())]
struct Choice {
    /// Choose the quickest settings whose error (mean FLIP) was at most this when `measure ladder SCENE` measured them here.
    #[arg(long, value_name = "FLIP", value_parser = parse_positive)]
    tolerance: Option<f64>,
    /// Choose the most accurate settings whose frames took at most this long when `measure ladder SCENE` measured them here.
    #[arg(long, value_name = "MS", value_parser = parse_positive)]
    budget_ms: Option<f64>,
}

/// Every flag of a look: a group of clap's has no members that are flattened in.
fn look_flags() -> Vec<clap::Id> {
    QualityOptions::augment_args(clap::Command::new("look")).get_arguments().map(|flag| flag.get_id().clone()).collect()
}

impl Choice {
    /// The look: as it is, or chosen from the scene's ladder.
    fn look(
        &self,
        look: QualityOptions,
        scene: &std::path::Path,
        gpu: GpuOptions<'_>,
        cache: Option<&Cache>,
    ) -> Result<QualityOptions> {
        limit(self.tolerance, self.budget_ms).map_or(Ok(look), |limit| measure::choose(scene, limit, gpu, cache))
    }
}

fn limit(tolerance: Option<f64>, budget_ms: Option<f64>) -> Option<Limit> {
    tolerance.map(Limit::Tolerance).or(budget_ms.map(Limit::BudgetMs))
}

#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum On {
    #[default]
    Auto,
    Headset,
    Window,
}

#[derive(Args)]
struct Render {
    /// A scene description (.toml) or a model (.obj).
    scene: PathBuf,
    /// The picture: .png as a viewer sees it, .exr as linear radiance.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size)]
    size: [u32; 2],
    /// One of the scene's cameras; the first if left out.
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Write FILE-left and FILE-right, an eye each.
    #[arg(long)]
    stereo: bool,
    /// Draw this many frames, for times; the last is written. With `--shading reference`, average them. 1 if left out, or
    /// 256 to average.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,
    /// Write times and facts.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    look: QualityOptions,
    #[command(flatten)]
    choice: Choice,
}

#[derive(Args)]
struct NeedsArgs {
    /// A scene description (.toml) or a model (.obj).
    scene: PathBuf,
    /// Write the decisions, material by material.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Args)]
struct Bake {
    /// A Radiance (.hdr) or OpenEXR (.exr) panorama.
    panorama: PathBuf,
    /// The folder for irradiance.ktx2, specular.ktx2 and brdf.ktx2; made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Texels along a face of the largest specular levels: a power of two from 16 to 1024.
    #[arg(long, value_name = "N", default_value_t = Options::default().face_size)]
    size: u32,
    /// Write times and facts.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Args)]
struct Compare {
    a: PathBuf,
    b: PathBuf,
    /// Pixels in a degree of visual angle as FLIP sees them: 67 on a monitor at arm's length, 11 in an HTC Vive.
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = parse_pixels_per_degree)]
    pixels_per_degree: f32,
    /// Write a.png and b.png, as a viewer sees them, and flip.png, bright where they differ.
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// Write the numbers.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| refuse(&error));
    start_log(cli.global.verbose);
    match run(&cli).and_then(|()| printed()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain!("pbr-vr: {error}");
            view::console::hold();
            ExitCode::from(error.exit_code())
        }
    }
}

/// Says what is wrong with the command line, or what was asked about it, and ends.
fn refuse(error: &clap::Error) -> ! {
    // Where it cannot be printed, nothing can be said.
    let _ = error.print();
    let scene = std::env::args().nth(1).filter(|first| is_scene(first));
    if let (clap::error::ErrorKind::InvalidSubcommand, Some(scene)) = (error.kind(), scene) {
        complain!("pbr-vr: to see a scene: pbr-vr view {scene}");
    }
    std::process::exit(error.exit_code())
}

/// Whether a name is that of a scene.
fn is_scene(name: &str) -> bool {
    [".toml", ".obj"].iter().any(|end| name.to_lowercase().ends_with(end))
}

fn run(cli: &Cli) -> Result<()> {
    let gpu = GpuOptions { name: cli.global.gpu.as_deref(), validate: cli.global.validate, ..GpuOptions::default() };
    let cache = if cli.global.no_cache { None } else { Cache::of_user() };
    let cache = cache.as_ref();
    let view = View::default();
    match cli.command.as_ref().unwrap_or(&Command::View(view)) {
        Command::View(view) => run_view(view, gpu, cache),
        Command::Render(render) => run_render(render, gpu, cache),
        Command::Bake(bake) => run_bake(bake, gpu, cache),
        Command::Measure(request) => measure::run(request, gpu, cache, &Report::to_terminal()),
        Command::Needs(needs) => run_needs(needs),
        Command::Compare(compare) => run_compare(compare),
        Command::Doctor => doctor::run(),
        Command::ProbeHeadset => {
            view::answer_probe();
            Ok(())
        }
    }
}

fn run_view(args: &View, gpu: GpuOptions<'_>, cache: Option<&Cache>) -> Result<()> {
    view::console::step_aside();
    let demo = || Ok::<_, Error>(shipped::folder()?.join(shipped::DEMO));
    let scene = args.scene.clone().map_or_else(demo, Ok)?;
    Outputs::of(scene_files(&scene)).file_if(args.report.as_deref())?;
    let request = ViewRequest {
        scene: Some(&scene),
        frames: args.frames,
        look: args.choice.look(args.look, &scene, gpu, cache)?,
        cache,
        hidden_area: args.hidden_area,
        mirror: args.mirror,
        report: args.report.as_deref(),
        no_headset: None,
    };
    match args.on {
        On::Auto => view::auto(&request, gpu),
        On::Window => view::window(&request, gpu),
        On::Headset => view::headset(&request, gpu),
    }
}

fn run_render(args: &Render, gpu: GpuOptions<'_>, cache: Option<&Cache>) -> Result<()> {
    let mut outputs = Outputs::of(scene_files(&args.scene));
    view::picture_files(&args.output, args.stereo).iter().try_for_each(|file| outputs.file(file))?;
    outputs.file_if(args.json.as_deref())?;
    let look = args.choice.look(args.look, &args.scene, gpu, cache)?;
    let request = RenderRequest {
        scene: &args.scene,
        output: &args.output,
        size: args.size,
        camera: args.camera.as_deref(),
        stereo: args.stereo,
        frames: args.frames.unwrap_or(look.shading.default_frames()),
        look,
        cache,
    };
    let facts = view::render(&request, gpu, &Report::to_terminal())?;
    if let Some(error) = &facts.standard_error {
        say!("pbr-vr: {error}");
    }
    match &args.json {
        Some(path) => write_json(path, &facts),
        None => Ok(()),
    }
}

fn run_needs(args: &NeedsArgs) -> Result<()> {
    Outputs::of(scene_files(&args.scene)).file_if(args.json.as_deref())?;
    // Nothing is drawn: compressing would only take time.
    let textures = TextureOptions { storage: Storage::Raw, ..TextureOptions::default() };
    let findings = Findings::of(&view::load_scene(&args.scene, &textures, &Report::to_terminal())?);
    say!("{}: {} triangles, {}", args.scene.display(), findings.triangles, findings.lines().join("\n  "));
    match &args.json {
        Some(path) => write_json(path, &findings),
        None => Ok(()),
    }
}

fn run_bake(args: &Bake, gpu: GpuOptions<'_>, cache: Option<&Cache>) -> Result<()> {
    let mut outputs = Outputs::of([&args.panorama]);
    outputs.folder(&args.output, &view::BAKED)?;
    outputs.file_if(args.json.as_deref())?;
    let request = BakeRequest { panorama: &args.panorama, folder: &args.output, face_size: args.size, cache };
    let facts = view::bake(&request, gpu, &Report::to_terminal())?;
    facts.files.iter().for_each(|file| say!("{file}"));
    match &args.json {
        Some(path) => write_json(path, &facts),
        None => Ok(()),
    }
}

fn run_compare(args: &Compare) -> Result<()> {
    let mut outputs = Outputs::of([&args.a, &args.b]);
    if let Some(folder) = &args.maps {
        outputs.folder(folder, &MAPS)?;
    }
    outputs.file_if(args.json.as_deref())?;
    let (a, b) = (Picture::read(&args.a)?, Picture::read(&args.b)?);
    let comparison = compare_seen(&a, &b, args.pixels_per_degree)?;
    say!(
        "FLIP          mean {:.4}, largest {:.4}, at {} pixels per degree",
        comparison.flip_mean,
        comparison.flip_max,
        comparison.flip_pixels_per_degree
    );
    say!("relative MSE  {:.3e}", comparison.relative_mse);
    say!(
        "error         mean {:.3e}, largest {:.3e} at {:?}",
        comparison.mean_error,
        comparison.max_error,
        comparison.max_error_at
    );
    if let Some(folder) = &args.maps {
        std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
        let maps = [a.to_display(0.0), b.to_display(0.0), comparison.flip_map()];
        MAPS.iter().zip(maps).try_for_each(|(name, map)| map.write(&folder.join(name)))?;
    }
    match &args.json {
        Some(path) => write_json(path, &comparison),
        None => Ok(()),
    }
}

/// What `compare --maps` writes.
const MAPS: [&str; 3] = ["a.png", "b.png", "flip.png"];

fn write_json(path: &std::path::Path, value: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::write(path)(e.into()))?;
    write_atomically(path, (text + "\n").as_bytes())
}

fn parse_size(text: &str) -> std::result::Result<[u32; 2], String> {
    let problem = || format!("`{text}` is not WIDTHxHEIGHT in pixels, such as 1280x720");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(problem)?;
    let side = |s: &str| s.parse().ok().filter(|n| *n > 0).ok_or_else(problem);
    Ok([side(width)?, side(height)?])
}

fn parse_positive(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "a number above 0".into())
}

fn parse_pixels_per_degree(text: &str) -> std::result::Result<f32, String> {
    let (least, most) = (PIXELS_PER_DEGREE_RANGE.start(), PIXELS_PER_DEGREE_RANGE.end());
    let number = text.parse().ok().filter(|number| PIXELS_PER_DEGREE_RANGE.contains(number));
    number.ok_or_else(|| format!("a number from {least} to {most}"))
}

fn start_log(verbose: u8) {
    use tracing_subscriber::filter::{LevelFilter, Targets};
    use tracing_subscriber::layer::SubscriberExt as _;
    use tracing_subscriber::util::SubscriberInitExt as _;
    // What libraries say about the desktop is of use only to who looks for a defect.
    let (ours, others) = match verbose {
        0 => (LevelFilter::WARN, LevelFilter::ERROR),
        1 => (LevelFilter::INFO, LevelFilter::WARN),
        _ => (LevelFilter::DEBUG, LevelFilter::DEBUG),
    };
    // Windows' console shows colours once it is asked to; where it cannot, their codes would be rubbish on the screen.
    let console_shows_colours = anstyle_query::windows::enable_ansi_colors() != Some(false);
    let ansi = std::io::IsTerminal::is_terminal(&std::io::stderr()) && console_shows_colours;
    let layer = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(ansi)
        .without_time()
        .with_target(false)
        // It would print them by `eprintln!`, which panics.
        .log_internal_errors(false);
    let levels = Targets::new().with_default(others).with_target("pbr_vr", ours);
    tracing_subscriber::registry().with(layer).with(levels).init();
}
