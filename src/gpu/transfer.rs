//! Bytes between CPU and GPU: readback, and whole images written at once. Uploads of any size: `staging`.

use std::sync::Arc;

use super::buffer::{Buffer, BufferKind};
use super::command_buffer::PassTime;
use super::commands::Commands;
use super::device::Gpu;
use super::image::{Image, ImageAccess, Subresource};
use super::submit::submit_and_wait;
use crate::{Error, Result};

/// Copies a buffer back to the CPU.
pub fn read_buffer(gpu: &Arc<Gpu>, from: &Buffer) -> Result<Vec<u8>> {
    let to = Buffer::new(gpu, "readback", BufferKind::Readback, from.size())?;
    submit_and_wait(gpu, |commands| {
        commands.buffers_written();
        commands.copy_buffer(from, 0, &to, 0, from.size());
        commands.copies_to_host();
        Ok(())
    })?;
    Ok(to.read(<[u8]>::to_vec))
}

/// Copies one layer of one mip back to the CPU, tightly packed rows from the top.
///
/// # Errors
/// A subresource that nothing was ever recorded into; a driver that fails.
pub fn read_image(gpu: &Arc<Gpu>, from: &Image, part: Subresource, bytes_per_texel: u64) -> Result<Vec<u8>> {
    let [width, height] = from.mip_size(part.mip);
    let size = u64::from(width) * u64::from(height) * bytes_per_texel;
    Ok(read_parts(gpu, from, &[(part, size)])?.remove(0))
}

/// Copies all of an image back to the CPU: for each mip, layer after layer, tightly packed rows from the top.
///
/// # Errors
/// As for [`read_image`].
pub fn read_mips(gpu: &Arc<Gpu>, from: &Image, bytes_per_texel: u64) -> Result<Vec<Vec<u8>>> {
    let parts = parts(from, bytes_per_texel);
    let read = read_parts(gpu, from, &parts)?;
    let mut mips = vec![Vec::new(); from.desc().mips as usize];
    parts.iter().zip(read).for_each(|((part, _), bytes)| mips[part.mip as usize].extend(bytes));
    Ok(mips)
}

/// Copies some subresources back, each with its bytes, and leaves the image as it was.
fn read_parts(gpu: &Arc<Gpu>, from: &Image, parts: &[(Subresource, u64)]) -> Result<Vec<Vec<u8>>> {
    let before: Vec<ImageAccess> = parts.iter().map(|(part, _)| from.access(part.mip, part.layer)).collect();
    if before.contains(&ImageAccess::Fresh) {
        return Err(Error::Usage(
            "an image is read back that nothing has been written to; this is a defect of pbr-vr, please report it"
                .into(),
        ));
    }
    let size = parts.iter().map(|(_, bytes)| bytes).sum();
    let to = Buffer::new(gpu, "readback", BufferKind::Readback, size)?;
    submit_and_wait(gpu, |commands| {
        let prepare = |commands: &mut Commands<'_>, part: &Subresource, access| {
            let (mips, layers) = (part.mip..part.mip + 1, part.layer..part.layer + 1);
            commands.prepare_subresources(from, mips, layers, access);
        };
        parts.iter().for_each(|(part, _)| prepare(commands, part, ImageAccess::CopyFrom));
        let mut offset = 0;
        for (part, bytes) in parts {
            commands.copy_from_image(from, *part, &to, offset);
            offset += bytes;
        }
        commands.copies_to_host();
        parts.iter().zip(&before).for_each(|((part, _), access)| prepare(commands, part, *access));
        Ok(())
    })?;
    Ok(to.read(|mut rest| {
        let mut next = |(_, bytes): &(Subresource, u64)| {
            let (bytes, after) = rest.split_at(usize::try_from(*bytes).unwrap_or(usize::MAX).min(rest.len()));
            rest = after;
            bytes.to_vec()
        };
        parts.iter().map(&mut next).collect()
    }))
}

