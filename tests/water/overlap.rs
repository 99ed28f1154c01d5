//! Links that touch or overlap at their joint: refused unless declared, and what is declared.

use crate::support::says;
use hydrograd::adjoint::kernel::{Sources, Write};
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::boundary::{self, BodyBoundary};
use hydrograd::coupling::full::{Full, FullSolver, SolveSettings};
use hydrograd::coupling::{Coupling, Exclusions};
use hydrograd::geometry::Image;
use hydrograd::scene::{Body, Controller, Fluid, Joint, Plane, Scene, Shape, Wall};
use hydrograd::simulate::Method;
use hydrograd::simulate::gradcheck::{self, gradcheck};
use hydrograd::{Controls, Fidelity, Settings, Simulator, shape};
use nalgebra::DMatrix;
use std::path::Path;
use std::sync::Arc;

/// Two capsules that share a round end at their hinge, and a coin beside them.
fn linked(declared: bool) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.name = "linked".into();
    let capsule = || Body::new(Shape::capsule(0.05, 0.2).faces(100)).density(1200.0);
    let upper = capsule()
        .named("upper")
        .joint(Joint::Planar { plane: Plane::Yz });
    scene.add(upper);
    let hinge = Joint::Revolute {
        axis: [1.0, 0.0, 0.0],
    };
    let mut lower = capsule()
        .named("lower")
        .child_of("upper")
        .at([0.0, 0.0, -0.1])
        .shape_at([0.0, 0.0, -0.1], [0.0; 3])
        .joint(hinge)
        .actuated();
    lower.overlaps_parent = declared;
    scene.add(lower);
    let coin = Body::new(Shape::ellipsoid([0.06, 0.02, 0.06]).faces(80)).density(1200.0);
    scene.add(coin.named("coin").at([0.0, 0.15, -0.2]));
    scene.controller = Some(Controller::Constant { control: vec![0.3] });
    scene.initial.v = vec![0.1, 0.0, 0.5, -0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    scene
}

fn full() -> Settings {
    Settings::default().fidelity(Fidelity::Full)
}

fn refused(scene: &Scene) -> String {
    let error = Simulator::new(scene, full()).err().unwrap();
    error.to_string()
}

/// Wherever a configuration is given, it is checked as that of a scene.
#[test]
fn every_way_to_a_start_is_checked() {
    let mut scene = Scene::new(Fluid::fresh_water());
    for (name, x) in [("left", 0.0), ("right", 3.0)] {
        let body = Body::new(Shape::sphere(1.0).faces(320)).named(name);
        scene.add(body.density(1000.0).at([x, 0.0, 0.0]));
    }
    for fidelity in [Fidelity::Reduced, Fidelity::Full] {
        let settings = Settings::default().fidelity(fidelity);
        let mut simulator = Simulator::new(&scene, settings).unwrap();
        let (mut q, v) = (simulator.start().0.clone(), simulator.start().1.clone());
        q[7] -= 2.0;
        says(
            simulator.set_start(q.clone(), v.clone()).unwrap_err(),
            &["left", "right", "overlap"],
        );
        assert!(simulator.state(0, &q, &v).is_err());
        // Without water they may be in one another, until there is some.
        let mut dry = simulator.parameters().clone();
        *dry.density_mut() = 0.0;
        let wet = simulator.parameters().clone();
        simulator.set_parameters(dry).unwrap();
        simulator.set_start(q, v).unwrap();
        says(
            simulator.set_parameters(wet).unwrap_err(),
            &["left", "right", "overlap"],
        );
    }
}

#[test]
fn overlap_that_is_not_declared_is_refused_with_the_way_to_declare_it() {
    let message = refused(&linked(false));
    let declare = "`overlaps_parent = true` for body \"lower\"";
    says(
        &message,
        &["\"upper\" and body \"lower\"", "overlap", declare],
    );
    // Bodies of which neither carries the other have no such way.
    let mut scene = linked(true);
    scene.bodies[2].placement.position = [0.0, 0.05, 0.0];
    let message = refused(&scene);
    says(&message, &["coin", "overlap", "move them apart"]);
    assert!(!message.contains("overlaps_parent"), "{message}");
}

