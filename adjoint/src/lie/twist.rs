//! Cross products of spatial twists and wrenches, and their point forms.

use super::{Vec3, Vec6, angular, linear, six};

/// Lie bracket of twists, `v × m = (ω_v × u_m + u_v × ω_m, ω_v × ω_m)`: the rate of a twist `m`
/// that is carried along by `v`.
#[inline]
pub fn cross_motion(v: &Vec6, m: &Vec6) -> Vec6 {
    let (u, w) = (linear(v), angular(v));
    let (mu, mw) = (linear(m), angular(m));
    six(&(w.cross(&mu) + u.cross(&mw)), &w.cross(&mw))
}

/// Dual of [`cross_motion`]: `v ×* f = (ω × f, ω × τ + u × f)`, with
/// `(v × m) · f = −m · (v ×* f)`: the rate of a wrench or momentum `f` carried along by `v`.
#[inline]
pub fn cross_force(v: &Vec6, f: &Vec6) -> Vec6 {
    let (u, w) = (linear(v), angular(v));
    let (force, moment) = (linear(f), angular(f));
    six(&w.cross(&force), &(w.cross(&moment) + u.cross(&force)))
}

/// Velocity of the point at `x` under the spatial twist `v`.
#[inline]
pub fn point_velocity(v: &Vec6, x: &Vec3) -> Vec3 {
    linear(v) + angular(v).cross(x)
}

/// Spatial wrench of a force `f` acting at `x`; the transpose of [`point_velocity`].
#[inline]
pub fn point_wrench(x: &Vec3, f: &Vec3) -> Vec6 {
    six(f, &x.cross(f))
}
