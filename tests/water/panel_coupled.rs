//! Bodies and walls in one panel system, against exact values and against itself.

use crate::support::reference::{TwoSpheres, equal_spheres, spheres_by_wall, unequal_spheres};
use crate::support::{mesh, says};
use hydrograd::adjoint::lie::{Mat3, Mat6, Pose, Vec3, exp_matrix};
use hydrograd::boundary::PanelBoundary;
use hydrograd::boundary::panel::MOST_FACES;
use hydrograd::coupling::full::{FullSolver, SolveSettings};
use hydrograd::coupling::{Coupling, Direction, Exclusions, Linearise, PanelCoupled};
use hydrograd::scene::{Body, Fluid, Scene, Shape, Wall, WallSurface};
use hydrograd::simulate::gradcheck;
use hydrograd::simulate::{Fidelity, Method, Settings, Simulator};
use hydrograd::{Error, Result, TriMesh};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;
use std::sync::Arc;

type Mesh = (Vec<Vec3>, Vec<[usize; 3]>);

fn ellipsoid(semi_axes: [f64; 3], faces: usize) -> Mesh {
    let m = mesh(&Shape::ellipsoid(semi_axes), faces);
    (m.vertices().to_vec(), m.faces().to_vec())
}

fn named(name: &str, mesh: &Mesh) -> Arc<PanelBoundary> {
    let mesh = TriMesh::new(name, mesh.0.clone(), mesh.1.clone()).unwrap();
    Arc::new(PanelBoundary::new(name, &mesh).unwrap())
}

/// Plane z = height, fluid above.
fn wall(height: f64, surface: WallSurface) -> Wall {
    Wall {
        surface,
        point: [0.3, -0.2, height],
        normal: [0.0, 0.0, 2.0],
    }
}

fn at(z: f64) -> Pose {
    Pose::new(Mat3::identity(), Vec3::new(0.0, 0.0, z))
}

fn momenta(
    bodies: &[Arc<PanelBoundary>],
    walls: &[Wall],
    solver: FullSolver,
    poses: &[Pose],
) -> Result<DMatrix<f64>> {
    let settings = SolveSettings {
        solver,
        tolerance: 1e-10,
        ..SolveSettings::default()
    };
    let c = PanelCoupled::new(bodies.to_vec(), walls, Exclusions::none(), settings)?;
    let n = 6 * bodies.len();
    let record = c.evaluate(poses, &DMatrix::identity(n, n))?;
    assert_eq!(record.report().iterations == 0, solver == FullSolver::Qr);
    assert!(record.report().asymmetry < 5e-3, "{:?}", record.report());
    let m = record.momenta().clone();
    assert!((&m - m.transpose()).abs().max() < 1e-7 * m.max());
    Ok(m)
}

#[test]
fn two_spheres() {
    let ball = named("ball", &ellipsoid([1.0; 3], 1280));
    let pair = [ball.clone(), ball.clone()];
    let worst = |m: &DMatrix<f64>, exact: &[f64; 4]| {
        let found = TwoSpheres::coefficients_of(m);
        let own = exact[0].max(exact[2]);
        let errors = found.iter().zip(exact).map(|(f, e)| (f - e).abs() / own);
        errors.fold(0.0, f64::max)
    };
    let table = equal_spheres();
    for (i, limit) in [(0, 0.009), (1, 0.007), (3, 0.0055)] {
        let (d, exact) = (table[i].distance, table[i].coefficients());
        let poses = [at(0.0), at(d)];
        let iterative = momenta(&pair, &[], FullSolver::Gmres, &poses).unwrap();
        let error = worst(&iterative, &exact);
        assert!(error < limit, "{d}: {error}");
        if i == 1 {
            let direct = momenta(&pair, &[], FullSolver::Qr, &poses).unwrap();
            let apart = (&iterative - &direct).abs().max() / direct.max();
            assert!(apart < 1e-8, "{apart:e}");
        }
    }
    // Radii 1 and ½, and both meshes extrapolated: an order better.
    let small = |n| named("small", &ellipsoid([0.5; 3], n));
    let at_faces = |ball, n| {
        momenta(
            &[ball, small(n)],
            &[],
            FullSolver::Gmres,
            &[at(0.0), at(1.6)],
        )
        .unwrap()
    };
    let fine = at_faces(ball, 1280);
    let coarse = at_faces(named("ball", &ellipsoid([1.0; 3], 320)), 320);
    let better = &fine + (&fine - coarse) / (1.985 * 1.985 - 1.0);
    // Along the line of centres and across: large, mutual, small.
    let known = &unequal_spheres()[0];
    assert_eq!((known.radius, known.distance), (0.5, 1.6));
    for (i, exact) in [(2, known.along), (0, known.across)] {
        let exact = [exact[0][0], exact[0][1], exact[1][1]];
        let scale = [exact[0], f64::sqrt(exact[0] * exact[2]), exact[2]];
        for (k, (row, column)) in [(i, i), (i, i + 6), (i + 6, i + 6)].into_iter().enumerate() {
            let error = |m: &DMatrix<f64>| (m[(row, column)] - exact[k]).abs() / scale[k];
            assert!(error(&fine) < 0.009, "{i} {k}: {}", error(&fine));
            assert!(error(&better) < 5e-4, "{i} {k}: {}", error(&better));
        }
    }
}

