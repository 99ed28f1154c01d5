//! One evaluation of the coupled panels.

use super::PanelCoupled;
use super::system::{System, seen_from};
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::settings::asymmetry;
use crate::coupling::{CouplingReport, Momenta};
use crate::solver::Columns;
use crate::{Error, Result};
use faer::MatRef;
use nalgebra::DMatrix;

/// M̄_f applied to a basis.
pub(super) fn momenta(
    coupled: &PanelCoupled,
    poses: &[Pose],
    basis: &DMatrix<f64>,
) -> Result<Momenta> {
    let (bodies, k) = (coupled.bodies.len(), basis.ncols());
    if poses.len() != bodies || basis.nrows() != 6 * bodies {
        return Err(Error::input(
            "coupled panel method: poses and basis",
            format!("{} poses, {} rows", poses.len(), basis.nrows()),
            format!("one pose and six rows for each of the {bodies} bodies"),
        ));
    }
    let mut momenta = DMatrix::zeros(6 * bodies, k);
    if k == 0 || bodies == 0 {
        return Ok(Momenta::new(momenta, CouplingReport::default()));
    }
    let system = System::new(coupled, poses)?;
    let n = coupled.rows();
    // D F x̄ and q = F x̄ of the basis columns.
    let (mut flux, mut q) = (Columns::zeros(n, k), Columns::zeros(n, k));
    for (b, body) in coupled.bodies.iter().enumerate() {
        for (i, at) in coupled.faces[b].clone().enumerate() {
            let row = body.faces.twist_flux(i);
            for c in 0..k {
                let value = row.dot(&basis.fixed_view::<6, 1>(6 * b, c));
                flux.data[at * k + c] = value;
                q.data[at * k + c] = value / body.faces.areas[i];
            }
        }
    }
    let mu = system.solve(&flux, true)?;
    let (right, back) = single_layers(coupled, poses, &q, &mu.x);
    let phi = system.solve(&right, false)?;
    let raw = DMatrix::from_fn(k, k, |i, j| {
        (0..n).map(|s| flux.at(s, i) * phi.x.at(s, j)).sum::<f64>()
    });
    let report = CouplingReport {
        iterations: phi.iterations.max(mu.iterations),
        residual: phi.residual.max(mu.residual),
        asymmetry: asymmetry(&raw, basis, |b| coupled.bodies[b].faces.volume()),
        condition: system.condition(),
    };
    for (b, body) in coupled.bodies.iter().enumerate() {
        for c in 0..k {
            let mut h = Vec6::zeros();
            for (i, at) in coupled.faces[b].clone().enumerate() {
                let weight = phi.x.at(at, c) + back.at(at, c) / body.faces.areas[i];
                h += body.faces.twist_flux(i) * (0.5 * weight);
            }
            momenta.fixed_view_mut::<6, 1>(6 * b, c).copy_from(&h);
        }
    }
    if momenta.iter().all(|x| x.is_finite()) {
        return Ok(Momenta::new(momenta, report));
    }
    Err(Error::Solver {
        what: format!("the coupled panel system ({n} panels)"),
        iterations: report.iterations,
        residual: f64::NAN,
        tolerance: coupled.settings.tolerance,
        remedy: "check the poses: the impulses aren't finite".into(),
    })
}

/// S q and Sᵀ μ over all bodies and images.
fn single_layers(
    coupled: &PanelCoupled,
    poses: &[Pose],
    q: &Columns,
    mu: &Columns,
) -> (Columns, Columns) {
    let k = q.columns;
    let mut there = Columns::zeros(q.rows, k);
    let mut back = Columns::zeros(q.rows, k);
    let add = |out: &mut [f64], part: &[f64], sign: f64| {
        out.iter_mut().zip(part).for_each(|(o, p)| *o += sign * p);
    };
    for (source, panels) in coupled.faces.iter().enumerate() {
        let q = q.slice(panels.start, panels.end);
        let q = MatRef::from_row_major_slice(q, panels.len(), k);
        for (target, points) in coupled.faces.iter().enumerate() {
            let mu = mu.slice(points.start, points.end);
            let mu = MatRef::from_row_major_slice(mu, points.len(), k);
            for image in &coupled.images {
                if image.is_identity() && coupled.excluded.contains(source, target) {
                    continue;
                }
                let seen = seen_from(coupled, poses, image, source, target);
                let layers = coupled.bodies[source].panels();
                let (s_q, s_mu) = layers.single_layer_both(&seen, q, mu);
                add(there.slice_mut(points.start, points.end), &s_q, image.sign);
                add(back.slice_mut(panels.start, panels.end), &s_mu, image.sign);
            }
        }
    }
    (there, back)
}
