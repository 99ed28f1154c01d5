//! Gaps between placed meshes and walls, shares of volumes, and meshes with other numbers of faces.

use hydrograd::adjoint::lie::{Pose, Vec3, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::geometry::{
    Edge, Gap, Gaps, Kind, Other, Severity, Share, Wall, check_parts, overlap_error,
};
use hydrograd::shape::build;
use hydrograd::{Shape, TriMesh};
use std::path::Path;

fn sphere(radius: f64, faces: usize) -> TriMesh {
    let faces = Some(faces);
    build(&Shape::Sphere { radius, faces }, Path::new("."), None).unwrap()
}

fn cuboid(size: [f64; 3], faces: usize) -> TriMesh {
    let faces = Some(faces);
    build(&Shape::Box { size, faces }, Path::new("."), None).unwrap()
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::new(exp_matrix(&Vec3::zeros()), Vec3::new(x, y, z))
}

fn turned(w: [f64; 3], x: [f64; 3]) -> Pose {
    Pose::new(exp_matrix(&Vec3::from(w)), Vec3::from(x))
}

/// The gap of two meshes, which must be the same whoever comes first and wherever the two are
/// carried together.
fn gap(a: &TriMesh, at_a: Pose, b: &TriMesh, at_b: Pose) -> f64 {
    let there = Gaps::new(&[Some(a), Some(b)], &[], &[]).unwrap();
    let back = Gaps::new(&[Some(b), Some(a)], &[], &[]).unwrap();
    let found = there.smallest(&[at_a, at_b]).unwrap();
    assert_eq!(there.all(&[at_a, at_b]), [found]);
    assert_eq!(there.smallest(&[at_a, at_b]).unwrap(), found);
    let size = a.diameter() + b.diameter();
    let swapped = back.smallest(&[at_b, at_a]).unwrap().distance;
    let carry = turned([0.4, -1.3, 2.2], [0.3 * size, -size, 0.7 * size]);
    let carried = there
        .smallest(&[carry.compose(&at_a), carry.compose(&at_b)])
        .unwrap()
        .distance;
    let d = found.distance;
    for other in [swapped, carried] {
        assert!(
            (other - d).abs() < 1e-11 * d.abs() + 1e-12 * size,
            "{d:e} {other:e}"
        );
    }
    d
}

fn vector(random: &mut Samples) -> Vec3 {
    Vec3::from(random.vector(1.0))
}

#[test]
fn spheres_at_known_gaps() {
    let ball = sphere(1.0, 1280);
    // An inscribed mesh falls short by at most this much of the sphere.
    let sagitta = 1.0
        - (0..ball.faces().len())
            .map(|f| ball.corners(f)[0].dot(&ball.normal(f)))
            .fold(1.0, f64::min);
    assert!(sagitta < 0.01);
    for exact in [1e-6, 1e-3, 0.1, 1.0, 10.0] {
        for way in [
            Vec3::x(),
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(-0.3, 0.1, 0.7),
        ] {
            let there = turned([0.1, 0.9, -0.5], (way.normalize() * (2.0 + exact)).into());
            let found = gap(&ball, at(0.0, 0.0, 0.0), &ball, there);
            assert!(found >= exact - 1e-14, "{found} {exact}");
            assert!(found <= exact + 2.0 * sagitta, "{found} {exact}");
        }
    }
    // Along x vertex meets vertex.
    let found = gap(&ball, at(0.0, 0.0, 0.0), &ball, at(2.0 + 1e-6, 0.0, 0.0));
    assert!((found - 1e-6).abs() < 1e-14, "{found}");
}

#[test]
fn boxes_exactly() {
    for faces in [12, 500] {
        let cube = cuboid([1.0; 3], faces);
        let o = at(0.0, 0.0, 0.0);
        let near = |expected: f64, pose: Pose| {
            let found = gap(&cube, o, &cube, pose);
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        };
        // Face to face, edge to edge, corner to corner.
        near(0.25, at(1.25, 0.2, 0.1));
        near(0.5f64.hypot(0.25), at(1.5, 1.25, 0.3));
        near(Vec3::new(0.5, 0.25, 1.0).norm(), at(1.5, 1.25, 2.0));
        // An edge to a face, a corner to a face, crossed edges.
        let quarter = std::f64::consts::FRAC_PI_4;
        let diagonal = 0.5f64.sqrt();
        near(
            0.1,
            turned([0.0, 0.0, quarter], [0.5 + diagonal + 0.1, 0.0, 0.0]),
        );
        let tip = Vec3::new(1.0, 1.0, 1.0);
        let axis = tip.cross(&Vec3::x()).normalize() * (1.0 / 3f64.sqrt()).acos();
        near(
            0.2,
            turned((-axis).into(), [-0.5 - 0.75f64.sqrt() - 0.2, 0.0, 0.0]),
        );
        let roof = turned([0.0, quarter, 0.0], [0.0; 3]);
        let floor = turned([quarter, 0.0, 0.0], [0.0, 0.0, 2.0 * diagonal + 0.3]);
        let found = gap(&cube, roof, &cube, floor);
        assert!((found - 0.3).abs() < 1e-12, "{found}");
    }
}

#[test]
fn touching_is_zero() {
    let cube = cuboid([1.0; 3], 12);
    for pose in [at(1.0, 0.0, 0.0), at(1.0, 0.3, 0.2), at(1.0, 1.0, 1.0)] {
        let gaps = Gaps::new(&[Some(&cube), Some(&cube)], &[], &[]).unwrap();
        let found = gaps.smallest(&[at(0.0, 0.0, 0.0), pose]).unwrap();
        assert_eq!(found.distance, 0.0);
    }
}

#[test]
fn crossing_surfaces_overlap() {
    let cube = cuboid([1.0; 3], 12);
    let o = at(0.0, 0.0, 0.0);
    // A corner inside: as deep as it reaches.
    let found = gap(&cube, o, &cube, at(0.9, 0.85, 0.8));
    assert!((found + 0.1).abs() < 1e-12, "{found}");
    // Sides that lie in one plane, and surfaces that are the same.
    let shifted = gap(&cube, o, &cube, at(0.7, 0.0, 0.0));
    assert!((-0.3 - 1e-12..-0.1).contains(&shifted), "{shifted}");
    let same = gap(&cube, o, &cube, o);
    assert!((same + 0.5).abs() < 1e-12, "{same}");
    // Crossed bars and plates, with no vertex of one inside the other.
    let bar = cuboid([4.0, 0.2, 0.2], 12);
    let crossed = gap(&bar, o, &bar, turned([0.0, 0.0, 1.5], [0.0, 0.0, 0.15]));
    assert!((-0.05 - 1e-12..-0.04).contains(&crossed), "{crossed}");
    let plate = cuboid([1.0, 1.0, 1e-3], 12);
    let cut = gap(&plate, o, &plate, turned([1.2, 0.0, 0.0], [0.1, 0.2, 0.0]));
    assert!(cut < -1e-4, "{cut}");
    // Edges that only just cross.
    let quarter = std::f64::consts::FRAC_PI_4;
    let lift = 2f64.sqrt() - 1e-5;
    let edges = gap(
        &cube,
        turned([0.0, quarter, 0.0], [0.0; 3]),
        &cube,
        turned([quarter, 0.0, 0.0], [0.0, 0.0, lift]),
    );
    assert!((-1e-5..-1e-6).contains(&edges), "{edges}");
}

#[test]
fn spheres_in_one_another() {
    let ball = sphere(1.0, 1280);
    for depth in [1e-3, 0.05, 0.3, 0.9] {
        let found = gap(&ball, at(0.0, 0.0, 0.0), &ball, at(2.0 - depth, 0.0, 0.0));
        assert!((-depth - 1e-12..0.0).contains(&found), "{found} {depth}");
        assert!(found < -0.8 * depth, "{found} {depth}");
    }
}

#[test]
fn one_inside_another_overlaps() {
    let ball = sphere(1.0, 1280);
    let grain = sphere(0.01, 80);
    let found = gap(&ball, at(0.0, 0.0, 0.0), &grain, at(0.3, 0.2, 0.1));
    let depth = 1.0 - Vec3::new(0.3, 0.2, 0.1).norm() + 0.01;
    assert!((found + depth).abs() < 0.02, "{found} {depth}");
    // A thin plate inside a larger box, of 12 faces.
    let (case, plate) = (cuboid([1.0, 1.0, 0.2], 12), cuboid([0.5, 0.5, 1e-3], 12));
    let found = gap(&case, at(0.0, 0.0, 0.0), &plate, at(0.1, 0.0, 0.0));
    assert!((found + 0.1).abs() < 1e-3, "{found}");
    // And outside, parallel to it: the nearest is a face.
    let found = gap(&case, at(0.0, 0.0, 0.0), &plate, at(0.1, 0.0, 0.2));
    assert!((found - 0.0995).abs() < 1e-12, "{found}");
}

/// A square frame around z: `outer` and `inner` are half the widths of its two squares, `half` is half its
/// height.
fn frame(outer: f64, inner: f64, half: f64) -> TriMesh {
    let corner = |r: f64, z: f64, k: usize| {
        let (x, y) = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][k % 4];
        Vec3::new(r * x, r * y, z)
    };
    // Around the section, outward seen from its middle.
    let section = [(inner, -half), (outer, -half), (outer, half), (inner, half)];
    let at = |k: usize, s: usize| 4 * (k % 4) + s % 4;
    let vertices = (0..4).flat_map(|k| section.map(|(r, z)| corner(r, z, k)));
    let sides = (0..4).flat_map(|k| (0..4).map(move |s| (k, s)));
    let faces = sides.flat_map(|(k, s)| {
        let [a, b, c, d] = [at(k, s), at(k + 1, s), at(k + 1, s + 1), at(k, s + 1)];
        [[a, b, c], [a, c, d]]
    });
    TriMesh::new("frame", vertices.collect(), faces.collect()).unwrap()
}

