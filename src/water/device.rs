//! What the couplings of a simulator are computed on: the CPU, or one open GPU that all of them share.

use super::backend::{Backend, BackendReport, GpuSettings};
use crate::coupling::full::{Cpu, Full, Model};
use crate::coupling::reduced::Reduced;
use crate::coupling::scattering::Scattering;
use crate::coupling::{Coupling, PanelCoupled};
use crate::{Error, Result};
use std::sync::Arc;

#[cfg(feature = "gpu")]
use {
    super::backend::{Arithmetic, DeviceReport},
    crate::gpu::{
        self, Context,
        full::Gpu,
        panel::GpuPanels,
        reduced::{GpuReduced, GpuSums},
    },
};

/// The CPU unless a GPU is open.
#[derive(Clone, Default)]
pub(crate) struct Device {
    asked: Backend,
    /// Why it isn't what was asked for.
    pub reason: Option<String>,
    /// Whether gaps may have films, which are computed on the CPU.
    pub films: bool,
    #[cfg(feature = "gpu")]
    fallback: bool,
    #[cfg(feature = "gpu")]
    context: Option<Arc<Context>>,
}

impl Device {
    /// What is asked for; `idle` says why the scene leaves a GPU nothing to compute, if it does.
    ///
    /// # Errors
    /// A GPU that can't be opened, unless the CPU may take over.
    pub fn open(
        asked: Backend,
        settings: &GpuSettings,
        idle: Option<&'static str>,
    ) -> Result<Self> {
        let mut out = Self {
            asked,
            ..Self::default()
        };
        if asked == Backend::Cpu {
            return Ok(out);
        }
        if cfg!(feature = "gpu")
            && let Some(reason) = idle
        {
            out.reason = Some(reason.into());
            return Ok(out);
        }
        match out.fill(settings) {
            Err(error) if settings.fallback => {
                out.reason = Some(fallen_back(&error));
                Ok(out)
            }
            done => done.map(|()| out),
        }
    }

    #[cfg(feature = "gpu")]
    fn fill(&mut self, settings: &GpuSettings) -> Result<()> {
        self.fallback = settings.fallback;
        self.context = Some(Context::new(&settings.into())?);
        Ok(())
    }

    #[cfg(not(feature = "gpu"))]
    fn fill(&mut self, _: &GpuSettings) -> Result<()> {
        Err(super::backend::not_built())
    }

    /// Whether a body of so many faces is to be factored: on the CPU always, on a GPU where that doesn't
    /// take minutes.
    pub fn factors(&self, faces: usize) -> bool {
        const MOST: usize = 20_000;
        #[cfg(feature = "gpu")]
        let matrix_free = self.context.is_some();
        #[cfg(not(feature = "gpu"))]
        let matrix_free = false;
        !matrix_free || faces <= MOST
    }

    /// The fidelity `Full` here.
    pub fn full(&mut self, model: Model) -> Result<Full> {
        let model = Arc::new(model);
        #[cfg(feature = "gpu")]
        if let Some(context) = &self.context {
            match Gpu::new(context, &model) {
                Ok(gpu) => return Ok(Full::on(model, Box::new(gpu))),
                // The CPU has no use for bodies without a factor: the device's error is the one that tells.
                Err(error) if model.bodies.iter().any(|b| !b.factored()) => {
                    return Err(error);
                }
                Err(error) => self.leave(error)?,
            }
        }
        Ok(Full::on(model.clone(), Box::new(Cpu::new(model)?)))
    }

    /// Coupled panels here, and those of coarser meshes where there are such: both, or the CPU has both.
    pub fn panels(
        &mut self,
        fine: PanelCoupled,
        coarse: impl FnOnce() -> Result<Option<PanelCoupled>>,
    ) -> Result<(PanelCoupled, Option<PanelCoupled>)> {
        #[cfg(feature = "gpu")]
        let first = self.uploaded(&fine)?;
        let coarse = coarse()?;
        #[cfg(feature = "gpu")]
        let (fine, coarse) = {
            let second = coarse.as_ref().map(|c| self.uploaded(c)).transpose()?;
            // A device that was left for the second has lost the first.
            let on = |coupled: PanelCoupled, gpu: Option<GpuPanels>| match gpu {
                Some(gpu) if self.context.is_some() => coupled.on(Box::new(gpu)),
                _ => coupled,
            };
            (on(fine, first), coarse.map(|c| on(c, second.flatten())))
        };
        Ok((fine, coarse))
    }

    /// Coupled panels on the open GPU, if it is open and takes them.
    #[cfg(feature = "gpu")]
    fn uploaded(&mut self, coupled: &PanelCoupled) -> Result<Option<GpuPanels>> {
        let Some(context) = &self.context else {
            return Ok(None);
        };
        match GpuPanels::new(context, coupled.model()) {
            Ok(gpu) => Ok(Some(gpu)),
            Err(error) => self.leave(error).map(|()| None),
        }
    }

