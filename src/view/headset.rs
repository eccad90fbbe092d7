//! The headset as an output: probing for one, connecting to it in OpenVR's order, and showing a scene in it.

mod actions;
mod app;
mod codes;
mod events;
mod eye_images;
mod frame_statistics;
mod hands;
mod held;
mod hidden_area;
mod optics;
mod overlay;
mod painter;
mod panel;
pub(crate) mod probe;
mod quality;
mod report;
mod rig;
mod runtime;
mod session;
mod steady;
mod watchdog;

use std::sync::Arc;

pub use app::run as run_alone;
pub use hidden_area::HiddenAreaV;
pub use probe::{SUBCOMMAND as PROBE_SUBCOMMAND, answer as answer_probe, probe, registry};
pub use report::{HeadsetReport, RunReport};
pub use session::{End, FrameResult, Session};
pub use steady::{Seen, Steady};

use crate::gpu::{Gpu, GpuOptions, Instance};
use crate::{Error, Result, say};
use runtime::{Role, Runtime};
use watchdog::{Patience, Watchdog};

/// A runtime and the GPU that its headset is connected to. Drop order: the runtime first.
pub struct Connected {
    runtime: Runtime,
    watchdog: Watchdog,
    pub gpu: Arc<Gpu>,
}

impl Connected {
    /// Begins a session.
    pub fn begin(self, v: HiddenAreaV) -> Result<Session> {
        // On failure, arguments are dropped in the right order: the runtime before our reference to the GPU.
        let Self { runtime, watchdog, gpu } = self;
        Session::new(runtime, &gpu, watchdog, v)
    }
}

/// Drop order: the runtime before the instance that it uses.
struct Opening {
    runtime: Runtime,
    _instance: Arc<Instance>,
}

/// Connects, in the order that OpenVR requires: runtime, instance extensions, instance, its choice of a GPU, device
/// extensions, device.
///
/// # Errors
/// [`Error::Headset`] with the runtime's reason; whatever stops the GPU.
pub fn connect(options: GpuOptions<'_>) -> Result<Connected> {
    let watchdog = Watchdog::new()?;
    let start = || Runtime::start(Role::Scene);
    let runtime = watchdog
        .watch("the start of the runtime", Patience::START, start)
        .map_err(|refusal| Error::Headset { problem: refusal.to_string() })?;
    let display = options.display.map(|display| display.as_raw());
    let instance = Instance::new(options.validate, display, &runtime.instance_extensions())?;
    let instance = Arc::new(instance);
    let opening = Opening { runtime, _instance: Arc::clone(&instance) };
    let physical = opening.runtime.output_device(instance.handle());
    let asked = |physical| Ok(opening.runtime.device_extensions(physical));
    let gpu = Gpu::open_for_headset(options, &instance, physical, asked)?;
    watchdog.set_gpu(&gpu);
    let name = &gpu.info().name;
    if let Some(wanted) = options.name.filter(|wanted| !name.to_lowercase().contains(&wanted.to_lowercase())) {
        say!("pbr-vr: on {name} instead of {wanted}, because the headset is connected to it");
    }
    Ok(Connected { runtime: opening.runtime, watchdog, gpu })
}
