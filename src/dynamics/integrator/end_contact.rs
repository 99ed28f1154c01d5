//! Contact in a step whose forces are those of its end: solved as for any step ([`super::contact`]) for the velocity v_s that it moves by, and for the momenta once more, with the force that
//! this motion makes itself ([`super::motion_push`])
//!
//! ```text
//! M (v_e − v*) = P + Δt g(q, v_e)      p̂⁺ = p̂ + Δt f(q, v*) + X⁻ᵀ (P + Δt g(q, v_e))
//! ```
//!
//! Where v* has with it what contact bears already, λ ([`super::hold`]), v* is about v_s, and there is one problem, M (v_s − v*) = Δt g(q, v_s) − λ.

use super::contact::{Problem, pressed, solve, solve_pushed};
use super::hold::Hold;
use super::motion_push::{MotionPush, Push};
use super::reaction::Resisting;
use super::stages::ContactVelocities;
use super::start::Start;
use super::{State, StateBar, StateTangents, StepBar, StepTangents};
use crate::Result;
use crate::dynamics::slopes::columns;
use nalgebra::{DMatrix, DVector};

/// The end of a step from the velocity and the frame momenta before contact, which have with them what it bears already.
pub(super) fn apply(
    start: &Start,
    before: DVector<f64>,
    mut hat: DVector<f64>,
    hold: Option<Hold>,
) -> Result<(State, ContactVelocities)> {
    let dt = start.stepper.dt;
    if let Some(hold) = hold {
        let (held, Push { user, frame }) = hold.into_parts();
        let after = solve_pushed(start, &before, &-user, dt, &before, Resisting::AtStart)?;
        let mut velocities = ContactVelocities::new(before, after);
        velocities.held = Some(held);
        let carried = start.stepper.system.drift.carry(dt, frame);
        let next = ends(start, &velocities, hat - carried);
        return Ok((next, velocities));
    }
    let after = solve(start, &before, dt, Resisting::AtStart)?;
    let mut velocities = ContactVelocities::new(before, after);
    if let Some(motion) = MotionPush::new(start, &velocities, Resisting::No)? {
        let push = motion.push(start);
        velocities.end = Some(solve_pushed(
            start,
            &velocities.before,
            &push.user,
            dt,
            &velocities.after,
            Resisting::AtStart,
        )?);
        hat += push.frame;
    }
    let next = ends(start, &velocities, hat);
    Ok((next, velocities))
}

/// The state at the end of a step with these velocities, from the frame momenta with all but contact.
fn ends(start: &Start, velocities: &ContactVelocities, hat: DVector<f64>) -> State {
    let ContactVelocities { before, .. } = velocities;
    let hat = pressed(start, before, velocities.acting(), hat, Resisting::AtStart);
    start.next_state(start.advance(&velocities.after), hat)
}

/// What the derivatives of [`apply`] need.
pub(super) struct Adjoint<'s, 'a> {
    pub velocities: &'s ContactVelocities,
    moved: Problem<'a>,
    end: Option<End<'a>>,
}

/// Cotangents of what [`apply`] starts from.
pub(super) struct EndBar {
    /// Of the velocity before contact.
    pub before: DVector<f64>,
    /// Of the frame momenta before contact.
    pub hat: DVector<f64>,
    /// Of what contact bears already.
    pub borne: Push<DVector<f64>>,
}

struct End<'a> {
    problem: Problem<'a>,
    motion: MotionPush,
}

impl<'s, 'a> Adjoint<'s, 'a> {
    /// At a step's velocities before and after contact.
    pub fn new(start: &Start<'_, 'a>, velocities: &'s ContactVelocities) -> Result<Self> {
        let dt = start.stepper.dt;
        let ContactVelocities {
            before,
            after,
            held,
            ..
        } = velocities;
        let motion = match held {
            None => MotionPush::new(start, velocities, Resisting::No)?,
            Some(_) => None,
        };
        let end = motion.map(|motion| {
            Ok(End {
                problem: Problem::pushed(
                    start,
                    before,
                    velocities.acting(),
                    dt,
                    Resisting::AtStart,
                )?,
                motion,
            })
        });
        Ok(Self {
            velocities,
            moved: match held {
                None => Problem::new(start, before, after, dt, Resisting::AtStart)?,
                Some(_) => Problem::pushed(start, before, after, dt, Resisting::AtStart)?,
            },
            end: end.transpose()?,
        })
    }

