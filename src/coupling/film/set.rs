//! The films of all pairs of bodies, and of bodies and rigid walls.

use super::bodies::FilmBody;
use super::placed::{MovingFilm, PlacedFilm};
use super::{Apart, Beside, Between, Extent, Film, NoFilm, Shares, Side};
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::Exclusions;
use crate::error::in_order;
use crate::geometry::{Image, Neighbours, Opposite, Other, Wall, WallSurface};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Films that were made stay up to so many times those that are near, and a few.
const KEPT: usize = 4;
const FEW: usize = 256;
/// Faces in films from which on it pays to wake other threads.
const WORTH_WAKING: usize = 400;

/// What each film gives, in order.
fn over<'f, F: Sync, T: Send>(
    films: &'f [F],
    faces: impl Fn(&F) -> usize,
    of: impl Fn(&'f F) -> T + Sync + Send,
) -> Vec<T> {
    match films.iter().map(faces).sum::<usize>() < WORTH_WAKING {
        true => films.iter().map(of).collect(),
        false => films.par_iter().map(of).collect(),
    }
}

/// All films that there may be: those of gaps that were narrow once are kept, others made when their gaps are.
#[derive(Clone, Default)]
pub(crate) struct Films {
    bodies: Vec<FilmBody>,
    /// The gap from which on each body is resolved, m.
    reaches: Vec<f64>,
    shares: Shares,
    walls: Vec<RigidWall>,
    excluded: Exclusions,
    made: Arc<Mutex<BTreeMap<Place, Arc<Film>>>>,
}

/// Where a film is: those at walls come first, wall by wall, then pairs of bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    /// Number of the rigid wall, and the body.
    Wall(usize, usize),
    /// Two bodies, the lower number first.
    Bodies(usize, usize),
}

#[derive(Clone)]
struct RigidWall {
    /// Number of the wall.
    number: usize,
    image: Image,
    plane: Arc<Opposite>,
}

impl fmt::Debug for Films {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (bodies, walls) = (self.bodies.len(), self.walls.len());
        write!(f, "films of {bodies} bodies and {walls} rigid walls")
    }
}

impl Films {
    /// From the gaps, one a body, m, below which it isn't resolved.
    ///
    /// # Errors
    /// A wall without normal.
    pub fn new(
        bodies: Vec<FilmBody>,
        reaches: Vec<f64>,
        shares: &Shares,
        walls: &[Wall],
    ) -> Result<Self> {
        let mut rigid = Vec::new();
        for (number, wall) in walls.iter().enumerate() {
            if wall.surface == WallSurface::Rigid {
                rigid.push(RigidWall {
                    number,
                    image: Image::of_walls(std::slice::from_ref(wall))?[1],
                    plane: Arc::new(Opposite::of_wall(wall.half_space(number)?)),
                });
            }
        }
        Ok(Self {
            bodies,
            reaches,
            shares: *shares,
            walls: rigid,
            ..Self::default()
        })
    }

    /// Drops those between bodies that don't feel each other.
    pub fn exclude(&mut self, pairs: &Exclusions) {
        self.excluded = Exclusions::new(self.excluded.iter().chain(pairs.iter()));
    }

    /// Whether there may be none.
    pub fn is_empty(&self) -> bool {
        self.at_walls().chain(self.pairs()).next().is_none()
    }

    /// Whether a body may have films at walls.
    fn has_at_walls(&self, body: &FilmBody) -> bool {
        self.shares.in_corners || self.walls.len() < 2 || !body.flat
    }

    /// Those of bodies that may have films at walls.
    fn at_walls(&self) -> impl Iterator<Item = Place> {
        let bodies = self.bodies.iter().enumerate();
        let bodies = bodies.filter(|(_, body)| self.has_at_walls(body));
        let bodies: Vec<usize> = bodies.map(|(b, _)| b).collect();
        let walls = 0..self.walls.len();
        walls.flat_map(move |w| bodies.clone().into_iter().map(move |b| Place::Wall(w, b)))
    }

