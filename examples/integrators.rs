//! Prints the tables of `docs/integrators.md`: energy, momentum and cost of every integrator over the example
//! scenes. `cargo run --release --example integrators [FACES [SCENE]]`, by default with 320 faces a body; `SCENE` may be `long`, for 10⁵ steps, or
//! `cost`, for what an accuracy costs, which are printed by their names alone.

use hydrograd::adjoint::lie::Vec6;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Drag, DragPart, Fluid, Joint, Scene, Shape, Spring};
use hydrograd::simulate::Sample;
use hydrograd::{Controls, Error, Fidelity, Result, Rollout, Settings, Simulator};
use std::path::Path;
use std::time::Instant;

const INTEGRATORS: [(Integrator, &str); 6] = [
    (Integrator::MomentumEuler, "momentum Euler"),
    (Integrator::EnergyEuler, "energy Euler"),
    (Integrator::Midpoint, "midpoint"),
    (Integrator::Rk2, "RK2"),
    (Integrator::Rk4, "RK4"),
    (Integrator::VelocityEuler, "velocity Euler"),
];

fn scene(name: &str) -> Result<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes");
    Scene::load(folder.join(format!("{name}.toml")))
}

/// Largest change of the total momentum, linear or angular, against the largest momentum of one body;
/// an angular momentum counts at least as much as the linear one at an arm of the bodies' size.
fn momentum_drift(rollout: &Rollout) -> f64 {
    let s = rollout.samples();
    let bodies = &rollout.simulator().system().bodies;
    let size = bodies
        .iter()
        .map(|b| b.volume.cbrt())
        .fold(0.0_f64, f64::max);
    let largest = |at: usize, h: &dyn Fn(&Sample) -> Vec6| {
        s.iter()
            .map(|s| h(s).fixed_rows::<3>(at).amax())
            .fold(0.0_f64, f64::max)
    };
    let linear = largest(0, &|s| s.largest_momentum);
    let angular = largest(3, &|s| s.largest_momentum).max(size * linear);
    let change = |s: &Sample| s.momentum - rollout.samples()[0].momentum;
    (largest(0, &change) / linear).max(largest(3, &change) / angular)
}

/// Largest energy error relative to the largest energy.
fn energy_error(rollout: &Rollout) -> f64 {
    let s = rollout.samples();
    let scale = s.iter().map(|s| s.energy().abs()).fold(0.0, f64::max);
    let changes = s.iter().map(|x| (x.energy() - s[0].energy()).abs());
    changes.fold(0.0, f64::max) / scale
}

/// Largest difference of the energy from a converged run's with `ratio` times as many steps, relative to the largest energy.
fn energy_difference(rollout: &Rollout, converged: &Rollout, ratio: usize) -> f64 {
    let (s, c) = (rollout.samples(), converged.samples());
    let scale = c.iter().map(|s| s.energy().abs()).fold(0.0, f64::max);
    let differences = (0..s.len()).map(|n| (s[n].energy() - c[ratio * n].energy()).abs());
    differences.fold(0.0, f64::max) / scale
}

/// One row; `first` is the time of the first integrator.
fn row(
    scene: &str,
    integrator: &str,
    energy: f64,
    momentum: Option<f64>,
    seconds: f64,
    first: &mut f64,
) {
    if *first == 0.0 {
        *first = seconds;
    }
    let momentum = momentum.map_or("–".into(), |m| format!("{m:.0e}"));
    println!(
        "| {scene} | {integrator} | {:.4} % | {momentum} | {:.1} |",
        100.0 * energy,
        seconds / *first
    );
}

