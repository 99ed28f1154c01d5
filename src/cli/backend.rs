//! Flags of what computes the coupling.

use clap::Args;

use super::list::choice;
use crate::simulate::{AdapterName, Arithmetic, Backend, GpuSettings};

/// Which GPU, and how.
#[derive(Clone, Debug, Args)]
pub(super) struct Adapter {
    /// Part of the GPU's name, in any case [default: the fastest there is].
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<AdapterName>,
    /// Arithmetic of residuals and derivatives on the GPU.
    #[arg(long, value_parser = choice::<Arithmetic>(), default_value = "auto")]
    pub gpu_arithmetic: Arithmetic,
}

/// What computes the coupling, and how.
#[derive(Clone, Debug, Args)]
pub(super) struct Compute {
    /// What computes the coupling.
    #[arg(long, value_parser = choice::<Backend>(), default_value = "cpu")]
    pub backend: Backend,
    #[command(flatten)]
    pub adapter: Adapter,
    /// Use the CPU where the GPU can't be opened, and say so.
    #[arg(long)]
    pub gpu_fallback: bool,
}

impl Adapter {
    pub fn settings(&self) -> GpuSettings {
        GpuSettings {
            adapter: self.adapter.clone(),
            arithmetic: self.gpu_arithmetic,
            fallback: false,
        }
    }
}

impl Compute {
    /// Choices of the GPU.
    pub fn settings(&self) -> GpuSettings {
        GpuSettings {
            fallback: self.gpu_fallback,
            ..self.adapter.settings()
        }
    }
}
