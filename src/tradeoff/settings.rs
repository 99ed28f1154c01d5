//! What a user may choose about the comparison.

use crate::dynamics::Integrator;
use crate::simulate::{Fidelity, Knob, Method};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use strum::VariantArray;

/// What is varied, and how long it may take. Of each list that isn't empty, the first value is what all else is varied
/// around; what an empty one stands for is said with it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TradeoffSettings {
    /// Fidelities; empty: all of them.
    pub fidelities: Vec<Fidelity>,
    /// Methods by which a body alone is solved; empty: what the scene asks for, and the others that the fidelity has.
    pub methods: Vec<Method>,
    /// Faces per body of shapes by formula; empty: the scene's own, and 80, 320, 1280.
    pub faces: Vec<usize>,
    /// Points of each compressed body ([`Fidelity::Reduced`]); empty: 20, 40, 80, 160, 320.
    pub ranks: Vec<usize>,
    /// Errors that [`Fidelity::Reduced`] and [`Fidelity::Auto`] aim at; empty: their own, and 3e-2 to 1e-4.
    pub accuracies: Vec<f64>,
    /// Relative residuals of the coupled solve ([`Fidelity::Full`]); empty: its own, and 1e-3 to 1e-10.
    pub tolerances: Vec<f64>,
    /// Integrators, with one fidelity: reduced if it is among them; empty: the scene's own, and all others.
    pub integrators: Vec<Integrator>,
    /// Time steps in s, with the same fidelity; empty: the scene's own, and 4 times to a quarter of it.
    pub time_steps: Vec<f64>,
    /// Every combination of what is varied, in place of one after the other.
    pub full_product: bool,
    /// Steps of the scene's own length over which trajectories are compared; `None`: the scene's own number, at most 50.
    pub steps: Option<usize>,
    /// Finest faces per body of the reference, whatever time it takes; `None`: as many as the budget has time for.
    pub reference_faces: Option<usize>,
    /// Time to do all this in, roughly, s; what is left out for it is told. `None`: 120.
    pub budget: Option<f64>,
}

impl TradeoffSettings {
    /// Checks the values.
    pub(super) fn validate(&self) -> Result<()> {
        let numbers = |counts: &[usize]| counts.iter().map(|n| *n as f64).collect();
        let count = (f64::INFINITY, "must be above zero");
        let part = (1.0, "must be between 0 and 1");
        let time = (f64::INFINITY, "must be above zero and finite, in s");
        let fields: [(&str, Vec<f64>, (f64, &str)); 8] = [
            ("faces", numbers(&self.faces), count),
            ("ranks", numbers(&self.ranks), count),
            ("steps", numbers(self.steps.as_slice()), count),
            (
                "reference_faces",
                numbers(self.reference_faces.as_slice()),
                count,
            ),
            ("accuracies", self.accuracies.clone(), part),
            ("tolerances", self.tolerances.clone(), part),
            ("time_steps", self.time_steps.clone(), time),
            ("budget", self.budget.as_slice().to_vec(), time),
        ];
        for (name, values, (below, expected)) in fields {
            if let Some(x) = values.into_iter().find(|x| !(*x > 0.0 && *x < below)) {
                let place = format!("tradeoff settings: {name}");
                return Err(Error::input(place, x, expected));
            }
        }
        let own = &self.fidelities;
        let varied = [
            ("ranks", self.ranks.len(), Knob::Rank),
            ("accuracies", self.accuracies.len(), Knob::Accuracy),
            ("tolerances", self.tolerances.len(), Knob::Tolerance),
        ];
        for (name, count, knob) in varied {
            let has = |fidelity: &&Fidelity| fidelity.kind().knobs().contains(&knob);
            if count == 0 || own.is_empty() || own.iter().any(|fidelity| has(&fidelity)) {
                continue;
            }
            return Err(Error::input(
                format!("tradeoff settings: {name}"),
                format!("{count} with the fidelities {}", names(own.iter())),
                format!(
                    "must be left out, or one of {} be among the fidelities",
                    names(Fidelity::VARIANTS.iter().filter(has))
                ),
            ));
        }
        Ok(())
    }
}

fn names<'f>(fidelities: impl Iterator<Item = &'f Fidelity>) -> String {
    fidelities
        .map(Fidelity::to_string)
        .collect::<Vec<_>>()
        .join(", ")
}
