//! Which parameters are shapes', and what follows from them.

use super::parameters::{Parameter, Parameters};

/// A parameter of a body that changes with one of its shape's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follows {
    /// The shape's.
    pub shape: Parameter,
    /// The body's.
    pub follower: Parameter,
    /// Its derivative.
    pub slope: f64,
}

/// The shape parameters of a system.
#[derive(Clone, Debug, Default)]
pub struct Shapes {
    /// All, in the order in which they were asked for.
    pub all: Vec<Parameter>,
    /// Those that the water feels, in the coupling's order.
    pub water: Vec<Parameter>,
    /// What follows from them, and from those of dry bodies.
    pub follows: Vec<Follows>,
}

impl Shapes {
    /// What follows from those of the parameters at the places `chosen` that are shapes': the number among the chosen, the follower's place, its slope.
    pub fn followers(&self, parameters: &Parameters, chosen: &[usize]) -> Vec<(usize, usize, f64)> {
        let follower = |f: &Follows| {
            let from = parameters.place_of(f.shape);
            let at = chosen.iter().position(|place| *place == from)?;
            Some((at, parameters.place_of(f.follower), f.slope))
        };
        self.follows.iter().filter_map(follower).collect()
    }

    /// Transpose of what [`Shapes::followers`] tells: adds to the cotangents of shapes those along what follows.
    pub fn follow_vjp(&self, bar: &mut Parameters) {
        for f in &self.follows {
            let carried = f.slope * bar[f.follower];
            bar[f.shape] += carried;
        }
    }
}
