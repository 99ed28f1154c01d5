//! The water around bodies with refined meshes.

use hydrograd::boundary::OneBody;
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::time::Instant;

/// A box alone.
fn boxed(body: impl FnOnce(Body) -> Body) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let plain = Body::new(Shape::cuboid([1.0, 0.5, 0.3]))
        .named("box")
        .density(998.0);
    scene.add(body(plain));
    scene
}

fn added_mass(scene: &Scene, settings: Settings) -> DMatrix<f64> {
    let sim = Simulator::new(scene, settings).unwrap();
    sim.added_mass().unwrap().matrix
}

/// max |ΔM_ij| / √(M_ii M_jj), but for directions in which next to no water moves: a round body's spin.
fn error(found: &DMatrix<f64>, exact: &DMatrix<f64>) -> f64 {
    let most = [0, 3].map(|k| {
        let own = (0..exact.nrows()).filter(|i| i % 6 / 3 == k / 3);
        own.map(|i| exact[(i, i)]).fold(0.0, f64::max)
    });
    let felt = |i: &usize| exact[(*i, *i)] > 1e-3 * most[i % 6 / 3];
    let felt: Vec<usize> = (0..exact.nrows()).filter(felt).collect();
    let off = |i: usize, j: usize| {
        let size = (exact[(i, i)] * exact[(j, j)]).sqrt();
        (found[(i, j)] - exact[(i, j)]).abs() / size
    };
    let all = felt.iter().flat_map(|i| felt.iter().map(|j| off(*i, *j)));
    all.fold(0.0, f64::max)
}

#[test]
fn a_refined_corner_changes_little_of_the_added_mass() {
    let plain = boxed(|b| b);
    let corner = boxed(|b| b.refine([0.5, 0.25, 0.15], 0.08, 0.02));
    let best = added_mass(&plain, Settings::default().fidelity(Fidelity::Isolated));
    let base = Settings::default().faces(600);
    let all = [
        ("full", base.fidelity(Fidelity::Full)),
        (
            "full, panel",
            base.fidelity(Fidelity::Full).one_body(OneBody::Panel),
        ),
        ("isolated", base.fidelity(Fidelity::Isolated)),
        ("reduced", base.fidelity(Fidelity::Reduced)),
    ];
    for (name, settings) in all {
        let (a, b) = (added_mass(&plain, settings), added_mass(&corner, settings));
        let (moved, before, after) = (error(&b, &a), error(&a, &best), error(&b, &best));
        println!("{name}: moved by {moved:.2e}; from the finest: {before:.2e} -> {after:.2e}");
        assert!(moved < 0.01, "{name}: {moved}");
        assert!(after < before + 1e-4, "{name}: {before} -> {after}");
    }
}

#[test]
fn closed_forms_do_not_see_the_mesh() {
    let ball = |refine: bool| {
        let mut scene = Scene::new(Fluid::fresh_water());
        let body = Body::new(Shape::ellipsoid([0.2, 0.1, 0.1])).density(998.0);
        scene.add(if refine {
            body.refine([0.2, 0.0, 0.0], 0.05, 0.01)
        } else {
            body
        });
        scene
    };
    for fidelity in [Fidelity::Isolated, Fidelity::Reduced] {
        let settings = Settings::default().fidelity(fidelity);
        let (a, b) = (
            added_mass(&ball(false), settings),
            added_mass(&ball(true), settings),
        );
        assert_eq!(a, b);
    }
}

/// A coin flat over a fixed box, with regions around the points where they are nearest.
fn coin_over_box(regions: Option<(f64, f64)>, faces: [usize; 2]) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 1.0,
        current: [0.0; 3],
    });
    let axis = [0.0, 0.0, 1.0];
    let mut plate = Body::new(Shape::cuboid([1.0, 1.0, 0.4]).faces(faces[0])).fixed();
    let mut coin = Body::new(Shape::ellipsoid([0.2, 0.2, 0.1]).faces(faces[1]))
        .density(1.0)
        .at([0.0, 0.0, 0.3])
        .joint(Joint::Prismatic { axis });
    if let Some((radius, edge)) = regions {
        plate = plate.refine([0.0, 0.0, 0.2], radius, edge);
        coin = coin.refine([0.0, 0.0, -0.1], radius, edge);
    }
    scene.add(plate);
    scene.add(coin);
    scene.initial.q = vec![GAP];
    scene
}

