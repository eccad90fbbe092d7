//! After the first frames, recording and submitting takes no memory from the heap.

use std::path::Path;

use pbr_vr::asset::Report;
use pbr_vr::gpu::{CommandBuffer, Gpu, GpuOptions};
use pbr_vr::render::{Eye, FRAMES_IN_FLIGHT, IPD_METRES, Renderer, Settings, Shading};
use pbr_vr::scene::{self, LoadOptions};

#[test]
fn fifty_frames_are_recorded_and_submitted_without_an_allocation() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/demo.toml");
    let scene = scene::load(&scene, &LoadOptions::default(), &Report::silent()).expect("the demo scene");
    // The layer's own messages are not ours to count.
    let gpu = Gpu::open(GpuOptions::default()).expect("a GPU");
    let settings = Settings { samples: 1, ..Settings::default() };
    let mut renderer =
        Renderer::new(&gpu, &scene, settings, Shading::Pbr, [64, 64], 2, &Report::silent()).expect("a renderer");
    let mut recorders: Vec<CommandBuffer> =
        (0..FRAMES_IN_FLIGHT).map(|_| CommandBuffer::new(&gpu).expect("a recorder")).collect();
    let mut frame = |number: usize| {
        // The eye goes around, so that other draws are seen in another order.
        let turn = number as f32 * 0.3;
        let position = glam::Vec3::new(turn.sin(), 0.4, turn.cos());
        let eyes = Eye::looking(position, glam::Vec3::ZERO, 60.0, 1.0).stereo(IPD_METRES);
        let slot = number % FRAMES_IN_FLIGHT;
        let (mut commands, times) = recorders[slot].begin().expect("a command buffer");
        renderer.record(&mut commands, slot, &eyes, None);
        commands.submit(None).expect("a submission");
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
