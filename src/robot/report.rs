//! What a robot came to: its bodies, how heavy and how buoyant they are, what was replaced, and what of the file was not used.

use serde::Serialize;
use std::fmt;

/// Something of a file that isn't read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Unused {
    /// The element or attribute.
    pub what: String,
    /// How often it stands there.
    pub count: usize,
    /// Where first.
    pub line: u32,
}

/// A body that a robot came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BodyReport {
    /// Its name: that of the link whose frame it has.
    pub body: String,
    /// The body that carries it; none of what hangs on the world.
    pub parent: Option<String>,
    /// The joint between.
    pub joint: Option<String>,
    /// That joint's kind: `revolute`, `free`, ….
    pub kind: String,
    /// All links that it consists of.
    pub links: Vec<String>,
    /// kg.
    pub mass: f64,
    /// Volume of water that it displaces, m³; zero of a dry one.
    pub volume: f64,
    /// N.
    pub weight: f64,
    /// N.
    pub buoyancy: f64,
    /// m, body's frame.
    pub center_of_mass: [f64; 3],
    /// m, body's frame; none of a dry one.
    pub center_of_buoyancy: Option<[f64; 3]>,
    /// What the water sees.
    pub shape: String,
    /// Convex pieces that it is for contact; zero where the shape itself is.
    pub pieces: usize,
}

/// A mesh of the file, and what became of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MeshUse {
    /// The link.
    pub link: String,
    /// The file.
    pub file: String,
    /// Its faces.
    pub faces: usize,
    /// What was made of it.
    pub used_as: String,
}

/// A link that folded into a body, and is a site now.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoldedReport {
    /// The link.
    pub link: String,
    /// The body.
    pub body: String,
    /// Its origin in the body's frame, m.
    pub position: [f64; 3],
    /// Its rotation vector there, rad.
    pub rotation: [f64; 3],
}

/// What a robot came to, SI units.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// Its name in the file.
    pub robot: String,
    /// The file.
    pub file: String,
    /// `free` or `fixed`.
    pub base: String,
    /// Density of the water, kg/m³, and gravity, m/s², of weights and buoyancies.
    pub density: f64,
    /// m/s².
    pub gravity: f64,
    /// Its bodies, parents before children.
    pub bodies: Vec<BodyReport>,
    /// kg.
    pub mass: f64,
    /// m³.
    pub volume: f64,
    /// N.
    pub weight: f64,
    /// N.
    pub buoyancy: f64,
    /// Of all, at the start, m, in the root's frame.
    pub center_of_mass: [f64; 3],
    /// Of all, at the start, m, in the root's frame; none of a dry robot.
    pub center_of_buoyancy: Option<[f64; 3]>,
    /// Links that folded into others.
    pub sites: Vec<FoldedReport>,
    /// Its meshes.
    pub meshes: Vec<MeshUse>,
    /// Inertias that fit no body of the size that the link has.
    pub implausible: Vec<String>,
    /// What was chosen or replaced.
    pub notes: Vec<String>,
    /// What of the file was not used.
    pub unused: Vec<Unused>,
    /// Of the notes, those by which the water sees less of a body than the file has.
    #[serde(skip)]
    pub(crate) warnings: Vec<String>,
}

impl Report {
    /// Adds a note that a run tells as well.
    pub(super) fn warn(&mut self, what: String) {
        if !self.warnings.contains(&what) {
            self.warnings.push(what.clone());
        }
        self.note(what);
    }

    /// Adds what was chosen or replaced.
    pub(super) fn note(&mut self, what: String) {
        if !self.notes.contains(&what) {
            self.notes.push(what);
        }
    }

    /// Weights and buoyancies in such water and gravity (its magnitude).
    pub(crate) fn weigh(&mut self, density: f64, gravity: f64) {
        (self.density, self.gravity) = (density, gravity);
        for body in &mut self.bodies {
            body.weight = body.mass * gravity;
            body.buoyancy = density * body.volume * gravity;
        }
        self.mass = self.bodies.iter().map(|b| b.mass).sum();
        self.volume = self.bodies.iter().map(|b| b.volume).sum();
        self.weight = self.mass * gravity;
        self.buoyancy = density * self.volume * gravity;
    }

