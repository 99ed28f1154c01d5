//! `shaders/conjugate.wgsl`: conjugate gradients in the fine arithmetic, what isn't a product.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Call, threads};
use crate::Result;

/// The vectors of an iteration, rows × columns, and each column's numbers.
pub(super) struct Directions {
    pub r: Buffer,
    pub p: Buffer,
    pub q: Buffer,
    pub x: Buffer,
    /// `[column][4]`: γ, α, β, the right-hand side's norm.
    scalars: Buffer,
    /// `[column][4]`: iterations, whether a direction had no positive curvature, whether it is unfinished.
    pub counts: Buffer,
    /// `[column][2]`: the residual squared, the least quotient p·Ap/p·p.
    pub state: Buffer,
    /// `[iteration][2]`: α and β of the probe.
    pub history: Buffer,
    /// Columns that go on.
    pub going: Buffer,
}

/// What a solve is asked for.
pub(super) struct Limits {
    /// Residual at which a column is done, relative to its right-hand side.
    pub tolerance: f64,
    /// Most iterations.
    pub most: usize,
    /// The column whose coefficients are kept.
    pub probe: Option<usize>,
}

/// Before the first product, after each, and at the end.
pub(super) struct Steps {
    pub opening: [Call; 2],
    pub iteration: [Call; 4],
    pub finish: Call,
}

impl Directions {
    pub fn new(context: &Context, rows: usize, columns: usize, most: usize) -> Result<Self> {
        let reals = |label, count| context.reals(label, context.fine(), count);
        Ok(Self {
            r: reals("r", rows * columns)?,
            p: reals("p", rows * columns)?,
            q: reals("q", rows * columns)?,
            x: reals("x", rows * columns)?,
            scalars: reals("scalars", 4 * columns)?,
            counts: context.bytes("counts", 16 * columns)?,
            state: reals("state", 2 * columns)?,
            history: reals("history", 2 * most)?,
            going: context.upload_words("going", &vec![0; columns])?,
        })
    }
}

/// The steps of a solve of `given` into `solution`, both rows × columns.
pub(super) fn conjugate(
    context: &Context,
    directions: &Directions,
    (given, solution): (&Buffer, &Buffer),
    (rows, columns): (usize, usize),
    limits: &Limits,
) -> Result<Steps> {
    let probe = limits.probe.unwrap_or(columns);
    let mut words = [rows, columns, probe, limits.most]
        .map(|n| n as u32)
        .to_vec();
    words.extend([(limits.tolerance.powi(2) as f32).to_bits(), 0, 0, 0]);
    let uniform = context.uniform(&words);
    let buffers = [
        ("given", given.into()),
        ("r", (&directions.r).into()),
        ("p", (&directions.p).into()),
        ("q", (&directions.q).into()),
        ("x", (&directions.x).into()),
        ("solution", solution.into()),
        ("scalars", (&directions.scalars).into()),
        ("counts", (&directions.counts).into()),
        ("state", (&directions.state).into()),
        ("history", (&directions.history).into()),
        ("going", (&directions.going).into()),
        ("task", (&uniform).into()),
    ];
    let of = |entry: &str, count| {
        let kernel = context.kernel("conjugate", entry, context.fine(), &[])?;
        context.call(&kernel, &buffers, count)
    };
    let each = [columns as u32, 1, 1];
    let all = threads(rows * columns);
    Ok(Steps {
        opening: [of("begin", each)?, of("start", all)?],
        iteration: [
            of("curvature", each)?,
            of("advance", all)?,
            of("measure", each)?,
            of("turn", all)?,
        ],
        finish: of("finish", all)?,
    })
}
