//! What errors are measured against, and how far that is to be trusted itself.
//!
//! M_f comes from coupled panels ([`panels`]), accelerations and trajectories from compressed bodies
//! ([`moving`]), for panels have no derivatives.

mod moving;
mod panels;

use std::time::{Duration, Instant};

use nalgebra::{DMatrix, DVector};

use super::compare::{Excursion, Weights, end_error, felt, matrix_error, norm, vector_error};
use super::measure::{Path, Start, free};
use super::report;
use crate::adjoint::sample;
use crate::scene::{Scene, Shape};
use crate::simulate::{Fidelity, Settings, Simulator};
use crate::{Error, Result};
use moving::Probes;
use panels::Panels;

/// An acceleration with a larger error estimate says nothing.
const VAGUE: f64 = 0.3;
/// Nor does one that changes the velocity over the horizon by less than this part.
const NEGLIGIBLE: f64 = 1e-9;

/// How long the reference may take, and what is asked of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// s
    pub seconds: f64,
    /// Finest faces per body; then time doesn't limit the resolutions.
    pub faces: Option<usize>,
    /// Steps of the scene's own length over which trajectories are compared.
    pub steps: usize,
}

/// The reference of a scene.
pub(super) struct Reference {
    added_mass: DMatrix<f64>,
    /// Rows of it that mean something.
    felt: Vec<usize>,
    motion: Option<Motion>,
    horizon: f64,
    /// For the report.
    pub said: report::Reference,
}

/// Acceleration and trajectory.
struct Motion {
    mass: DMatrix<f64>,
    path: Path,
    /// Force beside the scene's own for which the accelerations are compared.
    extra: DVector<f64>,
    acceleration: DVector<f64>,
    weights: Weights,
    excursion: Excursion,
}

impl Reference {
    /// Computes it; `tick` hears of each part that is done.
    ///
    /// # Errors
    /// A scene without water or where nothing can move, and what no method can solve.
    pub fn new(scene: &Scene, limits: Limits, tick: &mut dyn FnMut()) -> Result<Self> {
        let begin = Instant::now();
        check(scene)?;
        let half = Duration::from_secs_f64(limits.seconds / 2.0);
        let panels = Panels::new(scene, &limits, begin + half, tick);
        let probes = Probes::new(scene, &limits, half, tick);
        let mut notes = Vec::new();
        let (panels, probes) = match (panels, probes) {
            (Err(error), Err(_)) => return Err(error),
            (panels, probes) => (
                noted(panels, "coupled panels", &mut notes),
                noted(probes, "compressed bodies", &mut notes),
            ),
        };
        let starts = [
            panels.as_ref().map(|p| p.best.clone()),
            probes.as_ref().map(|p| p.best.start.clone()),
        ];
        let mut starts = starts.into_iter().flatten();
        let Some(best) = starts.next() else {
            return Err(Error::input(
                "reference",
                "none",
                "panels or compressed bodies",
            ));
        };
        let felt = felt(&best.added_mass, &best.mass);
        let (free, left_out) = (best.mass.nrows(), best.mass.nrows() - felt.len());
        if left_out > 0 {
            notes.push(format!(
                "{left_out} of {free} coordinates move next to no water (a round body's spin): M_f is \
                 compared without them"
            ));
        }
        let horizon = limits.steps as f64 * scene.time_step;
        let others = starts.next();
        let moving_differs_by =
            others.and_then(|s| matrix_error(&s.added_mass, &best.added_mass, &felt));
        let mut out = Self {
            said: report::Reference {
                added_mass: match (&panels, &probes) {
                    (None, Some(p)) => report::Quantity {
                        what: p.said.clone(),
                        error_estimate: p.estimate(|a, b| {
                            matrix_error(&a.start.added_mass, &b.start.added_mass, &felt)
                        }),
                    },
                    (panels, _) => report::Quantity {
                        what: panels.as_ref().map_or_else(String::new, |p| p.said.clone()),
                        error_estimate: panels.as_ref().and_then(|p| p.estimate(&felt)),
                    },
                },
                moving_differs_by,
                acceleration: None,
                end_state: None,
                horizon_seconds: horizon,
                seconds: 0.0,
                notes,
            },
            added_mass: best.added_mass.clone(),
            felt,
            motion: None,
            horizon,
        };
        if let Some(probes) = probes {
            out.set_motion(scene, probes)?;
        }
        out.said.finish();
        out.said.seconds = begin.elapsed().as_secs_f64();
        Ok(out)
    }