/// With the added mass of the single bodies known, the error of the coupling alone is left.
#[test]
fn known_added_mass_of_single_bodies() {
    let ball = named("ball", &ellipsoid([1.0; 3], 1280));
    let mut known = Mat6::zeros();
    (0..3).for_each(|i| known[(i, i)] = 2.0 / 3.0 * PI);
    let basis = DMatrix::identity(12, 12);
    let table = equal_spheres();
    for (i, limit) in [(0, 0.85), (1, 0.75), (3, 0.6)] {
        let pair = vec![ball.clone(); 2];
        let plain = PanelCoupled::new(pair, &[], Exclusions::none(), SolveSettings::default());
        let plain = plain.unwrap();
        let poses = [at(0.0), at(table[i].distance)];
        let exact = table[i].coefficients();
        let error = |c: &PanelCoupled| {
            let found = c.evaluate(&poses, &basis).unwrap();
            let found = TwoSpheres::coefficients_of(found.momenta());
            let errors = found.iter().zip(&exact).map(|(f, e)| (f - e).abs());
            errors.fold(0.0, f64::max) / exact[0].max(exact[2])
        };
        let before = error(&plain);
        let after = error(&plain.with_added_mass(&[Some(known); 2]));
        println!("distance {}: {before:.2e}, {after:.2e}", table[i].distance);
        assert!(after < limit * before, "{before:e} {after:e}");
    }
}

#[test]
fn a_sphere_by_a_wall() {
    let ball = [named("ball", &ellipsoid([1.0; 3], 1280))];
    let table = spheres_by_wall();
    for (i, limit) in [(0, 0.011), (1, 0.009), (3, 0.0065), (4, 0.006)] {
        let (h, across, along) = (table[i].height, table[i].across, table[i].along);
        let rigid = [wall(-0.7, WallSurface::Rigid)];
        let m = momenta(&ball, &rigid, FullSolver::Gmres, &[at(h - 0.7)]).unwrap();
        for (found, exact) in [(m[(2, 2)], across), (m[(0, 0)], along)] {
            assert!((found / exact - 1.0).abs() < limit, "{h}: {found} {exact}");
        }
        let direct = momenta(&ball, &rigid, FullSolver::Qr, &[at(h - 0.7)]).unwrap();
        assert!((m - direct).abs().max() < 1e-8);
    }
    // A free surface: the image moves along, two spheres 2.2 apart in step.
    let free = [wall(-0.7, WallSurface::Free)];
    let m = momenta(&ball, &free, FullSolver::Gmres, &[at(0.4)]).unwrap();
    let step = &equal_spheres()[1];
    let across = step.along[0][0] + step.along[0][1];
    let along = step.across[0][0] - step.across[0][1];
    assert!((m[(2, 2)] / across - 1.0).abs() < 0.006, "{}", m[(2, 2)]);
    assert!((m[(0, 0)] / along - 1.0).abs() < 0.006, "{}", m[(0, 0)]);
}

