//! Prisms: a convex profile in the y-z plane, extruded along x.
//!
//! One half is meshed, x ≥ 0, and mirrored. Each of its plane sides is a convex polygon; edges are
//! divided first, so that neighbouring sides agree on them. Triangles are somewhat smaller at sharp
//! edges, as on a box, and where the profile has edges shorter than the rest.

use super::Parts;
use super::planar::{Planar, Point};
use crate::error::{Error, Result};
use crate::shape::description::MAX_FACES;
use hydrograd_adjoint::lie::Vec3;
use std::cmp::Ordering;
use std::f64::consts::{PI, TAU};

/// Size of triangles at a sharp edge, as a part of that at the middle of a side.
const EDGE: f64 = 0.6;
/// Angle between sides of the profile, rad, from which a corner is a sharp edge of the prism.
const SHARP: f64 = 0.5;
/// Longest cells beside a narrow side, in its widths.
const STRETCH: f64 = 3.0;
/// Smallest cells beside a narrow side, as a part of those elsewhere.
const FINEST: f64 = 0.3;
/// How fast cells grow away from a narrow side.
const GROWTH: f64 = 0.4;

/// A prism of length `length` (m) along x, centred at x = 0, with about `target` faces. The
/// profile's corners (y, z) are in m.
pub(in crate::shape) fn prism(profile: &[[f64; 2]], length: f64, target: usize) -> Parts {
    // Near one, by a power of two: lengths may be as extreme as their type allows.
    let largest = profile.iter().flatten().fold(length, |m, x| m.max(x.abs()));
    let unit = largest.log2().floor().exp2();
    let mut corners: Vec<Point> = profile.iter().map(|p| Point::from(*p) / unit).collect();
    if signed_area(&corners) < 0.0 {
        corners.reverse();
    }
    let solid = Solid::new(corners, length / unit);
    let target = target.min(MAX_FACES) as f64;
    let even = (solid.area() / target * 4.0 / 3f64.sqrt()).sqrt();
    // Edges alone may need more faces than that, on a body like a needle.
    let mut size = even.max(solid.edges() / target);
    let mut best = (f64::INFINITY, size, Parts::default());
    for attempt in 0..TRIES {
        let parts = solid.mesh(size);
        let count = parts.1.len() as f64;
        let miss = (count / target).ln().abs();
        if miss < best.0 {
            best = (miss, size, parts);
        }
        if miss < CLOSE {
            break;
        }
        // The number of faces jumps a little as the size changes: towards the target first, then
        // around the nearest that was found.
        size = if attempt < TOWARDS {
            size * (count / target).sqrt()
        } else {
            let step = (attempt - TOWARDS) / 2 + 1;
            let sign = if attempt % 2 == 0 { 1.0 } else { -1.0 };
            best.1 * (1.0 + sign * STEP * step as f64)
        };
    }
    let (_, _, (mut vertices, faces)) = best;
    vertices.iter_mut().for_each(|v| *v *= unit);
    (vertices, faces)
}

/// Most meshes made in search of the number of faces, those of them made by its square-root law,
/// and the step of the size in between.
const TRIES: usize = 32;
const TOWARDS: usize = 8;
const STEP: f64 = 0.01;
/// Miss of that number, as a part of it, that ends the search.
const CLOSE: f64 = 0.004;

fn signed_area(corners: &[Point]) -> f64 {
    let origin = corners[0];
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let parts = sides.map(|(a, b)| (a - origin).perp(&(b - origin)));
    parts.sum::<f64>() / 2.0
}

/// The prism, at a size near one.
struct Solid {
    /// Counter-clockwise seen from +x.
    corners: Vec<Point>,
    length: f64,
    sharp: Vec<bool>,
    /// Edges of the profile, `corners[k]` to `corners[k + 1]`.
    widths: Vec<f64>,
    /// Twice the area over the perimeter: between one and two radii of the largest circle in the
    /// profile.
    inradius: f64,
}

/// Numbers of the vertices along a line, with their distances from its start.
type Line = Vec<(usize, f64)>;

