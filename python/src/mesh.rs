//! Triangles as arrays.

use crate::array;
use hydrograd::TriMesh;
use pyo3::prelude::*;

/// Vertices (n, 3) in m and faces (m, 3), vertex numbers counted from 0.
pub type Triangles<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// The triangles of a mesh.
pub fn triangles<'py>(py: Python<'py>, mesh: &TriMesh) -> PyResult<Triangles<'py>> {
    let numbers = mesh.vertices().iter().flat_map(|v| [v.x, v.y, v.z]);
    let vertices = array::to_python(py, numbers.collect(), &[mesh.vertices().len(), 3])?;
    let faces: Vec<i64> = mesh.faces().iter().flatten().map(|v| *v as i64).collect();
    let faces =
        numpy::PyArray1::from_vec(py, faces).call_method1("reshape", (mesh.faces().len(), 3))?;
    Ok((vertices.into_any(), faces))
}