/// Walls against the same images as bodies of their own, mirrored meshes.
#[test]
fn walls_are_mirrored_bodies() {
    let (ball, coin) = (ellipsoid([0.4; 3], 80), ellipsoid([0.5, 0.2, 0.3], 80));
    let poses = [
        Pose::new(
            exp_matrix(&Vec3::new(0.4, 0.1, -0.3)),
            Vec3::new(0.7, 0.2, 0.6),
        ),
        Pose::new(
            exp_matrix(&Vec3::new(-0.2, 0.7, 0.5)),
            Vec3::new(1.6, -0.1, 0.9),
        ),
    ];
    let bodies = [named("ball", &ball), named("coin", &coin)];
    let side = Wall {
        surface: WallSurface::Rigid,
        point: [0.05, 0.0, 0.0],
        normal: [1.0, 0.0, 0.0],
    };
    let walls = [wall(-0.05, WallSurface::Rigid), side];
    let with_walls = momenta(&bodies, &walls, FullSolver::Gmres, &poses).unwrap();
    // In the world's frame: mirrored meshes are turned inside out.
    let mirror = |mesh: &Mesh, pose: &Pose, flip: [bool; 2]| -> Mesh {
        let place = |x: &Vec3| {
            let mut y = pose.apply(x);
            if flip[0] {
                y.z = -0.1 - y.z;
            }
            if flip[1] {
                y.x = 0.1 - y.x;
            }
            y
        };
        let turn = |t: &[usize; 3]| {
            if flip[0] != flip[1] {
                [t[0], t[2], t[1]]
            } else {
                *t
            }
        };
        (
            mesh.0.iter().map(place).collect(),
            mesh.1.iter().map(turn).collect(),
        )
    };
    let flips = [[false, false], [true, false], [false, true], [true, true]];
    let all: Vec<_> = [(&ball, &poses[0]), (&coin, &poses[1])]
        .iter()
        .flat_map(|(mesh, pose)| flips.map(|f| named("image", &mirror(mesh, pose, f))))
        .collect();
    let together = momenta(&all, &[], FullSolver::Qr, &[Pose::identity(); 8]).unwrap();
    // Spatial twists of the images: velocities mirrored, turns mirrored and reversed.
    let image = |x: &[f64], flip: [bool; 2]| -> [f64; 6] {
        let mut out: [f64; 6] = x.try_into().unwrap();
        for (axis, offset) in [(2, -0.1), (0, 0.1)] {
            if flip[usize::from(axis == 0)] {
                // y = x with one coordinate c ↦ offset − c.
                let mut turn = [-out[3], -out[4], -out[5]];
                turn[axis] = -turn[axis];
                let mut u = [out[0], out[1], out[2]];
                u[axis] = -u[axis];
                let shift = Vec3::ith(axis, offset);
                let u = Vec3::from(u) - Vec3::from(turn).cross(&shift);
                out = [u.x, u.y, u.z, turn[0], turn[1], turn[2]];
            }
        }
        out
    };
    let mut embed = DMatrix::zeros(48, 12);
    for b in 0..2 {
        for k in 0..6 {
            let mut twist = nalgebra::Vector6::zeros();
            twist[k] = 1.0;
            let spatial = poses[b].twist_to_world(&twist);
            for (i, f) in flips.iter().enumerate() {
                let x = image(spatial.as_slice(), *f);
                for (c, x) in x.iter().enumerate() {
                    embed[(24 * b + 6 * i + c, 6 * b + k)] = *x;
                }
            }
        }
    }
    let expected = embed.transpose() * together * embed / 4.0;
    let error = (with_walls - &expected).abs().max() / expected.max();
    assert!(error < 1e-9, "{error:e}");
}

