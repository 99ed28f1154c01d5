//! Robots of a scene: what is written of them, and the bodies and sites that they become.

mod joint;
mod link;

use super::{
    Body, BodyId, CollisionPiece, Drag, Fluid, Mimic, Motion, Passive, Placement, Scene, Servo,
    Site, Thruster, is_default,
};
use crate::multibody::Joint;
pub use crate::robot::{
    BadMeshes, Base, BodyReport, FoldedReport, Followers, MeshUse, Report as RobotReport, Unused,
    Wet,
};
use crate::robot::{Imported, Led, LinkChoice, Options, RobotBody, import};
use crate::{Error, Result};
pub use joint::RobotJoint;
pub use link::RobotLink;
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A robot in a URDF or MJCF file: `[[robot]]` of a scene file, which reading it turns into bodies and sites.
///
/// Links at fixed joints fold into what carries them and are sites of their names; other links are bodies of their names, as are those with geometry that are fixed to a
/// root which is but a place in the world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Robot {
    /// The file; relative to the scene file. [`Scene::from_urdf`] and [`Scene::add_robot`] are given it beside.
    pub urdf: PathBuf,
    /// Whether it floats; default: it does, unless its root is called `world` or has no mass.
    pub base: Option<Base>,
    /// Where its root is, m, in the world; a floating one starts there.
    #[serde(skip_serializing_if = "is_default")]
    pub position: [f64; 3],
    /// Rotation vector of its root (axis times angle), rad.
    #[serde(skip_serializing_if = "is_default")]
    pub rotation: [f64; 3],
    /// Begins the names of its bodies and sites, so that several of a kind fit in one scene.
    #[serde(skip_serializing_if = "is_default")]
    pub prefix: String,
    /// Folders that hold packages of meshes, before those of `ROS_PACKAGE_PATH`, the file's own and all above it.
    #[serde(skip_serializing_if = "is_default")]
    pub package_path: Vec<PathBuf>,
    /// What the water sees of links, unless `links` says otherwise.
    #[serde(skip_serializing_if = "is_default")]
    pub shape: Wet,
    /// What is done about meshes that aren't closed surfaces.
    #[serde(skip_serializing_if = "is_default")]
    pub bad_meshes: BadMeshes,
    /// Faces of hulls, and of meshes that have more than twice as many; default 320. Of shapes by formula too, whose default is their own.
    pub faces: Option<usize>,
    /// What is done about joints that follow others.
    #[serde(skip_serializing_if = "is_default")]
    pub mimic: Followers,
    /// Whether its joints are controls: all that have one coordinate. Default: they are, in a file that has actuators those that have one.
    pub actuated: Option<bool>,
    /// Drive of all its joints that are controls, which are then their targets; default: as the file has it.
    #[serde(skip_serializing_if = "is_default")]
    pub servo: Option<Servo>,
    /// Whether joints stop at their limits. Default: they do.
    pub limits: Option<bool>,
    /// Drag on the surfaces of all its wet bodies.
    pub drag: Option<Drag>,
    /// Coordinates at which joints start, m or rad, by the joints' names; default: zero, or just inside the limits.
    #[serde(skip_serializing_if = "is_default")]
    pub start: BTreeMap<String, f64>,
    /// Joints whose zero isn't sure, and where it starts, m or rad. Each gets a massless body more, `JOINT zero`, on a locked joint of the same kind before it, whose coordinate
    /// is the offset: it can be set at the start, differentiated by, and identified ([`Unknown::sets_start`](crate::optimize::Unknown::sets_start)).
    #[serde(skip_serializing_if = "is_default")]
    pub zeros: BTreeMap<String, f64>,
    /// Motions that drive joints, one per coordinate, by the joints' names; they are then no controls.
    #[serde(skip_serializing_if = "is_default")]
    pub motions: BTreeMap<String, Vec<Motion>>,
    /// What is chosen for single joints, by their names in the file.
    #[serde(skip_serializing_if = "is_default")]
    pub joints: BTreeMap<String, RobotJoint>,
    /// What is chosen for single links, by their names in the file.
    #[serde(skip_serializing_if = "is_default")]
    pub links: BTreeMap<String, RobotLink>,
}

/// A robot that was added to a scene.
#[derive(Clone, Debug)]
pub struct Added {
    /// Its bodies, parents before children.
    pub bodies: Vec<BodyId>,
    /// The joints of the file that move, each with the body that it moves.
    pub joints: Vec<(String, BodyId)>,
    /// Names of its thrusters, forces of the scene: actuators of sites in MJCF files.
    pub thrusters: Vec<String>,
    /// What it came to.
    pub report: RobotReport,
}

