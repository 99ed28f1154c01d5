//! The water's solution, on the device: value and first derivative.

use super::geometry::PlacedSystem;
use super::solve::solves;
use crate::adjoint::lie::Vec6;
use crate::coupling::{CoupledResponse, Direction, PairTensor, Reached, Tangent};
use crate::gpu::buffer::Buffer;
use crate::gpu::columns::{Base, combine, products};
use crate::gpu::kernel::Call;
use crate::gpu::products::{Product, To, product};
use crate::gpu::rows::{impulse, rows};
use crate::gpu::units::{self, Twists};
use crate::gpu::wrenches::tensor;
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::sync::Arc;

/// a, λ, r, μ of some columns, on the device.
pub(super) struct Solution {
    pub placed: Arc<PlacedSystem>,
    /// Bodies that the columns first given move.
    moving: Arc<Vec<bool>>,
    pub twists: Twists,
    pub columns: usize,
    /// X = [a, λ], `[source][2·columns]`.
    pub strengths: Buffer,
    /// [μ, r, β], `[face][3·columns]`.
    pub densities: Buffer,
    momenta: DMatrix<f64>,
    energies: DMatrix<f64>,
    reached: Reached,
}

impl Solution {
    /// Solves for columns of twists.
    pub fn solve(
        placed: Arc<PlacedSystem>,
        moving: Arc<Vec<bool>>,
        twists: &DMatrix<f64>,
    ) -> Result<Self> {
        let surfaces = placed.surfaces.surfaces.clone();
        let (context, sizes) = (&surfaces.context, &surfaces.sizes);
        let fine = context.fine();
        let k = twists.ncols();
        let n = sizes.sources;
        let twists = Twists::new(twists.clone(), surfaces.length);
        let given = (&twists.upload(context)?, k);
        let g = context.reals("right-hand sides", fine, n * 2 * k)?;
        let mut out = Self {
            moving,
            columns: k,
            densities: context.reals("densities", fine, sizes.faces * 3 * k)?,
            strengths: context.zeros("strengths", fine, n * 2 * k)?,
            momenta: DMatrix::zeros(6 * sizes.bodies, k),
            energies: DMatrix::zeros(k, k),
            reached: Reached::default(),
            placed: placed.clone(),
            twists,
        };
        if k == 0 || n == 0 {
            return Ok(out);
        }
        let (faces, sources) = (&surfaces.face_rows, &surfaces.source_rows);
        let at = |block: usize| (&out.densities, 3 * k, block * k);
        let half = |block: usize| (&g, 2 * k, block * k);
        let asked = || rows(context, (faces, 0), given, at(1), false);
        let mut calls = vec![asked()?];
        calls.push(rows(context, (faces, 6), given, at(2), false)?);
        for (block, potential) in [false, true].into_iter().enumerate() {
            let (back, to) = (Product::back(potential), To::plain(k, half(block)));
            calls.extend(product(
                &placed.surfaces,
                fine,
                back,
                at(1 + block),
                k,
                &[to],
            )?);
        }
        calls.push(rows(context, (sources, 0), given, half(1), true)?);
        context.submit(&calls)?;

        // r and μ from X, then momenta and energies.
        let x = (&out.strengths, 2 * k, 0);
        let what = "coupled system (Eq. 20)";
        let solves = solves(&placed, what, half(0), x, 2 * k)?;
        let residual = To {
            scale: -1.0,
            base: Base::Out,
            ..To::plain(k, at(1))
        };
        let mu = To {
            from: k,
            ..To::plain(k, at(0))
        };
        let forward = Product::forward(false);
        let mut follow = product(&placed.surfaces, fine, forward, x, 2 * k, &[residual, mu])?;
        let (calls, momenta) = out.impulse_calls()?;
        follow.extend(calls);
        let energies = context.reals("energies", fine, k * k)?;
        follow.push(products(context, n, (half(1), x), (&energies, k))?);
        let wanted = [(&momenta, 6 * sizes.bodies * k), (&energies, k * k)];
        // r made of an unfinished solution has to be made again from F x̄.
        let (reached, values) = solves.run(&[asked()?], &follow, &wanted)?;
        out.reached = reached;
        out.momenta = out.impulses(&values[0]);
        let (e, scale) = (&values[1], &out.twists.scale);
        let l5 = surfaces.length.powi(5);
        out.energies = DMatrix::from_fn(k, k, |x, y| e[x * k + y] * scale[x] * scale[y] * l5);
        Ok(out)
    }

