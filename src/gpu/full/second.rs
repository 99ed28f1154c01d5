//! The tangent along one displacement, on the device: Eq. 21, and the second derivatives of the kernels.

use super::geometry::Solution;
use super::solve::solves;
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::Tangent;
use crate::gpu::columns::{Base, Slice};
use crate::gpu::products::{Product, To, product};
use crate::gpu::rows::impulse;

/// As the CPU's: the tangent of the first column's energy with the last.
pub(super) fn second(solution: &Solution, z: &[Vec6]) -> Result<Tangent> {
    let (placed, n) = (&solution.placed.surfaces, solution.columns);
    let surfaces = &placed.surfaces;
    let (context, sizes) = (&surfaces.context, &surfaces.sizes);
    let fine = context.fine();
    let (faces, sources) = (sizes.faces, sizes.sources);
    let motion = context.upload("motions", fine, &placed.motions(z))?;

    // [δK a, δK λ] and δP a by face.
    let dk = context.reals("δK X", fine, faces * 2 * n)?;
    let dphi = context.reals("δP a", fine, faces * n)?;
    // [δKᵀ r − Kᵀ δK a, δPᵀ β − δKᵀ μ − Kᵀ δK λ] by source.
    let g = context.reals("right-hand sides", fine, sources * 2 * n)?;
    let x = context.zeros("tangent of the strengths", fine, sources * 2 * n)?;
    let forward = |potential| Product::forward(potential).tangent(&motion);
    let back = |potential| Product::back(potential).tangent(&motion);
    let all = |b| (b, 2 * n, 0);
    // Of [δKᵀ μ, δKᵀ r].
    let mu = To {
        scale: -1.0,
        ..To::plain(n, (&g, 2 * n, n))
    };
    let r = To {
        from: n,
        ..To::plain(n, all(&g))
    };
    let beta = To {
        base: Base::Out,
        ..To::plain(n, (&g, 2 * n, n))
    };
    let carried = To {
        scale: -1.0,
        base: Base::Out,
        ..To::plain(2 * n, all(&g))
    };
    let of = |what, x, columns, to: &[To]| product(placed, fine, what, x, columns, to);
    let tangents = [To::plain(2 * n, all(&dk))];
    let mut calls = of(forward(false), solution.by_source(0), 2 * n, &tangents)?;
    let potentials = [To::plain(n, (&dphi, n, 0))];
    calls.extend(of(forward(true), solution.by_source(0), n, &potentials)?);
    calls.extend(of(back(false), solution.by_face(0), 2 * n, &[mu, r])?);
    calls.extend(of(back(true), solution.by_face(2), n, &[beta])?);
    calls.extend(of(Product::back(false), all(&dk), 2 * n, &[carried])?);
    context.submit(&calls)?;

    // What follows from the tangent of the strengths: momenta and wrenches.
    let what = "tangent of the coupled system (Eq. 21)";
    let solves = solves(&solution.placed, what, all(&g), all(&x), 2 * n)?;
    let left = context.reals("left densities", fine, faces * 5 * n)?;
    let right = context.reals("right densities", fine, sources * 4 * n)?;
    let phi = context.reals("δφ", fine, faces * n)?;
    let momenta = context.reals("tangent of the momenta", fine, 6 * sizes.bodies * n)?;
    let lefts = |block: usize| (&left, 5 * n, block * n);
    let rights = |block: usize| (&right, 4 * n, block * n);
    let copy =
        |rows, columns, from, out: Slice, scale| solution.copy((rows, columns), from, out, scale);
    // [μ, r, β | δμ, δr] and [a, λ | δa, δλ]: δr = −δK a − K δa, δμ = δK λ + K δλ.
    let mut follow = vec![
        copy(faces, 3 * n, solution.by_face(0), lefts(0), 1.0)?,
        copy(faces, n, (&dk, 2 * n, n), lefts(3), 1.0)?,
        copy(faces, n, (&dk, 2 * n, 0), lefts(4), -1.0)?,
        copy(sources, 2 * n, solution.by_source(0), rights(0), 1.0)?,
        copy(sources, 2 * n, all(&x), rights(2), 1.0)?,
    ];
    let residual = To {
        scale: -1.0,
        base: Base::Out,
        ..To::plain(n, lefts(4))
    };
    let mu = To {
        from: n,
        base: Base::Out,
        ..To::plain(n, lefts(3))
    };
    let potential = To {
        base: Base::Other((&dphi, n, 0)),
        ..To::plain(n, (&phi, n, 0))
    };
    let forward = Product::forward;
    follow.extend(of(forward(false), all(&x), 2 * n, &[residual, mu])?);
    follow.extend(of(forward(true), all(&x), n, &[potential])?);
    let read = impulse(surfaces, (&phi, n, 0), lefts(3), all(&x), (&momenta, n))?;
    follow.push(read);
    let densities = [&left, &right, &motion];
    solution.tangents(&solves, follow, &momenta, densities, z)
}
