//! Films in gaps that compressed bodies don't resolve.

use crate::support::reference::multipoles;
use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape};
use hydrograd::simulate::Method;
use hydrograd::{Fidelity, Settings, Simulator};
use nalgebra::DVector;

fn films() -> Settings {
    Settings::default().fidelity(Fidelity::Reduced)
}

fn unit_water() -> Fluid {
    Fluid {
        density: 1.0,
        current: [0.0; 3],
    }
}

/// The mass of either of two spheres and between them, along the gap and across, against multipoles; with `auto` as well.
#[test]
fn two_spheres_down_to_a_hundredth() {
    for fidelity in [Fidelity::Reduced, Fidelity::Auto] {
        for gap in [0.1, 0.05, 0.03, 0.01] {
            let mut scene = Scene::new(unit_water());
            for z in [0.0, 2.0 + gap] {
                let ball = Shape::sphere(1.0).faces(1280);
                scene.add(Body::new(ball).density(1.0).at([0.0, 0.0, z]));
            }
            let simulator = Simulator::new(&scene, films().fidelity(fidelity)).unwrap();
            assert_eq!(simulator.fidelity(), Fidelity::Reduced);
            let m = simulator.added_mass().unwrap().matrix;
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
                println!("{fidelity:?}, gap {gap}, {at:?}: {error:.1e}");
                assert!(error < 0.025, "gap {gap}, {at:?}: {} for {exact}", m[at]);
            }
            assert_eq!(simulator.warnings().len(), 0, "{:?}", simulator.warnings());
        }
    }
}

/// A disc, radius 1 and thickness 0.25, flat over a wall: mass along the gap against rings of sources on the exact surface (`cargo bench --bench gap -- --references`). Without films it
/// is off by 4 and 85 %, and refused from there on.
#[test]
fn a_disc_flat_over_a_wall() {
    let converged = [
        (0.1, 7.4877),
        (0.05, 11.9338),
        (0.025, 20.3838),
        (0.01, 44.8002),
    ];
    for (gap, converged) in converged {
        let mut scene = Scene::new(unit_water());
        scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
        let disc = Shape::cylinder(1.0, 0.25).faces(1280);
        scene.add(Body::new(disc).density(1.0).at([0.0, 0.0, 0.125 + gap]));
        let mass = |settings: Settings| {
            let simulator = Simulator::new(&scene, settings)?;
            Ok::<_, hydrograd::Error>(simulator.added_mass()?.matrix[(2, 2)])
        };
        let error = mass(films()).unwrap() / converged - 1.0;
        println!("gap {gap}: {error:+.4}");
        assert!(error.abs() < 0.03, "gap {gap}: {error}");
        if gap < 0.1 {
            let without = mass(films().films(false));
            assert!(without.map_or(true, |m| (m / converged - 1.0).abs() > 0.5));
        }
    }
}

/// Like bodies that lie flat on one another have like masses: where one's face ends so does the other's, and nothing of the film is beside it. Largest difference of any
/// entry from coupled panels, relative to √(M_ii M_jj), and of both bodies' own blocks from one another.
#[test]
fn like_bodies_flat_on_one_another_are_alike() {
    let cube = Shape::cuboid([0.2; 3]).faces(1280);
    let disc = Shape::cylinder(0.1, 0.05).faces(1280);
    for (name, shape, half) in [("cubes", cube, 0.1), ("discs", disc, 0.025)] {
        for gap in [0.02, 0.01, 0.005] {
            let mut scene = Scene::new(unit_water());
            for z in [0.0, 2.0 * half + gap] {
                scene.add(Body::new(shape.clone()).density(1.0).at([0.0, 0.0, z]));
            }
            let matrix = |settings: Settings| {
                let simulator = Simulator::new(&scene, settings).unwrap();
                simulator.added_mass().unwrap().matrix
            };
            let full = Settings::default().fidelity(Fidelity::Full);
            let panels = matrix(full.method(Method::Panel));
            let scale = |i: usize, j: usize| f64::sqrt(panels[(i, i)] * panels[(j, j)]);
            for fidelity in [Fidelity::Reduced, Fidelity::Auto] {
                let m = matrix(films().fidelity(fidelity));
                let (mut off, mut unlike) = (0.0_f64, 0.0_f64);
                // Spinning about the axis of a disc moves no water.
                for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (i, j))) {
                    for (a, b) in [(i, j), (i, 6 + j), (6 + i, 6 + j)] {
                        off = off.max((m[(a, b)] - panels[(a, b)]).abs() / scale(a, b));
                    }
                    if i == j {
                        unlike = unlike.max((m[(i, i)] / m[(6 + i, 6 + i)] - 1.0).abs());
                    }
                }
                println!("{name}, gap {gap}, {fidelity:?}: off by {off:.3}, unlike {unlike:.3}");
                assert!(off < 0.15 && unlike < 0.1, "{name} {gap}: {off} {unlike}");
            }
        }
    }
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