#[test]
fn inside_a_hollow_is_not_overlap() {
    let frame = frame(1.0, 0.8, 0.5).split().split();
    let ball = sphere(0.3, 320);
    let found = gap(&frame, at(0.0, 0.0, 0.0), &ball, at(0.1, 0.0, 0.0));
    assert!((0.4 - 1e-12..0.41).contains(&found), "{found}");
    let stuck = sphere(0.05, 320);
    let found = gap(&frame, at(0.0, 0.0, 0.0), &stuck, at(0.9, 0.0, 0.0));
    assert!(found < 0.0, "{found}");
}

#[test]
fn each_piece_of_a_mesh_is_seen() {
    let (far, near) = (sphere(0.1, 80), sphere(0.1, 80));
    let count = far.vertices().len();
    let moved = near.transformed(&at(3.0, 0.0, 0.0));
    let vertices = [far.vertices(), moved.vertices()].concat();
    let second = near.faces().iter().map(|f| f.map(|v| v + count));
    let faces: Vec<_> = far.faces().iter().copied().chain(second).collect();
    let report = check_parts("two", &vertices, &faces);
    assert_eq!(
        report.find(Kind::Components).unwrap().severity,
        Severity::Warning
    );
    let two = TriMesh::new("two", vertices, faces).unwrap();
    // Either piece inside another body overlaps it, as it does alone.
    let outer = sphere(1.0, 320);
    let alone = gap(&outer, at(3.0, 0.0, 0.0), &moved, at(0.0, 0.0, 0.0));
    assert!(alone < -0.9, "{alone}");
    for x in [0.0, 3.0] {
        let found = gap(&outer, at(x, 0.0, 0.0), &two, at(0.0, 0.0, 0.0));
        assert!((found - alone).abs() < 0.02, "{found}, alone {alone}");
    }
    let between = gap(&outer, at(1.5, 0.0, 0.0), &two, at(0.0, 0.0, 0.0));
    assert!((0.4 - 1e-12..0.45).contains(&between), "{between}");
}

