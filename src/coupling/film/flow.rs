//! The flow in a film at given poses: its potential, its momentum, and what thickness, rim and facing are to its energy.

use super::Film;
use super::jet::{Displaced, Jet, Screw, Vector, add, constant, cross, cross_force, dot, parts};
use super::jet::{product, screw, whole, zero};
use super::layer::{Cell, Layer};
use super::pull::{Cotangents, Reverse};
use super::surface::Element;
use crate::adjoint::lie::{Vec6, point_wrench};
use crate::solver::{SparseCholesky, SparsePattern};
use faer::MatMut;
use nalgebra::{DMatrix, SMatrix};
use std::sync::{Arc, PoisonError};

/// Components of the twists of both sides, frame of the first.
pub(super) const TWISTS: usize = 12;

/// A film's potential for unit twists.
pub(super) struct Solved {
    factor: SparseCholesky,
    /// Active vertices × [`TWISTS`].
    pub potential: DMatrix<f64>,
}

/// The flow for twists of both sides.
pub(super) struct Flow<D> {
    /// Of the other in its own frame.
    other: Vec6,
    /// Of the first, and of the other in the frame of the first.
    twists: [Screw<D>; 2],
    /// At the active vertices, as the film is and held apart.
    potential: [Vec<D>; 2],
    /// Their difference.
    apart: Vec<D>,
    /// Of both sides in the frame of the first, as the film is less that held apart.
    pub impulses: [Screw<D>; 2],
    /// What the other's twist pushes in at the corners of each cell, per area of a corner's share and facing.
    speeds: Vec<[Vector<D>; 3]>,
}

impl Film {
    /// Where the system has entries: that of a layer with potentials at the same vertices, if that was the last one.
    fn pattern(&self, layer: &Layer<f64>) -> Option<Arc<SparsePattern>> {
        let active: Vec<usize> = (layer.active.iter())
            .map(|spot| layer.spots[*spot].vertex)
            .collect();
        let mut last = self.pattern.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((at, pattern)) = &*last
            && *at == active
        {
            return Some(pattern.clone());
        }
        let mut entries: Vec<_> = (0..active.len()).map(|v| (v, v)).collect();
        for cell in &layer.cells {
            lower(cell, |a, b, _| entries.push((a, b)));
        }
        let pattern = Arc::new(SparsePattern::new(active.len(), &entries)?);
        *last = Some((active, pattern.clone()));
        Some(pattern)
    }

    /// div(H ∇ψ) = −flux with the thickness as it is, and held apart.
    pub(super) fn solve(&self, layer: &Layer<f64>, loads: &DMatrix<f64>) -> Option<[Solved; 2]> {
        let (n, pattern) = (layer.active.len(), self.pattern(layer)?);
        let of = |which: usize| {
            let mut values = layer.rim.clone();
            for cell in &layer.cells {
                let element = &self.surface.faces[cell.face];
                let strength = element.area * cell.thickness[which];
                lower(cell, |_, _, at| values.push(strength * element.slopes[at]));
            }
            let factor = pattern.factor(&values)?;
            let mut potential = loads.clone();
            let all = MatMut::from_column_major_slice_mut(potential.as_mut_slice(), n, TWISTS);
            factor.solve(all);
            Some(Solved { factor, potential })
        };
        Some([of(0)?, of(1)?])
    }

    /// What unit twists push at the active vertices: ∫ φ (n, x × n) dA over each side.
    pub(super) fn loads(&self, layer: &Layer<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(layer.active.len(), TWISTS);
        for (v, spot) in layer.active.iter().enumerate() {
            let own = self.surface.loads[layer.spots[*spot].vertex].transpose();
            out.fixed_view_mut::<1, 6>(v, 0).copy_from(&own);
        }
        for cell in &layer.cells {
            let element = &self.surface.faces[cell.face];
            let push = element.area / 3.0 * nalgebra::Vector3::from(cell.facing);
            for (at, arm) in cell.corners.iter().zip(&element.arms) {
                if let Some(at) = at {
                    let mut row = out.fixed_view_mut::<1, 6>(*at, 6);
                    row += point_wrench(arm, &push).transpose();
                }
            }
        }
        out
    }

