//! What is recorded of a run.

use super::observable::{OBSERVABLES, Observable};
use super::{Checkpoint, Rollout};
use crate::Result;
use crate::scene::Scene;

/// The name of the controls that acted, of which the last row has none: there no step begins.
pub(super) const CONTROLS: &str = "applied_controls";

/// What a recording holds unless told otherwise, in its order, before the controls.
const RECORDED: [&str; 6] = ["q", "v", "energy", "momentum", "min_gap", "gap_error"];

/// What is written of a run: one row for the start and one after each step. SI units.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of the scene.
    pub scene: String,
    /// Time step, s.
    pub dt: f64,
    /// Time, s.
    pub time: Vec<f64>,
    /// The observables, in the order of the columns.
    pub observables: Vec<Recorded>,
    /// Where the run stands after the last row.
    pub state: Option<Checkpoint>,
}

/// An observable of a whole run.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Its name.
    pub name: &'static str,
    /// Names of its entries.
    pub labels: Vec<String>,
    /// Whether it is one number.
    pub scalar: bool,
    /// Its values, one row a time; NaN where there is none.
    pub values: Vec<Vec<f64>>,
}

impl Recording {
    /// Every state of a rollout of a scene: coordinates, velocities, energy, momentum, the smallest gap and the estimated error across it, and the controls
    /// that acted from there on ([`Rollout::applied_controls`]), of the last state NaN.
    ///
    /// # Errors
    /// A value that can't be found ([`Observable::value`]).
    pub fn of(scene: &Scene, rollout: &Rollout) -> Result<Self> {
        let of = |name: &&str| OBSERVABLES.iter().find(|o| o.name() == *name);
        let mut out = Self::with(scene, rollout, RECORDED.iter().filter_map(of).copied())?;
        let labels = rollout.simulator().control_names();
        if !labels.is_empty() {
            let acted = rollout.applied_controls();
            let none = vec![f64::NAN; labels.len()];
            let steps = acted.column_iter().map(|u| u.iter().copied().collect());
            out.observables.push(Recorded {
                name: CONTROLS,
                labels,
                scalar: false,
                values: steps.chain([none]).collect(),
            });
        }
        Ok(out)
    }

    /// The same with these observables.
    ///
    /// # Errors
    /// As [`Recording::of`].
    pub fn with(
        scene: &Scene,
        rollout: &Rollout,
        observables: impl IntoIterator<Item = &'static dyn Observable>,
    ) -> Result<Self> {
        let states = 0..rollout.states().len();
        let record = |o: &'static dyn Observable| {
            let values = states.clone().map(|n| o.value(&rollout.reading(n)));
            Ok(Recorded {
                name: o.name(),
                labels: o.labels(scene),
                scalar: o.shape(rollout.simulator().system()).is_empty(),
                values: values.collect::<Result<_>>()?,
            })
        };
        Ok(Self {
            scene: scene.name.clone(),
            dt: rollout.simulator().time_step(),
            time: rollout.samples().iter().map(|s| s.time).collect(),
            observables: (observables.into_iter().map(record)).collect::<Result<_>>()?,
            state: Some(
                rollout
                    .simulator()
                    .checkpoint(&rollout.states()[rollout.steps()])?,
            ),
        })
    }

    /// Names of the columns after time, each with its place: observable and entry.
    pub fn columns(&self) -> impl Iterator<Item = (&str, &Recorded, usize)> {
        self.observables.iter().flat_map(|o| {
            let labels = o.labels.iter().enumerate();
            labels.map(move |(i, label)| (label.as_str(), o, i))
        })
    }
}
