//! How the added mass changes with the vertices of a mesh: errors of the discrete derivative and of Hadamard's formula, and the time of the first against that of the
//! added mass itself in the same run.
//!
//! `cargo bench --bench shape`. The least of all rounds counts. Errors are of the largest entry, in translation and in rotation, in percent.

#[path = "../tests/support/mod.rs"]
mod support;

use hydrograd::adjoint::lie::{Mat6, Vec3};
use hydrograd::boundary::PanelBoundary;
use hydrograd::geometry::TriMesh;
use hydrograd::scene::Shape;
use std::time::Instant;
use support::mesh;
use support::reference::lamb;

const FACES: [usize; 3] = [320, 1280, 5120];

/// Entries below this part of the largest one of all are none: a sphere turns without water.
const NONE: f64 = 1e-6;

/// Worst error of the diagonal, in percent of the largest entry of its kind; zero where there is none.
fn percent(found: &Mat6, exact: &[f64; 6]) -> f64 {
    let all = exact.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let kinds = [0..3, 3..6].map(|at| {
        let largest = exact[at.clone()].iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let errors = at.map(|i| (found[(i, i)] - exact[i]).abs());
        let worst = errors.fold(0.0, f64::max);
        match largest > NONE * all {
            true => worst / largest,
            false => 0.0,
        }
    });
    100.0 * kinds[0].max(kinds[1])
}

/// The least time of some rounds, s, and what was made.
fn timed<T>(rounds: usize, make: impl Fn() -> T) -> (f64, T) {
    let mut least = f64::INFINITY;
    let mut made = None;
    for _ in 0..rounds {
        let start = Instant::now();
        made = Some(make());
        least = least.min(start.elapsed().as_secs_f64());
    }
    (least, made.expect("at least one round"))
}

fn body(mesh: &TriMesh) -> PanelBoundary {
    PanelBoundary::new("b", mesh).expect("a body")
}

/// The rate of Lamb's added mass with one semi-axis.
fn exact(semi_axes: [f64; 3], axis: usize) -> [f64; 6] {
    let h = 1e-4 * semi_axes[axis];
    let at = |h: f64| {
        let mut axes = semi_axes;
        axes[axis] += h;
        lamb(axes)
    };
    let (ahead, behind) = (at(h), at(-h));
    std::array::from_fn(|i| (ahead[i] - behind[i]) / (2.0 * h))
}

fn main() {
    println!("| faces | ms added mass | ms its slopes | ratio |\n|---|---|---|---|");
    for faces in FACES {
        let mesh = mesh(&Shape::ellipsoid([0.6, 0.3, 0.4]), faces);
        let rounds = if faces > 2000 { 1 } else { 5 };
        let (made, b) = timed(rounds, || body(&mesh));
        let (slopes, _) = timed(rounds, || b.added_mass_slopes());
        let ratio = slopes / made;
        println!(
            "| {faces} | {:.1} | {:.1} | {ratio:.2} |",
            1e3 * made,
            1e3 * slopes
        );
    }
    println!("\n| shape, parameter | faces | discrete, % | by the flow, % |\n|---|---|---|---|");
    let shapes = [[0.5; 3], [0.6, 0.3, 0.4], [1.0, 0.25, 1.0]];
    for semi_axes in shapes {
        for faces in FACES {
            let mesh = mesh(&Shape::ellipsoid(semi_axes), faces);
            let b = body(&mesh);
            let slopes = b.added_mass_slopes();
            for axis in 0..3 {
                let grow = |x: &Vec3| Vec3::ith(axis, x[axis] / semi_axes[axis]);
                let grow: Vec<Vec3> = mesh.vertices().iter().map(grow).collect();
                let right = exact(semi_axes, axis);
                let found = [slopes.along(&grow), b.added_mass_along_by_flow(&grow)];
                let [discrete, flow] = found.map(|m| percent(&m, &right));
                println!("| {semi_axes:?}, axis {axis} | {faces} | {discrete:.3} | {flow:.3} |");
            }
        }
    }
    println!(
        "\n| box 0.5 × 0.4 × 0.6, length along x | by the flow against the discrete sums, % |\n|---|---|"
    );
    for faces in FACES {
        let mesh = mesh(&Shape::cuboid([0.5, 0.4, 0.6]), faces);
        let b = body(&mesh);
        let grow: Vec<Vec3> = mesh
            .vertices()
            .iter()
            .map(|x| Vec3::x() * x.x / 0.5)
            .collect();
        let right = b.added_mass_slopes().along(&grow);
        let diagonal = std::array::from_fn(|i| right[(i, i)]);
        let off = percent(&b.added_mass_along_by_flow(&grow), &diagonal);
        println!("| {} faces | {off:.3} |", mesh.faces().len());
    }
}
