//! Currents by depth and time, against the uniform steady one, Lamb's sphere, and differences.

use crate::support::says;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{
    Body, Current, Drag, DragPart, Fin, Float, Fluid, Joint, Motion, Passive, Scene, Shape,
    Thruster,
};
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DVector, UnitQuaternion, Vector3};

const DENSITY: f64 = 998.0;

fn water(current: [f64; 3]) -> Fluid {
    Fluid {
        density: DENSITY,
        current,
    }
}

fn tide() -> Motion {
    Motion::Sine {
        offset: 0.3,
        amplitude: 0.8,
        frequency: 3.0,
        phase: 0.4,
    }
}

/// A box with a fin, a thruster and drag, and an arm on it, over a wall: nothing is symmetric.
fn swimmer(current: [f64; 3]) -> Scene {
    let mut scene = Scene::new(water(current));
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add_wall([0.0, 0.0, -3.0], [0.0, 0.0, 1.0]);
    let drag = Drag {
        part: DragPart::Total,
        linear: 20.0,
        quadratic_part: DragPart::Normal,
        quadratic: 0.5,
    };
    let hull = Body::new(Shape::cuboid([0.5, 0.3, 0.2]).faces(108)).named("hull");
    let hull = hull.density(1020.0).center_of_mass([0.01, 0.0, -0.02]);
    scene.add(hull.rotated([0.1, -0.2, 0.3]).drag(drag));
    let arm = Body::new(Shape::cuboid([0.3, 0.06, 0.04]).faces(108)).named("arm");
    let arm = arm.density(1300.0).at([0.45, 0.0, 0.0]);
    let axis = [0.0, 1.0, 0.0];
    scene.add(arm.joint(Joint::Revolute { axis }).child_of("hull"));
    let fin = Fin::new("hull").at([-0.3, 0.0, 0.0]);
    let fin = fin.chord([1.0, 0.0, 0.0], 0.1).normal([0.0, 1.0, 0.0]);
    scene.add_force(fin.area(0.02).lift_slope(4.0).drag(0.02).into());
    let jet = Thruster::new("hull").at([-0.25, 0.05, 0.0]);
    scene.add_force(jet.loss(0.3).smoothing(0.1).into());
    scene
}

fn simulator(scene: &Scene, fidelity: Fidelity, integrator: Integrator) -> Simulator {
    let settings = Settings::default().fidelity(fidelity);
    Simulator::new(scene, settings.integrator(integrator)).unwrap()
}

fn wavy(n: usize, phase: f64, size: f64) -> DVector<f64> {
    DVector::from_fn(n, |i, _| size * (1.7 * i as f64 + phase).sin())
}

fn acceleration(sim: &Simulator, q: &DVector<f64>, v: &DVector<f64>, t: f64) -> DVector<f64> {
    let (zeros, u) = (
        DVector::zeros(v.len()),
        wavy(sim.no_control().len(), 0.2, 3.0),
    );
    let at = sim.equations_at(q, t).unwrap();
    at.acceleration(v, &u, &zeros, &zeros).unwrap()
}

/// One that neither depth nor time changes is the uniform steady one, for bodies that don't feel each other exactly (1e-13). Coupled ones, here a hull with an arm a tenth of its length
/// away, lack what each does to the stream at the other: up to a third of what the current does to the accelerations.
#[test]
fn a_steady_uniform_one_is_that_of_the_fluid() {
    let stream = [0.6, -0.4, 0.0];
    let mut by_force = swimmer([0.0; 3]);
    by_force.add_force(Current::new(stream).into());
    let mut both = swimmer([0.4, -0.1, 0.0]);
    both.add_force(Current::new([0.2, -0.3, 0.0]).into());
    let flat = Current::new(stream).profile(vec![[-5.0, 1.0], [0.0, 1.0], [5.0, 1.0]]);
    let mut flat_profile = swimmer([0.0; 3]);
    flat_profile.add_force(flat.into());
    for (fidelity, limit) in [(Fidelity::Isolated, 1e-13), (Fidelity::Reduced, 0.4)] {
        let make = |scene: &Scene| simulator(scene, fidelity, Integrator::Rk4);
        let known = make(&swimmer(stream));
        let still = make(&swimmer([0.0; 3]));
        let n = known.start().1.len();
        for (k, other) in [&by_force, &both, &flat_profile].into_iter().enumerate() {
            let other = make(other);
            let phase = k as f64;
            let q = known
                .integrate(known.start().0, &wavy(n, phase, 0.2))
                .unwrap();
            let v = wavy(n, 2.0 + phase, 0.7);
            let [a, b, rest] = [&known, &other, &still].map(|s| acceleration(s, &q, &v, 0.7));
            let error = (&a - &b).norm() / (&a - rest).norm();
            println!("{fidelity:?}: {error:.1e} of what the current does");
            assert!(error < limit, "{fidelity:?} {k}: {error:.1e}");
        }
    }
}

