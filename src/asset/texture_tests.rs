//! Tests of textures.

use image::{ImageBuffer, Luma, LumaA, Rgb};

use super::*;

fn grey(width: u32, values: &[u8]) -> Channel {
    Channel { width, height: values.len() as u32 / width, values: values.into() }
}

fn texture(width: u32, texels: &[[u8; 4]]) -> Texture {
    let (height, pixels) = (texels.len() as u32 / width, texels.concat());
    Texture { name: "t".into(), width, height, encoding: Encoding::Linear, pixels }
}

fn saved(name: &str, picture: &DynamicImage) -> Texture {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    picture.save(&path).unwrap();
    Texture::load(&ImageSource::file(path.clone()), Encoding::Srgb).unwrap()
}

#[test]
fn any_depth_and_colour_kind() {
    let grey = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(3, 2, Luma([77])));
    for name in ["a.png", "a.tga", "a.jpg"] {
        let got = saved(name, &grey);
        assert_eq!((got.width, got.height, got.constant()), (3, 2, Some([77, 77, 77, 255])), "{name}");
    }
    // WebP has no grey; without loss it is exact.
    let colour = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(3, 2, Rgb([7, 77, 177])));
    assert_eq!(saved("a.webp", &colour).constant(), Some([7, 77, 177, 255]));
    let deep = DynamicImage::ImageRgb16(ImageBuffer::from_pixel(1, 1, Rgb([0xffff, 0x8080, 0])));
    assert_eq!(saved("b.png", &deep).pixels, [255, 128, 0, 255]);
    let grey_alpha = DynamicImage::ImageLumaA16(ImageBuffer::from_pixel(1, 1, LumaA([0xffff, 0x4040])));
    assert_eq!(saved("c.png", &grey_alpha).pixels, [255, 255, 255, 64]);
}

#[test]
fn palettes() {
    // Colour-mapped TGA: two BGR entries, two 8-bit indices, from the top.
    let mut bytes = vec![0, 1, 1, 0, 0, 2, 0, 24, 0, 0, 0, 0, 2, 0, 1, 0, 8, 0x20];
    bytes.extend([255, 0, 0, 0, 0, 255, 0, 1]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("palette.tga");
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(
        Texture::load(&ImageSource::file(path.clone()), Encoding::Srgb).unwrap().pixels,
        [0, 0, 255, 255, 255, 0, 0, 255]
    );
}

#[test]
fn formats_are_recognised_by_content() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("really-png.jpg");
    let picture = DynamicImage::new_rgb8(2, 2);
    picture.save_with_format(&path, ImageFormat::Png).unwrap();
    assert_eq!(Texture::load(&ImageSource::file(path.clone()), Encoding::Srgb).unwrap().width, 2);
    std::fs::write(&path, b"no picture at all, but long enough for a header").unwrap();
    let error = Texture::load(&ImageSource::file(path.clone()), Encoding::Srgb).unwrap_err();
    assert!(
        matches!(error, Error::Broken { .. }) && error.to_string().contains("neither PNG, JPEG nor WebP"),
        "{error}"
    );
    picture.save_with_format(&path, ImageFormat::Png).unwrap();
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..20]).unwrap();
    let error = Texture::load(&ImageSource::file(path.clone()), Encoding::Srgb).unwrap_err();
    assert!(error.to_string().contains("it ends too early"), "{error}");
}

#[test]
fn a_truncated_jpeg_is_rejected_wherever_it_ends() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jpg");
    let noise = |x: u32, y: u32| Rgb([(x * 97 + y * 31) as u8, (x * y) as u8, (x ^ y) as u8]);
    DynamicImage::ImageRgb8(ImageBuffer::from_fn(64, 64, noise)).save(&path).unwrap();
    let whole = std::fs::read(&path).unwrap();
    assert!(Texture::load(&ImageSource::file(path.clone()), Encoding::Srgb).is_ok());
    for length in [whole.len() / 2, whole.len() * 9 / 10, whole.len() - 2] {
        std::fs::write(&path, &whole[..length]).unwrap();
        let error = Texture::load(&ImageSource::file(path.clone()), Encoding::Srgb).unwrap_err();
        assert!(matches!(error, Error::Broken { .. }), "{length}: {error}");
    }
}

#[test]
fn sizes_are_checked_before_decoding() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.tga");
    std::fs::write(&path, [0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 0xff, 0xff, 24, 0]).unwrap();
    assert!(matches!(Texture::load(&ImageSource::file(path.clone()), Encoding::Srgb), Err(Error::TooLarge { .. })));
}

#[test]
fn constants() {
    assert_eq!(texture(2, &[[1, 2, 3, 4], [1, 2, 4, 4]]).constant(), Some([1, 2, 4, 4]));
    assert_eq!(texture(2, &[[1, 2, 3, 4], [1, 2, 5, 4]]).constant(), None);
    assert_eq!(grey(1, &[0, 255]).constant(), None);
    assert_eq!(grey(1, &[9, 9]).constant(), Some(9));
}

#[test]
fn packing_fills_and_resizes() {
    let packed = Texture::packed("p".into(), [None, Some(&grey(2, &[10, 20])), Some(&grey(1, &[7])), None]).unwrap();
    assert_eq!((packed.width, packed.height), (2, 1));
    assert_eq!(packed.pixels, [255, 10, 7, 255, 255, 20, 7, 255]);
    assert_eq!(Texture::packed("p".into(), [None; 4]), None);
}

#[test]
fn masks_go_into_alpha() {
    let mut base_color = texture(2, &[[1, 2, 3, 255]; 4]);
    base_color.set_alpha(&grey(1, &[0]));
    assert_eq!(base_color.pixels, [1, 2, 3, 0].repeat(4));
    assert!(grey(1, &[0, 255]).cuts_out() && !grey(1, &[0, 0]).cuts_out() && !grey(1, &[200, 255]).cuts_out());
}

#[test]
fn heights_become_normals() {
    let flat = texture(4, &[[90, 90, 90, 255]; 16]).into_normal_map(1.0);
    assert_eq!((flat.constant(), flat.encoding), (Some([128, 128, 255, 255]), Encoding::Normal));
    // Height grows to the right within the picture, and to the top.
    let slope = |along_x: bool| {
        let at = |i: usize| if along_x { i % 4 } else { 3 - i / 4 };
        let texels: Vec<_> = (0..16).map(|i| [(at(i) * 60) as u8; 3]).map(|[r, g, b]| [r, g, b, 255]).collect();
        let map = texture(4, &texels).into_normal_map(20.0);
        <[u8; 4]>::try_from(&map.pixels[5 * 4..6 * 4]).unwrap()
    };
    let ([x, y, ..], [x2, y2, ..]) = (slope(true), slope(false));
    assert!(x < 110 && y == 128, "rising to the right leans left: {x} {y}");
    assert!(x2 == 128 && y2 < 110, "rising to the top leans down: {x2} {y2}");
    let normals = texture(2, &[[128, 128, 255, 255], [100, 140, 250, 255]]);
    assert_eq!(normals.clone().into_normal_map(1.0).pixels, normals.pixels, "a normal map stays");
    assert_ne!(texture(1, &[[255; 4]; 2]).into_normal_map(1.0).pixels, [255; 8], "white is no normal map");
}
