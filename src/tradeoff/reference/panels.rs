//! M_f by coupled panels at growing resolutions.
//!
//! Their error goes with h², that is with one over the number of faces N, so two resolutions give
//!
//! ```text
//! M = M₂ + (M₂ − M₁)/((N₂/N₁)^p − 1)          p = 1, or 2/3 where a body has sharp edges
//! ```
//!
//! and three give two such values, whose difference is the estimate of the error. With sharp edges the order is that of the
//! leading part alone: the estimate is then no less than what p = 1 would have changed.

use super::{Limits, climb};
use crate::Result;
use crate::scene::{Preset, Scene};
use crate::simulate::{Fidelity, Method, Settings, Simulator};
use crate::tradeoff::compare::matrix_error;
use crate::tradeoff::progress::Watch;
use crate::tradeoff::shapes::{has_edges, refinable, shapes};
use crate::tradeoff::start::Start;
use nalgebra::DMatrix;
use std::time::{Duration, Instant};

/// Faces per body, one after another: icosahedra with edges in 5, 7, 10, 14, 20 parts, whose meshes
/// are alike.
const FACES: [usize; 5] = [500, 980, 2000, 3920, 8000];
/// How the time grows with each of them.
const GROWTH: f64 = 6.0;
/// Numbers of faces with a smaller ratio aren't extrapolated.
const APART: f64 = 1.2;

/// Order of the error in 1/faces of smooth bodies, and of bodies with sharp edges.
const SMOOTH: f64 = 1.0;
const SHARP: f64 = 2.0 / 3.0;

/// The best M_f and others, for the estimate of its error.
pub(super) struct Panels {
    pub best: Start,
    pub description: String,
    others: Vec<DMatrix<f64>>,
}

struct Level {
    /// Asked for, of each body.
    asked: usize,
    /// Of all bodies.
    faces: usize,
    start: Start,
}

impl Level {
    /// What the two resolutions tell of infinitely many faces.
    fn extrapolated(&self, fine: &Self, order: f64) -> DMatrix<f64> {
        let ratio = fine.faces as f64 / self.faces as f64;
        let (a, b) = (&self.start.added_mass, &fine.start.added_mass);
        b + (b - a) / (ratio.powf(order) - 1.0)
    }
}

impl Panels {
    pub fn new(scene: &Scene, limits: &Limits, until: Instant, watch: &mut Watch) -> Result<Self> {
        let (mut levels, until) = match limits.faces {
            Some(n) => (
                vec![n.div_ceil(4), n.div_ceil(2), n],
                until + Duration::from_secs(1 << 30),
            ),
            None => (FACES.to_vec(), until),
        };
        if !shapes(scene).any(refinable) {
            levels.truncate(1);
        }
        let mut found = climb(levels, 2, GROWTH, until, |asked| {
            let settings = Settings::preset(Preset::Default)
                .fidelity(Fidelity::Full)
                .method(Method::Panel)
                .faces(asked);
            let simulator = Simulator::new(scene, settings)?;
            let start = Start::values(&simulator)?;
            watch.advance()?;
            let faces = simulator.faces();
            Ok(Level {
                asked,
                faces,
                start,
            })
        })?;
        // Meshes of equal size say nothing new.
        found.dedup_by(|b, a| (b.faces as f64) < APART * a.faces as f64);
        let sharp = shapes(scene).any(has_edges);
        let order = if sharp { SHARP } else { SMOOTH };
        let by = "coupled panels (full, panel)";
        let (best, mut description, others) = match found.as_slice() {
            [.., a, b, c] => (
                b.extrapolated(c, order),
                format!(
                    "{by}, extrapolated from {} and {} faces a body; its error from the same with {} and {}",
                    b.asked, c.asked, a.asked, b.asked
                ),
                vec![a.extrapolated(b, order), b.extrapolated(c, SMOOTH)],
            ),
            [b, c] => (
                b.extrapolated(c, order),
                format!(
                    "{by}, extrapolated from {} and {} faces a body; its error from the correction",
                    b.asked, c.asked
                ),
                vec![c.start.added_mass.clone()],
            ),
            all => (
                all[0].start.added_mass.clone(),
                format!("{by}, {} faces in all", all[0].faces),
                Vec::new(),
            ),
        };
        if !shapes(scene).all(refinable) {
            description += "; meshes from files are taken as they are";
        }
        let finest = found.swap_remove(found.len() - 1).start;
        Ok(Self {
            best: Start {
                added_mass: best,
                ..finest
            },
            description,
            others,
        })
    }

    /// Estimate of the error over the rows that mean something.
    pub fn estimate(&self, significant: &[usize]) -> Option<f64> {
        let others = self.others.iter();
        let error = |other| matrix_error(other, &self.best.added_mass, significant);
        others.filter_map(error).reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_extrapolated_away() {
        for order in [SMOOTH, SHARP] {
            let level = |faces: usize| {
                let value = |x: f64| DMatrix::from_element(1, 1, x);
                let start = Start {
                    added_mass: value(3.0 + 5.0 / (faces as f64).powf(order)),
                    mass: value(1.0),
                    force: nalgebra::DVector::zeros(1),
                };
                Level {
                    asked: faces,
                    faces,
                    start,
                }
            };
            let found = level(100).extrapolated(&level(250), order);
            assert!((found[(0, 0)] - 3.0).abs() < 1e-12);
        }
    }
}
