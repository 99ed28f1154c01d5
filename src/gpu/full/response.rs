//! The water's solution, on the device: value and first derivative.

use super::pairs::{Densities, pairs_vjp};
use super::products::{Product, To, product};
use super::solve::Solves;
use crate::adjoint::lie::Vec6;
use crate::coupling::full::{Reached, SystemResponse};
use crate::coupling::{Direction, PairTensor, Tangent};
use crate::gpu::buffer::Buffer;
use crate::gpu::combine::combine;
use crate::gpu::geometry::{Geometry, PlacedSystem};
use crate::gpu::impulse::impulse;
use crate::gpu::kernel::{Batch, Call};
use crate::gpu::products::{Task, products};
use crate::gpu::rows::{Table, rows};
use crate::gpu::share::passes;
use crate::gpu::units::{self, scaled, size};
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Columns on the left of one pass of a derivative.
const LEFT: usize = 4;

/// a, λ, r, μ of some columns, on the device.
pub(super) struct Solution {
    pub placed: Arc<PlacedSystem>,
    /// Bodies that the columns first given move.
    moving: Arc<Vec<bool>>,
    twists: DMatrix<f64>,
    /// What each column is in units of: on the device all are about 1.
    pub scale: Vec<f64>,
    pub columns: usize,
    /// X = [a, λ], `[source][2·columns]`.
    pub strengths: Buffer,
    /// [μ, r, β], `[face][3·columns]`.
    pub densities: Buffer,
    momenta: DMatrix<f64>,
    energies: DMatrix<f64>,
    reached: Reached,
}

/// What follows from X.
struct Followed {
    momenta: DMatrix<f64>,
    energies: DMatrix<f64>,
    /// How the solves stand.
    states: Vec<Vec<u8>>,
}

/// A wrench about the scene's middle in the device's units as a spatial wrench.
pub(super) fn spatial(placed: &PlacedSystem, w: &[f64], scale: f64) -> Vec6 {
    units::spatial(placed.geometry.length, &placed.middle, w, scale)
}

/// Body-frame impulses from the device's `[body][6][columns]`.
pub(super) fn impulses(
    geometry: &Geometry,
    moving: &[bool],
    values: &[f64],
    scale: &[f64],
) -> DMatrix<f64> {
    let k = scale.len();
    DMatrix::from_fn(6 * moving.len(), k, |i, c| {
        if !moving[i / 6] {
            return 0.0;
        }
        let power = if i % 6 < 3 { 4 } else { 5 };
        values[i * k + c] * scale[c] * geometry.length.powi(power)
    })
}

impl Solution {
    /// Solves for columns of twists.
    pub fn solve(
        placed: Arc<PlacedSystem>,
        moving: Arc<Vec<bool>>,
        twists: &DMatrix<f64>,
    ) -> Result<Self> {
        let geometry = placed.geometry.clone();
        let (context, sizes) = (&geometry.context, &geometry.sizes);
        let fine = context.fine();
        let k = twists.ncols();
        let n = sizes.sources;
        let scale: Vec<f64> = (0..k).map(|c| size(twists, c, geometry.length)).collect();
        let values = scaled(twists, &scale, geometry.length);
        let device_twists = context.upload("twists", fine, &values)?;
        let densities = context.reals("densities", fine, sizes.faces * 3 * k)?;
        let strengths = context.zeros("strengths", fine, n * 2 * k)?;
        let g = context.reals("right-hand sides", fine, n * 2 * k)?;
        let mut out = Self {
            moving,
            twists: twists.clone(),
            scale,
            columns: k,
            strengths,
            densities,
            momenta: DMatrix::zeros(twists.nrows(), k),
            energies: DMatrix::zeros(k, k),
            reached: Reached::default(),
            placed: placed.clone(),
        };
        if k == 0 || n == 0 {
            return Ok(out);
        }
        let table = |first| Table {
            values: &geometry.face_table,
            width: 12,
            first,
            map: &geometry.face_map,
            rows: sizes.faces,
        };
        let own = Table {
            values: &geometry.source_table,
            width: 6,
            first: 0,
            map: &geometry.source_map,
            rows: n,
        };
        let given = (&device_twists, k);
        let at = |block: usize| (&out.densities, 3 * k, block * k);
        let asked = [
            rows(context, fine, &table(0), given, at(1), false)?,
            rows(context, fine, &table(6), given, at(2), false)?,
        ];
        let back = |potential| Product::Transpose { potential };
        let gathered = product(
            &placed,
            fine,
            back(false),
            at(1),
            k,
            &[To::plain(k, (&g, 2 * k, 0))],
        )?;
        let read = product(
            &placed,
            fine,
            back(true),
            at(2),
            k,
            &[To::plain(k, (&g, 2 * k, k))],
        )?;
        let added = [rows(context, fine, &own, given, (&g, 2 * k, k), true)?];
        context.run(&[&asked, &gathered, &read, &added])?;

        let solves = Solves::new(&placed, (&g, 2 * k, 0), (&out.strengths, 2 * k, 0), 2 * k)?;
        let mut batch = Batch::default();
        solves.begin(&mut batch);
        context.submit(&batch)?;
        // Most solves end within the first batch: what follows from them is read together with how they
        // stand.
        let what = "coupled system (Eq. 20)";
        let mut found = out.follow(&g, Some(&solves))?;
        let reached = match solves.reached(&placed, &found.states, what, false)? {
            Some(reached) => reached,
            None => {
                let reached = solves.finish(&placed, what)?;
                // r was made of an unfinished solution: again from F x̄.
                let again = rows(context, fine, &table(0), given, at(1), false)?;
                context.run(&[&[again]])?;
                found = out.follow(&g, None)?;
                reached
            }
        };
        out.reached = reached;
        (out.momenta, out.energies) = (found.momenta, found.energies);
        Ok(out)
    }

