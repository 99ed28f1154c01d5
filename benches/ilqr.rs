//! Optimal control of a vehicle with an arm: iterations a second, where the time goes, and what it is worth against a tuned PID.
//!
//! `cargo bench --bench ilqr -- speed`: iLQR of a free vehicle with nine actuated links over 50 knots, by fidelity.
//! `cargo bench --bench ilqr -- hold`: a vehicle with a three-joint arm that keeps its hand on a point while the current turns, by model-predictive control and by PID whose gains
//! are tuned on the very same run.

#[allow(dead_code)]
mod common;

use common::{arguments, median};
use hydrograd::dynamics::Integrator;
use hydrograd::optimize::{
    Cost, Guess, IlqrSettings, Mpc, MpcSettings, OptimizeSettings, Problem, ilqr, minimise, terms,
};
use hydrograd::scene::{Body, Drag, Fluid, Joint, Scene, Shape, Site};
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DVector;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

const GO: fn(&hydrograd::optimize::IlqrProgress) -> ControlFlow<()> = |_| ControlFlow::Continue(());

/// A free hull with a wrench, and links in a row before it, each about another axis than the one before; all a little heavier than water.
fn vehicle(links: usize, current: [f64; 3]) -> Scene {
    let mut scene = Scene::new(Fluid {
        current,
        ..Fluid::fresh_water()
    });
    scene.gravity = [0.0, 0.0, -9.81];
    let drag = |linear: f64| Drag {
        linear,
        quadratic: 1.0,
        ..Drag::default()
    };
    let hull = Body::new(Shape::ellipsoid([0.35, 0.25, 0.2]).faces(320));
    scene.add(
        hull.named("hull")
            .density(1000.0)
            .thruster()
            .drag(drag(20.0)),
    );
    let half = 0.6 / links as f64;
    let mut parent = ("hull".to_string(), 0.37);
    for k in 0..links {
        let axis = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]][k % 2];
        let shape = Shape::ellipsoid([half, 0.035, 0.035]).faces(160);
        let link = Body::new(shape).shape_at([half + 0.01, 0.0, 0.0], [0.0; 3]);
        let link = link
            .named(format!("link {k}"))
            .density(1050.0)
            .child_of(parent.0);
        let link = link
            .at([parent.1, 0.0, 0.0])
            .joint(Joint::Revolute { axis });
        scene.add(link.actuated().drag(drag(5.0)));
        parent = (format!("link {k}"), 2.0 * half + 0.02);
    }
    scene.add_site(Site::new("hand", parent.0).at([parent.1, 0.0, 0.0]));
    scene.initial.q = vec![0.0; 7 + links];
    scene.initial.q[3] = 1.0;
    for k in 0..links {
        scene.initial.q[7 + k] = 0.3 * (1.7 * k as f64 + 0.4).sin();
    }
    scene
}

fn simulator(
    scene: &Scene,
    fidelity: Fidelity,
    integrator: Integrator,
    dt: f64,
) -> hydrograd::Result<Simulator> {
    let settings = Settings::default()
        .fidelity(fidelity)
        .integrator(integrator)
        .time_step(dt);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/cache");
    Simulator::cached(scene, settings, &folder)
}

/// Where the hand is at the start, m.
fn hand(simulator: &Simulator) -> hydrograd::Result<[f64; 3]> {
    let still = simulator.rollout(&hydrograd::Controls::zeros(simulator, 0))?;
    let at = still.observe("site_positions")?;
    Ok([at[0], at[1], at[2]])
}

