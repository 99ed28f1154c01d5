//! Plane polygons into triangles.

use hydrograd_adjoint::lie::Vec3;

/// Most corners of a polygon: the search for ears grows with the cube.
pub(super) const MAX_CORNERS: usize = 256;

/// Cuts a polygon (corners in order; fewer than three give nothing) into triangles that turn as it does, by
/// cutting off the ear with the widest smallest angle; right for notched polygons too.
pub(super) fn triangles(corners: &[usize], vertices: &[Vec3]) -> Vec<[usize; 3]> {
    let mut left = corners.to_vec();
    let mut cut = Vec::with_capacity(corners.len().saturating_sub(2));
    // A corner that doesn't exist is for the check to report: any fan will do.
    let known = !corners.is_empty() && corners.iter().all(|&v| v < vertices.len());
    let normal = if known {
        normal(corners, vertices)
    } else {
        Vec3::zeros()
    };
    while left.len() > 3 {
        let n = left.len();
        let ear = |i: usize| [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
        let best = (0..n)
            .filter(|_| known)
            .filter_map(|i| {
                let t = ear(i).map(|v| vertices[v]);
                let quality = quality(&t, &normal);
                let free = quality > 0.0
                    && left
                        .iter()
                        .all(|v| ear(i).contains(v) || !inside(&vertices[*v], &t, &normal));
                free.then_some((quality, i))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        // None: the polygon is flat or crosses itself; the check will find the faces.
        let i = best.map_or(1, |(_, i)| i);
        cut.push(ear(i));
        left.remove(i);
    }
    if let [a, b, c] = left[..] {
        cut.push([a, b, c]);
    }
    cut
}

/// Newell's normal: right for notched and slightly bent polygons.
fn normal(corners: &[usize], vertices: &[Vec3]) -> Vec3 {
    let origin = vertices[corners[0]];
    (0..corners.len())
        .map(|i| {
            let a = vertices[corners[i]] - origin;
            let b = vertices[corners[(i + 1) % corners.len()]] - origin;
            a.cross(&b)
        })
        .sum()
}

/// Area over longest side squared, negative where the corner is a notch.
fn quality([a, b, c]: &[Vec3; 3], normal: &Vec3) -> f64 {
    let area = (b - a).cross(&(c - a)).dot(normal) / normal.norm();
    let longest = (b - a)
        .norm_squared()
        .max((c - b).norm_squared())
        .max((a - c).norm_squared());
    area / longest
}

fn inside(p: &Vec3, [a, b, c]: &[Vec3; 3], normal: &Vec3) -> bool {
    let left = |a: &Vec3, b: &Vec3| (b - a).cross(&(p - a)).dot(normal) >= 0.0;
    left(a, b) && left(b, c) && left(c, a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_notched_polygon_keeps_its_area() {
        // An arrow head, notch first: a fan from its first corner would be right, one from its
        // second would not; so all rotations are tried.
        let points = [[0.0, 0.0], [-1.0, -1.0], [2.0, 0.0], [-1.0, 1.0]];
        let vertices = points.map(|[x, y]| Vec3::new(x, y, 0.0));
        for turn in 0..4 {
            let corners: Vec<usize> = (0..4).map(|i| (i + turn) % 4).collect();
            let mut total = 0.0;
            for [a, b, c] in triangles(&corners, &vertices) {
                let z = (vertices[b] - vertices[a])
                    .cross(&(vertices[c] - vertices[a]))
                    .z;
                assert!(z > 0.0);
                total += z / 2.0;
            }
            assert!((total - 2.0).abs() < 1e-15, "{turn}: {total}");
        }
    }
}
