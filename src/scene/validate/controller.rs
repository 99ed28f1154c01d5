//! Controllers of a scene.

use super::{finite, nearest};
use crate::scene::{Body, Controller, Joint, Scene};
use crate::{Error, Result};

impl Scene {
    pub(super) fn check_controller(&self) -> Result<()> {
        let commands = self.commands();
        let counted = |field: &str, values: &[f64], commands: usize| {
            let controls = self.body_controls() + commands;
            finite(&format!("controller.{field}"), values)?;
            if values.len() == controls {
                return Ok(());
            }
            let parts = self.bodies.iter().filter(|b| b.controls() > 0);
            let mut parts: Vec<_> = parts
                .map(|b| format!("{:?} {}", b.name, b.controls()))
                .collect();
            if commands > 0 {
                let of = [
                    ("thrusters", self.all_thrusters().count()),
                    ("tendons", self.all_tendons().count()),
                ];
                let some = of.iter().filter(|(_, n)| *n > 0);
                parts.extend(some.map(|(what, n)| format!("{what} {n}")));
            }
            Err(Error::input(
                format!("controller.{field}"),
                format!("{} numbers", values.len()),
                format!(
                    "give one per control, {controls} in all ({})",
                    if parts.is_empty() {
                        "no body is actuated or has a thruster".into()
                    } else {
                        parts.join(", ")
                    }
                ),
            ))
        };
        let count = |field: &str, values: &[f64]| counted(field, values, commands);
        match &self.controller {
            None => Ok(()),
            Some(Controller::Constant { control }) => count("control", control),
            Some(Controller::Pd {
                target,
                stiffness,
                damping,
            }) => {
                let unfit = |b: &&Body| {
                    b.thruster || (b.actuated && (b.joint.has_quaternion() || b.servo.is_some()))
                };
                if let Some(body) = self.bodies.iter().find(unfit) {
                    return Err(Error::input(
                        "controller.kind",
                        "pd",
                        format!(
                            "it drives joints without quaternions by forces, and body {:?} \
                             has {}: use kind = \"constant\" or a controller of your own in Rust",
                            body.name,
                            if body.thruster {
                                "a thruster".into()
                            } else if body.servo.is_some() {
                                "a servo, whose control is a target and not a force".into()
                            } else {
                                format!("an actuated {} joint", body.joint.kind())
                            }
                        ),
                    ));
                }
                // Thrusters and tendons among the forces get nothing from it.
                if self.body_controls() == 0 {
                    return Err(Error::input(
                        "controller.kind",
                        "pd",
                        "it drives joints by forces, and none of the scene's is actuated; thrusters and tendons get nothing from it: use kind = \"constant\" or a controller of \
                         your own",
                    ));
                }
                counted("target", target, 0)?;
                counted("stiffness", stiffness, 0)?;
                counted("damping", damping, 0)
            }
            Some(Controller::PushThenLock {
                body: name,
                force,
                stop_at,
            }) => {
                finite("controller.force", &[*force])?;
                finite("controller.stop_at", &[*stop_at])?;
                let body = self.named("controller.body", name)?;
                if body.joint.velocities() != 1 || !body.actuated {
                    return Err(Error::input(
                        "controller.body",
                        format!("{name:?}"),
                        format!(
                            "push-then-lock pushes an actuated prismatic or revolute joint, and \
                             this body has a {} joint with actuated = {}: change the body or name \
                             another",
                            body.joint.kind(),
                            body.actuated
                        ),
                    ));
                }
                match body.servo {
                    None => Ok(()),
                    Some(_) => Err(Error::input(
                        "controller.body",
                        format!("{name:?}"),
                        "push-then-lock pushes with a force, and the control of this body's joint is the target of its servo: take the servo away, or give the target as \
                         kind = \"constant\"",
                    )),
                }
            }
            Some(Controller::Wave {
                bodies,
                places,
                amplitude,
                frequency,
                length,
                bias,
                stiffness,
                damping,
                rise,
            }) => {
                for (k, name) in bodies.iter().enumerate() {
                    self.wave_joint(name)?;
                    if bodies[..k].contains(name) {
                        return Err(Error::input(
                            format!("controller.bodies[{k}]"),
                            format!("{name:?}"),
                            "name each body once: it has one joint to bend",
                        ));
                    }
                }
                let sizes = [
                    ("frequency", *frequency),
                    ("bias", *bias),
                    ("stiffness", *stiffness),
                    ("damping", *damping),
                ];
                for (field, x) in sizes {
                    finite(&format!("controller.{field}"), &[x])?;
                }
                finite("controller.amplitude", amplitude)?;
                finite("controller.places", places)?;
                let wrong = |field: &str, value: String, right: &str| {
                    Err(Error::input(format!("controller.{field}"), value, right))
                };
                if bodies.is_empty() {
                    return wrong("bodies", "none".into(), "name a body whose joint bends");
                }
                if !places.is_empty() && places.len() != bodies.len() {
                    let given = format!("{} numbers", places.len());
                    return wrong("places", given, "give one for each of `bodies`, or none");
                }
                if *length == 0.0 || !length.is_finite() {
                    let right = "give a finite length that isn't zero, in lengths of the body";
                    return wrong("length", length.to_string(), right);
                }
                if !(*rise >= 0.0 && rise.is_finite()) {
                    let right = "give a time that is finite and not negative, s";
                    return wrong("rise", rise.to_string(), right);
                }
                Ok(())
            }
            Some(Controller::Playback { control }) => {
                let mut rows = control.iter().enumerate();
                rows.try_for_each(|(n, row)| count(&format!("control[{n}]"), row))
            }
            Some(Controller::SpeedStages { bodies, stages }) => {
                for name in bodies {
                    let body = self.named("controller.bodies", name)?;
                    if body.joint.velocities() != 1 {
                        return Err(Error::input(
                            "controller.bodies",
                            format!("{name:?}"),
                            format!(
                                "speed-stages watches prismatic and revolute joints, and this body has a {} joint: name \
                                 another",
                                body.joint.kind()
                            ),
                        ));
                    }
                    if let Some(mimic) = &body.mimic {
                        return Err(Error::input(
                            "controller.bodies",
                            format!("{name:?}"),
                            format!(
                                "its joint follows that of {:?} and has no speed of its own: name that one",
                                mimic.body
                            ),
                        ));
                    }
                }
                if bodies.is_empty() || stages.is_empty() {
                    return Err(Error::input(
                        "controller",
                        format!("{} bodies, {} stages", bodies.len(), stages.len()),
                        "give at least one body to watch and one stage",
                    ));
                }
                for (k, stage) in stages.iter().enumerate() {
                    let field = format!("stages[{k}]");
                    if !(stage.until >= 0.0 && stage.until.is_finite()) {
                        return Err(Error::input(
                            format!("controller.{field}.until"),
                            stage.until,
                            "give a speed that is finite and not negative, m/s or rad/s",
                        ));
                    }
                    count(&format!("{field}.control"), &stage.control)?;
                }
                Ok(())
            }
        }
    }