#[test]
fn declared_links_run_and_feel_all_but_each_other() {
    let scene = linked(true);
    let simulator = Simulator::new(&scene, full().tolerance(1e-12)).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 20)).unwrap();
    assert_eq!(rollout.warnings(), Vec::<String>::new());
    // The gap that counts is that to the coin.
    let gap = rollout.summary().min_gap.unwrap();
    assert!(gap > 0.03 && gap < 0.15, "{gap}");
    // The coin is moved through the water, without a push of its own.
    let moved = rollout.samples()[20].q.rows(4, 3) - rollout.samples()[0].q.rows(4, 3);
    assert!(moved.norm() > 1e-4, "{moved}");
    // The hinge's own torque moves no momentum in or out.
    let drift = rollout.summary().momentum_drift.unwrap();
    assert!(drift < 1e-9, "{drift}");

    // Alone the two have their own added masses and nothing between.
    let mut pair = scene.clone();
    pair.bodies.truncate(2);
    pair.initial.v.truncate(4);
    let of = |fidelity| {
        let settings = full()
            .method(Method::MfsVertex)
            .tolerance(1e-12)
            .fidelity(fidelity);
        let added = Simulator::new(&pair, settings).unwrap().added_mass();
        added.unwrap().matrix
    };
    let (coupled, own) = (of(Fidelity::Full), of(Fidelity::Isolated));
    assert!((&coupled - &own).amax() < 1e-9 * own.amax());
    assert_eq!(coupled.view((0, 6), (6, 6)).amax(), 0.0);
    // With the coin something comes back from it.
    let m = simulator.added_mass().unwrap().matrix;
    assert!((&m - m.transpose()).amax() < 1e-12 * m.amax());
    assert!(m.view((0, 6), (6, 6)).amax() > 1e-5 * m.amax());
    assert!(m.symmetric_eigenvalues().min() > 0.0);
}

#[test]
fn the_gradient_is_exact_with_declared_links() {
    for wall in [false, true] {
        let mut scene = linked(true);
        if wall {
            scene.add_wall([0.0, 0.0, -0.5], [0.0, 0.0, 1.0]);
        }
        let settings = full().tolerance(1e-13).faces(80);
        let mut simulator = Simulator::new(&scene, settings).unwrap();
        let report = gradcheck(
            &mut simulator,
            &gradcheck::GradcheckSettings {
                steps: 4,
                directions: 1,
                seed: 7,
                timings: 0,
                enough: Some(1e-6),
            },
        )
        .unwrap();
        println!("wall {wall}: {:.1e}", report.max_rel_error);
        assert!(report.max_rel_error <= 1e-6, "{:#?}", report.directions);
    }
}

#[test]
fn touching_links_warn_with_the_way_to_declare_them() {
    let mut scene = Scene::new(Fluid::fresh_water());
    let cube = || Body::new(Shape::cuboid([0.2; 3]).faces(80)).density(1200.0);
    scene.add(cube().named("base"));
    let slide = Joint::Prismatic {
        axis: [0.0, 1.0, 0.0],
    };
    scene.add(
        cube()
            .named("slide")
            .child_of("base")
            .at([0.2, 0.0, 0.0])
            .joint(slide),
    );
    scene.initial.v = vec![0.0; 6];
    scene.initial.v.push(0.1);
    let warnings = |scene: &Scene, settings: Settings| {
        let simulator = Simulator::new(scene, settings).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 2)).unwrap();
        rollout.warnings()
    };
    let hint = "`overlaps_parent = true` for body \"slide\"";
    let narrow = warnings(&scene, full().method(Method::MfsVertex));
    assert_eq!(narrow.len(), 1, "{narrow:?}");
    says(&narrow[0], &["narrower than half", hint]);
    // Coupled panels have no solution there.
    let touching = Simulator::new(&scene, full()).err().unwrap().to_string();
    says(&touching, &["they touch", hint]);
    scene.bodies[1].overlaps_parent = true;
    assert_eq!(warnings(&scene, full()), Vec::<String>::new());
}

#[test]
fn declared_links_may_not_lie_within_each_other() {
    let mut scene = linked(true);
    // The lower capsule's middle comes to lie 0.06 below the upper one's: three quarters are inside.
    scene.bodies[1].placement.position = [0.0, 0.0, 0.04];
    let message = refused(&scene);
    says(
        &message,
        &["\"upper\"", "\"lower\"", "part of its volume", "up to half"],
    );
    // Also when they get there in a run.
    let mut scene = linked(true);
    scene.bodies[1].joint = Joint::Prismatic {
        axis: [0.0, 0.0, 1.0],
    };
    scene.initial.v[3] = 2.0;
    let simulator = Simulator::new(&scene, full()).unwrap();
    let error = simulator
        .rollout(&Controls::zeros(&simulator, 20))
        .err()
        .unwrap();
    says(
        error.to_string(),
        &["t = 0.", "part of its volume", "limit 5.000000e-1"],
    );
}

