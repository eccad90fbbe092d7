//! Tests of `view::headset::held`: where the panel is on the controller, and what points at it.

use super::*;

const HEIGHT: f32 = 1.25 * WIDTH_METRES;

/// A hand half a metre in front of a point of the panel that points straight at it.
fn pointing_at(play_from_panel: &Mat4, at: Vec2) -> Mat4 {
    *play_from_panel * Mat4::from_translation(at.extend(0.5))
}

#[test]
fn the_panel_is_above_the_controller_and_faces_who_holds_it() {
    let device_from_panel = device_from_panel(HEIGHT);
    let corner =
        |x: f32, y: f32| device_from_panel.transform_point3(0.5 * Vec3::new(x * WIDTH_METRES, y * HEIGHT, 0.0));
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let corner = corner(x, y);
        assert!(corner.y >= CLEARANCE_METRES - 1e-6, "through the controller: {corner}");
        assert!(corner.length() < 0.5, "out of reach: {corner}");
    }
    assert!(((corner(1.0, 0.0) - corner(-1.0, 0.0)).length() - WIDTH_METRES).abs() < 1e-6);
    let [right, up, front] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| device_from_panel.transform_vector3(axis));
    assert!(right.abs_diff_eq(Vec3::X, 1e-6), "upright letters: {right}");
    assert!(up.y > 0.5 && up.z < -0.5, "its upper edge is farther away: {up}");
    assert!(front.y > 0.5 && front.z > 0.5, "it faces up and back: {front}");
}

#[test]
fn a_ray_meets_the_panels_front_where_the_hand_points() {
    let panel = Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0)) * Mat4::from_rotation_y(0.7);
    for at in [Vec2::ZERO, Vec2::new(0.1, -0.05), Vec2::new(3.0, 2.0)] {
        let met = hit(&panel, &pointing_at(&panel, at)).expect("a hit");
        assert!(met.abs_diff_eq(at, 1e-5), "{met} for {at}");
    }
    let straight = pointing_at(&panel, Vec2::ZERO);
    // From the left, 45° to its right: as far right as it is away.
    let slanting = hit(&panel, &(straight * Mat4::from_rotation_y(-std::f32::consts::FRAC_PI_4))).expect("a hit");
    assert!(slanting.abs_diff_eq(Vec2::new(0.5, 0.0), 1e-5), "{slanting}");
    let away = straight * Mat4::from_rotation_y(std::f32::consts::PI);
    let along = straight * Mat4::from_rotation_y(std::f32::consts::FRAC_PI_2);
    let from_behind = panel * Mat4::from_rotation_y(std::f32::consts::PI) * Mat4::from_translation(Vec3::Z * 0.5);
    assert_eq!([away, from_behind].map(|hand| hit(&panel, &hand)), [None; 2]);
    assert!(hit(&panel, &along).is_none_or(|at| at.length() > 1e3), "along the panel");
}
