//! The pressure on bodies: its sum against what the dynamics do to them.

use crate::support::{example, mesh, says};
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::boundary::{EllipsoidSurface, ExactBoundary, Response};
use hydrograd::geometry::{Faces, Wall};
use hydrograd::scene::{Body, Current, Fluid, Motion, Placement, Scene, Shape};
use hydrograd::shape::file::write_obj;
use hydrograd::simulate::{Earlier, Method, Recording, SurfacePressure};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use std::f64::consts::PI;

/// Largest difference of the wrenches of pressures and of dynamics over all bodies: of forces in parts of the largest there, of moments
/// in parts of it at the body's farthest point.
fn error(rollout: &Rollout, n: usize) -> f64 {
    let loads = rollout.loads(n).unwrap();
    let mut water = loads.wrenches("water").unwrap().to_vec();
    for (all, streamed) in water
        .iter_mut()
        .zip(loads.wrenches("current").unwrap_or(&[]))
    {
        *all += streamed;
    }
    let parts = |w: &Vec6| [0, 3].map(|at| w.fixed_rows::<3>(at).norm());
    let reach = |p: &SurfacePressure| {
        let far = p.centres.iter().map(|x| (x - p.origin).norm());
        far.fold(0.0, f64::max)
    };
    let largest = water.iter().map(|w| parts(w)[0]).fold(0.0, f64::max);
    let pressures = rollout.pressure(n).unwrap();
    pressures.iter().fold(0.0, |worst: f64, p| {
        let [force, moment] = parts(&(p.wrench() - water[p.body]));
        worst
            .max(force / largest)
            .max(moment / (largest * reach(p)))
    })
}

fn at_start(scene: &Scene, settings: Settings) -> Rollout {
    let simulator = Simulator::new(scene, settings).unwrap();
    simulator.rollout(&Controls::zeros(&simulator, 1)).unwrap()
}

/// Of each number of faces.
fn errors<const N: usize>(
    scene: &Scene,
    fidelity: Fidelity,
    method: Method,
    faces: [usize; N],
) -> [f64; N] {
    faces.map(|faces| {
        let settings = Settings::default().fidelity(fidelity).method(method);
        error(&at_start(scene, settings.faces(faces)), 0)
    })
}

/// What knows the flow, by all ways to come by it.
const ALL: [(Fidelity, Method); 4] = [
    (Fidelity::Isolated, Method::Auto),
    (Fidelity::Reduced, Method::Auto),
    (Fidelity::Full, Method::Panel),
    (Fidelity::Full, Method::MfsVertex),
];

/// Two spheres, one heavy and one light, that turn and pass each other at half a radius.
fn spheres() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    for (x, density) in [(-0.15, 1500.0), (0.1, 700.0)] {
        let ball = Body::new(Shape::sphere(0.1)).density(density);
        scene.add(ball.at([x, 0.0, 0.3 * x]));
    }
    scene.initial.v = vec![
        0.4, 0.1, -0.2, 1.0, 2.0, -0.5, -0.3, 0.2, 0.1, 0.3, 0.0, 1.0,
    ];
    scene
}

fn ellipsoid_beside_a_wall() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    let mut body = Body::new(Shape::ellipsoid([0.2, 0.1, 0.06])).density(1300.0);
    body.shape_at = Placement::new([0.03, -0.02, 0.01], [0.2, 0.1, -0.3]);
    scene.add(body.at([0.0, 0.0, 0.25]));
    scene.walls.push(Wall::rigid([0.0; 3], [0.0, 0.0, 1.0]));
    scene.fluid.current = [0.2, -0.1, 0.0];
    scene.initial.v = vec![0.5, 0.1, -0.3, 1.0, -2.0, 1.5];
    scene
}

/// An example as it is after so many steps, with what drives it there.
fn after(name: &str, steps: usize) -> Scene {
    let mut scene = example(name);
    let settings = Settings::default().fidelity(Fidelity::Reduced).faces(320);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let run = simulator
        .rollout(&Controls::zeros(&simulator, steps))
        .unwrap();
    let last = run.samples().last().unwrap();
    scene.initial.q = last.q.as_slice().to_vec();
    scene.initial.v = last.v.as_slice().to_vec();
    scene
}

#[test]
fn pressures_add_up_to_what_the_dynamics_do_to_round_bodies() {
    let scenes = [
        ("two spheres", spheres()),
        ("ellipsoid", ellipsoid_beside_a_wall()),
        ("falling ball", after("falling_ball", 60)),
    ];
    for (name, scene) in &scenes {
        for (fidelity, method) in ALL {
            let [coarse, fine] = errors(scene, fidelity, method, [320, 1280]);
            // Second order in the edges, which are half as long.
            assert!(fine < 0.01, "{name}, {fidelity}, {method}: {coarse} {fine}");
            assert!(
                fine < 0.5 * coarse || fine < 1e-3,
                "{name}, {fidelity}, {method}: {coarse} {fine}"
            );
        }
    }
}

