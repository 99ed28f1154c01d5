//! One scene's coupling among many.

use super::group::{Group, SLOTS};
use super::question::{Kind, Question, STATUS};
use super::runner::Answer;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3};
use crate::coupling::CouplingReport;
use crate::coupling::reduced::ReducedBody;
use crate::gpu::lanczos;
use crate::gpu::units::{Twists, placements};
use nalgebra::DMatrix;
use std::f64::consts::PI;
use std::sync::{Arc, Mutex, PoisonError};

/// 4π: a source of strength α makes the flux 4πα.
pub(super) const FLUX: f64 = 4.0 * PI;

/// The fidelity reduced of one of many equal scenes.
pub(super) struct Seat {
    pub group: Arc<Group>,
    /// Its number in the group.
    pub number: usize,
    /// What each slot holds: numbers of evaluations, from 1 on.
    slots: Mutex<Slots>,
}

#[derive(Default)]
struct Slots {
    held: [u64; SLOTS],
    /// Evaluations so far.
    count: u64,
}

/// A slot as long as it holds what was put there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    slot: usize,
    evaluation: u64,
}

/// What an evaluation came to.
pub(super) struct Found {
    pub momenta: DMatrix<f64>,
    pub report: CouplingReport,
    pub middle: Vec3,
    /// Of all pairs of columns, in the device's units.
    pub wrenches: Vec<f64>,
}

impl Seat {
    pub fn new(group: &Arc<Group>, number: usize) -> Self {
        Self {
            group: group.clone(),
            number,
            slots: Mutex::default(),
        }
    }

    fn slots(&self) -> std::sync::MutexGuard<'_, Slots> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The slot that was used longest ago, for another evaluation.
    fn take(&self) -> Held {
        let mut slots = self.slots();
        slots.count += 1;
        let evaluation = slots.count;
        let slot = (evaluation % SLOTS as u64) as usize;
        slots.held[slot] = evaluation;
        Held { slot, evaluation }
    }

    /// Whether a slot still holds it.
    pub fn holds(&self, held: Held) -> bool {
        self.slots().held[held.slot] == held.evaluation
    }

    /// The slot among those of the group.
    pub fn place(&self, held: Held) -> u32 {
        (self.number * SLOTS + held.slot) as u32
    }

    /// Numbers as the device has them.
    pub fn bytes(&self, values: &[f64]) -> Vec<u8> {
        self.group.model.context.fine().bytes(values)
    }

    /// Asks one question at new poses.
    ///
    /// # Errors
    /// A device that fails.
    pub fn put(
        &self,
        kind: Kind,
        poses: &[Pose],
        twists: &Twists,
    ) -> Result<(Held, Vec3, Option<Answer>)> {
        let model = &self.group.model;
        let held = self.take();
        let (middle, mut values) = placements(poses, &model.images, model.length);
        values.extend(twists.numbers());
        let question = Question {
            kind,
            slot: self.place(held),
            input: self.bytes(&values),
            direction: Vec::new(),
        };
        let answer = self.group.ask(self.number, vec![question])?.pop();
        Ok((held, middle, answer))
    }

    /// Whether the device is asked at all: the columns must be those that it keeps, and no gap may have a film.
    ///
    /// # Errors
    /// Bodies that touch.
    fn asks(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<bool> {
        let sizes = &self.group.model.sizes;
        let right = poses.len() == sizes.bodies && basis.nrows() == 6 * sizes.bodies;
        let fits = right && basis.ncols() == sizes.columns;
        Ok(fits && !self.group.model.reduced.narrow(poses)?)
    }

    /// Solves for the basis; `None` where the CPU is to.
    ///
    /// # Errors
    /// A device that fails, bodies that touch, or a solution that means nothing.
    pub fn solve(
        &self,
        kind: Kind,
        poses: &[Pose],
        basis: &DMatrix<f64>,
    ) -> Result<Option<(Held, Found)>> {
        let model = &self.group.model;
        if !self.asks(poses, basis)? {
            self.group.count_alone();
            return Ok(None);
        }
        let twists = Twists::new(basis.clone(), model.length);
        let (held, middle, answer) = self.put(kind, poses, &twists)?;
        let Some(answer) = answer else {
            return Ok(None);
        };
        let [solved, wrenches] = answer.numbers(model);
        let (values, status) = solved.split_at(6 * model.sizes.bodies * model.sizes.columns);
        let condition = condition(&status[STATUS..]);
        let (Some(condition), true) = (condition, is_solved(status)) else {
            // The CPU's factor tells what is wrong, if anything is.
            self.group.count_alone();
            return Ok(None);
        };
        let momenta = impulses(model.reduced.reduced_bodies(), &twists, values);
        model
            .reduced
            .check_solution(poses, basis, &momenta, condition)?;
        let report = CouplingReport {
            iterations: status[2] as usize,
            residual: status[3],
            asymmetry: 0.0,
            condition,
        };
        self.group.count_iterations(report.iterations);
        let found = Found {
            momenta,
            report,
            middle,
            wrenches,
        };
        Ok(Some((held, found)))
    }
}

/// Whether a status tells of a solve that came to its end.
pub(super) fn is_solved(status: &[f64]) -> bool {
    status[0] == 0.0 && status[1] == 0.0
}

/// Impulses of columns of twists, from the potentials' part of them.
pub(super) fn impulses(
    bodies: &[Arc<ReducedBody>],
    twists: &Twists,
    values: &[f64],
) -> DMatrix<f64> {
    let mut out = twists.impulses(values, FLUX);
    for (b, body) in bodies.iter().enumerate() {
        let mut rows = out.rows_mut(6 * b, 6);
        rows += body.parts().added_mass * twists.all.rows(6 * b, 6);
    }
    out
}

/// Condition number from the probe's coefficients, from below. `None` of a system that isn't positive definite.
fn condition(history: &[f64]) -> Option<f64> {
    let steps = history[0] as usize;
    let (alpha, beta) = (|j: usize| history[1 + 2 * j], |j: usize| history[2 + 2 * j]);
    match lanczos::extremes(steps, alpha, beta) {
        None => Some(1.0),
        Some([low, high]) => (low > 0.0 && high.is_finite()).then(|| high / low),
    }
}
