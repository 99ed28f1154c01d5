//! The flow in a film at given poses: its potential, its momentum, and what thickness, rim and facing are to its energy.

use super::jet::{Displaced, Jet, Screw, Vector, add, constant, cross, cross_force, dot, parts};
use super::jet::{product, scale, screw, whole, zero};
use super::layer::{Cell, Layer};
use super::pull::{Cotangents, Rates, Reverse};
use super::surface::Element;
use super::{Film, Side};
use crate::adjoint::lie::{Vec6, point_wrench};
use crate::solver::{SparseCholesky, SparsePattern};
use std::sync::{Arc, PoisonError};

/// What unit twists of both sides push, and the factors of what answers them.
pub(super) struct System {
    /// At the active vertices: ∫ φ (n, x × n) dA over each side.
    pub loads: Vec<[Vec6; 2]>,
    /// With the thickness as it is, and held apart.
    factor: SparseCholesky<2>,
}

impl System {
    /// div(H ∇ψ) = −flux for twists of both sides in the frame of the first.
    pub fn potential(&self, twists: &[Vec6; 2]) -> Vec<[f64; 2]> {
        let push = |load: &[Vec6; 2]| [load[0].dot(&twists[0]) + load[1].dot(&twists[1]); 2];
        let mut out: Vec<[f64; 2]> = self.loads.iter().map(push).collect();
        self.factor.solve(&mut out);
        out
    }

    /// The impulses of both sides, frame of the first, of a potential as the film is less that held apart.
    pub fn impulses(&self, apart: impl Iterator<Item = f64>) -> [Vec6; 2] {
        let mut out = [Vec6::zeros(); 2];
        for (psi, load) in apart.zip(&self.loads) {
            (0..2).for_each(|side| out[side] += psi * load[side]);
        }
        out
    }
}

