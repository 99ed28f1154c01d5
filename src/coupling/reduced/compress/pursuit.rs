//! Choice of columns that explain given targets best.

use faer::Mat;
use faer::linalg::solvers::SolveLstsq;
use rayon::prelude::*;

/// Part of a column, squared, that the others must leave of it for it to be worth choosing: what
/// is smaller is rounding of the products.
const FLOOR: f64 = 1e-9;

/// Greedy choice of the columns of `a` that best explain `targets` (orthogonal matching pursuit with
/// all targets at once): each step takes the column that lowers the sum of squares of the targets'
/// rests most, until every rest is at most `tolerance` long, or `most` are chosen. With the length of the longest rest.
///
/// Works on the products `AᵀA` and `AᵀT` alone, updated as in a Cholesky factorisation with pivoting.
pub(super) fn pursuit(
    a: &Mat<f64>,
    targets: &Mat<f64>,
    tolerance: f64,
    most: usize,
) -> (Vec<usize>, f64) {
    let n = a.ncols();
    let most = most.min(a.nrows()).min(n);
    let gram = a.transpose() * a;
    let along = targets.transpose() * a;
    let mut along: Vec<Vec<f64>> = (0..n).map(|j| along.col_as_slice(j).to_vec()).collect();
    let mut left: Vec<f64> = (0..n).map(|j| gram[(j, j)]).collect();
    let floor: Vec<f64> = left.iter().map(|g| FLOOR * g).collect();
    let mut rests: Vec<f64> = targets.col_iter().map(|t| t.squared_norm_l2()).collect();
    // Row k: the chosen, orthonormalised column k times every column.
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut chosen = Vec::new();
    while chosen.len() < most && rests.iter().any(|r| *r > tolerance * tolerance) {
        let gain = |j: usize| {
            if left[j] <= floor[j] {
                return 0.0;
            }
            along[j].iter().map(|x| x * x).sum::<f64>() / left[j]
        };
        let gains: Vec<f64> = (0..n).into_par_iter().map(gain).collect();
        let Some(best) = (0..n).max_by(|i, j| gains[*i].total_cmp(&gains[*j])) else {
            break;
        };
        if gains[best] <= 0.0 {
            break;
        }
        let length = left[best].sqrt();
        let mut row: Vec<f64> = gram.col_as_slice(best).to_vec();
        for r in &rows {
            let c = r[best];
            row.iter_mut().zip(r).for_each(|(x, r)| *x -= c * r);
        }
        row.iter_mut().for_each(|x| *x /= length);
        let taken: Vec<f64> = along[best].iter().map(|x| x / length).collect();
        let columns = along.par_iter_mut().zip(&row).zip(&mut left);
        columns.for_each(|((along, x), left)| {
            along.iter_mut().zip(&taken).for_each(|(a, t)| *a -= x * t);
            *left -= x * x;
        });
        left[best] = 0.0;
        rests.iter_mut().zip(&taken).for_each(|(r, t)| *r -= t * t);
        chosen.push(best);
        rows.push(row);
    }
    let longest = rests.iter().fold(0.0, |a: f64, b| a.max(*b));
    (chosen, longest.sqrt())
}

/// Least-squares solution of `a x ≈ b`.
pub(super) fn least_squares(a: &Mat<f64>, b: &Mat<f64>) -> Mat<f64> {
    a.qr().solve_lstsq(b)
}

#[cfg(test)]
mod tests {
    use super::{least_squares, pursuit};
    use faer::Mat;

    #[test]
    fn few_columns_explain_what_few_columns_made() {
        let bump = |i: usize, j: f64| 1.0 / (1.0 + 0.05 * (i as f64 - j).powi(2));
        let a = Mat::from_fn(60, 40, |i, j| bump(i, 1.5 * j as f64));
        let made = [3, 17, 30];
        let targets = Mat::from_fn(60, 2, |i, k| {
            let parts = made.iter().enumerate();
            parts
                .map(|(n, j)| a[(i, *j)] * (1.0 + n as f64 - 2.5 * k as f64))
                .sum::<f64>()
        });
        let (mut chosen, longest) = pursuit(&a, &targets, 1e-3, 40);
        assert!(longest <= 1e-3, "{longest}");
        let picked = Mat::from_fn(60, chosen.len(), |i, k| a[(i, chosen[k])]);
        let rest = &targets - &picked * least_squares(&picked, &targets);
        assert!((0..2).all(|k| rest.col(k).norm_l2() <= 1.1e-3), "{rest:?}");
        assert_eq!(pursuit(&a, &targets, 0.0, 2).0.len(), 2);
        chosen.sort_unstable();
        chosen.dedup();
        assert!(chosen.len() <= 12, "{chosen:?}");
    }
}
