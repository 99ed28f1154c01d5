//! Shapes, by formula, from files and from arrays.

use crate::array::{self, Dim};
use crate::error::{OrRaise, counts, input};
use crate::interrupt::short;
use crate::mesh::{Triangles, triangles};
use hydrograd::{MassProperties, TriMesh, shape};
use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyString;
use std::path::{Path, PathBuf};

/// A closed surface: made by `sphere`, `ellipsoid`, `box`, `cylinder`, `capsule`, `prism` or `mesh`.
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Shape(pub hydrograd::Shape);

#[pymethods]
impl Shape {
    /// The shape's name in a scene file.
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind()
    }

    /// Its triangles: vertices (n, 3) in m and faces (m, 3), vertex numbers counted from 0.
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Triangles<'py>> {
        triangles(py, &self.mesh(py)?)
    }

    /// Volume of the triangles, m³.
    #[getter]
    fn volume(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(MassProperties::of(&self.mesh(py)?).volume)
    }

    fn __repr__(&self) -> String {
        format!("Shape({})", shape::shape_name(&self.0))
    }
}

impl Shape {
    fn mesh(&self, py: Python<'_>) -> PyResult<TriMesh> {
        short(py, || shape::build(&self.0, Path::new(""), None))
    }

    fn checked(shape: hydrograd::Shape) -> PyResult<Self> {
        shape::validate(&shape, shape.kind()).or_raise()?;
        Ok(Self(shape))
    }
}

fn with_faces(shape: hydrograd::Shape, faces: Option<usize>) -> PyResult<Shape> {
    Shape::checked(match faces {
        Some(faces) => shape.faces(faces),
        None => shape,
    })
}

/// A sphere: radius in m. `faces` is the number of triangles wanted (default 1280), here and for the other shapes.
#[pyfunction]
#[pyo3(signature = (radius, *, faces=None))]
fn sphere(
    radius: f64,
    #[pyo3(from_py_with = counts::optional::faces)] faces: Option<usize>,
) -> PyResult<Shape> {
    with_faces(hydrograd::Shape::sphere(radius), faces)
}

/// An ellipsoid with the semi-axes a, b and c along x, y and z, in m.
#[pyfunction]
#[pyo3(signature = (a, b, c, *, faces=None))]
fn ellipsoid(
    a: f64,
    b: f64,
    c: f64,
    #[pyo3(from_py_with = counts::optional::faces)] faces: Option<usize>,
) -> PyResult<Shape> {
    with_faces(hydrograd::Shape::ellipsoid([a, b, c]), faces)
}

/// A box with the edges x, y and z, in m.
#[pyfunction(name = "box")]
#[pyo3(signature = (x, y, z, *, faces=None))]
fn cuboid(
    x: f64,
    y: f64,
    z: f64,
    #[pyo3(from_py_with = counts::optional::faces)] faces: Option<usize>,
) -> PyResult<Shape> {
    with_faces(hydrograd::Shape::cuboid([x, y, z]), faces)
}

/// A cylinder along z: radius and length in m.
#[pyfunction]
#[pyo3(signature = (radius, length, *, faces=None))]
fn cylinder(
    radius: f64,
    length: f64,
    #[pyo3(from_py_with = counts::optional::faces)] faces: Option<usize>,
) -> PyResult<Shape> {
    with_faces(hydrograd::Shape::cylinder(radius, length), faces)
}

/// A capsule along z: radius, and length without its round ends, in m.
#[pyfunction]
#[pyo3(signature = (radius, length, *, faces=None))]
fn capsule(
    radius: f64,
    length: f64,
    #[pyo3(from_py_with = counts::optional::faces)] faces: Option<usize>,
) -> PyResult<Shape> {
    with_faces(hydrograd::Shape::capsule(radius, length), faces)
}

/// A prism along x: corners (n, 2) of its convex profile in the y-z plane, and its length, in m.
#[pyfunction]
#[pyo3(signature = (profile, length, *, faces=None))]
fn prism(
    profile: &Bound<'_, PyAny>,
    length: f64,
    #[pyo3(from_py_with = counts::optional::faces)] faces: Option<usize>,
) -> PyResult<Shape> {
    let found = array::array(
        "prism: profile",
        profile,
        &[Dim::Any("corners"), Dim::Is(2)],
    )?;
    let corners: Vec<[f64; 2]> = found.values.as_chunks().0.to_vec();
    with_faces(hydrograd::Shape::prism(corners, length), faces)
}

