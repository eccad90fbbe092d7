//! OpenEXR pictures as panoramas: choosing layer and channels, placing the data window, checks against hostile files.

use std::io::Cursor;
use std::path::Path;

use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock};
use exr::error::Error as ExrError;
use exr::meta::header::Header;
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, FlatImage, FlatSamples, IntegerBounds, Layer, MetaData, ReadChannels,
    ReadLayers, read,
};

use super::contained::contained;
use super::radiance_image::{RadianceImage, SizeCheck};
use super::{Report, file};
use crate::error::{MAX_QUOTED, one_line};
use crate::{Error, Result};

/// Limit for all layers and channels of a file together: which layer is used is known only after all are read.
const MAX_SAMPLE_BYTES: u64 = 4 << 30;

/// Indices of a DWA chunk's leading 64-bit counters that give decompressed sizes: of unknown, run-length (twice), AC
/// and DC data. The others are bounded by the chunk itself.
const DWA_SIZES: [usize; 5] = [1, 6, 7, 8, 9];

type FlatLayer = Layer<AnyChannels<FlatSamples>>;

/// Whether the content begins like an OpenEXR file.
pub fn is_openexr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

/// Decodes the first layer with R, G and B channels, else the first with Y alone; other channels are ignored.
///
/// The display window is the whole sphere: what the data window leaves out of it is black (with a warning), and what
/// lies outside of it is cropped.
pub fn decode(path: &Path, bytes: &[u8], check_size: SizeCheck, report: &Report) -> Result<RadianceImage> {
    let image = guarded(path, bytes, check_size, read_layers)?;
    let (layer, channels) = image
        .layer_data
        .iter()
        .find_map(|layer| find_rgb(layer).map(|channels| (layer, channels)))
        .or_else(|| image.layer_data.iter().find_map(|layer| find_luminance(layer).map(|channels| (layer, channels))))
        .ok_or_else(|| {
            broken(path, format!("no R, G, B or Y among its channels ({})", channel_names(&image.layer_data)))
        })?;
    place(path, layer, channels, image.attributes.display_window, report)
}

/// Runs the decoder `read` after checking what it would trust; its errors and panics become errors that name the file.
pub fn guarded<T>(
    path: &Path,
    bytes: &[u8],
    check_size: SizeCheck,
    read: fn(&[u8]) -> exr::error::Result<T>,
) -> Result<T> {
    // The decoder panics on some broken files (B44 for one).
    let decoded = contained(|| {
        check_header(path, bytes, check_size)?;
        check_dwa(bytes).and_then(|()| read(bytes)).map_err(|error| decoder_error(path, &error))
    });
    decoded.unwrap_or_else(|problem| Err(broken(path, problem)))
}

/// In one thread: a panic in a worker thread of the decoder would end the process.
fn read_layers(bytes: &[u8]) -> exr::error::Result<FlatImage> {
    read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
}

fn check_header(path: &Path, bytes: &[u8], check_size: SizeCheck) -> Result<()> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|error| decoder_error(path, &error))?;
    let mut total = 0u64;
    for header in &meta.headers {
        let display = header.shared_attributes.display_window.size;
        for size in [header.layer_size, display] {
            check_size(path, size.width() as u64, size.height() as u64)?;
        }
        total += (header.layer_size.area() * header.channels.list.len() * 4) as u64;
    }
    if total > MAX_SAMPLE_BYTES {
        let size = format!("{total} bytes over all layers");
        return Err(Error::TooLarge {
            path: path.into(),
            what: "OpenEXR picture",
            size,
            limit: format!("{MAX_SAMPLE_BYTES} bytes"),
        });
    }
    Ok(())
}

