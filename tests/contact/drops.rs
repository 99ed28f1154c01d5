//! Bodies that fall, rest, meet and land in water: bounds, conservation, and many drops at random.

use super::tools::{above_floor, contact, touching};
use crate::support::falling::drops;
use crate::support::{self, check_gradient, run, says};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::{Body, Contact, Fluid, Joint, Plane, Scene, Shape};
use hydrograd::{Controls, Fidelity, Settings, Simulator};
use rayon::prelude::*;

fn simulator(scene: &Scene) -> Simulator {
    support::simulator(scene, Fidelity::Isolated, Integrator::MomentumEuler)
}

/// On the way down and up, no step adds energy: kinetic, of position, and of the compressed contact.
#[test]
fn contact_never_adds_energy() {
    for (dissipation, dt) in [(0.0, 0.01), (0.5, 0.01), (0.5, 0.001)] {
        let mut scene = above_floor(0.0);
        scene.time_step = dt;
        scene.add(
            Body::new(Shape::cuboid([0.3, 0.2, 0.1]))
                .density(1000.0)
                .at([0.0, 0.0, 0.5])
                .rotated([0.3, 0.4, 0.0]),
        );
        scene.initial.v = vec![0.5, 0.0, 0.0, 1.0, 2.0, 0.5];
        contact(&mut scene).stiffness = Some(2e4);
        contact(&mut scene).dissipation = dissipation;
        let simulator = simulator(&scene);
        let rollout = run(&simulator, (2.0 / dt) as usize);
        let energy: Vec<f64> = rollout.samples().iter().map(|s| s.energy()).collect();
        let highest = energy.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        assert!(
            highest <= energy[0] * (1.0 + 1e-3),
            "{highest} from {}",
            energy[0]
        );
        let last = energy[energy.len() - 1];
        assert!(last < 0.6 * energy[0], "{last}");
    }
}

#[test]
fn a_stack_of_three_rests_for_ten_seconds() {
    let mut scene = above_floor(0.0);
    for k in 0..3 {
        scene.add(
            Body::new(Shape::cuboid([0.2, 0.2, 0.1]))
                .density(1000.0)
                .at([0.0, 0.0, 0.053 + 0.103 * f64::from(k)]),
        );
    }
    let simulator = simulator(&scene);
    let rollout = run(&simulator, 1000);
    for b in 0..3 {
        let at = |n: usize| rollout.samples()[n].poses[b].translation;
        let drift = (at(1000) - at(50)).norm();
        assert!(drift < 1e-4, "body {b} drifts by {drift} m");
    }
}

/// Two equal balls: momentum to the last digits, and the velocities change places as the contact is resolved in time.
#[test]
fn balls_that_meet_head_on() {
    let mut passed = Vec::new();
    for dt in [1e-3, 1e-4] {
        let mut scene = touching(0.0);
        scene.gravity = [0.0; 3];
        scene.time_step = dt;
        let rail = Joint::Prismatic {
            axis: [1.0, 0.0, 0.0],
        };
        for x in [-0.15, 0.15] {
            scene.add(
                Body::new(Shape::sphere(0.1))
                    .density(1000.0)
                    .at([x, 0.0, 0.0])
                    .joint(rail),
            );
        }
        scene.initial.v = vec![1.0, 0.0];
        let c = contact(&mut scene);
        (c.stiffness, c.dissipation, c.friction) = (Some(2e4), 0.0, 0.0);
        let simulator = simulator(&scene);
        let rollout = run(&simulator, (0.3 / dt) as usize);
        let end = &rollout.samples()[rollout.steps()].v;
        let momentum = end[0] + end[1];
        assert!((momentum - 1.0).abs() < 1e-12, "{momentum}");
        passed.push(end[1]);
    }
    // Euler's loss falls with the step.
    assert!(
        passed[1] > 0.9 && 1.0 - passed[1] < 0.25 * (1.0 - passed[0]),
        "{passed:?}"
    );
}

