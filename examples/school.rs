//! A school of a thousand flat bodies at rest, and a large one that passes through them: how far the water moves the school with coupling and without, and by which path of the
//! large one its centre would be moved most.
//!
//! `cargo run --release --features cli --example school [BODIES [FOLDER]]`, by default 1,000 bodies, without files. With a folder, runs are written there as `straight.glb`, `pushed.glb` and
//! `isolated.glb`, animated scenes that a browser or Blender shows.
//!
//! The large body is a sphere, as dense as the water, which begins with the speed of one of its radii a second; forces on it are its controls. They are improved along the gradient of the whole
//! rollout, their mean square bounded.

use hydrograd::dynamics::Integrator;
use hydrograd::objective::Objective;
use hydrograd::output::gltf;
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::Cotangents;
use hydrograd::{Controls, Error, Fidelity, Result, Rollout, Settings, Simulator};
use nalgebra::{DMatrix, Vector3};
use std::path::Path;
use std::time::Instant;

/// Radius of the large body, and of the ball around a small one, m.
const LARGE: f64 = 0.3;
const SMALL: f64 = 0.06;
/// Centre to centre in the school, m.
const PITCH: f64 = 0.2;
const STEPS: usize = 30;
const STEP: f64 = 0.05;
/// Largest root of the mean square of the forces, N.
const FORCE: f64 = 60.0;
const IMPROVEMENTS: usize = 5;

/// Small ones on a grid with a tunnel for the large one, which starts before it.
fn scene(bodies: usize) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let across = (bodies as f64 / 1.6).cbrt().ceil();
    let tunnel = LARGE + SMALL + 0.06;
    let way = -(LARGE + SMALL + 0.02);
    let large = Body::new(Shape::sphere(LARGE).faces(320)).density(998.0);
    scene.add(large.named("large").at([way, 0.0, 0.0]).thruster());
    scene.initial.v = vec![LARGE, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (mut made, mut cell) = (0, 0_usize);
    let side = across as usize + 1;
    while made < bodies {
        let [i, j, k] = [cell % side, cell / side % side, cell / side / side];
        cell += 1;
        let middle = across / 2.0;
        let at = [k as f64, i as f64 - middle, j as f64 - middle].map(|x| PITCH * x);
        if at[1].hypot(at[2]) < tunnel {
            continue;
        }
        let shape = Shape::ellipsoid([SMALL, 0.4 * SMALL, 0.8 * SMALL]).faces(320);
        scene.add(
            Body::new(shape)
                .density(998.0)
                .named(format!("small {made}"))
                .at(at),
        );
        scene.initial.v.extend([0.0; 6]);
        made += 1;
    }
    scene
}

/// How far the school's centre has gone at the end, m², squared.
struct Moved;

impl Moved {
    fn way(rollout: &Rollout) -> Vector3<f64> {
        let (first, last) = (&rollout.samples()[0], &rollout.samples()[rollout.steps()]);
        let each = last.poses.iter().zip(&first.poses).skip(1);
        let sum: Vector3<f64> = each.map(|(b, a)| b.translation - a.translation).sum();
        sum / (last.poses.len() - 1) as f64
    }
}

impl Objective for Moved {
    fn value(&self, rollout: &Rollout) -> f64 {
        Self::way(rollout).norm_squared()
    }

    fn cotangents(&self, rollout: &Rollout) -> Cotangents {
        let mut out = rollout.zero_cotangents();
        let (end, bodies) = (rollout.steps(), rollout.samples()[0].poses.len());
        let slope = 2.0 / (bodies - 1) as f64 * Self::way(rollout);
        for b in 1..bodies {
            for i in 0..3 {
                out.positions[(3 * b + i, end)] = slope[i];
            }
        }
        out
    }
}

/// Forces alone, without torques.
fn pushing(mut forces: DMatrix<f64>) -> DMatrix<f64> {
    forces.rows_mut(3, 3).fill(0.0);
    forces
}

/// Root of the forces' mean square over the steps, N.
fn mean(forces: &DMatrix<f64>) -> f64 {
    (forces.norm_squared() / forces.ncols() as f64).sqrt()
}

