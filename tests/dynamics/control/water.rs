//! Tasks in water, on states with rotations: reaching, swinging up, and the feedback that holds a plan.

use super::{by_sweep, hand, open_gradient, solve, tight, vehicle};
use crate::support::{check_gradient, root};
use hydrograd::dynamics::Integrator;
use hydrograd::optimize::{
    Cost, CostPoint, CustomCost, Guess, IlqrSettings, IlqrStop, Problem, Quadratic, ilqr, terms,
};
use hydrograd::scene::{Body, Drag, Fluid, Joint, Scene, Shape, Site};
use hydrograd::{Controls, Fidelity, Result, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

fn cached(scene: &Scene, fidelity: Fidelity) -> Simulator {
    let settings = Settings::default()
        .fidelity(fidelity)
        .integrator(Integrator::Rk2);
    Simulator::cached(scene, settings, &root().join("target/cache")).unwrap()
}

/// Squared speed of the hull, as a cost of one's own.
struct Speed;

impl CustomCost for Speed {
    fn value(&self, at: &CostPoint) -> Result<f64> {
        Ok(at.sample().v.rows(0, 3).norm_squared())
    }

    fn quadratic(&self, at: &CostPoint) -> Result<Quadratic> {
        let n = 2 * at.sample().v.len();
        let by_x = DMatrix::from_fn(3, n, |i, j| f64::from(u8::from(j == n / 2 + i)));
        let by_u = DMatrix::zeros(3, at.control.map_or(8, DVector::len));
        let own = at.sample().v.rows(0, 3).into_owned();
        Ok(Quadratic::least_squares(&own, &by_x, &by_u))
    }
}

fn reach(knots: usize) -> Problem {
    let cost = Cost::default()
        .running(terms::effort(1e-3))
        .running(terms::custom(Speed))
        .running(terms::observable(
            "angular_momentum",
            [2, 5],
            [0.0, 0.0],
            1e-3,
        ))
        .running(terms::control_change(1e-3))
        .running(terms::orientation("hull", [0.0, 0.0, 0.3], 0.3))
        // A folded arm would be in itself.
        .running(terms::configuration(
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 3.0],
        ))
        .last(terms::position("hand", [0.75, 0.2, 0.12], 3e3))
        .last(terms::orientation("hand", [0.0, -0.6, 0.9], 300.0))
        .last(terms::velocity([0.0; 8], 20.0));
    Problem::new(knots, cost).hold(2).limits([-6.0], [6.0])
}

/// A vehicle with an arm, all bodies feeling each other through the water, brings its hand to a pose and rests there, within limits that it meets.
#[test]
fn a_vehicle_reaches_in_water() {
    let simulator = cached(&vehicle([0.05, -0.03, 0.0]), Fidelity::Auto);
    let problem = reach(50);
    let start = simulator.initial().unwrap();
    let plan = ilqr(&simulator, &start, &problem, Guess::Zero, &tight(), |p| {
        println!("{p:?}");
        ControlFlow::Continue(())
    })
    .unwrap();
    let place = hand(&plan.rollout)[100].clone();
    let miss = (&place - DVector::from_vec(vec![0.75, 0.2, 0.12])).norm();
    let rest = plan.rollout.samples()[100].v.amax();
    let (open, held) = open_gradient(&plan, &by_sweep(&plan, &problem), -6.0, 6.0);
    println!(
        "{:?} after {} iterations, cost {} from {}, {:?}; hand misses by {:.2} mm, speed {rest:.1e}; {held} held, gradient {open:.1e}",
        plan.stop,
        plan.iterations,
        plan.cost(),
        plan.costs[0],
        plan.times,
        1e3 * miss
    );
    assert!(miss < 5e-3 && rest < 0.02);
    assert!(held > 5, "{held}");
    assert!(open < 1e-5 * plan.cost(), "{open:e}");
    assert!(plan.costs.windows(2).all(|w| w[1] <= w[0]));
}

