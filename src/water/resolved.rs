//! What gaps compressed bodies resolve, and where.

use crate::adjoint::lie::{Pose, Vec3};
use crate::coupling::reduced::Region;
use crate::geometry::{Gap, Gaps, Other};

/// The smallest gap that a body resolves, m: zero where it isn't compressed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Resolved {
    /// All around it.
    pub everywhere: f64,
    /// Where it is smaller.
    pub regions: Vec<Region>,
}

impl Resolved {
    /// Near a point of its surface, body's frame.
    fn at(&self, point: &Vec3) -> f64 {
        let here = self.regions.iter().filter(|r| r.contains(point));
        here.map(|r| r.gap).fold(self.everywhere, f64::min)
    }
}

/// A gap, to the image behind a wall where it is one, over what both bodies resolve, at the place where that is least; and what they
/// resolve there, m. None if neither is compressed.
pub(crate) fn narrowest(
    gaps: &Gaps,
    gap: &Gap,
    poses: &[Pose],
    resolved: &[Resolved],
) -> Option<(f64, f64)> {
    let image = match gap.second {
        Other::Body(_) => 1.0,
        Other::Wall(_) => 2.0,
    };
    let side = |(body, other): (usize, Other)| -> Option<(f64, f64)> {
        let own = &resolved[body];
        let everywhere = (gap.image_distance() / own.everywhere, own.everywhere);
        if own.everywhere <= 0.0 {
            return None;
        }
        if own.regions.is_empty() || everywhere.0 >= 1.0 {
            return Some(everywhere);
        }
        // Centroids are farther than the surface itself, by up to about an edge.
        let reach = own.everywhere / image + gap.edge;
        let faces = gaps.centroids_within(body, other, reach, poses);
        let nearest = (faces.iter().map(|(_, d)| *d)).fold(f64::INFINITY, f64::min);
        let excess = (nearest - gap.distance).max(0.0);
        let ratios = faces.iter().map(|(centroid, distance)| {
            let limit = own.at(centroid);
            (image * (distance - excess) / limit, limit)
        });
        ratios
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .or(Some(everywhere))
    };
    let sides = gap.sides().filter_map(side);
    sides.min_by(|a, b| a.0.total_cmp(&b.0))
}
