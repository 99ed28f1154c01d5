//! Bodies too large to factor: nothing of the size of a matrix, on either side.

use super::fixture::*;
use hydrograd::boundary::{BodyBoundary, Readout, Settings};
use hydrograd::coupling::full::{Cpu, Full, Model, Preconditioner, SolveSettings, WetBody};
use hydrograd::coupling::{Coupling, Exclusions};
use hydrograd::gpu::full::Gpu;
use hydrograd::scene::Shape;
use hydrograd::shape;
use std::path::Path;
use std::sync::Arc;

fn bodies(factored: bool) -> Vec<Arc<WetBody>> {
    // Without the body's own residual flux both read the same potential out.
    let settings = Settings {
        readout: Readout::Centre,
        ..Settings::default()
    };
    let of = |shape: &Shape| {
        let mesh = shape::build(shape, Path::new("."), Some(80)).unwrap();
        let (v, f) = (mesh.vertices(), mesh.faces());
        let made = if factored {
            BodyBoundary::new("b", v, f, &settings)
        } else {
            BodyBoundary::unfactored("b", v, f, &settings)
        };
        Arc::new(WetBody::new(Arc::new(made.unwrap())))
    };
    vec![
        of(&Shape::sphere(0.5)),
        of(&Shape::ellipsoid([0.6, 0.3, 0.4])),
        of(&Shape::sphere(0.4)),
    ]
}

fn model(factored: bool) -> Arc<Model> {
    let settings = SolveSettings {
        preconditioner: Preconditioner::Jacobi,
        tolerance: 1e-9,
        ..SolveSettings::default()
    };
    Arc::new(Model::new(bodies(factored), &[], Exclusions::none(), settings).unwrap())
}

#[test]
fn a_body_without_factor_gives_the_same_answer() {
    let basis = basis(3, 5, 0.3);
    let with = model(true);
    let cpu = Full::on(with.clone(), Box::new(Cpu::new(with).unwrap()));
    let without = model(false);
    let gpu = Full::on(
        without.clone(),
        Box::new(Gpu::new(context(), &without).unwrap()),
    );
    let a = cpu.evaluate(&poses(), &basis, false).unwrap();
    let b = gpu.evaluate(&poses(), &basis, false).unwrap();
    let found = difference(b.momenta().as_slice(), a.momenta().as_slice());
    assert!(found <= 1e-6, "{found:.1e}");
}

#[test]
fn the_cpu_refuses_a_body_without_factor() {
    let message = Cpu::new(model(false)).err().expect("refused").to_string();
    assert!(message.contains("backend gpu"), "{message}");
}
