//! How joints, and a current, move the bodies in the water.

use super::System;
use crate::adjoint::lie::{Vec3, Vec6, six};
use crate::coupling::scattering::Motions;
use crate::multibody::Kinematics;
use nalgebra::DVector;

/// The bodies in the water as the joints move them, and the current past them.
pub(super) struct TreeMotions<'a> {
    system: &'a System,
    kinematics: Kinematics,
}

impl<'a> TreeMotions<'a> {
    pub fn new(system: &'a System, kinematics: Kinematics) -> Self {
        Self { system, kinematics }
    }
}

impl Motions for TreeMotions<'_> {
    fn twists(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        let (system, tree) = (self.system, &self.system.tree);
        let nv = tree.velocities();
        let v = coefficients.rows(0, nv).into_owned();
        let carried = coefficients.get(nv).copied().unwrap_or(0.0);
        let mut field = tree.twists(&self.kinematics, &v);
        if carried != 0.0 {
            let current = carried * six(&system.current, &Vec3::zeros());
            field.iter_mut().for_each(|twist| *twist -= current);
        }
        system.submerged_twists(&self.kinematics, &field)
    }

    fn transposed(&self, impulses: &DVector<f64>) -> DVector<f64> {
        let (system, tree) = (self.system, &self.system.tree);
        let mut field = vec![Vec6::zeros(); system.len()];
        for (b, w) in system.submerged() {
            let h = impulses.fixed_rows::<6>(6 * w).into_owned();
            field[b] = self.kinematics.poses[b].wrench_to_world(&h);
        }
        let current = six(&system.current, &Vec3::zeros());
        let carried: f64 = field.iter().map(|h| -current.dot(h)).sum();
        let out = tree.project(&self.kinematics.columns, field);
        match system.has_current() {
            true => out.push(carried),
            false => out,
        }
    }
}
