//! The forward pass: one pipeline per combination of what materials need, and the sky behind.

use std::collections::HashMap;
use std::mem::offset_of;
use std::sync::Arc;

use super::shared::{DrawBlock, constant};
use super::world::{Needs, World};
use super::{Settings, Shading, exact};
use crate::Result;
use crate::gpu::{Commands, Constant, Depth, Format, Gpu, GraphicsDesc, Pipeline, Set, SetLayout};
use crate::scene::Vertex;

/// Locations 0.. of `glsl/forward.vert`.
const ATTRIBUTES: [(Format, u32); 4] = [
    (Format::R32G32B32_SFLOAT, offset_of!(Vertex, position) as u32),
    (Format::R32G32B32_SFLOAT, offset_of!(Vertex, normal) as u32),
    (Format::R32G32_SFLOAT, offset_of!(Vertex, uv) as u32),
    (Format::R32G32B32A32_SFLOAT, offset_of!(Vertex, tangent) as u32),
];

/// The fragment stages and what they draw into: the picture itself, or samples for the exact one.
struct Stage {
    surface: &'static str,
    sky: &'static str,
    colour: Format,
    samples: u32,
}

impl Stage {
    fn new(settings: &Settings, shading: Shading) -> Self {
        if shading == Shading::Reference {
            return Self { surface: "exact.frag", sky: "exact_sky.frag", colour: exact::FORMAT, samples: 1 };
        }
        let (colour, samples) = (settings.output.format(), settings.samples);
        Self { surface: "forward.frag", sky: "sky.frag", colour, samples }
    }
}

/// Pipelines for one world and one group of settings.
pub struct Forward {
    materials: HashMap<Needs, Pipeline>,
    sky: Pipeline,
    eyes: u32,
}

impl Forward {
    /// Makes every pipeline that the world needs, and no other.
    pub fn new(
        gpu: &Arc<Gpu>,
        frame_layout: &SetLayout,
        world: &World,
        settings: &Settings,
        shading: Shading,
        eyes: u32,
    ) -> Result<Self> {
        let stage = Stage::new(settings, shading);
        let common: [Constant; 5] = [
            (constant::EYES, eyes),
            (constant::SHADING, shading as u32),
            (constant::GEOMETRY, settings.geometry as u32),
            (constant::LINEAR_OUTPUT, u32::from(settings.output == super::Output::Linear)),
            (constant::HAS_LIGHTS, u32::from(world.light_count > 0)),
        ];
        let mut materials = HashMap::new();
        for needs in world.draws.iter().map(|d| world.materials[d.material].needs) {
            if let std::collections::hash_map::Entry::Vacant(entry) = materials.entry(needs) {
                let sets = [frame_layout, &world.material_layout];
                entry.insert(material_pipeline(gpu, &sets, needs, &common, &stage)?);
            }
        }
        let sky = Pipeline::graphics(
            gpu,
            &GraphicsDesc {
                name: "sky",
                vertex: "sky.vert",
                fragment: stage.sky,
                constants: &common,
                sets: &[frame_layout],
                push_bytes: 0,
                vertex_stride: 0,
                vertex_attributes: &[],
                colour: stage.colour,
                depth: Depth::Test,
                samples: stage.samples,
                cull_back: false,
                blend: false,
            },
        )?;
        Ok(Self { materials, sky, eyes })
    }

    /// Draws all instances for all eyes.
    pub fn draw(&self, commands: &mut Commands<'_>, world: &World, frame: &Set) {
        commands.bind_mesh(&world.geometry.vertices, &world.geometry.indices);
        let mut bound: (Option<Needs>, Option<usize>) = (None, None);
        for draw in &world.draws {
            let material = &world.materials[draw.material];
            let Some(pipeline) = self.materials.get(&material.needs) else { continue };
            if bound.0 != Some(material.needs) {
                commands.bind(pipeline, &[frame]);
                bound = (Some(material.needs), None);
            }
            if bound.1 != Some(draw.material) {
                commands.bind_set(pipeline, 1, &material.set);
                bound.1 = Some(draw.material);
            }
            commands.push(pipeline, bytemuck::bytes_of(&DrawBlock::new(draw.world_from_local)));
            commands.draw_indexed(draw.range.indices.clone(), draw.range.first_vertex, self.eyes);
        }
    }

    /// Draws the panorama wherever nothing else is.
    pub fn draw_sky(&self, commands: &mut Commands<'_>, frame: &Set) {
        commands.bind(&self.sky, &[frame]);
        commands.draw(3, self.eyes);
    }
}

fn material_pipeline(
    gpu: &Arc<Gpu>,
    sets: &[&SetLayout],
    needs: Needs,
    common: &[Constant],
    stage: &Stage,
) -> Result<Pipeline> {
    let mut constants = common.to_vec();
    constants.extend([
        (constant::HAS_ALBEDO_MAP, u32::from(needs.albedo_map)),
        (constant::HAS_NORMAL_MAP, u32::from(needs.normal_map)),
        (constant::HAS_SURFACE_MAP, u32::from(needs.surface_map)),
        (constant::ALPHA_MASK, u32::from(needs.alpha_mask)),
    ]);
    Pipeline::graphics(
        gpu,
        &GraphicsDesc {
            name: "forward",
            vertex: "forward.vert",
            fragment: stage.surface,
            constants: &constants,
            sets,
            push_bytes: size_of::<DrawBlock>() as u32,
            vertex_stride: size_of::<Vertex>() as u32,
            vertex_attributes: &ATTRIBUTES,
            colour: stage.colour,
            depth: Depth::Write,
            samples: stage.samples,
            cull_back: false,
            blend: false,
        },
    )
}
