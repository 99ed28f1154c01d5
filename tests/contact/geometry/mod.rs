//! Contact points: known answers, slopes against differences, symmetry, agreement with GJK.

mod cylinder;
mod extremes;
mod gjk;
mod invariance;
mod known;
mod neighbours;
mod slopes;
mod smooth;
mod sunk;

use hydrograd::adjoint::lie::{Mat3, Pose, Vec3, Vec6, exp_matrix, point_velocity};
use hydrograd::adjoint::sample::Samples;
use hydrograd::contact::{ContactPoint, ContactShape, against_wall, between};
use hydrograd::geometry::HalfSpace;
use hydrograd::shape::{TriMesh, build};
use hydrograd::{Error, Shape};
use std::path::Path;

/// Numbers, vectors, poses and choices.
struct Draw(Samples);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(Samples::new(seed))
    }

    fn number(&mut self) -> f64 {
        self.0.number()
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::from(self.0.vector(1.0))
    }

    fn pose(&mut self) -> Pose {
        Pose::new(exp_matrix(&(3.0 * self.vector())), self.vector())
    }

    fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.0.below(from.len())]
    }
}

/// A prism with a trapezium for its profile, given clockwise.
fn wedge() -> Shape {
    Shape::prism(
        vec![[-0.2, -0.1], [-0.15, 0.1], [0.25, 0.1], [0.3, -0.1]],
        0.6,
    )
}

fn cylinder() -> Shape {
    Shape::cylinder(0.15, 0.3)
}

fn plain(shape: &Shape) -> ContactShape {
    ContactShape::of_shape(shape, Pose::identity(), Path::new(".")).unwrap()
}

fn offset(shape: &Shape, offset: Pose) -> ContactShape {
    ContactShape::of_shape(shape, offset, Path::new(".")).unwrap()
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::new(Mat3::identity(), Vec3::new(x, y, z))
}

fn turned(rotation: [f64; 3], translation: [f64; 3]) -> Pose {
    Pose::new(exp_matrix(&Vec3::from(rotation)), Vec3::from(translation))
}

fn smallest(points: &[ContactPoint]) -> f64 {
    let full = points.iter().filter(|p| p.weight >= 1.0 - 1e-12);
    full.map(|p| p.gap).fold(f64::INFINITY, f64::min)
}

fn is_finite(p: &ContactPoint) -> bool {
    let s = &p.slopes;
    let values = [p.gap, p.weight];
    let vectors = p.normal.iter().chain(p.position.iter());
    let slopes = s.gap.iter().chain(s.weight.iter());
    let rows = s.normal.iter().chain(s.position.iter());
    values
        .iter()
        .chain(vectors)
        .chain(slopes)
        .chain(rows)
        .all(|x| x.is_finite())
        && (p.normal.norm() - 1.0).abs() < 1e-12
        && (0.0..=1.0).contains(&p.weight)
}

fn every_kind() -> Vec<Shape> {
    vec![
        Shape::sphere(0.12),
        Shape::capsule(0.06, 0.4),
        Shape::ellipsoid([0.2, 0.05, 0.2]),
        Shape::ellipsoid([0.12, 0.18, 0.25]),
        Shape::cuboid([0.3, 0.2, 0.4]),
        wedge(),
        cylinder(),
    ]
}

/// Moves `a` along `away`, from afar towards where the centres meet, until the smallest gap is `gap`.
fn approach(
    a: &ContactShape,
    b: &ContactShape,
    from: &Pose,
    rest: &Pose,
    away: &Vec3,
    gap: f64,
) -> Pose {
    let meet = b.ball_at(rest).center - a.ball_at(from).center + from.translation;
    let moved = |t: f64| Pose::new(from.rotation, meet + t * away);
    // Half faded points too: where a cylinder stands nearly flat none is full.
    let is_apart = |t: f64| {
        let points = between(a, b, &moved(t), rest, 10.0).unwrap();
        points.iter().all(|p| p.gap > gap || p.weight < 0.5)
    };
    let mut high = 2.0 * (a.radius() + b.radius()) + 2.0;
    // Deep in one another, where points have faded, bodies may look apart.
    let step = high / 200.0;
    let mut low = high;
    while low > 0.0 && is_apart(low) {
        (high, low) = (low, low - step);
    }
    for _ in 0..60 {
        let t = 0.5 * (low + high);
        if is_apart(t) {
            high = t;
        } else {
            low = t;
        }
    }
    moved(high)
}
