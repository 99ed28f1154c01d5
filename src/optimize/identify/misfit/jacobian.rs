//! The Jacobian of a misfit's residuals, forward or by reverse sweeps.

use super::{Evaluated, Misfit, Place, Setting};
use crate::Result;
use crate::optimize::identify::Experiment;
use crate::optimize::identify::derived::derivative;
use crate::optimize::identify::root;
use crate::simulate::observable::differentiable;
use crate::simulate::{Rollout, Variables};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Residuals, those of priors after the experiments', weighted by the loss; half their square's gradient is the misfit's.
pub struct Linear {
    pub residuals: DVector<f64>,
    pub jacobian: DMatrix<f64>,
}

impl Misfit<'_> {
    /// # Errors
    /// Derivatives that can't be found.
    pub fn linearise(&self, at: &Evaluated) -> Result<Linear> {
        let each: Vec<_> = (0..self.experiments.len())
            .into_par_iter()
            .map(|k| self.experiment_jacobian(k, at))
            .collect();
        let priors = self.priors();
        let data: usize = at.differences.iter().map(DVector::len).sum();
        let mut residuals = DVector::zeros(data + priors.len());
        let mut jacobian = DMatrix::zeros(data + priors.len(), self.coordinates);
        let mut row = 0;
        for (k, made) in each.into_iter().enumerate() {
            let made = made.map_err(|e| e.within(&self.experiments[k].place()))?;
            for (i, r) in at.differences[k].iter().enumerate() {
                let weight = self.loss.of(*r).1.sqrt();
                residuals[row] = weight * r;
                jacobian.row_mut(row).copy_from(&(weight * made.row(i)));
                row += 1;
            }
        }
        for (i, prior) in priors {
            residuals[row] = (at.x[i] - prior.mean) / prior.deviation;
            jacobian[(row, i)] = 1.0 / prior.deviation;
            row += 1;
        }
        Ok(Linear {
            residuals,
            jacobian,
        })
    }

    /// Jacobian of an experiment's differences by all coordinates.
    fn experiment_jacobian(&self, k: usize, at: &Evaluated) -> Result<DMatrix<f64>> {
        let named = |s: &Setting| match &s.place {
            Place::Parameter(name) => Some(name.clone()),
            Place::Start { .. } | Place::Root { .. } => None,
        };
        let mut parameters: Vec<String> = self.settings[k].iter().filter_map(named).collect();
        let roots = self.roots(k, &at.x)?;
        // Of each body with a root its inertia, after what is set itself.
        let first_root = parameters.len();
        parameters.extend(roots.keys().flat_map(|body| root::parameters(body)));
        let count = parameters.len();
        let simulator = &self.experiments[k].simulator;
        let n = simulator.start().1.len();
        let start = self.starts[k].as_ref();
        let unsure = start.is_some_and(|s| s.deviations[0] > 0.0);
        let variables = Variables {
            parameters,
            initial_q: unsure || self.sets_start(k),
            initial_v: start.is_some_and(|s| s.deviations[1] > 0.0),
            ..Variables::default()
        };
        let own = count + n * (usize::from(variables.initial_q) + usize::from(variables.initial_v));
        if own == 0 {
            return Ok(DMatrix::zeros(at.differences[k].len(), self.coordinates));
        }
        let few = self.experiments[k].derived.is_empty() && self.experiments[k].residuals() < own;
        let made = match few {
            true => self.by_reverse(k, &at.rollouts[k], &variables)?,
            false => self.by_forward(k, &at.rollouts[k], &variables)?,
        };
        let mut out = DMatrix::zeros(made.nrows(), self.coordinates);
        let mut parameter = 0..first_root;
        for setting in &self.settings[k] {
            let i = setting.unknown;
            if let Place::Root { body, entry } = &setting.place {
                let number = roots.keys().position(|b| b == body).unwrap_or(0);
                let by = root::slope(&roots[body]).column(*entry) * self.unknowns[i].slope(at.x[i]);
                let columns = made.columns(first_root + 6 * number, 6);
                let mut column = out.column_mut(i);
                column += columns * by;
                continue;
            }
            let column = match setting.place {
                Place::Start { v, .. } => count + v,
                // They come in this order.
                Place::Parameter(_) | Place::Root { .. } => parameter.next().unwrap_or(0),
            };
            let by = setting.factor * self.unknowns[i].slope(at.x[i]);
            out.column_mut(i).axpy(by, &made.column(column), 1.0);
        }
        let Some(start) = start else {
            return Ok(out);
        };
        let velocities = count + if variables.initial_q { n } else { 0 };
        for (to, part, _) in start.parts() {
            let from = if part == 0 { count } else { velocities };
            let columns = made.columns(from, n);
            let by = match (part, self.displaced(k, &at.x)) {
                (0, Some([xi, _])) => {
                    let tree = &simulator.system().tree;
                    let still = DMatrix::zeros(n, n);
                    columns * tree.integrate_jvp(&xi, &still, &DMatrix::identity(n, n))
                }
                _ => columns.into_owned(),
            };
            for (i, v) in start.free.iter().enumerate() {
                out.set_column(to + i, &by.column(*v));
            }
        }
        Ok(out)
    }

    /// By `variables`, a run for all of them.
    fn by_forward(&self, k: usize, rollout: &Rollout, by: &Variables) -> Result<DMatrix<f64>> {
        let Experiment {
            recorded, derived, ..
        } = &self.experiments[k];
        let of_derived = derived.iter().flat_map(|d| &d.states);
        let states: BTreeSet<usize> = (recorded.iter().flat_map(|r| &r.states))
            .chain(of_derived)
            .copied()
            .collect();
        let states: Vec<usize> = states.into_iter().collect();
        let of_derived = derived.iter().flat_map(|d| &d.observables);
        let names: BTreeSet<&str> = (recorded.iter().map(|r| &r.observable))
            .chain(of_derived)
            .map(String::as_str)
            .collect();
        let names: Vec<&str> = names.into_iter().collect();
        let made = rollout.jacobian(by, &names, &states)?;
        let columns = made.first().map_or(0, DMatrix::ncols);
        let mut rows = Vec::new();
        for of in derived {
            let seen = of.seen(rollout)?;
            let along = |column: usize| -> Vec<DMatrix<f64>> {
                let tangent = |name: &String| {
                    let made = &made[names.binary_search(&name.as_str()).unwrap_or(0)];
                    let entries = made.nrows() / states.len();
                    DMatrix::from_fn(entries, of.states.len(), |i, n| {
                        let place = states.binary_search(&of.states[n]).unwrap_or(0);
                        made[(place * entries + i, column)]
                    })
                };
                of.observables.iter().map(tangent).collect()
            };
            let columns = (0..columns).map(|c| derivative(of, &seen, &along(c)));
            let columns = columns.collect::<Result<Vec<_>>>()?;
            rows.push(DMatrix::from_columns(&columns));
        }
        let more: usize = rows.iter().map(DMatrix::nrows).sum();
        let mut out = DMatrix::zeros(self.experiments[k].residuals() + more, columns);
        let mut row = self.experiments[k].residuals();
        for found in rows {
            out.rows_mut(row, found.nrows()).copy_from(&found);
            row += found.nrows();
        }
        let mut row = 0;
        for r in recorded {
            let of = names.binary_search(&r.observable.as_str()).unwrap_or(0);
            let entries = made[of].nrows() / states.len();
            let tangent = self.experiments[k].tangent_of(r)?.unwrap_or(r.entry);
            for n in &r.states {
                let place = states.binary_search(n).unwrap_or(0);
                let found = made[of].row(place * entries + tangent) / r.deviation;
                out.row_mut(row).copy_from(&found);
                row += 1;
            }
        }
        Ok(out)
    }

    /// The same, a reverse sweep for each residual.
    fn by_reverse(&self, k: usize, rollout: &Rollout, by: &Variables) -> Result<DMatrix<f64>> {
        let system = rollout.simulator().system();
        let n = system.tree.velocities();
        let mut rows = Vec::new();
        for r in &self.experiments[k].recorded {
            let entries = differentiable(&r.observable)?;
            let tangent = self.experiments[k].tangent_of(r)?.unwrap_or(r.entry);
            for state in &r.states {
                let mut bar = rollout.zero_cotangents();
                let mut seed = DMatrix::zeros(entries.tangents(system), rollout.steps() + 1);
                seed[(tangent, *state)] = 1.0 / r.deviation;
                bar.observables.insert(r.observable.clone(), seed);
                let found = rollout.vjp(&bar)?;
                let mut row = Vec::new();
                for name in &by.parameters {
                    row.push(found.parameters.get(name)?);
                }
                if by.initial_q {
                    row.extend(found.initial.q.iter().take(n));
                }
                if by.initial_v {
                    row.extend(found.initial.v.iter().take(n));
                }
                rows.push(DVector::from_vec(row).transpose());
            }
        }
        Ok(DMatrix::from_rows(&rows))
    }
}
