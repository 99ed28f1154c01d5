//! Triangles in a tree of boxes.

use super::points::bounds;
use super::triangle::Triangle;
use hydrograd_adjoint::lie::Vec3;

/// Faces in a leaf, at most.
const LEAF: usize = 2;

/// A box of the tree, body frame. Its first child follows it in the list.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub center: Vec3,
    pub half: Vec3,
    /// Its faces, in the order of the tree.
    pub faces: std::ops::Range<usize>,
    /// Its second child; none in a leaf.
    pub second: Option<usize>,
}

impl Node {
    /// Square of the distance of a point to the box.
    #[inline]
    pub fn distance_squared(&self, p: &Vec3) -> f64 {
        let out = (p - self.center).abs() - self.half;
        out.map(|x| x.max(0.0)).norm_squared()
    }
}

/// The tree over some triangles with these centroids, its root first, and the order in which its leaves hold them.
pub(super) fn tree(
    triangles: &[Triangle],
    centroid: impl Fn(usize) -> Vec3,
) -> (Vec<Node>, Vec<usize>) {
    let centroids: Vec<Vec3> = (0..triangles.len()).map(centroid).collect();
    let mut order: Vec<usize> = (0..triangles.len()).collect();
    let mut nodes = Vec::with_capacity(2 * triangles.len());
    grow(&mut nodes, &mut order, 0, &centroids, triangles);
    (nodes, order)
}

/// Builds the tree over `order`, whose first element is number `start`, and returns its root.
fn grow(
    nodes: &mut Vec<Node>,
    order: &mut [usize],
    start: usize,
    centroids: &[Vec3],
    triangles: &[Triangle],
) -> usize {
    let [low, high] = bounds(order.iter().flat_map(|&f| triangles[f].corners.iter()));
    let root = nodes.len();
    let center = low + (high - low) * 0.5;
    nodes.push(Node {
        center,
        // No corner may stick out by rounding.
        half: (high - center).sup(&(center - low)),
        faces: start..start + order.len(),
        second: None,
    });
    if order.len() > LEAF {
        let [low, high] = bounds(order.iter().map(|&f| &centroids[f]));
        let axis = (high - low).imax();
        let half = order.len() / 2;
        order.select_nth_unstable_by(half, |&f, &g| {
            centroids[f][axis]
                .total_cmp(&centroids[g][axis])
                .then(f.cmp(&g))
        });
        let (left, right) = order.split_at_mut(half);
        grow(nodes, left, start, centroids, triangles);
        let second = grow(nodes, right, start + half, centroids, triangles);
        nodes[root].second = Some(second);
    }
    root
}
