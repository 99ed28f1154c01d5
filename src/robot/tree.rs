//! The tree of links, and what moves together: links at fixed joints fold into what carries them.

use super::file::File;
use super::options::{Base, Options};
use crate::{Error, Result};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::collections::HashMap;
use urdf_rs::{JointType, Pose};

/// A link within a body.
pub(super) struct Part {
    /// Number of the link in the file.
    pub link: usize,
    /// Its frame in the body's.
    pub at: Isometry3<f64>,
}

/// Links that move together; the first one's frame is the body's.
pub(super) struct Group {
    pub parts: Vec<Part>,
    /// The joint that carries it, by its number in the file; none of the root.
    pub joint: Option<usize>,
    /// The group that carries it.
    pub parent: Option<usize>,
    /// The joint's frame in the parent's.
    pub placement: Isometry3<f64>,
}

impl Group {
    /// The link whose frame and name it has.
    pub fn top(&self) -> usize {
        self.parts[0].link
    }
}

/// A pose as the file gives it: rotations about the fixed axes x, y, z in turn.
pub(super) fn placed(pose: &Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = *pose.rpy;
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Isometry3::from_parts(Translation3::from(*pose.xyz), turn)
}

/// The pose that [`placed`] makes this of.
pub(super) fn unplaced(at: &Isometry3<f64>) -> Pose {
    let r = at.rotation.to_rotation_matrix();
    // Where the pitch is a right angle, roll and yaw turn about one axis: yaw makes up for what roll took.
    let roll = r[(2, 1)].atan2(r[(2, 2)]);
    let (sine, cosine) = roll.sin_cos();
    let yaw = (sine * r[(0, 2)] - cosine * r[(0, 1)]).atan2(cosine * r[(1, 1)] - sine * r[(1, 2)]);
    let pitch = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
    Pose {
        xyz: urdf_rs::Vec3(at.translation.vector.into()),
        rpy: urdf_rs::Vec3([roll, pitch, yaw]),
    }
}

/// The message's beginning for a joint.
pub(super) fn joint_place(file: &File, joint: usize) -> String {
    let name = &file.robot.joints[joint].name;
    let line = file.joints[joint].line;
    let line = line.map_or(String::new(), |line| format!(", line {line}"));
    format!("{}{line}: joint {name:?}", file.path.display())
}

/// The message's beginning for a link.
pub(super) fn link_place(file: &File, link: usize) -> String {
    let name = &file.robot.links[link].name;
    format!("{}: link {name:?}", file.path.display())
}

/// A group, and a place there.
type Within = (usize, Isometry3<f64>);

/// The bodies of a file, parents before children, in the file's order where it leaves a choice.
pub(super) fn groups(file: &File, options: &Options) -> Result<Vec<Group>> {
    let robot = &file.robot;
    let carried = carried(file)?;
    let root = root(file, &carried)?;
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); robot.links.len()];
    for (link, by) in carried.iter().enumerate() {
        if let Some((_, parent)) = by {
            children[*parent].push(link);
        }
    }
    // In the order of the joints, whatever that of the links.
    for of in &mut children {
        of.sort_by_key(|link| carried[*link].map(|(joint, _)| joint));
    }
    let still = stands_still(file, options, root, &children, &carried);
    let mut groups: Vec<Group> = Vec::new();
    let mut seen = 0;
    // Link, the group that its parent is in, and that parent's place there.
    let mut open: Vec<(usize, Option<Within>)> = vec![(root, None)];
    while let Some((link, above)) = open.pop() {
        seen += 1;
        let joint = carried[link].map(|(joint, _)| joint);
        let origin = joint.map_or(Isometry3::identity(), |j| placed(&robot.joints[j].origin));
        let at = match above {
            Some((_, place)) => place * origin,
            None => origin,
        };
        let kept = options.links.get(&robot.links[link].name);
        // What stands in the world is no one thing with what else does.
        let alone = still && above.is_some_and(|(group, _)| group == 0) && has_geometry(file, link);
        let folds = joint.is_some_and(|j| robot.joints[j].joint_type == JointType::Fixed)
            && !alone
            && !kept.is_some_and(|choice| choice.keep);
        let (group, at) = match above {
            Some((group, _)) if folds => {
                groups[group].parts.push(Part { link, at });
                (group, at)
            }
            _ => {
                groups.push(Group {
                    parts: vec![Part {
                        link,
                        at: Isometry3::identity(),
                    }],
                    joint,
                    parent: above.map(|(group, _)| group),
                    placement: at,
                });
                (groups.len() - 1, Isometry3::identity())
            }
        };
        let below = children[link].iter().rev();
        open.extend(below.map(|child| (*child, Some((group, at)))));
    }
    if seen < robot.links.len() {
        return Err(looped(file, &carried));
    }
    Ok(groups)
}

fn has_geometry(file: &File, link: usize) -> bool {
    let link = &file.robot.links[link];
    !(link.collision.is_empty() && link.visual.is_empty())
}

