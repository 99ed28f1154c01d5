//! The tangent along one displacement, on the device.

use super::products::{Blocks, Part, Product, product};
use super::solution::{FLUX, Side, Solution, wrench};
use super::solve::Solve;
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::Tangent;
use crate::gpu::columns::{Base, Sum};
use crate::gpu::units::spatial;

impl Solution {
    /// As the CPU's: the tangent of the first column's energy with the last; one column or two.
    ///
    /// # Errors
    /// A system that isn't solved, or a device that fails.
    pub fn second(&self, z: &[Vec6], tolerance: f64) -> Result<Tangent> {
        let (placed, n) = (&self.placed, self.columns);
        let model = &placed.model;
        let (context, sizes) = (&model.context, &model.sizes);
        let fine = context.fine();
        let displaced = placed.displaced(z)?;
        let reals = |label, count| context.reals(label, fine, count);
        let psi = reals("δG α", sizes.points * n)?;
        let total = reals("δG α + G δα", sizes.points * n)?;
        let given = reals("right-hand sides", sizes.modes * n)?;
        let da = reals("tangent of the solutions", sizes.modes * n)?;
        let dalpha = reals("tangent of the charges", sizes.points * n)?;
        let momenta = reals("momenta", 6 * sizes.bodies * n)?;
        let open = &model.open;
        let whole = |b| (b, n, 0);

        // (I − LᵀGL) δa = Lᵀ δG α, δα = L δa.
        let alpha = whole(&self.alpha);
        let modes = Part::Modes;
        let tangent = Product::Tangent(&displaced);
        let mut before = product(placed, tangent, alpha, n, whole(&psi), open)?;
        before.push(Blocks::project(modes, n, whole(&psi), whole(&given)).call(model, open)?);
        let solve = Solve::new(placed, (&given, &da), n, tolerance, None)?;
        let (da, change, sum) = (whole(&da), whole(&dalpha), whole(&total));
        let mut last = vec![Blocks::expand(modes, n, da, change).call(model, open)?];
        // Ūᵀ (δG α + G δα).
        last.extend(product(placed, Product::Potential, change, n, sum, open)?);
        let task = Sum {
            base: Base::Out,
            ..Sum::new((sizes.points, n), (&psi, 1), sum)
        };
        last.push(task.call(context, fine, open)?);
        let read = Blocks::project(Part::Strengths, n, sum, whole(&momenta));
        last.push(read.call(model, open)?);
        // Pulls, their tangents, and wrenches.
        let pulls = reals("pulls", sizes.points * 2 * model.pull() * n)?;
        let both = Product::PullTangent(&displaced, &dalpha);
        last.extend(product(placed, both, alpha, n, whole(&pulls), open)?);
        let count = sizes.bodies * n * n * 12;
        let wrenches = reals("wrenches", count)?;
        let side = Side {
            alpha: &self.alpha,
            pull: &pulls,
            change: &dalpha,
            columns: n,
        };
        last.push(wrench(placed, (side, side), Some(&displaced), &wrenches)?);

        let wanted = [(&momenta, 6 * sizes.bodies * n), (&wrenches, count)];
        let follow: Vec<_> = last.iter().collect();
        let (_, found) = solve.run(before.iter().collect(), &follow, &wanted)?;
        let momenta = self.twists.impulses(&found[0], FLUX);
        let unit = FLUX * self.twists.scale[0] * self.twists.scale[n - 1];
        let of = |b: usize, part: usize| {
            // The first column with the last.
            let at = ((b * n) * n + n - 1) * 12 + 6 * part;
            spatial(model.length, &placed.middle, &found[1][at..at + 6], unit)
        };
        let column = |k: usize| momenta.column(k).into_owned();
        Ok(Tangent {
            momentum_x: column(0),
            momentum_y: column(n - 1),
            gradient: (0..sizes.bodies).map(|b| of(b, 0)).collect(),
            wrench: (0..sizes.bodies).map(|b| of(b, 1)).collect(),
        })
    }
}
