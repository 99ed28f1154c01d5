//! Fins of a body.

use super::super::is_default;
use super::{Force, Scene, direction, number, square};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A fin or foil on a body, by quasi-steady lift and drag in the plane of its chord and its normal; flow along the span has no effect. For a rudder that is
/// deflected, give it to a body on a revolute joint.
///
/// With u along the chord and v along the normal the velocity through the water, w = √(u² + v² + w₀²): lift ½ρA C_Lα (uv/w)(v, −u), drag −½ρA (C_D0 + C_D1 v²/w²) w (u, v),
/// at a quarter of the chord from the middle, upstream. It is smooth, nothing at rest, and the same forwards and backwards. It doesn't stall.
///
/// ```
/// use hydrograd::scene::{Body, Fin, Fluid, Scene, Shape};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::ellipsoid([0.5, 0.1, 0.1])).named("glider").density(1000.0));
/// let wing = Fin::new("glider").at([0.05, 0.0, 0.0]).chord([1.0, 0.0, 0.0], 0.12).normal([0.0, 0.0, 1.0]);
/// scene.add_force(wing.area(0.1).lift_slope(4.5).drag(0.01).induced_drag(1.2).into());
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fin {
    /// Name, unique in the scene; default: "fin" and its number among the forces.
    pub name: Option<String>,
    /// Name of the body.
    pub body: String,
    /// The middle of its chord, body's frame, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: [f64; 3],
    /// Direction of the chord, toward the leading edge, body's frame, of any length.
    pub chord: [f64; 3],
    /// Direction across the fin, at a right angle to the chord, body's frame, of any length.
    pub normal: [f64; 3],
    /// Length of the chord, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub length: f64,
    /// A, m².
    pub area: f64,
    /// C_Lα, 1/rad: 2π of a long thin foil, 2π Λ/(Λ + 2) or so of one of the aspect ratio Λ.
    pub lift_slope: f64,
    /// C_D0, of the flow along the chord.
    #[serde(default, skip_serializing_if = "is_default")]
    pub drag: f64,
    /// C_D1, of the flow across: about 1.2 for a plate, and for the induced drag C_Lα²/(π Λ).
    #[serde(default, skip_serializing_if = "is_default")]
    pub induced_drag: f64,
    /// w₀, m/s: the speed below which the laws go over to smooth ones.
    #[serde(default = "smoothing", skip_serializing_if = "is_smoothing")]
    pub smoothing: f64,
}

/// A hundredth of a metre a second: drag at rest is linear to there.
fn smoothing() -> f64 {
    0.01
}

fn is_smoothing(value: &f64) -> bool {
    *value == smoothing()
}

impl Default for Fin {
    fn default() -> Self {
        Self {
            name: None,
            body: String::new(),
            at: [0.0; 3],
            chord: [1.0, 0.0, 0.0],
            normal: [0.0, 0.0, 1.0],
            length: 0.0,
            area: 0.0,
            lift_slope: 0.0,
            drag: 0.0,
            induced_drag: 0.0,
            smoothing: smoothing(),
        }
    }
}

impl Fin {
    /// At a body's origin, its chord along x and its normal along z; it still needs an area and coefficients.
    pub fn new(body: impl Into<String>) -> Self {
        Self {
            body: body.into(),
            ..Self::default()
        }
    }

    /// Directions of length one along the chord and across it.
    pub(crate) fn axes(&self) -> ([f64; 3], [f64; 3]) {
        square(self.chord, self.normal)
    }
}

setters! { Fin {
    /// Name, unique in the scene.
    named(name: impl Into<String>) => name = Some(name.into());
    /// The middle of its chord, body's frame, m.
    at(point: [f64; 3]) => at = point;
    /// Direction across the fin, at a right angle to the chord, body's frame.
    normal(normal: [f64; 3]) => normal = normal;
    /// Area, m².
    area(area: f64) => area = area;
    /// C_Lα, 1/rad.
    lift_slope(slope: f64) => lift_slope = slope;
    /// C_D0.
    drag(coefficient: f64) => drag = coefficient;
    /// C_D1.
    induced_drag(coefficient: f64) => induced_drag = coefficient;
    /// w₀, m/s.
    smoothing(speed: f64) => smoothing = speed;
} }

impl Fin {
    /// Direction of the chord, toward the leading edge, and its length, m.
    pub fn chord(mut self, direction: [f64; 3], length: f64) -> Self {
        (self.chord, self.length) = (direction, length);
        self
    }
}

impl From<Fin> for Force {
    fn from(fin: Fin) -> Self {
        Force::Fin(fin)
    }
}

impl Fin {
    /// Checks all that doesn't need the meshes; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        scene.named_body(&self.body, place("body"))?;
        for x in self.at {
            number(place("at"), x, true, "give finite numbers, in m")?;
        }
        direction(place("chord"), self.chord)?;
        direction(place("normal"), self.normal)?;
        super::across(place("normal"), self.chord, self.normal, "the chord")?;
        let numbers = [
            ("length", self.length, "m"),
            ("area", self.area, "m²"),
            ("lift_slope", self.lift_slope, "1/rad"),
            ("drag", self.drag, "a coefficient"),
            ("induced_drag", self.induced_drag, "a coefficient"),
        ];
        for (field, x, unit) in numbers {
            number(
                place(field),
                x,
                false,
                &format!("give zero or more, {unit}"),
            )?;
        }
        match self.smoothing > 0.0 && self.smoothing.is_finite() {
            true => Ok(()),
            false => Err(Error::input(
                place("smoothing"),
                self.smoothing,
                "give a speed above zero, small beside the fin's, in m/s",
            )),
        }
    }
}
