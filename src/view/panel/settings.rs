//! Choices of the render settings. Each gives whole settings; the app finds out what has to be made again for them.

use clap::ValueEnum;
use egui::{ComboBox, RichText, Ui};

use super::place::place as control;
use crate::asset::Storage;
use crate::render::RenderSettings;
use crate::scene::atlas::SIDES;
use crate::view::action::Action;
use crate::view::measured::MeasuredSettings;

/// The settings that a section shows, with what has been measured of them.
pub struct Choices<'a> {
    new: RenderSettings,
    measured: &'a [MeasuredSettings],
}

/// Where a setting is among all.
type Place<T> = fn(&mut RenderSettings) -> &mut T;

/// A section of choices; what it changes becomes an action.
pub fn section(
    ui: &mut Ui,
    (settings, measured): (&RenderSettings, &[MeasuredSettings]),
    actions: &mut Vec<Action>,
    show: impl FnOnce(&mut Choices<'_>, &mut Ui),
) {
    let mut choices = Choices { new: settings.clone(), measured };
    show(&mut choices, ui);
    if choices.new != *settings {
        actions.push(Action::Settings(Box::new(choices.new)));
    }
}

impl Choices<'_> {
    /// The shading, and what it is made of.
    pub fn shading(&mut self, ui: &mut Ui) {
        self.one_of_enum(ui, "shading", |s| &mut s.shading);
        self.one_of_enum(ui, "masking and shadowing", |s| &mut s.geometry);
        self.one_of_enum(ui, "bounces between microfacets", |s| &mut s.scattering);
        self.one_of_enum(ui, "mirrored panorama", |s| &mut s.split_sum);
        self.one_of_enum(ui, "modelled", |s| &mut s.model);
    }

    /// Which light is modelled.
    pub fn light(&mut self, ui: &mut Ui) {
        self.one_of_enum(ui, "light", |s| &mut s.light);
    }

    /// Numbers of samples and texels.
    pub fn quality(&mut self, ui: &mut Ui) {
        let what = if self.measured.is_empty() {
            "`pbr-vr measure ladder` with this scene's file finds time and error of each choice, to be shown here"
        } else {
            "beside a choice: a frame's time, as a multiple of the default's, and the error (FLIP), measured on this GPU"
        };
        ui.label(RichText::new(what).small().weak());
        self.one_of(ui, "samples a pixel", |s| &mut s.samples, &[1, 4], u32::to_string);
        self.one_of(ui, "scale of the picture", |s| &mut s.scale, &[1.0, 0.85, 0.7, 0.5, 0.25], f32::to_string);
        self.one_of(ui, "mirrored light, texels", |s| &mut s.cube_size, &powers(16, 1024), u32::to_string);
        self.one_of(ui, "diffuse light, texels", |s| &mut s.irradiance_size, &powers(4, 128), u32::to_string);
        self.detail(ui);
        let storages = [None, Some(Storage::Raw), Some(Storage::Bc)];
        self.one_of(
            ui,
            "textures",
            |s| &mut s.textures.storage,
            &storages,
            |storage| storage.as_ref().map_or_else(|| "automatic".into(), value_name),
        );
        let anisotropies = automatic_and(&[1, 2, 4, 8, 16]);
        self.one_of(ui, "anisotropy", |s| &mut s.textures.anisotropy, &anisotropies, or_automatic);
        self.one_of(ui, "levels left out", |s| &mut s.textures.drop_levels, &[0, 1, 2, 3, 4], u32::to_string);
    }

    fn detail(&mut self, ui: &mut Ui) {
        let with_none = |sizes: Vec<u32>| [vec![0], sizes].concat();
        let shadows = automatic_and(&with_none(powers(256, 8192)));
        self.one_of(
            ui,
            "shadow map, texels",
            |s| &mut s.light_detail.shadow_size,
            &shadows,
            |size| match size {
                Some(0) => "none".into(),
                size => or_automatic(size),
            },
        );
        let sides = automatic_and(&SIDES);
        self.one_of(ui, "lightmap, texels", |s| &mut s.light_detail.lightmap_size, &sides, or_automatic);
        let samples = powers(8, 4096);
        self.one_of(ui, "samples of a texel", |s| &mut s.light_detail.lightmap_samples, &samples, u32::to_string);
        let probes = with_none(powers(16, 1024));
        self.one_of(
            ui,
            "probes, texels",
            |s| &mut s.light_detail.probe_size,
            &probes,
            |size| match size {
                0 => "none".into(),
                size => size.to_string(),
            },
        );
    }

    fn one_of_enum<T: ValueEnum + PartialEq + Copy>(&mut self, ui: &mut Ui, label: &str, place: Place<T>) {
        let help = |value: &T| Some(value.to_possible_value()?.get_help()?.to_string());
        self.choose(ui, label, place, T::value_variants(), (value_name, help));
    }

    fn one_of<T: PartialEq + Copy>(
        &mut self,
        ui: &mut Ui,
        label: &str,
        place: Place<T>,
        all: &[T],
        text: impl Fn(&T) -> String,
    ) {
        self.choose(ui, label, place, all, (text, |_: &T| None));
    }

    /// A list of values, each with its text, what has been measured of it and, where there is any, its help.
    fn choose<T: PartialEq + Copy>(
        &mut self,
        ui: &mut Ui,
        label: &str,
        place: Place<T>,
        all: &[T],
        (text, help): (impl Fn(&T) -> String, impl Fn(&T) -> Option<String>),
    ) {
        let measured = self.measured;
        ui.horizontal(|ui| {
            let value = place(&mut self.new);
            let choice = ComboBox::from_id_salt(label).selected_text(text(value)).show_ui(ui, |ui| {
                for choice in all {
                    let name = text(choice);
                    let found = beside(measured, place, *choice);
                    let shown = found.map_or_else(|| name.clone(), |found| format!("{name}   {found}"));
                    let response = ui.selectable_value(value, *choice, shown);
                    control(ui, &format!("{label}={name}"), &response);
                    help(choice).into_iter().for_each(|help| drop(response.clone().on_hover_text(help)));
                }
            });
            control(ui, label, &choice.response);
            ui.label(label);
        });
    }
}

/// What has been measured of a value with all other settings at their defaults.
fn beside<T>(measured: &[MeasuredSettings], place: Place<T>, value: T) -> Option<String> {
    let mut alone = RenderSettings::default();
    *place(&mut alone) = value;
    let found = measured.iter().find(|measured| measured.settings == alone)?;
    Some(format!("{:.2} x time, FLIP {:.3}", found.time, found.flip))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_is_said_beside_the_value_that_it_is_of() {
        let measured = |settings, time, flip| MeasuredSettings { settings, time, flip };
        let default = RenderSettings::default();
        let all = [
            measured(default.clone(), 1.0, 0.0104),
            measured(RenderSettings { samples: 1, ..default.clone() }, 0.4, 0.03),
            measured(RenderSettings { samples: 1, scale: 0.5, ..default }, 0.1, 0.08),
        ];
        let samples = |value| beside(&all, |settings| &mut settings.samples, value);
        assert_eq!(samples(4).as_deref(), Some("1.00 x time, FLIP 0.010"));
        assert_eq!(samples(1).as_deref(), Some("0.40 x time, FLIP 0.030"));
        assert_eq!(beside(&all, |settings| &mut settings.scale, 0.5), None, "only measured with one sample");
    }

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
