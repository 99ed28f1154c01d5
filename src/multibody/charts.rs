//! Coordinates about a configuration: how they move it, their rates, and the momenta conjugate to them.

use super::{JointBlocks, Link, Tree};
use crate::adjoint::lie::{
    Mat3, Vec3, exp_jacobian, exp_jacobian_inverse, exp_jacobian_inverse_jvp, exp_matrix,
};
use nalgebra::{DMatrix, DVector};

impl Tree {
    /// `q ⊕ xi` for all joints.
    pub fn integrate(&self, q: &DVector<f64>, xi: &DVector<f64>) -> DVector<f64> {
        self.per_joint(q, xi, |j, q, x| j.integrate(q, x))
    }

    /// The `xi` with which [`Tree::integrate`] gets from one configuration to the other; of rotations the shorter way.
    pub fn difference(&self, from: &DVector<f64>, to: &DVector<f64>) -> DVector<f64> {
        let [out] = self.joints(|l| [l.joint.difference(l.of_q(from), l.of_q(to))]);
        out
    }

    /// Tangent cotangents of `(q, xi)` of [`Tree::integrate`].
    pub fn integrate_vjp(
        &self,
        xi: &DVector<f64>,
        bar: &DVector<f64>,
    ) -> (DVector<f64>, DVector<f64>) {
        self.joints(|l| l.joint.integrate_vjp(l.of_v(xi), l.of_v(bar)).into())
            .into()
    }

    /// Tangents of [`Tree::integrate`] along those of q and of xi, a column for each direction.
    pub fn integrate_jvp(
        &self,
        xi: &DVector<f64>,
        q: &DMatrix<f64>,
        along: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut out = q + along;
        for (rows, theta) in self.rotations(xi) {
            let turned = exp_matrix(&theta) * q.fixed_rows::<3>(rows)
                + exp_jacobian(&theta) * along.fixed_rows::<3>(rows);
            out.fixed_rows_mut::<3>(rows).copy_from(&turned);
        }
        out
    }

    /// First rows of the angular velocities in v of joints with a quaternion, each with the rotation vector in `xi`.
    fn rotations(&self, xi: &DVector<f64>) -> impl Iterator<Item = (usize, Vec3)> {
        let rows = |l: &Link| Some(l.v.start + l.joint.quaternion_at()?);
        let rows = self.links().iter().filter_map(rows);
        rows.map(|rows| (rows, xi.fixed_rows::<3>(rows).into_owned()))
    }

    /// Rates of the chart coordinates at generalised velocity `v`.
    pub fn chart_rate(&self, xi: &DVector<f64>, v: &DVector<f64>) -> DVector<f64> {
        let [out] = self.joints(|l| [l.joint.chart_rate(l.of_v(xi), l.of_v(v))]);
        out
    }

    /// Cotangents of `(xi, v)` of [`Tree::chart_rate`].
    pub fn chart_rate_vjp(
        &self,
        xi: &DVector<f64>,
        v: &DVector<f64>,
        bar: &DVector<f64>,
    ) -> (DVector<f64>, DVector<f64>) {
        let of = |l: &Link| l.joint.chart_rate_vjp(l.of_v(xi), l.of_v(v), l.of_v(bar));
        self.joints(|l| of(l).into()).into()
    }

    /// Tangents of [`Tree::chart_rate`] along those of xi and of v, a column for each direction.
    pub fn chart_rate_jvp(
        &self,
        xi: &DVector<f64>,
        v: &DVector<f64>,
        xi_along: &DMatrix<f64>,
        along: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut out = along.clone();
        for (rows, theta) in self.rotations(xi) {
            let rate = v.fixed_rows::<3>(rows).into_owned();
            let unit = |k| exp_jacobian_inverse_jvp(&theta, &rate, &Vec3::ith(k, 1.0));
            let bent = Mat3::from_columns(&[unit(0), unit(1), unit(2)]);
            let turned = exp_jacobian_inverse(&theta) * along.fixed_rows::<3>(rows)
                + bent * xi_along.fixed_rows::<3>(rows);
            out.fixed_rows_mut::<3>(rows).copy_from(&turned);
        }
        out
    }

    /// Momentum conjugate to the chart coordinates `xi` around `q`, from frame momentum.
    pub fn chart_momentum(
        &self,
        q: &DVector<f64>,
        xi: &DVector<f64>,
        hat: &DVector<f64>,
    ) -> DVector<f64> {
        let of = |l: &Link| l.joint.chart_momentum(l.of_q(q), l.of_v(xi), l.of_v(hat));
        let [out] = self.joints(|l| [of(l)]);
        out
    }

    /// Cotangents of `(q, xi, p̂)` of [`Tree::chart_momentum`].
    pub fn chart_momentum_vjp(
        &self,
        q: &DVector<f64>,
        xi: &DVector<f64>,
        hat: &DVector<f64>,
        z: &DVector<f64>,
    ) -> [DVector<f64>; 3] {
        self.joints(|l| {
            let (q, xi, hat, z) = (l.of_q(q), l.of_v(xi), l.of_v(hat), l.of_v(z));
            l.joint.chart_momentum_vjp(q, xi, hat, z)
        })
    }

    /// Derivatives of [`Tree::chart_momentum`] with respect to q, xi and p̂: joint by joint, from the transposes of its entries.
    pub fn chart_momentum_slopes(
        &self,
        q: &DVector<f64>,
        xi: &DVector<f64>,
        hat: &DVector<f64>,
    ) -> [JointBlocks; 3] {
        self.joint_blocks(|l, z| {
            l.joint
                .chart_momentum_vjp(l.of_q(q), l.of_v(xi), l.of_v(hat), z)
        })
    }
}
