//! The bodies' solution to columns of twists: charges and momenta, what they pull with, and wrenches.

use super::products::{Blocks, Part, Product, product};
use super::solve::{Reached, Solve};
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::PairTensor;
use crate::gpu::buffer::Buffer;
use crate::gpu::columns::{Base, Sum, combine};
use crate::gpu::kernel::{Call, Table};
use crate::gpu::points::PlacedPoints;
use crate::gpu::source::Constant;
use crate::gpu::units::{Twists, spatial};
use nalgebra::DMatrix;
use std::f64::consts::PI;
use std::sync::Arc;

/// 4π: a source of strength α makes the flux 4πα.
pub(super) const FLUX: f64 = 4.0 * PI;

/// α of some columns, on the device.
pub(super) struct Solution {
    pub placed: Arc<PlacedPoints>,
    pub twists: Twists,
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

/// Columns of charges, and their pulls.
#[derive(Clone, Copy)]
pub(super) struct Side<'a> {
    /// `[point][columns]`.
    pub alpha: &'a Buffer,
    /// `[point][F, D][columns]`, displaced `[point][F, D, δF, δD][columns]`.
    pub pull: &'a Buffer,
    /// δα, read where displaced alone.
    pub change: &'a Buffer,
    pub columns: usize,
}

/// `out[body][left][right][6]`, displaced `[12]`: wrenches about the scene's middle, then their tangents, over 4π
/// (`shaders/wrench.wgsl`).
pub(super) fn wrench(
    placed: &PlacedPoints,
    (left, right): (Side, Side),
    displaced: Option<&Table>,
    out: &Buffer,
) -> Result<Call> {
    let model = &placed.model;
    let constants = [
        ("FADING", Constant::Flag(model.fading)),
        ("TANGENT", Constant::Flag(displaced.is_some())),
    ];
    let buffers = [
        ("alpha_left", left.alpha),
        ("pull_left", left.pull),
        ("change_left", left.change),
        ("alpha_right", right.alpha),
        ("pull_right", right.pull),
        ("change_right", right.change),
        ("out", out),
    ];
    let count = [model.sizes.bodies, left.columns, right.columns].map(|n| n as u32);
    model.context.call(
        ("wrench", "main", model.context.fine()),
        &constants,
        &[left.columns, right.columns, 0, 0],
        (displaced.unwrap_or(&placed.table), &buffers),
        count,
    )
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
        let twists = Twists::new(twists.clone(), model.length);
        let given_twists = twists.upload(context)?;
        let alpha = context.reals("charges", fine, sizes.points * k)?;
        let psi = context.reals("potentials", fine, sizes.points * k)?;
        let given = context.reals("right-hand sides", fine, sizes.modes * all)?;
        let a = context.reals("solutions", fine, sizes.modes * all)?;
        let momenta = context.reals("momenta", fine, 6 * sizes.bodies * k)?;
        let open = &model.open;
        let whole = |b| (b, k, 0);
        let strengths = Blocks::expand(Part::Strengths, k, whole(&given_twists), whole(&alpha));
        let moved = strengths.call(&model, open)?;
        let (x, y) = (whole(&alpha), whole(&psi));
        let gathered = product(&placed, Product::Potential, x, k, y, open)?;
        let asked = Blocks::project(Part::Modes, k, y, (&given, all, 0)).call(&model, open)?;
        let mut before = vec![&moved];
        before.extend(&gathered);
        before.push(&asked);
        let numbers = context.upload("probe", fine, &probe(sizes.modes))?;
        let probed = Sum::new((sizes.modes, 1), (&numbers, 1), (&given, all, k));
        let probed = probing.then(|| probed.call(context, fine, open));
        let probed = probed.transpose()?;
        before.extend(&probed);
        let solve = Solve::new(&placed, (&given, &a), all, tolerance, probing.then_some(k))?;
        // What follows from a: α = Ū x̄ + L a and Ūᵀ G α.
        let added = Blocks {
            base: Base::Out,
            ..Blocks::expand(Part::Modes, k, (&a, all, 0), x)
        };
        let added = added.call(&model, open)?;
        let read = Blocks::project(Part::Strengths, k, y, whole(&momenta)).call(&model, open)?;
        let mut follow = vec![&moved, &added];
        follow.extend(&gathered);
        follow.push(&read);
        let wanted = [(&momenta, 6 * sizes.bodies * k)];
        let (reached, values) = solve.run(before, &follow, &wanted)?;
        let mut momenta = twists.impulses(&values[0], FLUX);
        for (b, body) in model.reduced.reduced_bodies().iter().enumerate() {
            let mut rows = momenta.rows_mut(6 * b, 6);
            rows += body.parts().added_mass * twists.all.rows(6 * b, 6);
        }
        Ok(Self {
            twists,
            columns: k,
            alpha,
            momenta,
            reached,
            placed: placed.clone(),
        })
    }

    /// Combinations of the columns, coefficients columns × n, and the coefficients between both's units.
    ///
    /// # Errors
    /// A device that fails.
    pub fn combination(&self, coefficients: &DMatrix<f64>) -> Result<(Self, DMatrix<f64>)> {
        let model = &self.placed.model;
        let (context, n) = (&model.context, coefficients.ncols());
        let (twists, units) = self.twists.combined(coefficients);
        let alpha = context.reals("charges", context.fine(), model.sizes.points * n)?;
        let call = combine(
            context,
            &self.alpha,
            &units,
            &alpha,
            (model.sizes.points, 1),
        )?;
        context.submit([&call])?;
        let out = Self {
            placed: self.placed.clone(),
            momenta: &self.momenta * coefficients,
            reached: self.reached,
            columns: n,
            twists,
            alpha,
        };
        Ok((out, units))
    }

    /// What every column's charges pull with, `[point][F, D][columns]`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn pulls(&self) -> Result<Buffer> {
        let model = &self.placed.model;
        let (context, k) = (&model.context, self.columns);
        let count = model.sizes.points * model.pull() * k;
        let out = context.reals("pulls", context.fine(), count)?;
        let (x, y) = ((&self.alpha, k, 0), (&out, k, 0));
        let calls = product(&self.placed, Product::Pull, x, k, y, &model.open)?;
        context.submit(&calls)?;
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
        let call = wrench(&self.placed, sides, None, &out)?;
        context.submit([&call])?;
        let values = context.read(fine, &[(&out, count)])?.swap_remove(0);
        let of = |b: usize, x: usize, y: usize| {
            let at = ((b * n + x) * m + y) * 6;
            let unit = FLUX * self.twists.scale[x] * other.0.twists.scale[y];
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
