//! Triangles in a convex polygon, near-equilateral, of a size that may vary: a Delaunay
//! triangulation of given boundary points, refined at the centres of the largest circumcircles and
//! smoothed.
//!
//! # References
//! C. L. Lawson, "Software for C¹ surface interpolation", in Mathematical Software III (1977):
//! flips. L. P. Chew, "Guaranteed-quality mesh generation for curved surfaces", SoCG (1993):
//! refinement at circumcentres.

use nalgebra::Vector2;
use std::collections::{BinaryHeap, HashMap};

pub(super) type Point = Vector2<f64>;

/// Circumradius, in target edges, from which a triangle is split; 0.58 is an equilateral one's.
const SPLIT: f64 = 0.75;
/// Least distance of an inner point from the boundary, in target edges.
const MARGIN: f64 = 0.5;
/// Rounds of smoothing after each refinement.
const ROUNDS: usize = 6;
/// What counts as zero beside products of edges.
const ROUNDING: f64 = 1e-12;
/// No neighbour: the boundary.
const NONE: usize = usize::MAX;

/// A polygon's triangles: its boundary points first, then those inside.
pub(super) struct Planar {
    pub points: Vec<Point>,
    pub triangles: Vec<[usize; 3]>,
    /// Across the edge opposite to each corner.
    neighbors: Vec<[usize; 3]>,
    /// How many points lie on the boundary.
    boundary: usize,
}

/// Twice the signed area.
fn cross(a: &Point, b: &Point, c: &Point) -> f64 {
    (b - a).perp(&(c - a))
}

impl Planar {
    /// Triangles in a convex polygon with the points `boundary` on it, counter-clockwise, of which
    /// `corners` (at least three, ascending) are its corners; edges about `size` long.
    pub fn new(boundary: Vec<Point>, corners: &[usize], size: impl Fn(&Point) -> f64) -> Self {
        let sides: Vec<(Point, Point)> = (0..corners.len())
            .map(|k| {
                let (from, to) = (corners[k], corners[(k + 1) % corners.len()]);
                let along = (boundary[to] - boundary[from]).normalize();
                (boundary[from], Point::new(-along.y, along.x))
            })
            .collect();
        let inside = |p: &Point, margin: f64| {
            sides
                .iter()
                .all(|(from, inward)| (p - from).dot(inward) >= margin)
        };
        let triangles = zip(&boundary, corners);
        let mut out = Self {
            neighbors: adjacency(&triangles),
            boundary: boundary.len(),
            points: boundary,
            triangles,
        };
        out.flip_all();
        // Twice: smoothing makes room.
        for _ in 0..2 {
            out.refine(&size, &inside);
            for _ in 0..ROUNDS {
                out.smooth(&size);
                out.flip_all();
            }
        }
        out
    }

    fn corners(&self, t: usize) -> [Point; 3] {
        self.triangles[t].map(|v| self.points[v])
    }

    /// Splits triangles, the largest first, until all are of the size wanted.
    fn refine(&mut self, size: &impl Fn(&Point) -> f64, inside: &impl Fn(&Point, f64) -> bool) {
        // Bits of positive numbers sort as the numbers do.
        let ask = |this: &Self, t: usize| {
            let center = circumcenter(&this.corners(t))?;
            let h = size(&center);
            let ratio = (center - this.points[this.triangles[t][0]]).norm() / h;
            let wanted = ratio > SPLIT && inside(&center, MARGIN * h);
            wanted.then(|| (ratio.to_bits(), t, this.triangles[t]))
        };
        let mut waiting: BinaryHeap<_> = (0..self.triangles.len())
            .filter_map(|t| ask(self, t))
            .collect();
        while let Some((_, t, corners)) = waiting.pop() {
            if self.triangles[t] != corners {
                continue;
            }
            let Some(center) = circumcenter(&self.corners(t)) else {
                continue;
            };
            let Some(home) = self.locate(t, &center) else {
                continue;
            };
            for t in self.insert(center, home) {
                waiting.extend(ask(self, t));
            }
        }
    }

