//! How much of one body lies inside another.

use crate::geometry::mesh::TriMesh;
use crate::geometry::tree::MeshTree;
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Points at which each cone from a body's centroid to a face is asked, in shells of equal volume.
const SHELLS: usize = 3;

/// The part of one body's volume that lies inside another body.
#[derive(Clone, Debug)]
pub struct Share {
    inner: usize,
    outer: usize,
    tree: MeshTree,
    /// Points of the inner body, in its frame, with their parts of its volume: cones from the
    /// centroid to the faces, negative where the body isn't seen from there.
    samples: Vec<(Vec3, f64)>,
}

impl Share {
    /// The part of the smaller one of two bodies inside the larger, by volume; none if one of them
    /// has no surface. `meshes` in body frames.
    pub fn new(meshes: &[Option<&TriMesh>], (first, second): (usize, usize)) -> Option<Self> {
        let mesh = |i: usize| meshes.get(i).copied().flatten();
        let (a, b) = (mesh(first)?, mesh(second)?);
        let volume = |m: &TriMesh| m.mass_properties().volume;
        let (inner, outer, small, large) = if volume(a) < volume(b) {
            (first, second, a, b)
        } else {
            (second, first, b, a)
        };
        let mass = small.mass_properties();
        let apex = mass.centroid;
        let cones = (0..small.faces().len()).flat_map(|f| {
            let [a, b, c] = small.corners(f).map(|x| x - apex);
            let part = a.dot(&b.cross(&c)) / 6.0 / mass.volume / SHELLS as f64;
            let center = (a + b + c) / 3.0;
            (0..SHELLS).map(move |s| {
                let out = ((s as f64 + 0.5) / SHELLS as f64).cbrt();
                (apex + center * out, part)
            })
        });
        Some(Self {
            inner,
            outer,
            tree: MeshTree::new(large),
            samples: cones.collect(),
        })
    }

    /// Numbers of the smaller body and of the one that it is in.
    pub fn bodies(&self) -> (usize, usize) {
        (self.inner, self.outer)
    }

    /// The part at these poses, one per mesh: 0 apart, 1 with the smaller body all inside. To some
    /// hundredths for a hundred faces.
    pub fn at(&self, poses: &[Pose]) -> f64 {
        let (inner, outer) = (&poses[self.inner], &poses[self.outer]);
        let inside = |x: &Vec3| {
            let there = outer.apply_inverse(&inner.apply(x));
            self.tree.depth_above(&there, 0.0).is_some()
        };
        let parts = self.samples.iter().filter(|(x, _)| inside(x));
        parts.map(|(_, part)| part).sum::<f64>() + 0.0
    }
}
