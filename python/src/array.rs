//! Numbers from Python and arrays to Python, with errors that name what was given.

use crate::error::input;
use hydrograd::simulate::FLOW_POINTS;
use nalgebra::{DMatrix, DVector, Vector3};
use numpy::{
    PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// What a shape may be: a number, or any with a name.
#[derive(Clone, Copy)]
pub enum Dim {
    /// Exactly this many.
    Is(usize),
    /// Any number of what is named.
    Any(&'static str),
}

/// Numbers in the order of C with their shape.
pub struct Array {
    /// The numbers, last index fastest.
    pub values: Vec<f64>,
    /// The shape.
    pub shape: Vec<usize>,
}

impl Array {
    /// As a matrix with the first index as columns: (steps, n) becomes n × steps.
    pub fn columns(self, rows: usize) -> DMatrix<f64> {
        let columns = self.shape.first().copied().unwrap_or(0);
        DMatrix::from_vec(rows, columns, self.values)
    }
}

/// Whole, real or Boolean numbers as double precision; anything else is refused.
fn numbers<'py>(place: &str, given: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let py = given.py();
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (given,)).map_err(|e| {
        // Whatever NumPy makes of it (ragged lists, objects that raise): only a stop by the user goes through.
        if e.is_instance_of::<pyo3::exceptions::PyException>(py) {
            input(
                place,
                type_name(given),
                format!("must be numbers; NumPy says: {}", e.value(py)),
            )
        } else {
            e
        }
    })?;
    let array = array.cast_into::<PyUntypedArray>()?;
    let kind: char = array.dtype().getattr("kind")?.extract()?;
    if !"fiub".contains(kind) {
        return Err(input(
            place,
            format!("an array of dtype {}", array.dtype()),
            "must hold real numbers (float or int)",
        ));
    }
    let options = PyDict::new(py);
    options.set_item("dtype", "float64")?;
    options.set_item("order", "C")?;
    let array = numpy.call_method("require", (array, "float64", "C"), None)?;
    Ok(array.cast_into::<PyArrayDyn<f64>>()?.readonly())
}

fn type_name(given: &Bound<'_, PyAny>) -> String {
    match given.get_type().name() {
        Ok(name) => format!("a value of type {name}"),
        Err(_) => "a value".into(),
    }
}

fn wanted(shape: &[Dim]) -> String {
    let parts: Vec<String> = shape
        .iter()
        .map(|d| match d {
            Dim::Is(n) => n.to_string(),
            Dim::Any(name) => (*name).to_string(),
        })
        .collect();
    let comma = if parts.len() == 1 { "," } else { "" };
    format!("({}{comma})", parts.join(", "))
}

fn shown(shape: &[usize]) -> String {
    let parts: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if parts.len() == 1 { "," } else { "" };
    format!("({}{comma})", parts.join(", "))
}

/// Finite numbers of the shape wanted.
pub fn array(place: &str, given: &Bound<'_, PyAny>, shape: &[Dim]) -> PyResult<Array> {
    let found = numbers(place, given)?;
    let fits = found.shape().len() == shape.len()
        && found.shape().iter().zip(shape).all(|(n, d)| match d {
            Dim::Is(m) => n == m,
            Dim::Any(_) => true,
        });
    if !fits {
        return Err(input(
            place,
            format!("an array of shape {}", shown(found.shape())),
            format!("must have the shape {}", wanted(shape)),
        ));
    }
    let values = found.as_slice()?.to_vec();
    if let Some(at) = values.iter().position(|x| !x.is_finite()) {
        let mut rest = at;
        let mut index = vec![0; found.shape().len()];
        for (i, n) in found.shape().iter().enumerate().rev() {
            index[i] = rest % n;
            rest /= n;
        }
        return Err(input(
            format!("{place}{index:?}"),
            values[at],
            "must be finite",
        ));
    }
    Ok(Array {
        shape: found.shape().to_vec(),
        values,
    })
}

/// `N` finite numbers.
pub fn fixed<const N: usize>(place: &str, given: &Bound<'_, PyAny>) -> PyResult<[f64; N]> {
    let found = array(place, given, &[Dim::Is(N)])?;
    Ok(std::array::from_fn(|i| found.values[i]))
}

/// `N` finite numbers, or zeros where nothing is given.
pub fn or_zeros<const N: usize>(
    place: &str,
    given: Option<&Bound<'_, PyAny>>,
) -> PyResult<[f64; N]> {
    given.map_or(Ok([0.0; N]), |given| fixed(place, given))
}

