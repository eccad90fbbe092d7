//! The interaction lists of the treecode: for each tile of a prefiltered cube map, the nodes that it is summed from.
//! They depend on sizes and lobes only, not on the light. Derivation of the criteria: src/precompute/README.md.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3, IVec3};
use rayon::prelude::*;

use crate::reference::cube::cube_direction;
use crate::reference::lobe::kernel_integral;

/// Texels along a tile's side; the same in `glsl/hierarchical_convolution.comp`.
pub const TILE: u32 = 8;

/// A cube map to be computed: texels along a face, and alpha of its lobe.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    pub size: u32,
    pub alpha: f64,
}

/// Interaction lists of all tiles.
#[derive(Default)]
pub struct InteractionLists {
    /// Interaction lists of all tiles.
    /// Node numbers, tile after tile.
    pub entries: Vec<u32>,
    /// For each tile (by face, then row): its first entry and the number of entries.
    pub tiles: Vec<[u32; 2]>,
    /// For each target, the number of its first tile.
    pub first_tile: Vec<u32>,
}

/// Number of the first node of faces of `size` texels, where the finest have `finest` and come first.
pub fn first_node(size: u32, finest: u32) -> u32 {
    // 6 (finest² + finest²/4 + … ) down to, not including, size².
    8 * (finest * finest - size * size)
}

/// Number of all nodes.
pub fn node_count(finest: u32) -> u32 {
    first_node(1, finest) + 6
}

/// Tiles along a face's side.
pub fn tiles_across(size: u32) -> u32 {
    size.div_ceil(TILE)
}

/// A node of a quadtree: texel (x, y) of a face of 2^level texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cell {
    face: u32,
    level: u32,
    x: u32,
    y: u32,
}

impl InteractionLists {
    /// Lists for all targets; the finest nodes are texels of faces of `finest`, a power of two.
    pub fn new(finest: u32, targets: &[Target]) -> Self {
        let shapes = Shapes::new(finest);
        let mut lists = Self::default();
        for target in targets {
            lists.first_tile.push(lists.tiles.len() as u32);
            let across = tiles_across(target.size);
            // The lists of one face, rotated, are those of the others.
            let cells: Vec<Vec<Cell>> = (0..across * across)
                .into_par_iter()
                .map(|tile| shapes.cells(target, [tile % across, tile / across]))
                .collect();
            for face in 0..6 {
                for cells in &cells {
                    lists.tiles.push([lists.entries.len() as u32, cells.len() as u32]);
                    lists.entries.extend(cells.iter().map(|cell| cell.turned(face).number(finest)));
                }
            }
        }
        lists
    }
}

/// Acceptance criterion: largest radius of a node as a part of the lobe's scale there, which is α at the lobe's centre
/// and half the distance from it far outside. Smaller for wide lobes, whose levels are small and cost little.
fn node_per_lobe(alpha: f64) -> f64 {
    match alpha {
        a if a < 0.04 => 0.9,
        a if a < 0.15 => 0.7,
        _ => 0.5,
    }
}

/// Largest radius in radians of a node that the horizon crosses, for the clamped cosine, which has a kink there.
const NODE_AT_HORIZON: f64 = 0.08;

/// The same for any lobe: the error grows with the square of the radius and with the kernel's slope at the horizon,
/// c/q² → 1/q², relative to its integral; for the cosine that is 1/π.
fn width_at_horizon(alpha: f64) -> f64 {
    let q = 0.5 * (1.0 + alpha * alpha);
    NODE_AT_HORIZON * (kernel_integral(alpha) * q * q / PI).sqrt()
}

/// Directions and angular radii of the nodes of face 0.
struct Shapes {
    /// By level, then row by row: centre, and the angle from there to the farthest corner.
    levels: Vec<Vec<(DVec3, f64)>>,
}