    /// The state at the end of the step, from the frame momenta before contact, of a step in which it bears nothing already.
    pub fn reached(&self, start: &Start, mut hat: DVector<f64>) -> State {
        if let Some(End { motion, .. }) = &self.end {
            hat += motion.push(start).frame;
        }
        ends(start, self.velocities, hat)
    }

    /// Tangents of [`apply`], from those of the velocity and of the momenta before contact, and of what it bears already: of the state, and of the velocity with which contact acts.
    pub fn apply_jvp(
        &self,
        start: &Start<'_, 'a>,
        along: &StepTangents,
        before: &DMatrix<f64>,
        mut hat: DMatrix<f64>,
        borne: Option<&Push<DMatrix<f64>>>,
    ) -> Result<(StateTangents, DMatrix<f64>)> {
        let velocities = self.velocities;
        let after = match borne {
            None => self.moved.solve_jvp(start, along, before)?,
            Some(Push { user, .. }) => {
                (self.moved).solve_pushed_jvp(start, along, before, &-user)?
            }
        };
        if let Some(Push { frame, .. }) = borne {
            let (dt, drift) = (start.stepper.dt, &start.stepper.system.drift);
            hat -= columns(frame, |p| drift.carry(dt, p.clone()));
        }
        let q = start.advance_jvp(&velocities.after, along.q, &after);
        let (problem, acting) = match &self.end {
            None => (&self.moved, after),
            Some(End { problem, motion }) => {
                let push = motion.push_jvp(start, along, velocities, [before, &after])?;
                hat += push.frame;
                let end = problem.solve_pushed_jvp(start, along, before, &push.user)?;
                (problem, end)
            }
        };
        let hat = problem.pressed_jvp(start, along, [before, &acting], hat);
        let next = StateTangents {
            q,
            y: start.next_momenta(hat),
        };
        Ok((next, acting))
    }

    /// Transpose of [`apply`], with the cotangent of the velocity with which contact acts from elsewhere; the rest is added to `bar`.
    pub fn apply_vjp(
        &self,
        start: &Start<'_, 'a>,
        next_bar: &StateBar,
        own: Option<&DVector<f64>>,
        bar: &mut StepBar,
    ) -> Result<EndBar> {
        let (q_bar, mut after_bar) = start.advance_vjp(&self.velocities.after, &next_bar.q);
        bar.state.q += q_bar;
        let hat_bar = start.next_momentum_bar(next_bar);
        let problem = self.end.as_ref().map_or(&self.moved, |end| &end.problem);
        let [mut before_bar, mut acting_bar] = problem.pressed_vjp(start, &hat_bar, bar);
        if let Some(own) = own {
            acting_bar += own;
        }
        match &self.end {
            None => after_bar += acting_bar,
            Some(End { problem, motion }) => {
                let (held, user) = problem.solve_pushed_vjp(start, &acting_bar, bar)?;
                let frame = hat_bar.clone();
                let push_bar = Push { user, frame };
                let own = motion.push_vjp(start, self.velocities, &push_bar, bar)?;
                after_bar += own.after;
                before_bar += held + own.before;
            }
        }
        let (held, user) = self.moved.solve_pushed_vjp(start, &after_bar, bar)?;
        before_bar += held;
        let (dt, drift) = (start.stepper.dt, &start.stepper.system.drift);
        let borne = Push {
            user: -user,
            frame: -drift.carry_back(dt, hat_bar.clone()),
        };
        Ok(EndBar {
            before: before_bar,
            hat: hat_bar,
            borne,
        })
    }
}
