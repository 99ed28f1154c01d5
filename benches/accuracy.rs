//! The tables of `docs/accuracy.md` and `docs/accuracy-coupled.md` that take minutes.
//!
//! `cargo bench --bench accuracy [-- SECTION …]`, sections `mfs` and `panel` (one body by each method against Lamb's
//! values), `harmonics` (ellipsoids in the flow of sources), `iterations` (of CGLS without the bodies' factors) and `gap` (a narrow gap
//! without and with refined faces); all of them if none is named.

#[allow(dead_code)]
mod common;

use common::arguments;
use common::support::bodies::{
    COIN_GAP, COIN_RADIUS, coin_iterations, coin_over_box, graded_box, off_ellipsoid,
};
use common::support::reference::lamb;
use common::support::{felt_error, mesh};
use hydrograd::adjoint::lie::{Mat6, Pose};
use hydrograd::boundary::panel::richardson;
use hydrograd::boundary::{
    BodyBoundary, Depth, ExactBoundary, Method, MfsSettings, PanelBoundary, Response, RowScaling,
};
use hydrograd::coupling::full::Preconditioner;
use hydrograd::scene::{Scene, Shape};
use hydrograd::{Fidelity, Result, Settings, Simulator, simulate};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;
use std::time::Instant;

/// A section's name, and what prints it.
type Section = (&'static str, fn() -> Result<()>);

fn main() -> Result<()> {
    let arguments = arguments();
    let sections: [Section; 5] = [
        ("mfs", mfs),
        ("panel", panel),
        ("harmonics", harmonics),
        ("iterations", iterations),
        ("gap", gap),
    ];
    for (name, section) in sections {
        if arguments.is_empty() || arguments.iter().any(|a| a == name) {
            println!("\n### {name}\n");
            section()?;
        }
    }
    Ok(())
}

/// Errors of the diagonal in percent; a dash where the exact value vanishes.
fn errors(m: &Mat6, exact: &[f64; 6]) -> String {
    let cell = |i: usize| match exact[i] {
        0.0 => "–".to_string(),
        e => format!("{:.2}", 100.0 * (m[(i, i)] / e - 1.0)),
    };
    (0..6).map(cell).collect::<Vec<_>>().join(" | ")
}

fn sources(semi_axes: [f64; 3], faces: usize, settings: &MfsSettings) -> Result<BodyBoundary> {
    let mesh = mesh(&Shape::ellipsoid(semi_axes), faces);
    BodyBoundary::new("body", &mesh, settings)
}

fn mfs() -> Result<()> {
    let plain = |method| MfsSettings::plain(method, Depth::Auto);
    for (name, settings, faces) in [
        ("default", MfsSettings::default(), &[320, 1280, 5120][..]),
        (
            "vertex, read at the centre, undamped",
            plain(Method::MfsVertex),
            &[320, 1280],
        ),
        (
            "face, read at the centre, undamped",
            plain(Method::MfsFace),
            &[320, 1280],
        ),
    ] {
        println!("\n{name}\n");
        for faces in faces {
            for semi_axes in [
                [1.0, 1.0, 1.0],
                [1.0, 0.5, 1.0],
                [1.0, 0.25, 1.0],
                [1.0, 0.2, 1.0],
                [1.0, 0.15, 1.0],
                [1.0, 0.1, 1.0],
                [4.0, 2.0, 0.5],
                [5.0, 1.0, 1.0],
                [3.0, 2.0, 1.0],
            ] {
                let b = sources(semi_axes, *faces, &settings)?;
                println!(
                    "| {semi_axes:?} | {} | {} | {:.0e} |",
                    b.faces.len(),
                    errors(&b.added_mass, &lamb(semi_axes)),
                    b.condition
                );
            }
        }
    }
    Ok(())
}

fn panel() -> Result<()> {
    for semi_axes in [
        [1.0; 3],
        [1.0, 0.5, 1.0],
        [1.0, 0.2, 1.0],
        [1.0, 0.1, 1.0],
        [1.0, 0.03, 1.0],
        [4.0, 2.0, 0.5],
        [5.0, 1.0, 1.0],
        [3.0, 2.0, 1.0],
    ] {
        let (exact, mut last) = (lamb(semi_axes), None);
        for faces in [320, 1280, 5120] {
            let mesh = mesh(&Shape::ellipsoid(semi_axes), faces);
            let b = PanelBoundary::new("body", &mesh)?;
            let row = errors(&b.added_mass, &exact);
            println!("| {semi_axes:?} | {faces} | {row} | {:.1} |", b.condition);
            if let Some(coarse) = &last {
                let r = richardson(&b, coarse)?;
                let (before, after) = (100.0 * r.fine_error, 100.0 * r.error);
                let row = errors(&r.added_mass, &exact);
                println!(
                    "| {semi_axes:?} | extrapolated | {row} | estimates {before:.2}, {after:.2} |"
                );
            }
            last = Some(b);
        }
    }
    for (size, base) in [
        ([1.0; 3], [4; 3]),
        ([1.0, 0.1, 1.0], [6, 2, 6]),
        ([1.0, 0.4, 0.7], [6, 4, 4]),
    ] {
        let mut last: Option<Mat6> = None;
        for k in [3, 4, 5] {
            let mesh = graded_box(size, base.map(|n| n * k));
            let m = PanelBoundary::new("box", &mesh)?.added_mass;
            println!("{size:?} graded {k}: {:.6?}", m.diagonal().as_slice());
            if let Some(coarse) = last {
                let ratio = k as f64 / (k - 1) as f64;
                let better = m + (m - coarse) / (ratio * ratio - 1.0);
                println!("extrapolated: {:.6?}", better.diagonal().as_slice());
            }
            last = Some(m);
        }
    }
    Ok(())
}

fn harmonics() -> Result<()> {
    println!(
        "| semi-axes | gap / longest | degree | harmonics | residual | made in | 1000 sources in |"
    );
    println!("|---|---|---|---|---|---|---|");
    for axes in [
        [1.0, 0.2, 1.0],
        [1.0, 0.1, 1.0],
        [1.0, 0.15, 1.0],
        [1.0, 1.0, 0.03],
        [5.0, 1.0, 5.0],
        [5.0, 1.0, 1.0],
        [1.0, 1.0, 20.0],
        [3.0, 2.0, 1.0],
        [0.5, 4.0, 2.0],
        [1.0, 0.7, 0.02],
        [1.0, 0.999, 0.998],
        [1e-4, 1.0, 1e-4],
    ] {
        for part in [0.5, 0.2, 0.1, 0.05] {
            let gap = part * axes.iter().fold(0.0, |m: f64, a| m.max(*a));
            let start = Instant::now();
            let body = ExactBoundary::new("body", axes, &Pose::identity(), gap)?;
            let made = start.elapsed().as_secs_f64();
            let points = off_ellipsoid(axes, gap, 1000);
            let start = Instant::now();
            body.scattered(&points, &points)?;
            let solved = start.elapsed().as_secs_f64();
            let (count, degree) = body.harmonics();
            println!(
                "| {}:{}:{} | {} | {degree} | {count} | {:.0e} | {made:.2} s | {solved:.2} s |",
                axes[0], axes[1], axes[2], part, body.residual
            );
        }
    }
    Ok(())
}

/// A unit sphere and a coin of 1280 faces each.
fn sphere_and_coin(settings: &MfsSettings) -> Result<[Arc<BodyBoundary>; 2]> {
    let body = |axes| {
        let body = sources(axes, 1280, settings)?;
        Ok(Arc::new(body))
    };
    Ok([body([1.0; 3])?, body([1.0, 0.2, 1.0])?])
}

fn iterations() -> Result<()> {
    let default = sphere_and_coin(&MfsSettings::default())?;
    let undamped = |rows| {
        sphere_and_coin(&MfsSettings {
            rows,
            damping: 0.0,
            ..MfsSettings::default()
        })
    };
    let kinds = [
        undamped(RowScaling::Scaled)?,
        undamped(RowScaling::Unscaled)?,
    ];
    println!("gap | factors without damping, 1e-3 and 1e-8: scaled rows, unscaled | Jacobi 1e-8");
    for gap in [1.0, 0.2, 0.1, 0.02] {
        let jacobi = coin_iterations(&default, gap, Preconditioner::Jacobi, 1e-8);
        let factors = kinds.each_ref().map(|bodies| {
            [1e-3, 1e-8].map(|t| coin_iterations(bodies, gap, Preconditioner::Factors, t))
        });
        println!("{gap} | {factors:?} | {jacobi}");
    }
    Ok(())
}

/// M_f, and the force between the bodies of [`coin_over_box`] at unit speed.
struct Found {
    matrix: DMatrix<f64>,
    /// ½ ∂M_zz/∂gap of the coin, kg/m.
    force: f64,
    seconds: f64,
    faces: usize,
}

fn found(scene: &Scene, settings: Settings) -> Result<Found> {
    let mut sim = Simulator::new(scene, settings)?;
    let mut at = |gap: f64| {
        sim.set_start(DVector::from_element(1, gap), DVector::zeros(1))?;
        let begin = Instant::now();
        let m = sim.added_mass()?.matrix;
        Result::Ok((m, begin.elapsed().as_secs_f64()))
    };
    let (low, first) = at(0.98 * COIN_GAP)?;
    let (high, second) = at(1.02 * COIN_GAP)?;
    Ok(Found {
        force: 0.5 * (high[(8, 8)] - low[(8, 8)]) / (0.04 * COIN_GAP),
        matrix: 0.5 * (low + high),
        seconds: first.min(second),
        faces: sim.faces(),
    })
}

fn gap() -> Result<()> {
    let full = Settings::default().fidelity(Fidelity::Full);
    let panel = |edge, faces| {
        let scene = coin_over_box(Some((COIN_RADIUS, edge)), faces);
        found(&scene, full.method(simulate::Method::Panel))
    };
    let coarse = panel(2.0 * COIN_GAP, [1000, 500])?;
    let fine = panel(1.4 * COIN_GAP, [2000, 980])?;
    // Twice the faces: the error goes with their power ⅔ at the box's edges, with 1/faces in the gap.
    let best = &fine.matrix + (&fine.matrix - &coarse.matrix) / (2f64.powf(2.0 / 3.0) - 1.0);
    let force = 2.0 * fine.force - coarse.force;
    let row = |name: &str, f: &Found| {
        println!(
            "{name:20} {:6} faces {:8.3} s   M_f {:5.2} %   coin {:+6.2} %   force {:+6.1} %",
            f.faces,
            f.seconds,
            100.0 * felt_error(&f.matrix, &best),
            100.0 * (f.matrix[(8, 8)] / best[(8, 8)] - 1.0),
            100.0 * (f.force / force - 1.0),
        );
    };
    println!("reference: coin {:.6}, force {force:.5}", best[(8, 8)]);
    row("panels, coarse", &coarse);
    row("panels, fine", &fine);
    for (name, regions, faces) in [
        ("even", None, [600, 320]),
        (
            "refined",
            Some((0.5 * COIN_RADIUS, 2.0 * COIN_GAP)),
            [600, 320],
        ),
        ("even", None, [1280, 980]),
        (
            "refined",
            Some((0.5 * COIN_RADIUS, 2.0 * COIN_GAP)),
            [1280, 980],
        ),
        ("even", None, [3000, 2000]),
    ] {
        row(name, &found(&coin_over_box(regions, faces), full.clone())?);
    }
    Ok(())
}
