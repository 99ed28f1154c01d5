//! The device: what it is, its limits, its faults, its counters.

use super::pipeline::Kernel;
use super::pool::{Counts, Pool};
use super::source::{Arithmetic, Constant};
use crate::{Error, Result};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Storage buffers that the largest shader binds.
const STORAGE_BUFFERS: u32 = 12;
/// Bytes of workgroup memory that the largest shader takes.
const WORKGROUP_BYTES: u32 = 20 << 10;
/// Threads of the largest workgroup.
const THREADS: u32 = 256;

/// What to run on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Part of the adapter's name, in any case; `None` for the fastest there is.
    pub adapter: Option<String>,
    /// Arithmetic of residuals and derivatives; `None` for double precision where the adapter has it,
    /// two-float numbers otherwise.
    pub fine: Option<Arithmetic>,
}

/// What an adapter is and can do.
#[derive(Clone, Debug, PartialEq)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// Its driver.
    pub driver: String,
    /// The interface it is reached by: Vulkan, Metal, Dx12.
    pub interface: String,
    /// Discrete, integrated, virtual, or a CPU that stands for one.
    pub kind: String,
    /// Whether it computes in double precision.
    pub double: bool,
    /// Largest buffer that a shader can see, bytes.
    pub largest_binding: u64,
    /// What it lacks, if anything.
    pub lacks: Option<String>,
}

type Key = (
    &'static str,
    &'static str,
    Arithmetic,
    Vec<(&'static str, Constant)>,
);

type Fault = Arc<OnceLock<String>>;

/// An open device.
pub struct Context {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    adapter: Adapter,
    fine: Arithmetic,
    pub(super) limits: wgpu::Limits,
    pub(super) pool: Arc<Pool>,
    kernels: Mutex<HashMap<Key, Arc<Kernel>>>,
    /// The first that the device reported.
    fault: Fault,
}

fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env())
}

fn describe(adapter: &wgpu::Adapter) -> Adapter {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    Adapter {
        name: info.name,
        driver: format!("{} {}", info.driver, info.driver_info)
            .trim()
            .to_string(),
        interface: format!("{:?}", info.backend),
        kind: format!("{:?}", info.device_type),
        double: adapter.features().contains(wgpu::Features::SHADER_F64),
        largest_binding: limits
            .max_storage_buffer_binding_size
            .min(limits.max_buffer_size),
        lacks: lacks(&limits),
    }
}

/// The first limit of an adapter that is below what the shaders need.
fn lacks(limits: &wgpu::Limits) -> Option<String> {
    let needs = [
        (
            "storage buffers a shader",
            limits.max_storage_buffers_per_shader_stage,
            STORAGE_BUFFERS,
        ),
        (
            "bytes of workgroup memory",
            limits.max_compute_workgroup_storage_size,
            WORKGROUP_BYTES,
        ),
        (
            "threads a workgroup",
            limits.max_compute_invocations_per_workgroup,
            THREADS,
        ),
    ];
    needs
        .iter()
        .find(|(_, has, needed)| has < needed)
        .map(|(what, has, needed)| format!("{what}: it has {has}, {needed} are needed"))
}

/// Every adapter of this machine.
pub fn adapters() -> Vec<Adapter> {
    let all = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::all()));
    all.iter().map(describe).collect()
}

