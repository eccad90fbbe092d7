//! What things do to each other's light in a scene's picture: each approximation replaced by its exact form.
//!
//! Light is a sum of parts: what comes straight from lamps and the sun, and what of all other light comes back diffuse, or
//! mirrored. Both the fast picture and the exact one are drawn in these parts, as linear radiance averaged over each pixel,
//! so that one part of the fast picture can be exchanged for the exact one before the tone curve.

use glam::{DVec3, Vec3};

use super::super::bench::{Bench, exact};
use super::super::noise::{MeanAndHalves, floor_share};
use super::picture::{Picture, Subject};
use super::rows::{Ablation, Kind, Row};
use crate::Result;
use crate::reference::tone::display_bytes;
use crate::render::{LightDetail, LightModel, LightPart, Output, RenderSettings, Shading};

/// Frames of soft light for each of those of lamps and the sun: a path takes one of many ways.
const FRAMES: u32 = 2;

/// Radiance of each pixel.
type Radiance = Vec<DVec3>;

/// A fast picture in parts. Only the whole has the sky.
struct Fast {
    whole: Radiance,
    /// From lamps and the sun, with shadow maps and without.
    direct: Radiance,
    unblocked: Radiance,
    diffuse: Radiance,
    specular: Radiance,
}

/// An exact picture in parts, without the sky: the mean of all frames, then of either half.
struct Exact {
    direct: [Radiance; 3],
    diffuse: [Radiance; 3],
    specular: [Radiance; 3],
}

