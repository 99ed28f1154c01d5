//! Where a simulator's runs begin.

use super::{Simulator, finite};
use crate::dynamics::{Drive, State};
use crate::multibody::Link;
use crate::{Error, Result};
use nalgebra::DVector;
use std::sync::Arc;

/// How far a value given of a driven joint may be from its motion's, relative.
const SAME: f64 = 1e-6;

impl Simulator {
    /// Initial coordinates and velocity.
    pub fn start(&self) -> (&DVector<f64>, &DVector<f64>) {
        (&self.assembled.q, &self.assembled.v)
    }

    /// Replaces the initial coordinates and velocity. Of a joint that a motion drives, both are what the motion says: 0, or that.
    ///
    /// # Errors
    /// Wrong lengths, values that aren't finite, coordinates of driven joints that their motion doesn't have at the start; bodies in one another or
    /// in a wall, and gaps that aren't resolved.
    pub fn set_start(&mut self, q: DVector<f64>, v: DVector<f64>) -> Result<()> {
        let (q, v) = self.check_start(0, &q, &v)?;
        self.check_apart(&q, self.parameters().density())?;
        let assembled = Arc::make_mut(&mut self.assembled);
        (assembled.q, assembled.v) = (q, v);
        Ok(())
    }

    /// Refuses bodies that are in one another or in a wall, and gaps that aren't resolved, where bodies feel each other through water of this density.
    pub(super) fn check_apart(&self, q: &DVector<f64>, density: f64) -> Result<()> {
        if density <= 0.0 || !self.fidelity().coupled() {
            return Ok(());
        }
        let poses = self.system().tree.kinematics(q).poses;
        let clearance = self.clearance();
        clearance.refuse_start(&poses)?;
        clearance.refuse_touch(clearance.moving.smallest(&poses).as_ref())?;
        clearance.refuse_film(&poses)
    }

    /// Checks the numbers of a configuration.
    pub(super) fn check_configuration(&self, place: &str, q: &DVector<f64>) -> Result<()> {
        let tree = &self.system().tree;
        let n = tree.coordinates();
        if q.len() != n || q.iter().any(|x| !x.is_finite()) {
            return Err(Error::input(
                place,
                format!("{:?}", q.as_slice()),
                format!("must be {n} finite numbers"),
            ));
        }
        for (body, link) in self.system().bodies.iter().zip(tree.links()) {
            let Some(w) = link.joint.quaternion_at() else {
                continue;
            };
            let norm = link.of_q(q)[w..].iter().map(|x| x * x).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > 1e-6 {
                return Err(Error::input(
                    format!("{place} of body \"{}\": quaternion (w, x, y, z)", body.name),
                    format!("length {norm}"),
                    "must have length 1",
                ));
            }
        }
        Ok(())
    }

    /// Checks the numbers of coordinates and velocity; messages call them `whose` q and v.
    pub(crate) fn check_numbers(
        &self,
        whose: &str,
        q: &DVector<f64>,
        v: &DVector<f64>,
    ) -> Result<()> {
        self.check_configuration(&format!("{whose} q"), q)?;
        let n = self.system().tree.velocities();
        if v.len() != n || v.iter().any(|x| !x.is_finite()) {
            return Err(Error::input(
                format!("{whose} v"),
                format!("{:?}", v.as_slice()),
                format!("must be {n} finite numbers"),
            ));
        }
        Ok(())
    }

    /// Checks coordinates and velocity after `step` steps; gives them with what motions say of driven joints.
    pub(super) fn check_start(
        &self,
        step: usize,
        q: &DVector<f64>,
        v: &DVector<f64>,
    ) -> Result<(DVector<f64>, DVector<f64>)> {
        self.check_numbers("initial", q, v)?;
        let time = step as f64 * self.choices.time_step;
        let (driven_q, driven_v) = self.driven(q, v, time);
        let labels = [self.scene.coordinate_labels(), self.scene.velocity_labels()];
        for (given, right, labels, name) in [
            (q, &driven_q, &labels[0], "q"),
            (v, &driven_v, &labels[1], "v"),
        ] {
            let differs = |i: &usize| {
                let (x, y) = (given[*i], right[*i]);
                x != 0.0 && (x - y).abs() > SAME * x.abs().max(y.abs())
            };
            if let Some(i) = (0..given.len()).find(differs) {
                let mut joints = self.system().drives.iter().zip(self.system().tree.links());
                let locked = |(drive, link): (&Drive, &Link)| {
                    *drive == Drive::Locked && name == "v" && link.v.contains(&i)
                };
                let right = match joints.any(locked) {
                    true => "the joint is locked and can't move; give 0".into(),
                    false => format!(
                        "the joint is driven, and at t = {time} s its motion has {}; give that, or 0",
                        right[i]
                    ),
                };
                let place = format!("initial {name}: {}", labels[i]);
                return Err(Error::input(place, given[i], right));
            }
        }
        Ok((driven_q, driven_v))
    }

