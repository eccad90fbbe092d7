//! `view::headset::rig`: what stays where it was, and what goes where it should.

use super::*;

/// A head or hand, looking along `yaw_degrees` and up by `pitch_degrees`.
fn pose(position: Vec3, yaw_degrees: f32, pitch_degrees: f32) -> Mat4 {
    let turn = Quat::from_rotation_y(yaw_degrees.to_radians()) * Quat::from_rotation_x(pitch_degrees.to_radians());
    Mat4::from_rotation_translation(turn, position)
}

fn head() -> Mat4 {
    pose(Vec3::new(0.7, 1.65, -0.4), 50.0, -20.0)
}

fn camera(position: Vec3, target: Vec3) -> Camera {
    Camera { name: "test".into(), position, target, vertical_fov_degrees: 40.0 }
}

fn head_world(rig: &Rig) -> Mat4 {
    rig.world_from_play() * head()
}

#[test]
fn in_a_room_the_user_stands_on_its_floor_at_the_camera() {
    let camera = camera(Vec3::new(3.0, 1.6, -2.0), Vec3::new(0.0, 1.0, -2.5));
    let rig = Rig::start(&camera, 0.1, &head());
    let at = head_world(&rig);
    assert!((at.w_axis.truncate() - Vec3::new(3.0, 0.1 + 1.65, -2.0)).length() < 1e-5);
    assert_eq!(rig.floor(), 0.1);
    let (ours, its) = (-at.z_axis.truncate().with_y(0.0), (camera.target - camera.position).with_y(0.0));
    assert!(ours.normalize().dot(its.normalize()) > 1.0 - 1e-5);
}

#[test]
fn before_a_small_object_or_high_above_the_eyes_are_where_the_camera_is() {
    for position in [Vec3::new(0.0, 0.22, 0.52), Vec3::new(5.0, 30.0, 9.0), Vec3::new(0.0, -4.0, 1.0)] {
        let rig = Rig::start(&camera(position, Vec3::ZERO), 0.0, &head());
        assert!((head_world(&rig).w_axis.truncate() - position).length() < 1e-5);
    }
}

#[test]
fn the_seated_position_puts_the_head_at_the_camera_and_back_there_again() {
    let camera = camera(Vec3::new(0.85, 1.35, 1.35), Vec3::new(0.0, 0.85, -0.1));
    let mut rig = Rig::seated(&camera, &head());
    rig.snap_turn(2, &head());
    rig.teleport(Vec3::new(4.0, 0.0, 4.0), &head());
    let again = Rig::seated(&camera, &head());
    assert!((head_world(&again).w_axis.truncate() - camera.position).length() < 1e-5);
    assert_ne!(rig, again);
}

#[test]
fn a_camera_that_looks_straight_down_gives_a_direction_all_the_same() {
    let rig = Rig::seated(&camera(Vec3::Y, Vec3::ZERO), &pose(Vec3::Y, 0.0, -90.0));
    assert!(rig.yaw.is_finite() && rig.world_from_play().is_finite());
}

#[test]
fn a_snap_turn_keeps_the_head_where_it_is_and_turns_it_by_thirty_degrees() {
    let mut rig = Rig { origin_world: Vec3::new(2.0, 0.3, -7.0), yaw: 1.0 };
    let start = head_world(&rig);
    for turn in 1..=12 {
        let before = head_world(&rig);
        rig.snap_turn(1, &head());
        let after = head_world(&rig);
        assert!((after.w_axis - before.w_axis).length() < 1e-5, "turn {turn}");
        let cosine = before.x_axis.truncate().normalize().dot(after.x_axis.truncate());
        assert!((cosine - SNAP_DEGREES.to_radians().cos()).abs() < 1e-5);
        // To the right: what was on the right is now nearer to the front.
        assert!((-after.z_axis.truncate()).dot(before.x_axis.truncate()) > 0.4);
        assert_eq!(rig.floor(), 0.3);
    }
    assert!(head_world(&rig).abs_diff_eq(start, 1e-4), "twelve turns go round");
    rig.snap_turn(-1, &head());
    rig.snap_turn(1, &head());
    assert!(head_world(&rig).abs_diff_eq(start, 1e-4));
}

#[test]
fn a_teleport_puts_the_floor_under_the_head_at_the_landing_and_turns_nothing() {
    let mut rig = Rig { origin_world: Vec3::new(2.0, 0.3, -7.0), yaw: 1.0 };
    let before = head_world(&rig);
    rig.teleport(Vec3::new(-1.0, 0.5, 4.0), &head());
    let after = head_world(&rig);
    assert!((after.w_axis.truncate() - Vec3::new(-1.0, 0.5 + 1.65, 4.0)).length() < 1e-5);
    assert_eq!((after.x_axis, after.y_axis), (before.x_axis, before.y_axis));
    assert!((rig.floor() - 0.5).abs() < 1e-6);
}

#[test]
fn play_space_is_never_tilted_or_scaled() {
    let matrix = Rig { origin_world: Vec3::ONE, yaw: 2.5 }.world_from_play();
    assert!((matrix.y_axis.truncate() - Vec3::Y).length() < 1e-6);
    assert!((matrix.determinant() - 1.0).abs() < 1e-5);
}

