//! Streamlines, path lines and the potential of the flow, against what is known in closed form.

use crate::support::directions;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::scene::{Body, Fluid, Scene, Shape, Wall};
use hydrograd::simulate::{LineEnd, Method, StreamlineSettings, Way};
use hydrograd::{Controls, Error, Fidelity, Rollout, Settings, Simulator};

/// Radius of the sphere, m, and its velocity, m/s.
const RADIUS: f64 = 0.3;
const U: f64 = 0.5;

/// A sphere that moves along z through still water.
fn scene() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0; 3];
    let mut ball = Body::new(Shape::sphere(RADIUS)).density(998.0);
    ball.name = "ball".into();
    scene.add(ball);
    scene.initial.v = vec![0.0, 0.0, U, 0.0, 0.0, 0.0];
    scene
}

fn run(scene: &Scene, fidelity: Fidelity, faces: usize, steps: usize) -> Rollout {
    let settings = Settings::default()
        .fidelity(fidelity)
        .faces(faces)
        .time_step(0.05);
    let simulator = Simulator::new(scene, settings).unwrap();
    simulator
        .rollout(&Controls::zeros(&simulator, steps))
        .unwrap()
}

/// Stokes's stream function of the sphere in water at rest: U R³ sin²θ/2r, Lamb 1932, art. 96.
fn stream(x: &Vec3) -> f64 {
    let r = x.norm();
    0.5 * U * RADIUS.powi(3) * (x.x * x.x + x.y * x.y) / r.powi(3)
}

#[test]
fn streamlines_of_a_moving_sphere_keep_its_stream_function() {
    let seeds = [
        Vec3::new(0.5, 0.0, 0.0),
        Vec3::new(0.3, 0.3, 0.2),
        Vec3::new(0.0, -0.8, -0.3),
    ];
    for fidelity in [Fidelity::Isolated, Fidelity::Reduced, Fidelity::Full] {
        let rollout = run(&scene(), fidelity, 1280, 0);
        let lines = rollout.streamlines(0, &seeds, &StreamlineSettings::new(1.5));
        for (line, seed) in lines.unwrap().iter().zip(&seeds) {
            assert_eq!(line.points[line.seed], *seed);
            assert_eq!(line.points.len(), line.velocities.len());
            let right = stream(seed);
            let off = line.points.iter().map(|x| (stream(x) / right - 1.0).abs());
            let worst = off.fold(0.0, f64::max);
            println!("{fidelity}: {} points, {worst:.1e}", line.points.len());
            // That of the panels.
            assert!(worst < 0.01, "{fidelity}: {worst}");
            for end in line.ends.iter().flatten() {
                let known = [LineEnd::Length, LineEnd::Body("ball".into())];
                assert!(known.contains(end), "{end:?}");
            }
            let all = line.points.iter().chain(&line.velocities);
            assert!(all.flat_map(|x| x.iter()).all(|x| x.is_finite()));
        }
    }
}

#[test]
fn lines_end_where_they_are_told_to() {
    let rollout = run(&scene(), Fidelity::Isolated, 320, 0);
    let seed = [Vec3::new(0.6, 0.0, 0.0)];
    let ends =
        |settings: &StreamlineSettings| rollout.streamlines(0, &seed, settings).unwrap()[0].clone();
    let short = StreamlineSettings {
        way: Way::Forward,
        ..StreamlineSettings::new(0.25)
    };
    let line = ends(&short);
    assert_eq!(line.ends, [None, Some(LineEnd::Length)]);
    let pieces = line.points.windows(2).map(|p| (p[1] - p[0]).norm());
    let length: f64 = pieces.sum();
    assert!((length / 0.25 - 1.0).abs() < 1e-3, "{length}");
    let few = StreamlineSettings {
        most_steps: 3,
        ..short.clone()
    };
    assert_eq!(ends(&few).ends[1], Some(LineEnd::Steps));
    let boxed = StreamlineSettings {
        within: Some([[-1.0; 3], [1.0, 1.0, 0.1]]),
        way: Way::Both,
        ..short
    };
    let line = ends(&boxed);
    assert!(line.ends.contains(&Some(LineEnd::Box)), "{:?}", line.ends);
    assert!(line.points.iter().all(|x| x.z < 0.1 + 1e-12));
    // Behind the sphere's pole lines come to it.
    let pole = [Vec3::new(0.0, 0.0, 0.5)];
    let found = rollout
        .streamlines(0, &pole, &StreamlineSettings::new(0.6))
        .unwrap();
    assert_eq!(found[0].ends[0], Some(LineEnd::Body("ball".into())));
}

#[test]
fn tracers_go_straight_in_a_uniform_current() {
    let mut scene = scene();
    scene.fluid.current = [0.3, -0.1, 0.0];
    // The sphere goes with the current: nothing disturbs it.
    scene.initial.v = vec![0.3, -0.1, 0.0, 0.0, 0.0, 0.0];
    for steps in [6, 7] {
        let rollout = run(&scene, Fidelity::Isolated, 320, steps);
        let seeds = [Vec3::new(0.0, 0.0, 0.6), Vec3::new(-0.7, 0.2, 0.0)];
        for (line, seed) in rollout
            .path_lines(&seeds, 0, steps)
            .unwrap()
            .iter()
            .zip(&seeds)
        {
            assert_eq!(
                (line.points.len(), &line.end),
                (steps + 1, &LineEnd::Length)
            );
            for (x, t) in line.points.iter().zip(&line.times) {
                let right = seed + *t * Vec3::from(scene.fluid.current);
                assert!((x - right).norm() < 1e-12, "{x} {right}");
            }
        }
    }
}

