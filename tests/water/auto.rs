//! What the fidelity `auto` chooses, and that it says so.

use crate::support::says;
use hydrograd::boundary::{Depth, Readout, RowScaling};
use hydrograd::coupling::full::{FullSolver, Preconditioner};
use hydrograd::scene::{Placement, Preset, Shape};
use hydrograd::simulate::{Exchange, Method};
use hydrograd::{Body, Fidelity, Fluid, Scene, Settings, Simulator};

fn balls(places: &[f64]) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    for x in places {
        let mut body = Body::new(Shape::sphere(1.0)).density(1000.0);
        body.placement = Placement::new([*x, 0.0, 0.0], [0.0; 3]);
        scene.add(body);
    }
    scene
}

fn auto(scene: &Scene) -> Simulator {
    Simulator::new(scene, Settings::default().fidelity(Fidelity::Auto)).unwrap()
}

#[test]
fn bodies_that_are_near_get_more_sources_and_far_pairs_fade_out() {
    let simulator = auto(&balls(&[0.0, 2.2, 40.0]));
    assert_eq!(simulator.fidelity(), Fidelity::Reduced);
    let unknowns: Vec<usize> = simulator
        .discretisation()
        .iter()
        .map(|d| d.unknowns)
        .collect();
    assert!(
        unknowns[0] == unknowns[1] && 2 * unknowns[0] > 3 * unknowns[2],
        "{unknowns:?}"
    );
    let reasons = simulator.reasons().join("\n");
    assert!(reasons.contains("coupled in full up to"), "{reasons}");
}

/// However narrow a gap, bodies stay compressed, and the water in it is a film. Who turns films off is told of gaps that the sources don't resolve.
#[test]
fn gaps_that_compression_does_not_resolve() {
    for gap in [0.1, 0.06, 0.03, 0.005] {
        let simulator = auto(&balls(&[0.0, 2.0 + gap]));
        assert_eq!(simulator.fidelity(), Fidelity::Reduced, "gap {gap}");
        let resolved = simulator.discretisation()[0].resolved_gap.unwrap();
        let without = Settings::default().films(false);
        let without = Simulator::new(&balls(&[0.0, 2.0 + gap]), without).unwrap();
        assert_eq!(without.fidelity(), Fidelity::Reduced, "gap {gap}");
        let said = without.start_gap_warning();
        assert_eq!(said.is_some(), gap < resolved, "gap {gap}: {said:?}");
        if let Some(said) = said {
            says(said, &["compressed sources resolve", "body 0", "body 1"]);
        }
    }
}

