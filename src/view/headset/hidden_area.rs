//! The hidden area: the part of the picture that the lenses do not show, as the runtime reports it.

use clap::ValueEnum;

/// Cells along a side of the grid for [`share`].
const GRID: usize = 512;

/// Whether hidden pixels are left out, and which way up the runtime gives them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum HiddenAreaV {
    /// v = 1 is the picture's top.
    #[default]
    Up,
    /// v = 1 is the picture's bottom.
    Down,
    /// Everything is drawn.
    Off,
}

impl HiddenAreaV {
    /// The corners with v downwards, as in pictures; none for `Off`.
    pub fn downwards(self, corners: &[[f32; 2]]) -> Vec<[f32; 2]> {
        match self {
            Self::Up => corners.iter().map(|[u, v]| [*u, 1.0 - v]).collect(),
            Self::Down => corners.to_vec(),
            Self::Off => Vec::new(),
        }
    }
}

/// The part of the picture, 0 to 1, that triangles cover, three corners each; overlaps count once. Counted at the middles of
/// 512² cells.
pub fn share(corners: &[[f32; 2]]) -> f64 {
    let mut covered = vec![false; GRID * GRID];
    for triangle in corners.chunks_exact(3) {
        mark(&mut covered, triangle);
    }
    covered.iter().filter(|cell| **cell).count() as f64 / covered.len() as f64
}

fn mark(covered: &mut [bool], triangle: &[[f32; 2]]) {
    let span = |axis: usize| {
        let values = triangle.iter().map(|corner| corner[axis].clamp(0.0, 1.0) * GRID as f32);
        let (low, high) = values.fold((f32::MAX, 0f32), |(low, high), v| (low.min(v), high.max(v)));
        // Rounded outwards; NaN has become 0 on the way.
        low as usize..(high.ceil() as usize).min(GRID)
    };
    let middle = |cell: usize| (cell as f32 + 0.5) / GRID as f32;
    for y in span(1) {
        for x in span(0) {
            covered[y * GRID + x] |= holds(triangle, [middle(x), middle(y)]);
        }
    }
}

/// Whether a point is on the same side of all three edges.
fn holds(triangle: &[[f32; 2]], [x, y]: [f32; 2]) -> bool {
    let side = |a: [f32; 2], b: [f32; 2]| (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    let sides = [side(triangle[0], triangle[1]), side(triangle[1], triangle[2]), side(triangle[2], triangle[0])];
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_areas_whichever_way_round_and_overlaps_count_once() {
        let corner = [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]];
        let turned = [corner[0], corner[2], corner[1]];
        let eighth = share(&corner);
        assert!((eighth - 0.125).abs() < 2e-3, "{eighth}");
        assert_eq!(share(&turned), eighth);
        assert_eq!(share(&[corner, turned].concat()), eighth);
        assert_eq!(share(&[]), 0.0);
    }

    #[test]
    fn what_lies_outside_of_the_picture_is_not_counted_and_nonsense_does_no_harm() {
        assert!((share(&[[-9.0, -9.0], [10.0, -9.0], [-9.0, 10.0]]) - 0.5).abs() < 4e-3);
        assert_eq!(share(&[[2.0, 2.0], [3.0, 2.0], [2.0, 3.0]]), 0.0);
        share(&[[f32::NAN, 0.0], [f32::INFINITY, 1.0], [0.0, f32::NEG_INFINITY]]);
    }

    #[test]
    fn the_setting_turns_triangles_upside_down_or_leaves_them_out() {
        let corners = [[0.25, 0.0], [0.5, 0.125], [1.0, 1.0]];
        assert_eq!(HiddenAreaV::Up.downwards(&corners), [[0.25, 1.0], [0.5, 0.875], [1.0, 0.0]]);
        assert_eq!(HiddenAreaV::Down.downwards(&corners), corners);
        assert!(HiddenAreaV::Off.downwards(&corners).is_empty());
    }
}
