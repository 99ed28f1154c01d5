//! Rungs of the equations of motion and of every integrator, on a scene with every kind of joint, a
//! wall, a current, weight, both drags, thrusters, and driven, held and released joints.

use super::multibody::tree_displacement;
use super::tools::{Group, all, groups, vector_along, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::dynamics::{
    Drive, Input, Integrator, Linearisation, Owner, Parameters, Range, State, StateBar, StepBar,
    StepRecord, Stepper, System,
};
use hydrograd::scene::{
    Body, Current, Damping, Drag, DragPart, Edge, Fin, Float, Fluid, Force, Joint, Mimic, Motion,
    Passive, Plane, Scene, Shape, Spring, Tendon, Thruster,
};
use hydrograd::simulate::{Pd, PdAxis};
use hydrograd::{Controls, Rollout, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;
use std::sync::OnceLock;

pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "dynamics::balance::Linearisation::force_jvp" => force_jvp,
        "dynamics::balance::Linearisation::force_vjp" => force_vjp,
        "dynamics::momentum::Linearisation::momentum_vjp" => momentum,
        "dynamics::momentum::Linearisation::mass_vjp" => mass,
        "dynamics::acceleration::Linearisation::inertial_force_vjp" => inertial_force,
        "dynamics::integrator::readout::Stepper::velocity_vjp" => velocity,
        "dynamics::integrator::readout::Stepper::conserved_vjp" => conserved,
        "dynamics::integrator::start::Start::momentum_vjp" => released,
        "dynamics::integrator::euler::Adjoint::vjp" => |c| step(Integrator::MomentumEuler, c),
        "dynamics::integrator::energy::Closure::vjp" => closed,
        "dynamics::integrator::middle_contact::Adjoint::apply_vjp" => |c| limited(Integrator::Midpoint, c),
        "dynamics::integrator::reaction::Reaction::force_vjp" => |c| limited(Integrator::MomentumEuler, c),
        "dynamics::integrator::midpoint::Adjoint::vjp" => |c| step(Integrator::Midpoint, c),
        "dynamics::integrator::runge_kutta::Adjoint::vjp" =>
            |c| step(Integrator::Rk4, c).worst(step(Integrator::Rk2, c)),
        "dynamics::integrator::velocity_euler::Adjoint::vjp" => |c| step(Integrator::VelocityEuler, c),
        "simulate::record::Record::jvp" => record_jvp,
        "simulate::observable::attitude::Attitudes::vjp" => |c| observed("attitudes", c),
        "simulate::observable::angular_momentum::AngularMomentum::vjp" => |c| observed("angular_momentum", c),
        "simulate::observable::acceleration::Accelerations::vjp" => |c| observed_over("accelerations", 1, c),
        "simulate::gains::Reads::apply_vjp" => |c| observed_over("accelerations", 1, c),
        "simulate::observable::velocity::Gyros::vjp" => |c| observed("gyros", c),
        "simulate::observable::velocity::Velocities::vjp" => |c| observed("velocities", c),
    ]
}

