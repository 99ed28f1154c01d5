//! Viscous water in thin gaps as bodies move: what terminal motions it leads to, that it makes no energy, and gradients through it.

use crate::support::says;
use hydrograd::adjoint::lie::Vec6;
use hydrograd::dynamics::Integrator;
use hydrograd::dynamics::force::{ForceModel, Loads, Place};
use hydrograd::scene::{Body, Contact, Fluid, Joint, Lubrication, Scene, Shape, Wall, WallSurface};
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::DVector;
use std::f64::consts::PI;

const GRAVITY: f64 = 9.81;

fn simulator(scene: &Scene) -> Simulator {
    Simulator::new(scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap()
}

fn run(scene: &Scene, steps: usize) -> Rollout {
    let sim = simulator(scene);
    sim.rollout(&Controls::zeros(&sim, steps)).unwrap()
}

/// A body at a gap over a floor, with viscous water of this viscosity between.
fn over_floor(body: Body, gap: f64, low: f64, viscosity: f64, roughness: f64) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 998.0,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    scene.add(body.at([0.0, 0.0, low + gap]));
    scene.add_force(Lubrication::new(roughness).viscosity(viscosity).into());
    scene
}

/// Energy may fall from state to state, but not rise, unless contact presses: what its springs hold isn't counted.
fn loses_energy(rollout: &Rollout) {
    let energies: Vec<f64> = rollout.samples().iter().map(|s| s.energy()).collect();
    let size = energies[0].abs().max(energies[energies.len() - 1].abs());
    assert!(energies.iter().all(|e| *e <= energies[0] + 1e-9 * size));
    for (n, pair) in energies.windows(2).enumerate() {
        let contacts = rollout.contacts(n, 0.0).unwrap();
        if contacts.iter().any(|c| c.force != [0.0; 3]) {
            continue;
        }
        assert!(
            pair[1] <= pair[0] + 1e-9 * size,
            "step {n}: {} to {}",
            pair[0],
            pair[1]
        );
    }
}

/// A disc that sinks onto a floor, at 0.01 s: soon ḣ = −2 F H³/(3πμR⁴), H = h + r, so that 1/H² grows evenly.
#[test]
fn a_disc_settles_as_lubrication_says() {
    let (radius, viscosity, roughness) = (0.05, 0.3, 1e-6);
    let disc = Body::new(Shape::cylinder(radius, 0.02).faces(1280))
        .named("disc")
        .density(2000.0);
    let scene = over_floor(disc, 2e-3, 0.01, viscosity, roughness);
    let rollout = run(&scene, 300);
    loses_energy(&rollout);
    let thickness = |n: usize| rollout.samples()[n].poses[0].translation.z - 0.01 + roughness;
    let force = (2000.0 - 998.0) * PI * radius.powi(2) * 0.02 * GRAVITY;
    let rate = 4.0 * force / (3.0 * PI * viscosity * radius.powi(4));
    let (from, to) = (150, 300);
    let grown = (thickness(to).powi(-2) - thickness(from).powi(-2)) / (0.01 * (to - from) as f64);
    let error = grown / rate - 1.0;
    // The mesh is a polygon, and steps are of first order.
    assert!(error.abs() < 0.03, "{grown} for {rate}: {error:+.4}");
    assert!(thickness(300) > 0.0 && thickness(300) < 0.5 * thickness(0));
    let flow = rollout.gap_flow().unwrap().expect("a gap");
    assert!(
        flow.lubricated && flow.viscous_over_inertial > 10.0,
        "{flow:?}"
    );
    assert!(flow.stokes.is_some_and(|s| s < 0.1), "{flow:?}");
    assert_eq!(flow.advice(), None);
}