/// Whether the root is but a place in the world: without mass and geometry of its own, and fixed, by choice, by its name or as nothing that is fixed to it has a mass.
fn stands_still(
    file: &File,
    options: &Options,
    root: usize,
    children: &[Vec<usize>],
    carried: &[Option<(usize, usize)>],
) -> bool {
    let robot = &file.robot;
    let massless = |link: usize| {
        let given = &robot.links[link].inertial;
        let i = &given.inertia;
        [given.mass.value, i.ixx, i.iyy, i.izz] == [0.0; 4]
    };
    if !massless(root) || has_geometry(file, root) {
        return false;
    }
    if let Some(base) = options.base {
        return base == Base::Fixed;
    }
    if robot.links[root].name == "world" {
        return true;
    }
    let is_fixed = |link: &usize| {
        carried[*link].is_some_and(|(joint, _)| robot.joints[joint].joint_type == JointType::Fixed)
    };
    let mut open = vec![root];
    while let Some(link) = open.pop() {
        if !massless(link) {
            return false;
        }
        open.extend(children[link].iter().copied().filter(is_fixed));
    }
    true
}

/// The joint and link that carry each link.
fn carried(file: &File) -> Result<Vec<Option<(usize, usize)>>> {
    let robot = &file.robot;
    let mut numbers: HashMap<&str, usize> = HashMap::new();
    for (link, of) in robot.links.iter().enumerate() {
        if numbers.insert(&of.name, link).is_some() {
            let place = link_place(file, link);
            return Err(Error::input(
                place,
                "two links of this name",
                "give each link a name of its own",
            ));
        }
    }
    let mut names: HashMap<&str, usize> = HashMap::new();
    let mut carried: Vec<Option<(usize, usize)>> = vec![None; robot.links.len()];
    for (joint, of) in robot.joints.iter().enumerate() {
        let wrong = |given: String, remedy: String| {
            Err(Error::input(joint_place(file, joint), given, remedy))
        };
        if names.insert(&of.name, joint).is_some() {
            return wrong(
                "two joints of this name".into(),
                "give each joint a name of its own".into(),
            );
        }
        let find = |what: &str, name: &str| {
            numbers.get(name).copied().ok_or_else(|| {
                let known = robot.links.iter().map(|l| l.name.as_str());
                let near = known
                    .map(|k| (strsim::jaro_winkler(name, k), k))
                    .filter(|(likeness, _)| *likeness > 0.75)
                    .max_by(|a, b| a.0.total_cmp(&b.0));
                let hint = near.map_or(String::new(), |(_, k)| format!("; did you mean {k:?}?"));
                Error::input(
                    joint_place(file, joint),
                    format!("{what} {name:?}"),
                    format!("there is no such link{hint}"),
                )
            })
        };
        let parent = find("parent", &of.parent.link)?;
        let child = find("child", &of.child.link)?;
        if parent == child {
            return wrong(
                format!("{:?} as parent and child", of.parent.link),
                "a joint lies between two links".into(),
            );
        }
        if let Some((other, _)) = carried[child] {
            return wrong(
                format!("child {:?}", of.child.link),
                format!(
                    "it hangs on joint {:?} already, and URDF has no loops: leave one of the two joints out, and close the loop by a spring",
                    robot.joints[other].name
                ),
            );
        }
        carried[child] = Some((joint, parent));
    }
    Ok(carried)
}

/// The one link that no joint carries.
fn root(file: &File, carried: &[Option<(usize, usize)>]) -> Result<usize> {
    let roots: Vec<usize> = (0..carried.len())
        .filter(|l| carried[*l].is_none())
        .collect();
    match roots[..] {
        [root] => Ok(root),
        [] => Err(looped(file, carried)),
        [_, second, ..] => {
            let names: Vec<&str> =
                (roots.iter().map(|r| file.robot.links[*r].name.as_str())).collect();
            Err(Error::input(
                link_place(file, second),
                format!(
                    "no joint that it is the child of, as {} links: {names:?}",
                    roots.len()
                ),
                "a robot is one tree: join all but one of them to the rest by a joint, or give each tree a file of its own",
            ))
        }
    }
}

/// That some links carry each other in a circle.
fn looped(file: &File, carried: &[Option<(usize, usize)>]) -> Error {
    // From a link that leads to no root, as many steps up as there are links end within the circle.
    let up = |link: usize| carried[link].map(|(_, parent)| parent);
    let endless = |link: &usize| {
        let mut at = Some(*link);
        for _ in 0..carried.len() {
            at = at.and_then(up);
        }
        at
    };
    let within = (0..carried.len())
        .find_map(|link| endless(&link))
        .unwrap_or(0);
    let mut names = vec![file.robot.links[within].name.as_str()];
    let mut at = up(within);
    while let Some(link) = at.filter(|link| *link != within) {
        names.push(&file.robot.links[link].name);
        at = up(link);
    }
    names.reverse();
    Error::input(
        link_place(file, within),
        format!("a loop of the links {names:?}"),
        "a robot is a tree with one root: leave one of their joints out, and close the loop by a spring",
    )
}
