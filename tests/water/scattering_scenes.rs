//! What scenes ask of many bodies that are coupled by products: given added masses, joints that follow others, the flow, and sensors in it.

use crate::support::says;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::adjoint::sample::Samples;
use hydrograd::dynamics::Integrator;
use hydrograd::objective::{self, Sum, final_flow, final_pressure};
use hydrograd::scene::{Body, Fluid, Joint, Mimic, Scene, Shape, Wall, WallSurface};
use hydrograd::simulate::{Exchange, Sensor};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::{DMatrix, DVector};

const STEPS: usize = 3;

/// Two hands, each of a palm and two fingers, of which one follows the other, and three stones, of which one is given its added mass, over a floor.
fn hands() -> Scene {
    let mut scene = Scene::new(Fluid {
        current: [0.1, 0.05, 0.0],
        ..Fluid::fresh_water()
    });
    scene.add_wall([0.0, 0.0, -0.4], [0.0, 0.0, 1.0]);
    let mut drawn = Samples::new(3);
    for k in 0..2 {
        let at = [0.9 * f64::from(k), 0.1 * f64::from(k), 0.0];
        let palm = Body::new(Shape::ellipsoid([0.12, 0.1, 0.08]).faces(320));
        scene.add(
            palm.named(format!("palm {k}"))
                .density(1100.0)
                .at(at)
                .thruster(),
        );
        for (name, side) in [("left", 1.0), ("right", -1.0)] {
            let finger = Body::new(Shape::ellipsoid([0.12, 0.04, 0.05]).faces(320))
                .named(format!("{name} {k}"))
                .child_of(format!("palm {k}"))
                .density(1300.0)
                .at([0.27, 0.1 * side, 0.0])
                .joint(Joint::Revolute {
                    axis: [0.1, 0.2, 1.0],
                });
            scene.add(match side > 0.0 {
                true => finger.actuated(),
                false => finger.mimic(Mimic::new(format!("left {k}")).ratio(-0.8).offset(0.1)),
            });
        }
    }
    for k in 0..3 {
        let stone = Body::new(Shape::sphere(0.07).faces(320)).density(1500.0);
        let stone = stone.named(format!("stone {k}"));
        let stone = stone.at([0.55, 0.2 * f64::from(k) - 0.2, 0.15]);
        let given = |i: usize, k: usize| match (i == k, i < 3) {
            (true, true) => 2e-3 + 4e-4 * i as f64,
            (true, false) => 1e-6,
            _ => 0.0,
        };
        scene.add(match k {
            1 => stone.added_mass(std::array::from_fn(|i| {
                std::array::from_fn(|k| given(i, k))
            })),
            _ => stone,
        });
    }
    scene.initial.v = (0..2 * 7 + 3 * 6).map(|_| 0.2 * drawn.number()).collect();
    scene
}

fn simulator(scene: &Scene, exchange: Exchange, integrator: Integrator) -> Simulator {
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .exchange(exchange)
        .integrator(integrator)
        .accuracy(3e-3)
        .time_step(0.01);
    Simulator::new(scene, settings).unwrap()
}

/// Pushed by forces that last.
fn pushed(simulator: &Simulator, more: &DMatrix<f64>) -> Rollout {
    let rows = simulator.control_names().len();
    let push = DMatrix::from_fn(rows, STEPS, |i, n| 0.4 - 0.1 * i as f64 + 0.05 * n as f64);
    let controls = Controls::from_matrix(simulator, push + more).unwrap();
    simulator.rollout(&controls).unwrap()
}

/// Relative difference of the slope that a gradient tells, along where all starts (by parts of `aside`), how fast (by parts of `faster`), and what pushes, from one by differences.
fn off(from: &Simulator, aside: f64, faster: f64, loss: impl Fn(&Simulator) -> Sum) -> f64 {
    let mut drawn = Samples::new(5);
    let (rows, nv) = (from.control_names().len(), from.start().1.len());
    let still = DMatrix::zeros(rows, STEPS);
    let rollout = pushed(from, &still);
    let gradient = rollout.gradient(&loss(from)).unwrap();
    let along = DVector::from_fn(nv, |_, _| drawn.number());
    let more = DMatrix::from_fn(rows, STEPS, |_, _| drawn.number());
    let told = (faster * &gradient.initial.v + aside * &gradient.initial.q).dot(&along)
        + gradient.controls.dot(&more);
    let value = |h: f64| {
        let mut moved = from.clone();
        let (q, v) = moved.start();
        let q = from.system().tree.integrate(q, &(aside * h * &along));
        let v = v + faster * h * &along;
        moved.set_start(q, v).unwrap();
        pushed(&moved, &(h * &more)).value(&loss(from)).unwrap()
    };
    let h = 2e-3;
    let sides = |h: f64| value(h) - value(-h);
    let by = (8.0 * sides(h) - sides(2.0 * h)) / (12.0 * h);
    (told - by).abs() / by.abs()
}

