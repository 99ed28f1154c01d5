//! Derivatives with respect to the shapes of bodies.
//!
//! A shape parameter s of a body moves the points of its surface, in the body's frame, with velocities that are fixed once its mesh is: see
//! [`ShapeDirection`]. A coupling that is made with such directions answers with ∂E/∂s of what it computes, discretisation included
//! ([`Linearised::shape_vjp`](super::Linearised::shape_vjp)).

use super::Direction;
use crate::Error;
use crate::adjoint::lie::{Mat6, Vec3, Vec6};

/// How a body changes with one of its shape parameters, per unit of that.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeDirection {
    /// The body, by its number in the water.
    pub body: usize,
    /// Velocities of the vertices of its mesh, body frame.
    pub vertices: Vec<Vec3>,
    /// Change of its added mass alone in the water (unit density, body frame, about its origin), where that is known better than the mesh tells it.
    pub added_mass: Option<Mat6>,
}

/// What derivatives with respect to shapes are asked of: `weight` times E(x, y), or times `D_g E(x, y)[Z]` where the bodies are displaced `along` Z (a spatial twist
/// a body) at constant body-frame twists.
#[derive(Clone, Copy, Debug)]
pub struct ShapeTerm<'a> {
    /// Factor.
    pub weight: f64,
    /// The one direction.
    pub x: Direction<'a>,
    /// The other one.
    pub y: Direction<'a>,
    /// The displacement, if it is of the energy's slope.
    pub along: Option<&'a [Vec6]>,
}

/// Why there are no derivatives where a film acts.
pub(super) fn filmed() -> Error {
    Error::Unsupported {
        what: "derivatives with respect to shapes where a film carries a gap".into(),
        why: "how the film changes with the shape isn't told".into(),
        instead: "keep bodies farther apart, or leave the films out (`films` = false)".into(),
    }
}
