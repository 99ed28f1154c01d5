//! What acts on bodies and joints at a state.

use crate::array;
use crate::error::input;
use hydrograd::adjoint::lie::Vec6;
use hydrograd::simulate;
use numpy::PyArrayDyn;
use pyo3::prelude::*;

/// Wrenches on all bodies at one state, kind by kind, and across their joints: made by `Rollout.loads`. Rows are force (N) and moment about the body's origin (N m), world axes. With
/// the wrench across its own joint and the opposite ones of what it carries, they are the rate of a body's own momentum.
#[pyclass(frozen, module = "hydrograd")]
pub struct Loads(pub simulate::Loads);

type Numbers<'py> = PyResult<Bound<'py, PyArrayDyn<f64>>>;

fn rows<'py>(py: Python<'py>, wrenches: &[Vec6]) -> Numbers<'py> {
    let values = wrenches.iter().flat_map(|w| w.iter().copied()).collect();
    array::to_python(py, values, &[wrenches.len(), 6])
}

#[pymethods]
impl Loads {
    /// What acts: the scene's forces by what they are ("gravity", "buoyancy", "linear drag", "spring", …; all springs together, whatever the scene names them), "water" (added mass; with "isolated" none on bodies that can't move), "contact".
    #[getter]
    fn kinds(&self) -> Vec<String> {
        self.0.kinds().map(String::from).collect()
    }

    /// What one kind does to each body (bodies, 6).
    fn wrenches<'py>(&self, py: Python<'py>, kind: &str) -> Numbers<'py> {
        let found = self.0.wrenches(kind).ok_or_else(|| {
            let expected = format!("must be one of {:?}", self.kinds());
            input("loads: kind", format!("{kind:?}"), expected)
        })?;
        rows(py, found)
    }

    /// What each body gets from what carries it, across its joint (bodies, 6); of its drive and stops as well.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        rows(py, self.0.joints())
    }

    /// Those along the axes of the joints (v_size,), N or N m: what a sensor in the drive reads.
    #[getter]
    fn joint_forces<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let forces = self.0.joint_forces();
        array::to_python(py, forces.as_slice().to_vec(), &[forces.len()])
    }

    /// The generalised acceleration that all of it gives (v_size,).
    #[getter]
    fn acceleration<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let found = self.0.acceleration();
        array::to_python(py, found.as_slice().to_vec(), &[found.len()])
    }
}
