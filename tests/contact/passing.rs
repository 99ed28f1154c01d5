//! Nothing passes through: fast balls and walls, thin plates, corners that sweep, joints at their limits, and what a step says of its pieces.

use super::tools::{above_floor, contact, touching, under_gravity};
use crate::support::{CONTACT_INTEGRATORS, run, simulator};
use hydrograd::adjoint::sample::Samples;
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Joint, Scene, Shape};
use hydrograd::{Controls, Fidelity, Rollout};
use nalgebra::DMatrix;

const RADIUS: f64 = 0.05;

fn most(rollout: &Rollout) -> usize {
    rollout.summary().most_pieces
}

/// A ball that comes at a wall by so many radii a step, from a little nearer each time.
#[test]
fn a_ball_never_passes_a_wall() {
    for integrator in CONTACT_INTEGRATORS {
        let mut deepest = f64::INFINITY;
        for radii in [3.0, 10.0, 100.0] {
            for offset in 0..12 {
                for slant in [0.0, 1.0] {
                    let mut scene = above_floor(0.0);
                    scene.gravity = [0.0; 3];
                    let way = radii * RADIUS;
                    let height = 2.0 * RADIUS + way * (1.0 + f64::from(offset) / 12.0);
                    let ball = Body::new(Shape::sphere(RADIUS)).density(1000.0);
                    scene.add(ball.at([0.0, 0.0, height]));
                    let down = way / scene.time_step;
                    scene.initial.v = vec![slant * down, 0.0, -down, 0.0, 3.0, 0.0];
                    let simulator = simulator(&scene, Fidelity::Isolated, integrator);
                    let rollout = run(&simulator, 10);
                    for sample in rollout.samples() {
                        let gap = sample.poses[0].translation.z - RADIUS;
                        deepest = deepest.min(gap / RADIUS);
                    }
                    let [first, last] = [0, 10].map(|n| rollout.samples()[n].kinetic_energy);
                    assert!(last <= first, "{radii} {offset}: {last} J of {first} J");
                    // It landed, and is no deeper than where it was pressed to.
                    assert!(rollout.samples()[10].v[2] > -1e-3 * down);
                    let said = rollout.warnings().join("; ");
                    assert!(!said.contains("pieces"), "{said}");
                }
            }
        }
        println!("{integrator:?}: deepest {deepest:.3} radii");
        assert!(deepest > -0.2, "{integrator:?}: {deepest} radii deep");
    }
}

/// A plate of 2 mm in the way of a ball: one that is held, and one that is free.
#[test]
fn a_ball_never_passes_a_thin_plate() {
    let thickness = 0.002;
    for integrator in [Integrator::MomentumEuler, Integrator::VelocityEuler] {
        for held in [true, false] {
            let mut pieces = Vec::new();
            for thicknesses in [10.0, 100.0, 1000.0] {
                for offset in 0..6 {
                    let mut scene = touching(0.0);
                    scene.gravity = [0.0; 3];
                    let way = thicknesses * thickness;
                    let height = RADIUS + 0.003 + way * (0.2 + f64::from(offset) / 6.0);
                    let plate = Body::new(Shape::cuboid([0.4, 0.4, thickness])).density(2000.0);
                    scene.add(match held {
                        true => plate.fixed(),
                        false => plate,
                    });
                    let ball = Body::new(Shape::sphere(RADIUS)).density(1000.0);
                    // A free plate that is hit beside its middle turns out of the way.
                    let [x, y] = if held { [0.05, 0.02] } else { [0.0, 0.0] };
                    scene.add(ball.at([x, y, height]));
                    let down = way / scene.time_step;
                    let still = if held { 0 } else { 6 };
                    scene.initial.v = vec![0.0; still + 6];
                    scene.initial.v[still + 2] = -down;
                    let simulator = simulator(&scene, Fidelity::Isolated, integrator);
                    let rollout = run(&simulator, 6);
                    let above = rollout.samples().iter().map(|s| {
                        let [plate, ball] = [&s.poses[0], &s.poses[1]];
                        plate.apply_inverse(&ball.translation).z
                    });
                    let lowest = above.fold(f64::INFINITY, f64::min);
                    assert!(lowest > 0.5 * RADIUS, "{thicknesses} {offset}: {lowest} m");
                    pieces.push(most(&rollout));
                }
            }
            println!("{integrator:?}, held {held}: pieces {pieces:?}");
        }
    }
}

