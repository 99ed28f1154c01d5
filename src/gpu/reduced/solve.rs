//! `(I − LᵀGL) a = b` on the device, by conjugate gradients in the fine arithmetic (`shaders/conjugate.wgsl`).

use super::products::{Blocks, Part, Product, product};
use crate::gpu::buffer::{Buffer, words};
use crate::gpu::columns::Base;
use crate::gpu::kernel::{Call, threads};
use crate::gpu::lanczos;
use crate::gpu::points::PlacedPoints;
use crate::{Error, Result};

/// Iterations that are started before the host first looks.
const FEW: usize = 12;
/// After so many the system isn't solved.
const MOST: usize = 1000;

/// The solve of some columns.
pub(super) struct Solve<'a> {
    placed: &'a PlacedPoints,
    columns: usize,
    tolerance: f64,
    /// The column whose coefficients are kept.
    probe: Option<usize>,
    /// `[column][4]`: iterations, whether a direction had no positive curvature, whether it is unfinished.
    counts: Buffer,
    /// `[column][2]`: the residual squared, the least quotient p·Ap/p·p.
    state: Buffer,
    /// `[iteration][2]`: α and β of the probe.
    history: Buffer,
    opening: [Call; 2],
    /// q = p − LᵀG L p, and the step.
    iteration: Vec<Call>,
    last: Call,
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

