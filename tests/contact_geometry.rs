//! Contact points: known answers, slopes against differences, symmetry, agreement with GJK.

use hydrograd::adjoint::lie::{Mat3, Pose, Vec3, Vec6, exp_matrix, point_velocity};
use hydrograd::contact::geometry::{ContactPoint, Geometry, against_wall, between};
use hydrograd::shape::{TriMesh, build};
use hydrograd::{Error, Shape};
use std::path::Path;

/// Numbers in [−1, 1] without a pattern, the same in every run (xorshift64*).
struct Draw(u64);

impl Draw {
    fn number(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11;
        bits as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.number(), self.number(), self.number())
    }

    fn pose(&mut self) -> Pose {
        Pose::new(exp_matrix(&(3.0 * self.vector())), self.vector())
    }

    fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        let k = (0.5 * (self.number() + 1.0) * from.len() as f64) as usize;
        &from[k.min(from.len() - 1)]
    }
}

fn sphere(radius: f64) -> Shape {
    Shape::Sphere {
        radius,
        faces: None,
    }
}

fn ellipsoid(semi_axes: [f64; 3]) -> Shape {
    Shape::Ellipsoid {
        semi_axes,
        faces: None,
    }
}

fn cuboid(size: [f64; 3]) -> Shape {
    Shape::Box { size, faces: None }
}

fn capsule(radius: f64, length: f64) -> Shape {
    Shape::Capsule {
        radius,
        length,
        faces: None,
    }
}

/// A prism with a trapezium for its profile, given clockwise.
fn wedge() -> Shape {
    Shape::Prism {
        profile: vec![[-0.2, -0.1], [-0.15, 0.1], [0.25, 0.1], [0.3, -0.1]],
        length: 0.6,
        faces: None,
    }
}

fn cylinder() -> Shape {
    Shape::Cylinder {
        radius: 0.15,
        length: 0.3,
        faces: None,
    }
}

fn plain(shape: &Shape) -> Geometry {
    Geometry::of_shape(shape, Pose::identity(), Path::new(".")).unwrap()
}

fn offset(shape: &Shape, offset: Pose) -> Geometry {
    Geometry::of_shape(shape, offset, Path::new(".")).unwrap()
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::new(Mat3::identity(), Vec3::new(x, y, z))
}

fn turned(rotation: [f64; 3], translation: [f64; 3]) -> Pose {
    Pose::new(exp_matrix(&Vec3::from(rotation)), Vec3::from(translation))
}

fn smallest(points: &[ContactPoint]) -> f64 {
    let full = points.iter().filter(|p| p.weight >= 1.0 - 1e-12);
    full.map(|p| p.gap).fold(f64::INFINITY, f64::min)
}

fn is_finite(p: &ContactPoint) -> bool {
    let s = &p.slopes;
    let values = [p.gap, p.weight];
    let vectors = p.normal.iter().chain(p.position.iter());
    let slopes = s.gap.iter().chain(s.weight.iter());
    let rows = s.normal.iter().chain(s.position.iter());
    values
        .iter()
        .chain(vectors)
        .chain(slopes)
        .chain(rows)
        .all(|x| x.is_finite())
        && (p.normal.norm() - 1.0).abs() < 1e-12
        && (0.0..=1.0).contains(&p.weight)
}

fn every_kind() -> Vec<Shape> {
    vec![
        sphere(0.12),
        capsule(0.06, 0.4),
        ellipsoid([0.2, 0.05, 0.2]),
        ellipsoid([0.12, 0.18, 0.25]),
        cuboid([0.3, 0.2, 0.4]),
        wedge(),
        cylinder(),
    ]
}