/// A scene of every kind.
pub fn scene() -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 998.0,
        current: [0.1, -0.3, 0.0],
    });
    scene.gravity = [0.3, 0.1, -2.0];
    scene.add_wall([0.0, 0.0, -0.6], [0.0, 0.0, 1.0]);
    // Derivatives are exact at any resolution: the coarsest keeps the many evaluations cheap.
    let oval = |x, y, z| Shape::ellipsoid([x, y, z]).faces(20);
    let drag = |part, quadratic_part| Drag {
        part,
        linear: 15.0,
        quadratic_part,
        quadratic: 0.4,
    };
    let axis = [0.3, 0.8, -0.2];
    scene.add(
        Body::new(oval(0.3, 0.2, 0.15))
            .named("hull")
            .density(1100.0)
            .center_of_mass([0.02, -0.01, -0.03])
            .rotated([0.2, -0.3, 0.4])
            .thruster()
            .actuated()
            .drag(drag(DragPart::Tangential, DragPart::Normal)),
    );
    scene.add(
        Body::new(oval(0.15, 0.06, 0.1))
            .named("arm")
            .child_of("hull")
            .density(1300.0)
            .at([0.55, 0.0, 0.05])
            .joint(Joint::Revolute { axis })
            .actuated()
            .passive(Passive {
                stiffness: 4.0,
                rest: 0.2,
                damping: 0.8,
                friction: 0.6,
                friction_speed: 0.4,
                armature: 0.05,
            })
            .drag(drag(DragPart::Total, DragPart::Total)),
    );
    scene.add(
        Body::new(oval(0.08, 0.05, 0.05))
            .named("claw")
            .child_of("arm")
            .density(1500.0)
            .at([0.4, 0.0, 0.05])
            .joint(Joint::Screw {
                axis: [0.1, 0.9, 0.3],
                pitch: 0.2,
            })
            .mimic(Mimic::new("arm").ratio(-0.7).offset(0.3)),
    );
    scene.add(
        Body::new(oval(0.1, 0.07, 0.08))
            .named("tail")
            .child_of("hull")
            .density(900.0)
            .at([-0.6, 0.1, 0.0])
            .shape_at([-0.05, 0.02, 0.0], [0.1, 0.2, 0.0])
            .joint(Joint::Spherical)
            .thruster(),
    );
    scene.add(
        Body::new(oval(0.12, 0.12, 0.05))
            .named("coin")
            .density(2000.0)
            .at([0.1, 0.9, 0.1])
            .joint(Joint::Planar { plane: Plane::Zx })
            .actuated(),
    );
    scene.add(
        Body::dry()
            .named("weight")
            .child_of("coin")
            .mass(0.7)
            .inertia([0.01, 0.02, 0.015])
            .center_of_mass([0.0, 0.05, 0.0])
            .volume(5e-4)
            .center_of_buoyancy([0.02, 0.0, 0.03])
            .joint(Joint::Prismatic { axis })
            .passive(Passive::default().stiffness(3.0).armature(0.2)),
    );
    scene.add(
        Body::dry()
            .named("nut")
            .child_of("weight")
            .mass(0.3)
            .inertia([0.01, 0.02, 0.015])
            .at([0.1, 0.0, 0.0])
            .joint(Joint::Screw { axis, pitch: 0.3 }),
    );
    scene.add(
        Body::new(oval(0.1, 0.05, 0.1))
            .named("fin")
            .child_of("coin")
            .density(1000.0)
            .at([0.3, 0.0, 0.0])
            .joint(Joint::Revolute { axis })
            .driven([Motion::Sine {
                offset: 0.2,
                amplitude: 0.4,
                frequency: 3.0,
                phase: 0.5,
            }]),
    );
    let spring = Spring::new("hull").at([0.1, 0.05, 0.0]);
    let spring = spring.to("coin", [0.0, -0.1, 0.05]).stiffness(40.0);
    scene.add_force(spring.rest_length(0.3).damping(6.0).into());
    let tether = Spring::new("tail").at([0.0, 0.05, 0.02]).damping(3.0);
    scene.add_force(tether.anchored([-0.5, 0.4, 0.7]).stiffness(15.0).into());
    scene.add_force(damping().into());
    let about = Damping::new("tail").at([-0.05, 0.02, 0.03]);
    scene.add_force(about.quadratic([3.0, 5.0, 6.0, 0.1, 0.2, 0.15]).into());
    let jet = Thruster::new("hull").at([-0.2, 0.1, -0.05]);
    let jet = jet.direction([0.9, 0.1, 0.3]).polynomial([0.8, 0.3, 0.05]);
    scene.add_force(
        jet.dead_band(0.4)
            .torque(-0.03)
            .loss(1.5)
            .smoothing(0.5)
            .into(),
    );
    let points = [
        [-4.0, -9.0],
        [-1.0, -2.0],
        [0.5, 0.4],
        [2.0, 3.0],
        [4.0, 11.0],
    ];
    let side = Thruster::new("tail").at([0.0, 0.03, 0.02]);
    let side = side.direction([0.1, -0.4, 0.8]).table(points);
    scene.add_force(
        side.torque(0.02)
            .loss(0.7)
            .dead_band(0.3)
            .smoothing(0.5)
            .into(),
    );
    scene.add(
        Body::dry()
            .named("propeller")
            .child_of("hull")
            .mass(0.2)
            .inertia([0.02, 0.03, 0.04])
            .center_of_mass([0.01, 0.0, 0.02])
            .at([-0.2, -0.1, 0.1])
            .joint(Joint::Revolute { axis }),
    );
    let driven = Thruster::new("hull").at([-0.2, -0.1, 0.1]);
    let driven = driven.direction([0.8, -0.3, 0.1]).polynomial([2.0, 0.9]);
    let driven = driven.rotor("propeller", 0.3).torque(0.04);
    scene.add_force(driven.loss(0.4).dead_band(0.2).smoothing(0.5).into());
    let foam = Float::new("arm").at([0.03, 0.02, 0.06]);
    scene.add_force(foam.volume(8e-4).mass(0.2).into());
    let wing = Fin::new("hull")
        .at([0.1, 0.15, 0.02])
        .chord([1.0, 0.2, 0.1], 0.2);
    let wing = wing
        .normal([-0.1, 0.0, 1.0])
        .area(0.03)
        .lift_slope(4.0)
        .smoothing(0.3);
    scene.add_force(wing.drag(0.02).induced_drag(1.1).into());
    let edge = Edge::new("tail").at([-0.15, 0.02, 0.01]).span(0.2);
    let edge = edge.forward([1.0, 0.1, -0.2]).normal([0.2, 0.0, 1.0]);
    scene.add_force(edge.factor(0.8).smoothing(0.3).into());
    let tendon = Tendon::new([("weight", 0.3), ("propeller", -0.1)]).stiffness(40.0);
    scene.add_force(tendon.damping(2.0).gain(2.0).into());
    let profile = vec![[-0.8, 0.3], [-0.1, 0.9], [0.4, 1.2], [0.9, 0.5]];
    let tide = Motion::Sine {
        offset: 0.4,
        amplitude: 1.1,
        frequency: 2.0,
        phase: 0.6,
    };
    let deep = Current::new([0.12, -0.36, 0.0]).profile(profile);
    scene.add_force(deep.over_time(tide.clone()).into());
    scene.add_force(Current::new([-0.07, 0.21, 0.0]).over_time(tide).into());
    scene
}