/// A hand that a swing brings there: whole steps lead astray, and those that are cut to an eighth ask for regularisation. Without it sixty iterations come to a cost of 0.223, and two hundred to 0.171.
#[test]
fn steps_that_are_cut_short_regularise() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.time_step = 0.02;
    let hull = Body::new(Shape::ellipsoid([0.3, 0.2, 0.2]).faces(80));
    scene.add(hull.named("hull").density(998.0).thruster());
    let arm = Body::new(Shape::ellipsoid([0.2, 0.04, 0.04]).faces(80))
        .named("arm")
        .density(998.0)
        .shape_at([0.22, 0.0, 0.0], [0.0; 3])
        .child_of("hull")
        .at([0.32, 0.0, 0.0]);
    let axis = [0.0, 1.0, 0.0];
    scene.add(arm.joint(Joint::Revolute { axis }).actuated());
    scene.add_site(Site::new("hand", "arm").at([0.44, 0.0, 0.0]));
    let simulator =
        Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    let cost = Cost::default()
        .running(terms::effort(1e-3))
        .last(terms::position("hand", [0.9, 0.3, 0.1], 1e3))
        .last(terms::velocity([0.0; 7], 10.0));
    let problem = Problem::new(25, cost).hold(4);
    let settings = IlqrSettings {
        iterations: 60,
        ..IlqrSettings::default()
    };
    let mut told = Vec::new();
    let start = simulator.initial().unwrap();
    let plan = ilqr(&simulator, &start, &problem, Guess::Zero, &settings, |p| {
        told.push((p.part, p.regularisation));
        ControlFlow::Continue(())
    })
    .unwrap();
    println!("cost {}, {:?}", plan.cost(), plan.stop);
    assert!(plan.cost() < 0.169, "{}", plan.cost());
    let follows = told.windows(2).filter(|w| w[0].0 <= 0.125);
    let grown: Vec<bool> = follows.map(|w| w[1].1 > w[0].1).collect();
    let count = grown.iter().filter(|g| **g).count();
    assert!(count > 10 && 4 * count > 3 * grown.len(), "{told:?}");
}

/// A tip that must stay out of a disc: w (0.15 m − d)² where it is in, read from the angles of two links of 0.38 and 0.35 m.
struct KeepOut(f64);

impl CustomCost for KeepOut {
    fn value(&self, at: &CostPoint) -> Result<f64> {
        Ok(self.0 * self.depth(at).0.powi(2))
    }

    fn quadratic(&self, at: &CostPoint) -> Result<Quadratic> {
        let (depth, slope) = self.depth(at);
        let root = self.0.sqrt();
        let by_x = DMatrix::from_row_slice(1, 4, &[slope[0], slope[1], 0.0, 0.0]);
        let residual = DVector::from_element(1, root * depth);
        let by_u = DMatrix::zeros(1, at.control.map_or(2, DVector::len));
        Ok(Quadratic::least_squares(&residual, &(root * by_x), &by_u))
    }
}

impl KeepOut {
    /// How deep the tip is in, m, and its derivatives by the angles.
    fn depth(&self, at: &CostPoint) -> (f64, [f64; 2]) {
        let q = &at.sample().q;
        let ends = [(0.38, q[0]), (0.35, q[0] + q[1])];
        let x: f64 = ends.iter().map(|(l, a)| -l * a.sin()).sum();
        let z: f64 = ends.iter().map(|(l, a)| -l * a.cos()).sum();
        let along = (x - 0.45, z + 0.45);
        let distance = along.0.hypot(along.1);
        if distance >= 0.15 {
            return (0.0, [0.0; 2]);
        }
        let by = |first: usize| -> f64 {
            let each = ends[first..].iter();
            let of = |(l, a): &(f64, f64)| along.0 * -l * a.cos() + along.1 * l * a.sin();
            -each.map(of).sum::<f64>() / distance
        };
        (0.15 - distance, [by(0), by(1)])
    }
}

/// Along a wall that is stiff by 10⁷ to 10⁸ the way is narrow: steps are cut short, and regularisation only makes them worse. It went round and round there, and used up any number of iterations.
#[test]
fn narrow_ways_are_gone_along() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.time_step = 0.02;
    let link = |name: &str, radius: f64, middle: f64| {
        let axis = [0.0, 1.0, 0.0];
        let body = Body::new(Shape::capsule(radius, 0.3).faces(80)).named(name);
        let body = body.density(1500.0).shape_at([0.0, 0.0, middle], [0.0; 3]);
        body.joint(Joint::Revolute { axis }).actuated()
    };
    scene.add(link("upper", 0.04, -0.15));
    let lower = link("lower", 0.03, -0.17).child_of("upper");
    scene.add(lower.at([0.0, 0.0, -0.38]).overlaps_parent());
    scene.add_site(Site::new("tip", "lower").at([0.0, 0.0, -0.35]));
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&scene, settings).unwrap();
    for weight in [1e4, 1e7, 3e7] {
        let cost = Cost::default()
            .last(terms::position("tip", [0.6, 0.0, -0.2], 1e2))
            .last(terms::velocity([0.0; 2], 1.0))
            .running(terms::effort(1e-3))
            .running(terms::custom(KeepOut(weight)));
        let problem = Problem::new(20, cost).hold(3).limits([-3.0], [3.0]);
        let settings = IlqrSettings {
            iterations: 150,
            ..IlqrSettings::default()
        };
        let plan = solve(&simulator, &problem, &settings);
        println!(
            "{weight:.0e}: {:?} after {} iterations, cost {:.3e} from {:.1}",
            plan.stop,
            plan.iterations,
            plan.cost(),
            plan.costs[0]
        );
        assert!(plan.cost() < 0.01, "{weight}: {}", plan.cost());
        assert_ne!(plan.stop, IlqrStop::Budget, "{weight}");
    }
}

