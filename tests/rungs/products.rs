//! A step of bodies that products couple, and the velocity that is read out before it, by every integrator: forces and velocities whose cotangents are found together, stages that are
//! transposed by products, contact aside.

use super::multibody::tree_displacement;
use super::tools::{Group, all, groups, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::dynamics::{Drive, Input, Integrator, Parameters, State, StateBar, Stepper};
use hydrograd::scene::{Body, Drag, DragPart, Fluid, Joint, Motion, Passive, Scene, Shape};
use hydrograd::simulate::Exchange;
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DVector;
use std::sync::OnceLock;

const DT: f64 = 0.02;

pub fn rungs() -> Vec<Rung> {
    vec![Rung {
        name: "dynamics::integrator::readout::force_vjp",
        check: |c| {
            all([
                Integrator::Rk4,
                Integrator::Rk2,
                Integrator::MomentumEuler,
                Integrator::EnergyEuler,
                Integrator::Midpoint,
                Integrator::VelocityEuler,
            ]
            .map(|integrator| step(integrator, c)))
        },
    }]
}

/// A vehicle with an arm that holds a weight, which isn't in the water, and a tail that is driven, and two others, in a current.
fn simulator() -> &'static Simulator {
    static MADE: OnceLock<Simulator> = OnceLock::new();
    MADE.get_or_init(|| {
        let mut scene = Scene::new(Fluid {
            density: 998.0,
            current: [0.1, -0.2, 0.05],
        });
        scene.gravity = [0.2, 0.1, -1.0];
        let oval = |x, y, z| Shape::ellipsoid([x, y, z]).faces(80);
        scene.add(
            Body::new(oval(0.3, 0.2, 0.15))
                .named("hull")
                .density(1100.0)
                .center_of_mass([0.02, -0.01, -0.03])
                .rotated([0.2, -0.3, 0.4])
                .thruster()
                .actuated()
                .drag(Drag {
                    linear: 10.0,
                    quadratic_part: DragPart::Normal,
                    quadratic: 0.4,
                    ..Drag::default()
                }),
        );
        scene.add(
            Body::new(oval(0.15, 0.06, 0.1))
                .named("arm")
                .child_of("hull")
                .density(1300.0)
                .at([0.55, 0.0, 0.05])
                .joint(Joint::Revolute {
                    axis: [0.3, 0.8, -0.2],
                })
                .actuated(),
        );
        scene.add(
            Body::new(oval(0.1, 0.1, 0.1))
                .density(900.0)
                .at([0.3, 0.5, 0.1]),
        );
        scene.add(
            Body::new(oval(0.12, 0.05, 0.2))
                .density(2000.0)
                .at([-0.1, -0.5, 0.2]),
        );
        scene.add(
            Body::new(oval(0.06, 0.05, 0.08))
                .named("tail")
                .child_of("hull")
                .density(1000.0)
                .at([-0.5, 0.0, 0.0])
                .joint(Joint::Revolute {
                    axis: [0.1, 0.2, 0.9],
                })
                .driven([Motion::Sine {
                    amplitude: 0.3,
                    frequency: 1.5,
                    phase: 0.2,
                    offset: 0.0,
                }]),
        );
        scene.add(
            Body::dry()
                .named("weight")
                .child_of("arm")
                .mass(0.8)
                .inertia([2e-3, 3e-3, 4e-3])
                .at([0.1, 0.0, 0.1])
                .joint(Joint::Prismatic {
                    axis: [0.2, 0.1, 1.0],
                })
                .passive(Passive {
                    stiffness: 4.0,
                    damping: 0.8,
                    armature: 0.3,
                    ..Passive::default()
                }),
        );
        let settings = Settings::default()
            .fidelity(Fidelity::Reduced)
            .exchange(Exchange::Products)
            .accuracy(0.01)
            .films(false)
            .time_step(DT);
        Simulator::new(&scene, settings).expect("the scene is right")
    })
}

fn stepper(parameters: &Parameters, integrator: Integrator) -> Stepper<'_> {
    Stepper {
        system: simulator().system(),
        parameters,
        integrator,
        dt: DT,
    }
}

/// What a step is made from.
#[derive(Clone)]
struct From {
    q: DVector<f64>,
    y: DVector<f64>,
    control: DVector<f64>,
    parameters: Parameters,
}

fn step(integrator: Integrator, c: f64) -> Outcome {
    let system = simulator().system();
    let (tree, n) = (&system.tree, system.tree.velocities());
    let own = simulator().parameters();
    let mut q = tree.integrate(simulator().start().0, &wavy(n, 0.3, 0.05));
    stepper(own, integrator).place_motions(&mut q, 0.0);
    let v = wavy(n, 0.8, 0.5);
    let e = system.linearise(own, &q, 0.0).unwrap();
    let from = From {
        y: stepper(own, integrator).conserved(&e, &v),
        q,
        control: wavy(system.controls, 1.8, 3.0),
        parameters: own.clone(),
    };
    let make = |from: &From| {
        let s = stepper(&from.parameters, integrator);
        let e = system.linearise(&from.parameters, &from.q, 0.0).unwrap();
        let state = State {
            step: 0,
            q: from.q.clone(),
            y: from.y.clone(),
            held: Vec::new(),
            mode: 0,
        };
        let v = s.velocity(&e, &state).unwrap();
        let input = Input {
            control: from.control.clone(),
            hold: Vec::new(),
        };
        s.step(&e, &state, &v, &input).unwrap()
    };
    let base = make(&from);
    let (q_bar, y_bar) = (wavy(n, 5.1, 1.0), wavy(n, 6.1, 1.0));
    let value = |from: &From| {
        let next = make(from).0;
        q_bar.dot(&tree_displacement(tree, &base.0.q, &next.q)) + y_bar.dot(&next.y)
    };
    let next_bar = StateBar {
        q: q_bar.clone(),
        y: y_bar.clone(),
    };
    let made = stepper(own, integrator).linearise_step(&base.1);
    let bar = made.and_then(|made| made.state_vjp(&next_bar)).unwrap();
    let (mut dq, dy) = (wavy(n, 2.1, 0.05), wavy(n, 3.1, 0.2));
    // A step takes the coordinates of driven joints from their motions.
    for (link, drive) in tree.links().iter().zip(&system.drives) {
        if matches!(drive, Drive::Motion(_)) {
            link.v.clone().for_each(|i| dq[i] = 0.0);
        }
    }
    let du = wavy(system.controls, 4.1, 1.0);
    let values = DVector::from_vec(own.to_vec());
    let change = values.map(|x| 0.1 * x);
    let (from, value) = (&from, &value);
    let list = vec![
        Group {
            name: "q",
            slope: bar.state.q.dot(&dq),
            value: Box::new(|h| {
                value(&From {
                    q: tree.integrate(&from.q, &(h * &dq)),
                    ..from.clone()
                })
            }),
        },
        Group {
            name: "y",
            slope: bar.state.y.dot(&dy),
            value: Box::new(|h| {
                value(&From {
                    y: &from.y + h * &dy,
                    ..from.clone()
                })
            }),
        },
        Group {
            name: "control",
            slope: bar.control.dot(&du),
            value: Box::new(|h| {
                value(&From {
                    control: &from.control + h * &du,
                    ..from.clone()
                })
            }),
        },
        Group {
            name: "parameters",
            slope: DVector::from_vec(bar.parameters.to_vec()).dot(&change),
            value: Box::new(|h| {
                let values = &values + h * &change;
                value(&From {
                    parameters: own.with_values(values.as_slice()).unwrap(),
                    ..from.clone()
                })
            }),
        },
    ];
    groups(list, c)
}
