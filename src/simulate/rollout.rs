//! A trajectory, and its gradient.

use super::gradient::Sums;
use super::observable::{Reading, differentiable, observable, velocity};
use super::trajectory::Seed;
use super::{Cotangents, GapReport, Gradient, Sample, Simulator};
use crate::adjoint::step::{self, Tape};
use crate::contact::ContactPair;
use crate::dynamics::force::coarser;
use crate::dynamics::{ContactForce, State, StateBar, StepRecord};
use crate::error::readable;
use crate::geometry::Gap;
use crate::once::once;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::OnceLock;

/// A trajectory: the forward pass, and the only key to its gradient. It holds what it needs of the simulator that made it.
pub struct Rollout {
    pub(super) simulator: Simulator,
    pub(super) controls: DMatrix<f64>,
    pub(super) tape: Tape<State, Sample, StepRecord>,
    pub(super) initial_velocity: DVector<f64>,
    pub(super) gaps: OnceLock<Vec<Option<Gap>>>,
    pub(super) report: OnceLock<GapReport>,
}

impl Rollout {
    /// Observations at states 0 … N.
    pub fn samples(&self) -> &[Sample] {
        self.tape.observations()
    }

    /// States 0 … N.
    pub fn states(&self) -> &[State] {
        self.tape.states()
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.tape.records().len()
    }

    /// The simulator that made it.
    pub fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// Coordinates, nq × (N + 1).
    pub fn q(&self) -> DMatrix<f64> {
        self.columns(|s| s.q.clone())
    }

    /// Generalised velocities, nv × (N + 1).
    pub fn v(&self) -> DMatrix<f64> {
        self.columns(|s| s.v.clone())
    }

    fn columns(&self, of: impl Fn(&Sample) -> DVector<f64>) -> DMatrix<f64> {
        DMatrix::from_columns(&self.samples().iter().map(of).collect::<Vec<_>>())
    }

    /// Velocities of the bodies at states 0 … N, 6·bodies × (N + 1), world axes: a body's rows are the velocity of its
    /// origin, m/s, and its angular velocity, rad/s.
    pub fn velocities(&self) -> DMatrix<f64> {
        let rows = 6 * self.simulator.system().len();
        let states = self.states().len();
        let values = (0..states).flat_map(|n| velocity::velocities(&self.reading(n)));
        DMatrix::from_iterator(rows, states, values)
    }

    /// An observable ([`super::observable`]) at states 0 … N by its name, one column each.
    ///
    /// # Errors
    /// A name that no observable has; a value that can't be found ([`Observable::value`](super::observable::Observable::value)).
    pub fn observe(&self, name: &str) -> Result<DMatrix<f64>> {
        let observable = observable(name)?;
        let rows: usize = observable.shape(self.simulator.system()).iter().product();
        let states = self.states().len();
        let values = (0..states).map(|n| observable.value(&self.reading(n)));
        let values = values.collect::<Result<Vec<_>>>()?;
        Ok(DMatrix::from_iterator(rows, states, values.concat()))
    }

    /// An observable at state `n` alone, last index fastest.
    ///
    /// # Errors
    /// As [`Rollout::observe`], and a state that there isn't.
    pub fn observable_value(&self, name: &str, n: usize) -> Result<Vec<f64>> {
        if n >= self.states().len() {
            return Err(Error::input(
                "observable: state",
                n,
                format!("must be at most {}, the last state", self.steps()),
            ));
        }
        observable(name)?.value(&self.reading(n))
    }

