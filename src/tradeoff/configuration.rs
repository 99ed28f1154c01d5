//! One way to simulate a scene.

use crate::dynamics::Integrator;
use crate::simulate::{Fidelity, Method, Settings};
use serde::Serialize;

/// What was varied to come to a configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Nothing: what the others are varied around.
    #[default]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
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

/// A number with three digits.
pub(crate) fn three_digits(x: f64) -> String {
    match x {
        0.0 => "0".into(),
        x if (1e-3..1e5).contains(&x) => {
            let digits = (2 - x.log10().floor() as i32).max(0) as usize;
            format!("{x:.digits$}")
        }
        x => format!("{x:.2e}"),
    }
}

/// The same without zeros at its end: a time as people write it.
pub(crate) fn short(x: f64) -> String {
    let digits = three_digits(x);
    match digits.contains('.') && !digits.contains('e') {
        true => digits.trim_end_matches('0').trim_end_matches('.').into(),
        false => digits,
    }
}

impl Configuration {
    /// The settings of a simulator.
    pub fn settings(&self) -> Settings {
        Settings {
            fidelity: Some(self.fidelity),
            method: Some(self.method),
            integrator: Some(self.integrator),
            time_step: Some(self.time_step),
            faces: self.faces_per_body,
            rank: self.rank,
            accuracy: self.accuracy,
            tolerance: self.tolerance,
            ..Settings::default()
        }
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
        let mut out = format!("{} ({})", self.fidelity, self.method);
        let faces = self.faces_per_body.map(|n| format!(", {n} faces a body"));
        let rank = self.rank.map(|n| format!(", rank {n}"));
        let accuracy = self.accuracy.map(|x| format!(", accuracy {x:.0e}"));
        let tolerance = self.tolerance.map(|x| format!(", tolerance {x:.0e}"));
        out.extend([faces, rank, accuracy, tolerance].into_iter().flatten());
        let integrator: &str = self.integrator.into();
        out + &format!(", {integrator}, {} s", short(self.time_step))
    }
}
