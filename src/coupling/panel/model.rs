//! What the coupled panels consist of.

use crate::adjoint::lie::Mat6;
use crate::boundary::PanelBoundary;
use crate::boundary::panel::{MassSlopes, check_size};
use crate::coupling::full::SolveSettings;
use crate::coupling::settings::{check_limits, end, ranges};
use crate::coupling::{Exclusions, ShapeDirection};
use crate::geometry::{HalfSpace, Image, Wall};
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// What the coupled panels consist of, whoever computes with them: all that doesn't change with the poses.
#[derive(Clone)]
pub struct PanelModel {
    /// The bodies, each in its own frame; those of equal shape share one.
    pub bodies: Vec<Arc<PanelBoundary>>,
    /// For messages: bodies of equal shape share their panels.
    pub(super) names: Vec<String>,
    /// Images that the walls make, in the world frame; the identity first.
    pub images: Vec<Image>,
    pub(super) walls: Vec<HalfSpace>,
    /// How the system is solved.
    pub settings: SolveSettings,
    /// Panels of each body.
    pub faces: Vec<Range<usize>>,
    /// Pairs of bodies that don't feel each other but by images.
    pub excluded: Exclusions,
    /// What each body's own panels lack of its added mass, body frame.
    lacking: Vec<Mat6>,
    /// Whether that added mass is known.
    known: Vec<bool>,
    /// How bodies change with the shape parameters.
    shapes: Arc<Vec<ShapeDirection>>,
    /// Of each of them, the rate of what the body's own panels lack.
    lacking_rates: Arc<Vec<Mat6>>,
    /// Memory of blocks that no system uses any more: to ask the operating system for it again takes as long as filling it.
    pub(super) spare: Arc<Mutex<Vec<Vec<f64>>>>,
}

impl PanelModel {
    /// As [`PanelCoupled::new`](super::PanelCoupled::new).
    ///
    /// # Errors
    /// As there.
    pub(super) fn new(
        bodies: Vec<Arc<PanelBoundary>>,
        walls: &[Wall],
        excluded: Exclusions,
        settings: SolveSettings,
    ) -> Result<Self> {
        check_limits(settings.tolerance, settings.max_iterations)?;
        let faces = ranges(bodies.iter().map(|b| b.faces.len()));
        check_size(&format!("{} bodies", bodies.len()), end(&faces))?;
        excluded.check(bodies.len())?;
        Ok(Self {
            images: Image::of_walls(walls)?,
            walls: Wall::half_spaces(walls)?,
            lacking: vec![Mat6::zeros(); bodies.len()],
            known: vec![false; bodies.len()],
            names: bodies.iter().map(|b| b.name.clone()).collect(),
            bodies,
            settings,
            faces,
            excluded,
            shapes: Arc::default(),
            lacking_rates: Arc::default(),
            spare: Arc::default(),
        })
    }

    /// Names the bodies, for messages.
    pub(super) fn rename(&mut self, names: &[String]) {
        let given = self.names.iter_mut().zip(names);
        given.for_each(|(own, name)| own.clone_from(name));
    }

    /// Sets the added mass of each body in unbounded fluid where it is known.
    pub(super) fn know(&mut self, known: &[Option<Mat6>]) {
        for (own, known) in self.known.iter_mut().zip(known) {
            *own = known.is_some();
        }
        for ((lacking, body), known) in self.lacking.iter_mut().zip(&self.bodies).zip(known) {
            *lacking = known.map_or_else(Mat6::zeros, |known| known - body.added_mass);
        }
    }

    /// Sets how bodies change with shape parameters, after what is known of their added mass.
    ///
    /// # Errors
    /// [`Error::Input`] for a body that doesn't exist, velocities that aren't one for each vertex, and a body whose added mass is known, but not how it changes.
    pub(super) fn change(&mut self, shapes: Vec<ShapeDirection>) -> Result<()> {
        let mut slopes: HashMap<usize, MassSlopes> = HashMap::new();
        let mut rates = Vec::with_capacity(shapes.len());
        for (p, shape) in shapes.iter().enumerate() {
            let bad = |field: &str, value: String, expected: String| {
                let place = format!("shape parameter {p}: {field}");
                Err(Error::input(place, value, expected))
            };
            let Some(body) = self.bodies.get(shape.body) else {
                let expected = format!("one of {} bodies, counted from 0", self.bodies.len());
                return bad("body", shape.body.to_string(), expected);
            };
            let (given, vertices) = (shape.vertices.len(), body.panels().vertices().len());
            if given != vertices {
                let expected = format!("one for each of the mesh's {vertices} vertices");
                return bad("velocities", given.to_string(), expected);
            }
            rates.push(match (self.known[shape.body], shape.added_mass) {
                (false, _) => Mat6::zeros(),
                (true, Some(rate)) => {
                    let own = slopes.entry(shape.body);
                    let own = own.or_insert_with(|| body.added_mass_slopes());
                    rate - own.along(&shape.vertices)
                }
                (true, None) => {
                    let expected = "its rate, as the added mass itself is given".to_string();
                    return bad("added mass", "none".into(), expected);
                }
            });
        }
        self.shapes = Arc::new(shapes);
        self.lacking_rates = Arc::new(rates);
        Ok(())
    }

    /// How bodies change with the shape parameters.
    pub fn shapes(&self) -> &[ShapeDirection] {
        &self.shapes
    }

    /// Of each of them, the rate of what the body's own panels lack of its added mass.
    pub(super) fn lacking_rates(&self) -> &[Mat6] {
        &self.lacking_rates
    }

    /// Number of panels of all bodies.
    pub fn rows(&self) -> usize {
        end(&self.faces)
    }

    /// What the bodies' own panels lack of their impulses, 6·bodies × k, for twists.
    pub fn lacking(&self, twists: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = twists.clone();
        for (b, lacking) in self.lacking.iter().enumerate() {
            let own = lacking * twists.rows(6 * b, 6);
            out.rows_mut(6 * b, 6).copy_from(&own);
        }
        out
    }
}
