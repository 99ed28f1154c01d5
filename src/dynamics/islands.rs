//! Velocities that feel each other, through joints, the water or forces, and matrices that fall apart accordingly.

use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Sets of velocities none of which another set's change or force. Each ascends.
#[derive(Clone)]
pub(super) struct Islands {
    each: Arc<[Vec<usize>]>,
    /// Where each velocity stands in its island.
    places: Arc<[usize]>,
}

impl Islands {
    /// From the velocities of each, of so many in all.
    pub fn new(each: Vec<Vec<usize>>, velocities: usize) -> Self {
        let mut places = vec![0; velocities];
        for island in &each {
            for (place, i) in island.iter().enumerate() {
                places[*i] = place;
            }
        }
        Self {
            each: each.into(),
            places: places.into(),
        }
    }

    /// One of all velocities.
    pub fn whole(velocities: usize) -> Self {
        Self::new(vec![(0..velocities).collect()], velocities)
    }

    /// Whether there is no more than one.
    pub fn is_whole(&self) -> bool {
        self.each.len() <= 1
    }

    /// Number of velocities.
    pub fn velocities(&self) -> usize {
        self.places.len()
    }

    /// The velocities of each.
    pub fn each(&self) -> impl Iterator<Item = &[usize]> {
        self.each.iter().map(Vec::as_slice)
    }

    /// Where a velocity stands in its island.
    pub fn place(&self, i: usize) -> usize {
        self.places[i]
    }

    /// Changes of the velocity that tell all columns of a matrix: the first velocities of all islands at once, the second, and so on.
    pub fn changes(&self) -> Vec<DVector<f64>> {
        let most = self.each.iter().map(Vec::len).max().unwrap_or(0);
        let mut out = vec![DVector::zeros(self.velocities()); most];
        for island in self.each.iter() {
            for (change, i) in out.iter_mut().zip(island) {
                change[*i] = 1.0;
            }
        }
        out
    }

    /// The block of each island, with its velocities, of the matrix whose products with [`Islands::changes`] these are.
    pub fn blocks<'i>(
        &'i self,
        products: &'i [DVector<f64>],
    ) -> impl Iterator<Item = (&'i [usize], DMatrix<f64>)> {
        self.each.iter().map(move |island| {
            let n = island.len();
            let block = DMatrix::from_fn(n, n, |i, k| products[k][island[i]]);
            (island.as_slice(), block)
        })
    }

    /// The matrix whose products with [`Islands::changes`] these are.
    pub fn matrix(&self, products: &[DVector<f64>]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.velocities(), self.velocities());
        for (island, block) in self.blocks(products) {
            for (k, column) in island.iter().zip(block.column_iter()) {
                for (i, x) in island.iter().zip(column.iter()) {
                    out[(*i, *k)] = *x;
                }
            }
        }
        out
    }
}
