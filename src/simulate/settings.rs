//! What a user may choose about a simulation.

use crate::assembly::Choices;
use crate::boundary::{Depth, Readout, RowScaling};
use crate::coupling::full::{FullSolver, Preconditioner};
use crate::dynamics::Integrator;
use crate::scene::{Preset, Scene};
use crate::water::{Backend, Exchange, Fidelity, GpuSettings, Method};
use serde::{Deserialize, Serialize};

/// Declares what may be asked for beside a preset, with its places in [`Choices`]: each a field, and a method that gives other
/// settings with it.
macro_rules! settings {
    ($($(#[$about:meta])* $name:ident: $type:ty => $($($place:ident).+),+;)*) => {
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

            /// Choices with what these settings ask for put over them; the preset isn't looked at.
            pub fn over(&self, mut choices: Choices) -> Choices {
                $(
                    if let Some(asked) = &self.$name {
                        $(choices.$($place).+ = asked.clone().into();)+
                    }
                )*
                choices
            }
        }
    };
}

settings! {
    /// How much of the coupling is modelled.
    fidelity: Fidelity => water.fidelity;
    /// Method by which each body alone is solved.
    method: Method => water.method;
    /// How far inside the surface the sources of fundamental solutions are.
    depth: Depth => water.numerics.mfs.depth;
    /// Norm in which the rows of fundamental solutions are fitted.
    rows: RowScaling => water.numerics.mfs.rows;
    /// How the energy is read from the strengths of fundamental solutions.
    readout: Readout => water.numerics.mfs.readout;
    /// Weight of those strengths in the least squares.
    damping: f64 => water.numerics.mfs.damping;
    /// Solver of the coupled system (fidelity `full`).
    solver: FullSolver => water.numerics.solve.solver;
    /// Its preconditioner.
    preconditioner: Preconditioner => water.numerics.solve.preconditioner;
    /// ρ of the preconditioner `csd24`: how far, in its own scales, a source reaches others of its body; 1 to 20.
    csd24_rho: f64 => water.numerics.solve.csd24_rho;
    /// Relative residual at which it stops.
    tolerance: f64 => water.numerics.solve.tolerance;
    /// Iterations after which it gives up with an error.
    max_iterations: usize => water.numerics.solve.max_iterations;
    /// Points of each compressed body (fidelity `reduced`).
    rank: usize => water.numerics.compress.rank;
    /// Smallest gap that compressed bodies resolve, m (fidelity `reduced`).
    resolved_gap: f64 => water.numerics.compress.resolved_gap;
    /// Error of M_f, relative to √(M_ii M_jj), that the fidelities `reduced` (added to that of the bodies themselves) and `auto`
    /// aim at.
    accuracy: f64 => water.numerics.compress.tolerance, water.numerics.accuracy;
    /// Whether the water in gaps that compressed bodies or panels don't resolve is added as films (fidelities `reduced`, `auto`, and `full` by panels; on
    /// unless turned off).
    films: bool => water.numerics.films;
    /// How compressed bodies are coupled (fidelities `reduced` and `auto`): by a factor, or by products alone where they are many.
    exchange: Exchange => water.numerics.exchange;
    /// Time integrator. `None`: the preset's; for a scene with contact, if that doesn't solve contact,
    /// [`Integrator::MomentumEuler`].
    integrator: Integrator => integrator;
    /// Time step, s; `None`: the scene's.
    time_step: f64 => time_step;
    /// Faces per body of shapes by formula; `None`: what each shape says.
    faces: usize => water.faces;
    /// Shapes with respect to which gradients are wanted: names of shape parameters (`finger.size.y`), or what these begin with (`finger`; `hull.vertex` for all vertices of a mesh), or
    /// `*` for those of all bodies.
    shape_parameters: Vec<String> => shape_parameters;
    /// What computes the coupling.
    backend: Backend => water.backend;
    /// Choices of [`Backend::Gpu`].
    gpu: GpuSettings => water.gpu;
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
    /// Contact is solved in the velocity that a step moves by, and what joints resist with may be far too stiff for a velocity from before: where nobody chose an integrator and the
    /// preset's can't do that, a scene with either gets [`Integrator::Midpoint`] if it has a body that moves against one that moves itself, whose swing a step of first order
    /// misses by what both have of speed, and no bodies that touch; otherwise [`Integrator::MomentumEuler`], which shows what rests on something at rest. [`Simulator::reasons`](super::Simulator::reasons)
    /// says which.
    pub fn resolve(&self, scene: &Scene) -> Choices {
        let preset = self.preset.unwrap_or(scene.preset);
        let mut base = Choices::preset(preset, scene.time_step);
        let asked = scene.has_contact() || scene.resisting().is_some();
        if asked && !base.integrator.solves_contact() && self.integrator.is_none() {
            base.in_place_of = Some(base.integrator);
            let swings = scene.contact.is_none() && scene.carriers().articulated().is_some();
            base.integrator = match swings {
                true => Integrator::Midpoint,
                false => Integrator::MomentumEuler,
            };
        }
        self.over(base)
    }
}
