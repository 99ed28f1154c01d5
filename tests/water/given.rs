//! Bodies whose own added mass is given, where they feel each other: alone they have exactly that, and what others and walls change is as computed.

use crate::support::says;
use hydrograd::adjoint::lie::Mat6;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Current, Fluid, Motion, Scene, Shape};
use hydrograd::simulate::{Exchange, Method};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector};

const DENSITY: f64 = 998.0;

/// Every coupled fidelity with each method that it has.
const HOW: [(Fidelity, Method); 6] = [
    (Fidelity::Reduced, Method::Auto),
    (Fidelity::Reduced, Method::MfsVertex),
    (Fidelity::Auto, Method::Auto),
    (Fidelity::Full, Method::Panel),
    (Fidelity::Full, Method::MfsVertex),
    (Fidelity::Full, Method::MfsFace),
];

fn settings((fidelity, method): (Fidelity, Method)) -> Settings {
    let settings = Settings::default().fidelity(fidelity).method(method);
    match fidelity {
        Fidelity::Isolated => settings,
        Fidelity::Full => settings.tolerance(1e-13),
        // At `auto`'s own accuracy pairs this near begin to fade out, from where what is given says.
        _ => settings.accuracy(1e-3),
    }
}

fn water() -> Scene {
    Scene::new(Fluid {
        density: DENSITY,
        current: [0.0; 3],
    })
}

/// Of a body some 0.2 m across, at unit density: positive definite, without any symmetry else.
fn given(scale: f64) -> [[f64; 6]; 6] {
    let arm = |i: usize| if i < 3 { 1.0 } else { 0.1 };
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (a, b) = (i.min(j) as f64, i.max(j) as f64);
            let aside = 0.1 * (1.0 + a + 2.0 * b).sin();
            let own = if i == j { 1.0 + 0.1 * a } else { aside };
            scale * 4e-3 * own * arm(i) * arm(j)
        })
    })
}

fn matrix(rows: [[f64; 6]; 6]) -> Mat6 {
    Mat6::from_fn(|i, j| rows[i][j])
}

fn egg() -> Body {
    let egg = Body::new(Shape::ellipsoid([0.12, 0.08, 0.1]).faces(320)).named("egg");
    egg.density(1100.0).rotated([0.2, -0.4, 0.3])
}

fn brick() -> Body {
    let brick = Body::new(Shape::cuboid([0.2, 0.15, 0.18]).faces(108)).named("brick");
    brick.density(900.0).at([0.1, 0.05, 0.28])
}

/// Six by six of a body, its own axes, at unit density.
fn own(scene: &Scene, how: (Fidelity, Method), body: usize) -> Mat6 {
    let simulator = Simulator::new(scene, settings(how)).unwrap();
    simulator.added_mass().unwrap().own(body) / DENSITY
}

fn off(found: &Mat6, right: &Mat6) -> f64 {
    let scale = |i: usize| right[(i, i)].sqrt();
    let relative = |i: usize, j: usize| (found[(i, j)] - right[(i, j)]) / (scale(i) * scale(j));
    Mat6::from_fn(relative).amax()
}

#[test]
fn alone_a_body_has_what_is_given() {
    for body in [egg, brick] {
        let mut scene = water();
        scene.add(body().added_mass(given(1.0)));
        for how in HOW {
            let error = off(&own(&scene, how, 0), &matrix(given(1.0)));
            println!("{} {how:?}: {error:.1e}", body().name);
            assert!(error < 1e-12, "{how:?}: {error:e}");
        }
    }
}

