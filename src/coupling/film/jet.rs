//! Numbers that carry their derivatives along a displacement of six components.

use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6};
use crate::geometry::Field;
use nalgebra::{Const, U1};
use num_dual::{Derivative, Dual2SVec64, DualNum, DualSVec64};

/// A value, with its first derivatives or its second ones too.
pub(super) trait Jet: DualNum<Primitive = f64> + Copy + Send + Sync {
    /// Component `k` of a displacement that hasn't happened yet.
    fn component(k: usize) -> Self;

    /// Its first derivative; zero where it carries none.
    fn first(&self) -> Vec6;

    /// Its second derivative; zero where it carries none.
    fn second(&self) -> Mat6;

    /// The displacement, linear part first.
    fn displacement() -> [Self; 6] {
        std::array::from_fn(Self::component)
    }
}

impl Jet for f64 {
    fn component(_: usize) -> Self {
        0.0
    }

    fn first(&self) -> Vec6 {
        Vec6::zeros()
    }

    fn second(&self) -> Mat6 {
        Mat6::zeros()
    }
}

impl Jet for DualSVec64<6> {
    fn component(k: usize) -> Self {
        Self::from_re(0.0).derivative(k)
    }

    fn first(&self) -> Vec6 {
        self.eps.unwrap_generic(Const::<6>, U1)
    }

    fn second(&self) -> Mat6 {
        Mat6::zeros()
    }
}

impl Jet for Dual2SVec64<6> {
    fn component(k: usize) -> Self {
        Self::from_re(0.0).derivative(k)
    }

    fn first(&self) -> Vec6 {
        self.v1.unwrap_generic(U1, Const::<6>).transpose()
    }

    fn second(&self) -> Mat6 {
        let none = Derivative::none();
        match &self.v2 {
            v2 if *v2 == none => Mat6::zeros(),
            v2 => v2.unwrap_generic(Const::<6>, Const::<6>),
        }
    }
}

/// A vector of them.
pub(super) type Vector<D> = [D; 3];

pub(super) fn constant<D: Jet>(x: &Vec3) -> Vector<D> {
    [D::from(x.x), D::from(x.y), D::from(x.z)]
}

pub(super) fn real<D: Jet>(x: &Vector<D>) -> Vec3 {
    Vec3::new(x[0].re(), x[1].re(), x[2].re())
}

pub(super) fn dot<D: Jet>(x: &Vector<D>, y: &Vec3) -> D {
    x[0] * y.x + x[1] * y.y + x[2] * y.z
}

pub(super) fn add<D: Jet>(x: &Vector<D>, y: &Vector<D>) -> Vector<D> {
    std::array::from_fn(|i| x[i] + y[i])
}

pub(super) fn scale<D: Jet>(factor: D, x: &Vector<D>) -> Vector<D> {
    x.map(|x| factor * x)
}

fn cross<D: Jet>(x: &Vector<D>, y: &Vector<D>) -> Vector<D> {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        x[j] * y[k] - x[k] * y[j]
    })
}

fn parts<D: Jet>(z: &[D; 6]) -> (Vector<D>, Vector<D>) {
    ([z[0], z[1], z[2]], [z[3], z[4], z[5]])
}

/// `exp(z) x` of a direction, to second order in the displacement z.
fn turned<D: Jet>(z: &[D; 6], x: &Vector<D>) -> Vector<D> {
    let omega = parts(z).1;
    let once = cross(&omega, x);
    let twice = cross(&omega, &once);
    std::array::from_fn(|i| x[i] + once[i] + twice[i] * 0.5)
}

/// A frame that is displaced: exact to the second order that is asked for.
#[derive(Clone, Copy)]
pub(super) struct Displaced<'a, D> {
    pub pose: &'a Pose,
    /// In the frame that the pose leads to.
    pub by: [D; 6],
}

impl<'a, D: Jet> Displaced<'a, D> {
    pub fn new(pose: &'a Pose) -> Self {
        Self {
            pose,
            by: D::displacement(),
        }
    }

    /// A point of the frame.
    pub fn apply(&self, x: &Vec3) -> Vector<D> {
        let p = constant(&self.pose.apply(x));
        let (v, omega) = parts(&self.by);
        let twice = cross(&omega, &v);
        let turned = turned(&self.by, &p);
        std::array::from_fn(|i| turned[i] + v[i] + twice[i] * 0.5)
    }

    /// A direction of the frame.
    pub fn rotate(&self, x: &Vector<D>) -> Vector<D> {
        let r = &self.pose.rotation;
        let x = std::array::from_fn(|i| x[0] * r[(i, 0)] + x[1] * r[(i, 1)] + x[2] * r[(i, 2)]);
        turned(&self.by, &x)
    }

    /// A direction of where the pose leads to, in the frame.
    pub fn rotate_inverse(&self, x: &Vec3) -> Vector<D> {
        let back = self.by.map(|z| -z);
        let x = turned(&back, &constant(x));
        let r = &self.pose.rotation;
        std::array::from_fn(|i| x[0] * r[(0, i)] + x[1] * r[(1, i)] + x[2] * r[(2, i)])
    }

    /// A twist of where the pose leads to, in the frame.
    pub fn twist_to_body(&self, x: &Vec6) -> [D; 6] {
        let x: [D; 6] = std::array::from_fn(|i| D::from(x[i]));
        let once = bracket(&self.by, &x);
        let twice = bracket(&self.by, &once);
        let y: [D; 6] = std::array::from_fn(|i| x[i] - once[i] + twice[i] * 0.5);
        let (u, w) = parts(&y);
        let arm = cross(&constant(&self.pose.translation), &w);
        let r = &self.pose.rotation;
        let back = |x: [D; 3]| -> [D; 3] {
            std::array::from_fn(|i| x[0] * r[(0, i)] + x[1] * r[(1, i)] + x[2] * r[(2, i)])
        };
        let (u, w) = (back(std::array::from_fn(|i| u[i] - arm[i])), back(w));
        [u[0], u[1], u[2], w[0], w[1], w[2]]
    }
}

/// `[z, x]`: how the twist x changes along z.
fn bracket<D: Jet>(z: &[D; 6], x: &[D; 6]) -> [D; 6] {
    let ((v, omega), (u, w)) = (parts(z), parts(x));
    let (a, b) = (cross(&omega, &u), cross(&v, &w));
    let c = cross(&omega, &w);
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], c[0], c[1], c[2]]
}

/// A distance whose field is known at a point, from where the point goes.
pub(super) fn distance<D: Jet>(field: &Field, at: &Vector<D>) -> D {
    let from = real(at);
    let way: Vector<D> = std::array::from_fn(|i| at[i] - from[i]);
    let h = &field.hessian;
    let bent: Vector<D> =
        std::array::from_fn(|i| way[0] * h[(i, 0)] + way[1] * h[(i, 1)] + way[2] * h[(i, 2)]);
    let square = way[0] * bent[0] + way[1] * bent[1] + way[2] * bent[2];
    dot(&way, &field.gradient) + square * 0.5 + field.distance
}
