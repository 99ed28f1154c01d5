//! Where the scene starts: lengths against the joints, unit quaternions, prescribed joints.

use super::{finite, limits, place};
use crate::scene::{Body, Motion, Scene};
use crate::{Error, Result};

pub(super) fn check(scene: &Scene) -> Result<()> {
    let initial = &scene.initial;
    if !initial.v.is_empty() && !initial.momentum.is_empty() {
        return Err(Error::input(
            "initial.momentum",
            "a momentum beside v",
            "give either v or momentum; the other follows from it",
        ));
    }
    check_length(scene, "q", &initial.q, Body::coordinates)?;
    check_length(scene, "v", &initial.v, Body::velocities)?;
    check_length(scene, "momentum", &initial.momentum, Body::velocities)?;

    let (mut nq, mut nv) = (0, 0);
    for body in &scene.bodies {
        let (dq, dv) = (body.coordinates(), body.velocities());
        check_own(body)?;
        let given = initial.q.get(nq).copied();
        let own = body.start.first().copied().filter(|_| initial.q.is_empty());
        limits::check_start(body, nq, given, own)?;
        if !initial.q.is_empty() {
            check_quaternion(body, "initial.q", nq, &initial.q[nq..nq + dq])?;
            check_driven(body, nq, "q", &initial.q[nq..nq + dq], |m| m.value(0.0))?;
        }
        for (field, values) in [("v", &initial.v), ("momentum", &initial.momentum)] {
            if !values.is_empty() {
                let given = &values[nv..nv + dv];
                let rate = |m: &Motion| if field == "v" { m.rate(0.0) } else { 0.0 };
                check_driven(body, nv, field, given, rate)?;
                check_locked(body, nv, field, given)?;
            }
        }
        nq += dq;
        nv += dv;
    }
    Ok(())
}

/// Where the body's joint starts by itself.
fn check_own(body: &Body) -> Result<()> {
    if body.start.is_empty() {
        return Ok(());
    }
    let place = place(body, "start");
    finite(&place, &body.start)?;
    let needed = body.coordinates();
    if body.start.len() != needed {
        return Err(Error::input(
            place,
            format!("{} numbers", body.start.len()),
            format!(
                "a {} joint needs {needed}, or none for its origin",
                body.joint.kind()
            ),
        ));
    }
    if body.motion.is_some() {
        return Err(Error::input(
            place,
            format!("{:?}", body.start),
            "the joint is driven, and starts where its `motion` says: take one of the two away",
        ));
    }
    check_quaternion(body, "start", 0, &body.start)
}

fn check_length(
    scene: &Scene,
    field: &str,
    values: &[f64],
    size: impl Fn(&Body) -> usize,
) -> Result<()> {
    let place = format!("initial.{field}");
    finite(&place, values)?;
    let expected: usize = scene.bodies.iter().map(&size).sum();
    if values.is_empty() || values.len() == expected {
        return Ok(());
    }
    let parts = scene.bodies.iter().filter(|b| size(b) > 0);
    let parts: Vec<_> = parts
        .map(|b| format!("{:?} {} {}", b.name, b.joint.kind(), size(b)))
        .collect();
    Err(Error::input(
        place,
        format!("{} numbers", values.len()),
        format!(
            "give {expected} in the order of the bodies ({}), or leave it out for {}",
            parts.join(", "),
            if field == "q" {
                "all joints at their origin"
            } else {
                "a start at rest"
            }
        ),
    ))
}

fn check_quaternion(body: &Body, field: &str, first: usize, q: &[f64]) -> Result<()> {
    let Some(w) = body.joint.model().quaternion_at() else {
        return Ok(());
    };
    let quaternion = &q[w..w + 4];
    let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (norm - 1.0).abs() <= 1e-6 {
        return Ok(());
    }
    let at = first + w;
    let remedy = if norm == 0.0 {
        "give a unit quaternion (w, x, y, z); no rotation is [1, 0, 0, 0]".into()
    } else {
        let unit: Vec<_> = quaternion.iter().map(|x| x / norm).collect();
        format!("give a unit quaternion (w, x, y, z); of the same direction: {unit:?}")
    };
    Err(Error::input(
        place(body, &format!("{field}[{at}..{}]", at + 4)),
        format!("{quaternion:?} of length {norm}"),
        remedy,
    ))
}

/// Entries of driven joints: zero, which leaves them to the motion, or what the motion says.
fn check_driven(
    body: &Body,
    first: usize,
    field: &str,
    given: &[f64],
    at_start: impl Fn(&Motion) -> f64,
) -> Result<()> {
    let motions = body.motion.iter().flatten();
    for (i, (&value, motion)) in given.iter().zip(motions).enumerate() {
        let right = at_start(motion);
        if value != 0.0 && (value - right).abs() > 1e-6 * right.abs().max(value.abs()) {
            let remedy = if field == "momentum" {
                "the joint is driven, so its momentum follows from its motion; write 0".into()
            } else {
                format!("the joint is driven and starts at {right}; write that, or 0")
            };
            return Err(Error::input(
                place(body, &format!("initial.{field}[{}]", first + i)),
                value,
                remedy,
            ));
        }
    }
    Ok(())
}

fn check_locked(body: &Body, first: usize, field: &str, given: &[f64]) -> Result<()> {
    if !body.locked {
        return Ok(());
    }
    match given.iter().position(|&x| x != 0.0) {
        None => Ok(()),
        Some(i) => Err(Error::input(
            place(body, &format!("initial.{field}[{}]", first + i)),
            given[i],
            "the joint is locked and can't move; write 0 or take `locked` away",
        )),
    }
}