    /// The triangle that holds `p`, by a walk from `t`.
    fn locate(&self, mut t: usize, p: &Point) -> Option<usize> {
        for _ in 0..=self.triangles.len() {
            let c = self.corners(t);
            let out = (0..3).find(|&i| {
                let (a, b) = (&c[(i + 1) % 3], &c[(i + 2) % 3]);
                cross(a, b, p) < -ROUNDING * (b - a).norm_squared()
            });
            match out {
                None => return Some(t),
                Some(i) if self.neighbors[t][i] == NONE => return None,
                Some(i) => t = self.neighbors[t][i],
            }
        }
        None
    }

    /// Adds a point inside triangle `t`; what stands around it afterwards.
    fn insert(&mut self, p: Point, t: usize) -> Vec<usize> {
        let v = self.points.len();
        self.points.push(p);
        let [a, b, c] = self.triangles[t];
        let [na, nb, nc] = self.neighbors[t];
        let (second, third) = (self.triangles.len(), self.triangles.len() + 1);
        self.triangles[t] = [v, b, c];
        self.neighbors[t] = [na, second, third];
        self.triangles.push([a, v, c]);
        self.neighbors.push([t, nb, third]);
        self.triangles.push([a, b, v]);
        self.neighbors.push([t, second, nc]);
        self.replace_neighbor(nb, t, second);
        self.replace_neighbor(nc, t, third);
        let mut around = Vec::new();
        let mut suspects = vec![t, second, third];
        while let Some(t) = suspects.pop() {
            let Some(at) = self.triangles[t].iter().position(|&c| c == v) else {
                continue;
            };
            match self.flip_if_better(t, at) {
                Some(other) => suspects.extend([t, other]),
                None => around.push(t),
            }
        }
        around.sort_unstable();
        around.dedup();
        around
    }

    fn replace_neighbor(&mut self, t: usize, old: usize, new: usize) {
        if t != NONE
            && let Some(n) = self.neighbors[t].iter_mut().find(|n| **n == old)
        {
            *n = new;
        }
    }

    /// Flips the edge opposite to corner `i` of triangle `t` if the angles across it add up to more
    /// than π: the other triangle.
    fn flip_if_better(&mut self, t: usize, i: usize) -> Option<usize> {
        let o = self.neighbors[t][i];
        if o == NONE {
            return None;
        }
        let j = self.neighbors[o].iter().position(|&n| n == t)?;
        let (c, a, b) = {
            let f = self.triangles[t];
            (f[i], f[(i + 1) % 3], f[(i + 2) % 3])
        };
        let d = self.triangles[o][j];
        let [pa, pb, pc, pd] = [a, b, c, d].map(|v| self.points[v]);
        let (ca, cb, da, db) = (pa - pc, pb - pc, pa - pd, pb - pd);
        // sin(γ + δ) times the four lengths.
        let sine = ca.perp(&cb) * da.dot(&db) - ca.dot(&cb) * da.perp(&db);
        let scale = ca.norm() * cb.norm() * da.norm() * db.norm();
        let convex = cross(&pc, &pa, &pd) > 0.0 && cross(&pd, &pb, &pc) > 0.0;
        if sine >= -ROUNDING * scale || !convex {
            return None;
        }
        // t = (c, a, b), o = (d, b, a) become (c, a, d) and (d, b, c).
        let (tb, ta) = (
            self.neighbors[t][(i + 2) % 3],
            self.neighbors[t][(i + 1) % 3],
        );
        let (oa, ob) = (
            self.neighbors[o][(j + 2) % 3],
            self.neighbors[o][(j + 1) % 3],
        );
        // Across (c, a): tb; across (b, c): ta; across (d, b): oa; across (a, d): ob.
        self.triangles[t] = [c, a, d];
        self.neighbors[t] = [ob, o, tb];
        self.triangles[o] = [d, b, c];
        self.neighbors[o] = [ta, t, oa];
        self.replace_neighbor(ob, o, t);
        self.replace_neighbor(ta, t, o);
        Some(o)
    }

    /// Flips until no flip is better.
    fn flip_all(&mut self) {
        let mut suspects: Vec<usize> = (0..self.triangles.len()).rev().collect();
        // More than it takes; rounding could go round in circles on a polygon like a thread.
        let mut left = 1000 * self.triangles.len();
        while let Some(t) = suspects.pop() {
            left -= 1;
            if left == 0 {
                return;
            }
            if let Some(other) = (0..3).find_map(|i| self.flip_if_better(t, i)) {
                suspects.extend([other, t]);
            }
        }
    }

