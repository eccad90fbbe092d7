//! The smallest files that a reader once failed on, and what each of them showed.

use super::formats::{png_chunks, png_of};
use super::readers::Reader;
use super::seeds;

/// Reader, what the file showed, and the file.
pub fn all() -> Vec<(Reader, &'static str, Vec<u8>)> {
    let hdr = |line: &str| format!("#?RADIANCE\n{line}\n\n-Y 1 +X 1\n\u{1}\u{1}\u{1}\u{1}").into_bytes();
    vec![
        (Reader::Hdr, "the error quotes the whole line, of any length", hdr(&format!("FORMAT={}", "x".repeat(5000)))),
        (Reader::Hdr, "a carriage return breaks the line of the error", hdr("EXPOSURE=2\rCOLORCORR=1 0.5 2")),
        (Reader::Hdr, "the same in the name of its colours", hdr("FORMAT=32-bit_rle_rgbe\rFORMAT=xyze")),
        (Reader::Jpeg, "zune-jpeg's message ends with a line break", Vec::new()),
        (Reader::Png, "png panics: a palette's length is no multiple of three", png_palette()),
        (Reader::Exr, "exr panics: differences of B44 overflow (where overflow is checked)", exr_b44()),
        (Reader::Gltf, "a compressed view of 37 bytes declares 946 MB, which were allocated", gltf_packed()),
        (Reader::Gltf, "the name of an extension breaks the line of the error", gltf_name()),
        (Reader::Gltf, "so does its version", br#"{"asset":{"version":"1\n"}}"#.to_vec()),
        (Reader::Exr, "the error names all channels, whose names are long", exr_channels()),
    ]
}

fn gltf_packed() -> Vec<u8> {
    let text = String::from_utf8(seeds::gltf()).unwrap();
    text.replace(r#""byteStride":12,"count":3"#, r#""byteStride":12,"count":78863138"#).into_bytes()
}

fn gltf_name() -> Vec<u8> {
    let text = String::from_utf8(seeds::gltf()).unwrap();
    text.replacen('{', r#"{"extensionsRequired":["\n"],"#, 1).into_bytes()
}

fn png_palette() -> Vec<u8> {
    let mut chunks = png_chunks(&seeds::pngs()[12]);
    for (_, content) in chunks.iter_mut().filter(|(kind, _)| kind == b"PLTE") {
        content.truncate(5);
    }
    png_of(&chunks)
}

/// The end of the file is the half floats of its only compressed channel.
fn exr_b44() -> Vec<u8> {
    let mut bytes = seeds::exrs().swap_remove(6);
    let end = bytes.len();
    bytes[end - 40..].fill(0);
    bytes
}

fn exr_channels() -> Vec<u8> {
    let names: Vec<String> = (0..12).map(|number| format!("{number:02}{}", "x".repeat(200))).collect();
    seeds::exr_of(&names.iter().map(String::as_str).collect::<Vec<_>>())
}
