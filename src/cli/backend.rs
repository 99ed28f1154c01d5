//! Flags of what computes the coupling.

use clap::{Args, ValueEnum};

use crate::simulate::{self, AdapterName, GpuSettings, Settings};

/// What computes the coupling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Backend {
    /// The processor.
    #[default]
    Cpu,
    /// A GPU, in builds with the feature gpu; `hydrograd gpu-info` lists them.
    Gpu,
}

/// Arithmetic of residuals and derivatives on the GPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Arithmetic {
    /// `double` where the GPU has it, `two-float` otherwise.
    #[default]
    Auto,
    /// Double precision.
    Double,
    /// Sums of two single-precision numbers, about 14 digits.
    TwoFloat,
}

/// Which GPU, and how.
#[derive(Clone, Debug, Args)]
pub(super) struct Adapter {
    /// Part of the GPU's name, in any case [default: the fastest there is].
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<AdapterName>,
    /// Arithmetic of residuals and derivatives on the GPU.
    #[arg(long, value_enum, default_value_t = Arithmetic::Auto)]
    pub gpu_arithmetic: Arithmetic,
}

/// What computes the coupling, and how.
#[derive(Clone, Debug, Args)]
pub(super) struct Compute {
    /// What computes the coupling.
    #[arg(long, value_enum, default_value_t = Backend::Cpu)]
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
            adapter: self.adapter,
            arithmetic: match self.gpu_arithmetic {
                Arithmetic::Auto => simulate::Arithmetic::Auto,
                Arithmetic::Double => simulate::Arithmetic::Double,
                Arithmetic::TwoFloat => simulate::Arithmetic::TwoFloat,
            },
            fallback: false,
        }
    }
}

impl Compute {
    /// Puts the choice into the settings.
    pub fn choose(&self, mut settings: Settings) -> Settings {
        settings.backend = match self.backend {
            Backend::Cpu => simulate::Backend::Cpu,
            Backend::Gpu => simulate::Backend::Gpu,
        };
        settings.gpu = GpuSettings {
            fallback: self.gpu_fallback,
            ..self.adapter.settings()
        };
        settings
    }
}
