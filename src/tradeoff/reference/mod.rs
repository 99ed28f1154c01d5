//! What errors are measured against, and how far that is to be trusted itself.
//!
//! M_f comes from coupled panels ([`panels`]), accelerations and trajectories from compressed bodies
//! ([`moving`]), for panels have no derivatives.

mod moving;
mod panels;

use super::compare::{Excursion, end_error, matrix_error, norm, significant, vector_error};
use super::progress::Watch;
use super::row::{ReferenceQuantity, TradeoffReference};
use super::start::{Path, Start, free, isolated};
use crate::adjoint::sample;
use crate::scene::Scene;
use crate::{Error, Result};
use moving::Simulations;
use nalgebra::{DMatrix, DVector};
use panels::Panels;
use std::time::{Duration, Instant};

/// An acceleration with a larger error estimate says nothing.
const VAGUE: f64 = 0.3;
/// Nor does one that changes the velocity over the horizon by less than this part.
const NEGLIGIBLE: f64 = 1e-9;

/// How long the reference may take, and what is asked of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// s
    pub seconds: f64,
    /// Finest faces per body; then time doesn't limit resolutions and accuracies.
    pub faces: Option<usize>,
    /// Steps of the scene's own length over which trajectories are compared.
    pub steps: usize,
}

/// So much later than now nothing ends for want of time.
const NEVER: Duration = Duration::from_secs(1 << 30);

impl Limits {
    /// When what may take a time from now must end: never where it is to be of given faces.
    fn until(&self, time: Duration) -> Instant {
        Instant::now() + if self.faces.is_some() { NEVER } else { time }
    }
}

/// Runs levels one after another while the next, expected to take `growth` times as long, ends in time;
/// at least `least` of them. An error ends the climb, and counts if nothing was found before.
fn climb<L, T>(
    levels: impl IntoIterator<Item = L>,
    least: usize,
    growth: f64,
    until: Instant,
    mut run: impl FnMut(L) -> Result<T>,
) -> Result<Vec<T>> {
    let mut out = Vec::new();
    let mut last = 0.0;
    for level in levels {
        let now = Instant::now();
        let left = until.saturating_duration_since(now).as_secs_f64();
        if out.len() >= least && growth * last > left {
            break;
        }
        match run(level) {
            Ok(found) => out.push(found),
            Err(error) if out.is_empty() => return Err(error),
            Err(_) => break,
        }
        last = now.elapsed().as_secs_f64();
    }
    Ok(out)
}

/// The reference of a scene.
pub(super) struct Reference {
    added_mass: DMatrix<f64>,
    /// Rows of it that mean something.
    significant: Vec<usize>,
    motion: Option<Motion>,
    /// For users.
    pub description: TradeoffReference,
}

/// Acceleration and trajectory.
struct Motion {
    mass: DMatrix<f64>,
    path: Path,
    /// Force beside the scene's own for which the accelerations are compared.
    extra: DVector<f64>,
    acceleration: DVector<f64>,
    excursion: Excursion,
}

impl Reference {
    /// Computes it.
    ///
    /// # Errors
    /// A scene without water or where nothing can move, what no method can solve, and the end that was asked for.
    pub fn new(scene: &Scene, limits: Limits, watch: &mut Watch) -> Result<Self> {
        let begin = Instant::now();
        let half = Duration::from_secs_f64(limits.seconds / 2.0);
        let panels = Panels::new(scene, &limits, limits.until(half), watch);
        watch.check()?;
        let simulations = Simulations::new(scene, &limits, limits.until(half), watch);
        watch.check()?;
        let mut notes = Vec::new();
        let (panels, simulations) = match (panels, simulations) {
            (Err(error), Err(_)) => return Err(error),
            (panels, simulations) => (
                noted(panels, "coupled panels", &mut notes),
                noted(simulations, "compressed bodies", &mut notes),
            ),
        };
        let moving = simulations.as_ref().map(|s| &s.best.start);
        let best = panels.as_ref().map(|p| &p.best).or(moving);
        let none = || Error::input("reference", "none", "panels or compressed bodies");
        let best = best.cloned().ok_or_else(none)?;
        let significant = significant(&best.added_mass, &best.mass);
        let difference =
            |a: &Start, b: &Start| matrix_error(&a.added_mass, &b.added_mass, &significant);
        let (free, left_out) = (best.mass.nrows(), best.mass.nrows() - significant.len());
        if left_out > 0 {
            notes.push(format!(
                "{left_out} of {free} coordinates move next to no water (a round body's spin): M_f is \
                 compared without them"
            ));
        }
        let (what, error_estimate) = match (&panels, &simulations) {
            (Some(p), _) => (p.description.clone(), p.estimate(&significant)),
            (None, Some(s)) => {
                let estimate = s.estimate(|a, b| difference(&a.start, &b.start));
                (s.description.clone(), estimate)
            }
            (None, None) => (String::new(), None),
        };
        let moving_differs_by = moving
            .filter(|_| panels.is_some())
            .and_then(|s| difference(s, &best));
        let mut out = Self {
            description: TradeoffReference {
                added_mass: ReferenceQuantity {
                    what,
                    error_estimate,
                },
                moving_differs_by,
                acceleration: None,
                end_state: None,
                horizon_seconds: limits.steps as f64 * scene.time_step,
                seconds: 0.0,
                notes,
            },
            added_mass: best.added_mass,
            significant,
            motion: None,
        };
        if let Some(simulations) = simulations {
            out.set_motion(scene, simulations)?;
        }
        out.description.finish();
        out.description.seconds = begin.elapsed().as_secs_f64();
        Ok(out)
    }

