//! Slopes against central differences.

use super::*;

/// Largest relative error of all slopes against central differences, at the best step for each
/// quantity; none if the points aren't the same on both sides.
pub(super) fn slope_error(evaluate: impl Fn(&Pose) -> Vec<ContactPoint>, pose: &Pose) -> f64 {
    let here = evaluate(pose);
    let mut worst: f64 = 0.0;
    for k in 0..6 {
        let mut z = Vec6::zeros();
        z[k] = 1.0;
        let mut best = vec![[f64::INFINITY; 4]; here.len()];
        for h in [1e-3, 1e-4, 1e-5, 1e-6, 1e-7] {
            let ahead = evaluate(&pose.displace(&(h * z)));
            let behind = evaluate(&pose.displace(&(-h * z)));
            if ahead.len() != here.len() || behind.len() != here.len() {
                continue;
            }
            for (i, p) in here.iter().enumerate() {
                let (f, b) = (&ahead[i], &behind[i]);
                let error = |difference: Vec3, slope: Vec3| {
                    (difference / (2.0 * h) - slope).norm() / slope.norm().max(1.0)
                };
                let scalar = |x: f64| Vec3::new(x, 0.0, 0.0);
                let s = &p.slopes;
                let errors = [
                    error(scalar(f.gap - b.gap), scalar(s.gap[k])),
                    error(scalar(f.weight - b.weight), scalar(s.weight[k])),
                    error(f.normal - b.normal, s.normal.column(k).into_owned()),
                    error(f.position - b.position, s.position.column(k).into_owned()),
                ];
                for (b, e) in best[i].iter_mut().zip(errors) {
                    *b = b.min(e);
                }
            }
        }
        worst = best.iter().flatten().fold(worst, |w, &e| w.max(e));
    }
    worst
}

#[test]
fn slopes_of_every_pair_agree_with_differences() {
    let mut draw = Draw::new(23);
    let kinds = every_kind();
    let mut worst: f64 = 0.0;
    let (mut points, mut faded) = (0, 0);
    for first in &kinds {
        for second in &kinds {
            for gap in [0.02, 1e-3, -4e-3, 0.01, 3e-3, -1e-3] {
                let a = offset(first, draw.pose());
                let b = offset(second, draw.pose());
                let (from, rest) = (draw.pose(), draw.pose());
                let away = draw.vector().normalize();
                let pose = approach(&a, &b, &from, &rest, &away, gap);
                let evaluate = |g: &Pose| between(&a, &b, g, &rest, 0.05).unwrap();
                let here = evaluate(&pose);
                points += here.len();
                faded += here.iter().filter(|p| p.weight < 1.0).count();
                let error = slope_error(evaluate, &pose);
                worst = worst.max(error);
                assert!(
                    error < 1e-6,
                    "{first:?} {second:?} {gap}: {error:e} {here:#?}"
                );
            }
        }
    }
    println!("worst {worst:e}, {points} points, {faded} faded");
    assert!(points > 300 && faded > 5, "{points} {faded} {worst:e}");
}

#[test]
fn slopes_of_flat_contact_and_fading_crossings_agree_with_differences() {
    let mut draw = Draw::new(29);
    let plank = plain(&Shape::cuboid([1.0, 0.1, 0.05]));
    let rod = plain(&Shape::capsule(0.03, 0.7));
    let mut faded = 0;
    for (a, b) in [
        (&plank, &plank),
        (&rod, &plank),
        (&plank, &rod),
        (&rod, &rod),
    ] {
        for along in [0.1, 0.497, 0.505, 0.348] {
            for turn in [1.2, 0.04] {
                let rest = Pose::new(exp_matrix(&(0.02 * draw.vector())), 0.01 * draw.vector());
                // Crossing near the end of one, tilted a little.
                let tilt = exp_matrix(&(0.02 * draw.vector()));
                let across = if std::ptr::eq(a, &rod) { 1.571 } else { 0.0 };
                let turned = tilt * exp_matrix(&Vec3::new(0.0, 0.0, turn));
                let pose = Pose::new(
                    turned * exp_matrix(&Vec3::new(0.0, across, 0.0)),
                    turned * Vec3::new(along, 0.0, 0.052),
                );
                let evaluate = |g: &Pose| between(a, b, g, &rest, 0.08).unwrap();
                faded += evaluate(&pose).iter().filter(|p| p.weight < 1.0).count();
                let error = slope_error(evaluate, &pose);
                assert!(error < 1e-6, "{along} {turn}: {error:e}");
            }
        }
    }
    assert!(faded > 20, "{faded}");
}

#[test]
fn slopes_against_walls_agree_with_differences() {
    let mut draw = Draw::new(31);
    for shape in every_kind() {
        for _ in 0..3 {
            let body = offset(&shape, draw.pose());
            let (point, normal, pose) = (draw.vector(), draw.vector(), draw.pose());
            let plane = HalfSpace::new(&point, &normal).unwrap();
            let evaluate = |g: &Pose| against_wall(&body, &plane, g, 100.0).unwrap();
            assert!(!evaluate(&pose).is_empty());
            let error = slope_error(evaluate, &pose);
            assert!(error < 1e-6, "{shape:?}: {error:e}");
        }
    }
}
