//! Films in gaps that coupled panels don't resolve.

use crate::support::reference::multipoles;
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::boundary::PanelBoundary;
use hydrograd::coupling::full::SolveSettings;
use hydrograd::coupling::{
    Coupling, Direction, Exclusions, ExtrapolatedPanels, FilmedPanels, Linearise, PanelCoupled,
};
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape, Wall, WallSurface};
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Simulator, shape};
use nalgebra::{DMatrix, DVector};
use std::path::Path;
use std::sync::Arc;

fn panels() -> Settings {
    let full = Settings::default().fidelity(Fidelity::Full);
    full.method(Method::Panel)
}

fn scene(floor: bool) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 1.0,
        current: [0.0; 3],
    });
    if floor {
        scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    }
    scene
}

/// The shape on a rail that opens the gap, turned by a rotation vector.
fn on_a_rail(shape: &Shape, turn: [f64; 3], height: f64) -> Body {
    let up = exp_matrix(&Vec3::from(turn)).transpose() * Vec3::z();
    let rail = Joint::Prismatic { axis: up.into() };
    let body = Body::new(shape.clone().faces(1280)).density(1.0);
    body.joint(rail).at([0.0, 0.0, height]).rotated(turn)
}

/// Added mass along the gap and its slope, of the first body on a rail.
fn along(scene: &Scene, settings: Settings) -> [f64; 2] {
    let simulator = Simulator::new(scene, settings).unwrap();
    let found = simulator
        .stepper()
        .linearise(simulator.start().0, 0.0)
        .unwrap();
    let force = found.inertial_force(&DVector::from_element(1, 1.0), &DVector::zeros(0));
    let mass = found.mass_matrix()[(0, 0)] - simulator.parameters().mass(0);
    [mass, -2.0 * force.unwrap()[0]]
}

/// At a hundredth and a thousandth of a radius, against the references of `cargo bench --bench gap` (exact series, rings, and facets graded towards the gap): M to 2 %, its
/// slope to 5 %. Panels alone miss one of both in each of these.
#[test]
fn masses_and_forces_down_to_a_thousandth() {
    let quarter = std::f64::consts::FRAC_PI_4;
    let (ball, disc) = (Shape::sphere(1.0), Shape::cylinder(1.0, 0.25));
    let (brick, capsule) = (Shape::cuboid([1.0, 1.0, 0.5]), Shape::capsule(0.25, 1.0));
    let over_wall = |shape: &Shape, turn: [f64; 3], height: f64| {
        let mut scene = scene(true);
        scene.add(on_a_rail(shape, turn, height));
        scene
    };
    let over_other = |shape: &Shape, turns: [[f64; 3]; 2], height: f64| {
        let mut scene = scene(false);
        scene.add(on_a_rail(shape, turns[0], height));
        let lower = Body::new(shape.clone().faces(1280)).density(1.0);
        scene.add(lower.joint(Joint::Fixed).rotated(turns[1]));
        scene
    };
    let flat = [0.0; 3];
    let crossed = [[0.0, 2.0 * quarter, 0.0], [2.0 * quarter, 0.0, 0.0]];
    let edge = 0.75 / f64::sqrt(2.0);
    let cases: [(&str, Scene, [f64; 2]); 7] = [
        (
            "two spheres",
            over_other(&ball, [flat; 2], 2.001),
            [2.414_9, -4.163_7],
        ),
        (
            "sphere",
            over_wall(&ball, flat, 1.001),
            [3.345_03, -15.803_26],
        ),
        (
            "disc",
            over_wall(&disc, flat, 0.135),
            [44.800_220, -4_022.846],
        ),
        (
            "disc",
            over_wall(&disc, flat, 0.126),
            [400.493_68, -393_697.07],
        ),
        (
            "box over box",
            over_other(&brick, [flat; 2], 0.505),
            [7.847_918, -1_423.389_7],
        ),
        (
            "edge",
            over_wall(&brick, [quarter, 0.0, 0.0], edge + 0.0005),
            [0.534_100, -1.407_444],
        ),
        (
            "capsules",
            over_other(&capsule, crossed, 0.500_25),
            [0.236_801, -1.061_807],
        ),
    ];
    for (name, scene, exact) in cases {
        let off = |settings: Settings| {
            let found = along(&scene, settings);
            [0, 1].map(|k| found[k] / exact[k] - 1.0)
        };
        let (with, without) = (off(panels()), off(panels().films(false)));
        println!("{name}: {with:+.4?} of M and of its slope, without films {without:+.4?}");
        assert!(with[0].abs() < 0.02 && with[1].abs() < 0.05, "{name}");
        assert!(without[0].abs() > 0.02 || without[1].abs() > 0.05, "{name}");
    }
}