/// A ball that falls on a floor with contact: from 6πμR²/h it slows down until it touches, in steps of any length, and never gains energy.
#[test]
fn a_ball_lands_softly_at_any_step() {
    for dt in [2e-3, 1e-2, 5e-2] {
        let ball = Body::new(Shape::sphere(0.02).faces(320))
            .named("ball")
            .density(3000.0);
        let mut scene = over_floor(ball, 0.01, 0.02, 0.5, 1e-5);
        scene.time_step = dt;
        scene.contact = Some(Contact {
            gap: Some(1e-4),
            ..Contact::default()
        });
        let rollout = run(&scene, (1.0 / dt) as usize);
        loses_energy(&rollout);
        let last = rollout.samples().last().unwrap();
        let height = last.poses[0].translation.z - 0.02;
        // Contact of the default stiffness, ten times the mass over Δt², gives way by a tenth of what weight does in a step.
        let sunk = 0.1 * GRAVITY * dt * dt;
        assert!((-sunk..3e-3).contains(&height), "{dt}: {height}");
        assert!(last.v.norm() < 0.01, "{dt}: {}", last.v);
    }
}

/// At rest contact carries the weight, and not the water that nothing moves: friction holds.
#[test]
fn what_rests_rests_on_contact() {
    let radius = 0.03;
    let disc = Body::new(Shape::cylinder(radius, 0.02).faces(320))
        .named("disc")
        .density(3000.0);
    let mut scene = over_floor(disc, 1e-4, 0.01, 1e-3, 1e-6);
    scene.contact = Some(Contact {
        gap: Some(1e-4),
        ..Contact::default()
    });
    let rollout = run(&scene, 200);
    let forces = rollout.contacts(199, 0.0).unwrap();
    let carried: f64 = forces.iter().map(|c| c.force[2]).sum();
    let weight = (3000.0 - 998.0) * simulator(&scene).system().bodies[0].volume * GRAVITY;
    assert!(
        (carried / weight - 1.0).abs() < 0.02,
        "{carried} for {weight}"
    );
}

/// Lengths in millimetres or kilometres: with the times and the viscosity that go with them all is the same.
#[test]
fn small_and_large_worlds_are_alike() {
    let path = |size: f64| {
        // t ~ √L, μ ~ L^(3/2).
        let disc = Body::new(Shape::cylinder(size, 0.4 * size).faces(320))
            .named("disc")
            .density(2000.0)
            .rotated([0.003, 0.002, 0.0]);
        let viscosity = 5.0 * size.powf(1.5);
        let mut scene = over_floor(disc, 0.02 * size, 0.2 * size, viscosity, 1e-4 * size);
        scene.contact = Some(Contact {
            stiction_speed: 1e-3 * size.sqrt(),
            ..Contact::default()
        });
        scene.time_step = 0.02 * size.sqrt();
        let rollout = run(&scene, 60);
        loses_energy(&rollout);
        let z = rollout
            .samples()
            .iter()
            .map(|s| s.poses[0].translation.z / size);
        z.collect::<Vec<f64>>()
    };
    let [one, small, large] = [1.0, 1e-3, 1e3].map(path);
    assert!(one[60] < 0.99 * one[0]);
    for other in [small, large] {
        for (a, b) in one.iter().zip(&other) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }
}

/// Two bodies give and take alike: total momentum stays, spinning and sliding along each other too.
#[test]
fn momentum_stays() {
    let mut scene = Scene::new(Fluid::none());
    let ball = |name: &str| {
        Body::new(Shape::sphere(0.1).faces(320))
            .named(name)
            .density(500.0)
    };
    scene.add(ball("a").at([0.01, 0.0, 0.0]));
    scene.add(ball("b").at([0.0, 0.02, 0.203]));
    scene.initial.v = vec![
        0.1, 0.2, 0.1, 0.5, -1.0, 2.0, //
        -0.2, 0.1, -0.3, -1.5, 0.5, 1.0,
    ];
    scene.add_force(Lubrication::new(1e-5).viscosity(2.0).into());
    let rollout = run(&scene, 50);
    loses_energy(&rollout);
    let summary = rollout.summary();
    let drift = summary.momentum_drift.unwrap();
    assert!(drift < 1e-10, "{drift}");
    assert!(summary.energy_final < 0.9 * summary.energy_initial);
}

