//! Many bodies at some poses: what their modes and twists see of each other, and what they answer.

use super::Scattering;
use super::blocks::Blocks;
use super::elsewhere::{Changed, SummingAt};
use super::kept::{Answer, Kept};
use super::narrow::{MovingNarrow, Narrow};
use super::pairs::{Near, Pairs};
use super::parts::of_each;
use super::places::{Places, length, minus};
use super::sums::{Sums, dual};
use crate::adjoint::lie::{Mat6, Pose, Vec6};
use crate::adjoint::multipole;
use crate::coupling::isolated::Isolated;
use crate::coupling::reduced::FLUX;
use crate::solver::dot;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;
use std::ops::Range;
use std::sync::Mutex;

/// Twists of all bodies as linear functions of a few coefficients: those of joints, and of a current.
pub trait Motions: Send + Sync {
    /// Body-frame twists (6 a body) for coefficients.
    fn twists(&self, coefficients: &DVector<f64>) -> DVector<f64>;

    /// Its transpose: what body-frame impulses are worth per coefficient.
    fn transposed(&self, impulses: &DVector<f64>) -> DVector<f64>;
}

/// Who makes the sums.
enum Made {
    Here(Blocks),
    Elsewhere(Box<dyn SummingAt>),
}

/// The same, with what a sum here begins with.
pub(super) enum Making<'s> {
    Here(&'s Blocks, Sums<'s, f64>),
    Elsewhere(&'s dyn SummingAt),
}

/// Bodies as they are displaced.
pub(super) struct Moving<'s> {
    places: MovingPlaces<'s>,
    /// In narrow gaps.
    pub narrow: MovingNarrow<'s>,
}

/// Places as bodies are displaced.
enum MovingPlaces<'s> {
    Here(Places<Dual64>),
    /// By spatial twists.
    Elsewhere(&'s dyn SummingAt, Vec<Vec6>),
}

/// Many bodies at some poses.
pub struct Scattered<'a> {
    pub(super) model: &'a Scattering,
    pub(super) poses: Vec<Pose>,
    pub(super) pairs: Pairs,
    places: Places<f64>,
    making: Made,
    pub(super) narrow: Narrow<'a>,
    pub(super) motions: Box<dyn Motions + 'a>,
    pub(super) kept: Mutex<Kept>,
}

impl Scattering {
    /// Places the bodies.
    ///
    /// # Errors
    /// [`Error::Input`] for another number of poses; bodies with films that touch; a device that fails.
    pub fn place<'a>(
        &'a self,
        poses: &[Pose],
        motions: Box<dyn Motions + 'a>,
    ) -> Result<Scattered<'a>> {
        if poses.len() != self.bodies.len() {
            return Err(Error::input(
                "many bodies: poses",
                poses.len(),
                format!("must be {}, one a body", self.bodies.len()),
            ));
        }
        let places = Places::new(self, poses);
        let narrow = self.narrow(poses)?;
        let (pairs, making) = match &self.summing {
            Some(summing) => (Pairs::default(), Made::Elsewhere(summing.place(poses)?)),
            None => {
                let pairs = Pairs::new(&self.cells, &self.refused, &places, &self.levels);
                let blocks = Blocks::new(&Sums::new(self, &pairs, &places));
                (pairs, Made::Here(blocks))
            }
        };
        Ok(Scattered {
            making,
            narrow,
            pairs,
            places,
            poses: poses.to_vec(),
            model: self,
            motions,
            kept: Mutex::default(),
        })
    }
}

impl<'a> Scattered<'a> {
    /// The bodies where they don't feel each other.
    pub fn alone(&self) -> &'a Isolated {
        self.model.alone()
    }
}

