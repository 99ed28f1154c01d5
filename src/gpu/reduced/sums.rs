//! The Coulomb sums of many bodies that are coupled by products alone: of one column of charges at a time, over all pairs of points (`shaders/coulomb*.wgsl`).

use super::products::{Product, product};
use super::solution::{Side, wrench};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::reduced::Reduced;
use crate::coupling::scattering::{Changed, Summing, SummingAt};
use crate::gpu::buffer::Buffer;
use crate::gpu::context::Context;
use crate::gpu::kernel::{Call, Table};
use crate::gpu::points::{Compressed, PlacedPoints};
use crate::gpu::units::{size, spatial};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Sums on a device for [`Scattering::summed_by`](crate::coupling::scattering::Scattering::summed_by), of the bodies, walls and pairs of a [`Reduced`].
pub struct GpuSums {
    model: Arc<Compressed>,
}

/// [`GpuSums`] at some poses.
struct Placed {
    at: PlacedPoints,
}

/// Charges on the device, in units of their own size, and that size.
struct Charges {
    alpha: Buffer,
    scale: f64,
}

/// A displacement of about unit size, and its size.
struct Displaced {
    table: Table,
    scale: f64,
}

impl GpuSums {
    /// Uploads the bodies.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(context: &Arc<Context>, reduced: impl Into<Arc<Reduced>>) -> Result<Self> {
        let model = Arc::new(Compressed::new(context, &reduced.into())?);
        Ok(Self { model })
    }
}

impl Summing for GpuSums {
    fn place(&self, poses: &[Pose]) -> Result<Box<dyn SummingAt>> {
        let at = PlacedPoints::new(&self.model, poses)?;
        Ok(Box::new(Placed { at }))
    }
}

/// The largest of some numbers, or one where all are zero.
fn largest(x: &[f64]) -> f64 {
    match x.iter().fold(0.0, |most: f64, x| most.max(x.abs())) {
        0.0 => 1.0,
        most => most,
    }
}

impl Placed {
    fn model(&self) -> &Compressed {
        &self.at.model
    }

    fn reals(&self, label: &'static str, count: usize) -> Result<Buffer> {
        let context = &self.model().context;
        context.reals(label, context.fine(), count)
    }

    fn charges(&self, charges: &[f64], scale: f64) -> Result<Charges> {
        let context = &self.model().context;
        let values: Vec<f64> = charges.iter().map(|x| x / scale).collect();
        let alpha = context.upload("charges", context.fine(), &values)?;
        Ok(Charges { alpha, scale })
    }

    fn displaced(&self, z: &[Vec6]) -> Result<Displaced> {
        let all = DMatrix::from_fn(6 * z.len(), 1, |i, _| z[i / 6][i % 6]);
        let scale = size(&all, 0, self.model().length);
        let unit: Vec<Vec6> = z.iter().map(|z| z / scale).collect();
        let table = self.at.displaced(&unit)?;
        Ok(Displaced { table, scale })
    }

    /// The calls of a product, and where it goes: so many numbers a point.
    fn product(&self, what: Product, x: &Buffer, numbers: usize) -> Result<(Vec<Call>, Buffer)> {
        let model = self.model();
        let out = self.reals("sums", model.sizes.points * numbers)?;
        let calls = product(&self.at, what, (x, 1, 0), 1, (&out, 1, 0), &model.open)?;
        Ok((calls, out))
    }

    /// Potentials from the device's, of charges in units of `scale`.
    fn potentials_of(&self, values: Vec<f64>, scale: f64) -> Vec<f64> {
        let unit = scale / self.model().length;
        values.into_iter().map(|x| unit * x).collect()
    }

    /// Of each body the wrenches that stand in the device's numbers, `count` in a row: halves, for energies are ½ αᵀ G α.
    fn wrenches(&self, values: &[f64], count: usize, part: usize, scale: f64) -> Vec<Vec6> {
        let (length, middle) = (self.model().length, &self.at.middle);
        // What is put at the place of an energy's L⁵.
        let unit = 0.5 * scale / length.powi(6);
        let of = |body: &[f64]| spatial(length, middle, &body[6 * part..6 * part + 6], unit);
        values.chunks_exact(count).map(of).collect()
    }

