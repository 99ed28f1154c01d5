//! From a file to bodies.

use super::chosen::{check_choices, check_names, chosen_mass};
use super::file::File;
use super::followers::follow;
use super::inertia::{Inertial, of_group, of_link};
use super::joints::{Moves, moves};
use super::options::{Base, Followers, Options};
use super::overlap::{declare, untangle};
use super::pieces::Meshes;
use super::read::read;
use super::report::{BodyReport, FoldedReport, Report};
use super::surface::{Immersed, Surface, pose};
use super::tree::{Group, groups, link_place};
use crate::geometry::MassProperties;
use crate::multibody::Joint;
use crate::shape::Shape;
use crate::{Error, Result};
use hydrograd_adjoint::lie::{Pose, Vec3};
use nalgebra::Isometry3;
use std::path::Path;

/// A moment of inertia, in that of a point mass at the edge of what the link is, under which it is implausible.
const THIN: f64 = 1e-4;

/// A body of a robot, in the frame of its first link.
#[derive(Clone, Debug)]
pub(crate) struct RobotBody {
    pub name: String,
    /// Number of the body that carries it.
    pub parent: Option<usize>,
    /// The joint's frame in the parent's.
    pub placement: Isometry3<f64>,
    /// None of the root.
    pub moves: Option<Moves>,
    /// kg; none where a density is chosen.
    pub mass: Option<f64>,
    /// kg/m³, where it is chosen.
    pub density: Option<f64>,
    /// m.
    pub center: [f64; 3],
    /// xx, yy, zz, xy, xz, yz, kg m².
    pub inertia: [f64; 6],
    /// The surface and its pose.
    pub shape: Option<(Shape, Isometry3<f64>)>,
    /// Convex pieces for contact.
    pub pieces: Vec<(Shape, Isometry3<f64>)>,
    pub overlaps_parent: bool,
}

/// A link that folded into a body.
#[derive(Clone, Debug)]
pub(crate) struct Folded {
    pub name: String,
    /// Number of the body.
    pub body: usize,
    pub at: Isometry3<f64>,
}

/// What pushes a body.
#[derive(Clone, Debug)]
pub(crate) struct RobotThruster {
    pub name: String,
    /// Number of the body.
    pub body: usize,
    /// m, body's frame.
    pub at: [f64; 3],
    /// Of length one, body's frame.
    pub direction: [f64; 3],
    /// N a unit of its control.
    pub push: f64,
    /// Moment about the direction per newton, m.
    pub torque: f64,
}

/// A robot.
#[derive(Clone, Debug)]
pub(crate) struct Imported {
    pub base: Base,
    /// Parents before children.
    pub bodies: Vec<RobotBody>,
    pub folded: Vec<Folded>,
    pub thrusters: Vec<RobotThruster>,
    pub report: Report,
}

