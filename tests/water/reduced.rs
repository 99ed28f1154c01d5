//! The reduced coupling against exact solutions, its symmetry, its cache, and what it refuses.

use crate::support::mesh;
use crate::support::reference::{TwoSpheres, equal_spheres};
use crate::support::says;
use hydrograd::adjoint::lie::{Mat3, Pose, Vec3};
use hydrograd::boundary::{Depth, ExactBoundary, PanelBoundary};
use hydrograd::coupling::reduced::{Reduced, ReducedBody, cache, compress};
use hydrograd::coupling::{Coupling, Direction, Exclusions, Linearise};
use hydrograd::scene::{Body, Fluid, Scene, Shape, Wall, WallSurface};
use hydrograd::simulate::Method;
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

fn sphere(rank: Option<usize>, tolerance: f64, gap: f64) -> Arc<ReducedBody> {
    let mesh = mesh(&Shape::sphere(1.0), 1280);
    let response = ExactBoundary::new("sphere", [1.0; 3], &Pose::identity(), gap).unwrap();
    let settings = compress::CompressSettings {
        rank,
        tolerance,
        resolved_gap: Some(gap),
    };
    Arc::new(compress::compress("sphere", &mesh, &response, &settings, &[]).unwrap())
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::new(Mat3::identity(), Vec3::new(x, y, z))
}

fn matrix(coupling: &dyn Coupling, poses: &[Pose]) -> DMatrix<f64> {
    let n = 6 * poses.len();
    let basis = DMatrix::identity(n, n);
    let record = coupling.evaluate(poses, &basis).unwrap();
    record.momenta().clone()
}

/// Largest error of the two spheres' coefficients relative to M11.
fn two_spheres_error(body: &Arc<ReducedBody>, exact: &TwoSpheres) -> f64 {
    let pair = Reduced::new(vec![body.clone(); 2], &[], |_, _| None).unwrap();
    let m = matrix(&pair, &[at(0.0, 0.0, 0.0), at(0.0, 0.0, exact.distance)]);
    let (found, exact) = (TwoSpheres::coefficients_of(&m), exact.coefficients());
    let errors = found.iter().zip(exact).map(|(a, b)| (a - b).abs());
    errors.fold(0.0, f64::max) / exact[0]
}

#[test]
fn two_spheres_meet_the_exact_table() {
    let table = equal_spheres();
    for (rank, gap, limits) in [
        (80, 0.5, [2e-2, 5e-3, 1e-3, 5e-4, 1e-4, 5e-5]),
        (160, 0.5, [2e-2, 5e-3, 5e-4, 1e-4, 1e-5, 1e-6]),
        (160, 0.2, [2e-3, 1e-3, 5e-4, 1e-4, 1e-4, 1e-4]),
    ] {
        let body = sphere(Some(rank), 1e-4, gap);
        assert!(body.points() <= rank);
        for (exact, limit) in table.iter().zip(limits) {
            let error = two_spheres_error(&body, exact);
            println!(
                "rank {rank}, resolved gap {gap}, gap {:.2}: {error:.1e}",
                exact.gap()
            );
            assert!(error <= limit, "rank {rank} gap {}: {error:e}", exact.gap());
        }
    }
}

#[test]
fn a_tighter_tolerance_gives_more_points_and_smaller_errors() {
    let mut last = (0, f64::INFINITY);
    let exact = &equal_spheres()[1];
    for tolerance in [3e-2, 3e-3, 3e-4] {
        let body = sphere(None, tolerance, 0.2);
        let error = two_spheres_error(&body, exact);
        println!(
            "tolerance {tolerance:.0e}: {} points, error {error:.1e}",
            body.points()
        );
        assert!(error <= tolerance);
        assert!(body.points() > last.0 && error < last.1);
        last = (body.points(), error);
    }
}

