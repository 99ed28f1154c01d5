//! The kinematic tree and the reverse of its velocity fields.

use super::{JointBlocks, JointModel};
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, cross_motion, point_velocity, six};
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

    /// Sum of its columns with what goes with each of them.
    pub(super) fn combine(&self, columns: &[Vec6], x: &DVector<f64>) -> Vec6 {
        self.terms().map(|(column, k)| columns[column] * x[k]).sum()
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
            out.push(base + l.combine(&kinematics.columns, v));
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
            let own = l.combine(&kinematics.columns, v);
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
            out.push(base + carried + bent + l.combine(&kinematics.columns, dv));
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
}
