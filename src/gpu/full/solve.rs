//! `(KᵀK + D²) X = G` on the device (Eq. 20 and 21): conjugate gradients in single precision, refined.

use super::products::{Product, WIDE, once};
use super::refined::{Iterates, factor};
use crate::coupling::Reached;
use crate::coupling::full::Preconditioner;
use crate::gpu::buffer::{Buffer, words};
use crate::gpu::columns::{Base, Slice, Sum, passes};
use crate::gpu::geometry::PlacedSystem;
use crate::gpu::kernel::Call;
use crate::gpu::source::Arithmetic;
use crate::{Error, Result};

/// Cycles and iterations of each that are started before the host first looks.
const CYCLES: usize = 3;
const FEW: usize = 12;
const MANY: usize = 64;

const FORWARD: Product = Product::forward(false);
const BACK: Product = Product::back(false);

/// The solve of some columns.
pub(super) struct Solve {
    columns: usize,
    iterates: Iterates,
    first: Vec<Call>,
    again: Vec<Call>,
    opening: [[Call; 5]; 2],
    lead: [Call; 2],
    iteration: Vec<Call>,
}

/// Several solves, all columns of G.
pub(super) struct Solves<'a> {
    placed: &'a PlacedSystem,
    all: Vec<Solve>,
    few: usize,
    /// What is solved.
    what: &'static str,
}

impl Solve {
    fn new(placed: &PlacedSystem, g: Slice, x: Slice, columns: usize) -> Result<Self> {
        let geometry = &placed.geometry;
        let (context, sizes) = (&geometry.context, &geometry.sizes);
        let (fine, single) = (context.fine(), Arithmetic::Single);
        let n = sizes.sources;
        let iterates = Iterates::new(context, n, columns)?;
        let (faces, _, forward) = FORWARD.sizes(sizes);
        let (_, _, back) = BACK.sizes(sizes);
        let whole = |b| (b, columns, 0);
        let memory = |arithmetic| -> Result<[Buffer; 3]> {
            Ok([
                context.reals("shares of K x", arithmetic, forward * faces * columns)?,
                context.reals("K x", arithmetic, faces * columns)?,
                context.reals("shares of Kᵀ y", arithmetic, back * n * columns)?,
            ])
        };
        // The shares of Kᵀ K x.
        let normal = |arithmetic, memory: &[Buffer; 3], x: Slice, gate: &Buffer| {
            let [rows, y, gathered] = memory;
            let y = (y, columns, 0);
            let gather = Sum::new((faces, columns), (rows, forward), y);
            Ok::<_, Error>([
                once(placed, arithmetic, FORWARD, x, (rows, columns), gate)?,
                gather.call(context, arithmetic, gate)?,
                once(placed, arithmetic, BACK, y, (gathered, columns), gate)?,
            ])
        };
        let (memory, memory1) = (memory(fine)?, memory(single)?);
        let q = context.reals("N p", single, n * columns)?;

        // ρ = G, and later ρ = G − Kᵀ(K X) − D² X.
        let gate = &iterates.unfinished;
        let residual = |shares: usize| {
            let task = Sum {
                scale: -1.0,
                base: Base::Other(g),
                damped: (shares > 0).then_some((&geometry.damping, x)),
                ..Sum::new((n, columns), (&memory[2], shares), whole(&iterates.rho))
            };
            task.call(context, fine, gate)
        };
        let first = vec![residual(0)?];
        let mut again = Vec::from(normal(fine, &memory, x, gate)?);
        again.push(residual(back)?);
        let tolerance = geometry.model.settings.tolerance;
        let cycle = |first| iterates.refine(context, first, tolerance, x);
        let shares = geometry.factor_shares();
        let parts = context.reals("shares of R⁻¹ x", single, shares * n * columns)?;
        let preconditioned =
            |transpose, x, out, gate| factor(placed, transpose, (x, &parts, out), columns, gate);
        let lead = preconditioned(true, &iterates.shrunk, &iterates.s, gate)?;
        let active = &iterates.active;
        let direction = whole(&iterates.direction);
        let damped = Sum {
            damped: Some((&geometry.damping_single, direction)),
            ..Sum::new((n, columns), (&memory1[2], back), whole(&q))
        };
        let mut iteration = Vec::new();
        iteration.extend(preconditioned(
            false,
            &iterates.p,
            &iterates.direction,
            active,
        )?);
        iteration.extend(normal(single, &memory1, direction, active)?);
        iteration.push(damped.call(context, single, active)?);
        iteration.extend(preconditioned(true, &q, &iterates.q, active)?);
        iteration.extend(iterates.cgls(context)?);
        Ok(Self {
            columns,
            opening: [cycle(true)?, cycle(false)?],
            first,
            again,
            lead,
            iteration,
            iterates,
        })
    }

