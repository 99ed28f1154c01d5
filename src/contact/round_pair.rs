//! Two ellipsoids or discs: their common normal.
//!
//! The signed distance is the largest of f(n) = n · d − h_A(n) − h_B(n) over unit n, with d from
//! the second centre to the first and h = √(nᵀ Σ n) the support functions: apart, the distance;
//! overlapping, minus the shift that parts them. Newton's method on the sphere climbs f, for ellipsoids from the
//! normal at which the two would touch if scaled alike. The axis of a disc, along which its outermost points are many, isn't
//! found.
//!
//! # References
//! J. W. Perram, M. S. Wertheim, "Statistical mechanics of hard ellipsoids I", J. Comput. Phys. 58
//! (1985) 409: the largest of λ(1−λ) dᵀ ((1−λ) Σ_A + λ Σ_B)⁻¹ d and its common normal.

use super::point::{ContactPoint, Slopes, carry, columns};
use crate::error::{Error, Result};
use crate::geometry::convex::{Ellipsoid, Round, Support, perpendicular};
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3, Vec6, skew};
use nalgebra::{Matrix2, Matrix3x2, SymmetricEigen, Vector2};

const ROUNDS: usize = 100;
const BISECTIONS: usize = 40;
/// Residual in sizes of the bodies that is asked for, and that is good enough if rounding allows
/// no better.
const TIGHT: f64 = 1e-15;
const ENOUGH: f64 = 1e-10;
/// Longest step, rad.
pub(super) const FARTHEST: f64 = 0.5;
/// Least curvature of f at its top, in sizes: concentric balls have none.
const FLOOR: f64 = 1e-9;

/// f at a normal, with what its slopes need.
struct Height {
    value: f64,
    gradient: Vec3,
    /// Support points of the two bodies, world frame.
    points: [Vec3; 2],
    /// Slopes of either along its own direction.
    spreads: [Mat3; 2],
}

/// The point of contact of two ellipsoids, however far.
///
/// # Errors
/// [`Error::Solver`] if the common normal isn't found.
pub(super) fn ellipsoids(
    first: &Ellipsoid,
    first_at: &Pose,
    second: &Ellipsoid,
    second_at: &Pose,
) -> Result<ContactPoint> {
    let size = first.semi_axes.max() + second.semi_axes.max();
    let normal = start(first, first_at, second, second_at);
    let first = |n: &Vec3| first.support(first_at, n);
    let second = |n: &Vec3| second.support(second_at, n);
    contact(first, second, |_| FARTHEST, size, normal)
}

/// The point of contact of two bodies by their outermost points (world frame) and their size together (m), with a normal near `normal`. `most` is how far a step may
/// lead from a normal, rad: not past one where f has a kink.
///
/// # Errors
/// [`Error::Solver`] if the common normal isn't found.
pub(super) fn contact(
    first: impl Fn(&Vec3) -> Support,
    second: impl Fn(&Vec3) -> Support,
    most: impl Fn(&Vec3) -> f64,
    size: f64,
    mut normal: Vec3,
) -> Result<ContactPoint> {
    let height = |n: &Vec3| {
        let (a, b) = (first(&-n), second(n));
        let gradient = a.point - b.point;
        Height {
            value: gradient.dot(n),
            gradient,
            points: [a.point, b.point],
            spreads: [a.spread, b.spread],
        }
    };
    let mut at = height(&normal);
    let mut residual = f64::INFINITY;
    let mut rounds = 0;
    while rounds < ROUNDS {
        rounds += 1;
        let basis = tangents(&normal);
        let slope = basis.tr_mul(&at.gradient);
        residual = slope.norm() / size;
        let top = top(&at, &basis);
        let least = top.eigenvalues.min();
        if residual <= TIGHT && least > 0.0 {
            break;
        }
        // Where f isn't concave the step goes uphill all the same, and off a saddle sideways.
        let floor = FLOOR * size;
        let mut step = Vector2::zeros();
        for (value, direction) in top.eigenvalues.iter().zip(top.eigenvectors.column_iter()) {
            step += slope.dot(&direction) / value.abs().max(floor) * direction;
        }
        if least < -floor && residual <= ENOUGH {
            step += 0.1 * top.eigenvectors.column(top.eigenvalues.imin());
        }
        let length = step.norm();
        let most = most(&normal);
        if length > most {
            step *= most / length;
        }
        let mut risen = None;
        for halving in 0..50 {
            let tilted = (normal + basis * step * 0.5f64.powi(halving)).normalize();
            let there = height(&tilted);
            if there.value > at.value {
                risen = Some((tilted, there));
                break;
            }
            // A step so small that f can't tell: Newton's own residual decides.
            let tangent = tangents(&tilted).tr_mul(&there.gradient).norm() / size;
            if length < 1e-6 && least > 0.0 && tangent < residual {
                risen = Some((tilted, there));
                break;
            }
        }
        match risen {
            Some((tilted, there)) => (normal, at) = (tilted, there),
            None => break,
        }
    }
    if residual.is_nan() || residual > ENOUGH {
        return Err(Error::Solver {
            what: "contact: common normal of two ellipsoids".into(),
            iterations: rounds,
            residual,
            tolerance: ENOUGH,
            remedy: "they lie deep in one another: make contact stiffer or the time step smaller"
                .into(),
        });
    }
    Ok(point(&normal, &at, size))
}

