//! The forward pass: one pipeline per combination of what materials need, and the sky behind.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Mat4;

use super::draws::DrawList;
use super::scene_resources::{ATTRIBUTES, PackedVertex, SceneResources};
use super::shared::{DrawBlock, constant};
use super::{Settings, Shading, reference_accumulator};
use crate::Result;
use crate::gpu::{
    Commands, Constant, DepthState, DescriptorSet, DescriptorSetLayout, Format, Gpu, GraphicsDesc, Pipeline,
};
use crate::reference::energy::Scattering;
use crate::reference::table::SplitSum;
use crate::scene::MaterialFeatures;

/// The fragment stages and what they draw into: the picture itself, or samples for the exact one.
struct ShaderSet {
    surface: &'static str,
    cutout: &'static str,
    sky: &'static str,
    colour: Format,
    samples: u32,
}

impl ShaderSet {
    fn new(settings: &Settings, shading: Shading) -> Self {
        if shading == Shading::Reference {
            return Self {
                surface: "exact.frag",
                cutout: "exact.frag",
                sky: "exact_sky.frag",
                colour: reference_accumulator::FORMAT,
                samples: 1,
            };
        }
        let (colour, samples) = (settings.output.format(), settings.samples);
        let cutout = if samples == 4 { "cutout.frag" } else { "forward.frag" };
        Self { surface: "forward.frag", cutout, sky: "sky.frag", colour, samples }
    }
}

/// Pipelines for one world and one group of settings.
pub struct Forward {
    materials: HashMap<MaterialFeatures, Pipeline>,
    sky: Pipeline,
    eyes: u32,
}

impl Forward {
    /// Makes every pipeline that the world needs, and no other.
    pub fn new(
        gpu: &Arc<Gpu>,
        frame_layout: &DescriptorSetLayout,
        world: &SceneResources,
        settings: &Settings,
        shading: Shading,
        eyes: u32,
    ) -> Result<Self> {
        let stage = ShaderSet::new(settings, shading);
        let common: [Constant; 6] = [
            (constant::EYES, eyes),
            (constant::SHADING, shading as u32),
            (constant::GEOMETRY, settings.geometry as u32),
            (constant::LINEAR_OUTPUT, u32::from(settings.output == super::Output::Linear)),
            (constant::SLICES, u32::from(settings.split_sum == SplitSum::Slices)),
            // Below 0 the shader asks the frame.
            (constant::LIGHTS, world.lights_needed.map_or(u32::MAX, |count| count)),
        ];
        let multiple = settings.scattering == Scattering::Multiple;
        let mut materials = HashMap::new();
        for needs in world.draws.iter().map(|d| world.materials[d.material].needs) {
            if let std::collections::hash_map::Entry::Vacant(entry) = materials.entry(needs) {
                let sets = [frame_layout, &world.material_layout];
                entry.insert(material_pipeline(gpu, &sets, needs, multiple, &common, &stage)?);
            }
        }
        let sky = Pipeline::graphics(
            gpu,
            &GraphicsDesc {
                name: "sky",
                vertex: "sky.vert",
                fragment: Some(stage.sky),
                constants: &common,
                sets: &[frame_layout],
                push_bytes: 0,
                vertex_stride: 0,
                vertex_attributes: &[],
                colours: &[stage.colour],
                depth: Some(DepthState::TEST),
                samples: stage.samples,
                blend: false,
            },
        )?;
        Ok(Self { materials, sky, eyes })
    }

    /// Draws what is listed for all eyes, moved together by a rigid `models`, setting only what changes from draw to draw.
    pub fn draw(
        &self,
        commands: &mut Commands<'_>,
        world: &SceneResources,
        models: Mat4,
        list: &DrawList,
        frame: &DescriptorSet,
    ) {
        commands.bind_mesh(&world.geometry.vertices, &world.geometry.indices);
        let (mut pipeline, mut needs, mut material, mut placed) = (None, None, None, None);
        let mut cull_back = false;
        for listed in list.iter() {
            let draw = &world.draws[listed.draw as usize];
            if material != Some(draw.material) {
                let next = &world.materials[draw.material];
                if needs != Some(next.needs) {
                    pipeline = self.materials.get(&next.needs);
                    needs = Some(next.needs);
                    // Another pipeline's layout may keep neither sets nor push constants.
                    pipeline.iter().for_each(|pipeline| commands.bind(pipeline, &[frame]));
                    placed = None;
                }
                pipeline.iter().for_each(|pipeline| commands.bind_set(pipeline, 1, &next.set, &[]));
                material = Some(draw.material);
            }
            let Some(pipeline) = pipeline else { continue };
            if placed != Some(draw.world_from_local) {
                commands.push(pipeline, bytemuck::bytes_of(&DrawBlock::new(models * draw.world_from_local)));
                placed = Some(draw.world_from_local);
            }
            if cull_back != listed.cull_back {
                commands.cull_back(listed.cull_back);
                cull_back = listed.cull_back;
            }
            commands.draw_indexed(draw.range.indices.clone(), draw.range.first_vertex, self.eyes);
        }
        commands.cull_back(false);
    }

    /// Draws the panorama wherever nothing else is.
    pub fn draw_sky(&self, commands: &mut Commands<'_>, frame: &DescriptorSet) {
        commands.bind(&self.sky, &[frame]);
        commands.draw(3, self.eyes);
    }
}

fn material_pipeline(
    gpu: &Arc<Gpu>,
    sets: &[&DescriptorSetLayout],
    needs: MaterialFeatures,
    multiple: bool,
    common: &[Constant],
    stage: &ShaderSet,
) -> Result<Pipeline> {
    let mut constants = common.to_vec();
    constants.extend([
        (constant::HAS_BASE_COLOR_MAP, u32::from(needs.base_color_map)),
        (constant::HAS_NORMAL_MAP, u32::from(needs.normal_map)),
        (constant::HAS_ORM_MAP, u32::from(needs.orm_map)),
        (constant::ALPHA_MASK, u32::from(needs.alpha_mask)),
        (constant::METALNESS, needs.metalness as u32),
        (constant::MULTI_SCATTER, u32::from(multiple && needs.multi_scatter)),
    ]);
    Pipeline::graphics(
        gpu,
        &GraphicsDesc {
            name: "forward",
            vertex: "forward.vert",
            fragment: Some(if needs.alpha_mask { stage.cutout } else { stage.surface }),
            constants: &constants,
            sets,
            push_bytes: size_of::<DrawBlock>() as u32,
            vertex_stride: size_of::<PackedVertex>() as u32,
            vertex_attributes: &ATTRIBUTES,
            colours: &[stage.colour],
            depth: Some(DepthState::WRITE),
            samples: stage.samples,
            blend: false,
        },
    )
}
