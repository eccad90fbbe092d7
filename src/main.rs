//! The command line: one call per subcommand.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use pbr_vr::asset::Report;
use pbr_vr::error::printed;
use pbr_vr::gpu::GpuOptions;
use pbr_vr::measure::{self, Limit, MeasureRequest};
use pbr_vr::precompute::Cache;
use pbr_vr::reference::metrics::PIXELS_PER_DEGREE;
use pbr_vr::view::{
    self, BakeRequest, Choice, CompareRequest, NeedsRequest, RenderRequest, ViewRequest, doctor,
    parse_pixels_per_degree, parse_positive, parse_size,
};
use pbr_vr::{Result, complain, say};

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
    /// Compute all light again, and keep nothing for the next start.
    #[arg(long, global = true)]
    no_cache: bool,
    /// Say more; twice, much more.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

#[derive(Subcommand)]
enum Command {
    /// Show a scene: in a headset, else in a window, else as one picture.
    View(ViewRequest),
    /// Write a picture of a scene.
    Render(RenderRequest),
    /// Write what a panorama is precomputed to, as KTX2 files.
    Bake(BakeRequest),
    /// Measure speed against accuracy: tables and charts.
    Measure(Measure),
    /// Say what is modelled for a scene, what is left out, and why.
    Needs(NeedsRequest),
    /// Say how different two pictures are.
    Compare(CompareRequest),
    /// Say what this machine has, what is missing, and what to do.
    Doctor,
    /// Started by the program itself as a child process: whether a headset answers.
    #[command(name = view::PROBE_SUBCOMMAND, hide = true)]
    ProbeHeadset,
}

#[derive(Args)]
struct Measure {
    /// What to measure; everything if left out, or for `all`. What ends in .toml or .obj is a scene for `ladder` and
    /// `causes`.
    #[arg(value_name = "NAME|SCENE")]
    names: Vec<String>,
    /// The folder for CSV, JSON and charts; made if it is not there.
    #[arg(short, long, value_name = "DIR", required_unless_present = "list")]
    output: Option<PathBuf>,
    /// Write everything that was measured.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// A few sizes and parameters: minutes. The default.
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// All sizes and parameters, more texels: an hour on a CPU.
    #[arg(long)]
    full: bool,
    /// Say what can be measured.
    #[arg(long)]
    list: bool,
    /// Pixels of the pictures of ladder and causes.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    picture: Option<[u32; 2]>,
    /// Say which settings of a ladder are the quickest with an error (mean FLIP) of at most this.
    #[arg(long, value_name = "FLIP", value_parser = parse_positive, conflicts_with = "budget_ms")]
    tolerance: Option<f64>,
    /// Say which settings of a ladder are the most accurate that take at most so long a frame.
    #[arg(long, value_name = "MS", value_parser = parse_positive)]
    budget_ms: Option<f64>,
    /// Pixels in a degree of visual angle as the ladder's FLIP sees them: 67 on a monitor at arm's length, 11 in an HTC Vive.
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = parse_pixels_per_degree)]
    pixels_per_degree: f32,
    /// Measure with this panorama instead of the synthetic and shipped ones; may be repeated.
    #[arg(long = "panorama", value_name = "FILE")]
    panoramas: Vec<PathBuf>,
    /// Measure this method alone; may be repeated.
    #[arg(long = "method", value_name = "NAME")]
    methods: Vec<String>,
    /// Texels along the cube's faces; may be repeated.
    #[arg(long = "size", value_name = "N")]
    sizes: Vec<u32>,
    /// Also judge cube maps that cmgen wrote (-f exr --no-mirror) from the one panorama.
    #[arg(long, value_name = "DIR")]
    judge: Option<PathBuf>,
}

fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| refuse(&error));
    start_log(cli.global.verbose);
    match run(cli).and_then(|()| printed()) {
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

fn run(cli: Cli) -> Result<()> {
    let gpu = GpuOptions { name: cli.global.gpu.as_deref(), validate: cli.global.validate, ..GpuOptions::default() };
    let cache = if cli.global.no_cache { None } else { Cache::of_user() };
    let cache = cache.as_ref();
    match cli.command.unwrap_or_else(|| Command::View(ViewRequest::default())) {
        Command::View(mut request) => {
            request.check()?;
            if let Some(limit) = chosen(request.choice) {
                request.look = measure::choose(&request.scene()?, limit, gpu, cache)?;
            }
            request.run(gpu, cache)
        }
        Command::Render(mut request) => {
            request.check()?;
            if let Some(limit) = chosen(request.choice) {
                request.look = measure::choose(&request.scene, limit, gpu, cache)?;
            }
            request.run(gpu, cache)
        }
        Command::Bake(request) => request.run(gpu, cache),
        Command::Measure(measure) => run_measure(&measure, gpu, cache),
        Command::Needs(request) => view::needs(&request, &Report::to_terminal()),
        Command::Compare(request) => view::compare(&request),
        Command::Doctor => doctor::run(),
        Command::ProbeHeadset => {
            view::answer_probe();
            Ok(())
        }
    }
}

fn chosen(Choice { tolerance, budget_ms }: Choice) -> Option<Limit> {
    tolerance.map(Limit::Tolerance).or(budget_ms.map(Limit::BudgetMs))
}

fn run_measure(args: &Measure, gpu: GpuOptions<'_>, cache: Option<&Cache>) -> Result<()> {
    if args.list {
        measure::MEASUREMENTS.iter().for_each(|m| say!("{:12} {}", m.name, m.what));
        say!("methods      {}", measure::METHODS.join(", "));
        return Ok(());
    }
    let (scenes, names): (Vec<String>, Vec<String>) = args.names.iter().cloned().partition(|name| is_scene(name));
    let request = MeasureRequest {
        names: &names,
        scenes: &scenes.into_iter().map(PathBuf::from).collect::<Vec<_>>(),
        picture: args.picture,
        limit: chosen(Choice { tolerance: args.tolerance, budget_ms: args.budget_ms }),
        pixels_per_degree: args.pixels_per_degree,
        cache,
        output: args.output.as_deref().unwrap_or(std::path::Path::new(".")),
        full: args.full,
        panoramas: &args.panoramas,
        methods: &args.methods,
        sizes: &args.sizes,
        judge: args.judge.as_deref(),
        json: args.json.as_deref(),
    };
    measure::run(&request, gpu, &Report::to_terminal())
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
