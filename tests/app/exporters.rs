//! Models as programs write them: comments, the order of keys, forms of numbers and habits, and what each is read as.

use pbr_vr::asset::{Report, Storage, TextureOptions};
use pbr_vr::scene::{self, LoadOptions, Scene};

use crate::common::Workshop;

/// What a file is to be read as.
struct Expected<'a> {
    triangles: usize,
    /// Name, base color, metalness, roughness.
    materials: &'a [(&'a str, [f32; 3], f32, f32)],
    /// What each warning starts with.
    warnings: &'a [&'a str],
}

fn read(shop: &Workshop, obj: &str, mtl: &str) -> (Scene, Vec<String>) {
    shop.write("a.mtl", mtl);
    let report = Report::silent();
    let textures = TextureOptions { storage: Storage::Raw, ..TextureOptions::default() };
    let options = LoadOptions { textures, ..LoadOptions::default() };
    let scene = scene::load(&shop.write("a.obj", obj), &options, &report).unwrap();
    (scene, report.warnings().into_iter().filter(|w| !w.contains("no environment")).collect())
}

fn check(shop: &Workshop, obj: &str, mtl: &str, expected: &Expected<'_>) -> Scene {
    let (scene, warnings) = read(shop, obj, mtl);
    assert_eq!(scene.triangles(), expected.triangles);
    assert_eq!(warnings.len(), expected.warnings.len(), "{warnings:#?}");
    for (warning, start) in warnings.iter().zip(expected.warnings) {
        assert!(warning.starts_with(start), "{warning}, not {start}");
    }
    let found: Vec<_> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    let names: Vec<_> = expected.materials.iter().map(|m| m.0).collect();
    assert_eq!(found, names);
    for (material, (name, colour, metallic, roughness)) in scene.materials.iter().zip(expected.materials) {
        let values =
            [&material.base_color_factor.to_array()[..], &[material.metallic_factor, material.roughness_factor]];
        let wanted = [&colour[..], &[*metallic, *roughness]];
        let differ = values.concat().iter().zip(wanted.concat()).any(|(a, b)| (a - b).abs() > 1e-3);
        assert!(!differ, "{name}: {values:?}, not {wanted:?}");
    }
    scene
}

/// A picture that is not of one colour.
fn picture(shop: &Workshop, name: &str) {
    let path = shop.path(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([(x * 30) as u8, (y * 30) as u8, 128])).save(path).unwrap();
}

/// A square of four corners by a program's ways, without normals.
const CORNERS: &str = "v -1.000000 -1.000000 0.000000\nv 1.000000 -1.000000 0.000000\nv 1.000000 1.000000 0.000000\n\
    v -1.000000 1.000000 0.000000\n";
const UVS: &str = "vt 0.000000 0.000000\nvt 1.000000 0.000000\nvt 1.000000 1.000000\nvt 0.000000 1.000000\n";

const BLENDER_MTL: &str = "# Blender 4.2.1 LTS MTL File: 'untitled.blend'\n# www.blender.org\n\nnewmtl Gold\nNs 640.000061\n\
    Ka 1.000000 1.000000 1.000000\nKd 0.800000 0.600000 0.200000\nKs 0.500000 0.500000 0.500000\n\
    Ke 0.000000 0.000000 0.000000\nNi 1.450000\nd 1.000000\nillum 3\n\nnewmtl Wood.001\nNs 250.000000\n\
    Ka 1.000000 1.000000 1.000000\nKs 0.500000 0.500000 0.500000\nKe 2.000000 1.000000 0.500000\nNi 1.500000\n\
    d 0.250000\nillum 4\nmap_Kd textures/wood color.png\nmap_Bump -bm 0.400000 textures/wood_n.png\n";

const BLENDER_OBJ: &str = "# Blender 4.2.1 LTS\n# www.blender.org\nmtllib a.mtl\no Plane\n";

