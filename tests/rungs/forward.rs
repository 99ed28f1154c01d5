//! Tangents: of the tree's maps, of every integrator's step, and of whole rollouts, along several directions at once.

use super::dynamics::{
    self, DT, INTEGRATORS, Point, STEP, directions, evaluate, feedback, hold, observed_point, run,
    simulator, state, state_point, stepper, still, system, unmoved,
};
use super::multibody::{start, tree, tree_displacement};
use super::tools::{all, vector_along, wavy};
use super::{contact, multibody};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::adjoint::lie::{Vec6, six, unskew};
use hydrograd::dynamics::{
    Drive, Input, InputTangents, Integrator, LinearisedStep, Parameters, StateTangents, Stepper,
};
use nalgebra::{DMatrix, DVector};

pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "multibody::charts::Tree::integrate_jvp" => integrate,
        "multibody::charts::Tree::chart_rate_jvp" => chart_rate,
        "multibody::tree::Tree::twists_jvp" => twists,
        "dynamics::integrator::readout::Stepper::velocity_jvp" => velocity,
        "dynamics::integrator::readout::Stepper::conserved_jvp" => conserved,
        "dynamics::integrator::start::Start::momentum_jvp" =>
            |c| all(INTEGRATORS.map(|i| step(i, &["arm", "coin"], &["tail"], c))),
        "dynamics::integrator::euler::Adjoint::jvp" => |c| both(Integrator::MomentumEuler, c),
        "dynamics::integrator::energy::Closure::jvp" => closed,
        "dynamics::integrator::midpoint::Adjoint::jvp" => |c| both(Integrator::Midpoint, c),
        "dynamics::integrator::runge_kutta::Adjoint::jvp" =>
            |c| both(Integrator::Rk4, c).worst(both(Integrator::Rk2, c)),
        "dynamics::integrator::velocity_euler::Adjoint::jvp" => |c| both(Integrator::VelocityEuler, c),
        "dynamics::integrator::end_contact::Adjoint::apply_jvp" =>
            |c| all(contact::INTEGRATORS.map(|i| pressed(i, c))),
        "dynamics::integrator::middle_contact::Adjoint::apply_jvp" => |c| limited(Integrator::Midpoint, c),
        "dynamics::integrator::reaction::Reaction::force_jvp" => |c| limited(Integrator::MomentumEuler, c),
        "simulate::tangents::Rollout::jvp" => |c| all(INTEGRATORS.map(|i| rollout(i, &["positions", "rotations"], c))),
        "simulate::observable::pose::Positions::jvp" => |c| rollout(Integrator::Rk2, &["positions"], c),
        "simulate::observable::pose::Rotations::jvp" => |c| rollout(Integrator::Rk2, &["rotations"], c),
        "simulate::observable::attitude::Attitudes::jvp" => |c| rollout(Integrator::Rk2, &["attitudes"], c),
        "simulate::observable::acceleration::Accelerations::jvp" => |c| rollout(Integrator::Rk2, &["accelerations"], c),
        "simulate::observable::velocity::Gyros::jvp" => |c| rollout(Integrator::Rk2, &["gyros"], c),
        "simulate::observable::velocity::Velocities::jvp" => |c| rollout(Integrator::Rk2, &["velocities"], c),
        "simulate::observable::angular_momentum::AngularMomentum::jvp" =>
            |c| rollout(Integrator::Rk2, &["angular_momentum"], c),
    ]
}

fn column(x: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(x.len(), 1, x.as_slice())
}

/// Vectors side by side.
fn beside(parts: &[DVector<f64>]) -> DMatrix<f64> {
    DMatrix::from_columns(parts)
}

fn joined(parts: &[&DVector<f64>]) -> Vec<f64> {
    parts.iter().flat_map(|p| p.iter().copied()).collect()
}

