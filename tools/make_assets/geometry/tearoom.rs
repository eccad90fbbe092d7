//! The tearoom: a table laid for tea in a room with a window.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec2, DVec3};

use super::obj::{Material, Obj};
use super::shapes::{Sheet, block, lathe, tube};
use super::teapot::{self, Segments};

/// The room's inner size; the floor's middle is the origin, the window is in the wall towards −z.
const ROOM_METRES: DVec3 = DVec3::new(4.4, 2.6, 4.0);
/// The window's hole: left, bottom, right, top.
const WINDOW_METRES: [f64; 4] = [-0.9, 0.9, 0.9, 2.2];
const WALL_METRES: f64 = 0.22;
const TABLE_TOP_METRES: f64 = 0.74;

const PLASTER_REPEATS: f64 = 0.5;
const WOOD_REPEATS: f64 = 0.8;

/// The whole room, furnished.
pub fn model() -> Obj {
    let mut obj = Obj::default();
    room(&mut obj);
    window(&mut obj);
    table(&mut obj);
    tea_things(&mut obj);
    lamp(&mut obj);
    obj
}

/// Plaster, wood, porcelain, brass, tea.
pub fn materials() -> Vec<Material> {
    let mapped = |name, maps| Material { name, albedo: [1.0; 3], metallic: 1.0, roughness: 1.0, maps: Some(maps) };
    let plain = |name, albedo, metallic, roughness| Material { name, albedo, metallic, roughness, maps: None };
    vec![
        mapped("plaster", "plaster"),
        mapped("wood", "wood"),
        plain("porcelain", [0.83, 0.82, 0.78], 0.0, 0.12),
        plain("brass", [0.91, 0.78, 0.42], 1.0, 0.25),
        plain("tea", [0.09, 0.022, 0.004], 0.0, 0.05),
    ]
}

fn sheet(obj: &mut Obj, corner: [f64; 3], right: DVec3, up: DVec3, repeats: f64) {
    let corner = DVec3::from_array(corner);
    // Sheets of one wall share one texture plane, so that the pieces around the window meet without a seam.
    let uv_origin = DVec2::new(corner.dot(right.normalize()), corner.dot(up.normalize()));
    Sheet { corner, right, up, uv_origin, repeats_per_metre: repeats }.build(obj, 1, 1);
}

/// Floor, ceiling and walls, seen from inside.
fn room(obj: &mut Obj) {
    let (x, y, z) = (ROOM_METRES.x / 2.0, ROOM_METRES.y, ROOM_METRES.z / 2.0);
    let (along_x, along_y, along_z) = (DVec3::X * 2.0 * x, DVec3::Y * y, DVec3::Z * 2.0 * z);
    obj.object("floor", "wood");
    sheet(obj, [-x, 0.0, z], along_x, -along_z, WOOD_REPEATS);
    obj.object("walls", "plaster");
    sheet(obj, [-x, y, -z], along_x, along_z, PLASTER_REPEATS);
    sheet(obj, [x, 0.0, z], -along_x, along_y, PLASTER_REPEATS);
    sheet(obj, [-x, 0.0, z], -along_z, along_y, PLASTER_REPEATS);
    sheet(obj, [x, 0.0, -z], along_z, along_y, PLASTER_REPEATS);
    let [left, bottom, right, top] = WINDOW_METRES;
    let mut wall = |x0: f64, y0: f64, x1: f64, y1: f64| {
        sheet(obj, [x0, y0, -z], DVec3::X * (x1 - x0), DVec3::Y * (y1 - y0), PLASTER_REPEATS);
    };
    wall(-x, 0.0, x, bottom);
    wall(-x, top, x, y);
    wall(-x, bottom, left, top);
    wall(right, bottom, x, top);
}

