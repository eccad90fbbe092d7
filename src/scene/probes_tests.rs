//! Tests of the placement of probes: rooms, furniture, open places, scenes without cameras in them.

use glam::{Mat4, Vec3Swizzles};

use super::*;
use crate::scene::bvh::tests::mesh;
use crate::scene::{Instance, Mesh};

/// The inside of a box, without the sides whose numbers (−X, +X, −Y, +Y, −Z, +Z) are listed.
pub fn walls(min: Vec3, max: Vec3, without: &[usize]) -> Mesh {
    let corner = |i: usize| Vec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), max, min);
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let corners: Vec<Vec3> = (0..8).map(corner).collect();
    let kept = sides.iter().enumerate().filter(|(side, _)| !without.contains(side));
    let indices = kept.flat_map(|(_, [a, b, c, d])| [*a, *b, *c, *a, *c, *d].map(|i| i as u32)).collect();
    mesh(&corners, indices)
}

/// The same whose fronts are seen from within.
fn room_of_walls(min: Vec3, max: Vec3, without: &[usize]) -> Mesh {
    let mut room = walls(min, max, without);
    room.indices.reverse();
    room
}

pub fn bvh(meshes: &[Mesh]) -> Bvh {
    let placed = |mesh| Instance { mesh, world_from_local: Mat4::IDENTITY };
    let instances: Vec<Instance> = (0..meshes.len()).map(placed).collect();
    Bvh::new(meshes, &instances).unwrap()
}

/// The placement in a scene of these parts, of which the last is smooth.
fn placed(meshes: &[Mesh], cameras: &[Vec3]) -> Placement {
    let bvh = bvh(meshes);
    let last = meshes.len() as u32 - 1;
    place(&bvh, cameras, |triangle| bvh.triangles()[triangle].instance == last)
}

/// A part of a wall where x is 2, as high as the room.
fn wall_at_2(z: [f32; 2]) -> Mesh {
    let at = |y: f32, z: f32| Vec3::new(2.0, y, z);
    mesh(&[at(0.0, z[0]), at(2.5, z[0]), at(2.5, z[1]), at(0.0, z[1])], vec![0, 1, 2, 0, 2, 3])
}

pub fn ball(centre: Vec3, radius: f32) -> Mesh {
    let mut ball = Mesh::ball(12, radius);
    ball.vertices.iter_mut().for_each(|v| v.position = (Vec3::from(v.position) + centre).into());
    ball
}

/// Probes for rooms, and around things.
fn rooms_and_things(found: &Placement) -> [Vec<Probe>; 2] {
    let (things, rooms) = found.probes.iter().partition(|probe| probe.thing.is_some());
    [rooms, things]
}

fn is_box(bounds: Bounds, min: Vec3, max: Vec3) -> bool {
    (bounds.min - min).abs().max((bounds.max - max).abs()).max_element() < 0.05
}

const LOW: Vec3 = Vec3::new(-2.0, 0.0, -3.0);
const HIGH: Vec3 = Vec3::new(2.0, 2.5, 3.0);

#[test]
fn a_room_gets_one_probe_with_its_walls_as_the_box() {
    let table = walls(Vec3::new(-0.5, 0.7, -0.5), Vec3::new(0.5, 0.75, 0.5), &[]);
    let ball = ball(Vec3::new(0.0, 0.9, 0.0), 0.15);
    let cameras = [Vec3::new(1.5, 1.6, 2.5), Vec3::new(-1.5, 1.2, -2.0)];
    let found = placed(&[walls(LOW, HIGH, &[]), table, ball], &cameras);
    let [rooms, things] = rooms_and_things(&found);
    assert_eq!((rooms.len(), things.len(), found.open), (1, 1, 0), "{found:?}");
    let Probe { position, bounds, .. } = rooms[0];
    assert!(
        (bounds.min - LOW).abs().max_element() < 0.02 && (bounds.max - HIGH).abs().max_element() < 0.02,
        "{bounds:?}"
    );
    assert!((position - 0.5 * (LOW + HIGH)).length() < 1.0, "{position}");
    assert!((position - Vec3::new(0.0, 0.9, 0.0)).length() > 0.3, "{position} is clear of the ball");
    let around = Bounds { min: bounds.min.with_y(0.75), ..bounds };
    assert_eq!(found.probes[0].bounds, around, "around the ball, which comes first, are walls and the table");
    assert!((found.probes[0].position - Vec3::new(0.0, 0.9, 0.0)).length() < 0.02, "{found:?}");
    let none = placed(&[walls(LOW, HIGH, &[]), self::ball(Vec3::new(9.0, 0.0, 0.0), 0.1)], &cameras);
    assert_eq!((none.sees_smooth, none.probes.len()), (false, 0), "nothing smooth is seen");
}

