//! Draws the user interface that egui has laid out: its textures on the GPU, and its triangles over a finished picture.

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use egui::epaint::{ClippedPrimitive, ImageDelta, Primitive, Vertex};
use egui::{ColorImage, ImageData, TextureId, TexturesDelta};

use super::frame_set::FrameSet;
use super::layouts;
use crate::Result;
use crate::gpu::{
    AddressMode, Attachments, Binding, Blend, Buffer, BufferKind, ColourAttachment, Commands, DescriptorSet,
    DescriptorSetLayout, Format, FrameContext, Gpu, GraphicsDesc, Image, ImageAccess, ImageDesc, ImageUsageFlags,
    Pipeline, Rect, Sampler,
};

/// Bytes of a frame's triangles at most, more than a screen full of text; meshes beyond them are left out.
pub const UI_BYTES: u64 = 4 << 20;
/// 32-bit words of a vertex: position, texture coordinates, colour.
const VERTEX_WORDS: u32 = (size_of::<Vertex>() / 4) as u32;
/// The largest side of a texture, which every GPU allows.
pub const MAX_TEXTURE_SIDE: usize = 4096;

/// One laid-out frame of the interface.
#[derive(Default)]
pub struct UiFrame {
    /// From back to front, in points.
    pub primitives: Vec<ClippedPrimitive>,
    /// What has changed since the frame before. Every frame must be recorded, or its changes added to the next.
    pub textures: TexturesDelta,
    pub pixels_per_point: f32,
}

/// What the interface is drawn into: an attachment of one layer with an sRGB format.
#[derive(Clone, Copy)]
pub struct UiTarget<'a> {
    pub colour: ColourAttachment<'a>,
    pub format: Format,
    /// Pixels.
    pub size: [u32; 2],
}

/// The pipeline and textures of the interface.
pub struct UiRenderer {
    gpu: Arc<Gpu>,
    frame_layout: DescriptorSetLayout,
    layout: DescriptorSetLayout,
    /// For each format that was drawn to.
    pipelines: Vec<(Format, Pipeline)>,
    sampler: Arc<Sampler>,
    textures: HashMap<TextureId, UiTexture>,
    /// What the last recording was the last to use. An object that is dropped while a recording uses it must wait for that
    /// one's submission, and would only wait for the next, which may be another thread's: so it is kept until the next
    /// recording, by when this one was submitted.
    used: Vec<Used>,
}

/// Something that a recording uses and nothing after it.
#[expect(dead_code, reason = "only kept")]
enum Used {
    Texels(Arc<Buffer>),
    Texture(UiTexture),
}

/// A texture with a copy of its texels, which rows are uploaded from.
struct UiTexture {
    texels: ColorImage,
    image: Arc<Image>,
    set: DescriptorSet,
}

/// The push constants of `ui.vert`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    ndc_from_points: [f32; 2],
    /// Words from the start of the pass's storage.
    first_index: u32,
    first_vertex: u32,
}

/// A mesh in the storage of the pass.
struct Draw {
    texture: TextureId,
    clip: Rect,
    push: Push,
    indices: u32,
}

