//! The context of every command (GPU, cache on disk, report), and the command-line options that open it.

use std::sync::Arc;

use clap::Args;

use crate::Result;
use crate::asset::{Cache, Report};
use crate::gpu::{Gpu, GpuOptions};

/// Options of every command.
#[derive(Args, Clone, Debug, Default)]
pub struct GlobalOptions {
    /// Use the GPU whose name contains this.
    #[arg(long, global = true, value_name = "NAME")]
    pub gpu: Option<String>,
    /// Have every Vulkan call checked; any message is a failure.
    #[arg(long, global = true)]
    pub validate: bool,
    /// Compute all light again, and keep nothing for the next start.
    #[arg(long, global = true)]
    pub no_cache: bool,
    /// Say more; twice, much more.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
}

impl GlobalOptions {
    /// The setup that these options ask for; warnings and progress go to the terminal.
    pub fn setup(&self) -> Setup<'_> {
        Setup {
            gpu: GpuOptions { name: self.gpu.as_deref(), validate: self.validate, ..GpuOptions::default() },
            cache: if self.no_cache { None } else { Cache::of_user() },
            report: Arc::new(Report::to_terminal()),
        }
    }
}

/// How a [`Context`] is opened.
#[derive(Clone)]
pub struct Setup<'a> {
    pub gpu: GpuOptions<'a>,
    /// `None` computes and compresses at each start.
    pub cache: Option<Cache>,
    pub report: Arc<Report>,
}

impl<'a> Setup<'a> {
    /// Without a cache; warnings are collected but not printed.
    pub fn silent(gpu: GpuOptions<'a>) -> Self {
        Self { gpu, cache: None, report: Arc::new(Report::silent()) }
    }

    /// Opens the GPU.
    ///
    /// # Errors
    /// There is no usable GPU.
    pub fn open(&self) -> Result<Context> {
        Ok(self.with(&Gpu::open(self.gpu)?))
    }

    /// A context for a GPU that is already open.
    pub fn with(&self, gpu: &Arc<Gpu>) -> Context {
        Context { gpu: Arc::clone(gpu), cache: self.cache.clone(), report: Arc::clone(&self.report) }
    }
}

/// An open GPU, the cache and the report; shared by everything that loads, precomputes and draws.
#[derive(Clone)]
pub struct Context {
    pub gpu: Arc<Gpu>,
    /// Where precomputed light, compressed textures and pipelines are kept between runs.
    pub cache: Option<Cache>,
    pub report: Arc<Report>,
}

impl Context {
    /// Without a cache; warnings are collected but not printed.
    pub fn silent(gpu: &Arc<Gpu>) -> Self {
        Setup::silent(GpuOptions::default()).with(gpu)
    }
}
