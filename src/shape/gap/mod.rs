//! Smallest gaps between placed surfaces, and between surfaces and walls.
//!
//! A [`Gaps`] is built once per scene and asked at every step. Distances between surfaces that
//! don't overlap are those of the triangle meshes themselves, to rounding. Overlap is found
//! where surfaces cross and where one lies inside the other; its depth is a lower bound of the
//! shift that separates the two, measured at vertices, face centres, points well inside and along
//! crossing edges.

mod pair;
mod point;
mod share;
mod surface;
pub(super) mod triangle;

#[cfg(test)]
mod tests;

pub use point::Distance;
pub use share::Share;

use super::mesh::TriMesh;
use crate::error::{Error, Result};
use crate::scene::Wall;
use hydrograd_adjoint::lie::{Pose, Vec3};
use pair::{Between, Pair};
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};
use surface::Surface;

/// Smallest distance between two surfaces, or a surface and a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// m; 0 touching; negative overlapping. Against a wall, minus the depth of the deepest
    /// vertex behind it. Between bodies, minus an estimate: the deepest point found of either
    /// inside the other, so that no shift shorter than this separates them.
    pub distance: f64,
    /// Number of the body.
    pub first: usize,
    /// What it is near.
    pub second: Other,
    /// Mean edge length near the closest points, m: the longer one of the two surfaces.
    pub edge: f64,
}

/// What a body is near.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Other {
    /// Another body, by its number.
    Body(usize),
    /// A wall, by its number.
    Wall(usize),
}

/// The surfaces and walls of a scene, ready to be asked for gaps.
#[derive(Clone, Debug)]
pub struct Gaps {
    surfaces: Vec<Option<Surface>>,
    /// Point and unit normal.
    walls: Vec<(Vec3, Vec3)>,
    pairs: Vec<(usize, Other)>,
}

impl Gaps {
    /// `meshes` in body frames, none for a body without surface. Pairs of bodies in `ignore`,
    /// in either order, are left out: those that never move relative to one another.
    ///
    /// # Errors
    /// [`Error::Mesh`] if a mesh has no faces or a vertex that isn't finite, [`Error::Input`] if a
    /// wall has no normal or `ignore` names a body that doesn't exist.
    pub fn new(
        meshes: &[Option<&TriMesh>],
        walls: &[Wall],
        ignore: &[(usize, usize)],
    ) -> Result<Self> {
        let count = meshes.len();
        if let Some((a, b)) = ignore.iter().find(|(a, b)| *a.max(b) >= count) {
            return Err(Error::input(
                "gaps: ignored pair",
                format!("({a}, {b})"),
                format!("bodies are counted from 0 and there are {count}"),
            ));
        }
        let surfaces = meshes
            .iter()
            .map(|mesh| mesh.map(Surface::new).transpose())
            .collect::<Result<Vec<_>>>()?;
        let walls = walls
            .iter()
            .enumerate()
            .map(|(w, wall)| plane(w, wall))
            .collect::<Result<Vec<_>>>()?;
        let ignored: BTreeSet<(usize, usize)> =
            ignore.iter().map(|&(a, b)| (a.min(b), a.max(b))).collect();
        let submerged: Vec<usize> = (0..count).filter(|&i| surfaces[i].is_some()).collect();
        let mut pairs = Vec::new();
        for (k, &i) in submerged.iter().enumerate() {
            let others = submerged[k + 1..]
                .iter()
                .filter(|&&j| !ignored.contains(&(i, j)));
            pairs.extend(others.map(|&j| (i, Other::Body(j))));
            pairs.extend((0..walls.len()).map(|w| (i, Other::Wall(w))));
        }
        Ok(Self {
            surfaces,
            walls,
            pairs,
        })
    }

    /// The pairs that are looked at: a body, and another or a wall.
    pub fn pairs(&self) -> &[(usize, Other)] {
        &self.pairs
    }

    /// Smallest gap of all pairs, one pose per mesh; none when there is no pair. Of pairs
    /// equally near to rounding, always the same one. Pairs with a pose that is missing or isn't
    /// finite are passed over.
    pub fn smallest(&self, poses: &[Pose]) -> Option<Gap> {
        let balls: Vec<Option<(Vec3, f64)>> = self
            .surfaces
            .iter()
            .zip(poses)
            .map(|(s, pose)| s.as_ref().map(|s| (pose.apply(&s.center), s.radius)))
            .collect();
        // Nearest first by the balls around them. Bits of numbers ≥ 0 sort as the numbers do.
        let mut waiting: BinaryHeap<Reverse<(u64, usize)>> = self
            .pairs
            .iter()
            .enumerate()
            .filter_map(|(k, &pair)| {
                let bound = self.bound(&balls, pair)?;
                Some(Reverse((bound.max(0.0).to_bits(), k)))
            })
            .collect();
        let mut best: Option<Gap> = None;
        while let Some(Reverse((bits, k))) = waiting.pop() {
            let bound = f64::from_bits(bits);
            let limit = best.map_or(f64::INFINITY, |gap| gap.distance);
            if bound > 0.0 && bound >= limit {
                break;
            }
            if let Some(gap) = self.gap(self.pairs[k], poses, limit) {
                best = Some(gap);
            }
        }
        best
    }

