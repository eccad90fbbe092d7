//! The stages of a lightmap's computation: their order, their samples, and how many bounces a scene takes.

use super::light_detail::{AT_ONCE, SAMPLES};
use crate::gpu::FRAMES_IN_FLIGHT;

/// Names of the passes, for their times: of light that is bounced, and of what comes before.
pub const PASS: &str = "lightmap";
pub const DIRECT_PASS: &str = "lightmap direct";
const OPEN_PASS: &str = "lightmap open";
/// Bounces before the last: so many that what is missing then is below [`MISSING`], and no more than fit between white walls.
const BOUNCES: std::ops::RangeInclusive<u32> = 10..=40;
/// Part of all light; the last bounce, whose samples read those before them, leaves less.
const MISSING: f64 = 0.01;
/// After this bounce it is found out how much light surfaces give back. The CPU reads it by the end of the least bounces, when that
/// frame has finished: no two bounces end in one.
const WEIGHED: u32 = 4;
const _: () = assert!((*BOUNCES.start() - 1 - WEIGHED) as usize > FRAMES_IN_FLIGHT);
/// Samples of a texel for each of these bounces: their noise is averaged by the gathering that follows.
const BOUNCE_SAMPLES: u32 = 2;
/// Bounces before those whose mean is shown until the last is there, and samples of a texel that make it better than an
/// open sky. What is missing after so few bounces is missing for some seconds only.
const UNKEPT: u32 = 8;
const PRESENTABLE: u32 = 16;
/// Places of a texel, at most 31: of each it is found out whether it is seen, and which lamps and sun reach it.
const DIRECT_SAMPLES: u32 = 16;
/// Samples that take as long as these stages.
const SKY_COST: u32 = 2;
const GUIDE_COST: u32 = 2;
const FILTER_COST: u32 = 4;
const SMOOTH_COST: u32 = 1;
/// Flags of a stage's passes: sums begin with these samples; what is known is shown from now on; their sky is counted; their sums are
/// kept.
const BEGINS: u32 = 1;
const IS_SHOWN: u32 = 2;
const COUNTS: u32 = 4;
const KEEPS: u32 = 8;

/// How much is computed: bounces before the last, and samples of a texel for that, a power of two.
#[derive(Clone, Copy)]
pub struct Length {
    pub bounces: u32,
    pub samples: u32,
}

impl Default for Length {
    /// The most bounces, for as long as it is not known how many the scene takes.
    fn default() -> Self {
        Self { bounces: *BOUNCES.end(), samples: SAMPLES }
    }
}

impl Length {
    /// With the bounces of a scene that gives back a `share` of the light it gets: a geometric series, of which less than
    /// [`MISSING`] is left. NaN, where there is no light, counts as 0.
    pub fn with_share(self, share: f64) -> Self {
        let [least, most] = [*BOUNCES.start(), *BOUNCES.end()];
        let bounces = if share > 0.0 { (MISSING.ln() / share.min(0.999).ln()).ceil() } else { 0.0 };
        Self { bounces: bounces.clamp(least.into(), most.into()) as u32, ..self }
    }
}

/// What is being computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Light of an open sky, for as long as there is no other.
    Open,
    Direct,
    Relays,
    /// Samples of one bounce, the first of which is 0.
    Bounce(u32),
    /// What the texels around have seen of the sky.
    Sky,
    /// Samples after this many of the last one.
    Last(u32),
    /// What the filter goes by, the filter, and what it leaves.
    Guide,
    Filter,
    Smooth,
    Done,
}

impl Stage {
    /// What follows.
    pub fn next(self, has_relays: bool, length: Length) -> Self {
        match self {
            Self::Open => Self::Direct,
            Self::Direct if has_relays => Self::Relays,
            Self::Direct | Self::Relays => Self::Bounce(0),
            Self::Bounce(bounce) if bounce + 1 < length.bounces => Self::Bounce(bounce + 1),
            Self::Bounce(_) => Self::Sky,
            Self::Sky => Self::Last(0),
            Self::Last(samples) if samples + AT_ONCE < length.samples => Self::Last(samples + AT_ONCE),
            Self::Last(_) => Self::Guide,
            Self::Guide => Self::Filter,
            Self::Filter => Self::Smooth,
            Self::Smooth | Self::Done => Self::Done,
        }
    }

    /// Whether it is found out after it how much light surfaces give back.
    pub fn is_weighed(self) -> bool {
        self == Self::Bounce(WEIGHED)
    }

    /// Whether the number of bounces is decided after it, by what was found out.
    pub fn decides(self) -> bool {
        self == Self::Bounce(BOUNCES.start() - 1)
    }

    /// Whether it gathers light that surfaces give back.
    pub fn is_soft(self) -> bool {
        matches!(self, Self::Bounce(_) | Self::Last(_))
    }