    fn set_motion(&mut self, scene: &Scene, probes: Probes) -> Result<()> {
        let best = &probes.best;
        let simulator = isolated(scene)?;
        let free = free(&simulator);
        let weights = Weights::new(&simulator, &free);
        let excursion = Excursion::new(&best.path, &weights);
        let mass = best.start.mass.clone();
        // Whether the scene's own forces accelerate anything at the start.
        let rate = norm(&simulator.start().1.select_rows(&free), &mass) / self.horizon;
        let gravity = scene.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        let least = NEGLIGIBLE * (rate + gravity * mass.diagonal().sum().sqrt());
        let none = DVector::zeros(free.len());
        let estimate = |extra: &DVector<f64>| {
            probes.estimate(|a, b| {
                let (a, b) = (a.start.acceleration(extra)?, b.start.acceleration(extra)?);
                vector_error(&a, &b, &mass)
            })
        };
        let size = best
            .start
            .acceleration(&none)
            .map_or(0.0, |a| norm(&a, &mass));
        let own = size > least && estimate(&none).is_none_or(|e| e < VAGUE);
        let (extra, how) = if own {
            (none, "under the scene's own forces")
        } else {
            let how = "under a pseudo-random force, as next to nothing accelerates the bodies then";
            (
                pseudo_random_force(&mass) * if rate > 0.0 { rate } else { 1.0 },
                how,
            )
        };
        let Some(acceleration) = best.start.acceleration(&extra) else {
            return Err(Error::Unresolved {
                place: "mass matrix of the reference".into(),
                quantity: "smallest eigenvalue".into(),
                value: mass.symmetric_eigenvalues().min(),
                limit: 0.0,
                remedy: "give massless bodies mass".into(),
            });
        };
        self.said.acceleration = Some(report::Quantity {
            what: format!("{}; at the start, {how}", probes.said),
            error_estimate: estimate(&extra),
        });
        if excursion.any() {
            self.said.end_state = Some(report::Quantity {
                what: format!(
                    "{}; rk4 with steps of {} s",
                    probes.said,
                    report::short(best.path.time_step)
                ),
                error_estimate: probes
                    .estimate(|a, b| end_error(&a.path, &b.path, &weights, &excursion)),
            });
        } else {
            let note = "nothing moves within the horizon: end states aren't compared";
            self.said.notes.push(note.into());
        }
        self.motion = Some(Motion {
            mass,
            path: probes.best.path,
            extra,
            acceleration,
            weights,
            excursion,
        });
        Ok(())
    }

    /// Time over which end states are compared, s.
    pub fn horizon(&self) -> f64 {
        self.horizon
    }

    /// Whether there is an end state to compare with.
    pub fn moves(&self) -> bool {
        self.said.end_state.is_some()
    }

    /// Error of M_f.
    pub fn added_mass_error(&self, start: &Start) -> Option<f64> {
        matrix_error(&start.added_mass, &self.added_mass, &self.felt)
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
        end_error(path, &motion.path, &motion.weights, &motion.excursion)
    }
}

fn isolated(scene: &Scene) -> Result<Simulator> {
    Simulator::new(
        scene,
        Settings::default().fidelity(Fidelity::Isolated).faces(80),
    )
}

/// Refuses scenes in which there is nothing to compare.
fn check(scene: &Scene) -> Result<()> {
    if scene.fluid.density <= 0.0 {
        return Err(Error::input(
            "fluid.density",
            scene.fluid.density,
            "must be above zero: without water all fidelities are the same",
        ));
    }
    if free(&isolated(scene)?).is_empty() {
        return Err(Error::input(
            "joints that forces move at the start",
            0,
            "give at least one body a joint that is neither locked, held nor driven",
        ));
    }
    Ok(())
}

fn noted<T>(found: Result<T>, what: &str, notes: &mut Vec<String>) -> Option<T> {
    match found {
        Ok(found) => Some(found),
        Err(error) => {
            notes.push(format!("no reference from {what}: {error}"));
            None
        }
    }
}

/// Runs levels one after another while the next, `growth` times as dear, is expected to end in time;
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

fn shapes(scene: &Scene) -> impl Iterator<Item = &Shape> {
    scene.bodies.iter().filter_map(|b| b.shape.as_ref())
}

/// Whether a shape's number of faces can be chosen.
fn refinable(shape: &Shape) -> bool {
    !shape.is_mesh()
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

    #[test]
    fn scenes_without_anything_to_compare_are_refused() {
        use crate::scene::{Body, Fluid};
        let mut scene = Scene::new(Fluid::none());
        scene.add(Body::new(Shape::sphere(1.0)).density(998.0));
        assert!(
            check(&scene)
                .unwrap_err()
                .to_string()
                .contains("fluid.density")
        );
        scene.fluid = Fluid::fresh_water();
        assert!(check(&scene).is_ok());
        scene.bodies[0].locked = true;
        assert!(check(&scene).unwrap_err().to_string().contains("joints"));
    }
}