setters! { Robot {
    /// Whether it floats.
    base(base: Base) => base = Some(base);
    /// Where its root is, m.
    at(position: [f64; 3]) => position = position;
    /// Rotation vector of its root, rad.
    rotated(rotation: [f64; 3]) => rotation = rotation;
    /// Begins the names of its bodies and sites.
    prefix(prefix: impl Into<String>) => prefix = prefix.into();
    /// Folders that hold packages of meshes.
    package_path(folders: impl Into<Vec<PathBuf>>) => package_path = folders.into();
    /// What the water sees of links.
    shape(wet: Wet) => shape = wet;
    /// What is done about joints that follow others.
    mimic(mimic: Followers) => mimic = mimic;
    /// Drag on the surfaces of all its wet bodies.
    drag(drag: Drag) => drag = Some(drag);
    /// Drive of all its joints that are controls.
    servo(servo: Servo) => servo = Some(servo);
} }

impl Robot {
    /// With other choices for a link, by its name in the file.
    pub fn link(mut self, name: impl Into<String>, link: RobotLink) -> Self {
        self.links.insert(name.into(), link);
        self
    }

    /// With other choices for a joint, by its name in the file.
    pub fn joint(mut self, name: impl Into<String>, joint: RobotJoint) -> Self {
        self.joints.insert(name.into(), joint);
        self
    }

    /// Drives a joint, by its name in the file.
    pub fn driven(mut self, joint: impl Into<String>, motion: impl Into<Vec<Motion>>) -> Self {
        self.motions.insert(joint.into(), motion.into());
        self
    }

    fn options(&self) -> Options {
        let link = |link: &RobotLink| LinkChoice {
            shape: link.shape,
            mass: link.mass,
            density: link.density,
            keep: link.keep,
            center_of_mass: link.center_of_mass,
            volume: link.volume,
            center_of_buoyancy: link.center_of_buoyancy,
            of_body: link.of_body(),
        };
        Options {
            base: self.base,
            package_path: self.package_path.clone(),
            shape: self.shape,
            bad_meshes: self.bad_meshes,
            faces: self.faces,
            followers: self.mimic,
            without_limits: self.limits == Some(false),
            start: self.start.clone(),
            driven: (self.motions.iter())
                .map(|(joint, motion)| (joint.clone(), begins(motion)))
                .collect(),
            zeroed: self.zeros.clone(),
            joints: (self.joints.iter())
                .map(|(name, of)| (name.clone(), of.choice()))
                .collect(),
            links: (self.links.iter())
                .map(|(name, of)| (name.clone(), link(of)))
                .collect(),
        }
    }

    fn import(&self, path: &Path) -> Result<Imported> {
        let place = |field: &str| format!("{}: {field}", path.display());
        super::validate::finite(&place("position"), &self.position)?;
        super::validate::rotation(&place("rotation"), &self.rotation)?;
        if let Some(faces) = self.faces.filter(|faces| !(20..=20_000).contains(faces)) {
            return Err(Error::input(
                format!("{}: faces", path.display()),
                faces,
                "ask for 20 to 20000 faces of a hull (default 320)",
            ));
        }
        import(path, &self.options())
    }

    /// What a robot would come to in such water: [`Scene::add_robot`] without the scene.
    ///
    /// # Errors
    /// As there.
    pub fn inspect(&self, path: impl AsRef<Path>, fluid: &Fluid) -> Result<RobotReport> {
        let mut report = self.import(path.as_ref())?.report;
        report.weigh(fluid.density, STANDARD_GRAVITY);
        Ok(report)
    }
}

/// Where motions begin; what isn't finite is refused by whoever checks them.
fn begins(motion: &[Motion]) -> Vec<f64> {
    let values = motion.iter().map(|one| one.value(0.0));
    values
        .map(|q| if q.is_finite() { q } else { 0.0 })
        .collect()
}

/// m/s².
const STANDARD_GRAVITY: f64 = 9.81;

fn placement(at: &Isometry3<f64>) -> Placement {
    Placement::new(
        at.translation.vector.into(),
        at.rotation.scaled_axis().into(),
    )
}

/// What the file says of a joint's own resistance.
fn passive(dynamics: &crate::robot::Dynamics) -> Option<Passive> {
    let made = Passive::default().damping(dynamics.damping);
    let made = made.friction(dynamics.friction).armature(dynamics.armature);
    let made = match dynamics.stiffness > 0.0 {
        true => made.stiffness(dynamics.stiffness).rest(dynamics.rest),
        false => made,
    };
    (made != Passive::default()).then_some(made)
}

