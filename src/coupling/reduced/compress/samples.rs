//! Points around a body, at given distances from its surface, and inside it.

use crate::adjoint::lie::Vec3;
pub(super) use crate::geometry::Ball;
use crate::geometry::{Edge, Interior};
use rayon::prelude::*;
use std::collections::HashMap;

/// Bend of the surface, rad, from which an edge is sharp.
const SHARP: f64 = 0.6;

/// A point of the surface with a direction into the fluid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub point: Vec3,
    pub normal: Vec3,
    /// A face that it lies on.
    face: usize,
}

/// Points of the surface no farther apart than about `spacing`; at sharp edges and corners with
/// directions between the faces' normals.
pub(super) fn surface_points(surface: &Interior, spacing: f64) -> Vec<Sample> {
    let mut out = Vec::new();
    let mut add = |point: Vec3, normal: Vec3, face: usize| {
        out.push(Sample {
            point,
            normal,
            face,
        });
    };
    let normals = &surface.faces.normals;
    let smooth = |v: usize, f: usize| {
        let n = &surface.vertex_normals[v];
        (n.dot(&normals[f]) > SHARP.cos()).then_some(*n)
    };
    let faces = surface.mesh.faces();
    // In the order of their second faces, and along each of these.
    let mut ridges: Vec<(usize, usize, Edge)> = (surface.mesh.sharp_edges(SHARP).into_iter())
        .map(|e| {
            let [second, from] = [e.faces[1], e.vertices[1]];
            let corner = faces[second].iter().position(|v| *v == from);
            (second, corner.unwrap_or(0), e)
        })
        .collect();
    ridges.sort_unstable_by_key(|(face, corner, _)| (*face, *corner));
    for (v, normal) in surface.vertex_normals.iter().enumerate() {
        let point = surface.mesh.vertices()[v];
        let face = faces.iter().position(|t| t.contains(&v));
        if let Some(face) = face {
            add(point, *normal, face);
        }
    }
    for (face, _, Edge { vertices, faces }) in ridges {
        let [b, a] = vertices.map(|v| surface.mesh.vertices()[v]);
        let normal = (normals[faces[0]] + normals[faces[1]]).normalize();
        let n = ((b - a).norm() / spacing).ceil() as usize;
        for i in 1..n {
            add(a + (b - a) * (i as f64 / n as f64), normal, face);
        }
    }
    for (face, t) in faces.iter().enumerate() {
        let c = &surface.faces.corners[face];
        let longest = (0..3).map(|k| (c[(k + 1) % 3] - c[k]).norm());
        let longest = longest.fold(0.0, f64::max);
        let n = (longest / spacing).ceil().max(1.0) as usize;
        let at = t.map(|v| smooth(v, face).unwrap_or(normals[face]));
        if longest.powi(2) > SLIVER * surface.faces.areas[face] {
            for (point, normal) in halved([c, &at], spacing) {
                add(point, normal, face);
            }
            continue;
        }
        for i in 0..n {
            for j in 0..n - i {
                // Centroids of the upright and of the inverted small triangles.
                for shift in [1.0 / 3.0, 2.0 / 3.0] {
                    if shift > 0.5 && j + i + 1 == n {
                        continue;
                    }
                    let (u, v) = ((i as f64 + shift) / n as f64, (j as f64 + shift) / n as f64);
                    let w = 1.0 - u - v;
                    let normal = (at[0] * w + at[1] * u + at[2] * v).normalize();
                    add(c[0] * w + c[1] * u + c[2] * v, normal, face);
                }
            }
        }
    }
    out
}

/// Square of the longest edge over the area from which a face is a sliver.
const SLIVER: f64 = 40.0;

/// Centroids, and normals there, of what halving the longest edges makes of a triangle (corners and their normals) until none is longer than `spacing`: in a
/// sliver as many as its length asks for, not as its square.
fn halved([corners, normals]: [&[Vec3; 3]; 2], spacing: f64) -> Vec<(Vec3, Vec3)> {
    let mut out = Vec::new();
    let mut left = vec![(*corners, *normals)];
    while let Some((c, n)) = left.pop() {
        let length = |k: usize| (c[(k + 1) % 3] - c[k]).norm();
        let k = (1..3).fold(0, |k, i| if length(i) > length(k) { i } else { k });
        if length(k) <= spacing {
            let normal: Vec3 = n.iter().sum();
            out.push((c.iter().sum::<Vec3>() / 3.0, normal.normalize()));
            continue;
        }
        let (a, b, far) = (k, (k + 1) % 3, (k + 2) % 3);
        let middle = [0.5 * (c[a] + c[b]), 0.5 * (n[a] + n[b])];
        left.push(([c[a], middle[0], c[far]], [n[a], middle[1], n[far]]));
        left.push(([middle[0], c[b], c[far]], [middle[1], n[b], n[far]]));
    }
    out
}

/// Keeps what is at least `spacing` apart, first come first kept; `place` says where.
pub(super) fn thin<T>(
    items: impl IntoIterator<Item = T>,
    spacing: f64,
    place: impl Fn(&T) -> Vec3,
) -> Vec<T> {
    let cell = |p: &Vec3| cell(p, spacing);
    let mut grid: HashMap<[i64; 3], Vec<Vec3>> = HashMap::new();
    let mut out = Vec::new();
    for item in items {
        let p = place(&item);
        let at = cell(&p);
        let near = |n: usize| {
            let beside = [n / 9, n / 3 % 3, n % 3].map(|i| i as i64 - 1);
            let there = grid.get(&[0, 1, 2].map(|k| at[k] + beside[k]));
            there.is_some_and(|n| n.iter().any(|q| (p - q).norm() < spacing))
        };
        if !(0..27).any(near) {
            grid.entry(at).or_default().push(p);
            out.push(item);
        }
    }
    out
}