/// A mesh has no closed form: all of it is by panels.
#[test]
fn pressures_add_up_on_meshes_too() {
    let folder = tempfile::tempdir().unwrap();
    let errors = [320, 1280].map(|faces| {
        let path = folder.path().join(format!("{faces}.obj"));
        write_obj(&path, &mesh(&Shape::ellipsoid([0.2, 0.1, 0.06]), faces)).unwrap();
        let mut scene = ellipsoid_beside_a_wall();
        scene.bodies[0].shape = Some(Shape::mesh(&path));
        let settings = Settings::default().fidelity(Fidelity::Reduced);
        error(&at_start(&scene, settings), 0)
    });
    println!("mesh: {errors:.4?}");
    let [coarse, fine] = errors;
    assert!(fine < 0.02 && fine < coarse / 3.0, "{coarse} {fine}");
}

#[test]
fn pressures_on_spheres_by_formula_are_right_to_a_thousandth() {
    // A radius apart; at half of it 0.12 % are left.
    let mut scene = spheres();
    scene.bodies[1].placement.position[0] = 0.15;
    for fidelity in [Fidelity::Isolated, Fidelity::Reduced, Fidelity::Full] {
        let [coarse, fine] = errors(&scene, fidelity, Method::Auto, [320, 1280]);
        println!("{fidelity}: {coarse:.6} {fine:.6}");
        assert!(fine < 1e-3, "{fidelity}: {fine}");
    }
}

#[test]
fn pressures_add_up_to_what_the_dynamics_do_to_bodies_with_sharp_edges() {
    // The fingers are 0.2 m off the coin there.
    let scene = after("grasp_open", 60);
    for (fidelity, method, faces, limit) in [
        (Fidelity::Isolated, Method::Auto, 320, 0.05),
        (Fidelity::Isolated, Method::Auto, 1280, 0.03),
        (Fidelity::Reduced, Method::Auto, 320, 0.05),
        (Fidelity::Reduced, Method::Auto, 1280, 0.02),
        (Fidelity::Full, Method::Panel, 320, 0.05),
        (Fidelity::Full, Method::Panel, 1280, 0.02),
        (Fidelity::Full, Method::MfsVertex, 320, 0.02),
        (Fidelity::Full, Method::MfsVertex, 1280, 0.03),
    ] {
        let [found] = errors(&scene, fidelity, method, [faces]);
        println!("grasp, {fidelity}, {method}, {faces}: {found:.4}");
        assert!(found < limit, "{fidelity}, {method}: {found}");
    }
}