fn integrate(c: f64) -> Outcome {
    let tree = tree();
    let n = tree.velocities();
    let (q, xi) = (start(&tree), wavy(n, 1.1, 0.7));
    let end = tree.integrate(&q, &xi);
    let (dq, dxi) = (wavy(n, 2.0, 0.3), wavy(n, 3.3, 0.3));
    let tangent = tree.integrate_jvp(&xi, &column(&dq), &column(&dxi));
    vector_along(
        |h| {
            let from = tree.integrate(&q, &(h * &dq));
            let next = tree.integrate(&from, &(&xi + h * &dxi));
            joined(&[&tree_displacement(&tree, &end, &next)])
        },
        (c * tangent).as_slice(),
    )
}

fn chart_rate(c: f64) -> Outcome {
    let tree = tree();
    let n = tree.velocities();
    let (xi, v) = (wavy(n, 1.1, 0.7), wavy(n, 0.4, 1.0));
    let (dxi, dv) = (wavy(n, 2.0, 0.3), wavy(n, 3.3, 0.3));
    let tangent = tree.chart_rate_jvp(&xi, &v, &column(&dxi), &column(&dv));
    vector_along(
        |h| joined(&[&tree.chart_rate(&(&xi + h * &dxi), &(&v + h * &dv))]),
        (c * tangent).as_slice(),
    )
}

/// Displacements and twists of all bodies.
fn twists(c: f64) -> Outcome {
    let tree = multibody::tree();
    let n = tree.velocities();
    let (q, v) = (start(&tree), wavy(n, 0.4, 1.0));
    let (dq, dv) = (wavy(n, 2.0, 0.3), wavy(n, 3.3, 0.3));
    let base = tree.kinematics(&q);
    let found = tree.twists_jvp(&base, &v, &dq, &dv);
    let list = |fields: [Vec<Vec6>; 2]| -> Vec<f64> {
        let all = fields.concat();
        all.iter().flat_map(|x| x.iter().copied()).collect()
    };
    let tangent: Vec<f64> = list(found).iter().map(|x| c * x).collect();
    let value = |h: f64| {
        let at = tree.kinematics(&tree.integrate(&q, &(h * &dq)));
        let moved = at.poses.iter().zip(&base.poses).map(|(pose, base)| {
            let step = pose.compose(&base.inverse());
            six(&step.translation, &(0.5 * unskew(&step.rotation)))
        });
        list([moved.collect(), tree.twists(&at, &(&v + h * &dv))])
    };
    vector_along(value, &tangent)
}

/// A direction of everything that a step depends on.
struct Along {
    q: DVector<f64>,
    y: DVector<f64>,
    u: DVector<f64>,
    parameters: DVector<f64>,
}

impl Along {
    fn new(at: &Point, phase: f64) -> Self {
        let n = at.v.len();
        let sum: DVector<f64> = directions(&at.parameters).iter().map(|(_, d)| d).sum();
        Self {
            q: unmoved(wavy(n, 2.1 + phase, 0.05)),
            y: wavy(n, 3.1 + phase, 0.2),
            u: wavy(at.u.len(), 4.1 + phase, 1.0),
            parameters: sum * (1.0 - 0.3 * phase),
        }
    }

    fn at(&self, p: &Point, h: f64) -> Point {
        let values = DVector::from_vec(p.parameters.to_vec()) + h * &self.parameters;
        Point {
            q: system().tree.integrate(&p.q, &(h * &self.q)),
            v: &p.v + h * &self.y,
            u: &p.u + h * &self.u,
            parameters: p.parameters.with_values(values.as_slice()).unwrap(),
        }
    }
}

fn tangents(along: &[Along]) -> (StateTangents, InputTangents) {
    let of = |part: fn(&Along) -> &DVector<f64>| {
        beside(&along.iter().map(|a| part(a).clone()).collect::<Vec<_>>())
    };
    (
        StateTangents {
            q: of(|a| &a.q),
            y: of(|a| &a.y),
        },
        InputTangents {
            control: of(|a| &a.u),
            parameters: of(|a| &a.parameters),
        },
    )
}

