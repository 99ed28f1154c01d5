//! Flat bodies that land flat in water, however fast and in however long steps.

use super::tools::above_floor;
use crate::support::simulator;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Shape};
use hydrograd::{Controls, Fidelity};

/// Half height and shape.
fn shapes() -> [(&'static str, f64, Shape); 3] {
    [
        ("box", 0.05, Shape::cuboid([0.1; 3]).faces(300)),
        ("cylinder", 0.05, Shape::cylinder(0.05, 0.1).faces(300)),
        ("slab", 0.05, Shape::cuboid([0.2, 0.2, 0.1]).faces(300)),
    ]
}

#[test]
fn flat_bodies_land_at_any_speed() {
    let mut failed = Vec::new();
    for (name, half, shape) in shapes() {
        for integrator in [
            Integrator::MomentumEuler,
            Integrator::EnergyEuler,
            Integrator::Midpoint,
        ] {
            for dt in [0.005, 0.01, 0.02] {
                for speed in [3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 20.0] {
                    let mut scene = above_floor(998.0);
                    scene.time_step = dt;
                    let body = Body::new(shape.clone()).density(2000.0);
                    scene.add(body.at([0.0, 0.0, half + 0.1]));
                    scene.initial.v = vec![0.0, 0.0, -speed, 0.0, 0.0, 0.0];
                    let sim = simulator(&scene, Fidelity::Reduced, integrator);
                    let steps = (0.3 / dt).round() as usize;
                    let what = format!("{name} {integrator:?} {dt} s {speed} m/s");
                    let began = std::time::Instant::now();
                    match sim.rollout(&Controls::zeros(&sim, steps)) {
                        Ok(rollout) => {
                            let summary = rollout.summary();
                            let end = rollout.samples().last().unwrap();
                            println!(
                                "{what}: {} cut into at most {}, ends {:.4} m high at {:.1e} m/s, {:.2} s",
                                summary.cut_steps,
                                summary.most_pieces,
                                end.q[2] - half,
                                end.v.amax(),
                                began.elapsed().as_secs_f64()
                            );
                        }
                        Err(error) => failed.push(format!("{what}: {error}")),
                    }
                }
            }
        }
    }
    println!("{} failed", failed.len());
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
