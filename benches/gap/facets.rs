//! Bodies with flat facets over a wall, or over their like: facets with constant potentials, graded towards edges and gaps, closed-form integrals.
//!
//! Direct, as in [`super::rings`]: ½φ − ∫ φ ∂G/∂n = −∫ G ∂φ/∂n at the centroids, M = −∮ φ n_z. Of what is symmetric one part has unknowns.

use faer::Mat;
use faer::linalg::solvers::Solve;
use hydrograd::adjoint::lie::{Mat3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// A plane quadrilateral; two of its corners may coincide.
#[derive(Clone)]
pub struct Facet {
    corners: [Vec3; 4],
    normal: Vec3,
    centroid: Vec3,
    area: f64,
}

/// An image of what has unknowns: an orthogonal matrix, and the sign of the potential there.
pub struct Copy {
    pub placed: Mat3,
    pub sign: f64,
}

impl Facet {
    /// With its normal away from a point inside the body.
    pub fn new(mut corners: [Vec3; 4], inside: &Vec3) -> Self {
        let across = |c: &[Vec3; 4]| (c[2] - c[0]).cross(&(c[3] - c[1])) / 2.0;
        let parts = [[0, 1, 2], [0, 2, 3]].map(|t| {
            let [a, b, c] = t.map(|k| corners[k]);
            ((b - a).cross(&(c - a)).norm() / 2.0, (a + b + c) / 3.0)
        });
        let area = parts[0].0 + parts[1].0;
        let centroid = (parts[0].0 * parts[0].1 + parts[1].0 * parts[1].1) / area;
        if across(&corners).dot(&(centroid - inside)) < 0.0 {
            corners.swap(1, 3);
        }
        Self {
            normal: across(&corners).normalize(),
            corners,
            centroid,
            area,
        }
    }

    /// ∫ 1/r and ∫ n·(P − Q)/r³ as seen from P.
    fn seen(&self, at: &Vec3) -> [f64; 2] {
        let from = self.corners.map(|c| c - at);
        let away = from.map(|c| c.norm());
        let height = -self.normal.dot(&from[0]);
        let mut layer = 0.0;
        for i in 0..4 {
            let j = (i + 1) % 4;
            let edge = from[j] - from[i];
            let length = edge.norm();
            if length > 0.0 {
                let inside = edge.cross(&self.normal).dot(&from[i]) / length;
                let both = away[i] + away[j];
                let least = (both - length).max(1e-15 * both);
                layer += inside * ((both + length) / least).ln();
            }
        }
        let angle = |[a, b, c]: [usize; 3]| {
            let over = from[a].dot(&from[b].cross(&from[c]));
            let under = away[a] * away[b] * away[c]
                + from[a].dot(&from[b]) * away[c]
                + from[b].dot(&from[c]) * away[a]
                + from[c].dot(&from[a]) * away[b];
            -2.0 * over.atan2(under)
        };
        let angle = angle([0, 1, 2]) + angle([0, 2, 3]);
        [layer - height * angle, angle]
    }
}

/// Added mass along z of a body at density 1, of which `facets` are a part of `1/parts`; `copies` are all images but itself, of the body's other parts too.
pub fn added_mass(facets: &[Facet], parts: f64, copies: &[Copy]) -> f64 {
    let count = facets.len();
    let rows: Vec<(Vec<f64>, f64)> = (facets.par_iter().enumerate())
        .map(|(i, row)| {
            let images: Vec<(Vec3, f64)> = (copies.iter())
                .map(|copy| (copy.placed.tr_mul(&row.centroid), copy.sign))
                .collect();
            let mut right = 0.0;
            let line = facets.iter().enumerate().map(|(j, facet)| {
                let [mut layer, mut angle] = facet.seen(&row.centroid);
                if i == j {
                    angle = 0.0;
                }
                for (at, sign) in &images {
                    let [l, a] = facet.seen(at);
                    layer += sign * l;
                    angle += sign * a;
                }
                right -= layer * facet.normal.z / (4.0 * PI);
                -angle / (4.0 * PI) + if i == j { 0.5 } else { 0.0 }
            });
            let line = line.collect();
            (line, right)
        })
        .collect();
    let matrix = Mat::from_fn(count, count, |i, j| rows[i].0[j]);
    let right = Mat::from_fn(count, 1, |i, _| rows[i].1);
    let potential = matrix.partial_piv_lu().solve(&right);
    let all = facets.iter().enumerate();
    let push = |(j, f): (usize, &Facet)| potential[(j, 0)] * f.normal.z * f.area;
    -parts * all.map(push).sum::<f64>()
}

/// Nodes from 0 to a length: intervals of `near` at the two ends, growing with the distance from there up to `most`, `level` for each of them.
pub fn graded(length: f64, near: [f64; 2], growth: f64, most: f64, level: usize) -> Vec<f64> {
    const FINE: usize = 4000;
    let size = |s: f64| {
        most.min(near[0] + growth * s)
            .min(near[1] + growth * (length - s))
    };
    // The count of intervals up to each of many points, finer towards the ends.
    let place = |k: usize| {
        let t = k as f64 / FINE as f64;
        length * t * t * (3.0 - 2.0 * t)
    };
    let mut sums = vec![0.0];
    for k in 0..FINE {
        let (a, b) = (place(k), place(k + 1));
        sums.push(sums[k] + (b - a) / size(0.5 * (a + b)));
    }
    let count = sums[FINE].ceil() as usize * level;
    let mut k = 0;
    let inner = (1..count).map(|n| {
        let want = sums[FINE] * n as f64 / count as f64;
        while sums[k + 1] < want {
            k += 1;
        }
        let part = (want - sums[k]) / (sums[k + 1] - sums[k]);
        place(k) + part * (place(k + 1) - place(k))
    });
    let inner: Vec<f64> = inner.collect();
    [0.0].into_iter().chain(inner).chain([length]).collect()
}

/// Facets between the nodes of two parameters of a surface.
pub fn patch([u, v]: [&[f64]; 2], inside: &Vec3, surface: impl Fn(f64, f64) -> Vec3) -> Vec<Facet> {
    let mut out = Vec::new();
    for a in u.windows(2) {
        for b in v.windows(2) {
            let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| surface(a[i], b[j]));
            out.push(Facet::new(corners, inside));
        }
    }
    out
}
