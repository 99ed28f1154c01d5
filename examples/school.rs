//! A school of a thousand flat bodies at rest, and a large one that passes through them: how far the water moves the school with coupling and without, and by which path of the
//! large one its centre would be moved most.
//!
//! `cargo run --release --features cli --example school [BODIES [FOLDER]]`, by default 1,000 bodies, without files. With a folder, runs are written there as `straight.glb`, `pushed.glb` and
//! `isolated.glb`, animated scenes that a browser or Blender shows.
//!
//! The large body is a sphere, as dense as the water, which begins with the speed of one of its radii a second; forces along two axes across its way are its controls. They are improved by the gradient of the whole
//! rollout, all of the same mean square.

use hydrograd::dynamics::Integrator;
use hydrograd::objective::Objective;
use hydrograd::output::gltf;
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::Cotangents;
use hydrograd::{Controls, Fidelity, Result, Rollout, Settings, Simulator};
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
/// Root of the mean square of the forces, N.
const FORCE: f64 = 20.0;
const IMPROVEMENTS: usize = 3;

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

/// Forces across the way alone, of the mean square asked for.
fn scaled(mut forces: DMatrix<f64>) -> DMatrix<f64> {
    for (i, mut row) in forces.row_iter_mut().enumerate() {
        if i != 1 && i != 2 {
            row.fill(0.0);
        }
    }
    let size = (forces.norm_squared() / forces.ncols() as f64).sqrt();
    if size > 0.0 {
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

fn main() -> Result<()> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let bodies = given.first().and_then(|n| n.parse().ok()).unwrap_or(1000);
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
    let mut forces = scaled(straight.gradient(&Moved)?.controls);
    let mut pushed = simulator.rollout(&Controls::from_matrix(&simulator, forces.clone())?)?;
    for _ in 1..IMPROVEMENTS {
        forces = scaled(pushed.gradient(&Moved)?.controls);
        pushed = simulator.rollout(&Controls::from_matrix(&simulator, forces.clone())?)?;
    }
    told("pushed across its way by the gradient", &pushed, started);
    write("pushed.glb", &pushed)?;
    println!(
        "the centre goes {:.2} times as far",
        (pushed.value(&Moved)? / straight.value(&Moved)?).sqrt()
    );
    Ok(())
}

#[test]
fn the_gradient_moves_the_school_further() -> Result<()> {
    let scene = scene(60);
    let simulator = run(&scene, Fidelity::Reduced)?;
    let straight = simulator.rollout(&Controls::zeros(&simulator, 4))?;
    let forces = scaled(straight.gradient(&Moved)?.controls);
    let pushed = simulator.rollout(&Controls::from_matrix(&simulator, forces)?)?;
    let alone = run(&scene, Fidelity::Isolated)?;
    let alone = alone.rollout(&Controls::zeros(&alone, 4))?;
    let [alone, straight, pushed] = [alone, straight, pushed].map(|r| r.value(&Moved));
    assert!(alone? < 1e-24);
    assert!(pushed? > straight?);
    Ok(())
}