/// Where surfaces are near one another over little: the force between a box's edge and a wall, crossed capsules, and spheres down to a hundredth of an edge of their faces, against
/// graded facets (`cargo bench --bench gap -- --references`, sure to 0.2 to 0.6 %) and the series of images.
#[test]
fn forces_at_edges_and_between_round_bodies() {
    let quarter = std::f64::consts::FRAC_PI_4;
    let (brick, capsule) = (Shape::cuboid([1.0, 1.0, 0.5]), Shape::capsule(0.25, 1.0));
    let edge = |gap: f64| {
        let mut scene = Scene::new(unit_water());
        scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
        let up = Joint::Prismatic {
            axis: [0.0, quarter.sin(), quarter.cos()],
        };
        let body = Body::new(brick.clone().faces(1280)).density(1.0).joint(up);
        let height = 0.75 / f64::sqrt(2.0) + gap;
        scene.add(body.at([0.0, 0.0, height]).rotated([quarter, 0.0, 0.0]));
        scene
    };
    let crossed = |gap: f64| {
        let mut scene = Scene::new(unit_water());
        let body = || Body::new(capsule.clone().faces(1280)).density(1.0);
        let up = Joint::Prismatic {
            axis: [-1.0, 0.0, 0.0],
        };
        let upper = body().joint(up).at([0.0, 0.0, 0.5 + gap]);
        scene.add(upper.rotated([0.0, 2.0 * quarter, 0.0]));
        let lower = body().joint(Joint::Fixed);
        scene.add(lower.rotated([2.0 * quarter, 0.0, 0.0]));
        scene
    };
    let over_wall = |gap: f64| {
        let mut scene = Scene::new(unit_water());
        scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
        let up = Joint::Prismatic {
            axis: [0.0, 0.0, 1.0],
        };
        let ball = Body::new(Shape::sphere(1.0).faces(1280))
            .density(1.0)
            .joint(up);
        scene.add(ball.at([0.0, 0.0, 1.0 + gap]));
        scene
    };
    let cases: [(&str, Scene, [f64; 2]); 8] = [
        ("edge", edge(0.05), [0.498090, -0.520291]),
        ("edge", edge(0.0125), [0.522475, -0.830788]),
        ("edge", edge(0.005), [0.529204, -0.976325]),
        ("capsules", crossed(0.025), [0.226979, -0.241472]),
        ("capsules", crossed(0.00625), [0.233070, -0.465374]),
        ("capsules", crossed(0.0025), [0.235074, -0.630183]),
        ("sphere", over_wall(0.01), [3.245_75, -8.801_66]),
        ("sphere", over_wall(0.001), [3.345_03, -15.803_26]),
    ];
    for (name, scene, exact) in cases {
        let found = along(&scene, films());
        let off = [0, 1].map(|k| found[k] / exact[k] - 1.0);
        println!("{name}: {:+.4} of M, {:+.4} of its slope", off[0], off[1]);
        assert!(off[0].abs() < 0.015, "{name}: {found:?} for {exact:?}");
        assert!(off[1].abs() < 0.08, "{name}: {found:?} for {exact:?}");
    }
}

