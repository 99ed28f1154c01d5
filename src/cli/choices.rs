//! By what a scene was simulated, for the reports of all commands.

use serde::Serialize;

use super::options::name;
use crate::simulate::{BackendReport, Simulator};

/// By what a scene was simulated.
#[derive(Clone, Debug, Serialize)]
pub(super) struct ChoicesReport {
    pub fidelity: String,
    /// What `auto` came to; the fidelity itself otherwise.
    pub fidelity_used: String,
    /// What `auto` chose for each body and pair, and why.
    pub chosen: Vec<String>,
    #[serde(flatten)]
    pub backend: BackendReport,
    pub method: String,
    pub integrator: String,
}

impl ChoicesReport {
    pub fn new(simulator: &Simulator) -> Self {
        let choices = simulator.choices();
        Self {
            fidelity: name(choices.water.fidelity),
            fidelity_used: name(simulator.fidelity()),
            chosen: simulator.reasons().to_vec(),
            backend: simulator.backend(),
            method: name(choices.water.method_used()),
            integrator: name(choices.integrator),
        }
    }
}