/// The tangent of a step, the velocity being read out at its state.
fn through(step: &LinearisedStep, along: &[Along]) -> StateTangents {
    let (state, inputs) = tangents(along);
    let v = step.velocity_jvp(&state, &inputs).unwrap();
    step.jvp(&state, &v, &inputs).unwrap()
}

fn velocity(c: f64) -> Outcome {
    let held = hold(&["arm"]);
    all(
        [Integrator::MomentumEuler, Integrator::VelocityEuler].map(|integrator| {
            let p = state_point(integrator);
            let along = Along::new(&p, 0.0);
            let read = |p: &Point| {
                let s = stepper(&p.parameters, integrator);
                let e = evaluate(&p.parameters, &p.q);
                s.velocity(&e, &state(p, &held)).unwrap()
            };
            let s = stepper(&p.parameters, integrator);
            let e = evaluate(&p.parameters, &p.q);
            let (at, inputs) = tangents(std::slice::from_ref(&along));
            let momentum = s.momentum_slopes(&e, &read(&p), true).unwrap();
            let found = s.velocity_jvp(&e, &state(&p, &held), momentum.as_ref(), &at, &inputs);
            vector_along(
                |h| joined(&[&read(&along.at(&p, h))]),
                (c * found.unwrap()).as_slice(),
            )
        }),
    )
}

fn conserved(c: f64) -> Outcome {
    all(
        [Integrator::MomentumEuler, Integrator::VelocityEuler].map(|integrator| {
            let p = dynamics::point();
            let along = Along::new(&p, 0.0);
            let value = |p: &Point| {
                let s = stepper(&p.parameters, integrator);
                s.conserved(&evaluate(&p.parameters, &p.q), &p.v)
            };
            let s = stepper(&p.parameters, integrator);
            let e = evaluate(&p.parameters, &p.q);
            let (at, inputs) = tangents(std::slice::from_ref(&along));
            let momentum = s.momentum_slopes(&e, &p.v, true).unwrap();
            let found = s.conserved_jvp(&e, &p.v, momentum.as_ref(), &at.q, &at.y, &inputs);
            vector_along(
                |h| joined(&[&value(&along.at(&p, h))]),
                (c * found).as_slice(),
            )
        }),
    )
}

/// Free throughout, and with one joint held anew while another stays held.
fn both(integrator: Integrator, c: f64) -> Outcome {
    step(integrator, &[], &[], c).worst(step(integrator, &["arm"], &["arm", "tail"], c))
}

/// One step with its readout, from a state whose joints `before` were held, holding `now`, along two directions.
fn step(integrator: Integrator, before: &[&str], now: &[&str], c: f64) -> Outcome {
    let (before, now) = (hold(before), hold(now));
    let p = state_point(integrator);
    let tree = &system().tree;
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
    let (base, record) = make(&p);
    let along = [Along::new(&p, 0.0), Along::new(&p, 0.5)];
    let s = stepper(&p.parameters, integrator);
    let found = through(&s.linearise_step(&record).unwrap(), &along);
    all(along.iter().enumerate().map(|(k, along)| {
        let value = |h: f64| {
            let next = make(&along.at(&p, h)).0;
            joined(&[&tree_displacement(tree, &base.q, &next.q), &next.y])
        };
        let [q, y] = [&found.q, &found.y].map(|m| c * m.column(k));
        vector_along(value, &joined(&[&q, &y]))
    }))
}

/// A step in which a joint with friction presses on its limit, of bodies that drag.
fn limited(integrator: Integrator, c: f64) -> Outcome {
    let p = dynamics::still_point(integrator);
    let (base, record) = dynamics::still_step(&p, integrator);
    let along = Along::new(&p, 0.0);
    let s = dynamics::still_stepper(&p.parameters, integrator);
    let step = s.linearise_step(&record).unwrap();
    let found = through(&step, std::slice::from_ref(&along));
    let tree = &still().system().tree;
    let value = |h: f64| {
        let next = dynamics::still_step(&along.at(&p, h), integrator).0;
        joined(&[&tree_displacement(tree, &base.q, &next.q), &next.y])
    };
    let [q, y] = [&found.q, &found.y].map(|m| c * m.column(0));
    vector_along(value, &joined(&[&q, &y]))
}

