//! The water's solution, on the device: value and first derivative.

use super::geometry::PlacedPanels;
use super::solve::{System, solves};
use crate::adjoint::lie::Vec6;
use crate::coupling::{CoupledResponse, Direction, PairTensor, Reached, Tangent};
use crate::gpu::buffer::Buffer;
use crate::gpu::columns::{Base, combine, products};
use crate::gpu::products::{Product, To, product};
use crate::gpu::rows::{impulse, rows};
use crate::gpu::units::{self, Twists};
use crate::gpu::wrenches::tensor;
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::sync::Arc;

/// φ, q and μ of some columns, on the device.
pub(super) struct Solution {
    pub placed: Arc<PlacedPanels>,
    /// Bodies that the columns first given move.
    moving: Arc<Vec<bool>>,
    pub twists: Twists,
    pub columns: usize,
    /// [φ, q], `[panel][2·columns]`.
    pub densities: Buffer,
    /// μ, `[centroid][columns]`.
    pub mu: Buffer,
    momenta: DMatrix<f64>,
    energies: DMatrix<f64>,
    reached: Reached,
}

impl Solution {
    /// Solves for columns of twists; with the share of the full solid angle that all others fill, seen from every panel.
    ///
    /// # Errors
    /// A tolerance that isn't reached, or a device that fails.
    pub fn solve(
        placed: Arc<PlacedPanels>,
        moving: Arc<Vec<bool>>,
        twists: &DMatrix<f64>,
    ) -> Result<(Self, Vec<f64>)> {
        let (surfaces, here) = (&placed.surfaces.surfaces, &placed.surfaces);
        let (context, sizes) = (&surfaces.context, &surfaces.sizes);
        let (fine, k, n) = (context.fine(), twists.ncols(), sizes.faces);
        let zeros = |label, width| context.zeros(label, fine, n * width);
        let mut out = Self {
            twists: Twists::new(twists.clone(), surfaces.length),
            densities: zeros("densities", 2 * k)?,
            mu: zeros("adjoint densities", k)?,
            momenta: DMatrix::zeros(6 * sizes.bodies, k),
            energies: DMatrix::zeros(k, k),
            reached: Reached::default(),
            columns: k,
            moving,
            placed: placed.clone(),
        };
        let filled = (&placed.filled, n);
        if k == 0 || n == 0 {
            let filled = context.read(fine, &[filled])?.swap_remove(0);
            return Ok((out, filled));
        }
        let given = (&out.twists.upload(context)?, k);
        let reals = |label, count| context.reals(label, fine, count);
        let (b, g) = (reals("S q", n * k)?, reals("fluxes", n * k)?);
        let (phi, q) = ((&out.densities, 2 * k, 0), (&out.densities, 2 * k, k));
        let [mu, right, flux] = [&out.mu, &b, &g].map(|x| (x, k, 0));
        let (faces, points) = (&surfaces.face_rows, &surfaces.source_rows);
        // S q: of each body's own panels it is known.
        let mut calls = vec![
            rows(context, (faces, 0), given, q, false)?,
            rows(context, (faces, 6), given, flux, false)?,
            rows(context, (points, 0), given, right, false)?,
        ];
        let others = To {
            base: Base::Out,
            ..To::plain(k, right)
        };
        calls.extend(product(here, fine, Product::back(true), q, k, &[others])?);
        context.submit(&calls)?;

        let system = |transpose, given, solution| System {
            transpose,
            given,
            solution,
        };
        let systems = [system(false, right, phi), system(true, flux, mu)];
        let solves = solves(&placed, "the coupled panel system", systems, k)?;
        // ½ {Fᵀ D φ + Fᵀ Sᵀ μ}, and the energies.
        let spread = reals("Sᵀ μ", n * k)?;
        let momenta = reals("momenta", 6 * sizes.bodies * k)?;
        let energies = reals("energies", k * k)?;
        let to = To::plain(k, (&spread, k, 0));
        let mut follow = product(here, fine, Product::forward(true), mu, k, &[to])?;
        follow.push(impulse(surfaces, phi, (&spread, k, 0), mu, (&momenta, k))?);
        follow.push(products(context, n, (flux, phi), (&energies, k))?);
        let wanted = [(&momenta, 6 * sizes.bodies * k), (&energies, k * k), filled];
        let (reached, mut values) = solves.run(&[], &follow, &wanted)?;
        let lacking = placed.geometry.model.lacking(&out.twists.all);
        out.reached = reached;
        out.momenta = out.impulses(&values[0]) + &lacking;
        let (e, scale) = (&values[1], &out.twists.scale);
        let l5 = surfaces.length.powi(5);
        let made = DMatrix::from_fn(k, k, |x, y| e[x * k + y] * scale[x] * scale[y] * l5);
        out.energies = made + out.twists.all.tr_mul(&lacking);
        Ok((out, values.swap_remove(2)))
    }

    /// Body-frame impulses of the bodies that move, from the device's.
    pub fn impulses(&self, values: &[f64]) -> DMatrix<f64> {
        let mut out = self.twists.impulses(values, 1.0);
        for b in (0..self.moving.len()).filter(|b| !self.moving[*b]) {
            out.rows_mut(6 * b, 6).fill(0.0);
        }
        out
    }

    /// A combination of the columns, coefficients columns × n.
    fn combination(&self, coefficients: &DMatrix<f64>) -> Result<Self> {
        let surfaces = &self.placed.surfaces.surfaces;
        let (context, rows) = (&surfaces.context, surfaces.sizes.faces);
        let n = coefficients.ncols();
        let (twists, units) = self.twists.combined(coefficients);
        let reals = |label, width| context.reals(label, context.fine(), rows * width);
        let out = Self {
            placed: self.placed.clone(),
            moving: self.moving.clone(),
            twists,
            columns: n,
            densities: reals("densities", 2 * n)?,
            mu: reals("adjoint densities", n)?,
            momenta: &self.momenta * coefficients,
            energies: coefficients.tr_mul(&self.energies) * coefficients,
            reached: self.reached,
        };
        context.submit(&[
            combine(context, &self.densities, &units, &out.densities, (rows, 2))?,
            combine(context, &self.mu, &units, &out.mu, (rows, 1))?,
        ])?;
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
        let densities = [&self.densities, &self.mu];
        tensor(&self.placed.surfaces, densities, &self.twists.scale)
    }

    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn CoupledResponse + '_>> {
        let solution = match self.twists.along(directions) {
            Ok(coefficients) => self.combination(&coefficients)?,
            // One more column costs a solve little: the kernels are evaluated once for all.
            Err(twists) => Self::solve(self.placed.clone(), self.moving.clone(), &twists)?.0,
        };
        Ok(Box::new(solution))
    }

    fn tangent(&self, z: &[Vec6]) -> Result<Tangent> {
        if !(1..=2).contains(&self.columns) {
            let columns = self.columns;
            return Err(Error::input("tangent: columns", columns, "must be 1 or 2"));
        }
        let length = self.placed.surfaces.surfaces.length;
        units::along(z, length, |z| self.second(z))
    }

    fn densities(&self) -> Result<Columns> {
        let surfaces = &self.placed.surfaces.surfaces;
        let (k, n, context) = (self.columns, surfaces.sizes.faces, &surfaces.context);
        let values = context.read(context.fine(), &[(&self.densities, n * 2 * k)])?;
        let l2 = surfaces.length.powi(2);
        Ok(Columns::from_fn(n, k, |i, c| {
            values[0][i * 2 * k + c] * self.twists.scale[c] * l2
        }))
    }
}
