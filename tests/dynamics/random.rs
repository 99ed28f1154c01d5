//! Runs at the ends of what can be asked for, drawn by chance: each is finite with an energy that something accounts for, or ends in an error, or has a warning.

use crate::support::INTEGRATORS;
use hydrograd::adjoint::sample::numbers;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{
    Body, Controller, Drag, DragPart, Fluid, Joint, Motion, Scene, Shape, Spring,
};
use hydrograd::simulate::Sample;
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator, objective};

const STEPS: usize = 40;
const COUNT: usize = 120;

/// Numbers of one scene, used one after the other.
struct Dice(std::vec::IntoIter<f64>);

impl Dice {
    fn new(seed: u64) -> Self {
        Self(numbers(seed, 400, 1.0).into_iter())
    }

    /// From −1 to 1.
    fn even(&mut self) -> f64 {
        self.0.next().expect("enough numbers")
    }

    fn three(&mut self, size: f64) -> [f64; 3] {
        std::array::from_fn(|_| size * self.even())
    }

    /// From 10^low to 10^high, each power as likely.
    fn power(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(low + (high - low) * 0.5 * (self.even() + 1.0))
    }

    fn chance(&mut self, of: f64) -> bool {
        0.5 * (self.even() + 1.0) < of
    }
}

fn scene(dice: &mut Dice) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    if dice.chance(0.3) {
        let size = dice.power(-2.0, 1.5);
        scene.fluid.current = dice.three(size);
    }
    if dice.chance(0.5) {
        scene.gravity = [0.0, 0.0, -9.81];
    }
    let mut controls = 0;
    for b in 0..2 {
        let size = dice.power(-1.5, 0.0);
        let shape = Shape::ellipsoid([size, 0.6 * size, 0.5 * size]).faces(20);
        let mut body = Body::new(shape).density(dice.power(1.5, 4.0));
        body = body.named(["first", "second"][b]);
        let joint = match dice.chance(0.3) {
            true => Joint::Revolute {
                axis: [0.3, 0.8, -0.2],
            },
            false => Joint::Free,
        };
        body = body.at([4.0 * b as f64, 0.0, 0.0]).joint(joint);
        if b == 1 && dice.chance(0.3) {
            body = body.child_of("first").at([2.5 * size, 0.0, 0.0]);
        }
        if dice.chance(0.6) {
            body = body.drag(Drag {
                part: DragPart::Total,
                linear: if dice.chance(0.5) {
                    dice.power(0.0, 6.0)
                } else {
                    0.0
                },
                quadratic_part: DragPart::Total,
                quadratic: if dice.chance(0.5) {
                    dice.power(-1.0, 4.0)
                } else {
                    0.0
                },
            });
        }
        match joint {
            Joint::Revolute { .. } if dice.chance(0.4) => {
                body = body.driven([Motion::Sine {
                    offset: 0.0,
                    amplitude: dice.power(-1.0, 1.0),
                    frequency: dice.power(-1.0, 2.0),
                    phase: 0.3,
                }]);
            }
            _ if dice.chance(0.5) => {
                body = body.actuated();
                controls += joint.velocities();
            }
            _ => {}
        }
        let count = joint.velocities();
        let speed = dice.power(-2.0, 2.0);
        let given = dice.chance(0.7) && body.motion.is_none();
        scene
            .initial
            .v
            .extend((0..count).map(|_| if given { speed * dice.even() } else { 0.0 }));
        scene.add(body);
    }
    if dice.chance(0.4) {
        let spring = Spring::new("first").to("second", [0.05, 0.0, 0.0]);
        let spring = spring.stiffness(dice.power(0.0, 5.0));
        scene.add_force(
            spring
                .rest_length(1.0)
                .damping(dice.power(-1.0, 5.0))
                .into(),
        );
    }
    if controls > 0 {
        let size = dice.power(-2.0, 5.0);
        let control = (0..controls).map(|_| size * dice.even()).collect();
        scene.controller = Some(Controller::Constant { control });
    }
    scene.time_step = dice.power(-3.0, -0.5);
    scene
}