/// The hole's four sides, and a wooden frame with a cross bar.
fn window(obj: &mut Obj) {
    let [left, bottom, right, top] = WINDOW_METRES;
    let (inner, outer) = (-ROOM_METRES.z / 2.0, -ROOM_METRES.z / 2.0 - WALL_METRES);
    let (width, height, depth) = (DVec3::X * (right - left), DVec3::Y * (top - bottom), DVec3::Z * WALL_METRES);
    obj.object("reveal", "plaster");
    sheet(obj, [left, bottom, inner], width, -depth, PLASTER_REPEATS);
    sheet(obj, [left, top, outer], width, depth, PLASTER_REPEATS);
    sheet(obj, [left, bottom, inner], -depth, height, PLASTER_REPEATS);
    sheet(obj, [right, bottom, outer], depth, height, PLASTER_REPEATS);
    obj.object("frame", "wood");
    let (bar, back, front) = (0.05, outer + 0.02, outer + 0.08);
    let mut beam = |x0: f64, y0: f64, x1: f64, y1: f64| {
        block(obj, DVec3::new(x0, y0, back), DVec3::new(x1, y1, front), WOOD_REPEATS);
    };
    beam(left, bottom, left + bar, top);
    beam(right - bar, bottom, right, top);
    beam(left + bar, bottom, right - bar, bottom + bar);
    beam(left + bar, top - bar, right - bar, top);
    beam(-bar / 2.0, bottom + bar, bar / 2.0, top - bar);
    beam(left + bar, 1.75, -bar / 2.0, 1.79);
    beam(bar / 2.0, 1.75, right - bar, 1.79);
    obj.object("sill", "wood");
    let sill = DVec3::new(left - 0.06, bottom - 0.03, inner);
    block(obj, sill, DVec3::new(right + 0.06, bottom, inner + 0.14), WOOD_REPEATS);
}

fn table(obj: &mut Obj) {
    obj.object("table", "wood");
    let (x, z, top) = (0.70, 0.45, TABLE_TOP_METRES);
    block(obj, DVec3::new(-x, top - 0.03, -z), DVec3::new(x, top, z), WOOD_REPEATS);
    let inset = 0.06;
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let foot = DVec3::new(sx * (x - inset - 0.03), 0.0, sz * (z - inset - 0.03));
        let half = DVec3::new(0.03, 0.0, 0.03);
        block(obj, foot - half, foot + half + DVec3::Y * (top - 0.03), WOOD_REPEATS);
    }
    let (low, high) = (top - 0.11, top - 0.03);
    for s in [-1.0, 1.0] {
        let (ax, az) = (s * (x - inset - 0.03), s * (z - inset - 0.03));
        let (rail_x, rail_z) = (x - inset - 0.06, z - inset - 0.06);
        block(obj, DVec3::new(-rail_x, low, az - 0.012), DVec3::new(rail_x, high, az + 0.012), WOOD_REPEATS);
        block(obj, DVec3::new(ax - 0.012, low, -rail_z), DVec3::new(ax + 0.012, high, rail_z), WOOD_REPEATS);
    }
}

/// Teapot on a brass tray, four cups with saucers and spoons.
fn tea_things(obj: &mut Obj) {
    let on_table = |x: f64, z: f64, turn: f64| {
        DAffine3::from_translation(DVec3::new(x, TABLE_TOP_METRES, z)) * DAffine3::from_rotation_y(turn)
    };
    obj.object("tray", "brass");
    lathe(obj, on_table(0.0, -0.05, 0.0), &TRAY, 64, 4.0);
    obj.object("teapot", "porcelain");
    let pot_on_tray = on_table(0.0, -0.05, -0.5) * DAffine3::from_translation(DVec3::Y * 0.003);
    teapot::pot(obj, pot_on_tray, Segments { around: 9, along: 9 });
    for (number, (x, z)) in [(-0.42, -0.16), (0.43, -0.12), (0.34, 0.24), (-0.30, 0.26)].into_iter().enumerate() {
        let place = on_table(x, z, 0.9 + 1.7 * number as f64);
        obj.object(&format!("saucer {}", number + 1), "porcelain");
        lathe(obj, place, &SAUCER, 40, 4.0);
        obj.object(&format!("cup {}", number + 1), "porcelain");
        let cup = place * DAffine3::from_translation(DVec3::Y * 0.006);
        lathe(obj, cup, &CUP, 40, 4.0);
        cup_handle(obj, cup);
        obj.object(&format!("tea {}", number + 1), "tea");
        lathe(obj, cup, &[[0.0388, 0.047], [0.0, 0.047]], 40, 4.0);
        obj.object(&format!("spoon {}", number + 1), "brass");
        // It rests on the saucer's rim.
        spoon(obj, place * DAffine3::from_translation(DVec3::new(0.0, 0.0205, 0.052)));
    }
}

