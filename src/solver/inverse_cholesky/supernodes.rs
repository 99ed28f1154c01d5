//! Columns that share their rows.

use super::order::Order;

/// Ratio of scales within a supernode.
const RATIO: f64 = 1.5;

/// Neighbours of like scale, and all rows that their columns reach.
pub(super) struct Supernode {
    /// Places in the order, ascending: from coarse to fine.
    pub rows: Vec<usize>,
    /// Where among the rows its columns are.
    pub members: Vec<usize>,
}

/// All columns in supernodes: from fine to coarse, each takes what of its neighbours is left.
pub(super) fn supernodes(order: &Order) -> Vec<Supernode> {
    let mut left = vec![true; order.points.len()];
    let mut out = Vec::new();
    for seed in (0..order.points.len()).rev() {
        if !left[seed] {
            continue;
        }
        let like = |at: &usize| left[*at] && order.scales[*at] <= RATIO * order.scales[seed];
        let mut members: Vec<usize> = order.near[seed].iter().copied().filter(like).collect();
        members.push(seed);
        let mut rows: Vec<usize> = members.clone();
        for at in &members {
            left[*at] = false;
            rows.extend(&order.near[*at]);
        }
        rows.sort_unstable();
        rows.dedup();
        let find = |at: &usize| rows.binary_search(at).ok();
        let members = members.iter().filter_map(find).collect();
        out.push(Supernode { rows, members });
    }
    out
}
