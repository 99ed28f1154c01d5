//! Joints at their limits: where they stop, what they lose, in water, and scenes that can't be.

use super::tools::{RAIL, under_gravity};
use crate::support::{CONTACT_INTEGRATORS, GRAVITY, run, says, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Contact, Controller, Fluid, Joint, Motion, Scene, Shape};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::DVector;
use std::f64::consts::PI;

const HINGE: Joint = Joint::Revolute {
    axis: [0.0, 1.0, 0.0],
};

/// A mass of 2 kg that slides up and down by 0.3 m.
pub fn slider() -> Scene {
    let mut scene = under_gravity(0.0);
    scene.add(
        Body::dry()
            .named("slider")
            .mass(2.0)
            .inertia([0.01; 3])
            .joint(RAIL)
            .limits([-0.3, 0.3]),
    );
    scene
}

/// A mass of 1 kg on an arm of 0.5 m that falls from the horizontal and is stopped before it hangs.
fn pendulum() -> Scene {
    let mut scene = under_gravity(0.0);
    scene.time_step = 1e-3;
    scene.add(
        Body::dry()
            .named("pendulum")
            .mass(1.0)
            .inertia([0.01; 3])
            .center_of_mass([0.5, 0.0, 0.0])
            .joint(HINGE)
            .limits([-0.2, 1.0]),
    );
    scene
}

/// Highest energy above that at the start.
fn gain(rollout: &Rollout) -> f64 {
    let first = rollout.samples()[0].energy();
    let each = rollout.samples().iter().map(|s| s.energy() - first);
    each.fold(f64::NEG_INFINITY, f64::max)
}

/// A joint that rests at its limit when the run starts is pressed a little: the step's derivatives are numbers, those of differences.
#[test]
fn a_joint_may_start_at_rest_at_its_limit() {
    for integrator in CONTACT_INTEGRATORS {
        let mut scene = slider();
        scene.gravity = [0.0; 3];
        scene.bodies[0].start = vec![0.3];
        let sim = simulator(&scene, Fidelity::Isolated, integrator);
        let end = |start: [f64; 2]| {
            let mut sim = sim.clone();
            let [q, v] = start.map(|x| DVector::from_element(1, x));
            sim.set_start(q, v).unwrap();
            sim.rollout(&Controls::zeros(&sim, 3)).unwrap()
        };
        let rollout = end([0.3, 0.0]);
        assert!(rollout.samples()[3].v[0] < 0.0);
        let mut seed = rollout.zero_cotangents();
        seed.v[(0, 3)] = 1.0;
        let gradient = rollout.vjp(&seed).unwrap().initial;
        let by = |step: [f64; 2]| {
            let at = |sign: f64| end([0.3 + sign * step[0], sign * step[1]]).samples()[3].v[0];
            (at(1.0) - at(-1.0)) / (2.0 * step[0].max(step[1]))
        };
        let h = 1e-7;
        let right = [by([h, 0.0]), by([0.0, h])];
        let found = [gradient.q[0], gradient.v[0]];
        for (found, right) in found.into_iter().zip(right) {
            let off = (found - right).abs() / right.abs().max(1.0);
            assert!(off < 1e-5, "{integrator:?}: {found} for {right}");
        }
    }
}

/// By which part of what a joint comes by in a step it goes past its limit at most: midpoint's mean velocity has half of the stop's impulse in it.
fn past(integrator: Integrator) -> f64 {
    match integrator {
        Integrator::Midpoint => 1.0 / 6.0,
        _ => 1.0 / 11.0,
    }
}

/// It goes past its limit by an eleventh of what it would in the step that reaches it (midpoint: a sixth), and rests where the smoothed
/// law carries its weight.
#[test]
fn a_slider_falls_on_its_stop() {
    for integrator in CONTACT_INTEGRATORS {
        let simulator = simulator(&slider(), Fidelity::Isolated, integrator);
        let rollout = run(&simulator, 200);
        let q = |n: usize| rollout.samples()[n].q[0];
        let dt = simulator.time_step();
        let lowest = (0..=200).map(q).fold(f64::INFINITY, f64::min);
        let fastest = (2.0 * GRAVITY * 0.3).sqrt() + GRAVITY * dt;
        let bound = fastest * dt * past(integrator);
        let (depth, width) = (GRAVITY * dt * dt / 10.0, 6e-4);
        let rest = -0.3 + width - 2.0 * (width * depth).sqrt();
        println!(
            "{integrator:?}: {:.2e} m past the limit, bound {bound:.2e}; rests {:.1e} m off; gains {:.1e} J",
            -0.3 - lowest,
            q(200) - rest,
            gain(&rollout),
        );
        assert!(-0.3 - lowest <= bound);
        assert!((q(200) - rest).abs() < 1e-9);
        assert!((q(200) - q(199)).abs() < 1e-12);
        assert!(gain(&rollout) <= 1e-12);
        // It lost all that it had fallen.
        let left = rollout.samples()[200].energy() + 2.0 * GRAVITY * 0.3;
        assert!(left < 0.02 * 2.0 * GRAVITY * 0.3, "{left}");
    }
}