#[test]
fn blender_without_pbr_keys() {
    let shop = Workshop::new();
    picture(&shop, "textures/wood color.png");
    picture(&shop, "textures/wood_n.png");
    let faces = "vn -0.0000 -0.0000 1.0000\ns 0\nusemtl Gold\nf 1/1/1 2/2/1 3/3/1 4/4/1\no Plane.001\ns 1\nusemtl Wood.001\nf 1/1/1 2/2/1 3/3/1\nl 3 4\n";
    let obj = format!("{BLENDER_OBJ}{CORNERS}{UVS}{faces}");
    let expected = Expected {
        triangles: 3,
        materials: &[("Gold", [0.8, 0.6, 0.2], 1.0, 0.2), ("Wood.001", [1.0; 3], 0.0, 1.0)],
        warnings: &[],
    };
    let scene = check(&shop, &obj, BLENDER_MTL, &expected);
    let wood = &scene.materials[1];
    assert!(wood.base_color_map.is_some() && wood.normal_map.is_some());
    // Its map of normals comes with one of roughness.
    assert_eq!(wood.roughness_range, [0.5; 2]);
    assert!(wood.blends && wood.opacity == 0.25 && !scene.materials[0].blends);
    assert_eq!(
        (wood.emissive_factor.to_array(), scene.materials[0].emissive_factor.to_array()),
        ([2.0, 1.0, 0.5], [0.0; 3])
    );
}

#[test]
fn blender_with_pbr_keys() {
    let shop = Workshop::new();
    for name in ["rough.png", "metal.png", "color.png"] {
        picture(&shop, name);
    }
    let mtl = "# Blender 4.2.1 LTS MTL File: 'untitled.blend'\n# www.blender.org\n\nnewmtl Car paint\nNs 360.000031\n\
        Ka 0.000000 0.000000 0.000000\nKd 0.300000 0.000000 0.000000\nKs 0.500000 0.500000 0.500000\n\
        Ke 0.000000 0.000000 0.000000\nNi 1.500000\nd 1.000000\nillum 3\nPr 0.350000\nPm 0.700000\nPs 0.000000\n\
        Pc 0.800000\nPcr 0.030000\naniso 0.000000\nanisor 0.000000\n\nnewmtl maps\nKa 1.000000 1.000000 1.000000\n\
        Ks 0.500000 0.500000 0.500000\nKe 0.000000 0.000000 0.000000\nNi 1.500000\nd 1.000000\nillum 2\nPs 0.000000\n\
        Pc 0.000000\nPcr 0.030000\naniso 0.000000\nanisor 0.000000\nmap_Kd color.png\nmap_Pr rough.png\nmap_Pm metal.png\n";
    let faces = "s 0\nusemtl Car paint\nf 1/1 2/2 3/3\nusemtl maps\nf 1/1 3/3 4/4\n";
    let expected = Expected {
        triangles: 2,
        materials: &[("Car paint", [0.3, 0.0, 0.0], 0.7, 0.35), ("maps", [1.0; 3], 1.0, 1.0)],
        warnings: &[],
    };
    let scene = check(&shop, &format!("{BLENDER_OBJ}{CORNERS}{UVS}{faces}"), mtl, &expected);
    let coats: Vec<_> = scene.materials.iter().map(|m| [m.clearcoat_factor, m.clearcoat_roughness]).collect();
    assert_eq!(coats, [[0.8, 0.03], [0.0, 0.03]]);
    assert!(scene.materials[1].orm_map.is_some());
}