    /// Body-frame impulses of the bodies that move, from the device's.
    pub fn impulses(&self, values: &[f64]) -> DMatrix<f64> {
        let mut out = self.twists.impulses(values, 1.0);
        for b in (0..self.moving.len()).filter(|b| !self.moving[*b]) {
            out.rows_mut(6 * b, 6).fill(0.0);
        }
        out
    }

    /// φ = P a and the impulses: the calls, and where the impulses will be.
    fn impulse_calls(&self) -> Result<(Vec<Call>, Buffer)> {
        let k = self.columns;
        let surfaces = &self.placed.surfaces.surfaces;
        let (context, fine) = (&surfaces.context, surfaces.context.fine());
        let phi = context.reals("potentials", fine, surfaces.sizes.faces * k)?;
        let out = context.reals("momenta", fine, 6 * surfaces.sizes.bodies * k)?;
        let (a, to) = ((&self.strengths, 2 * k, 0), To::plain(k, (&phi, k, 0)));
        let mut calls = product(
            &self.placed.surfaces,
            fine,
            Product::forward(true),
            a,
            k,
            &[to],
        )?;
        let mu = (&self.densities, 3 * k, 0);
        calls.push(impulse(surfaces, (&phi, k, 0), mu, a, (&out, k))?);
        Ok((calls, out))
    }

    /// A combination of the columns, coefficients columns × n.
    fn combination(&self, coefficients: &DMatrix<f64>) -> Result<Self> {
        let surfaces = &self.placed.surfaces.surfaces;
        let (context, sizes) = (&surfaces.context, &surfaces.sizes);
        let fine = context.fine();
        let n = coefficients.ncols();
        let (twists, units) = self.twists.combined(coefficients);
        let mut out = Self {
            placed: self.placed.clone(),
            moving: self.moving.clone(),
            twists,
            columns: n,
            strengths: context.zeros("strengths", fine, sizes.sources * 2 * n)?,
            densities: context.zeros("densities", fine, sizes.faces * 3 * n)?,
            momenta: DMatrix::zeros(6 * sizes.bodies, n),
            energies: coefficients.tr_mul(&self.energies) * coefficients,
            reached: self.reached,
        };
        if n == 0 || self.columns == 0 {
            return Ok(out);
        }
        let of = |x, out, sizes| combine(context, x, &units, out, sizes);
        let mut calls = vec![
            of(&self.strengths, &out.strengths, (sizes.sources, 2))?,
            of(&self.densities, &out.densities, (sizes.faces, 3))?,
        ];
        let (last, momenta) = out.impulse_calls()?;
        calls.extend(last);
        context.submit(&calls)?;
        let values = context.read(fine, &[(&momenta, 6 * sizes.bodies * n)])?;
        out.momenta = out.impulses(&values[0]);
        Ok(out)
    }
}

impl CoupledResponse for Solution {
    fn reached(&self) -> Reached {
        self.reached
    }

    fn momenta(&self) -> Result<DMatrix<f64>> {
        Ok(self.momenta.clone())
    }

    fn energies(&self) -> Result<DMatrix<f64>> {
        Ok(self.energies.clone())
    }

    fn gradient(&self) -> Result<PairTensor> {
        let densities = [&self.densities, &self.strengths];
        tensor(&self.placed.surfaces, densities, &self.twists.scale)
    }

    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn CoupledResponse + '_>> {
        let solution = match self.twists.along(directions) {
            Ok(coefficients) => self.combination(&coefficients)?,
            // One more column costs a solve little: the kernels are evaluated once for all.
            Err(twists) => Self::solve(self.placed.clone(), self.moving.clone(), &twists)?,
        };
        Ok(Box::new(solution))
    }

    fn tangent(&self, z: &[Vec6]) -> Result<Tangent> {
        if !(1..=2).contains(&self.columns) {
            return Err(Error::input(
                "tangent of the coupled system: columns",
                self.columns,
                "must be 1 or 2",
            ));
        }
        units::along(z, self.placed.surfaces.surfaces.length, |z| self.second(z))
    }

    fn densities(&self) -> Result<Columns> {
        let surfaces = &self.placed.surfaces.surfaces;
        let (k, n) = (self.columns, surfaces.sizes.sources);
        let context = &surfaces.context;
        let values = context.read(context.fine(), &[(&self.strengths, n * 2 * k)])?;
        let l3 = surfaces.length.powi(3);
        Ok(Columns::from_fn(n, k, |j, c| {
            values[0][j * 2 * k + c] * self.twists.scale[c] * l3
        }))
    }
}
