//! What drives joints, and pushes at sites ([`super::thrusters`]), as the actuators of an MJCF file do: all of them `<general>` ones by now ([`super::general`]), or of kinds that aren't read.

use super::Made;
use mjcf_rs::Model;
use mjcf_rs::body::JointType;
use mjcf_rs::extras::{Actuator, ActuatorKind};
use std::collections::HashMap;

/// How a force F follows from the control u, the length l that is driven and its rate.
pub(super) enum Law {
    /// F = u, or a multiple of it.
    Force,
    /// F = k (u − l) − c l̇: k and c.
    Servo([f64; 2]),
    /// Another one.
    Other,
}

pub(super) fn law(actuator: &Actuator) -> Law {
    let is = |given: &Option<String>, plain: &[&str]| {
        given.as_deref().is_none_or(|given| plain.contains(&given))
    };
    let one = |all: &[f64], k: usize| all.get(k).copied().unwrap_or(0.0);
    let lags = is(&actuator.dyn_type, &["none", "filter", "filterexact"]);
    let plain = actuator.kind == ActuatorKind::General && is(&actuator.gain_type, &["fixed"]);
    if !(plain && lags) {
        return Law::Other;
    }
    let [k, c] = [1, 2].map(|i| 0.0 - one(&actuator.biasprm, i));
    match actuator.bias_type.as_deref() {
        None | Some("none") => Law::Force,
        Some("affine") if k != 0.0 => Law::Servo([k, c]),
        _ => Law::Other,
    }
}

fn kind_of(model: &Model, joint: &str) -> Option<JointType> {
    let (body, number) = model.joint_by_name(joint)?;
    Some(model.bodies[body].body.joints[number].type_)
}

impl Made<'_> {
    /// Which joints are driven, and how, where the file has actuators.
    pub(super) fn actuators(&mut self) {
        let model = self.model;
        if model.actuators.is_empty() {
            return;
        }
        let mut drives: HashMap<String, Option<[f64; 2]>> = HashMap::new();
        for actuator in &model.actuators {
            let Some(joint) = actuator.joint.clone() else {
                if let Some(site) = &actuator.site {
                    self.thruster(actuator, site);
                }
                continue;
            };
            let one = kind_of(model, &joint);
            let one = one.is_some_and(|kind| matches!(kind, JointType::Hinge | JointType::Slide));
            let note = match law(actuator) {
                _ if !one => format!(
                    "the actuator of joint {joint:?} isn't read, as that has more than one coordinate"
                ),
                _ if drives.contains_key(&joint) => {
                    format!("a second actuator of joint {joint:?} isn't read")
                }
                Law::Servo(gains) => {
                    // A length g q is driven, by a force whose moment is g times as large.
                    let gear = actuator.gear[0];
                    let [k, c] = gains.map(|gain| gear * gear * gain);
                    if !(k >= 0.0 && c >= 0.0 && k.is_finite() && c.is_finite()) {
                        self.file.notes.push(format!("the actuator of joint {joint:?} isn't read: with the stiffness {k} and the damping {c} it would push the joint on"));
                        drives.insert(joint, None);
                        continue;
                    }
                    drives.insert(joint.clone(), Some([k, c]));
                    format!(
                        "the file's actuator of joint {joint:?} is a servo (stiffness {k}, damping {c}): unless chosen otherwise its control is where the joint shall be, rad or m, whatever gear, gain and constant bias"
                    )
                }
                Law::Force => {
                    drives.insert(joint, None);
                    continue;
                }
                Law::Other => {
                    drives.insert(joint.clone(), None);
                    format!(
                        "how the actuator of joint {joint:?} makes a force or torque of its control isn't read: unless chosen otherwise the control is that itself"
                    )
                }
            };
            self.file.notes.push(note);
        }
        // What tendons drive isn't known here.
        let tendons = model.actuators.iter().any(|a| a.tendon.is_some());
        let joints = self.file.robot.joints.iter();
        let idle = joints.filter(|j| self.file.extras.contains_key(&j.name) && j.mimic.is_none());
        let idle: Vec<&str> = (idle.map(|j| &j.name[..]))
            .filter(|name| !drives.contains_key(*name))
            .collect();
        match (idle.is_empty(), tendons) {
            (true, _) => {}
            (_, true) => {
                let note = format!(
                    "joints {idle:?} are controls, forces or torques, as what drives tendons isn't read"
                );
                let idle: Vec<String> = idle.into_iter().map(String::from).collect();
                drives.extend(idle.into_iter().map(|name| (name, None)));
                self.file.notes.push(note);
            }
            (_, false) => {
                let note = format!(
                    "joints {idle:?} have no actuator, and are no controls; `actuated = true` makes them so"
                );
                self.file.notes.push(note);
            }
        }
        self.file.drives = Some(drives);
    }
}
