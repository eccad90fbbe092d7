//! Tests of the atlas by rasterising it: whole scenes, and those that cannot be unwrapped.

use std::collections::BTreeSet;
use std::path::Path;

use glam::{Mat4, Quat, Vec2, Vec3};

use super::*;
use crate::asset::{Storage, TextureOptions};
use crate::scene::cluster::clusters;
use crate::scene::groups::Groups;
use crate::scene::{Bounds, LoadOptions};

fn work<'a>(report: &'a Report, stop: &'a AtomicBool) -> Work<'a> {
    Work { cache: None, report, stop }
}

fn try_flatten(meshes: &[Mesh], instances: &[Instance], side: u32) -> Result<Flattened, NoAtlas> {
    flatten(GeometryView { meshes, instances }, &[], side, work(&Report::silent(), &AtomicBool::new(false)))
}

fn flattened(meshes: &[Mesh], instances: &[Instance], side: u32) -> Flattened {
    try_flatten(meshes, instances, side).unwrap()
}

/// Triangles of three corners each, with one normal for all.
fn soup(corners: &[Vec3]) -> Mesh {
    let vertex = |p: &Vec3| {
        let (normal, tangent) = ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 1.0]);
        Vertex { position: p.to_array(), normal, uv: [0.0; 2], tangent, ..Vertex::default() }
    };
    let (vertices, indices) = (corners.iter().map(vertex).collect(), (0..corners.len() as u32).collect());
    Mesh { name: "soup".into(), vertices, indices, material: 0, bounds: Bounds::of(corners.iter().copied()) }
}

/// A ball, thrice in a row with other sizes, once mirrored; and an upright quadrilateral.
fn row() -> (Vec<Mesh>, Vec<Instance>) {
    let square = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::ZERO, Vec3::X + Vec3::Y, Vec3::Y];
    let place = |mesh, scale, x| {
        let turn = Quat::from_rotation_y(0.3 * x);
        let world_from_local = Mat4::from_scale_rotation_translation(scale, turn, Vec3::X * x);
        Instance { mesh, world_from_local }
    };
    let sizes = [Vec3::ONE, Vec3::splat(0.5), Vec3::new(-2.0, 2.0, 2.0)];
    let mut instances: Vec<Instance> = (0u8..).zip(sizes).map(|(i, s)| place(0, s, 5.0 * f32::from(i))).collect();
    instances.push(place(1, Vec3::splat(3.0), -5.0));
    (vec![Mesh::ball(12, 1.0), soup(&square)], instances)
}

/// Corners of each triangle in texels, and its place in world space.
fn triangles(scene: &Flattened) -> Vec<([Vec2; 3], [Vec3; 3])> {
    let side = scene.atlas.size[0] as f32;
    let of_instance = |(mesh, instance): (&Mesh, &Instance)| {
        let corner = |i: u32| {
            let v = &mesh.vertices[i as usize];
            (side * Vec2::from(v.lightmap_uv), instance.world_from_local.transform_point3(v.position.into()))
        };
        let triangle = |t: &[u32]| {
            let [a, b, c] = [t[0], t[1], t[2]].map(corner);
            ([a.0, b.0, c.0], [a.1, b.1, c.1])
        };
        mesh.indices.chunks_exact(3).map(triangle).collect::<Vec<_>>()
    };
    scene.meshes.iter().zip(&scene.instances).flat_map(of_instance).collect()
}

/// The chart of each triangle: those that have a point of the atlas in common, which two charts never have.
fn charts(triangles: &[([Vec2; 3], [Vec3; 3])]) -> Vec<u32> {
    let mut known: HashMap<[u32; 2], u32> = HashMap::new();
    let mut groups = Groups::new(3 * triangles.len());
    let mut point = |p: Vec2| {
        let next = known.len() as u32;
        *known.entry(p.to_array().map(f32::to_bits)).or_insert(next)
    };
    let points: Vec<[u32; 3]> = triangles.iter().map(|(t, _)| t.map(&mut point)).collect();
    for [a, b, c] in &points {
        groups.join(*a, *b);
        groups.join(*b, *c);
    }
    points.iter().map(|[a, ..]| groups.of(*a)).collect()
}