/// The same forces, scaled down to the largest mean square.
fn within(forces: DMatrix<f64>) -> DMatrix<f64> {
    let size = mean(&forces);
    if size > FORCE {
        forces * (FORCE / size)
    } else {
        forces
    }
}

fn run(scene: &Scene, fidelity: Fidelity) -> Result<Simulator> {
    let settings = Settings::default()
        .fidelity(fidelity)
        .accuracy(0.03)
        .integrator(Integrator::Rk2)
        .time_step(STEP);
    Simulator::new(scene, settings)
}

fn told(name: &str, rollout: &Rollout, started: Instant) {
    let way = 1e3 * Moved::way(rollout);
    println!(
        "{name}: the school's centre moves by ({:.4}, {:.4}, {:.4}) mm; {:.1} s",
        way.x,
        way.y,
        way.z,
        started.elapsed().as_secs_f64()
    );
}

/// A number of bodies.
fn number(text: &str) -> Result<usize> {
    let usage = "must be a whole number above zero: school [BODIES [FOLDER]]";
    let above = text.parse().ok().filter(|bodies| *bodies > 0);
    above.ok_or_else(|| Error::input("BODIES", text, usage))
}

fn main() -> Result<()> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let bodies = given.first().map_or(Ok(1000), |n| number(n))?;
    let write = |name: &str, rollout: &Rollout| match given.get(1) {
        Some(folder) => gltf::write(rollout, &Path::new(folder).join(name), &Default::default()),
        None => Ok(()),
    };
    let scene = scene(bodies);
    let alone = run(&scene, Fidelity::Isolated)?;
    let started = Instant::now();
    let rollout = alone.rollout(&Controls::zeros(&alone, STEPS))?;
    told("without coupling", &rollout, started);
    write("isolated.glb", &rollout)?;

    let simulator = run(&scene, Fidelity::Reduced)?;
    let started = Instant::now();
    let straight = simulator.rollout(&Controls::zeros(&simulator, STEPS))?;
    told("with coupling, straight through", &straight, started);
    write("straight.glb", &straight)?;
    let started = Instant::now();
    let still = straight.value(&Moved)?;
    let (mut pushed, mut length) = (straight, 0.1 * FORCE);
    for _ in 0..IMPROVEMENTS {
        let upwards = pushing(pushed.gradient(&Moved)?.controls);
        let step = upwards.scale(length / mean(&upwards).max(f64::MIN_POSITIVE));
        let forces = within(pushed.controls() + step);
        let next = simulator.rollout(&Controls::from_matrix(&simulator, forces)?)?;
        match next.value(&Moved)? > pushed.value(&Moved)? {
            true => (pushed, length) = (next, 2.0 * length),
            false => length *= 0.3,
        }
    }
    told("pushed along the gradient", &pushed, started);
    write("pushed.glb", &pushed)?;
    println!(
        "the centre goes {:.2} times as far",
        (pushed.value(&Moved)? / still).sqrt()
    );
    Ok(())
}

#[test]
fn what_is_no_number_of_bodies_is_an_error() -> Result<()> {
    for wrong in ["abc", "0", "-1", "1.5"] {
        let said = number(wrong).unwrap_err().to_string();
        assert!(said.contains("BODIES") && said.contains(wrong), "{said}");
    }
    assert_eq!(number("60")?, 60);
    Ok(())
}

#[test]
fn the_gradient_moves_the_school_further() -> Result<()> {
    let scene = scene(60);
    let simulator = run(&scene, Fidelity::Reduced)?;
    let straight = simulator.rollout(&Controls::zeros(&simulator, 4))?;
    let upwards = pushing(straight.gradient(&Moved)?.controls);
    let forces = within(upwards.scale(0.1 * FORCE / mean(&upwards)));
    let pushed = simulator.rollout(&Controls::from_matrix(&simulator, forces)?)?;
    let alone = run(&scene, Fidelity::Isolated)?;
    let alone = alone.rollout(&Controls::zeros(&alone, 4))?;
    let [alone, straight, pushed] = [alone, straight, pushed].map(|r| r.value(&Moved));
    assert!(alone? < 1e-24);
    assert!(pushed? > straight?);
    Ok(())
}
