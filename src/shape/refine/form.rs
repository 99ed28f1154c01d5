//! The surfaces that meshes of shapes by formula stand for.

use crate::scene::Shape;
use hydrograd_adjoint::lie::Vec3;

/// Height above a cylinder's end, as a part of its length, that still counts as on it.
const LEVEL: f64 = 1e-9;

/// Where a surface is curved, and how it is reached.
pub(super) enum Form {
    /// Flat faces only.
    Flat,
    /// An ellipsoid along the axes.
    Ellipsoid(Vec3),
    /// About z; its ends are flat.
    Cylinder { radius: f64, half: f64 },
    /// About z; `half` is half the length of the straight part.
    Capsule { radius: f64, half: f64 },
}

impl Form {
    pub fn of(shape: &Shape) -> Self {
        match *shape {
            Shape::Sphere { radius, .. } => Self::Ellipsoid(Vec3::repeat(radius)),
            Shape::Ellipsoid { semi_axes, .. } => Self::Ellipsoid(semi_axes.into()),
            Shape::Cylinder { radius, length, .. } => Self::Cylinder {
                radius,
                half: 0.5 * length,
            },
            Shape::Capsule { radius, length, .. } => Self::Capsule {
                radius,
                half: 0.5 * length,
            },
            Shape::Box { .. }
            | Shape::Prism { .. }
            | Shape::Mesh { .. }
            | Shape::Triangles { .. } => Self::Flat,
        }
    }

    /// Whether a face stands for a curved part.
    pub fn curved(&self, corners: &[Vec3; 3]) -> bool {
        match self {
            Self::Flat => false,
            Self::Ellipsoid(_) | Self::Capsule { .. } => true,
            Self::Cylinder { half, .. } => {
                let at = |end: f64| corners.iter().all(|c| (c.z - end).abs() <= LEVEL * half);
                !at(*half) && !at(-half)
            }
        }
    }

    /// The point of the curved part that `x`, the middle of a chord, stands for: the same way as the base
    /// mesh is laid out, so that an ellipsoid's is a stretched sphere's.
    pub fn onto(&self, x: &Vec3) -> Vec3 {
        match self {
            Self::Flat => *x,
            Self::Ellipsoid(axes) => over(x, x.component_div(axes).norm()),
            Self::Cylinder { radius, .. } => about_z(x, x.z, *radius),
            Self::Capsule { radius, half } => about_z(x, x.z.clamp(-half, *half), *radius),
        }
    }
}

/// `x` over a number; itself where there is no direction outwards.
fn over(x: &Vec3, size: f64) -> Vec3 {
    let out = x / size;
    match out.iter().all(|c| c.is_finite()) {
        true => out,
        false => *x,
    }
}

/// The point at `radius` from the point of the axis at height `z`, towards `x`.
fn about_z(x: &Vec3, z: f64, radius: f64) -> Vec3 {
    let axis = Vec3::new(0.0, 0.0, z);
    let away = x - axis;
    let out = over(&away, away.norm() / radius);
    // A chord of a straight part stays at its height to the last bit.
    match x.z == z {
        true => Vec3::new(out.x, out.y, z),
        false => axis + out,
    }
}