/// The flow for twists of both sides.
pub(super) struct Flow<D> {
    /// Of the other in its own frame.
    other: Vec6,
    /// Of the first, and of the other in the frame of the first.
    twists: [Screw<D>; 2],
    /// At the active vertices, as the film is and held apart.
    pub potential: Vec<[D; 2]>,
    /// Their difference.
    apart: Vec<D>,
    /// Of both sides in the frame of the first, as the film is less that held apart.
    pub impulses: [Screw<D>; 2],
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
        let mut number = vec![None; self.surface.vertices.len()];
        for (k, vertex) in active.iter().enumerate() {
            number[*vertex] = Some(k);
        }
        let order: Vec<usize> = (self.surface.order.iter())
            .filter_map(|vertex| number[*vertex])
            .collect();
        let pattern = Arc::new(SparsePattern::new(&order, &entries)?);
        *last = Some((active, pattern.clone()));
        Some(pattern)
    }

    /// The system of a layer; `None` where it isn't positive definite.
    pub(super) fn system(&self, layer: &Layer<f64>) -> Option<System> {
        let mut values: Vec<[f64; 2]> = layer.rim.iter().map(|rim| [*rim; 2]).collect();
        for cell in &layer.cells {
            let element = &self.surface.faces[cell.face];
            let strength = cell.thickness.map(|t| element.area * t.value);
            lower(cell, |_, _, at| {
                values.push(strength.map(|s| s * element.slopes[at]));
            });
        }
        Some(System {
            loads: self.loads(layer),
            factor: self.pattern(layer)?.factor(&values)?,
        })
    }

    fn loads(&self, layer: &Layer<f64>) -> Vec<[Vec6; 2]> {
        let own = |spot: &usize| self.surface.loads[layer.spots[*spot].vertex];
        let active = layer.active.iter();
        let mut out: Vec<_> = active.map(|s| [own(s), Vec6::zeros()]).collect();
        if self.faces_wall() {
            return out;
        }
        for cell in &layer.cells {
            let element = &self.surface.faces[cell.face];
            let push = element.area / 3.0 * nalgebra::Vector3::from(cell.facing.normal);
            for (at, arm) in cell.corners.iter().zip(&element.arms) {
                if let Some(at) = at {
                    out[*at][1] += point_wrench(arm, &push);
                }
            }
        }
        out
    }

    /// A wall rests.
    pub(super) fn faces_wall(&self) -> bool {
        matches!(self.other, Side::Wall(_))
    }

    /// The flow for body-frame twists with this potential, and with its rate along the layer's displacement.
    pub(super) fn flow<D: Jet>(
        &self,
        (layer, placed): (&Layer<D>, &Displaced<D>),
        (system, potential): (&System, &[[f64; 2]]),
        [own, other]: [&Vec6; 2],
    ) -> Flow<D> {
        let mut out = Flow {
            other: *other,
            twists: [screw(own), placed.twist_to_body(other)],
            potential: potential.iter().map(|psi| psi.map(D::from)).collect(),
            apart: Vec::new(),
            impulses: [[D::from(0.0); 6]; 2],
        };
        // A potential that doesn't move has no rate to be found.
        if D::MOVES {
            let left = self.residual(layer, &out);
            let mut rates: Vec<[f64; 2]> = left.iter().map(|x| x.map(|x| x.rate())).collect();
            system.factor.solve(&mut rates);
            for (psi, rate) in out.potential.iter_mut().zip(rates) {
                *psi = [0, 1].map(|k| D::moving(psi[k].re(), rate[k]));
            }
        }
        out.apart = out.potential.iter().map(|psi| psi[0] - psi[1]).collect();
        out.impulses = match D::MOVES {
            true => self.impulses(layer, &out.apart),
            false => (system.impulses(out.apart.iter().map(|x| x.re()))).map(|x| screw(&x)),
        };
        out
    }

    /// b − A ψ.
    fn residual<D: Jet>(&self, layer: &Layer<D>, flow: &Flow<D>) -> Vec<[D; 2]> {
        let psi = &flow.potential;
        let mut out: Vec<[D; 2]> = (layer.active.iter().zip(&layer.rim).zip(psi))
            .map(|((spot, rim), psi)| {
                let load = &self.surface.loads[layer.spots[*spot].vertex];
                let push = pushed(load, &flow.twists[0]);
                psi.map(|psi| push - *rim * psi)
            })
            .collect();
        let (u, w) = parts(&flow.twists[1]);
        let rests = self.faces_wall();
        for cell in &layer.cells {
            let element = &self.surface.faces[cell.face];
            let slopes = slopes_of(cell, element, psi);
            let led = [0, 1].map(|k| scale(cell.thickness[k].value, &slopes[k]));
            for (i, at) in cell.corners.iter().enumerate() {
                let Some(at) = at else { continue };
                let gradient = element.gradients.column(i).into_owned();
                let push = match rests {
                    true => D::from(0.0),
                    false => {
                        let speed = add(&u, &cross(&w, &constant(&element.arms[i])));
                        product(&cell.facing.normal, &speed) / 3.0
                    }
                };
                for (k, led) in led.iter().enumerate() {
                    out[*at][k] += (push - dot(led, &gradient)) * element.area;
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
        let cells = match self.faces_wall() {
            true => &[],
            false => &layer.cells[..],
        };
        for cell in cells {
            let (sum, arm) = self.shares(cell, psi);
            force = add(&force, &scale(sum, &cell.facing.normal));
            torque = add(&torque, &cross(&arm, &cell.facing.normal));
        }
        [own, whole(&force, &torque)]
    }

    /// ∫ ψ dA over a cell, and ∫ x ψ dA.
    fn shares<D: Jet>(&self, cell: &Cell<D>, psi: &[D]) -> (D, Vector<D>) {
        let element = &self.surface.faces[cell.face];
        let (mut sum, mut arm) = (D::from(0.0), zero());
        for (at, x) in cell.corners.iter().zip(&element.arms) {
            if let Some(at) = at {
                let share = psi[*at] * (element.area / 3.0);
                sum += share;
                (0..3).for_each(|i| arm[i] += share * x[i]);
            }
        }
        (sum, arm)
    }

    /// Cotangents of `xᵀ K y`, as the film is less that held apart: −ψ_xᵀ δA ψ_y + ψ_xᵀ δb y + xᵀ δbᵀ ψ_y.
    pub(super) fn cotangents<D: Jet>(
        &self,
        layer: &Layer<D>,
        x: &Flow<D>,
        y: &Flow<D>,
    ) -> Cotangents<D> {
        let (same, rests) = (std::ptr::eq(x, y), self.faces_wall());
        let mut out = Cotangents {
            thickness: Vec::with_capacity(layer.cells.len()),
            facing: Vec::with_capacity(if rests { 0 } else { layer.cells.len() }),
            rim: Vec::with_capacity(layer.rim.len()),
        };
        for cell in &layer.cells {
            let element = &self.surface.faces[cell.face];
            let by_x = slopes_of(cell, element, &x.potential);
            let by_y = match same {
                true => by_x,
                false => slopes_of(cell, element, &y.potential),
            };
            let product = |k: usize| product(&by_x[k], &by_y[k]) * (SIGNS[k] * -element.area);
            out.thickness.push([0, 1].map(product));
            if rests {
                continue;
            }
            let by = |flow: &Flow<D>| self.shares(cell, &flow.apart);
            let facing = led(&by(x), y);
            out.facing.push(match same {
                true => facing.map(|x| x * 2.0),
                false => add(&facing, &led(&by(y), x)),
            });
        }
        let rim = |(x, y): (&[D; 2], &[D; 2])| x[1] * y[1] - x[0] * y[0];
        out.rim = x.potential.iter().zip(&y.potential).map(rim).collect();
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
        let turned = turned(placed, x, y);
        (0..6).for_each(|k| out[k] -= turned[k]);
        out
    }

    /// The wrenches of [`Film::wrench`] of every two of the flows, those of one with all up to itself after one another.
    pub(super) fn wrenches(
        &self,
        (layer, rates): (&Layer<f64>, &Rates),
        placed: &Displaced<f64>,
        flows: &[Flow<f64>],
    ) -> Vec<Vec6> {
        let pairs = || (0..flows.len()).flat_map(|x| (0..=x).map(move |y| (x, y)));
        let of_turning = |(x, y): (usize, usize)| -Vec6::from(turned(placed, &flows[x], &flows[y]));
        let mut out: Vec<Vec6> = pairs().map(of_turning).collect();
        let (mut slopes, mut shares) = (Vec::new(), Vec::new());
        for (c, cell) in layer.cells.iter().enumerate() {
            let element = &self.surface.faces[cell.face];
            slopes.clear();
            slopes.extend(flows.iter().map(|f| slopes_of(cell, element, &f.potential)));
            let thickness = [0, 1].map(|k| SIGNS[k] * -element.area * rates.thickness[c][k]);
            for (out, (x, y)) in out.iter_mut().zip(pairs()) {
                for (k, rate) in thickness.iter().enumerate() {
                    *out += product(&slopes[x][k], &slopes[y][k]) * rate;
                }
            }
            if let Some(rates) = rates.facing.get(c) {
                shares.clear();
                shares.extend(flows.iter().map(|f| self.shares(cell, &f.apart)));
                for (out, (x, y)) in out.iter_mut().zip(pairs()) {
                    let facing = add(&led(&shares[x], &flows[y]), &led(&shares[y], &flows[x]));
                    for (bar, rate) in facing.iter().zip(rates) {
                        *out += *bar * rate;
                    }
                }
            }
        }
        // Within the film there is no rim.
        let rims = (rates.rim.iter().enumerate()).filter(|(v, _)| layer.rim[*v] != 0.0);
        for (v, rate) in rims {
            for (out, (x, y)) in out.iter_mut().zip(pairs()) {
                let (x, y) = (&flows[x].potential[v], &flows[y].potential[v]);
                *out += (x[1] * y[1] - x[0] * y[0]) * rate;
            }
        }
        out
    }
}

/// What a flow pushes with the twist of the other side of another, from its shares of a cell: the cotangent of the facing.
fn led<D: Jet>((sum, arm): &(D, Vector<D>), other: &Flow<D>) -> Vector<D> {
    let (u, w) = parts(&other.twists[1]);
    add(&scale(*sum, &u), &cross(&w, arm))
}

/// What the other's twists, which turn in the frame of the first, take off the wrench of two flows.
fn turned<D: Jet>(placed: &Displaced<D>, x: &Flow<D>, y: &Flow<D>) -> Screw<D> {
    let mut out = [D::from(0.0); 6];
    for (flow, answer) in [(x, y), (y, x)] {
        let impulse = placed.wrench_to_world(&answer.impulses[1]);
        let turned = cross_force(&screw(&flow.other), &impulse);
        (0..6).for_each(|k| out[k] += turned[k]);
    }
    out
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

/// ∇ψ on a face, as the film is and held apart.
pub(super) fn slopes_of<D: Jet>(
    cell: &Cell<D>,
    element: &Element,
    psi: &[[D; 2]],
) -> [Vector<D>; 2] {
    let mut out = [zero(); 2];
    for (k, at) in cell.corners.iter().enumerate() {
        if let Some(at) = at {
            for (out, psi) in out.iter_mut().zip(&psi[*at]) {
                (0..3).for_each(|i| out[i] += *psi * element.gradients[(i, k)]);
            }
        }
    }
    out
}