    /// All pairs of bodies that may have films.
    fn pairs(&self) -> impl Iterator<Item = Place> {
        let n = self.bodies.len();
        let all = (0..n).flat_map(move |a| (a + 1..n).map(move |b| (a, b)));
        let all = all.filter(|(a, b)| !self.excluded.contains(*a, *b));
        all.map(|(a, b)| Place::Bodies(a, b))
    }

    /// What a film of a body is between.
    fn kind(&self, body: usize, other: Side) -> Between {
        let own = &self.bodies[body];
        let other = match other {
            Side::Body(b) => Some(&self.bodies[b]),
            Side::Wall(_) => None,
        };
        match other {
            Some(other) if own.has_face() && other.has_face() => Between::Faces,
            other if own.flat || other.is_some_and(|other| other.flat) => Between::Edges,
            _ => Between::Round,
        }
    }

    /// The body on whose faces it is solved, what is opposite, and the gap from which on it is there, m.
    fn between(&self, place: Place) -> (usize, Side, f64) {
        let (body, other, reach) = match place {
            Place::Wall(w, b) => (b, Side::Wall(self.walls[w].image), self.reaches[b]),
            Place::Bodies(a, b) => {
                // The smaller one's faces lie within the gap.
                let larger = self.bodies[b].surface.size < self.bodies[a].surface.size;
                let (own, other) = if larger { (b, a) } else { (a, b) };
                let reach = self.reaches[a].max(self.reaches[b]);
                let farther = match self.kind(own, Side::Body(other)) {
                    Between::Faces => self.shares.farther_between_faces,
                    Between::Edges | Between::Round => 1.0,
                };
                (own, Side::Body(other), farther * reach)
            }
        };
        let size = self.bodies[body].surface.size;
        (body, other, self.shares.reach(&other, size, reach))
    }

    /// Where the film is between a body and another, or a wall by its number, if there may be one.
    pub fn extent(&self, first: usize, second: Other) -> Option<Extent> {
        let known = |b: usize| b < self.bodies.len();
        let place = match second {
            Other::Body(b) if known(first) && known(b) && first != b => {
                let (a, b) = (first.min(b), first.max(b));
                (!self.excluded.contains(a, b)).then_some(Place::Bodies(a, b))
            }
            Other::Body(_) => None,
            Other::Wall(number) => {
                let wall = self.walls.iter().position(|w| w.number == number)?;
                let here = known(first) && self.has_at_walls(&self.bodies[first]);
                here.then_some(Place::Wall(wall, first))
            }
        }?;
        let (body, _, reach) = self.between(place);
        Some(Extent {
            body,
            reach,
            finer: self.bodies[body].surface.finer,
        })
    }

    /// The gap from which on there is none anywhere, m; 0 where there may be none.
    pub fn widest(&self) -> f64 {
        match self.is_empty() {
            true => 0.0,
            false => (0..self.bodies.len())
                .map(|b| self.farthest(b))
                .fold(0.0, f64::max),
        }
    }

    /// The gap from which on a body has no film, whatever is opposite, m.
    fn farthest(&self, b: usize) -> f64 {
        match self.bodies[b].has_face() {
            true => self.shares.farther_between_faces * self.reaches[b],
            false => self.reaches[b],
        }
    }

    /// Where gaps may be narrow at these poses, in order.
    fn near(&self, poses: &[Pose]) -> Vec<Place> {
        let regions = self.bodies.iter().zip(poses).enumerate();
        let regions =
            regions.map(|(b, (body, pose))| Some(body.casing.region(pose, self.farthest(b))));
        let pairs = Neighbours::new(regions.collect());
        let apart = |a: usize, b: usize| {
            let [x, y] = [a, b].map(|b| &self.bodies[b].casing);
            x.apart_at(&poses[a], y, &poses[b])
        };
        let narrow = |(a, b): &(usize, usize)| {
            let place = Place::Bodies(*a, *b);
            !self.excluded.contains(*a, *b) && apart(*a, *b) <= self.between(place).2
        };
        let pairs = pairs.pairs().filter(narrow);
        let pairs = pairs.map(|(a, b)| Place::Bodies(a, b));
        let at_wall = |place: &Place| match place {
            Place::Wall(w, b) => {
                let surface = &self.bodies[*b].surface;
                let middle = self.walls[*w]
                    .plane
                    .field(&poses[*b].apply(&surface.center));
                let reach = self.between(*place).2 + surface.radius;
                // What isn't a number isn't far.
                middle.distance <= reach || middle.distance.is_nan()
            }
            Place::Bodies(..) => false,
        };
        self.at_walls().filter(at_wall).chain(pairs).collect()
    }