#[test]
fn a_room_beside_the_cameras_gets_its_own() {
    // Two rooms side by side without the wall between them but for a door's height, seen through it.
    let next = [Vec3::new(2.0, 0.0, -3.0), Vec3::new(8.0, 2.5, 3.0)];
    let wall = [wall_at_2([-3.0, -0.6]), wall_at_2([0.6, 3.0])];
    let parts = [&[walls(LOW, HIGH, &[1]), walls(next[0], next[1], &[0])][..], &wall].concat();
    let ball = ball(Vec3::new(5.0, 1.0, 0.0), 0.6);
    let found = placed(&[&parts[..], &[ball]].concat(), &[Vec3::new(-1.0, 1.5, 0.0)]);
    let [rooms, things] = rooms_and_things(&found);
    assert_eq!((rooms.len(), things.len()), (1, 1), "{found:?}");
    let bounds = rooms[0].bounds;
    assert!((bounds.min - next[0]).abs().max_element() < 0.1, "{bounds:?}");
    assert!((bounds.max - next[1]).abs().max_element() < 0.1, "{bounds:?}");
}

#[test]
fn a_room_of_which_little_is_seen_gets_its_own() {
    // A smooth floor goes on through a door into the next room.
    let next = [Vec3::new(2.0, 0.0, -3.0), Vec3::new(8.0, 2.5, 3.0)];
    let rooms = [
        room_of_walls(LOW, HIGH, &[1, 2]),
        room_of_walls(next[0], next[1], &[0, 2]),
        wall_at_2([-3.0, 1.2]),
        wall_at_2([2.2, 3.0]),
    ];
    let floor = room_of_walls(LOW, next[1], &[0, 1, 3, 4, 5]);
    let found = placed(&[&rooms[..], &[floor]].concat(), &[Vec3::new(-1.0, 1.5, 1.0)]);
    let bounds: Vec<Bounds> = found.probes.iter().map(|probe| probe.bounds).collect();
    let is_room = |min: Vec3, max: Vec3| bounds.iter().any(|room| is_box(*room, min, max));
    assert!(bounds.len() == 2 && is_room(LOW, HIGH) && is_room(next[0], next[1]), "{found:?}");
}

#[test]
fn what_stands_in_a_street_is_no_wall_of_it() {
    let [low, high] = [Vec3::new(-5.0, 0.0, -40.0), Vec3::new(5.0, 8.0, 40.0)];
    let van = |z: f32| walls(Vec3::new(-2.4, 0.0, z), Vec3::new(-0.4, 2.2, z + 5.0), &[]);
    let ball = ball(Vec3::new(1.0, 1.0, 0.0), 0.3);
    let found = placed(&[walls(low, high, &[3, 4, 5]), van(-9.0), van(6.0), ball], &[Vec3::new(0.5, 1.6, 2.0)]);
    let [Probe { bounds, .. }] = rooms_and_things(&found)[0][..] else { panic!("{found:?}") };
    let (least, most) = (low.with_z(bounds.min.z), bounds.max.with_x(high.x));
    assert!(is_box(bounds, least, most), "{bounds:?}");
    assert!(bounds.max.y > 100.0 && bounds.min.z < -100.0 && bounds.max.z > 100.0, "no roof, and no ends: {bounds:?}");
}

