//! M_f by coupled panels at growing resolutions.
//!
//! Where shapes have a formula those are extrapolated from two meshes already, and in what order the rest of their error
//! falls depends on shapes and gaps. So the finest resolution is the reference, and what the last refinement changed its error:
//! with twice the faces that is no less than the error that is left, where the refinement halves it.

use super::{Limits, climb};
use crate::Result;
use crate::scene::{Preset, Scene};
use crate::simulate::{Fidelity, Method, Settings, Simulator};
use crate::tradeoff::compare::matrix_error;
use crate::tradeoff::progress::Watch;
use crate::tradeoff::shapes::{refinable, shapes};
use crate::tradeoff::start::Start;
use nalgebra::DMatrix;
use std::time::Instant;

/// Faces per body, one after another: icosahedra with edges in 5, 7, 10, 14, 20 parts, whose meshes
/// are alike.
const FACES: [usize; 5] = [500, 980, 2000, 3920, 8000];
/// How the time grows with each of them.
const GROWTH: f64 = 6.0;
/// Numbers of faces with a smaller ratio tell nothing of the error.
const APART: f64 = 1.2;

/// The best M_f, and the one before it, for the estimate of its error.
pub(super) struct Panels {
    pub best: Start,
    pub description: String,
    before: Option<DMatrix<f64>>,
}

struct Level {
    /// Asked for, of each body.
    asked: usize,
    /// Of all bodies.
    faces: usize,
    /// Of those whose number can be chosen.
    chosen: usize,
    start: Start,
}

impl Level {
    fn new(scene: &Scene, asked: usize) -> Result<Self> {
        let settings = Settings::preset(Preset::Default)
            .fidelity(Fidelity::Full)
            .method(Method::Panel)
            .faces(asked);
        let simulator = Simulator::new(scene, settings)?;
        let names = simulator.names();
        let shapes = scene.bodies.iter().map(|b| b.shape.as_ref());
        let chosen = |name: &String| {
            let mut named = names.iter().zip(shapes.clone());
            named.any(|(n, shape)| n == name && shape.is_some_and(refinable))
        };
        let bodies = simulator.discretisation().iter();
        Ok(Self {
            asked,
            faces: simulator.faces(),
            chosen: bodies.filter(|d| chosen(&d.body)).map(|d| d.faces).sum(),
            start: Start::values(&simulator)?,
        })
    }

    /// Whether it has so many more faces than another that their difference tells of the error.
    fn finer_than(&self, other: &Self) -> bool {
        self.chosen > other.chosen && self.chosen as f64 >= APART * other.chosen as f64
    }
}

impl Panels {
    pub fn new(scene: &Scene, limits: &Limits, until: Instant, watch: &mut Watch) -> Result<Self> {
        let mut levels = match limits.faces {
            Some(n) => vec![n.div_ceil(2), n],
            None => FACES.to_vec(),
        };
        if !shapes(scene).any(refinable) {
            levels.truncate(1);
        }
        let mut found = climb(levels, 2, GROWTH, until, |asked| {
            let level = Level::new(scene, asked)?;
            watch.advance()?;
            Ok(level)
        })?;
        let finest = found.swap_remove(found.len() - 1);
        let before = found.into_iter().rfind(|level| finest.finer_than(level));
        let by = "coupled panels (full, panel)";
        let mut description = match &before {
            Some(before) => format!(
                "{by}, {} faces a body; its error from the same with {}",
                finest.asked, before.asked
            ),
            None => format!("{by}, {} faces in all", finest.faces),
        };
        if !shapes(scene).all(refinable) {
            description += "; meshes from files are taken as they are";
        }
        Ok(Self {
            best: finest.start,
            description,
            before: before.map(|level| level.start.added_mass),
        })
    }

    /// Estimate of the error over the rows that mean something.
    pub fn estimate(&self, significant: &[usize]) -> Option<f64> {
        matrix_error(self.before.as_ref()?, &self.best.added_mass, significant)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Body, Fluid, Shape};
    use crate::tradeoff::compare::significant;
    use std::ops::ControlFlow;

    fn scene(bodies: &[(Shape, f64)]) -> Scene {
        let mut scene = Scene::new(Fluid::fresh_water());
        for (shape, x) in bodies {
            scene.add(Body::new(shape.clone()).density(998.0).at([*x, 0.0, 0.0]));
        }
        scene
    }

    fn panels(scene: &Scene, faces: usize) -> (Panels, Vec<usize>) {
        let limits = Limits {
            seconds: 1e-3,
            faces: Some(faces),
            steps: 1,
        };
        let mut on = |_| ControlFlow::Continue(());
        let until = limits.until(std::time::Duration::ZERO);
        let panels = Panels::new(scene, &limits, until, &mut Watch::new(&mut on)).unwrap();
        let rows = significant(&panels.best.added_mass, &panels.best.mass);
        (panels, rows)
    }

    /// Against Lamb's closed forms.
    #[test]
    fn what_is_said_of_the_error_is_near_it() {
        for shape in [
            Shape::sphere(0.1),
            Shape::ellipsoid([0.1, 0.05, 0.1]),
            Shape::ellipsoid([0.2, 0.05, 0.1]),
        ] {
            let scene = scene(&[(shape.clone(), 0.0)]);
            let settings = Settings::preset(Preset::Default)
                .fidelity(Fidelity::Isolated)
                .method(Method::Exact);
            let exact = Start::values(&Simulator::new(&scene, settings).unwrap()).unwrap();
            for faces in [320, 980, 2000] {
                let (panels, rows) = panels(&scene, faces);
                let said = panels.estimate(&rows).unwrap();
                let off = matrix_error(&exact.added_mass, &panels.best.added_mass, &rows).unwrap();
                println!("{shape:?}, {faces} faces: {off:.2e}, said {said:.2e}");
                assert!(off < 1.5 * said && said < 8.0 * off, "{shape:?}, {faces}");
            }
        }
    }

    /// Beside a large mesh as it is, the faces that can be chosen still tell of the error.
    #[test]
    fn meshes_that_stay_hide_no_refinement() {
        let mesh = crate::shape::build(&Shape::sphere(0.2).faces(1280), "".as_ref(), None).unwrap();
        let vertices: Vec<[f64; 3]> = mesh.vertices().iter().map(|x| (*x).into()).collect();
        let mesh = Shape::triangles(vertices, mesh.faces().to_vec());
        let scene = scene(&[(mesh, 0.0), (Shape::sphere(0.1), 0.4)]);
        let (panels, rows) = panels(&scene, 80);
        let said = panels.description.as_str();
        assert!(said.contains("80 faces a body"), "{said}");
        assert!(said.contains("taken as they are"), "{said}");
        assert!(panels.estimate(&rows).is_some_and(|e| e > 1e-5));
    }
}