#[test]
fn alone_or_moved_together_nothing_changes() {
    let coin = named("coin", &ellipsoid([0.5, 0.2, 0.3], 320));
    let pose = Pose::new(
        exp_matrix(&Vec3::new(0.4, 0.1, -0.3)),
        Vec3::new(0.7, 0.2, 0.6),
    );
    let alone = momenta(std::slice::from_ref(&coin), &[], FullSolver::Gmres, &[pose]);
    // No iteration is needed for one body; its own value comes back.
    let settings = SolveSettings::default();
    let c = PanelCoupled::new(vec![coin.clone()], &[], Exclusions::none(), settings).unwrap();
    let m = c.evaluate(&[pose], &DMatrix::identity(6, 6)).unwrap();
    let own = DMatrix::from_column_slice(6, 6, coin.added_mass.as_slice());
    assert!((m.momenta() - &own).abs().max() < 1e-12);
    assert!((alone.unwrap() - own).abs().max() < 1e-12);
    // A few columns of the basis, and a body that no column moves: its impulse isn't read.
    let pair = vec![coin.clone(), coin];
    let c = PanelCoupled::new(pair.clone(), &[], Exclusions::none(), settings).unwrap();
    let poses = [pose, pose.compose(&at(0.9))];
    let full = c.evaluate(&poses, &DMatrix::identity(12, 12)).unwrap();
    let basis = DMatrix::from_fn(12, 2, |i, k| {
        if i < 6 {
            (1.0 + (i + 7 * k) as f64).sin()
        } else {
            0.0
        }
    });
    let few = c.evaluate(&poses, &basis).unwrap();
    let error = few.momenta() - full.momenta() * &basis;
    let error = error.rows(0, 6).abs().max();
    assert!(error < 1e-8, "{error:e}");
    assert_eq!(few.momenta().rows(6, 6).abs().max(), 0.0);
    let turn = Pose::new(
        exp_matrix(&Vec3::new(1.0, -2.0, 0.5)),
        Vec3::new(30.0, 1.0, -7.0),
    );
    let moved = poses.map(|p| turn.compose(&p));
    let there = c.evaluate(&moved, &basis).unwrap();
    assert!((there.momenta() - few.momenta()).abs().max() < 1e-9);
    let nothing = c.evaluate(&poses, &DMatrix::zeros(12, 0)).unwrap();
    assert_eq!(nothing.momenta().shape(), (12, 0));
}

/// Mass along the gap and its slope of a disc, radius 1, thickness 0.25, flat over a wall: a film of water that follows the
/// law πR⁴/(8h), down to a thousandth of the radius.
#[test]
fn a_disc_over_a_wall() {
    let disc = mesh(&Shape::cylinder(1.0, 0.25), 1280);
    let disc = Arc::new(PanelBoundary::new("disc", &disc).unwrap());
    let floor = [wall(0.0, WallSurface::Rigid)];
    let c = PanelCoupled::new(
        vec![disc],
        &floor,
        Exclusions::none(),
        SolveSettings::default(),
    );
    let c = c.unwrap();
    let up = DMatrix::from_fn(6, 1, |i, _| if i == 2 { 1.0 } else { 0.0 });
    let one = DVector::from_element(1, 1.0);
    let mass = |gap: f64| c.evaluate(&[at(gap + 0.125)], &up).unwrap().momenta()[(2, 0)];
    for gap in [0.5, 0.1, 0.05, 0.025, 0.01, 0.001] {
        let record = c.linearise(&[at(gap + 0.125)], &up).unwrap();
        let slope = record.gradient(&one, &one).unwrap()[0][2];
        let h = 1e-4 * gap;
        let difference = (mass(gap + h) - mass(gap - h)) / (2.0 * h);
        let film = std::f64::consts::PI / (8.0 * gap);
        println!(
            "gap {gap}: {:.5} {slope:.6e}, difference {difference:.6e}, film {film:.4}",
            mass(gap)
        );
        assert!((slope - difference).abs() < 1e-5 * slope.abs(), "{gap}");
        if gap <= 0.01 {
            // What the rim and the outside add falls with the gap.
            assert!((1.0..1.3).contains(&(mass(gap) / film)), "{gap}");
            assert!((0.9..1.3).contains(&(-slope * gap / film)), "{gap}");
        }
    }
}