/// The speed of all, as a number.
fn all_speeds(from: &Simulator) -> Sum {
    let (_, v) = from.start();
    let speed = |i: usize| objective::final_velocity(i, 0.3 * v[i] - 0.2, 1.0);
    (1..v.len()).fold(speed(0), |sum, i| sum + speed(i))
}

#[test]
fn given_masses_and_followers_are_as_with_the_factor() {
    let scene = hands();
    for integrator in [
        Integrator::Rk4,
        Integrator::MomentumEuler,
        Integrator::Midpoint,
    ] {
        let [many, few] = [Exchange::Products, Exchange::Factor].map(|exchange| {
            let simulator = simulator(&scene, exchange, integrator);
            let still = DMatrix::zeros(simulator.control_names().len(), STEPS);
            let rollout = pushed(&simulator, &still);
            &rollout.samples()[STEPS].v - &rollout.samples()[0].v
        });
        let error = (&many - &few).norm() / few.norm();
        let many = simulator(&scene, Exchange::Products, integrator);
        assert!(many.system().coupling.scattering().is_some());
        let slope = off(&many, 0.05, 1.0, all_speeds);
        println!(
            "{integrator:?}: changes of velocity differ by {error:.1e}, gradients by {slope:.1e}"
        );
        assert!(error < 3e-3, "{integrator:?}: {error}");
        assert!(slope < 1e-6, "{integrator:?}: {slope}");
    }
}

/// Grains of 3 mm beside a ball of 1 m: what the ball does hides nothing of theirs.
#[test]
fn gradients_of_small_bodies_beside_a_large_one_are_their_slopes() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let ball = Body::new(Shape::sphere(1.0).faces(320)).density(1050.0);
    scene.add(ball.at([0.0, 0.0, -1.6]));
    let mut drawn = Samples::new(41);
    for k in 0..6 {
        let grain = Body::new(Shape::ellipsoid([3e-3, 2e-3, 2.5e-3]).faces(320));
        let at = [f64::from(k % 3), f64::from(k / 3), 0.0].map(|x| 8e-3 * x);
        scene.add(grain.density(2000.0).at(at).rotated(drawn.vector(1.0)));
    }
    let speed = |i: usize| match (i < 6, i % 6 < 3) {
        (true, _) => 0.5,
        (false, true) => 0.02,
        (false, false) => 2.0,
    };
    scene.initial.v = (0..42).map(|i| speed(i) * drawn.number()).collect();
    // The ball's own speed is none of the loss.
    let loss = |of: &Simulator| {
        let (_, v) = of.start();
        let speed = |i: usize| objective::final_velocity(i, 0.3 * v[i], 1e3);
        (7..v.len()).fold(speed(6), |sum, i| sum + speed(i))
    };
    for integrator in [Integrator::MomentumEuler, Integrator::Rk4] {
        let many = simulator(&scene, Exchange::Products, integrator);
        let slope = off(&many, 1e-3, 1e-2, loss);
        println!("{integrator:?}: gradients differ by {slope:.1e}");
        assert!(slope < 1e-6, "{integrator:?}: {slope}");
    }
}

/// Far from all others a body has what it is given.
#[test]
fn alone_a_body_has_what_is_given() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let given: [[f64; 6]; 6] = std::array::from_fn(|i| {
        std::array::from_fn(|k| if i == k { 1e-3 * (1.0 + i as f64) } else { 0.0 })
    });
    for x in [0.0, 40.0] {
        let body = Body::new(Shape::cuboid([0.2, 0.1, 0.1]).faces(320)).density(1200.0);
        scene.add(match x > 0.0 {
            true => body.at([x, 0.0, 0.0]),
            false => body.added_mass(given),
        });
    }
    let found = simulator(&scene, Exchange::Products, Integrator::Rk4);
    let (q, _) = found.start();
    let mass = found.equations(q).unwrap().added_mass_matrix().unwrap();
    for (i, row) in given.iter().enumerate() {
        let right = scene.fluid.density * row[i];
        assert!((mass[(i, i)] - right).abs() < 1e-6 * right);
    }
}

