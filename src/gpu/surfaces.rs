//! What of the bodies' surfaces lies on the device, whatever their faces are: constants once, in each shape's own frame.
//!
//! Lengths are in units of the scene's size, so that single precision resolves them.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::Table;
use super::source::Surface;
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::Exclusions;
use crate::geometry::Image;
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
/// Bodies that don't see each other, as the shaders have it.
const APART: u32 = 2;

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

/// What bodies are made of, in the device's units.
pub(super) struct Parts<'a> {
    pub surface: Surface,
    /// The unit of length, m.
    pub length: f64,
    /// Faces and sources of each body, and the number of its shape.
    pub faces: &'a [Range<usize>],
    pub sources: &'a [Range<usize>],
    pub of: &'a [usize],
    /// Faces and sources of each shape.
    pub shapes: Vec<[usize; 2]>,
    /// How each body's rows are made.
    pub method: Vec<u32>,
    pub images: &'a [Image],
    pub excluded: &'a Exclusions,
    /// `[shape's face]`, as the surface has it.
    pub shape_faces: Vec<f64>,
    /// `[shape's source][3]`.
    pub shape_sources: Vec<f64>,
    /// `[shape's face][12]` and `[shape's source][6]`: what twists ask for there.
    pub face_table: Vec<f64>,
    pub source_table: Vec<f64>,
}

