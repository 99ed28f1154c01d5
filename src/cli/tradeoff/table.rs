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

fn count(n: Option<usize>) -> String {
    n.map_or_else(|| "-".into(), |n| n.to_string())
}

fn mark(row: &TradeoffRow) -> String {
    let marks = [(row.pareto, "*"), (row.pareto_end_state, "+")];
    let marks = marks.iter().filter(|(on, _)| *on);
    marks.map(|(_, mark)| *mark).collect()
}

/// What stands over a column, and in it.
type Column = (&'static str, fn(&TradeoffRow, &TradeoffReference) -> String);

const COLUMNS: [Column; 15] = [
    ("", |r, _| mark(r)),
    ("fidelity", |r, _| r.configuration.fidelity.to_string()),
    ("method", |r, _| r.configuration.method.to_string()),
    ("faces", |r, _| count(r.faces)),
    ("unknowns", |r, _| count(r.unknowns)),
    ("points", |r, _| count(r.points)),
    ("set by", |r, _| aim(r)),
    ("integrator", |r, _| {
        <&str>::from(r.configuration.integrator).into()
    }),
    ("dt, s", |r, _| short(r.configuration.time_step)),
    ("ms/step", |r, _| number(r.ms_per_step)),
    ("ms/gradient", |r, _| number(r.ms_per_gradient_step)),
    ("M_f", |r, of| {
        let below = r.below_reference;
        error(r.added_mass_rel_error, below, Some(&of.added_mass))
    }),
    ("acceleration", |r, of| {
        let below = r.acceleration_below_reference;
        error(r.acceleration_rel_error, below, of.acceleration.as_ref())
    }),
    ("end state", |r, of| {
        let below = r.end_state_below_reference;
        error(r.end_state_rel_error, below, of.end_state.as_ref())
    }),
    ("setup, s", |r, _| number(r.setup_seconds)),
];

/// Configurations left out that people are told by name.
const LISTED: usize = 12;

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
        let cells = |r| COLUMNS.map(|(_, cell)| cell(r, reference));
        let rows: Vec<_> = found.rows.iter().map(cells).collect();
        let head = COLUMNS.map(|(head, _)| head.to_string());
        let widths: [usize; 15] = std::array::from_fn(|k| {
            let cells = rows.iter().chain([&head]).map(|r| r[k].chars().count());
            cells.fold(0, usize::max)
        });
        let mut line = |cells: &[String; 15], end: &str| {
            for (k, (cell, width)) in cells.iter().zip(widths).enumerate() {
                // Words to the left, numbers to the right.
                match k {
                    0..=2 | 6 | 7 => write!(f, "{cell:<width$}  ")?,
                    _ => write!(f, "{cell:>width$}  ")?,
                }
            }
            writeln!(f, "{end}")
        };
        line(&head, "")?;
        for (row, cells) in found.rows.iter().zip(&rows) {
            let said = [&row.error, &row.note].map(|s| s.as_deref());
            let said: Vec<&str> = said.into_iter().flatten().collect();
            line(cells, &said.join("; "))?;
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
