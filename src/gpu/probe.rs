//! The kernels one at a time, in the device's units: for comparisons and benchmarks.

use super::buffer::Buffer;
use super::context::Context;
use super::placed::PlacedSurfaces;
use super::products::{Product, To, product};
use super::source::{Arithmetic, Surface};
use super::wrenches::{Densities, wrenches};
use crate::Result;
use crate::adjoint::lie::{Vec3, Vec6};
use crate::solver::Columns;
use std::time::Instant;

/// Bodies at given poses, kernel by kernel. Of panels K is A, P is S, and the sources are the centroids.
#[derive(Clone, Copy)]
pub struct Kernels<'a>(&'a PlacedSurfaces);

impl<'a> Kernels<'a> {
    pub(super) fn new(placed: &'a PlacedSurfaces) -> Self {
        Self(placed)
    }

    /// The scene's size L (m) and the middle (m): positions are from the middle, over L.
    pub fn units(&self) -> (f64, Vec3) {
        (self.0.surfaces.length, self.0.middle)
    }

    fn context(&self) -> &Context {
        &self.0.surfaces.context
    }

    fn motions(&self, arithmetic: Arithmetic, z: Option<&[Vec6]>) -> Result<Option<Buffer>> {
        let of = |z| {
            self.context()
                .upload("motions", arithmetic, &self.0.motions(z))
        };
        z.map(of).transpose()
    }

    /// K̂ x, P̂ x (`potential`), or the same with their transposes, `[face or source][k]`; with the displacement z (a
    /// spatial twist a body) their tangents.
    ///
    /// # Errors
    /// A device that fails.
    pub fn product(
        &self,
        arithmetic: Arithmetic,
        (potential, transpose): (bool, bool),
        z: Option<&[Vec6]>,
        x: &Columns,
    ) -> Result<Columns> {
        let (context, k) = (self.context(), x.columns);
        let motions = self.motions(arithmetic, z)?;
        let mut what = match transpose {
            false => Product::forward(potential),
            true => Product::back(potential),
        };
        what = motions.as_ref().map_or(what, |m| what.tangent(m));
        let (rows, ..) = what.sizes(&self.0.surfaces.sizes);
        let from = context.upload("probe", arithmetic, &x.data)?;
        let out = context.reals("probe", arithmetic, rows * k)?;
        let to = [To::plain(k, (&out, k, 0))];
        context.submit(&product(self.0, arithmetic, what, (&from, k, 0), k, &to)?)?;
        Ok(Columns {
            rows,
            columns: k,
            data: context
                .read(arithmetic, &[(&out, rows * k)])?
                .swap_remove(0),
        })
    }

    /// Seconds of a product with K of so many columns: the mean of `repeat` in a row, nothing read back
    /// between them.
    ///
    /// # Errors
    /// A device that fails.
    pub fn time_apply(&self, arithmetic: Arithmetic, columns: usize, repeat: usize) -> Result<f64> {
        let (context, sizes) = (self.context(), &self.0.surfaces.sizes);
        let x = context.zeros("probe", arithmetic, sizes.sources * columns)?;
        let out = context.reals("probe", arithmetic, sizes.faces * columns)?;
        let (x, to) = ((&x, columns, 0), [To::plain(columns, (&out, columns, 0))]);
        let what = Product::forward(false);
        let calls = product(self.0, arithmetic, what, x, columns, &to)?;
        let time = |repeat: usize| -> Result<f64> {
            let start = Instant::now();
            for _ in 0..repeat {
                context.submit(&calls)?;
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

    /// `Σ_s (f, s × f)`, `f = Σ_i (β_x ∇P̂ − μ_x ∇K̂) a_y + r_x ∇K̂ λ_y`, for all columns x and y of
    /// `left = [μ, r, β]` by face and `right = [a, λ]` by source: `[pair][x][y][6]`, after (target, source, image) of
    /// every pair. With a displacement z its tangent beside it, `[12]`, `left = [μ, r, β, δμ, δr]` and
    /// `right = [a, λ, δa, δλ]`. Of panels `f = Σ_i (q_x ∇Ŝ − φ_x ∇D̂) μ_y`, `left = [φ, q]` and `right = [μ]`, with a displacement
    /// `[φ, q, δφ]` and `[μ, δμ]`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn wrenches(
        &self,
        arithmetic: Arithmetic,
        z: Option<&[Vec6]>,
        (left, right): (&Columns, &Columns),
    ) -> Result<(Vec<[usize; 3]>, Vec<f64>)> {
        let context = self.context();
        let blocks = match (self.0.surfaces.surface, z.is_some()) {
            (Surface::Faces, false) => 2,
            (Surface::Faces, true) => 4,
            (Surface::Panels, false) => 1,
            (Surface::Panels, true) => 2,
        };
        let columns = right.columns / blocks;
        let motions = self.motions(arithmetic, z)?;
        let of = Densities {
            left: &context.upload("probe", arithmetic, &left.data)?,
            right: &context.upload("probe", arithmetic, &right.data)?,
            columns,
            taken: (0, columns),
            motions: motions.as_ref(),
        };
        let (calls, out, count) = wrenches(self.0, arithmetic, &of)?;
        context.submit(&calls)?;
        let values = context.read(arithmetic, &[(&out, count)])?.swap_remove(0);
        let pairs = self.0.surfaces.pairs.iter();
        Ok((
            pairs.map(|p| [p.target, p.source, p.image]).collect(),
            values,
        ))
    }
}
