//! What a user may choose about a simulation.

use crate::assembly::Choices;
use crate::boundary::{Depth, Readout, RowScaling};
use crate::coupling::full::{FullSolver, Preconditioner};
use crate::dynamics::Integrator;
use crate::scene::{Preset, Scene};
use crate::water::{Backend, Fidelity, GpuSettings, Method};
use serde::{Deserialize, Serialize};

/// What is asked for, over what the scene and its preset say: `None` leaves a choice to them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Choices to start from; `None`: the scene's preset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// How much of the coupling is modelled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fidelity: Option<Fidelity>,
    /// Method by which each body alone is solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
    /// How far inside the surface the sources of fundamental solutions are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<Depth>,
    /// Norm in which the rows of fundamental solutions are fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rows: Option<RowScaling>,
    /// How the energy is read from the strengths of fundamental solutions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub readout: Option<Readout>,
    /// Weight of those strengths in the least squares.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping: Option<f64>,
    /// Solver of the coupled system (fidelity `full`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solver: Option<FullSolver>,
    /// Its preconditioner.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preconditioner: Option<Preconditioner>,
    /// Relative residual at which it stops.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Iterations after which it gives up with an error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_iterations: Option<usize>,
    /// Points of each compressed body (fidelity `reduced`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rank: Option<usize>,
    /// Smallest gap that compressed bodies resolve, m (fidelity `reduced`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resolved_gap: Option<f64>,
    /// Error of M_f, relative to √(M_ii M_jj), that the fidelities `reduced` (added to that of the bodies themselves) and `auto`
    /// aim at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<f64>,
    /// Time integrator. `None`: the preset's; for a scene with contact, if that doesn't solve contact,
    /// [`Integrator::MomentumEuler`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub integrator: Option<Integrator>,
    /// Time step, s; `None`: the scene's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_step: Option<f64>,
    /// Faces per body of shapes by formula; `None`: what each shape says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<usize>,
    /// What computes the coupling.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub backend: Option<Backend>,
    /// Choices of [`Backend::Gpu`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gpu: Option<GpuSettings>,
}

/// Puts what is asked for over what there is.
fn over<T: Clone>(place: &mut T, asked: &Option<T>) {
    if let Some(asked) = asked {
        *place = asked.clone();
    }
}

impl Settings {
    /// The settings of a preset, whatever the scene's own is.
    pub fn preset(preset: Preset) -> Self {
        Self {
            preset: Some(preset),
            ..Self::default()
        }
    }

    /// What these settings and a scene decide together.
    ///
    /// Contact is solved in the velocity that a step moves by: a scene with contact gets
    /// [`Integrator::MomentumEuler`] where nobody chose an integrator and the preset's can't do that.
    pub fn resolve(&self, scene: &Scene) -> Choices {
        let preset = self.preset.unwrap_or(scene.preset);
        let mut base = Choices::preset(preset, scene.time_step);
        if scene.has_contact() && !base.integrator.solves_contact() {
            base.integrator = Integrator::MomentumEuler;
        }
        self.over(base)
    }

    /// Choices with what these settings ask for put over them; the preset isn't looked at.
    pub fn over(&self, mut choices: Choices) -> Choices {
        let water = &mut choices.water;
        over(&mut water.fidelity, &self.fidelity);
        over(&mut water.method, &self.method);
        over(&mut water.backend, &self.backend);
        over(&mut water.gpu, &self.gpu);
        water.faces = self.faces.or(water.faces);
        let numerics = &mut water.numerics;
        over(&mut numerics.mfs.depth, &self.depth);
        over(&mut numerics.mfs.rows, &self.rows);
        over(&mut numerics.mfs.readout, &self.readout);
        over(&mut numerics.mfs.damping, &self.damping);
        over(&mut numerics.solve.solver, &self.solver);
        over(&mut numerics.solve.preconditioner, &self.preconditioner);
        over(&mut numerics.solve.tolerance, &self.tolerance);
        over(&mut numerics.solve.max_iterations, &self.max_iterations);
        over(&mut numerics.compress.tolerance, &self.accuracy);
        over(&mut numerics.accuracy, &self.accuracy);
        let compress = &mut numerics.compress;
        compress.rank = self.rank.or(compress.rank);
        compress.resolved_gap = self.resolved_gap.or(compress.resolved_gap);
        over(&mut choices.integrator, &self.integrator);
        over(&mut choices.time_step, &self.time_step);
        choices
    }

    /// With another time step, s.
    pub fn time_step(&self, dt: f64) -> Self {
        Self {
            time_step: Some(dt),
            ..self.clone()
        }
    }

    /// With another fidelity.
    pub fn fidelity(&self, fidelity: Fidelity) -> Self {
        Self {
            fidelity: Some(fidelity),
            ..self.clone()
        }
    }

    /// With another integrator.
    pub fn integrator(&self, integrator: Integrator) -> Self {
        Self {
            integrator: Some(integrator),
            ..self.clone()
        }
    }

    /// With another number of faces per body, for shapes by formula.
    pub fn faces(&self, faces: usize) -> Self {
        Self {
            faces: Some(faces),
            ..self.clone()
        }
    }

    /// With another method for single bodies.
    pub fn method(&self, method: Method) -> Self {
        Self {
            method: Some(method),
            ..self.clone()
        }
    }

    /// With another solver of the coupled system (`full`).
    pub fn solver(&self, solver: FullSolver) -> Self {
        Self {
            solver: Some(solver),
            ..self.clone()
        }
    }

    /// With another preconditioner of the coupled system (`full`).
    pub fn preconditioner(&self, preconditioner: Preconditioner) -> Self {
        Self {
            preconditioner: Some(preconditioner),
            ..self.clone()
        }
    }

    /// With another number of points a body (`reduced`).
    pub fn rank(&self, rank: usize) -> Self {
        Self {
            rank: Some(rank),
            ..self.clone()
        }
    }

    /// With another smallest gap that is resolved (`reduced`), m.
    pub fn resolved_gap(&self, gap: f64) -> Self {
        Self {
            resolved_gap: Some(gap),
            ..self.clone()
        }
    }

    /// With another error of M_f to aim at (`reduced` and `auto`).
    pub fn accuracy(&self, error: f64) -> Self {
        Self {
            accuracy: Some(error),
            ..self.clone()
        }
    }

    /// With another backend.
    pub fn backend(&self, backend: Backend) -> Self {
        Self {
            backend: Some(backend),
            ..self.clone()
        }
    }

    /// With other choices of the GPU.
    pub fn gpu(&self, gpu: GpuSettings) -> Self {
        Self {
            gpu: Some(gpu),
            ..self.clone()
        }
    }

    /// With another residual at which the iterative solves of the fidelity `full` stop.
    pub fn tolerance(&self, tolerance: f64) -> Self {
        Self {
            tolerance: Some(tolerance),
            ..self.clone()
        }
    }
}
