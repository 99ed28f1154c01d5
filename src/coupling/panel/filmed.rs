//! Coupled panels, and films in the gaps that they don't resolve.
//!
//! As in [`crate::coupling::film`]: a pair nearer than its film reaches is held apart in all panels' layers on each other, and the film's own added mass is
//! added, once, whether the panels are of one mesh or extrapolated from two.

use super::PanelCoupled;
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::boundary::PanelBoundary;
use crate::coupling::film::{FilmBody, Films, PlacedFilms, Shares};
use crate::coupling::settings::check_asked;
use crate::coupling::{
    Coupling, CouplingReport, Direction, Linearise, Linearised, Momenta, Motion, MotionBar,
    Pullback, ShapeTerm, SurfacePotential, Tangent, surface,
};
use crate::geometry::{Solid, TriMesh, Wall};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// The gap below which panels are held apart, in their edges.
const REACH: f64 = 0.5;
const SHARES: Shares = Shares {
    floor: 0.25,
    floor_at_edges: 0.25,
    floor_between_faces: 0.5,
    rim: 0.37,
    rim_to_wall: 0.55,
    // Faces that are shifted or turned against each other need more room, those of the coarser mesh even more.
    farther_between_faces: 2.0,
    // Panels are no worse there.
    in_corners: false,
};
/// How often faces are split for films at most.
const SPLITS: usize = 2;

/// Coupled panels that may be held apart.
pub(super) trait HeldApart: Coupling {
    /// Bodies' panels.
    fn panels(&self) -> &PanelCoupled;

    /// Names the bodies, for messages.
    fn rename(&mut self, names: &[String]);

    /// As [`Coupling::evaluate`], of bodies as far apart as the films hold them.
    ///
    /// # Errors
    /// As there.
    fn evaluate_held(
        &self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        films: &Arc<PlacedFilms>,
    ) -> Result<Momenta>;

    /// As [`Linearise::linearise`], of those.
    ///
    /// # Errors
    /// As there.
    fn linearise_held<'a>(
        &'a self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        films: &Arc<PlacedFilms>,
    ) -> Result<Box<dyn Linearised + 'a>>;

    /// As [`Coupling::surface_potentials`] on the own panels, of those; what films have themselves isn't in them.
    ///
    /// # Errors
    /// As there.
    fn surface_potentials_held(
        &self,
        motion: &Motion,
        films: &Arc<PlacedFilms>,
    ) -> Result<Vec<SurfacePotential>>;
}

/// Coupled panels with films in narrow gaps, between bodies that feel each other and to rigid walls.
pub struct FilmedPanels {
    panels: Box<dyn HeldApart>,
    films: Films,
}

impl FilmedPanels {
    /// From the surface of each body in its own frame, and its shape by formula where it has one; bodies that share their panels share these.
    ///
    /// # Errors
    /// [`Error::Input`] if there isn't one surface for each body, or for a wall without normal.
    pub(super) fn new(
        panels: Box<dyn HeldApart>,
        surfaces: &[(&TriMesh, Option<&Solid>)],
        walls: &[Wall],
    ) -> Result<Self> {
        let model = panels.panels().model();
        let (count, given) = (model.bodies.len(), surfaces.len());
        if given != count {
            let expected = format!("give one for each of {count} bodies");
            return Err(Error::input("films: surfaces", given, expected));
        }
        let same = |a: usize, b: usize| Arc::ptr_eq(&model.bodies[a], &model.bodies[b]);
        let bodies = FilmBody::all(surfaces, |_| SPLITS, same);
        let reach = |body: &Arc<PanelBoundary>| REACH * edge(body);
        let reaches: Vec<f64> = model.bodies.iter().map(reach).collect();
        let mut films = Films::new(bodies, reaches, &SHARES, walls)?;
        films.exclude(&model.excluded);
        Ok(Self { panels, films })
    }

    /// The same with names of the bodies, for messages; those beyond the bodies are dropped.
    pub fn named(mut self, names: impl IntoIterator<Item = String>) -> Self {
        let names: Vec<String> = names.into_iter().take(self.bodies()).collect();
        self.panels.rename(&names);
        self
    }

    fn names(&self) -> &[String] {
        &self.panels.panels().model().names
    }

    /// All films that there may be.
    pub(crate) fn films(&self) -> &Films {
        &self.films
    }

    fn placed(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Arc<PlacedFilms>> {
        check_asked(self, poses, basis)?;
        Ok(Arc::new(self.films.place(poses, basis, self.names())?))
    }
}

/// Length of a panel's edges where they are shortest, m: of the twentieth part of them that is smaller than the rest.
fn edge(body: &PanelBoundary) -> f64 {
    let mut areas = body.faces.areas.clone();
    areas.sort_by(f64::total_cmp);
    let area = areas.get(areas.len() / 20).copied().unwrap_or(0.0);
    // Of an equilateral triangle.
    (4.0 * area / f64::sqrt(3.0)).sqrt()
}

impl Coupling for FilmedPanels {
    fn name(&self) -> &'static str {
        self.panels.name()
    }