/// A closed triangle mesh: from arrays `vertices` (n, 3) and `faces` (m, 3) of vertex numbers counted from 0,
/// counter-clockwise seen from outside; from anything that has them as attributes, such as a mesh of trimesh; or from
/// the path of an OBJ, STL, PLY or DAE file, which is read where it is wanted. `scale` is the factor from its unit to m.
#[pyfunction]
#[pyo3(signature = (vertices, faces=None, *, scale=1.0))]
fn mesh(
    vertices: &Bound<'_, PyAny>,
    faces: Option<&Bound<'_, PyAny>>,
    scale: f64,
) -> PyResult<Shape> {
    let Some(faces) = faces else {
        let is_path = vertices.is_instance_of::<PyString>() || vertices.hasattr("__fspath__")?;
        if is_path {
            let path: PathBuf = vertices.extract()?;
            // It is read when it is wanted, in whatever folder the program is then.
            let path = std::path::absolute(&path).unwrap_or(path);
            let shape = Shape::checked(hydrograd::Shape::Mesh { path, scale })?;
            // What is wrong with the file is said here, not when a simulator is made.
            shape.mesh(vertices.py())?;
            return Ok(shape);
        }
        if vertices.hasattr("vertices")? && vertices.hasattr("faces")? {
            let faces = vertices.getattr("faces")?;
            return from_arrays(&vertices.getattr("vertices")?, &faces, scale);
        }
        return Err(input(
            "mesh",
            vertices.get_type().name()?,
            "give arrays of vertices and faces, an object with both as attributes, or the path of a file",
        ));
    };
    from_arrays(vertices, faces, scale)
}

fn from_arrays(
    vertices: &Bound<'_, PyAny>,
    faces: &Bound<'_, PyAny>,
    scale: f64,
) -> PyResult<Shape> {
    if !(scale.is_finite() && scale > 0.0) {
        return Err(input("mesh: scale", scale, "must be finite and positive"));
    }
    let (py, of) = (vertices.py(), [Dim::Any("n"), Dim::Is(3)]);
    let vertices = array::array("mesh: vertices", vertices, &of)?;
    let faces = array::array("mesh: faces", faces, &of)?;
    let count = vertices.shape[0];
    let number = |x: &f64| {
        let fits = *x >= 0.0 && *x < count as f64 && x.fract() == 0.0;
        fits.then_some(*x as usize).ok_or_else(|| {
            input(
                "mesh: faces",
                x,
                format!(
                    "must be numbers of vertices, whole and from 0 to {}",
                    count.saturating_sub(1)
                ),
            )
        })
    };
    let faces = faces
        .values
        .iter()
        .map(number)
        .collect::<PyResult<Vec<usize>>>()?;
    let faces: Vec<[usize; 3]> = faces.as_chunks().0.to_vec();
    let vertices = vertices.values.as_chunks().0.iter();
    let vertices: Vec<[f64; 3]> = vertices.map(|v: &[f64; 3]| v.map(|x| x * scale)).collect();
    // What is wrong with the mesh is said here, not when a simulator is made.
    short(py, || {
        let points = vertices.iter().map(|v| Vector3::from(*v)).collect();
        TriMesh::new("of triangles", points, faces.clone())
    })?;
    Ok(Shape(hydrograd::Shape::triangles(vertices, faces)))
}

/// Adds the functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(sphere, m)?)?;
    m.add_function(wrap_pyfunction!(ellipsoid, m)?)?;
    m.add_function(wrap_pyfunction!(cuboid, m)?)?;
    m.add_function(wrap_pyfunction!(cylinder, m)?)?;
    m.add_function(wrap_pyfunction!(capsule, m)?)?;
    m.add_function(wrap_pyfunction!(prism, m)?)?;
    m.add_function(wrap_pyfunction!(mesh, m)?)
}
