//! Smallest gaps between placed surfaces, and between surfaces and walls.
//!
//! A [`Gaps`] is built once per scene and asked at every step. Between two bodies by formula, and from such a body to a
//! wall, distances are those of the shapes themselves, to rounding; an overlap is the shortest shift found that parts
//! the two.
//!
//! Where a body is a mesh, the distances to it are those of the triangle meshes of both, to rounding. Overlap is found
//! there where surfaces cross and where one lies inside the other; its depth is a lower bound of the
//! shift that separates the two, measured at vertices, face centres, points well inside and along
//! crossing edges.

mod film;
mod nearest;
mod pair;

use crate::error::{Error, Result};
use crate::geometry::casing::Casing;
use crate::geometry::cluster::{Cluster, clusters};
use crate::geometry::convex::Solid;
use crate::geometry::mesh::TriMesh;
use crate::geometry::pairing::Pairing;
use crate::geometry::tree::MeshTree;
use crate::geometry::wall::{HalfSpace, Wall};
use hydrograd_adjoint::lie::{Pose, Vec3};
use pair::{Between, Pair};
use std::sync::Arc;

/// Smallest distance between two surfaces, or a surface and a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// m; 0 touching; negative overlapping. Against a wall, minus the depth of the deepest
    /// point behind it. Between bodies by formula, minus the shortest shift found that separates them. Where one is a
    /// mesh, minus an estimate: the deepest point found of either
    /// inside the other, so that no shift shorter than this separates them.
    pub distance: f64,
    /// Number of the body.
    pub first: usize,
    /// What it is near.
    pub second: Other,
    /// Mean edge length of the meshes near the closest points, m: the longer one of the two surfaces.
    pub edge: f64,
}

impl Gap {
    /// Whether it is one of body `b`'s.
    pub(crate) fn touches(&self, b: usize) -> bool {
        self.first == b || self.second == Other::Body(b)
    }

    /// The distance to the other body, or to the body's own image behind the wall, m.
    pub(crate) fn image_distance(&self) -> f64 {
        match self.second {
            Other::Body(_) => self.distance,
            Other::Wall(_) => 2.0 * self.distance,
        }
    }

    /// The bodies that it is between, each with what it is near.
    pub(crate) fn sides(&self) -> impl Iterator<Item = (usize, Other)> {
        let back = match self.second {
            Other::Body(b) => Some((b, Other::Body(self.first))),
            Other::Wall(_) => None,
        };
        [(self.first, self.second)].into_iter().chain(back)
    }
}

/// A gap whose edge isn't looked up: of many candidates only that of the smallest is wanted.
struct Found {
    distance: f64,
    first: usize,
    second: Other,
    near: Near,
}

/// Where a gap's edge is to be found.
enum Near {
    /// At the closest points, each in its body's frame.
    Points([Vec3; 2]),
    /// At the first body's, before a wall.
    Point(Vec3),
    /// It is known, m.
    Edge(f64),
}

/// Signed distance of a point from a surface or a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// m; negative inside a body or behind a wall.
    pub distance: f64,
    /// From what.
    pub from: Other,
    /// Mean edge length near the closest point, m; zero at a wall.
    pub edge: f64,
}

/// What a body is near.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Other {
    /// Another body, by its number.
    Body(usize),
    /// A wall, by its number.
    Wall(usize),
}

/// The surfaces and walls of a scene, ready to be asked for gaps.
#[derive(Clone, Debug)]
pub struct Gaps {
    trees: Vec<Option<Arc<MeshTree>>>,
    /// What the meshes stand for, of bodies by formula.
    solids: Vec<Option<Solid>>,
    /// Boxes around the bodies.
    casings: Vec<Option<Casing>>,
    walls: Vec<HalfSpace>,
    pairing: Pairing,
    /// No edge of a mesh is longer in the mean around a corner, m.
    longest: f64,
}

/// What finds distances from each mesh; equal ones share theirs, which of many bodies would be a third of all memory.
fn trees(meshes: &[Option<&TriMesh>]) -> Vec<Option<Arc<MeshTree>>> {
    let mut made: Vec<(&TriMesh, Arc<MeshTree>)> = Vec::new();
    let mut out = Vec::with_capacity(meshes.len());
    for mesh in meshes {
        out.push(mesh.map(|mesh| {
            let equal =
                |of: &TriMesh| of.vertices() == mesh.vertices() && of.faces() == mesh.faces();
            if let Some((_, known)) = made.iter().find(|(of, _)| equal(of)) {
                return known.clone();
            }
            let tree = Arc::new(MeshTree::new(mesh));
            made.push((mesh, tree.clone()));
            tree
        }));
    }
    out
}

