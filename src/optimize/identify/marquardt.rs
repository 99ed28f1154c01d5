//! Levenberg's and Marquardt's search within bounds.

use super::misfit::{Evaluated, Linear, Misfit};
use super::{IdentifyProgress, IdentifySettings, IdentifyStop};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

/// Part of the expected fall that a step must bring.
const ENOUGH: f64 = 1e-4;
/// Damping of a step of Gauss and Newton, but for what rounding alone tells.
const NO_DAMPING: f64 = 1e-14;
/// Part of the fall that a step of Gauss and Newton promises from which on one counts as such.
const LIGHT: f64 = 0.5;
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

    /// The misfit at a trial; none where its simulation fails.
    fn try_out(&mut self, x: &DVector<f64>) -> Result<Option<Evaluated>> {
        match self.evaluate(x) {
            Ok(trial) => Ok(Some(trial)),
            // The caller's own reasons, and what its function of observables raised.
            Err(stop) if stop.ends_search() => Err(stop),
            Err(_) => {
                self.failures += 1;
                Ok(None)
            }
        }
    }

    /// # Errors
    /// The start's simulation, and derivatives that can't be found.
    pub fn solve(
        mut self,
        progress: &mut dyn FnMut(&IdentifyProgress) -> ControlFlow<()>,
    ) -> Result<Found> {
        let mut at = self.evaluate(&self.misfit.start())?;
        let mut linear = self.misfit.linearise(&at)?;
        let mut promised = self.step(&at.x, &linear, NO_DAMPING).expected;
        let (mut jacobians, mut iterations) = (1, 0);
        let (mut damping, mut growth, mut refused) = (self.settings.damping, 2.0, 0);
        let stop = loop {
            if iterations == self.settings.iterations {
                break IdentifyStop::Budget;
            }
            if damping > MOST_DAMPING {
                break IdentifyStop::Stuck;
            }
            iterations += 1;
            // Damping makes any step small, where unknowns are hard to tell apart little of it: that is no end.
            let least = self.settings.cost_tolerance * at.cost;
            let is_near = |expected: f64| expected.abs() <= least;
            if is_near(promised) {
                break IdentifyStop::Cost;
            }
            let step = self.step(&at.x, &linear, damping);
            if is_near(step.expected) && refused > 0 {
                break IdentifyStop::Stuck;
            }
            let is_light = step.expected >= LIGHT * promised;
            // A step that leads uphill in the model, cut by bounds, isn't tried.
            let trial = match step.expected > 0.0 {
                true => self.try_out(&step.to)?,
                false => None,
            };
            let fell = trial.as_ref().map_or(0.0, |t| at.cost - t.cost);
            let ratio = fell / step.expected;
            let taken = trial.filter(|_| ratio > ENOUGH);
            let is_taken = taken.is_some();
            if let Some(next) = taken {
                at = next;
                linear = self.misfit.linearise(&at)?;
                promised = self.step(&at.x, &linear, NO_DAMPING).expected;
                jacobians += 1;
                // Nielsen's rule: no jumps as the model gets better.
                damping *= f64::max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0).powi(3));
                growth = 2.0;
                refused = 0;
            } else {
                damping *= growth;
                growth *= 2.0;
                refused += 1;
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
            if is_taken && is_light && fell <= self.settings.cost_tolerance * at.cost {
                break IdentifyStop::Cost;
            }
            if is_taken && is_light && step.size <= self.settings.step_tolerance {
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

    /// The damped step, within the bounds: what would leave them stays there, and the others are found anew.
    fn step(&mut self, x: &DVector<f64>, linear: &Linear, damping: f64) -> Step {
        let Linear {
            residuals,
            jacobian,
        } = linear;
        let gradient = jacobian.tr_mul(residuals);
        for i in 0..x.len() {
            self.scale[i] = self.scale[i].max(jacobian.column(i).norm());
        }
        let mut delta = DVector::zeros(x.len());
        let told = self.misfit.told(x, jacobian);
        let mut free: Vec<usize> = (0..x.len())
            .filter(|&i| told[i])
            .filter(|&i| {
                let [least, largest] = self.misfit.bounds(i);
                !(x[i] <= least && gradient[i] > 0.0 || x[i] >= largest && gradient[i] < 0.0)
            })
            .collect();
        let (mut size, mut cut) = (0.0, Vec::new());
        while !free.is_empty() {
            free.iter().for_each(|i| delta[*i] = 0.0);
            let right = residuals + jacobian * &delta;
            let (found, errors) = self.damped(&free, jacobian, &right, damping);
            let mut kept = Vec::new();
            for (k, &i) in free.iter().enumerate() {
                let [least, largest] = self.misfit.bounds(i);
                let to = x[i] + found[k];
                match (least..=largest).contains(&to) {
                    true => kept.push(i),
                    false => {
                        let bound = to.clamp(least, largest);
                        delta[i] = bound - x[i];
                        cut.push((i, bound));
                    }
                }
            }
            if kept.len() == free.len() {
                size = 0.0;
                for (k, &i) in free.iter().enumerate() {
                    delta[i] = found[k];
                    size = f64::max(size, found[k].abs() / errors[k].max(f64::MIN_POSITIVE));
                }
                break;
            }
            free = kept;
        }
        let after = residuals + jacobian * &delta;
        let mut to = self.misfit.within(x + &delta);
        // To the bit, by which a bound is known to hold: the sum may round to beside it.
        for (i, bound) in &cut {
            to[*i] = *bound;
        }
        Step {
            expected: 0.5 * (residuals.norm_squared() - after.norm_squared()),
            to,
            // Cut at a bound it counts as long, however short: the others go on from there.
            size: if cut.is_empty() { size } else { f64::INFINITY },
        }
    }

    /// The step of the coordinates `free` that answers to `residuals`, [R; √λ D] δ = [−Qᵀr; 0], and what it is measured by: the roots of the diagonal of the damped information's inverse.
    fn damped(
        &self,
        free: &[usize],
        jacobian: &DMatrix<f64>,
        residuals: &DVector<f64>,
        damping: f64,
    ) -> (DVector<f64>, DVector<f64>) {
        let n = free.len();
        let factored = jacobian.select_columns(free).qr();
        let (q, r) = (factored.q(), factored.r());
        let rows = r.nrows();
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
        let triangle = damped.r();
        let right = damped.q().tr_mul(&right);
        let step = triangle.solve_upper_triangular(&right);
        let inverse = triangle.solve_upper_triangular(&DMatrix::identity(n, n));
        let errors = |inverse: DMatrix<f64>| DVector::from_fn(n, |k, _| inverse.row(k).norm());
        (
            step.unwrap_or_else(|| DVector::zeros(n)),
            inverse.map_or_else(|| DVector::zeros(n), errors),
        )
    }
}
