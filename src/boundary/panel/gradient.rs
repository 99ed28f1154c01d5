//! The gradient along the surface of a potential that is known at the panels' centroids, and what its square is worth.
//!
//! Where the surface is smooth a quadratic function of the coordinates in the panel's plane is fitted to the potentials of the panels that share a vertex
//! with it, nearer ones with more weight; its slope at the centroid is of second order in the edges.
//!
//! At a sharp edge, around which the surface turns by θ, the flow is φ = c ± A r^λ with λ = π/(π + θ) and opposite signs on both sides: the velocity has no bound, but
//! its means over panels have. At the edge itself the potential is the mean of what both sides tell, c, and the gradient
//! of a panel that touches it is that of the linear function between its corners: the panel's mean. The square's mean is larger than that of the mean,
//! over a triangle with a side on the edge, for the part of the velocity across it,
//!
//! ```text
//! ∫ r^(2λ−2) / A = 1/(λ (2λ − 1)),   ∫ r^(λ−1) / A = 2/(λ (λ + 1))       of the height 1
//! κ = λ (λ + 1)² / (4 (2λ − 1))                                             1.39 where θ is a right angle
//! ```
//!
//! # References
//! H. Lamb, Hydrodynamics (1932), art. 63 (flow around a corner).

use super::{PanelBoundary, SHARP};
use crate::adjoint::lie::Vec3;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

/// Unknowns of a quadratic function without its constant.
const QUADRATIC: usize = 5;
/// Panels more than unknowns from which a quadratic function is fitted.
const SPARE: usize = 2;
/// Part of the largest singular value under which a direction isn't known.
const KNOWN: f64 = 1e-6;
/// At an edge as sharp as a knife's λ is ½ and the mean square has no bound: it isn't resolved, and taken as for this λ.
const LEAST_EXPONENT: f64 = 0.55;

/// Panels, and what each adds.
type Row<T> = Vec<(usize, T)>;

/// How gradients and their squares follow from potentials.
#[derive(Clone, Debug)]
pub(super) struct Slopes {
    /// Of each panel: other panels, and what a difference to their potential adds to the gradient, 1/m.
    rows: Vec<Row<Vec3>>,
    /// Panels with a side on a sharp edge, the direction across it in the panel, and κ − 1.
    edges: Vec<(usize, Vec3, f64)>,
    /// Panels with a corner on one.
    sharp: Vec<bool>,
}

impl PanelBoundary {
    /// ∇_s φ at the centroids, the mean over the panel at sharp edges, for the panels' potentials `phi` (m²/s): m/s, body frame.
    pub(crate) fn surface_gradient(&self, phi: &[f64]) -> Vec<Vec3> {
        let each = self.slopes().rows.iter().zip(phi);
        each.map(|(row, here)| row.iter().map(|(k, w)| w * (phi[*k] - here)).sum())
            .collect()
    }

    /// Means of the squares of velocities whose means over panels are these: m²/s².
    pub(crate) fn mean_squares(&self, velocities: &[Vec3]) -> Vec<f64> {
        let mut out: Vec<f64> = velocities.iter().map(Vec3::norm_squared).collect();
        for (face, across, more) in &self.slopes().edges {
            out[*face] += more * velocities[*face].dot(across).powi(2);
        }
        out
    }

    /// Whether a sharp edge ends at a corner of this panel.
    pub(crate) fn at_sharp_edge(&self, face: usize) -> bool {
        self.slopes().sharp.get(face).is_some_and(|sharp| *sharp)
    }

    /// Panels with a side on a sharp edge, the direction across it in the panel, and by how much the mean of a product of two velocities across it is larger
    /// than that of their means, relatively.
    pub(super) fn steep(&self) -> &[(usize, Vec3, f64)] {
        &self.slopes().edges
    }

    fn slopes(&self) -> &Slopes {
        self.slopes.get_or_init(|| Around::new(self).slopes())
    }
}

