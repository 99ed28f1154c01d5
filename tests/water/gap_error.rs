//! What runs estimate of the water across gaps, and that it goes on smoothly where a film takes over.

use hydrograd::adjoint::lie::{Vec3, exp_matrix};
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use hydrograd::simulate::{Carried, Method, NearGap};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use nalgebra::DVector;
use std::f64::consts::FRAC_PI_4;

/// The first body over the second, or over a wall, on a rail along the gap.
#[derive(Clone)]
struct Case {
    name: &'static str,
    shapes: Vec<Shape>,
    turns: [[f64; 3]; 2],
    closed: f64,
    size: f64,
}

const START: f64 = 0.3;

fn cases() -> Vec<Case> {
    let flat = [[0.0; 3]; 2];
    let case = |name, shapes: &[&Shape], turns, closed, size| Case {
        name,
        shapes: shapes.iter().map(|s| (*s).clone().faces(720)).collect(),
        turns,
        closed,
        size,
    };
    let (ball, disc) = (Shape::sphere(1.0), Shape::cylinder(1.0, 0.25));
    let (brick, capsule) = (Shape::cuboid([1.0, 1.0, 0.5]), Shape::capsule(0.25, 1.0));
    let thin = Shape::ellipsoid([1.0, 1.0, 0.25]);
    let across = [[0.0, 2.0 * FRAC_PI_4, 0.0], [2.0 * FRAC_PI_4, 0.0, 0.0]];
    let on_edge = [[FRAC_PI_4, 0.0, 0.0], [0.0; 3]];
    vec![
        case("sphere-sphere", &[&ball, &ball], flat, 2.0, 1.0),
        case("sphere-wall", &[&ball], flat, 1.0, 1.0),
        case("ellipsoid-wall", &[&thin], flat, 0.25, 1.0),
        case("disc-wall", &[&disc], flat, 0.125, 1.0),
        case("box-wall", &[&brick], flat, 0.25, 0.5),
        case("box-box", &[&brick, &brick], flat, 0.5, 0.5),
        case("edge-wall", &[&brick], on_edge, 0.75 / f64::sqrt(2.0), 0.5),
        case("capsule-capsule", &[&capsule, &capsule], across, 0.5, 0.25),
    ]
}

impl Case {
    fn simulator(&self, settings: &Settings) -> Simulator {
        let mut scene = Scene::new(Fluid {
            density: 1.0,
            current: [0.0; 3],
        });
        if self.shapes.len() == 1 {
            scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
        }
        for (b, shape) in self.shapes.iter().enumerate() {
            let up = exp_matrix(&Vec3::from(self.turns[b])).transpose() * Vec3::z();
            let (height, joint) = match b {
                0 => {
                    let axis = up.into();
                    (self.closed + START * self.size, Joint::Prismatic { axis })
                }
                _ => (0.0, Joint::Fixed),
            };
            let body = Body::new(shape.clone()).density(1.0).joint(joint);
            scene.add(body.at([0.0, 0.0, height]).rotated(self.turns[b]));
        }
        Simulator::new(&scene, settings.clone()).unwrap()
    }

    /// What a run says of a gap.
    fn said(&self, simulator: &Simulator, gap: f64) -> NearGap {
        let mut there = simulator.clone();
        let q = DVector::from_element(1, gap - START * self.size);
        there.set_start(q, DVector::zeros(1)).unwrap();
        let rollout = there.rollout(&Controls::zeros(&there, 0)).unwrap();
        let report = rollout.gap_report();
        assert_eq!(report.nearest, report.worst);
        let near = report.nearest.unwrap();
        assert!((near.gap - gap).abs() < 1e-9 * self.size, "{}", self.name);
        near
    }

    /// Added mass along the gap, and its slope.
    fn along(&self, simulator: &Simulator, gap: f64) -> [f64; 2] {
        let q = DVector::from_element(1, gap - START * self.size);
        let stepper = simulator.stepper();
        let found = stepper.linearise(&q, 0.0).unwrap();
        let speed = DVector::from_element(1, 1.0);
        let force = found.inertial_force(&speed, &DVector::zeros(0)).unwrap();
        let dry = simulator.parameters().mass(0);
        [found.mass_matrix()[(0, 0)] - dry, -2.0 * force[0]]
    }
}

