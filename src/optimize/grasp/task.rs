//! What is to be grasped, and with what.

use crate::adjoint::lie::Vec3;
use crate::simulate::{Rollout, Simulator};
use crate::{Error, Result};

/// A finger of a gripper.
#[derive(Clone, Debug, PartialEq)]
pub struct Finger {
    /// Name of its body.
    pub body: String,
    /// Where it should press, m, body frame: a point of its surface, about. The object is wanted in the middle of all fingers' pads.
    pub pad: [f64; 3],
}

/// A gripper that is to hold an object at the end of a run of its scene.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspTask {
    /// Name of the body that is to be held.
    pub object: String,
    /// Two or more.
    pub fingers: Vec<Finger>,
    /// One entry per control: its sign is the one that closes the gripper, its size what part of the limit closes it; 0: it doesn't.
    pub closing: Vec<f64>,
    /// Largest absolute value of each control, N or N m.
    pub limits: Vec<f64>,
    /// How long it must be held at the end, s.
    pub hold: f64,
}

/// A task in the numbers of a simulator.
#[derive(Clone, Debug)]
pub(super) struct Grip {
    pub object: usize,
    /// Bodies and their pads.
    pub fingers: Vec<(usize, Vec3)>,
    pub closing: Vec<f64>,
    pub limits: Vec<f64>,
    pub hold: f64,
    /// Radius of the object, m.
    pub radius: f64,
    /// Duration of a run, s.
    pub duration: f64,
}

/// Surfaces this part of the object's radius farther apart than the gap at which they touch still count as touching: after an impact without rebound
/// nothing presses any more.
const TOUCH: f64 = 0.015;
/// The fastest that a point of the object may move against a finger, in its radii a second.
const STILL: f64 = 0.025;
/// Most cosine between the normals of two fingers that hold something between them.
const OPPOSED: f64 = -0.2;

/// Part of a finger's size by which a point on its edge may be off.
const ROUNDING: f64 = 1e-6;

/// Part of the run over whose end the cost of the hold is taken, in times that it should be held.
const SPAN: f64 = 1.2;

impl GraspTask {
    /// Since when a rollout has held the object at its end, s: touched by fingers from opposed sides, at rest against them; none if it isn't held at the end.
    ///
    /// # Errors
    /// As [`GraspTask::hold_cost`], or contacts that can't be found.
    pub fn held_since(&self, rollout: &Rollout) -> Result<Option<f64>> {
        Grip::new(rollout.simulator(), self)?.held_since(rollout)
    }
}

impl Grip {
    /// From and to when it should be held, s.
    pub fn end(&self) -> [f64; 2] {
        [(self.duration - SPAN * self.hold).max(0.0), self.duration]
    }