#[test]
fn pressures_are_recorded_with_every_bit() {
    let scene = spheres();
    let settings = Settings::default().fidelity(Fidelity::Reduced).faces(320);
    let rollout = at_start(&scene, settings);
    let mut recording = Recording::of(&scene, &rollout).unwrap();
    recording.observables.push(rollout.pressures().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let [csv, json] = recording.write(folder.path()).unwrap();
    let text = std::fs::read_to_string(json).unwrap();
    let read: serde_json::Value = serde_json::from_str(&text).unwrap();
    for n in 0..2 {
        let row = read["pressure"][n].as_array().unwrap();
        let row: Vec<f64> = row.iter().map(|x| x.as_f64().unwrap()).collect();
        let right = rollout.pressure(n).unwrap().into_iter();
        let right: Vec<f64> = right.flat_map(|p| p.pressures).collect();
        assert_eq!(row, right);
    }
    let text = std::fs::read_to_string(csv).unwrap();
    let columns: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let name = &scene.bodies[1].name;
    assert!(columns.contains(&format!("{name}.pressure_319").as_str()));
    // It may be gone on with.
    let earlier = Earlier::read(&folder.path().join("trajectory.json")).unwrap();
    earlier.put_before(&mut recording).unwrap();
    let rows = &recording.observables.last().unwrap().values;
    assert_eq!(rows.len(), 3);
    assert_eq!(rows[0], rows[1]);
}

/// A stream that grows and turns in depth: its own pressure, and what the body answers.
#[test]
fn pressures_in_a_stream_add_up_to_what_it_does_to_bodies() {
    let growing = Motion::Sine {
        offset: 1.0,
        amplitude: 0.5,
        frequency: 0.4,
        phase: 0.3,
    };
    let stream = |profile: &[[f64; 2]]| {
        let current = Current::new([0.6, -0.3, 0.0]).profile(profile.to_vec());
        current.over_time(growing.clone())
    };
    let profile = [[-1.0, 1.5], [0.0, 1.0], [1.0, 0.2]];
    for (name, scene, profile) in [
        ("two spheres", spheres(), &profile[..]),
        ("two spheres, everywhere alike", spheres(), &[]),
        ("an ellipsoid", ellipsoid_beside_a_wall(), &profile[..]),
    ] {
        let mut scene = scene;
        scene.add_force(stream(profile).into());
        for (fidelity, method) in ALL {
            let [found] = errors(&scene, fidelity, method, [320]);
            println!("{name}, {fidelity}, {method}: {found:.5}");
            // As much as without a stream, of less force; fundamental solutions are off most with so few faces.
            let limit = if method == Method::MfsVertex {
                0.03
            } else {
                0.01
            };
            assert!(found < limit, "{name}, {fidelity}, {method}: {found}");
        }
    }
    // One at rest in a stream that is there at once: 3/2 ρ V a, along with nothing of its speed.
    let mut held = Scene::new(Fluid::fresh_water());
    held.add(Body::new(Shape::sphere(0.1)).density(1e9));
    held.add_force(stream(&[]).into());
    let made = &at_start(&held, Settings::default()).pressure(0).unwrap()[0];
    let gain = 0.5 * 0.4 * 0.3f64.cos() * Vec3::new(0.6, -0.3, 0.0);
    let right = 1.5 * 998.0 * 4.0 / 3.0 * PI * 1e-3 * gain;
    let force: Vec3 = made.wrench().fixed_rows::<3>(0).into_owned();
    assert!(
        (force - right).norm() < 2e-3 * right.norm(),
        "{force} {right}"
    );
    // The water goes around it: nothing through its surface.
    for (u, n) in made.velocities.iter().zip(&made.normals) {
        assert!(u.dot(n).abs() < 1e-6, "{u}");
    }
}

#[test]
fn a_sphere_that_moves_steadily_has_the_pressure_of_the_books() {
    // p = ½ ρ U² (1 − 9/4 sin²θ), Lamb 1932, art. 92; nothing in all.
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add(Body::new(Shape::sphere(0.3)).density(998.0));
    let speed = Vec3::new(0.6, -0.3, 0.2);
    scene.initial.v = vec![speed.x, speed.y, speed.z, 0.0, 0.0, 0.0];
    for (fidelity, method) in ALL {
        let settings = Settings::default().fidelity(fidelity).method(method);
        let run = at_start(&scene, settings.faces(320));
        let made = &run.pressure(0).unwrap()[0];
        let scale = 0.5 * 998.0 * speed.norm_squared();
        for (p, n) in made.pressures.iter().zip(&made.normals) {
            let cosine = n.dot(&speed.normalize());
            let right = scale * (1.0 - 2.25 * (1.0 - cosine * cosine));
            assert!((p - right).abs() < 1e-3 * scale, "{p} {right}");
        }
        assert!(made.wrench().norm() < 1e-3 * scale * 0.3);
        // At rest it is buoyancy.
        assert_eq!(made.hydrostatic_wrench(), Vec6::zeros());
    }
    scene.gravity = [0.0, 0.0, -9.81];
    let made = &at_start(&scene, Settings::default()).pressure(0).unwrap()[0];
    let lifted = 998.0 * 9.81 * 4.0 / 3.0 * PI * 0.027;
    assert!((made.hydrostatic_wrench()[2] / lifted - 1.0).abs() < 2e-3);
}

/// Below a waterline the water at rest lifts a box as its buoyancy does, faces that reach through the surface included; above it there is none.
#[test]
fn hydrostatic_pressure_ends_at_the_waterline() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.waterline = Some(0.5);
    let cube = || Shape::cuboid([0.1; 3]);
    let tilted = Body::new(cube()).at([1.0, 0.0, 0.51]);
    scene.add(Body::new(cube()).density(500.0).at([0.0, 0.0, 0.52]));
    scene.add(tilted.density(500.0).rotated([0.4, -0.3, 0.2]));
    scene.add(Body::new(cube()).density(500.0).at([2.0, 0.0, 0.1]));
    scene.add(Body::new(cube()).density(500.0).at([3.0, 0.0, 2.0]));
    let run = at_start(&scene, Settings::default().fidelity(Fidelity::Isolated));
    let loads = run.loads(0).unwrap();
    let lifted = loads.wrenches("buoyancy").unwrap();
    let full = 998.0 * 9.81 * 1e-3;
    for made in run.pressure(0).unwrap() {
        let force: Vec3 = made.hydrostatic_wrench().fixed_rows::<3>(0).into_owned();
        let right: Vec3 = lifted[made.body].fixed_rows::<3>(0).into_owned();
        assert!((force - right).norm() < 1e-10 * full, "{force} {right}");
        for (p, x) in made.hydrostatic.iter().zip(&made.centres) {
            // The mean over a face that is cut is more than that of its centre.
            let at_centre = 998.0 * 9.81 * (0.5 - x.z).max(0.0);
            assert!(*p >= at_centre - 1e-9, "{p} {at_centre}");
            if (0.5 - x.z).abs() > 0.1 {
                assert!((p - at_centre).abs() < 1e-9 * full.max(at_centre), "{p}");
            }
        }
    }
    let [a, .., dry] = lifted else {
        panic!("four bodies")
    };
    assert!((a[2] / (0.3 * full) - 1.0).abs() < 1e-9 && *dry == Vec6::zeros());
}