    /// The call that sums what pulls do to each body, with its tangent where bodies are displaced and charges change; and where it goes, so many numbers.
    fn pulled(
        &self,
        alpha: &Buffer,
        pull: &Buffer,
        changed: Option<(&Table, &Buffer)>,
    ) -> Result<(Call, Buffer, usize)> {
        let numbers = changed.map_or(6, |_| 12);
        let count = numbers * self.model().sizes.bodies;
        let out = self.reals("wrenches", count)?;
        let side = Side {
            alpha,
            pull,
            change: changed.map_or(alpha, |(_, change)| change),
            columns: 1,
        };
        let displaced = changed.map(|(table, _)| table);
        let call = wrench(&self.at, (side, side), displaced, &out)?;
        Ok((call, out, count))
    }

    /// Runs the calls, and reads.
    fn read(&self, calls: &[Call], wanted: &[(&Buffer, usize)]) -> Result<Vec<Vec<f64>>> {
        let context = &self.model().context;
        context.submit(calls)?;
        context.read(context.fine(), wanted)
    }
}

impl SummingAt for Placed {
    fn potentials(&self, charges: &[f64]) -> Result<Vec<f64>> {
        let Charges { alpha, scale } = self.charges(charges, largest(charges))?;
        let (calls, out) = self.product(Product::Potential, &alpha, 1)?;
        let found = self.read(&calls, &[(&out, charges.len())])?.swap_remove(0);
        Ok(self.potentials_of(found, scale))
    }

    fn gradient(&self, charges: &[f64]) -> Result<Vec<Vec6>> {
        let Charges { alpha, scale } = self.charges(charges, largest(charges))?;
        let (mut calls, pull) = self.product(Product::Pull, &alpha, self.model().pull())?;
        let (call, out, count) = self.pulled(&alpha, &pull, None)?;
        calls.push(call);
        let found = self.read(&calls, &[(&out, count)])?;
        Ok(self.wrenches(&found[0], 6, 0, scale * scale))
    }

    fn potentials_jvp(&self, z: &[Vec6], charges: &[f64]) -> Result<Vec<f64>> {
        let Charges { alpha, scale } = self.charges(charges, largest(charges))?;
        let displaced = self.displaced(z)?;
        let (calls, out) = self.product(Product::Tangent(&displaced.table), &alpha, 1)?;
        let found = self.read(&calls, &[(&out, charges.len())])?.swap_remove(0);
        Ok(self.potentials_of(found, scale * displaced.scale))
    }

    fn gradient_jvp(&self, z: &[Vec6], charges: &[f64], rates: &[f64]) -> Result<Changed> {
        let Charges { alpha, scale } = self.charges(charges, largest(charges))?;
        let displaced = self.displaced(z)?;
        let rate = scale * displaced.scale;
        let change = self.charges(rates, rate)?.alpha;
        let tangent = Product::Tangent(&displaced.table);
        let (mut calls, moved) = self.product(tangent, &alpha, 1)?;
        let (more, turned) = self.product(Product::Potential, &change, 1)?;
        calls.extend(more);
        let both = Product::PullTangent(&displaced.table, &change);
        let (more, pull) = self.product(both, &alpha, 2 * self.model().pull())?;
        calls.extend(more);
        let changed = Some((&displaced.table, &change));
        let (call, out, count) = self.pulled(&alpha, &pull, changed)?;
        calls.push(call);
        let points = charges.len();
        let wanted = [(&moved, points), (&turned, points), (&out, count)];
        let found = self.read(&calls, &wanted)?;
        let both = found[0].iter().zip(&found[1]).map(|(x, y)| x + y);
        Ok(Changed {
            potentials: self.potentials_of(both.collect(), rate),
            gradient: self.wrenches(&found[2], 12, 0, scale * scale),
            rate: self.wrenches(&found[2], 12, 1, scale * rate),
        })
    }
}
