//! Keyboard and mouse events of the viewer.

use glam::Vec2;
use winit::dpi::PhysicalPosition;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent};
use winit::window::Fullscreen;

use super::keys::action;
use super::output::{Drag, WindowOutput};
use super::viewer::Viewer;
use crate::Result;
use crate::scene::description_text::append_camera;
use crate::view::action::Action;

/// Points that the pointer may move between pressing and releasing a button for it to be a click.
const CLICK_POINTS: f64 = 4.0;
/// Pixels of a touchpad's scrolling, at scale 1, that count as one notch of a wheel.
const PIXELS_PER_NOTCH: f64 = 40.0;

impl WindowOutput {
    /// The keyboard's focus was gained or lost.
    pub fn focus(&mut self, focused: bool) {
        self.focused = focused;
        if !focused {
            self.keys.release_all();
            (self.drag, self.pressed) = (None, None);
        }
    }

    /// A mouse button was pressed or released; returns where that was a click with the left one, in pixels.
    pub fn button(&mut self, state: ElementState, button: MouseButton) -> Option<[u32; 2]> {
        let drag = match button {
            MouseButton::Left => Drag::Turn,
            MouseButton::Right | MouseButton::Middle => Drag::Pan,
            _ => return None,
        };
        match state {
            ElementState::Pressed => {
                self.drag = Some(drag);
                self.pressed = self.pointer.filter(|_| drag == Drag::Turn);
                None
            }
            ElementState::Released => {
                self.drag = self.drag.filter(|current| *current != drag);
                let pressed = self.pressed.take()?;
                let is_within = |at: f64, side: u32| (0.0..f64::from(side)).contains(&at);
                let clicked = is_within(pressed.x, self.size[0]) && is_within(pressed.y, self.size[1]);
                clicked.then_some([pressed.x as u32, pressed.y as u32])
            }
        }
    }

    /// The mouse pointer has moved.
    pub fn pointer(&mut self, position: PhysicalPosition<f64>) {
        let before = self.pointer.replace(position).unwrap_or(position);
        let limit = CLICK_POINTS * self.window.scale_factor();
        self.pressed = self.pressed.filter(|at| (at.x - position.x).hypot(at.y - position.y) <= limit);
        let height = f64::from(self.size[1].max(1));
        let moved = Vec2::new((position.x - before.x) as f32, (position.y - before.y) as f32) / height as f32;
        if let Some(control) = &mut self.control {
            match self.drag {
                Some(Drag::Turn) => control.turn(moved),
                Some(Drag::Pan) => control.pan(moved),
                None => {}
            }
        }
    }

    /// The wheel was turned, or two fingers moved on a touchpad.
    pub fn wheel(&mut self, delta: MouseScrollDelta) {
        let notches = match delta {
            MouseScrollDelta::LineDelta(_, lines) => lines,
            MouseScrollDelta::PixelDelta(by) => (by.y / (PIXELS_PER_NOTCH * self.window.scale_factor())) as f32,
        };
        if let Some(control) = &mut self.control {
            control.wheel(notches);
        }
    }

    /// Hands an event to the panel; returns whether it is the panel's alone.
    pub fn pass_to_panel(&mut self, event: &WindowEvent) -> bool {
        let typed = matches!(event, WindowEvent::KeyboardInput { .. }) && !self.panel.context.wants_keyboard_input();
        // A key is a command of the window's unless text is typed: Tab, too, which else moves the panel's focus.
        if typed {
            return false;
        }
        let response = self.ui_input.on_window_event(&self.window, event);
        let points = f64::from(self.panel.context.pixels_per_point());
        let at = self.pointer.map(|at| egui::pos2((at.x / points) as f32, (at.y / points) as f32));
        let over = at.is_some_and(|at| self.panel.is_at(at));
        // Moving the pointer over the picture changes nothing in the panel.
        let idle = matches!(event, WindowEvent::CursorMoved { .. }) && (self.drag.is_some() || !self.panel.is_shown());
        if response.repaint && !idle {
            self.panel.refresh();
        }
        over && self.drag.is_none()
    }

    fn switch_fullscreen(&self) {
        let full = self.window.fullscreen().is_none().then_some(Fullscreen::Borderless(None));
        self.window.set_fullscreen(full);
    }
}

