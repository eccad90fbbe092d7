//! placeholder, not committed
pub fn run(_: &super::ViewRequest<'_>, _: crate::gpu::GpuOptions<'_>) -> crate::Result<()> {
    Err(crate::Error::Window { problem: "none".into() })
}
