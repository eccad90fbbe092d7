//! After the first frames, recording and submitting takes no memory from the heap.

use pbr_vr::context::Context;
use pbr_vr::gpu::{FrameRing, Gpu, GpuOptions};
use pbr_vr::render::{
    ControllerGizmos, Eye, FRAME_BYTES, FrameInputs, IPD_METRES, LightModel, RenderSettings, Renderer,
};

use crate::common::stage::{scene, shipped};

#[test]
fn fifty_frames_are_recorded_and_submitted_without_an_allocation() {
    let scene = scene(&shipped("demo.toml"));
    // The layer's own messages are not ours to count.
    let gpu = Gpu::open(GpuOptions::default()).expect("a GPU");
    let settings = RenderSettings { samples: 1, light: LightModel::Direct, ..RenderSettings::default() };
    let mut renderer = Renderer::new(&Context::silent(&gpu), &scene, settings, [64, 64], 2).expect("a renderer");
    let mut ring = FrameRing::new(&gpu, FRAME_BYTES).expect("a ring");
    let mut gizmos = ControllerGizmos::default();
    gizmos.wand(&glam::Mat4::IDENTITY, glam::Vec3::ONE);
    let mut frame = |number: usize| {
        // The eye goes around, so that other draws are seen in another order.
        let turn = number as f32 * 0.3;
        let position = glam::Vec3::new(turn.sin(), 0.4, turn.cos());
        let eyes = Eye::looking(position, glam::Vec3::ZERO, 60.0, 1.0).stereo(IPD_METRES);
        let mut frame = ring.begin().expect("a frame");
        let times = frame.finished;
        let inputs = FrameInputs { gizmos: Some(&gizmos), ..FrameInputs::of(&scene, &eyes) };
        renderer.record(&mut frame, &inputs).expect("a recorded frame");
        frame.submit(None).expect("a submission");
        times.iter().map(|time| time.ms).sum::<f64>()
    };
    let _warm_up: f64 = (0..4).map(&mut frame).sum();
    let mut gpu_ms = 0.0;
    let counts = allocation_counter::measure(|| gpu_ms = (4..54).map(&mut frame).sum::<f64>());
    assert!(gpu_ms > 0.0, "nothing was drawn");
    assert_eq!((counts.count_total, counts.bytes_total), (0, 0), "allocations and bytes in 50 frames");
    let control = allocation_counter::measure(|| drop(std::hint::black_box(vec![1u8; 100])));
    assert_eq!(control.count_total, 1, "nothing is counted");
}
