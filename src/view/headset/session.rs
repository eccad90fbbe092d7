//! A session in the headset: its frame loop, from the first pose to the runtime's shutdown.

use std::mem::ManuallyDrop;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use glam::{Mat4, Quat};
use openvr_sys as sys;

use super::codes::{After, after};
use super::events::Event;
use super::eye_images::EyeImages;
use super::frame_statistics::FrameTiming;
use super::hands::{Hands, PanelInput, Step};
use super::held::HandPlaces;
use super::hidden_area::{HiddenAreaV, share};
use super::optics::{Head, Optics};
use super::panel::HeadsetPanel;
use super::quality::{Finished, Level, Quality};
use super::report::{FrameTime, HeadsetReport, Record, USUAL_HERTZ};
use super::runtime::{DEVICES, EYES, Runtime};
use super::steady::Seen;
use super::watchdog::{Patience, Watchdog};
use crate::gpu::{FrameRing, Gpu, PassTimes};
use crate::render::{Eye, FRAME_BYTES, FRAMES_IN_FLIGHT};
use crate::view::action::{Action, Requests};
use crate::view::app::App;
use crate::view::frame_clock::{FrameClock, ms_since};
use crate::view::loader::Target;
use crate::view::panel::PanelInputs;
use crate::view::shown_scene::ShownScene;
use crate::{Error, Result, say};

/// Seconds after which a disconnected headset is given up: longer than a loose contact.
const GONE_SECONDS: f32 = 0.5;
/// Frames after a change of scene whose times are ignored: the driver still compiles and moves data.
const WARM_UP: u32 = 10;
/// What the watchdog calls the calls for the panel.
const OVERLAY: &str = "the panel's overlay";
/// The pause after a frame that the runtime refuses, because refused frames are not paced.
const PAUSE: Duration = Duration::from_millis(5);

/// Why a session is over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// The runtime asked the program to quit.
    Quit,
    /// The headset or its runtime is lost; the reason, and what to do.
    Lost(String),
}

/// The result of a frame.
pub enum FrameResult {
    /// It was submitted; the user's requests.
    Shown(Requests),
    Over(End),
}

/// A running session. Drop order: the runtime is shut down before any Vulkan object that it knows is destroyed.
pub struct Session {
    hands: Hands,
    runtime: ManuallyDrop<Runtime>,
    watchdog: Watchdog,
    images: EyeImages,
    ring: FrameRing,
    /// The quality level that each slot was drawn with last; then that of the last frame.
    levels: [usize; FRAMES_IN_FLIGHT],
    level: Level,
    /// Frames until their times count.
    warm_up: u32,
    optics: [Optics; 2],
    /// Of both eyes, v downwards.
    hidden: [Vec<[f32; 2]>; 2],
    head: Head,
    poses: Box<[sys::TrackedDevicePose_t; DEVICES]>,
    /// What the last frame was drawn with: the left eye, the head, seconds since the frame before, and whether the user
    /// was moved.
    seen: Option<(Eye, Quat, f32, bool)>,
    /// Since when the headset has been disconnected.
    gone: Option<Instant>,
    /// Vulkan extensions that the runtime asked for and the driver lacks, until it has accepted a picture all the same.
    lacking: Option<String>,
    last: Option<Instant>,
    quality: Quality,
    /// `None` where the runtime has no overlays.
    panel: Option<HeadsetPanel>,
    /// What the hands did with it in the last frame.
    panel_input: PanelInput,
    /// GPU time of each pass of the frame that finished last.
    times: PassTimes,
    /// CPU time of the last frame.
    recording: Duration,
    name: String,
    /// Pixels of an eye's picture.
    size: [u32; 2],
    /// Never locked while the runtime is called: the watchdog reads it if that does not come back.
    record: Arc<Mutex<Record>>,
    gpu: Arc<Gpu>,
}

