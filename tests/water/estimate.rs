//! Error estimates against true errors, where those are known. `cargo test --release --test water estimate
//! -- --nocapture` prints the tables of `docs/accuracy-estimate.md`; with `--ignored` those with finer
//! meshes.

use crate::support::reference::{
    SphereByWall, TwoSpheres, data, equal_spheres, lamb, number, rows, spheres_by_wall,
    unequal_spheres,
};
use hydrograd::adjoint::lie::Vec3;
use hydrograd::scene::{Placement, Shape};
use hydrograd::simulate::Method;
use hydrograd::{Body, Fidelity, Fluid, Scene, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;
use std::path::Path;

// Scenes with known added mass

/// A scene at unit density with its true added mass and its bodies' volumes.
struct Known {
    name: String,
    scene: Scene,
    truth: DMatrix<f64>,
    volumes: Vec<f64>,
}

fn scene(bodies: &[(Shape, Placement)]) -> Scene {
    let mut scene = Scene::new(Fluid {
        density: 1.0,
        ..Fluid::fresh_water()
    });
    for (shape, at) in bodies {
        let mut body = Body::new(shape.clone()).density(1.0);
        body.placement = *at;
        scene.add(body);
    }
    scene
}

fn at(position: [f64; 3]) -> Placement {
    Placement::new(position, [0.0; 3])
}

fn ball(radius: f64) -> f64 {
    4.0 / 3.0 * PI * radius.powi(3)
}

/// Lamb's ellipsoids.
fn ellipsoid(semi_axes: [f64; 3]) -> Known {
    let [a, b, c] = semi_axes;
    Known {
        name: format!("ellipsoid {a}:{b}:{c}"),
        scene: scene(&[(Shape::ellipsoid(semi_axes), at([0.0; 3]))]),
        truth: DMatrix::from_diagonal(&DVector::from_row_slice(&lamb(semi_axes))),
        volumes: vec![4.0 / 3.0 * PI * a * b * c],
    }
}

/// Two spheres along z.
fn spheres() -> Vec<Known> {
    let known = |pair: &TwoSpheres| Known {
        name: format!("spheres 1 and {}, gap {:.2}", pair.radius, pair.gap()),
        scene: scene(&[
            (Shape::sphere(1.0), at([0.0; 3])),
            (Shape::sphere(pair.radius), at([0.0, 0.0, pair.distance])),
        ]),
        truth: pair.matrix(),
        volumes: vec![ball(1.0), ball(pair.radius)],
    };
    let all = equal_spheres().into_iter().chain(unequal_spheres());
    all.map(|pair| known(&pair)).collect()
}

/// A sphere above a wall.
fn wall() -> Vec<Known> {
    let known = |exact: SphereByWall| {
        let SphereByWall {
            height,
            across,
            along,
        } = exact;
        let mut scene = scene(&[(Shape::sphere(1.0), at([0.0, 0.0, height]))]);
        scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
        let diagonal = [along, along, across, 0.0, 0.0, 0.0];
        Known {
            name: format!("sphere and wall, gap {:.3}", height - 1.0),
            scene,
            truth: DMatrix::from_diagonal(&DVector::from_row_slice(&diagonal)),
            volumes: vec![ball(1.0)],
        }
    };
    spheres_by_wall().into_iter().map(known).collect()
}

/// Bodies with edges.
fn edged() -> Vec<Known> {
    let cylinder = |radius, length| Shape::cylinder(radius, length);
    let scenes = [
        (
            scene(&[
                (Shape::cuboid([1.0, 0.6, 0.4]), at([0.0; 3])),
                (cylinder(0.25, 0.8), at([0.9, 0.1, 0.1])),
            ]),
            vec![0.24, PI * 0.05],
        ),
        (
            scene(&[
                (Shape::cuboid([1.0, 1.0, 0.15]), at([0.0; 3])),
                (Shape::sphere(0.4), at([0.1, 0.0, 0.6])),
            ]),
            vec![0.15, ball(0.4)],
        ),
        {
            let mut scene = scene(&[
                (
                    Shape::capsule(0.2, 0.6),
                    Placement::new([0.0, 0.0, 0.1], [0.0, 1.2, 0.0]),
                ),
                (
                    Shape::cuboid([0.5; 3]),
                    Placement::new([0.1, 0.7, -0.1], [0.0, 0.0, 0.3]),
                ),
            ]);
            scene.add_wall([0.0, 0.0, -0.5], [0.0, 0.0, 1.0]);
            (scene, vec![PI * 0.024 + ball(0.2), 0.125])
        },
    ];
    let file = data("edged_bodies.json");
    let known = rows(&file, "scenes").iter();
    known
        .zip(scenes)
        .map(|(row, (scene, volumes))| {
            let m = rows(row, "added_mass");
            Known {
                name: row["name"].as_str().unwrap().replace('_', ", "),
                scene,
                truth: DMatrix::from_fn(12, 12, |i, j| number(&m[i][j])),
                volumes,
            }
        })
        .collect()
}

// Ways to solve them

fn full() -> Settings {
    Settings::default().fidelity(Fidelity::Full)
}

fn reduced() -> Settings {
    Settings::default().fidelity(Fidelity::Reduced)
}

fn isolated() -> Settings {
    Settings::default().fidelity(Fidelity::Isolated)
}

fn name(settings: &Settings) -> String {
    let choices = settings.resolve(&Scene::new(Fluid::fresh_water())).water;
    let mut out = format!("{} {}", choices.fidelity, choices.method_used());
    if let Some(faces) = settings.faces {
        out += &format!(" {faces}");
    }
    if let Some(rank) = settings.rank {
        out += &format!(", rank {rank}");
    }
    if let Some(gap) = settings.resolved_gap {
        out += &format!(", resolved gap {gap}");
    }
    if let Some(accuracy) = settings.accuracy {
        out += &format!(", accuracy {accuracy}");
    }
    if let Some(tolerance) = settings.tolerance {
        out += &format!(", tolerance {tolerance}");
    }
    out
}

/// The estimates of one family.
#[derive(Default)]
struct Table {
    /// Estimate over truth.
    ratios: Vec<f64>,
    /// Cases whose estimate is under a third of the truth.
    under: Vec<String>,
}

impl Table {
    fn add(&mut self, known: &Known, settings: &Settings) {
        let simulator = Simulator::new(&known.scene, settings.clone()).unwrap();
        let m = simulator.added_mass().unwrap().matrix;
        let truth = size(&(m - &known.truth), &known.truth, &known.volumes);
        let found = simulator.error_estimate().unwrap();
        let what = format!("{}: {}", known.name, name(settings));
        let total = found.total.unwrap_or_else(|| panic!("{what}: {found:?}"));
        let ratio = total / truth;
        println!("{what:<72} {total:.1e} {truth:.1e} {ratio:6.2}");
        if ratio.is_nan() || ratio < 1.0 / 3.0 {
            self.under
                .push(format!("{what}: {found:?}, in truth {truth:e}"));
        }
        self.ratios.push(ratio);
    }

    fn all(&mut self, known: &Known, settings: &[Settings]) {
        settings.iter().for_each(|s| self.add(known, s));
    }

    fn finish(mut self, least: usize) {
        self.ratios.sort_by(f64::total_cmp);
        let n = self.ratios.len();
        let (lowest, median, highest) = (self.ratios[0], self.ratios[n / 2], self.ratios[n - 1]);
        println!(
            "{n} cases: estimate over truth from {lowest:.2} to {highest:.1}, median {median:.2}"
        );
        assert!(self.under.is_empty(), "{}", self.under.join("\n"));
        assert!(n >= least, "{n} cases");
        assert!(median < 10.0, "{median}");
    }
}

const HEADING: &str = "case | estimate | true error | ratio";

/// max |D_ij| / √(M_ii M_jj); a direction that hardly moves water counts as a hundredth of what is displaced.
fn size(difference: &DMatrix<f64>, m: &DMatrix<f64>, volumes: &[f64]) -> f64 {
    let diagonal = |i: usize| {
        let volume = volumes[i / 6];
        let displaced = if i % 6 < 3 {
            volume
        } else {
            volume.powf(5.0 / 3.0)
        };
        m[(i, i)].max(0.01 * displaced)
    };
    let n = m.nrows();
    let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    pairs
        .map(|(i, j)| difference[(i, j)].abs() / (diagonal(i) * diagonal(j)).sqrt())
        .fold(0.0, f64::max)
}

const RATIOS: [[f64; 3]; 7] = [
    [1.0, 1.0, 1.0],
    [1.0, 0.5, 1.0],
    [1.0, 0.2, 1.0],
    [1.0, 0.1, 1.0],
    [5.0, 1.0, 1.0],
    [3.0, 2.0, 1.0],
    [4.0, 2.0, 0.5],
];

fn methods() -> [Settings; 3] {
    [
        isolated().method(Method::Panel),
        isolated().method(Method::MfsVertex),
        isolated().method(Method::MfsFace),
    ]
}

#[test]
fn one_body() {
    println!("{HEADING}");
    let mut table = Table::default();
    for semi_axes in RATIOS {
        let known = ellipsoid(semi_axes);
        for settings in methods() {
            table.all(&known, &[320, 720].map(|n| settings.faces(n)));
        }
    }
    let coin = ellipsoid([1.0, 0.2, 1.0]);
    table.all(&coin, &methods().map(|s| s.faces(1280)));
    table.all(&coin, &methods().map(|s| s.faces(80)));
    table.finish(45);
}

#[test]
fn two_spheres() {
    println!("{HEADING}");
    let mut table = Table::default();
    let ranks = [20, 40, 80, 160, 320].map(|r| reduced().rank(r));
    let accuracies = [3e-2, 1e-2, 1e-3].map(|a| reduced().accuracy(a));
    for known in spheres() {
        if known.name.contains("gap 8") || known.name.contains("gap 2.00") {
            continue;
        }
        let coarse = full().faces(320);
        table.all(
            &known,
            &[
                isolated(),
                coarse.clone(),
                coarse.method(Method::MfsFace),
                coarse.method(Method::Panel),
                full().faces(720).method(Method::Panel),
                reduced().method(Method::Panel).faces(320),
                reduced().method(Method::MfsVertex).faces(320),
                reduced().films(false),
                reduced().films(false).method(Method::Panel).faces(320),
                Settings::default().fidelity(Fidelity::Auto).accuracy(0.1),
            ],
        );
        table.all(&known, &ranks);
        table.all(&known, &accuracies);
    }
    let near = &spheres()[0];
    table.all(
        near,
        &[full().faces(1280), reduced().resolved_gap(0.5).rank(20)],
    );
    table.all(near, &[0.1, 0.01].map(|t| full().faces(720).tolerance(t)));
    table.finish(90);
}

#[test]
fn sphere_and_wall() {
    println!("{HEADING}");
    let mut table = Table::default();
    for known in wall() {
        let coarse = full().faces(320);
        table.all(
            &known,
            &[
                isolated(),
                coarse.clone(),
                coarse.method(Method::MfsFace),
                coarse.method(Method::Panel),
                reduced().method(Method::Panel).faces(320),
                reduced().rank(20),
                reduced().rank(80),
                reduced().films(false),
                reduced().films(false).method(Method::Panel).faces(320),
                reduced().resolved_gap(0.5).rank(20),
                reduced().accuracy(1e-3),
            ],
        );
    }
    table.finish(50);
}

#[test]
fn bodies_with_edges() {
    println!("{HEADING}");
    let mut table = Table::default();
    for known in edged() {
        table.all(
            &known,
            &[
                isolated().faces(720),
                full().faces(320).method(Method::Panel),
                full().faces(720).method(Method::Panel),
                full().faces(720),
                full().faces(720).method(Method::MfsFace),
                reduced().faces(320),
                reduced().faces(720).accuracy(0.03),
                reduced().faces(720).method(Method::MfsVertex),
            ],
        );
    }
    table.finish(24);
}

#[test]
fn meshes_from_files() {
    println!("{HEADING}");
    let folder = tempfile::tempdir().unwrap();
    let mut table = Table::default();
    for (faces, settings) in [
        (160, full().method(Method::Panel)),
        (720, full().method(Method::Panel)),
        (720, reduced()),
        (720, full()),
    ] {
        let mut known = edged().swap_remove(0);
        let shape = known.scene.bodies[0].shape.clone().unwrap();
        let mesh = hydrograd::shape::build(&shape, Path::new(""), Some(faces)).unwrap();
        let path = folder.path().join(format!("box{faces}.obj"));
        let point = |v: &Vec3| format!("v {:e} {:e} {:e}\n", v.x, v.y, v.z);
        let face = |f: &[usize; 3]| format!("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1);
        let lines = (mesh.vertices().iter().map(point)).chain(mesh.faces().iter().map(face));
        std::fs::write(&path, lines.collect::<String>()).unwrap();
        known.scene.bodies[0].shape = Some(Shape::mesh(path));
        known.name = format!("box of a file, {faces} faces, cylinder");
        table.add(&known, &settings.faces(720));
    }
    table.finish(4);
}

/// Slow: `--ignored`.
#[test]
#[ignore = "takes minutes"]
fn finer_meshes() {
    println!("{HEADING}");
    let mut table = Table::default();
    for semi_axes in RATIOS {
        let known = ellipsoid(semi_axes);
        for settings in methods() {
            table.add(&known, &settings.faces(1280));
        }
        table.add(&known, &isolated().method(Method::Panel).faces(5120));
        table.add(&known, &isolated().method(Method::MfsVertex).faces(5120));
    }
    for known in spheres().iter().chain(&wall()).chain(&edged()) {
        let settings = [
            full(),
            full().method(Method::MfsFace),
            full().method(Method::Panel),
            reduced().method(Method::Panel),
        ];
        table.all(known, &settings.map(|s| s.faces(1280)));
    }
    table.finish(90);
}

// What can't be known

#[test]
fn what_is_missing_is_said() {
    let mut scene = scene(&[(Shape::sphere(1.0), at([0.0; 3]))]);
    let exact = Simulator::new(&scene, isolated()).unwrap();
    let found = exact.error_estimate().unwrap();
    assert_eq!(found.total, Some(0.0), "{found:?}");
    let given = (0..6).map(|i| (0..6).map(|j| f64::from(u8::from(i == j))).collect());
    scene.bodies[0].added_mass = Some(given.collect());
    let found = Simulator::new(&scene, isolated()).unwrap().error_estimate();
    let found = found.unwrap();
    assert_eq!(found.total, None);
    assert!(
        found.missing[0].contains("given for body \"body 0\""),
        "{found:?}"
    );
    // Without a shape the coupling can't be had either.
    scene.bodies[0].shape = None;
    scene.bodies[0].mass = Some(1.0);
    scene.bodies[0].density = None;
    scene.bodies[0].inertia = Some(vec![1.0; 3]);
    scene.add(
        Body::new(Shape::sphere(1.0))
            .density(1.0)
            .at([3.0, 0.0, 0.0]),
    );
    let found = Simulator::new(&scene, isolated()).unwrap().error_estimate();
    let found = found.unwrap();
    assert_eq!((found.total, found.coupling), (None, None));
    assert!(
        found.missing.iter().any(|m| m.contains("no shape")),
        "{found:?}"
    );
}
