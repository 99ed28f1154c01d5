//! What a user may choose about a simulation.

use crate::assembly::Choices;
use crate::boundary::{Depth, Readout, RowScaling};
use crate::coupling::full::{FullSolver, Preconditioner};
use crate::dynamics::Integrator;
use crate::scene::{Preset, Scene};
use crate::water::{Backend, Fidelity, GpuSettings, Method};
use serde::{Deserialize, Serialize};

/// Declares what may be asked for beside a preset: each a field, and a method that gives other settings with it.
macro_rules! settings {
    ($($(#[$about:meta])* $name:ident: $type:ty,)*) => {
        /// What is asked for, over what the scene and its preset say: `None` leaves a choice to them.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Settings {
            /// Choices to start from; `None`: the scene's preset.
            #[serde(skip_serializing_if = "Option::is_none")]
            pub preset: Option<Preset>,
            $(
                $(#[$about])*
                #[serde(skip_serializing_if = "Option::is_none")]
                pub $name: Option<$type>,
            )*
        }

        impl Settings {
            $(
                $(#[$about])*
                pub fn $name(&self, $name: $type) -> Self {
                    Self {
                        $name: Some($name),
                        ..self.clone()
                    }
                }
            )*
        }
    };
}

settings! {
    /// How much of the coupling is modelled.
    fidelity: Fidelity,
    /// Method by which each body alone is solved.
    method: Method,
    /// How far inside the surface the sources of fundamental solutions are.
    depth: Depth,
    /// Norm in which the rows of fundamental solutions are fitted.
    rows: RowScaling,
    /// How the energy is read from the strengths of fundamental solutions.
    readout: Readout,
    /// Weight of those strengths in the least squares.
    damping: f64,
    /// Solver of the coupled system (fidelity `full`).
    solver: FullSolver,
    /// Its preconditioner.
    preconditioner: Preconditioner,
    /// Relative residual at which it stops.
    tolerance: f64,
    /// Iterations after which it gives up with an error.
    max_iterations: usize,
    /// Points of each compressed body (fidelity `reduced`).
    rank: usize,
    /// Smallest gap that compressed bodies resolve, m (fidelity `reduced`).
    resolved_gap: f64,
    /// Error of M_f, relative to √(M_ii M_jj), that the fidelities `reduced` (added to that of the bodies themselves) and `auto`
    /// aim at.
    accuracy: f64,
    /// Time integrator. `None`: the preset's; for a scene with contact, if that doesn't solve contact,
    /// [`Integrator::MomentumEuler`].
    integrator: Integrator,
    /// Time step, s; `None`: the scene's.
    time_step: f64,
    /// Faces per body of shapes by formula; `None`: what each shape says.
    faces: usize,
    /// What computes the coupling.
    backend: Backend,
    /// Choices of [`Backend::Gpu`].
    gpu: GpuSettings,
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
}
