//! One way to simulate a scene.

use crate::dynamics::Integrator;
use crate::simulate::{Fidelity, Method, Settings};
use serde::Serialize;

/// What was varied to come to a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Nothing: what the others are varied around.
    Base,
    /// The method by which a body alone is solved.
    Method,
    /// Faces per body.
    Faces,
    /// Points per compressed body.
    Rank,
    /// The error aimed at.
    Accuracy,
    /// The residual of the coupled solve.
    Tolerance,
    /// The time integrator.
    Integrator,
    /// The time step.
    TimeStep,
    /// All at once.
    Product,
}

/// One way to simulate a scene. What makes no difference with its fidelity is `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Configuration {
    /// What was varied to come here.
    pub family: Family,
    /// The fidelity asked for.
    pub fidelity: Fidelity,
    /// The method by which a body alone is solved.
    pub method: Method,
    /// Faces per body of shapes by formula; `None`: the scene's own.
    pub faces_per_body: Option<usize>,
    /// Points asked for per compressed body.
    pub rank: Option<usize>,
    /// The error that the fidelity aims at.
    pub accuracy: Option<f64>,
    /// Relative residual at which the coupled solve stops.
    pub tolerance: Option<f64>,
    /// The time integrator.
    pub integrator: Integrator,
    /// Time step, s.
    pub time_step: f64,
}

/// The name of a choice, as in files and on the command line.
pub(super) fn name(choice: impl Serialize) -> String {
    match serde_json::to_value(choice) {
        Ok(serde_json::Value::String(name)) => name,
        _ => String::new(),
    }
}

/// A time step as people write it.
pub(super) fn seconds(x: f64) -> String {
    let digits = (2 - x.log10().floor() as i32).max(0) as usize;
    match (1e-3..1e5).contains(&x) {
        true if digits > 0 => {
            let text = format!("{x:.digits$}");
            text.trim_end_matches('0').trim_end_matches('.').into()
        }
        true => format!("{x:.0}"),
        false => format!("{x:.2e}"),
    }
}

impl Configuration {
    /// The settings of a simulator.
    pub fn settings(&self) -> Settings {
        let mut out = Settings::default()
            .fidelity(self.fidelity)
            .method(self.method)
            .integrator(self.integrator)
            .time_step(self.time_step);
        if let Some(faces) = self.faces_per_body {
            out = out.faces(faces);
        }
        if let Some(rank) = self.rank {
            out = out.rank(rank);
        }
        if let Some(accuracy) = self.accuracy {
            out = out.accuracy(accuracy);
        }
        if let Some(tolerance) = self.tolerance {
            out = out.tolerance(tolerance);
        }
        out
    }

    /// Whether both have the same M_f: only the way through time differs.
    pub(super) fn couples_like(&self, other: &Self) -> bool {
        let timeless = |c: &Self| Self {
            family: Family::Base,
            integrator: Integrator::default(),
            time_step: 0.0,
            ..*c
        };
        timeless(self) == timeless(other)
    }

    /// Whether both take time in the same steps.
    pub(super) fn steps_like(&self, other: &Self) -> bool {
        (self.integrator, self.time_step) == (other.integrator, other.time_step)
    }

    /// In words.
    pub fn label(&self) -> String {
        let mut out = format!("{} ({})", name(self.fidelity), name(self.method));
        if let Some(faces) = self.faces_per_body {
            out += &format!(", {faces} faces a body");
        }
        if let Some(rank) = self.rank {
            out += &format!(", rank {rank}");
        }
        if let Some(accuracy) = self.accuracy {
            out += &format!(", accuracy {accuracy:.0e}");
        }
        if let Some(tolerance) = self.tolerance {
            out += &format!(", tolerance {tolerance:.0e}");
        }
        out + &format!(", {}, {} s", name(self.integrator), seconds(self.time_step))
    }
}
