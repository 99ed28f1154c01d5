//! The paper's semi-implicit Euler in velocity (Eq. 3–4): v⁺ = v + Δt a(q, v, u), q⁺ = q ⊕ Δt v⁺.
//!
//! Joints that follow a motion have its mean velocity over the step in q⁺, and in a the change of its velocity over the step.
//!
//! With contact, v⁺ is what [`contact::solve`] makes of that velocity at q.

use super::contact;
use super::reaction::Resisting;
use super::split::When;
use super::stages::{ContactVelocities, Stages, StepDerivatives};
use super::start::Start;
use super::{State, StateBar, StateTangents, StepBar, StepTangents};
use crate::Result;
use crate::dynamics::Inertia;
use crate::dynamics::slopes::columns;
use nalgebra::DVector;

/// Acceleration, with the factored mass matrix of free velocities: driven joints reach the velocity of the step's end within it, the
/// others follow Eq. 3. Were it the mean velocity of the step that they reach, as that which they move by, half their acceleration would act.
fn acceleration<'a>(start: &Start<'_, 'a>) -> Result<(DVector<f64>, Inertia<'a>)> {
    let (s, e, split, v) = (start.stepper, start.e, start.split, start.v);
    let end = (start.state.step + 1) as f64 * s.dt;
    let reached = s.split(&start.input.hold, When::At(end)).driven;
    let mut driven = (reached - v) / s.dt;
    for &i in &split.free {
        driven[i] = 0.0;
    }
    let right = e.inertial_force(v, &start.input.control)? - e.mass_times(&driven);
    let factor = e.factored(&split.free)?;
    let found = factor.solve(&right);
    e.check()?;
    e.check_energy(&found, &right)?;
    Ok((driven + found, factor))
}

pub(super) fn step(start: &Start) -> Result<(State, Stages)> {
    let (s, split) = (start.stepper, start.split);
    let (a, _) = acceleration(start)?;
    let before = split.complete(&(start.v + s.dt * a));
    let after = contact::solve(start, &before, s.dt, Resisting::No)?;
    let q = start.advance(&after);
    let next = start.next_state(q, after.clone());
    Ok((next, Stages::Contact(ContactVelocities::new(before, after))))
}

/// What the derivatives of a step need.
pub(super) struct Adjoint<'s, 'a> {
    velocities: &'s ContactVelocities,
    problem: contact::Problem<'a>,
    acceleration: DVector<f64>,
    /// Of the mass matrix of free velocities.
    factor: Inertia<'a>,
}

impl<'s, 'a> Adjoint<'s, 'a> {
    pub fn new(start: &Start<'_, 'a>, velocities: &'s ContactVelocities) -> Result<Self> {
        let (acceleration, factor) = acceleration(start)?;
        Ok(Self {
            problem: contact::Problem::new(
                start,
                &velocities.before,
                &velocities.after,
                start.stepper.dt,
                Resisting::No,
            )?,
            velocities,
            acceleration,
            factor,
        })
    }
}

impl<'a> StepDerivatives<'a> for Adjoint<'_, 'a> {
    fn jvp(&self, start: &Start<'_, 'a>, along: &StepTangents) -> Result<StateTangents> {
        let (s, e, split) = (start.stepper, start.e, start.split);
        let (q, inputs) = (along.q, along.inputs);
        let force = e.inertial_force_slopes(start.v, &start.input.control, &split.free)?;
        let inertia = e.mass_slopes(&self.acceleration, &split.free, inputs.has_parameters())?;
        // Driven velocities are reached from where they are: what they reach doesn't depend on the state.
        let mut driven = -along.v / s.dt;
        for &i in &split.free {
            driven.row_mut(i).fill(0.0);
        }
        let right = force.along(q, Some(along.v), inputs)
            - inertia.along(q, None, inputs)
            - columns(&driven, |v| e.mass_times(v));
        let mut before = along.v.clone();
        split.forget_driven_rows(&mut before);
        before += s.dt * self.factor.solve_columns(&right);
        e.check()?;
        let after = self.problem.solve_jvp(start, along, &before)?;
        Ok(StateTangents {
            q: start.advance_jvp(&self.velocities.after, along.q, &after),
            y: after,
        })
    }

    fn vjp(&self, start: &Start<'_, 'a>, next_bar: &StateBar) -> Result<StepBar> {
        let (s, e, split) = (start.stepper, start.e, start.split);
        let mut bar = StepBar::zeros(e);
        let after = &self.velocities.after;
        let (q_bar, mut after_bar) = start.advance_vjp(after, &next_bar.q);
        bar.state.q += q_bar;
        after_bar += &next_bar.y;
        let mut v_bar = self.problem.solve_vjp(start, &after_bar, &mut bar)?;
        split.forget_driven(&mut v_bar);
        bar.v += &v_bar;
        // Free rows of M a = G − M_fd a_d, a_d = (v_d − v)/Δt, v_d at the step's end.
        let w = self.factor.solve_vjp(&(s.dt * &v_bar));
        let force = e.inertial_force_vjp(start.v, &start.input.control, &w)?;
        bar.v += &force.v;
        bar.add(1.0, &force);
        bar.add(-1.0, &e.mass_vjp(&self.acceleration, &w)?);
        let through_driven = e.mass_times(&w) / s.dt;
        for (i, driven) in split.is_driven.iter().enumerate() {
            if *driven {
                bar.v[i] += through_driven[i];
            }
        }
        Ok(bar)
    }
}