/// The panels around each vertex.
struct Around<'b> {
    body: &'b PanelBoundary,
    faces: Vec<Vec<usize>>,
    /// Whether a sharp edge ends there.
    sharp: Vec<bool>,
    /// See [`Slopes`].
    edges: Vec<(usize, Vec3, f64)>,
}

impl<'b> Around<'b> {
    fn new(body: &'b PanelBoundary) -> Self {
        let corners = body.panels.corners();
        let mut faces: Vec<Vec<usize>> = vec![Vec::new(); body.panels.vertices().len()];
        for (face, corners) in corners.iter().enumerate() {
            for v in corners {
                faces[*v as usize].push(face);
            }
        }
        let mut out = Self {
            body,
            sharp: vec![false; faces.len()],
            edges: Vec::new(),
            faces,
        };
        out.find_edges();
        out
    }

    fn find_edges(&mut self) {
        let (body, normals) = (self.body, &self.body.faces.normals);
        for (face, corners) in body.panels.corners().iter().enumerate() {
            for k in 0..3 {
                let [a, b] = [corners[k] as usize, corners[(k + 1) % 3] as usize];
                let mut beyond = self.faces[a].iter().copied();
                let Some(other) = beyond.find(|f| *f != face && self.faces[b].contains(f)) else {
                    continue;
                };
                if self.alike(face, other) {
                    continue;
                }
                (self.sharp[a], self.sharp[b]) = (true, true);
                let vertices = body.panels.vertices();
                let along = (vertices[b] - vertices[a]).normalize();
                let across = along.cross(&normals[face]);
                // `across` points out of the panel: the other one lies behind it where the edge is convex.
                if across.dot(&normals[other]) > 0.0 {
                    let turn = normals[face].dot(&normals[other]).clamp(-1.0, 1.0).acos();
                    let exponent = (PI / (PI + turn)).max(LEAST_EXPONENT);
                    let more = exponent * (exponent + 1.0).powi(2) / (4.0 * (2.0 * exponent - 1.0));
                    self.edges.push((face, across, more - 1.0));
                }
            }
        }
    }

    /// Whether there is no sharp edge between two panels, by their normals.
    fn alike(&self, a: usize, b: usize) -> bool {
        let normals = &self.body.faces.normals;
        normals[a].dot(&normals[b]) > SHARP.cos()
    }

    fn slopes(self) -> Slopes {
        let corners = self.body.panels.corners().iter();
        let corners: Vec<[usize; 3]> = corners.map(|c| c.map(|v| v as usize)).collect();
        let touches = |corners: &[usize; 3]| corners.iter().any(|v| self.sharp[*v]);
        let sharp: Vec<bool> = corners.iter().map(touches).collect();
        let of = |(face, corners): (usize, &[usize; 3])| match sharp[face] {
            true => self.between_corners(face, *corners),
            false => self.fitted(face, *corners),
        };
        Slopes {
            rows: corners.iter().enumerate().map(of).collect(),
            edges: self.edges,
            sharp,
        }
    }

    /// By a quadratic function; by a linear one where too few panels are left.
    fn fitted(&self, face: usize, corners: [usize; 3]) -> Row<Vec3> {
        let all = corners.iter().flat_map(|v| self.faces[*v].iter().copied());
        let mut near: Vec<usize> = all.filter(|k| *k != face && self.alike(face, *k)).collect();
        near.sort_unstable();
        near.dedup();
        let faces = &self.body.faces;
        let normal = &faces.normals[face];
        let [a, b, _] = faces.corners[face];
        let along = (b - a).normalize();
        let across = normal.cross(&along);
        let arms: Vec<Vec3> = (near.iter())
            .map(|k| faces.centres[*k] - faces.centres[face])
            .collect();
        // In units of the farthest, so that all unknowns are of one size.
        let size = arms.iter().map(Vec3::norm).fold(0.0, f64::max);
        let unknowns = match near.len() >= QUADRATIC + SPARE {
            true => QUADRATIC,
            false => 2,
        };
        let mut fit = DMatrix::zeros(near.len(), unknowns);
        let mut weights = DVector::zeros(near.len());
        for (row, arm) in arms.iter().enumerate() {
            let (x, y) = (arm.dot(&along) / size, arm.dot(&across) / size);
            weights[row] = size / arm.norm();
            let terms = [x, y, x * x, x * y, y * y];
            for (column, term) in terms.iter().take(unknowns).enumerate() {
                fit[(row, column)] = weights[row] * term;
            }
        }
        let Some(inverse) = inverse(fit) else {
            return self.between_corners(face, corners);
        };
        let weight = |row: usize| {
            let [x, y] = [0, 1].map(|c| inverse[(c, row)] * weights[row] / size);
            x * along + y * across
        };
        (near.iter().enumerate())
            .map(|(row, k)| (*k, weight(row)))
            .collect()
    }

