//! Surfaces of bodies on which the flow is computed, whatever the fidelity.

use super::{Assembled, Choices};
use crate::boundary::{EllipsoidSurface, PanelBoundary};
use crate::geometry::TriMesh;
use crate::scene::Scene;
use crate::water::{pose, semi_axes};
use crate::{Error, Result};
use std::sync::Arc;

/// A body's surface, on which the flow is computed.
#[derive(Clone)]
pub(crate) struct FlowSurface {
    pub panels: Arc<PanelBoundary>,
    /// Of an ellipsoid by formula: what its own motion does there is known.
    pub exact: Option<Arc<EllipsoidSurface>>,
}

impl Assembled {
    /// Of all bodies in the water: the panels that couple them, or such of the same meshes, of which equal ones are shared. They are solved at the first call.
    ///
    /// # Errors
    /// A body without a surface, or one that panels don't resolve.
    pub fn flow_surfaces(&self, scene: &Scene, choices: &Choices) -> Result<&[FlowSurface]> {
        if let Some(found) = self.flow_surfaces.get() {
            return Ok(found);
        }
        let panels = match self.system.coupling.surfaces() {
            Some(own) => own.to_vec(),
            None => self.panels(scene, choices)?,
        };
        let numbers = self.system.submerged().map(|(b, _)| b);
        let made = numbers.zip(panels).map(|(b, panels)| {
            let body = &scene.bodies[b];
            let axes = body.shape.as_ref().and_then(semi_axes);
            let exact = axes.map(|axes| {
                let made = EllipsoidSurface::new(axes, &pose(&body.shape_at), &panels.faces)?;
                Ok::<_, Error>(Arc::new(made))
            });
            let exact = exact.transpose()?;
            Ok(FlowSurface { panels, exact })
        });
        let made = made.collect::<Result<Vec<_>>>()?;
        Ok(self.flow_surfaces.get_or_init(|| made))
    }

    fn panels(&self, scene: &Scene, choices: &Choices) -> Result<Vec<Arc<PanelBoundary>>> {
        let surfaces = self.surfaces(scene, choices)?;
        let mut made: Vec<(&TriMesh, Arc<PanelBoundary>)> = Vec::new();
        for (b, _) in self.system.submerged() {
            let name = &scene.bodies[b].name;
            let mesh = &surfaces[b].as_ref().ok_or_else(|| no_surface(name))?.mesh;
            let alike = |other: &TriMesh| {
                other.vertices() == mesh.vertices() && other.faces() == mesh.faces()
            };
            let panels = match made.iter().find(|(other, _)| alike(other)) {
                Some((_, panels)) => panels.clone(),
                None => Arc::new(PanelBoundary::new(name, mesh)?),
            };
            made.push((mesh, panels));
        }
        Ok(made.into_iter().map(|(_, panels)| panels).collect())
    }
}

fn no_surface(body: &str) -> Error {
    Error::Unsupported {
        what: format!("the flow on the surface of body {body:?}"),
        why: "it has a given added mass but no shape".into(),
        instead: "give it a shape".into(),
    }
}