impl UiRenderer {
    /// Without textures, which come with the first frame.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            frame_layout: layouts::frame(gpu)?,
            layout: layouts::ui(gpu)?,
            pipelines: Vec::new(),
            sampler: Sampler::new(gpu, "interface", AddressMode::Clamp, 1)?,
            textures: HashMap::new(),
            used: Vec::new(),
            gpu: Arc::clone(gpu),
        })
    }

    /// Records a frame of the interface over what `target` holds.
    ///
    /// # Errors
    /// No memory for a texture; a pipeline for a new format cannot be made.
    pub fn record(&mut self, frame: &mut FrameContext<'_>, target: UiTarget<'_>, ui: &UiFrame) -> Result<()> {
        self.used.clear();
        for (id, delta) in &ui.textures.set {
            self.set_texture(&mut frame.commands, *id, delta)?;
        }
        let UiTarget { colour, format, size } = target;
        let pipeline = self.pipeline(format)?;
        let (words, draws) = collect(ui, size);
        let storage = frame.push_bytes(bytemuck::cast_slice(&words))?;
        let set = FrameSet { set: frame.set, block: 0 };
        frame.commands.pass("interface", |commands| {
            commands.render(&Attachments { colours: &[colour], depth: None, area: size }, |commands| {
                let pipeline = &self.pipelines[pipeline].1;
                set.bind(commands, pipeline, storage);
                for Draw { texture, clip, push, indices } in &draws {
                    let Some(texture) = self.textures.get(texture) else { continue };
                    commands.scissor(*clip);
                    commands.bind_set(pipeline, 1, &texture.set, &[]);
                    commands.push(pipeline, bytemuck::bytes_of(push));
                    commands.draw(*indices, 1);
                }
            });
        });
        let freed = ui.textures.free.iter().filter_map(|id| self.textures.remove(id));
        self.used.extend(freed.map(Used::Texture));
        Ok(())
    }

    /// The index of the pipeline for a format.
    fn pipeline(&mut self, format: Format) -> Result<usize> {
        if let Some(at) = self.pipelines.iter().position(|(known, _)| *known == format) {
            return Ok(at);
        }
        let desc = GraphicsDesc {
            name: "interface",
            vertex: "ui.vert",
            fragment: Some("ui.frag"),
            sets: &[&self.frame_layout, &self.layout],
            push_bytes: size_of::<Push>() as u32,
            colours: &[format],
            blend: Blend::Over,
            ..GraphicsDesc::default()
        };
        self.pipelines.push((format, Pipeline::graphics(&self.gpu, &desc)?));
        Ok(self.pipelines.len() - 1)
    }

    /// Creates a texture, or replaces a part of one.
    fn set_texture(&mut self, commands: &mut Commands<'_>, id: TextureId, delta: &ImageDelta) -> Result<()> {
        let ImageData::Color(texels) = &delta.image;
        let rows = match (delta.pos, self.textures.get_mut(&id)) {
            (Some([x, y]), Some(texture)) => {
                replace(&mut texture.texels, texels, [x, y]);
                y..y + texels.height()
            }
            // A part of a texture that there is not.
            (Some(_), None) => return Ok(()),
            (None, _) => {
                let texture = self.make_texture(texels)?;
                self.used.extend(self.textures.insert(id, texture).map(Used::Texture));
                0..texels.height()
            }
        };
        let Some(texture) = self.textures.get(&id) else { return Ok(()) };
        let width = texture.texels.width();
        let bytes: &[u8] = bytemuck::cast_slice(&texture.texels.pixels[rows.start * width..rows.end * width]);
        let staging = Buffer::with_bytes(&self.gpu, "interface texels", BufferKind::Upload, bytes)?;
        commands.prepare(&texture.image, ImageAccess::CopyTo);
        // Textures have at most `MAX_TEXTURE_SIDE` rows.
        commands.copy_rows_to_image(&staging, 0, &texture.image, 0, rows.start as u32..rows.end as u32);
        commands.prepare(&texture.image, ImageAccess::Sampled);
        self.used.push(Used::Texels(staging));
        Ok(())
    }

    fn make_texture(&self, texels: &Arc<ColorImage>) -> Result<UiTexture> {
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST;
        let size = texels.size.map(|side| side.clamp(1, MAX_TEXTURE_SIDE) as u32);
        let image = Image::new(&self.gpu, "interface texture", ImageDesc::flat(Format::R8G8B8A8_UNORM, size, usage))?;
        let bindings = [Binding::Sampled(&image, &self.sampler)];
        let set = DescriptorSet::new(&self.gpu, "interface texture", &self.layout, &bindings)?;
        Ok(UiTexture { texels: ColorImage::clone(texels), image, set })
    }
}

/// Copies a part into an image at a corner.
fn replace(image: &mut ColorImage, part: &ColorImage, [x, y]: [usize; 2]) {
    let width = image.width();
    for (row, from) in part.pixels.chunks_exact(part.width().max(1)).enumerate() {
        let start = (y + row) * width + x;
        image.pixels[start..start + from.len()].copy_from_slice(from);
    }
}

