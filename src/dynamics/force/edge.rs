//! Trailing edges: the momentum that a beating fin leaves in the water behind it.
//!
//! With u and w the velocity of the edge through the water, toward the head (t̂) and across the fin (n̂), and m = ¼πρh² f the water that the span h carries along,
//!
//! ```text
//! F = g(u) (−m u w n̂ + ½ m w² t̂)        g = ½ (1 + u/√(u² + u₀²))
//! ```
//!
//! The water's kinetic energy, which closed flow keeps, then leaves with the wake: the power is −½ g m u w². At small amplitude of the edge's place y = h(x, t) in a stream U toward
//! the tail, w = ḣ + U h_x, and the mean thrust with the potential flow's own part is ½ m (ḣ² − U² h_x²).
//!
//! # References
//! M. J. Lighthill, "Large-amplitude elongated-body theory of fish locomotion", Proc. R. Soc. Lond. B 179 (1971) 125–138, eq. 6 and 7.

use super::local::{Law, Local, component};
use super::{ForceModel, ForceParts, LoadBars, Moving};
use crate::adjoint::lie::{Mat6, Vec6};
use crate::dynamics::parameters::{DENSITY, Declarations, Declared, Owner, Parameter, Parameters};
use std::f64::consts::FRAC_PI_4;

const SPAN: Declared = Declared::new("span", "m");
const FACTOR: Declared = Declared::new("factor", "1");

struct Edge {
    body: usize,
    /// What u and w are of the body's twist.
    along: Vec6,
    across: Vec6,
    /// u₀, m/s.
    smoothing: f64,
    span: Parameter,
    factor: Parameter,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let scene = parts.scene;
    let mut laws = Vec::new();
    for (i, given) in scene.edges() {
        let owner = Owner::Named(scene.force_name(i));
        let (forward, normal) = given.axes();
        let at = given.at.into();
        laws.push(Edge {
            body: scene.body(&given.body).map_or(0, |b| b.0),
            along: component(&forward.into(), &at),
            across: component(&normal.into(), &at),
            smoothing: given.smoothing,
            span: parameters.declare(owner.clone(), SPAN, given.span),
            factor: parameters.declare(owner, FACTOR, given.factor),
        });
    }
    Local::assemble("edge", laws)
}

impl Edge {
    /// u, w, g and g'.
    fn flow(&self, nu: &Vec6) -> [f64; 4] {
        let (u, w) = (self.along.dot(nu), self.across.dot(nu));
        if self.smoothing == 0.0 {
            return [u, w, 1.0, 0.0];
        }
        let size = u.hypot(self.smoothing);
        let part = self.smoothing / size;
        [u, w, 0.5 * (1.0 + u / size), 0.5 * part * part / size]
    }

    /// m.
    fn water(&self, parameters: &Parameters) -> f64 {
        FRAC_PI_4 * parameters.density() * parameters[self.span].powi(2) * parameters[self.factor]
    }

    /// The wrench at unit m.
    fn unit(&self, nu: &Vec6) -> Vec6 {
        let [u, w, g, _] = self.flow(nu);
        g * (0.5 * w * w * self.along - u * w * self.across)
    }
}

impl Law for Edge {
    fn body(&self) -> usize {
        self.body
    }

    fn wrench(&self, nu: &Vec6, at: &Moving) -> Vec6 {
        self.water(at.place.parameters) * self.unit(nu)
    }

    fn slope(&self, nu: &Vec6, at: &Moving) -> Mat6 {
        let [u, w, g, rate] = self.flow(nu);
        let along = 0.5 * rate * w * w * self.along + g * w * self.across;
        let across = -w * (g + u * rate) * self.along - g * u * self.across;
        let unit = self.along * along.transpose() + self.across * across.transpose();
        self.water(at.place.parameters) * unit
    }

    fn inputs_vjp(&self, nu: &Vec6, zeta: &Vec6, at: &Moving, bar: &mut LoadBars) {
        let parameters = at.place.parameters;
        let power = FRAC_PI_4 * self.unit(nu).dot(zeta);
        let (density, span, factor) = (
            parameters.density(),
            parameters[self.span],
            parameters[self.factor],
        );
        bar.parameters[DENSITY] += span * span * factor * power;
        bar.parameters[self.span] += 2.0 * density * span * factor * power;
        bar.parameters[self.factor] += density * span * span * power;
    }

    fn acts(&self, parameters: &Parameters) -> bool {
        parameters[self.span] != 0.0 && parameters[self.factor] != 0.0
    }
}
