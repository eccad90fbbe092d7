//! The sections of the panel.

use std::path::{Path, PathBuf};

use egui::{CollapsingHeader, ComboBox, Grid, RichText, Slider, Ui};

use super::library::{SIZE, Thumbnail};
use super::place::place;
use super::{MATERIAL, Panel, PanelInputs, graph, parts, rate_text, settings, style};
use crate::render::Change;
use crate::view::action::Action;
use crate::view::control::Mode;
use crate::view::loader::file_name;
use crate::view::shown_scene::ShownScene;

/// Limits of the exposure's slider, stops.
const EXPOSURE: std::ops::RangeInclusive<f32> = -10.0..=10.0;
/// Points: two fit beside each other.
const THUMBNAIL: f32 = 116.0;
/// Points; a longer list of panoramas scrolls.
const LIST_HEIGHT: f32 = 220.0;
/// Warnings that are shown; the terminal has all.
const MOST_WARNINGS: usize = 100;

/// Keys and gestures, and what they do.
const KEYS: [(&str, &str); 19] = [
    ("H  F1", "show or hide this panel"),
    ("click", "the material there, with its factors"),
    ("drag left", "orbit; look around while flying"),
    ("drag right", "pan (also the middle button)"),
    ("wheel", "zoom; speed while flying"),
    ("Tab", "orbit or fly"),
    ("W A S D Q E", "fly; with Shift faster"),
    ("1-9  C", "cameras of the scene; the next one"),
    ("PgUp  PgDn", "previous, next scene"),
    ("K  L", "previous, next panorama"),
    ("M  N", "next, previous shading"),
    ("[  ]", "exposure -, + 1/3 stop"),
    (",  .", "turn the panorama"),
    ("R", "reset all"),
    ("V", "vsync, mailbox, immediate"),
    ("P  F12", "write a screenshot"),
    ("F11", "fullscreen (also Alt+Enter)"),
    ("drop a file", "scene, model, folder, panorama"),
    ("Esc", "quit"),
];

impl Panel {
    /// All sections, from top to bottom.
    pub(super) fn sections(&mut self, ui: &mut Ui, inputs: &PanelInputs<'_>, actions: &mut Vec<Action>) {
        let Some(scene) = &inputs.app.scene else { return };
        let chosen = (inputs.app.settings(), scene.loaded.measured.as_slice());
        self.head(ui, inputs, scene, actions);
        self.section(ui, "Scene", true, |panel, ui| panel.scene(ui, inputs, scene, actions));
        self.section(ui, "Light", true, |panel, ui| panel.light(ui, inputs, scene, actions));
        self.section(ui, MATERIAL, false, |_, ui| parts::material(ui, scene, actions));
        self.section(ui, "Lamps", false, |_, ui| parts::lamps(ui, scene, actions));
        self.section(ui, "Shading", false, |_, ui| {
            settings::section(ui, chosen, actions, |choices, ui| choices.shading(ui));
        });
        self.section(ui, "Quality", false, |_, ui| {
            settings::section(ui, chosen, actions, |choices, ui| choices.quality(ui));
        });
        self.section(ui, "Statistics", false, |panel, ui| panel.statistics(ui, inputs, scene, actions));
        let (count, newest) = inputs.app.report().newest_warnings(MOST_WARNINGS);
        self.section(ui, &format!("Warnings ({count})"), false, |_, ui| warnings(ui, &newest));
        self.section(ui, "Keys", false, |_, ui| keys(ui));
    }

    /// A section that remembers whether it is open.
    fn section(&mut self, ui: &mut Ui, title: &str, open: bool, add: impl FnOnce(&mut Self, &mut Ui)) {
        // Without a count, if there is one.
        let id = title.split(" (").next().unwrap_or(title).to_owned();
        let was_open = self.saved.sections.get(&id).copied().unwrap_or(open);
        let opened = self.opened.take_if(|opened| *opened == title).map(|_| true);
        let header = CollapsingHeader::new(RichText::new(title).strong()).id_salt(&id).default_open(was_open);
        let shown = header.open(opened).show(ui, |ui| add(self, ui));
        place(ui, &id, &shown.header_response);
        let is_open = shown.fully_open();
        if is_open != was_open {
            self.saved.sections.insert(id, is_open);
            self.saved.store();
        }
    }

