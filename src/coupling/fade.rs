//! Polynomials by which what is coupled comes and goes.

use crate::adjoint::multipole::Number;
use num_dual::DualNum;

/// From 1 at t = 0 to 0 at 1, 1 − t⁴(35 − 84t + 70t² − 20t³), and its derivative: three derivatives vanish at both ends, so that state, gradient and Hessian products don't jump.
pub(super) fn fade<T: Number>(t: T) -> [T; 2] {
    let (zero, one) = (T::constant(0.0), T::constant(1.0));
    if t.value() <= 0.0 {
        return [one, zero];
    }
    if t.value() >= 1.0 {
        return [zero, zero];
    }
    let s = one - t;
    let t3 = t * t * t;
    let part = ((t * -20.0 + T::constant(70.0)) * t - T::constant(84.0)) * t + T::constant(35.0);
    [one - t3 * t * part, t3 * s * s * s * -140.0]
}

/// t³/(1 − t)³ from 0 on: what there is more and more of, without end at t = 1.
pub(super) fn opening<D: DualNum<Primitive = f64> + Copy>(t: D) -> D {
    match t.re() <= 0.0 {
        true => D::from(0.0),
        false => {
            let part = t / (-t + 1.0);
            part * part * part
        }
    }
}

/// Its derivative.
pub(super) fn opening_slope<D: DualNum<Primitive = f64> + Copy>(t: D) -> D {
    match t.re() <= 0.0 {
        true => D::from(0.0),
        false => {
            let square = (-t + 1.0) * (-t + 1.0);
            t * t * 3.0 / (square * square)
        }
    }
}