/// Either of two spheres and between them, along the gap and across, against multipoles.
#[test]
fn all_entries_of_two_spheres() {
    let gap = 0.01;
    let mut scene = scene(false);
    for z in [0.0, 2.0 + gap] {
        let ball = Shape::sphere(1.0).faces(1280);
        scene.add(Body::new(ball).density(1.0).at([0.0, 0.0, z]));
    }
    let m = Simulator::new(&scene, panels()).unwrap();
    let m = m.added_mass().unwrap().matrix;
    let [along, along12, across, across12] = multipoles(2.0 + gap);
    let exact = [
        ((2, 2), along),
        ((8, 8), along),
        ((2, 8), along12),
        ((0, 0), across),
        ((0, 6), across12),
    ];
    for (at, exact) in exact {
        let error = (m[at] - exact).abs() / along;
        println!("{at:?}: {error:.1e}");
        assert!(error < 0.01, "{at:?}: {} for {exact}", m[at]);
    }
}

/// Panels of two bodies on two meshes each, at a hundredth of their size over a wall and from one another.
struct Near {
    filmed: FilmedPanels,
    plain: ExtrapolatedPanels,
}

fn poses() -> [Pose; 2] {
    let turned = exp_matrix(&Vec3::new(0.02, -0.01, 0.3));
    [
        Pose::new(turned, Vec3::new(0.0, 0.0, 0.265)),
        Pose::new(
            exp_matrix(&Vec3::zeros()),
            Vec3::new(0.1, 0.05, 0.53 + 0.31),
        ),
    ]
}

fn near(walls: &[Wall], excluded: &Exclusions) -> Near {
    let shapes = [Shape::cuboid([1.0, 0.8, 0.5]), Shape::sphere(0.3)];
    let meshes =
        |faces| (shapes.clone()).map(|s| shape::build(&s, Path::new("."), Some(faces)).unwrap());
    let solids = (shapes.clone()).map(|s| shape::solid(&s, Pose::identity()).unwrap());
    let of = |faces| {
        let bodies = meshes(faces).map(|m| Arc::new(PanelBoundary::new("b", &m).unwrap()));
        let settings = SolveSettings::default();
        PanelCoupled::new(bodies.to_vec(), walls, excluded.clone(), settings).unwrap()
    };
    let both = || ExtrapolatedPanels::new(of(320), of(80), 2.0).unwrap();
    let fine = meshes(320);
    let solids = solids.iter().map(Option::as_ref);
    let surfaces: Vec<_> = fine.iter().zip(solids).collect();
    Near {
        filmed: both().with_films(&surfaces, walls).unwrap(),
        plain: both(),
    }
}

fn wall(surface: WallSurface) -> Wall {
    Wall {
        surface,
        point: [0.0; 3],
        normal: [0.0, 0.0, 1.0],
    }
}

/// Bodies that don't feel each other have no film between them, nor has one under a free surface; nor where nothing is near. There the panels answer alone, to the last bit.
#[test]
fn where_there_are_no_films() {
    let all = DMatrix::identity(12, 12);
    let momenta =
        |c: &dyn Coupling, poses: &[Pose]| c.evaluate(poses, &all).unwrap().momenta().clone();
    let none = Exclusions::none();
    let (rigid, free) = ([wall(WallSurface::Rigid)], [wall(WallSurface::Free)]);
    let far = poses().map(|p| Pose::new(p.rotation, 3.0 * p.translation));
    for (walls, excluded, poses, films) in [
        (&rigid, &none, poses(), true),
        (&rigid, &none, far, false),
        (&rigid, &Exclusions::new([(0, 1)]), poses(), true),
        (&free, &none, poses(), true),
        (&free, &Exclusions::new([(0, 1)]), poses(), false),
    ] {
        let Near { filmed, plain } = near(walls, excluded);
        let same = momenta(&filmed, &poses) == momenta(&plain, &poses);
        assert!(same != films, "{walls:?} {excluded:?}");
    }
}

