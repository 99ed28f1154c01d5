//! How much a trajectory magnifies a small change of its state, and with it the gradient.
//!
//! With x = (q, v), the free coordinates in their tangent space, the Jacobian of step n is A_n = ∂x_{n+1}/∂x_n, and a change of the start
//! becomes A_{N−1} … A_0 times it at the end ([`Rollout::step_jacobians`](super::Rollout::step_jacobians)). Singular values are
//! taken in comparable units: displacements in units of the cube root of the largest body's volume (angles in radians), velocities in
//! the same units per duration of the trajectory. A free body without forces then grows by 1.6, whatever its size and time.

use super::gradcheck::unit_displacements;
use super::{Controls, Simulator};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Growth above which gradients are hard to use: a relative error of a thousandth becomes one of a tenth.
const LARGE: f64 = 100.0;

/// A growth factor, and where it is reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Peak {
    /// Largest singular value.
    pub factor: f64,
    /// Number of the step, or of the state.
    pub step: usize,
    /// Its time, s.
    pub time: f64,
}

impl Peak {
    fn raise(&mut self, factor: f64, step: usize, time: f64) {
        if factor > self.factor {
            *self = Self { factor, step, time };
        }
    }
}

/// How a trajectory magnifies changes of its state.
#[derive(Clone, Debug, Serialize)]
pub struct Growth {
    /// Largest singular value of the Jacobian of a single step, and which step.
    pub largest_step: Peak,
    /// Largest singular value of the product over the whole trajectory: a change of the start grows by at most this much. At most
    /// the largest number there is.
    pub total: f64,
    /// The largest of that over all states, and which state.
    pub peak: Peak,
    /// Duration of the trajectory, s.
    pub duration: f64,
    /// The product's largest singular value at states 0 … N.
    #[serde(skip)]
    pub course: Vec<f64>,
}

impl Growth {
    /// What to do where the growth is large.
    pub fn advice(&self) -> Option<String> {
        (self.peak.factor > LARGE).then(|| {
            format!(
                "changes grow by {:.1e} by t = {} s, and gradients with them: clip the gradient, optimise over a shorter \
                 horizon, or split the trajectory into several with matching states (multiple shooting)",
                self.peak.factor, self.peak.time
            )
        })
    }
}

/// The growth along the trajectory of the scene's own controller over `steps` steps.
///
/// # Errors
/// A rollout or a transpose that fails, or no steps.
pub fn growth(simulator: &Simulator, steps: usize) -> Result<Growth> {
    if steps == 0 {
        return Err(Error::input("growth: steps", steps, "must be at least 1"));
    }
    let zero = Controls::zeros(simulator, steps);
    let rollout = simulator.rollout(&zero)?;
    let duration = simulator.time_step() * steps as f64;
    let system = simulator.system();
    let nv = system.tree.velocities();
    let displacement = unit_displacements(simulator).0;
    let unit = DVector::from_fn(2 * nv, |i, _| {
        displacement[i % nv.max(1)] / if i < nv { 1.0 } else { duration }
    });
    let mut out = Growth {
        largest_step: Peak::default(),
        total: 1.0,
        peak: Peak {
            factor: 1.0,
            ..Peak::default()
        },
        duration,
        course: vec![1.0],
    };
    if nv == 0 {
        out.course = vec![1.0; steps + 1];
        return Ok(out);
    }
    // The product so far, as e^size times a matrix whose entries are of order one.
    let (mut product, mut size) = (DMatrix::<f64>::identity(2 * nv, 2 * nv), 0.0);
    let samples = rollout.samples();
    for (n, step) in rollout.step_jacobians(&[])?.into_iter().enumerate() {
        let mut a = step.state;
        for i in 0..2 * nv {
            for j in 0..2 * nv {
                a[(i, j)] *= unit[j] / unit[i];
            }
        }
        let factor = largest(&a);
        out.largest_step.raise(factor, n, samples[n].time);
        product = a * product;
        let norm = product.amax();
        if norm > 0.0 {
            product /= norm;
            size += norm.ln();
        }
        let so_far = (size + largest(&product).ln()).exp().min(f64::MAX);
        out.course.push(so_far);
        out.peak.raise(so_far, n + 1, samples[n + 1].time);
        out.total = so_far;
    }
    Ok(out)
}

fn largest(a: &DMatrix<f64>) -> f64 {
    a.singular_values().max()
}