/// Whether a triangle overlaps the square of half side `half` around `centre` (separating axes).
fn overlaps(triangle: [Vec2; 3], centre: Vec2, half: f32) -> bool {
    let corners = triangle.map(|p| p - centre);
    let [a, b, c] = corners;
    let axes = [Vec2::X, Vec2::Y, (b - a).perp(), (c - b).perp(), (a - c).perp()];
    axes.iter().all(|axis| {
        let along = corners.map(|p| p.dot(*axis));
        let reach = half * (axis.x.abs() + axis.y.abs());
        along.iter().any(|d| *d < reach) && along.iter().any(|d| *d > -reach)
    })
}

/// No texel is read from two charts by bilinear filtering, no place in the atlas is covered twice, and none is outside.
/// Rounding to steps turns edges by less than `tolerance`.
fn assert_apart(scene: &Flattened) {
    let side = scene.atlas.size[0] as usize;
    let tolerance = 2.0 * side as f32 / STEPS as f32;
    let triangles = triangles(scene);
    let charts = charts(&triangles);
    let (mut readers, mut covers) = (vec![None; side * side], vec![false; side * side]);
    let mut read = 0;
    for ((triangle, _), chart) in triangles.iter().zip(&charts) {
        let [a, b, c] = *triangle;
        let (least, most) = (a.min(b).min(c) - 1.0, a.max(b).max(c) + 1.0);
        assert!(least.min_element() > -0.6 && most.max_element() < side as f32 + 0.6, "{least} {most}");
        for y in least.y.max(0.0) as usize..(most.y.ceil() as usize).min(side) {
            for x in least.x.max(0.0) as usize..(most.x.ceil() as usize).min(side) {
                let (texel, centre) = (y * side + x, Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
                if overlaps(*triangle, centre, 1.0 - tolerance) {
                    assert_eq!(*readers[texel].get_or_insert(*chart), *chart, "texel {x}, {y}");
                    read += 1;
                }
                let inside = [(a, b), (b, c), (c, a)]
                    .iter()
                    .all(|(p, q)| (*q - *p).perp_dot(centre - *p) > tolerance * p.distance(*q));
                assert!(!(inside && covers[texel]), "texel {x}, {y} is covered twice");
                covers[texel] |= inside;
            }
        }
    }
    assert!(read > 0);
    let names: BTreeSet<u32> = charts.into_iter().collect();
    assert_eq!(names.len(), scene.atlas.charts);
}

#[test]
fn charts_share_no_texel_and_every_square_metre_has_equally_many() {
    let (meshes, instances) = row();
    for side in [256, 384, 1024] {
        let scene = flattened(&meshes, &instances, side);
        // Half of each pole's triangles are degenerate.
        assert_eq!((scene.atlas.size, scene.unplaced), ([side; 2], 3 * 2 * 24));
        assert_apart(&scene);
        let density = f64::from(scene.atlas.texels_per_metre).powi(2);
        let (mut texels, mut metres) = (0.0, 0.0);
        for ([a, b, c], [p, q, r]) in triangles(&scene) {
            let placed = f64::from(0.5 * (b - a).perp_dot(c - a));
            assert!(placed >= 0.0, "turned over in the atlas");
            let area = f64::from((q - p).cross(r - p).length()) * 0.5;
            assert!((0.2..5.0).contains(&(placed / (area * density))) || placed < 1.0, "{placed} texels, {area} m²");
            (texels, metres) = (texels + placed, metres + area);
        }
        assert!((texels / metres / density - 1.0).abs() < 0.03, "{texels} {metres} {density}");
        let used = texels / f64::from(side * side);
        assert!((used / f64::from(scene.atlas.used) - 1.0).abs() < 0.02 && used > 0.6, "{used} {:?}", scene.atlas);
    }
}

#[test]
fn only_vertices_are_split() {
    let (meshes, instances) = row();
    let scene = flattened(&meshes, &instances, 256);
    assert_eq!(scene.instances.iter().map(|i| i.mesh).collect::<Vec<_>>(), [0, 1, 2, 3]);
    for ((old, new), mesh) in instances.iter().zip(&scene.instances).zip(&scene.meshes) {
        let source = &meshes[old.mesh];
        assert_eq!(old.world_from_local, new.world_from_local);
        assert_eq!((mesh.material, mesh.bounds, &mesh.name), (source.material, source.bounds, &source.name));
        assert_eq!(mesh.indices.len(), source.indices.len());
        for (now, before) in mesh.indices.iter().zip(&source.indices) {
            let now = Vertex { lightmap_uv: [0.0; 2], ..mesh.vertices[*now as usize] };
            assert_eq!(now, source.vertices[*before as usize]);
        }
        assert!(mesh.vertices.len() < source.vertices.len() * 3 / 2, "{} vertices", mesh.vertices.len());
        let is_whole = |steps: f32| (steps - steps.round()).abs() < 0.01;
        let on_steps = |v: &Vertex| v.lightmap_uv.iter().all(|c| (0.0..1.0).contains(c) && is_whole(c * STEPS as f32));
        assert!(mesh.vertices.iter().all(on_steps));
    }
    let closed = clusters(&scene.meshes, &scene.instances, &[]).iter().filter(|c| c.culling_bounds.is_some()).count();
    assert_eq!(closed, 3, "the balls are as closed as before");
}

#[test]
fn a_shipped_room_is_unwrapped_the_same_by_any_number_of_threads() {
    let textures = TextureOptions { storage: Storage::Raw, ..TextureOptions::default() };
    let options = LoadOptions { textures, ..LoadOptions::default() };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/tearoom.toml");
    let room = crate::scene::load(&file, &options, &Report::silent()).unwrap();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| flattened(&room.meshes, &room.instances, 512))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one.atlas, three.atlas);
    for (a, b) in one.meshes.iter().zip(&three.meshes) {
        assert!(a.vertices == b.vertices && a.indices == b.indices, "{}", a.name);
    }
    assert!(one.atlas.used > 0.85 && one.atlas.texels_per_metre > 50.0 && one.unplaced == 0, "{:?}", one.atlas);
    assert_apart(&one);
}

