//! Rungs of contact: bodies of every kind of shape pressed together and on a wall, sliding and turning.

use super::tools::{Group, all, along, groups, vector_along, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::adjoint::contact::Law;
use hydrograd::dynamics::{
    Dual, Input, Integrator, JointLimit, Linearisation, Parameters, State, StateBar, Stepper,
    System,
};
use hydrograd::scene::{Body, Contact, Fluid, Joint, Lubrication, Scene, Shape};
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DVector;
use std::sync::OnceLock;

/// Those that solve contact.
pub const INTEGRATORS: [Integrator; 4] = [
    Integrator::MomentumEuler,
    Integrator::EnergyEuler,
    Integrator::Midpoint,
    Integrator::VelocityEuler,
];

pub fn rungs() -> Vec<Rung> {
    vec![
        Rung {
            name: "dynamics::limit::JointLimit::forces_jvp",
            check: limit_jvp,
        },
        Rung {
            name: "dynamics::limit::JointLimit::forces_vjp",
            check: limit_vjp,
        },
        Rung {
            name: "dynamics::contact_force::Evaluation::contact_force_jvp",
            check: jvp,
        },
        Rung {
            name: "dynamics::contact_force::Evaluation::contact_force_vjp",
            check: force_vjp,
        },
        Rung {
            name: "dynamics::integrator::end_contact::Adjoint::apply_vjp",
            check: |c| all(INTEGRATORS.map(|i| step_vjp(i, c))),
        },
    ]
}

/// Coordinates and rates of a joint at which one of its stops presses, within the width and deeper.
const PRESSED: [(f64, f64); 5] = [
    (-0.1003, 0.02),
    (0.1, 0.3),
    (0.0999, -0.005),
    (-0.0999, -0.0001),
    (0.3, 0.1),
];

fn limit() -> JointLimit {
    JointLimit {
        q: 0,
        v: 0,
        range: [-0.1, 0.1],
        rigid: true,
        law: Law {
            stiffness: 3e3,
            dissipation: 0.2,
            friction: 0.0,
            torsional_friction: 0.0,
            rolling_friction: 0.0,
            stiction_speed: 1.0,
            stiction_spin: 1.0,
            gap: 0.0,
            width: 2e-4,
            horizon: 0.01,
        },
    }
}

fn limit_jvp(c: f64) -> Outcome {
    let l = limit();
    all(PRESSED.map(|(q, v)| {
        let value = |h: f64| l.forces(q, v + 1e-3 * h).iter().sum();
        assert!(value(0.0) != 0.0);
        along(value, c * l.forces_jvp(q, v, 1e-3))
    }))
}

fn limit_vjp(c: f64) -> Outcome {
    let l = limit();
    all(PRESSED.map(|(q, v)| {
        let [q_bar, v_bar] = l.forces_vjp(q, v, 0.7);
        let value = |dq: f64, dv: f64| 0.7 * l.forces(q + dq, v + dv).iter().sum::<f64>();
        groups(
            vec![
                Group {
                    name: "q",
                    slope: 1e-5 * q_bar,
                    value: Box::new(move |h| value(1e-5 * h, 0.0)),
                },
                Group {
                    name: "v",
                    slope: 1e-3 * v_bar,
                    value: Box::new(move |h| value(0.0, 1e-3 * h)),
                },
            ],
            c,
        )
    }))
}

/// Every two neighbours overlap by millimetres, and the lower ones the wall, with viscous water between; beside them an arm with both its joints at limits.
fn scene() -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 0.0,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add_wall([0.0, 0.0, -0.3], [0.0, 0.1, 1.0]);
    scene.contact = Some(Contact {
        stiffness: Some(3e3),
        dissipation: 0.4,
        friction: 0.6,
        torsional_friction: 0.03,
        rolling_friction: 0.02,
        gap: Some(0.02),
        width: Some(5e-3),
        stiction_speed: 0.05,
    });
    let bodies = [
        (Shape::ellipsoid([0.3, 0.2, 0.15]), [0.0, 0.0, -0.14]),
        (Shape::sphere(0.2), [0.1, 0.39, -0.11]),
        (Shape::cuboid([0.3, 0.2, 0.25]), [-0.42, 0.05, -0.16]),
        (Shape::capsule(0.1, 0.3), [0.05, 0.05, 0.28]),
    ];
    for (shape, place) in bodies {
        scene.add(
            Body::new(shape.faces(80))
                .density(1000.0)
                .at(place)
                .rotated([0.1, 0.2, 0.3]),
        );
    }
    // As strong as contact is.
    let oil = Lubrication::new(0.02).viscosity(3.0).reach(0.1);
    scene.add_force(oil.named("oil").into());
    let arm = |mass: f64| {
        let body = Body::dry().mass(mass).inertia([0.2, 0.3, 0.4]);
        body.center_of_mass([0.2, 0.1, 0.3])
    };
    let axis = [0.2, 0.4, 1.0];
    scene.add(
        arm(2.0)
            .named("slider")
            .joint(Joint::Prismatic { axis })
            .limits([-0.1, 5e-4])
            .limit_stiffness(4e3),
    );
    scene.add(
        arm(1.0)
            .child_of("slider")
            .at([0.3, 0.0, 0.1])
            .joint(Joint::Revolute { axis })
            .limits([-5e-4, 0.1]),
    );
    scene
}

