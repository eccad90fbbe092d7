//! A wall with textures.

use image::{Rgba, RgbaImage};

use super::Workshop;

/// A square that fills the picture, with parts of these images beside each other.
pub fn textured(workshop: &Workshop, images: &[RgbaImage], part: f32) {
    workshop.sky(0.0);
    let mut obj = format!("mtllib wall.mtl\nvn 0 0 1\nvt 0 0\nvt {part} 0\nvt {part} {part}\nvt 0 {part}\n");
    let mut mtl = String::new();
    for (i, image) in images.iter().enumerate() {
        image.save(workshop.path(&format!("{i}.png"))).expect("a picture");
        mtl += &format!("newmtl m{i}\nmap_Kd {i}.png\n");
        let (left, width) = (-2.0 + 4.0 * i as f32 / images.len() as f32, 4.0 / images.len() as f32);
        for (x, y) in [(0.0, -1.5), (width, -1.5), (width, 1.5), (0.0, 1.5)] {
            obj += &format!("v {} {y} 0\n", left + x);
        }
        let corner = |c: usize| format!("{}/{}/1", 4 * i + c, c);
        obj += &format!("usemtl m{i}\nf {} {} {} {}\n", corner(1), corner(2), corner(3), corner(4));
    }
    workshop.write("wall.obj", &obj);
    workshop.write("wall.mtl", &mtl);
    let camera = "[[camera]]\nname = \"front\"\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\n";
    let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"wall.obj\"\n";
    workshop.write("wall.toml", &format!("{text}{camera}"));
}

/// Stripes across.
pub fn stripes(width: u32, height: u32, green: u8) -> RgbaImage {
    let colour =
        |x: u32| if (x / (width / 16)).is_multiple_of(2) { [220, green, 40, 255] } else { [30, green, 120, 255] };
    RgbaImage::from_fn(width, height, |x, _| Rgba(colour(x)))
}

/// Four textures of 5.3 MiB each, raw. A picture shows so little of them that all texels are needed: stripes of four texels.
pub fn four_large(workshop: &Workshop) {
    let fine = |green: u8| {
        let colour = |x: u32| if (x / 4).is_multiple_of(2) { [220, green, 40, 255] } else { [30, green, 120, 255] };
        RgbaImage::from_fn(1024, 1024, |x, _| Rgba(colour(x)))
    };
    textured(workshop, &[10, 20, 30, 40].map(fine), 1.0 / 64.0);
}

/// MiB of textures after and before, as a line about memory says.
pub fn told_mib(line: &str) -> [f64; 2] {
    let (_, told) = line.split_once("textures of ").expect("a line about textures");
    let numbers = told.split_whitespace().filter_map(|word| word.parse().ok());
    numbers.collect::<Vec<f64>>().try_into().expect("two numbers")
}