/// Two spheres a thousandth of a radius apart: the slope by the series of images; a smaller tolerance has finer faces for the film.
#[test]
fn a_smaller_tolerance_has_finer_films() {
    let mut scene = Scene::new(unit_water());
    let ball = || Body::new(Shape::sphere(1.0).faces(1280)).density(1.0);
    let up = Joint::Prismatic {
        axis: [0.0, 0.0, 1.0],
    };
    scene.add(ball().joint(up).at([0.0, 0.0, 2.001]));
    scene.add(ball().joint(Joint::Fixed));
    let exact = [2.414_9, -4.163_7];
    for (settings, bound) in [(films(), 0.18), (films().accuracy(1e-3), 0.07)] {
        let found = along(&scene, settings);
        let off = [0, 1].map(|k| found[k] / exact[k] - 1.0);
        println!("{:+.4} of M, {:+.4} of its slope", off[0], off[1]);
        assert!(off[0].abs() < 0.005, "{found:?} for {exact:?}");
        assert!(off[1].abs() < bound, "{found:?} for {exact:?}");
    }
}

/// A prism tilted over a plate: whole matrices against coupled panels, in which the film is nearer than what was without.
#[test]
fn a_tilted_prism_over_a_plate() {
    let mut scene = Scene::new(unit_water());
    let plate = Shape::cuboid([1.6, 1.6, 0.4]).faces(720);
    let wedge = Shape::prism([[-0.3, -0.15], [0.3, -0.15], [0.2, 0.2], [-0.2, 0.2]], 0.7);
    scene.add(Body::new(plate).named("plate").density(1.0));
    let wedge = Body::new(wedge.faces(720)).named("wedge").density(1.0);
    scene.add(
        wedge
            .at([0.1, 0.05, 0.2 + 0.15 + 0.04])
            .rotated([0.04, 0.0, 0.0]),
    );
    let mass = |settings: Settings| {
        let simulator = Simulator::new(&scene, settings).unwrap();
        simulator.added_mass().unwrap().matrix
    };
    let panels = Settings::default().fidelity(Fidelity::Full);
    let exact = mass(panels.method(Method::Panel));
    let size = |i: usize, j: usize| (exact[(i, i)] * exact[(j, j)]).sqrt();
    let off = |settings: Settings| {
        let m = mass(settings);
        let of = |i: usize| (0..12).map(move |j| (i, j));
        let all = (0..12).flat_map(of);
        all.map(|(i, j)| (m[(i, j)] - exact[(i, j)]).abs() / size(i, j))
            .fold(0.0, f64::max)
    };
    let (with, without) = (off(films()), off(films().films(false)));
    println!("with films {with:.3}, without {without:.3}");
    assert!(with < 0.1 && with < without, "{with} {without}");
}

/// A coin that comes near something larger: its mass has no jump, neither where a film sets in, which is where the coin's rim lets it, nor further on.
#[test]
fn nothing_jumps_as_a_film_sets_in() {
    let mut scene = Scene::new(unit_water());
    let plate = Shape::cuboid([1.6, 1.6, 0.8]).faces(320);
    let coin = Shape::ellipsoid([0.2, 0.2, 0.05]).faces(320);
    scene.add(Body::new(plate).density(1.0).joint(Joint::Fixed));
    let up = Joint::Prismatic {
        axis: [0.0, 0.0, 1.0],
    };
    let coin = Body::new(coin).density(1.0).joint(up);
    scene.add(coin.at([0.3, 0.2, 0.6]).rotated([0.3, 0.0, 0.0]));
    let mut simulator = Simulator::new(&scene, films()).unwrap();
    const STEPS: usize = 400;
    let mut masses = Vec::with_capacity(STEPS);
    for k in 0..STEPS {
        let q = 0.25 * (k as f64 / STEPS as f64) - 0.06;
        let at = DVector::from_element(1, q);
        simulator.set_start(at, DVector::zeros(1)).unwrap();
        let m = simulator.added_mass().unwrap().matrix;
        masses.push([m[(8, 8)], m[(2, 2)], m[(2, 8)]]);
    }
    for (c, name) in ["coin", "plate", "between"].iter().enumerate() {
        let third = |w: &[[f64; 3]]| (w[3][c] - 3.0 * (w[2][c] - w[1][c]) - w[0][c]).abs();
        let worst = masses.windows(4).map(third).fold(0.0, f64::max);
        let most = masses.iter().fold(0.0_f64, |most, m| most.max(m[c].abs()));
        println!("{name}: {:.1e} of {most:.3e}", worst / most);
        assert!(worst < 1e-5 * most, "{name}: {worst} of {most}");
    }
}