impl Scene {
    /// A scene of one robot in still fresh water, gravity along −z.
    ///
    /// # Errors
    /// As [`Scene::add_robot`].
    pub fn from_urdf(path: impl AsRef<Path>, options: &Robot) -> Result<Self> {
        let mut scene = Self::new(Fluid::fresh_water());
        scene.gravity = [0.0, 0.0, -STANDARD_GRAVITY];
        let added = scene.add_robot(path, options)?;
        scene.name = added.report.robot;
        Ok(scene)
    }

    /// Adds the robot of a URDF or MJCF file: a body for each link that moves, a site for each that doesn't.
    ///
    /// # Errors
    /// [`Error::File`] and [`Error::Parse`] of a file that can't be read, and otherwise [`Error::Input`], with the link or joint: a tree that has loops or several roots, a
    /// negative mass, an inertia that can't be, links that move without inertia, negative damping, joints that follow themselves, limits that can't be, meshes that aren't
    /// there, choices for links and joints that aren't there or that would have no effect, and names that the scene has already.
    pub fn add_robot(&mut self, path: impl AsRef<Path>, options: &Robot) -> Result<Added> {
        let path = path.as_ref();
        let Imported {
            base,
            bodies,
            folded,
            thrusters,
            mut report,
        } = options.import(path)?;
        let called = |name: &str| format!("{}{name}", options.prefix);
        self.check_new(path, bodies.iter().map(|b| called(&b.name)))?;
        self.check_new(path, folded.iter().map(|f| called(&f.name)))?;
        let thrusters: Vec<Thruster> = (thrusters.iter())
            .map(|t| {
                let made = Thruster::new(called(&bodies[t.body].name)).named(called(&t.name));
                let made = made.at(t.at).direction(t.direction);
                made.polynomial([t.push]).torque(t.torque)
            })
            .collect();
        self.check_new_forces(path, &thrusters)?;
        let (mut joints, mut all) = (Vec::new(), Vec::new());
        for body in &bodies {
            let mut made = options.body(body, base);
            made.parent = body.parent.map(|p| called(&bodies[p].name));
            options.check_driven(path, body)?;
            if let Some(zero) = options.zero(path, body, &made)? {
                made.parent = Some(zero.name.clone());
                made.placement = Placement::default();
                all.push(zero);
            }
            if let Some(moves) = body.moves.as_ref().filter(|m| m.joint.velocities() > 0) {
                let of = |led: &Led| {
                    let leads = |b: &RobotBody| {
                        let moves = b.moves.as_ref();
                        moves.is_some_and(|m| m.name == led.joint)
                    };
                    let leader = bodies.iter().find(|b| leads(b))?;
                    let mimic = Mimic::new(called(&leader.name));
                    Some(mimic.ratio(led.ratio).offset(led.offset))
                };
                made.mimic = moves.mimic.as_ref().and_then(of);
                if made.mimic.is_none() {
                    let number = self.bodies.len() + all.len();
                    joints.push((moves.name.clone(), BodyId(number)));
                }
            }
            all.push(made);
        }
        // All of it, or, where something is refused, nothing.
        let added = all.into_iter().map(|body| self.add(body)).collect();
        for link in &folded {
            self.add_site(Site {
                name: called(&link.name),
                body: called(&bodies[link.body].name),
                placement: placement(&link.at),
            });
        }
        let names = thrusters.iter().filter_map(|t| t.name.clone()).collect();
        for thruster in thrusters {
            self.add_force(thruster.into());
        }
        let gravity = nalgebra::Vector3::from(self.gravity).norm();
        let gravity = if gravity > 0.0 {
            gravity
        } else {
            STANDARD_GRAVITY
        };
        report.weigh(self.fluid.density, gravity);
        self.imports.add(report.clone());
        Ok(Added {
            bodies: added,
            joints,
            thrusters: names,
            report,
        })
    }

    /// Refuses names that bodies or sites have already.
    fn check_new(&self, path: &Path, names: impl Iterator<Item = String>) -> Result<()> {
        for name in names {
            if self.body(&name).is_some() || self.sites.iter().any(|s| s.name == name) {
                return Err(Error::input(
                    format!("{}: link", path.display()),
                    format!("{name:?}"),
                    "the scene has a body or site of this name: give the robot a `prefix`",
                ));
            }
        }
        Ok(())
    }

    fn check_new_forces(&self, path: &Path, thrusters: &[Thruster]) -> Result<()> {
        let names: Vec<String> = (0..self.forces.len()).map(|i| self.force_name(i)).collect();
        let taken = |t: &&Thruster| t.name.as_ref().is_some_and(|name| names.contains(name));
        match thrusters.iter().find(taken) {
            None => Ok(()),
            Some(t) => Err(Error::input(
                format!("{}: actuator", path.display()),
                format!("{:?}", t.name.as_deref().unwrap_or_default()),
                "the scene has a force of this name: give the robot a `prefix`",
            )),
        }
    }

