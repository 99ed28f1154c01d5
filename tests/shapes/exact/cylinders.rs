//! Cylinders, and what another library makes of them.

use super::*;

/// Distance of a point from a cylinder along z, outside.
fn from_cylinder(radius: f64, half: f64, y: &Vec3) -> f64 {
    let (beside, above) = (y.xy().norm() - radius, y.z.abs() - half);
    beside.max(0.0).hypot(above.max(0.0))
}

/// Distance of two cylinders that are apart: nearest points are on a rim of either, or where the sides cross.
fn cylinders([(r, h), (s, k)]: [(f64, f64); 2], poses: [Pose; 2]) -> f64 {
    let rim = |(r, h): (f64, f64), (s, k): (f64, f64), a: &Pose, b: &Pose| {
        let mut least = f64::INFINITY;
        for z in [-h, h] {
            let distance = |t: f64| {
                let x = a.apply(&Vec3::new(r * t.cos(), r * t.sin(), z));
                from_cylinder(s, k, &b.apply_inverse(&x))
            };
            let n = 360;
            let step = TAU / n as f64;
            let all: Vec<f64> = (0..n).map(|i| distance(step * i as f64)).collect();
            for i in 0..n {
                if all[i] > all[(i + 1) % n] || all[i] > all[(i + n - 1) % n] {
                    continue;
                }
                // Golden section around each lowest one.
                let (mut low, mut high) = (step * (i as f64 - 1.0), step * (i as f64 + 1.0));
                let part = 0.5 * (5f64.sqrt() - 1.0);
                for _ in 0..80 {
                    let (x, y) = (high - part * (high - low), low + part * (high - low));
                    if distance(x) < distance(y) {
                        high = y;
                    } else {
                        low = x;
                    }
                }
                least = least.min(distance(0.5 * (low + high)));
            }
        }
        least
    };
    let [a, b] = &poses;
    let rims = rim((r, h), (s, k), a, b).min(rim((s, k), (r, h), b, a));
    let ends = |p: &Pose, h: f64| [-h, h].map(|z| p.apply(&Vec3::new(0.0, 0.0, z)));
    let ([c, d], [e, f]) = (ends(a, h), ends(b, k));
    // Where the axes' common normal meets both between their ends.
    let (u, v, w) = (d - c, f - e, c - e);
    let (uu, uv, vv) = (u.dot(&u), u.dot(&v), v.dot(&v));
    let along = uu * vv - uv * uv;
    let p = (uv * v.dot(&w) - vv * u.dot(&w)) / along;
    let q = (uu * v.dot(&w) - uv * u.dot(&w)) / along;
    let inner = [p, q].iter().all(|x| (0.0..=1.0).contains(x));
    let sides = if inner {
        (w + p * u - q * v).norm() - r - s
    } else {
        f64::INFINITY
    };
    rims.min(sides)
}

#[test]
fn cylinders_at_known_and_random_poses() {
    let (a, b) = (Shape::cylinder(0.5, 2.0), Shape::cylinder(0.3, 1.0));
    let o = at(0.0, 0.0, 0.0);
    let near = |exact: f64, pose: Pose| check(gap(&a, o, &b, pose), exact, 1e-12);
    for exact in [1e-4, 0.1, 3.0] {
        // Parallel, crossed, end on end (over one another and aside), end on side, and an end beside an end.
        near(exact, at(0.8 + exact, 0.0, 0.3));
        near(
            exact,
            turned([FRAC_PI_2, 0.0, 0.0], [0.8 + exact, 0.1, 0.4]),
        );
        near(exact, at(0.0, 0.0, 1.5 + exact));
        near(exact, at(0.6, 0.0, 1.5 + exact));
        near(
            exact,
            turned([0.0, FRAC_PI_2, 0.0], [0.5 + 0.5 + exact, 0.1, 0.2]),
        );
        near(exact.hypot(0.2), at(0.8 + exact, 0.0, 1.7));
        // A rim over an end, tilted.
        let tilt: f64 = 0.3;
        let low = 0.3 * tilt.sin() + 0.5 * tilt.cos();
        near(
            exact,
            turned([0.0, tilt, 0.0], [0.0, 0.0, 1.0 + low + exact]),
        );
        // Rim and rim, in the plane of both axes: along the way between the two corners there.
        let way = Vec3::new(0.6, 0.0, 0.8);
        let turn = exp_matrix(&Vec3::new(0.0, 0.3, 0.0));
        let corner = turn * Vec3::new(-0.3, 0.0, -0.5);
        near(
            exact,
            Pose::new(turn, Vec3::new(0.5, 0.0, 1.0) + exact * way - corner),
        );
    }
    // Overlapping: out through the side, and through an end.
    near(-0.2, at(0.6, 0.0, 0.0));
    near(-0.01, at(0.1, 0.0, 1.49));

    let mut random = Samples::new(13);
    let kinds = [(0.5, 1.0), (0.3, 0.5), (0.4, 0.02), (0.05, 0.6)];
    let (mut apart, mut worst) = (0, 0.0_f64);
    for n in 0..600 {
        let pair = [kinds[n % 4], kinds[(n / 4) % 4]];
        let poses = [pose(&mut random, 1.0), pose(&mut random, 1.0)];
        let shapes = pair.map(|(r, h)| Shape::cylinder(r, 2.0 * h));
        let found = gap(&shapes[0], poses[0], &shapes[1], poses[1]);
        if found < 1e-3 {
            continue;
        }
        apart += 1;
        let exact = cylinders(pair, poses);
        worst = worst.max((found / exact - 1.0).abs());
    }
    println!("{apart} pairs of cylinders: off by {worst:.1e} of the gap at most");
    assert!(apart > 200 && worst < 1e-9, "{apart} {worst:e}");
}