/// Values and slopes at the common normal, by the implicit function theorem: at the top
/// P∇f = 0, and along a displacement (C_A + C_B + f P) dn = P ∂(∇f).
fn point(normal: &Vec3, at: &Height, size: f64) -> ContactPoint {
    let [a, b] = &at.points;
    let [spread_a, spread_b] = &at.spreads;
    let basis = tangents(normal);
    let top = top(at, &basis);
    let mut inverse = Matrix2::zeros();
    for (value, direction) in top.eigenvalues.iter().zip(top.eigenvectors.column_iter()) {
        inverse += direction * direction.transpose() / value.max(FLOOR * size);
    }
    let carried = columns(&Mat3::identity(), &(-skew(a) - spread_a * skew(normal)));
    let normal_slope = basis * inverse * basis.transpose() * carried;
    let first = carried - spread_a * normal_slope;
    let second = spread_b * normal_slope;
    ContactPoint {
        gap: at.value,
        weight: 1.0,
        normal: *normal,
        position: 0.5 * (a + b),
        slopes: Slopes {
            gap: carry(a).tr_mul(normal),
            weight: Vec6::zeros(),
            normal: normal_slope,
            position: 0.5 * (first + second),
        },
    }
}

/// Minus the second derivative of f on the sphere, in the given tangent basis.
fn top(at: &Height, basis: &Matrix3x2<f64>) -> SymmetricEigen<f64, nalgebra::U2> {
    let bend = basis.transpose() * (at.spreads[0] + at.spreads[1]) * basis;
    SymmetricEigen::new(bend + at.value * Matrix2::identity())
}

fn tangents(normal: &Vec3) -> Matrix3x2<f64> {
    let u = perpendicular(normal);
    Matrix3x2::from_columns(&[u, normal.cross(&u)])
}

/// The normal at which the two would touch if both were scaled alike about their centres.
fn start(first: &Ellipsoid, first_at: &Pose, second: &Ellipsoid, second_at: &Pose) -> Vec3 {
    let between = first_at.translation - second_at.translation;
    // In units of the larger body, so that squares keep their range.
    let unit = first.semi_axes.max().max(second.semi_axes.max());
    let d = between / unit;
    let [a, b] = [(first, first_at), (second, second_at)].map(|(body, at)| {
        let squares = (body.semi_axes / unit).map(|x| x * x);
        at.rotation * Mat3::from_diagonal(&squares) * at.rotation.transpose()
    });
    let solve = |l: f64| ((1.0 - l) * a + l * b).try_inverse().map(|m| m * d);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..BISECTIONS {
        let l: f64 = 0.5 * (low + high);
        let Some(x) = solve(l) else { break };
        // The function is concave in λ.
        let slope = (1.0 - 2.0 * l) * d.dot(&x) - l * (1.0 - l) * x.dot(&((b - a) * x));
        if slope > 0.0 {
            low = l;
        } else {
            high = l;
        }
    }
    let found = solve(0.5 * (low + high)).unwrap_or(d);
    let norm = found.norm();
    if norm.is_finite() && norm > 0.0 {
        return found / norm;
    }
    // Concentric: across the second where it is flattest.
    let axis = second.semi_axes.imin();
    second_at.rotation.column(axis).into_owned()
}
