//! Everything about a scene that can be checked without its meshes.
//!
//! Each error names the body and the field, the value found there and what to write instead. What
//! needs meshes (whether a mesh is closed, whether bodies overlap, whether the whole mass matrix is
//! positive definite) is checked where they are made.

mod body;
mod contact;
mod controller;
mod limits;
mod mimic;
mod motion;
mod passive;
mod servo;
mod start;

use std::collections::HashMap;

use super::file::nearest;
use super::{Body, Scene};
use crate::{Error, Result};

impl Scene {
    /// Checks all that doesn't need the meshes: numbers, names, the tree of bodies, masses, joints,
    /// walls, the start, and the controller.
    pub fn validate(&self) -> Result<()> {
        #[cfg(feature = "urdf")]
        if let Some(robot) = self.robots.first() {
            return Err(Error::input(
                "robots",
                robot.urdf.display(),
                "only files have robots that aren't bodies yet: add it by `add_robot`",
            ));
        }
        self.check_world()?;
        self.check_names()?;
        self.check_tree()?;
        let carriers = self.carriers();
        for index in 0..self.bodies.len() {
            body::check(self, &carriers, index)?;
        }
        self.check_forces()?;
        self.check_sites()?;
        start::check(self)?;
        contact::check(self)?;
        self.check_controller()
    }

    fn check_world(&self) -> Result<()> {
        let fluid = &self.fluid;
        finite("fluid.density", &[fluid.density])?;
        finite("fluid.current", &fluid.current)?;
        finite("gravity", &self.gravity)?;
        finite("time_step", &[self.time_step])?;
        if fluid.density < 0.0 {
            return Err(Error::input(
                "fluid.density",
                fluid.density,
                "give a density in kg/m³, zero for no water or above (fresh water: 998)",
            ));
        }
        if let Some(height) = self.waterline {
            finite("waterline", &[height])?;
            if norm(self.gravity) == 0.0 {
                return Err(Error::input(
                    "waterline",
                    height,
                    "water at rest has a surface across gravity: give the scene `gravity`, or take `waterline` away",
                ));
            }
        }
        if self.time_step <= 0.0 {
            return Err(Error::input(
                "time_step",
                self.time_step,
                "give a time step above zero, in s (most example scenes use 0.01)",
            ));
        }
        if self.bodies.is_empty() {
            return Err(Error::input(
                "bodies",
                "none",
                "add a body: [[bodies]] in a scene file, scene.add(…) in Rust",
            ));
        }
        for (i, wall) in self.walls.iter().enumerate() {
            let place = |field| format!("walls[{i}].{field}");
            finite(&place("point"), &wall.point)?;
            finite(&place("normal"), &wall.normal)?;
            if norm(wall.normal) == 0.0 {
                return Err(Error::input(
                    place("normal"),
                    list(&wall.normal),
                    "give the direction from the wall into the water; it can't be zero",
                ));
            }
            for (j, other) in self.walls[..i].iter().enumerate() {
                if cosine(wall.normal, other.normal).abs() > PARALLEL {
                    return Err(Error::input(
                        place("normal"),
                        list(&wall.normal),
                        format!(
                            "walls must be perpendicular to each other, and walls[{j}] has the \
                             normal {}: correct one, or make one of them a fixed box",
                            list(&other.normal)
                        ),
                    ));
                }
            }
        }
        self.check_through_walls("fluid.current", fluid.current)
    }

    /// Refuses water that flows through a wall.
    pub(super) fn check_through_walls(&self, place: &str, velocity: [f64; 3]) -> Result<()> {
        for (i, wall) in self.walls.iter().enumerate() {
            if cosine(velocity, wall.normal).abs() > PARALLEL {
                return Err(Error::input(
                    place,
                    list(&velocity),
                    format!(
                        "water can't flow through walls[{i}], whose normal is {}: make the current \
                         parallel to it",
                        list(&wall.normal)
                    ),
                ));
            }
        }
        Ok(())
    }

    fn check_names(&self) -> Result<()> {
        let mut seen = HashMap::new();
        for (i, body) in self.bodies.iter().enumerate() {
            if body.name.trim().is_empty() {
                return Err(Error::input(
                    format!("bodies[{i}]: name"),
                    format!("{:?}", body.name),
                    "give every body a name",
                ));
            }
            if let Some(first) = seen.insert(body.name.as_str(), i) {
                return Err(Error::input(
                    format!("bodies[{i}]: name"),
                    format!("{:?}", body.name),
                    format!(
                        "bodies[{first}] has that name already (counted from 0); give each its own"
                    ),
                ));
            }
        }
        Ok(())
    }

