//! Levenberg's and Marquardt's search within bounds.

use super::misfit::{Evaluated, Linear, Misfit};
use super::{IdentifyProgress, IdentifySettings, IdentifyStop};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

/// Part of the expected fall that a step must bring.
const ENOUGH: f64 = 1e-4;
/// Damping at which no step is left.
const MOST_DAMPING: f64 = 1e14;

/// Where a search ended.
pub(super) struct Found {
    pub best: Evaluated,
    pub linear: Linear,
    pub iterations: usize,
    pub simulations: usize,
    pub jacobians: usize,
    pub failures: usize,
    pub stop: IdentifyStop,
}

pub(super) struct Marquardt<'m, 'a> {
    misfit: &'m Misfit<'a>,
    settings: &'m IdentifySettings,
    /// Largest length that each column of the Jacobian has had: the scale of its coordinate.
    scale: DVector<f64>,
    simulations: usize,
    failures: usize,
}

/// A step from a linearisation.
struct Step {
    to: DVector<f64>,
    expected: f64,
    /// Largest part of a standard error that a coordinate moves by.
    size: f64,
}

impl<'m, 'a> Marquardt<'m, 'a> {
    pub fn new(misfit: &'m Misfit<'a>, settings: &'m IdentifySettings) -> Self {
        Self {
            misfit,
            settings,
            scale: DVector::zeros(misfit.start().len()),
            simulations: 0,
            failures: 0,
        }
    }

    fn evaluate(&mut self, x: &DVector<f64>) -> Result<Evaluated> {
        self.simulations += self.misfit.experiments.len();
        let made = self.misfit.evaluate(x)?;
        if made.cost.is_finite() {
            return Ok(made);
        }
        let remedy = "the residuals left floating point";
        Err(Error::input("identify: misfit", made.cost, remedy))
    }

    /// # Errors
    /// The start's simulation, and derivatives that can't be found.
    pub fn solve(
        mut self,
        progress: &mut dyn FnMut(&IdentifyProgress) -> ControlFlow<()>,
    ) -> Result<Found> {
        let mut at = self.evaluate(&self.misfit.start())?;
        let mut linear = self.misfit.linearise(&at)?;
        let (mut jacobians, mut iterations) = (1, 0);
        let (mut damping, mut growth) = (self.settings.damping, 2.0);
        let stop = loop {
            if iterations == self.settings.iterations {
                break IdentifyStop::Budget;
            }
            if damping > MOST_DAMPING {
                break IdentifyStop::Stuck;
            }
            iterations += 1;
            let step = self.step(&at.x, &linear, damping);
            if step.expected <= self.settings.cost_tolerance * at.cost {
                break IdentifyStop::Cost;
            }
            let trial = match self.evaluate(&step.to) {
                Ok(trial) => Some(trial),
                Err(stop @ Error::Stopped { .. }) => return Err(stop),
                Err(_) => {
                    self.failures += 1;
                    None
                }
            };
            let fell = trial.as_ref().map_or(-1.0, |t| at.cost - t.cost);
            let ratio = fell / step.expected;
            let taken = trial.filter(|_| ratio > ENOUGH);
            let is_taken = taken.is_some();
            if let Some(next) = taken {
                at = next;
                linear = self.misfit.linearise(&at)?;
                jacobians += 1;
                // Nielsen's rule: no jumps as the model gets better.
                damping *= f64::max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0).powi(3));
                growth = 2.0;
            } else {
                damping *= growth;
                growth *= 2.0;
            }
            let told = IdentifyProgress {
                iteration: iterations,
                cost: at.cost,
                taken: is_taken,
                step: step.size,
                simulations: self.simulations,
            };
            if progress(&told).is_break() {
                break IdentifyStop::Asked;
            }
            if is_taken && fell <= self.settings.cost_tolerance * at.cost {
                break IdentifyStop::Cost;
            }
            if is_taken && step.size <= self.settings.step_tolerance {
                break IdentifyStop::Step;
            }
        };
        Ok(Found {
            best: at,
            linear,
            iterations,
            simulations: self.simulations,
            jacobians,
            failures: self.failures,
            stop,
        })
    }

    /// The damped step, within the bounds.
    fn step(&mut self, x: &DVector<f64>, linear: &Linear, damping: f64) -> Step {
        let Linear {
            residuals,
            jacobian,
        } = linear;
        let gradient = jacobian.tr_mul(residuals);
        let free: Vec<usize> = (0..x.len())
            .filter(|&i| {
                let [least, largest] = self.misfit.bounds(i);
                !(x[i] <= least && gradient[i] > 0.0 || x[i] >= largest && gradient[i] < 0.0)
            })
            .collect();
        for i in 0..x.len() {
            self.scale[i] = self.scale[i].max(jacobian.column(i).norm());
        }
        let n = free.len();
        if n == 0 {
            return Step {
                to: x.clone(),
                expected: 0.0,
                size: 0.0,
            };
        }
        let chosen = jacobian.select_columns(&free);
        let factored = chosen.qr();
        let (q, r) = (factored.q(), factored.r());
        let rows = r.nrows();
        // [R; √λ D] δ = [−Qᵀr; 0].
        let mut system = DMatrix::zeros(rows + n, n);
        system.rows_mut(0, rows).copy_from(&r);
        for (k, i) in free.iter().enumerate() {
            let scale = match self.scale[*i] {
                0.0 => 1.0,
                scale => scale,
            };
            system[(rows + k, k)] = damping.sqrt() * scale;
        }
        let mut right = DVector::zeros(rows + n);
        right.rows_mut(0, rows).copy_from(&-q.tr_mul(residuals));
        let damped = system.qr();
        let right = damped.q().tr_mul(&right);
        let triangle = damped.r();
        let mut delta = DVector::zeros(x.len());
        if let Some(found) = triangle.solve_upper_triangular(&right) {
            for (k, i) in free.iter().enumerate() {
                delta[*i] = found[k];
            }
        }
        let mut to = x + &delta;
        for i in 0..to.len() {
            let [least, largest] = self.misfit.bounds(i);
            to[i] = to[i].clamp(least, largest);
        }
        let delta = &to - x;
        let after = residuals + jacobian * &delta;
        // 1/√ of the damped information's diagonal of inverses.
        let inverse = triangle.solve_upper_triangular(&DMatrix::identity(n, n));
        let size = inverse.map_or(f64::INFINITY, |inverse| {
            let part = |(k, i): (usize, &usize)| {
                let error = inverse.row(k).norm();
                if error > 0.0 {
                    delta[*i].abs() / error
                } else {
                    0.0
                }
            };
            free.iter().enumerate().map(part).fold(0.0, f64::max)
        });
        Step {
            expected: 0.5 * (residuals.norm_squared() - after.norm_squared()),
            to,
            size,
        }
    }
}
