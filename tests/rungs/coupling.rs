//! Rungs of the fluid's energy: isolated bodies, and the coupled system with every method and
//! solver, with walls and without.

use super::tools::{all, along, vector_along, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::adjoint::lie::{Mat6, Pose, Vec3, Vec6, cross_motion, exp_matrix};
use hydrograd::boundary::{BodyBoundary, Method, MfsSettings, PanelBoundary};
use hydrograd::coupling::full::{Full, FullSolver, SolveSettings};
use hydrograd::coupling::reduced::{Cutoff, Reduced, compress};
use hydrograd::coupling::scattering::{Apart, Levels, Scattering};
use hydrograd::coupling::{
    Coupling, Direction, Exclusions, ExtrapolatedPanels, FilmedPanels, Given, Isolated, Linearise,
    PanelCoupled,
};
use hydrograd::geometry::{Image, TriMesh};
use hydrograd::scene::{Shape, Wall, WallSurface};
use hydrograd::shape;
use nalgebra::{DMatrix, DVector};
use std::path::Path;
use std::sync::Arc;

pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "geometry::image::Image::twist_vjp" => image_twist,
        "coupling::isolated::IsolatedLinearised::gradient" => |c| zero_gradient(c, false),
        "coupling::isolated::IsolatedLinearised::gradient_along" => |c| zero_gradient(c, true),
        "coupling::isolated::IsolatedLinearised::vjp" => |c| vjp(&isolated(), c),
        "coupling::isolated::IsolatedLinearised::hvp" => isolated_hvp,
        "coupling::given::GivenLinearised::gradient" => |c| all(given_systems().iter().map(|s| gradient(s, c))),
        "coupling::given::GivenLinearised::gradient_along" => |c| all(given_systems().iter().map(|s| gradient_along(s, c))),
        "coupling::given::GivenLinearised::vjp" => |c| all(given_systems().iter().map(|s| vjp(s, c))),
        "coupling::given::GivenLinearised::hvp" => |c| all(given_systems().iter().map(|s| hvp(s, c))),
        "coupling::response::ResponseLinearised::gradient" => |c| all(systems().iter().map(|s| gradient(s, c)).chain(panel_systems().iter().map(|s| gradient(s, c)))),
        "coupling::response::ResponseLinearised::gradient_along" => |c| all(systems().iter().map(|s| gradient_along(s, c)).chain(panel_systems().iter().map(|s| gradient_along(s, c)))),
        "coupling::response::ResponseLinearised::vjp" => |c| all(systems().iter().map(|s| vjp(s, c)).chain(panel_systems().iter().map(|s| vjp(s, c)))),
        "coupling::response::ResponseLinearised::hvp" => |c| all(systems().iter().map(|s| hvp(s, c)).chain(panel_systems().iter().map(|s| hvp(s, c)))),
        "coupling::panel::extrapolated::ExtrapolatedLinearised::gradient" => |c| gradient(&extrapolated_panels(), c),
        "coupling::panel::filmed::FilmedLinearised::gradient" => |c| all(filmed_panels().iter().map(|s| gradient(s, c))),
        "coupling::panel::filmed::FilmedLinearised::gradient_along" => |c| all(filmed_panels().iter().map(|s| gradient_along(s, c))),
        "coupling::panel::filmed::FilmedLinearised::vjp" => |c| all(filmed_panels().iter().map(|s| vjp(s, c))),
        "coupling::panel::filmed::FilmedLinearised::hvp" => |c| all(filmed_panels().iter().map(|s| hvp(s, c))),
        "coupling::reduced::linearised::ReducedLinearised::gradient" => |c| all(reduced_systems().iter().chain(&film_systems()).map(|s| gradient(s, c))),
        "coupling::scattering::linearised::ScatteredLinearised::gradient" => |c| all(scattering_systems().iter().map(|s| gradient(s, c))),
        "coupling::scattering::linearised::ScatteredLinearised::gradient_along" => |c| all(scattering_systems().iter().map(|s| gradient_along(s, c))),
        "coupling::scattering::linearised::ScatteredLinearised::vjp" => |c| all(scattering_systems().iter().map(|s| vjp(s, c))),
        "coupling::scattering::linearised::ScatteredLinearised::hvp" => |c| all(scattering_systems().iter().map(|s| hvp(s, c))),
        "coupling::panel::extrapolated::ExtrapolatedLinearised::gradient_along" => |c| gradient_along(&extrapolated_panels(), c),
        "coupling::reduced::linearised::ReducedLinearised::gradient_along" => |c| all(reduced_systems().iter().chain(&film_systems()).map(|s| gradient_along(s, c))),
        "coupling::panel::extrapolated::ExtrapolatedLinearised::vjp" => |c| vjp(&extrapolated_panels(), c),
        "coupling::reduced::linearised::ReducedLinearised::vjp" => |c| all(reduced_systems().iter().chain(&film_systems()).map(|s| vjp(s, c))),
        "coupling::panel::extrapolated::ExtrapolatedLinearised::hvp" => |c| hvp(&extrapolated_panels(), c),
        "coupling::reduced::linearised::ReducedLinearised::hvp" => |c| all(reduced_systems().iter().chain(&film_systems()).map(|s| hvp(s, c))),
    ]
}

