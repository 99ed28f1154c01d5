//! Joints that follow others: by how much, and what their leaders have of their limits and losses.

use super::file::File;
use super::joints::{Dynamics, INSIDE, Led, Moves};
use super::options::Options;
use super::report::Report;
use super::tree::joint_place;
use crate::{Error, Result};

/// Of joint number `number`, whose circles have been refused: through all that it follows.
fn led(file: &File, number: usize) -> Result<Option<Led>> {
    let joints = &file.robot.joints;
    let Some(first) = &joints[number].mimic else {
        return Ok(None);
    };
    let (mut ratio, mut offset) = (1.0, 0.0);
    let (mut mimic, mut leader) = (first, first.joint.as_str());
    loop {
        // q = m (m' q' + o') + o.
        offset += ratio * mimic.offset.unwrap_or(0.0);
        ratio *= mimic.multiplier.unwrap_or(1.0);
        let next = joints.iter().find(|j| j.name == leader);
        match next.and_then(|j| j.mimic.as_ref()) {
            Some(more) => (mimic, leader) = (more, more.joint.as_str()),
            None => break,
        }
    }
    if !(ratio.is_finite() && offset.is_finite()) {
        return Err(Error::input(
            format!("{}: {}", joint_place(file, number), file.coupled_by),
            format!("multiplier {ratio}, offset {offset}"),
            "give finite numbers",
        ));
    }
    let joint = leader.to_owned();
    Ok(Some(Led {
        joint,
        ratio,
        offset,
    }))
}

/// Lets joints follow; `joints` has the number of each body's joint.
pub(super) fn follow(
    file: &File,
    joints: &[Option<usize>],
    options: &Options,
    all: &mut [Option<Moves>],
    report: &mut Report,
) -> Result<()> {
    let mut followers = Vec::new();
    for (b, number) in joints.iter().enumerate() {
        let Some(number) = *number else { continue };
        let Some(led) = led(file, number)? else {
            continue;
        };
        let leader = all.iter().position(|m| {
            (m.as_ref()).is_some_and(|m| m.name == led.joint && m.joint.coordinates() == 1)
        });
        let own = all[b].as_ref().is_some_and(|m| m.joint.coordinates() == 1);
        let Some(leader) = leader.filter(|_| own) else {
            return Err(Error::input(
                format!("{}: {}", joint_place(file, number), file.coupled_by),
                format!("joint {:?}", led.joint),
                format!(
                    "both joints must have one coordinate (revolute, continuous or prismatic): take {} away",
                    file.coupled_by
                ),
            ));
        };
        followers.push((b, leader, led.ratio, led.offset));
        give(file, b, leader, led, all, report);
    }
    for (_, leader, ..) in &followers {
        let (Some(moves), Some(number)) = (&mut all[*leader], joints[*leader]) else {
            continue;
        };
        start_within(&joint_place(file, number), moves, options, report)?;
    }
    // Once their leaders' starts are known.
    for (b, leader, ratio, offset) in followers {
        let start = all[leader].as_ref().and_then(|m| m.start).unwrap_or(0.0);
        let start = ratio * start + offset;
        if let Some(follower) = &mut all[b] {
            follower.start = (start != 0.0).then_some(start);
        }
    }
    Ok(())
}

/// A leader starts within the limits that it has together with its followers; `place` begins the message where its start, as chosen, doesn't.
fn start_within(
    place: &str,
    moves: &mut Moves,
    options: &Options,
    report: &mut Report,
) -> Result<()> {
    if options.driven.contains_key(&moves.name) {
        return Ok(());
    }
    let start = moves.start.unwrap_or(0.0);
    let Some([lower, upper]) = moves.limits.filter(|l| !(l[0]..=l[1]).contains(&start)) else {
        return Ok(());
    };
    if options.start.contains_key(&moves.name) {
        return Err(Error::input(
            format!("{place}: start"),
            start,
            format!(
                "must be within the limits that it has together with the joints that follow it, from {lower} to {upper}"
            ),
        ));
    }
    let room = INSIDE * (upper - lower);
    let q = start.clamp(lower + room, upper - room);
    report.note(format!(
        "joint {:?} starts at {q:.6}, since {start} is outside the limits that it has together with its followers, {lower} to {upper}",
        moves.name
    ));
    moves.start = Some(q);
    Ok(())
}

/// Gives the leader what its follower has of limits and losses.
fn give(
    file: &File,
    b: usize,
    leader: usize,
    led: Led,
    all: &mut [Option<Moves>],
    report: &mut Report,
) {
    let Some(follower) = all[b].as_mut() else {
        return;
    };
    let (limits, dynamics) = (follower.limits.take(), follower.dynamics);
    let (actuated, servo) = (follower.actuated, follower.servo.take());
    follower.dynamics = Dynamics::default();
    let (name, ratio, offset) = (follower.name.clone(), led.ratio, led.offset);
    report.note(format!(
        "joint {name:?} follows {:?}: {ratio} times its coordinate and {offset}; its limits, damping, friction, spring and armature are the leader's",
        led.joint
    ));
    follower.mimic = Some(led);
    let Some(of) = all[leader].as_mut() else {
        return;
    };
    if actuated && file.drives.is_some() {
        // k (u − r q − o) at the lever r is r² k (u' − q), u' = (u − o)/r.
        let own = of.actuated;
        report.note(format!(
            "joint {name:?}, which follows {:?}, has an actuator{}",
            of.name,
            match own {
                true => ", which isn't read: the leader has its own",
                false => ": it is the leader's, by the leader's coordinate",
            }
        ));
        if !own {
            of.actuated = true;
            of.servo = servo.map(|gains| gains.map(|gain| ratio * ratio * gain));
        }
    }
    of.dynamics.damping += ratio * ratio * dynamics.damping;
    of.dynamics.friction += ratio.abs() * dynamics.friction;
    of.dynamics.armature += ratio * ratio * dynamics.armature;
    // ½ k (r q + o − q₀)² has its least at (q₀ − o)/r.
    let stiffness = ratio * ratio * dynamics.stiffness;
    if stiffness > 0.0 {
        let rest = (dynamics.rest - offset) / ratio;
        let (own, all) = (of.dynamics.stiffness, of.dynamics.stiffness + stiffness);
        of.dynamics.rest = (own * of.dynamics.rest + stiffness * rest) / all;
        of.dynamics.stiffness = all;
    }
    if let Some([lower, upper]) = limits.filter(|_| ratio != 0.0) {
        let ends = [(lower - offset) / ratio, (upper - offset) / ratio];
        let own = of.limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let both = [
            own[0].max(ends[0].min(ends[1])),
            own[1].min(ends[0].max(ends[1])),
        ];
        match both[0] < both[1] {
            true => of.limits = Some(both),
            false => report.note(format!(
                "the limits of joint {name:?} and of the one that it follows have nothing in common: its own aren't used"
            )),
        }
    }
}
