//! Things with smooth surfaces, as a probe is placed for: parts of the scene that hang together, and the boxes around them.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use glam::Vec3;

use super::bvh::{Bvh, BvhTriangle};
use super::groups::Groups;
use super::mesh::Bounds;

/// Of the smaller of two parts' boxes, the share that lies in the other's from which on they are one thing, as a teapot and its
/// handle are.
const OVERLAP: f64 = 0.05;
/// Unless its diagonal is a smaller part of the other's than this: what stands in a shelf is no part of it.
const PART: f32 = 0.15;
/// Least side of a thing's box, and of its parts', in parts of the next: flat ones are walls, floors, table tops and trays, which
/// mirror what stands on them; and in parts of the largest: thin ones are skirtings and cables.
const FLAT: f32 = 0.12;
const THIN: f32 = 0.05;
/// Diagonal of a thing's box, in parts of the scene's, from which on it is what surrounds others.
const LARGE: f32 = 0.7;

/// Boxes around the things whose triangles were met, `met` having one entry for each time, and how often; those that were met most
/// come first. Smooth triangles that share an edge hang together. Nothing that a camera is in is a thing, or part of one.
pub fn things(bvh: &Bvh, met: &[usize], smooth: impl Fn(usize) -> bool, cameras: &[Vec3]) -> Vec<(Bounds, usize)> {
    if met.is_empty() {
        return Vec::new();
    }
    let most = 2.0 * LARGE * bvh.bounds().radius();
    let parts = Parts::new(bvh, smooth);
    let is_thing = |bounds: &Bounds| {
        let mut sides = (bounds.max - bounds.min).to_array();
        sides.sort_by(f32::total_cmp);
        sides[0] > (FLAT * sides[1]).max(THIN * sides[2]) && !holds_any(*bounds, cameras)
    };
    let apart: Vec<Bounds> = parts.bounds.iter().copied().filter(is_thing).collect();
    let mut counts: HashMap<usize, usize> = HashMap::new();
    for part in met.iter().filter_map(|triangle| parts.of_triangle[*triangle]) {
        *counts.entry(part).or_default() += 1;
    }
    let mut boxes: Vec<(Bounds, usize)> = Vec::new();
    for (part, count) in counts.into_iter().filter(|(part, _)| is_thing(&parts.bounds[*part])) {
        let bounds = grown(parts.bounds[part], &apart);
        match boxes.iter_mut().find(|(known, _)| *known == bounds) {
            Some((_, known)) => *known += count,
            None => boxes.push((bounds, count)),
        }
    }
    boxes.retain(|(bounds, _)| is_thing(bounds) && 2.0 * bounds.radius() < most);
    let place = |bounds: &Bounds| bounds.min.to_array().map(f32::to_bits);
    boxes.sort_by_key(|(bounds, count)| (Reverse(*count), place(bounds)));
    boxes
}

/// Whether one of the cameras is in a box.
pub fn holds_any(bounds: Bounds, cameras: &[Vec3]) -> bool {
    cameras.iter().any(|camera| bounds.contains(Bounds::of([*camera])))
}

/// Makes one of the two boxes that are the nearest to each other and may be joined, again and again, until there are no more than
/// `most` or none may. Those that were met most come first.
pub fn joined(
    things: Vec<(Bounds, usize)>,
    most: usize,
    may_join: impl Fn(Bounds, Bounds) -> bool,
) -> Vec<(Bounds, usize)> {
    // Joined boxes come last; those that are part of one are gone.
    let mut boxes: Vec<Option<(Bounds, usize)>> = things.into_iter().map(Some).collect();
    let mut pairs = BinaryHeap::new();
    let (mut left, mut paired) = (boxes.len(), 0);
    while left > most {
        while let Some(next) = boxes.get(paired) {
            let sized = |(i, other): (usize, &Option<(Bounds, usize)>)| {
                let (a, b) = ((*other)?.0, (*next)?.0);
                // The bits of numbers that are not negative sort as they do.
                may_join(a, b).then(|| Reverse((a.union(b).radius().to_bits(), i, paired)))
            };
            pairs.extend(boxes[..paired].iter().enumerate().filter_map(sized));
            paired += 1;
        }
        let Some(Reverse((_, i, j))) = pairs.pop() else { break };
        if let (Some(a), Some(b)) = (boxes[i], boxes[j]) {
            [boxes[i], boxes[j]] = [None, None];
            boxes.push(Some((a.0.union(b.0), a.1 + b.1)));
            left -= 1;
        }
    }
    let mut things: Vec<(Bounds, usize)> = boxes.into_iter().flatten().collect();
    things.sort_by_key(|(_, count)| Reverse(*count));
    things
}

