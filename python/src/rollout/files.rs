//! Trajectories as tables, files of other programs, and figures of the whole.

use super::Rollout;
use crate::array;
use crate::interrupt::{long, short};
use crate::mapping;
use crate::output;
use hydrograd::simulate::{GapReport, NearGap, Recording};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

#[pymethods]
impl Rollout {
    /// Columns by name, one row a state: time, each coordinate and velocity, energy, momentum of all together, smallest gap, and the controls that acted from there on (NaN at the last state), SI units, with `pressure` also that of the flow on every face
    /// ("ball.pressure_0", …, Pa), at the price of solves of its own a state; `pandas.DataFrame(rollout.to_dict())` is a table.
    #[pyo3(signature = (*, pressure=false))]
    fn to_dict<'py>(&self, py: Python<'py>, pressure: bool) -> PyResult<Bound<'py, PyDict>> {
        let (simulator, inner) = (self.simulator.clone_ref(py), self.inner.clone());
        let recording = long(py, move |_| {
            let mut recording = Recording::of(&simulator.get().scene, &inner)?;
            if pressure {
                recording.observables.push(inner.pressures()?);
            }
            Ok(recording)
        })?;
        let out = PyDict::new(py);
        let n = recording.time.len();
        let column = |values: Vec<f64>| array::to_python(py, values, &[n]);
        out.set_item("time", column(recording.time.clone())?)?;
        for (name, recorded, i) in recording.columns() {
            let values = recorded.values.iter().map(|row| row[i]).collect();
            out.set_item(name, column(values)?)?;
        }
        Ok(out)
    }

    /// Writes files of VTK, which ParaView opens, into a folder, which is made where there is none; the files to open are given. `bodies.pvd`: all bodies' triangles frame by frame, in the
    /// world, with the `body` (number) and the `velocity` (m/s) of every face, and with `pressure`, at the price of solves of its own a frame, the `pressure` of the flow and the `hydrostatic`
    /// one (Pa) and the `water_velocity` (m/s) there, as `pressure` tells them, zero where a face isn't `wetted` (1 or 0); `walls.vtp`: walls as squares; with `loads`, `loads.pvd`: at each body's origin what acts on it,
    /// `gravity_force` (N), `gravity_moment` (N m), `water_force`, …, of every kind that `loads` tells; with `flow`, two corners (3,) of a box and the spacing of a grid in it, m, `flow.pvd`: the
    /// water's `velocity` there, zero where it isn't `resolved`; with `streamlines`, seeds (n, 3) and a length, m, `streamlines.pvd`: the lines of `streamlines`, of seeds where the flow is known. Frames are up to `frames_per_second` of simulated time (30 unless told otherwise), or every `every`-th
    /// state, with the first and the last. Files of the same names are replaced. Ctrl-C ends it.
    #[pyo3(signature = (folder, *, frames_per_second=None, every=None, loads=false, pressure=false, flow=None, streamlines=None))]
    #[expect(clippy::too_many_arguments, reason = "one per keyword")]
    fn write_vtk(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        frames_per_second: Option<f64>,
        every: Option<isize>,
        loads: bool,
        pressure: bool,
        flow: Option<output::GridBox<'_>>,
        streamlines: Option<output::Drawn<'_>>,
    ) -> PyResult<Vec<PathBuf>> {
        let frames = (frames_per_second, every);
        let more = (loads, pressure);
        output::write_vtk(py, &self.inner, folder, frames, more, flow, streamlines)
    }

    /// Writes an animated scene in glTF 2.0, to a name that ends in `.glb`, which Blender and browsers open, and gives its path: a node each body, moved between frames, and walls. Lengths are m and times s, counted from
    /// the first state; the node `hydrograd` above all turns z up. `colors` are "#rrggbb" by the names of bodies; frames are those of `write_vtk`. A file that stands there is replaced.
    #[pyo3(signature = (path, *, frames_per_second=None, every=None, colors=None))]
    fn write_gltf(
        &self,
        py: Python<'_>,
        path: PathBuf,
        frames_per_second: Option<f64>,
        every: Option<isize>,
        colors: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PathBuf> {
        let frames = (frames_per_second, every);
        let colors = mapping::named("write_gltf: colors", "a text, \"#rrggbb\"", colors)?;
        output::write_gltf(py, &self.inner, path, frames, colors)
    }

    /// Figures of the whole trajectory: energies (J), drift of momentum (relative), iterations, smallest gap (m), by what the water
    /// across gaps is carried and how far off it is estimated to be (`gaps`), the largest gap
    /// at which surfaces are taken to touch (m), steps that were cut into pieces, and the most pieces of one.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let s = short(py, || Ok(self.inner.summary()))?;
        let out = PyDict::new(py);
        out.set_item("steps", s.steps)?;
        out.set_item("energy_initial", s.energy_initial)?;
        out.set_item("energy_final", s.energy_final)?;
        out.set_item("energy_gain", s.energy_gain)?;
        out.set_item("energy_loss", s.energy_loss)?;
        out.set_item("momentum_drift", s.momentum_drift)?;
        out.set_item("momenta_kept", s.momenta_kept)?;
        out.set_item("iterations", s.iterations)?;
        out.set_item("asymmetry", s.asymmetry)?;
        out.set_item("min_gap", s.min_gap)?;
        out.set_item("gaps", gaps(py, &s.gaps)?)?;
        out.set_item("contact_gap", s.contact_gap)?;
        out.set_item("cut_steps", s.cut_steps)?;
        out.set_item("most_pieces", s.most_pieces)?;
        Ok(out)
    }
}

/// What a summary says of gaps.
fn gaps<'py>(py: Python<'py>, report: &GapReport) -> PyResult<Bound<'py, PyDict>> {
    let near = |gap: &Option<NearGap>| -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(gap) = gap else {
            return Ok(None);
        };
        let out = PyDict::new(py);
        out.set_item("time", gap.time)?;
        out.set_item("gap", gap.gap)?;
        out.set_item("bodies", gap.bodies.clone())?;
        out.set_item("carried", gap.carried.to_string())?;
        out.set_item("added_mass_error", gap.added_mass_error)?;
        out.set_item("force_error", gap.force_error)?;
        Ok(Some(out))
    };
    let out = PyDict::new(py);
    out.set_item("nearest", near(&report.nearest)?)?;
    out.set_item("worst", near(&report.worst)?)?;
    out.set_item("changes", report.changes)?;
    let changes = report.first_changes.iter();
    let changes = changes.map(|c| (c.time, c.bodies.clone(), c.carried.to_string()));
    out.set_item("first_changes", changes.collect::<Vec<_>>())?;
    Ok(out)
}