/// The decoder allocates what DWA chunks declare, unchecked; so their sizes are checked here first.
fn check_dwa(bytes: &[u8]) -> exr::error::Result<()> {
    let reader = exr::block::read(Cursor::new(bytes), false)?;
    let headers = reader.headers().to_vec();
    if !headers.iter().any(is_dwa) {
        return Ok(());
    }
    for chunk in reader.filter_chunks(false, |_, _, _| true)? {
        let chunk = chunk?;
        if let Some(header) = headers.get(chunk.layer_index).filter(|header| is_dwa(header)) {
            check_dwa_chunk(header, &chunk)?;
        }
    }
    Ok(())
}

fn is_dwa(header: &Header) -> bool {
    matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_))
}

/// No valid size is much larger than the chunk's pixels, rounded up to the method's blocks of 8×8.
fn check_dwa_chunk(header: &Header, chunk: &Chunk) -> exr::error::Result<()> {
    let data = match &chunk.compressed_block {
        CompressedBlock::ScanLine(CompressedScanLineBlock { compressed_pixels_le, .. })
        | CompressedBlock::Tile(CompressedTileBlock { compressed_pixels_le, .. }) => compressed_pixels_le,
        _ => return Ok(()),
    };
    let size =
        header.get_absolute_block_pixel_coordinates(header.get_block_data_indices(&chunk.compressed_block)?)?.size;
    let texel_bytes = header.channels.bytes_per_pixel;
    // Where compression does not help, texels are stored as they are.
    if data.len() == size.area() * texel_bytes {
        return Ok(());
    }
    let limit = ((size.width() + 8) * (size.height() + 8) * texel_bytes * 2) as u64;
    let counters = data.as_chunks().0;
    let excessive = |index: usize| counters.get(index).is_some_and(|bytes| u64::from_le_bytes(*bytes) > limit);
    if DWA_SIZES.into_iter().any(excessive) {
        return Err(ExrError::Invalid("a DWA chunk declares more data than its pixels".into()));
    }
    Ok(())
}

/// `diffuse.R` → (`diffuse`, `R`)
fn split_name(channel: &AnyChannel<FlatSamples>) -> (String, String) {
    let name = channel.name.to_string();
    let (layer, last) = name.rsplit_once('.').unwrap_or(("", &name));
    (layer.to_owned(), last.to_uppercase())
}

fn find<'a>(layer: &'a FlatLayer, prefix: &str, name: &str) -> Option<&'a FlatSamples> {
    let list = &layer.channel_data.list;
    list.iter().find(|channel| split_name(channel) == (prefix.into(), name.into())).map(|channel| &channel.sample_data)
}

/// Prefixes of the layer's channels, the unnamed one first.
fn prefixes(layer: &FlatLayer) -> Vec<String> {
    let mut all: Vec<_> = layer.channel_data.list.iter().map(|channel| split_name(channel).0).collect();
    all.sort();
    all.dedup();
    all
}

fn find_rgb(layer: &FlatLayer) -> Option<[&FlatSamples; 3]> {
    prefixes(layer)
        .iter()
        .find_map(|prefix| Some([find(layer, prefix, "R")?, find(layer, prefix, "G")?, find(layer, prefix, "B")?]))
}

/// Y, unless there are chroma channels.
fn find_luminance(layer: &FlatLayer) -> Option<[&FlatSamples; 3]> {
    prefixes(layer).iter().find_map(|prefix| {
        let grey = find(layer, prefix, "RY").is_none() && find(layer, prefix, "BY").is_none();
        find(layer, prefix, "Y").filter(|_| grey).map(|y| [y; 3])
    })
}