    /// State `n`, as observables read it.
    pub(super) fn reading(&self, n: usize) -> Reading<'_> {
        Reading {
            system: self.simulator.system(),
            parameters: self.simulator.parameters(),
            sample: &self.samples()[n],
            step: self.step_around(n),
            time_step: self.simulator.time_step(),
            gap: Box::new(move || self.gaps()[n]),
            gap_error: Box::new(move || {
                let gap = self.gaps()[n]?;
                self.simulator.gap_error(&gap, &self.samples()[n].poses)
            }),
            contacts: Box::new(move || {
                n.checked_sub(1)
                    .map_or(Ok(Vec::new()), |n| self.contacts(n, 0.0))
            }),
        }
    }

    /// The open-loop controls, controls × N.
    pub fn controls(&self) -> &DMatrix<f64> {
        &self.controls
    }

    /// The controls that acted, those of the controller included, controls × N.
    pub fn applied_controls(&self) -> DMatrix<f64> {
        let mut out = self.controls.clone();
        // The last state has no step after it.
        for (mut to, sample) in out.column_iter_mut().zip(self.samples()) {
            to.copy_from(&sample.control);
        }
        out
    }

    /// Smallest gap between bodies or to a wall at states 0 … N; none where there is nothing to
    /// meet. Pairs that never move relative to one another, and those declared to overlap, don't
    /// count. They are measured at the first call.
    pub fn gaps(&self) -> &[Option<Gap>] {
        let made = once(&self.gaps, || {
            let samples = self.samples().par_iter();
            let gaps = samples.map(|s| self.simulator.gaps().smallest(&s.poses));
            gaps.collect()
        });
        made.as_slice()
    }

    /// Number of pieces in which each step was made: one where it wasn't cut ([`Stepper::step`](crate::dynamics::Stepper::step)).
    pub fn pieces(&self) -> Vec<usize> {
        self.tape.records().iter().map(StepRecord::pieces).collect()
    }

    /// Contacts during step `n`, between the states n and n + 1: where something presses, or surfaces are no more than `slack` (m) farther
    /// apart than the gap at which they touch; none where there is no such step. In a step of several pieces each acts for its part of
    /// the step, and its force is the mean over the step.
    ///
    /// # Errors
    /// A signed distance that can't be found.
    pub fn contacts(&self, n: usize, slack: f64) -> Result<Vec<ContactForce>> {
        let Some(record) = self.tape.records().get(n) else {
            return Ok(Vec::new());
        };
        self.simulator.stepper().contact_forces(record, slack)
    }

    /// Number of the state with the smallest gap of the whole trajectory, and that gap.
    pub(super) fn nearest(&self) -> Option<(usize, Gap)> {
        let gaps = self.gaps().iter().enumerate();
        let found = gaps.filter_map(|(n, gap)| Some((n, (*gap)?)));
        found.min_by(|(_, a), (_, b)| a.distance.total_cmp(&b.distance))
    }

    /// What the user should know about this trajectory, with names and numbers: gaps that the
    /// meshes don't resolve, and bodies in one another with the fidelity `isolated`; drag or springs too stiff for the integrator's step, and
    /// energy that comes from nowhere; bodies that leave water which doesn't end with its surface.
    pub fn warnings(&self) -> Vec<String> {
        // Where bodies don't feel each other nothing is to be resolved.
        let coupled = self.simulator.fidelity_acting().coupled();
        let states = self.samples().iter().zip(self.gaps()).filter(|_| coupled);
        let states = states.filter_map(|(s, gap)| Some((s.time, s.poses.as_slice(), (*gap)?)));
        let smallest = self.nearest().map(|(n, gap)| (self.samples()[n].time, gap));
        let warning = self.simulator.gap_warning(smallest, states);
        let all = (warning.into_iter())
            .chain(self.stiffness_warning())
            .chain(self.energy_warning())
            .chain(self.loss_warning())
            .chain(self.rest_warning());
        let all = all.chain(self.passing_warning());
        let all = all.chain(self.coarse_warning());
        all.chain(self.above_water_warnings()).collect()
    }

    /// The gap whose viscous water was resolved worst, where it wasn't.
    fn coarse_warning(&self) -> Option<String> {
        let system = self.simulator.system();
        let each = self.tape.records().iter().map(StepRecord::coarse);
        let worst = each.fold(None, coarser)?;
        let name = |b: usize| format!("body {:?}", system.bodies[b].name);
        Some(format!(
            "lubrication between {} and {} isn't resolved {:.3e} m apart: it is cut into as many faces as there may be, and the longest edge is {:.1} times what the film asks for; its forces may be \
             far off: raise the force's roughness, hold the surfaces apart by contact.gap, or take shorter bodies",
            name(worst.first),
            worst.second.map_or("a wall".into(), name),
            worst.distance,
            worst.ratio,
        ))
    }

    /// What was gone deep into in spite of all pieces.
    fn passing_warning(&self) -> Option<String> {
        let system = self.simulator.system();
        let mut passing = self
            .tape
            .records()
            .iter()
            .filter(|r| !r.passed().is_empty());
        let first = passing.next()?;
        let name = |b: usize| format!("body {:?}", system.bodies[b].name);
        let passed = first.passed();
        let limit = (passed.limits.first()).and_then(|k| system.limits.get(*k));
        let other = |pair: &ContactPair| pair.second_body().map_or("a wall".into(), name);
        let pair = (passed.pairs.first()).map(|p| (p, "goes deep into"));
        let turned = (passed.turned.first()).map(|p| (p, "turns too far while it presses on"));
        let what = match (pair.or(turned), limit) {
            (Some((pair, does)), _) => {
                format!("{} {does} {}", name(pair.first), other(pair))
            }
            (None, Some(limit)) => {
                let links = system.tree.links();
                let b = links.iter().position(|l| l.v.contains(&limit.v))?;
                format!("the joint of {} gets past its limit", name(b))
            }
            (None, None) => return None,
        };
        let (dt, time) = (self.simulator.time_step(), first.state().step);
        Some(format!(
            "{what} in the step at t = {} s, though it was cut into {} pieces, and so in {} steps more: take a smaller time step than {dt} s",
            readable(time as f64 * dt),
            first.pieces(),
            passing.count(),
        ))
    }

    /// Cotangents of the right sizes for this rollout, all zero.
    pub fn zero_cotangents(&self) -> Cotangents {
        let system = self.simulator.system();
        Cotangents::zeros(
            system.tree.velocities(),
            system.len(),
            system.controls,
            self.steps(),
        )
    }

    /// Transpose of the rollout: the gradient of Σ cotangent · observation.
    ///
    /// # Errors
    /// Cotangents of other sizes than [`Rollout::zero_cotangents`] or not finite; a solve that misses its
    /// tolerance.
    pub fn vjp(&self, cotangents: &Cotangents) -> Result<Gradient> {
        self.vjp_with(cotangents, |_| ControlFlow::Continue(()))
    }

    /// As [`Rollout::vjp`]; `progress` is called with the number of steps gone back, and may end the sweep.
    ///
    /// # Errors
    /// As [`Rollout::vjp`], and [`Error::Stopped`] if `progress` breaks.
    pub fn vjp_with(
        &self,
        cotangents: &Cotangents,
        progress: impl FnMut(usize) -> ControlFlow<()> + Send,
    ) -> Result<Gradient> {
        rayon::scope(|_| self.vjp_here(&self.simulator, cotangents, progress))
    }

    /// The same on this thread, with a simulator that is this rollout's but for what computes its coupling.
    pub(super) fn vjp_here(
        &self,
        simulator: &Simulator,
        cotangents: &Cotangents,
        mut progress: impl FnMut(usize) -> ControlFlow<()> + Send,
    ) -> Result<Gradient> {
        let ended = |done| match progress(done) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Stopped {
                what: format!("the gradient, {done} of {} steps back", self.steps()),
            }),
        };
        let mut sums = Sums::new(simulator, self.controls.shape());
        let bar = self.back_here(simulator, None, cotangents, 0, &mut sums, ended)?;
        let first = &self.states()[0];
        sums.start(simulator, first, &self.initial_velocity, &bar)?;
        Ok(sums.gradient)
    }

    /// Cotangent of the first state, from that of the last one or the cotangents there, which aren't read otherwise; what the steps yield is added to `sums`, step 0 being number
    /// `first` there.
    ///
    /// # Errors
    /// As [`Rollout::vjp`], and that of `progress`, which is called with the number of steps gone back.
    pub(super) fn back(
        &self,
        end: Option<StateBar>,
        cotangents: &Cotangents,
        first: usize,
        sums: &mut Sums,
        progress: impl FnMut(usize) -> Result<()> + Send,
    ) -> Result<StateBar> {
        let simulator = &self.simulator;
        rayon::scope(|_| self.back_here(simulator, end, cotangents, first, sums, progress))
    }

    /// The same on this thread, as [`Rollout::vjp_here`].
    fn back_here(
        &self,
        simulator: &Simulator,
        end: Option<StateBar>,
        cotangents: &Cotangents,
        first: usize,
        sums: &mut Sums,
        progress: impl FnMut(usize) -> Result<()> + Send,
    ) -> Result<StateBar> {
        self.check(cotangents)?;
        if end.is_some() {
            // What is read from the part's last state would be lost.
            self.refuse_gains(cotangents.observables.keys())?;
        }
        let trajectory = simulator.trajectory(&self.controls);
        let seeds = self.seeds(cotangents)?;
        let (bar, partials) = match end {
            None => step::reverse(&trajectory, &self.tape, &seeds, progress),
            Some(bar) => step::reverse_from(&trajectory, &self.tape, bar, &seeds, progress),
        }?;
        let steps = self.steps();
        let mut direct = sums.gradient.controls.columns_mut(first, steps);
        direct += &cotangents.controls;
        *sums.gradient.parameters.density_mut() += cotangents.density;
        for (n, partial) in partials.iter().enumerate().rev() {
            sums.add(first + n, partial, seeds[n].size());
        }
        Ok(bar)
    }

    /// The seeds of a reverse sweep, one a state: without the observables that have none there.
    fn seeds(&self, c: &Cotangents) -> Result<Vec<Seed>> {
        let poses = [("positions", &c.positions), ("rotations", &c.rotations)];
        let given = c.observables.iter().map(|(name, x)| (name.as_str(), x));
        let mut parts = Vec::new();
        for (name, x) in poses.into_iter().chain(given) {
            let observable = differentiable(name)?;
            parts.push((observable, self.reads(name, observable)?.apply_vjp(x)));
        }
        let seed = |n: usize| {
            let columns = parts.iter().map(|(o, x)| (*o, x.column(n)));
            let here = columns.filter(|(_, x)| x.iter().any(|x| *x != 0.0));
            Seed {
                q: c.q.column(n).into_owned(),
                v: c.v.column(n).into_owned(),
                control: match n < self.steps() {
                    true => c.applied_controls.column(n).into_owned(),
                    false => DVector::zeros(0),
                },
                observables: here.map(|(o, x)| (o, x.into_owned())).collect(),
            }
        };
        Ok((0..=self.steps()).map(seed).collect())
    }

    fn check(&self, c: &Cotangents) -> Result<()> {
        let z = self.zero_cotangents();
        if !c.density.is_finite() {
            return Err(Error::input(
                "cotangents.density",
                c.density,
                "must be finite",
            ));
        }
        let mut parts = vec![
            ("q", &c.q, z.q.shape()),
            ("v", &c.v, z.v.shape()),
            ("positions", &c.positions, z.positions.shape()),
            ("rotations", &c.rotations, z.rotations.shape()),
            ("controls", &c.controls, z.controls.shape()),
            (
                "applied_controls",
                &c.applied_controls,
                z.applied_controls.shape(),
            ),
        ];
        for (name, x) in &c.observables {
            let rows = differentiable(name)?.tangents(self.simulator.system());
            parts.push((name, x, (rows, self.steps() + 1)));
        }
        for (name, given, right) in parts {
            if given.shape() != right {
                return Err(Error::input(
                    format!("cotangents.{name}"),
                    format!("{:?}", given.shape()),
                    format!("must have the shape {right:?}"),
                ));
            }
            if let Some(bad) = given.iter().find(|x| !x.is_finite()) {
                return Err(Error::input(
                    format!("cotangents.{name}"),
                    bad,
                    "must be finite",
                ));
            }
        }
        Ok(())
    }
}
