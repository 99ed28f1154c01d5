//! Finer faces where a body comes near others.
//!
//! Faces that touch a region (a ball) are split at their longest edges until these are short enough; around
//! it the mesh grows coarser from ring to ring. See [`bisection`] for how, and [`ExactSurface`] for curved parts. Meshes
//! whose faces are too long for what they should resolve are divided everywhere ([`divide`]).

mod bisection;
mod divide;
mod exact;
mod flip;
mod halve;

pub(crate) use divide::divided;
pub use exact::ExactSurface;
pub(crate) use halve::halved;

use crate::error::{Error, Result};
use crate::geometry::mesh::TriMesh;
use crate::geometry::points::area_vector;
use crate::geometry::triangle::Triangle;
use bisection::{Bisection, EdgeLength, MEAN_AREA};
use hydrograd_adjoint::lie::Vec3;
use serde::{Deserialize, Serialize};
use std::collections::BinaryHeap;

/// A ball in which a body's faces are made smaller. Faces that touch it are split at their longest edges until
/// none is longer than `edge`; around it they grow from ring to ring. New vertices lie on the shape
/// itself, also where that is curved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refinement {
    /// Its centre, m, in the body's frame.
    pub center: [f64; 3],
    /// Its radius, m.
    pub radius: f64,
    /// Longest edge inside, m. Fundamental solutions resolve a gap from about twice its width on; compressed bodies resolve one of half
    /// of it, to walls of a quarter.
    pub edge: f64,
}

/// Most faces that refinement may add to a mesh.
pub const MAX_ADDED_FACES: usize = 200_000;
/// Shortest edge that may be asked for, over the diameter of the mesh: far below it rounding would fold faces.
const SHORTEST: f64 = 1e-6;

/// Whether the numbers of regions can be. `place` begins the message: the body's name.
///
/// # Errors
/// [`Error::Input`] naming place, region and field, the value and what would be right.
pub fn validate_refinements(regions: &[Refinement], place: &str) -> Result<()> {
    for (i, region) in regions.iter().enumerate() {
        let place = |field: &str| format!("{place}: refine[{i}].{field}");
        if !region.center.iter().all(|x| x.is_finite()) {
            return Err(Error::input(
                place("center"),
                format!("{:?}", region.center),
                "give finite coordinates in metres, in the body's frame",
            ));
        }
        for (field, value) in [("radius", region.radius), ("edge", region.edge)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::input(
                    place(field),
                    value,
                    "give a finite, positive length in metres",
                ));
            }
        }
    }
    Ok(())
}

/// A mesh with faces split where they touch one of the regions (frame of the mesh) until none of their edges
/// is longer than the region's. New vertices lie on the exact surface that the mesh stands for where that
/// is curved, and everything else stays as it is: a polyhedron keeps its volume. `place` begins messages.
///
/// # Errors
/// [`Error::Input`] naming region and field: a number that can't be, an edge that would add more than
/// [`MAX_ADDED_FACES`] faces or is under a millionth of the mesh's diameter, a region that doesn't reach the
/// surface.
pub fn refine(
    mesh: &TriMesh,
    exact: &ExactSurface,
    regions: &[Refinement],
    place: &str,
) -> Result<TriMesh> {
    validate_refinements(regions, place)?;
    if regions.is_empty() {
        return Ok(mesh.clone());
    }
    let least = SHORTEST * mesh.diameter();
    if let Some(i) = regions.iter().position(|r| r.edge < least) {
        return Err(Error::input(
            format!("{place}: refine[{i}].edge"),
            regions[i].edge,
            format!("give at least {least:.1e} m, a millionth of the body's size"),
        ));
    }
    let mut work = Work {
        bisection: Bisection::new(mesh, exact.clone()),
        least,
        most: mesh.faces().len() + MAX_ADDED_FACES,
        place,
    };
    for (i, region) in regions.iter().enumerate() {
        work.reach(i, region)?;
    }
    work.split(regions)?;
    TriMesh::new(mesh.name(), work.bisection.vertices, work.bisection.faces)
}

struct Work<'a> {
    bisection: Bisection,
    /// Shortest edge worth splitting, m.
    least: f64,
    /// Most faces.
    most: usize,
    place: &'a str,
}

