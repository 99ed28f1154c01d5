//! Thrusters of a body.

use super::super::is_default;
use super::{Force, Scene, direction, number, unit};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A thruster at a point of a body, which pushes the body along a direction that turns with it. Its command is a control: the last ones of a scene, in the order of
/// its forces, named as they are.
///
/// The thrust is a curve of the command, an odd polynomial ([`Thruster::polynomial`]) or a table ([`Thruster::table`]); without either the command is the thrust, in N.
///
/// ```
/// use hydrograd::scene::{Body, Fluid, Scene, Shape, Thruster};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::sphere(0.2)).named("rov").density(1000.0));
/// let thruster = Thruster::new("rov").named("port").at([-0.1, 0.1, 0.0]).direction([1.0, 0.2, 0.0]);
/// scene.add_force(thruster.polynomial([0.0, 40.0]).torque(0.02).loss(6.0).into());
/// scene.validate()?;
/// assert_eq!(scene.control_labels(), ["port"]);
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thruster {
    /// Name, unique in the scene, also of its control; default: "thruster" and its number among the forces.
    pub name: Option<String>,
    /// Name of the body.
    pub body: String,
    /// Where it is in the body's frame, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: [f64; 3],
    /// Direction in which it pushes the body, body's frame, of any length.
    pub direction: [f64; 3],
    /// c₁, c₂, … of a thrust of Σ c_k |u|^(k−1) u at the command u: N. Default, without a table: 1.
    #[serde(default, skip_serializing_if = "is_default")]
    pub polynomial: Vec<f64>,
    /// Command and thrust (N), commands rising: a smooth curve through these points, monotone where they are, straight beyond them.
    #[serde(default, skip_serializing_if = "is_default")]
    pub table: Vec<[f64; 2]>,
    /// Command δ below which it does little: u³/(u² + δ²) takes the place of u.
    #[serde(default, skip_serializing_if = "is_default")]
    pub dead_band: f64,
    /// Moment on the body about the direction per newton of thrust, m: positive for one that turns the body by the right-hand rule.
    #[serde(default, skip_serializing_if = "is_default")]
    pub torque: f64,
    /// Thrust that is lost per speed through the water along the direction, and per command, N s/m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub loss: f64,
    /// Name of the body that is its rotor, on a joint with one velocity. The thrust is then that of this velocity n as the command, and the control is the velocity that
    /// the rotor is driven to: by the joint force (J/T)(u − n), J being the rotor's own inertia along its joint at the start, with the armature there.
    pub rotor: Option<String>,
    /// T, s, of the rotor.
    pub time_constant: Option<f64>,
    /// Command below which the loss sets in smoothly.
    #[serde(default = "smoothing", skip_serializing_if = "is_smoothing")]
    pub smoothing: f64,
}

/// A hundredth of commands between −1 and 1.
fn smoothing() -> f64 {
    0.01
}

fn is_smoothing(value: &f64) -> bool {
    *value == smoothing()
}

impl Default for Thruster {
    fn default() -> Self {
        Self {
            name: None,
            body: String::new(),
            at: [0.0; 3],
            direction: [1.0, 0.0, 0.0],
            polynomial: Vec::new(),
            table: Vec::new(),
            dead_band: 0.0,
            torque: 0.0,
            loss: 0.0,
            rotor: None,
            time_constant: None,
            smoothing: smoothing(),
        }
    }
}

impl Thruster {
    /// At a body's origin, along its x axis, with a command in N.
    pub fn new(body: impl Into<String>) -> Self {
        Self {
            body: body.into(),
            ..Self::default()
        }
    }

    /// By the velocity of a rotor, a body on a joint with one velocity, which is driven to the control with the time constant T, s. A dry body does for it, on the vehicle,
    /// which then feels it turn, or on the world, which makes of it a first-order lag alone.
    pub fn rotor(mut self, body: impl Into<String>, time_constant: f64) -> Self {
        (self.rotor, self.time_constant) = (Some(body.into()), Some(time_constant));
        self
    }

    /// Its polynomial.
    pub(crate) fn coefficients(&self) -> Vec<f64> {
        match self.polynomial.is_empty() {
            true => vec![1.0],
            false => self.polynomial.clone(),
        }
    }

    /// Its direction, of length one.
    pub(crate) fn unit_direction(&self) -> [f64; 3] {
        unit(self.direction)
    }
}