    /// r and μ from X, then momenta and energies, and how the solves stand; `g` are the right-hand sides.
    fn follow(&self, g: &Buffer, solves: Option<&Solves>) -> Result<Followed> {
        let (placed, k) = (self.placed.clone(), self.columns);
        let geometry = &placed.geometry;
        let (context, fine) = (&geometry.context, geometry.context.fine());
        let residual = To {
            scale: -1.0,
            accumulate: true,
            ..To::plain(k, (&self.densities, 3 * k, k))
        };
        let mu = To {
            from: k,
            ..To::plain(k, (&self.densities, 3 * k, 0))
        };
        let forward = Product::Forward { potential: false };
        let x = (&self.strengths, 2 * k, 0);
        let image = product(&placed, fine, forward, x, 2 * k, &[residual, mu])?;
        let (impulses_of, momenta) = self.impulse_calls()?;
        let energies = context.reals("energies", fine, k * k)?;
        let task = Task {
            rows: geometry.sizes.sources,
            g: (2 * k, k),
            a: (2 * k, 0),
            columns: k,
        };
        let dots = [products(
            context,
            fine,
            g,
            &self.strengths,
            &energies,
            &task,
        )?];
        context.run(&[&image, &impulses_of, &dots])?;
        let count = 6 * geometry.sizes.bodies * k;
        let mut wanted = vec![
            (&momenta, count * fine.size()),
            (&energies, k * k * fine.size()),
        ];
        wanted.extend(solves.iter().flat_map(|s| s.report()));
        let mut bytes = context.read_bytes(&wanted)?;
        let states = bytes.split_off(2);
        let values = fine.numbers(&bytes[0]);
        let momenta = impulses(geometry, &self.moving, &values, &self.scale);
        let e = fine.numbers(&bytes[1]);
        let l5 = geometry.length.powi(5);
        let energies = DMatrix::from_fn(k, k, |x, y| {
            e[x * k + y] * self.scale[x] * self.scale[y] * l5
        });
        Ok(Followed {
            momenta,
            energies,
            states,
        })
    }

    /// φ = P a and the impulses: the calls, and where the impulses will be.
    fn impulse_calls(&self) -> Result<(Vec<Call>, Buffer)> {
        let k = self.columns;
        let geometry = &self.placed.geometry;
        let (context, fine) = (&geometry.context, geometry.context.fine());
        let phi = context.reals("potentials", fine, geometry.sizes.faces * k)?;
        let out = context.reals("momenta", fine, 6 * geometry.sizes.bodies * k)?;
        let forward = Product::Forward { potential: true };
        let a = (&self.strengths, 2 * k, 0);
        let mut calls = product(
            &self.placed,
            fine,
            forward,
            a,
            k,
            &[To::plain(k, (&phi, k, 0))],
        )?;
        let mu = (&self.densities, 3 * k, 0);
        calls.push(impulse(context, geometry, &phi, mu, a, (&out, k))?);
        Ok((calls, out))
    }

