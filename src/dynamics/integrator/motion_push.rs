//! The force that a motion makes itself, quadratic in it, is beside contact that of the motion which contact leaves.
//!
//! A stage has its forces at the velocity v* that it ends with, and so the water's and the links' own, c(q, v*). What rests on a floor falls by Δt g in it, and would be pressed by c(q, v*), of order Δt²,
//! in every step, though it doesn't move. With v_s the velocity by which a step moves, contact is therefore solved once more for the momenta, beside the impulse
//!
//! ```text
//! P = Δt (c(q, v_s) − c(q, v*))
//! ```

use super::reaction::{Resisted, Resisting};
use super::stages::ContactVelocities;
use super::start::Start;
use super::{StepBar, StepTangents};
use crate::Result;
use crate::dynamics::Dual;
use crate::dynamics::slopes::columns;
use nalgebra::{DMatrix, DVector};

/// c(q, v_s) − c(q, v*), frame coordinates, with that of what resists motion where contact's problem for the momenta doesn't hold it itself.
pub(super) struct MotionPush {
    change: DVector<f64>,
    resisting: Resisting,
}

/// An impulse as contact's problem takes it, user coordinates, and as the frame momenta do.
pub(super) struct Push<T> {
    pub user: T,
    pub frame: T,
}

/// Cotangents of the velocities before and after contact.
pub(super) struct MotionPushBar {
    pub before: DVector<f64>,
    pub after: DVector<f64>,
}

impl MotionPush {
    /// Of a step's velocities before and after contact; none where nothing presses, or no motion makes a force.
    ///
    /// # Errors
    /// A coupling that fails.
    pub fn new(
        start: &Start,
        velocities: &ContactVelocities,
        resisting: Resisting,
    ) -> Result<Option<Self>> {
        let ContactVelocities { before, after, .. } = velocities;
        let e = start.e;
        let resisted = Resisted::new(start, before, resisting);
        let still = e.keeps_momenta() && resisted.is_none();
        if still || !start.near.contact_acts(before) {
            return Ok(None);
        }
        let mut change = e.motion_force(after)? - e.motion_force(before)?;
        if let Some(resisted) = resisted {
            change += resisted.force(after, Dual::Frame);
        }
        Ok(Some(Self { change, resisting }))
    }

    fn resisted<'r, 'a>(
        &self,
        start: &Start<'r, 'a>,
        velocities: &'r ContactVelocities,
    ) -> Option<Resisted<'r, 'a>> {
        Resisted::new(start, &velocities.before, self.resisting)
    }

    /// P.
    pub fn push(&self, start: &Start) -> Push<DVector<f64>> {
        let (dt, drift) = (start.stepper.dt, &start.stepper.system.drift);
        let impulse = dt * &self.change;
        Push {
            user: start.e.user_momentum(&impulse),
            frame: drift.carry(dt, impulse),
        }
    }

    /// Tangents of [`MotionPush::push`], from those of the velocities before and after contact.
    pub fn push_jvp(
        &self,
        start: &Start,
        along: &StepTangents,
        velocities: &ContactVelocities,
        [before, after]: [&DMatrix<f64>; 2],
    ) -> Result<Push<DMatrix<f64>>> {
        let (e, dt, drift) = (start.e, start.stepper.dt, &start.stepper.system.drift);
        let at = |v: &DVector<f64>, along_v: &DMatrix<f64>| -> Result<DMatrix<f64>> {
            let slopes = e.motion_force_slopes(v)?;
            Ok(slopes.along(along.q, Some(along_v), along.inputs))
        };
        let mut impulse = dt * (at(&velocities.after, after)? - at(&velocities.before, before)?);
        if let Some(resisted) = self.resisted(start, velocities) {
            let slopes = resisted.slopes(&velocities.after, Dual::Frame);
            impulse += dt * slopes.along(along, before, Some(after));
        }
        let turned = dt * e.frame_momentum_slope(&self.change) * along.q;
        Ok(Push {
            user: columns(&impulse, |p| e.user_momentum(p)) + turned,
            frame: columns(&impulse, |p| drift.carry(dt, p.clone())),
        })
    }

    /// Transpose of [`MotionPush::push`]: the rest is added to `bar`.
    pub fn push_vjp(
        &self,
        start: &Start,
        velocities: &ContactVelocities,
        push_bar: &Push<DVector<f64>>,
        bar: &mut StepBar,
    ) -> Result<MotionPushBar> {
        let (e, dt, drift) = (start.e, start.stepper.dt, &start.stepper.system.drift);
        bar.state.q += dt * e.frame_velocity_vjp(&push_bar.user, &self.change);
        let impulse_bar =
            drift.carry_back(dt, push_bar.frame.clone()) + e.frame_velocity(&push_bar.user);
        let change_bar = dt * impulse_bar;
        let left = e.motion_force_vjp(&velocities.after, &change_bar)?;
        let had = e.motion_force_vjp(&velocities.before, &change_bar)?;
        bar.add(1.0, &left);
        bar.add(-1.0, &had);
        let mut out = MotionPushBar {
            before: -had.v,
            after: left.v,
        };
        if let Some(resisted) = self.resisted(start, velocities) {
            let own = resisted.force_vjp(&velocities.after, &change_bar, Dual::Frame);
            bar.add(1.0, &own.force);
            bar.v += own.start;
            out.after += own.force.v;
            out.before += own.before;
        }
        Ok(out)
    }
}
