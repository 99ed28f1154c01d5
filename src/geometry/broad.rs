//! Which of many things lie near one another: by boxes around them in a tree (`parry3d-f64`), not by looking at all pairs.

use crate::geometry::points::Ball;
use hydrograd_adjoint::lie::Vec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

/// Up to so many all pairs are looked at, which is faster than a tree.
const FEW: usize = 24;
/// Room for rounding, of the coordinates.
const ROUNDING: f64 = 1e-12;

/// A box with sides along the world's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Region {
    low: Vec3,
    high: Vec3,
}

impl Region {
    /// Around all that is as near to a ball as `reach` (m), and a little more for rounding.
    pub fn around(ball: &Ball, reach: f64) -> Self {
        Self::of_box(ball.center, Vec3::repeat(ball.radius), reach)
    }

    /// The same of a box, by its middle and half of its sides.
    pub fn of_box(center: Vec3, half: Vec3, reach: f64) -> Self {
        let half = half.map(|x| x + reach);
        let room = ROUNDING * (center.amax() + half.amax());
        let half = half.map(|x| x + room);
        Self {
            low: center - half,
            high: center + half,
        }
    }

    /// Around both.
    pub fn joined(self, other: Self) -> Self {
        Self {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }

    fn is_finite(&self) -> bool {
        let both = self.low.iter().chain(self.high.iter());
        both.into_iter().all(|x| x.is_finite())
    }

    fn meets(&self, other: &Self) -> bool {
        (0..3).all(|i| self.low[i] <= other.high[i] && other.low[i] <= self.high[i])
    }

    fn boxed(&self) -> Aabb {
        let corner = |x: &Vec3| Vector::new(x.x, x.y, x.z);
        Aabb::new(corner(&self.low), corner(&self.high))
    }
}

/// Numbered regions, ready to be asked which of them meet.
pub(crate) struct Neighbours {
    /// None of what meets nothing.
    regions: Vec<Option<Region>>,
    /// What isn't finite, and so may meet anything; ascending.
    unknown: Vec<usize>,
    /// Of the finite ones, where they are many.
    tree: Option<Bvh>,
}

impl Neighbours {
    /// Of these regions, by their numbers; none of what meets nothing. One that isn't finite counts as meeting all others.
    pub fn new(regions: Vec<Option<Region>>) -> Self {
        Self::with_tree_above(FEW, regions)
    }

    fn with_tree_above(few: usize, regions: Vec<Option<Region>>) -> Self {
        let each = regions.iter().enumerate();
        let each = each.filter_map(|(i, region)| Some((i, region.as_ref()?)));
        let (finite, unknown): (Vec<_>, Vec<_>) = each.partition(|(_, r)| r.is_finite());
        let unknown = unknown.into_iter().map(|(i, _)| i).collect();
        let leaves = finite.iter().map(|(i, region)| (*i, region.boxed()));
        let tree = (finite.len() > few).then(|| Bvh::from_iter(BvhBuildStrategy::Binned, leaves));
        Self {
            regions,
            unknown,
            tree,
        }
    }

    /// Numbers after `i` whose regions meet its own, ascending.
    fn after(&self, i: usize) -> Vec<usize> {
        let Some(own) = &self.regions[i] else {
            return Vec::new();
        };
        let Some(tree) = self.tree.as_ref().filter(|_| own.is_finite()) else {
            let all = i + 1..self.regions.len();
            let near = |j: &usize| {
                let other = self.regions[*j].as_ref();
                other.is_some_and(|o| !own.is_finite() || !o.is_finite() || own.meets(o))
            };
            return all.filter(near).collect();
        };
        let query = own.boxed();
        let found = tree.intersect_aabb(&query).map(|j| j as usize);
        let mut out: Vec<usize> = found.chain(self.unknown.iter().copied()).collect();
        out.retain(|j| *j > i);
        out.sort_unstable();
        out
    }

    /// The pairs whose regions meet, each with the lower number first: ascending.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        let each = 0..self.regions.len();
        each.flat_map(|i| self.after(i).into_iter().map(move |j| (i, j)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydrograd_adjoint::sample::Samples;

    /// The tree finds what looking at all pairs finds, in the same order, with regions that aren't there and that aren't finite.
    #[test]
    fn the_tree_finds_all_pairs() {
        let mut random = Samples::new(11);
        let mut met = 0;
        for round in 0..40 {
            let regions: Vec<Option<Region>> = (0..10 * round)
                .map(|i| {
                    let center = Vec3::from_fn(|_, _| 4.0 * random.number());
                    let center = match i % 37 {
                        5 => center.map(|_| f64::NAN),
                        _ => center,
                    };
                    let radius = 0.5 * (1.0 + random.number());
                    let ball = Ball { center, radius };
                    (i % 11 != 3).then(|| Region::around(&ball, 0.2 * random.number()))
                })
                .collect();
            let [by_tree, all] = [0, usize::MAX].map(|few| {
                let found = Neighbours::with_tree_above(few, regions.clone());
                found.pairs().collect::<Vec<_>>()
            });
            assert_eq!(by_tree, all);
            met += all.len();
        }
        assert!(met > 1000, "{met}");
    }
}
