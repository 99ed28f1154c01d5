//! Which velocities feel each other, and the mass matrix by these islands.

use super::Evaluation;
use super::fluid::FluidMomenta;
use super::island_matrix::{IslandMatrix, MANY};
use super::islands::Islands;
use crate::once::once;

impl Evaluation<'_> {
    /// One where the water couples the bodies or a force may; else one for the trees of joints that forces tie together. Contact isn't asked, nor what many bodies
    /// exchange by products.
    pub(super) fn islands(&self) -> Islands {
        match self.fluid {
            FluidMomenta::Coupled(_) => Islands::whole(self.system.tree.velocities()),
            _ => self.tied(self.system.smooth_forces().map(|f| f.ties()).collect()),
        }
    }

    /// The same, what many bodies exchange by products asked as well.
    pub(super) fn islands_of_all(&self) -> Islands {
        match self.scattered() {
            Some(_) => Islands::whole(self.system.tree.velocities()),
            None => self.islands(),
        }
    }

    /// The same of joints alone.
    pub(super) fn jointed_islands(&self) -> Islands {
        self.tied(Some(Vec::new()))
    }

    /// The same of the dampers that are solved with contact alone.
    pub(super) fn damped_islands(&self) -> Islands {
        let place = self.place();
        self.tied(self.system.dampers().map(|f| f.ties_at(&place)).collect())
    }

    /// The same of what resists motion beside contact.
    pub(super) fn resisted_islands(&self) -> Islands {
        self.tied(self.system.resisting().map(|f| f.ties()).collect())
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

    /// M(q) by islands, but for what many bodies exchange by products: made when it is first asked for.
    pub(super) fn mass_blocks(&self) -> &IslandMatrix {
        once(&self.mass_blocks, || {
            let islands = self.islands();
            let few = islands.velocities() < MANY || islands.is_whole();
            if few && self.scattered().is_none() {
                return IslandMatrix::whole(self.mass_matrix().clone());
            }
            let changes = islands.changes();
            let products: Vec<_> = changes.iter().map(|v| self.mass_alone_times(v)).collect();
            IslandMatrix::new(islands, &products).symmetric()
        })
    }
}

fn first(tied: &[usize], mut b: usize) -> usize {
    while tied[b] != b {
        b = tied[b];
    }
    b
}
