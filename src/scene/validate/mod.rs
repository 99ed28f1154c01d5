//! Everything about a scene that can be checked without its meshes.
//!
//! Each error names the body and the field, the value found there and what to write instead. What
//! needs meshes (whether a mesh is closed, whether bodies overlap, whether the whole mass matrix is
//! positive definite) is checked where they are made.

mod body;
mod contact;
mod controller;
mod limits;
mod start;

pub(crate) use body::impossible_inertia;

use std::collections::HashMap;

use super::file::nearest;
use super::{Body, Scene};
use crate::{Error, Result};

impl Scene {
    /// Checks all that doesn't need the meshes: numbers, names, the tree of bodies, masses, joints,
    /// walls, the start, and the controller.
    pub fn validate(&self) -> Result<()> {
        self.check_world()?;
        self.check_names()?;
        self.check_tree()?;
        for index in 0..self.bodies.len() {
            body::check(self, index)?;
        }
        self.check_forces()?;
        start::check(self)?;
        contact::check(self)?;
        self.check_controller()
    }

    /// Whether this body can't move at all: fixed or locked joints all the way to the world.
    /// The tree must have been checked.
    pub(crate) fn is_static(&self, index: usize) -> bool {
        let body = &self.bodies[index];
        let held = body.joint.velocities() == 0 || body.locked;
        let parent = body.parent.as_ref().and_then(|name| self.body(name));
        held && parent.is_none_or(|parent| self.is_static(parent.0))
    }

    /// The nearest body with a shape among those that carry this one: what `overlaps_parent` speaks
    /// of. The tree must have been checked.
    pub(crate) fn submerged_parent(&self, index: usize) -> Option<usize> {
        let parent = self.bodies[index].parent.as_ref()?;
        let parent = self.body(parent)?.0;
        match self.bodies[parent].shape {
            Some(_) => Some(parent),
            None => self.submerged_parent(parent),
        }
    }

    /// Pairs of bodies declared to overlap, the carrying one first. The scene must have been checked.
    pub(crate) fn overlapping(&self) -> Vec<(usize, usize)> {
        let declared = (0..self.bodies.len()).filter(|&b| self.bodies[b].overlaps_parent);
        declared
            .filter_map(|b| Some((self.submerged_parent(b)?, b)))
            .collect()
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
            let across = cosine(fluid.current, wall.normal);
            if across.abs() > PARALLEL {
                return Err(Error::input(
                    "fluid.current",
                    list(&fluid.current),
                    format!(
                        "water can't flow through walls[{i}], whose normal is {}: make the current \
                         parallel to it",
                        list(&wall.normal)
                    ),
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

    fn parent(&self, body: &Body) -> Result<Option<usize>> {
        let Some(name) = &body.parent else {
            return Ok(None);
        };
        if let Some(parent) = self.body(name) {
            return Ok(Some(parent.0));
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
        let each = self.bodies.iter().map(|body| self.parent(body));
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
fn finite(place: &str, values: &[f64]) -> Result<()> {
    match values.iter().find(|x| !x.is_finite()) {
        None => Ok(()),
        Some(bad) if values.len() == 1 => Err(Error::input(place, bad, "give a finite number")),
        Some(_) => Err(Error::input(place, list(values), "give finite numbers")),
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
