//! The kinematic tree and the reverse of its velocity fields.

use super::{JointBlocks, JointModel};
use crate::adjoint::lie::{
    Mat3, Pose, Vec3, Vec6, angular, cross_force, cross_motion, exp_jacobian, exp_jacobian_inverse,
    exp_jacobian_inverse_jvp, exp_matrix, point_velocity, six,
};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// One body with the joint that carries it.
#[derive(Clone, Debug)]
pub struct Link {
    /// Index of the parent body; `None`: the world. Parents come before children.
    pub parent: Option<usize>,
    /// Pose of the joint's frame in the parent's frame.
    pub placement: Pose,
    /// The joint.
    pub joint: JointModel,
    /// Place of the joint's coordinates in q.
    pub q: Range<usize>,
    /// Place of the joint's velocities in v.
    pub v: Range<usize>,
    /// Place of the joint's columns in [`Kinematics`].
    pub columns: Range<usize>,
    /// The joint that moves this one, which then has no place in q and v.
    pub follows: Option<Follows>,
}

/// How a joint with one coordinate follows another: `q = ratio · q[leader] + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follows {
    /// The body whose joint it follows.
    pub leader: usize,
    /// Of its motion and the leader's.
    pub ratio: f64,
    /// m or rad.
    pub offset: f64,
    q: usize,
    v: usize,
}

impl Link {
    /// Its part of joint coordinates.
    pub fn of_q<'x>(&self, q: &'x DVector<f64>) -> &'x [f64] {
        &q.as_slice()[self.q.clone()]
    }

    /// Its part of a vector with an entry per velocity.
    pub fn of_v<'x>(&self, x: &'x DVector<f64>) -> &'x [f64] {
        &x.as_slice()[self.v.clone()]
    }

    /// Each of its columns with the velocity that it goes with.
    pub fn terms(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let v = match &self.follows {
            Some(follows) => follows.v..follows.v + 1,
            None => self.v.clone(),
        };
        self.columns.clone().zip(v)
    }
}

/// A forest of bodies, parents before children.
#[derive(Clone, Debug)]
pub struct Tree {
    links: Vec<Link>,
}