/// The words of all meshes, indices before vertices, and how each is drawn on a picture of `size` pixels.
fn collect(ui: &UiFrame, size: [u32; 2]) -> (Vec<u32>, Vec<Draw>) {
    let mut words: Vec<u32> = Vec::new();
    let mut draws = Vec::new();
    let ndc_from_points = size.map(|side| 2.0 * ui.pixels_per_point / side as f32);
    for ClippedPrimitive { clip_rect, primitive } in &ui.primitives {
        let (Primitive::Mesh(mesh), Some(clip)) = (primitive, pixels(*clip_rect, ui.pixels_per_point, size)) else {
            continue;
        };
        let added = mesh.indices.len() + mesh.vertices.len() * VERTEX_WORDS as usize;
        if 4 * (words.len() + added) as u64 > UI_BYTES {
            break;
        }
        // Words are fewer than `UI_BYTES`.
        let first_index = words.len() as u32;
        words.extend_from_slice(&mesh.indices);
        let first_vertex = words.len() as u32;
        words.extend_from_slice(bytemuck::cast_slice(&mesh.vertices));
        let push = Push { ndc_from_points, first_index, first_vertex };
        draws.push(Draw { texture: mesh.texture_id, clip, push, indices: mesh.indices.len() as u32 });
    }
    (words, draws)
}

/// The pixels of a rectangle of points; `None` where it covers none of the picture.
fn pixels(points: egui::Rect, pixels_per_point: f32, size: [u32; 2]) -> Option<Rect> {
    let side = |i: usize| {
        let clamped = |at: f32| (at * pixels_per_point).round().clamp(0.0, size[i] as f32) as u32;
        let (min, max) = (clamped(points.min[i]), clamped(points.max[i]));
        (max > min).then_some((min, max - min))
    };
    let ((x, width), (y, height)) = (side(0)?, side(1)?);
    Some(Rect { corner: [x, y], size: [width, height] })
}

#[cfg(test)]
mod tests {
    use egui::epaint::Mesh;
    use egui::{Color32, pos2, vec2};

    use super::*;

    fn clipped(rect: egui::Rect, triangles: usize) -> ClippedPrimitive {
        let mut mesh = Mesh::default();
        (0..triangles).for_each(|_| mesh.add_colored_rect(rect, Color32::WHITE));
        ClippedPrimitive { clip_rect: rect, primitive: Primitive::Mesh(mesh) }
    }

    #[test]
    fn clip_rectangles_are_whole_pixels_inside_the_picture() {
        let rect = |x, y, w, h| egui::Rect::from_min_size(pos2(x, y), vec2(w, h));
        let inside = pixels(rect(10.0, 5.0, 20.0, 10.0), 2.0, [100, 100]).expect("a rectangle");
        assert_eq!((inside.corner, inside.size), ([20, 10], [40, 20]));
        let beyond = pixels(rect(-5.0, 40.0, 1e9, 1e9), 2.0, [100, 100]).expect("a rectangle");
        assert_eq!((beyond.corner, beyond.size), ([0, 80], [100, 20]));
        for outside in [rect(60.0, 0.0, 5.0, 5.0), rect(0.0, 0.0, 0.0, 5.0), rect(f32::NAN, 0.0, 5.0, 5.0)] {
            assert!(pixels(outside, 2.0, [100, 100]).is_none(), "{outside:?}");
        }
    }

    #[test]
    fn meshes_follow_each_other_and_too_many_are_cut() {
        let rect = egui::Rect::from_min_size(pos2(0.0, 0.0), vec2(10.0, 10.0));
        let ui = |sizes: &[usize]| UiFrame {
            primitives: sizes.iter().map(|count| clipped(rect, *count)).collect(),
            pixels_per_point: 1.0,
            ..UiFrame::default()
        };
        let (words, draws) = collect(&ui(&[1, 2]), [64, 64]);
        assert_eq!(words.len(), 3 * (6 + 4 * VERTEX_WORDS as usize));
        assert_eq!((draws[1].push.first_index, draws[1].push.first_vertex, draws[1].indices), (26, 38, 12));
        let (words, draws) = collect(&ui(&[1, 1 << 20, 1]), [64, 64]);
        assert_eq!((words.len(), draws.len()), (26, 1));
    }

    #[test]
    fn parts_replace_only_their_texels() {
        let mut image = ColorImage::filled([4, 3], Color32::BLACK);
        replace(&mut image, &ColorImage::filled([2, 2], Color32::WHITE), [1, 1]);
        let white: Vec<usize> = (0..12).filter(|i| image.pixels[*i] == Color32::WHITE).collect();
        assert_eq!(white, [5, 6, 9, 10]);
    }
}
