//! Many bodies by products whose sums are made on the device, against the CPU's factor.

use super::batch::answers;
use super::fixture::*;
use super::reduced::three;
use crate::support::heap::heap;
use hydrograd::coupling::reduced::Reduced;
use hydrograd::coupling::scattering::{Levels, Scattering};
use hydrograd::coupling::{Exclusions, Linearise};
use hydrograd::dynamics::Integrator;
use hydrograd::geometry::Image;
use hydrograd::gpu::Context;
use hydrograd::gpu::reduced::GpuSums;
use hydrograd::scene::Wall;
use hydrograd::simulate::{Backend, Exchange};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator, objective};
use std::sync::Arc;

fn many(
    context: &Arc<Context>,
    reduced: &Arc<Reduced>,
    walls: &[Wall],
    excluded: &Exclusions,
) -> Scattering {
    let bodies = reduced.reduced_bodies().to_vec();
    let names = (0..bodies.len()).map(|b| b.to_string()).collect();
    let (levels, images) = (Levels::for_accuracy(1e-2), Image::of_walls(walls));
    let many = Scattering::between(bodies, names, &poses(), images.unwrap(), levels.unwrap());
    let sums = GpuSums::new(context, reduced.clone()).unwrap();
    let many = many.unwrap().excluding(excluded).unwrap();
    many.summed_by(Arc::new(sums))
}

/// Whatever accuracy the levels have, sums on the device are of all pairs.
#[test]
fn sums_on_the_device_couple_as_the_factor_does() {
    let none = Exclusions::none();
    let some = Exclusions::new([(0, 2)]);
    let cases = [
        (context(), &[][..], &some, 1e-8),
        (context(), &[WALL, SIDE], &some, 1e-8),
        (two_float(), &[WALL], &none, 1e-8),
    ];
    for (context, walls, excluded, limit) in cases {
        let reduced = three(walls, None, excluded);
        let many = many(context, &reduced, walls, excluded);
        let (bodies, columns) = (3, 4);
        let basis = basis(bodies, columns, 0.3);
        let right = reduced.linearise(&poses(), &basis).unwrap();
        let found = many.linearise(&poses(), &basis).unwrap();
        let right = answers(&*right, bodies, columns);
        let all = answers(&*found, bodies, columns);
        let worst = all.iter().zip(&right).map(|(a, b)| difference(a, b));
        let worst: Vec<f64> = worst.collect();
        println!("{} walls: {worst:?}", walls.len());
        assert!(worst.iter().all(|d| *d <= limit), "{worst:?}");
    }
}

/// Bodies, two of them with edges, close above a wall.
fn simulator(backend: Backend, exchange: Exchange, integrator: Integrator) -> Simulator {
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .backend(backend)
        .exchange(exchange)
        .films(false)
        .accuracy(0.03)
        .integrator(integrator);
    let mut scene = heap(4, 5e-3);
    if integrator == Integrator::Rk2 {
        scene.contact = None;
    }
    for body in &mut scene.bodies {
        body.placement.position[2] -= 0.02;
    }
    Simulator::new(&scene, settings).unwrap()
}

fn run(simulator: &Simulator, steps: usize) -> (Rollout, Vec<f64>) {
    let rollout = simulator
        .rollout(&Controls::zeros(simulator, steps))
        .unwrap();
    let goal = objective::final_velocity(0, 0.0, 1.0);
    let gradient = rollout.gradient(&goal).unwrap();
    let all = [gradient.initial.q, gradient.initial.v];
    let numbers = all.iter().flat_map(|x| x.iter().copied()).collect();
    (rollout, numbers)
}

#[test]
fn rollouts_with_sums_on_the_device_are_those_by_a_factor() {
    for (integrator, steps) in [(Integrator::Rk2, 2), (Integrator::MomentumEuler, 3)] {
        let gpu = simulator(Backend::Gpu, Exchange::Products, integrator);
        let cpu = simulator(Backend::Cpu, Exchange::Factor, integrator);
        let ((found, bars), (right, right_bars)) = (run(&gpu, steps), run(&cpu, steps));
        let states = difference(found.v().as_slice(), right.v().as_slice());
        let gradients = difference(&bars, &right_bars);
        println!("{integrator:?}: states {states:.1e}, gradients {gradients:.1e}");
        assert!(states < 1e-8 && gradients < 1e-7);
    }
}

#[test]
fn a_lost_device_is_named() {
    let gpu = simulator(Backend::Gpu, Exchange::Products, Integrator::MomentumEuler);
    gpu.context().unwrap().lose();
    let failed = gpu.rollout(&Controls::zeros(&gpu, 1));
    let told = failed.err().map(|error| error.to_string());
    println!("{told:?}");
    assert!(told.is_some_and(|told| told.contains("GPU")));
}
