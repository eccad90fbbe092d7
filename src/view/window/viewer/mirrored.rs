//! A viewer whose window mirrors a headset: the headset's frames, what the window shows of them, and going on without it.

use std::time::{Duration, Instant};

use winit::event_loop::ControlFlow;

use super::super::super::Mirror;
use super::super::super::headset::{End, Frame, RunReport};
use super::super::super::picture::ms_since;
use super::super::hud::Status;
use super::super::loader::LoadRequest;
use super::{TEXT_SCALE, Viewer, settings};
use crate::gpu::{Rect, Subresource};
use crate::render::Overlay;
use crate::{Error, Result, say};

/// How often the runtime's events are looked at while there is nothing to draw.
const DOZE: Duration = Duration::from_millis(20);
/// Bytes of a pixel of a screenshot.
const PIXEL: usize = 4;

impl Viewer {
    /// Whether frames go to a headset.
    pub fn is_in_headset(&self) -> bool {
        self.session.is_some()
    }

    /// Times and facts so far.
    pub fn report(&self) -> RunReport {
        let headset = self.session.as_ref().map(|session| session.report()).or_else(|| self.session_report.clone());
        RunReport {
            on: if headset.is_some() { "headset" } else { "window" },
            gpu: self.gpu.info().name.clone(),
            driver: self.gpu.info().driver.clone(),
            frames: self.frames,
            present_mode: Some(self.canvas.mode().name()),
            headset,
        }
    }

    /// When the headset wants to be asked again.
    pub(super) fn headset_pace(&self, now: Instant) -> ControlFlow {
        if self.stage.is_some() { ControlFlow::Poll } else { ControlFlow::WaitUntil(now + DOZE) }
    }

    /// Draws one frame for the headset, if a scene is there, and mirrors it.
    pub(super) fn draw_headset(&mut self) -> Result<()> {
        let Some(session) = &mut self.session else { return Ok(()) };
        let shown = match &mut self.stage {
            Some((stage, _)) => session.frame(stage),
            None => match session.follow_events() {
                Ok(None) => return Ok(()),
                ended => ended.map(|end| Frame::Over(end.unwrap_or(End::Quit))),
            },
        };
        let requests = match shown {
            Ok(Frame::Shown(requests)) => requests,
            Ok(Frame::Over(end)) => return self.leave_headset(&end),
            Err(Error::Headset { problem }) => return self.leave_headset(&End::Lost(problem)),
            Err(error) => return Err(error),
        };
        self.frames += 1;
        let now = Instant::now();
        self.clock.add_gpu(session.times(), session.times().total_ms());
        self.clock.tick(now);
        let shown = self.mirror_if_it_works(now)?;
        let Some(session) = &mut self.session else { return Ok(()) };
        session.mirrored(shown, ms_since(now));
        if self.frames == 1 {
            let [width, height] = session.size();
            let (headset, gpu) = (session.name(), &self.gpu.info().name);
            say!("pbr-vr: in the headset {headset}, {width}x{height} per eye on {gpu}, mirrored in a window");
        }
        if requests.next_shading {
            self.shade(1, false)?;
        }
        let scene = requests.next_scene.then(|| self.playlist.next_scene()).flatten();
        let panorama = requests.next_panorama.then(|| self.playlist.next_panorama()).flatten();
        scene.into_iter().chain(panorama).for_each(|path| self.open(&path));
        self.write_title(now);
        Ok(())
    }

    /// Goes on in the window: scene and light stay, the eyes' pipelines and images go.
    fn leave_headset(&mut self, end: &End) -> Result<()> {
        self.session_report = self.session.as_ref().map(|session| session.report());
        // The runtime is shut down here.
        self.session = None;
        if let Some((stage, _)) = &mut self.stage {
            stage.renderer.set_eyes(1)?;
            stage.renderer.set_fade(0.0);
        }
        // The window paces itself again, and if the mirror broke, tries anew.
        self.canvas.choose_vsync();
        self.clock.pause();
        let why = match end {
            End::Quit => "the headset's runtime ends",
            End::Lost(why) => why,
        };
        self.tell(format!("in the window from here on, because {why}"));
        Ok(())
    }

    /// Mirrors, until that fails: the headset goes on without, as long as there is a GPU.
    fn mirror_if_it_works(&mut self, now: Instant) -> Result<bool> {
        if self.mirror_broken {
            return Ok(false);
        }
        match self.mirror(now) {
            Err(error) if !error.is_device_lost() => {
                self.mirror_broken = true;
                crate::complain!("pbr-vr: the window shows the headset no more: {error}");
                Ok(false)
            }
            mirrored => mirrored,
        }
    }