#[test]
fn walls() {
    let ball = sphere(0.5, 1280);
    let wall = Wall {
        surface: Default::default(),
        point: [0.0, 0.0, -1.0],
        normal: [0.0, 0.0, 3.0],
    };
    let slanted = Wall {
        surface: Default::default(),
        point: [-2.0, 0.0, 0.0],
        normal: [1e-200, 0.0, 1e-200],
    };
    let gaps = Gaps::new(&[Some(&ball)], &[wall, slanted], &[]).unwrap();
    let found = gaps.smallest(&[at(5.0, 0.0, 0.0)]).unwrap();
    assert_eq!((found.first, found.second), (0, Other::Wall(0)));
    assert!((found.distance - 0.5).abs() < 1e-15, "{}", found.distance);
    let through = gaps.smallest(&[at(5.0, 0.0, -0.75)]).unwrap();
    assert!((through.distance + 0.25).abs() < 1e-15);
    let near = gaps.smallest(&[at(-2.0, 0.0, 0.8)]).unwrap();
    assert_eq!(near.second, Other::Wall(1));
    let expected = 0.8 * 0.5f64.sqrt() - 0.5;
    assert!(near.distance >= expected && near.distance < expected + 0.005);
    let least = |pose: Pose| {
        let heights = ball.vertices().iter().map(|x| pose.apply(x)[2] + 1.0);
        heights.fold(f64::INFINITY, f64::min)
    };
    let mut random = Samples::new(5);
    for _ in 0..20 {
        let pose = turned(
            (vector(&mut random) * 3.0).into(),
            [4.0, 0.0, random.number()],
        );
        assert!((gaps.all(&[pose])[0].distance - least(pose)).abs() < 1e-14);
    }
}

