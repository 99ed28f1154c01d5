//! A face's part of a bearing: its elements, and where they are integrated.
//!
//! The pressure falls like 1/H² on the flanks of a curved gap, so that is what the elements do: p = w/H² with w linear on the face. With the logarithm
//! L = ln H, quadratic from its values at the corners and halfway along the edges,
//!
//! ```text
//! H³ ∇p_u·∇p_v = e^(−L) (∇u − 2u ∇L)·(∇v − 2v ∇L)
//! ```

use super::patch::Patch;
use crate::adjoint::lie::{Pose, Vec3};
use nalgebra::Matrix3;

/// Points of a rule on triangles that is exact to the fourth degree: two rings of three, the larger of whose barycentric coordinates are these; with their weights
/// (D. Dunavant, 1985).
const RINGS: [(f64, f64); 2] = [
    (0.108_103_018_168_070, 0.223_381_589_678_011),
    (0.816_847_572_980_459, 0.109_951_743_655_322),
];
/// Cosine between a face and the way across from which on it is a side: it doesn't push, and leads into the open.
const SIDE: f64 = 0.3;
/// Cosine between a vertex' normal and a face's from which on the surface is round there.
const ROUND: f64 = 0.9;

/// A face.
pub(super) struct Cell {
    /// Spots.
    pub corners: [usize; 3],
    /// Spots halfway along the edges that begin at the corners.
    pub halves: [usize; 3],
    /// m²
    pub area: f64,
    /// Unit normals at the corners, in the frame of what is opposite: of the surface where it is round, else of the face.
    pub normals: [Vec3; 3],
    /// Of the face.
    pub normal: Vec3,
    /// ∇φ_i in the columns, 1/m.
    pub gradients: Matrix3<f64>,
    /// Cosine between its normal and the mean way across.
    facing: f64,
}

/// A point of a face that it is integrated at.
pub(super) struct Point {
    /// The corners' shares.
    pub shares: [f64; 3],
    /// Of the face's area, m².
    pub weight: f64,
    /// ln H.
    pub log: f64,
    /// ∇ ln H.
    pub slope: Vec3,
}

impl Cell {
    pub fn new(
        patch: &Patch,
        relative: &Pose,
        (corners, halves): &([usize; 3], [usize; 3]),
    ) -> Option<Self> {
        let points = corners.map(|s| patch.spots[s].point);
        let across = (points[1] - points[0]).cross(&(points[2] - points[0]));
        let size = across.norm();
        let normal = across.try_normalize(0.0)?;
        let slope = |i: usize| normal.cross(&(points[(i + 2) % 3] - points[(i + 1) % 3])) / size;
        let way: Vec3 = corners.map(|s| patch.spots[s].field.gradient).iter().sum();
        let at = |s: usize| {
            let own = relative.rotation * patch.spots[s].normal;
            if own.dot(&normal) > ROUND {
                own
            } else {
                normal
            }
        };
        Some(Self {
            corners: *corners,
            halves: *halves,
            area: 0.5 * size,
            normals: corners.map(at),
            gradients: Matrix3::from_columns(&[0, 1, 2].map(slope)),
            facing: -normal.dot(&way) / 3.0,
            normal,
        })
    }

    /// How far it looks across, and the derivative by its facing.
    pub fn looks(&self) -> [f64; 2] {
        let [left, slope] = fade(self.facing / SIDE);
        [1.0 - left, -slope / SIDE]
    }

    /// The points that it is integrated at, from the logarithms of the thickness at its corners and halfway along its edges.
    pub fn points(&self, [corners, halves]: &[[f64; 3]; 2]) -> [Point; 6] {
        std::array::from_fn(|k| {
            let (large, weight) = RINGS[k / 3];
            let shares: [f64; 3] = std::array::from_fn(|i| {
                if i == k % 3 {
                    large
                } else {
                    0.5 * (1.0 - large)
                }
            });
            let (mut log, mut slope) = (0.0, Vec3::zeros());
            for (k, (value, gradient)) in self.quadratic(&shares).into_iter().enumerate() {
                let own = if k < 3 { corners[k] } else { halves[k - 3] };
                log += value * own;
                slope += own * gradient;
            }
            Point {
                shares,
                weight: weight * self.area,
                log,
                slope,
            }
        })
    }

    /// Quadratic functions that are 1 at one of the corners, or halfway along one of the edges, and 0 at the others: value and gradient.
    pub fn quadratic(&self, shares: &[f64; 3]) -> [(f64, Vec3); 6] {
        std::array::from_fn(|k| {
            let (i, j) = (k % 3, (k + 1) % 3);
            let [a, b] = [i, j].map(|i| self.gradients.column(i).into_owned());
            let (x, y) = (shares[i], shares[j]);
            match k < 3 {
                true => (x * (2.0 * x - 1.0), (4.0 * x - 1.0) * a),
                false => (4.0 * x * y, 4.0 * (x * b + y * a)),
            }
        })
    }
}

impl Point {
    /// Of a linear function with these values at the corners, which has the gradient `along`: u, and ∇u − 2u ∇L.
    pub fn pressed(&self, values: &[f64; 3], along: &Vec3) -> (f64, Vec3) {
        let u = self.mean(values);
        (u, along - 2.0 * u * self.slope)
    }

    pub fn mean(&self, values: &[f64; 3]) -> f64 {
        (0..3).map(|i| self.shares[i] * values[i]).sum()
    }

    pub fn mean_vector(&self, values: &[Vec3; 3]) -> Vec3 {
        (0..3).map(|i| self.shares[i] * values[i]).sum()
    }
}

/// From 1 at 0 to 0 at 1, and its derivative; twice continuously differentiable.
pub(super) fn fade(t: f64) -> [f64; 2] {
    if t <= 0.0 {
        [1.0, 0.0]
    } else if t >= 1.0 {
        [0.0; 2]
    } else {
        [
            1.0 - t.powi(3) * (10.0 + t * (6.0 * t - 15.0)),
            -30.0 * (t * (1.0 - t)).powi(2),
        ]
    }
}