    /// Coordinates and velocity with driven joints where, and as fast as, their motion has them at a time; locked ones at rest.
    fn driven(
        &self,
        q: &DVector<f64>,
        v: &DVector<f64>,
        time: f64,
    ) -> (DVector<f64>, DVector<f64>) {
        let (mut q, mut v) = (q.clone(), v.clone());
        self.stepper().place_motions(&mut q, time);
        let system = self.system();
        for (drive, link) in system.drives.iter().zip(system.tree.links()) {
            for (k, i) in link.v.clone().enumerate() {
                match drive {
                    Drive::Motion(motions) => v[i] = motions[k].rate(time),
                    Drive::Locked => v[i] = 0.0,
                    Drive::Free => {}
                }
            }
        }
        (q, v)
    }

    /// Forgets what a start's cotangents, or tangents, have of what it isn't asked for: coordinates and velocities of joints that a motion drives, and velocities
    /// of locked ones.
    pub(super) fn forget_driven(&self, q: &mut DVector<f64>, v: &mut DVector<f64>) {
        let system = self.system();
        for (drive, link) in system.drives.iter().zip(system.tree.links()) {
            for i in link.v.clone() {
                if matches!(drive, Drive::Motion(_)) {
                    q[i] = 0.0;
                }
                if !matches!(drive, Drive::Free) {
                    v[i] = 0.0;
                }
            }
        }
    }

    /// The initial state of the integrator.
    ///
    /// # Errors
    /// An indefinite mass matrix, or whatever the coupling reports.
    pub fn initial(&self) -> Result<State> {
        self.state_unchecked(0, &self.assembled.q, &self.assembled.v)
    }

    fn state_unchecked(&self, step: usize, q: &DVector<f64>, v: &DVector<f64>) -> Result<State> {
        let stepper = self.stepper();
        let mut q = q.clone();
        stepper.place_motions(&mut q, step as f64 * self.choices.time_step);
        finite::coordinates(&self.scene, step, &q)?;
        finite::velocities(&self.scene, step, v)?;
        let run = || {
            let time = step as f64 * self.choices.time_step;
            let e = self.system().evaluate(self.parameters(), &q, time)?;
            let state = State {
                step,
                y: stepper.conserved(&e, v),
                q: q.clone(),
                held: Vec::new(),
                mode: 0,
            };
            finite::state(&self.scene, &state)?;
            stepper.velocity(&e, &state)?;
            Ok(state)
        };
        // Bodies in one another are the better thing to say.
        run().map_err(
            |e| match self.check_apart(&q, self.parameters().density()) {
                Err(apart) => apart,
                Ok(()) => e,
            },
        )
    }

    /// Coordinates and velocity after `step` steps: those given, else those of the start; of joints that a motion drives what it says then, and no velocity of locked ones.
    /// [`Simulator::state`] is at the state there.
    ///
    /// # Errors
    /// As [`Simulator::state`], of the numbers that are given.
    pub fn placed(
        &self,
        step: usize,
        q: Option<&DVector<f64>>,
        v: Option<&DVector<f64>>,
    ) -> Result<(DVector<f64>, DVector<f64>)> {
        let (q0, v0) = self.start();
        let (q0, v0) = self.driven(q0, v0, step as f64 * self.choices.time_step);
        self.check_start(step, q.unwrap_or(&q0), v.unwrap_or(&v0))
    }

    /// The integrator's state at coordinates `q` and generalised velocity `v` after `step` steps: where
    /// [`Simulator::rollout_from`] may begin. Of a joint that a motion drives, both are what the motion says then: 0, or that.
    ///
    /// # Errors
    /// Wrong lengths, values that aren't finite, quaternions not of length 1, coordinates of driven joints that their motion doesn't have then, or as
    /// [`Simulator::initial`].
    pub fn state(&self, step: usize, q: &DVector<f64>, v: &DVector<f64>) -> Result<State> {
        let (q, v) = self.check_start(step, q, v)?;
        self.state_unchecked(step, &q, &v)
    }

    /// The same from what is seen of a plant whose clock isn't this one's: driven joints are where their motion has them after `step` steps, whatever `q` and `v` say of
    /// them.
    ///
    /// # Errors
    /// As [`Simulator::state`], but for driven joints.
    #[cfg(feature = "opt")]
    pub(crate) fn state_of_plant(
        &self,
        step: usize,
        q: &DVector<f64>,
        v: &DVector<f64>,
    ) -> Result<State> {
        self.check_numbers("initial", q, v)?;
        let (q, v) = self.driven(q, v, step as f64 * self.choices.time_step);
        self.state_unchecked(step, &q, &v)
    }
}
