//! Momenta of the water that moves with the bodies, as linear maps of what moves it.

use super::System;
use super::tree_motions::TreeMotions;
use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3, Vec6, six};
use crate::coupling::scattering::Scattered;
use crate::multibody::Kinematics;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Spatial momenta of all bodies at unit density for coefficients on the basis on which the water is solved: a generalised velocity each, and the current's if there is
/// one.
#[derive(Clone)]
pub(super) enum FluidMomenta<'a> {
    /// No water acts.
    Still,
    /// Bodies that don't feel each other: the added mass of each by its number in the water ([`Coupling::apart`](crate::coupling::Coupling::apart)). What one asks of
    /// them takes a pass over the bodies, and nothing is kept.
    Apart(&'a [Mat6]),
    /// Per basis column, 6 × k a body.
    Coupled(Vec<DMatrix<f64>>),
    /// Bodies so many that single directions are solved for as they are asked for.
    Scattered(Arc<Scattered<'a>>),
}

impl FluidMomenta<'_> {
    /// Those for the coefficients `direction`.
    pub fn along(
        &self,
        system: &System,
        kinematics: &Kinematics,
        direction: &DVector<f64>,
    ) -> Vec<Vec6> {
        match self {
            Self::Still => vec![Vec6::zeros(); system.len()],
            Self::Apart(added) => {
                let nv = system.tree.velocities();
                let v = direction.rows(0, nv).into_owned();
                let carried = direction.get(nv).copied().unwrap_or(0.0);
                let current = carried * six(&system.current, &Vec3::zeros());
                let mut twists = system.tree.twists(kinematics, &v);
                twists.iter_mut().for_each(|twist| *twist -= current);
                apart(added, system, kinematics, &twists)
            }
            Self::Coupled(columns) => (columns.iter())
                .map(|m| (m * direction).fixed_rows::<6>(0).into_owned())
                .collect(),
            Self::Scattered(at) => {
                let twists = at.motions().twists(direction);
                in_world(system, kinematics, &at.impulses(&at.respond(&twists)))
            }
        }
    }

    /// Whether all that was solved for so far met its tolerance.
    ///
    /// # Errors
    /// The first solve that didn't.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Scattered(at) => at.check(),
            Self::Still | Self::Apart(_) | Self::Coupled(_) => Ok(()),
        }
    }

    /// Those of column `k` of the basis.
    pub fn column(&self, system: &System, kinematics: &Kinematics, k: usize) -> Vec<Vec6> {
        match self {
            Self::Coupled(columns) => (columns.iter())
                .map(|m| m.fixed_view::<6, 1>(0, k).into_owned())
                .collect(),
            Self::Still | Self::Apart(_) | Self::Scattered(_) => {
                let columns = system.tree.velocities() + usize::from(system.has_current());
                let unit = DVector::from_fn(columns, |i, _| f64::from(i == k));
                self.along(system, kinematics, &unit)
            }
        }
    }

    /// Transpose of [`FluidMomenta::along`] for generalised velocities: per velocity the power of its momenta on the bodies' spatial twists `field`.
    pub fn transposed(
        &self,
        system: &System,
        kinematics: &Kinematics,
        field: &[Vec6],
    ) -> DVector<f64> {
        let nv = system.tree.velocities();
        match self {
            Self::Still => DVector::zeros(nv),
            // Added masses are symmetric.
            Self::Apart(added) => {
                let momenta = apart(added, system, kinematics, field);
                system.tree.project(&kinematics.columns, momenta)
            }
            Self::Coupled(columns) => {
                let mut out = DVector::zeros(nv);
                for (m, twist) in columns.iter().zip(field) {
                    out += m.columns(0, nv).tr_mul(twist);
                }
                out
            }
            // M̄_f is symmetric.
            Self::Scattered(at) => {
                let twists = system.submerged_twists(kinematics, field);
                let momenta = in_world(system, kinematics, &at.impulses(&at.respond(&twists)));
                system.tree.project(&kinematics.columns, momenta)
            }
        }
    }
}

/// Body-frame impulses of the bodies in the water (stacked) as spatial momenta of all bodies.
fn in_world(system: &System, kinematics: &Kinematics, impulses: &DVector<f64>) -> Vec<Vec6> {
    let mut out = vec![Vec6::zeros(); system.len()];
    for (b, w) in system.submerged() {
        let h = impulses.fixed_rows::<6>(6 * w).into_owned();
        out[b] = kinematics.poses[b].wrench_to_world(&h);
    }
    out
}

/// Spatial momenta of bodies that move through the water with spatial `twists` and don't feel each other.
pub(super) fn apart(
    added: &[Mat6],
    system: &System,
    kinematics: &Kinematics,
    twists: &[Vec6],
) -> Vec<Vec6> {
    let mut out = vec![Vec6::zeros(); system.len()];
    for (b, w) in system.submerged() {
        let pose = &kinematics.poses[b];
        out[b] = pose.wrench_to_world(&(added[w] * pose.twist_to_body(&twists[b])));
    }
    out
}

impl System {
    /// The water's momenta where it needs no solve; none where it does.
    pub(super) fn fluid_apart(&self, acts: bool) -> Option<FluidMomenta<'_>> {
        match acts {
            false => Some(FluidMomenta::Still),
            true => self.coupling.apart().map(FluidMomenta::Apart),
        }
    }

    /// The water's momenta of bodies so many that single directions are solved for; none of others.
    ///
    /// # Errors
    /// A coupling that fails.
    pub(super) fn fluid_scattered(
        &self,
        kinematics: &Kinematics,
    ) -> Result<Option<Arc<Scattered<'_>>>> {
        let Some(many) = self.coupling.scattering() else {
            return Ok(None);
        };
        let poses: Vec<_> = self.submerged().map(|(b, _)| kinematics.poses[b]).collect();
        let motions = TreeMotions::new(self, kinematics.clone());
        Ok(Some(Arc::new(many.place(&poses, Box::new(motions))?)))
    }

    /// The water's momenta from the body-frame impulses of the basis.
    pub(super) fn fluid_coupled(
        &self,
        kinematics: &Kinematics,
        impulses: &DMatrix<f64>,
    ) -> FluidMomenta<'static> {
        let mut out = vec![DMatrix::zeros(6, impulses.ncols()); self.len()];
        for (b, w) in self.submerged() {
            for k in 0..impulses.ncols() {
                let h = impulses.fixed_view::<6, 1>(6 * w, k).into_owned();
                out[b].set_column(k, &kinematics.poses[b].wrench_to_world(&h));
            }
        }
        FluidMomenta::Coupled(out)
    }
}