#[test]
fn a_house_at_the_end_of_a_street_is_its_wall() {
    let [low, high] = [Vec3::new(-5.0, 0.0, -40.0), Vec3::new(5.0, 8.0, 25.0)];
    let ball = ball(Vec3::new(1.0, 1.0, 0.0), 0.3);
    let found = placed(&[walls(low, high, &[3, 4]), ball], &[Vec3::new(0.5, 1.6, 2.0)]);
    let [Probe { bounds, .. }] = rooms_and_things(&found)[0][..] else { panic!("{found:?}") };
    assert!((bounds.min.xy() - low.xy()).abs().max_element() < 0.05, "{bounds:?}");
    assert!((bounds.max.xz() - high.xz()).abs().max_element() < 0.05, "{bounds:?}");
    assert!(bounds.max.y > 100.0 && bounds.min.z < -100.0, "no roof, and no other end: {bounds:?}");
}

#[test]
fn a_porch_in_a_wide_meadow_is_a_room() {
    let meadow = room_of_walls(Vec3::new(-30.0, 0.0, -30.0), Vec3::new(30.0, 9.0, 30.0), &[0, 1, 3, 4, 5]);
    let floor = room_of_walls(LOW + 0.1 * Vec3::Y, HIGH, &[0, 1, 3, 4, 5]);
    let found = placed(&[meadow, room_of_walls(LOW, HIGH, &[2, 5]), floor], &[Vec3::new(4.0, 1.6, 6.0)]);
    let [Probe { bounds, .. }] = rooms_and_things(&found)[0][..] else { panic!("{found:?}") };
    assert!((bounds.min - LOW - 0.1 * Vec3::Y).abs().max_element() < 0.05, "{bounds:?}");
    assert!((bounds.max.xy() - HIGH.xy()).abs().max_element() < 0.05 && bounds.max.z > 100.0, "{bounds:?}");
}

#[test]
fn cupboards_are_no_wall() {
    // Cupboards along the wall where z is -3, above and below.
    let block = |y: [f32; 2], depth: f32| walls(Vec3::new(-2.0, y[0], -3.0), Vec3::new(2.0, y[1], -3.0 + depth), &[4]);
    let ball = ball(Vec3::new(0.0, 1.0, 0.0), 0.2);
    let kitchen = [walls(LOW, HIGH, &[]), block([0.0, 0.9], 0.6), block([1.5, 2.1], 0.35), ball];
    let found = placed(&kitchen, &[Vec3::new(1.0, 1.5, 2.0)]);
    let [Probe { bounds, .. }] = rooms_and_things(&found)[0][..] else { panic!("{found:?}") };
    assert!((bounds.min.z - LOW.z).abs() < 0.02, "{bounds:?}");
}

#[test]
fn a_room_found_from_places_outside_of_its_box_gets_one_probe() {
    // The box that is there ends before the wall where the next camera is.
    let parts = [walls(LOW, HIGH, &[]), ball(Vec3::new(0.0, 1.0, 0.0), 0.4)];
    let short = Probe { position: Vec3::Y, bounds: Bounds { min: LOW, max: Vec3::new(1.4, 2.5, 3.0) }, thing: None };
    let mut found = Placement { probes: vec![short], ..Placement::default() };
    let start = Vec3::new(1.8, 1.2, 2.0);
    let seen = [Vec3::X, Vec3::Z, -Vec3::X, -Vec3::Z].map(|side| Vec3::Y + 0.5 * side);
    let hierarchy = bvh(&parts);
    assert!(!found.reach(start) && room(&hierarchy, start).is_some());
    found.add(&hierarchy, start, &seen, 1);
    assert_eq!(found.probes, [short]);
    let probe = Probe { position: Vec3::ZERO, bounds: Bounds { min: LOW, max: HIGH }, thing: None };
    let moved = |by: Vec3| Probe { bounds: Bounds { min: LOW + by, max: HIGH + by }, ..probe };
    assert!(probe.is_same_room(&moved(Vec3::new(0.2, 0.0, 0.0))));
    assert!(!probe.is_same_room(&moved(Vec3::new(0.0, 0.0, 3.0))), "the room beside it");
    let niche = Probe { bounds: Bounds { min: LOW, max: Vec3::new(-1.0, 2.0, 0.0) }, ..probe };
    assert!(!probe.is_same_room(&niche) && !niche.is_same_room(&probe), "a niche is its own");
}

