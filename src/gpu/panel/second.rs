//! The tangent along one displacement, on the device.

use super::geometry::Solution;
use super::solve::{System, solves};
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::Tangent;
use crate::gpu::columns::{Base, Slice};
use crate::gpu::products::{Product, To, product};
use crate::gpu::rows::impulse;

/// As the CPU's: the tangent of the first column's energy with the last, `A δφ = δS q − δA φ`, `Aᵀ δμ = −δAᵀ μ`.
pub(super) fn second(solution: &Solution, z: &[Vec6]) -> Result<Tangent> {
    let (placed, n) = (&solution.placed.surfaces, solution.columns);
    let surfaces = &placed.surfaces;
    let (context, sizes) = (&surfaces.context, &surfaces.sizes);
    let (fine, count) = (context.fine(), sizes.faces);
    let motion = context.upload("motions", fine, &placed.motions(z))?;
    let reals = |label, width| context.reals(label, fine, count * width);
    let zeros = |label| context.zeros(label, fine, count * n);

    let (b, g) = (reals("δS q − δA φ", n)?, reals("−δAᵀ μ", n)?);
    let (dphi, dmu) = (zeros("δφ")?, zeros("δμ")?);
    let moved = reals("δSᵀ μ", n)?;
    let whole = |b| (b, n, 0);
    let (mu, right, turned) = (solution.by_source(0), whole(&b), whole(&g));
    let minus = |base, out| To {
        scale: -1.0,
        base,
        ..To::plain(n, out)
    };
    let of = |what: Product, x, to: To| product(placed, fine, what, x, n, &[to]);
    let (forward, back) = (Product::forward, Product::back);
    let along = |what: Product| of(what.tangent(&motion), mu, minus(Base::Nothing, turned));
    let given = To::plain(n, right);
    let mut calls = of(back(true).tangent(&motion), solution.by_face(1), given)?;
    let less = minus(Base::Out, right);
    calls.extend(of(back(false).tangent(&motion), solution.by_face(0), less)?);
    calls.extend(along(forward(false))?);
    let spread = To::plain(n, whole(&moved));
    calls.extend(of(forward(true).tangent(&motion), mu, spread)?);
    context.submit(&calls)?;

    let system = |transpose, given, solution| System {
        transpose,
        given,
        solution: whole(solution),
    };
    let systems = [system(false, right, &dphi), system(true, turned, &dmu)];
    let what = "the tangent of the coupled panel system";
    let solves = solves(&solution.placed, what, systems, n)?;
    // What follows from them: momenta, with δSᵀ μ + Sᵀ δμ, and wrenches of [φ, q, δφ] and [μ, δμ].
    let total = reals("δSᵀ μ + Sᵀ δμ", n)?;
    let (left, both) = (reals("left densities", 3 * n)?, reals("μ, δμ", 2 * n)?);
    let momenta = context.reals("tangent of the momenta", fine, 6 * sizes.bodies * n)?;
    let sum = To {
        base: Base::Other(whole(&moved)),
        ..To::plain(n, whole(&total))
    };
    let mut follow = of(forward(true), whole(&dmu), sum)?;
    let read = (whole(&dphi), whole(&total), whole(&dmu));
    follow.push(impulse(surfaces, read.0, read.1, read.2, (&momenta, n))?);
    let copy = |columns, from, out: Slice| solution.copy((count, columns), from, out, 1.0);
    follow.push(copy(2 * n, solution.by_face(0), (&left, 3 * n, 0))?);
    follow.push(copy(n, whole(&dphi), (&left, 3 * n, 2 * n))?);
    follow.push(copy(n, mu, (&both, 2 * n, 0))?);
    follow.push(copy(n, whole(&dmu), (&both, 2 * n, n))?);
    let densities = [&left, &both, &motion];
    solution.tangents(&solves, follow, &momenta, densities, z)
}