const WALL: Wall = Wall {
    surface: WallSurface::Rigid,
    point: [0.0, 0.0, 0.1],
    normal: [0.1, 0.0, 1.0],
};
const SIDE: Wall = Wall {
    surface: WallSurface::Rigid,
    point: [-0.8, 0.0, 0.0],
    normal: [1.0, 0.0, -0.1],
};

fn body(shape: Shape, method: Method, solver: FullSolver) -> Arc<BodyBoundary> {
    let mesh = shape::build(&shape, Path::new("."), Some(80)).unwrap();
    let mut settings = MfsSettings {
        method,
        ..MfsSettings::default()
    };
    if solver == FullSolver::Gmres {
        settings.damping = 0.0;
    }
    let b = BodyBoundary::new("b", &mesh, &settings).unwrap();
    Arc::new(b)
}

fn full(method: Method, solver: FullSolver, walls: &[Wall]) -> Full {
    without(Exclusions::none(), method, solver, walls)
}

fn without(excluded: Exclusions, method: Method, solver: FullSolver, walls: &[Wall]) -> Full {
    let bodies = vec![
        body(Shape::sphere(0.5), method, solver),
        body(Shape::ellipsoid([0.6, 0.3, 0.4]), method, solver),
    ];
    let settings = SolveSettings {
        solver,
        tolerance: 1e-13,
        ..SolveSettings::default()
    };
    Full::new(bodies, walls, excluded, settings).unwrap()
}

/// Every method with every solver that it has, without walls, with one and with two; and two bodies
/// that feel each other's images alone.
pub(super) fn systems() -> Vec<Full> {
    vec![
        full(Method::MfsVertex, FullSolver::Cgls, &[]),
        full(Method::MfsVertex, FullSolver::Qr, &[WALL, SIDE]),
        full(Method::MfsFace, FullSolver::Cgls, &[WALL]),
        full(Method::MfsFace, FullSolver::Gmres, &[]),
        without(
            Exclusions::new([(0, 1)]),
            Method::MfsVertex,
            FullSolver::Cgls,
            &[WALL],
        ),
    ]
}

pub(super) fn panels(faces: usize) -> Vec<Arc<PanelBoundary>> {
    let of = |shape: Shape| {
        let mesh = shape::build(&shape, Path::new("."), Some(faces)).unwrap();
        Arc::new(PanelBoundary::new("b", &mesh).unwrap())
    };
    vec![
        of(Shape::cuboid([0.5, 0.4, 0.6])),
        of(Shape::ellipsoid([0.6, 0.3, 0.4])),
    ]
}

