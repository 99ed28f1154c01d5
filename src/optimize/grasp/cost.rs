//! What it is to hold an object, as a cost that gradients descend.
//!
//! Means over the states of a span of time, with m the middle of the pads p_f, x and ω the object's place and angular velocity, V_f the velocity that a finger's
//! material would have at x, r the object's radius and u the controls over their limits:
//!
//! ```text
//! |x − m|²/r²                                               between the fingers
//! Σ_f max(0, gap_f − g)²/(r/4)²                             and they at it, g the gap at which they touch
//! Σ_f (|ẋ − V_f|² + r² |ω − ω_f|²)/(r/2 s)²                 at rest against them
//! |ẋ − mean V_f|²/(r/4 s)²                                  not drifting, before they touch it
//! Σ_closing (u − grip)²/grip²                               and they press
//! ```

use super::task::{GraspTask, Grip};
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, linear};
use crate::simulate::{Cotangents, Objective, Rollout, Simulator};
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Part of the closing controls with which the object is held.
pub(super) const GRIP: f64 = 0.2;
/// Speeds that cost 1, in radii a second: against each finger, and against their mean.
const REST: f64 = 0.5;
const DRIFT: f64 = 0.25;
/// Distance of a finger that costs 1, in radii.
const NEAR: f64 = 0.25;
/// Farther than bodies of a scene are apart, m.
const FAR: f64 = 1e6;

/// The cost of a span of time: an [`Objective`] ([`super::GraspTask::hold_cost`], [`super::GraspTask::approach_cost`]). A rollout none of whose states lies in it is refused.
#[derive(Clone, Debug)]
pub struct GraspCost {
    pub(super) grip: Arc<Grip>,
    /// From and to, s.
    pub(super) span: [f64; 2],
    /// Whether fingers should touch it, at rest against it, and press; else it should only not drift between them.
    pub(super) held: bool,
}

impl GraspTask {
    /// The cost of not holding the object over the end of the run.
    ///
    /// # Errors
    /// A task that doesn't fit the simulator's scene.
    pub fn hold_cost(&self, simulator: &Simulator) -> Result<GraspCost> {
        let grip = Grip::new(simulator, self)?;
        Ok(GraspCost {
            span: grip.end(),
            grip: Arc::new(grip),
            held: true,
        })
    }

    /// The cost of the object being elsewhere than between the fingers, or drifting there, from and to these times (s), before they touch it.
    ///
    /// # Errors
    /// As [`GraspTask::hold_cost`].
    pub fn approach_cost(&self, simulator: &Simulator, span: [f64; 2]) -> Result<GraspCost> {
        Ok(GraspCost {
            span,
            grip: Arc::new(Grip::new(simulator, self)?),
            held: false,
        })
    }
}

/// Cost of a state, with its derivatives over each body's place, rotation, velocity and angular velocity.
struct Slopes {
    cost: f64,
    bodies: Vec<[Vec3; 4]>,
}

impl Slopes {
    fn add(&mut self, body: usize, which: usize, bar: Vec3) {
        self.bodies[body][which] += bar;
    }
}

const PLACE: usize = 0;
const TURN: usize = 1;
const VELOCITY: usize = 2;
const RATE: usize = 3;

