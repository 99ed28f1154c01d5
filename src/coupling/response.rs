//! A coupled system's solution to a few columns of twists, and what it means: values and derivatives of the fluid's energy.

use super::settings::asymmetry;
use super::{
    CouplingReport, Direction, Linearised, Momenta, PairTensor, Pullback, ShapeTerm, Tangent,
};
use crate::adjoint::lie::Vec6;
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// The water's solution to k columns of twists at given poses, wherever it lies.
///
/// Bodies that none of the first columns moves have no impulses, there and in all that comes from it by
/// [`CoupledResponse::directions`].
pub trait CoupledResponse: Send + Sync {
    /// What its solves reached.
    fn reached(&self) -> Reached;

    /// M̄ x̄ of every column: body-frame impulses at unit density, 6·bodies × k (m⁴/s and m⁵/s).
    ///
    /// # Errors
    /// A device that fails.
    fn momenta(&self) -> Result<DMatrix<f64>>;

    /// E of all pairs of columns, k × k (m⁵/s²), not symmetrised: its asymmetry shows the error of discretisation.
    ///
    /// # Errors
    /// A device that fails.
    fn energies(&self) -> Result<DMatrix<f64>>;

    /// ∇_g E of all pairs of columns: spatial wrenches on each body.
    ///
    /// # Errors
    /// A device that fails.
    fn gradient(&self) -> Result<PairTensor>;

    /// The solution to these directions, one column each: [`Direction::Basis`] a combination of the
    /// columns there are, [`Direction::Twist`] a further solve.
    ///
    /// # Errors
    /// A solve that misses its tolerance, or a device that fails.
    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn CoupledResponse + '_>>;

    /// The tangent of the energy of the first with the last column (which are one if there is one)
    /// along the displacement z, a spatial twist a body.
    ///
    /// # Errors
    /// Neither one column nor two, a solve that misses its tolerance, or a device that fails.
    fn tangent(&self, z: &[Vec6]) -> Result<Tangent>;

    /// Derivative of the sum of terms with each shape parameter that the coupling was made with; `None` where that isn't told.
    ///
    /// # Errors
    /// A solve that misses its tolerance; films that hold bodies apart.
    fn shape_vjp(&self, _terms: &[ShapeTerm]) -> Result<Option<DVector<f64>>> {
        Ok(None)
    }

    /// What the solution consists of, on the host: strengths of all sources, or potentials of all panels, × k.
    ///
    /// # Errors
    /// A device that fails.
    fn densities(&self) -> Result<Columns>;

    /// The rates of the densities of all columns along the displacement z, a spatial twist a body, at constant twists.
    ///
    /// # Errors
    /// A solve that misses its tolerance; a device that doesn't tell them.
    fn density_rates(&self, _z: &[Vec6]) -> Result<Columns> {
        Err(Error::Unsupported {
            what: "the rates of densities on the backend gpu".into(),
            why: "only their effect on bodies is computed there".into(),
            instead: "use the backend cpu for pressures".into(),
        })
    }
}

/// What solves reached.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reached {
    /// Iterations of the slowest column; 0 for direct solves.
    pub iterations: usize,
    /// Largest relative residual.
    pub residual: f64,
}

impl Reached {
    /// The worse of both.
    pub fn worst(self, other: Self) -> Self {
        Self {
            iterations: self.iterations.max(other.iterations),
            residual: self.residual.max(other.residual),
        }
    }
}

/// A coupled system solved for a basis.
pub(super) struct Solved<R: ?Sized> {
    pub value: Momenta,
    /// Solution to the basis.
    pub response: Box<R>,
}

impl<R: CoupledResponse + ?Sized> Solved<R> {
    /// From the solution to a basis; `volume` of each body in m³, condition number of the matrix (0 if unknown).
    pub fn new(
        response: Box<R>,
        basis: &DMatrix<f64>,
        volume: impl Fn(usize) -> f64,
        condition: f64,
    ) -> Result<Self> {
        let reached = response.reached();
        let report = CouplingReport {
            iterations: reached.iterations,
            residual: reached.residual,
            asymmetry: asymmetry(&response.energies()?, basis, volume),
            condition,
        };
        Ok(Self {
            value: Momenta::new(response.momenta()?, report),
            response,
        })
    }

    /// With its derivatives.
    pub fn linearise(self) -> Result<ResponseLinearised<R>> {
        let (rows, columns) = self.value.momenta().shape();
        let gradient = match columns {
            0 => PairTensor::zeros(rows / 6, 0),
            _ => self.response.gradient()?,
        };
        Ok(ResponseLinearised {
            solved: self,
            gradient,
            shapes: 0,
        })
    }
}

/// [`Solved`] with its derivatives.
pub(super) struct ResponseLinearised<R: ?Sized> {
    solved: Solved<R>,
    gradient: PairTensor,
    /// Number of shape parameters.
    shapes: usize,
}

impl<R: CoupledResponse + ?Sized> ResponseLinearised<R> {
    /// Of a coupling that was made with so many shape parameters.
    pub fn with_shapes(self, shapes: usize) -> Self {
        Self { shapes, ..self }
    }
}

impl<R: CoupledResponse + ?Sized> Linearised for ResponseLinearised<R> {
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
        let directions = Direction::distinct(x, y);
        self.solved.response.directions(&directions)?.tangent(z)
    }

    fn shape_vjp(&self, terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        if self.shapes == 0 {
            return Ok(DVector::zeros(0));
        }
        let told = self.solved.response.shape_vjp(terms)?;
        told.ok_or_else(|| Error::Unsupported {
            what: "derivatives with respect to shapes on the backend gpu".into(),
            why: "the sums over moving corners are computed on the CPU alone".into(),
            instead: "use the backend cpu for shape parameters".into(),
        })
    }

    fn report(&self) -> &CouplingReport {
        self.solved.value.report()
    }
}

/// Whether any column moves body `b`.
pub(super) fn moves(twists: &DMatrix<f64>, b: usize) -> bool {
    twists.rows(6 * b, 6).iter().any(|x| *x != 0.0)
}

/// Twists of body `b` in the columns of a stacked matrix.
pub(super) fn body_twists(twists: &DMatrix<f64>, b: usize) -> Vec<Vec6> {
    (0..twists.ncols())
        .map(|k| twists.fixed_view::<6, 1>(6 * b, k).into_owned())
        .collect()
}

/// One column from coefficients on those that there are.
pub(super) fn combined(twists: &DMatrix<f64>, coefficients: &DVector<f64>) -> DMatrix<f64> {
    let twists = twists * coefficients;
    DMatrix::from_column_slice(twists.len(), 1, twists.as_slice())
}

/// Single columns side by side.
pub(super) fn beside<'a>(parts: impl Iterator<Item = &'a DMatrix<f64>>) -> DMatrix<f64> {
    let columns: Vec<_> = parts.map(|p| p.column(0)).collect();
    DMatrix::from_columns(&columns)
}

/// Pairs of one or two columns with their weights in the symmetrised form: the first with the last.
pub(super) fn symmetrised(columns: usize) -> &'static [(usize, usize, f64)] {
    match columns {
        1 => &[(0, 0, 1.0)],
        _ => &[(0, 1, 0.5), (1, 0, 0.5)],
    }
}