fn coupled_panels(
    bodies: Vec<Arc<PanelBoundary>>,
    solver: FullSolver,
    walls: &[Wall],
    excluded: Exclusions,
) -> PanelCoupled {
    let settings = SolveSettings {
        solver,
        tolerance: 1e-13,
        ..SolveSettings::default()
    };
    PanelCoupled::new(bodies, walls, excluded, settings).unwrap()
}

pub(super) fn extrapolated_panels() -> ExtrapolatedPanels {
    let of = |faces| {
        let (bodies, gmres) = (panels(faces), FullSolver::Gmres);
        coupled_panels(bodies, gmres, &[WALL], Exclusions::none())
    };
    ExtrapolatedPanels::new(of(80), of(20), 2.0).unwrap()
}

/// Panels with both solvers, without walls, with rigid ones and a free surface; and two bodies that feel each other's images
/// alone. A box's faces are flat, and its edges sharp.
pub(super) fn panel_systems() -> Vec<PanelCoupled> {
    let bodies = panels(80);
    let of = |solver: FullSolver, walls: &[Wall], excluded: Exclusions| {
        coupled_panels(bodies.clone(), solver, walls, excluded)
    };
    let free = Wall {
        surface: WallSurface::Free,
        ..SIDE
    };
    vec![
        of(FullSolver::Gmres, &[], Exclusions::none()),
        of(FullSolver::Qr, &[WALL, SIDE], Exclusions::none()),
        of(FullSolver::Gmres, &[WALL, free], Exclusions::none()),
        of(FullSolver::Gmres, &[WALL], Exclusions::new([(0, 1)]))
            .with_added_mass(&[Some(Mat6::identity()), None]),
    ]
}

/// Compressed bodies without walls, with rigid ones and a free surface, and fading out: between the
/// bodies, and between each and its image.
pub(super) fn reduced_systems() -> Vec<Reduced> {
    let compressed = |shape: Shape| {
        let mesh = shape::build(&shape, Path::new("."), Some(320)).unwrap();
        let b = BodyBoundary::new("b", &mesh, &MfsSettings::default()).unwrap();
        let settings = compress::CompressSettings {
            rank: Some(20),
            ..compress::CompressSettings::default()
        };
        Arc::new(compress::compress("b", &mesh, &b, &settings, &[]).unwrap())
    };
    let bodies = [
        compressed(Shape::sphere(0.4)),
        compressed(Shape::ellipsoid([0.5, 0.3, 0.4])),
    ];
    let of = |walls: &[Wall], cutoff: Option<Cutoff>| {
        Reduced::new(bodies.to_vec(), walls, |_, _| cutoff).unwrap()
    };
    let free = Wall {
        surface: WallSurface::Free,
        ..SIDE
    };
    let fading = |near: f64, far: f64| Some(Cutoff { near, far });
    vec![
        of(&[], None),
        of(&[WALL, SIDE], None),
        of(&[WALL, free], None),
        of(&[], fading(0.9, 1.6)),
        of(&[WALL], fading(0.8, 2.9)),
    ]
}

/// Two bodies that see each other by their points, by moments, by both, and across films.
pub(super) fn scattering_systems() -> Vec<Scattering> {
    let bodies = reduced_systems()[0].reduced_bodies().to_vec();
    let of = |sure: f64, most: f64| {
        let levels = Levels {
            bodies: Apart { sure, most },
            ..Levels::for_accuracy(1e-3).unwrap()
        };
        let names = vec!["a".to_string(), "b".to_string()];
        Scattering::new(bodies.clone(), names, &poses(), levels).unwrap()
    };
    let mut out = vec![of(0.01, 0.02), of(5.0, 6.0), of(0.3, 1.5)];
    // With a film between them; those with walls aren't made from a factor.
    let levels = Levels::for_accuracy(1e-3).unwrap();
    let filmed = film_systems();
    let filmed = (filmed.iter()).filter_map(|s| Scattering::of(s, &poses(), levels).ok());
    out.extend(filmed);
    assert!(out.len() > 3, "no film");
    out
}

