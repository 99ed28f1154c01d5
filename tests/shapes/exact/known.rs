//! Spheres, capsules, ellipsoids and boxes, and walls.

use super::*;

#[test]
fn spheres_and_capsules() {
    let mut random = Samples::new(3);
    let (ball, small) = (Shape::sphere(1.0), Shape::sphere(0.3));
    for exact in [1e-6, 1e-3, 0.1, 10.0, -1e-3, -0.5] {
        let way = vector(&mut random).normalize() * (1.3 + exact);
        let there = Pose::new(exp_matrix(&vector(&mut random)), way);
        let found = gap(&ball, Pose::identity(), &small, there);
        assert!(
            (found - exact).abs() < 1e-15 * (1.0 + way.norm()),
            "{found:e} {exact:e}"
        );
    }
    // Concentric, and one inside the other: the shift that parts them.
    assert_eq!(
        gap(&ball, at(0.0, 0.0, 0.0), &small, at(0.0, 0.0, 0.0)),
        -1.3
    );
    check(
        gap(&ball, at(0.0, 0.0, 0.0), &small, at(0.2, 0.0, 0.0)),
        -1.1,
        1e-14,
    );

    let rods = [Shape::capsule(0.1, 1.0), Shape::capsule(0.2, 0.7)];
    for _ in 0..500 {
        let poses = [pose(&mut random, 1.0), pose(&mut random, 1.0)];
        let ends =
            |k: usize, half: f64| [-half, half].map(|z| poses[k].apply(&Vec3::new(0.0, 0.0, z)));
        let exact = segments(ends(0, 0.5), ends(1, 0.35)) - 0.3;
        let found = gap(&rods[0], poses[0], &rods[1], poses[1]);
        assert!((found - exact).abs() < 1e-13, "{found:e} {exact:e}");
    }
}

/// Distance of two segments: where the lines are nearest, or at an end of either.
fn segments([a, b]: [Vec3; 2], [c, d]: [Vec3; 2]) -> f64 {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv) = (u.dot(&u), u.dot(&v), v.dot(&v));
    let along = uu * vv - uv * uv;
    let s = (uv * v.dot(&w) - vv * u.dot(&w)) / along;
    let t = (uu * v.dot(&w) - uv * u.dot(&w)) / along;
    let inner = [s, t].iter().all(|x| (0.0..=1.0).contains(x));
    let lines = if inner {
        (w + s * u - t * v).norm()
    } else {
        f64::INFINITY
    };
    let end = |p: Vec3, from: Vec3, way: Vec3| {
        let s = ((p - from).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
        (p - from - s * way).norm()
    };
    let ends = [end(a, c, v), end(b, c, v), end(c, a, u), end(d, a, u)];
    ends.into_iter().fold(lines, f64::min)
}

#[test]
fn walls() {
    let mut random = Samples::new(5);
    let profile = vec![[-0.2, -0.1], [-0.15, 0.1], [0.25, 0.1], [0.3, -0.1]];
    for _ in 0..200 {
        let wall = Wall::rigid(random.vector(1.0), random.vector(1.0));
        let plane = wall.half_space(0).unwrap();
        let pose = pose(&mut random, 2.0);
        let (height, down) = (
            plane.height(&pose.translation),
            pose.rotation.tr_mul(&plane.normal),
        );
        let of = |shape: Shape| wall_gap(&shape, pose, wall).distance;
        let near = |found: f64, exact: f64| {
            assert!((found - exact).abs() < 1e-14, "{found:e} {exact:e}");
        };
        near(of(Shape::sphere(0.4)), height - 0.4);
        let axes = Vec3::new(0.7, 0.2, 0.05);
        near(
            of(Shape::ellipsoid(axes.into())),
            height - axes.component_mul(&down).norm(),
        );
        near(
            of(Shape::capsule(0.1, 0.6)),
            height - 0.3 * down.z.abs() - 0.1,
        );
        near(
            of(Shape::cylinder(0.5, 0.2)),
            height - 0.5 * down.xy().norm() - 0.1 * down.z.abs(),
        );
        near(
            of(Shape::cuboid([0.2, 0.4, 0.6])),
            height - down.abs().dot(&Vec3::new(0.1, 0.2, 0.3)),
        );
        let corners = profile
            .iter()
            .flat_map(|[y, z]| [-0.3, 0.3].map(|x| Vec3::new(x, *y, *z)));
        let lowest = corners
            .map(|c| plane.height(&pose.apply(&c)))
            .fold(f64::INFINITY, f64::min);
        near(of(Shape::prism(profile.clone(), 0.6)), lowest);
    }
}

