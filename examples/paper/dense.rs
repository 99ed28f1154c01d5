//! The same as a library of automatic differentiation does it with a dense pseudo-inverse or least squares: backward forms the cotangent of all of K.

use crate::operator::{Case, Made, Solved};
use crate::spent::seconds;
use faer::linalg::solvers::{SolveLstsq, Svd};
use faer::{Mat, MatRef};
use hydrograd::solver::Columns;

/// Pseudo-inverse by singular values.
pub fn svd(case: &Case, height: f64, _tolerance: f64) -> Made {
    let start = seconds();
    let k = case.matrix(height);
    let k = square(&k, case.size());
    let pseudo = inverse(&k.thin_svd().map_err(|e| format!("{e:?}"))?);
    let a = &pseudo * column(&case.f);
    let forward = seconds() - start;
    let start = seconds();
    let slope = pulled_back(case, height, k, &pseudo);
    Ok(solved(case, &a, slope, forward, start))
}

/// Least squares by QR; backward by the pseudo-inverse that its factors make, where PyTorch takes singular values.
pub fn qr(case: &Case, height: f64, _tolerance: f64) -> Made {
    let n = case.size();
    let start = seconds();
    let k = case.matrix(height);
    let k = square(&k, n);
    let factors = k.qr();
    let a = factors.solve_lstsq(column(&case.f));
    let forward = seconds() - start;
    let start = seconds();
    let pseudo = factors.solve_lstsq(Mat::<f64>::identity(n, n));
    let slope = pulled_back(case, height, k, &pseudo);
    Ok(solved(case, &a, slope, forward, start))
}

fn square(k: &[f64], n: usize) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(k, n, n)
}

fn column(x: &Columns) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(&x.data, x.rows, 1)
}

fn solved(case: &Case, a: &Mat<f64>, slope: f64, forward: f64, start: f64) -> Solved {
    Solved {
        value: (column(&case.g).transpose() * a)[(0, 0)],
        slope,
        forward,
        backward: seconds() - start,
        iterations: 0,
    }
}

/// V S⁻¹ Uᵀ, nothing cut off.
fn inverse(svd: &Svd<f64>) -> Mat<f64> {
    let mut v = svd.V().to_owned();
    for (j, s) in svd.S().column_vector().iter().enumerate() {
        v.col_mut(j).iter_mut().for_each(|x| *x /= s);
    }
    v * svd.U().transpose()
}

/// dJ/dq through A = K⁺ f: the cotangent of K⁺ is g fᵀ.
fn pulled_back(case: &Case, height: f64, k: MatRef<f64>, pseudo: &Mat<f64>) -> f64 {
    let grad = column(&case.g) * column(&case.f).transpose();
    let bar = pseudo_inverse_vjp(k, pseudo, &grad);
    case.contracted(height, |i, j| bar[(i, j)])
}

/// Golub and Pereyra (1973) transposed, in the products that PyTorch takes for a matrix that isn't wide:
/// K̄ = −PᵀGPᵀ + (I − KP) GᵀPPᵀ + PᵀP Gᵀ(I − PK) of the cotangent G of P = K⁺, Gᵀ written `h`.
fn pseudo_inverse_vjp(k: MatRef<f64>, p: &Mat<f64>, grad: &Mat<f64>) -> Mat<f64> {
    let h = grad.transpose();
    let hp = h * p;
    let hpp = &hp * p.transpose();
    let mut out = &hpp - (p * &hp).transpose();
    out -= (k * p) * &hpp;
    drop(hpp);
    out += (p.transpose() * p) * (h - &hp * k);
    out
}