/// All that doesn't change with the poses.
pub(super) struct Surfaces {
    pub context: Arc<Context>,
    pub surface: Surface,
    /// L, m.
    pub length: f64,
    pub sizes: Sizes,
    /// The walls' images, the identity first.
    pub images: Vec<Image>,
    pub pairs: Vec<DevicePair>,
    /// What the shaders share.
    pub table: Table,
    /// What twists ask for on the faces, and read out of the sources.
    pub face_rows: Rows,
    pub source_rows: Rows,
    /// The table's relations, but no body sees itself.
    pub apart: Buffer,
    /// Tasks of every pair, as `ranges` has them.
    pair_tasks: Vec<Range<usize>>,
    /// Sources of the largest body.
    widest: usize,
    /// Always one: what isn't part of a solve goes on.
    pub open: Buffer,
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

/// A row of what unit twists ask for, in units of lengths and of `unit`.
pub(super) fn scaled(row: &Vec6, length: f64, unit: f64) -> impl Iterator<Item = f64> {
    let of = move |k: usize| if k < 3 { length } else { 1.0 };
    let row = *row;
    (0..6).map(move |k| row[k] * of(k) / unit)
}

/// Where each begins.
fn starts(sizes: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut at = 0;
    let start = |n| {
        at += n;
        at - n
    };
    sizes.map(start).collect()
}

/// (body, first, count, method) of every block.
fn blocks(ranges: &[Range<usize>], method: &[u32]) -> Vec<[u32; 4]> {
    let mut out = Vec::new();
    for (b, range) in ranges.iter().enumerate() {
        for first in range.clone().step_by(BLOCK) {
            let count = BLOCK.min(range.end - first);
            out.push([b as u32, first as u32, count as u32, method[b]]);
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

fn end(ranges: &[Range<usize>]) -> usize {
    ranges.last().map_or(0, |r| r.end)
}

impl Surfaces {
    /// Uploads bodies.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(context: &Arc<Context>, parts: Parts) -> Result<Self> {
        let face_blocks = blocks(parts.faces, &parts.method);
        let source_blocks = blocks(parts.sources, &parts.method);
        let sizes = Sizes {
            faces: end(parts.faces),
            sources: end(parts.sources),
            bodies: parts.of.len(),
            images: parts.images.len(),
            face_blocks: face_blocks.len(),
            source_blocks: source_blocks.len(),
        };
        let n = sizes.bodies;
        let signs = parts.images.iter().map(|i| u32::from(i.sign < 0.0));
        let relation = |t: usize, s: usize| match (t == s, parts.excluded.contains(t, s)) {
            (true, _) => 1,
            (_, true) => APART,
            _ => 0,
        };
        let pairs = (0..n * n).map(|at| relation(at / n, at % n));
        let relations: Vec<u32> = pairs.chain(signs).collect();
        let mut apart = relations.clone();
        (0..n).for_each(|b| apart[b * n + b] = APART);

        let (pairs, tasks, pair_tasks) = tasks(&sizes, &relations, &face_blocks, &source_blocks);
        let ranges: Vec<u32> = pair_tasks
            .iter()
            .flat_map(|r| [r.start as u32, r.end as u32])
            .collect();
        let bodies: Vec<u32> = (0..n)
            .flat_map(|b| [&parts.faces[b], &parts.sources[b]])
            .flat_map(|r| [r.start as u32, r.len() as u32])
            .collect();
        let [face_starts, source_starts] =
            [0, 1].map(|k| starts(parts.shapes.iter().map(|s| s[k])));
        let shape_of: Vec<u32> = (parts.of.iter())
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
        let fine = context.fine();
        let reals = |label, values: &[f64]| context.upload(label, fine, values);
        let whole = |label, words: &[u32]| context.upload_words(label, words);
        let face_map = map(parts.faces, parts.of, &face_starts);
        let source_map = map(parts.sources, parts.of, &source_starts);
        let face_rows = Rows {
            table: reals("rows of the faces", &parts.face_table)?,
            width: 12,
            map: whole("map of the faces", &face_map)?,
            rows: sizes.faces,
        };
        let source_rows = Rows {
            table: reals("readout of the sources", &parts.source_table)?,
            width: 6,
            map: whole("map of the sources", &source_map)?,
            rows: sizes.sources,
        };
        let open = whole("open", &[1])?;
        let all_blocks = [&face_blocks[..], &source_blocks[..]].concat().concat();
        let shape_faces = reals("faces of the shapes", &parts.shape_faces)?;
        let shape_sources = reals("sources of the shapes", &parts.shape_sources)?;
        let table = vec![
            ("sizes", context.uniform(&words)),
            ("shape_faces", shape_faces),
            ("shape_sources", shape_sources),
            ("face_map", face_rows.map.clone()),
            ("source_map", source_rows.map.clone()),
            ("blocks", whole("blocks", &all_blocks)?),
            ("relations", whole("relations", &relations)?),
            ("face_table", face_rows.table.clone()),
            ("source_table", source_rows.table.clone()),
            ("bodies", whole("bodies", &bodies)?),
            ("shapes", whole("shapes", &shape_of)?),
            ("tasks", whole("tasks", &tasks)?),
            ("ranges", whole("ranges of the tasks", &ranges)?),
            ("going", open.clone()),
        ];
        Ok(Self {
            apart: whole("relations between bodies", &apart)?,
            widest: parts.sources.iter().map(|r| r.len()).max().unwrap_or(0),
            context: context.clone(),
            surface: parts.surface,
            length: parts.length,
            images: parts.images.to_vec(),
            table,
            face_rows,
            source_rows,
            open,
            pair_tasks,
            sizes,
            pairs,
        })
    }

    /// Shares of a product with the factors: none shorter than a block.
    pub fn factor_shares(&self) -> usize {
        let widest = self.widest.div_ceil(BLOCK);
        self.sizes.shares(self.sizes.source_blocks, widest)
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

/// Pairs, the tasks (block of sources, image, first and last block of faces) of all in order, and which
/// are each pair's.
fn tasks(
    sizes: &Sizes,
    relations: &[u32],
    face_blocks: &[[u32; 4]],
    source_blocks: &[[u32; 4]],
) -> (Vec<DevicePair>, Vec<u32>, Vec<Range<usize>>) {
    let n = sizes.bodies;
    let of = |blocks: &[[u32; 4]], b: usize| -> Range<usize> {
        let first = blocks.partition_point(|x| (x[0] as usize) < b);
        let last = blocks.partition_point(|x| (x[0] as usize) <= b);
        first..last
    };
    let work = face_blocks.len() * source_blocks.len() * sizes.images;
    let chunk = work.div_ceil(TASKS).max(1);
    let (mut pairs, mut tasks, mut ranges) = (Vec::new(), Vec::new(), Vec::new());
    for target in 0..n {
        let rows = of(face_blocks, target);
        for image in 0..sizes.images {
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
