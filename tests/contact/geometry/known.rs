//! Gaps, normals and positions with known answers.

use super::*;
use crate::support::directions;

#[test]
fn balls_and_walls_have_known_gaps() {
    let (a, b) = (plain(&Shape::sphere(0.1)), plain(&Shape::sphere(0.2)));
    let points = between(&a, &b, &at(0.0, 0.0, 0.35), &at(0.0, 0.0, 0.0), 0.1).unwrap();
    assert_eq!(points.len(), 1);
    assert!((points[0].gap - 0.05).abs() < 1e-15);
    assert!((points[0].normal - Vec3::z()).norm() < 1e-15);
    assert!((points[0].position - Vec3::new(0.0, 0.0, 0.225)).norm() < 1e-15);
    assert!(
        between(&a, &b, &at(0.0, 0.0, 0.35), &at(0.0, 0.0, 0.0), 0.04)
            .unwrap()
            .is_empty()
    );

    let floor = |g: &ContactShape, pose: &Pose| {
        let plane = HalfSpace::new(&Vec3::zeros(), &(2.0 * Vec3::z())).unwrap();
        against_wall(g, &plane, pose, 0.1).unwrap()
    };
    let points = floor(&a, &at(0.3, -0.2, 0.09));
    assert!((points[0].gap + 0.01).abs() < 1e-15);
    assert!((points[0].position - Vec3::new(0.3, -0.2, -0.005)).norm() < 1e-15);

    let box_ = plain(&Shape::cuboid([0.3, 0.2, 0.1]));
    let points = floor(&box_, &at(0.0, 0.0, 0.05 + 1e-3));
    assert_eq!(points.len(), 4);
    assert!(points.iter().all(|p| (p.gap - 1e-3).abs() < 1e-15));

    let lying = turned([0.0, std::f64::consts::FRAC_PI_2, 0.0], [0.0, 0.0, 0.07]);
    let points = floor(&plain(&Shape::capsule(0.06, 0.4)), &lying);
    assert_eq!(points.len(), 2);
    for p in &points {
        assert!((p.gap - 0.01).abs() < 1e-15);
        assert!((p.position.x.abs() - 0.2).abs() < 1e-15);
    }

    // Height of a plane's support: √(nᵀ R D² Rᵀ n).
    let coin = plain(&Shape::ellipsoid([0.2, 0.05, 0.2]));
    let tilt: f64 = 0.4;
    let points = floor(&coin, &turned([tilt, 0.0, 0.0], [0.0, 0.0, 0.2]));
    let height = (0.2 * tilt.cos()).hypot(0.05 * tilt.sin());
    assert_eq!(points.len(), 1);
    assert!((points[0].gap - (0.2 - height)).abs() < 1e-15);
}

#[test]
fn boxes_lie_on_boxes_at_their_corners_and_crossings() {
    let (a, b) = (
        plain(&Shape::cuboid([0.2, 0.2, 0.1])),
        plain(&Shape::cuboid([0.6, 0.5, 0.2])),
    );
    let points = between(&a, &b, &at(0.05, 0.0, 0.149), &at(0.0, 0.0, 0.0), 0.01).unwrap();
    let touching: Vec<_> = points.iter().filter(|p| p.gap < 0.0).collect();
    assert_eq!(touching.len(), 4);
    for p in touching {
        assert!((p.gap + 1e-3).abs() < 1e-15 && p.weight == 1.0);
        assert!((p.normal - Vec3::z()).norm() < 1e-15);
    }

    // Two planks across one another: no corner of either is over the other.
    let plank = plain(&Shape::cuboid([1.0, 0.1, 0.05]));
    let across = turned([0.0, 0.0, 1.2], [0.0, 0.0, 0.049]);
    let points = between(&plank, &plank, &across, &at(0.0, 0.0, 0.0), 0.01).unwrap();
    assert_eq!(points.len(), 4);
    for p in &points {
        assert!((p.gap + 1e-3).abs() < 1e-12 && (p.weight - 1.0).abs() < 1e-12);
        assert!((p.normal - Vec3::z()).norm() < 1e-12);
    }
    let middle: Vec3 = points.iter().map(|p| p.position).sum();
    assert!((middle / 4.0 - Vec3::new(0.0, 0.0, 0.0245)).norm() < 1e-12);

    // Edge across edge, both boxes standing on an edge.
    let quarter = std::f64::consts::FRAC_PI_4;
    let cube = plain(&Shape::cuboid([0.2; 3]));
    let diagonal = 0.2 * 2f64.sqrt();
    let below = turned([quarter, 0.0, 0.0], [0.0; 3]);
    for gap in [2e-3, -2e-3] {
        let above = turned([0.0, quarter, 0.0], [0.02, 0.03, diagonal + gap]);
        let points = between(&cube, &cube, &above, &below, 0.01).unwrap();
        let full: Vec<_> = points.iter().filter(|p| p.weight == 1.0).collect();
        assert_eq!(full.len(), 1, "{points:#?}");
        assert!((full[0].gap - gap).abs() < 1e-14);
        assert!((full[0].normal - Vec3::z()).norm() < 1e-14);
        let expected = Vec3::new(0.02, 0.03, 0.5 * (diagonal + gap));
        // The edge of the upper one runs along y through x = 0.02, that of the lower one along x.
        assert!((full[0].position - Vec3::new(expected.x, 0.0, expected.z)).norm() < 1e-14);
    }
}

