//! Whether faces of a mesh pass through each other, by the signs of exact determinants: no tolerance, so no verdict depends on one.
//!
//! Two faces *cross* if they share more than a contact: a stretch of the line in which their planes meet runs inside both, or through an
//! edge across which the surface goes on on the other side; or they lie in one plane and share an area. Faces that meet in points
//! or along edges without passing through touch, and don't cross.
//!
//! # References
//! Guigue and Devillers 2003, Fast and robust triangle-triangle overlap test using orientation predicates, J. Graphics Tools 8(1).
//! The predicates are Shewchuk's (1997), by the crate `robust`.

use hydrograd_adjoint::lie::Vec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// A surface, in lengths for which products of three stay in double precision.
pub(super) struct Exact<'a> {
    vertices: Vec<Vec3>,
    faces: &'a [[usize; 3]],
    /// The face across each edge, from corner k to the next.
    across: Vec<[usize; 3]>,
}

/// 1, −1 or 0.
type Sign = i8;

fn sign(x: f64) -> Sign {
    i8::from(x > 0.0) - i8::from(x < 0.0)
}

impl<'a> Exact<'a> {
    /// Of vertices that span about `size`. Powers of two change no digit.
    pub fn new(
        vertices: &[Vec3],
        faces: &'a [[usize; 3]],
        across: Vec<[usize; 3]>,
        size: f64,
    ) -> Self {
        let unit = (-size.log2().round()).exp2();
        Self {
            vertices: vertices.iter().map(|x| x * unit).collect(),
            faces,
            across,
        }
    }

    /// Whether the boxes around two faces have a point in common.
    pub fn near(&self, f: usize, g: usize) -> bool {
        let [a, b] = [f, g].map(|f| self.faces[f].map(|v| &self.vertices[v]));
        (0..3).all(|i| {
            let span = |t: &[&Vec3; 3]| {
                let [x, y, z] = t.map(|p| p[i]);
                (x.min(y).min(z), x.max(y).max(z))
            };
            let ((a, b), (c, d)) = (span(&a), span(&b));
            a <= d && c <= b
        })
    }

    /// Whether two faces cross.
    pub fn cross(&self, f: usize, g: usize) -> bool {
        let (a, b) = (self.faces[f], self.faces[g]);
        let of_a = a.map(|v| self.height(b, v));
        if one_side(&of_a) {
            return false;
        }
        if of_a == [0; 3] {
            return self.overlap(a, b);
        }
        let of_b = b.map(|v| self.height(a, v));
        if straddles(&of_a) && straddles(&of_b) {
            return self.share_a_stretch((a, of_a), (b, of_b));
        }
        self.passes(f, &of_a, g) || self.passes(g, &of_b, f)
    }

    /// On which side of the plane of a face a vertex is: positive where the face's corners run counter-clockwise.
    fn height(&self, face: [usize; 3], v: usize) -> Sign {
        match face.contains(&v) {
            true => 0,
            false => self.turn([face[0], face[1], face[2], v]),
        }
    }

    /// Sign of the volume (b − a) × (c − a) · (d − a).
    fn turn(&self, corners: [usize; 4]) -> Sign {
        let [a, b, c, d] = corners.map(|v| {
            let p = &self.vertices[v];
            Coord3D {
                x: p.x,
                y: p.y,
                z: p.z,
            }
        });
        -sign(orient3d(a, b, c, d))
    }