/// A neutrally buoyant body goes with water that accelerates (1e-6 m/s by RK4), turned and with a shape that isn't round, for every fidelity and by integrators of second order and above.
#[test]
fn a_neutrally_buoyant_body_goes_with_accelerating_water() {
    let mut scene = Scene::new(water([0.1, 0.2, 0.0]));
    scene.time_step = 0.01;
    let body = Body::new(Shape::cuboid([0.4, 0.2, 0.1]).faces(108)).named("box");
    scene.add(body.density(DENSITY));
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.5, -0.2));
    scene.initial.q = vec![0.0, 0.0, 0.0, turn.w, turn.i, turn.j, turn.k];
    let velocity = Vector3::new(0.5, -0.2, 0.3);
    scene.add_force(Current::new(velocity.into()).over_time(tide()).into());
    for fidelity in [Fidelity::Isolated, Fidelity::Reduced, Fidelity::Full] {
        for integrator in [Integrator::Rk4, Integrator::Midpoint] {
            let mut scene = scene.clone();
            let start = tide().value(0.0) * velocity + Vector3::new(0.1, 0.2, 0.0);
            scene.initial.v = vec![start.x, start.y, start.z, 0.0, 0.0, 0.0];
            let sim = simulator(&scene, fidelity, integrator);
            let rollout = sim.rollout(&Controls::zeros(&sim, 100)).unwrap();
            let end = &rollout.samples()[100].v;
            let with = tide().value(1.0) * velocity + Vector3::new(0.1, 0.2, 0.0);
            let off = (end.fixed_rows::<3>(0) - with).norm() + end.fixed_rows::<3>(3).norm();
            // Midpoint takes the acceleration in the middle of each step.
            let limit = match integrator {
                Integrator::Rk4 => 1e-6,
                _ => 1e-4,
            };
            println!("{fidelity:?} {integrator:?}: {off:.1e} m/s");
            assert!(off < limit, "{fidelity:?} {integrator:?}: {off:.1e}");
        }
    }
}

/// So does one that floats make neutral, and one that is but a volume: a stream that accelerates by a is gravity that is smaller by a, to whoever goes along.
#[test]
fn floats_and_volumes_go_with_accelerating_water() {
    let acceleration = Vector3::new(0.7, -0.4, 0.3);
    let ramp = Motion::Linear {
        offset: 0.0,
        rate: 1.0,
    };
    let steps = 100;
    let scene = |moving: bool| {
        let mut scene = Scene::new(water([0.1, 0.0, 0.0]));
        scene.time_step = 5e-3;
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        scene.gravity = match moving {
            true => gravity,
            false => gravity - acceleration,
        }
        .into();
        let hull = Body::new(Shape::cuboid([0.4, 0.3, 0.2]).faces(108)).named("hull");
        scene.add(hull.mass(26.0).center_of_mass([0.01, 0.0, -0.02]));
        let pod = Body::dry().named("pod").mass(1.0).inertia([0.01; 3]);
        let pod = pod.volume(0.002).joint(Joint::Prismatic {
            axis: [1.0, 0.0, 0.0],
        });
        let pod = pod.passive(Passive::default().stiffness(30.0));
        scene.add(pod.child_of("hull").at([0.0, 0.1, 0.3]));
        let foam = Float::new("hull").at([0.0, 0.05, 0.1]).volume(0.002);
        scene.add_force(foam.mass(0.3).into());
        if moving {
            let current = Current::new(acceleration.into());
            scene.add_force(current.over_time(ramp.clone()).into());
        }
        scene.initial.v = vec![0.4, 0.2, -0.3, 1.0, 2.0, -1.0, 0.1];
        scene
    };
    for integrator in [Integrator::Rk4, Integrator::Midpoint] {
        let run = |moving| {
            let sim = simulator(&scene(moving), Fidelity::Isolated, integrator);
            sim.rollout(&Controls::zeros(&sim, steps)).unwrap()
        };
        let (moving, still) = (run(true), run(false));
        let pairs = moving.samples().iter().zip(still.samples());
        let off = pairs.map(|(a, b)| {
            let carried = 0.5 * a.time * a.time * acceleration;
            let each = a.poses.iter().zip(&b.poses);
            let each = each.map(|(a, b)| (a.translation - b.translation - carried).norm());
            each.fold(0.0, f64::max)
        });
        let off = off.fold(0.0, f64::max);
        println!("{integrator:?}: {off:.1e} m");
        let limit = match integrator {
            Integrator::Rk4 => 1e-8,
            _ => 1e-5,
        };
        assert!(off < limit, "{integrator:?}: {off:.1e}");
    }
}

