//! The coupling against what the bodies themselves solution, at the configuration itself.
//!
//! The charges α of the other bodies and of images, at y in a body's frame, are a flow that the body
//! was not fitted to. What the compressed body solutions there is `E L Lᵀ Eᵀ` and `E Ū`,
//! `E_ij = 1/|y_i − x̄_j|`; what the body solutions by its own method is Φ and φ. M̄_f depends on the
//! solutions in such a way that their differences enter, to first order, through α alone:
//!
//! ```text
//! δM = Σ_bodies { δM̄₀ + 4π [ α_yᵀ (Φ − E L Lᵀ Eᵀ) α_y + α_yᵀ (φ − E Ū) + (φ − E Ū)ᵀ α_y ] } + 4π αᵀ δG α
//! ```
//!
//! δG being what pairs that fade out leave out.

use super::Reduced;
use super::linearised::ReducedLinearised;
use super::views::{FLUX, dense};
use crate::Result;
use crate::adjoint::kernel::{Points, Sources, Write, potential_fill};
use crate::adjoint::lie::{Pose, Vec3};
use crate::boundary::Response;
use crate::coupling::pair::Pair;
use nalgebra::DMatrix;
use std::sync::Arc;

impl Reduced {
    /// To first order, how much `basisᵀ M̄_f basis` is off at `poses` if the bodies really solution as
    /// `solutions` do (one a body): symmetric, columns of `basis` squared.
    ///
    /// # Errors
    /// What [`Coupling::evaluate`](crate::coupling::Coupling::evaluate) and the solutions report.
    pub fn correction(
        &self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        solutions: &[Arc<dyn Response>],
    ) -> Result<DMatrix<f64>> {
        let solved = ReducedLinearised::new(self, poses, basis)?;
        let k = basis.ncols();
        let mut out = DMatrix::zeros(k, k);
        for (b, solution) in solutions.iter().enumerate() {
            let parts = self.bodies[b].parts();
            let twists = basis.rows(6 * b, 6);
            let own = solution.added_mass() - parts.added_mass;
            out += twists.tr_mul(&(own * twists));
            // Charges of the others, in this body's frame.
            let (mut places, mut rows, mut faded) = (Vec::new(), Vec::new(), Vec::new());
            for link in &self.links {
                for (_, source) in link.ends().filter(|(target, _)| *target == b) {
                    let (_, _, [weight, ..]) = link.reach(&self.bodies, poses);
                    let points = &self.bodies[source].parts().points;
                    let (at, from) = ((b, &poses[b]), (source, &poses[source]));
                    places.extend(Pair::new(at, from, &link.image, points).positions);
                    rows.extend(self.points[source].clone().map(|j| (j, link.image.sign)));
                    faded.extend(vec![1.0 - weight; points.len()]);
                }
            }
            if places.is_empty() {
                continue;
            }
            let charges = DMatrix::from_fn(rows.len(), k, |i, c| {
                rows[i].1 * solved.alpha[(rows[i].0, c)]
            });
            let field = inverse_distances(&places, &parts.points);
            let seen = parts.modes.tr_mul(&field.tr_mul(&charges));
            let answered = dense(&solution.scattered(&places, &places)?);
            let scattered = charges.tr_mul(&(answered * &charges)) - seen.tr_mul(&seen);
            let answered = dense(&solution.radiated(&places)?);
            let radiated = charges.tr_mul(&((answered - &field * &parts.strengths) * twists));
            let faint = DMatrix::from_fn(rows.len(), k, |i, c| faded[i] * charges[(i, c)]);
            let alpha = solved.alpha.rows(self.points[b].start, parts.points.len());
            let missing = alpha.tr_mul(&field.tr_mul(&faint));
            out += FLUX * (scattered + &radiated + radiated.transpose() + missing);
        }
        Ok(0.5 * (&out + out.transpose()))
    }
}

/// `1/|y_i − x_j|`.
fn inverse_distances(y: &[Vec3], x: &[Vec3]) -> DMatrix<f64> {
    let mut out = vec![0.0; y.len() * x.len()];
    let sources = Sources::new(x);
    potential_fill(&Points::bare(y), &sources, Write::Set, &mut out, x.len(), 0);
    DMatrix::from_row_slice(y.len(), x.len(), &out)
}
