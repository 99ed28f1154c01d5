//! What order, place and size of the bodies may not change.

use super::*;

#[test]
fn swapping_and_moving_both_bodies_change_nothing() {
    let mut draw = Draw::new(37);
    let kinds = every_kind();
    for first in &kinds {
        for second in &kinds {
            let (a, b) = (offset(first, draw.pose()), offset(second, draw.pose()));
            let (from, rest) = (draw.pose(), draw.pose());
            let away = draw.vector().normalize();
            let pose = approach(&a, &b, &from, &rest, &away, -2e-3);
            let here = between(&a, &b, &pose, &rest, 0.05).unwrap();
            let swapped = between(&b, &a, &rest, &pose, 0.05).unwrap();
            assert_eq!(here.len(), swapped.len());
            for p in &here {
                let same = |q: &&ContactPoint| {
                    (p.gap - q.gap).abs() < 1e-12
                        && (p.weight - q.weight).abs() < 1e-10
                        && (p.normal + q.normal).norm() < 1e-10
                        && (p.position - q.position).norm() < 1e-10
                };
                assert!(swapped.iter().any(|q| same(&q)), "{first:?} {second:?}");
            }

            assert_eq!(here, between(&a, &b, &pose, &rest, 0.05).unwrap());
            let motion = draw.pose();
            let (p2, r2) = (motion.compose(&pose), motion.compose(&rest));
            let moved = between(&a, &b, &p2, &r2, 0.05).unwrap();
            assert_eq!(
                here.len(),
                moved.len(),
                "{first:?} {second:?} {here:#?} {moved:#?}"
            );
            for (p, q) in here.iter().zip(&moved) {
                assert!((p.gap - q.gap).abs() < 1e-12);
                assert!((p.weight - q.weight).abs() < 1e-12);
                assert!((motion.rotation * p.normal - q.normal).norm() < 1e-12);
                assert!((motion.apply(&p.position) - q.position).norm() < 1e-12);
            }

            // Carrying the second body too: the slopes' rule.
            let z = Vec6::from_fn(|i, _| [0.3, -0.8, 0.5, 0.2, 0.9, -0.4][i]);
            for p in &here {
                let rule = |q: &ContactPoint| {
                    let slopes = &q.slopes;
                    let lag = point_velocity(&z, &q.position) - slopes.position * z;
                    (slopes.gap.dot(&z), lag)
                };
                let (gap, lag) = rule(p);
                let near = |q: &&ContactPoint| {
                    (q.position - p.position).norm() < 1e-10
                        && (q.slopes.gap.dot(&z) + gap).abs() < 1e-8
                        && (q.slopes.position * z - lag).norm() < 1e-6 * (1.0 + lag.norm())
                };
                assert!(swapped.iter().any(|q| near(&q)), "{first:?} {second:?}");
            }
        }
    }
}

#[test]
fn points_scale_with_the_bodies() {
    let mut draw = Draw::new(53);
    let scaled = |shape: &Shape, by: f64| match shape.clone() {
        Shape::Sphere { radius, .. } => Shape::sphere(by * radius),
        Shape::Capsule { radius, length, .. } => Shape::capsule(by * radius, by * length),
        Shape::Ellipsoid { semi_axes, .. } => Shape::ellipsoid(semi_axes.map(|a| by * a)),
        Shape::Box { size, .. } => Shape::cuboid(size.map(|a| by * a)),
        other => other,
    };
    let kinds: Vec<Shape> = every_kind().into_iter().take(5).collect();
    for first in &kinds {
        for second in &kinds {
            let (a, b) = (plain(first), plain(second));
            let (from, rest) = (draw.pose(), draw.pose());
            let away = draw.vector().normalize();
            let pose = approach(&a, &b, &from, &rest, &away, -2e-3);
            let here = between(&a, &b, &pose, &rest, 0.05).unwrap();
            for by in [1e-3, 1e3] {
                let (a, b) = (plain(&scaled(first, by)), plain(&scaled(second, by)));
                let grown = |g: &Pose| Pose::new(g.rotation, by * g.translation);
                let there = between(&a, &b, &grown(&pose), &grown(&rest), 0.05 * by).unwrap();
                assert_eq!(here.len(), there.len());
                for (p, q) in here.iter().zip(&there) {
                    assert!((p.gap - q.gap / by).abs() < 1e-12);
                    assert!((p.normal - q.normal).norm() < 1e-9);
                    assert!((p.weight - q.weight).abs() < 1e-9);
                }
            }
        }
    }
}

/// A smaller reach leaves points out and changes none: bodies apart by more than that touch nowhere.
#[test]
fn reach_only_leaves_points_out() {
    let mut draw = Draw::new(77);
    let (kinds, mut kept, mut dropped) = (every_kind(), 0, 0);
    for first in &kinds {
        for second in &kinds {
            let (a, b) = (plain(first), plain(second));
            for _ in 0..400 {
                let (pose, rest) = (draw.pose(), draw.pose());
                let pose = Pose::new(pose.rotation, 0.5 * pose.translation);
                let rest = Pose::new(rest.rotation, 0.1 * rest.translation);
                let all = between(&a, &b, &pose, &rest, 10.0).unwrap();
                for reach in [0.01, 0.1] {
                    // Edges that overlap deeper than the reach are left out too.
                    if all.iter().any(|p| p.gap < -reach) {
                        continue;
                    }
                    let near = between(&a, &b, &pose, &rest, reach).unwrap();
                    let expected: Vec<_> = all.iter().filter(|p| p.gap < reach).collect();
                    assert_eq!(
                        near.iter().collect::<Vec<_>>(),
                        expected,
                        "{first:?} {second:?} {pose:?} {rest:?}"
                    );
                    kept += near.len();
                    dropped += all.len() - near.len();
                }
            }
        }
    }
    assert!(kept > 1000 && dropped > 1000, "{kept} {dropped}");
}
