//! Joints of the file as joints here.

use super::file::File;
use super::options::{Followers, Options};
use super::report::Report;
use super::tree::joint_place;
use crate::multibody::{Joint, Plane};
use crate::{Error, Result};
use nalgebra::Vector3;
use urdf_rs::JointType;

/// Cosine of the largest angle between the axis of a planar joint and the frame's.
const ALONG: f64 = 1.0 - 1e-9;
/// Of its range, how far inside its limits a joint starts whose zero is outside.
pub(super) const INSIDE: f64 = 0.01;

/// How a body moves against what carries it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moves {
    /// Name of the joint.
    pub name: String,
    pub joint: Joint,
    /// m or rad.
    pub limits: Option<[f64; 2]>,
    /// Where it starts, if not at zero.
    pub start: Option<f64>,
    /// Of `<dynamics>`.
    pub dynamics: Dynamics,
    /// Whether something drives it, as far as the file says.
    pub actuated: bool,
    /// Stiffness and damping of what holds it at a target, N/m or N m/rad and N s/m or N m s/rad.
    pub servo: Option<[f64; 2]>,
    /// The joint that it follows.
    pub mimic: Option<Led>,
}

/// What a joint resists its own motion with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Dynamics {
    /// N s/m or N m s/rad.
    pub damping: f64,
    /// Coulomb's, N or N m.
    pub friction: f64,
    /// N/m or N m/rad, and the coordinate at which it doesn't push.
    pub stiffness: f64,
    pub rest: f64,
    /// kg or kg m².
    pub armature: f64,
}

/// How a joint follows another.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Led {
    /// The other's name; it has a coordinate of its own.
    pub joint: String,
    /// Motion per motion of the other.
    pub ratio: f64,
    /// Coordinate where the other's is zero, m or rad.
    pub offset: f64,
}

/// Of joint number `number`; what isn't taken as it stands is told to the report.
pub(super) fn moves(
    file: &File,
    number: usize,
    options: &Options,
    report: &mut Report,
) -> Result<Moves> {
    let given = &file.robot.joints[number];
    let wrong = |field: &str, value: String, remedy: String| {
        let place = format!("{}: {field}", joint_place(file, number));
        Err(Error::input(place, value, remedy))
    };
    let axis = *given.axis.xyz;
    let axial = matches!(
        given.joint_type,
        JointType::Revolute | JointType::Continuous | JointType::Prismatic
    );
    let needs_axis = axial || given.joint_type == JointType::Planar;
    if needs_axis && Vector3::from(axis).norm() == 0.0 {
        return wrong(
            "axis",
            format!("{axis:?}"),
            "give a direction that isn't zero, such as 0 0 1".into(),
        );
    }
    let joint = match given.joint_type {
        JointType::Fixed => Joint::Fixed,
        JointType::Revolute | JointType::Continuous => Joint::Revolute { axis },
        JointType::Prismatic => Joint::Prismatic { axis },
        JointType::Floating => Joint::Free,
        JointType::Spherical => Joint::Spherical,
        JointType::Planar => match plane(&axis) {
            Some(plane) => Joint::Planar { plane },
            None => {
                return wrong(
                    "axis",
                    format!("{axis:?}"),
                    "the normal of a planar joint must be along x, y or z of its frame: turn the joint's origin, and what is in the child link back".into(),
                );
            }
        },
    };
    if let Some(mimic) = &given.mimic {
        follows(file, number, mimic, options, report)?;
    }
    let dynamics = dynamics(file, number)?;
    let limits = match given.joint_type {
        JointType::Revolute | JointType::Prismatic => limits(file, number, report)?,
        _ => None,
    };
    let limits = limits.filter(|_| !options.without_limits);
    let limits = chosen_limits(file, number, options)?.or(limits);
    tell_unused(file, number, report);
    let start = start(file, number, axial, limits, options, report)?;
    Ok(Moves {
        name: given.name.clone(),
        joint,
        limits,
        start,
        dynamics,
        actuated: (file.drives.as_ref()).is_none_or(|drives| drives.contains_key(&given.name)),
        servo: (file.drives.as_ref()).and_then(|drives| *drives.get(&given.name)?),
        mimic: None,
    })
}