/// The body with a shape that carries it, past those without; also one that it's fixed to.
#[test]
fn the_overlapping_parent_is_the_nearest_with_a_shape() {
    let mut scene = linked(true);
    let mut dry = Body::dry().named("gimbal").mass(0.0).inertia([0.0; 3]);
    dry.parent = Some("upper".into());
    dry.joint = Joint::Revolute {
        axis: [0.0, 1.0, 0.0],
    };
    dry.placement = scene.bodies[1].placement;
    scene.bodies[1].placement = Default::default();
    scene.bodies[1].parent = Some("gimbal".into());
    scene.bodies.insert(1, dry);
    scene.initial.v.insert(3, 0.0);
    let run = |scene: &Scene| {
        let simulator = Simulator::new(scene, full()).unwrap();
        let steps = simulator.rollout(&Controls::zeros(&simulator, 3)).unwrap();
        steps.warnings()
    };
    assert_eq!(run(&scene), Vec::<String>::new());
    scene.bodies[2].overlaps_parent = false;
    says(
        refused(&scene),
        &["`overlaps_parent = true` for body \"lower\""],
    );

    let mut hull = linked(true);
    hull.bodies[1].joint = Joint::Fixed;
    hull.bodies[1].actuated = false;
    hull.controller = None;
    hull.initial.v.remove(3);
    assert_eq!(run(&hull), Vec::<String>::new());
    hull.bodies[1].overlaps_parent = false;
    says(
        refused(&hull),
        &["overlap", "`overlaps_parent = true` for body \"lower\""],
    );
}

#[test]
fn isolated_bodies_may_overlap_and_are_told_of_it_unless_declared() {
    for declared in [false, true] {
        let settings = Settings::default().fidelity(Fidelity::Isolated);
        let simulator = Simulator::new(&linked(declared), settings).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 3)).unwrap();
        assert_eq!(rollout.warnings().is_empty(), declared);
    }
}

/// M̄ of all bodies in their frames, density 1.
fn matrix(coupling: &dyn Coupling, poses: &[Pose]) -> DMatrix<f64> {
    let n = 6 * poses.len();
    let record = coupling.evaluate(poses, &DMatrix::identity(n, n));
    record.unwrap().momenta().clone()
}

/// The coupled equations written out, in dense matrices: own blocks, and between bodies that feel each
/// other (for all images but the body itself) the kernels; between excluded ones those of images alone.
fn written_out(
    bodies: &[Arc<BodyBoundary>],
    walls: &[Wall],
    excluded: &[(usize, usize)],
    poses: &[Pose],
) -> DMatrix<f64> {
    let images = Image::of_walls(walls).unwrap();
    let starts = |size: &dyn Fn(&BodyBoundary) -> usize| {
        let mut at = vec![0];
        for b in bodies {
            at.push(at[at.len() - 1] + size(b));
        }
        at
    };
    let (rows, columns) = (starts(&|b| b.faces.len()), starts(&|b| b.sources.len()));
    let n = bodies.len();
    let mut k = DMatrix::zeros(rows[n], columns[n]);
    let mut f = DMatrix::zeros(rows[n], 6 * n);
    let mut g = DMatrix::zeros(columns[n], 6 * n);
    let mut damping = DMatrix::zeros(columns[n], columns[n]);
    let units: [Vec6; 6] = std::array::from_fn(|i| Vec6::ith(i, 1.0));
    for (b, body) in bodies.iter().enumerate() {
        let own = body;
        for (i, row) in own.flux_rows.chunks_exact(body.sources.len()).enumerate() {
            for (j, x) in row.iter().enumerate() {
                k[(rows[b] + i, columns[b] + j)] = *x;
            }
        }
        for (i, row) in own.twist_rows.iter().enumerate() {
            (0..6).for_each(|c| f[(rows[b] + i, 6 * b + c)] = row[c]);
        }
        for (j, row) in own.readout.iter().enumerate() {
            (0..6).for_each(|c| g[(columns[b] + j, 6 * b + c)] = row[c]);
            damping[(columns[b] + j, columns[b] + j)] = own.damping[j].powi(2);
        }
        for (c, other) in bodies.iter().enumerate() {
            for image in &images {
                let apart = c == b || excluded.contains(&(b, c)) || excluded.contains(&(c, b));
                if image.is_identity() && apart {
                    continue;
                }
                let (turn, shift) = image.placement(&poses[c]);
                let seen: Vec<Vec3> = other
                    .sources
                    .iter()
                    .map(|s| {
                        poses[b]
                            .rotation
                            .tr_mul(&(turn * s + shift - poses[b].translation))
                    })
                    .collect();
                let seen = Sources::new(&seen);
                let width = other.sources.len();
                let mut block = vec![0.0; body.faces.len() * width];
                body.fill(&seen, Write::Set, &mut block, width, 0);
                let readout = body.potential(&seen, &body.readout_rows(&units), 6);
                for j in 0..width {
                    for i in 0..body.faces.len() {
                        k[(rows[b] + i, columns[c] + j)] += block[i * width + j];
                    }
                    for i in 0..6 {
                        g[(columns[c] + j, 6 * b + i)] += readout[6 * j + i];
                    }
                }
            }
        }
    }
    let normal = k.tr_mul(&k) + damping;
    let a = normal.cholesky().unwrap().solve(&k.tr_mul(&f));
    let raw = g.tr_mul(&a);
    0.5 * (&raw + raw.transpose())
}