    /// A combination of the columns, coefficients columns × n.
    fn combination(&self, coefficients: &DMatrix<f64>) -> Result<Self> {
        let geometry = &self.placed.geometry;
        let (context, sizes) = (&geometry.context, &geometry.sizes);
        let fine = context.fine();
        let n = coefficients.ncols();
        let twists = &self.twists * coefficients;
        let scale: Vec<f64> = (0..n).map(|c| size(&twists, c, geometry.length)).collect();
        let units = DMatrix::from_fn(self.columns, n, |k, c| {
            coefficients[(k, c)] * self.scale[k] / scale[c]
        });
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
            scale,
        };
        if n == 0 || self.columns == 0 {
            return Ok(out);
        }
        let combined = [
            combine(
                context,
                fine,
                &self.strengths,
                &units,
                &out.strengths,
                (sizes.sources, 2),
            )?,
            combine(
                context,
                fine,
                &self.densities,
                &units,
                &out.densities,
                (sizes.faces, 3),
            )?,
        ];
        let (calls, momenta) = out.impulse_calls()?;
        context.run(&[&combined, &calls])?;
        let values = context.read(fine, &[(&momenta, 6 * sizes.bodies * n)])?;
        out.momenta = impulses(geometry, &self.moving, &values[0], &out.scale);
        Ok(out)
    }

    /// Bodies that the columns first given move.
    pub fn moving(&self) -> &[bool] {
        &self.moving
    }
}

impl SystemResponse for Solution {
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
        let k = self.columns;
        let placed = &self.placed;
        let geometry = &placed.geometry;
        let (context, fine) = (&geometry.context, geometry.context.fine());
        let bodies = geometry.sizes.bodies;
        if k == 0 || geometry.pairs.is_empty() {
            return Ok(PairTensor::zeros(bodies, k));
        }
        // W(x, y) of every pair, x in passes.
        let of = Densities {
            left: &self.densities,
            right: &self.strengths,
            columns: k,
        };
        let shares: Vec<(usize, usize)> = passes(k, LEFT).collect();
        let mut outs = Vec::new();
        for share in &shares {
            let (calls, out, count) = pairs_vjp(placed, fine, &of, *share)?;
            context.run(&[&calls])?;
            outs.push((out, count));
        }
        let wanted: Vec<(&Buffer, usize)> = outs.iter().map(|(out, n)| (out, *n)).collect();
        let values = context.read(fine, &wanted)?;
        let place: Vec<(usize, usize, usize)> = (shares.iter().enumerate())
            .flat_map(|(p, (_, width))| (0..*width).map(move |x| (p, x, *width)))
            .collect();
        let mut out = PairTensor::zeros(bodies, k);
        for (number, pair) in geometry.pairs.iter().enumerate() {
            let raw = |x: usize, y: usize| {
                let (share, x_there, width) = place[x];
                let at = ((number * width + x_there) * k + y) * 6;
                spatial(
                    placed,
                    &values[share][at..at + 6],
                    self.scale[x] * self.scale[y],
                )
            };
            let image = &geometry.model.images[pair.image];
            for x in 0..k {
                for y in 0..=x {
                    let world = 0.5 * (raw(x, y) + raw(y, x));
                    out.add(pair.source, (x, y), &image.twist_vjp(&world));
                    out.add(pair.target, (x, y), &-world);
                }
            }
        }
        Ok(out)
    }

    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn SystemResponse + '_>> {
        let n = directions.len();
        let mut coefficients = DMatrix::zeros(self.columns, n);
        let mut twists = DMatrix::zeros(self.twists.nrows(), n);
        let mut combined = true;
        for (k, direction) in directions.iter().enumerate() {
            match direction {
                Direction::Basis(c) => {
                    coefficients.set_column(k, c);
                    twists.set_column(k, &(&self.twists * *c));
                }
                Direction::Twist(x) => {
                    combined = false;
                    twists.set_column(k, x);
                }
            }
        }
        let solution = if combined {
            self.combination(&coefficients)?
        } else {
            // One more column costs a solve little: the kernels are evaluated once for all.
            Self::solve(self.placed.clone(), self.moving.clone(), &twists)?
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
        units::along(z, self.placed.geometry.length, |z| self.second(z))
    }

    fn strengths(&self) -> Result<Columns> {
        let (k, n) = (self.columns, self.placed.geometry.sizes.sources);
        let geometry = &self.placed.geometry;
        let context = &geometry.context;
        let values = context.read(context.fine(), &[(&self.strengths, n * 2 * k)])?;
        let l3 = geometry.length.powi(3);
        Ok(Columns::from_fn(n, k, |j, c| {
            values[0][j * 2 * k + c] * self.scale[c] * l3
        }))
    }
}
