//! Shapes as parameters of rollouts: gradients against differences of scenes that are built anew.

use crate::support::INTEGRATORS;
use crate::support::forward::{self, check_forward};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, BodyId, Contact, Drag, DragPart, Fluid, Joint, Scene, Thruster};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Shape, Simulator, objective};

const STEPS: usize = 8;

/// Free bodies side by side that move and turn, the last one hinged to the one before it and denser.
fn scene(shapes: &[Shape]) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.time_step = 0.02;
    let mut v = Vec::new();
    for (k, shape) in shapes.iter().enumerate() {
        let hinged = k > 0 && k + 1 == shapes.len();
        let mut body = Body::new(shape.clone()).density(900.0 + 300.0 * k as f64);
        body.name = format!("body{k}");
        body.placement.position = [0.1, -0.2, 0.05];
        body.shape_at.position = [0.02, 0.01, -0.03];
        body.shape_at.rotation = [0.2, -0.3, 0.1];
        body.joint = Joint::Free;
        if hinged {
            body.parent = Some(format!("body{}", k - 1));
            body.placement.position = [1.6, 0.3, 0.2];
            body.joint = Joint::Revolute {
                axis: [0.3, 1.0, 0.2],
            };
            v.push(0.7);
        } else {
            body.placement.position[1] += 3.0 * k as f64;
            v.extend([0.3, -0.2, 0.25, 0.5, 0.4, -0.6]);
        }
        scene.bodies.push(body);
    }
    scene.initial.v = v;
    scene
}

fn settings(fidelity: Fidelity, integrator: Integrator) -> Settings {
    Settings::default()
        .fidelity(fidelity)
        .integrator(integrator)
        .tolerance(1e-13)
        .faces(80)
        .films(false)
        .shape_parameters(vec!["*".into()])
}

fn goal(rollout: &Rollout) -> objective::Sum {
    let mut goal = objective::mean_position(BodyId(0), [0.3, 0.1, -0.2]);
    for i in 0..rollout.samples()[0].v.len() {
        goal = goal + objective::final_velocity(i, 0.1 * i as f64, 0.3 + 0.1 * i as f64);
    }
    goal
}

fn run(simulator: &Simulator) -> Rollout {
    let controls = Controls::zeros(simulator, STEPS);
    simulator.rollout(&controls).unwrap()
}

/// Worst difference between the gradient and that of rebuilt scenes, relative to it (per relative change), or to a twentieth of the largest one, or to a thousandth of the
/// value; `part` of a length is the step of the differences.
fn worst(scene: &Scene, settings: &Settings, part: f64) -> f64 {
    let simulator = Simulator::new(scene, settings.clone()).unwrap();
    let rollout = run(&simulator);
    let goal = goal(&rollout);
    let size = rollout.value(&goal).unwrap();
    let gradient = rollout.gradient(&goal).unwrap();
    let mut found = Vec::new();
    // A mesh whose vertices are asked for keeps its long faces.
    let asked = settings.shape_parameters.clone();
    let plain = Settings {
        shape_parameters: asked.filter(|names| names.iter().any(|n| n.ends_with(".vertex"))),
        ..settings.clone()
    };
    let names = gradient.parameters.names();
    let known = simulator.parameters();
    let shapes = names
        .filter(|n| scene.shape_parameters().iter().any(|(s, _)| s == n) || n.contains(".vertex."));
    for name in shapes {
        let at = known.get(name).unwrap();
        let size = if at.abs() > 0.05 { at.abs() } else { 0.3 };
        let along = |h: f64| {
            let changed = scene.with_shape_parameter(name, at + h).unwrap();
            let simulator = Simulator::new(&changed, plain.clone()).unwrap();
            run(&simulator).value(&goal).unwrap()
        };
        let h = part * size;
        let central = |h: f64| (along(h) - along(-h)) / (2.0 * h);
        let differences = (4.0 * central(0.5 * h) - central(h)) / 3.0;
        let adjoint = gradient.parameters.get(name).unwrap();
        found.push((name.to_string(), size * adjoint, size * differences));
    }
    assert!(!found.is_empty());
    println!("{found:?}");
    // A ball that nothing pushes moves the same whatever its radius.
    let least = 1e-3 * size.abs();
    let largest = found.iter().fold(least, |m: f64, (_, a, _)| m.max(a.abs()));
    let off = |(_, a, d): &(String, f64, f64)| (a - d).abs() / a.abs().max(0.05 * largest);
    found.iter().map(off).fold(0.0, f64::max)
}