    fn head(&self, ui: &mut Ui, inputs: &PanelInputs<'_>, scene: &ShownScene, actions: &mut Vec<Action>) {
        ui.add_space(4.0);
        ui.horizontal(|ui| {
            ui.heading(&scene.loaded.name);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if inputs.alone {
                    return;
                }
                let hide = ui.button("Hide (H)");
                place(ui, "Hide", &hide);
                if hide.clicked() {
                    actions.push(Action::Panel);
                }
            });
        });
        let changes = scene.loaded.renderer.settings().difference(inputs.app.settings()) != Change::Nothing;
        let rate = rate_text(inputs.clock).unwrap_or_else(|| "not measured yet".into());
        ui.label(RichText::new(if changes { "changing to other settings".into() } else { rate }).small());
        inputs.headset.iter().for_each(|line| drop(ui.label(RichText::new(line).small())));
        ui.horizontal_wrapped(|ui| {
            let buttons = [
                ("Screenshot", "P", Action::Screenshot),
                ("Reset all", "R", Action::Reset),
                ("Fullscreen", "F11", Action::Fullscreen),
            ];
            // Alone, the panel is in a headset.
            let fits = |action: &Action| !inputs.alone || *action == Action::Reset;
            for (text, key, action) in buttons.into_iter().filter(|(_, _, action)| fits(action)) {
                let button = ui.button(text).on_hover_text(key);
                place(ui, text, &button);
                if button.clicked() {
                    actions.push(action);
                }
            }
        });
        ui.separator();
    }

    fn scene(&mut self, ui: &mut Ui, inputs: &PanelInputs<'_>, scene: &ShownScene, actions: &mut Vec<Action>) {
        let files = inputs.app.playlist().scenes();
        let shown = [Action::PreviousScene, Action::NextScene];
        if let Some(file) = file_choice(ui, "scene", files, Some(&scene.loaded.path), shown, actions) {
            actions.push(Action::Open(file));
        }
        ui.horizontal(|ui| {
            ui.label("camera");
            let cameras = &scene.loaded.cameras;
            let name = &cameras[scene.camera].name;
            let choice = ComboBox::from_id_salt("camera").selected_text(name).show_ui(ui, |ui| {
                for (index, camera) in cameras.iter().enumerate() {
                    // Clicking on the present one goes back to it.
                    let label = ui.selectable_label(index == scene.camera, &camera.name);
                    place(ui, &format!("camera={}", camera.name), &label);
                    if label.clicked() {
                        actions.push(Action::Camera(index));
                    }
                }
            });
            place(ui, "camera", &choice.response);
            if let Some(control) = inputs.control {
                let flies = control.mode() == Mode::Fly;
                let fly = ui.selectable_label(flies, "fly").on_hover_text("Tab; W A S D Q E move");
                place(ui, "fly", &fly);
                if fly.clicked() {
                    actions.push(Action::SwitchMode);
                }
            }
        });
        if inputs.control.is_some() {
            ui.horizontal(|ui| {
                let name = egui::TextEdit::singleline(&mut self.camera_name).hint_text("name").desired_width(120.0);
                let typed = ui.add(name.char_limit(64));
                place(ui, "view's name", &typed);
                let name = self.camera_name.trim();
                let save = ui.add_enabled(!name.is_empty(), egui::Button::new("Save view"));
                place(ui, "Save view", &save);
                if save.on_hover_text("adds this view to the scene's description, as a camera").clicked() {
                    actions.push(Action::SaveCamera(name.to_owned()));
                    self.camera_name.clear();
                }
            });
        }
    }

    fn light(&mut self, ui: &mut Ui, inputs: &PanelInputs<'_>, scene: &ShownScene, actions: &mut Vec<Action>) {
        let mut exposure = scene.exposure_ev;
        let slider = ui.add(Slider::new(&mut exposure, EXPOSURE).suffix(" EV").fixed_decimals(1).text("exposure"));
        place(ui, "exposure", &slider);
        if slider.changed() {
            actions.push(Action::Exposure(exposure));
        }
        let mut degrees = scene.environment_rotation.to_degrees().rem_euclid(360.0);
        let slider = ui.add(Slider::new(&mut degrees, 0.0..=360.0).suffix("°").fixed_decimals(0).text("turn"));
        place(ui, "turn", &slider);
        if slider.changed() {
            actions.push(Action::Rotation(degrees.to_radians()));
        }
        let chosen = (inputs.app.settings(), scene.loaded.measured.as_slice());
        settings::section(ui, chosen, actions, |choices, ui| choices.light(ui));
        ui.horizontal(|ui| {
            ui.label("panorama");
            step(ui, "panorama", [Action::PreviousPanorama, Action::NextPanorama], actions);
            ui.label(scene.panorama.as_deref().map_or_else(|| "uniform light".into(), file_name));
        });
        let height = LIST_HEIGHT;
        style::scrolled().id_salt("panoramas").max_height(height).show(ui, |ui| {
            ui.horizontal_wrapped(|ui| {
                for file in inputs.app.playlist().panoramas() {
                    // The same file may be named in several ways.
                    let shown = scene.panorama.as_ref().is_some_and(|shown| shown.file_name() == file.file_name());
                    if self.panorama(ui, file, shown) {
                        actions.push(Action::Open(file.clone()));
                    }
                }
            });
        });
    }

    /// A panorama as a button; whether it was clicked.
    fn panorama(&mut self, ui: &mut Ui, file: &Path, shown: bool) -> bool {
        let name = file_name(file);
        let size = egui::vec2(THUMBNAIL, THUMBNAIL * SIZE[1] as f32 / SIZE[0] as f32);
        let (id, area) = ui.allocate_space(size + egui::Vec2::splat(6.0));
        // Only what can be seen is loaded: a folder may hold thousands.
        if !ui.is_rect_visible(area) {
            return false;
        }
        let context = ui.ctx().clone();
        let response = ui.interact(area, id, egui::Sense::click());
        place(ui, &name, &response);
        let visuals = ui.style().interact_selectable(&response, shown);
        let frame = if shown { egui::Color32::from_rgb(90, 170, 255) } else { visuals.bg_fill };
        ui.painter().rect_filled(area, 3.0, frame);
        let inner = egui::Rect::from_center_size(area.center(), size);
        let text = |ui: &Ui, text: &str| {
            let font = egui::FontId::proportional(11.0);
            let laid_out = ui.painter().layout(text.to_owned(), font, visuals.text_color(), inner.width());
            ui.painter_at(inner).galley(inner.min, laid_out, visuals.text_color());
        };
        match self.thumbnails.get(&context, file) {
            Thumbnail::Ready(texture) => {
                let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
                ui.painter().image(texture.id(), inner, whole, egui::Color32::WHITE);
                response.on_hover_text(name).clicked()
            }
            Thumbnail::Awaited => {
                text(ui, &name);
                response.clicked()
            }
            Thumbnail::Broken(problem) => {
                text(ui, &format!("{name}: cannot be read"));
                response.on_hover_text(problem).clicked()
            }
        }
    }

    fn statistics(&self, ui: &mut Ui, inputs: &PanelInputs<'_>, scene: &ShownScene, actions: &mut Vec<Action>) {
        graph::show(ui, inputs.clock);
        let mut continuous = inputs.continuous;
        let what = "else only when something changes";
        if inputs.headset.is_none() {
            let all_the_time = ui.checkbox(&mut continuous, "draw all the time").on_hover_text(what);
            place(ui, "draw all the time", &all_the_time);
            if all_the_time.changed() {
                actions.push(Action::Continuous(continuous));
            }
        }
        let renderer = &scene.loaded.renderer;
        let counts = renderer.draw_counts();
        let mib = |bytes: u64| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20));
        let rate = inputs.clock.rate();
        Grid::new("statistics").num_columns(2).striped(true).show(ui, |ui| {
            let mut row = |name: &str, value: String| {
                ui.label(name);
                ui.label(value);
                ui.end_row();
            };
            if let Some(rate) = rate {
                row("frame", format!("{:.2} ms, {:.1} a second", rate.frame_ms, rate.frames_per_second));
                row("CPU, recording", format!("{:.2} ms", rate.record_ms));
                for pass in &rate.passes {
                    row(&format!("GPU, {}", pass.name), format!("{:.2} ms", pass.ms));
                }
            }
            row("draws", format!("{}, {} of {} ranges", counts.calls, counts.ranges, counts.all_ranges));
            row("textures", mib(renderer.texture_facts().bytes));
            row("shadow maps", mib(renderer.shadow_bytes()));
            if let Some(error) = renderer.standard_error(inputs.slot) {
                row("reference", error.to_string());
            }
            row("frames are shown", inputs.present_mode.to_owned());
            row("GPU", inputs.app.context.gpu.info().name.clone());
        });
    }
}

