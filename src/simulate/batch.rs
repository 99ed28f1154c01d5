//! Many rollouts of one simulator, and their gradients: on all cores, and with a coupling that computes equal scenes together in lockstep.

use super::{Controls, Cotangents, Gradient, Halted, Objective, Rollout, Simulator};
use crate::coupling::{Together, TogetherReport};
use crate::dynamics::State;
use crate::{Error, Result};
use nalgebra::DVector;
use rayon::prelude::*;
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Where a member of a batch begins.
#[derive(Clone, Debug)]
pub enum Begin {
    /// Where the scene does.
    Scene,
    /// At coordinates and generalised velocities ([`Simulator::state`]).
    At(DVector<f64>, DVector<f64>),
    /// In a state.
    State(State),
}

/// What became of a member: its rollout, or where it ended and why.
pub type Ran = std::result::Result<Rollout, Box<Halted>>;

/// One rollout of a batch.
#[derive(Clone, Debug)]
pub struct Member {
    /// Where it begins.
    pub begin: Begin,
    /// Its open-loop controls.
    pub controls: Controls,
}

/// How a batch was computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BatchReport {
    /// Seconds in all.
    pub seconds: f64,
    /// Members that ran side by side, each on a stack of its own, where their couplings were computed together; 0 where each was computed by itself.
    pub seats: usize,
    /// What was computed together.
    pub together: TogetherReport,
}

impl Simulator {
    /// Rollouts of many members, in their order: those of [`Simulator::rollout_as_far`]. `progress` is called after each step of any of them, and ends the
    /// batch where it breaks; it must not wait for another member.
    ///
    /// With the backend gpu and the fidelity reduced their couplings are computed together, as many as there is memory for ([`BatchReport`]); what a member
    /// becomes doesn't depend on the others, to the last bit. Everywhere else they are the rollouts by themselves, to the last bit. One batch takes all cores: not to be called
    /// from a parallel iterator, whose other items would begin within the one that waits.
    ///
    /// # Errors
    /// A device that fails before any member runs; what befalls a member is its own.
    pub fn rollout_batch(
        &self,
        members: &[Member],
        progress: impl Fn() -> ControlFlow<()> + Sync,
    ) -> Result<(Vec<Ran>, BatchReport)> {
        self.side_by_side(members.len(), |simulator, m| {
            let Member { begin, controls } = &members[m];
            let state = match begin {
                Begin::Scene => simulator.initial(),
                Begin::At(q, v) => simulator.state(0, q, v),
                Begin::State(state) => Ok(state.clone()),
            };
            let made = match state {
                Ok(state) => simulator.rollout_here(&state, controls, |_| progress()),
                Err(error) => Err(Box::new(Halted {
                    step: 0,
                    time: 0.0,
                    error,
                    rollout: None,
                })),
            };
            // What is asked later is asked of this simulator, for the seat is another's then.
            let own = |mut rollout: Rollout| {
                rollout.simulator = self.clone();
                rollout
            };
            made.map(own).map_err(|mut halted| {
                halted.rollout = halted.rollout.map(own);
                halted
            })
        })
    }

    /// [`Rollout::vjp`] of many rollouts of this simulator, each with its own cotangents, in their order. `progress` is called after each step back of any of them, and
    /// ends the batch where it breaks.
    ///
    /// # Errors
    /// Rollouts of another simulator, and other numbers of cotangents than of rollouts; a device that fails before any sweep; what befalls one sweep is its own.
    pub fn vjp_batch(
        &self,
        rollouts: &[&Rollout],
        cotangents: &[Cotangents],
        progress: impl Fn() -> ControlFlow<()> + Sync,
    ) -> Result<(Vec<Result<Gradient>>, BatchReport)> {
        self.swept("vjp_batch", rollouts, cotangents, progress)
    }