#[test]
fn pressures_that_are_not_known_are_refused() {
    let run = |scene: &Scene, fidelity| at_start(scene, Settings::default().fidelity(fidelity));
    let scene = spheres();
    let made = run(&scene, Fidelity::Reduced);
    says(made.pressure(2).unwrap_err(), &["state", "2", "at most 1"]);

    let mut dry = spheres();
    dry.fluid.density = 0.0;
    says(
        run(&dry, Fidelity::Reduced).pressure(0).unwrap_err(),
        &["density is 0"],
    );

    let mut stream = spheres();
    stream.add_force(Current::new([0.1, 0.0, 0.0]).into());
    let made = run(&stream, Fidelity::Reduced);
    let far = [Vec3::new(0.0, 3.0, 0.0)];
    says(made.flow_pressure(0, &far).unwrap_err(), &["current"]);

    // A film holds the boxes apart: nobody tells of points there, but for asking after none.
    let mut boxes = Scene::new(Fluid::fresh_water());
    for x in [0.0, 1.02] {
        boxes.add(
            Body::new(Shape::cuboid([1.0; 3]))
                .density(900.0)
                .at([x, 0.0, 0.0]),
        );
    }
    let made = run(&boxes, Fidelity::Reduced);
    says(made.flow(0, &far).unwrap_err(), &["body 0", "film"]);
    says(made.flow_pressure(0, &far).unwrap_err(), &["film"]);
    assert_eq!(made.flow_resolved(0, &far).unwrap(), [false]);
    assert!(made.flow(0, &[]).unwrap().is_empty());
}

#[test]
fn potentials_are_those_of_the_closed_form_and_gradients_their_slopes() {
    for axes in [[0.3, 0.3, 0.3], [0.3, 0.2, 0.1], [0.1, 0.4, 0.4]] {
        let pose = Pose::new(
            exp_matrix(&Vec3::new(0.3, -0.2, 0.5)),
            Vec3::new(0.1, 0.2, -0.3),
        );
        let surface = mesh(&Shape::ellipsoid(axes), 320);
        let faces = Faces::of(&surface.transformed(&pose));
        let made = EllipsoidSurface::new(axes, &pose, &faces).unwrap();
        let exact = ExactBoundary::new("e", axes, &pose, 0.1).unwrap();
        let twist = Vec6::new(0.3, -0.5, 0.7, 1.1, -0.4, 0.9);
        // Just outside, as the closed form asks for.
        let outward = |h: f64| -> Vec<Vec3> {
            let places = made.faces.centres.iter().zip(&made.faces.normals);
            places.map(|(x, n)| x + h * n).collect()
        };
        let right = exact.radiated(&outward(1e-9)).unwrap();
        let found = made.potentials(&twist);
        let largest = found.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        for (i, found) in found.iter().enumerate() {
            let right: f64 = (0..6).map(|k| right[(i, k)] * twist[k]).sum();
            assert!(
                (found - right).abs() < 1e-7 * largest,
                "{axes:?}: {found} {right}"
            );
        }
        let h = 1e-4;
        let slopes = made.gradients(&twist);
        for (i, (slope, normal)) in slopes.iter().zip(&made.faces.normals).enumerate() {
            let along = normal.cross(&Vec3::new(0.3, 0.8, 0.5)).normalize();
            // Both are as far outside.
            let points = [h, -h].map(|h| made.faces.centres[i] + h * along);
            let ends = exact.radiated(&points).unwrap();
            let right: f64 = (0..6)
                .map(|k| (ends[(0, k)] - ends[(1, k)]) * twist[k] / (2.0 * h))
                .sum();
            assert!(
                (slope.dot(&along) - right).abs() < 1e-4,
                "{} {right}",
                slope.dot(&along)
            );
            assert!(slope.dot(normal).abs() < 1e-12);
        }
        // Patches cover the whole ellipsoid: its volume, by ∮ x·n dA / 3.
        let faces = &made.faces;
        let each = faces.centres.iter().zip(&faces.normals).zip(&faces.areas);
        let volume: f64 = each.map(|((x, n), a)| x.dot(n) * a / 3.0).sum();
        let right = 4.0 / 3.0 * PI * axes.iter().product::<f64>();
        assert!((volume / right - 1.0).abs() < 2e-3, "{}", volume / right);
    }
}