/// Gradients of a rollout in which a finger presses water out from under it, through contact: against differences.
#[test]
fn gradients_through_a_closing_gap() {
    let block = Body::new(Shape::cuboid([0.06, 0.05, 0.04]).faces(100))
        .named("block")
        .density(2500.0)
        .rotated([0.01, 0.02, 0.3]);
    let mut scene = over_floor(block, 2e-3, 0.0215, 0.3, 1e-4);
    scene.contact = Some(Contact {
        gap: Some(1e-3),
        ..Contact::default()
    });
    let axis = [0.0, 0.0, 1.0];
    let finger = Body::new(Shape::sphere(0.02).faces(200))
        .named("finger")
        .mass(0.3);
    scene.add(
        finger
            .joint(Joint::Prismatic { axis })
            .at([0.003, 0.002, 0.07])
            .actuated(),
    );
    let mut sim = simulator(&scene);
    let settings = gradcheck::GradcheckSettings {
        steps: 20,
        directions: 1,
        seed: 1,
        timings: 0,
        enough: Some(1e-6),
    };
    let report = gradcheck(&mut sim, &settings).unwrap();
    assert!(report.max_rel_error < 1e-6, "{report:?}");
}

/// Water in a gap that nobody made viscous: what the summary of a run says of it.
#[test]
fn a_run_tells_which_rules() {
    let ball = Body::new(Shape::sphere(0.005).faces(320))
        .named("ball")
        .density(2000.0);
    let mut scene = over_floor(ball, 1e-4, 0.005, 1e-3, 1e-6);
    scene.forces.clear();
    scene.time_step = 1e-3;
    let rollout = run(&scene, 4);
    let flow = rollout.gap_flow().unwrap().expect("a gap");
    assert_eq!(flow.bodies, ("ball".into(), None));
    assert!(!flow.lubricated);
    let gap = |n: usize| rollout.gaps()[n].unwrap().distance;
    let speed = (0..4)
        .map(|n| (gap(n + 1) - gap(n)).abs() / 1e-3)
        .fold(0.0, f64::max);
    assert!((flow.speed / speed - 1.0).abs() < 1e-12);
    let reynolds = flow.gap * speed * 998.0 / 1.0016e-3;
    assert!((flow.film_reynolds / reynolds - 1.0).abs() < 1e-12);
    assert!((flow.viscous_over_inertial * reynolds / 24.0 - 1.0).abs() < 1e-12);
    // Davis' number, m |ḣ|/(6πμR²), with the added mass of a sphere.
    let mass = (2000.0 + 499.0) * 4.0 / 3.0 * PI * 0.005_f64.powi(3);
    let stokes = mass * speed / (6.0 * PI * 1.0016e-3 * 0.005_f64.powi(2));
    let found = flow.stokes.unwrap();
    assert!((found / stokes - 1.0).abs() < 0.06, "{found} for {stokes}");
    assert!(flow.advice().is_some());
    // A force whose reach ends before the gap doesn't act there, and so the run is told the same.
    let film = |reach: f64| Lubrication::new(1e-6).reach(reach).into();
    scene.forces = vec![film(0.5e-4)];
    let short = run(&scene, 4).gap_flow().unwrap().expect("a gap");
    assert!(!short.lubricated && short.advice().is_some(), "{short:?}");
    scene.forces = vec![film(2e-3)];
    assert!(
        run(&scene, 4)
            .gap_flow()
            .unwrap()
            .is_some_and(|f| f.lubricated)
    );
}