impl Scattered<'_> {
    /// What moves the bodies.
    pub fn motions(&self) -> &dyn Motions {
        self.motions.as_ref()
    }

    /// The added mass of each body alone, at unit density (body frame, about its origin).
    pub fn own(&self) -> &[Mat6] {
        self.model.own()
    }

    /// The two bodies whose points are nearest to each other against their sizes, of those that are seen point by point.
    pub(super) fn nearest(&self) -> Option<[usize; 2]> {
        let model = self.model;
        let ratio = |near: &Near| {
            let [a, b] = near.bodies;
            let [x, y] = [a, b].map(|b| self.places.centres[model.cells.leaf[b]]);
            (model.sizes[a] + model.sizes[b]) / length(&minus(&x, &y))
        };
        let pairs = self.pairs.near.iter();
        let nearest = pairs.max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        // What a mirror shows of a body has its name.
        nearest.map(|near| near.bodies.map(|b| b % self.poses.len()))
    }

    fn sums(&self, blocks: &Blocks) -> Sums<'_, f64> {
        Sums::with_weights(
            self.model,
            &self.pairs,
            &self.places,
            blocks.weights.clone(),
        )
    }

    pub(super) fn making(&self) -> Making<'_> {
        match &self.making {
            Made::Here(blocks) => Making::Here(blocks, self.sums(blocks)),
            Made::Elsewhere(at) => Making::Elsewhere(at.as_ref()),
        }
    }

    /// What was made elsewhere; something else where it failed, of which [`Scattered::check`] tells.
    fn told<T>(&self, made: Result<T>, or: impl FnOnce() -> T) -> T {
        made.unwrap_or_else(|lost| {
            let mut kept = self.kept();
            kept.failed.get_or_insert((0, f64::INFINITY));
            kept.lost.get_or_insert(lost);
            or()
        })
    }

    fn no_wrenches(&self) -> Vec<Vec6> {
        vec![Vec6::zeros(); self.poses.len()]
    }

    /// [L, Ū]ᵀ ψ of every body: of the modes, and of the twists.
    pub(super) fn projected(&self, potentials: &[f64]) -> (Vec<f64>, DVector<f64>) {
        let model = self.model;
        self.parted(&model.points, potentials, |_| true)
    }

    /// What modes and twists see, from what points or numbers do that stand in these ranges.
    fn parted(
        &self,
        ranges: &[Range<usize>],
        seen: &[f64],
        points: impl Fn(usize) -> bool + Sync,
    ) -> (Vec<f64>, DVector<f64>) {
        let model = self.model;
        let of_body = |b: usize| {
            let seen = &seen[ranges[b].clone()];
            match points(b) {
                true => products(model.bodies[b].basis(), seen),
                false => seen.to_vec(),
            }
        };
        let mut modes = Vec::with_capacity(model.mode_count());
        let mut impulses = DVector::zeros(6 * model.bodies.len());
        for (b, found) in of_each(model.bodies.len(), of_body).iter().enumerate() {
            let (own, moved) = found.split_at(model.bodies[b].modes());
            modes.extend_from_slice(own);
            for (k, sum) in moved.iter().enumerate() {
                impulses[6 * b + k] = FLUX * sum;
            }
        }
        (modes, impulses)
    }

    /// α = Ū x̄ + L a.
    pub(super) fn charges(&self, twists: &DVector<f64>, modes: &[f64]) -> Vec<f64> {
        self.joined(twists, modes, |_| true)
    }

    /// The charges of some bodies' points, [a, x̄] of others.
    fn joined(
        &self,
        twists: &DVector<f64>,
        modes: &[f64],
        points: impl Fn(usize) -> bool + Sync,
    ) -> Vec<f64> {
        let model = self.model;
        let of_body = |b: usize| {
            let own = &modes[model.modes[b].clone()];
            let own = [own, &twists.as_slice()[6 * b..6 * b + 6]].concat();
            match points(b) {
                true => combined(model.bodies[b].basis(), &own),
                false => own,
            }
        };
        of_each(model.bodies.len(), of_body).concat()
    }

    /// [Lᵀ, 4π Ūᵀ] Ĝ (Ū x̄ + L a), and the impulses of films.
    pub(super) fn exchanged(
        &self,
        making: &Making<'_>,
        twists: &DVector<f64>,
        modes: &[f64],
    ) -> (Vec<f64>, DVector<f64>) {
        let (seen, mut impulses) = self.exchanged_beside_films(making, twists, modes);
        self.narrow.add_impulses(twists, &mut impulses);
        (seen, impulses)
    }

    /// [Lᵀ, 4π Ūᵀ] Ĝ (Ū x̄ + L a), by what few numbers see of each other.
    pub(super) fn exchanged_beside_films(
        &self,
        making: &Making<'_>,
        twists: &DVector<f64>,
        modes: &[f64],
    ) -> (Vec<f64>, DVector<f64>) {
        let model = self.model;
        let (mut seen, mut impulses) = match making {
            Making::Here(blocks, sums) => {
                let points = |b: usize| model.carrier(b).is_none();
                let numbers = self.joined(twists, modes, points);
                self.parted(&model.numbers, &blocks.seen(sums, &numbers), points)
            }
            Making::Elsewhere(at) => {
                let charges = self.charges(twists, modes);
                let seen = at.potentials(&charges);
                self.projected(&self.told(seen, || vec![0.0; charges.len()]))
            }
        };
        let into = (&mut seen[..], &mut impulses);
        self.narrow.add_exchanged(twists, modes, into);
        (seen, impulses)
    }

    /// 4π αᵀ δĜ α as spatial wrenches.
    pub(super) fn gradient(&self, charges: &[f64]) -> Vec<Vec6> {
        let found = match &self.making {
            Made::Here(blocks) => self.sums(blocks).gradient(charges).wrenches(),
            Made::Elsewhere(at) => self.told(at.gradient(charges), || self.no_wrenches()),
        };
        let mut found: Vec<_> = found.into_iter().map(|w| 2.0 * FLUX * w).collect();
        self.narrow.add_gradient(charges, &mut found);
        found
    }

    /// 4π α_xᵀ δĜ α_y as spatial wrenches.
    pub(super) fn pull_back(&self, x: &[f64], y: &[f64]) -> Vec<Vec6> {
        if x == y {
            return self.gradient(x);
        }
        let part = balance(x, y);
        let [sum, difference] = [part, -part].map(|part| self.gradient(&plus(x, part, y)));
        mixed(&sum, &difference, part)
    }

    /// The places as the bodies are displaced.
    pub(super) fn moving(&self, z: &[Vec6]) -> Moving<'_> {
        let places = match &self.making {
            Made::Here(_) => MovingPlaces::Here(Places::moving(self.model, &self.poses, z)),
            Made::Elsewhere(at) => MovingPlaces::Elsewhere(at.as_ref(), z.to_vec()),
        };
        let narrow = self.narrow.along(z);
        Moving { places, narrow }
    }

    /// `DĜ[Z] α`.
    pub(super) fn tangent_potentials(&self, moving: &Moving, charges: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> = match &moving.places {
            MovingPlaces::Elsewhere(at, z) => {
                let seen = at.potentials_jvp(z, charges);
                self.told(seen, || vec![0.0; charges.len()])
            }
            MovingPlaces::Here(places) => {
                let still = vec![0.0; charges.len()];
                let sums = Sums::new(self.model, &self.pairs, places);
                let seen = sums.potentials(&dual(charges, &still));
                seen.iter().map(|x| x.eps).collect()
            }
        };
        moving.narrow.add_tangent_potentials(charges, &mut out);
        out
    }

    /// 4π αᵀ δĜ α, and how that and what charges see change as bodies are displaced and the charges change.
    pub(super) fn gradient_jvp(&self, moving: &Moving, charges: &[f64], rates: &[f64]) -> Changed {
        let mut out = match &moving.places {
            MovingPlaces::Elsewhere(at, z) => {
                let none = || Changed {
                    potentials: vec![0.0; charges.len()],
                    gradient: self.no_wrenches(),
                    rate: self.no_wrenches(),
                };
                self.told(at.gradient_jvp(z, charges, rates), none)
            }
            MovingPlaces::Here(places) => {
                let sums = Sums::new(self.model, &self.pairs, places);
                let found = sums.gradient(&dual(charges, rates));
                let [gradient, rate] = found.wrenches_and_rates();
                Changed {
                    potentials: found.potentials.iter().map(|x| x.eps).collect(),
                    gradient,
                    rate,
                }
            }
        };
        for wrench in out.gradient.iter_mut().chain(&mut out.rate) {
            *wrench *= 2.0 * FLUX;
        }
        moving.narrow.add_changed(charges, rates, &mut out);
        out
    }

    /// Charges of these twists that answer further potentials with their own.
    pub(super) fn answering_beside(&self, twists: &DVector<f64>, potentials: &[f64]) -> Vec<f64> {
        let none = vec![0.0; self.model.mode_count()];
        let (mut right, _) = self.exchanged(&self.making(), twists, &none);
        let (further, _) = self.projected(potentials);
        right.iter_mut().zip(further).for_each(|(x, y)| *x += y);
        self.charges(twists, &self.scattered(&right).x)
    }

    /// Charges that bodies that stand still answer potentials with, α = L a, a = Lᵀ(ψ + Ĝ L a), and the impulses 4π Ūᵀ(ψ + Ĝ α).
    pub(super) fn answered(&self, potentials: &[f64]) -> (Vec<f64>, DVector<f64>) {
        let still = DVector::zeros(6 * self.model.bodies.len());
        let (right, impulses) = self.projected(potentials);
        let found = self.scattered(&right);
        (self.charges(&still, &found.x), impulses + found.impulses)
    }

    /// 4π Ūᵀ ψ.
    pub(super) fn impulses_of(&self, potentials: &[f64]) -> DVector<f64> {
        self.projected(potentials).1
    }

    /// M̄ x̄: with each body's own.
    pub fn impulses(&self, answer: &Answer) -> DVector<f64> {
        let mut out = answer.exchanged.clone();
        self.add_own(&answer.twists, &mut out);
        out
    }

    /// The bodies of each film and the impulses of it to their twists, body frames, unit density.
    pub fn films(&self) -> impl Iterator<Item = (Vec<usize>, &DMatrix<f64>)> {
        self.narrow.masses()
    }

    /// Adds the impulses of films.
    pub fn add_films(&self, twists: &DVector<f64>, out: &mut DVector<f64>) {
        self.narrow.add_impulses(twists, out);
    }

    /// Adds each body's own impulses.
    pub fn add_own(&self, twists: &DVector<f64>, out: &mut DVector<f64>) {
        for (b, own) in self.model.own().iter().enumerate() {
            let own: &Mat6 = own;
            let twist = twists.fixed_rows::<6>(6 * b).into_owned();
            let mut rows = out.fixed_rows_mut::<6>(6 * b);
            rows += own * twist;
        }
    }
}