/// A sphere of another density is accelerated 3/(2s + 1) times as much as the water, s its density over the water's (Lamb, art. 92).
#[test]
fn a_sphere_lags_or_leads_as_lamb_has_it() {
    for ratio in [0.1, 0.5, 2.0, 7.8] {
        let mut scene = Scene::new(water([0.0; 3]));
        scene.add(
            Body::new(Shape::sphere(0.1))
                .named("ball")
                .density(ratio * DENSITY),
        );
        let along = Vector3::new(0.7, 0.2, -0.4);
        scene.add_force(Current::new(along.into()).over_time(tide()).into());
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let settings = settings.method(hydrograd::simulate::Method::Exact);
        let sim = Simulator::new(&scene, settings).unwrap();
        let (q, _) = sim.start();
        for t in [0.0, 0.4, 1.3] {
            let found = acceleration(&sim, q, &DVector::zeros(6), t);
            // The mass of a sphere's triangles is a little less than a sphere's.
            let mass = sim.parameters().mass(0);
            let (displaced, added) = (
                mass / ratio,
                0.5 * DENSITY * 4.0 / 3.0 * std::f64::consts::PI * 1e-3,
            );
            let expected = (displaced + added) / (mass + added) * tide().rate(t) * along;
            let error = (found.rows(0, 3) - expected).norm() / expected.norm();
            assert!(error < 1e-3, "{ratio} {t}: {error:.1e}");
            let ideal = 3.0 / (2.0 * ratio + 1.0) * tide().rate(t) * along;
            assert!((found.rows(0, 3) - ideal).norm() < 0.02 * ideal.norm());
        }
    }
}

/// What only drags ends up with the water of its depth; the end's share holds beyond the profile, without a kink.
#[test]
fn bodies_drift_with_the_water_of_their_depth() {
    let mut scene = Scene::new(water([0.0; 3]));
    scene.gravity = [0.0, 0.0, -9.81];
    scene.waterline = Some(2.0);
    scene.time_step = 0.05;
    let depths = [0.5, 3.0, 5.0, 9.0, 12.0];
    for (k, depth) in depths.iter().enumerate() {
        let ball = Body::new(Shape::sphere(0.1).faces(80)).named(format!("ball {k}"));
        let drag = Drag {
            part: DragPart::Total,
            linear: 500.0,
            ..Drag::default()
        };
        scene.add(
            ball.density(DENSITY)
                .at([0.0, k as f64, 2.0 - depth])
                .drag(drag),
        );
    }
    let profile = vec![[1.0, 1.0], [4.0, 0.6], [10.0, -0.2]];
    scene.add_force(Current::new([0.4, 0.0, 0.0]).profile(profile).into());
    let sim = simulator(&scene, Fidelity::Isolated, Integrator::Midpoint);
    let rollout = sim.rollout(&Controls::zeros(&sim, 200)).unwrap();
    let end = &rollout.samples()[200].v;
    let speeds: Vec<f64> = (0..depths.len()).map(|b| end[6 * b]).collect();
    // The first and the last lie beyond the points.
    assert!((speeds[0] - 0.4).abs() < 1e-6, "{speeds:?}");
    assert!((speeds[4] + 0.08).abs() < 1e-6, "{speeds:?}");
    assert!(speeds.windows(2).all(|v| v[0] > v[1]), "{speeds:?}");
    assert!(
        speeds[1] > 0.24 && speeds[2] < 0.24 && speeds[2] > -0.08,
        "{speeds:?}"
    );
    // They keep their depth.
    for (b, depth) in depths.iter().enumerate() {
        let z = rollout.samples()[200].poses[b].translation.z;
        assert!((2.0 - z - depth).abs() < 1e-3, "{b}: {z}");
    }
}

/// Errors fall with the time step as the integrator's order has it, though the water changes with time.
#[test]
fn integrators_keep_their_order() {
    let mut scene = swimmer([0.1, 0.0, 0.0]);
    scene.add_force(Current::new([0.8, 0.3, 0.0]).over_time(tide()).into());
    let end = |integrator, steps: usize| {
        let mut scene = scene.clone();
        scene.time_step = 0.4 / steps as f64;
        let sim = simulator(&scene, Fidelity::Isolated, integrator);
        let rollout = sim.rollout(&Controls::zeros(&sim, steps)).unwrap();
        rollout.samples()[steps].v.clone()
    };
    let known = end(Integrator::Rk4, 1280);
    for (integrator, order) in [
        (Integrator::MomentumEuler, 1.0),
        (Integrator::EnergyEuler, 1.0),
        (Integrator::VelocityEuler, 1.0),
        (Integrator::Midpoint, 2.0),
        (Integrator::Rk2, 2.0),
        // Quadratic drag has a kink in its second derivative, which some step meets.
        (Integrator::Rk4, 3.5),
    ] {
        let steps = if order > 2.0 { 20 } else { 160 };
        let [coarse, fine] = [steps, 2 * steps].map(|n| (end(integrator, n) - &known).norm());
        let found = (coarse / fine).log2();
        println!("{integrator:?}: {fine:.1e}, order {found:.2}");
        assert!(found > order - 0.3, "{integrator:?}: {found}");
    }
}

