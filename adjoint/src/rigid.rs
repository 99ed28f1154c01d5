//! Spatial inertia of a rigid body in its own frame.

use crate::lie::{Mat3, Mat6, Vec3, skew};

/// Inertia matrix about the centre of mass from xx, yy, zz, xy, xz, yz (kg m²).
pub fn inertia_matrix(i: &[f64; 6]) -> Mat3 {
    Mat3::new(i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2])
}

/// 6 × 6 inertia about the body's origin, body axes, linear part first:
/// `[m 1, −m [c]×; m [c]×, I − m [c]×²]` (Eq. 6 when the centre of mass c is the origin).
pub fn spatial_inertia(mass: f64, center: &Vec3, inertia: &[f64; 6]) -> Mat6 {
    let c = skew(center);
    let mut out = Mat6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(Mat3::identity() * mass));
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-mass * c));
    out.fixed_view_mut::<3, 3>(3, 0).copy_from(&(mass * c));
    out.fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&(inertia_matrix(inertia) - mass * c * c));
    out
}

/// Cotangents of a [`spatial_inertia`]'s arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertiaBar {
    /// Of the mass.
    pub mass: f64,
    /// Of the centre of mass.
    pub center: Vec3,
    /// Of xx, yy, zz, xy, xz, yz.
    pub inertia: [f64; 6],
}

/// Transpose of [`spatial_inertia`], which is linear in mass and inertia and quadratic in the centre: `∂/∂c_k` of its blocks is `−m [e_k]×`, `m [e_k]×` and
/// `−m ([e_k]× [c]× + [c]× [e_k]×)`.
pub fn spatial_inertia_vjp(mass: f64, center: &Vec3, bar: &Mat6) -> InertiaBar {
    let unit = spatial_inertia(1.0, center, &[0.0; 6]);
    let block = |i: usize, j: usize| bar.fixed_view::<3, 3>(3 * i, 3 * j).into_owned();
    let (across, back, a) = (block(0, 1), block(1, 0), block(1, 1));
    let c = skew(center);
    let slope = |k: usize| {
        let e = skew(&Vec3::ith(k, 1.0));
        mass * ((back - across).dot(&e) - a.dot(&(e * c + c * e)))
    };
    InertiaBar {
        mass: bar.dot(&unit),
        center: Vec3::new(slope(0), slope(1), slope(2)),
        inertia: [
            a[(0, 0)],
            a[(1, 1)],
            a[(2, 2)],
            a[(0, 1)] + a[(1, 0)],
            a[(0, 2)] + a[(2, 0)],
            a[(1, 2)] + a[(2, 1)],
        ],
    }
}
