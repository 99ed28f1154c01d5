//! Trailing edges, at which a swimmer leaves momentum in the water.

use super::super::is_default;
use super::{Force, Scene, direction, number, square};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A trailing edge: what a beating fin leaves in the water behind it, which flow that sheds nothing lacks. With the velocity of the edge through the water, u toward the head and w
/// across the fin, and the water that a span h carries along, m = ¼πρh²,
///
/// ```text
/// F = −m u w n̂ + ½ m w² t̂
/// ```
///
/// by Lighthill; t̂ toward the head, n̂ across. An edge that goes backwards leads and leaves nothing: F fades as u passes zero within the speed `smoothing` (½(1 + u/√(u² + u₀²))
/// of it is left).
///
/// ```
/// use hydrograd::scene::{Body, Edge, Fluid, Scene, Shape};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::ellipsoid([0.2, 0.02, 0.06])).named("tail").density(1000.0));
/// scene.add_force(Edge::new("tail").at([-0.2, 0.0, 0.0]).span(0.1).into());
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edge {
    /// Name, unique in the scene; default: "edge" and its number among the forces.
    pub name: Option<String>,
    /// Name of the body.
    pub body: String,
    /// The middle of the edge, body's frame, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: [f64; 3],
    /// Direction toward the head, body's frame, of any length.
    #[serde(default = "forward")]
    pub forward: [f64; 3],
    /// Direction across the fin, at a right angle to `forward`, body's frame, of any length.
    #[serde(default = "normal")]
    pub normal: [f64; 3],
    /// h, m.
    pub span: f64,
    /// Part of the water that a span carries along in theory.
    #[serde(default = "whole", skip_serializing_if = "is_whole")]
    pub factor: f64,
    /// u₀, m/s: the speed toward the head within which it fades; 0: it doesn't, and an edge that goes backwards gains energy.
    #[serde(default = "smoothing", skip_serializing_if = "is_smoothing")]
    pub smoothing: f64,
}

fn forward() -> [f64; 3] {
    [1.0, 0.0, 0.0]
}

fn normal() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn whole() -> f64 {
    1.0
}

fn is_whole(value: &f64) -> bool {
    *value == whole()
}

fn smoothing() -> f64 {
    0.01
}

fn is_smoothing(value: &f64) -> bool {
    *value == smoothing()
}

impl Edge {
    /// At a body's origin, toward x, across y; it still needs a span.
    pub fn new(body: impl Into<String>) -> Self {
        Self {
            name: None,
            body: body.into(),
            at: [0.0; 3],
            forward: forward(),
            normal: normal(),
            span: 0.0,
            factor: whole(),
            smoothing: smoothing(),
        }
    }

    /// Directions of length one toward the head and across.
    pub(crate) fn axes(&self) -> ([f64; 3], [f64; 3]) {
        square(self.forward, self.normal)
    }
}

setters! { Edge {
    /// Name, unique in the scene.
    named(name: impl Into<String>) => name = Some(name.into());
    /// The middle of the edge, body's frame, m.
    at(point: [f64; 3]) => at = point;
    /// Direction toward the head, body's frame.
    forward(direction: [f64; 3]) => forward = direction;
    /// Direction across the fin, at a right angle to that, body's frame.
    normal(normal: [f64; 3]) => normal = normal;
    /// h, m.
    span(length: f64) => span = length;
    /// Part of the water that a span carries along in theory.
    factor(part: f64) => factor = part;
    /// u₀, m/s.
    smoothing(speed: f64) => smoothing = speed;
} }

impl From<Edge> for Force {
    fn from(edge: Edge) -> Self {
        Force::Edge(edge)
    }
}

impl Edge {
    /// Checks all that doesn't need the meshes; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        scene.named_body(&self.body, place("body"))?;
        for x in self.at {
            number(place("at"), x, true, "give finite numbers, in m")?;
        }
        direction(place("forward"), self.forward)?;
        direction(place("normal"), self.normal)?;
        super::across(place("normal"), self.forward, self.normal, "`forward`")?;
        if !(self.span > 0.0 && self.span.is_finite()) {
            let remedy = "give the edge's length across the flow, above zero, in m";
            return Err(Error::input(place("span"), self.span, remedy));
        }
        let of_theory = "give zero or more; 1 is the theory's";
        number(place("factor"), self.factor, false, of_theory)?;
        let speed = "give zero or a speed, small beside the edge's, in m/s";
        number(place("smoothing"), self.smoothing, false, speed)
    }
}
