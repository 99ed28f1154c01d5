//! Every scene of `examples/scenes`, and scenes written in Rust.

use std::path::{Path, PathBuf};

use hydrograd::{Controls, Fidelity, Settings, Simulator};

use hydrograd::scene::{
    Body, Controller, Drag, DragPart, Fluid, Joint, Motion, Placement, Plane, Preset, Scene, Shape,
};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes")
}

fn example(name: &str) -> Scene {
    Scene::load(folder().join(format!("{name}.toml"))).unwrap()
}

#[test]
fn every_example_scene_loads_validates_and_survives_a_round_trip() {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        let scene = Scene::load(&path).unwrap_or_else(|e| panic!("{e}"));
        scene
            .validate()
            .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let again = Scene::from_toml(&scene.to_toml().unwrap(), "").unwrap();
        assert_eq!(again, scene, "{}", path.display());
        found.push(path.file_stem().unwrap().to_str().unwrap().to_owned());
    }
    for name in [
        "coins",
        "cube",
        "falling_ball",
        "falling_ball_box",
        "fish",
        "kirchhoff_ellipsoid",
        "two_spheres",
    ] {
        assert!(found.iter().any(|f| f == name), "{name} is missing");
    }
}

#[test]
fn falling_ball_has_the_papers_figures() {
    let scene = example("falling_ball");
    let boxed = example("falling_ball_box");
    assert_eq!(
        (scene.coordinates(), scene.velocities(), scene.controls()),
        (4, 4, 1)
    );
    assert_eq!(scene.walls.len(), 1);
    assert_eq!(scene.initial, boxed.initial);
    assert_eq!(scene.bodies[..2], boxed.bodies[..2]);
    let Some(Controller::PushThenLock { force, .. }) = scene.controller else {
        panic!("push-then-lock expected");
    };
    assert_eq!(force, -0.19e4 * (148.0_f64 / 156.0).powi(2));
    // The floor's top is the wall.
    let floor = boxed.body("floor").unwrap();
    let top = boxed.bodies[floor.0].placement.position[2] + 0.5;
    assert!((top - scene.walls[0].point[2]).abs() < 1e-12);
    // Within 1 % of the paper's 3582 faces.
    let faces: usize = boxed
        .bodies
        .iter()
        .map(|body| {
            let shape = body.shape.as_ref().unwrap();
            let mesh = hydrograd::shape::build(shape, Path::new(""), None).unwrap();
            mesh.faces().len()
        })
        .sum();
    assert!(faces.abs_diff(3582) <= 35, "{faces} faces");
}

/// Lamb's coefficients of the fish's links, carried from the link's centre to its hinge.
#[test]
fn fish_added_mass_is_that_of_its_links() {
    let scene = example("fish");
    let own = scene.bodies[0].added_mass.clone().unwrap();
    for body in &scene.bodies {
        let x = body.shape_at.position[0];
        let given = body.added_mass.as_ref().unwrap();
        let mut expected = own.clone();
        // u_center = u_hinge + ω × (x, 0, 0)
        expected[1][5] = own[1][1] * x;
        expected[5][1] = own[1][1] * x;
        expected[2][4] = -own[2][2] * x;
        expected[4][2] = -own[2][2] * x;
        expected[4][4] += own[2][2] * x * x;
        expected[5][5] += own[1][1] * x * x;
        for (row, right) in given.iter().zip(&expected) {
            for (a, b) in row.iter().zip(right) {
                assert!((a - b).abs() < 1e-17, "{}: {a} against {b}", body.name);
            }
        }
    }
}

#[test]
fn built_scenes_are_as_documented() {
    let mut scene = Scene::new(Fluid::fresh_water());
    assert_eq!(
        (scene.time_step, scene.steps, scene.gravity),
        (0.01, 100, [0.0; 3])
    );
    assert_eq!(Fluid::none().density, 0.0);
    let ball = scene.add(
        Body::new(Shape::sphere(0.1).faces(320))
            .density(998.0)
            .thruster(),
    );
    scene.add(
        Body::new(Shape::cuboid([1.0, 1.0, 0.1]))
            .fixed()
            .named("body 3"),
    );
    let capsule = scene.add(
        Body::new(Shape::capsule(0.1, 0.4))
            .mass(3.0)
            .at([0.0, 0.0, 2.0])
            .rotated([0.1, 0.0, 0.0])
            .joint(Joint::Spherical)
            .child_of("body 1")
            .actuated(),
    );
    assert_eq!(scene.bodies[ball.0].name, "body 1");
    assert_eq!(scene.bodies[capsule.0].name, "body 4", "body 3 is taken");
    assert_eq!(
        (scene.coordinates(), scene.velocities(), scene.controls()),
        (11, 9, 9)
    );
    assert_eq!(scene.coordinate_labels()[10], "body 4.qz");
    assert_eq!(scene.velocity_labels()[8], "body 4.wz");
    scene.validate().unwrap();
    scene.set_faces(80);
    assert_eq!(scene.bodies[0].shape, Some(Shape::sphere(0.1).faces(80)));
}