impl Work<'_> {
    /// Whether a face is still too long for a region that it touches.
    fn too_long(&self, f: usize, longest: &EdgeLength, region: &Refinement) -> bool {
        longest.squared() > region.edge * region.edge && self.touches(f, longest, region)
    }

    /// Whether a face touches a region.
    fn touches(&self, f: usize, longest: &EdgeLength, region: &Refinement) -> bool {
        let corners = self.bisection.corners(f);
        let center = Vec3::from(region.center);
        // All of a face lies within its longest edge of any of its corners.
        (corners[0] - center).norm() <= region.radius + longest.squared().sqrt()
            && distance(&corners, &center) <= region.radius
    }

    fn all(&self) -> std::ops::Range<usize> {
        0..self.bisection.faces.len()
    }

    /// Makes sure that region `i` touches the surface: a curved one may bulge into it where the flat
    /// faces of a coarse mesh don't, and then these are split first.
    fn reach(&mut self, i: usize, region: &Refinement) -> Result<()> {
        let center = Vec3::from(region.center);
        loop {
            let away = |f| (distance(&self.bisection.corners(f), &center), f);
            let nearest = self.all().map(away).min_by(|a, b| a.0.total_cmp(&b.0));
            let (distance, face) = nearest.unwrap_or((f64::INFINITY, 0));
            if distance <= region.radius {
                return Ok(());
            }
            let longest = self.bisection.longest(face).squared().sqrt();
            // A face lies no deeper under the surface than it is wide.
            let bulges = self.bisection.is_curved(face)
                && longest > self.least
                && distance - region.radius < longest;
            if !bulges {
                return Err(Error::input(
                    format!("{}: refine[{i}]", self.place),
                    format!("center {:?}, radius {}", region.center, region.radius),
                    format!(
                        "the surface is nowhere within the radius: it comes no nearer than {distance:.6e} m \
                         (frame of the shape); move the center to the surface, or give a larger radius"
                    ),
                ));
            }
            self.bisection.advance(face);
        }
    }

    /// Splits what is too long, the longest first.
    fn split(&mut self, regions: &[Refinement]) -> Result<()> {
        let mut waiting = BinaryHeap::new();
        let consider = |work: &Self, f: usize, waiting: &mut BinaryHeap<(EdgeLength, usize)>| {
            let longest = work.bisection.longest(f);
            if regions.iter().any(|r| work.too_long(f, &longest, r)) {
                waiting.push((longest, f));
            }
        };
        for f in self.all() {
            consider(self, f, &mut waiting);
        }
        while let Some((edge, f)) = waiting.pop() {
            // A face that has been split since has other edges, and was considered again then.
            while self.bisection.longest(f) == edge {
                if self.bisection.faces.len() + 2 > self.most {
                    return Err(self.too_many(regions));
                }
                for g in self.bisection.advance(f) {
                    consider(self, g, &mut waiting);
                }
            }
        }
        Ok(())
    }

    /// How many faces are asked for, and the region that most of them are for.
    fn too_many(&self, regions: &[Refinement]) -> Error {
        let mut about = 0.0;
        let mut asked = vec![0.0; regions.len()];
        for f in self.all() {
            let longest = self.bisection.longest(f);
            let area = area_vector(&self.bisection.corners(f)).norm();
            let touched = regions.iter().enumerate();
            let touched = touched.filter(|(_, r)| self.touches(f, &longest, r));
            // A face is split for the shortest edge that is asked of it.
            let finest = touched.min_by(|a, b| a.1.edge.total_cmp(&b.1.edge));
            about += match finest {
                None => 1.0,
                Some((i, region)) => {
                    let faces = area / (MEAN_AREA * region.edge * region.edge);
                    asked[i] += faces;
                    match self.too_long(f, &longest, region) {
                        true => faces.max(1.0),
                        false => 1.0,
                    }
                }
            };
        }
        let most = asked.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let i = most.map_or(0, |(i, _)| i);
        let edge = regions[i].edge;
        Error::input(
            format!("{}: refine[{i}].edge", self.place),
            edge,
            format!(
                "the mesh would have about {about:.1e} faces, and refinement adds at most \
                 {MAX_ADDED_FACES}: give a longer edge or a smaller radius"
            ),
        )
    }
}

/// From a point to a triangle.
fn distance(corners: &[Vec3; 3], point: &Vec3) -> f64 {
    (Triangle::new(*corners).closest(point).0 - point).norm()
}