/// Of every entry, those across the diagonal unlike.
fn damping() -> Damping {
    let sizes = [5.0, 7.0, 6.0, 0.6, 0.5, 0.7_f64];
    let rows = |phase: f64| -> [[f64; 6]; 6] {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| match i == j {
                true => sizes[i],
                false => 0.15 * (phase + (6 * i + j) as f64).sin() * (sizes[i] * sizes[j]).sqrt(),
            })
        })
    };
    let damping = Damping::new("hull").at([0.1, -0.05, 0.07]);
    damping.linear(rows(0.3)).quadratic(rows(1.4))
}

pub fn simulator() -> &'static Simulator {
    static MADE: OnceLock<Simulator> = OnceLock::new();
    MADE.get_or_init(|| {
        Simulator::new(
            &scene(),
            Settings::default()
                .tolerance(1e-13)
                .integrator(Integrator::default()),
        )
        .expect("the scene is right")
    })
}

/// Everything that the rungs are functions of.
#[derive(Clone)]
pub struct Point {
    pub q: DVector<f64>,
    /// Velocity, or the state's conserved variable.
    pub v: DVector<f64>,
    pub u: DVector<f64>,
    pub parameters: Parameters,
}

/// Cotangents of a point.
struct Bar {
    q: DVector<f64>,
    v: DVector<f64>,
    u: DVector<f64>,
    parameters: Parameters,
}

pub fn system() -> &'static System {
    simulator().system()
}

pub fn point() -> Point {
    let (s, tree) = (system(), &system().tree);
    let n = tree.velocities();
    let mut q = tree.integrate(simulator().start().0, &wavy(n, 0.3, 0.05));
    stepper(&simulator().parameters().clone(), Integrator::default()).place_motions(&mut q, TIME);
    Point {
        q,
        v: wavy(n, 0.8, 0.5),
        u: wavy(s.controls, 1.8, 3.0),
        parameters: simulator().parameters().clone(),
    }
}

/// Length and number of the step in the checks.
pub const DT: f64 = 0.02;
pub const STEP: usize = 3;
/// When that is, s.
pub const TIME: f64 = STEP as f64 * DT;

pub fn stepper(parameters: &Parameters, integrator: Integrator) -> Stepper<'_> {
    Stepper {
        system: system(),
        parameters,
        integrator,
        dt: DT,
    }
}

pub fn evaluate<'a>(parameters: &'a Parameters, q: &DVector<f64>) -> Linearisation<'a> {
    system().linearise(parameters, q, TIME).unwrap()
}

/// Directions of the parameters, one for each kind of them; contact, which this scene has none of, is checked apart.
pub fn directions(at: &Parameters) -> Vec<(&'static str, DVector<f64>)> {
    // Sizes for values that are zero.
    let floors = [
        ("mass", 0.1),
        ("inertia", 1e-3),
        ("drag.linear", 1.0),
        ("drag.quadratic", 0.1),
        ("rest_length", 0.1),
        ("joint.stiffness", 1.0),
        ("joint.rest", 0.1),
        ("joint.damping", 0.1),
        ("joint.friction", 0.1),
        ("joint.armature", 0.01),
        ("center_of_mass", 0.05),
        ("center_of_buoyancy", 0.05),
        ("linear", 0.1),
        ("quadratic", 0.1),
        ("drag", 0.1),
    ];
    let kinds = ["inertia", "center_of_mass", "center_of_buoyancy"];
    let kind = |name: &'static str| {
        let mut kinds = kinds.into_iter();
        kinds.find(|k| name.starts_with(k)).unwrap_or(name)
    };
    let mut out: Vec<(&'static str, DVector<f64>)> = Vec::new();
    for (i, (entry, value)) in at.table().iter().zip(at.to_vec()).enumerate() {
        if entry.owner == Owner::Named("contact".into()) {
            continue;
        }
        let kind = kind(entry.declared.name);
        let floor = floors.iter().find(|(k, _)| *k == kind).map_or(0.0, |f| f.1);
        let k = out.iter().position(|(k, _)| *k == kind).unwrap_or_else(|| {
            out.push((kind, DVector::zeros(at.table().len())));
            out.len() - 1
        });
        let sample = wavy(at.table().len(), 0.7 + k as f64, 1.0)[i];
        out[k].1[i] = 0.1 * sample * value.abs().max(floor);
    }
    out
}

