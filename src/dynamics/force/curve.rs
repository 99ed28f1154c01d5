//! Curves of one argument, C¹ in it and in the parameters that they are made of: thrust by command, the share of a current by depth.
//!
//! A polynomial is odd: Σ c_k |g|^(k−1) g, k = 1, 2, …: a linear one, one of |g| g and so on. A table is a cubic Hermite curve through points, straight beyond the
//! first and the last. With a and b the slopes of the lines on both sides of a point, the curve's slope there is 8 a² b² / (a + b)³ where they have one sign and zero
//! where they don't: it is that of a line where the points lie on one, and so is never over 1.2 times the smaller of both, under the three times from which on a
//! cubic between them stops being monotone (F. N. Fritsch, R. E. Carlson, *Monotone piecewise cubic interpolation*, SIAM J. Numer. Anal. 17, 1980). Unlike the
//! harmonic mean that is usual, it goes to zero with a zero slope: the curve has a gradient with respect to its points also beside a flat.

use crate::dynamics::parameters::{Parameter, Parameters};

/// A curve through the origin, or through points.
pub(super) enum Curve {
    /// c₁, c₂, …
    Polynomial(Vec<Parameter>),
    /// Arguments, which rise, and the value at each.
    Table {
        arguments: Vec<f64>,
        values: Vec<Parameter>,
    },
}

/// A curve at an argument.
pub(super) struct At {
    /// The value.
    pub value: f64,
    /// Its derivative.
    pub slope: f64,
    /// Derivatives of the value with respect to parameters.
    pub by: Vec<(Parameter, f64)>,
}

impl Curve {
    pub fn at(&self, g: f64, parameters: &Parameters) -> At {
        match self {
            Self::Polynomial(coefficients) => polynomial(coefficients, g, parameters),
            Self::Table {
                arguments,
                values: given,
            } => {
                let values: Vec<f64> = given.iter().map(|t| parameters[*t]).collect();
                let (value, slope, by) = table(arguments, &values, g);
                let by = by.into_iter().map(|(i, x)| (given[i], x)).collect();
                At { value, slope, by }
            }
        }
    }

    /// An argument as large as they come: a table's farthest from zero, or one.
    pub fn large(&self) -> f64 {
        match self {
            Self::Polynomial(_) => 1.0,
            Self::Table { arguments, .. } => arguments.iter().fold(0.0, |m, u| m.max(u.abs())),
        }
    }
}

fn polynomial(coefficients: &[Parameter], g: f64, parameters: &Parameters) -> At {
    let mut out = At {
        value: 0.0,
        slope: 0.0,
        by: Vec::with_capacity(coefficients.len()),
    };
    // |g|^(k−1)
    let mut power = 1.0;
    for (k, c) in coefficients.iter().enumerate() {
        out.value += parameters[*c] * power * g;
        out.slope += (k + 1) as f64 * parameters[*c] * power;
        out.by.push((*c, power * g));
        power *= g.abs();
    }
    out
}

/// Slope at a point between lines of the slopes `a` and `b`, with its derivatives by them.
fn between(a: f64, b: f64) -> (f64, f64, f64) {
    if a == 0.0 || b == 0.0 || (a > 0.0) != (b > 0.0) {
        return (0.0, 0.0, 0.0);
    }
    let (p, q) = (a / (a + b), b / (a + b));
    (
        8.0 * p * p * q * q * (a + b),
        8.0 * p * q * q * (2.0 * q - p),
        8.0 * p * p * q * (2.0 * p - q),
    )
}