#[test]
fn joint_dimensions() {
    let axis = [1.0, 0.0, 0.0];
    for (joint, nq, nv) in [
        (Joint::Fixed, 0, 0),
        (Joint::Prismatic { axis }, 1, 1),
        (Joint::Revolute { axis }, 1, 1),
        (Joint::Planar { plane: Plane::Zx }, 3, 3),
        (Joint::Spherical, 4, 3),
        (Joint::Free, 7, 6),
    ] {
        assert_eq!(
            (joint.coordinates(), joint.velocities()),
            (nq, nv),
            "{joint:?}"
        );
        assert_eq!(joint.coordinate_labels().len(), nq);
        assert_eq!(joint.velocity_labels().len(), nv);
        assert_eq!(joint.origin().len(), nq);
    }
}

/// Every field of every struct away from its default, so that none is lost on the way.
#[test]
fn everything_survives_a_round_trip() {
    let axis = [0.0, 1.0, 1.0 / 3.0];
    let sine = Motion::Sine {
        offset: 0.1,
        amplitude: 1e-7,
        frequency: 3.0,
        phase: 0.3,
    };
    let mut scene = Scene::new(Fluid {
        density: 1000.0 / 3.0,
        current: [0.1, 0.2, 0.0],
    });
    scene.name = "all \"of\" it\nis here".into();
    scene.gravity = [0.0, 0.0, -9.81];
    scene.preset = Preset::Paper;
    scene.add_wall([0.0, 0.0, -1.0], [0.0, 0.0, 2.0]);
    let drag = Drag {
        part: DragPart::Total,
        linear: 1.0,
        quadratic_part: DragPart::Normal,
        quadratic: 0.5,
    };
    let joints = [
        Joint::Fixed,
        Joint::Prismatic { axis },
        Joint::Revolute { axis },
        Joint::Planar { plane: Plane::Yz },
        Joint::Spherical,
        Joint::Free,
        Joint::Fixed,
    ];
    let shapes = [
        Shape::sphere(0.1).faces(7),
        Shape::ellipsoid([0.1, 0.2, 0.3]),
        Shape::cuboid([0.1, 0.2, 0.3]),
        Shape::cylinder(0.1, 0.2),
        Shape::capsule(0.1, 0.2).faces(9),
        Shape::mesh("hull.obj"),
        Shape::prism([[0.0, 0.0], [0.1, 1e-9], [0.0, 1.0 / 3.0]], 0.7).faces(11),
    ];
    for (joint, shape) in joints.into_iter().zip(shapes) {
        let mut identity = [[0.0; 6]; 6];
        (0..6).for_each(|i| identity[i][i] = 1.0 / 7.0);
        let mut body = Body::new(shape)
            .joint(joint)
            .mass(2.0)
            .inertia([1.0, 1.0, 1.0, 0.0, 0.1, 0.0])
            .center_of_mass([0.0, 0.1, 0.0])
            .added_mass(identity)
            .at([1.0, 2.0, 3.0])
            .rotated([0.1, 0.2, 0.3])
            .shape_at([0.1, 0.0, 0.0], [0.0, 0.0, 1.0])
            .drag(drag)
            .driven([
                Motion::Linear {
                    offset: 0.0,
                    rate: 1.0,
                },
                sine,
            ])
            .actuated()
            .locked()
            .thruster();
        body.parent = scene.bodies.last().map(|b| b.name.clone());
        scene.add(body);
    }
    scene.bodies[0].placement = Placement::new([0.0; 3], [0.0, 0.0, 1.0]);
    scene.initial.q = vec![0.1, 1e-300];
    scene.initial.v = vec![-1.0];
    scene.initial.momentum = vec![f64::MIN_POSITIVE];
    let controllers = [
        Controller::Constant { control: vec![1.0] },
        Controller::Pd {
            target: vec![1.0],
            stiffness: vec![2.0],
            damping: vec![3.0],
        },
        Controller::PushThenLock {
            body: "body 2".into(),
            force: -1.0,
            stop_at: 0.5,
        },
    ];
    for controller in controllers {
        scene.controller = Some(controller);
        let text = scene.to_toml().unwrap();
        assert_eq!(Scene::from_toml(&text, "").unwrap(), scene, "{text}");
    }
}

