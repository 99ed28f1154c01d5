//! The transpose of the potentials on the bodies' surfaces.

use super::linearised::ReducedLinearised;
use super::link::Link;
use super::placed::PointTangent;
use super::views::FLUX;
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::boundary::PanelBoundary;
use crate::coupling::surface_back::{Back, Pulled, onto_charges, pull};
use crate::coupling::{Motion, MotionBar, SurfacePotential};
use crate::solver::Columns;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

impl ReducedLinearised<'_> {
    /// The gradient of Σ `bars` · potentials, of bodies that no film holds apart: what the panels see of the charges, and with the cotangents β, β' of these
    ///
    /// ```text
    /// γ' = R β',   γ = R (β + Ġ γ'),   R = (I − S̄G)⁻¹ S̄
    /// δ(βᵀα + β'ᵀα') = γᵀδG α + γ'ᵀδG α' + γ'ᵀδĠ α + δx̄ᵀŪᵀ(β + Ġγ' + Gγ) + δx̄'ᵀŪᵀ(β' + Gγ')
    /// ```
    pub(super) fn potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        let Back { mut bar, densities } = onto_charges(surfaces, bars)?;
        let (z, bodies) = (motion.displacement, self.poses.len());
        let films = self.films.along(z);
        let alpha = self.alpha.column(0).into_owned();
        let (psi, _) = self.tangent_potentials(&[alpha.as_slice()], z, &films);
        let (displaced, _) = self.tangent_solution(&psi);
        let strengths = self.with_rates(&displaced.column(0).into_owned());
        let (mut gradient, mut wrench) = (vec![Vec6::zeros(); bodies], vec![Vec6::zeros(); bodies]);
        let mut beta = Columns::zeros(strengths.rows, 2);

        // Surfaces see both ends of a link, and bodies their own images once; of Coulomb energies these are 4π times as much.
        let seen: Vec<Link> = (self.placed.iter())
            .flat_map(|placed| {
                let link = placed.link;
                link.ends().map(move |(target, source)| Link {
                    target,
                    source,
                    factor: link.image.sign / FLUX,
                    ..link.clone()
                })
            })
            .collect();
        for link in &seen {
            let Some(placed) = link.place(&self.reduced.bodies, &self.poses, &self.films) else {
                continue;
            };
            let (t, s) = (link.target, self.range(link.source));
            let moved = placed.moved(&self.poses, z, &films);
            let [weight, slope, _] = placed.weight.map(|w| link.image.sign * w);
            let mut own = beta.part(&s);
            let pulled = pull(
                &placed.pair,
                &moved.points,
                (&surfaces[t].faces.centres, &densities[t]),
                &strengths.part(&s),
                [weight, slope * moved.rate],
                &mut own,
            );
            beta.slice_mut(&s).copy_from_slice(&own.data);
            let ([w, dw], _) = placed.pushed(&moved, |j| tangent(&pulled[j]));
            let pose = &self.poses[t];
            placed.pair.apply(pose, &w, &mut gradient);
            placed.pair.apply_jvp(pose, &w, &dw, &z[t], &mut wrench);
        }

        let column = |k: usize| DMatrix::from_column_slice(beta.rows, 1, &beta.column(k));
        let (of_rates, rates) = self.tangent_solution(&column(1));
        let of_rates: DVector<f64> = of_rates.column(0).into_owned();
        let charges = [of_rates.as_slice(), alpha.as_slice()];
        let (psi, kept) = self.tangent_potentials(&charges, z, &films);
        let (of_values, twists) = self.tangent_solution(&(column(0) + psi.columns(0, 1)));
        bar.rates += rates.column(0) / FLUX;
        bar.twists += twists.column(0) / FLUX;
        let rate = DVector::from_vec(strengths.column(1));
        let changes = DMatrix::from_columns(&[of_values.column(0).into_owned(), rate]);
        for (placed, kept) in self.placed.iter().zip(&kept) {
            let ([w, dw], _) = self.link_tangent(placed, kept, &charges, &changes);
            let (t, [w, dw]) = (placed.link.target, [w, dw].map(|w| w / FLUX));
            let pose = &self.poses[t];
            placed.pair.apply(pose, &w, &mut gradient);
            placed.pair.apply_jvp(pose, &w, &dw, &z[t], &mut wrench);
        }
        bar.add_pull(z, &gradient, &wrench);
        Ok(bar)
    }
}

fn tangent(of: &Pulled) -> PointTangent {
    PointTangent {
        force: of.force,
        dforce: of.dforce,
        energy: of.energy,
        denergy: of.denergy,
    }
}
