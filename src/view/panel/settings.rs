//! Choices of the render settings. Each gives whole settings; the app finds out what has to be made again for them.

use clap::ValueEnum;
use egui::{ComboBox, Ui};

use super::place::place;
use crate::asset::Storage;
use crate::render::{LightDetail, RenderSettings};
use crate::scene::atlas::SIDES;
use crate::view::action::Action;

/// The shading, and what it is made of.
pub fn shading(ui: &mut Ui, settings: &RenderSettings, actions: &mut Vec<Action>) {
    let mut new = settings.clone();
    one_of_enum(ui, "shading", &mut new.shading);
    one_of_enum(ui, "masking and shadowing", &mut new.geometry);
    one_of_enum(ui, "bounces between microfacets", &mut new.scattering);
    one_of_enum(ui, "mirrored panorama", &mut new.split_sum);
    one_of_enum(ui, "modelled", &mut new.model);
    change(settings, new, actions);
}

/// Which light is modelled.
pub fn light(ui: &mut Ui, settings: &RenderSettings, actions: &mut Vec<Action>) {
    let mut new = settings.clone();
    one_of_enum(ui, "light", &mut new.light);
    change(settings, new, actions);
}

/// Numbers of samples and texels.
pub fn quality(ui: &mut Ui, settings: &RenderSettings, actions: &mut Vec<Action>) {
    let mut new = settings.clone();
    one_of(ui, "samples a pixel", &mut new.samples, &[1, 4], u32::to_string);
    one_of(ui, "scale of the picture", &mut new.scale, &[1.0, 0.75, 0.5, 0.25], f32::to_string);
    one_of(ui, "mirrored light, texels", &mut new.cube_size, &powers(16, 1024), u32::to_string);
    one_of(ui, "diffuse light, texels", &mut new.irradiance_size, &powers(4, 128), u32::to_string);
    detail(ui, &mut new.light_detail);
    let textures = &mut new.textures;
    one_of(ui, "textures", &mut textures.storage, &[None, Some(Storage::Raw), Some(Storage::Bc)], |storage| {
        storage.as_ref().map_or_else(|| "automatic".into(), value_name)
    });
    one_of(ui, "anisotropy", &mut textures.anisotropy, &automatic_and(&[1, 2, 4, 8, 16]), or_automatic);
    one_of(ui, "levels left out", &mut textures.drop_levels, &[0, 1, 2, 3, 4], u32::to_string);
    change(settings, new, actions);
}

fn detail(ui: &mut Ui, detail: &mut LightDetail) {
    let with_none = |sizes: Vec<u32>| [vec![0], sizes].concat();
    let shadows = automatic_and(&with_none(powers(256, 8192)));
    one_of(ui, "shadow map, texels", &mut detail.shadow_size, &shadows, |size| match size {
        Some(0) => "none".into(),
        size => or_automatic(size),
    });
    one_of(ui, "lightmap, texels", &mut detail.lightmap_size, &automatic_and(&SIDES), or_automatic);
    one_of(ui, "samples of a texel", &mut detail.lightmap_samples, &powers(8, 4096), u32::to_string);
    one_of(ui, "probes, texels", &mut detail.probe_size, &with_none(powers(16, 1024)), |size| match size {
        0 => "none".into(),
        size => size.to_string(),
    });
}

fn change(old: &RenderSettings, new: RenderSettings, actions: &mut Vec<Action>) {
    if *old != new {
        actions.push(Action::Settings(Box::new(new)));
    }
}

fn powers(least: u32, most: u32) -> Vec<u32> {
    std::iter::successors(Some(least), |size| Some(2 * size)).take_while(|size| *size <= most).collect()
}

fn automatic_and(values: &[u32]) -> Vec<Option<u32>> {
    std::iter::once(None).chain(values.iter().copied().map(Some)).collect()
}

fn or_automatic(value: &Option<u32>) -> String {
    value.map_or_else(|| "automatic".into(), |value| value.to_string())
}

/// The name that the command line has for a value.
fn value_name(value: &impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

fn one_of_enum<T: ValueEnum + PartialEq + Copy>(ui: &mut Ui, label: &str, value: &mut T) {
    let help = |value: &T| Some(value.to_possible_value()?.get_help()?.to_string());
    choose(ui, label, value, T::value_variants(), (value_name, help));
}

fn one_of<T: PartialEq + Copy>(ui: &mut Ui, label: &str, value: &mut T, all: &[T], text: impl Fn(&T) -> String) {
    choose(ui, label, value, all, (text, |_: &T| None));
}

/// A list of values, each with its text and, where there is any, its help.
fn choose<T: PartialEq + Copy>(
    ui: &mut Ui,
    label: &str,
    value: &mut T,
    all: &[T],
    (text, help): (impl Fn(&T) -> String, impl Fn(&T) -> Option<String>),
) {
    ui.horizontal(|ui| {
        let choice = ComboBox::from_id_salt(label).selected_text(text(value)).show_ui(ui, |ui| {
            for choice in all {
                let response = ui.selectable_value(value, *choice, text(choice));
                place(ui, &format!("{label}={}", text(choice)), &response);
                help(choice).into_iter().for_each(|help| drop(response.clone().on_hover_text(help)));
            }
        });
        place(ui, label, &choice.response);
        ui.label(label);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that the command line refuses must not be offered.
    #[test]
    fn the_command_line_takes_every_offered_size() {
        use clap::{Args, FromArgMatches};
        let parses = |flag: &str, value: String| {
            let command = RenderSettings::augment_args(clap::Command::new("settings").no_binary_name(true));
            let matches = command.try_get_matches_from([flag, &value]);
            matches.is_ok_and(|matches| RenderSettings::from_arg_matches(&matches).is_ok())
        };
        let sizes = [
            ("--cube-size", powers(16, 1024)),
            ("--irradiance-size", powers(4, 128)),
            ("--shadow-size", [vec![0], powers(256, 8192)].concat()),
            ("--lightmap-size", SIDES.to_vec()),
            ("--lightmap-samples", powers(8, 4096)),
            ("--probe-size", [vec![0], powers(16, 1024)].concat()),
            ("--anisotropy", vec![1, 2, 4, 8, 16]),
            ("--drop-levels", vec![0, 4]),
            ("--samples", vec![1, 4]),
        ];
        for (flag, values) in sizes {
            assert!(!values.is_empty() && values.iter().all(|value| parses(flag, value.to_string())), "{flag}");
        }
        assert!(!parses("--cube-size", "2048".into()));
    }
}
