//! Times and errors: Pareto fronts with and without noise, and the choice by a limit.

/// A time and an error; both are better if smaller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    pub ms: f64,
    pub error: f64,
}

impl Score {
    /// Whether this one dominates another: better in time or error and not worse in the other, where differences up to `least`
    /// count as equal.
    fn dominates(self, other: Self, least: Self) -> bool {
        let gains = [(other.ms - self.ms, least.ms), (other.error - self.error, least.error)];
        gains.iter().any(|(gain, least)| gain > least) && gains.iter().all(|(gain, least)| *gain >= -least)
    }
}

/// For each score the quickest that dominates it, `None` on the Pareto front; differences of two scores up to `least` count as
/// equal.
pub fn dominated_by(scores: &[Score], least: impl Fn(usize, usize) -> Score) -> Vec<Option<usize>> {
    let by = |index: usize| {
        let better = (0..scores.len()).filter(|by| scores[*by].dominates(scores[index], least(*by, index)));
        better.min_by(|a, b| scores[*a].ms.total_cmp(&scores[*b].ms))
    };
    (0..scores.len()).map(by).collect()
}

/// Indices of the scores that none dominates, quickest first; all differences count.
pub fn front(scores: &[Score]) -> Vec<usize> {
    let dominated = dominated_by(scores, |_, _| Score { ms: 0.0, error: 0.0 });
    let mut front: Vec<usize> = (0..scores.len()).filter(|index| dominated[*index].is_none()).collect();
    front.sort_by(|a, b| scores[*a].ms.total_cmp(&scores[*b].ms));
    front
}

/// A limit for the choice among scores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// Error (FLIP) at most; the quickest is chosen.
    Tolerance(f64),
    /// Milliseconds a frame at most; the most accurate is chosen.
    BudgetMs(f64),
}

impl Limit {
    /// The index of the choice; `None` if no score holds the limit.
    pub fn choose(self, scores: &[Score]) -> Option<usize> {
        let key = |score: &Score| match self {
            Self::Tolerance(most) => (score.error <= most, score.ms, score.error),
            Self::BudgetMs(most) => (score.ms <= most, score.error, score.ms),
        };
        let keys = scores.iter().map(key).enumerate().filter(|(_, (holds, ..))| *holds);
        keys.min_by(|(_, a), (_, b)| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2))).map(|(index, _)| index)
    }
}

impl std::fmt::Display for Limit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Tolerance(most) => write!(f, "the quickest with FLIP at most {most}"),
            Self::BudgetMs(most) => write!(f, "the most accurate in at most {most} ms"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(all: &[(f64, f64)]) -> Vec<Score> {
        all.iter().map(|&(ms, error)| Score { ms, error }).collect()
    }

    #[test]
    fn nothing_dominates_the_front_and_noise_counts_as_equal() {
        let dominated =
            |all: &[(f64, f64)], ms: f64, error: f64| dominated_by(&scores(all), |_, _| Score { ms, error });
        let all = [(2.0, 0.3), (1.0, 0.5), (3.0, 0.4), (4.0, 0.1), (5.0, 0.2), (9.0, 0.6)];
        assert_eq!(dominated(&all, 0.01, 0.001), [None, None, Some(0), None, Some(3), Some(1)]);
        assert_eq!(front(&scores(&all)), [1, 0, 3]);
        assert_eq!(dominated(&[(1.0, 1.0), (1.0, 1.0)], 0.0, 0.0), [None, None], "equals");
        for error in [0.0258, 0.0262] {
            let quick = [(8.0, 0.0260), (2.0, error)];
            assert_eq!(dominated(&quick, 0.1, 0.0003), [Some(1), None], "{error}: quicker, as good");
            assert_eq!(dominated(&quick, 0.1, 0.0001), [(error < 0.026).then_some(1), None], "{error}");
        }
        assert_eq!(dominated(&[(8.0, 0.0201), (7.95, 0.02)], 0.1, 0.001), [None, None], "equal in both");
    }
}
