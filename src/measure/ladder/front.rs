//! Pareto front of times and errors, who beats whom, and the choice by a limit.

use serde::Serialize;

/// A setting's time and error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    pub ms: f64,
    pub error: f64,
}

impl Mark {
    /// Whether it beats another, where differences up to `least` count for nothing, in whichever direction: for sure
    /// (`Some(true)`) if it is better by more in both; hardly (`Some(false)`) if it is better by more in one, and worse by
    /// more in none.
    pub fn beats(self, other: Self, least: Self) -> Option<bool> {
        let gains = [(other.ms - self.ms, least.ms), (other.error - self.error, least.error)];
        let better = gains.iter().filter(|(gain, least)| gain > least).count();
        let worse = gains.iter().any(|(gain, least)| *gain < -least);
        (better > 0 && !worse).then_some(better == 2)
    }
}

/// Who beats a mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beaten {
    pub by: usize,
    /// By more than counts for nothing, in both.
    pub surely: bool,
}

/// For each mark one that beats it, where differences of two up to `least` count for nothing; `None` on the front. Of several
/// that surely do, that of the least error; of several that hardly do, the quickest.
pub fn beaten_by(marks: &[Mark], least: impl Fn(usize, usize) -> Mark) -> Vec<Option<Beaten>> {
    let best = |index: usize| {
        let better = marks.iter().enumerate().filter_map(|(by, mark)| {
            let surely = mark.beats(marks[index], least(by, index))?;
            Some((!surely, if surely { [mark.error, mark.ms] } else { [mark.ms, mark.error] }, by))
        });
        let first =
            better.min_by(|a, b| a.0.cmp(&b.0).then(a.1.partial_cmp(&b.1).unwrap_or(std::cmp::Ordering::Equal)));
        first.map(|(perhaps, _, by)| Beaten { by, surely: !perhaps })
    };
    (0..marks.len()).map(best).collect()
}

/// What a choice must hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// FLIP at most; the quickest is chosen.
    Tolerance(f64),
    /// Milliseconds a frame at most; the most accurate is chosen.
    BudgetMs(f64),
}

impl Limit {
    /// The index of the choice; `None` if nothing holds.
    pub fn choose(self, marks: &[Mark]) -> Option<usize> {
        let holds = |mark: &Mark| match self {
            Self::Tolerance(most) => mark.error <= most,
            Self::BudgetMs(most) => mark.ms <= most,
        };
        let key = |mark: &Mark| match self {
            Self::Tolerance(_) => (mark.ms, mark.error),
            Self::BudgetMs(_) => (mark.error, mark.ms),
        };
        let holding = marks.iter().enumerate().filter(|(_, mark)| holds(mark)).map(|(index, mark)| (index, key(mark)));
        holding.min_by(|(_, a), (_, b)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(index, _)| index)
    }

    /// In words, for one line.
    pub fn words(self) -> String {
        match self {
            Self::Tolerance(most) => format!("the quickest with FLIP at most {most}"),
            Self::BudgetMs(most) => format!("the most accurate in at most {most} ms"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marks(all: &[(f64, f64)]) -> Vec<Mark> {
        all.iter().map(|&(ms, error)| Mark { ms, error }).collect()
    }

    /// By the same noise for all: of each who beats it, and whether surely.
    fn beaten(all: &[(f64, f64)], ms: f64, error: f64) -> Vec<Option<(usize, bool)>> {
        let beaten = beaten_by(&marks(all), |_, _| Mark { ms, error });
        beaten.into_iter().map(|beaten| beaten.map(|Beaten { by, surely }| (by, surely))).collect()
    }

    #[test]
    fn the_front_is_beaten_by_nothing_and_the_others_name_who_beats_them() {
        let all = [(2.0, 0.3), (1.0, 0.5), (3.0, 0.4), (4.0, 0.1), (5.0, 0.2), (9.0, 0.6)];
        let expected = [None, None, Some((0, true)), None, Some((3, true)), Some((3, true))];
        assert_eq!(beaten(&all, 0.01, 0.001), expected);
    }

    #[test]
    fn equals_do_not_beat_each_other() {
        assert_eq!(beaten(&[(1.0, 1.0), (1.0, 1.0)], 0.0, 0.0), [None, None]);
        assert_eq!(beaten(&[(1.0, 1.0), (1.0, 0.9)], 0.0, 0.0), [Some((1, false)), None], "times are not told apart");
    }

    #[test]
    fn noise_doubts_the_front_as_much_as_it_excuses_the_beaten() {
        for error in [0.0258, 0.0262] {
            let quick = [(8.0, 0.0260), (2.0, error)];
            assert_eq!(beaten(&quick, 0.1, 0.0003), [Some((1, false)), None], "{error}: quicker, and perhaps as good");
            assert_eq!(beaten(&quick, 0.1, 0.0001), [(error < 0.026).then_some((1, true)), None], "{error} is told");
        }
        for ms in [7.95, 8.05] {
            let good = [(8.0, 0.02), (ms, 0.01)];
            assert_eq!(beaten(&good, 0.1, 0.001), [Some((1, false)), None], "{ms}: better, and perhaps as quick");
        }
        assert_eq!(beaten(&[(8.0, 0.0201), (7.95, 0.02)], 0.1, 0.001), [None, None], "nothing is told");
    }

    #[test]
    fn who_surely_beats_is_named_before_who_hardly_does() {
        let all = [(8.0, 0.020), (1.0, 0.0201), (4.0, 0.010), (5.0, 0.009)];
        assert_eq!(beaten(&all, 0.1, 0.001)[0], Some((3, true)));
        assert_eq!(beaten(&all[..2], 0.1, 0.001)[0], Some((1, false)));
        assert_eq!(beaten(&[all[0], (2.0, 0.0199), all[1]], 0.1, 0.001)[0], Some((2, false)), "the quickest of these");
    }

    #[test]
    fn a_tolerance_takes_the_quickest_that_holds_it_and_a_budget_the_most_accurate() {
        let marks = marks(&[(2.0, 0.03), (1.0, 0.05), (3.0, 0.02), (4.0, 0.01), (3.0, 0.02)]);
        let choose = |limit: Limit| limit.choose(&marks);
        assert_eq!(choose(Limit::Tolerance(0.03)), Some(0));
        assert_eq!(choose(Limit::Tolerance(0.029)), Some(2));
        assert_eq!(choose(Limit::Tolerance(1.0)), Some(1));
        assert_eq!(choose(Limit::Tolerance(0.009)), None);
        assert_eq!(choose(Limit::BudgetMs(3.5)), Some(2));
        assert_eq!(choose(Limit::BudgetMs(100.0)), Some(3));
        assert_eq!(choose(Limit::BudgetMs(0.5)), None);
    }
}