fn shapes() -> [Shape; 6] {
    [
        Shape::sphere(0.4),
        Shape::ellipsoid([0.5, 0.2, 0.35]),
        Shape::cuboid([0.4, 0.7, 0.2]),
        Shape::cylinder(0.3, 0.6),
        Shape::capsule(0.2, 0.5),
        Shape::prism([[-0.3, -0.2], [0.3, -0.25], [0.2, 0.3], [-0.25, 0.2]], 0.5),
    ]
}

#[test]
fn every_shape_alone_with_its_volume_mass_and_inertia() {
    for shape in shapes() {
        let mut scene = scene(std::slice::from_ref(&shape));
        if matches!(shape, Shape::Prism { .. }) {
            // Its mesh is laid out anew for every profile: held against differences are volume, mass and inertia.
            scene.fluid = Fluid::none();
            scene.gravity = [0.0, 0.0, -9.81];
        }
        let off = worst(
            &scene,
            &settings(Fidelity::Isolated, Integrator::Midpoint),
            2e-3,
        );
        println!("{}: {off:.1e}", shape.kind());
        assert!(off < 1e-6, "{}: {off:e}", shape.kind());
    }
}

#[test]
fn every_integrator_with_joints() {
    let scene = scene(&[
        Shape::cuboid([0.4, 0.7, 0.2]),
        Shape::ellipsoid([0.5, 0.2, 0.35]),
    ]);
    for integrator in INTEGRATORS {
        let off = worst(&scene, &settings(Fidelity::Isolated, integrator), 2e-3);
        println!("{integrator:?}: {off:.1e}");
        assert!(off < 1e-6, "{integrator:?}: {off:e}");
    }
}

/// Two free bodies beside each other.
fn near() -> Scene {
    let mut scene = scene(&[
        Shape::cuboid([0.4, 0.7, 0.2]),
        Shape::ellipsoid([0.5, 0.2, 0.35]),
    ]);
    scene.bodies[1].parent = None;
    scene.bodies[1].joint = Joint::Free;
    scene.bodies[1].placement.position = [0.2, 0.8, 0.1];
    scene.initial.v = vec![
        0.3, 0.4, 0.25, 0.5, 0.4, -0.6, -0.3, -0.4, 0.2, 0.3, -0.5, 0.2,
    ];
    scene
}

/// Each rebuilt scene chooses its sources anew, so that differences have the noise of the compression, and take large steps.
#[test]
fn compressed_bodies_follow_their_shapes() {
    let settings = settings(Fidelity::Reduced, Integrator::VelocityEuler).accuracy(1e-3);
    let off = worst(&near(), &settings, 0.05);
    println!("{off:.1e}");
    assert!(off < 0.06, "{off:e}");
}

#[test]
fn coupled_panels_follow_their_shapes() {
    let mut scene = near();
    for (integrator, wall) in [
        (Integrator::Midpoint, false),
        (Integrator::VelocityEuler, true),
    ] {
        if wall {
            scene.add_wall([0.0, 0.0, -0.7], [0.1, 0.0, 1.0]);
        }
        let settings = settings(Fidelity::Full, integrator).faces(60);
        let off = worst(&scene, &settings, 2e-3);
        println!("{integrator:?}: {off:.1e}");
        assert!(off < 1e-6, "{integrator:?}: {off:e}");
    }
}

/// An added mass that is given stays what it is; what the other body changes of it follows from the shape.
#[test]
fn a_given_added_mass_does_not_follow() {
    let mut scene = near();
    let diagonal = [90.0, 60.0, 150.0, 6.0, 3.0, 5.0].map(|x: f64| 1e-3 * x);
    let row = |i: usize| {
        (0..6)
            .map(|j| if i == j { diagonal[i] } else { 0.0 })
            .collect()
    };
    scene.bodies[0].added_mass = Some((0..6).map(row).collect());
    let settings = settings(Fidelity::Full, Integrator::Midpoint).faces(60);
    let off = worst(&scene, &settings, 2e-3);
    println!("{off:.1e}");
    assert!(off < 1e-6, "{off:e}");
}

/// Gravity, buoyancy of a body that reaches through the surface of the water, drag by both laws.
#[test]
fn drag_and_buoyancy_follow_shapes() {
    // A prism's mesh is laid out anew for every profile.
    for shape in &shapes()[..5] {
        let mut scene = scene(std::slice::from_ref(shape));
        scene.gravity = [0.0, 0.0, -9.81];
        scene.waterline = Some(0.15);
        scene.bodies[0].density = Some(600.0);
        scene.bodies[0].drag = Some(Drag {
            linear: 30.0,
            quadratic: 0.4,
            quadratic_part: DragPart::Total,
            ..Drag::default()
        });
        let off = worst(
            &scene,
            &settings(Fidelity::Isolated, Integrator::MomentumEuler),
            1e-3,
        );
        println!("{}: {off:.1e}", shape.kind());
        assert!(off < 1e-6, "{}: {off:e}", shape.kind());
    }
}

