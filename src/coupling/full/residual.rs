//! What the solution of the coupled system leaves of the boundary condition between its collocation points.
//!
//! Strengths α make the normal velocity f_α where the bodies' motion asks for f. The energy
//! `½ ∫ φ_α (2f − f_α)` is stationary at the solution ([`crate::boundary::readout`]). It is taken here
//! over the quarters of every face, none of whose middles but one was used in the fit, with the exact
//! flux through each quarter and the potential at its middle. What it differs by from the energy that is
//! reported is what normal velocities left between the collocation points are worth.

use super::Model;
use crate::Result;
use crate::adjoint::kernel::{Points, Sources, Triangles, Write, flux_fill, potential_fill};
use crate::adjoint::lie::{Pose, Vec3, Vec6, point_wrench};
use crate::coupling::CoupledResponse;
use crate::coupling::response::Solved;
use crate::solver::{Columns, product};
use nalgebra::DMatrix;

/// Faces of one piece of work: the matrices of their quarters are kept for so many.
const FACES: usize = 256;

/// The energy of pairs of basis columns over the quarters of all faces, less that reported;
/// k × k, symmetric.
pub(super) fn residual(
    model: &Model,
    solved: &Solved<dyn CoupledResponse + '_>,
    poses: &[Pose],
    basis: &DMatrix<f64>,
) -> Result<DMatrix<f64>> {
    let a = solved.response.densities()?;
    let pairs = model.pairs(poses);
    let k = basis.ncols();
    let mut energy = DMatrix::<f64>::zeros(k, k);
    for (b, body) in model.bodies.iter().enumerate() {
        let strengths = |b: usize| a.part(&model.sources[b]);
        let mut fields = vec![(Sources::new(&body.sources), strengths(b))];
        for pair in pairs.iter().filter(|p| p.target == b) {
            fields.push((pair.points.clone(), strengths(pair.source)));
        }
        let twists = basis.rows(6 * b, 6);
        for corners in body.faces.corners.chunks(FACES) {
            let quarters = Quarters::new(corners);
            let n = quarters.triangles.len();
            let (mut potential, mut flux) = (Columns::zeros(n, k), Columns::zeros(n, k));
            for (sources, strengths) in &fields {
                let width = sources.len();
                let mut matrix = vec![0.0; n * width];
                let set = Write::Set;
                potential_fill(&quarters.middles, sources, set, &mut matrix, width, 0);
                potential.add(&product(&matrix, n, strengths));
                flux_fill(&quarters.triangles, sources, set, &mut matrix, width, 0);
                flux.add(&product(&matrix, n, strengths));
            }
            let asked = DMatrix::from_fn(n, 6, |i, c| quarters.asked[i][c]) * twists;
            let left = DMatrix::from_fn(n, k, |i, c| 2.0 * asked[(i, c)] - flux.at(i, c));
            let potential = DMatrix::from_row_slice(n, k, &potential.data);
            energy += potential.tr_mul(&left);
        }
    }
    let reported = basis.tr_mul(solved.value.momenta());
    let difference = energy - reported;
    Ok(0.5 * (&difference + difference.transpose()))
}

/// The quarters of some faces.
struct Quarters {
    triangles: Triangles,
    middles: Points,
    /// Flux per unit twist.
    asked: Vec<Vec6>,
}

impl Quarters {
    fn new(faces: &[[Vec3; 3]]) -> Self {
        let mut vertices = Vec::with_capacity(6 * faces.len());
        let mut triangles = Vec::with_capacity(4 * faces.len());
        for [a, b, c] in faces {
            let n = vertices.len();
            vertices.extend([*a, *b, *c, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)]);
            let quarters = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]];
            triangles.extend(quarters.map(|t| t.map(|v| n + v)));
        }
        let weights = vec![1.0; triangles.len()];
        let triangles = Triangles::new(&vertices, &triangles, weights);
        let middles: Vec<Vec3> = (0..triangles.len())
            .map(|i| triangles.centroid(i))
            .collect();
        let asked = (0..triangles.len())
            .map(|i| {
                let n = triangles.normal(i) * triangles.area(i);
                point_wrench(&middles[i], &n)
            })
            .collect();
        Self {
            middles: Points::bare(&middles),
            triangles,
            asked,
        }
    }
}