/// In water the gap at which surfaces touch is what the coupling resolves, and the ball that lands carries its added mass.
/// Compressed, without films.
fn by_sources(scene: &Scene) -> Simulator {
    let settings = Settings::default().fidelity(Fidelity::Reduced).films(false);
    Simulator::new(scene, settings.integrator(Integrator::MomentumEuler)).unwrap()
}

#[test]
fn a_ball_lands_in_water() {
    let mut scene = above_floor(1000.0);
    scene.add(
        Body::new(Shape::sphere(0.1))
            .density(3000.0)
            .at([0.0, 0.0, 0.3])
            .joint(Joint::Planar { plane: Plane::Zx }),
    );
    let mut simulator = by_sources(&scene);
    let resolved = simulator.discretisation()[0].resolved_gap.unwrap();
    let rollout = run(&simulator, 200);
    let gap = rollout.samples()[200].poses[0].translation.z - 0.1;
    assert!(
        (gap - 1.25 * 0.5 * resolved).abs() < 5e-4,
        "{gap}, resolved {resolved}"
    );
    assert!(rollout.warnings().is_empty(), "{:?}", rollout.warnings());
    drop(rollout);
    check_gradient("a ball in water", &mut simulator, 60, 1, 1e-5);
}

/// Where gaps have films, or panels, it is a hundredth of the body, and the same for all: the ball lands there, and can be differentiated.
#[test]
fn a_ball_lands_through_a_film() {
    let mut scene = above_floor(1000.0);
    scene.add(
        Body::new(Shape::sphere(0.1).faces(1280))
            .density(3000.0)
            .at([0.0, 0.0, 0.2])
            .joint(Joint::Planar { plane: Plane::Zx }),
    );
    let with = |fidelity| {
        let settings = Settings::default().fidelity(fidelity);
        let settings = settings.integrator(Integrator::MomentumEuler);
        Simulator::new(&scene, settings).unwrap()
    };
    for fidelity in [Fidelity::Reduced, Fidelity::Auto, Fidelity::Full] {
        let simulator = with(fidelity);
        assert_eq!(simulator.contact_gaps()[0].gap, 1e-3);
        let told = simulator.warnings().join("\n");
        match fidelity {
            // Panels with a film do resolve a hundredth of the radius.
            Fidelity::Full => assert_eq!(told, ""),
            // Compressed bodies don't, to a percent.
            _ => says(told, &["body 0", "1.000e-3 m", "faces' edges", "check_gap"]),
        }
    }
    let mut simulator = with(Fidelity::Reduced);
    let rollout = run(&simulator, 100);
    let gap = rollout.samples()[100].poses[0].translation.z - 0.1;
    println!("rests at {gap:.4e}");
    assert!((gap - 1e-3).abs() < 3e-4, "{gap}");
    drop(rollout);
    check_gradient("a ball through a film", &mut simulator, 40, 1, 1e-5);
}

