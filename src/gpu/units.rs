//! Twists, poses and wrenches in the device's units: lengths over the scene's size, positions relative to its middle,
//! every column over its own size.

use super::buffer::Buffer;
use super::context::Context;
use crate::Result;
use crate::adjoint::lie::{Mat3, Pose, Vec3, Vec6, angular, linear, six};
use crate::coupling::{Direction, Tangent};
use crate::geometry::Image;
use nalgebra::DMatrix;

/// Columns of twists (bodies' six components × columns).
pub(super) struct Twists {
    pub all: DMatrix<f64>,
    /// What each column is in units of: on the device all are about 1.
    pub scale: Vec<f64>,
    /// Of the scene, m.
    length: f64,
}

impl Twists {
    pub fn new(all: DMatrix<f64>, length: f64) -> Self {
        let scale = (0..all.ncols()).map(|k| size(&all, k, length)).collect();
        Self { all, scale, length }
    }

    /// `[body][6][columns]`.
    pub fn upload(&self, context: &Context) -> Result<Buffer> {
        context.upload("twists", context.fine(), &self.numbers())
    }

    /// The same as numbers.
    pub fn numbers(&self) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.all.len());
        for i in 0..self.all.nrows() {
            let unit = if i % 6 < 3 { self.length } else { 1.0 };
            out.extend((self.scale.iter().enumerate()).map(|(k, s)| self.all[(i, k)] / (unit * s)));
        }
        out
    }

    /// Combinations of the columns, and the coefficients between both's units.
    pub fn combined(&self, coefficients: &DMatrix<f64>) -> (Self, DMatrix<f64>) {
        let out = Self::new(&self.all * coefficients, self.length);
        let units = DMatrix::from_fn(self.scale.len(), out.scale.len(), |k, c| {
            coefficients[(k, c)] * self.scale[k] / out.scale[c]
        });
        (out, units)
    }

    /// The coefficients of directions, or their twists where some are no combinations of the columns.
    pub fn along(
        &self,
        directions: &[Direction],
    ) -> std::result::Result<DMatrix<f64>, DMatrix<f64>> {
        let n = directions.len();
        let mut coefficients = DMatrix::zeros(self.all.ncols(), n);
        let mut twists = DMatrix::zeros(self.all.nrows(), n);
        let mut combined = true;
        for (k, direction) in directions.iter().enumerate() {
            match direction {
                Direction::Basis(c) => {
                    coefficients.set_column(k, c);
                    twists.set_column(k, &(&self.all * *c));
                }
                Direction::Twist(x) => {
                    combined = false;
                    twists.set_column(k, x);
                }
            }
        }
        if combined {
            Ok(coefficients)
        } else {
            Err(twists)
        }
    }

    /// Body-frame impulses from the device's `[body][6][columns]`, which are in units of `unit`.
    pub fn impulses(&self, values: &[f64], unit: f64) -> DMatrix<f64> {
        let k = self.scale.len();
        DMatrix::from_fn(self.all.nrows(), k, |i, c| {
            let power = if i % 6 < 3 { 4 } else { 5 };
            unit * values[i * k + c] * self.scale[c] * self.length.powi(power)
        })
    }
}

/// Size of a column of twists: of its velocities, at the scene's size, and rates.
pub(super) fn size(twists: &DMatrix<f64>, k: usize, length: f64) -> f64 {
    let column = twists.column(k);
    let of = |(i, x): (usize, &f64)| if i % 6 < 3 { x.abs() / length } else { x.abs() };
    match column.iter().enumerate().map(of).fold(0.0, f64::max) {
        0.0 => 1.0,
        s => s,
    }
}

/// The scene's middle, and relative to it `[body][12]`, then `[image][12]`: rotation row by row, translation.
pub(super) fn placements(poses: &[Pose], images: &[Image], length: f64) -> (Vec3, Vec<f64>) {
    let sum: Vec3 = poses.iter().map(|p| p.translation).sum();
    let middle = sum / poses.len().max(1) as f64;
    let mut values = Vec::new();
    let mut add = |linear: &Mat3, shift: Vec3| {
        (0..3).for_each(|i| values.extend(linear.row(i).iter()));
        values.extend((shift / length).iter());
    };
    for pose in poses {
        add(&pose.rotation, pose.translation - middle);
    }
    for image in images {
        let shift = image.linear * middle + image.shift - middle;
        add(&image.linear, shift);
    }
    (middle, values)
}

/// Spatial twists about the scene's middle.
pub(super) fn motions(twists: impl Iterator<Item = Vec6>, middle: &Vec3, length: f64) -> Vec<f64> {
    let of = |z: Vec6| {
        let u = (linear(&z) + angular(&z).cross(middle)) / length;
        six(&u, &angular(&z)).data.0[0]
    };
    twists.flat_map(of).collect()
}

/// A wrench about the scene's middle in the device's units as a spatial wrench.
pub(super) fn spatial(length: f64, middle: &Vec3, w: &[f64], scale: f64) -> Vec6 {
    let l4 = length.powi(4) * scale;
    let force = Vec3::new(w[0], w[1], w[2]) * l4;
    let moment = Vec3::new(w[3], w[4], w[5]) * (l4 * length);
    six(&force, &(moment + middle.cross(&force)))
}

/// A tangent along z, which it is linear in, made with a z of about unit size.
pub(super) fn along(
    z: &[Vec6],
    length: f64,
    tangent: impl FnOnce(&[Vec6]) -> Result<Tangent>,
) -> Result<Tangent> {
    let all = DMatrix::from_fn(6 * z.len(), 1, |i, _| z[i / 6][i % 6]);
    let scale = size(&all, 0, length);
    let unit: Vec<Vec6> = z.iter().map(|z| z / scale).collect();
    let mut out = tangent(&unit)?;
    out.momentum_x *= scale;
    out.momentum_y *= scale;
    out.wrench.iter_mut().for_each(|w| *w *= scale);
    Ok(out)
}