#[test]
fn an_ellipsoid_meets_faces_edges_and_corners_of_a_prism_as_its_distance_says() {
    let (coin, prism) = (plain(&Shape::ellipsoid([0.2, 0.05, 0.2])), plain(&wedge()));
    let rest = Pose::identity();
    let on = |g: &ContactShape, pose: &Pose| {
        let points = between(g, &prism, pose, &rest, 0.05).unwrap();
        assert_eq!(points.len(), 1, "{points:#?}");
        points[0].clone()
    };
    // Over the face z = 0.1, lying and tilted.
    for tilt in [0.0f64, 0.3, 1.2] {
        let height = (0.05 * tilt.cos()).hypot(0.2 * tilt.sin());
        let pose = Pose::new(
            exp_matrix(&Vec3::new(std::f64::consts::FRAC_PI_2 + tilt, 0.0, 0.0)),
            Vec3::new(0.0, 0.05, 0.1 + height - 1e-3),
        );
        let p = on(&coin, &pose);
        assert!((p.gap + 1e-3).abs() < 1e-14, "{tilt}: {}", p.gap);
        assert!((p.normal - Vec3::z()).norm() < 1e-14);
    }
    // A round ellipsoid is a ball: the same gap, normal, position over all features.
    let (round, ball) = (
        plain(&Shape::ellipsoid([0.1; 3])),
        plain(&Shape::sphere(0.1)),
    );
    let mut draw = Draw::new(7);
    let mut met = 0;
    for _ in 0..400 {
        let pose = Pose::new(exp_matrix(&draw.vector()), 0.5 * draw.vector());
        let p = between(&round, &prism, &pose, &rest, 0.05).unwrap();
        let q = between(&ball, &prism, &pose, &rest, 0.05).unwrap();
        // With the centre inside, the nearest face may differ from the ellipsoid's.
        if q.is_empty() || q[0].gap < -0.09 {
            continue;
        }
        met += 1;
        assert_eq!((p.len(), q.len()), (1, 1));
        assert!((p[0].gap - q[0].gap).abs() < 1e-12,);
        assert!((p[0].normal - q[0].normal).norm() < 1e-8, "{p:#?} {q:#?}");
        assert!((p[0].position - q[0].position).norm() < 1e-8);
    }
    assert!(met > 50, "{met}");
}

/// Points evenly over the unit sphere.
#[test]
fn ellipsoids_are_as_far_apart_as_their_surfaces() {
    let mut draw = Draw::new(11);
    let axes = [[0.2, 0.05, 0.2], [0.12, 0.18, 0.25], [0.3, 0.1, 0.04]];
    let ball = plain(&Shape::sphere(0.07));
    let directions = directions(1_000_000);
    for (k, semi_axes) in axes.iter().enumerate() {
        let body = plain(&Shape::ellipsoid(*semi_axes));
        let other_axes = axes[(k + 1) % 3];
        let other = plain(&Shape::ellipsoid(other_axes));
        for _ in 0..4 {
            let pose = draw.pose();
            let away = draw.vector().normalize();
            let there = Pose::new(exp_matrix(&draw.vector()), pose.translation + 0.6 * away);
            let points = between(&ball, &body, &there, &pose, 1.0).unwrap();
            let nearest = directions
                .iter()
                .map(|d| pose.apply(&d.component_mul(&Vec3::from(*semi_axes))))
                .map(|x| (x - there.translation).norm() - 0.07)
                .fold(f64::INFINITY, f64::min);
            let error = nearest - points[0].gap;
            assert!((-1e-12..1e-5).contains(&error), "{error:e}");

            // Apart, the distance is the largest separation along any direction.
            let p = &between(&other, &body, &there, &pose, 1.0).unwrap()[0];
            let height = |n: &Vec3| {
                let h = |g: &Pose, a: &[f64; 3]| {
                    g.rotation.tr_mul(n).component_mul(&Vec3::from(*a)).norm()
                };
                n.dot(&(there.translation - pose.translation))
                    - h(&there, &other_axes)
                    - h(&pose, semi_axes)
            };
            let largest = directions
                .iter()
                .map(height)
                .fold(f64::NEG_INFINITY, f64::max);
            let error = p.gap - largest;
            assert!((-1e-12..1e-5).contains(&error), "{error:e}");
        }
    }
    // Round ones are balls, overlapping too.
    let (a, b) = (
        plain(&Shape::ellipsoid([0.1; 3])),
        plain(&Shape::ellipsoid([0.2; 3])),
    );
    for gap in [0.03, 0.0, -0.02, -0.15] {
        let pose = Pose::new(
            exp_matrix(&Vec3::new(0.3, 0.2, -0.5)),
            Vec3::new(0.1, 0.2, 0.3),
        );
        let away = Vec3::new(0.6, 0.0, 0.8);
        let there = Pose::new(Mat3::identity(), pose.translation + (0.3 + gap) * away);
        let p = &between(&a, &b, &there, &pose, 1.0).unwrap()[0];
        assert!((p.gap - gap).abs() < 1e-14 && (p.normal - away).norm() < 1e-12);
    }
}
