//! Rungs of the controllers, of controls through knots, and of a whole rollout.

use super::tools::{Group, all, groups, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::scene::{Body, Controller, Fluid, Joint, Scene, Shape};
use hydrograd::simulate::{
    Constant, Knots, Observation, OpenLoop, Pd, PdAxis, Playback, Policy, PushThenLock, SpeedStage,
    SpeedStages, Wave, WaveJoint,
};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector};

pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "policy::OpenLoop::act_vjp" => open_loop,
        "policy::Constant::act_vjp" => |c| act(&Constant { control: vec![0.3, -0.7] }, c),
        "policy::pd::Pd::act_vjp" => |c| act(&pd(), c),
        "policy::push::PushThenLock::act_vjp" => push_then_lock,
        "policy::stages::SpeedStages::act_vjp" => speed_stages,
        "policy::playback::Playback::act_vjp" => |c| act(&playback(), c),
        "policy::wave::Wave::act_vjp" => |c| act(&wave(), c),
        "simulate::knots::Knots::controls_vjp" => knots,
        "simulate::rollout::Rollout::vjp" => rollout,
    ]
}

fn pd() -> Pd {
    let axis = |control: usize, q: usize, v: usize| PdAxis {
        control,
        q,
        v,
        target: 0.4 + q as f64,
        stiffness: 2.0 + v as f64,
        damping: 0.3 + 0.1 * v as f64,
    };
    Pd {
        controls: 2,
        velocities: 3,
        axes: vec![axis(1, 0, 0), axis(0, 2, 2)],
    }
}

/// Two joints while the wave still rises.
fn wave() -> Wave {
    let joint = |control: usize, q: usize, place: f64| WaveJoint {
        control,
        q,
        v: q,
        place,
    };
    Wave {
        controls: 2,
        velocities: 3,
        joints: vec![joint(0, 1, 0.4), joint(1, 2, 1.0)],
        amplitude: [0.3, -0.2, 0.5],
        frequency: 7.0,
        length: 1.3,
        bias: 0.2,
        stiffness: 3.0,
        damping: 0.4,
        rise: 0.05,
    }
}

/// Five steps; what is observed is one of them and half of the next.
fn playback() -> Playback {
    let steps = (0..5).map(|n| vec![0.3 + f64::from(n), -0.7 * f64::from(n)]);
    Playback {
        controls: 2,
        steps: steps.collect(),
        time_step: 0.01,
    }
}

/// State, velocity and gains of a controller of two controls on three plain coordinates.
fn act(policy: &dyn Policy, c: f64) -> Outcome {
    let (q, v) = (wavy(3, 0.5, 1.0), wavy(3, 1.5, 1.0));
    let (bar, gains) = (wavy(2, 2.5, 1.0), policy.gains());
    let (d, dgains) = (wavy(3, 3.5, 0.3), wavy(gains.len(), 4.5, 0.3));
    let seen = |q: &DVector<f64>, v: &DVector<f64>, gains: &[f64]| {
        let observed = Observation {
            step: 3,
            time: 0.03,
            time_step: 0.015,
            q,
            v,
            mode: 0,
        };
        let action = policy.with_gains(gains).unwrap().act(&observed).unwrap();
        let pairs = action.control.iter().zip(bar.iter());
        pairs.map(|(u, b)| u * b).sum::<f64>()
    };
    let observed = Observation {
        step: 3,
        time: 0.03,
        time_step: 0.015,
        q: &q,
        mode: 0,
        v: &v,
    };
    let back = policy.act_vjp(&observed, &bar).unwrap();
    let dot = |bar: &[f64], d: &DVector<f64>| bar.iter().zip(d.iter()).map(|(b, d)| b * d).sum();
    let moved = |h: f64| -> Vec<f64> {
        gains
            .iter()
            .zip(dgains.iter())
            .map(|(g, d)| g + h * d)
            .collect()
    };
    groups(
        vec![
            Group {
                name: "q",
                slope: dot(&back.q, &d),
                value: Box::new(|h| seen(&(&q + h * &d), &v, &gains)),
            },
            Group {
                name: "v",
                slope: dot(&back.v, &d),
                value: Box::new(|h| seen(&q, &(&v + h * &d), &gains)),
            },
            Group {
                name: "gains",
                slope: dot(&back.gains, &dgains),
                value: Box::new(|h| seen(&q, &v, &moved(h))),
            },
        ],
        c,
    )
}