/// Limits that stand for the file's.
fn chosen_limits(file: &File, number: usize, options: &Options) -> Result<Option<[f64; 2]>> {
    let choice = options.joints.get(&file.robot.joints[number].name);
    let Some([lower, upper]) = choice.and_then(|choice| choice.limits) else {
        return Ok(None);
    };
    if lower < upper && lower.is_finite() && upper.is_finite() {
        return Ok(Some([lower, upper]));
    }
    let place = format!("{}: limits, as chosen", joint_place(file, number));
    let given = format!("{lower} to {upper}");
    Err(Error::input(
        place,
        given,
        "give two finite numbers, the larger one second",
    ))
}

/// Tells what a joint of its kind has no use for.
fn tell_unused(file: &File, number: usize, report: &mut Report) {
    let given = &file.robot.joints[number];
    let (lower, upper) = (given.limit.lower, given.limit.upper);
    let ranged = lower < upper && (lower.is_finite() || upper.is_finite());
    let ranged = ranged && file.joints[number].has_range;
    let losses = given.dynamics.as_ref();
    let losses = losses.is_some_and(|d| d.damping != 0.0 || d.friction != 0.0);
    let (kind, losses) = match given.joint_type {
        JointType::Continuous => ("continuous", false),
        JointType::Planar => ("planar", losses),
        JointType::Floating => ("floating", losses),
        _ => return,
    };
    let what = match (ranged, losses) {
        (true, true) => "range (<limit>), damping and friction (<dynamics>)",
        (true, false) => "range (<limit>)",
        (false, true) => "damping and friction (<dynamics>)",
        (false, false) => return,
    };
    report.note(format!(
        "joint {:?} is {kind}, and moves without the {what} that the file gives it",
        given.name
    ));
}

fn plane(axis: &[f64; 3]) -> Option<Plane> {
    let unit = Vector3::from(*axis).normalize();
    let planes = [Plane::Yz, Plane::Zx, Plane::Xy];
    (0..3).find(|k| unit[*k].abs() > ALONG).map(|k| planes[k])
}

/// Checks a joint that follows another.
fn follows(
    file: &File,
    number: usize,
    mimic: &urdf_rs::Mimic,
    options: &Options,
    report: &mut Report,
) -> Result<()> {
    let name = &file.robot.joints[number].name;
    let wrong = |value: String, remedy: &str| {
        let place = format!("{}: {}", joint_place(file, number), file.coupled_by);
        Err(Error::input(place, value, remedy))
    };
    // Of the leader, and of whom that follows, and so on.
    let mut leader = mimic.joint.as_str();
    let mut passed = vec![name.as_str()];
    loop {
        if leader == name {
            let given = match mimic.joint == *name {
                true => "itself".to_string(),
                false => format!("joint {:?}, which follows this one", mimic.joint),
            };
            return wrong(
                given,
                "a joint follows another one, which has a coordinate of its own",
            );
        }
        // Fixed joints among them aren't looked at for themselves.
        if let Some(first) = passed.iter().position(|joint| *joint == leader) {
            return wrong(
                format!("joint {:?}, which leads to a circle", mimic.joint),
                &format!(
                    "the joints {:?} follow each other: take <mimic> away from one of them",
                    &passed[first..]
                ),
            );
        }
        passed.push(leader);
        let Some(of) = file.robot.joints.iter().find(|j| j.name == leader) else {
            return wrong(format!("joint {leader:?}"), "there is no such joint");
        };
        match &of.mimic {
            Some(next) => leader = &next.joint,
            None => break,
        }
    }
    match options.followers {
        Followers::Follow => Ok(()),
        Followers::Independent => {
            report.note(format!(
                "joint {name:?} follows {:?} in the file; here it has a coordinate of its own, as chosen",
                mimic.joint
            ));
            Ok(())
        }
    }
}

