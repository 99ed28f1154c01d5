//! Costs of the user's own, and what they see and give.

use crate::Result;
use crate::simulate::{Rollout, Sample};
use nalgebra::{DMatrix, DVector};

/// A knot of a trajectory, as costs see it.
#[derive(Clone, Copy)]
pub struct CostPoint<'a> {
    /// The trajectory.
    pub rollout: &'a Rollout,
    /// Number of the state in it.
    pub state: usize,
    /// Number of the knot.
    pub knot: usize,
    /// The controls from there to the next knot; none at the end.
    pub control: Option<&'a DVector<f64>>,
    /// Those of the knot before; none where nobody knows.
    pub previous: Option<&'a DVector<f64>>,
}

impl CostPoint<'_> {
    /// What was observed there: time, coordinates, velocity, poses.
    pub fn sample(&self) -> &Sample {
        &self.rollout.samples()[self.state]
    }
}

/// A function of a state x = (q, v), q in its tangent space, and controls u, to second order. The Hessian must not be negative in any direction to be of use: that of
/// Gauss and Newton isn't ([`Quadratic::least_squares`]). Zero where nothing is known; steps are then those of a gradient, kept short by the regularisation.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadratic {
    /// Value.
    pub value: f64,
    /// Gradient by x, 2nv.
    pub x: DVector<f64>,
    /// Gradient by u.
    pub u: DVector<f64>,
    /// Hessian by x, 2nv × 2nv.
    pub xx: DMatrix<f64>,
    /// By u.
    pub uu: DMatrix<f64>,
    /// By u (rows) and x.
    pub ux: DMatrix<f64>,
}

impl Quadratic {
    /// Zero, for a state of so many numbers (2nv) and so many controls.
    pub fn zeros(states: usize, controls: usize) -> Self {
        Self {
            value: 0.0,
            x: DVector::zeros(states),
            u: DVector::zeros(controls),
            xx: DMatrix::zeros(states, states),
            uu: DMatrix::zeros(controls, controls),
            ux: DMatrix::zeros(controls, states),
        }
    }

    /// |r|² with the Hessian of Gauss and Newton, from residuals and their Jacobians by x and u.
    pub fn least_squares(
        residual: &DVector<f64>,
        by_x: &DMatrix<f64>,
        by_u: &DMatrix<f64>,
    ) -> Self {
        Self {
            value: residual.norm_squared(),
            x: 2.0 * by_x.tr_mul(residual),
            u: 2.0 * by_u.tr_mul(residual),
            xx: 2.0 * by_x.tr_mul(by_x),
            uu: 2.0 * by_u.tr_mul(by_u),
            ux: 2.0 * by_u.tr_mul(by_x),
        }
    }

    /// Adds `scale` times another.
    pub fn add_scaled(&mut self, scale: f64, other: &Self) {
        self.value += scale * other.value;
        self.x.axpy(scale, &other.x, 1.0);
        self.u.axpy(scale, &other.u, 1.0);
        self.xx += scale * &other.xx;
        self.uu += scale * &other.uu;
        self.ux += scale * &other.ux;
    }

    /// What its parts are called, with their shapes and numbers.
    pub(super) fn parts(&self) -> [(&'static str, (usize, usize), &[f64]); 6] {
        let of = |m: &DMatrix<f64>| m.shape();
        [
            ("value", (1, 1), std::slice::from_ref(&self.value)),
            ("gradient by x", self.x.shape(), self.x.as_slice()),
            ("gradient by u", self.u.shape(), self.u.as_slice()),
            ("Hessian by x", of(&self.xx), self.xx.as_slice()),
            ("Hessian by u", of(&self.uu), self.uu.as_slice()),
            ("Hessian by u and x", of(&self.ux), self.ux.as_slice()),
        ]
    }
}

/// A cost of the user's own at a knot. A running one is a rate: what a second of it costs.
pub trait CustomCost: Send + Sync {
    /// Value.
    ///
    /// # Errors
    /// Whatever keeps it from being found: a trial trajectory is then turned down.
    fn value(&self, at: &CostPoint) -> Result<f64>;

    /// Value and derivatives.
    ///
    /// # Errors
    /// As [`CustomCost::value`]; they end the search.
    fn quadratic(&self, at: &CostPoint) -> Result<Quadratic>;
}