/// Reads a robot.
pub(crate) fn import(path: &Path, options: &Options) -> Result<Imported> {
    let file = read(path)?;
    let mut report = Report {
        robot: file.robot.name.clone(),
        file: path.display().to_string(),
        unused: file.unused.clone(),
        ..Report::default()
    };
    for note in &file.notes {
        report.note(note.clone());
    }
    check_names(&file, options)?;
    let groups = groups(&file, options)?;
    check_choices(&file, &groups, options)?;
    let mut all = Vec::with_capacity(groups.len());
    for group in &groups {
        let motion = match group.joint {
            Some(joint) => Some(moves(&file, joint, options, &mut report)?),
            None => None,
        };
        all.push(motion);
    }
    if options.followers == Followers::Follow {
        let joints: Vec<_> = groups.iter().map(|g| g.joint).collect();
        follow(&file, &joints, options, &mut all, &mut report)?;
    }
    let mut own = Vec::with_capacity(file.robot.links.len());
    let mut tops = vec![0; file.robot.links.len()];
    for group in &groups {
        group.parts.iter().for_each(|p| tops[p.link] = group.top());
    }
    let chosen = |top: usize| options.links.get(&file.robot.links[top].name);
    for (link, top) in tops.into_iter().enumerate() {
        let inertial = of_link(&file, link, chosen(top))?;
        own.push(chosen_mass(&file, link, inertial, options)?);
    }
    let inertials: Vec<Inertial> = (groups.iter())
        .map(|g| of_group(&file, g, &own, chosen(g.top()), &mut report))
        .collect::<Result<_>>()?;
    let base = base(&file, &groups, &inertials, options, &mut report);
    let bodies = Bodies {
        file: &file,
        options,
        groups: &groups,
        moves: &all,
        inertials: &inertials,
        fixed: base == Base::Fixed,
    };
    bodies.check_massless()?;
    let names: Vec<String> = (groups.iter())
        .map(|g| file.robot.links[g.top()].name.clone())
        .collect();
    let parents: Vec<Option<usize>> = groups.iter().map(|g| g.parent).collect();
    let poses = bodies.start();

    let mut meshes = Meshes::new(&file, options);
    let mut wets = Vec::with_capacity(groups.len());
    for (g, group) in groups.iter().enumerate() {
        let wet = Immersed::of_group(&mut meshes, group, &names[g], options, &mut report)?;
        wets.push(bodies.dry_if_massless(g, wet, &mut report));
    }
    untangle(&mut wets, &names, &parents, &poses, &mut report)?;
    for (wet, name) in wets.iter_mut().zip(&names) {
        wet.finish(name, options, &mut report);
    }
    let overlaps = declare(&mut wets, &names, &parents, &poses, &mut report)?;
    bodies.tell_overlaps(&overlaps, &names, &mut report);
    let made = bodies.made(&wets, &overlaps)?;
    bodies.tell(&made, &wets, &poses, base, &mut report)?;
    let folded = (groups.iter().enumerate())
        .flat_map(|(body, group)| group.parts[1..].iter().map(move |part| (body, part)));
    let folded: Vec<Folded> = folded
        .map(|(body, part)| Folded {
            name: file.robot.links[part.link].name.clone(),
            body,
            at: part.at,
        })
        .collect();
    let site = |f: &Folded| FoldedReport {
        link: f.name.clone(),
        body: names[f.body].clone(),
        position: f.at.translation.vector.into(),
        rotation: f.at.rotation.scaled_axis().into(),
    };
    report.sites = folded.iter().map(site).collect();
    Ok(Imported {
        base,
        bodies: made,
        folded,
        thrusters: thrusters(&file, &groups),
        report,
    })
}

fn thrusters(file: &File, groups: &[Group]) -> Vec<RobotThruster> {
    let parts =
        || (groups.iter().enumerate()).flat_map(|(b, g)| g.parts.iter().map(move |p| (b, p)));
    let each = file.thrusters.iter().filter_map(|given| {
        let (body, part) = parts().find(|(_, p)| file.robot.links[p.link].name == given.link)?;
        Some(RobotThruster {
            name: given.name.clone(),
            body,
            at: part.at.translation.vector.into(),
            direction: (part.at.rotation * nalgebra::Vector3::from(given.axis)).into(),
            push: given.push,
            torque: given.torque,
        })
    });
    each.collect()
}

/// Whether the root hangs on the world: as chosen, else if it is called so or has no mass.
fn base(
    file: &File,
    groups: &[Group],
    inertials: &[Inertial],
    options: &Options,
    report: &mut Report,
) -> Base {
    if let Some(chosen) = options.base {
        return chosen;
    }
    let root = &file.robot.links[groups[0].top()].name;
    let why = match (root.as_str(), inertials[0].is_none()) {
        ("world", _) => "its root is called so",
        (_, true) => "its root has no mass",
        _ => return Base::Free,
    };
    let floats = |j: &urdf_rs::Joint| j.joint_type == urdf_rs::JointType::Floating;
    let beside = match file.robot.joints.iter().any(floats) {
        true => ", and what has a free joint floats on it",
        false => "",
    };
    report.note(format!(
        "the base is fixed to the world, since {why}{beside}; `base` (--base) chooses"
    ));
    Base::Fixed
}

/// The bodies of a file, as far as they are known.
pub(super) struct Bodies<'b> {
    pub file: &'b File,
    pub options: &'b Options,
    pub groups: &'b [Group],
    pub moves: &'b [Option<Moves>],
    pub inertials: &'b [Inertial],
    fixed: bool,
}