impl Shapes {
    fn new(finest: u32) -> Self {
        let shape = |x: u32, y: u32, size: u32| {
            let at = |dx: f64, dy: f64| {
                cube_direction(0, DVec2::new(f64::from(x) + dx, f64::from(y) + dy) / f64::from(size))
            };
            let centre = at(0.5, 0.5);
            let corners = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)];
            (centre, corners.into_iter().map(|corner| angle(centre, corner)).fold(0.0, f64::max))
        };
        let level = |level: u32| {
            let size = 1 << level;
            (0..size * size).map(|i| shape(i % size, i / size, size)).collect()
        };
        Self { levels: (0..=finest.ilog2()).map(level).collect() }
    }

    /// The nodes of a tile of face 0.
    fn cells(&self, target: &Target, [x, y]: [u32; 2]) -> Vec<Cell> {
        let last = target.size - 1;
        let at = |x: u32, y: u32| {
            let texel = DVec2::new(f64::from(x.min(last)) + 0.5, f64::from(y.min(last)) + 0.5);
            cube_direction(0, texel / f64::from(target.size))
        };
        let (left, top, right, bottom) = (x * TILE, y * TILE, x * TILE + TILE - 1, y * TILE + TILE - 1);
        let corners = [at(left, top), at(right, top), at(left, bottom), at(right, bottom)];
        let centre = corners.iter().sum::<DVec3>().normalize();
        let radius = corners.into_iter().map(|corner| angle(centre, corner)).fold(0.0, f64::max);
        let mut cells = Vec::new();
        for face in 0..6 {
            let tile = Tile { centre, radius, alpha: target.alpha, width_at_horizon: width_at_horizon(target.alpha) };
            self.refine(Cell { face, level: 0, x: 0, y: 0 }, &tile, &mut cells);
        }
        cells
    }

    fn refine(&self, cell: Cell, tile: &Tile, cells: &mut Vec<Cell>) {
        let (on_face_0, radius) = self.levels[cell.level as usize][((cell.y << cell.level) + cell.x) as usize];
        let away = (angle(on_axes(cell.face, on_face_0), tile.centre) - tile.radius).max(0.0);
        if away - radius > FRAC_PI_2 {
            return; // below the horizon of every texel
        }
        let mut width = node_per_lobe(tile.alpha) * tile.alpha.min(1.0).hypot(0.5 * away);
        if away + 2.0 * tile.radius + radius > FRAC_PI_2 {
            width = width.min(tile.width_at_horizon);
        }
        if radius <= width || cell.level as usize + 1 == self.levels.len() {
            cells.push(cell);
            return;
        }
        for i in 0..4 {
            let child = Cell { level: cell.level + 1, x: 2 * cell.x + (i & 1), y: 2 * cell.y + (i >> 1), ..cell };
            self.refine(child, tile, cells);
        }
    }
}

struct Tile {
    centre: DVec3,
    radius: f64,
    alpha: f64,
    width_at_horizon: f64,
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    // By the chord, which is accurate for small angles.
    (2.0 * (0.5 * a.distance(b)).min(1.0).asin()).min(PI)
}

/// Axes of s and t of each face, and towards its centre, as in `cube_direction`, in integers.
const AXES: [[IVec3; 3]; 6] = [
    [IVec3::NEG_Z, IVec3::NEG_Y, IVec3::X],
    [IVec3::Z, IVec3::NEG_Y, IVec3::NEG_X],
    [IVec3::X, IVec3::Z, IVec3::Y],
    [IVec3::X, IVec3::NEG_Z, IVec3::NEG_Y],
    [IVec3::X, IVec3::NEG_Y, IVec3::Z],
    [IVec3::NEG_X, IVec3::NEG_Y, IVec3::NEG_Z],
];

/// A direction rotated as face 0 is to `face`.
fn on_axes(face: u32, d: DVec3) -> DVec3 {
    let ([s, t, middle], [s0, t0, middle0]) = (AXES[face as usize], AXES[0]);
    s.as_dvec3() * d.dot(s0.as_dvec3())
        + t.as_dvec3() * d.dot(t0.as_dvec3())
        + middle.as_dvec3() * d.dot(middle0.as_dvec3())
}

