//! What of a coupled system lies on the device: constants once, placed surfaces at each set of poses.
//!
//! Lengths are in units of the scene's size and positions relative to its middle, so that single precision
//! resolves them; boundary rows are in units of the largest row weight. With L that size and w that
//! weight: `K = w K̂`, `P = P̂/L`, `a = L³ â`, `r = w L³ r̂`, `λ = L²/w² λ̂`, `μ = L²/w μ̂`, energies `L⁵`.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::Table;
use super::source::Arithmetic;
use crate::Result;
use crate::adjoint::lie::{Vec3, Vec6};
use crate::boundary::{BodyBoundary, Method};
use crate::coupling::full::{Model, Preconditioner};
use faer::Mat;
use std::ops::Range;
use std::sync::Arc;

/// Faces or sources of one block.
const BLOCK: usize = 64;
/// Workgroups that keep a large card busy.
const BUSY: usize = 2048;
/// Tasks of a derivative, about, unless there are more pairs.
const TASKS: usize = 2048;
/// Memory for what the tasks of one batch of pairs leave, bytes; more, up to the second, where tasks leave so
/// much that a large card would have too few of them.
const BATCH: usize = 1 << 20;
const LARGEST_BATCH: usize = 64 << 20;

/// Numbers of things.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    pub faces: usize,
    pub sources: usize,
    pub bodies: usize,
    pub images: usize,
    pub face_blocks: usize,
    pub source_blocks: usize,
}

impl Sizes {
    /// Into how many shares the work of `own` blocks is cut that each go over `other` blocks.
    pub fn shares(&self, own: usize, other: usize) -> usize {
        BUSY.div_ceil(own.max(1)).clamp(1, other.max(1))
    }
}

/// A pair of (the image of) a body's sources and the faces that see them.
#[derive(Clone, Copy, Debug)]
pub(super) struct DevicePair {
    pub target: usize,
    pub source: usize,
    pub image: usize,
}

/// Pairs that one call works on, and their tasks.
#[derive(Clone, Debug)]
pub(super) struct PairBatch {
    pub pairs: Range<usize>,
    pub tasks: Range<usize>,
}

/// A table of rows per shape.
pub(super) struct Rows {
    /// `[shape's row][width]`.
    pub table: Buffer,
    pub width: usize,
    /// `[row]`: body, shape's row.
    pub map: Buffer,
    pub rows: usize,
}

/// All that doesn't change with the poses.
pub(super) struct Geometry {
    pub context: Arc<Context>,
    pub model: Arc<Model>,
    /// L, m.
    pub length: f64,
    /// w.
    pub weight: f64,
    pub sizes: Sizes,
    pub pairs: Vec<DevicePair>,
    /// What the shaders share.
    pub table: Table,
    /// What twists ask for on the faces (F̄, then B̄), and read out of the sources.
    pub face_rows: Rows,
    pub source_rows: Rows,
    /// D², fine and single.
    pub damping: Buffer,
    pub damping_single: Buffer,
    /// Whether some body has no factor here and takes the diagonal.
    pub diagonal: bool,
    /// Tasks of every pair, as `ranges` has them.
    pair_tasks: Vec<Range<usize>>,
    /// Always one: what isn't part of a solve goes on.
    pub open: Buffer,
}

/// The system at given poses.
pub(super) struct PlacedSystem {
    pub geometry: Arc<Geometry>,
    /// The scene's middle, m.
    pub middle: Vec3,
    /// The geometry's table with faces and sources where they are, in both arithmetics.
    pub fine: Table,
    pub single: Table,
}

/// Distinct shapes, and which one each body has.
pub(super) fn shapes<'a, T: 'a>(
    bodies: impl Iterator<Item = &'a Arc<T>>,
) -> (Vec<Arc<T>>, Vec<usize>) {
    let mut all: Vec<Arc<T>> = Vec::new();
    let of = bodies.map(|body| {
        let same = |b: &Arc<T>| Arc::ptr_eq(b, body);
        all.iter().position(same).unwrap_or_else(|| {
            all.push(body.clone());
            all.len() - 1
        })
    });
    let of = of.collect();
    (all, of)
}