/// Drag that the scene doesn't give, or gives as nothing, may be set: shapes have their part in it all the same.
#[test]
fn drag_that_is_set_later_follows_shapes() {
    let set = [
        (None, [("linear", 60.0)].as_slice()),
        (
            Some(Drag::default()),
            &[("linear", 30.0), ("quadratic", 0.4)],
        ),
    ];
    for (given, values) in set {
        let mut scene = scene(&[Shape::cuboid([0.4, 0.7, 0.2])]);
        scene.bodies[0].drag = given;
        let goal = objective::final_position(BodyId(0), [0.3, 0.1, -0.2]);
        let dragged = |scene: &Scene, shapes: Option<Vec<String>>| {
            let settings = Settings {
                shape_parameters: shapes,
                ..settings(Fidelity::Isolated, Integrator::MomentumEuler)
            };
            let mut simulator = Simulator::new(scene, settings).unwrap();
            let mut parameters = simulator.parameters().clone();
            for (name, value) in values {
                let name = format!("body0.drag.{name}");
                parameters.set(&name, *value).unwrap();
            }
            simulator.set_parameters(parameters).unwrap();
            simulator
        };
        let simulator = dragged(&scene, Some(vec!["body0.size".into()]));
        let gradient = run(&simulator).gradient(&goal).unwrap();
        for name in ["body0.size.x", "body0.size.y", "body0.size.z"] {
            let at = simulator.parameters().get(name).unwrap();
            let along = |h: f64| {
                let changed = scene.with_shape_parameter(name, at + h).unwrap();
                run(&dragged(&changed, None)).value(&goal).unwrap()
            };
            let h = 1e-3 * at;
            let central = |h: f64| (along(h) - along(-h)) / (2.0 * h);
            let differences = (4.0 * central(0.5 * h) - central(h)) / 3.0;
            let adjoint = gradient.parameters.get(name).unwrap();
            let error = (adjoint / differences - 1.0).abs();
            assert!(error < 1e-5, "{name}: {adjoint} is not {differences}");
        }
    }
}

/// A thruster's rotor is driven by its inertia, which follows from its shape, in the water and out of it.
#[test]
fn a_rotor_follows_its_shape() {
    for dry in [false, true] {
        let mut scene = scene(&[
            Shape::ellipsoid([0.5, 0.3, 0.35]),
            Shape::cylinder(0.2, 0.1),
        ]);
        if dry {
            scene.fluid = Fluid::none();
        }
        let thruster = Thruster::new("body0").polynomial([0.1]);
        scene.add_force(thruster.rotor("body1", 0.3).into());
        let settings = settings(Fidelity::Isolated, Integrator::Rk4);
        let off = worst(&scene, &settings, 1e-3);
        println!("dry {dry}: {off:.1e}");
        assert!(off < 1e-6, "dry {dry}: {off:e}");
    }
}

/// Bodies that slide over a wall and press on it, and on one another.
#[test]
fn contact_follows_shapes() {
    for shape in shapes() {
        let mut scene = scene(&[shape.clone(), Shape::sphere(0.3)]);
        if matches!(shape, Shape::Prism { .. }) {
            // Its mesh is laid out anew for every profile.
            scene.fluid = Fluid::none();
        }
        scene.time_step = 0.005;
        scene.gravity = [0.0, 0.0, -9.81];
        scene.add_wall([0.0, 0.0, -0.45], [0.1, 0.0, 1.0]);
        scene.contact = Some(Contact {
            stiffness: Some(3e4),
            friction: 0.4,
            gap: Some(0.02),
            width: Some(0.01),
            ..Contact::default()
        });
        scene.bodies[1].parent = None;
        scene.bodies[1].joint = Joint::Free;
        scene.bodies[1].placement.position = [0.1, 0.4, 0.1];
        scene.bodies[0].density = Some(2500.0);
        scene.initial.v = vec![
            0.3, 0.4, -2.0, 0.5, 0.4, -0.6, -0.3, -3.0, -0.5, 0.3, -0.5, 0.2,
        ];
        let settings = settings(Fidelity::Isolated, Integrator::MomentumEuler);
        let simulator = Simulator::new(&scene, settings.clone()).unwrap();
        let rollout = simulator
            .rollout(&Controls::zeros(&simulator, STEPS))
            .unwrap();
        let pressed = (0..STEPS).map(|n| rollout.contacts(n, 0.0).unwrap().len());
        assert!(pressed.sum::<usize>() > 2, "{}", shape.kind());
        let off = worst(&scene, &settings, 1e-4);
        println!("{}: {off:.1e}", shape.kind());
        assert!(off < 1e-5, "{}: {off:e}", shape.kind());
    }
}

