//! Vertices at the same place.

use hydrograd_adjoint::lie::Vec3;
use std::collections::HashMap;

/// For each vertex the first vertex at its place: bit for bit if `tolerance` is zero, else within
/// that distance (m). Vertices that aren't finite stay alone.
pub(crate) fn representatives(vertices: &[Vec3], tolerance: f64) -> Vec<usize> {
    let mut first: HashMap<[u64; 3], usize> = HashMap::with_capacity(vertices.len());
    let mut grid: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    let cell = |p: &Vec3| [p.x, p.y, p.z].map(|x| (x / (2.0 * tolerance)).floor() as i64);
    let representative = |(i, p): (usize, &Vec3)| {
        if !p.iter().all(|x| x.is_finite()) {
            return i;
        }
        if tolerance <= 0.0 {
            // Adding zero turns −0 into 0.
            let key = [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
            return *first.entry(key).or_insert(i);
        }
        // A ball of this radius reaches at most two cells in each direction.
        let low = cell(&p.add_scalar(-tolerance));
        let high = cell(&p.add_scalar(tolerance));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let near = |j: &&usize| (vertices[**j] - p).norm() <= tolerance;
                    let same = grid.get(&[x, y, z]).and_then(|list| list.iter().find(near));
                    if let Some(&j) = same {
                        return j;
                    }
                }
            }
        }
        grid.entry(cell(p)).or_default().push(i);
        i
    };
    vertices.iter().enumerate().map(representative).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_points_across_a_cell_border_are_one() {
        let p = [0.0, 2.0, 2.0 + 1e-9, 2.0 - 1e-9, -0.0, 5.0]
            .map(|x| Vec3::new(x, 1.0, -1.0))
            .to_vec();
        assert_eq!(representatives(&p, 0.0), [0, 1, 2, 3, 0, 5]);
        assert_eq!(representatives(&p, 1e-3), [0, 1, 1, 1, 0, 5]);
    }
}
