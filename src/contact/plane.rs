//! Bodies over a plane at rest.

use super::point::{ContactPoint, carry, columns};
use crate::geometry::HalfSpace;
use crate::geometry::convex::{Core, Field, Round};
use hydrograd_adjoint::lie::{Mat3, Pose, skew};

/// The lowest point of an ellipsoid or a disc.
pub(super) fn lowest(round: &impl Round, at: &Pose, plane: &HalfSpace) -> ContactPoint {
    let normal = &plane.normal;
    let support = round.support(at, &-normal);
    let field = Field::flat(plane.height(&support.point), *normal);
    // Carried along, the point slides along the surface by C (ω × m), which the gap doesn't feel.
    let sliding = columns(&Mat3::zeros(), &(support.spread * skew(normal)));
    let motion = carry(&support.point) - sliding;
    ContactPoint::probe(&support.point, &motion, [0.0; 2], &field)
}

/// All corners of a core, world frame.
pub(super) fn corners(core: &Core, at: &Pose, wall: &HalfSpace) -> Vec<ContactPoint> {
    let contact = |corner| {
        let x = at.apply(corner);
        let field = Field::flat(wall.height(&x), wall.normal);
        ContactPoint::probe(&x, &carry(&x), [core.radius, 0.0], &field)
    };
    core.corners.iter().map(contact).collect()
}
