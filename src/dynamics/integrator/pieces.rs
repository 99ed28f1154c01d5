//! A step, as it is or cut into equal pieces: each a step of its own with the same control and the same joints held.
//!
//! It is cut where contact or limits foresee that it passes something ([`Stepper::foreseen`]), where the inertia changes too much in its
//! implicit stage, where it fails, and where it turns out to have passed something; then into twice as many pieces, to [`SEEN`](super::plan::SEEN) or [`MOST`](super::plan::MOST) at most.

use super::plan::{Halt, Plan, Stops};
use super::record::{LaterPiece, StepRecord};
use super::stages::Stages;
use super::start::Start;
use super::{Input, Integrator, State, Stepper};
use super::{euler, midpoint, runge_kutta, velocity_euler};
use crate::dynamics::answers::Answers;
use crate::dynamics::contact_force::contact_forces;
use crate::dynamics::force::{CoarseGap, coarser};
use crate::dynamics::{ContactForce, Linearisation};
use crate::{Error, Result};
use nalgebra::DVector;

/// What a piece comes to.
struct Piece {
    next: State,
    stages: Stages,
    answers: Answers,
    passed: Stops,
    coarse: Option<CoarseGap>,
}

impl<'a> Stepper<'a> {
    /// One step from `state`, at which `e` was evaluated and where the velocity is `v`
    /// ([`Stepper::velocity`]). It is made in pieces where it is too long for its motion, or fails.
    ///
    /// # Errors
    /// A solve that misses its tolerance or a step too long for its implicit stage, in as many pieces as there may be.
    pub fn step(
        &self,
        e: &Linearisation<'a>,
        state: &State,
        v: &DVector<f64>,
        input: &Input,
    ) -> Result<(State, StepRecord)> {
        let path = self.split_of_step(state, input).complete(v);
        let mut plan = match self.integrator.solves_contact() {
            true => self.foreseen(e, &path)?,
            false => Plan::whole(),
        };
        loop {
            let may_cut = self.integrator.solves_contact() && plan.may_cut();
            match self.planned(e, state, v, input, &plan) {
                Ok((next, record)) if !self.is_curable(&plan, &record.passed) => {
                    return Ok((next, record));
                }
                Ok((_, record)) => plan.cure(&self.rigid(&record.passed)),
                Err(Halt::TooLong(times)) => plan.cut(times),
                Err(Halt::Failed(error)) if may_cut && may_end(&error) => plan.cut(2),
                Err(Halt::Failed(error)) => return Err(error),
            }
        }
    }

    /// What of it presses more stiffly in more pieces: a stiffness that was given stays what it is.
    fn rigid(&self, passed: &Stops) -> Stops {
        let contact = self.system.contact.as_ref();
        passed.sharper(contact.is_none_or(|m| m.rigid))
    }

    /// Whether what was passed asks for another plan.
    fn is_curable(&self, plan: &Plan, passed: &Stops) -> bool {
        self.integrator.solves_contact() && plan.cures(passed, &self.rigid(passed))
    }

    /// A step in the pieces that `plan` asks for.
    fn planned(
        &self,
        e: &Linearisation<'a>,
        state: &State,
        v: &DVector<f64>,
        input: &Input,
        plan: &Plan,
    ) -> std::result::Result<(State, StepRecord), Halt> {
        let n = plan.pieces;
        let stepper = Self {
            dt: self.dt / n as f64,
            ..*self
        };
        let first = State {
            step: n * state.step,
            ..state.clone()
        };
        let Piece {
            mut next,
            stages,
            answers,
            mut passed,
            mut coarse,
        } = stepper.piece(e, &first, v, input, plan)?;
        let mut later = Vec::with_capacity(n - 1);
        // What was passed is made again in more pieces, if there may be more.
        while later.len() + 1 < n && !self.is_curable(plan, &passed) {
            let e = stepper.linearise(&next.q, stepper.time(&next))?;
            let v = stepper.velocity(&e, &next)?;
            let piece = stepper.piece(&e, &next, &v, input, plan)?;
            passed.add(&piece.passed);
            coarse = coarser(coarse, piece.coarse);
            let state = std::mem::replace(&mut next, piece.next);
            later.push(LaterPiece {
                state,
                v,
                stages: piece.stages,
                answers: piece.answers,
            });
        }
        if n > 1 {
            next.step = state.step + 1;
            self.place_motions(&mut next.q, next.step as f64 * self.dt);
        }
        let record = StepRecord {
            state: state.clone(),
            v: v.clone(),
            input: input.clone(),
            integrator: self.integrator,
            dt: self.dt,
            plan: plan.clone(),
            stages,
            answers,
            later,
            passed,
            coarse,
        };
        Ok((next, record))
    }