#[test]
fn a_thing_in_the_open_gets_its_own_and_a_court_has_no_ceiling() {
    let floor = walls(Vec3::new(-5.0, 0.0, -5.0), Vec3::new(5.0, 9.0, 5.0), &[0, 1, 3, 4, 5]);
    let camera = [Vec3::new(0.0, 1.5, 2.0)];
    let found = placed(&[floor.clone(), ball(Vec3::new(0.0, 0.5, 0.0), 0.5)], &camera);
    let [Probe { position, bounds, thing: Some(thing) }] = found.probes[..] else { panic!("{found:?}") };
    assert!(found.open > 0 && (position - Vec3::new(0.0, 0.5, 0.0)).length() < 0.05, "{found:?}");
    assert!(bounds.min.y.abs() < 1e-3 && bounds.max.min_element() > 30.0, "the floor, and no walls: {bounds:?}");
    assert!(thing.min.y > 0.001 && (thing.max - Vec3::new(0.5, 1.0, 0.5)).abs().max_element() < 0.03, "{thing:?}");
    assert!(!found.probes[0].reaches(Vec3::new(0.1, 0.0, 0.1)), "the floor has its own mirror images");
    assert!(found.probes[0].reaches(Vec3::new(0.0, 0.02, 0.0)));
    let sunk = placed(&[floor.clone(), ball(Vec3::new(0.0, 0.4, 0.0), 0.5)], &camera);
    let sunk = sunk.probes[0].thing.expect("a thing").min.y;
    assert!((0.0..0.02).contains(&sunk), "rays begin above the floor, not below: {sunk}");
    let alone = placed(&[ball(Vec3::new(0.0, 0.5, 0.0), 0.5)], &camera);
    assert!(alone.probes.is_empty() && alone.open > 0, "the panorama alone: {alone:?}");
    let shiny_floor = placed(&[ball(Vec3::new(0.0, 0.5, 0.0), 0.5), floor], &camera);
    assert!(shiny_floor.probes.is_empty(), "a floor is no thing: {shiny_floor:?}");
    let court = walls(Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 6.0, 3.0), &[3]);
    let found = placed(&[court, ball(Vec3::new(0.0, 0.5, 0.0), 0.5)], &camera);
    let [Probe { bounds, .. }] = rooms_and_things(&found)[0][..] else { panic!("{found:?}") };
    assert!(bounds.max.y > 30.0 && (bounds.max.x - 3.0).abs() < 0.05 && bounds.min.y.abs() < 0.05, "{bounds:?}");
}

#[test]
fn a_small_thing_far_from_the_camera_gets_its_own_with_the_wall_behind_it() {
    let floor = walls(Vec3::new(-8.0, 0.0, -8.0), Vec3::new(8.0, 9.0, 8.0), &[0, 1, 3, 4, 5]);
    let wall = walls(Vec3::new(-8.0, 0.0, -0.5), Vec3::new(8.0, 3.0, 8.0), &[0, 1, 2, 3, 5]);
    let found = placed(&[floor, wall, ball(Vec3::new(-3.6, 0.4, 0.8), 0.4)], &[Vec3::new(1.5, 1.7, 5.5)]);
    let [Probe { bounds, thing: Some(_), .. }] = found.probes[..] else { panic!("{found:?}") };
    assert!((bounds.min.z + 0.5).abs() < 0.05 && bounds.min.y.abs() < 1e-3, "{bounds:?}");
    assert!(bounds.max.min_element() > 30.0 && bounds.min.x < -30.0, "no other walls: {bounds:?}");
}

#[test]
fn a_box_does_not_see_its_own_sides() {
    let floor = walls(Vec3::new(-5.0, 0.0, -5.0), Vec3::new(5.0, 9.0, 5.0), &[0, 1, 3, 4, 5]);
    let parts = [floor, walls(Vec3::new(-0.4, 0.0, -0.3), Vec3::new(0.4, 0.9, 0.3), &[])];
    let found = placed(&parts, &[Vec3::new(0.0, 1.5, 2.0)]);
    let [probe] = found.probes[..] else { panic!("{found:?}") };
    let Surroundings { from, met, .. } = Surroundings::around(&bvh(&parts), probe.position, probe.hidden(), RAYS);
    let heights: Vec<f32> = met.iter().map(|met| from.y + met.t * met.d.y).collect();
    assert!(heights.len() > RAYS as usize / 3, "rays that go down meet the floor: {}", heights.len());
    // Its sides reach down to the floor, to which rays begin a little above.
    let highest = heights.iter().copied().fold(0.0, f32::max);
    assert!(highest < probe.border(), "the box's own sides are met, {highest} m high");
}