/// What can't be used or can't be right is said, and what would lose most of the added mass is refused.
#[test]
fn settings_out_of_place_are_told() {
    let scene = balls(&[0.0, 3.0]);
    let warned = |settings: Settings| {
        Simulator::new(&scene, settings)
            .unwrap()
            .warnings()
            .join("\n")
    };
    let full = Settings::default().faces(320).fidelity(Fidelity::Full);
    assert!(warned(full.rank(10)).contains("rank has no effect with the fidelity full"));
    let sparse = full.preconditioner(Preconditioner::Csd24);
    assert!(
        warned(sparse.clone())
            .contains("preconditioner has no effect with the fidelity full by panel")
    );
    let by_sources = sparse.method(Method::MfsVertex);
    assert_eq!(warned(by_sources.csd24_rho(2.0)), "");
    let direct = by_sources.solver(FullSolver::Qr);
    assert!(warned(direct).contains("preconditioner has no effect with the solver qr"));
    let diagonal = by_sources
        .preconditioner(Preconditioner::Jacobi)
        .csd24_rho(2.0);
    assert!(warned(diagonal).contains("csd24_rho has no effect with the preconditioner jacobi"));
    let unheeded = |settings: &Settings, names: &[&str], with: &str| {
        let said = warned(settings.clone());
        for name in names {
            says(
                &said,
                &[&format!("setting {name} has no effect with {with}:")],
            );
        }
        assert_eq!(said.lines().count(), names.len(), "{said}");
    };
    let tight = |settings: &Settings| {
        let settings = settings.tolerance(1e-10).max_iterations(700);
        settings.solver(FullSolver::Qr)
    };
    let solve = ["tolerance", "solver", "max_iterations"];
    let reduced = full.fidelity(Fidelity::Reduced);
    unheeded(&tight(&reduced), &solve, "the fidelity reduced");
    let alone = full.fidelity(Fidelity::Isolated);
    unheeded(&tight(&alone), &solve, "the fidelity isolated");
    assert_eq!(warned(tight(&full)), "");
    let compressed = |settings: &Settings| settings.accuracy(0.02).exchange(Exchange::Factor);
    let names = ["accuracy", "exchange"];
    unheeded(&compressed(&full), &names, "the fidelity full");
    unheeded(&compressed(&alone), &names, "the fidelity isolated");
    for fidelity in [Fidelity::Reduced, Fidelity::Auto] {
        assert_eq!(warned(compressed(&full.fidelity(fidelity))), "");
    }
    let sources = |settings: &Settings| {
        let settings = settings.depth(Depth::Fixed(0.3)).readout(Readout::Centre);
        settings.rows(RowScaling::Unscaled).damping(1e-3)
    };
    let names = ["depth", "rows", "readout", "damping"];
    unheeded(&sources(&full), &names, "the method panel");
    unheeded(&sources(&reduced), &names, "the method auto");
    for of in [&full, &reduced] {
        let said = warned(sources(&of.method(Method::MfsVertex)));
        assert!(!said.contains("no effect"), "{said}");
    }
    // A preset's own numbers aren't asked for by name.
    let paper = Settings {
        preset: Some(Preset::Paper),
        ..full.method(Method::Panel)
    };
    assert_eq!(warned(paper), "");
    let folder = tempfile::tempdir().unwrap();
    for (settings, told) in [(&full, true), (&alone, true), (&reduced, false)] {
        let made = Simulator::cached(&scene, settings.clone(), folder.path()).unwrap();
        let said = made.warnings().join("\n");
        assert_eq!(said.contains("setting cache has no effect"), told, "{said}");
    }
    assert!(warned(reduced.rank(2)).contains("compressed sources leave"));
    assert_eq!(warned(reduced.clone()), "");
    let refused = |settings: Settings| {
        Simulator::new(&scene, settings)
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    assert!(refused(reduced.rank(100_000)).contains("from 1 to 1000"));
    assert!(refused(reduced.resolved_gap(1e9)).contains("radii of the body"));
    let mut plate = Scene::new(Fluid::fresh_water());
    plate.add(Body::new(Shape::cuboid([1.0, 0.003, 1.0])).density(1000.0));
    let sources = Settings::default().fidelity(Fidelity::Full);
    let thin = Simulator::new(&plate, sources.method(Method::MfsVertex))
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(
        thin.contains("far too thin") && thin.contains("panel"),
        "{thin}"
    );
}

/// A disc, radius 1 and thickness 0.25, flat over a wall: where compressed sources don't resolve the gap there is a film. Mass along
/// the gap, against coupled panels on finer and finer meshes, extrapolated.
#[test]
fn a_disc_flat_over_a_wall_keeps_its_film() {
    for (gap, converged, limit) in [(0.025, 20.55, 0.05), (0.01, 45.2, 0.08)] {
        let mut scene = Scene::new(Fluid {
            density: 1.0,
            current: [0.0; 3],
        });
        scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
        let disc = Shape::cylinder(1.0, 0.25).faces(1280);
        scene.add(Body::new(disc).density(1.0).at([0.0, 0.0, 0.125 + gap]));
        let simulator = auto(&scene);
        assert_eq!(simulator.fidelity(), Fidelity::Reduced);
        let m = simulator.added_mass().unwrap().matrix[(2, 2)];
        println!("gap {gap}: {m:.3}");
        assert!((m / converged - 1.0).abs() < limit, "gap {gap}: {m}");
        // By sources inside the disc it would be a fifth of that, with a force of the wrong sign.
        let sources = Settings::default().fidelity(Fidelity::Full);
        let error = Simulator::new(&scene, sources.method(Method::MfsVertex))
            .err()
            .expect("a film")
            .to_string();
        assert!(
            error.contains("flat gap") && error.contains("panel"),
            "{error}"
        );
    }
}

/// A pebble beside a large body is far from its middle, and near: what the block's motion does to it is there, as `reduced`, where no pair fades, has it, in every
/// unit of length.
#[test]
fn small_bodies_at_large_ones_are_coupled() {
    for scale in [1.0, 1e-3, 1e3] {
        // Over the middle of a block's face, and over a slab beside one of its corners.
        for (block, pebble, place) in [
            ([2.0, 2.0, 2.0], 0.005, [0.0, 0.0, 1.01]),
            ([2.0, 2.0, 0.2], 0.01, [0.8, 0.7, 0.115]),
        ] {
            let mut scene = Scene::new(Fluid::fresh_water());
            let block = Shape::cuboid(block.map(|x| scale * x)).faces(300);
            scene.add(Body::new(block).density(2000.0));
            let ball = Body::new(Shape::sphere(scale * pebble)).density(1000.0);
            scene.add(ball.at(place.map(|x| scale * x)));
            let [all, planned] = [Fidelity::Reduced, Fidelity::Auto].map(|fidelity| {
                let settings = Settings::default().fidelity(fidelity);
                let simulator = Simulator::new(&scene, settings).unwrap();
                simulator.added_mass().unwrap().matrix[(2, 8)]
            });
            // Compressed for other gaps, and neither resolves this one: but for that they are the same.
            assert!(
                all != 0.0 && (planned / all - 1.0).abs() < 0.25,
                "{scale} {place:?}: {planned:e} for {all:e}"
            );
        }
    }
}
