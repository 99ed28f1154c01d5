//! Every scene of `examples/scenes`, and scenes written in Rust.

use crate::support::{example, example_scenes, root};
use std::path::Path;

use hydrograd::{Controls, Fidelity, Settings, Simulator};

use hydrograd::scene::{
    Body, Controller, Current, Drag, DragPart, Edge, Fluid, Joint, Motion, Placement, Plane,
    Preset, Scene, Shape, Tendon,
};

#[test]
fn every_example_scene_loads_validates_and_survives_a_round_trip() {
    let mut found = Vec::new();
    for path in example_scenes() {
        let scene = Scene::load(&path).unwrap_or_else(|e| panic!("{e}"));
        scene
            .validate()
            .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let again = Scene::from_toml(&scene.to_toml().unwrap(), "").unwrap();
        assert_eq!(again, scene, "{}", path.display());
        found.push(path.file_stem().unwrap().to_str().unwrap().to_owned());
    }
    for name in [
        "clown_fish",
        "coins",
        "cube",
        "falling_ball",
        "falling_ball_box",
        "fish",
        "fish_near_tail",
        "grasp_open",
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
    let faces = faces(&boxed).iter().sum::<usize>();
    assert!(faces.abs_diff(3582) <= 35, "{faces} faces");
}

/// Numbers of faces of the bodies.
fn faces(scene: &Scene) -> Vec<usize> {
    let shapes = scene.bodies.iter().map(|body| body.shape.as_ref().unwrap());
    let count = |shape| {
        let mesh = hydrograd::shape::build(shape, Path::new(""), None).unwrap();
        mesh.faces().len()
    };
    shapes.map(count).collect()
}

/// Bodies, degrees of freedom (driven joints among them) and faces of the published table; the faces
/// to 1 %.
#[test]
fn scenes_have_the_papers_figures() {
    for (name, bodies, freedom, published) in [
        ("grasp_open", 4, 6, 3768),
        ("fish_near_tail", 4, 6, 5144),
        ("clown_fish", 4, 8, 4646),
    ] {
        let scene = example(name);
        let faces = faces(&scene);
        let sum: usize = faces.iter().sum();
        println!("{name}: {faces:?}, {sum} faces for {published}");
        assert_eq!((scene.bodies.len(), scene.velocities()), (bodies, freedom));
        assert!(sum.abs_diff(published) * 100 <= published, "{name}: {sum}");
        assert_eq!(
            (scene.gravity, scene.time_step, scene.steps),
            ([0.0; 3], 0.01, 250)
        );
        // The file says how many there are.
        let text =
            std::fs::read_to_string(root().join("examples/scenes").join(format!("{name}.toml")))
                .unwrap();
        assert!(text.contains(&format!("= {sum} faces)")), "{name}: {sum}");
    }
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
            .named("body 2"),
    );
    let capsule = scene.add(
        Body::new(Shape::capsule(0.1, 0.4))
            .mass(3.0)
            .at([0.0, 0.0, 2.0])
            .rotated([0.1, 0.0, 0.0])
            .joint(Joint::Spherical)
            .child_of("body 0")
            .actuated(),
    );
    assert_eq!(scene.bodies[ball.0].name, "body 0");
    assert_eq!(scene.bodies[capsule.0].name, "body 3", "body 2 is taken");
    assert_eq!(
        (scene.coordinates(), scene.velocities(), scene.controls()),
        (11, 9, 9)
    );
    assert_eq!(scene.coordinate_labels()[10], "body 3.qz");
    assert_eq!(scene.velocity_labels()[8], "body 3.wz");
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
        (Joint::Screw { axis, pitch: 0.1 }, 1, 1),
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
        Joint::Screw { axis, pitch: -0.1 },
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
            .overlaps_parent()
            .driven([
                Motion::Linear {
                    offset: 0.0,
                    rate: 1.0,
                },
                sine.clone(),
                Motion::through(vec![0.0, 0.1, 1.0 / 3.0], vec![0.2, 1e-9, -1.0]).unwrap(),
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
    let edge = Edge::new("body 1").named("rim").at([0.1, 0.2, 1e-9]);
    let edge = edge.forward([1.0, 0.0, 0.5]).normal([0.0, 1.0, 0.0]);
    scene.add_force(edge.span(1.0 / 3.0).factor(0.3).smoothing(0.0).into());
    let tendon = Tendon::new([("body 1", 0.1), ("body 2", -1.0 / 3.0)]);
    let tendon = tendon.named("crank").stiffness(4e3).damping(2.0);
    scene.add_force(tendon.gain(0.03).into());
    let tide = Motion::through(vec![0.0, 1.0 / 3.0, 2.0], vec![0.1, -0.2, 1e-9]).unwrap();
    let stream = Current::new([0.1, 0.0, 0.0]).profile(vec![[-0.1, 1.0], [7.0, 1.0 / 3.0]]);
    scene.add_force(stream.over_time(tide).into());
    let controllers = [
        Controller::Constant { control: vec![1.0] },
        Controller::Pd {
            target: vec![1.0],
            stiffness: vec![2.0],
            damping: vec![3.0],
        },
        Controller::PushThenLock {
            body: "body 1".into(),
            force: -1.0,
            stop_at: 0.5,
        },
        Controller::Wave {
            bodies: vec!["body 1".into()],
            places: vec![1.0 / 3.0],
            amplitude: [0.1, -1.0 / 3.0, 1e-9],
            frequency: 7.0,
            length: -0.9,
            bias: 0.2,
            stiffness: 8.0,
            damping: 0.3,
            rise: 1.0,
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
    // From a relative folder too they don't depend on where the program goes on.
    let scene = Scene::from_toml(text, "some").unwrap();
    let here = std::env::current_dir().unwrap();
    let hull = Shape::mesh(here.join("some/parts/hull.obj"));
    assert_eq!(scene.bodies[0].shape, Some(hull));
    let again = Scene::from_toml(&scene.to_toml().unwrap(), "elsewhere").unwrap();
    assert_eq!(again, scene);
}

#[test]
fn every_example_scene_runs_at_every_fidelity() {
    for path in example_scenes() {
        let scene = Scene::load(&path).unwrap();
        for fidelity in [
            Fidelity::Isolated,
            Fidelity::Reduced,
            Fidelity::Auto,
            Fidelity::Full,
        ] {
            let settings = Settings::default().fidelity(fidelity).faces(80);
            let simulator = Simulator::new(&scene, settings)
                .unwrap_or_else(|e| panic!("{} {fidelity:?}: {e}", path.display()));
            let rollout = simulator
                .rollout(&Controls::zeros(&simulator, 2))
                .unwrap_or_else(|e| panic!("{} {fidelity:?}: {e}", path.display()));
            assert_eq!(rollout.steps(), 2);
            assert!(rollout.samples()[2].energy().is_finite());
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
        let settings = Settings::default().fidelity(fidelity).faces(80);
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

/// The fingers stop before they meet the coin, which the water moves out and turns.
#[test]
fn grasp_is_held_open() {
    let scene = example("grasp_open");
    assert_eq!(scene.initial.q, [0.0, -0.4, 0.4, 1.4, 0.0, 0.4]);
    // The fingers are each other's mirror images, of 0.483 m³ and with 0.8 m between.
    let fingers: Vec<_> = scene.bodies[1..3]
        .iter()
        .map(|body| {
            let shape = body.shape.as_ref().unwrap();
            let mesh = hydrograd::shape::build(shape, Path::new(""), None).unwrap();
            (mesh.mass_properties(), mesh.bounds())
        })
        .collect();
    for (mass, _) in &fingers {
        assert!((mass.volume - 0.4832).abs() < 1e-12);
        // As dense as the other bodies.
        assert!((626.9 / mass.volume - 1297.0).abs() < 1.0);
    }
    assert!((fingers[0].0.centroid.z + fingers[1].0.centroid.z).abs() < 1e-12);
    assert_eq!((fingers[0].1[1].z, fingers[1].1[0].z), (0.0, 0.0));

    let run = |fidelity| {
        let settings = Settings::default().fidelity(fidelity).faces(150);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let rollout = simulator
            .rollout(&Controls::zeros(&simulator, 250))
            .unwrap();
        let gap = rollout.summary().min_gap.unwrap();
        let worked: f64 = rollout
            .samples()
            .windows(2)
            .map(|s| s[0].control.dot(&(s[1].q.rows(0, 3) - s[0].q.rows(0, 3))))
            .sum();
        let samples = rollout.samples();
        let most = samples.iter().map(|s| s.energy()).fold(0.0, f64::max);
        let missing = (samples[250].energy() - samples[0].energy() - worked).abs() / most;
        (samples[250].q.clone(), gap, missing)
    };
    let (q, gap, missing) = run(Fidelity::Full);
    println!(
        "grasp: q {:.4?}, gap {gap:.3}, energy {missing:.1e}",
        q.as_slice()
    );
    assert!((q[1] + 0.25).abs() < 0.01 && (q[2] - 0.25).abs() < 0.01);
    assert!(gap > 0.06 && gap < 0.1, "{gap}");
    assert!(q[3] - 1.4 > 0.03 && q[5] - 0.4 > 0.05, "{q}");
    // What the fingers' forces put in is what bodies and water hold.
    assert!(missing < 1e-5, "{missing}");
    let (q, ..) = run(Fidelity::Isolated);
    assert_eq!((q[3], q[4], q[5]), (1.4, 0.0, 0.4));
}

/// Turns a scene's meshes coarse, runs it, and gives the middle link's and the last body's motion.
fn swim(scene: &Scene, fidelity: Fidelity) -> (Vec<f64>, f64, f64) {
    let settings = Settings::default().fidelity(fidelity).faces(80);
    let simulator = Simulator::new(scene, settings).unwrap();
    let rollout = simulator
        .rollout(&Controls::zeros(&simulator, scene.steps))
        .unwrap();
    let summary = rollout.summary();
    let q = rollout.samples()[scene.steps].q.as_slice().to_vec();
    let drift = summary.momentum_drift.unwrap_or_default();
    (q, summary.min_gap.unwrap(), drift)
}

/// The tail's strokes push the swimmer out of its straight way.
#[test]
fn a_fish_near_a_tail_drifts_aside() {
    let scene = example("fish_near_tail");
    let (q, gap, _) = swim(&scene, Fidelity::Full);
    println!("near the tail: {:.3?}, gap {gap:.4}", &q[..3]);
    assert!(gap >= 0.02, "{gap}");
    let mut alone = scene.clone();
    alone.bodies.truncate(3);
    alone.initial.momentum.truncate(5);
    let (free, gap, drift) = swim(&alone, Fidelity::Full);
    println!(
        "alone: {:.3?}, gap {gap:.4}, momentum {drift:.1e}",
        &free[..3]
    );
    // Four cycles, ends where it faces ahead again.
    assert!(free[0] > 0.3 && free[1].abs() < 0.01 && free[2].abs() < 0.01);
    assert!(gap >= 0.02 && drift < 1e-6, "{gap} {drift}");
    assert!((q[1] - free[1]).abs() > 0.08 && (q[2] - free[2]).abs() > 0.3);
}

/// A passive fish is moved by the swimmer's water alone, and nothing touches.
#[test]
fn a_passive_fish_is_pushed_aside() {
    let scene = example("clown_fish");
    let (q, gap, drift) = swim(&scene, Fidelity::Full);
    let start = &scene.initial.q[5..];
    let moved = (q[5] - start[0]).hypot(q[6] - start[1]);
    println!(
        "small fish: moved {moved:.4}, turned {:.3}; gap {gap:.4}, momentum {drift:.1e}",
        q[7]
    );
    assert!(gap >= 0.02, "{gap}");
    assert!(drift < 1e-6, "{drift}");
    assert!(moved > 0.02 && q[7].abs() > 0.05, "{moved} {}", q[7]);
    let (alone, ..) = swim(&scene, Fidelity::Isolated);
    assert!((alone[5] - start[0]).abs() < 1e-12 && alone[7].abs() < 1e-12);
}
