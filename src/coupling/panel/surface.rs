//! The potentials on the bodies' own panels, with their rates, and the transpose.

use super::placed::{PanelSolution, scaled};
use crate::Result;
use crate::adjoint::kernel::{double_hvp, double_jvp, single_hvp, single_jvp};
use crate::adjoint::lie::{Vec3, Vec6};
use crate::coupling::pair::vector;
use crate::coupling::surface_back::wrenches;
use crate::coupling::{Motion, MotionBar, SurfacePotential};
use crate::solver::Columns;
use std::ops::Range;

impl PanelSolution<'_> {
    /// Potentials of the first of two columns, and their rates where the second has the rates of the twists and bodies are displaced as they move; what films
    /// have themselves isn't in them.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn surface_potentials(&self, motion: &Motion) -> Result<Vec<SurfacePotential>> {
        let displaced = self.displaced(motion)?;
        Ok(self.on_surfaces(&displaced))
    }

    /// What the displacement adds to the rates; zeros where those aren't asked for.
    fn displaced(&self, motion: &Motion) -> Result<Columns> {
        let placed = &self.placed;
        if motion.rates.is_none() {
            return Ok(Columns::zeros(self.phi.rows, 1));
        }
        let mut right = Columns::zeros(self.phi.rows, self.phi.columns);
        let z = motion.displacement;
        let films = placed.films.along(z);
        for (pair, fields) in placed.pairs.iter().zip(self.fields()) {
            let mut displacement = pair.displacements(&placed.poses[pair.target], z);
            if let Some((apart, film)) = pair.moving(&films) {
                let shift = apart.rate(film);
                displacement.iter_mut().for_each(|d| *d += shift);
            }
            placed.add_moved(pair, fields, &displacement, &mut right);
        }
        let none = Columns::zeros(right.rows, 0);
        let ([displaced, _], _) = placed.system.solve(&right, &none)?;
        Ok(displaced)
    }

    fn on_surfaces(&self, displaced: &Columns) -> Vec<SurfacePotential> {
        let of = |faces: &Range<usize>| SurfacePotential {
            value: faces.clone().map(|i| self.phi.at(i, 0)).collect(),
            rate: (faces.clone())
                .map(|i| self.phi.at(i, 1) + displaced.at(i, 0))
                .collect(),
            film: None,
        };
        self.placed.coupled.faces.iter().map(of).collect()
    }

    /// The transpose of [`PanelSolution::surface_potentials`], of a solution whose system reads the impulses of all bodies: with
    /// `Aᵀ m' = ψ̄` and `Aᵀ m = φ̄ − Ȧᵀ m'`,
    ///
    /// ```text
    /// δ(φ̄ᵀφ + ψ̄ᵀφ') = mᵀ(δS q − δA φ + S δq) + m'ᵀ(δS q' − δA φ' + δṠ q − δȦ φ + S δq' + Ṡ δq)
    /// ```
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn potentials_vjp(&self, motion: &Motion, bars: &[SurfacePotential]) -> Result<MotionBar> {
        let (placed, z) = (&self.placed, motion.displacement);
        let (rows, bodies) = (self.phi.rows, placed.poses.len());
        let displaced = self.displaced(motion)?;
        let phi = Columns::from_fn(rows, 2, |i, k| match k {
            0 => self.phi.at(i, 0),
            _ => self.phi.at(i, 1) + displaced.at(i, 0),
        });
        let moving = Self::known(placed.clone(), self.twists.clone(), phi);
        let all = |of: fn(&SurfacePotential) -> &[f64]| Columns {
            rows,
            columns: 1,
            data: bars.iter().flat_map(|b| of(b).iter().copied()).collect(),
        };
        let none = Columns::zeros(rows, 0);
        let ([_, of_rates], _) = placed.system.solve(&none, &all(|b| &b.rate))?;
        let displacements: Vec<Vec<Vec3>> = (placed.pairs.iter())
            .map(|pair| pair.displacements(&placed.poses[pair.target], z))
            .collect();
        let pairs = || placed.pairs.iter().zip(&displacements);
        let mut turned = all(|b| &b.value);
        // Ṡᵀ m'
        let mut back = Columns::zeros(rows, 1);
        for (pair, d) in pairs() {
            let (panels, points) = placed.ranges(pair);
            let triangles = placed.coupled.bodies[pair.target].panels().triangles();
            let (m, sign) = (of_rates.slice(&points), pair.image.sign);
            let out = turned.slice_mut(&panels);
            double_jvp(triangles, &pair.points, d, &scaled(-sign, m), 1, out);
            let out = back.slice_mut(&panels);
            single_jvp(triangles, &pair.points, d, &scaled(sign, m), 1, out);
        }
        let ([_, of_values], _) = placed.system.solve(&none, &turned)?;
        let mut bar = MotionBar::zeros(bodies);
        for (b, body) in placed.coupled.bodies.iter().enumerate() {
            let [mut twist, rate] = [&of_values, &of_rates].map(|m| placed.read(b, &m.data));
            for (i, at) in placed.coupled.faces[b].clone().enumerate() {
                twist += body.faces.twist_flux(i) * (back.at(at, 0) / body.faces.areas[i]);
            }
            bar.add_twists(b, &[twist, rate]);
        }
        let first = self.twists.columns(0, 1).into_owned();
        let (mut gradient, mut wrench) = (vec![Vec6::zeros(); bodies], vec![Vec6::zeros(); bodies]);
        for ((pair, d), fields) in pairs().zip(moving.fields()) {
            let (panels, points) = placed.ranges(pair);
            let triangles = placed.coupled.bodies[pair.target].panels().triangles();
            let sign = pair.image.sign;
            let mut bent = vec![0.0; 3 * d.len()];
            if let Some(q) = placed.normal_velocity(pair.target, &first) {
                single_hvp(triangles, &pair.points, d, &scaled(sign, &q), 1, &mut bent);
            }
            let phi: Vec<f64> = panels.clone().map(|i| -sign * self.phi.at(i, 0)).collect();
            double_hvp(triangles, &pair.points, d, &phi, 1, &mut bent);
            let forces = (0..d.len()).map(|i| {
                let (m, dm) = (
                    of_values.at(points.start + i, 0),
                    of_rates.at(points.start + i, 0),
                );
                let [e, de] = [0, 1].map(|k| vector(fields, 2, i, k));
                [dm * e, m * e + dm * (de + vector(&bent, 1, i, 0))]
            });
            let [w, dw] = wrenches(pair, d, forces);
            let pose = &placed.poses[pair.target];
            pair.apply(pose, &w, &mut gradient);
            pair.apply_jvp(pose, &w, &dw, &z[pair.target], &mut wrench);
        }
        bar.add_pull(z, &gradient, &wrench);
        Ok(bar)
    }
}