/// A plate that lands flat carries water that is hundreds of times as heavy, and steps are cut as its film closes: it gains no energy, and next to nothing comes back. A pebble beside it
/// makes the gap of contact small.
#[test]
fn plates_land_and_stay() {
    let tile = Shape::cuboid([0.1, 0.1, 0.002]);
    let plate = Shape::cuboid([0.3, 0.3, 0.004]);
    let coin = Shape::cylinder(0.05, 0.01);
    for (name, shape, half, gap) in [
        ("tile", &tile, 0.001, None),
        ("plate", &plate, 0.002, None),
        (
            "plate at a tenth of a millimetre",
            &plate,
            0.002,
            Some(1e-4),
        ),
        ("coin", &coin, 0.005, None),
    ] {
        for dt in [0.01, 0.005, 0.001] {
            let mut scene = above_floor(1000.0);
            scene.time_step = dt;
            contact(&mut scene).gap = gap;
            let body = Body::new(shape.clone().faces(320)).named("plate");
            scene.add(body.density(2700.0).at([0.0, 0.0, 0.05]));
            let pebble = Body::new(Shape::sphere(0.02).faces(320)).density(2500.0);
            scene.add(pebble.at([-0.5, 0.0, 0.05]));
            let settings = Settings::default().fidelity(Fidelity::Auto);
            let simulator = Simulator::new(&scene, settings).unwrap();
            let rollout = run(&simulator, (1.2 / dt) as usize);
            let samples = rollout.samples();
            let energy: Vec<f64> = samples.iter().map(|s| s.energy()).collect();
            let height = |k: usize| samples[k].poses[0].translation.z - half;
            let landed = (0..samples.len()).find(|k| height(*k) < 1e-3);
            let rebound = landed.map(|k| (k..samples.len()).map(height).fold(0.0, f64::max));
            let most = energy.iter().fold(0.0_f64, |a, b| a.max(*b));
            println!(
                "{name}, {dt} s: energy at most {most:.4} of {:.4} J, landed {landed:?}, back to {rebound:?} m, {:?} pieces at most",
                energy[0],
                rollout.pieces().iter().max()
            );
            assert!(most < 1.002 * energy[0], "{name} {dt}: {most}");
            assert!(rebound.is_none_or(|r| r < 4e-3), "{name} {dt}: {rebound:?}");
        }
    }
}

/// The gaps at which surfaces touch can be read, and one over a twentieth of a body is told.
#[test]
fn gaps_of_contact_are_told() {
    let mut scene = above_floor(1000.0);
    scene.add(
        Body::new(Shape::sphere(0.1))
            .density(3000.0)
            .at([0.0, 0.0, 0.3]),
    );
    let of = |scene: &Scene, fidelity| {
        let simulator = match fidelity {
            Fidelity::Reduced => by_sources(scene),
            _ => support::simulator(scene, fidelity, Integrator::MomentumEuler),
        };
        let [gap] = simulator.contact_gaps()[..] else {
            panic!("one pair expected");
        };
        assert_eq!((gap.first, gap.second), (0, None));
        assert!((gap.part - gap.gap / 0.2).abs() < 1e-12);
        assert_eq!(run(&simulator, 1).summary().contact_gap, Some(gap.gap));
        let told = |w: &&String| w.contains("touch at a gap");
        (gap.gap, simulator.warnings().iter().find(told).cloned())
    };
    let (gap, told) = of(&scene, Fidelity::Isolated);
    assert!(
        (gap - 1e-3).abs() < 1e-12 && told.is_none(),
        "{gap} {told:?}"
    );
    let (gap, told) = of(&scene, Fidelity::Reduced);
    assert!(gap > 0.01, "{gap}");
    says(
        told.unwrap(),
        &[
            "body \"body 0\"",
            "a wall",
            "resolves no less",
            "contact.gap",
        ],
    );
    contact(&mut scene).gap = Some(0.02);
    let (gap, told) = of(&scene, Fidelity::Isolated);
    assert_eq!(gap, 0.02);
    says(
        told.unwrap(),
        &["2.000e-2 m", "10 %", "as contact.gap says"],
    );
}

#[test]
fn constants_are_checked_by_name() {
    for (key, value) in [
        ("stiffness", "-1.0"),
        ("friction", "-0.1"),
        ("torsional_friction", "-0.1"),
        ("rolling_friction", "inf"),
        ("gap", "nan"),
        ("width", "0.0"),
    ] {
        let text = format!(
            "time_step = 0.01\nsteps = 1\n[fluid]\ndensity = 0.0\n[contact]\n{key} = {value}\n[[bodies]]\nname = \"a\"\nshape = {{ kind = \"sphere\", radius = 0.1 }}\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\njoint = {{ kind = \"free\" }}\n"
        );
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scene.toml");
        std::fs::write(&file, text).unwrap();
        let said = Scene::load(&file)
            .and_then(|s| s.validate())
            .unwrap_err()
            .to_string();
        assert!(said.contains(&format!("contact.{key}")), "{said}");
    }
}