/// Values and second derivatives through films, with one thread and with two.
#[test]
fn any_thread_count() {
    let Near { filmed, plain } = near(&[wall(WallSurface::Rigid)], &Exclusions::none());
    let basis = DMatrix::identity(12, 12);
    let x = DVector::from_fn(12, |i, _| (0.7 * i as f64).cos());
    let z = [Vec6::repeat(0.1), Vec6::from_fn(|i, _| (i as f64).sin())];
    let answers = |c: &dyn Linearise, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let found = c.linearise(&poses(), &basis).unwrap();
            let tangent = found.hvp(Direction::Twist(&x), Direction::Basis(&x), &z);
            let wrench = found.gradient(&x, &x).unwrap();
            (found.momenta().clone(), wrench, tangent.unwrap().wrench)
        })
    };
    let one = answers(&filmed, 1);
    assert!(one == answers(&filmed, 2));
    assert!(one.0 != answers(&plain, 1).0);
}

/// Bodies in one another and missing surfaces are refused by name.
#[test]
fn what_is_refused_is_named() {
    let Near { filmed, plain } = near(&[], &Exclusions::none());
    let filmed = filmed.named(["block", "ball"].map(String::from));
    let touching = [
        poses()[0],
        Pose::new(exp_matrix(&Vec3::zeros()), Vec3::new(0.0, 0.0, 0.8)),
    ];
    let said = filmed.evaluate(&touching, &DMatrix::identity(12, 12));
    let said = said.err().unwrap().to_string();
    assert!(
        said.contains("\"ball\"") && said.contains("\"block\""),
        "{said}"
    );
    let said = plain.with_films(&[], &[]).err().unwrap().to_string();
    assert!(
        said.contains("films: surfaces") && said.contains('2'),
        "{said}"
    );
    // Where there are no films panels say it: under a free surface.
    let filmed = near(&[wall(WallSurface::Free)], &Exclusions::none()).filmed;
    let filmed = filmed.named(["block", "ball"].map(String::from));
    let through = [
        poses()[0],
        Pose::new(exp_matrix(&Vec3::zeros()), Vec3::new(2.0, 0.0, 0.1)),
    ];
    let said = filmed.evaluate(&through, &DMatrix::identity(12, 12));
    let said = said.err().unwrap().to_string();
    assert!(
        said.contains("\"ball\"") && said.contains("wall 0"),
        "{said}"
    );
}

/// Two like discs, radius 1 and a tenth as thick, face to face with a gap of 0.005, shifted and turned against each other: their faces don't meet. M along the gap against 5120 faces; it was
/// up to 15 % off by 1280 and had no solution by 320 in two of the poses while both were held apart as little as faces that meet.
#[test]
fn faces_that_do_not_meet() {
    // Radians, radii, converged M.
    for (turn, shift, converged) in [
        (0.0, 0.0, 82.86),
        (0.3, 0.0, 82.41),
        (0.0, 0.2, 64.22),
        (0.0, 0.4, 47.01),
        (0.3, 0.4, 47.55),
    ] {
        for (faces, allowed) in [(320, 0.06), (1280, 0.025)] {
            let mut scene = scene(false);
            let disc = Shape::cylinder(1.0, 0.1).faces(faces);
            let lower = Body::new(disc.clone()).density(1.0);
            scene.add(lower.joint(Joint::Fixed));
            let upper = Body::new(disc).density(1.0).at([shift, 0.0, 0.105]);
            let rail = Joint::Prismatic {
                axis: [0.0, 0.0, 1.0],
            };
            scene.add(upper.rotated([0.0, 0.0, turn]).joint(rail));
            let simulator = Simulator::new(&scene, panels()).unwrap();
            let mass = simulator.equations(simulator.start().0).unwrap();
            let mass = mass.added_mass_matrix().unwrap()[(0, 0)];
            let error = mass / converged - 1.0;
            println!("{turn}, {shift}, {faces} faces: {mass:.2}, {error:+.3}");
            assert!(error.abs() < allowed, "{turn}, {shift}, {faces}: {error}");
        }
    }
}