    /// The flow for body-frame twists, with its rate along the layer's displacement.
    pub(super) fn flow<D: Jet>(
        &self,
        layer: &Layer<D>,
        placed: &Displaced<D>,
        solved: &[Solved; 2],
        [own, other]: [&Vec6; 2],
    ) -> Flow<D> {
        let twists = [screw(own), placed.twist_to_body(other)];
        let values = SMatrix::<f64, TWISTS, 1>::from_fn(|i, _| twists[i / 6][i % 6].re());
        let (u, w) = parts(&twists[1]);
        let speed = |arm| add(&u, &cross(&w, &constant(arm)));
        let faces = layer.cells.iter().map(|c| &self.surface.faces[c.face]);
        let speeds = faces.map(|f: &Element| [0, 1, 2].map(|i| speed(&f.arms[i])));
        let mut out = Flow {
            other: *other,
            twists,
            apart: Vec::new(),
            impulses: [[D::from(0.0); 6]; 2],
            speeds: speeds.collect(),
            potential: [0, 1].map(|k| {
                let potential = &solved[k].potential * values;
                potential.iter().map(|x| D::from(*x)).collect()
            }),
        };
        // A potential that doesn't move has no rate to be found.
        let moving = if D::MOVES { &solved[..] } else { &[] };
        for (which, solved) in moving.iter().enumerate() {
            let left = self.residual(layer, &out, which);
            let mut rates: Vec<f64> = left.iter().map(Jet::rate).collect();
            let n = rates.len();
            (solved.factor).solve(MatMut::from_column_major_slice_mut(&mut rates, n, 1));
            for (psi, rate) in out.potential[which].iter_mut().zip(rates) {
                *psi = D::moving(psi.re(), rate);
            }
        }
        let [near, apart] = &out.potential;
        out.apart = near.iter().zip(apart).map(|(a, b)| *a - *b).collect();
        out.impulses = self.impulses(layer, &out.apart);
        out
    }

    /// b − A ψ.
    fn residual<D: Jet>(&self, layer: &Layer<D>, flow: &Flow<D>, which: usize) -> Vec<D> {
        let psi = &flow.potential[which];
        let of_rim = layer.rim.iter().zip(psi).map(|(rim, psi)| -*rim * *psi);
        let mut out: Vec<D> = of_rim.collect();
        for (out, spot) in out.iter_mut().zip(&layer.active) {
            let load = &self.surface.loads[layer.spots[*spot].vertex];
            *out += pushed(load, &flow.twists[0]);
        }
        for (cell, speeds) in layer.cells.iter().zip(&flow.speeds) {
            let element = &self.surface.faces[cell.face];
            let slope = slope_of(cell, element, psi);
            for (i, at) in cell.corners.iter().enumerate() {
                if let Some(at) = at {
                    let led = dot(&slope, &element.gradients.column(i).into_owned());
                    let push = product(&cell.facing, &speeds[i]) / 3.0;
                    out[*at] += (push - cell.thickness[which] * led) * element.area;
                }
            }
        }
        out
    }

    /// `bᵀψ` as the film is less that held apart: the impulses of both sides in the frame of the first.
    fn impulses<D: Jet>(&self, layer: &Layer<D>, psi: &[D]) -> [Screw<D>; 2] {
        let mut own = [D::from(0.0); 6];
        for (psi, spot) in psi.iter().zip(&layer.active) {
            let load = &self.surface.loads[layer.spots[*spot].vertex];
            (0..6).for_each(|i| own[i] += *psi * load[i]);
        }
        let (mut force, mut torque) = (zero(), zero());
        for cell in &layer.cells {
            let element = &self.surface.faces[cell.face];
            for (at, arm) in cell.corners.iter().zip(&element.arms) {
                if let Some(at) = at {
                    let push = cell.facing.map(|n| n * psi[*at] * (element.area / 3.0));
                    force = add(&force, &push);
                    torque = add(&torque, &cross(&constant(arm), &push));
                }
            }
        }
        [own, whole(&force, &torque)]
    }

