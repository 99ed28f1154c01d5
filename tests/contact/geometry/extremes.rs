//! Deep, degenerate and slender bodies, and meshes.

use super::*;

#[test]
fn deep_and_degenerate_poses_stay_finite() {
    let mut draw = Draw::new(41);
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
    // Swallowed whole, the ellipsoid still has its one point.
    let (coin, hall) = (plain(&kinds[2]), plain(&Shape::cuboid([1.0, 0.8, 0.9])));
    for _ in 0..200 {
        let pose = Pose::new(draw.pose().rotation, 0.4 * draw.vector());
        let points = between(&coin, &hall, &pose, &Pose::identity(), 0.05).unwrap();
        assert!(points.len() == 1 && points[0].gap < 0.0 && is_finite(&points[0]));
    }
    let bad = at(f64::NAN, 0.0, 0.0);
    let ball = plain(&Shape::sphere(0.1));
    assert!(between(&ball, &ball, &bad, &bad, 0.1).is_err());
    assert!(between(&ball, &ball, &Pose::identity(), &at(1., 0., 0.), f64::NAN).is_err());
    let nowhere = Vec3::zeros();
    assert!(HalfSpace::new(&nowhere, &nowhere).is_none());
    let floor = HalfSpace::new(&nowhere, &Vec3::z()).unwrap();
    assert!(against_wall(&ball, &floor, &bad, 0.1).is_err());
}

#[test]
fn meshes_are_taken_by_their_flat_faces_and_refused_if_not_convex() {
    let shape = Shape::cuboid([0.3, 0.2, 0.4]);
    let mesh = build(&shape, Path::new("."), Some(400)).unwrap();
    let offset = turned([0.2, 0.5, -0.3], [0.1, 0.2, 0.3]);
    let from_mesh = ContactShape::of_mesh(&mesh, offset).unwrap();
    let exact = ContactShape::of_shape(&shape, offset, Path::new(".")).unwrap();
    let wall = |g: &ContactShape| {
        let mut heights: Vec<f64> = against_wall(
            g,
            &HalfSpace::new(&Vec3::zeros(), &Vec3::new(0.2, 0.5, 1.0)).unwrap(),
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

    let round = build(&Shape::sphere(0.1), Path::new("."), None).unwrap();
    let round = ContactShape::of_mesh(&round, Pose::identity()).unwrap();
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
    let error = ContactShape::of_mesh(&dented, Pose::identity()).unwrap_err();
    let said = error.to_string();
    assert!(matches!(error, Error::Unsupported { .. }), "{said}");
    assert!(
        said.contains("convex hull") && said.contains("outside"),
        "{said}"
    );
}

#[test]
fn ellipsoids_of_any_aspect_have_a_common_normal() {
    let mut draw = Draw::new(47);
    let (mut refused, mut worst) = (0, 0.0f64);
    for _ in 0..2000 {
        let mut axes = || [0; 3].map(|_| 10f64.powf(1.25 * draw.number() - 1.25));
        let shapes = [Shape::ellipsoid(axes()), Shape::ellipsoid(axes())];
        let [a, b] = shapes.each_ref().map(plain);
        let (pose, rest) = (draw.pose(), draw.pose());
        let ball = plain(&Shape::sphere(1e-9));
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
