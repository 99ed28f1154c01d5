//! What of coupled panels lies on the device: constants once, placed surfaces at each set of poses.
//!
//! With L the scene's size: A has no unit, `S = L Ŝ`, `q = L q̂`, `φ = L² φ̂`, `μ = L³ μ̂`, energies `L⁵`, all for twists in units of
//! lengths. Each shape's own inverse lies there in single precision: it preconditions, and what an answer is made of is its block in the
//! fine arithmetic, whose entries are made where they are used.

use crate::Result;
use crate::adjoint::kernel::radius_squared;
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::boundary::PanelBoundary;
use crate::coupling::PanelModel;
use crate::gpu::buffer::Buffer;
use crate::gpu::context::Context;
use crate::gpu::placed::PlacedSurfaces;
use crate::gpu::products::{Product, To, product};
use crate::gpu::source::{Arithmetic, Surface};
use crate::gpu::surfaces::{Parts, Surfaces, scaled, shapes};
use std::f64::consts::PI;
use std::sync::Arc;

/// How an inverse lies there: a square.
const SQUARE: u32 = 2;

/// All that doesn't change with the poses.
pub(super) struct Geometry {
    pub surfaces: Arc<Surfaces>,
    pub model: Arc<PanelModel>,
    /// As many ones as there are panels.
    ones: Buffer,
}

/// The panels at given poses.
pub(super) struct PlacedPanels {
    pub geometry: Arc<Geometry>,
    pub surfaces: PlacedSurfaces,
    pub poses: Vec<Pose>,
    /// Share of the full solid angle that all others and all images fill, seen from every centroid.
    pub filled: Buffer,
}

/// [φ, q] by panel, μ by centroid.
pub(super) type Solution = crate::gpu::response::Solution<PlacedPanels>;

/// A panel as `shaders/lib/panels.wgsl` has it.
fn panel(corners: &[Vec3; 3]) -> impl Iterator<Item = f64> {
    let [a, b, c] = *corners;
    let centre = (a + b + c) / 3.0;
    let m = (b - a).cross(&(c - a));
    // Second moments about the centroid: Σ (v − g)(v − g)ᵀ/12 over the corners.
    let (p, q) = ((b - a + (c - a)) / 72_f64.sqrt(), (b - c) / 24_f64.sqrt());
    let numbers = [
        m.norm() / (8.0 * PI),
        1.0 / m.norm(),
        p.norm_squared() + q.norm_squared(),
        radius_squared(&corners.map(|v| v - centre)),
    ];
    let vectors = [a, b, c, centre, m, p, q];
    vectors
        .into_iter()
        .flat_map(<[f64; 3]>::from)
        .chain(numbers)
}

impl Geometry {
    /// Uploads a model.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(context: &Arc<Context>, model: &Arc<PanelModel>) -> Result<Self> {
        let (all, of) = shapes(model.bodies.iter());
        // Before inverses are made that have no place.
        let bytes: u64 = all.iter().map(|b| 4 * (b.faces.len() as u64).pow(2)).sum();
        let most = context.adapter().largest_binding;
        if bytes > most {
            return Err(context.failure(format!(
                "the inverses of the bodies' own panels ({} panels, {} shapes) take {bytes} bytes, and a shader sees at most {most}",
                model.rows(),
                all.len()
            )));
        }
        let corners = all.iter().flat_map(|b| b.faces.corners.iter().flatten());
        let length = corners.map(|v| v.norm()).fold(0.0, f64::max);
        let (mut shape_faces, mut face_table) = (Vec::new(), Vec::new());
        let (mut shape_sources, mut source_table) = (Vec::new(), Vec::new());
        for b in &all {
            for i in 0..b.faces.len() {
                shape_faces.extend(panel(&b.faces.corners[i].map(|v| v / length)));
                shape_sources.extend((b.faces.centres[i] / length).iter());
                let flux = b.faces.twist_flux(i);
                let velocity = flux / b.faces.areas[i];
                let own = Vec6::from_fn(|k, _| b.single_layer()[(i, k)]);
                face_table.extend(scaled(&velocity, length, length));
                face_table.extend(scaled(&flux, length, length.powi(3)));
                source_table.extend(scaled(&own, length, length * length));
            }
        }
        let parts = Parts {
            surface: Surface::Panels,
            length,
            faces: &model.faces,
            sources: &model.faces,
            of: &of,
            shapes: all.iter().map(|b| [b.faces.len(); 2]).collect(),
            method: vec![0; model.bodies.len()],
            images: &model.images,
            excluded: &model.excluded,
            shape_faces,
            shape_sources,
            face_table,
            source_table,
        };
        let mut surfaces = Surfaces::new(context, parts)?;
        let (inverses, layout) = inverses(model, &all, &of);
        let inverses = context.upload("inverses", Arithmetic::Single, &inverses)?;
        let layout = context.upload_words("layout of the inverses", &layout)?;
        let ones = vec![1.0; model.rows()];
        surfaces.table.extend([
            ("factors", inverses),
            ("places", layout),
            // No body has a diagonal instead, but the variable has to be bound.
            (
                "scaling",
                context.upload("scaling", Arithmetic::Single, &[1.0])?,
            ),
        ]);
        Ok(Self {
            surfaces: Arc::new(surfaces),
            ones: context.upload("ones", context.fine(), &ones)?,
            model: model.clone(),
        })
    }
}

/// The inverse of each shape's own block, row-major, and where each body's lies.
fn inverses(model: &PanelModel, all: &[Arc<PanelBoundary>], of: &[usize]) -> (Vec<f64>, Vec<u32>) {
    let mut values = Vec::new();
    let mut at = Vec::new();
    for b in all {
        let (n, inverse) = (b.faces.len(), b.inverse());
        at.push([values.len(), n]);
        values.extend((0..n * n).map(|k| inverse[k % n * n + k / n]));
    }
    let layout = of.iter().zip(&model.faces).flat_map(|(shape, faces)| {
        let [at, n] = at[*shape].map(|x| x as u32);
        [at, n, faces.start as u32, SQUARE]
    });
    (values, layout.collect())
}

impl PlacedPanels {
    /// Places all bodies.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(geometry: &Arc<Geometry>, poses: &[Pose]) -> Result<Self> {
        let surfaces = PlacedSurfaces::new(&geometry.surfaces, poses, &[])?;
        let (context, n) = (&geometry.surfaces.context, geometry.model.rows());
        let filled = context.reals("filled", context.fine(), n)?;
        let (what, ones) = (Product::back(false).apart(), (&geometry.ones, 1, 0));
        let to = To::plain(1, (&filled, 1, 0));
        context.submit(&product(&surfaces, context.fine(), what, ones, 1, &[to])?)?;
        Ok(Self {
            geometry: geometry.clone(),
            poses: poses.to_vec(),
            surfaces,
            filled,
        })
    }
}
