//! Carlson's symmetric elliptic integrals, to near machine precision over any ratio of arguments.
//!
//! # References
//! B. C. Carlson, "Numerical computation of real or complex elliptic integrals", Numer. Algorithms 10
//! (1995) 13–26; NIST DLMF 19.16, 19.26, 19.36.

use num_dual::DualNum;

/// Spread of the arguments below which the series of [`r_d`] is exact to rounding: its error is of
/// the sixth power.
const SPREAD: f64 = 1.5e-3;
/// Duplication divides the spread by four, and the logarithm of large ratios by two: far fewer are
/// ever needed.
const MOST: usize = 200;

/// A number, or one that carries its derivatives: duplication is made of sums of positive terms, and what is true of them is true of those.
pub(crate) trait Number: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> Number for D {}

/// `R_D(x, y, z) = 3/2 ∫₀^∞ dt / (√(t+x) √(t+y) (t+z)^{3/2})`, for x, y ≥ 0 of which at most one is 0,
/// and z > 0. Symmetric in x and y.
pub(crate) fn r_d<D: Number>(mut x: D, mut y: D, mut z: D) -> D {
    let (mut sum, mut scale) = (D::from(0.0), 1.0);
    for _ in 0..MOST {
        let mean = (x.re() + y.re() + 3.0 * z.re()) / 5.0;
        let spread = |v: D| (mean - v.re()).abs() / mean;
        if spread(x).max(spread(y)).max(spread(z)) < SPREAD {
            break;
        }
        let [p, q, r] = [x.sqrt(), y.sqrt(), z.sqrt()];
        let shift = p * q + q * r + r * p;
        sum += D::from(scale) / (r * (z + shift));
        scale /= 4.0;
        [x, y, z] = [x, y, z].map(|v| (v + shift) / 4.0);
    }
    let mean = (x + y + z * 3.0) / 5.0;
    let (u, v) = ((mean - x) / mean, (mean - y) / mean);
    let w = -(u + v) / 3.0;
    let (uv, ww) = (u * v, w * w);
    let e2 = uv - ww * 6.0;
    let e3 = (uv * 3.0 - ww * 8.0) * w;
    let e4 = (uv - ww) * 3.0 * ww;
    let e5 = uv * ww * w;
    // DLMF 19.36.2.
    let series = e2 * (-3.0 / 14.0) + 1.0 + e3 / 6.0 + e2 * (9.0 / 88.0) * e2
        - e4 * (3.0 / 22.0)
        - e2 * (9.0 / 52.0) * e3
        + e5 * (3.0 / 26.0);
    sum * 3.0 + series * scale / (mean * mean.sqrt())
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
pub(crate) fn r_d_difference<D: Number>(mut x: D, mut y: D, mut z: D) -> D {
    let (mut sum, mut scale) = (D::from(0.0), 1.0);
    for _ in 0..MOST {
        // Weighted as the integrand, so that what is left is of second order in the spread.
        let mean = (x + y * 3.0 + z * 3.0) / 7.0;
        let rest = D::from(scale * 0.6) / (mean * mean * mean.sqrt());
        let spread = |v: D| ((mean.re() - v.re()) / mean.re()).abs();
        let spread = spread(x).max(spread(y)).max(spread(z));
        // Of derivatives what is left is of first order.
        let left = match D::NDERIV {
            0 => spread * spread,
            _ => spread,
        };
        if 4.0 * left * rest.re() <= f64::EPSILON / 8.0 * (sum.re() + rest.re()) {
            return sum + rest;
        }
        let [p, q, r] = [x.sqrt(), y.sqrt(), z.sqrt()];
        let shift = p * q + q * r + r * p;
        sum +=
            (y + q * r + z + shift) * (3.0 * scale) / (q * r * (q + r) * (y + shift) * (z + shift));
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
        assert!((r_d(4.0_f64, 4.0, 4.0) - 0.125).abs() < 1e-16);
        assert!((r_d(0.0_f64, 2.0, 1.0) - 1.797_210_352_103_388_3).abs() < 1e-15);
        assert!((r_d(2.0_f64, 3.0, 4.0) - 0.165_105_272_942_610_53).abs() < 1e-16);
    }
}