impl Bodies<'_> {
    pub fn name(&self, g: usize) -> &str {
        &self.file.robot.links[self.groups[g].top()].name
    }

    pub fn joint(&self, g: usize) -> Joint {
        match (&self.moves[g], self.fixed) {
            (Some(moves), _) => moves.joint,
            (None, true) => Joint::Fixed,
            (None, false) => Joint::Free,
        }
    }

    pub fn density(&self, g: usize) -> Option<f64> {
        self.options.links.get(self.name(g))?.density
    }

    pub fn has_inertia_chosen(&self, g: usize) -> bool {
        let choice = self.options.links.get(self.name(g));
        choice.is_some_and(|choice| choice.has("inertia"))
    }

    /// Where all bodies are at the start, in the root's frame.
    fn start(&self) -> Vec<Pose> {
        let mut poses: Vec<Pose> = Vec::with_capacity(self.groups.len());
        for (g, group) in self.groups.iter().enumerate() {
            let Some(parent) = group.parent else {
                poses.push(Pose::identity());
                continue;
            };
            let model = self.joint(g).model();
            let mut q = model.origin();
            if let Some(moves) = &self.moves[g] {
                match (
                    self.options.driven.get(&moves.name),
                    moves.start,
                    &mut q[..],
                ) {
                    (Some(at), _, q) if at.len() == q.len() => q.copy_from_slice(at),
                    (None, Some(at), [q]) => *q = at,
                    _ => {}
                }
                // The joint before it that stands for its zero is of its kind.
                if let ([q], Some(zero)) = (&mut q[..], self.options.zeroed.get(&moves.name)) {
                    *q += zero;
                }
            }
            let placed = poses[parent].compose(&pose(&group.placement));
            poses.push(placed.compose(&model.pose(&q)));
        }
        poses
    }

    fn tell_overlaps(&self, overlaps: &[bool], names: &[String], report: &mut Report) {
        let declared = (0..overlaps.len()).filter(|b| overlaps[*b]);
        let declared: Vec<String> = declared.map(|b| format!("{:?}", names[b])).collect();
        if !declared.is_empty() {
            report.note(format!(
                "these touch or overlap the body that carries them, or nearly so, and don't feel it through the water (`overlaps_parent`): {}",
                declared.join(", ")
            ));
        }
    }

    fn made(&self, wets: &[Immersed], overlaps: &[bool]) -> Result<Vec<RobotBody>> {
        let mut made = Vec::with_capacity(self.groups.len());
        for (g, (group, wet)) in self.groups.iter().zip(wets).enumerate() {
            let density = self.density(g);
            if let Some(density) = density {
                let place = format!("{}: density, as chosen", link_place(self.file, group.top()));
                if wet.surface.is_none() {
                    let remedy = "the link is dry, and has no volume that would make it a mass";
                    return Err(Error::input(place, density, remedy));
                }
                if !(density > 0.0 && density.is_finite()) {
                    return Err(Error::input(
                        place,
                        density,
                        "give a density above zero, kg/m³",
                    ));
                }
            }
            made.push(RobotBody {
                name: self.name(g).to_owned(),
                parent: group.parent,
                placement: group.placement,
                moves: self.moves[g].clone(),
                mass: density.is_none().then_some(self.inertials[g].mass),
                density,
                center: self.inertials[g].center.into(),
                inertia: self.inertials[g].six(),
                shape: wet.surface.as_ref().map(Surface::shape),
                pieces: wet.pieces.iter().map(Surface::shape).collect(),
                overlaps_parent: overlaps[g],
            });
        }
        Ok(made)
    }

    /// Fills the report.
    fn tell(
        &self,
        made: &[RobotBody],
        wets: &[Immersed],
        poses: &[Pose],
        base: Base,
        report: &mut Report,
    ) -> Result<()> {
        report.base = <&str>::from(base).into();
        let (mut mass, mut volume) = (0.0, 0.0);
        let (mut of_mass, mut of_volume) = (Vec3::zeros(), Vec3::zeros());
        for (g, (body, wet)) in made.iter().zip(wets).enumerate() {
            let seen = wet.surface.as_ref().map(Surface::properties).transpose()?;
            let (own, center) = match (body.density, &seen) {
                (Some(density), Some(seen)) => (density * seen.volume, seen.centroid),
                _ => (self.inertials[g].mass, self.inertials[g].center),
            };
            let chosen = self.options.links.get(self.name(g));
            let center = self.center_chosen(g).unwrap_or(center);
            mass += own;
            of_mass += own * poses[g].apply(&center);
            let displaced = chosen.and_then(|c| c.volume);
            let displaced = displaced.or(seen.as_ref().map(|s| s.volume));
            let own_volume = displaced.unwrap_or(0.0);
            // As a scene has it.
            let buoyed = chosen.and_then(|c| c.center_of_buoyancy).map(Vec3::from);
            let buoyed = buoyed.or(seen.as_ref().map(|s| s.centroid));
            let buoyed = displaced.map(|_| buoyed.unwrap_or(center));
            volume += own_volume;
            if let Some(buoyed) = &buoyed {
                of_volume += own_volume * poses[g].apply(buoyed);
            }
            if let Some(seen) = &seen {
                report.implausible.extend(self.implausible(g, wet, seen)?);
            }
            let links = self.groups[g].parts.iter();
            report.bodies.push(BodyReport {
                body: body.name.clone(),
                parent: body.parent.map(|p| self.name(p).to_owned()),
                joint: body.moves.as_ref().map(|m| m.name.clone()),
                kind: self.joint(g).kind().into(),
                links: links
                    .map(|part| self.file.robot.links[part.link].name.clone())
                    .collect(),
                mass: own,
                volume: own_volume,
                weight: 0.0,
                buoyancy: 0.0,
                center_of_mass: center.into(),
                center_of_buoyancy: buoyed.map(Into::into),
                shape: wet.said.clone(),
                pieces: wet.pieces.len(),
            });
        }
        if mass > 0.0 {
            report.center_of_mass = (of_mass / mass).into();
        }
        report.center_of_buoyancy = (volume > 0.0).then(|| (of_volume / volume).into());
        Ok(())
    }

    /// The centre of mass that is chosen for it.
    fn center_chosen(&self, g: usize) -> Option<Vec3> {
        let chosen = self.options.links.get(self.name(g))?;
        chosen.center_of_mass.map(Vec3::from)
    }

    /// What of a body's inertia fits nothing of its size.
    fn implausible(
        &self,
        g: usize,
        wet: &Immersed,
        seen: &MassProperties,
    ) -> Result<Option<String>> {
        let mut own = self.inertials[g];
        own.center = self.center_chosen(g).unwrap_or(own.center);
        let chosen = self.density(g).is_some() || self.has_inertia_chosen(g);
        let Some(surface) = (wet.surface.as_ref()).filter(|_| own.mass > 0.0 && !chosen) else {
            return Ok(None);
        };
        let mesh = surface.mesh()?;
        let vertices = mesh.vertices().iter();
        let far = vertices.fold(0.0, |far: f64, x| far.max((x - own.center).norm()));
        let [low, high] = mesh.bounds();
        let outside = (0..3).any(|k| own.center[k] < low[k] || own.center[k] > high[k]);
        let most = own.mass * far * far;
        let [a, b, c] = own.moments();
        let name = self.name(g);
        let said = if c > most {
            Some(format!(
                "its largest moment, {c:.3e} kg m², is more than if all its mass were at its farthest point ({most:.3e})"
            ))
        } else if a.min(b) < THIN * most {
            Some(format!(
                "its smallest moment, {a:.3e} kg m², is next to nothing for its size (at most {most:.3e})"
            ))
        } else if outside {
            Some(format!(
                "its centre of mass {:?} m is outside of its surface's bounds",
                own.center.as_slice()
            ))
        } else {
            None
        };
        let density = own.mass / seen.volume;
        let density = format!("; its mean density is {density:.0} kg/m³");
        Ok(said.map(|said| format!("body {name:?}: {said}{density}")))
    }
}
