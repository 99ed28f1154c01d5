//! Velocities that feel each other, through joints, the water or forces, and matrices that fall apart accordingly.

use super::Evaluation;
use super::fluid::FluidMomenta;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Sets of velocities none of which another set's change or force. Each ascends.
#[derive(Clone)]
pub(super) struct Islands {
    each: Arc<[Vec<usize>]>,
    /// Where each velocity stands in its island.
    places: Arc<[usize]>,
}

impl Evaluation<'_> {
    /// One where the water couples the bodies or a force may; else one for the trees of joints that forces tie together. Contact isn't asked.
    pub(super) fn islands(&self) -> Islands {
        match self.fluid {
            FluidMomenta::Coupled(_) => Islands::whole(self.system.tree.velocities()),
            _ => self.tied(self.system.smooth_forces().map(|f| f.ties()).collect()),
        }
    }

    /// The same of the dampers that are solved with contact alone.
    pub(super) fn damped_islands(&self) -> Islands {
        self.tied(self.system.dampers().map(|f| f.ties()).collect())
    }

    /// Of bodies that joints and these ties hold together; one of all where ties aren't known.
    fn tied(&self, ties: Option<Vec<Vec<[usize; 2]>>>) -> Islands {
        let tree = &self.system.tree;
        let links = tree.links();
        let Some(ties) = ties else {
            return Islands::whole(tree.velocities());
        };
        // Each body knows one that it is tied to; the first of an island knows itself.
        let mut tied: Vec<usize> = (0..links.len()).collect();
        let joints = links.iter().enumerate();
        let joints = joints.filter_map(|(b, link)| Some([link.parent?, b]));
        let led = links.iter().enumerate();
        let led = led.filter_map(|(b, link)| Some([link.follows?.leader, b]));
        for [a, b] in joints.chain(led).chain(ties.into_iter().flatten()) {
            let (a, b) = (first(&tied, a), first(&tied, b));
            tied[a.max(b)] = a.min(b);
        }
        let mut each = vec![Vec::new(); links.len()];
        for (b, link) in links.iter().enumerate() {
            tied[b] = first(&tied, b);
            each[tied[b]].extend(link.v.clone());
        }
        each.retain(|velocities| !velocities.is_empty());
        Islands::new(each, tree.velocities())
    }
}

fn first(tied: &[usize], mut b: usize) -> usize {
    while tied[b] != b {
        b = tied[b];
    }
    b
}

impl Islands {
    fn new(each: Vec<Vec<usize>>, velocities: usize) -> Self {
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