#[test]
fn a_pendulum_is_stopped() {
    for integrator in CONTACT_INTEGRATORS {
        let simulator = simulator(&pendulum(), Fidelity::Isolated, integrator);
        let rollout = run(&simulator, 3000);
        let q = |n: usize| rollout.samples()[n].q[0];
        let dt = simulator.time_step();
        let inertia = 0.01 + 0.25;
        let law = simulator.system().limits[0].law;
        assert!((law.stiffness * dt * dt / (10.0 * inertia) - 1.0).abs() < 1e-12);
        let furthest = (0..=3000).map(q).fold(f64::NEG_INFINITY, f64::max);
        let fastest = (2.0 * GRAVITY * 0.5 * 1.0_f64.sin() / inertia).sqrt();
        // One step's pull more, at most.
        let bound = (fastest + GRAVITY * 0.5 / inertia * dt) * dt * past(integrator);
        println!(
            "{integrator:?}: {:.2e} rad past the limit, bound {bound:.2e}; gains {:.1e} J; ends {:.1e} rad off",
            furthest - 1.0,
            gain(&rollout),
            q(3000) - 1.0
        );
        assert!(furthest - 1.0 <= bound);
        // What a first-order integrator makes of a free swing.
        let fallen = GRAVITY * 0.5 * 1.0_f64.sin();
        assert!(gain(&rollout) <= 5e-3 * fallen);
        assert!((q(3000) - 1.0).abs() <= law.width);
        let left = rollout.samples()[3000].energy() + fallen;
        assert!(left < 0.01 * fallen, "{left}");
    }
}

/// A hinge at its limit gives to either side what it takes from the other.
#[test]
fn a_limit_between_bodies_keeps_momentum() {
    for integrator in [Integrator::MomentumEuler, Integrator::Midpoint] {
        let mut scene = under_gravity(0.0);
        scene.gravity = [0.0; 3];
        scene.add(Body::dry().named("base").mass(3.0).inertia([0.2, 0.1, 0.2]));
        scene.add(
            Body::dry()
                .named("arm")
                .child_of("base")
                .mass(1.0)
                .inertia([0.02, 0.05, 0.04])
                .center_of_mass([0.4, 0.1, 0.0])
                .at([0.2, 0.0, 0.1])
                .joint(HINGE)
                .limits([-0.5, 0.5]),
        );
        scene.initial.v = vec![0.3, -0.2, 0.1, 0.5, 0.4, -0.3, 3.0];
        let simulator = simulator(&scene, Fidelity::Isolated, integrator);
        let rollout = run(&simulator, 100);
        let furthest = rollout.samples().iter().map(|s| s.q[7]).fold(0.0, f64::max);
        assert!(furthest > 0.5, "{furthest}");
        let drift = rollout.summary().momentum_drift.unwrap();
        println!("{integrator:?}: momentum drifts by {drift:.1e}");
        assert!(drift < 1e-12, "{drift}");
    }
}