    /// A body and those that carry it, up to the root.
    fn above<'r>(&'r self, body: &'r BodyReport) -> impl Iterator<Item = &'r BodyReport> {
        std::iter::successors(Some(body), |b| {
            let name = b.parent.as_ref()?;
            self.bodies.iter().find(|o| o.body == *name)
        })
    }

    /// How deep in the tree a body is.
    fn depth(&self, body: &BodyReport) -> usize {
        self.above(body).count() - 1
    }

    /// By how much what isn't fixed to the world is lighter than its water, N, and whether anything that has weight or buoyancy is fixed to it.
    fn lift(&self) -> (f64, bool) {
        let (fixed, moving): (Vec<_>, Vec<_>) =
            (self.bodies.iter()).partition(|body| self.above(body).all(|b| b.kind == "fixed"));
        let lift = moving.iter().map(|b| b.buoyancy - b.weight).sum();
        (
            lift,
            fixed.iter().any(|b| b.buoyancy > 0.0 || b.weight > 0.0),
        )
    }
}

fn point(x: &[f64; 3]) -> String {
    format!("({:.4}, {:.4}, {:.4})", x[0], x[1], x[2])
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "robot {:?}, {}: {} bodies, base {}, in water of {} kg/m³, gravity {} m/s²",
            self.robot,
            self.file,
            self.bodies.len(),
            self.base,
            self.density,
            self.gravity
        )?;
        for body in &self.bodies {
            let indent = "  ".repeat(1 + self.depth(body));
            let joint = match &body.joint {
                Some(joint) => format!("{} {joint:?}", body.kind),
                None => body.kind.clone(),
            };
            writeln!(
                f,
                "{indent}{} ({joint}): {:.4} kg, weight {:.4} N, buoyancy {:.4} N, centre of mass {} m",
                body.body,
                body.mass,
                body.weight,
                body.buoyancy,
                point(&body.center_of_mass)
            )?;
            let center = match &body.center_of_buoyancy {
                Some(x) => format!("; {:.4e} m³ about {} m", body.volume, point(x)),
                None => String::new(),
            };
            let pieces = match body.pieces {
                0 => String::new(),
                n => format!("; {n} pieces for contact"),
            };
            writeln!(f, "{indent}  {}{center}{pieces}", body.shape)?;
            if body.links.len() > 1 {
                writeln!(f, "{indent}  with {}", body.links[1..].join(", "))?;
            }
        }
        let (lift, fixed) = self.lift();
        let of = match fixed {
            true => "what isn't fixed to the world ",
            false => "",
        };
        write!(
            f,
            "all: {:.5} kg, weight {:.4} N, {:.4e} m³, buoyancy {:.4} N: {of}{} by {:.4} N; centre of mass {} m",
            self.mass,
            self.weight,
            self.volume,
            self.buoyancy,
            if lift < 0.0 { "sinks" } else { "rises" },
            lift.abs(),
            point(&self.center_of_mass)
        )?;
        if let Some(center) = &self.center_of_buoyancy {
            write!(f, ", of buoyancy {} m", point(center))?;
        }
        for mesh in &self.meshes {
            write!(
                f,
                "\nmesh: link {:?}, {} ({} faces): {}",
                mesh.link, mesh.file, mesh.faces, mesh.used_as
            )?;
        }
        for what in &self.implausible {
            write!(f, "\nimplausible: {what}")?;
        }
        for what in &self.notes {
            write!(f, "\nnote: {what}")?;
        }
        for Unused { what, count, line } in &self.unused {
            write!(
                f,
                "\nnot used: {what} ({count} times, first in line {line})"
            )?;
        }
        Ok(())
    }
}
