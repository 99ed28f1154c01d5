//! A controller of its own: what acts from what is seen, and its transpose.

use hydrograd::simulate::{Action, ActionBar, Observation, Policy};
use nalgebra::DVector;
use serde::Serialize;

// Entries of q and v: the scene's joints are plain.
pub const COLUMN: usize = 0;
pub const LOWER: usize = 1;
pub const UPPER: usize = 2;
pub const COIN_Y: usize = 3;
pub const COIN_Z: usize = 4;

/// Opening at the start and at the end, m, and how long closing takes, s.
pub const OPENING: [f64; 2] = [0.8, 0.55];
pub const CLOSING: f64 = 1.5;
/// Proportional–derivative control of column and fingers, with the coin's speed fed forward to the column.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Follow {
    /// Where along the fingers the coin is to be kept, m.
    pub along: f64,
    /// Stiffness of the column against the coin, N/m.
    column_stiffness: f64,
    /// Damping of the column against the coin's estimated speed, N s/m.
    column_damping: f64,
    /// c of the estimate v̂ = c · along · closing speed / opening.
    feed_forward: f64,
    /// Stiffness of each finger, N/m.
    finger_stiffness: f64,
    /// Damping of each finger, N s/m.
    finger_damping: f64,
    /// Part of the coin's z that the middle between the fingers follows.
    centring: f64,
}

impl Follow {
    /// Right on dry land for these masses of all that a joint moves, kg: critically damped at 3 rad/s.
    pub fn on_dry_land(along: f64, gripper: f64, finger: f64) -> Self {
        const FREQUENCY: f64 = 3.0;
        Self {
            along,
            column_stiffness: gripper * FREQUENCY * FREQUENCY,
            column_damping: 2.0 * gripper * FREQUENCY,
            feed_forward: 0.0,
            finger_stiffness: finger * FREQUENCY * FREQUENCY,
            finger_damping: 2.0 * finger * FREQUENCY,
            centring: 0.0,
        }
    }

    /// Gains from the numbers that the descent moves: stiffness and damping by their logarithms against these, so that they
    /// stay positive; feed-forward in tenths; centring as it is.
    pub fn at(&self, x: &[f64]) -> [f64; 6] {
        [
            self.column_stiffness * x[0].exp(),
            self.column_damping * x[1].exp(),
            0.1 * x[2],
            self.finger_stiffness * x[3].exp(),
            self.finger_damping * x[4].exp(),
            x[5],
        ]
    }

    /// Transpose of [`Follow::at`].
    pub fn at_vjp(&self, x: &[f64], gains_bar: &[f64]) -> Vec<f64> {
        let slope = self.at(x);
        let slope = [slope[0], slope[1], 0.1, slope[3], slope[4], 1.0];
        slope.iter().zip(gains_bar).map(|(s, b)| s * b).collect()
    }
}

/// Wanted opening at a time, m, and its rate, m/s: smooth from start to end.
fn opening(time: f64) -> (f64, f64) {
    let [from, to] = OPENING;
    let part = (time / CLOSING).clamp(0.0, 1.0);
    let value = from + (to - from) * part * part * (3.0 - 2.0 * part);
    (value, (to - from) * 6.0 * part * (1.0 - part) / CLOSING)
}

/// What a [`Follow`] makes of an observation, before it is weighed with gains.
struct Seen {
    /// Miss of the coin along the fingers, m.
    miss: f64,
    /// Its speed by the model with c = 1, m/s.
    carried: f64,
    /// How far off each finger is, centring left out, m, and how much too slow, m/s.
    off: [f64; 2],
    slow: [f64; 2],
}

impl Policy for Follow {
    fn act(&self, o: &Observation) -> hydrograd::Result<Action> {
        let s = self.see(o);
        let finger = |f: usize| {
            self.finger_stiffness * (s.off[f] + self.centring * o.q[COIN_Z])
                + self.finger_damping * s.slow[f]
        };
        let speed = self.feed_forward * s.carried - o.v[COLUMN];
        let column = self.column_stiffness * s.miss + self.column_damping * speed;
        Ok(Action {
            control: vec![column, finger(0), finger(1)],
            ..Action::default()
        })
    }

    fn act_vjp(&self, o: &Observation, u: &DVector<f64>) -> hydrograd::Result<ActionBar> {
        let s = self.see(o);
        let (mut q, mut v) = (vec![0.0; o.v.len()], vec![0.0; o.v.len()]);
        // Column.
        let opening = o.q[UPPER] - o.q[LOWER];
        let closing = o.v[LOWER] - o.v[UPPER];
        let along = o.q[COIN_Y] - o.q[COLUMN];
        let carried = u[0] * self.column_damping * self.feed_forward;
        let along_bar = u[0] * self.column_stiffness + carried * closing / opening;
        q[COIN_Y] += along_bar;
        q[COLUMN] -= along_bar;
        q[UPPER] -= carried * s.carried / opening;
        q[LOWER] += carried * s.carried / opening;
        v[LOWER] += carried * along / opening;
        v[UPPER] -= carried * along / opening;
        v[COLUMN] -= u[0] * self.column_damping;
        // Fingers.
        for (f, i) in [LOWER, UPPER].into_iter().enumerate() {
            q[i] -= u[1 + f] * self.finger_stiffness;
            q[COIN_Z] += u[1 + f] * self.finger_stiffness * self.centring;
            v[i] -= u[1 + f] * self.finger_damping;
        }
        let (z, both) = (o.q[COIN_Z], u[1] + u[2]);
        let gains = vec![
            u[0] * s.miss,
            u[0] * (self.feed_forward * s.carried - o.v[COLUMN]),
            u[0] * self.column_damping * s.carried,
            u[1] * s.off[0] + u[2] * s.off[1] + both * self.centring * z,
            u[1] * s.slow[0] + u[2] * s.slow[1],
            both * self.finger_stiffness * z,
        ];
        Ok(ActionBar { q, v, gains })
    }

    fn gains(&self) -> Vec<f64> {
        vec![
            self.column_stiffness,
            self.column_damping,
            self.feed_forward,
            self.finger_stiffness,
            self.finger_damping,
            self.centring,
        ]
    }

    fn with_gains(&self, gains: &[f64]) -> hydrograd::Result<Box<dyn Policy>> {
        let [k, d, c, finger_k, finger_d, centring] = *gains else {
            return Err(hydrograd::Error::input(
                "controller: gains",
                format!("{} numbers", gains.len()),
                "must be 6 numbers",
            ));
        };
        Ok(Box::new(Self {
            along: self.along,
            column_stiffness: k,
            column_damping: d,
            feed_forward: c,
            finger_stiffness: finger_k,
            finger_damping: finger_d,
            centring,
        }))
    }
}

impl Follow {
    fn see(&self, o: &Observation) -> Seen {
        let (wanted, rate) = opening(o.time);
        let along = o.q[COIN_Y] - o.q[COLUMN];
        let closing = o.v[LOWER] - o.v[UPPER];
        Seen {
            miss: along - self.along,
            carried: along * closing / (o.q[UPPER] - o.q[LOWER]),
            off: [-0.5 * wanted - o.q[LOWER], 0.5 * wanted - o.q[UPPER]],
            slow: [-0.5 * rate - o.v[LOWER], 0.5 * rate - o.v[UPPER]],
        }
    }
}
