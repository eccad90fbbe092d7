//! The command line: one call per subcommand.

use std::io::ErrorKind;
use std::num::NonZero;
use std::process::ExitCode;
use std::sync::mpsc::channel;

use clap::{Parser, Subcommand};

use pbr_vr::context::GlobalOptions;
use pbr_vr::error::printed;
use pbr_vr::measure::{self, Limit, MeasureRequest};
use pbr_vr::view::{self, BakeRequest, Choice, CompareRequest, NeedsRequest, RenderRequest, ViewRequest, doctor};
use pbr_vr::{Error, Result, complain};

/// Physically based materials under real light, in a headset, a window or a picture.
#[derive(Parser)]
#[command(version, about)]
struct Cli {
    #[command(flatten)]
    global: GlobalOptions,
    /// Without a subcommand: `view`.
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Show a scene: in a headset, else in a window, else as one picture.
    View(ViewRequest),
    /// Write a picture of a scene.
    Render(RenderRequest),
    /// Precompute a panorama's light and write it as KTX2 files.
    Bake(BakeRequest),
    /// Measure speed against accuracy: tables and charts.
    Measure(MeasureRequest),
    /// Say what is modelled for a scene, what is left out, and why.
    Needs(NeedsRequest),
    /// Say how different two pictures are.
    Compare(CompareRequest),
    /// Say what this machine has, what is missing, and what to do.
    Doctor,
    /// Internal: looks for a headset in a child process.
    #[command(name = view::PROBE_SUBCOMMAND, hide = true)]
    ProbeHeadset,
}

fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| refuse(&error));
    start_log(cli.global.verbose);
    match start_threads().and_then(|()| run(cli)).and_then(|()| printed()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain!("pbr-vr: {error}");
            view::console::hold();
            ExitCode::from(error.exit_code())
        }
    }
}

/// Prints a usage error, or the help that was asked for, and exits.
fn refuse(error: &clap::Error) -> ! {
    // If printing fails, there is nowhere to report it.
    let _ = error.print();
    let scene = std::env::args().nth(1).filter(|first| pbr_vr::scene::is_scene(first.as_ref()));
    if let (clap::error::ErrorKind::InvalidSubcommand, Some(scene)) = (error.kind(), scene) {
        complain!("pbr-vr: to see a scene: pbr-vr view {scene}");
    }
    std::process::exit(error.exit_code())
}

fn run(cli: Cli) -> Result<()> {
    let setup = cli.global.setup();
    match cli.command.unwrap_or_else(|| Command::View(ViewRequest::default())) {
        Command::View(mut request) => {
            request.check()?;
            if let Some(limit) = chosen(request.choice) {
                request.settings = measure::choose(&request.scene()?, limit, &setup)?;
            }
            request.measurements = Some(measure::measured);
            view::show(&request, &setup)
        }
        Command::Render(mut request) => {
            request.check()?;
            if let Some(limit) = chosen(request.choice) {
                request.settings = measure::choose(&request.scene, limit, &setup)?;
            }
            match request.sequence_files()? {
                Some(_) => view::render_sequence(&request, &setup),
                None => request.run(&setup),
            }
        }
        Command::Bake(request) => request.run(&setup),
        Command::Measure(request) => measure::run(&request, &setup),
        Command::Needs(request) => view::needs(&request, &setup.report),
        Command::Compare(request) => view::compare(&request),
        Command::Doctor => doctor::run(),
        Command::ProbeHeadset => {
            view::answer_probe();
            Ok(())
        }
    }
}

/// The threads that share parallel work: as many as `RAYON_NUM_THREADS` says, or as there are cores.
fn wanted_threads() -> usize {
    /// What any machine can start: with hundred thousands of threads nothing would go on.
    const MOST: usize = 256;
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let wanted = std::env::var("RAYON_NUM_THREADS").ok().and_then(|text| text.parse().ok());
    let wanted = wanted.filter(|wanted| *wanted > 0).unwrap_or(cores);
    let most = MOST.max(cores);
    if wanted > most {
        complain!("pbr-vr: RAYON_NUM_THREADS={wanted} is more than this machine can use; {most} threads are started");
    }
    wanted.min(most)
}

/// Starts these threads, or as many as the system allows: rayon itself would panic when one is missing.
fn start_threads() -> Result<()> {
    let wanted = wanted_threads();
    let mut waiting = Vec::new();
    for _ in 0..wanted {
        let (place, places) = channel::<rayon::ThreadBuilder>();
        let work = move || places.into_iter().for_each(rayon::ThreadBuilder::run);
        match std::thread::Builder::new().spawn(work) {
            Ok(_) => waiting.push(place),
            Err(error) if waiting.is_empty() => return Err(Error::NoThread(error)),
            Err(error) => {
                tracing::warn!(
                    "only {} of {wanted} threads can be started, which takes longer: {error}",
                    waiting.len()
                );
                break;
            }
        }
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(waiting.len()).spawn_handler(|thread| {
        let place = waiting.pop().ok_or(ErrorKind::WouldBlock)?;
        place.send(thread).map_err(|_| ErrorKind::BrokenPipe.into())
    });
    // Every thread is there, and no other pool.
    pool.build_global().map_err(|error| Error::NoThread(std::io::Error::other(error)))
}

fn chosen(Choice { tolerance, budget_ms }: Choice) -> Option<Limit> {
    tolerance.map(Limit::Tolerance).or(budget_ms.map(Limit::BudgetMs))
}

fn start_log(verbose: u8) {
    use tracing_subscriber::filter::{LevelFilter, Targets};
    use tracing_subscriber::layer::SubscriberExt as _;
    use tracing_subscriber::util::SubscriberInitExt as _;
    // Messages of desktop libraries help only with debugging.
    let (ours, others) = match verbose {
        0 => (LevelFilter::WARN, LevelFilter::ERROR),
        1 => (LevelFilter::INFO, LevelFilter::WARN),
        _ => (LevelFilter::DEBUG, LevelFilter::DEBUG),
    };
    // The console of Windows has to be switched to ANSI colours; without them, the escape codes would be visible.
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
