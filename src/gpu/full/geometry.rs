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

/// What a body's factor is, as `shaders/factor.wgsl` has it.
const DIAGONAL: u32 = 0;
const TRIANGLE: u32 = 1;
const SPARSE: u32 = 3;

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
    /// Whether some body has a sparse factor.
    pub has_sparse: bool,
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
        let (reach, entries) = sparse_tables(model, &of, &layout, weight);
        let damping_single = context.upload("damping", Arithmetic::Single, &damping)?;
        let factors = context.upload("factors", Arithmetic::Single, &factors)?;
        surfaces.table.extend([
            ("damping", damping_single.clone()),
            ("factors", factors),
            (
                "places",
                context.upload_words("layout of the factors", &layout)?,
            ),
            (
                "reach",
                context.upload_words("rows of the sparse factors", &reach)?,
            ),
            (
                "entries",
                context.upload_words("entries of the sparse factors", &entries)?,
            ),
        ]);
        Ok(Self {
            surfaces: Arc::new(surfaces),
            damping: context.upload("damping", context.fine(), &damping)?,
            damping_single,
            diagonal,
            has_sparse: !entries.is_empty(),
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

/// Of each source's row, L's and then Lᵀ's: where its entries start and end, and the first source of its body; and the entries, (source of the body, bits of the value), each shape's once.
fn sparse_tables(model: &Model, of: &[usize], layout: &[u32], weight: f64) -> (Vec<u32>, Vec<u32>) {
    let mut entries: Vec<u32> = Vec::new();
    let mut starts: Vec<Option<Vec<u32>>> = vec![None; of.iter().map(|s| s + 1).max().unwrap_or(0)];
    let mut reach = [Vec::new(), Vec::new()];
    for (b, body) in model.bodies.iter().enumerate() {
        let n = body.sources.len();
        let factor = (model.sparse_factors[b].as_ref()).filter(|_| layout[4 * b + 3] == SPARSE);
        let Some(factor) = factor else {
            reach.iter_mut().for_each(|r| r.extend(vec![0; 4 * n]));
            continue;
        };
        let starts = starts[of[b]].get_or_insert_with(|| {
            let mut starts = vec![entries.len() as u32 / 2];
            for rows in [factor.rows(), factor.transposed()] {
                for i in 0..n {
                    for (j, value) in rows.row(i) {
                        entries.extend([*j as u32, ((weight * value) as f32).to_bits()]);
                    }
                    starts.push(entries.len() as u32 / 2);
                }
            }
            starts
        });
        let first = model.sources[b].start as u32;
        for (half, reach) in reach.iter_mut().enumerate() {
            let rows = starts[half * n..(half + 1) * n + 1].windows(2);
            reach.extend(rows.flat_map(|w| [w[0], w[1], first, 0]));
        }
    }
    (reach.concat(), entries)
}

/// Of each shape, whether its sparse factor finds place among so many entries.
fn sparse_that_fit(model: &Model, of: &[usize], room: usize) -> Vec<bool> {
    let shapes = of.iter().map(|s| s + 1).max().unwrap_or(0);
    let (mut seen, mut fits, mut taken) = (vec![false; shapes], vec![false; shapes], 0);
    for (factor, &s) in model.sparse_factors.iter().zip(of) {
        let Some(factor) = factor.as_ref().filter(|_| !seen[s]) else {
            continue;
        };
        let needed = 2 * factor.rows().entries();
        seen[s] = true;
        fits[s] = taken + needed <= room;
        taken += if fits[s] { needed } else { 0 };
    }
    fits
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
    let sparse = sparse_that_fit(model, of, room / 2);
    let mut layout = Vec::new();
    let mut diagonal = false;
    for (b, s) in of.iter().enumerate() {
        let first = model.sources[b].start as u32;
        let n = all[*s].sources.len() as u32;
        let sparse = sparse[*s] && model.sparse_factors[b].is_some();
        layout.extend(match at[*s] {
            Some(at) => [at as u32, n, first, TRIANGLE],
            None if sparse => [0, n, first, SPARSE],
            None => [0, n, first, DIAGONAL],
        });
        diagonal |= at[*s].is_none() && !sparse;
    }
    (
        values,
        layout,
        diagonal && model.settings.preconditioner != Preconditioner::None,
    )
}