/// The gradients of all terms by the adjoint of step Jacobians, by reverse sweeps, and by differences are one.
#[test]
fn gradients_of_costs_agree() {
    let simulator = cached(&vehicle([0.1, 0.0, 0.05]), Fidelity::Isolated);
    let mut problem = reach(6);
    problem.previous = Some(vec![1.0; 8]);
    problem.cost = problem
        .cost
        .running(terms::configuration(
            vec![0.1, 0.0, 0.2, 0.6, 0.0, 0.8, 0.0, 0.3, -0.2],
            0.7,
        ))
        .running(terms::point(
            "lower",
            [0.1, 0.2, 0.0],
            [0.5, 0.1, 0.0],
            [1.0, 2.0, 3.0],
        ));
    let start = simulator.initial().unwrap();
    let guess = DMatrix::from_fn(8, 6, |i, k| (1.3 * i as f64 + 2.1 * k as f64).sin());
    let one = IlqrSettings {
        iterations: 1,
        ..IlqrSettings::default()
    };
    let objective = problem.objective(&simulator).unwrap();
    let value = |controls: &DMatrix<f64>| {
        let all = DMatrix::from_fn(8, 12, |i, n| controls[(i, n / 2)]);
        let controls = Controls::from_matrix(&simulator, all).unwrap();
        let rollout = simulator.rollout(&controls).unwrap();
        let gradient = rollout.gradient(&objective).unwrap().controls;
        (rollout.value(&objective).unwrap(), gradient)
    };
    let all = value(&guess).1;
    let sweep = DMatrix::from_fn(8, 6, |i, k| all[(i, 2 * k)] + all[(i, 2 * k + 1)]);
    let mut told = None;
    ilqr(
        &simulator,
        &start,
        &problem,
        Guess::Controls(&guess),
        &one,
        |p| {
            told = Some(p.gradient);
            ControlFlow::Continue(())
        },
    )
    .unwrap();
    let largest = sweep.amax();
    assert!(
        (told.unwrap() / largest - 1.0).abs() < 1e-9,
        "{told:?} {largest}"
    );
    for seed in 1..4 {
        let way = DMatrix::from_vec(8, 6, hydrograd::adjoint::sample::numbers(seed, 48, 1.0));
        let h = 3e-3;
        let at = |part: f64| value(&(&guess + part * h * &way)).0;
        // Fourth order.
        let slope = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h);
        let exact = sweep.dot(&way);
        println!("slope {slope} {exact}: {:.1e}", (slope / exact - 1.0).abs());
        assert!((slope - exact).abs() < 1e-8 * exact.abs());
    }
}

/// A heavy rod in water, hung from a pivot, that its motor can't lift straight up.
fn rod() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.time_step = 0.01;
    scene.gravity = [0.0, 0.0, -9.81];
    let drag = Drag {
        quadratic: 0.3,
        ..Drag::default()
    };
    let rod = Body::new(Shape::ellipsoid([0.03, 0.03, 0.25]).faces(160)).named("rod");
    let rod = rod
        .density(4000.0)
        .shape_at([0.0, 0.0, -0.25], [0.0; 3])
        .drag(drag);
    let weight = Body::new(Shape::sphere(0.05).faces(160))
        .density(4000.0)
        .named("weight");
    let joint = Joint::Revolute {
        axis: [0.0, 1.0, 0.0],
    };
    scene.add(rod.joint(joint).actuated());
    scene.add(
        weight
            .child_of("rod")
            .at([0.0, 0.0, -0.57])
            .joint(Joint::Fixed),
    );
    scene
}

