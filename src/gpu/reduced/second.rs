//! The tangent along one displacement, on the device.

use super::products::{Product, product};
use super::solution::{FLUX, Solution, expand, impulses, project};
use super::solve::Solve;
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::Tangent;
use crate::gpu::blocks::Part;
use crate::gpu::coulomb_hvp::coulomb_hvp;
use crate::gpu::kernel::Batch;
use crate::gpu::sum::{Base, Sum, sum};
use crate::gpu::units::spatial;
use crate::gpu::wrench::{Side, wrench};

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
        let motion = placed.motion(z)?;
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
        let tangent = Product::Tangent(&motion);
        let moved = product(placed, tangent, alpha, n, whole(&psi), open)?;
        let asked = [project(model, Part::Modes, n, whole(&psi), whole(&given))?];
        let solve = Solve::new(placed, (&given, &da), n, tolerance, None)?;
        let mut last = vec![expand(
            model,
            Part::Modes,
            n,
            whole(&da),
            whole(&dalpha),
            Base::Nothing,
        )?];
        // Ūᵀ (δG α + G δα).
        last.extend(product(
            placed,
            Product::Potential,
            whole(&dalpha),
            n,
            whole(&total),
            open,
        )?);
        let task = Sum {
            rows: sizes.points,
            columns: n,
            parts: (&psi, 1, n, 0),
            scale: 1.0,
            base: Base::Out,
            damped: None,
            out: whole(&total),
        };
        last.push(sum(context, fine, &task, open)?);
        last.push(project(
            model,
            Part::Strengths,
            n,
            whole(&total),
            whole(&momenta),
        )?);
        // Pulls, their tangents, and wrenches.
        let (shares, rows) = (sizes.shares(), sizes.points * 2 * model.pull());
        let parts = reals("shares of the pulls", shares * rows * n)?;
        let pulls = reals("pulls", rows * n)?;
        let charges = (&self.alpha, &dalpha);
        last.push(coulomb_hvp(context, placed, &motion, charges, (&parts, n))?);
        let task = Sum {
            rows,
            columns: n,
            parts: (&parts, shares, n, 0),
            scale: 1.0,
            base: Base::Nothing,
            damped: None,
            out: whole(&pulls),
        };
        last.push(sum(context, fine, &task, open)?);
        let count = sizes.bodies * n * n * 12;
        let wrenches = reals("wrenches", count)?;
        let side = Side {
            alpha: &self.alpha,
            pull: &pulls,
            change: &dalpha,
            columns: n,
        };
        last.push(wrench(
            context,
            placed,
            (side, side),
            Some(&motion),
            &wrenches,
        )?);

        let mut batch = Batch::default();
        batch.extend(&moved);
        batch.extend(&asked);
        solve.begin(&mut batch);
        batch.extend(&last);
        context.submit(&batch)?;
        let impulse_count = 6 * sizes.bodies * n;
        let mut wanted = vec![
            (&momenta, impulse_count * fine.size()),
            (&wrenches, count * fine.size()),
        ];
        wanted.extend(solve.report(placed));
        let mut bytes = context.read_bytes(&wanted)?;
        let states = bytes.split_off(2);
        let mut found: Vec<Vec<f64>> = bytes.iter().map(|b| fine.numbers(b)).collect();
        if solve.reached(placed, &states)?.is_none() {
            solve.finish(placed)?;
            context.run(&[&last])?;
            found = context.read(fine, &[(&momenta, impulse_count), (&wrenches, count)])?;
        }
        let momenta = impulses(model, &found[0], &self.scale);
        let unit = FLUX * self.scale[0] * self.scale[n - 1];
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
