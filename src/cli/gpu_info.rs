//! `hydrograd gpu-info`: the GPUs of this machine, and which one would be used.

use clap::Args;

use super::exit::Exit;
use super::options::Adapter;
use super::output::Output;
use crate::Result;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    adapter: Adapter,
}

/// Lists every adapter. One that can't be used as asked is a failure of the command as well.
#[cfg(feature = "gpu")]
pub(super) fn main(arguments: &Arguments, output: Output) -> Result<Exit> {
    let adapters = crate::gpu::adapters();
    let opened = crate::gpu::Context::new(&(&arguments.adapter.settings(false)).into());
    if adapters.is_empty() {
        // Its error says what to install.
        opened?;
        return Ok(Exit::Done);
    }
    output.result(&report::AdaptersReport::new(&adapters, &opened));
    let Err(error) = opened else {
        return Ok(Exit::Done);
    };
    output.error_for_people(&error);
    Ok(Exit::Failed)
}

#[cfg(not(feature = "gpu"))]
pub(super) fn main(_: &Arguments, _: Output) -> Result<Exit> {
    Err(crate::water::backend::not_built())
}

#[cfg(feature = "gpu")]
mod report {
    use std::fmt;
    use std::sync::Arc;

    use serde::Serialize;

    use crate::Result;
    use crate::gpu::{self, Context};
    use crate::simulate::Arithmetic;

    /// One adapter.
    #[derive(Debug, Serialize)]
    pub struct Adapter {
        name: String,
        driver: String,
        /// Vulkan, Metal or Dx12.
        interface: String,
        /// Discrete, integrated, virtual, or a CPU that stands for one.
        kind: String,
        /// Whether it computes in double precision.
        double: bool,
        /// Largest buffer that a shader can see, bytes.
        largest_buffer: u64,
        /// What it lacks; null if nothing.
        lacks: Option<String>,
    }

    /// What the backend gpu would run on.
    #[derive(Debug, Serialize)]
    pub struct Used {
        adapter: String,
        interface: String,
        arithmetic: Arithmetic,
    }

    /// The adapters of this machine.
    #[derive(Debug, Serialize)]
    pub struct AdaptersReport {
        adapters: Vec<Adapter>,
        /// Null where none can be used as asked.
        used: Option<Used>,
        /// Why not.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<String>,
    }

    impl AdaptersReport {
        pub fn new(adapters: &[gpu::Adapter], opened: &Result<Arc<Context>>) -> Self {
            let adapters = adapters.iter().cloned().map(|a| Adapter {
                name: a.name,
                driver: a.driver,
                interface: a.interface,
                kind: a.kind,
                double: a.double,
                largest_buffer: a.largest_binding,
                lacks: a.lacks,
            });
            Self {
                adapters: adapters.collect(),
                used: opened.as_ref().ok().map(|context| Used {
                    adapter: context.adapter().name.clone(),
                    interface: context.adapter().interface.clone(),
                    arithmetic: context.fine().into(),
                }),
                error: opened.as_ref().err().map(ToString::to_string),
            }
        }
    }

    impl fmt::Display for AdaptersReport {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            for a in &self.adapters {
                writeln!(f, "{}", a.name)?;
                writeln!(f, "  driver            {}", a.driver)?;
                writeln!(f, "  interface         {}", a.interface)?;
                writeln!(f, "  kind              {}", a.kind)?;
                let double = if a.double { "yes" } else { "no" };
                writeln!(f, "  double precision  {double}")?;
                let largest = a.largest_buffer as f64 / 1e6;
                writeln!(f, "  largest buffer    {largest:.0} MB")?;
                let lacks = a.lacks.as_deref().unwrap_or("nothing");
                writeln!(f, "  lacks             {lacks}")?;
            }
            match &self.used {
                Some(u) => write!(
                    f,
                    "used with --backend gpu: {} ({}), {}",
                    u.adapter, u.interface, u.arithmetic
                ),
                None => write!(f, "none can be used as asked"),
            }
        }
    }
}
