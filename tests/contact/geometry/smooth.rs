//! Forces along slow paths don't jump.

use super::*;

#[test]
fn a_coin_that_slides_off_a_prism_feels_no_jump() {
    let (coin, prism) = (plain(&Shape::ellipsoid([0.2, 0.05, 0.2])), plain(&wedge()));
    let reach = 0.02;
    for (tilt, aside) in [(0.0, 0.0), (0.1, 0.05), (-0.2, 0.31)] {
        let spin = exp_matrix(&Vec3::new(tilt, 0.7 * tilt, 0.3));
        let flat = exp_matrix(&Vec3::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0));
        let push = |t: f64| {
            let pose = Pose::new(spin * flat, Vec3::new(aside, t, 0.1 + 0.049));
            let points = between(&coin, &prism, &pose, &Pose::identity(), reach).unwrap();
            let force: Vec3 = points
                .iter()
                .map(|p| p.weight * (reach - p.gap).max(0.0) * p.normal)
                .sum();
            (force, force.norm())
        };
        let step = 1e-4;
        let mut last = push(0.0);
        assert!(last.1 > 0.0);
        for k in 1..5000 {
            let next = push(step * k as f64);
            // A gap changes by at most the step; the normal by that over the rim's radius.
            let bound = step + 0.03 * step / 0.0125;
            assert!(
                (next.1 - last.1).abs() <= 1.001 * step,
                "{k}: {last:?} {next:?}"
            );
            assert!(
                (next.0 - last.0).norm() <= 2.0 * bound,
                "{k}: {last:?} {next:?}"
            );
            last = next;
        }
        assert_eq!(last.1, 0.0);
    }
}

#[test]
fn planks_that_slide_off_one_another_feel_no_jump() {
    let (plank, rod) = (
        plain(&Shape::cuboid([1.0, 0.1, 0.05])),
        plain(&Shape::capsule(0.025, 0.8)),
    );
    let reach = 0.02;
    let stand = exp_matrix(&Vec3::new(0.0, std::f64::consts::FRAC_PI_2, 0.0));
    // Over the plank's face and 2 mm above it; turning while it slides off sideways, past the
    // directions in which edges are parallel.
    for (body, upright) in [(&plank, Mat3::identity()), (&rod, stand)] {
        for speed in [0.0, 0.7] {
            let push = |t: f64| {
                let turn = exp_matrix(&Vec3::new(0.0, 0.0, 1.0 - speed * t));
                let x = Vec3::new(0.3 * t, t, 0.052);
                let tilt = exp_matrix(&Vec3::new(2e-3, 1e-3, 0.0));
                let pose = Pose::new(tilt * turn * upright, x);
                let points = between(body, &plank, &pose, &Pose::identity(), reach).unwrap();
                points
                    .iter()
                    .map(|p| p.weight * (reach - p.gap).max(0.0) * p.normal)
                    .sum::<Vec3>()
            };
            // A jump would not shrink with the step.
            let steepest = [1e-4, 1e-5].map(|step: f64| {
                let mut last = push(0.0);
                let mut greatest: f64 = 0.0;
                for k in 1..(1.6 / step) as usize {
                    let next = push(step * k as f64);
                    greatest = greatest.max((next - last).norm() / step);
                    last = next;
                }
                assert_eq!(last.norm(), 0.0);
                greatest
            });
            println!("steepest change of force {steepest:?}");
            assert!(steepest[1] < 1.5 * steepest[0] && steepest[1] < 50.0);
        }
    }
}