fn simulator() -> &'static Simulator {
    static MADE: OnceLock<Simulator> = OnceLock::new();
    MADE.get_or_init(|| {
        let settings = Settings::default()
            .fidelity(Fidelity::Isolated)
            .integrator(Integrator::MomentumEuler);
        Simulator::new(&scene(), settings).expect("the scene is right")
    })
}

pub fn system() -> &'static System {
    simulator().system()
}

#[derive(Clone)]
pub struct Point {
    pub q: DVector<f64>,
    pub v: DVector<f64>,
    pub parameters: Parameters,
}

pub fn point() -> Point {
    let n = system().tree.velocities();
    let mut v = wavy(n, 0.8, 0.3);
    (v[n - 2], v[n - 1]) = (0.25, -0.3);
    Point {
        q: simulator().start().0.clone(),
        v,
        parameters: simulator().parameters().clone(),
    }
}

pub fn evaluate<'a>(parameters: &'a Parameters, q: &DVector<f64>) -> Linearisation<'a> {
    system().linearise(parameters, q, 0.0).unwrap()
}

/// A scalar against its cotangents: every body's displacement and velocity, and every parameter of contact and of what is solved with it, apart.
fn check(
    value: &dyn Fn(&Point) -> f64,
    at: &Point,
    q: &DVector<f64>,
    v: &DVector<f64>,
    parameters: &Parameters,
    c: f64,
) -> Outcome {
    let tree = &system().tree;
    let n = tree.velocities();
    let mut list = Vec::new();
    for link in tree.links() {
        let only = |d: DVector<f64>| {
            DVector::from_fn(n, |i, _| if link.v.contains(&i) { d[i] } else { 0.0 })
        };
        let (dq, dv) = (only(wavy(n, 2.1, 0.02)), only(wavy(n, 3.2, 0.1)));
        list.push(Group {
            name: "q",
            slope: q.dot(&dq),
            value: Box::new(move |h| {
                let q = tree.integrate(&at.q, &(h * &dq));
                value(&Point { q, ..at.clone() })
            }),
        });
        list.push(Group {
            name: "v",
            slope: v.dot(&dv),
            value: Box::new(move |h| {
                let v = &at.v + h * &dv;
                value(&Point { v, ..at.clone() })
            }),
        });
    }
    let all = at.parameters.to_vec();
    let bars = parameters.to_vec();
    for name in [
        "contact.stiffness",
        "contact.dissipation",
        "contact.friction",
        "contact.torsional_friction",
        "contact.rolling_friction",
        "oil.viscosity",
        "oil.roughness",
    ] {
        let i = parameters.names().position(|n| n == name).unwrap();
        let step = 0.1 * all[i];
        list.push(Group {
            name,
            slope: bars[i] * step,
            value: Box::new(move |h| {
                let mut values = at.parameters.to_vec();
                values[i] += h * step;
                let parameters = at.parameters.with_values(&values).unwrap();
                value(&Point {
                    parameters,
                    ..at.clone()
                })
            }),
        });
    }
    groups(list, c)
}

