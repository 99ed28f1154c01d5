//! How an extrapolated added mass changes with the vertices of both meshes: exactly, as it is computed.
//!
//! With F = 1/(ρᵖ − 1), ρ the ratio of the edges √(A/faces), which move with the areas A unless it is given, and p fixed,
//!
//! ```text
//! ∂M = (1 + F) ∂M_fine − F ∂M_coarse + (M_fine − M_coarse) ∂F,   ∂F = −p ρ^(p−1) F² ∂ρ,   ∂ρ = ½ ρ (∂A_coarse/A_coarse − ∂A_fine/A_fine)
//! ```
//!
//! Where energies are cut off at `least`, X = V diag(x) Vᵀ ↦ V diag(max(x, least)) Vᵀ has the derivative of a function of a symmetric matrix,
//! `V (D ∘ Vᵀ ∂X V) Vᵀ` with the divided differences D of the function, and the units of X move with the volume.
//!
//! # References
//! R. Bhatia, Matrix Analysis (1997), Theorem V.3.3 (Daleckii and Krein).

use super::richardson::{Richardson, displaced};
use super::{MassSlopes, PanelBoundary};
use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3, Vec6};
use std::sync::Arc;

/// Difference of energies, in units of the largest, under which they are equal.
const EQUAL: f64 = 1e-9;

/// A mesh of the shape with the slopes of its added mass.
struct Side {
    body: Arc<PanelBoundary>,
    slopes: MassSlopes,
}

/// What one mesh does along a motion of its vertices.
struct Rates {
    mass: Mat6,
    /// Of area and volume, relative, 1/s.
    area: f64,
    volume: f64,
}

/// The derivatives of [`Richardson`].
pub struct RichardsonSlopes {
    fine: Side,
    coarse: Side,
    /// Whether the ratio doesn't follow from the areas.
    given: bool,
    /// Before energies are cut off.
    raw: Mat6,
    found: Richardson,
}

impl RichardsonSlopes {
    /// Of the extrapolation of two meshes, and the ratio of their edges where the numbers of faces don't tell it.
    ///
    /// # Errors
    /// Meshes that don't differ enough.
    pub fn new(
        fine: Arc<PanelBoundary>,
        coarse: Arc<PanelBoundary>,
        ratio: Option<f64>,
    ) -> Result<Self> {
        let found = Richardson::of(&fine, &coarse, ratio)?;
        let factor = 1.0 / (found.ratio.powf(found.order) - 1.0);
        let side = |body: Arc<PanelBoundary>| Side {
            slopes: body.added_mass_slopes(),
            body,
        };
        Ok(Self {
            raw: fine.added_mass + factor * (fine.added_mass - coarse.added_mass),
            given: ratio.is_some(),
            found,
            fine: side(fine),
            coarse: side(coarse),
        })
    }

    /// Rate of the extrapolated added mass of [`Extrapolated`](super::Extrapolated), unit density, body frame, while the vertices of both meshes move with these
    /// velocities (m/s, body frame): kg/s, kg·m/s, kg·m²/s.
    ///
    /// Panics unless there is one for each vertex.
    pub fn along(&self, fine: &[Vec3], coarse: &[Vec3]) -> Mat6 {
        let rates = [self.fine.along(fine), self.coarse.along(coarse)];
        let (rate, _) = self.extrapolated(&rates);
        let volume = self.fine.body.faces.volume();
        positive_rate((&self.raw, &rate), (volume, rates[0].volume), (0.0, 0.0))
    }