impl Gaps {
    /// `meshes` in body frames, none for a body without surface. Pairs of bodies in `ignore`,
    /// in either order, are left out: those that never move relative to one another.
    ///
    /// # Errors
    /// [`Error::Input`] if a wall has no normal or `ignore` names a body that doesn't exist.
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
        let trees = trees(meshes);
        let longest = trees.iter().flatten().map(|t| t.longest_edge());
        Ok(Self {
            longest: longest.fold(0.0, f64::max),
            solids: vec![None; count],
            casings: trees.iter().map(|t| Some(t.as_ref()?.casing())).collect(),
            trees,
            walls: Wall::half_spaces(walls)?,
            pairing: Pairing::all(count).but(ignore.iter().copied()),
        })
    }

    /// The same surfaces with other walls, and others of them looked at together.
    ///
    /// # Errors
    /// [`Error::Input`] if a wall has no normal.
    pub(crate) fn paired(&self, walls: &[Wall], pairing: Pairing) -> Result<Self> {
        Ok(Self {
            walls: Wall::half_spaces(walls)?,
            pairing,
            ..self.clone()
        })
    }

    /// With the exact shapes of bodies by formula, one for each mesh, in the same frames; none for a body that its
    /// mesh stands for itself.
    ///
    /// # Errors
    /// [`Error::Input`] if their number isn't that of the meshes.
    pub fn by_formula(mut self, solids: Vec<Option<Solid>>) -> Result<Self> {
        if solids.len() != self.trees.len() {
            return Err(Error::input(
                "gaps: shapes by formula",
                solids.len(),
                format!("give one, or none, for each of {} meshes", self.trees.len()),
            ));
        }
        for (casing, solid) in self.casings.iter_mut().zip(&solids) {
            if let Some(solid) = solid {
                *casing = Some(Casing::new(solid.bounds()));
            }
        }
        self.solids = solids;
        Ok(self)
    }

    /// The pairs that are looked at: a body, and another or a wall. Bodies in order, for each the later bodies and then the walls.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, Other)> {
        let submerged = || (0..self.trees.len()).filter(|i| self.trees[*i].is_some());
        submerged().flat_map(move |i| {
            let bodies = submerged().skip_while(move |j| *j <= i);
            let bodies = bodies.filter(move |j| self.pairing.has(i, *j));
            bodies
                .map(Other::Body)
                .chain(self.walls_of(i))
                .map(move |o| (i, o))
        })
    }

    /// The walls that a body is looked at together with.
    fn walls_of(&self, body: usize) -> impl Iterator<Item = Other> + use<> {
        let walls = if self.pairing.has_walls(body) {
            self.walls.len()
        } else {
            0
        };
        (0..walls).map(Other::Wall)
    }

    /// [`Gap::edge`] is no more than this, m.
    pub(crate) fn longest_edge(&self) -> f64 {
        self.longest
    }

    /// Which bodies are looked at together.
    pub(crate) fn pairing(&self) -> &Pairing {
        &self.pairing
    }

    /// Every pair's gap: bodies in order, for each the later bodies and then the walls. Pairs
    /// with a pose that is missing or isn't finite are passed over.
    pub fn all(&self, poses: &[Pose]) -> Vec<Gap> {
        self.pairs()
            .filter_map(|pair| self.gap(pair, poses, f64::INFINITY))
            .collect()
    }

    /// A pair's gap; none where a pose is missing or isn't finite.
    pub(crate) fn between(&self, pair: (usize, Other), poses: &[Pose]) -> Option<Gap> {
        self.gap(pair, poses, f64::INFINITY)
    }

    /// A pair's gap if it is below `limit`.
    fn gap(&self, pair: (usize, Other), poses: &[Pose], limit: f64) -> Option<Gap> {
        Some(self.whole(&self.found(pair, poses, limit)?))
    }

    /// How far a pair is apart if that is below `limit`; the edge there isn't looked up.
    fn found(&self, (first, second): (usize, Other), poses: &[Pose], limit: f64) -> Option<Found> {
        let placed = |i: usize| Some((self.trees.get(i)?.as_ref()?, poses.get(i)?));
        let solid = |i: usize| self.solids.get(i)?.as_ref();
        let (tree, pose) = placed(first)?;
        let (distance, near) = match second {
            Other::Body(j) => {
                let (other, other_pose) = placed(j)?;
                match (solid(first), solid(j)) {
                    (Some(a), Some(b)) => {
                        let found = a.between(pose, b, other_pose)?;
                        (found.distance, Near::Points(found.points))
                    }
                    _ => {
                        let pair = Pair::new((tree, pose), (other, other_pose))?;
                        let Between { distance, edge } = pair.between(limit)?;
                        (distance, Near::Edge(edge))
                    }
                }
            }
            Other::Wall(w) => match solid(first) {
                Some(a) => {
                    let (distance, lowest) = a.height(pose, &self.walls[w]);
                    (distance, Near::Point(lowest))
                }
                None => {
                    let (distance, edge) = tree.height(pose, &self.walls[w]);
                    (distance, Near::Edge(edge))
                }
            },
        };
        (distance.is_finite() && distance < limit).then_some(Found {
            distance,
            first,
            second,
            near,
        })
    }

    /// With the edge at the closest points.
    fn whole(&self, found: &Found) -> Gap {
        let Found {
            distance,
            first,
            second,
            ref near,
        } = *found;
        let edge =
            |body: usize, x: &Vec3| self.trees[body].as_ref().map_or(0.0, |t| t.edge_near(x));
        let edge = match (near, second) {
            (Near::Edge(edge), _) => *edge,
            (Near::Points([x, y]), Other::Body(j)) => edge(first, x).max(edge(j, y)),
            (Near::Points([x, _]) | Near::Point(x), _) => edge(first, x),
        };
        Gap {
            distance,
            first,
            second,
            edge,
        }
    }

    /// Distances of a point (world frame) from every surface's mesh, around which flows are made, one pose per mesh, and then from every wall. A pose that is missing or
    /// isn't finite is passed over.
    pub fn distances<'a>(
        &'a self,
        point: &'a Vec3,
        poses: &'a [Pose],
    ) -> impl Iterator<Item = Distance> + 'a {
        let placed = self.trees.iter().zip(poses).enumerate();
        let bodies = placed.filter_map(|(body, (tree, pose))| {
            let tree = tree.as_ref()?;
            let (distance, face) = tree.signed(&pose.apply_inverse(point))?;
            Some(Distance {
                distance,
                from: Other::Body(body),
                edge: tree.edge_at_face(face),
            })
        });
        let walls = self.walls.iter().enumerate();
        bodies.chain(walls.map(move |(number, wall)| Distance {
            distance: wall.height(point),
            from: Other::Wall(number),
            edge: 0.0,
        }))
    }

    /// The point of body `b`'s surface, at its pose, that is closest to a point of the world frame (m), and the number of its face in the mesh; `None` of a body without a surface.
    pub(crate) fn foot(&self, b: usize, point: &Vec3, pose: &Pose) -> Option<(Vec3, usize)> {
        let tree = self.trees.get(b)?.as_ref()?;
        let (foot, face) = tree.closest(&pose.apply_inverse(point));
        Some((pose.apply(&foot), tree.numbers[face]))
    }
}

