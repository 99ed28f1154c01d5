//! Gaps of polyhedra against another program's.

use super::*;

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
    let mut draw = Draw::new(43);
    let shapes = [
        Shape::cuboid([0.3, 0.2, 0.4]),
        Shape::cuboid([1.0, 0.1, 0.05]),
        Shape::cuboid([0.5, 0.6, 0.02]),
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
