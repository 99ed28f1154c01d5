//! What the command prints.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::configurations::{Configuration, Family};
use super::pareto::front;
use crate::cli::options::name;
use crate::cli::output::write_warnings;

/// What errors are measured against.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Reference {
    pub added_mass: Quantity,
    /// How far M_f of the reference for accelerations and end states is from that above.
    pub moving_differs_by: Option<f64>,
    /// Null where there is none.
    pub acceleration: Option<Quantity>,
    /// Null where there is none.
    pub end_state: Option<Quantity>,
    /// Time at which the end states are compared, s.
    pub horizon_seconds: f64,
    /// Wall time, s.
    pub seconds: f64,
    pub notes: Vec<String>,
}

/// One part of the reference.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Quantity {
    /// What it is.
    pub what: String,
    /// Estimate of its own relative error; null where nothing tells.
    pub error_estimate: Option<f64>,
}

/// Differences below this are rounding: no error is known better.
const ROUNDING: f64 = 1e-10;
/// A reference that is less sure than this is none.
const UNSURE: f64 = 0.1;
/// A multiple of its error by which a reference may differ from another.
const APART: f64 = 3.0;

impl Reference {
    /// Estimates no better than rounding, and a word about those that are bad.
    pub fn finish(&mut self) {
        let parts = [
            Some(&mut self.added_mass),
            self.acceleration.as_mut(),
            self.end_state.as_mut(),
        ];
        let mut unsure = false;
        for quantity in parts.into_iter().flatten() {
            quantity.error_estimate = quantity.error_estimate.map(|e| e.max(ROUNDING));
            unsure |= quantity.error_estimate.is_some_and(|e| e > UNSURE);
        }
        if unsure {
            let note = "the reference itself is uncertain: give a larger budget, or more faces \
                        (--reference-faces)";
            self.notes.push(note.into());
        }
        let estimate = self.added_mass.error_estimate.unwrap_or(0.0);
        if let Some(by) = self.moving_differs_by.filter(|by| *by > APART * estimate) {
            self.notes.push(format!(
                "the two references for M_f differ by {by:.1e}, more than the first's own error: trust \
                 errors of M_f, and those of accelerations and end states, to about that"
            ));
        }
    }
}

/// One configuration. Errors are relative; null where there is no number.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    /// What was varied to come here.
    pub family: Family,
    pub fidelity: String,
    /// What `auto` chose.
    pub fidelity_used: String,
    pub method: String,
    /// Of all bodies.
    pub faces: Option<usize>,
    /// Of the coupled system.
    pub unknowns: Option<usize>,
    /// Points asked for per compressed body.
    pub rank: Option<usize>,
    /// Points of all compressed bodies.
    pub points: Option<usize>,
    /// Error that the fidelity aimed at.
    pub accuracy: Option<f64>,
    /// Residual at which the coupled solve stopped.
    pub tolerance: Option<f64>,
    pub integrator: String,
    /// s
    pub time_step: f64,
    /// Wall time of a step.
    pub ms_per_step: Option<f64>,
    /// Wall time of a step and its part of the gradient.
    pub ms_per_gradient_step: Option<f64>,
    pub ms_per_simulated_second: Option<f64>,
    pub added_mass_rel_error: Option<f64>,
    pub acceleration_rel_error: Option<f64>,
    pub end_state_rel_error: Option<f64>,
    /// Wall time of what is made once per scene, s.
    pub setup_seconds: Option<f64>,
    /// Steps and repetitions of the timed rollouts.
    pub timed_steps: Option<usize>,
    pub timed_repetitions: Option<usize>,
    /// Whether the error of M_f is below the reference's own: the true one is anywhere up to that.
    pub below_reference: bool,
    pub acceleration_below_reference: bool,
    pub end_state_below_reference: bool,
    /// See [`Report::fronts`].
    pub pareto: bool,
    pub pareto_end_state: bool,
    /// What is missing though nothing failed, and why.
    pub note: Option<String>,
    /// What failed.
    pub error: Option<String>,
    /// What it is measured with.
    #[serde(skip)]
    pub configuration: Configuration,
}

/// The whole comparison.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    pub scene: String,
    pub reference: Reference,
    pub rows: Vec<Row>,
    /// What `pareto` and `pareto_end_state` mean.
    pub fronts: Fronts,
    /// Configurations that the budget had no time for.
    pub left_out: Vec<String>,
    /// s
    pub budget: f64,
    /// Wall time of everything, s.
    pub seconds: f64,
    /// Threads that a step may use.
    pub threads: usize,
    pub warnings: Vec<String>,
    /// What was written.
    pub files: Vec<PathBuf>,
}

