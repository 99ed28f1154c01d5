//! Boxes around bodies along the axes of their own frames: how far apart two are at least, which for flat and long bodies says far more than balls do.

use crate::geometry::broad::Region;
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Room for rounding, of the coordinates.
const ROUNDING: f64 = 1e-12;

/// A box around a body, along the axes of its frame, and a little more for rounding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Casing {
    center: Vec3,
    half: Vec3,
}

impl Casing {
    /// Of smallest and largest coordinates, m.
    pub fn new([low, high]: [Vec3; 2]) -> Self {
        let center = 0.5 * (low + high);
        let half = (high - center).sup(&(center - low));
        let room = ROUNDING * (center.amax() + half.amax());
        Self {
            center,
            half: half.map(|x| x + room),
        }
    }

    /// Around both, of one frame.
    pub fn joined(self, other: Self) -> Self {
        let low = (self.center - self.half).inf(&(other.center - other.half));
        let high = (self.center + self.half).sup(&(other.center + other.half));
        Self::new([low, high])
    }

    /// A box along the world's axes around all that is as near to it as `reach` (m), at a pose.
    pub fn region(&self, pose: &Pose, reach: f64) -> Region {
        let half = pose.rotation.abs() * self.half;
        Region::of_box(pose.apply(&self.center), half, reach)
    }

    /// How far apart what two hold is at least, m, `other` at the pose `there` in the frame of this one: the widest of the gaps along the axes of both. Zero where it says nothing.
    pub fn apart(&self, other: &Self, there: &Pose) -> f64 {
        let turn = &there.rotation;
        let way = there.apply(&other.center) - self.center;
        // What isn't a number isn't apart.
        if !way.iter().chain(turn.iter()).all(|x| x.is_finite()) {
            return 0.0;
        }
        let room = ROUNDING * (way.amax() + self.half.amax() + other.half.amax());
        let back = turn.tr_mul(&way);
        let mut most: f64 = 0.0;
        for i in 0..3 {
            let [mut own, mut others] = [self.half[i], other.half[i]];
            for j in 0..3 {
                own += turn[(i, j)].abs() * other.half[j];
                others += turn[(j, i)].abs() * self.half[j];
            }
            most = most.max(way[i].abs() - own).max(back[i].abs() - others);
        }
        (most - room).max(0.0)
    }

    /// The same of bodies at poses in the world.
    pub fn apart_at(&self, pose: &Pose, other: &Self, other_pose: &Pose) -> f64 {
        let turn = pose.rotation.transpose();
        let way = turn * (other_pose.translation - pose.translation);
        self.apart(other, &Pose::new(turn * other_pose.rotation, way))
    }
}

#[cfg(test)]
mod tests {
    use super::Casing;
    use hydrograd_adjoint::lie::{Pose, Vec3, exp_matrix};
    use hydrograd_adjoint::sample::Samples;

    /// Corners of a box, and points on its surface between them.
    fn points(half: &Vec3) -> Vec<Vec3> {
        let n = 6;
        let at = |k: usize| 2.0 * k as f64 / n as f64 - 1.0;
        let all = (0..=n).flat_map(|i| (0..=n).flat_map(move |j| (0..=n).map(move |k| [i, j, k])));
        let outer = all.filter(|x| x.iter().any(|k| *k == 0 || *k == n));
        outer
            .map(|x| half.component_mul(&Vec3::from(x.map(at))))
            .collect()
    }

    /// Never more than the distance of boxes at random, plates and rods among them, and all of it where faces are opposite.
    #[test]
    fn it_is_a_lower_bound() {
        let mut drawn = Samples::new(7);
        let sizes = [[1.0, 1.0, 1.0], [1.0, 1.0, 1e-3], [2.0, 1e-2, 1e-2]];
        let mut apart = 0;
        for (k, size) in (0..300).map(|k| (k, sizes[k % 3])) {
            let halves = [Vec3::from(size), Vec3::from(sizes[(k / 3) % 3])];
            let center = Vec3::from(drawn.vector(0.5));
            let boxes = halves.map(|half| Casing::new([center - half, center + half]));
            let turn = exp_matrix(&Vec3::from(drawn.vector(3.0)));
            let there = Pose::new(turn, Vec3::from(drawn.vector(4.0)));
            let found = boxes[0].apart(&boxes[1], &there);
            let [own, others] = halves.map(|half| points(&half));
            let others = others.iter().map(|x| there.apply(&(x + center)) - center);
            let others: Vec<Vec3> = others.collect();
            let nearest = (own.iter())
                .flat_map(|x| others.iter().map(move |y| (x - y).norm()))
                .fold(f64::INFINITY, f64::min);
            assert!(found <= nearest + 1e-12, "{found} of {nearest}");
            apart += usize::from(found > 0.0);
        }
        assert!(apart > 100, "{apart} of 300 are told apart");
        let plate = Casing::new([Vec3::new(-1.0, -1.0, -0.01), Vec3::new(1.0, 1.0, 0.01)]);
        let there = Pose::new(exp_matrix(&Vec3::zeros()), Vec3::new(0.3, 0.0, 0.12));
        let found = plate.apart(&plate, &there);
        assert!((found - 0.1).abs() < 1e-11, "{found}");
        let nowhere = Pose::new(there.rotation, Vec3::new(f64::NAN, 0.0, 5.0));
        assert_eq!(plate.apart(&plate, &nowhere), 0.0);
    }
}