    pub fn pass(self) -> &'static str {
        match self {
            Self::Open => OPEN_PASS,
            Self::Direct | Self::Relays => DIRECT_PASS,
            Self::Bounce(_) | Self::Sky | Self::Last(_) | Self::Guide | Self::Filter | Self::Smooth | Self::Done => {
                PASS
            }
        }
    }

    /// Samples of a texel, or how many take as long.
    pub fn samples(self) -> u32 {
        match self {
            Self::Direct => DIRECT_SAMPLES,
            Self::Bounce(_) => BOUNCE_SAMPLES,
            Self::Last(_) => AT_ONCE,
            Self::Sky => SKY_COST,
            Self::Guide => GUIDE_COST,
            Self::Filter => FILTER_COST,
            Self::Smooth => SMOOTH_COST,
            Self::Open | Self::Relays | Self::Done => 1,
        }
    }

    /// The sequence they are of. What a bounce goes by is known of those before it, and must say nothing of its own samples: of one
    /// sequence, which is spread evenly, those that come go where none has been.
    pub fn sequence(self) -> u32 {
        if let Self::Bounce(bounce) = self { bounce + 1 } else { 0 }
    }

    /// The first of them in their sequence.
    pub fn first_sample(self) -> u32 {
        if let Self::Last(samples) = self { samples } else { 0 }
    }

    /// What its passes do with samples: the constants above.
    pub fn flags(self, length: Length) -> u32 {
        match self {
            Self::Bounce(bounce) if bounce < UNKEPT => BEGINS | COUNTS,
            Self::Bounce(bounce) => BEGINS | COUNTS | KEEPS | shown_if(kept_by(bounce) >= PRESENTABLE),
            Self::Last(samples) => {
                let begins = if samples == 0 { BEGINS } else { 0 };
                // Not before it is better than what the bounces' mean shows.
                let better = kept_by(length.bounces - 1).max(PRESENTABLE);
                begins | shown_if(samples + AT_ONCE >= better.min(length.samples))
            }
            Self::Filter | Self::Smooth => IS_SHOWN,
            Self::Open | Self::Direct | Self::Relays | Self::Sky | Self::Guide | Self::Done => 0,
        }
    }

    /// Samples of a texel that came before it.
    pub fn samples_before(self, length: Length) -> u32 {
        let bounces = DIRECT_SAMPLES + length.bounces * BOUNCE_SAMPLES;
        let last = bounces + SKY_COST + length.samples;
        match self {
            Self::Open | Self::Direct => 0,
            Self::Relays => DIRECT_SAMPLES,
            Self::Bounce(bounce) => DIRECT_SAMPLES + bounce * BOUNCE_SAMPLES,
            Self::Sky => bounces,
            Self::Last(samples) => bounces + SKY_COST + samples,
            Self::Guide => last,
            Self::Filter => last + GUIDE_COST,
            Self::Smooth => last + GUIDE_COST + FILTER_COST,
            Self::Done => last + GUIDE_COST + FILTER_COST + SMOOTH_COST,
        }
    }
}

/// Samples that are kept up to a bounce.
fn kept_by(bounce: u32) -> u32 {
    (bounce + 1 - UNKEPT) * BOUNCE_SAMPLES
}

fn shown_if(shown: bool) -> u32 {
    if shown { IS_SHOWN } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All stages of a bake in which surfaces give back this share of light.
    fn run(share: f64, samples: u32) -> Vec<(Stage, Length)> {
        let (mut stage, mut length) = (Stage::Open, Length { samples, ..Length::default() });
        let mut all = Vec::new();
        while stage != Stage::Done {
            all.push((stage, length));
            if stage.decides() {
                length = length.with_share(share);
            }
            stage = stage.next(true, length);
        }
        all
    }

    fn bounces(share: f64) -> usize {
        run(share, 64).iter().filter(|(stage, _)| matches!(stage, Stage::Bounce(_))).count()
    }

    #[test]
    fn a_scene_gets_as_many_bounces_as_it_gives_light_back() {
        assert_eq!([f64::NAN, 0.0, 0.5, 0.63].map(bounces), [10; 4]);
        assert_eq!([0.7, 0.8, 0.89, 0.95, 1.0, 1.2].map(bounces), [13, 21, 40, 40, 40, 40]);
        for share in [0.64, 0.7, 0.8, 0.85, 0.89] {
            let left = share_left(share);
            assert!(left <= MISSING && left > MISSING * share * share, "{share}: {left}");
        }
    }

    fn share_left(share: f64) -> f64 {
        share.powi(bounces(share) as i32)
    }

    #[test]
    fn stages_say_truly_how_much_is_done() {
        for samples in [8, 64, 256] {
            let mut done = 0;
            for (stage, length) in run(0.7, samples) {
                assert_eq!(stage.samples_before(length), done, "{stage:?}");
                done += if matches!(stage, Stage::Open | Stage::Relays) { 0 } else { stage.samples() };
            }
            let filtered = GUIDE_COST + FILTER_COST + SMOOTH_COST;
            assert_eq!(done, DIRECT_SAMPLES + 13 * BOUNCE_SAMPLES + samples + SKY_COST + filtered);
        }
    }

    #[test]
    fn each_bounce_has_a_sequence_of_its_own_and_the_last_is_shown_once_its_samples_are_enough() {
        for share in [0.3, 0.9] {
            let all = run(share, 64);
            let sequences = |is: fn(&Stage) -> bool| -> Vec<u32> {
                all.iter().map(|(stage, _)| *stage).filter(is).map(Stage::sequence).collect()
            };
            let mut before = sequences(|stage| matches!(stage, Stage::Bounce(_)));
            let (count, of_last) = (before.len(), sequences(|stage| matches!(stage, Stage::Last(_))));
            before.sort_unstable();
            before.dedup();
            assert_eq!(before.len(), count);
            assert!(of_last.iter().all(|sequence| *sequence == of_last[0]) && !before.contains(&of_last[0]));
            let last: Vec<_> = all.iter().filter(|(stage, _)| matches!(stage, Stage::Last(_))).collect();
            let firsts: Vec<u32> = last.iter().map(|(stage, _)| stage.first_sample()).collect();
            assert_eq!(firsts, (0..64).step_by(AT_ONCE as usize).collect::<Vec<_>>());
            let shown = |(stage, length): &&(Stage, Length)| stage.flags(*length) & IS_SHOWN != 0;
            let shown: Vec<bool> = last.iter().map(shown).collect();
            assert!(shown.is_sorted() && shown[7] && !shown[0], "{shown:?}");
        }
    }
}
