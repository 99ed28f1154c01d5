//! What is chosen about a robot's links and joints: that it is of something that is there, and has an effect.

use super::file::File;
use super::inertia::Inertial;
use super::options::{Followers, Options};
use super::tree::{Group, joint_place, link_place};
use crate::{Error, Result};
use urdf_rs::JointType;

/// Choices by name must be of links and joints that are there.
pub(super) fn check_names(file: &File, options: &Options) -> Result<()> {
    let links: Vec<&str> = file.robot.links.iter().map(|l| l.name.as_str()).collect();
    let joints: Vec<&str> = file.robot.joints.iter().map(|j| j.name.as_str()).collect();
    let moving = (file.robot.joints.iter()).filter(|j| j.joint_type != JointType::Fixed);
    let moving: Vec<&str> = moving.map(|j| j.name.as_str()).collect();
    let all = [
        ("links", &links, options.links.keys().collect::<Vec<_>>()),
        ("joints", &moving, options.joints.keys().collect()),
        ("start", &joints, options.start.keys().collect()),
        ("motions", &moving, options.driven.keys().collect()),
        ("zeros", &moving, options.zeroed.keys().collect()),
    ];
    for (key, known, given) in all {
        if let Some(bad) = given.iter().find(|name| !known.contains(&name.as_str())) {
            return Err(Error::input(
                format!("{}: {key}", file.path.display()),
                format!("{bad:?}"),
                format!("the file has no such name there; it has {known:?}"),
            ));
        }
    }
    Ok(())
}

/// What is chosen must have an effect: starts of joints that have a coordinate of their own, and of bodies what is a body.
pub(super) fn check_choices(file: &File, groups: &[Group], options: &Options) -> Result<()> {
    for (number, joint) in file.robot.joints.iter().enumerate() {
        let follows = (joint.mimic.as_ref()).filter(|_| options.followers == Followers::Follow);
        check_joint(file, number, follows, options)?;
        let Some(start) = options.start.get(&joint.name) else {
            continue;
        };
        let remedy = match follows {
            _ if joint.joint_type == JointType::Fixed => {
                "the joint is fixed, and has no coordinate: leave its start out".to_string()
            }
            Some(mimic) => format!(
                "the joint follows {:?}: give the start of that one, or make it `mimic = \"independent\"`",
                mimic.joint
            ),
            None if options.driven.contains_key(&joint.name) => {
                "the joint is driven, and starts where its motion does: leave its start or its motion out".into()
            }
            None => continue,
        };
        let place = format!("{}: start", joint_place(file, number));
        return Err(Error::input(place, start, remedy));
    }
    let choice = |link: usize| options.links.get(&file.robot.links[link].name);
    for group in groups {
        let body = &file.robot.links[group.top()].name;
        let is_dense = choice(group.top()).is_some_and(|c| c.density.is_some());
        for (k, part) in group.parts.iter().enumerate() {
            let Some(choice) = choice(part.link) else {
                continue;
            };
            let wrong = |key: &str, remedy: String| {
                let place = format!("{}: {key}, as chosen", link_place(file, part.link));
                Err(Error::input(place, "of no effect", remedy))
            };
            if let Some(key) = choice.of_body.first().filter(|_| k > 0) {
                let remedy = format!(
                    "the link is part of body {body:?}: choose it for that one, or make the link a body of its own by `keep = true`"
                );
                return wrong(key, remedy);
            }
            if choice.mass.is_some() && is_dense {
                let remedy = format!(
                    "the mass of body {body:?} follows from the `density` chosen for it: leave one of the two out"
                );
                return wrong("mass", remedy);
            }
        }
    }
    Ok(())
}

/// What is chosen for a joint is of a coordinate that nothing else gives.
fn check_joint(
    file: &File,
    number: usize,
    follows: Option<&urdf_rs::Mimic>,
    options: &Options,
) -> Result<()> {
    let joint = &file.robot.joints[number];
    let choice = options.joints.get(&joint.name);
    let Some(key) = choice.and_then(|choice| choice.given.first()) else {
        return Ok(());
    };
    let one = matches!(
        joint.joint_type,
        JointType::Revolute | JointType::Continuous | JointType::Prismatic
    );
    let remedy = match follows {
        _ if !one => {
            "only joints with one coordinate (revolute, continuous, prismatic) have it".to_string()
        }
        Some(mimic) => format!(
            "the joint follows {:?}: choose it for that one, or make it `mimic = \"independent\"`",
            mimic.joint
        ),
        None if options.driven.contains_key(&joint.name) => {
            "the joint is driven, and its force a result: leave it or the motion out".into()
        }
        None => return Ok(()),
    };
    let place = format!("{}: {key}, as chosen", joint_place(file, number));
    Err(Error::input(place, "of no effect", remedy))
}

/// A link's own inertia with the mass that is chosen for it: the inertia grows with it.
pub(super) fn chosen_mass(
    file: &File,
    link: usize,
    inertial: Inertial,
    options: &Options,
) -> Result<Inertial> {
    let name = &file.robot.links[link].name;
    let Some(mass) = options.links.get(name).and_then(|choice| choice.mass) else {
        return Ok(inertial);
    };
    if !(mass >= 0.0 && mass.is_finite()) {
        let place = format!("{}: mass, as chosen", link_place(file, link));
        return Err(Error::input(place, mass, "give zero or more, in kg"));
    }
    let factor = match inertial.mass > 0.0 {
        true => mass / inertial.mass,
        false => 1.0,
    };
    Ok(Inertial {
        mass,
        inertia: inertial.inertia * factor,
        ..inertial
    })
}