impl<'a> Solve<'a> {
    /// Of `given` into `solution`, both modes × columns; `probe` is the column that tells of the condition number.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(
        placed: &'a PlacedPoints,
        (given, solution): (&Buffer, &Buffer),
        columns: usize,
        tolerance: f64,
        probe: Option<usize>,
    ) -> Result<Self> {
        let model = &placed.model;
        let (context, sizes) = (&model.context, &model.sizes);
        let fine = context.fine();
        let rows = sizes.modes;
        let reals = |label, count| context.reals(label, fine, count);
        let (p, q) = (reals("p", rows * columns)?, reals("q", rows * columns)?);
        let counts = context.bytes("counts", 16 * columns)?;
        let state = reals("state", 2 * columns)?;
        let history = reals("history", 2 * MOST)?;
        let going = context.upload_words("going", &vec![0; columns])?;
        let buffers = [
            ("given", given),
            ("solution", solution),
            ("r", &reals("r", rows * columns)?),
            ("p", &p),
            ("q", &q),
            ("x", &reals("x", rows * columns)?),
            // `[column][4]`: γ, α, β, the right-hand side's norm.
            ("scalars", &reals("scalars", 4 * columns)?),
            ("counts", &counts),
            ("state", &state),
            ("history", &history),
            ("going", &going),
        ];
        let end = (tolerance.powi(2) as f32).to_bits() as usize;
        let words = [rows, columns, probe.unwrap_or(columns), MOST, end, 0, 0, 0];
        let of = |entry, count| {
            let shader = ("conjugate", entry, fine);
            context.call(shader, &[], &words, (&[], &buffers), count)
        };
        let each = [columns as u32, 1, 1];
        let all = threads(rows * columns);

        let charges = reals("charges", sizes.points * columns)?;
        let psi = reals("potentials", sizes.points * columns)?;
        let [x, y, p, q] = [&charges, &psi, &p, &q].map(|b| (b, columns, 0));
        let project = Blocks {
            scale: -1.0,
            base: Base::Other(p),
            ..Blocks::project(Part::Modes, columns, y, q)
        };
        let expand = Blocks::expand(Part::Modes, columns, p, x);
        let mut iteration = vec![expand.call(model, &going)?];
        let potential = Product::Potential;
        iteration.extend(product(placed, potential, x, columns, y, &going)?);
        iteration.extend([
            project.call(model, &going)?,
            of("curvature", each)?,
            of("advance", all)?,
            of("measure", each)?,
            of("turn", all)?,
        ]);
        Ok(Self {
            placed,
            columns,
            tolerance,
            probe,
            opening: [of("begin", each)?, of("start", all)?],
            iteration,
            last: of("finish", all)?,
            counts,
            state,
            history,
        })
    }

    fn iterate<'b>(&'b self, batch: &mut Vec<&'b Call>, iterations: usize) {
        for _ in 0..iterations {
            batch.extend(&self.iteration);
        }
        batch.push(&self.last);
    }

    /// Solves after some calls, starts what follows, and reads: the beginnings of some arrays of real numbers, so many
    /// of each.
    ///
    /// # Errors
    /// A system that isn't positive definite or not solved, or a device that fails.
    pub fn run<'b>(
        &'b self,
        mut batch: Vec<&'b Call>,
        follow: &[&'b Call],
        wanted: &[(&Buffer, usize)],
    ) -> Result<(Reached, Vec<Vec<f64>>)> {
        let context = &self.placed.model.context;
        let fine = context.fine();
        batch.extend(&self.opening);
        self.iterate(&mut batch, FEW);
        batch.extend(follow);
        context.submit(batch)?;
        // Most solves end within the first batch: what follows is read together with how they stand.
        let (mut values, mut states) = context.read_beside(fine, wanted, &self.report())?;
        let mut reached = match self.reached(&states)? {
            Some(reached) => reached,
            None => {
                let (reached, last) = self.finish()?;
                states = last;
                context.submit(follow.iter().copied())?;
                values = context.read(fine, wanted)?;
                reached
            }
        };
        if let Some(probe) = self.probe {
            reached.condition = self.condition(&states, probe)?;
        }
        Ok((reached, values))
    }

    /// What tells how each column stands: bytes of each array.
    fn report(&self) -> [(&Buffer, usize); 3] {
        let size = self.placed.model.context.fine().size();
        [
            (&self.counts, 16 * self.columns),
            (&self.state, 2 * self.columns * size),
            (&self.history, 2 * MOST * size),
        ]
    }

    /// Whether all columns are done, from what [`Solve::report`] names.
    ///
    /// # Errors
    /// A system that isn't positive definite, or that took too many iterations.
    fn reached(&self, bytes: &[Vec<u8>]) -> Result<Option<Reached>> {
        let model = &self.placed.model;
        let counts = words(&bytes[0]);
        let fine = model.context.fine();
        let state = fine.numbers(&bytes[1]);
        let column = |k: usize, which: usize| counts[4 * k + which] as usize;
        if let Some(k) = (0..self.columns).find(|k| column(*k, 1) != 0) {
            return Err(model
                .reduced
                .indefinite(&self.placed.poses, state[2 * k + 1]));
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
    fn finish(&self) -> Result<(Reached, Vec<Vec<u8>>)> {
        let context = &self.placed.model.context;
        let mut iterations = FEW;
        loop {
            iterations = (2 * iterations).min(MOST);
            let mut batch = Vec::new();
            self.iterate(&mut batch, iterations);
            context.submit(batch)?;
            let bytes = context.read_bytes(&self.report())?;
            if let Some(reached) = self.reached(&bytes)? {
                return Ok((reached, bytes));
            }
        }
    }

    /// Condition number from the probe's coefficients, from below: extreme eigenvalues of the tridiagonal matrix
    /// that conjugate gradients make (Golub and Van Loan, Matrix Computations, 10.2).
    ///
    /// # Errors
    /// One that isn't positive definite.
    fn condition(&self, bytes: &[Vec<u8>], probe: usize) -> Result<f64> {
        let model = &self.placed.model;
        let fine = model.context.fine();
        let steps = (words(&bytes[0])[4 * probe] as usize).min(MOST);
        let history = fine.numbers(&bytes[2]);
        match lanczos::extremes(steps, |j| history[2 * j], |j| history[2 * j + 1]) {
            None => Ok(1.0),
            Some([low, high]) if low > 0.0 => Ok(high / low),
            Some([low, _]) => Err(model.reduced.indefinite(&self.placed.poses, low)),
        }
    }
}
