//! What a user may choose about the machine that computes the coupling, and what became of it.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

choices! {
    /// What computes the coupling, whatever the fidelity.
    pub enum Backend {
        /// The processor, in double precision.
        #[default]
        Cpu,
        /// A GPU, in builds with the feature gpu; `hydrograd gpu-info` lists them. The fidelity `isolated` has nothing to compute
        /// there and stays on the CPU.
        Gpu,
    }
}

choices! {
    /// Arithmetic of residuals and derivatives on the GPU.
    pub enum Arithmetic {
        /// `double` where the GPU has it, `two-float` otherwise.
        #[default]
        Auto,
        /// Double precision.
        Double,
        /// Sums of two single-precision numbers, about 14 digits.
        TwoFloat,
    }
}

/// Choices of the backend `gpu`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct GpuSettings {
    /// Part of the adapter's name; default: the fastest there is.
    pub adapter: Option<AdapterName>,
    /// Arithmetic of residuals and derivatives.
    pub arithmetic: Arithmetic,
    /// Whether the CPU takes over where the GPU can't be opened, or fails while the bodies are set up. A
    /// GPU that fails later, on the way, is an error all the same.
    pub fallback: bool,
}

/// Part of an adapter's name, in any case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct AdapterName(String);

impl AdapterName {
    /// As text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for AdapterName {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.trim() {
            "" => Err(Error::input(
                "adapter",
                format!("{text:?}"),
                "give part of the adapter's name",
            )),
            name => Ok(Self(name.into())),
        }
    }
}

impl TryFrom<String> for AdapterName {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl From<AdapterName> for String {
    fn from(name: AdapterName) -> Self {
        name.0
    }
}

/// What computes the coupling of a simulator, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BackendReport {
    /// What was asked for.
    pub backend: Backend,
    /// What computes.
    pub backend_used: Backend,
    /// Why that isn't what was asked for; `None` where it is.
    pub backend_reason: Option<String>,
    /// Whether steps with films in their gaps are computed on the CPU all the same.
    pub films_on_cpu: bool,
    /// The GPU in use.
    pub device: Option<DeviceReport>,
}

/// A GPU in use, and what was done on it since its simulator opened it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceReport {
    /// The adapter's name.
    pub adapter: String,
    /// Its driver.
    pub driver: String,
    /// The interface it is reached by.
    pub interface: String,
    /// Arithmetic of residuals and derivatives: not `Auto`.
    pub arithmetic: Arithmetic,
    /// Most memory held there at once, bytes.
    pub peak_memory: u64,
    /// Shaders started.
    pub dispatches: u64,
    /// Times that the CPU waited for numbers.
    pub read_backs: u64,
    /// Bytes that came back.
    pub bytes_back: u64,
}

impl fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Double => "double precision",
            Self::TwoFloat => "two-float",
        })
    }
}

impl fmt::Display for BackendReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(d) = &self.device else {
            return f.write_str(match self.backend {
                Backend::Cpu => "cpu",
                // The reason is among the warnings.
                Backend::Gpu => "cpu, for all that gpu was asked for",
            });
        };
        write!(
            f,
            "gpu: {} ({}), {}; peak memory {:.1} MB, {} dispatches, {} read-backs{}",
            d.adapter,
            d.interface,
            d.arithmetic,
            d.peak_memory as f64 / 1e6,
            d.dispatches,
            d.read_backs,
            match self.films_on_cpu {
                true => "; where gaps have films, the water is computed on the CPU",
                false => "",
            }
        )
    }
}

/// What a build without the feature says.
#[cfg(not(feature = "gpu"))]
pub(crate) fn not_built() -> Error {
    Error::Unsupported {
        what: "the backend gpu".into(),
        why: "this build is without the feature gpu".into(),
        instead: "build with it (cargo build --release --features gpu; the Python package has it), or use the backend cpu"
            .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_adapters_are_kept() {
        let name: AdapterName = " GeForce é ".parse().unwrap();
        assert_eq!(name.as_str(), "GeForce é");
        let long = "x".repeat(65);
        assert_eq!(long.parse::<AdapterName>().unwrap().as_str(), long);
        for wrong in ["", "  "] {
            let message = wrong.parse::<AdapterName>().unwrap_err().to_string();
            assert!(message.contains("part of the adapter's name"), "{message}");
        }
    }

    #[test]
    fn settings_survive_a_round_trip() {
        let text = r#"{"adapter":"llvmpipe","arithmetic":"two-float","fallback":true}"#;
        let settings: GpuSettings = serde_json::from_str(text).unwrap();
        assert_eq!(settings.arithmetic, Arithmetic::TwoFloat);
        assert_eq!(serde_json::to_string(&settings).unwrap(), text);
        let empty: GpuSettings = serde_json::from_str("{}").unwrap();
        assert_eq!(empty, GpuSettings::default());
        assert!(serde_json::from_str::<GpuSettings>(r#"{"adaptor":"x"}"#).is_err());
    }
}