    /// Turns the robots that a file asks for into bodies; `folder` is that of the file.
    pub(super) fn expand_robots(&mut self, folder: &Path) -> Result<()> {
        for (i, mut robot) in std::mem::take(&mut self.robots).into_iter().enumerate() {
            if robot.urdf.as_os_str().is_empty() {
                return Err(Error::input(
                    format!("robot[{i}]: urdf"),
                    "nothing",
                    "give the path of a URDF file",
                ));
            }
            for path in &mut robot.package_path {
                *path = folder.join(&*path);
            }
            self.add_robot(folder.join(&robot.urdf), &robot)?;
        }
        Ok(())
    }
}

impl Robot {
    /// Refuses motions of joints that can't have them.
    fn check_driven(&self, path: &Path, body: &RobotBody) -> Result<()> {
        let moves = body.moves.as_ref();
        let driven = moves.filter(|m| self.motions.contains_key(&m.name));
        match driven {
            Some(moves) if moves.mimic.is_some() => Err(Error::input(
                format!("{}: motions", path.display()),
                format!("{:?}", moves.name),
                "the joint follows another: drive that one, or make it `mimic = \"independent\"`",
            )),
            _ => Ok(()),
        }
    }

    /// What carries a body whose joint's zero isn't sure.
    fn zero(&self, path: &Path, body: &RobotBody, made: &Body) -> Result<Option<Body>> {
        let moves = body.moves.as_ref();
        let Some((moves, offset)) = moves.and_then(|m| Some((m, self.zeros.get(&m.name)?))) else {
            return Ok(None);
        };
        let place = || format!("{}: zeros of joint {:?}", path.display(), moves.name);
        if moves.mimic.is_some() || moves.joint.coordinates() != 1 {
            let what = match moves.mimic {
                Some(_) => "the zero of a joint that follows another".to_string(),
                None => format!("the zero of a {} joint", moves.joint.kind()),
            };
            let remedy = "only joints with one coordinate of their own have one";
            return Err(Error::input(place(), what, remedy));
        }
        super::validate::finite(&place(), &[*offset])?;
        let zero = Body::dry().named(format!("{}{} zero", self.prefix, moves.name));
        Ok(Some(Body {
            mass: Some(0.0),
            parent: made.parent.clone(),
            placement: made.placement,
            joint: moves.joint,
            start: vec![*offset],
            locked: true,
            ..zero
        }))
    }

    /// A body of it, but for who carries it.
    fn body(&self, body: &RobotBody, base: Base) -> Body {
        let mut made = Body::dry().named(format!("{}{}", self.prefix, body.name));
        made.placement = placement(&body.placement);
        match &body.moves {
            Some(moves) => {
                made.joint = moves.joint;
                made.limits = moves.limits;
                made.start = moves.start.into_iter().collect();
                if moves.mimic.is_some() {
                    made.start.clear();
                } else if moves.joint.coordinates() == 1 {
                    made.actuated = self.actuated.unwrap_or(moves.actuated);
                    let drive = |[k, c]: [f64; 2]| Servo::new(k, c);
                    let servo = self.servo.or(moves.servo.map(drive));
                    made.passive = passive(&moves.dynamics);
                    let choice = self.joints.get(&moves.name).cloned();
                    choice.unwrap_or_default().apply(&mut made, servo);
                }
            }
            None => {
                made.placement = Placement::new(self.position, self.rotation);
                made.joint = match base {
                    Base::Free => Joint::Free,
                    Base::Fixed => Joint::Fixed,
                };
            }
        }
        if let Some((shape, at)) = &body.shape {
            made.shape = Some(shape.clone());
            made.shape_at = placement(at);
            made.drag = self.drag;
            let pieces = body.pieces.iter();
            made.collision = pieces
                .map(|(shape, at)| CollisionPiece {
                    shape: shape.clone(),
                    at: placement(at),
                })
                .collect();
        }
        let motion = (body.moves.as_ref()).and_then(|moves| self.motions.get(&moves.name));
        if let Some(motion) = motion {
            made.motion = Some(motion.clone());
            (made.actuated, made.servo) = (false, None);
            (made.passive, made.limits) = (None, None);
            made.start.clear();
        }
        made.overlaps_parent = body.overlaps_parent;
        match body.density {
            Some(density) => made.density = Some(density),
            None => {
                made.mass = body.mass;
                made.center_of_mass = Some(body.center);
                made.inertia = Some(body.inertia.to_vec());
            }
        }
        if let Some(link) = self.links.get(&body.name) {
            link.apply(&mut made);
        }
        made
    }
}
