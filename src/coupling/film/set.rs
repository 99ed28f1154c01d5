//! The films of all pairs of bodies, and of bodies and rigid walls.

use super::placed::{MovingFilm, PlacedFilm};
use super::surface::FilmSurface;
use super::{Apart, Beside, Extent, Film, Shares, Side};
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::Exclusions;
use crate::error::in_order;
use crate::geometry::{Image, Opposite, Other, Solid, TriMesh, Wall, WallSurface};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// Faces of a curved shape from which on there are enough for a film; they lie in one another else.
const ENOUGH: usize = 10_000;
/// The same of others. At an edge more of them wouldn't help (docs/accuracy-coupled.md), and fewer are far too stiff.
const ENOUGH_FLAT: usize = 1_000;

/// What films see of a body: the faces that they may be solved on, and what others' faces are opposite to.
#[derive(Clone)]
pub(crate) struct FilmBody {
    pub surface: Arc<FilmSurface>,
    opposite: Arc<Opposite>,
    /// Whether it may have flat faces.
    flat: bool,
}

impl FilmBody {
    /// Of each body, from its surface in its own frame, and its shape by formula where it has one; the `same` ones share theirs. Where faces are few for
    /// a film they are split into four up to as many times as `splits` says of a body.
    pub fn all(
        surfaces: &[(&TriMesh, Option<&Solid>)],
        splits: impl Fn(usize) -> usize,
        same: impl Fn(usize, usize) -> bool,
    ) -> Vec<Self> {
        let mut out: Vec<Self> = Vec::with_capacity(surfaces.len());
        for (b, (mesh, solid)) in surfaces.iter().enumerate() {
            out.push(match (0..b).find(|a| same(*a, b)) {
                Some(a) => out[a].clone(),
                None => {
                    let (mesh, finer) = split(mesh, *solid, splits(b));
                    Self {
                        surface: Arc::new(FilmSurface {
                            finer,
                            ..FilmSurface::new(&mesh, solid.is_some())
                        }),
                        opposite: Arc::new(Opposite::of_body(*solid, &mesh)),
                        flat: solid.is_none_or(Solid::has_faces),
                    }
                }
            });
        }
        out
    }
}

/// A finer mesh, or of the curved shape that it stands for, and its edges over those that it had.
fn split<'m>(mesh: &'m TriMesh, solid: Option<&Solid>, times: usize) -> (Cow<'m, TriMesh>, f64) {
    let (mut out, mut finer) = (Cow::Borrowed(mesh), 1.0);
    let curved = solid.filter(|solid| solid.is_curved());
    let enough = curved.map_or(ENOUGH_FLAT, |_| ENOUGH);
    for _ in 0..times {
        if out.faces().len() >= enough {
            break;
        }
        let split = out.split();
        out = Cow::Owned(match curved {
            None => split,
            Some(solid) => split.moved(|x| {
                let field = solid.field(x);
                x - field.distance * field.gradient
            }),
        });
        finer *= 0.5;
    }
    (out, finer)
}

/// All films that there may be.
#[derive(Clone, Default)]
pub(crate) struct Films(Vec<Film>);

impl Films {
    /// From the gaps, one a body, m, below which it isn't resolved.
    ///
    /// # Errors
    /// A wall without normal.
    pub fn new(
        bodies: &[FilmBody],
        reaches: &[f64],
        shares: &Shares,
        walls: &[Wall],
    ) -> Result<Self> {
        let film = |body: usize, other, opposite: &Arc<Opposite>, reach: f64| {
            let between = (bodies[body].surface.clone(), opposite.clone());
            Film::new(body, other, between, reach, shares)
        };
        let mut out = Vec::new();
        let rigid = |wall: &&Wall| wall.surface == WallSurface::Rigid;
        let everywhere = shares.in_corners || walls.iter().filter(rigid).count() < 2;
        for (w, wall) in walls.iter().enumerate() {
            if rigid(&wall) {
                let image = Image::of_walls(std::slice::from_ref(wall))?[1];
                let plane = Arc::new(Opposite::of_wall(wall.half_space(w)?));
                let all = reaches.iter().enumerate();
                let all = all.filter(|(b, _)| everywhere || !bodies[*b].flat);
                out.extend(all.map(|(b, reach)| film(b, Side::Wall(image), &plane, *reach)));
            }
        }
        for a in 0..bodies.len() {
            for b in a + 1..bodies.len() {
                // The smaller one's faces lie within the gap.
                let larger = bodies[b].surface.size < bodies[a].surface.size;
                let (own, other) = if larger { (b, a) } else { (a, b) };
                let reach = reaches[a].max(reaches[b]);
                out.push(film(own, Side::Body(other), &bodies[other].opposite, reach));
            }
        }
        Ok(Self(out))
    }