    /// # Errors
    /// Names that no body has, fewer than two fingers, one that is the object or another one, points off their fingers, lists of another length than the simulator has controls, numbers out of range, a scene without
    /// contact, an object without a surface, or a hold longer than the run.
    pub fn new(simulator: &Simulator, task: &GraspTask) -> Result<Self> {
        let names = simulator.names();
        let body = |place: &str, name: &str| {
            names.iter().position(|n| n == name).ok_or_else(|| {
                Error::input(
                    format!("grasp: {place}"),
                    format!("{name:?}"),
                    format!("must be one of {names:?}"),
                )
            })
        };
        let object = body("object", &task.object)?;
        let mut fingers = Vec::new();
        for finger in &task.fingers {
            if let Some(bad) = finger.pad.iter().find(|x| !x.is_finite()) {
                let place = format!("grasp: pad of finger {:?}", finger.body);
                return Err(Error::input(place, bad, "must be finite"));
            }
            let b = body("finger", &finger.body)?;
            let taken = match fingers.iter().any(|(other, _)| *other == b) {
                true => Some("must be a body of its own: another finger has this one"),
                false => (b == object).then_some("must be another body than the object"),
            };
            if let Some(expected) = taken {
                let name = format!("{:?}", finger.body);
                return Err(Error::input("grasp: finger", name, expected));
            }
            fingers.push((b, Vec3::from(finger.pad)));
        }
        if fingers.len() < 2 {
            let expected = "must be at least 2";
            return Err(Error::input("grasp: fingers", fingers.len(), expected));
        }
        let controls = simulator.system().controls;
        for (name, list) in [("closing", &task.closing), ("limits", &task.limits)] {
            if list.len() != controls {
                return Err(Error::input(
                    format!("grasp: {name}"),
                    format!("{} numbers", list.len()),
                    format!("must be {controls} numbers, one per control"),
                ));
            }
        }
        if let Some(bad) = task.closing.iter().find(|x| x.is_nan() || x.abs() > 1.0) {
            let expected = "must be from -1 to 1";
            return Err(Error::input("grasp: closing", bad, expected));
        }
        if task.closing.iter().all(|c| *c == 0.0) {
            let expected = "must not be zero for all controls: what closes the gripper?";
            return Err(Error::input("grasp: closing", "zeros", expected));
        }
        if let Some(bad) = task.limits.iter().find(|l| !(**l > 0.0 && l.is_finite())) {
            let expected = "must be positive numbers, N or N m";
            return Err(Error::input("grasp: limits", bad, expected));
        }
        let duration = simulator.steps() as f64 * simulator.time_step();
        if !(task.hold > 0.0 && task.hold < duration) {
            return Err(Error::input(
                "grasp: hold",
                task.hold,
                format!("must be more than 0 s and less than the {duration} s of the run"),
            ));
        }
        let contact = simulator.system().contact.as_ref();
        let contact = contact.ok_or_else(|| Error::Unsupported {
            what: "a grasp without contact".into(),
            why: "nothing holds what passes through it".into(),
            instead: "give the scene a [contact] section".into(),
        })?;
        let ball = contact.shapes.ball(object).ok_or_else(|| {
            let expected = "must have a shape";
            Error::input("grasp: object", format!("{:?}", task.object), expected)
        })?;
        for (finger, (b, pad)) in task.fingers.iter().zip(&fingers) {
            let Some(around) = contact.shapes.ball(*b) else {
                continue;
            };
            let off = (pad - around.center).norm();
            if off > (1.0 + ROUNDING) * around.radius {
                let expected = format!(
                    "must be a point of its surface, in the body's frame: this one is {off:.3e} m from its middle, of which all of it is within {:.3e} m",
                    around.radius
                );
                let place = format!("grasp: pad of finger {:?}", finger.body);
                return Err(Error::input(place, format!("{:?}", finger.pad), expected));
            }
        }
        Ok(Self {
            object,
            fingers,
            closing: task.closing.clone(),
            limits: task.limits.clone(),
            hold: task.hold,
            radius: ball.radius,
            duration,
        })
    }

    /// Since when the object has been held at the end, s: touched by fingers from opposed sides, at rest against them; none if it isn't at the end.
    pub fn held_since(&self, rollout: &Rollout) -> Result<Option<f64>> {
        let velocities = rollout.observe("velocities")?;
        let mut since = None;
        for n in (0..rollout.steps()).rev() {
            let motion = |b: usize| {
                let of = |k: usize| {
                    Vec3::from_column_slice(&velocities.column(n + 1).as_slice()[6 * b + k..][..3])
                };
                (of(0), of(3))
            };
            let sample = &rollout.samples()[n + 1];
            let (speed, rate) = motion(self.object);
            let place = sample.poses[self.object].translation;
            let still = |f: usize| {
                let (origin, turning) = motion(f);
                let there = origin + turning.cross(&(place - sample.poses[f].translation));
                (speed - there).norm() + self.radius * (rate - turning).norm() < STILL * self.radius
            };
            let mut normals: Vec<(usize, Vec3)> = Vec::new();
            for c in rollout.contacts(n, TOUCH * self.radius)? {
                let (finger, sign) = match (c.first, c.second) {
                    (b, Some(f)) if b == self.object => (f, 1.0),
                    (f, Some(b)) if b == self.object => (f, -1.0),
                    _ => continue,
                };
                if self.fingers.iter().any(|(f, _)| *f == finger) && still(finger) {
                    normals.push((finger, sign * Vec3::from(c.normal)));
                }
            }
            let opposed = |(f, a): &(usize, Vec3)| {
                let others = normals.iter().filter(|(g, _)| g != f);
                others.clone().any(|(_, b)| a.dot(b) < OPPOSED)
            };
            if !normals.iter().any(opposed) {
                break;
            }
            since = Some(sample.time);
        }
        Ok(since)
    }

    /// Whether an object that has been held since then, at the end of a rollout, was held for as long as is asked.
    pub fn caught(&self, rollout: &Rollout, held_since: Option<f64>) -> bool {
        let end = rollout.samples()[rollout.steps()].time;
        held_since.is_some_and(|t| end - t >= self.hold - 1e-9)
    }

    /// Time of the first contact of a finger with the object, s.
    pub fn first_touch(&self, rollout: &Rollout) -> Result<Option<f64>> {
        for n in 0..rollout.steps() {
            let touching = rollout.contacts(n, 0.0)?.into_iter().any(|c| {
                let both = [Some(c.first), c.second];
                both.contains(&Some(self.object))
                    && self.fingers.iter().any(|(f, _)| both.contains(&Some(*f)))
            });
            if touching {
                return Ok(Some(rollout.samples()[n].time));
            }
        }
        Ok(None)
    }
}
