//! The reverse of [`Layer::new`]: what a film's thickness, its ends and its shift exert on the bodies.

use super::Film;
use super::jet::{Displaced, Jet, Screw, Vector, add, add_scaled, constant, cross};
use super::jet::{product, scale, whole, zero};
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

/// [`Layer::new`] in reverse at one pose, for as many cotangents as are asked. Wrenches are those on the first body, in the frame of the other.
pub(super) struct Reverse<D> {
    /// Wrenches of the distances at each spot, as it is and held apart.
    spots: Vec<[Screw<D>; 2]>,
    /// Of the gap's normal.
    normal: [Screw<D>; 3],
    /// Of the shifts, in the frame of each.
    shift: [[Screw<D>; 3]; 2],
    cells: Vec<CellSlopes<D>>,
    /// Of each active vertex, what its distance and where it faces do to its rim.
    rim: Vec<[D; 2]>,
}

/// What the distances at the corners of a cell do.
struct CellSlopes<D> {
    /// To its thickness, as it is and held apart.
    thickness: [[D; 3]; 2],
    /// To its facing, corner by corner.
    facing: [Vector<D>; 3],
}

impl<D: Jet> Layer<D> {
    /// What the layer is made of, in reverse.
    pub fn reverse(&self, film: &Film, placed: &Displaced<D>) -> Reverse<D> {
        let near: Vec<Screw<D>> = (self.spots.iter())
            .map(|spot| at_point(&spot.point, &spot.distances[0].gradient))
            .collect();
        let [gap, mean] = self.gap_wrenches(film, &near);
        let normal = match film.opposite.wall_normal() {
            Some(wall) => units().map(|unit| turn(&constant(wall), &placed.rotate(&unit))),
            None => mean,
        };
        let [wider, slope] = self.wider(film);
        let own: [Screw<D>; 3] = std::array::from_fn(|i| {
            let mut out = normal[i].map(|x| x * wider);
            add_scaled(&mut out, slope * self.gap.normal[i], &gap[0]);
            out
        });
        // The other's shift is the own one in its frame.
        let other = units().map(|unit| {
            let mut out = turn(&self.shift[1], &unit);
            let back = placed.rotate_inverse(&unit);
            (0..3).for_each(|i| add_scaled(&mut out, back[i], &own[i]));
            out
        });
        let held = self.spots.iter().map(|spot| {
            let gradient = &spot.distances[1].gradient;
            let mut out = at_point(&spot.point, gradient);
            (0..3).for_each(|i| add_scaled(&mut out, -gradient[i], &other[i]));
            out
        });
        Reverse {
            spots: near.iter().zip(held).map(|(a, b)| [*a, b]).collect(),
            normal,
            shift: [own, other],
            cells: self.cell_slopes(film),
            rim: self.rim_slopes(film),
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

    fn cell_slopes(&self, film: &Film) -> Vec<CellSlopes<D>> {
        let one = |cell: &super::layer::Cell<D>| {
            let face = &film.surface.faces[cell.face];
            let heights = self.heights(&cell.spots);
            CellSlopes {
                thickness: [0, 1].map(|which| thickness_slope(&heights[which], face)),
                facing: facing_slope(&heights[0], face),
            }
        };
        self.cells.iter().map(one).collect()
    }

    fn rim_slopes(&self, film: &Film) -> Vec<[D; 2]> {
        let surface = &*film.surface;
        let [start, end] = ends(surface);
        (self.active.iter().zip(&self.rim))
            .map(|(s, rim)| {
                let spot = &self.spots[*s];
                let d = spot.distances[0].value;
                let [outside, behind] = self.outside(surface, *s).map(opening_slope);
                let strength = D::from(OPENING * surface.areas[spot.vertex]) / d;
                [
                    strength * outside / (end - start) - *rim / d,
                    strength * behind / (BACK[1] - BACK[0]),
                ]
            })
            .collect()
    }

    /// Wrenches of the gap (the first of the first) and of the mean normal.
    fn gap_wrenches(&self, film: &Film, near: &[Screw<D>]) -> [[Screw<D>; 3]; 2] {
        let surface = &*film.surface;
        let [_, end] = ends(surface);
        let mut gap = [[D::from(0.0); 6]; 3];
        let mut mean = gap;
        for (spot, screw) in self.spots.iter().zip(near) {
            let d = spot.distances[0].value;
            let area = surface.areas[spot.vertex];
            if let Some(weight) = weight(d, area, end, film.width.reach) {
                let weight = weight / self.gap.sum;
                let rate = weight * (d.recip() * -f64::from(NEAREST) - (-d + end).recip() * 3.0);
                add_scaled(&mut gap[0], (d - self.gap.value) * rate + weight, screw);
                let normal = &surface.normals[spot.vertex];
                for (i, mean) in mean.iter_mut().enumerate() {
                    add_scaled(mean, (-self.gap.mean[i] + normal[i]) * rate, screw);
                }
            }
        }
        [gap, mean]
    }
}

impl<D: Jet> Reverse<D> {
    /// The wrench of cotangents of the flow.
    pub fn pull(&self, film: &Film, layer: &Layer<D>, flow: &Cotangents<D>) -> Screw<D> {
        let mut bar = vec![[D::from(0.0); 2]; layer.spots.len()];
        let mut normal = zero();
        for (c, (cell, slopes)) in layer.cells.iter().zip(&self.cells).enumerate() {
            let [near, held] = flow.thickness[c];
            for (k, s) in cell.spots.iter().enumerate() {
                let turned = product(&flow.facing[c], &slopes.facing[k]);
                bar[*s][0] += near * slopes.thickness[0][k] + turned;
                bar[*s][1] += held * slopes.thickness[1][k];
            }
        }
        for ((s, slopes), cotangent) in layer.active.iter().zip(&self.rim).zip(&flow.rim) {
            bar[*s][0] += *cotangent * slopes[0];
            let facing = constant(&film.surface.normals[layer.spots[*s].vertex]);
            normal = add(&normal, &scale(*cotangent * slopes[1], &facing));
        }
        let mut out = [D::from(0.0); 6];
        for (screws, bar) in self.spots.iter().zip(&bar) {
            (0..2).for_each(|which| add_scaled(&mut out, bar[which], &screws[which]));
        }
        (0..3).for_each(|i| add_scaled(&mut out, normal[i], &self.normal[i]));
        out
    }

    /// The wrench of a cotangent of the shift in the frame `at` (0: of the first).
    pub fn pull_shift(&self, at: usize, bar: &Vector<D>) -> Screw<D> {
        let mut out = [D::from(0.0); 6];
        (0..3).for_each(|i| add_scaled(&mut out, bar[i], &self.shift[at][i]));
        out
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
