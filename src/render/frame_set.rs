//! Descriptor set 0 as passes bind it: the frame's uniform block and a pass's own storage.

use crate::gpu::{Commands, DescriptorSet, Pipeline};

/// Descriptor set 0 of one frame.
#[derive(Clone, Copy)]
pub struct FrameSet<'a> {
    pub set: &'a DescriptorSet,
    /// Offset of the `FrameBlock`.
    pub block: u32,
}

impl FrameSet<'_> {
    /// Binds a pipeline and the set; `storage` is the offset of the data that the pass has pushed, or 0.
    pub fn bind(&self, commands: &mut Commands<'_>, pipeline: &Pipeline, storage: u32) {
        commands.bind_pipeline(pipeline);
        commands.bind_set(pipeline, 0, self.set, &[self.block, storage]);
    }
}
