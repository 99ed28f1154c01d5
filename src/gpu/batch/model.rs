//! What equal scenes of compressed bodies share on the device.

use crate::Result;
use crate::coupling::SceneSize;
use crate::coupling::reduced::{Reduced, ReducedBody};
use crate::geometry::Image;
use crate::gpu::context::Context;
use crate::gpu::kernel::Table;
use crate::gpu::source::Arithmetic;
use crate::gpu::surfaces::shapes;
use std::sync::Arc;

/// Most points of one block of sources.
const BLOCK: usize = 64;
/// Threads of a workgroup: at least and at most.
const LANES: (usize, usize) = (64, 256);
/// Iterations in single precision before the residual is formed again.
pub(super) const STEPS: usize = 16;
/// Rounds of them at most: each gains five digits where bodies are apart.
const ROUNDS: usize = 10;
/// Residual at which a round ends.
const ROUGH: f32 = 1e-5;

/// All that doesn't change with the poses.
pub(super) struct Model {
    pub context: Arc<Context>,
    pub reduced: Arc<Reduced>,
    /// What lengths are in units of, m.
    pub length: f64,
    pub sizes: SceneSize,
    /// The identity first.
    pub images: Vec<Image>,
    pub lanes: usize,
    /// What the shaders share.
    pub table: Table,
}

/// The images of a scene, the identity first.
fn images(reduced: &Reduced) -> Vec<Image> {
    let mut out = vec![Image::identity()];
    for link in reduced.links() {
        if !out.contains(&link.image) {
            out.push(link.image);
        }
    }
    out
}

/// Fixed numbers with a part along every eigenvector, of size one.
fn probe(count: usize) -> Vec<f64> {
    // Weyl's sequence of the golden ratio.
    let of = |i: usize| 2.0 * (i as f64 * 0.618_033_988_749_894_9 + 0.25).fract() - 1.0;
    let values: Vec<f64> = (0..count).map(of).collect();
    let size = values.iter().map(|x| x * x).sum::<f64>().sqrt();
    values.iter().map(|x| x / size).collect()
}

/// Threads that take all points in as few passes as can be, with as few idle as can be.
fn lanes(points: usize) -> usize {
    let passes = points.div_ceil(LANES.1).max(1);
    let each = points.div_ceil(passes).next_multiple_of(32);
    each.clamp(LANES.0, LANES.1)
}

impl Model {
    /// Uploads compressed bodies that are asked for `columns` columns.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(context: &Arc<Context>, reduced: &Arc<Reduced>, columns: usize) -> Result<Self> {
        let bodies = reduced.reduced_bodies();
        let (all, of) = shapes(bodies.iter());
        let length = all.iter().map(reach).fold(0.0, f64::max);
        let length = if length > 0.0 { length } else { 1.0 };
        let (mut fixed, mut table, mut across) = (Vec::new(), Vec::new(), Vec::new());
        let mut starts = Vec::new();
        for body in &all {
            let parts = body.parts();
            let (points, modes) = (body.points(), body.modes());
            starts.push((fixed.len() / 3, table.len()));
            fixed.extend(parts.points.iter().flat_map(|p| (p / length).data.0[0]));
            let entry = |i: usize, k: usize| match k.checked_sub(modes) {
                None => parts.modes[(i, k)] / length.sqrt(),
                Some(c) => parts.strengths[(i, c)] / length.powi(if c < 3 { 2 } else { 3 }),
            };
            let rows = (0..points).flat_map(|i| (0..modes + 6).map(move |k| (i, k)));
            table.extend(rows.map(|(i, k)| entry(i, k)));
            let columns = (0..modes + 6).flat_map(|k| (0..points).map(move |i| (i, k)));
            across.extend(columns.map(|(i, k)| entry(i, k)));
        }
        let images = images(reduced);
        let (mut points, mut modes) = (Vec::new(), Vec::new());
        let (mut entries, mut blocks, mut entries_of_all) = (Vec::new(), Vec::new(), 0);
        for (b, body) in bodies.iter().enumerate() {
            let (shape, start) = starts[of[b]];
            let (first, n) = (points.len() / 2, body.points());
            entries.extend([first, n, modes.len(), body.modes(), start]);
            entries_of_all += n * (body.modes() + 6);
            // Even parts: a workgroup waits for its fullest.
            let parts = n.div_ceil(BLOCK);
            for p in 0..parts {
                let (from, to) = (p * n / parts, (p + 1) * n / parts);
                blocks.extend([b, first + from, to - from]);
            }
            points.extend((0..n).flat_map(|i| [b, shape + i]));
            modes.extend(vec![b; body.modes()]);
        }
        let count = bodies.len();
        let mut weights = vec![0.0; images.len() * count * count];
        let mut pairs = 0;
        for link in reduced.links() {
            let Some(g) = images.iter().position(|i| *i == link.image) else {
                continue;
            };
            let (t, s) = (link.target, link.source);
            // One body and its image once.
            let orders = [(t, s), (s, t)];
            for (t, s) in orders.into_iter().take(1 + usize::from(t != s)) {
                weights[(g * count + t) * count + s] = link.image.sign;
                pairs += bodies[t].points() * bodies[s].points();
            }
        }
        let sizes = SceneSize {
            points: points.len() / 2,
            modes: modes.len(),
            bodies: count,
            images: images.len(),
            columns,
            pairs,
            entries: entries_of_all,
        };
        let mut begin = Vec::new();
        for part in [table, across, weights, probe(sizes.modes)] {
            begin.push(fixed.len());
            fixed.extend(part);
        }
        // Squares. Two-float numbers have a digit less.
        let tolerance: f32 = match context.fine() {
            Arithmetic::TwoFloat => 1e-11,
            _ => 1e-12,
        };
        let squared = |x: f32| (x * x).to_bits() as usize;
        let scene = [
            sizes.points,
            sizes.modes,
            sizes.bodies,
            sizes.images,
            blocks.len() / 3,
            columns,
            begin[0],
            begin[1],
            begin[2],
            begin[3],
            STEPS,
            ROUNDS,
            squared(ROUGH),
            squared(tolerance),
            0,
            0,
        ];
        let indices: Vec<u32> = [points, modes, entries, blocks]
            .concat()
            .iter()
            .map(|n| *n as u32)
            .collect();
        let fine = context.fine();
        let table = vec![
            ("scene", context.uniform(&scene)),
            ("indices", context.upload_words("indices", &indices)?),
            ("fixed", context.upload("compressed bodies", fine, &fixed)?),
            (
                "fixed_single",
                context.upload("compressed bodies", Arithmetic::Single, &fixed)?,
            ),
        ];
        Ok(Self {
            lanes: lanes(sizes.points),
            context: context.clone(),
            reduced: reduced.clone(),
            length,
            sizes,
            images,
            table,
        })
    }
}

/// Largest distance of a point from its body's origin.
fn reach(body: &Arc<ReducedBody>) -> f64 {
    let points = body.parts().points.iter().map(|p| p.norm());
    points.fold(body.parts().radius, f64::max)
}
