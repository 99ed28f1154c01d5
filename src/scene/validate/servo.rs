//! Drives that hold a joint.

use super::{bounded, place};
use crate::scene::Body;
use crate::{Error, Result};

pub(super) fn check(body: &Body) -> Result<()> {
    let Some(servo) = &body.servo else {
        return Ok(());
    };
    let refused = |given: String, remedy: &str| {
        let place = place(body, "servo");
        Err(Error::input(place, given, remedy.to_owned()))
    };
    if body.joint.velocities() != 1 {
        let given = format!("a servo of a {} joint", body.joint.kind());
        return refused(
            given,
            "only a joint with one coordinate (such as a prismatic or revolute one) has one",
        );
    }
    if !body.actuated {
        let given = "a servo of a joint that isn't actuated".into();
        return refused(
            given,
            "its target is the joint's control: give the body `actuated = true` as well",
        );
    }
    let gains = [("stiffness", servo.stiffness), ("damping", servo.damping)];
    for (field, value) in gains {
        let remedy = "give zero or more: a negative gain would push the joint away";
        bounded(&place(body, &format!("servo.{field}")), value, true, remedy)?;
    }
    Ok(())
}
