//! Choice of columns by a QR factorisation with column pivoting, stopped early.

use faer::Mat;
use rayon::prelude::*;

/// The columns chosen, in order, and the thin factor Q of them (rows × rank) and R (rank × rank).
pub(super) struct Pivoted {
    pub columns: Vec<usize>,
    pub q: Mat<f64>,
    pub r: Mat<f64>,
}

/// Greedy choice by the largest part that the columns chosen so far don't span, until it is below
/// `tolerance` times the largest column, or `most` are chosen.
pub(super) fn pivoted_qr(a: &Mat<f64>, tolerance: f64, most: usize) -> Pivoted {
    let (rows, n) = a.shape();
    let most = most.min(rows).min(n);
    let mut left: Vec<Column> = (0..n)
        .map(|j| Column::new(a.col(j).iter().copied()))
        .collect();
    let largest = left.iter().map(|c| c.norm).fold(0.0, f64::max);
    let mut columns: Vec<usize> = Vec::new();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    while columns.len() < most {
        let free = (0..n).filter(|j| !columns.contains(j));
        let Some(best) = free.max_by(|i, j| left[*i].norm.total_cmp(&left[*j].norm)) else {
            break;
        };
        if left[best].norm <= tolerance * largest {
            break;
        }
        // Once more, so that Q is orthogonal to rounding.
        let mut q = left[best].rest.clone();
        for b in &basis {
            let c = dot(b, &q);
            q.iter_mut().zip(b).for_each(|(q, b)| *q -= c * b);
        }
        let length = dot(&q, &q).sqrt();
        q.iter_mut().for_each(|x| *x /= length);
        left.par_iter_mut().for_each(|c| c.project(&q));
        columns.push(best);
        basis.push(q);
    }
    let rank = columns.len();
    Pivoted {
        q: Mat::from_fn(rows, rank, |i, j| basis[j][i]),
        r: Mat::from_fn(rank, rank, |i, j| {
            if i <= j {
                left[columns[j]].along[i]
            } else {
                0.0
            }
        }),
        columns,
    }
}

/// A column, split into its parts along those chosen so far and the rest.
struct Column {
    rest: Vec<f64>,
    along: Vec<f64>,
    norm: f64,
}

impl Column {
    fn new(entries: impl Iterator<Item = f64>) -> Self {
        let rest: Vec<f64> = entries.collect();
        Self {
            norm: dot(&rest, &rest).sqrt(),
            along: Vec::new(),
            rest,
        }
    }

    fn project(&mut self, q: &[f64]) {
        let c = dot(q, &self.rest);
        self.rest.iter_mut().zip(q).for_each(|(x, q)| *x -= c * q);
        self.along.push(c);
        self.norm = dot(&self.rest, &self.rest).sqrt();
    }
}

/// Greedy choice of the columns of `a` that best explain `targets` (orthogonal matching pursuit with
/// all targets at once): each step takes the column that lowers the sum of squares of the targets'
/// rests most, until every rest is below `tolerance`, or `most` are chosen.
pub(super) fn pursuit(a: &Mat<f64>, targets: &Mat<f64>, tolerance: f64, most: usize) -> Pivoted {
    let (rows, n) = a.shape();
    let most = most.min(rows).min(n);
    let mut left: Vec<Column> = (0..n)
        .map(|j| Column::new(a.col(j).iter().copied()))
        .collect();
    let floor: Vec<f64> = left.iter().map(|c| 1e-10 * c.norm).collect();
    let mut rests: Vec<Column> = (0..targets.ncols())
        .map(|j| Column::new(targets.col(j).iter().copied()))
        .collect();
    // aᵀ times the rests, updated with every choice.
    let mut along: Vec<Vec<f64>> = left
        .par_iter()
        .map(|c| rests.iter().map(|t| dot(&c.rest, &t.rest)).collect())
        .collect();
    let mut columns: Vec<usize> = Vec::new();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    while columns.len() < most && rests.iter().any(|t| t.norm > tolerance) {
        let gain = |j: usize| {
            if left[j].norm <= floor[j] || columns.contains(&j) {
                return 0.0;
            }
            dot(&along[j], &along[j]) / (left[j].norm * left[j].norm)
        };
        let gains: Vec<f64> = (0..n).into_par_iter().map(gain).collect();
        let Some(best) = (0..n).max_by(|i, j| gains[*i].total_cmp(&gains[*j])) else {
            break;
        };
        if gains[best] <= 0.0 {
            break;
        }
        let mut q = left[best].rest.clone();
        for b in &basis {
            let c = dot(b, &q);
            q.iter_mut().zip(b).for_each(|(q, b)| *q -= c * b);
        }
        let length = dot(&q, &q).sqrt();
        q.iter_mut().for_each(|x| *x /= length);
        rests.par_iter_mut().for_each(|t| t.project(&q));
        left.par_iter_mut().zip(&mut along).for_each(|(c, along)| {
            c.project(&q);
            let s = c.along[c.along.len() - 1];
            for (a, t) in along.iter_mut().zip(&rests) {
                *a -= s * t.along[t.along.len() - 1];
            }
        });
        columns.push(best);
        basis.push(q);
    }
    let rank = columns.len();
    Pivoted {
        q: Mat::from_fn(rows, rank, |i, j| basis[j][i]),
        r: Mat::from_fn(rank, rank, |i, j| {
            if i <= j {
                left[columns[j]].along[i]
            } else {
                0.0
            }
        }),
        columns,
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::pivoted_qr;
    use faer::Mat;

    #[test]
    fn chosen_columns_are_q_times_r_and_span_the_rest() {
        let a = Mat::from_fn(40, 30, |i, j| {
            1.0 / (1.0 + (i as f64 - 1.3 * j as f64).powi(2) * 0.01)
        });
        let p = pivoted_qr(&a, 1e-6, 30);
        assert!(p.columns.len() < 30);
        let back = &p.q * &p.r;
        for (k, j) in p.columns.iter().enumerate() {
            for i in 0..40 {
                assert!((back[(i, k)] - a[(i, *j)]).abs() < 1e-12);
            }
        }
        let rest = &a - &p.q * (p.q.transpose() * &a);
        assert!(rest.norm_max() < 1e-5);
    }
}