/// Aᵀ x, column by column.
fn products(a: &DMatrix<f64>, x: &[f64]) -> Vec<f64> {
    let columns = a.as_slice().chunks_exact(x.len());
    multipole::vectorized(
        #[inline(always)]
        || columns.map(|column| dot(column, x)).collect(),
    )
}

/// A x.
fn combined(a: &DMatrix<f64>, x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.nrows()];
    multipole::vectorized(
        #[inline(always)]
        || {
            for (x, column) in x.iter().zip(a.as_slice().chunks_exact(out.len())) {
                for (out, a) in out.iter_mut().zip(column) {
                    *out += x * a;
                }
            }
        },
    );
    out
}

/// x + `part` y.
pub(super) fn plus(x: &[f64], part: f64, y: &[f64]) -> Vec<f64> {
    let each = x.iter().zip(y);
    each.map(|(x, y)| x + part * y).collect()
}

/// How much of y is as large as x: a sum of both as they come would hold none of the digits of one that is much smaller. One where either is nothing.
pub(super) fn balance(x: &[f64], y: &[f64]) -> f64 {
    let part = (dot(x, x) / dot(y, y)).sqrt();
    match part.is_normal() {
        true => part,
        false => 1.0,
    }
}

/// Of a quadratic form's values at x + `part` y and at x − `part` y its bilinear one's at x and y.
pub(super) fn mixed(sum: &[Vec6], difference: &[Vec6], part: f64) -> Vec<Vec6> {
    let each = sum.iter().zip(difference);
    each.map(|(s, d)| (s - d) * (0.25 / part)).collect()
}