/// Why distances aren't asked of parry3d: its search stops at the root of ten roundings, at lengths that aren't scaled.
#[test]
fn another_library_stops_short() {
    use parry3d_f64::math::{Pose as Place, Vector};
    use parry3d_f64::query::distance;
    use parry3d_f64::shape::Cylinder;
    let mut random = Samples::new(19);
    let kinds = [(0.5, 1.0), (0.3, 0.5), (0.4, 0.02), (0.05, 0.6)];
    let (mut ours, mut theirs) = (0.0_f64, 0.0_f64);
    for n in 0..300 {
        let pair = [kinds[n % 4], kinds[(n / 4) % 4]];
        let turns = [3.0 * vector(&mut random), 3.0 * vector(&mut random)];
        let places = [vector(&mut random), vector(&mut random)];
        let poses = [0, 1].map(|k| Pose::new(exp_matrix(&turns[k]), places[k]));
        let exact = cylinders(pair, poses);
        if exact < 1e-2 {
            continue;
        }
        let shapes = pair.map(|(r, h)| Shape::cylinder(r, 2.0 * h));
        ours = ours.max((gap(&shapes[0], poses[0], &shapes[1], poses[1]) / exact - 1.0).abs());
        // Theirs are along y.
        let upright = exp_matrix(&Vec3::new(FRAC_PI_2, 0.0, 0.0));
        let place = |k: usize| {
            let w = turn_vector(&(poses[k].rotation * upright));
            let x = places[k];
            Place::new(Vector::new(x.x, x.y, x.z), Vector::new(w.x, w.y, w.z))
        };
        let theirs_of = |(r, h): (f64, f64)| Cylinder::new(h, r);
        let found = distance(
            &place(0),
            &theirs_of(pair[0]),
            &place(1),
            &theirs_of(pair[1]),
        );
        theirs = theirs.max((found.unwrap().distance / exact - 1.0).abs());
    }
    println!("cylinders at random: ours off by {ours:.1e} of the gap, parry3d by {theirs:.1e}");
    assert!(ours < 1e-9 && theirs > 1e-9, "{ours:e} {theirs:e}");
}

/// The rotation vector of a rotation.
fn turn_vector(turn: &hydrograd::adjoint::lie::Mat3) -> Vec3 {
    nalgebra::Rotation3::from_matrix_unchecked(*turn).scaled_axis()
}

#[test]
fn a_disc_flat_over_a_face_is_as_far_as_it_is() {
    // Tilted by less and less: the lowest point of the rim.
    let (coin, plate) = (Shape::cylinder(0.4, 0.04), Shape::cuboid([2.0, 2.0, 0.1]));
    for tilt in [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, PI / 3.0] {
        let low = 0.4 * f64::sin(tilt) + 0.02 * f64::cos(tilt);
        for exact in [1e-6, 1e-3, 0.1] {
            let there = turned(
                [0.6 * tilt, 0.8 * tilt, 0.0],
                [0.1, 0.2, 0.05 + low + exact],
            );
            let found = gap(&coin, there, &plate, Pose::identity());
            assert!(
                (found - exact).abs() < 1e-15 + 1e-10 * exact,
                "{tilt:e}: {found:e} {exact:e}"
            );
        }
    }
}