    /// Drops those between bodies that don't feel each other.
    pub fn exclude(&mut self, pairs: &Exclusions) {
        self.0.retain(|film| match film.other {
            Side::Body(b) => !pairs.contains(film.body, b),
            Side::Wall(_) => true,
        });
    }

    /// Where each is, by the numbers of bodies and walls.
    ///
    /// # Errors
    /// A wall without normal.
    pub fn extents(&self, walls: &[Wall]) -> Result<Vec<Extent>> {
        let mut images = Vec::with_capacity(walls.len());
        for wall in walls {
            images.push(Image::of_walls(std::slice::from_ref(wall))?[1]);
        }
        let extent = |film: &Film| {
            let other = match film.other {
                Side::Body(b) => Other::Body(b),
                Side::Wall(image) => Other::Wall(images.iter().position(|i| *i == image)?),
            };
            Some(Extent {
                body: film.body,
                other,
                reach: film.width.reach,
                finer: film.surface.finer,
            })
        };
        Ok(self.0.iter().filter_map(extent).collect())
    }

    /// The films at the poses, for a basis of body-frame twists; none of gaps that are wide. `names` are those of the bodies, for messages.
    ///
    /// # Errors
    /// Bodies that touch.
    pub fn place(
        &self,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        names: &[String],
    ) -> Result<PlacedFilms<'_>> {
        let place = |film| {
            let placed = PlacedFilm::new(film, poses, basis);
            placed.map_err(|distance| touching(film, distance, names))
        };
        // Where all are far nobody needs to be woken.
        if self.0.iter().all(|film| film.is_far(poses)) {
            return Ok(PlacedFilms(self.0.iter().map(|_| None).collect()));
        }
        Ok(PlacedFilms(in_order(self.0.par_iter().map(place))?))
    }

    /// What films add to the impulses of body-frame twists, 6·bodies × columns, at density 1.
    ///
    /// # Errors
    /// Bodies that touch.
    pub fn momenta(
        &self,
        poses: &[Pose],
        twists: &DMatrix<f64>,
        names: &[String],
    ) -> Result<DMatrix<f64>> {
        let mut out = DMatrix::zeros(twists.nrows(), twists.ncols());
        self.place(poses, twists, names)?
            .add_impulses(twists, &mut out);
        Ok(out)
    }
}

fn touching(film: &Film, value: f64, names: &[String]) -> Error {
    let own = format!("body {:?}", names[film.body]);
    Error::Unresolved {
        place: match film.other {
            Side::Body(b) => format!("{own} and body {:?}", names[b]),
            Side::Wall(_) => format!("{own} and a wall"),
        },
        quantity: "gap in m".into(),
        value,
        limit: 0.0,
        remedy: "the water has no flow between surfaces that touch: hold them apart by contact with a gap, or end the run before".into(),
    }
}

/// All films at given poses, by their numbers; none where the gap is wide.
#[derive(Default)]
pub(crate) struct PlacedFilms<'a>(Vec<Option<PlacedFilm<'a>>>);

impl<'a> PlacedFilms<'a> {
    /// Whether there is one.
    pub fn any(&self) -> bool {
        self.0.iter().any(Option::is_some)
    }

    /// What holds the points of `source`, or of its image, off the body that sees them, if anything does.
    pub fn apart(&self, target: usize, source: usize, image: &Image) -> Option<Apart> {
        let of = |(number, placed): (usize, &Option<PlacedFilm>)| {
            Apart::of(number, placed.as_ref()?.film, (target, source), image)
        };
        self.0.iter().enumerate().find_map(of)
    }

