//! Contact forces among bodies, with walls, and of joints at their limits ([`JointLimit`]): the law of
//! [`crate::adjoint::contact`] at every point where surfaces are near.
//!
//! Points, normals and gaps belong to the configuration; the velocity is the argument of the force, so that an integrator
//! that is implicit in it solves contact implicitly, against the mass matrix with its fluid part.

use super::contact::sharpened;
use super::{
    ContactForce, Dual, Evaluation, ForceCotangents, JointLimit, PairContact, Parameters, System,
};
use crate::Result;
use crate::adjoint::contact::{Push, contact_force, contact_force_jvp, contact_force_vjp};
use crate::adjoint::lie::{Pose, Vec6, angular, point_velocity};
use crate::contact::{ContactPair, ContactPoint};
use crate::multibody::Cotangents;
use nalgebra::DVector;

/// Contacts at places where surfaces are near, of bodies that end a step with these twists: all where something presses, or where
/// surfaces are no more than `slack` (m) farther apart than the gap at which they touch.
pub(super) fn contact_forces(
    contact_points: &[PairContact],
    twists: &[Vec6],
    slack: f64,
) -> Vec<ContactForce> {
    let found = contact_points.iter().map(|t| {
        let push = contact_force(&t.law, &t.point_state(twists));
        ContactForce {
            first: t.first,
            second: t.second,
            gap: t.point.gap,
            position: t.point.position.into(),
            normal: t.point.normal.into(),
            force: push.force.into(),
            torque: push.torque.into(),
        }
    });
    // The law looks ahead by a step: what closes fast is pressed before it is near.
    let near = contact_points
        .iter()
        .zip(found)
        .filter(|(t, c)| t.point.gap <= t.law.gap + slack.max(t.law.width) || c.force != [0.0; 3]);
    near.map(|(_, c)| c).collect()
}

impl System {
    /// All places where surfaces are near.
    pub(super) fn contact_points(
        &self,
        parameters: &Parameters,
        poses: &[Pose],
    ) -> Result<Vec<PairContact>> {
        let mut out = Vec::new();
        if let Some(model) = &self.contact {
            for pair in model.near(poses, |b| model.shapes.share_ahead(b)) {
                out.extend(self.pair_points(parameters, poses, &pair, 1, 0.0)?);
            }
        }
        Ok(out)
    }

    /// Those of a pair whose law is sharpened `sharpness` times; as far as `travel` (m) beyond where it sets in, if that is farther than
    /// one always looks.
    pub(super) fn pair_points(
        &self,
        parameters: &Parameters,
        poses: &[Pose],
        pair: &ContactPair,
        sharpness: usize,
        travel: f64,
    ) -> Result<Vec<PairContact>> {
        let Some(model) = &self.contact else {
            return Ok(Vec::new());
        };
        let law = model.law(pair, parameters);
        let onset = law.gap + law.width;
        let reach = onset + model.shapes.ahead(pair).max(travel);
        let found = model.shapes.points_within(pair, poses, reach)?;
        let place = |point: ContactPoint| PairContact {
            pair: *pair,
            first: pair.first,
            second: pair.second_body(),
            law: sharpened(law, sharpness),
            scale: (sharpness * sharpness) as f64,
            point,
        };
        Ok(found.into_iter().map(place).collect())
    }
}