    /// Moves each inner point to the centre of the triangles around it, weighed by their areas in
    /// squares of the size wanted there.
    fn smooth(&mut self, size: &impl Fn(&Point) -> f64) {
        let mut around = vec![Vec::new(); self.points.len()];
        for (t, f) in self.triangles.iter().enumerate() {
            f.iter().for_each(|&v| around[v].push(t));
        }
        for (v, around) in around.iter().enumerate().skip(self.boundary) {
            let (mut sum, mut weight) = (Point::zeros(), 0.0);
            for &t in around {
                let [a, b, c] = self.corners(t);
                let center = (a + b + c) / 3.0;
                let w = cross(&a, &b, &c) / size(&center).powi(2);
                sum += center * w;
                weight += w;
            }
            let old = std::mem::replace(&mut self.points[v], sum / weight);
            // The star of a point isn't always convex.
            let good = around.iter().all(|&t| {
                let [a, b, c] = self.corners(t);
                let longest = (b - a).norm_squared().max((c - b).norm_squared());
                cross(&a, &b, &c) > 0.1 * longest.max((a - c).norm_squared())
            });
            if !good {
                self.points[v] = old;
            }
        }
    }
}

/// Centre of the circle through three points; none if they lie on a line.
fn circumcenter([a, b, c]: &[Point; 3]) -> Option<Point> {
    let (u, v) = (b - a, c - a);
    let area = 2.0 * u.perp(&v);
    let (uu, vv) = (u.norm_squared(), v.norm_squared());
    let offset = Point::new(v.y * uu - u.y * vv, u.x * vv - v.x * uu) / area;
    offset.iter().all(|x| x.is_finite()).then(|| a + offset)
}

/// Triangles between two chains of boundary points, from one corner to the farthest other that has
/// points between on both sides.
fn zip(points: &[Point], corners: &[usize]) -> Vec<[usize; 3]> {
    let n = points.len();
    if n == 3 {
        return vec![[0, 1, 2]];
    }
    let pairs = corners
        .iter()
        .enumerate()
        .flat_map(|(k, &i)| corners[k + 1..].iter().map(move |&j| (i, j)))
        .filter(|(i, j)| j - i > 1 && i + n - j > 1);
    let distance = |(i, j): &(usize, usize)| (points[*i] - points[*j]).norm_squared();
    let farthest = pairs.max_by(|p, q| distance(p).total_cmp(&distance(q)));
    let (start, end) = farthest.unwrap_or((0, n / 2));
    let (right, left) = (end - start, start + n - end);
    // Points of the chains, both from start to end.
    let a = |i: usize| (start + i) % n;
    let b = |j: usize| (start + n - j) % n;
    let gap = |p: usize, q: usize| distance(&(p, q));
    let mut out = vec![[start, a(1), b(1)]];
    let (mut i, mut j) = (1, 1);
    while i + 1 < right || j + 1 < left {
        let last = j + 1 == left;
        if last || i + 1 < right && gap(a(i + 1), b(j)) <= gap(a(i), b(j + 1)) {
            out.push([a(i), a(i + 1), b(j)]);
            i += 1;
        } else {
            out.push([a(i), b(j + 1), b(j)]);
            j += 1;
        }
    }
    out.push([a(i), end, b(j)]);
    out
}

/// Across each edge, opposite to its corner.
fn adjacency(triangles: &[[usize; 3]]) -> Vec<[usize; 3]> {
    let mut edges = HashMap::with_capacity(3 * triangles.len());
    for (t, f) in triangles.iter().enumerate() {
        for i in 0..3 {
            edges.insert((f[(i + 1) % 3], f[(i + 2) % 3]), t);
        }
    }
    let across = |f: &[usize; 3], i: usize| edges.get(&(f[(i + 2) % 3], f[(i + 1) % 3]));
    triangles
        .iter()
        .map(|f| [0, 1, 2].map(|i| across(f, i).copied().unwrap_or(NONE)))
        .collect()
}