/// Where a distance along a line is: x, and (y, z).
type Place<'a> = &'a dyn Fn(f64) -> (f64, Point);

/// Where a point of the surface is.
#[derive(Clone, Copy)]
enum Side {
    /// The end at x = length/2.
    End,
    /// The side at an edge of the profile.
    Edge(usize),
}

impl Solid {
    fn new(corners: Vec<Point>, length: f64) -> Self {
        let n = corners.len();
        let edge = |k: usize| corners[(k + 1) % n] - corners[k % n];
        let widths: Vec<f64> = (0..n).map(|k| edge(k).norm()).collect();
        let perimeter: f64 = widths.iter().sum();
        Self {
            sharp: (0..n)
                .map(|k| angle(&edge(k + n - 1), &edge(k)) > SHARP)
                .collect(),
            inradius: 2.0 * signed_area(&corners) / perimeter,
            widths,
            corners,
            length,
        }
    }

    fn area(&self) -> f64 {
        2.0 * signed_area(&self.corners) + self.length * self.widths.iter().sum::<f64>()
    }

    /// Length of all edges.
    fn edges(&self) -> f64 {
        2.0 * self.widths.iter().sum::<f64>() + self.corners.len() as f64 * self.length
    }

    fn next(&self, k: usize) -> usize {
        (k + 1) % self.corners.len()
    }

    /// Point of the profile at a distance along an edge.
    fn along(&self, k: usize, u: f64) -> Point {
        let (a, b) = (self.corners[k], self.corners[self.next(k)]);
        a + (b - a) * (u / self.widths[k])
    }

    /// Distance from an edge of the profile.
    fn distance(&self, k: usize, p: &Point) -> f64 {
        let (a, b) = (self.corners[k], self.corners[self.next(k)]);
        let along = ((p - a).dot(&(b - a)) / self.widths[k].powi(2)).clamp(0.0, 1.0);
        (p - a - (b - a) * along).norm()
    }

    /// Edge length wanted at a point `p` of the end (y, z), or of a side (distance along its edge, x),
    /// where triangles far from edges are to be of this `size`.
    fn size(&self, side: Side, p: &Point, size: f64) -> f64 {
        let n = self.corners.len();
        let (profile, edge) = match side {
            Side::End => {
                let all = (0..n).map(|k| self.distance(k, p));
                (*p, all.fold(f64::INFINITY, f64::min))
            }
            Side::Edge(k) => {
                let mut edge = self.length / 2.0 - p.y;
                if self.sharp[k] {
                    edge = edge.min(p.x);
                }
                if self.sharp[self.next(k)] {
                    edge = edge.min(self.widths[k] - p.x);
                }
                (self.along(k, p.x), edge)
            }
        };
        let depth = self.inradius.min(self.length / 2.0);
        let graded = EDGE + (1.0 - EDGE) * (edge / depth).clamp(0.0, 1.0);
        let narrow = |width: f64| (STRETCH * width).max(FINEST * size);
        let mut out = (graded * size).min(narrow(2.0 * depth));
        for k in 0..n {
            let least = narrow(self.widths[k]);
            if least < out {
                out = out.min(least + GROWTH * self.distance(k, &profile));
            }
        }
        out
    }