/// Half an ear, from under the lip to the waist, towards local +x.
fn cup_handle(obj: &mut Obj, world_from_cup: DAffine3) {
    let path: Vec<DVec3> = (0..=12)
        .map(|i| {
            let angle = PI * (0.5 - f64::from(i) / 12.0);
            DVec3::new(0.035 + 0.026 * angle.cos(), 0.033 + 0.017 * angle.sin(), 0.0)
        })
        .collect();
    tube(obj, world_from_cup, &path, DVec3::Z, 0.0032, 10, 4.0);
}

/// A straight handle with a flat oval bowl, lying along local x.
fn spoon(obj: &mut Obj, world_from_spoon: DAffine3) {
    let path: Vec<DVec3> = (0..=6).map(|i| DVec3::new(-0.055 + 0.013 * f64::from(i), 0.0, 0.0)).collect();
    tube(obj, world_from_spoon, &path, DVec3::Z, 0.0014, 8, 4.0);
    let bowl = world_from_spoon * DAffine3::from_translation(DVec3::new(0.036, -0.0005, 0.0));
    lathe(
        obj,
        bowl,
        &[[0.0, -0.0025], [0.007, -0.0015], [0.0095, 0.001], [0.0095, 0.001], [0.006, -0.0005], [0.0, -0.001]],
        20,
        4.0,
    );
}

/// A brass shade on a rod above the table.
fn lamp(obj: &mut Obj) {
    obj.object("lamp", "brass");
    let at = DAffine3::from_translation(DVec3::new(0.0, 1.62, 0.0));
    lathe(obj, at, &SHADE, 48, 2.0);
    let rod: Vec<DVec3> = (0..=1).map(|i| DVec3::Y * (0.17 + f64::from(i) * (ROOM_METRES.y - 1.79))).collect();
    tube(obj, at, &rod, DVec3::Z, 0.006, 12, 2.0);
    obj.object("bulb", "porcelain");
    let bulb: Vec<[f64; 2]> = (0..=12)
        .map(|i| {
            let (sin, cos) = (f64::from(i) / 12.0 * TAU / 2.0).sin_cos();
            [if i % 12 == 0 { 0.0 } else { 0.03 * sin }, 0.05 - 0.03 * cos]
        })
        .collect();
    lathe(obj, at, &bulb, 24, 2.0);
}

/// Profiles: (radius, y) in metres, from the middle of the underside around the lip to the middle of the inside.
const TRAY: [[f64; 2]; 9] = [
    [0.0, 0.0],
    [0.20, 0.0],
    [0.215, 0.012],
    [0.217, 0.014],
    [0.215, 0.015],
    [0.212, 0.013],
    [0.198, 0.003],
    [0.198, 0.003],
    [0.0, 0.003],
];
const SAUCER: [[f64; 2]; 12] = [
    [0.0, 0.002],
    [0.030, 0.002],
    [0.031, 0.0],
    [0.035, 0.0],
    [0.038, 0.004],
    [0.060, 0.010],
    [0.074, 0.017],
    [0.075, 0.0185],
    [0.0735, 0.019],
    [0.058, 0.0125],
    [0.032, 0.006],
    [0.0, 0.006],
];
const CUP: [[f64; 2]; 17] = [
    [0.0, 0.002],
    [0.017, 0.002],
    [0.018, 0.0],
    [0.021, 0.0],
    [0.022, 0.004],
    [0.030, 0.014],
    [0.037, 0.030],
    [0.0405, 0.046],
    [0.043, 0.060],
    [0.0425, 0.061],
    [0.0415, 0.060],
    [0.039, 0.047],
    [0.0355, 0.031],
    [0.0285, 0.016],
    [0.020, 0.008],
    [0.010, 0.006],
    [0.0, 0.006],
];
/// The shade opens downwards: from the middle of its inside around the lip to the middle of its top.
const SHADE: [[f64; 2]; 13] = [
    [0.0, 0.158],
    [0.048, 0.151],
    [0.098, 0.116],
    [0.143, 0.067],
    [0.168, 0.01],
    [0.172, 0.006],
    [0.17, 0.01],
    [0.145, 0.07],
    [0.10, 0.12],
    [0.05, 0.155],
    [0.034, 0.165],
    [0.03, 0.176],
    [0.0, 0.178],
];
