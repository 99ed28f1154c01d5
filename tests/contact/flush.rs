//! Bodies whose faces lie in one plane: stacks, rods across ends, pucks side by side. What holds them mustn't depend on which of two faces is nearer by rounding.

use super::tools::{above_floor, contact, touching};
use crate::support::{self, run};
use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::contact::{ContactShape, between};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Joint, Scene, Shape};
use hydrograd::{Fidelity, Simulator};
use std::f64::consts::PI;
use std::path::Path;

fn simulator(scene: &Scene) -> Simulator {
    support::simulator(scene, Fidelity::Isolated, Integrator::MomentumEuler)
}

fn cylinder(radius: f64, length: f64) -> ContactShape {
    let shape = Shape::cylinder(radius, length);
    ContactShape::of_shape(&shape, Pose::identity(), Path::new("")).unwrap()
}

/// A rod lies across the end of a stool, its own ends beyond it, however the stool is turned: it is as near as it is.
#[test]
fn a_rod_lies_across_an_end() {
    let gap = 1e-3;
    for (stool, rod) in [
        (cylinder(0.2, 0.2), cylinder(0.03, 0.5)),
        (cylinder(0.1, 0.4), cylinder(0.1, 0.4)),
        (cylinder(0.05, 0.3), cylinder(0.2, 2.0)),
    ] {
        let [foot, thick] = [&stool, &rod].map(|shape| shape.bounds()[1]);
        for turn in [0.0, PI / 16.0, PI / 8.0, 0.3, 1.0] {
            for aside in [0.0, 0.02] {
                let at = Pose::new(exp_matrix(&Vec3::new(0.0, 0.0, turn)), Vec3::zeros());
                let place = Vec3::new(0.0, aside, foot.z + gap + thick.x);
                let lying = Pose::new(exp_matrix(&Vec3::new(0.0, PI / 2.0, 0.0)), place);
                let found = between(&rod, &stool, &lying, &at, 0.05).unwrap();
                let held = found.iter().filter(|p| p.weight > 0.5);
                let least = held.clone().map(|p| p.gap).fold(f64::INFINITY, f64::min);
                assert!((least - gap).abs() < 1e-9, "{turn} {aside}: {least}");
                // On both sides of the middle, so that it doesn't tip.
                let near = held.filter(|p| p.gap < 2.0 * gap);
                let [low, high] = near.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], p| {
                    [a.min(p.position.x), b.max(p.position.x)]
                });
                assert!(
                    low < -0.02 && high > 0.02,
                    "{turn} {aside}: {low} to {high}"
                );
            }
        }
    }
}

/// Ten cubes, or coins, on each other, edge above edge: the lowest pair is pressed past the gap at which surfaces touch, and holds.
#[test]
fn flush_stacks_stand() {
    for shape in [Shape::cuboid([0.01; 3]), Shape::cylinder(0.005, 0.01)] {
        for count in [2, 10] {
            let mut scene = above_floor(0.0);
            for k in 0..count {
                let body = Body::new(shape.clone()).density(2000.0);
                scene.add(body.at([0.0, 0.0, 0.00505 + 0.0101 * f64::from(k)]));
            }
            // So soft that they sink in.
            contact(&mut scene).stiffness = Some(200.0);
            let rollout = run(&simulator(&scene), 200);
            let last = &rollout.samples()[200];
            for (k, pose) in last.poses.iter().enumerate() {
                let at = pose.translation;
                let right = 0.005 + 0.01 * k as f64;
                let off = at.z - right;
                println!(
                    "{count} of {shape:?}: {k} is {off:.2e} m too high, {:.1e} m aside",
                    at.x.hypot(at.y)
                );
                assert!(off.abs() < 5e-4 && at.x.hypot(at.y) < 5e-4, "{k}: {at}");
            }
        }
    }
}

/// Cubes and pucks of equal height that meet on a rail don't pass through each other.
#[test]
fn flush_sides_meet() {
    for shape in [Shape::cuboid([0.2; 3]), Shape::cylinder(0.1, 0.1)] {
        for speed in [0.5, 2.0] {
            let mut scene = touching(0.0);
            scene.gravity = [0.0; 3];
            let rail = Joint::Prismatic {
                axis: [1.0, 0.0, 0.0],
            };
            for x in [-0.15, 0.15] {
                let body = Body::new(shape.clone()).density(1000.0).at([x, 0.0, 0.0]);
                scene.add(body.joint(rail));
            }
            scene.initial.v = vec![speed, -speed];
            contact(&mut scene).friction = 0.0;
            let rollout = run(&simulator(&scene), 100);
            let least = rollout
                .samples()
                .iter()
                .map(|s| s.poses[1].translation.x - s.poses[0].translation.x);
            let least = least.fold(f64::INFINITY, f64::min);
            let v = &rollout.samples()[100].v;
            println!(
                "{shape:?} at {speed}: never nearer than {least:.4}, then {:.3} {:.3}",
                v[0], v[1]
            );
            assert!(least > 0.19, "{least}");
            assert!(v[0] <= 1e-9 && v[1] >= -1e-9, "{v}");
        }
    }
}

/// A ball lighter than water under a ceiling is held where one that weighs more would be on the floor.
#[test]
fn light_bodies_are_held() {
    for density in [1.2, 5.0, 20.0, 500.0] {
        let mut scene = touching(1000.0);
        scene.gravity = [0.0, 0.0, -9.81];
        scene.add_wall([0.0, 0.0, 0.2], [0.0, 0.0, -1.0]);
        scene.add(Body::new(Shape::sphere(0.05)).density(density));
        let rollout = run(&simulator(&scene), 300);
        let gap = 0.15 - rollout.samples()[300].poses[0].translation.z;
        println!("{density} kg/m³: a gap of {gap:.2e} m");
        assert!(gap > 0.0 && gap < 2e-3, "{density}: {gap}");
    }
}
