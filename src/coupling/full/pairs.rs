//! The pairs of (target body, source body's image) whose placement changes.

use super::Full;
use crate::adjoint::kernel::Sources;
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, cross_force, linear, six};
use crate::coupling::image::Image;

/// One pair at given poses.
pub(super) struct Pair {
    /// Body whose faces see the sources.
    pub target: usize,
    /// Body whose sources, or their images, are seen.
    pub source: usize,
    /// The image.
    pub image: Image,
    /// Source positions in the target's frame.
    pub points: Sources,
    /// The same as vectors.
    pub positions: Vec<Vec3>,
}

impl Pair {
    /// Displacement of each source in the target's frame, relative to the target.
    pub fn displacements(&self, pose: &Pose, z: &[Vec6]) -> Vec<Vec3> {
        let relative = self.image.twist(&z[self.source]) - z[self.target];
        let local = pose.twist_to_body(&relative);
        let (u, w) = (linear(&local), angular(&local));
        self.positions.iter().map(|s| u + w.cross(s)).collect()
    }

    /// Adds a wrench on the sources (given in the target's frame) to both bodies, as spatial wrenches.
    pub fn apply(&self, pose: &Pose, wrench: &Vec6, out: &mut [Vec6]) {
        let world = pose.wrench_to_world(wrench);
        out[self.source] += self.image.twist_vjp(&world);
        out[self.target] -= world;
    }

    /// Tangent of [`Pair::apply`] when the target moves with `z`.
    pub fn apply_jvp(
        &self,
        pose: &Pose,
        wrench: &Vec6,
        dwrench: &Vec6,
        z: &Vec6,
        out: &mut [Vec6],
    ) {
        let world = cross_force(z, &pose.wrench_to_world(wrench)) + pose.wrench_to_world(dwrench);
        out[self.source] += self.image.twist_vjp(&world);
        out[self.target] -= world;
    }
}

/// Wrench about the origin of forces at points: Σ (f, s × f).
pub(super) fn wrench(positions: &[Vec3], force: impl Fn(usize) -> Vec3) -> Vec6 {
    let (mut total, mut moment) = (Vec3::zeros(), Vec3::zeros());
    for (j, s) in positions.iter().enumerate() {
        let f = force(j);
        total += f;
        moment += s.cross(&f);
    }
    six(&total, &moment)
}

impl Full {
    /// All pairs but each body with its own sources and with those of bodies that it doesn't feel;
    /// images count always.
    pub(super) fn pairs(&self, poses: &[Pose]) -> Vec<Pair> {
        let mut out = Vec::new();
        for target in 0..self.bodies.len() {
            for image in &self.images {
                for source in 0..self.bodies.len() {
                    let apart = source == target || self.excluded.contains(source, target);
                    if apart && image.is_identity() {
                        continue;
                    }
                    let (rotation, shift) = image.placement(&poses[source]);
                    let pose = &poses[target];
                    let rotation = pose.rotation.tr_mul(&rotation);
                    let shift = pose.rotation.tr_mul(&(shift - pose.translation));
                    let own = &self.bodies[source].boundary.sources;
                    let positions: Vec<Vec3> = own.iter().map(|s| rotation * s + shift).collect();
                    out.push(Pair {
                        target,
                        source,
                        image: *image,
                        points: Sources::new(&positions),
                        positions,
                    });
                }
            }
        }
        out
    }
}
