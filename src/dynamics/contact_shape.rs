//! How places where surfaces are near move with the shapes of the bodies.

use super::{PairContact, Parameters, System};
use crate::adjoint::contact::ContactBar;
use crate::adjoint::lie::{Pose, Vec3};
use crate::contact::ContactPoint;

/// How far beyond a place's gap the same place is looked for on a changed shape, and how far from where it was, in what the surface moves by: a place on a flat side moves far.
const AROUND: f64 = 1000.0;

impl System {
    /// Adds the cotangents of shapes for those of what a place consists of, the bodies resting: from the same place on shapes a little larger and smaller.
    pub(super) fn add_contact_shape_vjp(
        &self,
        at: &PairContact,
        poses: &[Pose],
        (bar, position): (&ContactBar, &Vec3),
        out: &mut Parameters,
    ) {
        let Some(model) = &self.contact else { return };
        let idle = bar.gap == 0.0 && bar.weight == 0.0 && bar.normal == Vec3::zeros();
        if idle && *position == Vec3::zeros() {
            return;
        }
        for changed in &model.changed {
            if changed.body != at.first && Some(changed.body) != at.second {
                continue;
            }
            let near = AROUND * changed.reach;
            let value = |side: usize| {
                let reach = at.point.gap + near;
                // Where nothing is found any more nothing is known of a change.
                let found = changed.shapes[side]
                    .points_within(&at.pair, poses, reach)
                    .ok()?;
                let same = nearest(&found, &at.point)?;
                let apart = (same.position - at.point.position).norm();
                (apart <= near).then(|| product(bar, position, same))
            };
            let own = product(bar, position, &at.point);
            out[changed.parameter] += match (value(0), value(1)) {
                (Some(more), Some(less)) => (more - less) / (2.0 * changed.step),
                (Some(more), None) => (more - own) / changed.step,
                (None, Some(less)) => (own - less) / changed.step,
                (None, None) => 0.0,
            };
        }
    }
}

/// Of several places at corners and edges that meet, the one where the surfaces face each other as they did.
fn nearest<'p>(found: &'p [ContactPoint], at: &ContactPoint) -> Option<&'p ContactPoint> {
    let off = |p: &&ContactPoint| {
        let turned = (p.normal - at.normal).norm() + (p.weight - at.weight).abs();
        (p.position - at.position).norm() + at.gap.abs().max(p.gap.abs()) * turned
    };
    found.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
}

fn product(bar: &ContactBar, position: &Vec3, at: &ContactPoint) -> f64 {
    bar.gap * at.gap
        + bar.weight * at.weight
        + bar.normal.dot(&at.normal)
        + position.dot(&at.position)
}
