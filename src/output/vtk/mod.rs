//! A run for ParaView and other programs that read VTK's XML files: surfaces, loads and the flow of the water, frame by frame.
//!
//! [`write()`] fills a folder:
//!
//! | file | what it holds |
//! |---|---|
//! | `bodies.pvd` | the series of `bodies/bodies_00000.vtp` …: the triangles of all bodies, in the world; of each its `body` (number in the scene) and its centre's `velocity` (m/s), with [`Options::pressure`] also what the water does to it; a body without a shape is a point |
//! | `walls.vtp` | walls as squares around the scene, where there are any; of each its `wall` (number in the scene) and whether it is `free` (1) or rigid (0) |
//! | `loads.pvd` | with [`Options::loads`], the series of `loads/loads_00000.vtp` …: a point at each body's origin with forces (N) and moments about it (N m), kind by kind |
//! | `flow.pvd` | with [`Options::flow`], the series of `flow/flow_00000.vti` …: the water's `velocity` (m/s) on a grid, and where it is `resolved` |
//! | `streamlines.pvd` | with [`Options::streamlines`], the series of `streamlines/streamlines_00000.vtp` …: lines along the water's `velocity` (m/s), and which `seed` each goes through |
//!
//! All axes are the world's. Numbers are in double precision, compressed without loss.

mod file;
mod flow;
mod lines;
mod loads;
mod placed;
mod pressure;
mod surface;

pub use flow::{Grid, MOST_POINTS};
pub use lines::Streamlines;

use super::frames::Frames;
use super::room::Room;
use crate::error::in_order;
use crate::simulate::{Recording, Rollout};
use crate::{Error, Result};
use file::Series;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use vtkio::model::DataSet;

/// What is written of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// The states.
    pub frames: Frames,
    /// What acts on every body ([`Rollout::loads`]), which takes a solve a frame.
    pub loads: bool,
    /// What the water does to every face of the bodies ([`Rollout::pressure`]), which takes solves of its own a frame: `pressure` of the flow and `hydrostatic` one of the water at rest, Pa, `water_velocity`,
    /// m/s; `wetted`, 1 where they are known. All are zero on bodies that aren't in the water or have no shape.
    pub pressure: bool,
    /// The water's velocity at the points of a grid ([`Rollout::flow`]), which takes a solve a frame.
    pub flow: Option<Grid>,
    /// Lines along that velocity ([`Rollout::streamlines`]), which take a solve a frame.
    pub streamlines: Option<Streamlines>,
}

/// Writes a run into a folder, which is made where there is none. The files to open are given: series, and walls. Files of the same names are replaced; others that stand there stay.
///
/// # Errors
/// Frames that select nothing ([`Frames::check`]), a grid that is refused ([`Grid::counts`]); a folder or a file that can't be written, by its path; what
/// [`Rollout::loads`], [`Rollout::pressure`], [`Rollout::flow`] and [`Rollout::streamlines`] report.
pub fn write(rollout: &Rollout, folder: &Path, options: &Options) -> Result<Vec<PathBuf>> {
    write_with(rollout, folder, options, || ControlFlow::Continue(()))
}

/// As [`write()`]; `progress` is called after each file of a series, on whatever thread wrote it, and may end the work.
///
/// # Errors
/// As [`write()`], and [`Error::Stopped`] if `progress` breaks.
pub fn write_with(
    rollout: &Rollout,
    folder: &Path,
    options: &Options,
    progress: impl Fn() -> ControlFlow<()> + Sync,
) -> Result<Vec<PathBuf>> {
    let states = options.frames.states(rollout)?;
    if let Some(grid) = &options.flow {
        grid.counts()?;
    }
    Recording::prepare(folder)?;
    let room = Room::of(rollout, &states)?;
    let told = |made: Result<()>| {
        made?;
        match progress() {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Stopped {
                what: format!("writing {}", folder.display()),
            }),
        }
    };
    let times: Vec<f64> = states.iter().map(|n| rollout.samples()[*n].time).collect();
    let mut made = Vec::new();

    let series = Series::new(folder, "bodies", "vtp", &times)?;
    let velocities = rollout.velocities();
    let frame = |(k, n): (usize, &usize)| {
        let data = surface::bodies(rollout, &room, &velocities, *n, options.pressure);
        told(data.and_then(|data| series.write(k, data)))
    };
    in_order(states.par_iter().enumerate().map(frame))?;
    made.push(series.finish()?);

    if let Some(walls) = surface::walls(rollout, &room)? {
        let path = folder.join("walls.vtp");
        file::write(&path, walls)?;
        made.push(path);
    }
    if options.loads {
        let series = Series::new(folder, "loads", "vtp", &times)?;
        let frames: Vec<DataSet> = loads::frames(rollout, &states)?;
        for (k, data) in frames.into_iter().enumerate() {
            told(series.write(k, data))?;
        }
        made.push(series.finish()?);
    }
    if let Some(grid) = &options.flow {
        let series = Series::new(folder, "flow", "vti", &times)?;
        let points = grid.points()?;
        for (k, n) in states.iter().enumerate() {
            let data = flow::frame(rollout, grid, &points, *n);
            told(data.and_then(|data| series.write(k, data)))?;
        }
        made.push(series.finish()?);
    }
    if let Some(drawn) = &options.streamlines {
        let series = Series::new(folder, "streamlines", "vtp", &times)?;
        for (k, n) in states.iter().enumerate() {
            let data = lines::frame(rollout, drawn, *n);
            told(data.and_then(|data| series.write(k, data)))?;
        }
        made.push(series.finish()?);
    }
    Ok(made)
}
