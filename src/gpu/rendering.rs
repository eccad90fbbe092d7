//! Rendering: the attachments that draws write to, and how they are loaded and stored.

use ash::vk;

use super::commands::{Commands, Cull};
use super::copies::Rect;
use super::image::{AttachmentView, ImageAccess};

/// Colour attachments: every GPU allows four.
const MAX_COLOURS: usize = 4;

/// The attachments of one rendering. All views have the same number of layers.
pub struct Attachments<'a> {
    /// At most four; none for depth only.
    pub colours: &'a [ColourAttachment<'a>],
    pub depth: Option<DepthAttachment<'a>>,
    /// Only this many pixels from the upper left corner are drawn, cleared and stored; the rest is left as it is.
    pub area: [u32; 2],
}

/// An image prepared for [`ImageAccess::Colour`], and its content before and after the draws.
#[derive(Clone, Copy)]
pub struct ColourAttachment<'a> {
    pub view: AttachmentView<'a>,
    pub load: LoadOp<[f32; 4]>,
    pub store: StoreOp,
    /// A single-sample view that the multisampled one is averaged to; prepared in the same way.
    pub resolve: Option<AttachmentView<'a>>,
}

/// An image prepared for [`ImageAccess::Depth`], and its content before and after the draws.
#[derive(Clone, Copy)]
pub struct DepthAttachment<'a> {
    pub view: AttachmentView<'a>,
    pub load: LoadOp<f32>,
    pub store: StoreOp,
}

/// Content of an attachment before the first draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadOp<T> {
    Clear(T),
    /// The content of before.
    Load,
    /// Undefined: every pixel is drawn.
    DontCare,
}

/// Content of an attachment after the last draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreOp {
    Store,
    /// Undefined: nothing reads it.
    DontCare,
}

impl<'a> ColourAttachment<'a> {
    /// Cleared before, stored after.
    pub fn cleared(view: AttachmentView<'a>, colour: [f32; 4]) -> Self {
        Self { view, load: LoadOp::Clear(colour), store: StoreOp::Store, resolve: None }
    }

    /// Drawn over.
    pub fn loaded(view: AttachmentView<'a>) -> Self {
        Self { view, load: LoadOp::Load, store: StoreOp::Store, resolve: None }
    }

    /// The same, multisampled: only the average of the samples is stored, in `resolve`.
    pub fn resolved_to(self, resolve: AttachmentView<'a>) -> Self {
        Self { store: StoreOp::DontCare, resolve: Some(resolve), ..self }
    }
}

impl<'a> DepthAttachment<'a> {
    /// Cleared to the far plane of reversed depth before, not needed after.
    pub fn transient(view: AttachmentView<'a>) -> Self {
        Self { view, load: LoadOp::Clear(0.0), store: StoreOp::DontCare }
    }

    /// Cleared to `depth` before, stored after.
    pub fn cleared(view: AttachmentView<'a>, depth: f32) -> Self {
        Self { view, load: LoadOp::Clear(depth), store: StoreOp::Store }
    }
}

impl<T: Copy> LoadOp<T> {
    fn raw(self) -> vk::AttachmentLoadOp {
        match self {
            Self::Clear(_) => vk::AttachmentLoadOp::CLEAR,
            Self::Load => vk::AttachmentLoadOp::LOAD,
            Self::DontCare => vk::AttachmentLoadOp::DONT_CARE,
        }
    }

    fn value(self) -> Option<T> {
        if let Self::Clear(value) = self { Some(value) } else { None }
    }
}

impl StoreOp {
    fn raw(self) -> vk::AttachmentStoreOp {
        match self {
            Self::Store => vk::AttachmentStoreOp::STORE,
            Self::DontCare => vk::AttachmentStoreOp::DONT_CARE,
        }
    }
}

impl ColourAttachment<'_> {
    fn info(&self) -> vk::RenderingAttachmentInfo<'static> {
        let (layout, ..) = ImageAccess::Colour.parts();
        let float32 = self.load.value().unwrap_or_default();
        let info = vk::RenderingAttachmentInfo::default()
            .image_view(self.view.raw)
            .image_layout(layout)
            .load_op(self.load.raw())
            .store_op(self.store.raw())
            .clear_value(vk::ClearValue { color: vk::ClearColorValue { float32 } });
        let Some(resolve) = self.resolve else { return info };
        info.resolve_mode(vk::ResolveModeFlags::AVERAGE).resolve_image_view(resolve.raw).resolve_image_layout(layout)
    }
}

impl DepthAttachment<'_> {
    fn info(&self) -> vk::RenderingAttachmentInfo<'static> {
        let depth = self.load.value().unwrap_or_default();
        vk::RenderingAttachmentInfo::default()
            .image_view(self.view.raw)
            .image_layout(ImageAccess::Depth.parts().0)
            .load_op(self.load.raw())
            .store_op(self.store.raw())
            .clear_value(vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth, stencil: 0 } })
    }
}

impl Commands<'_> {
    /// Draws into attachments, which must have been prepared. Sets the viewport to their area, and culls nothing.
    ///
    /// # Panics
    /// Without attachments, or with more than four colours or different numbers of layers: a defect of the caller.
    pub fn render(&mut self, attachments: &Attachments<'_>, record: impl FnOnce(&mut Self)) {
        let Attachments { colours, depth, area: [width, height] } = *attachments;
        let views = || colours.iter().map(|c| c.view).chain(depth.map(|d| d.view));
        let layers = views().next().map_or(0, |view| view.layers);
        assert!(layers > 0 && colours.len() <= MAX_COLOURS && views().all(|v| v.layers == layers), "attachments");
        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } };
        let mut infos = [vk::RenderingAttachmentInfo::default(); MAX_COLOURS];
        infos.iter_mut().zip(colours).for_each(|(info, colour)| *info = colour.info());
        let depth = depth.map(|depth| depth.info());
        let mut info = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(layers)
            .color_attachments(&infos[..colours.len()]);
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        let viewport =
            vk::Viewport { width: width as f32, height: height as f32, max_depth: 1.0, ..Default::default() };
        // SAFETY: the command buffer is being recorded; views, layouts and sizes are those of the attachments.
        unsafe {
            self.device().cmd_begin_rendering(self.buffer.raw, &info);
            self.device().cmd_set_viewport(self.buffer.raw, 0, &[viewport]);
            self.device().cmd_set_scissor(self.buffer.raw, 0, &[area]);
        }
        self.cull(Cull::Nothing);
        record(self);
        // SAFETY: rendering was begun above.
        unsafe { self.device().cmd_end_rendering(self.buffer.raw) };
    }

    /// Draws only the pixels of a rectangle inside the attachments' area, until `render` ends.
    pub fn scissor(&mut self, Rect { corner: [x, y], size: [width, height] }: Rect) {
        // Images have at most 2^15 pixels a side on any GPU.
        let offset = vk::Offset2D { x: x as i32, y: y as i32 };
        let area = vk::Rect2D { offset, extent: vk::Extent2D { width, height } };
        // SAFETY: the command buffer is being recorded; every graphics pipeline has this state dynamic.
        unsafe { self.device().cmd_set_scissor(self.buffer.raw, 0, &[area]) };
    }
}
