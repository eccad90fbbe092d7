//! Submitted images: checked, copied on the program's own queue, written as PNG where the script says so.

use std::path::PathBuf;
use std::process;

use ash::vk::{self, Handle as _};
use openvr_sys as sys;
use serde_json::{Value, json};

use crate::copier::{Copier, Copy, KINDS};

type Code = sys::EVRCompositorError;

/// One eye's image, or an overlay's, as submitted.
#[derive(Clone)]
pub struct Submitted {
    /// Of [`KINDS`]: an eye, or an overlay.
    pub eye: usize,
    pub data: sys::VRVulkanTextureData_t,
    /// uMin, vMin, uMax, vMax.
    pub bounds: [f32; 4],
    color_space: sys::EColorSpace,
}

impl Submitted {
    /// Reads what the pointers of Submit hold.
    ///
    /// # Safety
    /// `texture` is a texture whose handle, if its type is Vulkan, is a `VRVulkanTextureData_t`; `bounds` is null or bounds.
    pub unsafe fn read(
        eye: usize,
        texture: *const sys::Texture_t,
        bounds: *const sys::VRTextureBounds_t,
    ) -> Result<Self, Code> {
        let invalid = sys::EVRCompositorError_VRCompositorError_InvalidTexture;
        // SAFETY: the caller's promise.
        let texture = unsafe { texture.as_ref() }.ok_or(invalid)?;
        if texture.eType != sys::ETextureType_TextureType_Vulkan {
            return Err(invalid);
        }
        // SAFETY: the caller's promise.
        let data = unsafe { texture.handle.cast::<sys::VRVulkanTextureData_t>().as_ref() }.ok_or(invalid)?;
        // SAFETY: the caller's promise.
        let bounds = unsafe { bounds.as_ref() }.map_or([0.0, 0.0, 1.0, 1.0], |b| [b.uMin, b.vMin, b.uMax, b.vMax]);
        Ok(Self { eye, data: *data, bounds, color_space: texture.eColorSpace })
    }

    /// For the log.
    pub fn details(&self) -> Value {
        let d = &self.data;
        json!({
            "image": d.m_nImage, "device": d.m_pDevice as u64, "queue": d.m_pQueue as u64,
            "queue_family": d.m_nQueueFamilyIndex, "size": [d.m_nWidth, d.m_nHeight], "format": d.m_nFormat,
            "samples": d.m_nSampleCount, "bounds": self.bounds, "color_space": self.color_space,
        })
    }

    /// The part that the bounds choose, in pixels, and whether it is upside down.
    fn part(&self) -> Result<(vk::Rect2D, bool), Code> {
        let [u0, v0, u1, v1] = self.bounds;
        let is_inside = self.bounds.iter().all(|b| (0.0..=1.0).contains(b));
        if !is_inside || u0 >= u1 || v0 == v1 {
            return Err(sys::EVRCompositorError_VRCompositorError_InvalidBounds);
        }
        let pixel = |part: f32, size: u32| (part * size as f32).round() as u32;
        let (x0, x1) = (pixel(u0, self.data.m_nWidth), pixel(u1, self.data.m_nWidth));
        let (y0, y1) = (pixel(v0.min(v1), self.data.m_nHeight), pixel(v0.max(v1), self.data.m_nHeight));
        let offset = vk::Offset2D { x: x0.cast_signed(), y: y0.cast_signed() };
        let extent = vk::Extent2D { width: x1 - x0, height: y1 - y0 };
        if extent.width == 0 || extent.height == 0 {
            return Err(sys::EVRCompositorError_VRCompositorError_InvalidBounds);
        }
        Ok((vk::Rect2D { offset, extent }, v0 > v1))
    }

    fn format(&self) -> Result<vk::Format, Code> {
        let format = vk::Format::from_raw(self.data.m_nFormat.cast_signed());
        let known = [
            vk::Format::R8G8B8A8_UNORM,
            vk::Format::R8G8B8A8_SRGB,
            vk::Format::B8G8R8A8_UNORM,
            vk::Format::B8G8R8A8_SRGB,
        ];
        let is_fine = known.contains(&format) && self.data.m_nSampleCount == 1;
        if is_fine { Ok(format) } else { Err(sys::EVRCompositorError_VRCompositorError_TextureUsesUnsupportedFormat) }
    }
}

/// The program's device and our copies on it.
pub struct Images {
    folder: PathBuf,
    entry: Option<ash::Entry>,
    copier: Option<Copier>,
    /// Whether any are.
    copies: bool,
    /// Images copied so far.
    pub copied: u64,
}

impl Images {
    /// Writes pictures into `folder`.
    pub fn new(folder: PathBuf, copies: bool) -> Self {
        Self { folder, entry: None, copier: None, copies, copied: 0 }
    }

    fn entry(&mut self) -> &ash::Entry {
        self.entry.get_or_insert_with(|| {
            // SAFETY: the program has loaded this very loader already.
            unsafe { ash::Entry::load() }.unwrap_or_else(|error| {
                eprintln!("headset runtime: no Vulkan loader: {error}");
                process::abort()
            })
        })
    }

