//! Accelerations and trajectories by compressed bodies with growing accuracy and shrinking time
//! steps; by the coupled system where gaps are too small to compress the bodies.

use super::{Limits, climb};
use crate::dynamics::Integrator;
use crate::geometry::Gap;
use crate::scene::{Preset, Scene};
use crate::simulate::{Fidelity, Method, Settings, Simulator};
use crate::tradeoff::progress::Watch;
use crate::tradeoff::shapes::{ClosedForms, closed_forms, refinable, shapes};
use crate::tradeoff::start::{Path, Start};
use crate::{Error, Result};
use std::time::Instant;

/// Accuracy of the compression, and steps for each of the scene's.
const LEVELS: [(f64, usize); 4] = [(1e-2, 1), (1e-3, 2), (1e-4, 2), (1e-5, 4)];
/// The same where nothing is compressed.
const FULL_LEVELS: [(f64, usize); 3] = [(0.0, 1), (0.0, 2), (0.0, 4)];
/// How the time grows with each of them.
const GROWTH: f64 = 3.0;
/// Faces per body at these levels, then at the last of them on finer meshes; unless they are given.
const FACES: [usize; 4] = [500, 980, 2000, 3920];
/// How the time grows with each of them: the larger part is often that of the steps, which are the same.
const MESH_GROWTH: f64 = 4.0;
/// Part of the time that is left for finer meshes.
const FOR_MESHES: f64 = 0.6;
/// Residual of the coupled system, far below the other errors.
const TOLERANCE: f64 = 1e-10;
/// Of the smallest gap that bodies come to, what they are compressed to resolve.
const ROOM: f64 = 0.6;
/// Gaps below this part of what is resolved are left to the coupled system.
const HOPELESS: f64 = 0.6;

/// What a simulation of the reference says.
#[derive(Clone)]
pub(super) struct Simulation {
    pub start: Start,
    pub path: Path,
    level: Level,
    /// Of all bodies.
    faces: usize,
    /// Smallest gap of each compressed body, and what it resolves, m.
    gaps: Vec<(f64, f64)>,
}

#[derive(Clone, Copy, Debug)]
struct Level {
    way: Way,
    accuracy: f64,
    /// Steps for each of the scene's.
    parts: usize,
    /// Per body.
    faces: usize,
    /// Smallest gap that is resolved, m.
    gap: Option<f64>,
}

/// How bodies are solved.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    Reduced(Method),
    Full,
}

/// The best simulation, and pairs whose differences estimate its error.
pub(super) struct Simulations {
    pub best: Simulation,
    pub description: String,
    pairs: Vec<(Simulation, Simulation)>,
}

impl Simulations {
    /// By the first way that works, until about then.
    pub fn new(scene: &Scene, limits: &Limits, until: Instant, watch: &mut Watch) -> Result<Self> {
        let mut why = None;
        for method in [Method::Auto, Method::Panel] {
            match Self::by(scene, Way::Reduced(method), limits, until, watch) {
                Ok(Some(found)) => return Ok(found.because(why)),
                Ok(None) => {
                    why = Some("gaps are too small to compress the bodies".to_string());
                    break;
                }
                Err(error) => {
                    why.get_or_insert(format!("compressed bodies fail: {error}"));
                }
            }
        }
        let found = Self::by(scene, Way::Full, limits, until, watch)?.map(|s| s.because(why));
        found.ok_or_else(|| Error::input("reference: levels", 0, "at least one"))
    }

    fn because(mut self, why: Option<String>) -> Self {
        self.description.extend(why.map(|why| format!(" ({why})")));
        self
    }

    /// In one way; none if gaps are too small for it.
    fn by(
        scene: &Scene,
        way: Way,
        limits: &Limits,
        until: Instant,
        watch: &mut Watch,
    ) -> Result<Option<Self>> {
        let left = until.saturating_duration_since(Instant::now());
        let mut run = |level: Level| {
            let out = Simulation::new(scene, &level, limits.steps, watch)?;
            watch.advance()?;
            Ok(out)
        };
        let levels = match way {
            Way::Reduced(_) => LEVELS.as_slice(),
            Way::Full => FULL_LEVELS.as_slice(),
        };
        let meshes = meshes(limits.faces);
        let level = |(accuracy, parts): (f64, usize), gap| Level {
            way,
            accuracy,
            parts,
            faces: meshes[0],
            gap,
        };
        let mut rough = run(level(levels[0], None))?;
        let gap = rough.needed_gap();
        if gap.is_some() {
            rough = run(level(levels[0], gap))?;
        }
        if rough.too_near() {
            return Ok(None);
        }
        let better = levels[1..].iter().map(|l| level(*l, gap));
        let early = until - left.mul_f64(FOR_MESHES);
        let mut found = vec![rough];
        found.extend(climb(better, 1, GROWTH, early, &mut run)?);
        let best = found.swap_remove(found.len() - 1);
        let mut out = Self {
            description: best.level.describe(scene),
            pairs: found.pop().map(|c| (c, best.clone())).into_iter().collect(),
            best,
        };
        if out.best.level.meshed(scene) {
            out.refine(&meshes[1..], until, run)?;
        }
        Ok(Some(out))
    }

    /// On finer meshes.
    fn refine(
        &mut self,
        finer: &[usize],
        until: Instant,
        mut run: impl FnMut(Level) -> Result<Simulation>,
    ) -> Result<()> {
        let levels = finer.iter().map(|faces| Level {
            faces: *faces,
            ..self.best.level
        });
        let mut found = vec![self.best.clone()];
        found.extend(climb(levels, 1, MESH_GROWTH, until, &mut run)?);
        // Patterns allow only certain numbers.
        found.dedup_by(|b, a| b.faces <= a.faces);
        if let [.., coarse, fine] = found.as_slice() {
            self.description += &format!(", {} faces a body", fine.level.faces);
            self.pairs.push((coarse.clone(), fine.clone()));
            self.best = fine.clone();
        }
        Ok(())
    }

