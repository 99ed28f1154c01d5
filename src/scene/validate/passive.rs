//! What a joint does by itself.

use super::{bounded, finite, limits, place};
use crate::scene::Body;
use crate::{Error, Result};

pub(super) fn check(body: &Body) -> Result<()> {
    let Some(passive) = &body.passive else {
        return Ok(());
    };
    let at = |field: &str| place(body, &format!("passive.{field}"));
    if body.joint.velocities() != 1 {
        return Err(Error::input(
            place(body, "passive"),
            format!("passive forces of a {} joint", body.joint.kind()),
            "only joints with one coordinate (such as prismatic and revolute ones) have them; build the motion from several, or take a force between two bodies (a spring with damping)",
        ));
    }
    if let Some((how, key)) = limits::prescribed(body) {
        return Err(Error::input(
            place(body, "passive"),
            format!("passive forces of a joint that is {how}"),
            format!(
                "its force is a result, so they change nothing: take `passive` or `{key}` away"
            ),
        ));
    }
    finite(&at("rest"), &[passive.rest])?;
    let strengths = [
        ("stiffness", passive.stiffness),
        ("damping", passive.damping),
        ("friction", passive.friction),
        ("armature", passive.armature),
    ];
    for (field, value) in strengths {
        let remedy = "give zero or more: a negative one would push the joint on";
        bounded(&at(field), value, true, remedy)?;
    }
    bounded(
        &at("friction_speed"),
        passive.friction_speed,
        false,
        "give a speed above zero (m/s or rad/s), over which friction sets in",
    )
}