/// What the closure of the energy adds to a step's momenta, which is small beside it.
fn closed(c: f64) -> Outcome {
    fn at(parameters: &Parameters, integrator: Integrator) -> Stepper<'_> {
        Stepper {
            system: still().system(),
            parameters,
            integrator,
            dt: DT,
        }
    }
    let system = still().system();
    let mut p = dynamics::point();
    p.parameters = still().parameters().clone();
    let s = at(&p.parameters, Integrator::EnergyEuler);
    p.v = s.conserved(
        &system
            .linearise(&p.parameters, &p.q, dynamics::TIME)
            .unwrap(),
        &p.v,
    );
    let make = |p: &Point, integrator| {
        let s = at(&p.parameters, integrator);
        let e = system
            .linearise(&p.parameters, &p.q, dynamics::TIME)
            .unwrap();
        let state = state(p, &[]);
        let v = s.velocity(&e, &state).unwrap();
        let input = Input {
            control: p.u.clone(),
            hold: Vec::new(),
        };
        s.step(&e, &state, &v, &input).unwrap()
    };
    let along = Along::new(&p, 0.0);
    let pair = [Integrator::EnergyEuler, Integrator::MomentumEuler];
    let [closed, open] = pair.map(|integrator| {
        let record = make(&p, integrator).1;
        let s = at(&p.parameters, integrator);
        let step = s.linearise_step(&record).unwrap();
        through(&step, std::slice::from_ref(&along)).y
    });
    let value = |h: f64| {
        let [closed, open] = pair.map(|i| make(&along.at(&p, h), i).0.y);
        joined(&[&(closed - open)])
    };
    vector_along(value, (c * (closed - open)).as_slice())
}

/// A step in which everything is pressed, with the parameters of contact.
fn pressed(integrator: Integrator, c: f64) -> Outcome {
    let mut p = contact::point();
    let (n, tree) = (p.v.len(), &contact::system().tree);
    let e = contact::evaluate(&p.parameters, &p.q);
    p.v = contact::stepper(&p.parameters, integrator).conserved(&e, &p.v);
    let make = |p: &contact::Point| {
        let s = contact::stepper(&p.parameters, integrator);
        let e = s.linearise(&p.q, 0.0).unwrap();
        let at = state(
            &Point {
                q: p.q.clone(),
                v: p.v.clone(),
                u: DVector::zeros(0),
                parameters: p.parameters.clone(),
            },
            &[],
        );
        let v = s.velocity(&e, &at).unwrap();
        let input = Input {
            control: DVector::zeros(0),
            hold: Vec::new(),
        };
        s.step(&e, &at, &v, &input).unwrap()
    };
    let (base, record) = make(&p);
    let mut parameters = DVector::zeros(p.parameters.table().len());
    for (i, (name, value)) in p.parameters.names().zip(p.parameters.to_vec()).enumerate() {
        if name.starts_with("contact") || name.starts_with("oil") {
            parameters[i] = 0.05 * value * wavy(3, 0.2 + i as f64, 1.0)[0];
        }
    }
    let along = Along {
        q: wavy(n, 2.1, 0.004),
        y: wavy(n, 3.1, 0.02),
        u: DVector::zeros(0),
        parameters,
    };
    let s = contact::stepper(&p.parameters, integrator);
    let found = through(
        &s.linearise_step(&record).unwrap(),
        std::slice::from_ref(&along),
    );
    let value = |h: f64| {
        let values = DVector::from_vec(p.parameters.to_vec()) + h * &along.parameters;
        let next = make(&contact::Point {
            q: tree.integrate(&p.q, &(h * &along.q)),
            v: &p.v + h * &along.y,
            parameters: p.parameters.with_values(values.as_slice()).unwrap(),
        });
        joined(&[&tree_displacement(tree, &base.q, &next.0.q), &next.0.y])
    };
    let [q, y] = [&found.q, &found.y].map(|m| c * m.column(0));
    vector_along(value, &joined(&[&q, &y]))
}