/// A scalar of a point against its cotangents, group by group; with `fine`, every joint and every
/// kind of parameter is a group, so that none hides behind another.
fn check(fine: bool, value: &dyn Fn(&Point) -> f64, at: &Point, bar: &Bar, c: f64) -> Outcome {
    let tree = &system().tree;
    let n = tree.velocities();
    let (dq, dv) = (wavy(n, 2.1, 0.05), wavy(n, 3.1, 0.2));
    let du = wavy(at.u.len(), 4.1, 1.0);
    let mut list = vec![
        Group {
            name: "v",
            slope: bar.v.dot(&dv),
            value: Box::new({
                let dv = dv.clone();
                move |h| {
                    let v = &at.v + h * &dv;
                    value(&Point { v, ..at.clone() })
                }
            }),
        },
        Group {
            name: "u",
            slope: bar.u.dot(&du),
            value: Box::new({
                let du = du.clone();
                move |h| {
                    let u = &at.u + h * &du;
                    value(&Point { u, ..at.clone() })
                }
            }),
        },
    ];
    let links: Vec<Vec<usize>> = if fine {
        tree.links().iter().map(|l| l.v.clone().collect()).collect()
    } else {
        // A step takes the coordinates of driven joints from their motions.
        let free = tree.links().iter().zip(&system().drives);
        let free = free.filter(|(_, drive)| !matches!(drive, Drive::Motion(_)));
        vec![free.flat_map(|(l, _)| l.v.clone()).collect()]
    };
    for link in links {
        let mut d = DVector::zeros(n);
        for i in link {
            d[i] = dq[i];
        }
        list.push(Group {
            name: "q",
            slope: bar.q.dot(&d),
            value: Box::new(move |h| {
                let q = tree.integrate(&at.q, &(h * &d));
                value(&Point { q, ..at.clone() })
            }),
        });
    }
    let mut parameters = directions(&at.parameters);
    if !fine {
        let sum = parameters.iter().map(|(_, d)| d).sum();
        parameters = vec![("parameters", sum)];
    }
    for (name, d) in parameters {
        let bars = DVector::from_vec(bar.parameters.to_vec());
        list.push(Group {
            name,
            slope: bars.dot(&d),
            value: Box::new(move |h| {
                let values = DVector::from_vec(at.parameters.to_vec()) + h * &d;
                let parameters = at.parameters.with_values(values.as_slice()).unwrap();
                value(&Point {
                    parameters,
                    ..at.clone()
                })
            }),
        });
    }
    groups(list, c)
}

fn force_jvp(c: f64) -> Outcome {
    let p = point();
    let e = evaluate(&p.parameters, &p.q);
    let dv = wavy(p.v.len(), 3.1, 0.2);
    let tangent = c * e.force_velocity_jacobian(&p.v, &p.u).unwrap() * &dv;
    vector_along(
        |h| {
            e.force(&(&p.v + h * &dv), &p.u)
                .unwrap()
                .as_slice()
                .to_vec()
        },
        tangent.as_slice(),
    )
}

fn force_vjp(c: f64) -> Outcome {
    let p = point();
    let z = wavy(p.v.len(), 5.1, 1.0);
    let e = evaluate(&p.parameters, &p.q);
    let b = e.force_vjp(&p.v, &p.u, &z).unwrap();
    let value = |p: &Point| z.dot(&evaluate(&p.parameters, &p.q).force(&p.v, &p.u).unwrap());
    let bar = Bar {
        q: b.q,
        v: b.v,
        u: b.control,
        parameters: b.parameters,
    };
    check(true, &value, &p, &bar, c)
}

fn momentum(c: f64) -> Outcome {
    let p = point();
    // Along 5.1 the slope of one joint is all but zero, below what differences resolve.
    let w = wavy(p.v.len(), 5.3, 1.0);
    let b = evaluate(&p.parameters, &p.q)
        .momentum_vjp(&p.v, &w)
        .unwrap();
    let value = |p: &Point| w.dot(&evaluate(&p.parameters, &p.q).momentum(&p.v));
    let bar = Bar {
        q: b.q,
        v: b.v,
        u: b.control,
        parameters: b.parameters,
    };
    check(true, &value, &p, &bar, c)
}

