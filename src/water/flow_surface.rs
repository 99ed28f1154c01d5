//! Surfaces of bodies on which the flow is computed, whatever the fidelity.

use super::surface::{Surface, pose, semi_axes};
use crate::boundary::{EllipsoidSurface, PanelBoundary};
use crate::geometry::TriMesh;
use crate::scene::Scene;
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
    /// Of the bodies with these numbers in the scene, whose surfaces are given: of the panels that couple them where there are `own` ones, or of such of the same meshes, of which
    /// equal ones are shared.
    ///
    /// # Errors
    /// A body without a surface, or one that panels don't resolve.
    pub fn all(
        scene: &Scene,
        numbers: &[usize],
        surfaces: &[Option<Surface>],
        own: Option<&[Arc<PanelBoundary>]>,
    ) -> Result<Vec<Self>> {
        let panels = match own {
            Some(own) => own.to_vec(),
            None => panels(scene, numbers, surfaces)?,
        };
        let made = numbers.iter().zip(panels).map(|(b, panels)| {
            let body = &scene.bodies[*b];
            let axes = body.shape.as_ref().and_then(semi_axes);
            let exact = axes.map(|axes| {
                let made = EllipsoidSurface::new(axes, &pose(&body.shape_at), &panels.faces)?;
                Ok::<_, Error>(Arc::new(made))
            });
            let exact = exact.transpose()?;
            Ok(Self { panels, exact })
        });
        made.collect()
    }
}

fn panels(
    scene: &Scene,
    numbers: &[usize],
    surfaces: &[Option<Surface>],
) -> Result<Vec<Arc<PanelBoundary>>> {
    let mut made: Vec<(&TriMesh, Arc<PanelBoundary>)> = Vec::with_capacity(numbers.len());
    for b in numbers {
        let name = &scene.bodies[*b].name;
        let mesh = &surfaces[*b].as_ref().ok_or_else(|| no_surface(name))?.mesh;
        let alike =
            |other: &TriMesh| other.vertices() == mesh.vertices() && other.faces() == mesh.faces();
        let panels = match made.iter().find(|(other, _)| alike(other)) {
            Some((_, panels)) => panels.clone(),
            None => Arc::new(PanelBoundary::new(name, mesh)?),
        };
        made.push((mesh, panels));
    }
    Ok(made.into_iter().map(|(_, panels)| panels).collect())
}

fn no_surface(body: &str) -> Error {
    Error::Unsupported {
        what: format!("the flow on the surface of body {body:?}"),
        why: "it has a given added mass but no shape".into(),
        instead: "give it a shape".into(),
    }
}
