//! Frames that move, mirrors, and threads.

use crate::scenes::{FIDELITIES, drifting, few, mechanism, run, simulator};
use hydrograd::adjoint::lie;
use hydrograd::dynamics::Integrator;
use hydrograd::{Controls, Fidelity, Scene, Shape, shape};
use nalgebra::DMatrix;
use proptest::prelude::*;

/// Seen in a mirror across x = 0: every body by its triangles, with these in the other sense.
fn mirrored(scene: &Scene, flip: bool) -> Scene {
    let sign = if flip { -1.0 } else { 1.0 };
    let across = |[x, y, z]: [f64; 3]| [sign * x, y, z];
    let about = |[x, y, z]: [f64; 3]| [x, sign * y, sign * z];
    let mut out = scene.clone();
    for body in &mut out.bodies {
        let mesh = shape::build(body.shape.as_ref().unwrap(), "".as_ref(), None).unwrap();
        let vertices: Vec<[f64; 3]> = mesh
            .vertices()
            .iter()
            .map(|v| across((*v).into()))
            .collect();
        let faces = mesh
            .faces()
            .iter()
            .map(|&[a, b, c]| if flip { [a, c, b] } else { [a, b, c] });
        body.shape = Some(Shape::triangles(vertices, faces.collect::<Vec<_>>()));
        body.placement.position = across(body.placement.position);
        body.placement.rotation = about(body.placement.rotation);
    }
    for v in out.initial.v.chunks_exact_mut(6) {
        let (u, w) = (across([v[0], v[1], v[2]]), about([v[3], v[4], v[5]]));
        v.copy_from_slice(&[u, w].concat());
    }
    out
}

proptest! {
    #![proptest_config(few(7))]

    /// What happens in a current is what happens in still water, seen in passing: up to rounding.
    #[test]
    fn a_current_is_a_moving_frame(scene in drifting(), current in prop::array::uniform3(-2.0..2.0_f64)) {
        let mut moving = scene.clone();
        moving.fluid.current = current;
        for (v, body) in moving.initial.v.chunks_exact_mut(6).zip(&scene.bodies) {
            // Along the axes of the joint's frame.
            let turn = lie::exp_matrix(&body.placement.rotation.into());
            let along = turn.transpose() * lie::Vec3::from(current);
            (0..3).for_each(|k| v[k] += along[k]);
        }
        for fidelity in FIDELITIES {
            for integrator in [Integrator::MomentumEuler, Integrator::Rk2, Integrator::Rk4] {
                let still = run(&scene, fidelity, integrator, 8);
                let carried = run(&moving, fidelity, integrator, 8);
                let time = 8.0 * scene.time_step;
                for (a, b) in still.samples()[8].poses.iter().zip(&carried.samples()[8].poses) {
                    let turned = (a.rotation - b.rotation).norm();
                    let along = nalgebra::Vector3::from(current) * time;
                    let moved = (a.translation + along - b.translation).norm();
                    prop_assert!(turned.max(moved) <= 1e-10, "{fidelity:?} {integrator:?}: {turned:e} {moved:e}");
                }
            }
        }
    }

    /// A mirror makes no difference but of rounding; compression chooses points that aren't mirrored, so there to its accuracy.
    #[test]
    fn a_mirrored_scene_does_the_same(scene in drifting()) {
        for (fidelity, limit) in [(Fidelity::Isolated, 1e-9), (Fidelity::Full, 1e-9), (Fidelity::Reduced, 1e-3)] {
            let right = run(&mirrored(&scene, false), fidelity, Integrator::Rk4, 8);
            let left = run(&mirrored(&scene, true), fidelity, Integrator::Rk4, 8);
            let mirror = DMatrix::from_diagonal(&nalgebra::dvector![-1.0, 1.0, 1.0]);
            for (a, b) in right.samples()[8].poses.iter().zip(&left.samples()[8].poses) {
                let moved = (&mirror * a.translation - b.translation).norm();
                let turned = (&mirror * a.rotation * &mirror - b.rotation).norm();
                prop_assert!(moved.max(turned) <= limit, "{fidelity:?}: {moved:e} {turned:e}");
            }
        }
    }

    /// The same bits from 1, 2 and 4 threads, gradient included.
    #[test]
    fn threads_make_no_difference(scene in mechanism()) {
        for fidelity in FIDELITIES {
            let all = [1, 2, 4].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    hydrograd::coupling::reduced::cache::forget();
                    let simulator = simulator(&scene, fidelity, Integrator::Rk4);
                    let rollout = simulator.rollout(&Controls::zeros(&simulator, 3)).unwrap();
                    let mut seed = rollout.zero_cotangents();
                    seed.positions.fill(1.0);
                    let gradient = rollout.vjp(&seed).unwrap();
                    let last = &rollout.samples()[3];
                    let numbers = last.q.iter().chain(&last.v).chain(&gradient.initial.q).chain(&gradient.initial.v);
                    numbers.chain(gradient.parameters.as_slice()).map(|x| x.to_bits()).collect::<Vec<_>>()
                })
            });
            prop_assert!(all[0] == all[1] && all[0] == all[2], "{fidelity:?}");
        }
    }
}