fn jvp(c: f64) -> Outcome {
    let p = point();
    let e = evaluate(&p.parameters, &p.q);
    // Each of the four on the next, and three on the wall.
    let pairs: std::collections::BTreeSet<_> = e
        .contact_points
        .iter()
        .map(|t| (t.first, t.second))
        .collect();
    assert!(pairs.len() >= 6, "{pairs:?}");
    let n = p.v.len();
    let pressed = e.contact_force(&p.v, Dual::User);
    assert!(pressed[n - 2] < 0.0 && pressed[n - 1] > 0.0);
    let dv = wavy(p.v.len(), 3.1, 0.1);
    let tangent = c * e.contact_force_jvp(&p.v, &dv);
    vector_along(
        |h| {
            e.contact_force(&(&p.v + h * &dv), Dual::User)
                .as_slice()
                .to_vec()
        },
        tangent.as_slice(),
    )
}

fn force_vjp(c: f64) -> Outcome {
    let p = point();
    let z = wavy(p.v.len(), 5.1, 1.0);
    all([Dual::User, Dual::Frame].map(|dual| {
        let e = evaluate(&p.parameters, &p.q);
        let b = e.contact_force_vjp(&p.v, &z, dual);
        let value = |p: &Point| {
            let e = evaluate(&p.parameters, &p.q);
            z.dot(&e.contact_force(&p.v, dual))
        };
        check(&value, &p, &b.q, &b.v, &b.parameters, c)
    }))
}

pub fn stepper(parameters: &Parameters, integrator: Integrator) -> Stepper<'_> {
    Stepper {
        system: system(),
        parameters,
        integrator,
        dt: 0.01,
    }
}

/// A whole step from the momenta or velocities `v`, contact solved in the velocity that it moves by.
fn step_vjp(integrator: Integrator, c: f64) -> Outcome {
    let mut p = point();
    let n = p.v.len();
    p.v = stepper(&p.parameters, integrator).conserved(&evaluate(&p.parameters, &p.q), &p.v);
    let (q_bar, y_bar) = (wavy(n, 5.1, 1.0), wavy(n, 6.1, 0.3));
    let input = Input {
        control: DVector::zeros(0),
        hold: Vec::new(),
    };
    let state = |p: &Point| State {
        step: 0,
        q: p.q.clone(),
        y: p.v.clone(),
        held: Vec::new(),
        mode: 0,
    };
    let s = stepper(&p.parameters, integrator);
    let (start, e) = (state(&p), s.linearise(&p.q, 0.0).unwrap());
    let v = s.velocity(&e, &start).unwrap();
    let (next, record) = s.step(&e, &start, &v, &input).unwrap();
    let end = next.q.clone();
    let value = |p: &Point| {
        let s = stepper(&p.parameters, integrator);
        let (start, e) = (state(p), s.linearise(&p.q, 0.0).unwrap());
        let v = s.velocity(&e, &start).unwrap();
        let next = s.step(&e, &start, &v, &input).unwrap().0;
        q_bar.dot(&super::multibody::tree_displacement(
            &system().tree,
            &end,
            &next.q,
        )) + y_bar.dot(&next.y)
    };
    let bar = StateBar {
        q: q_bar.clone(),
        y: y_bar.clone(),
    };
    // Pressed, and by more than rounding.
    let velocities = record.contact_velocities().unwrap();
    let pressed = s.dt * e.contact_force(&velocities.after, Dual::User);
    let moved = e.mass_matrix() * &velocities.before;
    assert!(pressed.norm() > 1e-3 * moved.norm());
    let b = s.linearise_step(&record).unwrap().state_vjp(&bar).unwrap();
    check(&value, &p, &b.state.q, &b.state.y, &b.parameters, c)
}