    /// Mesh with cells of about this size.
    fn mesh(&self, size: f64) -> Parts {
        let n = self.corners.len();
        let half = self.length / 2.0;
        let mut vertices: Vec<Vec3> = Vec::new();
        let mut push = |x: f64, p: Point| {
            vertices.push(Vec3::new(x, p.x, p.y));
            vertices.len() - 1
        };
        let at = |k: usize, u: f64, x: f64| self.size(Side::Edge(k), &Point::new(u, x), size);
        // Lines around the end and around the middle, and the edges between them: vertex numbers with
        // the distances along.
        let top: Vec<usize> = self.corners.iter().map(|p| push(half, *p)).collect();
        let bottom: Vec<usize> = self.corners.iter().map(|p| push(0.0, *p)).collect();
        let mut line = |ends: [usize; 2], length: f64, size: &dyn Fn(f64) -> f64, place: Place| {
            let mut out = vec![(ends[0], 0.0)];
            for u in divide(length, size) {
                let (x, p) = place(u);
                out.push((push(x, p), u));
            }
            out.push((ends[1], length));
            out
        };
        let mut around = |x: f64, ends: &[usize]| -> Vec<Line> {
            let side = |k: usize| {
                let (ends, width) = ([ends[k], ends[self.next(k)]], self.widths[k]);
                line(ends, width, &|u| at(k, u, x), &|u| (x, self.along(k, u)))
            };
            (0..n).map(side).collect()
        };
        let tops = around(half, &top);
        let bottoms = around(0.0, &bottom);
        let rail = |k: usize| {
            let ends = [bottom[k], top[k]];
            line(ends, half, &|x| at(k, 0.0, x), &|x| (x, self.corners[k]))
        };
        let rails: Vec<Line> = (0..n).map(rail).collect();

        let mut faces: Vec<[usize; 3]> = Vec::new();
        let mut fill = |vertices: &mut Vec<Vec3>,
                        side: Side,
                        chains: Vec<Vec<(usize, Point)>>,
                        place: &dyn Fn(&Point) -> Vec3| {
            let (mut ids, mut points, mut corners) = (Vec::new(), Vec::new(), Vec::new());
            for chain in chains {
                corners.push(points.len());
                let open = &chain[..chain.len() - 1];
                ids.extend(open.iter().map(|c| c.0));
                points.extend(open.iter().map(|c| c.1));
            }
            let count = points.len();
            let planar = Planar::new(points, &corners, |p| self.size(side, p, size));
            for p in &planar.points[count..] {
                ids.push(vertices.len());
                vertices.push(place(p));
            }
            faces.extend(planar.triangles.iter().map(|f| f.map(|v| ids[v])));
        };
        let end = tops
            .iter()
            .enumerate()
            .map(|(k, line)| line.iter().map(|&(v, u)| (v, self.along(k, u))).collect())
            .collect();
        fill(&mut vertices, Side::End, end, &|p| {
            Vec3::new(half, p.x, p.y)
        });
        for k in 0..n {
            let width = self.widths[k];
            let flat = |&(v, u): &(usize, f64), x: f64| (v, Point::new(u, x));
            let rail = |&(v, x): &(usize, f64), u: f64| (v, Point::new(u, x));
            let next = &rails[self.next(k)];
            let chains = vec![
                bottoms[k].iter().map(|p| flat(p, 0.0)).collect(),
                next.iter().map(|p| rail(p, width)).collect(),
                tops[k].iter().rev().map(|p| flat(p, half)).collect(),
                rails[k].iter().rev().map(|p| rail(p, 0.0)).collect(),
            ];
            fill(&mut vertices, Side::Edge(k), chains, &|p| {
                let q = self.along(k, p.x);
                Vec3::new(p.y, q.x, q.y)
            });
        }
        mirror(vertices, faces)
    }
}

/// The surface with its mirror image in x; vertices at x = 0 belong to both.
fn mirror(mut vertices: Vec<Vec3>, mut faces: Vec<[usize; 3]>) -> Parts {
    let image: Vec<usize> = (0..vertices.len())
        .map(|v| {
            let p = vertices[v];
            if p.x == 0.0 {
                return v;
            }
            vertices.push(Vec3::new(-p.x, p.y, p.z));
            vertices.len() - 1
        })
        .collect();
    for f in 0..faces.len() {
        let [a, b, c] = faces[f].map(|v| image[v]);
        faces.push([a, c, b]);
    }
    (vertices, faces)
}

