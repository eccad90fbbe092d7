//! The thread that draws the panel's pictures and gives them to the runtime, so that no frame of the eyes waits for it.
//!
//! The panel is laid out on the frames' thread, which owns what it shows, after a frame was handed over. All else is done
//! here. Drawing takes the queue for one submission at a time, like the loader's. SetOverlayTexture uses the queue for as
//! long as it takes, which nobody promises to be short: it may begin only between the hand-over of a frame and the next
//! frame's poses, and one that waits has its turn with every hand-over ([`Gate`]). Meanwhile the frames' thread is in
//! WaitGetPoses, which leaves the queue alone and allows other threads to use it in the timing mode that the program sets
//! (openvr.h, IVRCompositor::SetExplicitTimingMode; with older runtimes WaitGetPoses and this thread take turns). So a call
//! that is over before the next frame is submitted delays nothing, and a longer one delays that frame, and no other, by the
//! rest; the pause after it grows with it.

use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use openvr_sys::VROverlayHandle_t;

use super::overlay::TextureCall;
use super::runtime::EyePicture;
use crate::gpu::{ColourAttachment, FrameRing, Gpu, Image, ImageAccess, ImageDesc, ImageUsageFlags};
use crate::render::{Output, UI_BYTES, UiFrame, UiRenderer, UiTarget};
use crate::{Error, Result};

/// When calls that use the queue may begin, and whether one is under way.
#[derive(Default)]
pub struct Gate {
    state: Mutex<GateState>,
    changed: Condvar,
}

#[derive(Default)]
struct GateState {
    is_open: bool,
    /// The panel's thread waits for its turn.
    is_waiting: bool,
    is_calling: bool,
    /// Nothing may begin any more.
    is_over: bool,
}

/// A call under way; it ends when this is dropped.
struct Call<'a>(&'a Gate);

impl Gate {
    fn lock(&self) -> MutexGuard<'_, GateState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut GateState)) {
        change(&mut self.lock());
        self.changed.notify_all();
    }

    /// From now on a call may begin: a frame was handed over. One that waits begins with this, also where the next frame
    /// follows at once: with frames that are always late, the panel would else never be seen.
    pub fn open(&self) {
        self.change(|state| {
            state.is_open = true;
            state.is_calling |= std::mem::take(&mut state.is_waiting);
        });
    }

    /// From now on none may begin: a frame begins. Waits for nothing.
    pub fn close(&self) {
        self.change(|state| state.is_open = false);
    }

    /// Waits for the end of a call that is under way; the gate is closed.
    pub fn wait(&self) {
        let still = |state: &mut GateState| state.is_calling;
        drop(self.changed.wait_while(self.lock(), still).unwrap_or_else(PoisonError::into_inner));
    }

    /// Waits until a call may begin, and begins one; `None` where none will any more.
    fn begin(&self) -> Option<Call<'_>> {
        let mut state = self.lock();
        state.is_waiting = !state.is_open;
        state.is_calling = state.is_open;
        let shut = |state: &mut GateState| !state.is_calling && !state.is_over;
        let state = self.changed.wait_while(state, shut).unwrap_or_else(PoisonError::into_inner);
        let is_over = state.is_over;
        drop(state);
        // Dropped, a call that must not begin is over at once.
        Some(Call(self)).filter(|_| !is_over)
    }
}

impl Drop for Call<'_> {
    fn drop(&mut self) {
        self.0.change(|state| state.is_calling = false);
    }
}

/// A layout to draw, and the overlays that show it.
struct Job {
    ui: UiFrame,
    overlays: Vec<VROverlayHandle_t>,
}

/// The thread, from the side of the frames. It ends when this is dropped.
pub struct Painter {
    pub gate: Arc<Gate>,
    /// `None` only while this is dropped.
    jobs: Option<Sender<Job>>,
    /// The time of the longest call into the runtime for each picture.
    done: Receiver<Result<Duration>>,
    is_busy: bool,
    thread: Option<JoinHandle<()>>,
}