/// Steps and gradients of rollouts, flat face over flat face above a floor.
#[test]
fn boxes_that_approach_are_differentiated() {
    let mut scene = Scene::new(Fluid {
        density: 1000.0,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -9.81];
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    for (height, density) in [(0.5, 1500.0), (1.2, 2000.0)] {
        let body = Body::new(Shape::cuboid([1.0, 0.8, 0.4])).density(density);
        scene.add(body.at([0.05 * height, 0.0, height]));
    }
    let settings = Settings::default()
        .fidelity(Fidelity::Full)
        .method(Method::Panel)
        .time_step(0.01)
        .tolerance(1e-13)
        .faces(80);
    let mut simulator = Simulator::new(&scene, settings).unwrap();
    let checked = gradcheck::GradcheckSettings {
        steps: 5,
        directions: 1,
        seed: 3,
        timings: 0,
        enough: Some(1e-7),
    };
    let report = gradcheck::gradcheck(&mut simulator, &checked).unwrap();
    println!("{:.1e}", report.max_rel_error);
    assert!(report.max_rel_error < 1e-7, "{:#?}", report.directions);
}

#[test]
fn overlaps_and_impossible_settings_are_errors() {
    let ball = named("ball", &ellipsoid([1.0; 3], 320));
    let coin = named("coin", &ellipsoid([0.3, 0.1, 0.3], 80));
    for solver in [FullSolver::Gmres, FullSolver::Qr] {
        let pair = [ball.clone(), coin.clone()];
        // Crossing, wholly inside, nowhere.
        for x in [1.05, 0.0, f64::NAN] {
            let error = momenta(&pair, &[], solver, &[at(0.0), at(x)]).unwrap_err();
            assert!(matches!(error, Error::Unresolved { .. }), "{error}");
            let text = error.to_string();
            assert!(
                text.contains("\"ball\"") && text.contains("\"coin\""),
                "{text}"
            );
        }
        // Through the wall, and behind it.
        for x in [0.9, -5.0] {
            let floor = [wall(0.0, WallSurface::Rigid)];
            let error = momenta(std::slice::from_ref(&ball), &floor, solver, &[at(x)]).unwrap_err();
            let text = error.to_string();
            assert!(
                text.contains("\"ball\"") && text.contains("wall 0"),
                "{text}"
            );
        }
    }
    let new = |settings| PanelCoupled::new(vec![ball.clone()], &[], Exclusions::none(), settings);
    for tolerance in [0.0, -1.0, 1.0, f64::NAN] {
        let settings = SolveSettings {
            tolerance,
            ..SolveSettings::default()
        };
        assert!(matches!(new(settings), Err(Error::Input { .. })));
    }
    let settings = SolveSettings {
        max_iterations: 0,
        ..SolveSettings::default()
    };
    assert!(matches!(new(settings), Err(Error::Input { .. })));
    let many = vec![ball.clone(); MOST_FACES / ball.faces.len() + 1];
    let error = PanelCoupled::new(many, &[], Exclusions::none(), SolveSettings::default())
        .err()
        .unwrap();
    assert!(matches!(error, Error::Unsupported { .. }), "{error}");
    // A solve that can't finish says where it stopped.
    let settings = SolveSettings {
        max_iterations: 1,
        tolerance: 1e-12,
        ..SolveSettings::default()
    };
    let c = PanelCoupled::new(vec![ball; 2], &[], Exclusions::none(), settings).unwrap();
    let error = c.evaluate(&[at(0.0), at(2.1)], &DMatrix::identity(12, 12));
    assert!(matches!(error, Err(Error::Solver { iterations: 1, .. })));
    // Poses for fewer bodies.
    let error = c.evaluate(&[at(0.0)], &DMatrix::identity(12, 12));
    assert!(matches!(error, Err(Error::Input { .. })));
}

/// Bodies of equal shape share their panels, but not their names.
#[test]
fn equal_bodies_are_told_apart() {
    let beside = |x: f64, z: f64| {
        let second = Pose::new(Mat3::identity(), Vec3::new(x, 0.0, z));
        [at(0.0), second]
    };
    let all = DMatrix::identity(12, 12);
    let said = |c: &dyn Coupling, poses: [Pose; 2]| {
        let error = c.evaluate(&poses, &all).err();
        error.expect("refused").to_string()
    };
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add_wall([0.0, 0.0, -2.0], [0.0, 0.0, 1.0]);
    for (name, x) in [("left", 0.0), ("right", 3.0)] {
        let ball = Body::new(Shape::sphere(1.0).faces(80)).named(name);
        scene.add(ball.density(1000.0).at([x, 0.0, 0.0]));
    }
    for films in [false, true] {
        let settings = Settings::default()
            .fidelity(Fidelity::Full)
            .method(Method::Panel)
            .films(films);
        let simulator = Simulator::new(&scene, settings).unwrap();
        let coupling = simulator.system().coupling.as_ref();
        let apart = beside(1.5, 0.0);
        says(said(coupling, apart), &["\"left\"", "\"right\""]);
        let through = said(coupling, beside(3.0, -1.5));
        says(&through, &["\"right\"", "wall"]);
        assert!(!through.contains("left"), "{through}");
    }
    let ball = named("ball", &ellipsoid([1.0; 3], 80));
    let settings = SolveSettings::default();
    let pair = PanelCoupled::new(vec![ball; 2], &[], Exclusions::none(), settings).unwrap();
    let pair = pair.named(["pike", "perch", "nobody"].map(String::from));
    let names = ["\"pike\"", "\"perch\""];
    says(said(&pair, beside(1.5, 0.0)), &names);
}

/// A scene's coupled panels make as many iterations as are asked for, and no more.
#[test]
fn iterations_are_as_asked_for() {
    let mut scene = Scene::new(Fluid::fresh_water());
    for z in [0.0, 2.1] {
        let ball = Body::new(Shape::sphere(1.0).faces(320)).density(1000.0);
        scene.add(ball.at([0.0, 0.0, z]));
    }
    let solve = |most: usize| -> Result<_> {
        let settings = Settings::default()
            .fidelity(Fidelity::Full)
            .method(Method::Panel)
            .films(false)
            .tolerance(1e-12)
            .max_iterations(most);
        Simulator::new(&scene, settings)?.added_mass()
    };
    let error = solve(0).err().unwrap();
    assert!(matches!(error, Error::Input { .. }), "{error}");
    says(error, &["max_iterations", "at least 1"]);
    let error = solve(1).err().unwrap();
    assert!(
        matches!(error, Error::Solver { iterations: 1, .. }),
        "{error}"
    );
    assert!(solve(100).is_ok());
}

#[test]
fn any_thread_count() {
    let answers = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let b = named("coin", &ellipsoid([0.5, 0.2, 0.3], 500));
            let walls = [wall(-0.6, WallSurface::Rigid)];
            let poses = [at(0.0), at(0.7)];
            [FullSolver::Gmres, FullSolver::Qr]
                .map(|s| momenta(&[b.clone(), b.clone()], &walls, s, &poses).unwrap())
        })
    };
    assert!(answers(1) == answers(2));
}

