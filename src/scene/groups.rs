//! Disjoint sets of numbered points.

/// Disjoint sets of points (Tarjan 1975, with path halving).
pub struct Groups(Vec<u32>);

impl Groups {
    /// Each point alone.
    pub fn new(count: usize) -> Self {
        Self((0u32..).take(count).collect())
    }

    /// The least point of a point's set.
    pub fn of(&mut self, mut point: u32) -> u32 {
        while self.0[point as usize] != point {
            let up = self.0[self.0[point as usize] as usize];
            self.0[point as usize] = up;
            point = up;
        }
        point
    }

    /// Unites the sets of two points.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