    /// Whether two faces, each of which has corners on both sides of the other's plane, have more than a point in common: the intervals
    /// that they cut out of the line in which their planes meet overlap.
    fn share_a_stretch(
        &self,
        (a, of_a): ([usize; 3], [Sign; 3]),
        (b, of_b): ([usize; 3], [Sign; 3]),
    ) -> bool {
        let (ka, kb) = (alone(&of_a), alone(&of_b));
        let from = |t: [usize; 3], k: usize| [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
        let ([p1, mut q1, mut r1], [p2, mut q2, mut r2]) = (from(a, ka), from(b, kb));
        if of_a[ka] < 0 {
            (q2, r2) = (r2, q2);
        }
        if of_b[kb] < 0 {
            (q1, r1) = (r1, q1);
        }
        self.turn([p1, q1, p2, q2]) < 0 && self.turn([p1, r1, r2, p2]) < 0
    }

    /// Whether the surface passes through face `g` at an edge of face `f` that lies in the plane of `g`; `heights` are those of `f`.
    fn passes(&self, f: usize, heights: &[Sign; 3], g: usize) -> bool {
        let Some(k) = (0..3).find(|&k| heights[k] == 0 && heights[(k + 1) % 3] == 0) else {
            return false;
        };
        let (a, b) = (self.faces[f], self.faces[g]);
        let [u, v, third] = [a[k], a[(k + 1) % 3], a[(k + 2) % 3]];
        if b.contains(&u) && b.contains(&v) {
            return false;
        }
        let Some(beyond) = self.third(self.across[f][k], [u, v]) else {
            return false;
        };
        let plane = self.plane(b);
        if self.enters(&plane, [u, v], b) {
            return self.height(b, beyond) == -heights[(k + 2) % 3];
        }
        let along = (0..3).find(|&l| self.runs_along(&plane, [u, v], [b[l], b[(l + 1) % 3]]));
        let Some(l) = along else { return false };
        let ends = [b[l], b[(l + 1) % 3]];
        let Some(other) = self.third(self.across[g][l], ends) else {
            return false;
        };
        let between = |x| self.between([u, v], [third, beyond], x);
        between(b[(l + 2) % 3]) != between(other)
    }

    /// The corner of a face that isn't an end of this edge.
    fn third(&self, face: usize, ends: [usize; 2]) -> Option<usize> {
        let corners = self.faces.get(face)?;
        corners.iter().copied().find(|v| !ends.contains(v))
    }

    /// Whether the half plane of `x` at an axis lies strictly between those of `from` and `to`, counter-clockwise about it.
    fn between(&self, [u, v]: [usize; 2], [from, to]: [usize; 2], x: usize) -> bool {
        let turn = |p: usize, q: usize| self.turn([u, v, p, q]);
        match turn(from, to) {
            1 => turn(from, x) > 0 && turn(x, to) > 0,
            -1 => !(turn(to, x) >= 0 && turn(x, from) >= 0),
            _ => turn(from, x) > 0,
        }
    }

    /// The two coordinates in which a face is seen largest, and how it turns in them.
    fn plane(&self, face: [usize; 3]) -> Plane {
        let [a, b, c] = face.map(|v| self.vertices[v]);
        let axis = (b - a).cross(&(c - a)).iamax();
        let mut plane = Plane {
            axes: [(axis + 1) % 3, (axis + 2) % 3],
            turns: 0,
        };
        plane.turns = self.turn_in(&plane, face);
        plane
    }

    /// Sign of the area (b − a) × (c − a) in a plane.
    fn turn_in(&self, plane: &Plane, corners: [usize; 3]) -> Sign {
        let [i, j] = plane.axes;
        let [a, b, c] = corners.map(|v| Coord {
            x: self.vertices[v][i],
            y: self.vertices[v][j],
        });
        sign(orient2d(a, b, c))
    }

    /// Whether two faces in one plane share an area: no edge of either separates them.
    fn overlap(&self, a: [usize; 3], b: [usize; 3]) -> bool {
        let separates = |t: [usize; 3], other: [usize; 3]| {
            let plane = self.plane(t);
            (0..3).any(|k| {
                let out =
                    |&v: &usize| self.turn_in(&plane, [t[k], t[(k + 1) % 3], v]) * plane.turns <= 0;
                other.iter().all(out)
            })
        };
        !separates(a, b) && !separates(b, a)
    }

    /// Whether an edge in the plane of a face runs through its inside.
    fn enters(&self, plane: &Plane, [u, v]: [usize; 2], face: [usize; 3]) -> bool {
        let sides = face.map(|x| self.turn_in(plane, [u, v, x]));
        let beside = (0..3).any(|k| {
            let out = |x| self.turn_in(plane, [face[k], face[(k + 1) % 3], x]) * plane.turns <= 0;
            out(u) && out(v)
        });
        straddles(&sides) && !beside
    }

    /// Whether two edges in a plane share more than a point, on one line.
    fn runs_along(&self, plane: &Plane, [u, v]: [usize; 2], [x, y]: [usize; 2]) -> bool {
        if self.turn_in(plane, [u, v, x]) != 0 || self.turn_in(plane, [u, v, y]) != 0 {
            return false;
        }
        let at = |v: usize, i: usize| self.vertices[v][i];
        plane.axes.iter().any(|&i| {
            let (low, high) = (at(u, i).min(at(v, i)), at(u, i).max(at(v, i)));
            low.max(at(x, i).min(at(y, i))) < high.min(at(x, i).max(at(y, i)))
        })
    }
}

/// Two coordinates in which a face is seen, and whether its corners run counter-clockwise in them.
struct Plane {
    axes: [usize; 2],
    turns: Sign,
}

/// All strictly on one side.
fn one_side(heights: &[Sign; 3]) -> bool {
    heights[0] != 0 && heights.iter().all(|h| *h == heights[0])
}

/// Some strictly on either side.
fn straddles(heights: &[Sign; 3]) -> bool {
    heights.contains(&1) && heights.contains(&-1)
}

/// The corner that is alone on its side, of some on both sides.
fn alone(heights: &[Sign; 3]) -> usize {
    let alone = |k: &usize| heights.iter().filter(|h| **h == heights[*k]).count() == 1;
    (0..3).filter(|k| heights[*k] != 0).find(alone).unwrap_or(0)
}
