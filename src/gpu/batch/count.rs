//! What a scene's step asks of the device, by count.

use super::question::Kind;
use crate::coupling::SceneSize;

/// Operations of 1/|x − s| in the fine arithmetic: a difference, a square, and a root of single precision with two steps of Newton's.
const INVERSE: f64 = 3.0 + 5.0 + 9.0;
/// The same in single precision.
const ROUGH_INVERSE: f64 = 3.0 + 5.0 + 1.0;
/// Of −w r/r³ beyond that.
const PULL: f64 = 6.0;
/// Of ∇∇P d beyond that.
const BEND: f64 = 16.0;

/// Operations (a multiplication and an addition count as two) and bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Operations in the fine arithmetic.
    pub fine: f64,
    /// In single precision.
    pub single: f64,
    /// Bytes to the device and back.
    pub carried: f64,
    /// Bytes that a workgroup reads and writes of its own work, most of which stays in a card's cache while few are at work.
    pub touched: f64,
}

impl std::ops::Add for Cost {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            fine: self.fine + other.fine,
            single: self.single + other.single,
            carried: self.carried + other.carried,
            touched: self.touched + other.touched,
        }
    }
}

/// Of a solve of `n` columns in `rounds` rounds of `iterations` iterations in all, `probing` with a column more.
fn solve(size: &SceneSize, n: f64, probing: bool, rounds: f64, iterations: f64) -> Cost {
    let (pairs, entries) = (size.pairs as f64, size.entries as f64);
    let (points, modes) = (size.points as f64, size.modes as f64);
    // Four columns side by side, zeros among them.
    let wide = 4.0 * ((n + f64::from(u8::from(probing))) / 4.0).ceil();
    // A round forms potentials, and the residual from them; the last one finds that all is solved. Then momenta are read out.
    let round = pairs * (INVERSE + 2.0 * n) + 4.0 * entries * n;
    let iteration = pairs * (ROUGH_INVERSE + 2.0 * wide) + (4.0 * entries + 12.0 * modes) * wide;
    Cost {
        fine: (rounds + 1.0) * round,
        single: iterations * iteration,
        carried: 0.0,
        touched: (rounds + 1.0) * 8.0 * n * (3.0 * points + 2.0 * modes)
            + iterations * 4.0 * wide * (4.0 * points + 11.0 * modes),
    }
}

/// Of pulls of `wide` columns and wrenches of so many pairs of them.
fn pulls(size: &SceneSize, wide: f64, wrenches: f64) -> Cost {
    let (pairs, points) = (size.pairs as f64, size.points as f64);
    Cost {
        fine: pairs * (INVERSE + PULL + 6.0 * wide) + points * wrenches * 27.0,
        single: 0.0,
        carried: 0.0,
        touched: 8.0 * points * (6.0 * wide + 11.0 * wrenches),
    }
}

fn carried(size: &SceneSize, kind: Kind) -> Cost {
    let l = kind.lengths(size);
    Cost {
        carried: 8.0 * (l.input + l.direction + l.answer + l.wrenches) as f64,
        ..Cost::default()
    }
}

/// One evaluation with its first derivatives: a forward step of the integrator `momentum-euler`, if nothing touches. Its solve takes `rounds` rounds of `iterations` iterations in
/// all: three of five or six where bodies are apart.
pub fn forward(size: &SceneSize, rounds: f64, iterations: f64) -> Cost {
    let k = size.columns as f64;
    solve(size, k, true, rounds, iterations)
        + pulls(size, k, 0.5 * k * (k + 1.0))
        + carried(size, Kind::Basis)
}

/// A step with its gradient: forward, and in the reverse sweep the evaluation again, the answer to one further twist, and one tangent.
pub fn with_gradient(size: &SceneSize, rounds: f64, iterations: f64) -> Cost {
    let one = solve(size, 1.0, false, rounds, iterations);
    let tangent = Cost {
        fine: size.pairs as f64 * (2.0 * (INVERSE + PULL) + BEND + 20.0),
        ..Cost::default()
    };
    let evaluation = forward(size, rounds, iterations);
    let answer = one + pulls(size, 2.0, 1.0) + carried(size, Kind::Respond(1));
    evaluation + evaluation + answer + one + tangent + carried(size, Kind::Tangent(1))
}
