//! Exceptions: one tree under `hydrograd.Error`, each with the message of the Rust side.

use pyo3::exceptions::{PyException, PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple, PyType};

/// Names of the exceptions, the built-in one that each also is, and what they say.
const KINDS: [(&str, Option<Builtin>, &str); 9] = [
    (
        "InputError",
        Some(Builtin::Value),
        "A value that can't be used: the message names the place, the value and what would be right.",
    ),
    (
        "MeshError",
        None,
        "A surface mesh that doesn't bound a volume, or bounds it badly.",
    ),
    (
        "FileError",
        Some(Builtin::Os),
        "A file that can't be read, written or understood.",
    ),
    (
        "SolverError",
        None,
        "A linear or nonlinear solve that didn't reach its tolerance.",
    ),
    (
        "UnresolvedError",
        None,
        "The physics left what the discretisation or the time step resolves.",
    ),
    (
        "UnsupportedError",
        None,
        "A combination of settings that has no meaning or isn't offered.",
    ),
    (
        "DeviceError",
        None,
        "A GPU that isn't there, can't do what is needed, or failed.",
    ),
    (
        "BatchError",
        None,
        "Members of a batch that failed. `errors` has each one's error by its number, counted from 0, with its `step` and `time` (s) where they are \
         known; `members` has all of the batch: what ran, of a rollout that failed as far as it came, and None where there is nothing.",
    ),
    (
        "InternalError",
        None,
        "A fault of hydrograd itself; please report it with its message.",
    ),
];

#[derive(Clone, Copy)]
enum Builtin {
    Value,
    Os,
}

static BASE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static CLASSES: PyOnceLock<Vec<Py<PyType>>> = PyOnceLock::new();

fn base(py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
    let made = BASE.get_or_try_init(py, || {
        let doc = c"Base of all errors of hydrograd.";
        let class = PyErr::new_type(
            py,
            c"hydrograd.Error",
            Some(doc),
            Some(&py.get_type::<PyException>()),
            None,
        )?;
        PyResult::Ok(class)
    })?;
    Ok(made.bind(py))
}

fn classes(py: Python<'_>) -> PyResult<&Vec<Py<PyType>>> {
    CLASSES.get_or_try_init(py, || KINDS.iter().map(|kind| class(py, kind)).collect())
}

/// One exception class: `type(name, bases, {...})`, because some have two bases.
fn class(
    py: Python<'_>,
    (name, builtin, doc): &(&str, Option<Builtin>, &str),
) -> PyResult<Py<PyType>> {
    let base = base(py)?;
    let bases = match builtin {
        None => PyTuple::new(py, [base.clone()])?,
        Some(Builtin::Value) => PyTuple::new(py, [base.clone(), py.get_type::<PyValueError>()])?,
        Some(Builtin::Os) => PyTuple::new(py, [base.clone(), py.get_type::<PyOSError>()])?,
    };
    let namespace = PyDict::new(py);
    namespace.set_item("__doc__", doc)?;
    namespace.set_item("__module__", "hydrograd")?;
    let made = py.get_type::<PyType>().call1((*name, bases, namespace))?;
    Ok(made.cast_into::<PyType>()?.unbind())
}

/// An exception of the kind named, with a message.
fn raise(name: &str, message: String) -> PyErr {
    Python::attach(|py| {
        let at = KINDS.iter().position(|(kind, ..)| *kind == name);
        match (classes(py), at) {
            (Ok(classes), Some(at)) => PyErr::from_type(classes[at].bind(py).clone(), message),
            (Err(error), _) => error,
            (_, None) => PyException::new_err(message),
        }
    })
}

/// The exception of an error of the Rust side.
pub fn exception(error: hydrograd::Error) -> PyErr {
    use hydrograd::Error;
    let error = match error {
        Error::Controller { source } => match source.downcast::<PyErr>() {
            Ok(raised) => return *raised,
            Err(source) => Error::Controller { source },
        },
        error => error,
    };
    let name = match &error {
        Error::Input { .. } => "InputError",
        Error::Mesh { .. } => "MeshError",
        Error::File { .. } | Error::Parse { .. } => "FileError",
        Error::Solver { .. } => "SolverError",
        Error::Unresolved { .. } => "UnresolvedError",
        Error::Unsupported { .. } => "UnsupportedError",
        Error::Device { .. } => "DeviceError",
        _ => "InternalError",
    };
    raise(name, error.to_string())
}