/// Value, slope, and the value's derivatives by those of the points that it depends on.
fn table(x: &[f64], y: &[f64], at: f64) -> (f64, f64, Vec<(usize, f64)>) {
    let last = x.len() - 1;
    let line = |i: usize| (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
    if at <= x[0] || at >= x[last] {
        let (i, end) = if at <= x[0] { (0, 0) } else { (last - 1, last) };
        let (slope, along) = (line(i), (at - x[end]) / (x[i + 1] - x[i]));
        let value = y[end] + slope * (at - x[end]);
        return (value, slope, vec![(end, 1.0), (i, -along), (i + 1, along)]);
    }
    let i = x.partition_point(|x| *x <= at).clamp(1, last) - 1;
    let h = x[i + 1] - x[i];
    let t = (at - x[i]) / h;
    // The slope at a point, and its derivatives by the lines beside it.
    let slope_at = |k: usize| -> (f64, Vec<(usize, f64)>) {
        if k == 0 || k == last {
            let i = k.min(last - 1);
            return (line(i), vec![(i, 1.0)]);
        }
        let (slope, by_a, by_b) = between(line(k - 1), line(k));
        (slope, vec![(k - 1, by_a), (k, by_b)])
    };
    let (s0, by0) = slope_at(i);
    let (s1, by1) = slope_at(i + 1);
    let (tt, ttt) = (t * t, t * t * t);
    let rise = 3.0 * tt - 2.0 * ttt;
    let (w0, w1) = (h * (ttt - 2.0 * tt + t), h * (ttt - tt));
    let value = y[i] + rise * (y[i + 1] - y[i]) + w0 * s0 + w1 * s1;
    let slope =
        6.0 * (t - tt) * line(i) + (3.0 * tt - 4.0 * t + 1.0) * s0 + (3.0 * tt - 2.0 * t) * s1;
    let mut by = vec![(i, 1.0 - rise), (i + 1, rise)];
    for (w, lines) in [(w0, by0), (w1, by1)] {
        for (k, x_k) in lines {
            let part = w * x_k / (x[k + 1] - x[k]);
            by.extend([(k, -part), (k + 1, part)]);
        }
    }
    (value, slope, by)
}

#[cfg(test)]
mod tests {
    use super::{between, table};

    const X: [f64; 6] = [-1.0, -0.4, -0.1, 0.2, 0.5, 1.0];
    const Y: [f64; 6] = [-30.0, -8.0, 0.0, 0.0, 12.0, 50.0];

    /// Through its points, C¹ across them, monotone between and straight beyond, never beyond a flat's value.
    #[test]
    fn a_table_is_smooth_and_monotone() {
        for (x, y) in X.iter().zip(Y) {
            assert!((table(&X, &Y, *x).0 - y).abs() < 1e-13);
            let [left, right] = [x - 1e-9, x + 1e-9].map(|x| table(&X, &Y, x).1);
            assert!((left - right).abs() < 1e-5, "{left} {right}");
        }
        let samples: Vec<f64> = (0..=4000)
            .map(|i| -1.5 + 3.0 * f64::from(i) / 4000.0)
            .collect();
        let values: Vec<f64> = samples.iter().map(|x| table(&X, &Y, *x).0).collect();
        assert!(values.windows(2).all(|v| v[1] >= v[0]));
        assert_eq!(table(&X, &Y, 0.05).0, 0.0);
        let beyond = table(&X, &Y, 1.2);
        assert!((beyond.0 - (50.0 + 0.2 * 76.0)).abs() < 1e-12 && beyond.1 == 76.0);
    }

    /// Slope by the command, and derivatives by the points, against differences: 1e-7 of the largest.
    #[test]
    fn a_table_has_its_derivatives() {
        let bent = [-30.0, -8.0, -1.0, 2.0, 12.0, 50.0];
        let h = 1e-6;
        for at in [-1.3, -0.8, -0.2, 0.03, 0.3, 0.77, 1.4] {
            let (_, slope, by) = table(&X, &bent, at);
            let difference = (table(&X, &bent, at + h).0 - table(&X, &bent, at - h).0) / (2.0 * h);
            assert!(
                (slope - difference).abs() < 1e-7 * 76.0,
                "{at}: {slope} {difference}"
            );
            for k in 0..X.len() {
                let moved = |h: f64| {
                    let mut y = bent;
                    y[k] += h;
                    table(&X, &y, at).0
                };
                let difference = (moved(h) - moved(-h)) / (2.0 * h);
                let found: f64 = by.iter().filter(|b| b.0 == k).map(|b| b.1).sum();
                assert!(
                    (found - difference).abs() < 1e-7,
                    "{at}, {k}: {found} {difference}"
                );
            }
        }
    }

    #[test]
    fn slopes_between_lines() {
        assert_eq!(between(3.0, 3.0), (3.0, 0.5, 0.5));
        assert_eq!(between(-2.0, 3.0).0, 0.0);
        assert!(between(1e-200, 1e-200).0 > 0.0);
        for a in [0.01, 0.3, 1.0, 7.0, 1e3] {
            assert!(between(a, 1.0).0 <= 1.2 * f64::min(a, 1.0));
        }
    }
}