fn dynamics(file: &File, number: usize) -> Result<Dynamics> {
    let Some(given) = &file.robot.joints[number].dynamics else {
        return Ok(Dynamics::default());
    };
    for (field, value) in [("damping", given.damping), ("friction", given.friction)] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(Error::input(
                format!("{}: {field}", joint_place(file, number)),
                value,
                "give zero or more; a negative one would drive the joint on",
            ));
        }
    }
    let joint = &file.robot.joints[number].name;
    let extra = file.extras.get(joint).copied().unwrap_or_default();
    Ok(Dynamics {
        damping: given.damping,
        friction: given.friction,
        stiffness: extra.stiffness,
        rest: extra.rest,
        armature: extra.armature,
    })
}

fn limits(file: &File, number: usize, report: &mut Report) -> Result<Option<[f64; 2]>> {
    let given = &file.robot.joints[number];
    let (lower, upper) = (given.limit.lower, given.limit.upper);
    let text = &file.joints[number];
    if !text.has_range {
        let why = match text.has_limit {
            true => "its <limit> gives no range",
            false => "it has no <limit>",
        };
        report.note(format!(
            "joint {:?} turns or slides without limits: {why}",
            given.name
        ));
        return Ok(None);
    }
    if lower > upper || lower.is_nan() || upper.is_nan() {
        return Err(Error::input(
            format!("{}: limit", joint_place(file, number)),
            format!("lower {lower}, upper {upper}"),
            "the upper limit must be above the lower one",
        ));
    }
    if lower == upper {
        report.note(format!(
            "joint {:?} has the range {lower} to {upper}, which is none: it is read without limits; lock the body if it shall not move",
            given.name
        ));
        return Ok(None);
    }
    if lower.is_finite() && upper.is_finite() {
        return Ok(Some([lower, upper]));
    }
    // Stops are as wide as a part of the range, so that it has two ends.
    let one = match (lower.is_finite(), upper.is_finite()) {
        (true, _) => Some(("lower", lower)),
        (_, true) => Some(("upper", upper)),
        _ => None,
    };
    if let Some((side, value)) = one {
        report.note(format!(
            "joint {:?} has a {side} limit alone, {value}, which isn't kept: here limits have two ends; give the other one too",
            given.name
        ));
    }
    Ok(None)
}

/// Where a joint starts: as chosen, else where its motion does, else at zero, else just inside its limits.
fn start(
    file: &File,
    number: usize,
    axial: bool,
    limits: Option<[f64; 2]>,
    options: &Options,
    report: &mut Report,
) -> Result<Option<f64>> {
    let name = &file.robot.joints[number].name;
    if let Some(&q) = options.start.get(name) {
        let place = format!("{}: start", joint_place(file, number));
        if !axial {
            let remedy = "only joints with one coordinate can be given a start here";
            return Err(Error::input(place, q, remedy));
        }
        let [lower, upper] = limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        if !(q.is_finite() && (lower..=upper).contains(&q)) {
            let remedy = format!("must be a number within its limits, from {lower} to {upper}");
            return Err(Error::input(place, q, remedy));
        }
        return Ok(Some(q));
    }
    // What is driven has no limits.
    if let Some([q]) = options.driven.get(name).map(Vec::as_slice) {
        return Ok(Some(*q));
    }
    let own = file.extras.get(name).map_or(0.0, |extra| extra.start);
    let Some([lower, upper]) = limits.filter(|[lower, upper]| !(*lower..=*upper).contains(&own))
    else {
        return Ok((own != 0.0).then_some(own));
    };
    let room = INSIDE * (upper - lower);
    let q = if lower > own {
        lower + room
    } else {
        upper - room
    };
    report.note(format!(
        "joint {name:?} starts at {q:.6}, since {own} is outside its limits, {lower} to {upper}"
    ));
    Ok(Some(q))
}