/// A mesh number by number: every coordinate of every vertex.
#[test]
fn every_vertex_of_a_mesh() {
    let mesh = crate::support::mesh(&Shape::cuboid([0.4, 0.7, 0.2]), 24);
    let vertices: Vec<[f64; 3]> = mesh.vertices().iter().map(|v| (*v).into()).collect();
    let shape = Shape::triangles(vertices, mesh.faces());
    let settings = settings(Fidelity::Isolated, Integrator::Midpoint)
        .shape_parameters(vec!["body0.vertex".into()]);
    let off = worst(&scene(&[shape]), &settings, 1e-4);
    println!("{off:.1e}");
    assert!(off < 1e-6, "{off:e}");
}

/// A vertex that no face uses has its number, but no entry: the others keep those by which the scene sets them.
#[test]
fn a_loose_vertex_does_not_shift_the_others() {
    let vertices: [[f64; 3]; 5] = [
        [5.0, 5.0, 5.0],
        [-0.3, -0.2, -0.25],
        [0.5, -0.1, -0.2],
        [0.0, 0.6, -0.15],
        [0.1, 0.05, 0.45],
    ];
    let faces: [[usize; 3]; 4] = [[1, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 4]];
    let scene = scene(&[Shape::triangles(vertices, faces)]);
    let settings = settings(Fidelity::Isolated, Integrator::Midpoint)
        .shape_parameters(vec!["body0.vertex".into()]);
    let simulator = Simulator::new(&scene, settings.clone()).unwrap();
    for (v, x) in vertices.iter().enumerate() {
        for (axis, x) in ["x", "y", "z"].iter().zip(x) {
            let value = simulator
                .parameters()
                .get(&format!("body0.vertex.{v}.{axis}"));
            match v {
                0 => assert!(value.is_err()),
                _ => assert!((value.unwrap() - x).abs() < 1e-12),
            }
        }
    }
    let off = worst(&scene, &settings, 1e-4);
    println!("{off:.1e}");
    assert!(off < 1e-6, "{off:e}");
}

/// Forward mode against the transpose: states, and an observable that has masses and inertias in it.
#[test]
fn forward_mode_takes_what_follows_along() {
    let scene = near();
    for fidelity in [Fidelity::Isolated, Fidelity::Full] {
        let settings = settings(fidelity, Integrator::Midpoint).faces(60);
        let simulator = Simulator::new(&scene, settings).unwrap();
        check_forward(&format!("{fidelity:?}"), &simulator, 4, forward::LIMIT);
    }
}

/// Thin prisms with profiles that a larger change of a corner would bend inwards.
#[test]
fn every_shape_of_an_example() {
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .faces(60)
        .shape_parameters(vec!["*".into()]);
    let scene = crate::support::example("grasp");
    let simulator = Simulator::new(&scene, settings).unwrap();
    for (name, value) in scene.shape_parameters() {
        assert_eq!(simulator.parameters().get(&name).unwrap(), value);
    }
}

#[test]
fn wrong_names_and_settings_are_refused() {
    let scene = scene(&[Shape::cuboid([0.4, 0.7, 0.2])]);
    let told = |names: &str| {
        let settings = Settings::default().shape_parameters(vec![names.into()]);
        Simulator::new(&scene, settings).err().unwrap().to_string()
    };
    let said = told("body0.radius");
    assert!(
        said.contains("body0.radius") && said.contains("body0.size.y"),
        "{said}"
    );
    let said = told("body7");
    assert!(said.contains("body7"), "{said}");
    let settings = Settings::default().shape_parameters(vec!["body0.size".into()]);
    let mut simulator = Simulator::new(&scene, settings).unwrap();
    let mut parameters = simulator.parameters().clone();
    assert_eq!(parameters.get("body0.size.y").unwrap(), 0.7);
    parameters.set("body0.size.y", 0.8).unwrap();
    let said = simulator
        .set_parameters(parameters)
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("body0.size.y") && said.contains("0.8"),
        "{said}"
    );
    for (name, value) in [
        ("body0.size.y", -0.1),
        ("body0.size.y", f64::NAN),
        ("body0.depth", 1.0),
    ] {
        let said = scene
            .with_shape_parameter(name, value)
            .unwrap_err()
            .to_string();
        assert!(said.contains("size.y"), "{said}");
    }
}
