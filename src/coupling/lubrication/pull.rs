//! The reverse of a bearing's damping: what its product with two twists exerts on the pose, and on the roughness.

use super::Bearing;
use super::element::{Cell, Point, fade};
use super::flow::{PlacedBearing, outside_slope};
use crate::adjoint::lie::{Vec3, Vec6, angular, point_velocity, point_wrench, six};

/// Cotangents at a spot.
#[derive(Clone, Copy, Default)]
struct SpotBar {
    thickness: f64,
    outside: f64,
    /// Of the area of sides.
    side: f64,
    /// Of the way across.
    way: Vec3,
    point: Vec3,
}

/// A twist with the pressure that it makes.
struct Driven<'t> {
    twist: &'t Vec6,
    pressure: Vec<f64>,
}

/// What a cell gets from its points.
struct CellBar {
    /// Of the logarithms of the thickness at the corners and halfway along the edges.
    logs: [f64; 6],
    looks: f64,
    /// Moment of the cotangents of the normals about them: what a turn does.
    torque: Vec3,
}

impl PlacedBearing {
    /// The gradient of `zᵀ (C/μ) y`, twists as [`PlacedBearing::damping`] takes them: the wrench, same axes and origin, that a displacement of the first body
    /// against the other does work on, and the derivative by the roughness.
    pub fn product_vjp(&self, bearing: &Bearing, z: &Vec6, y: &Vec6) -> (Vec6, f64) {
        let driven = |twist| Driven {
            twist,
            pressure: (&self.pressure * twist).as_slice().to_vec(),
        };
        let both = [driven(z), driven(y)];
        let mut bars = vec![SpotBar::default(); self.layers.len()];
        self.pull_leaks(&both, &mut bars);
        let mut torque = Vec3::zeros();
        for cell in &self.cells {
            torque += self.pull_cell(cell, &both, &mut bars);
        }
        // From spots to the pose.
        let by_distance = outside_slope(bearing.reach);
        let (mut out, mut roughness) = (Vec6::zeros(), 0.0);
        for ((spot, layer), bar) in self.patch.spots.iter().zip(&self.layers).zip(&bars) {
            let (field, h) = (&spot.field, &layer.thickness);
            roughness += bar.thickness * h.by_roughness;
            let distance = bar.thickness * h.by_distance + bar.outside * by_distance;
            let force = bar.point + distance * field.gradient + field.hessian * bar.way;
            out += point_wrench(&spot.point, &force);
        }
        (out + six(&Vec3::zeros(), &torque), roughness)
    }

    fn pull_leaks(&self, [z, y]: &[Driven; 2], bars: &mut [SpotBar]) {
        for (layer, bar) in self.layers.iter().zip(bars) {
            if let Some(at) = layer.number {
                let product = -z.pressure[at] * y.pressure[at];
                let [_, by_height, by_outside, by_side] = layer.leak();
                bar.thickness += product * by_height;
                bar.outside += product * by_outside;
                bar.side += product * by_side;
            }
        }
    }

    /// Adds to the spots of a cell; returns the torque of what its normals do.
    fn pull_cell(&self, cell: &Cell, [z, y]: &[Driven; 2], bars: &mut [SpotBar]) -> Vec3 {
        let pressures = |d: &Driven| {
            let of = |s: usize| self.layers[s].number.map_or(0.0, |at| d.pressure[at]);
            cell.corners.map(of)
        };
        let values = [pressures(z), pressures(y)];
        let [looks, by_facing] = cell.looks();
        let mut own = CellBar {
            logs: [0.0; 6],
            looks: 0.0,
            torque: Vec3::zeros(),
        };
        for point in &self.points(cell) {
            self.pull_flow(cell, point, &values, &mut own);
            if looks > 0.0 {
                self.pull_push(cell, point, [z, y], &values, &mut own, bars);
            }
        }
        for (s, log) in cell.corners.iter().chain(&cell.halves).zip(own.logs) {
            bars[*s].thickness += log / self.layers[*s].thickness.value;
        }
        let sides: f64 = cell.corners.iter().map(|s| bars[*s].side).sum();
        own.looks -= cell.area / 3.0 * sides;
        // facing = −normal · mean way across.
        let facing = -own.looks * by_facing / 3.0;
        if facing != 0.0 {
            for s in cell.corners {
                bars[s].way += facing * cell.normal;
                let way = &self.patch.spots[s].field.gradient;
                own.torque += facing * cell.normal.cross(way);
            }
        }
        own.torque
    }

    /// −ψ_zᵀ δA ψ_y.
    fn pull_flow(&self, cell: &Cell, point: &Point, [p, q]: &[[f64; 3]; 2], own: &mut CellBar) {
        let pressed = |x: &[f64; 3]| point.pressed(x, &(cell.gradients * Vec3::from(*x)));
        let ((u, du), (v, dv)) = (pressed(p), pressed(q));
        let strength = point.weight / 12.0 * (-point.log).exp();
        let by_log = strength * du.dot(&dv);
        let by_slope = 2.0 * strength * (u * dv + v * du);
        for (log, (value, gradient)) in own.logs.iter_mut().zip(cell.quadratic(&point.shares)) {
            *log += by_log * value + by_slope.dot(&gradient);
        }
    }

    /// ψ_zᵀ δb y + ψ_yᵀ δb z + zᵀ δS y.
    fn pull_push(
        &self,
        cell: &Cell,
        point: &Point,
        [z, y]: [&Driven; 2],
        [p, q]: &[[f64; 3]; 2],
        own: &mut CellBar,
        bars: &mut [SpotBar],
    ) {
        let here = self.here(cell, point);
        let [looks, _] = cell.looks();
        let [u, w] = [z, y].map(|d| point_velocity(d.twist, &here.position));
        let strength = point.weight * (-2.0 * point.log).exp();
        let [p, q] = [p, q].map(|x| strength * point.mean(x));
        let velocity = p * w + q * u;
        let squeezed = here.push.dot(&velocity);
        let turned = here
            .push
            .cross(&(p * angular(y.twist) + q * angular(z.twist)));
        // Couette's shear.
        let (ug, wg) = (u.dot(&here.way), w.dot(&here.way));
        let along = u.dot(&w) - ug * wg;
        let shear = point.weight * (-point.log).exp();
        let sheared = shear * here.within;
        let rolled = (w - wg * here.way).cross(&angular(z.twist))
            + (u - ug * here.way).cross(&angular(y.twist));
        own.looks += squeezed + sheared * along;
        let log = -looks * (2.0 * squeezed + sheared * along);
        for (bar, (value, _)) in own.logs.iter_mut().zip(cell.quadratic(&point.shares)) {
            *bar += log * value;
        }
        let push = 0.5 * looks * velocity;
        let way = push - looks * sheared * (ug * w + wg * u);
        let position = looks * (turned + sheared * rolled);
        for ((s, share), normal) in cell.corners.iter().zip(point.shares).zip(&cell.normals) {
            let bar = &mut bars[*s];
            bar.way += share * way;
            bar.point += share * position;
            bar.outside += share * looks * shear * along * fade(self.layers[*s].outside)[1];
            own.torque -= share * normal.cross(&push);
        }
    }
}