impl Cell {
    /// This node rotated as face 0 is to `face`.
    fn turned(self, face: u32) -> Self {
        let n = 1 << self.level;
        let ([s, t, middle], [s0, t0, middle0]) = (AXES[face as usize], AXES[0]);
        let [own_s, own_t, own_middle] = AXES[self.face as usize];
        let at = own_s * (2 * self.x as i32 + 1 - n) + own_t * (2 * self.y as i32 + 1 - n) + own_middle * n;
        let at = s * at.dot(s0) + t * at.dot(t0) + middle * at.dot(middle0);
        // On the face whose axis component is n; all other components are smaller.
        let face = (0..5).find(|face| at.dot(AXES[*face][2]) == n).unwrap_or(5);
        let coordinate = |axis: IVec3| ((at.dot(axis) + n - 1) / 2) as u32;
        Self { face: face as u32, level: self.level, x: coordinate(AXES[face][0]), y: coordinate(AXES[face][1]) }
    }

    /// Its index among all nodes.
    fn number(self, finest: u32) -> u32 {
        let size = 1 << self.level;
        first_node(size, finest) + (self.face * size + self.y) * size + self.x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::cube::{cube_face, cube_texel_solid_angle};

    #[test]
    fn nodes_are_numbered_without_gaps() {
        assert_eq!((first_node(8, 8), first_node(4, 8), first_node(2, 8), first_node(1, 8)), (0, 384, 480, 504));
        assert_eq!(node_count(8), 510);
    }

    #[test]
    fn turning_cells_is_turning_directions() {
        for face in 0..6 {
            for own in 0..6 {
                for (x, y) in [(0, 0), (5, 2), (7, 6)] {
                    let direction = |cell: Cell| {
                        let size = f64::from(1 << cell.level);
                        let st = DVec2::new(f64::from(cell.x) + 0.5, f64::from(cell.y) + 0.5) / size;
                        cube_direction(cell.face, st)
                    };
                    let cell = Cell { face: own, level: 3, x, y };
                    let (got, want) = (direction(cell.turned(face)), on_axes(face, direction(cell)));
                    assert!(got.abs_diff_eq(want, 1e-12), "{cell:?} to {face}: {got} {want}");
                }
            }
            assert_eq!(cube_face(on_axes(face, DVec3::X)).0, face);
        }
    }

    /// Every list covers all of the sphere above the horizon, and nothing twice.
    #[test]
    fn lists_cover_what_the_tile_sees_once() {
        let finest = 16;
        for target in [Target { size: 32, alpha: 1.0 / 8.0 }, Target { size: 4, alpha: 1.0 }] {
            let lists = InteractionLists::new(finest, &[target]);
            let across = tiles_across(target.size);
            assert_eq!(lists.tiles.len() as u32, 6 * across * across);
            for [first, count] in &lists.tiles {
                let mut covered = vec![0; (6 * finest * finest) as usize];
                let mut area = 0.0;
                for entry in &lists.entries[*first as usize..(first + count) as usize] {
                    let size = (0..=finest.ilog2()).map(|l| 1 << l).find(|s| first_node(*s, finest) <= *entry).unwrap();
                    let i = entry - first_node(size, finest);
                    let (face, y, x) = (i / (size * size), i / size % size, i % size);
                    area += cube_texel_solid_angle([x, y], size);
                    let step = finest / size;
                    for j in 0..step * step {
                        let (x, y) = (x * step + j % step, y * step + j / step);
                        covered[((face * finest + y) * finest + x) as usize] += 1;
                    }
                }
                assert!(covered.iter().all(|times| *times <= 1));
                assert!(area > 0.499 * 4.0 * PI, "{area} sr");
            }
        }
    }
}
