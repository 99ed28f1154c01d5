//! The water in a film, place by place: what it adds to the flow that bodies held apart have.
//!
//! As all energies of films are those of the film as it is less that held apart, so is its potential ψ, with the velocity −∇ψ along the gap. Beside a velocity u of bodies held apart, along the
//! surface, Bernoulli's law has at a place of the surface that the potential is solved on, which moves at V, at unit density
//!
//! ```text
//! ψ' − V·∇ψ − ½ |∇ψ|² + u·∇ψ          ' at a point that goes with the surface
//! ```
//!
//! more. Across the film the pressure is the same: the other side has it where the arc that meets both surfaces at right angles ends. Both arms of a wedge of the angle β are as long, so that from
//! the foot of a place at the distance d the arc ends d tan(β/2) farther out.

use super::Side;
use super::flow::slopes_of;
use super::jet::dot;
use super::layer::Cell;
use super::placed::{MovingFilm, PlacedFilm, Twists};
use crate::adjoint::lie::{Vec3, point_velocity};
use nalgebra::DVector;
use num_dual::Dual64;

/// Into how many parts the side of a face is cut: places there fall on faces of other meshes.
const PARTS: usize = 4;
/// Least sum of one and the cosine of the angle at which the sides of a film stand, taken for any less: a film ends at its back.
const LEAST: f64 = 0.3;

/// A small part of a film.
pub(crate) struct Patch {
    /// Where it is on the surface that its potential is solved on, in the frame of the body, m.
    pub own: Vec3,
    /// Opposite, in the frame of what is there, m.
    pub other: Vec3,
    /// m².
    pub area: f64,
    /// ψ, m²/s.
    pub potential: f64,
    /// ∇ψ in the frames of both, m/s.
    pub slopes: [Vec3; 2],
    /// ψ' − V·∇ψ − ½ |∇ψ|², m²/s²; without ψ' where rates weren't given.
    pub pressure: f64,
}

/// A film's two sides, with what is between them.
pub(crate) struct Beside {
    /// The body that its potential is solved on.
    pub own: usize,
    /// The body opposite; none at a wall.
    pub other: Option<usize>,
    /// What there is of it.
    pub patches: Vec<Patch>,
}

/// The potential and its rate at the vertices that have one, as the film is and held apart.
struct Potentials {
    value: Vec<[f64; 2]>,
    rate: Vec<[f64; 2]>,
}

impl PlacedFilm {
    /// For body-frame twists, 6·bodies, and their rates; where those aren't given nothing has any.
    fn water(
        &self,
        twists: &DVector<f64>,
        rates: Option<&DVector<f64>>,
        moving: &MovingFilm,
    ) -> Beside {
        let x = self.twists(twists);
        let potentials = self.potentials(&x, twists, rates, moving);
        let cells = self.layer.cells.iter();
        Beside {
            own: self.film.body,
            other: match self.film.other {
                Side::Body(b) => Some(b),
                Side::Wall(_) => None,
            },
            patches: cells
                .flat_map(|cell| self.patches(cell, &x, &potentials))
                .collect(),
        }
    }

    fn potentials(
        &self,
        x: &Twists,
        twists: &DVector<f64>,
        rates: Option<&DVector<f64>>,
        moving: &MovingFilm,
    ) -> Potentials {
        let value = self.potential(x).into_owned();
        let Some(rates) = rates else {
            return Potentials {
                rate: vec![[0.0; 2]; value.len()],
                value,
            };
        };
        // Of twists that gain, and of places that change.
        let mut rate = self.potential(&self.twists(rates)).into_owned();
        for (rate, psi) in rate.iter_mut().zip(moving.potential(twists)) {
            (0..2).for_each(|k| rate[k] += psi[k].eps);
        }
        Potentials { value, rate }
    }

    fn patches(&self, cell: &Cell<f64>, x: &Twists, potentials: &Potentials) -> Vec<Patch> {
        let surface = &self.film.surface;
        let element = &surface.faces[cell.face];
        let corners = element.corners.map(|v| surface.vertices[v]);
        let ends = cell.spots.map(|s| self.end(s, &element.normal));
        let [near, held] = slopes_of(cell, element, &potentials.value).map(Vec3::from);
        let slope = near - held;
        let slopes = [slope, self.relative.rotation * slope];
        let at = |values: &[[f64; 2]]| {
            let apart = |c: usize| values[c][0] - values[c][1];
            Vec3::from(cell.corners.map(|c| c.map_or(0.0, apart)))
        };
        let (values, rates) = (at(&potentials.value), at(&potentials.rate));
        let area = element.area / (PARTS * PARTS) as f64;
        let patch = |shares: Vec3| {
            let own = mixed(&corners, &shares);
            let moves = point_velocity(&x.own, &own);
            Patch {
                own,
                other: mixed(&ends, &shares),
                area,
                potential: shares.dot(&values),
                slopes,
                pressure: shares.dot(&rates) - slope.dot(&moves) - 0.5 * slope.norm_squared(),
            }
        };
        parts().map(patch).collect()
    }

    /// Where the arc from a vertex, of a face with this normal, ends, in the frame of what is opposite.
    fn end(&self, spot: usize, normal: &Vec3) -> Vec3 {
        let spot = &self.layer.spots[spot];
        let distance = &spot.distances[0];
        let across = Vec3::from(distance.gradient);
        let normal = self.relative.rotation * normal;
        let cosine = -dot(&distance.gradient, &normal);
        let out = (normal + cosine * across) / (1.0 + cosine).max(LEAST);
        Vec3::from(spot.point) + distance.value * (out - across)
    }
}

impl MovingFilm<'_> {
    /// The water in it for body-frame twists (6·bodies), and as they gain `rates` and the bodies are displaced.
    pub(super) fn water(&self, twists: &DVector<f64>, rates: Option<&DVector<f64>>) -> Beside {
        self.placed.water(twists, rates, self)
    }

    /// The potential of twists that stay as they are, with its rates.
    fn potential(&self, twists: &DVector<f64>) -> Vec<[Dual64; 2]> {
        self.flow(twists).0.potential
    }
}

/// What the corners have, in these shares.
fn mixed(corners: &[Vec3; 3], shares: &Vec3) -> Vec3 {
    let each = corners.iter().zip(shares.iter());
    each.map(|(corner, share)| corner * *share).sum()
}

/// The middles of all parts of a triangle, in shares of its corners.
fn parts() -> impl Iterator<Item = Vec3> {
    let n = PARTS as f64;
    let rows = (0..PARTS).flat_map(|i| (0..PARTS - i).map(move |j| (i, j)));
    rows.flat_map(move |(i, j)| {
        let share = |third: f64| {
            let (a, b) = ((i as f64 + third) / n, (j as f64 + third) / n);
            Vec3::new(a, b, 1.0 - a - b)
        };
        // One that points as the triangle does, and, but at its end, one that points back.
        let back = (i + j + 1 < PARTS).then(|| share(2.0 / 3.0));
        std::iter::once(share(1.0 / 3.0)).chain(back)
    })
}

#[cfg(test)]
mod tests {
    use super::{PARTS, parts};
    use crate::adjoint::lie::Vec3;

    #[test]
    fn a_triangle_is_the_sum_of_its_parts() {
        let all: Vec<Vec3> = parts().collect();
        assert_eq!(all.len(), PARTS * PARTS);
        let mean = all.iter().sum::<Vec3>() / all.len() as f64;
        assert!((mean - Vec3::repeat(1.0 / 3.0)).norm() < 1e-14);
        assert!(all.iter().all(|x| x.iter().all(|x| *x > 0.0)));
    }
}
