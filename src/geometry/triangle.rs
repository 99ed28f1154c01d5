//! Distances between points, edges and triangles. Every distance returned is that of two points
//! that exist, so that rounding never makes a gap smaller than the smallest one by more than
//! itself.

use hydrograd_adjoint::lie::Vec3;

/// A triangle and its unit normal; zero if it has no area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub corners: [Vec3; 3],
    pub normal: Vec3,
}

/// The part of a triangle that a closest point lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Feature {
    /// Its inside.
    Face,
    /// The edge from this corner to the next.
    Edge(usize),
    /// This corner.
    Corner(usize),
}

impl Triangle {
    pub fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let n = (b - a).cross(&(c - a));
        let length = n.norm();
        let normal = if length > 0.0 && length.is_finite() {
            n / length
        } else {
            Vec3::zeros()
        };
        Self { corners, normal }
    }

    /// Height of a point above the plane.
    #[inline]
    fn height(&self, p: &Vec3) -> f64 {
        (p - self.corners[0]).dot(&self.normal)
    }

    /// Whether a point lies in the prism over the triangle; never if it has no area.
    #[inline]
    fn spans(&self, p: &Vec3) -> bool {
        let [a, b, c] = &self.corners;
        let left = |from: &Vec3, to: &Vec3| (to - from).cross(&(p - from)).dot(&self.normal) >= 0.0;
        self.normal != Vec3::zeros() && left(a, b) && left(b, c) && left(c, a)
    }

    /// Closest point to `p`, and the part that it lies on.
    pub fn closest(&self, p: &Vec3) -> (Vec3, Feature) {
        if self.spans(p) {
            return (p - self.normal * self.height(p), Feature::Face);
        }
        let mut best = (self.corners[0], Feature::Corner(0));
        let mut least = f64::INFINITY;
        for k in 0..3 {
            let (a, b) = (&self.corners[k], &self.corners[(k + 1) % 3]);
            let d = b - a;
            let along = (p - a).dot(&d);
            let whole = d.dot(&d);
            let here = if along <= 0.0 || whole <= 0.0 {
                (*a, Feature::Corner(k))
            } else if along >= whole {
                (*b, Feature::Corner((k + 1) % 3))
            } else {
                (a + d * (along / whole), Feature::Edge(k))
            };
            let square = (p - here.0).norm_squared();
            if square < least {
                (least, best) = (square, here);
            }
        }
        best
    }

    /// Where on the segment from `p` to `q` (0 to 1) it passes through the triangle.
    pub fn pierced(&self, p: &Vec3, q: &Vec3) -> Option<f64> {
        let (hp, hq) = (self.height(p), self.height(q));
        if (hp > 0.0 && hq > 0.0) || (hp < 0.0 && hq < 0.0) || hp == hq {
            return None;
        }
        let s = hp / (hp - hq);
        self.spans(&(p + (q - p) * s)).then_some(s)
    }

    /// Square of the distance to another triangle if it is below `limit`; 0 if they cross.
    pub fn distance_squared(&self, other: &Triangle, limit: f64) -> Option<f64> {
        let mine = self.corners.map(|p| other.height(&p));
        let theirs = other.corners.map(|p| self.height(&p));
        let (clear_mine, clear_theirs) = (clearance(&mine), clearance(&theirs));
        let bound = clear_mine.max(clear_theirs);
        if bound * bound >= limit {
            return None;
        }
        if bound <= 0.0 && self.crosses(other) {
            return Some(0.0);
        }
        let mut least = limit;
        for (from, heights, to) in [(self, &mine, other), (other, &theirs, self)] {
            for (p, h) in from.corners.iter().zip(heights) {
                if h * h < least {
                    least = least.min((p - to.closest(p).0).norm_squared());
                }
            }
        }
        for i in 0..3 {
            let p = &self.corners[i];
            let d = self.corners[(i + 1) % 3] - p;
            for j in 0..3 {
                let q = &other.corners[j];
                let e = other.corners[(j + 1) % 3] - q;
                if let Some(square) = between_insides(p, &d, q, &e) {
                    least = least.min(square);
                }
            }
        }
        (least < limit).then_some(least)
    }

    /// Whether an edge of one passes through the other.
    fn crosses(&self, other: &Triangle) -> bool {
        let through = |of: &Triangle, by: &Triangle| {
            (0..3).any(|k| {
                of.pierced(&by.corners[k], &by.corners[(k + 1) % 3])
                    .is_some()
            })
        };
        through(self, other) || through(other, self)
    }
}

/// Smallest height if all are on one side, else zero.
#[inline]
fn clearance([a, b, c]: &[f64; 3]) -> f64 {
    let low = a.min(*b).min(*c);
    let high = a.max(*b).max(*c);
    low.max(-high).max(0.0)
}

/// Square of the distance between the segments p + s d and q + t e where it is least strictly
/// inside both.
#[inline]
fn between_insides(p: &Vec3, d: &Vec3, q: &Vec3, e: &Vec3) -> Option<f64> {
    let r = p - q;
    let (dd, de, ee) = (d.dot(d), d.dot(e), e.dot(e));
    let (dr, er) = (d.dot(&r), e.dot(&r));
    let determinant = dd * ee - de * de;
    let s = de * er - ee * dr;
    let t = dd * er - de * dr;
    if !(s > 0.0 && t > 0.0 && s < determinant && t < determinant) {
        return None;
    }
    Some((r + d * (s / determinant) - e * (t / determinant)).norm_squared())
}
