//! The part of a closed surface below a plane: volume, first moment, and the plane's cut through it.
//!
//! With the plane n·x = d and the origin moved onto it, every clipped face makes a tetrahedron with that origin, and the cut itself none. The cut's boundary is where
//! faces are clipped, and its moments follow from that boundary. They are the derivatives of the volume and of its moment with respect to the plane.

use crate::lie::{Mat3, Pose, Vec3};

/// Part of a hull's largest coordinate by which its height along a normal may be off.
const ROUNDING: f64 = 1e-12;

/// A closed surface, its faces counter-clockwise from outside.
#[derive(Clone, Debug, Default)]
pub struct Hull {
    /// Its corners, m.
    pub vertices: Vec<Vec3>,
    /// Its faces, by the numbers of their corners.
    pub faces: Vec<[usize; 3]>,
}

/// What lies below a plane. A plane through the highest corner has all below it, one through the lowest nothing, both without a cut.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Below {
    /// Volume V, m³.
    pub volume: f64,
    /// ∫ x dV, m⁴.
    pub moment: Vec3,
    /// Area A of the cut, m².
    pub area: f64,
    /// ∫ x dA over the cut, m³.
    pub area_moment: Vec3,
    /// ∫ x xᵀ dA over the cut, m⁴.
    pub area_second: Mat3,
}