/// Two steps with feedback, along a displacement of the start, controls, parameters and gains; with these observables at all states.
fn rollout(integrator: Integrator, observables: &[&str], c: f64) -> Outcome {
    let mut made = simulator().clone();
    let settings = hydrograd::Settings::default().tolerance(1e-13);
    if integrator != Integrator::default() {
        made = hydrograd::Simulator::new(&dynamics::scene(), settings.integrator(integrator))
            .expect("the scene is right");
    }
    made.set_policy(Box::new(feedback()));
    let p = observed_point();
    let tree = &system().tree;
    let (n, nu) = (p.v.len(), p.u.len());
    let controls = beside(&[wavy(nu, 1.8, 3.0), wavy(nu, 2.8, 3.0)]);
    let base = run(made.clone(), &p, &controls);
    let mut along = base.zero_displacement();
    let free = |mut d: DVector<f64>| {
        for (link, drive) in tree.links().iter().zip(&system().drives) {
            if !matches!(drive, Drive::Free) {
                d.rows_mut(link.v.start, link.v.len()).fill(0.0);
            }
        }
        d
    };
    along.initial.q = unmoved(wavy(n, 2.1, 0.05));
    along.initial.v = free(wavy(n, 3.1, 0.2));
    along.controls = beside(&[wavy(nu, 4.1, 1.0), wavy(nu, 4.2, 1.0)]);
    let sum: DVector<f64> = directions(&p.parameters).iter().map(|(_, d)| d).sum();
    let mut changed = p.parameters.with_values(sum.as_slice()).unwrap();
    for entry in p.parameters.table() {
        if matches!(entry.declared.range, hydrograd::dynamics::Range::Zero(_)) {
            changed.set(&entry.name, 0.0).unwrap();
        }
    }
    along.parameters = changed;
    // No vectors in space: of a length that isn't theirs.
    let gains = along.gains.len();
    along.gains = wavy(3 * gains + 1, 5.1, 0.2).as_slice()[..gains].to_vec();
    let found = base.jvp(std::slice::from_ref(&along), observables).unwrap();
    let mut tangent: Vec<f64> = found[0].q.iter().chain(&found[0].v).copied().collect();
    if observables.len() == 1 {
        tangent.clear();
    }
    for name in observables {
        tangent.extend(found[0].observables[*name].iter());
    }
    let tangent: Vec<f64> = tangent.iter().map(|x| c * x).collect();
    let gains = made.policy().gains();
    let value = |h: f64| {
        let mut moved = made.clone();
        let gains = gains.iter().zip(&along.gains).map(|(g, d)| g + h * d);
        let gains: Vec<f64> = gains.collect();
        moved.set_policy(made.policy().with_gains(&gains).unwrap());
        let values = DVector::from_vec(p.parameters.to_vec())
            + h * DVector::from_column_slice(along.parameters.as_slice());
        let at = Point {
            q: tree.integrate(&p.q, &(h * &along.initial.q)),
            v: &p.v + h * &along.initial.v,
            u: p.u.clone(),
            parameters: p.parameters.with_values(values.as_slice()).unwrap(),
        };
        let made = run(moved, &at, &(&controls + h * &along.controls));
        let mut out = Vec::new();
        if observables.len() > 1 {
            for (at, from) in made.samples().iter().zip(base.samples()) {
                out.extend(tree_displacement(tree, &from.q, &at.q).iter());
            }
            out.extend(made.v().iter());
        }
        for name in observables {
            if *name != "rotations" {
                out.extend(made.observe(name).unwrap().iter());
                continue;
            }
            for (at, from) in made.samples().iter().zip(base.samples()) {
                for (a, b) in at.poses.iter().zip(&from.poses) {
                    let step = a.rotation * b.rotation.transpose();
                    out.extend((0.5 * unskew(&step)).iter());
                }
            }
        }
        out
    };
    assert_eq!(base.states()[0].step, STEP);
    vector_along(value, &tangent)
}
