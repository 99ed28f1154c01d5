//! Inertias that stay physical: by the triangular root of the second moments of mass.
//!
//! With Σ = ∫ x xᵀ dm about the centre of mass, I = tr Σ · 1 − Σ. Any distribution of mass has a Σ that is positive semi-definite, and any such Σ is one's: with Σ = L Lᵀ, L upper
//! triangular with a positive diagonal, each L is an inertia, triangle inequalities of its moments included, and each inertia of a body that isn't flat has one L.
//!
//! # References
//! P. M. Wensing, S. Kim, J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial parameter identification", IEEE RA-L 3 (2018) 60–67; C. Rucker,
//! P. M. Wensing, "Smooth parameterization of rigid-body inertia", IEEE RA-L 7 (2022) 2771–2778.

use crate::simulate::Simulator;
use crate::{Error, Result};
use nalgebra::{Matrix3, Matrix6};

/// Entries of the root and of the inertia, in order.
pub(super) const ENTRIES: [&str; 6] = ["xx", "yy", "zz", "xy", "xz", "yz"];

/// Names of a body's inertia among the parameters.
pub(super) fn parameters(body: &str) -> [String; 6] {
    ENTRIES.map(|entry| format!("{body}.inertia.{entry}"))
}

/// A body's inertia in a simulator, by its root.
///
/// # Errors
/// A body that isn't there, and one whose mass lies in a plane.
pub(super) fn of(simulator: &Simulator, body: &str) -> Result<[f64; 6]> {
    let mut inertia = [0.0; 6];
    for (x, name) in inertia.iter_mut().zip(parameters(body)) {
        *x = simulator.parameters().get(&name)?;
    }
    root(&inertia).ok_or_else(|| {
        Error::input(
            format!("unknown inertia of body {body:?}"),
            format!("{inertia:?} (xx, yy, zz, xy, xz, yz)"),
            "only an inertia has a root each of whose principal moments is less than the sum of the others: start from one that isn't that of a plate or a rod without thickness",
        )
    })
}

/// L of an inertia about the centre of mass, xx, yy, zz, xy, xz, yz, in √kg m.
fn root([xx, yy, zz, xy, xz, yz]: &[f64; 6]) -> Option<[f64; 6]> {
    let half = 0.5 * (xx + yy + zz);
    let least = 1e-12 * half;
    let part = |square: f64| (square > least).then(|| square.sqrt());
    // Σ, from its last row up.
    let l33 = part(half - zz)?;
    let (l13, l23) = (-xz / l33, -yz / l33);
    let l22 = part(half - yy - l23 * l23)?;
    let l12 = (-xy - l13 * l23) / l22;
    let l11 = part(half - xx - l12 * l12 - l13 * l13)?;
    Some([l11, l22, l33, l12, l13, l23])
}

/// L as a matrix.
fn matrix([l11, l22, l33, l12, l13, l23]: &[f64; 6]) -> Matrix3<f64> {
    Matrix3::new(*l11, *l12, *l13, 0.0, *l22, *l23, 0.0, 0.0, *l33)
}

/// The inertia of a matrix of second moments.
fn of_moments(moments: &Matrix3<f64>) -> [f64; 6] {
    let trace = moments.trace();
    let at = |i: usize| trace - moments[(i, i)];
    let mixed = |i: usize, j: usize| -moments[(i, j)];
    [at(0), at(1), at(2), mixed(0, 1), mixed(0, 2), mixed(1, 2)]
}

/// The inertia of a root.
pub(super) fn inertia(root: &[f64; 6]) -> [f64; 6] {
    let l = matrix(root);
    of_moments(&(l * l.transpose()))
}

/// Derivatives of the inertia (rows) by the root's entries.
pub(super) fn slope(root: &[f64; 6]) -> Matrix6<f64> {
    let l = matrix(root);
    let mut out = Matrix6::zeros();
    for k in 0..6 {
        let mut unit = [0.0; 6];
        unit[k] = 1.0;
        let d = matrix(&unit);
        let change = of_moments(&(d * l.transpose() + l * d.transpose()));
        out.set_column(k, &change.into());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{inertia, root, slope};

    const ROOT: [f64; 6] = [0.7, 0.4, 0.9, -0.2, 0.3, 0.15];

    /// There and back, to rounding; a plate has none.
    #[test]
    fn roots_are_those_of_their_inertias() {
        let found = root(&inertia(&ROOT)).unwrap();
        for (a, b) in found.iter().zip(ROOT) {
            assert!((a - b).abs() < 1e-14, "{found:?}");
        }
        assert_eq!(root(&[1.0, 1.0, 2.0, 0.0, 0.0, 0.0]), None);
        assert_eq!(root(&[1.0, 1.0, 2.1, 0.0, 0.0, 0.0]), None);
        assert_eq!(root(&[0.0; 6]), None);
    }

    /// Any numbers are an inertia: none of the principal moments is over the sum of the others.
    #[test]
    fn every_root_is_an_inertia() {
        let mut x = 0.37_f64;
        let mut next = || {
            x = (x * 3.9 * (1.0 - x)).clamp(1e-3, 1.0 - 1e-3);
            4.0 * x - 2.0
        };
        for _ in 0..200 {
            let all: [f64; 6] = std::array::from_fn(|_| next());
            let [xx, yy, zz, xy, xz, yz] = inertia(&all);
            let m = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
            let mut moments = m.symmetric_eigenvalues();
            moments.as_mut_slice().sort_by(f64::total_cmp);
            let rounding = 1e-12 * moments[2];
            assert!(moments[0] >= -rounding && moments[2] <= moments[0] + moments[1] + rounding);
        }
    }

    #[test]
    fn slopes_are_the_differences() {
        let made = slope(&ROOT);
        for k in 0..6 {
            let moved = |h: f64| {
                let mut at = ROOT;
                at[k] += h;
                inertia(&at)
            };
            let (up, down) = (moved(1e-6), moved(-1e-6));
            for i in 0..6 {
                let difference = (up[i] - down[i]) / 2e-6;
                assert!((difference - made[(i, k)]).abs() < 1e-9, "{i} {k}");
            }
        }
    }
}
