//! The feedback that holds a robot to a plan.

use crate::simulate::{Action, ActionBar, Observation, Policy, Simulator, steps_at};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// u = ū + K (x ⊖ x̄), kept within the plan's limits: a controller, for [`Simulator::set_policy`]. At every time step x̄ is the plan's state at that time, ū and K are those of its
/// knot; the controls of the knot before, which changes of controls may weigh, are taken to be as planned. Before the plan starts and after it has ended the nearest controls are held,
/// without feedback. Clones share the plan.
#[derive(Clone)]
pub struct Tracking(pub(super) Arc<Track>);

/// A plan, as feedback needs it: to be kept, and made a [`Tracking`] again ([`Tracking::of`]).
#[derive(Clone)]
pub struct Track {
    /// What planned it.
    pub simulator: Simulator,
    /// Time of its first state, s.
    pub start: f64,
    /// Time steps from one knot to the next.
    pub hold: usize,
    /// (q, v) at every time step, from its start to its end.
    pub states: Vec<(DVector<f64>, DVector<f64>)>,
    /// Controls × knots.
    pub controls: DMatrix<f64>,
    /// K of each knot, controls × 2nv.
    pub gains: Vec<DMatrix<f64>>,
    /// Least value of each control; infinite: none.
    pub lower: DVector<f64>,
    /// Largest value.
    pub upper: DVector<f64>,
}

impl Track {
    /// Refuses numbers that don't go with the simulator, or with each other.
    fn validate(&self) -> Result<()> {
        let system = self.simulator.system();
        let (nq, nv) = (system.tree.coordinates(), system.tree.velocities());
        let (nu, knots) = self.controls.shape();
        let states = knots.saturating_mul(self.hold).saturating_add(1);
        let fits = |(q, v): &(DVector<f64>, DVector<f64>)| [q.len(), v.len()] == [nq, nv];
        // No number is at most one that isn't.
        let within = |(least, most): (&f64, &f64)| least <= most;
        let checks = [
            ("start", self.start.is_finite()),
            ("knots and hold", knots > 0 && self.hold > 0),
            ("controls", nu == system.controls),
            (
                "states",
                self.states.len() == states && self.states.iter().all(fits),
            ),
            (
                "gains",
                self.gains.len() == knots && self.gains.iter().all(|k| k.shape() == (nu, 2 * nv)),
            ),
            (
                "limits",
                self.lower.len() == nu
                    && self.upper.len() == nu
                    && self.lower.iter().zip(&self.upper).all(within),
            ),
        ];
        match checks.iter().find(|(_, right)| !right) {
            None => Ok(()),
            Some((name, _)) => Err(Error::input(
                format!("tracking of a plan: {name}"),
                "what doesn't go with the rest",
                format!(
                    "must be those of a plan of {} controls, {nq} coordinates and {nv} velocities",
                    system.controls
                ),
            )),
        }
    }
}

impl Tracking {
    /// The feedback about a plan that was kept.
    ///
    /// # Errors
    /// Numbers that don't go with its simulator, or with each other.
    pub fn of(track: Track) -> Result<Self> {
        track.validate()?;
        Ok(Self(Arc::new(track)))
    }

    /// The plan.
    pub fn track(&self) -> &Track {
        &self.0
    }

    /// Time steps of the plan between its start and a time; negative before it.
    pub fn step_at(&self, time: f64) -> isize {
        steps_at(time - self.0.start, self.0.simulator.time_step()) as isize
    }

    /// Controls of the plan at its time step `step`, without feedback.
    pub(in crate::optimize) fn planned(&self, step: usize) -> DVector<f64> {
        let Track { controls, hold, .. } = &*self.0;
        let last = controls.ncols() - 1;
        controls.column((step / hold).min(last)).into_owned()
    }

    /// Controls at the plan's time step `step` and a state, and the change of the state against the plan where there is feedback.
    pub(super) fn before_limits(
        &self,
        step: isize,
        q: &DVector<f64>,
        v: &DVector<f64>,
    ) -> (DVector<f64>, Option<(usize, DVector<f64>)>) {
        let Track { controls, hold, .. } = &*self.0;
        let at = usize::try_from(step).ok();
        let mut u = self.planned(at.unwrap_or(0));
        match at.filter(|step| *step < controls.ncols() * hold) {
            None => (u, None),
            Some(step) => {
                let knot = step / hold;
                let (planned_q, planned_v) = &self.0.states[step];
                let moved =
                    super::problem::moved(&self.0.simulator, (planned_q, planned_v), (q, v));
                u += &self.0.gains[knot] * &moved;
                (u, Some((knot, moved)))
            }
        }
    }

    /// Controls at the plan's time step `step` and a state.
    ///
    /// # Errors
    /// A state of other sizes.
    pub fn control(&self, step: isize, q: &DVector<f64>, v: &DVector<f64>) -> Result<DVector<f64>> {
        self.check(q, v)?;
        let (mut u, _) = self.before_limits(step, q, v);
        for (i, u) in u.iter_mut().enumerate() {
            *u = u.clamp(self.0.lower[i], self.0.upper[i]);
        }
        Ok(u)
    }

    fn check(&self, q: &DVector<f64>, v: &DVector<f64>) -> Result<()> {
        let tree = &self.0.simulator.system().tree;
        let (given, right) = ([q.len(), v.len()], [tree.coordinates(), tree.velocities()]);
        match given == right {
            true => Ok(()),
            false => Err(Error::input(
                "tracking of a plan: numbers of coordinates and velocities",
                format!("{given:?}"),
                format!("must be {right:?}, as in the plan's scene"),
            )),
        }
    }
}

impl Policy for Tracking {
    fn act(&self, observed: &Observation) -> Result<Action> {
        let u = self.control(self.step_at(observed.time), observed.q, observed.v)?;
        Ok(Action {
            control: u.as_slice().to_vec(),
            ..Action::default()
        })
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        self.check(observed.q, observed.v)?;
        let controls = self.0.controls.nrows();
        if control_bar.len() != controls {
            return Err(Error::input(
                "tracking of a plan: control_bar",
                format!("{} numbers", control_bar.len()),
                format!("must be {controls} numbers, one per control"),
            ));
        }
        let step = self.step_at(observed.time);
        let (u, fed_back) = self.before_limits(step, observed.q, observed.v);
        let Some((knot, moved)) = fed_back else {
            return Ok(ActionBar::default());
        };
        let inside = |i: usize| u[i] >= self.0.lower[i] && u[i] <= self.0.upper[i];
        let bar = DVector::from_fn(u.len(), |i, _| if inside(i) { control_bar[i] } else { 0.0 });
        let bar = self.0.gains[knot].tr_mul(&bar);
        let nv = observed.v.len();
        let (xi, own) = (moved.rows(0, nv).into_owned(), bar.rows(0, nv).into_owned());
        // Transpose of how x ⊖ x̄ moves with x.
        let tree = &self.0.simulator.system().tree;
        let (_, q) = tree.chart_rate_vjp(&xi, &DVector::zeros(nv), &own);
        Ok(ActionBar {
            q: q.as_slice().to_vec(),
            v: bar.rows(nv, nv).as_slice().to_vec(),
            gains: Vec::new(),
        })
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        match gains {
            [] => Ok(Box::new(self.clone())),
            _ => Err(Error::input(
                "tracking of a plan: gains",
                format!("{} numbers", gains.len()),
                "must be none: plan again to change them",
            )),
        }
    }
}