/// Two bodies by products over a floor and beside a free surface, who feel each other by their images alone.
pub(super) fn scattering_between_walls() -> Scattering {
    let bodies = reduced_systems()[0].reduced_bodies().to_vec();
    let free = Wall {
        surface: WallSurface::Free,
        ..SIDE
    };
    let (images, levels) = (
        Image::of_walls(&[WALL, free]).unwrap(),
        Levels::for_accuracy(1e-3).unwrap(),
    );
    let names = vec!["a".to_string(), "b".to_string()];
    let made = Scattering::between(bodies, names, &poses(), images, levels).unwrap();
    made.excluding(&Exclusions::new([(0, 1)])).unwrap()
}

/// Panels that come nearer than they resolve: to one another and to a wall, round ones and with edges, on one mesh and on two, by blocks and by the whole matrix.
/// The film is there: it is what they differ by from those without.
pub(super) fn filmed_panels() -> Vec<FilmedPanels> {
    let of = |shapes: [Shape; 2], walls: &[Wall], solver, excluded: &Exclusions, two: bool| {
        let built = |faces| shapes.clone().map(|s| mesh(&s, faces));
        let coupled = |faces| {
            let bodies = built(faces).map(|m| Arc::new(PanelBoundary::new("b", &m).unwrap()));
            coupled_panels(bodies.to_vec(), solver, walls, excluded.clone())
        };
        let solids = shapes
            .clone()
            .map(|s| shape::solid(&s, Pose::identity()).unwrap());
        let meshes = built(80);
        let surfaces: Vec<_> = meshes
            .iter()
            .zip(solids.iter().map(Option::as_ref))
            .collect();
        let both = |faces: [usize; 2]| {
            let [fine, coarse] = faces.map(&coupled);
            ExtrapolatedPanels::new(fine, coarse, 2.0).unwrap()
        };
        let momenta = |s: &dyn Linearise| {
            s.evaluate(&poses(), &case().basis)
                .unwrap()
                .momenta()
                .clone()
        };
        let (plain, filmed) = match two {
            true => (
                momenta(&both([80, 20])),
                both([80, 20]).with_films(&surfaces, walls).unwrap(),
            ),
            false => (
                momenta(&coupled(80)),
                coupled(80).with_films(&surfaces, walls).unwrap(),
            ),
        };
        let there = (plain - momenta(&filmed)).amax();
        assert!(there > 1e-5, "no film: {there:e}");
        filmed
    };
    let (ball, egg) = (Shape::sphere(0.57), Shape::ellipsoid([0.65, 0.45, 0.5]));
    let round = [ball, egg.clone()];
    let small = [Shape::sphere(0.5), Shape::ellipsoid([0.3, 0.2, 0.4])];
    let sharp = [
        Shape::cuboid([0.83, 0.71, 0.77]),
        Shape::cylinder(0.42, 0.83),
    ];
    let (none, gmres) = (Exclusions::none(), FullSolver::Gmres);
    vec![
        of(round, &[], gmres, &none, true),
        of(small.clone(), &[FLOOR], FullSolver::Qr, &none, false),
        of(
            small,
            &[FLOOR, SIDE],
            gmres,
            &Exclusions::new([(0, 1)]),
            false,
        ),
        of(sharp, &[], gmres, &none, true),
    ]
}

/// A wall that comes near the first body.
const FLOOR: Wall = Wall {
    point: [0.0, 0.0, 0.45],
    ..WALL
};

fn mesh(shape: &Shape, faces: usize) -> TriMesh {
    shape::build(shape, Path::new("."), Some(faces)).unwrap()
}

