//! Bodies' surfaces, as their shapes are meshed for the water.

use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, exp_matrix};
use crate::geometry::{Gap, MassProperties, Solid, TriMesh};
use crate::scene::{Body, Placement, Refinement, Shape};
use crate::shape;
use std::path::Path;

/// Where a placement is.
pub(crate) fn pose(p: &Placement) -> Pose {
    Pose::new(exp_matrix(&Vec3::from(p.rotation)), Vec3::from(p.position))
}

/// A body's surface in its own frame, with its mass properties.
#[derive(Clone)]
pub(crate) struct Surface {
    pub mesh: TriMesh,
    /// The mesh that was given, where its faces were divided for the water.
    given: Option<TriMesh>,
    /// Its faces before regions of it were refined.
    pub base: usize,
    /// A mesh of about a quarter of the faces, of a shape by formula.
    pub coarse: Option<Coarse>,
    pub properties: MassProperties,
    /// Whether these are the formula's, not the mesh's.
    pub by_formula: bool,
    /// The exact surface, of a shape by formula.
    pub solid: Option<Solid>,
}

/// A coarser mesh of a shape.
#[derive(Clone)]
pub(crate) struct Coarse {
    pub mesh: TriMesh,
    /// The ratio of its edges to those of the finer one, where regions are refined: there the numbers of
    /// faces don't tell it.
    pub ratio: Option<f64>,
}

impl Surface {
    /// Edge of the equilateral triangle of mean area, m. Refined regions don't count.
    pub fn mean_edge(&self) -> f64 {
        (4.0 / 3.0_f64.sqrt() * self.mesh.surface_area() / self.base as f64).sqrt()
    }

    /// With its faces as they were given, where it was: for what doesn't depend on how it is divided.
    pub fn given(&self) -> &TriMesh {
        self.given.as_ref().unwrap_or(&self.mesh)
    }

    /// Of a mesh alone.
    pub fn of_mesh(mesh: TriMesh) -> Self {
        Self {
            properties: mesh.mass_properties(),
            by_formula: false,
            base: mesh.faces().len(),
            coarse: None,
            solid: None,
            given: None,
            mesh,
        }
    }
}

/// What the water asks of surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meshing {
    /// Target number of faces of shapes by formula; `None`: the shape's own. Longer faces of meshes are divided.
    pub faces: Option<usize>,
    /// Whether meshes keep their faces whatever their length.
    pub keeps: bool,
    /// Whether ellipsoids are solved by formula.
    pub by_formula: bool,
    /// Whether shapes by formula get a second, coarser mesh.
    pub pairs: bool,
}

/// The semi-axes of a shape by formula that closed forms are known for.
pub(crate) fn semi_axes(shape: &Shape) -> Option<[f64; 3]> {
    match shape {
        Shape::Sphere { radius, .. } => Some([*radius; 3]),
        Shape::Ellipsoid { semi_axes, .. } => Some(*semi_axes),
        _ => None,
    }
}

/// A body's surface, before its regions are refined to `edges` times the edges that they ask for.
pub(crate) fn surface(body: &Body, meshing: Meshing, edges: f64) -> Result<Option<Surface>> {
    let Some(shape) = &body.shape else {
        return Ok(None);
    };
    let at = pose(&body.shape_at);
    let even = |faces: Option<usize>| {
        let made = shape::build(shape, Path::new(""), faces);
        let key = match shape {
            Shape::Mesh { .. } => "shape.path",
            _ => "shape",
        };
        let place = || format!("{}body {:?}: {key}", body.origin.surface(None), body.name);
        made.map_err(|e| e.of(&place()))
    };
    let refined = |base: &TriMesh, edges: f64| -> Result<TriMesh> {
        let regions = body.refine.iter().map(|r| Refinement {
            center: at.apply_inverse(&Vec3::from(r.center)).into(),
            edge: r.edge * edges,
            ..*r
        });
        let regions: Vec<Refinement> = regions.collect();
        let place = format!("body {:?}", body.name);
        Ok(shape::refine(base, shape, &regions, &place)?.transformed(&at))
    };
    let own = even(meshing.faces)?;
    let divided = match shape.is_mesh() && !meshing.keeps {
        true => shape::divide(&own, meshing.faces.unwrap_or(shape::DEFAULT_FACES)),
        false => None,
    };
    let given = divided.as_ref().map(|_| own.transformed(&at));
    let mesh = divided.unwrap_or(own);
    let base = mesh.faces().len();
    let mesh = refined(&mesh, edges)?;
    let closed = meshing.by_formula && semi_axes(shape).is_some();
    let coarse = if meshing.pairs && !shape.is_mesh() {
        let quarter = (base / 4).max(12);
        let coarse = even(Some(quarter))?;
        let fewer = coarse.faces().len();
        // As many bisections as in the fine mesh.
        let ratio = (base as f64 / fewer as f64).sqrt();
        let coarse = Coarse {
            mesh: refined(&coarse, ratio * edges)?,
            ratio: (!body.refine.is_empty()).then_some(ratio),
        };
        // Patterns allow only certain numbers.
        Some(coarse).filter(|_| 2 * fewer <= base)
    } else {
        None
    };
    // Where the water sees the shape itself and not a mesh of it, so do gravity and buoyancy.
    let formula = match closed || coarse.is_some() {
        true => MassProperties::by_formula(shape)?,
        false => None,
    };
    let by_formula = formula.is_some();
    let solid_mesh = given.as_ref().unwrap_or(&mesh);
    let properties = formula.map_or_else(|| solid_mesh.mass_properties(), |p| p.transformed(&at));
    Ok(Some(Surface {
        properties,
        by_formula,
        mesh,
        given,
        base,
        coarse,
        solid: shape::solid(shape, at)?,
    }))
}

/// Depth in edges up to which surfaces count as touching, and distance from which they don't: rounding.
const TOUCHING: f64 = 1e-9;

/// The gap under which surfaces with edges of this length touch, m.
pub(crate) fn touching(edge: f64) -> f64 {
    TOUCHING * edge
}

/// Whether surfaces touch, or cross.
pub(crate) fn touches(gap: &Gap) -> bool {
    gap.distance < touching(gap.edge)
}

/// Whether surfaces cross.
pub(crate) fn overlaps(gap: &Gap) -> bool {
    gap.distance < -TOUCHING * gap.edge
}
