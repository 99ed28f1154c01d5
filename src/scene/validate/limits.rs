//! Limits of joints.

use super::{bounded, finite, list, place};
use crate::scene::Body;
use crate::{Error, Result};

pub(super) fn check(body: &Body) -> Result<()> {
    if let Some(stiffness) = body.limit_stiffness {
        let place = place(body, "limit_stiffness");
        let remedy = "give a stiffness above zero, N/m or N m/rad, or leave it out for one that is near rigid";
        bounded(&place, stiffness, false, remedy)?;
        if body.limits.is_none() {
            return Err(Error::input(
                place,
                stiffness,
                "the joint has no limits: give `limits = [lower, upper]`, or take the stiffness away",
            ));
        }
    }
    let Some([lower, upper]) = body.limits else {
        return Ok(());
    };
    let place = place(body, "limits");
    finite(&place, &[lower, upper])?;
    if lower >= upper {
        return Err(Error::input(
            place,
            list(&[lower, upper]),
            "give the lower limit, then the upper one, which must be above it (m or rad)",
        ));
    }
    if body.joint.coordinates() != 1 {
        return Err(Error::input(
            place,
            format!("limits of a {} joint", body.joint.kind()),
            "only joints with one coordinate (such as prismatic and revolute ones) have limits; build the motion from several of them",
        ));
    }
    if let Some((how, key)) = prescribed(body) {
        return Err(Error::input(
            place,
            list(&[lower, upper]),
            format!("the joint is {how}, so nothing can stop it: take `limits` or `{key}` away"),
        ));
    }
    Ok(())
}

/// How a joint is kept from moving by itself, and the key that says so; none if it isn't.
pub(super) fn prescribed(body: &Body) -> Option<(&'static str, &'static str)> {
    body.is_prescribed().then_some(match body.locked {
        true => ("locked", "locked"),
        false => ("driven", "motion"),
    })
}

/// A joint must start within its limits; `given` is its coordinate, number `first` of all, if the scene says, `own` what the body says.
pub(super) fn check_start(
    body: &Body,
    first: usize,
    given: Option<f64>,
    own: Option<f64>,
) -> Result<()> {
    let (Some([lower, upper]), q) = (body.limits, given.or(own).unwrap_or(0.0)) else {
        return Ok(());
    };
    if (lower..=upper).contains(&q) {
        return Ok(());
    }
    let start = match given.or(own) {
        Some(_) => "",
        None => " (no initial.q is given)",
    };
    let field = match own {
        Some(_) => "start".into(),
        None => format!("initial.q[{first}]"),
    };
    Err(Error::input(
        place(body, &field),
        format!("{q}{start}"),
        format!("the joint must start within its limits, from {lower} to {upper}"),
    ))
}
