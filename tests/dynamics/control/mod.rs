//! Optimal control: iLQR against what is known of linear systems, its limits, its feedback, tasks in water, and model-predictive control.

mod errors;
mod idle;
mod linear;
mod mpc;
mod water;

use hydrograd::optimize::{Guess, IlqrSettings, Plan, Problem, ilqr};
use hydrograd::scene::{Body, Drag, Fluid, Joint, Scene, Shape, Site};
use hydrograd::{Rollout, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

/// From a simulator's start, from no control.
fn solve(simulator: &Simulator, problem: &Problem, settings: &IlqrSettings) -> Plan {
    let start = simulator.initial().unwrap();
    let told = |_: &_| ControlFlow::Continue(());
    ilqr(simulator, &start, problem, Guess::Zero, settings, told).unwrap()
}

/// Iterates to rounding.
fn tight() -> IlqrSettings {
    IlqrSettings {
        tolerance: 1e-14,
        iterations: 300,
        ..IlqrSettings::default()
    }
}

/// Gradient of a plan's cost by the controls of its knots, by a reverse sweep: controls × knots.
fn by_sweep(plan: &Plan, problem: &Problem) -> DMatrix<f64> {
    let rollout = &plan.rollout;
    let objective = problem.objective(rollout.simulator()).unwrap();
    let value = rollout.value(&objective).unwrap();
    assert!(
        (value - plan.cost()).abs() <= 1e-12 * value.abs(),
        "{value} {}",
        plan.cost()
    );
    let all = rollout.gradient(&objective).unwrap().controls;
    let mut out = DMatrix::zeros(all.nrows(), problem.knots);
    for n in 0..all.ncols() {
        let mut column = out.column_mut(n / problem.hold);
        column += all.column(n);
    }
    out
}

/// Largest entry of a gradient where no limit holds the control; where one does, it must press against that. And how many are held, all of them at the limit to the bit.
fn open_gradient(plan: &Plan, gradient: &DMatrix<f64>, lower: f64, upper: f64) -> (f64, usize) {
    let (mut open, mut held) = (0.0_f64, 0);
    for (u, g) in plan.controls.iter().zip(gradient) {
        assert!(*u >= lower && *u <= upper, "{u}");
        match (*u == lower, *u == upper) {
            (true, _) => assert!(*g > -1e-9, "{g}"),
            (_, true) => assert!(*g < 1e-9, "{g}"),
            _ => open = open.max(g.abs()),
        }
        held += usize::from(*u == lower || *u == upper);
    }
    (open, held)
}

/// A vehicle with a thruster and an arm of two links, a site at its hand; neutrally buoyant.
fn vehicle(current: [f64; 3]) -> Scene {
    let mut scene = Scene::new(Fluid {
        current,
        ..Fluid::fresh_water()
    });
    scene.time_step = 0.02;
    let drag = Drag {
        linear: 20.0,
        quadratic: 1.0,
        ..Drag::default()
    };
    let hull = Body::new(Shape::ellipsoid([0.2, 0.12, 0.1]).faces(160));
    scene.add(hull.named("hull").density(998.0).thruster().drag(drag));
    let mut parent = ("hull", 0.22);
    for (name, axis) in [("upper", [0.0, 1.0, 0.0]), ("lower", [0.0, 0.0, 1.0])] {
        let link = Body::new(Shape::ellipsoid([0.1, 0.03, 0.03]).faces(80));
        let link = link
            .named(name)
            .density(1100.0)
            .shape_at([0.11, 0.0, 0.0], [0.0; 3]);
        let link = link.child_of(parent.0).at([parent.1, 0.0, 0.0]);
        let joint = Joint::Revolute { axis };
        scene.add(link.joint(joint).actuated().drag(drag));
        parent = (name, 0.22);
    }
    scene.add_site(Site::new("hand", "lower").at([0.22, 0.0, 0.0]));
    scene
}

/// Place of the hand at each state.
fn hand(rollout: &Rollout) -> Vec<DVector<f64>> {
    let all = rollout.observe("site_positions").unwrap();
    all.column_iter().map(|c| c.into_owned()).collect()
}
