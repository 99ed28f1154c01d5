//! Source points.

use crate::lie::Vec3;

/// Points the sources sit at, in the frame of the target body, m.
///
/// The coordinates lie in separate arrays, padded with copies of the last point to a multiple of
/// the widest vector (8), so that sums have no tails; what is computed for the copies is dropped.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sources {
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) z: Vec<f64>,
    len: usize,
}

/// Padding: the widest vector.
pub(crate) const WIDTH: usize = 8;

impl Sources {
    /// From points.
    pub fn new(points: &[Vec3]) -> Self {
        points.iter().copied().collect()
    }

    /// Number of sources.
    pub fn len(&self) -> usize {
        self.len
    }

    /// No sources.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Position of source `j`.
    #[inline]
    pub fn point(&self, j: usize) -> Vec3 {
        assert!(j < self.len);
        Vec3::new(self.x[j], self.y[j], self.z[j])
    }
}

impl FromIterator<Vec3> for Sources {
    fn from_iter<I: IntoIterator<Item = Vec3>>(points: I) -> Self {
        let mut sources = Self::default();
        for p in points {
            sources.x.push(p.x);
            sources.y.push(p.y);
            sources.z.push(p.z);
        }
        sources.len = sources.x.len();
        let padded = sources.len.next_multiple_of(WIDTH);
        for c in [&mut sources.x, &mut sources.y, &mut sources.z] {
            let last = c.last().copied().unwrap_or_default();
            c.resize(padded, last);
        }
        sources
    }
}
