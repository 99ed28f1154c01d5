//! Drag summed over a body's surface: the linear law of Eq. 22 and a quadratic one.
//!
//! With ν = (u, ω) the body's twist through the water in its own frame, the surface point x moves
//! with u + ω × x, of which the part w = Π(u + ω × x) drags: along the surface (Eq. 22), across
//! it, or all of it.

use crate::lie::{Mat3, Mat6, Vec3, Vec6, angular, linear, six, skew};

/// Which part of the surface velocity drags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Part {
    /// Along the surface, Π = 1 − nnᵀ (Eq. 22).
    #[default]
    Tangential,
    /// Across the surface, Π = nnᵀ.
    Normal,
    /// Π = 1.
    Total,
}

/// One flat piece of surface in the body's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// Centre, m.
    pub center: Vec3,
    /// Unit outward normal.
    pub normal: Vec3,
    /// Area, m².
    pub area: f64,
}

impl Part {
    fn projector(self, n: &Vec3) -> Mat3 {
        match self {
            Part::Tangential => Mat3::identity() - n * n.transpose(),
            Part::Normal => n * n.transpose(),
            Part::Total => Mat3::identity(),
        }
    }

    /// The projector as a multiple of 1 and one of nnᵀ.
    fn weights(self) -> [f64; 2] {
        match self {
            Part::Tangential => [1.0, -1.0],
            Part::Normal => [0.0, 1.0],
            Part::Total => [1.0, 0.0],
        }
    }

    /// The projector times `s`.
    fn project(self, n: &Vec3, s: Vec3) -> Vec3 {
        match self {
            Part::Tangential => s - n * n.dot(&s),
            Part::Normal => n * n.dot(&s),
            Part::Total => s,
        }
    }
}

/// Resistance at unit coefficient, Σ ΔA Gᵀ Π G with `G = [1, −[x]×]`: constant in the body's frame,
/// symmetric positive semi-definite; the wrench is `−coefficient · resistance · ν` (m², m³, m⁴).
pub fn resistance(surface: &[Element], part: Part) -> Mat6 {
    let mut out = Mat6::zeros();
    for e in surface {
        let p = part.projector(&e.normal) * e.area;
        let x = skew(&e.center);
        let px = p * x;
        let corner = -(x * px);
        for i in 0..3 {
            for j in 0..3 {
                out[(i, j)] += p[(i, j)];
                out[(i, j + 3)] -= px[(i, j)];
                out[(j + 3, i)] -= px[(i, j)];
                out[(i + 3, j + 3)] += corner[(i, j)];
            }
        }
    }
    out
}

/// Quadratic drag at unit coefficient: wrench `−½ Σ ΔA |w| w` about the body's origin, body frame
/// (to be multiplied by ρ and the dimensionless coefficient).
pub fn quadratic_drag(surface: &[Element], part: Part, nu: &Vec6) -> Vec6 {
    let (u, o) = (linear(nu), angular(nu));
    let (mut force, mut moment) = (Vec3::zeros(), Vec3::zeros());
    for e in surface {
        let w = part.project(&e.normal, u + o.cross(&e.center));
        let f = -0.5 * e.area * w.norm() * w;
        force += f;
        moment += e.center.cross(&f);
    }
    six(&force, &moment)
}

/// Derivative matrix of [`quadratic_drag`] with respect to ν: symmetric, negative
/// semi-definite, and zero (not 0/0) for an element at rest.
pub fn quadratic_drag_derivative(surface: &[Element], part: Part, nu: &Vec6) -> Mat6 {
    let (u, o) = (linear(nu), angular(nu));
    // Σ d, Σ d [x]× and Σ [x]× d [x]×, d = −½ ΔA d(|w| w)/dw Π.
    let mut sums = [Mat3::zeros(); 3];
    for e in surface {
        let (n, x) = (&e.normal, &e.center);
        let w = part.project(n, u + o.cross(x));
        let speed = w.norm();
        if speed == 0.0 {
            continue;
        }
        // d(|w|w) = (|w| 1 + w wᵀ/|w|) Π; Π is a projector and w lies in its range.
        let [same, across] = part.weights();
        let scale = -0.5 * e.area;
        let (along, by_normal) = (scale / speed * w, scale * speed * across * n);
        let mut d = along * w.transpose() + by_normal * n.transpose();
        for i in 0..3 {
            d[(i, i)] += scale * speed * same;
        }
        // Rows of d [x]× are d's crossed with x, columns of [x]× y are crossed with x.
        let rows = [0, 1, 2].map(|i| d.column(i).cross(x));
        let dx = Mat3::from_columns(&rows).transpose();
        sums[0] += d;
        sums[1] += dx;
        sums[2] += Mat3::from_columns(&[0, 1, 2].map(|i| x.cross(&dx.column(i))));
    }
    let [d, dx, xdx] = sums;
    let mut out = Mat6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&d);
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&-dx);
    out.fixed_view_mut::<3, 3>(3, 0).copy_from(&-dx.transpose());
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&-xdx);
    out
}

/// Tangent of [`quadratic_drag`].
pub fn quadratic_drag_jvp(surface: &[Element], part: Part, nu: &Vec6, dnu: &Vec6) -> Vec6 {
    quadratic_drag_derivative(surface, part, nu) * dnu
}

/// Cotangent of ν of [`quadratic_drag`].
pub fn quadratic_drag_vjp(surface: &[Element], part: Part, nu: &Vec6, bar: &Vec6) -> Vec6 {
    quadratic_drag_derivative(surface, part, nu).tr_mul(bar)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface() -> Vec<Element> {
        let mut out = Vec::new();
        for k in 0..12 {
            let a = k as f64;
            let n = Vec3::new(a.sin(), (1.3 * a).cos(), 0.4 - 0.1 * a).normalize();
            out.push(Element {
                center: n * 0.7 + Vec3::new(0.1, -0.2, 0.05 * a),
                normal: n,
                area: 0.3 + 0.02 * a,
            });
        }
        out
    }

    #[test]
    fn resistance_dissipates_and_matches_the_sum() {
        let nu = Vec6::new(0.3, -0.8, 0.5, 1.2, 0.4, -0.6);
        for part in [Part::Tangential, Part::Normal, Part::Total] {
            let power = nu.dot(&(resistance(&surface(), part) * nu));
            let direct: f64 = surface()
                .iter()
                .map(|e| {
                    let w =
                        part.projector(&e.normal) * (linear(&nu) + angular(&nu).cross(&e.center));
                    e.area * w.norm_squared()
                })
                .sum();
            assert!((power - direct).abs() < 1e-13 * direct);
        }
    }

    #[test]
    fn quadratic_derivative_matches_differences_and_is_zero_at_rest() {
        let nu = Vec6::new(0.3, -0.8, 0.5, 1.2, 0.4, -0.6);
        for part in [Part::Tangential, Part::Normal, Part::Total] {
            let d = quadratic_drag_derivative(&surface(), part, &nu);
            for k in 0..6 {
                let h = 1e-6 * Vec6::ith(k, 1.0);
                let fd = (quadratic_drag(&surface(), part, &(nu + h))
                    - quadratic_drag(&surface(), part, &(nu - h)))
                    / 2e-6;
                assert!((fd - d.column(k)).norm() < 1e-8 * d.norm());
            }
            assert_eq!(
                quadratic_drag_derivative(&surface(), part, &Vec6::zeros()),
                Mat6::zeros()
            );
        }
    }
}
