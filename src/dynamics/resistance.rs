//! Forces that resist motion, beside contact: they are those of the motion that contact leaves.
//!
//! Drag, damping, friction and drives of joints are part of a stage, at the velocity with which it would end without contact, and what is pressed on something has none of that. A
//! gripper's stiff servo would hardly press: at Δt q̇ of a step's free motion it is nearly at its target. Contact's problem therefore holds what such forces change by as contact changes the
//! velocity, R(v) − R(v*). Their derivatives by the velocity are symmetric and take energy, so that it stays the least of a convex function, and as stable however stiff they are.
//!
//! Midpoint takes those of joints at the configuration of its middle, and late ([`super::late`]); so does R.

use super::force::{ForceModel, Loads, Moving, Place, Velocity};
use super::island_matrix::IslandMatrix;
use super::{Dual, Evaluation, ForceCotangents, System};
use crate::multibody::Cotangents;
use nalgebra::DVector;

/// How such forces are taken in a step.
#[derive(Clone, Copy)]
pub(super) struct Resistance<'r> {
    pub control: &'r DVector<f64>,
    /// Where the forces of joints are taken in the middle of a step: the velocity at its start, and half its length, s.
    pub middle: Option<(&'r DVector<f64>, f64)>,
}

/// Transpose of R.
pub(super) struct ResistanceBars {
    /// Of the configuration, the velocity, controls and parameters.
    pub force: ForceCotangents,
    /// Of the velocity at the step's start.
    pub start: DVector<f64>,
}

/// Where the forces of joints are taken.
struct Joints {
    q: DVector<f64>,
    v: DVector<f64>,
}

impl System {
    /// Those that aren't late.
    pub(super) fn resisting(&self) -> impl Iterator<Item = &dyn ForceModel> {
        let all = self.forces.iter().map(AsRef::as_ref);
        all.filter(|f: &&dyn ForceModel| f.resists())
    }

    /// Whether there is any, late or not.
    pub(super) fn has_resistance(&self) -> bool {
        self.resisting().next().is_some() || self.late_forces().next().is_some()
    }
}

impl Evaluation<'_> {
    fn late_joints(&self, how: &Resistance, v: &DVector<f64>) -> Joints {
        match how.middle {
            None => Joints {
                q: self.q.clone(),
                v: v.clone(),
            },
            Some((start, reach)) => Joints {
                q: self.system.tree.integrate(&self.q, &(reach * v)),
                v: self
                    .late(v, start)
                    .map_or_else(|| v.clone(), |late| late.velocity),
            },
        }
    }

    fn moving_joints<'b>(&'b self, at: &'b Joints, control: &'b DVector<f64>) -> Moving<'b> {
        let place = Place {
            q: &at.q,
            ..self.place()
        };
        self.system.moving(place, &[], &at.v, control)
    }

    /// R at the velocity `v`.
    pub(super) fn resistance(
        &self,
        how: &Resistance,
        v: &DVector<f64>,
        dual: Dual,
    ) -> DVector<f64> {
        let tree = &self.system.tree;
        let twists = tree.twists(&self.kinematics, v);
        let mut loads = Loads::zeros(twists.len(), v.len());
        let at = self.moving(&twists, v, how.control);
        (self.system.resisting()).for_each(|f| f.add(&at, &mut loads));
        let joints = self.late_joints(how, v);
        let at = self.moving_joints(&joints, how.control);
        (self.system.late_forces()).for_each(|f| f.add(&at, &mut loads));
        // Joints with one coordinate have the same force in every frame.
        tree.project(self.columns(dual), loads.wrenches) + loads.joints
    }

    /// Of the forces of joints, each one's derivative by its own velocity.
    fn late_resistance_slopes(&self, how: &Resistance, v: &DVector<f64>) -> DVector<f64> {
        let joints = self.late_joints(how, v);
        let ones = DVector::repeat(v.len(), 1.0);
        let bars = self.late_loads_vjp(&self.moving_joints(&joints, how.control), &ones);
        match how.middle {
            None => bars.v,
            Some((_, reach)) => reach * bars.q + self.delayed(&bars.v) + bars.v,
        }
    }

    /// w of each velocity times its entry of `x`.
    fn delayed(&self, x: &DVector<f64>) -> DVector<f64> {
        match self.system.late.is_empty() {
            true => DVector::zeros(x.len()),
            false => self.system.late.component_mul(x),
        }
    }

    /// ∂R/∂v in the user's coordinates: symmetric, negative semi-definite.
    pub(super) fn resistance_matrix(&self, how: &Resistance, v: &DVector<f64>) -> IslandMatrix {
        let islands = self.resisted_islands();
        let products = self.resistance_jvps(how, v, &islands.changes());
        IslandMatrix::new(islands, &products)
    }

    /// Tangent of R (the user's coordinates) along `dv`.
    pub(super) fn resistance_jvp(
        &self,
        how: &Resistance,
        v: &DVector<f64>,
        dv: &DVector<f64>,
    ) -> DVector<f64> {
        self.resistance_jvps(how, v, std::slice::from_ref(dv))
            .swap_remove(0)
    }

    /// Its tangents along all `changes`.
    fn resistance_jvps(
        &self,
        how: &Resistance,
        v: &DVector<f64>,
        changes: &[DVector<f64>],
    ) -> Vec<DVector<f64>> {
        let mut out = self.load_rates(self.system.resisting(), v, how.control, changes);
        let joints = self.late_resistance_slopes(how, v);
        for (out, dv) in out.iter_mut().zip(changes) {
            *out += joints.component_mul(dv);
        }
        out
    }

    /// Transpose of [`Evaluation::resistance`]: the gradient of zᵀ R.
    pub(super) fn resistance_vjp(
        &self,
        how: &Resistance,
        v: &DVector<f64>,
        z: &DVector<f64>,
        dual: Dual,
    ) -> ResistanceBars {
        let (tree, virtual_velocity) = (&self.system.tree, dual.virtual_velocity(z));
        let fields = tree.fields(&self.kinematics, &self.q, v, virtual_velocity);
        let mut bar = Cotangents::zeros(self.system.len());
        let mut out = ForceCotangents::zeros(self);
        let at = self.moving(&fields.twist, v, how.control);
        let mut loads = Loads::zeros(fields.twist.len(), v.len());
        let power = Velocity {
            twists: &fields.virtual_twist,
            v: z,
        };
        for force in self.system.resisting() {
            force.add(&at, &mut loads);
            force.vjp(&at, &power, &mut out.bars(&mut bar));
        }
        bar.virtual_twist = loads.wrenches;
        let (q_bar, v_bar) = tree.reverse(&self.kinematics, v, virtual_velocity, &fields, bar);
        out.q += q_bar;
        out.v += v_bar;
        let joints = self.late_joints(how, v);
        let late = self.late_loads_vjp(&self.moving_joints(&joints, how.control), z);
        let mut start = DVector::zeros(v.len());
        match how.middle {
            None => out.q += late.q,
            Some((_, reach)) => {
                let (q_bar, xi_bar) = tree.integrate_vjp(&(reach * v), &late.q);
                start -= self.delayed(&late.v);
                out.q += q_bar;
                out.v += reach * xi_bar - &start;
            }
        }
        out.v += late.v;
        out.control += late.control;
        out.parameters.add(&late.parameters);
        ResistanceBars { force: out, start }
    }
}
