//! A body in water that streams past it, uniformly but not steadily: what the force of still water, −A ν̇ − ν ×* A ν, lacks there.
//!
//! In the body's frame, about its origin, with its added mass A at unit density, its twist ν = (u, ω), the velocity s and the acceleration a of the undisturbed water: the
//! water's momentum is A (ν − s), s̄ = (s, 0), whose frame turns. Kirchhoff's equations of the motion through the water then have, beyond those of ν alone,
//!
//! ```text
//! W = A (a − ω × s, 0) − (ν − s̄) ×* A (ν − s̄) + ν ×* A ν
//! ```
//!
//! The pressure that accelerates the undisturbed water, ρ V a at the centre of the volume, isn't part of it.
//!
//! # References
//! H. Lamb, *Hydrodynamics*, 6th ed., Cambridge 1932, art. 124. T. R. Auton, J. C. R. Hunt, M. Prud'homme, "The force exerted on a body in inviscid unsteady non-uniform
//! rotational flow", J. Fluid Mech. 197 (1988) 241–257 (which acceleration a is where s changes in space: the water's own).

use crate::lie::{Mat6, Vec3, Vec6, angular, cross_force, cross_motion, linear, six};

/// The undisturbed water at a body, or a change of it, body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stream {
    /// s, m/s.
    pub velocity: Vec3,
    /// a, m/s².
    pub acceleration: Vec3,
}

/// Cotangents of a [`stream_wrench`]'s arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StreamBar {
    /// Of ν.
    pub nu: Vec6,
    /// Of s and a.
    pub stream: Stream,
}

fn still(velocity: &Vec3) -> Vec6 {
    six(velocity, &Vec3::zeros())
}

/// W at unit density.
pub fn stream_wrench(added: &Mat6, nu: &Vec6, stream: &Stream) -> Vec6 {
    let past = nu - still(&stream.velocity);
    let rate = stream.acceleration - angular(nu).cross(&stream.velocity);
    added * still(&rate) - cross_force(&past, &(added * past)) + cross_force(nu, &(added * nu))
}

/// Derivative of [`stream_wrench`] along changes of ν, s and a.
pub fn stream_wrench_jvp(
    added: &Mat6,
    nu: &Vec6,
    stream: &Stream,
    dnu: &Vec6,
    dstream: &Stream,
) -> Vec6 {
    let carried =
        |x: &Vec6, dx: &Vec6| cross_force(dx, &(added * x)) + cross_force(x, &(added * dx));
    let (past, dpast) = (nu - still(&stream.velocity), dnu - still(&dstream.velocity));
    let drate = dstream.acceleration
        - angular(dnu).cross(&stream.velocity)
        - angular(nu).cross(&dstream.velocity);
    added * still(&drate) - carried(&past, &dpast) + carried(nu, dnu)
}

/// Transpose of [`stream_wrench_jvp`].
pub fn stream_wrench_vjp(added: &Mat6, nu: &Vec6, stream: &Stream, w_bar: &Vec6) -> StreamBar {
    // Of x ×* A x.
    let carried =
        |x: &Vec6| -cross_force(w_bar, &(added * x)) - added.tr_mul(&cross_motion(x, w_bar));
    let past = nu - still(&stream.velocity);
    let past_bar = -carried(&past);
    let rate_bar = linear(&added.tr_mul(w_bar));
    StreamBar {
        nu: past_bar + carried(nu) + six(&Vec3::zeros(), &rate_bar.cross(&stream.velocity)),
        stream: Stream {
            velocity: angular(nu).cross(&rate_bar) - linear(&past_bar),
            acceleration: rate_bar,
        },
    }
}
