//! One evaluation of the coupled panels: the value.

use super::system::{System, seen_from};
use super::{PanelCoupled, no_derivative};
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::settings::asymmetry;
use crate::coupling::{Direction, Pullback, Record, Report, Tangent};
use crate::solver::Columns;
use crate::{Error, Result};
use faer::MatRef;
use nalgebra::{DMatrix, DVector};

/// Record of [`PanelCoupled`].
pub(super) struct PanelRecord {
    bodies: usize,
    momenta: DMatrix<f64>,
    report: Report,
}

impl PanelRecord {
    pub fn new(coupled: &PanelCoupled, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Self> {
        let (bodies, k) = (coupled.bodies.len(), basis.ncols());
        if poses.len() != bodies || basis.nrows() != 6 * bodies {
            return Err(Error::input(
                "coupled panel method: poses and basis",
                format!("{} poses, {} rows", poses.len(), basis.nrows()),
                format!("one pose and six rows for each of the {bodies} bodies"),
            ));
        }
        let mut out = Self {
            bodies,
            momenta: DMatrix::zeros(6 * bodies, k),
            report: Report::default(),
        };
        if k == 0 || bodies == 0 {
            return Ok(out);
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
        out.report = Report {
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
                out.momenta.fixed_view_mut::<6, 1>(6 * b, c).copy_from(&h);
            }
        }
        if out.momenta.iter().all(|x| x.is_finite()) {
            return Ok(out);
        }
        Err(Error::Solver {
            what: format!("the coupled panel system ({n} panels)"),
            iterations: out.report.iterations,
            residual: f64::NAN,
            tolerance: coupled.settings.tolerance,
            remedy: "check the poses: the impulses aren't finite".into(),
        })
    }
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

/// Made without derivative, always.
impl Record for PanelRecord {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    fn gradient(&self, _x: &DVector<f64>, _y: &DVector<f64>) -> Result<Vec<Vec6>> {
        Ok(vec![Vec6::zeros(); self.bodies])
    }

    fn gradient_along(&self, y: &DVector<f64>, _z: &[Vec6]) -> Result<DVector<f64>> {
        Ok(DVector::zeros(y.len()))
    }

    fn vjp(&self, _x: Direction, _y: Direction) -> Result<Pullback> {
        Err(no_derivative("the vjp"))
    }

    fn hvp(&self, _x: Direction, _y: Direction, _z: &[Vec6]) -> Result<Tangent> {
        Err(no_derivative("the hvp"))
    }

    fn report(&self) -> &Report {
        &self.report
    }
}