    fn bodies(&self) -> usize {
        self.panels.bodies()
    }

    fn unknowns(&self) -> usize {
        self.panels.unknowns()
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        let films = self.placed(poses, basis)?;
        let held = self.panels.evaluate_held(poses, basis, &films)?;
        let mut momenta = held.momenta().clone();
        films.add_impulses(basis, &mut momenta);
        Ok(Momenta::new(momenta, held.report().clone()))
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        Some(self)
    }

    fn shape_parameters(&self) -> usize {
        self.panels.shape_parameters()
    }

    fn film_momenta(&self, poses: &[Pose], twists: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        check_asked(self, poses, twists)?;
        Ok(Some(self.films.momenta(poses, twists, self.names())?))
    }

    /// By the panels where they are.
    fn velocity(
        &self,
        poses: &[Pose],
        twists: &DVector<f64>,
        points: &[Vec3],
    ) -> Result<Option<Vec<Vec3>>> {
        self.panels.velocity(poses, twists, points)
    }

    fn surfaces(&self) -> Option<&[Arc<PanelBoundary>]> {
        self.panels.surfaces()
    }

    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        surface::check(motion, surfaces)?;
        let films = self.placed(motion.poses, &motion.columns())?;
        let mut out = self.panels.surface_potentials_held(motion, &films)?;
        surface::Held {
            films: &films,
            moving: &films.along(motion.displacement),
        }
        .add_water(motion, surfaces, &mut out);
        Ok(out)
    }

    /// # Errors
    /// Films at these poses, and as without them.
    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        surface::check(motion, surfaces)?;
        if self.placed(motion.poses, &motion.columns())?.any() {
            return Err(surface::held_apart());
        }
        self.panels.surface_potentials_vjp(motion, surfaces, bars)
    }
}

impl Linearise for FilmedPanels {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        let films = self.placed(poses, basis)?;
        let held = self.panels.linearise_held(poses, basis, &films)?;
        if !films.any() {
            return Ok(held);
        }
        let mut momenta = held.momenta().clone();
        films.add_impulses(basis, &mut momenta);
        Ok(Box::new(FilmedLinearised {
            basis: basis.clone(),
            momenta,
            films,
            held,
        }))
    }
}

/// [`FilmedPanels`] at given poses.
struct FilmedLinearised<'a> {
    held: Box<dyn Linearised + 'a>,
    films: Arc<PlacedFilms>,
    basis: DMatrix<f64>,
    momenta: DMatrix<f64>,
}

impl FilmedLinearised<'_> {
    fn twists(&self, x: Direction) -> DVector<f64> {
        match x {
            Direction::Basis(c) => &self.basis * c,
            Direction::Twist(x) => x.clone(),
        }
    }
}

impl Linearised for FilmedLinearised<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        let mut out = self.held.gradient(x, y)?;
        self.films.add_basis_wrenches(&self.basis, [x, y], &mut out);
        Ok(out)
    }

    fn gradient_columns(&self, x: &DVector<f64>) -> Result<Vec<Vec<Vec6>>> {
        let mut out = self.held.gradient_columns(x)?;
        self.films.add_column_wrenches(x, &mut out);
        Ok(out)
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        let mut rate = DVector::zeros(self.basis.nrows());
        let films = self.films.along(z);
        films.add_impulse_rate(&(&self.basis * y), &mut rate);
        Ok(self.held.gradient_along(y, z)? + self.basis.tr_mul(&rate))
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let mut out = self.held.vjp(x, y)?;
        let (x, y) = (self.twists(x), self.twists(y));
        self.films.add_wrenches(&x, &y, &mut out.wrench);
        for (twists, momentum) in [(x, &mut out.momentum_x), (y, &mut out.momentum_y)] {
            let column = DMatrix::from_column_slice(twists.len(), 1, twists.as_slice());
            let mut added = DMatrix::zeros(twists.len(), 1);
            self.films.add_impulses(&column, &mut added);
            *momentum += added.column(0);
        }
        Ok(out)
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        let mut out = self.held.hvp(x, y, z)?;
        let (x, y) = (self.twists(x), self.twists(y));
        let mut rates = [out.momentum_x, out.momentum_y];
        let into = (&mut out.gradient[..], &mut out.wrench[..]);
        self.films
            .along(z)
            .add_tangent(&[&x, &y], z, into, &mut rates);
        [out.momentum_x, out.momentum_y] = rates;
        Ok(out)
    }

    /// # Errors
    /// Films have no such derivatives.
    fn shape_vjp(&self, terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        self.held.shape_vjp(terms)
    }

    fn report(&self) -> &CouplingReport {
        self.held.report()
    }
}