#[test]
fn what_has_no_area_has_no_atlas() {
    let alone = |mesh: Mesh| try_flatten(&[mesh], &[Instance { mesh: 0, world_from_local: Mat4::IDENTITY }], 256);
    let (nan, inf) = (Vec3::splat(f32::NAN), Vec3::splat(f32::INFINITY));
    for corners in [
        &[][..],
        &[Vec3::ONE; 3],
        &[Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
        &[nan, Vec3::X, Vec3::Y],
        &[Vec3::ZERO, inf, Vec3::Y],
        &[Vec3::ZERO, Vec3::X * 1e-30, Vec3::Y * 1e-30],
    ] {
        let found = alone(soup(corners)).map(|scene| scene.atlas);
        assert!(matches!(found, Err(NoAtlas::NoArea)) || corners.last() == Some(&(Vec3::Y * 1e-30)), "{found:?}");
    }
    assert!(matches!(try_flatten(&[], &[], 256), Err(NoAtlas::NoArea)));
    let flat = Instance { mesh: 0, world_from_local: Mat4::from_scale(Vec3::ZERO) };
    assert!(matches!(try_flatten(&[Mesh::ball(6, 1.0)], &[flat], 256), Err(NoAtlas::NoArea)));
}

#[test]
fn triangles_without_area_take_a_point_of_their_neighbours() {
    let square = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
    // A line on an edge of the square, a point elsewhere, and a corner that is nowhere.
    let line = [Vec3::ZERO, Vec3::X * 0.5, Vec3::X];
    let point = [Vec3::Z; 3];
    let nowhere = [Vec3::ZERO, Vec3::splat(f32::NAN), Vec3::X];
    let corners: Vec<Vec3> = [&line[..], &square, &point, &nowhere].concat();
    let scene = flattened(&[soup(&corners)], &[Instance { mesh: 0, world_from_local: Mat4::IDENTITY }], 256);
    assert_eq!((scene.unplaced, scene.atlas.charts), (3, 1));
    let places: Vec<Vec2> =
        scene.meshes[0].indices.iter().map(|i| scene.meshes[0].vertices[*i as usize].lightmap_uv.into()).collect();
    let of_square = &places[3..9];
    for triangle in [0, 9, 12] {
        let three = &places[triangle..triangle + 3];
        assert!(of_square.contains(&three[0]) && three[0] == three[1] && three[1] == three[2], "{three:?}");
    }
}

#[test]
fn overlapping_and_inside_out_surfaces_have_places_of_their_own() {
    let square = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
    let turned: Vec<Vec3> = square.iter().rev().copied().collect();
    let corners = [&square[..], &square, &turned].concat();
    let scene = flattened(&[soup(&corners)], &[Instance { mesh: 0, world_from_local: Mat4::IDENTITY }], 256);
    assert_eq!(scene.unplaced, 0);
    assert_apart(&scene);
}

/// Triangles anywhere, the later the smaller.
fn confetti(count: u32) -> Mesh {
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut point = || Vec3::new(random(), random(), random());
    let mut corners = Vec::new();
    for i in 0..count {
        let at = 100.0 * point();
        corners.extend([(); 3].map(|()| at + point() * (1.0 - i as f32 / count as f32)));
    }
    soup(&corners)
}

#[test]
fn of_too_many_surfaces_the_largest_have_places() {
    let instances = [Instance { mesh: 0, world_from_local: Mat4::IDENTITY }];
    let scene = flattened(&[confetti(20_000)], &instances, 256);
    // A quarter of what an atlas of this size may hold.
    let most = 256 * 256 / TEXELS_PER_CHART / 4;
    assert_eq!((scene.atlas.charts, scene.unplaced), (most, 20_000 - most));
    let (mut least_placed, mut most_left) = (f32::INFINITY, 0.0_f32);
    for ([a, b, _], [p, q, r]) in triangles(&scene) {
        let area = (q - p).cross(r - p).length();
        if a == b {
            most_left = most_left.max(area);
        } else {
            least_placed = least_placed.min(area);
        }
    }
    assert!(least_placed >= most_left * 0.9999, "{least_placed} {most_left}");
}

#[test]
fn what_cannot_be_left_out_in_parts_has_no_atlas() {
    // Blades that all have one point in common.
    let mut corners = confetti(6_000).vertices.iter().map(|v| v.position.into()).collect::<Vec<Vec3>>();
    corners.iter_mut().step_by(3).for_each(|corner| *corner = Vec3::ZERO);
    let instances = [Instance { mesh: 0, world_from_local: Mat4::IDENTITY }];
    assert_eq!(try_flatten(&[soup(&corners)], &instances, 256).err(), Some(NoAtlas::TooFragmented));
    let ball = Mesh::ball(100, 1.0);
    let (each, all) = (ball.indices.len() / 3, vec![instances[0]; 101]);
    assert_eq!(try_flatten(&[ball], &all, 256).err(), Some(NoAtlas::TooManyTriangles(101 * each)));
}

#[test]
fn atlases_are_kept_and_a_stopped_one_is_not() {
    let (meshes, instances) = row();
    let flatten = |meshes: &[Mesh], instances: &[Instance], side, work| {
        super::flatten(GeometryView { meshes, instances }, &[], side, work)
    };
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::in_folder(folder.path().join("maps"));
    let (report, stop) = (Report::silent(), AtomicBool::new(true));
    let work = Work { cache: Some(&cache), ..work(&report, &stop) };
    assert_eq!(flatten(&meshes, &instances, 256, work).err(), Some(NoAtlas::Stopped));
    assert!(!folder.path().join("maps").exists());
    stop.store(false, Ordering::Relaxed);
    let fresh = flatten(&meshes, &instances, 256, work).unwrap();
    // Stopped as soon as it would have to be made again.
    stop.store(true, Ordering::Relaxed);
    let kept = flatten(&meshes, &instances, 256, work).unwrap();
    assert_eq!((kept.atlas, kept.unplaced), (fresh.atlas, fresh.unplaced));
    for (a, b) in kept.meshes.iter().zip(&fresh.meshes) {
        assert!(a.vertices == b.vertices && a.indices == b.indices);
    }
    let mut moved = instances.clone();
    moved.iter_mut().for_each(|i| i.world_from_local = Mat4::from_translation(Vec3::Y) * i.world_from_local);
    assert!(flatten(&meshes, &moved, 256, work).is_ok(), "where it stands does not matter");
    let larger: Vec<Instance> =
        moved.iter().map(|i| Instance { world_from_local: i.world_from_local * 2.0, ..*i }).collect();
    for (instances, side) in [(&instances, 512), (&larger, 256)] {
        assert_eq!(flatten(&meshes, instances, side, work).err(), Some(NoAtlas::Stopped));
    }
}
