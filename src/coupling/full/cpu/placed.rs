//! The coupled system at given poses: what all solutions there share.

use super::super::Model;
use super::Cpu;
use super::system::{Solved, System};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec6};
use crate::boundary::BodyBoundary;
use crate::coupling::Reached;
use crate::coupling::pair::Pair;
use crate::coupling::response::{self, body_twists, moves};
use crate::solver::Columns;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::sync::Arc;

/// The system at given poses.
pub(super) struct PlacedBodies<'a> {
    pub model: &'a Model,
    pub poses: Vec<Pose>,
    pub pairs: Vec<Pair>,
    pub system: System<'a>,
    /// Pᵀ B₆ of each body that the first twists move, over all sources.
    pub readout: Vec<Option<Columns>>,
}

/// Twists, 6·bodies × k, and what they make.
pub(super) struct Solution {
    pub twists: DMatrix<f64>,
    pub solved: Solved,
    pub reached: Reached,
}

impl<'a> PlacedBodies<'a> {
    /// For twists that move the same bodies as these, or fewer.
    pub fn new(cpu: &'a Cpu, poses: &[Pose], twists: &DMatrix<f64>) -> Self {
        let model = &*cpu.model;
        let pairs = model.pairs(poses);
        Self {
            model,
            poses: poses.to_vec(),
            system: System::new(cpu, &pairs),
            readout: readouts(model, &pairs, twists),
            pairs,
        }
    }

    /// Pᵀ B x̄ of columns of twists, sources × k.
    pub fn source_side(&self, twists: &DMatrix<f64>) -> Columns {
        let mut out = Columns::zeros(self.model.columns(), twists.ncols());
        for (b, readout) in self.readout.iter().enumerate() {
            let Some(readout) = readout.as_ref().filter(|_| moves(twists, b)) else {
                continue;
            };
            let twists = body_twists(twists, b);
            for j in 0..out.rows {
                let row = Vec6::from_row_slice(readout.row(j));
                for (x, twist) in out.slice_mut(&(j..j + 1)).iter_mut().zip(&twists) {
                    *x += row.dot(twist);
                }
            }
        }
        out
    }

    /// F x̄ of columns of twists, faces × k.
    pub fn face_side(&self, twists: &DMatrix<f64>) -> Columns {
        let mut out = Columns::zeros(self.model.rows(), twists.ncols());
        for (b, body) in self.model.bodies.iter().enumerate() {
            if moves(twists, b) {
                let rows = body.twist_rows(&body_twists(twists, b));
                out.slice_mut(&self.model.faces[b]).copy_from_slice(&rows);
            }
        }
        out
    }

    /// Solves for columns of twists.
    pub fn solve(&self, twists: DMatrix<f64>) -> Result<Solution> {
        let (f, g) = (self.face_side(&twists), self.source_side(&twists));
        let (solved, reached) = self.system.respond(&f, &g)?;
        Ok(Solution {
            twists,
            solved,
            reached,
        })
    }

    /// ½ {B₆ᵀ P a + F₆ᵀ μ} of one column: body-frame impulses of all bodies, zero for those without a
    /// readout.
    pub fn impulse(&self, solved: &Solved, column: usize) -> DVector<f64> {
        let (a, mu) = (solved.a.column(column), solved.mu.column(column));
        let mut out = DVector::zeros(6 * self.model.bodies.len());
        for (b, body) in self.model.bodies.iter().enumerate() {
            let Some(readout) = &self.readout[b] else {
                continue;
            };
            let mut h = Vec6::zeros();
            for (j, strength) in a.iter().enumerate() {
                h += Vec6::from_row_slice(readout.row(j)) * *strength;
            }
            let range = self.model.faces[b].clone();
            for (row, m) in body.twist_rows.iter().zip(&mu[range]) {
                h += row * *m;
            }
            out.fixed_rows_mut::<6>(6 * b).copy_from(&(0.5 * h));
        }
        out
    }
}

impl Solution {
    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.twists.ncols()
    }

    /// One column from coefficients on those there are.
    pub fn combine(&self, coefficients: &DVector<f64>) -> Self {
        let c = coefficients.as_slice();
        Self {
            twists: response::combined(&self.twists, coefficients),
            solved: each(|part| Columns::from_columns(&[&part(&self.solved).combine(c)])),
            reached: self.reached,
        }
    }

    /// Single columns side by side.
    pub fn beside(parts: &[Self]) -> Self {
        let reached = parts.iter().map(|p| p.reached);
        Self {
            twists: response::beside(parts.iter().map(|p| &p.twists)),
            solved: each(|part| {
                let columns = parts.iter().map(|p| part(&p.solved).data.as_slice());
                Columns::from_columns(&columns.collect::<Vec<_>>())
            }),
            reached: reached.fold(Reached::default(), Reached::worst),
        }
    }
}

/// All four from the same of others.
fn each(make: impl Fn(fn(&Solved) -> &Columns) -> Columns) -> Solved {
    Solved {
        a: make(|s| &s.a),
        lambda: make(|s| &s.lambda),
        r: make(|s| &s.r),
        mu: make(|s| &s.mu),
    }
}

/// μ, then r, of the faces of a body, `[face][μ.., r..]`.
pub(super) fn beside(mu: &Columns, r: &Columns, faces: &Range<usize>) -> Vec<f64> {
    let rows = faces.clone().map(|i| mu.row(i).iter().chain(r.row(i)));
    rows.flatten().copied().collect()
}

/// Pᵀ B₆ of each moving body over all sources: its own block and every image that its faces see.
fn readouts(model: &Model, pairs: &[Pair], twists: &DMatrix<f64>) -> Vec<Option<Columns>> {
    let own = |(b, body): (usize, &Arc<BodyBoundary>)| {
        moves(twists, b).then(|| {
            let mut columns = Columns::zeros(model.columns(), 6);
            let rows = columns.slice_mut(&model.sources[b]).chunks_exact_mut(6);
            rows.zip(&body.readout)
                .for_each(|(row, p)| row.copy_from_slice(p.as_slice()));
            columns
        })
    };
    let mut out: Vec<_> = model.bodies.iter().enumerate().map(own).collect();
    for pair in pairs {
        let body = &model.bodies[pair.target];
        if let Some(columns) = &mut out[pair.target] {
            let part = body.potential(&pair.points, &body.readout_rows(&unit_twists()), 6);
            let target = columns.slice_mut(&model.sources[pair.source]);
            target.iter_mut().zip(part).for_each(|(t, p)| *t += p);
        }
    }
    out
}

/// The six unit twists.
pub(super) fn unit_twists() -> [Vec6; 6] {
    std::array::from_fn(|k| Vec6::ith(k, 1.0))
}
