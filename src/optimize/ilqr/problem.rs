//! What is to be found, and trajectories through it.

use super::backward::{Answer, KnotModel};
use crate::error::in_order;
use crate::optimize::cost::{Bound, Cost, CostPoint, Quadratic};
use crate::simulate::{Cotangents, Jacobians, Objective, Rollout, Simulator};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Controls over a horizon that are to lower a cost: one row of them for each knot, held over some time steps.
#[derive(Clone)]
pub struct Problem {
    /// Knots.
    pub knots: usize,
    /// Time steps from one knot to the next.
    pub hold: usize,
    /// What is to be lowered.
    pub cost: Cost,
    /// Least value of each open-loop control (N, N m), one for all or one each; empty: none.
    pub lower: Vec<f64>,
    /// Largest value.
    pub upper: Vec<f64>,
    /// The controls before the first knot, from which [`terms::control_change`](crate::optimize::terms::control_change) counts there; `None`: it doesn't.
    pub previous: Option<Vec<f64>>,
}

impl Problem {
    /// Without limits, a control for every time step.
    pub fn new(knots: usize, cost: Cost) -> Self {
        Self {
            knots,
            hold: 1,
            cost,
            lower: Vec::new(),
            upper: Vec::new(),
            previous: None,
        }
    }

    /// With so many time steps from one knot to the next.
    pub fn hold(mut self, steps: usize) -> Self {
        self.hold = steps;
        self
    }

    /// With limits of the controls, one for all or one each; infinite: none.
    pub fn limits(mut self, lower: impl Into<Vec<f64>>, upper: impl Into<Vec<f64>>) -> Self {
        (self.lower, self.upper) = (lower.into(), upper.into());
        self
    }

    /// The cost as an objective of rollouts of all its steps, for gradients by reverse sweeps: each knot's controls are those of its first step.
    ///
    /// # Errors
    /// As [`ilqr`](super::ilqr), of the problem.
    pub fn objective(&self, simulator: &Simulator) -> Result<impl Objective> {
        Ok(ProblemObjective(Ready::new(self, simulator)?))
    }
}

/// A problem made ready for a simulator.
pub(in crate::optimize) struct Ready {
    pub knots: usize,
    pub hold: usize,
    /// From one knot to the next, s.
    pub duration: f64,
    pub cost: Bound,
    pub lower: DVector<f64>,
    pub upper: DVector<f64>,
    pub previous: Option<DVector<f64>>,
}

/// A trajectory with what it costs.
pub(in crate::optimize) struct Run {
    pub rollout: Rollout,
    /// Controls × knots.
    pub controls: DMatrix<f64>,
    pub cost: f64,
}

/// A list of numbers as one for each control.
fn each(place: &str, given: &[f64], empty: f64, controls: usize) -> Result<DVector<f64>> {
    if given.iter().any(|x| x.is_nan()) {
        let given = format!("{given:?}");
        return Err(Error::input(
            place,
            given,
            "must be numbers, infinite where there is no limit",
        ));
    }
    match given {
        [] => Ok(DVector::from_element(controls, empty)),
        [all] => Ok(DVector::from_element(controls, *all)),
        each if each.len() == controls => Ok(DVector::from_column_slice(each)),
        _ => Err(Error::input(
            place,
            format!("{} numbers", given.len()),
            format!("must be one number, or {controls}, one per control"),
        )),
    }
}

impl Ready {
    pub fn new(problem: &Problem, simulator: &Simulator) -> Result<Self> {
        for (name, count) in [("knots", problem.knots), ("hold", problem.hold)] {
            if count == 0 {
                return Err(Error::input(
                    format!("problem: {name}"),
                    0,
                    "must be at least 1",
                ));
            }
        }
        if problem.cost.is_empty() {
            return Err(Error::input(
                "problem: cost",
                "no terms",
                "give at least one: without, every trajectory is as good",
            ));
        }
        // Before anything is made for each of them.
        let steps = problem.knots.saturating_mul(problem.hold);
        (simulator.check_steps(steps)).map_err(|e| e.within("problem: knots · hold"))?;
        let controls = simulator.system().controls;
        if controls == 0 {
            return Err(Error::Unsupported {
                what: "optimal control of this scene".into(),
                why: "nothing in it is controlled".into(),
                instead: "make joints `actuated`, or give bodies thrusters".into(),
            });
        }
        let lower = each(
            "problem: lower",
            &problem.lower,
            f64::NEG_INFINITY,
            controls,
        )?;
        let upper = each("problem: upper", &problem.upper, f64::INFINITY, controls)?;
        for i in 0..controls {
            let room =
                lower[i] <= upper[i] && lower[i] < f64::INFINITY && upper[i] > f64::NEG_INFINITY;
            if !room {
                return Err(Error::input(
                    format!("problem: limits of control {i}"),
                    format!("lower {} and upper {}", lower[i], upper[i]),
                    "the lower one must be at most the upper one: are they the wrong way round?",
                ));
            }
        }
        let previous = match &problem.previous {
            None => None,
            Some(given) if given.len() == controls && given.iter().all(|x| x.is_finite()) => {
                Some(DVector::from_column_slice(given))
            }
            Some(given) => {
                return Err(Error::input(
                    "problem: previous",
                    format!("{given:?}"),
                    format!("must be {controls} finite numbers, one per control"),
                ));
            }
        };
        Ok(Self {
            knots: problem.knots,
            hold: problem.hold,
            duration: problem.hold as f64 * simulator.time_step(),
            cost: problem.cost.bind(simulator)?,
            lower,
            upper,
            previous,
        })
    }