/// From a gap of one to a thousandth: what `auto` has there is estimated to be no worse than sources alone, but for 3 % where a film begins.
#[test]
fn what_auto_has_is_no_worse_than_sources_alone() {
    let auto = Settings::default().fidelity(Fidelity::Auto);
    for case in cases() {
        let [with, without] = [auto.clone(), auto.films(false)].map(|s| case.simulator(&s));
        let mut carried = Vec::new();
        for k in 0..=18 {
            let gap = 10f64.powf(-f64::from(k) / 6.0);
            let near = case.said(&with, gap * case.size);
            // There is no gap so narrow that nothing is said of it, but sources may refuse it.
            let gap = gap * case.size;
            let mut alone = without.clone();
            let q = DVector::from_element(1, gap - START * case.size);
            alone.set_start(q, DVector::zeros(1)).unwrap();
            carried.push(near.carried);
            let Ok(rollout) = alone.rollout(&Controls::zeros(&alone, 0)) else {
                continue;
            };
            let by_sources = rollout.gap_report().nearest.unwrap();
            assert_eq!(by_sources.carried, Carried::Sources);
            println!(
                "{} {gap:.4}: {} {:.3} {:.3}, sources {:.3} {:.3}",
                case.name,
                near.carried,
                near.added_mass_error,
                near.force_error,
                by_sources.added_mass_error,
                by_sources.force_error
            );
            assert!(
                near.force_error <= by_sources.force_error + 0.03,
                "{} {gap}: {near:?} {by_sources:?}",
                case.name
            );
        }
        // From sources to a film, and not back.
        let films = carried.iter().position(|c| *c == Carried::Film).unwrap();
        assert!(films > 0 && carried[films..].iter().all(|c| *c == Carried::Film));
    }
}

/// Where a film takes over the added mass and its slope go on, and so does the estimate; a run says when.
#[test]
fn a_film_takes_over_smoothly() {
    let full = Settings::default().fidelity(Fidelity::Full);
    let full = full.method(Method::Panel);
    let both = [Settings::default().fidelity(Fidelity::Auto), full];
    let all = cases().into_iter();
    for (case, settings) in all.flat_map(|case| both.clone().map(|s| (case.clone(), s))) {
        let simulator = case.simulator(&settings);
        let [mut film, mut sources] = [1e-3, 1.0].map(|gap| gap * case.size);
        while sources - film > 1e-7 * case.size {
            let middle = 0.5 * (film + sources);
            match case.said(&simulator, middle).carried {
                Carried::Film => film = middle,
                _ => sources = middle,
            }
        }
        let [near, far] = [film, sources].map(|gap| case.along(&simulator, gap));
        let jump = [0, 1].map(|k| (near[k] / far[k] - 1.0).abs());
        let [a, b] = [film, sources].map(|gap| case.said(&simulator, gap).force_error);
        println!(
            "{}: at {film:.4}, {:.1e} {:.1e}, {a:.4} {b:.4}",
            case.name, jump[0], jump[1]
        );
        assert!(jump[0] < 1e-5 && jump[1] < 1e-3, "{}: {jump:?}", case.name);
        assert!((a - b).abs() < 1e-4, "{}: {a} {b}", case.name);
    }
}

/// A ball that comes at a wall and goes again: a film comes once and goes once, and the trajectory has an estimate at every state.
#[test]
fn a_run_says_when_films_come_and_go() {
    for (fidelity, gap, without) in [
        (Fidelity::Auto, 0.02, Carried::Sources),
        (Fidelity::Full, 0.012, Carried::Panels),
    ] {
        comes_and_goes(fidelity, gap, without);
    }
}

/// The same with a gap of contact, in which there is a film, and what carries the water elsewhere.
fn comes_and_goes(fidelity: Fidelity, gap: f64, without: Carried) {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    let rail = Joint::Prismatic {
        axis: [0.0, 0.0, 1.0],
    };
    let spring = hydrograd::scene::Contact {
        stiffness: Some(2e4),
        gap: Some(gap),
        ..Default::default()
    };
    scene.contact = Some(spring);
    let ball = Body::new(Shape::sphere(0.1).faces(320)).named("ball");
    scene.add(ball.density(1000.0).at([0.0, 0.0, 0.2]).joint(rail));
    scene.initial.v = vec![-0.5];
    scene.time_step = 0.01;
    let settings = Settings::default().fidelity(fidelity);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 60)).unwrap();
    let report = rollout.summary().gaps;
    println!("{report:?}");
    assert_eq!(report.changes, 2);
    let [come, gone] = &report.first_changes[..] else {
        panic!("{report:?}");
    };
    assert_eq!((come.carried, gone.carried), (Carried::Film, without));
    assert!(0.0 < come.time && come.time < gone.time);
    assert_eq!(come.bodies, ("ball".into(), None));
    let nearest = report.nearest.unwrap();
    assert_eq!(Some(nearest.gap), rollout.summary().min_gap);
    assert!(report.worst.unwrap().force_error >= nearest.force_error);
    let errors = rollout.observe("gap_error").unwrap();
    assert_eq!(errors.shape(), (2, 61));
    assert!(errors.iter().all(|x| *x > 0.0 && *x < 1.0));
}

