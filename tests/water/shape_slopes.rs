//! How the added mass of one body changes with its shape: the discrete sums against differences of theirs, both formulas against closed forms.

use crate::support::mesh;
use crate::support::reference::lamb;
use hydrograd::adjoint::lie::{Mat3, Mat6, Pose, Vec3, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::boundary::exact::lamb::added_mass_slopes;
use hydrograd::boundary::panel::{Extrapolated, RichardsonSlopes, richardson};
use hydrograd::boundary::{ExactBoundary, PanelBoundary, Response};
use hydrograd::coupling::{
    Coupling, Direction, Exclusions, Linearise, PanelCoupled, ShapeDirection, ShapeTerm,
};
use hydrograd::geometry::TriMesh;
use hydrograd::scene::Shape;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;
use std::sync::Arc;

fn body(mesh: &TriMesh) -> PanelBoundary {
    PanelBoundary::new("b", mesh).unwrap()
}

fn moved(mesh: &TriMesh, h: f64, velocities: &[Vec3]) -> TriMesh {
    let vertices = mesh.vertices().iter().zip(velocities);
    let vertices = vertices.map(|(x, v)| x + h * v).collect();
    TriMesh::new("moved", vertices, mesh.faces().to_vec()).unwrap()
}

fn random(mesh: &TriMesh, seed: u64, size: f64) -> Vec<Vec3> {
    let mut samples = Samples::new(seed);
    let each = mesh.vertices().iter();
    each.map(|_| size * Vec3::from(samples.array())).collect()
}

/// Largest entry of the difference to the central one, relative to the largest of that; the best of two steps.
fn off(found: &Mat6, at: impl Fn(f64) -> Mat6) -> f64 {
    let error = |h: f64| {
        let difference = (at(h) - at(-h)) / (2.0 * h);
        (found - difference).amax() / difference.amax()
    };
    error(1e-4).min(error(1e-5))
}

#[test]
fn slopes_are_those_of_the_discrete_added_mass() {
    let shapes = [
        Shape::sphere(0.5),
        Shape::cuboid([0.5, 0.4, 0.6]),
        Shape::ellipsoid([0.6, 0.3, 0.4]),
    ];
    for shape in shapes {
        let mesh = mesh(&shape, 200);
        let slopes = body(&mesh).added_mass_slopes();
        let size: Vec<Vec3> = mesh.vertices().iter().map(|x| Vec3::x() * x.x).collect();
        for velocities in [random(&mesh, 3, 0.1), size] {
            let rate = slopes.along(&velocities);
            let error = off(&rate, |h| body(&moved(&mesh, h, &velocities)).added_mass);
            println!("{shape:?}: {error:e}");
            assert!(error < 1e-7, "{shape:?}: {error:e}");
            // The transpose is that.
            let bar = Mat6::from_fn(|i, j| ((7 * i + 3 * j) % 5) as f64 - 2.0);
            let back = slopes.pull_back(&bar);
            let back: f64 = back.iter().zip(&velocities).map(|(b, v)| b.dot(v)).sum();
            assert!((back - bar.dot(&rate)).abs() < 1e-12 * bar.norm() * rate.norm());
        }
    }
}

/// Rigid motions: what turns with the body, by the rule for tensors, without a difference.
#[test]
fn rigid_motions_turn_the_added_mass() {
    let mesh = mesh(&Shape::cuboid([0.5, 0.4, 0.6]), 200);
    let b = body(&mesh);
    let velocities: Vec<Vec3> = mesh.vertices().iter().map(|x| Vec3::z().cross(x)).collect();
    let rate = b.added_mass_slopes().along(&velocities);
    let mut spin = Mat6::zeros();
    for at in [0, 3] {
        (spin[(at, at + 1)], spin[(at + 1, at)]) = (-1.0, 1.0);
    }
    let exact = spin * b.added_mass - b.added_mass * spin;
    let error = (rate - exact).amax() / b.added_mass.amax();
    assert!(error < 1e-12, "{error:e}");
}

#[test]
fn slopes_of_extrapolated_added_masses() {
    let cases = [
        (Shape::sphere(0.5), None),
        (Shape::cuboid([0.5, 0.4, 0.6]), None),
        (Shape::ellipsoid([0.6, 0.3, 0.4]), Some(2.0)),
        (Shape::ellipsoid([0.6, 0.3, 0.3]), None),
    ];
    for (shape, ratio) in cases {
        let meshes = [320, 80].map(|faces| mesh(&shape, faces));
        let fields = [0, 1].map(|k| random(&meshes[k], 3 + k as u64, 0.02));
        let at = |h: f64| [0, 1].map(|k| body(&moved(&meshes[k], h, &fields[k])));
        let extrapolated = |h: f64| {
            let [fine, coarse] = at(h);
            Extrapolated::new(fine, coarse, ratio).unwrap().added_mass()
        };
        let [fine, coarse] = at(0.0).map(Arc::new);
        let slopes = RichardsonSlopes::new(fine, coarse, ratio).unwrap();
        let ratio_given = ratio.is_some();
        let error = off(&slopes.along(&fields[0], &fields[1]), extrapolated);
        println!("{shape:?}: {error:e}");
        assert!(error < 1e-7, "{shape:?}: {error:e}");
        let ratio = |h: f64| {
            let [fine, coarse] = at(h);
            richardson(&fine, &coarse).unwrap().ratio
        };
        let rate = match ratio_given {
            true => 0.0,
            false => (ratio(1e-4) - ratio(-1e-4)) / 2e-4,
        };
        assert!((slopes.ratio_along(&fields[0], &fields[1]) - rate).abs() < 1e-8);
    }
}

/// Lamb's added masses, by a central difference.
fn lamb_slope(semi_axes: [f64; 3], axis: usize) -> [f64; 6] {
    let h = 1e-4 * semi_axes[axis];
    let at = |h: f64| {
        let mut axes = semi_axes;
        axes[axis] += h;
        lamb(axes)
    };
    let (ahead, behind) = (at(h), at(-h));
    std::array::from_fn(|i| (ahead[i] - behind[i]) / (2.0 * h))
}

#[test]
fn slopes_of_closed_forms() {
    let cases = [
        [1.0, 1.0, 1.0],
        [1.0, 0.25, 1.0],
        [0.6, 0.3, 0.4],
        [1.0, 1.0 + 1e-9, 0.05],
        [3.0, 0.1, 0.7],
    ];
    for semi_axes in cases {
        let slopes = added_mass_slopes(semi_axes).unwrap();
        for (axis, slope) in slopes.iter().enumerate() {
            let right = lamb_slope(semi_axes, axis);
            let largest = right[..3]
                .iter()
                .chain(&right[3..])
                .fold(0.0f64, |m, x| m.max(x.abs()));
            for (i, right) in right.iter().enumerate() {
                let error = (slope[(i, i)] - right).abs() / largest;
                assert!(error < 2e-7, "{semi_axes:?} {axis} {i}: {error:e}");
            }
        }
        // All axes together: degree 3 in translation, 5 in rotation.
        let mass = lamb(semi_axes);
        for i in 0..6 {
            let grown: f64 = (0..3).map(|k| semi_axes[k] * slopes[k][(i, i)]).sum();
            let degree = if i < 3 { 3.0 } else { 5.0 };
            assert!((grown - degree * mass[i]).abs() < 1e-11 * mass[i].max(1e-3));
        }
    }
    assert!(
        (added_mass_slopes([1.0; 3])
            .unwrap()
            .iter()
            .map(|m| m[(0, 0)])
            .sum::<f64>()
            - 2.0 * PI)
            .abs()
            < 1e-12
    );
    // About the body's origin, elsewhere.
    let pose = Pose::new(
        exp_matrix(&Vec3::new(0.3, -0.4, 0.9)),
        Vec3::new(0.2, 0.1, -0.3),
    );
    let at = |h: f64| {
        let axes = [0.6, 0.3 + h, 0.4];
        ExactBoundary::new("b", axes, &pose, 0.1)
            .unwrap()
            .added_mass()
    };
    let slope = ExactBoundary::new("b", [0.6, 0.3, 0.4], &pose, 0.1).unwrap();
    let error = off(&slope.added_mass_slopes()[1], at);
    assert!(error < 1e-8, "{error:e}");
}

/// Both formulas err by a quarter of that with four times the faces; what is extrapolated from 1,280 and 320 faces is within half a percent. `cargo bench --bench shape` has the table.
#[test]
fn both_formulas_converge_to_closed_forms() {
    let semi_axes = [0.6, 0.3, 0.4];
    let meshes = [1280, 320].map(|faces| mesh(&Shape::ellipsoid(semi_axes), faces));
    let bodies = [0, 1].map(|k| Arc::new(body(&meshes[k])));
    let [fine, coarse] = bodies.clone();
    let extrapolated = RichardsonSlopes::new(fine, coarse, None).unwrap();
    let slopes = [0, 1].map(|k| bodies[k].added_mass_slopes());
    let mut worst = [0.0f64; 5];
    for axis in 0..3 {
        let grow = [0, 1].map(|k| -> Vec<Vec3> {
            let grow = |x: &Vec3| Vec3::ith(axis, x[axis] / semi_axes[axis]);
            meshes[k].vertices().iter().map(grow).collect()
        });
        let exact = lamb_slope(semi_axes, axis);
        let largest = [0..3, 3..6].map(|at| exact[at].iter().fold(0.0f64, |m, x| m.max(x.abs())));
        let found = [
            slopes[0].along(&grow[0]),
            slopes[1].along(&grow[1]),
            bodies[0].added_mass_along_by_flow(&grow[0]),
            bodies[1].added_mass_along_by_flow(&grow[1]),
            extrapolated.along(&grow[0], &grow[1]),
        ];
        for (worst, found) in worst.iter_mut().zip(found) {
            for i in 0..6 {
                *worst = worst.max((found[(i, i)] - exact[i]).abs() / largest[i / 3]);
            }
        }
    }
    println!("discrete, by the flow, extrapolated: {worst:?}");
    let [fine, coarse, by_flow, by_coarse_flow, extrapolated] = worst;
    assert!(fine < 0.35 * coarse && fine < 0.015, "{fine:e} {coarse:e}");
    assert!(
        by_flow < 0.35 * by_coarse_flow,
        "{by_flow:e} {by_coarse_flow:e}"
    );
    assert!(extrapolated < 0.005, "{extrapolated:e}");
}

/// A film has no derivative with a shape: where one acts that is an error by name, elsewhere there is none.
#[test]
fn films_refuse_shape_parameters_where_they_act() {
    let mesh = mesh(&Shape::sphere(0.5), 80);
    let body = Arc::new(body(&mesh));
    let shapes = vec![ShapeDirection {
        body: 1,
        vertices: mesh.vertices().to_vec(),
        added_mass: None,
    }];
    let made = PanelCoupled::new(
        vec![body.clone(), body],
        &[],
        Exclusions::none(),
        Default::default(),
    );
    let made = made.unwrap().with_shapes(shapes).unwrap();
    let filmed = made
        .with_films(&[(&mesh, None), (&mesh, None)], &[])
        .unwrap();
    assert_eq!(filmed.shape_parameters(), 1);
    let basis = DMatrix::identity(12, 12);
    let told = |distance: f64| {
        let away = Pose::new(Mat3::identity(), Vec3::new(distance, 0.0, 0.0));
        let record = filmed.linearise(&[Pose::identity(), away], &basis).unwrap();
        let x = DVector::from_fn(12, |i, _| f64::from(i == 6));
        let x = Direction::Basis(&x);
        let term = ShapeTerm {
            weight: 1.0,
            x,
            y: x,
            along: None,
        };
        record.shape_vjp(&[term])
    };
    let found = told(3.0).unwrap()[0];
    // Little but its own: the added mass goes with the cube of the radius, here a relative change.
    let alone = filmed.evaluate(
        &[
            Pose::identity(),
            Pose::new(Mat3::identity(), Vec3::x() * 3.0),
        ],
        &basis,
    );
    let alone = alone.unwrap().momenta()[(6, 6)];
    assert!(
        (found / (3.0 * alone) - 1.0).abs() < 0.02,
        "{found} {alone}"
    );
    let error = told(1.02).unwrap_err().to_string();
    assert!(
        error.contains("a film carries a gap") && error.contains("films"),
        "{error}"
    );
}

#[test]
fn wrong_shape_parameters_are_errors_by_name() {
    let mesh = mesh(&Shape::sphere(0.5), 80);
    let bodies = vec![Arc::new(body(&mesh))];
    let made = |known: Option<Mat6>| {
        let settings = Default::default();
        let made = PanelCoupled::new(bodies.clone(), &[], Exclusions::none(), settings).unwrap();
        made.with_added_mass(&[known])
    };
    let direction = |body: usize, vertices: usize| ShapeDirection {
        body,
        vertices: vec![Vec3::zeros(); vertices],
        added_mass: None,
    };
    let n = mesh.vertices().len();
    let told = |made: PanelCoupled, d: ShapeDirection| {
        made.with_shapes(vec![d]).err().unwrap().to_string()
    };
    assert!(told(made(None), direction(1, n)).contains("shape parameter 0: body"));
    assert!(told(made(None), direction(0, 3)).contains("velocities"));
    assert!(told(made(Some(Mat6::identity())), direction(0, n)).contains("added mass"));
}