/// A rigid wall is the mirror sphere, a free surface the mirror sphere of opposite sign.
#[test]
fn a_sphere_by_a_wall_and_under_a_free_surface() {
    let body = sphere(None, 1e-4, 0.4);
    for pair in &equal_spheres()[2..5] {
        let (d, [along, along12, across, across12]) = (pair.distance, pair.coefficients());
        let wall = |surface| Wall {
            point: [0.0, 0.0, 0.0],
            normal: [0.0, 0.0, -1.0],
            surface,
        };
        for (surface, sign) in [(WallSurface::Rigid, 1.0), (WallSurface::Free, -1.0)] {
            let one = Reduced::new(vec![body.clone()], &[wall(surface)], |_, _| None).unwrap();
            let m = matrix(&one, &[at(0.3, -0.2, -0.5 * d)]);
            let errors = [
                m[(2, 2)] - (along - sign * along12),
                m[(0, 0)] - (across + sign * across12),
                m[(1, 1)] - (across + sign * across12),
            ];
            let worst = errors.iter().fold(0.0_f64, |w, e| w.max(e.abs())) / along;
            println!("{surface:?} at {:.2}: {worst:.1e}", 0.5 * d - 1.0);
            assert!(worst < 3e-4, "{surface:?} {d}: {worst:e}");
        }
    }
}

#[test]
fn the_matrix_is_symmetric_to_rounding() {
    let panel = |shape: Shape| {
        let mesh = mesh(&shape, 320);
        let response = PanelBoundary::new("box", &mesh).unwrap();
        let settings = compress::CompressSettings::default();
        Arc::new(compress::compress("box", &mesh, &response, &settings, &[]).unwrap())
    };
    let wall = Wall::rigid([0.0, 0.0, -2.0], [0.0, 0.2, 1.0]);
    let bodies = vec![
        panel(Shape::cuboid([1.0, 0.6, 0.4])),
        sphere(None, 1e-2, 0.3),
    ];
    let coupled = Reduced::new(bodies, &[wall], |_, _| None).unwrap();
    let m = matrix(&coupled, &[at(0.0, 0.0, -1.0), at(0.3, 1.6, -0.4)]);
    let size = m.diagonal().map(|x| x.abs().max(1e-3).sqrt());
    for i in 0..12 {
        for j in 0..12 {
            let gap = (m[(i, j)] - m[(j, i)]).abs() / (size[i] * size[j]);
            assert!(gap < 1e-12, "{i} {j}: {gap:e}");
        }
    }
    assert!(m.clone().cholesky().is_some() || m.symmetric_eigenvalues().min() > -1e-12);
}

#[test]
fn gaps_far_below_what_is_resolved_are_errors_with_numbers() {
    let body = sphere(Some(40), 1e-2, 0.5);
    let pair = Reduced::new(vec![body; 2], &[], |_, _| None)
        .unwrap()
        .named(["left".to_string(), "right".to_string()]);
    let basis = DMatrix::identity(12, 12);
    let poses = [at(0.0, 0.0, 0.0), at(0.0, 0.0, 1.2)];
    let error = match pair.linearise(&poses, &basis) {
        Ok(_) => panic!("spheres in one another"),
        Err(e) => e.to_string(),
    };
    println!("{error}");
    for word in ["left", "right", "5.000e-1", "full"] {
        assert!(error.contains(word), "{error}");
    }
}

/// Pairs that are left out have no film, whichever was said first.
#[test]
fn films_and_pairs_that_are_left_out_come_in_any_order() {
    let (body, surface) = (sphere(Some(40), 1e-2, 0.5), mesh(&Shape::sphere(1.0), 320));
    let pair = || Reduced::new(vec![body.clone(); 2], &[], |_, _| None).unwrap();
    let filmed = |pair: Reduced| {
        pair.with_films(&[(&surface, None), (&surface, None)], &[1e-2; 2], &[])
            .unwrap()
    };
    let apart = |pair: Reduced| pair.excluding(&Exclusions::new([(0, 1)])).unwrap();
    let poses = [at(0.0, 0.0, 0.0), at(0.0, 0.0, 2.05)];
    let right = matrix(&apart(pair()), &poses);
    let films = |coupling: &Reduced| {
        let found = coupling.film_momenta(&poses, &DMatrix::identity(12, 12));
        found.unwrap().unwrap().amax()
    };
    assert!(films(&filmed(pair())) > 0.0);
    for both in [apart(filmed(pair())), filmed(apart(pair()))] {
        assert_eq!(films(&both), 0.0);
        assert_eq!(matrix(&both, &poses), right);
    }
}

