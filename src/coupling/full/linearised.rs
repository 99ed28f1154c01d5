//! One evaluation of the coupled system, and its derivatives: what a backend's solution means; and what it
//! leaves of the boundary condition between its collocation points.
//!
//! Strengths α make the normal velocity f_α where the bodies' motion asks for f. The energy
//! `½ ∫ φ_α (2f − f_α)` is stationary at the solution ([`crate::boundary::readout`]). It is taken here
//! over the quarters of every face, none of whose middles but one was used in the fit, with the exact
//! flux through each quarter and the potential at its middle. What it differs by from the energy that is
//! reported is what normal velocities left between the collocation points are worth.

use super::{Full, Model, SystemResponse};
use crate::Result;
use crate::adjoint::kernel::{Points, Sources, Triangles, Write, flux_fill, potential_fill};
use crate::adjoint::lie::{Pose, Vec3, Vec6, point_wrench};
use crate::coupling::settings::asymmetry;
use crate::coupling::{
    CouplingReport, Direction, Linearised, Momenta, PairTensor, Pullback, Tangent,
};
use crate::solver::{Columns, product};
use nalgebra::{DMatrix, DVector};

/// Faces of one piece of work: the matrices of their quarters are kept for so many.
const FACES: usize = 256;

/// [`Full`] solved for a basis.
pub(super) struct Solved<'a> {
    pub model: &'a Model,
    /// Solution to the basis.
    pub response: Box<dyn SystemResponse + 'a>,
    pub value: Momenta,
}

/// [`Full`] with its derivatives.
pub(super) struct FullLinearised<'a> {
    pub solved: Solved<'a>,
    pub gradient: PairTensor,
}

impl<'a> Solved<'a> {
    pub fn new(full: &'a Full, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Self> {
        let model = full.model();
        let response = full.backend().respond(poses, basis)?;
        let volume = |b: usize| model.bodies[b].faces.volume();
        let reached = response.reached();
        let report = CouplingReport {
            iterations: reached.iterations,
            residual: reached.residual,
            asymmetry: asymmetry(&response.energies()?, basis, volume),
            condition: 0.0,
        };
        Ok(Self {
            value: Momenta::new(response.momenta()?, report),
            model,
            response,
        })
    }

    /// The energy of pairs of basis columns over the quarters of all faces, less that reported;
    /// k × k, symmetric.
    pub fn residual(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<DMatrix<f64>> {
        let a = self.response.strengths()?;
        let pairs = self.model.pairs(poses);
        let k = basis.ncols();
        let mut energy = DMatrix::<f64>::zeros(k, k);
        for (b, body) in self.model.bodies.iter().enumerate() {
            let strengths = |b: usize| a.part(&self.model.sources[b]);
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
        let reported = basis.tr_mul(self.value.momenta());
        let difference = energy - reported;
        Ok(0.5 * (&difference + difference.transpose()))
    }
}

impl Linearised for FullLinearised<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        self.solved.value.momenta()
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        Ok(self.gradient.contract(x, y))
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        Ok(self.gradient.along(y, z))
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let directions = Direction::distinct(x, y);
        let n = directions.len();
        let response = self.solved.response.directions(&directions)?;
        let momenta = response.momenta()?;
        let unit = |i: usize| DVector::from_fn(n, |k, _| f64::from(k == i));
        Ok(Pullback {
            momentum_x: momenta.column(0).into_owned(),
            momentum_y: momenta.column(n - 1).into_owned(),
            wrench: response.gradient()?.contract(&unit(0), &unit(n - 1)),
        })
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        self.solved
            .response
            .directions(&Direction::distinct(x, y))?
            .tangent(z)
    }

    fn report(&self) -> &CouplingReport {
        self.solved.value.report()
    }
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
