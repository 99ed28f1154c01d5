//! Forces that are solved with contact at the end of a step ([`ForceModel::solved_with_contact`]).

use super::force::{CoarseGap, ForceModel, Loads, Velocity, coarser};
use super::{Evaluation, ForceCotangents};
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::multibody::{Cotangents, Fields};
use nalgebra::DVector;

impl Evaluation<'_> {
    /// Whether any of them does anything at the configuration, at some velocity.
    pub(super) fn damps(&self) -> bool {
        let place = self.place();
        self.system.dampers().any(|force| force.acts(&place))
    }

    /// Refuses a configuration at which one of them has no value.
    pub(super) fn check_damping(&self) -> Result<()> {
        let place = self.place();
        (self.system.dampers()).try_for_each(|force| force.check_at(&place))
    }

    /// The gap that they resolve worst of those that they don't resolve.
    pub(super) fn coarse_gap(&self) -> Option<CoarseGap> {
        let place = self.place();
        let all = self.system.dampers().map(|force| force.coarse_at(&place));
        all.fold(None, coarser)
    }

    fn dampers(&self, mut each: impl FnMut(&dyn ForceModel, &DVector<f64>)) {
        let mut control = None;
        for force in self.system.dampers() {
            each(
                force,
                control.get_or_insert_with(|| DVector::zeros(self.system.controls)),
            );
        }
    }

    /// Adds what they do to bodies that move with spatial `twists` to their wrenches.
    pub(super) fn add_damping(&self, twists: &[Vec6], v: &DVector<f64>, out: &mut [Vec6]) {
        self.dampers(|force, control| {
            let mut loads = Loads::zeros(twists.len(), v.len());
            force.add(&self.moving(twists, v, control), &mut loads);
            out.iter_mut()
                .zip(&loads.wrenches)
                .for_each(|(x, w)| *x += w);
        });
    }

    /// Sizes of their generalised forces, without what cancels in them.
    pub(super) fn damping_effort(&self, v: &DVector<f64>) -> DVector<f64> {
        let tree = &self.system.tree;
        let mut out = DVector::zeros(v.len());
        // The first velocities of all islands at once, which don't reach one another, then the second.
        let parts = self.damped_islands().changes();
        self.dampers(|force, control| {
            for part in parts.iter().map(|change| change.component_mul(v)) {
                if part.iter().all(|x| *x == 0.0) {
                    continue;
                }
                let twists = tree.twists(&self.kinematics, &part);
                let mut loads = Loads::zeros(twists.len(), v.len());
                force.add(&self.moving(&twists, &part, control), &mut loads);
                out += tree.project(&self.kinematics.columns, loads.wrenches).abs();
            }
        });
        out
    }

    /// Transpose of [`Evaluation::add_damping`] projected: the gradient of the power on the velocity `z`, added to `bar` and `out`.
    pub(super) fn damping_vjp(
        &self,
        fields: &Fields,
        v: &DVector<f64>,
        z: &DVector<f64>,
        bar: &mut Cotangents,
        out: &mut ForceCotangents,
    ) {
        self.add_damping(&fields.twist, v, &mut bar.virtual_twist);
        let power = Velocity {
            twists: &fields.virtual_twist,
            v: z,
        };
        self.dampers(|force, control| {
            let at = self.moving(&fields.twist, v, control);
            force.vjp(&at, &power, &mut out.bars(bar));
        });
    }
}