fn mass(c: f64) -> Outcome {
    let p = point();
    let w = wavy(p.v.len(), 5.1, 1.0);
    let b = evaluate(&p.parameters, &p.q).mass_vjp(&p.v, &w).unwrap();
    let value = |p: &Point| w.dot(&evaluate(&p.parameters, &p.q).mass_times(&p.v));
    let bar = Bar {
        q: b.q,
        v: b.v,
        u: b.control,
        parameters: b.parameters,
    };
    check(true, &value, &p, &bar, c)
}

fn inertial_force(c: f64) -> Outcome {
    let p = point();
    let w = wavy(p.v.len(), 5.1, 1.0);
    let e = evaluate(&p.parameters, &p.q);
    let b = e.inertial_force_vjp(&p.v, &p.u, &w).unwrap();
    let value = |p: &Point| {
        w.dot(
            &evaluate(&p.parameters, &p.q)
                .inertial_force(&p.v, &p.u)
                .unwrap(),
        )
    };
    let bar = Bar {
        q: b.q,
        v: b.v,
        u: b.control,
        parameters: b.parameters,
    };
    check(true, &value, &p, &bar, c)
}

pub fn hold(names: &[&str]) -> Vec<bool> {
    let bodies = system().bodies.iter();
    bodies.map(|b| names.contains(&b.name.as_str())).collect()
}

pub fn state(p: &Point, held: &[bool]) -> State {
    State {
        step: STEP,
        q: p.q.clone(),
        y: p.v.clone(),
        held: held.to_vec(),
        mode: 0,
    }
}

/// A point whose `v` is the conserved variable that belongs to the usual velocity.
pub fn state_point(integrator: Integrator) -> Point {
    let p = point();
    let s = stepper(&p.parameters, integrator);
    let y = s.conserved(&evaluate(&p.parameters, &p.q), &p.v);
    Point { v: y, ..p.clone() }
}

/// Of a momentum, and of a velocity, with a held joint.
fn velocity(c: f64) -> Outcome {
    let held = hold(&["arm"]);
    all(
        [Integrator::MomentumEuler, Integrator::VelocityEuler].map(|integrator| {
            let p = state_point(integrator);
            let z = wavy(p.v.len(), 5.1, 1.0);
            let value = |p: &Point| {
                let s = stepper(&p.parameters, integrator);
                z.dot(
                    &s.velocity(&evaluate(&p.parameters, &p.q), &state(p, &held))
                        .unwrap(),
                )
            };
            let (s, e) = (
                stepper(&p.parameters, integrator),
                evaluate(&p.parameters, &p.q),
            );
            let at = state(&p, &held);
            let v = s.velocity(&e, &at).unwrap();
            let mut b = StepBar::zeros(&e);
            s.velocity_vjp(&e, &at, &v, &z, &mut b).unwrap();
            check(true, &value, &p, &bar_of(b), c)
        }),
    )
}

/// Cotangents of a state point; those of v have been pulled back to the state.
fn bar_of(b: StepBar) -> Bar {
    Bar {
        q: b.state.q,
        v: b.state.y,
        u: b.control,
        parameters: b.parameters,
    }
}

fn conserved(c: f64) -> Outcome {
    all(
        [Integrator::MomentumEuler, Integrator::VelocityEuler].map(|integrator| {
            let p = point();
            let z = wavy(p.v.len(), 5.1, 1.0);
            let value = |p: &Point| {
                let s = stepper(&p.parameters, integrator);
                z.dot(&s.conserved(&evaluate(&p.parameters, &p.q), &p.v))
            };
            let (s, e) = (
                stepper(&p.parameters, integrator),
                evaluate(&p.parameters, &p.q),
            );
            let mut b = StepBar::zeros(&e);
            s.conserved_vjp(&e, &p.v, &z, &mut b).unwrap();
            let bar = Bar {
                q: b.state.q,
                v: b.v,
                u: b.control,
                parameters: b.parameters,
            };
            check(true, &value, &p, &bar, c)
        }),
    )
}

/// One step with its readout, from a state whose joints `before` were held, holding `now`.
fn step_with(integrator: Integrator, before: &[&str], now: &[&str], c: f64) -> Outcome {
    let (before, now) = (hold(before), hold(now));
    let p = state_point(integrator);
    let n = p.v.len();
    let (q_bar, y_bar) = (wavy(n, 5.1, 1.0), wavy(n, 6.1, 1.0));
    let make = |p: &Point| {
        let s = stepper(&p.parameters, integrator);
        let e = evaluate(&p.parameters, &p.q);
        let at = state(p, &before);
        let v = s.velocity(&e, &at).unwrap();
        let input = Input {
            control: p.u.clone(),
            hold: now.clone(),
        };
        s.step(&e, &at, &v, &input).unwrap()
    };
    let base = make(&p);
    let tree = &system().tree;
    let value = |p: &Point| {
        let next = make(p).0;
        q_bar.dot(&tree_displacement(tree, &base.0.q, &next.q)) + y_bar.dot(&next.y)
    };
    let s = stepper(&p.parameters, integrator);
    let next_bar = StateBar {
        q: q_bar.clone(),
        y: y_bar.clone(),
    };
    let b = s.linearise_step(&base.1).unwrap().state_vjp(&next_bar);
    let b = b.unwrap();
    check(false, &value, &p, &bar_of(b), c)
}

