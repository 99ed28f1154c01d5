//! Joints that follow others.

use super::{finite, place};
use crate::scene::{Body, Scene};
use crate::{Error, Result};

/// What becomes of a follower's numbers where they are given to its leader.
const COORDINATE: &str = ", less the offset and over the ratio";
const SQUARE: &str = ", times the ratio's square";
const LOSSES: &str = ", times the ratio's square, friction times its size";

pub(super) fn check(scene: &Scene, body: &Body) -> Result<()> {
    let Some(mimic) = &body.mimic else {
        return Ok(());
    };
    let at = |field: &str| place(body, &format!("mimic.{field}"));
    let leader = scene.named_body(&mimic.body, at("body"))?;
    let leader = &scene.bodies[leader.0];
    let refused = |why: &str| {
        let given = format!("{:?}", mimic.body);
        Err(Error::input(at("body"), given, why.to_owned()))
    };
    if leader.name == body.name {
        return refused("a joint can't follow itself: name another one, or take `mimic` away");
    }
    if leader.mimic.is_some() {
        return refused(
            "that joint follows another itself: follow that one, with the product of both ratios",
        );
    }
    if leader.joint.coordinates() != 1 {
        return refused(
            "that body's joint hasn't one coordinate: follow a prismatic, revolute or screw joint",
        );
    }
    if body.joint.coordinates() != 1 {
        return Err(Error::input(
            place(body, "mimic"),
            format!("a {} joint", body.joint.kind()),
            "only a joint with one coordinate (such as a prismatic or revolute one) can follow another",
        ));
    }
    finite(&at("ratio"), &[mimic.ratio])?;
    finite(&at("offset"), &[mimic.offset])?;
    let own = [
        ("start", !body.start.is_empty(), COORDINATE),
        ("motion", body.motion.is_some(), COORDINATE),
        ("locked", body.locked, ""),
        ("limits", body.limits.is_some(), COORDINATE),
        ("passive", body.passive.is_some(), LOSSES),
        ("servo", body.servo.is_some(), SQUARE),
        ("actuated", body.actuated, ""),
    ];
    match own.iter().find(|(_, given, _)| *given) {
        Some((key, _, how)) => Err(Error::input(
            place(body, key),
            format!("{key} of a joint that follows another"),
            format!(
                "it has no coordinate of its own: give `{key}` to {:?}{how}, or take `mimic` away",
                mimic.body
            ),
        )),
        None => Ok(()),
    }
}