#[test]
fn what_hangs_shows_what_is_below_it_and_not_its_own_underside() {
    let floor = walls(Vec3::new(-5.0, 0.0, -5.0), Vec3::new(5.0, 9.0, 5.0), &[0, 1, 3, 4, 5]);
    let [low, high] = [Vec3::new(-0.4, 0.3, -0.8), Vec3::new(0.4, 0.9, 0.8)];
    let found = placed(&[floor, walls(low, high, &[])], &[Vec3::new(0.0, 1.5, 2.5)]);
    let [Probe { bounds, thing: Some(thing), .. }] = found.probes[..] else { panic!("{found:?}") };
    assert!(bounds.min.y.abs() < 1e-3, "the floor is where it is: {bounds:?}");
    assert!(thing.min.y < 0.3 && thing.min.y > 0.28, "the underside mirrors it, too: {thing:?}");
    assert!(found.probes[0].hidden().contains(Bounds { min: low, max: high }), "rays begin outside of it");
}

#[test]
fn small_things_in_a_room_get_their_own_and_neighbours_share_where_there_are_many() {
    let room = walls(LOW, HIGH, &[]);
    let cameras = [[1.5, 2.5], [-1.5, 2.5], [1.5, -2.5], [-1.5, -2.5]].map(|[x, z]| Vec3::new(x, 1.6, z));
    let chest = walls(Vec3::new(-2.0, 0.01, -3.0), Vec3::new(1.0, 1.2, -2.0), &[]);
    let [rooms, things] = rooms_and_things(&placed(&[room.clone(), chest], &cameras));
    assert_eq!((rooms.len(), things.len()), (1, 0), "6 % of the room is no small thing");
    // Pairs of balls, each as far from the others as the room lets it.
    let balls: Vec<Mesh> = (0..32)
        .map(|i| {
            let (pair, side) = (i / 2, (i % 2) as f32);
            ball(Vec3::new((pair % 4) as f32 - 1.5 + 0.2 * side, 0.5, (pair / 4) as f32 - 1.5), 0.095)
        })
        .collect();
    let bvh = bvh(&[&[room][..], &balls].concat());
    let found = place(&bvh, &cameras, |triangle| bvh.triangles()[triangle].instance > 0);
    let [rooms, things] = rooms_and_things(&found);
    assert_eq!((rooms.len(), found.crowded), (1, false), "{found:?}");
    assert_eq!(things.len(), MOST_PROBES - 1);
    let holds = |probe: &Probe| {
        balls
            .iter()
            .filter(|ball| {
                let thing = probe.thing.map(|thing| thing.grown(0.01));
                thing.is_some_and(|thing| thing.contains(Bounds::of(ball.vertices.iter().map(|v| v.position.into()))))
            })
            .count()
    };
    let mut held: Vec<usize> = things.iter().map(holds).collect();
    held.sort_unstable();
    assert_eq!(held, [&[2; 14][..], &[4]].concat(), "pairs, of which two share what is left");
}

#[test]
fn scenes_that_make_no_sense_do_not_stop_it() {
    assert_eq!(placed(&[ball(Vec3::ZERO, 0.0)], &[Vec3::ZERO]), Placement::default());
    let inside = placed(&[ball(Vec3::ZERO, 1.0)], &[Vec3::ZERO, Vec3::NAN, Vec3::splat(1e9)]);
    assert!(inside.probes.iter().all(|probe| probe.bounds.min.cmplt(probe.bounds.max).all()), "{inside:?}");
    assert!(placed(&[ball(Vec3::ZERO, 1.0)], &[]).probes.is_empty());
}
