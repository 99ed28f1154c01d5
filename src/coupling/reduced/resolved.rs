//! What an evaluation must not have come to, whatever computed it.

use super::Reduced;
use crate::adjoint::lie::{Pose, Vec3};
use crate::memory;
use crate::{Error, Result};
use nalgebra::DMatrix;

/// Condition number of I − LᵀGL above which the solutions of the bodies to one another lose their
/// meaning: at one digit lost the gap is far below what was fitted.
const ILL_CONDITIONED: f64 = 1e4;

/// Part of the water displaced that an energy may be below zero by: twists that move no water (a disc's
/// spin) carry what the one-body method leaves of them.
const ROUNDING: f64 = 1e-7;

impl Reduced {
    /// Whether what one evaluation is solved with can be had: I − LᵀGL, and what the bodies of every pair that never fades see of each other.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the bytes that it would take.
    pub(super) fn check_memory(&self) -> Result<()> {
        let lasting = self.links.iter().filter(|link| link.cutoff.is_none());
        let columns = |b: usize| (self.bodies[b].modes() + 6) as f64;
        let blocks = lasting.map(|link| columns(link.target) * columns(link.source));
        check_factor(&self.names, self.mode_count() as f64, blocks.sum())
    }

    /// The error of a system I − LᵀGL that isn't positive definite: some vector's quotient is `value`.
    pub(crate) fn indefinite(&self, poses: &[Pose], value: f64) -> Error {
        let quantity = "smallest eigenvalue of I − LᵀGL, at most";
        closest(self, poses, quantity, value.min(0.0))
    }

    /// Refuses momenta that mean nothing, and a system of too large a condition number.
    ///
    /// # Errors
    /// [`Error::Unresolved`] with the bodies and what was found.
    pub(crate) fn check_solution(
        &self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        momenta: &DMatrix<f64>,
        condition: f64,
    ) -> Result<()> {
        check_energy(self, basis, momenta)?;
        if condition > ILL_CONDITIONED {
            return Err(closest(self, poses, "condition number", condition));
        }
        Ok(())
    }
}

/// Whether the factor of so many modes, with blocks of so many numbers beside it, can be had.
fn check_factor(names: &[String], modes: f64, blocks: f64) -> Result<()> {
    let twists = 6.0 * names.len() as f64;
    // With what the modes see of twists, and twists of each other.
    let numbers = modes * (modes + twists) + twists * twists + blocks;
    let first = names.first().map_or("", String::as_str);
    memory::fits(
        &format!(
            "coupling {} bodies, {first:?} the first, by a factor of their {modes} modes",
            names.len()
        ),
        memory::numbers(numbers),
        "use the exchange products, a coarser accuracy, or the fidelity auto, whose pairs fade out",
    )
}

/// What the pair of bodies that come closest, against what they resolve, doesn't.
fn closest(reduced: &Reduced, poses: &[Pose], quantity: &str, value: f64) -> Error {
    let parts = |b: usize| reduced.bodies[b].parts();
    let world = |b: usize, p: &Vec3| poses[b].apply(p);
    let mut worst = (f64::INFINITY, String::from("all bodies"), [0.0; 2]);
    for link in &reduced.links {
        let (t, s) = (parts(link.target), parts(link.source));
        let seen = |p: &Vec3| link.image.linear * world(link.source, p) + link.image.shift;
        let points: Vec<Vec3> = s.points.iter().map(seen).collect();
        let distance = |p: &Vec3| {
            let p = world(link.target, p);
            points
                .iter()
                .map(|q| (p - q).norm())
                .fold(f64::INFINITY, f64::min)
        };
        let d = t.points.iter().map(distance).fold(f64::INFINITY, f64::min);
        // Sources lie as deep as the gap asks for: those of small bodies are always nearer to each other.
        let resolved = t.fit.resolved_gap.max(s.fit.resolved_gap);
        let nearness = d / resolved.max(f64::MIN_POSITIVE);
        if nearness < worst.0 {
            let of = |name: &str| format!("body {name:?}");
            let (one, other) = (&reduced.names[link.target], &reduced.names[link.source]);
            let place = match (link.target == link.source, link.image.is_identity()) {
                (true, _) => format!("{} and a wall", of(one)),
                (false, true) => format!("{} and {}", of(one), of(other)),
                (false, false) => format!("{} and {} by a wall", of(one), of(other)),
            };
            worst = (nearness, place, [d, resolved]);
        }
    }
    let (_, place, [distance, resolved]) = worst;
    Error::Unresolved {
        place,
        quantity: format!(
            "coupling of their compressed sources, {distance:.3e} m apart, fitted for surfaces at \
             least {resolved:.3e} m apart: {quantity}"
        ),
        value,
        limit: if value > 0.0 { ILL_CONDITIONED } else { 0.0 },
        remedy: "the bodies overlap or their gap isn't resolved: use more faces, a smaller resolved gap, \
                 a higher rank, or the fidelity full"
            .into(),
    }
}