    /// The same of what bodies have whose coupling is extrapolated as well. Where a shape has several lowest energies that are equal, as a sphere's rotations have, the
    /// floor of energies has a kink unless all change alike, and the mean of their rates is taken.
    ///
    /// Panics as [`RichardsonSlopes::along`].
    pub fn coupled_along(&self, fine: &[Vec3], coarse: &[Vec3]) -> Mat6 {
        let rates = [self.fine.along(fine), self.coarse.along(coarse)];
        let (_, ratio_rate) = self.extrapolated(&rates);
        let rate = self.along(fine, coarse);
        let body = &self.coarse.body;
        let (volume, grown) = (body.faces.volume(), rates[1].volume);
        let (x, dx) = in_units((&body.added_mass, &rates[1].mass), (volume, grown));
        let eigen = x.symmetric_eigen();
        let least = eigen.eigenvalues.min();
        // Equal ones part as the shape changes: the mean of theirs.
        let among = |i: &usize| eigen.eigenvalues[*i] - least < EQUAL * eigen.eigenvalues.amax();
        let lowest: Vec<usize> = (0..6).filter(among).collect();
        let slope = |i: &usize| {
            let vector = eigen.eigenvectors.column(*i);
            vector.dot(&(dx * vector)) / lowest.len() as f64
        };
        let square = self.found.ratio * self.found.ratio - 1.0;
        let room = least.max(0.0) / square;
        let moved = match least > 0.0 {
            true => lowest.iter().map(slope).sum::<f64>() / square,
            false => 0.0,
        };
        let narrowed = 2.0 * self.found.ratio * ratio_rate * room / square;
        positive_rate(
            (&self.found.added_mass, &rate),
            (volume, grown),
            (room, moved - narrowed),
        )
    }

    /// Rate of the ratio of the edges along the same: 1/s, zero where it is given.
    ///
    /// Panics as [`RichardsonSlopes::along`].
    pub fn ratio_along(&self, fine: &[Vec3], coarse: &[Vec3]) -> f64 {
        let rates = [self.fine.along(fine), self.coarse.along(coarse)];
        self.extrapolated(&rates).1
    }

    /// Rates of the extrapolated added mass before energies are cut off, and of the ratio.
    fn extrapolated(&self, [fine, coarse]: &[Rates; 2]) -> (Mat6, f64) {
        let Richardson { ratio, order, .. } = self.found;
        let factor = 1.0 / (ratio.powf(order) - 1.0);
        let ratio_rate = match self.given {
            true => 0.0,
            false => 0.5 * ratio * (coarse.area - fine.area),
        };
        let factor_rate = -order * ratio.powf(order - 1.0) * factor * factor * ratio_rate;
        let step = self.fine.body.added_mass - self.coarse.body.added_mass;
        let rate = fine.mass + factor * (fine.mass - coarse.mass) + factor_rate * step;
        (rate, ratio_rate)
    }
}

impl Side {
    fn along(&self, velocities: &[Vec3]) -> Rates {
        let (faces, corners) = (&self.body.faces, self.body.panels().corners());
        let of = |i: usize, k: usize| velocities[corners[i][k] as usize];
        Rates {
            mass: self.slopes.along(velocities),
            area: faces.area_rate(of) / faces.area(),
            volume: faces.volume_rate(of) / faces.volume(),
        }
    }
}

/// A matrix in the units of the water displaced, and its rate; `grown` the relative one of the volume.
fn in_units((m, dm): (&Mat6, &Mat6), (volume, grown): (f64, f64)) -> (Mat6, Mat6) {
    let units = displaced(volume);
    let x = m.component_div(&units);
    (x, dm.component_div(&units) - grown * powers(&x))
}

/// Entries times the powers of the volume in their units.
fn powers(x: &Mat6) -> Mat6 {
    let power = |i: usize| if i < 3 { 0.5 } else { 5.0 / 6.0 };
    Mat6::from_fn(|i, j| (power(i) + power(j)) * x[(i, j)])
}