#[test]
fn balls_and_walls_have_known_gaps() {
    let (a, b) = (plain(&sphere(0.1)), plain(&sphere(0.2)));
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

    let floor = |g: &Geometry, pose: &Pose| {
        against_wall(g, &Vec3::zeros(), &(2.0 * Vec3::z()), pose, 0.1).unwrap()
    };
    let points = floor(&a, &at(0.3, -0.2, 0.09));
    assert!((points[0].gap + 0.01).abs() < 1e-15);
    assert!((points[0].position - Vec3::new(0.3, -0.2, -0.005)).norm() < 1e-15);

    let box_ = plain(&cuboid([0.3, 0.2, 0.1]));
    let points = floor(&box_, &at(0.0, 0.0, 0.05 + 1e-3));
    assert_eq!(points.len(), 4);
    assert!(points.iter().all(|p| (p.gap - 1e-3).abs() < 1e-15));

    let lying = turned([0.0, std::f64::consts::FRAC_PI_2, 0.0], [0.0, 0.0, 0.07]);
    let points = floor(&plain(&capsule(0.06, 0.4)), &lying);
    assert_eq!(points.len(), 2);
    for p in &points {
        assert!((p.gap - 0.01).abs() < 1e-15);
        assert!((p.position.x.abs() - 0.2).abs() < 1e-15);
    }

    // Height of a plane's support: √(nᵀ R D² Rᵀ n).
    let coin = plain(&ellipsoid([0.2, 0.05, 0.2]));
    let tilt: f64 = 0.4;
    let points = floor(&coin, &turned([tilt, 0.0, 0.0], [0.0, 0.0, 0.2]));
    let height = (0.2 * tilt.cos()).hypot(0.05 * tilt.sin());
    assert_eq!(points.len(), 1);
    assert!((points[0].gap - (0.2 - height)).abs() < 1e-15);
}

#[test]
fn boxes_lie_on_boxes_at_their_corners_and_crossings() {
    let (a, b) = (
        plain(&cuboid([0.2, 0.2, 0.1])),
        plain(&cuboid([0.6, 0.5, 0.2])),
    );
    let points = between(&a, &b, &at(0.05, 0.0, 0.149), &at(0.0, 0.0, 0.0), 0.01).unwrap();
    let touching: Vec<_> = points.iter().filter(|p| p.gap < 0.0).collect();
    assert_eq!(touching.len(), 4);
    for p in touching {
        assert!((p.gap + 1e-3).abs() < 1e-15 && p.weight == 1.0);
        assert!((p.normal - Vec3::z()).norm() < 1e-15);
    }

    // Two planks across one another: no corner of either is over the other.
    let plank = plain(&cuboid([1.0, 0.1, 0.05]));
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
    let cube = plain(&cuboid([0.2; 3]));
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
    let (coin, prism) = (plain(&ellipsoid([0.2, 0.05, 0.2])), plain(&wedge()));
    let rest = Pose::identity();
    let on = |g: &Geometry, pose: &Pose| {
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
    let (round, ball) = (plain(&ellipsoid([0.1; 3])), plain(&sphere(0.1)));
    let mut draw = Draw(7);
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
fn directions(count: usize) -> impl Iterator<Item = Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |k| {
        let z = 1.0 - (2 * k + 1) as f64 / count as f64;
        let r = (1.0 - z * z).sqrt();
        let angle = golden * k as f64;
        Vec3::new(r * angle.cos(), r * angle.sin(), z)
    })
}

