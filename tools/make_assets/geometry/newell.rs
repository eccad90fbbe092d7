//! The Utah teapot's control points: 32 bicubic Bézier patches, after M. E. Newell, "The Utilization of Procedure
//! Models in Digital Image Synthesis", PhD thesis, University of Utah, 1975; the numbers as published in
//! F. Crow, "The Origins of the Teapot", IEEE Computer Graphics and Applications 7(1), 1987.
//!
//! Newell's axes: z up, handle towards −x, spout towards +x; his unit is not a metre, the pot is 3.15 high.
//! His rim is a little dented towards the handle (by 0.04); ours is round all around, as the rest of the body is.

use glam::DVec3;

/// Sixteen control points, four rows of four.
pub type Patch = [[DVec3; 4]; 4];

/// A row of a patch of revolution: radius, the ring's inner control offset, height.
pub type Ring = [f64; 3];

/// The parts that are surfaces of revolution, each listed from its outer or lower end upwards along the outside.
pub const BODY: [[Ring; 4]; 3] = [
    [[1.5, 0.84, 0.15], [1.5, 0.84, 0.225], [2.0, 1.12, 0.45], [2.0, 1.12, 0.9]],
    [[2.0, 1.12, 0.9], [2.0, 1.12, 1.35], [1.75, 0.98, 1.875], [1.5, 0.84, 2.4]],
    [[1.5, 0.84, 2.4], [1.4375, 0.805, 2.53125], [1.3375, 0.749, 2.53125], [1.4, 0.784, 2.4]],
];
pub const LID: [[Ring; 4]; 2] = [
    [[1.3, 0.728, 2.4], [1.3, 0.728, 2.55], [0.4, 0.224, 2.55], [0.2, 0.112, 2.7]],
    [[0.2, 0.112, 2.7], [0.0, 0.0, 2.85], [0.8, 0.45, 3.15], [0.0, 0.0, 3.15]],
];
pub const BOTTOM: [[Ring; 4]; 1] = [[[0.0, 0.0, 0.0], [1.425, 0.798, 0.0], [1.5, 0.84, 0.075], [1.5, 0.84, 0.15]]];

/// A row of half a tube: inner x and z, half width in y, outer x and z.
pub type Hoop = [f64; 5];

/// From the body's upper attachment around to the lower one; "inner" faces the gap that a hand goes through.
pub const HANDLE: [[Hoop; 4]; 2] = [
    [
        [-1.6, 2.025, 0.3, -1.5, 2.25],
        [-2.3, 2.025, 0.3, -2.5, 2.25],
        [-2.7, 2.025, 0.3, -3.0, 2.25],
        [-2.7, 1.8, 0.3, -3.0, 1.8],
    ],
    [
        [-2.7, 1.8, 0.3, -3.0, 1.8],
        [-2.7, 1.575, 0.3, -3.0, 1.35],
        [-2.5, 1.125, 0.3, -2.65, 0.9375],
        [-2.0, 0.9, 0.3, -1.9, 0.6],
    ],
];
/// From the body to the lip, which turns inwards; "inner" is the upper side.
pub const SPOUT: [[Hoop; 4]; 2] = [
    [
        [1.7, 1.425, 0.66, 1.7, 0.6],
        [2.6, 1.425, 0.66, 3.1, 0.825],
        [2.3, 2.1, 0.25, 2.4, 2.025],
        [2.7, 2.4, 0.25, 3.3, 2.4],
    ],
    [
        [2.7, 2.4, 0.25, 3.3, 2.4],
        [2.8, 2.475, 0.25, 3.525, 2.49375],
        [2.9, 2.475, 0.15, 3.45, 2.5125],
        [2.8, 2.4, 0.15, 3.2, 2.4],
    ],
];

/// Quarter `turn` (0..4) of a part of revolution; columns run counter-clockwise seen from above.
pub fn quarter(rings: &[Ring; 4], turn: usize) -> Patch {
    let (sin, cos) = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][turn % 4];
    rings.map(|[radius, offset, z]| {
        [(radius, 0.0), (radius, offset), (offset, radius), (0.0, radius)]
            .map(|(x, y)| DVec3::new(x * cos - y * sin, x * sin + y * cos, z))
    })
}

/// Half a tube, on the side of y where `side` (±1) points. Columns run to the right seen from outside: from the inner
/// to the outer edge where y < 0, back where y > 0.
pub fn half(hoops: &[Hoop; 4], side: f64) -> Patch {
    hoops.map(|[inner_x, inner_z, width, outer_x, outer_z]| {
        let y = width * side;
        let mut row = [
            DVec3::new(inner_x, 0.0, inner_z),
            DVec3::new(inner_x, y, inner_z),
            DVec3::new(outer_x, y, outer_z),
            DVec3::new(outer_x, 0.0, outer_z),
        ];
        if side > 0.0 {
            row.reverse();
        }
        row
    })
}

/// The point at (u, v) and its derivatives along u (columns) and v (rows).
pub fn evaluate(patch: &Patch, u: f64, v: f64) -> (DVec3, DVec3, DVec3) {
    let (along_u, along_v) = (bernstein(u), bernstein(v));
    let sum = |row_weights: [f64; 4], column_weights: [f64; 4]| {
        let mut point = DVec3::ZERO;
        for (row, row_weight) in patch.iter().zip(row_weights) {
            for (control, column_weight) in row.iter().zip(column_weights) {
                point += *control * (row_weight * column_weight);
            }
        }
        point
    };
    (sum(along_v.0, along_u.0), sum(along_v.0, along_u.1), sum(along_v.1, along_u.0))
}

/// The four cubic Bernstein polynomials at `t`, and their derivatives.
fn bernstein(t: f64) -> ([f64; 4], [f64; 4]) {
    let s = 1.0 - t;
    (
        [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t],
        [-3.0 * s * s, 3.0 * s * (s - 2.0 * t), 3.0 * t * (2.0 * s - t), 3.0 * t * t],
    )
}