/// How rows are marked.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Fronts {
    pub pareto: &'static str,
    pub pareto_end_state: &'static str,
}

pub(super) const FRONTS: Fronts = Fronts {
    pareto: "no other row that steps through time as the first one does (integrator, time_step) is \
             at most as slow (ms_per_step) and at most as wrong (added_mass_rel_error), and better \
             in one; errors below the reference's own count as that",
    pareto_end_state: "the same of all rows with ms_per_simulated_second and end_state_rel_error",
};

impl Row {
    /// Nothing is known yet.
    pub fn new(configuration: &Configuration) -> Self {
        let settings = &configuration.settings;
        Self {
            family: configuration.family,
            fidelity: name(settings.fidelity),
            fidelity_used: name(settings.fidelity),
            method: settings.method_name().into(),
            faces: None,
            unknowns: None,
            rank: configuration.rank(),
            points: None,
            accuracy: configuration.accuracy(),
            tolerance: configuration.tolerance(),
            integrator: name(settings.integrator),
            time_step: configuration.time_step(),
            ms_per_step: None,
            ms_per_gradient_step: None,
            ms_per_simulated_second: None,
            added_mass_rel_error: None,
            acceleration_rel_error: None,
            end_state_rel_error: None,
            setup_seconds: None,
            timed_steps: None,
            timed_repetitions: None,
            below_reference: false,
            acceleration_below_reference: false,
            end_state_below_reference: false,
            pareto: false,
            pareto_end_state: false,
            note: None,
            error: None,
            configuration: *configuration,
        }
    }

    /// Adds a note.
    pub fn say(&mut self, what: impl Into<String>) {
        let what = what.into();
        self.note = Some(match self.note.take() {
            Some(before) => format!("{before}; {what}"),
            None => what,
        });
    }

    /// Time and error for the first front: ms a step, error of M_f.
    pub fn by_added_mass(&self, reference: &Reference) -> Option<(f64, f64)> {
        let floor = reference.added_mass.error_estimate.unwrap_or(0.0);
        Some((self.ms_per_step?, self.added_mass_rel_error?.max(floor)))
    }

    /// Time and error for the second front: ms a simulated second, error of the end state.
    pub fn by_end_state(&self, reference: &Reference) -> Option<(f64, f64)> {
        let floor = reference.end_state.as_ref()?.error_estimate.unwrap_or(0.0);
        Some((
            self.ms_per_simulated_second?,
            self.end_state_rel_error?.max(floor),
        ))
    }
}

/// Fills in what follows from the measured numbers.
pub(super) fn conclude(rows: &mut [Row], reference: &Reference) {
    let below = |error: Option<f64>, quantity: Option<&Quantity>| {
        let estimate = quantity.and_then(|q| q.error_estimate);
        error
            .zip(estimate)
            .is_some_and(|(error, estimate)| error < estimate)
    };
    for row in rows.iter_mut() {
        row.ms_per_simulated_second = row.ms_per_step.map(|ms| ms / row.time_step);
        row.below_reference = below(row.added_mass_rel_error, Some(&reference.added_mass));
        row.acceleration_below_reference =
            below(row.acceleration_rel_error, reference.acceleration.as_ref());
        row.end_state_below_reference =
            below(row.end_state_rel_error, reference.end_state.as_ref());
    }
    let Some(first) = rows.first().map(|r| r.configuration) else {
        return;
    };
    let alike = |r: &Row| r.configuration.steps_like(&first);
    let by_added_mass = |r: &Row| r.by_added_mass(reference).filter(|_| alike(r));
    let marked = front(&rows.iter().map(by_added_mass).collect::<Vec<_>>());
    let ends = front(
        &rows
            .iter()
            .map(|r| r.by_end_state(reference))
            .collect::<Vec<_>>(),
    );
    for ((row, marked), end) in rows.iter_mut().zip(marked).zip(ends) {
        (row.pareto, row.pareto_end_state) = (marked, end);
    }
}

