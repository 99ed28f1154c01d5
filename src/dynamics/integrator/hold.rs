//! What contact bears already at a step's start, λ: part of the momenta from which a stage is solved, and taken off again where contact is solved after it.
//!
//! Without it a stage moves by what presses as if nothing bore it. In a film that motion is many times the gap, and the inertia found on the way not that of what rests. With v₀ the
//! velocity of the step's start, F all forces there (Eq. 3) and g those of contact
//!
//! ```text
//! M (v_h − v₀) = Δt (F(q, v₀, u) + R(q, v_h) − R(q, v₀) + g(q, v_h))      λ = Δt g(q, v_h)
//! ```
//!
//! which is contact's convex problem ([`super::contact`]) beside the impulse Δt F. Any λ is as right: contact adds Δt g − λ to what the stage ends with. The better it is, the less is left to add.
//! In a current the stage's own force carries on what it moves by, λ with it; what is taken off again is carried on as what contact adds is.

use super::contact::{Problem, solve_pushed};
use super::motion_push::Push;
use super::reaction::{Reaction, Resisting};
use super::start::Start;
use super::{Integrator, StepBar, StepTangents};
use crate::Result;
use crate::dynamics::Dual;
use nalgebra::{DMatrix, DVector};

/// What is borne, and v₀ and v_h, all driven velocities as they are in the step.
pub(super) struct Hold {
    start: DVector<f64>,
    held: DVector<f64>,
    /// λ.
    pub impulse: Push<DVector<f64>>,
}

impl Hold {
    /// Of a step in which surfaces press from its start; none where a motion makes no force that would be another one by it, and where the energy of contact is accounted for by itself.
    ///
    /// # Errors
    /// A coupling that fails, and contact that doesn't converge.
    pub fn new(start: &Start) -> Result<Option<Self>> {
        let (s, e, near) = (start.stepper, start.e, start.near);
        let accounted = s.integrator == Integrator::EnergyEuler;
        if accounted || e.keeps_momenta() || start.split.free.is_empty() || !near.may_touch() {
            return Ok(None);
        }
        let v = start.split.complete(start.v);
        let push = s.dt * e.inertial_force(&v, &start.input.control)?;
        let held = solve_pushed(start, &v, &push, s.dt, &v, Resisting::AtStart)?;
        Ok(near.touches(&held).then(|| Self::of(start, v, held)))
    }

    /// Of a step that was made with the velocity `held`.
    pub fn made(start: &Start, held: &DVector<f64>) -> Self {
        Self::of(start, start.split.complete(start.v), held.clone())
    }

    fn of(start: &Start, v: DVector<f64>, held: DVector<f64>) -> Self {
        let reaction = Reaction::new(start, &v, Resisting::No);
        let borne = |dual| start.stepper.dt * reaction.force(&held, dual);
        let impulse = Push {
            user: borne(Dual::User),
            frame: borne(Dual::Frame),
        };
        Self {
            start: v,
            held,
            impulse,
        }
    }

    /// v_h and λ.
    pub fn into_parts(self) -> (DVector<f64>, Push<DVector<f64>>) {
        (self.held, self.impulse)
    }

    fn reaction<'r, 'a>(&'r self, start: &Start<'r, 'a>) -> Reaction<'r, 'a> {
        Reaction::new(start, &self.start, Resisting::No)
    }

    fn problem<'a>(&self, start: &Start<'_, 'a>) -> Result<Problem<'a>> {
        let dt = start.stepper.dt;
        Problem::pushed(start, &self.start, &self.held, dt, Resisting::AtStart)
    }

    /// Tangents of λ.
    pub fn impulse_jvp(&self, start: &Start, along: &StepTangents) -> Result<Push<DMatrix<f64>>> {
        let (s, e, split) = (start.stepper, start.e, start.split);
        let mut v = along.v.clone();
        split.forget_driven_rows(&mut v);
        let force = e.inertial_force_slopes(&self.start, &start.input.control, &split.free)?;
        let push = s.dt * force.along(along.q, Some(&v), along.inputs);
        let held = (self.problem(start)?).solve_pushed_jvp(start, along, &v, &push)?;
        let reaction = self.reaction(start);
        let borne = |dual| {
            let slopes = reaction.slopes(&self.held, dual, &split.free);
            s.dt * slopes.along(along, &v, Some(&held))
        };
        Ok(Push {
            user: borne(Dual::User),
            frame: borne(Dual::Frame),
        })
    }

    /// Transpose of [`Hold::impulse_jvp`], added to `bar`.
    pub fn impulse_vjp(
        &self,
        start: &Start,
        impulse_bar: &Push<DVector<f64>>,
        bar: &mut StepBar,
    ) -> Result<()> {
        let (s, e, split) = (start.stepper, start.e, start.split);
        let reaction = self.reaction(start);
        let Push { user, frame } = impulse_bar;
        let mut held_bar = DVector::zeros(self.held.len());
        for (z, dual) in [(user, Dual::User), (frame, Dual::Frame)] {
            let borne = reaction.force_vjp(&self.held, z, dual);
            bar.add(s.dt, &borne.force);
            held_bar += s.dt * borne.force.v;
        }
        let problem = self.problem(start)?;
        let (mut v_bar, w) = problem.solve_pushed_vjp(start, &held_bar, bar)?;
        let force = e.inertial_force_vjp(&self.start, &start.input.control, &(s.dt * w))?;
        v_bar += &force.v;
        bar.add(1.0, &force);
        split.forget_driven(&mut v_bar);
        bar.v += v_bar;
        Ok(())
    }
}
