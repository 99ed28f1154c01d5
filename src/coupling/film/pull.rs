//! The reverse of [`Layer::new`]: what a film's thickness, its ends and its shift exert on the bodies.

use super::Film;
use super::jet::{Displaced, Jet, Screw, Vector, add, constant, cross, dot, minus, product, whole};
use super::jet::{scale, zero};
use super::layer::{
    BACK, Layer, NEAREST, OPENING, ends, facing_slope, opening_slope, thickness_slope, weight,
};

/// Cotangents of what the flow in a film takes from a [`Layer`].
pub(super) struct Cotangents<D> {
    /// Of the thickness of each cell, as it is and held apart.
    pub thickness: Vec<[D; 2]>,
    /// Of each cell's facing.
    pub facing: Vec<Vector<D>>,
    /// Of each active vertex' rim.
    pub rim: Vec<D>,
}

/// Cotangents within a layer.
struct Inner<D> {
    /// Of the distances at each spot.
    distances: Vec<[D; 2]>,
    /// Of the gap's normal.
    normal: Vector<D>,
}

impl<D: Jet> Layer<D> {
    /// The wrench on the first body, in the frame of the other, of cotangents of the flow and of the shifts.
    pub fn pull_back(
        &self,
        film: &Film,
        placed: &Displaced<D>,
        flow: Option<&Cotangents<D>>,
        shift: [Vector<D>; 2],
    ) -> Screw<D> {
        let mut bar = Inner {
            distances: vec![[D::from(0.0); 2]; self.spots.len()],
            normal: zero(),
        };
        if let Some(flow) = flow {
            self.pull_cells(film, flow, &mut bar);
            self.pull_rim(film, flow, &mut bar);
        }
        let (mut force, mut torque) = (zero(), zero());
        let mut push = |at: &Vector<D>, f: &Vector<D>| {
            force = add(&force, f);
            torque = add(&torque, &cross(at, f));
        };
        let [mut own, mut other] = shift;
        for (spot, bar) in self.spots.iter().zip(&bar.distances) {
            if bar[1].re() != 0.0 || bar[1].rate() != 0.0 {
                let f = scale(bar[1], &spot.distances[1].gradient);
                push(&spot.point, &f);
                other = add(&other, &minus(&f));
            }
        }
        // The other's shift is the own one in its frame.
        let mut turn = cross(&self.shift[1], &other);
        own = add(&own, &placed.rotate_inverse(&other));
        bar.normal = add(&bar.normal, &scale(self.wider(film)[0], &own));
        let gap = product(&own, &self.gap.normal) * self.wider(film)[1];
        let mut mean = zero();
        match film.opposite.wall_normal() {
            Some(wall) => {
                let there = placed.rotate(&bar.normal);
                turn = add(&turn, &cross(&constant(wall), &there));
            }
            None => mean = bar.normal,
        }
        self.pull_gap(film, gap, &mean, &mut bar);
        for (spot, bar) in self.spots.iter().zip(&bar.distances) {
            push(&spot.point, &scale(bar[0], &spot.distances[0].gradient));
        }
        whole(&force, &add(&torque, &turn))
    }

    /// How far the two are held apart, and its derivative by the gap.
    fn wider(&self, film: &Film) -> [D; 2] {
        let width = &film.width;
        let left = -self.gap.value / width.reach + 1.0;
        [
            left.powi(3) * width.floor,
            left.powi(2) * (-3.0 * width.floor / width.reach),
        ]
    }

    fn pull_cells(&self, film: &Film, flow: &Cotangents<D>, bar: &mut Inner<D>) {
        for (c, cell) in self.cells.iter().enumerate() {
            let face = &film.surface.faces[cell.face];
            let heights = self.heights(&cell.spots);
            for (which, d) in heights.iter().enumerate() {
                let slopes = thickness_slope(d, face);
                let strength = flow.thickness[c][which];
                for (s, slope) in cell.spots.iter().zip(slopes) {
                    bar.distances[*s][which] += strength * slope;
                }
            }
            let slopes = facing_slope(&heights[0], face, &flow.facing[c]);
            for (s, slope) in cell.spots.iter().zip(slopes) {
                bar.distances[*s][0] += slope;
            }
        }
    }

    fn pull_rim(&self, film: &Film, flow: &Cotangents<D>, bar: &mut Inner<D>) {
        let surface = &*film.surface;
        let [start, end] = ends(surface);
        for ((s, rim), cotangent) in self.active.iter().zip(&self.rim).zip(&flow.rim) {
            let spot = &self.spots[*s];
            let d = spot.distances[0].value;
            let [outside, behind] = self.outside(surface, *s).map(opening_slope);
            let strength = *cotangent * (OPENING * surface.areas[spot.vertex]) / d;
            bar.distances[*s][0] += strength * outside / (end - start) - *cotangent * rim / d;
            let normal = &surface.normals[spot.vertex];
            let turned = strength * behind / (BACK[1] - BACK[0]);
            (0..3).for_each(|i| bar.normal[i] += turned * normal[i]);
        }
    }

    fn pull_gap(&self, film: &Film, gap: D, mean: &Vector<D>, bar: &mut Inner<D>) {
        let surface = &*film.surface;
        let [_, end] = ends(surface);
        let about = gap * self.gap.value + product(mean, &self.gap.mean);
        for (spot, bar) in self.spots.iter().zip(&mut bar.distances) {
            let d = spot.distances[0].value;
            let area = surface.areas[spot.vertex];
            if let Some(weight) = weight(d, area, end, film.width.reach) {
                let weight = weight / self.gap.sum;
                let rate = weight * (d.recip() * -f64::from(NEAREST) - (-d + end).recip() * 3.0);
                let worth = gap * d + dot(mean, &surface.normals[spot.vertex]) - about;
                bar[0] += worth * rate + gap * weight;
            }
        }
    }
}
