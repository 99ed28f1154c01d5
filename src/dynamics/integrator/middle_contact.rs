//! Limits of joints in a step whose forces are those of its middle: solved twice, as for any step ([`super::contact`]).
//!
//! From the velocity v₀ at the step's start and its mean v without contact
//!
//! ```text
//! M (v_s − v) = ½ Δt G(q, v_s)            q⁺ = q ⊕ Δt v_s
//! M (v_e − (2v − v₀)) = P + Δt g(q, v_e)  p̂⁺ = p̂ + Δt f + X⁻ᵀ (P + Δt g(q, v_e))
//! ```
//!
//! with P for the force that the motion v_s makes itself rather than v ([`super::motion_push`]), and for what resists it; G is g with that ([`super::reaction`]).
//! The mean velocity v_s has half of contact's impulse in it, as it has of all other forces', and the velocity v_e at the end the whole: what rests reads as at rest, where the one
//! problem would leave the half of what presses in its velocity. Both stop at what they meet.

use super::contact::{Problem, pressed, solve, solve_pushed};
use super::motion_push::{MotionPush, Push};
use super::reaction::Resisting;
use super::stages::{ContactVelocities, Stages};
use super::start::Start;
use super::{State, StateBar, StateTangents, StepBar, StepTangents};
use crate::Result;
use nalgebra::{DMatrix, DVector};

/// The end of a step from its mean velocity and the frame momenta before contact.
pub(super) fn apply(
    start: &Start,
    mean: DVector<f64>,
    mut hat: DVector<f64>,
) -> Result<(State, Stages)> {
    let dt = start.stepper.dt;
    let free = at_end(start, &mean);
    let after = solve(start, &mean, 0.5 * dt, Resisting::InMiddle)?;
    let mut velocities = ContactVelocities::new(mean, after);
    let end = match MotionPush::new(start, &velocities, Resisting::InMiddle)? {
        None => solve(start, &free, dt, Resisting::No)?,
        Some(motion) => {
            let push = motion.push(start);
            hat += push.frame;
            solve_pushed(
                start,
                &free,
                &push.user,
                dt,
                &velocities.after,
                Resisting::No,
            )?
        }
    };
    let hat = pressed(start, &free, &end, hat, Resisting::No);
    let next = start.next_state(start.advance(&velocities.after), hat);
    velocities.end = Some(end);
    Ok((next, Stages::Contact(velocities)))
}

/// The velocity at the end of a step without contact; where something drives it, the mean.
fn at_end(start: &Start, mean: &DVector<f64>) -> DVector<f64> {
    let mut out = mean.clone();
    for &i in &start.split.free {
        out[i] = 2.0 * mean[i] - start.v[i];
    }
    out
}

/// What the derivatives of [`apply`] need.
pub(super) struct Adjoint<'s, 'a> {
    pub velocities: &'s ContactVelocities,
    mean: Problem<'a>,
    end: Problem<'a>,
    motion: Option<MotionPush>,
}

impl<'s, 'a> Adjoint<'s, 'a> {
    /// At a step's velocities before and after contact.
    pub fn new(start: &Start<'_, 'a>, velocities: &'s ContactVelocities) -> Result<Self> {
        let dt = start.stepper.dt;
        let ContactVelocities { before, after, .. } = velocities;
        let free = at_end(start, before);
        let motion = MotionPush::new(start, velocities, Resisting::InMiddle)?;
        let end = match motion {
            None => Problem::new(start, &free, velocities.acting(), dt, Resisting::No)?,
            Some(_) => Problem::pushed(start, &free, velocities.acting(), dt, Resisting::No)?,
        };
        Ok(Self {
            velocities,
            mean: Problem::new(start, before, after, 0.5 * dt, Resisting::InMiddle)?,
            end,
            motion,
        })
    }

    /// Tangents of [`apply`], from those of the mean velocity and of the momenta before contact.
    pub fn apply_jvp(
        &self,
        start: &Start<'_, 'a>,
        along: &StepTangents,
        mean: &DMatrix<f64>,
        mut hat: DMatrix<f64>,
    ) -> Result<StateTangents> {
        let after = self.mean.solve_jvp(start, along, mean)?;
        let mut free = mean.clone();
        for &i in &start.split.free {
            free.set_row(i, &(2.0 * mean.row(i) - along.v.row(i)));
        }
        let end = match &self.motion {
            None => self.end.solve_jvp(start, along, &free)?,
            Some(motion) => {
                let push = motion.push_jvp(start, along, self.velocities, [mean, &after])?;
                hat += push.frame;
                (self.end).solve_pushed_jvp(start, along, &free, &push.user)?
            }
        };
        let hat = self.end.pressed_jvp(start, along, [&free, &end], hat);
        Ok(StateTangents {
            q: start.advance_jvp(&self.velocities.after, along.q, &after),
            y: start.next_momenta(hat),
        })
    }

    /// Transpose of [`apply`]: cotangents of the mean velocity and of the momenta before contact; the rest is added to `bar`.
    pub fn apply_vjp(
        &self,
        start: &Start<'_, 'a>,
        next_bar: &StateBar,
        bar: &mut StepBar,
    ) -> Result<(DVector<f64>, DVector<f64>)> {
        let (q_bar, mut after_bar) = start.advance_vjp(&self.velocities.after, &next_bar.q);
        bar.state.q += q_bar;
        let hat_bar = start.next_momentum_bar(next_bar);
        let [own_bar, end_bar] = self.end.pressed_vjp(start, &hat_bar, bar);
        let (mut free_bar, user) = self.end.solve_pushed_vjp(start, &end_bar, bar)?;
        free_bar += own_bar;
        let mut mean_bar = DVector::zeros(hat_bar.len());
        if let Some(motion) = &self.motion {
            let frame = hat_bar.clone();
            let push_bar = Push { user, frame };
            let own = motion.push_vjp(start, self.velocities, &push_bar, bar)?;
            after_bar += own.after;
            mean_bar += own.before;
        }
        for &i in &start.split.free {
            bar.v[i] -= free_bar[i];
            free_bar[i] *= 2.0;
        }
        mean_bar += self.mean.solve_vjp(start, &after_bar, bar)?;
        Ok((mean_bar + free_bar, hat_bar))
    }
}