impl Context {
    /// Opens an adapter, without a trial of its arithmetic.
    ///
    /// # Errors
    /// [`Error::Device`] if there is none, none of that name, or its limits are too small.
    pub(super) fn open(options: &Options) -> Result<Arc<Self>> {
        let found = find(options)?;
        let adapter = describe(&found);
        let failed = |what: String, remedy: &str| Error::Device {
            adapter: adapter.name.clone(),
            what,
            remedy: remedy.into(),
        };
        if let Some(lack) = &adapter.lacks {
            return Err(failed(
                format!("its limits are too small: {lack}"),
                "use another adapter, or the backend cpu",
            ));
        }
        let fine = match options.fine {
            Some(Arithmetic::Double) if !adapter.double => {
                return Err(failed(
                    "it has no double precision".into(),
                    "use two-float arithmetic",
                ));
            }
            Some(fine) => fine,
            None if adapter.double => Arithmetic::Double,
            None => Arithmetic::TwoFloat,
        };
        let has = found.limits();
        let limits = wgpu::Limits {
            max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
            max_compute_workgroup_storage_size: WORKGROUP_BYTES,
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
            max_buffer_size: has.max_buffer_size,
            max_compute_workgroups_per_dimension: has.max_compute_workgroups_per_dimension,
            ..wgpu::Limits::default()
        };
        let mut features = found.features() & wgpu::Features::TIMESTAMP_QUERY;
        if fine == Arithmetic::Double {
            features |= wgpu::Features::SHADER_F64;
        }
        let asked = found.request_device(&wgpu::DeviceDescriptor {
            label: Some("hydrograd"),
            required_features: features,
            required_limits: limits.clone(),
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(asked)
            .map_err(|e| failed(e.to_string(), "update its driver, or use the backend cpu"))?;
        let fault = Arc::new(OnceLock::new());
        let lost: Fault = fault.clone();
        device.set_device_lost_callback(move |reason, message| {
            // Its own end is no loss.
            if reason != wgpu::DeviceLostReason::Destroyed {
                lost.get_or_init(|| format!("the device was lost: {message}"));
            }
        });
        let uncaptured: Fault = fault.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            uncaptured.get_or_init(|| e.to_string());
        }));
        Ok(Arc::new(Self {
            device,
            queue,
            adapter,
            fine,
            limits,
            pool: Arc::default(),
            kernels: Mutex::default(),
            fault,
        }))
    }

    /// The adapter.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// Arithmetic of residuals and derivatives.
    pub fn fine(&self) -> Arithmetic {
        self.fine
    }

    /// What was done so far.
    pub fn counts(&self) -> Counts {
        self.pool.count(|_| {})
    }

    /// The entry of a shader in an arithmetic, compiled once.
    pub(super) fn kernel(
        &self,
        shader: &'static str,
        entry: &'static str,
        arithmetic: Arithmetic,
        constants: &[(&'static str, Constant)],
    ) -> Result<Arc<Kernel>> {
        let key = (shader, entry, arithmetic, constants.to_vec());
        let kernels = || self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels().get(&key) {
            return Ok(kernel.clone());
        }
        let kernel = Arc::new(Kernel::new(
            &self.device,
            |what| self.failure(what),
            shader,
            entry,
            arithmetic,
            constants,
        )?);
        kernels().insert(key, kernel.clone());
        Ok(kernel)
    }

    /// An error of this device.
    pub(super) fn failure(&self, what: String) -> Error {
        Error::Device {
            adapter: self.adapter.name.clone(),
            what,
            remedy: "use a smaller scene, or the backend cpu".into(),
        }
    }

    /// The first fault that the device reported, if any.
    ///
    /// # Errors
    /// That fault.
    pub fn check(&self) -> Result<()> {
        match self.fault.get() {
            Some(what) => Err(self.failure(what.clone())),
            None => Ok(()),
        }
    }

    /// As if the device had been lost, for tests of what follows.
    pub fn lose(&self) {
        self.device.destroy();
        self.fault.get_or_init(|| "the device was lost".into());
    }
}

fn find(options: &Options) -> Result<wgpu::Adapter> {
    let instance = instance();
    let none = |what: String, adapter: &str| Error::Device {
        adapter: adapter.into(),
        what,
        remedy: "install a Vulkan, Metal or Direct3D 12 driver (a software one does: \
                 Debian's mesa-vulkan-drivers), or use the backend cpu"
            .into(),
    };
    let Some(wanted) = &options.adapter else {
        let asked = instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        });
        return pollster::block_on(asked).map_err(|e| none(e.to_string(), "any"));
    };
    let all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let name = |a: &wgpu::Adapter| a.get_info().name;
    let matches = |a: &&wgpu::Adapter| name(a).to_lowercase().contains(&wanted.to_lowercase());
    all.iter().find(matches).cloned().ok_or_else(|| {
        let names: Vec<String> = all.iter().map(name).collect();
        none(
            format!("there is none of this name among {names:?}"),
            wanted,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_that_are_too_small_are_named_with_what_is_needed() {
        let enough = wgpu::Limits {
            max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
            max_compute_workgroup_storage_size: WORKGROUP_BYTES,
            ..wgpu::Limits::default()
        };
        assert_eq!(lacks(&enough), None);
        let few = wgpu::Limits {
            max_storage_buffers_per_shader_stage: 4,
            ..enough
        };
        let message = lacks(&few).unwrap();
        assert!(message.contains("it has 4, 12 are needed"), "{message}");
    }
}
