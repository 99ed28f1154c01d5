//! Derivatives with respect to shapes, by way of the compression.
//!
//! With β = G α the potential that comes in at the points, and points, Ū, S̄ and M̄₀ of a body as functions of its shape,
//!
//! ```text
//! δE(x, y) = x̄ᵀ δM̄₀ ȳ + 4π [ (δŪ x̄)ᵀ β_y + β_xᵀ δŪ ȳ + β_xᵀ δS̄ β_y + Σ δx̄·(α_x ∇β_y + α_y ∇β_x) ]
//! ```
//!
//! at fixed poses and twists: no further solve. Its slope along a displacement of the bodies takes the tangents of α, β and ∇β, which the second derivative solves for as well.

use super::linearised::ReducedLinearised;
use super::placed::Moved;
use super::placed::PlacedSkeletons;
use super::slope::ShapeSlope;
use super::views::FLUX;
use crate::Result;
use crate::adjoint::lie::{Mat3, Vec3, Vec6, angular};
use crate::coupling::shape::filmed;
use crate::coupling::{Direction, ShapeTerm};
use nalgebra::{DMatrix, DVector};

/// What comes in at the points of all bodies for one direction, and its rates along a displacement.
struct Incoming {
    /// α.
    charge: Vec<[f64; 2]>,
    /// β.
    potential: Vec<[f64; 2]>,
    /// ∇β, body frames.
    gradient: Vec<[Vec3; 2]>,
}

