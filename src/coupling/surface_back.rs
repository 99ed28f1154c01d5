//! The transpose of the flow on surfaces.
//!
//! With cotangents φ̄ of the potentials and ψ̄ of their rates, and Λ_c(g; x̄) = cᵀ φ(g; x̄), linear in the twists x̄, the rates being
//! φ' = φ(g; x̄') + D_Z φ(g; x̄) for the displacement Z with which the bodies move,
//!
//! ```text
//! φ̄ᵀφ + ψ̄ᵀφ' = d/dε Λ_{ψ̄ + ε φ̄}(exp(εZ) g; x̄ + ε x̄')
//! ```
//!
//! is a derivative of Λ along one direction, and its gradient a product with the Hessian of Λ: what one adjoint solve for ψ̄, and its tangent along
//! that direction, give. Of a body that sees the sources α of others ([`super::surface`]), with `m = (½ I + Ω/4π)⁻ᵀ c` at its centroids,
//!
//! ```text
//! Λ = mᵀ (S q + w P α),     q̄ = Sᵀ m,     ᾱ = w Pᵀ m,     ∇_g: α ∇P m, a Coulomb force on each source
//! ```

use super::pair::{Pair, vector};
use super::surface::{Motion, MotionBar, SurfacePotential, check_bars};
use crate::Result;
use crate::adjoint::kernel::{Points, potential_hvp, potential_sum, potential_vjp};
use crate::adjoint::lie::{Vec3, Vec6, point_wrench, six};
use crate::boundary::PanelBoundary;
use crate::solver::Columns;
use std::ops::Range;
use std::sync::Arc;

/// What the bodies' own panels make of the cotangents.
pub(super) struct Back {
    /// What the bodies' own motions get of it.
    pub bar: MotionBar,
    /// m of the cotangents of values and of rates, at the centroids of each body's panels: two columns.
    pub densities: Vec<Columns>,
}

/// Of one source as it is seen: the force on it, what its weight is worth, and their rates.
#[derive(Clone, Copy, Default)]
pub(super) struct Pulled {
    pub force: Vec3,
    pub dforce: Vec3,
    pub energy: f64,
    pub denergy: f64,
}

/// The back-substitution of all bodies alone.
pub(super) fn onto_charges(
    surfaces: &[Arc<PanelBoundary>],
    bars: &[SurfacePotential],
) -> Result<Back> {
    check_bars(surfaces, bars)?;
    let mut bar = MotionBar::zeros(surfaces.len());
    let mut densities = Vec::with_capacity(surfaces.len());
    for (b, (surface, given)) in surfaces.iter().zip(bars).enumerate() {
        let (twists, found) = surface.total_potential_vjp(&given.columns());
        bar.add_twists(b, &twists);
        densities.push(found);
    }
    Ok(Back { bar, densities })
}

/// Of the sources of a pair that the panels' `centres` with these `densities` see, with displacements `d` and strengths with their rates; adds to the
/// cotangents of those, two columns. `weight` is what the pair counts, with its rate.
pub(super) fn pull(
    pair: &Pair,
    d: &[Vec3],
    (centres, densities): (&[Vec3], &Columns),
    strengths: &Columns,
    [weight, rate]: [f64; 2],
    bars: &mut Columns,
) -> Vec<Pulled> {
    let (targets, count) = (Points::bare(centres), d.len());
    let mut sums = vec![0.0; 2 * count];
    potential_sum(&targets, &pair.points, &densities.data, 2, &mut sums);
    let mut fields = vec![0.0; 6 * count];
    potential_vjp(&targets, &pair.points, &densities.data, 2, &mut fields);
    let mut bent = vec![0.0; 3 * count];
    let of_rates = densities.column(1);
    potential_hvp(&targets, &pair.points, d, &of_rates, 1, &mut bent);
    let of = |j: usize| {
        let [p, dp] = [sums[2 * j], sums[2 * j + 1]];
        let [e, de] = [0, 1].map(|k| vector(&fields, 2, j, k));
        let [a, da] = [0, 1].map(|k| strengths.at(j, k));
        bars.data[2 * j] += weight * (p + d[j].dot(&de)) + rate * dp;
        bars.data[2 * j + 1] += weight * dp;
        Pulled {
            force: a * de,
            dforce: a * e + da * de + a * vector(&bent, 1, j, 0),
            energy: a * dp,
            denergy: a * p + da * dp,
        }
    };
    (0..count).map(of).collect()
}

/// [`pull`] of a pair that counts as its image does, whose sources stand in a range of all `strengths`: adds to the cotangents of those, and to the spatial wrenches on the bodies with their
/// rates.
pub(super) fn pull_pair(
    motion: &Motion,
    pair: &Pair,
    seen_by: (&[Vec3], &Columns),
    (range, strengths): (&Range<usize>, &Columns),
    bars: &mut Columns,
    [wrench, rate]: &mut [Vec<Vec6>; 2],
) {
    let (t, sign) = (pair.target, pair.image.sign);
    let (pose, z) = (&motion.poses[t], motion.displacement);
    let d = pair.displacements(pose, z);
    let mut own = bars.part(range);
    let given = strengths.part(range);
    let pulled = pull(pair, &d, seen_by, &given, [sign, 0.0], &mut own);
    bars.slice_mut(range).copy_from_slice(&own.data);
    let forces = pulled.iter().map(|p| [sign * p.force, sign * p.dforce]);
    let [w, dw] = wrenches(pair, &d, forces);
    pair.apply(pose, &w, wrench);
    pair.apply_jvp(pose, &w, &dw, &z[t], rate);
}

/// The wrench of forces on the sources of a pair, and its rate, in the frame of the body that sees them.
pub(super) fn wrenches(
    pair: &Pair,
    d: &[Vec3],
    forces: impl Iterator<Item = [Vec3; 2]>,
) -> [Vec6; 2] {
    let (mut w, mut dw) = (Vec6::zeros(), Vec6::zeros());
    for ((s, d), [f, df]) in pair.positions.iter().zip(d).zip(forces) {
        w += point_wrench(s, &f);
        dw += six(&df, &(d.cross(&f) + s.cross(&df)));
    }
    [w, dw]
}
