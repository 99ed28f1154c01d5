//! How much of two surfaces lies face to face.

use super::{Gap, Gaps, Other};
use crate::geometry::boxes::Node;
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Part of the gap by which distances may exceed it where surfaces count as parallel.
const PARALLEL: f64 = 0.2;
/// How far faces are taken to lie inside their surface at most, in edges: a half for a circle's chord.
const INSIDE: f64 = 0.5;

/// Faces of a body near a gap.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NearFaces {
    /// Of all of them, m².
    pub area: f64,
    /// Their sum along their outward normals, world, m².
    pub facing: Vec3,
    count: usize,
}

impl NearFaces {
    /// Edge of as many equilateral triangles of that area, m; none where no face is near.
    pub fn edge(&self) -> Option<f64> {
        let each = self.area / self.count as f64;
        (self.count > 0).then(|| (4.0 / 3f64.sqrt() * each).sqrt())
    }
}

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
        self.near(body, other, (1.0 + PARALLEL) * gap, poses)
    }

    /// The faces of both bodies at a gap whose centres are no farther from the other than `beyond` (m) more than the nearest of them, the body itself first.
    /// Faces of round bodies lie inside, by more than a narrow gap where they are coarse: so the gap itself isn't what they are held to.
    pub(crate) fn near_faces(&self, gap: &Gap, beyond: f64, poses: &[Pose]) -> [NearFaces; 2] {
        let limit = gap.distance + beyond + INSIDE * gap.edge;
        let mut out = [NearFaces::default(); 2];
        for (near, (body, other)) in out.iter_mut().zip(gap.sides()) {
            let Some(Some(tree)) = self.trees.get(body) else {
                continue;
            };
            let faces = self.faces_within(body, other, limit, poses);
            let nearest = faces
                .iter()
                .fold(f64::INFINITY, |least, (_, d)| least.min(*d));
            for (f, _) in faces.iter().filter(|(_, d)| *d <= nearest + beyond) {
                near.area += tree.area(*f);
                near.facing += poses[body].rotation * tree.area_vector(*f);
                near.count += 1;
            }
        }
        out
    }

    fn near(&self, body: usize, other: Other, limit: f64, poses: &[Pose]) -> f64 {
        let Some(Some(tree)) = self.trees.get(body) else {
            return 0.0;
        };
        let near = self.faces_within(body, other, limit, poses);
        near.iter().map(|(f, _)| tree.area(*f)).sum()
    }

    /// Centroids (body frame) of a body's faces that are no farther from the other than `limit` (m), and how far each is.
    pub(crate) fn centroids_within(
        &self,
        body: usize,
        other: Other,
        limit: f64,
        poses: &[Pose],
    ) -> Vec<(Vec3, f64)> {
        let Some(Some(tree)) = self.trees.get(body) else {
            return Vec::new();
        };
        let near = self.faces_within(body, other, limit, poses).into_iter();
        near.map(|(f, distance)| (tree.centroid(f), distance))
            .collect()
    }

    fn faces_within(
        &self,
        body: usize,
        other: Other,
        limit: f64,
        poses: &[Pose],
    ) -> Vec<(usize, f64)> {
        let placed = |i: usize| Some((self.trees.get(i)?.as_ref()?, poses.get(i)?));
        let Some((tree, pose)) = placed(body) else {
            return Vec::new();
        };
        let distance = |x: &Vec3| match other {
            Other::Wall(w) => self.walls[w].height(x),
            Other::Body(b) => placed(b).map_or(f64::INFINITY, |(tree, pose)| {
                let x = pose.apply_inverse(x);
                (tree.closest(&x).0 - x).norm()
            }),
        };
        // Boxes first: most are so far away that none of their faces can be that near.
        let far = |node: &Node| {
            let reach = node.half.norm();
            let slack = 1e-12 * (node.center.norm() + pose.translation.norm() + reach);
            distance(&pose.apply(&node.center)) > limit + reach + slack
        };
        let mut out = Vec::new();
        let mut stack = vec![0];
        while let Some(number) = stack.pop() {
            let node = &tree.nodes[number];
            match node.second {
                _ if far(node) => {}
                // In the order of the faces.
                Some(second) => stack.extend([second, number + 1]),
                None => out.extend(
                    (node.faces.clone())
                        .map(|f| (f, distance(&pose.apply(&tree.centroid(f)))))
                        .filter(|(_, d)| *d <= limit),
                ),
            }
        }
        out
    }
}
