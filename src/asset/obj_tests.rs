//! Tests of reading OBJ models: what is read, what is repaired, what is rejected.

use super::*;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n";

fn loaded(obj: impl AsRef<[u8]>, mtl: &str) -> (Result<Model>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, obj).unwrap();
    std::fs::write(folder.path().join("My Lib.mtl"), mtl).unwrap();
    let report = Report::silent();
    (load(&path, &report), report.warnings())
}

fn good(obj: impl AsRef<[u8]>) -> Model {
    loaded(obj, "").0.unwrap()
}

fn problem(obj: impl AsRef<[u8]>) -> String {
    let error = loaded(obj, "").0.expect_err("it should be refused");
    assert!(matches!(error, Error::Broken { .. }), "{error}");
    error.to_string()
}

fn sizes(model: &Model) -> Vec<usize> {
    model.submeshes.iter().map(|submesh| submesh.corners.len() / 3).collect()
}

#[test]
fn objects_and_materials_make_submeshes() {
    let obj = format!(
        "mtllib My Lib.mtl\no one\nusemtl red\n{TRIANGLE}f 1/1/1 2/2/1 3/3/1\nusemtl blue\nf 1/1/1 2/2/1 3/3/1\ng two\nf 3/1/1 2/2/1 1/3/1"
    );
    let (model, warnings) = loaded(obj, "newmtl red\nnewmtl blue\n");
    let model = model.unwrap();
    assert_eq!(warnings, [""; 0]);
    let got: Vec<_> = model.submeshes.iter().map(|p| (p.name.as_str(), p.material)).collect();
    assert_eq!(got, [("one", Some(0)), ("one", Some(1)), ("two", Some(1))]);
    let corner = model.submeshes[0].corners[1];
    assert_eq!(corner, Corner { position: Vec3::X, normal: Vec3::Z, uv: Vec2::X });
}

#[test]
fn a_library_may_be_named_late_in_any_case_or_not_at_all() {
    let faces = format!("usemtl red\n{TRIANGLE}f 1/1/1 2/2/1 3/3/1\n");
    let (model, warnings) = loaded(format!("{faces}mtllib my lib.MTL\n"), "newmtl red\n");
    assert_eq!(model.unwrap().submeshes[0].material, Some(0));
    // Windows file names ignore case anyway.
    let expected = ["a.obj:10: mtllib my lib.MTL: found as My Lib.mtl"];
    assert_eq!(warnings, expected[usize::from(cfg!(windows))..]);
    let (model, warnings) = loaded(format!("mtllib no.mtl\n{faces}"), "");
    assert_eq!(model.unwrap().submeshes[0].material, None);
    assert_eq!(warnings.len(), 2);
    assert!(
        warnings[0].contains("mtllib no.mtl: file not found") && warnings[1].contains("usemtl red: no such material")
    );
    // One line for what cannot be read, however many materials it has.
    let (model, warnings) =
        loaded(format!("mtllib My Lib.mtl\n{faces}usemtl blue\nf 1/1/1 2/2/1 3/3/1\n"), "n\0e\0w\0");
    assert!(model.is_ok() && warnings.len() == 1 && warnings[0].contains("mtllib My Lib.mtl"), "{warnings:?}");
}

#[test]
fn polygons_become_fans_and_lines_nothing() {
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 0 0\nf 1 2 3 4 5\nf -5 -4 -3 -2\nl 1 2 3\np 1\nf 1 2\n";
    assert_eq!(sizes(&good(obj)), [5]);
}

#[test]
fn ends_of_lines_tabs_comments_and_continuations() {
    let lines = ["# c", "\tv 0 0 0 # origin", "v\t1 0 0", "  v 0 1 0", "f 1 2 \\", " 3", "s off", "usemtl\tx"];
    for end in ["\n", "\r\n", "\r"] {
        assert_eq!(sizes(&good(lines.join(end))), [1], "{end:?}");
    }
}

#[test]
fn names_that_are_not_utf8() {
    let obj = [b"g Gr\xfc\xdfe\nusemtl st\xe4in\n", TRIANGLE.as_bytes(), b"f 1 2 3\n# \xff"].concat();
    assert_eq!(good(obj).submeshes[0].name, "Gr\u{fffd}\u{fffd}e");
}

