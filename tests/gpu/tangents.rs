//! The Khronos normal and tangent test models: normal-mapped squares, also mirrored ones, must look like real bowls.

use crate::common::{PictureOptions, Workshop, pixel, scenes};
use pbr_vr::asset::picture::Picture;
use pbr_vr::render::Shading;

#[test]
fn normal_mapped_cells_look_like_real_geometry() {
    let Some(folder) = scenes("the normal and tangent test models") else { return };
    let shop = Workshop::new();
    shop.panorama("sky.exr", 16, |_| [0.0; 3]);
    for (name, file, bowls) in [
        ("NormalTangentTest", "obj/NormalTangentTest.obj", 30),
        ("NormalTangentMirrorTest", "obj/NormalTangentMirrorTest.obj", 40),
        ("NormalTangentTest", "NormalTangentTest.gltf", 30),
        ("NormalTangentMirrorTest", "NormalTangentMirrorTest.gltf", 40),
    ] {
        let model = folder.join("gltf-targets").join(name).join(file);
        let text = format!(
            "environment = {{ panorama = \"sky.exr\" }}\n[[model]]\nfile = {:?}\n\
             [[camera]]\nname = \"front\"\nposition = [0, 0, 30]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 5.5\n",
            model.display().to_string()
        );
        let scene = shop.write("cells.toml", &text);
        let options = PictureOptions { shading: Shading::Normal, size: [920, 868], ..PictureOptions::default() };
        let picture = &shop.render(&scene, &options)[0];
        let found = patches(picture);
        assert_eq!(found.len(), bowls, "{file}");
        for patch in &found {
            let (across, down) = patch.agreement(picture);
            // 1 is a perfect sphere; an axis the wrong way round is near −1, swapped axes near 0.
            assert!(
                across > 0.9 && down > 0.9,
                "{file}, bowl at {:?}: {across:.3} across, {down:.3} down",
                patch.centre()
            );
        }
    }
}

/// Neighbouring pixels whose normals lean.
struct Patch(Vec<(u32, u32)>);

impl Patch {
    fn centre(&self) -> (f64, f64) {
        let sum = self.0.iter().fold((0.0, 0.0), |(x, y), p| (x + f64::from(p.0), y + f64::from(p.1)));
        (sum.0 / self.0.len() as f64, sum.1 / self.0.len() as f64)
    }

    /// Correlation of n.x with the way right of the centre, and of n.y with the way up.
    fn agreement(&self, picture: &Picture) -> (f64, f64) {
        let (cx, cy) = self.centre();
        let pairs = |axis: usize| {
            self.0.iter().map(move |&(x, y)| {
                let way = if axis == 0 { f64::from(x) - cx } else { cy - f64::from(y) };
                (way, pixel(picture, x, y)[axis] - 0.5)
            })
        };
        let correlation = |axis: usize| {
            let (ab, aa, bb) =
                pairs(axis).fold((0.0, 0.0, 0.0), |(ab, aa, bb), (a, b)| (ab + a * b, aa + a * a, bb + b * b));
            ab / (aa * bb).sqrt()
        };
        (correlation(0), correlation(1))
    }
}

fn patches(picture: &Picture) -> Vec<Patch> {
    let (width, height) = (picture.width, picture.height);
    let leans = |x: u32, y: u32| {
        let [r, g, b] = pixel(picture, x, y);
        b > 0.4 && (r - 0.5).abs() + (g - 0.5).abs() > 0.08
    };
    let mut seen = vec![false; (width * height) as usize];
    let mut found = Vec::new();
    for start in 0..width * height {
        let mut open = vec![(start % width, start / width)];
        let mut patch = Vec::new();
        while let Some((x, y)) = open.pop() {
            let mark = &mut seen[(y * width + x) as usize];
            if *mark || !leans(x, y) {
                continue;
            }
            *mark = true;
            patch.push((x, y));
            if x > 0 {
                open.push((x - 1, y))
            }
            if y > 0 {
                open.push((x, y - 1))
            }
            if x + 1 < width {
                open.push((x + 1, y))
            }
            if y + 1 < height {
                open.push((x, y + 1))
            }
        }
        // Bowls are some 60 pixels wide; edges of cells that a sample straddles are slivers.
        if patch.len() > 800 {
            found.push(Patch(patch));
        }
    }
    found
}
