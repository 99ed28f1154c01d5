//! First derivatives with the shapes of bodies: of the energy, and of its slope along a displacement.
//!
//! Of what the solution leaves stationary, with f = D F x̄ the fluxes, and K = Ω/4π of all images,
//!
//! ```text
//! E(x, y) = ½ {L(x, y) + L(y, x)},   L(x, y) = f_xᵀ φ_y + μ_xᵀ (S q_y − A φ_y)
//! ∂L = ∂f_xᵀ φ_y + μ_xᵀ (∂S q_y + S ∂q_y − ∂K φ_y)
//! D_g(∂L)[Z] = ∂f_xᵀ δφ_y + δμ_xᵀ (∂S q_y + S ∂q_y − ∂K φ_y) − μ_xᵀ ∂K δφ_y + μ_xᵀ (δ∂S q_y + δS ∂q_y − δ∂K φ_y)
//! ```
//!
//! δ as the bodies are displaced along Z. A vertex moves the corners of panels, and with their centroids the points that see others; all of it ends as a cotangent of
//! the corners of each panel in its body's frame, which then meets the velocities of a [`ShapeDirection`]. So many directions cost little more than one.

use super::placed::{PanelSolution, PlacedPanels, scaled};
use super::second::Displacements;
use crate::Result;
use crate::adjoint::kernel::{
    CornerSums, Form, Sources, Triangles, corner_hvp, corner_vjp, double_hvp, layers_vjp,
    single_hvp,
};
use crate::adjoint::lie::{Vec3, Vec6, angular};
use crate::coupling::pair::{Pair, vector};
use crate::coupling::response::body_twists;
use crate::coupling::shape::filmed;
use crate::coupling::{Direction, ShapeTerm};
use crate::solver::Columns;
use nalgebra::{DMatrix, DVector};

/// Products μᵀ(S q − K φ) + fᵀ φ, a column each: weights are in μ and f.
#[derive(Default)]
struct Products {
    mu: Vec<Vec<f64>>,
    phi: Vec<Vec<f64>>,
    /// Twists of q.
    moving: Vec<DVector<f64>>,
    /// Twists of f.
    through: Vec<DVector<f64>>,
}

/// [`Products`] side by side.
struct Sides {
    mu: Columns,
    phi: Columns,
    moving: DMatrix<f64>,
    through: DMatrix<f64>,
}

/// Cotangents of one body's panels.
#[derive(Clone)]
struct Cotangent {
    /// Of the corners, m²/s² and so on per m.
    corners: Vec<[Vec3; 3]>,
    /// Of the normal velocities, `[panel][column]`.
    velocities: Vec<f64>,
}

impl Products {
    fn push(&mut self, mu: Vec<f64>, phi: Vec<f64>, moving: DVector<f64>, through: DVector<f64>) {
        self.mu.push(mu);
        self.phi.push(phi);
        self.moving.push(moving);
        self.through.push(through);
    }

    fn sides(&self) -> Option<Sides> {
        let columns = |x: &[Vec<f64>]| {
            let slices: Vec<&[f64]> = x.iter().map(Vec::as_slice).collect();
            Columns::from_columns(&slices)
        };
        (!self.mu.is_empty()).then(|| Sides {
            mu: columns(&self.mu),
            phi: columns(&self.phi),
            moving: DMatrix::from_columns(&self.moving),
            through: DMatrix::from_columns(&self.through),
        })
    }
}

impl PanelSolution<'_> {
    /// Derivatives of a sum of terms with respect to each of the shape parameters.
    ///
    /// # Errors
    /// A solve that misses its tolerance; films that hold bodies apart.
    pub fn shape_slopes(&self, terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        let (placed, model) = (&self.placed, self.placed.coupled);
        let shapes = model.shapes();
        if shapes.is_empty() {
            return Ok(DVector::zeros(0));
        }
        if placed.films.any() {
            return Err(filmed());
        }
        let mut bars: Vec<Option<Vec<[Vec3; 3]>>> = vec![None; model.bodies.len()];
        for shape in shapes {
            let none = || vec![[Vec3::zeros(); 3]; model.bodies[shape.body].faces.len()];
            bars[shape.body].get_or_insert_with(none);
        }
        let mut out = DVector::zeros(shapes.len());
        let mut products = Products::default();
        for term in terms {
            let solution = self.along(&Direction::distinct(term.x, term.y))?;
            let last = solution.twists.ncols() - 1;
            let twists = |k: usize| solution.twists.column(k).into_owned();
            // A pair that is one direction counts once.
            let pairs: &[(usize, usize)] = if last == 0 {
                &[(0, 0)]
            } else {
                &[(0, 1), (1, 0)]
            };
            let weight = term.weight / pairs.len() as f64;
            let Some(z) = term.along else {
                for &(x, y) in pairs {
                    let mu = scaled(weight, &solution.mu.column(x));
                    products.push(mu, solution.phi.column(y), twists(y), weight * twists(x));
                }
                for ((out, shape), rate) in out.iter_mut().zip(shapes).zip(model.lacking_rates()) {
                    let twists = body_twists(&solution.twists, shape.body);
                    let (x, y) = (twists[0], twists[last]);
                    *out += term.weight * x.dot(&(rate * y));
                }
                continue;
            };
            let displacements = placed.displacements(z);
            let moved = placed.moved(&solution, &displacements)?;
            let mut displaced = Products::default();
            for &(x, y) in pairs {
                let mu = scaled(weight, &solution.mu.column(x));
                let rest = DVector::zeros(solution.twists.nrows());
                let (phi, dphi) = (solution.phi.column(y), moved.phi.column(y));
                let dmu = scaled(weight, &moved.mu.column(x));
                products.push(dmu, phi.clone(), twists(y), rest.clone());
                products.push(mu.clone(), dphi, rest.clone(), weight * twists(x));
                displaced.push(mu, phi, twists(y), rest);
            }
            if let Some(sides) = displaced.sides() {
                placed.add_displaced(&sides, &displacements, z, &mut bars);
            }
        }
        if let Some(sides) = products.sides() {
            placed.add_products(&sides, &mut bars);
        }
        for (out, shape) in out.iter_mut().zip(shapes) {
            let (Some(bars), body) = (&bars[shape.body], &model.bodies[shape.body]) else {
                continue;
            };
            for (bar, corners) in bars.iter().zip(body.panels().corners()) {
                let each = bar.iter().zip(corners);
                let moved = each.map(|(bar, v)| bar.dot(&shape.vertices[*v as usize]));
                *out += moved.sum::<f64>();
            }
        }
        Ok(out)
    }
}

