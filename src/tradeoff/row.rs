//! What the comparison gives.

use super::configuration::Configuration;
use crate::simulate::Fidelity;
use serde::Serialize;

/// What errors are measured against.
#[derive(Clone, Debug, Serialize)]
pub struct TradeoffReference {
    /// Of the water's part of the mass matrix at the start.
    pub added_mass: ReferenceQuantity,
    /// How far M_f of the reference for accelerations and end states is from that above.
    pub moving_differs_by: Option<f64>,
    /// Of the acceleration at the start; `None` where there is none.
    pub acceleration: Option<ReferenceQuantity>,
    /// Of coordinates and velocities at the end; `None` where there is none.
    pub end_state: Option<ReferenceQuantity>,
    /// Time at which the end states are compared, s.
    pub horizon_seconds: f64,
    /// Wall time, s.
    pub seconds: f64,
    /// What limits it.
    pub notes: Vec<String>,
}

/// One part of the reference.
#[derive(Clone, Debug, Serialize)]
pub struct ReferenceQuantity {
    /// What it is.
    pub what: String,
    /// Estimate of its own relative error; `None` where nothing tells.
    pub error_estimate: Option<f64>,
}

/// Differences below this are rounding: no error is known better.
const ROUNDING: f64 = 1e-10;
/// A reference that is less sure than this is none.
const UNSURE: f64 = 0.1;
/// A multiple of its error by which a reference may differ from another.
const APART: f64 = 3.0;

impl TradeoffReference {
    /// Estimates no better than rounding, and a note on those that are bad.
    pub(super) fn finish(&mut self) {
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

/// One configuration with its time and its errors. Errors are relative to the reference; `None` where there is no number.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TradeoffRow {
    /// What was simulated.
    #[serde(flatten)]
    pub configuration: Configuration,
    /// What the fidelity `Auto` chose; the fidelity itself otherwise.
    pub fidelity_used: Fidelity,
    /// Faces of all bodies.
    pub faces: Option<usize>,
    /// Unknowns of the coupled system.
    pub unknowns: Option<usize>,
    /// Points of all compressed bodies.
    pub points: Option<usize>,
    /// Wall time of a step.
    pub ms_per_step: Option<f64>,
    /// Wall time of a step and its part of the gradient.
    pub ms_per_gradient_step: Option<f64>,
    /// Wall time of a simulated second.
    pub ms_per_simulated_second: Option<f64>,
    /// max |ΔM_ij| / √(M_ii M_jj) at the start.
    pub added_mass_rel_error: Option<f64>,
    /// Of the acceleration at the start, in the metric of the mass matrix.
    pub acceleration_rel_error: Option<f64>,
    /// Of coordinates or velocities at the end, the larger, relative to how far they go.
    pub end_state_rel_error: Option<f64>,
    /// Wall time of what is made once per scene, s.
    pub setup_seconds: Option<f64>,
    /// Steps of the timed rollouts.
    pub timed_steps: Option<usize>,
    /// Their repetitions.
    pub timed_repetitions: Option<usize>,
    /// Whether the error of M_f is below the reference's own: the true one is anywhere up to that.
    pub below_reference: bool,
    /// The same of the acceleration.
    pub acceleration_below_reference: bool,
    /// The same of the end state.
    pub end_state_below_reference: bool,
    /// Whether no other row that steps through time as the first one does (integrator, time step) is at most as slow a
    /// step and at most as wrong in M_f, and better in one; errors below the reference's own count as that.
    pub pareto: bool,
    /// The same of all rows with the time of a simulated second and the error of the end state.
    pub pareto_end_state: bool,
    /// What is missing though nothing failed, and why.
    pub note: Option<String>,
    /// What failed.
    pub error: Option<String>,
}

impl TradeoffRow {
    /// Nothing is known yet.
    pub(super) fn new(configuration: Configuration) -> Self {
        Self {
            fidelity_used: configuration.fidelity,
            configuration,
            ..Self::default()
        }
    }

    /// Adds a note.
    pub(super) fn add_note(&mut self, what: impl Into<String>) {
        let what = what.into();
        self.note = Some(match self.note.take() {
            Some(before) => format!("{before}; {what}"),
            None => what,
        });
    }

    /// Whether this row steps through time as `other` does: the rows that [`TradeoffRow::pareto`] is about step as the
    /// first one.
    pub fn steps_like(&self, other: &Self) -> bool {
        self.configuration.steps_like(&other.configuration)
    }

    /// Time and error that [`TradeoffRow::pareto`] is about: ms a step, error of M_f, no less than the reference's own.
    pub fn by_added_mass(&self, reference: &TradeoffReference) -> Option<(f64, f64)> {
        let floor = reference.added_mass.error_estimate.unwrap_or(0.0);
        Some((self.ms_per_step?, self.added_mass_rel_error?.max(floor)))
    }

