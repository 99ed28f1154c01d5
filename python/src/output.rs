//! Rollouts as files of other programs.

use crate::array;
use crate::error::input;
use crate::interrupt::long;
use hydrograd::output::{Frames, gltf, vtk};
use hydrograd::simulate::StreamlineSettings;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Two corners and a spacing, m.
pub type GridBox<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, f64);

/// Seeds of streamlines and their length, m.
pub type Drawn<'py> = (Bound<'py, PyAny>, f64);

/// Which states.
fn frames(place: &str, per_second: Option<f64>, every: Option<isize>) -> PyResult<Frames> {
    match (per_second, every) {
        (None, None) => Ok(Frames::default()),
        (Some(rate), None) => Ok(Frames::PerSecond(rate)),
        (None, Some(every)) => match usize::try_from(every) {
            Ok(every) => Ok(Frames::Every(every)),
            Err(_) => Err(input(
                format!("{place}: every"),
                every,
                "must be at least 1, which takes every state",
            )),
        },
        (Some(_), Some(every)) => Err(input(
            format!("{place}: every"),
            every.to_string(),
            "give every or frames_per_second, not both",
        )),
    }
}

/// As VTK; the files to open.
pub fn write_vtk(
    py: Python<'_>,
    rollout: &Arc<hydrograd::Rollout>,
    folder: PathBuf,
    (per_second, every): (Option<f64>, Option<isize>),
    (loads, pressure): (bool, bool),
    flow: Option<GridBox<'_>>,
    streamlines: Option<Drawn<'_>>,
) -> PyResult<Vec<PathBuf>> {
    let lines = |(seeds, length): Drawn| {
        let seeds = array::vectors("write_vtk: streamlines: seeds", &seeds)?;
        Ok::<_, PyErr>(vtk::Streamlines {
            seeds: seeds.into_iter().map(Into::into).collect(),
            settings: StreamlineSettings::new(length),
        })
    };
    let grid = |(low, high, spacing): GridBox| {
        Ok::<_, PyErr>(vtk::Grid {
            low: array::fixed("write_vtk: flow: low", &low)?,
            high: array::fixed("write_vtk: flow: high", &high)?,
            spacing,
        })
    };
    let options = vtk::Options {
        frames: frames("write_vtk", per_second, every)?,
        loads,
        pressure,
        flow: flow.map(grid).transpose()?,
        streamlines: streamlines.map(lines).transpose()?,
    };
    let rollout = rollout.clone();
    long(py, move |interrupt| {
        vtk::write_with(&rollout, &folder, &options, || interrupt.check())
    })
}

/// As glTF; the file.
pub fn write_gltf(
    py: Python<'_>,
    rollout: &Arc<hydrograd::Rollout>,
    path: PathBuf,
    (per_second, every): (Option<f64>, Option<isize>),
    colors: BTreeMap<String, String>,
) -> PyResult<PathBuf> {
    let frames = frames("write_gltf", per_second, every)?;
    let options = gltf::Options { frames, colors };
    let rollout = rollout.clone();
    long(py, move |_| {
        gltf::write(&rollout, &path, &options)?;
        Ok(path)
    })
}
