//! One evaluation of the coupled panels, and its derivatives.

use super::PanelCoupled;
use super::placed::{PlacedPanels, Solution};
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::settings::asymmetry;
use crate::coupling::{
    CouplingReport, Direction, Linearised, Momenta, PairTensor, Pullback, Tangent,
};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// [`PanelCoupled`] solved for a basis.
pub(super) struct Solved<'a> {
    placed: PlacedPanels<'a>,
    solution: Solution,
    pub value: Momenta,
}

/// [`PanelCoupled`] with its derivatives.
pub(super) struct PanelLinearised<'a> {
    solved: Solved<'a>,
    gradient: PairTensor,
}

impl<'a> Solved<'a> {
    pub fn new(coupled: &'a PanelCoupled, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Self> {
        let (bodies, k) = (coupled.bodies.len(), basis.ncols());
        if poses.len() != bodies || basis.nrows() != 6 * bodies {
            return Err(Error::input(
                "coupled panel method: poses and basis",
                format!("{} poses, {} rows", poses.len(), basis.nrows()),
                format!("one pose and six rows for each of the {bodies} bodies"),
            ));
        }
        let placed = PlacedPanels::new(coupled, poses)?;
        let solution = placed.solve(basis.clone())?;
        let momenta = momenta(&placed, &solution);
        let (flux, phi) = (placed.flux(basis), &solution.phi);
        let raw = DMatrix::from_fn(k, k, |i, j| {
            let products = (0..phi.rows).map(|s| flux.at(s, i) * phi.at(s, j));
            products.sum::<f64>()
        });
        let reached = solution.reached;
        let report = CouplingReport {
            iterations: reached.iterations,
            residual: reached.residual,
            asymmetry: asymmetry(&raw, basis, |b| coupled.bodies[b].faces.volume()),
            condition: placed.system.condition(),
        };
        if momenta.iter().any(|x| !x.is_finite()) {
            return Err(Error::Solver {
                what: format!("the coupled panel system ({} panels)", coupled.rows()),
                iterations: report.iterations,
                residual: f64::NAN,
                tolerance: coupled.settings.tolerance,
                remedy: "check the poses: the impulses aren't finite".into(),
            });
        }
        Ok(Self {
            placed,
            solution,
            value: Momenta::new(momenta, report),
        })
    }

    pub fn linearise(self) -> PanelLinearised<'a> {
        PanelLinearised {
            gradient: self.placed.gradient(&self.solution),
            solved: self,
        }
    }

    /// The solution to these directions, one column each.
    fn directions(&self, directions: &[Direction]) -> Result<Solution> {
        let parts = directions.iter().map(|direction| match direction {
            Direction::Basis(c) => Ok(self.solution.combine(c)),
            Direction::Twist(x) => {
                let twists = DMatrix::from_column_slice(x.len(), 1, x.as_slice());
                self.placed.solve(twists)
            }
        });
        Ok(Solution::beside(&parts.collect::<Result<Vec<_>>>()?))
    }
}

/// M̄_f times the twists of a solution.
fn momenta(placed: &PlacedPanels, solution: &Solution) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(solution.twists.nrows(), solution.twists.ncols());
    for k in 0..out.ncols() {
        let h = placed.impulse(&solution.phi.column(k), &solution.mu.column(k));
        out.set_column(k, &h);
    }
    out
}

impl Linearised for PanelLinearised<'_> {
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
        let solution = self.solved.directions(&Direction::distinct(x, y))?;
        let n = solution.twists.ncols();
        let placed = &self.solved.placed;
        let momenta = momenta(placed, &solution);
        let unit = |i: usize| DVector::from_fn(n, |k, _| if k == i { 1.0 } else { 0.0 });
        Ok(Pullback {
            momentum_x: momenta.column(0).into_owned(),
            momentum_y: momenta.column(n - 1).into_owned(),
            wrench: placed.gradient(&solution).contract(&unit(0), &unit(n - 1)),
        })
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        let solution = self.solved.directions(&Direction::distinct(x, y))?;
        self.solved.placed.second(&solution, z)
    }

    fn report(&self) -> &CouplingReport {
        self.solved.value.report()
    }
}