/// Whether it is an `Error` of hydrograd's.
pub fn own(py: Python<'_>, error: &PyErr) -> bool {
    base(py).is_ok_and(|class| error.is_instance(py, class))
}

/// A `BatchError`, from all members of a batch and the errors of those that failed, by number.
pub fn batch<'py>(
    py: Python<'py>,
    message: String,
    members: Bound<'py, PyAny>,
    errors: Bound<'py, PyDict>,
) -> PyErr {
    let error = raise("BatchError", message);
    let value = error.value(py);
    let set = value
        .setattr("members", members)
        .and_then(|()| value.setattr("errors", errors));
    set.map_or_else(|failed| failed, |()| error)
}

/// An `InputError`: what was given where, and what would be right.
pub fn input(
    place: impl Into<String>,
    value: impl std::fmt::Display,
    expected: impl Into<String>,
) -> PyErr {
    exception(hydrograd::Error::input(place, value, expected))
}

/// What was given, as Python writes it.
pub fn shown(given: &Bound<'_, PyAny>) -> String {
    given.repr().map_or("?".into(), |r| r.to_string())
}

/// Counts that are given by keyword: what can't be one is an `InputError` that names it.
pub mod counts {
    use super::{input, shown};
    use pyo3::prelude::*;

    fn count<'py, T: FromPyObjectOwned<'py>>(
        keyword: &str,
        given: &Bound<'py, PyAny>,
    ) -> PyResult<T> {
        given.extract::<T>().map_err(|_| {
            let expected = "must be a whole number that isn't negative";
            input(keyword, shown(given), expected)
        })
    }

    macro_rules! keywords {
        ($($keyword:ident: $number:ty),*) => {
            $(pub fn $keyword(given: &Bound<'_, PyAny>) -> PyResult<$number> {
                count(stringify!($keyword), given)
            })*
        };
    }
    keywords!(
        directions: usize, entry: usize, evaluations: usize, every: usize, first_iterations: usize, hold: usize, index: usize, iterations: usize,
        knots: usize, memory: usize, mode: usize, most_steps: usize, profiles: usize, seed: u64, shift: usize, step: usize, steps: usize, trials: usize
    );

    /// Those that may be left out.
    pub mod optional {
        use super::*;

        macro_rules! keywords {
            ($($keyword:ident),*) => {
                $(pub fn $keyword(given: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
                    let some = (!given.is_none()).then(|| count(stringify!($keyword), given));
                    some.transpose()
                })*
            };
        }
        keywords!(
            evaluations,
            faces,
            knots,
            pushes,
            rank,
            reference_faces,
            search,
            starts,
            steps
        );
    }

    /// A list of them.
    fn list(keyword: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
        let each = |(k, one): (usize, PyResult<Bound<'_, PyAny>>)| {
            count(&format!("{keyword}[{k}]"), &one?)
        };
        given.try_iter()?.enumerate().map(each).collect()
    }

    pub fn entries(given: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
        list("entries", given)
    }

    /// Lists that may be left out.
    pub mod lists {
        use super::*;

        macro_rules! keywords {
            ($($keyword:ident),*) => {
                $(pub fn $keyword(given: &Bound<'_, PyAny>) -> PyResult<Option<Vec<usize>>> {
                    let some = (!given.is_none()).then(|| list(stringify!($keyword), given));
                    some.transpose()
                })*
            };
        }
        keywords!(faces, ranks);
    }
}

/// An `InternalError`: what a panic said.
pub fn internal(message: &str) -> PyErr {
    raise(
        "InternalError",
        format!("hydrograd failed unexpectedly: {message}; please report this"),
    )
}

/// A result of the Rust side for Python.
pub trait OrRaise<T> {
    /// The value, or the exception of its error.
    fn or_raise(self) -> PyResult<T>;
}

impl<T> OrRaise<T> for hydrograd::Result<T> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(exception)
    }
}

/// Adds the exceptions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = m.py();
    m.add("Error", base(py)?)?;
    for ((name, ..), class) in KINDS.iter().zip(classes(py)?) {
        m.add(*name, class.bind(py))?;
    }
    Ok(())
}

/// All results of work spread over threads, or the first error in their order, whichever thread came first.
pub fn in_order<T: Send>(
    each: impl rayon::iter::ParallelIterator<Item = hydrograd::Result<T>>,
) -> hydrograd::Result<Vec<T>> {
    let all: Vec<hydrograd::Result<T>> = each.collect();
    all.into_iter().collect()
}