impl Subject<'_> {
    /// Draws everything; each row is kept as soon as it is known. Nothing where the scene has no light between things.
    pub fn measure_light(&self, keep: &mut impl FnMut(Vec<Row>) -> Result<()>) -> Result<()> {
        let settings = RenderSettings { light: LightModel::Baked, ..self.settings_for(&self.compressed) };
        let Some(fast) = self.fast(&settings)? else { return Ok(()) };
        let seen = self.drawn(&self.compressed, &settings)?;
        let exact = self.exact_parts(&settings)?;
        // The sky is what is left of the whole.
        let all = |index: usize| -> Radiance {
            let own = fast.whole.iter().enumerate().map(|(i, whole)| {
                let fast = fast.direct[i] + fast.diffuse[i] + fast.specular[i];
                whole - fast + exact.direct[index][i] + exact.diffuse[index][i] + exact.specular[index][i]
            });
            own.collect()
        };
        let [reference, halves @ ..] = [0, 1, 2].map(|index| self.shown(&all(index)));
        let row = |ablation, words: [&str; 3], numbers| Row::new(Kind::Light, &self.name, ablation, words, numbers);
        let error = self.flip(&seen, &reference)?;
        let floor = floor_share() * self.flip(&halves[0], &halves[1])?;
        keep(vec![
            row(Ablation::Whole, ["all light", "as it is", "exact"], [error, error, 0.0]),
            row(Ablation::Floor, ["floor", "reference", "its own two halves"], [floor, floor, 0.0]),
        ])?;

        let whole = self.shown(&fast.whole);
        let error = self.flip(&whole, &reference)?;
        let shadowed = exact_shadows(&fast.unblocked, &self.exact_shares(&settings)?);
        for (words, [old, new]) in [
            (["lightmap", "a texel's irradiance", "exact soft light"], [&fast.diffuse, &exact.diffuse[0]]),
            (["probes", "looked up, dimmed", "exact mirror images"], [&fast.specular, &exact.specular[0]]),
            (["shadow maps", "filtered depth", "exact shadows"], [&fast.direct, &shadowed]),
        ] {
            let replaced = fast.whole.iter().zip(old.iter().zip(new)).map(|(whole, (old, new))| whole - old + new);
            let replaced = self.shown(&replaced.collect::<Radiance>());
            let numbers = [self.flip(&whole, &replaced)?, error, self.flip(&replaced, &reference)?];
            keep(vec![row(Ablation::Exact, words, numbers)])?;
        }

        let [open, direct] = [LightDetail { shadow_size: Some(0), ..LightDetail::default() }, LightDetail::default()];
        let exactly = |light_detail| {
            let settings = RenderSettings { light: LightModel::Direct, light_detail, ..settings.clone() };
            Ok::<Picture, crate::Error>(self.shown(&self.integrated(settings, 1)?.all))
        };
        let [open, direct] = [exactly(open)?, exactly(direct)?];
        let [without, with] = [self.flip(&open, &reference)?, self.flip(&direct, &reference)?];
        keep(vec![
            row(Ablation::Other, ["no shadows", "exact", "none"], [self.flip(&direct, &open)?, with, without]),
            row(Ablation::Other, ["no indirect light", "exact", "none"], [with, 0.0, with]),
        ])
    }

    fn shown(&self, radiance: &[DVec3]) -> Picture {
        let ev = self.exposure_ev();
        radiance.iter().map(|radiance| display_bytes(radiance.max(DVec3::ZERO), ev)).collect()
    }

    /// The fast picture, one sample from each of many places in a pixel; `None` without a lightmap.
    fn fast(&self, settings: &RenderSettings) -> Result<Option<Fast>> {
        let settings = RenderSettings { output: Output::Linear, samples: 1, ..settings.clone() };
        let no_shadows = LightDetail { shadow_size: Some(0), ..settings.light_detail };
        let mut benches = Vec::new();
        for settings in [
            settings.clone(),
            RenderSettings { shading: Shading::Diffuse, ..settings.clone() },
            RenderSettings { shading: Shading::Specular, ..settings.clone() },
            RenderSettings { light_detail: no_shadows, ..settings },
        ] {
            benches.push(self.bench(&self.compressed, settings)?);
            if benches[0].renderer.lightmap().is_none() {
                return Ok(None);
            }
        }
        let none = || vec![DVec3::ZERO; self.detail.size.iter().product::<u32>() as usize];
        let [mut whole, mut direct, mut unblocked, mut diffuse, mut specular] = std::array::from_fn(|_| none());
        let part = 1.0 / f64::from(self.detail.places.pow(2));
        for eye in self.places() {
            let drawn = |bench: &mut Bench| {
                bench.eyes = vec![eye];
                bench.draw()?;
                bench.radiance()
            };
            let all = benches.iter_mut().map(drawn).collect::<Result<Vec<_>>>()?;
            for i in 0..whole.len() {
                let [all, soft, mirrored, open] = [0, 1, 2, 3].map(|bench: usize| all[bench][i]);
                whole[i] += part * all.as_dvec3();
                // The sky is the same in every mode.
                if all == soft && all == mirrored {
                    continue;
                }
                let straight = (all - soft - mirrored).as_dvec3();
                direct[i] += part * straight;
                unblocked[i] += part * (straight + (open - all).as_dvec3());
                diffuse[i] += part * soft.as_dvec3();
                specular[i] += part * mirrored.as_dvec3();
            }
        }
        Ok(Some(Fast { whole, direct, unblocked, diffuse, specular }))
    }

    fn exact_parts(&self, settings: &RenderSettings) -> Result<Exact> {
        let part = |part, light, frames| {
            let settings = RenderSettings { part, light, ..settings.clone() };
            let MeanAndHalves { all, halves: [first, second] } = self.integrated(settings, frames)?;
            Ok::<_, crate::Error>([all, first, second])
        };
        Ok(Exact {
            direct: part(LightPart::Direct, LightModel::Direct, 1)?,
            diffuse: part(LightPart::SoftDiffuse, LightModel::Baked, FRAMES)?,
            specular: part(LightPart::SoftSpecular, LightModel::Baked, FRAMES)?,
        })
    }

    /// Of each pixel's light from lamps and the sun, the share that nothing blocks.
    fn exact_shares(&self, settings: &RenderSettings) -> Result<Radiance> {
        let direct = RenderSettings { part: LightPart::Direct, light: LightModel::Direct, ..settings.clone() };
        let light_detail = LightDetail { shadow_size: Some(0), ..direct.light_detail };
        let open = RenderSettings { light_detail, ..direct.clone() };
        let [blocked, open] = [self.integrated(direct, 1)?.all, self.integrated(open, 1)?.all];
        Ok(blocked.iter().zip(&open).map(|(blocked, open)| shares(*blocked, *open)).collect())
    }

    /// The mean of many frames of the reference, `times` as many as [`super::picture::Detail::half_of_paths`] says.
    fn integrated(&self, settings: RenderSettings, times: u32) -> Result<MeanAndHalves<Radiance>> {
        let mut bench = self.bench(&self.compressed, exact(settings))?;
        bench.integrated(times * self.detail.half_of_paths, || (), |pixels| pixels.iter().map(Vec3::as_dvec3).collect())
    }
}

/// Light that nothing blocks, dimmed by exact shadows.
fn exact_shadows(unblocked: &[DVec3], shares: &[DVec3]) -> Radiance {
    unblocked.iter().zip(shares).map(|(light, share)| light * share).collect()
}

/// The part of each channel that is left; all of it where there is none.
fn shares(left: DVec3, all: DVec3) -> DVec3 {
    let share = |left: f64, all: f64| if all > 0.0 { (left / all).clamp(0.0, 1.0) } else { 1.0 };
    DVec3::new(share(left.x, all.x), share(left.y, all.y), share(left.z, all.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_of_each_channel() {
        let all = DVec3::new(2.0, 0.0, 4.0);
        assert_eq!(shares(DVec3::new(1.0, 0.0, 4.1), all), DVec3::new(0.5, 1.0, 1.0));
        assert_eq!(exact_shadows(&[all], &[DVec3::splat(0.5)]), [0.5 * all]);
    }
}