setters! { Thruster {
    /// Name, unique in the scene, also of its control.
    named(name: impl Into<String>) => name = Some(name.into());
    /// Where it is in the body's frame, m.
    at(point: [f64; 3]) => at = point;
    /// Direction in which it pushes the body, body's frame, of any length.
    direction(direction: [f64; 3]) => direction = direction;
    /// Coefficients of its thrust as Σ c_k |u|^(k−1) u, N: `[0.0, 40.0]` is 40 |u| u.
    polynomial(coefficients: impl Into<Vec<f64>>) => polynomial = coefficients.into();
    /// Command and thrust (N) of points, commands rising.
    table(points: impl Into<Vec<[f64; 2]>>) => table = points.into();
    /// Command below which it does little.
    dead_band(command: f64) => dead_band = command;
    /// Moment on the body about the direction per newton of thrust, m.
    torque(arm: f64) => torque = arm;
    /// Thrust that is lost per speed through the water along the direction, and per command, N s/m.
    loss(loss: f64) => loss = loss;
    /// Command below which the loss sets in smoothly.
    smoothing(command: f64) => smoothing = command;
} }

impl From<Thruster> for Force {
    fn from(thruster: Thruster) -> Self {
        Force::Thruster(thruster)
    }
}

impl Thruster {
    /// Checks all that doesn't need the meshes; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        scene.named_body(&self.body, place("body"))?;
        for x in self.at {
            number(place("at"), x, true, "give finite numbers, in m")?;
        }
        direction(place("direction"), self.direction)?;
        if !self.polynomial.is_empty() && !self.table.is_empty() {
            return Err(Error::input(
                place("table"),
                "a table beside a polynomial",
                "the thrust has one curve: take one of them away",
            ));
        }
        for (k, c) in self.polynomial.iter().enumerate() {
            let place = place(&format!("polynomial[{k}]"));
            number(place, *c, true, "give a finite number, in N")?;
        }
        if self.table.len() == 1 {
            return Err(Error::input(
                place("table"),
                "1 point",
                "give two or more: [[command, thrust], …]",
            ));
        }
        for (k, point) in self.table.iter().enumerate() {
            let field = |i: usize| place(&format!("table[{k}][{i}]"));
            number(field(0), point[0], true, "give a finite command")?;
            number(field(1), point[1], true, "give a finite thrust, in N")?;
            // So that no line between two points is steeper than numbers go.
            if k > 0 && point[0] - self.table[k - 1][0] <= 1e-9 * point[0].abs() {
                return Err(Error::input(
                    field(0),
                    format!("{} after {}", point[0], self.table[k - 1][0]),
                    "commands must rise, by more than a billionth",
                ));
            }
        }
        self.check_rotor(scene, place)?;
        number(
            place("torque"),
            self.torque,
            true,
            "give a finite arm, in m",
        )?;
        let remedy = "give a command, zero or more";
        number(place("dead_band"), self.dead_band, false, remedy)?;
        let remedy = "give zero or more, in N s/m: a negative loss would drive the body";
        number(place("loss"), self.loss, false, remedy)?;
        match self.smoothing > 0.0 && self.smoothing.is_finite() {
            true => Ok(()),
            false => Err(Error::input(
                place("smoothing"),
                self.smoothing,
                "give a command above zero, small beside those that are used",
            )),
        }
    }

    fn check_rotor(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        let (name, time) = match (&self.rotor, self.time_constant) {
            (None, None) => return Ok(()),
            (Some(name), Some(time)) => (name, time),
            (None, Some(time)) => {
                return Err(Error::input(
                    place("time_constant"),
                    time,
                    "the velocity of a rotor lags: give `rotor`, a body on a revolute joint (a dry one on the world is a lag alone), or take it away",
                ));
            }
            (Some(name), None) => {
                return Err(Error::input(
                    place("rotor"),
                    format!("{name:?}"),
                    "give its `time_constant`, in s",
                ));
            }
        };
        let b = scene.named_body(name, place("rotor"))?.0;
        let rotor = &scene.bodies[b];
        let unfit = match rotor {
            _ if *name == self.body => Some("is the body that the thruster pushes".to_string()),
            _ if rotor.joint.velocities() != 1 => {
                Some(format!("is on a {} joint", rotor.joint.kind()))
            }
            _ if rotor.mimic.is_some() => Some("follows another joint".to_string()),
            _ if rotor.is_prescribed() => Some("is driven by a motion or locked".to_string()),
            _ if rotor.actuated => Some("is actuated".to_string()),
            _ if scene
                .thrusters()
                .filter(|(_, _, t)| t.rotor == self.rotor)
                .count()
                > 1 =>
            {
                Some("another thruster drives".to_string())
            }
            _ => None,
        };
        if let Some(why) = unfit {
            return Err(Error::input(
                place("rotor"),
                format!("{name:?}, which {why}"),
                "name a body of its own on a joint with one velocity that nothing else drives",
            ));
        }
        match time > 0.0 && time.is_finite() {
            true => Ok(()),
            false => Err(Error::input(
                place("time_constant"),
                time,
                "give a time above zero, in s",
            )),
        }
    }
}
