//! The descriptor sets that all passes of a bake read: frame, scene, and what rays meet.

use super::frame_set::FrameSet;
use crate::gpu::{Commands, DescriptorSet, Pipeline};

/// Sets 0, 1 and 3 of a pass of a bake; set 2 is its own.
#[derive(Clone, Copy)]
pub struct BakeSets<'a> {
    pub frame: FrameSet<'a>,
    pub scene: &'a DescriptorSet,
    pub rays: &'a DescriptorSet,
}

impl BakeSets<'_> {
    /// Binds them with the pass's `own` set.
    pub fn bind(&self, commands: &mut Commands<'_>, pipeline: &Pipeline, own: &DescriptorSet) {
        self.frame.bind(commands, pipeline, 0);
        commands.bind_set(pipeline, 1, self.scene, &[]);
        commands.bind_set(pipeline, 2, own, &[]);
        commands.bind_set(pipeline, 3, self.rays, &[]);
    }
}
