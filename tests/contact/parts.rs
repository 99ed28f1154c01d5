//! Concave bodies as unions of convex pieces: pegs and balls in U- and L-shaped bodies.

use super::tools::{above_floor, contact, touching};
use crate::support::{check_gradient, run, says, simulator};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Scene, Shape};
use hydrograd::{Fidelity, Settings, Simulator};
use std::collections::BTreeMap;

const CELL: f64 = 0.1;
/// Cells of a U and of an L, (x, z).
const U: [[i32; 2]; 7] = [[-1, 0], [0, 0], [1, 0], [-1, 1], [1, 1], [-1, 2], [1, 2]];
const L: [[i32; 2]; 5] = [[-1, 0], [0, 0], [1, 0], [-1, 1], [-1, 2]];

/// The surface of cubes in the plane y = 0: the middle of the first at the origin's height.
fn cubes(cells: &[[i32; 2]]) -> Shape {
    let mut vertices = Vec::new();
    let mut known = BTreeMap::new();
    let mut faces = Vec::new();
    for cell in cells {
        for (axis, side) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
            let mut next = *cell;
            if axis != 1 {
                next[axis / 2] += side;
            }
            if axis != 1 && cells.contains(&next) {
                continue;
            }
            let corner = |u: i32, v: i32| {
                let mut at = [2 * cell[0], 0, 2 * cell[1]];
                at[axis] += side;
                at[(axis + 1) % 3] += u * side;
                at[(axis + 2) % 3] += v;
                at
            };
            let border = [(-1, -1), (1, -1), (1, 1), (-1, 1)].map(|(u, v)| {
                let at = corner(u, v);
                *known.entry(at).or_insert_with(|| {
                    vertices.push(at.map(|x| 0.5 * CELL * f64::from(x)));
                    vertices.len() - 1
                })
            });
            let [a, b, c, d] = border;
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    Shape::triangles(vertices, faces)
}

/// The base and the arms, by boxes.
fn in_pieces(body: Body, arms: &[f64]) -> Body {
    let base = Shape::cuboid([3.0 * CELL, CELL, CELL]);
    let mut body = body.collision_piece(base, [0.0; 3], [0.0; 3]);
    for x in arms {
        let arm = Shape::cuboid([CELL, CELL, 2.0 * CELL]);
        body = body.collision_piece(arm, [x * CELL, 0.0, 1.5 * CELL], [0.0; 3]);
    }
    body
}

fn u_shaped() -> Body {
    let body = Body::new(cubes(&U)).density(2000.0).named("fork");
    in_pieces(body, &[-1.0, 1.0])
}

fn l_shaped() -> Body {
    let body = Body::new(cubes(&L)).density(2000.0).named("bracket");
    in_pieces(body, &[-1.0])
}

fn made(scene: &Scene) -> Simulator {
    simulator(scene, Fidelity::Isolated, Integrator::MomentumEuler)
}

/// A peg that is thrown into the slot of a U that stands on the floor.
fn peg() -> Scene {
    let mut scene = above_floor(0.0);
    scene.add(u_shaped().at([0.0, 0.0, 0.052]));
    let peg = Body::new(Shape::cuboid([0.06, 0.08, 0.15])).density(1000.0);
    scene.add(peg.at([0.0, 0.0, 0.25]));
    scene.initial.v = vec![0.0; 12];
    scene.initial.v[6] = 0.3;
    scene
}

#[test]
fn a_peg_rests_in_a_fork() {
    let simulator = made(&peg());
    let pairs = simulator.system().contact.as_ref().unwrap().shapes.pairs();
    // Three pieces with the peg and with the floor, and the peg with the floor.
    assert_eq!(pairs.count(), 7);
    let rollout = run(&simulator, 300);
    let samples = rollout.samples();
    for sample in samples {
        let across = sample.poses[1].translation.x - sample.poses[0].translation.x;
        assert!(across.abs() < 0.5 * (CELL - 0.06) + 1e-3, "{across}");
    }
    let [fork, peg] = [0, 1].map(|b| samples[300].poses[b].translation);
    let rests = peg.z - fork.z - 0.5 * CELL - 0.075;
    let moved = (peg - samples[250].poses[1].translation).norm();
    println!(
        "the peg rests {:.2} mm above the base, and moves by {moved:.1e} m in 0.5 s",
        1e3 * rests
    );
    assert!(rests > 0.0 && rests < 2e-3, "{rests}");
    assert!(moved < 1e-4, "{moved}");
}

/// A ball rolls along the base of an L that is fixed, up to its arm and not through it.
fn ball() -> Scene {
    let mut scene = touching(0.0);
    scene.add(l_shaped().fixed());
    let ball = Body::new(Shape::sphere(0.04)).density(1000.0);
    scene.add(ball.at([0.05, 0.0, 0.5 * CELL + 0.0405]));
    let speed = 0.4;
    scene.initial.v = vec![-speed, 0.0, 0.0, 0.0, -speed / 0.04, 0.0];
    scene
}

#[test]
fn a_ball_stops_at_the_arm_of_a_bracket() {
    let rollout = run(&made(&ball()), 100);
    let x = |n: usize| rollout.samples()[n].poses[1].translation.x;
    let nearest = (0..=100).map(x).fold(f64::INFINITY, f64::min);
    println!(
        "the ball comes to {:.2} mm from the arm",
        1e3 * (nearest + 0.01)
    );
    assert!(nearest > -0.0101 && nearest < -0.008, "{nearest}");
}

#[test]
fn gradients_through_pieces() {
    let mut soft = peg();
    contact(&mut soft).stiffness = Some(2e4);
    // Not upright: of a box that lands flat all corners touch at once, where the force has a second derivative on one side alone.
    soft.bodies[1].placement.rotation = [0.03, -0.02, 0.1];
    for (name, scene, steps) in [("peg", soft, 25), ("ball", ball(), 30)] {
        check_gradient(name, &mut made(&scene), steps, 3, 1e-5);
    }
}

/// One piece that is the shape itself: the same bits.
#[test]
fn a_convex_body_as_one_piece_is_itself() {
    let shape = Shape::cuboid([0.3, 0.2, 0.1]);
    let body = Body::new(shape.clone()).density(1000.0).at([0.0, 0.0, 0.2]);
    let piece = body.clone().collision_piece(shape, [0.0; 3], [0.0; 3]);
    let ends = [body, piece].map(|body| {
        let mut scene = above_floor(0.0);
        scene.add(body.rotated([0.3, 0.4, 0.0]));
        scene.initial.v = vec![0.5, 0.0, 0.0, 1.0, 2.0, 0.5];
        run(&made(&scene), 100).states()[100].clone()
    });
    assert_eq!(ends[0], ends[1]);
}

/// The water and the mass are those of the shape, whatever the pieces.
#[test]
fn the_water_sees_the_shape() {
    let masses = [u_shaped(), Body::new(cubes(&U)).density(2000.0)].map(|body| {
        let mut scene = touching(1000.0);
        if body.collision.is_empty() {
            scene.contact = None;
        }
        scene.add(body);
        let simulator = made(&scene);
        let (q, _) = simulator.start();
        let e = simulator.system().evaluate(simulator.parameters(), q, 0.0);
        e.unwrap().mass_matrix().clone()
    });
    assert_eq!(masses[0], masses[1]);
    assert!(masses[0][(0, 0)] > 2000.0 * 7.0 * CELL.powi(3));
}

#[test]
fn scene_files_have_pieces() {
    let scene = peg();
    let text = scene.to_toml().unwrap();
    assert!(text.contains("collision"), "{text}");
    assert_eq!(Scene::from_toml(&text, "").unwrap(), scene);
}

#[test]
fn what_is_wrong_with_pieces_is_said() {
    let refused = |body: Body, words: &[&str]| {
        let mut scene = above_floor(0.0);
        contact(&mut scene);
        scene.add(body.at([0.0, 0.0, 1.0]));
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let made = Simulator::new(&scene, settings).map(|_| ());
        says(made.unwrap_err(), words);
    };
    let bare = || Body::new(cubes(&U)).density(2000.0).named("fork");
    let ball = |r: f64| Shape::sphere(r);
    refused(bare(), &["fork", "collision = ["]);
    let beside = u_shaped().collision_piece(ball(0.05), [0.5, 0.0, 0.0], [0.0; 3]);
    refused(beside, &["fork", "collision[3]", "0.5", "must lie where"]);
    let thin = u_shaped().collision_piece(ball(-0.05), [0.0; 3], [0.0; 3]);
    refused(thin, &["fork", "collision[3].shape", "radius", "-0.05"]);
    let lost = u_shaped().collision_piece(ball(0.05), [f64::NAN, 0.0, 0.0], [0.0; 3]);
    refused(lost, &["fork", "collision[3].at.position", "NaN"]);
    let concave = bare().collision_piece(cubes(&L), [0.0; 3], [0.0; 3]);
    refused(concave, &["fork", "collision[0]", "convex"]);
    let dry = Body::dry().mass(1.0).inertia([1.0, 1.0, 1.0]).named("dry");
    let dry = dry.collision_piece(ball(0.05), [0.0; 3], [0.0; 3]);
    refused(dry, &["dry", "collision", "shape"]);
}