/// Before and after the switch.
fn push_then_lock(c: f64) -> Outcome {
    let policy = |stop_at: f64| PushThenLock {
        controls: 2,
        bodies: 2,
        body: 1,
        control: 1,
        q: 2,
        force: -3.0,
        stop_at,
        from_above: true,
    };
    let (q, v) = (wavy(3, 0.5, 1.0), wavy(3, 1.5, 1.0));
    let observed = Observation {
        step: 3,
        time: 0.03,
        time_step: 0.015,
        q: &q,
        mode: 0,
        v: &v,
    };
    let stopped = policy(q[2] + 1.0);
    let action = stopped.act(&observed).unwrap();
    assert_eq!((action.control.len(), action.hold), (0, vec![false, true]));
    let back = stopped.act_vjp(&observed, &wavy(2, 2.5, 1.0)).unwrap();
    assert_eq!(back.gains, [0.0]);
    act(&policy(q[2] - 1.0), c)
}

/// In its first stage and in its second, and after the last one nothing.
fn speed_stages(c: f64) -> Outcome {
    let v = wavy(3, 1.5, 1.0);
    let fastest = v[0].abs().max(v[2].abs());
    let stage = |until: f64, control: [f64; 2]| SpeedStage {
        until,
        control: control.to_vec(),
    };
    let policy = |first: f64, second: f64| SpeedStages {
        watch: vec![0, 2],
        stages: vec![stage(first, [0.3, -0.7]), stage(second, [-1.1, 0.4])],
    };
    let q = wavy(3, 0.5, 1.0);
    let observed = Observation {
        step: 3,
        time: 0.03,
        time_step: 0.015,
        q: &q,
        mode: 0,
        v: &v,
    };
    let over = policy(0.5 * fastest, 0.9 * fastest);
    let (action, back) = (
        over.act(&observed).unwrap(),
        over.act_vjp(&observed, &wavy(2, 2.5, 1.0)).unwrap(),
    );
    assert_eq!((action.control.len(), action.mode), (0, 2));
    assert_eq!(back.gains, [0.0; 4]);
    all([
        act(&policy(2.0 * fastest, 3.0 * fastest), c),
        act(&policy(0.5 * fastest, 3.0 * fastest), c),
    ])
}

/// Two controls over knots that fall on steps and between them, and over one knot per step.
fn knots(c: f64) -> Outcome {
    let mut scene = Scene::new(Fluid::none());
    for mass in [1.0, 2.0] {
        let slide = Joint::Prismatic {
            axis: [1.0, 0.0, 0.0],
        };
        let body = Body::dry().mass(mass).inertia([0.1; 3]);
        scene.add(body.joint(slide).actuated());
    }
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&scene, settings).unwrap();
    all([(11, 3), (12, 5), (4, 4)].map(|(steps, count)| {
        let knots = Knots::new(&simulator, steps, count, &[3.0, 0.5]).unwrap();
        let (x, dx) = (wavy(knots.len(), 0.5, 1.2), wavy(knots.len(), 1.5, 1.0));
        let bar = wavy(2 * steps, 2.5, 1.0);
        let bar = DMatrix::from_column_slice(2, steps, bar.as_slice());
        let back = knots.controls_vjp(x.as_slice(), &bar).unwrap();
        let slope: f64 = back.iter().zip(dx.iter()).map(|(b, d)| b * d).sum();
        let value = |h: f64| {
            let moved = &x + h * &dx;
            let controls = knots.controls(&simulator, moved.as_slice()).unwrap();
            controls.matrix().dot(&bar)
        };
        super::tools::along(value, c * slope)
    }))
}

