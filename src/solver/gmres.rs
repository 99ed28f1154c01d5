//! GMRES with a right preconditioner, for square systems.

use super::{CALLS, Columns, Outcome};

/// Solves `A x = b` for several columns at once, each with its own Krylov space: full Arnoldi with
/// modified Gram–Schmidt and Givens rotations, restarted every `restart` iterations, until
/// `‖b − A x‖ ≤ tolerance · ‖b‖`.
///
/// `apply` takes v and the numbers of its columns in b, ascending, to `[M⁻¹ v, A M⁻¹ v]`, M the right preconditioner; every column may
/// have its own A and M. Both are kept for every v: solution and residual are
/// combinations of them, at no further product with A. A column of zeros has the solution zero, at no iteration.
///
/// # References
/// Saad and Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856.
pub fn gmres(
    apply: impl Fn(&Columns, &[usize]) -> [Columns; 2],
    b: &Columns,
    tolerance: f64,
    max_iterations: usize,
    restart: usize,
) -> Outcome {
    gmres_beside(apply, 0, b, tolerance, max_iterations, restart)
}

/// [`gmres`] where `apply` gives `beside` more rows with M⁻¹ v, linear in v: the solution has them too, at no further product.
pub fn gmres_beside(
    apply: impl Fn(&Columns, &[usize]) -> [Columns; 2],
    beside: usize,
    b: &Columns,
    tolerance: f64,
    max_iterations: usize,
    restart: usize,
) -> Outcome {
    CALLS.add(1);
    let n = b.columns;
    let mut x = Columns::zeros(b.rows + beside, n);
    // In parts of each column's largest entry: squares of the entries may not be numbers where the entries are.
    let most = largest(b);
    let b = &Columns::from_fn(b.rows, n, |i, k| b.at(i, k) / most[k]);
    let size = norms(b);
    let mut residual: Vec<f64> = size
        .iter()
        .map(|s| match s {
            0.0 => 0.0,
            s if s.is_finite() => 1.0,
            _ => f64::INFINITY,
        })
        .collect();
    let mut iterations = vec![0; n];
    // A column goes on while there is something to gain.
    let wanted = |k: &usize| residual[*k] > tolerance && residual[*k].is_finite();
    let mut active: Vec<usize> = (0..n).filter(wanted).collect();
    let mut r = select(b, &active);
    while !active.is_empty() {
        let limit = |k: usize| restart.min(max_iterations - iterations[k]);
        let mut spaces: Vec<Space> = active
            .iter()
            .zip(norms(&r))
            .map(|(k, beta)| Space::new(beta, 0.5 * tolerance * size[*k], limit(*k)))
            .collect();
        let [step, change] = arnoldi(&apply, beside, r.clone(), &active, &mut spaces);
        for (c, k) in active.iter().enumerate() {
            iterations[*k] += spaces[c].columns.len();
            for i in 0..x.rows {
                x.data[i * n + k] += step.at(i, c);
            }
        }
        r.add_scaled(&change, &vec![-1.0; active.len()]);
        let mut left = Vec::new();
        for (c, after) in norms(&r).into_iter().enumerate() {
            let (k, space) = (active[c], &spaces[c]);
            residual[k] = after / size[k];
            if residual[k].is_nan() {
                residual[k] = f64::INFINITY;
            }
            // Where rounding ended the progress, what was reached is reported.
            let stalled = after > 0.9 * space.beta && space.columns.len() < restart;
            let more = residual[k] > tolerance && residual[k].is_finite() && !stalled;
            if more && iterations[k] < max_iterations {
                left.push(c);
            }
        }
        r = select(&r, &left);
        active = left.iter().map(|c| active[*c]).collect();
    }
    for row in x.data.chunks_exact_mut(n.max(1)) {
        row.iter_mut().zip(&most).for_each(|(x, most)| *x *= most);
    }
    Outcome {
        x,
        iterations: iterations.into_iter().max().unwrap_or(0),
        residual: residual.into_iter().fold(0.0, f64::max),
    }
}