    /// Sum over the pairs of their differences; none without pairs.
    pub fn estimate(&self, of: impl Fn(&Simulation, &Simulation) -> Option<f64>) -> Option<f64> {
        let differences = self.pairs.iter().map(|(a, b)| of(a, b));
        differences
            .sum::<Option<f64>>()
            .filter(|_| !self.pairs.is_empty())
    }
}

/// Faces per body, one after another, up to what is given.
fn meshes(faces: Option<usize>) -> Vec<usize> {
    let Some(finest) = faces else {
        return FACES.to_vec();
    };
    let half = finest.div_ceil(2);
    let mut out = vec![FACES[0].min(half), half, finest];
    out.dedup();
    out
}

impl Level {
    /// Whether anything depends on the number of faces.
    fn meshed(&self, scene: &Scene) -> bool {
        let exact = self.way == Way::Reduced(Method::Auto);
        let exact = exact && closed_forms(scene) == ClosedForms::All;
        let drag = scene.bodies.iter().any(|b| b.drag.is_some());
        shapes(scene).any(refinable) && (!exact || drag)
    }

    fn describe(&self, scene: &Scene) -> String {
        let by = match (self.way, closed_forms(scene)) {
            (Way::Full, _) => return "the coupled system (full, panel)".into(),
            (Way::Reduced(Method::Panel), _) | (_, ClosedForms::None) => "panel",
            (_, ClosedForms::All) => "exact",
            (_, ClosedForms::Some) => "exact and panel",
        };
        let accuracy = self.accuracy;
        format!("compressed bodies (reduced, {by}, accuracy {accuracy:.0e})")
    }
}

impl Simulation {
    fn new(scene: &Scene, level: &Level, steps: usize, watch: &mut Watch) -> Result<Self> {
        let mut settings = Settings::preset(Preset::Default)
            .integrator(Integrator::Rk4)
            .time_step(scene.time_step / level.parts as f64)
            .faces(level.faces);
        settings.resolved_gap = level.gap;
        settings = match level.way {
            Way::Full => settings.fidelity(Fidelity::Full).tolerance(TOLERANCE),
            Way::Reduced(method) => settings
                .fidelity(Fidelity::Reduced)
                .method(method)
                .accuracy(level.accuracy),
        };
        let simulator = Simulator::new(scene, settings)?;
        let start = Start::values(&simulator)?.with_forces(&simulator)?;
        let path = Path::new(&simulator, steps * level.parts, watch)?;
        Ok(Self {
            gaps: gaps(&simulator, &path),
            faces: simulator.faces(),
            level: *level,
            start,
            path,
        })
    }

    /// What the bodies must be compressed to resolve, if that is less than they do by default.
    fn needed_gap(&self) -> Option<f64> {
        let tight = self.gaps.iter().filter(|(gap, to)| ROOM * gap < *to);
        let smallest = tight.map(|(gap, _)| ROOM * gap).reduce(f64::min)?;
        (smallest > 0.0 && smallest.is_finite()).then_some(smallest)
    }

    /// Whether a body comes nearer to others than its compression resolves.
    fn too_near(&self) -> bool {
        self.gaps.iter().any(|(gap, to)| *gap < HOPELESS * to)
    }
}

/// Smallest gap of each compressed body to others, or twice that to walls, at the start and at the
/// end; with what its compression resolves.
fn gaps(simulator: &Simulator, path: &Path) -> Vec<(f64, f64)> {
    let names = simulator.names();
    let ends = [path.q.first(), path.q.last()].into_iter().flatten();
    let poses = ends.map(|q| simulator.system().tree.kinematics(q).poses);
    let all: Vec<_> = poses.flat_map(|p| simulator.gaps().all(&p)).collect();
    let nearest = |b: usize| {
        let near = all.iter().filter(|g| g.touches(b));
        near.map(Gap::image_distance).fold(f64::INFINITY, f64::min)
    };
    let compressed = simulator.discretisation().iter().filter_map(|d| {
        let b = names.iter().position(|n| *n == d.body)?;
        Some((nearest(b), d.resolved_gap?))
    });
    compressed.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Body, Fluid, Shape};
    use std::ops::ControlFlow;

    /// With faces given all levels are run, on no more faces than that.
    #[test]
    fn given_faces_go_by_no_clock() {
        let mut scene = Scene::new(Fluid::fresh_water());
        scene.gravity = [0.0, 0.0, -9.81];
        scene.add(Body::new(Shape::cuboid([0.1, 0.08, 0.06])).density(2000.0));
        let made = |faces| {
            let limits = Limits {
                seconds: 1e-3,
                faces,
                steps: 1,
            };
            let mut on = |_| ControlFlow::Continue(());
            let until = limits.until(std::time::Duration::ZERO);
            Simulations::new(&scene, &limits, until, &mut Watch::new(&mut on)).unwrap()
        };
        let given = made(Some(96));
        let level = given.best.level;
        assert_eq!((level.accuracy, level.parts), LEVELS[LEVELS.len() - 1]);
        assert_eq!((level.faces, given.pairs.len()), (96, 2));
        assert!(given.best.faces <= 110, "{}", given.best.faces);
        let timed = made(None).best.level;
        assert_eq!((timed.accuracy, timed.parts), LEVELS[1]);
        for (faces, expected) in [
            (None, &FACES[..]),
            (Some(2000), &[500, 1000, 2000]),
            (Some(600), &[300, 600]),
            (Some(1), &[1]),
        ] {
            assert_eq!(meshes(faces), expected);
        }
    }
}
