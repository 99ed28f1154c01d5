//! Fewer points for bodies in the middle distance: some of a body's own, with charges that make the same potential from there on as all of them do.
//!
//! Of two bodies that are neither near nor far the exchange is then a sum over these points of both, of charges β = C α with a matrix C of each body: it is symmetric and moves with the bodies as that of
//! all points does, so that energy, forces, momenta and all derivatives are those of one energy.

use super::Levels;
use super::columns::{combined, products_of};
use super::end;
use super::parts::of_each;
use crate::adjoint::kernel;
use crate::adjoint::lie::{Vec3, Vec6};
use crate::adjoint::multipole::Number;
use crate::coupling::reduced::{FLUX, ReducedBody};
use crate::solver::{least_squares, pursuit};
use faer::Mat;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::borrow::Cow;
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

/// Places around a body at which its potential is held, for each of its points, and at least.
const CHECKS: usize = 2;
const LEAST: usize = 150;

/// Some of a body's points, that stand for all.
struct Fewer {
    /// Which.
    points: Vec<usize>,
    /// C: fewer × all points.
    onto: DMatrix<f64>,
    /// C [L, Ū]: fewer points × numbers.
    numbers: DMatrix<f64>,
}

/// What stands for a body in the middle distance.
#[derive(Clone)]
enum Stands {
    /// Its own points, of which it has few.
    All,
    Fewer(Arc<Fewer>),
    /// Nothing: fewer of its points wouldn't do.
    Nothing,
}

/// What stands for each body, and for what mirrors show of it. Points that do follow after all bodies' own in a list of both, the numbers of these after all bodies' own.
#[derive(Clone)]
pub(super) struct Standing {
    stands: Vec<Stands>,
    /// Of bodies whose own points do these.
    pub points: Vec<Range<usize>>,
    pub numbers: Vec<Range<usize>>,
}

impl Standing {
    /// For bodies whose own points and numbers are these, image after image.
    pub fn new(
        bodies: &[Arc<ReducedBody>],
        levels: &Levels,
        points: &[Range<usize>],
        numbers: &[Range<usize>],
    ) -> Self {
        let mut kinds: Vec<&Arc<ReducedBody>> = Vec::new();
        let kind = |body| {
            let known = kinds.iter().position(|k| Arc::ptr_eq(k, body));
            known.unwrap_or_else(|| {
                kinds.push(body);
                kinds.len() - 1
            })
        };
        let of: Vec<usize> = bodies.iter().map(kind).collect();
        let made = kinds.par_iter().map(|body| Stands::of(body, levels));
        let made: Vec<Stands> = made.collect();
        let stands: Vec<Stands> = of.into_iter().map(|k| made[k].clone()).collect();
        let after = |own: &[Range<usize>]| {
            let mut next = end(own);
            let each = own.iter().zip(stands.iter().cycle());
            let range = |(own, stands): (&Range<usize>, &Stands)| match stands {
                Stands::All => own.clone(),
                Stands::Nothing => next..next,
                Stands::Fewer(fewer) => {
                    next += fewer.points.len();
                    next - fewer.points.len()..next
                }
            };
            each.map(range).collect()
        };
        Self {
            points: after(points),
            numbers: after(numbers),
            stands,
        }
    }

    fn stands(&self, b: usize) -> &Stands {
        &self.stands[b % self.stands.len()]
    }

    /// Whether few points stand for two bodies, fewer than all that they have.
    pub fn stand_for(&self, pair: [usize; 2]) -> bool {
        let [a, b] = pair.map(|b| self.stands(b));
        match [a, b] {
            [Stands::Nothing, _] | [_, Stands::Nothing] | [Stands::All, Stands::All] => false,
            [Stands::Fewer(_), _] | [_, Stands::Fewer(_)] => true,
        }
    }

    /// How many all points are, those of the few among them.
    pub fn all_points(&self, own: &[Range<usize>]) -> usize {
        self.each().fold(end(own), |n, (_, f)| n + f.points.len())
    }

    /// Bodies that fewer points stand for.
    fn each(&self) -> impl Iterator<Item = (usize, &Fewer)> {
        (0..self.points.len()).filter_map(|b| match self.stands(b) {
            Stands::Fewer(fewer) => Some((b, fewer.as_ref())),
            Stands::All | Stands::Nothing => None,
        })
    }

    /// Places of all points, the few after them.
    pub fn add_places<T: Copy>(&self, own: &[Range<usize>], places: &mut Vec<T>) {
        for (b, fewer) in self.each() {
            let start = own[b].start;
            for k in &fewer.points {
                places.push(places[start + k]);
            }
        }
    }