/// The energy of the basis must not be negative beyond rounding.
fn check_energy(reduced: &Reduced, basis: &DMatrix<f64>, momenta: &DMatrix<f64>) -> Result<()> {
    let mut energy = basis.tr_mul(momenta);
    let k = energy.nrows();
    // Twists that hardly move water (a round body's spin) have no energy: shift by rounding.
    let own: Vec<f64> = (0..k)
        .map(|i| {
            let bodies = reduced.bodies.iter().enumerate();
            let inertia = bodies
                .map(|(b, body)| body.displaced(&basis.fixed_view::<6, 1>(6 * b, i).into_owned()));
            inertia.sum::<f64>()
        })
        .collect();
    let bodies = reduced.bodies.iter().map(|b| b.deficit());
    let rounding = ROUNDING + 2.0 * bodies.fold(0.0, f64::max);
    for i in 0..k {
        if own[i] > 0.0 {
            energy[(i, i)] += rounding * own[i];
        } else {
            energy[(i, i)] = 1.0;
        }
    }
    if energy.iter().all(|x| x.is_finite()) && energy.clone().cholesky().is_some() {
        return Ok(());
    }
    let symmetric = 0.5 * (&energy + energy.transpose());
    // What moves no body in the water has nothing to be scaled by. Roots by themselves: a product of small numbers may be none.
    let scale = |i: usize| if own[i] > 0.0 { own[i].sqrt() } else { 1.0 };
    let scaled = DMatrix::from_fn(k, k, |i, j| symmetric[(i, j)] / scale(i) / scale(j));
    let lowest = scaled.symmetric_eigenvalues().min();
    Err(Error::Unresolved {
        place: format!("bodies {}", reduced.names.join(", ")),
        quantity: "smallest eigenvalue of their added mass, scaled by the water displaced".into(),
        value: lowest,
        limit: 0.0,
        remedy:
            "a gap isn't resolved: use more faces, a smaller resolved gap, a higher rank, or the \
                 fidelity full"
                .into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjoint::lie::Mat6;
    use crate::coupling::reduced::{CompressedParts, Fit, ReducedBody};
    use std::sync::Arc;

    /// Two balls, and a third motion, of a joint of a body that isn't in the water.
    #[test]
    fn a_dry_joint_leaves_the_error_a_number() {
        let parts = CompressedParts {
            name: "ball".into(),
            points: vec![Vec3::zeros()],
            modes: DMatrix::zeros(1, 0),
            strengths: DMatrix::zeros(1, 6),
            added_mass: Mat6::identity(),
            centre: Vec3::zeros(),
            radius: 1.0,
            volume: 4.0,
            fit: Fit::default(),
        };
        let ball = Arc::new(ReducedBody::new(parts).unwrap());
        let reduced = Reduced::new(vec![ball; 2], &[], |_, _| None).unwrap();
        let mut basis = DMatrix::zeros(12, 3);
        (basis[(0, 0)], basis[(6, 1)]) = (1.0, 1.0);
        assert!(check_energy(&reduced, &basis, &basis).is_ok());
        // More between them than their own.
        let mut momenta = basis.clone();
        (momenta[(0, 1)], momenta[(6, 0)]) = (2.0, 2.0);
        let error = check_energy(&reduced, &basis, &momenta).unwrap_err();
        let Error::Unresolved { value, .. } = error else {
            panic!("{error}");
        };
        // (1 − 2)/4, but for rounding.
        assert!((value + 0.25).abs() < 1e-3, "{value}");
    }

    #[test]
    fn a_factor_that_does_not_fit_is_refused_before_it_is_made() {
        let names: Vec<String> = (0..9).map(|k| format!("stone {k}")).collect();
        assert!(check_factor(&names, 1e3, 1e4).is_ok());
        let said = check_factor(&names, 1e8, 0.0).unwrap_err().to_string();
        for part in [
            "9 bodies",
            "stone 0",
            "100000000 modes",
            "8.0",
            "bytes",
            "products",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
}
