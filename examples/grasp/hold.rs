//! What it is to hold the coin: as a yes or no, and as a cost that a gradient can descend.

use hydrograd::simulate::{Cotangents, Objective, Rollout, Sample};

// Entries of q and v.
pub const COLUMN: usize = 0;
pub const FINGERS: [usize; 2] = [1, 2];
pub const COIN_Y: usize = 3;
pub const COIN_Z: usize = 4;
pub const COIN_TURN: usize = 5;

// Bodies.
const COIN: usize = 3;
const FINGER_BODIES: [usize; 2] = [1, 2];

/// Semi-axes of the coin in the plane: along its disc, and across, m.
const COIN_AXES: [f64; 2] = [0.2, 0.05];
/// Reach of the fingers from the column, m.
const REACH: f64 = 1.6;
/// How long the coin must be held, s.
const HOLD: f64 = 0.5;
/// The fastest that any point of it may move against a finger, m/s.
const STILL: f64 = 5e-3;

/// Half the coin's height along z at a turn, m, and its derivative.
fn half_height(turn: f64) -> (f64, f64) {
    let [a, b] = COIN_AXES;
    let (sin, cos) = turn.sin_cos();
    let half = (a * a * cos * cos + b * b * sin * sin).sqrt();
    (half, (b * b - a * a) * sin * cos / half)
}

/// Fastest motion of the coin's rim against a finger, m/s.
fn slip(s: &Sample) -> f64 {
    let spin = COIN_AXES[0] * s.v[COIN_TURN].abs();
    let against = |f: usize| (s.v[COIN_Y] - s.v[COLUMN]).hypot(s.v[COIN_Z] - s.v[f]) + spin;
    against(FINGERS[0]).max(against(FINGERS[1]))
}

/// Since when the coin has been held at the end: between the fingers, touched by both, still against them; none if it isn't held at the end.
pub fn held_since(rollout: &Rollout) -> hydrograd::Result<Option<f64>> {
    let samples = rollout.samples();
    let mut since = None;
    for n in (0..rollout.steps()).rev() {
        let s = &samples[n + 1];
        let along = s.q[COIN_Y] - s.q[COLUMN];
        let between = (0.0..=REACH).contains(&along)
            && s.q[FINGERS[0]] < s.q[COIN_Z]
            && s.q[COIN_Z] < s.q[FINGERS[1]];
        let contacts = rollout.contacts(n)?;
        let touched = |finger: usize| {
            contacts.iter().any(|c| {
                (c.first == finger && c.second == Some(COIN))
                    || (c.first == COIN && c.second == Some(finger))
            })
        };
        if !(between && slip(s) < STILL && FINGER_BODIES.into_iter().all(touched)) {
            break;
        }
        since = Some(s.time);
    }
    Ok(since)
}

/// Whether the coin was held for the last half second.
pub fn caught(rollout: &Rollout) -> hydrograd::Result<bool> {
    let end = rollout.samples()[rollout.steps()].time;
    Ok(held_since(rollout)?.is_some_and(|t| end - t >= HOLD - 1e-9))
}

/// Distance of coin and gripper from a hold, meant over the last states, and the effort. Terms are squares of lengths and speeds over those
/// that would be a tolerable miss.
pub struct Hold {
    /// Gap at which surfaces touch, m.
    pub gap: f64,
    /// Where along the fingers the coin is wanted, m from the column.
    pub along: f64,
    /// Time from which it should be held, s.
    pub from: f64,
    /// Weight of the mean squared control, per N².
    pub effort: f64,
}

/// One term: (x / tolerable)², with the derivative over x.
fn miss(x: f64, tolerable: f64) -> (f64, f64) {
    ((x / tolerable).powi(2), 2.0 * x / (tolerable * tolerable))
}

impl Hold {
    /// Cost of one state, with its derivatives over q and v.
    fn state(&self, s: &Sample) -> (f64, [f64; 6], [f64; 6]) {
        let (q, v) = (&s.q, &s.v);
        let [lower, upper] = FINGERS;
        let (half, half_slope) = half_height(q[COIN_TURN]);
        let mut cost = 0.0;
        let (mut dq, mut dv) = ([0.0; 6], [0.0; 6]);
        // Open by no more than the coin with the gaps on both sides.
        let (c, d) = miss(q[upper] - q[lower] - 2.0 * (half + self.gap), 0.05);
        cost += c;
        dq[upper] += d;
        dq[lower] -= d;
        dq[COIN_TURN] -= 2.0 * half_slope * d;
        // In the middle between them.
        let (c, d) = miss(q[COIN_Z] - 0.5 * (q[lower] + q[upper]), 0.05);
        cost += c;
        dq[COIN_Z] += d;
        dq[lower] -= 0.5 * d;
        dq[upper] -= 0.5 * d;
        // At its place along them.
        let (c, d) = miss(q[COIN_Y] - q[COLUMN] - self.along, 0.1);
        cost += c;
        dq[COIN_Y] += d;
        dq[COLUMN] -= d;
        // And still.
        let rates = [
            (v[COIN_Y] - v[COLUMN], 0.05, [(COIN_Y, 1.0), (COLUMN, -1.0)]),
            (v[COIN_Z] - v[lower], 0.05, [(COIN_Z, 1.0), (lower, -1.0)]),
            (v[COIN_Z] - v[upper], 0.05, [(COIN_Z, 1.0), (upper, -1.0)]),
            (
                COIN_AXES[0] * v[COIN_TURN],
                0.05,
                [(COIN_TURN, COIN_AXES[0]), (COIN_TURN, 0.0)],
            ),
        ];
        for (rate, tolerable, parts) in rates {
            let (c, d) = miss(rate, tolerable);
            cost += c;
            for (i, part) in parts {
                dv[i] += part * d;
            }
        }
        (cost, dq, dv)
    }

    fn states<'a>(&self, rollout: &'a Rollout) -> impl Iterator<Item = (usize, &'a Sample)> {
        let from = self.from - 1e-9;
        let all = rollout.samples().iter().enumerate();
        all.filter(move |(_, s)| s.time >= from)
    }
}

impl Objective for Hold {
    fn value(&self, rollout: &Rollout) -> f64 {
        let count = self.states(rollout).count().max(1) as f64;
        let hold: f64 = self.states(rollout).map(|(_, s)| self.state(s).0).sum();
        let controls = rollout.controls();
        hold / count + self.effort * controls.norm_squared() / controls.len() as f64
    }

    fn cotangents(&self, rollout: &Rollout) -> Cotangents {
        let mut out = rollout.zero_cotangents();
        let count = self.states(rollout).count().max(1) as f64;
        for (n, s) in self.states(rollout) {
            let (_, dq, dv) = self.state(s);
            for i in 0..6 {
                out.q[(i, n)] += dq[i] / count;
                out.v[(i, n)] += dv[i] / count;
            }
        }
        let controls = rollout.controls();
        out.controls += 2.0 * self.effort / controls.len() as f64 * controls;
        out
    }
}