/// Fills images with bytes that `read_mips` returned for images of the same format and shape; returns the GPU time of
/// the copies, named `pass`.
///
/// # Panics
/// If mips are shorter than their image's: a defect of the caller.
pub fn write_mips(gpu: &Arc<Gpu>, pass: &'static str, images: &[(&Image, &[Vec<u8>])]) -> Result<Vec<PassTime>> {
    let stage = |(image, mips): &(&Image, &[Vec<u8>])| {
        let bytes = mips.concat();
        let texels = parts(image, 1).iter().map(|(_, texels)| texels).sum::<u64>();
        let bytes_per_texel = bytes.len() as u64 / texels;
        assert!(bytes_per_texel > 0 && bytes_per_texel * texels == bytes.len() as u64, "mips of another image");
        Ok((Buffer::with_bytes(gpu, "staging", BufferKind::Upload, &bytes)?, parts(image, bytes_per_texel)))
    };
    let staged: Vec<_> = images.iter().map(stage).collect::<Result<_>>()?;
    submit_and_wait(gpu, |commands| {
        commands.pass(pass, |commands| {
            for ((to, _), (staging, parts)) in images.iter().zip(&staged) {
                commands.prepare_fresh(to, ImageAccess::CopyTo);
                let mut offset = 0;
                for (part, bytes) in parts {
                    commands.copy_to_image(staging, offset, to, *part);
                    offset += bytes;
                }
                commands.prepare(to, ImageAccess::Sampled);
            }
        });
        Ok(())
    })
}

/// All layers of all mips with their sizes, mip 0 first.
fn parts(image: &Image, bytes_per_texel: u64) -> Vec<(Subresource, u64)> {
    let bytes = |mip| image.mip_size(mip).map(u64::from).iter().product::<u64>() * bytes_per_texel;
    let layers = image.desc().shape.layers();
    (0..image.desc().mips)
        .flat_map(|mip| (0..layers).map(move |layer| (Subresource { mip, layer }, bytes(mip))))
        .collect()
}

#[cfg(test)]
mod gpu_tests {
    use super::*;
    use crate::gpu::{Format, ImageDesc, ImageUsageFlags, Shape, with_gpu};

    #[test]
    fn an_image_is_read_only_where_something_was_written() {
        with_gpu(|gpu| {
            let usage = ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST | ImageUsageFlags::SAMPLED;
            let desc = ImageDesc::flat(Format::R8G8B8A8_UNORM, [2, 2], usage);
            let image = Image::new(gpu, "image", ImageDesc { shape: Shape::Layers(2), ..desc }).unwrap();
            let [first, second] = [0, 1].map(|layer| Subresource { mip: 0, layer });
            let refused = |result: Result<_>| assert!(matches!(result, Err(Error::Usage(_))));
            refused(read_image(gpu, &image, first, 4));
            let bytes = [7; 16];
            let staging = Buffer::with_bytes(gpu, "staging", BufferKind::Upload, &bytes).unwrap();
            submit_and_wait(gpu, |commands| {
                commands.prepare_subresources(&image, 0..1, 0..1, ImageAccess::CopyTo);
                commands.copy_to_image(&staging, 0, &image, first);
                Ok(())
            })
            .unwrap();
            assert_eq!(read_image(gpu, &image, first, 4).unwrap(), bytes);
            assert_eq!(image.access(0, 0), ImageAccess::CopyTo);
            refused(read_image(gpu, &image, second, 4));
            refused(read_mips(gpu, &image, 4).map(|mips| mips.concat()));
            write_mips(gpu, "copies", &[(&image, &[[bytes, bytes].concat()])]).unwrap();
            assert_eq!(read_mips(gpu, &image, 4).unwrap(), [[bytes, bytes].concat()]);
            assert_eq!([0, 1].map(|layer| image.access(0, layer)), [ImageAccess::Sampled; 2]);
        });
    }
}