    /// Shows in the window what the eyes see, if the window is ready; returns whether it was.
    fn mirror(&mut self, now: Instant) -> Result<bool> {
        let (Some((stage, control)), Some(session)) = (&mut self.stage, &self.session) else { return Ok(false) };
        let picture = session.area();
        if std::mem::take(&mut self.screenshot) {
            let pixels = self.canvas.read(&stage.renderer)?;
            let pixels = crop(&pixels, stage.renderer.picture().desc().size[0], picture);
            self.loader.start(LoadRequest::Screenshot { pixels, size: picture });
        }
        let Some(acquired) = self.canvas.poll(self.size, now)? else { return Ok(false) };
        let parts = parts(self.mirror, picture, self.canvas.size());
        // As large in the window as text is without a headset.
        let shrinks = parts.first().map_or(1.0, |(_, [from, onto])| f64::from(from.size[0]) / f64::from(onto.size[0]));
        let largest = (TEXT_SCALE * self.window.scale_factor() * shrinks).floor().max(1.0) as u32;
        let mut settings = settings(stage, control, self.camera, self.canvas.mode().name()).to_vec();
        settings.push(session.line());
        let status = Status { rate: self.clock.rate(), settings: &settings, loading: &self.loading };
        let (lines, scale) = self.hud.fit(now, &status, largest, |scale| Overlay::grid(picture, scale));
        self.overlay.set_text(self.canvas.slot(), &lines, picture, scale);
        // The text lies over the left eye's picture.
        let overlay = (self.mirror != Mirror::Right).then_some(&self.overlay);
        self.canvas.show_parts(acquired, &stage.renderer, overlay, &parts, &self.window)?;
        Ok(true)
    }
}

/// Which layers go where: as large as they fit, undistorted, in the window's middle.
fn parts(mirror: Mirror, picture: [u32; 2], window: [u32; 2]) -> Vec<(Subresource, [Rect; 2])> {
    let layers: &[u32] = match mirror {
        Mirror::Both => &[0, 1],
        Mirror::Left => &[0],
        Mirror::Right => &[1],
    };
    let count = layers.len() as u32;
    let [width, height] = picture.map(f64::from);
    let scale = (f64::from(window[0]) / (f64::from(count) * width)).min(f64::from(window[1]) / height);
    let size = [width, height].map(|s| ((s * scale).floor() as u32).max(1));
    let left = window[0].saturating_sub(count * size[0]) / 2;
    let top = window[1].saturating_sub(size[1]) / 2;
    let onto = |i: u32| Rect { corner: [left + i * size[0], top], size };
    let place = |(i, layer): (u32, &u32)| (Subresource { mip: 0, layer: *layer }, [Rect::of(picture), onto(i)]);
    // A window of a few pixels has no room for two pictures.
    let fits = |(_, [_, onto]): &(Subresource, [Rect; 2])| (0..2).all(|i| onto.corner[i] + onto.size[i] <= window[i]);
    (0..).zip(layers).map(place).filter(fits).collect()
}

/// The upper left part of a picture `width` pixels wide.
fn crop(pixels: &[u8], width: u32, [part_width, part_height]: [u32; 2]) -> Vec<u8> {
    let rows = pixels.chunks_exact(PIXEL * width as usize).take(part_height as usize);
    rows.flat_map(|row| &row[..PIXEL * part_width as usize]).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eyes_fit_the_window_undistorted_and_beside_each_other() {
        let rects: Vec<Rect> = parts(Mirror::Both, [1512, 1680], [1280, 720]).iter().map(|(_, [_, on])| *on).collect();
        assert_eq!(rects[0], Rect { corner: [0, 4], size: [640, 711] });
        assert_eq!(rects[1], Rect { corner: [640, 4], size: [640, 711] });
        let right = &parts(Mirror::Right, [1000, 1000], [400, 300])[0];
        assert_eq!((right.0.layer, right.1[1]), (1, Rect { corner: [50, 0], size: [300, 300] }));
    }

    #[test]
    fn no_window_is_too_small_or_too_odd() {
        for window in [[1, 1], [1, 720], [1280, 1], [3, 2], [2, 3]] {
            for (_, [_, onto]) in parts(Mirror::Both, [1512, 1680], window) {
                assert!((0..2).all(|i| onto.corner[i] + onto.size[i] <= window[i]), "{window:?}: {onto:?}");
            }
        }
    }

    #[test]
    fn screenshots_are_cut_to_what_was_drawn() {
        let pixels: Vec<u8> = (0..3 * 2 * 4).collect();
        assert_eq!(crop(&pixels, 3, [2, 1]), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(crop(&pixels, 3, [1, 2]), [0, 1, 2, 3, 12, 13, 14, 15]);
    }
}
