//! Contact in water that bodies feel each other through: what the water does to a motion, quadratic in it, is that of the motion which contact leaves.
//!
//! A stage ends with the velocity v* at which it has the water's force c(q, v*) too. What rests on a floor falls by Δt g in it, and was pressed by c(q, v*) of order Δt² in every step,
//! though it doesn't move. So contact is solved twice: as for any step ([`super::contact`]) for the velocity v_s that the step moves by, and for the momenta once more
//!
//! ```text
//! M (v_e − v*) = Δt (c(q, v_s) − c(q, v*)) + Δt g(q, v_e)      p̂⁺ = p̂ + Δt f(q, v*) + Δt (c(q, v_s) − c(q, v*)) + Δt g(q, v_e)
//! ```

use super::contact::{Problem, pressed, solve, solve_pushed};
use super::stages::{ContactVelocities, Stages};
use super::start::Start;
use super::{State, StateBar, StateTangents, StepBar, StepTangents};
use crate::Result;
use crate::dynamics::slopes::columns;
use nalgebra::{DMatrix, DVector};

/// The end of a step from the velocity and the frame momenta before contact.
pub(super) fn apply(
    start: &Start,
    before: DVector<f64>,
    hat: DVector<f64>,
) -> Result<(State, Stages)> {
    let after = solve(start, &before, start.stepper.dt)?;
    let mut velocities = ContactVelocities::new(before, after);
    let mut hat = hat;
    if answers(start, &velocities.before) {
        let (dt, drift) = (start.stepper.dt, &start.stepper.system.drift);
        let change = change(start, &velocities)?;
        let push = dt * start.e.user_momentum(&change);
        velocities.end = Some(solve_pushed(start, &velocities.before, &push, dt)?);
        hat += drift.carry(dt, dt * change);
    }
    let hat = pressed(start, &velocities.before, velocities.acting(), hat);
    let next = start.next_state(start.advance(&velocities.after), hat);
    Ok((next, Stages::Contact(velocities)))
}

/// Whether something presses in such water.
fn answers(start: &Start, before: &DVector<f64>) -> bool {
    start.e.is_coupled() && start.near.contact_acts(before)
}

/// c(q, v_s) − c(q, v*), frame coordinates.
fn change(start: &Start, velocities: &ContactVelocities) -> Result<DVector<f64>> {
    let ContactVelocities { before, after, .. } = velocities;
    Ok(start.e.motion_force(after)? - start.e.motion_force(before)?)
}

/// What the derivatives of [`apply`] need.
pub(super) struct Adjoint<'s, 'a> {
    pub velocities: &'s ContactVelocities,
    moved: Problem<'a>,
    end: Option<End<'a>>,
}

struct End<'a> {
    problem: Problem<'a>,
    change: DVector<f64>,
}

impl<'s, 'a> Adjoint<'s, 'a> {
    /// At a step's velocities before and after contact.
    pub fn new(start: &Start<'_, 'a>, velocities: &'s ContactVelocities) -> Result<Self> {
        let dt = start.stepper.dt;
        let ContactVelocities { before, after, end } = velocities;
        let end = end.as_ref().map(|end| {
            Ok(End {
                problem: Problem::new(start, before, end, dt)?,
                change: change(start, velocities)?,
            })
        });
        Ok(Self {
            velocities,
            moved: Problem::new(start, before, after, dt)?,
            end: end.transpose()?,
        })
    }

    /// Tangents of [`apply`], from those of the velocity and of the momenta before contact: of the state, and of the velocity by which the step moves.
    pub fn apply_jvp(
        &self,
        start: &Start,
        along: &StepTangents,
        before: &DMatrix<f64>,
        mut hat: DMatrix<f64>,
    ) -> Result<(StateTangents, DMatrix<f64>)> {
        let after = self.moved.solve_jvp(start, along, before)?;
        let hat = match &self.end {
            None => self.moved.pressed_jvp(start, along, &after, hat),
            Some(End { problem, change }) => {
                let (e, dt, drift) = (start.e, start.stepper.dt, &start.stepper.system.drift);
                let at = |v: &DVector<f64>, along_v: &DMatrix<f64>| {
                    let slopes = e.motion_force_slopes(v, &start.split.free)?;
                    Ok(slopes.along(along.q, Some(along_v), along.inputs))
                };
                let ContactVelocities {
                    before: v,
                    after: u,
                    ..
                } = self.velocities;
                let changed: Result<_> = at(u, &after);
                let changed = changed? - at(v, before)?;
                let push = columns(&changed, |c| e.user_momentum(c));
                let push = dt * (push + e.frame_momentum_slope(change) * along.q);
                let end = problem.solve_pushed_jvp(start, along, before, &push)?;
                hat += columns(&changed, |c| drift.carry(dt, dt * c));
                problem.pressed_jvp(start, along, &end, hat)
            }
        };
        let next = StateTangents {
            q: start.advance_jvp(&self.velocities.after, along.q, &after),
            y: start.next_momenta(hat),
        };
        Ok((next, after))
    }

    /// Transpose of [`apply`]: cotangents of the velocity and of the momenta before contact, with that of the velocity by which the step moves from elsewhere; the rest is added to `bar`.
    pub fn apply_vjp(
        &self,
        start: &Start,
        next_bar: &StateBar,
        own: Option<&DVector<f64>>,
        bar: &mut StepBar,
    ) -> Result<(DVector<f64>, DVector<f64>)> {
        let (q_bar, mut after_bar) = start.advance_vjp(&self.velocities.after, &next_bar.q);
        bar.state.q += q_bar;
        if let Some(own) = own {
            after_bar += own;
        }
        let hat_bar = start.next_momentum_bar(next_bar);
        let mut before_bar = DVector::zeros(hat_bar.len());
        match &self.end {
            None => after_bar += self.moved.pressed_vjp(start, &hat_bar, bar),
            Some(End { problem, change }) => {
                let (e, dt, drift) = (start.e, start.stepper.dt, &start.stepper.system.drift);
                let end_bar = problem.pressed_vjp(start, &hat_bar, bar);
                let (held, push_bar) = problem.solve_pushed_vjp(start, &end_bar, bar)?;
                bar.state.q += dt * e.frame_velocity_vjp(&push_bar, change);
                let change_bar =
                    drift.carry_back(dt, dt * &hat_bar) + dt * e.frame_velocity(&push_bar);
                let ContactVelocities {
                    before: v,
                    after: u,
                    ..
                } = self.velocities;
                let left = e.motion_force_vjp(u, &change_bar)?;
                let had = e.motion_force_vjp(v, &change_bar)?;
                bar.add(1.0, &left);
                bar.add(-1.0, &had);
                after_bar += left.v;
                before_bar += held - had.v;
            }
        }
        before_bar += self.moved.solve_vjp(start, &after_bar, bar)?;
        Ok((before_bar, hat_bar))
    }
}