fn conserved(name: &str, fidelity: Fidelity, steps: Option<usize>, faces: usize) -> Result<()> {
    let scene = scene(name)?;
    let steps = steps.unwrap_or(scene.steps);
    let title = format!("{}, {steps} steps", scene.name);
    let mut first = 0.0;
    for (integrator, label) in INTEGRATORS {
        let settings = Settings::default().fidelity(fidelity).faces(faces);
        let simulator = Simulator::new(&scene, settings.integrator(integrator))?;
        let start = Instant::now();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, steps))?;
        let seconds = start.elapsed().as_secs_f64();
        let drift = Some(momentum_drift(&rollout));
        let energy = energy_error(&rollout);
        row(&title, label, energy, drift, seconds, &mut first);
    }
    Ok(())
}

/// The ball's way down, whose energy is what the push puts in: against midpoint with a quarter of the step.
/// It ends before the stop, which takes whatever energy is there at its step.
fn pushed(faces: usize) -> Result<()> {
    const RATIO: usize = 4;
    let mut scene = scene("falling_ball")?;
    scene.steps = 150;
    let title = format!("{}, {} steps", scene.name, scene.steps);
    let settings = Settings::default().fidelity(Fidelity::Full).faces(faces);
    let fine = settings
        .integrator(Integrator::Midpoint)
        .time_step(scene.time_step / RATIO as f64);
    let fine = Simulator::new(&scene, fine)?;
    let converged = fine.rollout(&Controls::zeros(&fine, RATIO * scene.steps))?;
    let mut first = 0.0;
    for (integrator, label) in INTEGRATORS {
        let simulator = Simulator::new(&scene, settings.integrator(integrator))?;
        let start = Instant::now();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, scene.steps))?;
        let seconds = start.elapsed().as_secs_f64();
        let energy = energy_difference(&rollout, &converged, RATIO);
        row(&title, label, energy, None, seconds, &mut first);
    }
    Ok(())
}

/// Observed order on the coins: errors of q and v after 0.16 s.
fn orders() -> Result<()> {
    let scene = scene("coins")?;
    let end = |integrator, steps: usize| {
        let settings = Settings::default()
            .fidelity(Fidelity::Full)
            .integrator(integrator)
            .tolerance(1e-13)
            .time_step(0.16 / steps as f64);
        let simulator = Simulator::new(&scene, settings.faces(80))?;
        let rollout = simulator.rollout(&Controls::zeros(&simulator, steps))?;
        let last = &rollout.samples()[steps];
        Ok((last.q.clone(), last.v.clone()))
    };
    let reference = end(Integrator::Rk4, 128)?;
    println!("\n| integrator | error at 16 steps | 32 | order |\n|---|---|---|---|");
    for (integrator, label) in INTEGRATORS {
        let mut errors = [0.0; 2];
        for (error, steps) in errors.iter_mut().zip([16, 32]) {
            let (q, v) = end(integrator, steps)?;
            let squares = (q - &reference.0).norm_squared() + (v - &reference.1).norm_squared();
            *error = squares.sqrt();
        }
        let order = (errors[0] / errors[1]).log2();
        println!(
            "| {label} | {:.1e} | {:.1e} | {order:.2} |",
            errors[0], errors[1]
        );
    }
    Ok(())
}

/// Two ellipsoids in each other's water, tied by a spring, tumbling.
fn tied() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    for (name, semi_axes, x, density) in [
        ("long", [0.1, 0.06, 0.04], -0.15, 998.0),
        ("flat", [0.08, 0.08, 0.05], 0.15, 1300.0),
    ] {
        let body = Body::new(Shape::ellipsoid(semi_axes).faces(80)).named(name);
        scene.add(body.density(density).at([x, 0.02, 0.0]));
    }
    let spring = Spring::new("long").at([0.0, 0.03, 0.0]);
    let spring = spring.to("flat", [0.0, -0.03, 0.02]).stiffness(10.0);
    scene.add_force(spring.rest_length(0.3).into());
    scene.initial.v = vec![
        0.02, 0.03, -0.01, 0.5, -1.0, 0.8, -0.01, -0.02, 0.02, 1.0, 0.6, -0.7,
    ];
    scene
}