/// One row of numbers, or many.
#[derive(Clone)]
pub struct Rows {
    /// The rows.
    pub values: Vec<DVector<f64>>,
    /// Numbers of a row: known where there is none as well.
    pub size: usize,
    /// Whether they have an index of their own.
    pub is_many: bool,
}

impl Rows {
    /// One.
    pub fn one(row: DVector<f64>) -> Self {
        Self {
            size: row.len(),
            values: vec![row],
            is_many: false,
        }
    }

    /// Those given, or this one.
    pub fn or(
        place: &str,
        given: Option<&Bound<'_, PyAny>>,
        default: &DVector<f64>,
    ) -> PyResult<Self> {
        match given {
            Some(given) => rows(place, given, default.len()),
            None => Ok(Self::one(default.clone())),
        }
    }

    /// Row `i`, or the one for all.
    pub fn row(&self, i: usize) -> &DVector<f64> {
        &self.values[if self.is_many { i } else { 0 }]
    }

    /// As an array.
    pub fn to_python<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let n = self.size;
        let all = self.values.iter().flat_map(|row| row.as_slice().to_vec());
        match self.is_many {
            true => to_python(py, all.collect(), &[self.values.len(), n]),
            false => to_python(py, all.collect(), &[n]),
        }
    }
}

/// Rows of `n` finite numbers: (n,) is one, (N, n) are many.
pub fn rows(place: &str, given: &Bound<'_, PyAny>, n: usize) -> PyResult<Rows> {
    let is_many = numbers(place, given)?.shape().len() == 2;
    let found = match is_many {
        true => array(place, given, &[Dim::Any("N"), Dim::Is(n)])?,
        false => array(place, given, &[Dim::Is(n)])?,
    };
    let count = if is_many { found.shape[0] } else { 1 };
    let values = (0..count).map(|i| DVector::from_column_slice(&found.values[i * n..(i + 1) * n]));
    Ok(Rows {
        values: values.collect(),
        size: n,
        is_many,
    })
}

/// Any number of finite numbers in a row.
pub fn row(place: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    Ok(array(place, given, &[Dim::Any("n")])?.values)
}

/// Points of space.
pub fn vectors(place: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Vector3<f64>>> {
    // Before anything is copied.
    let shape = given
        .getattr("shape")
        .and_then(|s| s.extract::<Vec<usize>>());
    let count = shape.ok().and_then(|shape| shape.first().copied());
    if let Some(count) = count.filter(|count| *count > FLOW_POINTS) {
        let expected = format!("must be at most {FLOW_POINTS}: ask for them in parts");
        return Err(input(format!("{place}: their number"), count, expected));
    }
    let found = array(place, given, &[Dim::Any("n"), Dim::Is(3)])?;
    Ok(found
        .values
        .chunks(3)
        .map(Vector3::from_column_slice)
        .collect())
}

/// The one meant by a number that counts from the end if it is negative.
pub fn numbered(number: isize, count: usize, what: &str) -> PyResult<usize> {
    let at = if number < 0 {
        number + count as isize
    } else {
        number
    };
    let found = usize::try_from(at).ok().filter(|at| *at < count);
    found.ok_or_else(|| {
        let message = format!("{what} {number} of a rollout that has {count}");
        pyo3::exceptions::PyIndexError::new_err(message)
    })
}

/// A new array of this shape from numbers in the order of C.
pub fn to_python<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    PyArray1::from_vec(py, values).reshape(shape)
}

/// Columns of a matrix as the first index: n × steps becomes (steps, …) with `inner` the shape of a column.
pub fn transposed<'py>(
    py: Python<'py>,
    matrix: &DMatrix<f64>,
    inner: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let mut shape = vec![matrix.ncols()];
    shape.extend(inner);
    to_python(py, matrix.as_slice().to_vec(), &shape)
}

/// A matrix as it stands: rows first.
pub fn matrix<'py>(
    py: Python<'py>,
    matrix: &DMatrix<f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let values = matrix.transpose().as_slice().to_vec();
    to_python(py, values, &[matrix.nrows(), matrix.ncols()])
}

/// Rows of one length, one below the other.
pub fn columns<'py>(
    py: Python<'py>,
    each: &[DVector<f64>],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let n = each.first().map_or(0, DVector::len);
    let all = each.iter().flat_map(|x| x.iter().copied()).collect();
    to_python(py, all, &[each.len(), n])
}

/// Matrices of one shape, the first index their number.
pub fn matrices<'py>(
    py: Python<'py>,
    each: &[DMatrix<f64>],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let (rows, cols) = each.first().map_or((0, 0), |m| m.shape());
    let all = each.iter().flat_map(|m| m.transpose().as_slice().to_vec());
    to_python(py, all.collect(), &[each.len(), rows, cols])
}