/// How many of the first things get a probe where there are `free` ones, from how often each was met: all, or those that are met
/// clearly more often than the others, by three standard deviations of their numbers, for of things that are seen alike some must
/// not look better.
pub fn outstanding(met: &[usize], free: usize) -> usize {
    if met.len() <= free {
        return met.len();
    }
    let stands_out = |kept: &usize| {
        let [least, next] = [met[kept - 1], met[*kept]].map(|count| count as f32);
        least > 1.5 * next + 3.0 * next.sqrt()
    };
    (1..=free).rev().find(stands_out).unwrap_or(0)
}

/// Parts of the smooth surfaces that hang together by their edges: things that stand on others may share a corner by chance.
struct Parts {
    /// By triangle of the hierarchy; `None` for what is not smooth.
    of_triangle: Vec<Option<usize>>,
    bounds: Vec<Bounds>,
}

impl Parts {
    fn new(bvh: &Bvh, smooth: impl Fn(usize) -> bool) -> Self {
        let triangles = bvh.triangles();
        let mut edge_of: HashMap<[[u32; 3]; 2], u32> = HashMap::new();
        let mut number = |from: [f32; 3], to: [f32; 3]| {
            let next = edge_of.len() as u32;
            // The sum makes −0 and 0 equal.
            let mut edge = [from, to].map(|corner| corner.map(|c| (c + 0.0).to_bits()));
            edge.sort_unstable();
            *edge_of.entry(edge).or_insert(next)
        };
        let mut numbered = |triangle: &BvhTriangle| {
            let [a, b, c] = triangle.corners;
            [number(a, b), number(b, c), number(c, a)]
        };
        let all = triangles.iter().enumerate();
        let edges: Vec<Option<[u32; 3]>> = all.map(|(i, triangle)| smooth(i).then(|| numbered(triangle))).collect();
        let mut groups = Groups::new(edge_of.len());
        for [a, b, c] in edges.iter().flatten() {
            groups.join(*a, *b);
            groups.join(*b, *c);
        }
        let (mut part_of, mut bounds): (HashMap<u32, usize>, Vec<Bounds>) = (HashMap::new(), Vec::new());
        let of_triangle = edges.iter().zip(triangles).map(|(edges, triangle)| {
            let part = *part_of.entry(groups.of((*edges)?[0])).or_insert_with(|| {
                bounds.push(Bounds::EMPTY);
                bounds.len() - 1
            });
            bounds[part] = bounds[part].union(triangle.bounds());
            Some(part)
        });
        Self { of_triangle: of_triangle.collect(), bounds }
    }
}

/// The box around a part and all of these that belong to it.
fn grown(part: Bounds, parts: &[Bounds]) -> Bounds {
    let mut bounds = part;
    loop {
        let belongs = |other: &&Bounds| belong_together(bounds, **other);
        let grown = parts.iter().filter(belongs).fold(bounds, |sum, other| sum.union(*other));
        if grown == bounds {
            return bounds;
        }
        bounds = grown;
    }
}