/// A vehicle with an arm and quadratic drag that sinks in a current, `isolated`.
fn sinking() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -9.81];
    scene.fluid.current = [0.5, 0.0, 0.0];
    let drag = Drag {
        quadratic_part: DragPart::Total,
        quadratic: 0.5,
        ..Drag::default()
    };
    let oval = |x, y, z| Shape::ellipsoid([x, y, z]).faces(320);
    let hull = Body::new(oval(0.4, 0.2, 0.15))
        .named("hull")
        .density(1200.0);
    scene.add(hull.center_of_mass([0.02, 0.0, -0.03]).drag(drag));
    let arm = Body::new(oval(0.25, 0.05, 0.05))
        .child_of("hull")
        .density(1500.0);
    let arm = arm.at([0.4, 0.0, 0.0]).shape_at([0.25, 0.0, 0.0], [0.0; 3]);
    let axis = [0.0, 1.0, 0.3];
    scene.add(arm.joint(Joint::Revolute { axis }).drag(drag));
    scene.initial.v = vec![1.0, 0.2, 0.0, 0.3, 1.0, -0.5, 1.5];
    scene
}

/// Energy errors of 100,000 steps, at the scene's step of 0.01 s: at a tenth of them, and at all.
fn long() -> Result<()> {
    println!(
        "| scene | integrator | energy error in 10,000 steps | in 100,000 | time |\n|---|---|---|---|---|"
    );
    let ellipsoid = scene("kirchhoff_ellipsoid")?;
    for (title, scene, fidelity) in [
        ("Kirchhoff ellipsoid", ellipsoid, Fidelity::Isolated),
        ("two tied ellipsoids", tied(), Fidelity::Reduced),
    ] {
        let mut first = 0.0;
        'each: for (integrator, label) in INTEGRATORS {
            let settings = Settings::default().fidelity(fidelity).time_step(0.01);
            let simulator = Simulator::new(&scene, settings.integrator(integrator))?;
            let mut state = simulator.initial()?;
            let (mut errors, mut largest, mut start) = ([0.0_f64; 2], 0.0_f64, None);
            let clock = Instant::now();
            for part in 0..100 {
                let controls = Controls::zeros(&simulator, 1000);
                let go = |_| std::ops::ControlFlow::Continue(());
                let rollout = match simulator.rollout_from(&state, &controls, go) {
                    Ok(rollout) => rollout,
                    Err(error) => {
                        println!("| {title} | {label} | {error} |||");
                        continue 'each;
                    }
                };
                for s in rollout.samples() {
                    let start = *start.get_or_insert(s.energy());
                    largest = largest.max(s.energy().abs());
                    let error = (s.energy() - start).abs();
                    errors[1] = errors[1].max(error);
                    if part < 10 {
                        errors[0] = errors[0].max(error);
                    }
                }
                state = rollout.states()[1000].clone();
            }
            let seconds = clock.elapsed().as_secs_f64();
            if first == 0.0 {
                first = seconds;
            }
            println!(
                "| {title} | {label} | {:.1e} | {:.1e} | {:.1} |",
                errors[0] / largest,
                errors[1] / largest,
                seconds / first
            );
        }
    }
    Ok(())
}

