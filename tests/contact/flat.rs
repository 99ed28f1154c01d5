//! Flat bodies that land flat in water, however fast and in however long steps.

use super::tools::above_floor;
use crate::support::{check_gradient, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Scene, Shape};
use hydrograd::{Controls, Fidelity};

/// Where the floor is, m.
const FLOOR: f64 = -0.15;

/// A shape 0.1 m high that comes down at so many m/s.
fn falling(shape: &Shape, speed: f64, dt: f64) -> Scene {
    let mut scene = above_floor(998.0);
    scene.time_step = dt;
    let body = Body::new(shape.clone()).density(2000.0);
    scene.add(body.at([0.0, 0.0, 0.15]));
    scene.initial.v = vec![0.0, 0.0, -speed, 0.0, 0.0, 0.0];
    scene
}

#[test]
fn flat_bodies_land_at_any_speed() {
    let shapes = [
        ("box", Shape::cuboid([0.1; 3]).faces(300)),
        ("cylinder", Shape::cylinder(0.05, 0.1).faces(300)),
        ("slab", Shape::cuboid([0.2, 0.2, 0.1]).faces(300)),
    ];
    let (mut failed, mut most) = (Vec::new(), 0);
    for (name, shape) in &shapes {
        for integrator in [
            Integrator::MomentumEuler,
            Integrator::EnergyEuler,
            Integrator::Midpoint,
        ] {
            if integrator == Integrator::Midpoint && *name != "box" {
                continue;
            }
            for (dt, speed) in [(0.01, 5.0), (0.01, 10.0), (0.02, 5.0)] {
                let scene = falling(shape, speed, dt);
                let sim = simulator(&scene, Fidelity::Reduced, integrator);
                let steps = (0.3 / dt).round() as usize;
                let what = format!("{name} {integrator:?} {dt} s {speed} m/s");
                let rollout = match sim.rollout(&Controls::zeros(&sim, steps)) {
                    Ok(rollout) => rollout,
                    Err(error) => {
                        failed.push(format!("{what}: {error}"));
                        continue;
                    }
                };
                let pieces = rollout.summary().most_pieces;
                most = most.max(pieces);
                let samples = rollout.samples();
                let (first, end) = (samples[0].energy(), &samples[steps]);
                let height = end.q[2] - 0.05 - FLOOR;
                println!(
                    "{what}: into at most {pieces} pieces, {:.2} mm over the floor at {:.1e} m/s",
                    1e3 * height,
                    end.v.amax()
                );
                assert!(height > 0.0 && height < 4e-3, "{what}: {height}");
                assert!(end.v.amax() < 0.05, "{what}: {}", end.v);
                let gained = samples.iter().map(|s| s.energy() - first);
                let gained = gained.fold(0.0, f64::max);
                assert!(
                    gained <= 1e-3 * samples[0].kinetic_energy,
                    "{what}: {gained} J"
                );
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(most > 64, "{most}");
}

/// Of the map with the number of pieces that it takes.
#[test]
fn a_flat_landing_has_a_gradient() {
    for integrator in [Integrator::MomentumEuler, Integrator::Midpoint] {
        let scene = falling(&Shape::cuboid([0.1; 3]).faces(300), 5.0, 0.01);
        let mut sim = simulator(&scene, Fidelity::Reduced, integrator);
        let name = format!("a flat landing, {integrator:?}");
        check_gradient(&name, &mut sim, 4, 2, 1e-6);
    }
}