impl Painter {
    /// Starts the thread for pictures of `size` pixels.
    ///
    /// # Errors
    /// No memory; no thread.
    pub fn new(gpu: &Arc<Gpu>, call: TextureCall, size: [u32; 2]) -> Result<Self> {
        let usage = ImageUsageFlags::COLOR_ATTACHMENT | ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::SAMPLED;
        let image = || Image::new(gpu, "panel", ImageDesc::flat(Output::Display.format(), size, usage));
        let mut pictures = PanelPictures {
            ui: UiRenderer::new(gpu)?,
            images: [image()?, image()?],
            ring: FrameRing::new(gpu, UI_BYTES)?,
            gpu: Arc::clone(gpu),
            call,
            pictures: 0,
        };
        let gate = Arc::new(Gate::default());
        let (jobs, taken) = channel::<Job>();
        let (finished, done) = channel();
        let gate_there = Arc::clone(&gate);
        let work = move || {
            for job in taken {
                // Nobody wants to know any more: the session ends.
                if finished.send(pictures.paint(&job, &gate_there)).is_err() {
                    break;
                }
            }
        };
        let thread = std::thread::Builder::new().name("panel".into()).spawn(work);
        let thread =
            thread.map_err(|e| Error::Headset { problem: format!("no thread can be started for its panel ({e})") })?;
        Ok(Self { gate, jobs: Some(jobs), done, is_busy: false, thread: Some(thread) })
    }

    /// Whether a picture is under way.
    pub fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// The picture that is done since the last call: the time of its longest call into the runtime.
    ///
    /// # Errors
    /// A failed Vulkan call while drawing it.
    pub fn take_done(&mut self) -> Result<Option<Duration>> {
        match self.done.try_recv() {
            Ok(done) => {
                self.is_busy = false;
                done.map(Some)
            }
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(Error::Headset { problem: "its panel's thread has ended".into() }),
        }
    }

    /// Starts drawing a layout for some overlays, none to prepare only; not while it is busy.
    pub fn paint(&mut self, ui: UiFrame, overlays: Vec<VROverlayHandle_t>) {
        if let Some(jobs) = &self.jobs {
            // A thread that has ended is reported by `take_done`.
            let _ = jobs.send(Job { ui, overlays });
            self.is_busy = true;
        }
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        self.gate.change(|state| state.is_over = true);
        self.jobs = None;
        // The thread returns nothing.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// What the thread draws with.
struct PanelPictures {
    ui: UiRenderer,
    /// Taken in turn: the runtime may still read the last one.
    images: [Arc<Image>; 2],
    ring: FrameRing,
    gpu: Arc<Gpu>,
    call: TextureCall,
    /// Drawn so far.
    pictures: usize,
}

impl PanelPictures {
    /// The time of the longest call into the runtime.
    fn paint(&mut self, job: &Job, gate: &Gate) -> Result<Duration> {
        let picture = self.draw(&job.ui)?;
        let mut longest = Duration::ZERO;
        for overlay in &job.overlays {
            let Some(call) = gate.begin() else { break };
            let (shown, took) = self.gpu.with_queue_locked(|| {
                let started = Instant::now();
                (self.call.show(*overlay, &picture), started.elapsed())
            });
            drop(call);
            if let Err(why) = shown {
                tracing::debug!("headset: panel: {why}");
            }
            longest = longest.max(took);
        }
        Ok(longest)
    }

    /// Waits for nothing but the picture before the last.
    fn draw(&mut self, ui: &UiFrame) -> Result<EyePicture> {
        let image = &self.images[self.pictures % self.images.len()];
        let (format, size) = (image.desc().format, image.desc().size);
        let mut frame = self.ring.begin()?;
        frame.commands.prepare_fresh(image, ImageAccess::Colour);
        let colour = ColourAttachment::cleared(image.attachment(), [0.0, 0.0, 0.0, 1.0]);
        self.ui.record(&mut frame, UiTarget { colour, format, size }, ui)?;
        frame.commands.prepare(image, ImageAccess::CopyFrom);
        frame.submit(None)?;
        self.pictures += 1;
        // Vulkan's formats are small positive numbers.
        Ok(EyePicture { handles: self.gpu.handles(), image: image.handle(), size, format: format.as_raw() as u32 })
    }
}

#[cfg(test)]
#[path = "painter_tests.rs"]
mod tests;