impl Session {
    /// Begins a session; `watchdog` is already watching.
    pub fn new(mut runtime: Runtime, gpu: &Arc<Gpu>, watchdog: Watchdog, v: HiddenAreaV) -> Result<Self> {
        runtime.prepare();
        let most = gpu.max_image_size();
        let size = runtime.recommended_size()?.map(|s| s.min(most));
        let hertz = runtime.display_hertz();
        let hidden = EYES.map(|eye| v.downwards(&runtime.hidden_area(eye)));
        let optics = [runtime.optics(EYES[0])?, runtime.optics(EYES[1])?];
        let name = runtime.headset_name();
        let facts = HeadsetReport {
            name: name.clone(),
            hertz,
            size,
            tangents: optics.map(|optics| optics.tangents),
            explicit_timing: runtime.has_explicit_timing(),
            hidden_area_v: v,
            hidden_area_share: hidden.each_ref().map(|corners| share(corners)),
            ..Default::default()
        };
        // SAFETY: `Drop` drops it before the runtime; on failure here, arguments are dropped last.
        let panel = unsafe { HeadsetPanel::new(gpu, &runtime) }?;
        let quality = Quality::new(1e3 / hertz.unwrap_or(USUAL_HERTZ), size);
        Ok(Self {
            hands: Hands::new(&runtime),
            images: EyeImages::new(gpu, size)?,
            ring: FrameRing::new(gpu, FRAME_BYTES)?,
            levels: [0; FRAMES_IN_FLIGHT],
            level: quality.level(),
            warm_up: WARM_UP,
            optics,
            hidden,
            head: Head::default(),
            poses: Box::new([sys::TrackedDevicePose_t::default(); DEVICES]),
            seen: None,
            gone: None,
            lacking: gpu.missing_extensions(),
            last: None,
            quality,
            panel,
            panel_input: PanelInput::default(),
            times: PassTimes::default(),
            recording: Duration::ZERO,
            name,
            size,
            record: Arc::new(Mutex::new(Record { facts, ..Record::default() })),
            gpu: Arc::clone(gpu),
            watchdog,
            runtime: ManuallyDrop::new(runtime),
        })
    }

    /// The target that scenes are drawn for.
    pub fn target(&self) -> Target {
        Target { size: self.size, eyes: 2, hidden: self.hidden.clone() }
    }

    /// Pixels of an eye's picture.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The headset's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Pixels of the eyes' pictures that the last frame filled, from the upper left corner.
    pub fn area(&self) -> [u32; 2] {
        self.level.size
    }

