//! Cotangents that seed a reverse sweep, and the gradient that it yields.

use super::Simulator;
use super::grown::Grown;
use super::trajectory::Partial;
use crate::Result;
use crate::dynamics::{Parameters, State, StateBar, StepBar};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Derivatives of a scalar with respect to what a rollout observes; columns are states 0 … N
/// (controls: steps 0 … N − 1).
#[derive(Clone, Debug, PartialEq)]
pub struct Cotangents {
    /// Of q in its tangent space, nv × (N + 1).
    pub q: DMatrix<f64>,
    /// Of v, nv × (N + 1).
    pub v: DMatrix<f64>,
    /// Of the bodies' positions (origins, world), 3·bodies × (N + 1).
    pub positions: DMatrix<f64>,
    /// Of the bodies' rotations (δR = δθ × R, world), 3·bodies × (N + 1).
    pub rotations: DMatrix<f64>,
    /// Direct dependence on the open-loop controls, controls × N.
    pub controls: DMatrix<f64>,
    /// Of the controls that acted, controls × N: the open-loop ones and what the controller added.
    pub applied_controls: DMatrix<f64>,
    /// Direct dependence on the water's density, as the readings of pressure sensors have it.
    pub density: f64,
    /// Of any [`super::observable`] that has a transpose, by its name: its tangents × (N + 1).
    pub observables: BTreeMap<String, DMatrix<f64>>,
}

impl Cotangents {
    /// All zero.
    pub fn zeros(velocities: usize, bodies: usize, controls: usize, steps: usize) -> Self {
        Self {
            q: DMatrix::zeros(velocities, steps + 1),
            v: DMatrix::zeros(velocities, steps + 1),
            positions: DMatrix::zeros(3 * bodies, steps + 1),
            rotations: DMatrix::zeros(3 * bodies, steps + 1),
            controls: DMatrix::zeros(controls, steps),
            applied_controls: DMatrix::zeros(controls, steps),
            density: 0.0,
            observables: BTreeMap::new(),
        }
    }

    /// Adds those of another scalar of the same rollout.
    pub fn add(&mut self, other: &Self) {
        self.q += &other.q;
        self.v += &other.v;
        self.positions += &other.positions;
        self.rotations += &other.rotations;
        self.controls += &other.controls;
        self.applied_controls += &other.applied_controls;
        self.density += other.density;
        for (name, bars) in &other.observables {
            match self.observables.get_mut(name) {
                Some(own) => *own += bars,
                None => {
                    self.observables.insert(name.clone(), bars.clone());
                }
            }
        }
    }
}

/// Gradient with respect to the initial state.
#[derive(Clone, Debug, PartialEq)]
pub struct Initial {
    /// q₀, in its tangent space.
    pub q: DVector<f64>,
    /// v₀.
    pub v: DVector<f64>,
}

/// Gradient of a scalar of a rollout.
#[derive(Clone, Debug)]
pub struct Gradient {
    /// Open-loop controls, controls × steps.
    pub controls: DMatrix<f64>,
    /// Initial state.
    pub initial: Initial,
    /// Physical parameters.
    pub parameters: Parameters,
    /// The controller's gains.
    pub gains: Vec<f64>,
    /// What the user should know of it: that it grew out of all proportion.
    pub warnings: Vec<String>,
}

/// A gradient as it is summed, from the last step to the first.
pub(super) struct Sums {
    pub gradient: Gradient,
    grown: Grown,
}

impl Sums {
    /// All zero, with controls of this shape.
    pub fn new(simulator: &Simulator, (controls, steps): (usize, usize)) -> Self {
        let nv = simulator.system().tree.velocities();
        Self {
            gradient: Gradient {
                controls: DMatrix::zeros(controls, steps),
                initial: Initial {
                    q: DVector::zeros(nv),
                    v: DVector::zeros(nv),
                },
                parameters: simulator.parameters().zeros(),
                gains: vec![0.0; simulator.policy().gains().len()],
                warnings: Vec::new(),
            },
            grown: Grown::default(),
        }
    }

    /// Adds what step `n` yields, or the last state; the objective has added cotangents of up to `seed` there.
    pub fn add(&mut self, n: usize, partial: &Partial, seed: f64) {
        self.grown.add(n, partial.size, seed);
        let out = &mut self.gradient;
        if n < out.controls.ncols() {
            let mut column = out.controls.column_mut(n);
            column += &partial.control;
        }
        out.parameters.add(&partial.parameters);
        for (g, x) in out.gains.iter_mut().zip(&partial.gains) {
            *g += x;
        }
    }

    /// Carries the cotangent of the first state on to where the run starts, at the velocity `v`.
    pub fn start(
        &mut self,
        simulator: &Simulator,
        state: &State,
        v: &DVector<f64>,
        bar: &StateBar,
    ) -> Result<()> {
        // y₀ = y(q₀, v₀).
        let stepper = simulator.stepper();
        let e = stepper.linearise(&state.q, stepper.time(state))?;
        let mut out = StepBar::zeros(&e);
        out.state.q = bar.q.clone();
        stepper.conserved_vjp(&e, v, &bar.y, &mut out)?;
        self.gradient.parameters.add(&out.parameters);
        (simulator.system().shapes).follow_vjp(&mut self.gradient.parameters);
        simulator.forget_driven(&mut out.state.q, &mut out.v);
        self.gradient.initial.q = out.state.q;
        self.gradient.initial.v = out.v;
        let warning = self.grown.warning(simulator, state.step);
        self.gradient.warnings.extend(warning);
        Ok(())
    }
}