/// One column's small problem: the Hessenberg matrix, rotated to a triangle.
struct Space {
    /// Norm of the residual that it began with.
    beta: f64,
    /// Residual at which it ends.
    goal: f64,
    limit: usize,
    columns: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    right: Vec<f64>,
    done: bool,
}

impl Space {
    fn new(beta: f64, goal: f64, limit: usize) -> Self {
        Self {
            beta,
            goal,
            limit,
            columns: Vec::new(),
            rotations: Vec::new(),
            right: vec![beta],
            done: false,
        }
    }

    /// Takes the next column: products with the basis so far, and the norm of what is left.
    fn push(&mut self, mut column: Vec<f64>, last: f64) {
        let j = self.columns.len();
        for (i, (c, s)) in self.rotations.iter().enumerate() {
            let (a, b) = (column[i], column[i + 1]);
            column[i] = c * a + s * b;
            column[i + 1] = c * b - s * a;
        }
        let radius = column[j].hypot(last);
        let (c, s) = if radius > 0.0 {
            (column[j] / radius, last / radius)
        } else {
            (1.0, 0.0)
        };
        column[j] = radius;
        self.rotations.push((c, s));
        let top = self.right[j];
        self.right[j] = c * top;
        self.right.push(-s * top);
        self.columns.push(column);
        self.done = self.right[j + 1].abs() <= self.goal
            || last <= f64::EPSILON * radius
            || j + 1 >= self.limit;
    }

    /// Coefficients of the basis.
    fn coefficients(&self) -> Vec<f64> {
        let m = self.columns.len();
        let mut y = vec![0.0; m];
        for i in (0..m).rev() {
            let sum: f64 = (i + 1..m).map(|k| self.columns[k][i] * y[k]).sum();
            y[i] = match self.columns[i][i] {
                0.0 => 0.0,
                h => (self.right[i] - sum) / h,
            };
        }
        y
    }
}

/// One step of all columns that aren't done yet.
struct Step {
    v: Columns,
    /// M⁻¹ v, with what goes beside it, and A M⁻¹ v.
    images: [Columns; 2],
    /// Which columns these are.
    owners: Vec<usize>,
}

/// Builds every column's basis from its residual until all are done; the columns' best steps, and A times them.
fn arnoldi(
    apply: &impl Fn(&Columns, &[usize]) -> [Columns; 2],
    beside: usize,
    mut v: Columns,
    active: &[usize],
    spaces: &mut [Space],
) -> [Columns; 2] {
    let all = v.columns;
    for (c, space) in spaces.iter().enumerate() {
        scale(&mut v, c, 1.0 / space.beta);
    }
    let mut owners: Vec<usize> = (0..all).collect();
    let mut basis: Vec<Step> = Vec::new();
    loop {
        let numbers: Vec<usize> = owners.iter().map(|c| active[*c]).collect();
        let images = apply(&v, &numbers);
        debug_assert_eq!(images[0].rows, v.rows + beside, "rows beside the solution");
        let mut w = images[1].clone();
        basis.push(Step {
            v,
            images,
            owners: owners.clone(),
        });
        let mut products = vec![Vec::with_capacity(basis.len() + 1); owners.len()];
        for step in &basis {
            let v = match step.owners == owners {
                true => &step.v,
                false => &select(&step.v, &places(&step.owners, &owners)),
            };
            let dots = w.dots(v);
            w.add_scaled(v, &dots.iter().map(|d| -d).collect::<Vec<_>>());
            for (p, d) in products.iter_mut().zip(dots) {
                p.push(d);
            }
        }
        let mut left = Vec::new();
        for (c, (column, last)) in products.into_iter().zip(norms(&w)).enumerate() {
            let space = &mut spaces[owners[c]];
            space.push(column, last);
            if !space.done {
                scale(&mut w, c, 1.0 / last);
                left.push(c);
            }
        }
        if left.is_empty() {
            break;
        }
        v = match left.len() == owners.len() {
            true => w,
            false => select(&w, &left),
        };
        owners = left.iter().map(|c| owners[*c]).collect();
    }
    let coefficients: Vec<Vec<f64>> = spaces.iter().map(Space::coefficients).collect();
    [0, 1].map(|part| {
        let mut out = Columns::zeros(basis[0].images[part].rows, all);
        for (j, step) in basis.iter().enumerate() {
            let image = &step.images[part];
            if step.owners.len() == all {
                let scale: Vec<f64> = coefficients.iter().map(|of| of[j]).collect();
                out.add_scaled(image, &scale);
                continue;
            }
            for i in 0..image.rows {
                for (x, k) in image.row(i).iter().zip(&step.owners) {
                    out.data[i * all + k] += x * coefficients[*k][j];
                }
            }
        }
        out
    })
}