/// Where each begins, and the end.
fn starts(sizes: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut out = vec![0];
    for n in sizes {
        out.push(out[out.len() - 1] + n);
    }
    out
}

/// (body, first, count, method) of every block.
fn blocks(ranges: &[Range<usize>], method: impl Fn(usize) -> u32) -> Vec<[u32; 4]> {
    let mut out = Vec::new();
    for (b, range) in ranges.iter().enumerate() {
        for first in range.clone().step_by(BLOCK) {
            let count = BLOCK.min(range.end - first);
            out.push([b as u32, first as u32, count as u32, method(b)]);
        }
    }
    out
}

/// (body, row of the body's shape) of every row.
fn map(ranges: &[Range<usize>], of: &[usize], starts: &[usize]) -> Vec<u32> {
    let mut out = Vec::new();
    for (b, range) in ranges.iter().enumerate() {
        for i in 0..range.len() {
            out.extend([b as u32, (starts[of[b]] + i) as u32]);
        }
    }
    out
}

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
        let fine = context.fine();
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
        let face_starts = starts(all.iter().map(|b| b.faces.len()));
        let source_starts = starts(all.iter().map(|b| b.sources.len()));

        let scaled = |row: &Vec6, unit: f64| -> Vec<f64> {
            let of = |k: usize| if k < 3 { length } else { 1.0 };
            (0..6).map(|k| row[k] * of(k) / unit).collect()
        };
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
                face_table.extend(scaled(&b.twist_rows[i], weight * length.powi(3)));
                face_table.extend(scaled(&b.readout_flux[i], length.powi(3)));
            }
            for (s, p) in b.sources.iter().zip(&b.readout) {
                shape_sources.extend((s / length).iter());
                source_table.extend(scaled(p, length * length));
            }
        }
        let method = |b: usize| match model.bodies[b].settings.method {
            Method::MfsVertex => 0,
            Method::MfsFace => 1,
        };
        let face_blocks = blocks(&model.faces, method);
        let source_blocks = blocks(&model.sources, method);
        let sizes = Sizes {
            faces: model.rows(),
            sources: model.columns(),
            bodies: model.bodies.len(),
            images: model.images.len(),
            face_blocks: face_blocks.len(),
            source_blocks: source_blocks.len(),
        };
        let all_blocks = [&face_blocks[..], &source_blocks[..]].concat().concat();
        let n = sizes.bodies;
        let mut relations = vec![0; n * n];
        for t in 0..n {
            for s in 0..n {
                relations[t * n + s] = match (t == s, model.excluded.contains(t, s)) {
                    (true, _) => 1,
                    (_, true) => 2,
                    _ => 0,
                };
            }
        }
        let damping: Vec<f64> = model
            .bodies
            .iter()
            .flat_map(|b| b.damping.iter().map(|d| (d / weight).powi(2)))
            .collect();

        let (factors, layout, diagonal) = factors(context, model, &all, &of, weight);
        let (pairs, tasks, pair_tasks) = tasks(model, &relations, &face_blocks, &source_blocks);
        let ranges: Vec<u32> = pair_tasks
            .iter()
            .flat_map(|r| [r.start as u32, r.end as u32])
            .collect();
        let bodies: Vec<u32> = (0..n)
            .flat_map(|b| [&model.faces[b], &model.sources[b]])
            .flat_map(|r| [r.start as u32, r.len() as u32])
            .collect();
        let shape_of: Vec<u32> = of
            .iter()
            .flat_map(|s| [face_starts[*s] as u32, source_starts[*s] as u32])
            .collect();
        let words = [
            sizes.faces,
            sizes.sources,
            sizes.bodies,
            sizes.images,
            sizes.face_blocks,
            sizes.source_blocks,
            0,
            0,
        ];
        let reals = |label, values: &[f64]| context.upload(label, fine, values);
        let whole = |label, words: &[u32]| context.upload_words(label, words);
        let face_rows = Rows {
            table: reals("rows of the faces", &face_table)?,
            width: 12,
            map: whole("map of the faces", &map(&model.faces, &of, &face_starts))?,
            rows: sizes.faces,
        };
        let source_map = map(&model.sources, &of, &source_starts);
        let source_rows = Rows {
            table: reals("readout of the sources", &source_table)?,
            width: 6,
            map: whole("map of the sources", &source_map)?,
            rows: sizes.sources,
        };
        let damping_single = context.upload("damping", Arithmetic::Single, &damping)?;
        let factors = context.upload("factors", Arithmetic::Single, &factors)?;
        let open = whole("open", &[1])?;
        let table = vec![
            ("sizes", context.uniform(&words)),
            ("shape_faces", reals("faces of the shapes", &shape_faces)?),
            (
                "shape_sources",
                reals("sources of the shapes", &shape_sources)?,
            ),
            ("face_map", face_rows.map.clone()),
            ("source_map", source_rows.map.clone()),
            ("blocks", whole("blocks", &all_blocks)?),
            ("relations", whole("relations", &relations)?),
            ("face_table", face_rows.table.clone()),
            ("source_table", source_rows.table.clone()),
            ("bodies", whole("bodies", &bodies)?),
            ("shapes", whole("shapes", &shape_of)?),
            ("damping", damping_single.clone()),
            ("factors", factors),
            ("places", whole("layout of the factors", &layout)?),
            ("tasks", whole("tasks", &tasks)?),
            ("ranges", whole("ranges of the tasks", &ranges)?),
            ("going", open.clone()),
        ];
        Ok(Self {
            table,
            face_rows,
            source_rows,
            damping: reals("damping", &damping)?,
            damping_single,
            diagonal,
            open,
            pair_tasks,
            context: context.clone(),
            model: model.clone(),
            length,
            weight,
            sizes,
            pairs,
        })
    }

    /// Shares of a product with the factors: none shorter than a block.
    pub fn factor_shares(&self) -> usize {
        let widest = self
            .model
            .sources
            .iter()
            .map(|r| r.len())
            .max()
            .unwrap_or(0);
        self.sizes
            .shares(self.sizes.source_blocks, widest.div_ceil(BLOCK))
    }

    /// The pairs in batches, where each task leaves so many bytes.
    pub fn batches(&self, bytes: usize) -> Vec<PairBatch> {
        let largest = LARGEST_BATCH.min(self.context.adapter().largest_binding as usize);
        let most = (BATCH.max(BUSY * bytes).min(largest) / bytes.max(1)).max(1);
        let mut out: Vec<PairBatch> = Vec::new();
        for (number, tasks) in self.pair_tasks.iter().enumerate() {
            match out.last_mut() {
                Some(batch) if tasks.end - batch.tasks.start <= most => {
                    batch.pairs.end = number + 1;
                    batch.tasks.end = tasks.end;
                }
                _ => out.push(PairBatch {
                    pairs: number..number + 1,
                    tasks: tasks.clone(),
                }),
            }
        }
        out
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

/// Pairs, the tasks (block of sources, image, first and last block of faces) of all in order, and which
/// are each pair's.
fn tasks(
    model: &Model,
    relations: &[u32],
    face_blocks: &[[u32; 4]],
    source_blocks: &[[u32; 4]],
) -> (Vec<DevicePair>, Vec<u32>, Vec<Range<usize>>) {
    let n = model.bodies.len();
    let of = |blocks: &[[u32; 4]], b: usize| -> Range<usize> {
        let first = blocks.partition_point(|x| (x[0] as usize) < b);
        let last = blocks.partition_point(|x| (x[0] as usize) <= b);
        first..last
    };
    let work = face_blocks.len() * source_blocks.len() * model.images.len();
    let chunk = work.div_ceil(TASKS).max(1);
    let (mut pairs, mut tasks, mut ranges) = (Vec::new(), Vec::new(), Vec::new());
    for target in 0..n {
        let rows = of(face_blocks, target);
        for image in 0..model.images.len() {
            for source in 0..n {
                if image == 0 && relations[target * n + source] != 0 {
                    continue;
                }
                let start = tasks.len() / 4;
                for s in of(source_blocks, source) {
                    for first in rows.clone().step_by(chunk) {
                        let last = (first + chunk).min(rows.end);
                        tasks.extend([s as u32, image as u32, first as u32, last as u32]);
                    }
                }
                ranges.push(start..tasks.len() / 4);
                pairs.push(DevicePair {
                    target,
                    source,
                    image,
                });
            }
        }
    }
    (pairs, tasks, ranges)
}
