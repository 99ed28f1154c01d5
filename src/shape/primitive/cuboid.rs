//! Boxes: a grid on each side, somewhat finer towards the edges, where the flow is sharp.

use super::{Parts, graded, misfit};
use hydrograd_adjoint::lie::Vec3;
use std::collections::HashMap;

/// A box with the given edge lengths (m) along x, y, z, centred at the origin, with about
/// `target` faces (at least 12).
pub(in crate::shape) fn cuboid(size: [f64; 3], target: usize) -> Parts {
    let cells = choose_cells(size, target as f64);
    let lines = [0, 1, 2].map(|i| grid_lines(size[i], cells[i]));
    let mut grid = Grid {
        lines: &lines,
        known: HashMap::new(),
        vertices: Vec::new(),
        faces: Vec::new(),
    };
    for axis in 0..3 {
        for outward in [false, true] {
            grid.side(axis, outward, cells);
        }
    }
    (grid.vertices, grid.faces)
}

/// Faces of a grid with so many cells. A middle row of cells gets four triangles a cell instead
/// of two, because one diagonal has no mirror image in itself.
fn face_count(cells: [usize; 3]) -> usize {
    let side = |m: usize, n: usize| {
        let crossed = match (m % 2, n % 2) {
            (0, 0) => 0,
            (1, 0) => n,
            (0, _) => m,
            _ => m + n - 1,
        };
        2 * (2 * m * n + 2 * crossed)
    };
    side(cells[0], cells[1]) + side(cells[1], cells[2]) + side(cells[2], cells[0])
}

/// Part of the longest edge by which lengths may differ and have the same number of cells: a box that is nearly a cube has about the faces of one.
const SAME: f64 = 0.02;

/// Numbers of cells along x, y, z: near-square cells, near the target; equal lengths get equal
/// numbers, so that a cube stays one.
fn choose_cells(size: [f64; 3], target: f64) -> [usize; 3] {
    let [a, b, c] = size;
    // Scaled by the longest edge first: lengths may be as extreme as their type allows.
    let longest = a.max(b).max(c);
    let scaled = [a / longest, b / longest, c / longest];
    // Lengths that differ by little are the same.
    let mut alike = [0, 1, 2];
    for i in 1..3 {
        if let Some(j) = (0..i).find(|&j| (scaled[j] - scaled[i]).abs() <= SAME) {
            alike[i] = alike[j];
        }
    }
    let [a, b, c] = alike.map(|i| scaled[i]);
    let mut ideal = (4.0 * (a * b + b * c + c * a) / target).sqrt();
    // Where a side is thinner than a cell it takes one all the same: so many more of them that cells must be longer.
    let least = |cell: f64| face_count([a, b, c].map(|l| (l / cell).max(1.0) as usize)) as f64;
    while ideal < 1.0 && least(ideal) > 1.25 * target {
        ideal *= 1.1;
    }
    let mut best = (f64::INFINITY, [1; 3]);
    for step in -30..=30 {
        let cell = ideal * 1.01f64.powi(step);
        let exact = [a, b, c].map(|l| (l / cell).max(1e-9));
        // Each length rounded down, up, or down by one or two more.
        for choice in 0..64usize {
            let cells = [0, 1, 2].map(|i| {
                // The same length takes the same choice.
                let offset = (choice >> (2 * alike[i])) & 3;
                (exact[i] as usize + offset).saturating_sub(2).max(1)
            });
            let stretch = [0, 1, 2].map(|i| {
                // One cell is the fewest: a thin side can't do better.
                if cells[i] == 1 && exact[i] < 1.0 {
                    1.0
                } else {
                    cells[i] as f64 / exact[i]
                }
            });
            let cost = misfit(face_count(cells) as f64, target, &stretch);
            if cost < best.0 {
                best = (cost, cells);
            }
        }
    }
    best.1
}

/// Coordinates of n + 1 grid lines with the middles of the cells between them: 2n + 1 numbers,
/// exactly odd about the middle one.
fn grid_lines(length: f64, n: usize) -> Vec<f64> {
    let line = |i: usize| {
        let t = (2 * i) as f64 / n as f64 - 1.0;
        if i == 0 || i == n {
            return t.signum() * length / 2.0;
        }
        length / 2.0 * graded(t)
    };
    // The upper half mirrors the lower, bit for bit.
    let odd = |i: usize| if 2 * i > n { -line(n - i) } else { line(i) };
    (0..=2 * n)
        .map(|i| (odd(i / 2) + odd(i.div_ceil(2))) / 2.0)
        .collect()
}

/// Cells on all sides.
struct Grid<'a> {
    /// Per axis: grid lines at even, cell middles at odd numbers.
    lines: &'a [Vec<f64>; 3],
    known: HashMap<[usize; 3], usize>,
    vertices: Vec<Vec3>,
    faces: Vec<[usize; 3]>,
}

impl Grid<'_> {
    /// The vertex at some lines.
    fn vertex(&mut self, at: [usize; 3]) -> usize {
        *self.known.entry(at).or_insert_with(|| {
            self.vertices
                .push(Vec3::from([0, 1, 2].map(|i| self.lines[i][at[i]])));
            self.vertices.len() - 1
        })
    }

    /// The side of the box at the lower or upper end of an axis.
    fn side(&mut self, axis: usize, outward: bool, cells: [usize; 3]) {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let depth = if outward { 2 * cells[axis] } else { 0 };
        for i in 0..cells[u] {
            for j in 0..cells[v] {
                let mut at = |du: usize, dv: usize| {
                    let mut lines = [depth; 3];
                    lines[u] = 2 * i + du;
                    lines[v] = 2 * j + dv;
                    self.vertex(lines)
                };
                let corners = [at(0, 0), at(2, 0), at(2, 2), at(0, 2)];
                let triangles = if 2 * i + 1 == cells[u] || 2 * j + 1 == cells[v] {
                    let middle = at(1, 1);
                    (0..4)
                        .map(|k| [corners[k], corners[(k + 1) % 4], middle])
                        .collect()
                } else {
                    // Diagonals run from the middle of the side outward, so that none cuts off
                    // a corner of the box.
                    let low = (2 * i + 1 < cells[u]) == (2 * j + 1 < cells[v]);
                    let [a, b, c, d] = corners;
                    if low {
                        vec![[a, b, c], [a, c, d]]
                    } else {
                        vec![[a, b, d], [b, c, d]]
                    }
                };
                self.faces.extend(
                    triangles
                        .into_iter()
                        .map(|[a, b, c]: [usize; 3]| if outward { [a, b, c] } else { [a, c, b] }),
                );
            }
        }
    }
}