/// The same scene in a current that all may drift along with, with no joint that is driven, and one that just presses on its limit.
pub fn still() -> &'static Simulator {
    static MADE: OnceLock<Simulator> = OnceLock::new();
    MADE.get_or_init(|| {
        let mut scene = scene();
        scene.fluid.current = [0.2, 0.0, 0.0];
        // It isn't level, so it flows through no water that changes with depth.
        for force in &mut scene.forces {
            if let Force::Current(current) = force {
                current.profile.clear();
            }
        }
        for body in &mut scene.bodies {
            body.motion = None;
        }
        let at = point().q[7];
        let arm = scene.bodies.iter_mut().find(|b| b.name == "arm");
        let arm = arm.expect("an arm");
        arm.limits = Some([at + 1e-3, at + 1.0]);
        arm.limit_stiffness = Some(4.0);
        let settings = Settings::default()
            .tolerance(1e-13)
            .integrator(Integrator::default());
        let settings = settings.integrator(Integrator::EnergyEuler);
        Simulator::new(&scene, settings).expect("the scene is right")
    })
}

/// Steps of [`still`].
pub fn still_stepper(parameters: &Parameters, integrator: Integrator) -> Stepper<'_> {
    Stepper {
        system: still().system(),
        parameters,
        integrator,
        dt: DT,
    }
}

/// The state that it starts from, and the step there.
pub fn still_point(integrator: Integrator) -> Point {
    let parameters = still().parameters().clone();
    let at = point();
    let s = still_stepper(&parameters, integrator);
    let e = s.system.linearise(&parameters, &at.q, TIME).unwrap();
    let v = s.conserved(&e, &at.v);
    drop(e);
    Point {
        v,
        parameters,
        ..at
    }
}

pub fn still_step(p: &Point, integrator: Integrator) -> (State, StepRecord) {
    let s = still_stepper(&p.parameters, integrator);
    let e = s.system.linearise(&p.parameters, &p.q, TIME).unwrap();
    let at = state(p, &[]);
    let v = s.velocity(&e, &at).unwrap();
    let input = Input {
        control: p.u.clone(),
        hold: Vec::new(),
    };
    s.step(&e, &at, &v, &input).unwrap()
}

/// A step in which a joint with friction presses on its limit, of bodies that drag.
fn limited(integrator: Integrator, c: f64) -> Outcome {
    let p = still_point(integrator);
    let n = p.v.len();
    let (q_bar, y_bar) = (wavy(n, 5.1, 1.0), wavy(n, 6.1, 1.0));
    let base = still_step(&p, integrator);
    let velocities = base.1.contact_velocities().unwrap();
    let pressed = (&velocities.after - &velocities.before).norm();
    assert!(pressed > 1e-3, "{pressed:.1e}");
    let tree = &still().system().tree;
    let value = |p: &Point| {
        let next = still_step(p, integrator).0;
        q_bar.dot(&tree_displacement(tree, &base.0.q, &next.q)) + y_bar.dot(&next.y)
    };
    let next_bar = StateBar {
        q: q_bar.clone(),
        y: y_bar.clone(),
    };
    let s = still_stepper(&p.parameters, integrator);
    let b = s.linearise_step(&base.1).unwrap().state_vjp(&next_bar);
    check(false, &value, &p, &bar_of(b.unwrap()), c)
}

