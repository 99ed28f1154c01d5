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
/// Surfaces this much farther apart than the gap at which they touch still count as touching, m: after an impact without rebound nothing
/// presses any more.
const TOUCH: f64 = 3e-3;
/// How long the coin must be held, s.
const HOLD: f64 = 0.5;
/// The fastest that any point of it may move against a finger, m/s.
const STILL: f64 = 5e-3;

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
        let contacts = rollout.contacts(n, TOUCH)?;
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

/// Distance of coin and gripper from where they should be from a time on: squares of lengths, speeds and forces over those that would be a tolerable
/// miss, meant over the states from then.
pub struct Hold {
    /// Time from which they should be there, s.
    pub from: f64,
    /// Where along the fingers the coin is wanted, m from the column.
    pub along: f64,
    /// Between the fingers' joints, m.
    pub opening: f64,
    /// Force with which each finger should press, N.
    pub grip: f64,
    /// Misses that cost 1.
    pub tolerable: Tolerable,
}

/// Misses that cost 1; infinite: it doesn't matter.
pub struct Tolerable {
    /// Of the coin's place along the fingers, m.
    pub along: f64,
    /// Of its place between them, m.
    pub across: f64,
    /// Of the opening, m.
    pub opening: f64,
    /// Speed of the coin along the fingers, m/s.
    pub drift: f64,
    /// Speed of the coin against each finger across, and of its rim as it turns, m/s.
    pub closing: f64,
    /// Of the pressing forces, N.
    pub grip: f64,
}

/// Cost so far, with its derivatives over q and v.
#[derive(Default)]
struct Slope {
    cost: f64,
    q: [f64; 6],
    v: [f64; 6],
}

impl Slope {
    /// Adds (x / tolerable)² of a sum x of parts of coordinates.
    fn place(&mut self, x: f64, tolerable: f64, parts: &[(usize, f64)]) {
        self.cost += (x / tolerable).powi(2);
        for (i, part) in parts {
            self.q[*i] += part * 2.0 * x / tolerable.powi(2);
        }
    }

    /// The same of velocities.
    fn speed(&mut self, x: f64, tolerable: f64, parts: &[(usize, f64)]) {
        self.cost += (x / tolerable).powi(2);
        for (i, part) in parts {
            self.v[*i] += part * 2.0 * x / tolerable.powi(2);
        }
    }
}

impl Hold {
    /// Cost of a state, with its derivatives.
    fn state(&self, s: &Sample) -> Slope {
        let (q, v, t) = (&s.q, &s.v, &self.tolerable);
        let [lower, upper] = FINGERS;
        let mut out = Slope::default();
        let along = q[COIN_Y] - q[COLUMN] - self.along;
        out.place(along, t.along, &[(COIN_Y, 1.0), (COLUMN, -1.0)]);
        let across = q[COIN_Z] - 0.5 * (q[lower] + q[upper]);
        let between = [(COIN_Z, 1.0), (lower, -0.5), (upper, -0.5)];
        out.place(across, t.across, &between);
        let opening = q[upper] - q[lower] - self.opening;
        out.place(opening, t.opening, &[(upper, 1.0), (lower, -1.0)]);
        let drift = [(COIN_Y, 1.0), (COLUMN, -1.0)];
        out.speed(v[COIN_Y] - v[COLUMN], t.drift, &drift);
        for finger in FINGERS {
            let against = [(COIN_Z, 1.0), (finger, -1.0)];
            out.speed(v[COIN_Z] - v[finger], t.closing, &against);
        }
        let rim = COIN_AXES[0];
        out.speed(rim * v[COIN_TURN], t.closing, &[(COIN_TURN, rim)]);
        out
    }

    /// The states that count, each with its share.
    fn states<'a>(&self, rollout: &'a Rollout) -> impl Iterator<Item = (usize, &'a Sample, f64)> {
        let from = self.from - 1e-9;
        let samples = rollout.samples();
        let count = samples.iter().filter(|s| s.time >= from).count();
        let share = 1.0 / count.max(1) as f64;
        let all = samples.iter().enumerate();
        all.filter(move |(_, s)| s.time >= from)
            .map(move |(n, s)| (n, s, share))
    }

    /// Sum over the fingers of the squared miss of the grip in step `n`, with its derivatives over the controls.
    fn grip(&self, rollout: &Rollout, n: usize) -> (f64, [f64; 2]) {
        let u = rollout.controls();
        // The lower finger presses up, the upper one down.
        let misses = [(FINGERS[0], 1.0), (FINGERS[1], -1.0)]
            .map(|(finger, sign)| (u[(finger, n)] - sign * self.grip) / self.tolerable.grip);
        let cost = misses.iter().map(|m| m * m).sum();
        (cost, misses.map(|m| 2.0 * m / self.tolerable.grip))
    }
}

impl Objective for Hold {
    fn value(&self, rollout: &Rollout) -> f64 {
        let of = |(n, sample, share): (usize, &Sample, f64)| {
            let grip = match n < rollout.steps() {
                true => self.grip(rollout, n).0,
                false => 0.0,
            };
            share * (self.state(sample).cost + grip)
        };
        self.states(rollout).map(of).sum()
    }

    fn cotangents(&self, rollout: &Rollout) -> Cotangents {
        let mut out = rollout.zero_cotangents();
        for (n, sample, share) in self.states(rollout) {
            let slope = self.state(sample);
            for i in 0..6 {
                out.q[(i, n)] += share * slope.q[i];
                out.v[(i, n)] += share * slope.v[i];
            }
            if n < rollout.steps() {
                let (_, slopes) = self.grip(rollout, n);
                for (finger, slope) in FINGERS.into_iter().zip(slopes) {
                    out.controls[(finger, n)] += share * slope;
                }
            }
        }
        out
    }
}
