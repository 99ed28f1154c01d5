//! The smallest of all gaps, and those under a distance, without looking at bodies that are far apart.

use super::{Found, Gap, Gaps, Other};
use crate::geometry::broad::{Neighbours, Region};
use crate::geometry::convex::Solid;
use crate::geometry::points::Ball;
use hydrograd_adjoint::lie::Pose;

/// By how much farther pairs are looked for where the nearest of those found may not be the nearest of all.
const FARTHER: f64 = 4.0;

/// A pair with a lower bound of its gap, m; not negative.
struct Candidate {
    bound: f64,
    pair: (usize, Other),
}

impl Gaps {
    /// Smallest gap of all pairs, one pose per mesh; none when there is no pair. Of pairs
    /// equally near to rounding, always the same one. Pairs with a pose that is missing or isn't
    /// finite are passed over.
    pub fn smallest(&self, poses: &[Pose]) -> Option<Gap> {
        let balls = self.balls(poses);
        let mut best: Option<Found> = None;
        // Pairs up to a distance at a time, each time farther: the nearest first by the balls around them.
        let (mut from, mut to) = (f64::NEG_INFINITY, mean_radius(&balls));
        loop {
            let mut waiting = self.candidates(poses, &balls, to);
            waiting.retain(|c| c.bound >= from);
            waiting.sort_by(|a, b| a.bound.total_cmp(&b.bound).then(a.pair.cmp(&b.pair)));
            for Candidate { bound, pair } in waiting {
                let limit = best.as_ref().map_or(f64::INFINITY, |gap| gap.distance);
                if bound > 0.0 && bound >= limit {
                    return best.map(|gap| self.whole(&gap));
                }
                best = self.found(pair, poses, limit).or(best);
            }
            if to == f64::INFINITY || best.as_ref().is_some_and(|gap| gap.distance <= to) {
                return best.map(|gap| self.whole(&gap));
            }
            (from, to) = (to, farther(&balls, to));
        }
    }

    /// The gaps below `distance` (m), in the order of [`Gaps::all`].
    pub fn within(&self, poses: &[Pose], distance: f64) -> Vec<Gap> {
        self.among(poses, distance, |_| true)
    }

    /// Those of a gap's bodies with others.
    pub(crate) fn beside(&self, gap: &Gap, poses: &[Pose], distance: f64) -> Vec<Gap> {
        let itself = (gap.first, gap.second);
        self.among(poses, distance, |pair @ (a, b)| {
            let bodies = [Other::Body(a), b];
            pair != itself
                && gap
                    .sides()
                    .any(|(own, _)| bodies.contains(&Other::Body(own)))
        })
    }

    /// Those of some pairs.
    fn among(
        &self,
        poses: &[Pose],
        distance: f64,
        wanted: impl Fn((usize, Other)) -> bool,
    ) -> Vec<Gap> {
        let near = self.candidates(poses, &self.balls(poses), distance);
        let near = near.into_iter().filter(|c| wanted(c.pair));
        near.filter_map(|c| self.gap(c.pair, poses, distance))
            .collect()
    }

    fn balls(&self, poses: &[Pose]) -> Vec<Option<Ball>> {
        let placed = |(i, pose): (usize, &Pose)| {
            let tree = self.trees.get(i)?.as_ref()?;
            // Meshes lie within the shapes that they stand for.
            let ball = self.solids[i].as_ref().map_or(tree.ball, Solid::ball);
            Some(ball.transformed(pose)).filter(|b| b.center.iter().all(|x| x.is_finite()))
        };
        poses.iter().enumerate().map(placed).collect()
    }

    /// The pairs that may be nearer than `distance` (m), in the order of [`Gaps::pairs`].
    fn candidates(&self, poses: &[Pose], balls: &[Option<Ball>], distance: f64) -> Vec<Candidate> {
        let region = |ball: &Option<Ball>| Some(Region::around(ball.as_ref()?, 0.5 * distance));
        let near = Neighbours::new(balls.iter().map(region).collect());
        let mut bodies = near.pairs().peekable();
        let mut out = Vec::new();
        for i in (0..balls.len()).filter(|i| balls[*i].is_some()) {
            let own = std::iter::from_fn(|| bodies.next_if(|(first, _)| *first == i));
            let own = own.filter(|(_, j)| self.pairing.has(i, *j));
            let others = own.map(|(_, j)| Other::Body(j));
            for pair in others.chain(self.walls_of(i)).map(|other| (i, other)) {
                let bound = self.bound(balls, pair).filter(|b| *b < distance);
                let bound = bound.map(|b| b.max(self.apart(poses, pair)));
                if let Some(bound) = bound.filter(|b| *b < distance) {
                    out.push(Candidate { bound, pair });
                }
            }
        }
        out
    }

    /// A lower bound of a gap, from boxes around the bodies; not negative.
    fn apart(&self, poses: &[Pose], (i, other): (usize, Other)) -> f64 {
        let Other::Body(j) = other else {
            return 0.0;
        };
        let casing = |b: usize| Some((self.casings.get(b)?.as_ref()?, poses.get(b)?));
        match (casing(i), casing(j)) {
            (Some((a, at)), Some((b, there))) => a.apart_at(at, b, there),
            _ => 0.0,
        }
    }

    /// A lower bound of a gap, from balls around the bodies.
    fn bound(&self, balls: &[Option<Ball>], (i, other): (usize, Other)) -> Option<f64> {
        let ball = (*balls.get(i)?)?;
        let bound = match other {
            Other::Body(j) => ball.distance(&(*balls.get(j)?)?),
            Other::Wall(w) => self.walls[w].height(&ball.center) - ball.radius,
        };
        // Room for rounding.
        let slack = 1e-14 * (ball.center.norm() + ball.radius + bound.abs());
        bound.is_finite().then_some(bound - slack)
    }
}

fn mean_radius(balls: &[Option<Ball>]) -> f64 {
    let radii = balls.iter().flatten().map(|b| b.radius);
    radii.clone().sum::<f64>() / radii.count().max(1) as f64
}

/// A larger distance; without end where all are within it of one another.
fn farther(balls: &[Option<Ball>], distance: f64) -> f64 {
    let next = FARTHER * distance;
    let reach = balls.iter().flatten().map(|b| b.center.norm() + b.radius);
    let across = 2.0 * reach.fold(0.0, f64::max);
    if next > 0.0 && next < across {
        next
    } else {
        f64::INFINITY
    }
}
