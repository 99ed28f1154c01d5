//! Solves for the densities of panels, on the device.

use super::geometry::{PlacedPanels, Solution};
use super::solve::{System as Equations, solves};
use crate::adjoint::lie::Vec6;
use crate::coupling::Tangent;
use crate::gpu::columns::{Base, products};
use crate::gpu::placed::PlacedSurfaces;
use crate::gpu::products::{Product, To, product};
use crate::gpu::response::{System, Unknowns};
use crate::gpu::rows::{impulse, rows};
use crate::{Error, Result};

impl System for PlacedPanels {
    const DENSITIES: [usize; 2] = [2, 1];
    const UNKNOWNS: Unknowns = Unknowns::Faces;

    fn surfaces(&self) -> &PlacedSurfaces {
        &self.surfaces
    }

    fn solve(solution: &mut Solution) -> Result<()> {
        let placed = solution.placed.clone();
        let model = &placed.geometry.model;
        let found = solve(&placed, solution);
        if let Err(Error::Solver { .. }) = &found {
            // Bodies inside each other have no solution, and are the better thing to say.
            model.check_apart(&placed.poses)?;
        }
        model.check_filled(&placed.poses, &found?)
    }

    fn second(solution: &Solution, z: &[Vec6]) -> Result<Tangent> {
        super::second::second(solution, z)
    }
}

/// The share of the full solid angle that all others fill, seen from every panel.
fn solve(placed: &PlacedPanels, solution: &mut Solution) -> Result<Vec<f64>> {
    let (surfaces, here) = (&placed.surfaces.surfaces, &placed.surfaces);
    let (context, sizes) = (&surfaces.context, &surfaces.sizes);
    let (fine, k, n) = (context.fine(), solution.columns, sizes.faces);
    let filled = (&placed.filled, n);
    if k == 0 || n == 0 {
        return Ok(context.read(fine, &[filled])?.swap_remove(0));
    }
    let given = (&solution.twists.upload(context)?, k);
    let reals = |label, count| context.reals(label, fine, count);
    let (b, g) = (reals("S q", n * k)?, reals("fluxes", n * k)?);
    let (phi, q) = (solution.by_face(0), solution.by_face(1));
    let (mu, right, flux) = (solution.by_source(0), (&b, k, 0), (&g, k, 0));
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

    let equations = |transpose, given, solution| Equations {
        transpose,
        given,
        solution,
    };
    let systems = [equations(false, right, phi), equations(true, flux, mu)];
    let solves = solves(placed, "the coupled panel system", systems, k)?;
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
    let lacking = placed.geometry.model.lacking(&solution.twists.all);
    solution.take(reached, [&values[0], &values[1]], Some(lacking));
    Ok(values.swap_remove(2))
}
