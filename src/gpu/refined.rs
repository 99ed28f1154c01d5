//! Iterative refinement (`shaders/refine.wgsl`) around an inner solve in single precision, and the solves of several systems that
//! the host looks at together.

use super::buffer::{Buffer, words};
use super::columns::Slice;
use super::context::Context;
use super::kernel::{Call, threads};
use super::source::{Arithmetic, Constant};
use crate::coupling::Reached;
use crate::{Error, Result};

/// What an inner solve gains: near what single precision can.
const INNER: f32 = 1e-4;
/// Cycles that are started before the host first looks.
const CYCLES: usize = 3;

/// The vectors of a solve, rows × columns, and each column's numbers; in single precision but for the residual.
pub(super) struct Iterates {
    pub rows: usize,
    pub columns: usize,
    /// Where the inner solve begins.
    pub p: Buffer,
    /// Its right-hand side.
    pub s: Buffer,
    /// Its solution.
    pub x: Buffer,
    /// `[column][4]`: γ, two of the inner solve, γ to end at.
    pub scalars: Buffer,
    /// `[column][4]`: iterations, whether the inner solve reached its end, whether refinement stalled, cycles.
    pub counts: Buffer,
    /// Columns that go on.
    pub active: Buffer,
    /// Residual, fine.
    pub rho: Buffer,
    /// Its direction.
    pub shrunk: Buffer,
    norms: Buffer,
    /// Relative residual of each column.
    relative: Buffer,
    /// Columns that haven't reached the tolerance.
    pub unfinished: Buffer,
}

impl Iterates {
    /// Of so many rows and columns; the inner solve begins in `p` and has its right-hand side in `s`, if that isn't the residual's
    /// direction itself.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(
        context: &Context,
        (rows, columns): (usize, usize),
        p: Buffer,
        s: Option<Buffer>,
    ) -> Result<Self> {
        let (fine, single) = (context.fine(), Arithmetic::Single);
        let shrunk = context.reals("shrunk", single, rows * columns)?;
        Ok(Self {
            rows,
            columns,
            p,
            s: s.unwrap_or_else(|| shrunk.clone()),
            x: context.reals("x", single, rows * columns)?,
            scalars: context.zeros("scalars", single, 4 * columns)?,
            counts: context.upload_words("counts", &vec![0; 4 * columns])?,
            active: context.upload_words("going", &vec![0; columns])?,
            rho: context.reals("residual", fine, rows * columns)?,
            shrunk,
            norms: context.zeros("norms", fine, 2 * columns)?,
            relative: context.zeros("relative", single, columns)?,
            unfinished: context.upload_words("unfinished", &vec![1; columns])?,
        })
    }

    /// A call of an entry that makes every number of a vector, or so many workgroups, with `own` before what is here.
    ///
    /// # Errors
    /// A device that fails.
    pub fn call(
        &self,
        context: &Context,
        shader: (&'static str, &'static str, Arithmetic),
        task: &[usize],
        own: &[(&'static str, &Buffer)],
        groups: Option<[u32; 3]>,
    ) -> Result<Call> {
        let mut buffers = own.to_vec();
        buffers.extend([
            ("p", &self.p),
            ("x", &self.x),
            ("s", &self.s),
            ("scalars", &self.scalars),
            ("counts", &self.counts),
            ("going", &self.active),
            ("rho", &self.rho),
            ("shrunk", &self.shrunk),
            ("norms", &self.norms),
            ("relative", &self.relative),
            ("unfinished", &self.unfinished),
        ]);
        let constants = [("COLUMNS", Constant::Number(self.columns as u32))];
        let count = groups.unwrap_or_else(|| threads(self.rows * self.columns));
        context.call(shader, &constants, task, (&[], &buffers), count)
    }

    /// A workgroup a column.
    pub fn each(&self) -> Option<[u32; 3]> {
        Some([self.columns as u32, 1, 1])
    }

    /// The calls of a cycle of refinement, the first or another: two before and two after the inner solve's right-hand side is made,
    /// and one after the inner solve.
    fn refine(
        &self,
        context: &Context,
        first: bool,
        tolerance: f64,
        (solution, stride, offset): Slice,
    ) -> Result<[Call; 5]> {
        let end = (tolerance as f32).to_bits() as usize;
        let inner = INNER.to_bits() as usize;
        let first = usize::from(first);
        let words = [self.rows, first, stride, offset, end, inner, 0, 0];
        let of = |entry, groups| {
            let shader = ("refine", entry, context.fine());
            self.call(context, shader, &words, &[("solution", solution)], groups)
        };
        Ok([
            of("norm", self.each())?,
            of("shrink", None)?,
            of("begin", self.each())?,
            of("start", None)?,
            of("correct", None)?,
        ])
    }
}

/// An inner solve: what makes the residual in the fine arithmetic, and what a cycle goes through.
pub(super) struct Inner {
    pub iterates: Iterates,
    /// ρ of X = 0, and of any X.
    pub first: Vec<Call>,
    pub again: Vec<Call>,
    /// From the residual's direction to the right-hand side.
    pub lead: Vec<Call>,
    /// One iteration that is repeated, or as many different ones as a cycle has at the most.
    pub steps: Vec<Vec<Call>>,
    /// From the iterates to the correction.
    pub last: Vec<Call>,
}

/// An inner solve with the refinement around it.
struct Refined {
    inner: Inner,
    opening: [[Call; 5]; 2],
}

impl Refined {
    /// Some cycles of so many iterations each; the first of all starts from X = 0.
    fn push<'a>(
        &'a self,
        batch: &mut Vec<&'a Call>,
        start: bool,
        cycles: usize,
        iterations: usize,
    ) {
        let inner = &self.inner;
        let most = match inner.steps.len() {
            1 => iterations,
            n => iterations.min(n),
        };
        for c in 0..cycles {
            let first = start && c == 0;
            let [norm, shrink, begin, begun, correct] = &self.opening[usize::from(!first)];
            batch.extend(if first { &inner.first } else { &inner.again });
            batch.extend([norm, shrink]);
            batch.extend(&inner.lead);
            batch.extend([begin, begun]);
            batch.extend(inner.steps.iter().cycle().take(most).flatten());
            batch.extend(&inner.last);
            batch.push(correct);
        }
        // What the last cycle reached.
        let [norm, shrink, begin, ..] = &self.opening[1];
        batch.extend(&inner.again);
        batch.extend([norm, shrink]);
        batch.extend(&inner.lead);
        batch.push(begin);
    }
}