impl PlacedPanels<'_> {
    /// Adds the cotangents of corners of products.
    fn add_products(&self, sides: &Sides, bars: &mut [Option<Vec<[Vec3; 3]>>]) {
        let k = sides.mu.columns;
        let mut cotangents = self.cotangents(sides, bars);
        for (b, cotangent) in cotangents.iter_mut().enumerate() {
            if let Some(cotangent) = cotangent {
                self.add_own(b, sides, cotangent);
            }
        }
        for pair in &self.pairs {
            if let Some(cotangent) = &mut cotangents[pair.target] {
                let mu = sides.mu.slice(&self.coupled.faces[pair.source]);
                let mu = scaled(pair.image.sign, mu);
                let sums = self.sums(pair, k, |t, out| {
                    corner_vjp(t, &pair.points, Form::Blended, &mu, k, out);
                });
                self.meet(pair.target, sides, &sums, cotangent);
            }
            if let Some(cotangent) = &mut cotangents[pair.source] {
                let fields = self.fields_of(pair, &sides.moving, &sides.phi);
                let forces = self.forces(pair.source, sides, &fields);
                let own = forces.iter().map(|f| pair.rotation.tr_mul(f));
                spread(own, &mut cotangent.corners);
            }
        }
        for (b, cotangent) in cotangents.into_iter().enumerate() {
            if let (Some(cotangent), Some(bars)) = (cotangent, &mut bars[b]) {
                self.finish(b, sides, &cotangent, bars);
            }
        }
    }

    /// The same of their tangents where points of pairs are displaced, all else as it is.
    fn add_displaced(
        &self,
        sides: &Sides,
        displacements: &[Displacements],
        z: &[Vec6],
        bars: &mut [Option<Vec<[Vec3; 3]>>],
    ) {
        let k = sides.mu.columns;
        let mut cotangents = self.cotangents(sides, bars);
        for (pair, Displacements { points: d, .. }) in self.pairs.iter().zip(displacements) {
            let sign = pair.image.sign;
            if let Some(cotangent) = &mut cotangents[pair.target] {
                let mu = sides.mu.slice(&self.coupled.faces[pair.source]);
                let mu = scaled(sign, mu);
                let sums = self.sums(pair, k, |t, out| {
                    corner_hvp(t, &pair.points, Form::Blended, d, &mu, k, out);
                });
                self.meet(pair.target, sides, &sums, cotangent);
            }
            if let Some(cotangent) = &mut cotangents[pair.source] {
                let triangles = self.coupled.bodies[pair.target].panels().triangles();
                let mut rates = vec![0.0; 3 * k * pair.positions.len()];
                if let Some(q) = self.normal_velocity(pair.target, &sides.moving) {
                    single_hvp(triangles, &pair.points, d, &scaled(sign, &q), k, &mut rates);
                }
                let phi = sides.phi.slice(&self.coupled.faces[pair.target]);
                double_hvp(
                    triangles,
                    &pair.points,
                    d,
                    &scaled(-sign, phi),
                    k,
                    &mut rates,
                );
                let fields = self.fields_of(pair, &sides.moving, &sides.phi);
                let [forces, rates] = [&fields, &rates].map(|f| self.forces(pair.source, sides, f));
                // A point of the source turns with it, as the panels see it.
                let turn = angular(&pair.relative_twist(&self.poses[pair.target], z));
                let own = forces.iter().zip(&rates);
                let own = own.map(|(f, df)| pair.rotation.tr_mul(&(df - turn.cross(f))));
                spread(own, &mut cotangent.corners);
            }
        }
        for (b, cotangent) in cotangents.into_iter().enumerate() {
            if let (Some(cotangent), Some(bars)) = (cotangent, &mut bars[b]) {
                self.finish(b, sides, &cotangent, bars);
            }
        }
    }

    /// Zeros for the bodies that change.
    fn cotangents(&self, sides: &Sides, bars: &[Option<Vec<[Vec3; 3]>>]) -> Vec<Option<Cotangent>> {
        let of = |bar: &Option<Vec<[Vec3; 3]>>| {
            bar.as_ref().map(|bar| Cotangent {
                corners: vec![[Vec3::zeros(); 3]; bar.len()],
                velocities: vec![0.0; bar.len() * sides.mu.columns],
            })
        };
        bars.iter().map(of).collect()
    }

    /// A body's panels and its own centroids.
    fn add_own(&self, b: usize, sides: &Sides, cotangent: &mut Cotangent) {
        let k = sides.mu.columns;
        let body = &self.coupled.bodies[b];
        let (triangles, rows) = (body.panels().triangles(), &self.coupled.faces[b]);
        let points = Sources::new(&body.faces.centres);
        let mut sums = vec![CornerSums::default(); k * body.faces.len()];
        let mu = sides.mu.slice(rows);
        corner_vjp(triangles, &points, Form::Closed, mu, k, &mut sums);
        self.meet(b, sides, &sums, cotangent);
        let q = self.velocities(b, sides);
        let phi = scaled(-1.0, sides.phi.slice(rows));
        let mut fields = vec![0.0; 3 * k * body.faces.len()];
        layers_vjp(triangles, &points, &q, &phi, k, &mut fields);
        let forces = self.forces(b, sides, &fields);
        spread(forces.into_iter(), &mut cotangent.corners);
    }

    /// Sums of a pair's panels, by a sweep.
    fn sums(
        &self,
        pair: &Pair,
        columns: usize,
        fill: impl Fn(&Triangles, &mut [CornerSums]),
    ) -> Vec<CornerSums> {
        let triangles = self.coupled.bodies[pair.target].panels().triangles();
        let mut out = vec![CornerSums::default(); columns * triangles.len()];
        fill(triangles, &mut out);
        out
    }

    /// What sums of μ over points mean for the panels that they are of.
    fn meet(&self, b: usize, sides: &Sides, sums: &[CornerSums], cotangent: &mut Cotangent) {
        let (k, q) = (sides.mu.columns, self.velocities(b, sides));
        let phi = sides.phi.slice(&self.coupled.faces[b]);
        for (n, sum) in sums.iter().enumerate() {
            for (c, out) in cotangent.corners[n / k].iter_mut().enumerate() {
                *out += q[n] * sum.single_corners[c] - phi[n] * sum.double_corners[c];
            }
            cotangent.velocities[n] += sum.single;
        }
    }

    /// Normal velocities, `[panel][column]`.
    fn velocities(&self, b: usize, sides: &Sides) -> Vec<f64> {
        let resting = || vec![0.0; self.coupled.faces[b].len() * sides.mu.columns];
        let moving = self.normal_velocity(b, &sides.moving);
        moving.unwrap_or_else(resting)
    }

    /// Σ_columns μ ∇(S q − K φ) at the points of body `b`.
    fn forces(&self, b: usize, sides: &Sides, fields: &[f64]) -> Vec<Vec3> {
        let k = sides.mu.columns;
        let mu = sides.mu.slice(&self.coupled.faces[b]);
        let at = |i: usize| {
            (0..k)
                .map(|c| mu[i * k + c] * vector(fields, k, i, c))
                .sum()
        };
        (0..mu.len() / k).map(at).collect()
    }

    /// Adds the corners' cotangents, and what normal velocities and fluxes make of theirs.
    fn finish(&self, b: usize, sides: &Sides, cotangent: &Cotangent, bars: &mut [[Vec3; 3]]) {
        let k = sides.mu.columns;
        let faces = &self.coupled.bodies[b].faces;
        let (q, phi) = (
            self.velocities(b, sides),
            sides.phi.slice(&self.coupled.faces[b]),
        );
        let [moving, through] = [&sides.moving, &sides.through].map(|t| body_twists(t, b));
        for (i, out) in bars.iter_mut().enumerate() {
            let area = faces.areas[i];
            let (mut twist, mut stretched) = (Vec6::zeros(), 0.0);
            for c in 0..k {
                let n = i * k + c;
                twist += moving[c] * (cotangent.velocities[n] / area) + through[c] * phi[n];
                stretched += cotangent.velocities[n] * q[n] / area;
            }
            let (fluxes, areas) = (faces.twist_flux_slopes(i, &twist), faces.area_slopes(i));
            for (c, out) in out.iter_mut().enumerate() {
                *out += cotangent.corners[i][c] + fluxes[c] - stretched * areas[c];
            }
        }
    }
}

/// Adds cotangents of centroids to their corners.
fn spread(centroids: impl Iterator<Item = Vec3>, corners: &mut [[Vec3; 3]]) {
    for (force, corners) in centroids.zip(corners) {
        corners.iter_mut().for_each(|c| *c += force / 3.0);
    }
}