    fn set_motion(&mut self, scene: &Scene, simulations: Simulations) -> Result<()> {
        let simulator = isolated(scene)?;
        let start = &simulations.best.start;
        let free = free(&simulator)?;
        let excursion = Excursion::new(&simulator, &free, &simulations.best.path);
        let mass = start.mass.clone();
        // Whether the scene's own forces accelerate anything at the start.
        let rate = norm(&simulator.start().1.select_rows(&free), &mass) / self.horizon();
        let gravity = scene.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        let least = NEGLIGIBLE * (rate + gravity * mass.diagonal().sum().sqrt());
        let none = DVector::zeros(free.len());
        let estimate = |extra: &DVector<f64>| {
            simulations.estimate(|a, b| {
                let (a, b) = (a.start.acceleration(extra)?, b.start.acceleration(extra)?);
                vector_error(&a, &b, &mass)
            })
        };
        let size = start.acceleration(&none).map_or(0.0, |a| norm(&a, &mass));
        let own = size > least && estimate(&none).is_none_or(|e| e < VAGUE);
        let (extra, how) = if own {
            (none, "under the scene's own forces")
        } else {
            let size = if rate > 0.0 { rate } else { 1.0 };
            let how = "under a pseudo-random force, as next to nothing accelerates the bodies then";
            (pseudo_random_force(&mass) * size, how)
        };
        let Some(acceleration) = start.acceleration(&extra) else {
            return Err(Error::Unresolved {
                place: "mass matrix of the reference".into(),
                quantity: "smallest eigenvalue".into(),
                value: mass.symmetric_eigenvalues().min(),
                limit: 0.0,
                remedy: "give massless bodies mass".into(),
            });
        };
        let by = &simulations.description;
        self.description.acceleration = Some(ReferenceQuantity {
            what: format!("{by}; at the start, {how}"),
            error_estimate: estimate(&extra),
        });
        if excursion.any() {
            let dt = super::configuration::short(simulations.best.path.time_step);
            let error = |a: &Path, b: &Path| end_error(a, b, &excursion);
            self.description.end_state = Some(ReferenceQuantity {
                what: format!("{by}; rk4 with steps of {dt} s"),
                error_estimate: simulations.estimate(|a, b| error(&a.path, &b.path)),
            });
        } else {
            let note = "nothing moves within the horizon: end states aren't compared";
            self.description.notes.push(note.into());
        }
        self.motion = Some(Motion {
            mass,
            path: simulations.best.path,
            extra,
            acceleration,
            excursion,
        });
        Ok(())
    }

    /// Time over which end states are compared, s.
    pub fn horizon(&self) -> f64 {
        self.description.horizon_seconds
    }

    /// Whether there is an end state to compare with.
    pub fn moves(&self) -> bool {
        self.description.end_state.is_some()
    }

    /// Error of M_f.
    pub fn added_mass_error(&self, start: &Start) -> Option<f64> {
        matrix_error(&start.added_mass, &self.added_mass, &self.significant)
    }

    /// Error of the acceleration at the start.
    pub fn acceleration_error(&self, start: &Start) -> Option<f64> {
        let motion = self.motion.as_ref()?;
        let found = start.acceleration(&motion.extra)?;
        vector_error(&found, &motion.acceleration, &motion.mass)
    }

    /// Error of a trajectory's end.
    pub fn end_error(&self, path: &Path) -> Option<f64> {
        let motion = self.motion.as_ref()?;
        end_error(path, &motion.path, &motion.excursion)
    }
}

fn noted<T>(found: Result<T>, what: &str, notes: &mut Vec<String>) -> Option<T> {
    found
        .map_err(|error| notes.push(format!("no reference from {what}: {error}")))
        .ok()
}

/// A reproducible force for every velocity, of unit length in the metric of the mass matrix's diagonal.
fn pseudo_random_force(mass: &DMatrix<f64>) -> DVector<f64> {
    let n = mass.nrows();
    let unit = DVector::from_vec(sample::numbers(1, n, 1.0)).normalize();
    DVector::from_fn(n, |i, _| unit[i] * mass[(i, i)].max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn climbs_stop_at_the_time_and_at_errors() {
        let now = Instant::now();
        let run = |n: usize| match n {
            3 => Err(Error::input("level", n, "less")),
            n => Ok(n),
        };
        assert_eq!(climb(0..3, 1, 0.0, now, run).unwrap(), [0, 1, 2]);
        assert_eq!(climb(0..3, 2, 1e12, now, run).unwrap(), [0, 1]);
        assert_eq!(climb(0..9, 9, 1.0, now, run).unwrap(), [0, 1, 2]);
        assert!(climb(3..9, 1, 1.0, now, run).is_err());
    }
}