fn warnings(ui: &mut Ui, newest: &[String]) {
    if newest.is_empty() {
        ui.label("none");
    }
    newest.iter().for_each(|warning| drop(ui.label(style::error(warning))));
}

fn keys(ui: &mut Ui) {
    Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
        for (key, what) in KEYS {
            ui.label(RichText::new(key).monospace());
            ui.label(what);
            ui.end_row();
        }
    });
}

/// A list of files to choose from, with buttons for the previous and the next; returns the chosen one.
fn file_choice(
    ui: &mut Ui,
    label: &str,
    files: &[PathBuf],
    shown: Option<&Path>,
    steps: [Action; 2],
    actions: &mut Vec<Action>,
) -> Option<PathBuf> {
    let mut chosen = None;
    ui.horizontal(|ui| {
        ui.label(label);
        step(ui, label, steps, actions);
        let name = shown.map_or_else(String::new, file_name);
        let choice = ComboBox::from_id_salt(label).selected_text(name).show_ui(ui, |ui| {
            for file in files {
                let entry = ui.selectable_label(
                    shown.is_some_and(|shown| shown.file_name() == file.file_name()),
                    file_name(file),
                );
                place(ui, &format!("{label}={}", file_name(file)), &entry);
                if entry.clicked() {
                    chosen = Some(file.clone());
                }
            }
        });
        place(ui, label, &choice.response);
    });
    chosen
}

/// Buttons for the previous and the next.
fn step(ui: &mut Ui, label: &str, [previous, next]: [Action; 2], actions: &mut Vec<Action>) {
    for (text, action) in [("<", previous), (">", next)] {
        let button = ui.button(text);
        place(ui, &format!("{label}{text}"), &button);
        if button.clicked() {
            actions.push(action);
        }
    }
}
