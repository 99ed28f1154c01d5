//! The water around bodies with refined meshes.

use crate::support::bodies::{COIN_GAP, coin_over_box};
use crate::support::felt_error;
use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DMatrix;

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
            base.fidelity(Fidelity::Full).method(Method::Panel),
        ),
        ("isolated", base.fidelity(Fidelity::Isolated)),
        ("reduced", base.fidelity(Fidelity::Reduced)),
    ];
    for (name, settings) in all {
        let (a, b) = (
            added_mass(&plain, settings.clone()),
            added_mass(&corner, settings),
        );
        let (moved, before, after) = (
            felt_error(&b, &a),
            felt_error(&a, &best),
            felt_error(&b, &best),
        );
        println!("{name}: moved by {moved:.2e}; from the finest: {before:.2e} -> {after:.2e}");
        assert!(moved < 0.01, "{name}: {moved}");
        assert!(after < before + 1e-4, "{name}: {before} -> {after}");
    }
}

#[test]
fn closed_forms_do_not_see_the_mesh() {
    let ball = |refine: bool| {
        let mut scene = Scene::new(Fluid::fresh_water());
        let body = Body::new(Shape::ellipsoid([0.2, 0.1, 0.1]).faces(320)).density(998.0);
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
            added_mass(&ball(false), settings.clone()),
            added_mass(&ball(true), settings),
        );
        assert_eq!(a, b);
    }
}

#[test]
fn a_refined_gap_is_one_that_full_resolves() {
    let warning = |regions, films| {
        let scene = coin_over_box(regions, [300, 320]);
        let full = Settings::default().fidelity(Fidelity::Full).films(films);
        Simulator::new(&scene, full).unwrap().start_gap_warning()
    };
    let said = warning(None, false).unwrap();
    assert!(said.contains("by panels, may be off by"), "{said}");
    assert!(said.contains("`refine`"), "{said}");
    assert_eq!(warning(Some((0.03, 2.0 * COIN_GAP)), false), None);
    assert_eq!(warning(None, true), None);
}