#[test]
fn the_smallest_of_many_is_that_of_all() {
    let mut random = Samples::new(23);
    let meshes = [
        sphere(0.3, 80),
        cuboid([0.5, 0.3, 0.2], 100),
        cuboid([1.0, 1.0, 0.01], 12),
    ];
    let list: Vec<Option<&TriMesh>> = (0..12)
        .map(|i| if i == 4 { None } else { meshes.get(i % 3) })
        .collect();
    let wall = Wall {
        surface: Default::default(),
        point: [0.0, 0.0, -2.5],
        normal: [0.0, 0.0, 1.0],
    };
    let gaps = Gaps::new(&list, &[wall], &[(2, 0), (3, 5)]).unwrap();
    let mut negative = 0;
    for k in 0..60 {
        let spread = 1.0 + 0.05 * f64::from(k);
        let poses: Vec<Pose> = list
            .iter()
            .map(|_| {
                turned(
                    (vector(&mut random) * 2.0).into(),
                    (vector(&mut random) * spread).into(),
                )
            })
            .collect();
        let all = gaps.all(&poses);
        assert_eq!(all.len(), 11 * 10 / 2 - 2 + 11);
        assert!(
            all.iter()
                .all(|g| g.first != 4 && g.second != Other::Body(4))
        );
        assert!(
            !all.iter()
                .any(|g| (g.first, g.second) == (0, Other::Body(2)))
        );
        let least = all.iter().map(|g| g.distance).fold(f64::INFINITY, f64::min);
        let found = gaps.smallest(&poses).unwrap();
        assert!(
            (found.distance - least).abs() <= 1e-11 * least.abs(),
            "{} {least}",
            found.distance
        );
        negative += usize::from(least < 0.0);
    }
    assert!(negative > 5 && negative < 55, "{negative}");
}

/// Gaps under a distance, and the smallest, are those of all pairs, from clouds to bodies in one another.
#[test]
fn many_bodies_are_not_looked_at_in_pairs() {
    let mut random = Samples::new(24);
    let meshes = [
        sphere(0.3, 80),
        cuboid([0.5, 0.3, 0.2], 100),
        cuboid([1.0, 1.0, 0.01], 12),
    ];
    let list: Vec<Option<&TriMesh>> = (0..70).map(|i| meshes.get(i % 4)).collect();
    let wall = Wall::rigid([0.0, 0.0, -4.0], [0.0, 0.0, 1.0]);
    let gaps = Gaps::new(&list, &[wall], &[(2, 0), (5, 4)]).unwrap();
    for spread in [1.5, 4.0, 9.0, 60.0] {
        let mut poses: Vec<Pose> = list
            .iter()
            .map(|_| {
                turned(
                    (vector(&mut random) * 2.0).into(),
                    (vector(&mut random) * spread).into(),
                )
            })
            .collect();
        poses[6].translation.x = f64::NAN;
        let all = gaps.all(&poses);
        for distance in [0.05, 0.5, 3.0, f64::INFINITY] {
            let near = all.iter().filter(|g| g.distance < distance).copied();
            assert_eq!(gaps.within(&poses, distance), near.collect::<Vec<_>>());
        }
        let least = all.iter().map(|g| g.distance).fold(f64::INFINITY, f64::min);
        let found = gaps.smallest(&poses).unwrap().distance;
        assert!(
            (found - least).abs() <= 1e-11 * least.abs(),
            "{found} {least}"
        );
    }
}

