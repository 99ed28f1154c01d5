//! Groups of points that lie together, with balls around them.

use hydrograd_adjoint::lie::Vec3;

/// Points that lie together.
#[derive(Clone, Debug)]
pub(crate) struct Cluster {
    /// Their numbers.
    pub vertices: Vec<usize>,
    /// A ball around them.
    pub center: Vec3,
    pub radius: f64,
}

/// The points in groups of `most` at most, by halves across their longest side.
pub(crate) fn clusters(points: &[Vec3], most: usize) -> Vec<Cluster> {
    let (mut out, mut open) = (Vec::new(), vec![(0..points.len()).collect::<Vec<_>>()]);
    while let Some(mut group) = open.pop() {
        let Some(first) = group.first() else { continue };
        let bounds = (points[*first], points[*first]);
        let (low, high) = (group.iter()).fold(bounds, |(low, high), v| {
            (low.inf(&points[*v]), high.sup(&points[*v]))
        });
        if group.len() > most {
            let axis = (high - low).imax();
            group.sort_by(|a, b| points[*a][axis].total_cmp(&points[*b][axis]));
            open.push(group.split_off(group.len() / 2));
            open.push(group);
            continue;
        }
        let center = (low + high) / 2.0;
        let away = group.iter().map(|v| (points[*v] - center).norm());
        out.push(Cluster {
            radius: away.fold(0.0, f64::max),
            center,
            vertices: group,
        });
    }
    out
}
