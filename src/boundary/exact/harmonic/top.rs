//! The angular parts of ellipsoidal harmonics: eigenfunctions of `T = A L₁² + B L₂²` (axes in falling order
//! of length) among the spherical harmonics of one degree n.
//!
//! T is the Hamiltonian of an asymmetric top. Quantised about an axis u with the others v, w,
//!
//! ```text
//! T = t_u L_u² + s (L² − L_u²) + d (L_v² − L_w²),   s = (t_v + t_w)/2,  d = (t_v − t_w)/2,  t = (A, B, 0)
//! ```
//!
//! and L_v² − L_w² = ½(L₊² + L₋²) couples orders m and m ± 2 of the cosines among themselves and of the sines:
//! four symmetric tridiagonal matrices a degree. u is the axis about which the body is nearest to round;
//! where it is round, d = 0 and the matrices are diagonal.
//!
//! # References
//! S. C. Wang, "On the asymmetrical top in quantum mechanics", Phys. Rev. 34 (1929) 243–252;
//! R. D. Spence, "Angular momentum in sphero-conal coordinates", Am. J. Phys. 27 (1959) 329–335.

use super::tridiagonal;
use crate::adjoint::lie::Vec3;
use crate::error::in_order;
use crate::{Error, Result};
use faer::Mat;
use rayon::prelude::*;

/// The axes and coefficients of T for one ellipsoid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Top {
    /// u, v, w among the axes in falling order of length.
    axes: [usize; 3],
    /// t_u.
    along: f64,
    /// s.
    mean: f64,
    /// d.
    difference: f64,
}

/// Functions that mix: cosines or sines of m φ with m even or odd.
#[derive(Clone, Debug)]
pub(super) struct Class {
    pub sine: bool,
    /// The orders m.
    pub orders: Vec<usize>,
    /// Whether the functions are odd along the shortest axis.
    pub odd: bool,
    /// Eigenvalues of T.
    pub values: Vec<f64>,
    /// Eigenvectors, orders × values; none where each function is its own.
    pub vectors: Option<Mat<f64>>,
}

impl Top {
    /// From A ≥ B ≥ 0.
    pub fn new(a: f64, b: f64) -> Self {
        if a - b <= b {
            Self {
                axes: [2, 0, 1],
                along: 0.0,
                mean: 0.5 * (a + b),
                difference: 0.5 * (a - b),
            }
        } else {
            Self {
                axes: [0, 1, 2],
                along: a,
                mean: 0.5 * b,
                difference: 0.5 * b,
            }
        }
    }

    /// Components (u, v, w) of a direction.
    pub fn components(&self, x: &Vec3) -> [f64; 3] {
        self.axes.map(|i| x[i])
    }

    /// The four classes of degree n (fewer for n < 2).
    pub fn classes(&self, n: usize) -> Result<Vec<Class>> {
        let kinds = [(false, 0), (false, 1), (true, 2), (true, 1)];
        let each = kinds.into_par_iter().filter(|&(_, first)| first <= n);
        in_order(each.map(|(sine, first)| self.class(n, sine, (first..=n).step_by(2).collect())))
    }

    fn class(&self, n: usize, sine: bool, orders: Vec<usize>) -> Result<Class> {
        let l = n as f64;
        let total = l * (l + 1.0);
        let diagonal: Vec<f64> = orders
            .iter()
            .map(|&m| {
                let square = (m * m) as f64;
                let own = self.along * square + self.mean * (total - square);
                // L₊² takes −1 to 1.
                let fold = if m == 1 { 0.5 * total } else { 0.0 };
                own + self.difference * if sine { fold } else { -fold }
            })
            .collect();
        let odd = if self.axes[0] == 2 {
            (n - orders[0]) % 2 == 1
        } else {
            sine
        };
        let (values, vectors) = if self.difference == 0.0 {
            (diagonal, None)
        } else {
            let beside = orders
                .windows(2)
                .map(|pair| {
                    let m = pair[0] as f64;
                    let up = (l - m) * (l + m + 1.0) * (l - m - 1.0) * (l + m + 2.0);
                    let fold = if m == 0.0 { 2.0 } else { 1.0 };
                    0.5 * self.difference * (fold * up).sqrt()
                })
                .collect();
            let (values, vectors) =
                tridiagonal::eigen(diagonal, beside).ok_or_else(|| Error::Unresolved {
                    place: "ellipsoid".into(),
                    quantity: "degree of a harmonic without eigenfunctions".into(),
                    value: l,
                    limit: l,
                    remedy: "use a mesh".into(),
                })?;
            (values, Some(vectors))
        };
        Ok(Class {
            sine,
            orders,
            odd,
            // Not negative but for rounding.
            values: values.into_iter().map(|v: f64| v.max(0.0)).collect(),
            vectors,
        })
    }
}
