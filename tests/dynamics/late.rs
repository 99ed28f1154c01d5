//! Midpoint and joints that are resisted stiffly: nothing rings, and the order stays.

use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Fluid, Joint, Passive, Scene, Servo, Shape};
use hydrograd::simulate::gradcheck::{GradcheckSettings, gradcheck};
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use nalgebra::DMatrix;

/// A hull that floats, and a small gripper on a hinge.
fn gripper(passive: Option<Passive>, servo: Option<Servo>) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add(
        Body::new(Shape::ellipsoid([0.3, 0.2, 0.15]).faces(80))
            .named("hull")
            .density(998.0)
            .thruster(),
    );
    let mut grip = Body::new(Shape::ellipsoid([0.05, 0.02, 0.02]).faces(80))
        .named("grip")
        .density(1100.0)
        .child_of("hull")
        .at([0.36, 0.0, 0.0])
        .shape_at([0.06, 0.0, 0.0], [0.0; 3])
        .joint(Joint::Revolute {
            axis: [0.0, 1.0, 0.0],
        })
        .actuated();
    if let Some(passive) = passive {
        grip = grip.passive(passive);
    }
    if let Some(servo) = servo {
        grip = grip.servo(servo);
    }
    scene.add(grip);
    scene
}

fn simulator(scene: &Scene, integrator: Integrator, dt: f64) -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    Simulator::new(scene, settings.integrator(integrator).time_step(dt)).unwrap()
}

fn run(simulator: &Simulator, steps: usize, control: impl Fn(usize) -> f64) -> Rollout {
    let value = |i, n| if i == 6 { control(n) } else { 0.0 };
    let controls = DMatrix::from_fn(simulator.system().controls, steps, value);
    let controls = Controls::from_matrix(simulator, controls).unwrap();
    simulator.rollout(&controls).unwrap()
}

/// The joint's rate in the last steps: the largest, and the most by which it jumps from one state to the next.
fn end(rollout: &Rollout) -> [f64; 2] {
    let rates: Vec<f64> = rollout
        .samples()
        .iter()
        .rev()
        .take(20)
        .map(|s| s.v[6])
        .collect();
    let most = rates.iter().map(|x| x.abs()).fold(0.0, f64::max);
    let jumps = rates.windows(2).map(|r| (r[1] - r[0]).abs());
    [most, jumps.fold(0.0, f64::max)]
}

#[test]
fn stiff_servos_dont_ring() {
    for (stiffness, damping) in [
        (1e4, 10.0),
        (1e4, 0.0),
        (100.0, 1.0),
        (100.0, 0.0),
        (1.0, 0.0),
    ] {
        let scene = gripper(None, Some(Servo::new(stiffness, damping)));
        let [mid, euler] = [Integrator::Midpoint, Integrator::MomentumEuler].map(|i| {
            let simulator = simulator(&scene, i, 0.01);
            end(&run(&simulator, 300, |_| 0.05))
        });
        println!("{stiffness}, {damping}: {mid:?}, momentum Euler {euler:?}");
        // The hull goes on turning a little, and the joint with it.
        assert!(
            mid[0] < 2e-3 && mid[1] < 1e-4,
            "{stiffness}, {damping}: {mid:?}"
        );
    }
}

/// Under half of its friction's torque a joint creeps by the law's own speed; let go, it stops.
#[test]
fn friction_holds_and_stops() {
    let (friction, speed) = (0.02, 0.02);
    let passive = Passive::default().friction(friction).friction_speed(speed);
    let mut scene = gripper(Some(passive), None);
    scene.gravity = [0.0; 3];
    let simulator = simulator(&scene, Integrator::Midpoint, 0.01);
    let rollout = run(
        &simulator,
        200,
        |n| if n < 100 { 0.5 * friction } else { 0.0 },
    );
    let creep = speed * 0.5 / 0.75_f64.sqrt();
    let rates: Vec<f64> = rollout.samples().iter().map(|s| s.v[6]).collect();
    println!(
        "{:.5?} … {:.5?}, {:?}",
        &rates[..4],
        &rates[97..104],
        &rates[197..]
    );
    for rate in &rates[10..100] {
        assert!((rate / creep - 1.0).abs() < 0.05, "{rate} for {creep}");
    }
    assert!(rates[110..].iter().all(|r| r.abs() < 1e-6));
}