/// Three digits, or a dash.
fn number(x: Option<f64>) -> String {
    match x {
        None => "-".into(),
        Some(0.0) => "0".into(),
        Some(x) if (1e-3..1e5).contains(&x) => {
            let digits = (2 - x.log10().floor() as i32).max(0) as usize;
            format!("{x:.digits$}")
        }
        Some(x) => format!("{x:.2e}"),
    }
}

/// The same without zeros at its end.
pub(super) fn short(x: f64) -> String {
    let digits = number(Some(x));
    match digits.contains('.') && !digits.contains('e') {
        true => digits.trim_end_matches('0').trim_end_matches('.').into(),
        false => digits,
    }
}

fn error(x: Option<f64>, below: bool, quantity: Option<&Quantity>) -> String {
    match quantity.and_then(|q| q.error_estimate).filter(|_| below) {
        Some(estimate) => format!("≤ {estimate:.1e}"),
        None => x.map_or_else(|| "-".into(), |x| format!("{x:.2e}")),
    }
}

impl Row {
    /// What the fidelity's own accuracy is set by.
    fn knob(&self) -> String {
        match (self.rank, self.accuracy, self.tolerance) {
            (Some(rank), ..) => format!("rank {rank}"),
            (_, Some(accuracy), _) => format!("accuracy {accuracy:.0e}"),
            (.., Some(tolerance)) => format!("tolerance {tolerance:.0e}"),
            _ => "-".into(),
        }
    }

    fn cells(&self, reference: &Reference) -> [String; 15] {
        let count = |n: Option<usize>| n.map_or_else(|| "-".into(), |n| n.to_string());
        let mark = |on: bool, mark: &str| if on { mark.to_string() } else { String::new() };
        [
            mark(self.pareto, "*") + &mark(self.pareto_end_state, "+"),
            self.fidelity.clone(),
            self.method.clone(),
            count(self.faces),
            count(self.unknowns),
            count(self.points),
            self.knob(),
            self.integrator.clone(),
            short(self.time_step),
            number(self.ms_per_step),
            number(self.ms_per_gradient_step),
            error(
                self.added_mass_rel_error,
                self.below_reference,
                Some(&reference.added_mass),
            ),
            error(
                self.acceleration_rel_error,
                self.acceleration_below_reference,
                reference.acceleration.as_ref(),
            ),
            error(
                self.end_state_rel_error,
                self.end_state_below_reference,
                reference.end_state.as_ref(),
            ),
            number(self.setup_seconds),
        ]
    }
}

/// Configurations left out that people are told by name.
const LISTED: usize = 12;

