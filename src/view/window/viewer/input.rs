//! What keys and mouse do to a viewer.

use std::f32::consts::TAU;

use clap::ValueEnum;
use glam::{Mat4, Vec2};
use winit::dpi::PhysicalPosition;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta};
use winit::keyboard::ModifiersState;
use winit::window::Fullscreen;

use super::super::super::look::next_shading;
use super::super::keys::{Action, action};
use super::{Drag, Viewer};
use crate::Result;
use crate::render::Shading;

/// Radians of one step of the panorama.
const TURN_STEP: f32 = TAU / 72.0;
/// Pixels of a touchpad's scrolling, at scale 1, that count as one notch of a wheel.
const PIXELS_PER_NOTCH: f64 = 40.0;

impl Viewer {
    /// A key went down or up; returns whether that ends the program.
    pub fn key(&mut self, event: &KeyEvent) -> Result<bool> {
        self.held.follow(event);
        let wanted = event.state.is_pressed().then(|| action(event, self.modifiers.alt_key())).flatten();
        match wanted {
            Some(Action::Quit) => return Ok(true),
            Some(action) => self.perform(action)?,
            None => {}
        }
        Ok(false)
    }

    /// Alt, Shift and the like.
    pub fn modifiers(&mut self, state: ModifiersState) {
        self.modifiers = state;
    }

    /// The keyboard came or went.
    pub fn focus(&mut self, focused: bool) {
        self.focused = focused;
        if !focused {
            self.held.release_all();
            self.drag = None;
        }
    }

    /// A mouse button went down or up.
    pub fn button(&mut self, state: ElementState, button: MouseButton) {
        let drag = match button {
            MouseButton::Left => Drag::Turn,
            MouseButton::Right | MouseButton::Middle => Drag::Pan,
            _ => return,
        };
        match state {
            ElementState::Pressed => self.drag = Some(drag),
            ElementState::Released => self.drag = self.drag.filter(|current| *current != drag),
        }
    }

    /// The mouse pointer is somewhere else.
    pub fn pointer(&mut self, position: PhysicalPosition<f64>) {
        let before = self.pointer.replace(position).unwrap_or(position);
        let height = f64::from(self.size[1].max(1));
        let moved = Vec2::new((position.x - before.x) as f32, (position.y - before.y) as f32) / height as f32;
        if let Some((_, control)) = &mut self.stage {
            match self.drag {
                Some(Drag::Turn) => control.turn(moved),
                Some(Drag::Pan) => control.pan(moved),
                None => {}
            }
        }
    }

    /// The wheel was turned, or two fingers moved.
    pub fn wheel(&mut self, delta: MouseScrollDelta) {
        let notches = match delta {
            MouseScrollDelta::LineDelta(_, lines) => lines,
            MouseScrollDelta::PixelDelta(by) => (by.y / (PIXELS_PER_NOTCH * self.window.scale_factor())) as f32,
        };
        if let Some((_, control)) = &mut self.stage {
            control.wheel(notches);
        }
    }

    fn perform(&mut self, action: Action) -> Result<()> {
        match action {
            // `key` has seen to it.
            Action::Quit => {}
            Action::Keys => self.hud.switch_keys(),
            Action::Screenshot => self.screenshot = true,
            Action::Fullscreen => {
                let full = self.window.fullscreen().is_none().then_some(Fullscreen::Borderless(None));
                self.window.set_fullscreen(full);
            }
            Action::NextPresentMode => {
                let mode = self.canvas.next_mode();
                self.note(format!("showing frames: {}", mode.name()));
            }
            // On the desk one may hold the headset still.
            Action::NextShading => self.shade(1, true)?,
            Action::PreviousShading => self.shade(Shading::value_variants().len() - 1, true)?,
            Action::SwitchMode => {
                if let Some((_, control)) = &mut self.stage {
                    control.switch_mode();
                }
            }
            Action::NextCamera => self.choose_camera(self.camera + 1),
            Action::Camera(index) => {
                let count = self.stage.as_ref().map_or(0, |(stage, _)| stage.cameras.len());
                if index < count {
                    self.choose_camera(index);
                } else {
                    self.note(format!("there is no camera {}, only {count}", index + 1));
                }
            }
            Action::Reset => self.reset(),
            Action::Exposure(thirds) => {
                if let Some((stage, _)) = &mut self.stage {
                    *stage.renderer.exposure_ev() += f32::from(thirds) / 3.0;
                }
            }
            Action::Turn(steps) => {
                if let Some((stage, _)) = &mut self.stage {
                    let turn = stage.renderer.environment_rotation();
                    *turn = (*turn + f32::from(steps) * TURN_STEP).rem_euclid(TAU);
                }
            }
        }
        Ok(())
    }

    fn choose_camera(&mut self, index: usize) {
        if let Some((stage, control)) = &mut self.stage {
            self.camera = index % stage.cameras.len();
            control.set_camera(&stage.cameras[self.camera]);
            self.session.iter_mut().for_each(|session| session.go_to(self.camera));
        }
    }

    fn reset(&mut self) {
        self.choose_camera(self.camera);
        if let Some((stage, _)) = &mut self.stage {
            *stage.renderer.exposure_ev() = stage.exposure_ev;
            *stage.renderer.environment_rotation() = stage.rotation_degrees.to_radians();
            *stage.renderer.world_from_models() = Mat4::IDENTITY;
        }
    }

    pub(super) fn shade(&mut self, forward: usize, holds_still: bool) -> Result<()> {
        self.shading = next_shading(self.shading, forward, holds_still);
        match &mut self.stage {
            Some((stage, _)) => stage.renderer.set_shading(self.shading),
            None => Ok(()),
        }
    }
}
