//! The panel's sections for materials and lamps: what they are, and changes of them.

use egui::{Button, ComboBox, RichText, Slider, Ui};

use super::place::place;
use crate::render::MaterialFactors;
use crate::view::action::Action;
use crate::view::shown_scene::ShownScene;

/// Limits of a lamp's slider, stops. The lowest is dark enough to count as off.
const LAMP_STOPS: std::ops::RangeInclusive<f32> = -10.0..=6.0;

/// The chosen material: its name, maps and factors.
pub fn material(ui: &mut Ui, scene: &ShownScene, actions: &mut Vec<Action>) {
    let materials = &scene.loaded.parts.materials;
    let name = |index: usize| match materials[index].name.as_str() {
        "" => format!("material {}", index + 1),
        name => name.to_owned(),
    };
    let shown = scene.material.map_or_else(|| "click on an object".into(), name);
    let choice = ComboBox::from_id_salt("material").selected_text(shown).show_ui(ui, |ui| {
        for index in 0..materials.len() {
            let entry = ui.selectable_label(scene.material == Some(index), name(index));
            place(ui, &format!("material={}", name(index)), &entry);
            if entry.clicked() {
                actions.push(Action::Material(index));
            }
        }
    });
    place(ui, "material", &choice.response);
    let Some(index) = scene.material else { return };
    let Some(factors) = scene.loaded.renderer.factors(index) else { return };
    for map in &materials[index].maps {
        ui.label(RichText::new(map).small());
    }
    if materials[index].maps.is_empty() {
        ui.label(RichText::new("no maps").small());
    }
    let changed = sliders(ui, factors);
    if changed != factors {
        actions.push(Action::Factors(index, Some(changed)));
    }
    let is_edited = scene.loaded.renderer.edits().materials.contains_key(&index);
    let back = ui.add_enabled(is_edited, Button::new("As in its file"));
    place(ui, "As in its file", &back);
    if back.clicked() {
        actions.push(Action::Factors(index, None));
    }
}

/// The factors after what was done to their controls.
fn sliders(ui: &mut Ui, factors: MaterialFactors) -> MaterialFactors {
    let MaterialFactors { base_color, mut metallic, mut roughness } = factors;
    let mut linear = base_color.to_array();
    ui.horizontal(|ui| {
        let colour = ui.color_edit_button_rgb(&mut linear).on_hover_text("multiplies the map, where there is one");
        place(ui, "base color", &colour);
        ui.label("base color");
    });
    let unit = 0.0..=1.0;
    let slider = ui.add(Slider::new(&mut metallic, unit.clone()).fixed_decimals(2).text("metallic"));
    place(ui, "metallic", &slider);
    let slider = ui.add(Slider::new(&mut roughness, unit).fixed_decimals(2).text("roughness"));
    place(ui, "roughness", &slider);
    MaterialFactors { base_color: linear.into(), metallic, roughness }
}

/// Each lamp with its strength in stops.
pub fn lamps(ui: &mut Ui, scene: &ShownScene, actions: &mut Vec<Action>) {
    let lamps = &scene.loaded.parts.lamps;
    if lamps.is_empty() {
        ui.label("none");
    }
    for (index, kind) in lamps.iter().enumerate() {
        let factor = scene.loaded.renderer.edits().lamps.get(&index).copied();
        let is_on = factor != Some(0.0);
        ui.horizontal(|ui| {
            let mut on = is_on;
            let number = index + 1;
            let check = ui.checkbox(&mut on, format!("{kind} {number}"));
            place(ui, &format!("lamp {number}"), &check);
            if on != is_on {
                actions.push(Action::Lamp(index, if on { None } else { Some(0.0) }));
            }
            let mut stops = factor.filter(|factor| *factor > 0.0).map_or(0.0, f32::log2);
            let slider = Slider::new(&mut stops, LAMP_STOPS).suffix(" EV").fixed_decimals(1);
            let slider = ui.add_enabled(is_on, slider);
            place(ui, &format!("lamp {number} EV"), &slider);
            if slider.changed() {
                actions.push(Action::Lamp(index, Some(stops.exp2()).filter(|_| stops != 0.0)));
            }
        });
    }
}