    /// Films at places that ascend, kept for the next time.
    fn films(&self, places: &[Place]) -> Vec<Arc<Film>> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        // Bodies that are stirred have met all others at last.
        if made.len() > KEPT * places.len() + FEW {
            made.retain(|place, _| places.binary_search(place).is_ok());
        }
        let film = |place: &Place| {
            made.entry(*place)
                .or_insert_with(|| self.made(*place))
                .clone()
        };
        places.iter().map(film).collect()
    }

    fn made(&self, place: Place) -> Arc<Film> {
        let (body, other, reach) = self.between(place);
        let opposite = match (other, place) {
            (Side::Wall(_), Place::Wall(w, _)) => &self.walls[w].plane,
            (Side::Body(b), _) | (_, Place::Bodies(_, b)) => &self.bodies[b].opposite,
        };
        let between = (self.bodies[body].surface.clone(), opposite.clone());
        let kind = self.kind(body, other);
        let film = Film::new(body, other, between, reach, &self.shares, kind);
        Arc::new(match other {
            Side::Body(b) => film.beside(&self.bodies[body], &self.bodies[b]),
            Side::Wall(_) => film,
        })
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
    ) -> Result<PlacedFilms> {
        let near = self.near(poses);
        // Where all are far nobody needs to be woken.
        if near.is_empty() {
            return Ok(PlacedFilms::default());
        }
        let films = self.films(&near);
        let place = |film| {
            let placed = PlacedFilm::new(film, poses, basis);
            placed.map_err(|why| refused(film, why, names))
        };
        let placed = in_order(films.par_iter().map(place))?;
        Ok(PlacedFilms::new(placed.into_iter().flatten().collect()))
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

fn refused(film: &Film, why: NoFilm, names: &[String]) -> Error {
    let own = format!("body {:?}", names[film.body]);
    let (quantity, value, remedy) = match why {
        NoFilm::Touching(gap) => (
            "gap in m",
            gap,
            "the water has no flow between surfaces that touch: hold them apart by contact with a gap, or end the run before".into(),
        ),
        NoFilm::Squeezed { gap, held } => (
            "least distance in m at which a film would hold them apart",
            held,
            format!(
                "their gap is about {gap:.3e} m, on two sides at once, as of a peg in its hole, and a film holds bodies apart in one direction: leave them more room, \
                 or use the fidelity full without films"
            ),
        ),
    };
    Error::Unresolved {
        place: match film.other {
            Side::Body(b) => format!("{own} and body {:?}", names[b]),
            Side::Wall(_) => format!("{own} and a wall"),
        },
        quantity: quantity.into(),
        value,
        limit: 0.0,
        remedy,
    }
}

/// The films at given poses, of all gaps that are narrow.
#[derive(Default)]
pub(crate) struct PlacedFilms {
    all: Vec<PlacedFilm>,
    /// Numbers of those between two bodies, the lower one first, and of those of one body and walls.
    of: BTreeMap<(usize, usize), Vec<usize>>,
}

impl PlacedFilms {
    fn new(all: Vec<PlacedFilm>) -> Self {
        let mut of = BTreeMap::<_, Vec<usize>>::new();
        for (number, placed) in all.iter().enumerate() {
            let (own, side) = placed.sides();
            let other = match side {
                Side::Body(b) => b,
                Side::Wall(_) => own,
            };
            let both = (own.min(other), own.max(other));
            of.entry(both).or_default().push(number);
        }
        Self { all, of }
    }

    /// Whether there is one.
    pub fn any(&self) -> bool {
        !self.all.is_empty()
    }

    /// Each.
    pub fn iter(&self) -> impl Iterator<Item = &PlacedFilm> {
        self.all.iter()
    }

    /// What holds the points of `source`, or of its image, off the body that sees them, if anything does.
    pub fn apart(&self, target: usize, source: usize, image: &Image) -> Option<Apart> {
        let numbers = self.of.get(&(target.min(source), target.max(source)))?;
        let of =
            |number: &usize| Apart::of(*number, &self.all[*number].film, (target, source), image);
        numbers.iter().find_map(of)
    }

    /// The film that holds something apart.
    pub fn of(&self, apart: &Apart) -> Option<&PlacedFilm> {
        self.all.get(apart.film)
    }

    /// What each gives, where so many of its `faces` are to be gone through.
    fn each<'f, T: Send>(
        &'f self,
        faces: impl Fn(&PlacedFilm) -> usize,
        of: impl Fn(&'f PlacedFilm) -> T + Sync + Send,
    ) -> impl Iterator<Item = (&'f PlacedFilm, T)> {
        self.all.iter().zip(over(&self.all, faces, of))
    }

    /// Adds the impulses of the twists in the columns, body frames.
    pub fn add_impulses(&self, twists: &DMatrix<f64>, out: &mut DMatrix<f64>) {
        let films = self.all.iter();
        films.for_each(|film| film.add_impulses(twists, out));
    }

    /// Adds ∇E(x, y) of body-frame twists: spatial wrenches on the bodies.
    pub fn add_wrenches(&self, x: &DVector<f64>, y: &DVector<f64>, out: &mut [Vec6]) {
        for (film, wrench) in self.each(PlacedFilm::faces, |film| film.wrench(x, y)) {
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
        for (film, wrench) in self.each(PlacedFilm::faces_left, |film| {
            film.basis_wrench(basis, pair)
        }) {
            film.apply(&wrench, out);
        }
    }

    /// The same of a combination of the basis with every column.
    pub fn add_column_wrenches(&self, x: &DVector<f64>, out: &mut [Vec<Vec6>]) {
        for (film, wrenches) in self.each(PlacedFilm::faces_left, |film| film.column_wrenches(x)) {
            for (column, wrench) in &wrenches {
                film.apply(wrench, &mut out[*column]);
            }
        }
    }

    /// The films along spatial displacements of the bodies.
    pub fn along(&self, z: &[Vec6]) -> MovingFilms<'_> {
        MovingFilms(over(&self.all, PlacedFilm::faces, |film| film.along(z)))
    }
}

/// All films along a displacement.
pub(crate) struct MovingFilms<'a>(Vec<Option<MovingFilm<'a>>>);

