//! What the command prints.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use crate::cli::output::write_warnings;
use crate::tradeoff::{
    ReferenceQuantity, Tradeoff, TradeoffReference, TradeoffRow, short, three_digits,
};

/// The whole comparison, and what was written.
#[derive(Debug, Serialize)]
pub(super) struct TradeoffReport {
    #[serde(flatten)]
    found: Tradeoff,
    /// What `pareto` and `pareto_end_state` mean.
    fronts: Fronts,
    files: Vec<PathBuf>,
}

/// How rows are marked.
#[derive(Debug, Serialize)]
struct Fronts {
    pareto: &'static str,
    pareto_end_state: &'static str,
}

impl TradeoffReport {
    pub fn new(found: Tradeoff, files: Vec<PathBuf>) -> Self {
        let fronts = Fronts {
            pareto: "no other row that steps through time as the first one does (integrator, time_step) is \
                     at most as slow (ms_per_step) and at most as wrong (added_mass_rel_error), and better \
                     in one; errors below the reference's own count as that",
            pareto_end_state: "the same of all rows with ms_per_simulated_second and end_state_rel_error",
        };
        Self {
            found,
            fronts,
            files,
        }
    }
}

/// Three digits, or a dash.
fn number(x: Option<f64>) -> String {
    x.map_or_else(|| "-".into(), three_digits)
}

fn error(x: Option<f64>, below: bool, quantity: Option<&ReferenceQuantity>) -> String {
    match quantity.and_then(|q| q.error_estimate).filter(|_| below) {
        Some(estimate) => format!("≤ {estimate:.1e}"),
        None => x.map_or_else(|| "-".into(), |x| format!("{x:.2e}")),
    }
}

/// What the fidelity's own accuracy is set by.
fn aim(row: &TradeoffRow) -> String {
    let c = &row.configuration;
    match (c.rank, c.accuracy, c.tolerance) {
        (Some(rank), ..) => format!("rank {rank}"),
        (_, Some(accuracy), _) => format!("accuracy {accuracy:.0e}"),
        (.., Some(tolerance)) => format!("tolerance {tolerance:.0e}"),
        _ => "-".into(),
    }
}

fn cells(row: &TradeoffRow, reference: &TradeoffReference) -> [String; 15] {
    let count = |n: Option<usize>| n.map_or_else(|| "-".into(), |n| n.to_string());
    let mark = |on: bool, mark: &str| if on { mark.to_string() } else { String::new() };
    let c = &row.configuration;
    [
        mark(row.pareto, "*") + &mark(row.pareto_end_state, "+"),
        c.fidelity.to_string(),
        c.method.to_string(),
        count(row.faces),
        count(row.unknowns),
        count(row.points),
        aim(row),
        <&str>::from(c.integrator).into(),
        short(c.time_step),
        number(row.ms_per_step),
        number(row.ms_per_gradient_step),
        error(
            row.added_mass_rel_error,
            row.below_reference,
            Some(&reference.added_mass),
        ),
        error(
            row.acceleration_rel_error,
            row.acceleration_below_reference,
            reference.acceleration.as_ref(),
        ),
        error(
            row.end_state_rel_error,
            row.end_state_below_reference,
            reference.end_state.as_ref(),
        ),
        number(row.setup_seconds),
    ]
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

fn quantity(quantity: &ReferenceQuantity) -> String {
    match quantity.error_estimate {
        Some(estimate) => format!("±{estimate:.1e}: {}", quantity.what),
        None => format!("error unknown: {}", quantity.what),
    }
}

impl fmt::Display for TradeoffReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = &self.found;
        let reference = &found.reference;
        writeln!(
            f,
            "{}: time against error, one configuration after another, {} threads; relative errors against",
            found.scene, found.threads
        )?;
        writeln!(f, "  M_f           {}", quantity(&reference.added_mass))?;
        if let Some(acceleration) = &reference.acceleration {
            writeln!(f, "  acceleration  {}", quantity(acceleration))?;
        }
        if let Some(end_state) = &reference.end_state {
            writeln!(
                f,
                "  end state     after {} s; {}",
                short(reference.horizon_seconds),
                quantity(end_state)
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
        let rows: Vec<_> = found.rows.iter().map(|r| cells(r, reference)).collect();
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
        for (row, cells) in found.rows.iter().zip(&rows) {
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
        if !found.left_out.is_empty() {
            write!(f, "\nleft out for the budget of {} s:", found.budget)?;
            let mut listed = found.left_out.iter().take(LISTED);
            listed.try_for_each(|label| write!(f, "\n  {label}"))?;
            if let Some(more @ 1..) = found.left_out.len().checked_sub(LISTED) {
                write!(f, "\n  and {more} more (all with --json)")?;
            }
        }
        for file in &self.files {
            write!(f, "\nwrote {}", file.display())?;
        }
        write_warnings(f, &found.warnings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let reference = ReferenceQuantity {
            what: "made up".into(),
            error_estimate: Some(1e-4),
        };
        let of = |x, below| error(Some(x), below, Some(&reference));
        assert_eq!(of(2e-5, true), "≤ 1.0e-4");
        assert_eq!(of(2e-3, false), "2.00e-3");
    }
}
