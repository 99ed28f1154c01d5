//! What is chosen for single joints of a robot.

use crate::robot::JointChoice;
use crate::scene::{Body, Passive, Servo, is_default};
use serde::{Deserialize, Serialize};

/// What is chosen for a joint of a robot that has one coordinate of its own. What is left out stays as the file has it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RobotJoint {
    /// Whether it is a control; default: as the robot's `actuated`, and where it has a servo it is.
    #[serde(skip_serializing_if = "is_default")]
    pub actuated: Option<bool>,
    /// Drive that makes the control its target.
    #[serde(skip_serializing_if = "is_default")]
    pub servo: Option<Servo>,
    /// Spring, damping, friction and armature, instead of all that the file says of them.
    #[serde(skip_serializing_if = "is_default")]
    pub passive: Option<Passive>,
    /// Lower and upper limit, m or rad, also where the robot's `limits` are off.
    #[serde(skip_serializing_if = "is_default")]
    pub limits: Option<[f64; 2]>,
    /// Stiffness of its limits, N/m or N m/rad.
    #[serde(skip_serializing_if = "is_default")]
    pub limit_stiffness: Option<f64>,
}

impl RobotJoint {
    pub(super) fn choice(&self) -> JointChoice {
        let keys = [
            ("actuated", self.actuated.is_some()),
            ("servo", self.servo.is_some()),
            ("passive", self.passive.is_some()),
            ("limits", self.limits.is_some()),
            ("limit_stiffness", self.limit_stiffness.is_some()),
        ];
        let given = keys.into_iter().filter(|(_, given)| *given);
        JointChoice {
            limits: self.limits,
            given: given.map(|(key, _)| key).collect(),
        }
    }

    /// Puts what is chosen in place of what the file says, limits apart, which it has already; `servo` is the one that it has as a control.
    pub(super) fn apply(&self, body: &mut Body, servo: Option<Servo>) {
        body.actuated = self
            .actuated
            .unwrap_or(body.actuated || self.servo.is_some());
        body.servo = self.servo.or(servo.filter(|_| body.actuated));
        body.passive = self.passive.or(body.passive);
        body.limit_stiffness = self.limit_stiffness.or(body.limit_stiffness);
    }
}