    /// A piece of a step, or the whole.
    fn piece(
        &self,
        e: &Linearisation<'a>,
        state: &State,
        v: &DVector<f64>,
        input: &Input,
        plan: &Plan,
    ) -> std::result::Result<Piece, Halt> {
        let split = self.split_of_step(state, input);
        let near = self.near(e, &split.complete(v), plan)?;
        let start = Start {
            stepper: self,
            e,
            near: near.as_ref().unwrap_or(e),
            plan,
            state,
            v,
            input,
            split: &split,
        };
        let (next, stages) = match self.integrator {
            Integrator::MomentumEuler => euler::step(&start)?,
            Integrator::EnergyEuler => euler::closed_step(&start)?,
            Integrator::Midpoint => midpoint::step(&start)?,
            Integrator::Rk2 => runge_kutta::step(&start, &runge_kutta::SECOND)?,
            Integrator::Rk4 => runge_kutta::step(&start, &runge_kutta::FOURTH)?,
            Integrator::VelocityEuler => velocity_euler::step(&start)?,
        };
        let passed = match &stages {
            Stages::Contact(velocities) | Stages::Touching(velocities) => {
                self.passed(&start, velocities)
            }
            Stages::RungeKutta(_) => Stops::default(),
        };
        let own = stages.contact_velocities();
        let own = (own.into_iter()).flat_map(|c| {
            [&c.before, &c.after]
                .into_iter()
                .chain(&c.end)
                .chain(&c.held)
        });
        Ok(Piece {
            answers: e.answers(std::iter::once(v).chain(own)),
            next,
            stages,
            passed,
            coarse: start.near.coarse_gap(),
        })
    }

    /// Contacts during a step: where something presses, or surfaces are no more than `slack` (m) farther apart than the gap at which they
    /// touch. In a step of several pieces each acts for its part of the step, and its force is the mean over the step.
    ///
    /// # Errors
    /// A signed distance that can't be found.
    pub fn contact_forces(&self, record: &StepRecord, slack: f64) -> Result<Vec<ContactForce>> {
        let (system, stepper) = (self.system, self.of_pieces(record));
        let mut out = Vec::new();
        for (state, v, _, stages) in record.parts() {
            let kinematics = system.tree.kinematics(&state.q);
            let path = stepper.split_of_step(&state, &record.input).complete(v);
            let seen = stepper.seen(&kinematics, &state.q, &path, &record.plan)?;
            let points = match seen {
                Some(points) => points,
                None => system.contact_points(self.parameters, &kinematics.poses)?,
            };
            let acting = stages.contact_velocities().map_or(v, |v| v.acting());
            let twists = system.tree.twists(&kinematics, acting);
            let mut found = contact_forces(&points, &twists, slack);
            if record.pieces() > 1 {
                let forces =
                    (found.iter_mut()).flat_map(|c| c.force.iter_mut().chain(&mut c.torque));
                forces.for_each(|x| *x /= record.pieces() as f64);
            }
            out.extend(found);
        }
        Ok(out)
    }
}

/// Whether a shorter step may do better: solves, and states that have run away.
fn may_end(error: &Error) -> bool {
    matches!(
        error,
        Error::Solver { .. } | Error::Unresolved { .. } | Error::Input { .. }
    )
}
