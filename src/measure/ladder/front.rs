//! Pareto front of times and errors, who beats whom, and the choice by a limit.

use serde::Serialize;

/// A setting's time and error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    pub ms: f64,
    pub error: f64,
}

impl Mark {
    /// Whether it is at least as quick and as accurate, and one of both more.
    pub fn beats(self, other: Self) -> bool {
        self.ms <= other.ms && self.error <= other.error && self != other
    }
}

/// For each mark the index of one that beats it; `None` on the front. Of several, that of the least error.
pub fn beaten_by(marks: &[Mark]) -> Vec<Option<usize>> {
    let most_accurate = |mark: &Mark| {
        let better = marks.iter().enumerate().filter(|(_, other)| other.beats(*mark));
        better.min_by(|a, b| a.1.error.total_cmp(&b.1.error).then(a.1.ms.total_cmp(&b.1.ms))).map(|(index, _)| index)
    };
    marks.iter().map(most_accurate).collect()
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

    #[test]
    fn the_front_is_beaten_by_nothing_and_the_others_name_who_beats_them() {
        let marks = marks(&[(2.0, 0.3), (1.0, 0.5), (3.0, 0.4), (4.0, 0.1), (4.0, 0.2), (9.0, 0.6)]);
        assert_eq!(beaten_by(&marks), [None, None, Some(0), None, Some(3), Some(3)]);
    }

    #[test]
    fn equals_do_not_beat_each_other() {
        assert_eq!(beaten_by(&marks(&[(1.0, 1.0), (1.0, 1.0)])), [None, None]);
        assert_eq!(beaten_by(&marks(&[(1.0, 1.0), (1.0, 0.9)])), [Some(1), None]);
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