/// Sweeps over the blocks, in memory that was used before, give what the whole matrix does: for any number of bodies.
#[test]
fn chains_of_bodies() {
    let ball = named("ball", &ellipsoid([0.5, 0.3, 0.4], 80));
    let small = named("small", &ellipsoid([0.3, 0.3, 0.4], 48));
    let walls = [wall(-0.7, WallSurface::Free)];
    for count in 1..=5 {
        let bodies: Vec<_> = (0..count).map(|b| [&ball, &small][b % 2].clone()).collect();
        let n = 6 * count;
        let basis = DMatrix::identity(n, n);
        let coupled = |solver, walls: &[Wall]| {
            let settings = SolveSettings {
                solver,
                tolerance: 1e-12,
                ..SolveSettings::default()
            };
            let excluded = Exclusions::new((count > 2).then_some((0, 2)));
            PanelCoupled::new(bodies.clone(), walls, excluded, settings).unwrap()
        };
        let poses = |gap: f64| -> Vec<Pose> { (0..count).map(|b| at(gap * b as f64)).collect() };
        for walls in [&walls[..], &[]] {
            let [blocks, dense] = [FullSolver::Gmres, FullSolver::Qr].map(|s| coupled(s, walls));
            let z = DVector::from_fn(n, |i, _| (1.3 * i as f64).sin());
            let z: Vec<_> = (0..count)
                .map(|b| z.fixed_rows::<6>(6 * b).into())
                .collect();
            let all = |c: &PanelCoupled, gap| {
                let found = c.linearise(&poses(gap), &basis).unwrap();
                let x = DVector::from_fn(n, |i, _| (0.7 * i as f64).cos());
                let y = DVector::from_fn(n, |i, _| x[n - 1 - i]);
                let tangent = found
                    .hvp(Direction::Twist(&x), Direction::Twist(&y), &z)
                    .unwrap();
                let wrench = tangent.wrench.iter().flat_map(|w| w.iter().copied());
                (found.momenta().clone(), wrench.collect::<Vec<f64>>())
            };
            let first = all(&blocks, 0.95);
            all(&blocks, 1.1);
            assert!(all(&blocks, 0.95) == first);
            let expected = all(&dense, 0.95);
            let error = (&first.0 - &expected.0).abs().max() / expected.0.abs().max();
            let size = expected.1.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let pairs = first.1.iter().zip(&expected.1);
            let of_tangent =
                pairs.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / size.max(1e-3);
            assert!(
                error < 1e-10 && of_tangent < 1e-9,
                "{count}: {error:e} {of_tangent:e}"
            );
        }
    }
}
