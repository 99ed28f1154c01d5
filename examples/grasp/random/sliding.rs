//! Fingers that slide on a column, and a coin.

use super::{Drawn, Task};
use crate::task::LIMITS;
use hydrograd::adjoint::sample::Samples;
use hydrograd::optimize::{Finger, GraspTask};
use hydrograd::scene::Shape;
use hydrograd::{Result, Scene};

/// Length of the fingers in the scene, m.
const LENGTH: f64 = 1.6;

pub fn draw(scene: &Scene, random: &mut Samples) -> Result<Task> {
    let radius = random.between(0.14, 0.26);
    let half = radius * random.between(0.2, 0.4);
    let drawn = Drawn {
        kind: "coin",
        half: [radius, half, radius],
        tilt: random.between(-0.6, 0.6),
        density: random.between(1000.0, 2500.0),
        friction: random.between(0.4, 0.9),
        length: random.between(1.45, 1.9),
    };
    // From the tips towards the column, and off the middle between the fingers, m.
    let place = [random.between(0.1, 0.3), random.between(-0.05, 0.05)];
    let mut scene = scene.clone();
    scene.controller = None;
    let scale = drawn.length / LENGTH;
    for body in &mut scene.bodies {
        match (&mut body.shape, body.name.as_str()) {
            (Some(Shape::Prism { profile, .. }), "finger 1" | "finger 2") => {
                // Longer along the fingers, as thick as they are.
                profile.iter_mut().for_each(|p| p[0] *= scale);
                body.mass = body.mass.map(|m| m * scale);
            }
            (Some(Shape::Ellipsoid { semi_axes, .. }), "coin") => {
                *semi_axes = drawn.half;
                let volume = 4.0 / 3.0 * std::f64::consts::PI * radius * radius * half;
                let mass = drawn.density * volume;
                let across = mass / 5.0 * (radius * radius + half * half);
                let along = mass / 5.0 * (2.0 * radius * radius);
                body.mass = Some(mass);
                body.inertia = Some(vec![across, along, across]);
            }
            _ => {}
        }
    }
    if let Some(contact) = &mut scene.contact {
        contact.friction = drawn.friction;
    }
    let q = &mut scene.initial.q;
    q[3] = drawn.length - place[0];
    q[4] = place[1];
    q[5] = drawn.tilt;
    let pad = [0.0, drawn.length - 0.3, 0.0];
    let finger = |name: &str| Finger {
        body: name.into(),
        pad,
    };
    let task = GraspTask {
        object: "coin".into(),
        fingers: vec![finger("finger 1"), finger("finger 2")],
        closing: vec![0.0, 1.0, -1.0],
        limits: LIMITS.to_vec(),
        hold: 0.5,
    };
    Ok(Task { drawn, scene, task })
}
