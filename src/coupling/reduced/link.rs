//! The blocks of G: a body and the image of another, or of itself.

use super::ReducedBody;
use crate::adjoint::lie::{Pose, Vec3};
use crate::coupling::fade::fade;
use crate::geometry::Image;
use std::sync::Arc;

/// Weight of a pair whose centres are a distance c apart: 1 up to `near`, 0 from `far` on, and between
/// them the polynomial of degree 7 whose first three derivatives vanish at both ends, so that state,
/// gradient and Hessian products don't jump when a pair comes or goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutoff {
    /// Distance up to which the pair is fully coupled, m.
    pub near: f64,
    /// Distance from which on it isn't coupled, m.
    pub far: f64,
}

impl Cutoff {
    /// Weight at centre distance `c`, with its first two derivatives.
    pub fn weight(&self, c: f64) -> [f64; 3] {
        let width = self.far - self.near;
        let t = (c - self.near) / width;
        let [value, first] = fade(t);
        let second = match t > 0.0 && t < 1.0 {
            true => -420.0 * (t * (1.0 - t)).powi(2) * (1.0 - 2.0 * t),
            false => 0.0,
        };
        [value, first / width, second / (width * width)]
    }
}

/// A block of G that depends on the poses. G is symmetric and the images of perpendicular walls are
/// their own inverses, so a pair of bodies needs one block per image.
#[derive(Clone)]
pub struct Link {
    /// The body whose points see; not above `source`.
    pub target: usize,
    /// The body whose points, or whose images, are seen.
    pub source: usize,
    /// The image.
    pub image: Image,
    /// Distances of the centres between which the block fades out.
    pub cutoff: Option<Cutoff>,
    /// How often the block counts in `α_xᵀGα_y`, written `Σ_ij P_ij (x_i y_j + y_i x_j)`: 1 between
    /// different bodies, ½ within one; negative for images of opposite sign.
    pub factor: f64,
}

impl Link {
    pub(super) fn all(
        bodies: usize,
        images: &[Image],
        cutoff: impl Fn(usize, usize) -> Option<Cutoff>,
    ) -> Vec<Self> {
        let mut out = Vec::new();
        for target in 0..bodies {
            for source in target..bodies {
                for image in images {
                    let same = target == source;
                    if same && image.is_identity() {
                        continue;
                    }
                    out.push(Self {
                        target,
                        source,
                        image: *image,
                        cutoff: cutoff(target, source),
                        factor: image.sign * if same { 0.5 } else { 1.0 },
                    });
                }
            }
        }
        out
    }

    /// The source body's centre in the target's frame, the same less the target's, and the weight at
    /// that distance with two derivatives.
    pub(super) fn reach(
        &self,
        bodies: &[Arc<ReducedBody>],
        poses: &[Pose],
    ) -> (Vec3, Vec3, [f64; 3]) {
        let parts = |b: usize| bodies[b].parts();
        let (t, s) = (self.target, self.source);
        let (rotation, shift) = self.image.placement(&poses[s]);
        let centre = poses[t].apply_inverse(&(rotation * parts(s).centre + shift));
        let between = centre - parts(t).centre;
        let weight = match &self.cutoff {
            Some(cutoff) => cutoff.weight(between.norm()),
            None => [1.0, 0.0, 0.0],
        };
        (centre, between, weight)
    }

    /// The bodies (target, source) that it couples, in both orders: one body and its image once.
    pub(super) fn ends(&self) -> impl Iterator<Item = (usize, usize)> {
        let (t, s) = (self.target, self.source);
        [(t, s), (s, t)]
            .into_iter()
            .take(if t == s { 1 } else { 2 })
    }
}

#[cfg(test)]
mod tests {
    use super::Cutoff;

    #[test]
    fn fades_from_one_to_zero_with_its_own_derivatives() {
        let cutoff = Cutoff {
            near: 2.0,
            far: 3.5,
        };
        assert_eq!(cutoff.weight(1.0), [1.0, 0.0, 0.0]);
        assert_eq!(cutoff.weight(4.0), [0.0; 3]);
        let h = 1e-5;
        for i in 0..=30 {
            let c = 1.9 + 0.06 * f64::from(i);
            let [_, first, second] = cutoff.weight(c);
            let (up, down) = (cutoff.weight(c + h), cutoff.weight(c - h));
            assert!(((up[0] - down[0]) / (2.0 * h) - first).abs() < 1e-8);
            assert!(((up[1] - down[1]) / (2.0 * h) - second).abs() < 1e-7);
            assert!(up[0] <= down[0]);
        }
    }
}