/// Where each of `owners` is in `of`.
fn places(of: &[usize], owners: &[usize]) -> Vec<usize> {
    let place = |k: &usize| of.iter().position(|o| o == k);
    owners.iter().filter_map(place).collect()
}

/// The largest entry of each column by size, rounded to a power of two, by which nothing is rounded; one of a column of zeros, or of what aren't numbers.
fn largest(x: &Columns) -> Vec<f64> {
    let mut most = vec![0.0_f64; x.columns];
    for row in x.data.chunks_exact(x.columns.max(1)) {
        for (most, x) in most.iter_mut().zip(row) {
            *most = most.max(x.abs());
        }
    }
    let power = |most: &f64| most.log2().floor().clamp(-1000.0, 1000.0).exp2();
    let usable = |most: &f64| most.is_finite() && *most > 0.0;
    most.iter()
        .map(|most| if usable(most) { power(most) } else { 1.0 })
        .collect()
}

fn norms(x: &Columns) -> Vec<f64> {
    x.dots(x).into_iter().map(f64::sqrt).collect()
}

fn select(x: &Columns, columns: &[usize]) -> Columns {
    Columns::from_fn(x.rows, columns.len(), |i, c| x.at(i, columns[c]))
}

fn scale(x: &mut Columns, column: usize, factor: f64) {
    let n = x.columns;
    x.data[column..]
        .iter_mut()
        .step_by(n)
        .for_each(|v| *v *= factor);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::product;

    /// Well conditioned, not symmetric.
    fn matrix(n: usize) -> Vec<f64> {
        let entry = |i: usize, j: usize| {
            let noise = (1.3 * i as f64 + 2.9 * (j * j) as f64).sin() / n as f64;
            noise + if i == j { 1.0 + 0.02 * i as f64 } else { 0.0 }
        };
        (0..n * n).map(|k| entry(k / n, k % n)).collect()
    }

    #[test]
    fn columns_are_solved_together_as_alone() {
        let n = 60;
        let a = matrix(n);
        let jacobi = |v: &Columns, _: &[usize]| {
            let z = Columns::from_fn(n, v.columns, |i, k| v.at(i, k) / a[i * n + i]);
            let image = product(&a, n, &z);
            [z, image]
        };
        // Zero, an eigenvector-like easy one, hard ones.
        let b = Columns::from_fn(n, 4, |i, k| match k {
            0 => 0.0,
            1 => f64::from(i == 0),
            k => (0.4 * (i * k) as f64).cos(),
        });
        for restart in [3, 10, 60] {
            let together = gmres(jacobi, &b, 1e-11, 500, restart);
            assert!(together.residual <= 1e-11, "{}", together.residual);
            // The residual is that of the solution.
            let image = product(&a, n, &together.x);
            for k in 0..4 {
                let size = norms(&b)[k];
                let left = (0..n).map(|i| (b.at(i, k) - image.at(i, k)).powi(2));
                assert!(
                    left.sum::<f64>().sqrt() <= 1.001e-11 * size,
                    "{restart} {k}"
                );
            }
            let mut most = 0;
            for k in 0..4 {
                let one = Columns::from_columns(&[&b.column(k)]);
                let alone = gmres(jacobi, &one, 1e-11, 500, restart);
                most = most.max(alone.iterations);
                assert_eq!(together.x.column(k), alone.x.data, "{restart} {k}");
            }
            assert_eq!(together.iterations, most);
            assert!(most > 3, "{most}");
        }
    }

    #[test]
    fn what_goes_with_the_solution_is_as_linear() {
        let n = 40;
        let a = matrix(n);
        let b = Columns::from_fn(n, 2, |i, k| (0.4 * (i * (k + 1)) as f64).cos());
        let further = |v: &Columns, i: usize, k: usize| v.at(i, k) - 2.0 * v.at(i + 7, k);
        let apply = |v: &Columns, _: &[usize]| {
            let with = Columns::from_fn(n + 3, v.columns, |i, k| match i.checked_sub(n) {
                None => v.at(i, k),
                Some(i) => further(v, i, k),
            });
            [with, product(&a, n, v)]
        };
        for restart in [4, 60] {
            let found = gmres_beside(apply, 3, &b, 1e-11, 500, restart);
            assert!(found.residual <= 1e-11, "{}", found.residual);
            assert_eq!(found.x.rows, n + 3);
            for (i, k) in (0..3).flat_map(|i| [(i, 0), (i, 1)]) {
                let (given, made) = (found.x.at(n + i, k), further(&found.x, i, k));
                assert!((given - made).abs() <= 1e-14, "{given} {made}");
            }
        }
        // Of nothing it is nothing.
        let none = gmres_beside(apply, 3, &Columns::zeros(n, 1), 1e-11, 9, 9);
        assert_eq!(none.x.data, vec![0.0; n + 3]);
    }

    #[test]
    fn how_large_a_right_hand_side_is_changes_nothing_else() {
        let n = 40;
        let a = matrix(n);
        let apply = |v: &Columns, _: &[usize]| [v.clone(), product(&a, n, v)];
        let b = |size: f64| Columns::from_fn(n, 1, |i, _| size * (0.4 * i as f64).cos());
        let right = gmres(apply, &b(1.0), 1e-11, 500, 60);
        for power in [-1000, -532, -100, 300, 1000] {
            let size = 2.0_f64.powi(power);
            let found = gmres(apply, &b(size), 1e-11, 500, 60);
            assert!(found.residual <= 1e-11 && found.iterations == right.iterations);
            for (found, right) in found.x.data.iter().zip(&right.x.data) {
                assert_eq!(*found, size * right, "{power}");
            }
        }
        // Of numbers that are all but none what can be told of them.
        let least = gmres(apply, &b(1e-310), 1e-6, 500, 60);
        assert!(least.residual <= 1e-6 && least.x.data.iter().any(|x| *x != 0.0));
    }

    #[test]
    fn gives_up_and_says_so() {
        let n = 60;
        let a = matrix(n);
        let apply = |v: &Columns, _: &[usize]| [v.clone(), product(&a, n, v)];
        let b = Columns::from_fn(n, 2, |i, k| (0.4 * (i * (k + 1)) as f64).cos());
        let short = gmres(apply, &b, 1e-11, 4, 100);
        assert_eq!(short.iterations, 4);
        assert!(short.residual > 1e-11 && short.residual < 1.0);
        // A singular matrix can't reach its right-hand side.
        let nothing = |v: &Columns, _: &[usize]| [v.clone(), Columns::zeros(v.rows, v.columns)];
        let none = gmres(nothing, &b, 1e-11, 50, 100);
        assert_eq!(none.residual, 1.0);
        let wild = Columns::from_fn(n, 1, |_, _| f64::NAN);
        assert_eq!(gmres(apply, &wild, 1e-11, 9, 9).residual, f64::INFINITY);
    }
}