#[test]
fn the_arc_is_a_parabola_that_ends_on_the_floor() {
    for floor in [0.0, 0.25, -2.0] {
        let arc = teleport_arc(&pose(Vec3::new(1.0, floor + 1.2, 2.0), -30.0, 20.0), floor);
        let landing = arc.landing.expect("a landing");
        assert!((arc.points[ARC_POINTS - 1] - landing).length() < 1e-4 && landing.y == floor);
        assert_eq!(arc.points[0], Vec3::new(1.0, floor + 1.2, 2.0));
        // Equal steps of time: second differences are the gravity's, and sideways there are none.
        let second = |i: usize| arc.points[i + 1] - 2.0 * arc.points[i] + arc.points[i - 1];
        for i in 2..ARC_POINTS - 1 {
            assert!((second(i) - second(1)).length() < 1e-4 && second(i).with_y(0.0).length() < 1e-4);
        }
        assert!(second(1).y < 0.0);
        let forward = (landing - arc.points[0]).with_y(0.0).normalize();
        assert!((forward - Vec3::new(0.5, 0.0, -0.866_025_4)).length() < 1e-4);
    }
}

#[test]
fn steep_far_and_hopeless_arcs_land_nowhere() {
    let hand = |height, pitch| pose(Vec3::new(0.0, height, 0.0), 0.0, pitch);
    assert!(teleport_arc(&hand(1.2, 45.0), 0.0).landing.is_some());
    assert!(teleport_arc(&hand(1.2, -90.0), 0.0).landing.is_some());
    assert_eq!(teleport_arc(&hand(1.2, 80.0), 0.0).landing, None, "steep");
    assert_eq!(teleport_arc(&hand(12.0, 20.0), 0.0).landing, None, "far");
    assert_eq!(teleport_arc(&hand(-9.0, 20.0), 0.0).landing, None, "under the floor");
    assert_eq!(teleport_arc(&hand(1000.0, 0.0), 0.0).landing, None, "in the sky");
    assert!(teleport_arc(&Mat4::ZERO, 0.0).points.iter().all(|p| p.is_finite()));
}

#[test]
fn a_blink_is_dark_when_it_moves_and_moves_once() {
    for frame in [1.0 / 90.0, 1.0 / 45.0, 0.5] {
        let mut fade = TeleportFade::default();
        assert_eq!(fade.step(frame), (0.0, None), "none was begun");
        fade.begin(Vec3::X);
        let steps: Vec<_> = (0..40).map(|_| fade.step(frame)).collect();
        let moves: Vec<_> = steps.iter().filter(|(_, to)| to.is_some()).collect();
        assert_eq!(moves, [&(1.0, Some(Vec3::X))], "{frame}");
        assert_eq!(steps[39], (0.0, None));
        assert!(steps.iter().all(|(fade, _)| (0.0..=1.0).contains(fade)));
    }
}

#[test]
fn a_second_teleport_while_dark_replaces_the_first() {
    let mut fade = TeleportFade::default();
    fade.begin(Vec3::X);
    assert_eq!(fade.step(0.05).1, None);
    fade.begin(Vec3::Z);
    let moves: Vec<Vec3> = (0..40).filter_map(|_| fade.step(0.02).1).collect();
    assert_eq!(moves, [Vec3::Z]);
}

#[test]
fn grabbed_models_follow_the_hand_and_stay_rigid() {
    let start = pose(Vec3::new(0.0, 1.0, -0.5), 30.0, 0.0);
    let hand = pose(Vec3::new(0.2, 1.1, -0.3), 10.0, 5.0);
    let grab = Grab::begin(&hand, &start);
    assert!(grab.models(&hand).abs_diff_eq(start, 1e-5), "taking hold moves nothing");
    let by = Vec3::new(0.3, -0.2, 0.1);
    let moved = grab.models(&(Mat4::from_translation(by) * hand));
    assert!(moved.abs_diff_eq(Mat4::from_translation(by) * start, 1e-5));
    let mut models = start;
    for i in 0..2000u16 {
        let angle = f32::from(i);
        let grab = Grab::begin(&pose(Vec3::X, angle, 0.3 * angle), &models);
        models = grab.models(&pose(Vec3::X, angle + 17.0, 0.3 * angle - 5.0));
    }
    let gram = models.transpose() * models;
    let off = (0..3).map(|i| (gram.col(i).truncate() - Mat4::IDENTITY.col(i).truncate()).length()).sum::<f32>();
    assert!(off < 1e-4, "{gram}");
}

#[test]
fn the_turntable_keeps_its_centre() {
    let models = pose(Vec3::new(1.0, 2.0, 3.0), 20.0, 0.0);
    let centre = Vec3::new(0.5, 0.0, -1.0);
    let turned = turned_models(&models, centre, 90.0);
    let local = models.inverse().transform_point3(centre);
    assert!((turned.transform_point3(local) - centre).length() < 1e-5);
    let x = turned.transform_vector3(models.inverse().transform_vector3(Vec3::X));
    assert!((x - Vec3::NEG_Z).length() < 1e-5);
}

#[test]
fn a_teapot_is_an_object_and_a_room_is_not() {
    let cube = |half: f32| Bounds { min: Vec3::splat(-half), max: Vec3::splat(half) };
    assert!(is_object(cube(0.2)) && !is_object(cube(3.0)) && !is_object(Bounds::EMPTY));
}
