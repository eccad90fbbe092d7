//! The pipelines, descriptor sets and maps of one method; can run repeatedly, to be timed.

use std::sync::Arc;

use super::environment::{Environment, cube};
use super::{Method, Target};
use crate::Result;
use crate::gpu::{
    AddressMode, Binding, BindingType, Buffer, BufferKind, DescriptorSet, DescriptorSetLayout, Gpu, Image, ImageAccess,
    PassTime, Pipeline, Sampler, submit_and_wait,
};

/// Face size of the mip that harmonics are projected from: the error by the texels' size is below 0.2 % at degree 8.
const PROJECTED_SIZE: u32 = 64;

/// A method for one environment; fills a cube for each target.
pub struct AlternativePass<'a> {
    environment: &'a Environment,
    /// Access of the steps to the environment.
    reads: ImageAccess,
    pipelines: Vec<Pipeline>,
    steps: Vec<Step>,
    /// One map per target: radiance, or irradiance over π, both divided by the environment's scale.
    pub cubes: Vec<Arc<Image>>,
    sampler: Arc<Sampler>,
}

/// One dispatch.
struct Step {
    pipeline: usize,
    set: DescriptorSet,
    push: Vec<u8>,
    groups: [u32; 3],
    /// Whether it reads a buffer that the step before wrote.
    waits: bool,
}

impl<'a> AlternativePass<'a> {
    /// Creates everything that `method` needs to fill `targets` from `environment`.
    ///
    /// # Errors
    /// No memory, or a failed Vulkan call.
    pub fn new(gpu: &Arc<Gpu>, environment: &'a Environment, method: Method, targets: &[Target]) -> Result<Self> {
        let cubes =
            targets.iter().map(|target| cube(gpu, method.name(), target.size, 1)).collect::<Result<Vec<_>>>()?;
        let sampler = Sampler::new(gpu, "cube", AddressMode::Clamp, 1)?;
        let reads =
            if matches!(method, Method::Harmonics { .. }) { ImageAccess::Storage } else { ImageAccess::Sampled };
        let mut pass = Self { environment, reads, pipelines: Vec::new(), steps: Vec::new(), cubes, sampler };
        match method {
            Method::MonteCarlo { log2_samples } => pass.sample_lobes(gpu, log2_samples, false, targets)?,
            Method::FilteredSampling { log2_samples } => pass.sample_lobes(gpu, log2_samples, true, targets)?,
            Method::FixedStep { step_radians, with_sine } => pass.step_over_angles(gpu, step_radians, with_sine)?,
            Method::Harmonics { order } => pass.harmonics(gpu, order)?,
        }
        Ok(pass)
    }

    /// Fills the maps and waits; returns the GPU time of the pass.
    ///
    /// # Errors
    /// A failed Vulkan call.
    pub fn run(&self, gpu: &Arc<Gpu>) -> Result<Vec<PassTime>> {
        submit_and_wait(gpu, |commands| {
            commands.prepare(&self.environment.cube, self.reads);
            self.cubes.iter().for_each(|cube| commands.prepare(cube, ImageAccess::Storage));
            commands.pass("alternative", |commands| {
                for step in &self.steps {
                    if step.waits {
                        commands.buffers_written();
                    }
                    let pipeline = &self.pipelines[step.pipeline];
                    commands.bind(pipeline, &[&step.set]);
                    if !step.push.is_empty() {
                        commands.push(pipeline, &step.push);
                    }
                    commands.dispatch(step.groups);
                }
            });
            self.cubes.iter().for_each(|cube| commands.prepare(cube, ImageAccess::Sampled));
            Ok(())
        })
    }

    fn sample_lobes(&mut self, gpu: &Arc<Gpu>, log2_samples: u32, filtered: bool, targets: &[Target]) -> Result<()> {
        let layout = DescriptorSetLayout::new(gpu, "lobe samples", &[BindingType::Sampled, BindingType::StorageImage])?;
        let constants = [(0, log2_samples), (1, u32::from(filtered))];
        self.pipelines.push(Pipeline::compute(gpu, "alternative_specular.comp", &constants, &[&layout], 4)?);
        for (cube, target) in self.cubes.iter().zip(targets) {
            let bindings = [Binding::Sampled(&self.environment.cube, &self.sampler), Binding::StorageImage(cube, 0)];
            let set = DescriptorSet::new(gpu, "lobe samples", &layout, &bindings)?;
            let push = (target.alpha as f32).to_ne_bytes().to_vec();
            self.steps.push(Step { pipeline: 0, set, push, groups: groups(cube), waits: false });
        }
        Ok(())
    }

    fn step_over_angles(&mut self, gpu: &Arc<Gpu>, step_radians: f32, with_sine: bool) -> Result<()> {
        let layout = DescriptorSetLayout::new(gpu, "fixed step", &[BindingType::Sampled, BindingType::StorageImage])?;
        let constants = [(0, u32::from(with_sine))];
        self.pipelines.push(Pipeline::compute(gpu, "alternative_fixed_step.comp", &constants, &[&layout], 12)?);
        let count = |range: f64| (range / f64::from(step_radians)).ceil().max(1.0) as u32;
        let (thetas, phis) = (count(std::f64::consts::FRAC_PI_2), count(std::f64::consts::TAU));
        let push = [step_radians.to_ne_bytes(), thetas.to_ne_bytes(), phis.to_ne_bytes()].concat();
        for cube in &self.cubes {
            let bindings = [Binding::Sampled(&self.environment.cube, &self.sampler), Binding::StorageImage(cube, 0)];
            let set = DescriptorSet::new(gpu, "fixed step", &layout, &bindings)?;
            self.steps.push(Step { pipeline: 0, set, push: push.clone(), groups: groups(cube), waits: false });
        }
        Ok(())
    }

    fn harmonics(&mut self, gpu: &Arc<Gpu>, order: u32) -> Result<()> {
        let count = (order + 1) * (order + 1);
        let coefficients = Buffer::new(gpu, "harmonics", BufferKind::Storage, 16 * u64::from(count))?;
        let size = self.environment.cube.desc().size[0];
        let mip = size.ilog2().saturating_sub(PROJECTED_SIZE.ilog2()) as usize;
        let layout = DescriptorSetLayout::new(gpu, "projection", &[BindingType::StorageImage, BindingType::Storage])?;
        self.pipelines.push(Pipeline::compute(gpu, "alternative_project.comp", &[], &[&layout], 0)?);
        let bindings = [Binding::StorageImage(&self.environment.cube, mip), Binding::Storage(&coefficients)];
        let set = DescriptorSet::new(gpu, "projection", &layout, &bindings)?;
        self.steps.push(Step { pipeline: 0, set, push: Vec::new(), groups: [count, 1, 1], waits: false });

        let layout = DescriptorSetLayout::new(gpu, "harmonics", &[BindingType::Storage, BindingType::StorageImage])?;
        self.pipelines.push(Pipeline::compute(gpu, "alternative_harmonics.comp", &[(0, order)], &[&layout], 0)?);
        for cube in &self.cubes {
            let bindings = [Binding::Storage(&coefficients), Binding::StorageImage(cube, 0)];
            let set = DescriptorSet::new(gpu, "harmonics", &layout, &bindings)?;
            self.steps.push(Step { pipeline: 1, set, push: Vec::new(), groups: groups(cube), waits: true });
        }
        Ok(())
    }
}

fn groups(cube: &Image) -> [u32; 3] {
    let across = cube.desc().size[0].div_ceil(8);
    [across, across, 6]
}
