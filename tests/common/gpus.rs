//! GPUs under validation that the tests of a process use in turn, with the pipelines that those before them made: creating a
//! pipeline takes a processor longer than what most tests do with it.

use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

use super::{Gpu, validated};

/// Tests after which a GPU is closed: the validation layer then tells what they have left behind.
const USES: u32 = 24;
/// Pipelines that are kept for tests to come: of more, hardly one is used again.
const PIPELINES: usize = 128;

/// Those that no test has, with how many had them.
static IDLE: Mutex<Vec<(Arc<Gpu>, u32)>> = Mutex::new(Vec::new());

/// A GPU that only one test has. When it is dropped, validation messages and objects that keep it open fail the test.
pub struct TestGpu {
    /// None once it is dropped.
    gpu: Option<Arc<Gpu>>,
    uses: u32,
}

impl TestGpu {
    /// One that another test has had, or else a new one.
    pub fn take() -> Self {
        let idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner).pop();
        idle.map_or_else(
            || Self::new(Gpu::open(validated()).expect("a GPU")),
            |(gpu, uses)| Self { gpu: Some(gpu), uses: uses + 1 },
        )
    }

    fn new(gpu: Arc<Gpu>) -> Self {
        gpu.keep_unused_pipelines(PIPELINES);
        Self { gpu: Some(gpu), uses: 1 }
    }
}

impl Deref for TestGpu {
    type Target = Arc<Gpu>;

    fn deref(&self) -> &Arc<Gpu> {
        self.gpu.as_ref().expect("not dropped")
    }
}

impl Drop for TestGpu {
    fn drop(&mut self) {
        let Some(gpu) = self.gpu.take().filter(|_| !std::thread::panicking()) else { return };
        gpu.messages().check().expect("no validation messages");
        gpu.wait_idle().expect("an idle GPU");
        if self.uses == USES {
            close(gpu);
        } else {
            assert_eq!(Arc::strong_count(&gpu), 1, "something keeps the GPU open");
            IDLE.lock().unwrap_or_else(PoisonError::into_inner).push((gpu, self.uses));
        }
    }
}

/// Closes a GPU; validation messages and objects that keep it open fail the test.
pub fn close(gpu: Arc<Gpu>) {
    let messages = gpu.messages();
    assert!(Arc::into_inner(gpu).is_some(), "something keeps the GPU open");
    messages.check().expect("no validation messages");
}