    /// Some cycles of so many iterations each; the first of all starts from X = 0.
    fn push<'a>(
        &'a self,
        batch: &mut Vec<&'a Call>,
        start: bool,
        cycles: usize,
        iterations: usize,
    ) {
        for c in 0..cycles {
            let first = start && c == 0;
            let [norm, shrink, begin, begun, correct] = &self.opening[usize::from(!first)];
            batch.extend(if first { &self.first } else { &self.again });
            batch.extend([norm, shrink]);
            batch.extend(&self.lead);
            batch.extend([begin, begun]);
            for _ in 0..iterations {
                batch.extend(&self.iteration);
            }
            batch.push(correct);
        }
        // What the last cycle reached.
        let [norm, shrink, begin, ..] = &self.opening[1];
        batch.extend(&self.again);
        batch.extend([norm, shrink]);
        batch.extend(&self.lead);
        batch.push(begin);
    }
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
    /// `columns` columns of G into those of X, both by source.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(
        placed: &'a PlacedSystem,
        what: &'static str,
        g: Slice,
        x: Slice,
        columns: usize,
    ) -> Result<Self> {
        let all = passes(columns, WIDE)
            .filter(|(_, width)| *width > 0)
            .map(|(first, width)| {
                let (g, x) = ((g.0, g.1, g.2 + first), (x.0, x.1, x.2 + first));
                Solve::new(placed, g, x, width)
            })
            .collect::<Result<_>>()?;
        let settings = &placed.geometry.model.settings;
        let factored = settings.preconditioner == Preconditioner::Factors;
        let few = if factored && !placed.geometry.diagonal {
            FEW
        } else {
            MANY
        };
        Ok(Self {
            placed,
            what,
            all,
            few: few.min(settings.max_iterations),
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
        let context = &self.placed.geometry.context;
        let fine = context.fine();
        let mut batch = Vec::new();
        for solve in &self.all {
            solve.push(&mut batch, true, CYCLES, self.few);
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
            let (iterates, k) = (&solve.iterates, solve.columns);
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
        let geometry = &self.placed.geometry;
        let (model, context) = (&geometry.model, &geometry.context);
        let settings = &model.settings;
        let standing = self.standing(bytes);
        let reached = Reached {
            iterations: standing.iter().map(|s| s.iterations).max().unwrap_or(0),
            // What isn't a number is the worst.
            residual: standing.iter().map(|s| s.residual).fold(0.0, worse),
        };
        let bad = |s: &Standing| s.stalled || !s.residual.is_finite();
        let most = settings.max_iterations;
        let spent = |s: &Standing| s.unfinished && (last || s.iterations >= most);
        if standing.iter().any(bad) || standing.iter().any(spent) {
            return Err(Error::Solver {
                what: format!(
                    "{} ({} rows, {} unknowns) on {}",
                    self.what,
                    model.rows(),
                    model.columns(),
                    context.adapter().name
                ),
                iterations: reached.iterations,
                residual: reached.residual,
                tolerance: settings.tolerance,
                remedy: "raise the tolerance, refine the meshes where bodies are close, use the factors as \
                         preconditioner, or the backend cpu"
                    .into(),
            });
        }
        Ok((!standing.iter().any(|s| s.unfinished)).then_some(reached))
    }

    /// Goes on until all columns are done; every look at the device doubles what is done before the next.
    ///
    /// # Errors
    /// A tolerance that isn't reached, or a device that fails.
    fn finish(&self) -> Result<Reached> {
        let geometry = &self.placed.geometry;
        let context = &geometry.context;
        let most = geometry.model.settings.max_iterations;
        let (mut iterations, mut granted) = (self.few, 0);
        loop {
            iterations = (2 * iterations).min(most);
            granted += CYCLES * iterations;
            for solve in &self.all {
                let mut batch = Vec::new();
                solve.push(&mut batch, false, CYCLES, iterations);
                context.submit(batch)?;
            }
            let bytes = context.read_bytes(&self.report())?;
            // A direction without curvature counts no iterations, and must not go on for ever.
            let last = granted > 4 * CYCLES * most;
            if let Some(reached) = self.reached(&bytes, last)? {
                return Ok(reached);
            }
        }
    }
}
