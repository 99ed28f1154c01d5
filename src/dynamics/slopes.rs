//! Dense derivatives of a vector with an entry per velocity, and tangents along many directions at once.
//!
//! A tangent of a step needs the derivatives of forces, momenta and contact in all that they depend on. Their rows are the gradients of single
//! entries, made together: what doesn't depend on the entry is computed once, and the water answers all entries in one go. Then
//! a column for each direction costs a product of small matrices.

use super::{ForceCotangents, Parameters};
use nalgebra::{DMatrix, DVector};

/// Derivatives of a vector with an entry per velocity.
#[derive(Clone, Debug)]
pub struct Slopes {
    /// With respect to q, in its tangent space: nv × nv.
    pub q: DMatrix<f64>,
    /// To v, nv × nv.
    pub v: DMatrix<f64>,
    /// To the controls, nv × controls.
    pub control: DMatrix<f64>,
    /// To the parameters, nv × parameters.
    pub parameters: DMatrix<f64>,
}

/// Tangents of what stays the same in the course of a step, a column for each direction.
#[derive(Clone, Debug, PartialEq)]
pub struct InputTangents {
    /// Of the controls, controls × K.
    pub control: DMatrix<f64>,
    /// Of the parameters, parameters × K; without rows where none changes.
    pub parameters: DMatrix<f64>,
}

impl Slopes {
    /// From the gradients of the entries `entries`; the others have none.
    pub(super) fn from_rows(
        velocities: usize,
        entries: &[usize],
        rows: &[ForceCotangents],
        zero: &ForceCotangents,
    ) -> Self {
        let matrix = |of: &dyn Fn(&ForceCotangents) -> &[f64]| {
            let mut out = DMatrix::zeros(velocities, of(zero).len());
            for (i, row) in entries.iter().zip(rows) {
                out.row_mut(*i).copy_from_slice(of(row));
            }
            out
        };
        Self {
            q: matrix(&|r| r.q.as_slice()),
            v: matrix(&|r| r.v.as_slice()),
            control: matrix(&|r| r.control.as_slice()),
            parameters: matrix(&|r| r.parameters.as_slice()),
        }
    }

    /// The tangents along those of q, of v if it changes, and of the inputs.
    pub(super) fn along(
        &self,
        q: &DMatrix<f64>,
        v: Option<&DMatrix<f64>>,
        inputs: &InputTangents,
    ) -> DMatrix<f64> {
        let mut out = &self.q * q;
        if let Some(v) = v {
            out += &self.v * v;
        }
        out += &self.control * &inputs.control;
        if inputs.has_parameters() {
            out += &self.parameters * &inputs.parameters;
        }
        out
    }
}

impl InputTangents {
    /// Along `columns` directions in which nothing of them changes.
    pub fn zeros(controls: usize, columns: usize) -> Self {
        Self {
            control: DMatrix::zeros(controls, columns),
            parameters: DMatrix::zeros(0, columns),
        }
    }

    /// Whether any parameter changes.
    pub fn has_parameters(&self) -> bool {
        self.parameters.nrows() > 0
    }

    /// The parameters' part of a cotangent's products with the directions.
    pub(super) fn of_parameters(&self, bar: &Parameters) -> DVector<f64> {
        match self.has_parameters() {
            false => DVector::zeros(self.parameters.ncols()),
            true => (self.parameters).tr_mul(&DVector::from_column_slice(bar.as_slice())),
        }
    }
}

/// A unit vector.
pub(super) fn unit(length: usize, at: usize) -> DVector<f64> {
    DVector::from_fn(length, |i, _| f64::from(i == at))
}

/// A map of columns.
pub(super) fn columns(
    m: &DMatrix<f64>,
    map: impl Fn(&DVector<f64>) -> DVector<f64>,
) -> DMatrix<f64> {
    let mut out = m.clone();
    for (mut to, from) in out.column_iter_mut().zip(m.column_iter()) {
        to.copy_from(&map(&from.into_owned()));
    }
    out
}
