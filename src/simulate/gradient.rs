//! Cotangents that seed a reverse sweep, and the gradient that it yields.

use crate::dynamics::Parameters;
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
            observables: BTreeMap::new(),
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
}