    /// Time steps of the horizon.
    pub fn steps(&self) -> usize {
        self.knots * self.hold
    }

    /// Controls within the limits.
    pub fn clamp(&self, control: &mut DVector<f64>) {
        for (i, x) in control.iter_mut().enumerate() {
            *x = x.clamp(self.lower[i], self.upper[i]);
        }
    }

    /// The trajectory whose controls `decide` gives at each knot from the state there, (q, v), and the controls before, kept within the limits; and its cost.
    pub fn run(
        &self,
        simulator: &Simulator,
        start: &crate::simulate::State,
        mut decide: impl FnMut(
            usize,
            &DVector<f64>,
            &DVector<f64>,
            Option<&DVector<f64>>,
        ) -> DVector<f64>
        + Send,
    ) -> Result<Run> {
        let mut controls = DMatrix::zeros(self.cost.sizes.controls, self.knots);
        let mut held: Option<DVector<f64>> = self.previous.clone();
        let rollout = simulator.rollout_deciding(start, self.steps(), |n, sample| {
            if n % self.hold == 0 {
                let mut next = decide(n / self.hold, &sample.q, &sample.v, held.as_ref());
                self.clamp(&mut next);
                controls.set_column(n / self.hold, &next);
                held = Some(next);
            }
            Ok(held.clone().unwrap_or_default())
        })?;
        let cost = self.cost_of(&rollout, &controls)?;
        Ok(Run {
            rollout,
            controls,
            cost,
        })
    }

    /// Calls `with` at each knot's point, the end's last.
    fn each_point<T: Send>(
        &self,
        rollout: &Rollout,
        controls: &DMatrix<f64>,
        with: impl Fn(&CostPoint) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let columns: Vec<DVector<f64>> = controls.column_iter().map(|c| c.into_owned()).collect();
        let one = |knot: usize| {
            let previous = match knot.checked_sub(1) {
                None => self.previous.as_ref(),
                Some(before) => columns.get(before),
            };
            with(&CostPoint {
                rollout,
                state: knot * self.hold,
                knot,
                control: columns.get(knot),
                previous,
            })
        };
        in_order((0..=self.knots).into_par_iter().map(one))
    }

    fn cost_of(&self, rollout: &Rollout, controls: &DMatrix<f64>) -> Result<f64> {
        let each = self.each_point(rollout, controls, |at| self.cost.value(at, self.duration))?;
        // In order, whatever the threads.
        Ok(each.iter().sum())
    }

    /// Every knot of a trajectory linearised, and the cost at its end.
    ///
    /// # Errors
    /// Of the derivatives.
    pub(super) fn models(&self, run: &Run) -> Result<(Vec<KnotModel>, Quadratic)> {
        let costs = self.each_point(&run.rollout, &run.controls, |at| {
            self.cost.quadratic(at, self.duration)
        })?;
        let steps = run.rollout.step_jacobians(&[])?;
        let mut costs = costs.into_iter();
        let knots = steps.chunks(self.hold).zip(&mut costs).enumerate();
        let of = |(k, (steps, cost)): (usize, (&[Jacobians], Quadratic))| {
            let (a, b) = chained(steps);
            let now = run.controls.column(k);
            let before = match k.checked_sub(1) {
                None => self.previous.clone(),
                Some(before) => Some(run.controls.column(before).into_owned()),
            };
            let change = self
                .cost
                .change
                .as_ref()
                .zip(before)
                .map(|(weights, before)| (2.0 * self.duration * weights, now - before));
            KnotModel {
                a,
                b,
                cost,
                change,
                lower: &self.lower - now,
                upper: &self.upper - now,
            }
        };
        let models = knots.map(of).collect();
        let last = costs.next().unwrap_or_else(|| {
            Quadratic::zeros(self.cost.sizes.states(), self.cost.sizes.controls)
        });
        Ok((models, last))
    }

