//! The reverse of [`Layer::new`]: what a film's thickness, its ends and its shift exert on the bodies.

use super::Film;
use super::jet::{Displaced, Jet, Screw, Vector, add, add_scaled, constant, cross, scale};
use super::jet::{whole, zero};
use super::layer::{BACK, Layer, NEAREST, OPENING, weight};
use crate::adjoint::lie::Vec6;
use crate::coupling::fade::opening_slope;

/// Cotangents of what the flow in a film takes from a [`Layer`].
pub(super) struct Cotangents<D> {
    /// Of the thickness of each cell, as it is and held apart.
    pub thickness: Vec<[D; 2]>,
    /// Of each cell's facing; none where the other side rests.
    pub facing: Vec<Vector<D>>,
    /// Of each active vertex' rim.
    pub rim: Vec<D>,
}

/// [`Layer::new`] in reverse at one pose, for as many cotangents as are asked. Wrenches are those on the first body, in the frame of the other.
pub(super) struct Reverse<D> {
    /// Of the gap's normal.
    normal: [Screw<D>; 3],
    /// Of the shifts, in the frame of each.
    shift: [[Screw<D>; 3]; 2],
}

/// What displacements of the first body do to each part of a layer: rows of its Jacobian, as wrenches in the frame of the other.
pub(super) struct Rates {
    /// Of the thickness of each cell, as it is and held apart.
    pub thickness: Vec<[Vec6; 2]>,
    /// Of each cell's facing; none where the other side rests.
    pub facing: Vec<[Vec6; 3]>,
    /// Of each active vertex' rim.
    pub rim: Vec<Vec6>,
}

impl<D: Jet> Layer<D> {
    /// What the layer is made of, in reverse.
    pub fn reverse(&self, film: &Film, placed: &Displaced<D>) -> Reverse<D> {
        let (gap, mean) = self.gap_wrenches(film);
        let normal = match film.opposite.wall_normal() {
            Some(wall) => units().map(|unit| turn(&constant(wall), &placed.rotate(&unit))),
            None => mean,
        };
        let [wider, slope] = self.wider(film);
        let own: [Screw<D>; 3] = std::array::from_fn(|i| {
            let mut out = normal[i].map(|x| x * wider);
            add_scaled(&mut out, slope * self.gap.normal[i], &gap);
            out
        });
        // The other's shift is the own one in its frame.
        let other = units().map(|unit| {
            let mut out = turn(&self.shift[1], &unit);
            let back = placed.rotate_inverse(&unit);
            (0..3).for_each(|i| add_scaled(&mut out, back[i], &own[i]));
            out
        });
        Reverse {
            normal,
            shift: [own, other],
        }
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

    /// What its distance and where it faces do to the rim of an active vertex.
    fn rim_slopes(&self, film: &Film, number: usize) -> [D; 2] {
        let (surface, [start, end]) = (&*film.surface, film.rim);
        let (s, rim) = (self.active[number], self.rim[number]);
        let spot = &self.spots[s];
        let d = spot.distances[0].value;
        let [outside, behind] = self.outside(film, s).map(opening_slope);
        let strength = D::from(OPENING * surface.areas[spot.vertex]) / d;
        [
            strength * outside / (end - start) - rim / d,
            strength * behind / (BACK[1] - BACK[0]),
        ]
    }

    /// Wrenches of the gap, and of the mean normal where it isn't a wall's that counts.
    fn gap_wrenches(&self, film: &Film) -> (Screw<D>, [Screw<D>; 3]) {
        let (surface, [_, end]) = (&*film.surface, film.rim);
        let wall = film.opposite.wall_normal().is_some();
        let (mut gap, mut mean) = ([D::from(0.0); 6], [[D::from(0.0); 6]; 3]);
        for spot in &self.spots {
            let d = spot.distances[0].value;
            let area = surface.areas[spot.vertex];
            if let Some(weight) = weight(d, area, end, film.width.reach) {
                let weight = weight / self.gap.sum;
                let rate = weight * (d.recip() * -f64::from(NEAREST) - (-d + end).recip() * 3.0);
                let screw = at_point(&spot.point, &spot.distances[0].gradient);
                add_scaled(&mut gap, (d - self.gap.value) * rate + weight, &screw);
                if !wall {
                    let normal = &surface.normals[spot.vertex];
                    for (i, mean) in mean.iter_mut().enumerate() {
                        add_scaled(mean, (-self.gap.mean[i] + normal[i]) * rate, &screw);
                    }
                }
            }
        }
        (gap, mean)
    }
}

impl<D: Jet> Reverse<D> {
    /// The wrench of cotangents of the flow.
    pub fn pull(&self, film: &Film, layer: &Layer<D>, flow: &Cotangents<D>) -> Screw<D> {
        let mut bar = vec![[D::from(0.0); 2]; layer.spots.len()];
        for (c, cell) in layer.cells.iter().enumerate() {
            let turned = match flow.facing.get(c) {
                Some(bar) => cell.facing.pull(bar, &film.surface.faces[cell.face]),
                None => zero(),
            };
            let [near, held] = flow.thickness[c];
            for (k, s) in cell.spots.iter().enumerate() {
                bar[*s][0] += near * cell.thickness[0].slopes[k] + turned[k];
                bar[*s][1] += held * cell.thickness[1].slopes[k];
            }
        }
        let mut normal = zero();
        for (number, cotangent) in flow.rim.iter().enumerate() {
            // Within the film there is no rim.
            if layer.rim[number].re() != 0.0 {
                let s = layer.active[number];
                let slopes = layer.rim_slopes(film, number);
                bar[s][0] += *cotangent * slopes[0];
                let facing = constant(&film.surface.normals[layer.spots[s].vertex]);
                normal = add(&normal, &scale(*cotangent * slopes[1], &facing));
            }
        }
        let (mut force, mut torque, mut held) = (zero(), zero(), zero());
        for (spot, bar) in layer.spots.iter().zip(&bar) {
            let [near, apart] = [0, 1].map(|k| scale(bar[k], &spot.distances[k].gradient));
            let both = add(&near, &apart);
            force = add(&force, &both);
            torque = add(&torque, &cross(&spot.point, &both));
            held = add(&held, &apart);
        }
        let mut out = whole(&force, &torque);
        for i in 0..3 {
            add_scaled(&mut out, -held[i], &self.shift[1][i]);
            add_scaled(&mut out, normal[i], &self.normal[i]);
        }
        out
    }