/// The corner of a long box on a hinge would sweep through a plate; linear foresight doesn't see it.
#[test]
fn a_spinning_box_doesnt_sweep_through_a_plate() {
    for integrator in [Integrator::MomentumEuler, Integrator::VelocityEuler] {
        for turn in [0.3, 1.0, 2.0] {
            for offset in 0..3 {
                let mut scene = touching(0.0);
                scene.gravity = [0.0; 3];
                let hinge = Joint::Revolute {
                    axis: [0.0, 0.0, 1.0],
                };
                let rod = Body::new(Shape::cuboid([0.6, 0.03, 0.03])).density(1000.0);
                scene.add(rod.joint(hinge));
                let plate = Body::new(Shape::cuboid([0.2, 0.004, 0.2])).density(1000.0);
                scene.add(plate.at([0.2, 0.13, 0.0]).fixed());
                scene.initial.q = vec![-0.1 * f64::from(offset)];
                scene.initial.v = vec![turn / scene.time_step];
                let simulator = simulator(&scene, Fidelity::Isolated, integrator);
                let rollout = run(&simulator, 8);
                let angles: Vec<f64> = rollout.samples().iter().map(|s| s.q[0]).collect();
                let furthest = angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let name = format!("{integrator:?}, {turn} rad a step, start {offset}");
                println!("{name}: {furthest:.3} rad, pieces {}", most(&rollout));
                // The rod lies on the plate's inner edge at about 0.76 rad, on its outer one at 0.36.
                assert!(furthest < 0.8, "{name}: {angles:?}");
                assert!(angles.iter().all(|q| *q > -2.2), "{name}: {angles:?}");
            }
        }
    }
}

/// A ball struck by another takes over its speed within the step, and would pass the plate behind it, which it didn't come near to before.
#[test]
fn what_is_struck_doesnt_pass_either() {
    what_is_struck_stays(None);
}

/// Nor where a stiffness was given: the plate is met, and sunk into as it asks for.
#[test]
fn what_is_struck_meets_a_given_stiffness() {
    what_is_struck_stays(Some(1e6));
}

fn what_is_struck_stays(stiffness: Option<f64>) {
    let mut scene = touching(0.0);
    contact(&mut scene).stiffness = stiffness;
    scene.gravity = [0.0; 3];
    let ball = |z: f64| {
        let body = Body::new(Shape::sphere(RADIUS)).density(1000.0);
        body.at([0.0, 0.0, z])
    };
    let plate = Body::new(Shape::cuboid([0.4, 0.4, 0.002])).density(1000.0);
    scene.add(plate.fixed());
    scene.add(ball(0.2));
    scene.add(ball(0.4));
    scene.initial.v = vec![0.0; 12];
    scene.initial.v[8] = -50.0;
    let simulator = simulator(&scene, Fidelity::Isolated, Integrator::MomentumEuler);
    let rollout = run(&simulator, 10);
    for sample in rollout.samples() {
        let z = |b: usize| sample.poses[b].translation.z;
        assert!(z(1) > 0.5 * RADIUS && z(2) > z(1) + RADIUS);
    }
    assert!(most(&rollout) > 1);
}

/// Fast, but past each other: no force, and not a bit of difference.
#[test]
fn what_misses_isnt_touched() {
    let scene = |with: bool| {
        let mut scene = match with {
            true => touching(0.0),
            false => under_gravity(0.0),
        };
        scene.gravity = [0.0; 3];
        for (x, z) in [(0.0, 0.0), (0.11, 1.3)] {
            let ball = Body::new(Shape::sphere(RADIUS)).density(1000.0);
            scene.add(ball.at([x, 0.0, z]));
        }
        scene.initial.v = vec![0.0; 12];
        scene.initial.v[8] = -40.0;
        scene
    };
    let [with, without] = [true, false].map(|with| {
        let simulator = simulator(&scene(with), Fidelity::Isolated, Integrator::MomentumEuler);
        let rollout = run(&simulator, 8);
        assert_eq!(most(&rollout), 1);
        rollout.states().to_vec()
    });
    assert_eq!(with, without);
}

