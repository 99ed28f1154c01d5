//! The kernels one at a time, in SI units: for comparisons and benchmarks.

use super::Gpu;
use super::pairs::{Densities, pairs_hvp, pairs_vjp};
use super::products::{Product, To, product};
use super::second::motions;
use super::solve::Solves;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6, six};
use crate::coupling::full::Reached;
use crate::gpu::buffer::Buffer;
use crate::gpu::context::Context;
use crate::gpu::geometry::PlacedSystem;
use crate::gpu::kernel::Batch;
use crate::gpu::source::Arithmetic;
use crate::solver::Columns;
use std::sync::Arc;
use std::time::Instant;

/// The coupled system at given poses, kernel by kernel.
pub struct Probe {
    placed: Arc<PlacedSystem>,
}

/// A wrench on the sources of a pair and its tangent, for every pair of columns.
#[derive(Clone, Debug)]
pub struct PairWrenches {
    /// Body whose faces see the sources.
    pub target: usize,
    /// Body whose sources, or their images, are seen.
    pub source: usize,
    /// Number of the image.
    pub image: usize,
    /// Spatial wrenches, `[x][y]`.
    pub wrenches: Vec<Vec6>,
    /// Their tangents; empty without.
    pub tangents: Vec<Vec6>,
}

impl Probe {
    /// At these poses.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(gpu: &Gpu, poses: &[Pose]) -> Result<Self> {
        Ok(Self {
            placed: Arc::new(PlacedSystem::new(&gpu.geometry, poses)?),
        })
    }

    fn context(&self) -> &Arc<Context> {
        &self.placed.geometry.context
    }

    fn upload(&self, arithmetic: Arithmetic, x: &Columns) -> Result<Buffer> {
        self.context().upload("probe", arithmetic, &x.data)
    }

    /// A product of all columns, times `unit`.
    fn product(
        &self,
        arithmetic: Arithmetic,
        what: Product,
        x: &Columns,
        unit: f64,
    ) -> Result<Columns> {
        let sizes = &self.placed.geometry.sizes;
        let rows = match what {
            Product::Forward { .. } | Product::ForwardTangent { .. } => sizes.faces,
            _ => sizes.sources,
        };
        let k = x.columns;
        let from = self.upload(arithmetic, x)?;
        let out = self.context().reals("probe", arithmetic, rows * k)?;
        let to = [To::plain(k, (&out, k, 0))];
        let calls = product(&self.placed, arithmetic, what, (&from, k, 0), k, &to)?;
        self.context().run(&[&calls])?;
        let mut values = self.context().read(arithmetic, &[(&out, rows * k)])?;
        let data = values
            .swap_remove(0)
            .into_iter()
            .map(|v| v * unit)
            .collect();
        Ok(Columns {
            rows,
            columns: k,
            data,
        })
    }

    /// What one entry of K, or of P, is in.
    fn unit(&self, potential: bool) -> f64 {
        let geometry = &self.placed.geometry;
        if potential {
            1.0 / geometry.length
        } else {
            geometry.weight
        }
    }

    /// K x, or P x: `[face][k]`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn apply(&self, arithmetic: Arithmetic, potential: bool, x: &Columns) -> Result<Columns> {
        self.product(
            arithmetic,
            Product::Forward { potential },
            x,
            self.unit(potential),
        )
    }

    /// Seconds of a product with K of so many columns: the mean of `repeat` in a row, nothing read back
    /// between them.
    ///
    /// # Errors
    /// A device that fails.
    pub fn time_apply(&self, arithmetic: Arithmetic, columns: usize, repeat: usize) -> Result<f64> {
        let sizes = &self.placed.geometry.sizes;
        let context = self.context();
        let x = context.zeros("probe", arithmetic, sizes.sources * columns)?;
        let out = context.reals("probe", arithmetic, sizes.faces * columns)?;
        let to = [To::plain(columns, (&out, columns, 0))];
        let what = Product::Forward { potential: false };
        let calls = product(
            &self.placed,
            arithmetic,
            what,
            (&x, columns, 0),
            columns,
            &to,
        )?;
        let time = |repeat: usize| -> Result<f64> {
            let start = Instant::now();
            for _ in 0..repeat {
                context.run(&[&calls])?;
            }
            context.read(arithmetic, &[(&out, 1)])?;
            Ok(start.elapsed().as_secs_f64())
        };
        // What waiting costs, and the first start of a shader, are no part of it.
        time(1)?;
        let once = time(1)?;
        Ok(match repeat {
            0 | 1 => once,
            n => (time(n)? - once).max(0.0) / (n - 1) as f64,
        })
    }

    /// Kᵀ y, or Pᵀ y: `[source][k]`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn apply_transpose(
        &self,
        arithmetic: Arithmetic,
        potential: bool,
        y: &Columns,
    ) -> Result<Columns> {
        self.product(
            arithmetic,
            Product::Transpose { potential },
            y,
            self.unit(potential),
        )
    }

    /// δK x, or δP x, along the displacement z (a spatial twist a body).
    ///
    /// # Errors
    /// A device that fails.
    pub fn apply_jvp(
        &self,
        arithmetic: Arithmetic,
        potential: bool,
        z: &[Vec6],
        x: &Columns,
    ) -> Result<Columns> {
        let motions = self
            .context()
            .upload("motions", arithmetic, &motions(&self.placed, z))?;
        let what = Product::ForwardTangent {
            potential,
            motions: &motions,
        };
        self.product(arithmetic, what, x, self.unit(potential))
    }

    /// δKᵀ y, or δPᵀ y.
    ///
    /// # Errors
    /// A device that fails.
    pub fn apply_transpose_jvp(
        &self,
        arithmetic: Arithmetic,
        potential: bool,
        z: &[Vec6],
        y: &Columns,
    ) -> Result<Columns> {
        let motions = self
            .context()
            .upload("motions", arithmetic, &motions(&self.placed, z))?;
        let what = Product::TransposeTangent {
            potential,
            motions: &motions,
        };
        self.product(arithmetic, what, y, self.unit(potential))
    }

    /// Solves `(KᵀK + D²) x = g`.
    ///
    /// # Errors
    /// A tolerance that isn't reached, or a device that fails.
    pub fn normal_solve(&self, g: &Columns) -> Result<(Columns, Reached)> {
        let geometry = &self.placed.geometry;
        let (context, fine, k) = (self.context(), self.context().fine(), g.columns);
        let right = self.upload(fine, g)?;
        let x = context.zeros("probe", fine, g.rows * k)?;
        let solves = Solves::new(&self.placed, (&right, k, 0), (&x, k, 0), k)?;
        let mut batch = Batch::default();
        solves.begin(&mut batch);
        context.submit(&batch)?;
        let reached = match solves.reached(
            &self.placed,
            &context.read_bytes(&solves.report())?,
            "solve",
            false,
        )? {
            Some(reached) => reached,
            None => solves.finish(&self.placed, "solve")?,
        };
        let values = context.read(fine, &[(&x, g.rows * k)])?;
        let unit = 1.0 / (geometry.weight * geometry.weight);
        let data = values[0].iter().map(|v| v * unit).collect();
        let out = Columns {
            rows: g.rows,
            columns: k,
            data,
        };
        Ok((out, reached))
    }

    /// `Σ_s (f, s × f)`, `f = Σ_i (β_x ∇P − μ_x ∇K) a_y + r_x ∇K λ_y`, for all columns x and y of
    /// `left = [μ, r, β]` by face and `right = [a, λ]` by source, k columns each.
    ///
    /// # Errors
    /// A device that fails.
    pub fn pair_vjp(
        &self,
        arithmetic: Arithmetic,
        left: &Columns,
        right: &Columns,
    ) -> Result<Vec<PairWrenches>> {
        let k = right.columns / 2;
        let context = self.context();
        let (left, right) = (
            self.upload(arithmetic, &self.weighed(left, k, &[0, 1]))?,
            self.upload(arithmetic, right)?,
        );
        let of = Densities {
            left: &left,
            right: &right,
            columns: k,
        };
        let (calls, out, count) = pairs_vjp(&self.placed, arithmetic, &of, (0, k))?;
        context.run(&[&calls])?;
        let values = context.read(arithmetic, &[(&out, count)])?;
        Ok(self.wrenches(&values[0], k, 6))
    }

    /// The tangent of [`Probe::pair_vjp`] along z: `left = [μ, r, β, δμ, δr]`, `right = [a, λ, δa, δλ]`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn pair_hvp(
        &self,
        arithmetic: Arithmetic,
        z: &[Vec6],
        left: &Columns,
        right: &Columns,
    ) -> Result<Vec<PairWrenches>> {
        let k = right.columns / 4;
        let context = self.context();
        let motions = context.upload("motions", arithmetic, &motions(&self.placed, z))?;
        let (left, right) = (
            self.upload(arithmetic, &self.weighed(left, k, &[0, 1, 3, 4]))?,
            self.upload(arithmetic, right)?,
        );
        let of = Densities {
            left: &left,
            right: &right,
            columns: k,
        };
        let (calls, out, count) = pairs_hvp(&self.placed, arithmetic, &of, &motions)?;
        context.run(&[&calls])?;
        let values = context.read(arithmetic, &[(&out, count)])?;
        Ok(self.wrenches(&values[0], k, 12))
    }

    /// Densities of boundary rows in the unit of the potential's.
    fn weighed(&self, left: &Columns, k: usize, blocks: &[usize]) -> Columns {
        let geometry = &self.placed.geometry;
        Columns::from_fn(left.rows, left.columns, |i, c| {
            let unit = if blocks.contains(&(c / k)) {
                geometry.weight * geometry.length
            } else {
                1.0
            };
            left.at(i, c) * unit
        })
    }

    fn wrenches(&self, values: &[f64], k: usize, width: usize) -> Vec<PairWrenches> {
        let geometry = &self.placed.geometry;
        let unit = 1.0 / (geometry.length * geometry.length);
        let spatial = |w: &[f64]| {
            let force = Vec3::new(w[0], w[1], w[2]) * unit;
            let moment = Vec3::new(w[3], w[4], w[5]) * (unit * geometry.length);
            six(&force, &(moment + self.placed.middle.cross(&force)))
        };
        let pairs = geometry.pairs.iter().zip(values.chunks(k * k * width));
        pairs
            .map(|(pair, values)| PairWrenches {
                target: pair.target,
                source: pair.source,
                image: pair.image,
                wrenches: values.chunks(width).map(|w| spatial(&w[..6])).collect(),
                tangents: match width {
                    12 => values.chunks(width).map(|w| spatial(&w[6..])).collect(),
                    _ => Vec::new(),
                },
            })
            .collect()
    }
}