#[test]
fn mesh_paths_are_relative_to_the_scene_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let text = "time_step = 1\nsteps = 1\n[fluid]\ndensity = 1\n[[bodies]]\nname = \"a\"\n\
                density = 1\nshape = { kind = \"mesh\", path = \"parts/hull.obj\" }\n";
    std::fs::write(&path, text).unwrap();
    let scene = Scene::load(&path).unwrap();
    let hull = Shape::mesh(folder.path().join("parts/hull.obj"));
    assert_eq!(scene.bodies[0].shape, Some(hull));
}

#[test]
fn every_example_scene_runs_at_every_fidelity() {
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let scene = Scene::load(&path).unwrap();
        // The fish's links touch at their hinges and have their added mass given.
        let fidelities = match scene.name.as_str() {
            name if name.contains("fish") => vec![Fidelity::Isolated],
            _ => vec![
                Fidelity::Isolated,
                Fidelity::Reduced,
                Fidelity::Auto,
                Fidelity::Full,
            ],
        };
        for fidelity in fidelities {
            let settings = Settings::for_scene(&scene).fidelity(fidelity).faces(80);
            let simulator = Simulator::new(&scene, settings)
                .unwrap_or_else(|e| panic!("{} {fidelity:?}: {e}", path.display()));
            let rollout = simulator
                .rollout(&Controls::zeros(&simulator, 5))
                .unwrap_or_else(|e| panic!("{} {fidelity:?}: {e}", path.display()));
            assert_eq!(rollout.steps(), 5);
            assert!(rollout.samples()[5].energy().is_finite());
        }
    }
}

/// The coin is turned by the flow of the approaching sphere before anything touches, and isn't where
/// bodies don't feel each other.
#[test]
fn falling_ball_turns_the_coin_through_the_water_alone() {
    let scene = example("falling_ball");
    let stop = match scene.controller {
        Some(Controller::PushThenLock { stop_at, .. }) => stop_at,
        _ => panic!("push-then-lock expected"),
    };
    let run = |fidelity| {
        let settings = Settings::for_scene(&scene).fidelity(fidelity).faces(80);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let rollout = simulator
            .rollout(&Controls::zeros(&simulator, 200))
            .unwrap();
        let mut history = Vec::new();
        for s in rollout.samples() {
            // Between the nearest points: sphere to coin (bounded by its largest semi-axis, so a
            // lower bound), coin to floor.
            let (sphere, coin) = (s.poses[0].translation, s.poses[1].translation);
            let axis = s.poses[1].rotation.column(1).into_owned();
            let reach = |d: nalgebra::Vector3<f64>| {
                let across = axis.dot(&d);
                (0.03_f64.powi(2) * across.powi(2)
                    + 0.2_f64.powi(2) * (d.norm_squared() - across.powi(2)))
                .sqrt()
            };
            let apart = coin - sphere;
            // Support of the coin towards the sphere's centre: separated if the gap is positive.
            let pair = apart.norm() - 0.6 - reach(apart / apart.norm());
            let floor = coin.z + 0.98 - reach(nalgebra::Vector3::z());
            history.push((s.q[0], s.q[3] - scene.initial.q[3], pair.min(floor)));
        }
        history
    };
    let full = run(Fidelity::Full);
    let isolated = run(Fidelity::Isolated);
    assert!(
        full.iter().any(|x| x.0 < stop),
        "the sphere isn't stopped within 2 s"
    );
    for (n, x) in full.iter().enumerate().step_by(20) {
        println!(
            "{:.2} s: sphere {:.3} angle {:.3e} gap {:.3}",
            0.01 * n as f64,
            x.0,
            x.1,
            x.2
        );
    }
    let turned = full
        .iter()
        .take_while(|x| x.2 > 0.0)
        .map(|x| x.1.abs())
        .fold(0.0, f64::max);
    let alone = isolated.iter().map(|x| x.1.abs()).fold(0.0, f64::max);
    println!("turned {turned} rad before contact, {alone} alone");
    assert!(
        turned > 0.01,
        "turned only {turned} rad before anything touches"
    );
    assert_eq!(alone, 0.0, "turned by itself");
}