fn belong_together(a: Bounds, b: Bounds) -> bool {
    let (small, large) = (a.radius().min(b.radius()), a.radius().max(b.radius()));
    a.common(b).volume() > OVERLAP * a.volume().min(b.volume()) && small >= PART * large
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::bvh::tests::mesh;
    use crate::scene::probes::tests::{ball, bvh, walls};

    #[test]
    fn a_thing_is_what_hangs_together_and_what_reaches_into_it() {
        let floor = walls(Vec3::new(-5.0, 0.0, -5.0), Vec3::new(5.0, 9.0, 5.0), &[0, 1, 3, 4, 5]);
        let shelf = walls(Vec3::new(-3.0, 0.0, -3.0), Vec3::new(-1.0, 3.0, -2.0), &[5]);
        let (body, handle) = (ball(Vec3::new(1.0, 0.5, 0.0), 0.5), ball(Vec3::new(1.55, 0.5, 0.0), 0.2));
        let (beside, in_shelf) = (ball(Vec3::new(0.4, 0.1, 1.0), 0.1), ball(Vec3::new(-2.0, 1.0, -2.5), 0.15));
        let scene = bvh(&[floor, shelf, body, handle, beside, in_shelf]);
        let triangles_of = |instance: u32| {
            let all = scene.triangles().iter().enumerate();
            all.filter(move |(_, t)| t.instance == instance).map(|(i, _)| i)
        };
        let met: Vec<usize> = (0..6).flat_map(triangles_of).collect();
        let boxes =
            |things: Vec<(Bounds, usize)>| -> Vec<Bounds> { things.into_iter().map(|(thing, _)| thing).collect() };
        let found = |met: &[usize], cameras: &[Vec3]| boxes(things(&scene, met, |_| true, cameras));
        let near = |bounds: &Bounds, min: [f32; 3], max: [f32; 3]| {
            let off = (bounds.min - Vec3::from(min)).abs().max((bounds.max - Vec3::from(max)).abs());
            off.max_element() < 0.03
        };
        let all = found(&met, &[Vec3::new(0.0, 2.0, 4.0)]);
        assert_eq!(all.len(), 4, "not the floor: {all:?}");
        assert!(near(&all[0], [0.5, 0.0, -0.5], [1.75, 1.0, 0.5]), "body and handle: {all:?}");
        assert!(
            all.iter().any(|thing| near(thing, [-2.15, 0.85, -2.65], [-1.85, 1.15, -2.35])),
            "in the shelf: {all:?}"
        );
        let in_body = found(&met, &[Vec3::new(1.0, 0.5, 0.0)]);
        assert!(
            in_body.len() == 4 && in_body.iter().any(|thing| near(thing, [1.35, 0.3, -0.2], [1.75, 0.7, 0.2])),
            "the handle without what a camera is in: {in_body:?}"
        );
        let rough = boxes(things(&scene, &met, |i| scene.triangles()[i].instance == 4, &[]));
        assert!(
            rough.len() == 1 && near(&rough[0], [0.3, 0.0, 0.9], [0.5, 0.2, 1.1]),
            "the smooth ball alone: {rough:?}"
        );
        assert!(found(&[], &[]).is_empty());
    }

    #[test]
    fn what_surrounds_a_thing_or_touches_its_corner_is_no_part_of_it() {
        let shell = bvh(&[walls(Vec3::splat(-2.0), Vec3::splat(2.0), &[]), ball(Vec3::ZERO, 0.5)]);
        let met: Vec<usize> = (0..shell.triangles().len()).collect();
        let in_shell = things(&shell, &met, |_| true, &[Vec3::Y]);
        assert!(in_shell.len() == 1 && in_shell[0].0.max.x < 0.6, "{in_shell:?}");
        let pyramid = |y: [f32; 2]| {
            let base = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, z)| Vec3::new(x, y[0], z));
            let corners = [&[Vec3::new(0.0, y[1], 0.0)][..], &base].concat();
            mesh(&corners, vec![0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1])
        };
        let stacked = bvh(&[pyramid([1.0, 2.0]), pyramid([3.0, 2.0])]);
        let stacked: Vec<usize> = Parts::new(&stacked, |_| true).of_triangle.into_iter().flatten().collect();
        assert!(stacked.len() == 8 && stacked.iter().max() == Some(&1), "{stacked:?}");
    }

    #[test]
    fn the_nearest_are_joined_until_they_are_few() {
        let at = |x: f32, count| (Bounds { min: Vec3::splat(x), max: Vec3::splat(x + 1.0) }, count);
        let all = || vec![at(0.0, 5), at(10.0, 4), at(1.5, 3), at(20.0, 1), at(11.0, 1)];
        let joins = |most, may: fn(Bounds, Bounds) -> bool| -> Vec<(f32, usize)> {
            joined(all(), most, may).into_iter().map(|(thing, count)| (thing.min.x, count)).collect()
        };
        assert_eq!(joined(all(), 5, |_, _| true), all());
        assert_eq!(joins(4, |_, _| true), [(0.0, 5), (10.0, 5), (1.5, 3), (20.0, 1)]);
        assert_eq!(joins(2, |_, _| true), [(0.0, 8), (10.0, 6)]);
        assert_eq!(joins(1, |a, b| a.union(b).radius() < 3.0), [(0.0, 8), (10.0, 5), (20.0, 1)], "no more may be");
        assert_eq!(joins(0, |_, _| true), [(0.0, 14)]);
        assert!(joined(Vec::new(), 3, |_, _| true).is_empty());
    }

    #[test]
    fn things_that_are_seen_alike_get_probes_alike() {
        assert_eq!(outstanding(&[9, 5, 5], 3), 3);
        assert_eq!(outstanding(&[9, 9, 8, 7], 3), 0, "a row of balls");
        assert_eq!(outstanding(&[5, 3, 2, 2], 3), 0, "chance");
        assert_eq!(outstanding(&[90, 80, 9, 8, 8], 3), 2);
        assert_eq!(outstanding(&[90, 80, 70, 8, 8], 3), 3);
        assert_eq!(outstanding(&[9], 0), 0);
        assert_eq!(outstanding(&[], 8), 0);
    }
}
