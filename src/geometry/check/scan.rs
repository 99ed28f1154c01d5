//! The passes over a mesh that fill a report.

use super::crossing::{self, MANY, MOST};
use super::{Finding, Kind, MeshReport, Severity, counted, number};
use crate::geometry::points::{area_vector, bounds, signed_volume, vertex_normal_sums};
use crate::geometry::topology::{self, Component, Edges};
use crate::geometry::weld;
use hydrograd_adjoint::lie::Vec3;
use std::collections::HashMap;

/// Twice area over longest edge squared (for slivers: height over base) at which a face has no
/// area: its normal is then round-off.
const FLAT_FACE: f64 = 1e-8;
/// Longest edge of a face over diameter of the mesh at which the face is a point.
const POINT_FACE: f64 = 1e-10;
/// Distance over diameter within which two vertices are at the same place.
const SAME_PLACE: f64 = 1e-10;
/// Volume over area^1.5 at which a closed piece has no inside.
const FLAT_PIECE: f64 = 1e-9;
/// Largest coordinate, m: products of four lengths stay in double precision.
const FARTHEST: f64 = 1e60;
/// Length of the sum of angle-weighted unit normals below which a vertex has no normal.
const FOLDED: f64 = 1e-9;
/// Aspect ratio from which a warning is given.
const LONG_FACE: f64 = 30.0;

/// Checks the parts of a mesh, which may be anything: `vertices` in m, `faces` counted from 0. See [`Kind`]
/// for what is looked for.
pub fn check_parts(name: &str, vertices: &[Vec3], faces: &[[usize; 3]]) -> MeshReport {
    check(name, vertices, faces, true)
}

/// The same of a surface that doesn't cross itself, but where rounding has made it: that isn't looked for.
pub(in crate::geometry) fn check_rounded(
    name: &str,
    vertices: &[Vec3],
    faces: &[[usize; 3]],
) -> MeshReport {
    check(name, vertices, faces, false)
}

fn check(name: &str, vertices: &[Vec3], faces: &[[usize; 3]], crossings: bool) -> MeshReport {
    let mut checker = Checker::new(vertices, faces);
    checker.indices_and_numbers();
    checker.duplicate_faces();
    checker.shapes();
    let (edges, pieces) = checker.connections();
    checker.folds();
    if crossings {
        checker.crossings(&edges, &pieces);
    }
    checker.vertices_alone();

    let mut findings = checker.findings;
    findings.sort_by_key(|f| f.kind);
    let usable = findings.iter().all(|f| f.severity == Severity::Warning);
    let finite = checker.finite.iter();
    let all: Vec<_> = finite.map(|&f| corners(vertices, faces[f])).collect();
    MeshReport {
        name: name.to_owned(),
        vertices: vertices.len(),
        faces: faces.len(),
        components: pieces.len(),
        bounds: checker.bounds.map(Into::into),
        volume: usable.then(|| signed_volume(&all)),
        // An empty sum is −0.
        area: all.iter().map(|t| area_vector(t).norm()).sum::<f64>() + 0.0,
        worst_aspect: checker.worst_aspect,
        findings,
    }
}

fn is_usable(x: &Vec3) -> bool {
    x.iter().all(|c| c.abs() <= FARTHEST)
}

fn corners(vertices: &[Vec3], face: [usize; 3]) -> [Vec3; 3] {
    face.map(|v| vertices[v])
}

/// Lengths of a face's sides: the first is that between the first two corners.
fn sides([a, b, c]: &[Vec3; 3]) -> [f64; 3] {
    [(b - a).norm(), (c - b).norm(), (a - c).norm()]
}

/// Whether a face of a mesh of this diameter has an area, to rounding.
pub(crate) fn has_area(corners: &[Vec3; 3], diameter: f64) -> bool {
    let longest = sides(corners).into_iter().fold(0.0, f64::max);
    let area = area_vector(corners).norm();
    // Written so that NaN from under- or overflow counts as flat.
    2.0 * area > FLAT_FACE * longest * longest
        && longest > POINT_FACE * diameter
        && area.is_finite()
}

