//! Surfaces of bodies on which the flow is computed, whatever the fidelity.

use super::submerged::{SubmergedBody, shared};
use crate::adjoint::lie::{Mat6, Vec6};
use crate::boundary::panel::Richardson;
use crate::boundary::{EllipsoidSurface, PanelBoundary};
use crate::{Error, Result};
use std::sync::Arc;

/// A body's surface, on which the flow is computed.
#[derive(Clone)]
pub(crate) struct FlowSurface {
    pub panels: Arc<PanelBoundary>,
    /// Of an ellipsoid by formula: what its own motion does there is known.
    pub exact: Option<Arc<EllipsoidSurface>>,
    /// Of a body whose added mass is extrapolated from two meshes: the twists whose potentials its panels lack, per twist.
    lacking: Option<Mat6>,
}

/// Least added mass of a motion, over the water displaced, that panels tell well enough to be led to a better one; about an axis of revolution they have hardly any.
const TOLD: f64 = 0.01;

impl FlowSurface {
    /// Of the panels that couple these bodies where there are `own` ones, or of such of the same meshes, of which equal ones are shared.
    ///
    /// # Errors
    /// A body without a surface, or one that panels don't resolve.
    pub fn all(bodies: &[SubmergedBody], own: Option<&[Arc<PanelBoundary>]>) -> Result<Vec<Self>> {
        let panels = match own {
            Some(own) => own.to_vec(),
            None => shared(bodies, |body| {
                let mesh = body.mesh.ok_or_else(|| no_surface(body.name))?;
                PanelBoundary::new(body.name, mesh)
            })?,
        };
        let made = bodies.iter().zip(panels).map(|(body, panels)| {
            let exact = body.ellipsoid.map(|(axes, pose)| {
                let made = EllipsoidSurface::new(axes, &pose, &panels.faces)?;
                Ok::<_, Error>(Arc::new(made))
            });
            let exact = exact.transpose()?;
            let lacking = match (&exact, body.coarse) {
                (None, Some(coarse)) => {
                    let fewer = PanelBoundary::new(body.name, &coarse.mesh)?;
                    lacking(&panels, &Richardson::of(&panels, &fewer, coarse.ratio)?)
                }
                _ => None,
            };
            Ok(Self {
                panels,
                exact,
                lacking,
            })
        });
        made.collect()
    }

    /// Adds to the panels' potentials (m²/s) what they lack of those of the body's own motion: as much of them as the body's added mass, extrapolated from two meshes,
    /// is more than the panels' own. At sharp edges those are of low order in the edges, and the same factor is lacking everywhere.
    pub fn complete(&self, twist: &Vec6, potential: &mut [f64]) {
        if let Some(lacking) = &self.lacking {
            let more = self.panels.own_potential(&(lacking * twist));
            potential
                .iter_mut()
                .zip(more)
                .for_each(|(p, more)| *p += more);
        }
    }
}

/// M⁻¹ (M_extrapolated − M) in motions of which the panels tell anything: with that much more of each the impulses are those extrapolated.
fn lacking(panels: &PanelBoundary, found: &Richardson) -> Option<Mat6> {
    let volume = panels.faces.volume();
    let roots = Vec6::from_fn(|i, _| volume.powf(if i < 3 { 0.5 } else { 5.0 / 6.0 }));
    let units = roots * roots.transpose();
    let own = panels.added_mass.component_div(&units).symmetric_eigen();
    let inverse = own
        .eigenvalues
        .map(|x| if x > TOLD { 1.0 / x } else { 0.0 });
    let inverse = own.eigenvectors * Mat6::from_diagonal(&inverse) * own.eigenvectors.transpose();
    let more = (found.added_mass - panels.added_mass).component_div(&units);
    let back = Vec6::from_fn(|i, _| 1.0 / roots[i]);
    let out = (inverse * more).component_mul(&(back * roots.transpose()));
    out.iter().all(|x| x.is_finite()).then_some(out)
}

fn no_surface(body: &str) -> Error {
    Error::Unsupported {
        what: format!("the flow on the surface of body {body:?}"),
        why: "it has a given added mass but no shape".into(),
        instead: "give it a shape".into(),
    }
}
