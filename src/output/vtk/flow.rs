//! The water's velocity on a grid.

use super::file::{array, extent};
use crate::adjoint::lie::Vec3;
use crate::simulate::Rollout;
use crate::{Error, Result, memory};
use vtkio::model::{Attributes, DataSet, ImageDataPiece, Piece};

/// Most points of a grid.
pub const MOST_POINTS: usize = 20_000_000;

/// How far beyond its end a grid may reach for rounding, in spacings.
const ROUNDING: f64 = 1e-6;

/// VTK's mark of a point that isn't to be shown.
const HIDDEN: u8 = 2;

/// A number as the file has it: the crate writes corner and spacing of a grid in as many digits as single precision takes. Points are where the file says.
fn written(x: f64) -> f64 {
    (x as f32).to_string().parse().unwrap_or(f64::NAN)
}

/// A regular grid of points, from a corner on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Corner of the box with the smallest coordinates, m, which is a point of the grid. It and the spacing are taken to the digits of single precision.
    pub low: [f64; 3],
    /// Corner with the largest ones, m; a coordinate that is the same in both makes the grid a plane.
    pub high: [f64; 3],
    /// Distance of neighbours along each axis, m.
    pub spacing: f64,
}

impl Grid {
    /// Numbers of points along x, y and z.
    ///
    /// # Errors
    /// A spacing that isn't finite and positive; corners that aren't finite, or of which `high` lies below `low`; more than [`MOST_POINTS`].
    pub fn counts(&self) -> Result<[usize; 3]> {
        let spacing = written(self.spacing);
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(Error::input(
                "flow grid: spacing",
                self.spacing,
                "must be finite and positive, in m",
            ));
        }
        let mut counts = [0.0; 3];
        for (axis, count) in counts.iter_mut().enumerate() {
            let (low, high) = (self.low[axis], self.high[axis]);
            for (name, end) in [("low", low), ("high", high)] {
                if !written(end).is_finite() {
                    let place = format!("flow grid: {name}[{axis}]");
                    return Err(Error::input(place, end, "must be finite, in m"));
                }
            }
            if high < low {
                let expected = format!("must be at least that of low, {low} m");
                let place = format!("flow grid: high[{axis}]");
                return Err(Error::input(place, high, expected));
            }
            *count = ((high - low) / self.spacing + ROUNDING).floor() + 1.0;
        }
        let all: f64 = counts.iter().product();
        if all > MOST_POINTS as f64 {
            return Err(Error::input(
                "flow grid: points",
                format!(
                    "{all:.3e} ({:.3e} × {:.3e} × {:.3e})",
                    counts[0], counts[1], counts[2]
                ),
                format!(
                    "must be at most {:.0e}: take a spacing larger than {} m, or a smaller box",
                    MOST_POINTS as f64, self.spacing
                ),
            ));
        }
        Ok(counts.map(|n| n as usize))
    }

    /// Its points, m, world axes: x changes fastest, then y.
    ///
    /// # Errors
    /// As [`Grid::counts`], and a grid that the memory doesn't hold.
    pub fn points(&self) -> Result<Vec<Vec3>> {
        let [nx, ny, nz] = self.counts()?;
        // Points, those in the water, their velocities, and the array with its compressed text.
        let bytes = memory::numbers((5 * 3 * nx * ny * nz) as f64);
        memory::fits("flow grid", bytes, "take a larger spacing or a smaller box")?;
        let (low, spacing) = (self.low.map(written), written(self.spacing));
        let at = |axis: usize, k: usize| low[axis] + k as f64 * spacing;
        let plane = |k| (0..ny).map(move |j| (j, k));
        let rows = (0..nz).flat_map(plane);
        let row = |(j, k)| (0..nx).map(move |i| Vec3::new(at(0, i), at(1, j), at(2, k)));
        Ok(rows.flat_map(row).collect())
    }
}

/// The flow at the points of a grid at state `n`: zero, and marked, where it isn't resolved.
pub(super) fn frame(rollout: &Rollout, grid: &Grid, points: &[Vec3], n: usize) -> Result<DataSet> {
    let mut velocity = Vec::with_capacity(3 * points.len());
    let mut marks: Vec<u8> = Vec::with_capacity(points.len());
    for known in rollout.known_flow(n, points)? {
        // Readers stumble over what isn't a number.
        let known = known.filter(|u| u.iter().all(|x| x.is_finite()));
        marks.push(u8::from(known.is_some()));
        velocity.extend_from_slice(known.unwrap_or_default().as_slice());
    }
    let ghosts: Vec<u8> = marks.iter().map(|m| HIDDEN * (1 - m)).collect();
    let mut data = Attributes::new();
    data.point.push(array("velocity", 3, velocity));
    data.point.push(array("resolved", 1, marks));
    data.point.push(array("vtkGhostType", 1, ghosts));
    let extent = extent(grid.counts()?);
    Ok(DataSet::ImageData {
        extent: extent.clone(),
        origin: grid.low.map(|x| x as f32),
        spacing: [grid.spacing as f32; 3],
        meta: None,
        pieces: vec![Piece::Inline(Box::new(ImageDataPiece { extent, data }))],
    })
}