/// Swings up with half the torque that would lift it, and stands there; its feedback then holds it against a push that without makes it fall.
#[test]
fn a_rod_swings_up_and_is_held() {
    let simulator = cached(&rod(), Fidelity::Auto);
    let side = DVector::from_element(1, std::f64::consts::FRAC_PI_2);
    let (still, none) = (DVector::zeros(1), simulator.no_control());
    let static_torque = simulator
        .equations(&side)
        .unwrap()
        .bias_force(&still, &none)
        .unwrap()[0]
        .abs();
    let limit = 0.5 * static_torque;
    let up = std::f64::consts::PI;
    let cost = Cost::default()
        .running(terms::effort(1e-3 / (limit * limit)))
        .last(terms::configuration([up], 100.0))
        .last(terms::velocity([0.0], 10.0));
    let problem = Problem::new(75, cost).hold(4).limits([-limit], [limit]);
    let start = simulator.initial().unwrap();
    let guess = DMatrix::from_fn(1, 75, |_, k| if k < 10 { 0.5 * limit } else { 0.0 });
    let settings = IlqrSettings {
        iterations: 300,
        ..IlqrSettings::default()
    };
    let told = |_: &_| ControlFlow::Continue(());
    let plan = ilqr(
        &simulator,
        &start,
        &problem,
        Guess::Controls(&guess),
        &settings,
        told,
    )
    .unwrap();
    let end = &plan.rollout.samples()[300];
    let most = plan.controls.amax();
    println!(
        "torque {most:.2} of {static_torque:.2} N m, {:?} after {} iterations, cost {:.2e}: {:.4} rad from the top at {:.1e} rad/s",
        plan.stop,
        plan.iterations,
        plan.cost(),
        end.q[0] - up,
        end.v[0]
    );
    assert!((end.q[0] - up).abs() < 0.02 && end.v[0].abs() < 0.1);
    assert!(most <= limit);
    // On its head, pushed.
    let cost = Cost::default()
        .running(terms::configuration([up], 10.0))
        .running(terms::effort(1e-2 / (limit * limit)));
    let stand = Problem::new(75, cost).hold(4).limits([-limit], [limit]);
    let balanced = simulator
        .state(0, &DVector::from_element(1, up), &still)
        .unwrap();
    let plan = ilqr(&simulator, &balanced, &stand, Guess::Zero, &settings, told).unwrap();
    assert!(plan.rollout.samples()[300].q[0] - up < 1e-6);
    let pushed = simulator.state(
        0,
        &DVector::from_element(1, up - 0.05),
        &DVector::from_element(1, -0.2),
    );
    let pushed = pushed.unwrap();
    let falls = |simulator: &Simulator| {
        let none = Controls::zeros(simulator, 300);
        let rollout = simulator
            .rollout_from(&pushed, &none, |_| ControlFlow::Continue(()))
            .unwrap();
        rollout.samples()[200..280]
            .iter()
            .map(|s| (s.q[0] - up).abs())
            .fold(0.0, f64::max)
    };
    let mut held = simulator.clone();
    held.set_policy(Box::new(plan.tracking()));
    let (with, without) = (falls(&held), falls(&simulator));
    println!("from 2 s on at most {with:.1e} rad from the top with feedback, {without:.2} without");
    assert!(with < 5e-3 && without > 1.0);
}

/// The feedback is a controller like others, with exact derivatives, on states with rotations.
#[test]
fn tracking_has_gradients() {
    let mut scene = vehicle([0.05, 0.0, 0.0]);
    let plan = solve(
        &cached(&scene, Fidelity::Isolated),
        &reach(6),
        &IlqrSettings::default(),
    );
    scene.initial.v = vec![0.3, -0.2, 0.1, 0.5, -0.4, 0.6, 0.8, -0.7];
    let mut moved = cached(&scene, Fidelity::Isolated);
    moved.set_policy(Box::new(plan.tracking()));
    check_gradient("tracking of a plan", &mut moved, 10, 3, 1e-6);
}

/// The cost reaches its target, or nothing is left to be done.
#[test]
fn other_ways_to_end() {
    let simulator = cached(&vehicle([0.0; 3]), Fidelity::Isolated);
    let problem = reach(10);
    let all = solve(&simulator, &problem, &IlqrSettings::default());
    let target = 0.5 * (all.costs[0] + all.cost());
    let with = |settings: IlqrSettings| solve(&simulator, &problem, &settings).stop;
    let base = IlqrSettings::default();
    assert_eq!(
        with(IlqrSettings {
            target: Some(target),
            ..base
        }),
        IlqrStop::Target
    );
    assert_eq!(
        with(IlqrSettings {
            iterations: 1,
            ..base
        }),
        IlqrStop::Budget
    );
    assert_eq!(
        with(IlqrSettings {
            iterations: 1,
            last_gains: false,
            ..base
        }),
        IlqrStop::Budget
    );
    // By the last iteration that there is, too.
    assert_eq!(
        with(IlqrSettings {
            iterations: 1,
            last_gains: false,
            target: Some(all.costs[1]),
            ..base
        }),
        IlqrStop::Target
    );
    let rest = Problem::new(3, Cost::default().running(terms::effort(1.0)));
    assert_eq!(solve(&simulator, &rest, &base).stop, IlqrStop::Stationary);
}