/// The error of a gap that isn't positive: names both, says how deep and how to mend it.
/// `names` are those of the bodies; a body without name is called by its number.
pub fn overlap_error(gap: &Gap, names: &[impl AsRef<str>]) -> Error {
    let body = |i: usize| match names.get(i) {
        Some(name) => format!("body {:?}", name.as_ref()),
        None => format!("body {i}"),
    };
    let (first, depth, edge) = (body(gap.first), -gap.distance, gap.edge);
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

/// Points at which each cone from a body's centroid to a face is asked, in shells of equal volume.
const SHELLS: usize = 3;

/// The part of one body's volume that lies inside another body.
#[derive(Clone, Debug)]
pub struct Share {
    inner: usize,
    outer: usize,
    tree: MeshTree,
    /// Points of the inner body, in its frame, with their parts of its volume: cones from the
    /// centroid to the faces, negative where the body isn't seen from there.
    samples: Vec<(Vec3, f64)>,
    /// Points that lie together, with their positive parts.
    clusters: Vec<(Cluster, f64)>,
}

/// Points of a cluster at most.
const CLUSTER: usize = 48;

impl Share {
    /// The part of the smaller one of two bodies inside the larger, by volume; none if one of them
    /// has no surface. `meshes` in body frames.
    pub fn new(meshes: &[Option<&TriMesh>], (first, second): (usize, usize)) -> Option<Self> {
        let mesh = |i: usize| meshes.get(i).copied().flatten();
        let (a, b) = (mesh(first)?, mesh(second)?);
        let volume = |m: &TriMesh| m.mass_properties().volume;
        let (inner, outer, small, large) = if volume(a) < volume(b) {
            (first, second, a, b)
        } else {
            (second, first, b, a)
        };
        let mass = small.mass_properties();
        let apex = mass.centroid;
        let cones = (0..small.faces().len()).flat_map(|f| {
            let [a, b, c] = small.corners(f).map(|x| x - apex);
            let part = a.dot(&b.cross(&c)) / 6.0 / mass.volume / SHELLS as f64;
            let center = (a + b + c) / 3.0;
            (0..SHELLS).map(move |s| {
                let out = ((s as f64 + 0.5) / SHELLS as f64).cbrt();
                (apex + center * out, part)
            })
        });
        let samples: Vec<(Vec3, f64)> = cones.collect();
        let points: Vec<Vec3> = samples.iter().map(|(x, _)| *x).collect();
        let part = |v: &usize| samples[*v].1.max(0.0);
        let together = clusters(&points, CLUSTER).into_iter();
        let clusters = together.map(|c| {
            let parts = c.vertices.iter().map(part).sum();
            (c, parts)
        });
        let clusters = clusters.collect();
        Some(Self {
            inner,
            outer,
            tree: MeshTree::new(large),
            samples,
            clusters,
        })
    }

    /// Numbers of the smaller body and of the one that it is in.
    pub fn bodies(&self) -> (usize, usize) {
        (self.inner, self.outer)
    }

    /// The part at these poses, one per mesh: 0 apart, 1 with the smaller body all inside. To some
    /// hundredths for a hundred faces.
    pub fn at(&self, poses: &[Pose]) -> f64 {
        let (inner, outer) = (&poses[self.inner], &poses[self.outer]);
        let there = |x: &Vec3| outer.apply_inverse(&inner.apply(x));
        let parts = self.samples.iter().filter(|(x, _)| self.holds(&there(x)));
        parts.map(|(_, part)| part).sum::<f64>() + 0.0
    }

    /// [`Share::at`], if it is above a limit: most links lie so little in one another that boxes tell.
    pub fn above(&self, poses: &[Pose], limit: f64) -> Option<f64> {
        let (inner, outer) = (&poses[self.inner], &poses[self.outer]);
        let there = |x: &Vec3| outer.apply_inverse(&inner.apply(x));
        let may = |c: &Cluster| self.tree.meets_box(&there(&c.center), c.radius);
        let may = self.clusters.iter().filter(|(c, _)| may(c));
        // What isn't a number may be anywhere.
        if may.map(|(_, part)| part).sum::<f64>() <= limit {
            return None;
        }
        let near = self.samples.iter().map(|(x, part)| (there(x), *part));
        let near: Vec<(Vec3, f64)> = near.filter(|(x, _)| self.tree.in_box(x)).collect();
        let most: f64 = near.iter().map(|(_, part)| part.max(0.0)).sum();
        if most <= limit {
            return None;
        }
        let parts = near.iter().filter(|(x, _)| self.holds(x));
        let value = parts.map(|(_, part)| part).sum::<f64>() + 0.0;
        (value > limit).then_some(value)
    }

    /// Whether a point lies in the larger body, in its frame.
    fn holds(&self, x: &Vec3) -> bool {
        self.tree.depth_above(x, 0.0).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::{Gaps, TriMesh};
    use crate::geometry::tests::cuboid;
    use std::sync::Arc;

    #[test]
    fn equal_meshes_share_a_tree() {
        let cube = cuboid([0.1; 3]);
        let other =
            TriMesh::new("another", cube.vertices().to_vec(), cube.faces().to_vec()).unwrap();
        let larger = cuboid([0.1, 0.1, 0.2]);
        let meshes = [Some(&cube), None, Some(&larger), Some(&other)];
        let trees = Gaps::new(&meshes, &[], &[]).unwrap().trees;
        let [Some(first), None, Some(second), Some(third)] = &trees[..] else {
            panic!("a tree of each mesh");
        };
        assert!(Arc::ptr_eq(first, third) && !Arc::ptr_eq(first, second));
    }
}