/// The error falls with the square of the time step where damping is resolved.
#[test]
fn damped_joints_keep_the_order() {
    let passive = Passive::default().stiffness(0.05).damping(2e-3).rest(0.4);
    let scene = gripper(Some(passive.friction(2e-3).friction_speed(0.5)), None);
    let whole = |integrator, steps: usize| {
        let simulator = simulator(&scene, integrator, 0.5 / steps as f64);
        let rollout = run(&simulator, steps, |_| 0.0);
        let last = rollout.samples().last().unwrap().clone();
        (last.q, last.v)
    };
    let exact = whole(Integrator::Rk4, 800);
    let errors = [50, 100, 200].map(|steps| {
        let (q, v) = whole(Integrator::Midpoint, steps);
        (q - &exact.0).amax().max((v - &exact.1).amax())
    });
    println!("{errors:?}");
    for pair in errors.windows(2) {
        assert!(pair[0] / pair[1] > 3.5, "{errors:?}");
    }
}

/// Stiff and not, alone and feeling each other through the water.
#[test]
fn gradients_are_those_of_the_steps() {
    let stiff = Passive::default().friction(0.02).friction_speed(0.02);
    let mild = Passive::default().stiffness(0.05).damping(2e-3).rest(0.2);
    let servo = |stiffness, damping| Some(Servo::new(stiffness, damping));
    for (name, passive, servo) in [
        ("friction", Some(stiff), None),
        ("spring", Some(mild), None),
        ("servo", None, servo(100.0, 1.0)),
        ("both", Some(stiff.damping(0.01)), servo(20.0, 0.1)),
    ] {
        let mut scene = gripper(passive, servo);
        scene.initial.v = vec![
            0.2, 0.1, -0.1, 0.3, -0.2, 0.1, 0.4, -0.1, 0.2, 0.0, 0.1, 0.5, 0.2,
        ];
        scene.add(
            Body::new(Shape::sphere(0.1).faces(80))
                .density(1000.0)
                .at([0.7, 0.0, 0.1]),
        );
        for fidelity in [Fidelity::Isolated, Fidelity::Reduced] {
            let settings = Settings::default().fidelity(fidelity);
            let settings = settings.integrator(Integrator::Midpoint);
            let mut simulator = Simulator::new(&scene, settings).unwrap();
            let settings = GradcheckSettings {
                steps: 12,
                directions: 2,
                seed: 5,
                timings: 0,
                enough: Some(1e-6),
            };
            let found = gradcheck(&mut simulator, &settings).unwrap();
            println!("{name}, {fidelity:?}: {:.1e}", found.max_rel_error);
            assert!(found.max_rel_error < 1e-6, "{name}, {fidelity:?}");
        }
    }
}

/// From rest a servo's force is at once at its largest, where it has no power yet, and is spent where its joint is fast: no energy comes from nowhere, whatever the step.
#[test]
fn a_servo_that_starts_from_rest_is_not_called_unstable() {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add(
        Body::new(Shape::cuboid([0.02, 0.03, 0.05]).faces(200))
            .density(2700.0)
            .joint(Joint::Prismatic {
                axis: [-1.0, 0.0, 0.0],
            })
            .actuated()
            .servo(Servo::new(4000.0, 40.0)),
    );
    for integrator in [Integrator::MomentumEuler, Integrator::Midpoint] {
        for dt in [0.02, 0.01, 0.005, 0.004, 0.003, 0.002, 0.001] {
            let simulator = simulator(&scene, integrator, dt);
            let controls = DMatrix::from_element(1, (0.1 / dt) as usize, 0.015);
            let controls = Controls::from_matrix(&simulator, controls).unwrap();
            let told = simulator.rollout(&controls).unwrap().warnings();
            assert!(told.is_empty(), "{integrator:?}, {dt} s: {told:?}");
        }
    }
}
