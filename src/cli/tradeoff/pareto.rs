//! Which of many points nothing else beats.

/// Marks the points (cost, error) that no other point beats: none is at most as dear and at most as
/// wrong, and better in one of the two. Equal points don't beat each other. Points that are missing
/// or not finite beat nothing and are never marked.
pub(super) fn front(points: &[Option<(f64, f64)>]) -> Vec<bool> {
    let known = |p: &Option<(f64, f64)>| p.filter(|(x, y)| x.is_finite() && y.is_finite());
    let beats = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
    points
        .iter()
        .map(|p| {
            known(p).is_some_and(|p| !points.iter().filter_map(known).any(|other| beats(other, p)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::front;

    #[test]
    fn only_unbeaten_points_are_marked() {
        let points = [(1.0, 1.0), (2.0, 0.5), (2.0, 0.6), (3.0, 0.5), (0.5, 3.0)];
        let marked = front(&points.map(Some));
        assert_eq!(marked, [true, true, false, false, true]);
    }

    #[test]
    fn equal_points_are_marked_together() {
        let points = [(1.0, 0.1), (1.0, 0.1), (2.0, 0.1), (1.0, 0.2)];
        let marked = front(&points.map(Some));
        assert_eq!(marked, [true, true, false, false]);
    }

    #[test]
    fn zeros_count() {
        let points = [(0.0, 1.0), (1.0, 0.0), (1.0, -0.0), (2.0, 0.0)];
        assert_eq!(front(&points.map(Some)), [true, true, true, false]);
    }

    #[test]
    fn what_is_not_a_number_neither_beats_nor_is_marked() {
        let points = [
            None,
            Some((f64::NAN, 0.0)),
            Some((0.0, f64::NAN)),
            Some((f64::NEG_INFINITY, 0.0)),
            Some((0.0, f64::INFINITY)),
            Some((1.0, 1.0)),
        ];
        assert_eq!(front(&points), [false, false, false, false, false, true]);
        assert_eq!(front(&[]), Vec::<bool>::new());
        assert_eq!(front(&[None, None]), [false, false]);
    }

    /// Against the definition in another form: sorted by cost, the least error so far sinks.
    #[test]
    fn agrees_with_a_sweep() {
        let mut seed = 7_u64;
        let mut random = || {
            seed = seed
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            // Few values, so that ties are common.
            ((seed >> 33) % 12) as f64
        };
        for _ in 0..50 {
            let points: Vec<_> = (0..30).map(|_| (random(), random())).collect();
            let marked = front(&points.iter().copied().map(Some).collect::<Vec<_>>());
            let mut order: Vec<usize> = (0..points.len()).collect();
            order.sort_by(|a, b| points[*a].partial_cmp(&points[*b]).unwrap());
            let mut least = f64::INFINITY;
            let mut last = None;
            for i in order {
                let expected = points[i].1 < least || last == Some(points[i]);
                assert_eq!(marked[i], expected, "{points:?}");
                if points[i].1 < least {
                    least = points[i].1;
                    last = Some(points[i]);
                }
            }
        }
    }
}
