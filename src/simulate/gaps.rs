//! How a trajectory's gaps are reported.

use super::{Carried, Change, GapReport, NearGap, Rollout};
use crate::geometry::{Gap, Other};
use std::collections::BTreeSet;

/// Most changes that are kept with their times.
const MOST: usize = 20;

impl Rollout {
    /// The smallest gap and by what the water across it is carried, with estimates of its error, that with the largest error, and when films came and
    /// went. Without estimates with the fidelity `isolated`, by fundamental solutions, and where there is no water. Nothing is solved for it; gaps are
    /// looked through at the first call.
    pub fn gap_report(&self) -> GapReport {
        if self.report.get().is_none() {
            // Another thread's is the same.
            let _ = self.report.set(self.made_report());
        }
        self.report.get().cloned().unwrap_or_default()
    }

    fn made_report(&self) -> GapReport {
        let simulator = &self.simulator;
        let near = |n: usize| {
            let (sample, gap) = (&self.samples()[n], self.gaps()[n]?);
            let error = simulator.gap_error(&gap, &sample.poses)?;
            Some(NearGap {
                time: sample.time,
                gap: gap.distance,
                bodies: self.between((gap.first, gap.second)),
                carried: error.carried,
                added_mass_error: error.added_mass,
                force_error: error.force,
            })
        };
        let all = (0..self.states().len()).filter_map(near);
        let worst = all.max_by(|a, b| a.force_error.total_cmp(&b.force_error));
        let mut out = GapReport {
            nearest: self.nearest().and_then(|(n, _)| near(n)),
            worst,
            ..GapReport::default()
        };
        self.changes(&mut out);
        out
    }

    /// When films come and go.
    fn changes(&self, out: &mut GapReport) {
        let widest = self.simulator.widest_film();
        let without = self.simulator.carried_without_films();
        let mut before = Vec::new();
        let mut known = BTreeSet::new();
        for (sample, gap) in self.samples().iter().zip(self.gaps()) {
            let narrow = |gap: &Gap| gap.distance < widest;
            let now = match gap.as_ref().is_some_and(narrow) {
                true => self.simulator.films(&sample.poses),
                false => Vec::new(),
            };
            let there: BTreeSet<_> = now.iter().copied().collect();
            let come = now.iter().filter(|p| !known.contains(*p));
            let gone = before.iter().filter(|p| !there.contains(*p));
            let come = come.map(|pair| (pair, Carried::Film));
            for (pair, carried) in come.chain(gone.map(|pair| (pair, without))) {
                out.changes += 1;
                if out.first_changes.len() < MOST {
                    out.first_changes.push(Change {
                        time: sample.time,
                        bodies: self.between(*pair),
                        carried,
                    });
                }
            }
            (before, known) = (now, there);
        }
    }

    fn between(&self, (first, second): (usize, Other)) -> (String, Option<String>) {
        let name = |b: usize| self.simulator.system().bodies[b].name.clone();
        let other = match second {
            Other::Body(b) => Some(name(b)),
            Other::Wall(_) => None,
        };
        (name(first), other)
    }
}