impl ReducedLinearised<'_> {
    /// [`Linearised::shape_vjp`](crate::coupling::Linearised::shape_vjp).
    pub(super) fn shapes(&self, terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        let shapes = &self.reduced.shapes;
        let mut out = DVector::zeros(shapes.len());
        if shapes.is_empty() {
            return Ok(out);
        }
        if self.films.any() {
            return Err(filmed());
        }
        for term in terms {
            // A direction with itself is asked for in every step: its exchange is summed once.
            let responses: Vec<_> = (Direction::distinct(term.x, term.y).into_iter())
                .map(|x| self.respond(x))
                .collect();
            let (x, y) = (&responses[0], &responses[responses.len() - 1]);
            let incoming = match responses.len() {
                1 => Vec::from(self.incoming([x.alpha.as_slice()], term.along)),
                _ => {
                    Vec::from(self.incoming([&x.alpha, &y.alpha].map(|a| a.as_slice()), term.along))
                }
            };
            let (from_x, from_y) = (&incoming[0], &incoming[incoming.len() - 1]);
            for (out, (b, slope)) in out.iter_mut().zip(shapes) {
                let twists = [&x.twists, &y.twists].map(|t| t.fixed_rows::<6>(6 * b).into_owned());
                let found = self.contracted(*b, slope, &twists, [from_x, from_y]);
                *out += term.weight * found[usize::from(term.along.is_some())];
            }
        }
        Ok(out)
    }

    /// δE for a body's slope, and its rate.
    fn contracted(
        &self,
        b: usize,
        slope: &ShapeSlope,
        [x, y]: &[Vec6; 2],
        [from_x, from_y]: [&Incoming; 2],
    ) -> [f64; 2] {
        let range = self.range(b);
        let [own_x, own_y] = [x, y].map(|t| &slope.strengths * t);
        let part = |of: &Incoming, k: usize| {
            DVector::from_iterator(range.len(), range.clone().map(|i| of.potential[i][k]))
        };
        let [bx, by] = [from_x, from_y].map(|f| [part(f, 0), part(f, 1)]);
        let solved = |k: usize| &slope.solution * &by[k];
        let still = own_x.dot(&by[0]) + own_y.dot(&bx[0]) + bx[0].dot(&solved(0));
        let rate =
            own_x.dot(&by[1]) + own_y.dot(&bx[1]) + bx[1].dot(&solved(0)) + bx[0].dot(&solved(1));
        let mut out = [still, rate];
        for (i, d) in range.zip(&slope.points) {
            for (a, g) in [(from_x, from_y), (from_y, from_x)] {
                let ([a, da], [g, dg]) = (a.charge[i], g.gradient[i]);
                out[0] += a * d.dot(&g);
                out[1] += da * d.dot(&g) + a * d.dot(&dg);
            }
        }
        out = out.map(|x| FLUX * x);
        out[0] += x.dot(&(slope.added_mass * y));
        out
    }

    /// Of one or two directions; rates are zero without a displacement.
    fn incoming<const N: usize>(
        &self,
        alpha: [&[f64]; N],
        along: Option<&[Vec6]>,
    ) -> [Incoming; N] {
        let count = self.reduced.point_count();
        let (mut rates, mut moved) = (DMatrix::zeros(count, N), None);
        if let Some(z) = along {
            let (psi, kept) = self.tangent_potentials(&alpha, z, &self.films.along(z));
            rates = self.tangent_solution(&psi).0;
            moved = Some(kept);
        }
        let none = (Vec3::zeros(), [0.0; 2]);
        let mut seen = vec![[(none.1, [none.0; 2]); N]; count];
        let charge = |k: usize, i: usize| [alpha[k][i], rates[(i, k)]];
        for (n, placed) in self.placed.iter().enumerate() {
            let moved = moved.as_ref().map(|m| &m[n].0);
            self.exchange(placed, moved, charge, &mut seen);
        }
        std::array::from_fn(|k| Incoming {
            charge: (0..count).map(|i| charge(k, i)).collect(),
            potential: seen.iter().map(|s| s[k].0).collect(),
            gradient: seen.iter().map(|s| s[k].1).collect(),
        })
    }

    /// Adds what the two ends of a link send to each other.
    fn exchange<const N: usize>(
        &self,
        placed: &PlacedSkeletons,
        moved: Option<&Moved>,
        charge: impl Fn(usize, usize) -> [f64; 2],
        seen: &mut [[([f64; 2], [Vec3; 2]); N]],
    ) {
        let link = placed.link;
        let (t, s) = (self.range(link.target), self.range(link.source));
        let shaped = |b: usize| self.reduced.shapes.iter().any(|(body, _)| *body == b);
        let wanted = [shaped(link.target), shaped(link.source)];
        if wanted == [false; 2] {
            return;
        }
        let [weight, slope, _] = placed.weight;
        let weights = [
            link.factor * weight,
            link.factor * slope * moved.map_or(0.0, |m| m.rate),
        ];
        let (rotation, _) = link.image.placement(&self.poses[link.source]);
        let rotation: Mat3 = self.poses[link.target].rotation.tr_mul(&rotation);
        let turning = moved.map_or(Vec3::zeros(), |m| angular(&m.local));
        let targets = &self.reduced.bodies[link.target].parts().points;
        for (j, y) in placed.pair.positions.iter().enumerate() {
            let d = moved.map_or(Vec3::zeros(), |m| m.points[j]);
            let mut back = [([0.0; 2], [Vec3::zeros(); 2]); N];
            for (i, x) in targets.iter().enumerate() {
                let apart = x - y;
                let inverse = 1.0 / apart.norm();
                let (cube, along) = (inverse.powi(3), apart.dot(&d));
                let value = [inverse, cube * along];
                let gradient = [
                    -apart * cube,
                    d * cube - apart * (3.0 * cube * inverse * inverse * along),
                ];
                for k in 0..N {
                    if wanted[0] {
                        let at = &mut seen[t.start + i][k];
                        add(at, charge(k, s.start + j), &value, &gradient, weights, 1.0);
                    }
                    if wanted[1] {
                        let at = &mut back[k];
                        add(at, charge(k, t.start + i), &value, &gradient, weights, -1.0);
                    }
                }
            }
            for (at, (potential, [g, dg])) in seen[s.start + j].iter_mut().zip(back) {
                at.0[0] += potential[0];
                at.0[1] += potential[1];
                at.1[0] += rotation.tr_mul(&g);
                at.1[1] += rotation.tr_mul(&(dg - turning.cross(&g)));
            }
        }
    }
}

/// Adds a charge's potential and its gradient (`side` 1 where the point is the target, −1 where it is the source) with their rates.
fn add(
    (potential, gradient): &mut ([f64; 2], [Vec3; 2]),
    [a, da]: [f64; 2],
    value: &[f64; 2],
    slope: &[Vec3; 2],
    [w, dw]: [f64; 2],
    side: f64,
) {
    let (still, rate) = (w * a, w * da + dw * a);
    potential[0] += still * value[0];
    potential[1] += still * value[1] + rate * value[0];
    gradient[0] += slope[0] * (side * still);
    gradient[1] += slope[1] * (side * still) + slope[0] * (side * rate);
}