#[test]
fn maya() {
    let shop = Workshop::new();
    picture(&shop, "brick.png");
    let obj = format!(
        "# This file uses centimeters as units for non-parametric coordinates.\n\nmtllib a.mtl\ng default\n{CORNERS}{UVS}\
         vn 0.000000 0.000000 1.000000\nvn 0.000000 0.000000 1.000000\nvn 0.000000 0.000000 1.000000\nvn 0.000000 0.000000 1.000000\n\
         s off\ng pPlane1 group1\nusemtl initialShadingGroup\nf 1/1/1 2/2/2 3/3/3\ns 1\ng pPlane2\nusemtl blinn1SG\n\
         f 1/1/1 3/3/3 4/4/4\ng pPlane3\nusemtl glassSG\nf 1/1/1 2/2/2 3/3/3 4/4/4\n"
    );
    let mtl = "newmtl blinn1SG\nillum 4\nKd 0.00 0.00 0.00\nKa 0.00 0.00 0.00\nTf 1.00 1.00 1.00\n\
        map_Kd E:/projects/wall//sourceimages/brick.png\nNi 1.00\nKs 0.50 0.50 0.50\nNs 18.00\nnewmtl glassSG\nillum 4\n\
        Kd 0.50 0.60 0.70\nKa 0.00 0.00 0.00\nTf 0.20 0.20 0.20\nNi 1.00\nnewmtl initialShadingGroup\nillum 4\n\
        Kd 0.50 0.50 0.50\nKa 0.00 0.00 0.00\nTf 1.00 1.00 1.00\nNi 1.00\n";
    let expected = Expected {
        triangles: 4,
        materials: &[
            ("blinn1SG", [1.0; 3], 0.0, 0.5623),
            ("glassSG", [0.5, 0.6, 0.7], 0.0, 0.5),
            ("initialShadingGroup", [0.5; 3], 0.0, 0.5),
        ],
        warnings: &["a.mtl:6: map_Kd E:/projects/", "a.mtl: material blinn1SG: Kd 0 ", "a.mtl: material glassSG: Tf: "],
    };
    let scene = check(&shop, &obj, mtl, &expected);
    assert!(scene.materials[0].base_color_map.is_some());
}

#[test]
fn studio_max() {
    let shop = Workshop::new();
    picture(&shop, "Wood.png");
    picture(&shop, "maps/wood_bump.png");
    let obj = "# 3ds Max Wavefront OBJ Exporter v0.97b - (c)2007 guruware\r\n# File Created: 05.03.2012 15:02:44\r\n\r\nmtllib a.mtl\r\n\r\n\
        #\r\n# object Box001\r\n#\r\n\r\nv  -10.0000 0.0000 10.0000\r\nv  10.0000 0.0000 10.0000\r\nv  10.0000 20.0000 10.0000\r\n\
        v  -10.0000 20.0000 10.0000\r\n# 4 vertices\r\n\r\nvn 0.0000 -0.0000 1.0000\r\n# 1 vertex normals\r\n\r\nvt 0.0000 0.0000 0.0000\r\n\
        vt 1.0000 0.0000 0.0000\r\nvt 1.0000 1.0000 0.0000\r\nvt 0.0000 1.0000 0.0000\r\n# 4 texture coords\r\n\r\ng Box001\r\n\
        usemtl 01___Default\r\ns 2\r\nf 1/1/1 2/2/1 3/3/1 4/4/1 \r\n# 1 polygons\r\n\r\ng Box002\r\nusemtl wire_088144225\r\ns 4\r\n\
        f 1/1/1 2/2/1 3/3/1 \r\n# 1 faces\r\n\r\n";
    let mtl = "# 3ds Max Wavefront OBJ Exporter v0.97b - (c)2007 guruware\r\n# File Created: 05.03.2012 15:02:44\r\n\r\n\
        newmtl wire_088144225\r\n\tNs 32\r\n\td 1\r\n\tTr 0\r\n\tTf 1 1 1\r\n\tillum 2\r\n\tKa 0.3451 0.5647 0.8824\r\n\
        \tKd 0.3451 0.5647 0.8824\r\n\tKs 0.3500 0.3500 0.3500\r\n\r\nnewmtl 01___Default\r\n\tNs 10.0000\r\n\tNi 1.5000\r\n\
        \td 1.0000\r\n\tTr 0.0000\r\n\tTf 1.0000 1.0000 1.0000 \r\n\tillum 2\r\n\tKa 0.5880 0.5880 0.5880\r\n\
        \tKd 0.5880 0.5880 0.5880\r\n\tKs 0.0000 0.0000 0.0000\r\n\tKe 0.0000 0.0000 0.0000\r\n\
        \tmap_Ka C:\\Users\\Some One\\Wood.png\r\n\tmap_Kd C:\\Users\\Some One\\Wood.png\r\n\tmap_bump maps\\wood_bump.png\r\n\
        \tbump maps\\wood_bump.png\r\n";
    let expected = Expected {
        triangles: 3,
        materials: &[("wire_088144225", [0.3451, 0.5647, 0.8824], 0.0, 0.4925), ("01___Default", [0.588; 3], 0.0, 1.0)],
        warnings: &["a.mtl:26: map_Kd C:\\Users\\Some One\\Wood.png: found as Wood.png"],
    };
    let scene = check(&shop, obj, mtl, &expected);
    let wood = &scene.materials[1];
    // The ambient picture repeats the diffuse one and is no occlusion.
    assert!(wood.base_color_map.is_some() && wood.normal_map.is_some() && !wood.occludes);
}

