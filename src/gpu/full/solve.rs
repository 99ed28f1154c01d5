//! `(KᵀK + D²) X = G` on the device (Eq. 20 and 21): conjugate gradients in single precision, refined.

use super::products::{Product, WIDE, once};
use crate::coupling::full::{Preconditioner, Reached};
use crate::gpu::buffer::Buffer;
use crate::gpu::cgls::{Iterates, cgls};
use crate::gpu::factor::factor;
use crate::gpu::geometry::PlacedSystem;
use crate::gpu::kernel::{Batch, Call};
use crate::gpu::refine::{Cycle, Refined, refine};
use crate::gpu::share::passes;
use crate::gpu::source::Arithmetic;
use crate::gpu::sum::{Base, Slice, Sum, sum};
use crate::{Error, Result};

/// What an inner solve gains: near what single precision can.
const INNER: f64 = 1e-4;
/// Cycles and iterations of each that are started before the host first looks.
const CYCLES: usize = 3;
const FEW: usize = 12;
const MANY: usize = 64;

const FORWARD: Product = Product::Forward { potential: false };
const BACK: Product = Product::Transpose { potential: false };

/// The solve of some columns.
pub(super) struct Solve {
    columns: usize,
    iterates: Iterates,
    refined: Refined,
    first: Vec<Call>,
    again: Vec<Call>,
    opening: [Cycle; 2],
    lead: [Call; 2],
    iteration: Vec<Call>,
}

/// Several solves, all columns of G.
pub(super) struct Solves {
    all: Vec<Solve>,
    few: usize,
}

impl Solve {
    fn new(placed: &PlacedSystem, g: Slice, x: Slice, columns: usize) -> Result<Self> {
        let geometry = &placed.geometry;
        let (context, sizes) = (&geometry.context, &geometry.sizes);
        let (fine, single) = (context.fine(), Arithmetic::Single);
        let n = sizes.sources;
        let iterates = Iterates::new(context, n, columns)?;
        let refined = Refined::new(context, n, columns)?;
        let forward = sizes.shares(sizes.face_blocks, sizes.source_blocks);
        let back = sizes.shares(sizes.source_blocks, sizes.face_blocks);
        let memory = |arithmetic| -> Result<[Buffer; 3]> {
            Ok([
                context.reals("shares of K x", arithmetic, forward * sizes.faces * columns)?,
                context.reals("K x", arithmetic, sizes.faces * columns)?,
                context.reals("shares of Kᵀ y", arithmetic, back * n * columns)?,
            ])
        };
        let [rows, y, gathered] = memory(fine)?;
        let [rows1, y1, gathered1] = memory(single)?;
        let q = context.reals("N p", single, n * columns)?;

        // ρ = G, and later ρ = G − Kᵀ(K X) − D² X.
        let gate = &refined.unfinished;
        let residual = |shares: usize| {
            let task = Sum {
                rows: n,
                columns,
                parts: (&gathered, shares, columns, 0),
                scale: -1.0,
                base: Base::Other(g),
                damped: (shares > 0).then_some((&geometry.damping, x)),
                out: (&refined.rho, columns, 0),
            };
            sum(context, fine, &task, gate)
        };
        let gather = |arithmetic, parts: &Buffer, out: &Buffer, gate: &Buffer| {
            let task = Sum {
                rows: sizes.faces,
                columns,
                parts: (parts, forward, columns, 0),
                scale: 1.0,
                base: Base::Nothing,
                damped: None,
                out: (out, columns, 0),
            };
            sum(context, arithmetic, &task, gate)
        };
        let first = vec![residual(0)?];
        let again = vec![
            once(placed, fine, FORWARD, x, (&rows, columns), gate)?,
            gather(fine, &rows, &y, gate)?,
            once(
                placed,
                fine,
                BACK,
                (&y, columns, 0),
                (&gathered, columns),
                gate,
            )?,
            residual(back)?,
        ];
        let tolerance = geometry.model.settings.tolerance;
        let cycle = |first| {
            let sizes = (n, columns);
            refine(
                context,
                (&refined, &iterates),
                sizes,
                first,
                (tolerance, INNER),
                x,
            )
        };
        let factor_shares = geometry.factor_shares();
        let parts = context.reals("shares of R⁻¹ x", single, factor_shares * n * columns)?;
        let preconditioned =
            |transpose: bool, x: &Buffer, out: &Buffer, gate: &Buffer| -> Result<[Call; 2]> {
                let task = Sum {
                    rows: n,
                    columns,
                    parts: (&parts, factor_shares, columns, 0),
                    scale: 1.0,
                    base: Base::Nothing,
                    damped: None,
                    out: (out, columns, 0),
                };
                Ok([
                    factor(context, placed, transpose, (x, &parts, columns), gate)?,
                    sum(context, single, &task, gate)?,
                ])
            };
        let lead = preconditioned(true, &refined.shrunk, &iterates.s, gate)?;
        let active = &iterates.active;
        let [curvature, advance, measure, turn] = cgls(context, &iterates, n, columns)?;
        let direction = (&iterates.direction, columns, 0);
        let damped = Sum {
            rows: n,
            columns,
            parts: (&gathered1, back, columns, 0),
            scale: 1.0,
            base: Base::Nothing,
            damped: Some((&geometry.damping_single, direction)),
            out: (&q, columns, 0),
        };
        let mut iteration = Vec::new();
        iteration.extend(preconditioned(
            false,
            &iterates.p,
            &iterates.direction,
            active,
        )?);
        iteration.extend([
            once(
                placed,
                single,
                FORWARD,
                direction,
                (&rows1, columns),
                active,
            )?,
            gather(single, &rows1, &y1, active)?,
            once(
                placed,
                single,
                BACK,
                (&y1, columns, 0),
                (&gathered1, columns),
                active,
            )?,
            sum(context, single, &damped, active)?,
        ]);
        iteration.extend(preconditioned(true, &q, &iterates.q, active)?);
        iteration.extend([curvature, advance, measure, turn]);
        Ok(Self {
            columns,
            opening: [cycle(true)?, cycle(false)?],
            first,
            again,
            lead,
            iteration,
            iterates,
            refined,
        })
    }

