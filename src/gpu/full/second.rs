//! The tangent along one displacement, on the device: Eq. 21, and the second derivatives of the kernels.

use super::pairs::{Densities, pairs_hvp};
use super::products::{Product, To, product};
use super::response::{Solution, impulses, spatial};
use super::solve::Solves;
use crate::Result;
use crate::adjoint::lie::{Vec6, angular, cross_force, linear};
use crate::coupling::Tangent;
use crate::gpu::buffer::Buffer;
use crate::gpu::geometry::PlacedSystem;
use crate::gpu::impulse::impulse;
use crate::gpu::kernel::Batch;
use crate::gpu::sum::{Base, Slice, Sum, sum};

/// Twists of all images of all bodies, then of the bodies as they see, about the scene's middle.
pub(super) fn motions(placed: &PlacedSystem, z: &[Vec6]) -> Vec<f64> {
    let geometry = &placed.geometry;
    let mut out = Vec::new();
    let mut add = |z: &Vec6| {
        let u = (linear(z) + angular(z).cross(&placed.middle)) / geometry.length;
        out.extend(u.iter());
        out.extend(angular(z).iter());
    };
    for image in &geometry.model.images {
        z.iter().for_each(|z| add(&image.twist(z)));
    }
    z.iter().for_each(add);
    out
}

impl Solution {
    /// As the CPU's: the tangent of the first column's energy with the last.
    pub(super) fn second(&self, z: &[Vec6]) -> Result<Tangent> {
        let (placed, n) = (&self.placed, self.columns);
        let geometry = &placed.geometry;
        let (context, sizes) = (&geometry.context, &geometry.sizes);
        let fine = context.fine();
        let (faces, sources) = (sizes.faces, sizes.sources);
        let motion = context.upload("motions", fine, &motions(placed, z))?;

        // [δK a, δK λ] and δP a by face.
        let dk = context.reals("δK X", fine, faces * 2 * n)?;
        let dphi = context.reals("δP a", fine, faces * n)?;
        // [δKᵀ r − Kᵀ δK a, δPᵀ β − δKᵀ μ − Kᵀ δK λ] by source.
        let g = context.reals("right-hand sides", fine, sources * 2 * n)?;
        let x = context.zeros("tangent of the strengths", fine, sources * 2 * n)?;
        let forward = |potential| Product::ForwardTangent {
            potential,
            motions: &motion,
        };
        let back = |potential| Product::TransposeTangent {
            potential,
            motions: &motion,
        };
        let strengths = (&self.strengths, 2 * n, 0);
        let densities = |block: usize| (&self.densities, 3 * n, block * n);
        // Of [δKᵀ μ, δKᵀ r].
        let mu = To {
            scale: -1.0,
            ..To::plain(n, (&g, 2 * n, n))
        };
        let r = To {
            from: n,
            ..To::plain(n, (&g, 2 * n, 0))
        };
        let beta = To {
            accumulate: true,
            ..To::plain(n, (&g, 2 * n, n))
        };
        let carried = To {
            scale: -1.0,
            accumulate: true,
            ..To::plain(2 * n, (&g, 2 * n, 0))
        };
        let calls = [
            product(
                placed,
                fine,
                forward(false),
                strengths,
                2 * n,
                &[To::plain(2 * n, (&dk, 2 * n, 0))],
            )?,
            product(
                placed,
                fine,
                forward(true),
                strengths,
                n,
                &[To::plain(n, (&dphi, n, 0))],
            )?,
            product(placed, fine, back(false), densities(0), 2 * n, &[mu, r])?,
            product(placed, fine, back(true), densities(2), n, &[beta])?,
            product(
                placed,
                fine,
                Product::Transpose { potential: false },
                (&dk, 2 * n, 0),
                2 * n,
                &[carried],
            )?,
        ];
        let all: Vec<&[_]> = calls.iter().map(Vec::as_slice).collect();
        context.run(&all)?;

        let solves = Solves::new(placed, (&g, 2 * n, 0), (&x, 2 * n, 0), 2 * n)?;
        let mut batch = Batch::default();
        solves.begin(&mut batch);
        context.submit(&batch)?;
        let what = "tangent of the coupled system (Eq. 21)";
        let after = After {
            solution: self,
            motion: &motion,
            dk: &dk,
            dphi: &dphi,
            x: &x,
        };
        let mut found = after.run(Some(&solves))?;
        if (solves.reached(placed, &found.states, what, false)?).is_none() {
            solves.finish(placed, what)?;
            found = after.run(None)?;
        }
        Ok(self.assemble(z, &found.momenta, &found.wrenches))
    }