#[test]
fn without_pairs_there_is_no_gap() {
    let ball = sphere(1.0, 80);
    let o = at(0.0, 0.0, 0.0);
    assert!(Gaps::new(&[], &[], &[]).unwrap().smallest(&[]).is_none());
    assert!(
        Gaps::new(&[Some(&ball)], &[], &[])
            .unwrap()
            .smallest(&[o])
            .is_none()
    );
    let ignored = Gaps::new(&[Some(&ball), Some(&ball), None], &[], &[(1, 0)]).unwrap();
    assert!(ignored.smallest(&[o, o, o]).is_none() && ignored.all(&[o, o, o]).is_empty());
}

#[test]
fn every_scale_alike() {
    let (ball, cube) = (sphere(1.0, 320), cuboid([1.0, 0.7, 0.4], 200));
    for shift in [1.4, 1.6, 5.0, 1e4] {
        let pose = |s: f64| turned([0.3, 0.8, -0.2], [shift * s, 0.2 * s, 0.1 * s]);
        let expected = gap(&ball, at(0.0, 0.0, 0.0), &cube, pose(1.0));
        for s in [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e20] {
            let (b, c) = (ball.scaled(s).unwrap(), cube.scaled(s).unwrap());
            let found = gap(&b, at(0.0, 0.0, 0.0), &c, pose(s)) / s;
            assert!(
                (found / expected - 1.0).abs() < 1e-11,
                "{s} {found} {expected}"
            );
        }
    }
}

#[test]
fn edges_are_those_near_the_closest_points() {
    let (coarse, fine) = (sphere(1.0, 320), sphere(1.0, 5120));
    let mean = |m: &TriMesh| {
        let all = m.edges();
        let length = |e: &Edge| (m.vertices()[e.vertices[0]] - m.vertices()[e.vertices[1]]).norm();
        all.iter().map(length).sum::<f64>() / all.len() as f64
    };
    for (mesh, expected) in [(&coarse, mean(&coarse)), (&fine, mean(&fine))] {
        let gaps = Gaps::new(&[Some(&fine), Some(mesh)], &[], &[]).unwrap();
        for x in [2.5, 1.8, 0.1] {
            let found = gaps
                .smallest(&[at(0.0, 0.0, 0.0), at(x, 0.0, 0.0)])
                .unwrap();
            assert!(
                (found.edge / expected - 1.0).abs() < 0.15,
                "{} {expected}",
                found.edge
            );
        }
    }
}

#[test]
fn nothing_panics() {
    let ball = sphere(1.0, 80);
    let wall = Wall {
        surface: Default::default(),
        point: [0.0; 3],
        normal: [0.0, 0.0, 1.0],
    };
    let gaps = Gaps::new(&[Some(&ball), Some(&ball)], &[wall], &[]).unwrap();
    let o = at(0.0, 0.0, 2.0);
    let mut odd = vec![
        at(f64::NAN, 0.0, 0.0),
        at(f64::INFINITY, 0.0, 0.0),
        at(1e300, -1e300, 0.0),
    ];
    for entry in [0.0, f64::NAN, 1e300, f64::INFINITY, 1e-300] {
        odd.push(Pose::new(exp_matrix(&Vec3::zeros()) * entry, Vec3::zeros()));
    }
    for pose in odd {
        for poses in [
            vec![o, pose],
            vec![pose, o],
            vec![pose, pose],
            vec![pose],
            vec![],
        ] {
            let all = gaps.all(&poses);
            assert!(all.iter().all(|g| g.distance.is_finite()));
            assert!(gaps.smallest(&poses).is_none_or(|g| g.distance.is_finite()));
        }
    }
    // Faces without area, and surfaces that don't close, are no meshes.
    let flat = vec![
        Vec3::zeros(),
        Vec3::x(),
        Vec3::x() * 2.0,
        Vec3::zeros(),
        Vec3::y(),
    ];
    let faces = vec![[0, 1, 2], [0, 3, 0], [0, 1, 4], [2, 2, 2]];
    assert!(TriMesh::new("bad", flat, faces).is_err());
}

