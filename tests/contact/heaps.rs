//! Many bodies that settle into a heap, and the sparse matrices of such scenes against whole ones.

use crate::support::CONTACT_INTEGRATORS;
use crate::support::heap::{Heap, heap};
use hydrograd::adjoint::sample::Samples;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Scene, Spring};
use hydrograd::simulate::Exchange;
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator, objective};
use nalgebra::DVector;

fn simulator(scene: &Scene, integrator: Integrator) -> Simulator {
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .integrator(integrator);
    Simulator::new(scene, settings).unwrap()
}

fn run(simulator: &Simulator, steps: usize) -> Rollout {
    let controls = Controls::zeros(simulator, steps);
    simulator.rollout(&controls).unwrap()
}

/// Some bodies of a heap, already thrown at one another and at the floor, so that many touch within a few steps.
fn thrown(bodies: usize) -> Scene {
    let mut scene = heap(bodies, 5e-3);
    let mut random = Samples::new(3);
    scene.initial.v = random.numbers(6 * bodies, 0.5);
    for v in scene.initial.v.chunks_mut(6) {
        v[3..].iter_mut().for_each(|w| *w *= 10.0);
    }
    scene
}

/// The same with all bodies tied by springs that are next to nothing: one island, whose matrices are whole.
fn tied(mut scene: Scene) -> Scene {
    let names: Vec<String> = scene.bodies.iter().map(|b| b.name.clone()).collect();
    for pair in names.windows(2) {
        let spring = Spring {
            stiffness: 1e-280,
            ..Spring::new(&pair[0]).to(&pair[1], [0.0; 3])
        };
        scene.add_force(spring.into());
    }
    scene
}

#[test]
fn sixty_bodies_settle() {
    let simulator = simulator(&heap(60, 5e-3), Integrator::MomentumEuler);
    let rollout = run(&simulator, 200);
    let found = Heap::of(&rollout, 5).unwrap();
    println!(
        "{} inside, deepest {:.2e} m at a gap of {:.2e} m, kinetic energy {:.1e} of {:.1e} J",
        found.inside, found.deepest, found.gap, found.kinetic, found.most_kinetic
    );
    assert!(found.finite && found.inside == 60, "{}", found.inside);
    assert!(found.deepest > -1e-3, "{}", found.deepest);
    assert!(found.kinetic < 0.2 * found.most_kinetic);
    assert!(found.height < 0.3, "{}", found.height);
}

/// Sparse matrices end at the states of whole ones, to rounding.
#[test]
fn sparse_is_as_whole() {
    for integrator in CONTACT_INTEGRATORS {
        let scene = thrown(24);
        let [sparse, whole] = [scene.clone(), tied(scene)].map(|scene| {
            let rollout = run(&simulator(&scene, integrator), 20);
            let pressed: usize = (0..20)
                .map(|n| rollout.contacts(n, 0.0).unwrap().len())
                .sum();
            assert!(pressed > 20, "{pressed}");
            rollout
        });
        // One step to rounding; more make of that what contact makes of differences.
        for (n, limit) in [(1, 1e-12), (20, 1e-10)] {
            let [a, b] = [&sparse, &whole].map(|r| r.samples()[n].v.clone());
            let apart = (&a - &b).norm() / b.norm();
            println!("{integrator:?}: after {n} steps {apart:.1e} apart");
            assert!(apart < limit, "{integrator:?} {n}: {apart}");
        }
        let goal = objective::final_velocity(5, 0.3, 1.0) + objective::final_velocity(11, 0.2, 0.5);
        let [a, b] = [&sparse, &whole].map(|r| r.gradient(&goal).unwrap().initial.v.clone());
        let apart = (&a - &b).norm() / b.norm();
        println!("{integrator:?}: gradients {apart:.1e} apart");
        assert!(apart < 1e-6, "{integrator:?}: {apart}");
    }
}

/// Gradients through sparse factors against differences of the rollout.
#[test]
fn sparse_gradients_hold() {
    for integrator in CONTACT_INTEGRATORS {
        let scene = thrown(24);
        let goal = objective::final_velocity(5, 0.3, 1.0) + objective::final_velocity(11, 0.2, 0.5);
        let start = simulator(&scene, integrator);
        let rollout = run(&start, 8);
        let gradient = rollout.gradient(&goal).unwrap().initial.v;
        let mut random = Samples::new(8);
        let along = DVector::from_vec(random.numbers(gradient.len(), 1.0));
        let told = gradient.dot(&along);
        let value = |h: f64| {
            let mut moved = start.clone();
            let (q, v) = moved.start();
            let (q, v) = (q.clone(), v + h * &along);
            moved.set_start(q, v).unwrap();
            run(&moved, 8).value(&goal).unwrap()
        };
        let error = |h: f64| ((value(h) - value(-h)) / (2.0 * h) - told).abs() / told.abs();
        let best = [1e-5, 1e-6, 1e-7]
            .map(error)
            .into_iter()
            .fold(1.0, f64::min);
        println!("{integrator:?}: {best:.1e}");
        assert!(best < 1e-6, "{integrator:?}: {best}");
    }
}

/// Bodies that touch each other and the floor in water that couples them, by products: as by the factor within the accuracy, with gradients of their own.
#[test]
fn products_are_as_the_factor() {
    for (integrator, films) in CONTACT_INTEGRATORS
        .into_iter()
        .flat_map(|i| [(i, false), (i, true)])
    {
        let scene = thrown(6);
        let make = |exchange| {
            let settings = Settings::default()
                .fidelity(Fidelity::Reduced)
                .exchange(exchange)
                .films(films)
                .accuracy(0.01)
                .integrator(integrator);
            Simulator::new(&scene, settings).unwrap()
        };
        let steps = 24;
        let products = make(Exchange::Products);
        let [a, b] = [&products, &make(Exchange::Factor)].map(|s| run(s, steps));
        let pressed: usize = (0..steps).map(|n| a.contacts(n, 0.0).unwrap().len()).sum();
        assert!(pressed > 3, "{pressed}");
        let [x, y] = [&a, &b].map(|r| &r.samples()[steps].v - &r.samples()[0].v);
        let apart = (&x - &y).norm() / y.norm();
        let goal = objective::final_velocity(5, 0.3, 1.0) + objective::final_velocity(11, 0.2, 0.5);
        let gradient = a.gradient(&goal).unwrap().initial.v;
        let mut random = Samples::new(8);
        let along = DVector::from_vec(random.numbers(gradient.len(), 1.0));
        let told = gradient.dot(&along);
        let value = |h: f64| {
            let mut moved = products.clone();
            let (q, v) = moved.start();
            let (q, v) = (q.clone(), v + h * &along);
            moved.set_start(q, v).unwrap();
            run(&moved, steps).value(&goal).unwrap()
        };
        let error = |h: f64| ((value(h) - value(-h)) / (2.0 * h) - told).abs() / told.abs();
        let best = error(1e-5);
        println!(
            "{integrator:?}, films {films}: {pressed} pressed, {apart:.1e} apart, gradient {best:.1e}"
        );
        assert!(apart < 0.01, "{integrator:?}: {apart}");
        assert!(best < 1e-6, "{integrator:?}: {best}");
    }
}