/// The point of an ellipsoid nearest to one outside, by bisection of Lagrange's multiplier.
fn onto_ellipsoid(axes: &Vec3, pose: &Pose, x: &Vec3) -> Vec3 {
    let y = pose.apply_inverse(x);
    let at = |t: f64| Vec3::from_fn(|i, _| axes[i] * axes[i] * y[i] / (axes[i] * axes[i] + t));
    let (mut low, mut high) = (0.0, axes.max() * y.norm() * 2.0);
    for _ in 0..200 {
        let t = 0.5 * (low + high);
        if at(t).component_div(axes).norm() > 1.0 {
            low = t;
        } else {
            high = t;
        }
    }
    pose.apply(&at(0.5 * (low + high)))
}

#[test]
fn ellipsoids_are_as_far_as_going_to_and_fro_says() {
    let mut random = Samples::new(7);
    let axes = [
        Vec3::new(0.7, 0.2, 0.05),
        Vec3::new(0.4, 0.5, 0.3),
        Vec3::repeat(0.25),
    ];
    let (mut apart, mut worst) = (0, 0.0_f64);
    for k in 0..150 {
        let (a, b) = (&axes[k % 3], &axes[(k / 3) % 3]);
        let poses = [pose(&mut random, 1.0), pose(&mut random, 1.0)];
        let shapes = [a, b].map(|axes| Shape::ellipsoid((*axes).into()));
        let found = gap(&shapes[0], poses[0], &shapes[1], poses[1]);
        if found < 0.05 {
            continue;
        }
        apart += 1;
        let mut x = poses[0].translation;
        let mut y = x;
        for _ in 0..3000 {
            y = onto_ellipsoid(b, &poses[1], &x);
            x = onto_ellipsoid(a, &poses[0], &y);
        }
        let exact = (x - y).norm();
        worst = worst.max((found / exact - 1.0).abs());
    }
    println!("{apart} pairs of ellipsoids: off by {worst:.1e} of the gap at most");
    assert!(apart > 60 && worst < 1e-9, "{apart} {worst:e}");
}

#[test]
fn faces_edges_and_corners_of_boxes() {
    let cube = Shape::cuboid([1.0; 3]);
    let o = at(0.0, 0.0, 0.0);
    let near = |exact: f64, pose: Pose| check(gap(&cube, o, &cube, pose), exact, 1e-14);
    near(0.25, at(1.25, 0.2, 0.1));
    near(0.5f64.hypot(0.25), at(1.5, 1.25, 0.3));
    near(Vec3::new(0.5, 0.25, 1.0).norm(), at(1.5, 1.25, 2.0));
    let diagonal = 0.5f64.sqrt();
    near(
        0.1,
        turned([0.0, 0.0, FRAC_PI_4], [0.5 + diagonal + 0.1, 0.0, 0.0]),
    );
    let (roof, floor) = (
        turned([0.0, FRAC_PI_4, 0.0], [0.0; 3]),
        turned([FRAC_PI_4, 0.0, 0.0], [0.0, 0.0, 2.0 * diagonal + 0.3]),
    );
    check(gap(&cube, roof, &cube, floor), 0.3, 1e-14);
    // Touching at a face, an edge and a corner, and overlapping: the shortest way out.
    for pose in [at(1.0, 0.3, 0.2), at(1.0, 1.0, 0.3), at(1.0, 1.0, 1.0)] {
        assert_eq!(gap(&cube, o, &cube, pose), 0.0);
    }
    near(-0.1, at(0.9, 0.85, 0.8));
    near(-0.3, at(0.7, 0.0, 0.0));
    near(-1.0, o);
    let lift = 2.0 * diagonal - 1e-5;
    let crossed = turned([FRAC_PI_4, 0.0, 0.0], [0.0, 0.0, lift]);
    let found = gap(&cube, roof, &cube, crossed);
    assert!((found + 1e-5).abs() < 1e-14, "{found:e}");
}