/// Tangent of the nearest added mass without energies under `least`, from values with their rates.
fn positive_rate(m: (&Mat6, &Mat6), volume: (f64, f64), (least, least_rate): (f64, f64)) -> Mat6 {
    let (x, dx) = in_units(m, volume);
    let eigen = x.symmetric_eigen();
    let (values, vectors) = (&eigen.eigenvalues, &eigen.eigenvectors);
    if values.min() >= least {
        return *m.1;
    }
    let cut: Vec6 = values.map(|x| x.max(least));
    let kept = |i: usize| f64::from(values[i] > least);
    let turned = vectors.transpose() * dx * vectors;
    let inner = Mat6::from_fn(|i, j| {
        let apart = values[i] - values[j];
        let divided = match apart.abs() > f64::EPSILON * values.amax() {
            true => (cut[i] - cut[j]) / apart,
            false => kept(i),
        };
        let raised = f64::from(i == j) * (1.0 - kept(i)) * least_rate;
        divided * turned[(i, j)] + raised
    });
    let y = vectors * Mat6::from_diagonal(&cut) * vectors.transpose();
    let dy = vectors * inner * vectors.transpose();
    (dy + volume.1 * powers(&y)).component_mul(&displaced(volume.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adjoint::sample::Samples;
    use crate::geometry::TriMesh;

    /// An octahedron, split so often and blown up to an ellipsoid.
    fn ellipsoid(semi_axes: &Vec3, splits: usize) -> TriMesh {
        let mut triangles: Vec<[Vec3; 3]> = Vec::new();
        for n in 0..8 {
            let sign = |bit: i32| if n >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let [x, y, z] = [0, 1, 2].map(|c| sign(c as i32) * Vec3::ith(c, 1.0));
            let outward = sign(0) * sign(1) * sign(2) > 0.0;
            triangles.push(if outward { [x, y, z] } else { [x, z, y] });
        }
        for _ in 0..splits {
            let split = |[a, b, c]: &[Vec3; 3]| {
                let [d, e, f] = [b + c, c + a, a + b].map(|v| v.normalize());
                [[*a, f, e], [f, *b, d], [e, d, *c], [d, e, f]]
            };
            triangles = triangles.iter().flat_map(split).collect();
        }
        let mut vertices: Vec<Vec3> = Vec::new();
        let mut number = |v: &Vec3| {
            let found = vertices.iter().position(|w| (v - w).norm() < 1e-9);
            found.unwrap_or_else(|| {
                vertices.push(*v);
                vertices.len() - 1
            })
        };
        let faces = triangles.iter().map(|t| [0, 1, 2].map(|k| number(&t[k])));
        let faces = faces.collect();
        let vertices = vertices.iter().map(|v| v.component_mul(semi_axes));
        TriMesh::new("ellipsoid", vertices.collect(), faces).unwrap()
    }

    /// Energies of rotations about axes of revolution are cut off.
    #[test]
    fn slopes_of_coupled_added_masses() {
        let cases = [
            (Vec3::new(0.6, 0.3, 0.4), Some(2.0)),
            (Vec3::new(0.6, 0.3, 0.3), None),
            (Vec3::new(0.5, 0.5, 0.5), None),
        ];
        let mut cut = 0;
        for (semi_axes, ratio) in cases {
            let meshes = [2, 1].map(|splits| ellipsoid(&semi_axes, splits));
            // A sphere grows: its energies stay equal.
            let round = semi_axes.max() - semi_axes.min() == 0.0;
            let fields = [0, 1].map(|k| -> Vec<Vec3> {
                let mut samples = Samples::new(7 + k as u64);
                let each = meshes[k].vertices().iter();
                each.map(|x| match round {
                    true => *x,
                    false => 0.02 * Vec3::from(samples.array()),
                })
                .collect()
            });
            let at = |h: f64| {
                [0, 1].map(|k| {
                    let pairs = meshes[k].vertices().iter().zip(&fields[k]);
                    let vertices = pairs.map(|(x, v)| x + h * v).collect();
                    let mesh = TriMesh::new("moved", vertices, meshes[k].faces().to_vec());
                    PanelBoundary::new("b", &mesh.unwrap()).unwrap()
                })
            };
            let mut value = |h: f64| {
                let [fine, coarse] = at(h);
                let found = Richardson::of(&fine, &coarse, ratio).unwrap();
                let coupled = found.coupled(&coarse);
                cut += usize::from(coupled != found.added_mass);
                coupled
            };
            let difference = (value(1e-4) - value(-1e-4)) / 2e-4;
            let [fine, coarse] = at(0.0).map(Arc::new);
            let slopes = RichardsonSlopes::new(fine, coarse, ratio).unwrap();
            let found = slopes.coupled_along(&fields[0], &fields[1]);
            let error = (found - difference).amax() / difference.amax();
            assert!(error < 1e-7, "{semi_axes:?}: {error:e}");
        }
        assert!(cut > 0, "no energy is cut off");
    }
}
