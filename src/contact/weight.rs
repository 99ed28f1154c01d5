//! Weights by which points of contact come and go.

use super::point::ContactPoint;
use hydrograd_adjoint::lie::Vec6;

/// A weight with its slope; a product of such.
pub(super) struct Weight {
    pub value: f64,
    pub slope: Vec6,
}

impl Weight {
    /// One.
    pub fn full() -> Self {
        Self {
            value: 1.0,
            slope: Vec6::zeros(),
        }
    }

    /// Times 0 for x ≤ 0, 1 for x ≥ 1, 3x² − 2x³ in between.
    pub fn fade(&mut self, x: f64, slope: &Vec6) {
        if x < 1.0 {
            let x = x.max(0.0);
            let step = x * x * (3.0 - 2.0 * x);
            self.slope = self.slope * step + self.value * 6.0 * x * (1.0 - x) * slope;
            self.value *= step;
        }
    }

    /// Times what is left: 1 for x ≤ 0, 0 for x ≥ 1.
    pub fn fade_out(&mut self, x: f64, slope: &Vec6) {
        self.fade(1.0 - x, &-slope);
    }
}

/// Points of which one is meant: that with the largest gap, and the next as far as those before it have faded.
pub(super) fn in_turn(mut points: Vec<ContactPoint>) -> Vec<ContactPoint> {
    points.sort_by(|p, q| q.gap.total_cmp(&p.gap));
    let mut left = Weight::full();
    for point in &mut points {
        let Weight { value, slope } = left;
        left = Weight {
            value: value * (1.0 - point.weight),
            slope: slope * (1.0 - point.weight) - value * point.slopes.weight,
        };
        point.slopes.weight = value * point.slopes.weight + point.weight * slope;
        point.weight *= value;
    }
    points.retain(|p| p.weight > 0.0);
    points
}