#[test]
fn excluded_pairs_do_not_feel_each_other_and_feel_all_else() {
    let bodies: Vec<Arc<BodyBoundary>> = [
        Shape::sphere(0.5),
        Shape::ellipsoid([0.6, 0.3, 0.4]),
        Shape::cuboid([0.3, 0.5, 0.4]),
    ]
    .into_iter()
    .map(|shape| {
        let mesh = shape::build(&shape, Path::new("."), Some(80)).unwrap();
        let b = BodyBoundary::new("b", &mesh, &boundary::MfsSettings::default());
        Arc::new(b.unwrap())
    })
    .collect();
    // The first two overlap by some 0.2.
    let poses = [
        Pose::new(
            exp_matrix(&Vec3::new(0.2, -0.4, 0.3)),
            Vec3::new(0.1, -0.2, 1.0),
        ),
        Pose::new(
            exp_matrix(&Vec3::new(-0.7, 0.5, 0.9)),
            Vec3::new(0.6, 0.2, 1.1),
        ),
        Pose::new(
            exp_matrix(&Vec3::new(0.1, 0.2, 0.9)),
            Vec3::new(0.2, 0.9, 1.0),
        ),
    ];
    let wall = Wall::rigid([0.0, 0.0, 0.2], [0.1, 0.0, 1.0]);
    // In either order, once or twice.
    let exclusions = Exclusions::new([(1, 0), (0, 1)]);
    let coupling = |n: usize, walls: &[Wall], solver| {
        let settings = SolveSettings {
            solver,
            tolerance: 1e-12,
            ..SolveSettings::default()
        };
        Full::new(bodies[..n].to_vec(), walls, exclusions.clone(), settings).unwrap()
    };

    // Two alone: each has its own added mass, and nothing between them.
    let m = matrix(&coupling(2, &[], FullSolver::Cgls), &poses[..2]);
    for (b, body) in bodies[..2].iter().enumerate() {
        let own = body.added_mass;
        let error = (m.fixed_view::<6, 6>(6 * b, 6 * b) - own).amax();
        assert!(error < 1e-10 * own.amax(), "{error}");
        assert_eq!(m.fixed_view::<6, 6>(6 * b, 6 - 6 * b).amax(), 0.0);
    }

    // With a third, and with a wall, which throw their flow back at each other.
    for (n, walls) in [(3, vec![]), (2, vec![wall]), (3, vec![wall])] {
        let exact = written_out(&bodies[..n], &walls, &[(0, 1)], &poses[..n]);
        for solver in [FullSolver::Cgls, FullSolver::Qr] {
            let coupled = coupling(n, &walls, solver);
            // Matrices that served another evaluation are used again.
            let mut other = poses[..n].to_vec();
            other[0].translation.y -= 0.1;
            matrix(&coupled, &other);
            let m = matrix(&coupled, &poses[..n]);
            let error = (&m - &exact).amax() / exact.amax();
            let between = m.fixed_view::<6, 6>(0, 6).amax() / m.amax();
            println!(
                "{n} bodies, {} walls, {solver:?}: {error:.1e}, between {between:.1e}",
                walls.len()
            );
            assert!(error < 1e-9, "{error}");
            assert!(between > 1e-4, "{between}");
            // A sphere's spin moves hardly any water.
            let eigenvalues = m.symmetric_eigenvalues();
            let least = eigenvalues.min() / eigenvalues.max();
            println!("  least eigenvalue {least:.1e}");
            assert!(least > -1e-6, "{least}");
        }
    }

    for pair in [(0, 3), (1, 1)] {
        let settings = SolveSettings::default();
        let error = Full::new(bodies.clone(), &[], Exclusions::new([pair]), settings).err();
        let message = error.unwrap().to_string();
        assert!(
            message.contains("excluded pair") && message.contains("of 3"),
            "{message}"
        );
    }
}