/// What came of a drop.
struct Dropped {
    /// Smallest gap of full weight, m.
    deepest: f64,
    /// How far contact acts, less what may be lost of it in a step, m: each body's ½ r θ² by which a point that turns leaves its
    /// tangent, and a tenth of the way that its points go, since contact takes ten elevenths of what would go too far.
    bound: f64,
    /// Largest kinetic energy over the energy at the start.
    kinetic: f64,
    /// Largest angle that a body turns by in a step, rad.
    turn: f64,
    /// Whether the bodies met.
    met: bool,
    /// Steps that were cut, and the most pieces of one.
    pieces: (usize, usize),
}

fn dropped(scene: &Scene, duration: f64) -> hydrograd::Result<Dropped> {
    let simulator = simulator(scene);
    let dt = simulator.time_step();
    let steps = (duration / dt).round() as usize;
    let rollout = simulator.rollout(&Controls::zeros(&simulator, steps))?;
    let model = simulator.system().contact.as_ref().unwrap();
    let first = rollout.samples()[0].energy();
    let mut out = Dropped {
        deepest: f64::INFINITY,
        bound: model.gaps().map(|g| g.gap).fold(f64::INFINITY, f64::min),
        kinetic: 0.0,
        turn: 0.0,
        met: false,
        pieces: {
            let summary = rollout.summary();
            (summary.cut_steps, summary.most_pieces)
        },
    };
    let mut lost = [0.0_f64; 2];
    for sample in rollout.samples() {
        assert!(
            sample
                .q
                .iter()
                .chain(sample.v.iter())
                .all(|x| x.is_finite())
        );
        out.kinetic = out.kinetic.max(sample.kinetic_energy / first);
        for (b, lost) in lost.iter_mut().enumerate() {
            let radius = model.shapes.radius(b).unwrap();
            let turn = sample.v.fixed_rows::<3>(6 * b + 3).norm() * dt;
            let moved = sample.v.fixed_rows::<3>(6 * b).norm() * dt;
            out.turn = out.turn.max(turn);
            *lost = lost.max(0.5 * radius * turn * turn + 0.1 * (moved + radius * turn));
        }
        for pair in model.shapes.pairs() {
            let gap = model.laws.of(&pair).gap;
            for p in model.shapes.points(&pair, &sample.poses, gap)? {
                if p.weight >= 0.5 {
                    out.deepest = out.deepest.min(p.gap);
                }
                // Surfaces that slide at v ride τ μ v above the gap.
                let ride = 0.5 * dt * 4.0;
                out.met |= p.gap < ride + gap && pair.second_body().is_some();
            }
        }
    }
    out.bound -= lost[0] + lost[1];
    Ok(out)
}

/// All drops: none fails, none takes off, none sinks in deeper than `depth`, nor, unless bodies turn too far in a step for it, than its
/// bound.
fn all_hold(scenes: &[Scene], duration: f64, depth: f64, bounded: bool) {
    let ends: Vec<_> = scenes.par_iter().map(|s| dropped(s, duration)).collect();
    let (mut deepest, mut kinetic, mut turn, mut met) = (f64::INFINITY, 0.0_f64, 0.0_f64, 0);
    let (mut cut, mut most) = (0, 1);
    let mut failed = Vec::new();
    for (drop, end) in ends.iter().enumerate() {
        let end = match end {
            Ok(end) => end,
            Err(error) => {
                failed.push(format!("drop {drop}: {error}"));
                continue;
            }
        };
        if bounded && end.deepest < end.bound {
            failed.push(format!(
                "drop {drop}: gap {} m, bound {} m",
                end.deepest, end.bound
            ));
        }
        if end.kinetic > 1.0 {
            failed.push(format!(
                "drop {drop}: kinetic energy {} of all there was, pieces {:?}",
                end.kinetic, end.pieces
            ));
        }
        deepest = deepest.min(end.deepest);
        kinetic = kinetic.max(end.kinetic);
        turn = turn.max(end.turn);
        met += usize::from(end.met);
        cut += end.pieces.0;
        most = most.max(end.pieces.1);
    }
    println!(
        "{} drops, Δt {} s: smallest gap {:.2} mm; bodies meet in {met}; they turn by up to {turn:.2} rad a step; largest kinetic energy {kinetic:.3} of all at the start; {cut} steps cut, into at most {most}; {} failed",
        scenes.len(),
        scenes[0].time_step,
        1e3 * deepest,
        failed.len()
    );
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(kinetic <= 1.0, "kinetic energy {kinetic} of all there was");
    assert!(
        deepest >= -depth,
        "a body is {} m deep, over {depth} m",
        -deepest
    );
    assert!(5 * met > scenes.len(), "they meet in {met} alone");
}

