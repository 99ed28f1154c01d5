//! Mappings of names: dictionaries, and whatever else is a `collections.abc.Mapping`.

use crate::error::input;
use pyo3::conversion::FromPyObjectOwned;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use std::collections::BTreeMap;

/// A mapping as a dictionary: a copy, unless it is one.
fn dict<'py>(place: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    if let Ok(dict) = given.cast::<PyDict>() {
        return Ok(dict.clone());
    }
    let Ok(mapping) = given.cast::<PyMapping>() else {
        let what = format!("a value of type {}", given.get_type().name()?);
        return Err(input(
            place,
            what,
            "must be a mapping of names, such as a dict",
        ));
    };
    let dict = PyDict::new(given.py());
    dict.update(mapping)?;
    Ok(dict)
}

/// The values of a mapping by name, where there is one; `value` says what each must be.
pub fn named<'py, T: FromPyObjectOwned<'py>>(
    place: &str,
    value: &str,
    given: Option<&Bound<'py, PyAny>>,
) -> PyResult<BTreeMap<String, T>> {
    let Some(given) = given else {
        return Ok(BTreeMap::new());
    };
    let one = |(name, given): (Bound<'py, PyAny>, Bound<'py, PyAny>)| {
        let Ok(name) = name.extract::<String>() else {
            return Err(input(place, name.repr()?, "must have names as keys"));
        };
        match given.extract::<T>() {
            Ok(found) => Ok((name, found)),
            Err(_) => Err(input(
                format!("{place}[{name:?}]"),
                given.repr()?,
                format!("must be {value}"),
            )),
        }
    };
    dict(place, given)?.iter().map(one).collect()
}
