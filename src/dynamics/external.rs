//! Forces on one body that don't come from the water's kinetic energy: gravity, buoyancy, drag, thrust.
//!
//! All are spatial wrenches (moment about the world origin) at the body's pose and spatial twist.

use super::{Evaluation, Parameters};
use crate::adjoint::drag;
use crate::adjoint::lie::{Vec3, Vec6, angular, cross_force, linear, point_velocity, point_wrench};
use nalgebra::DVector;

/// Cotangents of the external wrench of one body.
pub(super) struct ExternalCotangents {
    /// Of the pose: work on a spatial displacement.
    pub pose: Vec6,
    /// Of the twist.
    pub twist: Vec6,
}

impl Evaluation<'_> {
    /// Weights: points (world), forces, of gravity and buoyancy.
    fn weights(&self, b: usize) -> [(Vec3, Vec3); 2] {
        let (body, pose) = (&self.system.bodies[b], &self.kinematics.poses[b]);
        let g = self.system.gravity;
        [
            (
                pose.apply(&body.center_of_mass),
                self.parameters.mass[b] * g,
            ),
            (
                pose.apply(&body.centroid),
                -(self.parameters.density * body.volume) * g,
            ),
        ]
    }

    /// Thrust on body `b`: force and moment (world axes) about its origin.
    fn thrust(&self, b: usize, control: &DVector<f64>) -> Option<Vec6> {
        self.system.bodies[b]
            .thruster
            .map(|at| control.fixed_rows::<6>(at).into_owned())
    }

    /// Body-frame resistance coefficients: linear, and `ρ c` of the quadratic law.
    fn drag_scales(&self, b: usize) -> (f64, f64) {
        (
            self.parameters.linear_drag[b],
            self.parameters.density * self.parameters.quadratic_drag[b],
        )
    }

    /// External wrench on body `b` moving with the spatial twist `twist`.
    pub(super) fn external(&self, b: usize, twist: &Vec6, control: &DVector<f64>) -> Vec6 {
        let (body, pose) = (&self.system.bodies[b], &self.kinematics.poses[b]);
        let mut out = Vec6::zeros();
        for (x, f) in self.weights(b) {
            out += point_wrench(&x, &f);
        }
        let (linear_scale, quadratic_scale) = self.drag_scales(b);
        if linear_scale != 0.0 || quadratic_scale != 0.0 {
            let nu = pose.twist_to_body(&self.relative(twist));
            let mut wrench = -linear_scale * (body.resistance * nu);
            if quadratic_scale != 0.0 {
                wrench +=
                    quadratic_scale * drag::quadratic_drag(&body.surface, body.quadratic_part, &nu);
            }
            out += pose.wrench_to_world(&wrench);
        }
        if let Some(w) = self.thrust(b, control) {
            out += point_wrench(&pose.translation, &linear(&w));
            let mut moment = out.fixed_rows_mut::<3>(3);
            moment += angular(&w);
        }
        out
    }

    /// Tangent of [`Evaluation::external`] along a change of the twist.
    pub(super) fn external_jvp(&self, b: usize, twist: &Vec6, dtwist: &Vec6) -> Vec6 {
        let (body, pose) = (&self.system.bodies[b], &self.kinematics.poses[b]);
        let (linear_scale, quadratic_scale) = self.drag_scales(b);
        if linear_scale == 0.0 && quadratic_scale == 0.0 {
            return Vec6::zeros();
        }
        let dnu = pose.twist_to_body(dtwist);
        let mut wrench = -linear_scale * (body.resistance * dnu);
        if quadratic_scale != 0.0 {
            let nu = pose.twist_to_body(&self.relative(twist));
            wrench += quadratic_scale
                * drag::quadratic_drag_jvp(&body.surface, body.quadratic_part, &nu, &dnu);
        }
        pose.wrench_to_world(&wrench)
    }

    /// Transpose of [`Evaluation::external`] in pose, twist, control and parameters, for the cotangent `z`
    /// (a spatial twist).
    pub(super) fn external_vjp(
        &self,
        b: usize,
        twist: &Vec6,
        control: &DVector<f64>,
        z: &Vec6,
        control_bar: &mut DVector<f64>,
        parameters_bar: &mut Parameters,
    ) -> ExternalCotangents {
        let (body, pose) = (&self.system.bodies[b], &self.kinematics.poses[b]);
        let mut bar = ExternalCotangents {
            pose: Vec6::zeros(),
            twist: Vec6::zeros(),
        };
        let turn = angular(z);
        let [mass, water] = self.weights(b);
        for (x, f) in [mass, water] {
            bar.pose += point_wrench(&x, &f.cross(&turn));
        }
        let g = self.system.gravity;
        parameters_bar.mass[b] += g.dot(&point_velocity(z, &mass.0));
        parameters_bar.density -= body.volume * g.dot(&point_velocity(z, &water.0));

        let relative = self.relative(twist);
        let nu = pose.twist_to_body(&relative);
        let zeta = pose.twist_to_body(z);
        let (linear_scale, quadratic_scale) = self.drag_scales(b);
        // Linear: −c ζᵀ R ν; the turning of the frame acts on both twists.
        let resisted = body.resistance * nu;
        parameters_bar.linear_drag[b] -= zeta.dot(&resisted);
        let mut wrench = -linear_scale * resisted;
        let mut nu_bar = -linear_scale * (body.resistance * zeta);
        if !body.surface.is_empty() {
            let unit = drag::quadratic_drag(&body.surface, body.quadratic_part, &nu);
            let power = zeta.dot(&unit);
            parameters_bar.quadratic_drag[b] += self.parameters.density * power;
            parameters_bar.density += self.parameters.quadratic_drag[b] * power;
            if quadratic_scale != 0.0 {
                wrench += quadratic_scale * unit;
                nu_bar += quadratic_scale
                    * drag::quadratic_drag_vjp(&body.surface, body.quadratic_part, &nu, &zeta);
            }
        }
        let (wrench, nu_bar) = (pose.wrench_to_world(&wrench), pose.wrench_to_world(&nu_bar));
        bar.twist += nu_bar;
        bar.pose -= cross_force(&relative, &nu_bar) + cross_force(z, &wrench);

        if let (Some(w), Some(at)) = (self.thrust(b, control), body.thruster) {
            bar.pose += point_wrench(&pose.translation, &linear(&w).cross(&turn));
            let velocity = point_velocity(z, &pose.translation);
            for k in 0..3 {
                control_bar[at + k] += velocity[k];
                control_bar[at + 3 + k] += turn[k];
            }
        }
        bar
    }
}