/// Two bodies near each other and a wall, with a film there where a fidelity has films: with what is given of one, of the other, and of both.
#[test]
fn what_others_change_is_as_computed() {
    let scene = |which: [bool; 2], films: bool| {
        let mut scene = water();
        let height = if films { -0.106 } else { -0.12 };
        scene.add_wall([0.0, 0.0, height], [0.0, 0.0, 1.0]);
        let of = |body: Body, scale: f64, put: bool| match put {
            true => body.added_mass(given(scale)),
            false => body,
        };
        scene.add(of(egg(), 1.0, which[0]));
        scene.add(of(brick(), 1.5, which[1]));
        scene
    };
    let alone = |body: Body, how| {
        let mut scene = water();
        scene.add(body);
        own(&scene, how, 0)
    };
    for how in HOW {
        let films = matches!(how.1, Method::Auto | Method::Panel) || how.0 != Fidelity::Full;
        let plain = Simulator::new(&scene([false; 2], films), settings(how)).unwrap();
        let kinematics = plain.system().tree.kinematics(plain.start().0);
        let unit = DMatrix::identity(12, 12);
        let film = plain
            .system()
            .coupling
            .film_momenta(&kinematics.poses, &unit);
        let film = film.unwrap().map_or(0.0, |m| m.amax());
        assert_eq!(film > 0.0, films, "{how:?}: {film}");
        let plain = plain.added_mass().unwrap();
        let computed = &plain.matrix;
        let coupled = computed.view((0, 6), (6, 6)).amax() / computed[(0, 0)];
        assert!(coupled > 0.01, "not near: {coupled}");
        let selves = [alone(egg(), how), alone(brick(), how)];
        for which in [[true, false], [false, true], [true, true]] {
            let simulator = Simulator::new(&scene(which, films), settings(how)).unwrap();
            let found = simulator.added_mass().unwrap();
            let mut worst = 0.0_f64;
            for (k, scale) in [(0, 1.0), (1, 1.5)] {
                let change = match which[k] {
                    true => matrix(given(scale)) - selves[k],
                    false => Mat6::zeros(),
                };
                let right = plain.own(k) / DENSITY + change;
                worst = worst.max(off(&(found.own(k) / DENSITY), &right));
            }
            // The blocks between them.
            let between = (found.matrix.view((0, 6), (6, 6)) - computed.view((0, 6), (6, 6)))
                .amax()
                / computed.view((0, 6), (6, 6)).amax();
            println!("{how:?} {which:?}: own {worst:.1e}, between {between:.1e}");
            assert!(
                worst < 1e-12 && between < 1e-12,
                "{how:?}: {worst:e} {between:e}"
            );
        }
    }
}

