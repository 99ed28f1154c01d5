//! Solves for the strengths of sources, on the device.

use super::geometry::{PlacedSystem, Solution};
use super::solve::solves;
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::Tangent;
use crate::gpu::columns::{Base, products};
use crate::gpu::placed::PlacedSurfaces;
use crate::gpu::products::{Product, To, product};
use crate::gpu::response::{System, Unknowns};
use crate::gpu::rows::{impulse, rows};

impl System for PlacedSystem {
    const DENSITIES: [usize; 2] = [3, 2];
    const UNKNOWNS: Unknowns = Unknowns::Sources;

    fn surfaces(&self) -> &PlacedSurfaces {
        &self.surfaces
    }

    fn solve(solution: &mut Solution) -> Result<()> {
        let placed = solution.placed.clone();
        let (surfaces, here) = (&placed.surfaces.surfaces, &placed.surfaces);
        let (context, sizes) = (&surfaces.context, &surfaces.sizes);
        let (fine, k, n) = (context.fine(), solution.columns, sizes.sources);
        if k == 0 || n == 0 {
            return Ok(());
        }
        let given = (&solution.twists.upload(context)?, k);
        let g = context.reals("right-hand sides", fine, n * 2 * k)?;
        let (faces, sources) = (&surfaces.face_rows, &surfaces.source_rows);
        let at = |density| solution.by_face(density);
        let half = |block: usize| (&g, 2 * k, block * k);
        let asked = || rows(context, (faces, 0), given, at(1), false);
        let mut calls = vec![asked()?];
        calls.push(rows(context, (faces, 6), given, at(2), false)?);
        for (block, potential) in [false, true].into_iter().enumerate() {
            let (back, to) = (Product::back(potential), To::plain(k, half(block)));
            calls.extend(product(here, fine, back, at(1 + block), k, &[to])?);
        }
        calls.push(rows(context, (sources, 0), given, half(1), true)?);
        context.submit(&calls)?;

        // r and μ from X, then momenta and energies.
        let a = solution.by_source(0);
        let what = "coupled system (Eq. 20)";
        let solves = solves(&placed, what, half(0), a, 2 * k)?;
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
        let mut follow = product(here, fine, forward, a, 2 * k, &[residual, mu])?;
        // φ = P a, and the impulses.
        let phi = context.reals("potentials", fine, sizes.faces * k)?;
        let momenta = context.reals("momenta", fine, 6 * sizes.bodies * k)?;
        let to = To::plain(k, (&phi, k, 0));
        follow.extend(product(here, fine, Product::forward(true), a, k, &[to])?);
        follow.push(impulse(surfaces, (&phi, k, 0), at(0), a, (&momenta, k))?);
        let energies = context.reals("energies", fine, k * k)?;
        follow.push(products(context, n, (half(1), a), (&energies, k))?);
        let wanted = [(&momenta, 6 * sizes.bodies * k), (&energies, k * k)];
        // r made of an unfinished solution has to be made again from F x̄.
        let (reached, values) = solves.run(&[asked()?], &follow, &wanted)?;
        solution.take(reached, [&values[0], &values[1]], None);
        Ok(())
    }

    fn second(solution: &Solution, z: &[Vec6]) -> Result<Tangent> {
        super::second::second(solution, z)
    }
}
