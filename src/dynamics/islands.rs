//! Velocities that feel each other, through joints, the water or forces, and matrices that fall apart accordingly.

use super::Evaluation;
use super::fluid::FluidMomenta;
use nalgebra::{DMatrix, DVector};

/// Sets of velocities none of which another set's change or force. Each ascends.
pub(super) struct Islands {
    each: Vec<Vec<usize>>,
    velocities: usize,
}

impl Evaluation<'_> {
    /// One where the water couples the bodies or a force may; else one for the trees of joints that forces tie together. Contact isn't asked.
    pub(super) fn islands(&self) -> Islands {
        let (system, links) = (self.system, self.system.tree.links());
        let velocities = system.tree.velocities();
        let coupled = matches!(
            self.fluid,
            FluidMomenta::Coupled(_) | FluidMomenta::Scattered(_)
        );
        let ties: Option<Vec<_>> = match coupled {
            true => None,
            false => system.smooth_forces().map(|f| f.ties()).collect(),
        };
        let Some(ties) = ties else {
            let each = vec![(0..velocities).collect()];
            return Islands { each, velocities };
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
        Islands { each, velocities }
    }
}

fn first(tied: &[usize], mut b: usize) -> usize {
    while tied[b] != b {
        b = tied[b];
    }
    b
}

impl Islands {
    /// Changes of the velocity that tell all columns of a matrix: the first velocities of all islands at once, the second, and so on.
    pub fn changes(&self) -> Vec<DVector<f64>> {
        let most = self.each.iter().map(Vec::len).max().unwrap_or(0);
        let mut out = vec![DVector::zeros(self.velocities); most];
        for island in &self.each {
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
        let mut out = DMatrix::zeros(self.velocities, self.velocities);
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
