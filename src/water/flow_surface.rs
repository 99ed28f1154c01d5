//! Surfaces of bodies on which the flow is computed, whatever the fidelity.

use super::submerged::{SubmergedBody, shared};
use crate::boundary::{EllipsoidSurface, PanelBoundary};
use crate::{Error, Result};
use std::sync::Arc;

/// A body's surface, on which the flow is computed.
#[derive(Clone)]
pub(crate) struct FlowSurface {
    pub panels: Arc<PanelBoundary>,
    /// Of an ellipsoid by formula: what its own motion does there is known.
    pub exact: Option<Arc<EllipsoidSurface>>,
}

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
            Ok(Self { panels, exact })
        });
        made.collect()
    }
}

fn no_surface(body: &str) -> Error {
    Error::Unsupported {
        what: format!("the flow on the surface of body {body:?}"),
        why: "it has a given added mass but no shape".into(),
        instead: "give it a shape".into(),
    }
}
