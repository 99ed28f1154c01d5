//! Fingers hinged under a palm, over the floor, and what lies there: a pebble, a box, or a block given as a mesh.

use super::{Drawn, Task};
use hydrograd::adjoint::sample::Samples;
use hydrograd::optimize::{Finger, GraspTask};
use hydrograd::scene::Shape;
use hydrograd::{Error, Result, Scene};

/// Faces of what is to be caught.
const FACES: usize = 320;

/// Longest edge of a mesh, m.
const EDGE: f64 = 0.03;
/// Radius of a finger, m.
const RADIUS: f64 = 0.04;
/// Largest force on the palm, N, and torque on each finger, N m.
const LIMITS: [f64; 3] = [40.0, 3.0, 3.0];
/// The palm's middle above the hinges, m.
const PALM: f64 = 0.1;

/// A block with six sides around its length, cut off at both ends: a hexagonal prism, corner by corner.
fn block([x, y, z]: [f64; 3]) -> Shape {
    let corner = |end: f64, k: usize| {
        let angle = std::f64::consts::PI / 3.0 * (k as f64 + 0.5);
        // So that the extent across is twice y and z.
        let wide = (std::f64::consts::PI / 6.0).cos();
        [end * x, y * angle.cos() / wide, z * angle.sin()]
    };
    let ends = [-1.0, 1.0].map(|end| (0..6).map(move |k| corner(end, k)));
    let vertices = ends.into_iter().flatten().collect();
    let mut faces = Vec::new();
    for k in 0..6 {
        let next = (k + 1) % 6;
        faces.push([k, next, 6 + next]);
        faces.push([k, 6 + next, 6 + k]);
        if (1..5).contains(&k) {
            faces.push([0, k + 1, k]);
            faces.push([6, 6 + k, 6 + k + 1]);
        }
    }
    Shape::Triangles { vertices, faces }
}

pub fn draw(scene: &Scene, random: &mut Samples) -> Result<Task> {
    let half = std::array::from_fn(|_| random.between(0.06, 0.1));
    let kind = ["pebble", "box", "block"][random.below(3)];
    let drawn = Drawn {
        kind,
        half,
        // What is flat lies flat.
        tilt: random.between(-0.3, 0.3) * if kind == "pebble" { 1.0 } else { 0.0 },
        density: random.between(1050.0, 1600.0),
        friction: random.between(0.4, 0.9),
        length: random.between(0.26, 0.4),
    };
    let off = random.between(-0.03, 0.03);
    let mut scene = scene.clone();
    let gap = scene.contact.and_then(|c| c.gap).unwrap_or(0.0);
    if let Some(contact) = &mut scene.contact {
        contact.friction = drawn.friction;
    }
    // The fingers hang from their hinges to the height of the object's middle.
    let tips = 0.5 * half[2].max(half[1]);
    let hinges = tips + drawn.length + 2.0 * RADIUS;
    for body in &mut scene.bodies {
        match body.name.as_str() {
            "palm" => body.placement.position[2] = hinges + PALM,
            "pebble" => {
                body.shape = Some(match kind {
                    "pebble" => Shape::ellipsoid(half).faces(FACES),
                    "box" => Shape::cuboid(half.map(|x| 2.0 * x)).faces(FACES),
                    _ => block(half),
                });
                body.density = Some(drawn.density);
                body.placement.position = [0.0; 3];
                if kind == "block" {
                    *body = body.clone().refine([0.0; 3], 1.0, EDGE);
                }
            }
            _ => {
                let Some(Shape::Capsule { length, .. }) = &mut body.shape else {
                    return Err(Error::input(
                        "gripper.toml: body",
                        &body.name,
                        "must be a capsule",
                    ));
                };
                *length = drawn.length;
                body.shape_at.position[2] = -(0.5 * drawn.length + RADIUS);
                body.placement.position[2] = -PALM;
            }
        }
    }
    let (sine, cosine) = drawn.tilt.sin_cos();
    let low = match kind {
        "pebble" => (half[1] * sine).hypot(half[2] * cosine),
        _ => half[2],
    };
    scene.initial.q = vec![0.0, -0.3, 0.3, off, low + 1.5 * gap, drawn.tilt];
    let pad = |side: f64| [0.0, side * RADIUS, -(drawn.length + RADIUS)];
    let finger = |name: &str, side: f64| Finger {
        body: name.into(),
        pad: pad(side),
    };
    let task = GraspTask {
        object: "pebble".into(),
        fingers: vec![finger("finger 1", 1.0), finger("finger 2", -1.0)],
        closing: vec![0.0, 1.0, -1.0],
        limits: LIMITS.to_vec(),
        hold: 0.5,
    };
    Ok(Task { drawn, scene, task })
}