/// What forces of viscous water tie together where a run starts, and the wrenches that they put on bodies which move with these twists.
fn ties_and_wrenches(sim: &Simulator, twists: &[Vec6]) -> (Vec<[usize; 2]>, Vec<Vec6>) {
    let system = sim.system();
    let rollout = sim.rollout(&Controls::zeros(sim, 1)).unwrap();
    let (start, v) = (&rollout.samples()[0], DVector::zeros(6 * twists.len()));
    let place = Place {
        poses: &start.poses,
        q: &start.q,
        time: 0.0,
        parameters: sim.parameters(),
    };
    let mut forces = system.forces.iter();
    let force: &dyn ForceModel = forces.find(|f| f.name() == "lubrication").unwrap().as_ref();
    let control = DVector::zeros(0);
    let mut loads = Loads::zeros(twists.len(), v.len());
    force.add(&system.moving(place, twists, &v, &control), &mut loads);
    (force.ties_at(&place).unwrap(), loads.wrenches)
}

/// Of many bodies those alone are tied, and looked at, that have water between them; it does there what it does where there are no others.
#[test]
fn only_near_bodies_are_tied() {
    let place = |b: usize| match b % 4 {
        // Two at a gap of 1 mm, one at 30 mm, past the film's reach, and one far away.
        1 => [0.5 * (b - 1) as f64, 0.041, 0.0],
        2 => [0.5 * (b - 2) as f64, -0.07, 0.0],
        _ => [0.5 * b as f64, 0.0, 0.0],
    };
    let made = |bodies: &[usize]| {
        let mut scene = Scene::new(Fluid::none());
        scene.time_step = 1e-3;
        for b in bodies {
            let ball = Body::new(Shape::sphere(0.02).faces(320)).density(1200.0);
            scene.add(ball.named(format!("{b}")).at(place(*b)));
            scene.initial.v.extend([0.0; 3]);
            scene
                .initial
                .v
                .extend([0.01 * (*b as f64).cos(), -0.02, 0.003 * *b as f64]);
        }
        scene.add_force(Lubrication::new(1e-5).viscosity(1.0).into());
        scene
    };
    let twist = |b: &usize| Vec6::from_fn(|i, _| ((7 * b + i) as f64).sin());
    let all: Vec<usize> = (0..32).collect();
    let twists: Vec<Vec6> = all.iter().map(twist).collect();
    let many = made(&all);
    let (ties, wrenches) = ties_and_wrenches(&simulator(&many), &twists);
    let mut tied: Vec<[usize; 2]> = ties;
    tied.iter_mut().for_each(|pair| pair.sort_unstable());
    let near = all.chunks(4).map(|four| [four[0], four[1]]);
    assert_eq!(tied, near.clone().collect::<Vec<_>>());
    let last = |scene: &Scene| run(scene, 3).samples()[3].clone();
    let moved = last(&many);
    for pair in near {
        let two = made(&pair);
        let (_, own) = ties_and_wrenches(&simulator(&two), &pair.map(|b| twist(&b)));
        let after = last(&two);
        for (k, b) in pair.into_iter().enumerate() {
            assert!(own[k].norm() > 1e-3);
            assert_eq!(own[k], wrenches[b]);
            let [one, other] = [after.v.rows(6 * k, 6), moved.v.rows(6 * b, 6)];
            assert!(
                (one - other).amax() < 1e-9 * one.amax(),
                "{b}: {one} {other}"
            );
        }
        for b in pair.map(|b| b + 2) {
            assert_eq!(wrenches[b], Vec6::zeros());
        }
    }
}

/// A pressure that numbers don't hold is an error that names the gap: it was taken for an open one, in which nothing resists.
#[test]
fn what_has_no_pressure_is_refused() {
    let disc = Body::new(Shape::cylinder(0.03, 0.02).faces(320))
        .named("disc")
        .density(2000.0);
    let scene = over_floor(disc, -1e-6, 0.01, 1e-3, 1e-140);
    let sim = simulator(&scene);
    let error = sim.rollout(&Controls::zeros(&sim, 1)).err().unwrap();
    let words = ["lubrication between body \"disc\" and a wall", "roughness"];
    says(&error, &words);
}