    /// Of the linear function between the corners' potentials.
    fn between_corners(&self, face: usize, corners: [usize; 3]) -> Row<Vec3> {
        let faces = &self.body.faces;
        let (normal, area) = (&faces.normals[face], faces.areas[face]);
        let at = faces.corners[face];
        let mut out: Row<Vec3> = Row::new();
        for (k, v) in corners.iter().enumerate() {
            let opposite = at[(k + 2) % 3] - at[(k + 1) % 3];
            let slope = normal.cross(&opposite) / (2.0 * area);
            for (other, weight) in self.at_vertex(face, *v) {
                out.push((other, slope * weight));
            }
        }
        out
    }

    /// The potential at a vertex: of the panels around it that belong together the value of a linear function, and where sharp edges part them the mean of those.
    fn at_vertex(&self, face: usize, vertex: usize) -> Row<f64> {
        let mut left: Vec<usize> = self.faces[vertex].clone();
        if !self.sharp[vertex] {
            left.retain(|k| self.alike(face, *k));
        }
        let mut patches: Vec<Vec<usize>> = Vec::new();
        while let Some(first) = left.first().copied() {
            let (patch, others) = left.iter().partition(|k| self.alike(first, **k));
            left = others;
            patches.push(patch);
        }
        let share = 1.0 / patches.len() as f64;
        let rows = patches
            .iter()
            .flat_map(|patch| self.in_patch(patch, vertex));
        rows.map(|(k, w)| (k, share * w)).collect()
    }

    fn in_patch(&self, patch: &[usize], vertex: usize) -> Row<f64> {
        let mean = || {
            patch
                .iter()
                .map(|k| (*k, 1.0 / patch.len() as f64))
                .collect()
        };
        if patch.len() < 3 {
            return mean();
        }
        let faces = &self.body.faces;
        let here = self.body.panels.vertices()[vertex];
        let arms: Vec<Vec3> = patch.iter().map(|k| faces.centres[*k] - here).collect();
        let normal: Vec3 = patch.iter().map(|k| faces.normals[*k]).sum();
        let along = (arms[0] - normal * (normal.dot(&arms[0]) / normal.norm_squared())).normalize();
        let across = normal.normalize().cross(&along);
        let size = arms.iter().map(Vec3::norm).fold(0.0, f64::max);
        let terms = |row: usize, column: usize| match column {
            0 => 1.0,
            1 => arms[row].dot(&along) / size,
            _ => arms[row].dot(&across) / size,
        };
        match inverse(DMatrix::from_fn(patch.len(), 3, terms)) {
            Some(inverse) => (patch.iter().enumerate())
                .map(|(row, k)| (*k, inverse[(0, row)]))
                .collect(),
            None => mean(),
        }
    }
}

/// The pseudo-inverse, of what is known.
fn inverse(fit: DMatrix<f64>) -> Option<DMatrix<f64>> {
    if fit.is_empty() {
        return None;
    }
    let svd = fit.svd(true, true);
    let largest = svd.singular_values.max();
    svd.pseudo_inverse(KNOWN * largest).ok()
}
