//! The energy from the strengths.
//!
//! `T = ½ ∫ φ f dA`, f the normal velocity that a twist asks for. Strengths α make the normal
//! velocity f_α = f − r, r the residual of least squares. Then `½ ∫ φ_α f` is off by the first order in
//! r, while `½ ∫ φ_α (2f − f_α) = ½ ∫ φ_α (f + r)` is stationary at the solution: off by the
//! second. So the readout's flux is B̄ plus the body's own residual flux, constant in the body frame.
//!
//! ∫ φ over a face: one point, the centre, where sources are at least an edge length away (on a mesh
//! inscribed in a smooth body its error has the sign opposite to that of the missing volume); the
//! three points of degree 2 (barycentric ⅔, ⅙, ⅙) where they are nearer than half; between, both in
//! proportion. Between bodies sources are farther, and the centre does.

use super::settings::Readout;
use crate::adjoint::kernel::{self, Points, Sources};
use crate::adjoint::lie::{Vec3, Vec6};
use crate::geometry::{Faces, equilateral_edge};
use rayon::prelude::*;

/// Distance to the nearest source, in edges, from which one point does, and below which three
/// are taken.
const FAR: f64 = 1.0;
const NEAR: f64 = 0.5;

/// Weighted points of each face.
pub(crate) fn points(faces: &Faces, sources: &[Vec3], rule: Readout) -> Vec<Vec<(Vec3, f64)>> {
    (0..faces.len())
        .into_par_iter()
        .map(|i| {
            let centre = faces.centres[i];
            if rule == Readout::Centre {
                return vec![(centre, 1.0)];
            }
            let near = sources
                .iter()
                .map(|s| distance(s, &faces.corners[i]))
                .fold(f64::INFINITY, f64::min);
            let ratio = near / equilateral_edge(faces.areas[i]);
            let one = ((ratio - NEAR) / (FAR - NEAR)).clamp(0.0, 1.0);
            let mut list = Vec::with_capacity(4);
            if one > 0.0 {
                list.push((centre, one));
            }
            if one < 1.0 {
                let w = (1.0 - one) / 3.0;
                list.extend(faces.corners[i].map(|c| (0.5 * (c + centre), w)));
            }
            list
        })
        .collect()
}

/// Distance from `s` to the nearest of a triangle's corners and centre.
fn distance(s: &Vec3, corners: &[Vec3; 3]) -> f64 {
    let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
    corners
        .iter()
        .map(|c| (c - s).norm())
        .fold((centre - s).norm(), f64::min)
}

/// Pᵀ B̄ of a body's own sources and faces, sources × 6.
pub(crate) fn own(points: &[Vec<(Vec3, f64)>], sources: &[Vec3], flux: &[Vec6]) -> Vec<Vec6> {
    let flat: Vec<Vec3> = points.iter().flatten().map(|p| p.0).collect();
    let weighted = |(list, b): (&Vec<(Vec3, f64)>, &Vec6)| -> Vec<f64> {
        list.iter()
            .flat_map(|(_, w)| (0..6).map(|k| w * b[k]).collect::<Vec<f64>>())
            .collect()
    };
    let bar: Vec<f64> = points.iter().zip(flux).flat_map(weighted).collect();
    // Normals and row weights don't enter the potential.
    let targets = Points::new(&flat, &flat, vec![1.0; flat.len()]);
    let mut out = vec![0.0; 6 * sources.len()];
    kernel::potential_sum(&targets, &Sources::new(sources), &bar, 6, &mut out);
    out.chunks_exact(6).map(Vec6::from_column_slice).collect()
}
