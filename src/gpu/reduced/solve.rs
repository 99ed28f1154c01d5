//! `(I − LᵀGL) a = b` on the device, by conjugate gradients.

use super::products::{Product, product};
use crate::gpu::blocks::{Blocks, Part, blocks};
use crate::gpu::buffer::Buffer;
use crate::gpu::conjugate::{Directions, Limits, Steps, conjugate};
use crate::gpu::kernel::{Batch, Call};
use crate::gpu::points::PlacedPoints;
use crate::gpu::sum::Base;
use crate::{Error, Result};
use nalgebra::DMatrix;

/// Iterations that are started before the host first looks.
const FEW: usize = 12;
/// After so many the system isn't solved.
const MOST: usize = 1000;

/// The solve of some columns.
pub(super) struct Solve {
    columns: usize,
    tolerance: f64,
    directions: Directions,
    steps: Steps,
    /// q = p − LᵀG L p.
    apply: Vec<Call>,
}

/// How far a solve came.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reached {
    pub iterations: usize,
    /// Relative to the right-hand side.
    pub residual: f64,
    /// Condition number, from below; 0 without a probe.
    pub condition: f64,
}

impl Solve {
    /// Of `given` into `solution`, both modes × columns; `probe` is the column that tells of the condition number.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(
        placed: &PlacedPoints,
        (given, solution): (&Buffer, &Buffer),
        columns: usize,
        tolerance: f64,
        probe: Option<usize>,
    ) -> Result<Self> {
        let model = &placed.model;
        let (context, sizes) = (&model.context, &model.sizes);
        let fine = context.fine();
        let directions = Directions::new(context, sizes.modes, columns, MOST)?;
        let limits = Limits {
            tolerance,
            most: MOST,
            probe,
        };
        let rows = (sizes.modes, columns);
        let steps = conjugate(context, &directions, (given, solution), rows, &limits)?;
        let charges = context.reals("charges", fine, sizes.points * columns)?;
        let psi = context.reals("potentials", fine, sizes.points * columns)?;
        let whole = |b| (b, columns, 0);
        let expand = Blocks {
            part: Part::Modes,
            columns,
            x: whole(&directions.p),
            out: whole(&charges),
            scale: 1.0,
            base: Base::Nothing,
        };
        let project = Blocks {
            part: Part::Modes,
            columns,
            x: whole(&psi),
            out: whole(&directions.q),
            scale: -1.0,
            base: Base::Other(whole(&directions.p)),
        };
        let gate = &directions.going;
        let mut apply = vec![blocks(context, model, true, &expand, gate)?];
        let potential = Product::Potential;
        let (x, out) = (whole(&charges), whole(&psi));
        apply.extend(product(placed, potential, x, columns, out, gate)?);
        apply.push(blocks(context, model, false, &project, gate)?);
        Ok(Self {
            columns,
            tolerance,
            steps,
            apply,
            directions,
        })
    }

    fn iterate<'a>(&'a self, batch: &mut Batch<'a>, iterations: usize) {
        for _ in 0..iterations {
            batch.extend(&self.apply);
            batch.extend(&self.steps.iteration);
        }
        batch.push(&self.steps.finish);
    }

    /// What does for most systems.
    pub fn begin<'a>(&'a self, batch: &mut Batch<'a>) {
        batch.extend(&self.steps.opening);
        self.iterate(batch, FEW);
    }

    /// What tells how each column stands, to be read beside other results: bytes of each array.
    pub fn report(&self, placed: &PlacedPoints) -> [(&Buffer, usize); 3] {
        let size = placed.model.context.fine().size();
        let d = &self.directions;
        [
            (&d.counts, 16 * self.columns),
            (&d.state, 2 * self.columns * size),
            (&d.history, 2 * MOST * size),
        ]
    }

    /// Whether all columns are done, from what [`Solve::report`] names.
    ///
    /// # Errors
    /// A system that isn't positive definite, or that took too many iterations.
    pub fn reached(&self, placed: &PlacedPoints, bytes: &[Vec<u8>]) -> Result<Option<Reached>> {
        let model = &placed.model;
        let counts: Vec<u32> = bytes[0]
            .chunks_exact(4)
            .map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]]))
            .collect();
        let fine = model.context.fine();
        let state = fine.numbers(&bytes[1]);
        let column = |k: usize, which: usize| counts[4 * k + which] as usize;
        if let Some(k) = (0..self.columns).find(|k| column(*k, 1) != 0) {
            return Err(model.reduced.indefinite(&placed.poses, state[2 * k + 1]));
        }
        let mut reached = Reached::default();
        for k in 0..self.columns {
            reached.iterations = reached.iterations.max(column(k, 0));
            reached.residual = reached.residual.max(state[2 * k].max(0.0).sqrt());
        }
        if (0..self.columns).all(|k| column(k, 2) == 0) {
            return Ok(Some(reached));
        }
        if reached.iterations >= MOST {
            return Err(Error::Solver {
                what: format!(
                    "coupling of compressed bodies ({} unknowns) on {}",
                    model.sizes.modes,
                    model.context.adapter().name
                ),
                iterations: reached.iterations,
                residual: reached.residual,
                tolerance: self.tolerance,
                remedy:
                    "raise the tolerance, use a smaller resolved gap, the fidelity full, or the \
                         backend cpu"
                        .into(),
            });
        }
        Ok(None)
    }

    /// Goes on until all columns are done; every look at the device doubles what is done before the next.
    ///
    /// # Errors
    /// As [`Solve::reached`], or a device that fails.
    pub fn finish(&self, placed: &PlacedPoints) -> Result<(Reached, Vec<Vec<u8>>)> {
        let context = &placed.model.context;
        let mut iterations = FEW;
        loop {
            iterations = (2 * iterations).min(MOST);
            let mut batch = Batch::default();
            self.iterate(&mut batch, iterations);
            context.submit(&batch)?;
            let bytes = context.read_bytes(&self.report(placed))?;
            if let Some(reached) = self.reached(placed, &bytes)? {
                return Ok((reached, bytes));
            }
        }
    }

    /// Condition number from the probe's coefficients, from below: extreme eigenvalues of the tridiagonal matrix
    /// that conjugate gradients make (Golub and Van Loan, Matrix Computations, 10.2).
    ///
    /// # Errors
    /// One that isn't positive definite.
    pub fn condition(&self, placed: &PlacedPoints, bytes: &[Vec<u8>], probe: usize) -> Result<f64> {
        let fine = placed.model.context.fine();
        let at = 16 * probe;
        let mut four = [0; 4];
        four.copy_from_slice(&bytes[0][at..at + 4]);
        let steps = (u32::from_le_bytes(four) as usize).min(MOST);
        let history = fine.numbers(&bytes[2]);
        let (alpha, beta) = (|j: usize| history[2 * j], |j: usize| history[2 * j + 1]);
        let mut lanczos = DMatrix::zeros(steps, steps);
        for j in 0..steps {
            lanczos[(j, j)] = 1.0 / alpha(j);
            if j > 0 {
                lanczos[(j, j)] += beta(j - 1) / alpha(j - 1);
                let beside = beta(j - 1).max(0.0).sqrt() / alpha(j - 1);
                lanczos[(j, j - 1)] = beside;
                lanczos[(j - 1, j)] = beside;
            }
        }
        if steps == 0 {
            return Ok(1.0);
        }
        let eigenvalues = lanczos.symmetric_eigenvalues();
        let (low, high) = (eigenvalues.min(), eigenvalues.max());
        if low > 0.0 {
            Ok(high / low)
        } else {
            Err(placed.model.reduced.indefinite(&placed.poses, low))
        }
    }
}