fn place(
    path: &Path,
    layer: &FlatLayer,
    channels: [&FlatSamples; 3],
    display: IntegerBounds,
    report: &Report,
) -> Result<RadianceImage> {
    let (width, height) = (display.size.width(), display.size.height());
    let data_width = layer.size.width();
    // Differences of 32-bit positions need more bits.
    let offset = |display: i32, data: i32| i64::from(display) - i64::from(data);
    let left = offset(display.position.x(), layer.attributes.layer_position.x());
    let top = offset(display.position.y(), layer.attributes.layer_position.y());
    let mut missing = 0u64;
    let mut texels = Vec::with_capacity(width * height);
    for y in 0..height as i64 {
        let row = usize::try_from(y + top).ok().filter(|row| *row < layer.size.height());
        for x in 0..width as i64 {
            let column = usize::try_from(x + left).ok().filter(|column| *column < data_width);
            texels.push(match row.zip(column) {
                Some((row, column)) => {
                    channels.map(|samples| samples.value_by_flat_index(row * data_width + column).to_f32())
                }
                None => {
                    missing += 1;
                    [0.0; 3]
                }
            });
        }
    }
    if missing == (width * height) as u64 {
        return Err(broken(path, "its data lie entirely outside its display window".into()));
    }
    if missing > 0 {
        let name = file::short_name(path);
        report.warn(format!("{name}: {missing} texel(s) of the display window have no data; left black"));
    }
    // Both were checked against the size limit.
    Ok(RadianceImage { width: width as u32, height: height as u32, texels })
}

fn channel_names(layers: &[FlatLayer]) -> String {
    let names: Vec<_> = layers.iter().flat_map(|l| &l.channel_data.list).take(12).map(|c| c.name.to_string()).collect();
    if names.is_empty() { "none".into() } else { one_line(&names.join(", "), 2 * MAX_QUOTED) }
}

/// An error of the decoder, in plain words where the file ends too early.
fn decoder_error(path: &Path, error: &ExrError) -> Error {
    let text = error.to_string();
    let is_cut = matches!(error, ExrError::Io(error) if error.kind() == std::io::ErrorKind::UnexpectedEof);
    if !is_cut && !text.contains("reference to missing bytes") {
        return broken(path, one_line(&text, 2 * MAX_QUOTED));
    }
    let remedy = "copy or download it again";
    Error::Broken { path: path.into(), what: "OpenEXR picture", problem: "it ends too early".into(), remedy }
}

fn broken(path: &Path, problem: String) -> Error {
    let remedy = "save it again as an RGB picture, one part, half or full float";
    Error::Broken { path: path.into(), what: "OpenEXR picture", problem, remedy }
}

#[cfg(test)]
mod tests {
    use exr::image::SpecificChannels;
    use exr::prelude::{Encoding, Image, LayerAttributes, Vec2, WritableImage, f16};

    use super::*;

    fn decoded(bytes: &[u8], report: &Report) -> Result<RadianceImage> {
        decode(Path::new("a.exr"), bytes, |_, _, _| Ok(()), report)
    }