/// Points in cubic cells.
struct Grid<'a> {
    edge: f64,
    cells: HashMap<[i64; 3], Vec<&'a Vec3>>,
}

impl<'a> Grid<'a> {
    fn new(points: &'a [Vec3], edge: f64) -> Self {
        let mut cells: HashMap<_, Vec<_>> = HashMap::new();
        for p in points {
            cells.entry(cell(p, edge)).or_default().push(p);
        }
        Self { edge, cells }
    }

    /// The points in the cell of `p` and in those around it: all that are within the cells' edge of it.
    fn beside(&self, p: &Vec3) -> impl Iterator<Item = &'a Vec3> {
        let at = cell(p, self.edge);
        let cells = (0..27).filter_map(move |n: usize| {
            let beside = [n / 9, n / 3 % 3, n % 3].map(|i| i as i64 - 1);
            self.cells.get(&[0, 1, 2].map(|k| at[k] + beside[k]))
        });
        cells.flatten().copied()
    }
}

/// The cubic cell that holds a point.
fn cell(p: &Vec3, edge: f64) -> [i64; 3] {
    [0, 1, 2].map(|k| (p[k] / edge).floor() as i64)
}

/// Area of the surface within a ball, m².
pub(super) fn area_within(surface: &Interior, ball: &Ball) -> f64 {
    /// Points across the ball at which it is asked.
    const ACROSS: f64 = 40.0;
    let spacing = 2.0 * ball.radius / ACROSS;
    let mut counts = vec![(0_usize, 0_usize); surface.faces.len()];
    for s in surface_points(surface, spacing) {
        let (all, within) = &mut counts[s.face];
        *all += 1;
        *within += usize::from((s.point - ball.center).norm() <= ball.radius);
    }
    let part = |(f, (all, within)): (usize, &(usize, usize))| {
        surface.faces.areas[f] * *within as f64 / (*all).max(1) as f64
    };
    counts.iter().enumerate().map(part).sum()
}

/// Points at `offset` from the surface, about `spacing` apart; all around or within a ball.
pub(super) fn around(
    surface: &Interior,
    offset: f64,
    spacing: f64,
    ball: Option<&Ball>,
) -> Vec<Vec3> {
    let mut samples = surface_points(surface, 0.5 * spacing);
    if let Some(ball) = ball {
        samples.retain(|s| (s.point - ball.center).norm() <= ball.radius + 3.0 * offset);
    }
    let within = |p: &Vec3| ball.is_none_or(|b| (p - b.center).norm() <= b.radius);
    let moved = samples.iter().map(|s| s.point + s.normal * offset);
    let moved = moved.filter(within);
    let points = thin(moved, spacing, |p| *p);
    // Where the surface is hollow, a point along the normal can come near another part of it.
    let places: Vec<Vec3> = samples.iter().map(|s| s.point).collect();
    let grid = Grid::new(&places, offset);
    let free = |p: &Vec3| {
        let near = |q: &Vec3| (p - q).norm_squared() < (0.8 * offset).powi(2);
        !grid.beside(p).any(near) && surface.winding(p) < 0.5
    };
    points.into_par_iter().filter(free).collect()
}

/// A place for a source, and in a plate the one on its other side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub point: Vec3,
    pub partner: Option<Vec3>,
}

/// How deep under the surface candidates lie, as the body allows, and how far apart relative to that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer {
    pub depth: f64,
    pub spacing: f64,
    /// At most this part of the ball that fits under the surface.
    pub tangent: f64,
    /// What is thinner is a plate.
    pub plate: f64,
}

/// Points inside the surface; all of them or those under the surface within a ball.
pub(super) fn inside(surface: &Interior, layer: Layer, ball: Option<&Ball>) -> Vec<Candidate> {
    let Layer {
        depth,
        spacing,
        tangent,
        plate,
    } = layer;
    let mut all = surface_points(surface, 0.7 * spacing * depth);
    if let Some(ball) = ball {
        all.retain(|s| (s.point - ball.center).norm() <= ball.radius);
    }
    let samples = thin(all, spacing * depth, |s| s.point);
    let mut points: Vec<(Candidate, f64)> = samples
        .par_iter()
        .filter_map(|s| {
            let start = s.point - s.normal * (1e-9 * depth);
            let thickness = surface.ray(&start, &-s.normal, usize::MAX, s.face)?;
            let ball = surface.tangent_ball(&s.point, &s.normal, thickness);
            let d = depth.min(tangent * ball);
            let point = s.point - s.normal * d;
            // What moves across a plate draws in on one side what it gives off on the other.
            let partner = (thickness < plate)
                .then(|| s.point - s.normal * (thickness - d))
                .filter(|p| surface.contains(p));
            surface
                .contains(&point)
                .then_some((Candidate { point, partner }, d))
        })
        .collect();
    // The shallowest of them where the body is thin lie closer together.
    points.sort_by(|a, b| b.1.total_cmp(&a.1));
    points.into_iter().map(|(p, _)| p).collect()
}
