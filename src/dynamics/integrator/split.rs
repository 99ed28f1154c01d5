//! Which velocities are free in a step, and what the others are.

use super::{State, Stepper};
use crate::dynamics::Drive;
use nalgebra::{DMatrix, DVector};

/// Which velocities are free, and the values of the others.
#[derive(Clone, Debug)]
pub(crate) struct Split {
    /// Indices of free velocities.
    pub free: Vec<usize>,
    /// Full-length velocity with driven values set and zeros elsewhere.
    pub driven: DVector<f64>,
    /// Per velocity: coordinate given by a motion.
    pub moved: Vec<bool>,
    /// Per velocity: driven in any way.
    pub is_driven: Vec<bool>,
}

impl Split {
    /// Free part of a vector.
    pub fn take(&self, x: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(self.free.len(), self.free.iter().map(|&i| x[i]))
    }

    /// Scatter of a free part into zeros.
    pub fn put(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(self.driven.len());
        for (k, &i) in self.free.iter().enumerate() {
            out[i] = x[k];
        }
        out
    }

    /// A velocity with the driven entries as they are in the step.
    pub fn complete(&self, v: &DVector<f64>) -> DVector<f64> {
        &self.driven + self.put(&self.take(v))
    }

    /// Free rows and columns.
    pub fn block(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        m.select_rows(&self.free).select_columns(&self.free)
    }

    /// Zeroes the entries whose value doesn't depend on the state: given motions.
    pub fn forget_moved(&self, x: &mut DVector<f64>) {
        forget(&self.moved, x.as_mut_slice());
    }

    /// Zeroes driven entries.
    pub fn forget_driven(&self, x: &mut DVector<f64>) {
        forget(&self.is_driven, x.as_mut_slice());
    }

    /// Zeroes driven rows.
    pub fn forget_driven_rows(&self, x: &mut DMatrix<f64>) {
        x.column_iter_mut()
            .for_each(|mut x| forget(&self.is_driven, x.as_mut_slice()));
    }

    /// Zeroes rows whose value doesn't depend on the state.
    pub fn forget_moved_rows(&self, x: &mut DMatrix<f64>) {
        x.column_iter_mut()
            .for_each(|mut x| forget(&self.moved, x.as_mut_slice()));
    }

    /// Free rows of a matrix.
    pub fn take_rows(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        x.select_rows(&self.free)
    }

    /// Scatter of free rows into zeros.
    pub fn put_rows(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.driven.len(), x.ncols());
        for (k, &i) in self.free.iter().enumerate() {
            out.row_mut(i).copy_from(&x.row(k));
        }
        out
    }

    /// Sizes of free momenta, each weighed by the square root of its inertia, from the diagonal of the mass matrix.
    pub fn sizes<'s>(&'s self, inertia: &DVector<f64>) -> impl Fn(&DVector<f64>) -> f64 + use<'s> {
        let scale = self.scale(inertia);
        move |p| self.take(p).component_mul(&scale).norm()
    }

    /// Those weights.
    pub fn scale(&self, inertia: &DVector<f64>) -> DVector<f64> {
        let inertia = self.free.iter().map(|&i| inertia[i]);
        let scale = inertia.map(|d| 1.0 / d.max(f64::MIN_POSITIVE).sqrt());
        DVector::from_iterator(self.free.len(), scale)
    }
}

fn forget(entries: &[bool], x: &mut [f64]) {
    for (x, _) in x.iter_mut().zip(entries).filter(|(_, gone)| **gone) {
        *x = 0.0;
    }
}

/// A part of a size; zero of nothing.
pub(super) fn share(part: f64, size: f64) -> f64 {
    if size > 0.0 { part / size } else { 0.0 }
}

/// When a given motion's velocity is wanted.
#[derive(Clone, Copy)]
pub(super) enum When {
    /// Exactly, at a time (s).
    At(f64),
    /// As the mean over a step that starts at a time (s).
    Over(f64, f64),
}

impl Stepper<'_> {
    /// Splits velocities into free and driven ones.
    pub(super) fn split(&self, held: &[bool], when: When) -> Split {
        let nv = self.system.tree.velocities();
        let mut out = Split {
            free: Vec::new(),
            driven: DVector::zeros(nv),
            moved: vec![false; nv],
            is_driven: vec![false; nv],
        };
        let held = self.system.tree.held(held);
        for ((b, link), is_held) in self.system.tree.links().iter().enumerate().zip(held) {
            for (k, i) in link.v.clone().enumerate() {
                match &self.system.drives[b] {
                    Drive::Motion(motions) => {
                        out.moved[i] = true;
                        out.is_driven[i] = true;
                        out.driven[i] = match when {
                            When::At(t) => motions[k].rate(t),
                            When::Over(t, dt) => {
                                (motions[k].value(t + dt) - motions[k].value(t)) / dt
                            }
                        };
                    }
                    Drive::Free if !is_held => out.free.push(i),
                    _ => out.is_driven[i] = true,
                }
            }
        }
        out
    }

    /// Velocities as they are split at a state.
    pub(crate) fn split_at(&self, state: &State) -> Split {
        self.split(&state.held, When::At(self.time(state)))
    }
}
