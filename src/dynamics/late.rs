//! Forces that resist single joints so stiffly that a step's mean velocity won't do for them.
//!
//! Midpoint takes forces at the mean velocity v of a step. A motion that damping ends within less than a step, at the rate λ > 2/Δt, then doesn't die away: it comes back with its
//! sign turned, by (1 − ½λΔt)/(1 + ½λΔt) a step, and velocities at states ring for seconds. Drives and friction of joints are that stiff; they are taken at
//!
//! ```text
//! v + w (v − v₀)        w = a/(1 + a)        a = λΔt
//! ```
//!
//! v₀ being the velocity at the step's start: with w = 0 the mean, with w = 1 the velocity at the step's end, by which what is stiff is gone at once (1/(1 + a) a step). In between
//! nothing changes its sign, and what a small a changes is of second order in Δt, as the method's own error. a is that of each joint at rest at the start of
//! a run, by all that the joint moves, up to the next power of two: a constant of the run, which gradients don't follow, and the same for scenes that differ by little.

use super::force::{ForceModel, Loads, Moving, Velocity};
use super::{Drive, Evaluation, ForceCotangents, Parameters, System};
use crate::Result;
use nalgebra::DVector;

/// A step's mean velocity, and the one that such forces are taken at.
pub(super) struct Late<'l> {
    pub mean: &'l DVector<f64>,
    pub velocity: DVector<f64>,
}

/// Transpose of what they do later than at the mean velocity.
pub(super) struct LateBars {
    /// Of the configuration, of the mean velocity, controls and parameters.
    pub force: ForceCotangents,
    /// Of the velocity at the step's start.
    pub start: DVector<f64>,
}

impl System {
    pub(super) fn late_forces(&self) -> impl Iterator<Item = &dyn ForceModel> {
        let all = self.forces.iter().map(AsRef::as_ref);
        all.filter(|f: &&dyn ForceModel| f.is_late())
    }

    /// w of each velocity for steps of `dt` (s), at the configuration `q`; empty where nothing resists a joint.
    ///
    /// # Errors
    /// As [`System::evaluate`].
    pub(crate) fn late_weights(
        &self,
        parameters: &Parameters,
        q: &DVector<f64>,
        dt: f64,
    ) -> Result<DVector<f64>> {
        let nv = self.tree.velocities();
        let none = DVector::zeros(0);
        if self.late_forces().next().is_none() {
            return Ok(none);
        }
        let e = self.evaluate_apart(parameters, q, 0.0)?;
        let rest = DVector::zeros(nv);
        let slowed = -e.late_slopes(&rest, &DVector::zeros(self.controls));
        if slowed.iter().all(|x| *x == 0.0) {
            return Ok(none);
        }
        let links = self.drives.iter().zip(self.tree.links());
        let free = links.filter(|(drive, _)| **drive == Drive::Free);
        let free: Vec<usize> = free.flat_map(|(_, link)| link.v.clone()).collect();
        let factor = e.mass_blocks().factored(&free, false);
        let mut out = DVector::zeros(nv);
        for (k, &i) in free.iter().enumerate().filter(|(_, i)| slowed[**i] > 0.0) {
            let unit = DVector::from_fn(free.len(), |j, _| f64::from(j == k));
            let mobility = factor.solve(&unit).map_or(f64::INFINITY, |x| x[k]);
            let a = (dt * slowed[i] * mobility).log2().ceil().exp2();
            // Without an inertia of its own all of it is late.
            out[i] = if a.is_finite() && a > 0.0 {
                a / (1.0 + a)
            } else {
                1.0
            };
        }
        Ok(out)
    }
}

impl Evaluation<'_> {
    /// What forces add as steps take them to what acts at an instant ([`ForceModel::ahead`]); user coordinates.
    pub(crate) fn ahead(&self, v: &DVector<f64>, control: &DVector<f64>) -> DVector<f64> {
        let tree = &self.system.tree;
        let twists = tree.twists(&self.kinematics, v);
        let at = self.moving(&twists, v, control);
        let mut out = Loads::zeros(self.system.len(), v.len());
        for force in self.system.forces.iter() {
            force.ahead(&at, &mut out);
        }
        tree.project(&self.kinematics.columns, out.wrenches) + out.joints
    }

    /// As those forces see joints that move by `v`: no body moves.
    fn joints<'b>(&'b self, v: &'b DVector<f64>, control: &'b DVector<f64>) -> Moving<'b> {
        self.moving(&[], v, control)
    }

    fn late_loads(&self, v: &DVector<f64>, control: &DVector<f64>) -> DVector<f64> {
        let mut out = Loads::zeros(0, v.len());
        let at = self.joints(v, control);
        self.system.late_forces().for_each(|f| f.add(&at, &mut out));
        out.joints
    }

    /// Each one's derivative by its own velocity.
    fn late_slopes(&self, v: &DVector<f64>, control: &DVector<f64>) -> DVector<f64> {
        let mut out = Loads::zeros(0, v.len());
        let at = self.joints(v, control);
        let ones = DVector::repeat(v.len(), 1.0);
        let change = Velocity {
            twists: &[],
            v: &ones,
        };
        (self.system.late_forces()).for_each(|f| f.jvp(&at, &change, &mut out));
        out.joints
    }

    /// Transpose of what they do to joints that move so.
    pub(super) fn late_loads_vjp(&self, at: &Moving, z: &DVector<f64>) -> ForceCotangents {
        let mut out = ForceCotangents::zeros(self);
        let power = Velocity { twists: &[], v: z };
        let mut bars = out.joint_bars();
        (self.system.late_forces()).for_each(|f| f.vjp(at, &power, &mut bars));
        out
    }

    /// Of a step that starts with the velocity `start`; none where no force is late.
    pub(super) fn late<'l>(
        &self,
        mean: &'l DVector<f64>,
        start: &DVector<f64>,
    ) -> Option<Late<'l>> {
        let weights = &self.system.late;
        (!weights.is_empty()).then(|| Late {
            velocity: mean + weights.component_mul(&(mean - start)),
            mean,
        })
    }

    /// What is added to the force at the mean velocity; joints with one coordinate have the same momentum in every frame.
    pub(super) fn late_force(&self, late: &Late, control: &DVector<f64>) -> DVector<f64> {
        self.late_loads(&late.velocity, control) - self.late_loads(late.mean, control)
    }

    /// Its derivative by the mean velocity: each joint's by its own.
    pub(super) fn late_rates(&self, late: &Late, control: &DVector<f64>) -> DVector<f64> {
        let there = self.late_slopes(&late.velocity, control);
        &there + self.system.late.component_mul(&there) - self.late_slopes(late.mean, control)
    }

    /// Transpose of [`Evaluation::late_force`]: the gradient of its power on `z`.
    pub(super) fn late_force_vjp(
        &self,
        late: &Late,
        control: &DVector<f64>,
        z: &DVector<f64>,
    ) -> LateBars {
        let mut there = self.late_loads_vjp(&self.joints(&late.velocity, control), z);
        let mean = self.late_loads_vjp(&self.joints(late.mean, control), z);
        let start = -self.system.late.component_mul(&there.v);
        there.q -= &mean.q;
        there.v -= &mean.v + &start;
        there.control -= &mean.control;
        there.parameters.add_scaled(-1.0, &mean.parameters);
        LateBars {
            force: there,
            start,
        }
    }
}