/// Poses and joint columns at one configuration.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// Poses of the bodies in the world.
    pub poses: Vec<Pose>,
    /// Frame columns Ŝ of all joints ([`Link::terms`]): spatial twists of the joint's constant basis; of one that follows another at the leader's unit rate.
    pub frame_columns: Vec<Vec6>,
    /// User columns S = Ŝ X of the same.
    pub columns: Vec<Vec6>,
}

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
    /// From parent, joint placement and joint of each body, parents before children.
    ///
    /// # Panics
    /// If a parent doesn't come before its child; scenes are validated before they come here.
    pub fn new(bodies: impl IntoIterator<Item = (Option<usize>, Pose, JointModel)>) -> Self {
        let mut links: Vec<Link> = Vec::new();
        for (index, (parent, placement, joint)) in bodies.into_iter().enumerate() {
            assert!(parent.is_none_or(|p| p < index), "parents come first");
            let (nq, nv) = links.last().map_or((0, 0), |l| (l.q.end, l.v.end));
            let (q, v) = (nq..nq + joint.coordinates(), nv..nv + joint.velocities());
            links.push(Link {
                parent,
                placement,
                joint,
                q,
                columns: v.clone(),
                v,
                follows: None,
            });
        }
        Self { links }
    }

    /// With joints of one coordinate that follow others: for each body the leader's number, the ratio and the offset (m or rad). A leader follows none.
    pub fn following(mut self, leaders: &[Option<(usize, f64, f64)>]) -> Self {
        let (mut nq, mut nv) = (0, 0);
        for (link, leader) in self.links.iter_mut().zip(leaders) {
            let (q, v) = match leader {
                None => (link.q.len(), link.v.len()),
                Some(_) => (0, 0),
            };
            (link.q, link.v) = (nq..nq + q, nv..nv + v);
            (nq, nv) = (link.q.end, link.v.end);
        }
        for (b, leader) in leaders.iter().enumerate() {
            let Some((leader, ratio, offset)) = *leader else {
                continue;
            };
            self.links[b].follows = Some(Follows {
                leader,
                ratio,
                offset,
                q: self.links[leader].q.start,
                v: self.links[leader].v.start,
            });
        }
        self
    }

    /// Whether a joint follows another.
    pub fn has_followers(&self) -> bool {
        self.links.iter().any(|l| l.follows.is_some())
    }

    /// Whether the joint of body `b` moves by itself, and no other with it.
    pub fn is_single(&self, b: usize) -> bool {
        let follows = |l: &Link| l.follows.is_some_and(|f| f.leader == b);
        self.links[b].follows.is_none() && !self.links.iter().any(follows)
    }

    /// The joints with coordinates of their own.
    fn own(&self) -> impl Iterator<Item = &Link> {
        self.links.iter().filter(|l| l.follows.is_none())
    }

    /// Which joints stand still where those of the bodies in `hold` are held (a shorter list holds no others): a joint is held with those that follow it.
    pub fn held(&self, hold: &[bool]) -> Vec<bool> {
        let mut held: Vec<bool> = (0..self.links.len())
            .map(|b| hold.get(b).copied().unwrap_or(false))
            .collect();
        for (b, link) in self.links.iter().enumerate() {
            if let Some(follows) = link.follows.as_ref().filter(|_| held[b]) {
                held[follows.leader] = true;
            }
        }
        held
    }

    /// The bodies with their joints.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Length of q.
    pub fn coordinates(&self) -> usize {
        self.links.last().map_or(0, |l| l.q.end)
    }

    /// Length of v.
    pub fn velocities(&self) -> usize {
        self.links.last().map_or(0, |l| l.v.end)
    }

    /// Coordinates with every joint at its origin.
    pub fn origin(&self) -> DVector<f64> {
        DVector::from_vec(self.own().flat_map(|l| l.joint.origin()).collect())
    }

    /// Whether body `b` moves when the joint of body `a` does.
    pub fn carries(&self, a: usize, b: usize) -> bool {
        self.carrying(b).any(|x| x == a)
    }

    /// Body `b` and those that carry it, up to the world.
    pub fn carrying(&self, b: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(b), |&x| self.links[x].parent)
    }

    /// Vectors from the parts that each joint has in them.
    pub fn joints<const N: usize>(
        &self,
        part: impl Fn(&Link) -> [Vec<f64>; N],
    ) -> [DVector<f64>; N] {
        let mut out = [const { Vec::new() }; N];
        for l in self.own() {
            for (out, part) in out.iter_mut().zip(part(l)) {
                out.extend(part);
            }
        }
        out.map(DVector::from_vec)
    }

    /// Applies a per-joint map from slices of q and of a velocity-sized vector.
    pub fn per_joint(
        &self,
        q: &DVector<f64>,
        x: &DVector<f64>,
        map: impl Fn(&JointModel, &[f64], &[f64]) -> Vec<f64>,
    ) -> DVector<f64> {
        let [out] = self.joints(|l| [map(&l.joint, l.of_q(q), l.of_v(x))]);
        out
    }

    /// The same of a map that is the identity for joints without a frame map ([`JointMotion::has_frame_map`](super::JointMotion::has_frame_map)).
    pub fn per_frame(
        &self,
        q: &DVector<f64>,
        x: &DVector<f64>,
        map: impl Fn(&JointModel, &[f64], &[f64]) -> Vec<f64>,
    ) -> DVector<f64> {
        let mut out = x.clone();
        for l in self.links.iter().filter(|l| l.joint.has_frame_map()) {
            let own = map(&l.joint, l.of_q(q), l.of_v(x));
            out.as_mut_slice()[l.v.clone()].copy_from_slice(&own);
        }
        out
    }

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
        let rows = self.links.iter().filter_map(rows);
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

    /// X(q) of all joints, nv × nv.
    pub fn frame_matrix(&self, q: &DVector<f64>) -> DMatrix<f64> {
        let [out] = self.blocks(|l, z| [l.joint.frame_momentum_transpose(l.of_q(q), z)]);
        out
    }

    /// Matrices with a block for each joint on the diagonal, whose rows are what `row` makes of its unit vectors.
    pub fn blocks<const N: usize>(
        &self,
        row: impl Fn(&Link, &[f64]) -> [Vec<f64>; N],
    ) -> [DMatrix<f64>; N] {
        self.joint_blocks(row).map(|blocks| blocks.dense())
    }

    /// The same, without the zeros between joints.
    pub fn joint_blocks<const N: usize>(
        &self,
        row: impl Fn(&Link, &[f64]) -> [Vec<f64>; N],
    ) -> [JointBlocks; N] {
        let mut out = std::array::from_fn(|_| JointBlocks::new(self.velocities()));
        for l in self.own().filter(|l| !l.v.is_empty()) {
            let n = l.v.len();
            let mut blocks: [DMatrix<f64>; N] = std::array::from_fn(|_| DMatrix::zeros(n, n));
            let mut unit = vec![0.0; n];
            for k in 0..n {
                unit[k] = 1.0;
                for (block, row) in blocks.iter_mut().zip(row(l, &unit)) {
                    block.row_mut(k).copy_from_slice(&row);
                }
                unit[k] = 0.0;
            }
            for (out, block) in out.iter_mut().zip(blocks) {
                out.push(l.v.start, block);
            }
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

    /// Poses and columns at `q`.
    pub fn kinematics(&self, q: &DVector<f64>) -> Kinematics {
        let mut poses: Vec<Pose> = Vec::with_capacity(self.links.len());
        let count = self.links.last().map_or(0, |l| l.columns.end);
        let mut frame_columns = Vec::with_capacity(count);
        let mut columns = Vec::with_capacity(count);
        for l in &self.links {
            let frame = match l.parent {
                Some(p) => poses[p].compose(&l.placement),
                None => l.placement,
            };
            let led = l.follows.map(|f| (f.ratio, [f.ratio * q[f.q] + f.offset]));
            let (ratio, qj) = match &led {
                Some((ratio, own)) => (*ratio, own.as_slice()),
                None => (1.0, l.of_q(q)),
            };
            let basis = l.joint.basis();
            let own: Vec<Vec6> = (basis.iter())
                .map(|b| ratio * frame.twist_to_world(b))
                .collect();
            for k in 0..own.len() {
                let mut unit = vec![0.0; own.len()];
                unit[k] = 1.0;
                let hat = l.joint.frame_velocity(qj, &unit);
                columns.push(own.iter().zip(&hat).map(|(s, x)| s * *x).sum());
            }
            frame_columns.extend(own);
            poses.push(frame.compose(&l.joint.pose(qj)));
        }
        Kinematics {
            poses,
            frame_columns,
            columns,
        }
    }

    /// Spatial twists of all bodies at generalised velocity `v`.
    pub fn twists(&self, kinematics: &Kinematics, v: &DVector<f64>) -> Vec<Vec6> {
        let mut out: Vec<Vec6> = Vec::with_capacity(self.links.len());
        for l in &self.links {
            let base = l.parent.map_or(Vec6::zeros(), |p| out[p]);
            out.push(base + combine(&kinematics.columns, l, v));
        }
        out
    }

    /// Spatial displacements of all bodies along the tangent `dq`, and the tangents of their twists along it and `dv`.
    pub fn twists_jvp(
        &self,
        kinematics: &Kinematics,
        v: &DVector<f64>,
        dq: &DVector<f64>,
        dv: &DVector<f64>,
    ) -> [Vec<Vec6>; 2] {
        let displacements = self.twists(kinematics, dq);
        let mut out: Vec<Vec6> = Vec::with_capacity(self.links.len());
        for l in &self.links {
            let (base, moved) = l.parent.map_or((Vec6::zeros(), Vec6::zeros()), |p| {
                (out[p], displacements[p])
            });
            let own = combine(&kinematics.columns, l, v);
            // dX v, entry by entry from the transpose.
            let mut bent = Vec6::zeros();
            let mut unit = vec![0.0; l.v.len()];
            for k in 0..l.v.len() {
                unit[k] = 1.0;
                let entry = l.joint.frame_velocity_vjp(l.of_v(v), &unit);
                let along: f64 = entry.iter().zip(l.of_v(dq)).map(|(a, b)| a * b).sum();
                bent += kinematics.frame_columns[l.columns.start + k] * along;
                unit[k] = 0.0;
            }
            // The columns move with the parent.
            let carried = cross_motion(&moved, &own);
            out.push(base + carried + bent + combine(&kinematics.columns, l, dv));
        }
        [displacements, out]
    }

    /// Adds each body's six-vector to its parent's, leaves first: the composite over subtrees.
    pub fn composite(&self, mut field: Vec<Vec6>) -> Vec<Vec6> {
        for b in (0..self.links.len()).rev() {
            if let Some(p) = self.links[b].parent {
                let child = field[b];
                field[p] += child;
            }
        }
        field
    }

    /// Projects spatial wrenches on columns, one per velocity: columnsᵀ composite. On the user columns it gives forces dual to user
    /// velocities, on the frame columns those dual to frame velocities.
    pub fn project(&self, columns: &[Vec6], wrenches: Vec<Vec6>) -> DVector<f64> {
        let composite = self.composite(wrenches);
        let mut out = DVector::zeros(self.velocities());
        for (l, f) in self.links.iter().zip(&composite) {
            for (column, k) in l.terms() {
                out[k] += columns[column].dot(f);
            }
        }
        out
    }

    /// Spatial twists of all bodies as columns of a 6B × nv matrix.
    pub fn jacobian(&self, kinematics: &Kinematics) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(6 * self.links.len(), self.velocities());
        for b in 0..self.links.len() {
            for a in self.carrying(b) {
                for (column, k) in self.links[a].terms() {
                    let mut entry = out.fixed_view_mut::<6, 1>(6 * b, k);
                    entry += kinematics.columns[column];
                }
            }
        }
        out
    }

    /// Velocity of the point of body `b` that is at `x` (m, world) and the body's angular velocity, world axes, per generalised velocity: 6 × nv.
    pub fn point_jacobian(&self, kinematics: &Kinematics, b: usize, x: &Vec3) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(6, self.velocities());
        for a in self.carrying(b) {
            for (column, k) in self.links[a].terms() {
                let column = &kinematics.columns[column];
                let moved = six(&point_velocity(column, x), &angular(column));
                let mut entry = out.column_mut(k);
                entry += moved;
            }
        }
        out
    }

    /// The four fields at velocity `v` and virtual velocity `z`.
    pub fn fields(
        &self,
        kinematics: &Kinematics,
        q: &DVector<f64>,
        v: &DVector<f64>,
        z: Virtual,
    ) -> Fields {
        let hat = |x: &DVector<f64>| self.per_frame(q, x, |j, q, x| j.frame_velocity(q, x));
        let n = self.links.len();
        let mut frame_bias = DVector::zeros(v.len());
        for l in self.links.iter().filter(|l| l.joint.has_frame_map()) {
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
        for l in &self.links {
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
        for (b, l) in self.links.iter().enumerate() {
            let sz = combine(&kinematics.frame_columns, l, &f.frame_virtual);
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
        for b in (0..self.links.len()).rev() {
            let l = &self.links[b];
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

/// Sum of a body's joint columns with the given coefficients.
fn combine(columns: &[Vec6], link: &Link, x: &DVector<f64>) -> Vec6 {
    link.terms().map(|(column, k)| columns[column] * x[k]).sum()
}

/// The joint's own contributions `Ŝ v̂`, `Ŝ ẑ`, `Ŝ (Ẋ v)`.
fn own(kinematics: &Kinematics, l: &Link, f: &Fields) -> [Vec6; 3] {
    let columns = &kinematics.frame_columns;
    [&f.frame_velocity, &f.frame_virtual, &f.frame_bias].map(|x| combine(columns, l, x))
}