    fn write(image: impl FnOnce(&mut Cursor<Vec<u8>>)) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image(&mut bytes);
        bytes.into_inner()
    }

    fn value(x: usize, y: usize) -> f32 {
        (x + 10 * y) as f32
    }

    fn flat(names_and_samples: Vec<(&str, FlatSamples)>, size: (usize, usize)) -> Layer<AnyChannels<FlatSamples>> {
        let list = names_and_samples.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
        Layer::new(size, LayerAttributes::named("a"), Encoding::UNCOMPRESSED, AnyChannels::sort(list))
    }

    #[test]
    fn every_compression_and_sample_type() {
        let all = [
            (Compression::Uncompressed, 0.0),
            (Compression::RLE, 0.0),
            (Compression::ZIP1, 0.0),
            (Compression::ZIP16, 0.0),
            (Compression::PIZ, 0.0),
            (Compression::PXR24, 1e-3),
            (Compression::B44, 0.3),
            (Compression::DWAA(Some(1.0)), 0.5),
            (Compression::DWAB(Some(1.0)), 0.5),
        ];
        for (compression, tolerance) in all {
            let pixel = |p: Vec2<usize>| (f16::from_f32(value(p.x(), p.y())), value(p.x(), p.y()) * 2.0, 7u32);
            let encoding = Encoding { compression, ..Encoding::FAST_LOSSLESS };
            let channels = SpecificChannels::build().with_channel("R").with_channel("G").with_channel("B");
            let layer = Layer::new((16, 8), LayerAttributes::default(), encoding, channels.with_pixel_fn(pixel));
            let bytes = write(|to| Image::from_layer(layer).write().to_buffered(to).unwrap());
            let got = decoded(&bytes, &Report::silent()).unwrap();
            assert_eq!((got.width, got.height), (16, 8));
            for (i, [r, g, b]) in got.texels.into_iter().enumerate() {
                let v = value(i % 16, i / 16);
                let error = (r - v).abs().max((g - 2.0 * v).abs());
                assert!(error <= tolerance * (1.0 + v) && b == 7.0, "{compression:?} {i}: {r} {g} {b} for {v}");
            }
        }
    }

    #[test]
    fn a_truncated_file_is_reported_as_such() {
        let layer = flat(vec![("Y", FlatSamples::F32(vec![1.0; 64]))], (8, 8));
        let bytes = write(|to| Image::from_layer(layer).write().to_buffered(to).unwrap());
        for length in [bytes.len() / 2, bytes.len() - 20] {
            let error = decoded(&bytes[..length], &Report::silent()).err().unwrap().to_string();
            assert!(error.contains("it ends too early; copy or download it again"), "{length}: {error}");
        }
    }

    #[test]
    fn luminance_prefixes_and_extra_channels() {
        let f = |v: f32| FlatSamples::F32(vec![v; 2]);
        let first = |layers: Vec<(&str, FlatSamples)>| {
            let bytes = write(|to| Image::from_layer(flat(layers, (2, 1))).write().to_buffered(to).unwrap());
            decoded(&bytes, &Report::silent()).map(|t| t.texels[0])
        };
        assert_eq!(first(vec![("Y", f(3.0)), ("A", f(1.0))]).unwrap(), [3.0; 3]);
        let many = vec![("Z", f(9.0)), ("B", f(3.0)), ("light.R", f(8.0)), ("R", f(1.0)), ("G", f(2.0))];
        assert_eq!(first(many).unwrap(), [1.0, 2.0, 3.0]);
        let prefixed = vec![("sky.main.R", f(1.0)), ("sky.main.G", f(2.0)), ("sky.main.B", f(3.0)), ("Z", f(0.0))];
        assert_eq!(first(prefixed).unwrap(), [1.0, 2.0, 3.0]);
        assert!(first(vec![("Z", f(1.0))]).unwrap_err().to_string().contains("(Z)"));
        assert!(first(vec![("Y", f(1.0)), ("RY", f(1.0)), ("BY", f(1.0))]).is_err(), "chroma would be lost");
    }

    #[test]
    fn the_display_window_is_the_sphere() {
        let samples = || FlatSamples::F32(vec![1.0, 2.0, 3.0, 4.0]);
        let place = |data: (i32, i32), display: (i32, i32), size: (usize, usize)| {
            let mut layer = flat(vec![("Y", samples())], (2, 2));
            layer.attributes.layer_position = Vec2(data.0, data.1);
            let mut image = Image::from_layer(layer);
            image.attributes.display_window = IntegerBounds::new(display, size);
            let report = Report::silent();
            let bytes = write(|to| image.write().to_buffered(to).unwrap());
            let values = decoded(&bytes, &report).map(|t| t.texels.iter().map(|t| t[0]).collect::<Vec<_>>());
            (values, report.warnings().len())
        };
        assert_eq!(place((5, 5), (5, 5), (2, 2)).0.unwrap(), [1.0, 2.0, 3.0, 4.0]);
        let (padded, warnings) = place((1, 0), (0, 0), (3, 2));
        assert_eq!((padded.unwrap(), warnings), (vec![0.0, 1.0, 2.0, 0.0, 3.0, 4.0], 1));
        let (cut, warnings) = place((-1, 0), (0, 0), (1, 2));
        assert_eq!((cut.unwrap(), warnings), (vec![2.0, 4.0], 0));
        assert!(place((50, 0), (0, 0), (2, 2)).0.is_err());
    }
}
