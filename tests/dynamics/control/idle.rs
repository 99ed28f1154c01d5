//! Thrusters that have no slope at rest: thrust that goes with u |u|, and dead bands.

use super::solve;
use hydrograd::dynamics::Integrator;
use hydrograd::optimize::{Cost, IlqrSettings, Mpc, MpcRun, MpcSettings, Problem, terms};
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape, Thruster};
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DVector;
use std::ops::ControlFlow;

/// A ball on a track, pushed by a thruster of this law.
fn cart(law: impl Fn(Thruster) -> Thruster) -> Simulator {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.time_step = 0.05;
    let axis = [1.0, 0.0, 0.0];
    let ball = Body::new(Shape::sphere(0.1).faces(80)).named("ball");
    scene.add(ball.density(998.0).joint(Joint::Prismatic { axis }));
    scene.add_force(law(Thruster::new("ball").direction(axis)).into());
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(&scene, settings.integrator(Integrator::Rk4)).unwrap()
}

fn laws() -> [(&'static str, Simulator); 3] {
    [
        ("quadratic", cart(|t| t.polynomial([0.0, 5.0]))),
        (
            "dead band",
            cart(|t| Thruster {
                dead_band: 0.2,
                ..t.polynomial([5.0])
            }),
        ),
        ("linear", cart(|t| t.polynomial([5.0]))),
    ]
}

fn to(place: f64) -> Problem {
    let cost = Cost::default()
        .running(terms::position("ball", [place, 0.0, 0.0], 50.0))
        .running(terms::effort(1e-3));
    Problem::new(15, cost).hold(2).limits([-1.0], [1.0])
}

/// From rest at a place, m.
fn run(mpc: &mut Mpc, plant: &Simulator, problem: &Problem, from: f64, steps: usize) -> MpcRun {
    let q = DVector::from_element(1, from);
    let start = plant.state(0, &q, &DVector::zeros(1)).unwrap();
    let go_on = |_: &_| ControlFlow::Continue(());
    mpc.run(plant, &start, steps, &problem.cost, go_on).unwrap()
}

/// From no control, where the model says that nothing helps.
#[test]
fn a_plan_moves_what_has_no_slope_at_rest() {
    for (name, simulator) in laws() {
        for place in [0.2, -0.2] {
            let plan = solve(&simulator, &to(place), &IlqrSettings::default());
            let end = plan.rollout.samples()[30].q[0];
            println!(
                "{name}: {:?} after {} iterations, cost {:.4} from {:.4}, ends at {end:.3} of {place}",
                plan.stop,
                plan.iterations,
                plan.cost(),
                plan.costs[0]
            );
            assert!((end - place).abs() < 0.02, "{name}: {end}");
            assert!(plan.cost() < 0.5 * plan.costs[0], "{name}");
        }
        // Where nothing is to be done nothing is.
        let plan = solve(&simulator, &to(0.0), &IlqrSettings::default());
        assert_eq!((plan.cost(), plan.controls.amax()), (0.0, 0.0), "{name}");
    }
}

/// Pushed away again and again it comes back each time, from plans that end at rest.
#[test]
fn planning_again_holds_a_place_with_what_has_no_slope_at_rest() {
    for (name, simulator) in laws() {
        let problem = to(0.0);
        let mut mpc = Mpc::new(&simulator, &problem, MpcSettings::default()).unwrap();
        for side in [0.3, -0.2, 0.1] {
            let run = run(&mut mpc, &simulator, &problem, side, 60);
            let end = run.rollout.samples()[60].q[0];
            println!("{name}: from {side} to {end:.4}, cost {:.4}", run.cost);
            assert!(end.abs() < 0.03, "{name}: {end}");
        }
    }
}

/// Where a wide dead band leaves nearly no slope the first plan's feedback is far too strong for the next plan to start with (it went 3,600 km), and its controls end where they act no more (it drifted off): neither is the end of it.
#[test]
fn feedback_that_spoils_a_start_is_left() {
    let simulator = cart(|t| Thruster {
        dead_band: 0.3,
        ..t.polynomial([0.0, 0.0, 5.0])
    });
    for limit in [10.0, f64::INFINITY] {
        let problem = to(0.0).limits([-limit], [limit]);
        let mut mpc = Mpc::new(&simulator, &problem, MpcSettings::default()).unwrap();
        let run = run(&mut mpc, &simulator, &problem, 0.3, 80);
        let end = run.rollout.samples()[80].q[0];
        let most = run.rollout.applied_controls().amax();
        println!(
            "limits ±{limit}: ends at {end:.4}, cost {:.3}, largest command {most:.2}",
            run.cost
        );
        assert!(end.abs() < 0.3 && run.cost < 10.0 && most < 10.0, "{limit}");
    }
}