/// At most 1.5 mm deep, of bodies 10 to 50 cm long: a point 0.2 m out that turns by 0.11 rad leaves its tangent by 1.2 mm in the step.
#[test]
fn random_drops() {
    all_hold(&drops(300, 2.5e-3, true), 0.4, 1.5e-3, true);
}

/// A thousand of those, and a thousand thrown at one another.
#[test]
#[ignore = "over a minute"]
fn a_thousand_random_drops() {
    all_hold(&drops(1000, 2.5e-3, true), 0.4, 1.5e-3, true);
    all_hold(&drops(1000, 0.01, true), 1.0, 3e-2, false);
    all_hold(&drops(1000, 0.01, false), 1.0, 1.5e-2, true);
}

/// Steps of a hundredth of a second, in which bodies turn by up to 0.4 rad and leave their tangents by a centimetre.
#[test]
fn random_drops_at_a_long_step() {
    all_hold(&drops(300, 0.01, false), 1.0, 1.5e-2, true);
}

/// Balls that start in one another are told so, and that contact is what parts them; energy that comes from there isn't put down to the time step.
#[test]
fn balls_that_start_in_one_another_are_told_what_is_so() {
    let mut scene = Scene::new(Fluid::fresh_water());
    (scene.time_step, scene.contact) = (0.01, Some(Default::default()));
    for z in [0.1, 0.3 - 1e-6] {
        scene.add(
            Body::new(Shape::sphere(0.1))
                .density(2000.0)
                .at([0.0, 0.0, z]),
        );
    }
    let simulator =
        Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated)).unwrap();
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 20)).unwrap();
    let told = rollout.warnings().join("\n");
    says(
        &told,
        &[
            "1.000e-6 m",
            "nothing but contact keeps them apart",
            "start pressed together",
        ],
    );
    assert!(!told.contains("time step"), "{told}");
}

/// Small heavy bodies set down on the floor rest in the gap that they have by default, at long steps as well.
#[test]
fn small_heavy_balls_rest_in_their_gap() {
    for (radius, dt) in [(0.02, 0.02), (0.008, 0.01), (0.02, 0.01)] {
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.gravity = [0.0, 0.0, -9.81];
        scene.time_step = dt;
        scene.contact = Some(Contact::default());
        scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
        let ball = Body::new(Shape::sphere(radius)).density(7800.0);
        scene.add(ball.at([0.0, 0.0, 1.015 * radius]));
        let simulator = Simulator::new(&scene, Settings::default()).unwrap();
        let rollout = simulator.rollout(&Controls::zeros(&simulator, 50)).unwrap();
        let gap = rollout.gaps()[50].unwrap().distance;
        println!(
            "{radius} m, {dt} s: {:.3} of the gap",
            gap / (0.01 * radius)
        );
        assert!(gap > 0.4 * 0.01 * radius && gap < 0.01 * radius, "{gap}");
    }
}
