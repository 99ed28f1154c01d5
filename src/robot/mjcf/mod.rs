//! Robots in MJCF files, as what a URDF file would say of them.
//!
//! The tree of bodies becomes links and joints under a massless link `world`; a body with several joints a chain of massless links, and sites links at fixed joints. As a link's frame is
//! its joint's, that of a body whose joint isn't at its origin is at the joint. Files that are included ([`includes`]) and classes of defaults ([`classes`]) are resolved in the text, which is checked there ([`left_out`]); `mjcf-rs` reads what
//! comes of it ([`flat`]), with its angles and frames. Numbers are known to be finite then.

mod actuators;
mod attributes;
mod classes;
mod element;
mod equalities;
mod flat;
mod general;
mod geometry;
mod includes;
mod left_out;
mod masses;
mod thrusters;
mod written;

use super::file::{Extra, File, JointText, LARGEST, guarded};
use super::tree::unplaced;
use crate::{Error, Result};
use geometry::{Geometries, Solid, isometry};
use left_out::LeftOut;
use mjcf_rs::body::{Body, Joint, JointType};
use mjcf_rs::{BodyId, Model, Tristate};
use nalgebra::{Isometry3, Translation3, Vector3};
use roxmltree::Document;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// A file whose outermost element is `mujoco`.
pub(super) fn parse(path: &Path, document: &Document) -> Result<File> {
    let whole = includes::expand(path, document)?;
    let mut left_out = LeftOut::new(path);
    left_out.look(&whole)?;
    let text = written::written(&flat::flat(&whole)?)?;
    // Files of meshes are looked for from the folder of this file, wherever they are named.
    let folder = path.parent().unwrap_or(Path::new(""));
    let model = guarded(path, "an MJCF file", || Model::from_str(&text, folder))?;
    let robot = urdf_rs::Robot {
        name: model.name.clone().unwrap_or_else(|| "robot".into()),
        version: None,
        links: Vec::new(),
        joints: Vec::new(),
        materials: Vec::new(),
    };
    let mut made = Made {
        path,
        model: &model,
        file: File {
            coupled_by: "<equality>",
            ..File::new(path, robot)
        },
        taken: HashSet::new(),
        names: Vec::new(),
        frames: Vec::new(),
        sites: HashMap::new(),
    };
    made.names()?;
    made.world();
    for (id, _) in model.bodies_iter() {
        made.body(id)?;
    }
    made.equalities();
    made.actuators();
    made.total_mass();
    made.check_masses()?;
    made.file.unused.extend(left_out.unused());
    Ok(made.file)
}

struct Made<'m> {
    path: &'m Path,
    model: &'m Model,
    file: File,
    /// Names of links.
    taken: HashSet<String>,
    /// Of each body, its link's.
    names: Vec<String>,
    /// Of each body, its link's name and the body's frame in the link's.
    frames: Vec<(String, Isometry3<f64>)>,
    /// Of each site with a name, its link's.
    sites: HashMap<String, String>,
}

fn link(name: &str) -> urdf_rs::Link {
    urdf_rs::Link {
        name: name.into(),
        inertial: urdf_rs::Inertial::default(),
        visual: Vec::new(),
        collision: Vec::new(),
    }
}