impl Below {
    /// Of a hull below the plane `normal`·x = `height`; `normal` is a unit vector.
    pub fn new(hull: &Hull, normal: &Vec3, height: f64) -> Self {
        let heights = hull.vertices.iter().map(|x| normal.dot(x));
        let (bottom, top) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (low.min(h), high.max(h))
        });
        let size = hull.vertices.iter().fold(0.0_f64, |m, x| m.max(x.amax()));
        // A level face that the plane doesn't reach is no cut, on whichever side rounding has its corners.
        let rounding = ROUNDING * size;
        let mut out = Self::default();
        if height <= bottom + rounding {
            return out;
        }
        let whole = height >= top - rounding;
        // A plane far above would lose digits, and one through the highest point says the same.
        let origin = top.min(height) * normal;
        for face in &hull.faces {
            let corners = face.map(|k| hull.vertices[k] - origin);
            let depths = match whole {
                true => [0.0; 3],
                false => corners.map(|x| -normal.dot(&x)),
            };
            out.add_face(&corners, &depths, normal);
        }
        out.about(&origin)
    }

    /// Adds a face, whose corners are given from a point on the plane.
    fn add_face(&mut self, corners: &[Vec3; 3], depths: &[f64; 3], normal: &Vec3) {
        // The corners below and on the plane, in their order, with where edges pass through it.
        let mut kept = [Vec3::zeros(); 4];
        let mut count = 0;
        let mut cut: [Option<Vec3>; 2] = [None, None];
        for k in 0..3 {
            let (a, b) = (k, (k + 1) % 3);
            if depths[a] >= 0.0 {
                kept[count] = corners[a];
                count += 1;
            }
            if (depths[a] >= 0.0) != (depths[b] >= 0.0) {
                let part = depths[a] / (depths[a] - depths[b]);
                let through = corners[a] + part * (corners[b] - corners[a]);
                kept[count] = through;
                count += 1;
                // Leaving the water, or coming back to it.
                cut[usize::from(depths[a] < 0.0)] = Some(through);
            }
        }
        for k in 2..count {
            let (a, b, c) = (&kept[0], &kept[k - 1], &kept[k]);
            let volume = a.dot(&b.cross(c)) / 6.0;
            self.volume += volume;
            self.moment += 0.25 * volume * (a + b + c);
        }
        let [Some(leaves), Some(comes)] = cut else {
            return;
        };
        // The cut looks up: its boundary runs the other way than the clipped face's.
        let area = 0.5 * normal.dot(&comes.cross(&leaves));
        let sum = leaves + comes;
        self.area += area;
        self.area_moment += area / 3.0 * sum;
        self.area_second += area / 12.0
            * (leaves * leaves.transpose() + comes * comes.transpose() + sum * sum.transpose());
    }

    /// The same about a point from which this one's origin is at `origin`.
    fn about(mut self, origin: &Vec3) -> Self {
        let crossed = self.area_moment * origin.transpose();
        self.area_second += crossed + crossed.transpose() + self.area * origin * origin.transpose();
        self.area_moment += self.area * origin;
        self.moment += self.volume * origin;
        self
    }

    /// The same in the frame that the surface's frame has this pose in.
    pub fn moved(mut self, pose: &Pose) -> Self {
        let r = &pose.rotation;
        self.moment = r * self.moment;
        self.area_moment = r * self.area_moment;
        self.area_second = r * self.area_second * r.transpose();
        self.about(&pose.translation)
    }

    /// Derivatives of volume and moment as the plane's height grows by `rate` and its normal by `tilt`: it rises by `rate` − `tilt`·x at x, m.
    pub fn jvp(&self, rate: f64, tilt: &Vec3) -> (f64, Vec3) {
        (
            rate * self.area - tilt.dot(&self.area_moment),
            rate * self.area_moment - self.area_second * tilt,
        )
    }

    /// Transpose of [`Below::jvp`]: cotangents of `rate` and `tilt`.
    pub fn vjp(&self, volume_bar: f64, moment_bar: &Vec3) -> (f64, Vec3) {
        (
            volume_bar * self.area + moment_bar.dot(&self.area_moment),
            -(volume_bar * self.area_moment + self.area_second * moment_bar),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(half: [f64; 3]) -> Hull {
        let corner = |k: usize| {
            let sign = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
            Vec3::new(sign(0) * half[0], sign(1) * half[1], sign(2) * half[2])
        };
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let faces = quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
        Hull {
            vertices: (0..8).map(corner).collect(),
            faces: faces.collect(),
        }
    }

    /// The slope of what is below is none where all is, or nothing, however a level face is rounded.
    #[test]
    fn a_level_face_out_of_reach_is_no_cut() {
        let hull = cuboid([0.3, 0.2, 0.1]);
        for k in 0..40 {
            let turn = nalgebra::Rotation3::new(Vec3::new(0.37, -0.2, 0.1) * f64::from(k));
            let turned = Hull {
                vertices: hull.vertices.iter().map(|x| turn * x).collect(),
                faces: hull.faces.clone(),
            };
            let normal = turn * Vec3::z();
            for (height, volume) in [
                (0.1, 0.048),
                (0.1 + 1e-9, 0.048),
                (50.0, 0.048),
                (-0.1, 0.0),
            ] {
                let found = Below::new(&turned, &normal, height);
                assert!(
                    (found.volume - volume).abs() < 1e-15,
                    "{k} {height}: {found:?}"
                );
                assert_eq!((found.area, found.area_moment.norm()), (0.0, 0.0));
            }
        }
    }

    /// A box upright, in the water up to a height.
    #[test]
    fn an_upright_box_displaces_its_draught() {
        let half = [0.3, 0.2, 0.1];
        let hull = cuboid(half);
        for height in [-0.15, -0.1, -0.04, 0.0, 0.07, 0.1, 0.3] {
            let found = Below::new(&hull, &Vec3::z(), height);
            let draught = (height + 0.1_f64).clamp(0.0, 0.2);
            let volume = 0.24 * draught;
            assert!((found.volume - volume).abs() < 1e-15, "{found:?}");
            let center = -0.1 + 0.5 * draught;
            assert!((found.moment - Vec3::new(0.0, 0.0, volume * center)).norm() < 1e-15);
            if draught > 0.0 && draught < 0.2 {
                assert!((found.area - 0.24).abs() < 1e-15);
                let second = Mat3::from_diagonal(&Vec3::new(
                    0.24 * 0.09 / 3.0,
                    0.24 * 0.04 / 3.0,
                    0.24 * height * height,
                ));
                assert!((found.area_second - second).amax() < 1e-15);
            }
        }
    }
}