/// Without gravity the ball comes at constant speed; the step that reaches the stop is that of mass and added mass.
#[test]
fn water_is_stopped_as_well() {
    let dt = 0.01;
    let density = 998.0;
    let volume = 4.0 / 3.0 * PI * 1e-3;
    let mass = (800.0 + 0.5 * density) * volume;
    for stiffness in [None, Some(3e4)] {
        for integrator in CONTACT_INTEGRATORS {
            let mut scene = Scene::new(Fluid::fresh_water());
            scene.time_step = dt;
            let ball = Body::new(Shape::sphere(0.1)).density(800.0).named("ball");
            let mut ball = ball.joint(RAIL).limits([-0.02, 0.103]);
            ball.limit_stiffness = stiffness;
            scene.add(ball);
            scene.initial.v = vec![1.0];
            let simulator = simulator(&scene, Fidelity::Isolated, integrator);
            let law = simulator.system().limits[0].law;
            let k = stiffness.unwrap_or(10.0 * mass / (dt * dt));
            assert!((law.stiffness / k - 1.0).abs() < 1e-9);
            let rollout = run(&simulator, 11);
            let q = |n: usize| rollout.samples()[n].q[0];
            assert!((q(10) - 0.1).abs() < 1e-12);
            // M (v − 1) = −Δt k (q + Δt v − 0.103), half of that in midpoint's mean velocity.
            let end = |time: f64| (mass - time * k * (0.1 - 0.103)) / (mass + time * dt * k);
            let v = match integrator {
                Integrator::Midpoint => end(0.5 * dt),
                _ => end(dt),
            };
            let found = (q(11) - q(10)) / dt;
            assert!((found - v).abs() < 1e-9, "{integrator:?}: {found}, not {v}");
            let reads = rollout.samples()[11].v[0];
            assert!((reads - end(dt)).abs() < 1e-9, "{integrator:?}: {reads}");
        }
    }
}

/// Both joints of an arm that is driven into its limits: one by a torque, one by its weight.
pub fn arm(water: f64) -> Scene {
    let mut scene = under_gravity(water);
    let link = |length: f64| {
        Body::new(Shape::ellipsoid([0.5 * length, 0.05, 0.04]))
            .density(1500.0)
            .shape_at([0.6 * length, 0.0, 0.0], [0.0; 3])
    };
    scene.add(
        link(0.4)
            .named("upper")
            .joint(HINGE)
            .limits([-0.3, 0.25])
            .actuated(),
    );
    scene.add(
        link(0.3)
            .named("lower")
            .child_of("upper")
            .at([0.6, 0.0, 0.0])
            .joint(HINGE)
            .limits([-0.1, 0.2])
            .limit_stiffness(2e3)
            .actuated(),
    );
    scene
}

#[track_caller]
fn refused(change: impl FnOnce(&mut Body), words: &[&str]) {
    let mut scene = slider();
    scene.validate().unwrap();
    change(&mut scene.bodies[0]);
    says(scene.validate().unwrap_err(), words);
}

#[test]
fn limits_are_checked_by_name() {
    let field = "body \"slider\": limits";
    refused(|b| b.limits = Some([0.1, -0.1]), &[field, "[0.1, -0.1]"]);
    refused(|b| b.limits = Some([0.1, 0.1]), &[field, "above it"]);
    refused(
        |b| b.limits = Some([f64::NAN, 0.1]),
        &[field, "NaN", "finite"],
    );
    refused(
        |b| b.limits = Some([0.0, f64::INFINITY]),
        &[field, "inf", "finite"],
    );
    refused(
        |b| b.joint = Joint::Free,
        &[field, "free joint", "prismatic and revolute"],
    );
    refused(|b| b.locked = true, &[field, "`locked`"]);
    let motion = Motion::Linear {
        offset: 0.0,
        rate: 1.0,
    };
    refused(|b| b.motion = Some(vec![motion]), &[field, "`motion`"]);
    let field = "body \"slider\": limit_stiffness";
    refused(|b| b.limit_stiffness = Some(0.0), &[field, "got 0", "N/m"]);
    refused(
        |b| b.limit_stiffness = Some(f64::NAN),
        &[field, "NaN", "finite"],
    );
    refused(
        |b| (b.limits, b.limit_stiffness) = (None, Some(1.0)),
        &[field, "no limits"],
    );
    let field = "body \"slider\": initial.q[0]";
    refused(
        |b| b.limits = Some([0.1, 0.3]),
        &[field, "got 0", "from 0.1 to 0.3"],
    );
    let mut scene = slider();
    scene.initial.q = vec![-0.31];
    let said = scene.validate().unwrap_err().to_string();
    assert!(said.contains(field) && said.contains("-0.31"), "{said}");
    // A start at the limit itself is one within.
    scene.initial.q = vec![-0.3];
    scene.validate().unwrap();
}