/// A step whose energy is closed, from where all move and something is pressed, which is what the correction consists of.
fn closed(c: f64) -> Outcome {
    let system = still().system();
    let mut p = point();
    p.parameters = still().parameters().clone();
    let n = p.v.len();
    fn at(parameters: &Parameters, integrator: Integrator) -> Stepper<'_> {
        Stepper {
            system: still().system(),
            parameters,
            integrator,
            dt: DT,
        }
    }
    let state = |p: &Point| State {
        step: STEP,
        q: p.q.clone(),
        y: p.v.clone(),
        held: Vec::new(),
        mode: 0,
    };
    p.v = at(&p.parameters, Integrator::EnergyEuler)
        .conserved(&system.linearise(&p.parameters, &p.q, TIME).unwrap(), &p.v);
    let make = |p: &Point, integrator| {
        let s = at(&p.parameters, integrator);
        let e = system.linearise(&p.parameters, &p.q, TIME).unwrap();
        let v = s.velocity(&e, &state(p)).unwrap();
        let input = Input {
            control: p.u.clone(),
            hold: Vec::new(),
        };
        s.step(&e, &state(p), &v, &input).unwrap()
    };
    let base = make(&p, Integrator::EnergyEuler);
    let open = make(&p, Integrator::MomentumEuler);
    let moved = (&base.0.y - &open.0.y).norm() / base.0.y.norm();
    let velocities = base.1.contact_velocities().unwrap();
    let pressed = (&velocities.after - &velocities.before).norm();
    assert!(moved > 1e-6 && pressed > 1e-3, "{moved:.1e}, {pressed:.1e}");
    // Only what the correction adds, which is small beside the step.
    let y_bar = wavy(n, 6.2, 1.0);
    let value = |p: &Point| {
        let [closed, open] =
            [Integrator::EnergyEuler, Integrator::MomentumEuler].map(|i| make(p, i).0.y);
        y_bar.dot(&(closed - open))
    };
    let bar = |integrator| {
        let (_, record) = make(&p, integrator);
        let s = at(&p.parameters, integrator);
        let bar = StateBar {
            q: DVector::zeros(n),
            y: y_bar.clone(),
        };
        let step = s.linearise_step(&record).unwrap();
        bar_of(step.state_vjp(&bar).unwrap())
    };
    let [closed, open] = [Integrator::EnergyEuler, Integrator::MomentumEuler].map(bar);
    let mut parameters = closed.parameters;
    parameters.add_scaled(-1.0, &open.parameters);
    let bar = Bar {
        q: closed.q - open.q,
        v: closed.v - open.v,
        u: closed.u - open.u,
        parameters,
    };
    // By joint and parameter it is too small for differences.
    check(false, &value, &p, &bar, c)
}

/// Free throughout, and with one joint held anew while another stays held.
fn step(integrator: Integrator, c: f64) -> Outcome {
    step_with(integrator, &[], &[], c).worst(step_with(integrator, &["arm"], &["arm", "tail"], c))
}

/// Joints that come free take their momentum from the velocity.
fn released(c: f64) -> Outcome {
    all(INTEGRATORS.map(|integrator| step_with(integrator, &["arm", "coin"], &["tail"], c)))
}

pub const INTEGRATORS: [Integrator; 6] = [
    Integrator::MomentumEuler,
    Integrator::EnergyEuler,
    Integrator::Midpoint,
    Integrator::Rk2,
    Integrator::Rk4,
    Integrator::VelocityEuler,
];

/// A vector without the entries of joints with a given motion, which no change of a state moves.
pub fn unmoved(mut d: DVector<f64>) -> DVector<f64> {
    for (link, drive) in system().tree.links().iter().zip(&system().drives) {
        if matches!(drive, Drive::Motion(_)) {
            d.rows_mut(link.v.start, link.v.len()).fill(0.0);
        }
    }
    d
}

/// The usual point, driven joints with the velocity of their motions in the simulator's step number [`STEP`].
pub fn moving_point() -> Point {
    let mut p = point();
    let time = simulator().time_step() * STEP as f64;
    for (link, drive) in system().tree.links().iter().zip(&system().drives) {
        if let Drive::Motion(motions) = drive {
            for (i, motion) in link.v.clone().zip(motions) {
                p.v[i] = motion.rate(time);
            }
        }
    }
    p
}

/// The rollout of a simulator from a point's coordinates and velocity, with its parameters and these controls.
pub fn run(mut simulator: Simulator, p: &Point, controls: &DMatrix<f64>) -> Rollout {
    let mut parameters = p.parameters.clone();
    for entry in p.parameters.table() {
        if matches!(entry.declared.range, Range::Zero(_)) {
            parameters.set(&entry.name, 0.0).unwrap();
        }
    }
    simulator.set_parameters(parameters).unwrap();
    let (q, v) = left_to_motions(&p.q, &p.v);
    let start = simulator.state(STEP, &q, &v).unwrap();
    let controls = Controls::from_matrix(&simulator, controls.clone()).unwrap();
    let rollout = simulator.rollout_from(&start, &controls, |_| ControlFlow::Continue(()));
    rollout.unwrap()
}

/// A moving point without parameters of zero: differences go to both sides, and they would become negative.
pub fn observed_point() -> Point {
    let mut p = moving_point();
    let entries = p.parameters.table().iter().zip(p.parameters.to_vec());
    let zero = entries.filter(|(e, x)| *x == 0.0 && matches!(e.declared.range, Range::NotNegative));
    let names: Vec<String> = zero.map(|(e, _)| e.name.clone()).collect();
    for name in &names {
        p.parameters.set(name, 0.1).unwrap();
    }
    p
}