/// A fin of 0.3 by 0.2 m, 4 mm thick, flat before a wall: faces lose what it has along itself, and what is given counts.
#[test]
fn a_thin_plate_by_a_wall_runs() {
    let mut rows = [[0.0; 6]; 6];
    for (i, own) in [2e-5, 3e-5, 7e-3, 2e-5, 4e-5, 1e-7].iter().enumerate() {
        rows[i][i] = *own;
    }
    let mut scene = water();
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add_wall([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let plate = Body::new(Shape::cuboid([0.3, 0.2, 0.004]).faces(600)).named("fin");
    scene.add(plate.density(2700.0).added_mass(rows).at([0.0, 0.0, 0.05]));
    for how in [
        (Fidelity::Reduced, Method::Auto),
        (Fidelity::Full, Method::Panel),
    ] {
        let simulator = Simulator::new(&scene, settings(how)).unwrap();
        let across = simulator.added_mass().unwrap().matrix[(2, 2)] / DENSITY;
        // The wall's part comes on top.
        assert!(across > 1.2 * rows[2][2], "{across}");
        let run = simulator.rollout(&Controls::zeros(&simulator, 20)).unwrap();
        let last = run.samples().last().unwrap();
        println!("{how:?}: {across:.3e} m³ at the wall, v {:.3}", last.v[2]);
        assert!(last.v.iter().all(|v| v.is_finite()) && last.v[2] < 0.0);
    }
}

#[test]
fn one_far_from_the_computed_is_told() {
    let told = |scale: f64, how| {
        let mut scene = water();
        let computed = {
            scene.add(egg());
            own(&scene, how, 0)
        };
        scene.bodies[0].added_mass = Some(
            (0..6)
                .map(|i| (0..6).map(|j| scale * computed[(i, j)]).collect())
                .collect(),
        );
        let simulator = Simulator::new(&scene, settings(how)).unwrap();
        simulator.warnings().to_vec()
    };
    for how in HOW {
        for scale in [0.55, 1.0, 1.9] {
            assert_eq!(told(scale, how), Vec::<String>::new(), "{how:?} {scale}");
        }
        for (scale, number) in [(0.4, "0.40"), (3.0, "3.00")] {
            let warnings = told(scale, how);
            assert_eq!(warnings.len(), 1, "{how:?}: {warnings:?}");
            says(&warnings[0], &["\"egg\"", "added_mass", number, "shape"]);
        }
    }
    let isolated = (Fidelity::Isolated, Method::Auto);
    assert_eq!(told(3.0, isolated), Vec::<String>::new());
}

/// Bodies that hardly weigh anything, whose given added mass is far smaller than what the other changes: an error by the body's name, and no NaN.
#[test]
fn one_that_leaves_no_inertia_is_refused_by_name() {
    let mut scene = water();
    for (name, x) in [("left", -0.11), ("right", 0.11)] {
        let ball = Body::new(Shape::sphere(0.1).faces(320)).named(name);
        let ball = ball.density(1e-3).added_mass(given(1e-3));
        scene.add(ball.at([x, 0.0, 0.0]));
    }
    for how in HOW {
        let found = Simulator::new(&scene, settings(how));
        let refused = found.and_then(|s| s.rollout(&Controls::zeros(&s, 1)).map(|_| ()));
        let message = refused.expect_err("no inertia").to_string();
        println!("{how:?}: {message}");
        says(message, &["mass matrix M(q)", "t\"", "given added mass"]);
    }
    // By products alone there is no factor of both: a velocity of less than no energy tells.
    scene.initial.v = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0].repeat(2);
    for integrator in [
        Integrator::MomentumEuler,
        Integrator::Rk4,
        Integrator::Midpoint,
    ] {
        let settings = settings(HOW[0])
            .fidelity(Fidelity::Reduced)
            .exchange(Exchange::Products)
            .integrator(integrator);
        let found = Simulator::new(&scene, settings);
        let refused = found.and_then(|s| s.rollout(&Controls::zeros(&s, 1)).map(|_| ()));
        let message = refused.expect_err("no inertia").to_string();
        println!("{integrator:?} by products: {message}");
        says(message, &["mass matrix M(q)", "t\"", "given added mass"]);
    }
}

#[test]
fn without_a_shape_it_is_refused_where_bodies_are_coupled() {
    let mut scene = water();
    scene.add(egg());
    let bare = Body::default().named("bare").density(1.0);
    let mut bare = bare.added_mass(given(1.0)).at([1.0, 0.0, 0.0]);
    (bare.density, bare.mass, bare.inertia) = (None, Some(1.0), Some(vec![0.1; 3]));
    scene.add(bare);
    for stream in [false, true] {
        if stream {
            scene.add_force(Current::new([0.3, 0.0, 0.0]).into());
        }
        for how in HOW {
            let message = Simulator::new(&scene, settings(how)).err();
            let message = message.expect("no shape").to_string();
            says(
                message,
                &["\"bare\"", "no shape", "use the fidelity isolated"],
            );
        }
    }
}

/// In a stream the given matrix is what the body feels of it: as with `isolated`, which has always taken it.
#[test]
fn a_stream_acts_on_what_is_given() {
    let mut scene = water();
    // A box has the same volume by every mesh.
    scene.add(brick().added_mass(given(1.0)));
    let tide = Motion::Sine {
        offset: 0.3,
        amplitude: 0.8,
        frequency: 3.0,
        phase: 0.4,
    };
    scene.add_force(Current::new([0.4, 0.1, -0.2]).over_time(tide).into());
    scene.initial.v = vec![0.1, 0.0, 0.2, 0.3, -0.2, 0.1];
    let end = |how| {
        let simulator = Simulator::new(&scene, settings(how)).unwrap();
        let run = simulator.rollout(&Controls::zeros(&simulator, 10)).unwrap();
        run.samples().last().unwrap().v.clone()
    };
    let right: DVector<f64> = end((Fidelity::Isolated, Method::Auto));
    for how in HOW {
        let error = (end(how) - &right).norm() / right.norm();
        println!("{how:?}: {error:.1e}");
        assert!(error < 1e-11, "{how:?}: {error:e}");
    }
}

/// Nothing is known of the error of what is given; of what others change as much as ever.
#[test]
fn the_estimate_leaves_it_out() {
    let scene = |put: bool| {
        let mut scene = water();
        let egg = egg();
        scene.add(match put {
            true => egg.added_mass(given(1.0)),
            false => egg,
        });
        scene.add(brick());
        scene
    };
    for how in [
        (Fidelity::Reduced, Method::Panel),
        (Fidelity::Full, Method::Panel),
    ] {
        let [computed, given] = [false, true].map(|put| {
            let simulator = Simulator::new(&scene(put), settings(how)).unwrap();
            simulator.error_estimate().unwrap()
        });
        println!("{how:?}: {computed:?}\n{given:?}");
        assert!(computed.total.is_some() && given.total.is_none());
        says(given.missing.join("; "), &["given for body \"egg\""]);
        let [computed, given] = [computed, given].map(|e| e.extrapolation.unwrap());
        assert!(given > 0.0 && given < 2.0 * computed, "{given} {computed}");
    }
}