    /// The handle of the n-th physical device of the program's instance.
    pub fn physical_device(&mut self, instance: u64, n: usize) -> Option<u64> {
        let handle = vk::Instance::from_raw(instance);
        if handle == vk::Instance::null() {
            return None;
        }
        // SAFETY: the program passes its living instance.
        let instance = unsafe { ash::Instance::load(self.entry().static_fn(), handle) };
        // SAFETY: as above.
        let devices = unsafe { instance.enumerate_physical_devices() }.unwrap_or_default();
        devices.get(n).map(|device| device.as_raw())
    }

    /// Copies an image that lies in TRANSFER_SRC_OPTIMAL; `shown`: its picture is written when the copy is done, with
    /// a `border` of one texel at the right and lower side.
    ///
    /// # Errors
    /// The code that Submit answers with.
    pub fn copy(&mut self, submitted: &Submitted, frame: u64, shown: bool, border: bool) -> Result<(), Code> {
        let (mut part, is_flipped) = submitted.part()?;
        let format = submitted.format()?;
        let data = &submitted.data;
        if border {
            let room = |offset: i32, size: u32| size - offset.cast_unsigned();
            part.extent.width = (part.extent.width + 1).min(room(part.offset.x, data.m_nWidth));
            part.extent.height = (part.extent.height + 1).min(room(part.offset.y, data.m_nHeight));
        }
        if !self.copies {
            return Ok(());
        }
        if self.copier.is_none() {
            let entry = self.entry().clone();
            self.copier = Some(Copier::new(&entry, data));
        }
        let copier = self.copier.as_mut().filter(|copier| copier.is_on(data));
        let copier = copier.ok_or(sys::EVRCompositorError_VRCompositorError_TextureIsOnWrongDevice)?;
        let name = KINDS[submitted.eye];
        let file = shown.then(|| self.folder.join(format!("frame-{frame:06}-{name}.png")));
        let image = vk::Image::from_raw(data.m_nImage);
        copier.copy(submitted.eye, Copy { image, format, part, is_flipped, frame, file });
        self.copied += 1;
        Ok(())
    }

    /// Before a frame begins: waits for the copies of the frame before the last.
    pub fn collect(&mut self, frame: u64) {
        if let Some(copier) = &mut self.copier {
            copier.collect(frame.saturating_sub(1));
        }
    }

    /// Calls Vulkan on the program's device, if there was an image, in a way that the validation layer does not allow.
    pub fn misbehave(&self) {
        if let Some(copier) = &self.copier {
            copier.misbehave();
        }
    }

    /// Waits for the program's device and frees what is ours.
    pub fn close(&mut self) {
        if let Some(copier) = self.copier.take() {
            copier.close();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submitted(bounds: [f32; 4], format: vk::Format, samples: u32) -> Submitted {
        let data = sys::VRVulkanTextureData_t {
            m_nWidth: 200,
            m_nHeight: 100,
            m_nFormat: format.as_raw().cast_unsigned(),
            m_nSampleCount: samples,
            ..Default::default()
        };
        Submitted { eye: 0, data, bounds, color_space: sys::EColorSpace_ColorSpace_Auto }
    }

    #[test]
    fn bounds_choose_a_part_and_may_turn_it_upside_down() {
        let part = |bounds| {
            submitted(bounds, vk::Format::R8G8B8A8_SRGB, 1)
                .part()
                .map(|(r, is_flipped)| ([r.offset.x, r.offset.y], [r.extent.width, r.extent.height], is_flipped))
        };
        assert_eq!(part([0.0, 0.0, 1.0, 1.0]), Ok(([0, 0], [200, 100], false)));
        assert_eq!(part([0.0, 0.0, 0.75, 0.8]), Ok(([0, 0], [150, 80], false)));
        assert_eq!(part([0.1, 1.0, 0.5, 0.2]), Ok(([20, 20], [80, 80], true)));
        for bounds in [[0.0, 0.0, 1.1, 1.0], [-0.1, 0.0, 1.0, 1.0], [0.5, 0.0, 0.5, 1.0], [f32::NAN, 0.0, 1.0, 1.0]] {
            assert_eq!(part(bounds), Err(sys::EVRCompositorError_VRCompositorError_InvalidBounds), "{bounds:?}");
        }
    }

    #[test]
    fn only_flat_eight_bit_images_of_one_sample_are_taken() {
        let format = |format, samples| submitted([0.0, 0.0, 1.0, 1.0], format, samples).format();
        assert_eq!(format(vk::Format::B8G8R8A8_SRGB, 1), Ok(vk::Format::B8G8R8A8_SRGB));
        let refused = Err(sys::EVRCompositorError_VRCompositorError_TextureUsesUnsupportedFormat);
        assert_eq!(format(vk::Format::R16G16B16A16_SFLOAT, 1), refused);
        assert_eq!(format(vk::Format::R8G8B8A8_SRGB, 4), refused);
    }
}
