//! A rollout and its gradient with the backend gpu against the CPU's.

use super::fixture::{difference, wavy};
use crate::support::example;
use hydrograd::simulate::{Backend, Method};
use hydrograd::{Controls, Fidelity, Gradient, Rollout, Scene, Settings, Simulator};
use nalgebra::DMatrix;

pub const STEPS: usize = 3;

/// The falling ball: a sphere, a coin and the image of a wall, on small meshes.
pub fn falling_ball() -> Scene {
    let mut scene = example("falling_ball");
    scene.set_faces(40);
    scene
}

pub fn simulator(backend: Backend, tolerance: f64) -> Simulator {
    of((Fidelity::Full, Method::MfsVertex), backend, tolerance)
}

fn of(how: (Fidelity, Method), backend: Backend, tolerance: f64) -> Simulator {
    in_scene(&falling_ball(), how, backend, tolerance)
}

fn in_scene(
    scene: &Scene,
    (fidelity, method): (Fidelity, Method),
    backend: Backend,
    tolerance: f64,
) -> Simulator {
    let settings = Settings::default()
        .fidelity(fidelity)
        .method(method)
        .backend(backend)
        .tolerance(tolerance);
    Simulator::new(scene, settings).unwrap()
}

/// The gradient of a fixed combination of all states.
fn gradient(rollout: &Rollout) -> Gradient {
    let mut cotangents = rollout.zero_cotangents();
    let fill = |m: &mut DMatrix<f64>, phase: f64| {
        m.copy_from_slice(&wavy(m.len(), phase));
    };
    fill(&mut cotangents.q, 0.3);
    fill(&mut cotangents.v, 0.7);
    fill(&mut cotangents.positions, 1.1);
    fill(&mut cotangents.rotations, 1.9);
    rollout.vjp(&cotangents).unwrap()
}

/// End state, controls, initial state and parameters, each by itself.
fn groups(simulator: &Simulator) -> [Vec<f64>; 5] {
    let controls = Controls::zeros(simulator, STEPS);
    let rollout = simulator.rollout(&controls).unwrap();
    let last = &rollout.samples()[STEPS];
    let end = [last.q.as_slice(), last.v.as_slice()].concat();
    let g = gradient(&rollout);
    [
        end,
        g.controls.as_slice().to_vec(),
        g.initial.q.as_slice().to_vec(),
        g.initial.v.as_slice().to_vec(),
        g.parameters.to_vec(),
    ]
}

fn holds(how: (Fidelity, Method), limit: f64) {
    let cpu = groups(&of(how, Backend::Cpu, 1e-12));
    let on_gpu = of(how, Backend::Gpu, 1e-10);
    let gpu = groups(&on_gpu);
    let names = ["end", "controls", "initial q", "initial v", "parameters"];
    for ((name, cpu), gpu) in names.iter().zip(&cpu).zip(&gpu) {
        let off = difference(gpu, cpu);
        println!("{how:?}, {name}: {off:.1e}");
        assert!(off <= limit, "{how:?}, {name}: {off:e}");
    }
    println!("{}", on_gpu.backend());
    assert_eq!(gpu, groups(&on_gpu), "two runs of one simulator");
    let again = of(how, Backend::Gpu, 1e-10);
    assert_eq!(gpu, groups(&again), "two simulators on one adapter");
}

#[test]
fn a_rollout_with_its_gradient_is_the_cpus() {
    holds((Fidelity::Full, Method::MfsVertex), 1e-6);
}

#[test]
fn so_is_one_of_panels_on_two_meshes_which_is_the_default() {
    holds((Fidelity::Full, Method::Auto), 1e-7);
    let made = of((Fidelity::Full, Method::Auto), Backend::Gpu, 1e-10);
    let bodies = made.discretisation();
    assert!(bodies.iter().all(|b| b.method == "panel"), "{bodies:?}");
}

#[test]
fn so_is_one_of_compressed_bodies() {
    holds((Fidelity::Reduced, Method::Auto), 1e-6);
}

/// An added mass of the coin's own: constant on either side.
#[test]
fn so_is_one_with_a_given_added_mass() {
    let mut scene = falling_ball();
    let coin = scene.bodies.last_mut().unwrap();
    let volume = coin.shape.clone().map(|shape| {
        let mesh = crate::support::mesh(&shape, 40);
        mesh.mass_properties().volume
    });
    let volume = volume.unwrap();
    let arm = |i: usize| if i < 3 { 1.0 } else { 0.3 * volume.cbrt() };
    let entry = |i: usize, j: usize| match i == j {
        true => 2.0 * volume * arm(i).powi(2),
        false => 0.1 * volume * (i as f64 + j as f64).sin() * arm(i) * arm(j),
    };
    let rows = (0..6).map(|i| (0..6).map(|j| entry(i, j)).collect());
    coin.added_mass = Some(rows.collect());
    let mut alone = Scene::new(falling_ball().fluid);
    alone.add(coin.clone());
    for (how, limit) in [
        ((Fidelity::Full, Method::MfsVertex), 1e-6),
        ((Fidelity::Full, Method::Auto), 1e-7),
        ((Fidelity::Reduced, Method::Auto), 1e-6),
    ] {
        let cpu = in_scene(&scene, how, Backend::Cpu, 1e-12);
        let gpu = in_scene(&scene, how, Backend::Gpu, 1e-10);
        for (cpu, gpu) in groups(&cpu).iter().zip(&groups(&gpu)) {
            let off = difference(gpu, cpu);
            println!("{how:?}: {off:.1e}");
            assert!(off <= limit, "{how:?}: {off:e}");
        }
        let by_itself = in_scene(&alone, how, Backend::Gpu, 1e-10);
        let own = by_itself.added_mass().unwrap().own(0) / by_itself.parameters().density();
        let right = DMatrix::from_fn(6, 6, entry);
        let scale = |i: usize| right[(i, i)].sqrt();
        let off = DMatrix::from_fn(6, 6, |i, j| {
            (own[(i, j)] - right[(i, j)]) / (scale(i) * scale(j))
        });
        println!("{how:?}, alone: {:.1e}", off.amax());
        assert!(off.amax() <= 1e-8, "{how:?}: {off}");
    }
}