/// When solves end, and what is said of those that don't.
pub(super) struct Limits {
    pub tolerance: f64,
    pub most: usize,
    /// Iterations of a cycle before the host first looks.
    pub few: usize,
    /// What is solved, and what to do where it isn't.
    pub what: String,
    pub remedy: &'static str,
}

/// Several solves.
pub(super) struct Solves<'a> {
    context: &'a Context,
    limits: Limits,
    all: Vec<Refined>,
}

/// How a column stands.
struct Standing {
    iterations: usize,
    residual: f64,
    stalled: bool,
    unfinished: bool,
}

/// The larger one, or what isn't a number.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

impl<'a> Solves<'a> {
    /// Inner solves, each with where its solution goes, which is zero before.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(context: &'a Context, limits: Limits, inner: Vec<(Inner, Slice)>) -> Result<Self> {
        let refined = |(inner, x): (Inner, Slice)| -> Result<Refined> {
            let cycle = |first| inner.iterates.refine(context, first, limits.tolerance, x);
            Ok(Refined {
                opening: [cycle(true)?, cycle(false)?],
                inner,
            })
        };
        Ok(Self {
            all: inner.into_iter().map(refined).collect::<Result<_>>()?,
            context,
            limits: Limits {
                few: limits.few.min(limits.most),
                ..limits
            },
        })
    }

    /// Solves, starts what follows from it, and reads: the beginnings of some arrays of real numbers, so many of each.
    /// Where the solve takes longer than most, what follows is done twice, the second time with `again` before it.
    ///
    /// # Errors
    /// A tolerance that isn't reached, or a device that fails.
    pub fn run(
        &self,
        again: &[Call],
        follow: &[Call],
        wanted: &[(&Buffer, usize)],
    ) -> Result<(Reached, Vec<Vec<f64>>)> {
        let context = self.context;
        let fine = context.fine();
        let mut batch = Vec::new();
        for solve in &self.all {
            solve.push(&mut batch, true, CYCLES, self.limits.few);
        }
        context.submit(batch.into_iter().chain(follow))?;
        // Most solves end within the first batch: what follows is read together with how they stand.
        let (values, states) = context.read_beside(fine, wanted, &self.report())?;
        if let Some(reached) = self.reached(&states, false)? {
            return Ok((reached, values));
        }
        let reached = self.finish()?;
        context.submit(again.iter().chain(follow))?;
        Ok((reached, context.read(fine, wanted)?))
    }

    /// What tells how each column stands: bytes of each array.
    fn report(&self) -> Vec<(&Buffer, usize)> {
        let mut out = Vec::new();
        for solve in &self.all {
            let (iterates, k) = (&solve.inner.iterates, solve.inner.iterates.columns);
            out.push((&iterates.counts, 16 * k));
            out.push((&iterates.relative, 4 * k));
            out.push((&iterates.unfinished, 4 * k));
        }
        out
    }

    fn standing(&self, bytes: &[Vec<u8>]) -> Vec<Standing> {
        let of = |b: &[Vec<u8>]| -> Vec<Standing> {
            let (counts, relative, unfinished) = (words(&b[0]), words(&b[1]), words(&b[2]));
            let each = counts.chunks_exact(4).zip(relative).zip(unfinished);
            each.map(|((counts, relative), unfinished)| Standing {
                iterations: counts[0] as usize,
                stalled: counts[2] != 0,
                residual: f64::from(f32::from_bits(relative)),
                unfinished: unfinished != 0,
            })
            .collect()
        };
        bytes.chunks(3).flat_map(of).collect()
    }

    /// Whether all columns are done, from what [`Solves::report`] names; where one can't be, or isn't after the
    /// last batch, the error.
    ///
    /// # Errors
    /// [`Error::Solver`] with what was reached.
    fn reached(&self, bytes: &[Vec<u8>], last: bool) -> Result<Option<Reached>> {
        let limits = &self.limits;
        let standing = self.standing(bytes);
        let reached = Reached {
            iterations: standing.iter().map(|s| s.iterations).max().unwrap_or(0),
            // What isn't a number is the worst.
            residual: standing.iter().map(|s| s.residual).fold(0.0, worse),
        };
        let bad = |s: &Standing| s.stalled || !s.residual.is_finite();
        let spent = |s: &Standing| s.unfinished && (last || s.iterations >= limits.most);
        if standing.iter().any(bad) || standing.iter().any(spent) {
            return Err(Error::Solver {
                what: format!("{} on {}", limits.what, self.context.adapter().name),
                iterations: reached.iterations,
                residual: reached.residual,
                tolerance: limits.tolerance,
                remedy: limits.remedy.into(),
            });
        }
        Ok((!standing.iter().any(|s| s.unfinished)).then_some(reached))
    }

    /// Goes on until all columns are done; every look at the device doubles what is done before the next.
    ///
    /// # Errors
    /// A tolerance that isn't reached, or a device that fails.
    fn finish(&self) -> Result<Reached> {
        let most = self.limits.most;
        let (mut iterations, mut granted) = (self.limits.few, 0);
        loop {
            iterations = (2 * iterations).min(most);
            granted += CYCLES * iterations;
            for solve in &self.all {
                let mut batch = Vec::new();
                solve.push(&mut batch, false, CYCLES, iterations);
                self.context.submit(batch)?;
            }
            let bytes = self.context.read_bytes(&self.report())?;
            // A direction without curvature counts no iterations, and must not go on for ever.
            let last = granted > 4 * CYCLES * most;
            if let Some(reached) = self.reached(&bytes, last)? {
                return Ok(reached);
            }
        }
    }
}
