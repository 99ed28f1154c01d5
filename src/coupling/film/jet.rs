//! Numbers that may carry their rate along one displacement, and frames that are displaced.

use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::geometry::Field;
use num_dual::{Dual64, DualNum};

/// A value, or one with its rate.
pub(super) trait Jet: DualNum<Primitive = f64> + Copy + Send + Sync {
    /// Whether it has a rate.
    const MOVES: bool;

    /// Of a value and its rate.
    fn moving(value: f64, rate: f64) -> Self;

    /// Its rate; zero where it carries none.
    fn rate(&self) -> f64;
}

impl Jet for f64 {
    const MOVES: bool = false;

    fn moving(value: f64, _: f64) -> Self {
        value
    }

    fn rate(&self) -> f64 {
        0.0
    }
}

impl Jet for Dual64 {
    const MOVES: bool = true;

    fn moving(value: f64, rate: f64) -> Self {
        Self::new(value, rate)
    }

    fn rate(&self) -> f64 {
        self.eps
    }
}

/// A vector of them.
pub(super) type Vector<D> = [D; 3];
/// A twist or a wrench of them, linear part first.
pub(super) type Screw<D> = [D; 6];

pub(super) fn zero<D: Jet>() -> Vector<D> {
    [D::from(0.0); 3]
}

pub(super) fn constant<D: Jet>(x: &Vec3) -> Vector<D> {
    [D::from(x.x), D::from(x.y), D::from(x.z)]
}

pub(super) fn real<D: Jet>(x: &Vector<D>) -> Vec3 {
    Vec3::new(x[0].re(), x[1].re(), x[2].re())
}

pub(super) fn screw<D: Jet>(x: &Vec6) -> Screw<D> {
    std::array::from_fn(|i| D::from(x[i]))
}

/// Values and rates.
pub(super) fn rates<D: Jet>(x: &Screw<D>) -> (Vec6, Vec6) {
    (
        Vec6::from_fn(|i, _| x[i].re()),
        Vec6::from_fn(|i, _| x[i].rate()),
    )
}

pub(super) fn dot<D: Jet>(x: &Vector<D>, y: &Vec3) -> D {
    x[0] * y.x + x[1] * y.y + x[2] * y.z
}

pub(super) fn product<D: Jet>(x: &Vector<D>, y: &Vector<D>) -> D {
    x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
}

pub(super) fn add<D: Jet>(x: &Vector<D>, y: &Vector<D>) -> Vector<D> {
    std::array::from_fn(|i| x[i] + y[i])
}

pub(super) fn minus<D: Jet>(x: &Vector<D>) -> Vector<D> {
    x.map(|x| -x)
}

pub(super) fn scale<D: Jet>(factor: D, x: &Vector<D>) -> Vector<D> {
    x.map(|x| factor * x)
}

/// Adds a multiple of a screw.
pub(super) fn add_scaled<D: Jet>(to: &mut Screw<D>, factor: D, x: &Screw<D>) {
    (0..6).for_each(|i| to[i] += factor * x[i]);
}

pub(super) fn cross<D: Jet>(x: &Vector<D>, y: &Vector<D>) -> Vector<D> {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        x[j] * y[k] - x[k] * y[j]
    })
}

pub(super) fn parts<D: Jet>(z: &Screw<D>) -> (Vector<D>, Vector<D>) {
    ([z[0], z[1], z[2]], [z[3], z[4], z[5]])
}

pub(super) fn whole<D: Jet>(u: &Vector<D>, w: &Vector<D>) -> Screw<D> {
    [u[0], u[1], u[2], w[0], w[1], w[2]]
}

/// What the twist x does to the momentum of a wrench f as it displaces it.
pub(super) fn cross_force<D: Jet>(x: &Screw<D>, f: &Screw<D>) -> Screw<D> {
    let ((u, w), (force, torque)) = (parts(x), parts(f));
    let turned = add(&cross(&w, &torque), &cross(&u, &force));
    whole(&cross(&w, &force), &turned)
}

/// A frame, with the rate of its displacement.
#[derive(Clone, Copy)]
pub(super) struct Displaced<'a, D> {
    pose: &'a Pose,
    /// In the frame that the pose leads to.
    by: Screw<D>,
}

impl<'a, D: Jet> Displaced<'a, D> {
    pub fn new(pose: &'a Pose, along: &Vec6) -> Self {
        Self {
            pose,
            by: std::array::from_fn(|k| D::moving(0.0, along[k])),
        }
    }

    /// A point of the frame.
    pub fn apply(&self, x: &Vec3) -> Vector<D> {
        let p = constant(&self.pose.apply(x));
        let (v, omega) = parts(&self.by);
        let turned = cross(&omega, &p);
        std::array::from_fn(|i| p[i] + v[i] + turned[i])
    }

    /// A direction of the frame.
    pub fn rotate(&self, x: &Vector<D>) -> Vector<D> {
        let r = &self.pose.rotation;
        let x = std::array::from_fn(|i| x[0] * r[(i, 0)] + x[1] * r[(i, 1)] + x[2] * r[(i, 2)]);
        add(&x, &cross(&parts(&self.by).1, &x))
    }

    /// A direction of where the pose leads to, in the frame.
    pub fn rotate_inverse(&self, x: &Vector<D>) -> Vector<D> {
        let x = add(x, &minus(&cross(&parts(&self.by).1, x)));
        let r = &self.pose.rotation;
        std::array::from_fn(|i| x[0] * r[(0, i)] + x[1] * r[(1, i)] + x[2] * r[(2, i)])
    }

    fn origin(&self) -> Vector<D> {
        self.apply(&Vec3::zeros())
    }

    /// A twist of where the pose leads to, in the frame.
    pub fn twist_to_body(&self, x: &Vec6) -> Screw<D> {
        let (u, w) = parts(&screw(x));
        let u = add(&u, &minus(&cross(&self.origin(), &w)));
        whole(&self.rotate_inverse(&u), &self.rotate_inverse(&w))
    }

    /// A wrench of the frame, where the pose leads to.
    pub fn wrench_to_world(&self, f: &Screw<D>) -> Screw<D> {
        let (force, torque) = parts(f);
        let (force, torque) = (self.rotate(&force), self.rotate(&torque));
        whole(&force, &add(&torque, &cross(&self.origin(), &force)))
    }
}

/// A distance and its gradient.
#[derive(Clone, Copy)]
pub(super) struct Distance<D> {
    pub value: D,
    pub gradient: Vector<D>,
}

impl<D: Jet> Distance<D> {
    /// From the field at where the point is.
    pub fn new(field: &Field, at: &Vector<D>) -> Self {
        if !D::MOVES {
            return Self {
                value: D::from(field.distance),
                gradient: constant(&field.gradient),
            };
        }
        let from = real(at);
        let way: Vector<D> = std::array::from_fn(|i| at[i] - from[i]);
        let (g, h) = (&field.gradient, &field.hessian);
        Self {
            value: dot(&way, g) + field.distance,
            gradient: std::array::from_fn(|i| {
                way[0] * h[(i, 0)] + way[1] * h[(i, 1)] + way[2] * h[(i, 2)] + g[i]
            }),
        }
    }
}