#[test]
fn missing_and_unusable_normals_are_computed() {
    for (normal, face) in [("", "f 1 2 3"), ("vn 0 0 0", "f 1//1 2//1 3//1"), ("vn nan 0 1", "f 1//1 2//1 3//1")] {
        let model = good(format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{normal}\n{face}"));
        assert!(model.submeshes[0].corners.iter().all(|c| c.normal == Vec3::Z), "{normal}");
    }
    let tiny = good("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1e-23 0 0\nvn 1e20 0 0\nf 1//1 2//2 3//1");
    assert!(tiny.submeshes[0].corners.iter().all(|c| c.normal == Vec3::X), "a direction of any length counts");
}

#[test]
fn corners_that_differ_in_kind() {
    let (model, warnings) = loaded(format!("{TRIANGLE}f 1/1/1 2/2 3/3/1\nf 1/1/1 2//1 3/3/1"), "");
    let submesh = &model.unwrap().submeshes[0];
    assert!(!submesh.has_uvs && submesh.corners.iter().all(|c| c.normal == Vec3::Z && c.uv == Vec2::ZERO));
    assert_eq!(warnings.iter().filter(|w| w.contains("only some corners")).count(), 2, "{warnings:?}");
}

#[test]
fn unusable_texture_coordinates_become_zero() {
    let (model, warnings) = loaded("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt inf 0\nvt 1 1e9\nvt 0.5 1\nf 1/1 2/2 3/3", "");
    let uvs: Vec<_> = model.unwrap().submeshes[0].corners.iter().map(|c| c.uv).collect();
    assert_eq!(uvs, [Vec2::ZERO, Vec2::X, Vec2::new(0.5, 1.0)]);
    assert!(warnings.iter().any(|w| w.contains("texture coordinates beyond")), "{warnings:?}");
}

#[test]
fn utf16_is_rejected_with_a_remedy() {
    let text: Vec<u8> = "v 0 0 0\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let error = problem([b"\xff\xfe", &text[..]].concat());
    assert!(error.contains("UTF-16 text; save it again as UTF-8"), "{error}");
}

#[test]
fn errors_name_the_line() {
    for (text, expected) in [
        ("", "no triangles"),
        ("v 0 0 0\nf 1 2\n", "no triangles"),
        ("v 0 0 0\nv 1 0\n", "line 2"),
        ("v 0 0 x\n", "line 1"),
        ("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3", "line 2"),
        ("v 0 0 0\nv 1 0 0\nv 0 1e30 0\nf 1 2 3", "line 3"),
        ("v 0 0 0\n\n# c\nf 1 2 x\n", "line 4"),
        ("v 0 0 0\nf 1 1 1\nf 1 1 2\no b\nf 1 1 1", "line 3: index 2"),
        ("v 0 0 0\nf 1 1 0\n", "line 2: index 0"),
        ("v 0 0 0\nvt 0 0\nf 1/1 1/2 1/1\n", "line 3: index 2"),
        ("v 0 0 0\nf 1 -2 1\n", "line 2: index -2"),
        ("v 0 0 0\nvt 0 0\nvn 0 0 1\nf 1/1/9223372036854775807 1/1/1 1/1/1\n", "line 4: index 9223372036854775807"),
        ("v 0 0 0\nf\n", "no triangles"),
        ("v 0 0 0 0\n", "line 1: scaling"),
    ] {
        let got = problem(text);
        assert!(got.contains(expected), "{text:?}: {got}");
    }
}

#[test]
fn too_many_triangles_are_rejected_before_they_are_allocated() {
    let polygon = format!("v 0 0 0\nf{}\n", " 1".repeat(1 << 20)).replace("f 1", "f 1 1 1");
    let obj = polygon + &format!("f{}\n", " 1".repeat(1 << 20)).repeat(16);
    assert!(matches!(loaded(obj, "").0, Err(Error::TooLarge { .. })));
}

#[test]
fn a_byte_order_mark_hides_no_line_and_the_last_may_end_in_a_continuation() {
    let (model, warnings) =
        loaded(format!("\u{feff}mtllib My Lib.mtl\nusemtl red\n{TRIANGLE}f 1 2 3\nf 3 2 1\\"), "newmtl red\n");
    let model = model.unwrap();
    assert_eq!((warnings.len(), sizes(&model), model.submeshes[0].material), (0, vec![2], Some(0)), "{warnings:?}");
}

#[test]
fn colours_of_positions_are_read_and_absent_ones_are_white() {
    let white = "v 0 0 0 1 1 1\nv 1 0 0 1.0 1 1\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(loaded(format!("usemtl\n{white}"), "").1, ["a.obj:1: usemtl : no such material; using the default one"]);
    let (model, warnings) = loaded(format!("{white}v 0 0 1 0.5 1 0\nv 0 1 1 1 0 0 0\nv 1 1 1 0 0 0\nf 4 5 6"), "");
    assert_eq!(sizes(&model.unwrap()), [2]);
    assert!(warnings.iter().all(|w| !w.contains("colours")), "{warnings:?}");
    assert!(good(white).submeshes.iter().all(|submesh| submesh.extras.is_empty()), "white is no colour");
    let colours = |text: &str| -> Vec<[f32; 4]> {
        good(text).submeshes[0]
            .extras
            .iter()
            .map(|extra| extra.colour.to_array().map(|c| (c * 100.0).round()))
            .collect()
    };
    let mixed = "v 0 0 0\nv 1 0 0 0.5 1 0\nv 0 1 0 1 0 0 0\nf 1 2 3\n";
    assert_eq!(
        colours(mixed),
        [[100.0; 4], [21.0, 100.0, 0.0, 100.0], [0.0, 0.0, 0.0, 100.0]],
        "sRGB; one has a weight"
    );
    let bytes = "v 0 0 0 255 0 0\nv 1 0 0 0 255 0\nv 0 1 0 0 0 51\nf 1 2 3\n";
    assert_eq!(colours(bytes)[2], [0.0, 0.0, 3.0, 100.0], "of 255");
    let bright = "v 0 0 0 1.08 0.5 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(colours(bright)[0], [100.0, 21.0, 0.0, 100.0], "clamped");
}

#[test]
fn faces_turn_about_their_normals() {
    let model = good(format!("{TRIANGLE}vn 0 0 -1\nf 1//1 2//1 3//1\nf 1//2 2//2 3//2\nf 1 2 3\n"));
    let turns: Vec<f32> = model.submeshes[0]
        .corners
        .chunks(3)
        .map(|t| (t[1].position - t[0].position).cross(t[2].position - t[0].position).z)
        .collect();
    // Where some corners have none, all are computed.
    assert_eq!(turns, [1.0, 1.0, 1.0]);
    let model = good(format!("{TRIANGLE}vn 0 0 -1\nf 1//1 2//1 3//1\nf 1//2 2//2 3//2\n"));
    for triangle in model.submeshes[0].corners.chunks(3) {
        let area = (triangle[1].position - triangle[0].position).cross(triangle[2].position - triangle[0].position);
        assert!(area.dot(triangle[0].normal) > 0.0, "{triangle:?}");
    }
    assert_eq!(model.submeshes[0].corners[3].normal, Vec3::NEG_Z);
}

#[test]
fn concave_polygons_are_not_covered_twice() {
    let model = good("v 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.5 1 0\nf 1 2 3 4\n");
    let area = |t: &[Corner]| 0.5 * (t[1].position - t[0].position).cross(t[2].position - t[0].position).length();
    assert_eq!(model.submeshes[0].corners.chunks(3).map(area).sum::<f32>(), 1.5);
}

/// Coordinates of a national grid in millimetres.
#[test]
fn what_is_far_from_the_origin_is_moved_there_before_digits_are_lost() {
    let far = |x: f64, y: f64| format!("v {} {} 0.25\n", 2_500_000_123.0 + x, 1_200_000_456.0 + y);
    let faces = "f 1 2 3\n";
    let (model, warnings) = loaded([far(0.0, 0.0), far(1000.25, 0.0), far(0.0, 1000.0), faces.into()].concat(), "");
    let corners = &model.unwrap().submeshes[0].corners;
    assert_eq!(corners[1].position - corners[0].position, Vec3::new(1000.25, 0.0, 0.0));
    assert_eq!(warnings[1], "a.obj: far from the origin for its size; moved by -2500000623 -1200000956 -0");
    // A cup in its room stays where it is.
    let (model, warnings) = loaded("v 90 1 20\nv 90.1 1 20\nv 90 1.1 20\nf 1 2 3\n", "");
    assert_eq!((model.unwrap().submeshes[0].corners[0].position, warnings.len()), (Vec3::new(90.0, 1.0, 20.0), 1));
}

#[test]
fn smoothing_groups_are_heeded_where_the_file_has_some() {
    let roof = "v 0 0 0\nv 0 0 1\nv 1 0.1 0\nv -1 0.1 0\n";
    let normals = |faces: &str| {
        let corners = good(format!("{roof}{faces}")).submeshes.into_iter().flat_map(|submesh| submesh.corners);
        let at_origin: Vec<Vec3> = corners.filter(|c| c.position == Vec3::ZERO).map(|c| c.normal).collect();
        (at_origin[0] - at_origin[1]).length()
    };
    assert!(normals("f 1 2 3\nf 1 4 2\n") < 1e-6, "without groups they are smooth");
    assert!(normals("s 1\nf 1 2 3\no other\nf 1 4 2\n") < 1e-6);
    assert!(normals("s off\nf 1 2 3\nf 1 4 2\n") > 0.1);
    assert!(normals("s 1\nf 1 2 3\ns 2\nf 1 4 2\n") > 0.1);
    assert!(normals("f 1 2 3\nf 3 1\ns 0\nf 1 4 2\n") > 0.1, "lines count for nothing");
}

#[test]
fn a_comment_ends_with_its_line() {
    assert_eq!(sizes(&good(format!("# C:\\models\\\n{TRIANGLE}f 1 2 3\n"))), [1]);
}
