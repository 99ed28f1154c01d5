//! Rules of linear solves.
//!
//! | solve | tangent | cotangents |
//! |---|---|---|
//! | `x = A⁻¹ b` | `dx = A⁻¹ (db − dA x)` | `w = A⁻ᵀ x̄`, `b̄ = w`, `Ā = −w xᵀ` |
//! | `min ‖K a − f‖² + ‖D a‖²` | below | `(KᵀK + D²) λ = ā`, `μ = K λ`, `f̄ = μ`, `K̄ = r λᵀ − μ aᵀ`, `r = f − K a` |
//!
//! Neither `Ā` nor `K̄` is formed: they are products of a few vectors, and callers know `wᵀ dA x` as a function of what
//! A depends on. Of a least-squares problem the solution and the solution of the transposed one are taken together
//! ([`Fitted`]), so that both are columns of one solve and have one tangent.

use crate::blocks::{Blocks, blocks};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, LU};

/// A symmetric positive definite matrix, by its Cholesky factor: of each block, where it falls apart.
#[derive(Clone, Debug)]
pub struct Definite(Blocks<Cholesky<f64, Dyn>>);

impl Definite {
    /// Factors a symmetric matrix. `None` if it isn't positive definite to round-off.
    pub fn new(a: DMatrix<f64>) -> Option<Self> {
        Blocks::new(a, DMatrix::cholesky).all().map(Self)
    }

    /// `x = A⁻¹ b`.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let found = self.0.solve_one(b, |factor, b| Some(factor.solve(b)));
        found.unwrap_or_else(|| DVector::zeros(b.len()))
    }

    /// The same for several columns.
    pub fn solve_columns(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let found = self.0.solve(b, |factor, b| Some(factor.solve(b)));
        found.unwrap_or_else(|| DMatrix::zeros(b.nrows(), b.ncols()))
    }

    /// Cotangent `w = A⁻¹ x̄` of `b`; that of A is `−w xᵀ`.
    pub fn solve_vjp(&self, x_bar: &DVector<f64>) -> DVector<f64> {
        self.solve(x_bar)
    }
}

/// Any square matrix, by its LU factors: of each block, where it falls apart.
#[derive(Clone, Debug)]
pub struct General(Blocks<LU<f64, Dyn, Dyn>>);

impl General {
    /// Factors a matrix.
    pub fn new(a: DMatrix<f64>) -> Self {
        Self(Blocks::new(a, DMatrix::lu))
    }

    /// `x = A⁻¹ b`; `None` of a singular matrix.
    pub fn solve(&self, b: &DVector<f64>) -> Option<DVector<f64>> {
        self.0.solve_one(b, |factor, b| factor.solve(b))
    }

    /// The same for several columns.
    pub fn solve_columns(&self, b: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        self.0.solve(b, |factor, b| factor.solve(b))
    }
}

/// Smallest eigenvalue of a symmetric matrix that is scaled to unit diagonal, so that it doesn't depend on units: at
/// most 1; 1 of an empty matrix. Rows without a positive diagonal become zero. NaN if an entry isn't finite.
pub fn smallest_scaled_eigenvalue(a: &DMatrix<f64>) -> f64 {
    if a.is_empty() {
        return 1.0;
    }
    let scaled = scaled(a);
    if scaled.iter().all(|x| x.is_finite()) {
        let of = |rows: Vec<usize>| {
            let block = scaled.select_rows(&rows).select_columns(&rows);
            block.symmetric_eigenvalues().min()
        };
        let each = blocks(&scaled).into_iter().map(of);
        each.fold(f64::INFINITY, f64::min)
    } else {
        f64::NAN
    }
}

/// Whether [`smallest_scaled_eigenvalue`] is above `least` beyond doubt: what is left has a Cholesky factor, at a tenth of the eigenvalues' cost. False says nothing.
pub fn is_scaled_above(a: &DMatrix<f64>, least: f64) -> bool {
    let mut left = scaled(a);
    // A factor is that of a matrix which differs by rounding.
    let room = least + 8.0 * a.nrows() as f64 * f64::EPSILON;
    for i in 0..left.nrows() {
        left[(i, i)] -= room;
    }
    left.iter().all(|x| x.is_finite()) && Definite::new(left).is_some()
}

/// A symmetric matrix scaled to unit diagonal; rows without a positive one become zero.
fn scaled(a: &DMatrix<f64>) -> DMatrix<f64> {
    let scale = a
        .diagonal()
        .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| scale[i] * a[(i, j)] * scale[j])
}

/// A few columns, in the layout of the caller's solver.
pub trait Columnwise: Sized {
    /// Number of columns.
    fn count(&self) -> usize;
    /// The columns of both, side by side.
    fn beside(&self, other: &Self) -> Self;
    /// The first `n` columns and the others.
    fn split(&self, n: usize) -> (Self, Self);
    /// `α x + β y`.
    fn sum(alpha: f64, x: &Self, beta: f64, y: &Self) -> Self;
}

impl Columnwise for DMatrix<f64> {
    fn count(&self) -> usize {
        self.ncols()
    }

    fn beside(&self, other: &Self) -> Self {
        let all: Vec<_> = self.column_iter().chain(other.column_iter()).collect();
        Self::from_columns(&all)
    }

    fn split(&self, n: usize) -> (Self, Self) {
        let rest = self.columns(n, self.ncols() - n).into_owned();
        (self.columns(0, n).into_owned(), rest)
    }

    fn sum(alpha: f64, x: &Self, beta: f64, y: &Self) -> Self {
        alpha * x + beta * y
    }
}

