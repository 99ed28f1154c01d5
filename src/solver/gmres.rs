//! GMRES with a right preconditioner, for the paper's square system.

use super::{Columns, Outcome};

/// Solves `A x = b` column by column: full Arnoldi with modified Gram–Schmidt and Givens rotations, restarted every
/// `restart` iterations, until `‖b − A x‖ ≤ tolerance · ‖b‖`.
///
/// `apply` is A, `precondition` the right preconditioner (x = M⁻¹ y).
///
/// # References
/// Saad and Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856.
pub fn gmres(
    apply: impl Fn(&Columns) -> Columns,
    precondition: impl Fn(&mut Columns),
    b: &Columns,
    tolerance: f64,
    max_iterations: usize,
    restart: usize,
) -> Outcome {
    let mut x = Columns::zeros(b.rows, b.columns);
    let (mut most, mut worst) = (0, 0.0_f64);
    for k in 0..b.columns {
        let right = Columns::from_columns(&[&b.column(k)]);
        let (column, iterations, residual) = single(
            &apply,
            &precondition,
            &right,
            tolerance,
            max_iterations,
            restart,
        );
        for (i, value) in column.data.iter().enumerate() {
            x.data[i * b.columns + k] = *value;
        }
        most = most.max(iterations);
        worst = worst.max(residual);
    }
    Outcome {
        x,
        iterations: most,
        residual: worst,
    }
}

fn norm(x: &Columns) -> f64 {
    x.dots(x)[0].sqrt()
}

fn single(
    apply: &impl Fn(&Columns) -> Columns,
    precondition: &impl Fn(&mut Columns),
    b: &Columns,
    tolerance: f64,
    max_iterations: usize,
    restart: usize,
) -> (Columns, usize, f64) {
    let size = norm(b);
    let mut x = Columns::zeros(b.rows, 1);
    if size == 0.0 {
        return (x, 0, 0.0);
    }
    if !size.is_finite() {
        return (x, 0, f64::INFINITY);
    }
    let mut iterations = 0;
    loop {
        let mut r = b.clone();
        r.add_scaled(&apply(&x), &[-1.0]);
        let beta = norm(&r);
        if beta <= tolerance * size || iterations >= max_iterations {
            return (x, iterations, beta / size);
        }
        let before = beta;
        let mut basis = vec![scaled(&r, 1.0 / beta)];
        let mut h: Vec<Vec<f64>> = Vec::new();
        let mut rotations: Vec<(f64, f64)> = Vec::new();
        let mut g = vec![beta];
        for j in 0..restart {
            iterations += 1;
            let mut z = basis[j].clone();
            precondition(&mut z);
            let mut w = apply(&z);
            let mut column = Vec::with_capacity(j + 2);
            for v in &basis {
                let c = w.dots(v)[0];
                w.add_scaled(v, &[-c]);
                column.push(c);
            }
            let last = norm(&w);
            for (i, (c, s)) in rotations.iter().enumerate() {
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
            rotations.push((c, s));
            let top = g[j];
            g[j] = c * top;
            g.push(-s * top);
            h.push(column);
            let done = g[j + 1].abs() <= 0.5 * tolerance * size
                || last <= f64::EPSILON * radius
                || iterations >= max_iterations;
            if done || j + 1 == restart {
                break;
            }
            basis.push(scaled(&w, 1.0 / last));
        }
        let m = h.len();
        let mut y = vec![0.0; m];
        for i in (0..m).rev() {
            let sum: f64 = (i + 1..m).map(|k| h[k][i] * y[k]).sum();
            y[i] = if h[i][i] != 0.0 {
                (g[i] - sum) / h[i][i]
            } else {
                0.0
            };
        }
        let mut step = Columns::zeros(b.rows, 1);
        for (v, c) in basis.iter().zip(&y) {
            step.add_scaled(v, &[*c]);
        }
        precondition(&mut step);
        x.add_scaled(&step, &[1.0]);
        let mut r = b.clone();
        r.add_scaled(&apply(&x), &[-1.0]);
        let after = norm(&r);
        if after > 0.9 * before && m < restart {
            // Rounding ended the progress: report what was reached.
            return (x, iterations, after / size);
        }
    }
}

fn scaled(x: &Columns, factor: f64) -> Columns {
    Columns {
        data: x.data.iter().map(|v| v * factor).collect(),
        rows: x.rows,
        columns: x.columns,
    }
}