/// Iterations a second over 50 knots, and where they go.
fn speed() -> hydrograd::Result<()> {
    println!(
        "ten bodies, 15 velocities, 15 controls, 50 knots of one step of 20 ms; medians over iterations with a whole step"
    );
    println!(
        "| fidelity | integrator | unknowns | iterations/s | rollout ms | derivatives ms | sweep ms | iterations | cost from | to | ended |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let scene = vehicle(9, [0.1, 0.05, 0.0]);
    for fidelity in [Fidelity::Isolated, Fidelity::Auto, Fidelity::Reduced] {
        for integrator in [
            Integrator::MomentumEuler,
            Integrator::VelocityEuler,
            Integrator::Rk2,
            Integrator::Rk4,
        ] {
            let simulator = simulator(&scene, fidelity, integrator, 0.02)?;
            let mut goal = hand(&simulator)?;
            goal[1] += 0.3;
            goal[2] -= 0.2;
            let nv = simulator.system().tree.velocities();
            let cost = Cost::default()
                .running(terms::position("hand", goal, 10.0))
                .running(terms::effort(1e-3))
                .running(terms::velocity(vec![0.0; nv], 0.1))
                .last(terms::position("hand", goal, 1000.0))
                .last(terms::velocity(vec![0.0; nv], 1.0));
            let problem = Problem::new(50, cost).limits([-20.0], [20.0]);
            let start = simulator.initial()?;
            let settings = IlqrSettings {
                iterations: 30,
                tolerance: 1e-6,
                last_gains: false,
                ..IlqrSettings::default()
            };
            let mut rates = Vec::new();
            let mut parts = [Vec::new(), Vec::new(), Vec::new()];
            let mut plan = None;
            for _ in 0..5 {
                let made = ilqr(&simulator, &start, &problem, Guess::Zero, &settings, GO)?;
                let n = made.iterations as f64;
                rates.push(made.rate());
                let t = made.times;
                for (part, all) in parts.iter_mut().zip([t.rollouts, t.derivatives, t.sweeps]) {
                    part.push(1e3 * all / n);
                }
                plan = Some(made);
            }
            let Some(plan) = plan else { continue };
            let [a, b, c] = parts.map(median);
            println!(
                "| {fidelity:?} | {integrator:?} | {} | {:.1} | {a:.1} | {b:.1} | {c:.1} | {} | {:.3} | {:.4} | {:?} |",
                simulator.unknowns(),
                median(rates),
                plan.iterations,
                plan.costs[0],
                plan.cost(),
                plan.stop,
            );
        }
    }
    Ok(())
}

/// Time step of the plant, s.
const DT: f64 = 0.01;
/// Parts in which the current stands, and steps of the plant in one.
const PARTS: usize = 24;
const PART: usize = 50;
/// Largest force or torque of a control.
const LIMIT: f64 = 60.0;

/// The current in a part of the run, m/s: it turns once, level.
fn current(part: usize) -> [f64; 3] {
    let angle = TAU * part as f64 / PARTS as f64;
    [0.25 * angle.cos(), 0.25 * angle.sin(), 0.0]
}

/// A closed loop over all parts: the cost and the mean distance of the hand, m.
fn closed(
    plants: &[Simulator],
    cost: &Cost,
    goal: [f64; 3],
    mut act: impl FnMut(usize, f64, &DVector<f64>, &DVector<f64>) -> hydrograd::Result<DVector<f64>>
    + Send,
) -> hydrograd::Result<(f64, f64)> {
    let (mut total, mut off) = (0.0, 0.0);
    let (q, v) = plants[0].start();
    let (mut q, mut v) = (q.clone(), v.clone());
    for (part, plant) in plants.iter().enumerate() {
        let start = plant.state(part * PART, &q, &v)?;
        let rollout = plant.rollout_deciding(&start, PART, |_, s| act(part, s.time, &s.q, &s.v))?;
        let problem = Problem::new(PART, cost.clone());
        total += rollout.value(&problem.objective(plant)?)?;
        let places = rollout.observe("site_positions")?;
        let miss = |n: usize| {
            (0..3)
                .map(|k| (places[(k, n)] - goal[k]).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        off += (0..PART).map(miss).sum::<f64>();
        let last = &rollout.samples()[PART];
        (q, v) = (last.q.clone(), last.v.clone());
    }
    Ok((total, off / (PARTS * PART) as f64))
}

/// A PID of every coordinate against where it starts: stiffness, damping and integral gain of the hull's place, of its attitude, and of the joints.
fn pid(
    plants: &[Simulator],
    cost: &Cost,
    goal: [f64; 3],
    gains: &[f64],
) -> hydrograd::Result<(f64, f64)> {
    let model = &plants[0];
    let rest = model.start().0.clone();
    let group = |i: usize| {
        if i < 3 {
            0
        } else if i < 6 {
            1
        } else {
            2
        }
    };
    let mut sum = DVector::zeros(model.system().tree.velocities());
    closed(plants, cost, goal, |_, _, q, v| {
        let off = model.difference(&rest, q)?;
        sum += DT * &off;
        let one = |i: usize, _| {
            let [p, d, s] = [0, 1, 2].map(|k| gains[3 * group(i) + k]);
            -(p * off[i] + d * v[i] + s * sum[i])
        };
        Ok(DVector::from_fn(off.len(), one).map(|u| u.clamp(-LIMIT, LIMIT)))
    })
}

/// Gains tuned by descent of the run's cost in their logarithms; slopes by differences, side by side.
fn tuned(
    plants: &[Simulator],
    cost: &Cost,
    goal: [f64; 3],
    integral: bool,
) -> hydrograd::Result<Vec<f64>> {
    let first = [300.0, 100.0, 100.0, 100.0, 30.0, 30.0, 30.0, 5.0, 10.0_f64];
    let open: Vec<usize> = (0..9).filter(|k| integral || k % 3 != 2).collect();
    let gains = |x: &[f64]| {
        let mut out = vec![0.0; 9];
        for (k, x) in open.iter().zip(x) {
            out[*k] = first[*k] * x.exp();
        }
        out
    };
    let h = 1e-4;
    let evaluate = |x: &[f64]| {
        let at = |k: usize, h: f64| {
            let mut y = x.to_vec();
            if let Some(y) = y.get_mut(k) {
                *y += h;
            }
            pid(plants, cost, goal, &gains(&y)).map(|found| found.0)
        };
        let value = at(usize::MAX, 0.0)?;
        let slope = |k: usize| Ok((at(k, h)? - at(k, -h)?) / (2.0 * h));
        let slopes: Vec<hydrograd::Result<f64>> = (0..x.len()).into_par_iter().map(slope).collect();
        Ok((value, slopes.into_iter().collect::<hydrograd::Result<_>>()?))
    };
    let settings = OptimizeSettings {
        iterations: 40,
        cost_tolerance: 1e-4,
        ..OptimizeSettings::default()
    };
    let found = minimise(evaluate, &vec![0.0; open.len()], &settings, |_| {})?;
    Ok(gains(&found.x))
}

/// A hand on a point while the current turns.
fn hold() -> hydrograd::Result<()> {
    let at = |current: [f64; 3]| vehicle(3, current);
    let plants =
        (0..PARTS).map(|part| simulator(&at(current(part)), Fidelity::Auto, Integrator::Rk2, DT));
    let plants = plants.collect::<hydrograd::Result<Vec<_>>>()?;
    let goal = hand(&plants[0])?;
    let nv = plants[0].system().tree.velocities();
    let cost = Cost::default()
        .running(terms::position("hand", goal, 1000.0))
        .running(terms::orientation("hull", [0.0; 3], 1.0))
        .running(terms::velocity(vec![0.0; nv], 0.1))
        .running(terms::effort(1e-4));
    println!(
        "{} s, a current of 0.25 m/s that turns once; limits of {LIMIT} N and N m; the PIDs' gains are tuned on this very run",
        (PARTS * PART) as f64 * DT
    );
    println!("| controller | cost | hand off by mm, mean | ms a plan | longest | plans |");
    println!("|---|---|---|---|---|---|");
    for (name, integral) in [("PD, tuned", false), ("PID, tuned", true)] {
        let clock = Instant::now();
        let gains = tuned(&plants, &cost, goal, integral)?;
        let (total, off) = pid(&plants, &cost, goal, &gains)?;
        println!("| {name} | {total:.4} | {:.2} | – | – | – |", 1e3 * off);
        eprintln!(
            "{name}: gains {gains:.1?}, tuned in {:.0} s",
            clock.elapsed().as_secs_f64()
        );
    }
    let problem = Problem::new(15, cost.clone())
        .hold(2)
        .limits([-LIMIT], [LIMIT]);
    let settings = MpcSettings {
        every: 1,
        iterations: 1,
        ..MpcSettings::default()
    };
    let rows = [
        ("MPC, model in still water", Fidelity::Isolated, false),
        ("MPC that is told the current", Fidelity::Isolated, true),
        ("the same, model `auto` as the plant", Fidelity::Auto, true),
    ];
    for (name, fidelity, told) in rows {
        let model = |part: usize| {
            let current = if told { current(part) } else { [0.0; 3] };
            simulator(&at(current), fidelity, Integrator::Rk2, 2.0 * DT)
        };
        let models = (0..PARTS)
            .map(model)
            .collect::<hydrograd::Result<Vec<_>>>()?;
        let mut mpc = Mpc::new(&models[0], &problem, settings)?;
        let mut now = 0;
        let (total, off) = closed(&plants, &cost, goal, |part, time, q, v| {
            if part != now {
                now = part;
                mpc.set_model(&models[part], &problem)?;
            }
            mpc.control(time, q, v)
        })?;
        let times: Vec<f64> = mpc.replans()[1..].iter().map(|r| 1e3 * r.seconds).collect();
        let longest = times.iter().copied().fold(0.0, f64::max);
        let count = mpc.replans().len();
        println!(
            "| {name} | {total:.4} | {:.2} | {:.1} | {longest:.1} | {count} |",
            1e3 * off,
            median(times)
        );
    }
    Ok(())
}

fn main() -> hydrograd::Result<()> {
    let arguments = arguments();
    let wanted = |name: &str| arguments.is_empty() || arguments.iter().any(|a| a == name);
    if wanted("speed") {
        speed()?;
    }
    if wanted("hold") {
        hold()?;
    }
    Ok(())
}