/// Old versions of that program wrote opacity into `Tr`.
#[test]
fn transparency_of_old_exporters() {
    let shop = Workshop::new();
    let mtl = "newmtl glass\n\tKd 0.5 0.5 0.5\n\tTr 0.6000\nnewmtl both\n\tKd 0.5 0.5 0.5\n\tTr 0.0000\n\td 1.0000\n\
        newmtl opaque\n\tKd 0.5 0.5 0.5\n\tTr 1.0000\n\td 1.0000\n";
    let faces = "usemtl glass\nf 1 2 3\nusemtl both\nf 1 3 4\nusemtl opaque\nf 2 3 4\n";
    let grey = [0.5; 3];
    let expected = Expected {
        triangles: 3,
        materials: &[("glass", grey, 0.0, 0.5), ("both", grey, 0.0, 0.5), ("opaque", grey, 0.0, 0.5)],
        warnings: &[],
    };
    let scene = check(&shop, &format!("mtllib a.mtl\n{CORNERS}{faces}"), mtl, &expected);
    let opacities: Vec<_> = scene.materials.iter().map(|m| (m.blends, (100.0 * m.opacity).round())).collect();
    assert_eq!(opacities, [(true, 40.0), (false, 100.0), (false, 100.0)]);
}

#[test]
fn substance_painter() {
    let shop = Workshop::new();
    for map in ["BaseColor", "Roughness", "Metallic", "Normal", "AO"] {
        picture(&shop, &format!("body_{map}.png"));
    }
    let obj = format!("mtllib ./a.mtl\no body\n{CORNERS}{UVS}vn 0 0 1\nusemtl body\nf 1/1/1 2/2/1 3/3/1 4/4/1\n");
    let mtl = "newmtl body\nKd 1 1 1\nKs 0.04 0.04 0.04\nillum 2\nmap_Kd body_BaseColor.png\nmap_Pr body_Roughness.png\n\
        map_Pm body_Metallic.png\nnorm body_Normal.png\nmap_AO body_AO.png\nmap_Ke body_Emissive.png\n";
    let expected = Expected {
        triangles: 2,
        materials: &[("body", [1.0; 3], 1.0, 1.0)],
        warnings: &["a.mtl:10: map_Ke body_Emissive.png: "],
    };
    let scene = check(&shop, &obj, mtl, &expected);
    let body = &scene.materials[0];
    assert!(body.base_color_map.is_some() && body.normal_map.is_some() && body.orm_map.is_some() && body.occludes);
    assert_eq!(body.emissive_factor.to_array(), [0.0; 3]);
}

#[test]
fn zbrush() {
    let shop = Workshop::new();
    let obj = format!(
        "#File Exported by ZBrush version 2021.6\n#www.zbrush.com\n#Vertex Count 4\n#UV Vertex Count 4\n#Face Count 1\n\
         #Auto scale x=0.010000 y=0.010000 z=0.010000\n{CORNERS}#The following MRGB block contains ZBrush Vertex Color\n\
         #MRGB ff808080ffa0a0a0ff808080ffffffff\n#End of MRGB block\n{UVS}g default\ngroup 21542\nf 1/1 2/2 3/3 4/4\n"
    );
    // No library, and no material.
    let (scene, warnings) = read(&shop, &obj, "");
    assert_eq!((scene.triangles(), scene.materials.len()), (2, 1));
    let others: Vec<_> = warnings.iter().filter(|w| !w.contains("usemtl") && !w.contains("colour")).collect();
    assert!(others.is_empty() && warnings.iter().any(|w| w.contains("usemtl")), "{warnings:?}");
}