impl Evaluation<'_> {
    /// Spatial wrenches on all bodies of forces at the places where surfaces are near.
    fn exchanged(&self, push: impl Fn(&PairContact) -> Push) -> Vec<Vec6> {
        let mut out = vec![Vec6::zeros(); self.system.len()];
        for t in &self.contact_points {
            let Push { force, torque } = push(t);
            t.exchange(&t.wrench(&force, &torque), &mut out);
        }
        out
    }

    /// Of the velocities, spatial.
    pub(super) fn columns(&self, dual: Dual) -> &[Vec6] {
        match dual {
            Dual::User => &self.kinematics.columns,
            Dual::Frame => &self.kinematics.frame_columns,
        }
    }

    fn twists(&self, v: &DVector<f64>) -> Vec<Vec6> {
        self.system.tree.twists(&self.kinematics, v)
    }

    /// Whether any force acts in contact at the velocity `v`, or any damper that is solved with it at some; where none does, none changes with v either.
    pub(super) fn contact_acts(&self, v: &DVector<f64>) -> bool {
        self.limit_forces(v).any(|(_, forces)| forces != [0.0; 2]) || self.touches(v)
    }

    /// Whether surfaces press on one another at the velocity `v`, or any damper between them does anything at some.
    pub(super) fn touches(&self, v: &DVector<f64>) -> bool {
        if self.damps() {
            return true;
        }
        if self.contact_points.is_empty() {
            return false;
        }
        let twists = self.twists(v);
        let push = |t: &PairContact| contact_force(&t.law, &t.point_state(&twists));
        let acts = |t: &PairContact| push(t) != Push::default();
        self.contact_points.iter().any(acts)
    }

    /// Whether that may be at some velocity.
    pub(super) fn may_touch(&self) -> bool {
        !self.contact_points.is_empty() || self.damps()
    }

    /// Generalised forces of contact at the velocity `v`, with the dampers that are solved with it.
    pub fn contact_force(&self, v: &DVector<f64>, dual: Dual) -> DVector<f64> {
        let tree = &self.system.tree;
        let twists = self.twists(v);
        let mut wrenches = self.exchanged(|t| contact_force(&t.law, &t.point_state(&twists)));
        self.add_damping(&twists, v, &mut wrenches);
        let mut out = tree.project(self.columns(dual), wrenches);
        for (limit, [lower, upper]) in self.limit_forces(v) {
            out[limit.v] += lower + upper;
        }
        out
    }

    /// Sizes of the generalised forces of contact, without what cancels among them: what their rounding is relative to.
    pub(super) fn contact_effort(&self, v: &DVector<f64>) -> DVector<f64> {
        let twists = self.twists(v);
        let mut out = self.damping_effort(v);
        for t in &self.contact_points {
            let push = contact_force(&t.law, &t.point_state(&twists));
            if push != Push::default() {
                let wrench = t.wrench(&push.force, &push.torque);
                self.add_effort(t, &wrench, &mut out);
            }
        }
        for (limit, [lower, upper]) in self.limit_forces(v) {
            out[limit.v] += lower.abs() + upper.abs();
        }
        out
    }

    /// Adds the sizes of the generalised forces of one contact, which what carries both of its bodies doesn't feel.
    fn add_effort(&self, t: &PairContact, wrench: &Vec6, out: &mut DVector<f64>) {
        let tree = &self.system.tree;
        let carries = |body: Option<usize>, a: usize| body.is_some_and(|b| tree.carries(a, b));
        let mut found: Vec<(usize, f64)> = Vec::new();
        let sides = [
            (Some(t.first), t.second, 1.0),
            (t.second, Some(t.first), -1.0),
        ];
        for (own, other, sign) in sides {
            let chain = own.into_iter().flat_map(|b| tree.carrying(b));
            for a in chain.filter(|a| !carries(other, *a)) {
                for (column, k) in tree.links()[a].terms() {
                    let force = sign * self.kinematics.columns[column].dot(wrench);
                    match found.iter_mut().find(|(i, _)| *i == k) {
                        Some((_, sum)) => *sum += force,
                        None => found.push((k, force)),
                    }
                }
            }
        }
        found.iter().for_each(|(k, force)| out[*k] += force.abs());
    }

    /// Tangent of [`Evaluation::contact_force`] (the user's coordinates) along `dv`.
    pub fn contact_force_jvp(&self, v: &DVector<f64>, dv: &DVector<f64>) -> DVector<f64> {
        let [twists, along] = [v, dv].map(|v| self.twists(v));
        let mut wrenches = self.exchanged(|t| {
            let point_state = t.point_state(&twists);
            contact_force_jvp(&t.law, &point_state, &t.rates(&along))
        });
        // Dampers are linear.
        self.add_damping(&along, dv, &mut wrenches);
        let tree = &self.system.tree;
        let mut out = tree.project(&self.kinematics.columns, wrenches);
        for l in &self.limits {
            out[l.v] += l.forces_jvp(self.q[l.q], v[l.v], dv[l.v]);
        }
        out
    }

    /// Transpose of [`Evaluation::contact_force`]: the gradient of zᵀ g over q, v and the parameters.
    pub fn contact_force_vjp(
        &self,
        v: &DVector<f64>,
        z: &DVector<f64>,
        dual: Dual,
    ) -> ForceCotangents {
        let tree = &self.system.tree;
        let virtual_velocity = dual.virtual_velocity(z);
        let fields = tree.fields(&self.kinematics, &self.q, v, virtual_velocity);
        let mut bar = Cotangents::zeros(self.system.len());
        let mut out = ForceCotangents::zeros(self);
        for t in &self.contact_points {
            let x = &t.point.position;
            let point_state = t.point_state(&fields.twist);
            let virt = t.relative(&fields.virtual_twist);
            let push = contact_force(&t.law, &point_state);
            t.exchange(&t.wrench(&push.force, &push.torque), &mut bar.virtual_twist);
            let virtual_push = Push {
                force: point_velocity(&virt, x),
                torque: angular(&virt),
            };
            let mut own = contact_force_vjp(&t.law, &point_state, &virtual_push);
            own.gap *= t.eased_gap().1;
            let rates = own.rates;
            t.exchange(&t.wrench(&rates.velocity, &rates.spin), &mut bar.twist);
            // Both velocities and the virtual one are taken at the point.
            let position = rates.velocity.cross(&point_state.rates.spin)
                + push.force.cross(&virtual_push.torque);
            t.displacement_vjp(&own, &position, &mut bar.pose);
            let poses = &self.kinematics.poses;
            self.system
                .add_contact_shape_vjp(t, poses, (&own, &position), &mut out.parameters);
            out.parameters.add_contact([
                t.scale * own.stiffness,
                own.dissipation,
                own.friction,
                own.torsional_friction,
                own.rolling_friction,
            ]);
        }
        self.damping_vjp(&fields, v, z, &mut bar, &mut out);
        let (q_bar, v_bar) = tree.reverse(&self.kinematics, v, virtual_velocity, &fields, bar);
        out.q += q_bar;
        out.v += v_bar;
        // The tangent of q is indexed as v.
        for l in &self.limits {
            let [q_bar, v_bar] = l.forces_vjp(self.q[l.q], v[l.v], z[l.v]);
            out.q[l.v] += q_bar;
            out.v[l.v] += v_bar;
        }
        out
    }

    /// Each limit with the forces of its stops at the velocity `v`.
    pub(super) fn limit_forces(
        &self,
        v: &DVector<f64>,
    ) -> impl Iterator<Item = (&JointLimit, [f64; 2])> {
        let each = self.limits.iter();
        each.map(|l| (l, l.forces(self.q[l.q], v[l.v])))
    }
}
