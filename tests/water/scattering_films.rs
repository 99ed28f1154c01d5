//! Films in gaps that many bodies' points don't resolve, by products: against the factor and differences, where faces, edges and rims lie close.

use crate::support::says;
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::coupling::{Coupling, Direction, Linearised};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use hydrograd::simulate::Exchange;
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::{DMatrix, DVector};

/// Two blocks face to face, a thin plate over them, a disc edge on beside it, a ball, and a rod along an edge; over a bed at which two of them lie.
fn pile(density: f64) -> (Scene, Vec<Pose>) {
    let mut scene = Scene::new(Fluid::fresh_water());
    let block = || Shape::cuboid([0.1, 0.1, 0.05]).faces(320);
    let parts = [
        (block(), [0.0, 0.0, 0.026]),
        (block(), [0.1012, 0.003, 0.027]),
        (
            Shape::cuboid([0.16, 0.12, 0.012]).faces(320),
            [0.045, 0.01, 0.0595],
        ),
        (Shape::cylinder(0.05, 0.02).faces(320), [0.05, 0.0, 0.0773]),
        (Shape::sphere(0.04).faces(320), [0.05, -0.02, 0.1288]),
        (
            Shape::capsule(0.015, 0.1).faces(320),
            [0.05, 0.0865, 0.0665],
        ),
        (Shape::sphere(0.03).faces(320), [-0.12, 0.1, 0.09]),
    ];
    let mut random = Samples::new(5);
    let mut poses = Vec::new();
    for (k, (shape, at)) in parts.into_iter().enumerate() {
        // Aligned to the last digit, distances have no slopes.
        let turn = random.vector(0.005);
        let body = Body::new(shape).density(density).at(at).rotated(turn);
        scene.add(body.named(format!("part {k}")));
        poses.push(Pose::new(exp_matrix(&Vec3::from(turn)), Vec3::from(at)));
    }
    scene.add_wall([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    (scene, poses)
}

fn settings(exchange: Exchange, films: bool) -> Settings {
    Settings::default()
        .fidelity(Fidelity::Reduced)
        .exchange(exchange)
        .accuracy(0.01)
        .films(films)
        .time_step(0.002)
}

fn made(scene: &Scene, exchange: Exchange, films: bool) -> Simulator {
    Simulator::new(scene, settings(exchange, films)).unwrap()
}

fn coupling(simulator: &Simulator) -> &dyn Coupling {
    simulator.system().coupling.as_ref()
}

fn stacked(wrenches: &[Vec6]) -> DVector<f64> {
    let all = wrenches.iter().flat_map(|w| w.iter().copied());
    DVector::from_iterator(6 * wrenches.len(), all)
}

fn differ(found: &DVector<f64>, right: &DVector<f64>) -> f64 {
    (found - right).norm() / right.norm()
}

fn moved(poses: &[Pose], z: &[Vec6], h: f64) -> Vec<Pose> {
    let each = poses.iter().zip(z);
    each.map(|(p, z)| p.displace(&(h * z))).collect()
}

/// Twists, and displacements that open and close gaps and turn faces against each other, a hundredth of a gap at most.
fn drawn(drawn: &mut Samples, bodies: usize, size: f64) -> Vec<Vec6> {
    let one = |k: usize| {
        Vec6::from_fn(|i, _| {
            size * if i < 3 { 1.0 } else { 5.0 } * drawn.number() / (1.0 + 0.1 * k as f64)
        })
    };
    (0..bodies).map(one).collect()
}

#[test]
fn values_and_derivatives_are_those_of_the_factor() {
    let (scene, poses) = pile(2000.0);
    let simulators =
        [Exchange::Products, Exchange::Factor].map(|exchange| made(&scene, exchange, true));
    let [products, factor] = simulators.each_ref().map(coupling);
    let n = poses.len();
    let mut random = Samples::new(3);
    let basis = DMatrix::from_fn(6 * n, 2, |_, _| random.number());
    let open = made(&scene, Exchange::Products, false);
    let momenta = |c: &dyn Coupling| {
        c.evaluate(&poses, &basis)
            .unwrap()
            .momenta()
            .column(0)
            .into_owned()
    };
    let (found, right) = (momenta(products), momenta(factor));
    let error = differ(&found, &right);
    println!("impulses differ by {error:.1e}");
    assert!(error < 5e-4);
    // Without films the points don't resolve these gaps at all.
    let refused = coupling(&open).evaluate(&poses, &basis);
    says(refused.err().unwrap().to_string(), &["nearer than", "part"]);

    let z = drawn(&mut random, n, 1.0);
    let [x, y] = [0, 1].map(|k| basis.column(k).into_owned());
    let unit = [[1.0, 0.0], [0.0, 1.0]].map(|x| DVector::from_column_slice(&x));
    let of = |at: &dyn Linearised| {
        let (bx, by) = (Direction::Basis(&unit[0]), Direction::Basis(&unit[1]));
        let pull = at.vjp(Direction::Twist(&x), by).unwrap();
        let bent = at.hvp(bx, bx, &z).unwrap();
        let mixed = at
            .hvp(Direction::Twist(&x), Direction::Twist(&y), &z)
            .unwrap();
        let mut out = vec![
            (
                "slope of x, x",
                stacked(&at.gradient(&unit[0], &unit[0]).unwrap()),
            ),
            (
                "slope of x, y",
                stacked(&at.gradient(&unit[0], &unit[1]).unwrap()),
            ),
            ("vjp", stacked(&pull.wrench)),
            ("vjp's impulses", pull.momentum_x),
            ("along", at.gradient_along(&unit[0], &z).unwrap()),
            ("hvp's slope", stacked(&bent.gradient)),
            ("hvp", stacked(&bent.wrench)),
            ("hvp's impulses", bent.momentum_x),
            ("mixed slope", stacked(&mixed.gradient)),
            ("mixed hvp", stacked(&mixed.wrench)),
            ("mixed impulses", mixed.momentum_y),
        ];
        if let Some(told) = at.carried(&unit[0], &y, &z).unwrap() {
            out.push(("carried slope", stacked(&told.gradient)));
            out.push(("carried", stacked(&told.wrench)));
            out.push(("carried momentum", told.momentum));
        }
        out
    };
    let at = |c: &dyn Coupling| {
        of(c.differentiable()
            .unwrap()
            .linearise(&poses, &basis)
            .unwrap()
            .as_ref())
    };
    let (found, right) = (at(products), at(factor));
    for ((what, found), (_, right)) in found.iter().zip(&right) {
        let error = differ(found, right);
        println!("{what}: {error:.1e}");
        assert!(error < 1e-4, "{what}: {error:e}");
    }
    // What the factor doesn't tell in one: by its parts.
    let factor = factor
        .differentiable()
        .unwrap()
        .linearise(&poses, &basis)
        .unwrap();
    let (bx, y) = (Direction::Basis(&unit[0]), Direction::Twist(&y));
    let (bent, pull) = (factor.hvp(bx, bx, &z).unwrap(), factor.vjp(y, bx).unwrap());
    let wrench = 0.5 * stacked(&bent.wrench) + stacked(&pull.wrench);
    let momentum = bent.momentum_x + pull.momentum_x;
    for (what, right) in [("carried", wrench), ("carried momentum", momentum)] {
        let told = found.iter().find(|(name, _)| *name == what).unwrap();
        let error = differ(&told.1, &right);
        println!("{what} by parts: {error:.1e}");
        assert!(error < 1e-4, "{what}: {error:e}");
    }
}

/// Round bodies so near to each other and to a bed that all gaps are films.
fn round(density: f64) -> (Scene, Vec<Pose>) {
    let mut scene = Scene::new(Fluid::fresh_water());
    let parts = [
        (Shape::sphere(0.05), [0.0, 0.0, 0.0512]),
        (Shape::sphere(0.04), [0.0905, 0.0, 0.066]),
        (Shape::ellipsoid([0.06, 0.04, 0.03]), [0.02, 0.0, 0.135]),
        (Shape::capsule(0.02, 0.06), [0.03, 0.0655, 0.06]),
    ];
    let mut poses = Vec::new();
    for (shape, at) in parts {
        scene.add(Body::new(shape.faces(320)).density(density).at(at));
        poses.push(Pose::new(Pose::identity().rotation, Vec3::from(at)));
    }
    scene.add_wall([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    (scene, poses)
}

/// The wrenches are slopes of the energy, and their rates those that differences have: of round bodies to their digits, of faces and edges as far as distances to these have slopes.
#[test]
fn slopes_are_those_of_differences() {
    for (name, (scene, poses), most) in [
        ("round", round(2000.0), 1e-8),
        ("edged", pile(2000.0), 2e-6),
    ] {
        let simulator = made(&scene, Exchange::Products, true);
        let products = coupling(&simulator).differentiable().unwrap();
        let n = poses.len();
        let mut random = Samples::new(9);
        let basis = DMatrix::from_fn(6 * n, 1, |_, _| random.number());
        let one = DVector::from_element(1, 1.0);
        let z = drawn(&mut random, n, 1.0);
        let at = |h: f64| {
            let at = products.linearise(&moved(&poses, &z, h), &basis).unwrap();
            let energy = basis.column(0).dot(&at.momenta().column(0));
            let wrenches = stacked(&at.gradient(&one, &one).unwrap());
            (energy, wrenches, at.momenta().column(0).into_owned())
        };
        let h = 2e-6;
        let [a, b, c, d] = [h, -h, 2.0 * h, -2.0 * h].map(&at);
        let here = products.linearise(&poses, &basis).unwrap();
        let slope = (8.0 * (a.0 - b.0) - c.0 + d.0) / (12.0 * h);
        let told = stacked(&here.gradient(&one, &one).unwrap()).dot(&stacked(&z));
        let x = basis.column(0).into_owned();
        let along = Direction::Twist(&x);
        let tangent = here.hvp(along, along, &z).unwrap();
        let rate = (8.0 * (&a.1 - &b.1) - &c.1 + &d.1) / (12.0 * h);
        let momenta = (8.0 * (&a.2 - &b.2) - &c.2 + &d.2) / (12.0 * h);
        let slopes = [
            (told - slope).abs() / slope.abs(),
            differ(&tangent.momentum_x, &momenta),
            differ(&stacked(&tangent.wrench), &rate),
        ];
        println!("{name}: slope, rates of impulses and of wrenches differ by {slopes:?}");
        assert!(slopes[0] < most && slopes[1] < most, "{slopes:?}");
    }
}

/// Faces and edges, and round bodies, that are pushed together, by explicit and implicit integrators: the factor's motion and gradients, and those of differences.
#[test]
fn closing_gaps_move_as_with_the_factor_and_have_gradients() {
    let integrators = [
        Integrator::Rk4,
        Integrator::MomentumEuler,
        Integrator::Midpoint,
    ];
    for (name, (mut scene, poses), most) in [
        ("round", round(1500.0), 1e-8),
        ("edged", pile(1500.0), 3e-5),
    ] {
        let closing = |i: usize| match i % 6 {
            2 => -0.02 - 0.01 * (i / 6) as f64,
            _ => 0.0,
        };
        scene.initial.v = (0..6 * poses.len()).map(closing).collect();
        let steps = 3;
        for integrator in integrators {
            let rollouts = [Exchange::Products, Exchange::Factor].map(|exchange| {
                let settings = settings(exchange, true).integrator(integrator);
                let simulator = Simulator::new(&scene, settings).unwrap();
                let controls = Controls::zeros(&simulator, steps);
                simulator.rollout(&controls).unwrap()
            });
            let change = |r: &hydrograd::Rollout| &r.samples()[steps].v - &r.samples()[0].v;
            let [found, right] = rollouts.each_ref().map(change);
            let error = differ(&found, &right);
            let last = rollouts[0].samples()[steps].v.clone();
            let mut random = Samples::new(4);
            let weights = DVector::from_fn(last.len(), |_, _| 0.5 * random.number());
            let target = |i: usize| objective::final_velocity(i, last[i] - 0.5, weights[i]);
            let loss = (1..weights.len()).fold(target(0), |sum, i| sum + target(i));
            let gradients = rollouts
                .each_ref()
                .map(|r| r.gradient(&loss).unwrap().initial);
            let along = DVector::from_fn(last.len(), |_, _| 0.1 * random.number());
            let start = rollouts[0].simulator();
            let value = |h: f64| {
                let mut moved = start.clone();
                let (q, v) = moved.start();
                let q = start.system().tree.integrate(q, &(0.01 * h * &along));
                let v = v + h * &along;
                moved.set_start(q, v).unwrap();
                let rollout = moved.rollout(&Controls::zeros(&moved, steps)).unwrap();
                weights.dot(&rollout.samples()[steps].v)
            };
            let [told, factor] = gradients.map(|g| (&g.v + 0.01 * &g.q).dot(&along));
            let h = 1e-3;
            let sides = |h: f64| value(h) - value(-h);
            let by = (8.0 * sides(h) - sides(2.0 * h)) / (12.0 * h);
            let [from_factor, worst] = [factor, by].map(|by| (told - by).abs() / by.abs());
            println!(
                "{name}, {integrator:?}: changes of velocity differ by {error:.1e}, gradients from the factor's by {from_factor:.1e}, from differences by {worst:.1e}"
            );
            assert!(error < 1e-3 && from_factor < 1e-4, "{error}, {from_factor}");
            assert!(worst < most, "{worst}");
        }
    }
}

/// Blocks in contact on a bed, that joints drive into each other: nothing fails, and the smallest gap is carried by a film, as with the factor.
#[test]
fn pressed_together_the_gap_is_a_film() {
    let mut scene = Scene::new(Fluid::fresh_water());
    for k in 0..3 {
        let block = Body::new(Shape::cuboid([0.1, 0.1, 0.04]).faces(320)).density(2500.0);
        let joint = Joint::Prismatic {
            axis: [0.0, 0.0, 1.0],
        };
        scene.add(
            block
                .at([0.0, 0.0, 0.024 + 0.046 * f64::from(k)])
                .joint(joint)
                .actuated(),
        );
    }
    scene.add_wall([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let run = |exchange| {
        let simulator = made(&scene, exchange, true);
        let controls = DMatrix::from_fn(3, 48, |_, _| -2.0);
        let controls = Controls::from_matrix(&simulator, controls).unwrap();
        simulator.rollout(&controls).unwrap()
    };
    let (products, factor) = (run(Exchange::Products), run(Exchange::Factor));
    let [found, right] = [&products, &factor].map(|r| r.samples()[48].q.clone());
    let fallen = (&right - &factor.samples()[0].q).norm();
    let error = (&found - &right).norm() / fallen;
    let [a, b] = [&products, &factor].map(|r| r.gap_report().nearest.unwrap());
    println!(
        "places differ by {error:.1e} of the way; smallest gaps {:.3e} m and {:.3e} m",
        a.gap, b.gap
    );
    assert!(error < 2e-3);
    assert_eq!(a.carried, b.carried);
    assert_eq!(format!("{:?}", a.carried), "Film");
    assert_eq!(products.gap_report().changes, factor.gap_report().changes);
}

/// Blocks that lie on one another a millimetre apart, over a bed, and slide and sink.
fn stack(blocks: usize) -> Simulator {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add_wall([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    scene.gravity = [0.0, 0.0, -9.81];
    for k in 0..blocks {
        let shape = Shape::cuboid([0.2, 0.2, 0.05]).faces(300);
        let body = Body::new(shape).density(2000.0);
        let at = [0.001 * (k % 3) as f64, 0.0, 0.026 + 0.051 * k as f64];
        scene.add(body.at(at).named(format!("block {k}")));
    }
    let settings = settings(Exchange::Products, true).integrator(Integrator::Rk2);
    Simulator::new(&scene, settings.time_step(0.001)).unwrap()
}

/// Films weigh more than the blocks do, each in its own gap: taken with the blocks' own inertia they don't lengthen the search, whose iterations grew with their number.
#[test]
fn films_weigh_with_the_bodies() {
    let mut iterations = Vec::new();
    for blocks in [8, 24] {
        let simulator = stack(blocks);
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 5)).unwrap();
        let summary = rollout.summary();
        let drift = summary.momentum_drift.expect("nothing acts along the bed");
        println!(
            "{blocks} blocks: {} iterations, momentum changes by {drift:.1e}",
            summary.iterations
        );
        assert!(drift < 1e-12);
        iterations.push(summary.iterations);
    }
    assert!(
        iterations.iter().all(|i| *i < 50),
        "{iterations:?}: 29 and 30 are right"
    );
}