    /// Time and error that [`TradeoffRow::pareto_end_state`] is about: ms a simulated second, error of the end state, no
    /// less than the reference's own.
    pub fn by_end_state(&self, reference: &TradeoffReference) -> Option<(f64, f64)> {
        let floor = reference.end_state.as_ref()?.error_estimate.unwrap_or(0.0);
        let error = self.end_state_rel_error?.max(floor);
        Some((self.ms_per_simulated_second?, error))
    }
}

/// Fills in what follows from the measured numbers.
pub(super) fn conclude(rows: &mut [TradeoffRow], reference: &TradeoffReference) {
    let below = |error: Option<f64>, quantity: Option<&ReferenceQuantity>| {
        let pair = error.zip(quantity.and_then(|q| q.error_estimate));
        pair.is_some_and(|(error, estimate)| error < estimate)
    };
    for row in rows.iter_mut() {
        let time_step = row.configuration.time_step;
        row.ms_per_simulated_second = row.ms_per_step.map(|ms| ms / time_step);
        row.below_reference = below(row.added_mass_rel_error, Some(&reference.added_mass));
        row.acceleration_below_reference =
            below(row.acceleration_rel_error, reference.acceleration.as_ref());
        row.end_state_below_reference =
            below(row.end_state_rel_error, reference.end_state.as_ref());
    }
    let like = |r: &TradeoffRow| r.steps_like(&rows[0]);
    let added = rows.iter();
    let added = added.map(|r| r.by_added_mass(reference).filter(|_| like(r)));
    let marked = front(&added.collect::<Vec<_>>());
    let ends = rows.iter().map(|r| r.by_end_state(reference));
    let ends = front(&ends.collect::<Vec<_>>());
    for ((row, marked), end) in rows.iter_mut().zip(marked).zip(ends) {
        (row.pareto, row.pareto_end_state) = (marked, end);
    }
}

/// Marks the points (cost, error) that no other point beats: none is at most as expensive and at most as
/// wrong, and better in one of the two. Equal points don't beat each other. Points that are missing
/// or not finite beat nothing and are never marked.
fn front(points: &[Option<(f64, f64)>]) -> Vec<bool> {
    let known = |p: &Option<(f64, f64)>| p.filter(|(x, y)| x.is_finite() && y.is_finite());
    let beats = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
    let unbeaten = |p| !points.iter().filter_map(known).any(|other| beats(other, p));
    points
        .iter()
        .map(|p| known(p).is_some_and(unbeaten))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::Integrator;

    fn row(ms: Option<f64>, error: Option<f64>, integrator: Integrator) -> TradeoffRow {
        let configuration = Configuration {
            fidelity: Fidelity::Reduced,
            integrator,
            time_step: 0.01,
            ..Configuration::default()
        };
        TradeoffRow {
            ms_per_step: ms,
            added_mass_rel_error: error,
            end_state_rel_error: error,
            ..TradeoffRow::new(configuration)
        }
    }

    fn reference(estimate: Option<f64>) -> TradeoffReference {
        let quantity = ReferenceQuantity {
            what: "made up".into(),
            error_estimate: estimate,
        };
        TradeoffReference {
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
        let marks = |rows: &[TradeoffRow]| rows.iter().map(|r| r.pareto).collect::<Vec<_>>();
        assert_eq!(marks(&rows), [true, true, true, false, false, false, false]);
        // The other integrator is better in both on the second front.
        let ends: Vec<bool> = rows.iter().map(|r| r.pareto_end_state).collect();
        assert_eq!(ends, [false, false, false, false, true, false, false]);
        assert_eq!(rows[0].ms_per_simulated_second, Some(100.0));
        assert!(rows.iter().all(|r| !r.below_reference));

        // Below the reference's own error nothing is better than another but by time.
        conclude(&mut rows, &reference(Some(2e-3)));
        let two = [true, true, false, false, false, false, false];
        assert_eq!(marks(&rows), two);
        let below: Vec<bool> = rows.iter().map(|r| r.below_reference).collect();
        assert_eq!(below, [false, true, true, false, true, true, false]);
        conclude(&mut [], &reference(None));
    }

    #[test]
    fn only_unbeaten_points_are_marked() {
        let points = [(1.0, 1.0), (2.0, 0.5), (2.0, 0.6), (3.0, 0.5), (0.5, 3.0)];
        let marked = front(&points.map(Some));
        assert_eq!(marked, [true, true, false, false, true]);
        // Equal points are marked together, and zeros count.
        let points = [(1.0, 0.1), (1.0, 0.1), (2.0, 0.1), (1.0, 0.2)];
        assert_eq!(front(&points.map(Some)), [true, true, false, false]);
        let points = [(0.0, 1.0), (1.0, 0.0), (1.0, -0.0), (2.0, 0.0)];
        assert_eq!(front(&points.map(Some)), [true, true, true, false]);
    }

    #[test]
    fn what_is_not_a_number_neither_beats_nor_is_marked() {
        let points = [
            None,
            Some((f64::NAN, 0.0)),
            Some((0.0, f64::NAN)),
            Some((f64::NEG_INFINITY, 0.0)),
            Some((0.0, f64::INFINITY)),
            Some((1.0, 1.0)),
        ];
        assert_eq!(front(&points), [false, false, false, false, false, true]);
        assert_eq!(front(&[]), Vec::<bool>::new());
        assert_eq!(front(&[None, None]), [false, false]);
    }

    /// Against the definition in another form: sorted by cost, the least error so far sinks.
    #[test]
    fn fronts_agree_with_a_sweep() {
        // Few values, so that ties are common.
        let value = |i: usize| ((i * i * 7919 + i * 104_729) % 10_007 % 12) as f64;
        for set in 0..50 {
            let points: Vec<_> = (0..30)
                .map(|k| (value(60 * set + 2 * k), value(60 * set + 2 * k + 1)))
                .collect();
            let marked = front(&points.iter().copied().map(Some).collect::<Vec<_>>());
            let mut order: Vec<usize> = (0..points.len()).collect();
            order.sort_by(|a, b| points[*a].partial_cmp(&points[*b]).unwrap());
            let mut least = f64::INFINITY;
            let mut last = None;
            for i in order {
                let expected = points[i].1 < least || last == Some(points[i]);
                assert_eq!(marked[i], expected, "{points:?}");
                if points[i].1 < least {
                    least = points[i].1;
                    last = Some(points[i]);
                }
            }
        }
    }
}
