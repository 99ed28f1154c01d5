//! Beside meshes: dense ones, mixed pairs, edges, scales and odd poses.

use super::*;

/// The shortest shift that parts two convex meshes that overlap: along the normal of a face of either, or across an edge of each.
fn shift(meshes: [&TriMesh; 2], poses: &[Pose; 2]) -> f64 {
    let placed = [0, 1].map(|i| meshes[i].transformed(&poses[i]));
    let edges = placed.each_ref().map(|m| -> Vec<Vec3> {
        let ends = m.edges().into_iter().map(|e| e.vertices);
        let along = ends.map(|[a, b]| m.vertices()[b] - m.vertices()[a]);
        along.collect()
    });
    let normals = placed
        .iter()
        .flat_map(|m| (0..m.faces().len()).map(move |f| m.normal(f)));
    let across = edges[0]
        .iter()
        .flat_map(|e| edges[1].iter().map(move |f| e.cross(f)));
    let axes = normals.chain(across).filter_map(|n| n.try_normalize(1e-9));
    let reach = |m: &TriMesh, n: &Vec3| {
        let heights = m.vertices().iter().map(|x| x.dot(n));
        heights.fold(f64::NEG_INFINITY, f64::max)
    };
    let along = |n: Vec3| reach(&placed[0], &-n) + reach(&placed[1], &n);
    axes.flat_map(|n| [n, -n])
        .map(along)
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn boxes_and_prisms_are_those_of_their_meshes() {
    let mut random = Samples::new(11);
    // Flat faces: a mesh is the shape.
    let shapes = [
        Shape::cuboid([1.0, 0.7, 0.4]),
        Shape::cuboid([0.5, 0.6, 0.02]),
        Shape::prism(
            vec![[-0.4, -0.2], [-0.3, 0.2], [0.5, 0.2], [0.6, -0.2]],
            0.8,
        ),
        Shape::prism(vec![[0.0, 0.0], [0.5, 0.1], [0.1, 0.6]], 1.2),
    ];
    let meshes = shapes.each_ref().map(|s| mesh(s, 12));
    let (mut apart, mut worst, mut inside, mut shallower) = (0, 0.0_f64, 0, 0.0_f64);
    let mut off = 0.0_f64;
    for k in 0..600 {
        let (i, j) = (k % 4, (k / 4) % 4);
        let poses = [pose(&mut random, 0.8), pose(&mut random, 0.8)];
        let found = gap(&shapes[i], poses[0], &shapes[j], poses[1]);
        let meshed = Gaps::new(&[Some(&meshes[i]), Some(&meshes[j])], &[], &[]).unwrap();
        let meshed = meshed.smallest(&poses).unwrap().distance;
        if meshed > 0.0 {
            apart += 1;
            worst = worst.max((found - meshed).abs() / meshed.max(1e-3));
        } else {
            inside += 1;
            // No shift shorter than what a mesh says parts the two, and the shortest that does is what is found.
            assert!(found < 0.0);
            shallower = shallower.max(meshed.abs() + found);
            off = off.max((found + shift([&meshes[i], &meshes[j]], &poses)).abs());
        }
    }
    println!(
        "{apart} apart, off by {worst:.1e}; {inside} overlap, off by {off:.1e} m, shallower than meshes by {shallower:.1e} m at most"
    );
    assert!(
        apart > 150 && inside > 100 && worst < 1e-9,
        "{apart} {inside} {worst:e}"
    );
    assert!(shallower < 1e-12 && off < 1e-10, "{shallower:e} {off:e}");
}

/// How far a mesh may lie inside its shape: that of its chords.
fn sagitta(shape: &Shape, mesh: &TriMesh) -> f64 {
    let within = |d: &Vec3| {
        let highest = mesh
            .vertices()
            .iter()
            .map(|x| x.dot(d))
            .fold(f64::NEG_INFINITY, f64::max);
        let exact = match *shape {
            Shape::Sphere { radius, .. } => radius,
            Shape::Ellipsoid { semi_axes, .. } => Vec3::from(semi_axes).component_mul(d).norm(),
            Shape::Cylinder { radius, length, .. } => {
                radius * d.xy().norm() + 0.5 * length * d.z.abs()
            }
            Shape::Capsule { radius, length, .. } => radius + 0.5 * length * d.z.abs(),
            _ => highest,
        };
        exact - highest
    };
    directions(500).iter().map(within).fold(0.0, f64::max)
}

#[test]
fn every_pair_is_as_far_as_dense_meshes_to_their_sagitta() {
    let shapes = [
        Shape::sphere(0.3),
        Shape::ellipsoid([0.5, 0.1, 0.3]),
        Shape::cuboid([0.6, 0.4, 0.2]),
        Shape::cylinder(0.3, 0.5),
        Shape::capsule(0.15, 0.5),
        Shape::prism(
            vec![[-0.2, -0.1], [-0.15, 0.1], [0.25, 0.1], [0.3, -0.1]],
            0.6,
        ),
    ];
    let meshes = shapes.each_ref().map(|s| mesh(s, 5000));
    let off: Vec<f64> = shapes
        .iter()
        .zip(&meshes)
        .map(|(s, m)| sagitta(s, m))
        .collect();
    let mut random = Samples::new(17);
    let (mut apart, mut overlaps, mut most) = (0, 0, 0.0_f64);
    for (i, a) in shapes.iter().enumerate() {
        for (j, b) in shapes.iter().enumerate() {
            let dense = Gaps::new(&[Some(&meshes[i]), Some(&meshes[j])], &[], &[]).unwrap();
            for _ in 0..20 {
                let poses = [pose(&mut random, 0.7), pose(&mut random, 0.7)];
                let found = gap(a, poses[0], b, poses[1]);
                let meshed = dense.smallest(&poses).unwrap().distance;
                // Meshes lie inside: farther apart by what they lack along the normal, of which the
                // sampled directions show most.
                let bound = 1.5 * (off[i] + off[j]) + 1e-12;
                if found > 0.0 {
                    apart += 1;
                    most = most.max((meshed - found) / bound);
                    assert!(
                        (-1e-12..=bound).contains(&(meshed - found)),
                        "{a:?} {b:?}: {found:e} {meshed:e} {bound:e}"
                    );
                } else {
                    overlaps += 1;
                    // At least as deep as the deepest point found of the meshes.
                    assert!(
                        found <= meshed.min(0.0) + 1e-9,
                        "{a:?} {b:?}: {found:e} {meshed:e}"
                    );
                }
            }
        }
    }
    println!("{apart} apart, at most {most:.2} of the bound; {overlaps} overlap");
    assert!(apart > 200 && overlaps > 100);
}

#[test]
fn every_scale_and_place_alike() {
    let pairs = [
        (Shape::cylinder(0.5, 0.4), Shape::cuboid([1.0, 0.7, 0.4])),
        (Shape::ellipsoid([0.5, 0.1, 0.3]), Shape::cylinder(0.5, 0.4)),
        (Shape::capsule(0.2, 0.5), Shape::ellipsoid([0.5, 0.1, 0.3])),
    ];
    let scaled = |shape: &Shape, by: f64| match shape.clone() {
        Shape::Cylinder { radius, length, .. } => Shape::cylinder(by * radius, by * length),
        Shape::Capsule { radius, length, .. } => Shape::capsule(by * radius, by * length),
        Shape::Ellipsoid { semi_axes, .. } => Shape::ellipsoid(semi_axes.map(|a| by * a)),
        Shape::Box { size, .. } => Shape::cuboid(size.map(|a| by * a)),
        other => other,
    };
    for (a, b) in &pairs {
        for shift in [1.1, 1.6, 5.0, 1e4] {
            let there = |s: f64| turned([0.3, 0.8, -0.2], [shift * s, 0.2 * s, 0.1 * s]);
            let exact = gap(a, Pose::identity(), b, there(1.0));
            assert!(exact > 0.0);
            for s in [1e-9, 1e-3, 1e3, 1e6, 1e20] {
                let found = gap(&scaled(a, s), Pose::identity(), &scaled(b, s), there(s)) / s;
                assert!(
                    (found / exact - 1.0).abs() < 1e-10,
                    "{s:e}: {found:e} {exact:e}"
                );
            }
        }
    }
}

#[test]
fn edges_are_those_of_the_meshes_near_the_closest_points() {
    let shape = Shape::sphere(1.0);
    let solids = || vec![solid(&shape, Pose::identity()).unwrap(); 2];
    let (coarse, fine) = (mesh(&shape, 320), mesh(&shape, 5120));
    let of = |m: &TriMesh| (4.0 / 3f64.sqrt() * m.surface_area() / m.faces().len() as f64).sqrt();
    for (second, longer) in [(&fine, of(&fine)), (&coarse, of(&coarse))] {
        let gaps = Gaps::new(&[Some(&fine), Some(second)], &[], &[]).unwrap();
        let gaps = gaps.by_formula(solids()).unwrap();
        for x in [2.5, 2.001, 0.1] {
            let found = gaps
                .smallest(&[at(0.0, 0.0, 0.0), at(x, 0.0, 0.0)])
                .unwrap();
            assert!(
                (found.edge / longer - 1.0).abs() < 0.2,
                "{x}: {} {longer}",
                found.edge
            );
        }
    }
}

#[test]
fn a_mesh_keeps_both_meshes() {
    let (ball, cube) = (Shape::sphere(0.5), Shape::cuboid([1.0; 3]));
    let meshes = [mesh(&ball, 80), mesh(&cube, 12)];
    let meshes = [Some(&meshes[0]), Some(&meshes[1])];
    let poses = [turned([0.1, 0.2, 0.3], [1.2, 0.0, 0.0]), at(0.0, 0.0, 0.0)];
    let plain = Gaps::new(&meshes, &[], &[]).unwrap();
    let mixed = Gaps::new(&meshes, &[], &[]).unwrap();
    let formula = solid(&ball, Pose::identity()).unwrap();
    let mixed = mixed.by_formula(vec![formula.clone(), None]).unwrap();
    assert_eq!(plain.all(&poses), mixed.all(&poses));
    let error = Gaps::new(&meshes, &[], &[])
        .unwrap()
        .by_formula(vec![formula]);
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("gaps: shapes by formula")
    );
    // A point's distance is that of the mesh, which lies inside.
    let x = Vec3::new(1.9, 0.3, 0.2);
    let exact = (x - poses[0].translation).norm() - 0.5;
    let found = mixed.distances(&x, &poses).next().unwrap().distance;
    assert!(found >= exact && found < exact + 0.05, "{found} {exact}");
}

#[test]
fn poses_that_can_not_be_are_passed_over() {
    let shapes = [
        Shape::cylinder(0.3, 0.5),
        Shape::ellipsoid([0.5, 0.1, 0.3]),
        Shape::cuboid([1.0; 3]),
    ];
    let wall = Wall::rigid([0.0; 3], [0.0, 0.0, 1.0]);
    let gaps = by_formula(&[&shapes[0], &shapes[1], &shapes[2]], &[wall]);
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
            vec![at(0.0, 0.0, 2.0), pose, pose],
            vec![pose, at(0.0, 0.0, 2.0)],
            vec![pose],
            vec![],
        ] {
            assert!(gaps.all(&poses).iter().all(|g| g.distance.is_finite()));
            assert!(gaps.smallest(&poses).is_none_or(|g| g.distance.is_finite()));
        }
    }
}