/// How many, the first face, and where.
type Found = (usize, Option<usize>, Option<Vec3>);

struct Checker<'a> {
    vertices: &'a [Vec3],
    faces: &'a [[usize; 3]],
    bounds: [Vec3; 2],
    /// Faces whose indices exist.
    indexed: Vec<usize>,
    /// Those of them with finite corners.
    finite: Vec<usize>,
    /// Faces that take part in the topology: three different vertices, second copies left out.
    connected: Vec<usize>,
    worst_aspect: f64,
    findings: Vec<Finding>,
}

impl<'a> Checker<'a> {
    fn new(vertices: &'a [Vec3], faces: &'a [[usize; 3]]) -> Self {
        let is_finite = |v: usize| is_usable(&vertices[v]);
        let indexed: Vec<usize> = (0..faces.len())
            .filter(|&f| faces[f].iter().all(|&v| v < vertices.len()))
            .collect();
        let mut finite = indexed.clone();
        finite.retain(|&f| faces[f].iter().all(|&v| is_finite(v)));
        // The size of what the faces span: a stray vertex far away is not part of the body.
        let bounds = bounds(finite.iter().flat_map(|&f| faces[f]).map(|v| &vertices[v]));
        Self {
            vertices,
            faces,
            bounds,
            indexed,
            finite,
            connected: Vec::new(),
            worst_aspect: 0.0,
            findings: Vec::new(),
        }
    }

    fn diameter(&self) -> f64 {
        (self.bounds[1] - self.bounds[0]).norm()
    }

    fn centroid(&self, face: usize) -> Option<Vec3> {
        let c = self.faces[face];
        c.iter()
            .all(|&v| v < self.vertices.len())
            .then(|| c.iter().map(|&v| self.vertices[v] / 3.0).sum())
    }

    fn report(&mut self, kind: Kind, found: Found, problem: String, remedy: &str) {
        let (count, face, position) = found;
        self.findings.push(Finding {
            kind,
            severity: kind.severity(),
            count,
            face,
            position: position.map(Into::into),
            problem,
            remedy: remedy.to_owned(),
        });
    }

    /// Some faces, of which the first is shown.
    fn report_faces(&mut self, kind: Kind, found: &[usize], problem: String, remedy: &str) {
        if let Some(&first) = found.first() {
            let found = (found.len(), Some(first), self.centroid(first));
            self.report(kind, found, problem, remedy);
        }
    }

    fn indices_and_numbers(&mut self) {
        let count = self.vertices.len();
        let parts = [("faces", self.faces.len()), ("vertices", count)];
        if let Some((what, _)) = parts.iter().find(|(_, n)| *n == 0) {
            let problem = format!("the mesh has no {what}");
            let remedy = "give a closed surface of triangles";
            self.report(Kind::Empty, (1, None, None), problem, remedy);
        }
        let wrong: Vec<usize> = (0..self.faces.len())
            .filter(|&f| self.faces[f].iter().any(|&v| v >= count))
            .collect();
        if let Some(&first) = wrong.first() {
            let problem = format!(
                "{} a vertex that doesn't exist: vertex index out of range, {:?} with {}",
                counted(wrong.len(), "face names", "faces name"),
                self.faces[first],
                counted(count, "vertex", "vertices"),
            );
            let remedy = "count vertices from 0, or add the missing vertices";
            self.report_faces(Kind::IndexOutOfRange, &wrong, problem, remedy);
        }
        // A loose vertex has no effect, wherever it is.
        let used = self.used();
        let bad: Vec<usize> = (0..count)
            .filter(|&v| used[v] && !is_usable(&self.vertices[v]))
            .collect();
        if let Some(&first) = bad.first() {
            let n = counted(bad.len(), "vertex has", "vertices have");
            let problem = format!(
                "{n} coordinates that are NaN, infinite or over {FARTHEST:.0e} m, the first is vertex {first}"
            );
            let remedy = "export the mesh again; coordinates must be finite numbers, in metres";
            self.report(Kind::NotFinite, self.at_vertex(&bad), problem, remedy);
        }
    }

