//! What the comparison asks about the shapes of a scene.

use crate::scene::{Scene, Shape};
use crate::shape::DEFAULT_FACES;

/// How many of the shapes closed forms are known for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ClosedForms {
    All,
    Some,
    None,
}

pub(super) fn closed_forms(scene: &Scene) -> ClosedForms {
    let known = |s: &Shape| matches!(s, Shape::Sphere { .. } | Shape::Ellipsoid { .. });
    match (shapes(scene).all(known), shapes(scene).any(known)) {
        (true, _) => ClosedForms::All,
        (false, true) => ClosedForms::Some,
        (false, false) => ClosedForms::None,
    }
}

pub(super) fn shapes(scene: &Scene) -> impl Iterator<Item = &Shape> {
    scene.bodies.iter().filter_map(|b| b.shape.as_ref())
}

/// Whether a shape's number of faces can be chosen.
pub(super) fn refinable(shape: &Shape) -> bool {
    !shape.is_mesh()
}

/// Whether the scene itself has so many faces on every shape by formula.
pub(super) fn has_faces(scene: &Scene, number: usize) -> bool {
    let asked = shapes(scene).filter(|s| refinable(s));
    asked
        .map(|s| s.asked_faces().unwrap_or(DEFAULT_FACES))
        .all(|n| n == number)
}