    /// Cotangents of `xᵀ K y`, as the film is less that held apart: −ψ_xᵀ δA ψ_y + ψ_xᵀ δb y + xᵀ δbᵀ ψ_y.
    pub(super) fn cotangents<D: Jet>(
        &self,
        layer: &Layer<D>,
        x: &Flow<D>,
        y: &Flow<D>,
    ) -> Cotangents<D> {
        let mut out = Cotangents {
            thickness: Vec::with_capacity(layer.cells.len()),
            facing: Vec::with_capacity(layer.cells.len()),
            rim: Vec::with_capacity(layer.rim.len()),
        };
        for (c, cell) in layer.cells.iter().enumerate() {
            let element = &self.surface.faces[cell.face];
            out.thickness.push([0, 1].map(|which| {
                let slope = |flow: &Flow<D>| slope_of(cell, element, &flow.potential[which]);
                product(&slope(x), &slope(y)) * (SIGNS[which] * -element.area)
            }));
            let mut facing = zero();
            for (i, at) in cell.corners.iter().enumerate() {
                if let Some(at) = at {
                    for (flow, other) in [(x, y), (y, x)] {
                        let share = flow.apart[*at] * (element.area / 3.0);
                        (0..3).for_each(|k| facing[k] += share * other.speeds[c][i][k]);
                    }
                }
            }
            out.facing.push(facing);
        }
        out.rim = (0..layer.rim.len())
            .map(|v| {
                let of = |which: usize| x.potential[which][v] * y.potential[which][v];
                of(1) - of(0)
            })
            .collect();
        out
    }

    /// The wrench on the first body, frame of the other, that the energy `xᵀ K y` exerts by way of the layer, and by the other's twists in the frame of the first.
    pub(super) fn wrench<D: Jet>(
        &self,
        (layer, reverse): (&Layer<D>, &Reverse<D>),
        placed: &Displaced<D>,
        x: &Flow<D>,
        y: &Flow<D>,
    ) -> Screw<D> {
        let mut out = reverse.pull(self, layer, &self.cotangents(layer, x, y));
        for (flow, answer) in [(x, y), (y, x)] {
            let impulse = placed.wrench_to_world(&answer.impulses[1]);
            let turned = cross_force(&screw(&flow.other), &impulse);
            (0..6).for_each(|k| out[k] -= turned[k]);
        }
        out
    }
}

/// The entries that a cell has on the diagonal and below, with the corners that they belong to.
fn lower<D>(cell: &Cell<D>, mut entry: impl FnMut(usize, usize, (usize, usize))) {
    for (i, a) in cell.corners.iter().enumerate() {
        for (j, b) in cell.corners.iter().enumerate() {
            if let (Some(a), Some(b)) = (a, b)
                && a >= b
            {
                entry(*a, *b, (i, j));
            }
        }
    }
}

/// Of the film as it is, and held apart.
const SIGNS: [f64; 2] = [1.0, -1.0];

fn pushed<D: Jet>(load: &Vec6, twist: &Screw<D>) -> D {
    (0..6).map(|i| twist[i] * load[i]).sum()
}

/// ∇ψ on a face.
fn slope_of<D: Jet>(cell: &Cell<D>, element: &Element, psi: &[D]) -> Vector<D> {
    let mut out = zero();
    for (k, at) in cell.corners.iter().enumerate() {
        if let Some(at) = at {
            (0..3).for_each(|i| out[i] += psi[*at] * element.gradients[(i, k)]);
        }
    }
    out
}