/// Compressed bodies that come nearer than they resolve: to one another and to a wall, round ones and with edges, by formula and as meshes. The film
/// is there: it is what they differ by from those without.
fn film_systems() -> Vec<Reduced> {
    let of = |shapes: [Shape; 2], walls: &[Wall], by_formula: bool| {
        let built = shapes.map(|shape| {
            let mesh = mesh(&shape, 320);
            let b = BodyBoundary::new("b", &mesh, &MfsSettings::default()).unwrap();
            let settings = compress::CompressSettings {
                rank: Some(20),
                ..compress::CompressSettings::default()
            };
            let body = compress::compress("b", &mesh, &b, &settings, &[]).unwrap();
            let solid = shape::solid(&shape, Pose::identity()).unwrap();
            (mesh, Arc::new(body), solid.filter(|_| by_formula))
        });
        let bodies = built.iter().map(|(_, body, _)| body.clone()).collect();
        let plain = Reduced::new(bodies, walls, |_, _| None).unwrap();
        let surfaces = built.iter().map(|(mesh, _, solid)| (mesh, solid.as_ref()));
        let filmed = plain.clone();
        let filmed = filmed
            .with_films(
                &surfaces.collect::<Vec<_>>(),
                &[compress::CompressSettings::default().tolerance; 2],
                walls,
            )
            .unwrap();
        let momenta = |s: &Reduced| {
            s.evaluate(&poses(), &case().basis)
                .unwrap()
                .momenta()
                .clone()
        };
        let there = (momenta(&plain) - momenta(&filmed)).amax();
        assert!(there > 1e-5, "no film: {there:e}");
        filmed
    };
    let egg = Shape::ellipsoid([0.65, 0.45, 0.5]);
    let (block, can) = (
        Shape::cuboid([0.83, 0.71, 0.77]),
        Shape::cylinder(0.42, 0.83),
    );
    vec![
        of([Shape::sphere(0.57), egg.clone()], &[], true),
        of(
            [Shape::sphere(0.5), Shape::ellipsoid([0.3, 0.2, 0.4])],
            &[FLOOR],
            true,
        ),
        of([block.clone(), can.clone()], &[], true),
        of(
            [
                Shape::cylinder(0.425, 0.835),
                Shape::cuboid([0.835, 0.715, 0.775]),
            ],
            &[],
            false,
        ),
    ]
}

/// A positive definite matrix without any symmetry else.
fn definite(phase: f64) -> Mat6 {
    let a = Mat6::from_column_slice(wavy(36, phase, 1.0).as_slice());
    a * a.transpose()
}

pub(super) fn isolated() -> Isolated {
    Isolated::new(vec![definite(0.2), definite(1.4)])
}

/// Given added masses in the place of the bodies' own, of one body and of both: over fundamental solutions, compressed bodies with films, and panels.
pub(super) fn given_systems() -> Vec<Given> {
    let of = |computed: Box<dyn Coupling>, change: [Mat6; 2]| {
        Given::new(computed, change.to_vec()).unwrap()
    };
    let one = [Mat6::zeros(), definite(2.3)];
    let both = [definite(0.2), definite(1.4)];
    let by_sources = full(Method::MfsVertex, FullSolver::Cgls, &[WALL]);
    vec![
        of(Box::new(by_sources), both),
        of(Box::new(film_systems().swap_remove(0)), one),
        of(Box::new(extrapolated_panels()), both),
    ]
}

pub(super) fn poses() -> [Pose; 2] {
    [
        Pose::new(
            exp_matrix(&Vec3::new(0.2, -0.4, 0.3)),
            Vec3::new(0.1, -0.2, 1.0),
        ),
        Pose::new(
            exp_matrix(&Vec3::new(-0.7, 0.5, 0.9)),
            Vec3::new(0.5, 0.9, 0.9),
        ),
    ]
}

/// Displaces the poses by `exp(h z)`.
pub(super) fn displaced(z: &[Vec6], h: f64) -> Vec<Pose> {
    let pairs = poses().into_iter().zip(z);
    pairs.map(|(p, z)| p.displace(&(h * z))).collect()
}

