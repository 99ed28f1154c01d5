//! What ellipsoids and discs have in common: one outermost point in all directions, those along a disc's
//! axis apart, and distances that grow along straight lines from one lowest place on.

use super::field::Field;
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3};

/// Rounds of Newton's method; from where it starts it takes about six.
pub(super) const ROUNDS: usize = 100;

/// Outermost point in a direction.
pub(crate) struct Support {
    /// World frame, m.
    pub point: Vec3,
    /// Its slope along the direction, taken at unit length, m: symmetric, zero along the direction.
    pub spread: Mat3,
}

/// How near an edge comes, roughly.
pub(crate) struct Approach {
    /// Where along the edge to look first, m.
    pub at: f64,
    /// The edge isn't nearer than this, m.
    pub least: f64,
    /// Whether the edge passes through the body.
    pub pierced: bool,
}

/// A strictly convex body, or a disc.
pub(crate) trait Round {
    /// Whether points can lie inside.
    const HAS_INSIDE: bool;

    /// The outermost point in a direction (unit vector, world frame).
    fn support(&self, at: &Pose, direction: &Vec3) -> Support;

    /// Signed distance of a point, frame of the body.
    fn field(&self, y: &Vec3) -> Field;

    /// Where and how near an edge from `from` along a unit vector comes, frame of the body.
    fn approach(&self, from: &Vec3, along: &Vec3, length: f64) -> Approach;

    /// A point isn't nearer than this, m; frame of the body.
    fn least(&self, x: &Vec3) -> f64;

    /// [`lowest`] of its field, frame of the body.
    fn lowest(&self, from: &Vec3, along: &Vec3, length: f64) -> Option<f64> {
        let first = self.approach(from, along, length).at;
        lowest(&|x| self.field(x), from, along, length, first)
    }
}

/// Where a function rises through zero between two places, from its value and slope: by Newton's method from `first` on, halving what is left where a step would leave it, until steps are no longer
/// than `least`.
pub(crate) fn rising_root(
    [mut low, mut high]: [f64; 2],
    first: f64,
    least: f64,
    f: impl Fn(f64) -> (f64, f64),
) -> f64 {
    let mut at = first;
    for _ in 0..ROUNDS {
        let (value, slope) = f(at);
        if value > 0.0 {
            high = at;
        } else {
            low = at;
        }
        let newton = at - value / slope;
        let next = if newton >= low && newton <= high {
            newton
        } else {
            0.5 * (low + high)
        };
        let step = (next - at).abs();
        at = next;
        if step <= least {
            break;
        }
    }
    at
}

/// Where the signed distance from a convex body is least along an edge: how far from its beginning, m, looked for from
/// `first` on; none at an end, unless it is level there. It is convex, so its slope along the edge has one root at most.
pub(super) fn lowest(
    field: &dyn Fn(&Vec3) -> Field,
    from: &Vec3,
    along: &Vec3,
    length: f64,
    first: f64,
) -> Option<f64> {
    let slope = |s: f64| {
        let field = field(&(from + s * along));
        let curvature = along.dot(&(field.hessian * along));
        (field.gradient.dot(along), curvature)
    };
    let ends = [slope(0.0), slope(length)];
    // Level at an end, and rising from there: bodies that stand flush.
    for (s, (value, curvature)) in [0.0, length].into_iter().zip(ends) {
        if value == 0.0 && curvature > 0.0 {
            return Some(s);
        }
    }
    if ends[0].0 >= 0.0 || ends[1].0 <= 0.0 {
        return None;
    }
    Some(rising_root([0.0, length], first, 1e-15 * length, slope))
}