    /// Refuses a body whose joint no wave can bend.
    fn wave_joint(&self, name: &str) -> Result<()> {
        let body = self.named("controller.bodies", name)?;
        let turns = matches!(body.joint, Joint::Revolute { .. });
        if body.servo.is_some() {
            return Err(Error::input(
                "controller.bodies",
                format!("{name:?}"),
                "wave bends joints by torques, and this one has a servo, which takes an angle: leave the servo away or name another",
            ));
        }
        if turns && body.actuated && body.motion.is_none() {
            return Ok(());
        }
        Err(Error::input(
            "controller.bodies",
            format!("{name:?}"),
            format!(
                "wave bends actuated revolute joints, and this body has a {} joint with actuated = {}: change the body or name another",
                body.joint.kind(),
                body.actuated
            ),
        ))
    }

    /// The body that a controller names.
    fn named(&self, field: &str, name: &str) -> Result<&Body> {
        let Some(id) = self.body(name) else {
            let names = self.bodies.iter().map(|b| b.name.as_str());
            let near = nearest(name, names).map(|n| format!("; did you mean {n:?}?"));
            return Err(Error::input(
                field,
                format!("{name:?}"),
                format!("no body has that name{}", near.unwrap_or_default()),
            ));
        };
        Ok(&self.bodies[id.0])
    }
}