/// A long cylinder all but on a floor has a narrow film that no faces resolve: the run says so, and nothing of the spot under a ball.
#[test]
fn a_film_that_faces_do_not_resolve_is_told() {
    let told = |shape: Shape, gap: f64| {
        let body = Body::new(shape.faces(320)).named("log").density(1200.0);
        let body = body.rotated([0.5 * PI, 0.0, 0.0]);
        run(&over_floor(body, gap, 0.02, 1e-3, 1e-12), 1).warnings()
    };
    let is_coarse = |w: &&String| w.contains("isn't resolved") && w.contains("lubrication");
    let narrow = told(Shape::cylinder(0.02, 4.0), 1e-7);
    let found = narrow.iter().find(is_coarse).expect("a warning");
    for words in ["body \"log\" and a wall", "m apart", "times"] {
        assert!(found.contains(words), "{found}");
    }
    let round = told(Shape::sphere(0.02), 2e-5);
    assert_eq!(round.iter().find(is_coarse), None);
}

/// What a scene may not say, and with what it may not be stepped.
#[test]
fn wrong_values_are_refused() {
    let ball = || {
        Body::new(Shape::sphere(0.1).faces(80))
            .named("ball")
            .density(2000.0)
    };
    let refused = |force: Lubrication, words: &[&str]| {
        let mut scene = over_floor(ball(), 0.1, 0.1, 1.0, 1e-5);
        scene.forces = vec![force.into()];
        says(scene.validate().unwrap_err(), words);
    };
    refused(
        Lubrication::new(0.0),
        &["forces[0].roughness", "above zero"],
    );
    refused(Lubrication::new(f64::NAN), &["forces[0].roughness"]);
    refused(Lubrication::new(1e-5).reach(-1.0), &["forces[0].reach"]);
    refused(
        Lubrication::new(1e-5).viscosity(-1.0),
        &["forces[0].viscosity", "Pa·s"],
    );
    refused(
        Lubrication::new(1e-5).of(["cube"]),
        &["forces[0].bodies", "\"cube\"", "ball"],
    );
    let scene = over_floor(ball(), 0.1, 0.1, 1.0, 1e-5);
    let rk4 = Settings::default().integrator(Integrator::Rk4);
    let error = Simulator::new(&scene, rk4).err().unwrap();
    says(&error, &["lubrication 1", "momentum-euler"]);
    assert_eq!(
        simulator(&scene).choices().integrator,
        Integrator::MomentumEuler
    );
}

/// A force of viscous water acts neither between neighbours in a chain nor at a free surface, which gives way.
#[test]
fn a_run_tells_where_no_film_can_be() {
    let oval = |x| {
        let body = Body::new(Shape::ellipsoid([0.1, 0.04, 0.04]).faces(320)).density(1100.0);
        body.at([x, 0.0, 0.0])
    };
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.add(oval(0.0).named("front"));
    let hinge = Joint::Revolute {
        axis: [0.0, 0.0, 1.0],
    };
    let tail = oval(0.203).named("tail").child_of("front");
    scene.add(tail.joint(hinge));
    scene.add_force(Lubrication::new(1e-6).into());
    let flow = run(&scene, 2).gap_flow().unwrap().expect("a gap");
    assert_eq!(flow.bodies, ("front".into(), Some("tail".into())));
    assert!(!flow.lubricated);

    scene.bodies.truncate(1);
    scene.walls.push(Wall {
        surface: WallSurface::Free,
        ..Wall::rigid([0.0, 0.0, 0.05], [0.0, 0.0, -1.0])
    });
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 2)).unwrap();
    assert!(rollout.gaps()[0].is_some() && rollout.gap_flow().unwrap().is_none());
}