    /// Both bodies' share of every pair's wrench.
    fn assemble(&self, z: &[Vec6], momenta: &[f64], wrenches: &[f64]) -> Tangent {
        let (placed, n) = (&self.placed, self.columns);
        let geometry = &placed.geometry;
        let momenta = impulses(geometry, self.moving(), momenta, &self.scale);
        let mut gradient = vec![Vec6::zeros(); geometry.sizes.bodies];
        let mut rate = gradient.clone();
        let unit = self.scale[0] * self.scale[n - 1];
        for (number, pair) in geometry.pairs.iter().enumerate() {
            let at = |x: usize, y: usize, part: usize| {
                let from = ((number * n + x) * n + y) * 12 + 6 * part;
                spatial(placed, &wrenches[from..from + 6], unit)
            };
            // The symmetrised form.
            let of = |part| 0.5 * (at(0, n - 1, part) + at(n - 1, 0, part));
            let world = of(0);
            // The pair's wrench turns with the faces that it was taken against.
            let turned = of(1) + cross_force(&z[pair.target], &world);
            let image = &geometry.model.images[pair.image];
            gradient[pair.source] += image.twist_vjp(&world);
            gradient[pair.target] -= world;
            rate[pair.source] += image.twist_vjp(&turned);
            rate[pair.target] -= turned;
        }
        Tangent {
            momentum_x: momenta.column(0).into_owned(),
            momentum_y: momenta.column(n - 1).into_owned(),
            gradient,
            wrench: rate,
        }
    }
}

/// What was derived from it, as the device has it.
struct Derived {
    momenta: Vec<f64>,
    wrenches: Vec<f64>,
    /// How the solves stand.
    states: Vec<Vec<u8>>,
}

/// What follows from the tangent X of the strengths.
struct After<'a> {
    solution: &'a Solution,
    motion: &'a Buffer,
    dk: &'a Buffer,
    dphi: &'a Buffer,
    x: &'a Buffer,
}

impl After<'_> {
    /// Momenta, wrenches, and how the solves stand.
    fn run(&self, solves: Option<&Solves>) -> Result<Derived> {
        let n = self.solution.columns;
        let placed = &self.solution.placed;
        let geometry = &placed.geometry;
        let (context, sizes) = (&geometry.context, &geometry.sizes);
        let fine = context.fine();
        let (faces, sources) = (sizes.faces, sizes.sources);
        let left = context.reals("left densities", fine, faces * 5 * n)?;
        let right = context.reals("right densities", fine, sources * 4 * n)?;
        let phi = context.reals("δφ", fine, faces * n)?;
        let momenta = context.reals("tangent of the momenta", fine, 6 * sizes.bodies * n)?;
        let copy = |rows: usize, columns: usize, base: Slice, out: Slice, scale: f32| {
            let task = Sum {
                rows,
                columns,
                parts: (base.0, 1, base.1, base.2),
                scale,
                base: Base::Nothing,
                damped: None,
                out,
            };
            sum(context, fine, &task, &geometry.open)
        };
        let solution = self.solution;
        // [μ, r, β | δμ, δr] and [a, λ | δa, δλ]: δr = −δK a − K δa, δμ = δK λ + K δλ.
        let copies = [
            copy(
                faces,
                3 * n,
                (&solution.densities, 3 * n, 0),
                (&left, 5 * n, 0),
                1.0,
            )?,
            copy(faces, n, (self.dk, 2 * n, n), (&left, 5 * n, 3 * n), 1.0)?,
            copy(faces, n, (self.dk, 2 * n, 0), (&left, 5 * n, 4 * n), -1.0)?,
            copy(
                sources,
                2 * n,
                (&solution.strengths, 2 * n, 0),
                (&right, 4 * n, 0),
                1.0,
            )?,
            copy(
                sources,
                2 * n,
                (self.x, 2 * n, 0),
                (&right, 4 * n, 2 * n),
                1.0,
            )?,
        ];
        let residual = To {
            scale: -1.0,
            accumulate: true,
            ..To::plain(n, (&left, 5 * n, 4 * n))
        };
        let mu = To {
            from: n,
            accumulate: true,
            ..To::plain(n, (&left, 5 * n, 3 * n))
        };
        let x = (self.x, 2 * n, 0);
        let image = product(
            placed,
            fine,
            Product::Forward { potential: false },
            x,
            2 * n,
            &[residual, mu],
        )?;
        let potential = To {
            base: Some((self.dphi, n, 0)),
            ..To::plain(n, (&phi, n, 0))
        };
        let read = product(
            placed,
            fine,
            Product::Forward { potential: true },
            x,
            n,
            &[potential],
        )?;
        let of = Densities {
            left: &left,
            right: &right,
            columns: n,
        };
        let (pairs, wrenches, count) = pairs_hvp(placed, fine, &of, self.motion)?;
        let last = [impulse(
            context,
            geometry,
            &phi,
            (&left, 5 * n, 3 * n),
            x,
            (&momenta, n),
        )?];
        context.run(&[&copies, &image, &read, &last, &pairs])?;
        let mut wanted = vec![
            (&momenta, 6 * sizes.bodies * n * fine.size()),
            (&wrenches, count * fine.size()),
        ];
        wanted.extend(solves.iter().flat_map(|s| s.report()));
        let mut bytes = context.read_bytes(&wanted)?;
        let states = bytes.split_off(2);
        Ok(Derived {
            momenta: fine.numbers(&bytes[0]),
            wrenches: fine.numbers(&bytes[1]),
            states,
        })
    }
}
