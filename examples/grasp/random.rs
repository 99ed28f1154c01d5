//! Grasps that nobody tuned: coins, fingers and friction drawn by a seed, one set of settings for all.

use hydrograd::adjoint::sample::Samples;
use hydrograd::optimize::{Finger, Grasp, GraspSettings, GraspTask, grasp};
use hydrograd::scene::Shape;
use hydrograd::simulate::Fidelity;
use hydrograd::{Result, Scene, Settings, Simulator};
use serde::Serialize;
use std::time::Instant;

use crate::task::LIMITS;

/// What is drawn.
#[derive(Clone, Debug, Serialize)]
pub struct Drawn {
    /// Semi-axes of the coin: its disc's, and half its thickness, m.
    pub coin: [f64; 2],
    /// Angle at the start, rad.
    pub tilt: f64,
    /// kg/m³
    pub density: f64,
    pub friction: f64,
    /// Of the fingers, m.
    pub length: f64,
    /// Where the coin starts: from the fingers' tips towards the column, and off the middle between them, m.
    pub place: [f64; 2],
}

/// Outcome of a drawn grasp.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    pub drawn: Drawn,
    pub caught: bool,
    /// Since when it is held at the end, s.
    pub held_since: Option<f64>,
    pub cost: f64,
    /// What found it: a push, a descent, a search.
    pub stage: hydrograd::optimize::GraspStage,
    /// Of the pushes, how many caught the coin.
    pub pushes_caught: usize,
    pub simulations: usize,
    pub gradients: usize,
    pub failures: usize,
    /// From the scene to the found forces, s.
    pub seconds: f64,
}

impl Drawn {
    fn new(random: &mut Samples) -> Self {
        let radius = random.between(0.14, 0.26);
        Self {
            coin: [radius, radius * random.between(0.2, 0.4)],
            tilt: random.between(-0.6, 0.6),
            density: random.between(1000.0, 2500.0),
            friction: random.between(0.4, 0.9),
            length: random.between(1.45, 1.9),
            place: [random.between(0.1, 0.3), random.between(-0.05, 0.05)],
        }
    }

    /// The scene of the example with these in it.
    fn scene(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.controller = None;
        let (scale, [radius, half]) = (self.length / 1.6, self.coin);
        for body in &mut scene.bodies {
            match (&mut body.shape, body.name.as_str()) {
                (Some(Shape::Prism { profile, .. }), "finger 1" | "finger 2") => {
                    // Longer beyond the column; wall and front as they are.
                    profile.iter_mut().for_each(|p| p[0] *= scale);
                    body.mass = body.mass.map(|m| m * scale);
                }
                (Some(Shape::Ellipsoid { semi_axes, .. }), "coin") => {
                    *semi_axes = [radius, half, radius];
                    let volume = 4.0 / 3.0 * std::f64::consts::PI * radius * radius * half;
                    let mass = self.density * volume;
                    let (across, along) = (
                        mass / 5.0 * (radius * radius + half * half),
                        mass / 5.0 * (2.0 * radius * radius),
                    );
                    body.mass = Some(mass);
                    body.inertia = Some(vec![across, along, across]);
                }
                _ => {}
            }
        }
        if let Some(contact) = &mut scene.contact {
            contact.friction = self.friction;
        }
        let q = &mut scene.initial.q;
        q[3] = self.length - self.place[0];
        q[4] = self.place[1];
        q[5] = self.tilt;
        scene
    }

    fn task(&self) -> GraspTask {
        let pad = [0.0, self.length - 0.3, 0.0];
        let finger = |name: &str| Finger {
            body: name.into(),
            pad,
        };
        GraspTask {
            object: "coin".into(),
            fingers: vec![finger("finger 1"), finger("finger 2")],
            closing: vec![0.0, 1.0, -1.0],
            limits: LIMITS.to_vec(),
            hold: 0.5,
        }
    }
}

/// One drawn grasp.
fn one(scene: &Scene, drawn: Drawn) -> Result<Outcome> {
    let start = Instant::now();
    let settings = Settings::default().fidelity(Fidelity::Reduced);
    let simulator = Simulator::new(&drawn.scene(scene), settings)?;
    let found: Grasp = grasp(
        &simulator,
        &drawn.task(),
        &GraspSettings::default(),
        |_, _| {},
    )?;
    Ok(Outcome {
        drawn,
        caught: found.caught,
        held_since: found.held_since,
        cost: found.cost,
        stage: found.stage,
        pushes_caught: found.pushes_caught,
        simulations: found.simulations,
        gradients: found.gradients,
        failures: found.failures,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// So many grasps, drawn by a seed.
pub fn run(scene: &Scene, count: usize, seed: u64) -> Result<Vec<Outcome>> {
    let mut random = Samples::new(seed);
    (0..count)
        .map(|i| {
            let outcome = one(scene, Drawn::new(&mut random))?;
            eprintln!(
                "grasp {}: {} by {:?}, cost {:.3}, {} of the pushes, {} simulations, {} gradients, {} failed, {:.1} s",
                i + 1,
                if outcome.caught { "caught" } else { "lost" },
                outcome.stage,
                outcome.cost,
                outcome.pushes_caught,
                outcome.simulations,
                outcome.gradients,
                outcome.failures,
                outcome.seconds
            );
            Ok(outcome)
        })
        .collect()
}