    /// Controls of a knot by what was found there for changes of its state and of the controls before; `part` of the step.
    pub(super) fn answered(
        &self,
        knot: usize,
        run: &Run,
        answer: &Answer,
        part: f64,
        moved: &DVector<f64>,
        previous: Option<&DVector<f64>>,
    ) -> DVector<f64> {
        let mut u = run.controls.column(knot) + part * &answer.step + &answer.gain * moved;
        if let (Some(gain), Some(now)) = (&answer.of_previous, previous) {
            let before = match knot.checked_sub(1) {
                None => self.previous.clone().unwrap_or_else(|| now.clone()),
                Some(before) => run.controls.column(before).into_owned(),
            };
            u += gain * (now - before);
        }
        if part == 1.0 {
            // At the limit to the bit where that holds it.
            for (i, held) in answer.held.iter().enumerate() {
                if *held {
                    let below = answer.step[i] <= self.lower[i] - run.controls[(i, knot)];
                    u[i] = if below { self.lower[i] } else { self.upper[i] };
                }
            }
        }
        u
    }
}

/// The next knot's state by a knot's state, and by its controls, from its steps.
pub(super) fn chained(steps: &[Jacobians]) -> (DMatrix<f64>, DMatrix<f64>) {
    let first = (steps[0].state.clone(), steps[0].controls.clone());
    steps[1..].iter().fold(first, |(a, b), step| {
        (&step.state * a, &step.state * b + &step.controls)
    })
}

/// Changes of (q, v) from one state to another, q in its tangent space: 2nv.
pub(in crate::optimize) fn moved(
    simulator: &Simulator,
    from: (&DVector<f64>, &DVector<f64>),
    to: (&DVector<f64>, &DVector<f64>),
) -> DVector<f64> {
    let q = simulator.system().tree.difference(from.0, to.0);
    let v = to.1 - from.1;
    let nv = v.len();
    DVector::from_fn(2 * nv, |i, _| if i < nv { q[i] } else { v[i - nv] })
}

struct ProblemObjective(Ready);

impl ProblemObjective {
    fn controls(&self, rollout: &Rollout) -> DMatrix<f64> {
        let all = rollout.controls();
        DMatrix::from_fn(all.nrows(), self.0.knots, |i, k| all[(i, k * self.0.hold)])
    }

    fn quadratics(&self, rollout: &Rollout) -> Result<Vec<Quadratic>> {
        let controls = self.controls(rollout);
        let of = |at: &CostPoint| self.0.cost.quadratic(at, self.0.duration);
        self.0.each_point(rollout, &controls, of)
    }
}

impl Objective for ProblemObjective {
    fn check(&self, rollout: &Rollout) -> Result<()> {
        let simulator = rollout.simulator();
        let sizes = crate::optimize::cost::Sizes::of(simulator);
        if sizes != self.0.cost.sizes || rollout.steps() != self.0.steps() {
            return Err(Error::input(
                "objective of a problem: rollout",
                format!("{} steps of {sizes}", rollout.steps()),
                format!(
                    "must have {} steps of {}",
                    self.0.steps(),
                    self.0.cost.sizes
                ),
            ));
        }
        self.quadratics(rollout).map(drop)
    }

    fn value(&self, rollout: &Rollout) -> f64 {
        let controls = self.controls(rollout);
        self.0.cost_of(rollout, &controls).unwrap_or(f64::NAN)
    }

    fn cotangents(&self, rollout: &Rollout) -> Cotangents {
        let mut out = rollout.zero_cotangents();
        let nv = self.0.cost.sizes.velocities;
        let controls = self.controls(rollout);
        // `check` has found no error.
        for (k, own) in self
            .quadratics(rollout)
            .unwrap_or_default()
            .iter()
            .enumerate()
        {
            let n = k * self.0.hold;
            out.q.set_column(n, &own.x.rows(0, nv));
            out.v.set_column(n, &own.x.rows(nv, nv));
            if k < self.0.knots {
                let mut column = out.controls.column_mut(n);
                column += &own.u;
            }
        }
        if let Some(weights) = &self.0.cost.change {
            for k in 0..self.0.knots {
                let before = match k.checked_sub(1) {
                    None => self.0.previous.clone(),
                    Some(before) => Some(controls.column(before).into_owned()),
                };
                let Some(before) = before else { continue };
                let change = controls.column(k) - before;
                let bar = 2.0 * self.0.duration * weights.component_mul(&change);
                let mut column = out.controls.column_mut(k * self.0.hold);
                column += &bar;
                if k > 0 {
                    let mut column = out.controls.column_mut((k - 1) * self.0.hold);
                    column -= &bar;
                }
            }
        }
        out
    }
}