impl<'a> MovingFilms<'a> {
    /// The film that holds something apart.
    pub fn of(&self, apart: &Apart) -> Option<&MovingFilm<'a>> {
        self.0[apart.film].as_ref()
    }

    fn each<'f, T: Send>(
        &'f self,
        of: impl Fn(&'f MovingFilm<'a>) -> T + Sync + Send,
    ) -> Vec<(&'f MovingFilm<'a>, T)> {
        let films: Vec<_> = self.0.iter().flatten().collect();
        let found = over(&films, |film| film.placed.faces(), |film| of(film));
        films.into_iter().zip(found).collect()
    }

    /// The water in all films, for body-frame twists (6·bodies), and as these gain `rates` where that is given.
    pub fn water(&self, twists: &DVector<f64>, rates: Option<&DVector<f64>>) -> Vec<Beside> {
        let films = self.0.iter().flatten();
        films.map(|film| film.water(twists, rates)).collect()
    }

    /// Adds the rate of the impulses of body-frame twists that stay as they are.
    pub fn add_impulse_rate(&self, twists: &DVector<f64>, out: &mut DVector<f64>) {
        for (film, flow) in self.each(|film| film.flow(twists)) {
            film.add_impulse_rate(&flow, out);
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
        let of = |film: &MovingFilm| {
            let flows: Vec<_> = twists.iter().map(|x| film.flow(x)).collect();
            let told = film.wrench(&flows[0], &flows[flows.len() - 1]);
            (flows, told)
        };
        for (film, (flows, (w, dw))) in self.each(of) {
            film.placed.apply(&w, gradient);
            film.apply_rate((&w, &dw), z, rate);
            for (impulse, flow) in impulses.iter_mut().zip(&flows) {
                film.add_impulse_rate(flow, impulse);
            }
        }
    }
}