    /// [`Simulator::vjp_batch`], as `name` for messages.
    fn swept(
        &self,
        name: &str,
        rollouts: &[&Rollout],
        cotangents: &[Cotangents],
        progress: impl Fn() -> ControlFlow<()> + Sync,
    ) -> Result<(Vec<Result<Gradient>>, BatchReport)> {
        if rollouts.len() != cotangents.len() {
            return Err(Error::input(
                format!("{name}: cotangents"),
                format!("of {} rollouts", cotangents.len()),
                format!("must be of {}", rollouts.len()),
            ));
        }
        let same = |r: &&&Rollout| Arc::ptr_eq(&r.simulator.assembled, &self.assembled);
        if let Some(other) = rollouts.iter().position(|r| !same(&r)) {
            return Err(Error::input(
                format!("{name}: rollout {other}"),
                "one of another simulator",
                "must be this simulator's, with these parameters",
            ));
        }
        self.side_by_side(rollouts.len(), |simulator, m| {
            rollouts[m].vjp_here(simulator, &cotangents[m], |_| progress())
        })
    }

    /// [`Rollout::gradient`] of an objective of many rollouts of this simulator, with `progress` as of [`Simulator::vjp_batch`].
    ///
    /// # Errors
    /// As [`Simulator::vjp_batch`], and an objective that doesn't fit the scene.
    pub fn gradient_batch(
        &self,
        rollouts: &[&Rollout],
        objective: &(dyn Objective + Sync),
        progress: impl Fn() -> ControlFlow<()> + Sync,
    ) -> Result<(Vec<Result<Gradient>>, BatchReport)> {
        let bars = rollouts.iter().map(|rollout| {
            objective.check(rollout)?;
            objective.try_cotangents(rollout)
        });
        let bars = bars.collect::<Result<Vec<_>>>()?;
        self.swept("gradient_batch", rollouts, &bars, progress)
    }

    /// `work` of so many members, in their order; each gets a simulator whose coupling is computed together with the others', if this one's can be.
    fn side_by_side<T: Send>(
        &self,
        members: usize,
        work: impl Fn(&Self, usize) -> T + Sync,
    ) -> Result<(Vec<T>, BatchReport)> {
        let started = Instant::now();
        let system = self.system();
        let columns = system.tree.velocities() + usize::from(system.has_current());
        // Without water nothing is asked of the coupling.
        let together = match self.parameters().density() > 0.0 {
            true => system.coupling.together(members, columns)?,
            false => None,
        };
        let Some(table) = together else {
            let all = (0..members).into_par_iter();
            let out = all.map(|m| work(self, m)).collect();
            let report = BatchReport {
                seconds: started.elapsed().as_secs_f64(),
                ..BatchReport::default()
            };
            return Ok((out, report));
        };
        let out = seated(self, table.as_ref(), members, work)?;
        let report = BatchReport {
            seconds: started.elapsed().as_secs_f64(),
            seats: table.seats(),
            together: table.report(),
        };
        Ok((out, report))
    }

    /// The same with another coupling.
    fn with_coupling(&self, coupling: Arc<dyn crate::coupling::Coupling>) -> Self {
        let mut out = self.clone();
        Arc::make_mut(&mut out.assembled).system.coupling = coupling;
        out
    }
}

/// Members in lockstep: whoever is done makes room for the next, so that all seats stay taken to the end.
fn seated<T: Send>(
    simulator: &Simulator,
    table: &dyn Together,
    members: usize,
    work: impl Fn(&Simulator, usize) -> T + Sync,
) -> Result<Vec<T>> {
    let found: Vec<Mutex<Option<T>>> = (0..members).map(|_| Mutex::default()).collect();
    let next = AtomicUsize::new(0);
    // One for all: its meshes and what else is prepared are large.
    let own = simulator.with_coupling(table.coupling());
    table.side_by_side(&|_| {
        loop {
            let m = next.fetch_add(1, Ordering::Relaxed);
            let Some(place) = found.get(m) else {
                break;
            };
            let made = work(&own, m);
            *place.lock().unwrap_or_else(PoisonError::into_inner) = Some(made);
        }
    })?;
    let out: Option<Vec<T>> = found
        .into_iter()
        .map(|place| place.into_inner().unwrap_or_else(PoisonError::into_inner))
        .collect();
    out.ok_or_else(|| Error::Unsupported {
        what: format!("a batch of {members} members"),
        why: "a member ended without a result".into(),
        instead: "use fewer members, or the backend cpu".into(),
    })
}
