//! A sphere in the flow of a point source, in closed form.
//!
//! The source `1/|x − y|` outside a sphere of radius a around the origin has its image in the point
//! y' = a² y/|y|², of strength a/|y|, and in a line of sinks of strength −1/a per length from the centre to
//! y':
//!
//! ```text
//! φ = (a/|y|) / |x − y'| − (1/a) ∫₀^{|y'|} ds / |x − s y/|y||
//!   = Σ_l l/(l+1) a^{2l+1} P_l(cos γ) / (|x| |y|)^{l+1}
//! ```
//!
//! The line's potential is ln[(|x| + |x − y'| + |y'|) / (|x| + |x − y'| − |y'|)]: right in all directions.
//!
//! # References
//! P. Weiss, "On hydrodynamical images: arbitrary irrotational flow disturbed by a sphere", Proc. Camb.
//! Phil. Soc. 40 (1944) 259–261.

use crate::adjoint::lie::Vec3;

/// Potential at x of the flow that the sphere adds to a unit source at y; both outside, m. 1/m.
pub(super) fn image(radius: f64, y: &Vec3, x: &Vec3) -> f64 {
    let (far, near) = (y.norm(), x.norm());
    let depth = radius * (radius / far);
    let image = y * (depth / far);
    let distance = (x - image).norm();
    let sum = near + distance;
    let line = (2.0 * depth / (sum - depth)).ln_1p();
    (radius / far) / distance - line / radius
}