/// A joint that carries no inertia has no default.
#[test]
fn a_limit_without_inertia_asks_for_a_stiffness() {
    let mut scene = slider();
    scene.bodies[0].mass = Some(0.0);
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let made = Simulator::new(&scene, settings);
    let said = made.map(|_| ()).unwrap_err().to_string();
    assert!(said.contains("\"slider\": limit_stiffness"), "{said}");
}

#[test]
fn limits_in_a_scene_file() {
    let text = |limits: &str| {
        format!(
            "time_step = 0.01\nsteps = 1\n[fluid]\ndensity = 0.0\n[[bodies]]\nname = \"a\"\nmass = 1.0\n\
             inertia = [1.0, 1.0, 1.0]\n{limits}\njoint = {{ kind = \"prismatic\", axis = [0, 0, 1] }}\n"
        )
    };
    let read = |limits: &str| Scene::from_toml(&text(limits), "");
    let scene = read("limits = [-0.3, 0.4]\nlimit_stiffness = 2e3").unwrap();
    assert_eq!(scene.bodies[0].limits, Some([-0.3, 0.4]));
    assert_eq!(scene.bodies[0].limit_stiffness, Some(2e3));
    let again = Scene::from_toml(&scene.to_toml().unwrap(), "").unwrap();
    assert_eq!(scene, again);
    for (wrong, word) in [
        ("limits = [-0.3]", "2"),
        ("limit = [-0.3, 0.4]", "limits"),
        ("limits = [-0.3, 0.4]\nlimit_width = 1.0", "limit_width"),
    ] {
        let said = read(wrong).unwrap_err().to_string();
        assert!(said.contains(word), "no {word:?} in: {said}");
    }
}

/// Limits beside surfaces that touch: the ball is pressed on the floor by a joint that can't come down any further than it.
#[test]
fn limits_and_surfaces_share_the_load() {
    let mut scene = slider();
    scene.add_wall([0.0, 0.0, -0.5], [0.0, 0.0, 1.0]);
    scene.contact = Some(Contact {
        gap: Some(0.0),
        width: Some(1e-5),
        stiffness: Some(2e5),
        ..Contact::default()
    });
    let body = &mut scene.bodies[0];
    body.shape = Some(Shape::sphere(0.2));
    body.limit_stiffness = Some(2e5);
    // The range is small, so that the depth at which the two carry is beyond the width.
    body.limits = Some([-0.3, -0.29]);
    scene.initial.q = vec![-0.295];
    for integrator in CONTACT_INTEGRATORS {
        let simulator = simulator(&scene, Fidelity::Isolated, integrator);
        let rollout = run(&simulator, 300);
        let depth = -0.3 - rollout.samples()[300].q[0];
        let alone = 2.0 * GRAVITY / 2e5;
        println!("{integrator:?}: {:.6} of the depth on one", depth / alone);
        assert!((depth / alone - 0.5).abs() < 0.01);
    }
}

/// Pressed on its limit by a motor a joint reads as at rest, and all that is told of it is that of the body that it hangs on.
#[test]
fn what_rests_on_a_limit_reads_as_at_rest() {
    for integrator in CONTACT_INTEGRATORS {
        let mut scene = Scene::new(Fluid::fresh_water());
        let hull = Body::new(Shape::ellipsoid([0.3, 0.2, 0.15]).faces(80));
        scene.add(hull.density(998.0).named("hull"));
        let arm = Body::new(Shape::ellipsoid([0.15, 0.04, 0.04]).faces(80));
        scene.add(
            arm.density(998.0)
                .child_of("hull")
                .at([0.35, 0.0, 0.0])
                .shape_at([0.16, 0.0, 0.0], [0.0; 3])
                .joint(HINGE)
                .limits([-0.5, 0.5])
                .actuated(),
        );
        scene.controller = Some(Controller::Constant { control: vec![2.0] });
        let simulator = simulator(&scene, Fidelity::Isolated, integrator);
        let rollout = run(&simulator, 200);
        let (dt, q) = (simulator.time_step(), |n: usize| rollout.samples()[n].q[7]);
        let (moved, reads) = ((q(200) - q(199)) / dt, rollout.samples()[200].v[6]);
        println!("{integrator:?}: moves {moved:.1e}, reads {reads:.1e} rad/s");
        assert!((q(200) - 0.5).abs() < 1e-3, "{}", q(200));
        assert!(
            moved.abs() < 1e-4 && reads.abs() < 1e-4,
            "{integrator:?}: {moved} {reads}"
        );
    }
}