    /// Every pair's gap: bodies in order, for each the later bodies and then the walls. Pairs
    /// with a pose that is missing or isn't finite are passed over.
    pub fn all(&self, poses: &[Pose]) -> Vec<Gap> {
        self.pairs
            .iter()
            .filter_map(|&pair| self.gap(pair, poses, f64::INFINITY))
            .collect()
    }

    /// A lower bound of a gap that isn't negative, from balls around the bodies.
    fn bound(&self, balls: &[Option<(Vec3, f64)>], (i, other): (usize, Other)) -> Option<f64> {
        let (center, radius) = (*balls.get(i)?)?;
        let bound = match other {
            Other::Body(j) => {
                let (there, other_radius) = (*balls.get(j)?)?;
                (there - center).norm() - (radius + other_radius)
            }
            Other::Wall(w) => {
                let (point, normal) = self.walls[w];
                (center - point).dot(&normal) - radius
            }
        };
        // Room for rounding.
        let slack = 1e-14 * (center.norm() + radius + bound.abs());
        bound.is_finite().then_some(bound - slack)
    }

    /// A pair's gap if it is below `limit`.
    fn gap(&self, (first, second): (usize, Other), poses: &[Pose], limit: f64) -> Option<Gap> {
        let placed = |i: usize| Some((self.surfaces.get(i)?.as_ref()?, poses.get(i)?));
        let (surface, pose) = placed(first)?;
        let Between { distance, edge } = match second {
            Other::Body(j) => Pair::new((surface, pose), placed(j)?)?.between(limit)?,
            Other::Wall(w) => {
                let (point, normal) = &self.walls[w];
                let (distance, edge) = surface.height(pose, point, normal);
                Between { distance, edge }
            }
        };
        (distance.is_finite() && distance < limit).then_some(Gap {
            distance,
            first,
            second,
            edge,
        })
    }
}

/// Point and unit normal of a wall.
fn plane(number: usize, wall: &Wall) -> Result<(Vec3, Vec3)> {
    let (point, normal) = (Vec3::from(wall.point), Vec3::from(wall.normal));
    let largest = normal.amax();
    if !(largest > 0.0 && normal.iter().chain(point.iter()).all(|x| x.is_finite())) {
        return Err(Error::input(
            format!("wall {number}"),
            format!("point {:?}, normal {:?}", wall.point, wall.normal),
            "give a finite point and a finite normal that isn't zero, pointing into the fluid",
        ));
    }
    Ok((point, (normal / largest).normalize()))
}

/// The error of a gap that isn't positive: names both, says how deep and how to mend it.
/// `names` are those of the bodies; a body without name is called by its number.
pub fn overlap_error(gap: &Gap, names: &[impl AsRef<str>]) -> Error {
    let body = |i: usize| {
        names
            .get(i)
            .map_or_else(|| format!("body {i}"), |n| format!("body {:?}", n.as_ref()))
    };
    let first = body(gap.first);
    let depth = -gap.distance;
    let edge = gap.edge;
    let (place, remedy) = match gap.second {
        Other::Body(j) if depth > 0.0 => (
            format!("{first} and {}", body(j)),
            format!("they overlap: move them apart by at least {depth:.6e} m"),
        ),
        Other::Wall(w) if depth > 0.0 => (
            format!("{first} and wall {w}"),
            format!(
                "it reaches through the wall: move it into the fluid by at least {depth:.6e} m"
            ),
        ),
        Other::Body(j) => (
            format!("{first} and {}", body(j)),
            format!("they are too near: move them apart; edges there are {edge:.3e} m long"),
        ),
        Other::Wall(w) => (
            format!("{first} and wall {w}"),
            format!("it is too near: move it into the fluid; edges there are {edge:.3e} m long"),
        ),
    };
    Error::Unresolved {
        place,
        quantity: "gap in m".into(),
        value: gap.distance,
        limit: 0.0,
        remedy,
    }
}