/// An observable, read at a state by itself: through its momentum, which the state carries, and directly.
fn observed(name: &str, c: f64) -> Outcome {
    observed_over(name, 0, c)
}

/// The same of a rollout of so many steps.
fn observed_over(name: &str, steps: usize, c: f64) -> Outcome {
    let run = |p: &Point| run(simulator().clone(), p, &DMatrix::zeros(p.u.len(), steps));
    let p = observed_point();
    let base = run(&p);
    let bar = wavy(base.observe(name).unwrap().nrows(), 5.1, 1.0);
    let mut seed = base.zero_cotangents();
    let mut columns = DMatrix::zeros(bar.len(), steps + 1);
    columns.set_column(0, &bar);
    seed.observables.insert(name.into(), columns);
    let g = base.vjp(&seed).unwrap();
    let value = |p: &Point| run(p).observe(name).unwrap().column(0).dot(&bar);
    let bar = Bar {
        q: g.initial.q,
        v: g.initial.v,
        u: DVector::zeros(p.u.len()),
        parameters: g.parameters,
    };
    check(false, &value, &p, &bar, c)
}

/// Coordinates and velocities with those of driven joints left to their motions.
pub fn left_to_motions(q: &DVector<f64>, v: &DVector<f64>) -> (DVector<f64>, DVector<f64>) {
    let (mut q, mut v) = (q.clone(), v.clone());
    for (drive, link) in system().drives.iter().zip(system().tree.links()) {
        if matches!(drive, Drive::Motion(_)) {
            link.q.clone().for_each(|i| q[i] = 0.0);
        }
        if !matches!(drive, Drive::Free) {
            link.v.clone().for_each(|i| v[i] = 0.0);
        }
    }
    (q, v)
}

/// Feedback from the last two coordinates to the first two controls.
pub fn feedback() -> Pd {
    let tree = &system().tree;
    let (nq, nv, nu) = (tree.coordinates(), tree.velocities(), system().controls);
    let axes = (0..nu.min(2)).map(|k| PdAxis {
        control: k,
        q: nq - 1 - k,
        v: nv - 1 - k,
        target: 0.3,
        stiffness: 2.0,
        damping: 0.7,
    });
    Pd {
        controls: nu,
        velocities: nv,
        axes: axes.collect(),
    }
}

/// The tangent of a simulator's step, in q and v, with a controller.
fn record_jvp(c: f64) -> Outcome {
    let mut simulator = simulator().clone();
    let tree = &system().tree;
    let (nv, nu) = (tree.velocities(), system().controls);
    simulator.set_policy(Box::new(feedback()));
    let p = moving_point();
    let u = wavy(nu, 1.8, 3.0);
    let make = |q: &DVector<f64>, v: &DVector<f64>, u: &DVector<f64>| {
        let (q, v) = left_to_motions(q, v);
        let start = simulator.state(STEP, &q, &v).unwrap();
        let (_, record) = simulator.step(&start, u).unwrap();
        record
    };
    // Driven velocities are what they are read out as: others would be another state.
    let start = make(&p.q, &p.v, &u);
    let start = &start.rollout().samples()[0];
    let p = Point {
        q: start.q.clone(),
        v: start.v.clone(),
        ..p
    };
    let base = make(&p.q, &p.v, &u);
    let (dq, dv) = (unmoved(wavy(nv, 2.1, 0.05)), unmoved(wavy(nv, 3.1, 0.2)));
    let du = wavy(nu, 4.1, 1.0);
    let along = DVector::from_iterator(2 * nv, dq.iter().chain(dv.iter()).copied());
    let tangent = base.jvp(&along, &du).unwrap();
    let mut bar = base.zero_cotangents();
    bar.q.set_column(1, &wavy(nv, 5.1, 1.0));
    bar.v.set_column(1, &wavy(nv, 6.1, 1.0));
    let back = base.vjp(&bar).unwrap();
    let forth =
        bar.q.column(1).dot(&tangent.rows(0, nv)) + bar.v.column(1).dot(&tangent.rows(nv, nv));
    let back = back.initial.q.dot(&dq) + back.initial.v.dot(&dv) + back.controls.column(0).dot(&du);
    assert!(
        (forth - back).abs() <= 1e-9 * forth.abs(),
        "{forth} is not {back}"
    );
    let end = base.rollout().samples()[1].q.clone();
    let value = |h: f64| {
        let q = tree.integrate(&p.q, &(h * &dq));
        let record = make(&q, &(&p.v + h * &dv), &(&u + h * &du));
        let next = &record.rollout().samples()[1];
        let moved = tree_displacement(tree, &end, &next.q);
        moved.iter().chain(next.v.iter()).copied().collect()
    };
    vector_along(value, (c * tangent).as_slice())
}