#[test]
fn what_can_not_be_is_refused() {
    let ball = sphere(1.0, 80);
    for normal in [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
        let wall = Wall {
            surface: Default::default(),
            point: [0.0; 3],
            normal,
        };
        let error = Gaps::new(&[Some(&ball)], &[wall], &[]).unwrap_err();
        assert!(error.to_string().starts_with("walls[0]"), "{error}");
    }
    assert!(Gaps::new(&[Some(&ball)], &[], &[(0, 1)]).is_err());
    assert!(TriMesh::new("empty", vec![], vec![]).is_err());
    let lost = TriMesh::new("lost", vec![Vec3::repeat(f64::NAN); 3], vec![[0, 1, 2]]);
    assert!(lost.is_err());
    let far = ball.vertices().iter().map(|x| x * 1e61).collect();
    assert!(TriMesh::new("far", far, ball.faces().to_vec()).is_err());
}

#[test]
fn the_error_names_both_and_the_remedy() {
    let overlap = Gap {
        distance: -0.003,
        first: 0,
        second: Other::Body(1),
        edge: 0.1,
    };
    let text = overlap_error(&overlap, &["coin", "ball"]).to_string();
    for part in [
        "\"coin\"",
        "\"ball\"",
        "move them apart by at least 3.000000e-3 m",
    ] {
        assert!(text.contains(part), "{text}");
    }
    let wall = Gap {
        second: Other::Wall(2),
        ..overlap
    };
    let text = overlap_error(&wall, &["coin"]).to_string();
    assert!(
        text.contains("\"coin\" and wall 2") && text.contains("3.000000e-3 m"),
        "{text}"
    );
    let unnamed = overlap_error(&overlap, &[] as &[&str]).to_string();
    assert!(unnamed.contains("body 0 and body 1"), "{unnamed}");
}

/// Prints how long a question takes: `cargo test --release --test shapes gaps::time -- --ignored --nocapture`.
#[test]
#[ignore = "measures time"]
fn time() {
    let (ball, cube) = (sphere(1.0, 1280), cuboid([2.0; 3], 1280));
    let big = sphere(1.0, 20480);
    let cases: [(&str, &TriMesh, &TriMesh); 3] = [
        ("balls", &ball, &ball),
        ("boxes", &cube, &cube),
        ("fine balls", &big, &big),
    ];
    for (name, a, b) in cases {
        let start = std::time::Instant::now();
        let gaps = Gaps::new(&[Some(a), Some(b)], &[], &[]).unwrap();
        println!("{name}: built in {:?}", start.elapsed());
        for x in [100.0, 4.0, 2.5, 2.1, 2.01, 2.0001, 1.99, 1.5, 0.0] {
            for w in [[0.0; 3], [0.1, 0.5, -0.3]] {
                let poses = [at(0.0, 0.0, 0.0), turned(w, [x, 0.05, 0.02])];
                let runs = if x < 2.0 { 3 } else { 100 };
                let start = std::time::Instant::now();
                let mut d = 0.0;
                for _ in 0..runs {
                    d = gaps.smallest(&poses).unwrap().distance;
                }
                println!(
                    "  x = {x}, turn {w:?}: {d:+.3e} m, {:?}",
                    start.elapsed() / runs
                );
            }
        }
    }
    for (name, a, b) in cases {
        let gaps = Gaps::new(&[Some(a), Some(b)], &[], &[]).unwrap();
        for far in [0.01, 0.1, 1.0, 10.0] {
            let mut random = Samples::new(1);
            let (mut total, mut longest) = (0.0, 0.0);
            for _ in 0..100 {
                let way = vector(&mut random).normalize();
                let turn: [f64; 3] = (vector(&mut random) * 2.0).into();
                let mut poses = [at(0.0, 0.0, 0.0), turned(turn, (way * 6.0).into())];
                // Brought to this gap along the line between the centres, roughly.
                for _ in 0..8 {
                    let d = gaps.smallest(&poses).unwrap().distance;
                    poses[1].translation -= way * (d - far);
                }
                let start = std::time::Instant::now();
                gaps.smallest(&poses);
                let seconds = start.elapsed().as_secs_f64();
                total += seconds;
                longest = f64::max(longest, seconds);
            }
            println!(
                "{name} at random, {far} m apart: mean {:.0} µs, longest {:.0} µs",
                total * 1e4,
                longest * 1e6
            );
        }
    }
    let list = vec![Some(&ball); 100];
    let gaps = Gaps::new(&list, &[], &[]).unwrap();
    let poses: Vec<Pose> = (0..100)
        .map(|i| at(f64::from(i % 10) * 2.1, f64::from(i / 10) * 2.15, 0.0))
        .collect();
    let start = std::time::Instant::now();
    let found = gaps.smallest(&poses).unwrap();
    println!(
        "smallest of 100 balls: {:e} m, {:?}",
        found.distance,
        start.elapsed()
    );
}