impl GraspCost {
    fn state(&self, rollout: &Rollout, velocities: &DMatrix<f64>, n: usize) -> Slopes {
        let grip = &*self.grip;
        let (r, count) = (grip.radius, grip.fingers.len() as f64);
        let poses = &rollout.samples()[n].poses;
        let column = velocities.column(n);
        let read =
            |b: usize, k: usize| Vec3::from_column_slice(&column.as_slice()[6 * b + k..][..3]);
        let mut out = Slopes {
            cost: 0.0,
            bodies: vec![[Vec3::zeros(); 4]; poses.len()],
        };
        let object = grip.object;
        let place = poses[object].translation;
        let arms: Vec<Vec3> = (grip.fingers.iter())
            .map(|(f, pad)| poses[*f].rotation * pad)
            .collect();
        let pads: Vec<Vec3> = (grip.fingers.iter().zip(&arms))
            .map(|((f, _), arm)| poses[*f].translation + arm)
            .collect();
        // On a pad: its body's place and rotation.
        let press = |out: &mut Slopes, i: usize, bar: Vec3| {
            let finger = grip.fingers[i].0;
            out.add(finger, PLACE, bar);
            out.add(finger, TURN, arms[i].cross(&bar));
        };
        let middle = pads.iter().sum::<Vec3>() / count;
        let miss = (place - middle) / r;
        out.cost += miss.norm_squared();
        out.add(object, PLACE, 2.0 / r * miss);
        for i in 0..pads.len() {
            press(&mut out, i, -2.0 / (r * count) * miss);
        }
        // The velocity of the object against what finger i would carry there, and where a cotangent of it goes.
        let against = |i: usize| {
            let finger = grip.fingers[i].0;
            let arm = place - poses[finger].translation;
            read(object, 0) - read(finger, 0) - read(finger, 3).cross(&arm)
        };
        let carried = |out: &mut Slopes, i: usize, bar: Vec3| {
            let finger = grip.fingers[i].0;
            let (arm, rate) = (place - poses[finger].translation, read(finger, 3));
            out.add(object, VELOCITY, bar);
            out.add(finger, VELOCITY, -bar);
            out.add(finger, RATE, -arm.cross(&bar));
            out.add(object, PLACE, -bar.cross(&rate));
            out.add(finger, PLACE, bar.cross(&rate));
        };
        if !self.held {
            let speed = (0..pads.len()).map(against).sum::<Vec3>() / count;
            let tolerable = DRIFT * r;
            out.cost += speed.norm_squared() / tolerable.powi(2);
            let bar = 2.0 / (count * tolerable.powi(2)) * speed;
            (0..pads.len()).for_each(|i| carried(&mut out, i, bar));
            return out;
        }
        let tolerable = REST * r;
        for i in 0..pads.len() {
            let finger = grip.fingers[i].0;
            if let Some((beyond, slope)) = self.apart(rollout, poses, finger) {
                out.cost += (beyond / (NEAR * r)).powi(2);
                let wrench = 2.0 * beyond / (NEAR * r).powi(2) * slope;
                for (b, wrench) in [(object, wrench), (finger, -wrench)] {
                    let force = linear(&wrench);
                    out.add(b, PLACE, force);
                    out.add(
                        b,
                        TURN,
                        angular(&wrench) - poses[b].translation.cross(&force),
                    );
                }
            }
            let speed = against(i);
            out.cost += speed.norm_squared() / tolerable.powi(2);
            carried(&mut out, i, 2.0 / tolerable.powi(2) * speed);
            let rate = r / tolerable * (read(object, 3) - read(finger, 3));
            out.cost += rate.norm_squared();
            let bar = 2.0 * r / tolerable * rate;
            out.add(object, RATE, bar);
            out.add(finger, RATE, -bar);
        }
        out
    }

    /// How much farther a finger is from the object than where they touch, m, if it is, with the slope as the object is displaced.
    fn apart(&self, rollout: &Rollout, poses: &[Pose], finger: usize) -> Option<(f64, Vec6)> {
        let object = self.grip.object;
        let contact = rollout.simulator().system().contact.as_ref()?;
        let mut nearest: Option<(f64, Vec6)> = None;
        for pair in contact.shapes.pairs() {
            let sign = match (pair.first, pair.second_body()) {
                (a, Some(b)) if a == object && b == finger => 1.0,
                (a, Some(b)) if a == finger && b == object => -1.0,
                _ => continue,
            };
            // Distances that can't be found count for nothing here; the step says so.
            let points = contact.shapes.points_within(&pair, poses, FAR);
            for p in points.unwrap_or_default() {
                let beyond = p.gap - contact.laws.of(&pair).gap;
                if nearest.is_none_or(|(least, _)| beyond < least) {
                    nearest = Some((beyond, sign * p.slopes.gap));
                }
            }
        }
        nearest.filter(|(beyond, _)| *beyond > 0.0)
    }

