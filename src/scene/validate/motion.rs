//! Given motions.

use super::finite;
use crate::scene::Motion;
use crate::{Error, Result};

/// Largest phase, rad: rounding is 10⁻⁷ there.
const MOST_PHASE: f64 = 1e9;

impl Motion {
    /// Refuses numbers that no motion can have; `place` says whose they are.
    pub(in crate::scene) fn check(&self, place: &str) -> Result<()> {
        let numbers: &[(&str, f64)] = match self {
            // Checked where it is made.
            Motion::Spline(_) => &[],
            &Motion::Linear { offset, rate } => &[("offset", offset), ("rate", rate)],
            &Motion::Sine {
                offset,
                amplitude,
                frequency,
                phase,
            } => &[
                ("offset", offset),
                ("amplitude", amplitude),
                ("frequency", frequency),
                ("phase", phase),
            ],
        };
        for (field, value) in numbers {
            let place = format!("{place}.{field}");
            finite(&place, &[*value])?;
            if *field == "phase" && value.abs() > MOST_PHASE {
                return Err(Error::input(
                    place,
                    value,
                    format!(
                        "give a phase within ±2π; past {MOST_PHASE:.0e} rad rounding moves the angle, and the rate isn't that of the value"
                    ),
                ));
            }
        }
        Ok(())
    }
}
