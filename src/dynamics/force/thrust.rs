//! Thrusters at a place and direction of a body, which turn with it; each has a command, a control.
//!
//! With the command u, softened below a dead band δ to g = u³/(u² + δ²), and the speed V at which the water comes toward the thruster (the body's own through the water,
//! at the thruster, along its direction), the thrust is
//!
//! ```text
//! T = f(g) − k V m(g)      m(g) = √(g² + s²) − s
//! ```
//!
//! along the direction, with the moment τ T about it. The loss is that of the bilinear model, T_nn |n| n − T_nv |n| V, for a command that sets the rate n of a
//! propeller, and a share of the thrust for one that sets the thrust; m is |g|, rounded below s, so that T is C¹ in the command where the water moves. As k and m aren't negative it
//! takes energy, whichever way the propeller turns.
//!
//! Where it has a rotor, a body on a joint of one velocity n, u is n and the control is the velocity to which [`super::rotor`] drives it.
//!
//! # References
//! T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd ed., Wiley 2021, section 9.3 (propeller thrust at an advance speed).

use super::curve::Curve;
use super::local::{Law, Local, component};
use super::{Commanded, ForceModel, ForceParts, LoadBars, Moving};
use crate::adjoint::lie::{Mat6, Vec3, Vec6, six};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Parameters, Range};

const COEFFICIENT: Declared = Declared::new("coefficient", "N")
    .range(Range::Finite)
    .size(|value, _| value.abs());
const THRUST: Declared = Declared::new("thrust", "N")
    .range(Range::Finite)
    .size(|value, _| value.abs());
const DEAD_BAND: Declared = Declared::new("dead_band", "of the command");
const LOSS: Declared = Declared::new("loss", "N s/m");
const TORQUE: Declared = Declared::new("torque", "m")
    .range(Range::Finite)
    .size(|value, _| value.abs());

struct Thruster {
    body: usize,
    control: usize,
    /// The body whose joint's velocity is the command instead of the control, and that velocity's number.
    rotor: Option<(usize, usize)>,
    /// Wrench of a newton, without its reaction torque; and what the speed along the direction is of the body's twist.
    lever: Vec6,
    /// The direction, as a moment.
    about: Vec6,
    curve: Curve,
    dead_band: Parameter,
    loss: Parameter,
    torque: Parameter,
    /// s.
    smoothing: f64,
}

/// A thruster at a command and a speed.
struct Thrust {
    /// T, N.
    value: f64,
    /// ∂T/∂u.
    by_command: f64,
    /// ∂T/∂V.
    by_speed: f64,
    /// ∂T/∂ parameters.
    by: Vec<(Parameter, f64)>,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let scene = parts.scene;
    let mut laws = Vec::new();
    for (i, control, given) in scene.thrusters() {
        let owner = Owner::Named(scene.force_name(i));
        let mut declare = |declared, value| parameters.declare(owner.clone(), declared, value);
        let (dead_band, loss, torque) = (
            declare(DEAD_BAND, given.dead_band),
            declare(LOSS, given.loss),
            declare(TORQUE, given.torque),
        );
        let mut parted = |declared, first: usize, values: Vec<f64>| {
            let each = values.into_iter().enumerate();
            let parts = each.map(|(k, value)| {
                let part = (first + k).to_string();
                parameters.declare_part(owner.clone(), declared, &part, value)
            });
            parts.collect()
        };
        let curve = match given.table.is_empty() {
            true => Curve::Polynomial(parted(COEFFICIENT, 1, given.coefficients())),
            false => Curve::Table {
                arguments: given.table.iter().map(|point| point[0]).collect(),
                values: parted(
                    THRUST,
                    0,
                    given.table.iter().map(|point| point[1]).collect(),
                ),
            },
        };
        let (point, direction) = (Vec3::from(given.at), given.unit_direction().into());
        laws.push(Thruster {
            body: scene.body(&given.body).map_or(0, |b| b.0),
            control,
            rotor: given.rotor.as_ref().and_then(|name| {
                let b = scene.body(name)?.0;
                Some((b, parts.tree.links()[b].v.start))
            }),
            lever: component(&direction, &point),
            about: six(&Vec3::zeros(), &direction),
            curve,
            dead_band,
            loss,
            torque,
            smoothing: given.smoothing,
        });
    }
    Local::assemble("thrust", laws)
}

