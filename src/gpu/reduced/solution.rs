//! The bodies' solution to columns of twists: charges and momenta, what they pull with, and wrenches.

use super::products::{Product, product};
use super::solve::{Reached, Solve};
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::PairTensor;
use crate::gpu::blocks::{Blocks, Part, blocks};
use crate::gpu::buffer::Buffer;
use crate::gpu::combine::combine;
use crate::gpu::kernel::{Batch, Call};
use crate::gpu::points::{Compressed, PlacedPoints};
use crate::gpu::sum::{Base, Slice, Sum, sum};
use crate::gpu::units::{scaled, size, spatial};
use crate::gpu::wrench::{Side, wrench};
use nalgebra::DMatrix;
use std::f64::consts::PI;
use std::sync::Arc;

/// 4π: a source of strength α makes the flux 4πα.
pub(super) const FLUX: f64 = 4.0 * PI;

/// α of some columns, on the device.
pub(super) struct Solution {
    pub placed: Arc<PlacedPoints>,
    pub twists: DMatrix<f64>,
    /// What each column is in units of: on the device all are about 1.
    pub scale: Vec<f64>,
    pub columns: usize,
    /// `[point][columns]`.
    pub alpha: Buffer,
    pub momenta: DMatrix<f64>,
    pub reached: Reached,
}

/// Fixed numbers between −1 and 1.
fn probe(count: usize) -> Vec<f64> {
    // Weyl's sequence of the golden ratio.
    let of = |i: usize| 2.0 * (i as f64 * 0.618_033_988_749_894_9 + 0.25).fract() - 1.0;
    (0..count).map(of).collect()
}

/// Body-frame impulses from the device's `[body][6][columns]`, over 4π there.
pub(super) fn impulses(model: &Compressed, values: &[f64], scale: &[f64]) -> DMatrix<f64> {
    let k = scale.len();
    DMatrix::from_fn(6 * model.sizes.bodies, k, |i, c| {
        let power = if i % 6 < 3 { 4 } else { 5 };
        FLUX * values[i * k + c] * scale[c] * model.length.powi(power)
    })
}