    /// Cost of the controls of step `n`, with its derivatives.
    fn pressing(&self, rollout: &Rollout, n: usize) -> (f64, Vec<f64>) {
        let controls = rollout.controls();
        let mut cost = 0.0;
        let each = self.grip.closing.iter().zip(&self.grip.limits).enumerate();
        let slopes = each.map(|(c, (closing, limit))| {
            if *closing == 0.0 || !self.held {
                return 0.0;
            }
            let wanted = GRIP * closing * limit;
            let miss = controls[(c, n)] / wanted - 1.0;
            cost += miss * miss;
            2.0 * miss / wanted
        });
        let slopes = slopes.collect();
        (cost, slopes)
    }

    /// The states that count, and the share of each.
    fn states(&self, rollout: &Rollout) -> (Vec<usize>, f64) {
        let [from, to] = self.span;
        let samples = rollout.samples().iter().enumerate();
        let within = samples.filter(|(_, s)| s.time >= from - 1e-9 && s.time <= to + 1e-9);
        let states: Vec<usize> = within.map(|(n, _)| n).collect();
        let share = 1.0 / states.len().max(1) as f64;
        (states, share)
    }
}

/// Of all bodies at all states.
fn velocities(rollout: &Rollout) -> Option<DMatrix<f64>> {
    rollout.observe("velocities").ok()
}

impl Objective for GraspCost {
    fn check(&self, rollout: &Rollout) -> Result<()> {
        let (bodies, controls) = (rollout.samples()[0].poses.len(), rollout.controls().nrows());
        let most = self
            .grip
            .fingers
            .iter()
            .map(|(f, _)| *f)
            .fold(self.grip.object, usize::max);
        if most >= bodies || controls != self.grip.limits.len() {
            return Err(Error::input(
                "cost of a grasp",
                format!("a rollout of {bodies} bodies and {controls} controls"),
                "must be one of the scene that the cost was made for",
            ));
        }
        if self.states(rollout).0.is_empty() {
            let samples = rollout.samples();
            let [from, to] = [0, samples.len() - 1].map(|n| samples[n].time);
            return Err(Error::input(
                "cost of a grasp: span",
                format!("{} to {} s", self.span[0], self.span[1]),
                format!("must hold states of the rollout, which goes from {from} to {to} s"),
            ));
        }
        rollout.observe("velocities").map(|_| ())
    }

    fn value(&self, rollout: &Rollout) -> f64 {
        let Some(velocities) = velocities(rollout) else {
            return f64::NAN;
        };
        let (states, share) = self.states(rollout);
        let of = |n: usize| {
            let pressing = match n < rollout.steps() {
                true => self.pressing(rollout, n).0,
                false => 0.0,
            };
            share * (self.state(rollout, &velocities, n).cost + pressing)
        };
        states.into_iter().map(of).sum()
    }

    fn cotangents(&self, rollout: &Rollout) -> Cotangents {
        let mut out = rollout.zero_cotangents();
        let Some(velocities) = velocities(rollout) else {
            return out;
        };
        let (rows, columns) = velocities.shape();
        let mut bars = DMatrix::zeros(rows, columns);
        let (states, share) = self.states(rollout);
        for n in states {
            let slopes = self.state(rollout, &velocities, n);
            for (b, [place, turn, velocity, rate]) in slopes.bodies.iter().enumerate() {
                for k in 0..3 {
                    out.positions[(3 * b + k, n)] += share * place[k];
                    out.rotations[(3 * b + k, n)] += share * turn[k];
                    bars[(6 * b + k, n)] += share * velocity[k];
                    bars[(6 * b + 3 + k, n)] += share * rate[k];
                }
            }
            if n < rollout.steps() {
                for (c, slope) in self.pressing(rollout, n).1.into_iter().enumerate() {
                    out.controls[(c, n)] += share * slope;
                }
            }
        }
        out.observables.insert("velocities".into(), bars);
        out
    }
}
