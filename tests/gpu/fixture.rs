//! What the comparisons share: bodies, poses, and two backends of one model.

use crate::support::mesh;
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::adjoint::sample;
use hydrograd::boundary::{BodyBoundary, Method, MfsSettings};
use hydrograd::coupling::Exclusions;
use hydrograd::coupling::full::{Full, Model, Preconditioner, SolveSettings};
use hydrograd::gpu::full::Gpu;
use hydrograd::gpu::{Arithmetic, Context, Options};
use hydrograd::scene::{Shape, Wall, WallSurface};
use nalgebra::{DMatrix, DVector};
use std::sync::{Arc, OnceLock};

pub const WALL: Wall = Wall {
    surface: WallSurface::Rigid,
    point: [0.0, 0.0, 0.1],
    normal: [0.1, 0.0, 1.0],
};
pub const SIDE: Wall = Wall {
    surface: WallSurface::Rigid,
    point: [-0.8, 0.0, 0.0],
    normal: [1.0, 0.0, -0.1],
};

/// The adapter's best arithmetic, opened once: compiling shaders takes longer than running them.
pub fn context() -> &'static Arc<Context> {
    static CONTEXT: OnceLock<Arc<Context>> = OnceLock::new();
    CONTEXT.get_or_init(|| {
        Context::new(&Options::default()).expect("a GPU, or a driver that stands for one")
    })
}

/// The same adapter as one without double precision.
pub fn two_float() -> &'static Arc<Context> {
    static CONTEXT: OnceLock<Arc<Context>> = OnceLock::new();
    let options = Options {
        fine: Some(Arithmetic::TwoFloat),
        ..Options::default()
    };
    CONTEXT.get_or_init(|| Context::new(&options).expect("a GPU, or a driver that stands for one"))
}

pub fn body(shape: &Shape, faces: usize, method: Method) -> Arc<BodyBoundary> {
    let mesh = mesh(shape, faces);
    let settings = MfsSettings {
        method,
        ..MfsSettings::default()
    };
    let b = BodyBoundary::new("b", &mesh, &settings).unwrap();
    Arc::new(b)
}

/// Three bodies, two of one shape, none of whose sizes is a multiple of a block.
pub fn model(
    method: Method,
    walls: &[Wall],
    excluded: Exclusions,
    settings: SolveSettings,
) -> Arc<Model> {
    let ball = body(&Shape::sphere(0.5), 80, method);
    let bodies = vec![
        ball.clone(),
        body(&Shape::ellipsoid([0.6, 0.3, 0.4]), 180, method),
        ball,
    ];
    Arc::new(Model::new(bodies, walls, excluded, settings).unwrap())
}

/// Two bodies: without factors, solves of more take minutes on a software driver.
pub fn small(walls: &[Wall], settings: SolveSettings) -> Arc<Model> {
    let bodies = vec![
        body(&Shape::sphere(0.5), 20, Method::MfsVertex),
        body(&Shape::ellipsoid([0.6, 0.3, 0.4]), 80, Method::MfsVertex),
    ];
    Arc::new(Model::new(bodies, walls, Exclusions::none(), settings).unwrap())
}

pub fn tight(preconditioner: Preconditioner) -> SolveSettings {
    SolveSettings {
        preconditioner,
        tolerance: 1e-11,
        ..SolveSettings::default()
    }
}

/// Poses above both walls, of three bodies.
pub fn poses() -> Vec<Pose> {
    let at = |w: [f64; 3], t: [f64; 3]| Pose::new(exp_matrix(&Vec3::from(w)), Vec3::from(t));
    vec![
        at([0.3, -0.2, 0.5], [0.1, 0.2, 0.9]),
        at([-0.4, 0.7, 0.1], [1.3, 0.1, 1.2]),
        at([0.2, 0.1, -0.9], [0.6, 1.2, 1.3]),
    ]
}

/// Fixed numbers between −1 and 1.
pub fn wavy(count: usize, phase: f64) -> Vec<f64> {
    sample::numbers(phase.to_bits(), count, 1.0)
}

pub fn basis(bodies: usize, columns: usize, phase: f64) -> DMatrix<f64> {
    DMatrix::from_vec(6 * bodies, columns, wavy(6 * bodies * columns, phase))
}

pub fn twist(bodies: usize, phase: f64) -> DVector<f64> {
    DVector::from_vec(wavy(6 * bodies, phase))
}

pub fn displacement(bodies: usize, phase: f64) -> Vec<Vec6> {
    wavy(6 * bodies, phase)
        .chunks(6)
        .map(Vec6::from_column_slice)
        .collect()
}

/// The same model on the CPU and on the device.
pub fn both(context: &Arc<Context>, model: &Arc<Model>) -> (Full, Full) {
    let cpu = Full::on(
        model.clone(),
        Box::new(hydrograd::coupling::full::Cpu::new(model.clone()).unwrap()),
    );
    let gpu = Full::on(model.clone(), Box::new(Gpu::new(context, model).unwrap()));
    (cpu, gpu)
}

/// Largest difference, relative to the largest number.
pub fn difference(got: &[f64], right: &[f64]) -> f64 {
    assert_eq!(got.len(), right.len());
    let size = right.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let worst = got.iter().zip(right).map(|(a, b)| (a - b).abs());
    // NaN counts as worst.
    worst.fold(0.0, |m, x| if x <= m { m } else { x }) / size.max(f64::MIN_POSITIVE)
}

pub fn flat(wrenches: &[Vec6]) -> Vec<f64> {
    wrenches
        .iter()
        .flat_map(|w| w.iter().copied().collect::<Vec<_>>())
        .collect()
}
