//! What compressed bodies are made of: sources, and in a plate pairs of them.
//!
//! A plate that moves across itself draws in on one side what it gives off on the other, and the two sides are nearer to each other than to anything that they are
//! fitted to. As single sources their fields are all but the same; their sum and their difference aren't, and each is worth a choice of its own.

use super::samples::Candidate;
use crate::adjoint::lie::Vec3;
use faer::Mat;

/// A combination of sources, by their numbers.
#[derive(Clone, Copy)]
enum Column {
    One(usize),
    /// The sum of two, or their difference: the second one's factor.
    Two(usize, usize, f64),
}

/// Where sources may be, and in which combinations.
pub(super) struct Sources {
    pub points: Vec<Vec3>,
    columns: Vec<Column>,
}

impl Sources {
    pub fn new(candidates: &[Candidate]) -> Self {
        let (mut points, mut columns) = (Vec::new(), Vec::new());
        for candidate in candidates {
            let first = points.len();
            points.push(candidate.point);
            match candidate.partner {
                None => columns.push(Column::One(first)),
                Some(partner) => {
                    points.push(partner);
                    columns.extend([1.0, -1.0].map(|s| Column::Two(first, first + 1, s)));
                }
            }
        }
        Self { points, columns }
    }

    /// Fields of the combinations, from those of the sources (columns).
    pub fn columns(&self, fields: &Mat<f64>) -> Mat<f64> {
        Mat::from_fn(fields.nrows(), self.columns.len(), |i, k| {
            match self.columns[k] {
                Column::One(a) => fields[(i, a)],
                Column::Two(a, b, s) => fields[(i, a)] + s * fields[(i, b)],
            }
        })
    }

    /// The sources in some of the combinations, and the strength of each in each of these: sources × combinations.
    pub fn chosen(&self, columns: &[usize]) -> (Vec<Vec3>, Mat<f64>) {
        let mut used: Vec<usize> = Vec::new();
        let mut entries = Vec::new();
        for (k, column) in columns.iter().enumerate() {
            let parts = match self.columns[*column] {
                Column::One(a) => vec![(a, 1.0)],
                Column::Two(a, b, s) => vec![(a, 1.0), (b, s)],
            };
            for (source, strength) in parts {
                let row = used.iter().position(|u| *u == source);
                let row = row.unwrap_or_else(|| {
                    used.push(source);
                    used.len() - 1
                });
                entries.push((row, k, strength));
            }
        }
        let mut spread = Mat::zeros(used.len(), columns.len());
        for (row, k, strength) in entries {
            spread[(row, k)] = strength;
        }
        (used.iter().map(|u| self.points[*u]).collect(), spread)
    }
}
