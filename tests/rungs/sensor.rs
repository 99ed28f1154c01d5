//! The transpose of what sensors in the water read, through whole rollouts.

use super::tools::{Group, all, groups, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::scene::{Placement, Wall};
use hydrograd::simulate::{Method, Sensor};
use hydrograd::{Body, Controls, Fidelity, Fluid, Rollout, Scene, Settings, Shape, Simulator};
use nalgebra::{DMatrix, DVector};

pub fn rungs() -> Vec<Rung> {
    vec![Rung {
        name: "simulate::sensor::Rollout::sensor_vjp",
        check: |c| all(WAYS.map(|way| sensors(way, c))),
    }]
}

/// All ways to come by the flow.
const WAYS: [(Fidelity, Method); 4] = [
    (Fidelity::Isolated, Method::Panel),
    (Fidelity::Reduced, Method::Panel),
    (Fidelity::Full, Method::Panel),
    (Fidelity::Full, Method::MfsVertex),
];
const STEPS: usize = 2;

/// Two bodies, one of them driven, that pass each other beside a wall in a current.
fn scene(walled: bool) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.1, 0.2, -9.81];
    scene.fluid.current = [0.1, -0.2, 0.0];
    let mut egg = Body::new(Shape::ellipsoid([0.3, 0.2, 0.25])).density(1500.0);
    egg.name = "egg".into();
    egg.shape_at = Placement::new([0.05, -0.03, 0.02], [0.2, -0.3, 0.1]);
    scene.add(egg.actuated());
    let ball = Body::new(Shape::ellipsoid([0.2, 0.25, 0.3])).density(700.0);
    scene.add(ball.at([0.8, 0.2, -0.1]));
    if walled {
        scene
            .walls
            .push(Wall::rigid([0.0, 0.0, -0.9], [0.0, 0.0, 1.0]));
    }
    scene.initial.v = wavy(12, 0.4, 0.6).as_slice().to_vec();
    scene
}

fn readings(rollout: &Rollout, sensors: &[Sensor]) -> [DMatrix<f64>; 2] {
    let states = 0..rollout.states().len();
    let flow = states.clone().flat_map(|n| {
        let found = rollout.sensor_flow(n, sensors).unwrap();
        found.into_iter().flat_map(|u| [u.x, u.y, u.z])
    });
    let flow = DMatrix::from_iterator(3 * sensors.len(), states.len(), flow);
    let pressure = states
        .clone()
        .flat_map(|n| rollout.sensor_pressure(n, sensors).unwrap());
    let pressure = DMatrix::from_iterator(sensors.len(), states.len(), pressure);
    [flow, pressure]
}

/// Controls, the state and the density, of a velocity and of a pressure.
fn sensors((fidelity, method): (Fidelity, Method), c: f64) -> Outcome {
    let settings = Settings::default().fidelity(fidelity).method(method);
    let settings = settings.faces(80).time_step(0.01).tolerance(1e-13);
    let simulator = Simulator::new(&scene(fidelity.coupled()), settings).unwrap();
    let sensors = [
        Sensor::fixed([0.4, 0.5, 0.2]),
        Sensor::on("egg", [-0.1, -0.45, 0.1]),
    ];
    let given = DMatrix::from_column_slice(6, STEPS, wavy(6 * STEPS, 1.5, 10.0).as_slice());
    let of = |simulator: &Simulator, u: &DMatrix<f64>| {
        let controls = Controls::from_matrix(simulator, u.clone()).unwrap();
        simulator.rollout(&controls).unwrap()
    };
    let rollout = of(&simulator, &given);
    let [flow, pressure] = readings(&rollout, &sensors);
    let bars = |x: &DMatrix<f64>, phase: f64| {
        let size = 1.0 / x.amax();
        DMatrix::from_column_slice(x.nrows(), x.ncols(), wavy(x.len(), phase, size).as_slice())
    };
    all([true, false].into_iter().map(|by_flow| {
        let bar = bars(if by_flow { &flow } else { &pressure }, 2.5);
        let cotangents = match by_flow {
            true => rollout.sensor_vjp(&sensors, Some(&bar), None),
            false => rollout.sensor_vjp(&sensors, None, Some(&bar)),
        };
        let back = rollout.vjp(&cotangents.unwrap()).unwrap();
        let value = |rollout: &Rollout| {
            let [flow, pressure] = readings(rollout, &sensors);
            bar.dot(if by_flow { &flow } else { &pressure })
        };
        let du = DMatrix::from_column_slice(6, STEPS, wavy(6 * STEPS, 3.6, 10.0).as_slice());
        let (dq, dv) = (wavy(12, 4.7, 0.1), wavy(12, 5.8, 0.3));
        let (q, v) = (simulator.start().0.clone(), simulator.start().1.clone());
        let started = |q: DVector<f64>, v: DVector<f64>| {
            let mut other = simulator.clone();
            other.set_start(q, v).unwrap();
            value(&of(&other, &given))
        };
        let tree = &simulator.system().tree;
        groups(
            vec![
                Group {
                    name: "controls",
                    slope: back.controls.dot(&du),
                    value: Box::new(|h| value(&of(&simulator, &(&given + h * &du)))),
                },
                Group {
                    name: "q",
                    slope: back.initial.q.dot(&dq),
                    value: Box::new(|h| started(tree.integrate(&q, &(h * &dq)), v.clone())),
                },
                Group {
                    name: "v",
                    slope: back.initial.v.dot(&dv),
                    value: Box::new(|h| started(q.clone(), &v + h * &dv)),
                },
                Group {
                    name: "density",
                    slope: 300.0 * back.parameters.density(),
                    value: Box::new(|h| {
                        let mut other = simulator.clone();
                        let mut parameters = simulator.parameters().clone();
                        *parameters.density_mut() += 300.0 * h;
                        other.set_parameters(parameters).unwrap();
                        value(&of(&other, &given))
                    }),
                },
            ],
            c,
        )
    }))
}