    /// The wrench of a cotangent of the shift in the frame `at` (0: of the first).
    pub fn pull_shift(&self, at: usize, bar: &Vector<D>) -> Screw<D> {
        let mut out = [D::from(0.0); 6];
        (0..3).for_each(|i| add_scaled(&mut out, bar[i], &self.shift[at][i]));
        out
    }
}

impl Reverse<f64> {
    /// [`Reverse::pull`] for all cotangents: worth it where many are asked for.
    pub fn rates(&self, film: &Film, layer: &Layer<f64>) -> Rates {
        let screws: Vec<[Vec6; 2]> = (layer.spots.iter())
            .map(|spot| {
                let of = |which: usize| at_point(&spot.point, &spot.distances[which].gradient);
                let mut held = of(1);
                for (slope, shift) in spot.distances[1].gradient.iter().zip(&self.shift[1]) {
                    add_scaled(&mut held, -slope, shift);
                }
                [Vec6::from(of(0)), Vec6::from(held)]
            })
            .collect();
        let thickness = layer.cells.iter().map(|cell| {
            let of = |which: usize| {
                let slopes = cell.spots.iter().zip(cell.thickness[which].slopes);
                slopes.map(|(s, slope)| slope * screws[*s][which]).sum()
            };
            [of(0), of(1)]
        });
        let facing = layer.cells.iter().map(|cell| {
            let slopes = cell.facing.slopes(&film.surface.faces[cell.face]);
            let of = |i: usize| {
                let corners = cell.spots.iter().zip(&slopes);
                corners.map(|(s, slope)| slope[i] * screws[*s][0]).sum()
            };
            [of(0), of(1), of(2)]
        });
        let rim = layer.active.iter().enumerate().map(|(number, s)| {
            if layer.rim[number] == 0.0 {
                return Vec6::zeros();
            }
            let [near, behind] = layer.rim_slopes(film, number);
            let normal = &film.surface.normals[layer.spots[*s].vertex];
            let turned = normal.iter().zip(&self.normal);
            let turned: Vec6 = turned.map(|(n, w)| *n * Vec6::from(*w)).sum();
            near * screws[*s][0] + behind * turned
        });
        Rates {
            thickness: thickness.collect(),
            facing: match film.faces_wall() {
                true => Vec::new(),
                false => facing.collect(),
            },
            rim: rim.collect(),
        }
    }
}

fn units<D: Jet>() -> [Vector<D>; 3] {
    [0, 1, 2].map(|k| std::array::from_fn(|i| D::from(if i == k { 1.0 } else { 0.0 })))
}

/// A force at a point.
fn at_point<D: Jet>(at: &Vector<D>, force: &Vector<D>) -> Screw<D> {
    whole(force, &cross(at, force))
}

/// What a direction feels that turns with the first body.
fn turn<D: Jet>(direction: &Vector<D>, force: &Vector<D>) -> Screw<D> {
    whole(&zero(), &cross(direction, force))
}