    /// Some vertices, of which the first is shown.
    fn at_vertex(&self, found: &[usize]) -> Found {
        let first = found[0];
        let face = self.faces.iter().position(|f| f.contains(&first));
        (found.len(), face, Some(self.vertices[first]))
    }

    fn duplicate_faces(&mut self) {
        let mut first: HashMap<[usize; 3], usize> = HashMap::with_capacity(self.indexed.len());
        let mut copies = Vec::new();
        let mut original = None;
        for &f in &self.indexed {
            let mut key = self.faces[f];
            key.sort_unstable();
            if key[0] == key[1] || key[1] == key[2] {
                continue; // without area; has no part in the topology
            }
            match first.get(&key) {
                Some(&other) => {
                    original.get_or_insert(other);
                    copies.push(f);
                }
                None => {
                    first.insert(key, f);
                    self.connected.push(f);
                }
            }
        }
        if let Some(original) = original {
            let n = counted(copies.len(), "face repeats", "faces repeat");
            let problem =
                format!("{n} the corners of another face (face {original} for the first)");
            let remedy = "delete the copies; a thin plate needs two surfaces at a distance";
            self.report_faces(Kind::DuplicateFace, &copies, problem, remedy);
        }
    }

    /// Area and aspect ratio of each face.
    fn shapes(&mut self) {
        let diameter = self.diameter();
        let mut flat = Vec::new();
        let mut long = 0;
        let mut worst = (0.0, 0);
        for &f in &self.finite {
            let corners = corners(self.vertices, self.faces[f]);
            if !has_area(&corners, diameter) {
                flat.push(f);
                continue;
            }
            let (sides, area) = (sides(&corners), area_vector(&corners).norm());
            let longest = sides.into_iter().fold(0.0, f64::max);
            let aspect = longest * sides.iter().sum::<f64>() / (4.0 * 3f64.sqrt() * area);
            long += usize::from(aspect > LONG_FACE);
            if aspect > worst.0 {
                worst = (aspect, f);
            }
        }
        let problem = format!("{} no area", counted(flat.len(), "face has", "faces have"));
        let remedy = "collapse the shortest edge of each, and merge vertices at the same place";
        self.report_faces(Kind::ZeroArea, &flat, problem, remedy);
        self.worst_aspect = worst.0;
        if long > 0 {
            let found = (long, Some(worst.1), self.centroid(worst.1));
            let n = counted(long, "face has", "faces have");
            let problem = format!(
                "{n} an aspect ratio over {LONG_FACE}, the worst {:.3e}",
                worst.0
            );
            let remedy = "remesh with faces nearer to equilateral, or with more of them";
            self.report(Kind::Aspect, found, problem, remedy);
        }
    }

    /// Edges, orientations and pieces.
    fn connections(&mut self) -> (Edges, Vec<Component>) {
        let edges = topology::edges(self.connected.iter().map(|&f| (f, self.faces[f])));
        let complete = self.indexed.len() == self.faces.len();
        if complete {
            self.edges_with(&edges, Kind::OpenEdge);
        }
        self.edges_with(&edges, Kind::NonManifoldEdge);
        let pieces = topology::components(self.faces.len(), self.connected.iter().copied(), &edges);
        self.orientations(&pieces);
        self.insides(&pieces);
        if let [_, second, ..] = pieces.as_slice() {
            let f = second.faces[0];
            let found = (pieces.len(), Some(f), self.centroid(f));
            let problem = format!(
                "{} separate pieces that share no edge; the second begins here",
                pieces.len()
            );
            let remedy = "they are one body, and narrow gaps between them aren't watched as those between bodies are; \
                          merge vertices if they should be one surface";
            self.report(Kind::Components, found, problem, remedy);
        }
        (edges, pieces)
    }