/// Two ellipsoids of different shape and a box, by a wall.
fn scene() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add(Body::new(Shape::ellipsoid([0.1, 0.06, 0.04])).density(998.0));
    scene.add(
        Body::new(Shape::cuboid([0.1, 0.1, 0.06]))
            .density(1300.0)
            .at([0.25, 0.05, 0.0]),
    );
    scene.add_wall([0.0, 0.0, -0.2], [0.0, 0.0, 1.0]);
    scene.initial.v = vec![
        0.02, 0.03, -0.01, 0.5, -1.0, 0.8, -0.01, -0.02, 0.02, 1.0, 0.6, -0.7,
    ];
    scene
}

fn reduced() -> Settings {
    Settings::default().fidelity(Fidelity::Reduced).faces(320)
}

fn end(simulator: &Simulator, steps: usize) -> Vec<u64> {
    let rollout = simulator
        .rollout(&Controls::zeros(simulator, steps))
        .unwrap();
    let last = &rollout.samples()[steps];
    let numbers = last.q.iter().chain(last.v.iter());
    numbers.map(|x| x.to_bits()).collect()
}

#[test]
fn threads_do_not_change_a_bit() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            cache::forget();
            end(&Simulator::new(&scene(), reduced()).unwrap(), 5)
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn the_cache_gives_the_same_bits_and_survives_damage() {
    let folder = tempfile::tempdir().unwrap();
    let settings = reduced().method(Method::Panel).accuracy(7e-3);
    let run = || {
        end(
            &Simulator::cached(&scene(), settings.clone(), folder.path()).unwrap(),
            5,
        )
    };
    let files = || -> Vec<_> {
        let all = std::fs::read_dir(folder.path()).unwrap();
        let mut all: Vec<_> = all.map(|f| f.unwrap().path()).collect();
        all.sort();
        all
    };
    cache::forget();
    let first = run();
    assert_eq!(files().len(), 2);
    let paths = files();
    let kept: Vec<Vec<u8>> = paths.iter().map(|f| std::fs::read(f).unwrap()).collect();
    // From memory, from disk, without either.
    assert_eq!(run(), first);
    cache::forget();
    assert_eq!(run(), first);
    cache::forget();
    assert_eq!(
        end(&Simulator::new(&scene(), settings.clone()).unwrap(), 5),
        first
    );
    // Cut short at many places, changed, empty, of another version.
    let mut damaged: Vec<Vec<u8>> = [0, 1, 50, 120, 1000, kept[0].len() - 1]
        .iter()
        .map(|n| kept[0][..*n].to_vec())
        .collect();
    let mut changed = kept[0].clone();
    let middle = changed.len() / 2;
    changed[middle] ^= 1;
    damaged.push(changed);
    let text = String::from_utf8(kept[0].clone()).unwrap();
    damaged.push(
        text.replacen(
            "hydrograd-compressed-body ",
            "hydrograd-compressed-body 9",
            1,
        )
        .into(),
    );
    for bytes in damaged {
        std::fs::write(&files()[0], bytes).unwrap();
        cache::forget();
        assert_eq!(run(), first);
        assert_eq!(std::fs::read(&files()[0]).unwrap(), kept[0]);
    }
    // What a killed writer leaves is not read.
    std::fs::write(folder.path().join(".tmpAbCdEf"), b"half").unwrap();
    cache::forget();
    assert_eq!(run(), first);
    // A folder that can't be made is a warning that names it.
    let file = folder.path().join("file");
    std::fs::write(&file, b"").unwrap();
    cache::forget();
    let made = Simulator::cached(&scene(), settings.clone(), &file.join("inside")).unwrap();
    let told = made.warnings().iter().filter(|w| w.contains("inside"));
    assert_eq!(told.count(), 1, "{:?}", made.warnings());
    assert_eq!(end(&made, 5), first);
    // One body's file under the other's name is not taken for it.
    std::fs::write(&paths[0], &kept[1]).unwrap();
    std::fs::write(&paths[1], &kept[0]).unwrap();
    cache::forget();
    assert_eq!(run(), first);
    for (file, bytes) in paths.iter().zip(&kept) {
        assert!(&std::fs::read(file).unwrap() == bytes);
    }
}

