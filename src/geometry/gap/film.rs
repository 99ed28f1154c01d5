//! How much of two surfaces lies face to face.

use super::{Gap, Gaps, Other};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Part of the gap by which distances may exceed it where surfaces count as parallel.
const PARALLEL: f64 = 0.2;

impl Gaps {
    /// The area over which the surfaces of a gap are parallel: of the faces of one whose centres are no farther from the other than
    /// 1.2 times the gap, m²; the larger one of both bodies. 0 for a gap that isn't positive.
    pub fn parallel_area(&self, gap: &Gap, poses: &[Pose]) -> f64 {
        if gap.distance <= 0.0 {
            return 0.0;
        }
        let first = self.facing(gap.first, gap.second, gap.distance, poses);
        match gap.second {
            Other::Wall(_) => first,
            Other::Body(b) => {
                let second = self.facing(b, Other::Body(gap.first), gap.distance, poses);
                first.max(second)
            }
        }
    }

    fn facing(&self, body: usize, other: Other, gap: f64, poses: &[Pose]) -> f64 {
        let placed = |i: usize| Some((self.trees.get(i)?.as_ref()?, poses.get(i)?));
        let Some((tree, pose)) = placed(body) else {
            return 0.0;
        };
        let distance = |x: &Vec3| match other {
            Other::Wall(w) => self.walls[w].height(x),
            Other::Body(b) => placed(b).map_or(f64::INFINITY, |(tree, pose)| {
                let x = pose.apply_inverse(x);
                (tree.closest(&x).0 - x).norm()
            }),
        };
        let near = |f: &usize| distance(&pose.apply(&tree.centroid(*f))) <= (1.0 + PARALLEL) * gap;
        (0..tree.len()).filter(near).map(|f| tree.area(f)).sum()
    }
}