    /// The film that holds something apart.
    pub fn of(&self, apart: &Apart) -> Option<&PlacedFilm<'a>> {
        self.0[apart.film].as_ref()
    }

    fn each<T: Send>(&self, of: impl Fn(&PlacedFilm<'a>) -> T + Sync) -> Vec<(&PlacedFilm<'a>, T)> {
        let films: Vec<_> = self.0.iter().flatten().collect();
        films.into_par_iter().map(|film| (film, of(film))).collect()
    }

    /// Adds the impulses of the twists in the columns, body frames.
    pub fn add_impulses(&self, twists: &DMatrix<f64>, out: &mut DMatrix<f64>) {
        let films = self.0.iter().flatten();
        films.for_each(|film| film.add_impulses(twists, out));
    }

    /// Adds ∇E(x, y) of body-frame twists: spatial wrenches on the bodies.
    pub fn add_wrenches(&self, x: &DVector<f64>, y: &DVector<f64>, out: &mut [Vec6]) {
        for (film, wrench) in self.each(|film| film.wrench(x, y)) {
            film.apply(&wrench, out);
        }
    }

    /// The same of combinations of the basis.
    pub fn add_basis_wrenches(
        &self,
        basis: &DMatrix<f64>,
        pair: [&DVector<f64>; 2],
        out: &mut [Vec6],
    ) {
        for (film, wrench) in self.each(|film| film.basis_wrench(basis, pair)) {
            film.apply(&wrench, out);
        }
    }

    /// The same of a combination of the basis with every column.
    pub fn add_column_wrenches(&self, x: &DVector<f64>, out: &mut [Vec<Vec6>]) {
        for (film, wrenches) in self.each(|film| film.column_wrenches(x)) {
            for (column, wrench) in &wrenches {
                film.apply(wrench, &mut out[*column]);
            }
        }
    }

    /// The films along spatial displacements of the bodies.
    pub fn along(&self, z: &[Vec6]) -> MovingFilms<'_> {
        let all = self.0.par_iter();
        MovingFilms(all.map(|film| film.as_ref()?.along(z)).collect())
    }
}

/// All films along a displacement.
pub(crate) struct MovingFilms<'a>(Vec<Option<MovingFilm<'a>>>);

impl<'a> MovingFilms<'a> {
    /// The film that holds something apart.
    pub fn of(&self, apart: &Apart) -> Option<&MovingFilm<'a>> {
        self.0[apart.film].as_ref()
    }

    /// The water in all films, for body-frame twists (6·bodies), and as these gain `rates` where that is given.
    pub fn water(&self, twists: &DVector<f64>, rates: Option<&DVector<f64>>) -> Vec<Beside> {
        let films = self.0.iter().flatten();
        films.map(|film| film.water(twists, rates)).collect()
    }

    /// Adds the rate of the impulses of body-frame twists that stay as they are.
    pub fn add_impulse_rate(&self, twists: &DVector<f64>, out: &mut DVector<f64>) {
        for film in self.0.iter().flatten() {
            film.add_impulse_rate(&film.flow(twists), out);
        }
    }

    /// Adds the wrenches of the first of one or two columns of twists with the last, their rates, and the rates of the impulses of each.
    pub fn add_tangent(
        &self,
        twists: &[&DVector<f64>],
        z: &[Vec6],
        (gradient, rate): (&mut [Vec6], &mut [Vec6]),
        impulses: &mut [DVector<f64>],
    ) {
        for film in self.0.iter().flatten() {
            let flows: Vec<_> = twists.iter().map(|x| film.flow(x)).collect();
            let (w, dw) = film.wrench(&flows[0], &flows[flows.len() - 1]);
            film.placed.apply(&w, gradient);
            film.apply_rate((&w, &dw), z, rate);
            for (impulse, flow) in impulses.iter_mut().zip(&flows) {
                film.add_impulse_rate(flow, impulse);
            }
        }
    }
}