/// g = u³/(u² + δ²), with its derivatives by u and δ.
fn softened(u: f64, band: f64) -> (f64, f64, f64) {
    let size = u.hypot(band);
    if size == 0.0 {
        return (0.0, 1.0, 0.0);
    }
    let (sine, cosine) = (u / size, band / size);
    let share = sine * sine;
    (
        u * share,
        share * (3.0 - 2.0 * share),
        -2.0 * share * sine * cosine,
    )
}

impl Thruster {
    fn thrust(&self, nu: &Vec6, at: &Moving) -> Thrust {
        let command = match self.rotor {
            Some((_, rate)) => at.v[rate],
            None => at.control[self.control],
        };
        self.thrust_at(command, self.lever.dot(nu), at.place.parameters)
    }

    fn thrust_at(&self, command: f64, speed: f64, parameters: &Parameters) -> Thrust {
        let (g, by_command, by_band) = softened(command, parameters[self.dead_band]);
        let curve = self.curve.at(g, parameters);
        let root = g.hypot(self.smoothing);
        // √(g² + s²) − s, without the difference of like numbers.
        let magnitude = g * g / (root + self.smoothing);
        let loss = parameters[self.loss];
        let by_g = curve.slope - loss * speed * g / root;
        let mut by = curve.by;
        by.extend([
            (self.loss, -speed * magnitude),
            (self.dead_band, by_g * by_band),
        ]);
        Thrust {
            value: curve.value - loss * speed * magnitude,
            by_command: by_g * by_command,
            by_speed: -loss * magnitude,
            by,
        }
    }

    /// Wrench of a newton.
    fn unit(&self, parameters: &Parameters) -> Vec6 {
        self.lever + parameters[self.torque] * self.about
    }
}

impl Law for Thruster {
    fn body(&self) -> usize {
        self.body
    }

    fn wrench(&self, nu: &Vec6, at: &Moving) -> Vec6 {
        self.thrust(nu, at).value * self.unit(at.place.parameters)
    }

    fn slope(&self, nu: &Vec6, at: &Moving) -> Mat6 {
        let by_speed = self.thrust(nu, at).by_speed;
        by_speed * self.unit(at.place.parameters) * self.lever.transpose()
    }

    fn inputs_vjp(&self, nu: &Vec6, zeta: &Vec6, at: &Moving, bar: &mut LoadBars) {
        let thrust = self.thrust(nu, at);
        let along = zeta.dot(&self.unit(at.place.parameters));
        if self.rotor.is_none() {
            bar.control[self.control] += along * thrust.by_command;
        }
        for (parameter, by) in thrust.by {
            bar.parameters[parameter] += along * by;
        }
        bar.parameters[self.torque] += thrust.value * zeta.dot(&self.about);
    }

    fn by_rate(&self, nu: &Vec6, at: &Moving) -> Option<(usize, Vec6)> {
        let (_, rate) = self.rotor?;
        let by_command = self.thrust(nu, at).by_command;
        Some((rate, by_command * self.unit(at.place.parameters)))
    }

    fn rotor(&self) -> Option<usize> {
        self.rotor.map(|(b, _)| b)
    }

    fn is_conservative(&self, parameters: &Parameters) -> bool {
        // At no command there is neither thrust nor loss, but by a table that says otherwise; a rotor may turn without a control.
        self.rotor.is_none() && self.thrust_at(0.0, 0.0, parameters).value == 0.0
    }

    fn driven_power(&self, nu: &Vec6, at: &Moving) -> f64 {
        self.wrench(nu, at).dot(nu)
    }

    fn commanded(&self, parameters: &Parameters) -> Option<Commanded> {
        Some(Commanded {
            control: self.control,
            body: self.body,
            wrench: self.unit(parameters),
            command: self.curve.large(),
            thrust: self.thrust_at(self.curve.large(), 0.0, parameters).value,
        })
    }
}