    /// Many bodies by products, whose sums are made here; `same` are the same bodies for a device.
    ///
    /// # Errors
    /// A device that fails, unless the CPU may take over.
    pub fn scattering(
        &mut self,
        many: Scattering,
        same: impl FnOnce() -> Result<Reduced>,
    ) -> Result<Scattering> {
        #[cfg(feature = "gpu")]
        if let Some(context) = &self.context {
            match GpuSums::new(context, same()?) {
                Ok(sums) => return Ok(many.summed_by(Arc::new(sums))),
                Err(error) => self.leave(error)?,
            }
        }
        #[cfg(not(feature = "gpu"))]
        drop(same);
        Ok(many)
    }

    /// The fidelity `Reduced` here.
    pub fn reduced(&mut self, coupling: Reduced) -> Result<Box<dyn Coupling>> {
        #[cfg(feature = "gpu")]
        if let Some(context) = &self.context {
            match GpuReduced::new(context, coupling.clone()) {
                Ok(gpu) => return Ok(Box::new(gpu)),
                Err(error) => self.leave(error)?,
            }
        }
        Ok(Box::new(coupling))
    }

    /// Goes on with the CPU after a failure of the device, if that was asked for.
    #[cfg(feature = "gpu")]
    fn leave(&mut self, error: Error) -> Result<()> {
        if !(self.fallback && matches!(error, Error::Device { .. })) {
            return Err(error);
        }
        self.reason = Some(fallen_back(&error));
        self.context = None;
        Ok(())
    }

    /// The open GPU.
    #[cfg(feature = "gpu")]
    pub fn context(&self) -> Option<&Arc<Context>> {
        self.context.as_ref()
    }

    /// What computes, and what was done so far.
    pub fn report(&self) -> BackendReport {
        #[cfg(feature = "gpu")]
        let device = self.context.as_ref().map(|context| {
            let (adapter, counts) = (context.adapter(), context.counts());
            DeviceReport {
                adapter: adapter.name.clone(),
                driver: adapter.driver.clone(),
                interface: adapter.interface.clone(),
                arithmetic: context.fine().into(),
                peak_memory: counts.peak_memory,
                dispatches: counts.dispatches,
                read_backs: counts.read_backs,
                bytes_back: counts.bytes_back,
            }
        });
        #[cfg(not(feature = "gpu"))]
        let device = None;
        BackendReport {
            backend: self.asked,
            backend_used: match device {
                Some(_) => Backend::Gpu,
                None => Backend::Cpu,
            },
            backend_reason: self.reason.clone(),
            films_on_cpu: device.is_some() && self.films,
            device,
        }
    }
}

fn fallen_back(error: &Error) -> String {
    format!("it runs on the CPU instead of the backend gpu: {error}")
}

#[cfg(feature = "gpu")]
impl From<&GpuSettings> for gpu::Options {
    fn from(settings: &GpuSettings) -> Self {
        Self {
            adapter: settings.adapter.as_ref().map(|a| a.as_str().into()),
            fine: match settings.arithmetic {
                Arithmetic::Auto => None,
                Arithmetic::Double => Some(gpu::Arithmetic::Double),
                Arithmetic::TwoFloat => Some(gpu::Arithmetic::TwoFloat),
            },
        }
    }
}

#[cfg(feature = "gpu")]
impl From<gpu::Arithmetic> for Arithmetic {
    fn from(fine: gpu::Arithmetic) -> Self {
        match fine {
            gpu::Arithmetic::Double => Self::Double,
            gpu::Arithmetic::Single | gpu::Arithmetic::TwoFloat => Self::TwoFloat,
        }
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;
    use crate::adjoint::lie::Pose;
    use crate::boundary::PanelBoundary;
    use crate::coupling::Exclusions;
    use crate::coupling::full::SolveSettings;
    use crate::geometry::{TriMesh, Wall};
    use crate::scene::Shape;
    use nalgebra::DMatrix;
    use std::path::Path;

    fn panels(mesh: &TriMesh) -> Result<PanelCoupled> {
        let body = Arc::new(PanelBoundary::new("ball", mesh)?);
        let floor = Wall::rigid([0.0, 0.0, -1.5], [0.0, 0.0, 1.0]);
        let (excluded, solve) = (Exclusions::none(), SolveSettings::default());
        PanelCoupled::new(vec![body], &[floor], excluded, solve)
    }

    /// A device that fails at the second of two meshes leaves the first one to the CPU as well.
    #[test]
    fn a_device_that_is_left_keeps_nothing() -> Result<()> {
        let shape = Shape::sphere(1.0);
        let meshes = [80, 20].map(|n| crate::shape::build(&shape, Path::new(""), Some(n)));
        let settings = GpuSettings {
            fallback: true,
            ..GpuSettings::default()
        };
        let mut device = Device::open(Backend::Gpu, &settings, None)?;
        let context = device.context().cloned();
        let context = context.expect("a device, if a software one");
        let [fine, coarse] = meshes;
        let (fine, coarse) = device.panels(panels(&fine?)?, || {
            context.lose();
            panels(&coarse?).map(Some)
        })?;
        assert_eq!(device.report().backend_used, Backend::Cpu);
        assert!(device.reason.is_some_and(|why| why.contains("lost")));
        let (pose, axes) = ([Pose::identity()], DMatrix::identity(6, 6));
        for coupled in [Some(fine), coarse] {
            let coupled = coupled.expect("of both meshes");
            let solved = coupled.evaluate(&pose, &axes)?;
            assert!(solved.momenta()[(0, 0)] > 1.0);
        }
        Ok(())
    }
}
