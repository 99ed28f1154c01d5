//! Numbers of coordinates, velocities and controls, and their names.

use super::{Body, Joint, Scene};

impl Body {
    /// Whether the joint's motion is given: driven by `motion`, or locked.
    pub fn is_prescribed(&self) -> bool {
        self.motion.is_some() || self.locked
    }

    /// Number of controls of this body: the velocities of an actuated joint, six for a thruster.
    pub fn controls(&self) -> usize {
        let joint = if self.actuated {
            self.joint.velocities()
        } else {
            0
        };
        joint + if self.thruster { 6 } else { 0 }
    }
}

impl Body {
    /// Number of joint coordinates of its own: none where it follows another's.
    pub fn coordinates(&self) -> usize {
        match self.mimic {
            Some(_) => 0,
            None => self.joint.coordinates(),
        }
    }

    /// Number of generalised velocities of its own.
    pub fn velocities(&self) -> usize {
        match self.mimic {
            Some(_) => 0,
            None => self.joint.velocities(),
        }
    }
}

impl Scene {
    /// Number of joint coordinates q of all bodies, those of driven and locked joints included.
    pub fn coordinates(&self) -> usize {
        self.bodies.iter().map(Body::coordinates).sum()
    }

    /// Number of generalised velocities v of all bodies, those of driven and locked joints included.
    pub fn velocities(&self) -> usize {
        self.bodies.iter().map(Body::velocities).sum()
    }

    /// Number of controls a step takes: those of bodies, then those of thrusters among the forces, then those of tendons.
    pub fn controls(&self) -> usize {
        self.body_controls() + self.commands()
    }

    /// How many of these are those of bodies.
    pub(crate) fn body_controls(&self) -> usize {
        self.bodies.iter().map(Body::controls).sum()
    }

    /// How many of these are commands of thrusters and tendons.
    pub(crate) fn commands(&self) -> usize {
        self.all_thrusters().count() + self.all_tendons().count()
    }

    /// Names of the controls, in order: `arm.force.rate` does work on the velocity `arm.rate`, `arm.target.angle` is where a servo shall bring `arm.angle`,
    /// `hull.wrench.fx`, …, `hull.wrench.mz` are a body's wrench, and a thruster's command has the thruster's name.
    pub fn control_labels(&self) -> Vec<String> {
        let mut out = Vec::with_capacity(self.controls());
        for body in &self.bodies {
            if body.actuated {
                let (what, labels) = match body.servo {
                    Some(_) => ("target", body.joint.coordinate_labels()),
                    None => ("force", body.joint.velocity_labels()),
                };
                let labels = labels.iter();
                out.extend(labels.map(|label| format!("{}.{what}.{label}", body.name)));
            }
            if body.thruster {
                let labels = ["fx", "fy", "fz", "mx", "my", "mz"];
                out.extend(labels.map(|label| format!("{}.wrench.{label}", body.name)));
            }
        }
        out.extend(self.thrusters().map(|(i, _, _)| self.force_name(i)));
        out.extend(self.tendons().map(|(i, _, _)| self.force_name(i)));
        out
    }

    /// Units of the controls, in order: of forces `N` and of moments `N m`, of targets of servos `m` and `rad`, of the velocity of a thruster's rotor `rad/s` (`m/s` where it slides), of other
    /// commands `N` where they are the thrust itself, of what tendons shall be pulled by `m`, and `1` of what scales or curves make something else of.
    pub fn control_units(&self) -> Vec<&'static str> {
        let mut out = Vec::with_capacity(self.controls());
        for body in &self.bodies {
            if body.actuated {
                let labels = body.joint.velocity_labels().iter();
                out.extend(labels.map(|label| match (body.servo, slides(label)) {
                    (Some(_), true) => "m",
                    (Some(_), false) => "rad",
                    (None, true) => "N",
                    (None, false) => "N m",
                }));
            }
            if body.thruster {
                out.extend(["N", "N", "N", "N m", "N m", "N m"]);
            }
        }
        let named = |name: &String| self.bodies.iter().find(|body| body.name == *name);
        let turns = |body: &Body| !body.joint.velocity_labels().iter().all(|x| slides(x));
        out.extend(self.thrusters().map(
            |(_, _, thruster)| match thruster.rotor.as_ref().map(named) {
                Some(rotor) if rotor.is_none_or(turns) => "rad/s",
                Some(_) => "m/s",
                None if thruster.polynomial.is_empty() && thruster.table.is_empty() => "N",
                None => "1",
            },
        ));
        out.extend(self.tendons().map(|(_, _, tendon)| match tendon.gain {
            1.0 => "m",
            _ => "1",
        }));
        out
    }

    /// Names of the entries of q: `coin.y`, `coin.z`, `coin.angle`, …
    pub fn coordinate_labels(&self) -> Vec<String> {
        self.labels(Joint::coordinate_labels)
    }

    /// Names of the entries of v: `coin.vy`, `coin.vz`, `coin.rate`, …
    pub fn velocity_labels(&self) -> Vec<String> {
        self.labels(Joint::velocity_labels)
    }

    fn labels(&self, of: impl Fn(&Joint) -> &'static [&'static str]) -> Vec<String> {
        let each = self.bodies.iter().filter(|body| body.mimic.is_none());
        each.flat_map(|body| {
            let labels = of(&body.joint).iter();
            labels.map(move |label| format!("{}.{label}", body.name))
        })
        .collect()
    }
}

/// Whether a velocity of this name is one of a length: others turn.
fn slides(label: &str) -> bool {
    label.starts_with('v')
}
