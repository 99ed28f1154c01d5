//! The exact surfaces that meshes stand for.

use hydrograd_adjoint::lie::Vec3;

/// Height above a cylinder's end, as a part of its length, that still counts as on it.
const LEVEL: f64 = 1e-9;

/// The exact surface that a mesh stands for: where it is curved, and how it is reached.
#[derive(Clone, Debug, PartialEq)]
pub enum ExactSurface {
    /// Flat faces only.
    Flat,
    /// An ellipsoid along the axes: its semi-axes, m.
    Ellipsoid(Vec3),
    /// About z; its ends are flat.
    Cylinder {
        /// m.
        radius: f64,
        /// Half its length, m.
        half: f64,
    },
    /// About z, with hemispherical ends.
    Capsule {
        /// m.
        radius: f64,
        /// Half the length of the straight part, m.
        half: f64,
    },
}

impl ExactSurface {
    /// Whether a face stands for a curved part.
    pub(super) fn curved(&self, corners: &[Vec3; 3]) -> bool {
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
    pub(super) fn onto(&self, x: &Vec3) -> Vec3 {
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