/// Pipes would be waited for, and devices never end: neither is opened.
#[cfg(unix)]
#[test]
fn what_is_no_plain_file_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let settings = reduced().accuracy(9e-3);
    Simulator::cached(&scene(), settings.clone(), folder.path()).unwrap();
    let all = std::fs::read_dir(folder.path()).unwrap();
    let files: Vec<_> = all.map(|f| f.unwrap().path()).collect();
    let made = |kind: usize| {
        for file in &files {
            std::fs::remove_file(file).unwrap();
            match kind {
                0 => {
                    let made = std::process::Command::new("mkfifo").arg(file).status();
                    assert!(made.unwrap().success());
                }
                1 => std::os::unix::fs::symlink("/dev/zero", file).unwrap(),
                _ => std::fs::create_dir(file).unwrap(),
            }
        }
        cache::forget();
        Simulator::cached(&scene(), settings.clone(), folder.path()).unwrap()
    };
    for kind in 0..3 {
        let told = made(kind).warnings().to_vec();
        // Files are put in the place of pipes and links; a folder can't be replaced.
        let unkept = told.iter().filter(|w| w.contains("isn't kept")).count();
        assert_eq!(unkept, usize::from(kind == 2), "{told:?}");
    }
}

/// An accuracy beyond what compression has room for is told with what is reached; one within isn't.
#[test]
fn accuracy_that_is_not_reached_is_told() {
    for shape in [Shape::sphere(0.1), Shape::cuboid([0.2, 0.2, 0.1])] {
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.add(Body::new(shape.clone()).named("one").density(1000.0));
        scene.add(
            Body::new(shape)
                .named("two")
                .density(1000.0)
                .at([0.35, 0.0, 0.0]),
        );
        let mut last: Option<nalgebra::DMatrix<f64>> = None;
        for accuracy in [3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-12] {
            let simulator = Simulator::new(&scene, reduced().accuracy(accuracy)).unwrap();
            let told = simulator
                .warnings()
                .iter()
                .filter(|w| w.contains("accuracy"));
            let told: Vec<&String> = told.collect();
            let m = simulator.added_mass().unwrap().matrix;
            let moved = last.map_or(0.0, |last| (&m - last).amax() / m.amax());
            println!(
                "{accuracy:e}: {} unknowns, moved {moved:.1e}, {told:?}",
                simulator.unknowns()
            );
            if accuracy >= 1e-3 {
                assert!(told.is_empty(), "{told:?}");
            }
            if accuracy <= 1e-6 {
                assert_eq!(told.len(), 1, "{accuracy:e}");
                let text = format!("{accuracy:.1e}");
                says(told[0], &["one", "reach", &text]);
            }
            last = Some(m);
        }
    }
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let try_with = |settings: Settings| match Simulator::new(&scene(), settings) {
        Ok(_) => String::new(),
        Err(e) => e.to_string(),
    };
    for (settings, word) in [
        (reduced().rank(0), "rank"),
        (reduced().accuracy(0.0), "tolerance"),
        (reduced().accuracy(f64::NAN), "tolerance"),
        (reduced().resolved_gap(-1.0), "resolved_gap"),
        (reduced().resolved_gap(f64::INFINITY), "resolved_gap"),
        (reduced().method(Method::Exact), "exact"),
        (reduced().fidelity(Fidelity::Auto).accuracy(2.0), "accuracy"),
    ] {
        let said = try_with(settings);
        assert!(said.contains(word), "{word}: {said:?}");
    }
    let mut free = scene();
    free.walls[0].surface = WallSurface::Free;
    let sources = (Settings::default().fidelity(Fidelity::Full)).method(Method::MfsVertex);
    let said = Simulator::new(&free, sources).err().unwrap().to_string();
    assert!(
        said.contains("walls[0]") && said.contains("reduced"),
        "{said}"
    );
    assert!(Simulator::new(&free, reduced()).is_ok());
}