/// Where a line of this length is cut so that its parts are about of the size wanted there: the
/// distances from its start.
fn divide(length: f64, size: impl Fn(f64) -> f64) -> Vec<f64> {
    // Number of cells up to each of many steps.
    const STEPS: usize = 256;
    let step = length / STEPS as f64;
    let mut passed = vec![0.0];
    for i in 0..STEPS {
        let middle = step * (i as f64 + 0.5);
        passed.push(passed[i] + step / size(middle));
    }
    let cells = passed[STEPS].round().max(1.0) as usize;
    let mut at = 0;
    (1..cells)
        .map(|i| {
            let wanted = passed[STEPS] * i as f64 / cells as f64;
            while passed[at + 1] < wanted {
                at += 1;
            }
            let within = (wanted - passed[at]) / (passed[at + 1] - passed[at]);
            step * (at as f64 + within)
        })
        .collect()
}

/// Angle from one direction to the next, rad, −π to π.
fn angle(a: &Point, b: &Point) -> f64 {
    a.perp(b).atan2(a.dot(b))
}

/// Least angle of a corner, rad, and least part that an edge is of the longest.
const LEAST: f64 = 1e-9;

/// Whether a profile can be: finite corners of a convex polygon without crossings, in either
/// order. `place` begins the message.
///
/// # Errors
/// [`Error::Input`] naming the corner.
pub(in crate::shape) fn check_profile(profile: &[[f64; 2]], place: &str) -> Result<()> {
    let corner = |k: usize, remedy: &str| {
        let place = format!("{place}: profile[{k}]");
        Err(Error::input(place, format!("{:?}", profile[k]), remedy))
    };
    let n = profile.len();
    if n < 3 {
        return Err(Error::input(
            format!("{place}: profile"),
            format!("{n} corners"),
            "give three corners [y, z] or more, in m, around the profile",
        ));
    }
    let sized = |x: f64| x.is_finite() && x.abs() <= 1e30;
    if let Some(k) = profile.iter().position(|p| !p.iter().all(|x| sized(*x))) {
        return corner(k, "give finite coordinates [y, z] in metres");
    }
    let all = profile.iter().flatten();
    let largest = all.fold(0.0_f64, |m, x| m.max(x.abs()));
    if largest < 1e-30 {
        return corner(0, "all corners are at the origin: give them in metres");
    }
    let corners: Vec<Point> = profile.iter().map(|p| Point::from(*p) / largest).collect();
    let edge = |k: usize| corners[(k + 1) % n] - corners[k % n];
    let longest = (0..n).map(|k| edge(k).norm()).fold(0.0, f64::max);
    if let Some(k) = (0..n).find(|&k| edge(k).norm() <= LEAST * longest) {
        let remedy = format!("it is the same as profile[{k}]: give each corner once");
        return corner((k + 1) % n, &remedy);
    }
    let angles: Vec<f64> = (0..n).map(|k| angle(&edge(k + n - 1), &edge(k))).collect();
    if let Some(k) = angles.iter().position(|t| t.abs() <= LEAST) {
        return corner(
            k,
            "it lies on the line between its neighbours: leave it out",
        );
    }
    if let Some(k) = angles.iter().position(|t| PI - t.abs() <= LEAST) {
        return corner(k, "the profile turns back on itself there: give it an area");
    }
    // The way that most corners turn is right; the others are dents.
    let left = angles.iter().filter(|t| **t > 0.0).count();
    let way = match (2 * left).cmp(&n) {
        Ordering::Equal => angles.iter().sum::<f64>().signum(),
        Ordering::Greater => 1.0,
        Ordering::Less => -1.0,
    };
    if let Some(k) = angles.iter().position(|t| t * way < 0.0) {
        let remedy = "the profile bends inwards or crosses itself there, and must be convex: correct \
             the corner, or build the body from several convex ones";
        return corner(k, remedy);
    }
    // Once around and no more; the first corner at which it has gone farther.
    let mut sum = 0.0;
    for (k, t) in angles.iter().enumerate() {
        sum += t.abs();
        if sum > TAU + 1e-6 {
            let remedy = "by this corner the profile has gone around more than once, so it crosses \
                 itself: give the corners in their order around it";
            return corner(k, remedy);
        }
    }
    Ok(())
}
