//! Matrices with a block for each joint on the diagonal.

use nalgebra::DMatrix;

/// Such a matrix, without the zeros between joints.
#[derive(Clone, Debug, PartialEq)]
pub struct JointBlocks {
    velocities: usize,
    /// Each with the number of its joint's first velocity.
    blocks: Vec<(usize, DMatrix<f64>)>,
}

impl JointBlocks {
    /// Of joints with so many velocities in all, none of which has a block yet.
    pub(super) fn new(velocities: usize) -> Self {
        Self {
            velocities,
            blocks: Vec::new(),
        }
    }

    /// Adds the block of the joint whose first velocity is `start`.
    pub(super) fn push(&mut self, start: usize, block: DMatrix<f64>) {
        self.blocks.push((start, block));
    }

    /// Its product with some columns; rows of joints without a block stay.
    pub fn times(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = m.clone();
        for (start, block) in &self.blocks {
            let own = block * m.rows(*start, block.nrows());
            out.rows_mut(*start, block.nrows()).copy_from(&own);
        }
        out
    }

    /// Its entries within the blocks: row, column, value.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.blocks.iter().flat_map(|(start, block)| {
            let n = block.nrows();
            let each = block.iter().enumerate();
            each.map(move |(at, x)| (start + at % n, start + at / n, *x))
        })
    }

    /// All of it, velocities × velocities.
    pub fn dense(&self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.velocities, self.velocities);
        for (i, j, x) in self.entries() {
            out[(i, j)] = x;
        }
        out
    }
}
