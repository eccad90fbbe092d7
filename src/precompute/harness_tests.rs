//! Helpers of tests: a GPU with validation, running a shader over a list of inputs, reading texels, comparing numbers.

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::Pod;
use glam::DVec3;
use half::f16;

use crate::gpu::{
    Binding, BindingType, Buffer, BufferKind, DescriptorSet, DescriptorSetLayout, Format, Gpu, Image, Pipeline,
    Subresource, read_buffer, read_image, submit_and_wait,
};

pub use crate::gpu::with_gpu;

/// The outputs of `tests/glsl/{shader}` for each input; both structs have scalar layout there.
pub fn evaluate<I: Pod, O: Pod>(gpu: &Arc<Gpu>, shader: &str, inputs: &[I]) -> Vec<O> {
    let from = Buffer::with_bytes(gpu, "inputs", BufferKind::FromCpu, bytemuck::cast_slice(inputs)).unwrap();
    let to = Buffer::new(gpu, "outputs", BufferKind::Storage, (size_of::<O>() * inputs.len()) as u64).unwrap();
    let layout = DescriptorSetLayout::new(gpu, shader, &[BindingType::Storage, BindingType::Storage]).unwrap();
    let set = DescriptorSet::new(gpu, shader, &layout, &[Binding::Storage(&from), Binding::Storage(&to)]).unwrap();
    let pipeline = Pipeline::compute(gpu, shader, &[], &[&layout], 0).unwrap();
    submit_and_wait(gpu, |commands| {
        commands.bind(&pipeline, &[&set]);
        commands.dispatch([inputs.len().div_ceil(64) as u32, 1, 1]);
        Ok(())
    })
    .unwrap();
    bytemuck::pod_collect_to_vec(&read_buffer(gpu, &to).unwrap())
}

/// One layer of one mip of an RGBA image in halves or floats, rows from the top.
pub fn texels(gpu: &Arc<Gpu>, image: &Image, part: Subresource) -> Vec<DVec3> {
    if image.desc().format == Format::R16G16B16A16_SFLOAT {
        let halves: Vec<[f16; 4]> = bytemuck::pod_collect_to_vec(&read_image(gpu, image, part, 8).unwrap());
        return halves.iter().map(|t| DVec3::new(t[0].to_f64(), t[1].to_f64(), t[2].to_f64())).collect();
    }
    assert_eq!(image.desc().format, Format::R32G32B32A32_SFLOAT);
    let floats: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&read_image(gpu, image, part, 16).unwrap());
    floats.iter().map(|t| DVec3::new(t[0].into(), t[1].into(), t[2].into())).collect()
}

/// Compares results of the GPU with the truth. When dropped, it prints for each quantity the largest share of its error
/// bound, and panics if that is above 1.
#[derive(Default)]
pub struct Judge(BTreeMap<&'static str, Worst>);

#[derive(Default)]
struct Worst {
    /// Error divided by bound.
    used: f64,
    case: String,
}

impl Judge {
    /// Expects every number of `got` to be finite and within `absolute + relative · |want|` of `want`.
    pub fn near(
        &mut self,
        what: &'static str,
        case: &dyn Debug,
        got: &[f32],
        want: &[f64],
        [absolute, relative]: [f64; 2],
    ) {
        assert_eq!(got.len(), want.len(), "{what}");
        let worst = self.0.entry(what).or_default();
        for (got, want) in got.iter().zip(want) {
            let error = (f64::from(*got) - want).abs();
            let bound = absolute + relative * want.abs();
            let used = match () {
                () if !got.is_finite() => f64::INFINITY,
                () if error == 0.0 => 0.0,
                () => error / bound,
            };
            if used > worst.used {
                *worst = Worst { used, case: format!("{got} is not {want}, for {case:?}") };
            }
        }
    }
}

impl Drop for Judge {
    fn drop(&mut self) {
        for (what, worst) in &self.0 {
            println!("{what}: at worst {:.2} of its bound", worst.used);
        }
        let failed: Vec<_> = self.0.iter().filter(|(_, worst)| worst.used > 1.0).collect();
        let describe =
            |(what, worst): &(&&str, &Worst)| format!("{what}: {:.2} of its bound: {}", worst.used, worst.case);
        let failures: Vec<_> = failed.iter().map(describe).collect();
        assert!(failures.is_empty() || std::thread::panicking(), "{}", failures.join("\n"));
    }
}

/// Pseudorandom numbers, the same in every run: Steele et al., "Fast Splittable Pseudorandom Number
/// Generators" (2014), figure 16.
pub struct Random(pub u64);

impl Random {
    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `end`.
    pub fn below(&mut self, end: u32) -> u32 {
        (self.bits() % u64::from(end)) as u32
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / 2f64.powi(53)
    }

    /// In [0, 1)³.
    pub fn colour(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// Evenly over the sphere.
    pub fn direction(&mut self) -> DVec3 {
        let (z, longitude) = (2.0 * self.unit() - 1.0, std::f64::consts::TAU * self.unit());
        let across = (1.0 - z * z).sqrt();
        DVec3::new(across * longitude.cos(), across * longitude.sin(), z)
    }
}
