//! Forces that resist motion, beside contact: they are those of the motion that contact leaves.
//!
//! Drag, damping, friction and drives of joints are part of a stage, at the velocity with which it would end without contact, and what is pressed on something has none of that. A
//! gripper's stiff servo would hardly press: at Δt q̇ of a step's free motion it is nearly at its target. Contact's problem therefore holds what such forces change by as contact changes the
//! velocity, R(v) − R(v*). Their derivatives by the velocity are symmetric and take energy, so that it stays the least of a convex function, and as stable however stiff they are.
//!
//! Midpoint takes those of joints at the configuration of its middle, and late ([`super::late`]); so does R.

use super::force::{ForceModel, LoadBars, Loads, Moving, Place, Velocity};
use super::island_matrix::IslandMatrix;
use super::{Dual, Evaluation, ForceCotangents, System};
use crate::adjoint::lie::Vec6;
use crate::multibody::{Cotangents, Virtual};
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
        let columns = match dual {
            Dual::User => &self.kinematics.columns,
            Dual::Frame => &self.kinematics.frame_columns,
        };
        // Joints with one coordinate have the same force in every frame.
        tree.project(columns, loads.wrenches) + loads.joints
    }

    /// Of the forces of joints, each one's derivative by its own velocity.
    fn late_resistance_slopes(&self, how: &Resistance, v: &DVector<f64>) -> DVector<f64> {
        let joints = self.late_joints(how, v);
        let ones = DVector::repeat(v.len(), 1.0);
        let bars = self.late_resistance_vjp(how, &joints, &ones);
        let mut out = bars.v;
        if let Some((_, reach)) = how.middle {
            if !self.system.late.is_empty() {
                out += self.system.late.component_mul(&out);
            }
            out += reach * bars.q;
        }
        out
    }

    /// Where they are taken.
    fn late_resistance_vjp(
        &self,
        how: &Resistance,
        joints: &Joints,
        z: &DVector<f64>,
    ) -> ForceCotangents {
        let mut out = ForceCotangents::zeros(self);
        let power = Velocity { twists: &[], v: z };
        let at = self.moving_joints(joints, how.control);
        let mut bars = LoadBars {
            pose: &mut [],
            twist: &mut [],
            q: &mut out.q,
            v: &mut out.v,
            control: &mut out.control,
            parameters: &mut out.parameters,
        };
        (self.system.late_forces()).for_each(|f| f.vjp(&at, &power, &mut bars));
        out
    }

    /// ∂R/∂v in the user's coordinates: symmetric, negative semi-definite.
    pub(super) fn resistance_matrix(&self, how: &Resistance, v: &DVector<f64>) -> IslandMatrix {
        let (tree, islands) = (&self.system.tree, self.resisted_islands());
        let changes = islands.changes();
        let twists = tree.twists(&self.kinematics, v);
        let along: Vec<Vec<Vec6>> = (changes.iter())
            .map(|dv| tree.twists(&self.kinematics, dv))
            .collect();
        let velocities: Vec<Velocity> = (changes.iter().zip(&along))
            .map(|(v, twists)| Velocity { twists, v })
            .collect();
        let mut loads: Vec<Loads> = (changes.iter())
            .map(|_| Loads::zeros(twists.len(), v.len()))
            .collect();
        let at = self.moving(&twists, v, how.control);
        (self.system.resisting()).for_each(|f| f.jvps(&at, &velocities, &mut loads));
        let joints = self.late_resistance_slopes(how, v);
        let products: Vec<_> = (loads.into_iter().zip(&changes))
            .map(|(loads, dv)| {
                tree.project(&self.kinematics.columns, loads.wrenches)
                    + loads.joints
                    + joints.component_mul(dv)
            })
            .collect();
        IslandMatrix::new(islands, &products)
    }

    /// Tangent of R (the user's coordinates) along `dv`.
    pub(super) fn resistance_jvp(
        &self,
        how: &Resistance,
        v: &DVector<f64>,
        dv: &DVector<f64>,
    ) -> DVector<f64> {
        let tree = &self.system.tree;
        let [twists, along] = [v, dv].map(|v| tree.twists(&self.kinematics, v));
        let mut loads = Loads::zeros(twists.len(), v.len());
        let (at, change) = (
            self.moving(&twists, v, how.control),
            Velocity {
                twists: &along,
                v: dv,
            },
        );
        (self.system.resisting()).for_each(|f| f.jvp(&at, &change, &mut loads));
        let joints = self.late_resistance_slopes(how, v).component_mul(dv);
        tree.project(&self.kinematics.columns, loads.wrenches) + loads.joints + joints
    }

    /// Transpose of [`Evaluation::resistance`]: the gradient of zᵀ R.
    pub(super) fn resistance_vjp(
        &self,
        how: &Resistance,
        v: &DVector<f64>,
        z: &DVector<f64>,
        dual: Dual,
    ) -> ResistanceBars {
        let tree = &self.system.tree;
        let virtual_velocity = match dual {
            Dual::User => Virtual::User(z),
            Dual::Frame => Virtual::Frame(z),
        };
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
            let mut bars = LoadBars {
                pose: &mut bar.pose,
                twist: &mut bar.twist,
                q: &mut out.q,
                v: &mut out.v,
                control: &mut out.control,
                parameters: &mut out.parameters,
            };
            force.vjp(&at, &power, &mut bars);
        }
        bar.virtual_twist = loads.wrenches;
        let (q_bar, v_bar) = tree.reverse(&self.kinematics, v, virtual_velocity, &fields, bar);
        out.q += q_bar;
        out.v += v_bar;
        let late = self.late_resistance_vjp(how, &self.late_joints(how, v), z);
        let mut start = DVector::zeros(v.len());
        match how.middle {
            None => {
                out.q += late.q;
                out.v += late.v;
            }
            Some((_, reach)) => {
                let (q_bar, xi_bar) = tree.integrate_vjp(&(reach * v), &late.q);
                out.q += q_bar;
                out.v += reach * xi_bar + &late.v;
                if !self.system.late.is_empty() {
                    let more = self.system.late.component_mul(&late.v);
                    out.v += &more;
                    start = -more;
                }
            }
        }
        out.control += late.control;
        out.parameters.add(&late.parameters);
        ResistanceBars { force: out, start }
    }
}