/// Arms of two joints with random ranges, masses, speeds and torques, at 10 ms: largest way past a limit, of its range.
fn episodes(count: usize, seed: u64) -> (f64, usize, Vec<String>) {
    let mut random = Samples::new(seed);
    let (mut worst, mut cut, mut failed) = (0.0_f64, 0, Vec::new());
    for episode in 0..count {
        let mut scene = under_gravity(if episode % 4 == 0 { 1000.0 } else { 0.0 });
        let mut parent: Option<String> = None;
        let axes = [[0.0, 1.0, 0.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]];
        for link in 0..2 {
            let length = random.between(0.1, 0.5);
            let shape = Shape::ellipsoid([0.5 * length, 0.05, 0.04]);
            let range = random.between(0.02, 0.6);
            let axis = axes[random.below(3)];
            let joint = match random.below(3) {
                0 => Joint::Prismatic { axis },
                _ => Joint::Revolute { axis },
            };
            let name = format!("link {link}");
            let body = Body::new(shape)
                .density(random.between(500.0, 8000.0))
                .shape_at([0.6 * length, 0.0, 0.0], [0.0; 3])
                .named(&name)
                .joint(joint)
                .limits([-range, range])
                .actuated();
            scene.add(match &parent {
                Some(parent) => body.child_of(parent).at([length, 0.0, 0.0]),
                None => body,
            });
            parent = Some(name);
        }
        scene.initial.v = random.numbers(2, 30.0);
        let simulator = simulator(&scene, Fidelity::Isolated, Integrator::MomentumEuler);
        let force = random.between(0.0, 80.0);
        let controls = DMatrix::from_fn(2, 40, |_, n| match n % 10 {
            0..5 => force * random.number(),
            _ => force,
        });
        let controls = Controls::from_matrix(&simulator, controls).unwrap();
        let rollout = match simulator.rollout(&controls) {
            Ok(rollout) => rollout,
            Err(error) => {
                failed.push(format!("episode {episode}: {error}"));
                continue;
            }
        };
        cut += rollout.summary().cut_steps;
        for sample in rollout.samples() {
            for limit in &simulator.system().limits {
                let past = limit.past(sample.q[limit.q]) / limit.room();
                assert!(past.is_finite());
                worst = worst.max(past);
            }
        }
    }
    (worst, cut, failed)
}

#[test]
fn joints_keep_to_their_limits() {
    let (worst, cut, failed) = episodes(200, 5);
    println!("at most {worst:.4} of a range past it; {cut} of 8000 steps cut");
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(worst < 0.06, "{worst}");
}

fn fast_ball() -> Scene {
    let mut scene = above_floor(0.0);
    scene.add(
        Body::new(Shape::cuboid([0.2, 0.1, 0.04]))
            .density(1000.0)
            .at([0.0, 0.0, 0.4])
            .rotated([0.4, 0.3, 0.2]),
    );
    scene.initial.v = vec![1.0, 0.5, -12.0, 8.0, -5.0, 10.0];
    scene
}

/// Pieces stand in a run's figures, contact forces are means over the step, and a stiffness that was given stays what it is.
#[test]
fn pieces_are_said() {
    let scene = fast_ball();
    let simulator_of =
        |scene: &Scene| simulator(scene, Fidelity::Isolated, Integrator::MomentumEuler);
    let sim = simulator_of(&scene);
    let rollout = run(&sim, 12);
    let pieces = rollout.pieces();
    let summary = rollout.summary();
    assert_eq!(pieces.len(), 12);
    assert_eq!(summary.cut_steps, pieces.iter().filter(|n| **n > 1).count());
    assert_eq!(Some(&summary.most_pieces), pieces.iter().max());
    assert!(
        summary.cut_steps > 0 && summary.cut_steps < 12,
        "{pieces:?}"
    );
    // Impulse of all that acted: momentum gained, weight apart.
    let mass = sim.parameters().mass(0);
    for (n, count) in pieces.iter().enumerate() {
        let up: f64 = rollout
            .contacts(n, 0.0)
            .unwrap()
            .iter()
            .map(|c| c.force[2])
            .sum();
        let gained = rollout.samples()[n + 1].momentum[2] - rollout.samples()[n].momentum[2];
        let expected = 0.01 * (up - mass * 9.81);
        assert!(
            (gained - expected).abs() < 1e-9 * mass,
            "step {n} of {count}: {gained} {expected}"
        );
    }
    let mut soft = scene;
    contact(&mut soft).stiffness = Some(2e4);
    let soft = simulator_of(&soft);
    assert!(!soft.system().contact.as_ref().unwrap().rigid);
    run(&soft, 12);
}

/// To the bit, on one thread and on several.
#[test]
fn pieces_are_the_same_every_time() {
    let ends = [1, 1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let simulator = simulator(&fast_ball(), Fidelity::Isolated, Integrator::MomentumEuler);
            let rollout = run(&simulator, 20);
            let mut seed = rollout.zero_cotangents();
            seed.positions[(0, 20)] = 1.0;
            let gradient = rollout.vjp(&seed).unwrap();
            (rollout.states().to_vec(), gradient.initial.v)
        })
    });
    assert_eq!(ends[0], ends[1]);
    assert_eq!(ends[0], ends[2]);
}
