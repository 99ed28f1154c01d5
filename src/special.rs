//! Carlson's symmetric elliptic integrals, to near machine precision over any ratio of arguments.
//!
//! # References
//! B. C. Carlson, "Numerical computation of real or complex elliptic integrals", Numer. Algorithms 10
//! (1995) 13–26; NIST DLMF 19.16, 19.26, 19.36.

/// Spread of the arguments below which the series of [`r_d`] is exact to rounding: its error is of
/// the sixth power.
const SPREAD: f64 = 1.5e-3;
/// Duplication divides the spread by four, and the logarithm of large ratios by two: far fewer are
/// ever needed.
const MOST: usize = 200;

/// `R_D(x, y, z) = 3/2 ∫₀^∞ dt / (√(t+x) √(t+y) (t+z)^{3/2})`, for x, y ≥ 0 of which at most one is 0,
/// and z > 0. Symmetric in x and y.
pub(crate) fn r_d(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    let (mut sum, mut scale) = (0.0, 1.0);
    for _ in 0..MOST {
        let mean = (x + y + 3.0 * z) / 5.0;
        let spread = |v: f64| (mean - v).abs() / mean;
        if spread(x).max(spread(y)).max(spread(z)) < SPREAD {
            break;
        }
        let [p, q, r] = [x.sqrt(), y.sqrt(), z.sqrt()];
        let shift = p * q + q * r + r * p;
        sum += scale / (r * (z + shift));
        scale /= 4.0;
        [x, y, z] = [x, y, z].map(|v| (v + shift) / 4.0);
    }
    let mean = (x + y + 3.0 * z) / 5.0;
    let (u, v) = ((mean - x) / mean, (mean - y) / mean);
    let w = -(u + v) / 3.0;
    let (uv, ww) = (u * v, w * w);
    let e2 = uv - 6.0 * ww;
    let e3 = (3.0 * uv - 8.0 * ww) * w;
    let e4 = 3.0 * (uv - ww) * ww;
    let e5 = uv * ww * w;
    // DLMF 19.36.2.
    let series = 1.0 - 3.0 / 14.0 * e2 + e3 / 6.0 + 9.0 / 88.0 * e2 * e2
        - 3.0 / 22.0 * e4
        - 9.0 / 52.0 * e2 * e3
        + 3.0 / 26.0 * e5;
    3.0 * sum + scale * series / (mean * mean.sqrt())
}

/// `[R_D(x, y, z) − R_D(x, z, y)] / (y − z) = 3/2 ∫₀^∞ dt / (√(t+x) (t+y)^{3/2} (t+z)^{3/2})`, right at
/// y = z too; x ≥ 0, y, z > 0.
///
/// The difference of two duplication steps, divided by y − z: with s = √x√y + √y√z + √z√x,
///
/// ```text
/// D(x, y, z) = D(¼(x+s), ¼(y+s), ¼(z+s)) / 16
///            + 3 (y + √(yz) + z + s) / [√(yz) (√y + √z) (y + s) (z + s)]
/// ```
///
/// all positive, nothing cancels; D(m, m, m) = ⅗ m^{−5/2}.
pub(crate) fn r_d_difference(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    let (mut sum, mut scale) = (0.0, 1.0);
    for _ in 0..MOST {
        // Weighted as the integrand, so that what is left is of second order in the spread.
        let mean = (x + 3.0 * y + 3.0 * z) / 7.0;
        let rest = scale * 0.6 / (mean * mean * mean.sqrt());
        let spread = |v: f64| ((mean - v) / mean).abs();
        let spread = spread(x).max(spread(y)).max(spread(z));
        if 4.0 * spread * spread * rest <= f64::EPSILON / 8.0 * (sum + rest) {
            return sum + rest;
        }
        let [p, q, r] = [x.sqrt(), y.sqrt(), z.sqrt()];
        let shift = p * q + q * r + r * p;
        sum +=
            3.0 * scale * (y + q * r + z + shift) / (q * r * (q + r) * (y + shift) * (z + shift));
        scale /= 16.0;
        [x, y, z] = [x, y, z].map(|v| (v + shift) / 4.0);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `∫ f(t) dt` over t > 0, with t = e^u, by the trapezoidal rule: spectral for these integrands.
    fn integral(f: impl Fn(f64) -> f64) -> f64 {
        let h = 0.02;
        (-6000..6000)
            .map(|i| {
                let t = (h * f64::from(i)).exp();
                h * t * f(t)
            })
            .sum()
    }

    const ARGUMENTS: [[f64; 3]; 7] = [
        [1.0, 1.0, 1.0],
        [0.3, 0.7, 2.0],
        [1.0, 1e-8, 1.0],
        [1.0, 1.0, 1e-8],
        [1e8, 1e-8, 1.0],
        [1e-16, 1.0, 1.0],
        [2.0, 1.0, 1.0 + 1e-9],
    ];

    #[test]
    fn integrals_agree_with_quadrature() {
        for [x, y, z] in ARGUMENTS {
            let root = |t: f64| ((t + x) * (t + y) * (t + z)).sqrt();
            let exact = integral(|t| 1.5 / (root(t) * (t + z)));
            assert!((r_d(x, y, z) / exact - 1.0).abs() < 5e-15, "{x} {y} {z}");
            let exact = integral(|t| 1.5 / (root(t) * (t + y) * (t + z)));
            let got = r_d_difference(x, y, z);
            assert!(
                (got / exact - 1.0).abs() < 5e-15,
                "{x} {y} {z}: {got} {exact}"
            );
        }
    }

    #[test]
    fn known_values() {
        // DLMF 19.20.18, and R_D(0, 2, 1) of Carlson's table.
        assert!((r_d(4.0, 4.0, 4.0) - 0.125).abs() < 1e-16);
        assert!((r_d(0.0, 2.0, 1.0) - 1.797_210_352_103_388_3).abs() < 1e-15);
        assert!((r_d(2.0, 3.0, 4.0) - 0.165_105_272_942_610_53).abs() < 1e-16);
    }
}