/// And the value alone is the same, to the bit.
#[test]
fn directions_outside_the_basis_agree_with_those_on_it() {
    let bodies = vec![sphere(Some(40), 1e-2, 0.5); 2];
    let pair = Reduced::new(bodies, &[], |_, _| None).unwrap();
    let poses = [at(0.0, 0.1, 0.0), at(0.3, 0.0, 2.9)];
    let basis = DMatrix::<f64>::identity(12, 12);
    let record = pair.linearise(&poses, &basis).unwrap();
    let x = DVector::from_fn(12, |i, _| (1.3 * i as f64).sin());
    let y = DVector::from_fn(12, |i, _| (0.7 * i as f64).cos());
    let on = record
        .vjp(Direction::Basis(&x), Direction::Basis(&y))
        .unwrap();
    let off = record
        .vjp(Direction::Twist(&x), Direction::Twist(&y))
        .unwrap();
    assert!((on.momentum_x - off.momentum_x).norm() < 1e-12);
    for (a, b) in on.wrench.iter().zip(&off.wrench) {
        assert!((a - b).norm() < 1e-12);
    }
    let other = record.gradient(&x, &y).unwrap();
    for (a, b) in on.wrench.iter().zip(&other) {
        assert!((a - b).norm() < 1e-12);
    }
    for (i, column) in record.gradient_columns(&x).unwrap().iter().enumerate() {
        let unit = DVector::from_fn(12, |k, _| f64::from(k == i));
        for (a, b) in column.iter().zip(record.gradient(&x, &unit).unwrap()) {
            assert!((a - b).norm() < 1e-12);
        }
    }
    let value = pair.evaluate(&poses, &basis).unwrap();
    assert_eq!(value.momenta(), record.momenta());
}

/// A depth of sources is in metres, whatever a fidelity measures a body in: small spheres, a third of a radius deep, coupled by all points and by compressed ones.
#[test]
fn depths_are_in_metres() {
    let mut scene = Scene::new(Fluid::fresh_water());
    for x in [0.0, 0.06] {
        let ball = Body::new(Shape::sphere(0.02)).density(1.0);
        scene.add(ball.at([x, 0.0, 0.0]));
    }
    let of = |fidelity: Fidelity, depth: Depth| {
        let settings = Settings::default().fidelity(fidelity).depth(depth);
        let settings = settings.method(Method::MfsVertex).faces(320);
        let simulator = Simulator::new(&scene, settings).unwrap();
        simulator.added_mass().unwrap().matrix
    };
    let depth = Depth::Fixed(0.0066);
    let [full, reduced] = [Fidelity::Full, Fidelity::Reduced].map(|f| of(f, depth));
    let automatic = of(Fidelity::Reduced, Depth::Auto);
    let off = |m: &DMatrix<f64>| (m - &full).view((0, 0), (3, 3)).amax() / full[(0, 0)];
    println!(
        "reduced off by {:.1e}, with an automatic depth {:.1e}",
        off(&reduced),
        off(&automatic)
    );
    assert!(off(&reduced) < 1e-3);
}
