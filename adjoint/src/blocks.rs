//! Matrices that fall apart: what no entry links is factored on its own.

use nalgebra::{DMatrix, DVector};

/// Rows that entries off the diagonal link with each other, directly or by others: the diagonal blocks to which a square matrix can be brought. Rows ascend in each, and
/// the blocks by their first.
pub fn blocks(a: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let n = a.nrows();
    // Each row knows one that it is linked with; the first of a block knows itself.
    let mut linked: Vec<usize> = (0..n).collect();
    for (j, column) in a.column_iter().enumerate() {
        for (i, x) in column.iter().enumerate() {
            // Numbers that aren't finite link too.
            if *x != 0.0 && linked[i] != linked[j] {
                let (i, j) = (first(&mut linked, i), first(&mut linked, j));
                linked[i.max(j)] = i.min(j);
            }
        }
    }
    let mut out = vec![Vec::new(); n];
    for i in 0..n {
        out[first(&mut linked, i)].push(i);
    }
    out.retain(|rows: &Vec<usize>| !rows.is_empty());
    out
}

/// The first row of the block of `i`, which it knows from now on.
fn first(linked: &mut [usize], i: usize) -> usize {
    let mut at = i;
    while linked[at] != at {
        at = linked[at];
    }
    linked[i] = at;
    at
}

/// Factors of the blocks of a matrix, each with its rows.
#[derive(Clone, Debug)]
pub(crate) struct Blocks<F>(Vec<(Vec<usize>, F)>);

impl<F> Blocks<F> {
    /// Factors each.
    pub fn new(a: DMatrix<f64>, factor: impl Fn(DMatrix<f64>) -> F) -> Self {
        let mut found = blocks(&a);
        if found.len() <= 1 {
            let rows = found.pop().unwrap_or_default();
            return Self(vec![(rows, factor(a))]);
        }
        let own = |rows: Vec<usize>| {
            let block = a.select_rows(&rows).select_columns(&rows);
            (rows, factor(block))
        };
        Self(found.into_iter().map(own).collect())
    }

    /// The solution for columns, of each block's own rows.
    pub fn solve(
        &self,
        b: &DMatrix<f64>,
        solve: impl Fn(&F, &DMatrix<f64>) -> Option<DMatrix<f64>>,
    ) -> Option<DMatrix<f64>> {
        if let [(_, factor)] = self.0.as_slice() {
            return solve(factor, b);
        }
        let mut out = DMatrix::zeros(b.nrows(), b.ncols());
        for (rows, factor) in &self.0 {
            let own = solve(factor, &b.select_rows(rows))?;
            for (row, i) in own.row_iter().zip(rows) {
                out.row_mut(*i).copy_from(&row);
            }
        }
        Some(out)
    }

    /// The same for one column.
    pub fn solve_one(
        &self,
        b: &DVector<f64>,
        solve: impl Fn(&F, &DVector<f64>) -> Option<DVector<f64>>,
    ) -> Option<DVector<f64>> {
        if let [(_, factor)] = self.0.as_slice() {
            return solve(factor, b);
        }
        let mut out = DVector::zeros(b.len());
        for (rows, factor) in &self.0 {
            let own = solve(factor, &b.select_rows(rows))?;
            for (x, i) in own.iter().zip(rows) {
                out[*i] = *x;
            }
        }
        Some(out)
    }
}

impl<F> Blocks<Option<F>> {
    /// `None` where a block has no factor.
    pub fn all(self) -> Option<Blocks<F>> {
        let each = self.0.into_iter();
        each.map(|(rows, factor)| factor.map(|f| (rows, f)))
            .collect::<Option<_>>()
            .map(Blocks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::{Definite, General, smallest_scaled_eigenvalue};

    /// Two interleaved blocks and a row of its own.
    fn apart() -> DMatrix<f64> {
        let mut a = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 3.0, 5.0, 2.0, 7.0]));
        for (i, j, x) in [(0, 2, 1.0), (1, 4, -0.5)] {
            (a[(i, j)], a[(j, i)]) = (x, x);
        }
        a
    }

    #[test]
    fn blocks_are_what_entries_link() {
        assert_eq!(blocks(&apart()), [vec![0, 2], vec![1, 4], vec![3]]);
        let mut one_sided = DMatrix::identity(3, 3);
        one_sided[(2, 0)] = f64::NAN;
        assert_eq!(blocks(&one_sided), [vec![0, 2], vec![1]]);
        assert!(blocks(&DMatrix::zeros(0, 0)).is_empty());
    }

    #[test]
    fn solutions_by_blocks_are_those_of_the_whole() {
        let mut a = apart();
        let b = DMatrix::from_fn(5, 2, |i, j| (i + 3 * j) as f64 - 2.0);
        let solved = |a: &DMatrix<f64>| a.clone().lu().solve(&b).unwrap();
        let definite = Definite::new(a.clone()).unwrap();
        assert!((definite.solve_columns(&b) - solved(&a)).amax() < 1e-15);
        let eigenvalue = smallest_scaled_eigenvalue(&a);
        assert!((eigenvalue - (1.0 - 1.0 / 20.0_f64.sqrt())).abs() < 1e-15);
        a[(0, 2)] = -3.0;
        let general = General::new(a.clone());
        assert!((general.solve_columns(&b).unwrap() - solved(&a)).amax() < 1e-15);
        let one = general.solve(&b.column(1).into_owned()).unwrap();
        assert!((one - solved(&a).column(1)).amax() < 1e-15);
    }

    #[test]
    fn what_has_no_factor_or_solution_says_so() {
        let mut a = apart();
        a[(3, 3)] = -1.0;
        assert!(Definite::new(a.clone()).is_none());
        a[(3, 3)] = 0.0;
        assert!(
            General::new(a)
                .solve(&DVector::from_element(5, 1.0))
                .is_none()
        );
    }
}