    fn edges_with(&mut self, edges: &Edges, kind: Kind) {
        let is_open = kind == Kind::OpenEdge;
        let wrong = |uses: &&[topology::EdgeUse]| match is_open {
            true => uses.len() == 1,
            false => uses.len() > 2,
        };
        let wrong: Vec<_> = edges.groups().filter(wrong).map(|uses| uses[0]).collect();
        // Of equals the first.
        let first = wrong.iter().min_by_key(|u| u.face);
        let Some(edge) = first else { return };
        let [a, b] = edge.directed();
        let middle = self.vertices[a] * 0.5 + self.vertices[b] * 0.5;
        let what = counted(wrong.len(), "edge", "edges");
        let (problem, remedy) = if is_open {
            (
                format!("{what} with one face only (a hole), the first from vertex {a} to {b}"),
                "close the holes; if the surface looks closed, merge vertices at the same place",
            )
        } else {
            (
                format!("{what} with more than two faces, the first from vertex {a} to {b}"),
                "delete inner walls, and split surfaces that touch along an edge",
            )
        };
        let found = (wrong.len(), Some(edge.face), Some(middle));
        self.report(kind, found, problem, remedy);
    }

    fn orientations(&mut self, pieces: &[Component]) {
        let mut flipped = Vec::new();
        let mut one_sided = Vec::new();
        for piece in pieces {
            if piece.one_sided {
                one_sided.push(piece.faces[0]);
            } else {
                flipped.extend_from_slice(&piece.flipped);
            }
        }
        flipped.sort_unstable();
        let n = counted(flipped.len(), "face is turned", "faces are turned");
        let problem = format!("{n} against the neighbours");
        let remedy = "reverse the order of their corners (recalculate normals outward)";
        self.report_faces(Kind::Orientation, &flipped, problem, remedy);
        let remedy = "it can't bound a volume; model the body as a solid";
        let problem = "the surface has one side only (a Möbius strip)".to_owned();
        self.report_faces(Kind::OneSided, &one_sided, problem, remedy);
    }

    /// Whether each closed piece has its inside inside.
    fn insides(&mut self, pieces: &[Component]) {
        let mut flat = Vec::new();
        let mut inward = Vec::new();
        let mut inverted = 0.0;
        for piece in pieces {
            if !piece.closed || piece.one_sided || !piece.flipped.is_empty() {
                continue;
            }
            let faces = piece.faces.iter();
            let all: Vec<_> = faces
                .map(|&f| corners(self.vertices, self.faces[f]))
                .collect();
            let mut numbers = all.iter().flatten().flat_map(|p| p.iter());
            if numbers.any(|x| !x.is_finite()) {
                continue;
            }
            let volume = signed_volume(&all);
            let area: f64 = all.iter().map(|t| area_vector(t).norm()).sum();
            // The cube root first: the 1.5th power of a small area would underflow sooner.
            if volume.abs().cbrt() <= FLAT_PIECE.cbrt() * area.sqrt() {
                flat.push(piece.faces[0]);
            } else if volume < 0.0 {
                inward.push(piece.faces[0]);
                inverted += volume;
            }
        }
        let problem = "the surface is closed but encloses no volume".to_owned();
        let remedy = "give the body a thickness";
        self.report_faces(Kind::NoVolume, &flat, problem, remedy);
        let n = counted(inward.len(), "closed piece", "closed pieces");
        let problem = format!(
            "{n} with normals pointing inward (volume {} m³)",
            number(inverted)
        );
        let remedy = "reverse the order of the corners of its faces (flip normals); delete it if \
                      it is a cavity";
        self.report_faces(Kind::Inward, &inward, problem, remedy);
    }

    fn has_errors(&self) -> bool {
        self.findings.iter().any(|f| f.severity == Severity::Error)
    }

