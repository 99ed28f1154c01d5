//! The pairs of (target body, source body's image) whose placement changes.

use super::Full;
use crate::adjoint::lie::Pose;
use crate::coupling::pair::Pair;

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
                    let own = &self.bodies[source].boundary.sources;
                    let (at, from) = ((target, &poses[target]), (source, &poses[source]));
                    out.push(Pair::new(at, from, image, own));
                }
            }
        }
        out
    }
}