fn mesh(shape: Shape, faces: usize) -> TriMesh {
    build(&shape, Path::new(""), Some(faces)).unwrap()
}

fn share(a: &TriMesh, b: &TriMesh, shift: [f64; 3]) -> f64 {
    let turn = exp_matrix(&Vec3::new(0.3, -0.2, 0.5));
    let first = Pose::new(turn, Vec3::new(1.0, 2.0, 3.0));
    let poses = [
        first,
        Pose::new(turn, first.translation + turn * Vec3::from(shift)),
    ];
    let either = Share::new(&[Some(a), Some(b)], (0, 1)).unwrap();
    let found = either.at(&poses);
    // Boxes tell the same.
    for limit in [-1.0, 0.0, 0.1, 0.5, 0.9] {
        let above = (found > limit).then_some(found);
        assert_eq!(either.above(&poses, limit), above, "{found}");
    }
    found
}

#[test]
fn the_lens_of_two_balls() {
    for (faces, within) in [(80, 0.06), (320, 0.03), (1280, 0.02)] {
        let ball = sphere(0.5, faces);
        for d in [0.1, 0.3, 0.5, 0.8] {
            let x: f64 = d / 0.5;
            let exact = 1.0 - 0.75 * x + x.powi(3) / 16.0;
            let found = share(&ball, &ball, [0.0, d * 0.6, d * 0.8]);
            println!("{faces} {d}: {found:.4} of {exact:.4}");
            assert!(
                (found - exact).abs() < within,
                "{faces} {d}: {found} {exact}"
            );
        }
        assert_eq!(share(&ball, &ball, [1.01, 0.0, 0.0]), 0.0);
    }
}

#[test]
fn the_smaller_one_counts_in_either_order() {
    let (plate, peg) = (
        mesh(Shape::cuboid([1.0, 1.0, 0.2]), 300),
        mesh(Shape::cylinder(0.1, 0.8), 300),
    );
    // A quarter of the peg's length is in the plate.
    for (a, b) in [(&plate, &peg), (&peg, &plate)] {
        let found = share(a, b, [0.1, 0.2, 0.05]);
        assert!((found - 0.25).abs() < 0.03, "{found}");
    }
    let small = sphere(0.05, 80);
    assert!((share(&small, &plate, [0.0; 3]) - 1.0).abs() < 1e-12);
    assert!(Share::new(&[Some(&plate), None], (0, 1)).is_none());
}

#[test]
fn splitting_keeps_the_polyhedron() {
    let mesh = mesh(Shape::ellipsoid([1.0, 0.5, 0.2]), 80);
    let fine = mesh.split();
    assert_eq!(fine.faces().len(), 4 * mesh.faces().len());
    assert!(fine.check().is_ok());
    let (a, b) = (mesh.mass_properties(), fine.mass_properties());
    assert!((a.volume - b.volume).abs() < 1e-14 && (a.area - b.area).abs() < 1e-14);
}

#[test]
fn coarser_meshes_keep_volume_and_sharp_edges() {
    for (shape, volume) in [
        (Shape::sphere(2.0), 0.04),
        (Shape::ellipsoid([1.0, 0.2, 1.0]), 0.06),
        (Shape::cuboid([1.0, 0.3, 0.6]), 1e-4),
    ] {
        let fine = mesh(shape, 1280);
        let mut last = fine.faces().len();
        for target in [640, 320, 160] {
            let mesh = fine.coarsened(target).unwrap();
            let n = mesh.faces().len();
            assert!(n < last && n <= target + 1, "{n} of {target}");
            last = n;
            let (a, b) = (fine.mass_properties(), mesh.mass_properties());
            let off = (b.volume / a.volume - 1.0).abs();
            assert!(off < volume, "{} {target}: {off}", fine.name());
        }
    }
    let cube = mesh(Shape::cuboid([1.0; 3]), 1200);
    assert!((cube.sharp_edge_length(1.0) - 12.0).abs() < 1e-12);
    assert!((cube.coarsened(200).unwrap().sharp_edge_length(1.0) - 12.0).abs() < 0.02);
}