    /// Vertices without a normal; looked for only where all else is right.
    fn folds(&mut self) {
        if self.has_errors() {
            return;
        }
        let sums = vertex_normal_sums(self.vertices, self.faces);
        let used = self.used();
        let folded = |v: &usize| used[*v] && sums[*v].norm() <= FOLDED;
        let folded: Vec<usize> = (0..sums.len()).filter(folded).collect();
        if let Some(&v) = folded.first() {
            let n = counted(folded.len(), "vertex has", "vertices have");
            let problem =
                format!("{n} faces that fold back on each other, the first is vertex {v}");
            let remedy = "mend the surface there, or split what touches in a point only";
            self.report(Kind::FoldedVertex, self.at_vertex(&folded), problem, remedy);
        }
    }

    /// Faces that cross, and pieces inside others; looked for only where all else is right.
    fn crossings(&mut self, edges: &Edges, pieces: &[Component]) {
        if self.has_errors() {
            return;
        }
        let found = crossing::crossings(self.vertices, self.faces, edges);
        if let Some([first, _]) = found.pairs.first() {
            let shown = found.pairs.iter().take(5);
            let shown: Vec<_> = shown.map(|[f, g]| format!("{f} with {g}")).collect();
            let most = match found.pairs.len() > MANY {
                true => format!("more than {MANY} pairs"),
                false => counted(found.pairs.len(), "pair", "pairs"),
            };
            let more = match found.pairs.len() > shown.len() {
                true => ", …",
                false => "",
            };
            let problem = format!(
                "{most} of faces pass through each other or share an area: {}{more}",
                shown.join(", ")
            );
            let remedy = "unite in a mesh tool what crosses (boolean union, remesh), or take the convex hull of its \
                          vertices (hydrograd check-mesh FILE --hull hull.obj)";
            let found = (found.pairs.len(), Some(*first), self.centroid(*first));
            self.report(Kind::Crossing, found, problem, remedy);
            return;
        }
        if found.searched < self.faces.len() {
            let rest = self.faces.len() - found.searched;
            let problem = format!(
                "crossings were looked for from {} of {} faces only: more than {MOST:.0e} pairs come near each other",
                found.searched,
                self.faces.len()
            );
            let remedy = "remesh with faces nearer to equilateral";
            self.report(Kind::Unsearched, (rest, None, None), problem, remedy);
        }
        if pieces.len() < 2 {
            return;
        }
        let inner = crossing::nested(self.vertices, self.faces, pieces);
        let n = counted(inner.len(), "piece lies", "pieces lie");
        let problem = format!("{n} inside another, where the surface winds twice");
        let remedy = "delete what is inside: the body is solid there";
        self.report_faces(Kind::Nested, &inner, problem, remedy);
    }

    /// Whether a face uses each vertex.
    fn used(&self) -> Vec<bool> {
        let mut used = vec![false; self.vertices.len()];
        let corners = self.indexed.iter().flat_map(|&f| self.faces[f]);
        corners.for_each(|v| used[v] = true);
        used
    }

    fn vertices_alone(&mut self) {
        let same = weld::representatives(self.vertices, SAME_PLACE * self.diameter());
        let copies: Vec<usize> = (0..same.len()).filter(|&v| same[v] != v).collect();
        if let Some(&v) = copies.first() {
            let n = counted(copies.len(), "vertex is", "vertices are");
            let problem = format!(
                "{n} at the place of another, the first is vertex {v} (at vertex {})",
                same[v]
            );
            let found = self.at_vertex(&copies);
            let remedy = "merge vertices at the same place";
            self.report(Kind::DuplicateVertex, found, problem, remedy);
        }
        let used = self.used();
        let unused: Vec<usize> = (0..used.len()).filter(|&v| !used[v]).collect();
        if let Some(&v) = unused.first() {
            let n = counted(unused.len(), "vertex is", "vertices are");
            let problem = format!("{n} not used by any face, the first is vertex {v}");
            let remedy = "delete loose vertices; they have no effect";
            let found = (unused.len(), None, Some(self.vertices[v]));
            self.report(Kind::UnreferencedVertex, found, problem, remedy);
        }
    }
}
