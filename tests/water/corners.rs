//! Blocks, cylinders and prisms side by side on a floor, and in the corner of two walls: narrow gaps that meet have a solution, however the bodies are turned.

use super::touching_edges::{GAPS, MOST, moved, shapes};
use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::NearGap;
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::DMatrix;

/// Bodies over a floor at z = 0, and with a second wall at x = 0.
fn simulator(shapes: &[Shape], walls: usize, accuracy: f64) -> Simulator {
    let mut scene = Scene::new(Fluid::fresh_water());
    for (k, shape) in shapes.iter().enumerate() {
        let body = Body::new(shape.clone()).density(1400.0);
        scene.add(body.at([0.2 + 0.2 * k as f64, 0.0, 0.2]));
    }
    let normals = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
    for normal in normals.into_iter().take(walls) {
        scene.add_wall([0.0; 3], normal);
    }
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .accuracy(accuracy);
    Simulator::new(&scene, settings).unwrap()
}

fn gap(simulator: &Simulator, poses: &[Pose]) -> f64 {
    simulator.gaps().smallest(poses).unwrap().distance
}

/// Each body is let down to the floor by itself, then moved along it up to the wall, or to the body before; half of all turns leave faces nearly parallel. How many turns have
/// no solution, and the largest condition number.
fn tried(shapes: &[Shape], walls: usize, accuracy: f64, turns: usize) -> (usize, f64) {
    let all = simulator(shapes, walls, accuracy);
    let over_floor: Vec<Simulator> = (shapes.iter())
        .map(|s| simulator(std::slice::from_ref(s), 1, accuracy))
        .collect();
    let coupling = all.system().coupling.as_ref();
    let mut random = Samples::new(1);
    let n = 6 * shapes.len();
    let basis = DMatrix::identity(n, n);
    let (mut failed, mut worst) = (0, 0.0_f64);
    for k in 0..turns {
        let mut poses: Vec<Pose> = Vec::new();
        for one in &over_floor {
            let turn = exp_matrix(&Vec3::from(random.vector([3.0, 0.05][k % 2])));
            let at = |x: f64, z: f64| Pose::new(turn, Vec3::new(x, 0.0, z));
            let z = moved(GAPS[k % 3], |z| gap(one, &[at(0.0, z)]));
            let from = poses.last().map_or(0.0, |p| p.translation.x);
            let beside = |x: f64| {
                // High above the floor; the wall is farther than the body before.
                let aside = if poses.is_empty() { 0.0 } else { 0.5 };
                let mut here = poses.clone();
                here.push(at(from + x, z));
                for pose in &mut here {
                    pose.translation += Vec3::new(aside, 0.0, 1.0);
                }
                let far = (here.len()..shapes.len())
                    .map(|b| Pose::new(turn, Vec3::new(10.0 + b as f64, 0.0, 5.0)));
                here.extend(far.collect::<Vec<_>>());
                gap(&all, &here)
            };
            let meets = walls > 1 || !poses.is_empty();
            let x = if meets {
                moved(GAPS[k / 3 % 3], beside)
            } else {
                0.0
            };
            poses.push(at(from + x, z));
        }
        let narrow = GAPS[k % 3].max(GAPS[k / 3 % 3]);
        assert!(gap(&all, &poses) < 1.01 * narrow);
        match coupling.evaluate(&poses, &basis) {
            Ok(found) => worst = worst.max(found.report().condition),
            Err(error) => {
                println!("{error}");
                failed += 1;
            }
        }
    }
    (failed, worst)
}

#[test]
fn narrow_gaps_that_meet_have_a_solution() {
    for accuracy in [0.03, 0.01] {
        for (k, one) in shapes(1.2).into_iter().enumerate() {
            let other = shapes(0.8)[(k + 1) % 3].clone();
            for (bodies, walls) in [
                (vec![one.clone()], 2),
                (vec![one.clone(), other.clone()], 1),
                (vec![one.clone(), other], 2),
            ] {
                let (failed, worst) = tried(&bodies, walls, accuracy, 36);
                println!(
                    "accuracy {accuracy}, body {k} of {}, {walls} walls: {failed} of 36 without a solution, condition {worst:.1}",
                    bodies.len()
                );
                assert!(failed == 0 && worst < MOST);
            }
        }
    }
}

/// Two boxes side by side on a floor: added mass of all their motions, and what a run says of its gaps.
fn side_by_side(gap: f64, faces: usize, settings: Settings) -> (DMatrix<f64>, Option<NearGap>) {
    let size = [0.05, 0.04, 0.03];
    let mut scene = Scene::new(Fluid::fresh_water());
    for k in 0..2 {
        let x = (k as f64 - 0.5) * (size[0] + gap);
        let body = Body::new(Shape::cuboid(size).faces(faces)).density(1400.0);
        scene.add(body.at([x, 0.0, 0.5 * size[2] + gap]));
    }
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 0)).unwrap();
    let equations = simulator.equations(simulator.start().0).unwrap();
    let mass = equations.added_mass_matrix().unwrap();
    (mass, rollout.gap_report().worst)
}

/// Where films meet they lose what others carry away from them, and runs say so.
#[test]
fn films_that_meet_are_told_of() {
    for gap in [0.004, 0.002, 0.001] {
        let panels = Settings::default().fidelity(Fidelity::Full).films(false);
        let (right, _) = side_by_side(gap, 700, panels);
        let reduced = Settings::default().fidelity(Fidelity::Reduced);
        let (found, told) = side_by_side(gap, 320, reduced);
        let told = told.unwrap();
        let part = |i: usize, j: usize| {
            (found[(i, j)] - right[(i, j)]) / (right[(i, i)] * right[(j, j)]).sqrt()
        };
        let all = DMatrix::from_fn(12, 12, part);
        let together = all.symmetric_eigenvalues().amax();
        // Across the gap between them, and off the floor.
        let own = part(0, 0).abs().max(part(2, 2).abs());
        println!(
            "gap {gap}: own motions off by {:.1} %, the worst of both by {:.1} %; told {:.1} %",
            100.0 * own,
            100.0 * together,
            100.0 * told.added_mass_error
        );
        assert!(told.added_mass_error > own / 3.0);
        assert!(told.added_mass_error < 0.4);
    }
}