impl Viewer {
    /// A key was pressed or released; returns whether that ends the program.
    pub fn key(&mut self, event: &KeyEvent) -> Result<bool> {
        // While text is typed, letters are no commands; releases are, or a key would stay down.
        if event.state.is_pressed() && self.output.panel.context.wants_keyboard_input() {
            return Ok(false);
        }
        self.output.keys.follow(event);
        let alt = self.output.modifiers.alt_key();
        let wanted = event.state.is_pressed().then(|| action(event, alt)).flatten();
        match wanted {
            Some(Action::Quit) => return Ok(true),
            Some(action) => self.perform(action)?,
            None => {}
        }
        Ok(false)
    }

    /// Shows the panel's section for the material in this pixel of the window, where the panel is shown.
    pub fn pick(&mut self, pixel: [u32; 2]) -> Result<()> {
        let size = self.output.presenter.size();
        let is_inside = pixel[0] < size[0] && pixel[1] < size[1];
        // A headset's mirror is another picture.
        let may_pick = self.session.is_none() && self.output.panel.is_shown() && is_inside;
        let Some((scene, control)) = self.app.scene.as_mut().zip(self.output.control.as_ref()).filter(|_| may_pick)
        else {
            return Ok(());
        };
        let eye = control.eye(size[0] as f32 / size[1] as f32).of_pixel(pixel, size);
        match scene.loaded.renderer.pick(&eye, scene.world_from_models)? {
            Some(index) => {
                self.perform(Action::Material(index))?;
                self.output.panel.open_material();
            }
            None => self.output.note("there is nothing but the panorama"),
        }
        Ok(())
    }

    /// Performs the panel's commands.
    pub fn perform_waiting(&mut self) -> Result<()> {
        let actions = std::mem::take(&mut self.output.actions);
        actions.into_iter().try_for_each(|action| self.perform(action))?;
        if self.app.has_refused() { self.collect() } else { Ok(()) }
    }

    fn perform(&mut self, action: Action) -> Result<()> {
        self.output.panel.refresh();
        let Some(action) = self.app.perform(action)? else { return Ok(()) };
        match action {
            Action::Panel => self.output.panel.toggle(),
            Action::Screenshot => self.output.screenshot = true,
            Action::Fullscreen => self.output.switch_fullscreen(),
            Action::Continuous(continuous) => self.output.continuous = continuous,
            Action::NextPresentMode => {
                let mode = self.output.presenter.next_mode();
                self.output.note(format!("showing frames: {}", mode.name()));
            }
            Action::SwitchMode => self.output.control.iter_mut().for_each(|control| control.switch_mode()),
            Action::NextCamera => self.choose_camera(self.app.scene.as_ref().map_or(0, |scene| scene.camera + 1)),
            Action::Camera(index) => {
                let count = self.app.scene.as_ref().map_or(0, |scene| scene.loaded.cameras.len());
                if index < count {
                    self.choose_camera(index);
                } else {
                    self.output.note(format!("there is no camera {}, only {count}", index + 1));
                }
            }
            Action::SaveCamera(name) => self.save_camera(&name),
            Action::Reset => self.reset()?,
            Action::Open(path) => self.open(&path),
            // `key` quits, and the app performs the others.
            _ => {}
        }
        Ok(())
    }

    fn choose_camera(&mut self, index: usize) {
        let (Some(scene), Some(control)) = (&mut self.app.scene, &mut self.output.control) else { return };
        scene.camera = index % scene.loaded.cameras.len();
        control.set_camera(&scene.loaded.cameras[scene.camera]);
        self.session.iter_mut().for_each(|session| session.go_to(scene.camera));
    }

    /// Adds the present view to the scene's description.
    fn save_camera(&mut self, name: &str) {
        let (Some(scene), Some(control)) = (&mut self.app.scene, &self.output.control) else { return };
        let camera = control.camera(name);
        match append_camera(&scene.loaded.path, &camera) {
            Ok(()) => {
                let text = format!("camera {name} is in {} now", scene.loaded.path.display());
                // The floor is that of the camera from which the view was reached.
                let floor = scene.loaded.floors[scene.camera];
                scene.loaded.cameras.push(camera);
                scene.loaded.floors.push(floor);
                scene.camera = scene.loaded.cameras.len() - 1;
                self.output.announce(text);
            }
            Err(error) => self.output.complain(&error),
        }
    }

    fn reset(&mut self) -> Result<()> {
        self.choose_camera(self.app.scene.as_ref().map_or(0, |scene| scene.camera));
        self.app.reset()
    }
}
