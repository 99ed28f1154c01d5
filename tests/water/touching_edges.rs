//! Blocks, cylinders and prisms that all but touch each other or a floor, however they are turned: compressed bodies resolve them as films hold them apart.

use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DMatrix;

/// Gaps, m, of bodies of about 4 cm.
pub const GAPS: [f64; 3] = [2e-5, 2e-4, 1e-3];
/// Condition number that tells of nothing but near bodies: with a smaller hold it was 500, and every tenth pose had no solution.
pub const MOST: f64 = 10.0;

pub fn shapes(size: f64) -> [Shape; 3] {
    let [a, b, c] = [0.03, 0.022, 0.016].map(|x| x * size);
    let corners = vec![[-b, -c], [-0.7 * b, c], [0.8 * b, c], [b, -c]];
    [
        Shape::cuboid([2.0 * b, 2.0 * c, 1.2 * a]).faces(80),
        Shape::cylinder(c, 1.5 * a).faces(80),
        Shape::prism(corners, 1.2 * a).faces(80),
    ]
}

/// The way along which a gap first is `wanted`, m.
pub fn moved(wanted: f64, gap: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 0.2);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        match gap(middle) > wanted {
            true => high = middle,
            false => low = middle,
        }
    }
    high
}

/// The coupling of these bodies at random turns, half of which leave faces nearly parallel, moved along an axis until the gap is narrow; how many turns have no solution, and the largest
/// condition number.
fn tried(shapes: &[Shape], wall: bool, accuracy: f64, turns: usize) -> (usize, f64) {
    let mut scene = Scene::new(Fluid::fresh_water());
    for (k, shape) in shapes.iter().enumerate() {
        let body = Body::new(shape.clone()).density(1400.0);
        scene.add(body.at([0.2 * k as f64, 0.0, 0.2]));
    }
    if wall {
        scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    }
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .accuracy(accuracy);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let coupling = simulator.system().coupling.as_ref();
    let mut random = Samples::new(1);
    let n = 6 * shapes.len();
    let basis = DMatrix::identity(n, n);
    let (mut failed, mut worst) = (0, 0.0_f64);
    for k in 0..turns {
        let turns: Vec<_> = (shapes.iter())
            .map(|_| exp_matrix(&Vec3::from(random.vector([3.0, 0.05][k % 2]))))
            .collect();
        let axes = [Vec3::z(), Vec3::x(), Vec3::y(), Vec3::new(0.6, 0.8, 0.0)];
        let axis = if wall { axes[0] } else { axes[k / 2 % 4] };
        let last = turns.len() - 1;
        let at = |way: f64| -> Vec<Pose> {
            let each = turns.iter().enumerate();
            let part = |b: usize| if b == last { way } else { 0.0 };
            each.map(|(b, turn)| Pose::new(*turn, part(b) * axis))
                .collect()
        };
        let gap = |way: f64| simulator.gaps().smallest(&at(way)).unwrap().distance;
        match coupling.evaluate(&at(moved(GAPS[k % 3], gap)), &basis) {
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
fn edged_bodies_that_all_but_touch_have_a_solution() {
    for accuracy in [0.03, 0.01] {
        for (k, one) in shapes(1.2).into_iter().enumerate() {
            let (failed, worst) = tried(std::slice::from_ref(&one), true, accuracy, 60);
            println!(
                "accuracy {accuracy}, body {k} on a floor: {failed} of 60 without a solution, condition {worst:.1}"
            );
            assert!(failed == 0 && worst < MOST);
            for (l, other) in shapes(0.8).into_iter().enumerate() {
                let both = [one.clone(), other];
                let (failed, worst) = tried(&both, false, accuracy, 60);
                println!(
                    "accuracy {accuracy}, bodies {k} and {l}: {failed} of 60 without a solution, condition {worst:.1}"
                );
                assert!(failed == 0 && worst < MOST);
            }
        }
    }
}