/// Least-squares solutions `a` of right-hand sides `f`, residuals `r = f − K a`, and the transposed solutions of
/// cotangents `g` of `a`: `(KᵀK + D²) λ = g`, `μ = K λ`.
#[derive(Clone, Debug)]
pub struct Fitted<C> {
    /// Solutions.
    pub a: C,
    /// Transposed solutions.
    pub lambda: C,
    /// Residuals.
    pub r: C,
    /// Cotangents of the right-hand sides.
    pub mu: C,
}

/// A matrix K, by what it does to columns.
pub trait Operator<C> {
    /// `K x`.
    fn apply(&self, x: &C) -> C;
    /// `Kᵀ y`.
    fn apply_transpose(&self, y: &C) -> C;
}

impl Operator<DMatrix<f64>> for DMatrix<f64> {
    fn apply(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        self * x
    }

    fn apply_transpose(&self, y: &DMatrix<f64>) -> DMatrix<f64> {
        self.tr_mul(y)
    }
}

/// How K, `f` and `g` move, of what [`least_squares`] solved.
pub struct Moved<'a, C> {
    /// `dK a − df`.
    pub a: &'a C,
    /// `dK λ`.
    pub lambda: &'a C,
    /// `dKᵀ r`.
    pub r: &'a C,
    /// `dg − dKᵀ μ`.
    pub g: &'a C,
}

/// Solves for `f` and `g` at once; `normal` solves `(KᵀK + D²) x = b`, and what it says besides is handed on.
///
/// # Errors
/// Those of `normal`.
pub fn least_squares<C: Columnwise, S, E>(
    k: &impl Operator<C>,
    normal: impl FnOnce(&C) -> Result<(C, S), E>,
    f: &C,
    g: &C,
) -> Result<(Fitted<C>, S), E> {
    let n = f.count();
    let (solved, said) = normal(&k.apply_transpose(f).beside(g))?;
    let (ka, mu) = k.apply(&solved).split(n);
    let (a, lambda) = solved.split(n);
    let r = C::sum(1.0, f, -1.0, &ka);
    Ok((Fitted { a, lambda, r, mu }, said))
}

/// Tangents of [`least_squares`], by one more solve:
///
/// ```text
/// (KᵀK + D²) da = dKᵀ r − Kᵀ (dK a − df),      dr = −(dK a − df) − K da,
/// (KᵀK + D²) dλ = dg − dKᵀ μ − Kᵀ dK λ,        dμ = dK λ + K dλ.
/// ```
///
/// # Errors
/// Those of `normal`.
pub fn least_squares_jvp<C: Columnwise, S, E>(
    k: &impl Operator<C>,
    normal: impl FnOnce(&C) -> Result<(C, S), E>,
    moved: &Moved<C>,
) -> Result<(Fitted<C>, S), E> {
    let n = moved.a.count();
    let right = moved.r.beside(moved.g);
    let faces = k.apply_transpose(&moved.a.beside(moved.lambda));
    let (solved, said) = normal(&C::sum(1.0, &right, -1.0, &faces))?;
    let (ka, kl) = k.apply(&solved).split(n);
    let (a, lambda) = solved.split(n);
    let r = C::sum(-1.0, moved.a, -1.0, &ka);
    let mu = C::sum(1.0, moved.lambda, 1.0, &kl);
    Ok((Fitted { a, lambda, r, mu }, said))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::numbers;

    fn matrix(seed: u64, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_vec(rows, columns, numbers(seed, rows * columns, 1.0))
    }

    /// The gradient of `gᵀ a` in K is `r λᵀ − μ aᵀ`, in `f` it is μ.
    #[test]
    fn transposed_solutions_give_the_gradient() {
        let (k, f, g) = (matrix(1, 9, 4), matrix(2, 9, 1), matrix(3, 4, 1));
        let square = DMatrix::from_diagonal(&DVector::from_vec(vec![0.1, 0.2, 0.3, 0.4]));
        let solve = |k: &DMatrix<f64>, f: &DMatrix<f64>| {
            let normal = |b: &DMatrix<f64>| {
                let matrix = k.tr_mul(k) + &square;
                Ok::<_, ()>((matrix.cholesky().unwrap().solve(b), ()))
            };
            least_squares(k, normal, f, &g).unwrap().0
        };
        let at = solve(&k, &f);
        let k_bar = &at.r * at.lambda.transpose() - &at.mu * at.a.transpose();
        let (dk, df) = (matrix(4, 9, 4), matrix(5, 9, 1));
        let value = |h: f64| g.dot(&solve(&(&k + h * &dk), &(&f + h * &df)).a);
        let difference = (value(1e-5) - value(-1e-5)) / 2e-5;
        let slope = k_bar.dot(&dk) + at.mu.dot(&df);
        assert!(
            (slope / difference - 1.0).abs() < 1e-8,
            "{slope} {difference}"
        );
        // The energy is the same from either side.
        assert!((g.dot(&at.a) - at.mu.dot(&f)).abs() < 1e-13);
    }

    #[test]
    fn smallest_eigenvalue_is_free_of_units() {
        let a = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 1.0]);
        assert!((smallest_scaled_eigenvalue(&a) - 0.5).abs() < 1e-15);
        assert!(is_scaled_above(&a, 0.4999) && !is_scaled_above(&a, 0.5));
        assert!(!is_scaled_above(
            &DMatrix::from_element(2, 2, f64::NAN),
            0.0
        ));
        let units = DMatrix::from_diagonal(&DVector::from_vec(vec![1e6, 1e-3]));
        assert!((smallest_scaled_eigenvalue(&(&units * a * &units)) - 0.5).abs() < 1e-15);
        assert_eq!(smallest_scaled_eigenvalue(&DMatrix::zeros(0, 0)), 1.0);
        assert!(smallest_scaled_eigenvalue(&DMatrix::from_element(2, 2, f64::NAN)).is_nan());
    }
}