#[test]
fn meshroom() {
    let shop = Workshop::new();
    picture(&shop, "texture_1001.png");
    let obj = "# \n# Wavefront OBJ file\n# Created with AliceVision\n# \nmtllib a.mtl\n\ng TexturedMesh\n\
        v 0.0731416 -0.250843 1.38155e+00\nv 1.07e-1 -2.5e-01 1.38155\nv 0.107 -0.15 1.38155\n\nvt 0.1 0.2\nvt 0.9 0.2\nvt 0.9 0.8\n\n\
        usemtl TextureAtlas_1001\nf 1/1 2/2 3/3\n";
    let mtl = "# \n# Wavefront material file\n# Created with AliceVision\n# \n\nnewmtl TextureAtlas_1001\nKa  0.6 0.6 0.6\n\
        Kd  0.6 0.6 0.6\nKs  0.0 0.0 0.0\nd  1.0\nNs  0.0\nillum 2\nmap_Kd texture_1001.png\n";
    let expected = Expected { triangles: 1, materials: &[("TextureAtlas_1001", [0.6; 3], 0.0, 1.0)], warnings: &[] };
    assert!(check(&shop, obj, mtl, &expected).materials[0].base_color_map.is_some());
}

#[test]
fn rhino() {
    let shop = Workshop::new();
    let obj = "# Rhino\r\n\r\nmtllib a.mtl\r\ng object_1\r\nusemtl diffuse_Chrome\r\nv -0.5000000000000000 0.0000000000000000 0\r\n\
        v 0.5000000000000000 0.0000000000000000 \\\r\n0\r\nv 0.5 1 0\r\nv -0.5 1 0\r\nvn 0 0 1\r\nvn 0 0 1\r\nvn 0 0 1\r\nvn 0 0 1\r\n\
        f 1//1 2//2 3//3 \\\r\n4//4\r\ncstype bspline\r\ndeg 3\r\nend\r\n";
    let mtl = "# Rhino\r\nnewmtl diffuse_Chrome\r\nKa 0.0000 0.0000 0.0000\r\nKd 0.9000 0.9000 0.9000\r\nKs 1.0000 1.0000 1.0000\r\n\
        Tf 0.0000 0.0000 0.0000\r\nd 1.0000\r\nNs 255.0000\r\n";
    let expected = Expected { triangles: 2, materials: &[("diffuse_Chrome", [0.9; 3], 0.0, 0.297)], warnings: &[] };
    check(&shop, obj, mtl, &expected);
}

#[test]
fn computer_aided_design() {
    let shop = Workshop::new();
    // Numbered from the end, far from the origin, with a face of more than four corners.
    let obj = "# WaveFront *.obj file (generated by Autodesk ATF)\n\nmtllib a.mtl\n\ng Body1:1\n\nv 500000.0 0.0 0.0\nv 500002.0 0.0 0.0\n\
        v 500003.0 1.0 0.0\nv 500001.0 2.0 0.0\nv 499999.0 1.0 0.0\nvn 0 0 1\n\nusemtl Steel_-_Satin\nf -5//-1 -4//-1 -3//-1 -2//-1 -1//-1\n\
        usemtl Missing\nf 1 2 3\n";
    let mtl = "newmtl Steel_-_Satin\nKa 0.627451 0.627451 0.627451\nKd 0.627451 0.627451 0.627451\nKs 0.1 0.1 0.1\nNs 200\nillum 2\nTr 0\n";
    let expected = Expected {
        triangles: 4,
        materials: &[("Steel_-_Satin", [0.627_451; 3], 0.0, 0.3154), ("default", [0.8; 3], 0.0, 0.5)],
        warnings: &["a.obj:16: usemtl Missing: ", "a.obj: far from the origin"],
    };
    check(&shop, obj, mtl, &expected);
}
