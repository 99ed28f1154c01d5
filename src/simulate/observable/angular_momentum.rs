//! Angular momentum of each body by itself, without the water, about its centre of mass: L = R I Rᵀ ω, world axes.

use super::entry::{
    Differentiable, Observable, Observed, ObservedBars, ObservedTangents, Reading, by_body,
};
use crate::Result;
use crate::adjoint::lie::{Mat3, Vec3, Vec6, angular, six};
use crate::dynamics::{Parameters, System};
use crate::scene::Scene;

pub(super) struct AngularMomentum;

/// Inertia of a body about its centre of mass, body axes.
fn inertia(parameters: &Parameters, b: usize) -> Mat3 {
    let [xx, yy, zz, xy, xz, yz] = parameters.inertia(b);
    Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

impl Observable for AngularMomentum {
    fn name(&self) -> &'static str {
        "angular_momentum"
    }

    fn unit(&self) -> &'static str {
        "kg m²/s, of each body without the water, about its centre of mass, world axes"
    }

    fn shape(&self, system: &System) -> Vec<usize> {
        vec![system.len(), 3]
    }

    fn labels(&self, scene: &Scene) -> Vec<String> {
        let names = ["x", "y", "z"].map(|axis| format!("angular_momentum_{axis}"));
        by_body(scene, &names.each_ref().map(String::as_str))
    }

    fn value(&self, at: &Reading) -> Result<Vec<f64>> {
        let (tree, sample) = (&at.system.tree, at.sample);
        let twists = tree.twists(&tree.kinematics(&sample.q), &sample.v);
        let of = |(b, twist): (usize, &Vec6)| {
            let r = &sample.poses[b].rotation;
            <[f64; 3]>::from(r * (inertia(at.parameters, b) * r.tr_mul(&angular(twist))))
        };
        Ok(twists.iter().enumerate().flat_map(of).collect())
    }

    fn differentiable(&self) -> Option<&dyn Differentiable> {
        Some(self)
    }
}

impl Differentiable for AngularMomentum {
    fn tangents(&self, system: &System) -> usize {
        3 * system.len()
    }

    fn jvp(&self, at: &Observed, along: &ObservedTangents) -> Vec<f64> {
        let of = |(b, twist): (usize, &Vec6)| {
            let (r, i) = (&at.kinematics.poses[b].rotation, inertia(at.parameters, b));
            let turned = angular(&along.displacement[b]);
            let rate = angular(&at.twists[b]);
            let world = |i: &Mat3, rate: &Vec3| r * (i * r.tr_mul(rate));
            // The frame's rotation acts on both factors.
            let changed = world(&i, &(angular(twist) - turned.cross(&rate)));
            let by_inertia = along
                .parameters
                .map_or(Vec3::zeros(), |p| world(&inertia(p, b), &rate));
            <[f64; 3]>::from(turned.cross(&world(&i, &rate)) + changed + by_inertia)
        };
        along.twist.iter().enumerate().flat_map(of).collect()
    }

    fn vjp(&self, at: &Observed, bar: &[f64], out: &mut ObservedBars) {
        for (b, bar) in bar.chunks_exact(3).enumerate() {
            let bar = Vec3::from_column_slice(bar);
            let rate = angular(&at.twists[b]);
            let (r, i) = (&at.kinematics.poses[b].rotation, inertia(at.parameters, b));
            let (x, w) = (r.tr_mul(&bar), r.tr_mul(&rate));
            let (momentum, virt) = (r * (i * w), r * (i * x));
            out.twist[b] += six(&Vec3::zeros(), &virt);
            // The frame's rotation acts on both factors.
            let moment = momentum.cross(&bar) - rate.cross(&virt);
            out.pose[b] += six(&Vec3::zeros(), &moment);
            let product = |j: usize, k: usize| x[j] * w[k] + x[k] * w[j];
            let (moments, products) = (x.component_mul(&w), [(0, 1), (0, 2), (1, 2)]);
            let [xy, xz, yz] = products.map(|(j, k)| product(j, k));
            let all = [moments.x, moments.y, moments.z, xy, xz, yz];
            out.parameters.add_inertia(b, &all);
        }
    }
}