/// Where it has no effect, and where the gap is too narrow for the faces, that is said.
#[test]
fn what_films_do_not_do_is_said() {
    let mut scene = Scene::new(unit_water());
    for z in [0.0, 2.0005] {
        let ball = Shape::sphere(1.0).faces(320);
        scene.add(Body::new(ball).density(1.0).at([0.0, 0.0, z]));
    }
    let simulator = |settings| Simulator::new(&scene, settings).unwrap();
    let said = simulator(films()).start_gap_warning().unwrap();
    assert!(said.contains("by a film, may be off by"), "{said}");
    assert!(said.contains("body 1") && said.contains("edges"), "{said}");
    let isolated = simulator(films().films(false).fidelity(Fidelity::Isolated));
    let warnings = isolated.warnings().join("\n");
    assert!(warnings.contains("films has no effect"), "{warnings}");
    let full = films().films(false).fidelity(Fidelity::Full);
    for (method, told) in [(Method::MfsVertex, true), (Method::Panel, false)] {
        let warnings = simulator(full.clone().method(method)).warnings().join("\n");
        let found = warnings.contains("films has no effect with the method");
        assert_eq!(found, told, "{warnings}");
    }
}

/// A block that turns about the normal over the rim of a plate: what a force does at the largest of its steps between 300 angles goes to nothing as the step does.
#[test]
fn films_over_a_rim_feel_no_jump() {
    for (thickness, gap, offset) in [(0.02, 3e-3, 0.17), (0.04, 3e-3, 0.17), (0.02, 2e-3, 0.16)] {
        let mut scene = Scene::new(unit_water());
        let plate = Shape::cuboid([0.4, 0.4, 0.02]).faces(600);
        scene.add(Body::new(plate).density(1.5).joint(Joint::Fixed));
        let block = Shape::cuboid([0.1, 0.1, thickness]).faces(200);
        let height = 0.01 + 0.5 * thickness + gap;
        scene.add(Body::new(block).density(1.5).at([offset, 0.0, height]));
        let simulator = Simulator::new(&scene, films()).unwrap();
        let v = DVector::from_vec(vec![0.1, 0.05, 0.3, 0.5, 0.7, 0.3]);
        let acceleration = |angle: f64| {
            let mut xi = DVector::zeros(6);
            xi[5] = angle;
            let q = simulator.integrate(simulator.start().0, &xi).unwrap();
            let equations = simulator.equations(&q).unwrap();
            let none = DVector::zeros(6);
            let found = equations.acceleration(&v, &simulator.no_control(), &none, &none);
            found.unwrap()
        };
        let angles: Vec<f64> = (0..300).map(|k| 5e-3 * f64::from(k)).collect();
        let all: Vec<DVector<f64>> = angles.iter().map(|a| acceleration(*a)).collect();
        let step = |k: &usize| (&all[k + 1] - &all[*k]).norm();
        let mut worst: Vec<usize> = (0..angles.len() - 1).collect();
        worst.sort_by(|a, b| step(b).total_cmp(&step(a)));
        for k in &worst[..2] {
            let (mut low, mut high) = (angles[*k], angles[k + 1]);
            let (mut at_low, mut at_high) = (all[*k].clone(), all[k + 1].clone());
            for _ in 0..24 {
                let middle = 0.5 * (low + high);
                let at = acceleration(middle);
                match (&at - &at_low).norm() > (&at_high - &at).norm() {
                    true => (high, at_high) = (middle, at),
                    false => (low, at_low) = (middle, at),
                }
            }
            let jump = (&at_high - &at_low).norm() / at_low.norm();
            println!("{thickness}, {gap}, {offset}: {jump:.1e} at {low}");
            assert!(
                jump < 1e-7,
                "{jump} at {low} of {thickness}, {gap}, {offset}"
            );
        }
    }
}