/// Every group of the gradient, the currents' velocities and shares among them, against differences: 1e-7.
#[test]
fn gradients_are_the_differences() {
    let mut scene = swimmer([0.2, 0.1, 0.0]);
    let profile = vec![[-1.0, 0.8], [-0.2, 1.0], [0.3, 0.5], [1.5, 0.2]];
    let deep = Current::new([0.5, -0.3, 0.0])
        .named("wind")
        .profile(profile);
    scene.add_force(deep.over_time(tide()).into());
    scene.add_force(Current::new([0.0, 0.0, 0.0]).named("unknown").into());
    let foam = Float::new("arm").named("foam").at([0.02, 0.01, 0.03]);
    scene.add_force(foam.volume(1e-4).mass(0.02).into());
    assert_eq!(
        Scene::from_toml(&scene.to_toml().unwrap(), "").unwrap(),
        scene
    );
    for fidelity in [Fidelity::Isolated, Fidelity::Reduced] {
        for integrator in [
            Integrator::MomentumEuler,
            Integrator::Midpoint,
            Integrator::Rk4,
            Integrator::VelocityEuler,
        ] {
            let mut sim = simulator(&scene, fidelity, integrator);
            let names = sim
                .parameters()
                .names()
                .map(String::from)
                .collect::<Vec<_>>();
            for name in [
                "wind.velocity.y",
                "wind.share.2",
                "unknown.velocity.x",
                "foam.volume",
            ] {
                assert!(names.iter().any(|n| n == name), "{name} isn't in {names:?}");
            }
            let settings = gradcheck::GradcheckSettings {
                steps: 20,
                directions: 2,
                seed: 3,
                timings: 0,
                enough: Some(1e-7),
            };
            let report = gradcheck(&mut sim, &settings).unwrap();
            println!("{fidelity:?} {integrator:?}: {:.1e}", report.max_rel_error);
            assert!(
                report.max_rel_error < 1e-7,
                "{fidelity:?} {integrator:?}: {report:?}"
            );
        }
    }
}

#[test]
fn what_can_not_be_is_refused() {
    let refused = |current: Current, expected: &[&str]| {
        let mut scene = swimmer([0.0; 3]);
        scene.add_force(current.into());
        says(scene.validate().unwrap_err(), expected);
    };
    let level = || Current::new([0.3, 0.0, 0.0]);
    refused(
        Current::new([0.3, f64::NAN, 0.0]),
        &["forces[2].velocity", "NaN", "finite"],
    );
    refused(
        Current::new([0.3, 0.0, 0.1]),
        &["forces[2].velocity", "walls[0]", "parallel"],
    );
    refused(
        level().profile(vec![[0.0, 1.0]]),
        &["forces[2].profile", "two points"],
    );
    refused(
        level().profile(vec![[0.0, 1.0], [2.0, f64::INFINITY]]),
        &["forces[2].profile", "inf"],
    );
    refused(
        level().profile(vec![[0.0, 1.0], [2.0, 0.5], [2.0, 0.4]]),
        &["forces[2].profile[2]", "ascend"],
    );
    let endless = Motion::Linear {
        offset: 0.0,
        rate: f64::INFINITY,
    };
    refused(
        level().over_time(endless),
        &["forces[2].over_time.rate", "inf"],
    );
    let mut open = swimmer([0.0; 3]);
    open.walls.clear();
    let rising = Current::new([0.3, 0.0, 0.1]);
    open.add_force(rising.profile(vec![[0.0, 1.0], [2.0, 0.5]]).into());
    says(
        open.validate().unwrap_err(),
        &["forces[2].velocity", "level"],
    );
    let mut beside = swimmer([0.0; 3]);
    beside.walls.clear();
    beside.add_force(level().profile(vec![[0.0, 1.0], [2.0, 0.5]]).into());
    beside.add_force(Current::new([0.0, 0.0, 0.1]).into());
    says(
        beside.validate().unwrap_err(),
        &["forces[2].profile", "0.1", "rise or sink"],
    );
    let sim = simulator(&swimmer([0.0; 3]), Fidelity::Isolated, Integrator::Rk4);
    says(
        sim.equations_at(sim.start().0, f64::NAN)
            .map(|_| ())
            .unwrap_err(),
        &["time", "NaN"],
    );
}