/// Seen from the sphere that moves steadily, tracers go along streamlines of the flow past it: their stream function in that frame is kept.
#[test]
fn tracers_keep_the_stream_function_of_the_flow_past_the_sphere() {
    let seeds = [Vec3::new(0.25, 0.0, 0.45), Vec3::new(0.0, 0.5, 0.2)];
    let mut errors = Vec::new();
    for steps in [8, 9, 16] {
        let settings = Settings::default().fidelity(Fidelity::Isolated).faces(1280);
        let simulator = Simulator::new(&scene(), settings.time_step(0.8 / steps as f64)).unwrap();
        let rollout = simulator
            .rollout(&Controls::zeros(&simulator, steps))
            .unwrap();
        let past = |x: &Vec3, t: f64| {
            let x = x - U * t * Vec3::z();
            stream(&x) - 0.5 * U * (x.x * x.x + x.y * x.y)
        };
        let mut worst = 0.0_f64;
        for (line, seed) in rollout
            .path_lines(&seeds, 0, steps)
            .unwrap()
            .iter()
            .zip(&seeds)
        {
            assert_eq!(line.end, LineEnd::Length);
            for (x, t) in line.points.iter().zip(&line.times) {
                worst = worst.max((past(x, *t) / past(seed, 0.0) - 1.0).abs());
            }
        }
        println!("{steps} steps: {worst:.1e}");
        errors.push(worst);
    }
    // That of the panels beside the sphere, whatever the steps.
    assert!(errors.iter().all(|e| *e < 0.015), "{errors:?}");
}

#[test]
fn the_potential_of_a_moving_sphere_is_a_dipoles() {
    // φ = U·x R³/2r³, up to the surface.
    let rays = directions(100);
    for (fidelity, method) in [
        (Fidelity::Isolated, Method::Auto),
        (Fidelity::Reduced, Method::Auto),
        (Fidelity::Full, Method::Panel),
        (Fidelity::Full, Method::MfsVertex),
    ] {
        let settings = Settings::default().fidelity(fidelity).method(method);
        let simulator = Simulator::new(&scene(), settings.faces(1280)).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 0)).unwrap();
        for away in [0.02, 0.1, 0.5, 2.0] {
            let radius = RADIUS * (1.0 + away);
            let points: Vec<Vec3> = rays.iter().map(|d| radius * d).collect();
            let made = rollout.potential(0, &points).unwrap();
            for (phi, x) in made.iter().zip(&points) {
                let right = 0.5 * U * x.z * (RADIUS / radius).powi(3);
                let size = 0.5 * U * RADIUS;
                assert!(
                    (phi - right).abs() < 0.01 * size,
                    "{fidelity} {away}: {phi} {right}"
                );
            }
        }
        // Its slope is the flow.
        let (x, h) = (Vec3::new(0.4, 0.3, 0.5), 1e-4);
        let sides = |axis: Vec3| [x + h * axis, x - h * axis];
        let points: Vec<Vec3> = [Vec3::x(), Vec3::y(), Vec3::z()]
            .into_iter()
            .flat_map(sides)
            .collect();
        let phi = rollout.potential(0, &points).unwrap();
        let slope = Vec3::from_fn(|c, _| (phi[2 * c] - phi[2 * c + 1]) / (2.0 * h));
        let flow = rollout.flow(0, &[x]).unwrap()[0];
        assert!((slope + flow).norm() < 0.02 * flow.norm(), "{slope} {flow}");
        let inside = rollout
            .potential(0, &[Vec3::new(0.1, 0.0, 0.0)])
            .unwrap_err();
        assert!(inside.to_string().contains("body \"ball\""), "{inside}");
        assert!(rollout.potential(0, &[]).unwrap().is_empty());
    }
}

#[test]
fn bad_seeds_are_refused_by_name() {
    let mut scene = scene();
    scene
        .walls
        .push(Wall::rigid([0.0, 0.0, -2.0], [0.0, 0.0, 1.0]));
    let rollout = run(&scene, Fidelity::Reduced, 320, 2);
    let settings = StreamlineSettings::new(1.0);
    let nan = Vec3::new(0.0, f64::NAN, 0.0);
    let out = Vec3::new(1.0, 0.0, 0.0);
    for (seed, says) in [
        (nan, "must be finite"),
        (Vec3::zeros(), "body \"ball\""),
        (Vec3::new(0.0, 0.0, -2.5), "wall 0"),
    ] {
        let stream = rollout.streamlines(0, &[out, seed], &settings).unwrap_err();
        let path = rollout.path_lines(&[out, seed], 0, 2).unwrap_err();
        for (error, name) in [
            (stream, "streamlines: seeds[1]"),
            (path, "path_lines: seeds[1]"),
        ] {
            let text = error.to_string();
            assert!(text.contains(name) && text.contains(says), "{text}");
        }
    }
    let many = vec![out; 100_001];
    let text = rollout
        .streamlines(0, &many, &settings)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("number of seeds") && text.contains("100000"),
        "{text}"
    );
    let refused = |settings: StreamlineSettings, says: &str| {
        let error = rollout.streamlines(0, &[out], &settings).unwrap_err();
        assert!(matches!(error, Error::Input { .. }), "{error}");
        assert!(error.to_string().contains(says), "{error}");
    };
    refused(StreamlineSettings::new(f64::NAN), "length");
    refused(
        StreamlineSettings {
            tolerance: Some(0.0),
            ..settings.clone()
        },
        "tolerance",
    );
    refused(
        StreamlineSettings {
            most_steps: 0,
            ..settings.clone()
        },
        "most_steps",
    );
    refused(
        StreamlineSettings {
            within: Some([[0.0; 3], [1.0, -1.0, 1.0]]),
            ..settings
        },
        "within[1]",
    );
    assert!(rollout.path_lines(&[out], 1, 1).is_err());
    assert!(rollout.path_lines(&[out], 0, 3).is_err());
}
