//! Which films there are, and from which gap on they carry what the sources don't resolve.

use super::{Reduced, compress};
use crate::adjoint::lie::Pose;
use crate::coupling::film::{Film, FilmSurface, PlacedFilm, Side, Width};
use crate::geometry::{Image, Opposite, Other, Solid, TriMesh, Wall, WallSurface};
use crate::{Error, Result};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::sync::Arc;

/// The gap below which compressed sources are held apart, in the least that they resolve, times the area of a body over that of the ball of equal volume: flat bodies
/// have less room for sources.
const REACH: f64 = 1.4;
/// Power of the compression's tolerance by which gaps narrow in which its sources are right.
const FINER: f64 = 0.6;
/// How far they are held apart at contact, in that.
const FLOOR: f64 = 0.25;

impl Reduced {
    /// The same with films in the gaps between bodies, and to rigid walls, that the sources don't resolve: from the surface of each body in its own frame, and its
    /// shape by formula where it has one, and the tolerance to which it was compressed.
    ///
    /// # Errors
    /// [`Error::Input`] if there isn't one surface and tolerance for each body, or for a wall without normal.
    pub fn with_films(
        mut self,
        surfaces: &[(&TriMesh, Option<&Solid>)],
        tolerances: &[f64],
        walls: &[Wall],
    ) -> Result<Self> {
        let count = self.bodies.len();
        for (what, given) in [
            ("films: surfaces", surfaces.len()),
            ("films: tolerances", tolerances.len()),
        ] {
            if given != count {
                let expected = format!("give one for each of {count} bodies");
                return Err(Error::input(what, given, expected));
            }
        }
        let mut sides: Vec<(Arc<FilmSurface>, Arc<Opposite>)> = Vec::with_capacity(count);
        for (b, (mesh, solid)) in surfaces.iter().enumerate() {
            let shared = |a: &usize| Arc::ptr_eq(&self.bodies[*a], &self.bodies[b]);
            sides.push(match (0..b).find(shared) {
                Some(a) => sides[a].clone(),
                None => {
                    let opposite = Opposite::of_body(*solid, mesh);
                    (
                        Arc::new(FilmSurface::new(mesh, solid.is_some())),
                        Arc::new(opposite),
                    )
                }
            });
        }
        let reach = |b: usize| {
            let fit = &self.bodies[b].parts().fit;
            // Sources of a smaller tolerance are right in narrower gaps, and more than films are.
            let finer = (tolerances[b] / compress::CompressSettings::default().tolerance).min(1.0);
            REACH * sides[b].0.flatness * fit.finest() * finer.powf(FINER)
        };
        let film = |body: usize, other, opposite: &Arc<Opposite>, reach: f64| {
            let floor = FLOOR * reach;
            let between = (sides[body].0.clone(), opposite.clone());
            Film::new(body, other, between, Width { floor, reach })
        };
        let mut films = Vec::new();
        for (w, wall) in walls.iter().enumerate() {
            if wall.surface == WallSurface::Rigid {
                let image = Image::of_walls(std::slice::from_ref(wall))?[1];
                let plane = Arc::new(Opposite::of_wall(wall.half_space(w)?));
                films.extend((0..count).map(|b| film(b, Side::Wall(image), &plane, reach(b))));
            }
        }
        for a in 0..count {
            for b in a + 1..count {
                // The smaller one's faces lie within the gap.
                let larger = sides[b].0.size < sides[a].0.size;
                let (own, other) = if larger { (b, a) } else { (a, b) };
                let reach = reach(a).max(reach(b));
                films.push(film(own, Side::Body(other), &sides[other].1, reach));
            }
        }
        self.films = films;
        Ok(self)
    }

    /// The gap from which on each pair has a film, m: a body's number, and another's or a wall's.
    ///
    /// # Errors
    /// A wall without normal.
    pub(crate) fn film_reaches(&self, walls: &[Wall]) -> Result<Vec<(usize, Other, f64)>> {
        let mut images = Vec::with_capacity(walls.len());
        for wall in walls {
            images.push(Image::of_walls(std::slice::from_ref(wall))?[1]);
        }
        let reach = |film: &Film| {
            let other = match film.other {
                Side::Body(b) => Other::Body(b),
                Side::Wall(image) => Other::Wall(images.iter().position(|i| *i == image)?),
            };
            Some((film.body, other, film.width.reach))
        };
        Ok(self.films.iter().filter_map(reach).collect())
    }

    /// The films at the poses, for a basis of body-frame twists; none of gaps that are wide.
    ///
    /// # Errors
    /// Bodies that touch.
    pub(super) fn placed_films(
        &self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
    ) -> Result<Vec<Option<PlacedFilm<'_>>>> {
        let place = |film| {
            let placed = PlacedFilm::new(film, poses, basis);
            placed.map_err(|distance| self.touching(film, distance))
        };
        self.films.par_iter().map(place).collect()
    }

    /// What films add to the impulses of body-frame twists, 6·bodies × columns, at density 1.
    ///
    /// # Errors
    /// Bodies that touch.
    pub(crate) fn film_momenta(
        &self,
        poses: &[Pose],
        twists: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>> {
        let mut out = DMatrix::zeros(twists.nrows(), twists.ncols());
        let films = self.placed_films(poses, twists)?;
        (films.iter().flatten()).for_each(|film| film.add_impulses(twists, &mut out));
        Ok(out)
    }

    /// Whether there are films at the poses.
    ///
    /// # Errors
    /// Bodies that touch.
    #[cfg(feature = "gpu")]
    pub(crate) fn narrow(&self, poses: &[Pose]) -> Result<bool> {
        let none = DMatrix::zeros(6 * self.bodies.len(), 0);
        let films = self.placed_films(poses, &none)?;
        Ok(films.iter().any(Option::is_some))
    }

    fn touching(&self, film: &Film, value: f64) -> Error {
        let own = format!("body {:?}", self.names[film.body]);
        Error::Unresolved {
            place: match film.other {
                Side::Body(b) => format!("{own} and body {:?}", self.names[b]),
                Side::Wall(_) => format!("{own} and a wall"),
            },
            quantity: "gap in m".into(),
            value,
            limit: 0.0,
            remedy: "the water has no flow between surfaces that touch: hold them apart by contact with a gap, or end the run before".into(),
        }
    }
}