/// Small bodies beside a slab whose faces, and sources, are coarse for them: what runs say of the error isn't under a third of it, the truth being that beside a wall.
#[test]
fn small_bodies_beside_large_ones_are_told() {
    let by = |fidelity| Settings::default().fidelity(fidelity);
    let slab = |faces: usize| Shape::cuboid([2.0, 2.0, 0.2]).faces(faces);
    let mut worst = [0.0_f64; 2];
    for a in [0.2, 0.1, 0.05, 0.02] {
        let ball = ("ball", Shape::sphere(a), a);
        let cube = ("cube", Shape::cuboid([1.6 * a; 3]).faces(300), 0.8 * a);
        let disc = Shape::cylinder(1.3 * a, 0.6 * a).faces(320);
        for (name, shape, half) in [ball, cube, ("disc", disc, 0.3 * a)] {
            // Over a wall, or a slab of so many faces; it starts in a gap of `gap`.
            let case = |faces: Option<usize>, gap: f64| Case {
                name,
                shapes: [shape.clone()].into_iter().chain(faces.map(slab)).collect(),
                turns: [[0.0; 3]; 2],
                closed: half + faces.map_or(0.0, |_| 0.1),
                size: gap / START,
            };
            let prepared = |case: Case, fidelity| (case.simulator(&by(fidelity)), case);
            let (truth, wall) = prepared(case(None, a), Fidelity::Reduced);
            let [reduced, full] = [Fidelity::Reduced, Fidelity::Full]
                .map(|fidelity| prepared(case(Some(300), a), fidelity));
            for part in [2.0, 1.0, 0.5, 0.2, 0.05] {
                let gap = part * a;
                let true_ones = wall.along(&truth, gap);
                // `auto` chooses by the gap that it starts with.
                let auto = prepared(case(Some(1000), gap), Fidelity::Auto);
                for (by, (run, case)) in [("reduced", &reduced), ("auto", &auto), ("full", &full)] {
                    let found = case.along(run, gap);
                    let told = case.said(run, gap);
                    let off = [0, 1].map(|k| (found[k] / true_ones[k] - 1.0).abs());
                    let said = [told.added_mass_error, told.force_error];
                    println!("{name} {a}, gap {part}, {by}: off by {off:.3?}, told {said:.3?}");
                    for k in 0..2 {
                        worst[k] = worst[k].max(off[k] / said[k]);
                    }
                }
            }
        }
    }
    println!("at most {worst:.2?} of what is told");
    assert!(worst.iter().all(|w| *w < 3.0), "{worst:?}");
}

/// Flat bodies of few faces: compressed ones answer by faces that are fine enough for the gaps that their sources resolve, whatever they were given
/// (they were up to twice as heavy as they are, or had no solution), and what few faces leave of `full` is told. The truth is that by panels of 5,120 faces each, 0.3 %
/// from that by 2,560.
#[test]
fn few_flat_faces_are_told() {
    let mut worst = [0.0_f64; 2];
    for (gap, truth) in [
        (0.010, 0.1031),
        (0.007, 0.1170),
        (0.004, 0.1498),
        (0.002, 0.2188),
    ] {
        for faces in [80, 160, 320] {
            let scene = || {
                let mut scene = Scene::new(Fluid {
                    density: 1000.0,
                    current: [0.0; 3],
                });
                let rail = Joint::Prismatic {
                    axis: [0.0, 0.0, 1.0],
                };
                let cube = Body::new(Shape::cuboid([0.05; 3]).faces(faces)).joint(rail);
                scene.add(cube.density(1000.0));
                let brick = Body::new(Shape::cuboid([0.06, 0.08, 0.02]).faces(faces));
                let brick = brick.joint(Joint::Fixed).at([0.0, 0.0, 0.035 + gap]);
                scene.add(brick.density(1000.0));
                scene
            };
            for (k, fidelity) in [Fidelity::Full, Fidelity::Reduced].into_iter().enumerate() {
                let settings = Settings::default().fidelity(fidelity);
                let simulator = Simulator::new(&scene(), settings).unwrap();
                let (start, _) = simulator.start();
                let at = simulator.equations(start).unwrap();
                let added = at.mass_matrix().unwrap()[(0, 0)] - simulator.parameters().mass(0);
                let off = (added / truth - 1.0).abs();
                let rollout = simulator.rollout(&Controls::zeros(&simulator, 0)).unwrap();
                let told = rollout.gap_report().nearest.unwrap().added_mass_error;
                println!("{fidelity} {faces} {gap}: {off:.3}, told {told:.3}");
                worst[k] = worst[k].max(off / told);
                assert!(
                    fidelity == Fidelity::Full || off < 0.16,
                    "{faces} {gap}: {off}"
                );
            }
        }
    }
    println!("at most {worst:.2?} of what is told");
    assert!(worst.iter().all(|w| *w < 3.0), "{worst:?}");
}
