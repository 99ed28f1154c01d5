//! Twists and wrenches in the device's units: lengths over the scene's size, every column over its own size.

use crate::Result;
use crate::adjoint::lie::{Vec3, Vec6, six};
use crate::coupling::Tangent;
use nalgebra::DMatrix;

/// Size of a column of twists: of its velocities, at the scene's size, and rates.
pub(super) fn size(twists: &DMatrix<f64>, k: usize, length: f64) -> f64 {
    let column = twists.column(k);
    let of = |(i, x): (usize, &f64)| if i % 6 < 3 { x.abs() / length } else { x.abs() };
    match column.iter().enumerate().map(of).fold(0.0, f64::max) {
        0.0 => 1.0,
        s => s,
    }
}

/// Twists as the device has them: `[body][6][columns]`.
pub(super) fn scaled(twists: &DMatrix<f64>, scale: &[f64], length: f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(twists.len());
    for i in 0..twists.nrows() {
        let unit = if i % 6 < 3 { length } else { 1.0 };
        out.extend((0..twists.ncols()).map(|k| twists[(i, k)] / (unit * scale[k])));
    }
    out
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