const HEAD: [&str; 15] = [
    "",
    "fidelity",
    "method",
    "faces",
    "unknowns",
    "points",
    "set by",
    "integrator",
    "dt, s",
    "ms/step",
    "ms/gradient",
    "M_f",
    "acceleration",
    "end state",
    "setup, s",
];

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.error_estimate {
            Some(estimate) => write!(f, "±{estimate:.1e}: {}", self.what),
            None => write!(f, "error unknown: {}", self.what),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reference = &self.reference;
        writeln!(
            f,
            "{}: time against error, one configuration after another, {} threads; relative errors against",
            self.scene, self.threads
        )?;
        writeln!(f, "  M_f           {}", reference.added_mass)?;
        if let Some(acceleration) = &reference.acceleration {
            writeln!(f, "  acceleration  {acceleration}")?;
        }
        if let Some(end_state) = &reference.end_state {
            writeln!(
                f,
                "  end state     after {} s; {end_state}",
                short(reference.horizon_seconds)
            )?;
        }
        if let Some(difference) = reference.moving_differs_by {
            writeln!(
                f,
                "  M_f of the last two differs from the first by {difference:.1e}"
            )?;
        }
        for note in &reference.notes {
            writeln!(f, "  {note}")?;
        }
        writeln!(f)?;
        let rows: Vec<_> = self.rows.iter().map(|r| r.cells(reference)).collect();
        let width = |k: usize| {
            let cells = rows.iter().map(|r| r[k].chars().count());
            cells.fold(HEAD[k].chars().count(), usize::max)
        };
        let widths: [usize; 15] = std::array::from_fn(width);
        let mut line = |cells: [&str; 15], end: &str| {
            for (k, (cell, width)) in cells.iter().zip(widths).enumerate() {
                // Words to the left, numbers to the right.
                match k {
                    0..=2 | 6 | 7 => write!(f, "{cell:<width$}  ")?,
                    _ => write!(f, "{cell:>width$}  ")?,
                }
            }
            writeln!(f, "{end}")
        };
        line(HEAD, "")?;
        for (row, cells) in self.rows.iter().zip(&rows) {
            let said = [&row.error, &row.note].map(|s| s.as_deref());
            let said: Vec<&str> = said.into_iter().flatten().collect();
            line(cells.each_ref().map(String::as_str), &said.join("; "))?;
        }
        writeln!(
            f,
            "\n* Pareto front: no other row with this integrator and time step is as fast a step and as near in M_f"
        )?;
        write!(
            f,
            "+ Pareto front: no other row simulates a second as fast and ends as near; gradients include their \
             forward pass"
        )?;
        if !self.left_out.is_empty() {
            write!(f, "\nleft out for the budget of {} s:", self.budget)?;
            let listed = self.left_out.iter().take(LISTED);
            listed
                .into_iter()
                .try_for_each(|label| write!(f, "\n  {label}"))?;
            if let Some(more @ 1..) = self.left_out.len().checked_sub(LISTED) {
                write!(f, "\n  and {more} more (all with --json)")?;
            }
        }
        for file in &self.files {
            write!(f, "\nwrote {}", file.display())?;
        }
        write_warnings(f, &self.warnings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::Integrator;
    use crate::simulate::Settings;

    fn row(ms: Option<f64>, error: Option<f64>, integrator: Integrator) -> Row {
        let settings = Settings::default().time_step(0.01).integrator(integrator);
        let family = Family::Base;
        Row {
            ms_per_step: ms,
            added_mass_rel_error: error,
            end_state_rel_error: error,
            ..Row::new(&Configuration { family, settings })
        }
    }

    fn reference(estimate: Option<f64>) -> Reference {
        let quantity = Quantity {
            what: "made up".into(),
            error_estimate: estimate,
        };
        Reference {
            added_mass: quantity.clone(),
            moving_differs_by: None,
            acceleration: Some(quantity.clone()),
            end_state: Some(quantity),
            horizon_seconds: 1.0,
            seconds: 0.0,
            notes: Vec::new(),
        }
    }

    #[test]
    fn rows_are_marked() {
        let (rk2, rk4) = (Integrator::Rk2, Integrator::Rk4);
        let mut rows = [
            row(Some(1.0), Some(0.1), rk2),
            row(Some(2.0), Some(1e-3), rk2),
            row(Some(3.0), Some(1e-5), rk2),
            row(Some(4.0), Some(0.05), rk2),
            row(Some(0.5), Some(1e-9), rk4),
            row(None, Some(1e-9), rk2),
            row(Some(0.1), None, rk2),
        ];
        conclude(&mut rows, &reference(None));
        let marks = |rows: &[Row]| rows.iter().map(|r| r.pareto).collect::<Vec<_>>();
        assert_eq!(marks(&rows), [true, true, true, false, false, false, false]);
        // The other integrator is better in both on the second front.
        let ends: Vec<bool> = rows.iter().map(|r| r.pareto_end_state).collect();
        assert_eq!(ends, [false, false, false, false, true, false, false]);
        assert_eq!(rows[0].ms_per_simulated_second, Some(100.0));
        assert!(rows.iter().all(|r| !r.below_reference));

        // Below the reference's own error nothing is better than another but by time.
        conclude(&mut rows, &reference(Some(2e-3)));
        assert_eq!(
            marks(&rows),
            [true, true, false, false, false, false, false]
        );
        let below: Vec<bool> = rows.iter().map(|r| r.below_reference).collect();
        assert_eq!(below, [false, true, true, false, true, true, false]);
    }

    #[test]
    fn numbers_for_people() {
        for (x, text) in [
            (None, "-"),
            (Some(0.0), "0"),
            (Some(0.001234), "0.00123"),
            (Some(12.345), "12.3"),
            (Some(12345.6), "12346"),
            (Some(1e-7), "1.00e-7"),
        ] {
            assert_eq!(number(x), text);
        }
        for (x, text) in [
            (0.01, "0.01"),
            (6.2831853e-3, "0.00628"),
            (1e-4, "1.00e-4"),
            (20.0, "20"),
        ] {
            assert_eq!(short(x), text);
        }
        let reference = reference(Some(1e-4));
        let of = |x, below| error(Some(x), below, Some(&reference.added_mass));
        assert_eq!(of(2e-5, true), "≤ 1.0e-4");
        assert_eq!(of(2e-3, false), "2.00e-3");
    }
}