/// Spatial displacements small enough for the step sizes of the checks.
pub(super) fn field(phase: f64) -> Vec<Vec6> {
    let x = wavy(12, phase, 0.3);
    x.as_slice().chunks(6).map(Vec6::from_row_slice).collect()
}

/// What the rungs are asked for: basis, two directions on it, a twist outside it, a displacement.
struct Case {
    basis: DMatrix<f64>,
    x: DVector<f64>,
    y: DVector<f64>,
    twist: DVector<f64>,
    z: Vec<Vec6>,
}

fn case() -> Case {
    Case {
        basis: DMatrix::from_vec(12, 3, wavy(36, 0.4, 1.0).as_slice().to_vec()),
        x: wavy(3, 0.1, 1.0),
        y: wavy(3, 1.1, 1.0),
        twist: wavy(12, 2.2, 1.0),
        z: field(0.7),
    }
}

fn dot(a: &[Vec6], b: &[Vec6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

/// E(g; x, y) for body twists x, y with the poses displaced by `h z`.
fn energy(s: &dyn Linearise, z: &[Vec6], h: f64, x: &DVector<f64>, y: &DVector<f64>) -> f64 {
    let b = DMatrix::from_columns(&[x.clone(), y.clone()]);
    let r = s.evaluate(&displaced(z, h), &b).unwrap();
    let m = b.tr_mul(r.momenta());
    0.5 * (m[(0, 1)] + m[(1, 0)])
}

fn gradient(s: &dyn Linearise, c: f64) -> Outcome {
    let k = case();
    let record = s.linearise(&poses(), &k.basis).unwrap();
    let slope = c * dot(&record.gradient(&k.x, &k.y).unwrap(), &k.z);
    let (x, y) = (&k.basis * &k.x, &k.basis * &k.y);
    along(|h| energy(s, &k.z, h, &x, &y), slope)
}

fn gradient_along(s: &dyn Linearise, c: f64) -> Outcome {
    let k = case();
    let record = s.linearise(&poses(), &k.basis).unwrap();
    let tangent = c * record.gradient_along(&k.y, &k.z).unwrap();
    let y = &k.basis * &k.y;
    let value = |h: f64| -> Vec<f64> {
        let of = |i: usize| energy(s, &k.z, h, &k.basis.column(i).into_owned(), &y);
        (0..k.basis.ncols()).map(of).collect()
    };
    vector_along(value, tangent.as_slice())
}

/// All three parts, for a direction outside the basis and one on it.
fn vjp(s: &dyn Linearise, c: f64) -> Outcome {
    let k = case();
    let record = s.linearise(&poses(), &k.basis).unwrap();
    let pull = record
        .vjp(Direction::Twist(&k.twist), Direction::Basis(&k.y))
        .unwrap();
    let y = &k.basis * &k.y;
    let d = wavy(12, 5.0, 0.3);
    let by_y = along(
        |h| energy(s, &k.z, 0.0, &k.twist, &(&y + h * &d)),
        c * pull.momentum_x.dot(&d),
    );
    let by_x = along(
        |h| energy(s, &k.z, 0.0, &(&k.twist + h * &d), &y),
        c * pull.momentum_y.dot(&d),
    );
    let slope = c * dot(&pull.wrench, &k.z);
    if s.unknowns() == 0 {
        // Bodies that don't feel each other: no wrench at all.
        assert_eq!(slope, 0.0);
        return by_x.worst(by_y);
    }
    let by_pose = along(|h| energy(s, &k.z, h, &k.twist, &y), slope);
    all([by_x, by_y, by_pose])
}

/// Tangents of impulses and wrenches, for two directions and for one taken twice.
fn hvp(s: &dyn Linearise, c: f64) -> Outcome {
    let k = case();
    let record = s.linearise(&poses(), &k.basis).unwrap();
    let at = |h: f64| s.linearise(&displaced(&k.z, h), &k.basis).unwrap();
    all([(&k.x, &k.y), (&k.x, &k.x)].into_iter().flat_map(|(x, y)| {
        let t = record
            .hvp(Direction::Basis(x), Direction::Basis(y), &k.z)
            .unwrap();
        let impulse = |a: &DVector<f64>, tangent: &DVector<f64>| {
            vector_along(
                |h| (at(h).momenta() * a).as_slice().to_vec(),
                (c * tangent).as_slice(),
            )
        };
        let flat = |w: &[Vec6], c: f64| -> Vec<f64> {
            w.iter().flat_map(|w| (c * w).as_slice().to_vec()).collect()
        };
        let wrench = vector_along(
            |h| flat(&at(h).gradient(x, y).unwrap(), 1.0),
            &flat(&t.wrench, c),
        );
        let (value, right) = (
            flat(&t.gradient, 1.0),
            flat(&record.gradient(x, y).unwrap(), 1.0),
        );
        let size = right.iter().fold(0.0_f64, |m, r| m.max(r.abs()));
        for (v, r) in value.iter().zip(&right) {
            assert!((v - r).abs() <= 1e-9 * size, "{v} is not {r}");
        }
        [impulse(x, &t.momentum_x), impulse(y, &t.momentum_y), wrench]
    }))
}

/// The gradient of isolated bodies' energy is zero exactly; corrupted means not zero here.
fn zero_gradient(c: f64, along: bool) -> Outcome {
    let (k, s) = (case(), isolated());
    let record = s.linearise(&poses(), &k.basis).unwrap();
    let y = &k.basis * &k.y;
    let x = &k.basis * &k.x;
    assert_eq!(energy(&s, &k.z, 0.3, &x, &y), energy(&s, &k.z, 0.0, &x, &y));
    let size = if along {
        record.gradient_along(&k.y, &k.z).unwrap().norm()
    } else {
        dot(&record.gradient(&k.x, &k.y).unwrap(), &k.z).abs()
    };
    Outcome {
        rel_error: size + (c - 1.0),
        order: f64::INFINITY,
        tolerance: super::tools::TOLERANCE,
    }
}

fn isolated_hvp(c: f64) -> Outcome {
    let (k, s) = (case(), isolated());
    let record = s.linearise(&poses(), &k.basis).unwrap();
    let t = record
        .hvp(Direction::Basis(&k.x), Direction::Basis(&k.y), &k.z)
        .unwrap();
    let size = t.momentum_x.norm() + t.momentum_y.norm() + dot(&t.wrench, &t.wrench);
    Outcome {
        rel_error: size + (c - 1.0),
        order: f64::INFINITY,
        tolerance: super::tools::TOLERANCE,
    }
}

/// Images of two walls: the transpose of a linear map, which is also the motion of the image.
fn image_twist(c: f64) -> Outcome {
    let images = Image::of_walls(&[WALL, SIDE]).unwrap();
    let z = field(0.7)[0];
    let bar = field(1.9)[1];
    all(images.iter().map(|image| {
        let slope = c * image.twist_vjp(&bar).dot(&z);
        along(|h| bar.dot(&image.twist(&(h * z))), slope)
    }))
}

/// What the tangents say beyond differences: impulses are the energy's derivative, and the order of
/// two displacements matters by their bracket.
#[test]
fn second_derivatives_commute_up_to_the_bracket() {
    let full = systems()
        .into_iter()
        .map(|s| Box::new(s) as Box<dyn Linearise>);
    let reduced = reduced_systems()
        .into_iter()
        .map(|s| Box::new(s) as Box<dyn Linearise>);
    let panels = panel_systems()
        .into_iter()
        .map(|s| Box::new(s) as Box<dyn Linearise>);
    let filmed = filmed_panels()
        .into_iter()
        .map(|s| Box::new(s) as Box<dyn Linearise>);
    let given = given_systems()
        .into_iter()
        .map(|s| Box::new(s) as Box<dyn Linearise>);
    for s in full.chain(reduced).chain(panels).chain(filmed).chain(given) {
        let k = case();
        let other = field(1.9);
        let record = s.linearise(&poses(), &k.basis).unwrap();
        for (x, y) in [(&k.x, &k.y), (&k.x, &k.x)] {
            let along = |z: &[Vec6]| {
                record
                    .hvp(Direction::Basis(x), Direction::Basis(y), z)
                    .unwrap()
            };
            let (yz, zy) = (
                dot(&along(&other).wrench, &k.z),
                dot(&along(&k.z).wrench, &other),
            );
            let g = record.gradient(x, y).unwrap();
            let brackets: Vec<Vec6> = (0..2).map(|b| cross_motion(&k.z[b], &other[b])).collect();
            let bracket = dot(&g, &brackets);
            let size = yz.abs().max(zy.abs()).max(bracket.abs());
            assert!(
                (yz - zy - bracket).abs() < 1e-9 * size,
                "{yz} {zy} {bracket}"
            );
        }
        // The two ways to the same first derivative.
        let g = dot(&record.gradient(&k.x, &k.y).unwrap(), &k.z);
        let along = record.gradient_along(&k.y, &k.z).unwrap().dot(&k.x);
        assert!((along - g).abs() < 1e-10 * g.abs(), "{along} {g}");
    }
}

/// Many directions at once are each by itself.
#[test]
fn many_directions_are_one_by_one() {
    fn check(coupling: &impl Linearise, at: &[Pose], name: &str) {
        let n = 6 * coupling.bodies();
        let basis = DMatrix::from_column_slice(n, 3, wavy(3 * n, 0.4, 1.0).as_slice());
        let made = coupling.linearise(at, &basis).unwrap();
        let x = wavy(3, 1.4, 1.0);
        let twists = DMatrix::from_column_slice(n, 4, wavy(4 * n, 2.4, 1.0).as_slice());
        let near = |found: &[f64], right: &[f64], what: &str| {
            let right = DVector::from_column_slice(right);
            let error = (DVector::from_column_slice(found) - &right).norm();
            assert!(error <= 1e-11 * right.norm(), "{name}, {what}: {error:e}");
        };
        let flat =
            |field: &[Vec6]| -> Vec<f64> { field.iter().flat_map(|w| w.iter().copied()).collect() };
        let (momenta, wrenches) = made.respond(&twists, &x).unwrap();
        let fields: Vec<Vec<Vec6>> = (0..5)
            .map(|k| {
                let z = wavy(n, 3.4 + f64::from(k), 1.0);
                z.as_slice().chunks(6).map(Vec6::from_row_slice).collect()
            })
            .collect();
        for (k, wrench) in wrenches.iter().enumerate() {
            let twist = twists.column(k).into_owned();
            let alone = made
                .vjp(Direction::Twist(&twist), Direction::Basis(&x))
                .unwrap();
            near(
                momenta.column(k).into_owned().as_slice(),
                alone.momentum_x.as_slice(),
                "momenta",
            );
            near(&flat(wrench), &flat(&alone.wrench), "wrenches");
        }
        let through = Direction::Basis(&x);
        for (many, z) in made.displaced(&x, &fields).unwrap().iter().zip(&fields) {
            let alone = made.hvp(through, through, z).unwrap();
            near(
                many.momentum_x.as_slice(),
                alone.momentum_x.as_slice(),
                "momenta along",
            );
            near(&flat(&many.wrench), &flat(&alone.wrench), "wrenches along");
            near(&flat(&many.gradient), &flat(&alone.gradient), "gradient");
        }
    }
    for s in reduced_systems().iter().chain(&film_systems()) {
        check(s, &poses(), "reduced");
    }
    for s in &given_systems() {
        check(s, &poses(), "given");
    }
    check(&isolated(), &poses(), "isolated");
}
