//! What of a coupled system lies on the device: constants once, placed surfaces at each set of poses.
//!
//! Lengths are in units of the scene's size and positions relative to its middle, so that single precision
//! resolves them; boundary rows are in units of the largest row weight. With L that size and w that
//! weight: `K = w K̂`, `P = P̂/L`, `a = L³ â`, `r = w L³ r̂`, `λ = L²/w² λ̂`, `μ = L²/w μ̂`, energies `L⁵`.

use crate::Result;
use crate::adjoint::lie::Pose;
use crate::boundary::{BodyBoundary, Method};
use crate::coupling::full::{Model, Preconditioner};
use crate::gpu::buffer::Buffer;
use crate::gpu::context::Context;
use crate::gpu::placed::PlacedSurfaces;
use crate::gpu::source::{Arithmetic, Surface};
use crate::gpu::surfaces::{Parts, Surfaces, scaled, shapes};
use faer::Mat;
use std::sync::Arc;

/// All that doesn't change with the poses.
pub(super) struct Geometry {
    pub surfaces: Arc<Surfaces>,
    pub model: Arc<Model>,
    /// w.
    pub weight: f64,
    /// D², fine and single.
    pub damping: Buffer,
    pub damping_single: Buffer,
    /// Whether some body has no factor here and takes the diagonal.
    pub diagonal: bool,
}

/// The system at given poses.
pub(super) struct PlacedSystem {
    pub geometry: Arc<Geometry>,
    pub surfaces: PlacedSurfaces,
}

/// [μ, r, β] by face, [a, λ] by source.
pub(super) type Solution = crate::gpu::response::Solution<PlacedSystem>;

/// R⁻¹ of a body, row-major, times `scale`.
fn inverse(boundary: &BodyBoundary, scale: f64) -> Vec<f64> {
    let n = boundary.sources.len();
    let mut x = Mat::<f64>::identity(n, n);
    boundary.solve_factor(x.as_mut());
    (0..n * n).map(|at| scale * x[(at / n, at % n)]).collect()
}

impl Geometry {
    /// Uploads a model.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(context: &Arc<Context>, model: &Arc<Model>) -> Result<Self> {
        let (all, of) = shapes(model.bodies.iter());
        let length = all
            .iter()
            .flat_map(|b| b.faces.corners.iter().flatten())
            .map(|v| v.norm())
            .fold(0.0, f64::max);
        let row_unit = |b: &BodyBoundary| match b.settings.method {
            Method::MfsVertex => 1.0,
            Method::MfsFace => 1.0 / (length * length),
        };
        let weight = all
            .iter()
            .flat_map(|b| b.row_weights.iter().map(|w| w * row_unit(b)))
            .fold(0.0, f64::max);

        let (mut shape_faces, mut face_table) = (Vec::new(), Vec::new());
        let (mut shape_sources, mut source_table) = (Vec::new(), Vec::new());
        for b in &all {
            let unit = row_unit(b);
            for i in 0..b.faces.len() {
                let corners = b.faces.corners[i].map(|v| v / length);
                corners.iter().for_each(|v| shape_faces.extend(v.iter()));
                let m = match b.settings.method {
                    Method::MfsVertex => {
                        (corners[1] - corners[0]).cross(&(corners[2] - corners[0]))
                    }
                    Method::MfsFace => b.faces.normals[i],
                };
                shape_faces.extend(m.iter());
                shape_faces.push(b.row_weights[i] * unit / weight);
                let asked = weight * length.powi(3);
                face_table.extend(scaled(&b.twist_rows[i], length, asked));
                face_table.extend(scaled(&b.readout_flux[i], length, length.powi(3)));
            }
            for (s, p) in b.sources.iter().zip(&b.readout) {
                shape_sources.extend((s / length).iter());
                source_table.extend(scaled(p, length, length * length));
            }
        }
        let method = |b: &Arc<BodyBoundary>| match b.settings.method {
            Method::MfsVertex => 0,
            Method::MfsFace => 1,
        };
        let mut surfaces = Surfaces::new(
            context,
            Parts {
                surface: Surface::Faces,
                length,
                faces: &model.faces,
                sources: &model.sources,
                of: &of,
                shapes: (all.iter())
                    .map(|b| [b.faces.len(), b.sources.len()])
                    .collect(),
                method: model.bodies.iter().map(method).collect(),
                images: &model.images,
                excluded: &model.excluded,
                shape_faces,
                shape_sources,
                face_table,
                source_table,
            },
        )?;
        let damping: Vec<f64> = model
            .bodies
            .iter()
            .flat_map(|b| b.damping.iter().map(|d| (d / weight).powi(2)))
            .collect();
        let (factors, layout, diagonal) = factors(context, model, &all, &of, weight);
        let damping_single = context.upload("damping", Arithmetic::Single, &damping)?;
        let factors = context.upload("factors", Arithmetic::Single, &factors)?;
        surfaces.table.extend([
            ("damping", damping_single.clone()),
            ("factors", factors),
            (
                "places",
                context.upload_words("layout of the factors", &layout)?,
            ),
        ]);
        Ok(Self {
            surfaces: Arc::new(surfaces),
            damping: context.upload("damping", context.fine(), &damping)?,
            damping_single,
            diagonal,
            model: model.clone(),
            weight,
        })
    }
}

impl PlacedSystem {
    /// Places all bodies.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(geometry: &Arc<Geometry>, poses: &[Pose]) -> Result<Self> {
        let context = &geometry.surfaces.context;
        let (single, sizes) = (Arithmetic::Single, &geometry.surfaces.sizes);
        // The Jacobi preconditioner.
        let scaling = context.upload("scaling", single, &vec![1.0; sizes.sources])?;
        let own = [("scaling", scaling)];
        let surfaces = PlacedSurfaces::new(&geometry.surfaces, poses, &own)?;
        if geometry.diagonal {
            // scaling_j = 1/√(Σ_i K_ij² + D_j²).
            let shader = ("diagonal", "main", single);
            let count = [sizes.source_blocks as u32, 1, 1];
            let all = (&surfaces.table(single)[..], &[][..]);
            context.submit([&context.call(shader, &[], &[], all, count)?])?;
        }
        Ok(Self {
            geometry: geometry.clone(),
            surfaces,
        })
    }
}

/// The factors that fit (each shape's once), where each body's lies, and whether some have none.
fn factors(
    context: &Context,
    model: &Model,
    all: &[Arc<BodyBoundary>],
    of: &[usize],
    weight: f64,
) -> (Vec<f64>, Vec<u32>, bool) {
    let room = (context.adapter().largest_binding / 4) as usize;
    let mut values = Vec::new();
    let mut at: Vec<Option<usize>> = vec![None; all.len()];
    if model.settings.preconditioner == Preconditioner::Factors {
        for (s, b) in all.iter().enumerate() {
            let n = b.sources.len();
            if b.factored() && values.len() + n * n <= room {
                at[s] = Some(values.len());
                values.extend(inverse(b, weight));
            }
        }
    }
    let mut layout = Vec::new();
    let mut diagonal = false;
    for (b, s) in of.iter().enumerate() {
        let first = model.sources[b].start as u32;
        let n = all[*s].sources.len() as u32;
        layout.extend(match at[*s] {
            Some(at) => [at as u32, n, first, 1],
            None => [0, n, first, 0],
        });
        diagonal |= at[*s].is_none();
    }
    (
        values,
        layout,
        diagonal && model.settings.preconditioner != Preconditioner::None,
    )
}