impl Solution {
    /// Solves for columns of twists; `probing` tells of the condition number too.
    ///
    /// # Errors
    /// A system that isn't positive definite or not solved, or a device that fails.
    pub fn solve(
        placed: Arc<PlacedPoints>,
        twists: &DMatrix<f64>,
        tolerance: f64,
        probing: bool,
    ) -> Result<Self> {
        let model = placed.model.clone();
        let (context, sizes) = (&model.context, &model.sizes);
        let fine = context.fine();
        let k = twists.ncols();
        let all = k + usize::from(probing);
        let scale: Vec<f64> = (0..k).map(|c| size(twists, c, model.length)).collect();
        let device_twists =
            context.upload("twists", fine, &scaled(twists, &scale, model.length))?;
        let alpha = context.reals("charges", fine, sizes.points * k)?;
        let psi = context.reals("potentials", fine, sizes.points * k)?;
        let given = context.reals("right-hand sides", fine, sizes.modes * all)?;
        let a = context.reals("solutions", fine, sizes.modes * all)?;
        let momenta = context.reals("momenta", fine, 6 * sizes.bodies * k)?;
        let open = &model.open;
        let whole = |b| (b, k, 0);
        let moved = [expand(
            &model,
            Part::Strengths,
            k,
            whole(&device_twists),
            whole(&alpha),
            Base::Nothing,
        )?];
        let gathered = product(
            &placed,
            Product::Potential,
            whole(&alpha),
            k,
            whole(&psi),
            open,
        )?;
        let mut asked = vec![project(
            &model,
            Part::Modes,
            k,
            whole(&psi),
            (&given, all, 0),
        )?];
        let numbers = context.upload("probe", fine, &probe(sizes.modes))?;
        if probing {
            let task = Sum {
                rows: sizes.modes,
                columns: 1,
                parts: (&numbers, 1, 1, 0),
                scale: 1.0,
                base: Base::Nothing,
                damped: None,
                out: (&given, all, k),
            };
            asked.push(sum(context, fine, &task, open)?);
        }
        let solve = Solve::new(&placed, (&given, &a), all, tolerance, probing.then_some(k))?;
        // What follows from a: α = Ū x̄ + L a and Ūᵀ G α.
        let added = [expand(
            &model,
            Part::Modes,
            k,
            (&a, all, 0),
            whole(&alpha),
            Base::Out,
        )?];
        let read = [project(
            &model,
            Part::Strengths,
            k,
            whole(&psi),
            whole(&momenta),
        )?];
        let follow = |batch: &mut Batch<'_>| -> Result<()> {
            context.submit(batch)?;
            context.run(&[&moved, &added, &gathered, &read])
        };
        let mut batch = Batch::default();
        for calls in [&moved[..], &gathered, &asked] {
            batch.extend(calls);
        }
        solve.begin(&mut batch);
        follow(&mut batch)?;
        // Most solves end within the first batch: what follows is read together with how they stand.
        let count = 6 * sizes.bodies * k;
        let mut wanted = vec![(&momenta, count * fine.size())];
        wanted.extend(solve.report(&placed));
        let mut bytes = context.read_bytes(&wanted)?;
        let mut states = bytes.split_off(1);
        let mut values = fine.numbers(&bytes[0]);
        let mut reached = match solve.reached(&placed, &states)? {
            Some(reached) => reached,
            None => {
                let (reached, last) = solve.finish(&placed)?;
                states = last;
                follow(&mut Batch::default())?;
                values = context.read(fine, &[(&momenta, count)])?.swap_remove(0);
                reached
            }
        };
        if probing {
            reached.condition = solve.condition(&placed, &states, k)?;
        }
        let mut momenta = impulses(&model, &values, &scale);
        for (b, body) in model.reduced.reduced_bodies().iter().enumerate() {
            let mut rows = momenta.rows_mut(6 * b, 6);
            rows += body.parts().added_mass * twists.rows(6 * b, 6);
        }
        Ok(Self {
            twists: twists.clone(),
            columns: k,
            scale,
            alpha,
            momenta,
            reached,
            placed,
        })
    }

    /// Combinations of the columns, coefficients columns × n.
    ///
    /// # Errors
    /// A device that fails.
    pub fn combination(&self, coefficients: &DMatrix<f64>) -> Result<Self> {
        let model = &self.placed.model;
        let (context, n) = (&model.context, coefficients.ncols());
        let twists = &self.twists * coefficients;
        let scale: Vec<f64> = (0..n).map(|c| size(&twists, c, model.length)).collect();
        let alpha = context.reals("charges", context.fine(), model.sizes.points * n)?;
        let units = self.units(coefficients, &scale);
        let call = combine(
            context,
            context.fine(),
            &self.alpha,
            &units,
            &alpha,
            (model.sizes.points, 1),
        )?;
        context.run(&[&[call]])?;
        Ok(Self {
            placed: self.placed.clone(),
            momenta: &self.momenta * coefficients,
            reached: self.reached,
            columns: n,
            twists,
            scale,
            alpha,
        })
    }

    /// Coefficients between the columns' units and others.
    pub fn units(&self, coefficients: &DMatrix<f64>, scale: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(self.columns, scale.len(), |k, c| {
            coefficients[(k, c)] * self.scale[k] / scale[c]
        })
    }

    /// What every column's charges pull with, `[point][F, D][columns]`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn pulls(&self) -> Result<Buffer> {
        let model = &self.placed.model;
        let (context, k) = (&model.context, self.columns);
        let out = context.reals(
            "pulls",
            context.fine(),
            model.sizes.points * model.pull() * k,
        )?;
        let alpha = (&self.alpha, k, 0);
        let calls = product(
            &self.placed,
            Product::Pull,
            alpha,
            k,
            (&out, k, 0),
            &model.open,
        )?;
        context.run(&[&calls])?;
        Ok(out)
    }

    fn side<'a>(&'a self, pull: &'a Buffer) -> Side<'a> {
        Side {
            alpha: &self.alpha,
            change: &self.alpha,
            columns: self.columns,
            pull,
        }
    }

    /// ∇_g E of every pair of columns, these and another's.
    ///
    /// # Errors
    /// A device that fails.
    pub fn wrenches(&self, pulls: &Buffer, other: (&Self, &Buffer)) -> Result<Vec<Vec<Vec6>>> {
        let model = &self.placed.model;
        let (context, fine) = (&model.context, model.context.fine());
        let (n, m) = (self.columns, other.0.columns);
        let count = model.sizes.bodies * n * m * 6;
        let out = context.reals("wrenches", fine, count)?;
        let sides = (self.side(pulls), other.0.side(other.1));
        let call = wrench(context, &self.placed, sides, None, &out)?;
        context.run(&[&[call]])?;
        let values = context.read(fine, &[(&out, count)])?.swap_remove(0);
        let of = |b: usize, x: usize, y: usize| {
            let at = ((b * n + x) * m + y) * 6;
            let unit = FLUX * self.scale[x] * other.0.scale[y];
            spatial(model.length, &self.placed.middle, &values[at..at + 6], unit)
        };
        let pairs = |b: usize| {
            let each = |x: usize| (0..m).map(move |y| of(b, x, y));
            (0..n).flat_map(each).collect()
        };
        Ok((0..model.sizes.bodies).map(pairs).collect())
    }

    /// The same of these columns with one another, as a tensor.
    ///
    /// # Errors
    /// A device that fails.
    pub fn tensor(&self, pulls: &Buffer) -> Result<PairTensor> {
        let k = self.columns;
        let all = self.wrenches(pulls, (self, pulls))?;
        // The two orders of a pair are summed in different orders: one of them stands for both.
        let of = |wrenches: &Vec<Vec6>| {
            let at = |x: usize, y: usize| wrenches[x.max(y) * k + x.min(y)];
            DMatrix::from_fn(6, k * k, |i, pair| at(pair / k, pair % k)[i])
        };
        Ok(PairTensor::new(k, all.iter().map(of).collect()))
    }
}

/// `out = L x` or `Ū x` (+ base).
pub(super) fn expand(
    model: &Compressed,
    part: Part,
    columns: usize,
    x: Slice,
    out: Slice,
    base: Base,
) -> Result<Call> {
    let task = Blocks {
        part,
        columns,
        x,
        out,
        scale: 1.0,
        base,
    };
    blocks(&model.context, model, true, &task, &model.open)
}

/// `out = Lᵀ x` or `Ūᵀ x`.
pub(super) fn project(
    model: &Compressed,
    part: Part,
    columns: usize,
    x: Slice,
    out: Slice,
) -> Result<Call> {
    let task = Blocks {
        part,
        columns,
        x,
        out,
        scale: 1.0,
        base: Base::Nothing,
    };
    blocks(&model.context, model, false, &task, &model.open)
}