#[test]
fn ellipsoids_are_as_far_apart_as_their_surfaces() {
    let mut draw = Draw(11);
    let axes = [[0.2, 0.05, 0.2], [0.12, 0.18, 0.25], [0.3, 0.1, 0.04]];
    let ball = plain(&sphere(0.07));
    for (k, semi_axes) in axes.iter().enumerate() {
        let body = plain(&ellipsoid(*semi_axes));
        let other_axes = axes[(k + 1) % 3];
        let other = plain(&ellipsoid(other_axes));
        for _ in 0..4 {
            let pose = draw.pose();
            let away = draw.vector().normalize();
            let there = Pose::new(exp_matrix(&draw.vector()), pose.translation + 0.6 * away);
            let points = between(&ball, &body, &there, &pose, 1.0).unwrap();
            let nearest = directions(1_000_000)
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
            let largest = directions(1_000_000)
                .map(|n| height(&n))
                .fold(f64::NEG_INFINITY, f64::max);
            let error = p.gap - largest;
            assert!((-1e-12..1e-5).contains(&error), "{error:e}");
        }
    }
    // Round ones are balls, overlapping too.
    let (a, b) = (plain(&ellipsoid([0.1; 3])), plain(&ellipsoid([0.2; 3])));
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

/// Moves `a` along `away` from where the centres meet until the smallest gap is `gap`.
fn approach(a: &Geometry, b: &Geometry, from: &Pose, rest: &Pose, away: &Vec3, gap: f64) -> Pose {
    let meet = b.center_at(rest) - a.center_at(from) + from.translation;
    let moved = |t: f64| Pose::new(from.rotation, meet + t * away);
    let (mut low, mut high) = (0.0, 2.0 * (a.radius() + b.radius()) + 2.0);
    for _ in 0..60 {
        let t = 0.5 * (low + high);
        let points = between(a, b, &moved(t), rest, 10.0).unwrap();
        if smallest(&points) > gap {
            high = t;
        } else {
            low = t;
        }
    }
    moved(high)
}

/// Largest relative error of all slopes against central differences, at the best step for each
/// quantity; none if the points aren't the same on both sides.
fn slope_error(evaluate: impl Fn(&Pose) -> Vec<ContactPoint>, pose: &Pose) -> f64 {
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
    let mut draw = Draw(23);
    let kinds = every_kind();
    let mut worst: f64 = 0.0;
    let (mut points, mut faded) = (0, 0);
    for first in &kinds {
        for second in &kinds {
            for gap in [0.02, 1e-3, -4e-3] {
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
    let mut draw = Draw(29);
    let plank = plain(&cuboid([1.0, 0.1, 0.05]));
    let rod = plain(&capsule(0.03, 0.7));
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
    let mut draw = Draw(31);
    for shape in every_kind() {
        for _ in 0..3 {
            let body = offset(&shape, draw.pose());
            let (point, normal, pose) = (draw.vector(), draw.vector(), draw.pose());
            let evaluate = |g: &Pose| against_wall(&body, &point, &normal, g, 100.0).unwrap();
            assert!(!evaluate(&pose).is_empty());
            let error = slope_error(evaluate, &pose);
            assert!(error < 1e-6, "{shape:?}: {error:e}");
        }
    }
}

#[test]
fn swapping_and_moving_both_bodies_change_nothing() {
    let mut draw = Draw(37);
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
            assert_eq!(here.len(), moved.len());
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
fn deep_and_degenerate_poses_stay_finite() {
    let mut draw = Draw(41);
    let kinds = every_kind();
    let mut refused = 0;
    for first in &kinds {
        for second in &kinds {
            let (a, b) = (plain(first), plain(second));
            let special = [
                at(0.0, 0.0, 0.0),
                at(0.05, 0.0, 0.0),
                at(0.0, 0.0, 0.1),
                at(0.15, 0.1, 0.2),
                at(0.3, 0.2, 0.4),
                at(0.3, 0.0, 0.0),
                turned([0.0, std::f64::consts::FRAC_PI_2, 0.0], [0.0; 3]),
                turned([std::f64::consts::PI, 0.0, 0.0], [0.0, 0.0, 0.4]),
            ];
            let random: Vec<Pose> = (0..40)
                .map(|_| Pose::new(draw.pose().rotation, 0.2 * draw.vector()))
                .collect();
            for pose in special.iter().chain(&random) {
                match between(&a, &b, pose, &Pose::identity(), 0.05) {
                    Ok(points) => assert!(
                        points.iter().all(is_finite),
                        "{first:?} {second:?} {pose:?} {points:#?}"
                    ),
                    Err(Error::Solver { .. }) => refused += 1,
                    Err(other) => panic!("{other}"),
                }
            }
        }
    }
    assert_eq!(refused, 0);
    let bad = at(f64::NAN, 0.0, 0.0);
    let ball = plain(&sphere(0.1));
    assert!(between(&ball, &ball, &bad, &bad, 0.1).is_err());
    assert!(between(&ball, &ball, &Pose::identity(), &at(1., 0., 0.), f64::NAN).is_err());
    let nowhere = Vec3::zeros();
    assert!(against_wall(&ball, &nowhere, &nowhere, &Pose::identity(), 0.1).is_err());
}

#[test]
fn meshes_are_taken_by_their_flat_faces_and_refused_if_not_convex() {
    let shape = cuboid([0.3, 0.2, 0.4]);
    let mesh = build(&shape, Path::new("."), Some(400)).unwrap();
    let offset = turned([0.2, 0.5, -0.3], [0.1, 0.2, 0.3]);
    let from_mesh = Geometry::of_mesh(&mesh, offset).unwrap();
    let exact = Geometry::of_shape(&shape, offset, Path::new(".")).unwrap();
    let wall = |g: &Geometry| {
        let mut heights: Vec<f64> = against_wall(
            g,
            &Vec3::zeros(),
            &Vec3::new(0.2, 0.5, 1.0),
            &Pose::identity(),
            9.0,
        )
        .unwrap()
        .iter()
        .map(|p| p.gap)
        .collect();
        heights.sort_by(f64::total_cmp);
        heights
    };
    let (ours, theirs) = (wall(&from_mesh), wall(&exact));
    assert_eq!((ours.len(), theirs.len()), (8, 8));
    assert!(ours.iter().zip(&theirs).all(|(x, y)| (x - y).abs() < 1e-14));

    let round = build(&sphere(0.1), Path::new("."), None).unwrap();
    let round = Geometry::of_mesh(&round, Pose::identity()).unwrap();
    let points = between(&round, &exact, &Pose::identity(), &Pose::identity(), 0.01).unwrap();
    assert!(points.iter().all(is_finite));

    // A box with its top pushed in.
    let vertices: Vec<Vec3> = mesh
        .vertices()
        .iter()
        .map(|v| {
            let inner = v.z > 0.19 && v.x.abs() < 0.14 && v.y.abs() < 0.09;
            if inner { v - 0.03 * Vec3::z() } else { *v }
        })
        .collect();
    let dented = TriMesh::new("dented", vertices, mesh.faces().to_vec()).unwrap();
    let error = Geometry::of_mesh(&dented, Pose::identity()).unwrap_err();
    let said = error.to_string();
    assert!(matches!(error, Error::Unsupported { .. }), "{said}");
    assert!(
        said.contains("convex hull") && said.contains("outside"),
        "{said}"
    );
}

#[test]
fn a_coin_that_slides_off_a_prism_feels_no_jump() {
    let (coin, prism) = (plain(&ellipsoid([0.2, 0.05, 0.2])), plain(&wedge()));
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

/// Corners of a box or of the wedge, world frame.
fn corners(shape: &Shape, pose: &Pose) -> Vec<parry3d_f64::math::Vector> {
    let (profile, half) = match shape {
        Shape::Box {
            size: [x, y, z], ..
        } => {
            let (y, z) = (0.5 * y, 0.5 * z);
            (vec![[-y, -z], [y, -z], [y, z], [-y, z]], 0.5 * x)
        }
        Shape::Prism {
            profile, length, ..
        } => (profile.clone(), 0.5 * length),
        _ => unreachable!("boxes and prisms only"),
    };
    let point = |x: f64, [y, z]: [f64; 2]| {
        let p = pose.apply(&Vec3::new(x, y, z));
        parry3d_f64::math::Vector::new(p.x, p.y, p.z)
    };
    let ends = profile.iter().map(|&p| [point(-half, p), point(half, p)]);
    ends.flatten().collect()
}

#[test]
fn gaps_of_random_polyhedra_are_those_of_gjk() {
    use parry3d_f64::{math::Pose as Place, query::distance, shape::ConvexPolyhedron};
    let mut draw = Draw(43);
    let shapes = [
        cuboid([0.3, 0.2, 0.4]),
        cuboid([1.0, 0.1, 0.05]),
        cuboid([0.5, 0.6, 0.02]),
        wedge(),
    ];
    let (mut apart, mut worst, mut off) = (0, 0.0f64, 0);
    for _ in 0..1500 {
        let (first, second) = (draw.pick(&shapes), draw.pick(&shapes));
        let (pose, rest) = (draw.pose(), draw.pose());
        let pose = Pose::new(pose.rotation, rest.translation + 0.6 * draw.vector());
        let points = between(&plain(first), &plain(second), &pose, &rest, 5.0).unwrap();
        assert!(!points.is_empty() && points.iter().all(is_finite));
        let hull = |shape: &Shape, pose: &Pose| {
            ConvexPolyhedron::from_convex_hull(&corners(shape, pose)).unwrap()
        };
        let (a, b) = (hull(first, &pose), hull(second, &rest));
        let same = Place::IDENTITY;
        let reference = distance(&same, &a, &same, &b).unwrap().distance;
        if reference < 1e-4 {
            continue;
        }
        apart += 1;
        // Crossings near the end of an edge and those of nearly parallel edges have faded, and the
        // corners alone are somewhat farther.
        let error = smallest(&points) - reference;
        worst = worst.max(error);
        off += usize::from(error > 1e-6);
        assert!((-1e-6..1e-2).contains(&error), "{error:e} {reference}");
    }
    println!("{apart} apart, worst {worst:e}, {off} above 1e-6");
    assert!(apart > 300 && 20 * off < apart, "{apart} {off}");
}

#[test]
fn planks_that_slide_off_one_another_feel_no_jump() {
    let (plank, rod) = (
        plain(&cuboid([1.0, 0.1, 0.05])),
        plain(&capsule(0.025, 0.8)),
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

#[test]
fn ellipsoids_of_any_aspect_have_a_common_normal() {
    let mut draw = Draw(47);
    let (mut refused, mut worst) = (0, 0.0f64);
    for _ in 0..2000 {
        let mut axes = || [0; 3].map(|_| 10f64.powf(1.25 * draw.number() - 1.25));
        let shapes = [ellipsoid(axes()), ellipsoid(axes())];
        let [a, b] = shapes.each_ref().map(plain);
        let (pose, rest) = (draw.pose(), draw.pose());
        let ball = plain(&sphere(1e-9));
        for spread in [0.02, 0.3, 2.0] {
            let place = Pose::new(pose.rotation, rest.translation + spread * draw.vector());
            match between(&a, &b, &place, &rest, 10.0) {
                Ok(points) => {
                    let p = &points[0];
                    assert!(is_finite(p), "{shapes:?} {place:?} {rest:?}");
                    // The witness point of the first is as far from the second as the gap says.
                    if p.gap > 0.0 {
                        let x = p.position + 0.5 * p.gap * p.normal;
                        let there = Pose::new(Mat3::identity(), x);
                        let q = &between(&ball, &b, &there, &rest, 20.0).unwrap()[0];
                        worst = worst.max((q.gap + 1e-9 - p.gap).abs());
                    }
                }
                Err(_) => refused += 1,
            }
        }
    }
    println!("{refused} refused, worst {worst:e}");
    assert!(worst < 1e-9, "{worst:e}");
    assert_eq!(refused, 0);
}

#[test]
fn points_scale_with_the_bodies() {
    let mut draw = Draw(53);
    let scaled = |shape: &Shape, by: f64| match shape.clone() {
        Shape::Sphere { radius, .. } => sphere(by * radius),
        Shape::Capsule { radius, length, .. } => capsule(by * radius, by * length),
        Shape::Ellipsoid { semi_axes, .. } => ellipsoid(semi_axes.map(|a| by * a)),
        Shape::Box { size, .. } => cuboid(size.map(|a| by * a)),
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
