//! Points from coarse to fine.

use crate::adjoint::lie::Vec3;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Maximin order: each point is the one farthest from those before it. With its distance from them, its scale, and those that lie near it.
pub(super) struct Order {
    /// Numbers of the points, from coarse to fine.
    pub points: Vec<usize>,
    /// Scale of each place, falling, m.
    pub scales: Vec<f64>,
    /// Places before each within ρ of its scale, ascending.
    pub near: Vec<Vec<usize>>,
}

/// Cubes from the middle of which numbers are all different.
const FAR: f64 = 1e15;

/// Points by cubes in space.
struct Grid {
    edge: f64,
    cells: HashMap<[i64; 3], Vec<usize>>,
}

impl Grid {
    fn new<'a>(edge: f64, points: impl Iterator<Item = (usize, &'a Vec3)>) -> Self {
        let cells = HashMap::new();
        let mut out = Self { edge, cells };
        points.for_each(|(k, x)| out.add(k, x));
        out
    }

    fn cell(&self, x: &Vec3) -> [i64; 3] {
        // Points so far apart in size share a cell: what may be near is only ever more.
        [x.x, x.y, x.z].map(|c| (c / self.edge).floor().clamp(-FAR, FAR) as i64)
    }

    fn add(&mut self, k: usize, x: &Vec3) {
        self.cells.entry(self.cell(x)).or_default().push(k);
    }

    /// What may lie within an edge of a point.
    fn around(&self, x: &Vec3) -> impl Iterator<Item = usize> + '_ {
        let own = self.cell(x);
        let cells = (0..27).map(move |c| {
            let [x, y, z] = own;
            [x + c % 3 - 1, y + c / 3 % 3 - 1, z + c / 9 - 1]
        });
        cells.filter_map(|c| self.cells.get(&c)).flatten().copied()
    }
}

impl Order {
    /// Of points with neighbours within `rho` scales.
    pub fn new(points: &[Vec3], rho: f64) -> Self {
        let mut out = Self {
            points: Vec::with_capacity(points.len()),
            scales: Vec::with_capacity(points.len()),
            near: Vec::with_capacity(points.len()),
        };
        // Distances as bits: of numbers that aren't negative these are in their order.
        let mut distance = vec![f64::INFINITY; points.len()];
        let mut place = vec![usize::MAX; points.len()];
        let Some(mut next) = first(points) else {
            return out;
        };
        let mut heap = BinaryHeap::new();
        let (mut left, mut taken) = (
            Grid::new(1.0, [].into_iter()),
            Grid::new(1.0, [].into_iter()),
        );
        let mut edge = f64::INFINITY;
        loop {
            let (x, scale) = (&points[next], distance[next]);
            let at = out.points.len();
            place[next] = at;
            out.points.push(next);
            out.scales.push(scale);
            if scale < 0.5 * edge && scale > 0.0 && scale.is_finite() {
                edge = scale;
                let rest = (0..points.len()).filter(|k| place[*k] == usize::MAX);
                left = Grid::new(edge, rest.map(|k| (k, &points[k])));
                let before = out.points[..at].iter();
                taken = Grid::new(rho * edge, before.map(|k| (*k, &points[*k])));
            }
            let closer = |k: usize, distance: &mut [f64], heap: &mut BinaryHeap<_>| {
                let d = (points[k] - x).norm();
                if place[k] == usize::MAX && d < distance[k] {
                    distance[k] = d;
                    heap.push((d.to_bits(), Reverse(k)));
                }
            };
            let mut near = Vec::new();
            if scale.is_finite() {
                left.around(x)
                    .for_each(|k| closer(k, &mut distance, &mut heap));
                let within = |k: &usize| (points[*k] - x).norm() <= rho * scale;
                near.extend(taken.around(x).filter(within).map(|k| place[k]));
                near.sort_unstable();
            } else {
                (0..points.len()).for_each(|k| closer(k, &mut distance, &mut heap));
            }
            taken.add(next, x);
            out.near.push(near);
            let fresh = |(bits, Reverse(k)): &(u64, Reverse<usize>)| {
                place[*k] == usize::MAX && *bits == distance[*k].to_bits()
            };
            let farthest = loop {
                match heap.pop() {
                    Some(found) if fresh(&found) => break Some(found.1.0),
                    Some(_) => {}
                    None => break None,
                }
            };
            match farthest {
                Some(k) => next = k,
                None => break,
            }
        }
        // Nothing lies before the first: its scale is that of the second.
        out.scales[0] = out.scales.get(1).copied().unwrap_or(0.0);
        out
    }
}

/// The point farthest from the middle.
fn first(points: &[Vec3]) -> Option<usize> {
    let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
    let away = |k: &usize| ((points[*k] - middle).norm_squared().to_bits(), Reverse(*k));
    (0..points.len()).max_by_key(away)
}
