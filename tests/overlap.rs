//! Links that touch or overlap at their joint: refused unless declared, and what is declared.

use hydrograd::scene::{Body, Controller, Fluid, Joint, Plane, Scene, Shape};
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};

/// Two capsules that share a round end at their hinge, and a coin beside them.
fn linked(declared: bool) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.name = "linked".into();
    let capsule = || Body::new(Shape::capsule(0.05, 0.2).faces(100)).density(1200.0);
    let upper = capsule()
        .named("upper")
        .joint(Joint::Planar { plane: Plane::Yz });
    scene.add(upper);
    let hinge = Joint::Revolute {
        axis: [1.0, 0.0, 0.0],
    };
    let mut lower = capsule()
        .named("lower")
        .child_of("upper")
        .at([0.0, 0.0, -0.1])
        .shape_at([0.0, 0.0, -0.1], [0.0; 3])
        .joint(hinge)
        .actuated();
    lower.overlaps_parent = declared;
    scene.add(lower);
    let coin = Body::new(Shape::ellipsoid([0.06, 0.02, 0.06]).faces(80)).density(1200.0);
    scene.add(coin.named("coin").at([0.0, 0.15, -0.2]));
    scene.controller = Some(Controller::Constant { control: vec![0.3] });
    scene.initial.v = vec![0.1, 0.0, 0.5, -0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    scene
}

fn full() -> Settings {
    Settings::default().fidelity(Fidelity::Full)
}

fn refused(scene: &Scene) -> String {
    let error = Simulator::new(scene, full()).err().unwrap();
    error.to_string()
}

fn has(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "no {word:?} in: {message}");
    }
}

#[test]
fn overlap_that_is_not_declared_is_refused_with_the_way_to_declare_it() {
    let message = refused(&linked(false));
    let declare = "`overlaps_parent = true` for body \"lower\"";
    has(
        &message,
        &["\"upper\" and body \"lower\"", "overlap", declare],
    );
    // Bodies of which neither carries the other have no such way.
    let mut scene = linked(true);
    scene.bodies[2].placement.position = [0.0, 0.05, 0.0];
    let message = refused(&scene);
    has(&message, &["coin", "overlap", "move them apart"]);
    assert!(!message.contains("overlaps_parent"), "{message}");
}

#[test]
fn declared_links_run_and_feel_all_but_each_other() {
    let scene = linked(true);
    let simulator = Simulator::new(&scene, full().tolerance(1e-12)).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 20)).unwrap();
    assert_eq!(rollout.warnings(), Vec::<String>::new());
    // The gap that counts is that to the coin.
    let gap = rollout.summary().min_gap.unwrap();
    assert!(gap > 0.03 && gap < 0.15, "{gap}");
    // The coin is moved through the water, without a push of its own.
    let moved = rollout.samples()[20].q.rows(4, 3) - rollout.samples()[0].q.rows(4, 3);
    assert!(moved.norm() > 1e-4, "{moved}");
    // The hinge's own torque moves no momentum in or out.
    let drift = rollout.summary().momentum_drift;
    assert!(drift < 1e-9, "{drift}");

    // Alone the two have their own added masses and nothing between.
    let mut pair = scene.clone();
    pair.bodies.truncate(2);
    pair.initial.v.truncate(4);
    let of = |fidelity| {
        let settings = full().tolerance(1e-12).fidelity(fidelity);
        let added = Simulator::new(&pair, settings).unwrap().added_mass();
        added.unwrap().matrix
    };
    let (coupled, own) = (of(Fidelity::Full), of(Fidelity::Isolated));
    assert!((&coupled - &own).amax() < 1e-9 * own.amax());
    assert_eq!(coupled.view((0, 6), (6, 6)).amax(), 0.0);
    // With the coin something comes back from it.
    let m = simulator.added_mass().unwrap().matrix;
    assert!((&m - m.transpose()).amax() < 1e-12 * m.amax());
    assert!(m.view((0, 6), (6, 6)).amax() > 1e-5 * m.amax());
    assert!(m.symmetric_eigenvalues().min() > 0.0);
}