/// m
const GAP: f64 = 0.002;
/// About where the gap is twice as wide, m.
const RADIUS: f64 = 0.04;

/// M_f, and the force between the bodies of [`coin_over_box`] at unit speed.
struct Found {
    matrix: DMatrix<f64>,
    /// ½ ∂M_zz/∂gap of the coin, kg/m.
    force: f64,
    seconds: f64,
    faces: usize,
}

fn found(scene: &Scene, settings: Settings) -> Found {
    let mut sim = Simulator::new(scene, settings).unwrap();
    let mut at = |gap: f64| {
        sim.set_start(DVector::from_element(1, gap), DVector::zeros(1))
            .unwrap();
        let begin = Instant::now();
        let m = sim.added_mass().unwrap().matrix;
        (m, begin.elapsed().as_secs_f64())
    };
    let (low, first) = at(0.98 * GAP);
    let (high, second) = at(1.02 * GAP);
    Found {
        force: 0.5 * (high[(8, 8)] - low[(8, 8)]) / (0.04 * GAP),
        matrix: 0.5 * (low + high),
        seconds: first.min(second),
        faces: sim.faces(),
    }
}

#[test]
fn a_refined_gap_is_one_that_full_resolves() {
    let warning = |regions| {
        let scene = coin_over_box(regions, [300, 320]);
        let full = Settings::default().fidelity(Fidelity::Full);
        Simulator::new(&scene, full).unwrap().start_gap_warning()
    };
    let said = warning(None).unwrap();
    assert!(said.contains("narrower than half the edges"), "{said}");
    assert!(said.contains("`refine`"), "{said}");
    assert_eq!(warning(Some((0.03, 2.0 * GAP))), None);
}

/// Printed for `docs/accuracy-coupled.md`; takes a few minutes.
#[test]
#[ignore = "a measurement"]
fn a_gap_resolved_where_it_is() {
    let full = Settings::default().fidelity(Fidelity::Full);
    let panel = |edge, faces| {
        let scene = coin_over_box(Some((RADIUS, edge)), faces);
        found(&scene, full.one_body(OneBody::Panel))
    };
    let coarse = panel(2.0 * GAP, [1000, 500]);
    let fine = panel(1.4 * GAP, [2000, 980]);
    // Twice the faces: the error goes with their power ⅔ at the box's edges, with 1/faces in the gap.
    let best = &fine.matrix + (&fine.matrix - &coarse.matrix) / (2f64.powf(2.0 / 3.0) - 1.0);
    let force = 2.0 * fine.force - coarse.force;
    let row = |name: &str, f: &Found| {
        println!(
            "{name:20} {:6} faces {:8.3} s   M_f {:5.2} %   coin {:+6.2} %   force {:+6.1} %",
            f.faces,
            f.seconds,
            100.0 * error(&f.matrix, &best),
            100.0 * (f.matrix[(8, 8)] / best[(8, 8)] - 1.0),
            100.0 * (f.force / force - 1.0),
        );
    };
    println!("reference: coin {:.6}, force {force:.5}", best[(8, 8)]);
    row("panels, coarse", &coarse);
    row("panels, fine", &fine);
    for (name, regions, faces) in [
        ("even", None, [600, 320]),
        ("refined", Some((0.5 * RADIUS, 2.0 * GAP)), [600, 320]),
        ("even", None, [1280, 980]),
        ("refined", Some((0.5 * RADIUS, 2.0 * GAP)), [1280, 980]),
        ("even", None, [3000, 2000]),
    ] {
        row(name, &found(&coin_over_box(regions, faces), full));
    }
}