impl Made<'_> {
    fn wrong(&self, of: &str, value: impl std::fmt::Display, remedy: &str) -> Error {
        Error::input(format!("{}: {of}", self.path.display()), value, remedy)
    }

    /// Refuses numbers that nothing here has.
    fn check(&self, of: &str, what: &str, numbers: &[f64]) -> Result<()> {
        match numbers.iter().find(|x| x.is_nan() || x.abs() > LARGEST) {
            Some(bad) => Err(self.wrong(
                &format!("{of}: {what}"),
                bad,
                &format!("give finite numbers of at most {LARGEST:e} in size"),
            )),
            None => Ok(()),
        }
    }

    /// Refuses turns by what is too small to be normalised.
    fn checked(&self, of: &str, pose: &mjcf_rs::Pose) -> Result<Isometry3<f64>> {
        let (p, q) = (pose.translation, pose.rotation);
        self.check(of, "pose", &[p.x, p.y, p.z, q.x, q.y, q.z, q.w])?;
        if q.length() == 0.0 {
            let remedy = "a rotation's quaternion can't be zero";
            return Err(self.wrong(&format!("{of}: pose"), "0 0 0 0", remedy));
        }
        Ok(isometry(pose))
    }

    /// Names the bodies' links before all others: what has no name of its own gets one that is free.
    fn names(&mut self) -> Result<()> {
        let named = |body: &Body, id: BodyId| match id {
            0 => Some("world".to_string()),
            _ => body.name.clone(),
        };
        let given = self.model.bodies.iter().enumerate();
        let given: Vec<_> = given.map(|(id, entry)| named(&entry.body, id)).collect();
        for name in given.iter().flatten() {
            if !self.taken.insert(name.clone()) {
                let what = format!("body {name:?}");
                return Err(self.wrong(&what, "two of this name", "give each body its own"));
            }
        }
        for (id, name) in given.into_iter().enumerate() {
            let name = name.unwrap_or_else(|| self.free(format!("body {id}")));
            self.names.push(name);
        }
        Ok(())
    }

    /// A name that no link has yet: this one, or with a number.
    fn free(&mut self, name: String) -> String {
        let numbered = (2..).map(|k| format!("{name} ({k})"));
        let mut all = std::iter::once(name.clone()).chain(numbered);
        let free = all.find(|name| !self.taken.contains(name)).unwrap_or(name);
        self.taken.insert(free.clone());
        free
    }

    /// A site's name: its own, or where a body or another site has it, that and its body's.
    fn site_name(&mut self, given: Option<&str>, body: &str, number: usize) -> String {
        let own = given.map_or(format!("{body} site {number}"), String::from);
        let others = (1..).map(|k| match k {
            1 => format!("{own} of {body}"),
            k => format!("{own} of {body} ({k})"),
        });
        let mut names = std::iter::once(own.clone()).chain(others);
        let free = names.find(|name| !self.taken.contains(name));
        let free = free.unwrap_or_else(|| own.clone());
        if free != own {
            self.file.notes.push(format!(
                "site {own:?} of body {body:?} is called {free:?}, as another body or site has its name"
            ));
        }
        self.taken.insert(free.clone());
        free
    }

    /// A joint from one link to another.
    fn join(
        &mut self,
        name: String,
        joint_type: urdf_rs::JointType,
        [parent, child]: [&str; 2],
        origin: &Isometry3<f64>,
    ) -> &mut urdf_rs::Joint {
        let named = |name: &str| urdf_rs::LinkName { link: name.into() };
        self.file.robot.joints.push(urdf_rs::Joint {
            name,
            joint_type,
            origin: unplaced(origin),
            parent: named(parent),
            child: named(child),
            axis: urdf_rs::Axis::default(),
            limit: urdf_rs::JointLimit::default(),
            calibration: None,
            dynamics: None,
            mimic: None,
            safety_controller: None,
        });
        // Here a joint without a range is no mistake.
        self.file.joints.push(JointText {
            line: None,
            has_range: true,
            has_limit: true,
        });
        let last = self.file.robot.joints.len() - 1;
        &mut self.file.robot.joints[last]
    }

    fn world(&mut self) {
        let name = self.names[0].clone();
        self.file.robot.links.push(link(&name));
        self.frames.push((name, Isometry3::identity()));
        let world = &self.model.bodies[0].body;
        for (count, what) in [(world.geoms.len(), "geom"), (world.sites.len(), "site")] {
            if count > 0 {
                self.file.notes.push(format!(
                    "{count} <{what}> of the world not read: give the scene walls and fixed bodies"
                ));
            }
        }
    }

    fn body(&mut self, id: BodyId) -> Result<()> {
        let entry = &self.model.bodies[id];
        let body = &entry.body;
        let name = self.names[id].clone();
        let of = format!("body {name:?}");
        let above = entry.parent.filter(|p| *p < self.frames.len()).unwrap_or(0);
        let (mut parent, at_parent) = self.frames[above].clone();
        let mut at = at_parent * self.checked(&of, &body.pose)?;
        if body.gravcomp != 0.0 || body.mocap {
            let what = if body.mocap { "mocap" } else { "gravcomp" };
            self.file.notes.push(format!("{of}: {what} isn't read"));
        }
        // Where the body's frame is in the link of the last joint.
        let mut own = Isometry3::identity();
        let count = body.joints.len();
        for (k, joint) in body.joints.iter().enumerate() {
            let last = k + 1 == count;
            let child = match last {
                true => name.clone(),
                false => self.free(format!("{name} (joint {})", k + 1)),
            };
            let anchor = Isometry3::translation(joint.pos[0], joint.pos[1], joint.pos[2]);
            self.joint(joint, &of, k, [&parent, &child], &(at * anchor))?;
            at = anchor.inverse();
            own = at;
            if !last {
                self.file.robot.links.push(link(&child));
                parent = child;
            }
        }
        if count == 0 {
            let joint = format!("{name} (fixed)");
            self.join(joint, urdf_rs::JointType::Fixed, [&parent, &name], &at);
        } else if own != Isometry3::identity() {
            self.file.notes.push(format!(
                "{of}: its frame is at its joint, {:?} m from where the file has it",
                body.joints[count - 1].pos
            ));
        }
        let mut made = link(&name);
        self.fill(&mut made, body, &of, &own)?;
        self.file.robot.links.push(made);
        for (k, site) in body.sites.iter().enumerate() {
            let site_name = self.site_name(site.name.as_deref(), &name, k + 1);
            let pose = own * self.checked(&format!("site {site_name:?}"), &site.pose)?;
            self.file.robot.links.push(link(&site_name));
            if let Some(own) = &site.name {
                self.sites.insert(own.clone(), site_name.clone());
            }
            let joint = format!("{site_name} (fixed)");
            self.join(joint, urdf_rs::JointType::Fixed, [&name, &site_name], &pose);
        }
        self.frames.push((name, own));
        Ok(())
    }

    fn joint(
        &mut self,
        given: &Joint,
        of: &str,
        number: usize,
        links: [&str; 2],
        origin: &Isometry3<f64>,
    ) -> Result<()> {
        let name =
            (given.name.clone()).unwrap_or_else(|| format!("{} joint {}", links[1], number + 1));
        let place = format!("joint {name:?}");
        for (field, value) in [("stiffness", given.stiffness), ("armature", given.armature)] {
            if value < 0.0 {
                return Err(self.wrong(&format!("{place}: {field}"), value, "give zero or more"));
            }
        }
        let axis = Vector3::from(given.axis);
        let back = match given.type_ {
            JointType::Hinge if axis.norm() > 0.0 => {
                Isometry3::rotation(-given.ref_ * axis.normalize())
            }
            JointType::Slide if axis.norm() > 0.0 => {
                let along = -given.ref_ * axis.normalize();
                Isometry3::from(Translation3::from(along))
            }
            _ => Isometry3::identity(),
        };
        let (kind, one) = match given.type_ {
            JointType::Hinge => (urdf_rs::JointType::Revolute, true),
            JointType::Slide => (urdf_rs::JointType::Prismatic, true),
            JointType::Ball => (urdf_rs::JointType::Spherical, false),
            JointType::Free => (urdf_rs::JointType::Floating, false),
        };
        let rises = given.range.is_some_and(|[lower, upper]| lower < upper);
        self.check_range(given, &place, one, rises)?;
        let limited = (given.limited).resolve(self.model.compiler.autolimits, rises);
        if limited && !one {
            let note = format!("{place}: the range of a ball joint isn't read");
            self.file.notes.push(note);
        }
        if rises && !limited && given.limited == Tristate::Auto {
            let note = format!(
                "{place}: its range isn't used, as autolimits is false and it isn't limited"
            );
            self.file.notes.push(note);
        }
        let range = given.range.filter(|_| limited && one);
        let passive = given.stiffness != 0.0
            || given.damping != 0.0
            || given.frictionloss != 0.0
            || given.armature != 0.0;
        if passive && !one {
            self.file.notes.push(format!(
                "{of}: springs, damping, friction and armature of its ball or free joint aren't read"
            ));
        }
        if given.springdamper.is_some() {
            self.file
                .notes
                .push(format!("{place}: springdamper isn't read"));
        }
        let joint = self.join(name.clone(), kind, links, &(origin * back));
        joint.axis.xyz = urdf_rs::Vec3(given.axis);
        if one {
            joint.dynamics = Some(urdf_rs::Dynamics {
                damping: given.damping,
                friction: given.frictionloss,
            });
        }
        let [lower, upper] = range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        (joint.limit.lower, joint.limit.upper) = (lower, upper);
        if one {
            let extra = Extra {
                stiffness: given.stiffness,
                rest: given.springref,
                armature: given.armature,
                start: given.ref_,
            };
            self.file.extras.insert(name, extra);
        }
        Ok(())
    }

    /// Refuses limits without a range, and tells of a range that is none.
    fn check_range(&mut self, given: &Joint, place: &str, one: bool, rises: bool) -> Result<()> {
        let range = given.range.filter(|range| *range != [0.0; 2]);
        if rises || !one || given.limited == Tristate::False {
            return Ok(());
        }
        let unit = match given.type_ {
            JointType::Slide => "m",
            _ => "rad",
        };
        let told = range.map_or("no range".into(), |[lower, upper]| {
            format!("a range from {lower} to {upper} {unit}")
        });
        if given.limited == Tristate::True {
            let remedy = "limited=\"true\" needs a range whose second number is the larger one";
            return Err(self.wrong(&format!("{place}: range"), told, remedy));
        }
        if range.is_some() {
            let note = format!("{place}: it has no limits, as {told} doesn't rise");
            self.file.notes.push(note);
        }
        Ok(())
    }

    /// A piece as URDF has it: a shape stands under a name in a mesh's place.
    fn geometry(&mut self, solid: &Solid) -> urdf_rs::Geometry {
        let (filename, scale) = match solid {
            Solid::Shape(shape) => {
                let name = format!("{shape:?}");
                self.file.shapes.insert(name.clone(), shape.clone());
                (name, None)
            }
            Solid::Mesh(file, scale) => (file.display().to_string(), Some(urdf_rs::Vec3(*scale))),
        };
        urdf_rs::Geometry::Mesh { filename, scale }
    }

    /// Mass and geometry of a body; `own` is its frame in the link's.
    fn fill(
        &mut self,
        link: &mut urdf_rs::Link,
        body: &Body,
        of: &str,
        own: &Isometry3<f64>,
    ) -> Result<()> {
        let geometries = Geometries::new(self.path, self.model, of);
        let mut solids = Vec::new();
        for geom in &body.geoms {
            let pose = self.checked(&format!("{of}: geom"), &geom.pose)?;
            let Some((solid, at)) = geometries.read(geom, &pose)? else {
                let note = format!("{of}: a geom of the kind {:?} isn't read", geom.type_);
                self.file.notes.push(note);
                continue;
            };
            let (name, origin) = (geom.name.clone(), unplaced(&(own * at)));
            let geometry = self.geometry(&solid);
            match geom.contype != 0 || geom.conaffinity != 0 {
                true => link.collision.push(urdf_rs::Collision {
                    name,
                    origin,
                    geometry,
                }),
                false => link.visual.push(urdf_rs::Visual {
                    name,
                    origin,
                    geometry,
                    material: None,
                }),
            }
            solids.push((geom, (solid, at)));
        }
        let found = self.mass(body, of, &geometries, &solids)?;
        if !found.is_none() {
            let at = own * Isometry3::from(Translation3::from(found.center));
            let [ixx, iyy, izz, ixy, ixz, iyz] = found.six();
            link.inertial = urdf_rs::Inertial {
                origin: unplaced(&at),
                mass: urdf_rs::Mass { value: found.mass },
                inertia: urdf_rs::Inertia {
                    ixx,
                    iyy,
                    izz,
                    ixy,
                    ixz,
                    iyz,
                },
            };
        }
        Ok(())
    }
}