/// What an accuracy costs: error of q after 2 s against RK4 at a sixteenth of the smallest step, and the time that the run takes, over steps.
fn cost() -> Result<()> {
    const TIME: f64 = 2.0;
    println!(
        "| scene | integrator | Δt, ms | error of q | µs a step | ms a run |\n|---|---|---|---|---|---|"
    );
    for (title, scene, fidelity) in [
        ("sinking vehicle", sinking(), Fidelity::Isolated),
        ("two tied ellipsoids", tied(), Fidelity::Reduced),
    ] {
        let run = |integrator, dt: f64, repeat: usize| {
            let settings = Settings::default().fidelity(fidelity).tolerance(1e-12);
            let settings = settings.integrator(integrator).time_step(dt);
            let simulator = Simulator::new(&scene, settings)?;
            let steps = (TIME / dt).round() as usize;
            let controls = Controls::zeros(&simulator, steps);
            let (mut least, mut q) = (f64::INFINITY, None);
            for _ in 0..repeat {
                let clock = Instant::now();
                let rollout = simulator.rollout(&controls)?;
                least = least.min(clock.elapsed().as_secs_f64());
                q = Some(rollout.samples()[steps].q.clone());
            }
            Ok::<_, hydrograd::Error>((q, least, steps))
        };
        let (exact, ..) = run(Integrator::Rk4, 0.0025 / 8.0, 1)?;
        for (integrator, label) in INTEGRATORS {
            for dt in [0.04, 0.02, 0.01, 0.005, 0.0025] {
                match run(integrator, dt, 3) {
                    Ok((q, seconds, steps)) => {
                        let error = q
                            .zip(exact.clone())
                            .map_or(f64::NAN, |(q, e)| (q - e).norm());
                        println!(
                            "| {title} | {label} | {:.1} | {error:.1e} | {:.1} | {:.2} |",
                            1e3 * dt,
                            1e6 * seconds / steps as f64,
                            1e3 * seconds
                        );
                    }
                    Err(error) => println!("| {title} | {label} | {:.1} | {error} |||", 1e3 * dt),
                }
            }
        }
    }
    Ok(())
}

/// Scenes whose energy and momentum are conserved.
const CONSERVED: [&str; 4] = ["coins", "two_spheres", "cube", "kirchhoff_ellipsoid"];

/// Faces a body, and what is printed alone.
fn asked(given: &[String]) -> Result<(usize, Option<&str>)> {
    let faces = given.first().map_or(Ok(320), |text| {
        let usage = "must be a whole number above zero: integrators [FACES [SCENE]]";
        let above = text.parse().ok().filter(|faces| *faces > 0);
        above.ok_or_else(|| Error::input("FACES", text, usage))
    })?;
    let known = [&CONSERVED[..], &["falling_ball", "long", "cost"]].concat();
    let only = given.get(1).map(String::as_str);
    match only.filter(|name| !known.contains(name)) {
        Some(name) => Err(Error::input(
            "SCENE",
            name,
            format!("must be one of {known:?}"),
        )),
        None => Ok((faces, only)),
    }
}

fn main() -> Result<()> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let (faces, only) = asked(&given)?;
    match only {
        Some("long") => return long(),
        Some("cost") => return cost(),
        _ => {}
    }
    let wanted = |name: &str| only.is_none_or(|o| o == name);
    println!(
        "| scene | integrator | energy error | momentum drift | time |\n|---|---|---|---|---|"
    );
    for name in CONSERVED {
        if wanted(name) {
            conserved(name, Fidelity::Full, None, faces)?;
        }
    }
    if wanted("kirchhoff_ellipsoid") {
        conserved(
            "kirchhoff_ellipsoid",
            Fidelity::Isolated,
            Some(10_000),
            faces,
        )?;
    }
    if wanted("falling_ball") {
        pushed(faces)?;
    }
    if only.is_none() {
        orders()?;
    }
    Ok(())
}

#[test]
fn what_is_not_understood_is_an_error() -> Result<()> {
    let of = |given: &[&str]| given.iter().map(|s| s.to_string()).collect::<Vec<_>>();
    for (given, word) in [
        (&["long"][..], "FACES"),
        (&["0"], "FACES"),
        (&["80", "lng"], "SCENE"),
    ] {
        let said = asked(&of(given)).unwrap_err().to_string();
        assert!(said.contains(word), "{said}");
    }
    assert_eq!(asked(&[])?, (320, None));
    assert_eq!(asked(&of(&["80", "long"]))?, (80, Some("long")));
    Ok(())
}
