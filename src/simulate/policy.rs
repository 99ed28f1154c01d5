//! Controllers: what acts, from what is observed, with its transpose.

use crate::{Error, Result};
use nalgebra::DVector;

/// What a controller sees at the start of a step.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Number of steps made.
    pub step: usize,
    /// Time, s.
    pub time: f64,
    /// Joint coordinates.
    pub q: &'a DVector<f64>,
    /// Generalised velocity.
    pub v: &'a DVector<f64>,
}

/// What a controller does during the step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Action {
    /// Added to the open-loop controls; empty: nothing.
    pub control: Vec<f64>,
    /// Bodies whose joints are held; empty: none.
    pub hold: Vec<bool>,
}

/// Cotangents of [`Policy::act`]'s inputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActionBar {
    /// Tangent cotangent of q, length nv; empty: zero.
    pub q: Vec<f64>,
    /// Cotangent of v; empty: zero.
    pub v: Vec<f64>,
    /// Cotangent of the gains.
    pub gains: Vec<f64>,
}

/// A controller. A pure function of what it observes, so that a rollout can be replayed.
///
/// Controllers with switches (if, lock) are differentiable between them: the gradient is that of the
/// branch that was taken, at the step at which it was taken. How the *moment* of a switch moves with the
/// inputs is not seen: it moves in whole steps, so the trajectory jumps by what one step at the
/// switch is worth, and the gradient holds between two such jumps.
pub trait Policy: Send + Sync {
    /// The action at an observation.
    fn act(&self, observed: &Observation) -> Action;

    /// Transpose of [`Policy::act`] for the cotangent of its control.
    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> ActionBar;

    /// Adjustable gains.
    fn gains(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The same controller with other gains.
    ///
    /// # Errors
    /// A wrong number of gains.
    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>>;
}

/// No feedback: only the open-loop controls.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpenLoop;

fn expect(count: usize, gains: &[f64]) -> Result<()> {
    if gains.len() == count {
        return Ok(());
    }
    Err(Error::input(
        "controller: gains",
        format!("{} numbers", gains.len()),
        format!("must be {count} numbers"),
    ))
}

impl Policy for OpenLoop {
    fn act(&self, _: &Observation) -> Action {
        Action::default()
    }

    fn act_vjp(&self, _: &Observation, _: &DVector<f64>) -> ActionBar {
        ActionBar::default()
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(0, gains)?;
        Ok(Box::new(*self))
    }
}

/// Constant controls as gains.
#[derive(Clone, Debug)]
pub struct Constant {
    /// Controls, N or N m.
    pub control: Vec<f64>,
}

impl Policy for Constant {
    fn act(&self, _: &Observation) -> Action {
        Action {
            control: self.control.clone(),
            hold: Vec::new(),
        }
    }

    fn act_vjp(&self, _: &Observation, control_bar: &DVector<f64>) -> ActionBar {
        ActionBar {
            gains: control_bar.as_slice().to_vec(),
            ..ActionBar::default()
        }
    }

    fn gains(&self) -> Vec<f64> {
        self.control.clone()
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(self.control.len(), gains)?;
        Ok(Box::new(Self {
            control: gains.to_vec(),
        }))
    }
}

/// One actuated coordinate of a [`Pd`] controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PdAxis {
    /// Control that it drives.
    pub control: usize,
    /// Its coordinate in q.
    pub q: usize,
    /// Its velocity in v.
    pub v: usize,
    /// Target, m or rad.
    pub target: f64,
    /// Stiffness, N/m or N m/rad.
    pub stiffness: f64,
    /// Damping, N s/m or N m s/rad.
    pub damping: f64,
}

/// Proportional–derivative control, `u = stiffness (target − q) − damping v`. Gains: target, stiffness and
/// damping of each axis in turn.
#[derive(Clone, Debug)]
pub struct Pd {
    /// Number of controls of the system.
    pub controls: usize,
    /// Number of velocities of the system.
    pub velocities: usize,
    /// Axes.
    pub axes: Vec<PdAxis>,
}

impl Policy for Pd {
    fn act(&self, observed: &Observation) -> Action {
        let mut control = vec![0.0; self.controls];
        for a in &self.axes {
            control[a.control] +=
                a.stiffness * (a.target - observed.q[a.q]) - a.damping * observed.v[a.v];
        }
        Action {
            control,
            hold: Vec::new(),
        }
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> ActionBar {
        let mut bar = ActionBar {
            q: vec![0.0; self.velocities],
            v: vec![0.0; self.velocities],
            gains: Vec::with_capacity(3 * self.axes.len()),
        };
        for a in &self.axes {
            let u = control_bar[a.control];
            bar.q[a.v] -= a.stiffness * u;
            bar.v[a.v] -= a.damping * u;
            bar.gains.extend([
                a.stiffness * u,
                (a.target - observed.q[a.q]) * u,
                -observed.v[a.v] * u,
            ]);
        }
        bar
    }

    fn gains(&self) -> Vec<f64> {
        let row = |a: &PdAxis| [a.target, a.stiffness, a.damping];
        self.axes.iter().flat_map(row).collect()
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(3 * self.axes.len(), gains)?;
        let mut out = self.clone();
        for (a, g) in out.axes.iter_mut().zip(gains.chunks_exact(3)) {
            (a.target, a.stiffness, a.damping) = (g[0], g[1], g[2]);
        }
        Ok(Box::new(out))
    }
}

/// Pushes one joint until its coordinate passes a value, then stops it within one step and holds it: the
/// paper's falling ball. Its gain is the force; see [`Policy`] for what the switch does to a gradient.
#[derive(Clone, Debug)]
pub struct PushThenLock {
    /// Number of controls of the system.
    pub controls: usize,
    /// Number of bodies.
    pub bodies: usize,
    /// The body.
    pub body: usize,
    /// Its control.
    pub control: usize,
    /// Its coordinate.
    pub q: usize,
    /// Force, N or N m.
    pub force: f64,
    /// Coordinate at which it stops.
    pub stop_at: f64,
    /// Whether the coordinate comes from above.
    pub from_above: bool,
}

impl PushThenLock {
    fn stopped(&self, observed: &Observation) -> bool {
        let x = observed.q[self.q];
        if self.from_above {
            x < self.stop_at
        } else {
            x > self.stop_at
        }
    }
}

impl Policy for PushThenLock {
    fn act(&self, observed: &Observation) -> Action {
        if self.stopped(observed) {
            let mut hold = vec![false; self.bodies];
            hold[self.body] = true;
            return Action {
                control: Vec::new(),
                hold,
            };
        }
        let mut control = vec![0.0; self.controls];
        control[self.control] = self.force;
        Action {
            control,
            hold: Vec::new(),
        }
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> ActionBar {
        let gain = if self.stopped(observed) {
            0.0
        } else {
            control_bar[self.control]
        };
        ActionBar {
            gains: vec![gain],
            ..ActionBar::default()
        }
    }

    fn gains(&self) -> Vec<f64> {
        vec![self.force]
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(1, gains)?;
        Ok(Box::new(Self {
            force: gains[0],
            ..self.clone()
        }))
    }
}