    /// The number of a body's parent, found among those that there are.
    fn parent(&self, body: &Body, found: Option<usize>) -> Result<Option<usize>> {
        let Some(name) = &body.parent else {
            return Ok(None);
        };
        if found.is_some() {
            return Ok(found);
        }
        let names = || self.bodies.iter().map(|b| b.name.as_str());
        let remedy = match nearest(name, names()) {
            Some(near) => format!("no body has that name; did you mean {near:?}?"),
            None => format!(
                "no body has that name; the bodies are {}",
                names().collect::<Vec<_>>().join(", ")
            ),
        };
        Err(Error::input(
            place(body, "parent"),
            format!("{name:?}"),
            format!("{remedy} (leave `parent` out for the world)"),
        ))
    }

    /// Parents exist, stand before their children, and no body carries itself.
    fn check_tree(&self) -> Result<()> {
        let carriers = self.carriers();
        let each = self.bodies.iter().enumerate();
        let each = each.map(|(b, body)| self.parent(body, carriers.parent(b)));
        let parents = each.collect::<Result<Vec<_>>>()?;
        for (i, body) in self.bodies.iter().enumerate() {
            if let Some(cycle) = chain(i, &parents) {
                let names: Vec<_> = cycle.iter().map(|&b| self.name(b)).collect();
                return Err(Error::input(
                    place(body, "parent"),
                    self.name(parents[i].unwrap_or(i)),
                    format!(
                        "the parents go in a circle ({}); take `parent` away from one of them, \
                         which then hangs on the world",
                        names.join(" on ")
                    ),
                ));
            }
        }
        let late = |&i: &usize| parents[i].is_some_and(|parent| parent > i);
        if let Some(child) = (0..self.bodies.len()).find(late) {
            let mut order: Vec<usize> = (0..self.bodies.len()).collect();
            order.sort_by_key(|&i| depth(i, &parents));
            let names: Vec<_> = order.iter().map(|&i| self.name(i)).collect();
            return Err(Error::input(
                place(&self.bodies[child], "parent"),
                self.name(parents[child].unwrap_or(child)),
                format!(
                    "a parent must stand before its children; write the bodies in the order {}",
                    names.join(", ")
                ),
            ));
        }
        Ok(())
    }

    fn name(&self, index: usize) -> String {
        format!("{:?}", self.bodies[index].name)
    }
}

/// Largest cosine that still counts as perpendicular.
const PARALLEL: f64 = 1e-9;

/// The circle of parents that goes through body `i`, if there is one.
fn chain(i: usize, parents: &[Option<usize>]) -> Option<Vec<usize>> {
    let path = std::iter::successors(Some(i), |&at| parents[at]).take(parents.len() + 1);
    let path: Vec<usize> = path.collect();
    let back = path[1..].iter().position(|&parent| parent == i)?;
    Some(path[..back + 2].to_vec())
}

fn depth(i: usize, parents: &[Option<usize>]) -> usize {
    std::iter::successors(parents[i], |&p| parents[p]).count()
}

fn place(body: &Body, field: &str) -> String {
    format!("body {:?}: {field}", body.name)
}

/// Refuses NaN and infinities.
pub(super) fn finite(place: &str, values: &[f64]) -> Result<()> {
    match values.iter().find(|x| !x.is_finite()) {
        None => Ok(()),
        Some(bad) if values.len() == 1 => Err(Error::input(place, bad, "give a finite number")),
        Some(_) => Err(Error::input(place, list(values), "give finite numbers")),
    }
}

/// Angle, rad, beyond which a rotation vector is taken for a mistake: from there on its digits say little of the rotation, and its square may have no number.
const MOST_TURNED: f64 = 1e6;

/// Refuses what is no rotation vector.
pub(super) fn rotation(place: &str, vector: &[f64; 3]) -> Result<()> {
    finite(place, vector)?;
    match norm(*vector) <= MOST_TURNED {
        true => Ok(()),
        false => Err(Error::input(
            place,
            list(vector),
            "give the axis times the angle, rad, at most 1e6: a turn is 2π",
        )),
    }
}

/// Refuses what isn't finite, or is negative, or zero if it may not be.
fn bounded(place: &str, value: f64, zero: bool, remedy: &str) -> Result<()> {
    finite(place, &[value])?;
    match value > 0.0 || (zero && value == 0.0) {
        true => Ok(()),
        false => Err(Error::input(place, value, remedy)),
    }
}

fn list(values: &[f64]) -> String {
    format!("{values:?}")
}

fn norm(a: [f64; 3]) -> f64 {
    let largest = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if largest == 0.0 {
        return 0.0;
    }
    largest * a.iter().map(|x| (x / largest).powi(2)).sum::<f64>().sqrt()
}

/// Cosine of the angle between two vectors; zero if one of them is zero.
fn cosine(a: [f64; 3], b: [f64; 3]) -> f64 {
    let (na, nb) = (norm(a), norm(b));
    if na == 0.0 || nb == 0.0 {
        return 0.0;
    }
    a.iter().zip(&b).map(|(x, y)| (x / na) * (y / nb)).sum()
}