#[test]
fn the_gradient_is_exact_with_declared_links() {
    for wall in [false, true] {
        let mut scene = linked(true);
        if wall {
            scene.add_wall([0.0, 0.0, -0.5], [0.0, 0.0, 1.0]);
        }
        let settings = full().tolerance(1e-13).faces(80);
        let mut simulator = Simulator::new(&scene, settings).unwrap();
        let report = gradcheck(
            &mut simulator,
            &gradcheck::Settings {
                steps: 8,
                directions: 2,
                seed: 7,
                timings: 0,
            },
        )
        .unwrap();
        println!("wall {wall}: {:.1e}", report.max_rel_error);
        assert!(report.max_rel_error <= 1e-6, "{:#?}", report.directions);
    }
}

#[test]
fn touching_links_warn_with_the_way_to_declare_them() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let cube = || Body::new(Shape::cuboid([0.2; 3]).faces(80)).density(1200.0);
    scene.add(cube().named("base"));
    let slide = Joint::Prismatic {
        axis: [0.0, 1.0, 0.0],
    };
    scene.add(
        cube()
            .named("slide")
            .child_of("base")
            .at([0.2, 0.0, 0.0])
            .joint(slide),
    );
    scene.initial.v = vec![0.0; 6];
    scene.initial.v.push(0.1);
    let warnings = |scene: &Scene| {
        let simulator = Simulator::new(scene, full()).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 2)).unwrap();
        rollout.warnings()
    };
    let narrow = warnings(&scene);
    assert_eq!(narrow.len(), 1, "{narrow:?}");
    has(
        &narrow[0],
        &[
            "narrower than half",
            "`overlaps_parent = true` for body \"slide\"",
        ],
    );
    scene.bodies[1].overlaps_parent = true;
    assert_eq!(warnings(&scene), Vec::<String>::new());
}

#[test]
fn declared_links_may_not_lie_within_each_other() {
    let mut scene = linked(true);
    // The lower capsule's middle comes to lie 0.06 below the upper one's: three quarters are inside.
    scene.bodies[1].placement.position = [0.0, 0.0, 0.04];
    let message = refused(&scene);
    has(
        &message,
        &["\"upper\"", "\"lower\"", "part of its volume", "up to half"],
    );
    // Also when they get there in a run.
    let mut scene = linked(true);
    scene.bodies[1].joint = Joint::Prismatic {
        axis: [0.0, 0.0, 1.0],
    };
    scene.initial.v[3] = 2.0;
    let simulator = Simulator::new(&scene, full()).unwrap();
    let error = simulator
        .rollout(&Controls::zeros(&simulator, 20))
        .err()
        .unwrap();
    has(
        &error.to_string(),
        &["t = 0.", "part of its volume", "limit 5.000000e-1"],
    );
}

/// The body with a shape that carries it, past those without; also one that it's fixed to.
#[test]
fn the_overlapping_parent_is_the_nearest_with_a_shape() {
    let mut scene = linked(true);
    let mut dry = Body::dry().named("gimbal").mass(0.0).inertia([0.0; 3]);
    dry.parent = Some("upper".into());
    dry.joint = Joint::Revolute {
        axis: [0.0, 1.0, 0.0],
    };
    dry.placement = scene.bodies[1].placement;
    scene.bodies[1].placement = Default::default();
    scene.bodies[1].parent = Some("gimbal".into());
    scene.bodies.insert(1, dry);
    scene.initial.v.insert(3, 0.0);
    let run = |scene: &Scene| {
        let simulator = Simulator::new(scene, full()).unwrap();
        let steps = simulator.rollout(&Controls::zeros(&simulator, 3)).unwrap();
        steps.warnings()
    };
    assert_eq!(run(&scene), Vec::<String>::new());
    scene.bodies[2].overlaps_parent = false;
    has(
        &refused(&scene),
        &["`overlaps_parent = true` for body \"lower\""],
    );

    let mut hull = linked(true);
    hull.bodies[1].joint = Joint::Fixed;
    hull.bodies[1].actuated = false;
    hull.controller = None;
    hull.initial.v.remove(3);
    assert_eq!(run(&hull), Vec::<String>::new());
    hull.bodies[1].overlaps_parent = false;
    has(
        &refused(&hull),
        &["overlap", "`overlaps_parent = true` for body \"lower\""],
    );
}

#[test]
fn isolated_bodies_may_overlap_and_are_told_of_it_unless_declared() {
    for declared in [false, true] {
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let simulator = Simulator::new(&linked(declared), settings).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 3)).unwrap();
        assert_eq!(rollout.warnings().is_empty(), declared);
    }
}