    /// What the last frame was drawn with.
    pub fn seen(&self) -> Option<Seen<'_>> {
        let (eye, world_from_head, seconds, jumped) = self.seen?;
        Some(Seen { eye, hidden: &self.hidden[0], world_from_head, seconds, jumped })
    }

    /// The greatest texture coordinates of what the last frame filled of the eyes' pictures.
    pub fn bounds(&self) -> [f32; 2] {
        self.level.bounds
    }

    /// Frames shown so far.
    pub fn frames(&self) -> u64 {
        self.noted().facts.frames
    }

    /// Moves the user to one of the scene's cameras with the next frame; also for a new scene.
    pub fn go_to(&mut self, camera: usize) {
        self.hands.go_to(camera);
        self.warm_up = WARM_UP;
    }

    /// Notes the last frame's times.
    pub fn time_frame(&self, clock: &mut FrameClock, now: Instant) {
        clock.add_gpu(&self.times, self.times.total_ms());
        clock.add_recording(self.recording);
        clock.tick(now);
    }

    /// One line for the screen: quality, rate, the compositor's statistics.
    pub fn line(&self) -> String {
        let [width, height] = self.level.size;
        let statistics = self.noted().statistics_line();
        format!("{}: {width}x{height} per eye; {statistics}", self.name)
    }

    /// Notes the mirror's time and whether it was ready.
    pub fn mirrored(&self, shown: bool, ms: f64) {
        let mut record = self.noted();
        record.facts.mirror[usize::from(!shown)] += 1;
        record.timeline.set_mirror(ms as f32);
    }

    /// Shows an error on the panel, where there is one.
    pub fn show_error(&mut self, error: &Error) {
        self.panel.iter_mut().for_each(|panel| panel.error(error.to_string()));
    }

    /// Follows the panel on the dashboard and at the hand, between two frames; returns what was chosen there.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn follow_panel(&mut self, app: &App, clock: &FrameClock) -> Result<Vec<Action>> {
        let Some(panel) = &mut self.panel else { return Ok(Vec::new()) };
        let input = std::mem::take(&mut self.panel_input);
        let is_due = self.watchdog.watch(OVERLAY, Patience::FRAME, || {
            panel.follow(&self.runtime, input, &HandPlaces::new(&self.runtime, &self.poses))
        })?;
        self.hands.follow_laser(panel.has_laser());
        if !is_due {
            return Ok(Vec::new());
        }
        let inputs = PanelInputs {
            app,
            clock,
            control: None,
            present_mode: "headset",
            slot: self.ring.next_slot(),
            headset: Some(self.line()),
            continuous: true,
            alone: true,
        };
        Ok(self.panel.as_mut().map(|panel| panel.lay_out(&inputs)).unwrap_or_default())
    }

    /// Polls the runtime's events; to be called often, also while there is nothing to draw.
    pub fn follow_events(&mut self) -> Result<Option<End>> {
        while let Some(event) = self.watchdog.watch("PollNextEvent", Patience::FRAME, || self.runtime.next_event()) {
            tracing::debug!("headset: {event:?}");
            match event {
                Event::Quit => {
                    self.runtime.acknowledge_quit();
                    self.noted().facts.quit_acknowledged = true;
                    return Ok(Some(End::Quit));
                }
                Event::OpticsChanged => self.change_optics(),
                Event::DeviceOff(0) => return Ok(Some(End::Lost("the headset is gone; connect it again".into()))),
                Event::DeviceOn(device) | Event::DeviceOff(device) => {
                    tracing::info!("headset: device {device} changed")
                }
                Event::Dashboard(up) => {
                    tracing::info!("headset: dashboard {}", if up { "up" } else { "away" });
                    self.hands.follow_dashboard(up);
                }
                Event::WrongGpu => {
                    return Ok(Some(End::Lost("the runtime says that another GPU must draw; start again".into())));
                }
                Event::Other(_) => {}
            }
        }
        Ok(None)
    }

    /// Draws the scene for both eyes, at the predicted pose of the head.
    pub fn frame(&mut self, scene: &mut ShownScene) -> Result<FrameResult> {
        if let Some(end) = self.follow_events()? {
            return Ok(self.over(end));
        }
        let started = Instant::now();
        if let Some(end) = self.wait_for_poses()? {
            return Ok(self.over(end));
        }
        let wait_ms = ms_since(started) as f32;
        let started = Instant::now();
        let seconds = self.last.replace(started).map_or(0.0, |last| (started - last).as_secs_f32());
        let Step { world_from_play, jumped, fade, requests, panel } =
            self.hands.step(&self.runtime, scene, &self.head, seconds);
        self.panel_input = panel;
        let world_from_head = world_from_play * self.head.space_from_head;
        let left = self.optics[0].eye(world_from_head);
        self.seen = Some((left, Quat::from_mat4(&world_from_head).normalize(), seconds, jumped));
        let slot = self.draw(scene, world_from_head, fade)?;
        self.recording = started.elapsed();
        let cpu_ms = ms_since(started) as f32;
        let started = Instant::now();
        if let Some(end) = self.submit(slot, jumped)? {
            return Ok(self.over(end));
        }
        let area = self.level.bounds.iter().product();
        let submit_ms = ms_since(started) as f32;
        let mut record = self.noted();
        record.timeline.push(FrameTime { wait_ms, cpu_ms, submit_ms, area, ..Default::default() });
        record.facts.frames += 1;
        record.facts.lost_poses = self.head.lost_poses;
        record.facts.runtime_messages = self.gpu.messages().foreign();
        drop(record);
        Ok(FrameResult::Shown(requests))
    }

    /// Facts and times of the session so far.
    pub fn report(&self) -> HeadsetReport {
        self.noted().report()
    }

    /// Sets what is done with the report if a call into the runtime never comes back, before the process ends.
    pub fn when_hopeless(&self, write: impl Fn(HeadsetReport) + Send + 'static) {
        let record = Arc::clone(&self.record);
        self.watchdog.set_on_give_up(move |call| {
            let mut record = record.lock().unwrap_or_else(PoisonError::into_inner);
            record.facts.ended = format!("{call} never came back");
            if record.facts.frames > 0 {
                say!("pbr-vr: headset: {}", record.summary());
            }
            write(record.report());
        });
    }

    fn noted(&self) -> MutexGuard<'_, Record> {
        self.record.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn over(&mut self, end: End) -> FrameResult {
        self.noted().facts.ended = match &end {
            End::Quit => "quit".into(),
            End::Lost(why) => why.clone(),
        };
        FrameResult::Over(end)
    }

    fn wait_for_poses(&mut self) -> Result<Option<End>> {
        let (runtime, gpu, poses) = (&self.runtime, &self.gpu, &mut self.poses);
        let started = Instant::now();
        let code = self.watchdog.watch("WaitGetPoses", Patience::FRAME, || {
            if runtime.has_explicit_timing() {
                runtime.wait_get_poses(poses)
            } else {
                gpu.with_queue_locked(|| runtime.wait_get_poses(poses))
            }
        })?;
        self.panel.iter().for_each(|panel| panel.gate().close());
        if code == sys::EVRCompositorError_VRCompositorError_None {
            self.head.follow(&self.poses[0]);
            if self.poses[0].bDeviceIsConnected {
                self.gone = None;
            } else if self.gone.get_or_insert(started).elapsed().as_secs_f32() > GONE_SECONDS {
                return Ok(Some(End::Lost("the headset is gone; connect it again".into())));
            }
        } else if started.elapsed() < PAUSE {
            // The call returned at once, so frames are not paced.
            std::thread::sleep(PAUSE);
        }
        Ok(self.judge("WaitGetPoses", code))
    }

    /// Records and submits a frame; returns its slot.
    fn draw(&mut self, scene: &mut ShownScene, world_from_head: Mat4, fade: f32) -> Result<usize> {
        let (size, slot) = (self.size(), self.ring.next_slot());
        let eyes = self.optics.map(|optics| optics.eye(world_from_head));
        let finished = self.ring.finish_slot()?;
        self.choose_level(slot, &finished);
        self.times = finished;
        let inputs = scene.inputs(&eyes, fade, Some(self.hands.gizmos()));
        let renderer = &mut scene.loaded.renderer;
        renderer.resize(size)?;
        renderer.set_area(self.level.size);
        let mut frame = self.ring.begin()?;
        renderer.record(&mut frame, &inputs)?;
        self.images.fill(&mut frame.commands, slot, renderer.picture(), self.level.size);
        let panel = self.panel.as_ref();
        self.watchdog.watch(OVERLAY, Patience::FRAME, || panel.iter().for_each(|panel| panel.gate().wait()));
        self.gpu.with_queue_locked(|| self.runtime.submit_timing());
        frame.submit(None)?;
        Ok(slot)
    }

    /// This frame's quality, from the times of the slot's previous frame.
    fn choose_level(&mut self, slot: usize, times: &PassTimes) {
        let gpu_ms = times.total_ms() as f32;
        let finished = (!times.is_empty()).then(|| {
            let mut record = self.noted();
            record.timeline.set_gpu(FRAMES_IN_FLIGHT, gpu_ms);
            let reprojected_for_gpu = record.statistics.last().is_some_and(FrameTiming::is_reprojected_for_gpu);
            Finished { gpu_ms, level: self.levels[slot], reprojected_for_gpu }
        });
        let counts = self.warm_up == 0;
        self.warm_up -= u32::from(!counts);
        self.level = self.quality.next(finished.filter(|_| counts));
        self.levels[slot] = self.level.index;
    }

    fn submit(&mut self, slot: usize, jumped: bool) -> Result<Option<End>> {
        let bounds = self.level.bounds;
        for (eye, picture) in EYES.into_iter().zip(self.images.pictures(slot)) {
            let submit = || self.gpu.with_queue_locked(|| self.runtime.submit(eye, &picture, bounds, jumped));
            let code = self.watchdog.watch("Submit", Patience::FRAME, submit)?;
            if code == sys::EVRCompositorError_VRCompositorError_None {
                self.lacking = None;
            }
            if let Some(end) = self.judge("Submit", code) {
                return Ok(Some(end));
            }
        }
        let handoff = || self.gpu.with_queue_locked(|| self.runtime.post_present_handoff());
        self.watchdog.watch("PostPresentHandoff", Patience::FRAME, handoff);
        // The previous frame, whose numbers are complete.
        if let Some(timing) = self.runtime.frame_timing(1) {
            self.noted().statistics.add(timing);
        }
        Ok(None)
    }

    fn judge(&self, call: &str, code: sys::EVRCompositorError) -> Option<End> {
        match after(code) {
            After::Continue => None,
            After::NoFocus => {
                self.noted().facts.calls_without_focus += 1;
                None
            }
            After::FrameLost(words) => {
                let mut record = self.noted();
                let count = record.facts.failed_calls.entry(format!("{call} {code}")).or_default();
                *count += 1;
                if *count == 1 {
                    let lacking = lacking_words(&self.lacking);
                    crate::complain!("pbr-vr: headset: {call}: {words} ({code}); this frame is not seen{lacking}");
                }
                None
            }
            After::GiveUp(why) => Some(End::Lost(why.to_owned() + &lacking_words(&self.lacking))),
        }
    }

    /// Updates the optics; invalid ones are reported and ignored.
    fn change_optics(&mut self) {
        match (self.runtime.optics(EYES[0]), self.runtime.optics(EYES[1])) {
            (Ok(left), Ok(right)) => {
                self.optics = [left, right];
                let mut record = self.noted();
                record.facts.tangents = self.optics.map(|optics| optics.tangents);
                record.facts.optics_changes += 1;
            }
            (Err(error), _) | (_, Err(error)) => crate::complain!("pbr-vr: {error}"),
        }
    }
}

/// A possible reason why no picture has been accepted yet.
fn lacking_words(lacking: &Option<String>) -> String {
    let words = |names: &String| format!("; it also asked for {names}, which the graphics driver lacks: update that");
    lacking.as_ref().map_or_else(String::new, words)
}

impl Drop for Session {
    fn drop(&mut self) {
        if self.frames() > 0 && !std::thread::panicking() {
            say!("pbr-vr: headset: {}", self.noted().summary());
        }
        // The thread that paints the panel calls the runtime.
        let panel = self.panel.take();
        self.watchdog.watch(OVERLAY, Patience::FRAME, || drop(panel));
        // Waiting fails only on a lost device, where there is nothing to wait for.
        let _ = self.gpu.wait_idle();
        let (runtime, gpu) = (&mut self.runtime, &self.gpu);
        // The runtime may wait for the device; the loader, which may still be working, must not submit meanwhile.
        // SAFETY: nothing uses it after this.
        let shut_down = || gpu.with_queue_locked(|| unsafe { ManuallyDrop::drop(runtime) });
        self.watchdog.watch("VR_Shutdown", Patience::FRAME, shut_down);
    }
}
