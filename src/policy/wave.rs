//! A wave along a body of joints, held by torques: how fish robots are made to swim.
//!
//! With the place s of a joint, 0 at the head and 1 at the tail, its target is
//!
//! ```text
//! θ(t) = r(t) { a(s) sin φ + β },  a(s) = a₀ + a₁ s + a₂ s²,  φ = ω t − 2π s/λ
//! ```
//!
//! and its torque k (θ − q) + d (θ̇ − q̇). r rises smoothly (C²) from 0 to 1 while the swimmer starts.

use super::{Action, ActionBar, Observation, Policy, expect};
use crate::{Error, Result};
use nalgebra::DVector;
use std::f64::consts::TAU;

/// One joint of a [`Wave`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaveJoint {
    /// Control that it drives.
    pub control: usize,
    /// Its coordinate in q.
    pub q: usize,
    /// Its velocity in v.
    pub v: usize,
    /// Where it is along the body: 0 at the head, 1 at the tail.
    pub place: f64,
}

/// A travelling wave of joint angles, tracked by proportional–derivative torques. Gains: amplitude (three numbers), frequency, length, bias, stiffness, damping.
#[derive(Clone, Debug)]
pub struct Wave {
    /// Number of controls of the system.
    pub controls: usize,
    /// Number of velocities of the system.
    pub velocities: usize,
    /// From head to tail.
    pub joints: Vec<WaveJoint>,
    /// Amplitude's coefficients of 1, s and s², rad.
    pub amplitude: [f64; 3],
    /// ω, rad/s.
    pub frequency: f64,
    /// λ: length of the wave by that of the body.
    pub length: f64,
    /// β, added to all joints: a turn, rad.
    pub bias: f64,
    /// N m/rad.
    pub stiffness: f64,
    /// N m s/rad.
    pub damping: f64,
    /// Time in which the wave rises, s; 0: at once.
    pub rise: f64,
}

/// Number of gains.
const GAINS: usize = 8;

/// A target with its rate, and the derivatives of both with respect to amplitude, phase, frequency at a given phase, and bias.
struct Target {
    angle: f64,
    rate: f64,
    by_amplitude: [f64; 2],
    by_phase: [f64; 2],
    /// Of the rate alone.
    by_frequency: f64,
    by_bias: [f64; 2],
}

impl Wave {
    /// r and its rate at a time, s.
    fn rise(&self, t: f64) -> [f64; 2] {
        if t >= self.rise {
            return [1.0, 0.0];
        }
        let x = t / self.rise;
        let value = x * x * x * (10.0 - x * (15.0 - 6.0 * x));
        [value, 30.0 * (x * (1.0 - x)).powi(2) / self.rise]
    }

    fn target(&self, place: f64, t: f64) -> Target {
        let [r, r_rate] = self.rise(t);
        let [a0, a1, a2] = self.amplitude;
        let a = a0 + place * (a1 + place * a2);
        let omega = self.frequency;
        let (sin, cos) = (omega * t - TAU * place / self.length).sin_cos();
        Target {
            angle: r * (a * sin + self.bias),
            rate: r_rate * (a * sin + self.bias) + r * a * omega * cos,
            by_amplitude: [r * sin, r_rate * sin + r * omega * cos],
            by_phase: [r * a * cos, r_rate * a * cos - r * a * omega * sin],
            by_frequency: r * a * cos,
            by_bias: [r, r_rate],
        }
    }
}

impl Policy for Wave {
    fn act(&self, observed: &Observation) -> Result<Action> {
        let mut control = vec![0.0; self.controls];
        for j in &self.joints {
            let target = self.target(j.place, observed.time);
            control[j.control] += self.stiffness * (target.angle - observed.q[j.q])
                + self.damping * (target.rate - observed.v[j.v]);
        }
        Ok(Action::control(control))
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        let mut bar = ActionBar {
            q: vec![0.0; self.velocities],
            v: vec![0.0; self.velocities],
            gains: vec![0.0; GAINS],
        };
        let t = observed.time;
        for j in &self.joints {
            let u = control_bar[j.control];
            let target = self.target(j.place, t);
            bar.q[j.v] -= self.stiffness * u;
            bar.v[j.v] -= self.damping * u;
            let through =
                |[angle, rate]: [f64; 2]| u * (self.stiffness * angle + self.damping * rate);
            let amplitude = through(target.by_amplitude);
            let phase = through(target.by_phase);
            let s = j.place;
            let more = [
                amplitude,
                amplitude * s,
                amplitude * s * s,
                t * phase + u * self.damping * target.by_frequency,
                phase * TAU * s / (self.length * self.length),
                through(target.by_bias),
                u * (target.angle - observed.q[j.q]),
                u * (target.rate - observed.v[j.v]),
            ];
            bar.gains.iter_mut().zip(more).for_each(|(g, x)| *g += x);
        }
        Ok(bar)
    }

    fn gains(&self) -> Vec<f64> {
        let [a0, a1, a2] = self.amplitude;
        vec![
            a0,
            a1,
            a2,
            self.frequency,
            self.length,
            self.bias,
            self.stiffness,
            self.damping,
        ]
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(GAINS, gains)?;
        if let Some(k) = gains.iter().position(|g| !g.is_finite()) {
            let place = format!("controller: gains[{k}]");
            return Err(Error::input(place, gains[k], "must be finite"));
        }
        if gains[4] == 0.0 {
            return Err(Error::input(
                "controller: gains[4]",
                gains[4],
                "the length of the wave can't be zero",
            ));
        }
        Ok(Box::new(Self {
            amplitude: [gains[0], gains[1], gains[2]],
            frequency: gains[3],
            length: gains[4],
            bias: gains[5],
            stiffness: gains[6],
            damping: gains[7],
            ..self.clone()
        }))
    }
}