    /// Some cycles of so many iterations each; the first of all starts from X = 0.
    fn push<'a>(&'a self, batch: &mut Batch<'a>, start: bool, cycles: usize, iterations: usize) {
        for c in 0..cycles {
            let first = start && c == 0;
            let cycle = &self.opening[usize::from(!first)];
            batch.extend(if first { &self.first } else { &self.again });
            batch.extend([&cycle.norm, &cycle.shrink]);
            batch.extend(&self.lead);
            batch.extend([&cycle.begin, &cycle.start]);
            for _ in 0..iterations {
                batch.extend(&self.iteration);
            }
            batch.push(&cycle.correct);
        }
        // What the last cycle reached.
        let cycle = &self.opening[1];
        batch.extend(&self.again);
        batch.extend([&cycle.norm, &cycle.shrink]);
        batch.extend(&self.lead);
        batch.push(&cycle.begin);
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

impl Solves {
    /// `columns` columns of G into those of X, both by source.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(placed: &PlacedSystem, g: Slice, x: Slice, columns: usize) -> Result<Self> {
        let all = passes(columns, WIDE)
            .filter(|(_, width)| *width > 0)
            .map(|(first, width)| {
                let g = (g.0, g.1, g.2 + first);
                let x = (x.0, x.1, x.2 + first);
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
            all,
            few: few.min(settings.max_iterations),
        })
    }

    /// What does for most systems.
    pub fn begin<'a>(&'a self, batch: &mut Batch<'a>) {
        for solve in &self.all {
            solve.push(batch, true, CYCLES, self.few);
        }
    }

    /// What tells how each column stands, to be read beside other results: bytes of each array.
    pub fn report(&self) -> Vec<(&Buffer, usize)> {
        let of = |s: &'_ Solve| s.columns;
        self.all
            .iter()
            .flat_map(|s| {
                [
                    (&s.iterates.counts, 16 * of(s)),
                    (&s.refined.relative, 4 * of(s)),
                    (&s.refined.unfinished, 4 * of(s)),
                ]
            })
            .collect()
    }

    fn standing(&self, bytes: &[Vec<u8>]) -> Vec<Standing> {
        let word = |b: &[u8], at: usize| {
            let mut four = [0; 4];
            four.copy_from_slice(&b[4 * at..4 * at + 4]);
            u32::from_le_bytes(four)
        };
        self.all
            .iter()
            .zip(bytes.chunks(3))
            .flat_map(|(solve, b)| {
                (0..solve.columns).map(move |k| Standing {
                    iterations: word(&b[0], 4 * k) as usize,
                    stalled: word(&b[0], 4 * k + 2) != 0,
                    residual: f64::from(f32::from_bits(word(&b[1], k))),
                    unfinished: word(&b[2], k) != 0,
                })
            })
            .collect()
    }

    /// Whether all columns are done, from what [`Solves::report`] names; where one can't be, or isn't after the
    /// last batch, the error.
    ///
    /// # Errors
    /// [`Error::Solver`] with what was reached.
    pub fn reached(
        &self,
        placed: &PlacedSystem,
        bytes: &[Vec<u8>],
        what: &str,
        last: bool,
    ) -> Result<Option<Reached>> {
        let settings = &placed.geometry.model.settings;
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
            let model = &placed.geometry.model;
            let context = &placed.geometry.context;
            return Err(Error::Solver {
                what: format!("{what} ({} rows, {} unknowns) on {}", model.rows(), model.columns(), context.adapter().name),
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
    pub fn finish(&self, placed: &PlacedSystem, what: &str) -> Result<Reached> {
        let context = &placed.geometry.context;
        let most = placed.geometry.model.settings.max_iterations;
        let (mut iterations, mut granted) = (self.few, 0);
        loop {
            iterations = (2 * iterations).min(most);
            granted += CYCLES * iterations;
            for solve in &self.all {
                let mut batch = Batch::default();
                solve.push(&mut batch, false, CYCLES, iterations);
                context.submit(&batch)?;
            }
            let bytes = context.read_bytes(&self.report())?;
            // A direction without curvature counts no iterations, and must not go on for ever.
            let last = granted > 4 * CYCLES * most;
            if let Some(reached) = self.reached(placed, &bytes, what, last)? {
                return Ok(reached);
            }
        }
    }
}