/// No action, no cotangent; corrupted means not nothing here.
fn open_loop(c: f64) -> Outcome {
    let (q, v) = (wavy(3, 0.5, 1.0), wavy(3, 1.5, 1.0));
    let observed = Observation {
        step: 0,
        time: 0.0,
        time_step: 0.01,
        q: &q,
        mode: 0,
        v: &v,
    };
    assert_eq!(OpenLoop.act(&observed).unwrap(), Default::default());
    let back = OpenLoop.act_vjp(&observed, &wavy(2, 2.5, 1.0)).unwrap();
    let size = back.q.len() + back.v.len() + back.gains.len();
    Outcome {
        rel_error: size as f64 + (c - 1.0),
        order: f64::INFINITY,
        tolerance: super::tools::TOLERANCE,
    }
}

/// A whole rollout with feedback: every cotangent seeded at every state, at two horizons.
fn rollout(c: f64) -> Outcome {
    let mut scene = Scene::new(Fluid::fresh_water());
    let sphere = Shape::sphere(0.1).faces(80);
    let slide = Joint::Prismatic {
        axis: [1.0, 0.2, 0.0],
    };
    scene.add(Body::new(sphere).density(998.0).joint(slide).actuated());
    let oval = Shape::ellipsoid([0.1, 0.05, 0.08]).faces(80);
    scene.add(
        Body::new(oval)
            .density(1200.0)
            .at([0.3, 0.05, 0.02])
            .rotated([0.3, 0.2, 0.1]),
    );
    scene.initial.v = vec![0.4, 0.1, -0.2, 0.05, 0.8, -0.5, 0.3];
    scene.controller = Some(Controller::Pd {
        target: vec![0.1],
        stiffness: vec![20.0],
        damping: vec![3.0],
    });
    let settings = Settings::default().tolerance(1e-13);
    let simulator = Simulator::new(&scene, settings).unwrap();
    all([1, 7].map(|steps| {
        let controls = |h: f64| {
            let u = wavy(steps, 0.2, 1.0) + h * wavy(steps, 1.2, 30.0);
            let u = DMatrix::from_row_slice(1, steps, u.as_slice());
            Controls::from_matrix(&simulator, u).unwrap()
        };
        let base = simulator.rollout(&controls(0.0)).unwrap();
        let mut bar = base.zero_cotangents();
        for (k, m) in [
            &mut bar.q,
            &mut bar.v,
            &mut bar.positions,
            &mut bar.rotations,
        ]
        .into_iter()
        .enumerate()
        {
            m.copy_from_slice(wavy(m.len(), k as f64, 1.0).as_slice());
        }
        let scalar = |h: f64| {
            let run = simulator.rollout(&controls(h)).unwrap();
            let tree = &simulator.system().tree;
            let mut sum = 0.0;
            for (n, (a, b)) in base.samples().iter().zip(run.samples()).enumerate() {
                let dq = super::multibody::tree_displacement(tree, &a.q, &b.q);
                sum += bar.q.column(n).dot(&dq) + bar.v.column(n).dot(&(&b.v - &a.v));
                for (i, (p, r)) in a.poses.iter().zip(&b.poses).enumerate() {
                    let shift = r.translation - p.translation;
                    let turn = r.rotation * p.rotation.transpose();
                    let turn = 0.5 * hydrograd::adjoint::lie::unskew(&turn);
                    sum += bar.positions.fixed_view::<3, 1>(3 * i, n).dot(&shift);
                    sum += bar.rotations.fixed_view::<3, 1>(3 * i, n).dot(&turn);
                }
            }
            sum
        };
        let gradient = base.vjp(&bar).unwrap().controls;
        let direction = DMatrix::from_row_slice(1, steps, wavy(steps, 1.2, 30.0).as_slice());
        super::tools::along(scalar, c * gradient.dot(&direction))
    }))
}
