//! The four fields of velocities over the bodies, and their reverse.

use super::{Kinematics, Link, Tree};
use crate::adjoint::lie::{Vec6, cross_force, cross_motion};
use nalgebra::DVector;

/// How the virtual velocity of [`Tree::fields`] is given.
#[derive(Clone, Copy, Debug)]
pub enum Virtual<'a> {
    /// In frame coordinates ẑ (dual to frame momenta).
    Frame(&'a DVector<f64>),
    /// In the user's coordinates, ẑ = X z (dual to p).
    User(&'a DVector<f64>),
}

/// The four fields over the bodies, spatial twists.
#[derive(Clone, Debug)]
pub struct Fields {
    /// Twists V.
    pub twist: Vec<Vec6>,
    /// Virtual twists Z.
    pub virtual_twist: Vec<Vec6>,
    /// Rate D of Z at constant ẑ.
    pub turning: Vec<Vec6>,
    /// Rate C of V at constant v.
    pub bias: Vec<Vec6>,
    /// v̂ and ẑ, kept for the reverse.
    frame_velocity: DVector<f64>,
    frame_virtual: DVector<f64>,
    frame_bias: DVector<f64>,
}

/// Cotangents of [`Fields`] and of the poses (spatial wrenches).
#[derive(Clone, Debug)]
pub struct Cotangents {
    /// Of the poses: work done on a spatial displacement of each body.
    pub pose: Vec<Vec6>,
    /// Of V.
    pub twist: Vec<Vec6>,
    /// Of Z.
    pub virtual_twist: Vec<Vec6>,
    /// Of D.
    pub turning: Vec<Vec6>,
    /// Of C.
    pub bias: Vec<Vec6>,
}

impl Cotangents {
    /// All zero, for `bodies` bodies.
    pub fn zeros(bodies: usize) -> Self {
        let zero = vec![Vec6::zeros(); bodies];
        Self {
            pose: zero.clone(),
            twist: zero.clone(),
            virtual_twist: zero.clone(),
            turning: zero.clone(),
            bias: zero,
        }
    }
}

impl Tree {
    /// The four fields at velocity `v` and virtual velocity `z`.
    pub fn fields(
        &self,
        kinematics: &Kinematics,
        q: &DVector<f64>,
        v: &DVector<f64>,
        z: Virtual,
    ) -> Fields {
        let hat = |x: &DVector<f64>| self.per_frame(q, x, |j, q, x| j.frame_velocity(q, x));
        let n = self.links().len();
        let mut frame_bias = DVector::zeros(v.len());
        for l in self.links().iter().filter(|l| l.joint.has_frame_map()) {
            let own = l.joint.frame_bias(l.of_v(v));
            frame_bias.as_mut_slice()[l.v.clone()].copy_from_slice(&own);
        }
        let mut f = Fields {
            twist: Vec::with_capacity(n),
            virtual_twist: Vec::with_capacity(n),
            turning: Vec::with_capacity(n),
            bias: Vec::with_capacity(n),
            frame_bias,
            frame_velocity: hat(v),
            frame_virtual: match z {
                Virtual::Frame(z) => z.clone(),
                Virtual::User(z) => hat(z),
            },
        };
        for l in self.links() {
            let [sv, sz, sb] = own(kinematics, l, &f);
            let zero = Vec6::zeros();
            let (v, z, d, c) = l.parent.map_or((zero, zero, zero, zero), |p| {
                (f.twist[p], f.virtual_twist[p], f.turning[p], f.bias[p])
            });
            f.turning.push(d + cross_motion(&v, &sz));
            f.bias.push(c + cross_motion(&v, &sv) + sb);
            f.twist.push(v + sv);
            f.virtual_twist.push(z + sz);
        }
        f
    }

    /// The fields for another virtual velocity.
    pub fn with_virtual(
        &self,
        kinematics: &Kinematics,
        q: &DVector<f64>,
        fields: &Fields,
        z: Virtual,
    ) -> Fields {
        let mut f = fields.clone();
        f.frame_virtual = match z {
            Virtual::Frame(z) => z.clone(),
            Virtual::User(z) => self.per_frame(q, z, |j, q, x| j.frame_velocity(q, x)),
        };
        for (b, l) in self.links().iter().enumerate() {
            let sz = l.combine(&kinematics.frame_columns, &f.frame_virtual);
            let zero = Vec6::zeros();
            let (v, z, d) = l.parent.map_or((zero, zero, zero), |p| {
                (f.twist[p], f.virtual_twist[p], f.turning[p])
            });
            f.turning[b] = d + cross_motion(&v, &sz);
            f.virtual_twist[b] = z + sz;
        }
        f
    }

    /// Transpose of [`Tree::fields`]: tangent cotangents of `(q, v)` from cotangents of the fields
    /// and the poses. With [`Virtual::User`] the dependence of ẑ = X z on q is included; the cotangent of the virtual velocity
    /// itself is not needed by any caller and not returned.
    pub fn reverse(
        &self,
        kinematics: &Kinematics,
        v: &DVector<f64>,
        z: Virtual,
        fields: &Fields,
        mut bar: Cotangents,
    ) -> (DVector<f64>, DVector<f64>) {
        let mut q_bar = DVector::zeros(self.velocities());
        let mut v_bar = DVector::zeros(self.velocities());
        for b in (0..self.links().len()).rev() {
            let l = &self.links()[b];
            let [sv, sz, sb] = own(kinematics, l, fields);
            let parent_twist = l.parent.map_or(Vec6::zeros(), |p| fields.twist[p]);
            let (twist, virt, turning, bias) = (
                bar.twist[b],
                bar.virtual_twist[b],
                bar.turning[b],
                bar.bias[b],
            );
            let sv_bar = twist - cross_force(&parent_twist, &bias);
            let sz_bar = virt - cross_force(&parent_twist, &turning);
            // X is its own q's; S = Ŝ X already holds it.
            for (column, i) in l.terms() {
                q_bar[i] += kinematics.columns[column].dot(&bar.pose[b]);
                v_bar[i] += kinematics.columns[column].dot(&sv_bar);
            }
            if l.joint.has_frame_map() {
                let dot = |f: &Vec6| -> Vec<f64> {
                    let columns = (l.columns.clone()).map(|k| kinematics.frame_columns[k].dot(f));
                    columns.collect()
                };
                let (hat_v, hat_z, hat_b) = (dot(&sv_bar), dot(&sz_bar), dot(&bias));
                let own_q = l.joint.frame_velocity_vjp(l.of_v(v), &hat_v);
                let own_v = l.joint.frame_bias_vjp(l.of_v(v), &hat_b);
                for (k, i) in l.v.clone().enumerate() {
                    q_bar[i] += own_q[k];
                    v_bar[i] += own_v[k];
                }
                if let Virtual::User(z) = z {
                    let more_q = l.joint.frame_velocity_vjp(l.of_v(z), &hat_z);
                    for (k, i) in l.v.clone().enumerate() {
                        q_bar[i] += more_q[k];
                    }
                }
            }
            if let Some(p) = l.parent {
                bar.twist[p] += twist + cross_force(&sz, &turning) + cross_force(&sv, &bias);
                bar.virtual_twist[p] += virt;
                bar.turning[p] += turning;
                bar.bias[p] += bias;
                // The columns move with the parent.
                let own =
                    cross_force(&sv, &sv_bar) + cross_force(&sz, &sz_bar) + cross_force(&sb, &bias);
                let child = bar.pose[b];
                bar.pose[p] += child + own;
            }
        }
        (q_bar, v_bar)
    }
}

/// The joint's own contributions `Ŝ v̂`, `Ŝ ẑ`, `Ŝ (Ẋ v)`.
fn own(kinematics: &Kinematics, l: &Link, f: &Fields) -> [Vec6; 3] {
    let columns = &kinematics.frame_columns;
    [&f.frame_velocity, &f.frame_virtual, &f.frame_bias].map(|x| l.combine(columns, x))
}