/// A shoal beside a wall and under a free surface.
fn shoal() -> Scene {
    let mut scene = Scene::new(Fluid {
        current: [0.1, 0.0, 0.0],
        ..Fluid::fresh_water()
    });
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add_wall([0.0, -0.3, 0.0], [0.0, 1.0, 0.0]);
    scene.walls.push(Wall {
        surface: WallSurface::Free,
        ..Wall::rigid([0.0, 0.0, 0.5], [0.0, 0.0, -1.0])
    });
    let mut drawn = Samples::new(8);
    for k in 0..6 {
        let shape = match k % 2 {
            0 => Shape::ellipsoid([0.12, 0.05, 0.08]),
            _ => Shape::cuboid([0.2, 0.12, 0.1]),
        };
        let body = Body::new(shape.faces(200)).named(format!("fish {k}"));
        let at = [
            0.4 * f64::from(k % 3),
            0.4 * f64::from(k / 3),
            0.02 * f64::from(k),
        ];
        scene.add(body.density(1020.0 + 20.0 * f64::from(k)).at(at).thruster());
    }
    scene.initial.v = (0..36).map(|_| 0.3 * drawn.number()).collect();
    scene
}

fn sensors() -> [Sensor; 2] {
    [
        Sensor::fixed([0.2, 0.15, 0.1]),
        Sensor::on("fish 4", [0.0, 0.11, 0.06]),
    ]
}

#[test]
fn the_flow_is_that_of_the_factor() {
    let scene = shoal();
    let [many, few] = [Exchange::Products, Exchange::Factor].map(|exchange| {
        let simulator = simulator(&scene, exchange, Integrator::Rk4);
        let still = DMatrix::zeros(simulator.control_names().len(), STEPS);
        pushed(&simulator, &still)
    });
    let points: Vec<Vec3> = (0..20)
        .map(|k| Vec3::new(0.05 * f64::from(k), 0.2, -0.2 + 0.02 * f64::from(k)))
        .collect();
    for n in [0, STEPS] {
        let [a, b] = [&many, &few].map(|r| r.flow(n, &points).unwrap());
        let size = b.iter().map(|f| f.norm()).fold(0.0, f64::max);
        let apart = a.iter().zip(&b).map(|(a, b)| (a - b).norm());
        let of_flow = apart.fold(0.0, f64::max) / size;
        let [a, b] = [&many, &few].map(|r| r.pressure(n).unwrap());
        let size = b.iter().map(|p| p.wrench().amax()).fold(0.0, f64::max);
        let apart = a
            .iter()
            .zip(&b)
            .map(|(a, b)| (a.wrench() - b.wrench()).amax());
        let of_pressure = apart.fold(0.0, f64::max) / size;
        let [a, b] = [&many, &few].map(|r| r.sensor_flow(n, &sensors()).unwrap());
        let read = a.iter().zip(&b).map(|(a, b)| (a - b).norm());
        let read = read.fold(0.0, f64::max);
        println!(
            "step {n}: flow differs by {of_flow:.1e}, wrenches of pressure by {of_pressure:.1e}, sensors by {read:.1e} m/s"
        );
        assert!(of_flow < 3e-3 && of_pressure < 3e-3 && read < 1e-3);
    }
}

#[test]
fn what_sensors_read_has_gradients() {
    let simulator = simulator(&shoal(), Exchange::Products, Integrator::Rk2);
    let worst = off(&simulator, 0.05, 1.0, |_| {
        let [fixed, carried] = sensors();
        let read = |sensor: &Sensor, weight| final_flow(sensor.clone(), [0.1, -0.2, 0.1], weight);
        read(&fixed, 1.0) + read(&carried, 2.0) + final_pressure(carried.clone(), 30.0, 1e-3)
    });
    println!("gradients differ from differences by {worst:.1e}");
    assert!(worst < 1e-6);
}

/// Shapes that are parameters take the factor, and nothing else does.
#[test]
fn shape_parameters_are_refused_by_name() {
    let mut scene = shoal();
    scene.walls.clear();
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .exchange(Exchange::Products)
        .shape_parameters(vec!["fish 0".to_string()]);
    let refused = Simulator::new(&scene, settings);
    says(
        refused.err().map_or(String::new(), |e| e.to_string()),
        &["shape parameters", "exchange", "factor"],
    );
}
