//! Prints the tables of `docs/contact.md`: what the gap, the width and the stiction speed do. `cargo run --release --example contact`.

use hydrograd::adjoint::lie::Vec3;
use hydrograd::scene::{Body, Contact, Fluid, Scene, Shape};
use hydrograd::{Controls, Fidelity, Result, Rollout, Settings, Simulator};
use nalgebra::DVector;

const RADIUS: f64 = 0.1;

/// A ball above a floor at z = 0.
fn ball(water: f64, density: f64, height: f64) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: water,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -9.81];
    scene.contact = Some(Contact::default());
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    scene.add(
        Body::new(Shape::sphere(RADIUS))
            .density(density)
            .at([0.0, 0.0, height]),
    );
    scene
}

fn simulator(scene: &Scene, fidelity: Fidelity) -> Result<Simulator> {
    Simulator::new(scene, Settings::default().fidelity(fidelity))
}

fn height(rollout: &Rollout, n: usize) -> f64 {
    rollout.samples()[n].poses[0].translation.z - RADIUS
}

/// A ball dropped in water: how near it comes, and where it rests, over the gap that the coupling resolves.
fn gaps() -> Result<()> {
    println!(
        "gap g₀ and a ball of radius 0.1 m and 3000 kg/m³ that falls 0.2 m in water, reduced, Δt 0.01 s"
    );
    println!(
        "g₀ over default | g₀, mm | resolved, mm | lowest, mm | at rest, mm | lowest over resolved | warnings"
    );
    let scene = ball(1000.0, 3000.0, RADIUS + 0.2);
    let usual = simulator(&scene, Fidelity::Reduced)?;
    let default = usual
        .system()
        .contact
        .as_ref()
        .and_then(|c| c.gaps().next())
        .map_or(0.0, |g| g.gap);
    for factor in [0.25, 0.5, 1.0, 2.0] {
        let mut scene = scene.clone();
        scene.contact.get_or_insert_default().gap = Some(factor * default);
        let simulator = simulator(&scene, Fidelity::Reduced)?;
        let resolved = simulator.discretisation()[0].resolved_gap.unwrap_or(0.0) / 2.0;
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 200))?;
        let lowest = (0..=200)
            .map(|n| height(&rollout, n))
            .fold(f64::INFINITY, f64::min);
        println!(
            "{factor} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {}",
            1e3 * factor * default,
            1e3 * resolved,
            1e3 * lowest,
            1e3 * height(&rollout, 200),
            lowest / resolved,
            rollout.warnings().len()
        );
    }
    Ok(())
}

/// Where a ball thrown aslant ends, and the derivative of that along the start height.
fn thrown(simulator: &mut Simulator, up: f64, reverse: bool) -> Result<(f64, f64)> {
    let steps = (0.8 / simulator.time_step()).round() as usize;
    let (q, v) = simulator.start();
    let (q, v) = (q.clone(), v.clone());
    let mut moved = q.clone();
    moved[2] += up;
    simulator.set_start(moved, v.clone())?;
    let out = {
        let rollout = simulator.rollout(&Controls::zeros(simulator, steps))?;
        let mut slope = 0.0;
        if reverse {
            let mut seed = rollout.zero_cotangents();
            seed.positions[(0, steps)] = 1.0;
            slope = rollout.vjp(&seed)?.initial.q[2];
        }
        (rollout.samples()[steps].poses[0].translation.x, slope)
    };
    simulator.set_start(q, v)?;
    Ok(out)
}

/// The derivative at many start heights against the slope over a centimetre.
fn derivatives(name: &str, stiffness: Option<f64>, dt: f64) -> Result<()> {
    println!();
    println!(
        "∂(end x)/∂(start height) of a ball thrown at 2 m/s along a floor, {name}, over 100 heights from 0.3 to 0.4 m above it"
    );
    println!(
        "width over default | stiction speed, m/s | slope over 0.1 m | mean of the derivatives | they lie within | worst against differences over 1 cm"
    );
    for (width, stiction) in [
        (0.1, 1e-3),
        (1.0, 1e-3),
        (10.0, 1e-3),
        (100.0, 1e-3),
        (1.0, 1e-4),
        (1.0, 1e-2),
        (1.0, 1e-1),
    ] {
        let mut scene = ball(0.0, 1000.0, RADIUS + 0.35);
        scene.time_step = dt;
        scene.initial.v = vec![2.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let c = scene.contact.get_or_insert_default();
        (c.stiffness, c.dissipation) = (stiffness, 0.1);
        (c.width, c.stiction_speed) = (Some(width * 4e-4), stiction);
        let mut simulator = simulator(&scene, Fidelity::Isolated)?;
        let n = 100;
        let spacing = 0.1 / f64::from(n);
        let mut found = DVector::zeros(n as usize);
        let mut ends = DVector::zeros(n as usize);
        for i in 0..n {
            let (end, slope) = thrown(&mut simulator, -0.05 + spacing * f64::from(i), true)?;
            (found[i as usize], ends[i as usize]) = (slope, end);
        }
        let wide = (ends[n as usize - 1] - ends[0]) / (0.1 - spacing);
        let half = 5;
        let mut worst = 0.0_f64;
        for i in half..n as usize - half {
            let slope = (ends[i + half] - ends[i - half]) / (2.0 * half as f64 * spacing);
            worst = worst.max((found[i] - slope).abs());
        }
        println!(
            "{width} | {stiction} | {wide:.4} | {:.4} | {:.3} … {:.3} | {worst:.3}",
            found.mean(),
            found.min(),
            found.max()
        );
    }
    Ok(())
}

/// How high a block rides that slides along a floor.
fn sliding() -> Result<()> {
    println!();
    println!("a block that slides at 2 m/s: height of its surface above the gap g₀, and τ μ v");
    for dt in [0.01, 0.0025] {
        let block = |height: f64| {
            let mut scene = ball(0.0, 1000.0, 0.0);
            scene.bodies[0] = Body::new(Shape::cuboid([0.3, 0.3, 0.05]))
                .named("block")
                .density(1000.0)
                .at([0.0, 0.0, 0.025 + height]);
            scene.time_step = dt;
            scene.initial.v = vec![2.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            simulator(&scene, Fidelity::Isolated)
        };
        let gap = (block(0.01)?.system().contact.as_ref())
            .and_then(|c| c.gaps().next())
            .map_or(0.0, |g| g.gap);
        // From where it will ride: nearer, it would be thrown up.
        let simulator = block(gap + 0.5 * 2.0 * dt)?;
        let n = (0.05 / dt).round() as usize;
        let rollout = simulator.rollout(&Controls::zeros(&simulator, n))?;
        let sample = &rollout.samples()[n];
        let lowest = [-0.15, 0.15].map(|x| sample.poses[0].apply(&Vec3::new(x, 0.0, -0.025)).z);
        println!(
            "Δt {dt} s: {:.2} and {:.2} mm at the two ends, v = {:.2} m/s, τ μ v = {:.2} mm",
            1e3 * (lowest[0] - gap),
            1e3 * (lowest[1] - gap),
            sample.v[0],
            1e3 * dt * 0.5 * sample.v[0]
        );
    }
    Ok(())
}

fn main() -> Result<()> {
    gaps()?;
    derivatives("near rigid (the default), Δt 0.01 s", None, 0.01)?;
    derivatives("soft (20 kN/m), Δt 0.01 s", Some(2e4), 0.01)?;
    derivatives("soft (20 kN/m), Δt 0.001 s", Some(2e4), 0.001)?;
    derivatives("near rigid (the default), Δt 0.001 s", None, 0.001)?;
    sliding()
}
