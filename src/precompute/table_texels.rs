//! The split sum's table read back from the GPU, with the lookups of the shaders.

use std::sync::Arc;

use super::BrdfTable;
use crate::Result;
use crate::gpu::{Gpu, Subresource, read_image};
use crate::reference::table::{Entry, Lobe, LobePart, table_place};

/// The table at n·v and a roughness.
#[derive(Clone, Copy, Debug)]
pub struct TableAt {
    pub lobe: Lobe,
    /// Both albedos averaged over directions.
    pub mean: Entry,
}

/// A [`BrdfTable`]'s texels.
pub struct TableTexels {
    layers: Vec<Vec<[f32; 4]>>,
    size: [usize; 2],
}

impl TableTexels {
    /// Reads the table back.
    ///
    /// # Errors
    /// No memory, or a failed Vulkan call.
    pub fn read(gpu: &Arc<Gpu>, table: &BrdfTable) -> Result<Self> {
        let layer = |layer| {
            Ok(bytemuck::pod_collect_to_vec(&read_image(gpu, &table.image, Subresource { mip: 0, layer }, 16)?))
        };
        let layers = (0..table.image.desc().shape.layers()).map(layer).collect::<Result<_>>()?;
        Ok(Self { layers, size: table.image.desc().size.map(|side| side as usize) })
    }

    /// Bilinear between texels, as `glsl/environment.glsl` reads it.
    pub fn look_up(&self, nv: f64, roughness: f64) -> TableAt {
        let place = table_place(nv, roughness);
        let value = |layer: usize, channel: usize| self.value(place, layer, channel);
        let part = |weight, along: f64, across_over_sine| LobePart { weight, along: along.powi(2), across_over_sine };
        let whole = |i| part(value(0, i), value(0, 2 + i), value(1, i));
        let lobe = Lobe { base: whole(0), fresnel: whole(1) };
        let mean = Entry { scale: value(1, 2), bias: value(1, 3) };
        TableAt { lobe, mean }
    }

    fn value(&self, place: [f64; 2], layer: usize, channel: usize) -> f64 {
        let at: [f64; 2] = std::array::from_fn(|i| place[i].clamp(0.0, 1.0) * (self.size[i] - 1) as f64);
        let low: [usize; 2] = std::array::from_fn(|i| (at[i] as usize).min(self.size[i] - 2));
        let [u, v] = std::array::from_fn(|i| at[i] - low[i] as f64);
        let texel =
            |x: usize, y: usize| f64::from(self.layers[layer][(low[1] + y) * self.size[0] + low[0] + x][channel]);
        let row = |y| texel(0, y) * (1.0 - u) + texel(1, y) * u;
        row(0) * (1.0 - v) + row(1) * v
    }
}