/// The most energy that anything accounts for, J: at first, of the fall, what controls can do on their way, and what motions and current carry along.
fn accounted(scene: &Scene, rollout: &Rollout) -> f64 {
    let samples = rollout.samples();
    let potential = samples.iter().map(|s| s.potential_energy);
    let fall = potential.clone().fold(f64::MIN, f64::max) - potential.fold(f64::MAX, f64::min);
    let fastest = |s: &Sample| s.v.amax();
    let speed = samples.iter().map(fastest).fold(0.0, f64::max);
    let push: f64 = samples[0].control.iter().map(|u| u.abs()).sum();
    let time = STEPS as f64 * scene.time_step;
    let current: f64 = scene.fluid.current.iter().map(|u| u * u).sum();
    let mut rate = 0.0_f64;
    for motion in scene.bodies.iter().filter_map(|b| b.motion.as_ref()) {
        let each = (0..STEPS).map(|n| motion[0].rate(n as f64 * scene.time_step).abs());
        rate = rate.max(each.fold(0.0, f64::max));
    }
    let bodies = &rollout.simulator().system().bodies;
    let parameters = rollout.simulator().parameters();
    let mass: f64 = (0..bodies.len())
        .map(|b| parameters.mass(b) + 1000.0 * bodies[b].volume)
        .sum();
    let carried = mass * (current + rate * rate);
    samples[0].kinetic_energy + fall + push * speed * time + 1e6 * carried
}

#[test]
fn extreme_runs_are_sensible_or_told() {
    let (mut told, mut failed, mut calm) = (0, 0, 0);
    let mut silent = Vec::new();
    for seed in 0..COUNT as u64 {
        let mut dice = Dice::new(seed);
        let scene = scene(&mut dice);
        let integrator = INTEGRATORS[seed as usize % INTEGRATORS.len()];
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let simulator = match Simulator::new(&scene, settings.integrator(integrator)) {
            Ok(simulator) => simulator,
            Err(e) => panic!("{seed}: {e}"),
        };
        let made = simulator.rollout(&Controls::zeros(&simulator, STEPS));
        let Ok(rollout) = made else {
            failed += 1;
            continue;
        };
        let numbers = rollout
            .samples()
            .iter()
            .flat_map(|s| s.v.iter().chain(s.q.iter()));
        assert!(numbers.into_iter().all(|x| x.is_finite()), "{seed}");
        if !rollout.warnings().is_empty() {
            told += 1;
            continue;
        }
        let most = rollout.samples().iter().map(|s| s.kinetic_energy);
        let most = most.fold(0.0, f64::max);
        let accounted = accounted(&scene, &rollout);
        if most > 2.0 * accounted {
            silent.push(format!(
                "{seed} {integrator:?}: {most:.2e} J for {accounted:.2e} J"
            ));
        } else {
            calm += 1;
        }
        if let Ok(gradient) = rollout.gradient(&objective::final_velocity(0, 0.0, 1.0)) {
            let initial = gradient.initial;
            assert!(
                initial
                    .v
                    .iter()
                    .chain(initial.q.iter())
                    .all(|x| x.is_finite())
            );
        }
    }
    println!("{calm} calm, {told} told, {failed} failed; silent: {silent:#?}");
    assert!(silent.is_empty());
    // The draw reaches both sides of what can be run.
    assert!(calm > COUNT / 4 && told > COUNT / 20 && failed > 0);
}

/// Controls do work: what they can have done isn't told, and what goes beyond is.
#[test]
fn a_controls_own_work_is_allowed_for() {
    let made = |quadratic: f64, push: f64, steps: usize| {
        let mut scene = Scene::new(Fluid::fresh_water());
        let drag = Drag {
            quadratic,
            quadratic_part: DragPart::Total,
            ..Drag::default()
        };
        let body = Body::new(Shape::sphere(0.1).faces(80)).density(1000.0);
        scene.add(body.drag(drag).actuated());
        scene.time_step = 0.1;
        scene.initial.v = vec![1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        scene.controller = Some(Controller::Constant {
            control: vec![push, 0.0, 0.0, 0.0, 0.0, 0.0],
        });
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let simulator = Simulator::new(&scene, settings.integrator(Integrator::Rk2)).unwrap();
        simulator.rollout(&Controls::zeros(&simulator, steps))
    };
    // From 1 to 14 m/s, all by the push.
    let pushed = made(0.0, 100.0, 8).unwrap();
    assert!(pushed.samples()[8].kinetic_energy > 50.0 * pushed.samples()[0].kinetic_energy);
    assert_eq!(pushed.warnings(), Vec::<String>::new());
    // Explicit drag that overshoots, with a push that could do next to nothing.
    let warnings = made(2.5, 1e-3, 5).unwrap().warnings();
    println!("{warnings:?}");
    let told = |w: &String| w.contains("energy grows") && w.contains("controls");
    assert!(warnings.iter().any(told), "{warnings:?}");
}