    /// Charges of all points, those of the few after them: [α, C α].
    pub fn with_charges<'c, T: Number>(
        &self,
        own: &[Range<usize>],
        charges: &'c [T],
    ) -> Cow<'c, [T]> {
        self.with(charges, |b, fewer| {
            combined(&fewer.onto, &charges[own[b].clone()])
        })
    }

    /// Numbers of all bodies, those of the few points after them.
    pub fn with_numbers<'c>(&self, own: &[Range<usize>], numbers: &'c [f64]) -> Cow<'c, [f64]> {
        self.with(numbers, |b, fewer| {
            combined(&fewer.numbers, &numbers[own[b].clone()])
        })
    }

    fn with<'c, T: Number>(
        &self,
        all: &'c [T],
        further: impl Fn(usize, &Fewer) -> Vec<T> + Sync,
    ) -> Cow<'c, [T]> {
        let further = of_each(self.points.len(), |b| match self.stands(b) {
            Stands::Fewer(fewer) => further(b, fewer),
            Stands::All | Stands::Nothing => Vec::new(),
        });
        match further.iter().all(Vec::is_empty) {
            true => Cow::Borrowed(all),
            false => Cow::Owned([all, &further.concat()].concat()),
        }
    }

    /// The transpose of [`Standing::with_charges`]: of what all of them see, what the bodies' own points do.
    pub fn without_charges<T: Number>(&self, own: &[Range<usize>], seen: &mut Vec<T>) {
        self.without(own, &self.points, seen, |fewer| &fewer.onto);
    }

    /// The transpose of [`Standing::with_numbers`].
    pub fn without_numbers(&self, own: &[Range<usize>], seen: &mut Vec<f64>) {
        self.without(own, &self.numbers, seen, |fewer| &fewer.numbers);
    }

    fn without<T: Number>(
        &self,
        own: &[Range<usize>],
        few: &[Range<usize>],
        seen: &mut Vec<T>,
        of: impl Fn(&Fewer) -> &DMatrix<f64> + Sync,
    ) {
        let found = of_each(self.points.len(), |b| match self.stands(b) {
            Stands::Fewer(fewer) => products_of(of(fewer), &seen[few[b].clone()]),
            Stands::All | Stands::Nothing => Vec::new(),
        });
        for (own, found) in own.iter().zip(&found) {
            let own = seen[own.clone()].iter_mut();
            own.zip(found).for_each(|(out, x)| *out += *x);
        }
        seen.truncate(end(own));
    }

    /// The transpose of [`Standing::add_places`]: forces on the few are ones on the points that they are.
    pub fn without_places<T: Number>(&self, own: &[Range<usize>], forces: &mut Vec<T>) {
        for (b, fewer) in self.each() {
            for (few, point) in self.points[b].clone().zip(&fewer.points) {
                let force = forces[few];
                forces[own[b].start + point] += force;
            }
        }
        forces.truncate(end(own));
    }
}

impl Stands {
    fn of(body: &ReducedBody, levels: &Levels) -> Self {
        match body.basis().ncols() < body.points() {
            false => Self::All,
            true => Fewer::of(body, levels).map_or(Self::Nothing, |f| Self::Fewer(Arc::new(f))),
        }
    }
}

impl Fewer {
    /// Of a body that has more points than numbers; none if it would take more than these.
    fn of(body: &ReducedBody, levels: &Levels) -> Option<Self> {
        if levels.rest <= 0.0 {
            return None;
        }
        let (parts, size) = (body.parts(), body.size());
        let from = even(LEAST.max(CHECKS * body.points()));
        let from: Vec<_> = from
            .map(|way| parts.centre + way * (size / levels.fewer.most))
            .collect();
        let seen = Mat::from_fn(from.len(), body.points(), |i, j| {
            kernel::potential(&from[i], &parts.points[j])
        });
        // Each number as large as it is where it has a unit of energy; its potential times the root of the body's size has no unit.
        let unit = |k: usize| {
            let mut twist = Vec6::zeros();
            match k.checked_sub(body.modes()) {
                None => 1.0,
                Some(i) => {
                    twist[i] = 1.0;
                    (FLUX / body.displaced(&twist)).sqrt()
                }
            }
        };
        let basis = body.basis();
        let numbers = Mat::from_fn(basis.nrows(), basis.ncols(), |j, k| basis[(j, k)] * unit(k));
        let targets = &seen * &numbers;
        // A body that moves no water has no such numbers.
        if !targets.col_iter().all(|t| t.iter().all(|x| x.is_finite())) {
            return None;
        }
        let rest = levels.rest * (from.len() as f64 / size).sqrt();
        let (mut points, left) = pursuit(&seen, &targets, rest, basis.ncols());
        if left > rest || points.is_empty() {
            return None;
        }
        points.sort_unstable();
        let chosen = Mat::from_fn(from.len(), points.len(), |i, k| seen[(i, points[k])]);
        let onto = least_squares(&chosen, &seen);
        let onto = DMatrix::from_fn(points.len(), basis.nrows(), |i, j| onto[(i, j)]);
        let finite = onto.iter().all(|x| x.is_finite());
        finite.then(|| Self {
            numbers: &onto * basis,
            points,
            onto,
        })
    }
}

/// So many directions, evenly over the sphere (a spiral by the golden angle).
fn even(count: usize) -> impl Iterator<Item = Vec3> {
    let angle = PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |k| {
        let z = 1.0 - (2 * k + 1) as f64 / count as f64;
        let (sin, cos) = (angle * k as f64).sin_cos();
        let side = (1.0 - z * z).sqrt();
        Vec3::new(side * cos, side * sin, z)
    })
}
